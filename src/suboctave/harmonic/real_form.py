"""The adjoint gradient of `left^T J right` for the two real kinds of operator, compiled.

In the basis of cosines and sines, integer or half-odd, both vectors are real functions of time. With
`L = l_0 + 2 sum (l_c cos + l_s sin)` and `r = r_0 + sum (r_c cos + r_s sin)` along a direction (in the half-odd basis
without the means),

    d (left^T J right) / d X_k = 1/(2 pi) int f_uu L r phi_k dtau,    phi_k = 1, cos k tau, sin k tau,

and the linear part depends on omega through its blocks alone. The general case is `perturbation.bilinear_gradient`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.compiled import at_hand, kernel, ready
from suboctave.harmonic.basis import Array
from suboctave.harmonic.closed_bends import bends_of_corners, bends_of_polynomial, bends_of_smooth_steps
from suboctave.harmonic.evaluation import told_steps
from suboctave.harmonic.group_force import Group, PackedLaws
from suboctave.harmonic.kernels import polynomial, spectra, toeplitz_form
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.sharp_nodes import sharp_nodes
from suboctave.harmonic.state import BalanceState

if TYPE_CHECKING:
    from suboctave.harmonic.balance import HarmonicBalance


_NO_NODES = np.empty((4, 0))


@kernel()
def _half_turn(zr, zi):
    """Real and imaginary part of `exp(i tau / 2)`, up to a sign."""
    if zr > 0.0:
        cosine = math.sqrt(0.5 * (1.0 + zr))
        return cosine, 0.5 * zi / cosine
    sine = math.sqrt(0.5 * (1.0 - zr))
    return 0.5 * zi / sine, sine


@kernel()
def half_odd_values(waves, zr, zi):
    """`Re sum_k c_k exp(i (k + 1/2) tau)` of every row of amplitudes (R, F) at instants, (R, N), up to a sign that all
    rows share.
    """
    values = polynomial(waves, zr, zi)
    out = np.empty((waves.shape[0], zr.shape[0]))
    for j in range(zr.shape[0]):
        cosine, sine = _half_turn(zr[j], zi[j])
        for r in range(waves.shape[0]):
            out[r, j] = values[r, j].real * cosine - values[r, j].imag * sine
    return out


@kernel()
def _add_group(left, right, mean, dofs, shape, zr, zi, uu, gx):
    """Add the gradient of one direction's force, given as weights `uu` at the points z, to `gx` (2 H + 1, n)."""
    high = gx.shape[0] // 2
    count = left.shape[0] // 2 + (1 if mean else 0)
    waves = np.zeros((2, count), dtype=np.complex128)
    for s in range(dofs.shape[0]):
        d = dofs[s]
        for k in range(count):
            if mean and k == 0:
                waves[0, 0] += shape[s] * left[0, d]
                waves[1, 0] += shape[s] * right[0, d]
                continue
            at = 2 * k - 1 if mean else 2 * k
            waves[0, k] += 2.0 * shape[s] * complex(left[at, d], -left[at + 1, d])
            waves[1, k] += shape[s] * complex(right[at, d], -right[at + 1, d])
    values = polynomial(waves, zr, zi)
    n = zr.shape[0]
    product = np.empty((1, n))
    for j in range(n):
        cosine, sine = 1.0, 0.0
        if not mean:
            # up to a sign, which both functions share
            cosine, sine = _half_turn(zr[j], zi[j])
        u = values[0, j].real * cosine - values[0, j].imag * sine
        v = values[1, j].real * cosine - values[1, j].imag * sine
        product[0, j] = u * v * uu[j]
    found = spectra(product, zr, zi, high)
    for s in range(dofs.shape[0]):
        gx[0, dofs[s]] += shape[s] * found[0, 0].real
        for k in range(1, high + 1):
            gx[2 * k - 1, dofs[s]] += shape[s] * found[0, k].real
            gx[2 * k, dofs[s]] -= shape[s] * found[0, k].imag


