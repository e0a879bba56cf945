"""`track`: a bifurcation followed in two parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from suboctave.analysis.checks import check_bounds, check_parameter, check_range, is_number, make_settings
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.trace import Settings
from suboctave.analysis.track_follow import Box, TrackedTrace, follow_tracked
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.analysis.tracked_curve import TrackedCurve
from suboctave.analysis.tracked_sample import null_row
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.augmented import (
    Augmentation,
    BranchPointUnfolded,
    GrazingContactEquations,
    SingularOperator,
)
from suboctave.bifurcation.augmented_extended import ExtendedOperator, PublishedDoubling
from suboctave.bifurcation.formulation import Alcorta2019, ExtendedSystem, Formulation, written
from suboctave.bifurcation.gaps import levels
from suboctave.bifurcation.tracked import TRACKED_KINDS
from suboctave.compiled import computation_begins
from suboctave.continuation import CurvePoint, NewtonOptions, SteppingOptions
from suboctave.continuation.linear import one_thread
from suboctave.continuation.march import make_point
from suboctave.continuation.newton import correct
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.selection import AdaptiveHarmonics
from suboctave.harmonic.state import BalanceState
from suboctave.stability import StabilityMethod

_OPERATORS = {"LP": Kind.INTEGER, "PD": Kind.HALF, "NS": Kind.FREE}
#: a start moves at most this far from the bifurcation given, in units of the parameters' spans and of the motion
_NEAR = 0.05

Range = tuple[float, float]


@timed
def track(
    bifurcation: Bifurcation,
    parameter: str | Sequence[str],
    bounds: Sequence[Any],
    *,
    omega: Range | None = None,
    harmonics: int | str | AdaptiveHarmonics | None = None,
    max_step: float | None = None,
    observe: int | None = None,
    progress: Any = None,
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
    stability: StabilityMethod | str | None = None,
    formulation: Formulation | str | None = None,
) -> TrackedBranch:
    """The curve of a bifurcation in two parameters, in both directions, from end to end or closed.

    Parameters
    ----------
    bifurcation
        A located LP, BP, PD, NS or grazing of any branch (of motions of one or several load periods).
    parameter
        The second parameter, omega being the first; or two names, with omega kept.
    bounds
        Its range (from, to); or two ranges. A bifurcation on a bound counts as inside.
    omega
        Range of omega, rad per unit time; default: not bounded.
    harmonics
        As in `frequency_response`; default: as the bifurcation was computed.
    max_step
        Largest distance between neighbours in scaled arclength: each parameter in units of its range (omega without a
        range in units of its value at the start), the motion in units of its own size.

    formulation
        As in `frequency_response`: with "extended" the null vector is among the unknowns, with "alcorta2019" period
        doublings are those of the published system.

    Other parameters as `frequency_response`.

    Returns
    -------
    TrackedBranch
        With `extrema` (where either parameter turns) and, in `bifurcations`, points of codimension two as well: CP
        (cusp), R1, R2, R3, R4 (resonances), LPPD (fold-flip).

    Raises
    ------
    InputError
        Wrong input, before any work.
    ConvergenceError
        If the bifurcation given is not found again.

    Notes
    -----
    Minimally augmented systems (`bifurcation.augmented`) and pseudo-arclength. A branch point can be followed only
    where a symmetry forces it; the curve ends where that is broken.
    """
    names, ranges = _free(bifurcation, parameter, bounds, omega)
    orbit = bifurcation.orbit
    system = orbit.system
    settings = make_settings(
        system, max_step, _observed(bifurcation, observe), (), newton, stepping, stability, formulation
    )
    basis = orbit.basis
    wanted = harmonics if harmonics is not None else orbit.adaptive or max(1, basis.harmonics // basis.nu)
    adaptive, basis = _discretisation(basis, wanted)
    second = ranges[1]
    assert second is not None
    ends = (min(second), max(second))
    first = None if ranges[0] is None else (min(ranges[0]), max(ranges[0]))
    box = Box(first, ends)
    computation_begins()
    with one_thread(), reporting(progress, f"{bifurcation.kind} over {names[1]}") as report:
        settings = replace(settings, report=report)
        balance = HarmonicBalance(system, basis, linear=_linear_part(bifurcation))
        start = _start(bifurcation, balance, adaptive, names, box, settings)
        trace = _both_ways(start, box, math.copysign(1.0, second[1] - second[0]), settings)
    options = {
        "bounds": {name: r for name, r in zip(names, ranges, strict=True) if r is not None},
        "harmonics": asdict(wanted) if isinstance(wanted, AdaptiveHarmonics) else wanted,
        "newton": asdict(settings.newton),
        "stepping": asdict(settings.stepping),
        "stability": settings.stability.name,
        "formulation": written(settings.formulation),
        "observe": settings.observe,
    }
    context = {"system": system, "parameter": names[1], **options}
    return TrackedBranch(
        bifurcation.kind,
        names,
        system,
        names[1],
        trace.points,
        [replace(event, context=context) for event in trace.events],
        [],
        trace.closed,
        trace.ended,
        settings.observe,
        options,
        tuple(trace.warnings),
    )


def _free(
    item: Bifurcation, parameter: Any, bounds: Any, omega: Any
) -> tuple[tuple[str, str], tuple[Range | None, Range | None]]:
    """The two free parameters and their ranges, checked."""
    if not isinstance(item, Bifurcation):
        raise InputError(
            f"track starts from a located bifurcation, not {type(item).__name__}: one of the .bifurcations of a branch"
        )
    if item.kind not in TRACKED_KINDS:
        raise InputError(f"track follows {', '.join(TRACKED_KINDS)}; this is a {item.kind}")
    system = item.orbit.system
    if isinstance(parameter, str):
        names: tuple[str, str] = ("omega", parameter)
        if parameter == "omega":
            raise InputError("omega is free already: parameter= names the second one, omega=(from, to) bounds omega")
        check_parameter(system, parameter)
        second = check_bounds(system, parameter, bounds)
        first = None if omega is None else check_range("omega", omega, positive=True)
    else:
        both = tuple(parameter) if isinstance(parameter, Sequence) else ()
        if len(both) != 2 or not all(isinstance(name, str) for name in both) or both[0] == both[1]:
            raise InputError(f"parameter must be a name or two different names, not {parameter!r}")
        names = (both[0], both[1])
        for name in names:
            check_parameter(system, name)
        if names[1] == "omega":
            raise InputError(f"write omega first: parameter=('omega', {names[0]!r})")
        if omega is not None:
            raise InputError("with two parameters named their ranges are in bounds: leave omega= out")
        if not isinstance(bounds, Sequence) or len(bounds) != 2 or any(is_number(b) for b in bounds):
            raise InputError(f"bounds of two parameters are two ranges, ((from, to), (from, to)), not {bounds!r}")
        first, second = (check_bounds(system, name, r) for name, r in zip(names, bounds, strict=True))
    for name, ends in zip(names, (first, second), strict=True):
        if ends is None:
            continue
        value, (low, high) = item.parameter(name), sorted(ends)
        slack = 1e-9 * (high - low)
        if not low - slack <= value <= high + slack:
            raise InputError(f"the bifurcation has {name}={value:.6g}, outside the bounds ({low:g}, {high:g})")
    return names, (first, second)


def _observed(item: Bifurcation, observe: int | None) -> int | None:
    return item.context.get("observe") if observe is None and item.context else observe


def _discretisation(basis: HarmonicBasis, wanted: Any) -> tuple[AdaptiveHarmonics | None, HarmonicBasis]:
    if isinstance(wanted, str) and wanted == "adaptive":
        wanted = AdaptiveHarmonics()
    if isinstance(wanted, AdaptiveHarmonics):
        return wanted, basis.filled
    if isinstance(wanted, (int, np.integer)) and not isinstance(wanted, bool) and wanted >= 1:
        return None, HarmonicBasis(int(wanted) * basis.nu, basis.nu)
    raise InputError(
        f'harmonics must be a whole number of at least 1, "adaptive" or AdaptiveHarmonics(...), not {wanted!r}'
    )


def _linear_part(item: Bifurcation) -> LinearPart | None:
    """The linear part a bifurcation was solved with, at its parameters; None for its system's own matrices."""
    linear = item.orbit.balance.linear
    return None if isinstance(linear, StructuralMatrices) else linear.rebuilt(item.orbit.values)


