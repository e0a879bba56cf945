"""An element of one's own: a spring that saturates, f = F0 tanh(k u / F0).

For small motions it is a linear spring, for large ones its force stays below F0. The resonance bends to the left. An
element states how smooth its law is and gives force and derivatives as functions of arrays; `check_derivatives` holds
them against finite differences. Everything else, stability and bifurcations included, follows from that.

    python ex06_own_element.py [figure.png]
"""

import numpy as np
from scipy.integrate import quad

import suboctave as so
from suboctave.model import SharpSampling
from suboctave.pictures import figure_file

DAMPING = 0.02
PARAMETERS = {"k": 1.0, "F0": 1.0, "F": 0.03}
OMEGA = (0.3, 1.3)


class SaturatingSpring(so.Element):
    """`f = F0 tanh(w)` with `w = k u / F0`. Below, `g = 1 - tanh(w)^2` and `h = 2 g tanh(w) / F0`."""

    coefficient_names = ("k", "F0")

    def __init__(self, dof, k, F0):
        super().__init__(dof, [k, F0])

    def sampling(self, c):
        return SharpSampling(points=(0.0,), widths=(0.5 * np.pi * c[1] / c[0],))  # poles of tanh at w = +- i pi/2

    def tangent(self, u, v, c):
        t = np.tanh(c[0] * u / c[1])
        return c[1] * t, c[0] * (1.0 - t**2), None

    def curvature(self, u, v, c):
        _, _, h = self._parts(u, c)
        return -c[0] * c[0] * h, None, None

    def coefficient_tangent(self, u, v, c):
        w, g, h = self._parts(u, c)
        return np.array([u * g, np.tanh(w) - w * g]), np.array([g - c[0] * u * h, c[0] * w * h]), None

    def coefficient_curvature(self, u, v, c):
        w, _, h = self._parts(u, c)
        return np.array([[-u * u * h, u * w * h], [u * w * h, -w * w * h]])

    def _parts(self, u, c):
        w = c[0] * u / c[1]
        g = 1.0 - np.tanh(w) ** 2
        return w, g, 2.0 * g * np.tanh(w) / c[1]


spring = SaturatingSpring(dof=0, k="k", F0="F0")
report = so.check_derivatives(spring, parameters=PARAMETERS)
print(report)
assert report.ok

system = so.System(1.0, DAMPING, 0.0, [spring], [so.HarmonicLoad(dof=0, amplitude="F")], PARAMETERS)
curve = so.frequency_response(system, OMEGA)
print(curve)

curve.plot(figure_file())

# Near its peak the response vibrates like the free, undamped oscillator: from conservation of energy
# omega = 2 pi / T, T = 4 int_0^a dx / sqrt(2 V(a) - 2 V(x)), V = F0^2 / k ln cosh(k x / F0); x = a sin(s) below.
peak = np.argmax(curve.amplitude)
a, k, F0 = curve.amplitude[peak], PARAMETERS["k"], PARAMETERS["F0"]


def energy(x):
    return F0**2 / k * np.log(np.cosh(k * x / F0))


quarter = quad(lambda s: a * np.cos(s) / np.sqrt(2.0 * (energy(a) - energy(a * np.sin(s)))), 0.0, np.pi / 2)[0]
expected = 0.5 * np.pi / quarter
assert abs(curve.omega[peak] / expected - 1.0) < 1e-3, (curve.omega[peak], expected)
