"""`sweep`: runs a study at many values of its parameters, on all cores or a cluster, and can go on after a kill.

The journal beside the results holds every point that is computed, from the moment on at which it is. Records: "sweep"
says what is swept, "point" what came of a point.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, TypeAlias, Unpack

from suboctave.arguments import READ, Count, Index
from suboctave.atomic import free_place
from suboctave.errors import InputError, path_of, refuse_idle, shortened
from suboctave.interruption import Interruption, TimeLimitReached
from suboctave.model.inputs import check_count, timed
from suboctave.options import ParallelOptions, with_options
from suboctave.progress import Report, reporting
from suboctave.store.journal import Journal
from suboctave.study.file import Study, read_study
from suboctave.study.fingerprint import fingerprint
from suboctave.study.results import load
from suboctave.study.sweeps.gather import gathered
from suboctave.study.sweeps.plan import Plan, SweepSection, plan_of
from suboctave.study.sweeps.point import AtPoint, Measure
from suboctave.study.sweeps.result import Computed, Sweep
from suboctave.version import __version__
from suboctave.workers import Lost, check_workers, completed

#: the dimension along which the lists of an analysis lie, by what it gives
_LISTS = {"branch": "event", "diagram": "event", "isolas": "isola", "table": "row"}
#: how journals end
_SUFFIX = ".journal"


class SweepOptions(ParallelOptions, total=False):
    """Options of `sweep`."""

    draws: Annotated[Count | None, "How many points are drawn from the distributions."]
    seed: Annotated[int | None, "From which they are drawn (0)."]
    sampling: Annotated[str | None, 'How they are drawn: "random" (default), "latin hypercube" or "sobol".']
    measure: Annotated[
        Measure | None,
        "A function that is given the `Results` of each point at which nothing failed and gives `{name: number}`.",
    ]
    listed: Annotated[Index | None, "How many bifurcations of a kind, isolas or rows are listed (4); all are counted."]
    path: Annotated[
        str | Path | None,
        "Where the result is saved (.nc). Beside it a journal keeps each point as it is computed, until all are.",
    ]
    overwrite: Annotated[bool | None, "Replace what is there."]
    resume: Annotated[bool | None, "Go on with what an interrupted or killed sweep left at `path`."]
    scheduler: Annotated[
        str | None,
        'Address of a Dask scheduler whose workers compute instead, "tcp://host:8786" (extra `cluster`).',
    ]
    allow_code: Annotated[bool | None, "Import and call the Python code that the study file names."]


#: read by `plan_of`, which takes a pandas table too
Swept: TypeAlias = Annotated[Mapping[str, Any] | Sequence[Mapping[str, float]] | None, READ]


@with_options(SweepOptions)
@timed
def sweep(
    study: str | Path | Study,
    parameters: Swept = None,
    **options: Unpack[SweepOptions],
) -> Sweep:
    """Run a study at many values of its parameters: a grid, a list of points, or draws from distributions.

    What comes of a point depends on the study and the point alone: the numbers are the same bits for any number of
    workers, any order, and after any interruption. A point that fails is noted in words and costs no other. A time
    limit in the study holds for each point, `seconds` for the sweep.

    Parameters
    ----------
    study
        A study file, or a study that was read.
    parameters
        `{name: values}` for the grid of all combinations; values are a list, one number, or `{"from": 0.1, "to": 0.3,
        "count": 11, "spacing": "log"}` (default: linear). `{name: distribution}` for draws, such as `{"distribution":
        "normal", "mean": 0.5, "deviation": 0.02}`; uniform (low, high), loguniform (low, high), normal (mean,
        deviation), truncated normal (mean, deviation, low, high), lognormal (median, deviation of the logarithm),
        triangular (low, mode, high). `[{name: value, ...}, ...]`, or a pandas table, for a list of points. None: what
        the study's table [sweep] says, which also gives defaults of draws, seed, sampling and listed.
    """
    count = check_workers(options.get("workers"), options.get("scheduler"))
    measure, path = options.get("measure"), options.get("path")
    overwrite, resume = bool(options.get("overwrite")), bool(options.get("resume"))
    if path is None:
        refuse_idle("nothing is saved; give path=, or leave it out", overwrite=overwrite, resume=resume)
    if measure is not None and not callable(measure):
        raise InputError(f"measure is a function of the results of a point, not {shortened(measure)}")
    read = study if isinstance(study, Study) else read_study(study, bool(options.get("allow_code")))
    plan, listed = _asked(read, parameters, options)
    key = _key(read, plan, listed, measure)
    place = None if path is None else _free(path, overwrite, resume)
    if place is not None and resume and place.exists() and not _journal_of(place).exists():
        return _complete(place, key, read.allow_code)
    attributes: dict[str, Any] = {"title": read.title, "study": read.text, "listed": listed, "key": key}
    lists = {step.name: _LISTS[step.gives] for step in read.steps}
    with (
        reporting(options.get("progress"), read.title or "sweep") as report,
        _kept(place, key, overwrite, resume) as kept,
    ):
        how = (count, options.get("scheduler"), report)
        interruption = _compute(AtPoint(read, listed, measure), plan, kept, *how)
        result = gathered(plan, kept.computed, lists, listed, attributes, interruption)
        result.seconds = perf_counter() - kept.begin
        if place is not None:
            for torn in place.parent.glob(f".{place.name}-*.part"):  # half a file of a sweep that was killed
                torn.unlink(missing_ok=True)
            result.save(place, overwrite=True)
            if interruption is None:
                kept.remove()
    return result


def _asked(study: Study, parameters: Any, options: SweepOptions) -> tuple[Plan, int]:
    """The points, and how many items are listed: as given, else as the study says."""
    section = study.sweep
    if parameters is None and section is None:
        raise InputError(
            "what is swept over? Give parameters, or write a table [sweep] into the study file (docs/sweeps.md)"
        )
    draws = options.get("draws")
    if parameters is None and section is not None:
        parameters = section.parameters
        draws = section.draws if draws is None else draws
    default = section or SweepSection(parameters={})
    seed = default.seed if (given := options.get("seed")) is None else given
    sampling = options.get("sampling") or default.sampling
    listed = default.listed if (most := options.get("listed")) is None else most
    plan = plan_of(study.system, study.steps, parameters, draws, seed, sampling)
    if not plan.drawn:
        own = {name: options.get(name) is not None for name in ("seed", "sampling")}
        refuse_idle("no parameter has a distribution; leave it out", **own)
    return plan, check_count("listed", listed)


def _key(study: Study, plan: Plan, listed: int, measure: Measure | None) -> str:
    """What the numbers depend on, as a digest: a time limit too, for it makes points fail."""
    content = {
        "version": __version__,
        "analyses": list(study.keys.items()),
        "seconds": [study.seconds, *(step.seconds for step in study.steps)],
        "points": [plan.names, plan.origin, hashlib.sha256(plan.points.tobytes()).hexdigest()],
        "listed": listed,
        "measure": None if measure is None else fingerprint(measure),
    }
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


# -------------------------------------------------------------------------------------------------------- what is kept
@dataclass
class _Kept:
    """The points that are computed, and the journal that holds them, if there is one."""

    computed: dict[int, Computed] = field(default_factory=dict)
    journal: Journal | None = None
    begin: float = field(default_factory=perf_counter)

    def add(self, number: int, point: Computed) -> None:
        """One more, on the disk when this returns."""
        self.computed[number] = point
        if self.journal is not None:
            fields = {"point": number, "row": point.row, "failure": point.failure, "seconds": point.seconds}
            self.journal.append("point", fields)

    def remove(self) -> None:
        """All of it is in the results."""
        if self.journal is not None:
            self.journal.remove()


def _journal_of(place: Path) -> Path:
    return place.with_suffix(_SUFFIX)


def _free(path: str | Path, overwrite: bool, resume: bool) -> Path:
    """Where results go; InputError where something is there that is neither to be replaced nor gone on with."""
    place = path_of(path)
    if _journal_of(place).exists() and not (overwrite or resume):
        raise InputError(
            f"{_journal_of(place)} holds a sweep that did not finish: go on with it (resume=True, --resume), or start "
            "anew (overwrite=True, --overwrite)"
        )
    return free_place(place, overwrite or resume, (".nc",))


def _complete(place: Path, key: str, allow_code: bool) -> Sweep:
    """The results of a sweep that is complete; InputError if they are another one's."""
    there = load(place, allow_code=allow_code)
    if not isinstance(there, Sweep) or there.dataset.attrs.get("key") != key:
        raise InputError(
            f"there is nothing to resume: {place} holds the results of another sweep, or of this one before it was "
            "changed; overwrite=True (--overwrite) replaces it"
        )
    return there


