"""Where another curve of the same equations crosses a curve: its direction there, and its first points on both sides.

At a branch point of `F(u) = 0`, one equation fewer than unknowns, F_u has a null space of two dimensions. With t the
curve's direction and phi the other one across it, psi the left null vector, a curve leaves along `s phi + r t` where

    c s^2 + 2 b s r + a r^2 = 0,    a = psi . F''[t, t],  b = psi . F''[phi, t],  c = psi . F''[phi, phi]

(Keller 1977), and a = 0 but for the place of the point. The second derivatives are differences of F_u, so that what is
followed does not matter: motions of a free phase among them, whose R_X is singular all along.
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
#: distances in scaled arclength at which the first point of the other curve is looked for
_DISTANCES = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
#: cosine of a first point's direction with the one that leads there, at least
_AHEAD = 0.98


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

    def bent(by: Array) -> Array:
        """psi . F''[by, .] in scaled arclength."""
        ahead, behind = (curve.evaluate(u + s * _STEP * by / weights).jacobian for s in (1.0, -1.0))
        change: Array = psi @ ((ahead - behind) / weights) / (2.0 * _STEP)
        return change

    by_t, by_phi = bent(t), bent(phi)
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
            point = make_point(solved, curve, direction, 0.0)
        except ConvergenceError:
            continue
        way = length(weights * (solved.u - u))
        if way <= 1.5 * distance and cosine(point.tangent, direction, weights) >= _AHEAD:
            return replace(point, arclength=0.0)
    raise ConvergenceError(f"no point of the other curve was found beside {curve.where(u)}")
