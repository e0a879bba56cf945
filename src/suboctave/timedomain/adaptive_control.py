"""What an adaptive integrator decides after a step has been tried, for one trajectory of many side by side.

A step is accepted, repeated with another length, or cut where a corner of a law is met. Corners are located without
an interpolant: the margin over the first interval is Hermite's cubic, a step is tried to its zero, and tried again
until it lands there; then the flag of the corner is turned. A trial that stops short of the corner is a step like any
other. A force that is continuous has no jump at the corner, so that landing within `e` leaves an error of order e^2,
provided that the next step begins with a rate of its own: the last stage before has the old flag, and is wrong by e.

Step lengths follow Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.5.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.integrate import DOP853

__all__ = ["ERROR_3", "ERROR_5", "FIELDS", "NODES", "STAGES", "control"]

#: the method of Dormand and Prince of order 8; the last row is the state at the end of the step
STAGES = np.zeros((13, 12))
STAGES[:12], STAGES[12] = DOP853.A, DOP853.B
NODES = np.append(DOP853.C, 1.0)
ERROR_3, ERROR_5 = np.ascontiguousarray(DOP853.E3), np.ascontiguousarray(DOP853.E5)

#: rows that `control` reads and writes, in the order of the offsets that it is given
FIELDS = (
    "y", "trial", "K", "e3", "e5", "on", "g", "dg", "g1", "dg1", "now", "past", "floor", "h", "next", "t", "period",
    "omega", "sample", "slot", "left", "tries", "stuck", "failed", "peak", "calm", "weight",
    "crest", "turning", "spent", "accepted", "extra", "stale",
)  # fmt: skip
(
    _Y, _TRIAL, _K, _E3, _E5, _ON, _G, _DG, _G1, _DG1, _NOW, _PAST, _FLOOR, _H, _NEXT, _T, _PERIOD, _OMEGA, _SAMPLE,
    _SLOT, _LEFT, _TRIES, _STUCK, _FAILED, _PEAK, _CALM, _WEIGHT, _CREST,
    _TURNING, _SPENT, _ACCEPTED, _EXTRA, _STALE,
) = range(len(FIELDS))  # fmt: skip
_SHRINK, _GROW, _SAFETY = 0.3, 6.0, 0.9
#: a corner is reached when it is this share of a period away, or after so many trials
_LANDED, _TRIALS = 1e-10, 12
#: the share of a period below which a step makes no sense
_SHORTEST = 1e-13
#: trials between two samples beyond which a motion is given up: it grows without bound, and quicker and quicker
_MOST = 100000.0
#: the share of its largest part that a degree of freedom counts for at least
_SMALLEST_SHARE = 1e-3
#: a corner is near if a step passes it within this share of the distance at its ends
_NEAR = 0.1
#: displacements above this share of the largest so far may be the largest
_HIGH = 0.9


@njit(cache=True, error_model="numpy")
def _first_root(m0, d0, m1, d1):
    """Where Hermite's cubic on [0, 1] turns negative for the first time, it or its minimum; -1.0 if it does not."""
    a, b = 2.0 * (m0 - m1) + d0 + d1, 3.0 * (m1 - m0) - 2.0 * d0 - d1
    low, top = 0.0, 1.0
    if m1 >= 0.0:
        # both ends are on this side: only a minimum in between can be on the other
        if not (d0 < 0.0 < d1):
            return -1.0
        root = b * b - 3.0 * a * d0
        if root < 0.0:
            return -1.0
        root = math.sqrt(root)
        x = (-b + root) / (3.0 * a) if abs(a) > 1e-300 else -d0 / (2.0 * b)
        low = ((a * x + b) * x + d0) * x + m0
        # the cubic is not the motion: where it comes near, the step is cut at its minimum, and the sign there decides
        near = low < _NEAR * max(m0, m1) and 0.001 < x < 0.999
        return x if 0.0 < x < 1.0 and (low < 0.0 or near) else -1.0
    if m0 <= 0.0:
        # begins at the corner: first away from it, or over it at once
        low = 0.5
        while low > 1e-9 and ((a * low + b) * low + d0) * low + m0 <= 0.0:
            low *= 0.5
        if low <= 1e-9:
            return 0.0
    for _ in range(60):
        x = 0.5 * (low + top)
        if ((a * x + b) * x + d0) * x + m0 > 0.0:
            low = x
        else:
            top = x
    return 0.5 * (low + top)


