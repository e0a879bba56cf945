"""The linearised motion over one period, by collocation at the nodes of a time mesh.

In modes of the linear part elements are channels: they read one direction of the motion and act along one,

    y'' + C y' + K y = - sum_g left_g F_g,    F_g = k_g q_g + c_g q_g' + r_g,    q_g = right_g^T y.

On a panel y'' is the polynomial through its values at the Lobatto nodes. With `T = S diag(dt/ds)`, S the matrix that
integrates such polynomials from the panel's beginning to its nodes, `y' = y'_0 + T y''` and `y = y_0 + T y'`: the
collocation method Lobatto IIIA, of order 12 at the panel's end and without damping of its own (Hairer & Wanner, Solving
Ordinary Differential Equations II, section IV.5). It is solved in two steps. `structure` has what the linear part makes
of a panel's initial state and of forces at its nodes: the same on all panels of one length. `propagate` then solves for
the forces, on each panel a system as large as there are channels and nodes.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel

#: sums may be reordered; infinities keep their meaning
_FAST = {"reassoc", "contract", "nsz"}


@kernel(fastmath=_FAST, error_model="numpy")
def eliminate(a, b):
    """Solve `a x = b` for the columns of b, in place, by Gauss's elimination with pivots; zeros cost nothing."""
    n = a.shape[0]
    columns = b.shape[1]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            for j in range(columns):
                b[k, j], b[best, j] = b[best, j], b[k, j]
        for i in range(k + 1, n):
            if a[i, k] != 0.0:
                f = a[i, k] / a[k, k]
                for j in range(k + 1, n):
                    a[i, j] -= f * a[k, j]
                for j in range(columns):
                    b[i, j] -= f * b[k, j]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            if a[i, k] != 0.0:
                for j in range(columns):
                    b[i, j] -= a[i, k] * b[k, j]
        for j in range(columns):
            b[i, j] /= a[i, i]


@kernel(fastmath=_FAST, error_model="numpy")
def structure(spans, integration, adjoint, stiffness, damping, left, right):
    """What the linear part makes of initial states and forces, on panels with dt/ds = spans (P, m).

    Returns which kind each panel is, (P,), a panel like the one before being of the same kind, and for each kind the
    matrix (2 G m + 2 n, 2 n + G m) from y_0, y'_0 and the forces F_g at the nodes to q_g, then q_g' at the nodes, and
    to y, y' at the panel's end.
    """
    kinds = np.zeros(spans.shape[0], dtype=np.int64)
    for p in range(1, spans.shape[0]):
        kinds[p] = kinds[p - 1]
        for j in range(spans.shape[1]):
            if abs(spans[p, j] - spans[p - 1, j]) > 1e-12 * spans[p, j]:
                kinds[p] = kinds[p - 1] + 1
                break
    groups, n = left.shape
    m = integration.shape[0]
    size, forces = 2 * n, groups * m
    columns = size + forces
    out = np.zeros((kinds[-1] + 1, 2 * forces + size, columns))
    for p in range(spans.shape[0]):
        d = kinds[p]
        if p > 0 and d == kinds[p - 1]:
            continue
        once = integration * spans[p]
        rate = adjoint * spans[p]
        twice = once @ rate
        time = once.sum(axis=1)
        # unknowns are the accelerations, mode by mode
        a = np.eye(n * m)
        b = np.zeros((n * m, columns))
        for i in range(n):
            for k in range(n):
                for j in range(m):
                    b[i * m + j, k] = -stiffness[i, k]
                    b[i * m + j, n + k] = -damping[i, k] - stiffness[i, k] * time[j]
                    for l in range(m):
                        a[i * m + j, k * m + l] += damping[i, k] * rate[j, l] + stiffness[i, k] * twice[j, l]
            for g in range(groups):
                for j in range(m):
                    b[i * m + j, size + g * m + j] = -left[g, i]
        eliminate(a, b)
        for i in range(n):
            y = twice @ b[i * m : i * m + m]
            v = rate @ b[i * m : i * m + m]
            for j in range(m):
                y[j, i] += 1.0
                y[j, n + i] += time[j]
                v[j, n + i] += 1.0
            for g in range(groups):
                if right[g, i] != 0.0:
                    for j in range(m):
                        for l in range(columns):
                            out[d, g * m + j, l] += right[g, i] * y[j, l]
                            out[d, forces + g * m + j, l] += right[g, i] * v[j, l]
            out[d, 2 * forces + i] = y[m - 1]
            for j in range(m):
                for l in range(columns):
                    out[d, 2 * forces + n + i, l] += once[m - 1, j] * b[i * m + j, l]
            out[d, 2 * forces + n + i, n + i] += 1.0
    return kinds, out


@kernel(fastmath=_FAST, error_model="numpy")
def _add_product(a, b, out):
    """Add the matrix product a b to out; zeros of a cost nothing."""
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            f = a[i, k]
            if f != 0.0:
                for j in range(b.shape[1]):
                    out[i, j] += f * b[k, j]


