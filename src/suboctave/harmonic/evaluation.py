"""One evaluated motion in one compiled call: forces along all directions and the residual, or the Jacobian.

What `group_kernels` and `kernels` do piece by piece, for callers who need all of it: between compiled calls a small
system spends more time than in them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.compiled import kernel, ready
from suboctave.errors import ConvergenceError
from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.group_force import PackedLaws, add_sampled_spectra
from suboctave.harmonic.group_kernels import (
    add_pieces,
    add_polynomial,
    add_smooth_steps,
    balance_residual,
    tangent_matrix,
)
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.nodal import add_tangent
from suboctave.harmonic.quadrature import rule_tables, uniform_nodes
from suboctave.harmonic.sharp_nodes import sharp_nodes

if TYPE_CHECKING:
    from suboctave.harmonic.state import BalanceState

_NO_MATRICES = np.zeros((0, 1, 1))


@kernel()
def along_directions(x, starts, dofs, shape, motions):
    """Complex coefficients of the displacement along every direction, into `motions` (G, H + 1)."""
    for g in range(motions.shape[0]):
        for h in range(motions.shape[1]):
            re = 0.0
            im = 0.0
            for s in range(starts[g], starts[g + 1]):
                if h == 0:
                    re += shape[s] * x[0, dofs[s]]
                else:
                    re += shape[s] * x[2 * h - 1, dofs[s]]
                    im -= shape[s] * x[2 * h, dofs[s]]
            motions[g, h] = complex(re, im)


@kernel()
def evaluate(
    x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load, weight,
    table, motions, parts, sizes,
):  # fmt: skip
    """Evaluate harmonic balance at a motion; returns whether the forces are finite.

    Parameters
    ----------
    x, omega, multiples
        Coefficients (2 H + 1, n), frequency, harmonics in units of it (H + 1,).
    matrices
        Mass, damping, stiffness (3, n, n), or nothing, (0, n, n), where `blocks` is given.
    starts, dofs, shape
        Directions, as in `balance_residual`.
    pieces, first
        Stiffness, gap and side of piecewise-linear pieces (P, 3), or None without any, direction by direction: where
        each begins, (G + 1,).
    polynomial
        Coefficients of u^0, u^1, ... along every direction (G, D).
    grid, nodes
        Points on the circle (cosines and sines, (2, N)): for searches, and for polynomials.
    load, weight
        Load coefficients (2 H + 1, n), weights of residual entries per DOF.
    blocks, table, motions, parts, sizes
        Filled: dynamic stiffness (H + 1, n, n), unless given; spectra of force, stiffness, damping (3, G, top + 1),
        which may hold the spectra of other laws already; displacements (G, H + 1); the results of `balance_residual`.
    """
    if matrices.shape[0] > 0:
        n = x.shape[1]
        for h in range(multiples.shape[0]):
            om = multiples[h] * omega
            for i in range(n):
                for j in range(n):
                    blocks[h, i, j] = complex(matrices[2, i, j] - om * om * matrices[0, i, j], om * matrices[1, i, j])
    along_directions(x, starts, dofs, shape, motions)
    finite = True
    for g in range(motions.shape[0]):
        c = motions[g]
        # without pieces nobody waits for the compilation of what they need
        if pieces is not None and first[g + 1] > first[g]:
            add_pieces(c, pieces[first[g] : first[g + 1]], grid[0], grid[1], table[0, g], table[1, g])
        if polynomial.shape[1] > 0:
            add_polynomial(c, polynomial[g], nodes[0], nodes[1], table[0, g], table[1, g])
        # a number that is not finite at any instant is in all coefficients
        for r in range(3):
            finite = finite and math.isfinite(table[r, g, 0].real) and math.isfinite(table[r, g, 0].imag)
    balance_residual(x, blocks, table[0], load, starts, dofs, shape, weight, parts, sizes)
    return finite


@kernel()
def add_told(c, points, widths, steps, line, grid, rule_nodes, rule_weights, force, stiffness):
    """Add the Fourier coefficients of the arctan steps along one direction to force and stiffness (top + 1,), in place;
    returns the nodes with the motion there (`sharp_nodes`). Arguments as in `evaluate_told`.
    """
    degree = force.shape[0] + c.shape[0] - 2
    # not a literal, for which the nodes would be compiled once more
    moving = degree < 0
    sampled = sharp_nodes(c, points, widths, degree, moving, grid[0], grid[1], rule_nodes, rule_weights)
    add_smooth_steps(sampled, steps, line, force, stiffness)
    return sampled


@kernel()
def evaluate_told(
    x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load, weight,
    points, widths, steps, step_first, line, rule_nodes, rule_weights, table, motions, parts, sizes,
):  # fmt: skip
    """`evaluate` with laws that have arctan steps; the table's spectra are zero before. Returns besides the nodes of
    the last direction that has steps, as `sharp_nodes` gives them.

    Parameters
    ----------
    points, widths, steps, step_first
        Places and widths of the steps (S,); they as `add_smooth_steps` wants them (S, 3), direction by direction: where
        each direction's begin, (G + 1,).
    line
        Constant and slope of the laws that they belong to, (G, 2).
    rule_nodes, rule_weights
        `sharp_nodes.tables()`.
    """
    along_directions(x, starts, dofs, shape, motions)
    sampled = np.empty((4, 0))
    for g in range(motions.shape[0]):
        low, high = step_first[g], step_first[g + 1]
        if high > low:
            sampled = add_told(
                motions[g], points[low:high], widths[low:high], steps[low:high], line[g], grid, rule_nodes,
                rule_weights, table[0, g], table[1, g],
            )  # fmt: skip
    finite = evaluate(
        x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load,
        weight, table, motions, parts, sizes,
    )  # fmt: skip
    return finite, sampled


@kernel()
def evaluate_anew(
    x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load, weight,
    points, widths, steps, step_first, line, rule_nodes, rule_weights, table, motions, parts, sizes,
):  # fmt: skip
    """`evaluate`, or `evaluate_told` where there are `points`, into a table that holds anything before; returns
    whether the forces are finite, and the nodes of the last direction with steps, (4, 0) without any.
    """
    table.fill(0.0)
    if points is None:
        finite = evaluate(
            x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load,
            weight, table, motions, parts, sizes,
        )  # fmt: skip
        return finite, np.empty((4, 0))
    return evaluate_told(
        x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load,
        weight, points, widths, steps, step_first, line, rule_nodes, rule_weights, table, motions, parts, sizes,
    )  # fmt: skip


@kernel()
def jacobian(out, table, moving, rate, mean, starts, dofs, shape, matrices, multiples, omega, x):
    """Add R_X of a structure's own matrices to a matrix of zeros, in the integer (mean) or the half-odd basis.

    Parameters
    ----------
    out
        Filled. Where it has a column more than rows, that is the linear part of R_omega.
    table, moving, rate
        Spectra (3, G, top + 1), whether a direction has damping, the base frequency.
    matrices, multiples
        Mass, damping, stiffness (3, n, n); the basis's frequencies in units of omega.
    x
        Coefficients (2 H + 1, n).
    """
    n = x.shape[1]
    tangent_matrix(out, table[1], table[2], moving, rate, mean, starts, dofs, shape, n)
    first = 1 if mean else 0
    last = out.shape[1] - 1
    extended = last == out.shape[0]
    for h in range(multiples.shape[0]):
        om = multiples[h] * omega
        single = mean and h == 0
        at = 0 if single else (2 * h - first) * n
        for i in range(n):
            slope = other = 0.0
            for j in range(n):
                p = matrices[2, i, j] - om * om * matrices[0, i, j]
                q = om * matrices[1, i, j]
                # an amplitude a - i b stands for a cos + b sin: the block is [[P, Q], [-Q, P]]
                out[at + i, at + j] += p
                if single:
                    continue
                out[at + n + i, at + n + j] += p
                out[at + i, at + n + j] += q
                out[at + n + i, at + j] -= q
                if extended:
                    p = -2.0 * om * multiples[h] * matrices[0, i, j]
                    q = multiples[h] * matrices[1, i, j]
                    slope += p * x[2 * h - 1, j] + q * x[2 * h, j]
                    other += p * x[2 * h, j] - q * x[2 * h - 1, j]
            if extended and not single:
                out[at + i, last] += slope
                out[at + n + i, last] += other


@kernel()
def neglected_of_one(force, shape, multiples, omega, matrices, out):
    """Answer of one DOF to the harmonics of the element forces beyond the basis, into `out` (H + 1, 1).

    force (G, 2 H + 2): spectra along the directions, whose entries are `shape` (G,); multiples (H + 1,): the harmonics
    beyond, in units of omega; matrices: mass, damping, stiffness (3, 1, 1).
    """
    high = multiples.shape[0] - 1
    for h in range(high + 1):
        om = multiples[h] * omega
        total = 0.0 + 0.0j
        for g in range(shape.shape[0]):
            total += 2.0 * shape[g] * force[g, high + 1 + h]
        block = complex(matrices[2, 0, 0] - om * om * matrices[0, 0, 0], om * matrices[1, 0, 0])
        out[h, 0] = -total / block if abs(block) > 0.0 else complex(np.inf, np.inf)


def evaluated(state: BalanceState) -> tuple[ComplexArray, Array, Array]:
    """Spectra along all directions, A X, F, `A X + F - P`, and the sizes of the latter, A X, F and P.

    The state gets its displacements and the blocks of A besides. Raises ConvergenceError if a force is not finite.
    """
    balance, basis, linear = state.balance, state.basis, state.linear
    count, size = len(balance.groups), balance.size
    packed, nodes = state.packed
    table = np.zeros((3, count, balance.top + 1), dtype=complex)
    if packed.sampled and not packed.told:
        laws = balance.coefficients(state.values)[2]
        for g, (law, motion) in enumerate(zip(laws, state.motions, strict=True)):
            out = (table[0, g], table[1, g], table[2, g])
            add_sampled_spectra(law, balance.elements, balance.samples, motion, state.rate, out)
    pieces = packed.pieces if len(packed.pieces) else None
    if pieces is not None and ready(evaluate) and not ready(add_pieces):
        # compiled one after the other, where `evaluate` has been compiled for laws without pieces
        grid = balance.grid
        for g, motion in enumerate(state.motions):
            own = pieces[packed.first[g] : packed.first[g + 1]]
            add_pieces(motion, own, grid[0], grid[1], table[0, g], table[1, g])
        pieces = None
    if isinstance(linear, StructuralMatrices):
        matrices = linear.matrices
        blocks = np.empty((basis.harmonics + 1, size, size), dtype=complex)
    else:
        matrices, blocks = _NO_MATRICES, np.ascontiguousarray(state.blocks, dtype=complex)
    motions = np.empty((count, basis.harmonics + 1), dtype=complex)
    parts, sizes = np.empty((3, *state.x.shape)), np.empty(4)
    given = (
        state.x,
        state.omega,
        basis.multiples,
        matrices,
        blocks,
        *balance.directions,
        pieces,
        packed.first,
        packed.polynomial,
        balance.grid,
        nodes,
        balance.load(state.values, state.omega),
        balance.scales()[1],
    )
    filled = (table, motions, parts, sizes)
    known = state.__dict__
    if packed.told:
        finite, sampled = evaluate_told(*(*given, *told_steps(packed), *filled))
        known["_told_nodes"] = int(packed.step_owner[-1]), sampled
    else:
        finite = evaluate(*given, *filled)
    known["motions"], known["blocks"] = motions, blocks
    if not balance.own:
        known["nodal"] = []
    if not finite:
        _refuse(state)
    return table, parts, sizes


def told_steps(packed: PackedLaws) -> tuple[Any, ...]:
    """Arctan steps as `evaluate_told` wants them, from `points` to `rule_weights`."""
    return (*packed.places, packed.steps, packed.step_first, packed.line, *rule_tables())


def _refuse(state: BalanceState) -> None:
    for local in state.local_motions:
        nodes = uniform_nodes(64) if local.pieces is not None else local.nodes()
        u, du = kernels.motion(local.motion, nodes.zr, nodes.zi)
        parts = local.element.tangent(u, state.rate * du, local.coefficients)
        if not all(np.isfinite(part).all() for part in parts if part is not None):
            raise ConvergenceError(
                f"{local.element.label} returned a force that is not finite at omega = {state.omega:.6g} "
                f"(largest coefficient of the motion {np.abs(state.x).max():.3g})"
            )
    raise ConvergenceError(f"the element forces are not finite at omega = {state.omega:.6g}")


def structural_jacobian(state: BalanceState, matrices: Array, mean: bool, columns: int = 0) -> Array:
    """R_X in the integer (mean=True) or the half-odd basis with all harmonics up to H, and the linear part of R_omega
    if a column is added for it; matrices: M, C, K.
    """
    balance, basis, table = state.balance, state.basis, state.spectra_table
    rows = balance.size * (2 * basis.harmonics + (1 if mean else 2))
    out = np.zeros((rows, rows + columns))
    multiples = basis.multiples if mean else basis.half_multiples
    jacobian(
        out, table, balance.moving, state.rate, mean, *balance.directions, matrices, multiples, state.omega, state.x
    )
    if state.nodal:
        add_tangent(state.nodal, out, mean, balance.size)
    return out


__all__ = [
    "add_told",
    "along_directions",
    "evaluate",
    "evaluate_anew",
    "evaluate_told",
    "evaluated",
    "jacobian",
    "neglected_of_one",
    "structural_jacobian",
]
