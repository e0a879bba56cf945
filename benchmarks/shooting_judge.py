"""An independent judge of response curves: shooting, its own continuation, multipliers of the monodromy matrix.

Nothing here is suboctave's. A system comes as plain numbers and lists (`System`, made from the dictionaries of
`random_systems.py`); in the phase `tau = omega t` its motions obey

    dz/dtau = f(z, tau) / omega,    z = (x, dx/dt),    f = (v, M^-1 (p(tau) - C v - K x - sum_e d_e f_e)),

with the variational equations `dPhi/dtau = f_z Phi / omega` and `dS/dtau = f_z S / omega - f / omega^2` beside them.
They are integrated over the period by the Runge-Kutta pair of order 8(5,3) of Dormand and Prince with SciPy's table,
relative tolerance 1e-11 (`against_scipy` holds it against SciPy's own DOP853); a step ends where a contact begins or
ceases to touch and where the velocity across a quadratic damper changes its sign, so that each sees one smooth law, and
at the turning points in between, so that no touch is stepped over.

A curve `z(T; z0, omega) = z0` is followed by pseudo-arclength steps, each so short that the tangent turns and the
multipliers move little. Four functions are watched: the tangent's omega component (LP), the determinant bordered by the
tangent (BP), `prod (mu + 1)` (PD), and the modulus of every complex pair, matched from point to point (NS). An interval
is halved until what changes in it is one event, and until interpolation through the points beside it leaves no room for
a pair of zeros; events are then solved for to 1e-11 of the interval.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate._ivp import dop853_coefficients as table
from scipy.optimize import linear_sum_assignment

A, B, C_NODES = table.A[:12, :12].copy(), table.B.copy(), table.C[:12].copy()
E3, E5 = table.E3.copy(), table.E5.copy()
STOP, ARCTAN, POLYNOMIAL, DAMPER, PARAMETRIC = range(5)
TOLERANCE = 1e-11

#: longest step in scaled arclength, and shortest
LONGEST, SHORTEST = 0.05, 1e-9
#: cosine of the angle by which a tangent may turn in a step
TURN = 0.99
#: movement of multipliers of modulus above 0.3 in a step, relative to their modulus above one
MOVEMENT = 0.12
#: intervals shorter than this are not halved any more to find hidden pairs
FINEST = 2e-7
#: share of the odd part's largest size below which a motion of twice the period counts as its parent
PARENT = 0.01
#: multipliers of which shooting over one period tells nothing any more
LARGEST = 1e7


# ----------------------------------------------------------------------------------------------------- the equations
@njit(cache=True)
def law(code, par, mode, u, v, tau):
    """Force and its derivatives by u and v."""
    if code == STOP:
        if mode > 0.0:
            return par[0] * (u - par[1]), par[0], 0.0
        return 0.0, 0.0, 0.0
    if code == ARCTAN:
        k, b, side, s = par[0], par[1], par[2], par[3]
        y = u - b
        phi = 0.5 * y + (y * math.atan(s * y) - math.log1p((s * y) ** 2) / (2.0 * s)) / math.pi
        rest = -0.5 * b + (b * math.atan(s * b) - math.log1p((s * b) ** 2) / (2.0 * s)) / math.pi
        slope = 0.5 + math.atan(s * y) / math.pi
        if side > 0.0:
            return k * (phi - rest + max(-b, 0.0)), k * slope, 0.0
        return k * (u - phi + rest + min(-b, 0.0)), k * (1.0 - slope), 0.0
    if code == POLYNOMIAL:
        f = g = 0.0
        for p in range(5, 0, -1):
            f = (f + par[p - 1]) * u
        for p in range(5, 0, -1):
            g = g * u + p * par[p - 1]
        return f, g, 0.0
    if code == DAMPER:
        return par[0] * mode * v * v, 0.0, 2.0 * par[0] * mode * v
    k = par[0] * math.cos(par[1] * tau + par[2])
    return k * u, k, 0.0


@njit(cache=True)
def field_of(tau, z, omega, minv, damping, stiffness, dirs, codes, pars, modes, loads, out, work):
    """out = dz/dtau for all columns of z (2 n, 1 + columns); the last of several is the derivative by omega."""
    n = minv.shape[0]
    cols = z.shape[1]
    wide = cols > 1
    force, low = work[0], work[1 : 1 + n]
    for i in range(n):
        s = 0.0
        for j in range(n):
            s -= damping[i, j] * z[n + j, 0] + stiffness[i, j] * z[j, 0]
            if wide:
                low[i, j] = -stiffness[i, j]
                low[i, n + j] = -damping[i, j]
        force[i] = s
    for r in range(loads.shape[0]):
        wave = math.cos(loads[r, 0] * tau + loads[r, 1])
        for i in range(n):
            force[i] += loads[r, 2 + i] * wave
    for e in range(codes.shape[0]):
        u = v = 0.0
        for i in range(n):
            u += dirs[e, i] * z[i, 0]
            v += dirs[e, i] * z[n + i, 0]
        f, fu, fv = law(codes[e], pars[e], modes[e], u, v, tau)
        for i in range(n):
            force[i] -= dirs[e, i] * f
            if wide:
                for j in range(n):
                    low[i, j] -= dirs[e, i] * dirs[e, j] * fu
                    low[i, n + j] -= dirs[e, i] * dirs[e, j] * fv
    # the mass matrix is diagonal in what is drawn, but need not be
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += minv[i, j] * force[j]
        out[n + i, 0] = s / omega
        out[i, 0] = z[n + i, 0] / omega
        for c in range(1, cols):
            out[i, c] = z[n + i, c] / omega
            out[n + i, c] = 0.0
    if not wide:
        return
    for i in range(n):
        for j in range(2 * n):
            s = 0.0
            for k in range(n):
                s += minv[i, k] * low[k, j]
            s /= omega
            for c in range(1, cols):
                out[n + i, c] += s * z[j, c]
    for i in range(2 * n):
        out[i, cols - 1] -= out[i, 0] / omega


@njit(cache=True)
def advance(tau, h, z, first, omega, minv, damping, stiffness, dirs, codes, pars, modes, loads, k, work, stage, new):
    """One step of the pair into `new`; k[0] is `first`, k[12] the slope at the end; the error in units of tolerance."""
    rows, cols = z.shape
    system = (minv, damping, stiffness, dirs, codes, pars, modes, loads)
    k[0, :, :] = first
    flat, whole, begin = k.reshape(13, rows * cols), stage.reshape(rows * cols), z.reshape(rows * cols)
    for s in range(1, 13):
        target = whole if s < 12 else new.reshape(rows * cols)
        for i in range(rows * cols):
            target[i] = 0.0
        for r in range(s):
            factor = A[s, r] if s < 12 else B[r]
            if factor != 0.0:
                for i in range(rows * cols):
                    target[i] += factor * flat[r, i]
        for i in range(rows * cols):
            target[i] = begin[i] + h * target[i]
        at = C_NODES[s] * h if s < 12 else h
        field_of(tau + at, stage if s < 12 else new, omega, *system, k[s], work)
    five, three = np.zeros(rows * cols), np.zeros(rows * cols)
    for r in range(13):
        if E5[r] != 0.0 or E3[r] != 0.0:
            for i in range(rows * cols):
                five[i] += E5[r] * flat[r, i]
                three[i] += E3[r] * flat[r, i]
    half = rows // 2
    worst = 0.0
    for j in range(cols):
        for part in range(2):
            size = 1e-3
            a = b = 0.0
            for i in range(part * half, part * half + half):
                size = max(size, abs(z[i, j]), abs(new[i, j]))
                a += five[i * cols + j] ** 2
                b += three[i * cols + j] ** 2
            if a > 0.0:
                worst = max(worst, h * a / math.sqrt((a + 0.01 * b) * half) / (TOLERANCE * size))
    return worst


@njit(cache=True)
def switch(e, z, slope, omega, dirs, codes, pars):
    """The function whose sign is the mode of a law, and its rate; (0, 0) for laws without modes."""
    n = dirs.shape[1]
    if codes[e] == STOP:
        u = v = 0.0
        for i in range(n):
            u += dirs[e, i] * z[i, 0]
            v += dirs[e, i] * slope[i, 0]
        return pars[e, 2] * (u - pars[e, 1]), pars[e, 2] * v
    if codes[e] == DAMPER:
        v = a = 0.0
        for i in range(n):
            v += dirs[e, i] * z[n + i, 0]
            a += dirs[e, i] * slope[n + i, 0]
        return v, a
    return 0.0, 0.0


@njit(cache=True)
def until(e, rate, tau, h, z, first, omega, minv, damping, stiffness, dirs, codes, pars, modes, loads, work):
    """The step up to the zero of a switching function, or of its rate, within h: Illinois, with the state alone."""
    rows = z.shape[0]
    system = (minv, damping, stiffness, dirs, codes, pars, modes, loads)
    one, slope = np.empty((rows, 1)), np.empty((rows, 1))
    for i in range(rows):
        one[i, 0], slope[i, 0] = z[i, 0], first[i, 0]
    k, stage, new = np.empty((13, rows, 1)), np.empty((rows, 1)), np.empty((rows, 1))
    index = 1 if rate else 0
    a, b = 0.0, h
    fa = switch(e, one, slope, omega, dirs, codes, pars)[index]
    advance(tau, h, one, slope, omega, *system, k, work, stage, new)
    fb = switch(e, new, k[12], omega, dirs, codes, pars)[index]
    if fa * fb >= 0.0:
        return h
    side, c = 0, h
    for count in range(80):
        c = b - fb * (b - a) / (fb - fa)
        if count % 6 == 5 or not a < c < b:
            c = 0.5 * (a + b)
        advance(tau, c, one, slope, omega, *system, k, work, stage, new)
        fc = switch(e, new, k[12], omega, dirs, codes, pars)[index]
        if abs(fc) < 1e-15 or b - a < 1e-13:
            break
        if fc * fb > 0.0:
            b, fb = c, fc
            if side == -1:
                fa *= 0.5
            side = -1
        else:
            a, fa = c, fc
            if side == 1:
                fb *= 0.5
            side = 1
    return c


@njit(cache=True)
def flow(start, omega, periods, wide, minv, damping, stiffness, dirs, codes, pars, loads):
    """State, monodromy matrix and derivative by omega after so many periods of the load; largest |x|, |v|; steps."""
    n = minv.shape[0]
    cols = 2 * n + 2 if wide else 1
    z, new, stage = np.zeros((2 * n, cols)), np.empty((2 * n, cols)), np.empty((2 * n, cols))
    for i in range(2 * n):
        z[i, 0] = start[i]
        if wide:
            z[i, 1 + i] = 1.0
    work = np.zeros((1 + n, 2 * n))
    k = np.empty((13, 2 * n, cols))
    slope = np.empty((2 * n, cols))
    modes = np.zeros(codes.shape[0])
    system = (minv, damping, stiffness, dirs, codes, pars, modes, loads)
    field_of(0.0, z, omega, *system, slope, work)
    for e in range(codes.shape[0]):
        g, rate = switch(e, z, slope, omega, dirs, codes, pars)
        modes[e] = 1.0 if g > 0.0 or (g == 0.0 and rate > 0.0) else -1.0
    field_of(0.0, z, omega, *system, slope, work)
    end = 2.0 * math.pi * periods
    tau, h = 0.0, 0.02
    peaks = np.zeros(2)
    steps = 0
    while tau < end:
        steps += 1
        if steps > 100000:
            return z, peaks, -1
        last = tau + h >= end * (1.0 - 1e-15)
        if last:
            h = end - tau
        error = advance(tau, h, z, slope, omega, *system, k, work, stage, new)
        if not error < 1.0:
            h *= max(0.2, 0.9 * error ** (-0.125)) if error == error else 0.2
            if h < 1e-14:
                return z, peaks, -1
            continue
        # up to where a contact turns back within reach of its gap, or a law changes, whichever comes first
        taken, which = h, -1
        for e in range(codes.shape[0]):
            if codes[e] != STOP:
                continue
            g0, r0 = switch(e, z, slope, omega, dirs, codes, pars)
            g1, r1 = switch(e, new, k[12], omega, dirs, codes, pars)
            near = min(abs(g0), abs(g1)) <= 2.0 * h * max(abs(r0), abs(r1), h * abs(r1 - r0))
            if r0 * r1 < 0.0 and near:
                at = until(e, True, tau, h, z, slope, omega, *system, work)
                if 1e-10 < at < h - 1e-10:
                    taken = min(taken, at)
            elif near and h > 1e-3:
                # two turning points in one step: cut where the velocity is least
                a0 = a1 = 0.0
                toward = 1.0 if r0 > 0.0 else -1.0
                for i in range(n):
                    a0 += toward * pars[e, 2] * dirs[e, i] * slope[n + i, 0]
                    a1 += toward * pars[e, 2] * dirs[e, i] * k[12, n + i, 0]
                if a0 < 0.0 < a1:
                    taken = min(taken, max(0.05, min(0.95, a0 / (a0 - a1))) * h)
        if taken < h:
            advance(tau, taken, z, slope, omega, *system, k, work, stage, new)
        whole = taken
        for e in range(codes.shape[0]):
            if codes[e] != STOP and codes[e] != DAMPER:
                continue
            if switch(e, new, k[12], omega, dirs, codes, pars)[0] * modes[e] < 0.0:
                at = until(e, False, tau, whole, z, slope, omega, *system, work)
                if which < 0 or at < taken:
                    taken, which = at, e
        if taken < h:
            last = False
        if taken < whole:
            advance(tau, taken, z, slope, omega, *system, k, work, stage, new)
        tau = end if last else tau + taken
        z[:, :] = new
        slope[:, :] = k[12]
        if which >= 0:
            modes[which] = -modes[which]
        changed = which >= 0
        # where a step ends on a change of several laws, or by chance, the rate tells which side comes
        for e in range(codes.shape[0]):
            g, rate = switch(e, z, slope, omega, dirs, codes, pars)
            if (codes[e] == STOP or codes[e] == DAMPER) and abs(g) < 1e-12 and abs(rate) > 1e-9:
                mode = 1.0 if rate > 0.0 else -1.0
                changed = changed or mode != modes[e]
                modes[e] = mode
        if changed:
            field_of(tau, z, omega, *system, slope, work)
        for i in range(n):
            peaks[0] = max(peaks[0], abs(z[i, 0]))
            peaks[1] = max(peaks[1], abs(z[n + i, 0]))
        if not peaks[0] < 1e6:
            return z, peaks, -1
        h = min(h * min(5.0, 0.9 * max(error, 1e-10) ** (-0.125)), 0.35)
    return z, peaks, steps


class System:
    """The arrays of a description (see `random_systems.describe`)."""

    def __init__(self, description: dict[str, Any]) -> None:
        mass = np.array(description["mass"], float)
        self.n = n = len(mass)
        codes, dirs, pars = [], [], []
        for item in description["laws"]:
            direction = np.array(item["direction"], float)
            for code, values in terms(item):
                codes.append(code)
                dirs.append(direction)
                pars.append([*values, *[0.0] * (5 - len(values))])
        loads = [
            [load["harmonic"], load["phase"], *(load["amplitude"] * np.eye(n)[load["dof"]])]
            for load in description["loads"]
        ]
        self.arrays = (
            np.linalg.inv(mass),
            np.array(description["damping"], float),
            np.array(description["stiffness"], float),
            np.array(dirs, float).reshape(-1, n),
            np.array(codes, np.int64),
            np.array(pars, float).reshape(-1, 5),
            np.array(loads, float).reshape(-1, 2 + n),
        )

    def period_map(self, z0: np.ndarray, omega: float, nu: int, wide: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """What the flow over nu periods of the load gives: columns state, monodromy matrix, derivative by omega."""
        z, peaks, steps = flow(np.ascontiguousarray(z0), omega, nu, wide, *self.arrays)
        if steps < 0 or not np.isfinite(z).all():
            raise Failure("the motion could not be integrated")
        return z, peaks


def terms(item: dict[str, Any]) -> list[tuple[int, list[float]]]:
    """A law as (code, numbers)."""
    kind = item["kind"]
    if kind == "stop":
        sharp = item.get("sharpness")
        numbers = [item["stiffness"], item["gap"], float(item["side"])]
        return [(STOP, numbers)] if sharp is None else [(ARCTAN, [*numbers, sharp])]
    if kind == "play":
        return [(STOP, [item["stiffness"], item["offset"] + side * item["gap"], float(side)]) for side in (-1, 1)]
    if kind == "polynomial":
        return [(POLYNOMIAL, list(item["coefficients"]))]
    if kind == "damper":
        return [(DAMPER, [item["coefficient"]])]
    if kind == "parametric":
        return [(PARAMETRIC, [item["stiffness"], float(item["harmonic"]), item["phase"]])]
    raise ValueError(kind)


# ------------------------------------------------------------------------------------------------------- one motion
class Failure(Exception):
    """The judge cannot go on, and why."""


@dataclass(eq=False)
class Point:
    """A periodic motion: unknowns (z0, omega), the monodromy matrix, the scaled tangent."""

    y: np.ndarray
    weights: np.ndarray
    jac: np.ndarray
    mu: np.ndarray
    tangent: np.ndarray
    half: np.ndarray
    s: float = 0.0

    @property
    def omega(self) -> float:
        return float(self.y[-1])

    def unstable(self) -> int:
        return int(np.count_nonzero(np.abs(self.mu) > 1.0))

    @property
    def slope(self) -> float:
        return float(self.tangent[-1])

    def orientation(self) -> float:
        scaled = self.jac / self.weights
        return float(np.linalg.slogdet(np.vstack((scaled, self.tangent)))[0])

    def product(self, which: str) -> float:
        """prod (mu - 1), prod (mu + 1) or prod_{i<j} (1 - mu_i mu_j), every factor divided by its size."""
        mu = self.mu
        if which == "torus":
            i, j = np.triu_indices(len(mu), 1)
            factors, sizes = 1.0 - mu[i] * mu[j], np.abs(mu[i] * mu[j])
        else:
            factors = mu - 1.0 if which == "fold" else mu + 1.0
            sizes = np.abs(mu)
        return float(np.prod(factors / np.sqrt(1.0 + sizes**2)).real)


@dataclass
class Found:
    """An event: its kind, the two points it lies between, the point solved for, and what crosses."""

    kind: str
    s: float
    point: Point
    multiplier: complex


@dataclass
class Curve:
    """A judged curve."""

    points: list[Point] = field(default_factory=list)
    events: list[Found] = field(default_factory=list)
    ended: str = ""
    failure: str = ""
    close: list[tuple[float, str]] = field(default_factory=list)


class Judge:
    """Follows one curve of motions of nu load periods between two frequencies."""

    def __init__(self, system: System, bounds: tuple[float, float], nu: int = 1, seconds: float = 60.0) -> None:
        self.system, self.nu = system, nu
        self.low, self.high = min(bounds), max(bounds)
        self.size = np.zeros(2)
        self.odd = 0.0
        self.until = time.process_time() + seconds

    # ------------------------------------------------------------------------------------------------------- solving
    def solve(self, y: np.ndarray, row: np.ndarray, value: float, along: np.ndarray, weights: np.ndarray) -> Point:
        """The motion with `row . (weights y) = value`, by Newton's method; its tangent has a positive product with
        `along`.
        """
        if time.process_time() > self.until:
            raise Failure("out of time")
        n2 = 2 * self.system.n
        last = math.inf
        for iteration in range(20):
            if not 0.0 < y[-1] < 3.0 * self.high:
                raise ArithmeticError("left")
            z, peaks = self.system.period_map(y[:-1], y[-1], self.nu)
            jac = np.hstack((z[:, 1 : n2 + 1] - np.eye(n2), z[:, n2 + 1 :]))
            residual = np.append(z[:, 0] - y[:-1], row @ (weights * y) - value)
            matrix = np.vstack((jac / weights, row))
            step = np.linalg.solve(matrix, -residual)
            moved = float(np.linalg.norm(step))
            if not np.isfinite(moved) or moved > 1.0 or (iteration > 8 and moved > 1e-3):
                raise ArithmeticError("diverges")
            y = y + step / weights
            if moved < 1e-9 or (moved < 3e-8 and moved > 0.3 * last):
                break
            last = moved
        else:
            raise ArithmeticError("no convergence")
        z, peaks = self.system.period_map(y[:-1], y[-1], self.nu)
        self.size = np.maximum(self.size, peaks)
        phi = z[:, 1 : n2 + 1]
        jac = np.hstack((phi - np.eye(n2), z[:, n2 + 1 :]))
        weights = self.weights(peaks)
        mu = np.linalg.eigvals(phi)
        if np.abs(mu).max() > LARGEST:
            raise Failure(f"multipliers of {np.abs(mu).max():.0e} at omega = {y[-1]:.9g}")
        bordering = along * weights
        bordering /= np.linalg.norm(bordering)
        tangent = np.linalg.solve(np.vstack((jac / weights, bordering)), np.append(np.zeros(n2), 1.0))
        tangent /= np.linalg.norm(tangent)
        half = np.zeros(n2)
        if self.nu == 2:
            half = y[:-1] - self.system.period_map(y[:-1], y[-1], 1, False)[0][:, 0]
            self.odd = max(self.odd, float(np.linalg.norm(half)))
        return Point(y, weights, jac, mu, tangent, half)

    def weights(self, peaks: np.ndarray) -> np.ndarray:
        n = self.system.n
        sizes = np.maximum(np.maximum(peaks, 0.1 * self.size), 1e-12)
        return np.concatenate((np.full(n, 1 / sizes[0]), np.full(n, 1 / sizes[1]), [1 / (self.high - self.low)]))

    def started(self, state: np.ndarray, omega: float) -> Point:
        """The motion at a frequency, from a state near it."""
        y = np.append(state, omega)
        _, peaks = self.system.period_map(y[:-1], omega, self.nu)
        self.size = peaks.copy()
        weights = self.weights(peaks)
        row = np.zeros(len(y))
        row[-1] = 1.0
        try:
            return self.solve(y, row, float(weights[-1] * omega), row, weights)
        except ArithmeticError as error:
            raise Failure(f"the start is not found: {error}") from None

    def between(self, a: Point, b: Point, share: float) -> Point:
        """The motion at a share of the chord, by cubic interpolation corrected across the chord."""
        w = b.weights
        chord = w * (b.y - a.y)
        length = float(np.linalg.norm(chord))
        row = chord / length
        ta, tb = a.tangent / a.weights, b.tangent / b.weights
        ta, tb = ta * length / (row @ (w * ta)), tb * length / (row @ (w * tb))
        if not (np.isfinite(ta).all() and np.isfinite(tb).all()):
            raise ArithmeticError("tangents across the chord")
        t = share
        guess = (
            (1 + 2 * t) * (1 - t) ** 2 * a.y
            + t**2 * (3 - 2 * t) * b.y
            + t * (1 - t) ** 2 * ta / w * w
            - t**2 * (1 - t) * tb / w * w
        )
        value = float(row @ (w * ((1 - t) * a.y + t * b.y)))
        point = self.solve(guess, row, value, (1 - t) * a.tangent / a.weights + t * b.tangent / b.weights, w)
        point.s = a.s + share * (b.s - a.s)
        return point

    # ------------------------------------------------------------------------------------------------------- marching
    def follow(self, start: Point, direction: float) -> Curve:
        """Follow the curve from a motion until it leaves the range, closes, or meets its parent (nu = 2)."""
        curve = Curve()
        here = start
        if here.slope * direction < 0.0:
            here = Point(here.y, here.weights, here.jac, here.mu, -here.tangent, here.half)
        curve.points.append(here)
        h = 0.01
        try:
            while True:
                new, h, nxt = self.step(here, h)
                if self.nu == 2 and float(new.half @ here.half) < 0.0:
                    points, omega = self.towards_parent(here, new)
                    curve.points += [p for p in points if self.low <= p.omega <= self.high]
                    curve.ended = f"parent at omega = {omega:.6g}"
                    break
                if new.omega < self.low or new.omega > self.high:
                    bound = self.low if new.omega < self.low else self.high
                    new = self.at_bound(here, new, bound)
                    curve.points.append(new)
                    curve.ended = f"omega = {bound:.9g}"
                    break
                curve.points.append(new)
                if len(curve.points) > 4 and self.closes(curve.points[0], here, new):
                    curve.ended = "closed"
                    break
                here, h = new, nxt
                if len(curve.points) > 20000:
                    raise Failure("20000 points")
        except Failure as failure:
            curve.failure = str(failure)
            curve.ended = "failed"
        return curve

    def step(self, here: Point, h: float) -> tuple[Point, float, float]:
        """The next point, the step taken and the next one to try."""
        while True:
            if h < SHORTEST:
                raise Failure(f"steps become too short at omega = {here.omega:.9g}")
            w = here.weights
            guess = here.y + h * here.tangent / w
            value = float(here.tangent @ (w * here.y)) + h
            try:
                new = self.solve(guess, here.tangent, value, here.tangent / w, w)
            except ArithmeticError:
                h *= 0.4
                continue
            along = new.tangent / new.weights * w
            cosine = float(here.tangent @ along) / float(np.linalg.norm(along))
            off = float(np.linalg.norm(w * (new.y - guess))) / h
            moved = movement(here.mu, new.mu)
            if (cosine < TURN or off > 0.15 or moved > MOVEMENT) and h > 20 * SHORTEST:
                h *= 0.5
                continue
            new.s = here.s + h
            easy = cosine > 1 - 0.3 * (1 - TURN) and off < 0.06 and moved < 0.5 * MOVEMENT
            return new, h, min(LONGEST, h * (1.7 if easy else 1.0))

    def at_bound(self, a: Point, b: Point, bound: float) -> Point:
        share = (bound - a.omega) / (b.omega - a.omega)
        y = a.y + share * (b.y - a.y)
        y[-1] = bound
        row = np.zeros(len(y))
        row[-1] = 1.0
        try:
            point = self.solve(y, row, float(a.weights[-1] * bound), a.tangent / a.weights, a.weights)
        except ArithmeticError:
            raise Failure(f"the end at omega = {bound} is not found") from None
        point.s = a.s + share * (b.s - a.s)
        return point

    def towards_parent(self, a: Point, b: Point) -> tuple[list[Point], float]:
        """Points closer and closer to where the odd part vanishes, between the last point before and the first after;
        and the frequency there.

        At that place itself the equations of twice the period are singular: what lies within PARENT of the odd part's
        largest size is the parent's.
        """
        unit = a.half / np.linalg.norm(a.half)
        rate = float(unit @ (a.half - b.half)) / (b.s - a.s)
        points, here = [a], a
        while True:
            f = float(unit @ here.half)
            if f < PARENT * self.odd or len(points) > 30:
                break
            try:
                here = self.step(here, 0.5 * f / rate)[0]
            except Failure:
                break
            if not 0.0 < float(unit @ here.half) < f:
                break
            points.append(here)
        return points[1:], points[-1].omega

    def closes(self, first: Point, a: Point, b: Point) -> bool:
        """Whether the curve has come back to its first point, or to it a load period later."""
        w = b.weights
        targets = [first.y]
        if self.nu == 2:
            targets.append(np.append(first.y[:-1] - first.half, first.omega))
        size = float(np.linalg.norm(w * (b.y - a.y)))
        for target in targets:
            rel = w * (target - a.y)
            chord = w * (b.y - a.y)
            t = float(rel @ chord) / size**2
            if 0.0 < t <= 1.0 and float(np.linalg.norm(rel - t * chord)) < 0.03 * size + 1e-7:
                return True
        return False

    # --------------------------------------------------------------------------------------------------------- events
    def judge(self, curve: Curve) -> None:
        """Refine the points of a curve until its events are separated, and solve for them."""
        try:
            self.refine(curve)
            self.locate(curve)
        except Failure as failure:
            curve.failure = curve.failure or str(failure)

    def refine(self, curve: Curve) -> None:
        i = 0
        points = curve.points
        while i < len(points) - 1:
            a, b = points[i], points[i + 1]
            size = float(np.linalg.norm(b.weights * (b.y - a.y)))
            reason = self.crowded(a, b) or self.hides(points, i)
            if not reason or size < FINEST:
                if reason:
                    curve.close.append((0.5 * (a.omega + b.omega), reason))
                i += 1
                continue
            middle = None
            for share in (0.5, 0.4, 0.65, 0.25, 0.8):
                try:
                    middle = self.between(a, b, share)
                    break
                except ArithmeticError:
                    continue
            if middle is None:
                curve.close.append((0.5 * (a.omega + b.omega), f"{reason}; no motion in between"))
                i += 1
                continue
            points.insert(i + 1, middle)
            # what lies before sees another neighbour
            i = max(0, i - 1)

    def crowded(self, a: Point, b: Point) -> str:
        """Whether more than one thing changes between two points, or the count is not explained."""
        changed = changes(a, b)
        explained = sum({"LP": 1, "BP": 1, "PD": 1, "NS": 2}[kind] for kind, _ in changed)
        difference = abs(b.unstable() - a.unstable())
        if len(changed) > 1:
            # a pitchfork at which the curve turns back stays two changes however close one looks
            return "several events at once"
        if difference != explained:
            return f"the count of unstable multipliers changes by {difference}, {explained} explained"
        if movement(a.mu, b.mu) > 2.0 * MOVEMENT:
            return "multipliers move fast"
        if a.product("torus") * b.product("torus") < 0.0 and not changed_pair(a, b):
            return "a pair may cross the circle and become real"
        return ""

    def hides(self, points: list[Point], i: int) -> str:
        """Whether a smooth test function may have two zeros more between two points than seen at its ends."""
        low, high = max(0, i - 1), min(len(points), i + 3)
        stencil = points[low:high]
        if len(stencil) < 3:
            return "too few points"
        s = np.array([p.s for p in stencil])
        for name in ("turn", "fold", "double", "torus"):
            f = np.array([p.slope if name == "turn" else p.product(name) for p in stencil])
            if may_vanish_twice(s, f, i - low):
                return f"{name} may vanish unseen"
        return ""

    def locate(self, curve: Curve) -> None:
        for a, b in pairwise(curve.points):
            changed = changes(a, b)
            found = []
            for kind, members in changed:
                located = self.zero(kind, members, a, b)
                if located is not None:
                    found.append(located)
            kinds = {item.kind: item for item in found}
            if "LP" in kinds and "BP" in kinds:
                apart = abs(kinds["LP"].s - kinds["BP"].s)
                if apart < 10 * FINEST:
                    # at a pitchfork the branch that leaves turns back
                    found.remove(kinds["LP"])
            curve.events += sorted(found, key=lambda item: item.s)

    def zero(self, kind: str, members: tuple[complex, complex] | None, a: Point, b: Point) -> Found | None:
        """The event between two points, by Illinois on its function."""

        def value(p: Point, share: float) -> float:
            if kind == "LP":
                return p.slope
            if kind == "PD":
                return p.product("double")
            if kind == "BP":
                return p.product("fold")
            assert members is not None
            aim = members[0] + share * (members[1] - members[0])
            upper = p.mu[p.mu.imag >= 0.0]
            return float(abs(upper[np.argmin(np.abs(upper - aim))]) - 1.0)

        low, high = 0.0, 1.0
        f_low, f_high = value(a, 0.0), value(b, 1.0)
        best, size, side = (a, abs(f_low), 0) if abs(f_low) < abs(f_high) else (b, abs(f_high), 0)
        for count in range(80 if f_low * f_high < 0.0 else 0):
            # a function that jumps, or all but does, is halved
            wanted = 0.5 * (low + high) if count % 4 == 3 else high - f_high * (high - low) / (f_high - f_low)
            p = None
            for share in (wanted, 0.5 * (low + high), 0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high):
                if not low < share < high:
                    continue
                try:
                    p = self.between(a, b, share)
                    break
                except ArithmeticError:
                    continue
            if p is None:
                break
            f = value(p, share)
            if abs(f) < size:
                best, size = p, abs(f)
            if abs(f) < 1e-13 or high - low < 1e-11:
                break
            if kind == "BP" and high - low < 2e-3:
                # the equations are singular there: from either side instead
                return self.beside(kind, a, b, low, high)
            if f * f_high > 0.0:
                high, f_high = share, f
                f_low *= 0.5 if side == -1 else 1.0
                side = -1
            else:
                low, f_low = share, f
                f_high *= 0.5 if side == 1 else 1.0
                side = 1
        target = {"LP": 1.0, "BP": 1.0, "PD": -1.0}.get(kind)
        if target is None:
            assert members is not None
            aim = 0.5 * (members[0] + members[1])
            upper = best.mu[best.mu.imag >= 0.0]
            multiplier = complex(upper[np.argmin(np.abs(upper - aim))])
        else:
            multiplier = complex(best.mu[np.argmin(np.abs(best.mu - target))])
        return Found(kind, best.s, best, multiplier)

    def beside(self, kind: str, a: Point, b: Point, low: float, high: float) -> Found:
        """A branch point from the cubic through `prod (mu - 1)` at four motions, two on either side of it."""
        middle, points, shares = 0.5 * (low + high), [], []
        for way in (-0.02, -0.006, 0.006, 0.02):
            share = min(1.0, max(0.0, middle + way))
            if share in shares:
                continue
            try:
                points.append(a if share == 0.0 else b if share == 1.0 else self.between(a, b, share))
                shares.append(share)
            except ArithmeticError:
                continue
        if len(points) < 2:
            raise Failure(f"no motions beside the branch point at omega = {a.omega:.9g}")
        f = np.array([p.product("fold") for p in points])
        # where the curve turns back as well, the function has a double zero there and changes no sign
        if f.min() * f.max() < 0.0:
            order = np.argsort(f)
            root = float(lagrange(f[order], np.array(shares)[order], np.zeros(1))[0])
        else:
            root = middle
        y = np.array(
            [lagrange(np.array(shares), column, np.array([root]))[0] for column in np.array([p.y for p in points]).T]
        )
        near = points[int(np.argmin(np.abs(np.array(shares) - root)))]
        at = Point(y, near.weights, near.jac, near.mu, near.tangent, near.half, a.s + root * (b.s - a.s))
        return Found(kind, at.s, at, complex(near.mu[np.argmin(np.abs(near.mu - 1.0))]))


def pairs_of(mu: np.ndarray) -> np.ndarray:
    """One member of every complex pair."""
    return mu[mu.imag > 1e-9 * np.abs(mu)]


def matched(old: np.ndarray, new: np.ndarray) -> list[tuple[complex, complex]]:
    """Multipliers of neighbouring motions, one to one, by least movement."""
    distance = np.abs(old[:, None] - new[None, :]) / np.maximum(1.0, np.abs(old[:, None]))
    rows, cols = linear_sum_assignment(distance)
    return [(complex(old[i]), complex(new[j])) for i, j in zip(rows, cols, strict=True)]


def movement(old: np.ndarray, new: np.ndarray) -> float:
    """Largest movement of a multiplier of modulus above 0.3, relative to its modulus above one."""
    return max((abs(a - b) / max(1.0, abs(a)) for a, b in matched(old, new) if max(abs(a), abs(b)) > 0.3), default=0.0)


def changes(a: Point, b: Point) -> list[tuple[str, tuple[complex, complex] | None]]:
    """The kinds whose functions change sign between two points."""
    found: list[tuple[str, tuple[complex, complex] | None]] = []
    if a.slope * b.slope < 0.0:
        found.append(("LP", None))
    if a.orientation() != b.orientation():
        found.append(("BP", None))
    if a.product("double") * b.product("double") < 0.0:
        found.append(("PD", None))
    for p, q in matched(a.mu, b.mu):
        both = p.imag > 1e-9 * abs(p) and q.imag > 1e-9 * abs(q)
        if both and (abs(p) > 1.0) != (abs(q) > 1.0):
            found.append(("NS", (p, q)))
    return found


def changed_pair(a: Point, b: Point) -> bool:
    """Whether what changes the sign of prod (1 - mu_i mu_j) is seen: a complex pair that crosses the circle, or two
    real multipliers that become each other's inverses.
    """
    pairs = matched(a.mu, b.mu)
    real = [(p.real, q.real) for p, q in pairs if max(abs(p.imag) / abs(p), abs(q.imag) / abs(q)) <= 1e-9]
    saddles = sum((p * r - 1.0) * (q * s - 1.0) < 0.0 for i, (p, q) in enumerate(real) for r, s in real[:i])
    crossings = sum(kind == "NS" for kind, _ in changes(a, b))
    return bool((saddles + crossings) % 2)


def may_vanish_twice(s: np.ndarray, f: np.ndarray, at: int) -> bool:
    """Whether the interpolant through three or four points, believed up to twice its distance from those of lower
    order, leaves room between s[at] and s[at + 1] for two zeros beyond those that the ends show.
    """
    top = np.abs(f).max()
    if top == 0.0:
        return True
    f = f / top
    x = s[at] + (s[at + 1] - s[at]) * np.linspace(0.02, 0.98, 25)
    if f[at] * f[at + 1] <= 0.0:
        whole = s[at] + (s[at + 1] - s[at]) * np.linspace(0.0, 1.0, 201)
        values = lagrange(s, f, whole)
        crossing = np.nonzero(values[:-1] * values[1:] <= 0.0)[0]
        if len(crossing) != 1:
            return True
        k = crossing[0]
        root = whole[k] - values[k] * (whole[k + 1] - whole[k]) / (values[k + 1] - values[k])
        if np.abs(s - root).min() < 1e-3 * (s[at + 1] - s[at]):
            return False
        # without the zero that is seen
        f = f / (s - root)
        f = f / np.abs(f).max()
        if f[at] * f[at + 1] <= 0.0:
            return True
    value = lagrange(s, f, x)
    doubt = np.zeros_like(x)
    for first, last in ((0, at + 2), (at, len(s))):
        if last - first < len(s):
            doubt = np.maximum(doubt, np.abs(lagrange(s[first:last], f[first:last], x) - value))
    sign = 1.0 if f[at] > 0.0 else -1.0
    return bool((sign * value - 2.0 * doubt < 0.0).any())


def lagrange(s: np.ndarray, f: np.ndarray, x: np.ndarray) -> np.ndarray:
    total = np.zeros_like(x)
    for i in range(len(s)):
        term = np.full_like(x, f[i])
        for j in range(len(s)):
            if j != i:
                term *= (x - s[j]) / (s[i] - s[j])
        total += term
    return total


# ---------------------------------------------------------------------------------------------------------- the answer
def judged(
    description: dict[str, Any],
    start: Sequence[float],
    omega: float,
    direction: float,
    nu: int = 1,
    seconds: float = 60.0,
) -> dict[str, Any]:
    """The events of the curve through a motion: from it in a direction (nu = 1), or from end to end (nu = 2).

    Plain data: kinds, frequencies, states, multipliers, the number of unstable multipliers before, between and after
    them, in the order of the curve; how it ends; why it could not be judged to its end, if so.
    """
    began = time.perf_counter()
    judge = Judge(System(description), tuple(description["omega"]), nu, seconds)
    curves: list[Curve] = []
    failure = ""
    try:
        first = judge.started(np.array(start, float), omega)
        if nu == 2 and np.linalg.norm(first.half) < 1e-3 * np.linalg.norm(first.y[:-1]):
            raise Failure("the start leads to the parent")
        for way in (direction,) if nu == 1 else (-direction, direction):
            curve = judge.follow(first, way)
            judge.judge(curve)
            curves.append(curve)
            if curve.ended == "closed":
                break
    except Failure as error:
        failure = str(error)
    events: list[Found] = []
    counts: list[int] = []
    ends: list[str] = []
    for number, curve in enumerate(curves):
        between = segments(curve)
        back = number == 0 and len(curves) == 2
        events = events + (curve.events[::-1] if back else curve.events)
        part = between[::-1] if back else between
        counts = [*counts[:-1], *part] if counts else list(part)
        ends.append(curve.ended)
        failure = failure or curve.failure
    return {
        "nu": nu,
        "start": [float(v) for v in start],
        "start_omega": float(omega),
        "direction": float(direction),
        "events": [
            {
                "kind": item.kind,
                "omega": item.point.omega,
                "state": item.point.y[:-1].tolist(),
                "multiplier": [item.multiplier.real, item.multiplier.imag],
                "multipliers": [[mu.real, mu.imag] for mu in item.point.mu],
            }
            for item in events
        ],
        "unstable": counts,
        "ended": ends,
        "ends": [curve.points[-1].omega for curve in curves if curve.points],
        "points": sum(len(curve.points) for curve in curves),
        "close": [[omega, reason] for curve in curves for omega, reason in curve.close][:20],
        "failure": failure,
        "seconds": round(time.perf_counter() - began, 2),
    }


def segments(curve: Curve) -> list[int]:
    """The number of unstable multipliers before, between and after the events: that of the most points (those right at
    an event may lie on either side).
    """
    counts = []
    edges = [-math.inf, *[item.s for item in curve.events], math.inf]
    for low, high in pairwise(edges):
        inside = [p.unstable() for p in curve.points if low < p.s < high]
        counts.append(max(set(inside), key=inside.count) if inside else -1)
    return counts


def scipys(description: dict[str, Any], state: Sequence[float], omega: float, samples: int = 2) -> np.ndarray:
    """States at equal parts of a period, both ends included, by SciPy's own DOP853 with location of contacts;
    shape (samples, 2 n).
    """
    from scipy.integrate import solve_ivp

    system = System(description)
    n = system.n
    minv, damping, stiffness, dirs, codes, pars, loads = system.arrays

    def right(tau: float, z: np.ndarray) -> np.ndarray:
        x, v = z[:n], z[n:]
        force = -damping @ v - stiffness @ x
        for row in loads:
            force = force + row[2:] * math.cos(row[0] * tau + row[1])
        for d, code, par in zip(dirs, codes, pars, strict=True):
            u, w = d @ x, d @ v
            mode = 1.0 if (par[2] * (u - par[1]) if code == STOP else w) > 0.0 else -1.0
            force = force - d * law(code, par, mode, u, w, tau)[0]
        return np.concatenate((v, minv @ force)) / omega

    functions: list[Callable[[float, np.ndarray], float]] = []
    for d, code, par in zip(dirs, codes, pars, strict=True):
        if code == STOP:
            functions.append(lambda tau, z, d=d, par=par: float(d @ z[:n] - par[1]))
    answer = solve_ivp(
        right,
        (0.0, 2.0 * math.pi),
        np.array(state, float),
        method="DOP853",
        t_eval=np.linspace(0.0, 2.0 * math.pi, samples),
        rtol=1e-12,
        atol=1e-13,
        max_step=0.05,
        events=functions or None,
    )
    return np.asarray(answer.y.T)


def against_scipy(description: dict[str, Any], state: Sequence[float], omega: float) -> float:
    """Largest difference of the state after one period from SciPy's own integration, relative to the largest state."""
    theirs = scipys(description, state, omega, 64)
    mine, _ = System(description).period_map(np.array(state, float), omega, 1, False)
    return float(np.abs(theirs[-1] - mine[:, 0]).max() / np.abs(theirs).max())
