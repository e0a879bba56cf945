"""The linearised motion over one period, from what the linear part does exactly and forces at the nodes of a time mesh.

Elements are channels: they read one direction of the motion and act along one, and the linear part is in blocks
(`blocks`),

    z' = L z + B F,    F_g = k_g q_g + c_g q_g' + r_g,    q = G z + R F,    q' = G' z,

R the flexibility of what is too fast to have states. On a panel F is the polynomial through its values at the Lobatto
nodes, and between the nodes the blocks move as they do:

    z(t_j) = exp(L t_j) z_0 + sum_l W_jl B F_l,    W_jl = int_0^t_j exp(L (t_j - t)) P_l(t) dt = w_0 + w_1 L,

P_l Lagrange's polynomials. Panels are as long as polynomials follow the forces, whatever the blocks do. `structure`
(`exponentials`) has these matrices, the same on all panels of one length, and `act` what channels that act make of one
another; the others are followed through the states. `march` then solves for the forces of the
channels that act on a panel, a system as large as these have nodes; where none acts the blocks just go on. Constant
stiffnesses of contacts are within the blocks (`forms`): as contacts begin and end, the states of one form become
those of the next. With forces as polynomials the method is of order 12 at a panel's end, as Lobatto IIIA is (Hairer &
Wanner, Solving Ordinary Differential Equations II, section IV.5), and exact without.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.floquet.exponentials import act, along
from suboctave.floquet.time_mesh import HIGHEST, ORDER
from suboctave.harmonic.elimination import eliminate

#: sums may be reordered; infinities keep their meaning
_FAST = {"reassoc", "contract", "nsz"}
#: relative errors of the entries of a monodromy matrix by rounding
_ROUNDING = 1e-15
_TINY = float(np.finfo(float).tiny)
#: the first column or node and the last one, as numbers that kernels are not compiled for once more
_FIRST = np.int64(0)
_LAST = np.int64(ORDER - 1)


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _turn(moved, first, start, stop, state):
    """The columns from start to stop of the states (S, .) moved on, in place; moved (blocks, 2, 2)."""
    for b in range(moved.shape[0]):
        s = first[b]
        if first[b + 1] == s:
            break
        if first[b + 1] - s == 1:
            for j in range(start, stop):
                state[s, j] *= moved[b, 0, 0]
        else:
            for j in range(start, stop):
                x, y = state[s, j], state[s + 1, j]
                state[s, j] = moved[b, 0, 0] * x + moved[b, 0, 1] * y
                state[s + 1, j] = moved[b, 1, 0] * x + moved[b, 1, 1] * y


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _lower(values, row):
    """Take the two highest Legendre components from a polynomial by its values at the nodes, values[row : row + m]."""
    for i in range(HIGHEST.shape[0]):
        share = 0.0
        for j in range(ORDER):
            share += HIGHEST[i, 0, j] * values[row + j]
        for j in range(ORDER):
            values[row + j] -= share * HIGHEST[i, 1, j]


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _tangents(law, loose, active, p, forced, values, acts, rows):
    """Forces, stiffness and damping at the nodes of panel p into values (3, G m), which channels act there into acts
    (G,), and their nodes into rows, one node after the other; returns how many these are, and whether any has damping.
    """
    m, count, moving = ORDER, 0, False
    for g in range(active.shape[0]):
        row, stiff, moves = g * m, False, False
        for j in range(m):
            for part in range(3):
                values[part, row + j] = law[active[g], part, p * (m - 1) + j]
            values[1, row + j] += loose[active[g], p]
            stiff, moves = stiff or values[1, row + j] != 0.0, moves or values[2, row + j] != 0.0
        acts[g], moving = stiff or moves, moving or moves
        if forced:
            if stiff:
                _lower(values[1], row)
            if moves:
                _lower(values[2], row)
    for j in range(m):
        for g in range(active.shape[0]):
            if acts[g]:
                rows[count], count = g * m + j, count + 1
    return count, moving


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _still(e, w, motion, first, driven, r, acts, start, given, states):
    """The states (m, S) that forces r of channels that do not act make from none, `start`; `given` (G m,) is room."""
    some = False
    for row in range(r.shape[0]):
        given[row] = 0.0 if acts[row // ORDER] else r[row]
        some = some or acts[row // ORDER]
    along(e, w, motion, first, driven, given, start, _FIRST if some else _LAST, states)


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _known(read, flexible, states, felt, acts, values, rows, count, f):
    """Forces at the nodes `rows`, count of them, as far as they are known, into the last column of f: r, and if any is
    felt what those r that do not act make of stiffness and damping, by the states (m, S) that follow from these.
    """
    last = f.shape[1] - 1
    for i in range(count):
        g, j, q, v = rows[i] // ORDER, rows[i] % ORDER, 0.0, 0.0
        for s in range(states.shape[1] if felt else 0):
            q += read[0, g, s] * states[j, s]
            v += read[1, g, s] * states[j, s]
        for h in range(acts.shape[0]):
            if not acts[h]:
                q += flexible[g, h] * values[0, h * ORDER + j]
        f[i, last] = values[0, rows[i]] + values[1, rows[i]] * q + values[2, rows[i]] * v


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _room(forces, groups, size, columns):
    """Arrays for `_solve` to work in."""
    equations, begin, after = np.empty((forces, forces)), np.empty((groups, groups)), np.empty((forces, groups))
    return equations, begin, after, np.empty((forces, size)), np.empty((forces, columns))


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _solve(reading, influence, total, values, rows, count, moving, f, room):
    """Forces at the nodes `rows`, count of them, from states `total` at a panel's start, and f as far as these are
    known, into f; room: arrays to work in.
    """
    a, begin, after, seen, speed = room
    columns, here, k, c = total.shape[1], count // ORDER, values[1], values[2]
    for part in range(2 if moving else 1):
        of = k if part == 0 else c
        for i in range(count):
            for s in range(total.shape[0]):
                seen[i, s] = of[rows[i]] * reading[part, rows[i], s]
        np.dot(seen[:count], total, speed[:count])
        for i in range(count):
            for j in range(columns):
                f[i, j] += speed[i, j]
    # at the first node only what has no states answers at once
    for i in range(count):
        row = rows[i]
        for l in range(here if i < here else count):
            value = k[row] * influence[0, row, rows[l]] + (c[row] * influence[1, row, rows[l]] if moving else 0.0)
            if i < here:
                begin[i, l] = (1.0 if i == l else 0.0) - value
            elif l < here:
                after[i, l] = value
            else:
                a[i - here, l - here] = (1.0 if i == l else 0.0) - value
    eliminate(begin, f, here)
    for i in range(here, count):
        for l in range(here):
            for j in range(columns):
                f[i, j] += after[i, l] * f[l, j]
    eliminate(a, f[here:count], count - here)


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _other_form(turn, total, room):
    """The states (S, .) of one form as those of another, in place."""
    np.dot(turn, total, room)
    for s in range(total.shape[0]):
        for j in range(total.shape[1]):
            total[s, j] = room[s, j]


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _kick(amount, read, driven, total):
    """Add impulses, so many times what is read of the states (S, .), to these."""
    for j in range(total.shape[1]):
        q = 0.0
        for s in range(total.shape[0]):
            q += read[s] * total[s, j]
        for s in range(total.shape[0]):
            total[s, j] += amount * q * driven[s]


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _enter(entering, rows, count, f, packed, added, total):
    """Add what forces f at the nodes `rows`, count of them, leave in the states (S, .) at a panel's end; packed and
    added are room to work in.
    """
    size = total.shape[0]
    into = packed[: size * count].reshape(size, count)
    for s in range(size):
        for l in range(count):
            into[s, l] = entering[s, rows[l]]
    np.dot(into, f[:count], added)
    for s in range(size):
        for j in range(total.shape[1]):
            total[s, j] += added[s, j]


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _made(made, acts, parts):
    """Whether all that is wanted of the channels that act, (G,), is known; made: see `structure`."""
    known = True
    for g in range(acts.shape[0]):
        known = known and (not acts[g] or made[g] >= parts)
    return known


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _note(r, acts, rows, count, f, acting, solved):
    """Keep which channels act on a panel, and all forces there: f at the nodes `rows`, count of them, else r."""
    for l in range(count):
        for j in range(f.shape[1]):
            solved[rows[l], j] = f[l, j]
    for g in range(acts.shape[0]):
        acting[g] = acts[g]
        for l in range(g * ORDER, g * ORDER + (0 if acts[g] else ORDER)):
            solved[l, f.shape[1] - 1] = r[l]


@kernel(fastmath=_FAST, error_model="numpy")
def march(structures, stretch, forms, law, loose, kick, active, total, kept, acting, solved, states):
    """Perturbations along the panels of one period, and with them the response to the forces r.

    Parameters
    ----------
    structures, stretch, forms
        See `structure`.
    law, loose, kick
        Forces, stiffness and damping of all channels at the nodes of the period, (C, >= 3, N); what is added to the
        stiffness on every panel and is not within the forms, (C, P); impulses `-kick q` at the beginnings of panels,
        (C, P).
    active
        The channels that act, (G,).
    total
        Zeros; in the end states, (S, kept) or (S, kept + 1): the last column feels r.
    kept
        The states that perturbations begin with, (kept,).
    acting, solved
        Which channels have stiffness or damping on which panels, (P, G), and all forces at the nodes,
        (P, G m, kept + 1); of channels that do not act the last column alone.
    states
        Those that panels begin with on which channels act, (P, S, kept + 1); with r, as `solved`.

    Notes
    -----
    With r, stiffness and damping are polynomials of lower degree on panels.
    """
    kinds, moved, e, w, made, reading, influence, entering = structures
    groups, m, (size, columns) = active.shape[0], ORDER, total.shape
    free = kept.shape[0]
    forced, forces = columns > free, groups * m
    for i in range(free):
        total[kept[i], i] = 1.0
    values, acts, rows = np.empty((3, forces)), np.empty(groups, dtype=np.bool_), np.empty(forces, dtype=np.int64)
    f, room = np.empty((forces, columns)), _room(forces, groups, size, columns)
    packed, added = np.empty(size * forces), np.empty((size, columns))
    still, forward, given = np.zeros((size, 1)), np.empty((m, size)), np.empty(forces)
    waiting, later, now = moved[0].copy(), False, -1
    for p in range(kinds.shape[0]):
        d, kicked, begins = kinds[p], False, stretch[p] != now
        for channel in active:
            kicked = kicked or kick[channel, p] != 0.0
        count, moving = _tangents(law, loose, active, p, forced, values, acts, rows)
        if later and (kicked or begins or count > 0):
            _turn(waiting, forms.first[now], _FIRST, free, total)
            later = False
        if begins:
            now = stretch[p]
            if forms.turning[now]:
                _other_form(forms.turns[now], total, added)
        first, driven = forms.first[now], forms.driven[now]
        for g in range(groups if kicked else 0):
            if kick[active[g], p] != 0.0:
                _kick(kick[active[g], p], forms.read[now, 0, g], driven[:, g], total)
        felt = forced and count < forces
        if felt:
            _still(e[d], w[d], forms.motion[now], first, driven, values[0], acts, still, given, forward)
        if count > 0:
            f[:count] = 0.0
            if forced:
                states[p] = total
                _known(forms.read[now], forms.flexible[now], forward, felt, acts, values, rows, count, f)
            if not _made(made[d], acts, 2 if moving else 1):
                act(structures, d, forms, now, acts, moving)
            _solve(reading[d], influence[d], total, values, rows, count, moving, f, room)
            _turn(moved[d], first, _FIRST, columns, total)
            _enter(entering[d], rows, count, f, packed, added, total)
        else:
            for b in range(moved.shape[1]):
                _follow(moved[d, b], waiting[b], later)
            later = True
            _turn(moved[d], first, free, columns, total)
        if forced:
            _note(values[0], acts, rows, count, f, acting[p], solved[p])
        for s in range(size if felt else 0):
            total[s, free] += forward[m - 1, s]
    if later:
        _turn(waiting, forms.first[now], _FIRST, free, total)
    if forms.turning[now + 1]:
        _other_form(forms.turns[now + 1], total, added)


@kernel(fastmath=_FAST, error_model="numpy")
def response(structures, stretch, forms, active, acting, solved, states, start, whole, kept, path, largest, out):
    """q, q' at the nodes along all channels into `out` (C, 2, N), which is zero, of the response that begins with the
    kept states `start` (kept, 1); returns how much larger it is than `largest` times the motion where that is most,
    infinity where it is not finite.

    structures, stretch, forms, active, acting, solved, states: see `march`; whole (S, kept + 1): states at the end of
    the period, kept (kept,): which of them these are; path (C, 2, N): the motion along all channels.
    """
    kinds, _moved, e, w, _made, _reading, _influence, _entering = structures
    groups, m, free, size = active.shape[0], ORDER, start.shape[0], whole.shape[0]
    state, force, forward, now = np.empty((size, 1)), np.empty(groups * m), np.empty((m, size)), -1
    for s in range(size):
        state[s, 0] = whole[s, free]
        for i in range(free):
            state[s, 0] += whole[s, i] * start[i, 0]
    for i in range(free):
        state[kept[i], 0] = start[i, 0]
    for p in range(kinds.shape[0]):
        d = kinds[p]
        if stretch[p] != now:
            now = stretch[p]
            if forms.turning[now]:
                state = np.dot(forms.turns[now], state)
        acts = False
        for g in range(groups):
            acts = acts or acting[p, g]
        # without its forces the structure may grow, and what rounding leaves with it
        for s in range(size if acts else 0):
            state[s, 0] = states[p, s, free]
            for i in range(free):
                state[s, 0] += states[p, s, i] * start[i, 0]
        for row in range(groups * m):
            force[row] = solved[p, row, free]
            for i in range(free if acting[p, row // m] else 0):
                force[row] += solved[p, row, i] * start[i, 0]
        along(e[d], w[d], forms.motion[now], forms.first[now], forms.driven[now], force, state, _FIRST, forward)
        for g in range(groups):
            for j in range(m):
                # the last node of a panel is the first of the next
                at, q, v = p * (m - 1) + j, 0.0, 0.0
                for s in range(size):
                    q += forms.read[now, 0, g, s] * forward[j, s]
                    v += forms.read[now, 1, g, s] * forward[j, s]
                for h in range(groups):
                    q += forms.flexible[now, g, h] * force[h * m + j]
                out[active[g], 0, at], out[active[g], 1, at] = q, v
        for s in range(size):
            state[s, 0] = forward[m - 1, s]
    worst = 0.0
    for channel in active:
        most, limit = 0.0, _TINY
        for at in range(path.shape[2]):
            most = max(most, abs(out[channel, 0, at])) if out[channel, 0, at] == out[channel, 0, at] else np.inf
            limit = max(limit, largest * abs(path[channel, 0, at]))
        worst = max(worst, most / limit)
    return worst


@kernel(inner=True, forceinline=True, fastmath=_FAST, error_model="numpy")
def _follow(step, waiting, later):
    """A panel's exponential (2, 2) after those that wait, if any do, in place."""
    for j in range(2):
        x, y = (waiting[0, j], waiting[1, j]) if later else (1.0 - j, 1.0 * j)
        waiting[0, j] = step[0, 0] * x + step[0, 1] * y
        waiting[1, j] = step[1, 0] * x + step[1, 1] * y


