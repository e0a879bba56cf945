"""Multiple shooting on compiled flows: pieces join, monodromy matrices are exact, motions are found from afar."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.timedomain import shoot, state_transition
from suboctave.timedomain.flow import Flow
from suboctave.timedomain.multiple_shooting import PIECES, MultipleShooting


@pytest.fixture(scope="module")
def system():
    return so.library.duffing(c=0.1, F=0.3)


def along(system, state, omega, periods=1):
    """States (1, N, 2n) of a trajectory at the instants of the pieces."""
    count = periods * PIECES
    times = np.arange(count + 1) * (2.0 * np.pi / omega / PIECES)
    flow = so.integrate(system, start=state, omega=omega, periods=periods, steps_per_period=PIECES)
    assert np.allclose(flow.time, times)
    return np.hstack([flow.displacement, flow.velocity])[None, :count]


def test_pieces_join_to_the_whole(system):
    """Each from the end of the one before, at phases of their own, with frequencies of their own."""
    states, omega = np.array([[0.3, -0.2], [1.0, 0.5]]), np.array([0.9, 1.7])
    flow = Flow(system, samples=PIECES, tolerance=1e-13)
    whole = flow.over(states, omega, 1).end
    joined = states
    for first in range(PIECES):
        joined = flow.onward(joined, omega, np.full(2, first)).end
    np.testing.assert_allclose(joined, whole, rtol=1e-11)
    with pytest.raises(InputError, match="accurate"):
        Flow(system, "newmark", PIECES).onward(states, omega, np.zeros(2, dtype=int))


def test_a_linear_oscillator_is_exact():
    """The monodromy matrix is the exponential of the companion matrix; the motion is the complex gain."""
    from scipy.linalg import expm

    system = so.library.duffing(c=0.3, k=2.0, alpha=0.0, F=0.5)
    omega = 1.2
    found = MultipleShooting(system, 1).solve(
        along(system, [0.4, 0.1], omega), np.array([omega]), {}, np.array([[0.5, 0.6]])
    )
    assert found.converged[0]
    w = found.omega[0]  # that of the nearest motion
    gain = 0.5 / (2.0 - w**2 + 0.3j * w)
    np.testing.assert_allclose(found.states[0, 0], [gain.real, (1j * w * gain).real], rtol=1e-9)
    scale = np.array([0.5, 0.6])
    exact = expm(np.array([[0.0, 1.0], [-2.0, -0.3]]) * 2.0 * np.pi / w)
    np.testing.assert_allclose(found.monodromy[0] * scale[:, None] / scale, exact, atol=1e-8)


def test_as_single_shooting_finds_it(system):
    """A nonlinear motion, a start some percent off, the tangent of the curve, and the errors that are told."""
    omega = 1.5
    true = shoot(system, so.integrate(system, omega=omega, periods=5, transient=100).end, omega)
    sizes = np.array([[true.amplitude, true.amplitude * omega]])
    found = MultipleShooting(system, 1).solve(along(system, 1.03 * true.state, omega), np.array([omega]), {}, sizes)
    assert found.converged[0]
    assert found.residual[0] < 1e-11
    again = shoot(system, found.states[0, 0], found.omega[0])
    np.testing.assert_allclose(found.states[0, 0], again.state, rtol=1e-9)
    exact = state_transition(system, again.state, (0.0, again.period), again.omega)[1]
    np.testing.assert_allclose(found.monodromy[0] * sizes.T / sizes, exact, atol=1e-7)
    multipliers, errors = found.multipliers()
    assert errors.max() < 1e-6
    np.testing.assert_allclose(np.prod(multipliers[0]).real, np.exp(-0.1 * 2.0 * np.pi / found.omega[0]), rtol=1e-7)
    # the tangent: the motion at a neighbouring frequency
    step = 1e-4 * omega
    sides = [shoot(system, found.states[0, 0], found.omega[0] + way * step).state for way in (-1.0, 1.0)]
    slope = (sides[1] - sides[0]) / sizes[0] / (2.0 * step / omega)
    t = found.tangent[0]
    np.testing.assert_allclose(t[:2] / t[-1], slope, rtol=1e-4)


def test_where_there_is_no_motion():
    """A load on a mass that nothing holds back: the trajectory leaves the range of numbers."""
    away = so.System(
        mass=1.0, damping=0.0, stiffness=0.0, elements=[so.CubicSpring(dof=0, coefficient=-1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude=1.0)],
    )  # fmt: skip
    found = MultipleShooting(away, 1).solve(
        np.full((1, PIECES, 2), 50.0), np.array([0.1]), {}, np.array([[50.0, 50.0]])
    )
    assert not found.converged[0]
    assert np.isnan(found.multipliers()[0]).all()
