"""An oscillator between two stops: the exact contact law against the smooth one of the literature.

    x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t),   stops at x = -1 and x = 0

The literature rounds the corner of a stop with an arctan; its sharpness s = 3000 looks like a sharp corner. Yet the
motion at the upper end of the unstable range is only a few hundredths large, and there the rounding moves the period
doubling by more than half a percent; at the lower end, where the motion is four times as large, by less.

    python ex01_rattling_oscillator.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file, plot_response

FORCE = 0.55
GAP = 0.0
SHARPNESS = 3000.0
OMEGA = (4.15, 2.2)  # the unstable range and a little more

exact, smooth = (
    so.frequency_response(so.library.reference_oscillator(p=FORCE, j=GAP, regularization=s), OMEGA)
    for s in (None, SHARPNESS)
)

print(f"{'':4}{'exact':>12}{'smooth':>12}{'moved by':>12}")
for a, b in zip(exact.bifurcations, smooth.bifurcations, strict=True):
    print(f"{a.kind:4}{a.omega:12.7f}{b.omega:12.7f}{b.omega - a.omega:+12.7f}")

names = ["exact", f"smooth, s = {SHARPNESS:g}"]
plot_response([exact.to_xarray(), smooth.to_xarray()], figure_file(), labels=names)

# Shooting (DOP853 with located contacts, variational equations), both laws: 3.99345233 - 3.96971051.
moved = smooth.bifurcations["PD"][0].omega - exact.bifurcations["PD"][0].omega
assert abs(moved - 0.0237418) < 1e-6, moved
