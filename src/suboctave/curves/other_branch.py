"""Where another curve of the same equations crosses a curve: the point, the direction, first points on both sides.

At a branch point of `F(u) = 0`, one equation fewer than unknowns, F_u has a null space of two dimensions. With t the
curve's direction and phi the other one across it, psi the left null vector, a curve leaves along `s phi + r t` where

    c s^2 + 2 b s r + a r^2 = 0,    a = psi . F''[t, t],  b = psi . F''[phi, t],  c = psi . F''[phi, phi]

(Keller 1977), and a = 0 but for the place of the point. The second derivatives are differences of F_u, so that what is
followed does not matter: motions of a free phase among them, whose R_X is singular all along.

The equations of a curve are singular at the point itself, which they give to half the digits. With the null vectors
psi_0, V_0 of a motion close by as borders,

    [F_u psi_0; V_0 0] [v; g] = [0; 1],    F + beta psi_0 = 0,  g_1 = g_2 = 0

are as many equations as unknowns, u and the unfolding beta, and regular (Govaerts, Numerical Methods for Bifurcations
of Dynamical Equilibria, SIAM 2000); g changes by `-psi . F_uu[v, .]`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from suboctave.continuation.linear import cosine, length
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import CurvePoint, make_point
from suboctave.continuation.problem import Array, Curve
from suboctave.errors import ConvergenceError

#: step of the differences, in scaled arclength
_STEP = 1e-5
#: discriminant, relative to the coefficients, below which the two directions are not told apart
_DISTINCT = 1e-10
#: share of F_u's third smallest singular value above which the second is none that vanishes
_CROSSED = 0.03
#: corrections for the place of a crossing, the last one and how far all lead, in scaled arclength; unfolding, in units
#: of F_u, of curves that pass each other
_CORRECTIONS, _SETTLED, _CLOSE, _UNFOLDED = 8, 1e-10, 1e-2, 1e-8
#: distances in scaled arclength at which the first point of the other curve is looked for
_DISTANCES = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
#: cosine of a first point's direction with the one that leads there, at least
_AHEAD = 0.98


def crossing_point(curve: Curve, u: Array, weights: Array) -> Array:
    """The point at which two curves cross, from one close to it, (N,); ConvergenceError where it is not found close by
    or the curves pass each other.
    """
    left, _, right = np.linalg.svd(curve.evaluate(u).jacobian / weights)
    psi, borders, start, n = left[:, -1], right[-2:], u, len(left)
    beta = 0.0
    ends = np.concatenate((np.zeros((n, 2)), np.eye(2)))
    for _ in range(_CORRECTIONS):
        evaluation = curve.evaluate(u)
        jacobian = evaluation.jacobian / weights
        bordered = np.block([[jacobian, psi[:, None]], [borders, np.zeros((2, 1))]])
        # (v; g) of both, and the left null vector
        solved = np.linalg.solve(bordered, ends)
        across = np.linalg.solve(bordered.T, np.eye(1, n + 2, n + 1)[0])[:n]
        rows = [-_bent(curve, u, weights, across, v) for v in solved[: n + 1].T]
        whole = np.block([[jacobian, psi[:, None]], [np.array(rows), np.zeros((2, 1))]])
        step = np.linalg.solve(whole, -np.concatenate((evaluation.residual + beta * psi, solved[n + 1])))
        u, beta = u + step[:-1] / weights, beta + float(step[-1])
        if length(weights * (u - start)) > _CLOSE:
            break
        if length(step[:-1]) <= _SETTLED:
            if abs(beta) > _UNFOLDED * length(jacobian.ravel()):
                break
            return u
    raise ConvergenceError(f"no crossing of curves was found beside {curve.where(start)}")


def _bent(curve: Curve, u: Array, weights: Array, psi: Array, by: Array) -> Array:
    """`psi . F''[by, .]`, in scaled arclength."""
    ahead, behind = (curve.evaluate(u + s * _STEP * by / weights).jacobian for s in (1.0, -1.0))
    change: Array = psi @ ((ahead - behind) / weights) / (2.0 * _STEP)
    return change


def other_direction(curve: Curve, u: Array, weights: Array, tangent: Array) -> Array:
    """The direction in which the other curve crosses at a branch point, of unit length in scaled arclength.

    Parameters
    ----------
    curve, u, weights
        The branch point, u of shape (N,), and the units of scaled arclength there, (N,).
    tangent
        About the direction of the curve that is known, (N,).

    Raises
    ------
    ConvergenceError
        If no other curve crosses there, or the directions cannot be told apart.
    """
    left, sizes, right = np.linalg.svd(curve.evaluate(u).jacobian / weights)
    if len(sizes) > 1 and sizes[-1] > _CROSSED * sizes[-2]:
        raise ConvergenceError(f"no other curve crosses at {curve.where(u)}")
    known = weights * tangent
    basis = right[-2:]
    along = basis.T @ (basis @ known)
    if not length(along) > 0.5 * length(known):
        raise ConvergenceError(f"the direction of the curve at {curve.where(u)} is not known")
    t = along / length(along)
    across = basis[0] - t * float(t @ basis[0])
    if length(across) < 0.5:
        across = basis[1] - t * float(t @ basis[1])
    phi, psi = across / length(across), left[:, -1]

    by_t, by_phi = (_bent(curve, u, weights, psi, by) for by in (t, phi))
    a, b, c = float(by_t @ t), 0.5 * float(by_t @ phi + by_phi @ t), float(by_phi @ phi)
    inside = b * b - a * c
    if not inside > _DISTINCT * max(abs(a), abs(b), abs(c)) ** 2:
        raise ConvergenceError(f"the curves that cross at {curve.where(u)} cannot be told apart")
    root = b + math.copysign(math.sqrt(inside), b)
    # the roots s : r are -root : c and -a : root: the one that leads away from the curve is the other's
    s, r = max(((-root, c), (-a, root)), key=lambda pair: abs(pair[0]) / math.hypot(*pair))
    direction: Array = (s * phi + r * t) / (math.hypot(s, r) * weights)
    return direction


def beside_branch_point(curve: Curve, u: Array, direction: Array, weights: Array, newton: NewtonOptions) -> CurvePoint:
    """The first point of a curve that leaves a branch point u in a direction, of unit length in `weights`, headed away;
    ConvergenceError where none is found.
    """
    row = weights * direction
    for distance in _DISTANCES:
        try:
            solved = correct(curve, u + distance * direction, row, weights, newton)
            point = make_point(solved, direction, 0.0)
        except ConvergenceError:
            continue
        way = length(weights * (solved.u - u))
        if way <= 1.5 * distance and cosine(point.tangent, direction, weights) >= _AHEAD:
            return replace(point, arclength=0.0)
    raise ConvergenceError(f"no point of the other curve was found beside {curve.where(u)}")
