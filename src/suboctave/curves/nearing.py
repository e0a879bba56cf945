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
        one, two = (a.tau, a.value, a.curve, a.level), (b.tau, b.value, b.curve, b.level)
        _, count, crossed, other = passages(*one, *two)
        if count > 0 or crossed != other:
            return GRAZES
        near = near or (FIRST if _shrinks(*one, *two) else LAST if _shrinks(*two, *one) else NOTHING)
    return near


@kernel()
def _shrinks(ta, xa, sa, level_a, tb, xb, sb, level_b):
    """Whether an excursion of motion a across its level is a small part of the same excursion of motion b; extrema as
    `passages` takes them.
    """
    largest = 0.0
    for i in range(xa.shape[0]):
        largest = max(largest, abs(xa[i]))
    for i in range(xa.shape[0]):
        height = level_a - xa[i] if sa[i] > 0.0 else xa[i] - level_a
        if not 0.0 < height < YOUNG * largest:
            continue
        nearest, same = -2.0, 0.0
        for j in range(xb.shape[0]):
            near = math.cos(tb[j] - ta[i])
            if (sb[j] > 0.0) == (sa[i] > 0.0) and near > nearest:
                nearest, same = near, (level_b - xb[j] if sb[j] > 0.0 else xb[j] - level_b)
        if height < SHRINKS * same:
            return True
    return False


__all__ = ["CUT", "FIRST", "GRAZES", "LAST", "NOTHING", "contacts_between"]
