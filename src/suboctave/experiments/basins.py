"""`basins`: which motion every state of a plane tends to.

States are followed until they are trapped, chunk by chunk, and kept as they come.

What is known after a chunk depends on the chunks before it only; a run that goes on from a journal therefore ends as
one that was never stopped.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self, Unpack

import numpy as np
from numpy.typing import NDArray

from suboctave.arguments import Count, checked
from suboctave.errors import InputError, path_of
from suboctave.experiments.basin_attractors import BasinAttractor, Catalogue, Given, enter_attractors, read_attractors
from suboctave.experiments.common import (
    BasinOptions,
    On,
    TimeResult,
    check_plane,
    checked_integration,
    coordinates,
    of_structures,
)
from suboctave.experiments.poincare import attractor_of
from suboctave.interruption import Interruption
from suboctave.model.elements.base import Array
from suboctave.model.inputs import check_omega, check_range, start_state, timed
from suboctave.model.projected import coordinates_of
from suboctave.model.system import System, describe
from suboctave.options import with_options
from suboctave.progress import Report, reporting
from suboctave.store.journal import Journal, Record
from suboctave.store.plain import Recorded, from_json, padded, to_json
from suboctave.timedomain.flow import Flow, Motions, check_extent
from suboctave.timedomain.trapping import Trap

APERIODIC, GONE, OPEN, DRIFTING = -1, -2, -3, -4
#: states followed together; cells of the coarse sample along each side; stopped trajectories that are followed on
_CHUNK, _COARSE, _FOLLOWED = 4096, 8, 200
#: periods between two tests of where the trajectories are, early and late
_EARLY, _LATE, _LONG = 8, 16, 64
#: periods by which a trajectory that was not trapped is classified
_CLASSIFIED = 60

_OTHERS = {APERIODIC: "aperiodic", GONE: "left the range", OPEN: "not computed", DRIFTING: "drifting"}


@checked(result=True)
@dataclass(eq=False, repr=False)
class Basins(TimeResult):
    """Basins of attraction on a plane of states at phase 0 of the load.

    Attributes
    ----------
    x, y
        (W,) and (V,): the states' coordinates along `plane`, from end to end of the box.
    labels
        (V, W): the number of the attractor in `attractors`; -1 of motions that do not repeat, -2 where the trajectory
        left the range of numbers, -3 where nothing was computed (an interruption), -4 of motions that drift, as
        rotations do whose angle is not declared.
    settling
        (V, W): periods of the load after which the trajectory was known to be trapped.
    attractors
        `BasinAttractor`: name, period, points, amplitude, multipliers.
    followed, contradicted
        How many of the trajectories that were stopped early were followed to the end, and how many of those did not
        end where they were said to.

    The table has one row for each label that occurs: name, period, amplitude, share and its errors.
    """

    contents = "basins"
    picture = "plot_basins"
    x: Annotated[Array, On("x")]
    y: Annotated[Array, On("y")]
    labels: Annotated[NDArray[np.int_], On("y", "x", name="label")]
    settling: Annotated[NDArray[np.int_], On("y", "x")]
    attractors: list[BasinAttractor]
    plane: tuple[str, str]
    rest: Annotated[Array, On("state")]
    omega: float
    parameters: Mapping[str, float]
    followed: int
    contradicted: int
    complete: bool
    observed: int
    system: System

    @property
    def names(self) -> dict[int, str]:
        """Names of the labels that occur."""
        names = {i: one.name for i, one in enumerate(self.attractors)} | _OTHERS
        return {i: names[i] for i in sorted(set(np.unique(self.labels).tolist()), key=lambda i: (i < 0, abs(i)))}

    @property
    def _computed(self) -> int:
        """How many states were computed, at least one."""
        return max(int((self.labels != OPEN).sum()), 1)

    @property
    def shares(self) -> dict[str, float]:
        """The share of the computed states that each has, by name."""
        return {name: float((self.labels == i).sum()) / self._computed for i, name in self.names.items() if i != OPEN}

    @property
    def standard_errors(self) -> dict[str, float]:
        """Of the shares, if the states were drawn at random: `sqrt(s (1 - s) / N)`. An upper bound for a grid."""
        return {name: float(np.sqrt(s * (1.0 - s) / self._computed)) for name, s in self.shares.items()}

    @property
    def grid_errors(self) -> dict[str, float]:
        """Of the shares, as areas: the cell about a state at a boundary may belong to both sides.

        The B states next to one of another label count with a standard deviation of half a cell each, independently:
        `sqrt(B) / (2 N)`. Where boundaries are finer than the grid, `standard_errors` say more.
        """
        at_boundary = {name: _at_boundary(self.labels == i).sum() for i, name in self.names.items() if i != OPEN}
        return {name: float(np.sqrt(count) / (2.0 * self._computed)) for name, count in at_boundary.items()}

    def attractor_at(self, x: float, y: float) -> BasinAttractor | None:
        """The attractor of the state next to a point of the plane; None if its motion is aperiodic or unknown."""
        places = []
        for name, value, grid in (("x", x, self.x), ("y", y, self.y)):
            step = (grid[-1] - grid[0]) / max(len(grid) - 1, 1) or 1.0
            place = (value - grid[0]) / step + 0.5
            if not 0.0 <= place < len(grid):
                raise InputError(f"{name}={value:g} lies outside of the box")
            places.append(int(place))
        label = int(self.labels[places[1], places[0]])
        return self.attractors[label] if label >= 0 else None

    def _derived(self) -> Mapping[str, Any]:
        known, one = self.attractors, ("attractor",)
        points = np.vstack([np.zeros((0, 2 * self.integrated.n)), *(coordinates_of(one.points) for one in known)])
        errors = {"standard_error": self.standard_errors, "grid_error": self.grid_errors}
        return {
            "period": (one, np.array([one.period for one in known], dtype=int)),
            "amplitude": (one, np.array([one.amplitude for one in known])),
            "given": (one, np.array([one.given for one in known], dtype=bool)),
            "multipliers": (("attractor", "multiplier"), padded([one.multipliers for one in known], complex)),
            "points": (("section", "state"), self.integrated.recovered(points)),
            "point_of": (("section",), np.repeat(np.arange(len(known)), [one.period for one in known]).astype(int)),
            **{name: ("kind", np.array(list(by.values()))) for name, by in ({"share": self.shares} | errors).items()},
            "attractor": ("attractor", np.array([one.name for one in known], dtype=str)),
            "kind": ("kind", np.array(list(self.shares), dtype=str)),
            "plane_x": self.plane[0],
            "plane_y": self.plane[1],
        }

    def recovered(self, lost: float = 0.0) -> Self:
        """See `TimeResult.recovered`; traps stay in the coordinates."""
        small = self.system
        self.attractors = [replace(one, points=small.recovered(one.points)) for one in self.attractors]
        return super().recovered(lost)

    def _recorded(self) -> Mapping[str, Any]:
        return {"traps": [[tuple(vars(trap).values()) for trap in one.traps] for one in self.attractors]}

    @classmethod
    def _from_record(cls, stored: Recorded) -> Mapping[str, Any]:
        columns = [stored[name].tolist() for name in ("attractor", "period", "amplitude", "given")]
        known = [
            BasinAttractor(
                str(name), int(period), stored["points"][stored["point_of"] == i], float(amplitude),
                stored["multipliers"][i].copy(), bool(given), [Trap(*trap) for trap in traps],
            )
            for i, (name, period, amplitude, given, traps) in enumerate(
                zip(*columns, stored.record["traps"], strict=True)
            )
        ]  # fmt: skip
        attributes = stored.dataset.attrs
        return {"attractors": known, "plane": (str(attributes["plane_x"]), str(attributes["plane_y"]))}

    def _columns(self) -> Mapping[str, Any]:
        known = {one.name: (one.period, one.amplitude) for one in self.attractors}
        motions = [known.get(name, (0, np.nan)) for name in self.shares]
        by_name = {"share": self.shares, "standard_error": self.standard_errors, "grid_error": self.grid_errors}
        own = {"name": list(self.shares), "period": [p for p, _ in motions], "amplitude": [a for _, a in motions]}
        return own | {name: list(values.values()) for name, values in by_name.items()}

    def plot(self, path: Any = None, **options: Any) -> Any:
        """The plane in one colour for each attractor, stroboscopic points marked; saved if a path is given.

        Options are those of `pictures.plot_basins`: `points`, `title`, `size`.
        """
        names = coordinates(self.system)
        columns = [names.index(name) for name in self.plane]
        marks = [one.points[:, columns] for one in self.attractors] if self.system.n == 1 else None
        return super().plot(path, **{"points": marks, **options})

    def _in_words(self) -> str:
        shares = ", ".join(f"{name} {share:.4f} +- {self.grid_errors[name]:.1g}" for name, share in self.shares.items())
        drifts = "\n  what drifts may be a rotation: declare its angle (angles= of the system)"
        return (
            f"Basins({len(self.x)} x {len(self.y)} states at omega={self.omega:.8g}: {shares}"
            f"{'' if self.complete else ', not complete'}){drifts if (self.labels == DRIFTING).any() else ''}"
        )


@with_options(BasinOptions)
@timed
@of_structures
def basins(
    system: System,
    omega: float,
    *,
    box: tuple[tuple[float, float], tuple[float, float]],
    grid: tuple[Count, Count] = (200, 200),
    plane: tuple[str | int, str | int] | None = None,
    start: Any = None,
    attractors: Any = None,
    parameters: Mapping[str, float] | None = None,
    periods: Count = 500,
    keep: str | Path | None = None,
    **options: Unpack[BasinOptions],
) -> Basins:
    """The basins of attraction on a plane of states at phase 0 of the load.

    Parameters
    ----------
    omega, parameters
        Of the load; other values of some parameters, by name.
    box
        `((from, to), (from, to))` of the two coordinates; `grid` states along each, the ends among them.
    plane, start
        The two coordinates: names `"x_0"`, `"v_2"` (of displacements and velocities) or numbers in the state (2n,);
        default displacement and velocity of the observed degree of freedom. All others are as in `start`, (2n,) or a
        motion, default zero.
    attractors
        Motions (of harmonic balance, of shooting, found in time), branches or diagrams of which the stable motions at
        this frequency are taken; one, several, or by name in a mapping. What else attracts is identified and named: a
        coarse sample of the states is followed first, and every trajectory that comes to no known motion is examined.
    periods
        Periods of the load after which a trajectory that is not trapped yet is classified by its last points.
    keep
        A file in which what is done is kept as it comes (a journal): called again with the same arguments after a kill
        or Ctrl-C, only the rest is computed, and the result is the same. Finished ones are read from it. With other
        arguments, other `attractors` among them, it is refused.

    A trajectory is stopped as soon as it lies in an ellipsoid about a stroboscopic point of a stable motion in which
    the map over a few periods contracts, in the norm adapted to the monodromy matrix. The derivative of the map is
    taken in 192 points of it, and the radius that passes is reduced by a tenth: no proof, so that up to 200 of the
    stopped trajectories are followed to the end (`followed`, `contradicted`). A motion about which nothing contracts
    has no such neighbourhood; its trajectories are followed for all `periods`.

    On a plane of a large structure, displacement and velocity of the observed degree of freedom or two that `plane`
    names, the others follow as a force there deflects them. Its neighbourhoods are a hundredth of the motion and not
    examined: what was followed to the end says how far to trust them.
    """
    state, values = start_state(system, start), system.read_values(parameters)
    check_omega(omega)
    how = checked_integration(system, options, tolerance=1e-8)
    columns = check_plane(system, plane, how.observe)
    sides, counts = _box(box), grid
    check_extent(counts[0] * counts[1], periods, counts[0] * counts[1] * 2 * system.n)
    ends = [np.linspace(low, high, count) for (low, high), count in zip(sides, counts, strict=True)]
    states = np.repeat(state[None], counts[0] * counts[1], axis=0)
    states[:, columns[0]], states[:, columns[1]] = np.tile(ends[0], counts[1]), np.repeat(ends[1], counts[0])
    catalogue = Catalogue(system, float(omega), values, how)
    run = BasinRun(catalogue, states, counts, periods)
    interruption: Interruption | None = None
    with reporting(options.get("progress"), "basins") as report:
        run.open(keep, read_attractors(catalogue, attractors))
        try:
            run.go(report)
        except KeyboardInterrupt as cause:
            interruption = Interruption.of(cause)
        finally:
            run.close()
    names, shape = coordinates(system), (counts[1], counts[0])
    result = Basins(
        ends[0], ends[1], run.labels.reshape(shape), run.settling.reshape(shape), catalogue.known,
        (names[columns[0]], names[columns[1]]), state, catalogue.omega, {**system.parameters, **values},
        run.followed, run.contradicted, interruption is None, how.observe, system,
    )  # fmt: skip
    result.interruption = interruption
    return result


def _box(box: Any) -> list[tuple[float, float]]:
    if not (isinstance(box, tuple | list | np.ndarray) and len(box) == 2):
        raise InputError(f"box={box!r}: give ((from, to), (from, to)) of the two coordinates")
    sides = []
    for name, side in zip(("box, first coordinate", "box, second coordinate"), box, strict=True):
        low, high = sorted(check_range(name, tuple(side) if isinstance(side, list | np.ndarray) else side, False))
        sides.append((low, high))
    return sides


def _at_boundary(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells that have a neighbour on the other side."""
    out = np.zeros_like(inside)
    across, along = inside[:, 1:] != inside[:, :-1], inside[1:] != inside[:-1]
    out[:, 1:] |= across
    out[:, :-1] |= across
    out[1:] |= along
    out[:-1] |= along
    return out


