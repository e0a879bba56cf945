"""Multipliers against closed forms, identities, other integrators, and shooting, which knows no harmonic object."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import suboctave as so
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic import HarmonicBalance, HarmonicBasis
from suboctave.model import Element, PolynomialSampling
from suboctave.timedomain import shoot


def state_of(system, x, omega, nu=1):
    x = np.asarray(x, float).reshape(-1, system.n)
    return HarmonicBalance(system, HarmonicBasis(len(x) // 2, nu)).at(x, omega)


def paired(a, b):
    """Every multiplier of b with the error of the nearest of a, as one worst difference per entry of a."""
    order = [int(np.argmin(np.abs(b - mu))) for mu in a]
    assert sorted(order) == list(range(len(a)))
    return np.abs(a - b[order])


# ------------------------------------------------------------------------------------------------ closed forms
@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize("nu", [1, 3])
def test_linear_system(n, nu):
    """Multipliers are exp(lambda T), lambda the roots of the quadratic eigenvalue problem."""
    rng = np.random.default_rng(n)
    m = np.eye(n) + 0.2 * np.diag(np.arange(n))
    k = 3.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    c = 0.05 * k + 0.03 * rng.normal(size=(n, n))
    system = so.System(m, c, k, loads=[so.HarmonicLoad(0, 1.0)])
    omega = 1.3
    result = floquet_multipliers(state_of(system, np.zeros((7, n)), omega, nu))
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(m, k), -np.linalg.solve(m, c)]])
    expected = np.exp(np.linalg.eigvals(a) * 2 * np.pi * nu / omega)
    assert paired(result.multipliers, expected).max() < 1e-12
    assert np.all(paired(result.multipliers, expected) <= 10 * result.errors)
    assert np.all(np.diff(np.abs(result.multipliers)) <= 1e-12)
    assert result.stable
    assert result.decided
    assert result.unstable == 0


@pytest.mark.parametrize(
    ("damping", "stiffness"), [(5.0, 1.0), (2.0, 1.0), (0.1, -0.3), (0.0, 0.0), (3e3, 1e4), (1e3, 1.0), (-3.0, 1.0)]
)
def test_overdamped_critical_and_unstable(damping, stiffness):
    """Real multipliers: at critical damping double, statically unstable, a free mass, damping heavy enough for the
    hyperbolic functions to overflow, negative damping.
    """
    system = so.System(1.0, damping, stiffness, loads=[so.HarmonicLoad(0, 1.0)])
    result = floquet_multipliers(state_of(system, np.zeros(3), 2.0))
    roots = np.roots([1.0, damping, stiffness])
    expected = np.exp(roots * np.pi)
    # a double one is as good as the square root of rounding
    assert np.abs(np.sort(result.multipliers.real) - np.sort(expected.real)).max() < 1e-6
    if damping == 0.1:
        assert not result.stable
        assert result.unstable == 1
        assert result.unstable_pairs == 0
        assert result.margin == pytest.approx(expected.real.max() - 1.0, rel=1e-9)


@pytest.mark.parametrize("stiffness", [-1.0, -3.0, -6.0])
def test_small_multipliers_beside_a_large_one_say_what_digits_they_have(stiffness):
    """An unstable direction mixed with two stable ones: multipliers up to 3e9 beside 0.91. All stated errors are from
    rounding here, and hold up to the rounding of the expected values themselves.
    """
    q = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    k = q @ np.diag([stiffness, 2.0, 4.0]) @ q.T
    system = so.System(np.eye(3), 0.02 * np.eye(3), k, loads=[so.HarmonicLoad(0, 1.0)])
    result = floquet_multipliers(state_of(system, np.zeros((7, 3)), 0.7))
    roots = np.concatenate([np.roots([1.0, 0.02, value]) for value in (stiffness, 2.0, 4.0)])
    expected = np.exp(roots * 2 * np.pi / 0.7)
    difference = np.abs(result.multipliers[:, None] - expected[None, :]).min(axis=1)
    assert np.all(difference <= 3 * result.errors + 3e-14 * np.abs(result.multipliers))
    assert result.errors[1] < 1e-13 * abs(result.multipliers[0])


def mathieu(delta, epsilon, damping):
    """Multipliers of y'' + c y' + (delta + epsilon cos 2 t) y = 0 over pi, by a general-purpose integrator."""

    def field(t, y):
        y = y.reshape(2, 2)
        return np.concatenate((y[1], -damping * y[1] - (delta + epsilon * np.cos(2 * t)) * y[0]))

    solution = solve_ivp(field, (0, np.pi), np.eye(2).ravel(), method="DOP853", rtol=1e-12, atol=1e-13)
    return np.linalg.eigvals(solution.y[:, -1].reshape(2, 2))


