"""What a step of a study is: one analysis with its arguments, as a table of the study file.

A new kind of step is a class derived from `Step` in a file of this folder; it registers itself. The class names its
`kind` and its arguments as fields, says in `check` what is wrong before any work, and computes in `run`. Options of the
verbs are tables as well: newton, stepping, harmonics, stability, formulation, seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from inspect import get_annotations
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag

from suboctave.analysis.diagram import Keeper
from suboctave.analysis.subharmonics import Seeds
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.curves.events.formulation import Alcorta2019, BorderedSystem, ExtendedSystem, formulation_of
from suboctave.errors import InputError, suggest
from suboctave.floquet.methods import Hill, KoopmanHill, Monodromy, method_of
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.kinds import KINDS
from suboctave.maps.isolas.result import Isola, Isolas
from suboctave.model.system import System
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.study.results import Result

_METHODS: dict[str, Any] = {method.name: method for method in (Monodromy, Hill, KoopmanHill)}
_FORMULATIONS: dict[str, Any] = {one.name: one for one in (BorderedSystem, ExtendedSystem, Alcorta2019)}


def read_by(read: Callable[[Any], Any]) -> AfterValidator:
    """What is given for a field stays as it is; where it cannot be read it is refused at its key."""

    def check(given: Any) -> Any:
        read(given)
        return given

    return AfterValidator(check)


def as_harmonics(given: Any) -> Any:
    """A whole number, "adaptive", or the options of adaptive harmonics as a table; None stays None."""
    if isinstance(given, Mapping):
        return _options(AdaptiveHarmonics, "harmonics", given)
    if given is None or given == "adaptive":
        return given
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise InputError(f'give a whole number of at least 1, "adaptive", or a table of its options, not {given!r}')
    return given


def _named(what: str, key: str, kinds: Mapping[str, Any], by_name: Callable[[str], Any], given: Any) -> Any:
    """An object by its name, or by a table with its name at `key` beside its options; None stays None."""
    if isinstance(given, Mapping):
        table = dict(given)
        name = table.pop(key, None)
        if name not in kinds:
            raise InputError(f"there is no {what} {name!r} that takes options{suggest(str(name), kinds)}")
        return _options(kinds[name], name, table)
    if given is not None and not isinstance(given, str):
        raise InputError(f"give the name of a {what}, or a table with {key} = ..., not {given!r}")
    return None if given is None else by_name(given)


def _options(kind: Any, what: str, table: Mapping[str, Any] | None) -> Any:
    """The options of a table as an object, each of the type of its default; None stays None."""
    if table is None:
        return None
    known = {f.name: f for f in fields(kind)}
    for name, value in table.items():
        if name not in known:
            raise InputError(f"{what} has no option {name!r}{suggest(name, known)}")
        default = known[name].default
        wanted: Any = (bool,) if isinstance(default, bool) else (str,) if isinstance(default, str) else (int, float)
        if not isinstance(value, wanted) or (isinstance(value, bool) and wanted != (bool,)):
            raise InputError(f"{what}, {name}: {value!r} will not do; the default is {default!r}")
        if isinstance(default, int) and not isinstance(default, bool) and not isinstance(value, int):
            raise InputError(f"{what}, {name}: a whole number is needed, not {value!r}")
    return kind(**table)


#: what the tables of a study file give, by the option: an object for a table, or a name, None where there is none
as_newton = partial(_options, NewtonOptions, "newton")
as_stepping = partial(_options, SteppingOptions, "stepping")
as_seeds = partial(_options, Seeds, "seeds")
as_stability = partial(_named, "method", "method", _METHODS, method_of)
as_formulation = partial(_named, "formulation", "name", _FORMULATIONS, formulation_of)


# -------------------------------------------------------------------------------------------------------------- steps
#: the kinds of steps, by name
STEPS: dict[str, type[Step]] = {}

#: bifurcations that the ends of isolas are
_ENDS = ("isola_centre", "isola_merging")

Range = Annotated[list[float], Field(min_length=2, max_length=2)]
#: what a check reports: the key inside the table, and what to change
Complaint = tuple[tuple[str | int, ...], str]


@dataclass(frozen=True)
class Known:
    """What is known of the motions of an analysis before it runs: their free parameter, the values of the others."""

    free: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class CheckContext:
    """What is known before a study runs: the system as this step sees it, and the kinds of the steps before it.

    `known` has an entry for each of these steps that follows a curve and is in order.
    """

    system: System
    before: Mapping[str, type[Step]]
    allow_code: bool = False
    known: Mapping[str, Known] = field(default_factory=dict)


@dataclass
class Context:
    """What a step finds when it runs: its system, the results of the steps before it, somebody to report to.

    `keeper` keeps the branches of a diagram when they are complete.
    """

    system: System
    results: Mapping[str, Result]
    progress: Any = None
    allow_code: bool = False
    keeper: Keeper | None = None


class Step(BaseModel):
    """One analysis of a study. `parameters` are other values for this analysis alone, `seconds` is its time limit."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    kind: ClassVar[str] = ""
    gives_branch: ClassVar[bool] = False
    gives_diagram: ClassVar[bool] = False
    gives_isolas: ClassVar[bool] = False

    name: str = Field(min_length=1)
    type: str
    parameters: dict[str, float] = Field(default_factory=dict)
    seconds: float | None = Field(default=None, gt=0.0)

    @classmethod
    def drawn(cls) -> bool:
        """Whether it gives anything that is drawn as a curve."""
        return cls.gives_branch or cls.gives_diagram or cls.gives_isolas

    @property
    def plane(self) -> tuple[str, str] | None:
        """The two parameters of a curve of bifurcations, or of isolas; None for any other result."""
        return None

    @classmethod
    def __pydantic_init_subclass__(cls, **more: Any) -> None:
        super().__pydantic_init_subclass__(**more)
        if cls.kind:
            STEPS[cls.kind] = cls

    def needs(self) -> list[tuple[tuple[str | int, ...], str]]:
        """The analyses whose results it starts from: the key that names each, and the name."""
        return []

    def own(self, *without: str) -> dict[str, Any]:
        """The arguments that its kind has and no other, by name."""
        names = [name for name in get_annotations(type(self)) if name in type(self).model_fields]
        return {name: getattr(self, name) for name in names if name not in without}

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        """What is wrong with the arguments, before any work."""
        yield from ()

    def known(self, around: CheckContext) -> Known | None:
        """What is known of its motions before it runs; None where that is nothing, or they are none."""
        return None

    def run(self, context: Context) -> Result:
        """The result. Raises InputError or ConvergenceError; on Ctrl-C what was computed comes back, or nothing."""
        raise TypeError(f"{type(self).__name__} does not say how it runs")


