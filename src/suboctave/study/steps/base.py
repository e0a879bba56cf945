"""What a step of a study is: one analysis with its arguments, as a table of the study file.

A new kind of step is one file in this folder with one class derived from `Step`; it is found by itself. The class names
its `kind` and its arguments as fields, says in `check` what is wrong before any work, and computes in `run`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from suboctave.analysis import Branch, Table
from suboctave.bifurcation import KINDS
from suboctave.errors import InputError, suggest
from suboctave.model.system import System

__all__ = ["STEPS", "Context", "Range", "Step", "Surroundings", "chosen", "chosen_branch"]

#: the kinds of steps, by name
STEPS: dict[str, type[Step]] = {}

Range = Annotated[list[float], Field(min_length=2, max_length=2)]
#: what a check reports: the key inside the table, and what to change
Complaint = tuple[tuple[str | int, ...], str]


@dataclass(frozen=True)
class Surroundings:
    """What is known before a study runs: the system as this step sees it, and the kinds of the steps before it."""

    system: System
    before: Mapping[str, type[Step]]
    allow_code: bool = False


@dataclass
class Context:
    """What a step finds when it runs: its system, the results of the steps before it, somebody to report to."""

    system: System
    results: Mapping[str, Branch | Table]
    progress: Any = None
    allow_code: bool = False
    notes: list[str] = field(default_factory=list)


class Step(BaseModel):
    """One analysis of a study. `parameters` are other values for this analysis alone."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    kind: ClassVar[str] = ""
    gives_branch: ClassVar[bool] = False

    name: str = Field(min_length=1)
    type: str
    parameters: dict[str, float] = Field(default_factory=dict)

    @property
    def plane(self) -> tuple[str, str] | None:
        """The two parameters of a curve of bifurcations; None for any other result."""
        return None

    @classmethod
    def __pydantic_init_subclass__(cls, **more: Any) -> None:
        super().__pydantic_init_subclass__(**more)
        if cls.kind:
            STEPS[cls.kind] = cls

    def needs(self) -> list[tuple[tuple[str | int, ...], str]]:
        """The analyses whose results it starts from: the key that names each, and the name."""
        return []

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """What is wrong with the arguments, before any work."""
        yield from ()

    def run(self, context: Context) -> Branch | Table:
        """The result. Raises InputError or ConvergenceError; on Ctrl-C what was computed comes back, or nothing."""
        raise TypeError(f"{type(self).__name__} does not say how it runs")


def as_table(names: Sequence[str], kinds: Sequence[Any], rows: Sequence[Sequence[Any]]) -> dict[str, np.ndarray]:
    """Rows as columns by name, each of its kind."""
    return {
        name: np.array([row[i] for row in rows], dtype=kind)
        for i, (name, kind) in enumerate(zip(names, kinds, strict=True))
    }


def tried(key: str, call: Callable[[], Any]) -> Iterator[Complaint]:
    """The complaint of a call that refuses its input, if it does."""
    try:
        call()
    except InputError as error:
        yield (key,), str(error)


# ------------------------------------------------------------------------------------------------- motions of a branch
class Motion(BaseModel):
    """One motion of an earlier branch: a point, a bifurcation of a kind, or the point nearest to given values."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    analysis: str
    point: int | None = None
    bifurcation: str | None = None
    index: int = 0
    nearest: dict[str, float] | None = None


def check_motion(motion: Motion, key: tuple[str | int, ...], around: Surroundings) -> Iterator[Complaint]:
    """What is wrong with the choice of a motion, as far as that is known before the branch is."""
    ways = [motion.point is not None, motion.bifurcation is not None, motion.nearest is not None]
    if sum(ways) > 1:
        yield key, "choose by point, by bifurcation or by nearest, not by several of them"
    if motion.bifurcation is not None and motion.bifurcation not in KINDS:
        kinds = suggest(motion.bifurcation, KINDS)
        yield (*key, "bifurcation"), f"there is no kind of bifurcation {motion.bifurcation!r}{kinds}"
    for name in motion.nearest or {}:
        known = ["omega", "amplitude", *around.system.parameters]
        if name not in known:
            yield (*key, "nearest", name), f"neither omega, amplitude nor a parameter{suggest(name, known)}"


def check_branch(name: str, key: tuple[str | int, ...], around: Surroundings) -> Iterator[Complaint]:
    """Refuse the name of an analysis that is not there, not before this one, or gives no branch."""
    if name not in around.before:
        yield key, f"there is no analysis {name!r} before this one{suggest(name, around.before)}"
    elif not around.before[name].gives_branch:
        yield key, f"the analysis {name!r} gives no branch to start from"


def chosen_branch(name: str, context: Context) -> Branch:
    """The branch that an earlier analysis gave."""
    branch = context.results.get(name)
    if not isinstance(branch, Branch):
        raise InputError(f"the analysis {name!r} gave no branch")
    return branch


def chosen(motion: Motion, context: Context) -> Any:
    """The point or bifurcation of an earlier branch; InputError where there is none."""
    branch = chosen_branch(motion.analysis, context)
    if motion.bifurcation is not None:
        found = branch.bifurcations[motion.bifurcation]
        if not -len(found) <= motion.index < len(found):
            count = "no" if not found else f"only {len(found)}"
            raise InputError(
                f"{motion.analysis!r} has {count} {motion.bifurcation}, so that there is none with index {motion.index}"
            )
        return found[motion.index]
    if motion.nearest is not None:
        distance = np.zeros(len(branch))
        for name, value in motion.nearest.items():
            values = branch.amplitude if name == "amplitude" else branch.parameter(name)
            distance += ((values - value) / max(float(np.ptp(values)), abs(value), 1e-300)) ** 2
        return branch.points[int(np.argmin(distance))]
    point = -1 if motion.point is None else motion.point
    if not -len(branch) <= point < len(branch):
        raise InputError(f"{motion.analysis!r} has {len(branch)} points, so that there is no point {point}")
    return branch.points[point]
