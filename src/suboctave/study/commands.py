"""What the commands do: each prints for a reader, or one JSON object for a machine."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.experiments.time_result import TimeResult
from suboctave.interruption import Interruption
from suboctave.maps.isolas.region import IsolaMap
from suboctave.maps.isolas.result import Isola, Isolas, isola_row
from suboctave.maps.regimes.map import RegimeMap
from suboctave.progress import bar
from suboctave.results.diagram import BifurcationDiagram
from suboctave.store import files
from suboctave.store.table import Table
from suboctave.study.file import Study, read_study
from suboctave.study.outputs import tables_of
from suboctave.study.results import Result, Results, load
from suboctave.study.runner import JOURNAL, Finished, Outcome, recovered, run_study
from suboctave.study.screen import console, print_result, print_texts, significant
from suboctave.study.steps import Step

__all__ = ["check", "examples", "new", "run", "show"]

_TEMPLATES = Path(__file__).parent / "templates"


def examples() -> dict[str, str]:
    """The study files that `new` writes, by name, with the first line of each."""
    return {
        path.stem: path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
        for path in sorted(_TEMPLATES.glob("*.toml"))
    }


def new(path: Path, example: str, names: bool, overwrite: bool, as_json: bool) -> None:
    """Write an example, or name them all."""
    known = examples()
    if names:
        if as_json:
            _print_json({"ok": True, "examples": known})
            return
        print_texts(console(), ("example", "what it is"), list(known.items()), left=("example", "what it is"))
        return
    if example not in known:
        raise InputError(f"there is no example {example!r}{suggest(example, known)}")
    target = files.free_place(path, overwrite, (".toml",))
    text = (_TEMPLATES / f"{example}.toml").read_text(encoding="utf-8").replace("THIS_FILE", str(path))
    files.replace_file(target, lambda place: place.write_text(text, encoding="utf-8"))
    if as_json:
        _print_json({"ok": True, "file": str(target), "example": example})
    else:
        console().print(f"{target} is written; run it: suboctave run {target}", markup=False, soft_wrap=True)


def check(path: Path, allow_code: bool, as_json: bool) -> None:
    """Read a study; what is wrong is raised."""
    study = read_study(path, allow_code)
    if as_json:
        _print_json({"ok": True, "analyses": [step.name for step in study.steps], "mistakes": []})
    else:
        count = "1 analysis" if len(study.steps) == 1 else f"{len(study.steps)} analyses"
        console().print(f"{path} is in order: {count}, outputs in {study.folder}", markup=False, soft_wrap=True)


def run(
    path: Path,
    out: Path | None,
    overwrite: bool,
    resume: bool,
    allow_code: bool,
    as_json: bool,
    seconds: float | None = None,
) -> int:
    """Run a study and print what came of it; the exit status."""
    study = read_study(path, allow_code)
    screen = console(quiet=as_json)
    titles = [study.title] if study.title else []

    def watch(step: Step) -> AbstractContextManager[Any]:
        return bar(step.name)

    def report(item: Finished) -> None:
        while titles:  # above the first result: what is refused before any work has no title
            screen.print(titles.pop(), style="bold", markup=False)
        _print_finished(screen, item)

    outcome = run_study(study, out, overwrite, resume, watch, report, seconds)
    if outcome.complete is not None:
        screen.print(f"nothing to compute: {outcome.complete} is complete", markup=False, soft_wrap=True)
    elif outcome.files:
        screen.print()
    for file in outcome.files:
        screen.print(f"written: {file}", markup=False, soft_wrap=True)
    if others := [file.name for file in outcome.left if file != outcome.complete]:
        text = f"left as they are: {', '.join(others)} (--resume --overwrite writes them again)"
        screen.print(text, markup=False, soft_wrap=True)
    status = _status(outcome)
    if as_json:
        _print_json(_summary(outcome, status))
    elif outcome.interrupted:
        why = f"{outcome.interruption}; what was computed is kept"
        how = "Go on" if outcome.interruption == Interruption() else "Give more seconds, and go on"
        screen.print(f"{why}. {how}: suboctave run {path} --resume", markup=False)
    elif status:
        names = ", ".join(item.step.name for item in outcome.failed)
        screen.print(f"failed: {names}. Change the study, and go on with --resume", markup=False)
    return status


def _status(outcome: Outcome) -> int:
    if outcome.interruption == Interruption():
        return 130
    if outcome.interrupted:
        return 1
    if not outcome.failed:
        return 0
    return 2 if any(item.wrong_input for item in outcome.failed) else 1


def _print_finished(screen: Any, item: Finished) -> None:
    note = ", taken from the earlier run" if item.reused else f" in {item.seconds:.2f} s"
    if item.result is not None:
        print_result(screen, item.step.name, item.result, note)
    else:
        screen.print(f"\n{item.step.name}", style="bold", markup=False, end="")
        screen.print(f": failed. {item.failure}", markup=False)


def _summary(outcome: Outcome, status: int) -> dict[str, Any]:
    analyses = []
    for item in outcome.finished:
        entry: dict[str, Any] = {"name": item.step.name, "type": item.step.kind, "seconds": item.seconds}
        entry |= {"reused": item.reused, "failure": item.failure}
        if item.result is not None:
            entry |= _result(item.result)
        analyses.append(entry)
    return {
        "ok": status == 0,
        "status": status,
        "interrupted": outcome.interrupted,
        "analyses": analyses,
        "files": [str(file) for file in outcome.files],
        "left": [str(file) for file in outcome.left],
    }


def show(path: Path, csv: Path | None, overwrite: bool, allow_code: bool, as_json: bool) -> None:
    """Print a results file, a study file or a journal."""
    if path.is_dir():
        raise InputError(f"{path} is a folder; name the results file in it, or the study file")
    if path.suffix.lower() == ".toml":
        _no_csv(csv)
        _show_study(read_study(path, allow_code), as_json)
        return
    if path.suffix == Path(JOURNAL).suffix:
        _no_csv(csv)
        _show_journal(path, as_json)
        return
    loaded = load(path, allow_code=allow_code)
    single = loaded.to_table() if isinstance(loaded, TimeResult | IsolaMap | RegimeMap) else loaded
    results = single if isinstance(single, Results) else Results({path.stem: single})
    written = _csv(results, csv, overwrite) if csv is not None else []
    if as_json:
        listed = {name: _result(item) for name, item in results.items()}
        _print_json(
            {"ok": True, "attributes": dict(results.attributes), "analyses": listed, "files": [str(f) for f in written]}
        )
        return
    screen = console()
    if results.attributes.get("title"):
        screen.print(str(results.attributes["title"]), style="bold", markup=False)
    if "written" in results.attributes:
        origin = results.attributes
        screen.print(f"suboctave {origin.get('suboctave')}, {origin['written']}", markup=False)
    for name, item in results.items():
        seconds = results.details.get(name, {}).get("seconds")
        note = f" in {seconds:.2f} s" if seconds is not None else ""
        print_result(screen, name, item, note)
    for file in written:
        screen.print(f"written: {file}", markup=False, soft_wrap=True)


def _no_csv(csv: Path | None) -> None:
    if csv is not None:
        raise InputError("--csv writes the tables of a results file; this is none")


def _csv(results: Results, folder: Path, overwrite: bool) -> list[Path]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {folder} cannot be made: {error.strerror}") from None
    jobs = [job for name, item in results.items() for job in tables_of(name, item, folder)]
    for path, _ in jobs:
        files.free_place(path, overwrite)
    return [write(path, overwrite=overwrite) for path, write in jobs]


def _show_study(study: Study, as_json: bool) -> None:
    steps = [
        {"name": step.name, "type": step.kind, "arguments": json.loads(step.model_dump_json(exclude_unset=True))}
        for step in study.steps
    ]
    if as_json:
        _print_json(
            {
                "ok": True,
                "title": study.title,
                "system": repr(study.system),
                "analyses": steps,
                "out": str(study.folder),
            }
        )
        return
    screen = console()
    screen.print(study.title or study.source.name, style="bold", markup=False)
    screen.print(repr(study.system), markup=False)
    screen.print("\nanalyses", style="bold")
    for step in steps:
        arguments = {k: v for k, v in step["arguments"].items() if k not in ("name", "type")}
        listed = ", ".join(f"{name} = {_written(value)}" for name, value in arguments.items())
        screen.print(f"  {step['name']}: {step['type']}({listed})", markup=False)
    screen.print(f"\noutputs in {study.folder}", markup=False, soft_wrap=True)


def _written(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_written(v)}" for k, v in value.items() if v not in (None, 0)) + "}"
    return json.dumps(value)


def _show_journal(path: Path, as_json: bool) -> None:
    analyses = recovered(path)
    if as_json:
        _print_json({"ok": True, "analyses": [asdict(item) for item in analyses]})
        return
    screen = console()
    screen.print("the journal of a run that did not finish; `suboctave run ... --resume` goes on with it", markup=False)
    rows = [
        [item.name, item.state, str(item.points), str(item.bifurcations), str(item.branches or "")] for item in analyses
    ]
    names = ("analysis", "state", "points", "bifurcations", "branches")
    print_texts(screen, names, rows, left=("analysis", "state"))
    for item in analyses:
        if item.events:
            screen.print(f"{item.name}, so far", style="bold", markup=False)
            lines = [[kind, significant(omega, 9), significant(amplitude, 7)] for kind, omega, amplitude in item.events]
            print_texts(screen, ("kind", "omega", "max |x|"), lines, left=("kind",))


def _result(item: Result) -> dict[str, Any]:
    if isinstance(item, BifurcationDiagram):
        branches = []
        for node in item:
            parent = item.parent(node)
            place: dict[str, Any] = {"branch": node.number, "label": node.label, "depth": node.depth}
            place |= {"period": node.branch.nu, "parent": None if parent is None else parent.number}
            place["not_followed"] = [{"kind": b.kind, "omega": b.omega, "reason": why} for b, why in node.failures]
            branches.append(place | _result(node.branch))
        return {"stopped": item.stopped, "branches": branches}
    if isinstance(item, Isolas):
        isolas = [{k: _plain(v) for k, v in isola_row(isola).items()} | _closed(isola) for isola in item]
        counts = {"limit_points": len(item.limit_points), "doublings": len(item.doublings)}
        state = {"notes": list(item.notes), "interrupted": item.interrupted}
        return {"parameter": item.parameter, "said": item.summary, "isolas": isolas} | counts | state
    if isinstance(item, Table):
        return {"title": item.title, "rows": len(item), "columns": {n: _listed(c) for n, c in item.columns.items()}}
    events = item.bifurcations_frame().to_dict("records")
    values = item.parameter(item.name)
    return {
        "points": len(item),
        "unstable": int(np.count_nonzero(~item.stable)) if len(item) else 0,
        "along": item.name,
        "from": float(values[0]) if len(item) else None,
        "to": float(values[-1]) if len(item) else None,
        "closed": bool(item.closed),
        "ended": item.ended,
        "warnings": list(item.warnings),
        "bifurcations": [{str(k): _plain(v) for k, v in event.items()} for event in events],
    }


def _closed(isola: Isola) -> dict[str, Any]:
    """The closed branches of an isola that are known."""
    return {"closed": [{"at": value} | _result(branch) for value, branch in isola.known.items()]}


def _listed(column: np.ndarray) -> list[Any]:
    return [_plain(value) for value in column]


def _plain(value: Any) -> Any:
    if isinstance(value, complex | np.complexfloating):
        return [_plain(value.real), _plain(value.imag)]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _print_json(content: dict[str, Any]) -> None:
    print(json.dumps(content, ensure_ascii=False, allow_nan=False, default=_plain))
