"""Structural damping: a force `i S x` at every frequency."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse

import suboctave as so
from suboctave.harmonic.perturbation import operator_at

MASS = np.diag([1.0, 2.0, 1.5])
STIFFNESS = np.array([[3.0, -1.0, 0.0], [-1.0, 2.5, -1.0], [0.0, -1.0, 2.0]])
#: the first spring to the ground and the last are damped, not in proportion
LOSSES = np.array([[0.2, 0.0, 0.0], [0.0, 0.03, -0.03], [0.0, -0.03, 0.05]])


def duffing(eta=0.05, force=0.1):
    return so.System(
        1.0, 0.0, 1.0, [so.CubicSpring(0, 0.5)], [so.HarmonicLoad(0, force)], {"eta": eta}, structural="eta"
    )


def direct(mass, damping, stiffness, losses, omega, force):
    return np.linalg.solve(stiffness - omega**2 * mass + 1j * (omega * damping + losses), force)


@pytest.mark.parametrize("where", [[0], [0, 1, 2]])
def test_the_linear_response_is_that_of_a_complex_stiffness(where):
    """With the unknowns where the load acts, and with all of them."""
    loads = [so.HarmonicLoad(0, 0.4), *(so.HarmonicLoad(dof, 1e-300) for dof in where[1:])]
    system = so.System(MASS, 0.01 * MASS, STIFFNESS, [], loads, structural=LOSSES)
    branch = so.frequency_response(system, (0.4, 2.4), harmonics=3)
    for orbit in branch.orbits[::7]:
        x = direct(MASS, 0.01 * MASS, STIFFNESS, LOSSES, orbit.omega, [0.4, 0.0, 0.0])
        np.testing.assert_allclose([orbit.harmonic(1, dof) for dof in range(3)], x, rtol=1e-8, atol=1e-12)


def test_a_large_structure_has_it_in_its_projection():
    n = 120
    springs = scipy.sparse.diags_array([-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], offsets=[-1, 0, 1]).tocsr()
    masses = scipy.sparse.eye_array(n).tocsr() / n**2
    spring = so.PolynomialSpring(n // 2, {1: 0.3})
    system = so.System(
        masses, 0.0 * masses, springs, [spring], [so.HarmonicLoad(5, 0.01)], {"eta": 0.04}, structural={"eta": springs}
    )
    branch = so.frequency_response(system, (2.0, 4.0), harmonics=3)
    assert any("120 degrees of freedom" in words for words in branch.basis)
    assert any("Structural damping" in words for words in branch.basis)
    dense = springs.toarray()
    held = dense.copy()
    held[n // 2, n // 2] += 0.3
    for orbit in branch.orbits[::9]:
        force = 0.01 * np.eye(n)[5]
        x = direct(masses.toarray(), 0.0 * dense, held, 0.04 * dense, orbit.omega, force)
        np.testing.assert_allclose(orbit.harmonic(1, n // 2), x[n // 2], rtol=1e-8)
        np.testing.assert_allclose(orbit.harmonic(1, 100), x[100], rtol=1e-4)


def test_a_moving_base_pulls_by_it_too():
    y = 0.3
    load = so.BaseDisplacement(amplitude=y, coordinates="absolute", phase=0.2)
    moved = so.System(MASS, 0.01 * MASS, STIFFNESS, loads=[load], structural=LOSSES)
    branch = so.frequency_response(moved, (0.5, 1.5), harmonics=3)
    for orbit in branch.orbits[::9]:
        omega = orbit.omega
        pull = (STIFFNESS + 1j * (omega * 0.01 * MASS + LOSSES)) @ np.ones(3) * y * np.exp(0.2j)
        x = direct(MASS, 0.01 * MASS, STIFFNESS, LOSSES, omega, pull)
        np.testing.assert_allclose([orbit.harmonic(1, dof) for dof in range(3)], x, rtol=1e-10)


def test_what_is_dissipated_is_what_the_load_puts_in():
    # of a single mass: pi eta k |x|^2 a period by the spring, pi F |Im x| by the load
    orbit = so.frequency_response(duffing(), (0.8, 1.0), harmonics=9).orbits[-1]
    amplitudes = np.array([abs(orbit.harmonic(k, 0)) for k in range(1, 10)])
    lost = np.pi * 0.05 * np.sum(np.arange(1, 10) * amplitudes**2)
    assert np.isclose(lost, np.pi * 0.1 * abs(orbit.harmonic(1, 0).imag), rtol=1e-8)


# -------------------------------------------------------------------------------------------------------- multipliers
def test_multipliers_of_a_linear_system_are_in_closed_form():
    system = so.System(1.0, 0.0, 4.0, loads=[so.HarmonicLoad(0, 1.0)], structural=4.0 * 0.1)
    orbit = so.frequency_response(system, (0.9, 1.2), harmonics=5).orbits[3]
    kappa = 2.0 * np.sqrt(1.0 + 0.1j)
    expected = np.exp(2j * np.pi * kappa / orbit.omega)
    got = so.stability(orbit).multipliers
    np.testing.assert_allclose(
        sorted(got, key=np.imag), sorted([expected, expected.conjugate()], key=np.imag), rtol=1e-9
    )


def test_multipliers_are_on_the_circle_at_bifurcations():
    branch = so.frequency_response(duffing(), (0.6, 2.2), harmonics=9)
    assert [item.kind for item in branch.bifurcations] == ["LP", "LP"]
    for item in branch.bifurcations:
        assert abs(item.critical_multiplier() - 1.0) < 1e-8
    stop = so.ElasticStop(0, 10.0, 0.55)
    system = so.System(1.0, 0.0, 1.0, [stop], [so.HarmonicLoad(0, 0.5)], structural=0.08)
    doublings = so.frequency_response(system, (0.62, 0.5), harmonics=15).bifurcations["PD"]
    assert doublings
    for item in doublings:
        assert abs(item.critical_multiplier() + 1.0) < 1e-8


def test_as_many_are_outside_as_the_phase_of_the_determinant_turns():
    """Nyquist's criterion on `det J_kappa / prod det A`, which tends to 1: an account of its own."""
    mass, stiffness = np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]])
    cubic = so.CubicSpring(1, 0.6)
    system = so.System(
        mass, 0.0 * mass, stiffness, [cubic], [so.HarmonicLoad(0, 0.25)], {"eta": 0.03}, structural={"eta": stiffness}
    )
    branch = so.frequency_response(system, (0.5, 3.0), harmonics=9)
    counts = []
    for point in branch.points[::9]:
        state = point.orbit.state()
        kappa = np.linspace(1e-9, 0.5, 3001)
        frequency = (kappa[:, None] + np.arange(-9, 10)) * state.rate
        whole = np.linalg.slogdet(operator_at(state, frequency))[0]
        free = state.linear.stiffness(frequency.ravel())
        turned = whole / np.prod(np.linalg.slogdet(free)[0].reshape(frequency.shape), axis=1)
        phase = np.unwrap(np.angle(turned))
        counts.append(point.floquet.unstable)
        assert abs(-(phase[-1] - phase[0]) / np.pi - point.floquet.unstable) < 0.2
    assert {0, 1} <= set(counts)