@njit(cache=True, error_model="numpy")
def _top(x0, v0, a0, x1, v1, a1, h):
    """Where the velocity changes sign within a step, as a share of it, and the displacement there, by a quintic."""
    d = x1 - x0
    c2 = 0.5 * a0 * h * h
    p = d - h * v0 - c2
    q = h * (v1 - v0) - a0 * h * h
    r = h * h * (a1 - a0)
    c3, c4, c5 = 10.0 * p - 4.0 * q + 0.5 * r, -15.0 * p + 7.0 * q - r, 6.0 * p - 3.0 * q + 0.5 * r
    low, top = 0.0, 1.0
    up = v0 > 0.0
    for _ in range(50):
        x = 0.5 * (low + top)
        if ((((5.0 * c5 * x + 4.0 * c4) * x + 3.0 * c3) * x + 2.0 * c2) * x + h * v0 > 0.0) == up:
            low = x
        else:
            top = x
    return low, abs(((((c5 * low + c4) * low + c3) * low + c2) * low + h * v0) * low + x0)


@njit(cache=True, error_model="numpy")
def _turn(z, at, l, lanes, n, i, h):
    """`_top` for degree of freedom i in the step that was tried."""
    y, k, trial = at[_Y] + i, at[_K] + n + i, at[_TRIAL] + i
    return _top(
        z[y * lanes + l],
        z[(y + n) * lanes + l],
        z[k * lanes + l],
        z[trial * lanes + l],
        z[(trial + n) * lanes + l],
        z[(k + 24 * n) * lanes + l],
        h,
    )


@njit(cache=True, error_model="numpy")
def _error(z, at, l, lanes, n):
    """The error of the step over what is allowed, in units of the tolerance."""
    e3 = e5 = 0.0
    omega = z[at[_OMEGA] * lanes + l]
    for i in range(2 * n):
        dof = i if i < n else i - n
        size = max(z[(at[_NOW] + dof) * lanes + l], z[(at[_PAST] + dof) * lanes + l], z[(at[_FLOOR] + dof) * lanes + l])
        trial = abs(z[(at[_TRIAL] + i) * lanes + l])
        if i >= n:
            size *= omega
        size = max(size, trial)
        e3 += (z[(at[_E3] + i) * lanes + l] / size) ** 2
        e5 += (z[(at[_E5] + i) * lanes + l] / size) ** 2
    if e3 == 0.0 and e5 == 0.0:
        return 0.0
    return abs(z[at[_H] * lanes + l]) * e5 / math.sqrt((e5 + 0.01 * e3) * 2 * n)


@njit(cache=True, error_model="numpy")
def _measure(z, at, l, lanes, n):
    """Lengths for the tolerance of the next period."""
    largest = 0.0
    for i in range(n):
        size = z[(at[_NOW] + i) * lanes + l]
        z[(at[_PAST] + i) * lanes + l] = size
        z[(at[_NOW] + i) * lanes + l] = 0.0
        largest = max(largest, size * z[(at[_WEIGHT] + i) * lanes + l])
    for i in range(n):
        z[(at[_FLOOR] + i) * lanes + l] = max(_SMALLEST_SHARE * largest / z[(at[_WEIGHT] + i) * lanes + l], 1e-300)


@njit(cache=True, error_model="numpy")
def _fail(z, at, l, lanes, n):
    z[at[_FAILED] * lanes + l] = 1.0
    z[at[_LEFT] * lanes + l] = 0.0
    z[at[_H] * lanes + l] = 0.0
    for i in range(2 * n):
        z[(at[_Y] + i) * lanes + l] = np.nan


