"""Compiled kernels for several degrees of freedom, on the panels of `panels`.

    y'' + C(t) y' + K(t) y = - sum_g left_g r_g(t),   K(t) = K_0 + sum_g k_g(t) left_g right_g^T,   C(t) likewise

with y in DOFs weighted by the square roots of their masses. On a panel dt/ds, k_g, c_g and r_g are polynomials, and the
solution is summed as a power series in s, whose coefficients follow from each other; the elements enter as products of
rank one, so that a term costs hardly more than with constant matrices. Series converge for any length; panels are taken
in steps short enough for rounding not to grow.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from suboctave.stability.panels import NODES, ORDER

#: from values at the nodes to coefficients of powers of s
POWERS = np.linalg.inv(np.vander(NODES, increasing=True))
#: length of a step in units of the fastest time scale, and the most terms of a series
_REACH, _TERMS = 2.5, 48
#: size up to which plain loops beat the overhead of BLAS
_SMALL = 16


@njit(cache=True)
def _subtract_product(a, b, out, first):
    """`out -= a b`, columns from `first`."""
    n = a.shape[0]
    if n > _SMALL:
        out[:, first:] -= np.dot(a, np.ascontiguousarray(b[:, first:]))
        return
    for i in range(n):
        for k in range(n):
            f = a[i, k]
            if f != 0.0:
                for j in range(first, b.shape[1]):
                    out[i, j] -= f * b[k, j]


@njit(cache=True)
def _shifted(coefficients, origin, length, out):
    """Coefficients of `p(origin + length x)` in powers of x."""
    m = coefficients.shape[0]
    for i in range(m):
        out[i] = coefficients[i]
    for i in range(m):
        for j in range(m - 2, i - 1, -1):
            out[j] += origin * out[j + 1]
    f = 1.0
    for i in range(m):
        out[i] *= f
        f *= length


@njit(cache=True)
def _norm(a):
    """Largest sum of moduli along a row."""
    size = 0.0
    for i in range(a.shape[0]):
        row = 0.0
        for j in range(a.shape[1]):
            row += abs(a[i, j])
        size = max(size, row)
    return size


@njit(cache=True)
def monodromy_several(stretch, scale, stiffness, damping, left, right, base, k, c, force, kick, powers, nodes):
    """Monodromy matrix and, where there is a force, what `respond_several` needs.

    stretch: dtau/ds (P, m); scale: dt/dtau; stiffness, damping: K_0, C_0 (n, n); left, right (G, n); base (G, P): parts
    of k_g that are constant on every panel; k (G, N): the others at the nodes; c (G, N) or (G, 0): c_g; force (G, N) or
    (G, 0): r_g; kick (G, P): impulses `-kick left right^T y` at the beginning of panels. Returns

    - the state (y, y') after the period (2 n, 2 n + 1): one column per initial condition, and the one from rest with
      the force,
    - the same for every panel alone (P, 2 n, 2 n + 1),
    - right_g^T y, right_g^T y' at the nodes of every panel for these columns (G, 2, P, m, 2 n + 1).
    """
    count, m = stretch.shape
    groups, n = left.shape
    forced = force.shape[1] > 0
    moving = c.shape[1] > 0
    cols = 2 * n + 1
    total = np.zeros((2 * n, cols))
    for i in range(2 * n):
        total[i, i] = 1.0
    alone = np.zeros((count if forced else 1, 2 * n, cols))
    rows = np.zeros((groups, 2, count, m, cols) if forced else (0, 2, 1, m, cols))
    one = np.zeros((2 * n, cols))
    y = np.zeros((_TERMS + 1, n, cols))
    w = np.zeros((_TERMS + 1, n, cols))
    ry = np.zeros((groups, _TERMS + 1, cols))
    rw = np.zeros((groups, _TERMS + 1, cols))
    matrix = stiffness.copy()
    stretched = np.zeros((n, cols))
    current = np.full(groups, np.nan)
    poly = np.zeros((1 + 3 * groups, m))
    local = np.zeros((1 + 3 * groups, m))
    sizes = np.zeros((groups, 2))
    same = False
    size_c = _norm(damping)
    size_k = 0.0
    last_length = -1.0
    terms = 0
    product = np.zeros((2 * n, cols))
    for p in range(count):
        at = p * (m - 1)
        even = True
        for j in range(1, m):
            even = even and stretch[p, j] == stretch[p, 0]
        changed = False
        for g in range(groups):
            changed = changed or base[g, p] != current[g]
        if changed:
            matrix[:] = stiffness
            for g in range(groups):
                current[g] = base[g, p]
                for i in range(n):
                    for j in range(n):
                        matrix[i, j] += base[g, p] * left[g, i] * right[g, j]
            size_k = _norm(matrix)
        # the polynomials: dt/ds, then k, c, r of every direction, all times dt/ds
        constant = even
        length = 0.0
        for j in range(m):
            length = max(length, scale * stretch[p, j])
        for g in range(groups):
            top_k = top_c = 0.0
            for j in range(m):
                top_k = max(top_k, abs(k[g, at + j]))
                if moving:
                    top_c = max(top_c, abs(c[g, at + j]))
            sizes[g, 0] = top_k
            sizes[g, 1] = top_c
            constant = constant and top_k == 0.0 and top_c == 0.0
        for i in range(m):
            poly[0, i] = 0.0
            if even:
                poly[0, i] = scale * stretch[p, 0] if i == 0 else 0.0
            else:
                for j in range(m):
                    poly[0, i] += powers[i, j] * scale * stretch[p, j]
            for g in range(groups):
                pk = pc = pf = 0.0
                for j in range(m):
                    f = powers[i, j] * scale * stretch[p, j]
                    pk += f * k[g, at + j]
                    if moving:
                        pc += f * c[g, at + j]
                    if forced:
                        pf += f * force[g, at + j]
                poly[1 + 3 * g, i] = pk
                poly[2 + 3 * g, i] = pc
                poly[3 + 3 * g, i] = pf
        reuse = same and constant and not changed and abs(length - last_length) <= 1e-14 * length
        same = constant
        last_length = length
        first = 2 * n if reuse else 0
        if not (reuse and not forced):
            rate_k = size_k
            rate_c = size_c
            for g in range(groups):
                if sizes[g, 0] > 0.0 or sizes[g, 1] > 0.0:
                    reach_l = np.abs(left[g]).max()
                    reach_r = np.abs(right[g]).sum()
                    rate_k += sizes[g, 0] * reach_l * reach_r
                    rate_c += sizes[g, 1] * reach_l * reach_r
            rate = math.sqrt(rate_k) + rate_c
            steps = max(1, math.ceil(rate * 2.0 * length / _REACH))
            for i in range(2 * n):
                for j in range(first, cols):
                    one[i, j] = 1.0 if i == j else 0.0
            for step in range(steps):
                origin = -1.0 + 2.0 * step / steps
                span = 2.0 / steps
                for q in range(1 + 3 * groups):
                    _shifted(poly[q], origin, span, local[q])
                    for i in range(m):
                        local[q, i] *= span
                for i in range(n):
                    for j in range(first, cols):
                        y[0, i, j] = one[i, j]
                        w[0, i, j] = one[n + i, j]
                degree = 0 if even else m - 1
                used = 0
                for order in range(_TERMS):
                    used = order
                    for g in range(groups):
                        for j in range(first, cols):
                            a = b = 0.0
                            for i in range(n):
                                a += right[g, i] * y[order, i, j]
                                b += right[g, i] * w[order, i, j]
                            ry[g, order, j] = a
                            rw[g, order, j] = b
                    # dt/ds y' and dt/ds y at this order
                    fy = y[order + 1]
                    fw = w[order + 1]
                    for i in range(n):
                        for j in range(first, cols):
                            fy[i, j] = local[0, 0] * w[order, i, j]
                            stretched[i, j] = local[0, 0] * y[order, i, j]
                            fw[i, j] = 0.0
                        for q in range(1, min(order, degree) + 1):
                            f = local[0, q]
                            for j in range(first, cols):
                                fy[i, j] += f * w[order - q, i, j]
                                stretched[i, j] += f * y[order - q, i, j]
                    _subtract_product(matrix, stretched, fw, first)
                    _subtract_product(damping, fy, fw, first)
                    for g in range(groups):
                        if sizes[g, 0] == 0.0 and sizes[g, 1] == 0.0 and not forced:
                            continue
                        for j in range(first, cols):
                            a = 0.0
                            for q in range(min(order, m - 1) + 1):
                                a += local[1 + 3 * g, q] * ry[g, order - q, j]
                                if moving:
                                    a += local[2 + 3 * g, q] * rw[g, order - q, j]
                            if forced and j == 2 * n and order < m:
                                a += local[3 + 3 * g, order]
                            for i in range(n):
                                fw[i, j] -= left[g, i] * a
                    f = 1.0 / (order + 1)
                    term = 0.0
                    for i in range(n):
                        for j in range(first, cols):
                            fy[i, j] *= f
                            fw[i, j] *= f
                            one[i, j] += fy[i, j]
                            one[n + i, j] += fw[i, j]
                            term = max(term, abs(fy[i, j]) * rate, abs(fw[i, j]))
                    # the force alone tells nothing of when to stop: as many terms as for the same step before
                    if order >= m and (term < 1e-16 * min(1.0, rate) if first == 0 else order >= terms):
                        break
                terms = max(used, terms) if first > 0 or step > 0 else used
                if forced:
                    for j in range(m):
                        x = (nodes[j] - origin) / span
                        if x < -1e-9 or x > 1.0 + 1e-9:
                            continue
                        for g in range(groups):
                            for i in range(first, cols):
                                a = b = 0.0
                                for order in range(used, -1, -1):
                                    a = a * x + ry[g, order, i]
                                    b = b * x + rw[g, order, i]
                                rows[g, 0, p, j, i] = a
                                rows[g, 1, p, j, i] = b
        if forced:
            if reuse:
                for g in range(groups):
                    rows[g, :, p, :, : 2 * n] = rows[g, :, p - 1, :, : 2 * n]
            alone[p] = one
        for g in range(groups):
            if kick[g, p] != 0.0:
                for j in range(cols):
                    a = 0.0
                    for i in range(n):
                        a += right[g, i] * total[i, j]
                    for i in range(n):
                        total[n + i, j] -= kick[g, p] * left[g, i] * a
        product[:] = 0.0
        for i in range(2 * n):
            for q in range(2 * n):
                f = one[i, q]
                for j in range(cols):
                    product[i, j] += f * total[q, j]
            product[i, 2 * n] += one[i, 2 * n]
        total[:] = product
    return total, alone, rows


@njit(cache=True)
def respond_several(start, alone, rows):
    """right_g^T d, right_g^T d' at the nodes (G, 2, N) of the response to the force that begins with the state `start`
    (2 n,).
    """
    groups, _, count, m, cols = rows.shape
    out = np.zeros((groups, 2, count * (m - 1) + 1))
    state = start.copy()
    follow = np.empty_like(state)
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
        state[:] = follow
    return out
