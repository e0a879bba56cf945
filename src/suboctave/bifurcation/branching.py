"""Which way other branches leave: the directions of emanating branches at branch points and period doublings.

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
from dataclasses import dataclass

import numpy as np

from suboctave.bifurcation.bordered import NullVectors, bordered, null_vectors
from suboctave.continuation.linear import length
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.derivatives import Direction, second_derivative
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import motion_size

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
            f"the branches at this branch point cannot be told apart (branching equation {c:.2e} s^2 + {2 * b:.2e} s r "
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
