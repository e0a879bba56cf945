"""Laws known in closed form as one parameter changes: what elements tell at its values, packed for compiled code.

Only elements that have the parameter in a coefficient are asked again. `group_force.PackedLaws` of whole sets of
parameter values costs several times as much, and solving for one point asks for some four of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suboctave.harmonic.basis import Array
from suboctave.harmonic.changes import change_in_pieces, told_change
from suboctave.harmonic.group_force import PackedLaws
from suboctave.harmonic.rates import coefficient_rates
from suboctave.lazy import lazy
from suboctave.model.element import Element
from suboctave.model.sampling import PiecewiseLinear, Sampling, SharpSampling

if TYPE_CHECKING:
    from suboctave.harmonic.balance import HarmonicBalance

__all__ = ["ChangingLaws", "LinearLaws", "PackedChanges", "ToldLaws"]

_NO_PIECES, _NO_STEPS = np.zeros((0, 5)), np.zeros((0, 6))


class PackedChanges(NamedTuple):
    """What a parameter does to laws that are known in closed form, direction by direction, as arrays.

    pieces, first
        Pieces as `law_changes.change_of_pieces` wants them, (P, 5); where each direction's begin, (G + 1,).
    steps, step_first
        Steps as `law_changes.change_of_steps` wants them, (S, 6); where each direction's begin, (G + 1,).
    line
        Rates of constant and slope of the laws that the steps belong to, (G, 2).
    """

    pieces: Array
    first: NDArray[np.int64]
    steps: Array
    step_first: NDArray[np.int64]
    line: Array


class ToldLaws(NamedTuple):
    """The laws at one value of the parameter, and coefficients and laws of the elements that have it."""

    packed: PackedLaws
    elements: list[tuple[Array, Sampling]]


class LinearLaws(NamedTuple):
    """Laws whose coefficients are linear in the parameter, as `moving_laws.laws_at` wants them.

    value
        The parameter where they are told.
    linear, rounded, rest
        Pieces and rounded stops that have it (None without any); constant and slope of the other steps' laws, (G, 2).
    """

    value: float
    linear: Array | None
    rounded: Array | None
    rest: Array


@dataclass(frozen=True, eq=False)
class _Changing:
    """An element with the parameter: it and its number, its direction, rates of its coefficients (None if they change),
    where its pieces or steps begin among all, which of the direction's told laws it is.
    """

    element: Element
    number: int
    direction: int
    rates: Array | None
    at: int
    place: int


class ChangingLaws:
    """The laws of all directions at values of one parameter, and how they change with it there.

    The balance remembers what the elements have told last, for those who ask for whole laws at a point that is solved.
    """

    def __init__(
        self,
        balance: HarmonicBalance,
        name: str,
        changing: list[_Changing],
        kinds: list[Sampling],
        lines: list[list[tuple[float, float]]],
    ) -> None:
        self.name = name
        self._balance = balance
        self._changing = changing
        #: constant and slope of the told laws of every direction
        self._lines = lines
        self._base = balance.packed_laws(balance.values)[0]
        count = len(balance.groups)
        sharp = [isinstance(kind, SharpSampling) for kind in kinds]
        self._steps, self._pieces = any(sharp), not all(sharp)
        ends, step_ends = np.zeros((2, count + 1), dtype=np.int64)
        for item, own in zip(changing, kinds, strict=True):
            many = item.direction + 1
            if isinstance(own, PiecewiseLinear):
                ends[many:] += len(own.pieces)
            elif isinstance(own, SharpSampling):
                step_ends[many:] += len(own.points)
        self._ends, self._step_ends = ends, step_ends
        #: the directions whose line changes
        self._directions = sorted({item.direction for item, one in zip(changing, sharp, strict=True) if one})
        self._none = np.zeros((count, 2))

    @classmethod
    def of(cls, balance: HarmonicBalance, name: str) -> ChangingLaws | None:
        """None where laws are not known in closed form, or the parameter changes one that is no piece or step."""
        packed = balance.packed_laws(balance.values)[0]
        if packed.sampled and not packed.told:
            return None
        _, kinds, _ = balance.coefficients(balance.values)
        touched = dict(balance.changing(name))
        changing, lines = [], []
        pieces = steps = 0
        for g, group in enumerate(balance.groups):
            own = touched.get(g, {})
            told: list[tuple[float, float]] = []
            for i in group.members:
                kind = kinds[i]
                if isinstance(kind, SharpSampling):
                    at, steps, place = steps, steps + len(kind.points), len(told)
                    told.append((kind.constant, kind.slope))
                elif isinstance(kind, PiecewiseLinear):
                    at, pieces, place = pieces, pieces + len(kind.pieces), 0
                elif i in own:
                    return None
                if i in own:
                    changing.append(_Changing(balance.elements[i], i, g, own[i], at, place))
            lines.append(told)
        return cls(balance, name, changing, [kinds[item.number] for item in changing], lines)

    @lazy
    def linear(self) -> LinearLaws | None:
        """The same for compiled code that asks no element; None where coefficients are not linear in the parameter, or
        a law is a sum of other than pieces and rounded stops.
        """
        linear: list[tuple[float, ...]] = []
        rounded: list[tuple[float, ...]] = []
        touched = set()
        for item in self._changing:
            if item.rates is None:
                return None
            c = item.element.coefficient_values(self._balance.values)
            kind, own, by = item.element.sampling(c), c.tolist(), item.rates.tolist()
            if isinstance(kind, PiecewiseLinear):
                for at, p in enumerate(kind.pieces, item.at):
                    linear.append((at, p.side, own[p.stiffness], own[p.gap], by[p.stiffness], by[p.gap]))
            elif isinstance(kind, SharpSampling) and kind.rounded is not None:
                touched.add((item.direction, item.place))
                for at, r in enumerate(kind.rounded, item.at):
                    numbers = [rows[i] for rows in (own, by) for i in (r.stiffness, r.gap, r.sharpness)]
                    rounded.append((at, item.direction, r.side, *numbers))
            else:
                return None
        rest = np.zeros((len(self._lines), 2))
        for g, lines in enumerate(self._lines):
            for place, line in enumerate(lines):
                if (g, place) not in touched:
                    rest[g] += line
        value = float(self._balance.values[self.name])
        return LinearLaws(value, np.array(linear) if linear else None, np.array(rounded) if rounded else None, rest)

    def room(self, linear: LinearLaws) -> tuple[PackedLaws, PackedChanges]:
        """Arrays of the laws and their changes for `moving_laws.laws_at` to fill."""
        base, changed = self._base, linear.linear is not None
        pieces = base.pieces.copy() if changed else base.pieces
        steps, line, moved = base.steps, base.line, self._none
        places = base.places
        if linear.rounded is not None:
            steps, line, moved = steps.copy(), line.copy(), np.empty(line.shape)
            places = places[0].copy(), places[1].copy()
        packed = PackedLaws(
            pieces, base.owner, base.first, base.polynomial, steps, base.step_owner, line, base.step_first, places,
            base.sampled, base.told,
        )  # fmt: skip
        pieces_by = _NO_PIECES if linear.linear is None else np.empty((len(linear.linear), 5))
        steps_by = _NO_STEPS if linear.rounded is None else np.empty((len(linear.rounded), 6))
        return packed, PackedChanges(pieces_by, self._ends, steps_by, self._step_ends, moved)

    def at(self, values: Mapping[str, float]) -> ToldLaws:
        """The laws at parameter values of which only this one differs from the balance's."""
        base = self._base
        if not self._changing:
            return ToldLaws(base, [])
        pieces = base.pieces.copy() if self._pieces else base.pieces
        steps, line, places = base.steps, base.line, base.places
        if self._steps:
            steps, line = steps.copy(), line.copy()
        lines, told = self._lines, []
        for item in self._changing:
            c = item.element.coefficient_values(values)
            kind = item.element.sampling(c)
            told.append((c, kind))
            self._balance.remember(item.number, values, c, kind)
            at = item.at
            if isinstance(kind, PiecewiseLinear):
                own = c.tolist()
                for piece in kind.pieces:
                    pieces[at, 0], pieces[at, 1] = own[piece.stiffness], own[piece.gap]
                    at += 1
            elif isinstance(kind, SharpSampling) and kind.steps is not None:
                for point, width, step in zip(kind.points, kind.widths, kind.steps, strict=True):
                    steps[at, 0], steps[at, 1], steps[at, 2] = point, width, step
                    at += 1
                if lines is self._lines:
                    lines = [own.copy() for own in lines]
                lines[item.direction][item.place] = kind.constant, kind.slope
        if self._steps:
            places = (steps[:, 0].copy(), steps[:, 1].copy())
            for g in self._directions:
                line[g, 0], line[g, 1] = sum([own[0] for own in lines[g]]), sum([own[1] for own in lines[g]])
        packed = PackedLaws(
            pieces, base.owner, base.first, base.polynomial, steps, base.step_owner, line, base.step_first, places,
            base.sampled, base.told,
        )  # fmt: skip
        return ToldLaws(packed, told)

    def changes(self, values: Mapping[str, float], told: ToldLaws) -> PackedChanges | None:
        """How they change there; None where an element does not tell that. `told`: what `at` has given."""
        pieces: list[tuple[float, ...]] = []
        steps: list[tuple[float, ...]] = []
        line = self._none.copy() if self._steps else self._none
        for item, (c, kind) in zip(self._changing, told.elements, strict=True):
            rates = item.rates
            if rates is None:
                rates = coefficient_rates(item.element, values, {self.name: 1.0})
            if isinstance(kind, PiecewiseLinear):
                pieces += change_in_pieces(kind, c, rates)
                continue
            found = told_change(item.element, kind, c, rates)
            if found is None:
                return None
            steps += found[0]
            constant, slope = found[1]
            line[item.direction, 0] += constant
            line[item.direction, 1] += slope
        packed = np.array(pieces) if pieces else _NO_PIECES
        return PackedChanges(packed, self._ends, np.array(steps) if steps else _NO_STEPS, self._step_ends, line)
