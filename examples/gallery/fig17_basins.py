"""Alcorta et al. 2019, Fig. 17: basins of attraction of three motions that coexist, one of them on an isola.

j = 0.5, 200 x 200 states. The small motion without contact, the 2T motion on the isola, and the large resonant motion.

    python fig17_basins.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=0.55, j=0.5, regularization=3000.0)
found = so.basins(oscillator, omega=2.25, box=((-2.0, 2.0), (-2.0, 2.0)))
print(found)
print(found.to_dataframe().to_string(index=False))

found.plot(figure_file(), size=(6.85, 6.4))

# Shares and largest displacements by Newmark's method over many periods in another program.
shares = {round(one.amplitude, 5): found.shares[one.name] for one in found.attractors}
assert set(shares) == {0.13544, 0.88906, 3.09017}
for amplitude, share in ((0.13544, 0.814), (0.88906, 0.1745), (3.09017, 0.0117)):
    assert abs(shares[amplitude] - share) < 0.002
assert found.contradicted == 0
