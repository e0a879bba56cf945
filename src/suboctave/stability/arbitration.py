"""Which method to believe: the monodromy matrix first, its witnesses where it leaves the verdict open.

Where a multiplier lies closer to the unit circle than its error estimate, other methods are asked, the cheapest first,
until the verdict is clear. A multiplier lies where the discs (estimate, error) of the methods overlap: the smallest
disc around the overlap is what they say together. An overlap much narrower than either disc is not believed: the radius
stays above half the smaller one. Discs that do not overlap contradict each other; then the disc around both is
kept, which seldom decides, and the result says who said what.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.harmonic.state import BalanceState
from suboctave.stability.methods import Hill, KoopmanHill, Monodromy, StabilityMethod
from suboctave.stability.monodromy import floquet_multipliers
from suboctave.stability.result import FloquetResult

#: least radius of a joint estimate in units of the better single one
_BELIEVED = 0.5
#: logarithm of the product of all multipliers below which a motion counts as undamped
_UNDAMPED = 1e-9
#: unknowns of a witness's matrix up to which it is asked unbidden
_UNBIDDEN = 800


@dataclass(frozen=True)
class Arbitration(StabilityMethod):
    """The monodromy matrix, and its witnesses where it leaves the verdict open: the default.

    witnesses
        Methods to ask, the cheapest first.
    """

    witnesses: tuple[StabilityMethod, ...] = (Hill(), KoopmanHill())
    name: ClassVar[str] = "arbitration"

    def __post_init__(self) -> None:
        for witness in self.witnesses:
            if not isinstance(witness, StabilityMethod) or isinstance(witness, Arbitration):
                raise InputError(f"a witness must be a method such as Hill() or KoopmanHill(), not {witness!r}")

    def multipliers(self, state: BalanceState) -> FloquetResult:
        """See `StabilityMethod.multipliers`."""
        return self.settled(state, floquet_multipliers(state))

    def along(self, state: BalanceState) -> FloquetResult:
        """The monodromy matrix alone."""
        return floquet_multipliers(state)

    def settled(self, state: BalanceState, found: FloquetResult) -> FloquetResult:
        """The verdict, with witnesses where it is open."""
        if found.decided:
            return found
        if abs(float(np.log(np.maximum(np.abs(found.multipliers), 1e-300)).sum())) < _UNDAMPED:
            return replace(found, note="undamped: multipliers stay on the unit circle, and nothing settles the verdict")
        asked, joint, contradiction = [found], found, ""
        size = len(found.multipliers) * (2 * state.basis.harmonics + 1)
        for witness in self.witnesses if size <= _UNBIDDEN else ():
            said = witness.multipliers(state)
            asked.append(said)
            if not said.applicable:
                continue
            joint, conflict = combined(joint, said)
            contradiction = contradiction or conflict
            if joint.decided:
                break
        return replace(joint, note=_words(state, asked, joint, contradiction), witnesses=tuple(asked))


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
                f"{a.method} and {b.method} contradict each other: {_said(a.multipliers[i], a.errors[i])} against "
                f"{_said(b.multipliers[j], b.errors[j])}"
            )
    order = np.argsort(-np.abs(mu), kind="stable")
    return FloquetResult(mu[order], errors[order], f"{a.method} and {b.method}"), contradiction


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


def _words(state: BalanceState, asked: Iterable[FloquetResult], joint: FloquetResult, contradiction: str) -> str:
    first, *others = asked
    heard = [r.method for r in others if r.applicable]
    silent = "; ".join(r.note for r in others if not r.applicable)
    start = f"{_nearest(first)} by {first.method}"
    if contradiction:
        start = f"{contradiction[0].upper()}{contradiction[1:]}"
    if joint.decided:
        return f"{start}; {' and '.join(heard)} settle{'s' if len(heard) == 1 else ''} it"
    remaining = _nearest(joint) if heard else start
    harmonics = state.basis.harmonics
    text = start if contradiction else remaining
    if contradiction:
        text += f"; together: {remaining}"
    if silent:
        text += f"; {silent}"
    return (
        f"{text}. More harmonics than the motion's {harmonics} would settle it, or so.verify (shooting), unless the "
        "motion is a bifurcation point itself"
    )


def _nearest(result: FloquetResult) -> str:
    """Where the multiplier lies that leaves the verdict open."""
    distance = np.abs(result.multipliers) - 1.0
    i = int(np.argmin(np.abs(distance) - result.errors))
    side = "inside" if distance[i] < 0.0 else "outside"
    mu = result.multipliers[i]
    return f"multiplier {_said(mu, result.errors[i])} lies {abs(distance[i]):.1e} {side} the unit circle"


def _said(mu: complex, error: float) -> str:
    digits = 10 if not 1e-15 < error < 1.0 else max(4, 1 - math.floor(math.log10(error)))
    real = f"{mu.real:.{digits}g}"
    text = real if abs(mu.imag) <= error else f"{real}{mu.imag:+.{digits}g}i"
    return f"{text} +- {error:.1e}"


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
