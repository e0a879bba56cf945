"""Curves of bifurcations over omega and a design parameter, each once, and the branches that lead to them.

Responses at values of the parameter, followed from both ends of the range with what bifurcates from them, meet
bifurcations. Each is followed over the parameter unless it lies on a curve that is known. Through a limit point of such
a curve a branch can be followed at any value that the curve reaches.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suboctave.analysis.branches import continue_branch, switch_branch
from suboctave.analysis.diagram import Followed, diagram_of, span_of
from suboctave.analysis.options import SearchOptions, handed_on, settings_of
from suboctave.analysis.subharmonics import Seeds, isolated_branches
from suboctave.analysis.track import track
from suboctave.arguments import checked
from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation import NewtonOptions
from suboctave.continuation.notes import Note, lines
from suboctave.curves.identity import Relation, gap_to, lies_on, relation
from suboctave.curves.junction import period_name
from suboctave.curves.sample import Sample
from suboctave.curves.starts import Harmonics, harmonics_of, make_curve, own_linear_part, rule_of, start_point
from suboctave.curves.trace import CurveDescription, Trace
from suboctave.errors import ConvergenceError, InputError, is_number, shortened
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import Interruption, pass_on
from suboctave.maps.pieces import MonotonePiece, pieces_of
from suboctave.model.inputs import check_bounds, check_count, check_parameter, check_range, check_system
from suboctave.model.system import System
from suboctave.pictures.cells import Pictured
from suboctave.progress import Search, searching
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.store.registry import Stored
from suboctave.store.table import Table
from suboctave.workers import in_order

if TYPE_CHECKING:
    import pandas

#: share of the range of omega by which branches are followed beyond what they are to hold
_MARGIN = 0.02
#: frequencies of one bifurcation located twice differ by less, relatively
_SAME_OMEGA = 2e-5
#: distance from a curve of limit points, relative to omega, within which the limit point on it is solved for
_BESIDE = 1e-3
#: share of a closed branch's length by which points are beside a bifurcation, not at it
_CLEAR = 1e-4
#: errors of verbs that start from a bifurcation
FAILURES = (ConvergenceError, InputError)
#: what is noted of limit points through which no branch was found
THROUGH = "the branch through it could not be followed"


class SearchRange(NamedTuple):
    """The range of omega of a search, ascending, and the wider ones in which curves are followed for it."""

    low: float
    high: float

    @property
    def around(self) -> tuple[float, float]:
        """An octave more on both sides, for what leads into the range from outside."""
        return 0.5 * self.low, 2.0 * self.high

    def holding(self, places: Iterable[float]) -> SearchRange:
        """The range, wider where places lie outside or close to its ends; not beyond half its lower end."""
        inside = list(places)
        margin = _MARGIN * (max(self.high, *inside) - min(self.low, *inside)) if inside else 0.0
        low = min([self.low, *(place - margin for place in inside)])
        return SearchRange(max(low, 0.5 * min([self.low, *inside])), max([self.high, *(p + margin for p in inside)]))


@checked(result=True)
class PlaneMap(Stored, Pictured):
    """What is known over a plane of two parameters."""

    @abstractmethod
    def to_table(self) -> Table:
        """The borders in the plane, point by point."""

    def to_dataframe(self) -> pandas.DataFrame:
        """`to_table` as a table of pandas."""
        return self.to_table().to_dataframe()

    @staticmethod
    def _check_reach(name: str, value: Any, within: tuple[float, float]) -> None:
        low, high = within
        if not is_number(value) or not low <= value <= high:
            raise InputError(f"the map reaches from {name} = {low:g} to {high:g}, not to {value!r}")


_KEPT = "what is here is what had been found by then"


@dataclass(eq=False, kw_only=True)
class Work:
    """What is said of long work: what it could not settle, how far it has come, what stopped it before its end."""

    notes: list[Note] = field(default_factory=list)
    report: Search | None = None
    interruption: Interruption | None = None

    @contextmanager
    def reporting(self, progress: Any, title: str, kept: str = _KEPT) -> Iterator[None]:
        """Report the work within to `progress`; Ctrl-C and time limits end it, which is noted with what is `kept`."""
        with searching(progress, title) as self.report:
            try:
                yield
            except KeyboardInterrupt as cause:
                self.interruption = Interruption.of(cause)
                self.notes.append(Note(f"{self.interruption}: {kept}"))

    @property
    def unsettled(self) -> tuple[str, ...]:
        """What could not be settled, one line for each cause."""
        return tuple(lines(self.notes))

    @contextmanager
    def noting(self, what: Note, errors: tuple[type[Exception], ...] = (ConvergenceError,)) -> Iterator[None]:
        """Note what could not be computed within, and why."""
        try:
            yield
        except errors as failure:
            self.notes.append(replace(what, failure=str(failure)))

    def progress(self, share: float, where: str) -> None:
        """Report how far the work has come."""
        if self.report is not None:
            self.report.at(share, where)

    def show(self, branch: Branch) -> None:
        """Show a branch that was followed elsewhere to whoever keeps curves."""
        if self.report is not None and self.report.followed is not None and len(branch):
            of = CurveDescription((branch.name,), "", "", branch.observe)
            self.report.followed(Trace(list(branch.points), bifurcations=list(branch.bifurcations), of=of))


@dataclass(eq=False)
class Catalogue(Work):
    """What is known of the bifurcations of a system over omega and a design parameter.

    system, name, bounds, omega
        What is examined, `bounds` and `omega` ascending.
    harmonics, options
        For the verbs that follow branches.
    most
        Curves after which no more are followed.
    curves, pieces
        The curves of bifurcations over the parameter, and their monotone pieces.
    """

    system: System
    name: str
    bounds: tuple[float, float]
    omega: SearchRange
    harmonics: Harmonics
    options: SearchOptions
    most: int
    curves: list[TrackedBranch] = field(default_factory=list)
    pieces: list[MonotonePiece] = field(default_factory=list)
    _lost: list[tuple[float, Bifurcation]] = field(default_factory=list)

    @classmethod
    def checked(
        cls,
        system: System,
        name: str,
        bounds: Any,
        omega: Any,
        harmonics: Harmonics,
        most: int,
        options: SearchOptions,
    ) -> Catalogue:
        """An empty one for what a verb was given; InputError for what cannot be."""
        check_parameter(system, name)
        if name == "omega":
            raise InputError("the design parameter is one of the system's: omega varies anyway, it is the other axis")
        low, high = sorted(check_bounds(system, name, bounds))
        within = SearchRange(*sorted(check_range("omega", omega, positive=True)))
        check_system(system, within)
        rule_of(harmonics)
        settings_of(system, options)
        return cls(system, name, (low, high), within, harmonics, handed_on(options), check_count("max_curves", most, 1))

    def emptied(self) -> Catalogue:
        """One for the same with nothing in it, which reports to nobody."""
        how = (self.harmonics, self.options, self.most)
        return Catalogue(self.system, self.name, self.bounds, self.omega, *how)

    @property
    def span(self) -> float:
        """Width of the parameter's range."""
        return self.bounds[1] - self.bounds[0]

    @property
    def limit_points(self) -> list[MonotonePiece]:
        """The pieces of curves of limit points."""
        return [piece for piece in self.pieces if piece.kind == "LP"]

    def at(self, value: float) -> System:
        """The system at a value of the parameter."""
        return self.system.with_parameters({self.name: value})

    def open(self, text: str, value: float, omega: float | None = None, kind: str = "") -> Note:
        """Something that is open at a value of the parameter, and at a frequency."""
        where = f"{self.name} = {value:.6g}"
        where = where if omega is None else f"omega = {omega:.6g}, {where}"
        return Note(text, self.name, value, value, kind, where)

    # ------------------------------------------------------------------------------------------------------ branches
    def responses(self, value: float, omega: tuple[float, float], followed: Followed) -> Iterator[BifurcationDiagram]:
        """The response at a value with what bifurcates from it; that from the other end as well if it is another."""
        low, high = omega
        for ends in ((high, low), (low, high)):
            with self.noting(self.open("the response could not be followed", value)):
                diagram = diagram_of(self.at(value), ends, self.harmonics, followed, self.options)
                self.note_failures(diagram, value)
                yield diagram
                root = diagram.root.branch
                if len(diagram.responses) > 1 or (len(root) and root.points[-1].orbit.omega == ends[1]):
                    return

    def resonant(self, value: float, order: int, seeds: Seeds | None, known: Sequence[Branch]) -> list[Branch]:
        """Branches of a period at a value that a search among resonances meets, without those that are known."""
        found: list[Branch] = []
        with self.noting(self.open(f"the search for {period_name(order)} motions failed", value)):
            at = self.at(value), self.omega, order, known, self.harmonics
            found += isolated_branches(*at, seeds=seeds or _COARSE, **self.options)
        return found

    def note_failures(self, diagram: BifurcationDiagram, value: float) -> None:
        """Note the branches of a diagram that could not be followed, and stop where it was interrupted."""
        pass_on(diagram.interruption)
        for node in diagram:
            for item, why in node.failures:
                place = self.open("what leaves it could not be followed", value, item.omega, item.kind)
                self.notes.append(replace(place, failure=why))

    def carrier(self, branch: Branch, value: float, attached: Iterable[Branch]) -> Branch | None:
        """As `carrier_of`; None, with a note, where that cannot be decided."""
        try:
            return carrier_of(branch, attached, self.options)
        except FAILURES as failure:
            place = self.open("whether a closed branch is isolated is open", value)
            self.notes.append(replace(place, failure=str(failure)))
            return None

    # -------------------------------------------------------------------------------------------------------- curves
    def add(self, curve: TrackedBranch) -> list[MonotonePiece]:
        """A curve in (omega, parameter) becomes known; its pieces."""
        self.curves.append(curve)
        pieces = pieces_of(curve, self.name)
        self.pieces += pieces
        return pieces

    def piece_of(self, item: Bifurcation, value: float) -> MonotonePiece | None:
        """The known piece that a bifurcation at a value of the parameter, or its mirror image, lies on: the nearest."""
        alike = (p for p in self.pieces if p.kind == item.kind and p.nu == item.orbit.basis.nu and p.contains(value))
        gaps = {piece: gap_to(item.orbit, piece.nodes, self.name, images=True) for piece in alike}
        near = {piece: gap for piece, gap in gaps.items() if gap is not None}
        if near or item.kind != "LP":
            return min(near, key=near.__getitem__, default=None)
        # beside a cusp or a corner a few points say little of what lies between them: what is located there decides
        for piece in sorted(gaps, key=lambda piece: abs(float(piece.across(value)) - item.omega)):
            if abs(float(piece.across(value)) - item.omega) > _BESIDE * item.omega:
                break
            with suppress(ConvergenceError):
                if relation(item.orbit, piece.solve_at(value).orbit) is not Relation.OTHER:
                    return piece
        return None

    def known(self, item: Bifurcation, value: float) -> MonotonePiece | None:
        """The piece that a bifurcation lies on, followed over the parameter if it is new; None if that fails."""
        piece = self.piece_of(item, value)
        lost = (b for v, b in self._lost if v == value and b.kind == item.kind)
        if piece is not None or any(abs(b.omega - item.omega) <= _SAME_OMEGA * item.omega for b in lost):
            return piece

        def noted(text: str) -> Note:
            return self.open(text, value, item.omega, item.kind)

        if len(self.curves) >= self.most:
            text = f"max_curves={self.most} curves were followed, this one and what lies beyond it were not. Raise it"
            self.notes.append(noted(text))
            return None
        self.progress(-1.0, f"{item.kind} at omega = {item.omega:.6g}, {self.name} = {value:.6g}")
        with self.noting(noted(f"could not be followed over {self.name}"), FAILURES):
            curve = track(item, self.name, self.bounds, omega=self.omega.around, **self.options)
            pass_on(curve.interruption)
            self.add(curve)
            piece = self.piece_of(item, value)
            if piece is None:
                self.notes.append(
                    noted("not on the curve that was followed from it. Use a smaller max_step or more harmonics")
                )
        if piece is None:
            self._lost.append((value, item))
        return piece


