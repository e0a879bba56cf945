"""Grazing: a contact that begins or ceases to touch, detected between neighbours of a curve and located.

With u = d . x the relative displacement of an element and b a gap of its law, a motion grazes where

    R(X, omega) = 0,    u(tau) = b,    du/dtau(tau) = 0

in (X, free parameter, tau): a local extremum of u reaches the gap. The force is continuous at a gap, so R_X is
continuous there; it moves like the square root of the penetration beyond (the duration of the young contact), and R_XX
diverges. Newton's method on the system above needs R_X only, and the other two equations are smooth: it converges with
order 3/2. Source of the exponents: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems,
Springer 2008, chapters 6 and 7 (a continuous force with a corner gives a map with a term of order 3/2).

Between two neighbours the extrema of every u are paired and compared with the gap. A second impact, a contact that
lets go for an instant inside its interval, and contacts that come and go within one step are all extrema that pass.
For a law with a rounded corner (`SharpSampling`) the same is reported where the motion just reaches the place at which
the law is sharp: nothing diverges there, but a contact begins all the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from suboctave.bifurcation.contact import GrazingContact
from suboctave.bifurcation.finder import Located, position
from suboctave.bifurcation.gaps import contact_side, gap_extrema, level_rate, levels
from suboctave.bifurcation.grazed import grazed
from suboctave.bifurcation.kinds import BifurcationKind, Sample
from suboctave.bifurcation.solve import AtOnce, Extra, Guess, Singular, Slopes, newton
from suboctave.continuation.linear import length
from suboctave.continuation.newton import NewtonOptions
from suboctave.continuation.point import CurvePoint, between, point_between
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.grazing_instants import passages
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState
from suboctave.model.coupled import reads

#: halvings of a step after which a grazing is left with its bracket
_BISECTIONS = 30
#: halvings for extrema that come and go near a gap, where nothing has been seen to pass
_UNCLEAR = 8


@dataclass(frozen=True)
class Grazing(Singular):
    """A located grazing: with the instant tau in (0, 2 pi)."""

    tau: float = 0.0


class Touch(BifurcationKind):
    """One extremum that passes one gap somewhere between two neighbours.

    tau, share
        Where to look for it: in the period, and on the way from the first neighbour (0) to the second (1).
    maximum, above
        Whether it is a maximum, and whether it lies above the gap at the second neighbour.
    """

    name = "grazing"
    operator = Kind.INTEGER

    def __init__(self, element: int, index: int, tau: float, share: float, maximum: bool, above: bool) -> None:
        self.element = element
        self.index = index
        self.tau = tau
        self.share = share
        self.maximum = maximum
        self.above = above

    def changed(self, a: Sample, b: Sample) -> bool:
        """See `BifurcationKind.changed`."""
        return any(
            (t.element, t.index, t.maximum) == (self.element, self.index, self.maximum) for t in touches(a, b)[0]
        )

    def fraction(self, a: Sample, b: Sample) -> float:
        """See `BifurcationKind.fraction`."""
        return self.share

    def critical(self, found: Singular) -> None:
        """No multiplier need be critical."""
        return

    def contact(self, found: Singular, name: str) -> GrazingContact:
        """What grazes."""
        assert isinstance(found, Grazing)
        state = found.state
        local = state.local(self.element)
        side = contact_side(local, self.index)
        verb = "touch" if self.maximum == (side > 0) else "lift off"
        # a touching extremum is in contact afterwards if it begins, a lifting one is not
        begins = (self.above == (side > 0)) == (verb == "touch")
        return GrazingContact(
            self.element,
            local.element.label,
            levels(local)[self.index],
            found.tau / state.rate,
            f"{'begins' if begins else 'ceases'} to {verb}",
            state.omega if name == "omega" else state.values[name],
        )

    def solve(self, guess: Guess, start: BalanceState | None = None) -> Grazing:
        """Newton's method for the grazing from the nearest extremum of the guess's motion; `start`: the equations
        there, where they have been evaluated.

        Raises
        ------
        ConvergenceError
            If it does not converge.
        """
        start = guess.state() if start is None else start
        tau = np.array([self._nearest(start)])
        direction = read_direction(start, self.element)
        known = self._at_once(guess, start, direction, float(tau[0]))
        if known is not None:
            return known
        high = start.basis.harmonics
        column = np.zeros(start.balance.dimension)
        still = levels(start.local(self.element))[self.index] if guess.name == "omega" else None

        def augmentation(state: BalanceState, extra: Array) -> tuple[list[Extra], Array | None, list[Array]]:
            rows = basis_rows(high, float(extra[0]))
            u = state.x @ direction
            value, slope, curve = (float(row @ u) for row in rows)
            level = levels(state.local(self.element))[self.index] if still is None else still
            size = length(u)

            def height() -> Slopes:
                rate = level_rate(state, self.element, self.index, guess.name)
                return state.balance.packed(np.multiply.outer(rows[0], direction)), -rate, (slope,)

            def rise() -> Slopes:
                return state.balance.packed(np.multiply.outer(rows[1], direction)), 0.0, (curve,)

            return [Extra(value - level, size, height), Extra(slope, size, rise)], None, [column]

        state, extra, residual, iterations = newton(guess, tau, np.ones(1), augmentation, start=start)
        return Grazing(state, None, 0.0, residual, iterations, float(extra[0]) % (2.0 * math.pi))

    def _at_once(self, guess: Guess, start: BalanceState, direction: Array, tau: float) -> Grazing | None:
        """`solve` in one compiled call; None where that does not go."""
        equations = AtOnce.of(guess, start)
        if equations is None:
            return None
        level = float(levels(start.local(self.element))[self.index])
        u = np.concatenate((start.unknowns, (guess.omega, tau)))
        along = np.ascontiguousarray(direction, dtype=float)
        found = equations.search(grazed, guess, u, along, level)
        return None if found is None else Grazing(found[0], None, 0.0, *found[1:], float(u[-1]) % (2.0 * math.pi))

    def rise(self, found: Grazing, name: str) -> Array:
        """Gradient of the extremum's height over the gap by coefficients and free parameter, shape (dimension + 1,)."""
        state = found.state
        value = basis_rows(state.basis.harmonics, found.tau)[0]
        direction = read_direction(state, self.element)
        by_x = state.balance.packed(np.multiply.outer(value, direction))
        return np.append(by_x, -level_rate(state, self.element, self.index, name))

    def _nearest(self, state: BalanceState) -> float:
        """The instant of the extremum of the right kind nearest to tau."""
        for gap in gap_extrema(state):
            if (gap.element, gap.index) == (self.element, self.index):
                candidates = gap.tau[(gap.curve < 0.0) == self.maximum]
                if candidates.size:
                    return float(candidates[np.argmin(1.0 - np.cos(candidates - self.tau))])
        raise ConvergenceError("the motion has no extremum here")


