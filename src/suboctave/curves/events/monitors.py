"""What each kind of bifurcation is, and the way from a change of its test between two neighbours to a located one.

A new kind is one class here (or in a file of its own) with four answers: how often it may have happened between two
neighbours, where in between, how to solve for it, and whether a solution is one.

- LP: the component of the tangent along the free parameter changes sign, and does not vanish along a piece;
- BP: the bordered determinant `det [R_X R_omega; t]` changes sign, the branch going straight on;
- PD: det J_half changes sign;
- NS: complex pairs of multipliers cross the unit circle, by the number of those outside, or by that of all multipliers
  outside where it changes by more than LP, BP and PD account for. Two real multipliers with product one (a neutral
  saddle) never cross the circle and are not counted;
- multiple BP, PD and NS: several multipliers pass one place on the circle, alike before and behind it.

First the bordered system is solved from an interpolated start; where that does not converge into the step, the step is
bisected on the test function and the solver tries again from a nearer point. If it never converges (at a grazing
contact the equations are not smooth enough), the bracket of the test's change is all that is known: what it means is
for others to say.
"""

from __future__ import annotations

import cmath
import math
import weakref
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from suboctave.bifurcation.bordered import null_vectors, transversality
from suboctave.bifurcation.gaps import GrazingContact
from suboctave.bifurcation.measures import crossing_pair, upper
from suboctave.continuation.linear import length
from suboctave.continuation.newton import NewtonOptions
from suboctave.continuation.point import CurvePoint, between, point_between
from suboctave.continuation.problem import Array
from suboctave.curves.events.formulation import BORDERED, Formulation
from suboctave.curves.events.locate import Guess, Singular, locate_branch_point, locate_multiple
from suboctave.curves.sample import Sample, compare, resolved
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.perturbation import Kind

#: transversality of a limit point, at least. Newton's method leaves one located on a branch point by mistake within
#: 1e-9 of it, where it is as much; at a peak it is the damping ratio
_TRANSVERSAL = 1e-7
#: how far apart multipliers that pass the circle together may lie, as a share of their distance from it: where they are
#: looked for in one, which the equations then have to confirm
_ALIKE = 1e-3
#: length of an interval, in scaled arclength, in which several pairs are looked for at once: twice that of one that is
#: not cut any further
_SHORTEST = 2e-5
_NONE = np.zeros(0)


class BifurcationKind(ABC):
    """One kind of bifurcation of periodic motions, and the formulation by which it is solved for."""

    name: str
    operator: Kind
    formulation: Formulation = BORDERED
    #: whether multipliers tell, those of the completed motion, and what is solved for belongs to the truncated one
    counted: bool = False
    #: how many bifurcations of the kind fall together
    multiplicity: int = 1
    #: whether it is solved for in one way only, whatever the formulation
    one_way: bool = False

    def __init__(self, formulation: Formulation = BORDERED) -> None:
        self.formulation = formulation

    @abstractmethod
    def changed(self, a: Sample, b: Sample) -> bool:
        """True if the test function differs in sign between two neighbours."""

    @abstractmethod
    def fraction(self, a: Sample, b: Sample) -> float:
        """A guess of where in between, 0 at a and 1 at b."""

    def kappa(self, sample: Sample) -> float:
        """Start for the frequency of the perturbation."""
        return 0.0

    @staticmethod
    def of_its_sort(mu: ComplexArray) -> ComplexArray:
        """The multipliers that could pass the circle where those of the kind do; none unless several may together."""
        return np.zeros(0, dtype=complex)

    def solve(self, guess: Guess) -> Singular:
        """Solve the bifurcation's system from a guess."""
        return self.formulation.locate(guess, self.operator)

    def genuine(self, solution: Singular, guess: Guess) -> bool:
        """Whether a solution of the system really is of this kind."""
        return True

    def critical(self, solution: Singular) -> complex | None:
        """The multiplier that lies on the unit circle at a solution, None if none need."""
        return {Kind.INTEGER: 1.0 + 0.0j, Kind.HALF: -1.0 + 0.0j}[self.operator]

    def contact(self, solution: Singular, name: str) -> GrazingContact | None:
        """The contact that grazes at a solution, where the kind is that; `name` is the free parameter's."""
        return None


