"""Hill's method against shooting, closed forms and identities; monodromy with them."""

from __future__ import annotations

import numpy as np
import pytest
from slow import slow

import suboctave as so
from suboctave.floquet.hill import Variational, exponents as hills_exponents, in_strip
from suboctave.harmonic import HarmonicBalance, HarmonicBasis
from suboctave.timedomain import integrate, shoot

METHODS = [so.Monodromy(), so.Hill()]
WITNESSES = METHODS[1:]
#: what the multipliers of shooting are good to themselves
SHOOTING = 1e-9
each_method = pytest.mark.parametrize("method", METHODS, ids=repr)
each_witness = pytest.mark.parametrize("method", WITNESSES, ids=repr)


def exponents(system):
    """Roots of the quadratic eigenvalue problem of a system without elements."""
    m, c, k = system.matrices()
    zero, one = np.zeros_like(m), np.eye(len(m))
    return np.linalg.eigvals(np.block([[zero, one], [-np.linalg.solve(m, k), -np.linalg.solve(m, c)]]))


# ------------------------------------------------------------------------------------------------------- shooting
@pytest.mark.parametrize("each", [8, *slow(1)])
@each_method
def test_fifty_motions_by_shooting(fifty, distances, method, each):
    """Within its own error estimate of shooting everywhere, the estimate below 1e-3, every verdict the same."""
    assert [draw.stable for draw in fifty[::each]] == [i < 25 for i in range(0, 50, each)]
    for draw in fifty[::each]:
        result = so.stability(draw.orbit, method=method)
        assert result.applicable, (draw.name, result)
        assert np.all(distances(result.multipliers, draw.exact) <= result.errors + SHOOTING), (draw.name, result)
        assert result.errors.max() <= 1e-3, (draw.name, result)
        assert result.stable == draw.stable, (draw.name, result)


@pytest.mark.slow
def test_truncations_cancel_in_hills_method(fifty, distances):
    """With contacts the truncated motion alone, or the truncated perturbation alone, move multipliers by up to 1e-4."""
    contacts = [d for d in fifty if d.name.startswith("p=") and "j=0.0" in d.name]
    errors = [distances(so.stability(d.orbit, method="hill").multipliers, d.exact).max() for d in contacts]
    truncated = []
    for draw in contacts:
        motion = draw.orbit.state()
        many = 3 * motion.basis.harmonics
        alone = hills_exponents(Variational.of(motion, 2 * many), many)
        alone = alone[in_strip(alone, many)[0]]
        truncated.append(distances(np.exp(2.0 * np.pi * alone), draw.exact).max())
    assert len(contacts) > 20
    assert np.mean(errors) < 5e-7
    assert np.mean(errors) < 0.05 * np.mean(truncated)


def test_hill_checks_itself(fifty):
    """Exactly 2 n eigenvalues in the strip, reported on the result."""
    for draw in fifty[::7]:
        checks, size = so.stability(draw.orbit, method="hill").checks, 2 * draw.orbit.system.n
        assert checks["inside the strip"] == checks["expected"] == size
        assert checks["gap"] >= 0.99 / size
        assert checks["Liouville"] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("harmonics", [15, 31])
def test_coverage_on_the_reference_curves(draw, distances, method, harmonics):
    """Ninety-five percent of all motions, half of them unstable, lie within their error estimates; verdicts agree."""
    covered, whole, motions = [], [], [item for _, item in draw(harmonics, 12, seed=harmonics)]
    assert sum(not item.stable for item in motions) == len(motions) // 2
    for item in motions:
        result = so.stability(item.orbit, method=method)
        inside = distances(result.multipliers, item.exact) <= result.errors + SHOOTING
        covered += list(inside)
        whole.append(inside.all())
        assert result.stable == item.stable, (item.name, result)
        assert harmonics < 31 or result.errors.max() <= 1e-3, (item.name, result)
    assert len(covered) > 400
    assert np.mean(covered) >= 0.95
    assert np.mean(whole) >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_coverage_on_random_systems(random_motions, distances, method):
    """The same for systems of one to three DOFs and 7 to 31 harmonics; no decided verdict is wrong."""
    covered, silent, wrong = [], 0, []
    for item in random_motions(11, 150):
        result = so.stability(item.orbit, method=method)
        if not result.applicable:
            silent += 1
            continue
        covered += list(distances(result.multipliers, item.exact) <= result.errors + SHOOTING)
        if result.decided and result.stable != item.stable:
            wrong.append((item.name, result))
    assert silent <= 10
    assert np.mean(covered) >= 0.95
    assert not wrong


