"""The methods that a user can ask for, as objects: `so.stability(orbit, method=...)` and `stability=...` of the verbs.

A method takes one solved motion's equations and returns a `FloquetResult`. Along a curve it is asked for a `spectrum`:
the multipliers of the motion as it stands, and of the motion completed by what its harmonics leave out. Tests of
neighbouring points compare these where they are resolved, and those of motions as they stand elsewhere. `settled` gives
the verdict on a point that was accepted: arbitration asks its witnesses only there.

Arbitration: where a multiplier lies closer to the unit circle than its error estimate, other methods follow, the
cheapest first, until the verdict is clear. A multiplier lies where the discs (estimate, error) of the methods overlap:
the smallest disc around the overlap is what they say together. An overlap much narrower than either disc is not
believed: the radius stays above half the smaller one. Discs that do not overlap contradict each other; then the disc
around both is kept, which seldom decides, and the result says who said what.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from suboctave.arguments import checked
from suboctave.errors import ConvergenceError, InputError, shortened, suggest
from suboctave.floquet.hill import hill_beside, hill_multipliers
from suboctave.floquet.monodromy import MonodromySpectrum, floquet_multipliers
from suboctave.floquet.result import FloquetResult, OneResult, Spectrum, written
from suboctave.harmonic.evaluation import BalanceState
from suboctave.interruption import check_time

SELECTIONS = ("strip", "imaginary", "symmetry")
#: least radius of a joint estimate in units of the better single one
_BELIEVED = 0.5
#: rows of a witness's matrix up to which it is asked along a curve, where nobody waits for this one point
_UNBIDDEN = 700


class StabilityMethod(ABC):
    """One way to the multipliers of a motion."""

    name: ClassVar[str]
    #: whether `along` gives the multipliers of the monodromy matrix
    follows_monodromy: ClassVar[bool] = False

    @abstractmethod
    def multipliers(self, state: BalanceState) -> FloquetResult:
        """Multipliers, error estimates and verdict of a solved motion, over the motion's own period."""

    def beside(self, state: BalanceState, known: FloquetResult) -> FloquetResult:
        """As a witness on another method's result: something of those multipliers that this leaves open is enough."""
        return self.multipliers(state)

    def along(self, state: BalanceState) -> FloquetResult:
        """The same along a curve, where something must be said at every point."""
        result = self.multipliers(state)
        if result.applicable:
            return result
        instead = floquet_multipliers(state)
        return replace(instead, note=f"{result.note}; multipliers of the monodromy matrix instead", stands_in=True)

    def spectrum(self, state: BalanceState) -> Spectrum:
        """Multipliers along a curve, of the motion as it stands and of the completed one, as they are asked for."""
        return OneResult(self.along(state))

    def settled(self, state: BalanceState, result: FloquetResult) -> FloquetResult:
        """The verdict on a point of a curve, from the `result` of `along` there."""
        return result


@checked(methods=False)
@dataclass(frozen=True)
class Monodromy(StabilityMethod):
    """Multipliers as eigenvalues of the monodromy matrix, a product of matrix exponentials over one period."""

    name: ClassVar[str] = "monodromy"
    follows_monodromy: ClassVar[bool] = True

    def multipliers(self, state: BalanceState) -> FloquetResult:
        return floquet_multipliers(state)

    def spectrum(self, state: BalanceState) -> Spectrum:
        return MonodromySpectrum(state)


