"""Harmonic balance against closed forms, the equation of motion in time, and the decoupling of doubled periods."""

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic import HarmonicBalance, HarmonicBasis, PeriodicOrbit
from suboctave.harmonic.basis import to_complex
from suboctave.model import CubicSpring, ElasticStop, HarmonicLoad, System


def chain(elements=(), **load):
    """Three masses with proportional and one unsymmetric damping term."""
    k = np.array([[2.0, -1.0, 0.0], [-1.0, 2.5, -1.0], [0.0, -1.0, 1.5]])
    damping = 0.02 * k
    damping[0, 2] += 0.01
    return System(np.diag([1.0, 2.0, 0.5]), damping, k, elements=elements, loads=[HarmonicLoad(**load)])


@pytest.mark.parametrize("nu", [1, 2])
def test_linear_system(solve, nu):
    """x = Re Z(h omega)^-1 p exp(i (h omega t + phase)), plus the static deflection; one Newton step from anywhere."""
    system = chain(dof=1, amplitude=[1.3, 0.4], harmonic=[1, 3], phase=[0.4, -1.0], static=0.7)
    m, c, k = system.matrices()
    omega, p = 0.83, np.eye(3)[1]
    balance = HarmonicBalance(system, HarmonicBasis(4 * nu, nu))
    amplitudes = to_complex(solve(balance, omega, np.full((balance.basis.size, 3), 9.0)))
    expected = np.zeros((4 * nu + 1, 3), complex)
    expected[0] = np.linalg.solve(k, 0.7 * p)
    for h, a, phase in ((1, 1.3, 0.4), (3, 0.4, -1.0)):
        z = k - (h * omega) ** 2 * m + 1j * h * omega * c
        expected[h * nu] = np.linalg.solve(z, a * np.exp(1j * phase) * p)
    np.testing.assert_allclose(amplitudes, expected, atol=1e-13)


