"""The linearised motion over one period, from what the linear part does exactly and forces at the nodes of a time mesh.

Elements are channels: they read one direction of the motion and act along one, and the linear part is in blocks
(`blocks`),

    z' = L z + B F,    F_g = k_g q_g + c_g q_g' + r_g,    q = G z + R F,    q' = G' z,

R the flexibility of what is too fast to have states. On a panel F is the polynomial through its values at the Lobatto
nodes, and between the nodes the blocks move as they do:

    z(t_j) = exp(L t_j) z_0 + sum_l W_jl B F_l,    W_jl = int_0^t_j exp(L (t_j - t)) P_l(t) dt = w_0 + w_1 L,

P_l Lagrange's polynomials, the integrals by Gauss's formula between neighbouring nodes. Panels are as long as
polynomials follow the forces, whatever the blocks do. `structure` has these matrices, the same on all panels of one
length. `march` then solves for the forces of the channels that act on a panel, a system as large as these have nodes;
where none acts the blocks just go on. With forces as polynomials the method is of order 12 at a panel's end, as
Lobatto IIIA is (Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.5), and exact without.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.floquet.time_mesh import HIGHEST, NODES, ORDER, WEIGHTS

#: sums may be reordered; infinities keep their meaning
_FAST = {"reassoc", "contract", "nsz"}
#: relative errors of the entries of a monodromy matrix by rounding
_ROUNDING = 1e-15
_TINY = float(np.finfo(float).tiny)
#: what panels are made for: errors of multipliers, and share of what blocks without states may move them
ACCURACY, _FINER = 1e-8, 0.01
#: impulses in a period that blocks without states may miss
_CHANGES = 4.0
#: points of Gauss's formula between neighbouring nodes
_POINTS = 8


def _between() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """For Gauss's points between every two neighbouring nodes, from values at the nodes: values there, integrals from
    there to the right node, (m - 1, points, m) each, and over the whole interval, (m - 1, m); the weights.
    """
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    left, right = NODES[:-1, None], NODES[1:, None]
    points = 0.5 * (left + right) + 0.5 * (right - left) * x
    inverse = np.linalg.inv(np.polynomial.legendre.legvander(NODES, ORDER - 1))
    integral = np.array([np.polynomial.legendre.legint(row) for row in np.eye(ORDER)])
    over = np.polynomial.legendre.legvander(NODES, ORDER) @ integral.T @ inverse
    until = over[1:, None, :] - np.polynomial.legendre.legvander(points, ORDER) @ integral.T @ inverse
    values = np.polynomial.legendre.legvander(points, ORDER - 1) @ inverse
    return np.ascontiguousarray(values), np.ascontiguousarray(until), over[1:] - over[:-1], 0.5 * (right - left) * w


_VALUES, _UNTIL, _WHOLE, _WEIGHTS = _between()


@kernel(fastmath=_FAST, error_model="numpy")
def eliminate(a, b, n):
    """Solve `a x = b`, n equations, for the columns of b, in place, by Gauss's elimination with pivots; zeros cost
    nothing.
    """
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
def exponential(mean, square, t):
    """e_0, e_1 with `exp(L t) = e_0 + e_1 L` for a matrix whose eigenvalues are `mean +- sqrt(square)`."""
    if square < 0.0:
        turn = math.sqrt(-square)
        size = math.exp(mean * t)
        odd = size * (math.sin(turn * t) / turn if turn * t > 1e-6 else t)
        return size * math.cos(turn * t) - mean * odd, odd
    root = math.sqrt(square)
    low, high = math.exp((mean - root) * t), math.exp((mean + root) * t)
    odd = 0.5 * (high - low) / root if root * t > 1e-3 else low * t * (1.0 + root * t * (1.0 + root * t * (2.0 / 3.0)))
    return 0.5 * (low + high) - mean * odd, odd


@kernel(fastmath=_FAST, error_model="numpy")
def _integrals(times, left, rate, mean, square, e, w):
    """e_0, e_1 at the nodes into e (2, m), and w_0, w_1 into w (2, m m), on one panel; mean, square: see `exponential`.

    times (m - 1,): between the nodes; left, rate (m - 1, points): time from Gauss's points to the next node, and dt/ds
    there times their weight.
    """
    m = ORDER
    e[0, 0], e[1, 0] = 1.0, 0.0
    for l in range(m):
        w[0, l] = w[1, l] = 0.0
    trace, minus = 2.0 * mean, square - mean * mean
    for i in range(m - 1):
        old, new = i * m, (i + 1) * m
        x, y = exponential(mean, square, times[i])
        # (x + y L) (u + v L) with L^2 = trace L + minus
        e[0, i + 1] = x * e[0, i] + minus * y * e[1, i]
        e[1, i + 1] = x * e[1, i] + y * e[0, i] + trace * y * e[1, i]
        for l in range(m):
            w[0, new + l] = x * w[0, old + l] + minus * y * w[1, old + l]
            w[1, new + l] = x * w[1, old + l] + y * w[0, old + l] + trace * y * w[1, old + l]
        for g in range(_POINTS):
            x, y = exponential(mean, square, left[i, g])
            x *= rate[i, g]
            y *= rate[i, g]
            for l in range(m):
                w[0, new + l] += x * _VALUES[i, g, l]
                w[1, new + l] += y * _VALUES[i, g, l]


@kernel(fastmath=_FAST, error_model="numpy")
def structure(spans, motion, first, driven, read, coupling, flexible, dynamic):
    """What the first `dynamic` blocks make of initial states and forces on panels with dt/ds = spans (P, m).

    motion, first, driven, read, coupling, flexible: see `blocks.Blocks`; S: states of these blocks. Returns which kind
    each panel is, (P,), a panel like the one before being of the same kind, and for each kind

    - moved (D, blocks, 2, 2): exp(L t) over the panel
    - reading (D, 2, G m, S): q and q' at the nodes from initial states
    - influence (D, 2, G m, G m): the same from forces at the nodes
    - entering (D, S, G m): final states from forces at the nodes.
    """
    kinds = np.zeros(spans.shape[0], dtype=np.int64)
    for p in range(1, spans.shape[0]):
        kinds[p] = kinds[p - 1]
        for j in range(spans.shape[1]):
            if abs(spans[p, j] - spans[p - 1, j]) > 1e-12 * spans[p, j]:
                kinds[p] = kinds[p - 1] + 1
                break
    groups, m, size = driven.shape[1], ORDER, first[dynamic]
    count = kinds[-1] + 1
    moved, reading = np.zeros((count, dynamic, 2, 2)), np.empty((count, 2, groups * m, size))
    influence, entering = np.empty((count, 2, groups * m, groups * m)), np.empty((count, size, groups * m))
    times, left, rate = np.empty(m - 1), np.empty((m - 1, _POINTS)), np.empty((m - 1, _POINTS))
    e, w, sums = np.empty((2, m)), np.empty((2, m * m)), np.empty((2 * groups * groups, m * m))
    turned = np.empty(2)
    for p in range(spans.shape[0]):
        d = kinds[p]
        if p > 0 and d == kinds[p - 1]:
            continue
        for i in range(m - 1):
            times[i] = 0.0
            for l in range(m):
                times[i] += _WHOLE[i, l] * spans[p, l]
            for g in range(_POINTS):
                left[i, g] = rate[i, g] = 0.0
                for l in range(m):
                    left[i, g] += _UNTIL[i, g, l] * spans[p, l]
                    rate[i, g] += _VALUES[i, g, l] * spans[p, l] * _WEIGHTS[i, g]
        sums[:] = 0.0
        for b in range(dynamic):
            s, wide = first[b], first[b + 1] - first[b]
            mean = 0.5 * (motion[b, 0, 0] + motion[b, 1, 1])
            half = 0.5 * (motion[b, 0, 0] - motion[b, 1, 1])
            _integrals(times, left, rate, mean, half * half + motion[b, 0, 1] * motion[b, 1, 0], e, w)
            for i in range(sums.shape[0]):
                once, twice = coupling[b, 0, i], coupling[b, 1, i]
                for l in range(m * m):
                    sums[i, l] += once * w[0, l] + twice * w[1, l]
            for i in range(wide):
                for k in range(wide):
                    moved[d, b, i, k] = e[1, m - 1] * motion[b, i, k] + (e[0, m - 1] if i == k else 0.0)
                for g in range(groups):
                    turned[0] = turned[1] = 0.0
                    for k in range(wide):
                        turned[0] += motion[b, i, k] * driven[s + k, g]
                    for j in range(m):
                        l = (m - 1) * m + j
                        entering[d, s + i, g * m + j] = w[0, l] * driven[s + i, g] + w[1, l] * turned[0]
                    for part in range(2):
                        turned[1] = 0.0
                        for k in range(wide):
                            turned[1] += read[part, g, s + k] * motion[b, k, i]
                        for j in range(m):
                            reading[d, part, g * m + j, s + i] = e[0, j] * read[part, g, s + i] + e[1, j] * turned[1]
        for part in range(2):
            for g in range(groups):
                for h in range(groups):
                    for j in range(m):
                        for l in range(m):
                            value = sums[(part * groups + g) * groups + h, j * m + l]
                            influence[d, part, g * m + j, h * m + l] = value
                        if part == 0:
                            influence[d, 0, g * m + j, h * m + j] += flexible[dynamic, g, h]
    return kinds, moved, reading, influence, entering


@kernel(fastmath=_FAST, error_model="numpy")
def _turn(moved, first, start, stop, state):
    """The columns from start to stop of the states (S, .) moved on, in place; moved (blocks, 2, 2)."""
    for b in range(moved.shape[0]):
        s = first[b]
        if first[b + 1] - s == 1:
            for j in range(start, stop):
                state[s, j] *= moved[b, 0, 0]
        else:
            for j in range(start, stop):
                x, y = state[s, j], state[s + 1, j]
                state[s, j] = moved[b, 0, 0] * x + moved[b, 0, 1] * y
                state[s + 1, j] = moved[b, 1, 0] * x + moved[b, 1, 1] * y


@kernel(fastmath=_FAST, error_model="numpy")
def _add_product(a, rows, count, b, depth, out):
    """Add the product of chosen rows of a, count of them, and b, depth rows, to out; four terms at a time."""
    width = b.shape[1]
    whole = depth - depth % 4
    for i in range(count):
        row = a[rows[i]]
        for k in range(0, whole, 4):
            p, q, r, s = row[k], row[k + 1], row[k + 2], row[k + 3]
            for j in range(width):
                out[i, j] += p * b[k, j] + q * b[k + 1, j] + r * b[k + 2, j] + s * b[k + 3, j]
        for k in range(whole, depth):
            for j in range(width):
                out[i, j] += row[k] * b[k, j]


@kernel(fastmath=_FAST, error_model="numpy")
def _lower(values, row):
    """Take the two highest Legendre components from a polynomial by its values at the nodes, values[row : row + m]."""
    for i in range(HIGHEST.shape[0]):
        share = 0.0
        for j in range(ORDER):
            share += HIGHEST[i, 0, j] * values[row + j]
        for j in range(ORDER):
            values[row + j] -= share * HIGHEST[i, 1, j]


@kernel(fastmath=_FAST, error_model="numpy")
def march(structures, first, driven, law, base, kick, active, total, acting, solved):
    """Move perturbations on along the panels of one period, in place, and the response to the forces r with them.

    Parameters
    ----------
    structures, first, driven
        See `structure`.
    law, base, kick
        Forces, stiffness and damping of all channels at the nodes of the period, (C, >= 3, N); what is added to the
        stiffness on every panel, (C, P); impulses `-kick q` at the beginnings of panels, (C, P).
    active
        The channels that act, (G,).
    total
        States, (S, S), or (S, S + 1): the last column feels r.
    acting, solved
        Which channels have stiffness or damping on which panels, (P, G), and all forces at the nodes, (P, G m, S + 1);
        empty without r. Of channels that do not act the last column alone is there.

    Notes
    -----
    With r, laws are polynomials of lower degree on panels.
    """
    kinds, moved, reading, influence, entering = structures
    groups, panels, m = active.shape[0], kinds.shape[0], ORDER
    size, columns = total.shape
    forced, forces = columns > size, groups * m
    r, k, c = np.empty(forces), np.empty(forces), np.empty(forces)
    a, f, speed = np.empty((forces, forces)), np.empty((forces, columns)), np.empty((forces, columns))
    all_rows, rows, packed = np.arange(size), np.empty(forces, dtype=np.int64), np.empty((size, max(forces, 1)))
    waiting, later = moved[0].copy(), False
    for p in range(panels):
        d, at, count, moving, kicked = kinds[p], p * (m - 1), 0, False, False
        for g in range(groups):
            channel, row, acts, moves = active[g], g * m, False, False
            kicked = kicked or kick[channel, p] != 0.0
            for j in range(m):
                r[row + j], c[row + j] = law[channel, 0, at + j], law[channel, 2, at + j]
                k[row + j] = law[channel, 1, at + j] + base[channel, p]
                acts, moves = acts or k[row + j] != 0.0, moves or c[row + j] != 0.0
            for j in range(m if acts or moves else 0):
                rows[count] = row + j
                count += 1
            moving = moving or moves
            if forced:
                acting[p, g] = acts or moves
                _lower(r, row)
                if acts:
                    _lower(k, row)
                if moves:
                    _lower(c, row)
        if later and (kicked or count > 0):
            _turn(waiting, first, 0, size, total)
            later = False
        for g in range(groups if kicked else 0):
            for j in range(columns if kick[active[g], p] != 0.0 else 0):
                q = 0.0
                for s in range(size):
                    q += reading[d, 0, g * m, s] * total[s, j]
                for s in range(size):
                    total[s, j] += kick[active[g], p] * q * driven[s, g]
        if count > 0:
            f[:count] = 0.0
            _add_product(reading[d, 0], rows, count, total, size, f)
            if moving:
                speed[:count] = 0.0
                _add_product(reading[d, 1], rows, count, total, size, speed)
            for i in range(count):
                row = rows[i]
                for j in range(columns):
                    f[i, j] *= k[row]
                for j in range(columns if moving else 0):
                    f[i, j] += c[row] * speed[i, j]
                for l in range(count):
                    a[i, l] = -k[row] * influence[d, 0, row, rows[l]] - c[row] * influence[d, 1, row, rows[l]]
                a[i, i] += 1.0
                # forces that are known
                for l in range(forces if forced and count < forces else 0):
                    if not acting[p, l // m]:
                        f[i, size] += (k[row] * influence[d, 0, row, l] + c[row] * influence[d, 1, row, l]) * r[l]
                if forced:
                    f[i, size] += r[row]
            eliminate(a, f, count)
            _turn(moved[d], first, 0, columns, total)
            for s in range(size):
                for l in range(count):
                    packed[s, l] = entering[d, s, rows[l]]
            _add_product(packed, all_rows, size, f, count, total)
            for i in range(count if forced else 0):
                for j in range(columns):
                    solved[p, rows[i], j] = f[i, j]
        else:
            for b in range(moved.shape[1]):
                _follow(moved[d, b], waiting[b], later)
            later = True
            _turn(moved[d], first, size, columns, total)
        for l in range(forces if forced else 0):
            if not acting[p, l // m]:
                solved[p, l, size] = r[l]
                for s in range(size):
                    total[s, size] += entering[d, s, l] * r[l]
    if later:
        _turn(waiting, first, 0, size, total)


@kernel(fastmath=_FAST, error_model="numpy")
def response(structures, first, active, acting, solved, start, path, largest, out):
    """q, q' at the nodes along all channels into `out` (C, 2, N), which is zero, of the response that begins with the
    state `start` (S, 1); returns the share of it that is left: none is larger than `largest` times the displacement.

    structures, first, active, acting, solved: see `march`; path (C, 2, N): the motion along all channels.
    """
    kinds, moved, reading, influence, entering = structures
    groups, m, size = active.shape[0], ORDER, start.shape[0]
    state, force = start.copy(), np.empty(groups * m)
    for p in range(kinds.shape[0]):
        d = kinds[p]
        for row in range(groups * m):
            force[row] = solved[p, row, size]
            for s in range(size if acting[p, row // m] else 0):
                force[row] += solved[p, row, s] * start[s, 0]
        for part in range(2):
            for row in range(groups * m):
                value = 0.0
                for s in range(size):
                    value += reading[d, part, row, s] * state[s, 0]
                for l in range(groups * m):
                    value += influence[d, part, row, l] * force[l]
                # the last node of a panel is the first of the next
                out[active[row // m], part, p * (m - 1) + row % m] = value
        _turn(moved[d], first, 0, 1, state)
        for s in range(size):
            for l in range(groups * m):
                state[s, 0] += entering[d, s, l] * force[l]
    worst = 0.0
    for channel in active:
        most, limit = 0.0, _TINY
        for at in range(path.shape[2]):
            most = max(most, abs(out[channel, 0, at])) if out[channel, 0, at] == out[channel, 0, at] else np.inf
            limit = max(limit, largest * abs(path[channel, 0, at]))
        worst = max(worst, most / limit)
    share = 1.0 if worst <= 1.0 else 1.0 / worst
    if share < 1.0:
        for channel in active:
            for part in range(2):
                for at in range(path.shape[2]):
                    # one that is not finite is left out
                    out[channel, part, at] = out[channel, part, at] * share if share > 0.0 else 0.0
    return share


@kernel(fastmath=_FAST, error_model="numpy")
def _follow(step, waiting, later):
    """A panel's exponential (2, 2) after those that wait, if any do, in place."""
    for j in range(2):
        x, y = (waiting[0, j], waiting[1, j]) if later else (1.0 - j, 1.0 * j)
        waiting[0, j] = step[0, 0] * x + step[0, 1] * y
        waiting[1, j] = step[1, 0] * x + step[1, 1] * y


