"""May a function known at a few places vanish in between? Interpolation with a verdict.

Between two neighbouring places p and q the function is taken for the cubic Q through p, q and the two nearest places
beside them. What it may do instead is judged by how well it could have been foretold: the parabola through p and the
two places before it, and the one through q and the two places behind it, part from the cubic by

    E(s) = |f[l2, l1, p, q]| (s - p) (s - l1) (s - l2)    and    |f[p, q, r1, r2]| (q - s) (r1 - s) (r2 - s)

(divided differences). A third difference may be small by chance, where the third derivative changes its sign: that of
the places before, |f[l3, l2, l1, p]|, or behind, |f[q, r1, r2, r3]|, counts where it is larger. A smooth function that
the places resolve has small ones; behind a kink, or where the places are too far apart, the foretelling fails at the
far end by as much as the function may have strayed unseen. No zero hides between p and q if Q keeps its sign beyond
SAFETY times the larger of the two; between places of opposite sign there is one zero only, if this holds on both sides
of that of Q, and its slope there leaves no doubt either. Where there is but one place beside, it serves with p and q as
the second difference does above.

A function that does something between p and q of which neither its values nor those before and after give a hint is
beyond this (and any) test: that is what the length of the examined intervals is reported for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from suboctave.compiled import kernel
from suboctave.continuation.problem import Array

#: times its distance from what could be foretold up to which the interpolating cubic is believed
SAFETY = 2.0
#: fractions of an interval at which it is looked at, beside the extrema of the cubic
_GRID = np.array([0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.98])


def first_doubtful(
    places: Sequence[float],
    tests: Sequence[Array],
    at: int,
    others: Callable[[int], Iterable[Array]] = lambda _: (),
) -> tuple[int, float] | None:
    """The first of several functions of which a zero may hide between `places[at]` and `places[at + 1]`, and where, as
    a fraction of the interval, not too close to its ends, so that both parts shrink; None if none is in doubt.

    Three to eight different places ascend, up to three on either side of the interval; `tests` has at every place the
    functions' signs and logarithms of moduli, (2, m). The side of an exact zero is the caller's business. `others`
    gives for the function k in doubt, in several ways, functions (N, 2, m') with together the same zeros: where none of
    them is in doubt in one of these ways, and no two have a zero, so is k.
    """
    x, values, k = np.array(places), np.array(tests), -1
    while True:
        k, share = _first_doubtful(x, values, at, k + 1)
        if share < 0.0:
            return None
        if not any(_settled(x, functions, at) for functions in others(k)):
            return k, min(0.6, max(0.4, share))


def _settled(places: Array, functions: Array, at: int) -> bool:
    """Whether none of the functions is in doubt, and one at most has a zero."""
    zeros = int(np.count_nonzero(functions[at, 0] != functions[at + 1, 0]))
    return zeros <= 1 and bool(_first_doubtful(places, functions, at, 0)[1] < 0.0)


@kernel(inner=True, forceinline=True)
def _third(places, values, i):
    """The modulus of f[x_i, x_i+1, x_i+2, x_i+3]."""
    a, b, c, d = places[i], places[i + 1], places[i + 2], places[i + 3]
    first = (values[i + 1] - values[i]) / (b - a)
    middle = (values[i + 2] - values[i + 1]) / (c - b)
    last = (values[i + 3] - values[i + 2]) / (d - c)
    return abs(((last - middle) / (d - b) - (middle - first) / (c - a)) / (d - a))


@kernel(inner=True)
def _interpolated(places, tests, at, k, values):
    """Function k in units of its largest value into `values`; its cubic off the chord by `bent`, `third` and `shift`,
    and the third differences that foretell it from before and behind.
    """
    p, q, n = places[at], places[at + 1], places.shape[0]
    # products of many factors leave the range of numbers
    largest = tests[0, 1, k]
    for i in range(1, n):
        largest = max(largest, tests[i, 1, k])
    for i in range(n):
        values[i] = tests[i, 0, k] * np.exp(tests[i, 1, k] - largest)
    chord = (values[at + 1] - values[at]) / (q - p)
    # f[p, q, x] for the places beside
    second = np.empty(n)
    for i in range(n):
        if i != at and i != at + 1:
            second[i] = ((values[i] - values[at]) / (places[i] - p) - chord) / (places[i] - q)
    left, right = at, n - at - 2
    before = behind = 0.0
    if left == 1:
        before = abs(second[at - 1])
    elif left > 1:
        before = _third(places, values, at - 2)
    if right == 1:
        behind = abs(second[at + 2])
    elif right > 1:
        behind = _third(places, values, at)
    if left > 2:
        before = max(before, _third(places, values, at - 3))
    if right > 2:
        behind = max(behind, _third(places, values, at + 1))
    bent, third, shift, count = 0.0, 0.0, p, 0
    for i in (at - 1, at + 2, at - 2, at + 3):
        if 0 <= i < n:
            if count == 0:
                bent, shift = second[i], places[i]
            elif count == 1:
                third = (second[i] - bent) / (places[i] - shift)
            count += 1
    return chord, bent, third, shift, before, behind


@kernel()
def _first_doubtful(places, tests, at, first):
    """`first_doubtful` of tests (N, 2, m) from the function `first` on: which one, and the share, -1 without doubt."""
    p, q = places[at], places[at + 1]
    h, low, high = q - p, max(0, at - 2), min(places.shape[0], at + 4)
    values, grid = np.empty(places.shape[0]), _GRID.shape[0]
    shares, value, doubt = np.empty(grid + 2), np.empty(grid + 2), np.empty(grid + 2)
    for function in range(first, tests.shape[2]):
        chord, bent, third, shift, before, behind = _interpolated(places, tests, at, function, values)
        # one that is nothing all along says nothing
        if np.isnan(values[0]):
            continue
        fp, fq = values[at], values[at + 1]
        same = (fp > 0.0) == (fq > 0.0)
        if same:
            # all that may come off the chord against its lower end
            bend = 0.25 * h * h * (abs(bent) + abs(third) * max(abs(shift - p), abs(shift - q)))
            ahead, back = before, behind
            for i in range(low, at):
                ahead *= abs(q - places[i])
            for i in range(at + 2, high):
                back *= abs(p - places[i])
            if min(abs(fp), abs(fq)) > bend + SAFETY * h * max(ahead, back):
                continue
        sign = 1.0 if fp > 0.0 else -1.0
        # the grid, and in their places where the cubic off the chord is extreme: its derivative is a s^2 + b s + c
        looks = grid
        for k in range(grid):
            shares[k] = _GRID[k]
        a, b, c = 3.0 * third, 2.0 * (bent - third * (shift - p + h)), chord - bent * h + third * (shift - p) * h
        inside = b * b - 4.0 * a * c
        if inside >= 0.0:
            q_root = -0.5 * (b + math.copysign(math.sqrt(inside), b))
            for over, under in ((q_root, a), (c, q_root)):
                if under != 0.0 and 0.0 < over / under < h:
                    share, k = over / (under * h), looks
                    while k > 0 and shares[k - 1] > share:
                        shares[k] = shares[k - 1]
                        k -= 1
                    shares[k] = share
                    looks += 1
        # one zero between places of opposite sign: where the cubic says, and nowhere else
        root, last, value_last = 1.0, 0.0, sign * fp
        for k in range(looks + 1):
            share, here = 1.0, sign * fq
            if k < looks:
                share = shares[k]
                ahead, back = share * h, (1.0 - share) * h
                s = p + ahead
                here = value[k] = sign * (fp + ahead * chord - ahead * back * (bent + third * (s - shift)))
                ahead, back = ahead * before, back * behind
                for i in range(low, at):
                    ahead *= abs(s - places[i])
                for i in range(at + 2, high):
                    back *= abs(s - places[i])
                doubt[k] = SAFETY * max(ahead, back)
            if not same and here <= 0.0 and root == 1.0:
                part = value_last / (value_last - here) if value_last > here else 0.5
                root = last + (share - last) * part
            last, value_last = share, here
        margin, where = np.inf, -1.0
        for k in range(looks):
            if same:
                left_over = value[k] - doubt[k]
            else:
                left_over = value[k] if shares[k] < root else -value[k]
                left_over -= 0.25 * doubt[k] * min(1.0, 4.0 * abs(shares[k] - root))
            if left_over < margin:
                margin, where = left_over, shares[k]
        if margin < 0.0 or (same and margin == 0.0):
            return function, where
    return tests.shape[2], -1.0
