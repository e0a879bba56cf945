"""The period-doubling system of Alcorta, Baguet, Prabel, Piteau, Jacquet-Richardet (Nonlinear Dynamics 98, 2019).

A perturbation `exp(lambda t) phi(t)`, lambda = i w0/2, phi of the motion's own period and harmonics (their Eq. 13-18):

    R = 0,    N phi = 0,    q . phi_I = b,    N = R_X + lambda D1 + lambda^2 D2,    phi = phi_R + i phi_I,
    D1 = 2 omega (D kron M) + I kron C + T(f_v),    D2 = I kron M.

N is J_kappa at kappa = w0/2, written in sines and cosines with complex coefficients: so it is computed here, which
serves condensed structures and motions of several periods as well. In real numbers, for (phi_R, phi_I),

    B = [ Re N  -Im N ]        det B = |det N|^2.
        [ Im N   Re N ]

As it stands the system cannot be solved by Newton's method. The frequencies of N, -H + 1/2 .. H + 1/2, are not closed
under conjugation: det N is complex and, at real omega, comes near zero but for the harmonics left out does not reach
it. And where phi solves it so does `exp(i theta) phi`, of which the normalisation fixes one real number of two: the
Jacobian (Eq. 20) is singular to the same accuracy, whatever q, and exactly where |det N| is least. Its steps never
become small.

Here it is completed by the missing phase, `q . phi_R = 0`. That is one equation more than unknowns; R = 0 and the
normalisation are kept exactly, and N phi = 0 in the sense of least squares: with the bordered scalar g of N, zero where
N is singular, the step along the curve makes |g| least. Newton's method then converges as fast as it should, to where
|g| is smallest, which differs from the zero of det J_half by what the harmonics left out make. The same elimination
as in `extended` takes the steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bordered import null_vectors
from suboctave.continuation.linear import Factor
from suboctave.curves.events.extended import NullVectorEquation, Solved, solve_extended
from suboctave.curves.events.locate import Guess, Singular, locate_singular
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.derivatives import Direction
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, operator, operator_along
from suboctave.harmonic.truncation import motion_size

#: way, in units of the motion and of the parameter's range, from a solution to where J_half must be singular
_BESIDE = 0.05


@dataclass(frozen=True)
class PublishedDoubling:
    """A solution of the completed system.

    solved
        Where, with steps and residuals; `solved.defect` is |N phi| in units of omega^2, which no motion makes zero.
    phi
        phi_R + i phi_I in the basis of the motion, (dimension,).
    q, b
        Of the normalisation `q . phi = i b`, |q| = 1.
    """

    solved: Solved
    phi: ComplexArray
    q: Array
    b: float


class _HalfFrequency(NullVectorEquation):
    """`N phi = 0` in the sense of least squares, with `row . phi = i b`."""

    def __init__(self, row: ComplexArray, b: float) -> None:
        super().__init__(Kind.FREE)
        self.free = False
        self.row, self.b = row, b

    def kappa(self, state: BalanceState, free: float) -> float:
        """Half the base frequency."""
        return 0.5 * state.rate

    def shift(self, omega: float, nu: int) -> float:
        """kappa follows omega."""
        return 0.5 * omega / nu

    def normalisation(self, phi: np.ndarray) -> tuple[np.ndarray, complex]:
        """See `NullVectorEquation.normalisation`."""
        return self.row, 1j * self.b - complex(self.row @ phi)

    def combination(self, g: np.ndarray) -> Array:
        """The way along the tangent that makes `|g_0 + s g_1|` least."""
        slope = abs(g[1]) ** 2
        if slope == 0.0:
            raise ConvergenceError("the system does not tell where on the curve to look")
        return np.array([-(g[1].conjugate() * g[0]).real / slope])

    def missed(self, value: np.ndarray) -> float:
        """Nothing: what is left of N phi is orthogonal to what a step can change, and steps tell when that is so."""
        return 0.0


def locate_published(guess: Guess) -> PublishedDoubling:
    """Solve the completed system from a guess.

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge from the guess.
    """
    begin = guess.state()
    size, scale = begin.balance.size, begin.balance.scales()[1]
    vectors = null_vectors(begin, Kind.FREE, 0.5 * begin.rate)
    waves = vectors.right.reshape(-1, size)
    phi = _to_basis(waves)
    # turned such that phi_R and phi_I are orthogonal, phi_I the longer: q along it leaves room for the phase
    square = complex((phi**2).sum())
    turn = np.sqrt(-abs(square) / square) if square != 0.0 else 1.0
    length = float(np.linalg.norm(phi))
    phi, waves = phi * turn / length, waves * turn / length
    b = float(np.linalg.norm(phi.imag))
    q = phi.imag / b
    equation = _HalfFrequency(_functional(q).ravel(), b)
    start = type(vectors)(waves.ravel(), vectors.left)
    solved = solve_extended(guess, equation, start, begin)
    # the solver's vectors have unit length: back to the normalisation, and to the units of the DOFs
    waves = solved.vectors.right
    waves = waves * (1j * b / complex(equation.row @ waves))
    phi = _to_basis(waves.reshape(-1, size) * scale).ravel()
    q = (q / scale).ravel()
    units = float(np.linalg.norm(q))
    return PublishedDoubling(solved, phi, q / units, b / units)


def locate_doubling(guess: Guess) -> Singular:
    """A period doubling by the completed system, with the null vectors of J_half there.

    `residual` is that of the whole system, |N phi| in units of omega^2 included: as large as the harmonics left out.

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge, or to a place where J_half is not singular: |g| may be least as well where
        multipliers only come near -1.
    """
    found = locate_published(guess).solved
    state = found.state
    beside = replace(guess, x=state.x, omega=state.omega, values=state.values, vectors=null_vectors(state, Kind.HALF))
    try:
        confirmed = locate_singular(beside, Kind.HALF)
    except ConvergenceError as failure:
        raise ConvergenceError(f"no period doubling where the system is nearly solved: {failure}") from None
    scale = state.balance.scales()[0] / max(motion_size(state), np.finfo(float).tiny)
    away = float(np.linalg.norm((confirmed.state.x - state.x) * scale))
    moved = replace(beside, omega=confirmed.state.omega, values=confirmed.state.values).parameter - beside.parameter
    if max(away, abs(moved) / guess.span) > _BESIDE:
        raise ConvergenceError("no period doubling where the system is nearly solved: J_half is singular elsewhere")
    residual = max(found.residual, found.defect)
    return Singular(state, confirmed.vectors, 0.0, residual, found.iterations)


def log_determinant(state: BalanceState) -> float:
    """Natural logarithm of det B, up to a constant of the basis."""
    return 2.0 * Factor.of(operator(state, Kind.FREE, 0.5 * state.rate)).log_determinant


def published_operator(state: BalanceState) -> ComplexArray:
    """N in sines and cosines, complex, (dimension, dimension)."""
    size, rows = state.balance.size, state.basis.size
    blocks = operator(state, Kind.FREE, 0.5 * state.rate).reshape(rows, size, rows, size)
    columns = np.moveaxis(_functional(np.moveaxis(blocks, 2, 0), column=True), 0, 2)
    matrix: ComplexArray = _to_basis(columns).reshape(rows * size, rows * size)
    return matrix


def equations(state: BalanceState, phi: ComplexArray, q: Array, b: float) -> Array:
    """Eq. 18: `[R; Re N phi; Im N phi; q . phi_I - b]`, (3 dimension + 1,)."""
    value = published_operator(state) @ phi
    return np.concatenate((state.residual, value.real, value.imag, [float(q @ phi.imag) - b]))


def jacobian(state: BalanceState, phi: ComplexArray, q: Array, name: str = "omega") -> Array:
    """Eq. 20: derivatives of `equations` by (X, phi_R, phi_I, omega or a parameter), square of 3 dimension + 1 rows.

    Singular at a solution, to the accuracy that the harmonics allow.
    """
    n, size, nu = state.balance.dimension, state.balance.size, state.basis.nu
    matrix = published_operator(state)
    units = np.eye(n).reshape(n, state.basis.size, size)
    directions = [Direction(unit) for unit in units] + [Direction(np.zeros_like(state.x), {name: 1.0})]
    shifts = [0.5 * a.omega / nu for a in directions]
    waves = _to_waves(phi.reshape(-1, size)).ravel()
    changes = operator_along(state, Kind.FREE, waves, directions, 0.5 * state.rate, shifts)
    by = _to_basis(changes.reshape(-1, size, n + 1)).reshape(n, n + 1)
    out = np.zeros((3 * n + 1, 3 * n + 1))
    out[:n, :n], out[:n, -1] = state.jacobian, state.residual_by(name)
    out[n : 2 * n, :n], out[2 * n : 3 * n, :n] = by[:, :n].real, by[:, :n].imag
    out[n : 2 * n, -1], out[2 * n : 3 * n, -1] = by[:, n].real, by[:, n].imag
    out[n : 3 * n, n : 3 * n] = np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
    out[-1, 2 * n : 3 * n] = q
    return out


def _to_basis(waves: np.ndarray) -> ComplexArray:
    """Amplitudes of waves k = -H .. H (2 H + 1, ...) as complex coefficients of 1, cos, sin, ..."""
    high = len(waves) // 2
    ahead, back = waves[high + 1 :], waves[high - 1 :: -1] if high else waves[:0]
    out = np.empty(waves.shape, dtype=complex)
    out[0], out[1::2], out[2::2] = waves[high], ahead + back, 1j * (ahead - back)
    return out


def _to_waves(coefficients: np.ndarray) -> ComplexArray:
    """The inverse of `_to_basis`."""
    high = len(coefficients) // 2
    out = np.empty(coefficients.shape, dtype=complex)
    a, b = coefficients[1::2], coefficients[2::2]
    out[high] = coefficients[0]
    out[high + 1 :], out[high - 1 :: -1] = 0.5 * (a - 1j * b), 0.5 * (a + 1j * b)
    return out


def _functional(rows: np.ndarray, column: bool = False) -> ComplexArray:
    """A linear form of coefficients, first axis, as one of waves; `column`: of waves as one of coefficients."""
    high = len(rows) // 2
    out = np.empty(rows.shape, dtype=complex)
    if column:
        ahead, back = rows[high + 1 :], rows[high - 1 :: -1]
        out[0], out[1::2], out[2::2] = rows[high], 0.5 * (ahead + back), 0.5j * (back - ahead)
        return out
    out[high] = rows[0]
    out[high + 1 :], out[high - 1 :: -1] = rows[1::2] + 1j * rows[2::2], rows[1::2] - 1j * rows[2::2]
    return out
