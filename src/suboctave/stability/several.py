"""Compiled kernels for several degrees of freedom, on the panels of `panels`.

    y'' + C(t) y' + K(t) y = - sum_g left_g r_g(t),   K(t) = K_0 + sum_g k_g(t) left_g right_g^T,   C(t) likewise

with y in DOFs weighted by the square roots of their masses, so that norms have no units. On a panel dt/ds, k_g, c_g and
r_g are polynomials, and the solution is summed as a power series in s, whose coefficients follow from each other; the
elements enter as products of rank one, so that a term costs hardly more than with constant matrices. Series converge
for any length; panels are taken in steps short enough for rounding not to grow.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
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


@kernel()
def propagate(stretch, scale, stiffness, damping, left, right, base, k, c, force, kick, powers, nodes):
    """Monodromy matrix and, where there is a force, what `_respond` needs.

    stretch: dtau/ds (P, m); scale: dt/dtau; stiffness, damping: K_0, C_0 (n, n); left, right (G, n); base (G, P): parts
    of k_g that are constant on every panel; k (G, N) or (G, 0): the others at the nodes; c (G, N) or (G, 0): c_g; force
    (G, N) or (G, 0): r_g; kick (G, P): impulses `-kick left right^T y` at the beginnings of panels. Returns

    - the state (y, y') after the period (2 n, cols): one column per initial condition, with a force one more,
    - the same for every panel alone (P, 2 n, cols),
    - right_g^T y, right_g^T y' at the nodes of every panel for these columns (G, 2, P, m, cols).
    """
    count = stretch.shape[0]
    groups, n = left.shape
    forced = force.shape[1] > 0
    moving = c.shape[1] > 0
    varying = k.shape[1] > 0
    size = 2 * n
    cols = size + 1 if forced else size
    total = np.zeros((size, cols))
    for i in range(size):
        total[i, i] = 1.0
    alone = np.empty((count, size, cols))
    rows = np.zeros((groups, 2, count, ORDER, cols) if forced else (0, 2, 1, ORDER, cols))
    # terms of the series, and those where all is constant
    y = np.zeros((PAST + TERMS, n * cols))
    w = np.zeros((PAST + TERMS, n * cols))
    ry = np.zeros((PAST + TERMS, groups * cols))
    rw = np.zeros((PAST + TERMS, groups * cols))
    many = size + groups * ORDER if forced else size
    hy = np.zeros((PAST + TERMS, groups * many))
    hw = np.zeros((PAST + TERMS, groups * many))
    hall = np.zeros((2, PAST + TERMS, n * many))
    step_matrix = np.empty((size, many))
    at_nodes = np.empty((ORDER, groups, 2, many))
    product = np.empty((size, cols))
    known = known_steps = 0
    matrix = np.empty((n, n))
    current = np.zeros(groups)
    poly = np.zeros((1 + 3 * groups, ORDER))
    local = np.zeros((1 + 3 * groups, ORDER))
    active = np.zeros(groups, dtype=np.bool_)
    size_c = norm(damping)
    size_k = known_span = -1.0
    shares = np.empty(groups)
    for g in range(groups):
        top = whole = 0.0
        for i in range(n):
            top = max(top, abs(left[g, i]))
            whole += abs(right[g, i])
        shares[g] = top * whole
    for p in range(count):
        at = p * (ORDER - 1)
        changed = size_k < 0.0
        for g in range(groups):
            changed = changed or base[g, p] != current[g]
        if changed:
            known_span = -1.0
            for i in range(n):
                for j in range(n):
                    matrix[i, j] = stiffness[i, j]
            for g in range(groups):
                current[g] = base[g, p]
                for i in range(n):
                    for j in range(n):
                        matrix[i, j] += base[g, p] * left[g, i] * right[g, j]
            size_k = norm(matrix)
        graded = stretch[p, 0] != stretch[p, ORDER - 1]
        length = 0.0
        for j in range(ORDER):
            length = max(length, scale * stretch[p, j])
        constant = not graded
        for g in range(groups):
            top_k = top_c = 0.0
            for j in range(ORDER):
                if varying:
                    top_k = max(top_k, abs(k[g, at + j]))
                if moving:
                    top_c = max(top_c, abs(c[g, at + j]))
            active[g] = top_k > 0.0 or top_c > 0.0
            if active[g]:
                constant = False
        for i in range(ORDER):
            for q in range(1 + 3 * groups):
                poly[q, i] = 0.0
            for j in range(ORDER):
                f = powers[i, j]
                if graded:
                    f *= scale * stretch[p, j]
                    poly[0, i] += f
                for g in range(groups):
                    if active[g]:
                        poly[1 + 3 * g, i] += f * k[g, at + j]
                        if moving:
                            poly[2 + 3 * g, i] += f * c[g, at + j]
                    if forced:
                        poly[3 + 3 * g, i] += f * force[g, at + j]
        # the series converges anyhow, but on the way to the last digits its terms should not become large
        most = _REACH if constant else 2.0 * _REACH
        steps = max(1, math.ceil((math.sqrt(size_k) + size_c) * 2.0 * length / most))
        while (
            not constant
            and steps < _MOST
            and growth(poly, local, 2.0 / steps, steps, length, graded, size_k, size_c, shares) > most
        ):
            steps += 1 + steps // 8
        span = 2.0 / steps
        one = alone[p]
        for i in range(size):
            for j in range(cols):
                one[i, j] = 1.0 if i == j else 0.0
        if constant and abs(span * length - known_span) > 1e-13 * known_span:
            # every step has the same propagator, and the same response to a power of x
            known_span = span * length
            known_steps = 0
            for i in range(size):
                for j in range(many):
                    step_matrix[i, j] = 1.0 if i == j else 0.0
            known = series(
                step_matrix, matrix, damping, left, right, local, known_span, active, moving, False, _EXACT,
                hall[0], hall[1], hy, hw,
            )  # fmt: skip
        fresh = steps != known_steps
        if constant:
            known_steps = steps
        for step in range(steps):
            origin = -1.0 + span * step
            for q in range(1 + 3 * groups):
                shifted(poly[q], origin, span, local[q])
                if graded:
                    for i in range(ORDER):
                        local[q, i] *= span
            used = 0
            if not constant:
                used = series(
                    one, matrix, damping, left, right, local, span * length, active, moving, graded, _CLOSE,
                    y, w, ry, rw,
                )  # fmt: skip
            if forced:
                for j in range(ORDER):
                    x = (nodes[j] - origin) / span
                    if x < -1e-9 or x > 1.0 + 1e-9:
                        continue
                    for g in range(groups):
                        for part in range(2):
                            into = rows[g, part, p, j]
                            if not constant:
                                evaluate(ry if part == 0 else rw, used, g, cols, x, into)
                                continue
                            row = at_nodes[j, g, part]
                            if fresh:
                                evaluate(hy if part == 0 else hw, known, g, many, x, row)
                            through(row, one, local, into)
            if constant:
                for i in range(size):
                    through(step_matrix[i], one, local, product[i])
                for i in range(size):
                    for j in range(cols):
                        one[i, j] = product[i, j]
        advance(total, one, left, right, kick, p, product)
    return total, alone, rows


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
