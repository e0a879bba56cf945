"""What happens along a motion: crossings of gaps, extrema that miss them, passages of sharp laws."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from suboctave.harmonic.instants import _jet, crossings_of
from suboctave.harmonic.kernels import motion
from suboctave.harmonic.sharp_nodes import singular_instants

#: extrema that miss a gap by less than this share of the motion are kept in sight: the true motion may touch it
_MISS = 1e-3


@njit(cache=True)
def _note(row, tau, depth, slope, bend, miss, piece):
    row[0] = tau
    row[1] = depth
    row[2] = slope
    row[3] = bend
    row[4] = miss
    row[5] = piece


@njit(cache=True)
def events_along(c, pieces, owner, where, where_owner, zr, zi, reach):
    """What happens along the motion, ascending in tau: rows (tau, depth, du/dtau, d2u/dtau2, miss, piece).

    A crossing of the gap of a piece has infinite depth; an extremum that falls short of it is kept with the distance
    `miss`. A passage of a sharp law has the distance of its complex singularity for depth, and -1 for piece.
    """
    n = zr.shape[0]
    h = 2.0 * math.pi / n
    found = np.empty((4 * n + 16, 6))
    count = 0
    last = -1
    size = 0.0
    values = np.empty((2, 0))
    for q in range(pieces.shape[0]):
        g = owner[q]
        gap = pieces[q, 1]
        if g != last:
            values = motion(c[g], zr, zi)
            size = values[0].max() - values[0].min()
            last = g
        at, _above = crossings_of(c[g], gap, values)
        while count + at.shape[0] + n > found.shape[0]:
            found = np.concatenate((found, np.empty_like(found)))
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
    for g in range(c.shape[0]):
        own = where_owner == g
        if own.any():
            passed = singular_instants(c[g], where[own, 0], where[own, 1], reach, zr, zi)
            while count + passed.shape[1] > found.shape[0]:
                found = np.concatenate((found, np.empty_like(found)))
            for i in range(passed.shape[1]):
                _note(found[count], passed[0, i], passed[1, i], 0.0, 0.0, 0.0, -1)
                count += 1
    return found[np.argsort(found[:count, 0])]


@njit(cache=True)
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
