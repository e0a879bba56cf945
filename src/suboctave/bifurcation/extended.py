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

from dataclasses import dataclass

import numpy as np

from suboctave.bifurcation.bordered import NullVectors, at_values, null_vectors, weighted_operator
from suboctave.bifurcation.solve import Guess, Singular
from suboctave.continuation.linear import Factor
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.perturbation_rate import operator_along
from suboctave.harmonic.second import Direction
from suboctave.harmonic.selection import motion_size
from suboctave.harmonic.state import BalanceState

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
    kind, name = equation.kind, guess.name
    x, parameter, free = guess.x.ravel().copy(), guess.parameter, guess.kappa
    phi, left = vectors.right, vectors.left
    state, tangent = begin, None
    lengths: list[float] = []
    for iteration in range(iterations + 1):
        if iteration > 0:
            omega, values = at_values(guess.values, name, parameter, guess.omega)
            if omega <= 0.0:
                raise ConvergenceError("omega left the positive axis")
            state = guess.balance.at(x, omega, values)
        kappa = equation.kappa(state, free)
        row, amount = equation.normalisation(phi)
        blocks = _Blocks(state, kind, name, guess.span, kappa, phi, left, row, tangent)
        d, t = blocks.along_curve()
        tangent = t
        directions = [blocks.direction(d), blocks.direction(t)]
        shifts = [equation.shift(a.omega, state.basis.nu) for a in directions]
        if equation.free:
            directions.append(Direction(np.zeros_like(state.x)))
            shifts.append(1.0)
        changes = operator_along(state, kind, phi * blocks.scale, directions, kappa, shifts)
        changes = changes * blocks.scale[:, None]
        value, size = blocks.matrix @ phi, state.omega**2
        error = max(blocks.residual, equation.missed(value / size), abs(amount))
        if not (np.isfinite(error) and np.isfinite(changes).all()):
            raise ConvergenceError("the extended system is not finite")
        last = lengths[-1] if lengths else np.inf
        settled = last <= _STEP or (last <= 1e-5 and error <= 1e-3 * _TOLERANCE)
        # right behind a grazing the last digit of an unknown is more than tolerated
        rounding = np.finfo(float).eps * float(np.linalg.norm(changes[:, 1])) / size
        if settled and error <= max(_TOLERANCE, rounding if last <= _STEP else 0.0):
            defect = float(np.linalg.norm(value)) / size
            return Solved(
                state, NullVectors(phi / np.linalg.norm(phi), blocks.left()), kappa, error, defect, (*lengths,)
            )
        if iteration == iterations:
            break
        rhs = -changes
        rhs[:, 0] -= value
        solved = blocks.beside(rhs, amount)
        share = equation.combination(solved[-1])
        way = d + share[0] * t
        turn = solved[:-1, 0] + solved[:-1, 1:] @ share
        extra = float(share[1]) if len(share) > 1 else 0.0
        length = float(np.sqrt(way @ way + np.vdot(turn, turn).real + (extra / state.rate) ** 2))
        if not np.isfinite(length):
            raise ConvergenceError("the extended system is singular")
        if iteration > 0 and length > _AWAY:
            raise ConvergenceError("the extended system leads away from its start")
        if iteration > 3 and length > 0.5 * last and last > 1e-6:
            raise ConvergenceError("the extended system does not contract")
        damp = min(1.0, 0.5 / length) if length > 0.0 else 1.0
        x += damp * blocks.direction(way).x.ravel()
        parameter += damp * way[-1] * guess.span
        phi = phi + damp * turn
        free += damp * extra
        left = blocks.left()
        lengths.append(length)
    raise ConvergenceError(f"the extended system did not converge (residual {error:.1e})")


class _Blocks:
    """The two small blocks at one iterate, bordered and factorised, in weighted and dimensionless unknowns.

    Ways along the curve are (dimension + 1,) in units of the motion and of the parameter's range.
    """

    def __init__(
        self,
        state: BalanceState,
        kind: Kind,
        name: str,
        span: float,
        kappa: float,
        phi: np.ndarray,
        left: np.ndarray,
        row: np.ndarray,
        tangent: Array | None,
    ) -> None:
        self.state, self.kind, self.name, self.span = state, kind, name, span
        self.matrix, self.scale = weighted_operator(state, kind, kappa)
        n = state.balance.dimension
        rows = self.scale if kind is Kind.INTEGER else np.tile(state.balance.scales()[1], state.basis.size)
        self.unit = max(motion_size(state), _NOTHING)
        self.rows = rows
        force = max(state.force_scale(), _NOTHING)
        self.residual = float(np.linalg.norm(state.residual * rows)) / force
        #: factors of the unknowns' and of the equations' units
        self._per_row = self.unit * state.omega**2
        column = state.residual_by(name) * rows * span / self._per_row
        self._column_size = float(np.linalg.norm(column)) or 1.0
        first = np.zeros((n + 1, n + 1), order="F")
        if kind is Kind.INTEGER:
            first[:n, :n] = self.matrix / state.omega**2
            first[:n, n] = column / self._column_size
            first[n, :n] = phi
            self._curve = self._operator = _factor(first)
            return
        first[:n, :n] = state.jacobian * np.multiply.outer(rows, rows) / state.omega**2
        first[:n, n] = column / self._column_size
        if tangent is None:
            first[n, n] = 1.0
        else:
            first[n] = tangent
            first[n, n] *= 1.0 / self._column_size
        self._curve = _factor(first)
        m = len(self.matrix)
        second = np.zeros((m + 1, m + 1), dtype=self.matrix.dtype, order="F")
        second[:m, :m] = self.matrix / state.omega**2
        second[:m, m], second[m, :m] = left, row
        self._operator = _factor(second)

    def along_curve(self) -> tuple[Array, Array]:
        """What solves `R + R' d = 0`, and the tangent of R = 0, of unit length."""
        n = self.state.balance.dimension
        rhs = np.zeros((n + 1, 2), order="F")
        rhs[:n, 0] = -self.state.residual * self.rows / self._per_row
        rhs[n, 1] = 1.0
        found = self._curve.solve(rhs)
        found[n] /= self._column_size
        length = float(np.linalg.norm(found[:, 1]))
        if not np.isfinite(length) or length == 0.0:
            raise ConvergenceError("the curve has no tangent here")
        return found[:, 0], found[:, 1] / length

    def direction(self, way: Array) -> Direction:
        """A way along the curve as changes of coefficients and of the free parameter."""
        x = (way[:-1] * self.rows * self.unit).reshape(self.state.x.shape)
        return Direction(x, {self.name: float(way[-1]) * self.span})

    def beside(self, rhs: np.ndarray, amount: complex) -> np.ndarray:
        """dphi with g below it, (rows + 1, columns), for changes of J phi; the first column has the amount besides."""
        m = len(self.matrix)
        whole = np.zeros((m + 1, rhs.shape[1]), dtype=self.matrix.dtype, order="F")
        whole[:m] = rhs / self.state.omega**2
        whole[m, 0] = amount
        return self._operator.solve(whole)

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
