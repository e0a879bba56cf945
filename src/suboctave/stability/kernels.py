"""Compiled propagation of the linearised motion: products of matrix exponentials over steps.

Every step of length h carries the linearisation at its two Gauss instants; the fourth-order commutator-free scheme
takes

    exp(h (a2 A1 + a1 A2)) exp(h (a1 A1 + a2 A2)),   a1 = 1/4 + sqrt(3)/6,  a2 = 1/4 - sqrt(3)/6

(Blanes & Moan, Appl. Numer. Math. 56 (2006) 1519-1537): midpoint-type exponentials, exact where A is constant.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_A1 = 0.25 + math.sqrt(3.0) / 6.0
_A2 = 0.25 - math.sqrt(3.0) / 6.0


@njit(cache=True)
def propagate_single(stiffness, damping, h):
    """Monodromy of `y'' + c y' + k y = 0` from k and c (2 columns: the Gauss instants) over steps h; shape (2, 2)."""
    p11, p12, p21, p22 = 1.0, 0.0, 0.0, 1.0
    for i in range(h.shape[0]):
        for stage in range(2):
            first = _A1 if stage == 0 else _A2
            second = _A2 if stage == 0 else _A1
            k = 2.0 * (first * stiffness[i, 0] + second * stiffness[i, 1])
            c = 2.0 * (first * damping[i, 0] + second * damping[i, 1])
            t = 0.5 * h[i]
            # exp of t [[0, 1], [-k, -c]] in closed form: co, si are exp(-c t / 2) cos(w t), exp(-c t / 2) sin(w t) / w
            q = k - 0.25 * c * c
            if q * t * t > 1e-8:
                e = math.exp(-0.5 * c * t)
                w = math.sqrt(q)
                co = e * math.cos(w * t)
                si = e * math.sin(w * t) / w
            elif q * t * t < -1e-8:
                # both exponents on their own, so that heavy damping neither overflows nor cancels
                w = math.sqrt(-q)
                slow = math.exp(-k / (w + 0.5 * c) * t) if c > 0.0 else math.exp((w - 0.5 * c) * t)
                fast = math.exp(-(w + 0.5 * c) * t)
                co = 0.5 * (slow + fast)
                si = 0.5 * (slow - fast) / w
            else:
                e = math.exp(-0.5 * c * t)
                co = e * (1.0 - 0.5 * q * t * t)
                si = e * t * (1.0 - q * t * t / 6.0)
            m11 = co + 0.5 * c * si
            m12 = si
            m21 = -k * si
            m22 = co - 0.5 * c * si
            n11 = m11 * p11 + m12 * p21
            n12 = m11 * p12 + m12 * p22
            n21 = m21 * p11 + m22 * p21
            n22 = m21 * p12 + m22 * p22
            p11, p12, p21, p22 = n11, n12, n21, n22
    out = np.empty((2, 2))
    out[0, 0], out[0, 1], out[1, 0], out[1, 1] = p11, p12, p21, p22
    return out


#: size up to which plain loops beat the overhead of BLAS
_SMALL = 7


@njit(cache=True)
def _multiply(a, b, out):
    """`out = a b`."""
    n, m = b.shape
    if n > _SMALL:
        np.dot(a, b, out)
        return
    for i in range(n):
        for j in range(m):
            total = 0.0
            for k in range(n):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@njit(cache=True)
def propagate(base_k, base_c, shapes, stiffness, damping, h):
    """Monodromy of `y'' + C(t) y' + K(t) y = 0`, `K(t) = base_k + sum_e stiffness_e(t) left_e right_e^T`.

    C(t) likewise, from base_c and damping_e; shape (2 n, 2 n). shapes (E, 2, n): left and right vectors; stiffness,
    damping (E, S, 2) at the Gauss instants of the steps h (S,). Exponentials act by their Taylor series, on sub-steps
    short enough for it to reach rounding within twenty terms. DOFs should be weighted alike (by the square roots of
    their masses).
    """
    n = base_k.shape[0]
    # displacements and velocities: y = upper, y' = lower, one column per initial condition
    upper = np.zeros((n, 2 * n))
    lower = np.zeros((n, 2 * n))
    for i in range(n):
        upper[i, i] = 1.0
        lower[i, n + i] = 1.0
    k = np.empty((n, n))
    c = np.empty((n, n))
    term_u = np.empty((n, 2 * n))
    term_l = np.empty((n, 2 * n))
    from_k = np.empty((n, 2 * n))
    from_c = np.empty((n, 2 * n))
    for i in range(h.shape[0]):
        for stage in range(2):
            first = 2.0 * (_A1 if stage == 0 else _A2)
            second = 2.0 * (_A2 if stage == 0 else _A1)
            k[:] = base_k
            c[:] = base_c
            for e in range(shapes.shape[0]):
                ks = first * stiffness[e, i, 0] + second * stiffness[e, i, 1]
                cs = first * damping[e, i, 0] + second * damping[e, i, 1]
                for p in range(n):
                    for q in range(n):
                        o = shapes[e, 0, p] * shapes[e, 1, q]
                        k[p, q] += ks * o
                        c[p, q] += cs * o
            size_k = 0.0
            size_c = 0.0
            for p in range(n):
                row_k = 0.0
                row_c = 0.0
                for q in range(n):
                    row_k += abs(k[p, q])
                    row_c += abs(c[p, q])
                size_k = max(size_k, row_k)
                size_c = max(size_c, row_c)
            # the time scale of the step, not the norm of A: displacements and velocities have different units
            rate = math.sqrt(size_k) + size_c
            count = max(1, math.ceil(rate * 0.5 * h[i] / 0.7))
            d = 0.5 * h[i] / count
            # terms fall like (rate d)^order / order!: as many as reach rounding
            orders = 1
            left = rate * d
            while left > 1e-17 and orders < 20:
                orders += 1
                left *= rate * d / orders
            for _ in range(count):
                term_u[:] = upper
                term_l[:] = lower
                for order in range(1, orders + 1):
                    f = d / order
                    _multiply(k, term_u, from_k)
                    _multiply(c, term_l, from_c)
                    for p in range(n):
                        for q in range(2 * n):
                            term_u[p, q] = f * term_l[p, q]
                            term_l[p, q] = -f * (from_k[p, q] + from_c[p, q])
                            upper[p, q] += term_u[p, q]
                            lower[p, q] += term_l[p, q]
    out = np.empty((2 * n, 2 * n))
    out[:n] = upper
    out[n:] = lower
    return out
