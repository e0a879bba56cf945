"""Limit cycles: oscillations that a system keeps going by itself, from a Hopf point or from any of them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.equilibria import check_undriven
from suboctave.analysis.options import Inherited, TrackOptions
from suboctave.analysis.track import track
from suboctave.arguments import Range
from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation.linear import length
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.curves.hopf import shape_of
from suboctave.curves.kinds.multiple import MultiplePoint
from suboctave.curves.leaving import independent
from suboctave.curves.motion import MotionEvaluation
from suboctave.curves.starts import linear_up_to, own_linear_part, rule_of
from suboctave.curves.trace import BranchPoint
from suboctave.curves.tracked.start import curve_through
from suboctave.errors import ConvergenceError, InputError
from suboctave.floquet.methods import Monodromy
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.model.inputs import check_bounds, check_parameter, timed
from suboctave.options import with_options
from suboctave.results.branch import TrackedBranch

#: share by which forces must deviate from linear ones for an oscillation to count as nonlinear, and of the parameter's
#: range by which that is moved besides: its forces alone may be nonlinear
_NOTICED, _ASIDE = 0.01, 0.01
#: share of a motion that oscillates below which it stands still
_STILL = 1e-8
#: shares of that size at which the first cycle is looked for
_SIZES = (1.0, 0.3, 0.1, 0.03)
#: change of the frequency, as a share, up to which it is the oscillation that begins there
_SAME = 0.3
#: starts for each of several Hopf points that fall together; cosine of two waves beyond which they are one
_STARTS, _ONE = 12, 0.999
#: how far the second multiplier of a cycle there lies from +1, at least, as a share of the last of those that the Hopf
#: points have there. Of standing waves it is a power of the amplitude, so that nothing tells small ones apart
_TOLD = 0.2


@with_options(TrackOptions)
@timed
def limit_cycles(
    start: Bifurcation | BranchPoint | PeriodicOrbit,
    parameter: str | None = None,
    bounds: Range | None = None,
    *,
    omega: Range | None = None,
    harmonics: int | str | AdaptiveHarmonics = "adaptive",
    unloaded: bool = False,
    **options: Unpack[TrackOptions],
) -> TrackedBranch:
    """Oscillations that nothing drives, over a parameter: frequency, stability, and their bifurcations.

    Their frequency is unknown and their phase free (`suboctave.curves.kinds.limit_cycle`); one multiplier is +1. They
    end where they shrink to an equilibrium, in a Hopf point, or meet those of half the period.

    Parameters
    ----------
    start
        A "Hopf" of `equilibria`; or a motion near a cycle: an orbit, a point of a branch. From Hopf points that fall
        together, those of equal oscillators, rotating waves as a rule, from each another one.
    bounds
        Range of the parameter (from, to); from a Hopf point default that of its equilibria.
    parameter
        Its name; from a Hopf point default that along which it was found.
    omega
        Range of their frequency, rad per unit time; default: not bounded.
    harmonics
        As in `frequency_response`, of the cycle's own frequency.
    unloaded
        Leaves the oscillating loads of the system out: from a response to a small load to the cycle beside it. The
        system of the result then has a parameter `load_scale` of value 0.

    Returns
    -------
    TrackedBranch
        Of kind "limit_cycle" over (omega, parameter). Among its `bifurcations` are LP, where the parameter turns, BP,
        PD, NS, "Hopf" where it ends in one, and the extrema of omega. `track` follows LP, PD and NS in another
        parameter, `switch_branch` what leaves a PD or BP.

    Raises
    ------
    InputError
        Wrong input, before any work: also a start from an equilibrium that is no Hopf point.
    ConvergenceError
        If no cycle is found beside the start.
    """
    if not isinstance(start, Bifurcation | BranchPoint | PeriodicOrbit):
        raise InputError(
            "limit cycles begin at a Hopf point (equilibria(...).bifurcations) or at a motion, not at "
            f"{type(start).__name__}"
        )
    item = start if isinstance(start, Bifurcation) else None
    orbit = start if isinstance(start, PeriodicOrbit) else start.orbit
    if unloaded:
        orbit = _without_loads(orbit)
    check_undriven(orbit.system)
    if item is not None and item.kind != "Hopf" and "still" in (item.context or {}):
        raise InputError(f"an oscillation begins at Hopf points only: this is a {item.kind} of equilibria")
    hopf = item if item is not None and item.kind == "Hopf" else None
    if hopf is None and length(orbit.x[1:].ravel()) <= _STILL * length(orbit.x.ravel()):
        raise InputError("nothing moves there: limit cycles begin at Hopf points, or at a motion")
    if parameter is None:
        if item is None or item.parameter_name == "omega":
            raise InputError("name the parameter= over which the cycles are followed")
        parameter = item.parameter_name
    check_parameter(orbit.system, parameter)
    if bounds is None:
        if item is None:
            raise InputError(f"give bounds=(from, to) of {parameter}")
        bounds = Inherited(item).bounds(parameter)
    ends = check_bounds(orbit.system, parameter, bounds)
    if hopf is not None:
        begins = _first_cycle if hopf.multiplicity == 1 else _one_of_several
        orbit = begins(hopf, parameter, ends, harmonics)
    # multipliers are computed when asked for
    motion = BranchPoint(orbit, None, 0.0, 0, Monodromy())
    return track(motion, parameter, ends, omega=omega, onto="limit_cycle", harmonics=harmonics, **options)


def _without_loads(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """A motion as one of the system whose oscillating loads are zero."""
    system, name = orbit.system, "load_scale"
    without = system.with_scaled_loads(name).with_parameters({name: 0.0})
    balance = HarmonicBalance(without, orbit.basis, linear=own_linear_part(orbit))
    return replace(orbit, balance=balance, values={**orbit.values, name: 0.0})


def _first_cycle(hopf: Bifurcation, name: str, ends: tuple[float, float], harmonics: Any) -> PeriodicOrbit:
    """A small cycle beside a Hopf point, as large as its forces begin to be nonlinear; ConvergenceError if none is
    found.
    """
    rule = rule_of(harmonics)
    basis = HarmonicBasis(rule if isinstance(rule, int) else rule.minimum)
    low, high = min(ends), max(ends)
    state = hopf.orbit.state()
    if hopf.null_vectors is None:
        raise ConvergenceError(
            "this Hopf point is bracketed, not solved for: its cycles are unknown. Use a law that is smooth there"
        )
    vector = hopf.null_vectors.right
    shape = shape_of(vector, state.balance.size, state.balance.row_weights(len(vector)))
    unit = _noticed(state, shape, name, _ASIDE * (high - low))
    rest = replace(hopf.orbit, omega=hopf.kappa)
    reason = "they lie elsewhere"
    for share in _SIZES:
        x = hopf.orbit.x + share * unit * shape
        guess = Bifurcation(
            "limit_cycle", replace(rest, x=x), hopf.floquet, 0.0, 0.0, name, context={"observe": 0, "onto": {}}
        )
        curve, u = curve_through(guess, basis, ("omega", name), {name: (low, high)})
        weights = curve.weights(u, 0.0)
        along = curve.join(hopf.orbit.basis.resized(shape, basis), 0.0)
        row = weights * along
        try:
            solved = correct(curve, u, row / length(row), weights, NewtonOptions())
        except ConvergenceError as failure:
            reason = str(failure)
            continue
        evaluation = solved.evaluation
        assert isinstance(evaluation, MotionEvaluation)
        found = evaluation.state
        value = found.values[name]
        if abs(found.omega / hopf.kappa - 1.0) <= _SAME and low <= value <= high:
            return replace(rest, balance=found.balance, x=found.x.copy(), omega=found.omega, values=dict(found.values))
        reason = f"what was found lies at {curve.where(solved.u)}"
    raise ConvergenceError(
        f"no limit cycle was found beside the Hopf point at {name} = {hopf.parameter(name):.6g}: {reason}"
    )


def _one_of_several(hopf: Bifurcation, name: str, ends: tuple[float, float], harmonics: Any) -> PeriodicOrbit:
    """A small cycle beside one of the Hopf points that fall together, from each another if there are as many, looked
    for from starts all over the null space; ConvergenceError if none is found that is told from others.
    """
    state, m = hopf.orbit.state(), hopf.multiplicity
    own = MultiplePoint.of(state, Kind.FREE, m, name, hopf.kappa)
    equations = own.at(state, np.array([hopf.kappa]), (name,))
    basis, size = equations.solved[0], state.balance.size
    middle, scale = slice(size, 2 * size), equations.scale[size : 2 * size]
    which = int(np.argmax(np.abs(hopf.null_vectors.right.conj() @ basis)))
    found: list[tuple[float, Array | ComplexArray]] = []
    cycles: list[PeriodicOrbit] = []
    failure = None
    for start in np.random.default_rng(0).normal(size=(_STARTS * m, m, 2)) @ np.array([1.0, 1.0j]):
        try:
            vectors = equations.vectors(start / np.linalg.norm(start))
            cycle = _first_cycle(replace(hopf, null_vectors=vectors), name, ends, harmonics)
        except ConvergenceError as cause:
            failure = cause
            continue
        away = np.sort(np.abs(floquet_multipliers(cycle.state()).multipliers - 1.0))
        if away[1] < _TOLD * away[2 * m - 1]:
            continue
        wave = (cycle.x[1] - 1j * cycle.x[2]) / scale
        mix = np.asarray(np.linalg.lstsq(basis[middle], wave, rcond=None)[0])
        mix = mix / np.linalg.norm(mix)
        if all(abs(np.vdot(mix, other)) < _ONE for _, other in found):
            found.append((float(cycle.values[name] - hopf.parameter(name)) / float(np.vdot(wave, wave).real), mix))
            cycles.append(cycle)
    if not cycles:
        raise ConvergenceError(
            f"{m} Hopf points coincide at {name} = {hopf.parameter(name):.6g}, and small cycles beside them are not "
            "distinguishable. Start from a larger cycle, the orbit at the end of so.integrate"
        ) from failure
    chosen = independent(found, m)
    # with fewer cycles than Hopf points some share one
    places = [i for mix in chosen for i, (_, other) in enumerate(found) if mix is other]
    return cycles[places[min(which, len(places) - 1)]]


def _noticed(state: BalanceState, shape: Array, name: str, aside: float) -> float:
    """The size from which on an oscillation about an equilibrium is nonlinear, at a parameter or a little beside."""
    sizes = []
    for value in (state.values[name], state.values[name] + aside, state.values[name] - aside):
        rest = state.balance.at(state.x, state.omega, {**state.values, name: value})
        linear = length(rest.linear_jacobian @ shape.ravel()) + length(rest.force_jacobian @ shape.ravel())
        sizes.append(linear_up_to(rest, shape, _NOTICED * linear)[1])
    if not math.isfinite(min(sizes)):
        raise ConvergenceError("the system is linear: oscillations of any size begin at this Hopf point")
    return min(sizes)
