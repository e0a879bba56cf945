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
from suboctave.floquet.time_mesh import ADJOINT, INTEGRATION, LOWER, ORDER, WEIGHTS

#: sums may be reordered; infinities keep their meaning
_FAST = {"reassoc", "contract", "nsz"}
#: relative errors of the entries of a monodromy matrix by rounding
_ROUNDING = 1e-15
_TINY = float(np.finfo(float).tiny)


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
def _product(a, b, kept, out):
    """The matrix product a b and a share `kept` of out, into out; zeros of a cost nothing."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = kept * out[i, j] if kept != 0.0 else 0.0
        for k in range(a.shape[1]):
            f = a[i, k]
            if f != 0.0:
                for j in range(b.shape[1]):
                    out[i, j] += f * b[k, j]


@kernel(fastmath=_FAST, error_model="numpy")
def structure(spans, stiffness, damping, left, right):
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
    m = ORDER
    size, forces = 2 * n, groups * m
    columns = size + forces
    out = np.zeros((kinds[-1] + 1, 2 * forces + size, columns))
    once, rate, twice = np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    y, v = np.empty((m, columns)), np.empty((m, columns))
    for p in range(spans.shape[0]):
        d = kinds[p]
        if p > 0 and d == kinds[p - 1]:
            continue
        time = np.zeros(m)
        for j in range(m):
            for l in range(m):
                once[j, l], rate[j, l] = INTEGRATION[j, l] * spans[p, l], ADJOINT[j, l] * spans[p, l]
                time[j] += once[j, l]
        _product(once, rate, 0.0, twice)
        # unknowns are the accelerations, mode by mode
        a, b = np.zeros((n * m, n * m)), np.zeros((n * m, columns))
        for i in range(n * m):
            a[i, i] = 1.0
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
            _product(twice, b[i * m : i * m + m], 0.0, y)
            _product(rate, b[i * m : i * m + m], 0.0, v)
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
            for l in range(columns):
                out[d, 2 * forces + i, l] = y[m - 1, l]
            for j in range(m):
                for l in range(columns):
                    out[d, 2 * forces + n + i, l] += once[m - 1, j] * b[i * m + j, l]
            out[d, 2 * forces + n + i, n + i] += 1.0
    return kinds, out


@kernel(fastmath=_FAST, error_model="numpy")
def propagate(kinds, structures, law, base, kick, active, left, right, monodromy, start, nodes):
    """Along the panels of one period, into arrays: the monodromy matrix (2 n, 2 n), the state in which the periodic
    response to the forces begins, (2 n, 1), and q_g, q_g' at the nodes of all panels, (P, 2 G m, 2 n + 1).

    kinds (P,), structures (D, ., .): see `structure`; law (C, >= 3, N): forces, stiffness and damping of all channels
    at the nodes of the period; base (C, P): what is added to the stiffness on every panel; kick (C, P): impulses
    `-kick left right^T y` at the beginnings of panels; active (G,): the channels that act.

    With forces laws are polynomials of lower degree on panels, and the nodes have one column for every initial state
    and one for the forces; where `nodes` is empty there are none, and no periodic response.
    """
    groups, panels, m, forced = active.shape[0], kinds.shape[0], ORDER, nodes.shape[0] > 0
    n = left.shape[1]
    size, forces = 2 * n, groups * m
    columns = size + 1 if forced else size
    total, closing = np.zeros((size, columns)), np.zeros((size, size))
    for i in range(size):
        total[i, i] = closing[i, i] = 1.0
    values, lower = np.empty((3, forces)), np.empty((3, forces))
    a = np.empty((forces, forces))
    f = np.empty((forces, columns))
    free = np.empty((2 * forces, columns))
    end = np.empty((size, columns))
    for p in range(panels):
        for g in range(groups):
            channel, at = active[g], p * (m - 1)
            if kick[channel, p] != 0.0:
                for j in range(columns):
                    q = 0.0
                    for i in range(n):
                        q += right[g, i] * total[i, j]
                    for i in range(n):
                        total[n + i, j] -= kick[channel, p] * q * left[g, i]
            for j in range(m):
                for part in range(3):
                    values[part, g * m + j] = law[channel, part, at + j]
                values[1, g * m + j] += base[channel, p]
        if forced:
            for row in range(forces):
                g, j = row // m, row % m
                for part in range(3):
                    value = 0.0
                    for i in range(m):
                        value += values[part, g * m + i] * LOWER[i, j]
                    lower[part, row] = value
            values, lower = lower, values
        r, k, c = values[0], values[1], values[2]
        one = structures[kinds[p]]
        _product(one[: 2 * forces, :size], total, 0.0, free)
        for row in range(forces):
            for l in range(forces):
                a[row, l] = -k[row] * one[row, size + l] - c[row] * one[forces + row, size + l]
            a[row, row] += 1.0
            for l in range(columns):
                f[row, l] = k[row] * free[row, l] + c[row] * free[forces + row, l]
            if forced:
                f[row, size] += r[row]
        eliminate(a, f)
        if forced:
            _product(one[: 2 * forces, size:], f, 1.0, free)
            for row in range(2 * forces):
                for l in range(columns):
                    nodes[p, row, l] = free[row, l]
        _product(one[2 * forces :, :size], total, 0.0, end)
        _product(one[2 * forces :, size:], f, 1.0, end)
        total, end = end, total
    for i in range(size):
        for j in range(size):
            monodromy[i, j] = total[i, j]
            closing[i, j] -= total[i, j]
        if forced:
            start[i, 0] = total[i, size]
    if forced:
        eliminate(closing, start)


@kernel()
def parts_needed(spans, law, base, active, stiffness, damping, shares, longest):
    """Into how many parts panels with dt/ds = spans (P, m) have to be cut, (P,), and how many there are then, a float.

    law, base, active: see `propagate`; stiffness, damping: norms of those of the linear part; shares (G,): what k or c
    of one channel adds to them; longest: length of a part in units of the fastest time scale.
    """
    panels, m = spans.shape
    parts, total = np.ones(panels, dtype=np.int64), 0.0
    for p in range(panels):
        a, b, length = stiffness, damping, 0.0
        for j in range(m):
            length += WEIGHTS[j] * spans[p, j]
        for g in range(active.shape[0]):
            channel = active[g]
            k = c = 0.0
            for j in range(p * (m - 1), p * (m - 1) + m):
                k = max(k, abs(law[channel, 1, j] + base[channel, p]))
                c = max(c, abs(law[channel, 2, j]))
            a += shares[g] * k
            b += shares[g] * c
        wanted = math.ceil(length * (math.sqrt(a) + b) / longest)
        total += wanted
        # no more than a number of parts: beyond a million nothing is cut
        parts[p] = int(min(wanted, 1e6)) if wanted >= 1.0 else 1
    return parts, total


@kernel()
def response(start, nodes, active, path, largest, out):
    """q_g, q_g' at the nodes along all channels into `out` (C, 2, N), which is zero, of the response that begins with
    the state `start`; returns the share of it that is left: none is larger than `largest` times the displacement.

    nodes: see `propagate`; path (C, 2, N): the motion along all channels; active (G,): those that act.
    """
    groups, m, last = active.shape[0], ORDER, nodes.shape[2] - 1
    worst = 0.0
    for g in range(groups):
        channel, size, limit = active[g], 0.0, _TINY
        for p in range(nodes.shape[0]):
            for j in range(m):
                # the last node of a panel is the first of the next
                at = p * (m - 1) + j
                for part in range(2):
                    row = (part * groups + g) * m + j
                    value = nodes[p, row, last]
                    for i in range(last):
                        value += nodes[p, row, i] * start[i]
                    out[channel, part, at] = value
                size = max(size, abs(out[channel, 0, at])) if out[channel, 0, at] == out[channel, 0, at] else np.inf
                limit = max(limit, largest * abs(path[channel, 0, at]))
        worst = max(worst, size / limit)
    share = 1.0 if worst <= 1.0 else 1.0 / worst
    if share < 1.0:
        for channel in active:
            for part in range(2):
                for at in range(path.shape[2]):
                    # one that is not finite is left out
                    out[channel, part, at] = out[channel, part, at] * share if share > 0.0 else 0.0
    return share


@kernel()
def multipliers_and_shifts(real, imaginary, left, right, phi, before, mu, moved):
    """Eigenvalues of phi (N, N) by descending modulus into `mu` (N,), and how far each may have moved from those of
    `before`, and by rounding of the entries, into `moved` (N,).

    real, imaginary (N,), left, right (N, N): as LAPACK's geev has them, conjugate vectors as real and imaginary parts.
    """
    size = phi.shape[0]
    change, norm, largest = 0.0, 0.0, 1.0
    for i in range(size):
        mu[i] = complex(real[i], imaginary[i])
        largest = max(largest, abs(mu[i]))
        for j in range(size):
            change += (phi[i, j] - before[i, j]) ** 2
            norm += phi[i, j] ** 2
    # a double multiplier moves like the square root of a perturbation: that bounds the first-order estimate
    most = math.sqrt((math.sqrt(change) + _ROUNDING * math.sqrt(norm)) * largest)
    for j in range(size):
        if imaginary[j] < 0.0:
            moved[j] = moved[j - 1]
            continue
        more = j + 1 if imaginary[j] > 0.0 else j
        turn = 0.0 if more == j else 1.0
        by_change = scale = 0.0j
        by_rounding = 0.0
        for i in range(size):
            changed = 0.0j
            rounded = 0.0
            for q in range(size):
                v = complex(right[q, j], turn * right[q, more])
                changed += (phi[i, q] - before[i, q]) * v
                rounded += abs(phi[i, q]) * abs(v)
            u = complex(left[i, j], -turn * left[i, more])
            scale += u * complex(right[i, j], turn * right[i, more])
            by_change += u * changed
            by_rounding += abs(u) * rounded
        first = (abs(by_change) + _ROUNDING * by_rounding) / abs(scale) if abs(scale) > 0.0 else np.inf
        moved[j] = min(first, most) + 1e-14
    for k in range(1, size):
        while k > 0 and abs(mu[k - 1]) < abs(mu[k]):
            mu[k - 1], mu[k] = mu[k], mu[k - 1]
            moved[k - 1], moved[k] = moved[k], moved[k - 1]
            k -= 1
