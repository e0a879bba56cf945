"""Where a curve of bifurcations ends although its parameters stay in range: its motions cease to be of its kind.

- NS: kappa reaches 0 (R1, on a curve of limit points) or w0/2 (R2, on a curve of period doublings), located there. At
  w0/2 the harmonics left out shift the end in the equations solved, so that a curve may go on with neutral saddles: it
  ends as well where the pair has become two real multipliers. Perturbations of motions with a half-wave symmetry have
  either even or odd multiples of w0 beside kappa. The two of a pair are then of different kinds, and pass each other
  at w0/2 as if nothing were there: the curve goes on with kappa above it, and ends where that reaches w0.
- BP: the unfolding is not zero any more: the symmetry that forces branch points is broken.
- LP of motions without the half-wave symmetry that the system has: the even harmonics vanish, where the branch points
  of the symmetric motions change between super- and subcritical. Along these every point solves the same equations.
- LP of doubled motions: the doubled part vanishes, on a curve of period doublings of the parent motion, at a GPD. In
  the basis of the doubled period every period doubling of the parent solves the equations of a limit point, so that a
  tracker would slide on along them: J at the parent is block diagonal, J_0 and J_half.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from suboctave.analysis.tracked_curve import TrackedCurve
from suboctave.analysis.tracked_events import Found
from suboctave.analysis.tracked_sample import TrackedSample, nearest_point, zero_along
from suboctave.analysis.tracked_tests import CurveTest, DoubleMultiplier, GeneralisedDoubling
from suboctave.bifurcation.augmented import Augmentation, BranchPointUnfolded, SingularOperator
from suboctave.continuation import CurvePoint, NewtonOptions
from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState

#: sub-harmonic share of the motion from which on the end of the curve is looked for, and which is none any more
_FAINT, _NOTHING_LEFT = 3e-3, 1e-5
#: speed in the plane of the parameters below which they may stand, and distance there at which the end is reached
#: whatever the share: what more of the way a motion of little damping shows is less than residuals tell
_STANDING, _REACHED = 1e-4, 2e-7
#: steps like the last within which it vanishes and its end is looked for; how far that may lie from where two points
#: lead, as a share of the way
_AHEAD, _LEADS = 3.0, 0.3
#: way along the parent's curve, in scaled arclength, within which that end lies
_BESIDE = 0.05
#: parts of that way on which it is looked for one after the other: the parent's curve may turn sharply there
_NEARER = (1.0, 1e-2, 1e-4)
#: the same along a curve of LP or PD for the end of an NS curve
_AROUND = 0.2
#: kappa in units of the base frequency, from 0 or 1/2, at which an NS curve has reached its end
_RESONANT = 2e-3
#: the same, within which the pair is looked at
_DOUBTFUL = 0.05
#: share of a perturbation with waves of the other parity that is none
_NO_PARITY = 1e-6
#: residual of the odd harmonics alone, in units of the forces and of the even ones' share, of a symmetric system; share
#: of a parameter's range after which it is asked again whether they stay by themselves
_UNSYMMETRIC, _ASIDE = 0.1, 0.02
#: unfolding, in units of the forces that balance, above which there is no branch point
_UNFOLDING = 1e-8


@dataclass(frozen=True)
class End:
    """Why a curve ends, the event there where it was located, and whether the motion there is the curve's last."""

    reason: str
    event: Found | None = None
    last: bool = False

    def way(self, a: TrackedSample) -> float:
        """Distance in the plane of the parameters from a point to the event, in scaled arclength."""
        return 0.0 if self.event is None else _apart(self.event.sample.point, a.point)


