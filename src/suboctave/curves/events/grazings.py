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
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from suboctave.bifurcation.gaps import (
    GapExtrema,
    GrazingContact,
    contact_side,
    gap_extrema,
    height_at,
    level_of,
)
from suboctave.continuation.newton import NewtonOptions
from suboctave.continuation.point import point_between
from suboctave.curves.events.locate import Guess, Singular, solve
from suboctave.curves.events.monitors import BifurcationKind, Located, solved_between
from suboctave.curves.kinds.grazing import GrazingContactEquations
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.harmonic.aft.corners import FLAT
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.trigonometric import passages

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
        own = self.element, self.index, self.maximum
        return any((t.element, t.index, t.maximum) == own for t in touches(a, b)[0])

    def fraction(self, a: Sample, b: Sample) -> float:
        return self.share

    def critical(self, solution: Singular) -> None:
        """No multiplier need be critical."""
        return

    def contact(self, solution: Singular, name: str) -> GrazingContact:
        """What grazes."""
        assert isinstance(solution, Grazing)
        state = solution.state
        local = state.local(self.element)
        side = contact_side(local, self.index)
        verb = "touch" if self.maximum == (side > 0) else "lift off"
        # a touching extremum is in contact afterwards if it begins, a lifting one is not
        begins = (self.above == (side > 0)) == (verb == "touch")
        return GrazingContact(
            self.element,
            local.element.label,
            level_of(local, self.index),
            solution.tau / state.rate,
            f"{'begins' if begins else 'ceases'} to {verb}",
            state.omega if name == "omega" else state.values[name],
        )

    def solve(self, guess: Guess) -> Grazing:
        """Newton's method for the grazing from the nearest extremum of the guess's motion; raises ConvergenceError."""
        nearest = nearest_extremum(guess.state, self.element, self.index, self.tau, self.maximum)
        if nearest is None:
            raise ConvergenceError("the motion has no extremum here")
        augmentation = GrazingContactEquations.of(guess.state, self.element, self.index)
        evaluation, iterations = solve(guess, augmentation, nearest[0].tau[[nearest[1]]])
        tau = float(evaluation.extra[0]) % (2.0 * math.pi)
        return Grazing(evaluation.state, None, 0.0, evaluation.error, iterations, tau)

    def rise(self, solution: Grazing, name: str) -> Array:
        """Gradient of the extremum's height over the gap by coefficients and free parameter, shape (dimension + 1,)."""
        return np.append(*height_gradient(solution.state, self.element, self.index, solution.tau, (name,)))


def height_gradient(
    state: BalanceState, element: int, index: int, tau: float, names: tuple[str, ...]
) -> tuple[Array, Array]:
    """Gradient of an extremum's height over a gap by coefficients, (2 H + 1, size), and by free parameters."""
    height = height_at(state, element, index, tau, names)
    return height.by_x, height.by_names


def nearest_extremum(
    state: BalanceState, element: int, index: int, tau: float, maximum: bool
) -> tuple[GapExtrema, int] | None:
    """The maximum or minimum of a gap's relative displacement nearest to an instant: its gap, and which it is there."""
    for gap in gap_extrema(state):
        alike = np.flatnonzero((gap.curve < 0.0) == maximum) if (gap.element, gap.index) == (element, index) else None
        if alike is not None and alike.size:
            return gap, int(alike[np.argmin(1.0 - np.cos(gap.tau[alike] - tau))])
    return None


def touches(a: Sample, b: Sample) -> tuple[list[Touch], bool]:
    """Extrema that pass a gap between two neighbours, and whether they explain the numbers of crossings there."""
    passing, clear = [], True
    for p, q in zip(a.gaps, b.gaps, strict=True):
        pairs, count, before, after, _ = passages(p.tau, p.value, p.curve, p.level, q.tau, q.value, q.curve, q.level)
        if before == after and not count:
            continue
        explained = 0
        for i, j in pairs[:count]:
            above, maximum = bool(q.value[j] > q.level), bool(q.curve[j] < 0.0)
            # a maximum above the gap and a minimum below it have two crossings beside them
            explained += 2 if above == maximum else -2
            if p.curve[i] == q.curve[j] == FLAT:
                # what begins to touch everywhere at once does not lift off besides
                continue
            first, second = p.value[i] - p.level, q.value[j] - q.level
            share = float(first / (first - second)) if first != second else 0.5
            way = (q.tau[j] - p.tau[i] + math.pi) % (2.0 * math.pi) - math.pi
            passing.append(Touch(p.element, p.index, float(p.tau[i] + share * way), share, maximum, above))
        clear = clear and after - before == explained
    return passing, clear


def locate_grazings(a: Sample, b: Sample, options: NewtonOptions) -> list[Located]:
    """All grazings between two neighbours, in the order met.

    What cannot be solved for from the ends of the step is separated by halving it, and bracketed at last.
    """
    if not a.gaps:
        return []
    return sorted(_search(a, b, 0.0, 1.0, 0, options), key=lambda item: item.fraction)


def _search(a: Sample, b: Sample, low: float, high: float, depth: int, options: NewtonOptions) -> list[Located]:
    passing, clear = touches(a, b)
    if not passing and (clear or depth >= _UNCLEAR):
        return []
    solved = [solved_between(touch, a, b, touch.share, b) for touch in passing]
    grazings = [
        Located(touch, low + s[1] * (high - low), a if s[1] < 0.5 else b, s[0], 0.0)
        for touch, s in zip(passing, solved, strict=True)
        if s is not None
    ]
    if clear and len(grazings) == len(passing) and not _repeated(grazings):
        return grazings
    middle = None
    if depth < _BISECTIONS:
        with suppress(ConvergenceError):
            middle = b.at(point_between(a.point, b.point, 0.5, options))
    if middle is None:
        width = 0.5 * abs(b.point.parameter - a.point.parameter)
        return grazings + [
            Located(touch, 0.5 * (low + high), b, None, width)
            for touch, s in zip(passing, solved, strict=True)
            if s is None
        ]
    half = 0.5 * (low + high)
    parts = ((a, middle, low, half), (middle, b, half, high))
    return [item for part in parts for item in _search(*part, depth + 1, options)]


def _repeated(located: list[Located]) -> bool:
    """True if two extrema led to the same grazing."""
    seen = []
    for item in located:
        touch, solution = item.kind, item.solution
        assert isinstance(touch, Touch)
        assert isinstance(solution, Grazing)
        seen.append((touch.element, touch.index, solution.tau, item.fraction))
    return any(
        one[:2] == other[:2] and 1.0 - math.cos(one[2] - other[2]) < 1e-12 and abs(one[3] - other[3]) < 1e-6
        for i, one in enumerate(seen)
        for other in seen[:i]
    )