class LimitPoint(BifurcationKind):
    """LP: the branch turns back in its free parameter; a multiplier is +1."""

    name = "LP"
    operator = Kind.INTEGER

    def changed(self, a: Sample, b: Sample) -> bool:
        # where the parameter stands still the sign of its slope is rounding
        return (a.slope > 0.0) != (b.slope > 0.0) and not (a.still or b.still)

    def fraction(self, a: Sample, b: Sample) -> float:
        return _zero(a.slope, b.slope)

    def genuine(self, solution: Singular, guess: Guess) -> bool:
        """At a branch point R_X is singular, too, but R_p lies in its range."""
        vectors = solution.vectors or null_vectors(solution.state, Kind.INTEGER)
        return transversality(solution.state, vectors, guess.name) > _TRANSVERSAL


class BranchPoint(BifurcationKind):
    """BP: two branches cross; a multiplier is +1."""

    name = "BP"
    operator = Kind.INTEGER

    def changed(self, a: Sample, b: Sample) -> bool:
        return (a.point.orientation > 0.0) != (b.point.orientation > 0.0)

    def fraction(self, a: Sample, b: Sample) -> float:
        return _zero(_nearest(a, 1.0), _nearest(b, 1.0))

    @staticmethod
    def of_its_sort(mu: ComplexArray) -> ComplexArray:
        return _real(mu[mu.real > 0.0])

    def solve(self, guess: Guess) -> Singular:
        return locate_branch_point(guess)


class PeriodDoubling(BifurcationKind):
    """PD: motions of twice the period branch off; a multiplier is -1."""

    name = "PD"
    operator = Kind.HALF

    def changed(self, a: Sample, b: Sample) -> bool:
        return (a.half_sign > 0.0) != (b.half_sign > 0.0)

    def fraction(self, a: Sample, b: Sample) -> float:
        return _zero(_nearest(a, -1.0), _nearest(b, -1.0))

    @staticmethod
    def of_its_sort(mu: ComplexArray) -> ComplexArray:
        return _real(mu[mu.real < 0.0])


class NeimarkSacker(BifurcationKind):
    """NS: a torus branches off; a complex pair of multipliers crosses the unit circle."""

    name = "NS"
    operator = Kind.FREE
    counted = True

    def changed(self, a: Sample, b: Sample) -> bool:
        return any(kind.name == "NS" for kind in changes(a, b))

    @staticmethod
    def crossing(a: Sample, b: Sample) -> tuple[complex, complex] | None:
        """The complex pair of multipliers that crosses the circle: its members at a and b."""
        if not resolved(a, b):
            return None
        kinds = _passing_one(a, b)
        real = sum(kind.multiplicity for kind in kinds)
        # one multiplier passes +1 at a limit point or a branch point, or at both in one
        real -= BRANCH_POINT in kinds and LIMIT_POINT in kinds
        before, behind = a.floquet.multipliers, b.floquet.multipliers
        return crossing_pair(before, behind, compare(a, b).change, real)

    @staticmethod
    def of_its_sort(mu: ComplexArray) -> ComplexArray:
        return upper(mu)

    def fraction(self, a: Sample, b: Sample) -> float:
        pair = self.crossing(a, b)
        return 0.5 if pair is None else _zero(abs(pair[0]) - 1.0, abs(pair[1]) - 1.0)

    def kappa(self, sample: Sample) -> float:
        """From the complex multiplier closest to the unit circle: `mu = exp(i kappa T)`."""
        pairs = upper(sample.floquet.multipliers)
        if not len(pairs):
            raise ConvergenceError("no complex pair of multipliers here")
        mu = min(pairs, key=lambda m: abs(abs(m) - 1.0))
        return float(np.angle(mu)) * sample.state.rate / (2.0 * np.pi)

    def genuine(self, solution: Singular, guess: Guess) -> bool:
        """At kappa = 0 or w0/2 every LP and PD solves the system as well: those are none."""
        share = solution.kappa / solution.state.rate
        return 1e-3 < share < 0.5 - 1e-3

    def critical(self, solution: Singular) -> complex:
        """`exp(i kappa T)`."""
        return cmath.exp(2j * cmath.pi * solution.kappa / solution.state.rate)


class PairAmong(NeimarkSacker):
    """One of several pairs of different frequencies that cross the circle within the shortest interval, by its rank
    among these, ascending: as the modes of oscillators with equal dampers do.
    """

    one_way = True

    def __init__(self, rank: int, count: int) -> None:
        super().__init__()
        self.rank, self.count = rank, count

    def _pair(self, sample: Sample) -> complex:
        pairs = upper(sample.floquet.multipliers)
        nearest = pairs[np.argsort(np.abs(np.abs(pairs) - 1.0), kind="stable")[: self.count]]
        if len(nearest) < self.count:
            raise ConvergenceError("no complex pair of multipliers here")
        return complex(nearest[np.argsort(np.angle(nearest), kind="stable")[self.rank]])

    def fraction(self, a: Sample, b: Sample) -> float:
        return _zero(abs(self._pair(a)) - 1.0, abs(self._pair(b)) - 1.0)

    def kappa(self, sample: Sample) -> float:
        return float(np.angle(self._pair(sample))) * sample.state.rate / (2.0 * np.pi)


