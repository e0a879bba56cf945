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
    _open: list[tuple[Pair, bool]] = field(default_factory=list)
    _last: Sample | None = None

    def passed(self, a: Sample, b: Sample) -> list[tuple[Located, Sample, Sample]]:
        """The period doublings that the step from a to b leads to, each with the samples it lies between."""
        if PERIOD_DOUBLING.changed(a, b):
            self._open.append(((a, b), False))
        doublings = []
        for p, q in self._indicated(a, b):
            low, high = p.point.arclength, q.point.arclength
            self._open = [(pair, known or _within(pair, low, high)) for pair, known in self._open]
            located = self.locate(self.kind, p, q)
            if located is not None:
                doublings.append((located, p, q))
                self._explained(low + located.fraction * (high - low), _ASIDE * (high - low))
        self._last = a
        return doublings

    def moved(self, old: Sample, again: Sample) -> None:
        """The same motion was solved for with other harmonics: its test functions jump a little."""
        if PERIOD_DOUBLING.changed(old, again):
            self._open.append(((old, again), False))

    def missed(self, everything: bool = False) -> list[tuple[Sample, Sample, str]]:
        """What has been passed without a period doubling being found, by from, to and a reason, each once.

        The last two steps are left out unless `everything` is wanted: the determinant tells of them later.
        """
        since = None if everything or self._last is None else self._last.point.arclength
        done = [item for item in self._open if since is None or item[0][1].point.arclength < since]
        self._open = [item for item in self._open if item not in done]
        return [(a, b, _UNSOLVED if known else _MISSED.format(test=self.test)) for (a, b), known in done]

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

    def _explained(self, place: float, reach: float) -> None:
        """A period doubling was found at an arclength: the passage of -1 nearest to it is that."""
        nearest = min(self._open, key=lambda item: _distance(item[0], place), default=None)
        if nearest is not None and _distance(nearest[0], place) <= reach:
            self._open.remove(nearest)


def leading(sample: Sample) -> float:
    """`sign(Re mu) |mu| + 1`, mu the multiplier of largest modulus (Eq. 25)."""
    mu = sample.floquet.multipliers[0]
    return float(np.sign(mu.real) * abs(mu)) + 1.0


def _within(pair: Pair, low: float, high: float) -> bool:
    """Whether a passage lies between two places."""
    return low <= pair[0].point.arclength and pair[1].point.arclength <= high


def _distance(pair: Pair, place: float) -> float:
    """How far outside a pair of samples a place lies; 0 inside."""
    a, b = (s.point.arclength for s in pair)
    return max(a - place, place - b, 0.0)
