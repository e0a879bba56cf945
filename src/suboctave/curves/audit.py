"""What a branch says of its own list of bifurcations: how finely it looked, and what it could not settle."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

#: scaled arclength up to which two stretches in doubt are at one place of the branch: a share of a usual step
PLACE = 0.01


@dataclass(frozen=True)
class Unsettled:
    """A stretch of a branch in which something may have happened that is not in the list.

    Attributes
    ----------
    parameter, first, last
        Name of the free parameter and its values at the two ends, in the order of the branch.
    arclength
        The two ends in scaled arclength along the branch.
    reason
        What is in doubt, as the rest of a sentence.
    """

    parameter: str
    first: float
    last: float
    arclength: tuple[float, float]
    reason: str

    @property
    def length(self) -> float:
        """Length in scaled arclength."""
        return self.arclength[1] - self.arclength[0]

    def __str__(self) -> str:
        return f"between {self.parameter} = {self.first:.9g} and {self.last:.9g} {self.reason}"


def joined(stretches: Iterable[Unsettled]) -> list[Unsettled]:
    """Stretches in the order of the branch, those at one place as one: what overlaps, or lies no farther apart than
    PLACE or than the longer of two is long.
    """
    result: list[Unsettled] = []
    for item in sorted(stretches, key=lambda u: u.arclength):
        last = result[-1] if result else None
        if last is None or item.arclength[0] - last.arclength[1] > max(PLACE, last.length, item.length):
            result.append(item)
            continue
        reasons = last.reason if item.reason in last.reason else f"{last.reason}; {item.reason}"
        end = max(last, item, key=lambda u: u.arclength[1])
        result[-1] = replace(last, last=end.last, arclength=(last.arclength[0], end.arclength[1]), reason=reasons)
    return result


@dataclass(frozen=True)
class Audit:
    """How a branch was searched for bifurcations.

    Neighbouring motions at which all test functions are known bound an interval. An interval counts as settled if the
    test functions, with what they do at its ends and beside it, cannot have vanished unseen inside.

    Attributes
    ----------
    finest, longest
        Shortest and longest interval that was settled, in scaled arclength: two events closer together than the
        former cannot be told apart, and what passes within less than the latter without leaving a trace in any test
        function beside it is not seen.
    probes
        Motions solved for between neighbouring points to settle a step; those that were needed to separate events are
        points of the branch.
    refused
        Steps taken again, shorter, because they may have jumped to another curve.
    unsettled
        Stretches that stayed in doubt.
    """

    finest: float = math.inf
    longest: float = 0.0
    probes: int = 0
    refused: int = 0
    unsettled: tuple[Unsettled, ...] = ()

    @property
    def complete(self) -> bool:
        """True if nothing is in doubt."""
        return not self.unsettled

    def reversed_before(self, other: Audit, whole: float, gap: float = 0.0) -> Audit:
        """This audit's stretch, of length `whole`, walked backwards, and then, beyond a gap, that of `other`."""
        start = whole + gap
        back = [
            replace(u, first=u.last, last=u.first, arclength=(whole - u.arclength[1], whole - u.arclength[0]))
            for u in reversed(self.unsettled)
        ]
        on = [replace(u, arclength=(start + u.arclength[0], start + u.arclength[1])) for u in other.unsettled]
        return Audit(
            min(self.finest, other.finest),
            max(self.longest, other.longest),
            self.probes + other.probes,
            self.refused + other.refused,
            (*back, *on),
        )

    def __repr__(self) -> str:
        if self.longest == 0.0:
            return "Audit: no interval examined"
        text = (
            f"Audit: {self.probes} probes between points, {self.refused} steps refused; intervals from "
            f"{self.finest:.1e} to {self.longest:.1e} of arclength; "
        )
        if self.complete:
            return text + "nothing unsettled"
        return text + "\n  ".join([f"{len(self.unsettled)} unsettled:", *map(str, self.unsettled)])
