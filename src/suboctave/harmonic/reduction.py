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
"""

from __future__ import annotations

import copy
import math
import weakref
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh

from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.interruption import check_time
from suboctave.model.matrices import MatrixCoefficient, sparse_factors
from suboctave.model.system import System

#: degrees of freedom up to which a structure is taken as it is
COMPLETE = 40
#: error of the flexibility, relative, that a basis is grown for
_TOLERANCE = 1e-11
#: frequencies at which a basis is tested, as shares of the highest, and at how many of them it is grown at once
_TESTED, _AT_ONCE = tuple(np.linspace(1.0, 0.0, 17)[:-1].tolist()), 2
#: part of the residual, relative to the largest, that is worth a vector
_WORTH = 1e-6
#: error below which steps without progress, so many, mean that rounding is all that is left
_PROMISING, _PATIENCE = 1e-5, 4
#: change of the flexibility by the last vectors, relative, at this many frequencies, up to which vibrations between the
#: tested ones are known as well
_SETTLED, _COMPARED = 1e-7, 96
#: error of the flexibility, relative, beyond which a projection is refused
_WRONG = 1e-3
#: most vectors of a basis
_MOST = 600
#: relative change of an expression in a matrix that a basis is trusted over without a test
_TRUSTED = 0.05


class Projected(NamedTuple):
    """A structure's matrices in a basis.

    matrices
        M, C, K and the structural damping S, (r, r).
    shapes
        The basis V, (n, r); None for the structure's own degrees of freedom.
    seen
        The directions in it, D V, (m, r).
    covers
        Highest frequency it is made for.
    error
        Of the flexibility at the highest frequency, relative, against a direct solution of the whole structure; 0 for
        the structure itself.
    """

    matrices: tuple[MatrixCoefficient, ...]
    shapes: Array | None
    seen: Array
    covers: float
    error: float


class Reduction:
    """A structure in a basis that is grown for the directions (m, n) that forces act along; larger ones grow from it.

    served: these and others that the motion is read along, (k, n), such as those of the degrees of freedom `observed`;
    scale: a frequency within the range of interest; projected: the structure in the basis. Made by `of` and `covering`:
    what one curve asks for does not change what others have, and what several ask for is made once.
    """

    projected: Projected

    def __init__(
        self, system: System, directions: Array, served: Array, observed: tuple[int, ...], scale: float
    ) -> None:
        self.system = system
        self.directions = directions
        self.served = served
        self.observed = observed
        self.scale = scale
        self._matrices = system.linear_parts
        self._shapes = np.zeros((system.n, 0))
        self._solve: Any = None
        #: expressions in the matrices and the highest frequency, where the basis was tested
        self._tested: list[tuple[Array, float]] = []
        #: what has grown from it and is in use, by what it was grown for
        self._larger: weakref.WeakValueDictionary[tuple[Any, ...], Reduction] = weakref.WeakValueDictionary()

    @classmethod
    def of(
        cls,
        system: System,
        directions: Array,
        served: Array,
        observed: tuple[int, ...],
        scale: float,
        frequency: float,
        values: Mapping[str, float],
    ) -> Reduction:
        """The smallest basis that serves up to a frequency at these values of the parameters."""
        made = cls(system, directions, served, observed, scale)
        if system.n <= COMPLETE:
            made.projected = Projected(made._matrices, None, directions, math.inf, 0.0)
            return made
        at = made._expressions(values)
        key = (*map(id, made._matrices), *(a.tobytes() for a in (directions, served, at)), observed, scale, frequency)
        return _kept(_IN_USE, key, lambda: made._grown_to(frequency, values, at))

    def _expressions(self, values: Mapping[str, float]) -> Array:
        return np.array([c.value(values) for matrix in self._matrices for c in matrix.coefficients])

    def covering(self, frequency: float, values: Mapping[str, float]) -> Reduction:
        """This one, or one that serves up to a frequency at these values of the parameters."""
        if self.projected.shapes is None:
            return self
        at = self._expressions(values)
        serving = next((one for one in (self, *self._larger.values()) if one._serves(frequency, at)), None)
        return serving or _kept(self._larger, (frequency, at.tobytes()), lambda: self._grown_to(frequency, values, at))

    def _serves(self, frequency: float, at: Array) -> bool:
        """Whether it was tested there, or near by."""
        return any(
            np.all(np.abs(at - tested) <= _TRUSTED * np.abs(tested)) and covers >= frequency
            for tested, covers in self._tested
        )

    def _grown_to(self, frequency: float, values: Mapping[str, float], at: Array) -> Reduction:
        larger = copy.copy(self)
        larger._larger = weakref.WeakValueDictionary()
        known_to = max((covers for tested, covers in self._tested if np.array_equal(tested, at)), default=-1.0)
        larger._grown(frequency, values, known_to)
        larger._tested = [*self._tested, (at, frequency)]
        larger.projected = larger._project(values)
        return larger

    # ---------------------------------------------------------------------------------------------------- the basis
    def _grown(self, top: float, values: Mapping[str, float], known_to: float) -> None:
        """Grow the basis until it serves up to `top`; up to `known_to` it does."""
        images = _Images([matrix.sparse_value(values) for matrix in self._matrices], self._shapes)
        if self._solve is None:
            self._solve = factorised(images.matrices[2] + self.scale**2 * images.matrices[0]).solve
        columns = self.served.T
        if not self._shapes.shape[1]:
            self._add(self._solve(np.ascontiguousarray(columns)), images)
        best, since = math.inf, 0
        order, known = [share for share in _TESTED if share * top > known_to], np.zeros((1, 1, 1), dtype=complex)
        while True:
            check_time()
            worst, left = 0.0, []
            for share in order.copy():
                error, answers = self._left_over(share * top, images)
                if error > worst:
                    # the next basis is tested there first
                    worst = error
                    order.remove(share)
                    order.insert(0, share)
                left.append(answers)
                if worst > _TOLERANCE and len(left) >= _AT_ONCE:
                    break
            best, since = (worst, 0) if worst < 0.5 * best or worst > _PROMISING else (best, since + 1)
            known, last = _flexibilities(images.small, self._shapes.T @ columns, top), known
            settled = (worst <= _TOLERANCE or since >= _PATIENCE) and _change(last, known) <= max(_SETTLED, 3.0 * worst)
            if settled or self._shapes.shape[1] >= min(_MOST, self.system.n):
                return
            self._add(np.concatenate(left, axis=1), images)

    def _left_over(self, frequency: float, images: _Images) -> tuple[float, Array]:
        """The estimated error of the flexibility at a frequency, relative, and what a better basis needs, (n, 2 m)."""
        columns, m = self.served.T, len(self.served)
        mass, damping, stiffness, structural = images.small
        dynamic = stiffness - frequency**2 * mass + 1j * (frequency * damping + structural)
        y = np.linalg.solve(dynamic, self._shapes.T @ columns)
        # real and imaginary parts side by side
        parts = np.concatenate((y.real, y.imag), axis=1)
        mass, damping, stiffness, structural = (whole @ parts for whole in images.whole)
        elastic, lossy = stiffness - frequency**2 * mass, frequency * damping + structural
        rest = np.concatenate((columns - elastic[:, :m] + lossy[:, m:], -elastic[:, m:] - lossy[:, :m]), axis=1)
        answers = self._solve(rest)
        size = np.abs((self.served @ (self._shapes @ y)).diagonal())
        wrong = (rest[:, :m] + 1j * rest[:, m:]).T @ (answers[:, :m] + 1j * answers[:, m:])
        worst = float((np.abs(wrong) / np.sqrt(np.multiply.outer(size, size))).max())
        return worst, answers / np.sqrt(np.tile(size, 2))

    def _add(self, candidates: Array, images: _Images) -> None:
        """Add the span of candidates, orthonormal in the mass, without what is in the basis already."""
        mass, seen = images.matrices[0], images.whole[0]
        for _ in range(2):
            candidates = candidates - self._shapes @ (seen.T @ candidates)
        square = candidates.T @ (mass @ candidates)
        sizes, turn = np.linalg.eigh(0.5 * (square + square.T))
        kept = sizes > _WORTH**2 * sizes[-1]
        # no more than there are degrees of freedom
        kept[: max(0, len(kept) - (self.system.n - self._shapes.shape[1]))] = False
        new = candidates @ (turn[:, kept] / np.sqrt(sizes[kept]))
        for _ in range(2):
            new = new - self._shapes @ (seen.T @ new)
            square = new.T @ (mass @ new)
            new = np.linalg.solve(np.linalg.cholesky(0.5 * (square + square.T)), new.T).T
        self._shapes = images.with_columns(self._shapes, new)

    def _project(self, values: Mapping[str, float]) -> Projected:
        """All matrices in the basis, turned to its modes at these values."""
        mass, _, stiffness, _ = (self._shapes.T @ (m.sparse_value(values) @ self._shapes) for m in self._matrices)
        _, modes = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T))
        shapes = self._shapes @ modes
        matrices = tuple(matrix.projected(shapes) for matrix in self._matrices)
        top = max(covers for _, covers in self._tested)
        seen = self.directions @ shapes
        m, c, k, s = (matrix.value(values) for matrix in matrices)
        exact = exact_flexibility(self.system, self.directions, top, values)
        off = np.abs(seen @ np.linalg.solve(k - top**2 * m + 1j * (top * c + s), seen.T) - exact)
        size = np.sqrt(np.abs(exact.diagonal()))
        error = float((off / np.multiply.outer(size, size)).max())
        if not error <= _WRONG:
            raise ConvergenceError(
                f"the projection of the structure has an error of {error:.1e} at the frequency {top:.6g} with "
                f"{shapes.shape[1]} vectors: keep fewer harmonics, or damp the structure more"
            )
        return Projected(matrices, shapes, seen, top, error)


class _Images:
    """M, C, K, S of a structure, (n, n), along its basis: of the basis (n, r) in `whole`, in it (r, r) in `small`."""

    def __init__(self, matrices: list[Any], shapes: Array) -> None:
        self.matrices = matrices
        self.whole: list[Array] = [matrix @ shapes for matrix in matrices]
        self.small: list[Array] = [shapes.T @ image for image in self.whole]

    def with_columns(self, shapes: Array, new: Array) -> Array:
        """The basis with new columns, and all of this with their images."""
        result = np.concatenate((shapes, new), axis=1)
        for i, matrix in enumerate(self.matrices):
            image = matrix @ new
            self.small[i] = np.block([[self.small[i], shapes.T @ image], [new.T @ self.whole[i], new.T @ image]])
            self.whole[i] = np.concatenate((self.whole[i], image), axis=1)
        return result


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


def _flexibilities(small: list[Array], seen: Array, top: float) -> ComplexArray:
    """Of a projection, M, C, K, S (r, r), along directions in its basis (r, m), at many frequencies, (F, m, m)."""
    mass, damping, stiffness, structural = small
    w = np.linspace(top / _COMPARED, top, _COMPARED)[:, None, None]
    columns = np.broadcast_to(seen.astype(complex), (len(w), *seen.shape))
    return np.asarray(
        seen.T @ np.linalg.solve(stiffness - w**2 * mass + 1j * (w * damping + structural), columns), dtype=complex
    )


def _change(one: ComplexArray, other: ComplexArray) -> float:
    """Largest change of a flexibility, relative to its diagonal; infinite from none."""
    if one.shape != other.shape:
        return math.inf
    size = np.sqrt(np.abs(np.einsum("fii->fi", other)))
    return float((np.abs(one - other) / (size[:, :, None] * size[:, None, :])).max())


def factorised(matrix: Any) -> Any:
    """SuperLU's factors of a large sparse matrix."""
    try:
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
