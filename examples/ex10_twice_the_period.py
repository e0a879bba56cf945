"""One more loop: an oscillator between stops before and after it doubles its period, in the phase plane.

    x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)

The motion that repeats after two load periods is found where it attracts, by time integration, and followed from there:
towards lower frequencies it ends in a limit point.

    python ex10_twice_the_period.py [figure.png]
"""

import math
import sys

import numpy as np

import suboctave as so
from suboctave.harmonic.basis import spectrum_to_real
from suboctave.timedomain import integrate

OMEGA, SETTLING = 3.0, 120  # the frequency at which it is found, and after how many load periods
PERIOD = 2.0 * math.pi / OMEGA

oscillator = so.library.reference_oscillator(p=0.55, regularization=3000.0)
parameters = oscillator.parameters

# The attractor, then one response period of it, sampled; its spectrum is a motion in the basis of period 2T.
settled = integrate(oscillator, np.zeros(2), np.array([0.0, SETTLING * PERIOD]), OMEGA, parameters)
basis = so.HarmonicBasis(2 * 15, nu=2)
times = np.arange(257) * 2.0 * PERIOD / 256
begin = np.concatenate((settled.x[-1], settled.v[-1]))
sampled = integrate(oscillator, begin, times, OMEGA, parameters)
coefficients = spectrum_to_real(np.fft.rfft(sampled.x[:-1], axis=0) / 256, basis.harmonics)
found = so.PeriodicOrbit(
    so.HarmonicBalance(oscillator, basis), coefficients, OMEGA, parameters, 0.0, adaptive=so.AdaptiveHarmonics()
)

doubled = so.frequency_response(oscillator, omega=(3.0, 2.9), start=found)
single = so.frequency_response(oscillator, omega=(4.2, 2.9))
print(doubled.bifurcations)
(fold,) = doubled.bifurcations["LP"]

if len(sys.argv) > 1:
    so.plot_phase([single.bifurcations["PD"][0], doubled.orbits[0], fold], sys.argv[1], size="double-column")

# Shooting on the same equations: the fold of the 2T motions at omega = 2.94603063, max |x| = 0.6191226 there.
assert abs(fold.omega - 2.94603063) < 1e-7
assert abs(fold.amplitude - 0.6191226) < 1e-6
