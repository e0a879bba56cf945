"""The first point of a branch.

From a given motion, or, without one: Newton's method from the linear response; where that fails (it can cycle for
ever on a contact that is closed at rest), a homotopy that switches the element forces on from 0 to 1 by continuation;
where that fails, a short time integration from rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from suboctave.analysis.response import ResponseCurve
from suboctave.continuation.march import March
from suboctave.continuation.newton import NewtonOptions, Solved, correct
from suboctave.continuation.point import CurvePoint, make_point, solve_at
from suboctave.continuation.problem import Array, Curve, Evaluation
from suboctave.continuation.stepping import SteppingOptions
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.basis import HarmonicBasis, spectrum_to_real
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.state import BalanceState, apply_blocks
from suboctave.timedomain import integrate

_SETTLING = 200


def linear_response(curve: ResponseCurve, value: float) -> Array:
    """u of the response without elements, at a value of the free parameter."""
    balance = curve.balance
    zero = np.zeros((balance.basis.size, balance.size))
    x, omega, values = curve.split(curve.join(zero, value))
    state = balance.at(x, omega, values)
    load = balance.load(values, omega)
    if state.compliance is not None:
        load = apply_blocks(state.compliance, load)
    try:
        inverse = np.linalg.inv(state.blocks).astype(complex)
    except np.linalg.LinAlgError:
        # a free body or an undamped resonance: the least motion that balances what can be balanced
        inverse = np.linalg.pinv(state.blocks).astype(complex)
    return curve.join(apply_blocks(inverse, load), value)


def start_point(
    curve: ResponseCurve, value: float, given: Any, newton: NewtonOptions, largest: float = 0.0
) -> CurvePoint:
    """A solved point of the curve at a value of the free parameter, in a basis that suits it.

    Parameters
    ----------
    given
        None, a `PeriodicOrbit`, coefficients (2 H + 1, n), or a state `(x, dx/dt)` of shape (2 n,) from which time
        integration leads to the motion.

    Raises
    ------
    ConvergenceError
        If no motion is found; says what was tried.
    """
    tried = []
    linear = linear_response(curve, value)
    curve.reference = max(curve.reference, curve.size(linear))
    if given is not None:
        if isinstance(given, PeriodicOrbit) and curve.adaptive is not None and given.basis.nu == curve.balance.basis.nu:
            curve = curve.with_basis(given.basis)
        guess = _from_given(curve, value, given)
        try:
            return _settled(curve, guess, newton, largest)
        except ConvergenceError as failure:
            if isinstance(given, PeriodicOrbit):
                # at a limit point the equations are singular at a fixed parameter: the nearest point of the curve
                with suppress(ConvergenceError):
                    return _settled(curve, guess, newton, largest, _solve_nearest)
            raise ConvergenceError(f"no motion found from the given start at {curve.where(guess)}: {failure}") from None
    patient = replace(newton, iterations=max(newton.iterations, 40), damped=True)
    ways: list[tuple[str, Callable[[ResponseCurve, float], Array], ResponseCurve]] = []
    for finer in _with_more_harmonics(curve):
        ways.append(("linear response", linear_response, finer))
        if curve.balance.system.elements:
            ways.append(("homotopy in the element forces", partial(_homotopy, newton=newton), finer))
    ways.append(("time integration from rest", partial(_integrated, state=None), finer))
    for name, guess_by, finer in ways:
        try:
            return _settled(finer, guess_by(finer, value), patient, largest)
        except ConvergenceError as failure:
            reason = str(failure)
            if reason not in tried:
                tried += [f"{name} with {finer.balance.basis.harmonics} harmonics", reason]
    raise ConvergenceError(
        f"no motion found to start from at {curve.where(linear)}. Tried: " + "; ".join(tried) + ". "
        "Start elsewhere in the range, or give start= (an orbit, or a state near the motion)"
    )


def _with_more_harmonics(curve: ResponseCurve) -> Iterator[ResponseCurve]:
    """The curve, and where the number of harmonics is free, with more of them: too few may have no motion at all."""
    yield curve
    if curve.adaptive is None:
        return
    nu = curve.balance.basis.nu
    for harmonics in (15, 31, 63):
        if curve.balance.basis.harmonics < harmonics * nu and harmonics <= curve.adaptive.maximum:
            yield curve.with_basis(HarmonicBasis(harmonics * nu, nu))


def _settled(
    curve: ResponseCurve, u: Array, newton: NewtonOptions, largest: float, solve: Callable[..., Solved] = solve_at
) -> CurvePoint:
    """Solve at the guess's parameter value (unless told otherwise), again with more harmonics while the motion asks."""
    for _ in range(12):
        x, omega, values = curve.split(u)
        settled = curve.balance.settle(x, omega, values)
        if settled is not curve.balance:
            curve = curve.with_balance(settled)
        solved = solve(curve, u, largest, newton)
        adapted = curve.adapted(solved.u, solved.evaluation)
        if adapted is curve:
            break
        u = adapted.transfer(solved.u, curve)
        assert isinstance(adapted, ResponseCurve)
        curve = adapted
    return make_point(solved, curve, None, 0.0)


def _solve_nearest(curve: ResponseCurve, guess: Array, largest: float, newton: NewtonOptions) -> Solved:
    """The point of the curve nearest to a guess close to it, whatever its parameter value."""
    weights = curve.weights(guess, largest)
    row = np.linalg.svd(curve.evaluate(guess).jacobian / weights)[2][-1]
    return correct(curve, guess, row, weights, newton)