@kernel()
def add_doubled_form(p, q, dofs, shape, zr, zi, second, third, slope, by_two, by_three):
    """Add `<f_uu p p>` in the integer basis, times the direction, to `by_two` (2 H + 1, n), and `<f_uuu p p p q>` to
    `by_three` (1,).

    p, q (2 H + 2, n): vectors of the half-odd basis, q a left one; dofs, shape: where the direction is not zero, and
    its entries there; the rest as in `closed_bends`.
    """
    high = by_two.shape[0] // 2
    n = zr.shape[0]
    waves = np.zeros((2, high + 1), dtype=np.complex128)
    for s in range(dofs.shape[0]):
        d = dofs[s]
        for k in range(high + 1):
            waves[0, k] += shape[s] * complex(p[2 * k, d], -p[2 * k + 1, d])
            waves[1, k] += 2.0 * shape[s] * complex(q[2 * k, d], -q[2 * k + 1, d])
    values = half_odd_values(waves, zr, zi)
    square = np.empty((1, n))
    total = 0.0
    for j in range(n):
        u = values[0, j]
        square[0, j] = second[j] * u * u
        total += third[j] * u * u * u * values[1, j]
    if slope.shape[0] > 0:
        turned = np.empty_like(waves)
        for k in range(high + 1):
            for r in range(2):
                turned[r, k] = complex(-(k + 0.5) * waves[r, k].imag, (k + 0.5) * waves[r, k].real)
        rates = half_odd_values(turned, zr, zi)
        for j in range(n):
            u, v = values[0, j], values[1, j]
            total += slope[j] * u * u * (3.0 * rates[0, j] * v + u * rates[1, j])
    found = spectra(square, zr, zi, high)
    for s in range(dofs.shape[0]):
        d = dofs[s]
        by_two[0, d] += shape[s] * found[0, 0].real
        for k in range(1, high + 1):
            by_two[2 * k - 1, d] += 2.0 * shape[s] * found[0, k].real
            by_two[2 * k, d] -= 2.0 * shape[s] * found[0, k].imag
    by_three[0] += total / (2.0 * math.pi)


@kernel()
def toeplitz_part(left, right, mean, dofs, shape, spectrum):
    """`left^T T right` along a direction, T the product with a real periodic function whose Fourier coefficients
    0 .. top are given; vectors (rows, n) of the integer basis (mean) or the half-odd one.
    """
    count = left.shape[0] // 2
    middle = count + 1 if mean else count
    waves = np.zeros((2, middle + count), dtype=np.complex128)
    for s in range(dofs.shape[0]):
        d = dofs[s]
        if mean:
            waves[0, count] += shape[s] * left[0, d]
            waves[1, count] += shape[s] * right[0, d]
        for k in range(count):
            at = 2 * k + 1 if mean else 2 * k
            waves[0, middle + k] += shape[s] * complex(left[at, d], -left[at + 1, d])
            waves[1, middle + k] += 0.5 * shape[s] * complex(right[at, d], -right[at + 1, d])
    for k in range(count):
        waves[0, count - 1 - k] = waves[0, middle + k].conjugate()
        waves[1, count - 1 - k] = waves[1, middle + k].conjugate()
    return toeplitz_form(waves[0], spectrum, waves[1]).real


@kernel()
def linear_rates(left, right, mean, multiples, omega, matrices):
    """Derivatives of the linear part of the form by omega, and by kappa (its imaginary part, the real one is zero)."""
    n = left.shape[1]
    by_omega = by_kappa = 0.0
    for h in range(multiples.shape[0]):
        m = multiples[h]
        om = m * omega
        if mean and h == 0:
            for i in range(n):
                for j in range(n):
                    by_kappa += left[0, i] * matrices[1, i, j] * right[0, j]
            continue
        at = 2 * h - 1 if mean else 2 * h
        for i in range(n):
            a, b = left[at, i], left[at + 1, i]
            for j in range(n):
                c, d = right[at, j], right[at + 1, j]
                p, q = -2.0 * om * matrices[0, i, j], matrices[1, i, j]
                even = a * c + b * d
                odd = a * d - b * c
                by_omega += m * (p * even + q * odd)
                by_kappa += q * even - p * odd
    return by_omega, by_kappa


