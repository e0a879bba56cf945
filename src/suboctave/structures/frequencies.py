"""Natural frequencies and modes, `K phi = omega^2 M phi`, by Lanczos's method on the shifted inverse.

With a shift sigma below zero, `K - sigma M` is regular for free bodies too, and the eigenvalues nearest to sigma are
the lowest. A first shift is small beside the highest eigenvalue, of which `max K_ii / M_ii` gives the size; with
rigid-body modes a second one is of the size of the first elastic eigenvalue. Small structures are solved densely, by
`M phi = mu (K - sigma M) phi` with `omega^2 = sigma + 1 / mu`: degrees of freedom without inertia have mu = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.errors import ConvergenceError, InputError
from suboctave.model.elements.base import Array
from suboctave.model.matrices import sparse_factors

#: DOFs below which eigenvalues are computed densely
_DENSE = 300
#: first shift, in units of max K_ii / M_ii: far above rounding (1e-16), far below where the lowest modes lie
_SHIFT = 1e-10
#: an eigenvalue below this, in units of phi^T |K| phi, is rounding: a rigid-body mode
_ROUNDING = 1e-13
#: restarts of Lanczos's method; structures take less than ten, modes closer than 1e-6 of their frequency more
_RESTARTS = 60
#: relative change of a matrix that a solution without pivots off the diagonal may be the exact one of
_BACKWARD = 1e-12
#: a shift so far below the first elastic eigenvalue loses digits beside rigid-body modes
_FAR = 1e-3


@dataclass(frozen=True, eq=False)
class NaturalFrequencies:
    """The lowest natural frequencies of the undamped structure, in ascending order.

    omega
        Circular frequencies (count,), radians per unit time. An indefinite stiffness (a buckled structure) has modes
        that grow: their rates stand here with a minus sign.
    modes
        Their shapes (n, count), of unit modal mass, `phi^T M phi = 1`.
    rigid
        How many of them are rigid-body modes, of the frequency zero but for rounding.
    """

    omega: Array
    modes: Array
    rigid: int

    @property
    def hertz(self) -> Array:
        """Frequencies (count,), cycles per unit time."""
        return self.omega / (2.0 * np.pi)

    @property
    def growing(self) -> int:
        """How many of them are no frequencies, but rates of growth; they come first."""
        return int(np.count_nonzero(self.omega < 0))

    def __len__(self) -> int:
        return len(self.omega)

    def __str__(self) -> str:
        lines = ["mode    rad per unit time     Hz (if that is 1 s)"]
        for i, (omega, hertz) in enumerate(zip(self.omega, self.hertz, strict=True)):
            rigid = self.growing <= i < self.growing + self.rigid
            note = "   rigid-body mode" if rigid else "   grows: no frequency" if omega < 0 else ""
            lines.append(f"{i + 1:4} {omega:20.6g} {hertz:20.6g}{note}")
        if self.rigid:
            count = "1 rigid-body mode: nothing holds it" if self.rigid == 1 else f"{self.rigid} rigid-body modes"
            lines.append(f"{count}{'' if self.rigid == 1 else ': nothing holds them'}")
        if self.growing:
            lines.append("the stiffness is not positive: the structure at rest is unstable")
        return "\n".join(lines)

    __repr__ = __str__


def natural_frequencies(mass: Any, stiffness: Any, count: int = 10) -> NaturalFrequencies:
    """The lowest `count` natural frequencies of sparse matrices (n, n), all of them where there are fewer.

    Raises `ConvergenceError` where Lanczos's method does not arrive.
    """
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise InputError(f"count={count!r}: how many natural frequencies, a whole number from 1 on")
    n = mass.shape[0]
    inertia = np.asarray(mass.diagonal())
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.abs(np.asarray(stiffness.diagonal())) / inertia
    highest = np.max(ratios, where=np.isfinite(ratios) & (inertia > 0), initial=0.0)
    shift = -_SHIFT * (highest or 1.0)
    moving = int(np.count_nonzero(inertia > 0))
    count = min(int(count), moving)
    if n < _DENSE or count > n // 3:
        squares, modes = _densely(mass, stiffness, -(highest or 1.0) * 1e-6, count)
    else:
        squares, modes = _by_lanczos(mass, stiffness, shift, count)
        rigid = _rigid(squares, modes, stiffness)
        elastic = squares[~rigid]
        if rigid.any() and len(elastic) and -shift < _FAR * elastic[0]:
            squares, modes = _by_lanczos(mass, stiffness, -elastic[0], count)
    rigid = _rigid(squares, modes, stiffness)
    omega = np.where(rigid, 1.0, np.sign(squares)) * np.sqrt(np.abs(squares))
    order = np.argsort(omega)
    return NaturalFrequencies(omega[order], modes[:, order], int(rigid.sum()))


def _rigid(squares: Array, modes: Array, stiffness: Any) -> np.ndarray:
    """Which of the modes are rigid-body modes."""
    noise = _ROUNDING * np.einsum("ij,ij->j", np.abs(modes), abs(stiffness) @ np.abs(modes))
    return np.abs(squares) <= noise


def _densely(mass: Any, stiffness: Any, shift: float, count: int) -> tuple[Array, Array]:
    import scipy.linalg

    m, k = mass.toarray(), stiffness.toarray()
    try:
        inverse, vectors = scipy.linalg.eigh(m, k - shift * m)
        squares = shift + 1.0 / inverse[::-1][:count]
        vectors = vectors[:, ::-1][:, :count]
    except np.linalg.LinAlgError:  # a stiffness that is not positive: multipliers among the unknowns, or a buckled one
        values, right = scipy.linalg.eig(k, m)
        finite = np.flatnonzero(np.isfinite(values) & (np.abs(values) < 1e30))
        order = finite[np.argsort(values[finite].real)][:count]
        squares, vectors = values[order].real, right[:, order].real
    return _ascending(squares, vectors, mass)


def _by_lanczos(mass: Any, stiffness: Any, shift: float, count: int) -> tuple[Array, Array]:
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    n = mass.shape[0]
    start = np.random.default_rng(1).standard_normal(n)  # the same digits in every run
    size = min(max(3 * count, count + 40), n)
    try:
        inverse = LinearOperator((n, n), _inverse(stiffness - shift * mass, start), dtype=float)
        squares, vectors = eigsh(
            stiffness, k=count, M=mass, sigma=shift, v0=start, ncv=size, maxiter=_RESTARTS, OPinv=inverse
        )
    except (ArpackError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise ConvergenceError(f"the natural frequencies were not found, they may lie too close: {reason}") from None
    return _ascending(squares, vectors, mass)


def _inverse(matrix: Any, sample: Array) -> Callable[[Array], Array]:
    """What solves the equations of a symmetric matrix: with pivots on its diagonal alone where they are good enough, as
    those of a positive stiffness are.
    """
    from scipy.sparse.linalg import splu

    try:
        solve: Callable[[Array], Array] = sparse_factors(matrix).solve
        solution = solve(sample)
        size = float(abs(matrix).sum(axis=1).max()) * np.abs(solution).max()
        if np.abs(matrix @ solution - sample).max() <= _BACKWARD * size:
            return solve
    except RuntimeError:  # a zero on the diagonal
        pass
    pivoted: Callable[[Array], Array] = splu(matrix.tocsc()).solve
    return pivoted


def _ascending(squares: Array, vectors: Array, mass: Any) -> tuple[Array, Array]:
    order = np.argsort(squares)
    vectors = vectors[:, order]
    modal = np.einsum("ij,ij->j", vectors, mass @ vectors)
    return squares[order], vectors / np.sqrt(modal)
