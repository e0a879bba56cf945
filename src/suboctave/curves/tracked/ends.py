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
- Motions of a free phase: the oscillation vanishes, in a Hopf point; or all its odd harmonics do, on a curve of motions
  of half the period, as where a mode meets another one of 2, 4, 6 times its frequency. Behind it the same motions
  follow, half a period later. (Of 3 or 5 times they are others: the curve goes on.)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation import CurvePoint, NewtonOptions
from suboctave.continuation.events import Bracket
from suboctave.continuation.linear import length
from suboctave.continuation.point import point_ahead
from suboctave.continuation.problem import Array
from suboctave.curves.augmentation import Augmentation
from suboctave.curves.hopf import hopf_beside
from suboctave.curves.junction import NOTHING_LEFT, doubled_size, subharmonic_share
from suboctave.curves.kinds.branch_point import BranchPointUnfolded
from suboctave.curves.kinds.free_phase import FreePhaseOperator
from suboctave.curves.kinds.limit_cycle import LimitCycle, oscillating
from suboctave.curves.kinds.singular import SingularOperator
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.tracked.events import (
    LocatedEvent,
    crossing_in,
    nearest_point,
    same_discretisation,
    zero_along,
)
from suboctave.curves.tracked.tests import CurvesCross, CurveTest, DoubleMultiplier, GeneralisedDoubling
from suboctave.errors import ConvergenceError
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind

#: sub-harmonic share of the motion from which on the end of the curve is looked for
_FAINT = 3e-3
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
#: the same, from which that end is looked for, with steps as long as need be
_CLOSE = 0.02
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
    event: LocatedEvent | None = None
    last: bool = False
    #: the Hopf point in which limit cycles end, and how far behind the last point
    hopf: TrackedEvent | None = None
    behind: float = 0.0

    def way(self, a: Sample) -> float:
        """Distance in the plane of the parameters from a point to the event, in scaled arclength."""
        return self.behind if self.event is None else _apart(self.event.sample.point, a.point)


def end_between(a: Sample, b: Sample, newton: NewtonOptions, lopsided: bool = True) -> End | None:
    """The end of a curve between two neighbours, None if it goes on; lopsided: whether its motions had no half-wave
    symmetry where it began.
    """
    augmentation, beta = b.curve.augmentation.own, b.curve.augmentation.unfolding(b.evaluation.extra)
    if abs(beta) > _UNFOLDING:
        return End(
            f"the branch points end after {a.where}: their unfolding is {beta:.1e} at "
            f"{b.where}, the symmetry that forces them is broken there"
        )
    if augmentation.free_phase and vanished(a, b):
        return _in_its_parent(a, b, newton)
    target = resonant_between(a, b)
    if target is not None:
        return _resonance(a, target == 0.5, newton)
    if augmentation.free_phase:
        return None
    if b.curve.balance.basis.nu == 1:
        return _symmetry_gained(a, b) if lopsided else None
    share = subharmonic_share(b.curve, b.point.u)
    standing = share > _FAINT and _standing(a, b)
    parent = _on_the_parent(a, newton) if share <= _FAINT or standing else None
    if parent is not None:
        near = not standing or _apart(parent.sample.point, b.point) <= 10.0 * _REACHED
        return _in_the_parent(parent) if near else None
    if standing:
        return End(
            f"the curve ends on the period doublings of the parent motion beside {b.where}: the "
            "parameters are constant there while the doubled part vanishes, and the GPD was not located"
        )
    if share <= NOTHING_LEFT:
        return End(
            f"the sub-harmonic part of the motion vanishes at {b.where}: what follows are period "
            "doublings of the parent motion, which solve the same equations"
        )
    return None


def vanished(a: Sample, b: Sample) -> bool:
    """Whether the oscillation of motions of a free phase, or all that is odd in it, has passed zero between two
    neighbours: behind it they are the same once more, half a period later.
    """
    return any(_turned_over(a, b))


def _turned_over(a: Sample, b: Sample) -> tuple[bool, bool]:
    """Whether an oscillation is the other way round at the second of two neighbours, and whether its odd harmonics are,
    where there are any: those of motions of half the period are none.
    """
    (whole, odd), others = (_oscillation(sample) for sample in (a, b))
    size = min(len(whole), len(others[0]))
    turned = [float(np.vdot(one[:size], other[:size])) < 0.0 for one, other in zip((whole, odd), others, strict=True)]
    return turned[0], turned[1] and length(odd) > _NO_PARITY * length(whole)


