"""May a function known at a few places vanish in between? Interpolation with a verdict.

Between two neighbouring places p and q the function is taken for the cubic Q through four places (p, q and the nearest
ones beside them). How far two parabolas through three of them part,

    E(s) = |f[s0, s1, s2, s3]| (s - p) (q - s) max(|s - left|, |s - right|),

is what a parabola would have been wrong by: the cubic is believed up to SAFETY times that. No zero hides between p and
q if Q keeps its sign beyond this doubt; between places of opposite sign there is just one if the doubt is small beside
Q on both sides of its zero and beside its slope there. With three places the parabola is held against the chord.

A function that does something between p and q of which neither its values nor those before and after give a hint is
beyond this (and any) test: that is what the length of the examined intervals is reported for.
"""

from __future__ import annotations

from collections.abc import Sequence

#: times the difference of two parabolas up to which the cubic is believed
SAFETY = 2.0
#: fractions of an interval at which the interpolating polynomial is looked at
_GRID = tuple(i / 10.0 for i in range(1, 10))


def doubtful(places: Sequence[float], values: Sequence[float], at: int) -> float | None:
    """Where between `places[at]` and `places[at + 1]` a zero may hide, as a fraction of the interval; None if nowhere.

    Parameters
    ----------
    places
        Three or four different places in ascending order.
    values
        The function there. A zero counts as positive: the side of an exact zero is the caller's business.
    """
    p, q = places[at], places[at + 1]
    fp, fq = values[at], values[at + 1]
    h = q - p
    # divided differences of p, q and the others
    chord = (fq - fp) / h
    beside = [i for i in range(len(places)) if i not in (at, at + 1)]
    seconds = [((values[i] - fp) / (places[i] - p) - chord) / (places[i] - q) for i in beside]
    second, shift, third, doubt, reach = seconds[0], 0.0, 0.0, SAFETY * abs(seconds[0]), 1.0
    left, right = (places[at - 1] if at else None), (places[at + 2] if at + 2 < len(places) else None)
    cubic = len(beside) == 2
    if cubic:
        shift = places[beside[0]]
        third = (seconds[1] - second) / (places[beside[1]] - shift)
        doubt = SAFETY * abs(third)
        reach = max(q - left if left is not None else 0.0, right - p if right is not None else 0.0)
    same = (fp > 0.0) == (fq > 0.0)
    if same:
        # all that may come off the chord against its lower end
        most = abs(second) + abs(third) * max(abs(shift - p), abs(shift - q)) + doubt * reach
        if min(abs(fp), abs(fq)) > 0.25 * h * h * most:
            return None
    sign = 1.0 if fp > 0.0 else -1.0
    curve = []
    for share in _GRID:
        s = p + share * h
        product = (s - p) * (s - q)
        value = fp + (s - p) * chord + product * (second + third * (s - shift))
        if cubic:
            reach = max(s - left if left is not None else 0.0, right - s if right is not None else 0.0)
        curve.append((share, sign * value, -product * doubt * reach))
    if same:
        margin, where = min((value - error, share) for share, value, error in curve)
        return where if margin <= 0.0 else None
    # one zero: where the cubic says, and nowhere else
    root, before, value_before = 1.0, 0.0, sign * fp
    for share, value, _ in [*curve, (1.0, sign * fq, 0.0)]:
        if value <= 0.0:
            part = value_before / (value_before - value) if value_before > value else 0.5
            root = before + part * (share - before)
            break
        before, value_before = share, value
    margins = []
    for share, value, error in curve:
        near = min(1.0, 4.0 * abs(share - root))
        margins.append(((value if share < root else -value) - error * near, share, abs(share - root)))
    margin, where, apart = min(margins)
    return where if margin < 0.0 and apart > 0.02 else None


__all__ = ["SAFETY", "doubtful"]
