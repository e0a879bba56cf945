"""What a study writes: results, tables, figures, a report page. The one place where studies meet pictures."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path, PurePath
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from suboctave.analysis import BifurcationDiagram, Branch, Results
from suboctave.analysis.contacts import check_element, gapped_elements
from suboctave.analysis.junction import period_name
from suboctave.analysis.results import Result
from suboctave.bifurcation import KINDS
from suboctave.errors import InputError, suggest
from suboctave.model.system import System
from suboctave.pictures import View, plot_response
from suboctave.pictures.saving import SUFFIXES
from suboctave.pictures.style import check_text, size_in_inches
from suboctave.store import files
from suboctave.study.motion_figures import MotionFigure
from suboctave.study.steps import Step

__all__ = ["FigureSection", "Outputs", "check_outputs", "csv_names", "places", "write_outputs"]

_STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
#: bytes of a file name: disks take 255, and half a name more is needed while it is written
_LONGEST = 200
_REPORT = "suboctave.pictures.report"


class FigureSection(BaseModel):
    """One figure of response curves; the form follows the suffix of `file`, what is drawn the keys of `View`."""

    model_config = _STRICT

    kind: str = "response"
    file: str
    analyses: list[str] = Field(default_factory=list)
    x: str | None = None
    labels: list[str] | None = None
    title: str | None = None
    size: Any = (6.4, 4.2)
    quantity: str = "amplitude"
    harmonic: int | None = Field(default=None, ge=0)
    element: int | None = None
    dof: int | None = None
    frequency: str | None = None
    omega_reference: float | None = None
    scale: float | None = None
    unit: str | None = None
    xlabel: str | None = None
    ylabel: str | None = None
    xlim: list[float] | None = Field(default=None, min_length=2, max_length=2)
    ylim: list[float] | None = Field(default=None, min_length=2, max_length=2)
    marks: list[str] | None = None

    @property
    def view(self) -> View:
        """Quantity and units; InputError where they do not go together."""
        return View(**{field.name: getattr(self, field.name) for field in fields(View)})

    @property
    def texts(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """What is written on it, with the key of each."""
        for key in ("title", "unit", "xlabel", "ylabel"):
            if getattr(self, key) is not None:
                yield (key,), getattr(self, key)
        for i, label in enumerate(self.labels or ()):
            yield ("labels", i), label


class Outputs(BaseModel):
    """What is written into `folder` (default: the study's name with _results, beside the study file)."""

    model_config = _STRICT

    folder: str | None = Field(default=None, min_length=1)
    results: str = "results.nc"
    csv: bool = False
    html: str | None = None
    figures: list[Any] = Field(default_factory=list)


def check_outputs(
    outputs: Outputs, steps: Sequence[Step], system: System | None
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong with the outputs, before any work: key and message."""
    curves = [step.name for step in steps if step.gives_branch or step.gives_diagram]
    kinds = {step.name: type(step) for step in steps}
    names: list[tuple[tuple[str | int, ...], str]] = [(("results",), outputs.results)]
    yield from _wrong_suffix(("results",), outputs.results, (".nc",))
    if outputs.html is not None:
        names.append((("html",), outputs.html))
        yield from _wrong_suffix(("html",), outputs.html, (".html", ".htm"))
        if importlib.util.find_spec(_REPORT) is None:
            yield ("html",), "this version writes no report pages: leave it out"
    for index, figure in enumerate(outputs.figures):
        key = ("figures", index)
        names.append(((*key, "file"), figure.file))
        yield from _wrong_suffix((*key, "file"), figure.file, SUFFIXES)
        yield from _wrong_texts(figure, key)
        if isinstance(figure, MotionFigure):
            yield from (((*key, *where), text) for where, text in figure.check(kinds, system))
            continue
        for i, name in enumerate(figure.analyses):
            if name not in curves:
                yield (*key, "analyses", i), f"no analysis {name!r} gives a curve{suggest(name, curves)}"
        if not curves:
            yield key, "there is no analysis that gives a curve"
        known = ["omega", *(system.parameters if system else ())]
        if system is not None and figure.x is not None and figure.x not in known:
            yield (*key, "x"), f"neither omega nor a parameter{suggest(figure.x, known)}"
        drawn = len(figure.analyses or curves)
        if figure.labels is not None and len(figure.labels) != drawn:
            yield (*key, "labels"), f"{len(figure.labels)} labels for {drawn} curves"
        try:
            size_in_inches(figure.size)
        except InputError as error:
            yield (*key, "size"), str(error)
        events = [event.name for step in steps for event in getattr(step, "events", ())]
        for i, kind in enumerate(figure.marks or ()):
            if kind not in (*KINDS, *events):
                yield (*key, "marks", i), f"neither a kind nor an event{suggest(kind, [*KINDS, *events])}"
        try:
            view = figure.view
        except InputError as error:
            yield key, str(error)
        else:
            yield from _not_in(view, system, key)
    seen: dict[str, str] = dict.fromkeys(csv_names(steps) if outputs.csv else (), "csv")
    if outputs.csv and len(seen) < len(csv_names(steps)):
        yield ("csv",), "two analyses would write the same table: rename the one that ends in _bifurcations"
    if outputs.folder is not None and not _printable(outputs.folder):
        yield ("folder",), f"{outputs.folder!r} has characters that no name has"
    for place, name in names:
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


def _wrong_texts(
    figure: FigureSection | MotionFigure, key: tuple[str | int, ...]
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    for where, text in figure.texts:
        try:
            check_text(text)
        except InputError as error:
            yield (*key, *where), str(error)


def _not_in(
    view: View, system: System | None, key: tuple[str | int, ...]
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What a figure shows that the system does not have."""
    if system is None:
        return
    if view.dof is not None and not 0 <= view.dof < system.n:
        yield (*key, "dof"), f"dof={view.dof} is out of range: the system has {system.n}, numbered from 0"
    if view.element is not None:
        gapped = gapped_elements(system) if view.quantity in ("contact_share", "impacts") else None
        try:
            check_element(system, view.element, gapped)
        except InputError as error:
            yield (*key, "element"), str(error)
    loads = [c for c in system.load_components() if c.harmonic == 1 and c.direction.sum()]
    if view.quantity == "transmissibility" and not loads:
        yield (*key, "quantity"), "no force at harmonic 1 is applied, so that there is no transmissibility"


def _wrong_suffix(
    key: tuple[str | int, ...], name: str, suffixes: Sequence[str]
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    if PurePath(name).suffix.lower() not in suffixes:
        yield key, f"{name!r} must end in {' or '.join(suffixes)}"


def csv_names(steps: Sequence[Step]) -> list[str]:
    """The names of the tables that `csv = true` writes."""
    names = []
    for step in steps:
        names.append(f"{step.name}.csv")
        if step.gives_branch or step.gives_diagram:
            names.append(f"{step.name}_bifurcations.csv")
    return names


def places(outputs: Outputs, steps: Sequence[Step], folder: Path) -> list[Path]:
    """Every file that the study will write."""
    names = [outputs.results, *(figure.file for figure in outputs.figures)]
    names += csv_names(steps) if outputs.csv else []
    names += [outputs.html] if outputs.html else []
    return [folder / name for name in names]


def write_outputs(outputs: Outputs, results: Results, folder: Path, title: str) -> Iterator[Path]:
    """Write what was asked for of what there is, and yield each file; what stood there is replaced.

    Raises InputError, after everything else is written, for figures of motions that the finished branches do not have.
    """
    yield results.save(folder / outputs.results, overwrite=True)
    if outputs.csv:
        for name, item in results.items():
            yield from _tables(name, item, folder)
    curves = {name: found for name, item in results.items() if (found := _curves(item))}
    missing = []
    for index, figure in enumerate(outputs.figures):
        path = folder / figure.file
        if isinstance(figure, MotionFigure):
            try:
                if figure.draw(results, path):
                    yield path
            except InputError as error:
                missing.append(f"outputs.figures[{index}] is not drawn: {error}")
        elif _drawn(figure, results, curves, path):
            yield path
    if outputs.html is not None and curves:
        path = folder / outputs.html
        report: Any = importlib.import_module(_REPORT)
        shown = {name: _shown(item, results.details.get(name, {})) for name, item in results.items() if len(item)}
        report.write_report(shown, path, title=title or "Study", overwrite=True)
        yield path
    if missing:
        rest = "everything else is written; change the figure, and go on with --resume"
        raise InputError("; ".join([*missing, rest]))


def _curves(item: Result) -> list[Branch]:
    """The branches of a result that can be drawn."""
    if isinstance(item, BifurcationDiagram):
        return [branch for branch in item.branches if len(branch)]
    return [item] if isinstance(item, Branch) and len(item) else []


def _drawn(figure: FigureSection, results: Results, curves: Mapping[str, list[Branch]], path: Path) -> bool:
    """Draw a figure of curves; False where none of them is there."""
    chosen = [name for name in figure.analyses or curves if name in curves]
    if not chosen:
        return False
    labels: list[str] | None = None
    view = figure.view
    if len(chosen) == 1 and figure.marks is None and isinstance(diagram := results[chosen[0]], BifurcationDiagram):
        view = replace(view, marks=diagram.marks)
    if figure.labels is not None:
        every = figure.analyses or [name for name in results if name in curves]
        told = {name: figure.labels[every.index(name)] for name in chosen}
        labels = [label for name in chosen for label in _labels(results[name], curves[name], told[name])]
    elif len(chosen) == 1 and isinstance(diagram := results[chosen[0]], BifurcationDiagram):
        labels = diagram.legend
    readings = [] if view.variable == "amplitude" else [view.variable]
    drawn = [branch.to_xarray(readings=readings) for name in chosen for branch in curves[name]]
    plot_response(drawn, path, x=figure.x, labels=labels, title=figure.title, size=figure.size, view=view)
    return True


def _labels(item: Result, branches: Sequence[Branch], label: str) -> list[str]:
    """The label of a curve; those of a diagram's branches tell their periods, too."""
    if isinstance(item, BifurcationDiagram):
        return [f"{label}, {period_name(branch.nu)}" for branch in branches]
    return [label]


def _shown(item: Result, details: Mapping[str, Any]) -> Any:
    """What the report page is told of a result."""
    if isinstance(item, BifurcationDiagram):
        return item
    return item.to_xarray().assign_attrs(seconds=details.get("seconds", float("nan")))


def _tables(name: str, item: Result, folder: Path) -> Iterator[Path]:
    yield item.to_csv(files.free_place(folder / f"{name}.csv", True), overwrite=True)
    if isinstance(item, Branch | BifurcationDiagram):
        yield item.to_csv(folder / f"{name}_bifurcations.csv", "bifurcations", overwrite=True)