@kernel(fastmath=_FAST, error_model="numpy")
def closed(whole, kept, phi, start):
    """The monodromy matrix of the kept states into phi (kept, kept), and into start (kept, 1) these states where the
    periodic response begins; whole (S, kept + 1): see `march`.
    """
    size = kept.shape[0]
    closing = np.empty((size, size))
    for i in range(size):
        for j in range(size):
            phi[i, j] = whole[kept[i], j]
            closing[i, j] = (1.0 if i == j else 0.0) - phi[i, j]
        start[i, 0] = whole[kept[i], size]
    eliminate(closing, start, size)


@kernel(fastmath=_FAST, error_model="numpy")
def own_values(imaginary, left, right, own):
    """Which eigenvalues are those of the first `own` states, (N,): all others but those in whose eigenvectors, left
    times right, the other states have most part.

    imaginary (N,), left, right (N, N): as LAPACK's geev has them, conjugate vectors as real and imaginary parts.
    """
    size = imaginary.shape[0]
    result, part = np.ones(size, dtype=np.bool_), np.zeros(size)
    for j in range(size if own < size else 0):
        if imaginary[j] < 0.0:
            part[j] = part[j - 1]
            continue
        more, turn = (j + 1, 1.0) if imaginary[j] > 0.0 else (j, 0.0)
        others = scale = 0.0j
        for i in range(size):
            u, v = complex(left[i, j], -turn * left[i, more]), complex(right[i, j], turn * right[i, more])
            scale += u * v
            if i >= own:
                others += u * v
        part[j] = abs(others) / max(abs(scale), _TINY)
    left_over = size - own
    while left_over > 0:
        most = -1
        for j in range(size):
            wide = 1 if imaginary[j] == 0.0 else 2
            if result[j] and wide <= left_over and (most < 0 or part[j] > part[most]):
                most = j
        if most < 0:
            break
        result[most] = False
        left_over -= 1
        if imaginary[most] != 0.0:
            result[most + 1] = False
            left_over -= 1
    return result


