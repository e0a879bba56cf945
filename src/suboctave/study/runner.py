"""Runs a study: analyses in order, each kept in the journal when it is there, results and pictures at the end.

A run that was killed left its journal: `resume` takes the finished analyses from it and goes on. An analysis is taken
over only if version, system, its arguments and those of the analyses it starts from are the same.

Records of the journal: "points" holds what is new on a curve that is being followed, "branch" a branch of a diagram
that is under way, named by the number of its parent and the bifurcation that it leaves at, "analysis" a finished one.
The branches of a finished diagram are those records; its own holds the tree. Before the record of finished isolas stand
those of their curves and closed branches, "part"; before that of a table those of the result that it was taken from.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from suboctave.errors import ConvergenceError, InputError, TimeLimitError
from suboctave.experiments.common import TimeResult
from suboctave.interruption import Interruption, check_seconds, time_limit
from suboctave.maps.isolas.result import Isolas
from suboctave.results.branch import Branch
from suboctave.store.journal import Journal, Record, read_journal
from suboctave.store.registry import from_datasets, to_datasets
from suboctave.store.table import Table
from suboctave.study.file import Study
from suboctave.study.outputs import places, write_outputs
from suboctave.study.results import Result, Results, load
from suboctave.study.steps import Context, Step

if TYPE_CHECKING:
    import xarray


JOURNAL = "unfinished.journal"
#: seconds between records of points of an analysis that is under way
_OFTEN = 1.0


@dataclass(frozen=True)
class Finished:
    """An analysis that is over: its result (None if it has none), the seconds it took, and what is to be said of it.

    `interruption`: what stopped it before its end; it may have no result then.
    """

    step: Step
    result: Result | None
    seconds: float
    reused: bool = False
    failure: str = ""
    wrong_input: bool = False
    interruption: Interruption | None = None


@dataclass
class Outcome:
    """What a run gave: analyses in order, files written, and what stopped it or one of them before the end.

    `complete`: the results file of a study that was complete already; `left`: outputs that stood there and were left.
    """

    finished: list[Finished] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    interruption: Interruption | None = None
    complete: Path | None = None
    left: list[Path] = field(default_factory=list)

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C or a time limit left something to go on with."""
        return self.interruption is not None

    @property
    def failed(self) -> list[Finished]:
        """The analyses that failed."""
        return [item for item in self.finished if item.failure]


Watch = Callable[[Step], AbstractContextManager[Any]]


def run_study(
    study: Study,
    folder: str | Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
    watch: Watch | None = None,
    report: Callable[[Finished], None] | None = None,
    seconds: float | None = None,
) -> Outcome:
    """Run a study and write its outputs.

    Parameters
    ----------
    folder
        Where outputs go, in place of what the study says.
    overwrite, resume
        Replace what an earlier run left, or go on with it. Of a study that is complete `resume` writes the outputs that
        are missing, from its results; with `overwrite` all of them.
    watch
        Gives for each analysis a context whose value is the `progress=` of its verb.
    report
        Called with each analysis when it is over.
    seconds
        Time limit for all analyses together, in place of the study's own.

    Raises
    ------
    InputError
        If outputs exist and neither is given, or the folder cannot be written to: before any work.
    """
    check_seconds(seconds)
    place = Path(folder) if folder is not None else study.folder
    journal_at = place / JOURNAL
    targets = places(study.outputs, study.steps, place)
    if resume and not journal_at.exists() and targets[0].exists():
        return _complete(study, place, targets, overwrite)
    _prepare(place, targets, journal_at, overwrite, resume)
    seconds = study.seconds if seconds is None else seconds
    outcome, results, details = Outcome(), dict[str, Result](), dict[str, dict[str, Any]]()
    unfinished: set[str] = set()
    opened = Journal.reopen if resume and journal_at.exists() else Journal.create
    with closing(opened(journal_at)) as journal:
        for torn in place.glob(f".{study.outputs.results}-*.part"):  # half a file of a run that was killed
            torn.unlink(missing_ok=True)
        journal.append("run", {"study": study.text, "title": study.title, "source": study.source.name})
        with time_limit(seconds) as limit:
            for step in study.steps:
                whole = unfinished.isdisjoint(name for _, name in step.needs())
                done = _one(study, step, results, journal, watch, whole)
                if done.interruption is not None or not whole:
                    unfinished.add(step.name)
                if done.result is not None:
                    results[step.name] = done.result
                    key = "" if step.name in unfinished else study.keys[step.name]
                    arguments = step.model_dump_json(exclude_defaults=True)
                    own = {"type": step.kind, "seconds": done.seconds, "key": key, "arguments": arguments}
                    details[step.name] = own
                if done.result is not None or done.failure:
                    outcome.finished.append(done)
                    if report is not None:
                        report(done)
                if done.interruption is not None:
                    outcome.interruption = done.interruption
                    # the time limit of an analysis stops that one alone
                    if done.interruption.seconds is None or (limit is not None and limit.reached):
                        break
        if results:
            journal.extend([("output", {"file": path.name}, None) for path in targets])
            outcome.files = _written(study, results, details, place)
        if not (outcome.interrupted or outcome.failed):  # else --resume goes on from here
            journal.remove()
    return outcome


