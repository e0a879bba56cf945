"""Natural frequencies, damping ratios and modes of small vibrations, `K phi = omega^2 M phi`; M may be singular.

Degrees of freedom with neither inertia nor stiffness have no part in it (`without_effect`) and are left out. Others
without inertia follow the rest, `K_bb x_b = -K_ba x_a`; where K_bb is singular what it leaves free are forces of
constraints, `Z^T K_ba x_a = 0` for `K_bb Z = 0`. Inertia without stiffness is a rigid-body motion (`model.modes`).

Small structures are solved densely, large ones by Lanczos's method on the shifted inverse. With a shift sigma below
zero, `K - sigma M` is regular for free bodies too, and the eigenvalues nearest to sigma are the lowest. A first shift
is small beside the highest eigenvalue, of which `max K_ii / M_ii` gives the size; with rigid-body modes a second one is
of the size of the first elastic eigenvalue.

A damping C that does not couple the modes has the ratios `phi . C phi / (2 omega)`, structural damping S half the loss
factor, `phi . S phi / (2 omega^2)`. Where damping couples them, and with gyroscopic or circulatory forces, frequencies
and ratios are those of the eigenvalues of `lambda^2 M + lambda C + K + i S` with positive imaginary part,

    omega = |lambda|,    zeta = -Re lambda / |lambda|,

which gives the same where nothing is coupled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from suboctave.arguments import checked
from suboctave.errors import ConvergenceError, InputError
from suboctave.model.elements.base import Array
from suboctave.model.matrices import sparse_factors
from suboctave.model.modes import ROUNDING, is_rigid, modes_of, terms_of
from suboctave.model.updated import Updated, part_of
from suboctave.units import UnitSystem

if TYPE_CHECKING:
    import pandas

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
#: DOFs up to which damping that couples the modes is taken into account
_COUPLED = 200
#: share of the largest modal damping, or of the largest entry of a matrix, that is rounding
_LITTLE = 1e-9
#: share of the largest eigenvalue below which one is zero
_ZERO = 1e-7
#: DOFs up to which shapes are printed beside the frequencies, and names that a line shows
_PRINTED, _SHOWN = 6, 4


@checked(result=True)
@dataclass(frozen=True, eq=False)
class NaturalFrequencies:
    """The lowest natural frequencies of small vibrations, in ascending order, with damping ratios and mode shapes.

    omega
        Circular frequencies (count,), radians per unit time. Modes that grow without oscillating, as of a buckled
        structure, come first: their rates stand here with a minus sign.
    damping_ratio
        Shares of critical damping (count,): 0.02 is 2 per cent. nan of rigid-body modes and of those that grow.
    modes
        Their shapes (n, count), of unit modal mass, `phi^T M phi = 1`; complex where damping couples the modes.
    rigid
        How many of them are rigid-body modes: their frequency is 0.
    left_out
        Degrees of freedom with neither mass nor stiffness, which have no part in it: their rows of `modes` are 0.
    dof_names
        What the degrees of freedom are called, where they have names.
    units
        Units that the system declares, None where it declares none.
    notes
        What is to be known of the numbers, in sentences.
    """

    omega: Array
    damping_ratio: Array
    modes: NDArray[Any]
    rigid: int
    left_out: tuple[int, ...] = ()
    dof_names: tuple[str, ...] = ()
    units: UnitSystem | None = None
    notes: tuple[str, ...] = ()

    @property
    def hertz(self) -> Array:
        """Frequencies (count,), cycles per unit time: Hz where that is 1 s."""
        return self.omega / (2.0 * np.pi)

    @property
    def damped_omega(self) -> Array:
        """Circular frequencies (count,) at which free vibrations die away, `omega sqrt(1 - zeta^2)`; nan of modes that
        do not oscillate.
        """
        ratio = np.where(np.abs(self.damping_ratio) < 1.0, self.damping_ratio, np.nan)
        result: Array = self.omega * np.sqrt(1.0 - ratio**2)
        return result

    @property
    def growing(self) -> int:
        """How many of them are no frequencies, but rates of growth; they come first."""
        return int(np.count_nonzero(self.omega < 0))

    def __len__(self) -> int:
        return len(self.omega)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per mode: `omega`, `hertz`, `damping_ratio`, and the shape, its largest entry 1, with one column
        `shape_NAME` (or `shape_0`, ...) per degree of freedom.
        """
        import pandas as pd

        table = {"omega": self.omega, "hertz": self.hertz, "damping_ratio": self.damping_ratio}
        names = self.dof_names or [str(i) for i in range(len(self.modes))]
        columns = {f"shape_{name}": row for name, row in zip(names, self._shown_shapes, strict=True)}
        return pd.DataFrame(table | columns, index=pd.RangeIndex(1, len(self) + 1, name="mode"))

    @property
    def _shown_shapes(self) -> NDArray[Any]:
        """The shapes with 1 where they are largest."""
        places = np.abs(self.modes).argmax(axis=0)
        return self.modes / self.modes[places, np.arange(len(self))]

    @property
    def _shapes_printed(self) -> bool:
        """Whether there is room for the shapes beside the frequencies."""
        return len(self.modes) <= _PRINTED and not np.iscomplexobj(self.modes)

    def _cells(self) -> tuple[list[str], list[list[str]]]:
        """Head and rows of the table that is printed."""
        units, damped = self.units, bool((self.damping_ratio != 0.0)[np.isfinite(self.damping_ratio)].any())
        head = ["mode", units.frequency if units else "rad per unit time"]
        head += [units.cycles if units else "Hz (if that is 1 s)"]
        columns = [[f"{i + 1}" for i in range(len(self))]]
        columns += [[f"{value:.6g}" for value in values] for values in (self.omega, self.hertz)]
        if damped:
            head.append("damping ratio")
            columns.append(["" if np.isnan(zeta) else f"{zeta:.4g}" for zeta in self.damping_ratio])
        if self._shapes_printed:
            head += list(self.dof_names) or [f"x{i}" if len(self.modes) > 1 else "x" for i in range(len(self.modes))]
            columns += [[f"{0.0 if abs(x) < _LITTLE else x:.3g}" for x in row] for row in self._shown_shapes]
        return head, [list(row) for row in zip(*columns, strict=True)]

    def _remark(self, mode: int) -> str:
        rigid = self.growing <= mode < self.growing + self.rigid
        return "rigid-body mode" if rigid else "grows: no frequency" if self.omega[mode] < 0 else ""

    def _sentences(self) -> list[str]:
        lines = []
        if self.rigid:
            count = "1 rigid-body mode: nothing holds it" if self.rigid == 1 else f"{self.rigid} rigid-body modes"
            lines.append(f"{count}{'' if self.rigid == 1 else ': nothing holds them'}")
        if self.growing:
            lines.append("the stiffness is not positive: the structure at rest is unstable")
        if self.left_out:
            names = [self.dof_names[i] if self.dof_names else str(i) for i in self.left_out[:_SHOWN]]
            more = f", ... ({len(self.left_out)} in all)" if len(self.left_out) > _SHOWN else ""
            lines.append(f"left out, as they move with neither mass nor stiffness: {', '.join(names)}{more}")
        return [*lines, *self.notes]

    def __str__(self) -> str:
        head, rows = self._cells()
        shapes = len(self.modes) if self._shapes_printed else 0
        least = [4, *[12] * (len(head) - 1 - shapes), *[8] * shapes]
        widths = [4, *(max(width, 2 + len(title)) for width, title in zip(least[1:], head[1:], strict=True))]
        lines = ["".join(f"{text:>{width}}" for text, width in zip(head, widths, strict=True))]
        for i, row in enumerate(rows):
            remark = self._remark(i)
            text = "".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True))
            lines.append(text + (f"   {remark}" if remark else ""))
        return "\n".join([*lines, *self._sentences()])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        from html import escape

        head, rows = self._cells()
        remarks = [self._remark(i) for i in range(len(rows))]
        titles = "".join(f'<th style="text-align: right">{escape(text)}</th>' for text in head)
        lines = [
            "<tr>" + "".join(f'<td style="text-align: right">{escape(c)}</td>' for c in row) + f"<td>{remark}</td></tr>"
            for row, remark in zip(rows, remarks, strict=True)
        ]
        notes = "".join(f"<p>{escape(text)}</p>" for text in self._sentences())
        return f"<table><thead><tr>{titles}<th></th></tr></thead><tbody>{''.join(lines)}</tbody></table>{notes}"