@kernel()
def add_steps(left, right, mean, dofs, shape, sampled, steps, gx):
    """Add the gradient of arctan steps along one direction to `gx`; sampled: their nodes with the motion."""
    weights = bends_of_smooth_steps(sampled, steps)
    _add_group(left, right, mean, dofs, shape, sampled[0], sampled[1], weights[0], gx)


@kernel()
def noted_gradient(
    left, right, mean, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points, widths, steps,
    step_first, line, rule_nodes, rule_weights, noted, top, multiples, omega, matrices, gx,
):  # fmt: skip
    """Add the derivative of `left^T J right` by the coefficients to `gx` (2 H + 1, n), where all laws are known in
    closed form; returns that by omega, and the imaginary part of that by kappa.

    left, right (rows, n): vectors of the integer basis (mean) or the half-odd one; multiples: its frequencies in units
    of omega; motions, ..., nodes and points, ..., rule_weights: as in `evaluation.evaluate` and `evaluate_told`; noted:
    the nodes of the only direction that has steps, or an array without nodes, (4, 0); top: highest Fourier coefficient
    of the tangent.
    """
    degree = top + motions.shape[1] - 1
    # not a literal, for which the nodes would be compiled once more
    moving = degree < 0
    for g in range(motions.shape[0]):
        c, at, along = motions[g], dofs[starts[g] : starts[g + 1]], shape[starts[g] : starts[g + 1]]
        if pieces is not None and first[g + 1] > first[g]:
            bends = bends_of_corners(c, pieces[first[g] : first[g + 1]], grid[0], grid[1])
            _add_group(left, right, mean, at, along, bends[0], bends[1], bends[2], gx)
        if polynomial.shape[1] > 2:
            weights = bends_of_polynomial(c, polynomial[g], nodes[0], nodes[1])
            _add_group(left, right, mean, at, along, nodes[0], nodes[1], weights[0], gx)
        if points is not None and step_first[g + 1] > step_first[g]:
            low, high = step_first[g], step_first[g + 1]
            if noted.shape[1] > 0:
                sampled = noted
            else:
                sampled = sharp_nodes(
                    c, points[low:high], widths[low:high], degree, moving, grid[0], grid[1], rule_nodes, rule_weights
                )
            add_steps(left, right, mean, at, along, sampled, steps[low:high], gx)
    return linear_rates(left, right, mean, multiples, omega, matrices)


@kernel()
def closed_gradient(
    left, right, mean, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points, widths, steps,
    step_first, line, rule_nodes, rule_weights, top, multiples, omega, matrices, gx,
):  # fmt: skip
    """`noted_gradient` without nodes known."""
    return noted_gradient(
        left, right, mean, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes, points, widths, steps,
        step_first, line, rule_nodes, rule_weights, np.empty((4, 0)), top, multiples, omega, matrices, gx,
    )  # fmt: skip


def closed_parts(packed: PackedLaws) -> list[Callable[..., Any]] | None:
    """The kernels that gradients call for laws of some kinds only; None if some are not in closed form."""
    if packed.sampled and not packed.told:
        return None
    asked = (
        (bends_of_corners, len(packed.pieces)),
        (bends_of_polynomial, packed.polynomial.shape[1] > 2),
        (sharp_nodes, packed.told),
        (bends_of_smooth_steps, packed.told),
    )
    return [part for part, needed in asked if needed]