@lru_cache(maxsize=64)
def among(rank: int, count: int) -> PairAmong:
    """One object for each."""
    return PairAmong(rank, count)


class Multiple(BifurcationKind):
    """Several of a kind fall together, as the modes of equal sectors do."""

    one_way = True

    def __init__(self, kind: BifurcationKind, multiplicity: int) -> None:
        super().__init__(kind.formulation)
        self.kind, self.multiplicity = kind, multiplicity
        self.name, self.operator, self.counted = kind.name, kind.operator, kind.counted

    def changed(self, a: Sample, b: Sample) -> bool:
        return any(isinstance(kind, Multiple) and kind.name == self.name for kind in changes(a, b))

    def fraction(self, a: Sample, b: Sample) -> float:
        before, behind = _together(self.kind, a, b)
        return _zero(float(before.mean()), float(behind.mean())) if before.size else 0.5

    def kappa(self, sample: Sample) -> float:
        return self.kind.kappa(sample)

    def solve(self, guess: Guess) -> Singular:
        return locate_multiple(guess, self.operator, self.multiplicity)

    def genuine(self, solution: Singular, guess: Guess) -> bool:
        return self.operator is not Kind.FREE or self.kind.genuine(solution, guess)

    def critical(self, solution: Singular) -> complex | None:
        return self.kind.critical(solution)


@lru_cache(maxsize=64)
def multiple(kind: BifurcationKind, multiplicity: int) -> BifurcationKind:
    """The kind of so many of a kind that fall together, one object for each; of one itself."""
    return Multiple(kind, multiplicity) if multiplicity > 1 else kind


BRANCH_POINT, LIMIT_POINT, PERIOD_DOUBLING = BranchPoint(), LimitPoint(), PeriodDoubling()
NEIMARK_SACKER = NeimarkSacker()
#: in the order in which they are looked for: a BP explains the LP test's change at a pitchfork
ALL_KINDS: tuple[BifurcationKind, ...] = (BRANCH_POINT, LIMIT_POINT, PERIOD_DOUBLING, NEIMARK_SACKER)


def solved_by(formulation: Formulation) -> dict[str, BifurcationKind]:
    """The kinds by name, to be solved for by a formulation; a branch point is always solved for in the same way."""
    own = BRANCH_POINT, LimitPoint(formulation), PeriodDoubling(formulation), NeimarkSacker(formulation)
    return {kind.name: kind for kind in (ALL_KINDS if formulation == BORDERED else own)}


def changes(a: Sample, b: Sample) -> tuple[BifurcationKind, ...]:
    """The kinds whose tests have changed between two neighbours, in the order in which they are looked for."""
    # several ask this of the same two
    if b.compared is not None and b.compared[0]() is a:
        return b.compared[1]
    kinds: list[BifurcationKind] = []
    eventful = a.signs != b.signs or abs(compare(a, b).change) > 1
    if eventful:
        kinds = _passing_one(a, b)
    if eventful and NEIMARK_SACKER.crossing(a, b) is not None:
        together, apart = len(_together(NEIMARK_SACKER, a, b)[0]), _pairs_within(a, b)
        alone = together > 1 or apart < 2
        kinds += [multiple(NEIMARK_SACKER, together)] if alone else [among(rank, apart) for rank in range(apart)]
    b.compared = weakref.ref(a), tuple(kinds)
    return b.compared[1]


def _passing_one(a: Sample, b: Sample) -> list[BifurcationKind]:
    """The kinds, NS left out, whose tests have changed between two neighbours."""
    kinds: list[BifurcationKind] = []
    for kind in ALL_KINDS[:3]:
        several = len(_together(kind, a, b)[0])
        if several or kind.changed(a, b):
            kinds.append(multiple(kind, several))
    return kinds


def _pairs_within(a: Sample, b: Sample) -> int:
    """How many pairs cross the circle within the shortest interval, 0 in longer ones, which are cut."""
    if b.place - a.place > _SHORTEST:
        return 0
    outside = [int(np.count_nonzero(np.abs(upper(s.floquet.multipliers)) > 1.0)) for s in (a, b)]
    return abs(outside[1] - outside[0])


