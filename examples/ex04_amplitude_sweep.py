"""A Duffing oscillator at fixed frequency while the force grows: an S-curve with a jump up and a jump down.

    x'' + c x' + x + alpha x^3 = F cos(omega t),   omega = 1.5

The curve is followed around both folds, the unstable middle included. One harmonic (what a hand calculation keeps) puts
both jumps within a percent of the right force, but the large motions two percent too low.

    python ex04_amplitude_sweep.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file, plot_response

DAMPING, ALPHA = 0.05, 1.0
OMEGA = 1.5
FORCES = (0.0, 1.0)

system = so.library.duffing(c=DAMPING, alpha=ALPHA)
curve = so.continue_branch(system, "F", FORCES, omega=OMEGA, max_step=0.05)
by_hand = so.continue_branch(system, "F", FORCES, omega=OMEGA, max_step=0.05, harmonics=1)
print(curve)

plot_response([curve.to_xarray(), by_hand.to_xarray()], figure_file(), labels=["adaptive harmonics", "one harmonic"])

# With one harmonic, y = a^2 obeys F^2 = y [(1 - omega^2 + 3/4 alpha y)^2 + (c omega)^2]. The jump up is at the fold
# with the smaller motion, where dF^2/dy = 0. (Any textbook on nonlinear oscillations.)
detuning, cubic, loss = 1.0 - OMEGA**2, 0.75 * ALPHA, (DAMPING * OMEGA) ** 2
y = np.roots([3.0 * cubic**2, 4.0 * cubic * detuning, detuning**2 + loss]).min()
expected = np.sqrt(y * ((detuning + cubic * y) ** 2 + loss))
found = max(point.parameter("F") for point in by_hand.bifurcations["LP"])
assert abs(found / expected - 1.0) < 1e-8, (found, expected)
