"""The multipliers along a curve held against what its equations do: is every change a bifurcation that was found?

- The number of unstable multipliers is held against the located bifurcations.
- Where two period doublings have all but merged, the harmonics left out decide whether there are two or none: det
  J_half of the truncated motion may keep its sign while a multiplier, which belongs to the motion completed by what it
  lacks, passes -1 and comes back. Sample by sample the sign of det J_half and that of prod (1 + mu) are held against
  each other. Beside an ordinary period doubling they differ between its two places; a stretch of difference that both
  of its ends leave to the multipliers hides a pair. It is solved for with more harmonics, as many as the rule for
  curves allows.
- `Alcorta2019` looks for period doublings as its paper does, from one point of a curve to the next: where one of its
  two test functions changes, its system is solved from there. Beside that the sign of det J_half is known at every
  point; it changes at every period doubling. Where it did and the published test led to none, the branch says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation import NewtonOptions
from suboctave.curves.events.alcorta import log_determinant
from suboctave.curves.events.monitors import PERIOD_DOUBLING, BifurcationKind, Located, locate
from suboctave.curves.refine import solved_in
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.harmonic.truncation import choose_harmonics, next_harmonics

#: multipliers this close to the unit circle are not counted when the count is held against the located bifurcations
_NEAR_CIRCLE = 0.02


class CountCheck:
    """Holds the number of unstable multipliers against the located bifurcations."""

    def __init__(self) -> None:
        self._last: Sample | None = None
        self._since: list[str] = []

    def noted(self, item: Bifurcation) -> None:
        """A bifurcation that belongs to no step."""
        self._since.append(item.kind)

    def complaint(self, sample: Sample, kinds: list[str]) -> tuple[Sample, Sample, str] | None:
        """From where to where, and a sentence, if the count has changed by what the bifurcations since the last clear
        sample do not explain.

        kinds: those met on the way to the sample, and those whose tests have changed and that are in doubt already.
        """
        self._since += kinds
        if not sample.floquet.decided or sample.floquet.clearance < _NEAR_CIRCLE:
            return None
        last, kinds = self._last, self._since
        self._last, self._since = sample, []
        if last is None:
            return None
        before, now = last.outside, sample.outside
        if before == now and not kinds:
            return None
        odd = sum(kind in ("LP", "PD", "BP") for kind in kinds)
        change = abs(now - before)
        # a branch that turns back at a pitchfork is its own mirror image behind it: the count does not change there
        if change <= odd + 2 * kinds.count("NS") and ("BP" in kinds or (change - odd) % 2 == 0):
            return None
        located = ", ".join(kinds)
        reason = (
            f"the number of unstable multipliers changes from {before} to {now}, which no bifurcation there explains"
        )
        if kinds:
            reason = (
                f"the number of unstable multipliers changes from {before} to {now}, which the bifurcations located "
                f"there ({located}) do not explain"
            )
        if change == 0:
            reason = (
                f"as many multipliers are unstable behind as before ({now}), although each of the bifurcations located "
                f"there ({located}) changes their number: another one may be missing"
            )
        return last, sample, reason


REASON = "a multiplier passes -1 and comes back, which the harmonics solved for do not show"


#: three motions in the order of the curve: outside, between and outside a hidden pair
Stretch = tuple[Sample, Sample, Sample]


class HiddenDoublings:
    """Watches a curve for stretches in which multipliers of completed motions and det J_half differ."""

    def __init__(self) -> None:
        self._since: list[Sample] = []

    def forget(self) -> None:
        """What lies behind says nothing of what comes."""
        self._since = []

    def passed(self, samples: list[Sample]) -> list[Stretch]:
        """The stretches that end within the next samples of the curve."""
        stretches = []
        for sample in samples:
            if not _agree(sample):
                self._since += [sample] if self._since else []
                continue
            if len(self._since) > 1:
                before, *between = self._since
                if all(s.half_sign == before.half_sign for s in (*between, sample)):
                    stretches.append((before, max(between, key=lambda s: s.floquet.symmetric[1, 1]), sample))
            self._since = [sample]
        return stretches


def _agree(sample: Sample) -> bool:
    return (sample.half_sign > 0.0) == (sample.floquet.symmetric[0, 1] > 0.0)


def pair_in(stretch: Stretch, newton: NewtonOptions) -> list[tuple[Located, Sample, Sample]]:
    """The hidden period doublings, each with the two motions of more harmonics that it lies between; none if they are
    not there, or not found.
    """
    samples, curve = stretch, stretch[1].curve
    doublings: list[tuple[Located, Sample, Sample]] = []
    while curve.adaptive is not None:
        present, rule = samples[1].state, curve.adaptive
        found = [item.sample.state if item.solution is None else item.solution.state for item, _, _ in doublings]
        bases = [choose_harmonics(state, rule, rule.event_tolerance) for state in found]
        basis = max(bases or [next_harmonics(present, rule)], key=lambda basis: basis.harmonics)
        if basis.harmonics <= present.basis.harmonics:
            break
        try:
            curve, _ = curve.finer(present, basis)
            first, middle, last = (solved_in(curve, s, newton) for s in samples)
        except ConvergenceError:
            break
        samples = (first, middle, last)
        if not (PERIOD_DOUBLING.changed(first, middle) and PERIOD_DOUBLING.changed(middle, last)):
            if all(map(_agree, samples)):
                # with more harmonics nobody sees them
                return []
            continue
        # each between motions of its own: left to itself with still more harmonics, one may run to the other
        pairs = [(a, b, locate(PERIOD_DOUBLING, a, b, newton)) for a, b in ((first, middle), (middle, last))]
        doublings = [(item, a, b) for a, b, item in pairs if item is not None]
    return doublings


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
    """Follows a curve with one published test function: "multiplier" or "determinant".

    `kind`: period doubling, with the formulation that solves for it; `locate` solves between two samples.
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
        reasons = []
        for a, b in left:
            in_vain = any(low <= a.place and b.place <= high for low, high in self._tried)
            reasons.append((a, b, _UNSOLVED if in_vain else _MISSED.format(test=self.test)))
        return reasons

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