def _from_given(curve: ResponseCurve, value: float, given: Any) -> Array:
    balance = curve.balance
    basis, size = balance.basis, balance.size
    if isinstance(given, PeriodicOrbit):
        if given.coefficients.shape[1] != size:
            raise InputError(f"start has {given.coefficients.shape[1]} DOFs, the system has {size}")
        return curve.join(given.basis.resized(given.coefficients, basis), value)
    try:
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            "start must be a PeriodicOrbit, a point of a branch, a Bifurcation, a state (x, dx/dt) or coefficients, "
            f"not {type(given).__name__}{' (one of its .orbits?)' if hasattr(given, 'orbits') else ''}"
        ) from None
    if not np.isfinite(array).all():
        raise InputError("start contains numbers that are not finite")
    if array.ndim == 1 and array.size == 2 * size:
        return _integrated(curve, value, array)
    shape = np.shape(given)
    if array.ndim == 1 and size == 1:  # coefficients of one degree of freedom
        array = array[:, None]
    if array.ndim == 2 and array.shape[1] == size and array.shape[0] % 2 == 1 and array.shape[0] > 1:
        return curve.join(HarmonicBasis(array.shape[0] // 2, basis.nu).resized(array, basis), value)
    raise InputError(
        f"start must be a PeriodicOrbit, a state (x, dx/dt) of length {2 * size}, or coefficients of shape "
        f"(2 H + 1, {size}), H at least 1; got an array of shape {shape}"
    )


def _integrated(curve: ResponseCurve, value: float, state: Array | None) -> Array:
    """Harmonics of the motion that time integration settles on: from a state for one period, from rest until it
    repeats.
    """
    balance = curve.balance
    if balance.size != balance.system.n:
        raise ConvergenceError("time integration needs the full system, not a condensed one")
    _, omega, values = curve.split(curve.join(np.zeros((balance.basis.size, balance.size)), value))
    period = 2.0 * math.pi * balance.basis.nu / omega
    current = np.zeros(2 * balance.system.n) if state is None else state
    rounds = _SETTLING if state is None else 1
    samples = 8 * balance.basis.harmonics + 8
    times = np.arange(samples + 1) * period / samples
    for _ in range(rounds):
        trajectory = integrate(balance.system, current, times, omega, values, rtol=1e-6)
        new = np.concatenate((trajectory.x[-1], trajectory.v[-1]))
        change = np.abs(new - current).max()
        current = new
        if change <= 1e-5 * max(np.abs(current).max(), 1e-300):
            break
    spectrum = np.fft.rfft(trajectory.x[:-1], axis=0) / samples
    return curve.join(spectrum_to_real(spectrum, balance.basis.harmonics), value)


@dataclass(frozen=True, eq=False)
class _HomotopyEvaluation:
    state: BalanceState
    share: float

    @cached_property
    def residual(self) -> Array:
        """`A X + B (share F - P)`."""
        return self.state.residual - (1.0 - self.share) * self._force

    @cached_property
    def _force(self) -> Array:
        force = self.state.force
        if self.state.compliance is not None:
            force = apply_blocks(self.state.compliance, force)
        return self.state.balance.packed(force)

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives by X and by the share of the element forces."""
        full, linear = self.state.jacobian, self.state.linear_jacobian
        return np.column_stack((linear + self.share * (full - linear), self._force))

    @cached_property
    def error(self) -> float:
        """Residual in units of the forces that balance."""
        state = self.state
        weight = state.balance.scales()[1]
        size = float(np.linalg.norm(self.residual.reshape(-1, state.balance.size) * weight))
        return size / max(state.force_scale(), np.finfo(float).tiny)


class _Homotopy:
    """Motions with a share of the element forces, from none (linear) to all."""

    def __init__(self, curve: ResponseCurve, value: float) -> None:
        self.curve = curve
        self.value = value

    @property
    def parameter(self) -> int:
        return self.curve.parameter

    def evaluate(self, u: Array) -> Evaluation:
        x, omega, values = self.curve.split(self.curve.join(u[:-1], self.value))
        return _HomotopyEvaluation(self.curve.balance.at(x, omega, values), float(u[-1]))

    def size(self, u: Array) -> float:
        return self.curve.size(u)

    def weights(self, u: Array, largest: float) -> Array:
        weights = self.curve.weights(u, largest)
        weights[-1] = 1.0
        return weights

    def adapted(self, u: Array, evaluation: Evaluation) -> Curve:
        return self

    def transfer(self, u: Array, origin: Curve) -> Array:
        return u

    def images(self, u: Array) -> list[Array]:
        return [u]

    def unwrapped(self, u: Array, near: Array) -> Array:
        return u

    def where(self, u: Array) -> str:
        return f"{u[-1]:.1%} of the element forces at {self.curve.name} = {self.value:.6g}"


def _homotopy(curve: ResponseCurve, value: float, newton: NewtonOptions) -> Array:
    """u with all element forces, followed from the linear response."""
    linear = linear_response(curve, value)
    problem = _Homotopy(curve, value)
    first = linear.copy()
    first[-1] = 0.0
    point = make_point(solve_at(problem, first, curve.size(linear), newton), problem, None, 0.0)
    stepping = SteppingOptions(max_step=0.2, initial_step=0.02, max_points=2000)
    march = March(point, 1.0, (0.0, 1.0), newton, stepping)
    *_, last = march
    if abs(last.parameter - 1.0) > 1e-12:
        raise ConvergenceError(march.ended)
    return curve.join(last.u[:-1], value)