@kernel(fastmath=_FAST, error_model="numpy")
def propagate(kinds, structures, k, c, r, kick, left, right):
    """The state (y, y') after one period, (2 n, cols), and q_g, q_g' at the nodes of all panels, (P, 2 G m, cols).

    kinds (P,), structures (D, ., .): see `structure`; k, c (G, P, m): stiffness and damping of the channels at the
    nodes; r (G, P, m) or (0, 0, 0): their forces; kick (G, P): impulses `-kick left right^T y` at the beginnings of
    panels. The first 2 n columns begin with the unit vectors; with forces there is one more, which begins at rest and
    is the only one to feel them. Without forces nothing is kept of the nodes.
    """
    groups, panels, m = k.shape
    n = left.shape[1]
    size, forces = 2 * n, groups * m
    forced = r.shape[0] > 0
    columns = size + 1 if forced else size
    total = np.eye(size, columns)
    nodes = np.empty((panels if forced else 0, 2 * forces, columns))
    a = np.empty((forces, forces))
    f = np.empty((forces, columns))
    free = np.empty((2 * forces, columns))
    end = np.empty((size, columns))
    for p in range(panels):
        for g in range(groups):
            if kick[g, p] != 0.0:
                for j in range(columns):
                    q = 0.0
                    for i in range(n):
                        q += right[g, i] * total[i, j]
                    for i in range(n):
                        total[n + i, j] -= kick[g, p] * q * left[g, i]
        one = structures[kinds[p]]
        free[:] = 0.0
        _add_product(one[: 2 * forces, :size], total, free)
        for row in range(forces):
            g, j = row // m, row % m
            for l in range(forces):
                a[row, l] = -k[g, p, j] * one[row, size + l] - c[g, p, j] * one[forces + row, size + l]
            a[row, row] += 1.0
            for l in range(columns):
                f[row, l] = k[g, p, j] * free[row, l] + c[g, p, j] * free[forces + row, l]
            if forced:
                f[row, size] += r[g, p, j]
        eliminate(a, f)
        if forced:
            _add_product(one[: 2 * forces, size:], f, free)
            nodes[p] = free
        end[:] = 0.0
        _add_product(one[2 * forces :, :size], total, end)
        _add_product(one[2 * forces :, size:], f, end)
        total[:] = end
    return total, nodes


@kernel()
def on_panels(values, active, panels):
    """Values (G, N) at the nodes of the period, on every panel, for the active channels: (A, P, m)."""
    m = (values.shape[1] - 1) // panels + 1
    out = np.empty((active.shape[0], panels, m))
    for g in range(active.shape[0]):
        for p in range(panels):
            for j in range(m):
                out[g, p, j] = values[active[g], p * (m - 1) + j]
    return out


@kernel()
def growth(spans, weights, k, c, stiffness, damping, shares):
    """Length of every panel in units of the fastest time scale, (P,).

    weights: of the quadrature; k, c (G, P, m): of the channels; stiffness, damping: norms of those of the linear part;
    shares (G,): what k or c of one adds to them.
    """
    out = np.empty(spans.shape[0])
    for p in range(spans.shape[0]):
        a, b, length = stiffness, damping, 0.0
        for j in range(weights.shape[0]):
            length += weights[j] * spans[p, j]
        for g in range(shares.shape[0]):
            a += shares[g] * np.abs(k[g, p]).max()
            b += shares[g] * np.abs(c[g, p]).max()
        out[p] = length * (math.sqrt(a) + b)
    return out


@kernel()
def response(start, nodes, active, channels):
    """q_g, q_g' at the nodes along all channels, (channels, 2, N), of the response that begins with the state `start`.

    nodes: see `propagate`; active (G,): its channels among all.
    """
    panels, rows, columns = nodes.shape
    m = rows // (2 * max(1, active.shape[0]))
    out = np.zeros((channels, 2, panels * (m - 1) + 1))
    for p in range(panels):
        for row in range(rows):
            a = nodes[p, row, columns - 1]
            for i in range(columns - 1):
                a += nodes[p, row, i] * start[i]
            part, g = row // (m * active.shape[0]), row // m % active.shape[0]
            out[active[g], part, p * (m - 1) + row % m] = a
    return out


@kernel()
def shifts(imaginary, left, right, phi, change, rounding):
    """First-order shifts of eigenvalues of phi (N, N) by a change, and by relative rounding errors of its entries.

    imaginary (N,), left, right (N, N): as LAPACK's geev has them, conjugate vectors as real and imaginary parts.
    """
    size = phi.shape[0]
    out = np.empty(size)
    for first in range(size):
        j = first
        if imaginary[j] < 0.0:
            out[j] = out[j - 1]
            continue
        more = j + 1 if imaginary[j] > 0.0 else j
        u = left[:, j] + (0.0 if more == j else 1.0j) * left[:, more]
        v = right[:, j] + (0.0 if more == j else 1.0j) * right[:, more]
        by_change = 0.0j
        by_rounding = 0.0
        scale = 0.0j
        for i in range(size):
            changed = 0.0j
            rounded = 0.0
            for q in range(size):
                changed += change[i, q] * v[q]
                rounded += abs(phi[i, q]) * abs(v[q])
            scale += u[i].conjugate() * v[i]
            by_change += u[i].conjugate() * changed
            by_rounding += abs(u[i]) * rounded
        out[j] = (abs(by_change) + rounding * by_rounding) / abs(scale) if abs(scale) > 0.0 else np.inf
    return out
