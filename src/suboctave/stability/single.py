"""Compiled kernels for one degree of freedom: `y'' + c(t) y' + k(t) y = -r(t)` on the panels of `panels`.

On a step the Magnus expansion writes the propagator as one exponential. With `A_i = h^-i int (t - t_mid)^i A dt` and

    a1 = 3/4 (3 A_0 - 20 A_2),   a2 = 12 A_1,   a3 = -15 (A_0 - 12 A_2)
    Omega = a1 + a3/12 + [-20 a1 - a3 + C1, a2 + C2] / 240,   C1 = [a1, a2],   C2 = -[a1, 2 a3 + C1] / 60

it is of order six (Blanes, Casas, Oteo & Ros, Phys. Rep. 470 (2009) 151-238, section 5.3), exact where A is constant.
The moments are those of the polynomials through a panel's nodes. Of `A = [[0, 1], [-k, -c]]` the trace commutes with
everything: what remains is `[[a, b], [-k, -a]]` with b = 1, a = c / 2, whose exponential and commutators are closed
forms, and the product of the multipliers is `exp(-int c dt)` to rounding (Liouville).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from suboctave.stability.panels import NODES, ORDER, moments

#: most steps per panel with moments of their own; more of them share the parabola of one
_MOST = 8
#: error of the fine steps per panel, and of the coarse ones, in units of the Magnus expansion's leading error
_FINE, _COARSE = 1.0e-8, 6.4e-7


def _tables() -> np.ndarray:
    """Matrices from values at the nodes to a1, a2, a3 on every step of a panel with n steps; (n, step, 3, ORDER)."""
    out = np.zeros((_MOST + 1, _MOST, 3, ORDER))
    for n in range(1, _MOST + 1):
        ends = np.linspace(-1.0, 1.0, n + 1)
        for i in range(n):
            a = moments(ends[i], ends[i + 1], 3)
            out[n, i] = 0.75 * (3.0 * a[0] - 20.0 * a[2]), 12.0 * a[1], -15.0 * (a[0] - 12.0 * a[2])
    return out


STEPS = _tables()
#: the same for A_0 and A_1 between neighbouring nodes: (ORDER - 1, 2, ORDER)
BETWEEN = np.array([moments(NODES[i], NODES[i + 1], 2) for i in range(ORDER - 1)])


@njit(cache=True)
def _waves(q, decay):
    """`cos(sqrt q)` and `sin(sqrt q) / sqrt q`, times `exp(-decay)`."""
    if abs(q) < 0.25:
        e = math.exp(-decay)
        c = 1.0 - q * (
            1.0 / 2.0
            - q * (1.0 / 24.0 - q * (1.0 / 720.0 - q * (1.0 / 40320.0 - q * (1.0 / 3628800.0 - q / 479001600.0))))
        )
        s = 1.0 - q * (
            1.0 / 6.0
            - q * (1.0 / 120.0 - q * (1.0 / 5040.0 - q * (1.0 / 362880.0 - q * (1.0 / 39916800.0 - q / 6227020800.0))))
        )
        return e * c, e * s
    if q > 0.0:
        e = math.exp(-decay)
        w = math.sqrt(q)
        return e * math.cos(w), e * math.sin(w) / w
    # both exponents on their own, so that heavy damping does not overflow
    w = math.sqrt(-q)
    slow = 0.5 * math.exp(w - decay)
    fast = 0.5 * math.exp(-w - decay)
    return slow + fast, (slow - fast) / w


@njit(cache=True)
def _exponent(a1, b1, k1, a2, b2, k2, a3, b3, k3):
    """Omega as (a, b, k), from the moments a1, a2, a3 in the same form."""
    # [(a, b, k), (a', b', k')] = (b' k - b k', 2 (a b' - a' b), 2 (a' k - a k'))
    u = b2 * k1 - b1 * k2
    v = 2.0 * (a1 * b2 - a2 * b1)
    w = 2.0 * (a2 * k1 - a1 * k2)
    ua = 2.0 * a3 + u
    ub = 2.0 * b3 + v
    uk = 2.0 * k3 + w
    ra = a2 - (ub * k1 - b1 * uk) / 60.0
    rb = b2 - 2.0 * (a1 * ub - ua * b1) / 60.0
    rk = k2 - 2.0 * (ua * k1 - a1 * uk) / 60.0
    la = u - 20.0 * a1 - a3
    lb = v - 20.0 * b1 - b3
    lk = w - 20.0 * k1 - k3
    return (
        a1 + a3 / 12.0 + (rb * lk - lb * rk) / 240.0,
        b1 + b3 / 12.0 + 2.0 * (la * rb - ra * lb) / 240.0,
        k1 + k3 / 12.0 + 2.0 * (ra * lk - la * rk) / 240.0,
    )


@njit(cache=True)
def monodromy_single(stretch, scale, base, k, damping, c, kick, tables, fine):
    """Trace of the monodromy matrix, and `int c dt`.

    stretch: dtau/ds (P, m); scale: dt/dtau; base (P,): constant part of the stiffness on every panel, k (N,) its
    varying part at the nodes; damping: constant part, c (N,) or (0,) the varying one; kick (P,): an impulse
    `-kick y` at the beginning of every panel.
    """
    count, m = stretch.shape
    varying = c.shape[0] > 0
    tolerance = _FINE if fine else _COARSE
    jj = np.empty(m)
    kk = np.empty(m)
    cc = np.empty(m)
    p11, p12, p21, p22 = 1.0, 0.0, 0.0, 1.0
    total = 0.0
    for p in range(count):
        if kick[p] != 0.0:
            p21 -= kick[p] * p11
            p22 -= kick[p] * p12
        at = p * (m - 1)
        low = high = k[at]
        rate = length = swing = 0.0
        for j in range(m):
            g = scale * stretch[p, j]
            value = k[at + j]
            low = min(low, value)
            high = max(high, value)
            length = max(length, g)
            jj[j] = g
            kk[j] = g * (value + base[p])
            half = 0.5 * (damping + c[at + j]) if varying else 0.5 * damping
            cc[j] = g * half
            rate = max(rate, abs(value + base[p] - half * half))
            swing = max(swing, abs(half - 0.5 * damping))
        length *= 2.0
        angle = rate * length * length
        change = (high - low) * length * length + 2.0 * swing * length * (1.0 + math.sqrt(angle))
        # the leading error of a step is rarely more than (angle + 0.3)^2 change / 400
        want = change * (angle + 0.3) ** 2 / 400.0 / tolerance
        steps = 1
        while steps < 1000 and steps**6 < want:
            steps += 1
        parts = 1
        if steps > _MOST:
            parts = math.ceil(steps / _MOST)
            steps = _MOST
        for i in range(steps):
            a1 = a2 = a3 = b1 = b2 = b3 = k1 = k2 = k3 = 0.0
            for j in range(m):
                w = tables[steps, i, 0, j]
                a1 += w * cc[j]
                b1 += w * jj[j]
                k1 += w * kk[j]
                w = tables[steps, i, 1, j]
                a2 += w * cc[j]
                b2 += w * jj[j]
                k2 += w * kk[j]
                w = tables[steps, i, 2, j]
                a3 += w * cc[j]
                b3 += w * jj[j]
                k3 += w * kk[j]
            for part in range(parts):
                if parts == 1:
                    decay = a1 + a3 / 12.0
                    a, b, q = _exponent(a1, b1, k1, a2, b2, k2, a3, b3, k3)
                else:
                    r = 1.0 / parts
                    x = (part + 0.5) * r - 0.5
                    first = r * (a1 + x * (a2 + x * a3))
                    third = r * r * r * a3
                    decay = first + third / 12.0
                    a, b, q = _exponent(
                        first,
                        r * (b1 + x * (b2 + x * b3)),
                        r * (k1 + x * (k2 + x * k3)),
                        r * r * (a2 + 2.0 * x * a3),
                        r * r * (b2 + 2.0 * x * b3),
                        r * r * (k2 + 2.0 * x * k3),
                        third,
                        r * r * r * b3,
                        r * r * r * k3,
                    )
                total += decay
                co, si = _waves(b * q - a * a, decay)
                m11 = co + a * si
                m12 = b * si
                m21 = -q * si
                m22 = co - a * si
                n11 = m11 * p11 + m12 * p21
                n12 = m11 * p12 + m12 * p22
                p21, p22 = m21 * p11 + m22 * p21, m21 * p12 + m22 * p22
                p11, p12 = n11, n12
    return p11 + p22, 2.0 * total


@njit(cache=True)
def respond_single(stretch, scale, base, k, damping, c, force, between, most):
    """The periodic solution of `d'' + c d' + k d = -force` at the nodes: d, d' (N,), and its share of the whole.

    Magnus steps of order four from node to node: the force is known no better. A solution larger than `most` (close to
    a limit point there is none) is taken in the share that makes it as large.
    """
    count, m = stretch.shape
    intervals = count * (m - 1)
    varying = c.shape[0] > 0
    jj = np.empty(m)
    kk = np.empty(m)
    cc = np.empty(m)
    rr = np.empty(m)
    step = np.empty((intervals, 6))
    p11, p12, p21, p22 = 1.0, 0.0, 0.0, 1.0
    e1 = e2 = 0.0
    for p in range(count):
        at = p * (m - 1)
        for j in range(m):
            g = scale * stretch[p, j]
            jj[j] = g
            kk[j] = g * (k[at + j] + base[p])
            cc[j] = 0.5 * g * (damping + c[at + j]) if varying else 0.5 * g * damping
            rr[j] = g * force[at + j]
        for i in range(m - 1):
            a0 = a1 = b0 = b1 = k0 = k1 = r0 = r1 = 0.0
            for j in range(m):
                w = between[i, 0, j]
                a0 += w * cc[j]
                b0 += w * jj[j]
                k0 += w * kk[j]
                r0 += w * rr[j]
                w = between[i, 1, j]
                a1 += w * cc[j]
                b1 += w * jj[j]
                k1 += w * kk[j]
                r1 += w * rr[j]
            # Omega = A_0 - [A_0, A_1], acting on (y, y', 1)
            a = a0 - (b1 * k0 - b0 * k1)
            b = b0 - 2.0 * (a0 * b1 - a1 * b0)
            q = k0 - 2.0 * (a1 * k0 - a0 * k1)
            f1 = b0 * r1 - b1 * r0
            f2 = a1 * r0 - a0 * r1 - r0
            square = b * q - a * a
            co, si = _waves(square, a0)
            s = step[at + i]
            s[0] = co + a * si
            s[1] = b * si
            s[2] = -q * si
            s[3] = co - a * si
            co, si = _waves(square, 0.5 * a0)
            half = math.exp(-0.5 * a0)
            rest = (half - co) / square if abs(square) > 1e-4 else half * (0.5 - square / 24.0)
            s[4] = si * f1 + rest * (a * f1 + b * f2)
            s[5] = si * f2 - rest * (q * f1 + a * f2)
            n11 = s[0] * p11 + s[1] * p21
            n12 = s[0] * p12 + s[1] * p22
            p21, p22 = s[2] * p11 + s[3] * p21, s[2] * p12 + s[3] * p22
            p11, p12 = n11, n12
            e1, e2 = s[0] * e1 + s[1] * e2 + s[4], s[2] * e1 + s[3] * e2 + s[5]
    out = np.empty((2, intervals + 1))
    det = (1.0 - p11) * (1.0 - p22) - p12 * p21
    if det == 0.0:
        det = 1e-300
    d = ((1.0 - p22) * e1 + p12 * e2) / det
    v = (p21 * e1 + (1.0 - p11) * e2) / det
    out[0, 0] = d
    out[1, 0] = v
    largest = abs(d)
    for i in range(intervals):
        s = step[i]
        d, v = s[0] * d + s[1] * v + s[4], s[2] * d + s[3] * v + s[5]
        out[0, i + 1] = d
        out[1, i + 1] = v
        largest = max(largest, abs(d))
    share = 1.0
    if not largest <= most:
        share = most / largest if largest < np.inf else 0.0
        out *= share
        if not np.isfinite(share) or share == 0.0:
            out[:] = 0.0
            share = 0.0
    return out, share
