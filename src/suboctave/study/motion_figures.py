"""Figures of single motions in study files: phase portraits, spectra, time histories of points and bifurcations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from suboctave.analysis import BifurcationDiagram, Branch, Isolas
from suboctave.analysis.contacts import check_element
from suboctave.analysis.results import Result
from suboctave.errors import InputError, suggest
from suboctave.model.system import System
from suboctave.pictures import plot_history, plot_phase, plot_spectrum
from suboctave.pictures.motions import DERIVATIVES, MotionView
from suboctave.pictures.style import size_in_inches
from suboctave.store.motions import motion_datasets
from suboctave.study.steps.base import (
    Complaint,
    Motion,
    Step,
    Surroundings,
    check_branch,
    check_motion,
    chosen,
    chosen_branch,
    name_or_table,
)

__all__ = ["MOTION_FIGURES", "MotionFigure"]


_Motion = Annotated[Annotated[str, Tag("name")] | Annotated[Motion, Tag("table")], Discriminator(name_or_table)]
#: keys of a figure that are no options of what draws it
_OWN = {"kind", "file", "motions"}


class MotionFigure(BaseModel):
    """One figure of motions, each chosen as `start` chooses one; the other keys are the options of the function."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    plot: ClassVar[Any]
    quantities: ClassVar[Sequence[str]] = ("displacement",)

    kind: str
    file: str
    motions: list[_Motion] = Field(min_length=1)
    dof: int | None = None
    overlay: bool = False
    frequency: str | None = None
    omega_reference: float | None = None
    scale: float | None = None
    unit: str | None = None
    xlabel: str | None = None
    ylabel: str | None = None
    labels: list[str] | None = None
    title: str | None = None
    size: Any = None

    @property
    def chosen(self) -> list[Motion]:
        """The motions; the name of an analysis alone means its last point."""
        return [Motion(analysis=given) if isinstance(given, str) else given for given in self.motions]

    @property
    def texts(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """What is written on it, with the key of each."""
        for key in ("title", "unit", "xlabel", "ylabel"):
            if getattr(self, key) is not None:
                yield (key,), getattr(self, key)
        for i, label in enumerate(self.labels or ()):
            yield ("labels", i), label

    def check(self, steps: Mapping[str, type[Step]], system: System | None) -> Iterator[Complaint]:
        """What is wrong with it, before any work."""
        curves = [name for name, step in steps.items() if step.drawn()]
        for i, motion in enumerate(self.chosen):
            key: tuple[str | int, ...] = ("motions", i)
            if motion.analysis not in curves:
                yield key, f"no analysis {motion.analysis!r} gives a curve{suggest(motion.analysis, curves)}"
            elif system is not None:
                named = key if isinstance(self.motions[i], str) else (*key, "analysis")
                yield from check_branch(motion, named, Surroundings(system, steps))
            if system is not None:
                yield from check_motion(motion, key, Surroundings(system, steps))
        if self.labels is not None and len(self.labels) != len(self.motions):
            yield ("labels",), f"{len(self.labels)} labels for {len(self.motions)} motions"
        if self.size is not None:
            try:
                size_in_inches(self.size)
            except InputError as error:
                yield ("size",), str(error)
        quantity, element = getattr(self, "quantity", "displacement"), getattr(self, "element", None)
        try:
            MotionView(quantity, element, self.frequency, self.omega_reference, self.scale, self.unit).check_quantity(
                self.quantities
            )
        except InputError as error:
            yield (), str(error)
        if system is None:
            return
        if self.dof is not None and not 0 <= self.dof < system.n:
            yield ("dof",), f"dof={self.dof} is out of range: the system has {system.n}, numbered from 0"
        if element is not None:
            try:
                check_element(system, element)
            except InputError as error:
                yield ("element",), str(error)

    def draw(self, results: Mapping[str, Result], path: Path) -> bool:
        """Draw it; False where an analysis that it shows gave nothing, or was interrupted before the motion.

        Raises InputError where a finished branch has no such motion.
        """
        found = []
        for motion in self.chosen:
            result = results.get(motion.analysis)
            if result is None or not len(result):
                return False
            try:
                branch = chosen_branch(motion, results)
                item = chosen(motion, results)
            except InputError:
                if _interrupted(result):
                    return False
                raise
            element = getattr(self, "element", None)
            dof = branch.observe if self.dof is None else self.dof
            found += motion_datasets(item, dof=dof, elements=() if element is None else (element,))
        options = {name: getattr(self, name) for name in type(self).model_fields if name not in _OWN | {"dof"}}
        type(self).plot(found, path, **options)
        return True


def _interrupted(result: Result) -> bool:
    return isinstance(result, Branch | BifurcationDiagram | Isolas) and result.interrupted


class PhaseFigure(MotionFigure):
    """Phase portraits."""

    plot: ClassVar[Any] = staticmethod(plot_phase)
    kind: Literal["phase"]


class SpectrumFigure(MotionFigure):
    """Spectra."""

    plot: ClassVar[Any] = staticmethod(plot_spectrum)
    quantities: ClassVar[Sequence[str]] = tuple(DERIVATIVES)
    kind: Literal["spectrum"]
    quantity: str = "displacement"
    highest: float | None = Field(default=None, gt=0)


class HistoryFigure(MotionFigure):
    """Time histories."""

    plot: ClassVar[Any] = staticmethod(plot_history)
    quantities: ClassVar[Sequence[str]] = (*DERIVATIVES, "force")
    kind: Literal["history"]
    quantity: str = "displacement"
    element: int | None = None


#: by the `kind` of a figure
MOTION_FIGURES: dict[str, type[MotionFigure]] = {
    "phase": PhaseFigure,
    "spectrum": SpectrumFigure,
    "history": HistoryFigure,
}