@njit(cache=True, error_model="numpy")
def control(z, at, l, lanes, n, corners, samples, skip, tolerance, out, peaks, measure):
    """Judge the trial step of lane l and choose the next one. Returns 1 when the trajectory is complete."""
    z[at[_ACCEPTED] * lanes + l] = 0.0
    if z[at[_LEFT] * lanes + l] <= 0.0:
        return 1
    h, period = z[at[_H] * lanes + l], z[at[_PERIOD] * lanes + l]
    z[at[_SPENT] * lanes + l] += 1.0
    if z[at[_SPENT] * lanes + l] > _MOST:
        _fail(z, at, l, lanes, n)
        return 1
    t = z[at[_T] * lanes + l]
    error = max(_error(z, at, l, lanes, n), z[at[_EXTRA] * lanes + l]) / tolerance
    if not error <= 1.0:
        share = _SHRINK if not error < 1e30 else max(_SHRINK, _SAFETY * error**-0.125)
        h *= share
        if h < _SHORTEST * period:
            _fail(z, at, l, lanes, n)
            return 1
        z[at[_H] * lanes + l] = h
        z[at[_NEXT] * lanes + l] = h
        z[at[_CALM] * lanes + l] = 0.0
        z[at[_TRIES] * lanes + l] = 0.0
        return 0
    # the first corner that is met
    first, which, landed = 2.0, -1, -1
    for i in range(corners):
        sign = 2.0 * z[(at[_ON] + i) * lanes + l] - 1.0
        m1, d1 = sign * z[(at[_G1] + i) * lanes + l], sign * z[(at[_DG1] + i) * lanes + l]
        if m1 < 0.0 and (-m1 <= _LANDED * period * abs(d1) or z[at[_TRIES] * lanes + l] >= _TRIALS):
            landed = i
            continue
        m0, d0 = sign * z[(at[_G] + i) * lanes + l], sign * z[(at[_DG] + i) * lanes + l]
        if m1 >= 0.0 and d1 >= 0.0 and d0 >= 0.0:
            continue
        x = _first_root(m0, h * d0, m1, h * d1)
        if x >= 0.0 and x < first:
            first, which = x, i
    if which >= 0 and z[at[_STUCK] * lanes + l] <= 2.0 * corners + 2.0:
        tries = z[at[_TRIES] * lanes + l]
        if first == 0.0:
            # over the corner at once: its flag was on the wrong side
            z[(at[_ON] + which) * lanes + l] = 1.0 - z[(at[_ON] + which) * lanes + l]
            z[at[_STALE] * lanes + l] = 1.0
            z[at[_STUCK] * lanes + l] += 1.0
            return 0
        # a little beyond: the margin is judged by its sign, and a step that stops short is accepted
        share = first * (1.0 + 1e-12)
        if share < 0.999999 and tries < _TRIALS:
            z[at[_H] * lanes + l] = max(h * share, _SHORTEST * period)
            z[at[_TRIES] * lanes + l] = tries + 1.0
            return 0
        if z[(at[_G1] + which) * lanes + l] * (2.0 * z[(at[_ON] + which) * lanes + l] - 1.0) < 0.0:
            landed = which
    if measure and z[at[_TURNING] * lanes + l] == 0.0:
        # the largest displacement is looked at from the end of a step: one is cut there, once
        share = 1.0
        for i in range(n):
            v0, v1 = z[(at[_Y] + n + i) * lanes + l], z[(at[_TRIAL] + n + i) * lanes + l]
            if v0 * v1 < 0.0:
                x, top = _turn(z, at, l, lanes, n, i, h)
                high = max(z[(at[_PEAK] + i) * lanes + l], _HIGH * z[(at[_CREST] + i) * lanes + l])
                if top >= high and 0.001 < x < share:
                    share = x
        if share < 0.999:
            z[at[_H] * lanes + l] = h * share
            z[at[_TURNING] * lanes + l] = 1.0
            return 0
    z[at[_ACCEPTED] * lanes + l] = 1.0
    z[at[_TURNING] * lanes + l] = 0.0
    z[at[_TRIES] * lanes + l] = 0.0
    z[at[_STUCK] * lanes + l] = 0.0
    omega = z[at[_OMEGA] * lanes + l]
    for i in range(n):
        x1, v1 = z[(at[_TRIAL] + i) * lanes + l], z[(at[_TRIAL] + n + i) * lanes + l]
        if measure:
            top = abs(x1)
            if z[(at[_Y] + n + i) * lanes + l] * v1 < 0.0:
                top = max(top, _turn(z, at, l, lanes, n, i, h)[1])
            z[(at[_PEAK] + i) * lanes + l] = max(z[(at[_PEAK] + i) * lanes + l], top)
        z[(at[_NOW] + i) * lanes + l] = max(z[(at[_NOW] + i) * lanes + l], abs(x1), abs(v1) / omega)
    for i in range(2 * n):
        z[(at[_Y] + i) * lanes + l] = z[(at[_TRIAL] + i) * lanes + l]
        z[(at[_K] + i) * lanes + l] = z[(at[_K] + 24 * n + i) * lanes + l]
    for i in range(corners):
        z[(at[_G] + i) * lanes + l] = z[(at[_G1] + i) * lanes + l]
        z[(at[_DG] + i) * lanes + l] = z[(at[_DG1] + i) * lanes + l]
    # all corners that lie behind are turned
    for i in range(corners):
        if i == landed or (2.0 * z[(at[_ON] + i) * lanes + l] - 1.0) * z[(at[_G] + i) * lanes + l] < 0.0:
            z[(at[_ON] + i) * lanes + l] = 1.0 - z[(at[_ON] + i) * lanes + l]
            z[at[_STALE] * lanes + l] = 1.0
    grow = _GROW if error < 1e-7 else min(_GROW, _SAFETY * error**-0.125)
    if z[at[_CALM] * lanes + l] == 0.0:
        grow = min(grow, 1.0)
    z[at[_CALM] * lanes + l] = 1.0
    # a step that was cut short says little about the length that the method could take
    following = max(h * grow, z[at[_NEXT] * lanes + l]) if h < z[at[_NEXT] * lanes + l] else h * grow
    z[at[_NEXT] * lanes + l] = following
    # the next instant that is asked for
    sample = z[at[_SAMPLE] * lanes + l]
    target = period * (sample + 1.0) / samples
    t += h
    if target - t <= 1e-12 * period:
        t = target
        sample += 1.0
        left = z[at[_LEFT] * lanes + l] - 1.0
        z[at[_LEFT] * lanes + l] = left
        z[at[_SPENT] * lanes + l] = 0.0
        slot = int(z[at[_SLOT] * lanes + l])
        z[at[_SLOT] * lanes + l] = slot + 1.0
        if slot >= skip:
            for i in range(2 * n):
                out[slot - skip, i, l] = z[(at[_Y] + i) * lanes + l]
            if measure:
                for i in range(n):
                    peaks[slot - skip, i, l] = z[(at[_PEAK] + i) * lanes + l]
        if measure:
            for i in range(n):
                z[(at[_CREST] + i) * lanes + l] = z[(at[_PEAK] + i) * lanes + l]
                z[(at[_PEAK] + i) * lanes + l] = 0.0
        if sample >= samples:
            sample = 0.0
            t = 0.0
            _measure(z, at, l, lanes, n)
        z[at[_SAMPLE] * lanes + l] = sample
        target = period * (sample + 1.0) / samples
        if left <= 0.0:
            z[at[_T] * lanes + l] = t
            z[at[_H] * lanes + l] = 0.0
            return 1
    z[at[_T] * lanes + l] = t
    remaining = target - t
    if following >= remaining:
        following = remaining
    elif following > 0.5 * remaining:
        following = 0.5 * remaining
    z[at[_H] * lanes + l] = following
    return 0
