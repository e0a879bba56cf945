"""`track`: a bifurcation followed in two parameters, an extremum along a curve of them in a third.

From a point of codimension two onto the other curve of bifurcations that passes through it, or begins there.

Where two curves cross (LPPD, LPNS, PDNS, NSNS) the point lies on both. At R1 and R2 Neimark-Sacker points begin on a
curve of LP or PD: with g of `bifurcation.bordered` as a function of kappa, and k its distance from 0 or w0/2,

    g = g_0 + i k g_1 + k^2 g_2 + ...,    g_i real,

so that the equations of an NS, `Re g = 0` and `Im g / k = 0`, are smooth in k^2 and hold at k^2 = 0 where g_0 = g_1 =
0: at R1, R2. The curve is entered at a small k, held fixed. On its other side, k^2 < 0, are neutral saddles, two real
multipliers with product one, which bifurcate nowhere: no k is theirs, and the side need not be chosen.

At a GPD the motions of twice the period change sides. On one side of it the doubled branch turns back close to its
birth, and these limit points are a curve that ends at the GPD, tangent to the curve of period doublings. Along it the
parameters and the even part of the motion change with the square of the doubled part, which leaves along the null
vector of J_half: the curve is entered where that part has a given small size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.options import Inherited, TrackOptions, check_inside, options_of, settings_of
from suboctave.arguments import Range
from suboctave.bifurcation.bifurcation import CURVES_THROUGH, Bifurcation, TrackedEvent, kind_of
from suboctave.bifurcation.bordered import null_vectors, transversality
from suboctave.continuation import CurvePoint, NewtonOptions, SteppingOptions
from suboctave.continuation.linear import length, one_thread
from suboctave.continuation.newton import correct
from suboctave.continuation.notes import Note
from suboctave.continuation.point import point_ahead
from suboctave.curves.events.formulation import BorderedSystem
from suboctave.curves.junction import repeats_earlier
from suboctave.curves.kinds.nonlinear_mode import NonlinearMode, of_modes
from suboctave.curves.kinds.singular import SingularOperator
from suboctave.curves.motion import MotionEvaluation, MotionProblem
from suboctave.curves.starts import check_unknowns, harmonics_of, rule_of
from suboctave.curves.trace import BranchPoint, Settings, Trace
from suboctave.curves.tracked.follow import follow_tracked
from suboctave.curves.tracked.start import (
    Ranges,
    curve_through,
    inside,
    is_extremum,
    on_free_phase,
    on_mode,
    solved_start,
)
from suboctave.errors import ConvergenceError, InputError, is_number, shortened, suggest
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.kinds import KINDS, MOTION_KINDS, TRACKED_KINDS
from suboctave.model.inputs import check_bounds, check_parameter, check_range, observed_dof, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.progress import reporting
from suboctave.results.branch import TrackedBranch
from suboctave.results.modes import tracked_class

#: a curve of bifurcations is drawn by its points, and those in its turns cost little
_STEPPING = SteppingOptions(angle=0.15, growth=4.0)
#: what a curve of multiple bifurcations says
_MULTIPLE = Note("extrema are located along multiple bifurcations, points of codimension two are not")


@with_options(TrackOptions)
@timed
def track(
    bifurcation: Bifurcation | BranchPoint,
    parameter: str | Sequence[str],
    bounds: Range | Sequence[Range],
    *,
    omega: Range | None = None,
    onto: str | Mapping[str, Any] | None = None,
    harmonics: int | str | AdaptiveHarmonics | None = None,
    **options: Unpack[TrackOptions],
) -> TrackedBranch:
    """The curve of a bifurcation in two parameters, in both directions, from end to end or closed.

    Of an extremum along such a curve (one of its `extrema`): the curve of these extrema in a third parameter.

    Parameters
    ----------
    bifurcation
        A located LP, BP, PD, NS or grazing of any branch (of motions of one or several load periods); a Hopf point of
        equilibria; an LP, PD or NS of limit cycles; an LP, BP, PD or extremum of omega of a nonlinear mode; one of the
        `extrema` of a tracked curve; or one of its points of codimension two through which another curve passes, or
        from which one begins (GPD, R1, R2, LPPD, LPNS, PDNS, NSNS). With `onto` a kind of motions also a user's event
        or a point of a branch, one of its `points`, beside the curve.
    parameter
        The second parameter, omega being the first; or two names, with omega kept. Of an extremum the third one.
    bounds
        Its range (from, to); or two ranges. A bifurcation on a bound counts as inside. Named parameters of an
        extremum's curve keep their ranges, one that is extreme with as much again on both sides.
    omega
        Range of omega, rad per unit time; default: not bounded.
    onto
        From a point of codimension two: the kind of the curve to follow. Default: that on which it was not found, the
        Neimark-Sacker points that begin in an R1 or R2 of a curve of LP or PD, the LP or PD through that of an NS.
        From any motion: a kind of motions that is located nowhere, by its name or as a mapping with its `name` and what
        chooses the curve.
    harmonics
        As in `frequency_response`; default: as the bifurcation was computed.

    Scaled arclength has each parameter in units of its range (omega without one in units of its value at the start).
    Default of `stepping`: `SteppingOptions(angle=0.15, growth=4)`. The formulation "extended" has the null vector among
    the unknowns, "alcorta2019" is the published system of period doublings. A branch point can be followed only where
    a symmetry forces it.

    Returns
    -------
    TrackedBranch
        With `extrema` (where either parameter turns) and, in `bifurcations`, points of codimension two as well: CP
        (cusp), GPD, GPF, GH (generalised period doubling, pitchfork, Hopf), R1, R2, R3, R4 (resonances), LPPD, LPNS,
        PDNS, NSNS (fold-flip, fold-, flip- and double Neimark-Sacker). Along multiple bifurcations, those of symmetric
        systems that fall together, extrema only.

    Raises
    ------
    InputError
        Wrong input, before any work.
    ConvergenceError
        If the bifurcation given is not found again, or nothing of the kind wanted beside it.
    """
    item, through = begun(bifurcation, onto, options.get("observe"))
    turning = item.parameter_name if is_extremum(item) else ""
    further = is_extremum(item) or on_free_phase(item) or on_mode(item)
    names, given = (_third if further else _free)(item, parameter, bounds, omega)
    ranges = {name: (min(ends), max(ends)) for name, ends in given.items()}
    kind = curve_onto(item, through)
    settings = _settings(item, turning, options)
    wanted, adaptive, basis = _harmonics(item, harmonics)
    with one_thread(), reporting(options.get("progress"), f"{kind} over {names[-1]}") as report:
        settings = settings.reporting_to(report, ranges[names[-1]], "event")
        if item.kind in CURVES_THROUGH:
            assert isinstance(item, TrackedEvent)
            item = start_onto(item, kind, names, ranges, settings.newton)
            wanted, adaptive, basis = _harmonics(item, harmonics)
        start = solved_start(item, basis, adaptive, names, ranges, settings)
        if item.kind in CURVES_THROUGH:
            start = aside(start, ranges, settings.newton)
        first, last = given[names[-1]]
        trace = _both_ways(start, ranges, math.copysign(1.0, last - first), settings)
    if item.multiplicity > 1:
        trace.notes.append(_MULTIPLE)
    kept = options_of(settings, wanted, given)
    return _branch(item, names, turning, trace, settings, kept)


def _settings(item: Bifurcation, turning: str, options: TrackOptions) -> Settings:
    """The options, checked, with those of curves of bifurcations as defaults."""
    if item.kind == "LP" and repeats_earlier(item.orbit):
        raise InputError(
            f"this limit point is written with {item.orbit.basis.nu} load periods but repeats earlier, so that its "
            "curve is that of the period doublings. Track the PD, or a limit point of the branch from switch_branch"
        )
    given = {name: value for name, value in options.items() if value is not None}
    default = {"stepping": _STEPPING, "observe": Inherited(item).observe}
    settings = settings_of(item.orbit.system, {**default, **given})
    if turning and not isinstance(settings.formulation, BorderedSystem):
        raise InputError(
            f"curves of extrema are followed by the bordered system, not {settings.formulation.name!r}: leave "
            "formulation= out; locate_extremum solves for a single one by the published system"
        )
    return settings


def _branch(
    item: Bifurcation, names: tuple[str, ...], turning: str, trace: Trace, settings: Settings, options: dict[str, Any]
) -> TrackedBranch:
    """The curve that begins at a bifurcation, with how it was computed."""
    system, kind = item.orbit.system, kind_of(item)
    known, own = item.context or {}, ["damped", "mode", "still", *(["onto"] if kind in MOTION_KINDS else [])]
    options = {**options, **{name: known[name] for name in own if name in known}}
    if item.multiplicity > 1:
        options["multiplicity"] = item.multiplicity
    context = {"system": system, "parameter": names[-1], **options}
    met = [replace(event, context=context) for event in trace.bifurcations]
    return tracked_class(options)(
        kind, names, system, names[-1], trace.points, met, [], trace.closed, trace.endings, settings.observe, options,
        tuple(trace.open_questions), turning=turning,
    )  # fmt: skip


def _third(item: TrackedEvent, parameter: Any, bounds: Any, omega: Any) -> tuple[tuple[str, ...], dict[str, Range]]:
    """The three parameters in which an extremum is followed and the ranges that they have, checked: named ones of the
    extremum's curve keep theirs.
    """
    system = item.orbit.system
    if len(item.names) > 2:
        raise InputError(
            f"this {item.kind} lies on a curve in {', '.join(item.names)}: only those along curves in two parameters "
            "can be followed in another one"
        )
    if not isinstance(parameter, str):
        raise InputError(f"this {item.kind} is followed in one more parameter: give its name, not {parameter!r}")
    check_parameter(system, parameter)
    if parameter in item.names:
        raise InputError(f"{parameter} is free on the curve of this {item.kind} already: name another parameter")
    if omega is not None and item.names[0] != "omega":
        raise InputError("omega= bounds omega where it is free, which it is not on the curve of this point")
    # a parameter of the extremum's curve keeps its range; if it is extreme, with as much again on both sides. That of
    # omega is often no more than where bifurcations were looked for
    kept: dict[str, Range] = {}
    for name in item.names:
        known = Inherited(item).range(name)
        if known is not None and name != "omega":
            low, high = sorted(known)
            more = high - low if item.extreme and name == item.parameter_name else 0.0
            kept[name] = low - more, high + more
    ranges = _ranges(system, omega, kept, parameter, bounds)
    for name in (item.names[0], parameter):
        if name in ranges:
            check_inside("the bifurcation", name, item.parameter(name), ranges[name], 1e-9)
    return (*item.names, parameter), ranges


def _ranges(system: System, omega: Any, kept: Mapping[str, Range], parameter: str, bounds: Any) -> dict[str, Range]:
    own = {} if omega is None else {"omega": check_range("omega", omega, positive=True)}
    return {**own, **kept, parameter: check_bounds(system, parameter, bounds)}


def _free(item: Bifurcation, parameter: Any, bounds: Any, omega: Any) -> tuple[tuple[str, ...], dict[str, Range]]:
    """The two free parameters and the ranges that they have, checked."""
    if not isinstance(item, Bifurcation):
        raise InputError(
            f"track starts from a located bifurcation, not {type(item).__name__}: one of the .bifurcations of a branch"
        )
    if item.kind not in (*TRACKED_KINDS, *MOTION_KINDS, *CURVES_THROUGH):
        raise InputError(
            f"track follows {', '.join(TRACKED_KINDS)} and extrema along their curves, and other curves from "
            f"{', '.join(CURVES_THROUGH)}; this is a {item.kind}"
        )
    system, known = item.orbit.system, Inherited(item)
    if isinstance(parameter, str) and "still" in known.known:
        # an equilibrium has no omega
        own = next((name for name in reversed(item.free_names) if name != parameter), item.parameter_name)
        parameter, bounds = (own, parameter), (known.bounds(own), bounds)
    if isinstance(parameter, str):
        names: tuple[str, ...] = ("omega", parameter)
        if parameter == "omega":
            raise InputError("omega is free already: parameter= names the second one, omega=(from, to) bounds omega")
        check_parameter(system, parameter)
        ranges = _ranges(system, omega, {}, parameter, bounds)
    else:
        both = tuple(parameter) if isinstance(parameter, Sequence) else ()
        if len(both) != 2 or not all(isinstance(name, str) for name in both) or both[0] == both[1]:
            raise InputError(f"parameter must be a name or two different names, not {parameter!r}")
        names = both
        for name in names:
            check_parameter(system, name)
        single = not isinstance(bounds, Sequence) or len(bounds) != 2 or any(is_number(b) for b in bounds)
        if "omega" in names and single:
            (other,) = (name for name in names if name != "omega")
            raise InputError(
                f"omega is free anyway: write parameter={other!r} with bounds=(from, to), and omega=(from, to) to "
                f"bound omega; or two ranges, parameter=('omega', {other!r}) with bounds=((from, to), (from, to)), not "
                f"{shortened(bounds)}"
            )
        if names[1] == "omega":
            raise InputError(f"write omega first, in parameter=('omega', {names[0]!r}) and in bounds")
        if omega is not None:
            raise InputError("with two parameters named their ranges are in bounds: leave omega= out")
        if single:
            raise InputError(f"bounds of two parameters are two ranges, ((from, to), (from, to)), not {bounds!r}")
        ranges = {name: check_bounds(system, name, r) for name, r in zip(names, bounds, strict=True)}
    for name, ends in ranges.items():
        check_inside("the bifurcation", name, item.parameter(name), ends, 1e-9)
    return names, ranges


def _harmonics(item: Bifurcation, given: Any) -> tuple[Any, AdaptiveHarmonics | None, HarmonicBasis]:
    """Harmonics wanted, the rule for them, and the basis that tracking begins with; by default as those of a start."""
    orbit = item.orbit
    wanted = harmonics_of(orbit) if given is None else given
    rule, basis = rule_of(wanted), orbit.basis
    adaptive = rule if isinstance(rule, AdaptiveHarmonics) else None
    if isinstance(rule, int):
        basis = HarmonicBasis(rule * basis.nu, basis.nu)
    check_unknowns(orbit.balance.size, basis)
    return wanted, adaptive, basis


def _both_ways(start: CurvePoint, ranges: Ranges, ahead: float, settings: Settings) -> Trace:
    """Follow a curve from a start to both sides; from a bound inwards only."""
    if start.tangent[-1] * ahead < 0.0:
        start = start.turned
    ways = [_leads_inside(point, ranges) for point in (start, start.turned)]
    if not any(ways):
        raise InputError("the curve leaves the ranges at its start in both directions: widen them")
    forward = follow_tracked(start, ranges, settings) if ways[0] else None
    if forward is not None and (forward.closed or forward.interrupted or not ways[1]):
        return forward
    back = follow_tracked(start.turned, ranges, settings)
    # closed the other way it is the whole curve, wherever this way came to an end
    return back if forward is None or back.closed else back.reversed_before(forward)


def _leads_inside(point: CurvePoint, ranges: Ranges) -> bool:
    """Whether a curve that begins at a point stays within its ranges there."""
    assert isinstance(point.curve, MotionProblem)
    for name, (low, high) in ranges.items():
        index = point.curve.index(name)
        value, slope = point.u[index], point.tangent[index]
        slack = 1e-9 * (high - low)
        if (value >= high - slack and slope > 0.0) or (value <= low + slack and slope < 0.0):
            return False
    return True


#: distances of kappa from 0 or w0/2, in units of w0, at which Neimark-Sacker points are looked for beside a resonance
_SHARES = (0.02, 0.01, 0.03, 0.005, 0.0025)
#: the farthest that they lie from it, in scaled arclength, and their multipliers from the unit circle
_NEAR, _CRITICAL = 0.2, 0.02
#: component of the parameters' forces along the left null vector below which there is none
_FORCED = 1e-6
#: way along a curve from a point of codimension two, in scaled arclength, from which it is met like any other
_ASIDE = 2e-3
#: sizes of the doubled part, in scaled arclength, at which limit points are looked for first beside a GPD, and that
#: which is far enough from it
_DOUBLED, _CLEAR = (3e-3, 1e-3, 3e-4), 0.05


def motion_kind(onto: Any) -> tuple[str, dict[str, float]] | None:
    """The kind of motions that `onto` names, with the numbers that choose among its curves; None where it names none.
    InputError for a kind or a number that there is not.
    """
    given = dict(onto) if isinstance(onto, Mapping) else {"name": onto}
    name = given.pop("name", None)
    choices = KINDS[name].choices if name in MOTION_KINDS else None
    if name == NonlinearMode.name:
        raise InputError("a nonlinear mode is a curve over omega alone: so.nonlinear_mode follows it")
    if choices is None:
        if isinstance(onto, Mapping):
            raise InputError(f"onto= has no kind of motions {name!r}{suggest(str(name), MOTION_KINDS)}")
        return None
    for key, number in given.items():
        if key not in choices:
            raise InputError(f"{name} has no {key!r}{suggest(str(key), choices)}")
        if not (is_number(number) and number > 0.0):
            raise InputError(f"{key} of {name} must be a positive number, not {shortened(number)}")
    return name, {**choices, **given}


def begun(start: Any, onto: Any, observe: int | str | None) -> tuple[Any, str | None]:
    """What a curve begins at, and the kind that is chosen of those through it: a motion as a point of its own curve."""
    kind = motion_kind(onto)
    if kind is None:
        return start, onto
    if not isinstance(start, Bifurcation | BranchPoint):
        raise InputError(
            f"a curve of {kind[0]} begins at a point of a branch or at a located one, not {type(start).__name__}"
        )
    known = start.context or {} if isinstance(start, Bifurcation) else {}
    orbit = start.orbit
    dof = next((d for d in (observe, known.get("observe")) if d is not None), None)
    dof = observed_dof(orbit.system, dof)
    context = {**known, "observe": dof, "onto": {"name": kind[0], **kind[1]}}
    floquet, size = start.floquet, orbit.amplitude(dof)
    return Bifurcation(kind[0], orbit, floquet, orbit.residual, size, "omega", context=context), None


def curve_onto(item: Bifurcation, onto: str | None) -> str:
    """Kind of the curve that is followed from a point of codimension two; default: the one that it was not found on.
    InputError where it lies on no such curve.
    """
    if item.kind not in CURVES_THROUGH or not isinstance(item, TrackedEvent):
        if onto is not None:
            raise InputError(
                f"onto= chooses between the curves through a point of codimension two ({', '.join(CURVES_THROUGH)}); "
                f"this is a {item.kind}: leave it out"
            )
        return item.kind
    family = "nonlinear modes" if of_modes(item) else "limit cycles" if len(item.names) > 2 else ""
    if family and not item.turning:
        raise InputError(
            f"this {item.kind} is one of {family}: no curve is entered from it; track begins at the other "
            "bifurcation where it is located along them"
        )
    if item.turning:
        raise InputError(
            f"this {item.kind} lies on a curve of extrema in {', '.join(item.names)}: other curves are entered from "
            "points of curves in two parameters"
        )
    kinds = CURVES_THROUGH[item.kind]
    if onto is None:
        # branch points of a symmetry are on the place of limit points
        found = "LP" if item.curve == "BP" else item.curve
        return next((kind for kind in kinds if kind != found), kinds[0])
    if onto not in kinds:
        raise InputError(
            f"onto={onto!r}: the curves through a {item.kind} are {' and '.join(kinds)}{suggest(onto, kinds)}"
        )
    return onto


def start_onto(
    item: TrackedEvent, kind: str, names: tuple[str, ...], ranges: Ranges, newton: NewtonOptions
) -> Bifurcation:
    """A bifurcation of a kind at a point of codimension two, or beside it where its curve begins there; InputError if
    the curve lies outside the ranges, ConvergenceError where nothing of that kind is found.
    """
    if item.kind == "GPD" and kind == "LP":
        return _beside_doubling(item, names, ranges, newton)
    if kind == "LP" and _symmetric(item, names):
        kind = "BP"
    if kind != "NS":
        return replace(item, curve=kind, kappa=0.0)
    if item.kind in ("R1", "R2"):
        return _beside_resonance(item, names, ranges, newton)
    return replace(item, curve=kind, kappa=_frequency(item))


def _symmetric(item: TrackedEvent, names: tuple[str, ...]) -> bool:
    """Whether no parameter moves the multiplier +1: it belongs to branch points that a symmetry forces.

    The equations of a limit point hold there, too, but are singular.
    """
    state = item.orbit.state()
    vectors = null_vectors(state, Kind.INTEGER)
    return all(transversality(state, vectors, name) <= _FORCED for name in names)


def aside(start: CurvePoint, ranges: Ranges, newton: NewtonOptions) -> CurvePoint:
    """A start a little beside a point of codimension two, which the curve then passes; the start where none is found.

    Tests vanish at the point itself, and do not tell there that they change sign.
    """
    for way in (_ASIDE, -_ASIDE):
        try:
            point = replace(point_ahead(start, way, newton), arclength=0.0)
        except ConvergenceError:
            continue
        assert isinstance(point.curve, MotionProblem)
        if inside(point.curve.named(point.u), ranges):
            return point
    return start


def _frequency(item: TrackedEvent) -> float:
    """kappa of the pair on the unit circle; at an NSNS of the pair that its curve does not follow. ConvergenceError if
    there is none.
    """
    if item.curve == "NS" and item.kind != "NSNS":
        return item.kappa
    mu = item.multipliers
    if item.curve == "NS":
        critical = item.critical_multiplier()
        apart = np.minimum(np.abs(mu - critical), np.abs(mu - np.conj(critical)))
        mu = np.delete(mu, np.argsort(apart)[:2])  # both of the pair that the curve follows
    pairs = mu[mu.imag > 1e-9 * np.abs(mu)]
    if not pairs.size:
        raise ConvergenceError(f"this {item.kind} has no complex pair of multipliers")
    pair = min(pairs, key=lambda m: abs(abs(m) - 1.0))
    return float(np.angle(pair)) / item.orbit.period


def _beside_resonance(item: TrackedEvent, names: tuple[str, ...], ranges: Ranges, newton: NewtonOptions) -> Bifurcation:
    """A Neimark-Sacker point close to a 1:1 or 1:2 resonance."""
    orbit = item.orbit
    rate = orbit.omega / orbit.basis.nu
    outside, reason = False, "they lie elsewhere, or more harmonics are needed"
    for share in _SHARES:
        kappa = (share if item.kind == "R1" else 0.5 - share) * rate
        beside = replace(item, curve="NS", kappa=kappa)
        try:
            curve, u = curve_through(beside, orbit.basis, names, ranges)
            weights = curve.weights(u, 0.0)
            solved = correct(curve, u, curve.balance.dimension, weights, newton)
        except ConvergenceError as failure:
            reason = str(failure)
            continue
        evaluation = solved.evaluation
        assert isinstance(evaluation, MotionEvaluation)
        if length(weights * (solved.u - u)) > _NEAR or evaluation.doubt > _CRITICAL:
            continue
        if inside(curve.named(solved.u), ranges):
            return replace(beside, orbit=_moved(orbit, evaluation.state))
        outside = True
    at = " and ".join(f"{name} = {item.parameter(name):.6g}" for name in item.names)
    if outside:
        raise InputError(
            f"the Neimark-Sacker points that begin in the {item.kind} at {at} lie outside the ranges: widen them"
        )
    raise ConvergenceError(f"no Neimark-Sacker points were found beside the {item.kind} at {at}: {reason}")


def _beside_doubling(item: TrackedEvent, names: tuple[str, ...], ranges: Ranges, newton: NewtonOptions) -> Bifurcation:
    """A limit point of the doubled motions close to a GPD."""
    orbit = item.orbit
    curve, u = curve_through(replace(item, curve="LP"), orbit.basis.doubled, names, ranges)
    weights, operator = curve.weights(u, 0.0), curve.augmentation
    assert isinstance(operator, SingularOperator)
    away = curve.join(operator.borders.right * curve.balance.row_weights(curve.balance.dimension), 0.0)
    away /= length(weights * away)
    for size in _DOUBLED:
        # the rest of the motion and the parameters follow the square of the doubled part
        beside, bend = None, np.zeros_like(u)
        while size < _CLEAR:
            try:
                solved = correct(curve, u + size * away + size**2 * bend, weights * away, weights, newton)
            except ConvergenceError:
                break
            evaluation = solved.evaluation
            assert isinstance(evaluation, MotionEvaluation)
            if evaluation.doubt > _CRITICAL or not inside(curve.named(solved.u), ranges):
                break
            beside = replace(item, curve="LP", orbit=_moved(orbit, evaluation.state))
            bend, size = (solved.u - u - size * away) / size**2, 2.0 * size
        if beside is not None:
            return beside
    at = " and ".join(f"{name} = {item.parameter(name):.6g}" for name in names)
    raise ConvergenceError(f"no limit point of the doubled motions was found beside the GPD at {at} in the ranges")


def _moved(orbit: PeriodicOrbit, state: BalanceState) -> PeriodicOrbit:
    """Another motion in the place of one."""
    values = dict(state.values)
    return replace(orbit, balance=state.balance, x=state.x.copy(), omega=state.omega, values=values)