@kernel(fastmath=_FAST, error_model="numpy")
def multipliers_and_shifts(real, imaginary, left, right, phi, before, own, missing, doubt, mu, moved):
    """Eigenvalues of phi (N, N) by descending modulus into `mu` (N,), and how far each may have moved from those of
    `before`, and by rounding of the entries, and by what is left out of the structure, and a share `doubt` of what
    differs from `before`, into `moved` (2, N); those of other states than the first `own` come last.

    missing (2, own): what is left out moves every eigenvalue by the product of the lengths of its vectors, left and
    right, in these units.
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
    change, norm = math.sqrt(change), math.sqrt(norm)
    most = math.sqrt((change + _ROUNDING * norm) * largest)
    unknown = doubt * change
    v, turned = np.empty(size), np.zeros(size)
    for j in range(size):
        if imaginary[j] < 0.0:
            moved[0, j], moved[1, j] = moved[0, j - 1], moved[1, j - 1]
            continue
        more = j + 1 if imaginary[j] > 0.0 else j
        turn = 0.0 if more == j else 1.0
        by_change = scale = 0.0j
        lefts = rights = ahead = behind = 0.0
        for q in range(size):
            v[q], turned[q] = right[q, j], turn * right[q, more]
        for i in range(size):
            x = y = 0.0
            for q in range(size):
                d = phi[i, q] - before[i, q]
                x += d * v[q]
                y += d * turned[q]
            u = complex(left[i, j], -turn * left[i, more])
            scale += u * complex(v[i], turned[i])
            by_change += u * complex(x, y)
            forwards, backwards = u.real**2 + u.imag**2, v[i] ** 2 + turned[i] ** 2
            lefts += forwards
            rights += backwards
            if i < own:
                ahead += forwards * missing[0, i] ** 2
                behind += backwards * missing[1, i] ** 2
        by_rounding = _ROUNDING * norm * math.sqrt(lefts * rights)
        first = (abs(by_change) + by_rounding) / abs(scale) if abs(scale) > 0.0 else np.inf
        moved[0, j] = min(first, most) + 1e-14
        by_missing = unknown + abs(mu[j]) * math.sqrt(ahead * behind)
        furthest = math.sqrt(by_missing * largest)
        moved[1, j] = min(by_missing / abs(scale), furthest) if abs(scale) > 0.0 else furthest
    count, kept = 0, own_values(imaginary, left, right, own)
    for j in range(size):
        if kept[j]:
            # others move to the end
            for i in range(j, count, -1):
                mu[i], mu[i - 1] = mu[i - 1], mu[i]
                for part in range(2):
                    moved[part, i], moved[part, i - 1] = moved[part, i - 1], moved[part, i]
            count += 1
    for k in range(1, count):
        while k > 0 and abs(mu[k - 1]) < abs(mu[k]):
            mu[k - 1], mu[k] = mu[k], mu[k - 1]
            for part in range(2):
                moved[part, k - 1], moved[part, k] = moved[part, k], moved[part, k - 1]
            k -= 1
