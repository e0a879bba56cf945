"""Quadrature along a motion: nodes on the period and weights, chosen by how smooth a law is.

Four rules, all of which converge faster than any power of the number of nodes for the laws they are meant for:

- uniform (the trapezoidal rule), exact for laws that are polynomials in displacement and velocity;
- graded, for a law with singularities at `u = point +- i width` (a regularised contact). As a function of time it is
  singular at the complex instants `s +- i d` at which the motion takes these values: close to the real axis wherever a
  narrow transition is crossed or nearly touched. They are searched on a grid and split the period. From each the
  instants run as `tau = s +- d sinh(t)`, which carries the singularity to `t = i pi / 2`, so that Gauss-Legendre rules
  in t converge as fast as for a smooth law, with a number of nodes that grows like log(1 / width) (Tee & Trefethen,
  SIAM J. Sci. Comput. 28 (2006) 1798-1811, use such maps for sharp layers). Elsewhere plain Gauss-Legendre panels;
- Gauss-Legendre panels between corners of the law;
- uniform with a number of samples that is doubled until force and tangent stop moving, for laws of unknown smoothness.

The nodes follow the motion at each evaluation. That does no harm because the rule is accurate to rounding before and
after.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.trigonometric import FAST, displacement, extrema, jet

#: fewest and most uniform samples per period of laws of unknown smoothness
FEWEST, MOST = 32, 1 << 15
#: change of force and tangent coefficients below which their number has settled, in units of what matters
SETTLED = 1e-11
#: nodes of the Gauss-Legendre rules in the tables, from 0 to this
ORDERS = 64
#: phase (highest harmonic times length) of plain panels, of the pieces next to a singularity, and of those that follow
_PLAIN, _NEAR, _NEXT = 56.0, 4.0, 28.0
#: longest piece: sines and cosines of its half are known by their series to rounding
_LONGEST = 1.2
#: a singularity this far from the axis, in half-lengths of a plain panel, does not disturb it
_HARMLESS = 1.3
#: Gauss-Legendre nodes on every panel between corners
_ORDER = 16
GAUSS = np.polynomial.legendre.leggauss(_ORDER)
#: coefficients of the series of sine and cosine
_S2, _S3, _S4, _S5, _S6, _S7, _S8 = -1 / 2, -1 / 6, 1 / 24, 1 / 120, -1 / 720, -1 / 5040, 1 / 40320
_S9, _S10, _S11, _S12 = 1 / 362880, -1 / 3628800, -1 / 39916800, 1 / 479001600
_S13, _S14, _S15 = 1 / 6227020800, -1 / 87178291200, -1 / 1307674368000


@dataclass(frozen=True)
class Nodes:
    """Points `exp(i tau_j)` on the period (real and imaginary part, shape (N,)) and weights that add up to 2 pi."""

    zr: Array
    zi: Array
    weights: Array

    @property
    def tau(self) -> Array:
        """Instants in [0, 2 pi), shape (N,)."""
        return np.mod(np.arctan2(self.zi, self.zr), 2.0 * math.pi)


@lru_cache(maxsize=64)
def uniform_nodes(count: int) -> Nodes:
    """`count` equidistant instants from tau = 0."""
    tau = 2.0 * math.pi * np.arange(count) / max(1, count)
    return Nodes(np.cos(tau), np.sin(tau), np.full(count, 2.0 * math.pi / max(1, count)))


def search_grid(high: int) -> Nodes:
    """Equidistant instants, close enough for searches along a motion of harmonics up to `high`."""
    return uniform_nodes(8 * high + 8)


def peak(c: ComplexArray) -> tuple[float, float, float]:
    """Largest modulus of `Re sum_k c_k exp(i k tau)` over a period and where: (max |x|, tau, x there)."""
    grid = search_grid(len(c) - 1)
    tau, value, _ = extrema(np.ascontiguousarray(c), grid.zr, grid.zi)
    if not len(tau):
        return abs(float(c[0].real)), 0.0, float(c[0].real)
    i = int(np.argmax(np.abs(value)))
    return abs(float(value[i])), float(tau[i]), float(value[i])


def polynomial_nodes(highest: int, top: int) -> Nodes:
    """Instants, no harmonic of which up to `highest` aliases onto those up to `top`; of a few numbers, so that tables
    are shared.
    """
    return uniform_nodes(8 * math.ceil((highest + top + 1) / 8))


def graded_nodes(motion: ComplexArray, points: Array, widths: Array, top: int) -> Nodes:
    """Nodes for laws that are singular at u = points +- i widths.

    motion: complex coefficients (H + 1,); top: highest Fourier coefficient of the tangent that is wanted.
    """
    high = motion.shape[0] - 1
    grid = search_grid(high)
    return Nodes(*sharp_nodes(motion, points, widths, top + high, grid.zr, grid.zi, *rule_tables()))


def between_corners(corners: Array, longest: float, parts: int) -> Nodes:
    """Gauss-Legendre panels between neighbouring corners, `parts` for every one that is no longer than `longest`.

    Next to a corner instants run like the square of the variable, in which powers of one half are analytic too.
    """
    gaps = np.append(np.diff(corners), corners[0] + 2.0 * math.pi - corners[-1])
    pieces = parts * np.maximum(2, np.ceil(gaps / longest)).astype(np.int64)
    first = np.cumsum(pieces) - pieces
    whole = np.repeat(gaps / pieces, pieces)
    number = np.arange(len(whole)) - np.repeat(first, pieces)
    low = np.repeat(corners, pieces) + number * whole
    y, share = 0.5 + 0.5 * GAUSS[0], 0.5 * GAUSS[1]
    low, whole = low[:, None], whole[:, None]
    at, weights = np.tile(y, (len(whole), 1)), whole * share
    last = first + pieces - 1
    at[first], at[last] = y * y, 1.0 - (1.0 - y) ** 2
    weights[first] *= 2.0 * y
    weights[last] *= 2.0 * (1.0 - y)
    tau = low + whole * at
    return Nodes(np.cos(tau).ravel(), np.sin(tau).ravel(), weights.ravel())


@lru_cache(maxsize=1)
def rule_tables() -> tuple[Array, Array]:
    """Nodes and weights of all Gauss-Legendre rules on (-1, 1), row n for n nodes; shape (ORDERS + 1, ORDERS)."""
    nodes, weights = np.zeros((ORDERS + 1, ORDERS)), np.zeros((ORDERS + 1, ORDERS))
    for n in range(1, ORDERS + 1):
        nodes[n, :n], weights[n, :n] = np.polynomial.legendre.leggauss(n)
    return nodes, weights


@kernel(inner=True, forceinline=True)
def _roots(x, d, s, point, width):
    """Both complex offsets at which the parabola (x, d, s) equals point + i width: real and imaginary parts.

    In real numbers, which are compiled in a third of the time of complex ones.
    """
    # the square root a + i b of the discriminant, a >= 0
    re = d * d - 2.0 * s * (x - point)
    im = 2.0 * s * width
    a = math.sqrt(0.5 * (math.sqrt(re * re + im * im) + abs(re)))
    b = 0.5 * im / a if a > 0.0 else 0.0
    if re < 0.0:
        a, b = abs(b), (a if im >= 0.0 else -a)
    # the half without cancellation
    sign = 1.0 if d >= 0.0 else -1.0
    qr = -(d + sign * a)
    qi = -sign * b
    size = qr * qr + qi * qi
    if size == 0.0:
        return np.inf, 0.0, np.inf, 0.0
    tr = 2.0 * (x - point) / size
    ti = -2.0 * width / size
    near_r = tr * qr + ti * qi
    near_i = ti * qr - tr * qi
    if s == 0.0:
        return near_r, near_i, np.inf, 0.0
    return near_r, near_i, qr / s, qi / s


@kernel()
def singular_instants(c, points, widths, reach, zr, zi):
    """Complex instants `s + i d`, d > 0 and below `reach`, at which the motion meets point +- i width; ascending in s.

    z: uniform grid on the circle, fine enough for the motion's highest harmonic. Returns (2, count): s in [0, 2 pi), d.
    """
    n = zr.shape[0]
    cell = 2.0 * math.pi / n
    instants = np.empty((2, 8 * n))
    count = 0
    values = np.empty((3, n))
    displacement(c, zr, zi, values)
    for j in range(n):
        x, d, s = values[0, j], values[1, j], values[2, j]
        most = abs(d) * 1.5 * reach + abs(s) * reach * reach
        for m in range(points.shape[0]):
            if abs(x - points[m]) > most + abs(d) * cell + widths[m]:
                continue
            near_r, near_i, far_r, far_i = _roots(x, d, s, points[m], widths[m])
            for r in range(2):
                offset = near_r if r == 0 else far_r
                distance = abs(near_i if r == 0 else far_i)
                if not (abs(offset) <= 0.8 * cell and distance <= 1.5 * reach):
                    continue
                at = j * cell
                # the parabola around the singularity's own real part: twice is as good as exact
                for _ in range(3):
                    at += offset
                    vx, vd, vs = jet(c, math.cos(at), math.sin(at))
                    new_r, new_i, two_r, two_i = _roots(vx, vd, vs, points[m], widths[m])
                    new_i, two_i = abs(new_i), abs(two_i)
                    # of the two roots the one that continues the present
                    if two_r * two_r + (two_i - distance) ** 2 < new_r * new_r + (new_i - distance) ** 2:
                        new_r, new_i = two_r, two_i
                    if not (abs(new_r) <= cell):
                        break
                    offset, distance = new_r, new_i
                    if abs(offset) < 0.05 * distance:
                        break
                at += offset
                if not distance <= reach:
                    continue
                at %= 2.0 * math.pi
                distance = max(distance, 1e-13)
                known = False
                for k in range(count):
                    gap = abs(instants[0, k] - at)
                    gap = min(gap, 2.0 * math.pi - gap)
                    if gap < 0.3 * min(distance, instants[1, k]) + 1e-13:
                        instants[1, k] = min(instants[1, k], distance)
                        known = True
                        break
                if not known and count < instants.shape[1]:
                    instants[0, count] = at
                    instants[1, count] = distance
                    count += 1
    out = np.empty((2, count))
    for k in range(count):
        # by insertion: there are few
        i = k
        while i > 0 and out[0, i - 1] > instants[0, k]:
            out[0, i] = out[0, i - 1]
            out[1, i] = out[1, i - 1]
            i -= 1
        out[0, i] = instants[0, k]
        out[1, i] = instants[1, k]
    return out


@kernel(inner=True, fastmath=FAST)
def _fill(zr, zi, w, count, centre, sign, distance, first, last, plain, phase, nodes, weights, offset):
    """Append the nodes of one piece, offsets (first, last) from `centre` in the direction `sign`; returns the count."""
    if plain:
        # in a short one the law may still be singular as close by as in a long one
        orders = max(20, math.ceil(8.0 + 0.36 * phase))
        low, high = first, last
    else:
        low, high = math.asinh(first / distance), math.asinh(last / distance)
        t = high - low
        orders = math.ceil(8.0 + 2.8 * t**0.8 if first == 0.0 else 7.0 + 0.4 * phase + 3.0 * t)
    orders = min(max(orders, 7), ORDERS)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    origin = 0.5 * (first + last)
    # views: indices that cannot be negative let the loops run in vector registers
    node, weight = nodes[orders, :orders], weights[orders, :orders]
    at_r, at_i, share = zr[count : count + orders], zi[count : count + orders], w[count : count + orders]
    if plain:
        for j in range(orders):
            offset[j] = half * node[j]
            share[j] = half * weight[j]
    else:
        for j in range(orders):
            grown = 0.5 * distance * math.exp(middle + half * node[j])
            shrunk = 0.25 * distance * distance / grown
            offset[j] = grown - shrunk - origin
            share[j] = half * weight[j] * (grown + shrunk)
    cr, ci = math.cos(centre + sign * origin), math.sin(centre + sign * origin)
    for j in range(orders):
        # sine and cosine of a small angle, by their series
        t = sign * offset[j]
        y = t * t
        si = _S15
        si = _S13 + y * si
        si = _S11 + y * si
        si = _S9 + y * si
        si = _S7 + y * si
        si = _S5 + y * si
        si = _S3 + y * si
        si = t + t * y * si
        co = _S14
        co = _S12 + y * co
        co = _S10 + y * co
        co = _S8 + y * co
        co = _S6 + y * co
        co = _S4 + y * co
        co = 1.0 + y * (_S2 + y * co)
        at_r[j] = cr * co - ci * si
        at_i[j] = cr * si + ci * co
    return count + orders


@kernel()
def sharp_nodes(c, points, widths, degree, zr, zi, nodes, weights):
    """Nodes on a period: `cos tau`, `sin tau`, and weights, which add up to 2 pi.

    Parameters
    ----------
    c
        Complex coefficients of the motion (H + 1,).
    points, widths
        Where the laws are singular: u = point +- i width.
    degree
        Highest harmonic of the integrands where the law is smooth.
    zr, zi
        Uniform grid on the circle for the search.
    nodes, weights
        `rule_tables()`.
    """
    panel = min(_PLAIN / degree, _LONGEST)
    at = singular_instants(c, points, widths, 0.5 * _HARMLESS * panel, zr, zi)
    near, number = min(_NEAR / degree, _LONGEST), at.shape[1]
    intervals = max(1, 2 * number)
    capacity = ORDERS * (8 + 3 * intervals + math.ceil(2.0 * math.pi / panel))
    out_r, out_i, w = np.empty(capacity), np.empty(capacity), np.empty(capacity)
    offset = np.empty(ORDERS)
    # not a literal, for which `_fill` would be compiled twice
    count = np.int64(0)
    for k in range(intervals):
        # the way from a singularity to the middle before the next, forwards or backwards in time
        centre, distance, length, sign = 0.0, 1.0, 2.0 * math.pi, 1.0
        if number > 0:
            first, second = k // 2, (k // 2 + 1) % number
            start = at[0, first]
            end = at[0, second] + (2.0 * math.pi if first == number - 1 else 0.0)
            length = 0.5 * (end - start)
            forwards = k % 2 == 0
            centre, distance = (start, at[1, first]) if forwards else (end, at[1, second])
            sign = 1.0 if forwards else -1.0
        done = 0.0
        while done < length * (1.0 - 1e-15):
            # far from the singularity, in units of its own length, a piece needs no map
            piece = panel
            if number > 0 and done < 1.5 * near:
                piece = near if done == 0.0 else min(_NEXT / degree, _LONGEST)
            plain = number == 0 or done > 0.5 * piece
            if done + 1.3 * piece >= length:
                piece = length - done
            elif done + 2.0 * piece > length:
                piece = 0.5 * (length - done)
            count = _fill(
                out_r,
                out_i,
                w,
                count,
                centre,
                sign,
                distance,
                done,
                done + piece,
                plain,
                piece * degree,
                nodes,
                weights,
                offset,
            )
            done += piece
    return out_r[:count].copy(), out_i[:count].copy(), w[:count].copy()