def test_a_pair_is_found_where_the_viscous_equivalent_has_two_real_ones():
    """With a loss factor of 0.2 they part elsewhere: the pair goes on, and nothing is in doubt where they meet."""
    branch = so.frequency_response(duffing(0.2, 0.5), (0.6, 2.0))
    upper, _ = branch.bifurcations["LP"]
    before = [point for point in branch.points if -0.12 < point.arclength - upper.arclength < -0.03]
    assert len(before) >= 2
    for point in before:
        (mu, other), errors = point.floquet.multipliers, point.floquet.errors
        assert mu.imag != 0.0
        assert mu == other.conjugate()
        assert errors.max() < 1e-3
        # det J_kappa vanishes
        kappa = abs(np.angle(mu)) / (2.0 * np.pi) - 1j * np.log(abs(mu)) / (2.0 * np.pi)
        beside, state = np.array([0.0, 1e-3]), point.orbit.state()
        waves = np.arange(-state.basis.harmonics, state.basis.harmonics + 1)
        at, near = np.linalg.slogdet(operator_at(state, ((kappa + beside)[:, None] + waves) * state.rate))[1]
        assert at < near - 10.0
    assert not branch.audit.unsettled


def test_pairs_of_no_matter_leave_nothing_in_doubt_along_a_ridge():
    """Pairs that begin where no real ones meet make the product of all 1 - mu_i mu_j jump, but not its least factor."""
    springs = 2.0 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
    cubic, load = so.CubicSpring(3, 0.5), so.HarmonicLoad(0, 0.3)
    chain = so.System(np.eye(6), 0.0 * springs, springs, [cubic], [load], {"eta": 0.03}, structural={"eta": springs})
    ridge = so.track_peak(so.frequency_response(chain, (0.5, 0.8)), "eta", (0.02, 0.034))
    assert len(ridge.bifurcations["NS"]) == 1
    assert not ridge.warnings


