"""`find_isolas`: closed branches that no sweep leads to, over a design parameter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from suboctave.analysis.branch import Branch
from suboctave.analysis.checks import check_bounds, check_parameter, check_range, check_system, make_settings
from suboctave.analysis.diagram import bifurcation_diagram
from suboctave.analysis.isola import Isola, Isolas
from suboctave.analysis.isola_life import Life, life_of
from suboctave.analysis.isola_survey import Loop, Survey
from suboctave.analysis.limit_curves import Leg
from suboctave.analysis.making import Harmonics, rule_of
from suboctave.analysis.progress import reporting, timed
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.errors import ConvergenceError, InputError
from suboctave.model.system import System
from suboctave.stability import StabilityMethod

__all__ = ["find_isolas"]


@timed
def find_isolas(
    system: System,
    omega: tuple[float, float],
    parameter: str,
    bounds: tuple[float, float],
    harmonics: Harmonics = "adaptive",
    *,
    values: int | Sequence[float] = 5,
    depth: int = 1,
    max_curves: int = 64,
    max_step: float | None = None,
    observe: int | None = None,
    progress: Any = None,
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
    stability: StabilityMethod | str | None = None,
) -> Isolas:
    """docs"""
    check_parameter(system, parameter)
    low, high = sorted(check_bounds(system, parameter, bounds))
    first, last = sorted(check_range("omega", omega, positive=True))
    check_system(system, (first, last))
    rule_of(harmonics)
    make_settings(system, max_step, observe, (), newton, stepping, stability, None)
    places = _values(values, low, high)
    options: dict[str, Any] = {
        "max_step": max_step, "observe": observe, "newton": newton, "stepping": stepping, "stability": stability,
    }
    tracking = {**options, "omega": (0.5 * first, 2.0 * last)}
    with reporting(progress, f"isolas over {parameter}") as report:
        survey = Survey(system, parameter, (low, high), (first, last), options, tracking, max_curves, report)
        for number, value in enumerate(places):
            survey.report(0.5 * number / len(places), f"{parameter} = {value:.6g}")
            _look(survey, value, harmonics, depth)
        lives = _lives(survey, places)
    found = [
        Isola(system, parameter, (first, last), life.ends, (life.low, life.high), life.reasons, life.legs, options,
              life.notes, [(loop.value, loop.branch) for loop in life.loops])
        for life in lives
    ]
    return Isolas(found, system, parameter, (low, high), (first, last), survey.curves, survey.doublings, survey.notes, "")


def _values(values: Any, low: float, high: float) -> list[float]:
    if isinstance(values, int):
        return [float(v) for v in np.linspace(low, high, values)]
    return sorted(float(v) for v in values)


def _look(survey: Survey, value: float, harmonics: Harmonics, depth: int) -> None:
    """Responses at a value of the parameter and what bifurcates from them: limit points and doublings are followed."""
    system = survey.system.with_parameters({survey.name: value})
    for branch, level in _branches(survey, system, harmonics, depth):
        if level < depth:
            for item in branch.bifurcations["PD"]:
                survey.doubling(item, value)
        loop = survey.loop_of(branch, value)
        if not loop.detached:
            survey.attach(value, set(loop.legs))


def _branches(survey: Survey, system: System, harmonics: Harmonics, depth: int) -> Iterator[tuple[Branch, int]]:
    low, high = survey.omega
    for ends in ((high, low), (low, high)):
        try:
            diagram = bifurcation_diagram(system, ends, depth, harmonics=harmonics, **survey.options)
        except ConvergenceError as failure:
            survey.note(str(failure))
            continue
        for node in diagram:
            yield node.branch, node.depth
        root = diagram[0].branch
        if len(root) and root.points[-1].orbit.omega == ends[1]:
            return


def _lives(survey: Survey, places: list[float]) -> list[Life]:
    lives: list[Life] = []
    for leg, value in _starts(survey, lives, places):
        loop = survey.loop(leg, value)
        if loop is None:
            continue
        if loop.detached:
            lives.append(life_of(loop, survey))
        else:
            survey.attach(value, set(loop.legs))
    return lives


def _starts(survey: Survey, lives: list[Life], places: list[float]) -> Iterator[tuple[Leg, float]]:
    done = set()
    while True:
        centres = [(leg, upper, e) for leg in survey.legs for upper in (False, True)
                   if (e := leg.end(upper)) is not None and e.isola == "isola_centre" and id(e) not in done]
        if not centres:
            break
        leg, upper, event = centres[0]
        done.add(id(event))
        if any(life.has(event) for life in lives):
            continue
        value = event.parameter(survey.name)
        nxt, _ = next(iter(survey.critical(leg.nu, value, not upper)), (survey.bounds[0] if upper else survey.bounds[1], []))
        yield leg, 0.5 * (value + nxt)
    for value in places:
        for leg in list(survey.legs):
            if leg.contains(value) and leg not in survey.attached.get(value, set()) and not any(l.covers(leg, value) for l in lives):
                yield leg, value
