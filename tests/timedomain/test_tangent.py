"""Tangent vectors of compiled flows, against the variational equations integrated with SciPy and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from slow import slow

import suboctave as so
from suboctave.errors import InputError
from suboctave.timedomain.flow import Flow
from suboctave.timedomain.shooting import shoot
from suboctave.timedomain.trajectory import state_transition
from suboctave.timedomain.trapping import traps_about

LOADS = [so.HarmonicLoad(0, amplitude="p", phase=0.3)]


def one(*elements):
    return so.System(1.3, 0.12, 1.1, elements=elements, loads=LOADS, parameters={"p": 0.8})


def two(*elements):
    return so.System(
        np.diag([1.0, 1.4]), [[0.06, -0.02], [-0.02, 0.05]], [[2.0, -1.0], [-1.0, 1.5]], elements=elements, loads=LOADS,
        parameters={"p": 0.8},
    )  # fmt: skip


SYSTEMS = {
    "stops": one(so.ElasticStop(0, 5.0, 0.3), so.ElasticStop(0, 3.0, -0.5), so.CubicSpring(0, 0.2)),
    "rounded": one(so.ElasticStop(0, 5.0, 0.3, regularization=80.0)),
    "dampers": one(so.QuadraticDamper(0, 0.3), so.TanhFriction(0, 0.2, 0.3)),
    "text": one(so.Expression(0, "2*max(x - 0.2, 0) + 0.1*x' * abs(x') + 0.1*x**3")),
    "two": two(so.ElasticStop((0, 1), 4.0, 0.2), so.CubicSpring(1, 0.5)),
}


@pytest.mark.parametrize(
    "name",
    ["stops", *slow("two", "rounded", "dampers", "text")],
)
def test_state_transition_matrix(name):
    system = SYSTEMS[name]
    state = np.linspace(0.4, -0.7, 2 * system.n)
    omega = 1.3
    flow = Flow(system, tangents=2 * system.n, transition=True, tolerance=1e-12, lanes=8)
    motions = flow.over(state, omega, 2)
    end, transition = state_transition(system, state, (0.0, 4.0 * np.pi / omega), omega)
    assert np.abs(motions.end[0] - end).max() < 1e-9
    assert np.abs(motions.tangents[0] - transition).max() < 1e-7
    # the volume that the flow keeps is the determinant of its derivative (Liouville)
    assert abs(motions.growth[0, :, -1].sum() - np.log(np.linalg.det(transition))) < 1e-7


def test_growth_of_many_linear_degrees_of_freedom():
    """Of a linear system the exponents are the real parts of its eigenvalues, however far apart."""
    n = 5
    damping = np.diag([0.02, 0.3, 1.0, 6.0, 40.0])
    system = so.System(np.eye(n), damping, np.diag(np.arange(1.0, n + 1)), loads=LOADS, parameters={"p": 0.1})
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(np.arange(1.0, n + 1)), -damping]])
    expected = np.sort(np.linalg.eigvals(a).real)[::-1]
    found = so.lyapunov_exponents(system, omega=2.3, periods=100, transient=30, trajectories=2)
    # expm(a T) has a condition of 1e54: a matrix over a whole period could not show the smallest ones
    assert np.linalg.cond(expm(a * 2.0 * np.pi / 2.3)) > 1e16
    assert np.abs(found.exponents - expected).max() < 1e-4
    assert found.defect < 1e-6
    assert not found.chaotic


def test_a_trap_holds_what_it_catches():
    """States drawn from the neighbourhoods of a stable motion are at the motion at last; unstable ones have none."""
    system = so.library.duffing(c=0.1, alpha=1.0, F=0.3)
    for state, stable in (([-0.2, 0.0], True), ([1.5, 0.0], True)):
        motion = shoot(system, so.integrate(system, start=state, omega=1.5, periods=1, transient=150).end, 1.5)
        assert motion.stable is stable
        sizes = np.array([1.0, 1.5]) * motion.amplitude
        (trap,) = traps_about(system, motion.state[None], 1.5, {}, sizes)
        assert trap.radius > 1e-3
        random = np.random.default_rng(3)
        away = random.normal(size=(300, 2))
        away *= trap.radius / np.linalg.norm(away, axis=1, keepdims=True)
        states = motion.state + away @ np.linalg.inv(trap.factor).T
        end = Flow(system).over(states, 1.5, 200).end
        assert np.abs(end - motion.state).max() < 1e-3 * motion.amplitude


def test_an_unstable_motion_has_no_trap():
    system = so.library.duffing(c=0.1, alpha=1.0, F=0.3)
    curve = so.frequency_response(system, omega=(2.5, 0.8))
    unstable = [p.orbit for p in curve.points if not p.floquet.stable]
    orbit = unstable[len(unstable) // 2]
    motion = shoot(system, orbit.start(), orbit.omega)
    assert not motion.stable
    assert traps_about(system, motion.state[None], motion.omega, {}, np.ones(2)) == []


def test_tangents_need_the_accurate_method():
    for options in ({"method": "newmark", "tangents": 2}, {"tangents": 3}):
        with pytest.raises(InputError, match="tangents"):
            Flow(one(), **options)
