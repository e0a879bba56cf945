"""Structures of many modes, most of them far too fast for the harmonics: multipliers against exact exponentials.

Along a motion through stops the linearised motion has constant matrices between the instants of contact: its monodromy
matrix is a product of exponentials of all modes, whatever their frequencies are.
"""

import numpy as np
import pytest
from many_modes import GAPS, STIFFNESS, displacement, motion_of, structure
from scipy.integrate import solve_ivp
from scipy.linalg import eig, expm
from scipy.optimize import brentq, linear_sum_assignment

import suboctave as so
from suboctave.floquet import monodromy
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic import HarmonicBalance, HarmonicBasis


def exact(system, directions, state):
    """The product of exponentials between the instants at which contacts begin and end."""
    _, damping, stiffness = system.matrices()
    contacts = [(state.x @ d, gap, STIFFNESS * np.outer(d, d)) for d, gap in zip(directions, GAPS, strict=False)]
    return product(damping, stiffness, contacts, state.rate)


def product(damping, stiffness, contacts, rate):
    """Multipliers of modes with unit masses; contacts: coefficients of a displacement, gap, what a contact adds."""
    zero, one = np.zeros_like(stiffness), np.eye(len(stiffness))
    grid, instants = np.linspace(0.0, 2.0 * np.pi, 2001), []

    def beyond(tau, c, gap):
        k = np.arange(1, len(c) // 2 + 1)
        return c[0] + np.cos(tau * k) @ c[1::2] + np.sin(tau * k) @ c[2::2] - gap

    for c, gap, _ in contacts:
        for i in np.flatnonzero(np.diff(np.sign([beyond(tau, c, gap) for tau in grid]))):
            instants.append(brentq(beyond, grid[i], grid[i + 1], (c, gap), xtol=1e-15))
    assert instants
    instants.sort()
    result = np.eye(2 * len(stiffness))
    for a, b in zip(instants, [*instants[1:], instants[0] + 2.0 * np.pi], strict=True):
        k = stiffness + sum(added for c, gap, added in contacts if beyond(0.5 * (a + b), c, gap) > 0.0)
        result = expm(np.block([[zero, one], [-k, -damping]]) * (b - a) / rate) @ result
    return np.linalg.eigvals(result)


def differences(mu, errors, expected):
    """Distances of multipliers that belong together, with the stated errors; those that have decayed aside."""
    apart = np.abs(mu[:, None] - expected)
    i, j = linear_sum_assignment(apart)
    alive = np.abs(expected[j]) > 1e-3
    return apart[i, j][alive], errors[i][alive]


def before(state):
    """Multipliers along the motion as it stands, with the errors of propagation alone."""
    motion = monodromy.Linearised(state)
    mu, errors = motion.others()
    own, left, right = eig(motion.before, left=True, right=True)
    # a matrix that changes moves an eigenvalue by so many times as much
    shares = left.conj() * right
    condition = 1.0 / np.abs(np.sum(shares, axis=0))
    # without those in which what stands in for fast modes has most part
    strange = np.abs(np.sum(shares[motion.own :], axis=0)) * condition
    kept = np.argsort(strange)[: motion.own]
    ahead, behind = (
        np.linalg.norm(vectors[: motion.own] * missing[:, None], axis=0)
        for vectors, missing in zip((left, right), motion.missing, strict=True)
    )
    least = 1e-8 * np.abs(own).max(initial=1.0) + np.abs(own) * ahead * behind * condition
    own, least = own[kept], least[kept]
    return motion, np.concatenate((own, mu)), np.concatenate((least, errors))


@pytest.mark.parametrize("kind", ["stiffness-proportional", "modal", "full"])
@pytest.mark.parametrize("channels", [1, 2])
def test_fast_modes(kind, channels):
    """Few states are left of twice fourteen, and the stated errors cover what that does."""
    for seed in range(4):
        system, directions = structure(14, 3e3, channels, kind, seed)
        state = motion_of(system, 9, 1.1, seed)
        motion, mu, errors = before(state)
        assert motion.size <= 20
        assert len(motion.spans) < 150
        difference, stated = differences(mu, errors, exact(system, directions, state))
        assert len(difference) >= 4
        assert np.all(difference <= stated)
        assert np.all(difference < 2e-4)


@pytest.mark.parametrize("kind", ["stiffness-proportional", "modal", "full"])
def test_all_modes_with_states(kind, monkeypatch):
    """Where nothing may be neglected everything is exact, with far fewer panels than vibrations of the fastest mode."""
    monkeypatch.setattr(monodromy, "_NEGLECTED", (0.0, 0.0))
    for seed in range(2):
        system, directions = structure(7, 120.0, 2, kind, seed)
        state = motion_of(system, 9, 1.1, seed)
        motion, mu, errors = before(state)
        assert motion.own == motion.size
        assert not motion.missing.any()
        assert len(motion.spans) < 40
        difference, _ = differences(mu, errors, exact(system, directions, state))
        assert difference.max() < 1e-11


def test_a_plate_with_five_stops(monkeypatch):
    """All multipliers of its projection are those of the product of exponentials."""
    pytest.importorskip("skfem")
    monkeypatch.setattr(monodromy, "_NEGLECTED", (0.0, 0.0))
    plate = so.structures.clearance_plate(12, 8, stops=5)
    orbit = so.frequency_response(plate, (2.2, 2.19), harmonics=15).orbits[-1]
    state = orbit.balance.at(orbit.x, orbit.omega)
    mass, damping, stiffness = state.linear.equation_of_motion()
    gap, held = plate.parameters["gap"], plate.parameters["Kc"]
    contacts = [
        (state.x @ group.inputs[0], gap, state.linear.expand(group.direction)) for group in state.balance.groups
    ]
    inverse = np.linalg.inv(mass)
    contacts = [(c, gap, held * inverse @ np.outer(d, d)) for c, gap, d in contacts]
    motion, mu, errors = before(state)
    assert len(motion.spans) < 40
    difference, _ = differences(mu, errors, product(inverse @ damping, inverse @ stiffness, contacts, state.rate))
    assert len(difference) >= 10
    assert difference.max() < 1e-10


def test_masses_that_move_freely_while_others_are_in_contact():
    """Without damping the eigenvectors of a free mass are parallel: panels then follow the contact."""
    stiffness = np.array([[4.0, -4.0, 0.0], [-4.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    elements = [so.ElasticStop(None, STIFFNESS, gap, direction=d) for d, gap in zip(directions, GAPS, strict=True)]
    system = so.System(np.eye(3), np.zeros((3, 3)), stiffness, elements, [so.HarmonicLoad(0, 1.0)])
    x = np.zeros((19, 3))
    x[1], x[4] = (1.3, 1.0, 0.9), (0.2, 0.1, -0.3)
    state = HarmonicBalance(system, HarmonicBasis(9)).at(x, 1.1)
    motion, mu, errors = before(state)
    assert motion.loose.any()
    difference, stated = differences(mu, errors, exact(system, directions, state))
    assert np.all(difference <= stated)


@pytest.mark.parametrize("kind", ["modal", "full"])
def test_fast_modes_of_a_smooth_force(kind):
    """Along a cubic spring, against a general-purpose integrator for all modes: the fast ones' flexibility in series
    with the spring tells all about them but their inertia.
    """
    system, (d,) = structure(6, 60.0, 1, kind, 0, lambda d: so.CubicSpring(direction=d, coefficient=0.3))
    state = motion_of(system, 9, 1.1, 0)
    motion, mu, errors = before(state)
    assert motion.size < 12
    _, damping, stiffness = system.matrices()

    def field(t, y):
        u, v = y.reshape(2, 6, 12)
        q = displacement(state, d, state.rate * t)
        return np.concatenate((v, -stiffness @ u - damping @ v - 0.9 * q**2 * np.outer(d, d @ u))).ravel()

    period = 2.0 * np.pi / state.rate
    solution = solve_ivp(field, (0.0, period), np.eye(12).ravel(), method="DOP853", rtol=1e-9, atol=1e-11)
    expected = np.linalg.eigvals(solution.y[:, -1].reshape(12, 12))
    difference, stated = differences(mu, errors, expected)
    assert np.all(difference <= stated)
    result = floquet_multipliers(state)
    assert len(result.multipliers) == 12
    assert np.all(np.diff(np.abs(result.multipliers)) <= 1e-12)


def test_modes_that_no_channel_sees():
    """They are free, whatever the others do: multipliers to rounding."""
    system, _ = structure(6, 40.0, 1, "modal", 0)
    hidden = np.array([[1.0, 0.7, 0.0, 0.5, 0.0, 0.6]])
    system = so.System(
        np.eye(6), system.matrices()[1], system.matrices()[2],
        [so.ElasticStop(direction=hidden[0], stiffness=STIFFNESS, gap=GAPS[0])], [so.HarmonicLoad(0, 1.0)],
    )  # fmt: skip
    state = motion_of(system, 9, 1.1, 0)
    result = floquet_multipliers(state)
    for i in (2, 4):
        c, k = system.matrices()[1][i, i], system.matrices()[2][i, i]
        for root in np.roots([1.0, c, k]):
            at = np.abs(result.multipliers - np.exp(root * 2.0 * np.pi / 1.1)).argmin()
            assert abs(result.multipliers[at] - np.exp(root * 2.0 * np.pi / 1.1)) < 1e-13
            assert result.errors[at] < 1e-12


def test_many_forces_that_vary():
    """Cubic springs at every mass of a chain, whose forces make systems of many equations on every panel: against a
    general-purpose integrator.
    """
    n, stiffness = 6, 2.0 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
    springs = [so.PolynomialSpring(i, coefficients={3: 0.5 + 0.2 * i}) for i in range(n)]
    dampers = [so.QuadraticDamper(i, 0.05) for i in range(1, n, 2)]
    damping = 0.02 * (stiffness + np.eye(n))
    system = so.System(np.eye(n), damping, stiffness, elements=springs + dampers, loads=[so.HarmonicLoad(n - 1, 1.0)])
    state = so.frequency_response(system, (0.6, 0.61), harmonics=9).orbits[-1].state()
    _, mu, errors = before(state)
    coefficients, rates = np.array([0.5 + 0.2 * i for i in range(n)]), np.array([0.0, 0.05] * 3)

    def field(t, y):
        u, v = y.reshape(2, n, 2 * n)
        k = np.arange(1, len(state.x) // 2 + 1) * state.rate
        cos, sin = np.cos(k * t), np.sin(k * t)
        q = state.x[0] + cos @ state.x[1::2] + sin @ state.x[2::2]
        speed = (k * cos) @ state.x[2::2] - (k * sin) @ state.x[1::2]
        added = (3.0 * coefficients * q**2)[:, None] * u + (2.0 * rates * np.abs(speed))[:, None] * v
        return np.concatenate((v, -stiffness @ u - damping @ v - added)).ravel()

    period = 2.0 * np.pi / state.rate
    solution = solve_ivp(field, (0.0, period), np.eye(2 * n).ravel(), method="DOP853", rtol=1e-9, atol=1e-11)
    expected = np.linalg.eigvals(solution.y[:, -1].reshape(2 * n, 2 * n))
    difference, _ = differences(mu, errors, expected)
    assert np.all(difference < 1e-7)
