"""Runs a study: analyses in order, each kept in the journal when it is there, results and pictures at the end.

A run that was killed left its journal: `resume` takes the finished analyses from it and goes on. An analysis is taken
over only if version, system, its arguments and those of the analyses it starts from are the same.

Records of the journal: "points" holds what is new on a curve that is being followed, "branch" a branch of a diagram
that is under way, named by the number of its parent and the bifurcation that it leaves at, "analysis" a finished one.
The branches of a finished diagram are those records; its own holds the tree. Before the record of finished isolas stand
those of their curves and closed branches, "part"; before that of a table those of the result that it was taken from.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from suboctave.analysis.diagram import Keeper
from suboctave.curves.trace import Trace
from suboctave.errors import ConvergenceError, FunctionError, InputError, TimeLimitError
from suboctave.experiments.common import TimeResult
from suboctave.interruption import Interruption, check_seconds, time_limit
from suboctave.kinds import plane_of_curve
from suboctave.maps.isolas.result import Isolas
from suboctave.results.branch import Branch
from suboctave.store.journal import Journal, read_journal
from suboctave.store.registry import from_datasets, to_datasets
from suboctave.store.table import Table
from suboctave.study.file import Study
from suboctave.study.outputs import make_folder, places, write_outputs
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

    `complete`: the results file of a study that was complete already; `left`: outputs that stood there and were left;
    `results`: of all analyses, by name.
    """

    finished: list[Finished] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    interruption: Interruption | None = None
    complete: Path | None = None
    left: list[Path] = field(default_factory=list)
    results: dict[str, Result] = field(default_factory=dict)

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C or a time limit left something to go on with."""
        return self.interruption is not None

    @property
    def failed(self) -> list[Finished]:
        """The analyses that failed."""
        return [item for item in self.finished if item.failure]

    @property
    def failures(self) -> dict[str, str]:
        """The analyses that failed, and why."""
        return {item.step.name: item.failure for item in self.failed}


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
        journal.append("run", {"study": study.text, "title": study.title, "source": study.called})
        with time_limit(seconds) as limit:
            for step in study.steps:
                whole = unfinished.isdisjoint(name for _, name in step.needs())
                done = _one(study, step, results, journal, watch, whole)
                if done.interruption is not None or done.failure or not whole:
                    unfinished.add(step.name)
                if done.result is not None:
                    results[step.name] = done.result
                    details[step.name] = {
                        "type": step.kind,
                        "seconds": done.seconds,
                        "key": "" if step.name in unfinished else study.keys[step.name],
                        "arguments": step.model_dump_json(exclude_defaults=True),
                    }
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
            outcome.results = results
            outcome.files = _written(study, results, details, place, failures=outcome.failures)
        if not (outcome.interrupted or outcome.failed):  # else --resume goes on from here
            journal.remove()
    return outcome


def _prepare(place: Path, targets: list[Path], journal: Path, overwrite: bool, resume: bool) -> None:
    """Make the folder and refuse what must not be overwritten, before any work."""
    make_folder(place)
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


def _written(
    study: Study,
    results: dict[str, Result],
    details: dict[str, Any],
    place: Path,
    left: Sequence[Path] = (),
    failures: dict[str, str] | None = None,
) -> list[Path]:
    """The files that are written of results; those in `left` are not."""
    attributes = {"title": study.title, "study": study.text, "analyses": "\n".join(results)}
    whole = Results(results, attributes, details)
    return list(write_outputs(study.outputs, whole, place, study.title, left, failures))


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
    items = {name: results[name] for name in names}
    finished = [
        Finished(step, results[step.name], float(details[step.name].get("seconds", 0.0)), True) for step in study.steps
    ]
    left = [] if overwrite else [target for target in targets if target.exists()]
    if len(left) < len(targets):
        make_folder(place)
    files = _written(study, items, details, place, left)
    return Outcome(finished, files, complete=path, left=left, results=items)


def _one(
    study: Study, step: Step, results: dict[str, Result], journal: Journal, watch: Watch | None, whole: bool
) -> Finished:
    """What came of one analysis; `whole`: what it starts from is complete, and so it may be kept as complete."""
    noted = Noting(journal, step.name, study.keys[step.name], study.allow_code)
    if whole and (kept := noted.finished()) is not None:
        result, attributes = kept
        return Finished(step, result, float(attributes.get("seconds", 0.0)), reused=True)
    with nullcontext() if watch is None else watch(step) as progress:
        noted.progress = progress
        done = analysed(study, step, results, noted, noted if whole else None)
    if done.result is not None and done.interruption is None and not done.failure and whole:
        noted.finish(done.result, done.seconds)
    return done


def analysed(
    study: Study, step: Step, results: Mapping[str, Result], progress: Any = None, keeper: Keeper | None = None
) -> Finished:
    """Run one analysis, which starts from the results of others: what comes of it, failures in words."""
    missing = [name for _, name in step.needs() if name not in results]
    if missing:
        return Finished(step, None, 0.0, failure=f"it starts from {missing[0]!r}, which gave nothing")
    begin = perf_counter()
    interruption: Interruption | None = None
    outcome: Result | None = None
    failure, wrong = "", False
    try:
        system = study.system.with_parameters(step.parameters) if step.parameters else study.system
        with time_limit(step.seconds):
            outcome = step.run(Context(system, results, progress, study.allow_code, keeper))
    except KeyboardInterrupt as cause:
        interruption = Interruption.of(cause)
    except TimeLimitError as error:
        failure, interruption = str(error), Interruption(step.seconds)
    except FunctionError as error:
        failure = str(error)
        # what else has a part only is no result that later analyses could start from
        outcome = error.result if isinstance(error.result, Branch) else None
    except (ConvergenceError, InputError) as error:
        failure, wrong = str(error), isinstance(error, InputError)
    except OverflowError as error:  # a size of 1e200 whose square is no number
        failure = f"the numbers grew too large ({error}): choose units in which they are nearer to 1"
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}, line {last.lineno}"
        failure = f"an unexpected error, please report it: {type(error).__name__}: {error} ({place})"
    if outcome is not None and not failure:
        interruption = interruption or outcome.interruption
    return Finished(step, outcome, perf_counter() - begin, False, failure, wrong, interruption)


# ------------------------------------------------------------------------------------------------------- the journal
class Noting:
    """What the journal holds of one analysis: points and branches as they come, and in the end all of it.

    It is the `progress=` of its verb, which passes reports on to `progress`, and what keeps the branches of a diagram
    (`suboctave.analysis.diagram.Keeper`).
    """

    def __init__(self, journal: Journal, name: str, key: str, allow_code: bool = False, progress: Any = None) -> None:
        self.journal, self.name, self.key, self.allow_code, self.progress = journal, name, key, allow_code, progress
        self.since = perf_counter()
        #: of the curve that is followed: itself, its number, its points and events that are written down
        self.trace: Trace | None = None
        self.number, self.points, self.events = -1, 0, 0
        self._own = [record for record in journal.records if record.fields.get("key") == key]
        self._branches = {(r.fields["parent"], r.fields["event"]): r for r in self._own if r.kind == "branch"}

    def finished(self) -> tuple[Result, dict[str, Any]] | None:
        """The analysis that an earlier run finished, and the attributes of its dataset; None if there is none."""
        heads = [record for record in self._own if record.kind == "analysis"]
        if not heads:
            return None
        groups: dict[str, xarray.Dataset] = {"": heads[-1].dataset}
        if groups[""].attrs.get("contents") == "diagram":
            places = zip(groups[""]["parent"].values, groups[""]["origin"].values, strict=True)
            for number, (parent, event) in enumerate(places):
                groups[f"branch_{number}"] = self._branches[int(parent), int(event)].dataset
        elif "parts" in groups[""].attrs:
            parts = {record.fields["part"]: record for record in self._own if record.kind == "part"}
            groups |= {part: parts[part].dataset for part in str(groups[""].attrs["parts"]).splitlines()}
        result, details = from_datasets(groups, self.allow_code)
        assert not isinstance(result, TimeResult)
        return result, details

    def finish(self, result: Result, seconds: float) -> None:
        """All of it, on the disk when this returns; the branches of a diagram are there already."""
        datasets = to_datasets(result, {"seconds": seconds})
        place = {"name": self.name, "key": self.key}
        parts = [part for part in datasets if part and isinstance(result, Isolas | Table)]
        entries = [("part", {**place, "part": part}, datasets[part]) for part in parts]
        self.journal.extend([*entries, ("analysis", place, datasets[""])])

    def known(self, parent: int, event: int) -> Branch | None:
        """A branch of a diagram that an earlier run kept."""
        record = self._branches.get((parent, event))
        branch: Branch | None = None if record is None else from_datasets({"": record.dataset}, self.allow_code)[0]
        return branch

    def keep(self, parent: int, event: int, branch: Branch) -> None:
        """A branch of a diagram that is complete."""
        place = {"name": self.name, "key": self.key, "parent": parent, "event": event}
        self.journal.append("branch", place, to_datasets(branch)[""])

    def __call__(self, share: float, where: str) -> None:
        if self.progress is not None:
            self.progress(share, where)

    def followed(self, trace: Trace) -> None:
        """Called at each point of a curve with what there is of it so far, which is written down now and then."""
        if trace is not self.trace:
            self._note()  # the rest of the curve before
            self.trace, self.number, self.points, self.events = trace, self.number + 1, 0, 0
        if perf_counter() - self.since >= _OFTEN or len(trace.bifurcations) != self.events:
            self._note()

    def _note(self) -> None:
        """Write down what is new of the curve that is followed."""
        trace = self.trace
        if trace is None or trace.of is None or len(trace.points) == self.points:
            return
        self.since = perf_counter()
        of, points, located = trace.of, trace.points[self.points :], trace.bifurcations[self.events :]
        fields = {
            "name": self.name,
            "curve": self.number,
            "from": self.points,
            "free": list(of.names),
            "kind": of.kind,
            "plane": plane_of_curve(of.kind, of.names, of.turning),
            "period": points[0].orbit.basis.nu,
            "omega": [point.orbit.omega for point in points],
            "values": [dict(point.orbit.values) for point in points],
            "amplitude": [point.orbit.amplitude(of.observe) for point in points],
            "stable": [bool(point.floquet.stable) for point in points],
            "arclength": [point.arclength for point in points],
            "bifurcations": [[b.kind, b.omega, dict(b.parameters), b.amplitude, b.arclength] for b in located],
        }
        self.points, self.events = len(trace.points), len(trace.bifurcations)
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
    #: points of the curves that are being followed, whose `events` are not among the bifurcations yet
    under_way: int = 0

    def over(self) -> None:
        """What is under way is complete, and counted by its record; or it is begun anew."""
        self.events, self.under_way = [], 0


def recovered(path: str | Path) -> list[Recovered]:
    """What a journal holds, analysis by analysis."""
    analyses: dict[str, Recovered] = {}
    for record in read_journal(path):
        kind, fields = record.kind, record.fields
        # parts of a table are what it was taken from
        if kind not in ("points", "part", "branch", "analysis") or fields.get("part", "").startswith("result"):
            continue
        name = str(fields["name"])
        item = analyses.setdefault(name, Recovered(name))
        if kind == "points":
            if not fields["from"] and not fields.get("curve"):
                item.over()
            item.under_way += len(fields["omega"])
            item.events += [(kind, omega, amplitude) for kind, omega, _, amplitude, _ in fields["bifurcations"]]
            continue
        item.over()
        sizes = record.dataset.sizes
        if kind != "analysis":
            item.branches = (item.branches or 0) + 1
        elif record.dataset.attrs.get("contents") in ("diagram", "isolas"):
            item.state = "finished"
            continue
        else:
            item = analyses[name] = Recovered(name, "finished")
        item.points += int(sizes.get("point", sizes.get("row", 0) if kind == "analysis" else 0))
        item.bifurcations += int(sizes.get("event", 0))
    for item in analyses.values():
        item.points += item.under_way
        item.bifurcations += len(item.events)
    return list(analyses.values())
