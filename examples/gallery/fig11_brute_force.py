"""Alcorta et al. 2019, Fig. 11: stroboscopic displacements over the frequency at p = 1.6, Kc = 4.2.

A scan that carries the motion on from frequency to frequency, downwards, and one that begins at rest at each. Whatever
they settle on is shown.

    python fig11_brute_force.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=1.6, Kc=4.2, j=0.0, regularization=3000.0)
scan = so.brute_force_diagram(
    oscillator, (2.3, 4.0), values=171, direction=("down", "anew"), transient=500, periods=100, workers=2
)
print(scan)

# Harmonic balance, no integration: where the period doubles, T to 2T and 2T to 4T.
response = so.frequency_response(oscillator, omega=(4.5, 2.0))
twice = so.switch_branch(max(response.bifurcations["PD"], key=lambda b: b.omega))
print(response.bifurcations, twice.bifurcations, sep="\n")
first, second = (sorted(b.omega for b in branch.bifurcations["PD"]) for branch in (response, twice))

figure = scan.plot(quantity="section", starts=["down"], size="double-column")
for doublings, colour in ((first, "#0072B2"), (second, "#E69F00")):
    for omega in doublings:
        figure.axes[0].axvline(omega, color=colour, linewidth=0.8, linestyle="--", zorder=1)
figure.savefig(figure_file(), dpi=300)

assert np.allclose(first, (2.36665, 3.84298), rtol=0.0, atol=2e-5), first
assert np.allclose(second, (2.44243, 2.89524), rtol=0.0, atol=2e-5), second
# Between them the scan that carries the motion on finds these periods, and chaos within 4T. It begins on a motion of
# 3T, which coexists, and comes back to 2T through motions of 6T and 8T.
omega, period = scan.values, scan.period[0]
for low, high, expected in ((2.3, first[0], 1), (first[0], 2.425, 2), (second[1], first[1], 2), (first[1], 3.955, 1)):
    assert (period[(omega > low - 1e-9) & (omega < high)] == expected).all(), (low, high)
assert (period[(omega > 2.855) & (omega < second[1])] == 4).all()
assert (period[(omega > 2.455) & (omega < 2.705)] == 0).all()
assert {int(p) for p in scan.period.ravel()} >= {0, 1, 2, 3, 4}
