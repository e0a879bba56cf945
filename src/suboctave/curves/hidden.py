"""Pairs of period doublings that the multipliers see and the solved harmonics do not.

Where two period doublings have all but merged, the harmonics left out decide whether there are two or none: det J_half
of the truncated motion may keep its sign while a multiplier, which belongs to the motion completed by what it lacks,
passes -1 and comes back. Sample by sample the sign of det J_half and that of prod (1 + mu) are held against each other.
Beside an ordinary period doubling they differ between its two places; a stretch of difference that both of its ends
leave to the multipliers hides a pair. It is solved for with more harmonics, as many as the rule for curves allows.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from suboctave.continuation import NewtonOptions
from suboctave.curves.events.finder import Located, locate
from suboctave.curves.events.monitors import PERIOD_DOUBLING
from suboctave.curves.refine import solved_in
from suboctave.curves.sample import Sample
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.truncation import AdaptiveHarmonics, choose_harmonics, next_harmonics

REASON = "a multiplier passes -1 and comes back, which the harmonics solved for do not show"


@dataclass(frozen=True)
class Stretch:
    """Three motions in the order of the curve: outside, between and outside a hidden pair."""

    before: Sample
    inside: Sample
    behind: Sample


@dataclass
class HiddenDoublings:
    """Watches a curve for stretches in which multipliers and det J_half differ."""

    _since: list[Sample] = field(default_factory=list)

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
                    stretches.append(Stretch(before, max(between, key=lambda s: s.measures[1, 2]), sample))
            self._since = [sample]
        return stretches


def _agree(sample: Sample) -> bool:
    return (sample.half_sign > 0.0) == (sample.measures[0, 2] > 0.0)


def pair_in(stretch: Stretch, newton: NewtonOptions) -> list[tuple[Located, Sample, Sample]]:
    """The hidden period doublings, each with the two motions of more harmonics that it lies between; none if they are
    not there, or not found.
    """
    samples = (stretch.before, stretch.inside, stretch.behind)
    curve = stretch.inside.curve
    doublings: list[tuple[Located, Sample, Sample]] = []
    while curve.adaptive is not None:
        present = samples[1].state
        basis = _wanted(doublings, curve.adaptive) if doublings else next_harmonics(present, curve.adaptive)
        if basis.harmonics <= present.basis.harmonics:
            break
        curve, _ = curve.finer(present, basis)
        try:
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


def _wanted(doublings: list[tuple[Located, Sample, Sample]], options: AdaptiveHarmonics) -> HarmonicBasis:
    """The harmonics that located bifurcations are to have."""
    states = [item.sample.state if item.solution is None else item.solution.state for item, _, _ in doublings]
    bases = (choose_harmonics(state, options, options.event_tolerance) for state in states)
    return max(bases, key=lambda basis: basis.harmonics)
