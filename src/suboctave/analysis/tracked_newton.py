"""Newton's method for a point of a curve of limit points or period doublings, two compiled calls an iteration.

What `continuation.newton.correct` does step by step, for the common case: omega and one parameter of loads or laws are
free, the structure has matrices of its own, and all laws are known in closed form. There the calls would cost more than
what they do. Only what the laws and the load are at an iterate's parameter is asked for in between.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suboctave.analysis.tracked_iteration import (
    ANEW,
    ERROR,
    FACTORS,
    GIVEN,
    ITERATION,
    LAST,
    MOVED,
    PREVIOUS,
    RATE,
    SOLVED,
    UNSOLVED,
    WAY,
    differentiated,
    looked_at,
)
from suboctave.bifurcation.augmented import SingularOperator
from suboctave.bifurcation.bordered import Bordered
from suboctave.continuation.linear import Factor
from suboctave.continuation.newton import NewtonOptions, not_converged
from suboctave.harmonic.basis import Array
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
_NO_NODES = np.empty((4, 0))


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
    balance, own, name = curve.balance, curve.augmentation, curve.names[1]
    assert isinstance(own, SingularOperator)
    assert isinstance(balance.linear, StructuralMatrices)
    basis, mean, borders = balance.basis, own.kind is Kind.INTEGER, own.borders
    n, high, size, groups, m = len(guess), basis.harmonics, balance.size, len(balance.groups), len(borders.right)
    frequencies, scale = (basis.multiples if mean else basis.half_multiples), balance.row_weights(m)
    u, tangent, numbers = guess.copy(), np.empty(n), np.empty(3)
    memo = np.zeros(9)
    memo[PREVIOUS] = np.inf
    if known is None:
        lu, pivots = np.empty((n, n)), np.empty(n, dtype=np.int32)
    else:
        lu, pivots = known.lu.T, known.pivots
        memo[WAY], memo[FACTORS], memo[GIVEN] = np.inf, 1.0, 1.0
    blocks, motions = np.empty((high + 1, size, size), dtype=complex), np.empty((groups, high + 1), dtype=complex)
    table, parts = np.empty((3, groups, balance.top + 1), dtype=complex), np.empty((3, 2 * high + 1, size))
    operator, border_lu, extended = _scratch(m, n)
    vectors, border_pivots = np.empty((2, m + 1)), np.empty(m + 1, dtype=np.int32)
    sizes, gx, rates = np.empty(4), np.empty((2 * high + 1, size)), np.empty(3)
    limits = np.array((options.tolerance, options.correction, options.iterations, spare, curve.floor))
    same, weight = (guess, row, weights), balance.scales()[1]
    of = (own.unit, curve.force, mean, frequencies, basis.nu, balance.moving)
    linear = (basis.multiples, balance.linear.matrices)
    along, nodes = balance.laws_along(name), balance.packed_laws(balance.values)[1]
    if along is None:
        return None
    loaded, rate = name in balance.load_names, balance.load_rate(name)
    while True:
        values = {**balance.values, name: float(u[-1])}
        laws_there = along.at(values)
        packed = laws_there.packed
        told = told_steps(packed) if packed.told else (None,) * 7
        pieces = packed.pieces if len(packed.pieces) else None
        laws = (*balance.directions, pieces, packed.first, packed.polynomial, balance.grid, nodes)
        if rate is None or not loaded:
            load = balance.load(values if loaded else balance.values, float(u[-2]))
        else:
            load = balance.load(balance.values, 0.0) + (values[name] - balance.values[name]) * rate
        filled = (blocks, table, motions, parts, sizes, operator, border_lu, border_pivots, vectors, numbers)
        factors = (memo, lu, pivots, tangent)
        found = (borders.left, borders.right, *of, scale, *linear, *laws, load, weight, *told, *filled)
        ended, sampled = looked_at(u, *same, limits, *factors, *found)
        if ended in (ANEW, LAST):
            change = along.changes(values, laws_there)
            if change is None:
                return None
            if memo[GIVEN] and memo[FACTORS]:
                # the factors given are those of another point
                lu, pivots = np.empty((n, n)), np.empty(n, dtype=np.int32)
                factors = (memo, lu, pivots, tangent)
            if rate is None:
                by_load = -balance.loads.value({**values, "omega": float(u[-2])}, size, (name,))
            else:
                by_load = -rate
            changed = change.pieces if len(change.pieces) else None
            moved_steps = change.steps if len(change.steps) else None
            changes = (changed, change.first, moved_steps, change.step_first, change.line)
            only = packed.told and _only_direction(packed)
            rest = (sampled if only else _NO_NODES, *changes, by_load, motions, table, parts, vectors)
            given = (*factors, *of, *linear, *laws, *told, *rest, gx, rates, numbers, extended)
            ended = differentiated(ended == LAST, u, *same, *given)
        if ended == MOVED:
            continue
        if ended == SOLVED:
            break
        if ended == UNSOLVED:
            raise not_converged(curve, guess, float(memo[ERROR]), int(memo[ITERATION]))
        return None
    x, omega = u[:-2].reshape(parts.shape[1:]), float(u[-2])
    state = BalanceState(balance, balance.linear, x, omega, values)
    state.__dict__.update(
        _evaluated=(table, parts, sizes), motions=motions, blocks=blocks, nodal=[], packed=(packed, nodes)
    )
    if packed.told:
        state.__dict__["_told_nodes"] = int(packed.step_owner[-1]), sampled
    way, sign, by_kappa = numbers.tolist()
    g = complex(float(vectors[0, m]) * omega**2)
    right, left = vectors[0, :m], vectors[1, :m]
    by_omega, by_name, _ = (-rates).tolist()
    return Corrected(
        u,
        state,
        float(memo[ERROR]),
        Bordered(state, own.kind, 0.0, g, right, left, scale, borders, None),
        (-gx.ravel(), {"omega": complex(by_omega), name: complex(by_name)}, -1j * by_kappa),
        Factor(lu.T, pivots, False),
        int(memo[ITERATION]),
        way,
        float(memo[RATE]),
        tangent,
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
