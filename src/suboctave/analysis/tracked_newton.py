"""Newton's method for a point of a curve of limit points or period doublings, in one compiled call.

What `continuation.newton.correct` does step by step, for the common case: omega and one parameter of loads or laws are
free, the structure has matrices of its own, and all laws are known in closed form. There the calls would cost more than
what they do. Where coefficients of laws are not linear in the parameter, two calls an iteration: what the laws and the
load are at an iterate's parameter is asked for in between.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suboctave.analysis.tracked_iteration import (
    ANEW,
    ERROR,
    FACTORS,
    GIVEN,
    ITERATION,
    LAST,
    MEMO,
    MOVED,
    PREVIOUS,
    RATE,
    SOLVED,
    UNSOLVED,
    WAY,
    differentiated,
    iterated,
    looked_at,
)
from suboctave.bifurcation.augmented import SingularOperator
from suboctave.bifurcation.bordered import Bordered
from suboctave.continuation.linear import Factor
from suboctave.continuation.newton import NewtonOptions, not_converged
from suboctave.harmonic.basis import Array
from suboctave.harmonic.changing_laws import ChangingLaws, LinearLaws
from suboctave.harmonic.evaluation import told_steps
from suboctave.harmonic.group_force import PackedLaws
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState

if TYPE_CHECKING:
    from suboctave.analysis.tracked_curve import TrackedCurve

#: scratch matrices of a thread, of up to as many rows
_OWN = threading.local()
_KEPT = 500
_NO_NODES, _NO_STEPS = np.empty((4, 0)), (None,) * 7


def applies(curve: TrackedCurve) -> bool:
    """Whether the common case is that of a curve, whatever its laws."""
    balance, names, own = curve.balance, curve.names, curve.augmentation
    if type(own) is not SingularOperator or own.kind is Kind.FREE or len(names) != 2 or names[0] != "omega":
        return False
    plain = balance.steady and balance.basis.kept is None and names[1] not in balance.matrix_names
    return plain and isinstance(balance.linear, StructuralMatrices)


class Corrected(NamedTuple):
    """A solved point: its motion, g with its gradient as `SingularEquations` has them, and what makes a `Solved`."""

    u: Array
    state: BalanceState
    error: float
    bordered: Bordered
    gradient: tuple[Array, dict[str, complex], complex]
    factor: Factor
    iterations: int
    distance: float
    rate: float
    tangent: Array
    sign: float


def corrected(
    curve: TrackedCurve,
    guess: Array,
    row: Array,
    weights: Array,
    options: NewtonOptions,
    spare: float,
    known: Factor | None,
) -> Corrected | None:
    """`newton.correct` of a curve to which this `applies`; None where its laws are others.

    Raises
    ------
    ConvergenceError
        If the iterations do not contract or run out.
    """
    along = curve.balance.laws_along(curve.names[1])
    if along is None:
        return None
    limits = np.array((options.tolerance, options.correction, options.iterations, spare, curve.floor))
    return _Solve(curve, (guess, row, weights), limits, known).run(along)


class _Solve:
    """One solution: what the kernels want, and their results."""

    def __init__(
        self, curve: TrackedCurve, place: tuple[Array, Array, Array], limits: Array, known: Factor | None
    ) -> None:
        guess = place[0]
        balance, own = curve.balance, curve.augmentation
        assert isinstance(own, SingularOperator)
        assert isinstance(balance.linear, StructuralMatrices)
        basis, mean, borders = balance.basis, own.kind is Kind.INTEGER, own.borders
        n, high, size, groups, m = len(guess), basis.harmonics, balance.size, len(balance.groups), len(borders.right)
        self.curve, self.borders, self.kind = curve, borders, own.kind
        self.guess, self.u, self.tangent, self.numbers = guess, guess.copy(), np.empty(n), np.empty(3)
        self.memo = np.zeros(MEMO)
        self.memo[PREVIOUS] = np.inf
        if known is None:
            self.lu, self.pivots = np.empty((n, n)), np.empty(n, dtype=np.int32)
        else:
            # those given stay those of the other point
            self.lu, self.pivots = known.lu.T.copy(), known.pivots.copy()
            self.memo[WAY], self.memo[FACTORS], self.memo[GIVEN] = np.inf, 1.0, 1.0
        self.motions = np.empty((groups, high + 1), dtype=complex)
        self.blocks = np.empty((high + 1, size, size), dtype=complex)
        self.table = np.empty((3, groups, balance.top + 1), dtype=complex)
        self.parts = np.empty((3, 2 * high + 1, size))
        operator, border_lu, self.extended = _scratch(m, n)
        self.vectors, self.sizes = np.empty((2, m + 1)), np.empty(4)
        self.gx, self.rates = np.empty((2 * high + 1, size)), np.empty(3)
        self.scale, self.nodes = balance.row_weights(m), balance.packed_laws(balance.values)[1]
        frequencies = basis.multiples if mean else basis.half_multiples
        # the arguments of the kernels, in their order
        self.same = self.u, *place
        self.factors = self.memo, self.lu, self.pivots, self.tangent
        self.limits, self.lines = limits, (borders.left, borders.right)
        self.units = own.unit, curve.force, mean, frequencies, basis.nu, balance.moving
        self.matrices = basis.multiples, balance.linear.matrices
        self.filled = (
            *(self.blocks, self.table, self.motions, self.parts, self.sizes),
            *(operator, border_lu, np.empty(m + 1, dtype=np.int32), self.vectors, self.numbers),
        )

    def run(self, along: ChangingLaws) -> Corrected | None:
        """The solution, None where laws are not what the kernels know."""
        balance, name = self.curve.balance, self.curve.names[1]
        rate = balance.load_rate(name)
        linear = along.linear if rate is not None or name not in balance.load_names else None
        found = self._asking(along, rate) if linear is None else self._at_once(along, linear, rate)
        if found is None:
            return None
        ended, packed, sampled = found
        if ended == UNSOLVED:
            raise not_converged(self.curve, self.guess, float(self.memo[ERROR]), int(self.memo[ITERATION]))
        return self._made(packed, sampled) if ended == SOLVED else None

    def _laws(self, packed: PackedLaws) -> tuple[Any, ...]:
        """Directions and laws as the kernels want them, without arctan steps."""
        balance, pieces = self.curve.balance, packed.pieces if len(packed.pieces) else None
        return *balance.directions, pieces, packed.first, packed.polynomial, balance.grid, self.nodes

    def _at_once(self, along: ChangingLaws, linear: LinearLaws, rate: Array | None) -> tuple[int, PackedLaws, Array]:
        """All iterations in compiled code."""
        balance = self.curve.balance
        packed, changes = along.room(linear)
        told = told_steps(packed) if packed.told else _NO_STEPS
        load = balance.load(balance.values, 0.0)
        load_by = np.zeros_like(load) if rate is None else rate
        changed = changes.pieces if linear.linear is not None else None
        steps = changes.steps if linear.rounded is not None else None
        alone = packed.told and _only_direction(packed)
        given: tuple[Any, ...] = (
            *(*linear, load, load_by, np.empty_like(load)),
            *(*self.same, self.limits, *self.factors, *self.lines, *self.units, self.scale, *self.matrices),
            *(*self._laws(packed), np.empty_like(load), balance.scales()[1], *told, *self.filled),
            *(alone, changed, changes.first, steps, changes.step_first, changes.line),
            *(self.gx, self.rates, self.extended),
        )
        ended, sampled = iterated(*given)
        return ended, packed, sampled

    def _asking(self, along: ChangingLaws, rate: Array | None) -> tuple[int, PackedLaws, Array] | None:
        """The elements are asked for their laws at every iterate."""
        balance, name = self.curve.balance, self.curve.names[1]
        loaded = name in balance.load_names
        while True:
            values, omega = self._values(), float(self.u[-2])
            there = along.at(values)
            packed = there.packed
            told, laws = told_steps(packed) if packed.told else _NO_STEPS, self._laws(packed)
            if rate is None or not loaded:
                load = balance.load(values if loaded else balance.values, omega)
            else:
                load = balance.load(balance.values, 0.0) + (values[name] - balance.values[name]) * rate
            given: tuple[Any, ...] = (
                *(*self.same, self.limits, *self.factors, *self.lines, *self.units, self.scale, *self.matrices),
                *(*laws, load, balance.scales()[1], *told, *self.filled),
            )
            ended, sampled = looked_at(*given)
            if ended in (ANEW, LAST):
                changes = along.changes(values, there)
                if changes is None:
                    return None
                if rate is None:
                    by_load = -balance.loads.value({**values, "omega": float(self.u[-2])}, balance.size, (name,))
                else:
                    by_load = -rate
                pieces = changes.pieces if len(changes.pieces) else None
                steps = changes.steps if len(changes.steps) else None
                moved = (pieces, changes.first, steps, changes.step_first, changes.line)
                noted = sampled if packed.told and _only_direction(packed) else _NO_NODES
                given = (
                    *(ended == LAST, *self.same, *self.factors, *self.units, *self.matrices, *laws, *told),
                    *(noted, *moved, by_load, self.motions, self.table, self.parts, self.vectors),
                    *(self.gx, self.rates, self.numbers, self.extended),
                )
                ended = differentiated(*given)
            if ended != MOVED:
                return ended, packed, sampled

    def _values(self) -> dict[str, float]:
        return {**self.curve.balance.values, self.curve.names[1]: float(self.u[-1])}

    def _made(self, packed: PackedLaws, sampled: Array) -> Corrected:
        """The solved point."""
        curve, u, name = self.curve, self.u, self.curve.names[1]
        balance, x, omega = curve.balance, u[:-2].reshape(self.parts.shape[1:]), float(u[-2])
        state = BalanceState(balance, balance.linear, x, omega, self._values())
        known = state.__dict__
        known["_evaluated"], known["motions"] = (self.table, self.parts, self.sizes), self.motions
        known["blocks"], known["nodal"], known["packed"] = self.blocks, [], (packed, self.nodes)
        if packed.told:
            known["_told_nodes"] = int(packed.step_owner[-1]), sampled
        m, (way, sign, by_kappa) = len(self.scale), self.numbers.tolist()
        g = complex(float(self.vectors[0, m]) * omega**2)
        right, left = self.vectors[0, :m], self.vectors[1, :m]
        by_omega, by_name, _ = (-self.rates).tolist()
        return Corrected(
            u,
            state,
            float(self.memo[ERROR]),
            Bordered(state, self.kind, 0.0, g, right, left, self.scale, self.borders, None),
            (-self.gx.ravel(), {"omega": complex(by_omega), name: complex(by_name)}, -1j * by_kappa),
            Factor(self.lu.T, self.pivots, False),
            int(self.memo[ITERATION]),
            way,
            float(self.memo[RATE]),
            self.tangent,
            sign,
        )


def _scratch(m: int, n: int) -> tuple[Array, Array, Array]:
    """Matrices that no point keeps: an operator (M, M), its factors with borders, `[R_X R_omega]`.

    Memory of some 100 KB would come from the system anew each time.
    """
    known: tuple[tuple[int, int], tuple[Array, Array, Array]] | None = _OWN.__dict__.get("matrices")
    if known is not None and known[0] == (m, n):
        return known[1]
    found = np.empty((m, m)), np.empty((m + 1, m + 1)), np.empty((n - 2, n - 1))
    if n <= _KEPT:
        _OWN.matrices = (m, n), found
    return found


def _only_direction(packed: PackedLaws) -> bool:
    """Whether all arctan steps act along one direction."""
    last = int(packed.step_owner[-1])
    return len(packed.steps) == packed.step_first[last + 1] - packed.step_first[last]


__all__ = ["applies", "corrected"]