def test_a_few_random_systems(random_motions, distances):
    """A small share of the slow test above."""
    covered = {method: [] for method in METHODS}
    for item in random_motions(3, 5):
        for method in METHODS:
            result = so.stability(item.orbit, method=method)
            if result.applicable:
                covered[method] += list(distances(result.multipliers, item.exact) <= result.errors + SHOOTING)
                assert result.stable == item.stable or not result.decided, item.name
    for method, inside in covered.items():
        assert np.mean(inside) >= 0.9, method


@each_witness
def test_gyroscopic_and_circulatory_forces(distances, method):
    """Unsymmetric C and K, a stop between the DOFs: no method may rely on symmetry."""
    system = so.System(
        [[1.0, 0.1], [0.1, 0.7]],
        [[0.05, 0.6], [-0.5, 0.04]],
        [[2.0, -0.4], [0.3, 1.5]],
        [so.ElasticStop((0, 1), 3.0, 0.2), so.CubicSpring(1, 0.4)],
        [so.HarmonicLoad(0, 0.5)],
    )
    orbit = so.frequency_response(system, (2.6, 1.9), harmonics=25).orbits[-1]
    exact = shoot(system, orbit.start(), orbit.omega).multipliers
    result = so.stability(orbit, method=method)
    assert np.all(distances(result.multipliers, exact) <= result.errors + SHOOTING)
    assert result.error < 1e-3


@each_witness
def test_forces_of_velocity(drag, distances, method):
    """A law in displacement and velocity of which nothing is told."""
    system = so.System(1.0, 0.01, 1.0, [drag(0, [0.02, 0.3, 0.1])], [so.HarmonicLoad(0, 1.2)])
    orbit = so.frequency_response(system, (2.0, 1.1), harmonics=13).orbits[-1]
    exact = shoot(system, orbit.start(), orbit.omega).multipliers
    result = so.stability(orbit, method=method)
    assert np.all(distances(result.multipliers, exact) <= result.errors + SHOOTING)
    assert result.error < 1e-4


@pytest.fixture(scope="module", params=[None, 3000.0], ids=["exact", "regularised"])
def doubled(request):
    """A stable motion of two load periods between the period doublings of the reference oscillator, and by shooting."""
    system, omega, nu, harmonics = so.library.reference_oscillator(regularization=request.param), 3.0, 2, 50
    period = 2.0 * np.pi * nu / omega
    settled = so.integrate(system, start=[0.1, 0.0], omega=omega, transient=120, periods=2).end
    solution = shoot(system, settled, omega, periods=nu)
    samples = integrate(system, solution.state, [0.0, period], omega).at(period * np.arange(512) / 512)[0]
    c = np.fft.rfft(samples, axis=0)[: harmonics + 1] / 256
    x = np.zeros((2 * harmonics + 1, 1))
    x[0], x[1::2], x[2::2] = 0.5 * c[0].real, c[1:].real, -c[1:].imag
    balance = HarmonicBalance(system, HarmonicBasis(harmonics, nu)).settle(x, omega)
    for _ in range(8):
        state = balance.at(x, omega)
        x = x - np.linalg.solve(state.jacobian, state.residual).reshape(x.shape)
    assert np.abs(x[1::4]).max() > 1e-2  # it does not repeat after one period
    return so.PeriodicOrbit(balance, x, omega, dict(system.parameters), 1e-12), solution


@each_method
def test_motions_of_two_periods(doubled, distances, method):
    orbit, solution = doubled
    result = so.stability(orbit, method=method)
    assert np.all(distances(result.multipliers, solution.multipliers) <= result.errors + SHOOTING)
    assert result.error < 1e-3
    assert result.stable
    assert solution.stable


# --------------------------------------------------------------------------------------- closed forms and identities
@each_witness
@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize("nu", [1, 3])
def test_linear_system(distances, method, n, nu):
    """Multipliers are exp(lambda T), lambda the roots of the quadratic eigenvalue problem."""
    rng = np.random.default_rng(n)
    k = 3.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    c = 0.05 * k + 0.03 * rng.normal(size=(n, n))
    system = so.System(np.eye(n) + 0.2 * np.diag(np.arange(n)), c, k, loads=[so.HarmonicLoad(0, 1.0)])
    state = HarmonicBalance(system, HarmonicBasis(5 * nu, nu)).at(np.zeros((10 * nu + 1, n)), 1.3)
    result = method.multipliers(state)
    difference = distances(result.multipliers, np.exp(exponents(system) * 2 * np.pi * nu / 1.3))
    assert difference.max() < 1e-11
    assert np.all(difference <= 10 * result.errors)
    assert np.all(np.diff(np.abs(result.multipliers)) <= 1e-12)