@kernel(fastmath=_FAST, error_model="numpy")
def periodic_start(total, start):
    """The state in which the periodic response begins, (S, 1): total is the monodromy matrix and what one period of
    forces makes of rest.
    """
    size = total.shape[0]
    closing = np.empty((size, size))
    for i in range(size):
        for j in range(size):
            closing[i, j] = (1.0 if i == j else 0.0) - total[i, j]
        start[i, 0] = total[i, size]
    eliminate(closing, start, size)


@kernel()
def with_states(most, held, rates, decays, flexibility, reach, first, coupled, resolved, time, tolerable):
    """How many blocks have states, and how far the others may move multipliers, relative to the largest.

    A block without states follows a force F that sets in at once, and not with a delay of 1/rate: what that makes is an
    impulse `F / rate` of its share in the force, k R k q / rate, whenever a contact begins or ends. Two neighbours, one
    with states and one without, are coupled by forces besides, and the closer they lie the more that does.

    most, held (2, G): largest stiffness and damping of channels, and integrals over the period, which takes `time`;
    rates, ...: see `blocks.Blocks`; reach (S + 1, G): how far an impulse moves a channel; resolved: a rate up to which
    all blocks have states; tolerable: how far the others may move multipliers.
    """
    groups = most.shape[1]
    dynamic, neglected, last = coupled, 0.0, 0.0
    impulse, shifts = np.zeros(groups), np.zeros(2)
    for b in range(coupled - 1, -1, -1):
        if not rates[b] > resolved:
            break
        much = 0.0
        for g in range(groups):
            for h in range(groups):
                both = (most[0, g] + most[1, g] * rates[b]) * (most[0, h] + most[1, h] * rates[b])
                impulse[g] += both * abs(flexibility[b, g, h]) / rates[b]
            much += _CHANGES * impulse[g] * reach[first[b], g]
        if not much <= tolerable:
            break
        between = 0.0
        if b > 0:
            for i in range(2):
                shifts[i] = 0.0
                for g in range(groups):
                    change = rates[b - i] * (held[0, g] + rates[b - i] * held[1, g])
                    shifts[i] += change * abs(flexibility[b - i, g, g])
            apart = (rates[b] - rates[b - 1]) * time
            between = math.exp(min(0.0, decays[b] * time)) * shifts[0] * shifts[1] / max(apart, 1e-3 * shifts[0], _TINY)
        if much + between <= tolerable:
            dynamic, neglected, last = b, much, between
    return dynamic, neglected + last


