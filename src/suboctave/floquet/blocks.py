"""The linear part of a structure as separate motions of one or two states each.

In modes normalised by mass the linear motion `y'' + C y' + K y = - sum_g left_g F_g`, `q_g = right_g^T y`, has a
diagonal K; a diagonal C leaves every mode to itself, and others couple few or all of them. Coupled modes are separated
by the eigenvectors of their states. What remains are blocks, each a state z of one or two numbers,

    z' = L z + B F,    q = G z,    q' = G' z,

L an eigenvalue, or a 2 x 2 matrix with two eigenvalues that are conjugate or lie close together: those of one mode are
left as they are, `z = (s y, y')`, which critical damping and free masses need. Exponentials of blocks are known in
closed form: `exp(L t) = e_0(t) + e_1(t) L`.

Blocks come in the order of their rates |lambda|. For those that are too fast for a motion others stand in (`levels`).
Blocks that no channel both reads and drives change no multiplier and come last.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.csgraph import connected_components

from suboctave.harmonic.aft.channel import Group
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.linear_part import LinearPart

#: real eigenvalues of a mode that are closer than this, relative to their sizes, stay in one block
_APART = 0.3
#: product of reading and driving, relative to the largest, of a block that does not take part
_UNCOUPLED = 1e-28
_EPS = float(np.finfo(float).eps)


class Blocks(NamedTuple):
    """See the module. B blocks, S states, G channels.

    motion
        L, (B, 2, 2); of a single state in the upper left corner.
    first
        The first state of every block, and the number of states, (B + 1,).
    rates
        Largest |lambda| of every block, (B,).
    decays
        Largest real part of the eigenvalues of every block, (B,).
    exponents
        All eigenvalues, in the order of the states, (S,).
    driven
        B, (S, G).
    read
        G and G', (2, G, S).
    flexibility
        -G L^-1 B of every block, (B, G, G); of one that is free to move, or does not take part, zero.
    yielding
        Sizes of its entries, summed over the channels that drive, (B, G).
    coupling
        G B and G L B of every block, (B, 2, 2 G G), by q and q', channels that read and that drive.
    shifting
        How far stiffness and damping of a channel shift the exponents, to first order, (2, S, G); of double ones zero.
    coupled
        How many blocks take part.
    active
        Which of all groups' inputs the channels are, (G,).
    rounding
        Relative errors of multipliers due to eigenvectors that are nearly parallel.
    """

    motion: Array
    first: np.ndarray
    rates: Array
    decays: Array
    exponents: ComplexArray
    driven: Array
    read: Array
    flexibility: Array
    yielding: Array
    coupling: Array
    shifting: ComplexArray
    coupled: int
    active: np.ndarray
    rounding: float


class _Parts:
    """Blocks as they are found: matrices L, rows that take states (y, y') to z, columns that take them back."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.matrices: list[Array] = []
        self.exponents: list[ComplexArray] = []
        self.rows: list[Array] = []
        self.columns: list[Array] = []

    def add(self, which: np.ndarray, matrix: Array, exponents: ComplexArray, rows: Array, columns: Array) -> None:
        """A block among the states `which`: rows (b, len(which)), columns (len(which), b)."""
        r, c = np.zeros((len(rows), self.count)), np.zeros((self.count, len(rows)))
        r[:, which], c[which] = rows, columns
        self.matrices.append(matrix)
        self.exponents.append(exponents)
        self.rows.append(r)
        self.columns.append(c)


@lru_cache(maxsize=16)
def in_blocks(linear: LinearPart, groups: tuple[Group, ...]) -> Blocks:
    """The linear part in blocks, with the channels of the groups."""
    m, c, k = (np.asarray(matrix, dtype=float) for matrix in linear.equation_of_motion())
    # in one unknown DOF channels have one direction
    pairs = [(d if len(d) == 1 else group.direction, d) for group in groups for d in group.inputs]
    rows = np.array([[linear.expand(d) for d in pair] for pair in pairs], dtype=float).reshape(-1, 2, len(m))
    active = np.flatnonzero(rows[:, 0].any(axis=1))
    stiffness, damping, left, right = _in_modes(m, c, k, rows[active, 0], rows[active, 1])
    n = len(m)
    parts, condition = _Parts(2 * n), 1.0
    _, labels = connected_components((stiffness != 0.0) | (damping != 0.0), directed=False)
    for label in range(labels.max(initial=-1) + 1):
        which = np.flatnonzero(labels == label)
        if len(which) == 1:
            _add_mode(parts, int(which[0]), stiffness[which[0], which[0]], damping[which[0], which[0]])
        else:
            at = np.ix_(which, which)
            condition = max(condition, _add_coupled(parts, which, stiffness[at], damping[at]))
    return _arranged(parts, n, left, right, active, (condition - 1.0) * _EPS)


def _in_modes(m: Array, c: Array, k: Array, l: Array, r: Array) -> tuple[Array, Array, Array, Array]:
    """Stiffness, damping, directions in modes normalised by mass. Where mass or stiffness is not symmetric, or the mass
    not positive definite, in DOFs weighted by the square roots of their masses.
    """
    modes = None
    if np.array_equal(m, m.T) and np.array_equal(k, k.T):
        try:
            values, modes = eigh(k, m)
        except np.linalg.LinAlgError:
            modes = None
    if modes is None:
        weight = np.sqrt(m.diagonal())
        inverse = np.linalg.inv(m) * weight[:, None]
        return inverse @ k / weight, inverse @ c / weight, l @ inverse.T, r / weight
    damping = modes.T @ c @ modes
    # without what rounding leaves off the diagonal
    size = np.abs(modes).T @ np.abs(c) @ np.abs(modes)
    scale = np.sqrt(np.abs(np.multiply.outer(damping.diagonal(), damping.diagonal())))
    damping = np.where(np.abs(damping) > np.maximum(1e-13 * scale, 4.0 * _EPS * size), damping, 0.0)
    # what is free to move is not held by rounding: a unit of its displacement would be millions of the others'
    values = np.where(np.abs(values) > len(m) * _EPS * np.abs(values).max(initial=0.0), values, 0.0)
    return np.diag(values), damping, l @ modes, r @ modes


def _add_mode(parts: _Parts, i: int, k: float, c: float) -> None:
    """The blocks of `y'' + c y' + k y`, the mode i."""
    which = np.array([i, i + parts.count // 2])
    root = np.sqrt(complex(0.25 * c * c - k))
    # the larger one without cancellation, the other from the product
    large = complex(-0.5 * c - (root if c >= 0.0 else -root))
    small = k / large if large != 0.0 else large
    if large.imag == 0.0 and abs(large - small) > _APART * (abs(large) + abs(small)):
        a, b = large.real, small.real
        for own, other in ((a, b), (b, a)):
            size = np.hypot(1.0, own)
            rows = np.array([[-other, 1.0]]) * (size / (own - other))
            parts.add(which, np.array([[own]]), np.array([own], complex), rows, np.array([[1.0], [own]]) / size)
        return
    s = np.sqrt(abs(k)) or abs(c) or 1.0
    matrix = np.array([[0.0, s], [-k / s, -c]])
    scale = np.diag([s, 1.0])
    parts.add(which, matrix, np.array([large, small]), scale, np.linalg.inv(scale))


def _add_coupled(parts: _Parts, which: np.ndarray, k: Array, c: Array) -> float:
    """The blocks of coupled modes; returns the condition of their eigenvectors."""
    n = len(which)
    scale = np.sqrt(np.abs(k.diagonal()))
    scale = np.where(scale > 0.0, scale, 1.0)
    matrix = np.block([[np.zeros((n, n)), np.diag(scale)], [-k / scale, -c]])
    basis, inverse, found = separated(matrix)
    weights = np.concatenate((scale, np.ones(n)))
    states, at = np.concatenate((which, which + parts.count // 2)), 0
    for block in found:
        width = len(block)
        value = complex(block[0, 0], block[0, -1] if width > 1 else 0.0)
        rows, columns = inverse[at : at + width] * weights, basis[:, at : at + width] / weights[:, None]
        parts.add(states, block, np.array([value, value.conjugate()])[:width], rows, columns)
        at += width
    return float(np.linalg.cond(basis))


def separated(matrix: Array) -> tuple[Array, Array, list[Array]]:
    """Real eigenvectors in columns, two for conjugate eigenvalues, their inverse, and the blocks that they make."""
    values, vectors = np.linalg.eig(matrix)
    keep = values.imag >= 0.0
    values, vectors = values[keep], vectors[:, keep]
    # real and imaginary parts at right angles
    vectors = vectors * np.exp(-0.5j * np.angle(np.sum(vectors**2, axis=0)))
    columns: list[Array] = []
    blocks: list[Array] = []
    for value, v in zip(values, vectors.T, strict=True):
        width = 1 if value.imag == 0.0 else 2
        columns += [v.real, v.imag][:width]
        blocks.append(np.array([[value.real, value.imag], [-value.imag, value.real]])[:width, :width])
    basis = np.stack(columns, axis=1)
    return basis, np.asarray(np.linalg.inv(basis), dtype=float), blocks


class States(NamedTuple):
    """Blocks of given matrices, as those of `Blocks`."""

    motion: Array
    first: np.ndarray
    driven: Array
    read: Array
    coupling: Array


def states_of(matrices: list[Array], driven: Array, read: Array) -> States:
    """Blocks with these matrices L, driven (S, G) and read (2, G, S)."""
    count, groups = len(matrices), driven.shape[1]
    first = np.concatenate(([0], np.cumsum([len(matrix) for matrix in matrices]))).astype(np.int64)
    motion, coupling = np.zeros((count, 2, 2)), np.zeros((count, 2, 2 * groups * groups))
    for b, matrix in enumerate(matrices):
        at = slice(first[b], first[b + 1])
        motion[b, : len(matrix), : len(matrix)] = matrix
        coupling[b] = (read[:, :, at] @ driven[at]).ravel(), (read[:, :, at] @ matrix @ driven[at]).ravel()
    return States(motion, first, driven, read, coupling)


def of_blocks(together: np.ufunc, values: Array, first: np.ndarray) -> Array:
    """The states' values (S, ...) taken together in every block, (B, ...)."""
    if len(first) == 1:
        return np.zeros((0, *values.shape[1:]))
    result: Array = together.reduceat(values, first[:-1])
    return result


def in_one(motion: Array, first: np.ndarray) -> Array:
    """The matrix of all states of blocks, (S, S)."""
    whole = np.zeros((first[-1] - first[0],) * 2)
    for b, (s, e) in enumerate(pairwise(first - first[0])):
        whole[s:e, s:e] = motion[b, : e - s, : e - s]
    return whole


def _arranged(parts: _Parts, n: int, left: Array, right: Array, active: np.ndarray, rounding: float) -> Blocks:
    """The blocks in their order, as arrays."""
    driven = [-rows[:, n:] @ left.T for rows in parts.rows]
    read = [np.stack((right @ columns[:n], right @ columns[n:])) for columns in parts.columns]
    rates = np.array([np.abs(values).max() for values in parts.exponents])
    taking = np.array(
        [np.abs(g).max(initial=0.0) * np.abs(b).max(initial=0.0) for g, b in zip(read, driven, strict=True)]
    )
    coupled = taking > _UNCOUPLED * taking.max(initial=0.0)
    order = np.lexsort((rates, ~coupled))
    groups = len(active)
    motion, flexibility = np.zeros((len(order), 2, 2)), np.zeros((len(order), groups, groups))
    for b, i in enumerate(order):
        size = len(parts.matrices[i])
        motion[b, :size, :size] = parts.matrices[i]
        if coupled[i] and np.abs(parts.exponents[i]).min() > 0.0:
            flexibility[b] = -read[i][0] @ np.linalg.solve(parts.matrices[i], driven[i])
    first = np.concatenate(([0], np.cumsum([len(parts.matrices[i]) for i in order]))).astype(np.int64)
    into = np.concatenate([driven[i] for i in order])
    out = np.concatenate([read[i] for i in order], axis=2)
    coupling = np.zeros((len(order), 2, 2, groups, groups))
    for b, i in enumerate(order):
        coupling[b, 0], coupling[b, 1] = read[i] @ driven[i], read[i] @ parts.matrices[i] @ driven[i]
    decays = np.array([parts.exponents[i].real.max() for i in order])
    shifting = np.concatenate(
        [_shifting(coupling[b, 0], coupling[b, 1], parts.exponents[i]) for b, i in enumerate(order)], axis=1
    )
    exponents = np.concatenate([parts.exponents[i] for i in order])
    return Blocks(
        motion, first, rates[order], decays, exponents, into, np.ascontiguousarray(out), flexibility,
        np.abs(flexibility).sum(axis=2),
        coupling.reshape(len(order), 2, -1), shifting, int(coupled.sum()), active, rounding,
    )  # fmt: skip


def _shifting(first: Array, second: Array, exponents: ComplexArray) -> ComplexArray:
    """`Blocks.shifting` of a block with these exponents, (2, b, G); first, second: G B and G L B, (2, G, G) each.

    With `L' = L + B k G`, the trace of L' grows by that of B k G, and half that of L'^2 by that of L B k G.
    """
    trace, product = np.diagonal(first, axis1=1, axis2=2), np.diagonal(second, axis1=1, axis2=2)
    if len(exponents) == 1:
        return trace[:, None, :].astype(complex)
    apart = exponents[0] - exponents[1]
    if apart.imag == 0.0:
        return np.zeros((2, 2, trace.shape[1]), dtype=complex)
    return np.stack((product - exponents[1] * trace, exponents[0] * trace - product), axis=1) / apart
