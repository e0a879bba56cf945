"""Where the linearised motion is looked at: panels of Lobatto nodes that follow the laws along a motion.

A period is cut into panels on which everything is smooth: at the instants where the motion crosses the gap of a
piecewise-linear law (there the stiffness jumps), and towards the passages of a sharp law. A law with singularities at
`u = point +- i width` has, along the motion, singularities at complex instants `tau_s +- i depth`; near them panels are
equal in v, with `tau = tau_s + depth sinh(v)`, in which they lie at `+- i pi / 2` whatever the sharpness is (the
substitution is that of Johnston & Elliott, Int. J. Numer. Meth. Engng 62 (2005) 564-578, for nearly singular
integrals). Elsewhere panels are equal in tau and as long as the motion's harmonics allow.

Every element is asked once for all nodes; what needs more is interpolated by the polynomials through a panel's nodes.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from suboctave.harmonic.kernels import motion

#: nodes per panel, both ends among them: quadrature of order 12
ORDER = 7
#: longest panel in v: with half-length 1.5 the singularities lie at 1.05 half-lengths from the middle, and the
#: polynomials gain a factor of 2.5 per degree
_STEP = 3.0
#: longest panel in tau: radians of the highest harmonic of the tangent, and of the highest harmonic of the motion
_CONTENT, _HARMONICS = 6.0, 8.0
#: harmonics of less than this share of the largest do not count for the former
_RELEVANT = 1e-4
#: extrema that miss a gap by less than this share of the motion are kept in sight: the true motion may touch it
_MISS = 1e-3


def lobatto(order: int) -> np.ndarray:
    """Nodes on [-1, 1]: the ends and the extrema of the Legendre polynomial of degree order - 1; shape (order,)."""
    slope = np.polynomial.Legendre.basis(order - 1).deriv()
    inner = np.sort(slope.roots().real)
    for _ in range(3):
        inner -= slope(inner) / slope.deriv()(inner)
    return np.concatenate(([-1.0], inner, [1.0]))


NODES = lobatto(ORDER)


def moments(low: float, high: float, count: int) -> np.ndarray:
    """Integrals over (low, high) of the polynomials that are one at a node and zero at the others, times powers of
    `(s - middle) / (high - low)`, 0 .. count - 1; shape (count, ORDER).
    """
    points, weights = np.polynomial.legendre.leggauss(ORDER + 2)
    share = 0.5 * points
    s = 0.5 * (low + high) + (high - low) * share
    others = [np.delete(NODES, j) for j in range(ORDER)]
    basis = np.array([np.prod((s[:, None] - o) / (NODES[j] - o), axis=1) for j, o in enumerate(others)])
    return np.array([basis @ (0.5 * (high - low) * weights * share**i) for i in range(count)])


@njit(cache=True)
def _jet(c, tau):
    """Value and first two derivatives of `Re sum_k c_k exp(i k tau)` with respect to tau."""
    zr = math.cos(tau)
    zi = math.sin(tau)
    pr = pi = dr = di = sr = si = 0.0
    for k in range(c.shape[0] - 1, -1, -1):
        a = c[k].real
        b = c[k].imag
        t = pr * zr - pi * zi + a
        pi = pr * zi + pi * zr + b
        pr = t
        t = dr * zr - di * zi + k * a
        di = dr * zi + di * zr + k * b
        dr = t
        t = sr * zr - si * zi + k * k * a
        si = sr * zi + si * zr + k * k * b
        sr = t
    return pr, -di, -sr


@njit(cache=True)
def _crossing(c, level, lo, hi, f0, f1):
    """The instant in (lo, hi) at which the motion crosses `level`, with its derivatives there."""
    tau = lo + (hi - lo) * f0 / (f0 - f1)
    x, d, s = _jet(c, tau)
    for _ in range(80):
        if ((x - level) > 0.0) == (f0 > 0.0):
            lo = tau
        else:
            hi = tau
        new = tau - (x - level) / d if d != 0.0 else lo
        if not (lo < new < hi):
            new = 0.5 * (lo + hi)
        moved = abs(new - tau)
        tau = new
        x, d, s = _jet(c, tau)
        if moved < 1e-13:
            break
    return tau, d, s


@njit(cache=True)
def _turning(c, lo, hi, d0, d1):
    """The instant in (lo, hi) at which the derivative changes sign, with value and second derivative there."""
    tau = lo + (hi - lo) * d0 / (d0 - d1)
    x, d, s = _jet(c, tau)
    for _ in range(60):
        if (d > 0.0) == (d0 > 0.0):
            lo = tau
        else:
            hi = tau
        new = tau - d / s if s != 0.0 else lo
        if not (lo < new < hi):
            new = 0.5 * (lo + hi)
        moved = abs(new - tau)
        tau = new
        x, d, s = _jet(c, tau)
        if moved < 1e-13:
            break
    return tau, x, s


@njit(cache=True)
def _singular(d, s, width):
    """The nearest complex root of `d z + s z^2 / 2 = i width`."""
    root = np.sqrt(complex(d * d, 2.0 * s * width))
    return complex(0.0, 2.0 * width) / (d + root if root.real * d >= 0.0 else d - root)


@njit(cache=True)
def _note(row, tau, depth, slope, bend, miss, law):
    row[0] = tau
    row[1] = depth
    row[2] = slope
    row[3] = bend
    row[4] = miss
    row[5] = law


@njit(cache=True)
def _events(c, laws, zr, zi, reach):
    """What happens along the motion, ascending in tau: rows (tau, depth, du/dtau, d2u/dtau2, miss, law).

    A crossing of the gap of a piecewise-linear law (width 0) has infinite depth; an extremum that falls short of it is
    kept with the distance `miss`. A passage of a sharp law has the depth of its complex singularity.
    """
    n = zr.shape[0]
    h = 2.0 * math.pi / n
    capacity = 64
    found = np.empty((capacity, 6))
    count = 0
    last = -1
    values = np.empty((2, n))
    size = 0.0
    for law in range(laws.shape[0]):
        g = int(laws[law, 0])
        if g != last:
            values = motion(c[g], zr, zi)
            size = values[0].max() - values[0].min()
            last = g
        level = laws[law, 1]
        width = laws[law, 2]
        for j in range(n):
            if count + 2 > capacity:
                found = np.concatenate((found, np.empty((capacity, 6))))
                capacity *= 2
            follow = j + 1 if j + 1 < n else 0
            f0 = values[0, j] - level
            f1 = values[0, follow] - level
            d0 = values[1, j]
            d1 = values[1, follow]
            lo = j * h
            if (f0 > 0.0) != (f1 > 0.0):
                tau, d, s = _crossing(c[g], level, lo, lo + h, f0, f1)
                depth = np.inf
                if width > 0.0:
                    z = _singular(d, s, width)
                    tau += z.real
                    depth = abs(z.imag)
                if depth == np.inf or depth < reach:
                    _note(found[count], tau, depth, d, s, 0.0, law)
                    count += 1
                continue
            # an extremum towards the level: does it reach across, or nearly so?
            if d0 * d1 >= 0.0 or (f0 > 0.0) != (d0 < 0.0):
                continue
            if min(abs(f0), abs(f1)) > h * (abs(d0) + abs(d1)) + _MISS * size:
                continue
            tau, x, s = _turning(c[g], lo, lo + h, d0, d1)
            across = (x - level > 0.0) != (f0 > 0.0)
            if s == 0.0:
                continue
            if width > 0.0:
                z = np.sqrt(complex(-2.0 * (x - level), 2.0 * width) / s)
                depth = abs(z.imag)
                if depth < reach:
                    offset = abs(z.real) if abs(z.real) > depth else 0.0
                    _note(found[count], tau - offset, depth, 0.0, s, 0.0, law)
                    count += 1
                    if offset > 0.0:
                        _note(found[count], tau + offset, depth, 0.0, s, 0.0, law)
                        count += 1
            elif across:
                at, d, bend = _crossing(c[g], level, lo, tau, f0, x - level)
                _note(found[count], at, np.inf, d, bend, 0.0, law)
                at, d, bend = _crossing(c[g], level, tau, lo + h, x - level, f1)
                _note(found[count + 1], at, np.inf, d, bend, 0.0, law)
                count += 2
            elif abs(x - level) < _MISS * size:
                _note(found[count], tau, np.inf, 0.0, s, x - level, law)
                count += 1
    return found[:count][np.argsort(found[:count, 0])]


@njit(cache=True)
def _depths(events):
    """Distance from every event to the nearest complex singularity, its own or another's."""
    n = events.shape[0]
    out = np.empty(n)
    for i in range(n):
        least = np.inf
        for j in range(n):
            apart = abs(events[i, 0] - events[j, 0])
            apart = min(apart, 2.0 * math.pi - apart)
            least = min(least, math.hypot(apart, events[j, 1]))
        out[i] = least
    return out


