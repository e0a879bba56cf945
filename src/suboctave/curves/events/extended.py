"""Extended systems: the null vector among the unknowns, solved with the factors of the small blocks.

    [R; J phi; phi.phi - 1] = 0    in (X, phi, parameter), and kappa where it is free,

J = R_X for a limit point (Alcorta et al., Nonlinear Dynamics 98 (2019), Eq. 15), J_half for a period doubling, the
complex J_kappa for a Neimark-Sacker point, whose normalisation `phi^H phi = 1` leaves a rotation of phi that no step
turns (`Im phi^H dphi = 0`). A Newton step

    [ R_X        0      R_p      ] [dX  ]     [ R               ]
    [ (J phi)_X  J      (J phi)_p] [dphi] = - [ J phi           ]
    [ 0          phi^H  0        ] [dp  ]     [ (phi.phi - 1)/2 ]

is taken in two halves. The first row leaves one direction free, the tangent t of the curve: `(dX, dp) = d + s t`. The
second row, its singular block bordered,

    [J b; phi^H 0] [dphi; g] = - [J phi + (J phi)'[d + s t]; (phi.phi - 1)/2],

is a step of the whole system where g = g_0 + s g_1 = 0 (with g_2 dkappa besides, and two real equations, where kappa is
free): four or five solves with factors of n (2 H + 1) and n (2 H + 2) rows, instead of one factorisation of twice that
size (W. Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000). At a limit point R_p borders
R_X and phi completes it: one factorisation serves both halves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from suboctave.bifurcation.bordered import NullVectors, at_values, null_vectors, residual_scale, weighted_operator
from suboctave.continuation.linear import Factor
from suboctave.curves.events.locate import Guess, Singular
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.derivatives import Direction
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, operator_along
from suboctave.harmonic.truncation import motion_size
from suboctave.interruption import check_time
from suboctave.lazy import lazy

#: residual and step at which an iteration has arrived, as for the bordered system
_TOLERANCE = 1e-10
_STEP = 1e-9
_AWAY = 4.0
_NOTHING = 1e-100


class NullVectorEquation:
    """`J_kappa phi = 0` with `phi^H phi = 1`: the second half of an extended system."""

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        #: whether kappa is an unknown
        self.free = kind is Kind.FREE

    def kappa(self, state: BalanceState, free: float) -> float:
        """Frequency of the perturbation; `free`: the unknown, where it is one."""
        return free

    def shift(self, omega: float, nu: int) -> float:
        """Change of kappa with a change of omega."""
        return 0.0

    def normalisation(self, phi: np.ndarray) -> tuple[np.ndarray, complex]:
        """A row and what a step must be along it."""
        return phi.conj(), 0.5 * (1.0 - float(np.vdot(phi, phi).real))

    def combination(self, g: np.ndarray) -> Array:
        """The way along the tangent (and dkappa) that makes `g_0 + s g_1 (+ dkappa g_2)` vanish."""
        if not self.free:
            return np.array([-g[0] / g[1]])
        matrix = np.array([[g[1].real, g[2].real], [g[1].imag, g[2].imag]])
        try:
            found: Array = np.linalg.solve(matrix, -np.array([g[0].real, g[0].imag]))
        except np.linalg.LinAlgError:
            raise ConvergenceError("the extended system is singular") from None
        return found

    def missed(self, value: np.ndarray) -> float:
        """How far `J phi`, in units of omega^2, is from what the system makes of it."""
        return float(np.linalg.norm(value))


@dataclass(frozen=True)
class Solved:
    """A solution of an extended system: state, phi (weighted by masses), its left counterpart, kappa, residuals.

    residual
        Of the equations that were solved, dimensionless.
    defect
        |J phi| in units of omega^2.
    lengths
        Of all steps, in units of motion, range and null vector.
    """

    state: BalanceState
    vectors: NullVectors
    kappa: float
    residual: float
    defect: float
    lengths: tuple[float, ...]

    @property
    def iterations(self) -> int:
        """Number of Newton steps."""
        return len(self.lengths)


def locate_extended(guess: Guess, kind: Kind) -> Singular:
    """Locate a motion at which J_kappa is singular, kappa = 0, w0/2, or free (starting from `guess.kappa`).

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge from the guess.
    """
    begin = guess.state()
    vectors = start_vectors(guess, begin, kind, guess.kappa)
    found = solve_extended(guess, NullVectorEquation(kind), vectors, begin)
    kappa = found.kappa if kind is Kind.FREE else 0.0
    return Singular(found.state, found.vectors, kappa, found.residual, found.iterations)


def start_vectors(guess: Guess, state: BalanceState, kind: Kind, kappa: float) -> NullVectors:
    """Null vectors to begin with: those of the guess, or the singular vectors of the operator there."""
    if guess.vectors is None:
        return null_vectors(state, kind, kappa)
    return guess.vectors.resized(guess.balance.basis, guess.balance.size, kind)


def solve_extended(
    guess: Guess, equation: NullVectorEquation, vectors: NullVectors, begin: BalanceState, iterations: int = 12
) -> Solved:
    """Newton's method on `[R; equation]`, from a guess and its null vectors.

    Raises
    ------
    ConvergenceError
        If it leaves the neighbourhood of the guess or does not converge. An iteration that stands still with a residual
        that rounding of its unknowns explains has converged.
    """
    x, parameter, free = guess.x.ravel().copy(), guess.parameter, guess.kappa
    phi, left = vectors.right, vectors.left
    state, tangent, steepest = begin, None, 0.0
    lengths: list[float] = []
    for iteration in range(iterations + 1):
        check_time()
        if iteration > 0:
            omega, values = at_values(guess.values, guess.name, parameter, guess.omega)
            if omega <= 0.0:
                raise ConvergenceError("omega left the positive axis")
            state = guess.balance.at(x, omega, values)
        blocks = _Blocks(state, equation, guess, equation.kappa(state, free), phi, left, tangent)
        value = blocks.matrix @ phi / state.omega**2
        error = max(blocks.residual, equation.missed(value), abs(blocks.amount))
        if not np.isfinite(error):
            raise ConvergenceError("the extended system is not finite")
        last = lengths[-1] if lengths else np.inf
        settled = last <= _STEP or (last <= 1e-5 and error <= 1e-3 * _TOLERANCE)
        # right behind a grazing the last digit of an unknown is more than tolerated
        tolerance = max(_TOLERANCE, np.finfo(float).eps * steepest if last <= _STEP else 0.0)
        if settled and error <= tolerance:
            found = NullVectors(phi / np.linalg.norm(phi), blocks.left())
            return Solved(state, found, blocks.kappa, error, float(np.linalg.norm(value)), (*lengths,))
        if iteration == iterations:
            break
        step = blocks.step(value)
        if not np.isfinite(step.length):
            raise ConvergenceError("the extended system is singular")
        if iteration > 0 and step.length > _AWAY:
            raise ConvergenceError("the extended system leads away from its start")
        if iteration > 3 and step.length > 0.5 * last and last > 1e-6:
            raise ConvergenceError("the extended system does not contract")
        damp = min(1.0, 0.5 / step.length) if step.length > 0.0 else 1.0
        x += damp * blocks.direction(step.way).x.ravel()
        parameter += damp * step.way[-1] * guess.span
        phi = phi + damp * step.turn
        free += damp * step.kappa
        left, tangent, steepest = blocks.left(), step.tangent, step.steepest
        lengths.append(step.length)
    raise ConvergenceError(f"the extended system did not converge (residual {error:.1e})")


@dataclass(frozen=True)
class _Step:
    """A Newton step: way along the curve, changes of phi and kappa; tangent, how steep J phi is along it; length."""

    way: Array
    turn: np.ndarray
    kappa: float
    tangent: Array
    steepest: float
    length: float


class _Blocks:
    """The two small blocks at one iterate, in weighted and dimensionless unknowns, bordered and factorised when needed.

    Ways along the curve are (dimension + 1,) in units of the motion and of the parameter's range.
    """

    def __init__(
        self,
        state: BalanceState,
        equation: NullVectorEquation,
        guess: Guess,
        kappa: float,
        phi: np.ndarray,
        left: np.ndarray,
        tangent: Array | None,
    ) -> None:
        self.state, self.equation, self.guess, self.kappa = state, equation, guess, kappa
        self.phi, self._border, self._tangent = phi, left, tangent
        self.matrix, self.scale = weighted_operator(state, equation.kind, kappa)
        self.row, self.amount = equation.normalisation(phi)
        self.rows = residual_scale(state)
        self.unit = max(motion_size(state), _NOTHING)
        self.residual = float(np.linalg.norm(state.residual * self.rows)) / max(state.force_scale(), _NOTHING)
        #: the size of an equation of motion
        self._force = self.unit * state.omega**2

    @lazy
    def _column(self) -> tuple[Array, float]:
        """R differentiated by the parameter, of unit length, and its length."""
        column = self.state.residual_by(self.guess.name) * self.rows * self.guess.span / self._force
        size = float(np.linalg.norm(column)) or 1.0
        return column / size, size

    @lazy
    def _curve(self) -> Factor:
        """`[R_X R_p]`, completed by phi at a limit point, by the last tangent elsewhere."""
        column, size = self._column
        jacobian = self.state.jacobian * np.multiply.outer(self.rows, self.rows) / self.state.omega**2
        n = len(jacobian)
        matrix = np.zeros((n + 1, n + 1), order="F")
        matrix[:n, :n], matrix[:n, n] = jacobian, column
        if self.equation.kind is Kind.INTEGER:
            matrix[n, :n] = self.phi
        elif self._tangent is None:
            matrix[n, n] = 1.0
        else:
            matrix[n] = self._tangent
            matrix[n, n] /= size
        return _factor(matrix)

    @lazy
    def _operator(self) -> Factor:
        """`[J b; row 0]`; at a limit point the same as `[R_X R_p; phi 0]`."""
        if self.equation.kind is Kind.INTEGER:
            return self._curve
        m = len(self.matrix)
        matrix = np.zeros((m + 1, m + 1), dtype=self.matrix.dtype, order="F")
        matrix[:m, :m] = self.matrix / self.state.omega**2
        matrix[:m, m], matrix[m, :m] = self._border, self.row
        return _factor(matrix)

    def step(self, value: np.ndarray) -> _Step:
        """The Newton step; `value` is J phi in units of omega^2."""
        state, equation = self.state, self.equation
        d, t = self._along_curve()
        directions = [self.direction(d), self.direction(t)]
        shifts = [equation.shift(a.omega, state.basis.nu) for a in directions]
        if equation.free:
            directions.append(Direction(np.zeros_like(state.x)))
            shifts.append(1.0)
        changes = operator_along(state, equation.kind, self.phi * self.scale, directions, self.kappa, shifts)
        m = len(self.matrix)
        rhs = np.zeros((m + 1, len(directions)), dtype=self.matrix.dtype, order="F")
        rhs[:m] = -changes * self.scale[:, None] / state.omega**2
        steepest = float(np.linalg.norm(rhs[:m, 1]))
        rhs[:m, 0] -= value
        rhs[m, 0] = self.amount
        solved = self._operator.solve(rhs)
        share = equation.combination(solved[m])
        way, turn = d + share[0] * t, solved[:m, 0] + solved[:m, 1:] @ share
        kappa = float(share[1]) if equation.free else 0.0
        length = math.sqrt(way @ way + np.vdot(turn, turn).real + (kappa / state.rate) ** 2)
        return _Step(way, turn, kappa, t, steepest, length)

    def _along_curve(self) -> tuple[Array, Array]:
        """What solves `R + R' d = 0`, and the tangent of R = 0, of unit length."""
        n = self.state.balance.dimension
        rhs = np.zeros((n + 1, 2), order="F")
        rhs[:n, 0] = -self.state.residual * self.rows / self._force
        rhs[n, 1] = 1.0
        found = self._curve.solve(rhs)
        found[n] /= self._column[1]
        length = float(np.linalg.norm(found[:, 1]))
        if not math.isfinite(length) or length == 0.0:
            raise ConvergenceError("the curve has no tangent here")
        return found[:, 0], found[:, 1] / length

    def direction(self, way: Array) -> Direction:
        """A way along the curve as changes of coefficients and of the free parameter."""
        x = (way[:-1] * self.rows * self.unit).reshape(self.state.x.shape)
        return Direction(x, {self.guess.name: float(way[-1]) * self.guess.span})

    def left(self) -> np.ndarray:
        """The left counterpart of phi, of unit length."""
        m = len(self.matrix)
        unit = np.zeros(m + 1, dtype=self.matrix.dtype)
        unit[m] = 1.0
        found = self._operator.solve(unit, adjoint=True)[:m]
        return found / np.linalg.norm(found)


def _factor(matrix: np.ndarray) -> Factor:
    factor = Factor.of(matrix, overwrite=True)
    if factor.singular:
        raise ConvergenceError("the extended system is singular")
    return factor
