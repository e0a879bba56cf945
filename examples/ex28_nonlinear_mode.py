"""How do two masses with a cubic spring vibrate by themselves, and with what do they share their energy?

The lower nonlinear mode of Kerschen, Peeters, Golinval & Vakakis, Nonlinear normal modes, Part I (Mechanical Systems
and Signal Processing 23, 2009) over its energy. At a branch point an internal resonance leaves it, in which the upper
mode takes part at twice the frequency.

    python ex28_nonlinear_mode.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

system = so.System(np.eye(2), np.zeros((2, 2)), [[2.0, -1.0], [-1.0, 2.0]], elements=[so.CubicSpring(0, 0.5)])
mode = so.nonlinear_mode(system, mode=1, amplitude=(0.01, 5.0))
print(mode)
(crossing,) = mode.bifurcations["BP"]
tongue = so.switch_branch(crossing, bounds=(1.2, 1.39))
print(tongue)

so.plot([mode, tongue], figure_file(), labels=["lower mode", "2:1 tongue"], quantity="energy")

# Shooting (no harmonic balance) puts the branch point at this frequency.
assert abs(crossing.omega - 1.281534) < 2e-6, crossing.omega
# The upper mode takes more and more of the motion, and the energy has a maximum on the way.
assert abs(tongue.harmonic(2)[-1]) > 5.0 * abs(tongue.harmonic(1)[-1])
assert abs(tongue.energy.max() - 148.66) < 0.01, tongue.energy.max()