@njit(cache=True)
def _panels(events, longest):
    """Panels from the first event over one period, rows (from, to, centre, depth), and where each event's begin.

    With depth 0, from and to are instants, else values of v.
    """
    n = events.shape[0]
    depth = _depths(events)
    start = np.zeros(n, dtype=np.int64)
    capacity = 64
    out = np.empty((capacity, 4))
    count = 0
    for i in range(max(n, 1)):
        low = events[i, 0] if n > 0 else 0.0
        high = low + 2.0 * math.pi
        left = right = 0.0
        if n > 0:
            start[i] = count
            follow = i + 1 if i + 1 < n else 0
            high = events[follow, 0] + (0.0 if follow > i else 2.0 * math.pi)
            # how far graded panels reach from either end: to where they are as long as the others
            for side in range(2):
                d = depth[i] if side == 0 else depth[follow]
                reach = 0.0
                if d * _STEP < longest:
                    reach = d * math.sinh(math.acosh(longest / (d * _STEP)))
                if side == 0:
                    left = reach
                else:
                    right = reach
        gap = high - low
        if gap <= 1e-14:
            continue
        if left + right > gap:
            if left < 0.5 * gap:
                right = gap - left
            elif right < 0.5 * gap:
                left = gap - right
            else:
                left = right = 0.5 * gap
        rest = gap - left - right
        if rest < 0.05 * longest and left + right > 0.0:
            # not worth a panel of its own
            if left > 0.0:
                left += rest
            else:
                right += rest
            rest = 0.0
        for part in range(3):
            if part == 1:
                length = rest
                centre = d = 0.0
                first = low + left
                last = high - right
                pieces = math.ceil(length / longest - 1e-9)
            else:
                length = left if part == 0 else right
                if length <= 0.0:
                    continue
                centre = low if part == 0 else high
                d = depth[i] if part == 0 else depth[i + 1 if i + 1 < n else 0]
                v = math.asinh(length / d)
                first = 0.0 if part == 0 else -v
                last = v if part == 0 else 0.0
                pieces = math.ceil(v / _STEP - 1e-9)
            if length <= 0.0:
                continue
            pieces = max(1, pieces)
            while count + pieces > capacity:
                out = np.concatenate((out, np.empty((capacity, 4))))
                capacity *= 2
            for p in range(pieces):
                out[count, 0] = first + (last - first) * p / pieces
                out[count, 1] = first + (last - first) * (p + 1) / pieces
                out[count, 2] = centre
                out[count, 3] = d
                count += 1
    return out[:count], start % max(count, 1)


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _series(c, f, zr, zi, out):
    """`Re sum c_k z^k`, its derivative by tau and `Re sum f_k z^k` at the points z into out (3, N)."""
    n = zr.shape[0]
    top = c.shape[0] - 1
    work = np.empty((6, n))
    pr, pi, dr, di, fr, fi = work[0], work[1], work[2], work[3], work[4], work[5]
    for j in range(n):
        pr[j] = c[top].real
        pi[j] = c[top].imag
        dr[j] = top * c[top].real
        di[j] = top * c[top].imag
        fr[j] = f[top].real
        fi[j] = f[top].imag
    for k in range(top - 1, -1, -1):
        a = c[k].real
        b = c[k].imag
        e = f[k].real
        g = f[k].imag
        for j in range(n):
            t = pr[j] * zr[j] - pi[j] * zi[j] + a
            pi[j] = pr[j] * zi[j] + pi[j] * zr[j] + b
            pr[j] = t
            t = dr[j] * zr[j] - di[j] * zi[j] + k * a
            di[j] = dr[j] * zi[j] + di[j] * zr[j] + k * b
            dr[j] = t
            t = fr[j] * zr[j] - fi[j] * zi[j] + e
            fi[j] = fr[j] * zi[j] + fi[j] * zr[j] + g
            fr[j] = t
    for j in range(n):
        out[0, j] = pr[j]
        out[1, j] = -di[j]
        out[2, j] = fr[j]


