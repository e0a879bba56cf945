"""Whether a contact is about to begin or cease just beyond an interval of a curve.

On the side of a grazing on which the contact exists everything changes like a square root of the way to it, up to the
grazing itself. No polynomial through places on that side foretells it, unless they lie the closer together the nearer
it is: an interval is too long if an excursion across a gap shrinks to less than SHRINKS of itself in it.
"""

from __future__ import annotations

import math

from suboctave.bifurcation import Sample
from suboctave.compiled import kernel

#: excursions across a gap, in units of the largest relative displacement, that may end soon
YOUNG = 0.05
#: share to which an excursion may shrink in an interval
SHRINKS = 0.3
#: where an interval is cut, from the end near the grazing
_CUT = 0.35


def nearing_share(p: Sample, q: Sample) -> float | None:
    """Where to cut an interval in which an excursion across a gap shrinks so much that it may end just beyond an end.

    As a fraction of the interval, closer to that end: towards it the intervals shorten like the excursion. None if
    there is no such excursion.
    """
    for a, b in zip(p.gaps, q.gaps, strict=True):
        end = _shrinking_end(a.tau, a.value, a.curve, a.level, b.tau, b.value, b.curve, b.level)
        if end:
            return _CUT if end == 1 else 1.0 - _CUT
    return None


@kernel()
def _shrinking_end(tau, value, curve, level, other_tau, other_value, other_curve, other_level):
    """1 where an excursion of the first motion is a small part of the same excursion of the other, 2 where it is the
    other way round, 0 where neither is.
    """
    if _shrinks(tau, value, curve, level, other_tau, other_value, other_curve, other_level):
        return 1
    if _shrinks(other_tau, other_value, other_curve, other_level, tau, value, curve, level):
        return 2
    return 0


@kernel()
def _shrinks(tau, value, curve, level, other_tau, other_value, other_curve, other_level):
    """Whether an excursion of one motion is a small part of the same excursion of another."""
    size = 0.0
    for i in range(value.shape[0]):
        size = max(size, abs(value[i]))
    for i in range(value.shape[0]):
        # a maximum above the gap, or a minimum below it
        sign = -1.0 if curve[i] > 0.0 else 1.0
        here = sign * (value[i] - level)
        if not 0.0 < here < YOUNG * size:
            continue
        best, there = -2.0, 0.0
        for j in range(other_value.shape[0]):
            if (other_curve[j] > 0.0) == (curve[i] > 0.0):
                near = math.cos(other_tau[j] - tau[i])
                if near > best:
                    best, there = near, sign * (other_value[j] - other_level)
        if here < SHRINKS * there:
            return True
    return False


__all__ = ["nearing_share"]