@pytest.mark.parametrize(("delta", "epsilon"), [(1.0, 0.4), (1.0, 0.1), (2.1, 1.5), (4.0, 2.0), (0.3, 3.0)])
def test_mathieu_through_duffing(delta, epsilon):
    """A Duffing oscillator on x = a cos t has the tangent k + 3/2 alpha a^2 (1 + cos 2 t): Mathieu's equation. Half a
    period of the load is enough for it, so the multipliers over the whole are squares.
    """
    alpha, a, c = 1.0, np.sqrt(epsilon / 1.5), 0.02
    system = so.System(1.0, c, delta - epsilon, elements=[so.CubicSpring(0, alpha)], loads=[so.HarmonicLoad(0, 1.0)])
    # a motion is given here, not solved for; with nine harmonics its force leaves nothing beyond the basis
    x = np.zeros((19, 1))
    x[1] = a
    result = floquet_multipliers(HarmonicBalance(system, HarmonicBasis(9)).at(x, 1.0))
    difference = paired(result.multipliers, mathieu(delta, epsilon, c) ** 2)
    assert difference.max() < 1e-6 * max(1.0, np.abs(result.multipliers).max())
    assert np.all(difference <= 3 * result.errors + 1e-11)


# ------------------------------------------------------------------------------------------------- kernels
@pytest.mark.parametrize("regularization", [None, 300.0])
def test_kernels_agree_on_uncoupled_oscillators(regularization):
    """Two oscillators side by side have the multipliers of each alone, which another kernel computes."""

    def oscillator(i, dofs):
        stop = so.ElasticStop(dof=dofs - 1, stiffness=4.0, gap=0.3 * (i + 1), regularization=regularization)
        spring = so.CubicSpring(dof=dofs - 1, coefficient=0.2 + 0.3 * i)
        return [stop, spring], so.HarmonicLoad(dof=dofs - 1, amplitude=0.4)

    elements, loads = zip(*(oscillator(i, i + 1) for i in range(2)), strict=True)
    both = so.System(
        np.eye(2), np.diag([0.1, 0.2]), np.diag([1.0, 2.0]), [e for pair in elements for e in pair], list(loads)
    )
    together = so.frequency_response(both, (2.2, 1.9), harmonics=11).orbits[-1]
    expected = []
    for i in range(2):
        parts, load = oscillator(i, 1)
        alone = so.System(1.0, 0.1 * (i + 1), 1.0 + i, parts, [load])
        orbit = so.frequency_response(alone, (2.2, 1.9), harmonics=11).orbits[-1]
        np.testing.assert_allclose(orbit.coefficients[:, 0], together.coefficients[:, i], atol=1e-9)
        expected += list(so.stability(orbit).multipliers)
    assert paired(np.array(expected), so.stability(together).multipliers).max() < 1e-7


# --------------------------------------------------------------------------------------------- identities
def reference(**changes):
    return so.library.reference_oscillator(p=0.55, j=0.0, **changes)


@pytest.mark.parametrize("regularization", [None, 3000.0])
def test_liouville_for_constant_damping(regularization):
    """The product of the multipliers is exp(-c T), whatever the stiffness does."""
    system = reference(regularization=regularization)
    for omega in (4.0, 3.0, 1.5):
        orbit = so.frequency_response(system, (4.4, omega), harmonics=9).orbits[-1]
        product = np.prod(so.stability(orbit).multipliers)
        assert product.real == pytest.approx(np.exp(-0.06 * orbit.period), rel=1e-9)
        assert product.imag == pytest.approx(0.0, abs=1e-12)


class VanDerPol(Element):
    """f = mu (u^2 - 1) v."""

    coefficient_names = ("mu",)
    depends_on_velocity = True

    def sampling(self, c):
        return PolynomialSampling(3)

    def tangent(self, u, v, c):
        return c[0] * (u**2 - 1) * v, 2 * c[0] * u * v, c[0] * (u**2 - 1)

    def curvature(self, u, v, c):
        return 2 * c[0] * v, 2 * c[0] * u, np.zeros_like(u)

    def coefficient_tangent(self, u, v, c):
        return ((u**2 - 1) * v)[None], (2 * u * v)[None], (u**2 - 1)[None]

    def coefficient_curvature(self, u, v, c):
        return np.zeros((1, 1, len(u)))