def _augmentation(
    item: Bifurcation, state: BalanceState, names: tuple[str, str], formulation: Formulation
) -> tuple[Augmentation, np.ndarray]:
    """What singles the bifurcation out, and the start of its extra unknowns."""
    if item.kind == "grazing":
        assert item.contact is not None
        places = np.array(levels(state.local(item.contact.element)))
        index = int(np.argmin(np.abs(places - item.contact.gap)))
        tau = item.contact.time * state.rate
        return GrazingContactEquations.of(state, item.contact.element, index), np.array([tau])
    if item.kind == "BP":
        return BranchPointUnfolded.of(state, names[0]), np.zeros(1)
    kind = _OPERATORS[item.kind]
    extra = np.zeros(0)
    if kind is Kind.FREE:
        kappa = item.kappa or float(np.angle(item.critical_multiplier())) * state.rate / (2.0 * np.pi)
        extra = np.array([kappa])
    kappa = float(extra.sum())
    if isinstance(formulation, Alcorta2019) and kind is Kind.HALF:
        return PublishedDoubling.started(state, names), extra
    if isinstance(formulation, ExtendedSystem) or (isinstance(formulation, Alcorta2019) and kind is Kind.INTEGER):
        return ExtendedOperator.started(state, kind, kappa)
    return SingularOperator.of(state, kind, kappa), extra


