"""Figures in study files: curves (responses, boundaries, in space) and motions (phase portraits, spectra, histories).

The keys of a figure are the options of the function that draws it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BeforeValidator, Field

from suboctave.curves.junction import period_name
from suboctave.errors import InputError, Key, chosen_dof, suggest
from suboctave.kinds import KINDS
from suboctave.maps.isolas.result import Isolas
from suboctave.model.inputs import check_element
from suboctave.model.system import System
from suboctave.pictures import View, plot_boundaries, plot_history, plot_phase, plot_response, plot_space, plot_spectrum
from suboctave.pictures.frames import check_frame
from suboctave.pictures.given import datasets_of
from suboctave.pictures.options import DERIVATIVES, FrameOptions, MotionView, as_multiple
from suboctave.pictures.style import checked_text, size_in_inches
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.results.readings import gapped_elements
from suboctave.store.motions import motion_datasets
from suboctave.study.mistakes import Section
from suboctave.study.results import Result
from suboctave.study.steps.base import CheckContext, Complaint, Motion, Step, tried

_VIEW = [field.name for field in fields(View)]
#: what a study file says of the frame of a figure in a plane
_FRAME = sorted(FrameOptions.__optional_keys__ - {"ax"})
_Limits = Annotated[list[float], Field(min_length=2, max_length=2)]


def _refused_by(check: Callable[[Any], Any]) -> AfterValidator:
    """A value that stays as it is given where `check` does not refuse it."""
    return AfterValidator(lambda given: (check(given), given)[1])


#: what is written on a figure
_Text = Annotated[str, _refused_by(checked_text)]
_Size = Annotated[Any, _refused_by(size_in_inches)]
#: a number, or a fraction as text: "1/3"
_Multiple = Annotated[float, BeforeValidator(as_multiple)]
#: the kinds of figures
FIGURES: dict[str, type[Figure]] = {}


@dataclass(frozen=True)
class StudyCurves:
    """What a figure may show: the steps of a study by name, with its system where that is in order."""

    steps: Mapping[str, Step]
    system: System | None

    @property
    def planes(self) -> dict[str, tuple[str, str] | None]:
        """The curves by name, with the two parameters of those that are tracked or bound isolas, else None."""
        return {name: step.plane for name, step in self.steps.items() if step.gives != "table"}


class Figure(Section):
    """One figure; its form follows the suffix of `file`. A class of figures is given its `kind` and what draws it."""

    plot: ClassVar[Callable[..., Any]]

    kind: str = "response"
    file: str
    dof: Any = None
    frequency: str | None = None
    omega_reference: float | None = None
    scale: float | None = None
    unit: _Text | None = None
    xlabel: _Text | None = None
    ylabel: _Text | None = None
    title: _Text | None = None
    size: _Size | None = None

    def __init_subclass__(cls, kind: str = "", plot: Callable[..., Any] | None = None, **more: Any) -> None:
        super().__init_subclass__(**more)
        if plot is not None:
            cls.plot = staticmethod(plot)
            FIGURES[kind] = cls

    def check(self, study: StudyCurves) -> Iterator[Complaint]:
        """What is wrong with it, before any work."""
        if study.system is not None:
            system = study.system
            for dof in self.dof if isinstance(self.dof, list) else [self.dof]:
                yield from tried("dof", partial(chosen_dof, dof, 0, system.n, names=system.dof_names))

    def draw(self, results: Mapping[str, Result], path: Path) -> bool:
        """Draw it; False where what it shows is not there.

        Raises InputError where a finished analysis lacks what it shows.
        """
        raise TypeError(f"{type(self).__name__} does not say how it is drawn")


class _InPlane(Figure):
    """A figure in a plane: what of its axes is shown, and their scales."""

    xlim: _Limits | None = None
    ylim: _Limits | None = None
    xscale: str | None = None
    yscale: str | None = None

    def check(self, study: StudyCurves) -> Iterator[Complaint]:
        yield from tried("", lambda: check_frame({name: getattr(self, name) for name in _FRAME}))
        yield from super().check(study)


class CurveFigure(Figure):
    """One figure of curves; what is drawn follows the keys of `View`."""

    analyses: list[str] = Field(default_factory=list)
    x: str | None = None
    size: _Size | None = (6.4, 4.2)
    dof: int | str | list[int | str] | None = None
    quantity: str = ""
    harmonic: _Multiple | None = None
    element: int | None = None

    @property
    def view(self) -> View:
        """Quantity and units; InputError where they do not go together."""
        given: dict[str, Any] = {name: getattr(self, name, None) for name in _VIEW}
        return View(**given)

    def drawn(self, planes: Mapping[str, tuple[str, str] | None]) -> list[str]:
        """The analyses that it shows."""
        return self.analyses or list(planes)

    def check(self, study: StudyCurves) -> Iterator[Complaint]:
        planes, system = study.planes, study.system
        for i, name in enumerate(self.analyses):
            if name not in planes:
                yield ("analyses", i), f"no analysis {name!r} gives a curve{suggest(name, planes)}"
        if not planes:
            yield (), "there is no analysis that gives a curve"
        parameters = ["omega", *(system.parameters if system else ())]
        for key in ("x", "y"):
            given = getattr(self, key, None)
            if system is not None and given is not None and given not in parameters:
                yield (key,), f"neither omega nor a parameter{suggest(given, parameters)}"
        if self.x is not None and self.x == getattr(self, "y", None):
            yield ("y",), f"is {self.x!r}, which is x as well"
        labels, drawn = getattr(self, "labels", None), len(self.drawn(planes))
        if labels is not None and len(labels) != drawn:
            yield ("labels",), f"{len(labels)} labels for {drawn} curves"
        kinds = [*KINDS, *(event.name for step in study.steps.values() for event in getattr(step, "events", ()))]
        for i, kind in enumerate(getattr(self, "marks", None) or ()):
            if kind not in kinds:
                yield ("marks", i), f"neither a kind nor an event{suggest(kind, kinds)}"
        yield from super().check(study)
        try:
            view = self.view
        except InputError as error:
            yield (), str(error)
            return
        if system is None:
            return
        if view.element is not None:
            gapped = gapped_elements(system) if view.quantity in ("contact_share", "impacts") else None
            yield from tried("element", lambda: check_element(system, view.element, gapped))
        loads = [c for c in system.load_components() if c.harmonic == 1 and c.direction.sum()]
        if view.quantity == "transmissibility" and not loads:
            yield ("quantity",), "no force at harmonic 1 is applied, so that there is no transmissibility"

    def draw(self, results: Mapping[str, Result], path: Path) -> bool:
        planes = {name: getattr(item, "plane", None) for name, item in results.items() if isinstance(item, _CURVES)}
        every = self.drawn(planes)
        there = [name for name in every if name in results and drawable(results[name])]
        view = self.view.placed(results.values())
        given: list[str] | None = getattr(self, "labels", None)
        drawn = [
            curve
            for name in there
            for curve in self._of_result(results[name], view, given[every.index(name)] if given else "")
        ]
        if not drawn:
            return False
        labels = [label for _, label in drawn if label is not None] if given else None
        alone = results[there[0]] if len(there) == 1 else None
        if isinstance(alone, BifurcationDiagram):
            labels = labels or alone.legend
            view = replace(view, marks=alone.marks) if view.marks is None else view
        datasets = datasets_of([dataset for dataset, _ in drawn], view)
        type(self).plot(datasets, path, **self.options(labels, view))
        return True

    def _of_result(self, item: Result, view: View, label: str) -> list[tuple[Any, str | None]]:
        """What of a result is drawn, each with its label: those of a diagram's branches name their periods, those of
        isolas what they are; none for the regions.
        """
        if isinstance(item, Isolas):
            datasets = item.to_xarray(readings=view.readings(0))
            names = {id(dataset): name.split(": ")[-1] for name, dataset in datasets.items()}
            shown = ((dataset, names[id(dataset)]) for dataset in self.of_isolas(datasets))
            return [(dataset, None if name == "isolas" else f"{label}, {name}") for dataset, name in shown]
        of_diagram = isinstance(item, BifurcationDiagram)
        return [(b, f"{label}, {period_name(b.nu)}" if of_diagram else label) for b in _branches_of(item)]

    def of_isolas(self, datasets: Mapping[str, Any]) -> list[Any]:
        """What of isolas is drawn."""
        raise TypeError(f"{type(self).__name__} does not say what of isolas it draws")

    def options(self, labels: Sequence[str] | None, view: View) -> dict[str, Any]:
        """What `plot` takes besides the datasets."""
        frame = {name: getattr(self, name, None) for name in _FRAME}
        return {"x": self.x, "labels": labels, "view": view, **frame}


_CURVES = (Branch, BifurcationDiagram, Isolas)


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


class PlaneFigure(_InPlane, CurveFigure):
    """Curves in a plane: their names, and the kinds of events that are marked."""

    labels: list[_Text] | None = None
    marks: list[str] | None = None


class ResponseFigure(PlaneFigure, kind="response", plot=plot_response):
    """Response curves. Curves of bifurcations are drawn among them where `x` is given and they are named.

    Of isolas that are named the closed branches known are drawn, or those at the values `at`.
    """

    at: list[float] | None = None

    def drawn(self, planes: Mapping[str, tuple[str, str] | None]) -> list[str]:
        """All that are no curves of bifurcations, unless some are named."""
        return self.analyses or [name for name, plane in planes.items() if plane is None] or list(planes)

    def of_isolas(self, datasets: Mapping[str, Any]) -> list[Any]:
        return _closed(datasets, self.at)

    def check(self, study: StudyCurves) -> Iterator[Complaint]:
        yield from super().check(study)
        for i, name in enumerate(self.analyses):
            tracked = study.planes.get(name) is not None and study.steps[name].gives != "isolas"
            if tracked and self.x is None:
                yield ("analyses", i), f'{name!r} is a curve of bifurcations: kind = "boundary" draws it, or give x'


class BoundaryFigure(PlaneFigure, kind="boundary", plot=plot_boundaries):
    """Curves of bifurcations and regions of isolas in the plane of two parameters; with a `quantity`, this upwards."""

    y: str | None = None

    @property
    def projected(self) -> bool:
        """Whether a quantity is drawn upwards."""
        return bool(self.quantity) or self.harmonic is not None

    def drawn(self, planes: Mapping[str, tuple[str, str] | None]) -> list[str]:
        """All curves of bifurcations, unless some are named."""
        return self.analyses or [name for name, plane in planes.items() if plane is not None]

    def check(self, study: StudyCurves) -> Iterator[Complaint]:
        yield from super().check(study)
        curves = study.planes
        tracked = [name for name, plane in curves.items() if plane is not None]
        if curves and not tracked:
            yield (), "there is no analysis of the type 'track' or 'find_isolas', whose curves it would show"
        for i, name in enumerate(self.analyses):
            if name in curves and curves[name] is None:
                yield ("analyses", i), f"{name!r} is no curve of bifurcations{suggest(name, tracked)}"
        planes = {curves.get(name) for name in self.drawn(curves)} - {None}
        if self.projected and self.y is not None:
            yield ("y",), "is a parameter; with a quantity that is what is drawn upwards: leave one of them out"
        if len(planes) > 1 and (self.x is None or (self.y is None and not self.projected)):
            yield (), "the curves are tracked in different parameters: choose x and y, or fewer analyses"
        if len(planes) == 1 and (self.x is None) != (self.y is None) and not self.projected:
            key, given = ("x", self.x) if self.x is not None else ("y", self.y)
            (plane,) = planes
            if plane is not None and given not in plane:
                yield (key,), f"is not free on these curves{suggest(str(given), plane)}; else give x and y"

    def of_isolas(self, datasets: Mapping[str, Any]) -> list[Any]:
        return [dataset for dataset in datasets.values() if "isola" not in dataset.attrs]

    def options(self, labels: Sequence[str] | None, view: View) -> dict[str, Any]:
        return {**super().options(labels, view), "y": self.y, "projected": self.projected}


class SpaceFigure(CurveFigure, kind="space", plot=plot_space):
    """Response curves at several values of a parameter, and curves of bifurcations through them, in space.

    Of isolas the closed branches known are drawn, or those at the values `at`.
    """

    y: str | None = None
    size: _Size | None = (6.4, 5.0)
    zlabel: _Text | None = None
    elevation: float = 24.0
    azimuth: float = -58.0
    at: list[float] | None = None

    def of_isolas(self, datasets: Mapping[str, Any]) -> list[Any]:
        return [d for d in datasets.values() if "isola" not in d.attrs] + _closed(datasets, self.at)

    def check(self, study: StudyCurves) -> Iterator[Complaint]:
        yield from super().check(study)
        curves = study.planes
        planes = {curves.get(name) for name in self.drawn(curves)} - {None}
        if self.x is not None and self.y is not None:
            return
        if len(planes) > 1:
            yield (), "the curves are tracked in different parameters: choose x and y, or fewer analyses"
        elif curves and not planes and self.y is None:
            yield ("y",), "is missing: the parameter into the depth, which no tracked curve tells here"

    def options(self, labels: Sequence[str] | None, view: View) -> dict[str, Any]:
        units = {name: getattr(view, name) for name in _VIEW if name in type(self).model_fields}
        return {**self.model_dump(exclude={"kind", "file", "analyses", "at"}), **units}


def _closed(datasets: Mapping[str, Any], values: Sequence[float] | None) -> list[Any]:
    """The closed branches among the datasets of isolas, or those at some values; InputError where there is none."""
    closed = [dataset for dataset in datasets.values() if "isola" in dataset.attrs]
    places = [float(dataset.attrs["at"]) for dataset in closed]
    parameter = datasets["isolas"].attrs["isolas"]
    for value in values or ():
        if value not in places:
            there = ", ".join(f"{other:.6g}" for other in sorted(set(places))) or "none"
            raise InputError(
                f"no closed branch at {parameter} = {value:g} is known (known: {there}): name it in at of the analysis"
            )
    return [dataset for dataset, place in zip(closed, places, strict=True) if values is None or place in values]


# ------------------------------------------------------------------------------------------------------------ motions
class MotionFigure(_InPlane, Figure):
    """One figure of motions, each chosen as `start` chooses one."""

    quantities: ClassVar[Sequence[str]] = ("displacement",)

    motions: list[Motion] = Field(min_length=1)
    dof: int | str | None = None
    overlay: bool = False
    labels: list[_Text] | None = None

    def check(self, study: StudyCurves) -> Iterator[Complaint]:
        curves = list(study.planes)
        kinds = {name: type(step) for name, step in study.steps.items()}
        for i, motion in enumerate(self.motions):
            key: Key = ("motions", i)
            if motion.analysis not in curves:
                yield key, f"no analysis {motion.analysis!r} gives a curve{suggest(motion.analysis, curves)}"
            elif study.system is not None:
                yield from motion.check(key, CheckContext(study.system, kinds))
        if self.labels is not None and len(self.labels) != len(self.motions):
            yield ("labels",), f"{len(self.labels)} labels for {len(self.motions)} motions"
        quantity, element = getattr(self, "quantity", "displacement"), getattr(self, "element", None)
        units = {name: getattr(self, name) for name in ("frequency", "omega_reference", "scale", "unit")}
        yield from tried("", lambda: MotionView(quantity, element, **units).check_quantity(self.quantities))
        yield from super().check(study)
        if element is not None and study.system is not None:
            system = study.system
            yield from tried("element", lambda: check_element(system, element))

    def draw(self, results: Mapping[str, Result], path: Path) -> bool:
        """See `Figure.draw`; False also where an analysis was interrupted before the motion."""
        element = getattr(self, "element", None)
        datasets = []
        for motion in self.motions:
            result = results.get(motion.analysis)
            if result is None or not len(result):
                return False
            try:
                branch, item = motion.of(results), motion.chosen(results)
            except InputError:
                if isinstance(result, _CURVES) and result.interrupted:
                    return False
                raise
            dof = branch.observe if self.dof is None else self.dof
            datasets += motion_datasets(item, dof=dof, elements=() if element is None else (element,))
        type(self).plot(datasets, path, **self.model_dump(exclude={"kind", "file", "motions", "dof"}))
        return True


class PhaseFigure(MotionFigure, kind="phase", plot=plot_phase):
    """Phase portraits."""


class SpectrumFigure(MotionFigure, kind="spectrum", plot=plot_spectrum):
    """Spectra."""

    quantities: ClassVar[Sequence[str]] = tuple(DERIVATIVES)
    quantity: str = "displacement"
    highest: float | None = Field(default=None, gt=0)


class HistoryFigure(MotionFigure, kind="history", plot=plot_history):
    """Time histories."""

    quantities: ClassVar[Sequence[str]] = (*DERIVATIVES, "force")
    quantity: str = "displacement"
    element: int | None = None
