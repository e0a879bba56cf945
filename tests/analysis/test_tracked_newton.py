"""Points of tracked curves solved for in compiled calls, against the general way through the equations' own methods."""

from __future__ import annotations

import subprocess
import sys
from functools import cache

import numpy as np
import pytest

import suboctave as so
from suboctave.analysis import tracked_curve, tracked_newton
from suboctave.analysis.tracked_curve import TrackedCurve
from suboctave.analysis.tracked_iteration import FIRST, ITERATION, MEMO, PREVIOUS, RATE, stepped
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import make_point
from suboctave.errors import ConvergenceError
from suboctave.harmonic.changing_laws import ChangingLaws

OPTIONS = NewtonOptions()


def two_masses():
    """Rounded stops along two directions, a play, stops with corners, a polynomial."""
    elements = [
        so.ElasticStop(dof=0, stiffness="k", gap="gap", regularization=300.0),
        so.Freeplay(dof=1, stiffness=1.2, gap="2*gap", regularization=500.0),
        so.ElasticStop(direction=[-1.0, 1.0], stiffness="k", gap=0.3),
        so.CubicSpring(direction=[-1.0, 1.0], coefficient="cubic"),
    ]
    stiffness = np.array([[3.0, -1.0], [-1.0, 2.0]])
    loads = [so.HarmonicLoad(dof=0, amplitude="p")]
    values = {"k": 4.0, "gap": 0.1, "p": 0.9, "cubic": 0.4}
    return so.System(np.diag([1.0, 0.7]), 0.03 * stiffness, stiffness, elements, loads, values)


CASES = {
    "corners, PD": (lambda: so.library.reference_oscillator(p=0.55, j=0.05), (4.5, 1.3), "PD", ("j", "Kc", "p")),
    "rounded, PD": (
        lambda: so.library.reference_oscillator(p=0.55, j=0.05, regularization=3e3),
        (4.5, 1.3),
        "PD",
        ("j", "Kc", "p"),
    ),
    "rounded, LP": (
        lambda: so.library.reference_oscillator(p=0.55, j=0.05, regularization=3e3),
        (4.5, 1.3),
        "LP",
        ("j", "p"),
    ),
    "polynomials, LP": (lambda: so.library.nltva(0.15), (0.8, 1.3), "LP", ("F",)),
    "all of them, LP": (two_masses, (1.0, 3.0), "LP", ("gap",)),
}
EVERY = [(case, name, 1e-6) for case, (*_, names) in CASES.items() for name in names]
#: and one of each with new factors at every point
EVERY += [(case, names[0], 0.0) for case, (*_, names) in CASES.items()]


@cache
def located(case):
    make, bounds, kind, _ = CASES[case]
    # with as many rows of two DOFs that g keeps its factors after short steps
    return so.frequency_response(make(), bounds, 21 if make is two_masses else 15).bifurcations[kind][0]


