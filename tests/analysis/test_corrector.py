"""Newton's method in one compiled call, against the general one, which goes through the equations' own methods."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.analysis.response import ResponseCurve
from suboctave.continuation.lapack import factorise, factorise_plainly, solve_factorised
from suboctave.continuation.linear import Factor
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import make_point
from suboctave.errors import ConvergenceError
from suboctave.harmonic import HarmonicBalance, HarmonicBasis

OPTIONS = NewtonOptions()


def between_stops():
    """Two masses, each with a rounded stop; a cubic spring and a stop with a corner between them."""
    elements = [
        so.ElasticStop(dof=0, stiffness=20.0, gap=0.05, regularization=400.0),
        so.ElasticStop(dof=1, stiffness=9.0, gap=-0.04, side="left", regularization=900.0),
        so.CubicSpring(direction=[-1.0, 1.0], coefficient=0.4),
        so.ElasticStop(direction=[-1.0, 1.0], stiffness=5.0, gap=0.03),
    ]
    stiffness = np.array([[3.0, -1.0], [-1.0, 2.0]])
    return so.System(
        np.diag([1.0, 0.7]), 0.05 * stiffness, stiffness, elements, [so.HarmonicLoad(dof=0, amplitude=0.6)]
    )


SYSTEMS = {
    "corners": so.library.reference_oscillator,
    "rounded": lambda: so.library.reference_oscillator(regularization=3000.0),
    "polynomials": lambda: so.library.nltva(0.11),
    "all of them": between_stops,
}


def setting_out(system, omega=3.0):
    """A curve, a motion near one of its points, and a tangent there."""
    balance = HarmonicBalance(system, HarmonicBasis(9))
    curve = ResponseCurve(balance, "omega", omega, 2.0, None, 1.0)
    u = np.zeros(balance.dimension + 1)
    u[-1] = omega
    start = balance.at(u[:-1], omega)
    u[:-1] -= np.linalg.solve(start.jacobian, start.residual)
    row = np.zeros(len(u))
    row[-1] = 1.0
    weights = curve.weights(u, 1.0)
    options = NewtonOptions(iterations=80, damped=True)
    return curve, make_point(correct(curve, u, row, weights, options), curve, None, 0.0)


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("step", [1e-6, 0.03])
def test_both_ways_agree(monkeypatch, name, step):
    curve, point = setting_out(SYSTEMS[name]())
    weights = point.weights
    row = weights * point.tangent
    guess = point.u + step * point.tangent
    at_once = curve.corrected(guess, row, weights, OPTIONS, 1e-6)
    assert at_once is not None
    monkeypatch.setattr(ResponseCurve, "corrected", lambda *_: None)
    general = correct(curve, guess, row, weights, OPTIONS, spare=1e-6)
    size = np.abs(general.u).max()
    assert at_once.u == pytest.approx(general.u, abs=1e-11 * size)
    assert at_once.iterations == general.iterations
    assert at_once.distance == pytest.approx(general.distance, rel=1e-6, abs=1e-12)
    assert at_once.factor.lu == pytest.approx(general.factor.lu, abs=1e-7 * np.abs(general.factor.lu).max())
    assert (at_once.factor.pivots == general.factor.pivots).all()
    one, other = (make_point(solved, curve, None, 0.0) for solved in (at_once, general))
    assert one.tangent == pytest.approx(other.tangent, abs=1e-8 * np.abs(other.tangent).max())
    assert one.orientation == other.orientation


@pytest.mark.parametrize("name", SYSTEMS)
def test_what_comes_with_a_point_belongs_to_it(name):
    """The evaluation handed over is the one at the solution: asked anew, it says the same."""
    curve, point = setting_out(SYSTEMS[name]())
    row = point.weights * point.tangent
    solved = curve.corrected(point.u + 0.02 * point.tangent, row, point.weights, OPTIONS, 0.0)
    anew = curve.evaluate(solved.u)
    assert solved.evaluation.error < 1e-10
    assert solved.evaluation.error == pytest.approx(anew.error, abs=1e-13)
    for part in ("motions", "blocks", "spectra_table", "jacobian", "force"):
        here, there = getattr(solved.evaluation.state, part), getattr(anew.state, part)
        assert here == pytest.approx(there, abs=1e-11 * max(1.0, np.abs(there).max())), part
    # the tangent spans the null space of the derivatives
    assert np.abs(anew.jacobian @ solved.tangent).max() < 1e-9 * np.abs(anew.jacobian).max()


def test_the_same_words_where_it_does_not_converge(monkeypatch):
    curve, point = setting_out(SYSTEMS["rounded"]())
    guess = point.u.copy()
    guess[:-1] *= 40.0
    row = np.zeros(len(guess))
    row[-1] = 1.0
    options = NewtonOptions(iterations=2)
    said = []
    for way in (ResponseCurve.corrected, lambda *_: None):
        monkeypatch.setattr(ResponseCurve, "corrected", way)
        with pytest.raises(ConvergenceError, match="did not converge near omega = 3") as failure:
            correct(curve, guess, row, point.weights, options)
        said.append(str(failure.value))
    assert said[0] == said[1]


def test_left_to_the_general_way():
    """Other parameters than the frequency, laws asked at nodes, frequencies below zero."""
    system = so.library.reference_oscillator()
    balance = HarmonicBalance(system, HarmonicBasis(5))
    u = np.zeros(balance.dimension + 1)
    row, weights = np.ones(len(u)), np.ones(len(u))
    along_force = ResponseCurve(balance, next(iter(system.parameters)), 1.0, 1.0, None, 1.0)
    assert along_force.corrected(u, row, weights, OPTIONS, 0.0) is None
    assert ResponseCurve(balance, "omega", 1.0, 1.0, None, 1.0).corrected(u, row, weights, OPTIONS, 0.0) is None
    dry = so.System(1.0, 0.1, 1.0, [so.TanhFriction(dof=0, force=0.1, velocity=0.01)], [so.HarmonicLoad(0, 1.0)])
    curve = ResponseCurve(HarmonicBalance(dry, HarmonicBasis(5)), "omega", 1.0, 1.0, None, 1.0)
    u[-1] = 1.0
    assert curve.corrected(u, row, weights, OPTIONS, 0.0) is None


@pytest.mark.parametrize("factorise", [factorise, factorise_plainly])
def test_factors_in_compiled_code(factorise):
    rng = np.random.default_rng(3)
    matrix, right = rng.standard_normal((23, 23)), rng.standard_normal(23)
    matrix[0, 0] = 0.0
    expected = Factor.of(matrix.copy())
    transposed, pivots, solution = matrix.T.copy(), np.empty(23, dtype=np.int32), right.copy()
    assert not factorise(transposed, pivots)
    assert pytest.approx(expected.lu, abs=1e-13) == transposed.T
    assert (pivots == expected.pivots).all()
    solve_factorised(transposed, pivots, solution)
    assert matrix @ solution == pytest.approx(right, abs=1e-12)
    singular = np.ones((4, 4))
    assert factorise(singular, np.empty(4, dtype=np.int32))
