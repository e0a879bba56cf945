"""Periodic motions by single shooting, with the exact monodromy matrix.

Find the state `y` with `Phi(y) - y = 0`, `Phi` the flow over `periods` excitation periods `2 pi / omega`: damped Newton
with the state-transition matrix, which at the solution is the monodromy matrix; its eigenvalues are the Floquet
multipliers over that time. Residuals are relative to the size of the motion (`field.default_lengths`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from suboctave.errors import ConvergenceError
from suboctave.model import System
from suboctave.model.inputs import check_count, observed_dof
from suboctave.timedomain.field import Array, Field, default_lengths, scaled_field
from suboctave.timedomain.integrator import Passage, advance
from suboctave.timedomain.trajectory import flow, largest_displacement

__all__ = ["PeriodicSolution", "shoot"]

# A Newton step larger than this, in units of the size of the motion, is shortened to it.
_LONGEST_STEP = 3.0
_HALVINGS = 6


@dataclass(frozen=True, eq=False)
class PeriodicSolution:
    """A periodic motion found by shooting.

    `state` (2n,) at t = 0; `periods` excitation periods make one response period; `multipliers` (2n,) complex and
    `monodromy` (2n, 2n) over the response period, the multipliers by falling modulus; `residual` relative to the size
    of the motion; `amplitude` max |x_dof| over the response period; `kind` and `test` where a bifurcation was located.
    """

    state: Array
    omega: float
    periods: int
    multipliers: NDArray[np.complex128]
    monodromy: Array
    residual: float
    iterations: int
    amplitude: float
    dof: int
    parameters: Mapping[str, float]
    kind: str | None = None
    test: float | None = None

    @property
    def stable(self) -> bool:
        """All multipliers inside the unit circle."""
        return bool(np.all(np.abs(self.multipliers) < 1.0))

    @property
    def period(self) -> float:
        """Response period, in the user's unit of time."""
        return 2.0 * np.pi * self.periods / self.omega

    def __repr__(self) -> str:
        what = "PeriodicSolution" if self.kind is None else f"PeriodicSolution at {self.kind}"
        lead = ", ".join(f"{mu.real:.6g}" if mu.imag == 0.0 else f"{mu:.6g}" for mu in self.multipliers[:3])
        more = ", ..." if len(self.multipliers) > 3 else ""
        return (
            f"{what}(omega={self.omega:.10g}, {self.periods} period{'s' * (self.periods > 1)}, "
            f"max|x_{self.dof}|={self.amplitude:.8g}, {'stable' if self.stable else 'unstable'}, "
            f"multipliers {lead}{more}, residual {self.residual:.1e})"
        )


def shoot(
    system: System,
    state: ArrayLike,
    omega: float,
    periods: int = 1,
    values: Mapping[str, float] | None = None,
    tol: float = 1e-11,
    max_iterations: int = 30,
    observe: int | str | None = None,
    rtol: float = 1e-12,
) -> PeriodicSolution:
    """A periodic motion near `state` (2n,) at fixed `omega`.

    `periods`: response period in excitation periods. `tol`: residual, relative to the size of the motion and, for
    strongly unstable motions, to the norm of the monodromy matrix. `values` replaces parameters by name. Raises
    `InputError` before any work, `ConvergenceError` if Newton does not arrive.
    """
    periods, dof = check_count("periods", periods), observed_dof(system, observe)
    y = np.array(state, dtype=float)
    model = scaled_field(system, y, omega, values)
    end = 2.0 * np.pi * periods
    m = 2 * system.n

    def evaluate(at: Array) -> tuple[Array, Array, Passage]:
        final, transition, passage = flow(model, 0.0, at / model.scale, end, rtol)
        # the same position again, if by whole turns further
        return system.turns.modulo(final * model.scale - at) / model.scale, transition, passage

    defect, transition, passage = evaluate(y)
    history = []
    for iteration in range(max_iterations):
        # The size of the motion is known only now; after the first pass it hardly changes.
        old = model.scale
        model.rescale(default_lengths(model, passage.extent * model.scale))
        ratio = old / model.scale
        defect, transition = defect * ratio, transition * ratio[:, None] / ratio
        residual = float(np.max(np.abs(defect)))
        history.append(residual)
        if residual <= tol * max(1.0, float(np.linalg.norm(transition, 2))):
            return finish(model, y, periods, transition, residual, iteration, dof, rtol)
        step = _newton_step(transition - np.eye(m), defect)
        share = min(1.0, _LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-300))
        for halving in range(_HALVINGS + 1):
            trial = y + share * step * model.scale
            try:
                defect, transition, passage = evaluate(trial)
            except ConvergenceError:
                if halving == _HALVINGS:
                    raise
            else:
                if np.max(np.abs(defect)) < (1.0 - 0.1 * share) * residual or halving == _HALVINGS:
                    break
            share *= 0.5
        y = trial
    raise ConvergenceError(
        f"shooting at omega = {omega:.9g} over {periods} period(s) did not converge: relative residual "
        f"{history[0]:.1e} at the start, {min(history):.1e} at best, {history[-1]:.1e} after {max_iterations} steps. "
        "Start closer to the motion, or close to a limit point use locate_by_shooting, which leaves omega free"
    )


def _newton_step(matrix: Array, defect: Array) -> Array:
    """Solve `matrix step = -defect`; the least-norm solution where the matrix is singular to rounding."""
    try:
        step = np.asarray(np.linalg.solve(matrix, -defect), dtype=float)
        if np.all(np.isfinite(step)):
            return step
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.lstsq(matrix, -defect, rcond=1e-12)[0], dtype=float)


def finish(
    model: Field,
    y: Array,
    periods: int,
    transition: Array,
    residual: float,
    iterations: int,
    dof: int,
    rtol: float,
    kind: str | None = None,
    test: float | None = None,
) -> PeriodicSolution:
    """The result for a converged state `y` with scaled monodromy matrix `transition`; measures the amplitude."""
    motion = advance(model, 0.0, y / model.scale, 2.0 * np.pi * periods, rtol, rtol, dense=True)
    multipliers = np.linalg.eigvals(transition).astype(complex)
    order = np.lexsort((-multipliers.imag, -np.abs(multipliers).round(12)))
    return PeriodicSolution(
        state=y.copy(),
        omega=model.omega,
        periods=periods,
        multipliers=multipliers[order],
        monodromy=transition * model.scale[:, None] / model.scale,
        residual=residual,
        iterations=iterations,
        amplitude=largest_displacement(model, motion, dof),
        dof=dof,
        parameters=dict(model.values),
        kind=kind,
        test=test,
    )