def end_between(a: TrackedSample, b: TrackedSample, newton: NewtonOptions) -> End | None:
    """The end of a curve between two neighbours, None if it goes on."""
    augmentation = b.curve.augmentation.own
    if isinstance(augmentation, BranchPointUnfolded):
        beta = float(b.evaluation.extra[0])
        if abs(beta) > _UNFOLDING:
            return End(
                f"the branch points end after {a.curve.where(a.point.u)}: their unfolding is {beta:.1e} at "
                f"{b.curve.where(b.point.u)}, the symmetry that forces them is broken there"
            )
    if isinstance(augmentation, SingularOperator) and augmentation.kind is Kind.FREE:
        before, share = a.kappa / a.state.rate, b.kappa / b.state.rate
        double = abs(share - 0.5) < 0.25
        if double and _symmetric(b):
            return None
        # a step may lead across
        target = 0.5 if double else float(round(share))
        distance = (share - target) * math.copysign(1.0, before - target)
        if distance < _RESONANT or (distance < _DOUBTFUL and _split(b)):
            return _resonance(a, double, newton)
    if b.curve.balance.basis.nu == 1:
        return _symmetry_gained(a, b)
    share = subharmonic_share(b.point)
    if share <= _FAINT:
        parent = _on_the_parent(a, newton)
        if parent is not None:
            return _in_the_parent(parent)
    elif _standing(a, b):
        parent = _on_the_parent(a, newton)
        if parent is not None:
            return _in_the_parent(parent) if _apart(parent.sample.point, b.point) <= 10.0 * _REACHED else None
        return End(
            f"the curve ends on the period doublings of the parent motion beside {b.curve.where(b.point.u)}: the "
            "parameters stand still there while the doubled part goes on to vanish, and the GPD was not located"
        )
    if share <= _NOTHING_LEFT:
        return End(
            f"the sub-harmonic part of the motion vanishes at {b.curve.where(b.point.u)}: what follows are period "
            "doublings of the parent motion, which solve the same equations"
        )
    return None


def end_ahead(a: TrackedSample, b: TrackedSample, newton: NewtonOptions) -> End | None:
    """The GPD in which limit points of doubled motions end within a step or two behind the second of two neighbours.

    Towards it the parameters run like the square of the doubled part y, which vanishes evenly: p = p_end + c y^2. Where
    y is small the equations tell limit points from period doublings of the parent by little, and of little damping by
    nothing; so the end is looked for while they still do, and taken if it lies where the last two points lead.
    """
    lead = _lead(a, b)
    if lead is None or subharmonic_share(b.point) <= _NOTHING_LEFT:
        return None
    before, size = (_doubled(sample.point) for sample in (a, b))
    if size > _AHEAD * (before - size):
        return None
    parent = _on_the_parent(b, newton)
    if parent is None:
        return None
    units = b.point.weights[-2:]
    miss = float(np.linalg.norm(units * (parent.sample.point.u[-2:] - b.point.u[-2:] - lead)))
    return _in_the_parent(parent) if miss <= _LEADS * float(np.linalg.norm(units * lead)) + _REACHED else None


def _lead(a: TrackedSample, b: TrackedSample) -> Array | None:
    """What the parameters still change by until the doubled part of limit points vanishes, if two neighbours lead
    there; None if they do not, or are others.
    """
    if b.curve.balance.basis.nu % 2 or b.curve.augmentation.name != "LP" or b.curve.augmentation.turning:
        return None
    before, size = (_doubled(sample.point) for sample in (a, b))
    if not 0.0 < size < before:
        return None
    result: Array = (b.point.u[-2:] - a.point.u[-2:]) * size**2 / (before**2 - size**2)
    return result


def _doubled(point: CurvePoint) -> float:
    """Size of the doubled part of a motion."""
    curve = point.curve
    assert isinstance(curve, TrackedCurve)
    return float(np.linalg.norm(_parts(curve, point.u)[0]))


def _in_the_parent(parent: Found) -> End:
    where = parent.sample.curve.where(parent.sample.point.u)
    reason = f"the curve ends on the period doublings of the parent motion, in a GPD at {where}"
    return End(reason, parent, last=True)


def _symmetry_gained(a: TrackedSample, b: TrackedSample) -> End | None:
    """The end of a curve of limit points whose motions become symmetric, x(t + T / 2) = -x(t)."""
    if b.curve.augmentation.name != "LP" or b.curve.augmentation.turning:
        return None
    before, share = (_unsymmetric_share(sample.state) for sample in (a, b))
    if share > _FAINT or share >= before or before <= _NO_PARITY:
        return None
    state, x = a.state, a.state.x.copy()
    x[0], x[3::4], x[4::4] = 0.0, 0.0, 0.0
    symmetric = state.balance.at(x, state.omega, state.values)
    # what is missing without the even harmonics is of their order where the system has no such symmetry, else of its
    # square
    if symmetric.residual_size() > _UNSYMMETRIC * before * symmetric.force_scale():
        return None
    # a system may be symmetric at one value of a parameter that the curve passes
    for name, width in zip(a.curve.names, a.curve.spans, strict=True):
        if name != "omega":
            values = {**state.values, name: state.values[name] + _ASIDE * width}
            aside = state.balance.at(x, state.omega, values)
            if np.abs(_even(aside.residual.reshape(x.shape))).max() > _NO_PARITY * aside.force_scale():
                return None
    return End(
        f"the motions become symmetric at {b.curve.where(b.point.u)}, x(t + T/2) = -x(t): what follows are branch "
        "points of symmetric motions, which solve the same equations"
    )


