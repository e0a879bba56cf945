"""Branches of doubled motions in coordinates in which the period doublings that they lead to are regular points.

In a basis of an even number of load periods the motions of half that period solve the same equations: those without
harmonics of odd order. A branch of doubled motions meets them at a period doubling, where the equations are singular.
With the odd part of a motion written as a size and a direction,

    X = X_even + eps w,    |w| = 1,    R_even(X_even + eps w) = 0,    R_odd(X_even + eps w) / eps = 0,

where the last is `J_half w` at eps = 0, motions of half the period are no solutions any more. What is left of them are
their period doublings, eps = 0 and w the null vector of J_half, and these are regular points: the branch goes straight
on to eps < 0, where its motions are the same, half a period later. So it leaves a doubling with eps > 0 and arrives at
one where eps comes to zero, whatever its tangent among the motions does there ("blow-up" of the pitchfork).

Unknowns are `u = (X_even and w, eps, free parameter)`, harmonic by harmonic like X.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from suboctave.continuation.linear import distance, length
from suboctave.continuation.newton import NewtonOptions, correct, factorised
from suboctave.continuation.point import CurvePoint, make_point
from suboctave.continuation.problem import Array, Curve, Evaluation
from suboctave.curves.motion import MotionEvaluation, MotionProblem
from suboctave.errors import ConvergenceError
from suboctave.harmonic.derivatives import Direction
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, operator_along, operator_by_motion
from suboctave.lazy import lazy

#: odd part, as a share of the motion, below which derivatives of the odd part's equations are those of their limit:
#: closer to the doubling rounding would be divided by it
_LIMIT = 1e-6
#: odd part, as a share of the motion, that counts as none
_NONE = 1e-7
#: odd part, as a share of the motion, below which its own equations are solved less closely than the others: to the
#: same force
_SHARE = 0.1
#: scaled arclength of one radian by which the odd part turns, at least: for a larger odd part, its share of the motion
_TURN = 0.25
_TINY = float(np.finfo(float).tiny)


class BlownUpEvaluation:
    """The equations and their derivatives at one u."""

    #: the point of the plain curve that a point with this evaluation stands for
    plain_point: tuple[CurvePoint, CurvePoint] | None = None

    def __init__(self, curve: BlownUp, u: Array, state: BalanceState) -> None:
        self.curve = curve
        self.state = state
        self.eps = float(u[-2])
        #: w, with zeros at even orders
        self.direction = np.where(curve.odd, u[:-2], 0.0)

    @lazy
    def motion(self) -> MotionEvaluation:
        """The equations of the motion as they stand."""
        return MotionEvaluation(self.curve.motions, self.state, np.zeros(0))

    @lazy
    def size(self) -> float:
        """Size of the motion."""
        return self.curve.unit(self.state.unknowns)

    @property
    def _vanishes(self) -> bool:
        return abs(self.eps) <= _NONE * self.size

    @lazy
    def _odd_residual(self) -> Array:
        """R_odd / eps, zeros at even orders."""
        whole = self.state.jacobian @ self.direction if self._vanishes else self.state.residual / self.eps
        return np.where(self.curve.odd, whole, 0.0)

    @lazy
    def _norm(self) -> float:
        weighted = self.curve.motions.balance.column_weights * self.direction
        return 0.5 * (float(weighted @ weighted) - 1.0)

    @lazy
    def residual(self) -> Array:
        """`[R_even and R_odd / eps; (|w|^2 - 1) / 2]`."""
        top = np.where(self.curve.odd, self._odd_residual, self.state.residual)
        return np.append(top, self._norm * self.curve.motions.force)

    @lazy
    def error(self) -> float:
        """The largest of the residuals of even and of odd orders, in units of the forces that balance, and of |w|."""
        curve, state = self.curve, self.state
        rows = state.balance.row_weights(state.balance.dimension)
        scale = max(state.balanced.scale, curve.motions.least_force(state), _TINY)
        even = length(np.where(curve.odd, 0.0, state.residual) * rows) / scale
        odd = length(self._odd_residual * rows)
        if self._vanishes:
            odd /= max(state.balanced.scale / self.size, state.rate**2)
        else:
            odd *= abs(self.eps) / (scale * max(abs(self.eps) / self.size, _SHARE))
        return max(even, odd, abs(self._norm))

    @lazy
    def jacobian(self) -> Array:
        """Derivatives by u, shape (dimension + 1, dimension + 2)."""
        curve, state, eps, w = self.curve, self.state, self.eps, self.direction
        odd, n = curve.odd, len(w)
        whole = state.extended_jacobian(curve.motions.name)
        out = np.zeros((n + 1, n + 2))
        top = out[:n]
        top[:, :n], top[:, n + 1] = whole[:, :n], whole[:, n]
        top[:, n] = whole[:, :n] @ w
        # the even rows: w counts times eps
        top[np.ix_(~odd, odd)] *= eps
        # the odd rows over eps; in the limit they are R_X w, even in eps
        if abs(eps) < _LIMIT * self.size:
            top[np.ix_(odd, ~odd)] = operator_by_motion(state, w)[np.ix_(odd, ~odd)]
            top[odd, n] = 0.0
            alone = Direction(np.zeros_like(state.x), {curve.motions.name: 1.0})
            top[odd, n + 1] = operator_along(state, Kind.INTEGER, w, [alone])[odd, 0]
        else:
            top[np.ix_(odd, ~odd)] = whole[np.ix_(odd, ~odd)] / eps
            top[odd, n] = (top[odd, n] - state.residual[odd] / eps) / eps
            top[odd, n + 1] = whole[odd, n] / eps
        out[n, :n] = state.balance.column_weights**2 * w * curve.motions.force
        return out


@dataclass(eq=False, repr=False)
class DoubledMotions(MotionProblem):
    """Motions along one free parameter in the basis of an even number of load periods."""

    @lazy
    def blown_up(self) -> BlownUp:
        """The same curve in coordinates in which the period doublings that it leads to are regular points."""
        return BlownUp(self)

    def regular(self, u: Array) -> BlownUp | None:
        """See `Curve`: those coordinates, None for a motion without an odd part."""
        return None if self.balance.basis.nu % 2 or self.blown_up.without(u) else self.blown_up


@dataclass(eq=False, repr=False)
class BlownUp:
    """The curve of doubled motions in these coordinates; `motions`: as it stands."""

    motions: DoubledMotions
    odd: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        balance = self.motions.balance
        self.odd = _odd(balance.basis.harmonics, balance.size)

    # ------------------------------------------------------------------------------------------ as the engine sees it
    @property
    def parameter(self) -> int:
        """Index of the free parameter in u, the last."""
        return self.motions.balance.dimension + 1

    @property
    def size_of_odd(self) -> int:
        """Index of eps in u."""
        return self.motions.balance.dimension

    def evaluate(self, u: Array) -> BlownUpEvaluation:
        """See `Curve`."""
        return BlownUpEvaluation(self, u, self.motions.evaluate(self.motion(u)).state)

    def weights(self, u: Array, largest: float) -> Array:
        """See `Curve`."""
        motion = self.motion(u)
        return self.weights_from(u, self.motions.weights(motion, largest))

    def weights_from(self, u: Array, weights: Array) -> Array:
        """The weights at u where those of the motions are these."""
        n = self.motions.balance.dimension
        columns, unit = self.motions.balance.column_weights, self.motions.unit(weights)
        out = np.empty(n + 2)
        out[:n] = np.where(self.odd, columns * max(_TURN, abs(float(u[n])) / unit), weights[:n])
        out[n], out[n + 1] = 1.0 / unit, weights[-1]
        return out

    def size(self, u: Array) -> float:
        """See `Curve`."""
        return self.motions.size(self.motion(u))

    def adapted(self, u: Array, evaluation: Evaluation) -> BlownUp:
        """See `Curve`."""
        assert isinstance(evaluation, BlownUpEvaluation)
        motions = self.motions.adapted(self.motion(u), evaluation.motion)
        assert isinstance(motions, DoubledMotions)
        return self if motions is self.motions else motions.blown_up

    def transfer(self, u: Array, origin: Curve) -> Array:
        """See `Curve`."""
        if origin is self:
            return u
        assert isinstance(origin, BlownUp)
        others = np.delete(u, -2)
        return np.insert(self.motions.transfer(others, origin.motions), -1, u[-2])

    def images(self, u: Array) -> list[Array]:
        """See `Curve`."""
        return [np.insert(image, -1, u[-2]) for image in self.motions.images(np.delete(u, -2))]

    def unwrapped(self, u: Array, near: Array) -> Array:
        """See `Curve`."""
        return u

    def severed(self, point: CurvePoint, u: Array, evaluation: Evaluation | None = None) -> str | None:
        """See `Curve`."""
        assert isinstance(point.evaluation, BlownUpEvaluation)
        assert evaluation is None or isinstance(evaluation, BlownUpEvaluation)
        here = replace(point, evaluation=point.evaluation.motion)
        return self.motions.severed(here, self.motion(u), None if evaluation is None else evaluation.motion)

    def where(self, u: Array) -> str:
        """See `Problem`."""
        return self.motions.where(u)

    # ------------------------------------------------------------------------------------------------- from and to X
    def unit(self, x: Array) -> float:
        """Size of a motion, (dimension,), at least a share of what the curve was scaled with."""
        size = length(self.motions.balance.column_weights * x)
        return max(size, 0.01 * self.motions.reference) or 1.0

    def joined(self, x: Array, w: Array, eps: float) -> Array:
        """Coefficients with the even part of x and an odd part of a size and direction."""
        return np.where(self.odd, eps * w, x)

    def motion(self, u: Array) -> Array:
        """(X, free parameter) of u."""
        return np.append(self.joined(u[:-2], u[:-2], float(u[-2])), u[-1])

    def odd_size(self, motion: Array) -> float:
        """eps of a vector (X, free parameter)."""
        return length(np.where(self.odd, self.motions.balance.column_weights * motion[:-1], 0.0))

    def without(self, motion: Array) -> bool:
        """Whether a motion has no odd part that a direction could be told of."""
        return self.odd_size(motion) <= _NONE * self.unit(motion[:-1])

    def written(self, motion: Array) -> Array:
        """u of a vector (X, free parameter) that has an odd part."""
        eps = self.odd_size(motion)
        x = motion[:-1]
        return np.concatenate((np.where(self.odd, x / eps, x), [eps, motion[-1]]))

    def along(self, u: Array, way: Array) -> Array:
        """A change of (X, free parameter) at u as one of u."""
        w, eps = np.where(self.odd, u[:-2], 0.0), float(u[-2])
        change, columns = way[:-1], self.motions.balance.column_weights
        grows = float((columns**2 * w) @ change)
        turned = np.where(self.odd, (change - grows * w) / eps, change)
        return np.concatenate((turned, [grows, way[-1]]))

    def way(self, u: Array, along: Array) -> Array:
        """A change of u as one of (X, free parameter)."""
        eps = float(u[-2])
        return np.append(np.where(self.odd, eps * along[:-2] + along[-2] * u[:-2], along[:-2]), along[-1])

    def blown_up_point(self, point: CurvePoint) -> CurvePoint:
        """A point of the curve of motions in these coordinates."""
        assert isinstance(point.evaluation, MotionEvaluation)
        u = self.written(point.u)
        along, weights = self.along(u, point.tangent), self.weights_from(u, point.weights)
        evaluation = BlownUpEvaluation(self, u, point.evaluation.state)
        factor = factorised(evaluation, weights * along / length(weights * along), weights)
        return replace(
            point,
            curve=self,
            u=u,
            tangent=along / length(weights * along),
            weights=weights,
            evaluation=evaluation,
            orientation=factor.sign,
            factor=factor,
        )

    def plain_point(self, point: CurvePoint, arclength: float) -> CurvePoint:
        """A point as one of the curve of motions, at an arclength of that curve."""
        evaluation = point.evaluation
        assert isinstance(evaluation, BlownUpEvaluation)
        known = evaluation.plain_point
        if known is not None and known[0] is point:
            return known[1]
        size = self.motions.balance.dimension
        weights = self.motions.balance.column_weights * point.weights[size]
        weights = np.append(weights, point.weights[-1])
        way = self.way(point.u, point.tangent)
        way /= length(weights * way)
        factor = factorised(evaluation.motion, weights * way, weights)
        plain = CurvePoint(
            self.motions,
            self.motion(point.u),
            way,
            weights,
            evaluation.motion,
            factor.sign,
            arclength,
            point.iterations,
            factor,
        )
        evaluation.plain_point = point, plain
        return plain

    def behind(self, point: CurvePoint, before: CurvePoint) -> CurvePoint:
        """A point as one of the curve of motions, behind another one of that curve."""
        plain = self.plain_point(point, 0.0)
        here = self.motions.transfer(before.u, before.curve)
        plain.arclength = before.arclength + distance(plain.u, here, plain.weights)
        return plain

    def solved_point(
        self,
        guess: Array,
        row: Array,
        weights: Array,
        newton: NewtonOptions,
        along: Array | None,
        arclength: float,
        spare: float,
    ) -> CurvePoint:
        """See `continuation.point.solved_point`: what is given and what comes out are of the curve of motions, and the
        plane is the one that touches there.
        """
        u = self.written(guess)
        own = self.weights_from(u, weights)
        plane = row * weights
        x, w = plane[:-1], np.where(self.odd, u[:-2], 0.0)
        plane = np.concatenate((np.where(self.odd, u[-2] * x, x), [float(x @ w), plane[-1]])) / own
        solved = correct(self, u, plane / length(plane), own, newton, spare=spare)
        if solved.u[-2] <= 0.0:
            raise ConvergenceError("what was found lies elsewhere")
        heading = None if along is None else self.along(u, along)
        return self.plain_point(make_point(solved, heading, 0.0), arclength)


@lru_cache(maxsize=64)
def _odd(harmonics: int, size: int) -> NDArray[np.bool_]:
    """Which of the coefficients, (dimension,), are of odd order."""
    orders = np.append(0, np.repeat(np.arange(1, harmonics + 1), 2))
    return np.repeat(orders % 2 == 1, size)
