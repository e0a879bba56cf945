"""A large linear structure as seen from a few directions: its Galerkin projection onto a basis that is grown for them.

Forces act and displacements are read along m directions, the rows of D. The projection onto the columns of V,

    V^T M V y'' + V^T C V y' + V^T K V y = V^T D^T s,    q = D V y,

has the structure's dynamic flexibility `G = D Z^-1 D^T`, `Z = K - Omega^2 M + i Omega C + i S`, up to some frequency
once V holds what the structure answers there. V grows by what is left over: with `R = D^T - Z V y`, the residual at
some frequencies, the columns of `(K + s^2 M)^-1 R` are added, s > 0 a fixed frequency. For Rayleigh damping that is
the block-Krylov basis which matches moments at `i s` (Bai, Applied Numerical Mathematics 43 (2002) 9-44), and any
other damping, or other values of parameters in the matrices, find what they need in the same way. One factorisation
serves all of it; the shift makes it one of a definite matrix for free bodies too. In exact arithmetic the error of G
is `R^T Z^-1 R`, of second order in the residual where the matrices are symmetric, and is estimated by `R^T (K + s^2
M)^-1 R`.

A basis that serves at two values of the parameters that are not far apart serves between them: the error vanishes at
both. So the values are divided into cells, and in each a basis serves that was grown at both ends of it. Which basis
that is depends on the first one, on the cell and on the frequency alone, not on what else was asked for.
"""

from __future__ import annotations

import copy
import math
import weakref
from collections.abc import Callable, Iterable, Mapping
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh

from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.interruption import check_time
from suboctave.lazy import lazy
from suboctave.model.matrices import MatrixCoefficient, sparse_factors
from suboctave.model.modes import terms_of
from suboctave.model.system import System
from suboctave.model.updated import Updated

#: degrees of freedom up to which a structure is taken as it is
COMPLETE = 40
#: error of the flexibility, relative, that a basis is grown for
_TOLERANCE = 1e-11
#: frequencies at which a basis is tested, as shares of the highest
_TESTED = tuple(np.linspace(1.0, 0.0, 17)[:-1].tolist())
#: part of the residual, relative to the largest, that is worth a vector
_WORTH = 1e-6
#: error below which steps without progress, so many, mean that rounding is all that is left
_PROMISING, _PATIENCE = 1e-5, 4
#: change of the flexibility by the last vectors, relative, at this many frequencies, up to which vibrations between the
#: tested ones are known as well
_SETTLED, _COMPARED = 1e-7, 96
#: error of the flexibility, relative, beyond which a projection is refused
_WRONG = 1e-3
#: most vectors of a basis; for how many there is room at first
_MOST, _ROOM = 600, 40
#: distance of two values of every expression in a matrix, relative, up to which what serves at both serves between
_NEAR = 1.0 / 3.0
#: how often a cell of parameters is halved until the expressions at its ends are so near
_HALVINGS = 8


class Projected(NamedTuple):
    """A structure's matrices in a basis.

    matrices
        M, C, K and the structural damping S, (r, r).
    shapes
        The basis V, (n, r); None for the structure's own degrees of freedom.
    seen
        The directions in it, D V, (m, r).
    terms
        `v^T |K| v` of its vectors, (r,), see `modes_of`; None for the structure's own degrees of freedom.
    covers
        Highest frequency it is made for.
    """

    matrices: tuple[MatrixCoefficient, ...]
    shapes: Array | None
    seen: Array
    terms: Array | None
    covers: float


class _Tested(NamedTuple):
    """Expressions in the matrices, the highest frequency, and values of the parameters, where a basis was tested."""

    at: Array
    covers: float
    values: Mapping[str, float]


