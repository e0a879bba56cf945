"""What happens along a motion: crossings of gaps, extrema that miss them, passages of sharp laws."""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.instants import _jet, crossings_of
from suboctave.harmonic.kernels import motion

#: extrema that miss a gap by less than this share of the motion are kept in sight: the true motion may touch it
_MISS = 1e-3


@kernel()
def _note(row, tau, depth, slope, bend, miss, piece):
    row[0] = tau
    row[1] = depth
    row[2] = slope
    row[3] = bend
    row[4] = miss
    row[5] = piece


@kernel()
def grown(rows):
    """Twice as many rows, the first of them copied."""
    out = np.empty((2 * rows.shape[0], rows.shape[1]))
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            out[i, j] = rows[i, j]
    return out


@kernel()
def in_order(rows, count):
    """The first rows, ascending in their first entry: by insertion, they are few and nearly sorted."""
    width = rows.shape[1]
    out = np.empty((count, width))
    for k in range(count):
        i = k
        while i > 0 and out[i - 1, 0] > rows[k, 0]:
            for j in range(width):
                out[i, j] = out[i - 1, j]
            i -= 1
        for j in range(width):
            out[i, j] = rows[k, j]
    return out


@kernel()
def events_along(c, pieces, owner, passed, zr, zi):
    """What happens along the motion, ascending in tau: rows (tau, depth, du/dtau, d2u/dtau2, miss, piece).

    A crossing of the gap of a piece has infinite depth; an extremum that falls short of it is kept with the distance
    `miss`. A passage of a sharp law has the distance of its complex singularity for depth, and -1 for piece: they are
    given by `passed` (2, K), instants and depths.
    """
    n = zr.shape[0]
    h = 2.0 * math.pi / n
    found = np.empty((4 * n + 16, 6))
    count = np.int64(0)
    last = -1
    size = 0.0
    values = np.empty((2, 0))
    for q in range(pieces.shape[0]):
        g = owner[q]
        gap = pieces[q, 1]
        if g != last:
            values = motion(c[g], zr, zi)
            low = high = values[0, 0]
            for j in range(n):
                low = min(low, values[0, j])
                high = max(high, values[0, j])
            size = high - low
            last = g
        at, _above = crossings_of(c[g], gap, values)
        while count + at.shape[0] + n > found.shape[0]:
            found = grown(found)
        for i in range(at.shape[0]):
            _x, d, s = _jet(c[g], math.cos(at[i]), math.sin(at[i]))
            _note(found[count], at[i], np.inf, d, s, 0.0, q)
            count += 1
        for j in range(n):
            follow = j + 1 if j + 1 < n else 0
            f0 = values[0, j] - gap
            f1 = values[0, follow] - gap
            d0 = values[1, j]
            d1 = values[1, follow]
            # an extremum towards the gap that falls short of it
            if d0 * d1 >= 0.0 or (f0 > 0.0) != (d0 < 0.0) or (f0 > 0.0) != (f1 > 0.0):
                continue
            if min(abs(f0), abs(f1)) > h * (abs(d0) + abs(d1)) + _MISS * size:
                continue
            tau = j * h + h * d0 / (d0 - d1)
            x, d, s = _jet(c[g], math.cos(tau), math.sin(tau))
            for _ in range(3):
                if s != 0.0 and abs(d / s) < h:
                    tau -= d / s
                    x, d, s = _jet(c[g], math.cos(tau), math.sin(tau))
            if abs(x - gap) < _MISS * size and (x > gap) == (f0 > 0.0) and s != 0.0:
                _note(found[count], tau, np.inf, 0.0, s, x - gap, q)
                count += 1
    while count + passed.shape[1] > found.shape[0]:
        found = grown(found)
    for i in range(passed.shape[1]):
        _note(found[count], passed[0, i], passed[1, i], 0.0, 0.0, 0.0, np.int64(-1))
        count += 1
    return in_order(found, count)


@kernel()
def depths(events):
    """Distance from every event to the nearest complex singularity, its own or another's."""
    n = events.shape[0]
    out = np.empty(n)
    for i in range(n):
        least = events[i, 1]
        for j in range(n):
            if events[j, 1] < np.inf:
                apart = abs(events[i, 0] - events[j, 0])
                least = min(least, math.hypot(min(apart, 2.0 * math.pi - apart), events[j, 1]))
        out[i] = least
    return out
