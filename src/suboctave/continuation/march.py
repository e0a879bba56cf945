"""Predictor-corrector continuation with scaled arclength.

Predictor: the quintic through the last three points and their tangents. Corrector: Newton's method in the hyperplane
orthogonal to the tangent. Step length: from the distance between prediction and solution, the angle between tangents
and the rate at which Newton's method contracts (Allgower & Georg, Numerical Continuation Methods, 1990, chapter 6). The
engine hands out the points one by one; what is looked for along the curve is the caller's business.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np

from suboctave.arguments import Count, Positive, checked
from suboctave.compiled import kernel
from suboctave.continuation.bounds import Bounds, Range
from suboctave.continuation.ending import Ending, EndReason
from suboctave.continuation.linear import distance, length
from suboctave.continuation.newton import NewtonOptions, Solved, closely, correct
from suboctave.continuation.point import CurvePoint, between, course_between, make_point, solved_again
from suboctave.continuation.problem import Array, Curve, Evaluation
from suboctave.errors import ConvergenceError, InputError, NotFiniteError

#: points behind the last one that a prediction takes into account
_BEHIND = 2
#: points from which on a march watches whether it goes round and round without passing its start
_LONG = 32
#: how often a prediction is halved towards the bound that it passes
_HALVED = 20
#: ways beyond a corner, as shares of the parameter's range, at which the curve is looked for; up to which of them, and
#: how many times as far from the corner, it is taken without further question
_BEYOND, _AT_ONCE, _CLOSE = (1e-6, 1e-5, 1e-4, 1e-3), 1e-5, 100.0
#: how far beside a place, or short of it, a step may pass it, as a share of its length
_BESIDE = 0.05
#: distance in scaled arclength, in one plane, below which two stretches of a curve are one
_SAME = 1e-6
#: steps below which points are solved for more closely anyway, and the share of the step that a point may lie off where
#: rounding leaves more
_CLOSELY, _LEFT = 1e-4, 1e-2
#: share of a step over which derivatives count as the same
_SPARED = 2e-4
#: squared sine of the angle between the tangents of two neighbours below which no corner is looked for between them
_STRAIGHT = 0.01
#: angle between successive tangents at which a step is refused, radians, unless the aim is large
_SHARP = 0.75


@checked(methods=False)
@dataclass(frozen=True)
class SteppingOptions:
    """How far the engine steps.

    max_step
        Largest distance between neighbours in scaled arclength: parameters in units of their range, the solution in
        units of its own current size (or of 1 % of the largest met so far, if that is larger).
    initial_step, min_step
        First step, and the step below which the curve ends with a reason.
    deviation
        Aim for the distance between prediction and solution.
    angle, growth
        Aim for the angle between successive tangents, radians; by how much at most a curve that turns more and more is
        expected to turn more from one step to the next.
    max_points
        Points after which the curve ends with a reason.
    """

    max_step: Positive = 0.06
    initial_step: Positive = 0.01
    min_step: Positive = 1e-7
    deviation: Positive = 0.01
    angle: Positive = 0.3
    growth: Positive = 1.0
    max_points: Count = 20000

    def __post_init__(self) -> None:
        if self.initial_step < self.min_step:
            raise InputError(f"initial_step={self.initial_step:g} must not be below min_step={self.min_step:g}")
        if self.max_step <= self.min_step:
            raise InputError(f"max_step={self.max_step:g} must lie above min_step={self.min_step:g}")
        if self.angle >= 1.6 or self.growth < 1.0 or self.max_points < 2:
            raise InputError(f"SteppingOptions out of range: {self}")

    @property
    def sharpest(self) -> float:
        """Angle between successive tangents at which a step is refused, radians."""
        return max(_SHARP, 2.5 * self.angle)


class Place:
    """A point of a curve that a march may come back to."""

    def __init__(self, point: CurvePoint) -> None:
        self.point = point
        #: of the parameter at all its images
        self._values = {image[point.curve.parameter] for image in point.curve.images(point.u)}
        #: its images in the discretisation of the last point
        self._images: tuple[Curve, list[Array]] | None = None

    def near(self, new: CurvePoint, reach: float) -> bool:
        """Whether it may lie within a reach of a point, as far as the parameter tells."""
        index = new.curve.parameter
        value, reach = new.u[index], reach / new.weights[index]
        for own in self._values:  # noqa: SIM110 - `any` takes three times as long
            if -reach <= value - own <= reach:
                return True
        return False

    def passed(self, point: CurvePoint, new: CurvePoint) -> CurvePoint | None:
        """It again, if the step from `point` to `new` passes it in the same direction."""
        for _, image, fraction in self._beside(point, new, 1.0):
            miss = length(new.weights * (between(point, new, fraction) - image))
            if miss < _BESIDE * distance(new.u, point.u, new.weights) + 1e-6:
                way = distance(image, point.u, new.weights)
                return replace(self.point, arclength=point.arclength + way)
        return None

    def retraced(self, point: CurvePoint, new: CurvePoint, newton: NewtonOptions) -> bool:
        """Whether the step from `point` to `new` comes back to it the other way round, which no curve does: one that
        folds back right beside itself is told from it by solving for both in one plane.
        """
        curve, weights = new.curve, new.weights
        for i, image, fraction in self._beside(point, new, -1.0):
            if i > 0:
                continue  # a sub-harmonic curve may pass its parent and lead back as its own image
            along = curve.transfer(self.point.tangent, self.point.curve)
            row = weights * along / length(weights * along)
            guess = between(point, new, fraction)
            guess -= float(row @ (weights * (guess - image))) * row / weights
            with suppress(ConvergenceError):
                own, other = (correct(curve, u, row, weights, newton) for u in (image, guess))
                return distance(own.u, other.u, weights) < _SAME
        return False

    def _beside(self, point: CurvePoint, new: CurvePoint, sense: float) -> list[tuple[int, Array, float]]:
        """Its images that the step from `point` to `new` passes, headed as it is (+1) or the other way round (-1):
        which they are, where they lie, and the fraction of the step at which it passes them.
        """
        w, own = new.weights, self.point
        step = distance(new.u, point.u, w)
        passed = []
        if self._images is None or self._images[0] is not new.curve:
            self._images = (new.curve, new.curve.images(new.curve.transfer(own.u, own.curve)))
        for i, turned in enumerate(self._images[1]):
            image = new.curve.unwrapped(turned, point.u)
            if max(distance(image, point.u, w), distance(new.u, image, w)) > 1.5 * step:
                continue
            from_point, to_new = w * (image - point.u), w * (new.u - image)
            # a shift in time turns the vector and, where there are instants among the unknowns, moves it
            start, way = (new.curve.transfer(v, own.curve) for v in (own.u, own.tangent))
            leaving = new.curve.images(start + way)[i] - turned
            before, beyond = float(from_point @ (w * point.tangent)), float(to_new @ (w * new.tangent))
            same_way = sense * float((w * leaving) @ (w * new.tangent)) > 0.5 * length(w * leaving)
            # a curve that is closed begins anew beyond its start; one that has come back may end on it
            if same_way and before >= 0.0 and beyond > (0.0 if sense > 0.0 else -_BESIDE * step):
                passed.append((i, image, length(from_point) / (length(from_point) + length(to_new))))
        return passed


@dataclass(frozen=True)
class Arrival:
    """A curve meets another one and ends there: its last point before that (None: the one it has), and the ending."""

    point: CurvePoint | None
    ending: Ending


@dataclass(eq=False)
class March:
    """Follows a curve from a start point; iterate over it for the points, then read `ending` and `closed`.

    Parameters
    ----------
    start
        Solved start with its parameter inside the bounds.
    direction
        +1 to set out towards larger values of the parameter, -1 towards smaller ones, 0 along the start's tangent.
    bounds
        (low, high) of the parameter; the curve ends exactly on them.
    inspect
        Called with two neighbours before the second is accepted; returning False has the step halved (unless it is
        shorter than `min_step` already).
    arrive
        Called with two neighbours; where the curve meets another one between them and ends there, it says so.
    finer
        Called with two neighbours; the discretisation of the curve in which the step has to be taken again, None as a
        rule.
    corner
        Called with a point from which no tangent leads on; whether it lies at a corner that whoever follows the curve
        knows how to pass, where the parameter would lead back.
    home
        A point already passed, in the direction of its tangent, at which the curve is closed; default: the start.
    others
        Ranges of other unknowns, or of what is measured, on which the curve ends as well.
    """

    start: CurvePoint
    direction: float
    bounds: tuple[float, float]
    newton: NewtonOptions
    stepping: SteppingOptions
    inspect: Callable[[CurvePoint, CurvePoint], bool] | None = None
    arrive: Callable[[CurvePoint, CurvePoint], Arrival | None] | None = None
    finer: Callable[[CurvePoint, CurvePoint], Curve | None] | None = None
    corner: Callable[[CurvePoint], bool] | None = None
    home: CurvePoint | None = None
    others: Sequence[Range] = ()
    closed: bool = field(default=False, init=False)
    ending: Ending = field(default=Ending(EndReason.NOT_STARTED), init=False)

    @property
    def ended(self) -> str:
        """Why it ended, in words."""
        return str(self.ending)

    def __iter__(self) -> Iterator[CurvePoint]:
        """Points in order, the start first."""
        options = self.stepping
        point = self.start
        if point.tangent[point.curve.parameter] * self.direction < 0.0:
            point = point.turned
        ranges = (Bounds(*self.bounds, attrgetter("parameter")), *self.others)
        home = mark = Place(self.home or point)
        yield point
        largest = point.curve.size(point.u)
        step = min(options.initial_step, options.max_step)
        behind: list[CurvePoint] = []
        curve, bend, count, marked = point.curve, 0.0, 1, 0
        while True:
            if count >= options.max_points:
                self.ending = Ending(EndReason.MAX_POINTS, point.curve.where(point.u), str(options.max_points))
                return
            here = self._carried(curve, point, largest)
            try:
                new, deviation, turn = self._advance(here, step, behind)
            except NotFiniteError as failure:
                self.ending = Ending(EndReason.NOT_FINITE, here.curve.where(here.u), str(failure))
                return
            except ConvergenceError as failure:
                where = here.curve.where(here.u)
                self.ending = Ending(EndReason.STEP_TOO_SMALL, where, f"{options.min_step:.0e} at {where}: {failure}")
                return
            arrival = None if self.arrive is None else self.arrive(here, new)
            if arrival is not None:
                self.ending = arrival.ending
                if arrival.point is not None:
                    yield arrival.point
                return
            finer = None if self.finer is None else self.finer(here, new)
            if finer is not None:
                # from the point as it was solved for, not from what fewer harmonics made of it
                curve = finer
                continue
            point, largest = here, max(largest, new.curve.size(new.u))
            reach = 1.5 * distance(new.u, point.u, new.weights)
            at_home = count > 2 and home.near(new, reach)
            back = home.passed(point, new) if at_home else None
            if back is not None:
                self.closed, self.ending = True, Ending(EndReason.CLOSED)
                yield back
                return
            at_mark = marked and mark.near(new, reach)
            if at_mark and count > marked + 3 and mark.passed(point, new) is not None:
                self.ending = Ending(EndReason.ASTRAY, new.curve.where(new.u))
                return
            back_again = at_home and count > 3 and home.retraced(point, new, self.newton)
            if back_again or (at_mark and mark.retraced(point, new, self.newton)):
                self.ending = Ending(EndReason.RETRACED, new.curve.where(new.u))
                return
            landed: CurvePoint | None = None
            try:
                for ends in ranges:  # the one that it leaves first
                    landed = ends.left(point, landed or new, self.newton) or landed
            except ConvergenceError:
                self.ending = Ending(EndReason.LEFT_RANGE, point.curve.where(point.u))
                return
            if landed is not None:
                # what comes to where it began need not have gone beyond it
                back_again = count > 3 and home.retraced(point, landed, self.newton)
                reason = EndReason.RETRACED if back_again else EndReason.RANGE_END
                self.ending = Ending(reason, landed.curve.where(landed.u))
                yield landed
                return
            yield new
            count += 1
            if count >= _LONG and count & (count - 1) == 0:
                mark, marked = Place(new), count
            taken = new.arclength - point.arclength
            bend, before = (turn / taken if taken > 0.0 else 0.0), bend
            # a curve that has begun to turn goes on to
            turn *= min(options.growth, bend / before) if bend > before > 0.0 else 1.0
            step = self._next_step(new, taken, deviation, turn)
            # beyond a corner nothing leads on from what lies behind
            behind = [point, *behind[: _BEHIND - 1]] if deviation > 0.0 else []
            curve, point = new.curve.adapted(new.u, new.evaluation), new

    def _carried(self, curve: Curve, point: CurvePoint, largest: float) -> CurvePoint:
        """The same point as one of `curve`, with scaling and tangent length of the present amplitude.

        In another discretisation it is solved for again: what harmonics move may be more than a step, or than a sharp
        turn is wide, and a point that does not lie on the curve does not tell which way it leads. Fewer unknowns are
        taken only where its heading stays what it was.
        """
        here = _rescaled(curve, point, largest)
        if len(here.u) == len(point.u):
            return here
        with suppress(ConvergenceError):
            again = solved_again(here, curve, here.weights, self.newton)
            if again.orientation == here.orientation and _angle(here, again) < self.stepping.sharpest:
                return again
        return here if len(here.u) > len(point.u) else _rescaled(point.curve, point, largest)

    def _advance(self, point: CurvePoint, step: float, behind: list[CurvePoint]) -> tuple[CurvePoint, float, float]:
        """One accepted step: new point, distance between prediction and solution, angle between the tangents."""
        known, curve, options = [point, *behind], point.curve, self.stepping
        both = [
            (p.u, p.tangent) if p.curve is curve else (curve.transfer(p.u, p.curve), curve.transfer(p.tangent, p.curve))
            for p in known
        ]
        points, tangents = np.array(both).swapaxes(0, 1).copy()
        order = len(known)
        while True:
            try:
                guess, row, bound = self._predicted(point, points[:order], tangents[:order], step)
                solved = self._solved(point, guess, row, step)
                if bound is not None:
                    solved.u[curve.parameter] = bound
                taken = distance(solved.u, point.u, point.weights)
                new = _joined(point, make_point(solved, point.tangent, point.arclength + taken))
                turn, meets, _ = course_between(point, new)
                if step <= options.min_step:
                    # not at a jump across a corner, onto the part of the curve behind it, to be followed back into it
                    fine = float((new.weights * (new.u - point.u)) @ (new.weights * new.tangent)) > 0.0
                    back = new.tangent[curve.parameter] * point.tangent[curve.parameter] < 0.0
                    if fine and back and turn >= options.sharpest:
                        # it comes back, or turned by more than a right angle, and its tangent points back wrongly
                        with suppress(ConvergenceError):
                            return self._around_corner(point, ConvergenceError("the curve has a corner"))
                else:
                    fine = turn < options.sharpest and solved.distance < 0.4 * step
                    fine = fine and taken <= 1.000001 * options.max_step
                    # nor across a corner that lies nearer
                    fine = fine and meets < _STRAIGHT
                    fine = fine and (self.inspect is None or self.inspect(point, new))
                if fine:
                    beyond = _leaving(point, new) if step <= options.min_step else new
                    return beyond, solved.distance if beyond is new else 0.0, turn
                failure = ConvergenceError("the curve turns too sharply")
            except ConvergenceError as error:
                failure = error
            if step <= options.min_step:
                ahead = _severed(point, point.u + options.max_step * point.tangent)
                return self._around_corner(point, failure if ahead is None else NotFiniteError(ahead))
            # what lies behind may not tell what comes
            order = max(1, order - 1)
            step = max(0.5 * step, options.min_step)

    def _solved(self, point: CurvePoint, guess: Array, row: Array | int, step: float) -> Solved[Curve]:
        """The point beside a prediction, ahead of another one; of a short step, or where the curve asks for it, more
        closely: what the tolerance leaves open may be as long as the step, or as a sharp turn is wide.
        """
        curve, weights, near = point.curve, point.weights, point.before or point
        delicate = getattr(curve, "delicate", False)
        if delicate or step < _CLOSELY:
            try:
                close = closely(self.newton)
                spare = 0.0 if delicate else _SPARED * step
                return correct(curve, guess, row, weights, close, spare=spare, near=near)
            except ConvergenceError:
                # by rounding perhaps
                solved = correct(curve, guess, row, weights, self.newton)
                missing = np.append(solved.evaluation.residual, 0.0)
                if solved.factor.singular or length(solved.factor.solve(missing)) > _LEFT * step:
                    raise
                return solved
        return correct(curve, guess, row, weights, self.newton, spare=_SPARED * step, near=near)

    def _predicted(
        self, point: CurvePoint, points: Array, tangents: Array, step: float
    ) -> tuple[Array, Array | int, float | None]:
        """A prediction and the row to solve with: one step ahead, or on the bound (returned) that it would pass."""
        guess, index = np.empty(len(point.u)), point.curve.parameter
        predict(points, tangents, point.weights, step, guess)
        low, high = self.bounds
        if low <= guess[index] <= high or not low < point.parameter < high:
            return guess, point.weights * point.tangent, None
        bound = low if guess[index] < low else high
        near, far = 0.0, step
        for _ in range(_HALVED):
            middle = 0.5 * (near + far)
            predict(points, tangents, point.weights, middle, guess)
            near, far = (near, middle) if (guess[index] - bound) * (point.parameter - bound) < 0.0 else (middle, far)
        guess[index] = bound
        return guess, index, bound

    def _around_corner(self, point: CurvePoint, failure: ConvergenceError) -> tuple[CurvePoint, float, float]:
        """A point beyond a corner of the equations, where no tangent leads on but the parameter does; as `_advance`.

        A corner is met where a coefficient has one: a gap tracked through zero, whose force at rest begins to change.
        Raises the failure that led here if there is no solution close by, or at such a `corner`.
        """
        if self.corner is not None and self.corner(point):
            raise failure
        curve, weights, index = point.curve, point.weights, point.curve.parameter
        heading = math.copysign(1.0, point.tangent[index])
        row = np.zeros(len(point.u))
        row[index] = 1.0
        nearer: CurvePoint | None = None
        for share in _BEYOND:
            guess = point.u.copy()
            guess[index] += heading * share / weights[index]
            try:
                solved = correct(curve, guess, row, weights, self.newton)
                taken = distance(solved.u, point.u, weights)
                new = _joined(point, make_point(solved, heading * row, point.arclength + taken))
            except ConvergenceError:
                nearer = None
                continue
            new = _leaving(point, new)
            if new.orientation != point.orientation:
                # a stretch that leads to the corner, not from it
                nearer = None
                continue
            if share <= _AT_ONCE and taken <= _CLOSE * share:
                return new, 0.0, _angle(point, new)
            # what lies farther comes from the corner if a tenth of the share leads less than half as far
            before, nearer = nearer, new
            if before is not None and 2.0 * (before.arclength - point.arclength) < taken <= self.stepping.max_step:
                return before, 0.0, _angle(point, before)
        raise failure

    def _next_step(self, new: CurvePoint, step: float, deviation: float, turn: float) -> float:
        options = self.stepping
        factor = min(
            (options.deviation / max(deviation, 1e-12)) ** (1.0 / 3.0),
            options.angle / max(turn, 1e-9),
            2.0 if new.iterations <= 4 else 4.0 / new.iterations,
        )
        step = step * min(2.0, max(0.3, factor))
        # the predictor's curvature may carry a step a little beyond its length: keep the distance below the largest
        # allowed
        return min(0.98 * options.max_step, max(step, options.min_step))


def _severed(point: CurvePoint, u: Array, evaluation: Evaluation | None = None) -> str | None:
    """Where the equations are not finite between a point and u, in words, if the curve can tell."""
    tells: Callable[[CurvePoint, Array, Evaluation | None], str | None] | None
    tells = getattr(point.curve, "severed", None)
    return None if tells is None else tells(point, u, evaluation)


def _joined(point: CurvePoint, new: CurvePoint) -> CurvePoint:
    """The second of two neighbours; NotFiniteError if the equations are not finite on the way to it."""
    reason = _severed(point, new.u, new.evaluation)
    if reason is not None:
        raise NotFiniteError(reason)
    return new


def _rescaled(curve: Curve, point: CurvePoint, largest: float) -> CurvePoint:
    """A point carried over to `curve` as it is, with scaling and tangent length of the present amplitude."""
    p, u, along = point, point.u, point.tangent
    if curve is not point.curve:
        u, along = curve.transfer(u, point.curve), curve.transfer(along, point.curve)
    weights = curve.weights(u, largest)
    size = length(weights * along)
    if not 0.0 < size < math.inf:
        raise OverflowError(f"the tangent has the length {size:g}")
    return CurvePoint(
        curve, u, along / size, weights, p.evaluation, p.orientation, p.arclength, p.iterations, before=p.before or p
    )


def _overshot(point: CurvePoint, new: CurvePoint) -> bool:
    """Whether a corner lies ahead of the second of two neighbours as it is headed.

    The corner lies where the tangents meet: `new - point = d a + s b` with unit tangents a and b; s is negative then.
    """
    return course_between(point, new)[1] >= _STRAIGHT


def _leaving(point: CurvePoint, new: CurvePoint) -> CurvePoint:
    """The second of two neighbours; behind a corner headed away from it, which is where the orientation stays.

    On the two sides of a corner F_u differs across the surface between them alone: `det [F_u; t]` has the same sign on
    both as long as both tangents t cross the surface to the same side.
    """
    return new.turned if _overshot(point, new) and new.orientation != point.orientation else new


def _angle(a: CurvePoint, b: CurvePoint) -> float:
    """Angle between the tangents of two points, radians."""
    return course_between(a, b)[0]


@kernel()
def predict(points, tangents, weights, step, out):
    """The Hermite polynomial through points and tangents (m, n) taken `step` further in scaled arclength, into `out`.

    The latest point comes first; one point gives a straight line, two a cubic, three a quintic.
    """
    m, n = points.shape
    size = np.empty(m)
    where = np.zeros(m)
    for j in range(m):
        total = 0.0
        for i in range(n):
            d = weights[i] * tangents[j, i]
            total += d * d
        size[j] = math.sqrt(total)
        if j > 0:
            chord = turn = 0.0
            for i in range(n):
                d = weights[i] * (points[j - 1, i] - points[j, i])
                chord += d * d
                d = weights[i] * (tangents[j - 1, i] / size[j - 1] - tangents[j, i] / size[j])
                turn += d * d
            # the arc is longer than its chord
            where[j] = where[j - 1] - math.sqrt(chord) * (1.0 + turn / 24.0)
    for i in range(n):
        out[i] = 0.0
    for j in range(m):
        product, total = 1.0, 0.0
        for k in range(m):
            if k != j:
                product *= (step - where[k]) / (where[j] - where[k])
                total += 1.0 / (where[j] - where[k])
        square = product * product
        ahead = step - where[j]
        value = square * (1.0 - 2.0 * ahead * total)
        slope = square * ahead / size[j]
        for i in range(n):
            out[i] += value * points[j, i] + slope * tangents[j, i]