def _unsymmetric_share(state: BalanceState) -> float:
    """Share of mean and even harmonics in a motion."""
    x = state.x * state.balance.scales()[0]
    return float(np.linalg.norm(_even(x))) / (float(np.linalg.norm(x)) or 1.0)


def _even(x: Array) -> Array:
    """Mean and even harmonics of coefficients (2 H + 1, n)."""
    return np.concatenate((x[:1], x[3::4], x[4::4]))


def _apart(one: CurvePoint, other: CurvePoint) -> float:
    """Distance in the plane of the parameters, in scaled arclength."""
    return float(np.linalg.norm(other.weights[-2:] * (one.u[-2:] - other.u[-2:])))


def _standing(a: TrackedSample, b: TrackedSample) -> bool:
    """Whether the doubled part of limit points goes on to vanish while the parameters have come to their end."""
    units, lead = b.point.weights[-2:], _lead(a, b)
    speed = float(np.linalg.norm(units * b.point.tangent[-2:]))
    if lead is None or speed > _STANDING or float(np.linalg.norm(units * lead)) > _REACHED:
        return False
    # the same by the tangent: two points may agree by chance, to what residuals tell
    before, size = (_doubled(sample.point) for sample in (a, b))
    return 0.5 * speed * size * (b.point.arclength - a.point.arclength) <= _REACHED * (before - size)


def _symmetric(b: TrackedSample) -> bool:
    """Whether a perturbation has frequencies kappa + k w0 for even k alone, or for odd k alone."""
    waves = b.equations.bordered.right.reshape(-1, b.curve.balance.size)
    first, last = (float(np.linalg.norm(waves[i::2])) for i in (0, 1))
    return min(first, last) < _NO_PARITY * max(first, last)


def _split(b: TrackedSample) -> bool:
    """Whether the two multipliers nearest to the critical one are real: a neutral saddle."""
    critical = b.evaluation.critical
    if critical is None:
        return False
    mu = b.evaluation.floquet.multipliers
    nearest = mu[np.argsort(np.abs(mu - critical), kind="stable")[:2]]
    return bool(np.all(nearest.imag == 0.0))


def _resonance(a: TrackedSample, double: bool, newton: NewtonOptions) -> End:
    """The 1:1 or 1:2 resonance in which an NS curve ends, located on the LP, BP or PD curve through it."""
    order = 2 if double else 1
    words = f"1:{order}"
    if a.curve.augmentation.turning:
        return End(f"the curve ends in a {words} resonance beyond {a.curve.where(a.point.u)}")
    balance, name = a.curve.balance, a.curve.names[0]
    state = balance.at(a.state.x, a.state.omega, a.state.values)
    # limit points of motions with a symmetry may be branch points, where the equations of limit points are singular
    singled_out: list[Callable[[], Augmentation]] = [
        lambda: SingularOperator.of(state, Kind.HALF if double else Kind.INTEGER)
    ]
    if not double:
        singled_out.append(lambda: BranchPointUnfolded.of(state, name))
    failures = []
    for augmentation in singled_out:
        try:
            curve = replace(a.curve, augmentation=augmentation())
            found = _zero_beside(a, curve, a.state.x, DoubleMultiplier(order), newton, _AROUND)
            break
        except ConvergenceError as failure:
            failures.append(str(failure))
    else:
        return End(f"the curve ends in a {words} resonance beyond {a.curve.where(a.point.u)} ({failures[0]})")
    where = found.sample.curve.where(found.sample.point.u)
    return End(f"the curve ends in a {words} resonance at {where}", found, last=True)