class Reduction:
    """A structure in a basis that is grown for the directions (m, n) that its unknowns are displacements along, and
    those of other loads, (l, n); larger ones grow from it.

    served: these and others that the motion is read along, (k, n), such as those of the degrees of freedom `observed`;
    scale: a frequency within the range of interest; projected: the structure in the basis. Immutable; made by `of` and
    `covering`: what several ask for is made once, and is what each would have made.
    """

    def __init__(
        self, system: System, directions: Array, loads: Array, served: Array, observed: tuple[int, ...], scale: float
    ) -> None:
        self.system = system
        self.directions = directions
        self.loads = loads
        self.served = served
        self.observed = observed
        self.scale = scale
        self._matrices = system.linear_parts
        self._shapes = np.zeros((system.n, 0))
        self._small: list[Array] = []
        self._solve: Any = None
        #: where the basis was tested
        self._tested: list[_Tested] = []
        #: what this one has grown from, None for a first one; those that have grown from a first one and are in use, by
        #: what they were grown for
        self._first: Reduction | None = None
        self._larger: weakref.WeakValueDictionary[tuple[Any, ...], Reduction] = weakref.WeakValueDictionary()

    @classmethod
    def of(
        cls,
        system: System,
        directions: Array,
        loads: Array,
        served: Array,
        observed: tuple[int, ...],
        scale: float,
        frequency: float,
        values: Mapping[str, float],
    ) -> Reduction:
        """The smallest basis that serves up to a frequency at these values of the parameters."""
        made = cls(system, directions, loads, served, observed, scale)
        if system.n <= COMPLETE:
            return made
        at = made._expressions(values)
        read = (a.tobytes() for a in (directions, loads, served, at))
        key = (*map(id, made._matrices), *read, observed, scale, frequency)
        return _kept(_IN_USE, key, lambda: made._grown_to(frequency, values))

    def _expressions(self, values: Mapping[str, float]) -> Array:
        return np.array([c.value(values) for matrix in self._matrices for c in matrix.coefficients])

    def covering(self, frequency: float, values: Mapping[str, float]) -> Reduction:
        """This one, or one that serves up to a frequency at these values of the parameters."""
        if self.system.n <= COMPLETE or self._serves(frequency, self._expressions(values)):
            return self
        first = self if self._first is None else self._first
        ends = first._cell(values)
        try:
            return first._grown_at(frequency, ends)
        except ConvergenceError:
            if ends == [values]:
                raise
            return first._grown_at(frequency, [values])  # nobody has asked for the ends of the cell

    def serving(self, frequency: float, several: Iterable[Mapping[str, float]]) -> Reduction:
        """One that serves up to a frequency at all of some values of the parameters, as a motion in time needs it."""
        if self.system.n <= COMPLETE:
            return self
        first = self if self._first is None else self._first
        ends: list[Mapping[str, float]] = []
        for values in several:
            ends += [end for end in first._cell(values) if end not in ends]
        return first._grown_at(frequency, ends)

    def _grown_at(self, frequency: float, ends: list[Mapping[str, float]]) -> Reduction:
        """The basis that has grown from this one, a first one, at some values of the parameters."""
        key = frequency, *(self._expressions(values).tobytes() for values in ends)

        def grown() -> Reduction:
            larger = self
            for values in ends:
                if not larger._serves(frequency, self._expressions(values)):
                    larger = larger._grown_to(frequency, values)
            if larger is not self:
                larger._first = self
            return larger

        return _kept(self._larger, key, grown)

    def _known_to(self, at: Array) -> float:
        """Up to which frequency it was tested there, negative where it was not."""
        return max((tested.covers for tested in self._tested if np.array_equal(tested.at, at)), default=-1.0)

    def _serves(self, frequency: float, at: Array) -> bool:
        """Whether it was tested there, or on both sides near by."""
        tested = [one.at for one in self._tested if one.covers >= frequency]
        return any(
            _far(one, other) <= _NEAR and _is_between(at, one, other)
            for one, other in combinations_with_replacement(tested, 2)
        )

    def _cell(self, values: Mapping[str, float]) -> list[Mapping[str, float]]:
        """The ends of the cell of parameters that holds these values, as seen from those of a first basis; the values
        themselves where there is no cell in which expressions in the matrices are near each other.
        """
        own, at = self._tested[0].values, self._expressions(values)
        moved = [name for name, value in values.items() if value not in (own[name], 0.0)]
        share = 1.0 if np.any(at != self._tested[0].at) else 0.0
        for _ in range(_HALVINGS if share else 0):
            low, high = dict(values), dict(values)
            for name in moved:
                low[name], high[name] = _between_powers(values[name], own[name], (1.0 - _NEAR) ** -share)
            share *= 0.5
            try:
                below, above = self._expressions(low), self._expressions(high)
            except InputError:  # an expression is none there
                continue
            if _far(below, above) <= _NEAR and _is_between(at, below, above):
                return [low, high]
        return [values]

    def _grown_to(self, frequency: float, values: Mapping[str, float]) -> Reduction:
        at, larger = self._expressions(values), copy.copy(self)
        for kept in ("projected", "error"):
            vars(larger).pop(kept, None)
        left = larger._grown(frequency, values, self._known_to(at))
        if not left <= _WRONG:
            raise ConvergenceError(
                f"the projection of the structure has an error of {left:.1e} at frequencies up to {frequency:.6g} with "
                f"{larger._shapes.shape[1]} vectors: keep fewer harmonics, or damp the structure more"
            )
        larger._tested = [*self._tested, _Tested(at, frequency, dict(values))]
        return larger

    @lazy
    def projected(self) -> Projected:
        """The structure in the basis, turned to its modes at the values that it was grown at."""
        if self.system.n <= COMPLETE:
            return Projected(self._matrices, None, self.directions, None, math.inf)
        mass, _, stiffness, _ = self._small
        _, modes = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T))
        shapes = self._shapes @ modes
        matrices = tuple(matrix.projected(shapes) for matrix in self._matrices)
        terms = terms_of(shapes, self._matrices[2].sparse_value(self._tested[-1].values))
        covers = max(one.covers for one in self._tested)
        return Projected(matrices, shapes, self.directions @ shapes, terms, covers)

    @lazy
    def error(self) -> float:
        """Of the flexibility at the highest frequency, relative, against a direct solution of the whole structure; 0
        for the structure itself. Known when it is asked for: the solution takes longer than most of the rest.
        """
        shapes, top = self.projected.shapes, self.projected.covers
        if shapes is None:
            return 0.0
        along = np.concatenate((self.directions, self.loads))
        seen = along @ shapes
        values = self._tested[-1].values
        m, c, k, s = (matrix.value(values) for matrix in self.projected.matrices)
        exact = exact_flexibility(self.system, along, top, values)
        off = np.abs(seen @ np.linalg.solve(k - top**2 * m + 1j * (top * c + s), seen.T) - exact)
        size = np.sqrt(np.abs(exact.diagonal()))
        return float((off / np.multiply.outer(size, size)).max())

    # ---------------------------------------------------------------------------------------------------- the basis
    def _grown(self, top: float, values: Mapping[str, float], known_to: float) -> float:
        """Grow the basis until it serves up to `top`; up to `known_to` it does. Returns its error as estimated."""
        basis = _Basis([matrix.sparse_value(values) for matrix in self._matrices], self._shapes)
        if self._solve is None:
            self._solve = factorised(basis.matrices[2] + self.scale**2 * basis.matrices[0]).solve
        if not basis.count:
            basis.add(self._solve(np.ascontiguousarray(self.served.T)))
        # what is between the tested frequencies is known where it served them at other values
        served = any(one.covers >= top for one in self._tested)
        best, since = math.inf, 0
        before: tuple[list[Array], Array] | None = None
        order = [share for share in _TESTED if share * top > known_to]
        while True:
            check_time()
            worst, lacking = -1.0, np.zeros((0, 0))
            for share in order.copy():
                error, answers = self._left_over(share * top, basis)
                if not error <= worst:
                    worst, lacking = error, answers
                if not worst <= _TOLERANCE:
                    # the next basis is tested there first
                    order.remove(share)
                    order.insert(0, share)
                    break
            best, since = (worst, 0) if worst < 0.5 * best or worst > _PROMISING else (best, since + 1)
            here = list(basis.small), (self.served @ basis.shapes).T
            settled = served and before is None and worst <= _TOLERANCE
            if before is not None and (worst <= _TOLERANCE or since >= _PATIENCE):
                last, known = (_flexibilities(small, seen, top) for small, seen in (before, here))
                settled = _change(last, known) <= max(_SETTLED, 3.0 * worst)
            if settled or basis.count >= min(_MOST, self.system.n):
                # without the room beside them
                self._shapes, self._small = basis.shapes.copy(), basis.small
                return worst
            before = here
            basis.add(lacking)

    def _left_over(self, frequency: float, basis: _Basis) -> tuple[float, Array]:
        """The estimated error of the flexibility at a frequency, relative, and what a better basis needs, (n, .)."""
        columns, m, seen = self.served.T, len(self.served), self.served @ basis.shapes
        mass, damping, stiffness, structural = basis.small
        dynamic = stiffness - frequency**2 * mass + 1j * (frequency * damping + structural)
        y = np.linalg.solve(dynamic, seen.T)
        # real and imaginary parts side by side
        motion = basis.shapes @ np.concatenate((y.real, y.imag), axis=1)
        mass, damping, stiffness, structural = (matrix @ motion for matrix in basis.matrices)
        elastic, lossy = stiffness - frequency**2 * mass, frequency * damping + structural
        rest = np.concatenate((columns - elastic[:, :m] + lossy[:, m:], -elastic[:, m:] - lossy[:, :m]), axis=1)
        # these are about as few vectors as there are directions: with proportional damping the same at all frequencies
        lengths = np.linalg.norm(rest, axis=0)
        lengths[lengths == 0.0] = 1.0
        sizes, turn = np.linalg.eigh((rest.T @ rest) / np.multiply.outer(lengths, lengths))
        turn = turn[:, sizes > _WORTH**2 * sizes[-1]]
        answers = self._solve(np.ascontiguousarray(rest @ (turn / lengths[:, None])))
        whole = (rest.T @ answers) @ (turn.T * lengths)
        wrong = whole[:m, :m] - whole[m:, m:] + 1j * (whole[:m, m:] + whole[m:, :m])
        size = np.abs((seen @ y).diagonal())
        return float((np.abs(wrong) / np.sqrt(np.multiply.outer(size, size))).max()), answers