def test_liouville_for_damping_along_the_motion():
    """The product of the multipliers is exp(-int c + mu (x^2 - 1) dt), the mean square being a sum over harmonics."""
    mu, c = 0.3, 0.05
    system = so.System(1.0, c, 1.0, elements=[VanDerPol(0, [mu])], loads=[so.HarmonicLoad(0, 2.0)])
    orbit = so.frequency_response(system, (2.5, 2.0), harmonics=15).orbits[-1]
    x = orbit.coefficients[:, 0]
    square = x[0] ** 2 + 0.5 * (x[1:] ** 2).sum()
    product = np.prod(so.stability(orbit).multipliers)
    assert product.real == pytest.approx(np.exp(-orbit.period * (c + mu * (square - 1.0))), rel=1e-6)


# ----------------------------------------------------------------------------------------------- shooting
SYSTEMS = {
    "exact": (reference(), (3.0, 1.7)),
    "regularised": (reference(regularization=3000.0), (3.0, 1.7)),
    "duffing": (so.library.duffing(c=0.1, k=1.0, alpha=1.0, F=0.8), (2.6, 0.9)),
    "velocity": (
        so.System(1.0, 0.05, 1.0, elements=[VanDerPol(0, [0.3])], loads=[so.HarmonicLoad(0, 2.0)]),
        (2.5, 1.2),
    ),
    "two masses": (
        so.System(
            np.diag([1.0, 0.6]),
            [[0.06, -0.02], [-0.02, 0.04]],
            [[2.0, -1.0], [-1.0, 1.5]],
            elements=[so.ElasticStop((0, 1), 3.0, 0.1), so.CubicSpring(1, 0.2)],
            loads=[so.HarmonicLoad(0, 0.3)],
        ),
        (2.4, 1.9),
    ),
}


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("harmonics", [7, pytest.param(21, marks=pytest.mark.slow)])
def test_against_shooting(name, harmonics):
    """The same motion by shooting: the stated errors cover the distance between the multipliers, and are not idle."""
    system, frequencies = SYSTEMS[name]
    for omega in frequencies:
        orbit = so.frequency_response(system, (frequencies[0] * 1.3, omega), harmonics=harmonics).orbits[-1]
        result = so.stability(orbit)
        witness = shoot(system, orbit.start(), omega)
        difference = paired(result.multipliers, witness.multipliers)
        assert np.all(difference <= 3 * result.errors + 1e-8)
        assert result.error < 0.1 if harmonics == 7 else result.error < 5e-3
        assert result.stable == witness.stable or not result.decided


def test_over_two_periods_multipliers_are_squares():
    """A motion of one load period, written in the basis of two."""
    orbit = so.frequency_response(reference(), (4.4, 3.0), harmonics=9).orbits[-1]
    doubled = HarmonicBasis(18, 2)
    state = HarmonicBalance(orbit.system, doubled).at(orbit.basis.resized(orbit.coefficients, doubled), orbit.omega)
    once, twice = so.stability(orbit).multipliers, floquet_multipliers(state).multipliers
    assert paired(twice, once**2).max() < 1e-6


# ------------------------------------------------------------------------------------------------ verdicts
def test_verdict_and_doubt():
    def result(*mu, error=1e-6):
        return FloquetResult(np.array(mu, complex), np.full(len(mu), error))

    assert result(0.9, 0.1).stable
    assert result(0.9, 0.1).decided
    assert not result(1.0 + 5e-7, 0.5).decided
    pair = result(0.8 + 0.7j, 0.8 - 0.7j, -1.2, 0.1)
    assert (pair.unstable, pair.unstable_pairs, pair.stable) == (3, 1, False)
    assert pair.margin == pytest.approx(0.2)
    # what decays within the period decides nothing
    assert FloquetResult(np.array([0.9, 1e-9], complex), np.array([1e-8, 1e-2])).error == 1e-8


@pytest.mark.parametrize(
    ("mu", "error", "decided"),
    [
        (-3.98 + 14.0j, 13.0, False),  # less than its distance from the circle, and as large as it is itself
        (1879.0, 1500.0, False),
        (5.2, 2.2, True),
        (1e6, 1e3, True),
        (0.02, 0.9, True),
    ],
)
def test_an_error_as_large_as_the_multiplier_is_no_verdict(mu, error, decided):
    result = FloquetResult(np.array([mu], complex), np.array([error]))
    assert result.decided is decided
    assert result.open[0] == (not decided)
    assert result.vague is not decided
