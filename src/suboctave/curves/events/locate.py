"""A bifurcation located: the equations of its curve in two parameters, of which one is held.

As many equations as unknowns are left, which `continuation.newton` solves from a guess, with the bordering vectors of
the guess's neighbourhood. Unknowns are weighted as along curves, so that convergence means the same in any units.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bordered import NullVectors, at_values
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import CurvePoint
from suboctave.curves.augmentation import PLAIN, Augmentation
from suboctave.curves.kinds.branch_point import BranchPointEquations, BranchPointUnfolded
from suboctave.curves.kinds.multiple import MultipleEquations, MultiplePoint
from suboctave.curves.kinds.singular import SingularEquations, SingularOperator
from suboctave.curves.motion import MotionEvaluation, MotionProblem
from suboctave.errors import ConvergenceError
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import motion_size
from suboctave.lazy import lazy

#: corrections of half a motion or half a range at most, the last one of 1e-9 of them
NEWTON = NewtonOptions(tolerance=1e-10, correction=1e-9, iterations=12, longest=0.5, rounding=True)
#: unfolding, in units of the forces that balance, above which a located point is no branch point: a hundred times what
#: rounding makes of a branch point that a symmetry forces. One of beta parts the branches of a pitchfork by beta^(1/3)
_UNFOLDING = 1e-13
#: way along a branch, in scaled arclength, within which simple bifurcations count as a multiple one
_APART = 1e-7
#: corrections, at most, made after convergence
_POLISHED = 3
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Guess:
    """Where to start: a motion with its equations, name and range of the free parameter, kappa; null vectors of the
    operator nearby, where they are known (with any number of harmonics); size of the motions around, where the
    curve may pass rest.
    """

    state: BalanceState
    name: str
    span: float
    kappa: float = 0.0
    vectors: NullVectors | None = None
    size: float = 0.0

    @classmethod
    def at(cls, u: Array, point: CurvePoint, kappa: float = 0.0) -> Guess:
        """From u, a vector in the discretisation of a point."""
        curve = point.curve
        assert isinstance(curve, MotionProblem)
        state = curve.balance.at(*curve.split(u))
        return cls(state, curve.name, curve.span, kappa, size=curve.unit(point.weights))

    @property
    def parameter(self) -> float:
        """Value of the free parameter."""
        return self.value(self.state)

    def value(self, state: BalanceState) -> float:
        """Value of the free parameter at a motion."""
        return state.omega if self.name == "omega" else state.values[self.name]

    def vector(self, state: BalanceState) -> Array:
        """Coefficients and free parameter of a motion, (dimension + 1,)."""
        return np.append(state.unknowns, self.value(state))

    def moved(self, vector: Array) -> Guess:
        """The same at other coefficients and another value of the free parameter."""
        x, value, state = vector[:-1], float(vector[-1]), self.state
        omega, values = at_values(state.values, self.name, value, state.omega)
        return replace(self, state=state.balance.at(state.balance.shaped(x), omega, values))

    def problem(self, augmentation: Augmentation = PLAIN, force: float = 0.0) -> MotionProblem:
        """The motions in the free parameter that an augmentation singles out; force: unit of its equations."""
        state, own = self.state, self.state.balance.values
        return MotionProblem(
            state.balance,
            (self.name,),
            (self.span,),
            state.omega,
            augmentation=augmentation,
            reference=self.size,
            force=force or state.omega**2,
            held={} if state.values is own else {n: v for n, v in state.values.items() if v != own[n]},
        )


@dataclass(frozen=True)
class Singular:
    """A located motion: state, null vectors of its singular operator (None if it has none), kappa, and the
    dimensionless residual of the whole system.
    """

    state: BalanceState
    vectors: NullVectors | None
    kappa: float
    residual: float
    iterations: int

    @property
    def balance_residual(self) -> float:
        """Residual of the equations of motion alone, in units of the forces that balance."""
        return min(self.residual, self.state.balanced.size / max(self.state.balanced.scale, _TINY))

    @lazy
    def floquet(self) -> FloquetResult:
        """Its multipliers."""
        return floquet_multipliers(self.state)


def solve(guess: Guess, augmentation: Augmentation, extra: Array) -> tuple[MotionEvaluation, int]:
    """Solve the equations of an augmentation in (X, extra, the guess's free parameter).

    Returns
    -------
    The equations at the solution, and the number of corrections.

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge from the guess.
    """
    problem = guess.problem(augmentation, guess.state.balanced.scale)
    u = problem.join(guess.state.x, guess.parameter, extra)
    solved = correct(problem, u, None, problem.weights(u, 0.0), NEWTON)
    evaluation = solved.evaluation
    # of corrections beyond what was asked for, which move the last digits, the least residual is taken
    u, further = solved.u, evaluation
    for _ in range(_POLISHED):
        step = solved.factor.solve(further.residual)
        if not np.isfinite(step).all():
            break
        u = u - step / solved.weights
        further = problem.evaluate(u)
        if further.error < evaluation.error:
            evaluation = further
    assert isinstance(evaluation, MotionEvaluation)
    return evaluation, solved.iterations


def locate_singular(guess: Guess, kind: Kind, operator: type[SingularOperator] = SingularOperator) -> Singular:
    """Locate a motion at which J_kappa is singular, kappa = 0, w0/2, or free (starting from `guess.kappa`).

    `operator`: the equations that say so. ConvergenceError where Newton's method does not converge from the guess.
    """
    state, vectors = guess.state, guess.vectors
    if vectors is not None:
        vectors = vectors.resized(state.basis, state.balance.size, kind)
    own, extra = operator.started(state, kind, guess.kappa, vectors)
    evaluation, iterations = solve(guess, own, extra)
    equations = evaluation.equations
    assert isinstance(equations, SingularEquations)
    return Singular(evaluation.state, equations.bordered.vectors, equations.kappa, evaluation.error, iterations)


def locate_multiple(guess: Guess, kind: Kind, multiplicity: int) -> Singular:
    """Locate a motion at which J_kappa loses so much rank at once; with one pair of its null vectors.

    ConvergenceError where Newton's method fails, or where those are simple bifurcations that lie beside each other.
    """
    own = MultiplePoint.of(guess.state, kind, multiplicity, guess.name, guess.kappa)
    start = np.array([guess.kappa]) if kind is Kind.FREE else np.zeros(own.extras)
    evaluation, iterations = solve(guess, own, start)
    equations = evaluation.equations
    assert isinstance(equations, MultipleEquations)
    weights = np.append(evaluation.state.balance.column_weights, 1.0 / guess.span)
    weights[:-1] /= max(motion_size(evaluation.state), guess.size) or 1.0
    apart = equations.apart(weights)
    if apart > _APART or own.unfolding(equations.extra) > _UNFOLDING:
        raise ConvergenceError(
            f"no multiple {own.name}: {multiplicity} simple ones lie {apart:.1e} of arclength apart, unfolded by "
            f"{own.unfolding(equations.extra):.1e}"
        )
    vectors = equations.vectors(np.eye(multiplicity)[0])
    return Singular(evaluation.state, vectors, equations.kappa, evaluation.error, iterations)


def locate_branch_point(guess: Guess) -> Singular:
    """Locate a branch point in the free parameter; ConvergenceError where Newton's method fails, or converges to one
    whose unfolding is not zero: an imperfect (broken) branch point.
    """
    evaluation, iterations = solve(guess, BranchPointUnfolded.of(guess.state, guess.name), np.zeros(1))
    equations = evaluation.equations
    assert isinstance(equations, BranchPointEquations)
    if abs(equations.beta) > _UNFOLDING:
        raise ConvergenceError(
            f"no branch point: its unfolding is {equations.beta:.1e} (a broken symmetry leaves a ghost here)"
        )
    return Singular(evaluation.state, equations.bordered.vectors, 0.0, evaluation.error, iterations)
