"""The study file: TOML to a checked `Study`, or all its mistakes at once, each with its line."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError

from suboctave.errors import Key, path_of, printable, suggest
from suboctave.harmonic.condensed import condense
from suboctave.harmonic.linear_part import LinearPart
from suboctave.model.system import System, describe
from suboctave.study.figures import FIGURES, Figure, StudyCurves
from suboctave.study.fingerprint import code_in
from suboctave.study.mistakes import Lines, Mistake, Mistakes, Section, StudyError
from suboctave.study.outputs import Outputs, check_outputs
from suboctave.study.steps import STEPS, CheckContext, Known, Step
from suboctave.study.sweeps.plan import SweepSection, plan_of
from suboctave.study.system import SystemSection, make_system, overridden
from suboctave.units import UnitSystem
from suboctave.version import __version__

#: a study file is written by hand; anything longer is something else
_LONGEST = 5_000_000
#: characters of the name of an analysis: files are called after it
_LONGEST_NAME = 60


class StudyFile(Section):
    """The sections of a study file; analyses are read one by one, each as the step that it is."""

    title: str = ""
    seconds: float | None = Field(default=None, gt=0.0)
    system: dict[str, Any]
    analyses: list[dict[str, Any]] = Field(min_length=1)
    outputs: dict[str, Any] = Field(default_factory=dict)
    sweep: dict[str, Any] | None = None


@dataclass(frozen=True)
class Study:
    """A study that has been checked and can run.

    source, text
        The file and what it says.
    system
        What vibrates.
    steps
        The analyses in order.
    outputs
        What is written, and where.
    allow_code
        Whether the user has allowed Python code that the file names.
    seconds
        Time limit for all analyses together; None for none.
    sweep
        What is swept over unless `sweep` is given more; None for nothing.
    """

    source: Path
    text: str
    title: str
    system: System
    steps: tuple[Step, ...]
    outputs: Outputs
    allow_code: bool = False
    seconds: float | None = None
    sweep: SweepSection | None = None

    @cached_property
    def keys(self) -> dict[str, str]:
        """Of each analysis what it depends on, as a digest: version, system, arguments, Python code that these name,
        the analyses it starts from.

        Not its time limit: what is finished did not need more.
        """
        keys: dict[str, str] = {}
        system = describe(self.system)
        for step in self.steps:
            content = {
                "version": __version__,
                "system": {**system, "parameters": {**system["parameters"], **step.parameters}},
                "step": {k: v for k, v in step.model_dump(mode="json").items() if k not in ("name", "seconds")},
                "needs": [keys[name] for _, name in step.needs()],
            }
            if code := code_in((content["system"], content["step"])):
                content["code"] = code
            keys[step.name] = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
        return keys

    def linear_part(self) -> LinearPart | None:
        """What the first analysis takes for the structure, made before it: degrees of freedom, unknowns, natural
        frequencies, modes and their error when it is printed. None for one degree of freedom.
        """
        for step in self.steps if self.system.n > 1 else ():
            omega, harmonics = getattr(step, "omega", None), getattr(step, "harmonics", None)
            if omega is not None:
                observe = getattr(step, "observe", None)
                kept = {"harmonics": harmonics} if isinstance(harmonics, int) else {}
                system = self.system.with_parameters(step.parameters) if step.parameters else self.system
                return condense(system, tuple(np.atleast_1d(omega)), **kept, observe=() if observe is None else observe)
        return None

    @property
    def called(self) -> str:
        """The name of the study file, as it is printed and saved."""
        return printable(self.source.name)

    @property
    def folder(self) -> Path:
        """Where outputs go, unless told otherwise: beside the study file."""
        return self.source.parent / (self.outputs.folder or f"{self.source.stem}_results")


def read_study(path: str | Path, allow_code: bool = False) -> Study:
    """A study file, read and checked; nothing is run.

    Raises StudyError (an InputError) with every mistake and its line.
    """
    source = path_of(path)
    text = _text(source)
    content = _parsed(source, text)
    mistakes = Mistakes(str(source), Lines(text))
    sections = _validated(StudyFile, content, (), mistakes, rest=True)
    system = None
    if "system" in sections.model_fields_set:
        section = _validated(SystemSection, sections.system, ("system",), mistakes, rest=True)
        system = make_system(section, source.parent, mistakes, allow_code)
        with mistakes.at("system"):
            units = UnitSystem.of(getattr(section, "units", None))  # said also where something else is wrong
            system = system and system.with_units(str(units) if units else None)
    steps = _steps(getattr(sections, "analyses", []), system, mistakes, allow_code)
    outputs = _outputs(sections.outputs, steps, system, mistakes)
    every = tuple(step for step in steps if step)
    sweep = _sweep(getattr(sections, "sweep", None), system, every, mistakes)
    mistakes.refuse()
    assert system is not None
    return Study(source, text, sections.title, system, every, outputs, allow_code, sections.seconds, sweep)


def _refused(source: Path, message: str, line: int = 0) -> StudyError:
    return StudyError(str(source), [Mistake("", line, message)])


def _text(source: Path) -> str:
    if source.is_dir():
        raise _refused(source, "this is a folder, not a study file")
    try:
        if source.exists() and not source.is_file():  # a pipe or a device never ends
            raise _refused(source, "this is no ordinary file")
        if source.stat().st_size > _LONGEST:
            raise _refused(source, "this is too long for a study file; keep matrices in files")
        return source.read_text(encoding="utf-8-sig")  # some editors put a mark in front
    except FileNotFoundError:
        near = [p.name for p in source.parent.glob("*.toml")] if source.parent.is_dir() else []
        hint = suggest(source.name, near) if near else "; `suboctave new` writes one"
        raise _refused(source, f"there is no such file{hint}") from None
    except UnicodeDecodeError as error:
        raise _refused(source, f"this is no text in UTF-8 ({error.reason})") from None
    except OSError as error:
        raise _refused(source, f"cannot be read: {error.strerror}") from None


def _parsed(source: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        reason, line = "values are nested too deeply", 0
    except ValueError as error:  # TOMLDecodeError, and whole numbers of thousands of digits
        reason = str(error)
        place = re.search(r" \(at line (\d+), column (\d+)\)", reason)
        line = int(place.group(1)) if place else text.count("\n") + 1 if "end of document" in reason else 0
        reason = reason.replace(place.group(0), f", in column {place.group(2)}") if place else reason
        reason = reason.replace(" (at end of document)", ": the file ends in the middle")
    raise _refused(source, f"this is not TOML: {reason}", line)


def _validated(model: Any, given: Mapping[str, Any], prefix: Key, mistakes: Mistakes, rest: bool = False) -> Any:
    """A table as a `model`. What is wrong in it is noted; then None, or with `rest` what is in order by itself is
    given, so that all mistakes are told at once.
    """
    try:
        return model.model_validate(given)
    except ValidationError as error:
        mistakes.add_validation(prefix, error, model)
        wrong = [item["loc"] for item in error.errors(include_url=False)]
    if not rest:
        return None
    kept = {name: value for name, value in given.items() if not any(place[0] == name for place in wrong)}
    if isinstance(values := given.get("parameters"), dict):
        # a parameter whose value is wrong exists: expressions that name it are right
        kept["parameters"] = {**values, **{place[1]: 1.0 for place in wrong if place[0] == "parameters" and place[1:]}}
    return model.model_construct(**kept)


#: stands for a range that is wrong while the rest of an analysis is checked
_SOME_RANGE = [1.0, 2.0]


def _step(kind: type[Step], given: Mapping[str, Any], place: Key, mistakes: Mistakes) -> tuple[Any, set[str | int]]:
    """An analysis; one with keys that are wrong without these, so that all mistakes are told at once, and these keys.
    None where it cannot do without them.
    """
    try:
        return kind.model_validate(given), set()
    except ValidationError as error:
        mistakes.add_validation(place, error, kind)
        wrong = {item["loc"][0] for item in error.errors(include_url=False) if item["loc"]}
    needed = {name for name, key in kind.model_fields.items() if key.is_required()} & wrong
    ranges = dict.fromkeys(needed, _SOME_RANGE)
    try:
        return kind.model_validate({name: v for name, v in given.items() if name not in wrong} | ranges), wrong
    except ValidationError:
        return None, wrong


def _steps(
    analyses: list[dict[str, Any]], system: System | None, mistakes: Mistakes, allow_code: bool
) -> list[Step | None]:
    steps: list[Step | None] = []
    before: dict[str, type[Step]] = {}
    known: dict[str, Known] = {}
    names: set[str] = set()
    for index, given in enumerate(analyses):
        place = ("analyses", index)
        kind = given.get("type")
        if not isinstance(kind, str) or kind not in STEPS:
            missing = f"is missing{suggest('', STEPS)}"
            wrong = f"there is no analysis of the type {kind!r}{suggest(str(kind), STEPS)}"
            mistakes.add((*place, "type"), missing if kind is None else wrong)
            steps.append(None)
        else:
            before_it = len(mistakes)
            step, wrong_keys = _step(STEPS[kind], {"name": kind, **given}, place, mistakes)
            steps.append(step)
            here = step and system and overridden(system, step.parameters, (*place, "parameters"), mistakes)
            if here is not None:
                around = CheckContext(here, before, allow_code, known)
                with mistakes.at(*place):
                    for where, text in step.check(around):
                        if not wrong_keys or (where and where[0] not in wrong_keys):
                            mistakes.add((*place, *where), text)
                    motions = step.known(around)
                    if motions is not None and len(mistakes) == before_it:
                        known[step.name] = motions
        name = given.get("name", kind)
        if not isinstance(name, str):
            continue
        if name in names:
            mistakes.add((*place, "name"), f"two analyses are called {name!r}; give each a name of its own")
        elif len(name) > _LONGEST_NAME:
            mistakes.add((*place, "name"), f"is too long; at most {_LONGEST_NAME} characters")
        elif not re.fullmatch(r"[^\W][\w .-]*", name):
            mistakes.add((*place, "name"), f"{name!r} will not do: letters, digits, spaces, and . - _, no slash")
        names.add(name)
        if isinstance(kind, str) and kind in STEPS:
            before[name] = STEPS[kind]
    return steps


def _sweep(
    given: dict[str, Any] | None, system: System | None, steps: tuple[Step, ...], mistakes: Mistakes
) -> SweepSection | None:
    section: SweepSection | None = None
    if given is not None:
        section = _validated(SweepSection, given, ("sweep",), mistakes)
    if section is not None and system is not None:
        with mistakes.at("sweep"):
            plan_of(system, steps, section.parameters, section.draws, section.seed, section.sampling)
    return section


def _outputs(given: dict[str, Any], steps: list[Step | None], system: System | None, mistakes: Mistakes) -> Outputs:
    plain = dict(given)
    figures = plain.pop("figures", [])
    sections: list[Figure | None] = []
    if not isinstance(figures, list) or not all(isinstance(item, dict) for item in figures):
        mistakes.add(("outputs", "figures"), "are tables: [[outputs.figures]], each with a file")
        figures = []
    for index, item in enumerate(figures):
        kind, place = item.get("kind", "response"), ("outputs", "figures", index)
        if isinstance(kind, str) and kind in FIGURES:
            sections.append(_validated(FIGURES[kind], item, place, mistakes))
        else:
            sections.append(None)
            mistakes.add((*place, "kind"), f"there is no figure of the kind {kind!r}{suggest(str(kind), FIGURES)}")
    outputs: Outputs = _validated(Outputs, plain, ("outputs",), mistakes, rest=True)
    outputs = outputs.model_copy(update={"figures": sections})
    if steps and None not in steps:
        known = {step.name: step for step in steps if step is not None}
        for key, text in check_outputs(outputs, StudyCurves(known, system)):
            mistakes.add(("outputs", *key), text)
    return outputs
