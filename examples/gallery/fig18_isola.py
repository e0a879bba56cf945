"""Alcorta et al. 2019, Fig. 18: the response at j = 0.5, and the isola of twice the period beside it.

No sweep meets the isola. At omega = 2.25 three stable motions coexist.

    python fig18_isola.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=0.55, j=0.5, regularization=3000.0)
response = so.frequency_response(oscillator, omega=(3.0, 1.3))
(isola,) = so.find_isolas(oscillator, omega=(1.9, 4.2), parameter="j", bounds=(0.3, 0.7), values=[0.5])
loop = isola.at(0.5)
print(response.bifurcations)
print(loop.bifurcations)
print(f"stable motions on the isola for omega in {isola.stable_ranges(0.5)}")

so.plot([response, loop], figure_file(), size="double-column", marks=["LP", "PD"])

# Shooting (no harmonic balance): the ends of the isola and of the bistable range of the response.
for branch, expected in ((loop, (2.200149, 2.514902)), (response, (1.443072, 2.481901))):
    assert np.allclose(sorted(b.omega for b in branch.bifurcations["LP"]), expected, rtol=0.0, atol=2e-6), branch
