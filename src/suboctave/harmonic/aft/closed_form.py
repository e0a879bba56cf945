"""Spectra and derivatives of laws known in closed form: piecewise-linear pieces, polynomials, arctan steps.

The inverse tangent is arithmetic, which compilers turn into vector instructions where the library's is called number by
number: beyond tan(pi/8) the argument is taken to `(|x| - 1) / (|x| + 1)`, beyond tan(3 pi/8) to `-1 / |x|`, and

    atan t = t + t^3 p(t^2),    |t| <= tan(pi/8),

p the polynomial of degree 10 that agrees at the Chebyshev nodes, with an error of 5e-18 relative to t.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array
from suboctave.harmonic.quadrature import sharp_nodes
from suboctave.harmonic.trigonometric import FAST, crossings_of, displacement, extrema, jet, spectra

#: no pieces or steps
NO_ROWS = np.zeros((0, 3))
_LOW, _HIGH = math.sqrt(2.0) - 1.0, math.sqrt(2.0) + 1.0
_P0, _P1, _P2, _P3 = -0.3333333333333333, 0.1999999999999552, -0.14285714284666542, 0.11111111015256361
_P4, _P5, _P6, _P7 = -0.09090904578123903, 0.07692183190826087, -0.06664511447381948, 0.0585814891280221
_P8, _P9, _P10 = -0.0508544973794026, 0.03923165829558719, -0.01917688711906226


class ClosedLaws(NamedTuple):
    """The laws of G directions that are known in closed form, for motions of some number of harmonics.

    pieces, first
        See `table.PackedLaws`.
    owner, polynomial, steps
        Of the smooth ones, polynomials and arctan steps: their directions (S,), and coefficients and rows of steps one
        after the other.
    starts
        Where in `polynomial`, `steps` and `nodes` those of each begin, (3, S + 1).
    nodes
        Cosines, sines and weights of the instants at which polynomials are evaluated, one set after the other, (3, N).
    grid
        Points on the circle for searches along the motion, (2, M).
    rules
        `quadrature.rule_tables`.
    """

    pieces: Array
    first: np.ndarray
    owner: np.ndarray
    polynomial: Array
    steps: Array
    starts: np.ndarray
    nodes: Array
    grid: Array
    rules: tuple[Array, Array]


@kernel(inner=True)
def contact_spectrum(tau, above, side, top):
    """Fourier coefficients q = 0 .. top of the indicator of `side * (x - level) > 0`, from the crossings of `level`.

    chi_q = 1/(2 pi) int chi exp(-i q tau): sums of exp(-i q tau_i) / q over the ends of the contact intervals.
    """
    out = np.zeros(top + 1, dtype=np.complex128)
    active = above == (side > 0)
    n = tau.shape[0]
    if n == 0:
        out[0] = 1.0 if active else 0.0
        return out
    scale = 1.0 / (2.0 * math.pi)
    length = 2.0 * math.pi if active else 0.0
    state = active
    for i in range(n):
        sign = 1.0 if state else -1.0  # +1: a contact ends here, -1: one begins
        length += sign * tau[i]
        zr = math.cos(tau[i])
        zi = -math.sin(tau[i])
        pr = zr
        pi = zi
        for q in range(1, top + 1):
            f = sign * scale / q
            out[q] += complex(-f * pi, f * pr)  # i/q * exp(-i q tau), the antiderivative at an end
            t = pr * zr - pi * zi
            pi = pr * zi + pi * zr
            pr = t
        state = not state
    out[0] = length * scale
    return out


@kernel(inner=True, fastmath=FAST)
def product_spectrum(c, shift, chi, top):
    """Fourier coefficients k = 0 .. top of `(x - shift) * chi`, x given by its c_k, chi by chi_q with q up to top +
    H.
    """
    high = c.shape[0] - 1
    # chi_q for q = -H .. top + H, negative ones by conjugation
    xr = np.empty(top + 2 * high + 1)
    xi = np.empty(top + 2 * high + 1)
    for q in range(-high, top + high + 1):
        xr[q + high] = chi[q].real if q >= 0 else chi[-q].real
        xi[q + high] = chi[q].imag if q >= 0 else -chi[-q].imag
    re = np.empty(top + 1)
    im = np.empty(top + 1)
    mean = c[0].real - shift
    for k in range(top + 1):
        re[k] = mean * xr[k + high]
        im[k] = mean * xi[k + high]
    for m in range(1, high + 1):
        # x_m = c_m / 2 and x_-m its conjugate
        a = 0.5 * c[m].real
        b = 0.5 * c[m].imag
        # views, whose indices the compiler knows to be positive
        pr, pi = xr[high - m : high - m + top + 1], xi[high - m : high - m + top + 1]
        qr, qi = xr[high + m : high + m + top + 1], xi[high + m : high + m + top + 1]
        for k in range(top + 1):
            re[k] += a * (pr[k] + qr[k]) + b * (qi[k] - pi[k])
            im[k] += a * (pi[k] + qi[k]) + b * (pr[k] - qr[k])
    out = np.empty(top + 1, dtype=np.complex128)
    for k in range(top + 1):
        out[k] = complex(re[k], im[k])
    return out


@kernel(inner=True, forceinline=True, fastmath=FAST)
def add_values(coefficients, u, force, stiffness):
    """Add a polynomial of the displacement and its derivative, by Horner's rule, to force and stiffness (N,)."""
    if coefficients.shape[0] == 0:
        return
    for j in range(u.shape[0]):
        f = slope = 0.0
        for p in range(coefficients.shape[0] - 1, -1, -1):
            slope = slope * u[j] + f
            f = f * u[j] + coefficients[p]
        force[j] += f
        stiffness[j] += slope