class _Basis:
    """The columns of V, (n, r), orthonormal in the mass, and M V; M, C, K, S of a structure, (n, n), in them: `small`,
    (r, r) each.
    """

    def __init__(self, matrices: list[Any], shapes: Array) -> None:
        self.matrices = matrices
        self.count = shapes.shape[1]
        #: V and M V, with room for as many columns again
        self._room: Array = np.empty((2, 2 * self.count + _ROOM, len(shapes)))
        self._room[:, : self.count] = shapes.T, (matrices[0] @ shapes).T
        self.small: list[Array] = [shapes.T @ (matrix @ shapes) for matrix in matrices]

    @property
    def shapes(self) -> Array:
        """V."""
        return self._room[0, : self.count].T

    def _beside(self, vectors: Array) -> Array:
        """Vectors without what of them is in the basis."""
        return vectors - self.shapes @ (self._room[1, : self.count] @ vectors)

    def add(self, candidates: Array) -> None:
        """Add the span of candidates, (n, .), without what is in the basis already."""
        mass = self.matrices[0]
        candidates = self._beside(self._beside(candidates))
        square = candidates.T @ (mass @ candidates)
        sizes, turn = np.linalg.eigh(0.5 * (square + square.T))
        kept = sizes > _WORTH**2 * sizes[-1]
        # no more than there are degrees of freedom
        kept[: max(0, len(kept) - (len(candidates) - self.count))] = False
        new = candidates @ (turn[:, kept] / np.sqrt(sizes[kept]))
        for _ in range(2):
            new = self._beside(new)
            square = new.T @ (mass @ new)
            new = np.linalg.solve(np.linalg.cholesky(0.5 * (square + square.T)), new.T).T
        new = np.ascontiguousarray(new)
        images = [matrix @ new for matrix in self.matrices]
        for i, matrix in enumerate(self.matrices):
            ahead, behind = self.shapes.T @ images[i], (matrix.T @ new).T @ self.shapes
            self.small[i] = np.block([[self.small[i], ahead], [behind, new.T @ images[i]]])
        first, self.count = self.count, self.count + new.shape[1]
        if self.count > self._room.shape[1]:
            room = np.empty((2, 2 * self.count, len(new)))
            room[:, :first] = self._room[:, :first]
            self._room = room
        self._room[:, first : self.count] = new.T, images[0].T


