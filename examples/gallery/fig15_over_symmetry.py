"""Alcorta et al. 2019, Fig. 15: the period doublings over frequency and the ratio of the gaps, in space.

Beyond a ratio of 0.177129 the response never doubles its period: there the two doublings of a response meet. The
motions of twice the period go on, as an isola.

    python fig15_over_symmetry.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=0.55, regularization=3000.0)
response = so.frequency_response(oscillator, omega=(4.05, 3.9))
border = so.track(response.bifurcations["PD"][0], "j", (0.0, 1.0))
(largest,) = (e for e in border.extrema if e.parameter_name == "j")
print(border)

isolas = so.find_isolas(oscillator, omega=(1.9, 4.2), parameter="j", bounds=(0.0, 1.0), values=2)
(folds,) = (curve for curve in isolas.limit_points if curve.bifurcations["CP"])
ratios = (0.0, 0.1, 0.3, 0.45)
systems = [oscillator.with_parameters({"j": j}) for j in ratios]
curves = [so.frequency_response(system, omega=(4.2, 1.9)) for system in systems]
doubled = [so.switch_branch(curve.bifurcations["PD"][0]) for curve in curves[:2]]
loops = [loop for j in ratios[2:] for loop in isolas.at(j)]
so.plot_space([*curves, *doubled, *loops, border, folds], figure_file(), size="double-column", azimuth=-108)

# Shooting (no harmonic balance).
assert abs(largest.omega - 2.021701) < 2e-6
assert abs(largest.parameter("j") - 0.177129) < 1e-6
