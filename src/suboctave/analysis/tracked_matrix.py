"""Curves of limit points and period doublings evaluated in two compiled calls: equations, and what Newton factorises.

What `BalanceState`, `Bordered` and `TrackedEvaluation` do step by step, for the common case: omega is free, the
structure has matrices of its own, and all laws are known in closed form. There the calls would cost more than what
they do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.augmented import SingularEquations
from suboctave.bifurcation.bordered import Bordered
from suboctave.bifurcation.bordered_kernels import border_at
from suboctave.compiled import kernel, ready
from suboctave.continuation.linear import Factor
from suboctave.harmonic.changes import changes_by
from suboctave.harmonic.evaluation import evaluate, evaluate_anew, evaluate_told, jacobian
from suboctave.harmonic.group_kernels import add_along, add_pieces
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.real_form import applies, closed_laws, closed_parts, noted_gradient, noted_nodes, toeplitz_part

if TYPE_CHECKING:
    from suboctave.analysis.tracked_curve import TrackedEvaluation
    from suboctave.harmonic.basis import Array

#: the kinds of laws for which all kernels that are called are compiled
_EVALUATED: set[tuple[bool, ...]] = set()
_DIFFERENTIATED: set[tuple[bool, ...]] = set()


@kernel()
def bordered_by_rows(
    table, moving, rate, starts, dofs, shape, matrices, multiples, omega, x, others, rows, force, row, weights, out,
    extended,
):  # fmt: skip
    """Transpose of `[R_u; force G_u; row]`, columns of the first two over `weights`, for u = (X, extra, omega, others).

    Parameters
    ----------
    table, ..., x
        As in `evaluation.jacobian`.
    others
        R differentiated by the free parameters besides omega, (k, N).
    rows, force
        Derivatives of the scalar equations by u, and their unit.
    row
        The last row.
    out, extended
        Filled, (N, N) for N entries of u; overwritten, (n, n + 1) for n equations R.
    """
    n, last, count = x.shape[0] * x.shape[1], weights.shape[0] - 1, others.shape[0]
    extended.fill(0.0)
    # not a literal, for which the Jacobian would be compiled once more
    mean = n > 0
    jacobian(extended, table, moving, rate, mean, starts, dofs, shape, matrices, multiples, omega, x)
    for j in range(last + 1):
        scale = 1.0 / weights[j]
        for i in range(n):
            if j < n:
                out[j, i] = extended[i, j] * scale
            elif j < last - count:
                # R does not depend on the extra unknowns
                out[j, i] = 0.0
            elif j == last - count:
                out[j, i] = extended[i, n] * scale
            else:
                out[j, i] = others[j - last + count - 1, i] * scale
        for r in range(rows.shape[0]):
            out[j, n + r] = rows[r, j] * force * scale
        out[j, last] = row[j]


@kernel()
def evaluate_and_border(
    x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load, weight,
    points, widths, steps, step_first, line, rule_nodes, rule_weights, table, motions, parts, sizes,
    moving, rate, mean, frequencies, scale, left, right, size, operator, lu, pivots, vectors,
):  # fmt: skip
    """A motion and g of its operator J_0 (mean) or J_half; returns whether the forces are finite, whether the bordered
    operator is singular, and the nodes of arctan steps.

    x, ..., sizes: as in `evaluation.evaluate_told`, `points` and what follows None without steps. moving, ..., pivots:
    as in `bordered_kernels.border_at`. vectors (2, N + 1): filled with v and u, without the weights, g / size last.
    """
    finite, sampled = evaluate_anew(
        x, omega, multiples, matrices, blocks, starts, dofs, shape, pieces, first, polynomial, grid, nodes, load,
        weight, points, widths, steps, step_first, line, rule_nodes, rule_weights, table, motions, parts, sizes,
    )  # fmt: skip
    v, u = vectors[0], vectors[1]
    singular = border_at(
        table, moving, rate, mean, starts, dofs, shape, matrices, frequencies, omega, x, scale, left, right, size,
        operator, lu, pivots, v, u,
    )  # fmt: skip
    for i in range(scale.shape[0]):
        v[i] *= scale[i]
        u[i] *= scale[i]
    return finite, singular, sampled


@kernel(alone=True)
def gradient_and_matrix(
    left, right, mean, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points, widths, steps,
    step_first, line, rule_nodes, rule_weights, noted, top, frequencies, omega, matrices, table, moving, rate,
    multiples, x,
    force_by, stiffness_by, other, unit, force, row, weights, gx, rates, out, extended,
):  # fmt: skip
    """`bordered_by_rows` for u = (X, omega, a parameter) with the gradient of g.

    Parameters
    ----------
    left, ..., matrices
        As in `real_form.noted_gradient`; table, ..., multiples, x: as in `evaluation.jacobian`.
    force_by, stiffness_by
        Spectra of what the parameter does to the forces and stiffnesses along the directions, (G, top + 1).
    other
        R differentiated by the parameter without that, (2 H + 1, n).
    unit, force
        Units of g, and of its row.
    gx, rates, out
        Filled: minus the gradient by X, zeros before; that by omega, by the parameter, by kappa (imaginary part), (3,);
        the matrix.
    extended
        As in `bordered_by_rows`.
    """
    rates[0], rates[2] = noted_gradient(
        left, right, mean, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points, widths, steps,
        step_first, line, rule_nodes, rule_weights, noted, top, frequencies, omega, matrices, gx,
    )  # fmt: skip
    rates[1] = 0.0
    for g in range(force_by.shape[0]):
        at, along = dofs[starts[g] : starts[g + 1]], shape[starts[g] : starts[g + 1]]
        rates[1] += toeplitz_part(left, right, mean, at, along, stiffness_by[g])
        add_along(force_by[g], at, along, other)
    n = x.shape[0] * x.shape[1]
    rows = np.empty((1, n + 2))
    rows[0, :n] = gx.ravel()
    rows[0, n], rows[0, n + 1] = rates[0], rates[1]
    bordered_by_rows(
        table, moving, rate, starts, dofs, shape, matrices, multiples, omega, x, other.ravel().reshape((1, n)), rows,
        -force / unit, row, weights, out, extended,
    )  # fmt: skip


def evaluate_at_once(evaluation: TrackedEvaluation) -> None:
    """Evaluate the motion and g in one compiled call where that goes; they are left where the general way has them."""
    state, own = evaluation.state, evaluation.equations.own
    if type(own) is not SingularEquations or own.of.kind is Kind.FREE:
        return
    balance, basis, linear, kind = state.balance, state.basis, state.linear, own.of.kind
    if basis.kept is not None or balance.own or not isinstance(linear, StructuralMatrices):
        return
    packed, nodes = state.packed
    if packed.sampled and not packed.told:
        return
    # what it calls is compiled one by one, not all at one go
    asked = packed.told, len(packed.pieces) > 0
    if asked not in _EVALUATED:
        called = [evaluate_told if packed.told else evaluate, border_at, *([add_pieces] if asked[1] else [])]
        if not all(map(ready, called)):
            return
        _EVALUATED.add(asked)
    high, size, count, mean = basis.harmonics, balance.size, len(balance.groups), kind is Kind.INTEGER
    borders, unit = own.of.borders, state.omega**2
    n = len(borders.right)
    scale, operator, vectors = balance.row_weights(n), np.zeros((n, n)), np.empty((2, n + 1))
    lu, pivots = np.empty((n + 1, n + 1)), np.empty(n + 1, dtype=np.int32)
    blocks, motions = np.empty((high + 1, size, size), dtype=complex), np.empty((count, high + 1), dtype=complex)
    table = np.zeros((3, count, balance.top + 1), dtype=complex)
    parts, sizes = np.empty((3, *state.x.shape)), np.empty(4)
    laws, steps = closed_laws(balance, packed, nodes)
    load = balance.load(state.values, state.omega), balance.scales()[1]
    frequencies = basis.multiples if mean else basis.half_multiples
    given = (state.x, state.omega, basis.multiples, linear.matrices, blocks, *laws, *load, *steps)
    found = (table, motions, parts, sizes)
    rest = (balance.moving, state.rate, mean, frequencies, scale, borders.left, borders.right, unit)
    finite, singular, sampled = evaluate_and_border(*(*given, *found, *rest, operator, lu, pivots, vectors))
    if not finite:
        return
    known = state.__dict__
    known.update(_evaluated=(table, parts, sizes), motions=motions, blocks=blocks, nodal=[])
    if packed.told:
        known["_told_nodes"] = int(packed.step_owner[-1]), sampled
    known["jacobian" if mean else "half_jacobian"] = operator
    if not singular:
        right, left = vectors
        g = complex(right[n]) * unit
        factor = Factor(lu.T, pivots, False)
        own.__dict__["bordered"] = Bordered(state, kind, 0.0, g, right[:n], left[:n], scale, borders, factor)


def matrix_at_once(evaluation: TrackedEvaluation, row: Array, weights: Array) -> Array | None:
    """The transpose of `[F_u / weights; row]` in one compiled call; None where that does not go.

    The gradient of g is left with the equations.
    """
    state, equations, names = evaluation.state, evaluation.equations, evaluation.curve.names
    if type(equations) is not SingularEquations or equations.of.kind is Kind.FREE or len(names) != 2:
        return None
    balance, basis, linear, name = state.balance, state.basis, state.linear, names[1]
    plain = names[0] == "omega" and name not in balance.matrix_names and balance.steady and applies(state, ())
    if not plain or not isinstance(linear, StructuralMatrices):
        return None
    packed, nodes = state.packed
    asked = packed.sampled, packed.told, len(packed.pieces) > 0, packed.polynomial.shape[1] > 2
    if asked not in _DIFFERENTIATED:
        called = closed_parts(packed)
        own: list[Callable[..., Any]] = [noted_gradient, bordered_by_rows]
        if called is None or not all(map(ready, called + own)):
            return None
        _DIFFERENTIATED.add(asked)
    changes, count = changes_by(state, name), len(balance.groups)
    force_by, stiffness_by = np.zeros((2, count, balance.top + 1), dtype=complex)
    for group, change in changes:
        g = next(i for i, along in enumerate(balance.groups) if along is group)
        force_by[g], stiffness_by[g] = change.force, change.stiffness
    other = np.zeros(state.x.shape)
    if name in balance.load_names:
        other -= balance.loads.value({**state.values, "omega": state.omega}, balance.size, (name,))
    b, mean = equations.bordered, equations.of.kind is Kind.INTEGER
    left, right = b.left.reshape(-1, balance.size), b.right.reshape(-1, balance.size)
    frequencies = basis.multiples if mean else basis.half_multiples
    laws, steps = closed_laws(balance, packed, nodes)
    gx, rates = np.zeros(state.x.shape), np.empty(3)
    noted = noted_nodes(state, packed)
    form = (left, right, mean, state.motions, *laws, *steps, noted, balance.top, frequencies, state.omega)
    whole = (linear.matrices, state.spectra_table, balance.moving, state.rate, basis.multiples, state.x)
    changed = (force_by, stiffness_by, other)
    units = (equations.of.unit, evaluation.curve.force, row, weights)
    found, extended = np.empty((len(weights), len(weights))), np.empty((len(weights) - 2, len(weights) - 1))
    gradient_and_matrix(*(*form, *whole, *changed, *units, gx, rates, found, extended))
    by_omega, by_name, by_kappa = (-rates).tolist()
    equations.__dict__["gradient"] = -gx.ravel(), {"omega": complex(by_omega), name: complex(by_name)}, 1j * by_kappa
    return found


__all__ = ["bordered_by_rows", "evaluate_at_once", "matrix_at_once"]
