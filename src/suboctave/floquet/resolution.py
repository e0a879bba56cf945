"""How finely a period is cut, and how much of a structure need not be followed along it.

Panels follow the forces: stiffness and damping of the channels, and blocks as far as channels see them.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.floquet.time_mesh import ORDER, WEIGHTS

#: sums may be reordered; infinities keep their meaning
_FAST = {"reassoc", "contract", "nsz"}
_TINY = float(np.finfo(float).tiny)
#: what panels are made for: errors of multipliers, and share of what blocks without states may move them
ACCURACY, _FINER = 1e-8, 0.01
#: most panels that a period is cut into
MOST = 20000
#: logarithm of the share of a block in a force below which it counts no more
_UNSEEN = math.log(1e-9)


@kernel()
def stretches(base, active):
    """The stiffnesses (R, G) that contacts have on panels one after the other, and which of these each has, (P,); base
    (C, P).
    """
    groups, panels = active.shape[0], base.shape[1]
    number, count = np.zeros(panels, dtype=np.int64), 0
    for p in range(1, panels):
        for channel in active:
            if base[channel, p] != base[channel, p - 1]:
                count = number[p - 1] + 1
        number[p] = count
    held = np.empty((count + 1, groups))
    for p in range(panels):
        for g in range(groups):
            held[number[p], g] = base[active[g], p]
    return held, number


@kernel()
def longest_rest(spans, law, base, active, start):
    """The first of the panels in a row on which no channel has stiffness or damping and none begins with an event, and
    how long it takes to pass them: the longest such row.

    spans, law, base, active: see `parts_needed`; start: the panels that begin with events.
    """
    panels, m = spans.shape
    busy, best, at, time, first = np.zeros(panels, dtype=np.bool_), 0.0, 0, 0.0, 0
    for p in start:
        busy[p] = True
    for p in range(panels):
        for channel in active:
            for j in range(p * (m - 1), p * (m - 1) + m):
                busy[p] = busy[p] or law[channel, 1, j] + base[channel, p] != 0.0 or law[channel, 2, j] != 0.0
    for turn in range(2 * panels):
        p = turn % panels
        if busy[p]:
            time, first = 0.0, turn + 1
            continue
        for j in range(m):
            time += WEIGHTS[j] * spans[p, j]
        if time > best and turn - first < panels:
            best, at = time, first % panels
    return at, best


@kernel()
def tolerated(spans, forces, law, base, active, held, limits):
    """How far what has no states may move multipliers on panels with dt/ds = spans (P, m), relative to the largest, the
    largest force that the motion leaves unbalanced, and whether any channel acts.

    forces (C, .): Fourier coefficients of all channels; law, base (C, P): forces, stiffness and damping at the nodes,
    and what is added to the stiffness on every panel; active: the channels that act; held (2, G): integrals of
    stiffness and damping over the period. limits: how far multipliers may move, and how much further where the motion
    leaves all of a force unbalanced.
    """
    panels, m = spans.shape
    left, whole, acting = 0.0, _TINY, False
    for g in range(active.shape[0]):
        held[0, g] = held[1, g] = 0.0
    for p in range(panels):
        length = 0.0
        for j in range(m):
            length += WEIGHTS[j] * spans[p, j]
        for g in range(active.shape[0]):
            k = c = 0.0
            for j in range(p * (m - 1), p * (m - 1) + m):
                k = max(k, abs(law[active[g], 1, j] + base[active[g], p]))
                c = max(c, abs(law[active[g], 2, j]))
                left = max(left, abs(law[active[g], 0, j]))
            held[0, g] += k * length
            held[1, g] += c * length
    for g in range(active.shape[0]):
        size = 0.0
        for h in range(forces.shape[1]):
            size += abs(forces[active[g], h])
        whole = max(whole, size)
        acting = acting or held[0, g] > 0.0 or held[1, g] > 0.0
    return limits[0] + limits[1] * min(1.0, left / whole), left, acting


@kernel(inner=True, forceinline=True)
def _sight(seen, speed, decays, since, power):
    """How fast what blocks add to a force turns, rad per unit time, at a time `since` the last of what sets them off;
    seen, speed (B,): logarithms of the share of each in the force at its beginning, and of its rate.
    """
    fastest = -np.inf
    for b in range(seen.shape[0]):
        left = min(0.0, seen[b]) + min(0.0, decays[b]) * since
        if left > _UNSEEN:
            fastest = max(fastest, speed[b] + power * left)
    return math.exp(fastest)


@kernel(inner=True)
def _forces(law, loose, active, p, rates, flexibility, stiffening, seen):
    """Rate of the forces on panel p, and the logarithms of the share of every block in them into seen (B,); see
    `divided`.
    """
    groups = active.shape[0]
    squares, rates_by, squared, rate = np.zeros(groups), np.zeros(groups), 0.0, 0.0
    for b in range(seen.shape[0]):
        seen[b] = 0.0
    for g in range(groups):
        k = c = 0.0
        for j in range(p * (ORDER - 1), p * (ORDER - 1) + ORDER):
            k = max(k, abs(law[active[g], 1, j] + loose[active[g], p]))
            c = max(c, abs(law[active[g], 2, j]))
        # no eigenvalue is larger than the sum of a row's entries
        for h in range(groups if k > 0.0 or c > 0.0 else 0):
            squares[h] += stiffening[h, g] * k
            rates_by[h] += stiffening[h, g] * c
            squared, rate = max(squared, squares[h]), max(rate, rates_by[h])
        for b in range(seen.shape[0] if k > 0.0 or c > 0.0 else 0):
            seen[b] += (k + c * rates[b]) * abs(flexibility[b, g, g])
    for b in range(seen.shape[0]):
        seen[b] = math.log(seen[b]) if seen[b] > 0.0 else -np.inf
    return math.sqrt(squared) + rate


@kernel(inner=True)
def _grown(rows):
    """Room for twice as many rows."""
    out = np.empty((2 * rows.shape[0], rows.shape[1]))
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            out[i, j] = rows[i, j]
    return out


@kernel()
def divided(
    panels, start, spans, law, loose, active, rates, decays, flexibility, stiffening, neglected, kinked, limits
):  # fmt: skip
    """Panels (., 4) as short as forces need them, and which of them events begin with; those given if that would be
    more than `MOST`.

    Blocks are set off by events, and by what a period begins with, and decay from then on: panels become longer.

    Parameters
    ----------
    panels, start, spans
        See `time_mesh.panels_between` and `along_panels`.
    law, loose, active
        See `march`.
    rates, decays, flexibility, stiffening
        See `levels.Level`.
    neglected
        How far what has no states may move multipliers.
    kinked
        Whether forces may set blocks off anywhere.
    limits
        Lengths of panels in units of the fastest time scale of the forces, of that of the blocks as channels see them,
        and of that of the blocks where panels are not uniform; the power of the share of a block in a force with which
        it counts for the second.
    """
    count, m = spans.shape
    # panels need not be much better than what is neglected
    seeing = limits[1] * max(1.0, _FINER * neglected / ACCURACY) ** 0.1
    dynamic, fastest = rates.shape[0], 0.0
    for b in range(dynamic):
        fastest = max(fastest, rates[b])
    out, where, added, since = np.empty((2 * count, 4)), np.empty(count, dtype=np.int64), 0, 0.0
    seen, speed = np.empty(dynamic), np.empty(dynamic)
    for b in range(dynamic):
        speed[b] = math.log(max(rates[b], _TINY))
    sets_off = np.zeros(count, dtype=np.bool_)
    for i in range(start.shape[0]):
        sets_off[start[i]] = True
    for p in range(count):
        where[p] = added
        needed, length = _forces(law, loose, active, p, rates, flexibility, stiffening, seen) / limits[0], 0.0
        for j in range(m):
            length += WEIGHTS[j] * spans[p, j]
        uniform = abs(spans[p, 0] - spans[p, m // 2]) <= 1e-12 * spans[p, 0]
        turning = 0.0 if uniform else fastest / limits[2]
        since = 0.0 if sets_off[p] or kinked else since
        # equal parts as its end needs them, and these in halves
        last = 0.0 if kinked else since + length
        wanted = length * max(needed + _sight(seen, speed, decays, last, limits[3]) / seeing, turning)
        if not wanted < MOST:
            return panels, start
        parts = max(1, math.ceil(wanted))
        at, whole = 0.0, 1.0 / parts
        while at < 1.0 - 1e-9:
            size, now = whole, since if kinked else since + at * length
            sight = needed + _sight(seen, speed, decays, now, limits[3]) / seeing
            # halves begin at multiples of themselves
            while size * length * sight > 1.0 or abs(at / size - round(at / size)) > 1e-6:
                size *= 0.5
            if added >= MOST:
                return panels, start
            if added == out.shape[0]:
                out = _grown(out)
            out[added, 2], out[added, 3] = panels[p, 2], panels[p, 3]
            out[added, 0] = panels[p, 0] + at * (panels[p, 1] - panels[p, 0])
            at = min(1.0, at + size) if at + size < 1.0 - 1e-9 else 1.0
            out[added, 1] = panels[p, 0] + at * (panels[p, 1] - panels[p, 0])
            added += 1
        since += length
    return out[:added].copy(), where[start]
