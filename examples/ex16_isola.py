"""At which gaps does an isolated resonance of twice the period exist, and where do its frequencies end?

The rattling oscillator has sub-harmonic motions that no sweep of the frequency meets. `find_isolas` says between which
gaps: where the closed branch shrinks to a point, and where it merges with what leaves the response.

    python ex16_isola.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

system = so.library.reference_oscillator(p=0.55, regularization=3000.0)
isolas = so.find_isolas(system, omega=(1.3, 4.5), parameter="j", bounds=(0.0, 1.0))
print(isolas)
(isola,) = isolas
closed = isola.at(0.5)
print(closed.bifurcations)
print("stable between", isola.stable_ranges(0.5))

isola.plot(figure_file(), values=[0.2, 0.3, 0.4, 0.5, 0.55])

# Shooting (no harmonic balance) puts the two ends, and the limit points at j = 0.5, here:
assert abs(isola.born - 0.579889) < 2e-6, isola.born
assert abs(isola.born.omega - 2.355660) < 2e-6, isola.born
assert abs(isola.merges - 0.176829) < 2e-6, isola.merges
assert abs(isola.merges.omega - 2.023364) < 2e-6, isola.merges
low, high = sorted(point.omega for point in closed.bifurcations["LP"])
assert abs(low - 2.200149) < 2e-6, low
assert abs(high - 2.514902) < 2e-6, high