class BasinRun:
    """States (B, 2n) of a grid, and what is known of them: `labels` and `settling` (B,)."""

    def __init__(self, catalogue: Catalogue, states: Array, counts: tuple[int, int], periods: int) -> None:
        self.catalogue, self.states, self.counts, self.periods = catalogue, states, counts, periods
        self.flow = Flow(catalogue.system, "accurate", tolerance=catalogue.how.tolerance)
        self.labels = np.full(len(states), OPEN)
        self.settling = np.zeros(len(states), dtype=int)
        self.followed = self.contradicted = 0
        self.journal: Journal | None = None
        self._next = 0
        self._audited = False

    # --------------------------------------------------------------------------------------------------- journal
    def open(self, keep: Any, given: Sequence[Given]) -> None:
        """Begin, or go on from the file `keep`; `given` are the attractors that the user knows."""
        if keep is None:
            enter_attractors(self.catalogue, given)
            return
        place = path_of(keep)
        mark = self._mark()
        if not place.exists() and not place.parent.is_dir():
            raise InputError(f"{place.parent} is no folder: make it, or keep elsewhere")
        self.journal = Journal.reopen(place) if place.exists() else Journal.create(place)
        records = self.journal.records
        try:
            if records:
                self._restore(records, mark, given, place)
                return
            enter_attractors(self.catalogue, given)
        except BaseException:
            (self.journal.close if records else self.journal.remove)()
            raise
        attractors = [[one.name, one.words, [[state.tolist(), nu] for state, nu in one.starts]] for one in given]
        self._keep("basins", {"mark": mark, "attractors": attractors})
        self._keep_attractors(0)

    def close(self) -> None:
        """Close the journal."""
        if self.journal is not None:
            self.journal.close()

    def _mark(self) -> str:
        """A digest of everything that the result depends on."""
        c = self.catalogue
        text = to_json([
            describe(c.system), c.omega, c.values, c.how.observe, c.how.tolerance,
            self.periods, c.how.period_tolerance, self.counts,
        ])  # fmt: skip
        return hashlib.sha256(text.encode() + self.states.tobytes()).hexdigest()

    def _restore(self, records: Sequence[Record], mark: str, given: Sequence[Given], place: Path) -> None:
        for record in records:
            entry = record.fields
            if record.kind == "basins":
                if entry["mark"] != mark:
                    raise InputError(
                        f"{place} is of other basins (another system, frequency, grid or option): name another file"
                    )
                self._compare(entry.get("attractors"), given, place)
            elif record.kind == "attractor":
                points, multipliers = (from_json(entry[name]) for name in ("points", "multipliers"))
                self.catalogue.enter(entry["name"], points, entry["amplitude"], multipliers, entry["given"])
            elif record.kind == "chunk":
                at = slice(int(entry["begin"]), int(entry["end"]))
                self.labels[at] = record.dataset["label"].to_numpy()
                self.settling[at] = record.dataset["settling"].to_numpy()
                self._next = at.stop
            elif record.kind == "followed":
                self.followed, self.contradicted = int(entry["followed"]), int(entry["contradicted"])
                self._audited = True

    def _compare(self, written: Any, given: Sequence[Given], place: Path) -> None:
        """Refuse a journal that was begun with other attractors."""
        if written is None:
            raise InputError(f"{place} does not say which attractors it was begun with: name another file")
        before = [Given(name, words, [(np.array(s), int(nu)) for s, nu in starts]) for name, words, starts in written]
        if len(before) == len(given) and all(map(Given.same, before, given)):
            return
        first, now = (", ".join(one.words for one in some) or "none" for some in (before, given))
        what = f"with attractors={first}, not {now}" if first != now else f"with other motions as attractors={now}"
        raise InputError(f"{place} was begun {what}: give the same ones, or name another file")

    def _keep(self, kind: str, fields: Mapping[str, Any], **variables: NDArray[Any]) -> None:
        """Append a record to the journal, if there is one."""
        if self.journal is not None:
            import xarray

            dataset = xarray.Dataset({name: ("cell", values) for name, values in variables.items()})
            self.journal.append(kind, fields, dataset if variables else None)

    def _keep_attractors(self, first: int) -> None:
        for one in self.catalogue.known[first:]:
            self._keep("attractor", {
                "name": one.name, "points": to_json(one.points), "multipliers": to_json(np.asarray(one.multipliers)),
                "amplitude": float(one.amplitude), "given": one.given,
            })  # fmt: skip

    # ------------------------------------------------------------------------------------------------------ work
    def go(self, report: Report | None) -> None:
        """All that is left to do."""
        count = len(self.states)
        if self._next == 0:
            self._sample()
        for begin in range(self._next, count, _CHUNK):
            end, known = min(begin + _CHUNK, count), len(self.catalogue.known)

            def progress(share: float, begin: int = begin, end: int = end) -> None:
                if report is not None:
                    done = begin + share * (end - begin)
                    report(done / count, f"{done:.0f} of {count} states")

            labels, settling = self._settle(self.states[begin:end], progress)
            self.labels[begin:end], self.settling[begin:end] = labels, settling
            self._keep_attractors(known)
            self._keep("chunk", {"begin": begin, "end": end}, label=labels, settling=settling)
        if not self._audited:
            self._follow_some()

    def _sample(self) -> None:
        """Find what attracts a coarse sample of the cells."""
        wide, high = self.counts
        columns, rows = (np.unique((np.arange(_COARSE) + 0.5) * n // _COARSE).astype(int) for n in (wide, high))
        cells = (rows[:, None] * wide + columns).ravel()
        known = len(self.catalogue.known)
        self._settle(self.states[cells], lambda share: None)
        self._keep_attractors(known)

    def _over(self, states: Array, periods: int, last: int, measure: bool = False) -> Motions:
        c = self.catalogue
        skip, workers = periods - last, c.how.workers
        return self.flow.over(states, c.omega, periods, c.values, skip, measure, workers).whole()

    def _settle(self, states: Array, progress: Callable[[float], None]) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Labels of states (B, 2n), and the periods after which they were known."""
        labels = self.catalogue.trapped(states)
        labels[labels < 0] = OPEN
        settling = np.zeros(len(states), dtype=int)
        y, elapsed = states.copy(), 0
        active = np.flatnonzero(labels == OPEN)
        while len(active) and elapsed < self.periods:
            step = min(_EARLY if elapsed < _LONG else _LATE, self.periods - elapsed)
            motions = self._over(y[active], step, 1)
            elapsed += step
            y[active] = motions.end
            trapped = self.catalogue.trapped(np.where(motions.failed[:, None], np.inf, motions.end))
            labels[active] = np.where(motions.failed, GONE, np.where(trapped >= 0, trapped, OPEN))
            settling[active] = elapsed
            active = active[labels[active] == OPEN]
            progress(1.0 - len(active) / len(states))
        if len(active):
            self._classify(active, y[active], labels)
        return labels, settling

    def _classify(self, which: NDArray[np.int_], states: Array, labels: NDArray[np.int_]) -> None:
        """Classify motions that were not trapped by their next points."""
        c = self.catalogue
        motions = self._over(states, _CLASSIFIED, _CLASSIFIED, measure=True)
        parameters = {**c.system.parameters, **c.values}
        turns = motions.turns if c.system.turns else None
        rows = zip(which, motions.states, motions.peaks, motions.failed, strict=True)
        for k, (i, points, peaks, failed) in enumerate(rows):
            if failed:
                labels[i] = GONE
                continue
            turned = None if turns is None else turns[k]
            end = attractor_of(
                c.system, points, peaks, c.omega, parameters, c.how.period_tolerance, c.how.observe, turned
            )
            if not end.period:
                labels[i] = APERIODIC if end.drift is None else DRIFTING
                continue
            number = c.find(end.points)
            if number is None:
                number = c.add(end.state, end.period, None, False)
            # it repeats, but shooting may not confirm that it does, or that it is stable
            labels[i] = number if number is not None and c.near(number, end.points) else APERIODIC

    def _follow_some(self) -> None:
        """Follow some of the trajectories that were stopped to the end."""
        trapped = np.array([bool(one.traps) for one in self.catalogue.known], dtype=bool)
        if trapped.any():
            cells = np.flatnonzero((self.labels >= 0) & trapped[np.maximum(self.labels, 0)])
            cells = cells[np.unique(np.linspace(0, len(cells) - 1, min(_FOLLOWED, len(cells))).astype(int))]
            if len(cells):
                motions = self._over(self.states[cells], self.periods, 1)
                end = np.where(motions.failed[:, None], np.inf, motions.end)
                self.followed = len(cells)
                self.contradicted = int((self.catalogue.trapped(end) != self.labels[cells]).sum())
        self._audited = True
        self._keep("followed", {"followed": self.followed, "contradicted": self.contradicted})