# without the check for a division by zero, which would be a branch
@kernel(fastmath=FAST, error_model="numpy")
def add_step(u, point, width, factor, force, stiffness):
    """Add `factor (y atan(y / width) - width / 2 log(1 + (y / width)^2))`, y = u - point, and its derivative by u to
    force and stiffness (N,), in place.
    """
    sharpness = 1.0 / width
    for j in range(u.shape[0]):
        y = u[j] - point
        x = y * sharpness
        a = abs(x)
        high = a > _HIGH
        low = a <= _LOW
        over = a if low else (-1.0 if high else a - 1.0)
        under = 1.0 if low else (a if high else a + 1.0)
        base = 0.0 if low else (0.5 * math.pi if high else 0.25 * math.pi)
        t = over / under
        z = t * t
        p = _P10
        p = p * z + _P9
        p = p * z + _P8
        p = p * z + _P7
        p = p * z + _P6
        p = p * z + _P5
        p = p * z + _P4
        p = p * z + _P3
        p = p * z + _P2
        p = p * z + _P1
        p = p * z + _P0
        angle = math.copysign(base + (t + t * z * p), x)
        force[j] += factor * y * angle
        stiffness[j] += factor * angle
    # a loop of its own: the logarithm is called number by number. What it loses below 1e-16 is nothing beside a width
    for j in range(u.shape[0]):
        ratio = (u[j] - point) * sharpness
        force[j] -= 0.5 * factor * width * math.log(1.0 + ratio * ratio)


@kernel(inner=True)
def add_pieces(motions, pieces, first, zr, zi, table):
    """Add the Fourier coefficients of piecewise-linear laws along motions (G, H + 1), and of their slopes, to `table`
    (>= 2, >= G, top + 1).

    pieces, first: see `table.PackedLaws`; zr, zi: points on the circle for searches along the motion.
    """
    top, high = table.shape[2] - 1, motions.shape[1] - 1
    for g in range(motions.shape[0]):
        if first[g + 1] == first[g]:
            continue
        c, force, stiffness = motions[g], table[0, g], table[1, g]
        turns = extrema(c, zr, zi)
        slope = np.zeros(top + high + 1, dtype=np.complex128)
        touching = False
        for p in range(first[g], first[g + 1]):
            k, gap, side = pieces[p, 0], pieces[p, 1], pieces[p, 2]
            crossed, above = crossings_of(c, gap, turns)
            if crossed.shape[0] == 0 and above != (side > 0):
                continue
            touching = True
            chi = contact_spectrum(crossed, above, side, top + high)
            for q in range(top + high + 1):
                slope[q] += k * chi[q]
            for q in range(top + 1):
                force[q] -= k * gap * chi[q]
        if touching:
            product = product_spectrum(c, 0.0, slope, top)
            for q in range(top + 1):
                force[q] += product[q]
                stiffness[q] += slope[q]


@kernel(inner=True)
def add_smooth(c, polynomial, steps, zr, zi, weights, table, g):
    """Add the Fourier coefficients of a polynomial and of arctan steps (S, 3) along a motion (H + 1,), and of their
    slope, to direction g of `table` (>= 2, > g, top + 1), by nodes and weights on the circle.
    """
    u = np.empty((1, zr.shape[0]))
    displacement(c, zr, zi, u)
    values = np.zeros((2, zr.shape[0]))
    add_values(polynomial, u[0], values[0], values[1])
    for s in range(steps.shape[0]):
        add_step(u[0], steps[s, 0], steps[s, 1], steps[s, 2] / math.pi, values[0], values[1])
    sums = spectra(values, weights, zr, zi, table.shape[2] - 1)
    for q in range(table.shape[2]):
        table[0, g, q] += sums[0, q]
        table[1, g, q] += sums[1, q]