def _oscillation(sample: Sample) -> tuple[Array, Array]:
    """The coefficients of a motion but its mean, and the odd ones alone."""
    whole = oscillating(sample.state)
    odd = whole.copy()
    odd[3::4], odd[4::4] = 0.0, 0.0
    return whole, odd


def _in_its_parent(a: Sample, b: Sample, newton: NewtonOptions) -> End:
    if not _turned_over(a, b)[0]:
        if b.state.basis.nu % 2 == 0:
            return End(
                f"the doubled part of the motions vanishes between {a.where} and {b.where}: in a period doubling"
            )
        reason = (
            f"the odd harmonics vanish between {a.where} and {b.where}: the BP there lies among motions of "
            "half the period"
        )
        with suppress(ConvergenceError):
            return End(reason, _tip(a, b, newton), last=True)
        return End(reason)
    if a.curve.augmentation.turning:
        return End(f"the oscillation vanishes between {a.where} and {b.where}: in a generalised Hopf (Bautin) point")
    if a.curve.augmentation.name != LimitCycle.name:
        return End(f"the oscillation vanishes between {a.where} and {b.where}")
    try:
        hopf = hopf_beside(a, b)
        one, other = (length(oscillating(sample.state)) for sample in (a, b))
        share = one / (one + other)
    except ConvergenceError as failure:
        return End(f"the oscillation vanishes between {a.where} and {b.where} ({failure})")
    where = f"omega = {hopf.omega:.6g}, {hopf.parameter_name} = {hopf.parameter(hopf.parameter_name):.6g}"
    return End(f"the oscillation vanishes in a Hopf point at {where}", hopf=hopf, behind=share * (b.place - a.place))


def _tip(a: Sample, b: Sample, newton: NewtonOptions) -> LocatedEvent:
    """The BP at which odd harmonics vanish, found where they do: the orientation may change for others besides, and of
    a tongue of high order as good as not. Raises ConvergenceError.
    """
    start = same_discretisation(a, b, newton)
    odd = _oscillation(start)[1]

    def left(point: CurvePoint) -> float:
        return float(np.vdot(odd, _oscillation(Sample(point))[1]))

    bracket = Bracket(start.point, b.point, (left(start.point), left(b.point)), left, newton)
    return crossing_in(bracket, LocatedEvent(CurvesCross(), b, ends=(start, b)))


def resonant_between(a: Sample, b: Sample) -> float | None:
    """kappa in units of the base frequency at which an NS curve ends between two neighbours; None if it goes on, or if
    the curve is another one.
    """
    augmentation = b.curve.augmentation.own
    if not isinstance(augmentation, SingularOperator) or augmentation.kind is not Kind.FREE:
        return None
    before, share = a.kappa / a.state.rate, b.kappa / b.state.rate
    # kappa of an equilibrium knows no base frequency
    double = abs(share - 0.5) < 0.25 and not b.curve.still
    if double and _symmetric(b):
        return None
    # a step may lead across
    target = 0.5 if double else 0.0 if b.curve.still else float(round(share))
    distance = (share - target) * math.copysign(1.0, before - target)
    return target if distance < _RESONANT or (distance < _DOUBTFUL and _split(b)) else None


def comes_close(a: Sample, b: Sample) -> bool:
    """False if an NS curve ends between two neighbours and the first is not close to its end: there may be several
    resonances about, on the curves through them.
    """
    target = resonant_between(a, b)
    return target is None or abs(a.kappa / a.state.rate - target) < _CLOSE


def end_ahead(a: Sample, b: Sample, newton: NewtonOptions) -> End | None:
    """The GPD in which limit points of doubled motions end within a step or two behind the second of two neighbours.

    Towards it the parameters run like the square of the doubled part y, which vanishes evenly: p = p_end + c y^2. Where
    y is small the equations tell limit points from period doublings of the parent by little, and of little damping by
    nothing; so the end is looked for while they still do, and taken if it lies where the last two points lead.
    """
    lead, before, size = _lead(a, b)
    if lead is None or subharmonic_share(b.curve, b.point.u) <= NOTHING_LEFT or size > _AHEAD * (before - size):
        return None
    parent = _on_the_parent(b, newton)
    if parent is None:
        return None
    units = b.point.weights[-2:]
    miss = float(np.linalg.norm(units * (parent.sample.point.u[-2:] - b.point.u[-2:] - lead)))
    return _in_the_parent(parent) if miss <= _LEADS * float(np.linalg.norm(units * lead)) + _REACHED else None