@each_witness
@pytest.mark.parametrize(("damping", "stiffness"), [(5.0, 1.0), (2.0, 1.0), (0.1, -0.3), (0.0, 0.0), (-0.5, 1.0)])
def test_overdamped_critical_and_unstable(method, damping, stiffness):
    """Real exponents, a double one at critical damping, a free mass, negative damping."""
    system = so.System(1.0, damping, stiffness, loads=[so.HarmonicLoad(0, 1.0)])
    result = method.multipliers(HarmonicBalance(system, HarmonicBasis(4)).at(np.zeros(9), 2.0))
    expected = np.exp(np.roots([1.0, damping, stiffness]) * np.pi)
    # a double one is as good as the square root of rounding
    for mu in expected:
        assert np.abs(result.multipliers - mu).min() < 1e-6
    assert result.unstable == np.count_nonzero(np.abs(expected) > 1.0)


@each_method
def test_liouville(fifty, drag, method):
    """The product of all multipliers is exp(-int trace(M^-1 (C + f_v)) dt), to what their errors allow."""
    for draw in fifty[::5]:
        mass, damping, _ = draw.orbit.system.matrices()
        expected = np.exp(-np.trace(np.linalg.solve(mass, damping)) * draw.orbit.period)
        check(so.stability(draw.orbit, method=method), expected)
    system = so.System(1.0, 0.05, 1.0, [drag(0, [-0.1, 0.3, 0.0])], [so.HarmonicLoad(0, 2.0)])
    orbit = so.frequency_response(system, (2.5, 2.0), harmonics=15).orbits[-1]
    x = orbit.coefficients[:, 0]
    square = x[0] ** 2 + 0.5 * (x[1:] ** 2).sum()
    check(so.stability(orbit, method=method), np.exp(-orbit.period * (0.05 - 0.1 + 0.3 * square)))


def check(result, expected):
    product = np.prod(result.multipliers)
    slack = np.sum(result.errors / np.abs(result.multipliers)) + 1e-9
    assert product.real == pytest.approx(expected, rel=slack)
    assert abs(product.imag) <= slack * expected


@each_witness
def test_multipliers_are_closed_under_conjugation(fifty, method):
    """Of a real equation; a negative real one must not carry an imaginary part."""
    negative = 0
    for draw in fifty[::4]:
        mu = so.stability(draw.orbit, method=method).multipliers
        assert np.abs(mu[:, None] - mu.conj()[None, :]).min(axis=1).max() < 1e-12 * np.abs(mu).max()
        real = (draw.exact.real < 0.0) & (np.abs(draw.exact.imag) < 1e-9)
        if real.all():
            negative += 1
            assert not mu.imag.any()
    assert negative >= 1


@each_witness
def test_units_and_order_of_dofs_do_not_matter(method):
    """Seconds to milliseconds, metres to millimetres, kilograms to tonnes, the DOFs renamed: the same multipliers."""

    def multipliers(mass, length, time, order):
        m, c, k = (
            np.diag([1.0, 0.6]),
            np.array([[0.06, -0.02], [-0.02, 0.04]]),
            np.array([[2.0, -1.0], [-1.0, 1.5]]),
        )
        at = [order.index(i) for i in (0, 1)]
        system = so.System(
            (mass * m)[np.ix_(order, order)],
            (mass / time * c)[np.ix_(order, order)],
            (mass / time**2 * k)[np.ix_(order, order)],
            [
                so.ElasticStop((at[0], at[1]), 3.0 * mass / time**2, 0.1 * length),
                so.CubicSpring(at[1], 0.2 * mass / time**2 / length**2),
            ],
            [so.HarmonicLoad(at[0], 0.3 * mass * length / time**2)],
        )
        orbit = so.frequency_response(system, (2.4 / time, 1.9 / time), harmonics=15).orbits[-1]
        return np.sort_complex(so.stability(orbit, method=method).multipliers)

    expected = multipliers(1.0, 1.0, 1.0, [0, 1])
    np.testing.assert_allclose(multipliers(1e-3, 1e3, 1e3, [1, 0]), expected, rtol=1e-7, atol=1e-9)


@each_witness
def test_condensed_linear_part(distances, method):
    """Six masses with one unknown: the multipliers are those of all twelve dimensions."""
    n = 6
    k = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    elements = [so.ElasticStop(0, 3.0, 0.5), so.CubicSpring(0, 0.05)]
    system = so.System(np.eye(n), 0.06 * k, k, elements, [so.HarmonicLoad(0, 0.4)])
    orbit = so.frequency_response(system, (0.6, 0.7), harmonics=9).orbits[-1]
    whole = so.frequency_response(system, (0.6, 0.7), harmonics=9).orbits[-1]
    exact = shoot(system, whole.start(), whole.omega).multipliers
    result = so.stability(orbit, method=method)
    assert result.multipliers.shape == (2 * n,)
    assert np.all(distances(result.multipliers, exact) <= result.errors + SHOOTING)
    assert result.error < 1e-2