def as_table(names: Sequence[str], kinds: Sequence[Any], rows: Sequence[Sequence[Any]]) -> dict[str, np.ndarray]:
    """Rows as columns by name, each of its kind."""
    return {
        name: np.array([row[i] for row in rows], dtype=kind)
        for i, (name, kind) in enumerate(zip(names, kinds, strict=True))
    }


def tried(key: str, call: Callable[[], Any]) -> Iterator[Complaint]:
    """The complaint of a call that refuses its input, if it does, at a key of the table (empty: the whole table)."""
    try:
        call()
    except InputError as error:
        yield ((key,) if key else ()), str(error)


# ------------------------------------------------------------------------------------------------- motions of a branch
class Curve(BaseModel):
    """A branch of an earlier analysis.

    Of a diagram one of its branches, by number or by how its label begins; of isolas the curve of limit points of one
    of them, or with `at`, a value of the parameter, its closed branch there.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    analysis: str
    branch: int | None = Field(default=None, ge=0)
    label: str | None = Field(default=None, min_length=1)
    isola: int | None = Field(default=None, ge=0)
    at: float | None = None

    @property
    def words(self) -> str:
        """How messages and titles name it."""
        if self.label is not None:
            return f"{self.analysis}, branch {self.label!r}"
        if self.isola is not None:
            return f"{self.analysis}, isola {self.isola}" + ("" if self.at is None else f" at {self.at:g}")
        return self.analysis if self.branch is None else f"{self.analysis}, branch {self.branch}"


class Motion(Curve):
    """One motion of an earlier branch: a point, a bifurcation of a kind, or the point nearest to given values.

    Of isolas the bifurcations "isola_centre" and "isola_merging" are the ends of one.
    """

    point: int | None = None
    bifurcation: str | None = None
    index: int = 0
    nearest: dict[str, float] | None = None


def name_or_table(given: Any) -> str | None:
    """Which way a branch or a motion is given, so that a mistake in it is told once, as one in that way."""
    return "name" if isinstance(given, str) else "table" if isinstance(given, dict | Curve) else None


#: a branch as a step names it: the name of an analysis alone, or with one of a diagram's branches
Named = Annotated[Annotated[str, Tag("name")] | Annotated[Curve, Tag("table")], Discriminator(name_or_table)]


def as_curve(given: str | Curve) -> Curve:
    """A branch by name."""
    return Curve(analysis=given) if isinstance(given, str) else given


def key_of_curve(given: str | Curve, key: str) -> tuple[str | int, ...]:
    """The key at which the name of the analysis stands."""
    return (key,) if isinstance(given, str) else (key, "analysis")


def check_motion(motion: Motion, key: tuple[str | int, ...], around: CheckContext) -> Iterator[Complaint]:
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


def check_branch(curve: Curve, key: tuple[str | int, ...], around: CheckContext) -> Iterator[Complaint]:
    """Refuse an analysis that is not there, not before this one, or gives no branch, and a choice that says too little.

    `key` is that of the name of the analysis.
    """
    name = curve.analysis
    if name not in around.before:
        yield key, f"there is no analysis {name!r} before this one{suggest(name, around.before)}"
        return
    step, place = around.before[name], key[:-1]
    given = [choice for choice in ("branch", "label", "isola", "at") if getattr(curve, choice) is not None]
    wrong, why = ("isola", "at"), "looks for no isolas"
    if step.gives_isolas:
        wrong, why = ("branch", "label"), "gives isolas, not a diagram"
    for choice in given:
        if choice in wrong:
            yield (*place, choice), f"the analysis {name!r} {why}: leave {choice} out"
    own = [choice for choice in given if choice not in wrong]
    if step.gives_isolas:
        if curve.isola is None:
            yield (
                key,
                f'the analysis {name!r} gives isolas: say which, and at which value, {{ analysis = "{name}", isola = '
                "0, at = 0.3 }; without at it is its curve of limit points",
            )
        elif curve.at is not None and getattr(curve, "bifurcation", None) in _ENDS:
            yield (*place, "at"), "an end of an isola has a value of its own: leave at out"
    elif step.gives_diagram:
        if len(own) == 2:
            yield key, "choose a branch of the diagram by its number or by its label, not by both"
        elif not own:
            yield (
                key,
                f"the analysis {name!r} gives a diagram: say which of its branches, "
                f'{{ analysis = "{name}", branch = 0 }} (the response) or label = "2T"',
            )
    elif not step.gives_branch:
        yield key, f"the analysis {name!r} gives no branch to start from"
    elif own:
        yield (*place, own[0]), f"the analysis {name!r} gives one branch, not a diagram: leave {own[0]} out"


def _isola(curve: Curve, isolas: Isolas) -> Isola:
    """The isola that is named; InputError where it was not found."""
    number = curve.isola or 0
    if number >= len(isolas):
        count = "no isola" if not len(isolas) else f"only {len(isolas)} isola{'s' * (len(isolas) > 1)}"
        raise InputError(f"{curve.analysis!r} found {count}, so that there is none with number {number}")
    return isolas[number]


def chosen_branch(curve: Curve, results: Mapping[str, Result]) -> Branch:
    """The branch that an earlier analysis gave, or one of a diagram or of an isola; InputError where there is none."""
    result = results.get(curve.analysis)
    if isinstance(result, Isolas):
        isola = _isola(curve, result)
        return isola.limit_points if curve.at is None else isola.at(curve.at)
    if isinstance(result, BifurcationDiagram):
        which = curve.branch if curve.label is None else curve.label
        assert which is not None
        try:
            return result[which].branch
        except InputError as error:
            raise InputError(f"{curve.analysis!r}: {error}") from None
    if not isinstance(result, Branch):
        raise InputError(f"the analysis {curve.analysis!r} gave no branch")
    return result


def chosen(motion: Motion, results: Mapping[str, Result]) -> Any:
    """The point or bifurcation of an earlier branch; InputError where there is none."""
    result = results.get(motion.analysis)
    if isinstance(result, Isolas) and motion.bifurcation in _ENDS:
        isola = _isola(motion, result)
        end = isola.born if motion.bifurcation == "isola_centre" else isola.merges
        if end is None:
            raise InputError(f"{motion.words} has no {motion.bifurcation}: {'; '.join(isola.reasons)}")
        return end
    branch = chosen_branch(motion, results)
    words = repr(motion.analysis) if motion.words == motion.analysis else motion.words
    if motion.bifurcation is not None:
        met = branch.bifurcations[motion.bifurcation]
        if not -len(met) <= motion.index < len(met):
            count = "no" if not met else f"only {len(met)}"
            kind = motion.bifurcation
            raise InputError(f"{words} has {count} {kind}, so that there is none with index {motion.index}")
        return met[motion.index]
    if motion.nearest is not None:
        distance = np.zeros(len(branch))
        for name, value in motion.nearest.items():
            values = branch.amplitude if name == "amplitude" else branch.parameter(name)
            distance += ((values - value) / max(float(np.ptp(values)), abs(value), 1e-300)) ** 2
        return branch.points[int(np.argmin(distance))]
    point = -1 if motion.point is None else motion.point
    if not -len(branch) <= point < len(branch):
        raise InputError(f"{words} has {len(branch)} points, so that there is no point {point}")
    return branch.points[point]
