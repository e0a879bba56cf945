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

from suboctave.compiled import kernel
from suboctave.stability.magnus import MOST, exponent, waves
from suboctave.stability.nodes import ORDER

#: error of the fine steps per panel, and of the coarse ones, in units of the Magnus expansion's leading error
_FINE, _COARSE = 1.0e-9, 6.4e-8


@kernel()
def _monodromy(stretch, scale, base, k, damping, c, kick, table, tolerance):
    """Trace of the monodromy matrix, and `int c dt`.

    stretch: dtau/ds (P, m); scale: dt/dtau; base (P,): constant part of the stiffness on every panel, k (N,) its
    varying part at the nodes; damping: constant part, c (N,) or (0,) the varying one; kick (P,): an impulse
    `-kick y` at the beginning of every panel. Coarse: longer steps, polynomials of lower degree.
    """
    count = stretch.shape[0]
    m = ORDER
    varying = c.shape[0] > 0
    jj = np.empty(m)
    kk = np.empty(m)
    cc = np.empty(m)
    p11, p12, p21, p22 = 1.0, 0.0, 0.0, 1.0
    total = 0.0
    # damping not applied yet
    late = 0.0
    for p in range(count):
        if kick[p] != 0.0:
            p21 -= kick[p] * p11
            p22 -= kick[p] * p12
        at = p * (m - 1)
        graded = stretch[p, 0] != stretch[p, m - 1]
        low = high = k[at]
        rate = length = swing = 0.0
        for j in range(m):
            g = scale * stretch[p, j]
            value = k[at + j]
            low = min(low, value)
            high = max(high, value)
            length += g * (table[1, 0, 0, j] + table[1, 0, 2, j] / 12.0)
            jj[j] = g
            kk[j] = g * (value + base[p])
            half = 0.5 * damping
            if varying:
                half += 0.5 * c[at + j]
                swing = max(swing, abs(half - 0.5 * damping))
                cc[j] = g * half
            rate = max(rate, abs(value + base[p] - half * half))
        angle = rate * length * length
        change = (high - low) * length * length + 2.0 * swing * length * (1.0 + math.sqrt(angle))
        # the leading error of a step is rarely more than (angle + 0.3)^2 change / 400
        want = change * (angle + 0.3) * (angle + 0.3) / 400.0 / tolerance
        steps = 1
        while steps < 1000 and steps**6 < want:
            steps += 1
        parts = 1
        if steps > MOST:
            parts = math.ceil(steps / MOST)
            steps = MOST
        for i in range(steps):
            k1 = k2 = k3 = 0.0
            for j in range(m):
                k1 += table[steps, i, 0, j] * kk[j]
                k2 += table[steps, i, 1, j] * kk[j]
                k3 += table[steps, i, 2, j] * kk[j]
            b1 = b2 = b3 = 0.0
            if graded:
                for j in range(m):
                    b1 += table[steps, i, 0, j] * jj[j]
                    b2 += table[steps, i, 1, j] * jj[j]
                    b3 += table[steps, i, 2, j] * jj[j]
            else:
                b1 = length / steps
            if varying:
                a1 = a2 = a3 = 0.0
                for j in range(m):
                    a1 += table[steps, i, 0, j] * cc[j]
                    a2 += table[steps, i, 1, j] * cc[j]
                    a3 += table[steps, i, 2, j] * cc[j]
            else:
                a1 = 0.5 * damping * b1
                a2 = 0.5 * damping * b2
                a3 = 0.5 * damping * b3
            for part in range(parts):
                if parts == 1:
                    decay = a1 + a3 / 12.0
                    a, b, q = exponent(a1, b1, k1, a2, b2, k2, a3, b3, k3)
                else:
                    # the moments of one of several equal parts of a parabola
                    r = 1.0 / parts
                    x = (part + 0.5) * r - 0.5
                    first = r * (a1 + x * (a2 + x * a3))
                    third = r * r * r * a3
                    decay = first + third / 12.0
                    a, b, q = exponent(
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
                co, si, rest = waves(b * q - a * a, decay)
                late += rest
                m11 = co + a * si
                m12 = b * si
                m21 = -q * si
                m22 = co - a * si
                n11 = m11 * p11 + m12 * p21
                n12 = m11 * p12 + m12 * p22
                p21, p22 = m21 * p11 + m22 * p21, m21 * p12 + m22 * p22
                p11, p12 = n11, n12
                if late > 1.0 or late < -1.0:
                    e = math.exp(-late)
                    p11 *= e
                    p12 *= e
                    p21 *= e
                    p22 *= e
                    late = 0.0
    return (p11 + p22) * math.exp(-late), 2.0 * total


@kernel()
def _respond(stretch, scale, base, k, damping, c, force, between, nodes, weight):
    """The periodic solution of `d'' + c d' + k d = -force` at the nodes, d and d' (2, N), and the largest |d|.

    Of its part along the direction of the real multiplier nearest to +1 only the share `weight` is kept. Magnus steps
    of order four from node to node: the force is known no better.
    """
    count = stretch.shape[0]
    m = ORDER
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
        graded = stretch[p, 0] != stretch[p, m - 1]
        for j in range(m):
            g = scale * stretch[p, j]
            jj[j] = g
            kk[j] = g * (k[at + j] + base[p])
            rr[j] = g * force[at + j]
            if varying:
                cc[j] = 0.5 * g * (damping + c[at + j])
        for i in range(m - 1):
            k0 = k1 = r0 = r1 = 0.0
            for j in range(m):
                k0 += between[i, 0, j] * kk[j]
                k1 += between[i, 1, j] * kk[j]
                r0 += between[i, 0, j] * rr[j]
                r1 += between[i, 1, j] * rr[j]
            b0 = b1 = 0.0
            if graded:
                for j in range(m):
                    b0 += between[i, 0, j] * jj[j]
                    b1 += between[i, 1, j] * jj[j]
            else:
                b0 = (nodes[i + 1] - nodes[i]) * jj[0]
            if varying:
                a0 = a1 = 0.0
                for j in range(m):
                    a0 += between[i, 0, j] * cc[j]
                    a1 += between[i, 1, j] * cc[j]
            else:
                a0 = 0.5 * damping * b0
                a1 = 0.5 * damping * b1
            # Omega = A_0 - [A_0, A_1], acting on (y, y', 1)
            a = a0 - (b1 * k0 - b0 * k1)
            b = b0 - 2.0 * (a0 * b1 - a1 * b0)
            q = k0 - 2.0 * (a1 * k0 - a0 * k1)
            f1 = b0 * r1 - b1 * r0
            f2 = a1 * r0 - a0 * r1 - r0
            square = b * q - a * a
            co, si, rest = waves(square, a0)
            # the force acts in the middle of the step on average
            half = math.exp(-0.5 * rest)
            full = half * half
            if rest != a0:
                half = math.exp(0.5 * a0)
            s = step[at + i]
            s[0] = full * (co + a * si)
            s[1] = full * b * si
            s[2] = -full * q * si
            s[3] = full * (co - a * si)
            bend = (1.0 - co) / square if abs(square) > 1e-4 else 0.5 - square / 24.0
            if rest != a0:
                # here co and si have the whole decay already
                bend = (1.0 / (half * half) - co) / square
            s[4] = half * (si * f1 + bend * (a * f1 + b * f2))
            s[5] = half * (si * f2 - bend * (q * f1 + a * f2))
            n11 = s[0] * p11 + s[1] * p21
            n12 = s[0] * p12 + s[1] * p22
            p21, p22 = s[2] * p11 + s[3] * p21, s[2] * p12 + s[3] * p22
            p11, p12 = n11, n12
            e1, e2 = s[0] * e1 + s[1] * e2 + s[4], s[2] * e1 + s[3] * e2 + s[5]
    out = np.empty((2, intervals + 1))
    det = (1.0 - p11) * (1.0 - p22) - p12 * p21
    d = ((1.0 - p22) * e1 + p12 * e2) / det if det != 0.0 else np.inf
    v = (p21 * e1 + (1.0 - p11) * e2) / det if det != 0.0 else np.inf
    apart = p11 - p22
    square = 0.25 * apart * apart + p12 * p21
    if weight < 1.0 and square > 0.0:
        # (Phi - other) / (near - other) projects on the direction of the real multiplier nearest to +1
        part = math.copysign(math.sqrt(square), 1.0 - 0.5 * (p11 + p22))
        other = 0.5 * (p11 + p22) - part
        a = (p11 - other) * d + p12 * v
        b = p21 * d + (p22 - other) * v
        d -= (1.0 - weight) * a / (2.0 * part)
        v -= (1.0 - weight) * b / (2.0 * part)
    largest = abs(d)
    out[0, 0] = d
    out[1, 0] = v
    for i in range(intervals):
        s = step[i]
        d, v = s[0] * d + s[1] * v + s[4], s[2] * d + s[3] * v + s[5]
        out[0, i + 1] = d
        out[1, i + 1] = v
        largest = max(largest, abs(d))
    return out, largest


@kernel()
def _weighted(weights, parts, constant, out):
    """`constant + sum_g weights_g parts_g` of arrays (G, N), into `out`."""
    for j in range(out.shape[0]):
        out[j] = constant
    for g in range(parts.shape[0]):
        for j in range(out.shape[0]):
            out[j] += weights[g] * parts[g, j]
    return out


@kernel()
def roots(trace, decay):
    """Roots of `mu^2 - trace mu + exp(-decay)`, the larger one first."""
    out = np.empty(2, dtype=np.complex128)
    product = math.exp(-decay)
    square = 0.25 * trace * trace - product
    if square < 0.0:
        out[0] = complex(0.5 * trace, math.sqrt(-square))
        out[1] = out[0].conjugate()
    else:
        # the smaller one from the product, with all its digits
        larger = 0.5 * trace + math.copysign(math.sqrt(square), trace)
        out[0] = larger
        out[1] = product / larger if larger != 0.0 else 0.0
    return out


@kernel()
def standing_single(stretch, scale, path, law, base, moving, shape, matrices, tables, between, nodes, largest, weight):
    """Along the motion as it stands: multipliers (2,), and the correction that it needs.

    path, law, base: see `panels.lay_out`; shape (G,): the directions; matrices: mass, damping, stiffness; largest: a
    correction larger than this share of the motion is cut down to it; weight: see `_respond`. Returns also the
    correction along the directions (G, 2, N) and the factor by which it was cut. Few digits.
    """
    mass, damping, stiffness = matrices
    groups, _, total = path.shape
    count = stretch.shape[0]
    square = np.empty(groups)
    once = np.empty(groups)
    for g in range(groups):
        once[g] = shape[g] / mass
        square[g] = shape[g] * once[g]
    whole = _weighted(square, base, stiffness / mass, np.empty(count))
    k = _weighted(square, law[:, 1], 0.0, np.empty(total))
    c = _weighted(square, law[:, 2], 0.0, np.empty(total)) if moving else np.empty(0)
    trace, decay = _monodromy(stretch, scale, whole, k, damping / mass, c, np.zeros(count), tables[1], _COARSE)
    force = _weighted(once, law[:, 0], 0.0, np.empty(total))
    change = np.zeros((groups, 2, total))
    factor = 1.0
    if groups > 0:
        found, size = _respond(stretch, scale, whole, k, damping / mass, c, force, between, nodes, weight)
        most = 0.0
        for j in range(total):
            most = max(most, abs(path[0, 0, j]))
        most *= largest / abs(shape[0])
        if not size <= most:
            factor = most / size if size < np.inf else 0.0
        if factor > 0.0:
            for g in range(groups):
                for j in range(total):
                    change[g, 0, j] = factor * shape[g] * found[0, j]
                    change[g, 1, j] = factor * shape[g] * found[1, j]
    return roots(trace, decay), change, factor


@kernel()
def corrected_single(stretch, scale, law, base, kick, moving, shape, matrices, tables, before):
    """Along the corrected motion: multipliers (2,), and their distances from those of the motion as it stands.

    law (G, 2, N), kick (G, P): see `panels.closed_changes`; before: the multipliers of `standing_single`.
    """
    mass, damping, stiffness = matrices
    groups, _, total = law.shape
    count = stretch.shape[0]
    square = np.empty(groups)
    for g in range(groups):
        square[g] = shape[g] * shape[g] / mass
    whole = _weighted(square, base, stiffness / mass, np.empty(count))
    k = _weighted(square, law[:, 0], 0.0, np.empty(total))
    c = _weighted(square, law[:, 1], 0.0, np.empty(total)) if moving else np.empty(0)
    kicks = _weighted(square, kick, 0.0, np.empty(count))
    trace, decay = _monodromy(stretch, scale, whole, k, damping / mass, c, kicks, tables[0], _FINE)
    mu = roots(trace, decay)
    shift = np.empty(2)
    for i in range(2):
        shift[i] = abs(mu[i] - before[i])
    # rounding: of the trace, and of a double multiplier like its root
    error = 1e-14 * (1.0 + abs(trace))
    apart = abs(mu[0] - mu[1])
    for i in range(2):
        first = error * abs(mu[i]) / apart if apart > 0.0 else np.inf
        shift[i] += min(math.sqrt(error), first) + 1e-15
    return mu, shift
