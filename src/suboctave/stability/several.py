"""Compiled kernels for several degrees of freedom, on the panels of `panels`.

    y'' + C(t) y' + K(t) y = - sum_g left_g r_g(t),   K(t) = K_0 + sum_g k_g(t) left_g right_g^T,   C(t) likewise

with y in DOFs weighted by the square roots of their masses, so that norms have no units. On a panel dt/ds, k_g, c_g and
r_g are polynomials, and the solution is summed as a power series in s, whose coefficients follow from each other; the
elements enter as products of rank one, so that a term costs hardly more than with constant matrices. Series converge
for any length; panels are taken in steps short enough for rounding not to grow.

A function and two kernels, `plan` and `march`: one kernel for all took too long to compile at the first use.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import QUICK, kernel
from suboctave.harmonic.basis import Array
from suboctave.stability.nodes import NODES, ORDER
from suboctave.stability.series import FAST, PAST, TERMS, evaluate, growth, norm, series, shifted, through

#: from values at the nodes to coefficients of powers of s: of the polynomial through all nodes, and of that without its
#: two highest Legendre components
_VALUES = np.linalg.inv(np.vander(NODES, increasing=True))
_LEGENDRE = np.polynomial.legendre.legvander(NODES, ORDER - 1)
_LOWER = _LEGENDRE @ np.diag((np.arange(ORDER) < ORDER - 2).astype(float)) @ np.linalg.inv(_LEGENDRE)
POWERS = np.array([_VALUES, _VALUES @ _LOWER])
#: length of a step in units of the fastest time scale, most steps of a panel, accuracy of a series
_REACH, _MOST = 4.0, 10000
_EXACT, _CLOSE = 1e-15, 1e-11


def propagate(
    stretch: Array,
    scale: float,
    stiffness: Array,
    damping: Array,
    left: Array,
    right: Array,
    base: Array,
    k: Array,
    c: Array,
    force: Array,
    kick: Array,
    powers: Array,
    nodes: Array,
) -> tuple[Array, Array, Array]:
    """Monodromy matrix and, where there is a force, what `respond` needs.

    stretch: dtau/ds (P, m); scale: dt/dtau; stiffness, damping: K_0, C_0 (n, n); left, right (G, n); base (G, P): parts
    of k_g that are constant on every panel; k (G, N) or (G, 0): the others at the nodes; c (G, N) or (G, 0): c_g; force
    (G, N) or (G, 0): r_g; kick (G, P): impulses `-kick left right^T y` at the beginnings of panels. Returns

    - the state (y, y') after the period (2 n, cols): one column per initial condition, with a force one more,
    - the same for every panel alone (P, 2 n, cols),
    - right_g^T y, right_g^T y' at the nodes of every panel for these columns (G, 2, P, m, cols).
    """
    count = len(stretch)
    groups, n = left.shape
    size = 2 * n
    forced = force.shape[1] > 0
    cols = size + 1 if forced else size
    many = size + groups * ORDER if forced else size
    poly = np.zeros((count, 1 + 3 * groups, ORDER))
    matrices = np.empty((count, n, n))
    steps = np.empty(count, dtype=np.int64)
    plan(stretch, scale, stiffness, damping, left, right, base, k, c, force, powers, poly, matrices, steps)
    total = np.eye(size, cols)
    alone = np.empty((count, size, cols))
    rows = np.zeros((groups, 2, count, ORDER, cols) if forced else (0, 2, 1, ORDER, cols))
    # terms of the series, and those where all is constant
    terms, plain = (np.zeros((PAST + TERMS, size + 2 * groups, columns)) for columns in (cols, many))
    march(
        stretch, scale, damping, left, right, base, kick, nodes, poly, matrices, steps, c.shape[1] > 0, forced,
        total, alone, rows, terms, plain,
    )  # fmt: skip
    return total, alone, rows


@kernel()
def plan(stretch, scale, stiffness, damping, left, right, base, k, c, force, powers, poly, matrices, steps):
    """What `march` needs of every panel.

    poly (P, 1 + 3 G, ORDER), zeros before: coefficients of powers of s in dt/ds, if the panel is graded, and in k_g,
    c_g, r_g, times dt/ds then; matrices (P, n, n): K_0 with the constant parts of k_g; steps (P,).
    """
    groups, n = left.shape
    local = np.zeros((1 + 3 * groups, ORDER))
    shares = np.empty(groups)
    for g in range(groups):
        top = whole = 0.0
        for i in range(n):
            top = max(top, abs(left[g, i]))
            whole += abs(right[g, i])
        shares[g] = top * whole
    size_c = norm(damping)
    for p in range(stretch.shape[0]):
        for i in range(n):
            for j in range(n):
                a = stiffness[i, j]
                for g in range(groups):
                    a += base[g, p] * left[g, i] * right[g, j]
                matrices[p, i, j] = a
        size_k = norm(matrices[p])
        graded = stretch[p, 0] != stretch[p, ORDER - 1]
        constant = not graded
        length = 0.0
        for j in range(ORDER):
            at = p * (ORDER - 1) + j
            factor = scale * stretch[p, j]
            length = max(length, factor)
            if graded:
                add(poly[p, 0], powers, j, factor)
            else:
                factor = 1.0
            for g in range(groups):
                if k.shape[1] > 0 and k[g, at] != 0.0:
                    constant = False
                    add(poly[p, 1 + 3 * g], powers, j, factor * k[g, at])
                if c.shape[1] > 0 and c[g, at] != 0.0:
                    constant = False
                    add(poly[p, 2 + 3 * g], powers, j, factor * c[g, at])
                if force.shape[1] > 0:
                    add(poly[p, 3 + 3 * g], powers, j, factor * force[g, at])
        # the series converges anyhow, but on the way to the last digits its terms should not become large
        most = _REACH if constant else 2.0 * _REACH
        number = max(1, math.ceil((math.sqrt(size_k) + size_c) * 2.0 * length / most))
        while (
            not constant
            and number < _MOST
            and growth(poly[p], local, 2.0 / number, number, length, graded, size_k, size_c, shares) > most
        ):
            number += 1 + number // 8
        steps[p] = number


@kernel()
def add(out, powers, j, value):
    """Add to the coefficients `out` what the value at node j contributes."""
    for i in range(ORDER):
        out[i] += powers[i, j] * value


@kernel(QUICK)
def march(
    stretch, scale, damping, left, right, base, kick, nodes, poly, matrices, steps, moving, forced,
    total, alone, rows, terms, plain,
):  # fmt: skip
    """Take the identity `total` over all panels; fill `alone` and `rows` (see `propagate`).

    terms, plain (PAST + TERMS, 2 n + 2 G, .): room for the series, and for those where all is constant.
    """
    groups, n = left.shape
    size = 2 * n
    cols = total.shape[1]
    many = plain.shape[2]
    local = np.zeros((1 + 3 * groups, ORDER))
    # a step's propagator, followed by the rows that lead to its nodes
    known = np.empty((size + 2 * groups * ORDER, many))
    product = np.empty((size, cols))
    room = np.empty((groups + size, many))
    known_span = -1.0
    known_steps = used = 0
    for p in range(stretch.shape[0]):
        graded = stretch[p, 0] != stretch[p, ORDER - 1]
        constant = not graded
        length = 0.0
        for j in range(ORDER):
            length = max(length, scale * stretch[p, j])
        for g in range(groups):
            if p > 0 and base[g, p] != base[g, p - 1]:
                known_span = -1.0
            for i in range(ORDER):
                if poly[p, 1 + 3 * g, i] != 0.0 or poly[p, 2 + 3 * g, i] != 0.0:
                    constant = False
        span = 2.0 / steps[p]
        one = alone[p]
        for i in range(size):
            for j in range(cols):
                one[i, j] = 1.0 if i == j else 0.0
        # where all is constant every step has the same propagator, and the same response to a power of x
        new = not constant or abs(span * length - known_span) > 1e-13 * known_span
        if constant and new:
            known_span = span * length
            known_steps = 0
            for i in range(size):
                for j in range(many):
                    known[i, j] = 1.0 if i == j else 0.0
        fresh = steps[p] != known_steps
        if constant:
            known_steps = steps[p]
        into = plain if constant else terms
        for step in range(steps[p]):
            origin = -1.0 + span * step
            for q in range(1 + 3 * groups):
                shifted(poly[p, q], origin, span, local[q])
                if graded:
                    for i in range(ORDER):
                        local[q, i] *= span
            if new:
                used = series(
                    known if constant else one, matrices[p], damping, left, right, local, span * length, moving, graded,
                    _EXACT if constant else _CLOSE, into, room,
                )  # fmt: skip
                new = not constant
            if forced:
                for j in range(ORDER):
                    x = (nodes[j] - origin) / span
                    if x < -1e-9 or x > 1.0 + 1e-9:
                        continue
                    for i in range(2 * groups):
                        at = size + 2 * groups * j + i
                        out = rows[i % groups, i // groups, p, j]
                        if fresh or not constant:
                            evaluate(into, used, size + i, x, known[at] if constant else out)
                        if constant:
                            through(known[at], one, local, out)
            if constant:
                for i in range(size):
                    through(known[i], one, local, product[i])
                for i in range(size):
                    for j in range(cols):
                        one[i, j] = product[i, j]
        advance(total, one, left, right, kick, p, product)


@kernel(fastmath=FAST)
def advance(total, one, left, right, kick, p, product):
    """Take the state `total` past the kicks at the beginning of panel p and the panel's own propagator."""
    size = one.shape[0]
    n = size // 2
    cols = total.shape[1]
    for g in range(left.shape[0]):
        if kick[g, p] != 0.0:
            for j in range(cols):
                a = 0.0
                for i in range(n):
                    a += right[g, i] * total[i, j]
                a *= kick[g, p]
                for i in range(n):
                    total[n + i, j] -= left[g, i] * a
    for i in range(size):
        for j in range(cols):
            product[i, j] = one[i, j] if j >= size else 0.0
        for q in range(size):
            f = one[i, q]
            for j in range(cols):
                product[i, j] += f * total[q, j]
    for i in range(size):
        for j in range(cols):
            total[i, j] = product[i, j]


@kernel()
def respond(start, alone, rows):
    """right_g^T d, right_g^T d' at the nodes (G, 2, N) of the response that begins with the state `start` (2 n,)."""
    groups, _, count, m, cols = rows.shape
    out = np.zeros((groups, 2, count * (m - 1) + 1))
    size = cols - 1
    state = np.empty(size)
    follow = np.empty(size)
    for i in range(size):
        state[i] = start[i]
    for p in range(count):
        for g in range(groups):
            for part in range(2):
                for j in range(m):
                    a = rows[g, part, p, j, cols - 1]
                    for i in range(cols - 1):
                        a += rows[g, part, p, j, i] * state[i]
                    out[g, part, p * (m - 1) + j] = a
        for i in range(cols - 1):
            a = alone[p, i, cols - 1]
            for j in range(cols - 1):
                a += alone[p, i, j] * state[j]
            follow[i] = a
        for i in range(size):
            state[i] = follow[i]
    return out
