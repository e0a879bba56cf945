"""The number of unstable multipliers along a curve, held against the bifurcations located there."""

from __future__ import annotations

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.curves.sample import Sample

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
        odd = sum(kind in ("LP", "PD", "BP") for kind in kinds)
        pairs = kinds.count("NS")
        before, now = last.unstable, sample.unstable
        change = abs(now - before)
        # a branch that turns back at a pitchfork is its own mirror image behind it: the count does not change there
        branching = "BP" in kinds
        if change <= odd + 2 * pairs and (branching or (change - odd) % 2 == 0):
            return None
        names = ", ".join(kinds) or "none"
        return (
            last,
            sample,
            f"the number of unstable multipliers changes from {before} to {now}, which the bifurcations located there "
            f"({names}) do not explain",
        )
