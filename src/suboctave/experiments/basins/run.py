"""The work behind `basins`: states are followed until they are trapped, chunk by chunk, and kept as they come.

What is known after a chunk depends on the chunks before it only; a run that goes on from a journal therefore ends as
one that was never stopped.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import InputError, path_of
from suboctave.experiments.attractors import attractor_of
from suboctave.experiments.basins.attractors import Catalogue, Given, enter_attractors
from suboctave.interruption import pass_on
from suboctave.model.elements.base import Array
from suboctave.model.system import describe
from suboctave.store.journal import Journal
from suboctave.store.plain import from_json, to_json
from suboctave.timedomain.flow import Flow, Report

__all__ = ["APERIODIC", "GONE", "OPEN", "BasinRun"]

APERIODIC, GONE, OPEN = -1, -2, -3
#: states followed together; cells of the coarse sample along each side; stopped trajectories that are followed on
_CHUNK, _COARSE, _FOLLOWED = 4096, 8, 200
#: periods between two tests of where the trajectories are, early and late
_EARLY, _LATE, _LONG = 8, 16, 64
#: periods by which a trajectory that was not trapped is classified
_CLASSIFIED = 60


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
        if place.exists():
            self.journal = Journal.reopen(place)
            if self.journal.records:
                try:
                    self._restore(mark, given, place)
                except BaseException:
                    self.journal.close()
                    raise
                return
        else:
            if not place.parent.is_dir():
                raise InputError(f"{place.parent} is no folder: make it, or keep elsewhere")
            self.journal = Journal.create(place)
        try:
            enter_attractors(self.catalogue, given)
        except BaseException:
            self.journal.remove()
            raise
        attractors = [[one.name, one.words, [[state.tolist(), nu] for state, nu in one.starts]] for one in given]
        self.journal.append("basins", {"mark": mark, "attractors": attractors})
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

    def _restore(self, mark: str, given: Sequence[Given], place: Path) -> None:
        assert self.journal is not None
        for record in self.journal.records:
            if record.kind == "basins":
                if record.fields["mark"] != mark:
                    raise InputError(
                        f"{place} is of other basins (another system, frequency, grid or option): name another file"
                    )
                self._compare(record.fields.get("attractors"), given, place)
            if record.kind == "attractor":
                entry = record.fields
                points, multipliers = (from_json(entry[name]) for name in ("points", "multipliers"))
                self.catalogue.enter(entry["name"], points, entry["amplitude"], multipliers, entry["given"])
            elif record.kind == "chunk":
                at = slice(int(record.fields["begin"]), int(record.fields["end"]))
                self.labels[at] = record.dataset["label"].to_numpy()
                self.settling[at] = record.dataset["settling"].to_numpy()
                self._next = at.stop
            elif record.kind == "followed":
                self.followed, self.contradicted = int(record.fields["followed"]), int(record.fields["contradicted"])
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

    def _keep_attractors(self, first: int) -> None:
        for one in self.catalogue.known[first:] if self.journal is not None else ():
            assert self.journal is not None
            self.journal.append("attractor", {
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
            if self.journal is not None:
                import xarray

                chunk = xarray.Dataset({"label": (("cell",), labels), "settling": (("cell",), settling)})
                self.journal.append("chunk", {"begin": begin, "end": end}, chunk)
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

    def _over(self, states: Array, periods: int, last: int, measure: bool = False) -> Any:
        c = self.catalogue
        motions = self.flow.over(
            states, c.omega, periods, c.values, skip=periods - last, measure=measure, workers=c.how.workers
        )
        pass_on(motions.interruption)
        return motions

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
        for i, points, peaks, failed in zip(which, motions.states, motions.peaks, motions.failed, strict=True):
            if failed:
                labels[i] = GONE
                continue
            end = attractor_of(c.system, points, peaks, c.omega, parameters, c.how.period_tolerance, c.how.observe)
            if not end.period:
                labels[i] = APERIODIC
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
        if self.journal is not None:
            self.journal.append("followed", {"followed": self.followed, "contradicted": self.contradicted})