#: reductions in use
_IN_USE: weakref.WeakValueDictionary[tuple[Any, ...], Reduction] = weakref.WeakValueDictionary()


def _kept(
    known: weakref.WeakValueDictionary[tuple[Any, ...], Reduction],
    key: tuple[Any, ...],
    make: Callable[[], Reduction],
) -> Reduction:
    """What is known by that key, or made now."""
    found = known.get(key)
    if found is None:
        found = known[key] = make()
    return found


def _between_powers(value: float, unit: float, ratio: float) -> tuple[float, float]:
    """The powers of a ratio, times a unit of the same sign, that a value lies between."""
    unit = unit if unit * value > 0.0 else math.copysign(1.0, value)
    power = math.floor(math.log(value / unit) / math.log(ratio))
    return unit * ratio**power, unit * ratio ** (power + 1)


def _is_between(at: Array, one: Array, other: Array) -> bool:
    return bool(np.all((np.minimum(one, other) <= at) & (at <= np.maximum(one, other))))


def _far(one: Array, other: Array) -> float:
    """The largest distance of values of expressions, relative to the larger of two."""
    size = np.maximum(np.abs(one), np.abs(other))
    return float((np.abs(one - other) / np.where(size > 0.0, size, 1.0)).max(initial=0.0))


def _flexibilities(small: list[Array], seen: Array, top: float) -> ComplexArray:
    """Of a projection, M, C, K, S (r, r), along directions in its basis (r, m), at many frequencies, (F, m, m)."""
    mass, damping, stiffness, structural = small
    w = np.linspace(top / _COMPARED, top, _COMPARED)[:, None, None]
    columns = np.broadcast_to(seen.astype(complex), (len(w), *seen.shape))
    return np.asarray(
        seen.T @ np.linalg.solve(stiffness - w**2 * mass + 1j * (w * damping + structural), columns), dtype=complex
    )


