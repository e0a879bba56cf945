"""What a step of a study is: one analysis with its arguments, as a table of the study file.

A new kind of step is a class derived from `Step` in a file of this folder; it registers itself. The class is given its
`kind` and its verb, has the arguments of that as fields, and says in `check` what is wrong before any work. Options of
the verbs are tables as well: newton, stepping, harmonics, stability, formulation, seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_serializer, model_validator

from suboctave.analysis.diagram import Keeper
from suboctave.analysis.subharmonics import Seeds
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.curves.events.formulation import FORMULATIONS, formulation_of
from suboctave.errors import InputError, Key, suggest
from suboctave.floquet.methods import METHODS, Arbitration, method_of
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.kinds import KINDS, suggest_kind
from suboctave.maps.isolas.result import Isola, Isolas
from suboctave.model.inputs import check_bounds, check_parameter, start_state
from suboctave.model.system import System
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.study.mistakes import Section
from suboctave.study.results import Result


# ----------------------------------------------------------------------------------------------- options of the verbs
def as_harmonics(given: Any) -> Any:
    """A whole number, "adaptive", or the options of adaptive harmonics as a table."""
    if isinstance(given, Mapping):
        return _options(AdaptiveHarmonics, "harmonics", given)
    if given != "adaptive" and (isinstance(given, bool) or not isinstance(given, int) or given < 1):
        raise InputError(f'give a whole number of at least 1, "adaptive", or a table of its options, not {given!r}')
    return given


def _named(what: str, key: str, kinds: Mapping[str, Any], by_name: Callable[[str], Any], given: Any) -> Any:
    """An object by its name, or by a table with its name at `key` beside its options."""
    if isinstance(given, Mapping):
        table = dict(given)
        name = table.pop(key, None)
        if name not in kinds:
            raise InputError(f"there is no {what} {name!r} that takes options{suggest(str(name), kinds)}")
        return _options(type(kinds[name]), name, table)
    if not isinstance(given, str):
        raise InputError(f"give the name of a {what}, or a table with {key} = ..., not {given!r}")
    return by_name(given)


def _options(kind: Any, what: str, table: Mapping[str, Any]) -> Any:
    """The options of a table as an object, each of the type of its default."""
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


_METHODS = {name: method for name, method in METHODS.items() if name != Arbitration.name}
as_stability = partial(_named, "method", "method", _METHODS, method_of)
as_formulation = partial(_named, "formulation", "name", FORMULATIONS, formulation_of)
#: how what a study file gives for an option becomes what the verbs take
READERS: dict[str, Callable[[Any], Any]] = {
    "harmonics": as_harmonics,
    "newton": partial(_options, NewtonOptions, "newton"),
    "stepping": partial(_options, SteppingOptions, "stepping"),
    "seeds": partial(_options, Seeds, "seeds"),
    "stability": as_stability,
    "formulation": as_formulation,
}


def _as_tuples(value: Any) -> Any:
    """Lists, and lists in them, as tuples: as scripts give ranges."""
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


# -------------------------------------------------------------------------------------------------------------- steps
#: the kinds of steps, by name
STEPS: dict[str, type[Step]] = {}

#: bifurcations that the ends of isolas are
_ENDS = ("isola_centre", "isola_merging")

Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Verb = Callable[..., Any]
#: what comes of a step
Gives = Literal["branch", "diagram", "isolas", "table"]
_WORDS: dict[Gives, str] = {"branch": "one branch", "diagram": "a diagram", "isolas": "isolas", "table": "a table"}
#: what a check reports: the key inside the table, and what to change
Complaint = tuple[Key, str]


@dataclass(frozen=True)
class Checked:
    """In the type of a field: what refuses its value for a system, before any work."""

    by: Callable[[System, Any], Any]


#: displacements and velocities in which a trajectory begins
State = Annotated[list[float] | None, Checked(start_state)]


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


class Step(Section):
    """One analysis of a study. `parameters` are other values for this analysis alone, `seconds` is its time limit.

    A class of steps is given its `kind`, the `verb`, what it `gives`, and fields that are no arguments of the verb
    (`besides`).
    """

    kind: ClassVar[str] = ""
    verb: ClassVar[Verb]
    gives: ClassVar[Gives] = "table"
    besides: ClassVar[tuple[str, ...]] = ()

    name: str = Field(min_length=1)
    type: str
    parameters: dict[str, float] = Field(default_factory=dict)
    seconds: float | None = Field(default=None, gt=0.0)

    def __init_subclass__(
        cls,
        kind: str = "",
        verb: Verb | None = None,
        gives: Gives | None = None,
        besides: tuple[str, ...] = (),
        **more: Any,
    ) -> None:
        super().__init_subclass__(**more)
        cls.kind, cls.gives, cls.besides = kind, gives or cls.gives, besides or cls.besides
        if verb is not None:
            cls.verb = staticmethod(verb)
        if kind:
            STEPS[kind] = cls

    @property
    def varied(self) -> tuple[str, ...]:
        """The parameters that vary in it."""
        return ()

    @property
    def plane(self) -> tuple[str, str] | None:
        """The two parameters of a curve of bifurcations, or of isolas; None for any other result."""
        return None

    def curves(self) -> Iterator[tuple[Key, Curve]]:
        """The branches and motions of earlier analyses that it starts from, each with its key."""
        for name in type(self).model_fields:
            value = getattr(self, name)
            if isinstance(value, Curve):
                yield (name,), value
            elif isinstance(value, list):
                yield from (((name, i), part) for i, part in enumerate(value) if isinstance(part, Curve))

    def needs(self) -> list[tuple[Key, str]]:
        """The analyses whose results it starts from: the key that names each, and the name."""
        return [(curve.key(*place), curve.analysis) for place, curve in self.curves()]

    def arguments(self, context: CheckContext | Context) -> dict[str, Any]:
        """The arguments of its verb that are given, as that takes them."""
        without = (*Step.model_fields, *self.besides)
        own = {name: getattr(self, name) for name in type(self).model_fields if name not in without}
        return {n: _as_tuples(value) for n, value in own.items() if value is not None and not isinstance(value, Curve)}

    def check(self, around: CheckContext) -> Iterator[Complaint]:
        """What is wrong with the arguments, before any work."""
        for place, curve in self.curves():
            yield from curve.check(place, around)
        for name, given in type(self).model_fields.items():
            for mark in given.metadata:
                if isinstance(mark, Checked):
                    yield from tried(name, partial(mark.by, around.system, getattr(self, name)))
        for name in [name for name in self.varied if name in self.parameters]:
            yield ("parameters", name), "is a parameter that varies: its range is in bounds"

    def known(self, around: CheckContext) -> Known | None:
        """What is known of its motions before it runs; None where that is nothing, or they are none."""
        return None

    def computed(self, context: Context, *first: Any, **more: Any) -> Any:
        """What its verb gives with `first` in place of the system, and with other arguments besides."""
        given = {**self.arguments(context), **more, "progress": context.progress}
        return type(self).verb(*(first or (context.system,)), **given)

    def run(self, context: Context) -> Result:
        """The result. Raises InputError or ConvergenceError; on Ctrl-C what was computed comes back, or nothing."""
        result: Result = self.computed(context)
        return result


def tried(key: str, call: Callable[[], Any]) -> Iterator[Complaint]:
    """The complaint of a call that refuses its input, if it does, at a key of the table (empty: the whole table)."""
    try:
        call()
    except InputError as error:
        yield ((key,) if key else ()), str(error)


def check_varied(
    around: CheckContext, name: str, bounds: Any, keys: tuple[str, str] = ("parameter", "bounds")
) -> Iterator[Complaint]:
    """What is wrong with a parameter that varies, or else with its range."""
    unknown = list(tried(keys[0], lambda: check_parameter(around.system, name)))
    yield from unknown or tried(keys[1], lambda: check_bounds(around.system, name, bounds))


# ------------------------------------------------------------------------------------------------- motions of a branch
class Curve(Section):
    """A branch of an earlier analysis; the name of that alone stands for a table with no more in it.

    Of a diagram one of its branches, by number or by how its label begins; of isolas the curve of limit points of one
    of them, or with `at`, a value of the parameter, its closed branch there.
    """

    analysis: str
    branch: int | None = Field(default=None, ge=0)
    label: str | None = Field(default=None, min_length=1)
    isola: int | None = Field(default=None, ge=0)
    at: float | None = None
    _is_name: bool = PrivateAttr(default=False)

    @model_validator(mode="wrap")
    @classmethod
    def _read(cls, given: Any, read: Callable[[Any], Self]) -> Self:
        if not isinstance(given, str | Mapping | Curve):
            raise ValueError(f"must be a text or a table, not {given!r}")
        curve = read({"analysis": given} if isinstance(given, str) else given)
        curve._is_name = isinstance(given, str)
        return curve

    @model_serializer(mode="wrap")
    def _written(self, write: Callable[[Self], Any]) -> Any:
        return self.analysis if self._is_name else write(self)

    @property
    def words(self) -> str:
        """How messages and titles name it."""
        if self.label is not None:
            return f"{self.analysis}, branch {self.label!r}"
        if self.isola is not None:
            return f"{self.analysis}, isola {self.isola}" + ("" if self.at is None else f" at {self.at:g}")
        return self.analysis if self.branch is None else f"{self.analysis}, branch {self.branch}"

    def key(self, *place: str | int) -> Key:
        """The key at which the name of the analysis stands, that of the curve being `place`."""
        return place if self._is_name else (*place, "analysis")

    def check(self, place: Key, around: CheckContext) -> Iterator[Complaint]:
        """Refuse an analysis that is not there, not before this one, or gives no branch, and a choice too vague."""
        name, key = self.analysis, self.key(*place)
        if name not in around.before:
            yield key, f"there is no analysis {name!r} before this one{suggest(name, around.before)}"
            return
        gives = around.before[name].gives
        for choice, of in (("branch", "diagram"), ("label", "diagram"), ("isola", "isolas"), ("at", "isolas")):
            if getattr(self, choice) is not None and of != gives:
                what = "looks for no isolas" if of == "isolas" else f"gives {_WORDS[gives]}, not a diagram"
                yield (*place, choice), f"the analysis {name!r} {what}: leave {choice} out"
        if gives == "table":
            yield key, f"the analysis {name!r} gives no branch to start from"
        elif gives == "isolas" and self.isola is None:
            example = f'{{ analysis = "{name}", isola = 0, at = 0.3 }}; without at is its curve of limit points'
            yield key, f"the analysis {name!r} gives isolas: say which, and at which value, {example}"
        elif gives == "isolas" and self.at is not None and getattr(self, "bifurcation", None) in _ENDS:
            yield (*place, "at"), "an end of an isola has a value of its own: leave at out"
        elif gives == "diagram" and self.branch is not None and self.label is not None:
            yield key, "choose a branch of the diagram by its number or by its label, not by both"
        elif gives == "diagram" and self.branch is None and self.label is None:
            example = f'{{ analysis = "{name}", branch = 0 }} (the response) or label = "2T"'
            yield key, f"the analysis {name!r} gives a diagram: say which of its branches, {example}"

    def of(self, results: Mapping[str, Result]) -> Branch:
        """The branch that the analysis gave, or one of a diagram or of an isola; InputError where there is none."""
        result = results.get(self.analysis)
        if isinstance(result, Isolas):
            isola = self.isola_of(result)
            return isola.limit_points if self.at is None else isola.at(self.at)
        if isinstance(result, BifurcationDiagram):
            which = self.branch if self.label is None else self.label
            assert which is not None
            try:
                return result[which].branch
            except InputError as error:
                raise InputError(f"{self.analysis!r}: {error}") from None
        if not isinstance(result, Branch):
            raise InputError(f"the analysis {self.analysis!r} gave no branch")
        return result

    def isola_of(self, isolas: Isolas) -> Isola:
        """The isola that is named; InputError where it was not found."""
        number = self.isola or 0
        if number >= len(isolas):
            count = "no isola" if not len(isolas) else f"only {len(isolas)} isola{'s' * (len(isolas) > 1)}"
            raise InputError(f"{self.analysis!r} found {count}, so that there is none with number {number}")
        return isolas[number]


class Motion(Curve):
    """One motion of an earlier branch: a point (the last one), a bifurcation of a kind, the point nearest to values.

    Of isolas the bifurcations "isola_centre" and "isola_merging" are the ends of one.
    """

    point: int | None = None
    bifurcation: str | None = None
    index: int = 0
    nearest: dict[str, float] | None = None

    def check(self, place: Key, around: CheckContext) -> Iterator[Complaint]:
        """As of a curve, and what is wrong with the choice."""
        yield from super().check(place, around)
        yield from self.check_choice(place, around.system)

    def check_choice(self, place: Key, system: System) -> Iterator[Complaint]:
        """What is wrong with the choice of a motion, as far as that is known before the branch is."""
        if sum(way is not None for way in (self.point, self.bifurcation, self.nearest)) > 1:
            yield place, "choose by point, by bifurcation or by nearest, not by several of them"
        if self.bifurcation is not None and self.bifurcation not in KINDS:
            kinds = suggest_kind(self.bifurcation)
            yield (*place, "bifurcation"), f"there is no kind of bifurcation {self.bifurcation!r}{kinds}"
        known = ["omega", "amplitude", *system.parameters]
        for name in self.nearest or {}:
            if name not in known:
                yield (*place, "nearest", name), f"neither omega, amplitude nor a parameter{suggest(name, known)}"

    def chosen(self, results: Mapping[str, Result]) -> Any:
        """The point or bifurcation of an earlier branch; InputError where there is none."""
        result, kind = results.get(self.analysis), self.bifurcation
        if isinstance(result, Isolas) and kind in _ENDS:
            isola = self.isola_of(result)
            end = isola.born if kind == "isola_centre" else isola.merges
            if end is None:
                raise InputError(f"{self.words} has no {kind}: {'; '.join(isola.reasons)}")
            return end
        branch = self.of(results)
        words = repr(self.analysis) if self.words == self.analysis else self.words
        if kind is not None:
            met = branch.bifurcations[kind]
            if not -len(met) <= self.index < len(met):
                count = "no" if not met else f"only {len(met)}"
                raise InputError(f"{words} has {count} {kind}, so that there is none with index {self.index}")
            return met[self.index]
        if self.nearest is not None:
            distance = np.zeros(len(branch))
            for name, value in self.nearest.items():
                values = branch.amplitude if name == "amplitude" else branch.parameter(name)
                distance += ((values - value) / max(float(np.ptp(values)), abs(value), 1e-300)) ** 2
            return branch.points[int(np.argmin(distance))]
        point = -1 if self.point is None else self.point
        if not -len(branch) <= point < len(branch):
            raise InputError(f"{words} has {len(branch)} points, so that there is no point {point}")
        return branch.points[point]