@checked(methods=False)
@dataclass(frozen=True)
class Hill(StabilityMethod):
    """Multipliers as eigenvalues in the frequency domain; see `suboctave.floquet.hill`.

    selection
        Which eigenvalues count: "strip" (checks itself), or as the literature does it, "imaginary" (smallest imaginary
        parts) and "symmetry" (most central eigenvectors). The last two are there for comparison: they fail beside every
        period doubling, and the result says so where they do.
    """

    selection: str = "strip"
    name: ClassVar[str] = "hill"

    def __post_init__(self) -> None:
        if self.selection not in SELECTIONS:
            raise InputError(f"unknown selection {self.selection!r}{suggest(str(self.selection), SELECTIONS)}")

    def multipliers(self, state: BalanceState) -> FloquetResult:
        return _without_equation(state, self.name) or hill_multipliers(state, self.selection)

    def beside(self, state: BalanceState, known: FloquetResult) -> FloquetResult:
        """Roots of Hill's determinant beside what is in doubt, whatever the selection."""
        if not state.balance.system.structural.zero:
            note = "Structural damping: multipliers are roots of Hill's determinant already"
            return FloquetResult.inapplicable(len(known.multipliers), self.name, note)
        return hill_beside(state, known)


@checked(methods=False)
@dataclass(frozen=True)
class Arbitration(StabilityMethod):
    """The monodromy matrix, and its witnesses where it leaves the verdict open: the default.

    witnesses
        Methods to ask, the cheapest first.
    """

    witnesses: tuple[StabilityMethod, ...] = (Hill(),)
    name: ClassVar[str] = "arbitration"
    follows_monodromy: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not isinstance(self.witnesses, Sequence):
            raise InputError(f"witnesses must be several methods, as (Hill(),), not {shortened(self.witnesses)}")
        for witness in self.witnesses:
            if not isinstance(witness, StabilityMethod) or isinstance(witness, Arbitration):
                raise InputError(f"a witness must be a method such as Hill(), not {witness!r}")

    def multipliers(self, state: BalanceState) -> FloquetResult:
        return self._weighed(state, floquet_multipliers(state), math.inf)

    def along(self, state: BalanceState) -> FloquetResult:
        """The monodromy matrix alone."""
        return floquet_multipliers(state)

    def spectrum(self, state: BalanceState) -> Spectrum:
        return MonodromySpectrum(state)

    def settled(self, state: BalanceState, result: FloquetResult) -> FloquetResult:
        """The verdict, with witnesses where it is open, they cost little, and the motion is resolved: they have as many
        harmonics.
        """
        return self._weighed(state, result, _UNBIDDEN) if result.resolved else result

    def _weighed(self, state: BalanceState, result: FloquetResult, limit: float) -> FloquetResult:
        if result.decided:
            return result
        if result.undamped:
            return replace(result, note="Undamped: multipliers stay on the unit circle, stability is undecided")
        size = 2 * state.balance.size * (2 * state.basis.harmonics + 1)
        if size > limit:
            skipped = f"A check with matrices of {size} rows is left out along curves: use so.stability(orbit)"
            return replace(result, note=f"{_open(result)}. {skipped}")
        results, joint, contradictions = [result], result, []
        for witness in self.witnesses:
            check_time()
            try:
                other = witness.beside(state, joint)
            except ConvergenceError as failure:  # with more harmonics the motion may leave the range of the forces
                other = FloquetResult.inapplicable(len(result.multipliers), witness.name, str(failure))
            results.append(other)
            if not other.applicable:
                continue
            joint, contradiction = combined(joint, other)
            contradictions += [contradiction] if contradiction else []
            if joint.decided:
                break
        return replace(joint, note=_explanation(state, results, joint, contradictions), witnesses=tuple(results))


def _without_equation(state: BalanceState, name: str) -> FloquetResult | None:
    """That a method does not apply, as the linear part has no equation of motion; None if it has."""
    if state.balance.system.structural.zero:
        return None
    note = "Structural damping has no equation of motion, which this method needs: use the default"
    return FloquetResult.inapplicable(2 * len(state.linear.equation_of_motion()[0]), name, note)