def _change(one: ComplexArray, other: ComplexArray) -> float:
    """Largest change of a flexibility, relative to its diagonal."""
    size = np.sqrt(np.abs(np.einsum("fii->fi", other)))
    return float((np.abs(one - other) / (size[:, :, None] * size[:, None, :])).max())


def factorised(matrix: Any) -> Any:
    """What solves the equations of a large sparse matrix, by SuperLU."""
    try:
        if isinstance(matrix, Updated):
            return matrix.factorised(sparse_factors(matrix.sparse))
        return sparse_factors(matrix)
    except RuntimeError as failure:
        raise InputError(f"the stiffness cannot be factorised ({failure}): is a part of the structure empty?") from None


def exact_flexibility(system: System, directions: Array, frequency: float, values: Mapping[str, float]) -> ComplexArray:
    """The dynamic flexibility between directions (m, n) by a direct solution of the whole structure, (m, m)."""
    mass, damping, stiffness, structural = (matrix.sparse_value(values) for matrix in system.linear_parts)
    matrix = stiffness - frequency**2 * mass + 1j * (frequency * damping + structural)
    factors, columns = factorised(matrix), np.ascontiguousarray(directions.T.astype(complex))
    answers = factors.solve(columns)
    # without pivots off the diagonal digits may be lost: once more for what is left over
    answers += factors.solve(columns - matrix @ answers)
    result: ComplexArray = directions @ answers
    return result