@dataclass(frozen=True, eq=False)
class AtValues(ABC):
    """Something that is looked for at places, such as values of the parameter, at each by itself.

    What is found at one place does not depend on what is found at others: places are divided among processes.
    `catalogue`: an empty one.
    """

    catalogue: Catalogue

    @abstractmethod
    def found(self, catalogue: Catalogue, place: Any) -> list[Any]:
        """What there is at a place; what cannot be settled is noted in the catalogue."""

    def __call__(self, place: Any) -> tuple[list[Any], list[Note]]:
        own = self.catalogue.emptied()
        return self.found(own, place), own.notes

    def over(self, places: Sequence[Any], workers: int, noted: Catalogue) -> Iterator[list[Any]]:
        """What there is at each place, in order; what could not be settled is noted in `noted`."""
        for found, notes in in_order(self, places, workers):
            noted.notes += notes
            if workers > 1:
                for branch in _branches_of(found):
                    noted.show(branch)
            yield found


def _branches_of(found: Iterable[Any]) -> Iterator[Branch]:
    """The branches among what was found."""
    for item in found:
        one = item[0] if isinstance(item, tuple) else item
        yield from one.branches if isinstance(one, BifurcationDiagram) else (one,) if isinstance(one, Branch) else ()


def branch_through(
    limit_point: Bifurcation, omega: SearchRange, name: str, pieces: Iterable[MonotonePiece], options: SearchOptions
) -> Branch:
    """The branch over omega through a limit point, in a range that holds the limit points of pieces at that value."""
    value = limit_point.parameter(name)
    places = [float(piece.across(value)) for piece in pieces if piece.contains(value)]
    return continue_branch(limit_point, "omega", omega.holding([*places, limit_point.omega]), **options)