@kernel()
def parts_needed(
    spans, forces, law, base, active, most, held, rates, decays, flexibility, share, first, coupled, resolved, limits
):  # fmt: skip
    """Into how many parts panels with dt/ds = spans (P, m) have to be cut, (P,), how many there are then, a float, and
    what `with_states` says.

    forces (C, .): Fourier coefficients of all channels; law, base, active: see `march`; rates, ..., resolved: see
    `with_states`. limits: how far blocks without states may move multipliers, and how much further where the motion
    leaves all of a force unbalanced; lengths of parts in units of the fastest time scale of the forces, of that of the
    blocks as channels see them, and of that of the blocks; the power of the share of a block in a force with which it
    counts for the second. Into most, held (2, G): see `with_states`; most has what channels can have elsewhere.
    """
    panels, m = spans.shape
    groups = active.shape[0]
    k, c, lengths, time = np.zeros((groups, panels)), np.zeros((groups, panels)), np.zeros(panels), 0.0
    for p in range(panels):
        for j in range(m):
            lengths[p] += WEIGHTS[j] * spans[p, j]
        time += lengths[p]
    left, whole = 0.0, _TINY
    held[:] = 0.0
    for g in range(groups):
        channel, size = active[g], 0.0
        for p in range(panels):
            for j in range(p * (m - 1), p * (m - 1) + m):
                k[g, p] = max(k[g, p], abs(law[channel, 1, j] + base[channel, p]))
                c[g, p] = max(c[g, p], abs(law[channel, 2, j]))
                left = max(left, abs(law[channel, 0, j]))
            most[0, g], most[1, g] = max(most[0, g], k[g, p]), max(most[1, g], c[g, p])
            held[0, g] += k[g, p] * lengths[p]
            held[1, g] += c[g, p] * lengths[p]
        for h in range(forces.shape[1]):
            size += abs(forces[channel, h])
        whole = max(whole, size)
    tolerable = limits[0] + limits[1] * min(1.0, left / whole)
    dynamic, neglected = with_states(
        most, held, rates, decays, flexibility, share[0], first, coupled, resolved, time, tolerable
    )
    fastest = rates[dynamic - 1] if dynamic > 0 else 0.0
    # panels need not be much better than that
    seeing = limits[3] * max(1.0, _FINER * neglected / ACCURACY) ** 0.1
    parts, total = np.ones(panels, dtype=np.int64), 0.0
    for p in range(panels):
        a = rate = sight = 0.0
        for g in range(groups):
            a += share[1, first[dynamic], g] * k[g, p]
            rate += share[1, first[dynamic], g] * c[g, p]
        for b in range(dynamic):
            seen = 0.0
            for g in range(groups):
                seen += (k[g, p] + c[g, p] * rates[b]) * abs(flexibility[b, g, g])
            if seen > 0.0:
                sight = max(sight, rates[b] * min(1.0, seen) ** limits[5])
        wanted = math.ceil(lengths[p] * max((math.sqrt(a) + rate) / limits[2] + sight / seeing, fastest / limits[4]))
        total += wanted
        # no more than a number of parts: beyond a million nothing is cut
        parts[p] = int(min(wanted, 1e6)) if wanted >= 1.0 else 1
    return parts, total, dynamic, neglected