def _lead(a: Sample, b: Sample) -> tuple[Array | None, float, float]:
    """What the parameters still change by until the doubled part of limit points vanishes, if two neighbours lead there
    (None if they do not, or are others), and the sizes of that part at both.
    """
    if b.curve.balance.basis.nu % 2 or not _are_limit_points(b):
        return None, 0.0, 0.0
    before, size = (doubled_size(sample.curve, sample.point.u) for sample in (a, b))
    if not 0.0 < size < before:
        return None, before, size
    return (b.point.u[-2:] - a.point.u[-2:]) * size**2 / (before**2 - size**2), before, size


def _are_limit_points(sample: Sample) -> bool:
    augmentation = sample.curve.augmentation
    return augmentation.name == "LP" and not augmentation.turning


def _in_the_parent(parent: LocatedEvent) -> End:
    reason = f"the curve ends on the period doublings of the parent motion, in a GPD at {parent.sample.where}"
    return End(reason, parent, last=True)


def _symmetry_gained(a: Sample, b: Sample) -> End | None:
    """The end of a curve of limit points whose motions become symmetric, x(t + T / 2) = -x(t)."""
    if not _are_limit_points(b):
        return None
    before, share = (_unsymmetric_share(sample.state) for sample in (a, b))
    if share > _FAINT or share >= before or before <= _NO_PARITY:
        return None
    state, x = a.state, a.state.x.copy()
    x[0], x[3::4], x[4::4] = 0.0, 0.0, 0.0
    symmetric = state.balance.at(x, state.omega, state.values)
    # what is missing without the even harmonics is of their order where the system has no such symmetry, else of its
    # square
    if symmetric.balanced.size > _UNSYMMETRIC * before * symmetric.balanced.scale:
        return None
    # a system may be symmetric at one value of a parameter that the curve passes
    for name, width in zip(a.curve.names, a.curve.spans, strict=True):
        if name != "omega":
            values = {**state.values, name: state.values[name] + _ASIDE * width}
            aside = state.balance.at(x, state.omega, values)
            if np.abs(_even(aside.residual.reshape(x.shape))).max() > _NO_PARITY * aside.balanced.scale:
                return None
    return End(
        f"the motions become symmetric at {b.where}, x(t + T/2) = -x(t): what follows are branch "
        "points of symmetric motions, which solve the same equations"
    )


def is_lopsided(sample: Sample) -> bool:
    """Whether a motion lacks the half-wave symmetry by more than rounding."""
    return _unsymmetric_share(sample.state) > _NO_PARITY


def _unsymmetric_share(state: BalanceState) -> float:
    """Share of mean and even harmonics in a motion."""
    x = state.x * state.balance.scales[0]
    return float(np.linalg.norm(_even(x))) / (float(np.linalg.norm(x)) or 1.0)


def _even(x: Array) -> Array:
    """Mean and even harmonics of coefficients (2 H + 1, n)."""
    return np.concatenate((x[:1], x[3::4], x[4::4]))


def _apart(one: CurvePoint, other: CurvePoint) -> float:
    """Distance in the plane of the parameters, in scaled arclength."""
    return float(np.linalg.norm(other.weights[-2:] * (one.u[-2:] - other.u[-2:])))


def _standing(a: Sample, b: Sample) -> bool:
    """Whether the doubled part of limit points goes on to vanish while the parameters have come to their end."""
    units, (lead, before, size) = b.point.weights[-2:], _lead(a, b)
    speed = float(np.linalg.norm(units * b.point.tangent[-2:]))
    if lead is None or speed > _STANDING or float(np.linalg.norm(units * lead)) > _REACHED:
        return False
    # the same by the tangent: two points may agree by chance, to what residuals tell
    return 0.5 * speed * size * (b.point.arclength - a.point.arclength) <= _REACHED * (before - size)


def _symmetric(b: Sample) -> bool:
    """Whether a perturbation has frequencies kappa + k w0 for even k alone, or for odd k alone."""
    waves = b.equations.bordered.right.reshape(-1, b.curve.balance.size)
    first, last = (float(np.linalg.norm(waves[i::2])) for i in (0, 1))
    return min(first, last) < _NO_PARITY * max(first, last)


def _split(b: Sample) -> bool:
    """Whether the two multipliers nearest to the critical one are real: a neutral saddle."""
    critical = b.evaluation.critical
    if critical is None:
        return False
    mu = b.evaluation.floquet.multipliers
    nearest = mu[np.argsort(np.abs(mu - critical), kind="stable")[:2]]
    return bool(np.all(nearest.imag == 0.0))