def _prepare(place: Path, targets: list[Path], journal: Path, overwrite: bool, resume: bool) -> None:
    """Make the folder and refuse what must not be overwritten, before any work."""
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {place} cannot be made: {error.strerror}; write elsewhere with --out") from None
    _check_folder(place)
    if overwrite and not resume:
        if journal.exists():
            Journal.reopen(journal).remove()
        return
    ours: set[str] = set()
    if journal.exists():
        if not resume:
            raise InputError(
                f"{place} holds a run that did not finish: go on with --resume, or start anew with --overwrite"
            )
        ours = {record.fields.get("file", "") for record in read_journal(journal) if record.kind == "output"}
    there = [path.name for path in targets if path.exists() and path.name not in ours]
    if there and not overwrite:
        more = f" and {len(there) - 3} more" if len(there) > 3 else ""
        raise InputError(
            f"{place} already holds {', '.join(there[:3])}{more}, left as it is: --overwrite replaces it, --out writes "
            "elsewhere"
        )


def _check_folder(place: Path) -> None:
    if not os.access(place, os.W_OK | os.X_OK):
        raise InputError(f"the folder {place} is not writable: write elsewhere with --out")


def _written(
    study: Study, results: dict[str, Result], details: dict[str, Any], place: Path, left: Sequence[Path] = ()
) -> list[Path]:
    """The files that are written of results; those in `left` are not."""
    attributes = {"title": study.title, "study": study.text, "analyses": "\n".join(results)}
    return list(write_outputs(study.outputs, Results(results, attributes, details), place, study.title, left))


def _complete(study: Study, place: Path, targets: list[Path], overwrite: bool) -> Outcome:
    """The results are there: write the outputs that are missing, or all. InputError if they are another study's."""
    path, names = targets[0], [step.name for step in study.steps]
    results = load(path, allow_code=study.allow_code)
    if not isinstance(results, Results) or not all(
        name in results and results.details[name].get("key") == study.keys[name] for name in names
    ):
        raise InputError(
            f"there is nothing to resume: {path} holds the results of another study, or of this one before it was "
            "changed; --overwrite replaces it, --out writes elsewhere"
        )
    details = {name: results.details[name] for name in names}
    finished = [
        Finished(step, results[step.name], float(details[step.name].get("seconds", 0.0)), True) for step in study.steps
    ]
    left = [] if overwrite else [target for target in targets if target.exists()]
    if len(left) < len(targets):
        _check_folder(place)
    files = _written(study, {name: results[name] for name in names}, details, place, left)
    return Outcome(finished, files, complete=path, left=left)


def _one(
    study: Study, step: Step, results: dict[str, Result], journal: Journal, watch: Watch | None, whole: bool
) -> Finished:
    """What came of one analysis; `whole`: what it starts from is complete, and so it may be kept as complete."""
    key = study.keys[step.name]
    kept = finished(journal.records, key, study.allow_code) if whole else None
    if kept is not None:
        result, attributes = kept
        return Finished(step, result, float(attributes.get("seconds", 0.0)), reused=True)
    missing = [name for _, name in step.needs() if name not in results]
    if missing:
        return Finished(step, None, 0.0, failure=f"it starts from {missing[0]!r}, which gave nothing")
    begin = perf_counter()
    interruption: Interruption | None = None
    outcome: Result | None = None
    failure, wrong = "", False
    with nullcontext() if watch is None else watch(step) as progress:
        try:
            system = study.system.with_parameters(step.parameters) if step.parameters else study.system
            keeper = BranchKeeper(journal, step.name, key, study.allow_code) if whole else None
            noted = Noting(journal, step.name, progress)
            with time_limit(step.seconds):
                outcome = step.run(Context(system, results, noted, study.allow_code, keeper))
        except KeyboardInterrupt as cause:
            interruption = Interruption.of(cause)
        except TimeLimitError as error:
            failure, interruption = str(error), Interruption(step.seconds)
        except ConvergenceError as error:
            failure = str(error)
        except InputError as error:
            failure, wrong = str(error), True
        except ArithmeticError as error:  # a size of 1e200 whose square is no number
            failure = f"the numbers grew too large or too small ({error}): choose units in which they are nearer to 1"
    seconds = perf_counter() - begin
    if outcome is not None:
        interruption = interruption or outcome.interruption
        if interruption is None and whole:
            keep(journal, step.name, key, outcome, seconds)
    return Finished(step, outcome, seconds, False, failure, wrong, interruption)