@kernel(fastmath=_FAST, error_model="numpy")
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
    v, turned, length = np.empty(size), np.zeros(size), np.empty(size)
    for j in range(size):
        if imaginary[j] < 0.0:
            moved[j] = moved[j - 1]
            continue
        more = j + 1 if imaginary[j] > 0.0 else j
        turn = 0.0 if more == j else 1.0
        for q in range(size):
            v[q], turned[q] = right[q, j], turn * right[q, more]
            length[q] = math.hypot(v[q], turned[q]) if turn != 0.0 else abs(v[q])
        by_change = scale = 0.0j
        by_rounding = 0.0
        for i in range(size):
            x = y = rounded = 0.0
            for q in range(size):
                d = phi[i, q] - before[i, q]
                x += d * v[q]
                y += d * turned[q]
                rounded += abs(phi[i, q]) * length[q]
            u = complex(left[i, j], -turn * left[i, more])
            scale += u * complex(v[i], turned[i])
            by_change += u * complex(x, y)
            by_rounding += abs(u) * rounded
        first = (abs(by_change) + _ROUNDING * by_rounding) / abs(scale) if abs(scale) > 0.0 else np.inf
        moved[j] = min(first, most) + 1e-14
    for k in range(1, size):
        while k > 0 and abs(mu[k - 1]) < abs(mu[k]):
            mu[k - 1], mu[k] = mu[k], mu[k - 1]
            moved[k - 1], moved[k] = moved[k], moved[k - 1]
            k -= 1
