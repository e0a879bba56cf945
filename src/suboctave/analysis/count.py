"""The number of unstable multipliers along a curve, held against the bifurcations located there."""

from __future__ import annotations

from suboctave.bifurcation import Bifurcation, Sample

#: multipliers this close to the unit circle are not counted when the count is held against the located bifurcations
_NEAR_CIRCLE = 0.02


class CountCheck:
    """Holds the number of unstable multipliers against the located bifurcations."""

    def __init__(self) -> None:
        self._last: Sample | None = None
        self._since: list[Bifurcation] = []

    def noted(self, item: Bifurcation) -> None:
        """A bifurcation that belongs to no step."""
        self._since.append(item)

    def complaint(self, sample: Sample, found: list[Bifurcation]) -> tuple[Sample, Sample, str] | None:
        """From where to where, and a sentence, if the count has changed by what the bifurcations since the last clear
        sample do not explain.
        """
        self._since += found
        if not sample.floquet.decided or sample.floquet.clearance < _NEAR_CIRCLE:
            return None
        last, items = self._last, self._since
        self._last, self._since = sample, []
        if last is None:
            return None
        odd = sum(item.kind in ("LP", "PD", "BP") for item in items)
        pairs = sum(item.kind == "NS" for item in items)
        before, now = last.floquet.unstable, sample.floquet.unstable
        change = abs(now - before)
        # a branch that turns back at a pitchfork is its own mirror image behind it: the count does not change there
        branching = any(item.kind == "BP" for item in items)
        if change <= odd + 2 * pairs and (branching or (change - odd) % 2 == 0):
            return None
        names = ", ".join(item.kind for item in items) or "none"
        return (
            last,
            sample,
            f"the number of unstable multipliers changes from {before} to {now}, which the bifurcations located there "
            f"({names}) do not explain",
        )
