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
def _propagate(stretch, scale, stiffness, damping, left, right, base, k, c, force, kick, powers, nodes):
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
    total = np.eye(size, cols)
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
    matrix = stiffness.copy()
    current = np.zeros(groups)
    poly = np.zeros((1 + 3 * groups, ORDER))
    local = np.zeros((1 + 3 * groups, ORDER))
    active = np.zeros(groups, dtype=np.bool_)
    size_c = norm(damping)
    size_k = norm(matrix)
    known_span = -1.0
    shares = np.empty(groups)
    for g in range(groups):
        shares[g] = np.abs(left[g]).max() * np.abs(right[g]).sum()
    for p in range(count):
        at = p * (ORDER - 1)
        changed = False
        for g in range(groups):
            changed = changed or base[g, p] != current[g]
        if changed:
            known_span = -1.0
            matrix[:] = stiffness
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
            step_matrix[:] = np.eye(size, many)
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
                one[:] = product
        _advance(total, one, left, right, kick, p, product)
    return total, alone, rows


@kernel(fastmath=FAST)
def _advance(total, one, left, right, kick, p, product):
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
def _respond(start, alone, rows):
    """right_g^T d, right_g^T d' at the nodes (G, 2, N) of the response that begins with the state `start` (2 n,)."""
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


