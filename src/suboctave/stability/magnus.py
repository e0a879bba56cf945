"""The Magnus expansion of order six on the steps of a panel, for one degree of freedom (formulae: see `single`)."""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.stability.nodes import NODES, ORDER, moments

#: most steps per panel with moments of their own; more of them share the parabola of one
MOST = 8


def _tables() -> np.ndarray:
    """Matrices from values at the nodes to a1, a2, a3 on every step of a panel with n steps.

    Shape (2, n, step, 3, ORDER): for the polynomials through all nodes, and for the same without their two highest
    Legendre components, which tell how well a panel is resolved.
    """
    legendre = np.polynomial.legendre.legvander(NODES, ORDER - 1)
    kept = np.diag(np.arange(ORDER) < ORDER - 2).astype(float)
    lower = legendre @ kept @ np.linalg.inv(legendre)
    out = np.zeros((2, MOST + 1, MOST, 3, ORDER))
    for n in range(1, MOST + 1):
        ends = np.linspace(-1.0, 1.0, n + 1)
        for i in range(n):
            a = moments(ends[i], ends[i + 1], 3)
            out[0, n, i] = 0.75 * (3.0 * a[0] - 20.0 * a[2]), 12.0 * a[1], -15.0 * (a[0] - 12.0 * a[2])
            out[1, n, i] = out[0, n, i] @ lower
    return out


STEPS = _tables()
#: the same for A_0 and A_1 between neighbouring nodes: (ORDER - 1, 2, ORDER)
BETWEEN = np.array([moments(NODES[i], NODES[i + 1], 2) for i in range(ORDER - 1)])


@kernel(at_once=True)
def waves(q, decay):
    """`cos(sqrt q)` and `sin(sqrt q) / sqrt q`, with or without a factor `exp(-decay)`, and the decay left to apply."""
    if abs(q) < 0.25:
        c = 1.0 - q * (
            1.0 / 2.0
            - q * (1.0 / 24.0 - q * (1.0 / 720.0 - q * (1.0 / 40320.0 - q * (1.0 / 3628800.0 - q / 479001600.0))))
        )
        s = 1.0 - q * (
            1.0 / 6.0
            - q * (1.0 / 120.0 - q * (1.0 / 5040.0 - q * (1.0 / 362880.0 - q * (1.0 / 39916800.0 - q / 6227020800.0))))
        )
        return c, s, decay
    if q > 0.0:
        w = math.sqrt(q)
        return math.cos(w), math.sin(w) / w, decay
    # both exponents on their own, so that heavy damping does not overflow
    w = math.sqrt(-q)
    slow = 0.5 * math.exp(w - decay)
    fast = 0.5 * math.exp(-w - decay)
    return slow + fast, (slow - fast) / w, 0.0


@kernel(at_once=True)
def exponent(a1, b1, k1, a2, b2, k2, a3, b3, k3):
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