# ------------------------------------------------------------------------------------------------------- the journal
def keep(journal: Journal, name: str, key: str, result: Result, seconds: float) -> None:
    """A finished analysis, on the disk when this returns; the branches of a diagram are there already."""
    datasets = to_datasets(result, {"seconds": seconds})
    place = {"name": name, "key": key}
    parts = datasets.items() if isinstance(result, Isolas | Table) else ()
    entries = [("part", {**place, "part": part}, dataset) for part, dataset in parts if part]
    journal.extend([*entries, ("analysis", place, datasets[""])])


def finished(records: Sequence[Record], key: str, allow_code: bool) -> tuple[Result, dict[str, Any]] | None:
    """The finished analysis with this key, and the attributes of its dataset; None if there is none."""
    own = [record for record in records if record.kind == "analysis" and record.fields["key"] == key]
    if not own:
        return None
    groups: dict[str, xarray.Dataset] = {"": own[-1].dataset}
    if groups[""].attrs.get("contents") == "diagram":
        branches = _branches(records, key)
        places = zip(groups[""]["parent"].values, groups[""]["origin"].values, strict=True)
        for number, (parent, event) in enumerate(places):
            groups[f"branch_{number}"] = branches[int(parent), int(event)].dataset
    elif "parts" in groups[""].attrs:
        parts = {r.fields["part"]: r for r in records if r.kind == "part" and r.fields["key"] == key}
        groups |= {part: parts[part].dataset for part in str(groups[""].attrs["parts"]).splitlines()}
    result, details = from_datasets(groups, allow_code)
    assert not isinstance(result, TimeResult)
    return result, details


def _branches(records: Sequence[Record], key: str) -> dict[tuple[int, int], Record]:
    return {
        (record.fields["parent"], record.fields["event"]): record
        for record in records
        if record.kind == "branch" and record.fields["key"] == key
    }


class BranchKeeper:
    """Keeps the branches of a diagram in the journal when they are complete, and knows those of an earlier run."""

    def __init__(self, journal: Journal, name: str, key: str, allow_code: bool) -> None:
        self.journal, self.name, self.key, self.allow_code = journal, name, key, allow_code
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
        place = {"name": self.name, "key": self.key, "parent": parent, "event": event}
        self.journal.append("branch", place, to_datasets(branch)[""])


class Noting:
    """A `progress=` that passes reports on and writes what there is so far to the journal now and then."""

    def __init__(self, journal: Journal, name: str, progress: Any) -> None:
        self.journal, self.name, self.progress = journal, name, progress
        self.since = perf_counter()
        self.points = self.events = 0

    def __call__(self, share: float, where: str) -> None:
        if self.progress is not None:
            self.progress(share, where)

    def followed(self, trace: Any) -> None:
        """Called at each point of a curve with what there is of it so far."""
        now = perf_counter()
        events = len(trace.bifurcations)
        if now - self.since < _OFTEN and events == self.events:
            return
        self.since = now
        points, located = trace.points[self.points :], trace.bifurcations[self.events :]
        fields = {
            "name": self.name,
            "from": self.points,
            "omega": [point.orbit.omega for point in points],
            "values": [dict(point.orbit.values) for point in points],
            "coefficients": [point.orbit.coefficients.tolist() for point in points],
            "stable": [bool(point.floquet.stable) for point in points],
            "bifurcations": [[b.kind, b.omega, dict(b.parameters), b.amplitude] for b in located],
        }
        self.points, self.events = len(trace.points), events
        self.journal.append("points", fields)


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


def recovered(path: str | Path) -> list[Recovered]:
    """What a journal holds, analysis by analysis."""
    analyses: dict[str, Recovered] = {}
    for record in read_journal(path):
        name = str(record.fields.get("name", ""))
        if record.kind not in ("points", "part", "branch", "analysis"):
            continue
        if record.kind == "part" and record.fields["part"].startswith("result"):
            continue  # of a table
        item = analyses.setdefault(name, Recovered(name))
        if record.kind == "points":
            if not record.fields["from"]:
                item = analyses[name] = Recovered(name)
            item.points += len(record.fields["omega"])
            item.events += [(kind, omega, amplitude) for kind, omega, _, amplitude in record.fields["bifurcations"]]
            item.bifurcations = len(item.events)
            continue
        sizes, whole = record.dataset.sizes, record.kind == "analysis"
        if whole:
            item.state = "finished"
            if record.dataset.attrs.get("contents") in ("diagram", "isolas"):
                continue
            item = analyses[name] = Recovered(name, "finished")
        else:
            item.branches = (item.branches or 0) + 1
        item.points += int(sizes.get("point", sizes.get("row", 0) if whole else 0))
        item.bifurcations += int(sizes.get("event", 0))
    return list(analyses.values())
