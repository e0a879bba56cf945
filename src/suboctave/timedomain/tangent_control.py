"""What becomes of tangent vectors after an accepted step: they are made orthonormal, and how much they grew is kept.

Gram and Schmidt's method after every step: the lengths that the vectors lose are the factors of an upper triangular
matrix, whose logarithms, summed over a long time and divided by it, are the Lyapunov exponents (Benettin et al. 1980).
Doing so after every step, and not once in a period, costs little and keeps directions that decay by hundreds of orders
of magnitude within a period.
"""

from __future__ import annotations

import math

from numba import njit

__all__ = ["MORE", "follow"]

#: rows that `follow` reads and writes, in the order of its second array of offsets
MORE = ("w", "goal", "metric", "log", "used", "rate_of_volume", "volume", "seen", "plain", "accepted", "slot")
_W, _GOAL, _METRIC, _LOG, _USED, _RATE, _VOLUME, _SEEN, _PLAIN, _ACCEPTED, _SLOT = range(len(MORE))


@njit(cache=True, error_model="numpy")
def follow(z, at, l, lanes, n, m, skip, grown):
    """Take over the tangent vectors of lane l if its step was accepted; at instants asked for, write what grew."""
    if z[at[_ACCEPTED] * lanes + l] == 0.0:
        return
    size = 2 * n
    for i in range(size * m):
        z[(at[_W] + i) * lanes + l] = z[(at[_GOAL] + i) * lanes + l]
    z[at[_VOLUME] * lanes + l] += z[at[_USED] * lanes + l] * z[at[_RATE] * lanes + l]
    if z[at[_PLAIN] * lanes + l] == 0.0:
        for c in range(m):
            for b in range(c):
                dot = 0.0
                for i in range(size):
                    weight = z[(at[_METRIC] + i) * lanes + l]
                    dot += (
                        weight
                        * weight
                        * z[(at[_W] + b * size + i) * lanes + l]
                        * z[(at[_W] + c * size + i) * lanes + l]
                    )
                for i in range(size):
                    z[(at[_W] + c * size + i) * lanes + l] -= dot * z[(at[_W] + b * size + i) * lanes + l]
            length = 0.0
            for i in range(size):
                length += (z[(at[_METRIC] + i) * lanes + l] * z[(at[_W] + c * size + i) * lanes + l]) ** 2
            length = math.sqrt(length)
            z[(at[_LOG] + c) * lanes + l] += math.log(length)
            for i in range(size):
                z[(at[_W] + c * size + i) * lanes + l] /= length
    slot = int(z[at[_SLOT] * lanes + l])
    if slot > z[at[_SEEN] * lanes + l]:
        z[at[_SEEN] * lanes + l] = slot
        if slot > skip:
            for c in range(m):
                grown[slot - 1 - skip, c, l] = z[(at[_LOG] + c) * lanes + l]
            grown[slot - 1 - skip, m, l] = z[at[_VOLUME] * lanes + l]
        for c in range(m):
            z[(at[_LOG] + c) * lanes + l] = 0.0
        z[at[_VOLUME] * lanes + l] = 0.0
