"""`poincare_sections`: where trajectories pierce the plane of phase 0 of the load, and what they settle on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from suboctave.arguments import Count, Index, checked
from suboctave.errors import InputError
from suboctave.experiments.common import (
    On,
    PeaksOn,
    SectionOptions,
    StatesOn,
    TimeResult,
    checked_integration,
    of_structures,
    starting_states,
    watched_states,
)
from suboctave.model.elements.base import Array
from suboctave.model.inputs import timed
from suboctave.model.projected import ProjectedSystem, coordinates_of
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.progress import reporting
from suboctave.store.layout import parameter_column
from suboctave.store.plain import Recorded
from suboctave.timedomain.flow import Flow
from suboctave.timedomain.period_recognition import Drift, drift_of, extents, period_of, same_cycle


@checked(result=True)
@dataclass(eq=False, repr=False)
class PoincareSections(TimeResult):
    """Stroboscopic points of B trajectories.

    Attributes
    ----------
    points
        (B, P, 2n): displacements, then velocities, at phase 0 of the load, after the transient; angles within half a
        turn.
    largest
        (B, P, n): the largest |x_i| in the period before each point.
    omega
        (B,).
    varied
        (B,) each: the parameters that differ from the system's, by name.
    failed
        (B,): trajectories that left the range of numbers (their points are NaN), or some steps of which Newmark's
        method did not solve.
    finished
        (B,): False for those that an interruption left out; their points are NaN.
    tolerance
        Relative tolerance of the recognition of periods.
    turns
        (B, P, k): whole turns that each of k angles had made by then; None without angles.

    The table has one row per point. `plot` draws the points in the plane of displacement and velocity; options are
    those of `pictures.plot_sections`: `dof`, `title`, `size`.
    """

    contents = "poincare sections"
    picture = "plot_sections"
    points: Annotated[Array, StatesOn("trajectory", "section")]
    largest: Annotated[Array, PeaksOn("trajectory", "section", "dof")]
    omega: Annotated[Array, On("trajectory")]
    varied: Mapping[str, Array]
    failed: Annotated[NDArray[np.bool_], On("trajectory")]
    finished: Annotated[NDArray[np.bool_], On("trajectory")]
    tolerance: float
    transient: int
    method: str
    observed: int
    system: System
    turns: Annotated[NDArray[np.int_] | None, On("trajectory", "section", "angle")] = None

    def __len__(self) -> int:
        return len(self.points)

    def attractor(self, index: int) -> Attractor:
        """What trajectory number `index` has settled on."""
        if not -len(self) <= index < len(self):
            raise InputError(f"there is no trajectory {index}: they are numbered from 0 to {len(self) - 1}")
        return recovered_attractor(self._settled(index), self.projection)

    def _settled(self, index: int) -> Attractor:
        """The attractor of the system that was integrated."""
        system = self.integrated
        values = {name: float(column[index]) for name, column in self.varied.items()}
        return attractor_of(
            system,
            coordinates_of(self.points)[index],
            coordinates_of(self.largest)[index],
            float(self.omega[index]),
            {**system.parameters, **values},
            self.tolerance,
            observed_in(self.projection, self.observed),
            None if self.turns is None else self.turns[index],
        )

    @property
    def periods(self) -> NDArray[np.int_]:
        """(B,): the period of each in periods of the load, 0 where nothing repeats."""
        return np.array([self._settled(i).period for i in range(len(self))], dtype=int)

    @property
    def attractors(self) -> list[Attractor]:
        """Every attractor once, by falling amplitude, with the number of trajectories on it.

        All trajectories must have the same frequency and parameters; those that did not finish are left out.
        """
        columns = [self.omega, *self.varied.values()]
        if any((column != column[0]).any() for column in columns):
            raise InputError(
                "the trajectories have different frequencies or parameters: ask for attractor(i) of each, or take "
                "brute_force_diagram"
            )
        kept = np.flatnonzero(self.finished & ~self.failed)
        found = distinct(self.integrated, [self._settled(int(i)) for i in kept], self.tolerance)
        return [recovered_attractor(one, self.projection) for one in found]

    def _derived(self) -> Mapping[str, Any]:
        columns = [self.varied.get(name, np.full(len(self), v)) for name, v in self.system.parameters.items()]
        parameters = np.array(columns, dtype=float).reshape(-1, len(self)).T
        return {
            "period": (("trajectory",), self.periods),
            "parameters": (("trajectory", "parameter"), parameters),
            "varied": "\n".join(self.varied),
        }

    def _recorded(self) -> Mapping[str, Any]:
        return {"varied": list(self.varied)}

    @classmethod
    def _from_record(cls, stored: Recorded) -> Mapping[str, Any]:
        names = stored["parameter"].astype(str).tolist()
        return {"varied": {name: stored["parameters"][:, names.index(name)].copy() for name in stored.record["varied"]}}

    def _columns(self) -> Mapping[str, Any]:
        count, sections, _ = self.points.shape
        which, names = watched_states(self.system, self.projection)
        taken = ("trajectory", "omega", "section", *names, "period")
        varied = {"omega": self.omega} | {parameter_column(n, taken): v for n, v in self.varied.items()}
        columns: dict[str, Any] = {"trajectory": np.repeat(np.arange(count), sections)}
        columns |= {n: np.repeat(values, sections) for n, values in varied.items()}
        columns["section"] = np.tile(np.arange(sections), count)
        columns |= {name: self.points[:, :, i].ravel() for i, name in zip(which, names, strict=True)}
        return columns | {"period": np.repeat(self.periods, sections)}

    def _in_words(self) -> str:
        count, sections, _ = self.points.shape
        head = f"PoincareSections({count} trajectories, {sections} points each after {self.transient} periods)"
        settled = (self.attractor(i) for i in range(min(count, _LOOKED_AT)))
        drifting = next((one.drifts for one in settled if one.drifts), "")
        return f"{head}\n  {drifting}" if drifting else head


@with_options(SectionOptions)
@timed
@of_structures
def poincare_sections(
    system: System,
    omega: ArrayLike,
    *,
    start: Any = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    transient: Index = 300,
    periods: Count = 60,
    **options: Unpack[SectionOptions],
) -> PoincareSections:
    """Follow many trajectories and keep their states once in every period of the load, on all processors.

    Parameters
    ----------
    omega, parameters
        A number, or (B,) with one for each trajectory; parameters by name.
    start
        (B, 2n) or (2n,): displacements, then velocities, at phase 0 of the load; one motion or a list of them; None for
        rest.
    transient, periods
        Periods of the load that are left out, and those that are kept.
    """
    states = starting_states(system, start)
    states = states if len(states) > 1 else states[0]
    how = checked_integration(system, options)
    flow = Flow(system, how.method, 1, how.steps, how.tolerance)
    with reporting(options.get("progress"), "Poincaré sections") as report:
        motions = flow.over(
            states, omega, transient + periods, parameters, transient, measure=True, workers=how.workers, report=report
        )
    count = len(motions.states)
    sections = PoincareSections(
        points=motions.states,
        largest=motions.peaks,
        omega=np.broadcast_to(np.asarray(omega, dtype=float), (count,)).copy(),
        varied={
            name: np.broadcast_to(np.asarray(values, dtype=float), (count,)).copy()
            for name, values in (parameters or {}).items()
        },
        failed=motions.failed | (motions.unsettled > 0.0),
        finished=motions.finished,
        tolerance=how.period_tolerance,
        transient=transient,
        method=how.method,
        observed=how.observe,
        system=system,
        turns=motions.turns if system.turns else None,
    )
    sections.interruption = motions.interruption
    return sections


#: by how much more the points of two trajectories on one attractor may miss each other than those of one motion
_WIDER = 100.0
#: by how much a drift may miss whole turns of 2 pi, relative to it, and be taken for a rotation
_WHOLE = 1e-5
#: trajectories among which a description looks for one that drifts
_LOOKED_AT = 16


@checked(result=True)
@dataclass(frozen=True, eq=False)
class Attractor:
    """What a trajectory has settled on, by its stroboscopic points.

    Attributes
    ----------
    kind
        "periodic"; "drifting", where it repeats but for displacements that grow by the same each time, as an angle that
        is not declared does in a rotation; or "aperiodic": quasi-periodic, chaotic, of a longer period than is
        recognised, or not settled yet.
    period
        In periods of the load; 0 of an aperiodic or drifting motion.
    points
        (period, 2n): its states at phase 0 of the load, angles within half a turn; of a motion that is not periodic all
        that were kept.
    amplitude
        Largest |x| of the observed degree of freedom.
    largest
        (n,): the same of all of them.
    defect
        By how much the points repeat, relative to the motion; of an aperiodic motion the best repetition found.
    omega, parameters
        Of the load, and all of the system's by name.
    count
        How many trajectories have settled on it.
    turns
        Whole turns that each of the system's angles makes in its period; empty without angles.
    drift
        Of a drifting motion the periods of the load after which it repeats, and by how much its displacements (n,) have
        grown by then; else None.
    names
        Of the degrees of freedom, if they have any.
    """

    kind: str
    period: int
    points: Array
    amplitude: float
    largest: Array
    defect: float
    omega: float
    parameters: Mapping[str, float]
    observed: int
    count: int = 1
    turns: tuple[int, ...] = ()
    drift: Drift | None = None
    names: tuple[str, ...] = ()

    @property
    def state(self) -> Array:
        """A state (2n,) at phase 0 of the load, from which other verbs may start."""
        return self.points[0]

    def __repr__(self) -> str:
        what = f"{self.period}T" if self.period > 1 else "T" if self.period else self.kind
        if any(self.turns):
            what += f" rotating by {' and '.join(map(str, self.turns))} turn{'s' * (self.turns not in ((1,), (-1,)))}"
        times = f", {self.count} trajectories" if self.count > 1 else ""
        size = f"max|x_{self.observed}|={self.amplitude:.8g}"
        return f"Attractor({what} at omega={self.omega:.8g}, {self.drifts or size}{times})"

    @property
    def drifts(self) -> str:
        """How a drifting motion does, and what to declare if that is a rotation; empty of others."""
        if self.drift is None:
            return ""
        step, periods = np.asarray(self.drift.step), self.drift.period
        dof = int(np.argmax(np.abs(step)))
        name, grown = self.names[dof] if self.names else f"x_{dof}", float(step[dof])
        turns = round(grown / (2.0 * np.pi))
        if not turns or abs(grown / (2.0 * np.pi) - turns) > _WHOLE * abs(turns):
            each = "each period" if periods == 1 else f"{periods} periods"
            return f"{name} moves on by {grown:.6g} in {each}: if it is an angle, declare it (angles= of the system)"
        if turns % periods == 0:
            turns, periods = turns // periods, 1
        each = "each period" if periods == 1 else f"{periods} periods"
        many = {1: "2 pi", -1: "-2 pi"}.get(turns, f"{turns} times 2 pi")
        return f"{name} turns by {many} in {each}: declare angles=[{(self.names[dof] if self.names else dof)!r}]"


def attractor_of(
    system: System,
    points: Array,
    peaks: Array,
    omega: float,
    parameters: Mapping[str, float],
    tolerance: float,
    observe: int,
    turned: NDArray[np.int_] | None = None,
) -> Attractor:
    """The attractor of one trajectory from its points (P, 2n) and its largest displacements (P, n) in between.

    `turned` (P, k): whole turns that are left out of the points.
    """
    turns = system.turns
    whole = points if turned is None or not turns else points.copy()
    if turned is not None and turns:
        whole[:, : system.n] += turned @ turns.rows
    sizes = state_sizes(system, peaks, omega, parameters)
    repeat, drift, made = period_of(points, sizes, tolerance, turns), None, (0,) * len(turns.rows)
    if not repeat.period:
        drift = drift_of(whole, omega, _masses(system, parameters), tolerance)
    elif turns:
        made = tuple(turns.counts(whole[-1] - whole[-1 - repeat.period]).tolist())
    last = repeat.period or len(points)
    points, largest = turns.modulo(points), peaks[-last:].max(axis=0)
    return Attractor(
        "periodic" if repeat.period else "aperiodic" if drift is None else "drifting",
        repeat.period,
        points[-last:].copy(),
        float(largest[observe]),
        largest,
        repeat.defect,
        omega,
        dict(parameters),
        observe,
        turns=made,
        drift=drift,
        names=system.dof_names,
    )


def observed_in(projection: ProjectedSystem | None, dof: int) -> int:
    """Which coordinate of the system that was integrated the observed degree of freedom is."""
    return dof if projection is None else projection.coordinate(dof)


def recovered_attractor(one: Attractor, projection: ProjectedSystem | None) -> Attractor:
    """An attractor of a projection as one of the structure."""
    if projection is None:
        return one
    points: Any = projection.recovered(one.points)
    largest: Any = projection.recovered_peaks(one.largest)
    observed, names = projection.watched[one.observed], projection.structure.dof_names
    drift = one.drift and Drift(one.drift.period, np.asarray(projection.recovered(one.drift.step)))
    return replace(one, points=points, largest=largest, observed=observed, drift=drift, names=names)


def distinct(system: System, all_of: Sequence[Attractor], tolerance: float) -> list[Attractor]:
    """Each once, with the number of trajectories on it, by falling amplitude; those that are not periodic are one.

    Periodic ones are the same if their points are, to a hundred times the tolerance.
    """
    groups: list[list[Attractor]] = []
    for one in all_of:
        sizes = state_sizes(system, one.largest[None], one.omega, one.parameters)
        for group in groups:
            other = group[0]
            if (other.period, other.kind, other.turns) == (one.period, one.kind, one.turns) and (
                not one.period or same_cycle(other.points, one.points, sizes, _WIDER * tolerance, system.turns)
            ):
                group.append(one)
                break
        else:
            groups.append([one])
    counted = [replace(group[0], count=len(group)) for group in groups]
    return sorted(counted, key=lambda one: -one.amplitude)


def state_sizes(system: System, peaks: Array, omega: float, parameters: Mapping[str, Any]) -> Array:
    """Sizes (2n,) of a motion's displacements and velocities, from its largest displacements (P, n) in each period."""
    with np.errstate(invalid="ignore"):
        return extents(peaks.max(axis=0), omega, _masses(system, parameters))


def _masses(system: System, parameters: Mapping[str, Any]) -> Array:
    """Masses that the degrees of freedom show, (n,)."""
    mass: Array = np.diagonal(system.mass.value({**system.parameters, **parameters}))
    return mass
