"""Whether a contact begins or ceases within an interval of a curve, or is about to just beyond it.

On the side of a grazing on which the contact exists everything changes like a square root of the way to it, up to the
grazing itself. No polynomial through places on that side foretells it, unless they lie the closer together the nearer
it is: an interval is too long if an excursion across a gap shrinks to less than SHRINKS of itself in it.
"""

from __future__ import annotations

import math

from suboctave.compiled import kernel
from suboctave.curves.sample import Sample
from suboctave.harmonic.trigonometric import passages

#: excursions across a gap, in units of the largest relative displacement, that may end soon
YOUNG = 0.05
#: share to which an excursion may shrink in an interval
SHRINKS = 0.3
#: what an interval's contacts do: nothing, shrink towards its first or its last end, begin or cease within it
NOTHING, FIRST, LAST, GRAZES = 0, 1, 2, 3
#: where an interval is cut whose contacts shrink, as a fraction of it: closer to that end, towards which the intervals
#: shorten like the excursion
CUT = {FIRST: 0.35, LAST: 0.65}


def contacts_between(p: Sample, q: Sample) -> int:
    """What contacts do between two samples.

    GRAZES if any begins or ceases to touch; else FIRST or LAST if an excursion across a gap shrinks so much that it may
    end just beyond that end; else NOTHING.
    """
    near = NOTHING
    for a, b in zip(p.gaps, q.gaps, strict=True):
        here = _between(a.tau, a.value, a.curve, a.level, b.tau, b.value, b.curve, b.level)
        if here == GRAZES:
            return GRAZES
        near = near or here
    return near


@kernel()
def _between(tau, value, curve, level, other_tau, other_value, other_curve, other_level):
    """`contacts_between` for one gap."""
    _, count, crossed, other_crossed = passages(
        tau, value, curve, level, other_tau, other_value, other_curve, other_level
    )
    if count > 0 or crossed != other_crossed:
        return 3
    for end in range(2):
        # whether an excursion of one motion is a small part of the same excursion of the other
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
                return 1 + end
        tau, value, curve, level, other_tau, other_value, other_curve, other_level = (
            other_tau,
            other_value,
            other_curve,
            other_level,
            tau,
            value,
            curve,
            level,
        )
    return 0


__all__ = ["CUT", "FIRST", "GRAZES", "LAST", "NOTHING", "contacts_between"]