def read_direction(state: BalanceState, element: int) -> Array:
    """The displacement that an element's gaps are places of, in the unknown DOFs."""
    system = state.balance.system
    return state.linear.retain(reads(system.elements[element], system.n))


def basis_rows(high: int, tau: float) -> tuple[Array, Array, Array]:
    """Basis functions at an instant and their first two derivatives by tau, shape (2 H + 1,) each."""
    k = np.arange(1.0, high + 1.0)
    value, slope, curve = np.empty(2 * len(k) + 1), np.empty(2 * len(k) + 1), np.empty(2 * len(k) + 1)
    c, s = np.cos(k * tau), np.sin(k * tau)
    value[0], slope[0], curve[0] = 1.0, 0.0, 0.0
    value[1::2], value[2::2] = c, s
    slope[1::2], slope[2::2] = -k * s, k * c
    curve[1::2], curve[2::2] = -(k**2) * c, -(k**2) * s
    return value, slope, curve


def touches(a: Sample, b: Sample) -> tuple[list[Touch], bool]:
    """Extrema that pass a gap between two neighbours, and whether they explain the numbers of crossings there."""
    found, clear = [], True
    for p, q in zip(a.gaps, b.gaps, strict=True):
        pairs, count, before, after = passages(p.tau, p.value, p.curve, p.level, q.tau, q.value, q.curve, q.level)
        if before == after and not count:
            continue
        explained = 0
        for i, j in pairs[:count]:
            above, maximum = bool(q.value[j] > q.level), bool(q.curve[j] < 0.0)
            # a maximum above the gap and a minimum below it have two crossings beside them
            explained += 2 if above == maximum else -2
            first, second = p.value[i] - p.level, q.value[j] - q.level
            share = float(first / (first - second)) if first != second else 0.5
            way = (q.tau[j] - p.tau[i] + math.pi) % (2.0 * math.pi) - math.pi
            found.append(Touch(p.element, p.index, float(p.tau[i] + share * way), share, maximum, above))
        clear = clear and after - before == explained
    return found, clear


