"""Which method to believe: the monodromy matrix first, its witnesses where it leaves the verdict open.

Where a multiplier lies closer to the unit circle than its error estimate, other methods are asked, the cheapest first,
until the verdict is clear. A multiplier lies where the discs (estimate, error) of the methods overlap: the smallest
disc around the overlap is what they say together. An overlap much narrower than either disc is not believed: the radius
stays above half the smaller one. Discs that do not overlap contradict each other; then the disc around both is
kept, which seldom decides, and the result says who said what.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from suboctave.errors import InputError, shortened, suggest
from suboctave.harmonic.state import BalanceState
from suboctave.interruption import check_time
from suboctave.stability.methods import Hill, KoopmanHill, Monodromy, StabilityMethod
from suboctave.stability.monodromy import floquet_multipliers
from suboctave.stability.result import FloquetResult, written

#: least radius of a joint estimate in units of the better single one
_BELIEVED = 0.5
#: rows of a witness's matrix up to which it is asked along a curve, where nobody waits for this one point
_UNBIDDEN = 700


@dataclass(frozen=True)
class Arbitration(StabilityMethod):
    """The monodromy matrix, and its witnesses where it leaves the verdict open: the default.

    witnesses
        Methods to ask, the cheapest first.
    """

    witnesses: tuple[StabilityMethod, ...] = (Hill(), KoopmanHill())
    name: ClassVar[str] = "arbitration"
    follows_monodromy: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not isinstance(self.witnesses, Sequence):
            raise InputError(f"witnesses must be several methods, as (Hill(),), not {shortened(self.witnesses)}")
        for witness in self.witnesses:
            if not isinstance(witness, StabilityMethod) or isinstance(witness, Arbitration):
                raise InputError(f"a witness must be a method such as Hill() or KoopmanHill(), not {witness!r}")

    def multipliers(self, state: BalanceState) -> FloquetResult:
        """See `StabilityMethod.multipliers`."""
        return self._weighed(state, floquet_multipliers(state), math.inf)

    def along(self, state: BalanceState) -> FloquetResult:
        """The monodromy matrix alone."""
        return floquet_multipliers(state)

    def settled(self, state: BalanceState, found: FloquetResult) -> FloquetResult:
        """The verdict, with witnesses where it is open and they cost little."""
        return self._weighed(state, found, _UNBIDDEN)

    def _weighed(self, state: BalanceState, found: FloquetResult, limit: float) -> FloquetResult:
        if found.decided:
            return found
        if found.undamped:
            return replace(found, note="Undamped: multipliers stay on the unit circle, and nothing settles the verdict")
        size = len(found.multipliers) * (2 * state.basis.harmonics + 1)
        if size > limit:
            skipped = f"Witnesses, with matrices of {size} rows, are not asked along a curve, but by so.stability"
            return replace(found, note=f"{_open(found)}. {skipped}")
        asked, joint, contradictions = [found], found, []
        for witness in self.witnesses:
            check_time()
            said = witness.multipliers(state)
            asked.append(said)
            if not said.applicable:
                continue
            joint, contradiction = combined(joint, said)
            contradictions += [contradiction] if contradiction else []
            if joint.decided:
                break
        return replace(joint, note=_words(state, asked, joint, contradictions), witnesses=tuple(asked))


def combined(a: FloquetResult, b: FloquetResult) -> tuple[FloquetResult, str]:
    """What two methods say together, and a sentence if they contradict each other."""
    from scipy.optimize import linear_sum_assignment

    # relative to the errors, so that small multipliers with many digits are paired as well as large ones
    scale = a.errors[:, None] + b.errors[None, :]
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


def _words(
    state: BalanceState, asked: Sequence[FloquetResult], joint: FloquetResult, contradictions: Sequence[str]
) -> str:
    """How the verdict came about, or what keeps it open and what would settle it."""
    first, others = asked[0], asked[1:]
    heard = [r.method for r in others if r.applicable]
    if joint.decided:
        settled = f"{' and '.join(heard)} settle{'s' if len(heard) == 1 else ''} it"
        return ". ".join([_open(first), *contradictions, settled])
    sentences = [_open(joint), *contradictions, *(r.note for r in others if not r.applicable)]
    sentences.append(
        f"More harmonics than the motion's {state.basis.harmonics} would settle it, or shooting (so.verify), unless "
        "the motion is itself a bifurcation point"
    )
    return ". ".join(sentences)


def _open(result: FloquetResult) -> str:
    """Which multiplier leaves the verdict open."""
    distance = np.abs(result.multipliers) - 1.0
    i = int(np.argmin(np.abs(distance) - result.errors))
    side = "inside" if distance[i] < 0.0 else "outside"
    where = f"multiplier {written(result.multipliers[i], result.errors[i])}, {abs(distance[i]):.1e} {side} the circle"
    return f"Undecided by {result.method}: {where}"


METHODS: dict[str, StabilityMethod] = {
    method.name: method for method in (Arbitration(), Monodromy(), Hill(), KoopmanHill())
}


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
        raise InputError(f"a stability method is Monodromy(), Hill(), KoopmanHill() or a name, not {given!r}")
    return given
