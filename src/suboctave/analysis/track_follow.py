"""Following a curve of bifurcations in two parameters: points, events, and the reasons to stop.

Besides the ends of the ranges a curve ends where its bifurcations cease to be of their kind:

- NS: kappa reaches 0 (R1, on a curve of limit points) or w0/2 (R2, on a curve of period doublings);
- BP: the unfolding is not zero any more, the symmetry that forces branch points being broken;
- on motions of several load periods: the sub-harmonic part vanishes. In the basis of the doubled period every period
  doubling of the parent motion solves the equations of a limit point; a tracker that slides onto it must not go on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from suboctave.analysis.follow import Settings
from suboctave.analysis.tracked_branch import TrackedPoint
from suboctave.analysis.tracked_curve import TrackedCurve, TrackedEvaluation
from suboctave.analysis.tracked_events import (
    CurveTest,
    DoubleMultiplier,
    Found,
    GeneralisedDoubling,
    TrackedSample,
    events_between,
    nearest_point,
    same_discretisation,
    tests_of,
    zero_along,
)
from suboctave.bifurcation.augmented import BranchPointUnfolded, GrazingContactEquations, SingularOperator
from suboctave.bifurcation.bordered import null_vectors
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation import CurvePoint, March, kernels
from suboctave.continuation.march import between, make_point
from suboctave.continuation.newton import correct
from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.selection import truncation

#: sub-harmonic share of the motion from which on the end of the curve is looked for, and which is none any more
_FAINT, _NOTHING_LEFT = 1e-2, 1e-5
#: way along the parent's curve, in scaled arclength, within which that end lies
_BESIDE = 0.05
#: kappa in units of the base frequency, from 0 or 1/2, at which an NS curve has reached its end
_RESONANT = 2e-3
#: unfolding, in units of the forces that balance, above which there is no branch point
_UNFOLDING = 1e-8
#: steps longer than this, in scaled arclength, must not change the curve's orientation
_JUMP = 1e-4


@dataclass
class TrackedTrace:
    """What following a curve in one direction gave."""

    points: list[TrackedPoint] = field(default_factory=list)
    events: list[TrackedEvent] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    closed: bool = False
    ended: str = ""
    interrupted: bool = False

    def reversed_before(self, other: TrackedTrace) -> TrackedTrace:
        """This trace walked backwards, then `other`, which started from the same point."""
        whole = self.points[-1].arclength
        points = [replace(p, arclength=whole - p.arclength) for p in reversed(self.points)]
        points += [replace(p, arclength=whole + p.arclength) for p in other.points[1:]]
        events = [replace(e, arclength=whole - e.arclength) for e in reversed(self.events)]
        events += [replace(e, arclength=whole + e.arclength) for e in other.events]
        same = self.ended == other.ended
        ended = other.ended if same else f"{self.ended} in one direction, {other.ended} in the other"
        return TrackedTrace(points, events, self.warnings + other.warnings, False, ended, other.interrupted)


@dataclass(frozen=True)
class Box:
    """Ranges of the two free parameters, None where one is not bounded: the curve ends where it leaves them."""

    first: tuple[float, float] | None
    second: tuple[float, float]


def follow_tracked(start: CurvePoint, box: Box, settings: Settings) -> TrackedTrace:
    """Follow a curve from a solved start along the start's own tangent; KeyboardInterrupt ends it politely."""
    return _Tracker(start, box, settings).run()


