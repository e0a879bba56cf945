"""Three formulations of the same bifurcations, held against each other, against shooting, and against their papers.

The published positions by shooting are exact to 1e-10; what harmonic balance leaves out is between 1e-5 (H = 7) and
1e-8 (H = 63) there, and may differ between formulations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from published import equations, jacobian, published_operator, published_vector

import suboctave as so
from suboctave.bifurcation.bordered import null_vectors
from suboctave.curves.events.alcorta import locate_doubling, log_determinant
from suboctave.curves.events.locate import Guess, locate_singular
from suboctave.curves.kinds.extended import ExtendedOperator
from suboctave.errors import ConvergenceError
from suboctave.harmonic import HarmonicBalance, HarmonicBasis
from suboctave.harmonic.assembly import toeplitz
from suboctave.harmonic.perturbation import Kind

#: period doublings of the reference oscillator at p = 0.55 by shooting: exact law, arctan law of sharpness 3000
EXACT, SHARP = (2.2937534169, 3.9697105128), (2.3031529690, 3.9934523291)
#: by harmonic balance with the exact law, first and second
TRUNCATED = {7: (2.2937474090, 3.9697276189), 15: (2.2937571683, 3.9697099799), 63: (2.2937534174, 3.9697105202)}
#: the same by the published system
PUBLISHED = {7: (2.2937369067, 3.9696952293), 15: (2.2937535514, 3.9697093215), 63: (2.2937534121, 3.9697105180)}


def above(system, harmonics, omega, away=5e-3, span=3.2):
    """The motion some way above omega, as a start."""
    orbit = so.frequency_response(system, (omega + 2.0 * away, omega + away), harmonics=harmonics).orbits[-1]
    return Guess(orbit.state(), "omega", span)


def oscillator(regularization=None):
    return so.library.reference_oscillator(p=0.55, regularization=regularization)


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("harmonics", [7, 15, 63])
def test_period_doublings_of_the_exact_law(harmonics, which):
    guess = above(oscillator(), harmonics, EXACT[which])
    one, two = locate_singular(guess, Kind.HALF), locate_singular(guess, Kind.HALF, ExtendedOperator)
    assert two.state.omega == pytest.approx(TRUNCATED[harmonics][which], abs=1e-10)
    assert two.state.omega == pytest.approx(one.state.omega, abs=1e-13)
    np.testing.assert_allclose(two.state.x, one.state.x, atol=1e-11)
    for a, b in ((one.vectors.right, two.vectors.right), (one.vectors.left, two.vectors.left)):
        assert abs(a @ b) == pytest.approx(1.0, abs=1e-12)
    assert two.iterations <= 4
    assert two.residual < 1e-10
    other = locate_doubling(guess)
    assert other.iterations <= 4
    # both miss the place by what the harmonics left out make, and by about as much
    truncation = max(abs(TRUNCATED[harmonics][which] - EXACT[which]), abs(PUBLISHED[harmonics][which] - EXACT[which]))
    assert abs(other.state.omega - EXACT[which]) <= 1.1 * truncation
    assert abs(other.state.omega - PUBLISHED[harmonics][which]) <= 2.0 * truncation
    assert abs(other.vectors.right @ one.vectors.right) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("which", [0, 1])
def test_period_doublings_of_the_arctan_law(which):
    guess = above(oscillator(3000.0), 63, SHARP[which])
    for found in (locate_singular(guess, Kind.HALF, ExtendedOperator), locate_doubling(guess)):
        assert found.state.omega == pytest.approx(SHARP[which], abs=2e-9)


def test_newton_steps_of_the_system_as_printed_do_not_shrink():
    guess = above(oscillator(), 7, EXACT[0])
    phi, q, b = published_vector(locate_doubling(guess).state)
    balance = guess.state.balance
    n = balance.dimension
    x, omega, increments = guess.state.unknowns, guess.state.omega, []
    for _ in range(12):
        state = balance.at(x, omega)
        step = np.linalg.solve(jacobian(state, phi, q), equations(state, phi, q, b))
        x, omega, phi = x - step[:n], omega - step[-1], phi - step[n : 2 * n] - 1j * step[2 * n : -1]
        increments.append(np.linalg.norm(step))
    assert min(increments) > 1e-3


@pytest.mark.parametrize("harmonics", [7, 31])
def test_the_published_jacobian_is_singular_at_the_solution(harmonics):
    """A rotation of phi is left; with the phase condition it is regular."""
    state = locate_doubling(above(oscillator(), harmonics, EXACT[0])).state
    phi, q, _ = published_vector(state)
    matrix = jacobian(state, phi, q)
    n = state.balance.dimension
    phase = np.zeros((1, len(matrix)))
    phase[0, n : 2 * n] = q
    assert np.linalg.svd(matrix, compute_uv=False)[-1] < 1e-9
    assert np.linalg.svd(np.vstack((matrix, phase)), compute_uv=False)[-1] > 0.02


@pytest.mark.parametrize(("harmonics", "tolerance"), [(7, 5e-4), (31, 2e-5)])
def test_both_null_vectors_are_the_same_function_of_time(harmonics, tolerance):
    """`exp(i omega t / 2) phi(t)` is a complex multiple of the half-odd null vector, but for harmonics left out."""
    state = locate_doubling(above(oscillator(), harmonics, EXACT[0])).state
    phi, q, b = published_vector(state)
    assert abs(q @ phi - 1j * b) < 1e-12
    tau = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)
    k = np.arange(1, harmonics + 1)[:, None]
    phi = phi[0] + phi[1::2] @ np.cos(k * tau) + phi[2::2] @ np.sin(k * tau)
    wave = np.exp(0.5j * tau) * phi
    vector, k = null_vectors(state, Kind.HALF).right, np.arange(harmonics + 1)[:, None] + 0.5
    real = vector[::2] @ np.cos(k * tau) + vector[1::2] @ np.sin(k * tau)
    factor = np.vdot(real, wave) / np.vdot(real, real)
    assert np.linalg.norm(wave - factor * real) < tolerance * np.linalg.norm(wave)


@pytest.fixture(scope="module")
def moving():
    """Two DOFs with contact, friction, an unsymmetric damping matrix; a motion of two periods, phi, random numbers."""
    system = so.System(
        mass=[[1.0, 0.1], [0.1, 2.0]],
        damping=[[0.06, -0.01], [0.02, 0.05]],
        stiffness=[[2.0, -1.0], [-1.0, 1.5]],
        elements=[so.CubicSpring(0, 0.2), so.ElasticStop((0, 1), 3.0, 0.2), so.QuadraticDamper(1, 0.1)],
        loads=[so.HarmonicLoad(0, "p*omega")],
        parameters={"p": 1.0},
    )
    balance = HarmonicBalance(system, HarmonicBasis(6, 2))
    random = np.random.default_rng(3)
    x = random.normal(size=(13, 2)) / (1.0 + np.arange(13)[:, None]) ** 1.5
    phi = random.normal(size=26) + 1j * random.normal(size=26)
    return balance, x, phi, random


def test_the_operator_is_that_of_the_paper(moving):
    """`R_X + lambda D1 + lambda^2 D2` with Kronecker products, lambda = i w0/2, and det B = |det N|^2."""
    balance, x, _, _ = moving
    omega = 1.3
    state = balance.at(x, omega)
    mass, damping, _ = balance.linear.equation_of_motion()
    size = balance.basis.size
    derivative = balance.basis.derivative(np.eye(size))
    friction = np.zeros((26, 26))
    unit = np.eye(size)
    for channel in state.own_channels:
        friction += np.kron(toeplitz(channel.damping(0), state.basis.harmonics), np.outer(channel.out, channel.ins[0]))
    assert friction.any()
    first = 2.0 * omega * np.kron(derivative, mass) + np.kron(unit, damping) + friction
    shift = 0.5j * omega / balance.basis.nu
    expected = state.jacobian + shift * first + shift**2 * np.kron(unit, mass)
    found = published_operator(state)
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())
    b = np.block([[expected.real, -expected.imag], [expected.imag, expected.real]])
    sign, size_of = np.linalg.slogdet(b)
    assert sign == 1.0
    other = balance.at(1.1 * x, omega)
    c = published_operator(other)
    change = np.linalg.slogdet(np.block([[c.real, -c.imag], [c.imag, c.real]]))[1] - size_of
    assert log_determinant(other) - log_determinant(state) == pytest.approx(change, rel=1e-9)


@pytest.mark.parametrize("name", ["omega", "p"])
def test_the_published_jacobian_against_differences(moving, name):
    balance, x, phi, random = moving
    q, n, h = random.normal(size=26), 26, 1e-6
    values = dict(balance.values)

    def at(step, way):
        omega = 1.3 + step * way[-1] * (name == "omega")
        changed = {**values, "p": values["p"] + step * way[-1] * (name == "p")}
        state = balance.at(x + step * way[:n].reshape(x.shape), omega, changed)
        return equations(state, phi + step * (way[n : 2 * n] + 1j * way[2 * n : 3 * n]), q, 0.3)

    way = random.normal(size=3 * n + 1)
    expected = (at(h, way) - at(-h, way)) / (2.0 * h)
    found = jacobian(balance.at(x, 1.3), phi, q, name) @ way
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_limit_points():
    """Eq. 15: both folds of the oscillator, by shooting 1.70709593 and 2.54594067 (to what 31 harmonics leave out)."""
    curve = so.frequency_response(oscillator(), (3.0, 1.5), harmonics=31, formulation="extended")
    default = so.frequency_response(oscillator(), (3.0, 1.5), harmonics=31)
    assert sorted(b.omega for b in curve.bifurcations["LP"]) == pytest.approx([1.70709593, 2.54594067], abs=2e-6)
    for a, b in zip(curve.bifurcations["LP"], default.bifurcations["LP"], strict=True):
        assert a.omega == pytest.approx(b.omega, abs=1e-11)
        for one, two in ((a.null_vectors.right, b.null_vectors.right), (a.null_vectors.left, b.null_vectors.left)):
            assert abs(one @ two) == pytest.approx(1.0, abs=1e-7)


def test_neimark_sacker_points_of_the_absorber():
    """Two DOFs: 1.1096 and 1.1956 in the literature."""
    curve = so.frequency_response(so.library.nltva(0.11), (1.08, 1.21), formulation="extended")
    default = so.frequency_response(so.library.nltva(0.11), (1.08, 1.21))
    found = curve.bifurcations["NS"]
    assert [b.omega for b in found] == pytest.approx([1.1096, 1.1956], abs=6e-5)
    for a, b in zip(found, default.bifurcations["NS"], strict=True):
        assert (a.omega, a.kappa) == pytest.approx((b.omega, b.kappa), abs=1e-10)
        assert abs(np.vdot(a.null_vectors.right, b.null_vectors.right)) == pytest.approx(1.0, abs=1e-9)
        assert a.residual < 1e-10


def test_period_doublings_of_two_masses_by_all_formulations():
    """Coupled masses, one beside a stop: five period doublings and two Neimark-Sacker points; by shooting, too."""
    k = np.array([[2.0, -1.0], [-1.0, 2.0]])
    system = so.System(
        np.eye(2),
        0.03 * k,
        2.0 * k,
        [so.ElasticStop(0, 9.0, 0.0), so.CubicSpring(0, 0.1)],
        [so.HarmonicLoad(0, 0.5)],
    )
    default = so.frequency_response(system, (6.0, 1.6), harmonics=31)
    assert [b.kind for b in default.bifurcations] == ["PD", "NS", "NS", "PD", "PD", "PD", "PD"]
    for formulation, tolerance in (("extended", 1e-11), ("alcorta2019", 2e-6)):
        curve = so.frequency_response(system, (6.0, 1.6), harmonics=31, formulation=formulation)
        assert [b.kind for b in curve.bifurcations] == [b.kind for b in default.bifurcations]
        assert not curve.warnings
        for a, b in zip(curve.bifurcations, default.bifurcations, strict=True):
            assert a.omega == pytest.approx(b.omega, abs=tolerance)
            assert a.orbit.residual < 1e-10
    for b in curve.bifurcations["PD"][::2]:
        check = so.verify(b)
        assert check.agrees
        assert check.solution.omega == pytest.approx(b.omega, abs=1e-6)


def test_a_motion_of_two_periods_doubles_again():
    """A parent with nu = 2: the 2T branch of the oscillator at p = 1.7 loses its stability to one of four periods."""
    system = so.library.reference_oscillator(p=1.7)
    parent = so.frequency_response(system, (3.95, 3.9), harmonics=15).orbits[-1]
    basis = HarmonicBasis(30, 2)
    balance = HarmonicBalance(system, basis)
    x = parent.basis.resized(parent.coefficients, basis)
    vector = null_vectors(parent.state(), Kind.HALF).right
    x[1::4, 0], x[2::4, 0] = 0.1 * vector[:30:2], 0.1 * vector[1:30:2]
    for _ in range(15):
        state = balance.at(x, parent.omega)
        x = x - np.linalg.solve(state.jacobian, state.residual).reshape(x.shape)
    assert np.abs(x[1::4]).max() > 1e-3
    orbit = so.PeriodicOrbit(balance, x, parent.omega, dict(parent.values), 0.0, 0.0, None)
    curve = so.continue_branch(orbit, "omega", (3.0, 3.95), harmonics=15, formulation="extended", max_step=0.2)
    doubled = curve.bifurcations["PD"][0]
    assert doubled.orbit.basis.nu == 2
    assert doubled.omega == pytest.approx(3.02970381, abs=1e-6)
    assert so.verify(doubled).agrees
    other = locate_doubling(Guess(replace(doubled.orbit, omega=doubled.omega + 1e-4).state(), "omega", 1.0))
    assert other.state.omega == pytest.approx(doubled.omega, abs=1e-4)


def test_what_is_no_period_doubling_is_refused():
    """A lightly damped oscillator at twice its natural frequency: multipliers come near -1 and det B is least there."""
    system = so.System(1.0, 0.02, 1.0, [so.CubicSpring(0, 0.1)], [so.HarmonicLoad(0, 0.01)])
    with pytest.raises(ConvergenceError):
        locate_doubling(above(system, 5, 2.0, away=0.01))
    curve = so.frequency_response(
        system, (2.3, 1.7), harmonics=5, max_step=0.02, formulation=so.Alcorta2019("determinant")
    )
    assert not len(curve.bifurcations)
    assert not curve.warnings


@pytest.mark.parametrize("formulation", ["extended", "alcorta2019"])
def test_units_of_single_degrees_of_freedom_do_not_matter(formulation):
    """The second mass in thousandths, the DOFs exchanged: the same places, steps and residuals."""
    k, unit = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.diag([1.0, 1e-3])
    found = []
    for dof, change in ((0, np.eye(2)), (1, unit[:, ::-1])):
        mass, stiffness = (change.T @ matrix @ change for matrix in (np.eye(2), k))
        stop = [so.ElasticStop(dof, 9.0, 0.0), so.CubicSpring(dof, 0.1)]
        system = so.System(mass, 0.03 * stiffness, 2.0 * stiffness, stop, [so.HarmonicLoad(dof, 0.5)])
        found.append(so.frequency_response(system, (5.2, 4.7), harmonics=9, formulation=formulation).bifurcations)
    one, other = found
    assert [b.kind for b in one] == [b.kind for b in other] == ["PD", "NS"]
    for a, b in zip(one, other, strict=True):
        assert a.omega == pytest.approx(b.omega, rel=1e-11)
        assert a.residual < 1e-6
        assert b.residual == pytest.approx(a.residual, rel=1e-3, abs=1e-10)