@cache
def places(case, name):
    """Some points met along a curve: its equations, and a prediction beside each with its row and weights."""
    item = located(case)
    value = item.orbit.values[name]
    met = []
    own = TrackedCurve.corrected

    def noted(self, guess, row, weights, options, spare, known=None):
        met.append((self, guess.copy(), row.copy(), weights.copy()))
        return own(self, guess, row, weights, options, spare, known)

    patch = pytest.MonkeyPatch()
    patch.setattr(TrackedCurve, "corrected", noted)
    try:
        so.track(item, name, (0.9 * value, 1.1 * value))
    finally:
        patch.undo()
    return met[2 :: max(1, len(met) // 3)]


def generally(monkeypatch):
    monkeypatch.setattr(tracked_newton, "applies", lambda curve: False)
    monkeypatch.setattr(tracked_curve, "evaluate_at_once", lambda evaluation: None)
    monkeypatch.setattr(tracked_curve, "matrix_at_once", lambda evaluation, row, weights: None)


@pytest.mark.parametrize("asking", [False, True], ids=["at once", "elements asked"])
@pytest.mark.parametrize(("case", "name", "spare"), EVERY)
def test_both_ways_agree(monkeypatch, case, name, spare, asking):
    for curve, guess, row, weights in places(case, name):
        assert curve.balance.laws_along(name).linear is not None
        with monkeypatch.context() as patch:
            if asking:
                patch.setattr(ChangingLaws, "linear", None)
                curve.balance.laws_along(name).__dict__.pop("linear", None)
            one = curve.corrected(guess, row, weights, OPTIONS, spare)
        assert one is not None
        with monkeypatch.context() as patch:
            generally(patch)
            other = correct(curve, guess, row, weights, OPTIONS, spare=spare)
            b = make_point(other, curve, None, 0.0)
            equations = other.evaluation.equations
            told = equations.gradient, equations.bordered, other.evaluation.residual, equations.rows
        a = make_point(one, curve, None, 0.0)
        assert a.u == pytest.approx(b.u, abs=1e-10 * np.abs(b.u).max())
        assert a.iterations == b.iterations
        assert a.tangent == pytest.approx(b.tangent, abs=1e-7 * np.abs(b.tangent).max())
        assert a.orientation == b.orientation
        assert one.distance == pytest.approx(other.distance, rel=1e-5, abs=1e-11)
        lu = other.factor.lu
        assert one.factor.lu == pytest.approx(lu, abs=1e-6 * np.abs(lu).max())
        (by_x, rates, by_kappa), border, residual, rows = told
        own = one.evaluation.equations
        size = np.abs(by_x).max()
        assert own.gradient[0] == pytest.approx(by_x, abs=1e-7 * size)
        assert own.rows == pytest.approx(rows, abs=1e-7 * np.abs(rows).max())
        for free in curve.names:
            assert own.gradient[1][free] == pytest.approx(rates[free], rel=1e-6, abs=1e-7 * size)
        assert own.gradient[2] == pytest.approx(by_kappa, rel=1e-6, abs=1e-9 * size)
        assert own.bordered.right == pytest.approx(border.right, abs=1e-8 * np.abs(border.right).max())
        assert own.bordered.left == pytest.approx(border.left, abs=1e-8 * np.abs(border.left).max())
        assert one.evaluation.residual == pytest.approx(residual, abs=1e-10 * curve.force)
        assert own.state.half_jacobian == pytest.approx(curve.evaluate(a.u).state.half_jacobian, abs=1e-9)


@pytest.mark.parametrize("case", CASES)
def test_factors_of_a_neighbour_are_used(monkeypatch, case):
    first, *_, last = places(case, CASES[case][3][0])
    curve, guess, row, weights = last
    known = curve.corrected(guess, row, weights, OPTIONS, 0.0).factor
    before = known.lu.copy()
    shifted = guess + 1e-4 * row / weights
    one = curve.corrected(shifted, row, weights, OPTIONS, 0.0, known)
    with monkeypatch.context() as patch:
        generally(patch)
        other = correct(curve, shifted, row, weights, OPTIONS, known)
    assert one.iterations == other.iterations > 0
    assert one.u == pytest.approx(other.u, abs=1e-10 * np.abs(other.u).max())
    assert (known.lu == before).all()
    assert first[0] is not curve


def test_coefficients_that_are_not_linear_in_the_parameter():
    """The same curve whether the gap is a parameter or its square root is."""
    found = []
    for gap, bounds in (("g", (0.01, 0.04)), ("r**2", (0.1, 0.2))):
        stop = so.ElasticStop(0, stiffness=4.0, gap=gap, side="right", regularization=300.0)
        loads, values = [so.HarmonicLoad(0, "p")], {"g": 0.0225, "r": 0.15, "p": 0.5}
        system = so.System(1.0, 0.06, 1.0, [stop], loads, {gap[0]: values[gap[0]], "p": values["p"]})
        item = so.frequency_response(system, (4.5, 1.3), 15).bifurcations["PD"][0]
        curve = so.track(item, gap[0], bounds)
        assert (curve.points[0].orbit.balance.laws_along(gap[0]).linear is None) == (gap != "g")
        found.append(curve)
    for end in (0, -1):
        assert found[0].parameter("g")[end] == pytest.approx(found[1].parameter("r")[end] ** 2, rel=1e-12)
        assert found[0].omega[end] == pytest.approx(found[1].omega[end], rel=1e-9)


def test_what_does_not_converge_is_said(monkeypatch):
    curve, guess, row, weights = places("corners, PD", "j")[-1]
    far = guess + 0.3 * row / weights
    far[:-2] *= 1.4
    said = []
    for way in ("at once", "generally"):
        with monkeypatch.context() as patch:
            if way == "generally":
                generally(patch)
            with pytest.raises(ConvergenceError) as caught:
                correct(curve, far, row, weights, NewtonOptions(iterations=2))
            said.append(str(caught.value))
    assert said[0] == said[1]
    assert "after 2 iterations" in said[0]


def test_corrections_that_come_to_nothing_are_seen():
    """Two in succession that hardly shrink, or one that grows far beyond the first."""
    for rate, length, ends in ((0.9, 0.9, True), (0.9, 0.7, False), (0.5, 0.9, False), (0.1, 2.5, True)):
        memo = np.zeros(MEMO)
        memo[PREVIOUS], memo[RATE], memo[ITERATION], memo[FIRST] = 1.0, rate, 2, 1.0
        u, row = np.zeros(3), np.array([0.0, 0.0, 1.0])
        lu, pivots = np.eye(3), np.arange(3, dtype=np.int32)
        assert stepped(u, u.copy(), row, np.ones(3), np.array([length]), 0.0, lu, pivots, memo) == ends
        assert u == pytest.approx([-length, 0.0, 0.0])
        assert memo[RATE] == pytest.approx(length)


def test_a_frequency_that_is_not_positive_is_left_to_the_general_way():
    curve, guess, row, weights = places("corners, PD", "j")[-1]
    wrong = guess.copy()
    wrong[-2] = -1.0
    assert curve.corrected(wrong, row, weights, OPTIONS, 0.0) is None
    with pytest.raises(ConvergenceError, match="omega is not positive"):
        correct(curve, wrong, row, weights, OPTIONS)


def test_whole_curves_agree(monkeypatch):
    item = located("rounded, PD")
    one = so.track(item, "Kc", (4.0, 9.0))
    generally(monkeypatch)
    other = so.track(item, "Kc", (4.0, 9.0))
    assert len(one) == len(other)
    for a, b in zip(one.points, other.points, strict=True):
        assert a.orbit.omega == pytest.approx(b.orbit.omega, abs=1e-9)
        assert a.coefficient == pytest.approx(b.coefficient, rel=1e-6)


ORDINARY = """
import suboctave as so
from suboctave.analysis import response, tracked_newton
calls = dict.fromkeys(("corrected", "iterated"), 0)

def counting(module, name):
    own = getattr(module, name)
    def counted(*args):
        calls[name] += 1
        return own(*args)
    setattr(module, name, counted)

counting(response, "corrected"), counting(tracked_newton, "iterated")
system = so.library.reference_oscillator(p=0.55, j=0.05, **LAW)
item = so.frequency_response(system, (4.5, 1.3), 15).bifurcations["PD"][0]
so.track(item, "Kc", (4.0, 9.0))
print(*calls.values())
"""


@pytest.mark.parametrize("law", [{}, {"regularization": 3000.0}])
def test_ordinary_processes_use_compiled_searches(law):
    """Where not everything is compiled when it is called, but has been by an earlier process: this one."""
    system = so.library.reference_oscillator(p=0.55, j=0.05, **law)
    so.track(so.frequency_response(system, (4.5, 1.3), 15).bifurcations["PD"][0], "Kc", (4.0, 9.0))
    done = subprocess.run(
        [sys.executable, "-c", ORDINARY.replace("LAW", repr(law))], capture_output=True, text=True, check=True
    )
    responses, points = map(int, done.stdout.split())
    assert responses > 10
    assert points > 10
