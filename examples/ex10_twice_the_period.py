"""One more loop: an oscillator between stops before and after it doubles its period, in the phase plane.

    x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)

The motion that repeats after two load periods is found where it attracts, by time integration, and followed from there:
towards lower frequencies it ends in a limit point.

    python ex10_twice_the_period.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=0.55, regularization=3000.0)

# From rest, 120 load periods at omega = 3 are enough to settle; the last state lies on the motion of period 2T.
settled = so.integrate(oscillator, omega=3.0, transient=120, periods=1)
doubled = so.frequency_response(oscillator, omega=(3.0, 2.9), start=settled.end, subharmonic=2)
single = so.frequency_response(oscillator, omega=(4.2, 2.9))
print(doubled.bifurcations)
(fold,) = doubled.bifurcations["LP"]

so.plot_phase([single.bifurcations["PD"][0], doubled.orbits[0], fold], figure_file(), size="double-column")

# Shooting on the same equations: the fold of the 2T motions at omega = 2.94603063, max |x| = 0.6191226 there.
assert abs(fold.omega - 2.94603063) < 1e-7
assert abs(fold.amplitude - 0.6191226) < 1e-6