def _on_the_parent(a: TrackedSample, newton: NewtonOptions) -> Found | None:
    """The GPD beside a faint LP of doubled motions, on the PD curve of the parent; None if there is none."""
    basis = a.curve.balance.basis
    if a.curve.augmentation.name != "LP" or a.curve.augmentation.turning or basis.nu % 2:
        return None
    x = basis.even_part(a.state.x)
    try:
        balance = a.curve.balance.with_basis(basis.halved).settle(x, a.state.omega, a.state.values)
        own = SingularOperator.of(balance.at(x, a.state.omega, a.state.values), Kind.HALF)
        curve = replace(a.curve, balance=balance, augmentation=own, cache={balance.basis: balance})
        return _zero_beside(a, curve, x, GeneralisedDoubling(), newton, _BESIDE)
    except ConvergenceError:
        return None


def _zero_beside(
    a: TrackedSample, curve: TrackedCurve, x: Array, test: CurveTest, newton: NewtonOptions, reach: float
) -> Found:
    """Where a test vanishes on the curve of another bifurcation beside a point; raises ConvergenceError."""
    u = curve.join(x, np.zeros(curve.augmentation.extras), a.point.u[-2:])
    start = nearest_point(curve, u, curve.weights(u, curve.size(u)), newton)
    *wider, last = _NEARER
    for share in wider:
        with suppress(ConvergenceError):
            return Found(test, zero_along(start, test.value, newton, share * reach))
    return Found(test, zero_along(start, test.value, newton, last * reach))


def rebased(orbit: PeriodicOrbit, a: TrackedSample) -> PeriodicOrbit:
    """A motion in a curve's basis, where that is of another period: one of the parent of doubled motions."""
    balance = a.curve.balance
    if orbit.basis.nu == balance.basis.nu:
        return orbit
    return replace(orbit, balance=balance, coefficients=orbit.basis.resized(orbit.coefficients, balance.basis))


def keeps_subharmonics(a: CurvePoint, b: CurvePoint) -> bool:
    """False if the sub-harmonic part of a motion may have vanished between two neighbours."""
    curve = b.curve
    assert isinstance(curve, TrackedCurve)
    if curve.balance.basis.nu == 1 or subharmonic_share(b) <= _NOTHING_LEFT:
        return True
    before = _parts(curve, curve.transfer(a.u, a.curve))
    return all(float(p @ q) >= 0.25 * float(p @ p) for p, q in zip(before, _parts(curve, b.u), strict=True))


def subharmonic_share(point: CurvePoint) -> float:
    """Smallest share of a motion that one of its period multiplications has brought about."""
    curve = point.curve
    assert isinstance(curve, TrackedCurve)
    return min(float(np.linalg.norm(part)) for part in _parts(curve, point.u)) / (curve.size(point.u) or 1.0)


def _parts(curve: TrackedCurve, u: Array) -> list[Array]:
    """Harmonics that the motion would not have if it repeated earlier: one array for each prime factor of nu."""
    basis = curve.balance.basis
    nu = basis.nu
    x = u[: curve.balance.dimension].reshape(basis.size, -1) * curve.balance.scales()[0]
    return [x[rows].ravel() for rows in _rows_of_parts(nu, basis.harmonics)]


def repeats_earlier(orbit: PeriodicOrbit) -> bool:
    """Whether a motion repeats after a part of the period that it is written with."""
    basis, scales = orbit.basis, orbit.balance.scales()[0]
    x = orbit.coefficients.reshape(basis.size, -1) * scales
    least = min((float(np.linalg.norm(x[rows])) for rows in _rows_of_parts(basis.nu, basis.harmonics)), default=np.inf)
    return least <= _NOTHING_LEFT * float(np.linalg.norm(x))


@lru_cache(maxsize=64)
def _rows_of_parts(nu: int, harmonics: int) -> list[np.ndarray]:
    k = np.append(0, np.repeat(np.arange(1, harmonics + 1), 2))
    primes = [d for d in range(2, nu + 1) if nu % d == 0 and all(d % e for e in range(2, math.isqrt(d) + 1))]
    return [np.flatnonzero(k % prime) for prime in primes]


__all__ = ["End", "end_ahead", "end_between", "keeps_subharmonics", "rebased", "repeats_earlier", "subharmonic_share"]