def _together(kind: BifurcationKind, a: Sample, b: Sample) -> tuple[Array, Array]:
    """By how much the multipliers that pass the circle together between two neighbours, two of them at least, lie
    outside of it at both; they must be alike before and behind. Empty where there are none.
    """
    if not resolved(a, b):
        return _NONE, _NONE
    sorts = [kind.of_its_sort(sample.floquet.multipliers) for sample in (a, b)]
    outside = [mu[np.abs(mu) > 1.0] for mu in sorts]
    several = abs(len(outside[0]) - len(outside[1]))
    if several < 2:
        return _NONE, _NONE
    inwards = len(outside[0]) > len(outside[1])
    first, last = (outside[0], sorts[1]) if inwards else (sorts[0], outside[1])
    families = _alike(first if inwards else first[np.abs(first) <= 1.0], several)
    others = _alike(last[np.abs(last) <= 1.0] if inwards else last, several)
    if not (families and others):
        return _NONE, _NONE
    pair = min(product(families, others), key=lambda pair: abs(pair[0].mean() - pair[1].mean()))
    return np.abs(pair[0]) - 1.0, np.abs(pair[1]) - 1.0


def _alike(mu: ComplexArray, several: int) -> list[ComplexArray]:
    """The sets of so many of some multipliers that lie as good as in one place."""
    mu = mu[np.argsort(np.abs(mu), kind="stable")]
    sets = [mu[i : i + several] for i in range(len(mu) - several + 1)]
    return [one for one in sets if np.abs(one - one.mean()).max() <= _ALIKE * np.abs(np.abs(one) - 1.0).max()]


def _zero(a: float, b: float) -> float:
    """Zero of the line through (0, a), (1, b), kept inside the interval; the middle if there is none."""
    if a * b >= 0.0 or not np.isfinite(a * b):
        return 0.5
    return min(0.98, max(0.02, a / (a - b)))


def _real(mu: ComplexArray) -> ComplexArray:
    """The real multipliers."""
    return mu[np.abs(mu.imag) < 1e-7 * np.abs(mu)]


def _nearest(sample: Sample, target: float) -> float:
    """Distance of the real multiplier nearest to a target from it, signed; nan if there is none."""
    real = _real(sample.standing.multipliers).real
    return float(real[np.argmin(np.abs(real - target))] - target) if real.size else float("nan")


#: fractions of a step by which rounding may carry a solution beyond its ends
_SLACK = 1e-7
#: the same before the first point of a curve, which may be the bifurcation as its multipliers tell, not its harmonics,
#: and beyond ends at which multipliers, if these tell of the kind, leave it open on which side they lie
_BEFORE = 1e-2
#: shares of a step: the bracket that is the answer, that between motions with more harmonics than their curve, and how
#: much narrower it has to be to solve again from there
NARROWEST, _OF_FINER, _NARROWER = 1e-10, 0.02, 0.06
#: corrections of a place on a step, at most, and one that settles it, as a share of the step
_ROUNDS, _SETTLED = 20, 1e-12


@dataclass(frozen=True)
class Located:
    """A bifurcation between two neighbours: solved (`solution`), or only the change of its test bracketed (`bracket`,
    its second end `sample`, with its width). One that is solved has a width where it lies beside them.
    """

    kind: BifurcationKind
    fraction: float
    sample: Sample
    solution: Singular | None
    width: float
    bracket: tuple[Sample, Sample] | None = None


def locate(
    kind: BifurcationKind,
    a: Sample,
    b: Sample,
    newton: NewtonOptions,
    narrowest: float = NARROWEST,
    begins: bool = False,
) -> Located | None:
    """Locate a bifurcation of a kind whose test changed between two neighbours; None if it turns out to be none.

    A bracket as narrow as that, as a share of the step, is taken for the answer. `begins`: whether the curve begins
    with the first neighbour; what lies right before it then belongs to no other step.
    """
    # where tests are those of motions with more harmonics, halving their brackets does not lead to what fewer have
    finer = a.finer is not None or b.finer is not None
    found = _located(kind, a, b, newton, max(narrowest, _OF_FINER) if finer else narrowest, begins)
    missed = found is None or found.solution is None
    return (_beside(kind, a, b) or found) if missed and (kind.counted or finer) else found


def _beside(kind: BifurcationKind, a: Sample, b: Sample) -> Located | None:
    """What multipliers show between two neighbours and the harmonics solved for have beside them, no farther off than
    these are apart; None if there is nothing.
    """
    share = kind.fraction(a, b)
    nearer = a if share < 0.5 else b
    solved = _solved(kind, between(a.point, b.point, share), b.point, nearer)
    if solved is None:
        return None
    size = length(b.point.weights * (b.point.u - b.curve.transfer(a.point.u, a.curve)))
    ends = [(end, length(b.point.weights * (solved[1] - b.curve.transfer(end.point.u, end.curve)))) for end in (a, b)]
    end, away = min(ends, key=lambda entry: entry[1])
    if away > size:
        return None
    width = abs(float(solved[1][-1]) - end.point.parameter)
    return Located(kind, 0.0 if end is a else 1.0, end, solved[0], width)


