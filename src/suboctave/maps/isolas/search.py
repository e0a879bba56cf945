"""The search for isolas: limit points that no branch explains lead to closed branches, these to ranges of existence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.interruption import pass_on
from suboctave.maps.catalogue import Catalogue
from suboctave.maps.isolas.existence import Existence, extend
from suboctave.maps.isolas.loops import Loop, Loops
from suboctave.maps.pieces import MonotonePiece
from suboctave.results.branch import Branch

__all__ = ["PREPARATION", "Search"]

#: share of the work that the responses make, for progress
PREPARATION = 0.6


class Search:
    """What a search for isolas knows: curves of bifurcations, branches at values, and the isolas so far.

    values
        Values of the design parameter at which responses are followed.
    few
        The first, the middle and the last of them.
    """

    def __init__(self, catalogue: Catalogue, values: Sequence[float]) -> None:
        self.catalogue = catalogue
        self.loops = Loops(catalogue)
        self.isolas: list[Existence] = []
        self.values = tuple(values)
        self.few = tuple(sorted({values[0], values[len(values) // 2], values[-1]}))

    def settle(self, values: Sequence[float] = ()) -> None:
        """The isolas that limit points known lie on: near centres, and at values at which responses were followed."""
        for piece, value in self._starts(values):
            loop = self.loops.through(piece, value)
            if loop is not None:
                self._consider(loop)

    def meet(self, branch: Branch, value: float) -> None:
        """A branch at a value that no bifurcation led to: an isola unless it is attached, or one that is known."""
        pass_on(branch.interruption)
        self._consider(self.loops.of(branch, value))
        self.settle()

    def _consider(self, loop: Loop) -> None:
        """A branch that is detached exists over some range, unless it is known; any other is known from now on."""
        if any(isola.covers(piece, loop.value) for isola in self.isolas for piece in loop.pieces):
            return
        if loop.detached and loop.pieces:
            self.catalogue.progress(PREPARATION, f"closed branch at {self.catalogue.name} = {loop.value:.6g}")
            isola = Existence.of(loop)
            others = tuple(self.isolas)
            self.isolas.append(isola)
            extend(isola, self.loops, others)
        else:
            self.loops.attach(loop)

    def _starts(self, values: Sequence[float]) -> Iterator[tuple[MonotonePiece, float]]:
        """Limit points that may lie on an isola: beside centres, then those that no branch met explains.

        Curves that become known on the way count as well.
        """
        name, bounds = self.catalogue.name, self.catalogue.bounds
        done: set[int] = set()
        while True:
            centre = next((c for c in self._centres() if id(c[1]) not in done), None)
            if centre is None:
                break
            piece, event, upper = centre
            done.add(id(event))
            if any(isola.ends_at(event) for isola in self.isolas):
                continue
            value = event.parameter(name)
            beyond, _ = next(self.loops.critical(piece.nu, value, not upper), (bounds[0 if upper else 1], []))
            yield piece, 0.5 * (value + beyond)
        for value in values:
            for piece in self.catalogue.limit_points:
                unexplained = piece.contains(value) and not self.loops.explained(piece, value)
                if unexplained and not any(isola.covers(piece, value) for isola in self.isolas):
                    yield piece, value

    def _centres(self) -> Iterator[tuple[MonotonePiece, TrackedEvent, bool]]:
        """Ends of pieces at which a closed branch may shrink to a point, and whether it exists below.

        Where a contact grazes, the quadratic form says nothing.
        """
        for piece in self.catalogue.limit_points:
            for upper in (False, True):
                event = piece.end(upper)
                if event is not None and event.kind == "extremum" and event.isola != "isola_merging":
                    yield piece, event, upper