def noted_nodes(state: BalanceState, packed: PackedLaws) -> Array:
    """The nodes of arctan steps that an evaluated motion has kept, where only one direction has any; else (4, 0)."""
    known: tuple[int, Array] | None = state.__dict__.get("_told_nodes")
    if known is None or len(packed.steps) != packed.step_first[known[0] + 1] - packed.step_first[known[0]]:
        return _NO_NODES
    return known[1]


def closed_laws(balance: HarmonicBalance, packed: PackedLaws, nodes: Array) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Directions and laws as `closed_gradient` wants them: from `starts` to `nodes`, and the arctan steps."""
    pieces = packed.pieces if len(packed.pieces) else None
    steps = told_steps(packed) if packed.told else (None,) * 7
    return (*balance.directions, pieces, packed.first, packed.polynomial, balance.grid, nodes), steps


def applies(state: BalanceState, names: tuple[str, ...]) -> bool:
    """Whether the forces depend on displacements alone, and the linear part is the structure's own."""
    balance = state.balance
    plain = balance.basis.kept is None and not balance.own and not balance.any_moving and names in ((), ("omega",))
    return plain and isinstance(state.linear, StructuralMatrices)


def real_gradient(state: BalanceState, mean: bool, left: Array, right: Array) -> tuple[Array, float, complex]:
    """Derivative of `left^T J right` by the coefficients (2 H + 1, size), by omega, by kappa, where it `applies`.

    mean: integer basis, else half-odd.
    """
    balance, basis, linear = state.balance, state.basis, state.linear
    assert isinstance(linear, StructuralMatrices)
    u = np.ascontiguousarray(left).reshape(-1, balance.size)
    v = np.ascontiguousarray(right).reshape(-1, balance.size)
    gx = np.zeros((basis.size, balance.size))
    multiples = basis.multiples if mean else basis.half_multiples
    packed, nodes = state.packed
    called = closed_parts(packed)
    if called is not None and "closed_bends" not in state.__dict__:
        laws, steps = closed_laws(balance, packed, nodes)
        noted = noted_nodes(state, packed)
        at = (noted, balance.top, multiples, state.omega, linear.matrices, gx)
        given = (u, v, mean, state.motions, *laws, *steps, *at)
        # what it calls is compiled one by one, not all at one go
        if at_hand(noted_gradient, *given) or all(map(ready, (_add_group, *called))):
            by_omega, by_kappa = noted_gradient(*given)
            return gx, by_omega, 1j * by_kappa
    for group, zr, zi, second in _second(state):
        _add_group(u, v, mean, group.dofs, group.values, zr, zi, second, gx)
    by_omega, by_kappa = linear_rates(u, v, mean, multiples, state.omega, linear.matrices)
    return gx, by_omega, 1j * by_kappa


def _second(state: BalanceState) -> Iterator[tuple[Group, Array, Array, Array]]:
    """Directions with instants and weights of f_uu: a direction's laws in closed form one by one."""
    laws = state.balance.coefficients(state.values)[2]
    for g, (group, law) in enumerate(zip(state.balance.groups, laws, strict=True)):
        if law.in_closed_form:
            for part in state.closed_bends[g]:
                yield group, part.zr, part.zi, part.second
        else:
            bend = state.curvatures[g]
            yield group, bend.zr, bend.zi, bend.uu


def by_kappa(state: BalanceState, mean: bool, left: Array, right: Array) -> complex:
    """The derivative of `left^T J right` by kappa alone."""
    assert isinstance(state.linear, StructuralMatrices)
    u, v = (np.ascontiguousarray(one).reshape(-1, state.balance.size) for one in (left, right))
    multiples = state.basis.multiples if mean else state.basis.half_multiples
    return 1j * float(linear_rates(u, v, mean, multiples, state.omega, state.linear.matrices)[1])


__all__ = [
    "add_doubled_form",
    "add_steps",
    "applies",
    "by_kappa",
    "closed_gradient",
    "closed_laws",
    "closed_parts",
    "half_odd_values",
    "noted_gradient",
    "noted_nodes",
    "real_gradient",
    "toeplitz_part",
]
