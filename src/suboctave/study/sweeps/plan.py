"""The points of a sweep: a grid, a list, or draws from distributions, checked before any work.

A draw is `F^-1(u)` for each parameter, F its distribution function and u a point of the unit cube: pseudo-random, of a
Latin hypercube, or of a scrambled Sobol sequence. The first draws of more are the same, but for a Latin hypercube.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from suboctave.errors import InputError, Refusals, is_number, shortened, suggest
from suboctave.model.system import System
from suboctave.study.mistakes import Section
from suboctave.study.steps import Step

SAMPLINGS = ("random", "latin hypercube", "sobol")
#: of each distribution the names of its numbers, in the order in which the command line takes them
DISTRIBUTIONS: dict[str, tuple[str, ...]] = {
    "uniform": ("low", "high"),
    "loguniform": ("low", "high"),
    "normal": ("mean", "deviation"),
    "truncated normal": ("mean", "deviation", "low", "high"),
    "lognormal": ("median", "deviation"),
    "triangular": ("low", "mode", "high"),
}
#: a table of evenly spaced values
_RANGE = ("from", "to", "count", "spacing")
#: points of a sweep: all of them are held in memory, and as rows of a table
_MOST = 1_000_000


class SweepSection(Section):
    """The table [sweep] of a study file: what `suboctave sweep` and `suboctave.sweep` do unless they are given more."""

    parameters: dict[str, Any] | list[dict[str, Any]]
    draws: int | None = None
    seed: int = 0
    sampling: str = "random"
    listed: int = Field(default=4, ge=1)


def swept(section: SweepSection) -> list[str]:
    """The names of the parameters that a study sweeps over."""
    return list(section.parameters if isinstance(section.parameters, dict) else section.parameters[0])


@dataclass(frozen=True, eq=False)
class Plan:
    """Where a study is run: `points`, (points, parameters), in the order of `names`.

    axes
        Of a grid the values of each parameter, whose product the points are; else None.
    origin
        What was asked, as JSON.
    """

    names: tuple[str, ...]
    points: np.ndarray
    axes: tuple[np.ndarray, ...] | None
    origin: str

    def __len__(self) -> int:
        return len(self.points)

    def values(self, number: int) -> dict[str, float]:
        """The values of the parameters at a point."""
        return dict(zip(self.names, map(float, self.points[number]), strict=True))

    @property
    def drawn(self) -> bool:
        """Whether points were drawn from distributions."""
        return "draws" in json.loads(self.origin)

    @property
    def words(self) -> str:
        """How many points, and over what."""
        if self.axes is None:
            return f"{len(self)} points over {', '.join(self.names)}"
        sizes = " x ".join(f"{len(axis)} {name}" for name, axis in zip(self.names, self.axes, strict=True))
        return f"{len(self)} points: {sizes}"


def plan_of(
    system: System,
    steps: Sequence[Step],
    parameters: Any,
    draws: int | None = None,
    seed: int = 0,
    sampling: str = "random",
) -> Plan:
    """The points that are asked for; InputError with everything that is wrong."""
    if hasattr(parameters, "to_dict"):  # a pandas table
        parameters = parameters.to_dict("records")
    if isinstance(parameters, Mapping):
        names = list(parameters)
    elif isinstance(parameters, Sequence) and not isinstance(parameters, str):
        names = list(parameters[0]) if parameters and isinstance(parameters[0], Mapping) else []
    else:
        raise InputError(
            "parameters are given as a mapping of names to values or distributions, or as a list of points, each "
            f"{{name: number}}, not {shortened(parameters)}"
        )
    if not names:
        raise InputError('a sweep needs parameters, such as {"gap": [0.1, 0.2, 0.3]}')
    refusals = Refusals()
    for name in names:
        with refusals.at("parameters", name):
            _check_name(system, steps, name)
    refusals.refuse()
    if not isinstance(parameters, Mapping):
        origin = json.dumps({"list": len(parameters)})
        plan = Plan(tuple(names), _listed(names, parameters), None, origin)
    else:
        given = {name: _given(value) for name, value in parameters.items()}
        for name, value in given.items():
            with refusals.at("parameters", name):
                _check_values(name, value)
        refusals.refuse()
        random = any(isinstance(value, Mapping) and "distribution" in value for value in given.values())
        plan = _drawn(given, draws, seed, sampling) if random else _grid(given)
    if not np.isfinite(plan.points).all():
        number, column = np.argwhere(~np.isfinite(plan.points))[0]
        raise InputError(f"{plan.names[column]} has the value {plan.points[number, column]} at point {number}")
    if draws is not None and not plan.drawn:
        raise InputError("draws are of distributions, and no parameter has one: leave draws out", ("draws",))
    _check_extremes(system, plan)
    return plan


def _check_name(system: System, steps: Sequence[Step], name: Any) -> None:
    if name == "omega":
        raise InputError("omega is no parameter of a sweep: analyses follow it, over the range omega = [from, to]")
    if name not in system.parameters:
        raise InputError(f"the system has no parameter {name!r}{suggest(str(name), system.parameters)}")
    fixed = [step.name for step in steps if name in step.parameters]
    if fixed:
        raise InputError(
            f"{name} has a value of its own in the analysis {fixed[0]!r} (parameters): take it out there, else the "
            "sweep does not reach that analysis"
        )
    if steps and all(name in step.varied for step in steps):
        raise InputError(f"{name} varies in every analysis of the study: a sweep over it would change nothing")


def _given(value: Any) -> Any:
    """A number, a list of numbers, a distribution, or a range as an array of its values."""
    if isinstance(value, np.ndarray | range | tuple):
        return list(value)
    return value


def _check_values(name: str, value: Any) -> None:
    if isinstance(value, Mapping):
        if "distribution" in value:
            _check_distribution(name, value)
        else:
            _range_values(name, value)
        return
    values = value if isinstance(value, list) else [value]
    if not values:
        raise InputError(f"{name} has no values")
    wrong = [item for item in values if isinstance(item, bool) or not is_number(item)]
    if wrong:
        raise InputError(
            f"{name}: {shortened(wrong[0])} is no finite number; give numbers, {{from, to, count}}, or {{distribution, "
            "...}"
        )
    if len(set(values)) < len(values):
        twice = next(item for place, item in enumerate(values) if item in values[:place])
        raise InputError(f"{name}: the value {twice:g} is given twice")


def _check_distribution(name: str, value: Mapping[str, Any]) -> None:
    kind = value["distribution"]
    if not isinstance(kind, str) or kind not in DISTRIBUTIONS:
        raise InputError(f"{name}: there is no distribution {shortened(kind)}{suggest(str(kind), DISTRIBUTIONS)}")
    wanted = DISTRIBUTIONS[kind]
    for key in value:
        if key not in (*wanted, "distribution"):
            raise InputError(f"{name}: the {kind} distribution has no {key!r}{suggest(str(key), wanted)}")
    missing = [key for key in wanted if key not in value]
    if missing:
        raise InputError(f"{name}: the {kind} distribution needs {' and '.join(missing)}")
    for key in wanted:
        if isinstance(value[key], bool) or not is_number(value[key]):
            raise InputError(f"{name}: {key} is a finite number, not {shortened(value[key])}")
    low, high, middle = (value.get(key) for key in ("low", "high", "mode"))
    if low is not None and high is not None and not low < high:
        raise InputError(f"{name}: low must be below high, not {low:g} and {high:g}")
    if middle is not None and low is not None and high is not None and not low <= middle <= high:
        raise InputError(f"{name}: mode must lie from low to high, not at {middle:g}")
    for key in ("deviation", "median", *(("low",) if kind == "loguniform" else ())):
        if key in value and value[key] <= 0.0:
            raise InputError(f"{name}: {key} must be positive, not {value[key]:g}")


def _range_values(name: str, value: Mapping[str, Any]) -> np.ndarray:
    """The values of a table {from, to, count, spacing}."""
    for key in value:
        if key not in _RANGE:
            raise InputError(f"{name}: there is no {key!r} of a range{suggest(str(key), (*_RANGE, 'distribution'))}")
    missing = [key for key in _RANGE[:3] if key not in value]
    if missing:
        raise InputError(f"{name}: a range needs {' and '.join(missing)}")
    first, last, count, spacing = value["from"], value["to"], value["count"], value.get("spacing", "linear")
    for key in ("from", "to"):
        if isinstance(value[key], bool) or not is_number(value[key]):
            raise InputError(f"{name}: {key} is a finite number, not {shortened(value[key])}")
    if isinstance(count, bool) or not isinstance(count, int) or not 2 <= count <= _MOST or first == last:
        raise InputError(f"{name}: a range has two ends and a whole number of at least 2 values (count)")
    if spacing not in ("linear", "log"):
        raise InputError(f"{name}: spacing is linear or log, not {shortened(spacing)}")
    if spacing == "log" and not (first > 0.0 and last > 0.0):
        raise InputError(f"{name}: a range with spacing log has positive ends")
    with np.errstate(over="ignore", invalid="ignore"):  # values that are not finite are refused
        return np.geomspace(first, last, count) if spacing == "log" else np.linspace(first, last, count)


def _check_count(count: int) -> None:
    if count > _MOST:
        raise InputError(f"{count} points are too many for one sweep: at most {_MOST}")


def _listed(names: Sequence[str], points: Sequence[Any]) -> np.ndarray:
    """A list of points, each {name: number}, as rows."""
    _check_count(len(points))
    rows = []
    for number, point in enumerate(points):
        if not isinstance(point, Mapping) or set(point) != set(names):
            raise InputError(
                f"point {number} of the list has not the parameters of the first one, {', '.join(names)}: "
                f"{shortened(point)}",
                ("parameters", number),
            )
        for name in names:
            if isinstance(point[name], bool) or not is_number(point[name]):
                raise InputError(
                    f"point {number} of the list: {name} is a finite number, not {shortened(point[name])}",
                    ("parameters", number),
                )
        rows.append([float(point[name]) for name in names])
    return np.array(rows)


def _grid(given: Mapping[str, Any]) -> Plan:
    """All combinations, the last parameter changing fastest."""
    axes = []
    for name, value in given.items():
        values = _range_values(name, value) if isinstance(value, Mapping) else np.atleast_1d(value)
        axes.append(values.astype(float))
    _check_count(int(np.prod([float(len(axis)) for axis in axes])))
    points = np.array(list(itertools.product(*axes)))
    origin = json.dumps({"grid": {name: len(axis) for name, axis in zip(given, axes, strict=True)}})
    return Plan(tuple(given), points, tuple(axes), origin)


def _drawn(given: Mapping[str, Any], draws: Any, seed: Any, sampling: Any) -> Plan:
    """Draws from distributions; a parameter with one number has that number in all of them."""
    for name, value in given.items():
        if not (isinstance(value, Mapping) and "distribution" in value) and not is_number(value):
            raise InputError(
                f"{name} has values and others have distributions: give it a distribution or one number, or sweep over "
                "its values one after the other",
                ("parameters", name),
            )
    if sampling not in SAMPLINGS:
        raise InputError(
            f"there is no sampling {shortened(sampling)}{suggest(str(sampling), SAMPLINGS)}", ("sampling",)
        )
    if isinstance(draws, bool) or not isinstance(draws, int) or draws < 1:
        how = "draws is missing: give" if draws is None else f"draws={shortened(draws)}: give"
        raise InputError(f"{how} how many points are drawn from the distributions, a whole number", ("draws",))
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise InputError(f"seed={shortened(seed)}: give a whole number, from 0", ("seed",))
    if sampling == "sobol" and draws & (draws - 1):
        near = 1 << draws.bit_length()
        raise InputError(f"a Sobol sequence is even at powers of two only: draws={near // 2} or {near}", ("draws",))
    _check_count(draws)
    random = [name for name, value in given.items() if isinstance(value, Mapping)]
    cube = np.clip(_unit_cube(draws, len(random), seed, sampling), 1e-16, 1.0 - 1e-16)
    columns = {name: _quantile(given[name], cube[:, i]) for i, name in enumerate(random)}
    points = np.column_stack([columns.get(name, np.full(draws, given.get(name))) for name in given]).astype(float)
    asked = {name: dict(value) if isinstance(value, Mapping) else value for name, value in given.items()}
    origin = json.dumps({"draws": draws, "seed": seed, "sampling": sampling, "parameters": asked})
    return Plan(tuple(given), points, None, origin)


def _unit_cube(draws: int, dimensions: int, seed: int, sampling: str) -> np.ndarray:
    """Points of the unit cube, (draws, dimensions)."""
    from scipy.stats import qmc

    random = np.random.default_rng(seed)
    if sampling == "random":
        return random.random((draws, dimensions))
    if sampling == "sobol":
        return qmc.Sobol(dimensions, seed=random).random(draws)
    return qmc.LatinHypercube(dimensions, seed=random).random(draws)


def _quantile(value: Mapping[str, Any], share: np.ndarray) -> np.ndarray:
    """Values below which a variable of this distribution lies with the probability `share`."""
    from scipy import stats

    kind = value["distribution"]
    numbers = [float(value[key]) for key in DISTRIBUTIONS[kind]]
    if kind == "uniform":
        low, high = numbers
        result = low + (high - low) * share
    elif kind == "loguniform":
        low, high = numbers
        result = low * (high / low) ** share
    elif kind == "normal":
        mean, deviation = numbers
        result = stats.norm.ppf(share, mean, deviation)
    elif kind == "truncated normal":
        mean, deviation, low, high = numbers
        result = stats.truncnorm.ppf(share, (low - mean) / deviation, (high - mean) / deviation, mean, deviation)
    elif kind == "lognormal":  # deviation of the logarithm
        median, deviation = numbers
        result = stats.lognorm.ppf(share, deviation, scale=median)
    else:
        low, mode, high = numbers
        result = stats.triang.ppf(share, (mode - low) / (high - low), low, high - low)
    return np.asarray(result)


def _check_extremes(system: System, plan: Plan) -> None:
    """That the study makes sense somewhere; what is wrong at single points is told by these."""
    error: InputError | None = None
    for number in {0, len(plan) // 2, len(plan) - 1}:
        try:
            system.with_parameters(plan.values(number))
        except InputError as failure:
            error = failure
        else:
            return
    if error is not None:
        raise error