def combined(a: FloquetResult, b: FloquetResult) -> tuple[FloquetResult, str]:
    """What two methods say together, and a sentence if they contradict each other."""
    from scipy.optimize import linear_sum_assignment

    # relative to the errors, so that small multipliers with many digits are paired as well as large ones; what one
    # method does not know is where the other has it
    known = [np.where(np.isfinite(one.errors), one.errors, 0.0) for one in (a, b)]
    scale = known[0][:, None] + known[1][None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        cost = np.nan_to_num(np.abs(a.multipliers[:, None] - b.multipliers[None, :]) / scale, nan=1e300, posinf=1e300)
    partner = linear_sum_assignment(np.minimum(cost, 1e300))[1]
    mu, errors = a.multipliers.copy(), a.errors.copy()
    contradiction = ""
    for i, j in enumerate(partner):
        mu[i], errors[i], consistent = _overlap(mu[i], errors[i], b.multipliers[j], b.errors[j])
        if not consistent and not contradiction:
            contradiction = (
                f"{a.method} and {b.method} contradict each other: {written(a.multipliers[i], a.errors[i])} against "
                f"{written(b.multipliers[j], b.errors[j])}"
            )
    order = np.argsort(-np.abs(mu), kind="stable")
    return FloquetResult(mu[order], errors[order], f"{a.method} + {b.method}"), contradiction


def _overlap(p: complex, a: float, q: complex, b: float) -> tuple[complex, float, bool]:
    """Centre and radius of the smallest disc around the overlap of two discs; around both where there is none."""
    # beyond all numbers infinity, without a word
    p, a, q, b = complex(p), float(a), complex(q), float(b)
    if b > a:
        p, a, q, b = q, b, p, a
    d = abs(q - p)
    if d > a + b:
        radius = 0.5 * (d + a + b)
        return (p + (radius - a) / d * (q - p), radius, False) if math.isfinite(radius) else (q, b, True)
    if d * d <= a * a - b * b or not math.isfinite(a):
        # the smaller disc's whole width lies inside the larger one
        return q, b, True
    along = (d * d + a * a - b * b) / (2.0 * d)
    radius = math.sqrt(max(0.0, a * a - along * along))
    return p + along / d * (q - p), max(radius, _BELIEVED * b), True


def _explanation(
    state: BalanceState, results: Sequence[FloquetResult], joint: FloquetResult, contradictions: Sequence[str]
) -> str:
    """How the verdict came about, or what keeps it open and what would settle it."""
    first, others = results[0], results[1:]
    witnesses = [r.method for r in others if r.applicable]
    if joint.decided:
        settled = f"{' and '.join(witnesses)} settle{'s' if len(witnesses) == 1 else ''} it"
        return ". ".join([_open(first), *contradictions, settled])
    sentences = [_open(joint), *contradictions, *(r.note for r in others if not r.applicable)]
    sentences.append(
        f"Use more harmonics than the motion's {state.basis.harmonics}, or so.verify, unless the motion is itself a "
        "bifurcation"
    )
    return ". ".join(sentences)


def _open(result: FloquetResult) -> str:
    """Which multiplier leaves the verdict open."""
    distance = np.abs(result.multipliers) - 1.0
    i = int(np.argmin(np.abs(distance) - result.errors))
    side = "inside" if distance[i] < 0.0 else "outside"
    where = f"multiplier {written(result.multipliers[i], result.errors[i])}, {abs(distance[i]):.1e} {side} the circle"
    return f"Undecided by {result.method}: {where}"


METHODS: dict[str, StabilityMethod] = {method.name: method for method in (Arbitration(), Monodromy(), Hill())}


def method_of(given: StabilityMethod | str | None) -> StabilityMethod:
    """The method that a user asked for: an object, its name, or None for the default."""
    if given is None:
        return METHODS[Arbitration.name]
    if isinstance(given, str):
        if given not in METHODS:
            raise InputError(f"unknown stability method {given!r}{suggest(given, METHODS)}")
        return METHODS[given]
    if isinstance(given, type) and issubclass(given, StabilityMethod):
        raise InputError(f"give an object, {given.__name__}(), instead of the class")
    if not isinstance(given, StabilityMethod):
        raise InputError(f"a stability method is Monodromy(), Hill() or a name, not {given!r}")
    return given
