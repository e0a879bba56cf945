"""Sub-harmonic motions that come from no period doubling: searched for by resonance, or from a state in time.

Such a motion answers a load of frequency omega mostly at `k omega / nu`, near a nonlinear resonance there: a free
vibration that continues a linear mode and whose size makes `k omega / nu` its own frequency (`free_vibrations`), k < 2
nu. Seeds are such vibrations, in several phases against the load, on top of the linear response; Newton's method
decides whether there is a motion nearby. A branch is followed from each new one, both ways.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import gcd
from typing import Any, Unpack

import numpy as np

from suboctave.analysis.free_vibrations import Backbone, backbones
from suboctave.analysis.options import CurveOptions, CurveRun, SearchOptions, settings_of
from suboctave.arguments import Count, Range, checked
from suboctave.continuation import CurvePoint, NewtonOptions
from suboctave.continuation.linear import one_thread
from suboctave.continuation.newton import correct
from suboctave.continuation.problem import Array
from suboctave.curves.follow import both_ways
from suboctave.curves.identity import lies_on, relation
from suboctave.curves.junction import period_name, subharmonic_share
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.starts import Harmonics, linear_response, make_curve, start_point
from suboctave.curves.trace import Trace
from suboctave.errors import ConvergenceError
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import Interruption, limited, pass_on
from suboctave.model.inputs import check_count, check_omega, check_range, check_system, start_state
from suboctave.model.system import System
from suboctave.options import RunOptions, with_options
from suboctave.progress import Report, Search, reporting
from suboctave.results.branch import Branch
from suboctave.timedomain import integrate

#: part of a motion at fractions of omega below which it is taken for a motion of the load's period
_SUBHARMONIC = 1e-3


@checked
@dataclass(frozen=True)
class Seeds:
    """Where sub-harmonic motions are looked for.

    frequencies
        Values of omega tried over the range.
    phases
        Phases of the sub-harmonic part against the load.
    modes
        Linear modes tried, from the lowest.
    """

    frequencies: Count = 40
    phases: Count = 3
    modes: Count = 3


def check_order(order: Any) -> int:
    """A sub-harmonic's order: a whole number of load periods, at least 2."""
    return check_count("subharmonic", order, 2)


@with_options(CurveOptions)
@limited
def find_subharmonics(
    system: System,
    omega: Range,
    *,
    subharmonic: int,
    harmonics: Harmonics = "adaptive",
    seeds: Seeds | None = None,
    linear: LinearPart | None = None,
    **options: Unpack[CurveOptions],
) -> Branches:
    """Branches of motions of `subharmonic` load periods in a range of frequencies, each once; empty if none is found.

    Isolated ones among them, which no sweep and no period doubling leads to. The search is one of resonances
    (see the module): what is far from every nonlinear resonance of the linear modes it may miss.

    Parameters
    ----------
    subharmonic
        Period of the motions in periods of the load, at least 2.
    seeds
        How finely it is looked for, a `Seeds`.

    After Ctrl-C, or a time limit, the list's `interruption` says so. Errors as of `frequency_response`.
    """
    order = check_order(subharmonic)
    ends = check_range("omega", omega, positive=True)
    check_system(system, ends)
    fine = seeds or Seeds()
    run = CurveRun(system, "omega", ends, harmonics, settings_of(system, options))
    curve = run.curve(ends[0], order, linear)
    with run.reporting(options.get("progress"), f"{period_name(order)} motions") as run:
        return Branches.of(_branches(curve, fine, run))


class Branches(list[Branch]):
    """Branches that a search has found; `interruption` says what stopped it, Ctrl-C or a time limit; None: nothing."""

    interruption: Interruption | None = None

    @classmethod
    def of(cls, search: Iterator[Branch]) -> Branches:
        """What a search finds until it ends or is interrupted. One that is interrupted empty-handed is no answer."""
        branches = cls()
        try:
            for branch in search:
                branches.append(branch)
                branches.interruption = branch.interruption
        except KeyboardInterrupt as cause:
            if not branches:
                raise
            branches.interruption = Interruption.of(cause)
        return branches


def isolated_branches(
    system: System,
    omega: Range,
    order: int,
    known: Sequence[Branch],
    harmonics: Harmonics,
    *,
    seeds: Seeds,
    **options: Unpack[SearchOptions],
) -> list[Branch]:
    """As `find_subharmonics`, without the branches that are known."""
    run = CurveRun(system, "omega", omega, harmonics, settings_of(system, options))
    with one_thread():
        branches = list(_branches(run.curve(omega[0], order, None), seeds, run, known))
    for branch in branches:
        pass_on(branch.interruption)
    return branches


def _branches(curve: MotionProblem, seeds: Seeds, run: CurveRun, known: Sequence[Branch] = ()) -> Iterator[Branch]:
    """The branches of the motions that a search meets, each once, without those that are known."""
    branches = list(known)
    # the share reported is that of the range that was searched: following branches on the way adds nothing
    search = Search(run.report if run.settings.report is None else run.settings.report.report)
    for point in _motions(run.scaled(curve), seeds, run, search.at):
        if any(lies_on(Sample(point).orbit, branch.points) for branch in branches):
            continue
        own = replace(
            run, settings=run.settings.reporting_to(None if run.settings.report is None else search, run.ends)
        )
        trace = both_ways(point, own.ahead, own.bounds, own.settings)
        if trace.points:
            branches.append(own.branch(trace))
            yield branches[-1]
        if trace.interrupted:
            return


