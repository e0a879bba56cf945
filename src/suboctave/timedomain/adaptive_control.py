"""What an adaptive integrator decides after a step has been tried, for one trajectory of many side by side.

A step is accepted, repeated with another length, or cut where a corner of a law is met. Corners are located without
an interpolant: the margin over the first interval is Hermite's cubic, a step is tried to its zero, and tried again
until it lands there; then the flag of the corner is turned. A trial that stops short of the corner is a step like any
other. A force that is continuous has no jump at the corner, so that landing within `e` leaves an error of order e^2,
provided that the next step begins with a rate of its own: the last stage before has the old flag, and is wrong by e.

Tangent vectors are made orthonormal after every accepted step (Gram and Schmidt): the lengths that they lose are the
factors of an upper triangular matrix, whose logarithms, summed over a long time and divided by it, are the Lyapunov
exponents (Benettin et al., Meccanica 15, 1980). Once in a period would do for those that matter; after every step it
costs little and keeps directions that decay by hundreds of orders of magnitude within a period.

Step lengths follow Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.5.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import DOP853

from suboctave.compiled import kernel

__all__ = ["ERROR_3", "ERROR_5", "NODES", "SCALARS", "STAGES", "VECTORS", "control", "follow"]

#: the method of Dormand and Prince of order 8; the last row is the state at the end of the step
STAGES = np.zeros((13, 12))
STAGES[:12], STAGES[12] = DOP853.A, DOP853.B
NODES = np.append(DOP853.C, 1.0)
ERROR_3, ERROR_5 = np.ascontiguousarray(DOP853.E3), np.ascontiguousarray(DOP853.E5)

#: the first rows of all, one number each
SCALARS = (
    "h", "next", "t", "period", "omega", "theta", "sample", "slot", "left", "tries", "stuck", "failed", "calm",
    "turning", "spent", "accepted", "extra", "stale", "used", "volume_rate", "volume", "seen", "plain",
)  # fmt: skip
(
    _H, _NEXT, _T, _PERIOD, _OMEGA, _, _SAMPLE, _SLOT, _LEFT, _TRIES, _STUCK, _FAILED, _CALM,
    _TURNING, _SPENT, _ACCEPTED, _EXTRA, _STALE, _USED, _VOLUME_RATE, _VOLUME, _SEEN, _PLAIN,
) = range(len(SCALARS))  # fmt: skip
#: names of several rows, in the order of the array that says where they begin
VECTORS = (
    "y", "trial", "K", "e3", "e5", "on", "g", "dg", "g1", "dg1", "now", "past", "floor", "peak", "weight", "crest",
    "w", "goal", "metric", "log", "turn", "fold",
)  # fmt: skip
(
    _Y, _TRIAL, _K, _E3, _E5, _ON, _G, _DG, _G1, _DG1, _NOW, _PAST, _FLOOR, _PEAK, _WEIGHT, _CREST,
    _W, _GOAL, _METRIC, _LOG, _TURNED, _FOLD,
) = range(len(VECTORS))  # fmt: skip
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


@kernel(inner=True, error_model="numpy")
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


@kernel(inner=True, error_model="numpy")
def _folded(x, turn):
    """|x| of an angle taken within half a turn; of what is no angle, the turn of which is beyond all numbers, |x|."""
    return abs(x - turn * math.floor(x / turn + 0.5))


@kernel(inner=True, error_model="numpy")
def _turn(c, at, n, i, h):
    """Where velocity i changes sign in the step tried, as a share of it, and |displacement| there, by a quintic."""
    y, k, trial = at[_Y] + i, at[_K] + n + i, at[_TRIAL] + i
    x0, v0, a0, x1, v1, a1 = c[y], c[y + n], c[k], c[trial], c[trial + n], c[k + 24 * n]
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
    top = ((((c5 * low + c4) * low + c3) * low + c2) * low + h * v0) * low + x0
    return low, _folded(top, c[at[_FOLD] + i])


@kernel(inner=True, error_model="numpy")
def _cut(c, at, n, corners, h, period, measure):
    """The corner at which the trial step has landed, -1 if none; -2 if a shorter step must be tried.

    A step is cut at the first corner that it passes, and with `measure` where a displacement is largest: that is read
    at the ends of steps.
    """
    first, which, landed = 2.0, -1, -1
    for i in range(corners):
        sign = 2.0 * c[at[_ON] + i] - 1.0
        m1, d1 = sign * c[at[_G1] + i], sign * c[at[_DG1] + i]
        if m1 < 0.0 and (-m1 <= _LANDED * period * abs(d1) or c[_TRIES] >= _TRIALS):
            landed = i
            continue
        m0, d0 = sign * c[at[_G] + i], sign * c[at[_DG] + i]
        if 0.0 < m0 <= -_LANDED * period * d0:
            # the last step has landed just short of it: by rounding no shorter one might come closer
            m0 = 0.0
        if m1 >= 0.0 and d1 >= 0.0 and d0 >= 0.0:
            continue
        x = _first_root(m0, h * d0, m1, h * d1)
        if x >= 0.0 and x < first:
            first, which = x, i
    if which >= 0 and c[_STUCK] <= 2.0 * corners + 2.0:
        if first == 0.0:
            # over the corner at once: its flag was on the wrong side
            c[at[_ON] + which] = 1.0 - c[at[_ON] + which]
            c[_STALE] = 1.0
            c[_STUCK] += 1.0
            return -2
        # a little beyond: the margin is judged by its sign, and a step that stops short is accepted
        share = first * (1.0 + 1e-12)
        if share < 0.999999 and c[_TRIES] < _TRIALS:
            c[_H] = max(h * share, _SHORTEST * period)
            c[_TRIES] += 1.0
            return -2
        if c[at[_G1] + which] * (2.0 * c[at[_ON] + which] - 1.0) < 0.0:
            landed = which
    if measure and c[_TURNING] == 0.0:
        share = 1.0
        for i in range(n):
            if c[at[_Y] + n + i] * c[at[_TRIAL] + n + i] < 0.0:
                x, top = _turn(c, at, n, i, h)
                if top >= max(c[at[_PEAK] + i], _HIGH * c[at[_CREST] + i]) and 0.001 < x < share:
                    share = x
        if share < 0.999:
            c[_H] = h * share
            c[_TURNING] = 1.0
            return -2
    return landed


@kernel(inner=True, error_model="numpy")
def _accept(c, l, at, n, corners, samples, skip, h, landed, out, peaks, measure):
    """Take the trial step, write the state at a sample, and limit the next step to the next sample.

    The corner that it landed at and all that lie behind are turned. Returns 1 after the last sample.
    """
    c[_ACCEPTED] = 1.0
    c[_TURNING] = c[_TRIES] = c[_STUCK] = 0.0
    for i in range(n):
        x1, v1 = c[at[_TRIAL] + i], c[at[_TRIAL] + n + i]
        if measure:
            fold = c[at[_FOLD] + i]
            top = _folded(x1, fold)
            if math.floor(c[at[_Y] + i] / fold + 0.5) != math.floor(x1 / fold + 0.5):
                top = 0.5 * fold  # past the far side of the turn
            if c[at[_Y] + n + i] * v1 < 0.0:
                top = max(top, _turn(c, at, n, i, h)[1])
            c[at[_PEAK] + i] = max(c[at[_PEAK] + i], top)
        c[at[_NOW] + i] = max(c[at[_NOW] + i], _folded(x1, c[at[_TURNED] + i]), abs(v1) / c[_OMEGA])
    for i in range(2 * n):
        c[at[_Y] + i] = c[at[_TRIAL] + i]
        c[at[_K] + i] = c[at[_K] + 24 * n + i]
    for i in range(corners):
        c[at[_G] + i] = c[at[_G1] + i]
        c[at[_DG] + i] = c[at[_DG1] + i]
        if i == landed or (2.0 * c[at[_ON] + i] - 1.0) * c[at[_G] + i] < 0.0:
            c[at[_ON] + i] = 1.0 - c[at[_ON] + i]
            c[_STALE] = 1.0
    period = c[_PERIOD]
    target = period * (c[_SAMPLE] + 1.0) / samples
    c[_T] += h
    if target - c[_T] <= 1e-12 * period:
        c[_T] = target
        c[_SAMPLE] += 1.0
        c[_LEFT] -= 1.0
        c[_SPENT] = 0.0
        slot = int(c[_SLOT]) - skip
        c[_SLOT] += 1.0
        if slot >= 0:
            for i in range(2 * n):
                out[slot, i, l] = c[at[_Y] + i]
        if measure:
            for i in range(n):
                if slot >= 0:
                    peaks[slot, i, l] = c[at[_PEAK] + i]
                c[at[_CREST] + i] = c[at[_PEAK] + i]
                c[at[_PEAK] + i] = 0.0
        if c[_SAMPLE] >= samples:
            c[_SAMPLE] = c[_T] = 0.0
            # lengths for the tolerance of the next period
            largest = 0.0
            for i in range(n):
                c[at[_PAST] + i] = c[at[_NOW] + i]
                c[at[_NOW] + i] = 0.0
                largest = max(largest, c[at[_PAST] + i] * c[at[_WEIGHT] + i])
            for i in range(n):
                c[at[_FLOOR] + i] = max(_SMALLEST_SHARE * largest / c[at[_WEIGHT] + i], 1e-300)
        if c[_LEFT] <= 0.0:
            c[_H] = 0.0
            return 1
        target = period * (c[_SAMPLE] + 1.0) / samples
    following, remaining = c[_NEXT], target - c[_T]
    if following >= remaining:
        following = remaining
    elif following > 0.5 * remaining:
        following = 0.5 * remaining
    c[_H] = following
    return 0


@kernel(inner=True, error_model="numpy")
def control(z, l, at, n, corners, samples, skip, tolerance, out, peaks, measure):
    """Judge the trial step of lane l and choose the next one. Returns 1 when the trajectory is complete.

    z
        All rows (R, W).
    at
        Where the `VECTORS` begin, of n degrees of freedom and so many corners.
    samples, skip
        Instants per period at which the state is written to `out`, after the first `skip`; with `measure` to `peaks`
        the largest displacements since the instant before.
    """
    c = z[:, l]
    c[_ACCEPTED] = 0.0
    if c[_LEFT] <= 0.0:
        return 1
    h, period = c[_H], c[_PERIOD]
    # the error of the step over what is allowed, in units of the tolerance
    e3 = e5 = 0.0
    for i in range(2 * n):
        dof = i if i < n else i - n
        size = max(c[at[_NOW] + dof], c[at[_PAST] + dof], c[at[_FLOOR] + dof])
        if i >= n:
            size = max(size * c[_OMEGA], abs(c[at[_TRIAL] + i]))
        else:
            size = max(size, _folded(c[at[_TRIAL] + i], c[at[_TURNED] + i]))
        e3 += (c[at[_E3] + i] / size) ** 2
        e5 += (c[at[_E5] + i] / size) ** 2
    error = 0.0 if e3 == 0.0 and e5 == 0.0 else abs(h) * e5 / math.sqrt((e5 + 0.01 * e3) * 2 * n)
    error = max(error, c[_EXTRA]) / tolerance
    rejected = not error <= 1.0
    if rejected:
        h *= _SHRINK if not error < 1e30 else max(_SHRINK, _SAFETY * error**-0.125)
    c[_SPENT] += 1.0
    if c[_SPENT] > _MOST or (rejected and h < _SHORTEST * period):
        c[_FAILED] = 1.0
        c[_LEFT] = c[_H] = 0.0
        c[at[_Y] : at[_Y] + 2 * n] = np.nan
        return 1
    if rejected:
        c[_H] = c[_NEXT] = h
        c[_CALM] = c[_TRIES] = 0.0
        return 0
    landed = _cut(c, at, n, corners, h, period, measure)
    if landed == -2:
        return 0
    grow = _GROW if error < 1e-7 else min(_GROW, _SAFETY * error**-0.125)
    if c[_CALM] == 0.0:
        grow = min(grow, 1.0)
    c[_CALM] = 1.0
    # a step that was cut short says little about the length that the method could take
    c[_NEXT] = max(h * grow, c[_NEXT]) if h < c[_NEXT] else h * grow
    return _accept(c, l, at, n, corners, samples, skip, h, landed, out, peaks, measure)


@kernel(inner=True, error_model="numpy")
def follow(z, l, at, n, count, skip, growth):
    """Take over the `count` tangent vectors of lane l if its step was accepted; at a sample write their `growth`."""
    c = z[:, l]
    if c[_ACCEPTED] == 0.0:
        return
    size, metric = 2 * n, at[_METRIC]
    for i in range(size * count):
        c[at[_W] + i] = c[at[_GOAL] + i]
    c[_VOLUME] += c[_USED] * c[_VOLUME_RATE]
    # Gram and Schmidt's method in the metric of the motion; the logarithms of lost lengths are summed
    for j in range(count if c[_PLAIN] == 0.0 else 0):
        vector = at[_W] + j * size
        for other in range(at[_W], vector, size):
            dot = 0.0
            for i in range(size):
                dot += c[metric + i] ** 2 * c[other + i] * c[vector + i]
            for i in range(size):
                c[vector + i] -= dot * c[other + i]
        length = 0.0
        for i in range(size):
            length += (c[metric + i] * c[vector + i]) ** 2
        length = math.sqrt(length)
        c[at[_LOG] + j] += math.log(length)
        for i in range(size):
            c[vector + i] /= length
    slot = int(c[_SLOT])
    if slot > c[_SEEN]:
        c[_SEEN] = slot
        for j in range(count):
            if slot > skip:
                growth[slot - 1 - skip, j, l] = c[at[_LOG] + j]
            c[at[_LOG] + j] = 0.0
        if slot > skip:
            growth[slot - 1 - skip, count, l] = c[_VOLUME]
        c[_VOLUME] = 0.0
