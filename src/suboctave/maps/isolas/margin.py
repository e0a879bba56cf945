"""How far a design is from one without an isolated resonance.

The isola exists up to where it is born, `q = born(p)`, q the design parameter and p others. In parameters measured by
scales, `y = (p - p_0) / s`, the nearest design without it is the point of the surface `g = born(p) - q = 0` nearest to
the origin. It is found as the design point of a reliability analysis is (Hasofer & Lind, J. Eng. Mech. Div. 100 (1974)
111-121; Rackwitz & Fiessler, Computers & Structures 9 (1978) 489-494),

    y <- (g' . y - g) g' / |g'|^2,

with the birth located anew at every y, by Newton's method, and g' its sensitivity there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Unpack

import numpy as np

from suboctave.analysis.locate_extremum import locate_extremum
from suboctave.analysis.sensitivity import foretold, sensitivity
from suboctave.arguments import checked
from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation.linear import length
from suboctave.errors import ConvergenceError, InputError, is_number, shortened, suggest
from suboctave.interruption import check_time, limited
from suboctave.maps.isolas.result import Isola
from suboctave.options import RunOptions, with_options
from suboctave.progress import reporting

#: most iterations, and change of the scaled parameters and of g over its slope at which they end
_ITERATIONS, _CLOSE = 50, 1e-9
#: longest step in scaled parameters, and shortest one, in units of the last, at which a birth is looked for
_LONGEST, _SHORTEST = 0.5, 1e-3


@checked(result=True)
@dataclass(frozen=True, repr=False)
class DesignMargin:
    """The nearest design without an isola.

    distance
        Norm of the scaled changes.
    changes, values
        What each parameter changes by, and its value then.
    scaled
        The changes in units of their scales.
    design
        The values of the parameters that it is measured from.
    end
        The birth, or the merging, that lies at the design there.
    linear
        The distance to first order: from sensitivities at the design alone.
    """

    distance: float
    changes: Mapping[str, float]
    values: Mapping[str, float]
    scaled: Mapping[str, float]
    design: Mapping[str, float]
    end: TrackedEvent = field(repr=False)
    linear: float = 0.0

    def __repr__(self) -> str:
        what = "is born" if self.end.isola == "isola_centre" else "merges"
        lines = [f"Design margin {self.distance:.6g} ({self.linear:.6g} to first order): there the isola {what}"]
        lines += [
            f"  {name:<12}{self.design[name]:>12.7g} -> {value:<12.7g} {self.scaled[name]:+.4g} of its scale"
            for name, value in self.values.items()
        ]
        return "\n".join(lines)


@with_options(RunOptions)
@limited
def design_margin(
    isola: Isola,
    *,
    by: str | Sequence[str],
    at: float | None = None,
    scales: Mapping[str, float] | None = None,
    end: str = "born",
    **options: Unpack[RunOptions],
) -> DesignMargin:
    """The smallest change of parameters, measured by scales, with which an isola is gone.

    Parameters
    ----------
    isola
        One of what `find_isolas` gives.
    by
        The parameters that may change; the design parameter may be among them.
    at
        Value of the design parameter, within the isola's range; by default that of the system.
    scales
        Change of each parameter that counts as one, in its unit: tolerances, or what can be afforded. By default its
        value, so that changes are shares.
    end
        "born": to where the closed branch vanishes; "merges": to where it joins the others.

    Raises
    ------
    InputError
        Wrong input, before any work.
    ConvergenceError
        If the birth cannot be followed to a design without the isola.
    """
    if not isinstance(isola, Isola):
        raise InputError(f"design_margin is of one of the isolas that find_isolas gives, not {shortened(isola)}")
    if end not in ("born", "merges"):
        raise InputError(f"end is 'born' or 'merges', not {end!r}{suggest(str(end), ('born', 'merges'))}")
    start = isola.born if end == "born" else isola.merges
    if start is None:
        raise InputError(f"where this isola {end} is not known: {'; '.join(isola.reasons)}")
    here = isola.system.parameters[isola.parameter] if at is None else at
    if not (is_number(here) and here in isola):
        low, high = isola.range
        raise InputError(f"no isola at {isola.parameter} = {here}: it exists from {low:.6g} to {high:.6g}; give at=")
    surface = _Surface.of(isola, by, float(here), scales)
    y, linear = np.zeros(len(surface.names)), 0.0
    item: TrackedEvent = start
    with reporting(options.get("progress"), "design margin") as report:
        for number in range(_ITERATIONS):
            check_time()
            if report is not None:
                report(number / _ITERATIONS, f"{length(y):.4g} away")
            gap, slope = surface.at(item, y)
            steep = length(slope)
            if not steep > 0.0:
                raise ConvergenceError(f"none of {', '.join(surface.names)} moves where the isola is {end}")
            linear = linear if number else abs(gap) / steep
            step = (slope @ y - gap) / steep**2 * slope - y
            size = length(step)
            if size <= _CLOSE * max(1.0, length(y)) and abs(gap) <= _CLOSE * steep:
                return surface.margin(item, y, linear)
            item, y = surface.followed(item, y, step * min(1.0, _LONGEST / size))
    raise ConvergenceError(
        f"no nearest design without the isola was found: {_ITERATIONS} steps lead {length(y):.4g} away"
    )


@dataclass(frozen=True)
class _Surface:
    """Where an end of the isola lies at the design, in scaled parameters.

    q, here: the design parameter and its value; names, design, sizes: the parameters that may change, their values and
    scales.
    """

    q: str
    here: float
    names: tuple[str, ...]
    design: np.ndarray
    sizes: np.ndarray

    @classmethod
    def of(
        cls, isola: Isola, parameters: str | Sequence[str], here: float, scales: Mapping[str, float] | None
    ) -> _Surface:
        """With arguments of the verb, checked."""
        known = list(isola.system.parameters)
        names = tuple(dict.fromkeys([parameters] if isinstance(parameters, str) else parameters))
        if not names:
            raise InputError("by is empty: name the parameters that may change")
        for name in (*names, *(scales or {})):
            if name not in known:
                raise InputError(f"the system has no parameter {name!r}{suggest(str(name), known)}")
        values = {**isola.system.parameters, isola.parameter: here}
        sizes = {name: abs(values[name]) for name in names} | dict(scales or {})
        for name in names:
            if not (is_number(sizes[name]) and sizes[name] > 0.0):
                why = "is zero" if not values[name] and name not in (scales or {}) else f"has the scale {sizes[name]}"
                raise InputError(f"{name} {why}: give scales={{{name!r}: the change that counts as one}}, above 0")
        design = np.array([values[name] for name in names])
        return cls(isola.parameter, here, names, design, np.array([float(sizes[name]) for name in names]))

    def _values(self, y: np.ndarray) -> dict[str, float]:
        return dict(zip(self.names, (self.design + self.sizes * y).tolist(), strict=True))

    def at(self, item: TrackedEvent, y: np.ndarray) -> tuple[float, np.ndarray]:
        """How far the end lies from the design, in the design parameter, and its derivatives by y."""
        others = [name for name in self.names if name != self.q]
        known = sensitivity(item, by=others) if others else {}
        slope = np.array([-1.0 if name == self.q else known[name][self.q] for name in self.names])
        return item.parameter(self.q) - self._values(y).get(self.q, self.here), slope * self.sizes

    def followed(self, item: TrackedEvent, y: np.ndarray, step: np.ndarray) -> tuple[TrackedEvent, np.ndarray]:
        """The end located anew after a step, or after as much of it as Newton's method can follow."""
        share = 1.0
        while True:
            after, before = self._values(y + share * step), self._values(y)
            changes = {name: after[name] - before[name] for name in self.names if name != self.q}
            try:
                found = locate_extremum(foretold(item, changes)) if changes else item
                if found.isola == item.isola:
                    return found, y + share * step
            except ConvergenceError:
                if share < _SHORTEST:
                    raise
            if share < _SHORTEST:
                raise ConvergenceError(f"where the isola ends turns into another kind of point at {after}")
            share *= 0.5

    def margin(self, item: TrackedEvent, y: np.ndarray, linear: float) -> DesignMargin:
        """The result."""
        values = self._values(y)
        design = dict(zip(self.names, self.design.tolist(), strict=True))
        changes = {name: values[name] - design[name] for name in self.names}
        scaled = dict(zip(self.names, y.tolist(), strict=True))
        return DesignMargin(length(y), changes, values, scaled, design, item, linear)
