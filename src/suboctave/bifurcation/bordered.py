"""One bordered system for every bifurcation of a periodic motion.

With J = J_kappa(X, omega, parameters), bordered by vectors b, c,

    [J b; c^H 0] [v; g] = [0; 1],     [J b; c^H 0]^H [u; .] = [0; 1],

g vanishes exactly where J is singular; v and u are then its right and left null vectors, and the gradient of g is
`g_p = -u^H J_p v` (Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, chapter 4). The
minimally augmented system is

    [R; g] = 0            limit point (kappa = 0), period doubling (kappa = w0 / 2)
    [R; Re g; Im g] = 0   Neimark-Sacker (kappa free, one unknown more)

Rows and columns are weighted by the square roots of the masses, so that b, c, and g (in 1/time^2) do not depend on
the units of single DOFs.

Other branches leave along them.

At a branch point `R_X` has the null vectors phi (right) and psi (left), and `psi . R_p = 0`, p the free parameter. With
`v = (X', 1)`, `R_X X' = -R_p`, `phi . X' = 0`, and `phi = (phi, 0)`, the two branches leave along `s phi + r v` where

    c s^2 + 2 b s r + a r^2 = 0,    a = psi . R''[v, v],  b = psi . R''[v, phi],  c = psi . R''[phi, phi],

the algebraic branching equation (Keller 1977; Seydel, Practical Bifurcation and Stability Analysis, 2010, section 5.4),
here homogeneous: at a pitchfork c = 0, and the form `phi + beta v` would lose the bifurcating branch.

At a period doubling the doubled branch leaves along the half-odd null vector, `(0, phi_half, dp = 0)`: a vector of the
basis of twice the period, in which it has odd multiples only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from suboctave.continuation.linear import Factor, bordered as bordered_factor, length
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.derivatives import Direction, second_derivative
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, bilinear_gradient, operator
from suboctave.harmonic.truncation import motion_size


@dataclass(frozen=True)
class NullVectors:
    """Null vectors of a (nearly) singular operator with its mass weights: right `v`, left `u`, unit length in
    weighted form; with zeros at harmonics that the motion's basis leaves out.
    """

    right: np.ndarray
    left: np.ndarray

    def resized(self, basis: HarmonicBasis, size: int, kind: Kind) -> NullVectors:
        """The same vectors with the harmonics of a basis, those that it does not have dropped."""
        rows = size * (basis.size + (kind is Kind.HALF))
        return NullVectors(*(_resized(v, rows, kind is Kind.FREE) for v in (self.right, self.left)))


def _resized(vector: np.ndarray, rows: int, two_sided: bool) -> np.ndarray:
    excess = len(vector) - rows
    if excess == 0:
        return vector
    # harmonics in ascending order, from 0 or from -H
    front = excess // 2 if two_sided else 0
    if excess > 0:
        vector = vector[front : front + rows]
    else:
        vector = np.concatenate((np.zeros(-front), vector, np.zeros(front - excess)))
    return vector / np.linalg.norm(vector)


@dataclass(eq=False, slots=True)
class Bordered:
    """The scalar g of an operator at one motion, with what its gradient needs; `factor`: of the bordered matrix."""

    state: BalanceState
    kind: Kind
    kappa: float
    g: complex
    right: np.ndarray
    left: np.ndarray
    scale: np.ndarray
    factor: Factor

    def gradient(self, names: tuple[str, ...]) -> tuple[np.ndarray, dict[str, complex], complex]:
        """Derivatives of g by the unknown coefficients (dimension,), by names, by kappa."""
        slope = bilinear_gradient(self.state, self.kind, self.left, self.right, names, self.kappa)
        return -slope.x.ravel(), {k: -r for k, r in slope.rates.items()}, -slope.kappa

    @property
    def vectors(self) -> NullVectors:
        """Bordering vectors for the next iteration: the present null vectors, weighted and of unit length."""
        return NullVectors(_unit(self.right / self.scale), _unit(self.left / self.scale))


def weighted_operator(state: BalanceState, kind: Kind, kappa: float) -> tuple[np.ndarray, np.ndarray]:
    """J_kappa with rows and columns weighted by 1/sqrt(mass), and these weights."""
    matrix = operator(state, kind, kappa)
    scale = state.balance.row_weights(matrix.shape[0])
    return matrix * scale[:, None] * scale, scale


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / math.sqrt(np.vdot(vector, vector).real)


def null_vectors(state: BalanceState, kind: Kind, kappa: float = 0.0, iterations: int = 4) -> NullVectors:
    """Singular vectors of the smallest singular value of the weighted operator, by inverse iteration."""
    matrix, _ = weighted_operator(state, kind, kappa)
    factor = Factor.of(matrix)
    if factor.singular:
        return NullVectors(*_by_svd(matrix))
    # a start with a component along everything, the same in every run
    n = matrix.shape[0]
    left = (np.cos(np.arange(n) * 1.7 + 0.3) / (1.0 + np.arange(n) / 8.0)).astype(matrix.dtype)
    right = left
    for _ in range(iterations):
        right = factor.solve(_unit(left))
        left = factor.solve(_unit(right), adjoint=True)
    if not (np.isfinite(left).all() and np.isfinite(right).all()):
        return NullVectors(*_by_svd(matrix))
    return NullVectors(_unit(right), _unit(left))


def _by_svd(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    u, _, vh = np.linalg.svd(matrix)
    return vh[-1].conj(), u[:, -1]


def transversality(state: BalanceState, vectors: NullVectors, name: str) -> float:
    """`|psi . R_p| / (|psi| |R_p|)` in mass weights, psi the left null vector of R_X and p a parameter: how far R_p is
    from the range of a singular R_X.

    Zero at branch points; a branch turns back in p, simply, where it is not.
    """
    left = vectors.left
    slope = state.residual_by(name) * state.balance.row_weights(len(left))
    size = length(left) * length(slope)
    return abs(float(left @ slope)) / size if size > 0.0 else 0.0


def bordered(state: BalanceState, kind: Kind, borders: NullVectors, kappa: float = 0.0) -> Bordered:
    """Evaluate g and the vectors of its gradient, bordered by `borders` (b = left, c = right)."""
    n = borders.right.size
    scale = state.balance.row_weights(n)
    matrix = operator(state, kind, kappa)
    # the operator's own size balances the bordering rows
    size = state.omega**2
    row = np.zeros(n + 1, dtype=matrix.dtype)
    row[:n] = size * np.conjugate(borders.right)
    left = np.multiply(size, borders.left, dtype=matrix.dtype)
    factor = bordered_factor(matrix * scale[:, None], scale, left[:, None], row)
    rhs = np.zeros(n + 1, dtype=factor.lu.dtype)
    rhs[n] = size
    v = factor.solve(rhs)
    u = factor.solve(rhs, adjoint=True)
    # with b and c scaled by omega^2 the unknown multiplying b is g / omega^2
    g = complex(v[n]) * size
    return Bordered(state, kind, kappa, g, v[:n] * scale, u[:n] * scale, scale, factor)


def at_values(values: Mapping[str, float], name: str, value: float, omega: float) -> tuple[float, Mapping[str, float]]:
    """omega and parameter values with the free one, "omega" or a parameter, set."""
    if name == "omega":
        return value, values
    return omega, {**values, name: value}


#: discriminant of the branching equation, relative to its coefficients, below which two branches are not told apart
_DISTINCT = 1e-10


@dataclass(frozen=True)
class BranchingEquation:
    """The algebraic branching equation at a branch point and its solutions.

    a, b, c
        Its coefficients, for phi as large as the motion and v over the range of the parameter, in units of forces.
    directions
        The two directions `(dX, dp)`, shape (dimension + 1,), unit length in `weights`.
    weights
        Units: square roots of the masses over the size of the motion, and one over the parameter's range.
    """

    a: float
    b: float
    c: float
    directions: tuple[Array, Array]
    weights: Array

    def other(self, tangent: Array) -> Array:
        """The direction that is not that of a known tangent, (dimension + 1,)."""
        along = self.weights * tangent
        cosines = [abs(float((self.weights * d) @ along)) for d in self.directions]
        return self.directions[int(np.argmin(cosines))]


def branching_equation(
    state: BalanceState, name: str, span: float, vectors: NullVectors | None = None
) -> BranchingEquation:
    """The directions in which branches leave a located branch point; ConvergenceError where no two are real.

    `name`, `span`: the free parameter and the width of its range; `vectors`: null vectors of R_X, where they are known.
    """
    borders = null_vectors(state, Kind.INTEGER) if vectors is None else vectors
    border = bordered(state, Kind.INTEGER, borders)
    scale, shaped = border.scale, state.balance.shaped
    phi = border.right / length(border.right / scale) * (motion_size(state) or 1.0)
    psi = border.left
    slope = state.residual_by(name)
    v = -border.factor.solve(np.append(slope * scale, 0.0))[:-1] * scale * span
    along, across = Direction(shaped(v), {name: span}), Direction(shaped(phi))
    a, b, c = (
        float(psi @ second_derivative(state, *pair)) for pair in ((along, along), (along, across), (across, across))
    )
    largest = max(abs(a), abs(b), abs(c))
    inside = b * b - a * c
    if not inside > _DISTINCT * largest**2:
        raise ConvergenceError(
            f"the branches at this branch point cannot be separated (branching equation {c:.2e} s^2 + {2 * b:.2e} s r "
            f"+ {a:.2e} r^2)"
        )
    root = b + math.copysign(math.sqrt(inside), b)
    weights = np.append(1.0 / (scale * (motion_size(state) or 1.0)), 1.0 / span)
    directions = []
    # the roots s : r are -root : c and -a : root, whichever of a, c vanishes
    for s, r in ((-root, c), (-a, root)):
        direction = np.append(s * phi + r * v, r * span)
        directions.append(direction / length(weights * direction))
    return BranchingEquation(a, b, c, (directions[0], directions[1]), weights)


def doubled_direction(vector: Array, size: int, doubled: HarmonicBasis) -> Array:
    """A half-odd vector (2 H + 2 times size,) as coefficients (2 H' + 1, size) of a basis of twice the period.

    Harmonics beyond that basis are dropped.
    """
    shaped = vector.reshape(-1, size)
    result = np.zeros((doubled.size, size))
    multiples = 2 * np.arange(shaped.shape[0] // 2) + 1
    kept = multiples <= doubled.harmonics
    result[2 * multiples[kept] - 1] = shaped[::2][kept]
    result[2 * multiples[kept]] = shaped[1::2][kept]
    return result