def natural_frequencies(
    mass: Any,
    stiffness: Any,
    count: int = 10,
    dof_names: Sequence[str] = (),
    *,
    damping: Any = None,
    structural: Any = None,
    units: UnitSystem | None = None,
    notes: Sequence[str] = (),
) -> NaturalFrequencies:
    """The lowest `count` natural frequencies of sparse matrices (n, n), all of them where there are fewer; damping and
    structural damping, None for none, give the ratios.

    Raises `ConvergenceError` where Lanczos's method does not arrive, `InputError` for a negative mass.
    """
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise InputError(f"count={count!r}: how many natural frequencies, a whole number from 1 on")
    n = mass.shape[0]
    left_out = without_effect(mass, stiffness)
    kept = np.setdiff1d(np.arange(n), left_out)
    if len(left_out):
        mass, stiffness = mass[kept][:, kept], stiffness[kept][:, kept]
        damping, structural = (None if part is None else part_of(part, kept) for part in (damping, structural))
    losses = damping, structural

    def found(omega: Array, ratio: Array, modes: NDArray[Any], rigid: int, *more: str) -> NaturalFrequencies:
        shapes = np.zeros((n, modes.shape[1]), modes.dtype)
        shapes[kept] = modes
        gone = tuple(left_out.tolist())
        return NaturalFrequencies(omega, ratio, shapes, rigid, gone, tuple(dof_names), units, (*notes, *more))

    turning = not _is_symmetric(stiffness) or not (damping is None or _is_symmetric(damping))
    massless = bool((mass.diagonal() == 0.0).any())
    if turning and (len(kept) > _COUPLED or massless):
        raise InputError(
            f"a damping or a stiffness that is not symmetric (gyroscopic, circulatory forces) is for up to {_COUPLED} "
            "degrees of freedom, all with inertia: reduce the model, or look at its symmetric parts"
        )
    if not turning:
        omega, modes, rigid = _undamped(mass, stiffness, int(count))
        ratio, coupled = _modal_ratios(omega, modes, losses)
        if not coupled:
            return found(omega, ratio, modes, rigid)
        if len(kept) > _COUPLED or massless:
            to_first_order = "damping couples the modes: each ratio is that of a mode by itself, to first order"
            return found(omega, ratio, modes, rigid, to_first_order)
    omega, ratio, modes, rigid, decaying = _by_eigenvalues(mass, stiffness, losses, int(count))
    gone = f"left out: {decaying} real eigenvalues, of motions that die away without oscillating"
    return found(omega, ratio, modes, rigid, *([gone] if decaying else []))


