"""Elements with nodes of their own: their Fourier coefficients against closed forms and brute force, at few nodes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.special import gamma

import suboctave as so
from suboctave.errors import ConvergenceError
from suboctave.harmonic import HarmonicBalance, HarmonicBasis
from suboctave.model import AdaptiveSampling, Element

OMEGA = 1.7


def state_of(element, x, nu=1, omega=OMEGA, **parameters):
    n = x.shape[1]
    system = so.System(
        np.eye(n),
        0.1 * np.eye(n),
        np.eye(n),
        elements=[element],
        loads=[so.HarmonicLoad(0, 1.0)],
        parameters=parameters,
    )
    balance = HarmonicBalance(system, HarmonicBasis(len(x) // 2, nu))
    return balance.settle(x, omega).at(x, omega)


def wave(harmonics, n=1, **amplitudes):
    """Coefficients (2 H + 1, n) of a sum of cosines, `c1=(..)` the amplitudes of the first per DOF."""
    x = np.zeros((2 * harmonics + 1, n))
    for name, values in amplitudes.items():
        k = int(name[1:])
        x[0 if k == 0 else (2 * k - 1 if name[0] == "c" else 2 * k)] = values
    return x


def test_describing_function_of_quadratic_damping():
    """The first harmonic of `c v |v|` for `a cos(omega t)` is that of a damper `8/(3 pi) c omega a`."""
    a, c = 0.6, 0.4
    force = state_of(so.QuadraticDamper(0, c), wave(1, c1=a)).force
    np.testing.assert_allclose(force[2, 0], -8.0 / (3.0 * np.pi) * c * (OMEGA * a) ** 2, rtol=1e-12)
    assert np.abs(force[:2]).max() < 1e-13


def test_a_linear_oscillator_with_quadratic_damping_at_one_harmonic():
    """Amplitude from `|k - omega^2 + i omega (d + 8/(3 pi) c omega a)| a = p`."""
    system = so.System(1.0, 0.01, 1.0, elements=[so.QuadraticDamper(0, 0.4)], loads=[so.HarmonicLoad(0, 0.3)])
    curve = so.frequency_response(system, (0.5, 1.8), harmonics=1)
    a, w = np.abs([o.harmonic(1) for o in curve.orbits]), curve.omega
    size = np.hypot(1.0 - w**2, w * (0.01 + 8.0 / (3.0 * np.pi) * 0.4 * w * a)) * a
    np.testing.assert_allclose(size, 0.3, rtol=1e-8)


def test_describing_function_of_a_contact_after_hertz():
    """Mean and first harmonic of `max(cos, 0)^(3/2)`: beta functions. Half powers are no trouble."""
    force = state_of(so.Expression(0, "max(x, 0)**1.5"), wave(2, c1=1.0)).force[:, 0]

    def moment(p):
        return gamma((p + 1) / 2) / (gamma(p / 2 + 1) * 2.0 * np.sqrt(np.pi))

    np.testing.assert_allclose(force[:2], [moment(1.5), 2.0 * moment(2.5)], rtol=1e-10)


@pytest.mark.parametrize("velocity", [0.3, 1e-2, 1e-5])
def test_friction_is_integrated_whatever_its_sharpness(velocity):
    """Against a fine rule on a grid that is graded towards the reversals; a hundred times sharper, few nodes more."""
    x = wave(5, c1=0.7, s1=-0.2, c3=0.15, s5=0.05)
    state = state_of(so.TanhFriction(0, 0.8, velocity), x)
    (law,) = state.own_channels[0].laws
    assert len(law.nodes.weights) < 900

    def v(tau):
        k = np.arange(1, 6)
        waves = np.multiply.outer(tau, k)
        return OMEGA * (np.cos(waves) * k @ x[2::2, 0] - np.sin(waves) * k @ x[1::2, 0])

    # reversals by bisection, then Gauss rules in the logarithm of the distance from them
    grid = np.linspace(0.0, 2 * np.pi, 4001)
    signs = np.flatnonzero(np.diff(np.sign(v(grid))))
    zeros = []
    for i in signs:
        lo, hi = grid[i], grid[i + 1]
        for _ in range(60):
            mid = 0.5 * (lo + hi)
            lo, hi = (mid, hi) if (v(np.array([mid]))[0] > 0) == (v(np.array([lo]))[0] > 0) else (lo, mid)
        zeros.append(lo)
    ends = np.append(zeros, zeros[0] + 2 * np.pi)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = np.zeros(3)
    for a, b in pairwise(ends):
        half = 0.5 * (b - a)
        steps = np.concatenate(([0.0], half * np.geomspace(1e-9, 1.0, 60)))
        for start, sign in ((a, 1.0), (b, -1.0)):
            for low, high in pairwise(steps):
                tau = start + sign * (0.5 * (low + high) + 0.5 * (high - low) * nodes)
                f = 0.8 * np.tanh(v(tau) / velocity)
                total += 0.5 * (high - low) * np.array([f, f * np.cos(tau), f * np.sin(3 * tau)]) @ weights
    expected = total / [2 * np.pi, np.pi, np.pi]
    np.testing.assert_allclose(state.force[[0, 1, 6], 0], expected, atol=3e-9)


@pytest.mark.parametrize("nu", [1, 2, 3])
def test_coupled_and_parametric_forces_by_brute_force(nu):
    rng = np.random.default_rng(nu)
    high = 4 * nu
    x = rng.normal(size=(2 * high + 1, 3)) / (1.0 + np.arange(2 * high + 1)[:, None])
    text = "k*x*y**2*(1 + e*cos(2*omega*t + 0.3)) + c*(x' - y)*max(x - 0.1, 0)*sin(omega*t)"
    element = so.Expression(1, text, {"x": (0, 2), "y": [1.0, 0.5, 0.0]})
    state = state_of(element, x, nu, k=0.7, e=0.4, c=0.2)
    count = 1 << 16
    tau = 2 * np.pi * np.arange(count) / count
    k = np.arange(1, high + 1)
    cos, sin = np.cos(np.multiply.outer(tau, k)), np.sin(np.multiply.outer(tau, k))
    u = x[0] + cos @ x[1::2] + sin @ x[2::2]
    v = OMEGA / nu * (-sin @ (k[:, None] * x[1::2]) + cos @ (k[:, None] * x[2::2]))
    a, y, rate, phase = u[:, 0] - u[:, 2], u[:, 1] * 0.5 + u[:, 0], v[:, 0] - v[:, 2], nu * tau
    f = 0.7 * a * y**2 * (1 + 0.4 * np.cos(2 * phase + 0.3)) + 0.2 * (rate - y) * np.maximum(a - 0.1, 0) * np.sin(phase)
    spectrum = np.fft.rfft(f)[: high + 1] / count
    np.testing.assert_allclose(state.force[0, 1], spectrum[0].real, atol=1e-8)
    np.testing.assert_allclose(state.force[1::2, 1], 2 * spectrum[1:].real, atol=1e-8)
    np.testing.assert_allclose(state.force[2::2, 1], -2 * spectrum[1:].imag, atol=1e-8)
    assert not state.force[:, [0, 2]].any()


def test_a_law_that_cannot_be_sampled_is_no_false_result():
    """A corner that the law does not tell: samples do not settle, and a sentence says so."""

    class Hidden(Element):
        depends_on_velocity = True
        own_nodes = True

        def sampling(self, c):
            return AdaptiveSampling()

        def tangent(self, u, v, c):
            return np.abs(v) * v, 0 * u, 2 * np.abs(v)

        def curvature(self, u, v, c):
            return 0 * u, 0 * u, 2 * np.sign(v)

        def coefficient_tangent(self, u, v, c):
            return np.zeros((0, len(u))), np.zeros((0, len(u))), np.zeros((0, len(u)))

        def coefficient_curvature(self, u, v, c):
            return np.zeros((0, 0, len(u)))

    with pytest.raises(ConvergenceError, match="do not resolve the force"):
        state_of(Hidden(0), wave(5, c1=0.7, s3=0.123))


def test_corners_are_integrated_as_exactly_as_contacts():
    """The same stop as a text and as an element in closed form: force and Jacobian to rounding."""
    x = wave(7, c0=0.1, c1=0.8, s2=0.3, c5=0.1)
    told, exact = (
        state_of(element, x) for element in (so.Expression(0, "4.7*max(x - 0.2, 0)"), so.ElasticStop(0, 4.7, 0.2))
    )
    np.testing.assert_allclose(told.force, exact.force, atol=1e-12)
    np.testing.assert_allclose(told.jacobian, exact.jacobian, atol=1e-11)
    np.testing.assert_allclose(told.half_jacobian, exact.half_jacobian, atol=1e-11)


def test_rest_is_no_trouble():
    for element in (so.QuadraticDamper(0, 1.0), so.TanhFriction(0, 1.0, 0.1), so.Expression(0, "max(x - 1, 0)*v")):
        state = state_of(element, np.zeros((7, 1)))
        assert not state.force.any()
        assert np.isfinite(state.jacobian).all()
