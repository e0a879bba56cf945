"""Following a response curve: points, stability, located bifurcations and events, until it ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from suboctave.analysis.audit import Audit
from suboctave.analysis.branch import BranchPoint
from suboctave.analysis.guard import BRANCH_POINT, CountCheck, StepGuard
from suboctave.analysis.response import ResponseCurve, ResponseEvaluation
from suboctave.bifurcation import ALL_KINDS, Bifurcation, BifurcationKind, Sample
from suboctave.bifurcation.finder import Located, locate, locate_near
from suboctave.bifurcation.grazing import locate_grazings, touches
from suboctave.bifurcation.layer import (
    behind_grazing,
    behind_their_grazings,
    grazing_beside,
    layer_of,
    solve_or_behind,
    unresolved,
)
from suboctave.bifurcation.solve import Guess, Singular
from suboctave.continuation import CurvePoint, Event, March, NewtonOptions, SteppingOptions
from suboctave.continuation.events import locate_zero
from suboctave.continuation.linear import length
from suboctave.continuation.march import make_point, point_between
from suboctave.continuation.newton import correct
from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.selection import choose_harmonics, next_harmonics, truncation
from suboctave.harmonic.state import BalanceState
from suboctave.stability import floquet_multipliers

#: distance of a located bifurcation's critical multiplier from the unit circle up to which its harmonics suffice
_CRITICAL = 1e-3

#: a limit point closer to a branch point than this, in scaled arclength, is the branch point
_APART = 1e-5
_NOT_FOUND = {
    "BP": "the curve may have jumped to another branch: its orientation changes without a branch point",
    "LP": "the branch turns back, but its limit point could not be located",
    "PD": "a multiplier passes -1, but no period doubling could be located",
}


@dataclass(frozen=True)
class Settings:
    """How a curve is followed and what is reported."""

    newton: NewtonOptions
    stepping: SteppingOptions
    events: Sequence[Event] = ()
    observe: int = 0
    report: Callable[[float, str], None] | None = None


@dataclass
class Trace:
    """What following a curve in one direction gave."""

    points: list[BranchPoint] = field(default_factory=list)
    bifurcations: list[Bifurcation] = field(default_factory=list)
    events: list[Bifurcation] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    audit: Audit = field(default_factory=Audit)
    closed: bool = False
    ended: str = ""
    interrupted: bool = False

    def reversed_before(self, other: Trace) -> Trace:
        """This trace walked backwards, then `other`, which started from the same point."""
        whole = self.points[-1].arclength
        back = [replace(p, arclength=whole - p.arclength) for p in reversed(self.points)]
        on = [replace(p, arclength=whole + p.arclength) for p in other.points[1:]]

        def joined(first: list[Bifurcation], second: list[Bifurcation]) -> list[Bifurcation]:
            flipped = [b.seen_backwards(whole - b.arclength) for b in reversed(first)]
            return flipped + [replace(b, arclength=whole + b.arclength) for b in second]

        return Trace(
            back + on,
            joined(self.bifurcations, other.bifurcations),
            joined(self.events, other.events),
            self.warnings + other.warnings,
            self.audit.reversed_before(other.audit, whole),
            other.closed,
            other.ended if self.ended == other.ended else f"{self.ended} in one direction, {other.ended} in the other",
        )


def follow(start: CurvePoint, direction: float, bounds: tuple[float, float], settings: Settings) -> Trace:
    """Follow a response curve from a solved start; KeyboardInterrupt ends it politely."""
    return _Follower(start, direction, bounds, settings).run()


class _Follower:
    def __init__(self, start: CurvePoint, direction: float, bounds: tuple[float, float], settings: Settings) -> None:
        self.settings = settings
        self.bounds = bounds
        self.direction = direction
        self.march = March(start, direction, bounds, settings.newton, settings.stepping, self._clear)
        self.trace = Trace()
        self.previous: Sample | None = None
        self._candidate: Sample | None = None
        self._guard = StepGuard(self._between, lambda a, b: self._located(BRANCH_POINT, a, b) is not None)
        self._again: tuple[Sample, ResponseCurve, Sample] | None = None
        self._count = CountCheck()
        self._last_located: tuple[BifurcationKind, Sample, Sample, Located | None] | None = None
        self._done = 0.0
        #: somebody who keeps what has been found (`progress.reporting`)
        self._found: Callable[[Trace], None] | None = getattr(settings.report, "found", None)

    def run(self) -> Trace:
        trace = self.trace
        try:
            for point in self.march:
                self._accept(point)
            trace.closed, trace.ended = self.march.closed, self.march.ended
        except KeyboardInterrupt:
            where = self.previous.point.curve.where(self.previous.point.u) if self.previous else "the start"
            trace.interrupted = True
            trace.ended = f"interrupted at {where}; what was computed is kept"
        trace.audit = self._guard.audit
        trace.warnings += [
            f"{stretch}; a smaller max_step or more harmonics may settle it" for stretch in trace.audit.unsettled
        ]
        if trace.closed:
            _drop_seam(trace.bifurcations)
            _drop_seam(trace.events)
        return trace

    def _sample(self, point: CurvePoint) -> Sample:
        candidate = self._candidate
        if candidate is not None and candidate.point is point:
            return candidate
        assert isinstance(point.evaluation, ResponseEvaluation)
        return Sample(point, point.evaluation.state)

    def _clear(self, a: CurvePoint, b: CurvePoint) -> bool:
        """True if a step stays on its curve and its interior could be looked at."""
        self._candidate = new = self._sample(b)
        if self.previous is None or _at_rest(self.previous) or _at_rest(new):
            return True
        return not self._guard.refuses(self._solved_again(self.previous, new), new)

    def _solved_again(self, sample: Sample, next_one: Sample) -> Sample:
        """A sample in the discretisation of the step that leaves it: where harmonics change, the motion moves a little
        and test functions with it.
        """
        point, curve = sample.point, next_one.point.curve
        assert isinstance(curve, ResponseCurve)
        if point.curve is curve:
            return sample
        known = self._again
        if known is None or known[0] is not sample or known[1] is not curve:
            weights = next_one.point.weights
            along = curve.transfer(point.tangent, point.curve)
            row = weights * along / length(weights * along)
            try:
                solved = correct(curve, curve.transfer(point.u, point.curve), row, weights, self.settings.newton)
                again = self._sample(make_point(solved, curve, along, point.arclength))
            except ConvergenceError:
                again = sample
            self._again = known = (sample, curve, again)
        return known[2]

    def _between(self, a: Sample, b: Sample, fraction: float) -> Sample:
        """The motion at a fraction of the way between two neighbours."""
        return self._sample(point_between(a.point, b.point, fraction, self.settings.newton))

    def _accept(self, point: CurvePoint) -> None:
        sample = self._sample(point)
        passed = [sample]
        if self.previous is not None:
            if _at_rest(self.previous) or _at_rest(sample):
                self._guard.forget()
            else:
                again = self._solved_again(self.previous, sample)
                if again is not self.previous:
                    self._search_here(self.previous, again)
                    self.previous = again
                passed = self._guard.passage(again, sample).samples
        for new in passed:
            if self.previous is not None:
                self._search(self.previous, new)
            where = new.point
            self.trace.points.append(BranchPoint(self._orbit(new), new.floquet, where.arclength, where.iterations))
            self.previous = new
        report = self.settings.report
        if report is not None:
            low, high = self.bounds
            share = (point.parameter - low) / (high - low)
            # where the branch folds back the share done does not
            self._done = max(self._done, min(1.0, share if self.direction > 0 else 1.0 - share))
            report(self._done, point.curve.where(point.u))
        if self._found is not None:
            self._found(self.trace)

    def _orbit(self, sample: Sample) -> PeriodicOrbit:
        evaluation = sample.point.evaluation
        assert isinstance(evaluation, ResponseEvaluation)
        curve = sample.point.curve
        assert isinstance(curve, ResponseCurve)
        return _as_orbit(sample.state, evaluation.error, evaluation.truncation, curve)

    def _search_here(self, old: Sample, again: Sample) -> None:
        """Events that lie behind a point in one discretisation and before it in the next."""
        kinds: list[BifurcationKind] = [kind for kind in ALL_KINDS if kind.changed(old, again)]
        kinds += touches(old, again)[0]
        if not kinds:
            return
        points = self.trace.points
        reach = points[-1].arclength - points[-2].arclength if len(points) > 1 else self.settings.stepping.initial_step
        for kind in kinds:
            located = locate_near(kind, again, reach, _guess)
            if located is not None:
                item = self._bifurcation(located, again, again)
                if not any(_same_event(item, known) for known in self.trace.bifurcations[-4:]):
                    self.trace.bifurcations.append(item)
                    self._count.noted(item)
                    continue
            self._guard.doubt(old, again, f"{kind.name} may have happened twice within what more harmonics change")

    def _search(self, a: Sample, b: Sample) -> None:
        found: list[tuple[float, Bifurcation]] = []
        branch_point: Located | None = None
        # at rest the equations have a corner where a contact is closed: nothing bifurcates there
        for kind in () if _at_rest(a) or _at_rest(b) else ALL_KINDS:
            if not kind.changed(a, b):
                continue
            located = self._located(kind, a, b)
            if kind is BRANCH_POINT:
                branch_point = located
            if kind.name == "LP" and branch_point is not None:
                # at a pitchfork the bifurcating branch turns back exactly at the branch point
                size = b.point.arclength - a.point.arclength
                if located is None or size * abs(located.fraction - branch_point.fraction) < _APART:
                    continue
            if located is None:
                if kind.name != "NS":  # several real multipliers may pass for a pair: the count tells
                    self._guard.doubt(a, b, _NOT_FOUND[kind.name])
                continue
            found.append((located.fraction, self._bifurcation(located, a, b)))
        complaint = self._count.complaint(b, [item for _, item in found])
        if not (_at_rest(a) or _at_rest(b)):
            for touched in locate_grazings(a, b, self.settings.newton, self._sample, _guess):
                found.append((touched.fraction, self._bifurcation(touched, a, b)))
        if complaint is not None:
            self._guard.doubt(*complaint)
        self.trace.bifurcations += behind_their_grazings(found)
        for event in self.settings.events:
            crossed = self._event(event, a, b)
            if crossed is not None:
                self.trace.events.append(crossed)

    def _located(self, kind: BifurcationKind, a: Sample, b: Sample) -> Located | None:
        """A bifurcation between two neighbours; a branch point only if its system was solved."""
        known = self._last_located
        if known is not None and known[0] is kind and known[1] is a and known[2] is b:
            return known[3]
        must_solve = kind is BRANCH_POINT
        found = locate(kind, a, b, self.settings.newton, self._sample, _guess, 9 if must_solve else 34)
        if must_solve and found is not None and found.solution is None:
            found = None
        self._last_located = (kind, a, b, found)
        return found

    def _bifurcation(self, located: Located, a: Sample, b: Sample) -> Bifurcation:
        arclength = a.point.arclength + located.fraction * (b.point.arclength - a.point.arclength)
        curve = b.point.curve
        assert isinstance(curve, ResponseCurve)
        solution = located.solution
        if solution is None:
            guess = _guess(located.sample.point.u, located.sample.point, _kappa(located))
            solution = behind_grazing(located.kind, guess) or self._with_more_harmonics(located, a, b)
        if solution is None:
            orbit = self._orbit(located.sample)
            beside = grazing_beside(guess)
            # what is bracketed is the change of a test; where a contact grazes, harmonics matter beyond that
            width = located.width if beside is None else max(located.width, abs(guess.parameter - beside.parameter))
            self.trace.warnings.append(
                f"{located.kind.name} near {curve.where(located.sample.point.u)} could only be bracketed, "
                f"to +- {width:.1e}: "
                + (f"{beside.label} grazes there" if beside else "too few harmonics are kept, or a law is rough there")
            )
            return Bifurcation(
                located.kind.name,
                orbit,
                located.sample.floquet,
                orbit.residual,
                orbit.amplitude(self.settings.observe),
                curve.name,
                uncertainty=width,
                arclength=arclength,
                contact=beside,
            )
        solution = self._refined(located, solution, curve)
        state = solution.state
        guess = Guess(state.balance, state.x, state.omega, state.values, curve.name, curve.span, solution.kappa)
        layer = layer_of(located.kind, solution, guess)
        orbit = _as_orbit(state, solution.residual, truncation(state), curve)
        return Bifurcation(
            located.kind.name,
            orbit,
            floquet_multipliers(state),
            solution.residual,
            orbit.amplitude(self.settings.observe),
            curve.name,
            solution.vectors,
            solution.kappa,
            0.0 if layer is None else unresolved(located.kind, guess, layer),
            arclength=arclength,
            contact=layer or located.kind.contact(solution, curve.name),
        )

    def _with_more_harmonics(self, located: Located, a: Sample, b: Sample) -> Singular | None:
        """A bracketed bifurcation solved with more harmonics: ripples of the truncated motion on a contact may be in
        the way with fewer.
        """
        sample = located.sample
        curve = sample.point.curve
        assert isinstance(curve, ResponseCurve)
        state, size = sample.state, b.point.arclength - a.point.arclength
        while curve.adaptive is not None:
            basis = next_harmonics(state, curve.adaptive)
            if basis.harmonics <= state.basis.harmonics:
                break
            x = state.basis.resized(state.x, basis)
            balance = curve.with_basis(basis).balance.settle(x, state.omega, state.values)
            state = balance.at(x, state.omega, state.values)
            try:
                guess = Guess(balance, x, state.omega, state.values, curve.name, curve.span, located.kind.kappa(sample))
                found = located.kind.solve(guess)
            except ConvergenceError:
                continue
            wide = curve.with_balance(balance)
            there = wide.join(
                found.state.x, found.state.omega if curve.name == "omega" else found.state.values[curve.name]
            )
            away = sample.point.weights * (sample.point.curve.transfer(there, wide) - sample.point.u)
            if located.kind.genuine(found, guess) and length(away) <= size:
                return found
        return None

    def _refined(self, located: Located, solution: Singular, curve: ResponseCurve) -> Singular:
        """Solved again with the harmonics that the tolerance for events asks for."""
        adaptive = curve.adaptive
        if adaptive is None:
            return solution
        for _ in range(8):
            state = solution.state
            basis = choose_harmonics(state, adaptive, adaptive.event_tolerance)
            if basis.harmonics <= state.basis.harmonics:
                # a small neglected motion may still matter (a stiff contact just closed): the critical multiplier tells
                critical = located.kind.critical(solution)
                if critical is None or np.abs(floquet_multipliers(state).multipliers - critical).min() <= _CRITICAL:
                    break
                basis = next_harmonics(state, adaptive)
            if basis.harmonics <= state.basis.harmonics:
                break
            x = state.completed.basis.resized(state.completed.x, basis)
            # more harmonics need more samples of a law that tells nothing of itself
            balance = curve.with_basis(basis).balance.settle(x, state.omega, state.values)
            guess = Guess(balance, x, state.omega, state.values, curve.name, curve.span, solution.kappa)
            try:
                better = solve_or_behind(located.kind, guess)
            except ConvergenceError as failure:
                self.trace.warnings.append(
                    f"{located.kind.name} near omega = {state.omega:.6g} was located with {state.basis.harmonics} "
                    f"harmonics; with {basis.harmonics} it was not found again ({failure})"
                )
                break
            moved = abs(better.state.omega - state.omega) / state.omega
            if moved > 0.05:
                self.trace.warnings.append(
                    f"{located.kind.name} near omega = {state.omega:.6g} moves by {moved:.1%} with {basis.harmonics} "
                    f"harmonics instead of {state.basis.harmonics}: too few harmonics to trust it"
                )
                break
            solution = better
        return solution

    def _event_value(self, event: Event, sample: Sample) -> float:
        value = event.function(self._orbit(sample))
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = float("nan")
        if not np.isfinite(number):
            where = sample.point.curve.where(sample.point.u)
            raise InputError(f"event {event.name!r} returned {value!r} at {where}; it must return a finite number")
        return number

    def _event(self, event: Event, a: Sample, b: Sample) -> Bifurcation | None:
        value_a, value_b = (self._event_value(event, sample) for sample in (a, b))
        if not (value_a == 0.0 and a.point.arclength == 0.0) and not value_a * value_b < 0.0 and value_b != 0.0:
            return None
        try:
            point = locate_zero(
                a.point,
                b.point,
                value_a,
                value_b,
                lambda p: self._event_value(event, self._sample(p)),
                self.settings.newton,
            )
        except ConvergenceError as failure:
            self.trace.warnings.append(f"event {event.name!r}: {failure}")
            return None
        sample = self._sample(point)
        orbit = self._orbit(sample)
        curve = point.curve
        assert isinstance(curve, ResponseCurve)
        return Bifurcation(
            event.name,
            orbit,
            sample.floquet,
            orbit.residual,
            orbit.amplitude(self.settings.observe),
            curve.name,
            arclength=point.arclength,
        )


def _at_rest(sample: Sample) -> bool:
    curve = sample.point.curve
    assert isinstance(curve, ResponseCurve)
    return curve.at_rest(sample.point.u)


def _as_orbit(state: BalanceState, residual: float, neglected: float, curve: ResponseCurve) -> PeriodicOrbit:
    values = dict(state.values)
    return PeriodicOrbit(state.balance, state.x.copy(), state.omega, values, residual, neglected, curve.adaptive)


def _guess(u: Array, point: CurvePoint, kappa: float) -> Guess:
    curve = point.curve
    assert isinstance(curve, ResponseCurve)
    x, omega, values = curve.split(u)
    return Guess(curve.balance, x, omega, values, curve.name, curve.span, kappa)


def _kappa(located: Located) -> float:
    try:
        return located.kind.kappa(located.sample)
    except ConvergenceError:
        return 0.0


def _same_event(a: Bifurcation, b: Bifurcation) -> bool:
    name = a.parameter_name
    if a.kind != b.kind or (a.kind == "grazing" and _element(a) != _element(b)):
        return False
    same_place = np.isclose(a.parameter(name), b.parameter(name), rtol=1e-9)
    return bool(same_place and np.isclose(a.amplitude, b.amplitude, rtol=1e-6))


def _element(item: Bifurcation) -> int | None:
    return None if item.contact is None else item.contact.element


def _drop_seam(items: list[Bifurcation]) -> None:
    """What lies on the seam of a closed curve is met at both ends: keep the first."""
    # several contacts may graze at once
    while len(items) > 1 and any(_same_event(items[-1], first) for first in items[: min(3, len(items) - 1)]):
        items.pop()


__all__ = ["Settings", "Trace", "follow"]