def test_bifurcations_are_tracked_over_the_loss_factor():
    (fold, _) = so.frequency_response(duffing(), (0.6, 2.2), harmonics=7).bifurcations
    curve = so.track(fold, "eta", (0.03, 0.08))
    for point in curve.points[::8]:
        eta, omega = point.orbit.values["eta"], point.orbit.omega
        again = so.frequency_response(duffing(eta), (0.6, omega + 0.2), harmonics=7).bifurcations["LP"]
        assert min(abs(item.omega - omega) for item in again) < 1e-8


# ------------------------------------------------------------------------------------------------------------ in time
def test_there_is_no_equation_of_motion_in_time():
    system = duffing()
    orbit = so.frequency_response(system, (0.6, 0.8), harmonics=5).orbits[0]
    for ask in (
        lambda: so.integrate(system, omega=1.0, periods=3),
        lambda: so.verify(orbit),
        lambda: so.lyapunov_exponents(system, omega=1.0),
    ):
        with pytest.raises(so.InputError, match="viscous_equivalent"):
            ask()
    assert "Structural damping" in so.stability(orbit, method="hill").note


def test_the_viscous_equivalent_damps_each_mode_by_half_its_loss_factor():
    system = so.System(MASS, 0.0 * MASS, STIFFNESS, [], [], {"eta": 0.06}, structural={"eta": STIFFNESS})
    equivalent = system.viscous_equivalent()
    assert equivalent.structural.zero
    assert not equivalent.parameters
    mass, damping, stiffness = equivalent.matrices()
    flow = np.block(
        [[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]]
    )
    exponents = np.linalg.eigvals(flow)
    np.testing.assert_allclose(-exponents.real / np.abs(exponents), 0.03, rtol=1e-10)


def test_the_equivalent_takes_nothing_from_a_free_body_and_keeps_other_damping():
    stiffness = np.array([[1.0, -1.0], [-1.0, 1.0]])
    damping = {"c": 0.1 * stiffness}
    system = so.System(np.eye(2), damping, stiffness, [], [], {"c": 2.0, "eta": 0.1}, structural={"eta": stiffness})
    equivalent = system.viscous_equivalent()
    assert dict(equivalent.parameters) == {"c": 2.0}
    extra = equivalent.matrices()[1] - 0.2 * stiffness
    np.testing.assert_allclose(extra @ np.ones(2), 0.0, atol=1e-15)
    np.testing.assert_allclose(extra, 0.1 / np.sqrt(2.0) * stiffness, atol=1e-14)


def test_files_keep_it(tmp_path):
    branch = so.frequency_response(duffing(), (0.6, 0.8), harmonics=5)
    branch.save(tmp_path / "branch.nc")
    again = so.load(tmp_path / "branch.nc")
    assert again.system.structural.value({"eta": 0.3}) == 0.3
    assert repr(again) == repr(branch)


def test_negative_losses_are_warned_of():
    with pytest.warns(so.NegativeDampingWarning, match="structural"):
        so.System(1.0, 0.1, 1.0, loads=[so.HarmonicLoad(0, 1.0)], structural=-0.1)


def test_families_of_equal_multipliers():
    # of three equal masses in a ring two modes are equal: roots of the determinant are double
    ring = 3.0 * np.eye(3) - 1.0
    stiffness = np.eye(3) + 0.01 * ring
    springs = [so.PolynomialSpring(i, {2: 0.5, 3: 0.2}) for i in range(3)]
    loads = [so.HarmonicLoad(i, 0.4) for i in range(3)]
    system = so.System(np.eye(3), np.zeros((3, 3)), stiffness, springs, loads, structural=0.03 * stiffness)
    branch = so.frequency_response(system, (1.9, 2.0))
    assert [event.multiplicity for event in branch.bifurcations["PD"]] == [1, 2, 2]
    double = branch.bifurcations["PD"][1]
    assert np.sort(np.abs(double.multipliers + 1.0))[1] < 1e-7
    assert not branch.audit.unsettled