def subharmonic_start(curve: MotionProblem, run: CurveRun) -> Trace:
    """The first branch of a curve's sub-harmonic motions that a search over the range finds, followed both ways.

    Raises ConvergenceError where it finds none.
    """
    point = next(_motions(run.scaled(curve), Seeds(), run, lambda share, where: run.report(0.0, where)), None)
    if point is None:
        first, last = run.ends
        raise ConvergenceError(
            f"no motion of {curve.balance.basis.nu} load periods was found between {curve.name} = {first:g} and "
            f"{last:g}: the search starts near nonlinear resonances of the linear modes at fractions of omega. Give a "
            "state or an orbit as start="
        )
    return both_ways(point, run.ahead, run.bounds, run.settings)


@with_options(RunOptions)
@limited
def periodic_orbit(
    system: System,
    omega: float,
    *,
    start: Any,
    subharmonic: int = 1,
    harmonics: Harmonics = "adaptive",
    transient: int = 0,
    newton: NewtonOptions | None = None,
    **options: Unpack[RunOptions],
) -> PeriodicOrbit:
    """The periodic motion near a state `(x, dx/dt)` in time, of one or several load periods, by harmonic balance.

    Parameters
    ----------
    omega
        Circular frequency of the load.
    start
        Displacements and velocities at t = 0, shape (2 n,).
    subharmonic
        Period of the motion in periods of the load; one that repeats earlier is returned with its own period.
    transient
        Periods of the motion that are integrated in time before, to come closer to an attracting one.
    newton
        Tolerances and iterations of Newton's method.

    Raises
    ------
    ConvergenceError
        If Newton's method finds no motion there.
    """
    order = 1 if subharmonic == 1 else check_order(subharmonic)
    omega = check_omega(omega)
    transient = check_count("transient", transient, 0)
    check_system(system, (omega,))
    given = start_state(system, start)
    curve = make_curve(system, "omega", omega, omega, harmonics, order, None)
    with one_thread(), reporting(options.get("progress"), "periodic motion") as report:
        if transient:
            if report is not None:
                report(0.0, f"{transient} periods in time")
            end = transient * order * 2.0 * np.pi / omega
            moving = system.viscous_equivalent()
            trajectory = integrate(moving, given, np.array([0.0, end]), omega, moving.parameters, rtol=1e-8)
            given = np.concatenate((trajectory.x[-1], trajectory.v[-1]))
        if report is not None:
            report(0.5, f"omega = {omega:.6g}")
        point = start_point(curve, omega, given, newton or NewtonOptions())
    own = (orbit := Sample(point).orbit).own_period
    return (
        orbit
        if own == order
        else periodic_orbit(system, omega, start=orbit.start(), subharmonic=own, harmonics=harmonics, newton=newton)
    )


# ------------------------------------------------------------------------------------------------------------- search
def _motions(curve: MotionProblem, seeds: Seeds, run: CurveRun, report: Report) -> Iterator[CurvePoint]:
    """Solved sub-harmonic motions over the range, as the search meets them."""
    nu = curve.balance.basis.nu
    patient = replace(run.settings.newton, iterations=25, damped=True)
    first, last = run.ends
    # away from the ends, where branches may just end
    values = first + (last - first) * (np.arange(seeds.frequencies) + 0.5) / seeds.frequencies
    free = backbones(curve, seeds.modes, 2.0 * max(run.ends))
    for number, value in enumerate(values):
        report(number / len(values), f"looking at {curve.where(np.array([value]))}")
        met: list[PeriodicOrbit] = []
        for guess in _guesses(curve, float(value), free, seeds):
            try:
                solved = correct(curve, guess, curve.parameter, curve.weights(guess, 0.0), patient)
            except ConvergenceError:
                continue
            x = curve.split(solved.u)[0]
            start = PeriodicOrbit(curve.balance, x, float(value), curve.balance.values, 0.0, 0.0, curve.adaptive)
            if subharmonic_share(curve, solved.u) <= _SUBHARMONIC or any(relation(start, other).one for other in met):
                continue
            met.append(start)
            try:
                point = start_point(curve, float(value), start, run.settings.newton, run.bounds)
            except ConvergenceError:
                continue
            own = point.curve
            assert isinstance(own, MotionProblem)
            if own.balance.basis.nu == nu and subharmonic_share(own, point.u) > _SUBHARMONIC:
                yield point


def _guesses(curve: MotionProblem, value: float, free: Sequence[Backbone], seeds: Seeds) -> Iterator[Array]:
    """Free vibrations at fractions of omega, in several phases, on top of the linear response."""
    nu, harmonics = curve.balance.basis.nu, curve.balance.basis.harmonics
    base = curve.split(linear_response(curve, value))[0]
    # a shift by a period of the load turns one phase into another
    phases = 2.0 * np.pi / nu * np.arange(seeds.phases) / seeds.phases
    for k in (k for k in range(1, 2 * nu) if gcd(k, nu) == 1):
        for motion in _vibrating(free, value * k / nu, k < nu):
            # what oscillates in it, in the basis of the longer period
            fitting = motion[1 : harmonics // k + 1]
            places = k * np.arange(1, len(fitting) + 1)
            for phase in phases:
                turns = (places // k * phase)[:, None]
                x = base.copy()
                x[0] = motion[0]
                x[2 * places - 1] += np.cos(turns) * fitting
                x[2 * places] += np.sin(turns) * fitting
                yield curve.join(x, value)


def _vibrating(free: Sequence[Backbone], frequency: float, slow: bool) -> Iterator[Array]:
    """The free vibrations of a frequency; for `slow` ones, where there are none, some whose frequency is another."""
    for backbone in free:
        resonant = backbone.at(frequency)
        yield from resonant or (backbone.typical if slow else ())
