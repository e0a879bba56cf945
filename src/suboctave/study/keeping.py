"""What a running study keeps in its journal: points of curves, branches of diagrams, finished analyses; and reads back.

Records: "points" holds what is new on a curve that is being followed, "branch" a branch of a diagram that is under way,
told by the number of its parent and the bifurcation that it leaves at, "analysis" a finished one. The branches of a
finished diagram are those records; its own holds the tree. Before the record of finished isolas stand those of their
curves and closed branches, "part", told by name; before that of a table those of the result that it was taken from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from suboctave.analysis import Branch, Isolas, Table
from suboctave.analysis.results import Result, from_datasets, to_datasets
from suboctave.analysis.time_result import TimeResult
from suboctave.store.journal import Journal, Record, read_journal
from suboctave.study.steps import Step

if TYPE_CHECKING:
    import xarray

__all__ = ["BranchKeeper", "Noting", "Recovered", "finished", "keep", "recovered"]

#: seconds between records of points of an analysis that is under way
_OFTEN = 1.0


def keep(journal: Journal, name: str, key: str, result: Result, seconds: float) -> None:
    """A finished analysis, on the disk when this returns; the branches of a diagram are there already."""
    datasets = to_datasets(result, {"seconds": seconds})
    if isinstance(result, Isolas | Table):
        for part, dataset in datasets.items():
            if part:
                journal.append("part", {"name": name, "key": key, "part": part}, dataset, sync=False)
    journal.append("analysis", {"name": name, "key": key}, datasets[""])


def finished(records: Sequence[Record], key: str, allow_code: bool) -> tuple[Result, dict[str, Any]] | None:
    """The finished analysis with this key, and what was said of it; None if there is none."""
    found = [record for record in records if record.kind == "analysis" and record.said["key"] == key]
    if not found:
        return None
    groups: dict[str, xarray.Dataset] = {"": found[-1].dataset}
    if groups[""].attrs.get("contents") == "diagram":
        branches = _branches(records, key)
        places = zip(groups[""]["parent"].values, groups[""]["origin"].values, strict=True)
        for number, (parent, event) in enumerate(places):
            groups[f"branch_{number}"] = branches[int(parent), int(event)].dataset
    elif "parts" in groups[""].attrs:
        parts = {r.said["part"]: r for r in records if r.kind == "part" and r.said["key"] == key}
        groups |= {part: parts[part].dataset for part in str(groups[""].attrs["parts"]).splitlines()}
    result, said = from_datasets(groups, allow_code)
    assert not isinstance(result, TimeResult)
    return result, said


def _branches(records: Sequence[Record], key: str) -> dict[tuple[int, int], Record]:
    found = (record for record in records if record.kind == "branch" and record.said["key"] == key)
    return {(record.said["parent"], record.said["event"]): record for record in found}


class BranchKeeper:
    """Keeps the branches of a diagram in the journal as they are found, and knows those of an earlier run."""

    def __init__(self, journal: Journal, step: Step, key: str, allow_code: bool) -> None:
        self.journal, self.name, self.key, self.allow_code = journal, step.name, key, allow_code
        self._known = _branches(journal.records, key)

    def known(self, parent: int, event: int) -> Branch | None:
        """See `suboctave.analysis.diagram.Keeper`."""
        record = self._known.get((parent, event))
        if record is None:
            return None
        branch, _ = from_datasets({"": record.dataset}, self.allow_code)
        assert isinstance(branch, Branch)
        return branch

    def keep(self, parent: int, event: int, branch: Branch) -> None:
        """See `suboctave.analysis.diagram.Keeper`."""
        said = {"name": self.name, "key": self.key, "parent": parent, "event": event}
        self.journal.append("branch", said, to_datasets(branch)[""])


class Noting:
    """A `progress=` that passes reports on and writes what has been found to the journal now and then."""

    def __init__(self, journal: Journal, step: Step, progress: Any) -> None:
        self.journal, self.step, self.progress = journal, step, progress
        self.since = perf_counter()
        self.points = self.events = 0

    def __call__(self, share: float, where: str) -> None:
        if self.progress is not None:
            self.progress(share, where)

    def found(self, trace: Any) -> None:
        """Called at each point of a curve with what has been found on it so far."""
        now = perf_counter()
        events = len(trace.bifurcations)
        if now - self.since < _OFTEN and events == self.events:
            return
        self.since = now
        points, located = trace.points[self.points :], trace.bifurcations[self.events :]
        said = {
            "name": self.step.name,
            "from": self.points,
            "omega": [point.orbit.omega for point in points],
            "values": [dict(point.orbit.values) for point in points],
            "coefficients": [point.orbit.coefficients.tolist() for point in points],
            "stable": [bool(point.floquet.stable) for point in points],
            "bifurcations": [[b.kind, b.omega, dict(b.parameters), b.amplitude] for b in located],
        }
        self.points, self.events = len(trace.points), events
        self.journal.append("points", said, sync=False)


@dataclass
class Recovered:
    """What a journal holds of one analysis; `events` are (kind, omega, amplitude) of one that had not finished.

    branches
        Of a diagram how many branches, of isolas how many curves; None for a single curve.
    """

    name: str
    state: str = "begun"
    points: int = 0
    bifurcations: int = 0
    events: list[tuple[str, float, float]] = field(default_factory=list)
    branches: int | None = None


def recovered(path: str | Path) -> tuple[list[Recovered], bool]:
    """What a journal holds, analysis by analysis, and whether its end was torn."""
    records, _, torn = read_journal(path)
    found: dict[str, Recovered] = {}
    for record in records:
        name = str(record.said.get("name", ""))
        if record.kind == "points":
            if not record.said["from"]:
                found[name] = Recovered(name)
            item = found.setdefault(name, Recovered(name))
            item.points += len(record.said["omega"])
            item.events += [(kind, omega, amplitude) for kind, omega, _, amplitude in record.said["bifurcations"]]
            item.bifurcations = len(item.events)
        elif record.kind == "part" and record.said["part"].startswith("result"):
            continue  # of a table
        elif record.kind in ("branch", "part"):
            item = found.setdefault(name, Recovered(name))
            sizes = record.dataset.sizes
            item.branches = (item.branches or 0) + 1
            item.points += int(sizes.get("point", 0))
            item.bifurcations += int(sizes.get("event", 0))
        elif record.kind == "analysis":
            if record.dataset.attrs.get("contents") in ("diagram", "isolas"):
                found.setdefault(name, Recovered(name)).state = "finished"
                continue
            sizes = record.dataset.sizes
            count = int(sizes.get("point", sizes.get("row", 0)))
            found[name] = Recovered(name, "finished", count, int(sizes.get("event", 0)))
    return list(found.values()), torn
