"""Whether a contact begins or ceases within an interval of a curve, or is about to just beyond it.

On the side of a grazing on which the contact exists everything changes like a square root of the way to it, up to the
grazing itself. No polynomial through places on that side foretells it, unless they lie the closer together the nearer
it is: an interval is too long if an excursion across a gap shrinks to less than SHRINKS of itself in it.
"""

from __future__ import annotations

import numpy as np

from suboctave.bifurcation.gaps import GapExtrema
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
        _, count, crossed, other = passages(a.tau, a.value, a.curve, a.level, b.tau, b.value, b.curve, b.level)
        if count > 0 or crossed != other:
            return GRAZES
        near = near or (FIRST if _shrinks(a, b) else LAST if _shrinks(b, a) else NOTHING)
    return near


def _shrinks(one: GapExtrema, other: GapExtrema) -> bool:
    """Whether an excursion of one motion is a small part of the same excursion of another."""
    for i in one.small(YOUNG):
        same = np.flatnonzero(other.sides == one.sides[i])
        if same.size:
            j = same[np.cos(other.tau[same] - one.tau[i]).argmax()]
            if one.beyond[i] < SHRINKS * other.beyond[j]:
                return True
    return False


__all__ = ["CUT", "FIRST", "GRAZES", "LAST", "NOTHING", "contacts_between"]