def _start(
    item: Bifurcation,
    balance: HarmonicBalance,
    adaptive: AdaptiveHarmonics | None,
    names: tuple[str, str],
    box: Box,
    settings: Settings,
) -> CurvePoint:
    """The bifurcation solved again as a point of the curve, in a basis that suits it."""
    orbit = item.orbit
    x = orbit.basis.resized(orbit.coefficients, balance.basis)
    balance = balance.settle(x, orbit.omega)
    state = balance.at(x, orbit.omega)
    augmentation, extra = _augmentation(item, state, names, settings.formulation)
    values = np.array([item.parameter(name) for name in names])
    for i, ends in enumerate((box.first, box.second)):
        if ends is not None:
            values[i] = min(ends[1], max(ends[0], values[i]))
    first = abs(values[0]) or 1.0
    if box.first is not None:
        first = box.first[1] - box.first[0]
    spans = (first, box.second[1] - box.second[0])
    force = state.force_scale()
    floor = 0.0 if force > 0.0 else 1e-8 * orbit.omega**2
    curve = TrackedCurve(
        balance,
        augmentation,
        names,
        spans,
        orbit.omega,
        adaptive,
        # between what a response curve needs and what a located event does
        0.0 if adaptive is None else math.sqrt(adaptive.tolerance * adaptive.event_tolerance),
        max(force, floor),
        floor,
        {balance.basis: balance},
    )
    u = curve.join(x, extra, values)
    begin = u
    origin = curve
    try:
        for _ in range(8):
            weights = curve.weights(u, 0.0)
            row = null_row(curve, u, weights)
            if abs(row[-1]) > 1e-2:
                row = np.eye(1, len(row), len(row) - 1)[0]
            solved = correct(curve, u, row, weights, settings.newton)
            adapted = curve.adapted(solved.u, solved.evaluation)
            same = adapted.balance.basis == curve.balance.basis and adapted.balance.samples == curve.balance.samples
            if same:
                break
            u, curve = adapted.transfer(solved.u, curve), adapted
        moved = weights * (solved.u - curve.transfer(begin, origin))
        if float(np.linalg.norm(moved)) > _NEAR:
            raise ConvergenceError(f"what was found lies elsewhere, at {curve.where(solved.u)}")
        return make_point(solved, curve, None, 0.0)
    except ConvergenceError as failure:
        raise ConvergenceError(f"the {item.kind} at {curve.where(begin)} was not found again: {failure}") from None


def _both_ways(start: CurvePoint, box: Box, ahead: float, settings: Settings) -> TrackedTrace:
    """Follow a curve from a start to both sides; from a bound inwards only."""
    if start.tangent[-1] * ahead < 0.0:
        start = replace(start, tangent=-start.tangent, orientation=-start.orientation)
    turned = replace(start, tangent=-start.tangent, orientation=-start.orientation)
    ways = [_leads_inside(point, box) for point in (start, turned)]
    if not any(ways):
        raise InputError("the curve leaves the ranges at its start in both directions: widen them")
    forward = follow_tracked(start, box, settings) if ways[0] else None
    if forward is not None and (forward.closed or forward.interrupted or not ways[1]):
        return forward
    back = follow_tracked(turned, box, settings)
    if forward is not None:
        return back.reversed_before(forward)
    return back


def _leads_inside(point: CurvePoint, box: Box) -> bool:
    """Whether a curve that begins at a point stays within its ranges there."""
    for index, ends in ((-2, box.first), (-1, box.second)):
        if ends is None:
            continue
        low, high = ends
        value, slope = point.u[index], point.tangent[index]
        slack = 1e-9 * (high - low)
        if (value >= high - slack and slope > 0.0) or (value <= low + slack and slope < 0.0):
            return False
    return True


__all__ = ["track"]