@kernel()
def add_laws(motions, laws, table):
    """Add the Fourier coefficients of laws (`ClosedLaws`) along motions (G, H + 1), and of their slopes, to `table`
    (>= 2, >= G, top + 1).
    """
    zr, zi = laws.grid[0], laws.grid[1]
    if laws.pieces.shape[0] > 0:
        add_pieces(motions, laws.pieces, laws.first, zr, zi, table)
    top, high = table.shape[2] - 1, motions.shape[1] - 1
    for s in range(laws.owner.shape[0]):
        g = laws.owner[s]
        polynomial = laws.polynomial[laws.starts[0, s] : laws.starts[0, s + 1]]
        steps = laws.steps[laws.starts[1, s] : laws.starts[1, s + 1]]
        begin, end = laws.starts[2, s], laws.starts[2, s + 1]
        nr, ni, weights = laws.nodes[0, begin:end], laws.nodes[1, begin:end], laws.nodes[2, begin:end]
        if steps.shape[0] > 0:
            places, widths = steps[:, 0].copy(), steps[:, 1].copy()
            nr, ni, weights = sharp_nodes(motions[g], places, widths, top + high, zr, zi, laws.rules[0], laws.rules[1])
        add_smooth(motions[g], polynomial, steps, nr, ni, weights, table, g)


@kernel()
def corner_weights(c, pieces, zr, zi):
    """Instants at which a motion crosses the gaps of piecewise-linear pieces (stiffness, gap, side): cosines, sines,
    and the weights there of the second derivative, and of the third: regular, and along its slope; (5, N). `f_uu` has
    `side stiffness / |u'|`, u' kept from zero where the motion grazes.
    """
    least, turns = 0.0, extrema(c, zr, zi)
    for k in range(c.shape[0]):
        least = max(least, abs(c[k]))
    least = max(1e-12 * least, 1e-300)
    out, count = np.empty((5, pieces.shape[0] * turns.shape[1])), 0
    for p in range(pieces.shape[0]):
        at, _above = crossings_of(c, pieces[p, 1], turns)
        for tau in at:
            co, si = math.cos(tau), math.sin(tau)
            _x, speed, bend = jet(c, co, si)
            if abs(speed) < least:
                speed = math.copysign(least, speed)
            weight = pieces[p, 2] * pieces[p, 0] / abs(speed)
            out[0, count], out[1, count], out[2, count] = co, si, weight
            out[3, count], out[4, count] = weight * bend / speed**2, -weight / speed
            count += 1
    return out[:, :count].copy()


@kernel()
def add_changed_pieces(c, pieces, rates, zr, zi, out):
    """Add what rates of stiffness and gap (P, 2) of piecewise-linear pieces (P, 3) do to the Fourier coefficients of
    their force and slope along a motion (H + 1,), to `out` (2, top + 1).
    """
    top, high, turns, moved = out.shape[1] - 1, c.shape[0] - 1, extrema(c, zr, zi), pieces.copy()
    for p in range(pieces.shape[0]):
        by_stiffness, gap, side = rates[p, 0], pieces[p, 1], pieces[p, 2]
        moved[p, 0] = shift = rates[p, 1] * pieces[p, 0]
        crossed, above = crossings_of(c, gap, turns)
        chi = contact_spectrum(crossed, above, side, top + high)
        product = product_spectrum(c, gap, chi, top)
        for q in range(top + 1):
            out[0, q] += by_stiffness * product[q] - shift * chi[q]
            out[1, q] += by_stiffness * chi[q]
    # of the slope, the jump at every crossing comes later
    at = corner_weights(c, moved, zr, zi)
    comb = spectra(np.ones((1, at.shape[1])), at[2], at[0], at[1], top)
    for q in range(top + 1):
        out[1, q] -= comb[0, q]


@kernel()
def smooth_weights(c, polynomial, steps, zr, zi, weights):
    """Second and third derivative of a polynomial and of arctan steps (S, 3) along a motion (H + 1,) at nodes, times
    the nodes' weights, (2, N).
    """
    u, out = np.empty((1, zr.shape[0])), np.zeros((2, zr.shape[0]))
    displacement(c, zr, zi, u)
    second = np.empty(max(0, polynomial.shape[0] - 2))
    for p in range(second.shape[0]):
        second[p] = (p + 2) * (p + 1) * polynomial[p + 2]
    add_values(second, u[0], out[0], out[1])
    for s in range(steps.shape[0]):
        width, factor = steps[s, 1], steps[s, 2] / math.pi
        for j in range(u.shape[1]):
            ratio = (u[0, j] - steps[s, 0]) / width
            share = 1.0 / (width * (1.0 + ratio * ratio))
            out[0, j] += factor * share
            out[1, j] -= 2.0 * factor * ratio * share * share
    for j in range(u.shape[1]):
        out[0, j] *= weights[j]
        out[1, j] *= weights[j]
    return out
