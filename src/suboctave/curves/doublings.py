"""Period doublings looked for by published test functions, and what they miss.

`Alcorta2019` looks for period doublings as its paper does, from one point of a curve to the next: where one of its two
test functions changes, its system is solved from there. Beside that the sign of det J_half is known at every point; it
changes at every period doubling. Where it did and the published test led to none, the branch says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from suboctave.curves.events.alcorta import log_determinant
from suboctave.curves.events.finder import Located
from suboctave.curves.events.monitors import PERIOD_DOUBLING, BifurcationKind
from suboctave.curves.sample import Sample

_MISSED = (
    "a period doubling lies there (a multiplier passes -1), which the test function {test!r} of the formulation "
    'does not show (formulation="bordered" finds it)'
)
_UNSOLVED = "a multiplier passes -1, but the published system of period doublings did not lead there"

#: what the harmonics left out may make between the places of two formulations, in units of a step
_ASIDE = 0.1

Pair = tuple[Sample, Sample]


@dataclass
class DoublingWatch:
    """Follows a curve with one published test function.

    Parameters
    ----------
    test
        "multiplier" or "determinant".
    kind
        Period doubling, with the formulation that solves for it.
    locate
        Solves between two samples; None if there is none.
    """

    test: str
    kind: BifurcationKind
    locate: Callable[[BifurcationKind, Sample, Sample], Located | None]
    _falling: Pair | None = None
    #: between which samples a multiplier passes -1, where the system was solved for, and the places found with how far
    #: off they may lie, all in scaled arclength
    _passages: list[Pair] = field(default_factory=list)
    _tried: list[tuple[float, float]] = field(default_factory=list)
    _found: list[tuple[float, float]] = field(default_factory=list)

    def passed(self, a: Sample, b: Sample) -> list[tuple[Located, Sample, Sample]]:
        """The period doublings that the step from a to b leads to, each with the samples it lies between."""
        self.moved(a, b)
        doublings = []
        for p, q in self._indicated(a, b):
            way = q.place - p.place
            self._tried.append((p.place, q.place))
            located = self.locate(self.kind, p, q)
            if located is not None:
                doublings.append((located, p, q))
                self._found.append((p.place + located.fraction * way, _ASIDE * way))
        return doublings

    def moved(self, old: Sample, again: Sample) -> None:
        """The next sample, or the same motion with other harmonics, where test functions jump a little."""
        if PERIOD_DOUBLING.changed(old, again):
            self._passages.append((old, again))

    def missed(self) -> list[tuple[Sample, Sample, str]]:
        """What has been passed without a period doubling being found, by from, to and a reason."""
        left = list(self._passages)
        for place, reach in self._found:
            # the passage of -1 nearest to a period doubling is that
            nearest = min(left, key=lambda pair: _distance(pair, place), default=None)
            if nearest is not None and _distance(nearest, place) <= reach:
                left.remove(nearest)
        reasons = [_UNSOLVED if self._in_vain(pair) else _MISSED.format(test=self.test) for pair in left]
        return [(a, b, reason) for (a, b), reason in zip(left, reasons, strict=True)]

    def _in_vain(self, pair: Pair) -> bool:
        return any(low <= pair[0].place and pair[1].place <= high for low, high in self._tried)

    def forget(self) -> None:
        """What lies behind says nothing of what comes."""
        self._falling = None

    def _indicated(self, a: Sample, b: Sample) -> list[Pair]:
        """Between which samples the test function has changed."""
        if self.test == "multiplier":
            return [(a, b)] if leading(a) * leading(b) < 0.0 else []
        rising = log_determinant(b.state) > log_determinant(a.state)
        before, self._falling = self._falling, None if rising else (a, b)
        if not rising or before is None:
            return []
        # of the two steps around the least det B, the one across which a multiplier passes -1
        for pair in (before, (a, b)):
            if PERIOD_DOUBLING.changed(*pair):
                return [pair]
        return [(before[0], b)]


def leading(sample: Sample) -> float:
    """`sign(Re mu) |mu| + 1`, mu the multiplier of largest modulus (Eq. 25)."""
    mu = sample.floquet.multipliers[0]
    return float(np.sign(mu.real) * abs(mu)) + 1.0


def _distance(pair: Pair, place: float) -> float:
    """How far outside a pair of samples a place lies; 0 inside."""
    return max(pair[0].place - place, place - pair[1].place, 0.0)