def locate_grazings(
    a: Sample,
    b: Sample,
    options: NewtonOptions,
    make_sample: Callable[[CurvePoint], Sample],
    make_guess: Callable[[Array, CurvePoint, float], Guess],
) -> list[Located]:
    """All grazings between two neighbours, in the order met; arguments as in `finder.locate`.

    What cannot be solved for from the ends of the step is separated by halving it, and bracketed at last.
    """
    if not a.gaps:
        return []
    return sorted(_search(a, b, 0.0, 1.0, 0, options, make_sample, make_guess), key=lambda found: found.fraction)


def _search(
    a: Sample,
    b: Sample,
    low: float,
    high: float,
    depth: int,
    options: NewtonOptions,
    make_sample: Callable[[CurvePoint], Sample],
    make_guess: Callable[[Array, CurvePoint, float], Guess],
) -> list[Located]:
    passing, clear = touches(a, b)
    if not passing and (clear or depth >= _UNCLEAR):
        return []
    solved = [_solved(touch, a, b, make_guess) for touch in passing]
    found = [
        Located(touch, low + s[1] * (high - low), a if s[1] < 0.5 else b, s[0], 0.0)
        for touch, s in zip(passing, solved, strict=True)
        if s is not None
    ]
    if clear and len(found) == len(passing) and not _repeated(found):
        return found
    middle = None
    if depth < _BISECTIONS:
        with suppress(ConvergenceError):
            middle = make_sample(point_between(a.point, b.point, 0.5, options))
    if middle is None:
        width = 0.5 * abs(b.point.parameter - a.point.parameter)
        return found + [
            Located(touch, 0.5 * (low + high), b, None, width)
            for touch, s in zip(passing, solved, strict=True)
            if s is None
        ]
    half = 0.5 * (low + high)
    parts = ((a, middle, low, half), (middle, b, half, high))
    return [item for part in parts for item in _search(*part, depth + 1, options, make_sample, make_guess)]


def _solved(
    touch: Touch, a: Sample, b: Sample, make_guess: Callable[[Array, CurvePoint, float], Guess]
) -> tuple[Grazing, float] | None:
    """The grazing and where between the two neighbours it lies; None if it was not found there."""
    try:
        guess = make_guess(between(a.point, b.point, touch.share), b.point, 0.0)
        found = touch.solve(guess)
    except ConvergenceError:
        return None
    value = found.state.omega if guess.name == "omega" else found.state.values[guess.name]
    fraction = position(a.point, b.point, np.append(found.state.unknowns, value))
    return None if fraction is None or not -0.05 <= fraction <= 1.05 else (found, fraction)


def _repeated(found: list[Located]) -> bool:
    """True if two extrema led to the same grazing."""
    seen = []
    for item in found:
        touch, solution = item.kind, item.solution
        assert isinstance(touch, Touch)
        assert isinstance(solution, Grazing)
        seen.append((touch.element, touch.index, solution.tau, item.fraction))
    return any(
        one[:2] == other[:2] and 1.0 - math.cos(one[2] - other[2]) < 1e-12 and abs(one[3] - other[3]) < 1e-6
        for i, one in enumerate(seen)
        for other in seen[:i]
    )