def _resonance(a: Sample, double: bool, newton: NewtonOptions) -> End:
    """The 1:1 or 1:2 resonance in which an NS curve ends, located on the LP, BP or PD curve through it."""
    order = 2 if double else 1
    ends = f"the curve ends in a 1:{order} resonance"
    own = a.curve.augmentation
    if own.turning or (own.free_phase and not double):
        return End(f"{ends} beyond {a.where}")
    balance, name = a.curve.balance, a.curve.names[0]
    state = balance.at(a.state.x, a.state.omega, a.state.values)
    # limit points of motions with a symmetry may be branch points, where the equations of limit points are singular
    singular = own.of_kind if isinstance(own, FreePhaseOperator) else SingularOperator.of
    singled_out: list[Callable[[], Augmentation]] = [
        partial(singular, state, Kind.HALF if double else Kind.INTEGER),
        partial(BranchPointUnfolded.of, state, name),
    ]
    failures = []
    for augmentation in singled_out[: 1 if double else 2]:
        try:
            curve = replace(a.curve, augmentation=augmentation())
            event = _zero_beside(a, curve, a.state.x, DoubleMultiplier(f"R{order}"), newton, _AROUND)
            break
        except ConvergenceError as failure:
            failures.append(str(failure))
    else:
        return End(f"{ends} beyond {a.where} ({failures[0]})")
    return End(f"{ends} at {event.sample.where}", event, last=True)


def _on_the_parent(a: Sample, newton: NewtonOptions) -> LocatedEvent | None:
    """The GPD beside a faint LP of doubled motions, on the PD curve of the parent; None if there is none."""
    basis = a.curve.balance.basis
    if not _are_limit_points(a) or basis.nu % 2:
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
    a: Sample, curve: MotionProblem, x: Array, test: CurveTest, newton: NewtonOptions, reach: float
) -> LocatedEvent:
    """Where a test vanishes on the curve of another bifurcation beside a point; raises ConvergenceError."""
    u = curve.join(x, a.point.u[-len(curve.names) :], np.zeros(curve.augmentation.extras))
    start = nearest_point(curve, u, curve.weights(u, curve.size(u)), newton)
    *wider, last = _NEARER
    for share in wider:
        with suppress(ConvergenceError):
            return LocatedEvent(test, zero_along(start, test.value, newton, share * reach))
    return LocatedEvent(test, zero_along(start, test.value, newton, last * reach))


def rebased(orbit: PeriodicOrbit, a: Sample) -> PeriodicOrbit:
    """A motion in a curve's basis, where that is of another period: one of the parent of doubled motions."""
    balance = a.curve.balance
    if orbit.basis.nu == balance.basis.nu:
        return orbit
    return replace(orbit, balance=balance, x=orbit.basis.resized(orbit.x, balance.basis))


#: points on the way to an end at which a parameter may turn before it, and a way for differences
_APPROACHES, _LITTLE = 6, 1e-6


def points_before(end: End, a: Sample, newton: NewtonOptions) -> list[Sample]:
    """Points between one and the end behind it, as many as a parameter asks for that is to turn there.

    The parameters p run like p_end + c z^2 + d z^4 towards it, z the size of the doubled part of limit points, or the
    distance of kappa from a resonance.
    """
    if end.event is None or a.curve.augmentation.turning or isinstance(end.event.test, CurvesCross):
        return []
    points: list[Sample] = []
    last = end.event.sample.point.u[-2:]
    for _ in range(_APPROACHES):
        point, curve = a.point, a.curve
        here = _remaining(curve, point.u)
        rate = (_remaining(curve, point.u + _LITTLE * point.tangent) - here) / _LITTLE
        slopes = point.tangent[-2:] * here
        # 2 c z^2 and 2 (c + 2 d z^2) z^2, but for the sign
        first, turned = 2.0 * (point.u[-2:] - last) * 2.0 * rate - slopes, slopes
        if not here * rate < 0.0 or not np.any(first * turned < 0.0):
            break
        way = -0.5 * here / rate
        try:
            b = Sample(point_ahead(point, way, newton))
        except ConvergenceError:
            break
        if not abs(_remaining(curve, b.point.u)) < abs(here) or resonant_between(a, b) is not None:
            break
        points.append(b)
        a = b
    return points


def _remaining(curve: MotionProblem, u: Array) -> float:
    """What vanishes at the end of limit points of doubled motions, or of an NS curve."""
    if curve.augmentation.name == "LP":
        return doubled_size(curve, u)
    extra, omega = curve.extra(u), curve.split(u)[1]
    share = float(extra[0]) * curve.balance.basis.nu / omega
    return share - 0.5 * round(2.0 * share)
