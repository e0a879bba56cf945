"""Branch switching on curves of motions of a free phase.

At a branch point the curve that crosses theirs, at a period doubling the motions of twice the period.

Such curves are tracked ones (`TrackedBranch`), and so are those that leave them; what leaves is found from the Jacobian
of their own equations (`curves.other_branch`), as R_X alone is singular all along.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from suboctave.analysis.options import CurveOptions, Inherited, check_inside, options_of, settings_of
from suboctave.arguments import Range
from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent
from suboctave.bifurcation.bordered import doubled_direction, null_vectors
from suboctave.continuation import CurvePoint
from suboctave.continuation.linear import length, one_thread
from suboctave.curves.junction import Junction
from suboctave.curves.kinds import equations_of
from suboctave.curves.motion import MotionProblem
from suboctave.curves.other_branch import beside_branch_point, other_direction
from suboctave.curves.starts import Harmonics, check_unknowns, harmonics_of, rule_of
from suboctave.curves.trace import Settings, Trace
from suboctave.curves.tracked.follow import follow_tracked
from suboctave.curves.tracked.start import curve_through
from suboctave.errors import InputError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.kinds import KINDS, MOTION_KINDS
from suboctave.progress import reporting
from suboctave.results.branch import TrackedBranch
from suboctave.results.modes import tracked_class

#: share of odd harmonics up to which a motion may have half the period
_FAINT = 1e-3


def leaves_free_phase(item: Bifurcation) -> bool:
    """Whether something was located along a curve of motions of a free phase."""
    return isinstance(item, TrackedEvent) and item.curve in MOTION_KINDS and equations_of(item.curve).free_phase is True


@dataclass(frozen=True)
class _Departure:
    """A branch point, or a period doubling in the basis of twice the period, as a point u of the curve that leaves."""

    item: TrackedEvent
    curve: MotionProblem
    u: Array
    direction: Array
    ranges: Mapping[str, Range]
    settings: Settings

    def away(self, side: float) -> tuple[CurvePoint, float]:
        """The first point on one side, and how far it lies."""
        curve, u, weights = self.curve, self.u, self.curve.weights(self.u, 0.0)
        point = beside_branch_point(curve, u, side * self.direction, weights, self.settings.newton)
        adapted = curve.adapted(point.u, point.evaluation)
        if adapted is not curve:
            # in the harmonics and samples that it needs
            u, along = adapted.transfer(u, curve), adapted.transfer(point.u - u, curve)
            weights = adapted.weights(u, 0.0)
            direction = along / length(weights * along)
            point = beside_branch_point(adapted, u, direction, weights, self.settings.newton)
        return point, length(point.weights * (point.u - u))

    def half(self, side: float) -> Trace:
        """The curve on one side."""
        trace = follow_tracked(self.away(side)[0], self.ranges, self.settings)
        trace.departs = replace(self.item, arclength=0.0)
        return trace

    def whole(self) -> Trace:
        """The curve through the branch point, both ways."""
        (one, gap), (other, more) = self.away(1.0), self.away(-1.0)
        forward = follow_tracked(one, self.ranges, self.settings)
        if forward.closed or forward.interrupted:
            # a closed curve comes back through the branch point
            last = forward.points[-1].arclength - 2.0 * gap if forward.closed else math.inf
            forward.cut(last)
            forward.bifurcations.insert(0, self._crossed(0.0))
            return forward
        back = follow_tracked(other, self.ranges, self.settings)
        place = back.points[-1].arclength + more
        trace = back.reversed_before(forward, gap + more)
        at = sum(event.arclength < place for event in trace.bifurcations)
        trace.bifurcations.insert(at, self._crossed(place))
        return trace

    def _crossed(self, arclength: float) -> TrackedEvent:
        """The branch point as one of the curve that leaves, which has that direction there."""
        n, own = self.curve.balance.dimension, self.item.orbit.basis
        motion = self.curve.balance.basis.resized(self.curve.balance.shaped(self.direction[:n]), own)
        along = np.concatenate((motion.ravel(), self.direction[n:]))
        return replace(self.item, arclength=arclength, tangent=tuple(along.tolist()))


def switch_tracked(
    item: TrackedEvent, side: int | None, bounds: Range | None, harmonics: Harmonics | None, options: CurveOptions
) -> TrackedBranch:
    """The curve that leaves another one of motions of a free phase; see `switch_branch`.

    Raises
    ------
    InputError
        If the ranges are not known, or do not hold the bifurcation.
    ConvergenceError
        If no other curve is found there.
    """
    orbit, name, known = item.orbit, item.names[-1], Inherited(item)
    given = {**known.known.get("bounds", {})} | ({} if bounds is None else {name: bounds})
    ranges = {one: (min(ends), max(ends)) for one, ends in given.items()}
    for one in item.names:
        if one in ranges:
            check_inside(f"the {KINDS[item.kind].words}", one, item.parameter(one), ranges[one], 1e-9)
    settings = settings_of(orbit.system, known.under(options))
    wanted = harmonics_of(orbit) if harmonics is None else harmonics
    rule, basis = rule_of(wanted), orbit.basis
    adaptive = rule if isinstance(rule, AdaptiveHarmonics) else None
    if isinstance(rule, int):
        basis = HarmonicBasis(rule * basis.nu, basis.nu)
    doubled = item.kind == "PD"
    title = f"{KINDS[item.curve].words} that leaves a {KINDS[item.kind].words}"
    with one_thread(), reporting(options.get("progress"), title) as report:
        settings = settings.reporting_to(report, ranges.get(name, (0.0, item.parameter(name))), "event")
        basis = basis.doubled if doubled else basis
        check_unknowns(orbit.balance.size, basis)
        curve, u = curve_through(replace(item, kind=item.curve), basis, item.names, ranges, adaptive)
        direction = (_doubled if doubled else _crossing)(item, curve, u)
        leaving = _Departure(item, curve, u, direction, ranges, settings)
        half = doubled or side is not None
        trace = leaving.half(float(side or 1)) if half else leaving.whole()
    own = {name: known.known[name] for name in ("onto", "damped", "mode") if name in known.known}
    kept = {**options_of(settings, wanted, given), **own}
    context = {"system": orbit.system, "parameter": name, **kept}
    met = [replace(event, context=context) for event in trace.bifurcations]
    departs = None if trace.departs is None else Junction.of(trace.departs)
    return tracked_class(kept)(
        item.curve, item.names, orbit.system, name, trace.points, met, [], trace.closed, trace.endings,
        settings.observe, kept, tuple(trace.open_questions), departs=departs,
    )  # fmt: skip


def _crossing(item: TrackedEvent, curve: MotionProblem, u: Array) -> Array:
    """The direction of the other curve at a branch point; +1 is the side on which the last parameter grows, or where it
    hardly moves, the largest coefficient.
    """
    basis = curve.balance.basis
    weights = curve.weights(u, 0.0)
    if item.tangent is None:
        raise InputError("this branch point does not know the direction of its curve: locate it again")
    known, own = np.array(item.tangent), item.orbit.basis
    motion = known[: own.size * curve.balance.size].reshape(own.size, -1)
    tangent = np.concatenate((own.resized(motion, basis).ravel(), known[motion.size :]))
    direction = _of_half_the_period(curve, u, weights, tangent)
    if direction is None:
        direction = other_direction(curve, u, weights, tangent)
    scaled = weights * direction
    leading = scaled[-1] if abs(scaled[-1]) > 1e-3 else scaled[int(np.argmax(np.abs(scaled[:-1])))]
    return math.copysign(1.0, leading) * direction


def _of_half_the_period(curve: MotionProblem, u: Array, weights: Array, tangent: Array) -> Array | None:
    """The direction of motions of half the period where a curve runs into them, None where it does not.

    In symmetric systems two more directions may lead away there, which differ by the phase of what vanishes: among the
    even harmonics there is one.
    """
    numbers = np.repeat((np.arange(curve.balance.basis.size) + 1) // 2, curve.balance.size)
    odd = np.append(numbers % 2 == 1, np.zeros(len(u) - len(numbers), dtype=bool))
    size, known = length(weights * u), length(weights * tangent)
    if length((weights * u)[odd]) > _FAINT * size or length((weights * tangent)[odd]) < 0.5 * known:
        return None
    direction = np.zeros(len(u))
    direction[~odd] = np.linalg.svd(curve.evaluate(u).jacobian[:, ~odd] / weights[~odd])[2][-1] / weights[~odd]
    return direction


def _doubled(item: TrackedEvent, curve: MotionProblem, u: Array) -> Array:
    """The direction of the motions of twice the period at a period doubling."""
    state = item.orbit.state()
    vectors = item.null_vectors or null_vectors(state, Kind.HALF)
    size = curve.balance.size
    weighted = vectors.right * state.balance.row_weights(len(vectors.right))
    phi = doubled_direction(weighted, size, curve.balance.basis)
    direction = curve.join(phi, 0.0, np.zeros(curve.augmentation.extras))
    return direction / length(curve.weights(u, 0.0) * direction)
