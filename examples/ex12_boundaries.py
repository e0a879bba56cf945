"""Where does the vibration double its period, and how do the response curves run through that border?

Response curves of the rattling oscillator at three gaps, the border of the period doublings over frequency and gap, and
the limit points of the doubled motions, in one picture in space. The border's highest point is the gap beyond which the
plain motion never doubles its period.

    python ex12_boundaries.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

system = so.library.reference_oscillator(p=0.55, regularization=3000.0)
curves = [so.frequency_response(system.with_parameters({"j": gap}), omega=(4.1, 2.0)) for gap in (0.0, 0.08, 0.16)]
first = curves[0].bifurcations["PD"][0]
border = so.track(first, parameter="j", bounds=(0.0, 1.0))
doubled = so.switch_branch(first)
folds = so.track(doubled.bifurcations["LP"][0], parameter="j", bounds=(0.0, 1.0))
print(border)
print(folds)

so.plot_space([*curves, doubled, border, folds], figure_file(), size="double-column")

# Shooting (no harmonic balance) puts the border's highest point at omega = 2.021701, j = 0.177129.
highest = next(e for e in border.extrema if e.parameter_name == "j")
assert abs(highest.omega - 2.021701) < 1e-5, highest
assert abs(highest.parameter("j") - 0.177129) < 1e-6, highest
# every response curve leaves its stable motions on the border
for curve in curves:
    for doubling in curve.bifurcations["PD"]:
        near = min(abs(border.omega - doubling.omega) + abs(border.parameter("j") - doubling.parameter("j")))
        assert near < 0.1, doubling
