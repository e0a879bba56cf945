"""What a study writes: results, tables, figures, a report page. The one place where studies meet pictures."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePath
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from suboctave.atomic import free_place
from suboctave.errors import InputError, Key
from suboctave.maps.isolas.result import Isolas
from suboctave.pictures.paper import SUFFIXES
from suboctave.pictures.style import checked_text
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.study.figures import StudyCurves, drawable
from suboctave.study.results import Result, Results
from suboctave.study.steps import Step
from suboctave.study.steps.base import Complaint, tried

_STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
#: bytes of a file name: disks take 255, and half a name more is needed while it is written
_LONGEST = 200


class Outputs(BaseModel):
    """What is written into `folder` (default: the study's name with _results, beside the study file)."""

    model_config = _STRICT

    folder: str | None = Field(default=None, min_length=1)
    results: str = "results.nc"
    csv: bool = False
    html: str | None = None
    figures: list[Any] = Field(default_factory=list)


def check_outputs(outputs: Outputs, study: StudyCurves) -> Iterator[Complaint]:
    """What is wrong with the outputs, before any work: key and message."""
    steps = list(study.steps.values())
    names: list[tuple[Key, str, Sequence[str]]] = [(("results",), outputs.results, (".nc",))]
    if outputs.html is not None:
        names.append((("html",), outputs.html, (".html", ".htm")))
    for index, figure in enumerate(outputs.figures):
        key = ("figures", index)
        names.append(((*key, "file"), figure.file, SUFFIXES))
        for where, text in figure.texts:
            yield from (((*key, *where), why) for _, why in tried("", partial(checked_text, text)))
        yield from (((*key, *where), text) for where, text in figure.check(study))
    seen: dict[str, str] = dict.fromkeys(csv_names(steps) if outputs.csv else (), "csv")
    if outputs.csv and len(seen) < len(csv_names(steps)):
        yield ("csv",), "two analyses would write the same table: rename the one that ends in _bifurcations"
    if outputs.folder is not None and not _printable(outputs.folder):
        yield ("folder",), f"{outputs.folder!r} has characters that no name has"
    for place, name, suffixes in names:
        if PurePath(name).suffix.lower() not in suffixes:
            yield place, f"{name!r} must end in {' or '.join(suffixes)}"
        if PurePath(name).name != name or name in (".", ".."):
            yield place, f"{name!r} is a name inside the folder of the outputs, without slashes"
        elif not _printable(name):
            yield place, f"{name!r} has characters that no name has"
        elif len(os.fsencode(name)) > _LONGEST:
            yield place, f"a name of {len(name)} characters is too long for a file: at most {_LONGEST}"
        elif name in seen:
            yield place, f"{name!r} is written twice: choose another name"
        seen[name] = name


def _printable(name: str) -> bool:
    return all(character.isprintable() for character in name)


def csv_names(steps: Sequence[Step]) -> list[str]:
    """The names of the tables that `csv = true` writes."""
    names = []
    for step in steps:
        names.append(f"{step.name}.csv")
        if step.gives == "isolas":
            names.append(f"{step.name}_points.csv")
        if step.gives != "table":
            names.append(f"{step.name}_bifurcations.csv")
    return names


def places(outputs: Outputs, steps: Sequence[Step], folder: Path) -> list[Path]:
    """Every file that the study will write."""
    names = [outputs.results, *(figure.file for figure in outputs.figures)]
    names += csv_names(steps) if outputs.csv else []
    names += [outputs.html] if outputs.html else []
    return [folder / name for name in names]


def write_outputs(
    outputs: Outputs, results: Results, folder: Path, title: str, left: Sequence[Path] = ()
) -> Iterator[Path]:
    """Write what was asked for of what there is, and yield each file; what stood there is replaced, or `left`.

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
    if outputs.html is not None and path not in left and any(drawable(item) for item in results.values()):
        from suboctave.pictures.report import write_report

        # of isolas that none was found is said
        worth = {name: item for name, item in results.items() if isinstance(item, Isolas) or len(item)}
        shown = {name: _shown(item, results.details.get(name, {})) for name, item in worth.items()}
        write_report(shown, path, title=title or "Study", overwrite=True)
        yield path
    if missing:
        rest = "everything else is written; change the figure, and go on with --resume"
        raise InputError("; ".join([*missing, rest]))


def _shown(item: Result, details: Mapping[str, Any]) -> Any:
    """What the report page is told of a result."""
    if isinstance(item, BifurcationDiagram | Isolas):
        return item
    return item.to_xarray().assign_attrs(seconds=details.get("seconds", float("nan")))


def tables_of(name: str, item: Result, folder: Path) -> Iterator[tuple[Path, Callable[..., Path]]]:
    """The tables of a result: where each goes, and what writes it."""
    yield folder / f"{name}.csv", item.to_csv
    if isinstance(item, Isolas):
        yield folder / f"{name}_points.csv", partial(item.to_csv, what="points")
    if isinstance(item, Branch | BifurcationDiagram | Isolas):
        yield folder / f"{name}_bifurcations.csv", partial(item.to_csv, what="bifurcations")


def write_tables(results: Results, folder: Path, overwrite: bool) -> list[Path]:
    """All tables of some results, into a folder that is made; InputError where one exists and is not to be replaced."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {folder} cannot be made: {error.strerror}") from None
    jobs = [job for name, item in results.items() for job in tables_of(name, item, folder)]
    for path, _ in jobs:
        free_place(path, overwrite)
    return [write(path, overwrite=overwrite) for path, write in jobs]
