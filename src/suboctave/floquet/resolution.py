"""What of a structure needs states along a motion, and how finely the period is cut.

Panels follow the forces: stiffness and damping of the channels, and blocks as far as channels see them. Blocks that are
too fast have no states, and follow the forces like springs; how far that may move multipliers decides which these are.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.floquet.time_mesh import ORDER, WEIGHTS

_TINY = float(np.finfo(float).tiny)
#: what panels are made for: errors of multipliers, and share of what blocks without states may move them
ACCURACY, _FINER = 1e-8, 0.01
#: most panels that a period is cut into
MOST = 20000
#: logarithm of the share of a block in a force below which it counts no more
_UNSEEN = math.log(1e-9)
#: numbers of blocks with states among many: what belongs to each of them serves other motions as well
_LEVELS = 12


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
def with_states(most, changes, held, rates, decays, flexibility, reach, coupled, resolved, time, tolerable):
    """How many blocks have states, and how far the others may move multipliers, relative to the largest.

    A block without states follows a force F that sets in at once, and not with a delay of 1/rate: what that makes is an
    impulse `F / rate` of its share in the force, k R k q / rate, whenever a contact begins or ends. Two neighbours, one
    with states and one without, are coupled by forces besides, and the closer they lie the more that does.

    most (3, G, G): largest products of the stiffnesses of two channels at one time, of one's stiffness and the other's
    damping, and of two dampings; changes (G,): how often each comes and goes; held (2, G): integrals of stiffness and
    damping over the period, which takes `time`; rates, ..., reach: see `blocks.Blocks`; resolved: a rate up to which
    all blocks have states; tolerable: how far the others may move multipliers.
    """
    groups = changes.shape[0]
    dynamic, neglected, last = coupled, 0.0, 0.0
    impulse, shifts = np.zeros(groups), np.zeros(2)
    for b in range(coupled - 1, -1, -1):
        if not rates[b] > resolved:
            break
        much = 0.0
        for g in range(groups):
            for h in range(groups):
                both = most[0, g, h] + rates[b] * (most[1, g, h] + rates[b] * most[2, g, h])
                impulse[g] += changes[h] * both * abs(flexibility[b, g, h]) / rates[b]
            much += impulse[g] * reach[b, g]
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
        if b % max(1, coupled // _LEVELS) == 0 and much + between <= tolerable:
            dynamic, neglected, last = b, much, between
    return dynamic, neglected + last


@kernel()
def _tangents_met(law, base, active, panels):
    """Of the stiffness and damping of channels on panels the `most` and `changes` of `with_states`."""
    groups, m = active.shape[0], ORDER
    now, before, largest = np.zeros((2, groups)), np.zeros((2, groups)), np.zeros((2, groups))
    most, changed = np.zeros((3, groups, groups)), np.zeros((2, groups))
    for turn in range(panels + 1):
        p = turn % panels
        for g in range(groups):
            now[0, g] = now[1, g] = 0.0
            for j in range(p * (m - 1), p * (m - 1) + m):
                now[0, g] = max(now[0, g], abs(law[active[g], 1, j] + base[active[g], p]))
                now[1, g] = max(now[1, g], abs(law[active[g], 2, j]))
            for part in range(2):
                largest[part, g] = max(largest[part, g], now[part, g])
                changed[part, g] += abs(now[part, g] - before[part, g]) if turn > 0 else 0.0
                before[part, g] = now[part, g]
        for g in range(groups):
            for h in range(groups):
                most[0, g, h] = max(most[0, g, h], now[0, g] * now[0, h])
                most[1, g, h] = max(most[1, g, h], now[0, g] * now[1, h] + now[1, g] * now[0, h])
                most[2, g, h] = max(most[2, g, h], now[1, g] * now[1, h])
    changes = np.zeros(groups)
    for g in range(groups):
        for part in range(2):
            if largest[part, g] > 0.0:
                changes[g] = max(changes[g], changed[part, g] / largest[part, g])
    return most, changes


@kernel()
def states_needed(
    spans, forces, law, base, active, held, rates, decays, flexibility, reach, coupled, resolved, limits
):  # fmt: skip
    """What `with_states` says of a motion on panels with dt/ds = spans (P, m), and whether any channel acts.

    forces (C, .): Fourier coefficients of all channels; law, base (C, P): forces, stiffness and damping at the nodes,
    and what is added to the stiffness on every panel; active: the channels that act; held, ..., resolved: see
    `with_states`. limits: how far blocks without states may move multipliers, and how much further where the motion
    leaves all of a force unbalanced.
    """
    panels, m = spans.shape
    left, whole, time, acting = 0.0, _TINY, 0.0, False
    most, changes = _tangents_met(law, base, active, panels)
    for g in range(active.shape[0]):
        held[0, g] = held[1, g] = 0.0
    for p in range(panels):
        length = 0.0
        for j in range(m):
            length += WEIGHTS[j] * spans[p, j]
        time += length
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
    tolerable = limits[0] + limits[1] * min(1.0, left / whole)
    dynamic, neglected = with_states(
        most, changes, held, rates, decays, flexibility, reach, coupled, resolved, time, tolerable
    )
    return dynamic, neglected, acting


@kernel()
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


@kernel()
def _forces(law, loose, active, p, rates, flexibility, stiffening, seen):
    """Rate of the forces on panel p, and the logarithms of the share of every block in them into seen (B,); see
    `divided`.
    """
    a = rate = 0.0
    for b in range(seen.shape[0]):
        seen[b] = 0.0
    for g in range(active.shape[0]):
        k = c = 0.0
        for j in range(p * (ORDER - 1), p * (ORDER - 1) + ORDER):
            k = max(k, abs(law[active[g], 1, j] + loose[active[g], p]))
            c = max(c, abs(law[active[g], 2, j]))
        a += stiffening[g] * k
        rate += stiffening[g] * c
        for b in range(seen.shape[0] if k > 0.0 or c > 0.0 else 0):
            seen[b] += (k + c * rates[b]) * abs(flexibility[b, g, g])
    for b in range(seen.shape[0]):
        seen[b] = math.log(seen[b]) if seen[b] > 0.0 else -np.inf
    return math.sqrt(a) + rate


@kernel()
def _grown(rows):
    """Room for twice as many rows."""
    out = np.empty((2 * rows.shape[0], rows.shape[1]))
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            out[i, j] = rows[i, j]
    return out


@kernel()
def divided(
    panels, start, spans, law, loose, active, rates, decays, flexibility, stiffening, dynamic, neglected, kinked, limits
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
    rates, decays, flexibility
        See `blocks.Blocks`.
    stiffening
        How much an impulse of stiffness in a channel adds to squared rates, (G,).
    dynamic, neglected
        See `with_states`.
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
    fastest = rates[dynamic - 1] if dynamic > 0 else 0.0
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
