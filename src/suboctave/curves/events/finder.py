"""From a change of a test function between two neighbours to a located bifurcation.

First the bordered system from an interpolated start; where it does not converge into the step, the step is bisected
on the test function and the solver tries again from a nearer point. If it never converges (at a grazing contact the
equations are not smooth enough), the bracket of the test's change is all that is known: what it means is for others to
say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from suboctave.continuation.linear import length
from suboctave.continuation.newton import NewtonOptions
from suboctave.continuation.point import CurvePoint, between, point_between
from suboctave.continuation.problem import Array
from suboctave.curves.events.locate import Guess, Singular
from suboctave.curves.events.monitors import BifurcationKind
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError

#: fractions of a step by which rounding may carry a solution beyond its ends
_SLACK = 1e-7
#: the same before the first point of a curve, which may be the bifurcation as its multipliers tell, not its harmonics
_BEFORE = 1e-2
#: corrections of a place on a step, at most, and one that settles it, as a share of the step
_ROUNDS, _SETTLED = 20, 1e-12


@dataclass(frozen=True)
class Located:
    """A bifurcation between two neighbours: solved (`solution`), or only the change of its test bracketed (`bracket`,
    its second end `sample`, with its width).
    """

    kind: BifurcationKind
    fraction: float
    sample: Sample
    solution: Singular | None
    width: float
    bracket: tuple[Sample, Sample] | None = None


def locate(
    kind: BifurcationKind,
    a: Sample,
    b: Sample,
    newton: NewtonOptions,
    bisections: int = 34,
    begins: bool = False,
) -> Located | None:
    """Locate a bifurcation of a kind whose test changed between two neighbours.

    Parameters
    ----------
    bisections
        Halvings after which the bracket is taken for the answer.
    begins
        Whether the curve begins with the first neighbour: what lies right before it then belongs to no other step.

    Returns
    -------
    None if the change of the test turns out to be no bifurcation of this kind.
    """
    low, high = 0.0, 1.0
    at_low, at_high = a, b
    for depth in range(bisections):
        share = kind.fraction(at_low, at_high)
        nearer = at_low if share < 0.5 else at_high
        if depth % 3 == 0:
            # near a grazing the curve bends within a sliver of the step: only its own ends tell where it runs
            attempt = solved_between(kind, at_low, at_high, share, nearer)
            # what lies beyond an end belongs to the next step, and would be missed there if it were taken for the one
            # here
            if attempt is not None:
                place = low + attempt[1] * (high - low)
                if -(_BEFORE if begins else _SLACK) <= place <= 1.0 + _SLACK:
                    return Located(kind, min(1.0, max(place, 0.0)), nearer, attempt[0], 0.0)
        middle = None
        for part in (0.5, 0.4, 0.65):
            try:
                at = low + part * (high - low)
                middle = b.at(point_between(a.point, b.point, at, newton, exactly=True))
                break
            except ConvergenceError:
                continue
        if middle is None:
            break
        if kind.changed(at_low, middle):
            high, at_high = at, middle
        elif kind.changed(middle, at_high):
            low, at_low = at, middle
        else:
            return None
    names = abs(at_high.point.parameter - at_low.point.parameter)
    return Located(kind, 0.5 * (low + high), at_high, None, 0.5 * names, (at_low, at_high))


def solved_between(
    kind: BifurcationKind, low: Sample, high: Sample, share: float, nearer: Sample
) -> tuple[Singular, float] | None:
    """A solution between two samples and where, from a start at a share of the way; None if there is none."""
    solved = _solved(kind, between(low.point, high.point, share), high.point, nearer)
    fraction = None if solved is None else position(low.point, high.point, solved[1])
    return None if solved is None or fraction is None or not -0.05 <= fraction <= 1.05 else (solved[0], fraction)


def _solved(kind: BifurcationKind, u: Array, point: CurvePoint, sample: Sample) -> tuple[Singular, Array] | None:
    """The bifurcation from u, in the discretisation of a point, and its place; None if there is none."""
    try:
        guess = Guess.at(u, point, kind.kappa(sample))
        solution = kind.solve(guess)
    except ConvergenceError:
        return None
    return (solution, guess.vector(solution.state)) if kind.genuine(solution, guess) else None


def locate_near(kind: BifurcationKind, sample: Sample, reach: float) -> Located | None:
    """A bifurcation within `reach` (scaled arclength) of a sample, on its curve: for tests that change in one place
    because the discretisation does.
    """
    point = sample.point
    solved = _solved(kind, point.u, point, sample)
    if solved is None:
        return None
    solution, there = solved
    way = point.weights * (there - point.u)
    along = point.weights * point.tangent
    ahead = float(way @ along) / length(along)
    aside = math.sqrt(max(0.0, float(way @ way) - ahead**2))
    if abs(ahead) > reach or aside > 0.1 * abs(ahead) + 1e-7:
        return None
    return Located(kind, 0.0, sample, solution, 0.0)


def position(a: CurvePoint, b: CurvePoint, u: Array) -> float | None:
    """Where between two neighbours a point u (in the discretisation of b) lies on the curve, or None if it lies
    elsewhere.
    """
    ua = b.curve.transfer(a.u, a.curve)
    chord = b.weights * (b.u - ua)
    size = length(chord)
    if size == 0.0:
        return None
    fraction = float((b.weights * (u - ua)) @ chord) / size**2
    for _ in range(_ROUNDS):
        if not -1.0 <= fraction <= 2.0:  # the cubic says nothing of what lies so far outside
            break
        # it runs at uneven speed along the chord
        rest = float((b.weights * (u - between(a, b, fraction))) @ chord) / size**2
        fraction += rest
        if abs(rest) < _SETTLED:
            break
    away = length(b.weights * (u - between(a, b, min(1.0, max(0.0, fraction)))))
    return fraction if away <= 0.1 * size + 1e-7 else None