@njit(cache=True)
def _longest(c, degree):
    """Longest panel in tau for a tangent that is a polynomial of this degree in the motion."""
    top = 1
    for g in range(c.shape[0]):
        largest = 0.0
        for k in range(c.shape[1]):
            largest = max(largest, abs(c[g, k]))
        for k in range(c.shape[1] - 1, top, -1):
            if abs(c[g, k]) > _RELEVANT * largest:
                top = k
                break
    return min(_CONTENT / max(1, degree * top), _HARMONICS / (c.shape[1] - 1), 2.0)


@njit(cache=True)
def lay_out(c, f, degree, finest, laws, zr, zi, nodes):
    """Panels along a motion, and the motion at their nodes.

    c, f: amplitudes (G, H + 1) of displacement and harmonics of force along the G directions; degree: that of the
    tangent as a polynomial in the motion (0: constant between events); finest: an upper bound of the panels' lengths;
    laws: rows (direction, gap or point, width or 0 where piecewise linear, ...), in the order of directions; z: a
    uniform grid to search on. Returns

    - stretch (P, m): dtau/ds on every panel, s in [-1, 1]; node i of panel p is node p (m - 1) + i of the period,
    - values (G, 3, P (m - 1) + 1): u, du/dtau, force within the basis at the nodes,
    - events: rows (tau, depth, du/dtau, d2u/dtau2, miss, law), and the panel that begins at each.
    """
    longest = min(_longest(c, degree), finest)
    events = _events(c, laws, zr, zi, longest)
    panels, start = _panels(events, longest)
    count = panels.shape[0]
    m = nodes.shape[0]
    tau = np.empty(count * (m - 1) + 1)
    stretch = np.empty((count, m))
    for p in range(count):
        middle = 0.5 * (panels[p, 0] + panels[p, 1])
        half = 0.5 * (panels[p, 1] - panels[p, 0])
        depth = panels[p, 3]
        at = p * (m - 1)
        for j in range(m):
            v = middle + half * nodes[j]
            if depth == 0.0:
                tau[at + j] = v
                stretch[p, j] = half
            else:
                e = math.exp(v)
                tau[at + j] = panels[p, 2] + 0.5 * depth * (e - 1.0 / e)
                stretch[p, j] = 0.5 * depth * (e + 1.0 / e) * half
    values = np.empty((c.shape[0], 3, tau.shape[0]))
    cos = np.cos(tau)
    sin = np.sin(tau)
    for g in range(c.shape[0]):
        _series(c[g], f[g], cos, sin, values[g])
    return stretch, values, events, start
