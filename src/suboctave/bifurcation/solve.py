"""Newton's method on the minimally augmented systems, for one free parameter: a bifurcation located to rounding.

The bordering vectors are renewed at every iteration. Unknowns are weighted as in the continuation, so that
convergence means the same in any units.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from suboctave.bifurcation.bordered import Bordered, NullVectors, at_values, bordered, null_vectors, residual_scale
from suboctave.bifurcation.located import AWAY, OFF_AXIS, OTHER, SOLVED, STILL, UNSOLVED, located, located_parts
from suboctave.compiled import at_hand, ready
from suboctave.continuation import kernels
from suboctave.continuation.linear import Factor, length
from suboctave.errors import ConvergenceError
from suboctave.harmonic import real_form
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.basis import Array
from suboctave.harmonic.linear_part import StructuralMatrices
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.selection import motion_size
from suboctave.harmonic.state import BalanceState
from suboctave.interruption import check_time
from suboctave.lazy import lazy
from suboctave.stability import FloquetResult, floquet_multipliers

_TOLERANCE = 1e-10
_STEP = 1e-9
#: size of motion and forces at rest: products of it with others neither overflow nor vanish
NOTHING = 1e-100
#: share of the motions in the neighbourhood below which a motion, and the forces on it, count as no smaller
_SHRUNK = 0.01
#: step below which the matrix is not computed anew
_SHORT = 1e-4
#: step, in units of the motion and of the parameter's range, that leads to no bifurcation of this neighbourhood
_AWAY = 4.0
_ITERATIONS = 10
_LIMITS = np.array((_TOLERANCE, _STEP, _SHORT, _AWAY))
_ENDS = {
    OFF_AXIS: "omega left the positive axis",
    AWAY: "the bordered system leads away from its start",
    STILL: "the bordered system does not contract",
    UNSOLVED: "the bordered system did not converge (residual {:.1e})",
}


@dataclass(frozen=True)
class Guess:
    """Where to start: equations, coefficients (2 H + 1, size), omega, values, name and range of the free parameter,
    kappa; null vectors of the operator nearby, where they are known (with any number of harmonics); size of the motions
    in the neighbourhood, where it may pass rest.
    """

    balance: HarmonicBalance
    x: Array
    omega: float
    values: Mapping[str, float]
    name: str
    span: float
    kappa: float = 0.0
    vectors: NullVectors | None = None
    size: float = 0.0

    def state(self) -> BalanceState:
        """The equations at the guess."""
        return self.balance.at(self.x, self.omega, self.values)

    @property
    def parameter(self) -> float:
        """Value of the free parameter."""
        return self.omega if self.name == "omega" else self.values[self.name]


@dataclass(frozen=True)
class Singular:
    """A located motion: state, null vectors of its singular operator (None if it has none), kappa, and the
    dimensionless residual of the whole system.
    """

    state: BalanceState
    vectors: NullVectors | None
    kappa: float
    residual: float
    iterations: int

    @property
    def balance_residual(self) -> float:
        """Residual of the equations of motion alone, in units of the forces that balance."""
        return min(self.residual, self.state.residual_size() / max(self.state.force_scale(), NOTHING))

    @lazy
    def floquet(self) -> FloquetResult:
        """Its multipliers."""
        return floquet_multipliers(self.state)


#: derivatives of a scalar equation by X, by the free parameter and by the extra unknowns
Slopes = tuple[Array, float, tuple[float, ...]]


@dataclass(frozen=True)
class Extra:
    """One scalar equation beside R = 0, its natural size, and its derivatives, which the last iteration does not ask
    for.
    """

    value: float
    size: float
    slopes: Callable[[], Slopes]

    @classmethod
    def of(cls, value: float, x: Array, parameter: float, unknowns: tuple[float, ...], size: float) -> Extra:
        """An equation whose derivatives are known."""
        return cls(value, size, lambda: (x, parameter, unknowns))


#: An augmentation evaluates at a state with extra unknowns and gives the equations, what to add to R, and its columns.
Augmentation = Callable[[BalanceState, Array], tuple[list[Extra], Array | None, list[Array]]]


def newton(
    guess: Guess,
    unknowns: Array,
    spans: Array,
    augmentation: Augmentation,
    iterations: int = _ITERATIONS,
    start: BalanceState | None = None,
) -> tuple[BalanceState, Array, float, int]:
    """Solve `[R + columns . unknowns; extras] = 0` in (X, parameter, unknowns).

    Parameters
    ----------
    unknowns, spans
        Start and natural size of the extra unknowns, shape (q,); one more equation than unknowns is needed.
    start
        The equations at the guess, where they have been evaluated.

    Returns
    -------
    State, unknowns, dimensionless residual, iterations.

    Raises
    ------
    ConvergenceError
        If the iteration leaves the neighbourhood of the guess or does not converge. An iteration that stands still with
        a residual that rounding of its unknowns explains has converged.
    """
    balance, n = guess.balance, guess.balance.dimension
    x, parameter, extra = balance.packed(guess.x).copy(), guess.parameter, unknowns.astype(float).copy()
    weight = balance.column_weights
    state = guess.state() if start is None else start
    rows = residual_scale(state)
    # a motion that shrinks to rest keeps the scales of its neighbourhood
    least = _SHRUNK * guess.size, _SHRUNK * guess.size * guess.omega**2
    previous, contraction = np.inf, 0.0
    nearest: tuple[BalanceState, Array, float, int] | None = None
    linear: tuple[Factor, Array, Array, list[float], float] | None = None
    for iteration in range(iterations + 1):
        check_time()
        omega, values = at_values(guess.values, guess.name, parameter, guess.omega)
        if omega <= 0.0:
            raise ConvergenceError(_ENDS[OFF_AXIS])
        if iteration > 0:
            state = balance.at(x, omega, values)
        equations, addition, columns = augmentation(state, extra)
        if not all(e.size > 0.0 for e in equations):
            raise ConvergenceError("nothing moves here")
        residual = state.residual if addition is None else state.residual + addition
        force = max(state.force_scale(), least[1], NOTHING)
        error = length(residual * rows) / force
        error = max([error] + [abs(e.value) / e.size for e in equations])
        if not math.isfinite(error):
            raise ConvergenceError("the bordered system is not finite")
        settled = previous <= _STEP or (previous <= 1e-5 and error <= 1e-3 * _TOLERANCE)
        if error <= _TOLERANCE and settled:
            return state, extra, error, iteration
        if iteration == iterations:
            break
        # after a short step that contracts, the old factors take the next one as far
        if linear is None or previous > _SHORT or contraction > 0.03:
            linear = _linearised(state, guess, equations, columns, spans, weight, rows, force, least[0])
        factor, scale_x, scale_rows, sizes, steepest = linear
        # right behind a grazing the equations are so steep that the last digit of an unknown is more than tolerated
        if previous <= _STEP and error <= np.finfo(float).eps * steepest and (nearest is None or error < nearest[2]):
            nearest = state, extra.copy(), error, iteration
        rhs = np.empty(n + 1 + len(extra))
        rhs[:n] = residual * scale_rows
        rhs[n:] = [e.value / e_size for e, e_size in zip(equations, sizes, strict=True)]
        step = factor.solve(rhs)
        moved = length(step)
        contraction = moved / previous
        if not math.isfinite(moved):
            raise ConvergenceError("the bordered system is singular")
        if iteration > 0 and moved > _AWAY:
            raise ConvergenceError(_ENDS[AWAY])
        if iteration > 3 and moved > 0.5 * previous and previous > 1e-6:
            raise ConvergenceError(_ENDS[STILL])
        damp = min(1.0, 0.5 / moved) if moved > 0.0 else 1.0
        x -= damp * step[:n] * scale_x
        parameter -= damp * step[n] * guess.span
        extra -= damp * step[n + 1 :] * spans
        if moved <= 1e-12 and error <= _TOLERANCE:
            return state, extra, error, iteration
        previous = moved
    if nearest is not None:
        return nearest
    raise ConvergenceError(_ENDS[UNSOLVED].format(error))


def _linearised(
    state: BalanceState,
    guess: Guess,
    equations: list[Extra],
    columns: list[Array],
    spans: Array,
    weight: Array,
    rows: Array,
    force: float,
    least: float,
) -> tuple[Factor, Array, Array, list[float], float]:
    """The factorised matrix of the augmented system in dimensionless unknowns and equations, the units of the
    coefficients, the factors of the residual's entries, the sizes of the other equations, and by how much the
    steepest equation changes at most with its unknowns.
    """
    n, q = len(rows), len(spans)
    scale_x = max(motion_size(state), least, NOTHING) / weight
    scale_rows = rows / force
    along = state.extended_jacobian(guess.name)
    packed = kernels.scaled_transposed(along, scale_rows, np.append(scale_x, guess.span), 1 + q)[:-1]
    matrix = packed.T
    for j, column in enumerate(columns):
        matrix[:n, n + 1 + j] = column * scale_rows * spans[j]
    for i, e in enumerate(equations):
        by_x, by_parameter, by_unknowns = e.slopes()
        matrix[n + i, :n] = by_x * scale_x / e.size
        matrix[n + i, n] = by_parameter * guess.span / e.size
        for j, value in enumerate(by_unknowns):
            matrix[n + i, n + 1 + j] = value * spans[j] / e.size
    steepest = float(kernels.longest_column(packed))
    factor = Factor.of(matrix, overwrite=True)
    if factor.singular:
        raise ConvergenceError("the bordered system is singular")
    return factor, scale_x, scale_rows, [e.size for e in equations], steepest


def locate_singular(guess: Guess, kind: Kind) -> Singular:
    """Locate a motion at which J_kappa is singular, kappa = 0, w0/2, or free (starting from `guess.kappa`).

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge from the guess.
    """
    check_time()
    begin = guess.state()
    found = _at_once(guess, kind, begin)
    if found is not None:
        return found
    if guess.vectors is None:
        borders = null_vectors(begin, kind, guess.kappa)
    else:
        borders = guess.vectors.resized(guess.balance.basis, guess.balance.size, kind)
    last: list[Bordered] = []

    def augmentation(state: BalanceState, extra: Array) -> tuple[list[Extra], Array | None, list[Array]]:
        nonlocal borders
        kappa = float(extra[0]) if kind is Kind.FREE else 0.0
        b = bordered(state, kind, borders, kappa)
        borders = b.vectors
        last[:] = [b]
        size = state.omega**2
        gradient = cache(lambda: b.gradient((guess.name,)))

        def real() -> Slopes:
            gx, rates, g_kappa = gradient()
            return gx.real, rates[guess.name].real, (g_kappa.real,) if kind is Kind.FREE else ()

        def imaginary() -> Slopes:
            gx, rates, g_kappa = gradient()
            return gx.imag, rates[guess.name].imag, (g_kappa.imag,)

        if kind is not Kind.FREE:
            return [Extra(b.g.real, size, real)], None, []
        equations = [Extra(b.g.real, size, real), Extra(b.g.imag, size, imaginary)]
        return equations, None, [np.zeros(guess.balance.dimension)]

    start = np.array([guess.kappa]) if kind is Kind.FREE else np.zeros(0)
    spans = np.full(len(start), guess.omega / guess.balance.basis.nu)
    state, extra, residual, iterations = newton(guess, start, spans, augmentation, start=begin)
    kappa = float(extra[0]) if kind is Kind.FREE else 0.0
    return Singular(state, last[0].vectors, kappa, residual, iterations)


@dataclass
class AtOnce:
    """The equations of a guess as compiled searches want them, where these apply: see `located.located`.

    structure, forces, filled: their arguments from `nu`, `starts` and `blocks` on; called: what is compiled before.
    """

    begin: BalanceState
    structure: tuple[Any, ...]
    forces: tuple[Any, ...]
    filled: tuple[Any, ...]
    called: tuple[Callable[..., Any], ...]

    @classmethod
    def of(cls, guess: Guess, begin: BalanceState) -> AtOnce | None:
        """From a guess and the equations there: along omega, of a structure's own matrices, laws in closed form."""
        balance, basis, linear, values = guess.balance, guess.balance.basis, begin.linear, begin.values
        plain = guess.name == "omega" and balance.steady and basis.kept is None
        if not plain or not isinstance(linear, StructuralMatrices):
            return None
        packed, nodes = balance.packed_laws(values)
        called = real_form.closed_parts(packed)
        if called is None:
            return None
        high, size, groups = basis.harmonics, balance.size, len(balance.groups)
        blocks, parts = np.empty((high + 1, size, size), dtype=complex), np.empty((3, 2 * high + 1, size))
        table = np.empty((3, groups, balance.top + 1), dtype=complex)
        motions, sizes, numbers = np.empty((groups, high + 1), dtype=complex), np.empty(4), np.empty(2)
        laws, steps = real_form.closed_laws(balance, packed, nodes)
        return cls(
            begin,
            (basis.nu, balance.moving, basis.multiples, basis.half_multiples, linear.matrices),
            (*laws, balance.load(values, 1.0), balance.scales()[1], *steps),
            (blocks, table, motions, parts, sizes, numbers),
            (*called, *located_parts(packed)),
        )

    def search(self, kernel: Callable[..., Any], guess: Guess, *asked: Any) -> tuple[BalanceState, float, int] | None:
        """State, residual and iterations of a search, `asked` its arguments before the span of omega, u first; None
        where it does not go.

        Raises
        ------
        ConvergenceError
            As `newton`.
        """
        least = np.array([max(_SHRUNK * guess.size * unit, NOTHING) for unit in (1.0, guess.omega**2)])
        limits = (float(guess.span), least, _LIMITS, _ITERATIONS)
        given = (*asked, *limits, *self.structure, *self.forces, *self.filled)
        # what it calls is compiled one by one, not all at one go
        if not (at_hand(kernel, *given) or all(map(ready, self.called))):
            return None
        ended = kernel(*given)
        if ended == OTHER:
            return None
        blocks, table, motions, parts, sizes, numbers = self.filled
        error, iterations = numbers.tolist()
        if ended != SOLVED:
            raise ConvergenceError(_ENDS[ended].format(error))
        balance, u = guess.balance, asked[0]
        x = u[: balance.dimension].reshape(balance.basis.size, balance.size)
        state = BalanceState(balance, self.begin.linear, x, float(u[balance.dimension]), self.begin.values)
        state.__dict__.update(_evaluated=(table, parts, sizes), motions=motions, blocks=blocks, nodal=[])
        return state, error, int(iterations)


def _at_once(guess: Guess, kind: Kind, begin: BalanceState) -> Singular | None:
    """`locate_singular` in one compiled call; None where that does not go."""
    equations = None if kind is Kind.FREE else AtOnce.of(guess, begin)
    if equations is None:
        return None
    balance, mean = guess.balance, kind is Kind.INTEGER
    rows = balance.dimension if mean else balance.dimension + balance.size
    near = None if guess.vectors is None else guess.vectors.resized(balance.basis, balance.size, kind)
    # both are filled with those at the solution
    right, left = (np.empty(rows), np.empty(rows)) if near is None else (near.right.copy(), near.left.copy())
    u = np.append(begin.unknowns, guess.omega)
    found = equations.search(located, guess, u, mean, near is not None, right, left)
    return None if found is None else Singular(found[0], NullVectors(right, left), 0.0, *found[1:])
