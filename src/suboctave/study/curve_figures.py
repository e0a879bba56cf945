"""Figures of curves in study files: responses, boundaries in the plane of two parameters, both together in space."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from suboctave.analysis import BifurcationDiagram, Branch, Isolas
from suboctave.analysis.contacts import check_element, gapped_elements
from suboctave.analysis.junction import period_name
from suboctave.analysis.results import Result
from suboctave.bifurcation import KINDS
from suboctave.errors import InputError, suggest
from suboctave.model.system import System
from suboctave.pictures import View, plot_boundaries, plot_response, plot_space
from suboctave.pictures.regions import is_isolas
from suboctave.pictures.style import size_in_inches
from suboctave.pictures.view import as_multiple
from suboctave.study.steps.base import Complaint

__all__ = ["CURVE_FIGURES", "BoundaryFigure", "CurveFigure", "FigureSection", "SpaceFigure", "drawable"]

_VIEW = [field.name for field in fields(View)]
#: the curves that a study gives, by name, with the two parameters in which bifurcations were tracked or isolas looked
#: for, else None
Drawable = Mapping[str, tuple[str, str] | None]


class CurveFigure(BaseModel):
    """One figure of curves; the form follows the suffix of `file`, what is drawn the keys of `View`."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    kind: str
    file: str
    analyses: list[str] = Field(default_factory=list)
    x: str | None = None
    title: str | None = None
    size: Any = (6.4, 4.2)
    quantity: str = "amplitude"
    harmonic: float | None = None
    element: int | None = None
    dof: int | None = None
    frequency: str | None = None
    omega_reference: float | None = None
    scale: float | None = None
    unit: str | None = None
    xlabel: str | None = None
    ylabel: str | None = None

    @field_validator("harmonic", mode="before")
    @classmethod
    def _multiple(cls, given: Any) -> Any:
        """A number, or a fraction as text: "1/3"."""
        return None if given is None else as_multiple(given)

    @property
    def view(self) -> View:
        """Quantity and units; InputError where they do not go together."""
        given: dict[str, Any] = {name: getattr(self, name, None) for name in _VIEW}
        if self.harmonic is not None and "quantity" not in self.model_fields_set:  # as `suboctave.plot`
            given["quantity"] = "harmonic"
        return View(**given)

    @property
    def texts(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """What is written on it, with the key of each."""
        for key in ("title", "unit", "xlabel", "ylabel", "zlabel"):
            if getattr(self, key, None) is not None:
                yield (key,), getattr(self, key)
        for i, label in enumerate(getattr(self, "labels", None) or ()):
            yield ("labels", i), label

    def drawn(self, names: Drawable) -> list[str]:
        """The analyses that it shows."""
        return self.analyses or list(names)

    def check(
        self, curves: Drawable, system: System | None, events: Sequence[str] = (), isolas: Sequence[str] = ()
    ) -> Iterator[Complaint]:
        """What is wrong with it, before any work; `isolas`: the analyses that look for these."""
        for i, name in enumerate(self.analyses):
            if name not in curves:
                yield ("analyses", i), f"no analysis {name!r} gives a curve{suggest(name, curves)}"
        if not curves:
            yield (), "there is no analysis that gives a curve"
        known = ["omega", *(system.parameters if system else ())]
        for key in ("x", "y"):
            given = getattr(self, key, None)
            if system is not None and given is not None and given not in known:
                yield (key,), f"neither omega nor a parameter{suggest(given, known)}"
        labels, drawn = getattr(self, "labels", None), len(self.drawn(curves))
        if labels is not None and len(labels) != drawn:
            yield ("labels",), f"{len(labels)} labels for {drawn} curves"
        try:
            size_in_inches(self.size)
        except InputError as error:
            yield ("size",), str(error)
        known = [*KINDS, *events]
        for i, kind in enumerate(getattr(self, "marks", None) or ()):
            if kind not in known:
                yield ("marks", i), f"neither a kind nor an event{suggest(kind, known)}"
        try:
            view = self.view
        except InputError as error:
            yield (), str(error)
        else:
            yield from _not_in(view, system)

    def draw(self, results: Mapping[str, Result], path: Path) -> bool:
        """Draw it; False where no analysis that it shows gave anything."""
        curves = {name: item for name, item in results.items() if drawable(item)}
        planes = {name: getattr(item, "plane", None) for name, item in results.items() if _is_curve(item)}
        every = self.drawn(planes)
        there = [name for name in every if name in curves]
        if not there:
            return False
        view = self.view
        labels: Sequence[str] | None = None
        alone = results[there[0]] if len(there) == 1 else None
        given: list[str] | None = getattr(self, "labels", None)
        if given is not None:
            told = {name: given[every.index(name)] for name in there}
            labels = [label for name in there for label in self._labels(results[name], told[name])]
        elif isinstance(alone, BifurcationDiagram):
            labels = alone.legend
        if isinstance(alone, BifurcationDiagram) and view.marks is None:
            view = replace(view, marks=alone.marks)
        datasets = [dataset for name in there for dataset in self.datasets(results[name], view)]
        if not datasets:
            return False
        drawn = iter(view.completed([dataset for dataset in datasets if not is_isolas(dataset)]))
        self.drawing([data if is_isolas(data) else next(drawn) for data in datasets], path, labels, view)
        return True

    def datasets(self, item: Result, view: View) -> list[Any]:
        """What of a result is drawn."""
        if isinstance(item, Isolas):
            return self.of_isolas(item.to_xarray(readings=view.readings(0)))
        return [branch.to_xarray(readings=view.readings(branch.nu)) for branch in _branches_of(item)]

    def of_isolas(self, datasets: Mapping[str, Any]) -> list[Any]:
        """What of isolas is drawn: everything."""
        return list(datasets.values())

    def _labels(self, item: Result, label: str) -> list[str]:
        """The label of a curve; those of a diagram's branches tell their periods, those of isolas what they are."""
        if isinstance(item, BifurcationDiagram):
            return [f"{label}, {period_name(branch.nu)}" for branch in _branches_of(item)]
        if isinstance(item, Isolas):
            names = item.to_xarray()
            shown = [id(dataset) for dataset in self.of_isolas(names)]
            told = [name.split(": ")[-1] for name, dataset in names.items() if id(dataset) in shown]
            return [f"{label}, {name}" for name in told if name != "isolas"]
        return [label]

    def drawing(self, datasets: list[Any], path: Path, labels: Sequence[str] | None, view: View) -> None:
        """Draw the datasets of its curves."""
        raise TypeError(f"{type(self).__name__} does not say how it is drawn")


def drawable(item: Result) -> bool:
    """Whether there is something of a result to draw."""
    if isinstance(item, Isolas):
        return bool(item.limit_points or item.doublings)
    return bool(_branches_of(item))


def _branches_of(item: Result) -> list[Branch]:
    """The branches of a curve or a diagram that can be drawn."""
    if isinstance(item, BifurcationDiagram):
        return [branch for branch in item.branches if len(branch)]
    return [item] if isinstance(item, Branch) and len(item) else []


def _is_curve(item: Result) -> bool:
    return isinstance(item, Branch | BifurcationDiagram | Isolas)


class FigureSection(CurveFigure):
    """Response curves. Curves of bifurcations are drawn among them where `x` is given and they are named.

    Of isolas that are named the closed branches known are drawn, or those at the values `at`.
    """

    kind: str = "response"
    labels: list[str] | None = None
    xlim: list[float] | None = Field(default=None, min_length=2, max_length=2)
    ylim: list[float] | None = Field(default=None, min_length=2, max_length=2)
    marks: list[str] | None = None
    at: list[float] | None = None

    def drawn(self, names: Drawable) -> list[str]:
        """The analyses that it shows: all that are no curves of bifurcations, unless told."""
        return self.analyses or [name for name, plane in names.items() if plane is None] or list(names)

    def of_isolas(self, datasets: Mapping[str, Any]) -> list[Any]:
        """See `CurveFigure.of_isolas`."""
        closed = [dataset for dataset in datasets.values() if "isola" in dataset.attrs]
        return _at(self.at, closed, datasets["isolas"].attrs["isolas"])

    def check(
        self, curves: Drawable, system: System | None, events: Sequence[str] = (), isolas: Sequence[str] = ()
    ) -> Iterator[Complaint]:
        """What is wrong with it, before any work."""
        yield from super().check(curves, system, events, isolas)
        for i, name in enumerate(self.analyses):
            if curves.get(name) is not None and self.x is None and name not in isolas:
                yield ("analyses", i), f'{name!r} is a curve of bifurcations: kind = "boundary" draws it, or give x'

    def drawing(self, datasets: list[Any], path: Path, labels: Sequence[str] | None, view: View) -> None:
        """See `CurveFigure.drawing`."""
        plot_response(datasets, path, x=self.x, labels=labels, title=self.title, size=self.size, view=view)


class BoundaryFigure(CurveFigure):
    """Curves of bifurcations and regions of isolas in the plane of two parameters; with a `quantity`, this upwards."""

    kind: Literal["boundary"]
    y: str | None = None
    labels: list[str] | None = None
    xlim: list[float] | None = Field(default=None, min_length=2, max_length=2)
    ylim: list[float] | None = Field(default=None, min_length=2, max_length=2)
    marks: list[str] | None = None

    @property
    def projected(self) -> bool:
        """Whether a quantity is drawn upwards."""
        return "quantity" in self.model_fields_set or self.harmonic is not None

    def drawn(self, names: Drawable) -> list[str]:
        """The analyses that it shows: all curves of bifurcations, unless told."""
        return self.analyses or [name for name, plane in names.items() if plane is not None]

    def check(
        self, curves: Drawable, system: System | None, events: Sequence[str] = (), isolas: Sequence[str] = ()
    ) -> Iterator[Complaint]:
        """What is wrong with it, before any work."""
        yield from super().check(curves, system, events, isolas)
        tracked = [name for name, plane in curves.items() if plane is not None]
        if curves and not tracked:
            yield (), "there is no analysis of the type 'track' or 'find_isolas', whose curves it would show"
        for i, name in enumerate(self.analyses):
            if name in curves and curves[name] is None:
                yield ("analyses", i), f"{name!r} is no curve of bifurcations{suggest(name, tracked)}"
        planes = {curves[name] for name in self.drawn(curves) if curves.get(name) is not None}
        if self.projected and self.y is not None:
            yield ("y",), "is a parameter; with a quantity that is what is drawn upwards: leave one of them out"
        if len(planes) > 1 and (self.x is None or (self.y is None and not self.projected)):
            yield (), "the curves are tracked in different parameters: choose x and y, or fewer analyses"
        yield from _same(self.x, self.y)
        if len(planes) == 1 and (self.x is None) != (self.y is None) and not self.projected:
            key, given = ("x", self.x) if self.x is not None else ("y", self.y)
            (plane,) = planes
            if plane is not None and given not in plane:
                yield (key,), f"is not free on these curves{suggest(str(given), plane)}; else give x and y"

    def of_isolas(self, datasets: Mapping[str, Any]) -> list[Any]:
        """See `CurveFigure.of_isolas`."""
        return [dataset for dataset in datasets.values() if "isola" not in dataset.attrs]

    def drawing(self, datasets: list[Any], path: Path, labels: Sequence[str] | None, view: View) -> None:
        """See `CurveFigure.drawing`."""
        axes: dict[str, Any] = {"x": self.x, "y": self.y, "projected": self.projected}
        plot_boundaries(datasets, path, **axes, labels=labels, title=self.title, size=self.size, view=view)


class SpaceFigure(CurveFigure):
    """Response curves at several values of a parameter, and curves of bifurcations through them, in space.

    Of isolas the closed branches known are drawn, or those at the values `at`.
    """

    kind: Literal["space"]
    y: str | None = None
    size: Any = (6.4, 5.0)
    zlabel: str | None = None
    elevation: float = 24.0
    azimuth: float = -58.0
    at: list[float] | None = None

    def of_isolas(self, datasets: Mapping[str, Any]) -> list[Any]:
        """See `CurveFigure.of_isolas`."""
        closed = [dataset for dataset in datasets.values() if "isola" in dataset.attrs]
        others = [dataset for dataset in datasets.values() if "isola" not in dataset.attrs]
        return others + _at(self.at, closed, datasets["isolas"].attrs["isolas"])

    def check(
        self, curves: Drawable, system: System | None, events: Sequence[str] = (), isolas: Sequence[str] = ()
    ) -> Iterator[Complaint]:
        """What is wrong with it, before any work."""
        yield from super().check(curves, system, events, isolas)
        planes = {curves[name] for name in self.drawn(curves) if curves.get(name) is not None}
        yield from _same(self.x, self.y)
        if self.x is not None and self.y is not None:
            return
        if len(planes) > 1:
            yield (), "the curves are tracked in different parameters: choose x and y, or fewer analyses"
        elif curves and not planes and self.y is None:
            yield ("y",), "is missing: the parameter into the depth, which no tracked curve tells here"

    def drawing(self, datasets: list[Any], path: Path, labels: Sequence[str] | None, view: View) -> None:
        """See `CurveFigure.drawing`."""
        own = {name: getattr(self, name) for name in ("x", "y", "zlabel", "elevation", "azimuth", "title", "size")}
        units: dict[str, Any] = {name: getattr(view, name) for name in _VIEW if name in type(self).model_fields}
        plot_space(datasets, path, **own, **units)


def _at(values: Sequence[float] | None, closed: Sequence[Any], parameter: str) -> list[Any]:
    """The closed branches at some values of the parameter; InputError where there is none."""
    if values is None:
        return list(closed)
    known = [float(dataset.attrs["at"]) for dataset in closed]
    for value in values:
        if value not in known:
            there = ", ".join(f"{other:.6g}" for other in sorted(set(known))) or "none"
            raise InputError(
                f"no closed branch at {parameter} = {value:g} is known (known: {there}): name it in at of the analysis"
            )
    return [dataset for dataset, value in zip(closed, known, strict=True) if value in values]


def _same(x: str | None, y: str | None) -> Iterator[Complaint]:
    if x is not None and x == y:
        yield ("y",), f"is {x!r}, which is x as well"


def _not_in(view: View, system: System | None) -> Iterator[Complaint]:
    """What a figure shows that the system does not have."""
    if system is None:
        return
    if view.dof is not None and not 0 <= view.dof < system.n:
        yield ("dof",), f"dof={view.dof} is out of range: the system has {system.n}, numbered from 0"
    if view.element is not None:
        gapped = gapped_elements(system) if view.quantity in ("contact_share", "impacts") else None
        try:
            check_element(system, view.element, gapped)
        except InputError as error:
            yield ("element",), str(error)
    loads = [c for c in system.load_components() if c.harmonic == 1 and c.direction.sum()]
    if view.quantity == "transmissibility" and not loads:
        yield ("quantity",), "no force at harmonic 1 is applied, so that there is no transmissibility"


#: by the `kind` of a figure
CURVE_FIGURES: dict[str, type[CurveFigure]] = {
    "response": FigureSection,
    "boundary": BoundaryFigure,
    "space": SpaceFigure,
}
