"""Where a branch of sub-harmonic motions leaves or meets the branch that it bifurcates from.

In a basis of an even number nu of load periods, a motion of half that period has harmonics of even order only. A branch
meets such a parent at a period doubling of the parent: its odd part shrinks to nothing and, were it followed further,
would grow again with the opposite sign, the same motions shifted by the parent's period. There the branch ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suboctave.analysis.response import ResponseCurve
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.branching import doubled_direction
from suboctave.bifurcation.finder import position
from suboctave.bifurcation.solve import Guess, Singular, locate_singular
from suboctave.continuation.linear import length
from suboctave.continuation.march import Arrival, CurvePoint, between, make_point
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.perturbation import Kind

__all__ = ["Junction", "Meeting", "beside", "meeting"]

#: distance from a bifurcation, in scaled arclength, at which a branch that leaves or meets it begins or ends
BESIDE = 3e-3


@dataclass(frozen=True)
class Junction:
    """The bifurcation at which a branch leaves or meets another: its kind, place, amplitude and period.

    kind
        "PD" or "BP", of the other branch.
    parameter, omega, amplitude
        The free parameter's value, the frequency, the amplitude of the observed DOF.
    nu
        Period of the other branch's motions in periods of the load.
    """

    kind: str
    parameter: float
    omega: float
    amplitude: float
    nu: int

    @classmethod
    def of(cls, item: Bifurcation) -> Junction:
        """The place of a located bifurcation."""
        value = item.parameter(item.parameter_name)
        return cls(item.kind, value, item.omega, item.amplitude, item.orbit.basis.nu)

    def same_place(self, item: Bifurcation, span: float) -> bool:
        """Whether a located bifurcation is this one, located anew; `span` is the range of the free parameter."""
        there = Junction.of(item)
        near = abs(self.parameter - there.parameter) <= 1e-5 * span and there.kind == self.kind
        return near and abs(self.amplitude - there.amplitude) <= 1e-3 * max(self.amplitude, there.amplitude)

    def __str__(self) -> str:
        return f"the {self.kind} of the {period_name(self.nu)} motion at omega = {self.omega:.9g}"


def period_name(nu: int) -> str:
    """T, 2T, 4T, ..."""
    return "T" if nu == 1 else f"{nu}T"


@dataclass(frozen=True)
class Meeting:
    """A branch that meets its parent: the parent's period doubling, its curve, and how the march ends."""

    solution: Singular
    parent: ResponseCurve
    arrival: Arrival


def meeting(a: CurvePoint, b: CurvePoint, newton: NewtonOptions) -> Meeting | None:
    """The parent's period doubling that a curve passes between two neighbours, None if it passes none."""
    curve = b.curve
    assert isinstance(curve, ResponseCurve)
    basis = curve.balance.basis
    if basis.nu % 2 or not _turned(a, b, curve):
        return None
    parent = _parent(curve)
    odd_a, odd_b = _odd(curve.transfer(a.u, a.curve), curve, b.weights), _odd(b.u, curve, b.weights)
    share = length(odd_a) / (length(odd_a) + length(odd_b))
    u = between(a, b, share)
    x, omega, values = curve.split(u)
    half = x[_even_rows(parent.balance.basis)]
    try:
        balance = parent.balance.settle(half, omega, values)
        found = locate_singular(Guess(balance, half, omega, values, curve.name, curve.span), Kind.HALF)
    except ConvergenceError:
        return None
    state = found.state
    value = state.omega if curve.name == "omega" else state.values[curve.name]
    there = curve.join(parent.balance.basis.resized(state.x, basis), value)
    place = position(a, b, there)
    if place is None or not -1e-6 <= place <= 1.0 + 1e-6 or found.vectors is None:
        return None
    reason = f"met the {period_name(basis.nu // 2)} motion at its period doubling at {curve.where(there)}"
    last = _last_before(a, b, there, found, parent, newton)
    return Meeting(found, parent.with_balance(state.balance), Arrival(last, reason))


def _turned(a: CurvePoint, b: CurvePoint, curve: ResponseCurve) -> bool:
    odd_a, odd_b = _odd(curve.transfer(a.u, a.curve), curve, b.weights), _odd(b.u, curve, b.weights)
    return bool(odd_a @ odd_b < 0.0)


def _odd(u: Array, curve: ResponseCurve, weights: Array) -> Array:
    """The weighted coefficients of odd order."""
    shaped = (weights * u)[:-1].reshape(curve.balance.basis.size, -1)
    return np.concatenate((shaped[1::4].ravel(), shaped[2::4].ravel()))


def _parent(curve: ResponseCurve) -> ResponseCurve:
    """The curve of motions of half the period with the same frequencies."""
    basis = curve.balance.basis
    return curve.with_basis(HarmonicBasis(max(1, basis.harmonics // 2), basis.nu // 2))


def _even_rows(parent: HarmonicBasis) -> Array:
    """Rows of a basis of twice the period that hold the parent's harmonics, in their order."""
    k = np.arange(1, parent.harmonics + 1)
    rows = np.zeros(parent.size, dtype=int)
    rows[1::2], rows[2::2] = 4 * k - 1, 4 * k
    return rows


def _last_before(
    a: CurvePoint, b: CurvePoint, there: Array, found: Singular, parent: ResponseCurve, newton: NewtonOptions
) -> CurvePoint | None:
    """The curve's point right before it meets its parent, None if a neighbour is that."""
    curve = b.curve
    assert isinstance(curve, ResponseCurve)
    before = curve.transfer(a.u, a.curve)
    way = length(b.weights * (there - before))
    if way <= 2.0 * BESIDE:
        return None
    direction = emanating(found, curve, b.weights)
    if (b.weights * direction) @ (b.weights * (before - there)) < 0.0:
        direction = -direction
    point = beside(curve, there, direction, b.weights, BESIDE, newton)
    if point is None:
        return None
    arclength = a.arclength + length(b.weights * (point.u - before))
    if (b.weights * point.tangent) @ (b.weights * (there - point.u)) < 0.0:
        return CurvePoint(
            curve,
            point.u,
            -point.tangent,
            point.weights,
            point.evaluation,
            -point.orientation,
            arclength,
            point.iterations,
        )
    return CurvePoint(
        curve, point.u, point.tangent, point.weights, point.evaluation, point.orientation, arclength, point.iterations
    )


def emanating(found: Singular, curve: ResponseCurve, weights: Array) -> Array:
    """The direction in which a curve of twice the period leaves a period doubling, unit length in its weights."""
    assert found.vectors is not None
    state, size = found.state, curve.balance.size
    scale = np.tile(state.balance.scales()[1], len(found.vectors.right) // size)
    phi = doubled_direction(found.vectors.right * scale, state.basis, size, curve.balance.basis)
    direction = curve.join(phi, 0.0)
    return direction / length(weights * direction)


def beside(
    curve: ResponseCurve, u: Array, direction: Array, weights: Array, distance: float, newton: NewtonOptions
) -> CurvePoint | None:
    """The curve's point at a distance from a bifurcation in a direction, with its tangent pointing away from it.

    The closer, the less regular the equations: larger distances are tried where the first one does not converge.
    """
    row = weights * direction
    row = row / length(row)
    for factor in (1.0, 0.3, 3.0, 0.1, 10.0):
        try:
            solved = correct(curve, u + factor * distance * direction, row, weights, newton)
        except ConvergenceError:
            continue
        if 0.5 <= length(weights * (solved.u - u)) / (factor * distance) <= 2.0:
            return make_point(solved, curve, solved.u - u, 0.0)
    return None
