"""What of a structure needs states along a motion, and how finely the period is cut.

Panels follow the forces: stiffness and damping of the channels, and blocks as far as channels see them. Blocks that are
too fast have no states, and follow the forces like springs; how far that may move multipliers decides which these are.
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
#: entries of G B, relative to the largest that they may be, that a mode has by rounding
_MODE = 1e-9
#: multipliers up to this count as zero: that of a block may be wrong
_GONE = 1e-6
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
def _sizes(tangents, active):
    """Sizes of the Fourier coefficients -top .. top of the channels `active`, and of the next one if they go on as
    those of a jump do, (2, G, 2 top + 2).
    """
    top = tangents.shape[2] - 1
    sizes = np.zeros((2, active.shape[0], 2 * top + 2))
    for part in range(2):
        for g in range(active.shape[0]):
            squares = 0.0
            for n in range(top + 1):
                size = abs(tangents[part, active[g], n])
                sizes[part, g, top - n] = sizes[part, g, top + n] = size
                if 2 * n > top:
                    squares += (n * size) ** 2 / (top - top // 2)
            sizes[part, g, 2 * top + 1] = math.sqrt(squares) / (top + 1.0)
    return sizes


@kernel(fastmath=_FAST, error_model="numpy")
def _couplings(spectra, sizes, i, b, slow, w, stiff, moving, back):
    """Squares of what couples a motion of block i, of the rate `slow`, and block b, of the rate w, by all coefficients
    of stiffness, and by those of damping as far as it reads the rate of b, into stiff and moving (2 top + 2,); returns
    the sum of the latter. back: room to work in.
    """
    total = 0.0
    for n in range(stiff.shape[0]):
        stiff[n] = moving[n] = back[n] = 0.0
    for g in range(spectra.shape[1]):
        reads, drives = sizes[0, i, g] * sizes[1, b, g], sizes[0, b, g] * sizes[1, i, g]
        for n in range(stiff.shape[0]):
            stiff[n] += reads * spectra[0, g, n]
            moving[n] += reads * spectra[1, g, n]
            back[n] += drives * (spectra[0, g, n] + slow * spectra[1, g, n])
    for n in range(stiff.shape[0]):
        stiff[n] *= back[n]
        moving[n] *= w * back[n]
        total += moving[n]
    return total


@kernel(fastmath=_FAST, error_model="numpy")
def _answers(stiff, own, nu, rate, w, decay, width):
    """Real and imaginary part of the sum of couplings times `1 - H(s + i n omega) / H(0)` for a mode."""
    real = imaginary = 0.0
    top = stiff.shape[0] // 2 - 1
    for n in range(2 * top + 1):
        s = nu + (n - top) * rate
        x, y, square, turn = w * w - s * s, width * s, s * s + own, 2.0 * decay * s
        part = stiff[n] / (x * x + y * y)
        real -= part * (square * x - turn * y)
        imaginary += part * (square * y + turn * x)
    return real, imaginary


@kernel(fastmath=_FAST, error_model="numpy")
def _shift(stiff, moving, damped, slow, fast, rate, turning):
    """What a block of the exponent `fast` adds to the exponent `slow` if it has no states; stiff, moving: see
    `_couplings`; damped: whether any of the latter is there; turning: see `blocks.Blocks`.
    """
    top, own, nu = stiff.shape[0] // 2 - 1, slow.real * slow.real, abs(slow.imag)
    w, decay, apart = abs(fast), abs(fast.real), abs(fast.real - slow.real)
    # at resonance the two repel each other
    near = top + min(top + 1, max(0, round((w - nu) / rate)))
    width = 2.0 * math.hypot(apart, math.sqrt(stiff[near] + moving[near])) + _TINY
    real = imaginary = other = 0.0
    if 0.0 <= turning < _MODE and not damped:
        real, imaginary = _answers(stiff, own, nu, rate, w, decay, width)
    else:
        for n in range(2 * top + 1):
            s = nu + (n - top) * rate
            size = math.sqrt(s * s + own)
            if turning < 0.0:
                lag = size / max(abs(s), apart, _TINY)
            else:
                lag = size * (size + 2.0 * decay + w * turning) / max(math.hypot(w * w - s * s, width * s), _TINY)
            other += stiff[n] * lag + moving[n] * size / w * (lag + 1.0)
    # beyond: an integral, and at resonance what is left of the block after a period
    last = (top + 0.5) * rate
    jump = (top + 1.0) * (top + 1.0) * rate / w * (stiff[2 * top + 1] + moving[2 * top + 1])
    real += jump * math.log((last + w) / max(abs(last - w), 0.5 * rate))
    if w > last:
        other += jump * 2.0 * math.pi * (nu / w + 1.0 / math.expm1(min(math.pi * width / rate, 50.0)))
    return (math.hypot(real, imaginary) + other) / w


@kernel()
def moved_without(tangents, active, rate, exponents, first, sizes, turning, coupled, resolved, most):
    """How far all blocks from each one on move multipliers of those before it if they have no states, (B + 1,);
    infinite where that is more than `most`.

    A block that follows forces like a spring answers them at every frequency as at zero. A motion with the exponent s
    makes forces at `s + i n omega` by the Fourier coefficients k_n of the stiffness, which adds to s

        sum_n l k_n (H(s + i n omega) - H(0)) k_n r,    H(s) - H(0) = s ((s - tr L) R - G B) / ((s - L) (s - L*)),

    H the response of the block without states, to first order: of the size `(|s| / |L|)^2` for slow forces, and at
    resonance what couples the two and no more. Frequencies below and above that of a mode act against each other.
    Behind the last coefficient that is known those of a stiffness that jumps follow. A block without states has no rate
    either, that damping would read.

    tangents (2, C, top + 1): Fourier coefficients of stiffness and damping; active (G,): the channels that act; rate:
    omega; exponents, first, sizes, turning, coupled: see `blocks.Blocks`; resolved: a rate up to which all blocks have
    states; most: a limit.
    """
    spectra, period = _sizes(tangents, active), 2.0 * math.pi / rate
    moved, shifts = np.full(coupled + 1, np.inf), np.zeros(coupled)
    room = np.empty((3, spectra.shape[2]))
    stiff, moving, back = room[0], room[1], room[2]
    moved[coupled] = 0.0
    for b in range(coupled - 1, -1, -1):
        fast, worst = exponents[first[b]], 0.0
        w = abs(fast)
        if not w > resolved:
            break
        for i in range(b):
            slow = exponents[first[i]]
            left = math.exp(min(0.0, slow.real) * period)
            if left > _GONE:
                damped = _couplings(spectra, sizes, i, b, abs(slow), w, stiff, moving, back) > 0.0
                shifts[i] += _shift(stiff, moving, damped, slow, fast, rate, turning[b])
                worst = max(worst, left * math.expm1(min(shifts[i] * period, 1.0)))
        if not worst <= most:
            break
        moved[b] = worst
    return moved


@kernel()
def states_needed(spans, forces, law, base, active, held, moved, limits):
    """How many blocks have states on panels with dt/ds = spans (P, m), how far the others may move multipliers,
    relative to the largest, the largest force that the motion leaves unbalanced, and whether any channel acts.

    forces (C, .): Fourier coefficients of all channels; law, base (C, P): forces, stiffness and damping at the nodes,
    and what is added to the stiffness on every panel; active: the channels that act; held (2, G): integrals of
    stiffness and damping over the period; moved: see `moved_without`. limits: how far blocks without states may move
    multipliers, and how much further where the motion leaves all of a force unbalanced.
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
    tolerable = limits[0] + limits[1] * min(1.0, left / whole)
    coupled = moved.shape[0] - 1
    dynamic = coupled
    for b in range(coupled - 1, -1, -1):
        if not moved[b] <= tolerable:
            break
        if b % max(1, coupled // _LEVELS) == 0:
            dynamic = b
    return dynamic, moved[dynamic], left, acting


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
