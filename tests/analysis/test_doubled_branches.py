"""Branches of doubled motions arrive where their odd part vanishes, and are the same curve from both ends.

With the odd part written as eps w, |w| = 1, a period doubling is a regular point of its doubled branch: the bordered
matrix there has a bounded condition number, and with eps the parameter moves like c eps^2, the same for -eps.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

import suboctave as so
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.curves.blow_up import BlownUp, DoubledMotions
from suboctave.curves.identity import lies_on
from suboctave.curves.starts import make_curve

CLOSE = NewtonOptions(tolerance=1e-12)


@pytest.fixture(scope="module")
def spring() -> so.System:
    """One mass on a spring that is not symmetric."""
    law = so.PolynomialSpring(0, coefficients={2: 0.6, 3: 0.3})
    return so.System(1.0, 0.05, 1.0, [law], [so.HarmonicLoad(0, 0.6)])


@pytest.fixture(scope="module")
def doublings(spring) -> list[so.Bifurcation]:
    return list(so.frequency_response(spring, (1.6, 2.4)).bifurcations["PD"])


@pytest.fixture(scope="module")
def doubling(doublings) -> so.Bifurcation:
    return doublings[0]


@pytest.fixture(scope="module")
def blown_up(spring) -> BlownUp:
    """The curve of doubled motions with a given number of harmonics."""
    curve = make_curve(spring, "omega", 1.9, 0.8, 15, 2, None)
    assert isinstance(curve, DoubledMotions)
    return curve.blown_up


@pytest.fixture(scope="module")
def born(blown_up, doubling) -> np.ndarray:
    """The period doubling, solved for as a point of the doubled branch."""
    curve, orbit = blown_up.motions, doubling.orbit
    x = orbit.basis.resized(orbit.x, curve.balance.basis).ravel()
    # the null vector of J_half at the harmonics 1/2, 3/2, ...
    half = orbit.state().half_jacobian
    vector = np.linalg.svd(half)[2][-1]
    w = np.zeros_like(x)
    odd = np.flatnonzero(blown_up.odd)
    w[odd[: len(vector)]] = vector[: len(odd)]
    w /= np.linalg.norm(curve.balance.column_weights * w)
    u = np.concatenate((blown_up.joined(x, w, 1.0), [0.0, doubling.omega]))
    return correct(blown_up, u, blown_up.size_of_odd, blown_up.weights(u, 0.0), CLOSE).u


def beside(curve: BlownUp, u: np.ndarray, eps: float) -> tuple[np.ndarray, float]:
    """The point of the branch with an odd part of a size, and the condition number of its equations."""
    start, weights = u.copy(), curve.weights(u, 0.0)
    start[-2] = eps
    solved = correct(curve, start, curve.size_of_odd, weights, CLOSE)
    rows = np.vstack((solved.evaluation.jacobian / weights, np.eye(len(u))[curve.size_of_odd]))
    return solved.u, float(np.linalg.cond(rows / np.linalg.norm(rows, axis=1)[:, None]))


def test_derivatives_are_those_of_differences(blown_up):
    rng = np.random.default_rng(3)
    n = blown_up.motions.balance.dimension
    decay = 1.0 / (1.0 + np.append(0, np.repeat(np.arange(1, n // 2 + 1), 2))) ** 2
    for eps in (0.1, 1e-3, 0.0):
        u = blown_up.written(np.append(0.3 * rng.normal(size=n) * decay, 2.4))
        u[-2] = eps
        jacobian = blown_up.evaluate(u).jacobian
        steps = np.full(n + 2, 1e-6)
        steps[-2] *= eps or 1.0
        for j in (0, 1, 2, 3, 4, 5, 6, n - 1, n, n + 1):
            ahead, behind = u.copy(), u.copy()
            ahead[j] += steps[j]
            behind[j] -= steps[j]
            change = blown_up.evaluate(ahead).residual - blown_up.evaluate(behind).residual
            np.testing.assert_allclose(jacobian[:, j], change / (2.0 * steps[j]), atol=1e-5, rtol=1e-5)


def test_a_period_doubling_is_a_regular_point_of_its_doubled_branch(blown_up, born, doubling):
    assert born[-1] == pytest.approx(doubling.omega, abs=1e-8)
    numbers, ways = [], []
    for eps in (3e-3, 1e-3, 3e-4, -3e-4):
        u, condition = beside(blown_up, born, eps)
        numbers.append(condition)
        ways.append((u[-1] - born[-1]) / eps**2)
    # among the motions it is singular there: the condition number would grow like 1/eps^2, a hundredfold
    assert max(numbers) < 1.2 * min(numbers)
    assert ways[2] == pytest.approx(ways[3], rel=1e-3)
    assert ways[1] == pytest.approx(ways[2], rel=1e-3)


def test_motions_of_half_the_period_are_no_points_of_it(blown_up, born):
    u = born.copy()
    assert blown_up.evaluate(u).error < 1e-10
    # the parent's motion at another frequency, with the same odd direction
    u[-1] += 0.05
    x, *_ = blown_up.motions.split(blown_up.motion(u))
    assert blown_up.evaluate(u).error > 1e-3
    assert not np.any(x[1::4]), "orders 1, 3, ... have no part at eps = 0"
    assert blown_up.motions.regular(blown_up.motion(u)) is None


# --------------------------------------------------------------------------------------------- both ends of a branch
def same_curve(one: so.Branch, other: so.Branch) -> None:
    """Two branches are one curve, walked from its two ends."""
    for kind in ("LP", "PD", "NS", "BP"):
        places = [np.array([item.omega for item in branch.bifurcations[kind]]) for branch in (one, other)]
        assert len(places[0]) == len(places[1]), kind
        np.testing.assert_allclose(places[0], places[1][::-1], rtol=2e-7)
    for a, b in ((one, other), (other, one)):
        for i in np.linspace(2, len(a.points) - 3, 7).astype(int):
            assert lies_on(a.orbits[i], b.points)


def test_the_branch_is_the_same_from_both_ends(doublings):
    there, back = (so.switch_branch(item, bounds=(1.2, 4.0)) for item in doublings)
    assert there.arrives is not None
    assert back.arrives is not None
    assert there.arrives.omega == pytest.approx(doublings[1].omega, abs=1e-9)
    assert back.arrives.omega == pytest.approx(doublings[0].omega, abs=1e-9)
    assert not there.warnings
    assert len(there.bifurcations["LP"]) == 2
    same_curve(there, back)
    # its last motion is the parent's doubling but for a small odd part
    last = there.orbits[-1]
    assert np.linalg.norm(last.amplitudes[1::2]) < 5e-3 * np.linalg.norm(last.amplitudes)
    assert np.abs(so.verify(last).solution.multipliers - 1.0).min() < 0.02


def three_masses(stiffness: float) -> so.System:
    return so.System(
        np.diag([1.0, 0.7, 1.2]),
        [[0.06, -0.02, 0], [-0.02, 0.05, -0.02], [0, -0.02, 0.06]],
        [[2, -1, 0], [-1, 2, -1], [0, -1, 1.6]],
        elements=[so.ElasticStop((0, 2), stiffness, 0.3), so.PolynomialSpring(1, coefficients={3: 0.5, 2: 0.3})],
        loads=[so.HarmonicLoad(1, 0.4)],
    )


@pytest.mark.slow
@pytest.mark.parametrize(("stiffness", "first", "last"), [(15.0, 0.905661, 0.9239933), (25.0, 0.907794, 0.924027)])
def test_a_branch_arrives_at_a_doubling_right_beside_a_grazing(stiffness, first, last):
    """Its odd part is 1e-4 of the motion where it turns to its parent: it went past, and came back as its own image."""
    response = so.frequency_response(three_masses(stiffness), (0.5, 1.8))
    near = [item for item in response.bifurcations["PD"] if 0.9 < item.omega < 0.93]
    assert [item.omega for item in near] == pytest.approx([first, last], abs=1e-6)
    there, back = (so.switch_branch(item) for item in near)
    assert there.arrives is not None
    assert back.arrives is not None
    assert [there.arrives.omega, back.arrives.omega] == pytest.approx([last, first], abs=1e-6)
    assert not there.bifurcations["BP"]
    same_curve(there, back)
    # what is close to the parent's doubling by shooting
    assert np.abs(so.verify(there.orbits[-1]).solution.multipliers - 1.0).min() < 0.05


@pytest.fixture(scope="module")
def systems():
    path = Path(__file__).parents[2] / "benchmarks" / "random_systems.py"
    spec = importlib.util.spec_from_file_location("random_systems", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_a_branch_does_not_come_back_along_itself(systems):
    """A sharp turn beside its birth: both branches came back along themselves, or said that they left the range."""
    description = systems.describe(1031, False)
    low, high = min(description["omega"]), max(description["omega"])
    doublings = so.frequency_response(systems.system_of(description), tuple(description["omega"])).bifurcations["PD"]
    assert len(doublings) == 2
    for item in doublings:
        branch = so.switch_branch(item)
        assert branch.arrives is None
        assert branch.omega[-1] in (low, high)
        assert so.verify(branch.orbits[-1]).agrees


@pytest.mark.slow
def test_a_limit_point_right_beside_the_birth_is_seen_from_both_ends(systems):
    """It lies 1e-6 below the doubling, in which the branch sets out to lower frequencies."""
    system = systems.system_of(systems.describe(1001, False))
    doublings = so.frequency_response(system, (0.53, 0.56)).bifurcations["PD"]
    there, back = (so.switch_branch(item) for item in doublings)
    (one,), (other,) = (branch.bifurcations["LP"] for branch in (there, back))
    assert one.omega == pytest.approx(other.omega, abs=2e-8)
    assert 0.0 < doublings[0].omega - one.omega < 1e-6


@pytest.mark.slow
def test_the_step_that_arrives_stays_on_its_branch(systems):
    """Another branch arrives close by: a step onto it, behind its doubling, once ended this one there."""
    description = systems.describe(1190, True)
    system = systems.system_of(description)
    doublings = so.frequency_response(system, tuple(description["omega"])).bifurcations["PD"]
    start = min(doublings, key=lambda point: abs(point.omega - 0.937098))
    branch = so.switch_branch(start)
    assert branch.arrives is not None
    assert branch.arrives.omega == pytest.approx(1.0230945, abs=1e-5)
    assert not branch.warnings
    assert {round(point.omega, 4) for point in branch.bifurcations["LP"]} == {0.9741, 0.9545, 1.0344, 1.0283, 1.0316}
