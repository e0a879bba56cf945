"""The step "track": a bifurcation of an earlier branch in two parameters, an extremum of such a curve in a third, or
another curve from a point of codimension two.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, ClassVar

from suboctave.analysis import Branch, track
from suboctave.analysis.checks import check_bounds, check_parameter, check_range
from suboctave.bifurcation.tracked import CURVES_THROUGH, TRACKED_KINDS
from suboctave.errors import suggest
from suboctave.study.steps.base import Complaint, Context, Known, Range, Surroundings, chosen, tried
from suboctave.study.steps.curves import CurveStep

#: what is tracked in a third parameter: extrema along curves, the ends of isolas
_EXTREMA = ("extremum", "isola_centre", "isola_merging")


class Track(CurveStep):
    """`so.track`: `start` names a bifurcation of an earlier branch."""

    kind: ClassVar[str] = "track"

    parameter: str | list[str]
    bounds: Range | list[Range]
    omega: Range | None = None
    onto: str | None = None

    @property
    def plane(self) -> tuple[str, str] | None:
        """See `Step.plane`."""
        both = ["omega", self.parameter] if isinstance(self.parameter, str) else self.parameter
        return (both[0], both[1]) if len(both) == 2 else None

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from super().check(around)
        yield from self._check_start()
        names = [self.parameter] if isinstance(self.parameter, str) else self.parameter
        ranges = [self.bounds] if isinstance(self.parameter, str) else self.bounds
        wrong = [c for name in names for c in tried("parameter", partial(check_parameter, around.system, name))]
        yield from wrong
        if not isinstance(self.parameter, str) and len(names) != 2:
            yield ("parameter",), "is one name, beside omega, or two"
        elif len(ranges) != len(names) or any(not isinstance(r, list) for r in ranges):
            yield ("bounds",), "needs a range [from, to] for each parameter"
        elif not wrong:
            for name, ends in zip(names, ranges, strict=True):
                mistaken = [*tried("bounds", partial(check_bounds, around.system, name, ends))]
                yield from mistaken or self._check_inside(around, name, ends)
        if self.omega is not None:
            yield from tried("omega", lambda: check_range("omega", self.omega, positive=True))
        for name in names:
            if name in self.parameters:
                yield ("parameters", name), "is a parameter that varies: its range is in bounds"
        if self.events:
            yield ("events",), "is no option of a curve of bifurcations: leave it out"

    def _check_inside(self, around: Surroundings, name: str, ends: Any) -> Iterator[Complaint]:
        """That the range of a parameter holds the value that it has along the curve where the bifurcation is."""
        known = self.inherited(around)
        value = None if known is None or name == known.free else known.values.get(name)
        if value is not None and not min(ends) <= value <= max(ends):
            yield ("bounds",), f"the bifurcations there have {name} = {value:g}: let the range hold it"

    def _check_start(self) -> Iterator[Complaint]:
        kind = None if self.motion is None else self.motion.bifurcation
        if kind is None:
            yield ("start",), 'name a bifurcation: start = { analysis = "response", bifurcation = "PD" }'
        elif kind not in (*TRACKED_KINDS, *_EXTREMA, *CURVES_THROUGH):
            yield (
                ("start", "bifurcation"),
                f"{kind} cannot be tracked{suggest(kind, (*TRACKED_KINDS, *CURVES_THROUGH))}",
            )
        elif kind in _EXTREMA and not isinstance(self.parameter, str):
            yield ("parameter",), "of an extremum is one name: the third parameter"
        if self.onto is None or kind is None:
            return
        through = CURVES_THROUGH.get(kind)
        if through is None:
            yield ("onto",), f"chooses between the curves through a point of codimension two; {kind} is none"
        elif self.onto not in through:
            yield ("onto",), f"{self.onto!r}: the curves through {kind} are {' and '.join(through)}"

    def known(self, around: Surroundings) -> Known | None:
        """See `Step.known`: what varies along it are parameters, too."""
        return None

    def run(self, context: Context) -> Branch:
        """See `Step.run`."""
        options: dict[str, Any] = self.options(context)
        assert self.motion is not None
        start = chosen(self.motion, context.results)
        self._moved(start.orbit, context)
        if self.omega is not None:
            options["omega"] = (self.omega[0], self.omega[1])
        if self.onto is not None:
            options["onto"] = self.onto
        return track(start, self.parameter, self.bounds, **options)
