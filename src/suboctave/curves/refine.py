"""From what a step brackets to a bifurcation: solved, with as many harmonics as it needs, and labelled."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.bifurcation.bordered import branching_equation
from suboctave.continuation import NewtonOptions
from suboctave.continuation.linear import distance, length
from suboctave.continuation.notes import Note
from suboctave.continuation.point import solved_again
from suboctave.curves.events.beyond import is_bifurcation, lacks_harmonics, resolved, zero_beside
from suboctave.curves.events.layer import (
    behind_grazing,
    grazing_beside,
    layer_of,
    solve_or_behind,
    unresolved,
)
from suboctave.curves.events.locate import Guess, Singular
from suboctave.curves.events.monitors import BRANCH_POINT, BifurcationKind, Located, locate, position
from suboctave.curves.interior import FINEST, contacts_between
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.truncation import (
    AdaptiveHarmonics,
    beyond_usual,
    choose_harmonics,
    next_harmonics,
    truncation,
)

#: distance of a located bifurcation's critical multiplier from the unit circle up to which its harmonics suffice
_CRITICAL = 1e-3
_NEWTON = NewtonOptions()
#: how many times the distance of a bifurcation from where it lies with more harmonics is stated: they leave out less,
#: but not nothing
_COVERED = 1.2
#: bracket, as a share of a step, in which a bifurcation is looked for with more harmonics
_NARROW = 1e-5
#: fractions of a step beyond its ends up to which more harmonics may move a bifurcation located in it
_MOVED = 0.05
#: move of a bifurcation by more harmonics, as a share of its parameter's value or range, that is not trusted
_FAR = 0.05
#: component of the unit tangent along the parameter, in scaled arclength, at both ends of the shortest interval, from
#: which on a curve that turns in between does so in a corner: a smooth limit point would be bent by 1e3
_ABRUPT = 1e-2
#: how much farther off a corner may be than the tangents beside it say
_MORE = 1.2
#: slope of a branch in its parameter at a branch point, both scaled, below which it turns back there
_STILL = 1e-5


def bifurcation_at(located: Located, a: Sample, b: Sample, observe: int, notes: list[Note]) -> Bifurcation | None:
    """The bifurcation located between two neighbours: solved again with the harmonics that events ask for, labelled.

    None if the change of its test is all that is known. Beside the grazing of an exact contact, where Newton's method
    has no chance, that is enough: it is noted in `notes`, as is what was not found again.
    """
    arclength = a.point.arclength + located.fraction * (b.point.arclength - a.point.arclength)
    curve = b.curve
    solution = located.solution
    if solution is None:
        kappa = 0.0
        with suppress(ConvergenceError):
            kappa = located.kind.kappa(located.sample)
        guess = Guess.at(located.sample.point.u, located.sample.point, kappa)
        behind = behind_grazing(located.kind, guess)
        own = behind is not None and _lies_between(behind, curve, a, b)
        # harmonics may move it beyond the ends of a short step, where it may also be another one
        solution = behind if own else _with_more_harmonics(located, a, b) or behind
    if solution is None:
        seen = _seen_with_more(located, curve, observe, arclength, notes)
        if seen is not None:
            return seen
        sample, width, beside = located.sample, located.width, grazing_beside(guess)
        why = "a law is rough there" if beside is None else f"{beside.label} grazes there"
        # the bracket of a grazing shows the excursion itself
        if located.bracket is not None:
            corner = _corner(located.kind, *located.bracket)
            if beside is None and corner is None:
                return None
            # across a branch point other tests change, too, but also where contact begins everywhere at once
            crossed = BRANCH_POINT.changed(*located.bracket)
            if crossed and (corner is None or contacts_between(*located.bracket).grazes is None):
                return None
            if corner is not None and (crossed or beside is None):
                (sample, width), why = corner, "the curve turns abruptly there, in a corner of the equations"
        # what is bracketed is the change of a test; where a contact grazes, harmonics matter beyond that
        width = width if beside is None else max(width, abs(guess.parameter - beside.parameter))
        where, orbit = curve.where(sample.point.u), sample.orbit
        notes.append(_bracketed(located.kind, curve, sample.point.parameter, where, width, why))
        return Bifurcation(
            located.kind.name,
            orbit,
            sample.floquet,
            orbit.residual,
            orbit.amplitude(observe),
            curve.name,
            uncertainty=width,
            arclength=arclength,
            contact=beside,
        )
    unit = curve.unit(located.sample.point.weights)
    remarks: list[Note] = []
    item = solved_bifurcation(located.kind, solution, curve, observe, remarks, arclength, unit, (a, b))
    if located.width > item.uncertainty:
        item = replace(item, uncertainty=located.width)
    known = with_what_harmonics_move(located, item, a, b, observe, remarks)
    if known is None:
        return None
    item = known
    notes += remarks
    if item.kind != "BP":
        return item
    share = located.fraction
    tangent = (1.0 - share) * curve.transfer(a.point.tangent, a.curve) + share * b.point.tangent
    return replace(item, tangent=tuple(curve.with_balance(item.orbit.balance).transfer(tangent, curve).tolist()))


def _bracketed(kind: BifurcationKind, curve: MotionProblem, value: float, where: str, width: float, why: str) -> Note:
    """A note on a bifurcation of which a bracket is known, and no solution."""
    text = f"bracketed (to +- {width:.1e}), not solved for: {why}"
    return Note(text, curve.name, value, value, kind.name, where)


def _seen_with_more(
    located: Located, curve: MotionProblem, observe: int, arclength: float, notes: list[Note]
) -> Bifurcation | None:
    """A period doubling between motions with more harmonics that fewer have too far away: as a motion with more; None
    if it is none.
    """
    sample, kind = located.sample, located.kind
    if sample.finer is None or kind.name != "PD" or kind.multiplicity > 1:
        return None
    try:
        found = zero_beside(kind, sample.finer, sample.floquet, -1.0)
    except ConvergenceError:
        found = None
    if found is None:
        return None
    state, width = found.motion.state, found.width
    residual = state.balanced.size / state.balanced.scale
    orbit = PeriodicOrbit(
        state.balance, state.x.copy(), state.omega, dict(state.values), residual, truncation(state), curve.adaptive
    )
    where = f"{curve.name} = {found.motion.parameter:.6g}"
    why = "its system needs more harmonics than it is solved with"
    notes.append(_bracketed(kind, curve, found.motion.parameter, where, width, why))
    known = orbit.amplitude(observe), curve.name
    return Bifurcation(kind.name, orbit, found.floquet, orbit.residual, *known, uncertainty=width, arclength=arclength)


def with_what_harmonics_move(
    located: Located, item: Bifurcation, a: Sample, b: Sample, observe: int, notes: list[Note]
) -> Bifurcation | None:
    """A bifurcation solved for between two samples with too few harmonics: solved for from where it lies with more, or,
    where the curve has no more, with its distance from there as uncertainty. None if there is none with more. `notes`:
    what was said of it with too few.
    """
    kind, curve, state = located.kind, b.curve, item.orbit.state()
    solution = Singular(state, item.null_vectors, item.kappa, item.residual, 0)
    # beside a grazing it is stated already, and the curve with more harmonics is no smoother there
    if item.contact is not None or not lacks_harmonics(kind, solution, curve):
        return item
    own, share = curve.with_balance(state.balance), located.fraction
    tangent = (1.0 - share) * own.transfer(a.point.tangent, a.curve) + share * own.transfer(b.point.tangent, b.curve)
    try:
        finer = resolved(kind, solution, own, tangent)
    except ConvergenceError:
        finer = None
    if finer is None:
        return None
    if curve.adaptive is not None and next_harmonics(state, curve.adaptive).size > state.basis.size:
        with suppress(ConvergenceError):
            again = kind.solve(Guess(finer.motion.state, curve.name, curve.span, item.kappa))
            notes.clear()
            return solved_bifurcation(kind, again, curve, observe, notes, item.arclength)
    moved = abs(item.parameter(curve.name) - finer.motion.parameter)
    return replace(item, floquet=finer.floquet, uncertainty=max(item.uncertainty, _COVERED * moved))


def _corner(kind: BifurcationKind, a: Sample, b: Sample) -> tuple[Sample, float] | None:
    """The limit point in which a curve turns abruptly between two samples as close together as any are told apart: the
    one nearer to it in the parameter, and how far it may lie from that. None if the slope comes to zero on the way, as
    at a smooth one, or the two lie on different curves.

    Up to the corner the curve goes on about as at its ends, whose tangents meet in it: it lies no farther from either
    than the slope there times the way to that place, and some more.
    """
    weights, target = b.point.weights, b.curve.transfer(a.point.u, a.curve)
    chord = weights * (b.point.u - target)
    steepness = [abs(float(s.point.weights[s.point.curve.parameter])) * abs(s.slope) for s in (a, b)]
    if kind.name != "LP" or length(chord) > FINEST or min(steepness) < _ABRUPT:
        return None
    tangents = np.stack((weights * b.curve.transfer(a.point.tangent, a.curve), weights * b.point.tangent), axis=1)
    ways = np.maximum(np.abs(np.linalg.lstsq(tangents, chord, rcond=None)[0]), length(chord))
    widths = [_MORE * abs(s.slope) * float(way) for s, way in zip((a, b), ways, strict=True)]
    nearer = int(np.argmin(widths))
    return (a, b)[nearer], widths[nearer]


def solved_bifurcation(
    kind: BifurcationKind,
    solution: Singular,
    curve: MotionProblem,
    observe: int,
    notes: list[Note],
    arclength: float = 0.0,
    size: float = 0.0,
    neighbours: tuple[Sample, Sample] | None = None,
) -> Bifurcation:
    """A solved bifurcation with the harmonics that events ask for, labelled; `size` as in `Guess`; `neighbours`: the
    samples it was located between.
    """
    own = None if neighbours is None or neighbours[0] is neighbours[1] else neighbours
    solution, coarser = _refined(kind, solution, curve, notes, size, own)
    guess = _guess_from(solution, curve, size)
    state = solution.state
    layer = layer_of(kind, solution, guess)
    known = dict(state.values), solution.balance_residual, truncation(state), curve.adaptive
    orbit = PeriodicOrbit(state.balance, state.x.copy(), state.omega, *known)
    return Bifurcation(
        kind.name,
        orbit,
        solution.floquet,
        solution.residual,
        orbit.amplitude(observe),
        curve.name,
        solution.vectors,
        solution.kappa,
        0.0 if layer is None else unresolved(kind, guess, layer, coarser),
        arclength=arclength,
        contact=layer or kind.contact(solution, curve.name),
    )


def turns_at(located: Located, a: Sample, b: Sample) -> bool:
    """Whether the curve stands still in its parameter at a branch point between two samples, as the bifurcating branch
    of a pitchfork does.
    """
    curve, solution = b.curve, located.solution
    if solution is None:
        return False
    try:
        equation = branching_equation(solution.state, curve.name, curve.span, solution.vectors)
    except ConvergenceError:
        return False
    here, weights = curve.with_balance(solution.state.balance), b.point.weights
    chord = weights * (b.point.tangent if a is b else b.point.u - curve.transfer(a.point.u, a.curve))
    ways = [weights * curve.transfer(direction, here) for direction in equation.directions]
    along = max((way / length(way) for way in ways), key=lambda way: abs(float(way @ chord)))
    return abs(float(along[-1])) < _STILL


def _with_more_harmonics(located: Located, a: Sample, b: Sample) -> Singular | None:
    """A bracketed bifurcation solved with more harmonics: ripples of the truncated motion on a contact may be in
    the way with fewer.
    """
    curve, state = located.sample.curve, located.sample.state
    beyond: Singular | None = None
    while curve.adaptive is not None:
        basis = _more_harmonics(state, curve.adaptive)
        if basis.size <= state.basis.size:
            break
        kind, sample = located.kind, located.sample
        try:
            wide, state = curve.finer(state, basis)
        except ConvergenceError:
            break
        try:
            guess = Guess(state, curve.name, curve.span, kind.kappa(sample))
            solution = kind.solve(guess)
            if kind.genuine(solution, guess):
                if _lies_between(solution, wide, a, b):
                    return solution
                beyond = beyond or solution
        except ConvergenceError:
            pass
        between = _between(kind, wide, a, b)
        if between is not None:
            return between
    if beyond is None:
        return None
    wide = located.sample.curve.with_balance(beyond.state.balance)
    return beyond if _within_reach(beyond, wide, a, b) else None


def _more_harmonics(state: BalanceState, rule: AdaptiveHarmonics) -> HarmonicBasis:
    """A basis with more harmonics for one bifurcation; the present one where there are the most."""
    basis = next_harmonics(state, rule)
    return basis if basis.size > state.basis.size else beyond_usual(state, rule, one=True)


def _refined(
    kind: BifurcationKind,
    solution: Singular,
    curve: MotionProblem,
    notes: list[Note],
    size: float,
    neighbours: tuple[Sample, Sample] | None,
) -> tuple[Singular, tuple[int, float] | None]:
    """Solved again with the harmonics that events ask for; with how many it was found before that, and where."""
    adaptive = curve.adaptive
    coarser = None
    if adaptive is None:
        return solution, coarser
    for _ in range(8):
        state, here = solution.state, _guess_from(solution, curve).parameter
        basis = choose_harmonics(state, adaptive, adaptive.event_tolerance)
        if basis.size <= state.basis.size:
            # a small neglected motion may still matter (a stiff contact just closed): the critical multiplier tells
            critical = kind.critical(solution)
            if critical is None or np.abs(solution.floquet.multipliers - critical).min() <= _CRITICAL:
                basis = beyond_usual(state, adaptive, one=True)
            else:
                basis = _more_harmonics(state, adaptive)
        if basis.size <= state.basis.size:
            break
        try:
            wide, start = curve.finer(state, basis)
            guess = replace(_guess_from(solution, curve, size), state=start)
            better = solve_or_behind(kind, guess)
            # beside a young contact Newton's method may run to the next bifurcation of the kind
            if neighbours is not None and not _lies_between(better, wide, *neighbours):
                behind = behind_grazing(kind, guess)
                if behind is None or not _lies_between(behind, wide, *neighbours):
                    behind = _between(kind, wide, *neighbours)
                # one whose multiplier is off the circle by more than its error is none: harmonics moved it here
                elsewhere = behind is None and not _within_reach(better, wide, *neighbours)
                if elsewhere and is_bifurcation(kind, solution):
                    there = _guess_from(better, curve).parameter
                    raise ConvergenceError(f"it leads to another one, at {curve.name} = {there:.6g}")
                better, neighbours = behind or better, None if elsewhere else neighbours
        except ConvergenceError as failure:
            text = (
                f"located with few harmonics ({state.basis.harmonics}), not found again with more ({basis.harmonics}: "
                f"{failure}). Use more harmonics for the whole curve"
            )
            notes.append(Note(text, curve.name, here, here, kind.name))
            break
        moved = abs(_guess_from(better, curve).parameter - here) / max(abs(here), curve.span)
        if moved > _FAR:
            text = (
                f"too few harmonics, it moves ({moved:.1%}) with more ({basis.harmonics} instead of "
                f"{state.basis.harmonics}). Use more harmonics for the whole curve"
            )
            notes.append(Note(text, curve.name, here, here, kind.name))
            break
        coarser = state.basis.harmonics, here
        solution = better
    return solution, coarser


def _lies_between(solution: Singular, curve: MotionProblem, a: Sample, b: Sample) -> bool:
    """Whether a solution, one of the motions of `curve`, lies between two samples, but for what harmonics move."""
    there = curve.u_of(solution.state)
    share = position(a.point, b.point, b.curve.transfer(there, curve))
    if share is None or not -_MOVED <= share <= 1.0 + _MOVED:
        # of a short step, only its ends with the same harmonics tell
        ends = _ends(curve, a, b)
        share = None if ends is None else position(ends[0].point, ends[1].point, there)
    return share is not None and -_MOVED <= share <= 1.0 + _MOVED


def _within_reach(solution: Singular, curve: MotionProblem, a: Sample, b: Sample) -> bool:
    """Whether a solution, one of the motions of `curve`, lies no farther from either of two samples than they are
    apart: a bifurcation that harmonics move out of a short step; one farther off is another.
    """
    u, way = curve.u_of(solution.state), b.point.arclength - a.point.arclength
    away = (distance(s.curve.transfer(u, curve), s.point.u, b.point.weights) for s in (a, b))
    return min(away) <= way


def _between(kind: BifurcationKind, curve: MotionProblem, a: Sample, b: Sample) -> Singular | None:
    """What lies between two samples with the harmonics of `curve`; None if the test does not change there, or nothing
    is solved for.
    """
    ends = _ends(curve, a, b)
    if ends is None or not kind.changed(*ends):
        return None
    located = locate(kind, *ends, _NEWTON, _NARROW)
    return None if located is None else located.solution


def _ends(curve: MotionProblem, a: Sample, b: Sample) -> tuple[Sample, Sample] | None:
    """Two samples with other harmonics; None if they cannot be solved for."""
    try:
        first, last = (solved_in(curve, sample, _NEWTON) for sample in (a, b))
    except ConvergenceError:
        return None
    return first, last


def solved_in(curve: MotionProblem, sample: Sample, newton: NewtonOptions) -> Sample:
    """The same motion with other harmonics."""
    u = curve.transfer(sample.point.u, sample.curve)
    return sample.at(solved_again(sample.point, curve, curve.weights(u, 0.0), newton))


def _guess_from(solution: Singular, curve: MotionProblem, size: float = 0.0) -> Guess:
    return Guess(solution.state, curve.name, curve.span, solution.kappa, solution.vectors, size)