@kernel()
def _solved(matrix, right):
    """`matrix^-1 right` by elimination; not finite if the matrix is singular."""
    n = matrix.shape[0]
    a = matrix.copy()
    x = right.copy()
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if a[pivot, k] == 0.0:
            return np.full(n, np.inf)
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            x[k], x[pivot] = x[pivot], x[k]
        for i in range(k + 1, n):
            f = a[i, k] / a[k, k]
            if f != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= f * a[k, j]
                x[i] -= f * x[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            x[k] -= a[k, j] * x[j]
        x[k] /= a[k, k]
    return x


@kernel()
def weighted(mass, damping, stiffness, shapes):
    """K_0, C_0 (n, n), left, right (G, n) in DOFs weighted by the square roots of their masses; shapes (G, n)."""
    n = mass.shape[0]
    weight = np.sqrt(np.diag(mass))
    inverse = np.linalg.inv(mass)
    for i in range(n):
        inverse[i] *= weight[i]
    return inverse @ stiffness / weight, inverse @ damping / weight, shapes @ inverse.T, shapes / weight


@kernel()
def standing_several(stretch, scale, path, law, base, moving, varying, matrices, powers, nodes, share, without):
    """Along the motion as it stands: monodromy matrix (2 n, 2 n) and the correction that the motion needs.

    path, law, base: see `panels.lay_out`; matrices: `weighted`; share: a correction larger than this share of the
    motion is cut down to it; without (2 n, 2 n) or (0, 0): a part of the state that it begins with is left out.
    Polynomials are of lower degree than in `corrected_several`. Returns also the correction
    along the directions (G, 2, N), the factor by which it was cut, and the propagators of all panels (P, 2 n, ...).
    """
    stiffness, damping, left, right = matrices
    groups = path.shape[0]
    none = np.zeros((groups, 0))
    k = law[:, 1] if varying else none
    c = law[:, 2] if moving else none
    kick = np.zeros((groups, stretch.shape[0]))
    total, alone, rows = _propagate(
        stretch, scale, stiffness, damping, left, right, base, k, c, law[:, 0], kick, powers[1], nodes
    )
    size = total.shape[0]
    phi = np.ascontiguousarray(total[:, :size])
    factor = 1.0
    change = np.zeros(path.shape)
    if groups > 0:
        start = _solved(np.eye(size) - phi, total[:, size].copy())
        if without.shape[0] > 0:
            start -= without @ start
        found = _respond(start, alone, rows)
        for g in range(groups):
            most = share * np.abs(path[g, 0]).max()
            largest = np.abs(found[g, 0]).max()
            if not largest <= most:
                factor = min(factor, most / largest if largest < np.inf else 0.0)
        if factor > 0.0:
            change = factor * found
    return phi, change, factor, alone


@kernel()
def corrected_several(stretch, scale, law, base, kick, moving, varying, matrices, powers, nodes, alone):
    """Monodromy matrix along the corrected motion; law (G, 2, N), kick (G, P): see `panels.closed_changes`.

    Where stiffness and damping are constant on every panel, the panels' propagators `alone` are still the same.
    """
    stiffness, damping, left, right = matrices
    groups = left.shape[0]
    size = 2 * stiffness.shape[0]
    none = np.zeros((groups, 0))
    if varying:
        c = law[:, 1] if moving else none
        return _propagate(
            stretch, scale, stiffness, damping, left, right, base, law[:, 0], c, none, kick, powers[0], nodes
        )[0]
    total = np.eye(size)
    product = np.empty((size, size))
    for p in range(alone.shape[0]):
        _advance(total, alone[p, :, :size].copy(), left, right, kick, p, product)
    return total


@kernel()
def perturbed(real, imaginary, left, right, phi, change):
    """Eigenvalues of phi (N, N), by descending modulus, and their first-order shifts by a change of it and by rounding.

    real, imaginary, left, right: as LAPACK's dgeev returns them, complex pairs in two columns.
    """
    n = real.shape[0]
    right = np.ascontiguousarray(right)
    moved = np.dot(change, right)
    size = np.empty((n, n))
    for j in range(n):
        pair = imaginary[j] != 0.0
        other = j if not pair else (j + 1 if imaginary[j] > 0.0 else j - 1)
        for i in range(n):
            size[i, j] = math.hypot(right[i, j], right[i, other]) if pair else abs(right[i, j])
    rounded = np.dot(np.abs(phi), size)
    mu = np.empty(n, dtype=np.complex128)
    shift = np.empty(n)
    norm = math.sqrt((change * change).sum()) + 1e-15 * math.sqrt((phi * phi).sum())
    for j in range(n):
        mu[j] = complex(real[j], imaginary[j])
    most = max(1.0, np.abs(mu).max())
    for j in range(n):
        if imaginary[j] < 0.0:
            shift[j] = shift[j - 1]
            continue
        pair = imaginary[j] > 0.0
        scale = by_change = complex(0.0, 0.0)
        by_rounding = 0.0
        for i in range(n):
            # the left vector conjugate
            u = complex(left[i, j], -left[i, j + 1] if pair else 0.0)
            scale += u * complex(right[i, j], right[i, j + 1] if pair else 0.0)
            by_change += u * complex(moved[i, j], moved[i, j + 1] if pair else 0.0)
            by_rounding += abs(u) * rounded[i, j]
        shift[j] = abs(by_change) + 1e-15 * by_rounding
        shift[j] = shift[j] / abs(scale) if abs(scale) > 0.0 else np.inf
        # a double multiplier moves like the square root of a perturbation: that bounds the first-order estimate
        shift[j] = min(shift[j], math.sqrt(norm * most)) + 1e-14
    order = np.argsort(-np.abs(mu), kind="mergesort")
    return mu[order], shift[order]


@kernel()
def projector(real, imaginary, left, right):
    """On the direction of the real multiplier nearest to +1, (N, N); zero if there is none or it is a double one."""
    n = real.shape[0]
    out = np.zeros((n, n))
    found = -1
    for j in range(n):
        if imaginary[j] == 0.0 and (found < 0 or abs(1.0 - real[j]) < abs(1.0 - real[found])):
            found = j
    if found >= 0:
        scale = 0.0
        for i in range(n):
            scale += left[i, found] * right[i, found]
        if abs(scale) > 1e-10:
            for i in range(n):
                for j in range(n):
                    out[i, j] = right[i, found] * left[j, found] / scale
    return out
