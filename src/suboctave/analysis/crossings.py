"""May a function known at a few places vanish in between? Interpolation with a verdict.

Between two neighbouring places p and q the function is taken for the cubic Q through p, q and the two nearest places
beside them. What it may do instead is judged by how well it could have been foretold: the parabola through p and the
two places before it, and the one through q and the two places behind it, part from the cubic by

    E(s) = |f[l2, l1, p, q]| (s - p) (s - l1) (s - l2)    and    |f[p, q, r1, r2]| (q - s) (r1 - s) (r2 - s)

(divided differences). A smooth function that the places resolve has small ones; behind a kink, or where the places are
too far apart, the foretelling fails at the far end by as much as the function may have strayed unseen. No zero hides
between p and q if Q keeps its sign beyond SAFETY times the larger of the two; between places of opposite sign there is
one zero only, if this holds on both sides of that of Q, and its slope there leaves no doubt either. Where there is but
one place beside, it serves with p and q as the second difference does above.

A function that does something between p and q of which neither its values nor those before and after give a hint is
beyond this (and any) test: that is what the length of the examined intervals is reported for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

#: times its distance from what could be foretold up to which the interpolating cubic is believed
SAFETY = 2.0
#: fractions of an interval at which it is looked at
_GRID = (0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.98)


def doubtful(places: Sequence[float], values: Sequence[float], at: int) -> float | None:
    """Where between `places[at]` and `places[at + 1]` a zero may hide, as a fraction of the interval; None if nowhere.

    Parameters
    ----------
    places
        Three to six different places in ascending order, up to two on either side of the interval.
    values
        The function there. A zero counts as positive: the side of an exact zero is the caller's business.
    """
    p, q = places[at], places[at + 1]
    fp, fq = values[at], values[at + 1]
    h = q - p
    chord = (fq - fp) / h
    # f[p, q, x] for the places beside, the nearest first
    left = [(places[i], _second(p, q, fp, chord, places[i], values[i])) for i in range(at - 1, -1, -1)]
    right = [(places[i], _second(p, q, fp, chord, places[i], values[i])) for i in range(at + 2, len(places))]
    before, behind = _Side(left), _Side(right)
    nearest = [left[0], right[0]] if left and right else [*left, *right][:2]
    shift, second = nearest[0]
    third = (nearest[1][1] - second) / (nearest[1][0] - shift) if len(nearest) == 2 else 0.0
    same = (fp > 0.0) == (fq > 0.0)
    if same:
        # all that may come off the chord against its lower end
        bend = 0.25 * h * h * (abs(second) + abs(third) * max(abs(shift - p), abs(shift - q)))
        if min(abs(fp), abs(fq)) > bend + SAFETY * h * max(before.rate(q), behind.rate(p)):
            return None
    sign = 1.0 if fp > 0.0 else -1.0
    curve = []
    for share in sorted([*_GRID, *_extrema(chord, second, third, shift - p, h)]):
        ahead, back = share * h, (1.0 - share) * h
        s = p + ahead
        value = fp + ahead * chord - ahead * back * (second + third * (s - shift))
        doubt = SAFETY * max(ahead * before.rate(s), back * behind.rate(s))
        curve.append((share, sign * value, doubt))
    if same:
        margin, where = min((value - doubt, share) for share, value, doubt in curve)
        return _kept(where) if margin <= 0.0 else None
    # one zero: where the cubic says, and nowhere else
    root, last, value_last = 1.0, 0.0, sign * fp
    for share, value, _ in [*curve, (1.0, sign * fq, 0.0)]:
        if value <= 0.0:
            root = last + (share - last) * (value_last / (value_last - value) if value_last > value else 0.5)
            break
        last, value_last = share, value
    margin, where = min(
        ((value if share < root else -value) - 0.25 * doubt * min(1.0, 4.0 * abs(share - root)), share)
        for share, value, doubt in curve
    )
    return _kept(where) if margin < 0.0 else None


def _kept(share: float) -> float:
    """Not too close to the ends, so that both parts shrink."""
    return min(0.6, max(0.4, share))


def _extrema(chord: float, second: float, third: float, shift: float, h: float) -> list[float]:
    """Fractions of (0, h) at which `chord s + s (s - h) (second + third (s - shift))` is largest or smallest."""
    # derivative a s^2 + b s + c
    a = 3.0 * third
    b = 2.0 * (second - third * (shift + h))
    c = chord - second * h + third * shift * h
    root = b * b - 4.0 * a * c
    if root < 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(root), b))
    places = ([q / a] if a != 0.0 else []) + ([c / q] if q != 0.0 else [])
    return [s / h for s in places if 0.0 < s < h]


def _second(p: float, q: float, fp: float, chord: float, x: float, fx: float) -> float:
    """Divided difference f[p, q, x]."""
    return ((fx - fp) / (x - p) - chord) / (x - q)


class _Side:
    """The distance between the cubic and what is foretold from one side, without its factor (s - p) or (q - s)."""

    def __init__(self, beside: list[tuple[float, float]]) -> None:
        self.places = [x for x, _ in beside]
        seconds = [d for _, d in beside]
        if len(beside) < 2:
            self.size = abs(seconds[0]) if beside else 0.0
        else:
            self.size = abs((seconds[1] - seconds[0]) / (self.places[1] - self.places[0]))

    def rate(self, s: float) -> float:
        result = self.size
        for x in self.places:
            result *= abs(s - x)
        return result


__all__ = ["SAFETY", "doubtful"]