@contextmanager
def _kept(place: Path | None, key: str, overwrite: bool, resume: bool) -> Iterator[_Kept]:
    """What an earlier run computed of the same sweep, and the journal for more."""
    if place is None:
        yield _Kept()
        return
    at = _journal_of(place)
    if at.exists() and overwrite and not resume:
        Journal.reopen(at).remove()
    with closing(Journal.reopen(at) if at.exists() else Journal.create(at)) as journal:
        records = journal.records
        heads = [record.fields.get("key") for record in records if record.kind == "sweep"]
        if any(head != key for head in heads) or (records and not heads):
            raise InputError(
                f"{at} holds another sweep, or this one before it was changed: overwrite=True (--overwrite) starts anew"
            )
        if not heads:
            journal.append("sweep", {"key": key})
        points = [record.fields for record in records if record.kind == "point"]
        computed = {int(f["point"]): Computed(f["row"], str(f["failure"]), float(f["seconds"])) for f in points}
        yield _Kept(computed, journal)


# ----------------------------------------------------------------------------------------------------------- computing
def _compute(
    at_point: AtPoint, plan: Plan, kept: _Kept, workers: int, scheduler: str | None, report: Report | None
) -> Interruption | None:
    """The points that are not computed yet; what stopped that before the end."""
    waiting = [number for number in range(len(plan)) if number not in kept.computed]
    before = len(kept.computed)
    tell = _Remaining(report, len(plan), before)
    tell(kept.computed)
    try:
        for index, result in completed(at_point, [plan.values(n) for n in waiting], workers, scheduler):
            point = Computed({}, result.words) if isinstance(result, Lost) else result
            kept.add(waiting[index], point)
            tell(kept.computed)
    except KeyboardInterrupt as cause:
        if not kept.computed:
            kept.remove()
            if isinstance(cause, TimeLimitReached):
                raise
            raise KeyboardInterrupt("before the first point was computed: nothing is kept") from None
        return Interruption.of(cause)
    return None


class _Remaining:
    """Reports how many points are computed, and how long the others will take at this pace."""

    def __init__(self, report: Report | None, whole: int, before: int) -> None:
        self.report, self.whole, self.before = report, whole, before
        self.begin = perf_counter()

    def __call__(self, computed: Mapping[int, Computed]) -> None:
        if self.report is None:
            return
        done = len(computed)
        failed = sum(bool(point.failure) for point in computed.values())
        text = f"{done} of {self.whole} points" + (f", {failed} with a failure" if failed else "")
        if self.before < done < self.whole:
            left = (perf_counter() - self.begin) / (done - self.before) * (self.whole - done)
            text += f", about {duration(left)} left"
        self.report(done / self.whole, text)


def duration(seconds: float) -> str:
    """A time as one reads it: 40 s, 12 min, 3.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