def _located(
    kind: BifurcationKind, a: Sample, b: Sample, newton: NewtonOptions, narrowest: float, begins: bool
) -> Located | None:
    """What of it lies between two neighbours: its bracket is made narrower by secants of the test, and it is solved for
    at first, and again whenever that has helped much. What is solved for and what the test shows lie as far apart as
    the harmonics left out make it: within a bracket that is wide enough they are the same.
    """
    low, high = 0.0, 1.0
    at_low, at_high = a, b
    before, behind = (_BEFORE if kind.counted and not end.floquet.decided else _SLACK for end in (a, b))
    tried, wider = math.inf, math.inf
    # one beyond an end that leaves it open may be another one, which leads back: what lies inside comes first
    beyond: Located | None = None
    while beyond is None or (before < high and low < 1.0 - behind):
        width, share = high - low, kind.fraction(at_low, at_high)
        nearer, last = at_low if share < 0.5 else at_high, width <= narrowest
        if narrowest < 1.0 and (last or width <= _NARROWER * tried):
            tried = width
            # near a grazing the curve bends within a sliver of the step: only its own ends tell where it runs
            attempt = solved_between(kind, at_low, at_high, share, nearer)
            # what lies beyond an end belongs to the next step, and would be missed there if it were taken for the one
            # here
            if attempt is not None:
                place = low + attempt[1] * (high - low)
                if -(_BEFORE if begins else before) <= place <= 1.0 + behind:
                    found = Located(kind, min(1.0, max(place, 0.0)), nearer, attempt[0], 0.0)
                    if begins or -_SLACK <= place <= 1.0 + _SLACK:
                        return found
                    beyond = beyond or found
        if last:
            break
        # where secants make it no narrower it is halved
        first = share if width <= 0.5 * wider else 0.5
        wider, middle = width, None
        for part in (first, 0.4, 0.65):
            try:
                at = low + part * (high - low)
                middle = b.at(point_between(a.point, b.point, at, newton, exactly=True))
                break
            except ConvergenceError:
                continue
        if middle is None:
            break
        if kind.changed(at_low, middle):
            high, at_high = at, middle
        elif kind.changed(middle, at_high):
            low, at_low = at, middle
        else:
            return beyond
    if beyond is not None:
        return beyond
    names = abs(at_high.point.parameter - at_low.point.parameter)
    return Located(kind, 0.5 * (low + high), at_high, None, 0.5 * names, (at_low, at_high))


def solved_between(
    kind: BifurcationKind, low: Sample, high: Sample, share: float, nearer: Sample
) -> tuple[Singular, float] | None:
    """A solution between two samples and where, from a start at a share of the way; None if there is none."""
    solved = _solved(kind, between(low.point, high.point, share), high.point, nearer)
    fraction = None if solved is None else position(low.point, high.point, solved[1])
    return None if solved is None or fraction is None or not -0.05 <= fraction <= 1.05 else (solved[0], fraction)


def _solved(kind: BifurcationKind, u: Array, point: CurvePoint, sample: Sample) -> tuple[Singular, Array] | None:
    """The bifurcation from u, in the discretisation of a point, and its place; None if there is none."""
    try:
        guess = Guess.at(u, point, kind.kappa(sample))
        solution = kind.solve(guess)
    except ConvergenceError:
        return None
    return (solution, guess.vector(solution.state)) if kind.genuine(solution, guess) else None


def position(a: CurvePoint, b: CurvePoint, u: Array) -> float | None:
    """Where between two neighbours a point u (in the discretisation of b) lies on the curve, or None if it lies
    elsewhere.
    """
    ua = b.curve.transfer(a.u, a.curve)
    chord = b.weights * (b.u - ua)
    size = length(chord)
    if size == 0.0:
        return None
    fraction = float((b.weights * (u - ua)) @ chord) / size**2
    for _ in range(_ROUNDS):
        if not -1.0 <= fraction <= 2.0:  # the cubic says nothing of what lies so far outside
            break
        # it runs at uneven speed along the chord
        rest = float((b.weights * (u - between(a, b, fraction))) @ chord) / size**2
        fraction += rest
        if abs(rest) < _SETTLED:
            break
    away = length(b.weights * (u - between(a, b, min(1.0, max(0.0, fraction)))))
    return fraction if away <= 0.1 * size + 1e-7 else None