def _is_symmetric(matrix: Any) -> bool:
    """Whether a sparse matrix, or an updated one, is symmetric up to rounding."""
    part = matrix.sparse if isinstance(matrix, Updated) else matrix
    return bool(abs(part - part.T).max() <= _LITTLE * abs(part).max()) if part.nnz else True


def _undamped(mass: Any, stiffness: Any, count: int) -> tuple[Array, Array, int]:
    """The lowest circular frequencies, ascending, their modes, and how many are rigid."""
    moving = int(np.count_nonzero(mass.diagonal() > 0.0))
    count, n = min(count, moving), mass.shape[0]
    if n < _DENSE or count > n // 3:
        squares, modes = _densely(mass.toarray(), stiffness.toarray())
        squares, modes = squares[:count], modes[:, :count]
    else:
        squares, modes = _sparsely(mass, stiffness, count)
    rigid = is_rigid(squares, terms_of(modes, stiffness))
    omega = np.where(rigid, 0.0, np.sign(squares) * np.sqrt(np.abs(squares)))
    order = np.argsort(omega, kind="stable")
    return omega[order], modes[:, order], int(rigid.sum())


def _modal_ratios(omega: Array, modes: Array, losses: tuple[Any, Any]) -> tuple[Array, bool]:
    """The ratio of each mode by itself, and whether damping couples these modes."""
    vibrating = omega > 0.0
    ratio, coupled, sizes = np.where(vibrating, 0.0, np.nan), False, np.where(vibrating, omega, 1.0)
    for power, matrix in enumerate(losses, 1):
        if matrix is None:
            continue
        inside = modes.T @ (matrix @ modes)
        own = np.diag(inside)
        ratio = ratio + own / (2.0 * sizes**power)
        coupled = coupled or bool(np.abs(inside - np.diag(own)).max() > _LITTLE * np.abs(inside).max())
    return ratio, coupled


def _by_eigenvalues(
    mass: Any, stiffness: Any, losses: tuple[Any, Any], count: int
) -> tuple[Array, Array, NDArray[Any], int, int]:
    """Frequencies, ratios, shapes, how many are rigid, and how many eigenvalues are those of motions that die away
    without oscillating, of `lambda^2 M + lambda C + K + i S`.
    """
    m, k = mass.toarray(), stiffness.toarray()
    c, s = (np.zeros_like(m) if part is None else part.toarray() for part in losses)
    n, inverse = len(m), np.linalg.inv(m)
    whole = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ (k + 1j * s if s.any() else k), -inverse @ c]])
    values, vectors = np.linalg.eig(whole)
    little = _ZERO * np.abs(values).max()
    nothing, turning = np.abs(values) <= little, values.imag > _ZERO * np.abs(values)
    straight = ~nothing & (np.abs(values.imag) <= _ZERO * np.abs(values))
    growing = straight & (values.real > 0.0)
    decaying = 0 if s.any() else int(np.count_nonzero(straight & ~growing)) - int(np.count_nonzero(growing))
    chosen = np.concatenate([np.flatnonzero(growing), np.flatnonzero(nothing)[::2], np.flatnonzero(turning & ~nothing)])
    omega = np.where(growing, -np.abs(values), np.where(nothing, 0.0, np.abs(values)))[chosen]
    order = np.argsort(omega, kind="stable")[:count]
    chosen, omega = chosen[order], omega[order]
    vibrating = omega > 0.0
    ratio = np.where(vibrating, -values.real[chosen] / np.where(vibrating, omega, 1.0), np.nan)
    shapes = vectors[:n, chosen]
    shapes = shapes / shapes[np.abs(shapes).argmax(axis=0), np.arange(len(chosen))]
    shapes = shapes / np.sqrt(np.einsum("im,ij,jm->m", shapes.conj(), m, shapes).real)
    return omega, ratio, shapes, int(np.count_nonzero(omega == 0.0)), max(decaying, 0)


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
