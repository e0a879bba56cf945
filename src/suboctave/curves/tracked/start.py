"""Where tracking begins: a bifurcation, or an extremum along a curve of them, solved again as a point of its curve."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeGuard

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent, kind_of
from suboctave.continuation import CurvePoint
from suboctave.continuation.linear import length
from suboctave.continuation.newton import null_row
from suboctave.curves.augmentation import Augmentation
from suboctave.curves.events.formulation import BORDERED, Formulation
from suboctave.curves.kinds.extremum import BorderedExtremal, LimitPointExtremal
from suboctave.curves.kinds.free_phase import FreePhaseOperator
from suboctave.curves.kinds.mode_event import MODE_EVENTS
from suboctave.curves.kinds.multiple import MultiplePoint
from suboctave.curves.kinds.nonlinear_mode import NonlinearMode, of_modes
from suboctave.curves.kinds.singular import SingularOperator
from suboctave.curves.motion import MotionProblem
from suboctave.curves.starts import own_linear_part, settled
from suboctave.curves.trace import Settings
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.kinds import KINDS, MOTION_KINDS

#: ranges of free parameters that are bounded, (low, high), by their names
Ranges = Mapping[str, tuple[float, float]]

#: a start moves at most this far from the located point, or the motion given, in units of the parameters' spans and of
#: the motion
_NEAR, _BESIDE = 0.05, 0.5
#: forces, as a share of what the parameters change them by over their ranges, up to which a motion is one at rest
_NOTHING = 1e-9


def inside(values: Mapping[str, float], ranges: Ranges) -> bool:
    """Whether values of free parameters lie within the ranges of those that are bounded."""
    return all(low <= values[name] <= high for name, (low, high) in ranges.items())


def is_extremum(item: Any) -> TypeGuard[TrackedEvent]:
    """Whether something is an extremum along a tracked curve, the ends of isolas among them."""
    return isinstance(item, TrackedEvent) and bool(item.extreme) and item.parameter_name in item.names


def on_free_phase(item: Bifurcation) -> bool:
    """Whether something is a bifurcation of motions of a free phase, which has a curve in three parameters."""
    return (
        isinstance(item, TrackedEvent)
        and item.kind in ("PD", "NS")
        and item.curve in KINDS
        and KINDS[item.curve].free_phase
    )


def on_mode(item: Bifurcation) -> bool:
    """Whether something was located along a nonlinear mode, where omega alone is free."""
    return isinstance(item, TrackedEvent) and item.curve == NonlinearMode.name and len(item.names) == 1


def _equations(item: Bifurcation, names: tuple[str, ...], formulation: Formulation) -> type[Augmentation]:
    """Those of the curve through a located point; InputError where it has none."""
    if item.multiplicity > 1 and is_extremum(item):
        raise InputError(
            f"this extremum lies on a curve of multiple {item.curve}: extrema along these are not followed in another "
            "parameter"
        )
    if item.multiplicity > 1:
        return MultiplePoint
    if on_free_phase(item) or (of_modes(item) and kind_of(item) == "PD"):
        return FreePhaseOperator
    if on_mode(item) and len(names) == 2:
        return MODE_EVENTS[item.kind]
    if of_modes(item) and is_extremum(item):
        raise InputError(
            f"this extremum lies on a curve of events of nonlinear modes in {', '.join(item.names)}: of the extrema "
            "along these, those of PD can be followed in another parameter"
        )
    return formulation.equations(kind_of(item))


def curve_through(
    item: Bifurcation,
    basis: HarmonicBasis,
    names: tuple[str, ...],
    ranges: Ranges | None = None,
    adaptive: AdaptiveHarmonics | None = None,
    formulation: Formulation = BORDERED,
) -> tuple[MotionProblem, np.ndarray]:
    """The curve of bifurcations in free parameters through one of them, and its u there, in a basis."""
    orbit = item.orbit
    widths = {**(item.context or {}).get("bounds", {})} if is_extremum(item) else {}
    widths |= ranges or {}
    ends = [widths.get(name, (0.0, item.parameter(name))) for name in names]
    spans = tuple(abs(float(high) - float(low)) or 1.0 for low, high in ends)
    equations = _equations(item, names, formulation)
    linear, x = own_linear_part(orbit), orbit.x
    if equations.reads_observed:
        linear = linear.holding(item.context["observe"])
        x = linear.read(orbit.coefficients)
    x = orbit.basis.resized(x, basis)
    balance = HarmonicBalance(orbit.system, basis, linear=linear).settle(x, orbit.omega)
    state = balance.at(x, orbit.omega)
    augmentation, extra = equations.through(item, state, names)
    force, change = state.balanced.scale, _change(state, names, spans)
    curve = MotionProblem(
        balance,
        names,
        spans,
        orbit.omega,
        adaptive,
        # between what a response curve needs and what a located event does
        0.0 if adaptive is None else math.sqrt(adaptive.tolerance * adaptive.event_tolerance),
        augmentation,
        # a motion at rest is measured by one whose masses need such forces; where there are none, by one of unit size
        reference=0.0 if force > _NOTHING * change else change / state.rate**2 or 1.0,
        unbounded=frozenset(names) - widths.keys(),
    )
    curve.force = max(force, curve.least_force(state))
    return curve, curve.join(x, np.array([item.parameter(name) for name in names]), extra)


def _change(state: BalanceState, names: tuple[str, ...], spans: tuple[float, ...]) -> float:
    """By how much forces change at a motion while parameters run over their spans, in the units of `balanced`."""
    weights = state.balance.row_weights(state.balance.dimension)
    return sum(span * length(weights * state.residual_by(name)) for name, span in zip(names, spans, strict=True))


def with_extremum(curve: MotionProblem, u: np.ndarray, turning: str) -> MotionProblem:
    """The curve with the equation of an extremum of one of its first two parameters, at one of its points."""
    extra = curve.extra(u)
    (beside,) = set(curve.names[:2]) - {turning}
    sizes = dict(zip(curve.names, curve.spans, strict=True))
    n = curve.balance.dimension
    extra_spans = 1.0 / curve.weights(u, 0.0)[n : n + len(extra)]
    state = curve.evaluate(u).state
    base = curve.augmentation.own
    augmentation: Augmentation
    if isinstance(base, SingularOperator) and base.name == "LP":
        augmentation = LimitPointExtremal(base, beside, state.balanced.scale / sizes[beside], turning)
    else:
        augmentation = BorderedExtremal.of(base, state, extra, beside, turning, sizes, extra_spans)
    return replace(curve, augmentation=augmentation)


def solved_start(
    item: Bifurcation,
    basis: HarmonicBasis,
    adaptive: AdaptiveHarmonics | None,
    names: tuple[str, ...],
    ranges: Ranges,
    settings: Settings,
) -> CurvePoint:
    """The bifurcation solved again as a point of the curve, in a basis that suits it; ConvergenceError where it is not
    found again.
    """
    curve, u = curve_through(item, basis, names, ranges, adaptive, settings.formulation)
    for name, (low, high) in ranges.items():
        u[curve.index(name)] = min(high, max(low, u[curve.index(name)]))
    if is_extremum(item) and not on_mode(item):
        curve = with_extremum(curve, u, item.parameter_name)
    anywhere = item.kind in MOTION_KINDS

    def held(curve: MotionProblem, u: np.ndarray, weights: np.ndarray) -> np.ndarray | int:
        # the last parameter keeps its value, unless the curve about stands still in it
        row = null_row(curve, u, weights)
        return curve.parameter if abs(row[-1]) > 1e-2 else row

    try:
        start = settled(curve, u, settings.newton, held=held)
        moved = length(start.weights * (start.u - start.curve.transfer(u, curve)))
        if moved > (_BESIDE if anywhere else _NEAR):
            raise ConvergenceError(f"what was found lies elsewhere, at {start.curve.where(start.u)}")
        return start
    except ConvergenceError as failure:
        where = curve.where(u)
        if anywhere:
            words = f"no {KINDS[item.kind].words} was found beside {where}: begin closer to it ({failure})"
        else:
            words = f"the {item.kind} at {where} was not found again: {failure}"
        raise ConvergenceError(words) from None
