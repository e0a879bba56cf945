"""Natural frequencies and modes, `K phi = omega^2 M phi`, of matrices as files have them: M may be singular.

Degrees of freedom with neither inertia nor stiffness have no part in it (`without_effect`) and are left out. Others
without inertia follow the rest, `K_bb x_b = -K_ba x_a`; where K_bb is singular what it leaves free are forces of
constraints, `Z^T K_ba x_a = 0` for `K_bb Z = 0`. Inertia without stiffness is a rigid-body motion (`model.modes`).

Small structures are solved densely, large ones by Lanczos's method on the shifted inverse. With a shift sigma below
zero, `K - sigma M` is regular for free bodies too, and the eigenvalues nearest to sigma are the lowest. A first shift
is small beside the highest eigenvalue, of which `max K_ii / M_ii` gives the size; with rigid-body modes a second one is
of the size of the first elastic eigenvalue.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.arguments import checked
from suboctave.errors import ConvergenceError, InputError
from suboctave.model.elements.base import Array
from suboctave.model.matrices import sparse_factors
from suboctave.model.modes import ROUNDING, is_rigid, modes_of, terms_of
from suboctave.structures.dof_map import DofMap, shown_dofs

#: DOFs below which eigenvalues are computed densely
_DENSE = 300
#: first shift, in units of max K_ii / M_ii: far above rounding (1e-16), far below where the lowest modes lie
_SHIFT = 1e-10
#: restarts of Lanczos's method; structures take less than ten, modes closer than 1e-6 of their frequency more
_RESTARTS = 60
#: relative change of a matrix that a solution without pivots off the diagonal may be the exact one of
_BACKWARD = 1e-12
#: a shift so far below the first elastic eigenvalue loses digits beside rigid-body modes
_FAR = 1e-3


@checked(result=True)
@dataclass(frozen=True, eq=False)
class NaturalFrequencies:
    """The lowest natural frequencies of the undamped structure, in ascending order.

    omega
        Circular frequencies (count,), radians per unit time. An indefinite stiffness (a buckled structure) has modes
        that grow: their rates stand here with a minus sign.
    modes
        Their shapes (n, count), of unit modal mass, `phi^T M phi = 1`.
    rigid
        How many of them are rigid-body modes: their frequency is 0.
    left_out
        Degrees of freedom with neither mass nor stiffness, which have no part in it: their rows of `modes` are 0.
    dofs
        What the degrees of freedom are called.
    """

    omega: Array
    modes: Array
    rigid: int
    left_out: tuple[int, ...] = ()
    dofs: DofMap | None = None

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
        if self.left_out:
            lines.append(
                f"left out, as they move with neither mass nor stiffness: {shown_dofs(self.left_out, self.dofs)}"
            )
        return "\n".join(lines)

    __repr__ = __str__


def natural_frequencies(mass: Any, stiffness: Any, count: int = 10, dofs: DofMap | None = None) -> NaturalFrequencies:
    """The lowest `count` natural frequencies of sparse matrices (n, n), all of them where there are fewer.

    Raises `ConvergenceError` where Lanczos's method does not arrive, `InputError` for a negative mass.
    """
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise InputError(f"count={count!r}: how many natural frequencies, a whole number from 1 on")
    n = mass.shape[0]
    left_out = without_effect(mass, stiffness)
    kept = np.setdiff1d(np.arange(n), left_out)
    if len(left_out):
        mass, stiffness = mass[kept][:, kept], stiffness[kept][:, kept]
    moving = int(np.count_nonzero(mass.diagonal() > 0.0))
    count = min(int(count), moving)
    if len(kept) < _DENSE or count > len(kept) // 3:
        squares, modes = _densely(mass.toarray(), stiffness.toarray())
        squares, modes = squares[:count], modes[:, :count]
    else:
        squares, modes = _sparsely(mass, stiffness, count)
    rigid = is_rigid(squares, terms_of(modes, stiffness))
    omega = np.where(rigid, 0.0, np.sign(squares) * np.sqrt(np.abs(squares)))
    order = np.argsort(omega, kind="stable")
    shapes = np.zeros((n, len(omega)))
    shapes[kept] = modes[:, order]
    return NaturalFrequencies(omega[order], shapes, int(rigid.sum()), tuple(left_out.tolist()), dofs)


def without_effect(mass: Any, stiffness: Any) -> np.ndarray:
    """Degrees of freedom, in ascending order, that can be held without any effect: those with neither inertia nor
    stiffness, and of others without inertia as many as there are motions of them that no stiffness resists.
    """
    from scipy.linalg import qr
    from scipy.sparse.csgraph import connected_components

    massless = np.flatnonzero(mass.diagonal() == 0.0)
    columns = stiffness.tocsc()[:, massless]
    columns.eliminate_zeros()
    largest = abs(columns).max(axis=0).toarray().ravel() if len(massless) else np.zeros(0)
    gone = massless[largest == 0.0].tolist()
    # whatever else may move freely is connected by stiffness
    _, part = connected_components(columns[massless], directed=False) if len(massless) else (0, np.zeros(0, dtype=int))
    sizes = np.bincount(part)
    for which in np.flatnonzero((sizes > 1) & (sizes <= _DENSE)):
        inside = np.flatnonzero(part == which)
        dense = columns[:, inside].tocsr()
        dense = dense[np.diff(dense.indptr) > 0].toarray() / largest[inside]
        _, values, right = np.linalg.svd(dense, full_matrices=True)
        values = np.append(values, np.zeros(len(right) - len(values)))
        free = right[values <= ROUNDING * values[0]]
        if len(free):
            pivots = qr(free, mode="r", pivoting=True)[1]
            gone += massless[inside[pivots[: len(free)]]].tolist()
    return np.array(sorted(gone), dtype=int)


# -------------------------------------------------------------------------------------------------------------- densely
def _densely(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """All squares and modes of full matrices (n, n)."""
    from scipy.linalg import eigh

    massless = mass.diagonal() == 0.0
    if not massless.any():
        try:
            return modes_of(mass, stiffness)[:2]
        except np.linalg.LinAlgError:  # a singular mass: in other coordinates some have none
            scale = 1.0 / np.sqrt(mass.diagonal())
            inertia, turn = eigh(mass * scale[:, None] * scale)
            if inertia[0] < -ROUNDING * len(mass):
                raise InputError("the mass is not positive definite: some motion has negative kinetic energy") from None
            turn = scale[:, None] * turn
            inertia = np.where(inertia > ROUNDING * len(mass), inertia, 0.0)
            squares, modes = _densely(np.diag(inertia), turn.T @ stiffness @ turn)
            return squares, turn @ modes
    if mass[massless].any():
        raise InputError("the mass is not positive definite: a DOF with no mass of its own is coupled to others by it")
    squares, modes = _condensed(mass[~massless][:, ~massless], stiffness, massless)
    return squares, modes


def _condensed(mass: Array, stiffness: Array, massless: np.ndarray) -> tuple[Array, Array]:
    """The same with degrees of freedom without inertia; mass (m, m): of the others."""
    from scipy.linalg import eigh, null_space

    own, beside = stiffness[~massless][:, ~massless], stiffness[massless][:, ~massless]
    inner = stiffness[massless][:, massless]
    size = np.abs(stiffness[massless]).max(axis=1)
    scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    values, turn = eigh(inner * scale[:, None] * scale)
    turn = scale[:, None] * turn
    stiff = np.abs(values) > ROUNDING * np.abs(values).max()
    following = -(turn[:, stiff] / values[stiff]) @ (turn[:, stiff].T @ beside)
    pulled = turn[:, ~stiff].T @ beside
    free = null_space(pulled) if len(pulled) else np.eye(len(own))
    squares, shapes = _densely(free.T @ mass @ free, free.T @ (own + beside.T @ following) @ free)
    modes = np.zeros((len(stiffness), len(squares)))
    moved = free @ shapes
    modes[~massless] = moved
    modes[massless] = following @ moved
    if len(pulled):
        rest = (mass @ moved) * squares - stiffness[~massless] @ modes
        modes[massless] += turn[:, ~stiff] @ np.linalg.lstsq(pulled.T, rest, rcond=None)[0]
    return squares, modes


# ------------------------------------------------------------------------------------------------------------- sparsely
def _sparsely(mass: Any, stiffness: Any, count: int) -> tuple[Array, Array]:
    """The lowest squares and their modes of large matrices."""
    inertia, size = mass.diagonal(), np.abs(stiffness.diagonal())
    highest = np.max(size[inertia > 0.0] / inertia[inertia > 0.0], initial=0.0)
    shift = -_SHIFT * (highest or 1.0)
    squares, modes = _by_lanczos(mass, stiffness, shift, count)
    rigid = is_rigid(squares, terms_of(modes, stiffness))
    elastic = squares[~rigid]
    if rigid.any() and len(elastic) and -shift < _FAR * elastic[0]:
        squares, modes = _by_lanczos(mass, stiffness, -elastic[0], count)
    return squares, modes


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