@pytest.mark.parametrize("a", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("alpha", [0.5, -0.05])
def test_duffing_with_one_harmonic(a, alpha):
    """F^2 = a^2 [ (k - m omega^2 + 3/4 alpha a^2)^2 + (c omega)^2 ]: with X chosen, the load that balances it."""
    m, c, k, omega = 1.4, 0.07, 2.2, 1.6
    angle = 0.9
    x = np.array([0.0, a * np.cos(angle), a * np.sin(angle)])[:, None]
    system = System(m, c, k, elements=[CubicSpring(0, alpha)], loads=[HarmonicLoad(0, 0.0)])
    residual = HarmonicBalance(system, HarmonicBasis(1)).at(x, omega).residual
    assert residual[0] == pytest.approx(0.0, abs=1e-14)
    expected = a * np.hypot(k - m * omega**2 + 0.75 * alpha * a**2, c * omega)
    assert np.hypot(*residual[1:]) == pytest.approx(expected, rel=1e-13)


def test_duffing_frequency_response_with_one_harmonic():
    """The whole curve lies on the closed form, and turns back where it does."""
    system = so.library.duffing(c=0.1, k=1.0, alpha=1.0, F=0.5)
    curve = so.frequency_response(system, (0.5, 3.0), harmonics=1)
    a, w = curve.amplitude, curve.omega
    np.testing.assert_allclose((1 - w**2 + 0.75 * a**2) ** 2 + (0.1 * w) ** 2, (0.5 / a) ** 2, rtol=1e-8)
    # at a turning point d/da of F^2(a, omega) vanishes
    for point in curve.bifurcations["LP"]:
        detuning = 1 - point.omega**2 + 0.75 * point.amplitude**2
        slope = detuning**2 + (0.1 * point.omega) ** 2 + 1.5 * point.amplitude**2 * detuning
        assert slope == pytest.approx(0.0, abs=1e-7)
    assert len(curve.bifurcations["LP"]) == 2


@pytest.mark.parametrize("regularization", [None, 50.0])
def test_the_equation_of_motion_holds_but_for_the_neglected_harmonics(solve, regularization):
    """M x'' + C x' + K x + f - p, sampled finely, has no harmonic up to H; those above are the force's alone."""
    stops = [
        ElasticStop((0, 1), 1.5, 0.03, regularization=regularization),
        ElasticStop(2, 1.0, -0.1, regularization=regularization),
    ]
    system = chain(stops, dof=0, amplitude=0.5)
    m, c, k = system.matrices()
    omega = 0.45
    balance = HarmonicBalance(system, HarmonicBasis(9))
    orbit = PeriodicOrbit(balance, solve(balance, omega), omega, dict(system.parameters), 0.0)
    n = 1 << 17
    t = np.arange(n) * orbit.period / n
    x, v, acceleration = orbit.displacement(t), orbit.velocity(t), orbit.acceleration(t)
    rest = m @ acceleration + c @ v + k @ x - system.force_time(t, omega)
    for stop in stops:
        d = stop.direction(3)
        rest += np.outer(d, stop.tangent(d @ x, d @ v, stop.coefficient_values({}))[0])
    spectrum = np.abs(np.fft.rfft(rest, axis=1)) / n
    assert spectrum[:, :10].max() < 1e-9
    assert spectrum[:, 10:].max() > 1e-5


@pytest.mark.parametrize("kind", ["exact", "regularised", "damper"])
def test_a_doubled_basis_falls_into_the_plain_and_the_half_odd_one(kind, damper):
    """At a motion of one load period, written in the basis of two, the Jacobian couples even with even and odd with
    odd multiples of omega/2 only: the blocks are J_0 and J_half of the plain basis.
    """
    stop = ElasticStop((0, 1), 5.0, 0.1, regularization=40.0 if kind == "regularised" else None)
    element = damper(0, [0.1, 0.4]) if kind == "damper" else stop
    system = chain([element, CubicSpring(2, 0.3)], dof=0, amplitude=0.5)
    high, omega, n = 5, 0.9, 3
    plain = HarmonicBalance(system, HarmonicBasis(high))
    x = np.random.default_rng(5).normal(size=(plain.basis.size, n)) / (1 + np.arange(plain.basis.size))[:, None]
    plain = plain.settle(x, omega)
    doubled = HarmonicBalance(system, HarmonicBasis(2 * high + 1, 2))
    y = plain.basis.resized(x, doubled.basis)
    doubled = doubled.settle(y, omega)
    small, large = plain.at(x, omega), doubled.at(y, omega)
    harmonic = np.concatenate(([0], np.repeat(np.arange(1, 2 * high + 2), 2)))
    even, odd = (np.repeat(harmonic % 2 == parity, n) for parity in (0, 1))
    size = np.abs(large.jacobian).max()
    np.testing.assert_allclose(large.jacobian[np.ix_(even, even)], small.jacobian, atol=1e-10 * size)
    np.testing.assert_allclose(large.jacobian[np.ix_(odd, odd)], small.half_jacobian, atol=1e-10 * size)
    assert np.abs(large.jacobian[np.ix_(even, odd)]).max() < 1e-10 * size
    assert np.abs(large.jacobian[np.ix_(odd, even)]).max() < 1e-10 * size
    np.testing.assert_allclose(large.residual[even], small.residual, atol=1e-10 * size)


def test_the_free_operator_at_half_the_frequency_belongs_to_the_half_odd_basis():
    """The complex operator on harmonics -H - 1/2 .. H + 1/2 is the real half-odd one: the free one on 2 H + 1 of these
    2 H + 2 is what is left after striking out the lowest row and column.
    """
    from suboctave.harmonic.perturbation import Kind, operator

    system = so.library.reference_oscillator(j=0.2)
    balance = HarmonicBalance(system, HarmonicBasis(6))
    x = np.random.default_rng(6).normal(size=(13, 1)) / (1 + np.arange(13))[:, None]
    state = balance.at(x, 1.9)
    real = state.half_jacobian
    # cos, sin of (k + 1/2) tau from exp(+-i (k + 1/2) tau)
    change = np.zeros((14, 14), complex)
    for k in range(7):
        change[2 * k : 2 * k + 2, 7 + k] = [1.0, 1j]
        change[2 * k : 2 * k + 2, 6 - k] = [1.0, -1j]
    waves = np.linalg.solve(change, real @ change)
    free = operator(state, Kind.FREE, 0.5 * state.rate)
    np.testing.assert_allclose(waves[1:, 1:], free, atol=1e-12 * np.abs(free).max())


def test_a_load_above_the_basis_is_refused():
    system = chain(dof=0, amplitude=1.0, harmonic=5)
    with pytest.raises(InputError, match="needs harmonics=5 or more"):
        HarmonicBalance(system, HarmonicBasis(8, 2))


def test_a_force_that_is_not_finite_is_named(damper):
    class Runaway(damper):
        def tangent(self, u, v, c):
            return np.where(u > 1.0, np.inf, u), np.ones_like(u), np.zeros_like(u)

    system = chain([Runaway((0, 2), [1.0, 1.0])], dof=0, amplitude=1.0)
    x = np.zeros((7, 3))
    x[1, 0] = 3.0
    with pytest.raises(ConvergenceError, match=r"dof=\(0, 2\).*not finite at omega = 0\.5"):
        _ = HarmonicBalance(system, HarmonicBasis(3)).at(x, 0.5).residual


def test_orbit_as_data(solve):
    """Displacement, velocity, acceleration, harmonics and amplitude of a linear motion in closed form."""
    system = System(1.0, 0.2, 4.0, loads=[HarmonicLoad(0, 1.5)])
    balance = HarmonicBalance(system, HarmonicBasis(6, 2))
    omega = 1.2
    orbit = PeriodicOrbit(balance, solve(balance, omega), omega, dict(system.parameters), 0.0)
    c = 1.5 / (4 - omega**2 + 0.2j * omega)
    t = np.linspace(0, 3, 7)
    for series, order in ((orbit.displacement, 0), (orbit.velocity, 1), (orbit.acceleration, 2)):
        expected = np.real(c * (1j * omega) ** order * np.exp(1j * omega * t))
        np.testing.assert_allclose(series(t)[0], expected, atol=1e-13)
        assert series(0.4).shape == (1,)
    assert orbit.period == pytest.approx(4 * np.pi / omega)
    assert orbit.harmonic(1) == pytest.approx(c)
    assert orbit.harmonic(0.5) == pytest.approx(0.0, abs=1e-14)
    assert orbit.harmonic(7) == 0.0
    assert orbit.amplitude() == pytest.approx(abs(c), rel=1e-13)
    np.testing.assert_allclose(orbit.start(), [c.real, (1j * omega * c).real], atol=1e-13)
    with pytest.raises(InputError, match="no harmonic"):
        orbit.harmonic(0.25)
    with pytest.raises(InputError, match="out of range"):
        orbit.amplitude(1)


def test_laws_at_parameter_values_are_computed_once():
    system = so.library.reference_oscillator()
    balance = HarmonicBalance(system, HarmonicBasis(3))
    assert balance.laws(balance.values) is balance.laws(balance.values)
    others = {**system.parameters, "j": 0.1}
    assert balance.laws(others) is balance.laws(dict(others))
    assert balance.laws(others) is not balance.laws(balance.values)
    assert balance.laws({**others, "j": 0.2}) is not balance.laws(others)
