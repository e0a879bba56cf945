"""Curves of bifurcations over a design parameter, each once, and the values at which the regimes may change.

A bifurcation met on a branch at some value of the parameter is followed over the parameter unless it lies on a curve
that is known. The regimes can change their order only at `critical` values: where a curve turns, ends, or has a point
of codimension two, where the other multipliers of its motions cross the unit circle, and where it leaves the range of
omega.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from suboctave.analysis.borders import Border, borders_of
from suboctave.analysis.identity import gap_to
from suboctave.analysis.limit_curves import bifurcation_at_value
from suboctave.analysis.making import Harmonics
from suboctave.analysis.track import track
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.kinds import LIMIT_POINT
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.continuation.linear import one_thread
from suboctave.errors import ConvergenceError, InputError
from suboctave.interruption import Interruption, pass_on
from suboctave.model.system import System

__all__ = ["Atlas"]

#: frequencies of one bifurcation located twice differ by less, relatively
_NEAR = 2e-5
#: events closer to each other, in shares of the parameter's range, are one
_TOGETHER = 1e-9


@dataclass(eq=False)
class Atlas:
    """What is known of the bifurcations of a system over omega and a design parameter.

    system, name, bounds, omega
        What is looked at, `bounds` and `omega` ascending.
    harmonics, options
        For the verbs that follow branches.
    most
        Curves after which no more are followed.
    interruption
        What stopped the work before its end.
    """

    system: System
    name: str
    bounds: tuple[float, float]
    omega: tuple[float, float]
    harmonics: Harmonics
    options: dict[str, Any]
    most: int
    curves: list[TrackedBranch] = field(default_factory=list)
    borders: list[Border] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    report: Callable[[float, str], None] | None = None
    interruption: Interruption | None = None
    _lost: list[tuple[float, Bifurcation]] = field(default_factory=list)

    @property
    def span(self) -> float:
        """Width of the parameter's range."""
        return self.bounds[1] - self.bounds[0]

    def note(self, text: str) -> None:
        """Something that could not be settled, told once."""
        if text not in self.notes:
            self.notes.append(text)

    def say(self, share: float, where: str) -> None:
        """Tell whoever wants to know."""
        if self.report is not None:
            self.report(share, where)

    def add(self, curve: TrackedBranch) -> None:
        """A curve in (omega, parameter) becomes known."""
        self.curves.append(curve)
        self.borders += borders_of(curve, self.name, "omega")

    # ------------------------------------------------------------------------------------------------------- borders
    def border_of(self, item: Bifurcation, value: float) -> Border | None:
        """The known border that a bifurcation at a value of the parameter lies on."""
        found = [(self._distance(border, item, value), border) for border in self.borders]
        near = [pair for pair in found if pair[0] is not None]
        return min(near, key=lambda pair: pair[0] or 0.0)[1] if near else None

    def _distance(self, border: Border, item: Bifurcation, value: float) -> float | None:
        """How far off a bifurcation, or its mirror image, lies, in units of what is allowed; None if too far, or
        something else.
        """
        if border.kind != item.kind or border.nu != item.orbit.basis.nu or not border.contains(value):
            return None
        return gap_to(item.orbit, border.nodes, self.name, images=True)

    def known(self, item: Bifurcation, value: float) -> Border | None:
        """The border that a bifurcation lies on, followed over the parameter if it is new; None if that fails."""
        border = self.border_of(item, value)
        if border is not None or self._is_lost(item, value):
            return border
        where = f"{item.kind} at omega = {item.omega:.6g}, {self.name} = {value:.6g}"
        if len(self.curves) >= self.most:
            self.note(f"max_curves={self.most} curves were followed: the {where} was not")
            return None
        self.say(-1.0, where)
        around = 0.5 * self.omega[0], 2.0 * self.omega[1]
        try:
            curve = track(item, self.name, self.bounds, omega=around, **self.options)
            pass_on(curve.interruption)
            self.add(curve)
            border = self.border_of(item, value)
            if border is None:
                self.note(f"the {where} is not on its curve")
        except (ConvergenceError, InputError) as failure:
            self.note(f"the {where} could not be followed over {self.name}: {failure}")
        if border is None:
            self._lost.append((value, item))
        return border

    def _is_lost(self, item: Bifurcation, value: float) -> bool:
        return any(
            v == value and b.kind == item.kind and abs(b.omega - item.omega) <= _NEAR * item.omega
            for v, b in self._lost
        )

    def limit_point(self, border: Border, value: float) -> Bifurcation:
        """The limit point of a border at a value of the parameter; ConvergenceError where it is not found."""
        index, share = border.around(value)
        beside = [node.orbit for node in border.nodes[index : index + 2]]
        orbit = max(beside, key=lambda o: o.basis.harmonics)
        a, b = (o.basis.resized(o.coefficients, orbit.basis.filled) for o in beside)
        expected = float(border.across(value))
        span = float(np.ptp(border.positions)) or expected
        x = a + share * (b - a)
        options = border.curve.options
        with one_thread():
            found = bifurcation_at_value(LIMIT_POINT, orbit, x, expected, self.name, value, span, options)
        if self._distance(border, found, value) is None:
            raise ConvergenceError(
                f"the limit point near omega = {expected:.6g}, {self.name} = {value:.6g} was not found again"
            )
        return found

    # ------------------------------------------------------------------------------------------------ critical values
    def critical(self) -> list[float]:
        """Values of the parameter, ascending, bounds included, at which the order of the regimes may change."""
        found = [*self.bounds]
        for curve in self.curves:
            for event in curve.bifurcations.met:
                if isinstance(event, TrackedEvent) and (event.kind != "extremum" or event.parameter_name == self.name):
                    found.append(event.parameter(self.name))
            values, stable = curve.parameter(self.name), curve.stable
            events = np.array([e.arclength for e in curve.bifurcations.met])
            for i in np.nonzero(stable[:-1] != stable[1:])[0]:
                start, stop = curve.arclength[i], curve.arclength[i + 1]
                if not np.any((events >= start) & (events <= stop)):
                    found.append(float(0.5 * (values[i] + values[i + 1])))
            if not curve.closed:
                found += [float(values[0]), float(values[-1])]
        for border in self.borders:
            for end in self.omega:
                found += border.values_at(end)
        low, high = self.bounds
        slack = _TOGETHER * self.span
        kept: list[float] = []
        for value in sorted(v for v in found if low <= v <= high):
            if not kept or value - kept[-1] > slack:
                kept.append(value)
        return kept