class _Tracker:
    def __init__(self, start: CurvePoint, box: Box, settings: Settings) -> None:
        assert isinstance(start.curve, TrackedCurve)
        self.settings = settings
        self.box = box
        heading = math.copysign(1.0, start.tangent[start.curve.parameter])
        self.march = March(start, heading, box.second, settings.newton, settings.stepping, self._clear)
        self.trace = TrackedTrace()
        self.tests: tuple[CurveTest, ...] = tests_of(start.curve)
        self.previous: TrackedSample | None = None

    def run(self) -> TrackedTrace:
        trace = self.trace
        try:
            for point in self.march:
                stop = self._accept(point)
                if stop is not None:
                    trace.ended = stop
                    break
            else:
                trace.closed, trace.ended = self.march.closed, self.march.ended
        except KeyboardInterrupt:
            where = self.previous.curve.where(self.previous.point.u) if self.previous else "the start"
            trace.interrupted = True
            trace.ended = f"interrupted at {where}; what was computed is kept"
        if trace.closed:
            _drop_seam(trace.events)
        return trace

    def _clear(self, a: CurvePoint, b: CurvePoint) -> bool:
        """True if a step stays on its curve."""
        assert isinstance(b.curve, TrackedCurve)
        if b.orientation != a.orientation and b.arclength - a.arclength > _JUMP:
            return False
        nu = b.curve.balance.basis.nu
        if nu > 1 and _subharmonic_share(b) > _NOTHING_LEFT:
            before, behind = (_subharmonic_parts(p, nu) for p in (replace(a, u=_in_basis(a, b), curve=b.curve), b))
            return all(float(p @ q) >= 0.25 * float(p @ p) for p, q in zip(before, behind, strict=True))
        return True

    def _accept(self, point: CurvePoint) -> str | None:
        """Take a point in; a sentence if the curve ends before it."""
        new = TrackedSample(point)
        if self.previous is not None:
            if point.curve is self.march.start.curve:
                new = self._closing(self.previous, new)
            a = same_discretisation(self.previous, new, self.settings.newton)
            stop = self._kind_ends(a, new)
            if stop is not None:
                return stop
            landed = self._leaves(a, new)
            b = self._smooth(a, new if landed is None else landed)
            for found in events_between(a, b, self.tests, self.settings.newton, self.trace.warnings):
                self.trace.events.append(self._event(found))
            self._add(b)
            if landed is not None:
                return f"reached the end of the range at {landed.curve.where(landed.point.u)}"
            if landed is None and not self._inside(new):
                return f"left the range after {a.curve.where(a.point.u)}; no solution was found exactly on its end"
        else:
            self._add(new)
        self.previous = new
        report = self.settings.report
        if report is not None:
            low, high = self.box.second
            report(min(1.0, max(0.0, (point.parameter - low) / (high - low))), point.curve.where(point.u))
        return None

    def _smooth(self, a: TrackedSample, b: TrackedSample) -> TrackedSample:
        """The second of two neighbours with the direction in which the curve comes to it.

        On the end of a range a coefficient may have a corner (a gap that is just closed): derivatives there may be those
        of the far side.
        """
        point = b.point
        if kernels.cosine(a.curve_tangent(b.curve), point.tangent, point.weights) > math.cos(
            2.5 * self.settings.stepping.angle
        ):
            return b
        chord = point.weights * (point.u - b.curve.transfer(a.point.u, a.curve))
        return TrackedSample(replace(point, tangent=kernels.normalised(chord, point.weights)))

    def _add(self, sample: TrackedSample) -> None:
        point = sample.point
        self.trace.points.append(
            TrackedPoint(
                _orbit(sample),
                point.arclength,
                point.iterations,
                self.settings.stability,
                _extra(sample.evaluation),
                sample.coefficient,
            )
        )

    def _closing(self, a: TrackedSample, back: TrackedSample) -> TrackedSample:
        """The first point again, with the bordering vectors of the last."""
        curve, weights = a.curve.adapted(a.point.u, a.evaluation), back.point.weights
        curve = curve.with_basis(back.curve.balance.basis)
        along = curve.transfer(a.point.tangent, a.curve)
        try:
            solved = correct(curve, back.point.u, weights * back.point.tangent, weights, self.settings.newton)
        except ConvergenceError:
            return back
        return TrackedSample(make_point(solved, curve, along, back.point.arclength))

    # --- ends ---

    def _inside(self, sample: TrackedSample) -> bool:
        if self.box.first is None:
            return True
        low, high = self.box.first
        return low <= float(sample.point.u[-2]) <= high

    def _leaves(self, a: TrackedSample, b: TrackedSample) -> TrackedSample | None:
        """The point at which the curve leaves the range of its first parameter, None if it does not."""
        if self._inside(b):
            return None
        assert self.box.first is not None
        index = b.curve.parameter - 1
        low, high = self.box.first
        bound = low if b.point.u[index] < low else high
        left, right = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (left + right)
            beyond = (between(a.point, b.point, middle)[index] - bound) * (b.point.u[index] - bound) > 0.0
            left, right = (left, middle) if beyond else (middle, right)
        guess = between(a.point, b.point, right)
        guess[index] = bound
        row = np.zeros(len(guess))
        row[index] = 1.0
        try:
            solved = correct(b.curve, guess, row, b.point.weights, self.settings.newton)
        except ConvergenceError:
            return None
        solved.u[index] = bound
        arclength = a.point.arclength + right * (b.point.arclength - a.point.arclength)
        return TrackedSample(make_point(solved, b.curve, b.point.tangent, arclength))

    def _kind_ends(self, a: TrackedSample, b: TrackedSample) -> str | None:
        augmentation = b.curve.augmentation
        if isinstance(augmentation, BranchPointUnfolded):
            beta = float(b.evaluation.extra[0])
            if abs(beta) > _UNFOLDING:
                return (
                    f"the branch points end after {a.curve.where(a.point.u)}: their unfolding is {beta:.1e} at "
                    f"{b.curve.where(b.point.u)}, the symmetry that forces them is broken there"
                )
        if isinstance(augmentation, SingularOperator) and augmentation.kind is Kind.FREE:
            share = b.kappa / b.state.rate
            if not _RESONANT < share < 0.5 - _RESONANT:
                return self._resonant_end(a, double=share > 0.25)
        if b.curve.balance.basis.nu > 1:
            share = _subharmonic_share(b.point)
            if share <= _FAINT:
                found = self._parent_end(a)
                if found is not None:
                    self.trace.events.append(replace(self._event(found), arclength=a.point.arclength))
                    where = found.sample.curve.where(found.sample.point.u)
                    return f"the curve ends on the period doublings of the parent motion, in a GPD at {where}"
            if share <= _NOTHING_LEFT:
                return (
                    f"the sub-harmonic part of the motion vanishes at {b.curve.where(b.point.u)}: what follows are "
                    "period doublings of the parent motion, which solve the same equations"
                )
        return None

    def _parent_end(self, a: TrackedSample) -> Found | None:
        """The GPD beside a faint LP of doubled motions, located on the PD curve of the parent; None if there is none."""
        curve = a.curve
        basis = curve.balance.basis
        if curve.augmentation.name != "LP" or basis.nu % 2:
            return None
        parent = HarmonicBasis(max(1, basis.harmonics // 2), basis.nu // 2)
        x = np.zeros((parent.size, curve.balance.size))
        x[0], x[1::2], x[2::2] = a.state.x[0], a.state.x[3::4][: parent.harmonics], a.state.x[4::4][: parent.harmonics]
        try:
            balance = curve.balance.with_basis(parent).settle(x, a.state.omega, a.state.values)
            state = balance.at(x, a.state.omega, a.state.values)
            doubling = SingularOperator(Kind.HALF, null_vectors(state, Kind.HALF))
            curve = replace(curve, balance=balance, augmentation=doubling, cache={})
            u = curve.join(x, np.zeros(0), a.point.u[-2:])
            start = nearest_point(curve, u, curve.weights(u, curve.size(u)), self.settings.newton)
            found = zero_along(start, GeneralisedDoubling(), self.settings.newton, _BESIDE)
        except ConvergenceError:
            return None
        return Found(GeneralisedDoubling(), found)

    def _resonant_end(self, a: TrackedSample, double: bool) -> str:
        """The 1:1 or 1:2 resonance in which an NS curve ends, located on the LP or PD curve through it."""
        name, operator, words = ("R2", Kind.HALF, "1:2") if double else ("R1", Kind.INTEGER, "1:1")
        where = a.curve.where(a.point.u)
        try:
            borders = null_vectors(a.state, operator)
            curve = replace(a.curve, augmentation=SingularOperator(operator, borders))
            u = curve.join(a.state.x, np.zeros(0), a.point.u[-2:])
            weights = curve.weights(u, a.curve.size(a.point.u))
            start = nearest_point(curve, u, weights, self.settings.newton)
            found = zero_along(start, DoubleMultiplier(name), self.settings.newton, 0.2)
        except ConvergenceError as failure:
            return f"the curve ends in a {words} resonance beyond {where} ({failure})"
        item = replace(self._event(Found(DoubleMultiplier(name), found)), arclength=a.point.arclength, curve="NS")
        self.trace.events.append(item)
        return f"the curve ends in a {words} resonance at {found.curve.where(found.point.u)}"

    # --- events ---

    def _event(self, found: Found) -> TrackedEvent:
        sample, curve = found.sample, found.sample.curve
        orbit = _orbit(sample)
        return TrackedEvent(
            found.test.kind,
            orbit,
            self.settings.stability.along(sample.state),
            orbit.residual,
            orbit.amplitude(self.settings.observe),
            getattr(found.test, "name", curve.names[1]),
            sample.vectors,
            sample.kappa,
            arclength=sample.point.arclength,
            curve=curve.augmentation.name,
            names=curve.names,
            extreme=found.extreme,
        )


def _orbit(sample: TrackedSample) -> PeriodicOrbit:
    state = sample.state
    values = dict(state.values)
    error, neglected = sample.evaluation.error, truncation(state)
    return PeriodicOrbit(state.balance, state.x.copy(), state.omega, values, error, neglected, sample.curve.adaptive)


def _extra(evaluation: TrackedEvaluation) -> float:
    augmentation = evaluation.curve.augmentation
    if isinstance(augmentation, BranchPointUnfolded) or not augmentation.extras:
        return 0.0
    value = float(evaluation.extra[0])
    return value % (2.0 * math.pi) if isinstance(augmentation, GrazingContactEquations) else value


def _in_basis(a: CurvePoint, b: CurvePoint) -> Array:
    return b.curve.transfer(a.u, a.curve)


def _subharmonic_parts(point: CurvePoint, nu: int) -> list[Array]:
    """Harmonics that the motion would not have if it repeated earlier: one array for each prime factor of nu."""
    curve = point.curve
    assert isinstance(curve, TrackedCurve)
    basis = curve.balance.basis
    x = point.u[: curve.balance.dimension].reshape(basis.size, -1) * curve.balance.scales()[0]
    k = np.repeat(np.arange(1, basis.harmonics + 1), 2)
    return [x[1:][k % prime != 0].ravel() for prime in range(2, nu + 1) if nu % prime == 0 and _is_prime(prime)]


def _is_prime(number: int) -> bool:
    return all(number % d for d in range(2, math.isqrt(number) + 1))


def _subharmonic_share(point: CurvePoint) -> float:
    """Smallest share of the motion that one of its period multiplications has brought about."""
    curve = point.curve
    assert isinstance(curve, TrackedCurve)
    size = curve.size(point.u) or 1.0
    return min(float(np.linalg.norm(part)) for part in _subharmonic_parts(point, curve.balance.basis.nu)) / size


def _drop_seam(events: list[TrackedEvent]) -> None:
    """What lies on the seam of a closed curve is met at both ends: keep the first."""
    if len(events) > 1:
        first, last = events[0], events[-1]
        names = first.names
        same = all(math.isclose(first.parameter(n), last.parameter(n), rel_tol=1e-8, abs_tol=1e-12) for n in names)
        if first.kind == last.kind and first.parameter_name == last.parameter_name and same:
            events.pop()


__all__ = ["Box", "TrackedTrace", "follow_tracked"]