def motion_near(orbit: PeriodicOrbit, system: System, omega: float) -> PeriodicOrbit:
    """The motion of a system near another one, at a frequency; ConvergenceError where Newton arrives at none."""
    linear = own_linear_part(orbit, system)
    start = make_curve(system, "omega", omega, omega, harmonics_of(orbit), orbit.basis.nu, linear)
    return Sample(start_point(start, omega, orbit, NewtonOptions())).orbit


# ----------------------------------------------------------------------------------------------------- closed branches
def carrier_of(branch: Branch, attached: Iterable[Branch], options: SearchOptions) -> Branch | None:
    """Of the closed branches that one is connected with by branch points that on which the others hang; None if one of
    them is not closed, or meets a branch that leads to the ends of the range, as those `attached` do.

    Branches meet at branch points, and where motions of twice the period lead from doublings of the one to elsewhere.
    A loop hangs on another if it turns back where it meets it, as what leaves a pitchfork does. ConvergenceError or
    InputError if what crosses one of them at a branch point cannot be followed.
    """
    met, connected = list(attached), [branch]
    for one in connected:  # which grows on the way
        if not one.closed or one.departs is not None or one.arrives is not None:
            return None
        if any(_links(other, one) for other in met):
            return None
        for item in one.bifurcations["BP"]:
            if any(lies_on(item.orbit, other.points) for other in met):
                return None
            if any(lies_on(item.orbit, other.points) for other in connected if other is not one):
                continue
            crossing = switch_branch(item, **options)
            pass_on(crossing.interruption)
            if not any(lies_on(crossing.points[len(crossing) // 2].orbit, other.points) for other in connected):
                connected.append(crossing)
    crossed = (one for one in connected if not any(_turns_back(one, item) for item in one.bifurcations["BP"]))
    return next(crossed, branch)


def _links(doubled: Branch, branch: Branch) -> bool:
    """Whether a branch of twice the period has one end, not both, at a period doubling of another branch."""
    doublings = branch.bifurcations["PD"]
    ends = [
        any(junction.same_place(item, span_of(doubled), beside) for item in doublings)
        for junction, beside in doubled.junctions
        if junction.nu == branch.nu
    ]
    return sum(ends) == 1


def _turns_back(branch: Branch, item: Bifurcation) -> bool:
    """Whether a closed branch lies on one side, in omega, of a bifurcation that it passes."""
    whole = float(branch.arclength[-1])
    ahead = (branch.arclength - item.arclength) % whole
    # points right beside it are off by less than its frequency is known
    clear = np.flatnonzero((ahead > _CLEAR * whole) & (ahead < (1.0 - _CLEAR) * whole))
    after, before = clear[np.argmin(ahead[clear])], clear[np.argmax(ahead[clear])]
    return bool((branch.omega[after] - item.omega) * (branch.omega[before] - item.omega) > 0.0)


#: values of a parameter at which whole responses are followed
MOST_VALUES = 10_000
#: a search among resonances: coarse, since the branches themselves are followed afterwards
_COARSE = Seeds(8, 4, 3)
#: periods that are looked for so where nobody names any and nothing else leads to an isola
UNASKED = (2,)


def listed(values: Any) -> list[Any]:
    """The items of a sequence or an array; a single None for anything else."""
    return list(values) if isinstance(values, Sequence | np.ndarray) and not isinstance(values, str) else [None]


def few(values: Sequence[float]) -> list[float]:
    """The first, the middle and the last of ascending values."""
    return sorted({values[0], values[len(values) // 2], values[-1]})


def checked_orders(search: Any, least: int) -> tuple[int, ...]:
    """Periods, in periods of the load, of a search among resonances."""
    given = listed(search)
    if not all(isinstance(order, int) and not isinstance(order, bool) and order >= least for order in given):
        raise InputError(f"search must be periods in periods of the load, {least} or more, as (2, 3), not {search!r}")
    return tuple(given)


def checked_values(name: str, given: Any, bounds: tuple[float, float], least: int = 1) -> list[float] | int:
    """Values of a parameter within bounds: how many, at least so many, or the values themselves."""
    low, high = bounds
    if isinstance(given, int) and not isinstance(given, bool):
        if least <= given <= MOST_VALUES:
            return given
        raise InputError(
            f"{name} must be at least {least} and at most {MOST_VALUES}, or the values of the parameter themselves, "
            f"not {shortened(given)}"
        )
    values = listed(given)
    if len(values) < min(least, 1) or not all(is_number(value) and low <= value <= high for value in values):
        raise InputError(
            f"{name} must be a number of values, or the values themselves, from {low:.9g} to {high:.9g}, "
            f"not {shortened(given)}"
        )
    return [float(value) for value in values]
