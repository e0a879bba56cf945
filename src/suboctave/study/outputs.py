"""What a study writes: results, tables, figures, a report page. The one place where studies meet pictures."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePath
from typing import Any

from pydantic import Field

from suboctave.atomic import free_place
from suboctave.errors import InputError, Key
from suboctave.maps.isolas.result import Isolas
from suboctave.pictures.paper import SUFFIXES
from suboctave.store.table import Table
from suboctave.study.figures import StudyCurves
from suboctave.study.mistakes import Section
from suboctave.study.results import Result, Results
from suboctave.study.steps import Step
from suboctave.study.steps.base import Complaint, Gives

#: bytes of a file name: disks take 255, and half a name more is needed while it is written
_LONGEST = 200


class Outputs(Section):
    """What is written into `folder` (default: the study's name with _results, beside the study file)."""

    folder: str | None = Field(default=None, min_length=1)
    results: str = "results.nc"
    csv: bool = False
    html: str | None = None
    figures: list[Any] = Field(default_factory=list)


def check_outputs(outputs: Outputs, study: StudyCurves) -> Iterator[Complaint]:
    """What is wrong with the outputs, before any work: key and message."""
    tables = csv_names(study.steps.values()) if outputs.csv else []
    names: list[tuple[Key, str, Sequence[str]]] = [(("results",), outputs.results, (".nc",))]
    if outputs.html is not None:
        names.append((("html",), outputs.html, (".html", ".htm")))
    for index, figure in enumerate(outputs.figures):
        if figure is None:  # what is wrong in it is told already
            continue
        names.append((("figures", index, "file"), figure.file, SUFFIXES))
        yield from ((("figures", index, *where), text) for where, text in figure.check(study))
    seen = set(tables)
    if len(seen) < len(tables):
        yield ("csv",), "two analyses would write the same table: rename the one that ends in _bifurcations"
    if outputs.folder is not None and not outputs.folder.isprintable():
        yield ("folder",), f"{outputs.folder!r} has characters that no name has"
    for place, name, suffixes in names:
        if PurePath(name).suffix.lower() not in suffixes:
            yield place, f"{name!r} must end in {' or '.join(suffixes)}"
        if PurePath(name).name != name or name in (".", ".."):
            yield place, f"{name!r} is a name inside the folder of the outputs, without slashes"
        elif not name.isprintable():
            yield place, f"{name!r} has characters that no name has"
        elif len(os.fsencode(name)) > _LONGEST:
            yield place, f"a name of {len(name)} characters is too long for a file: at most {_LONGEST}"
        elif name in seen:
            yield place, f"{name!r} is written twice: choose another name"
        seen.add(name)


#: the tables of what an analysis gives: how the name of each ends, after the mark what `to_csv` is asked for
_TABLES: dict[Gives, tuple[str, ...]] = {
    "table": ("",),
    "branch": ("", "_bifurcations"),
    "diagram": ("", "_bifurcations"),
    "isolas": ("", "_points", "_bifurcations"),
}


def csv_names(steps: Iterable[Step]) -> list[str]:
    """The names of the tables that `csv = true` writes."""
    return [f"{step.name}{ending}.csv" for step in steps for ending in _TABLES[step.gives]]


def places(outputs: Outputs, steps: Iterable[Step], folder: Path) -> list[Path]:
    """Every file that the study will write."""
    names = [outputs.results, *(figure.file for figure in outputs.figures)]
    names += csv_names(steps) if outputs.csv else []
    names += [outputs.html] if outputs.html else []
    return [folder / name for name in names]


def write_outputs(
    outputs: Outputs,
    results: Results,
    folder: Path,
    title: str,
    left: Sequence[Path] = (),
    failures: Mapping[str, str] | None = None,
) -> Iterator[Path]:
    """Write what was asked for of what there is, and yield each file; what stood there is replaced, or `left`.

    `failures`: the analyses that gave nothing, and why: the page says so.

    Raises InputError, after everything else is written, for figures of motions or branches that finished analyses lack.
    """
    if folder / outputs.results not in left:
        yield results.save(folder / outputs.results, overwrite=True)
    if outputs.csv:
        for name, item in results.items():
            for path, write in tables_of(name, item, folder):
                if path not in left:
                    yield write(free_place(path, True), overwrite=True)
    missing = []
    for index, figure in enumerate(outputs.figures):
        path = folder / figure.file
        if path in left:
            continue
        try:
            if figure.draw(results, path):
                yield path
        except InputError as error:
            missing.append(f"outputs.figures[{index}] is not drawn: {error}")
    path = folder / (outputs.html or "")
    if outputs.html is not None and path not in left and len(results):
        from suboctave.pictures.report import write_report

        write_report(results, path, title=title or "Study", overwrite=True, failures=failures)
        yield path
    if missing:
        rest = "everything else is written; change the figure, and go on with --resume"
        raise InputError("; ".join([*missing, rest]))


def tables_of(name: str, item: Result, folder: Path) -> Iterator[tuple[Path, Callable[..., Path]]]:
    """The tables of a result: where each goes, and what writes it."""
    gives: Gives = "isolas" if isinstance(item, Isolas) else "table" if isinstance(item, Table) else "branch"
    for ending in _TABLES[gives]:
        asked: dict[str, Any] = {"what": ending[1:]} if ending else {}
        yield folder / f"{name}{ending}.csv", partial(item.to_csv, **asked)


def make_folder(folder: Path) -> None:
    """Make a folder that files are written into; InputError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {folder} cannot be made: {error.strerror}; write elsewhere with --out") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"the folder {folder} is not writable: write elsewhere with --out")


def write_tables(results: Results, folder: Path, overwrite: bool) -> list[Path]:
    """All tables of some results, into a folder that is made; InputError where one exists and is not to be replaced."""
    make_folder(folder)
    jobs = [job for name, item in results.items() for job in tables_of(name, item, folder)]
    for path, _ in jobs:
        free_place(path, overwrite)
    return [write(path, overwrite=overwrite) for path, write in jobs]
