"""A linear part whose unknowns are the displacements along the directions of the elements, and no others.

Of a structure of any size, as it is or projected (`reduction`), nothing but the displacements q along the m directions
of its elements need be unknown: all else follows from them. With static modes E (`D E = 1`, a unit of one displacement,
none of the others) and vibrations N of the structure held there (`D N = 0`), `y = E q + N z`, elements' forces s and
loads f anywhere,

    Z_qq q + Z_qz z = E^T f - s,    Z_zq q + Z_zz z = N^T f,        A q + s = P,
    A = Z_qq - Z_qz Z_zz^-1 Z_zq,   P = (E^T - Z_qz Z_zz^-1 N^T) f.

These are the coordinates of Craig & Bampton (AIAA Journal 6 (1968) 1313-1319); for damping in proportion to mass and
stiffness `Z_zz` is diagonal. A is exactly the inverse of the dynamic flexibility at q, but no difference of large
numbers: with `S = K + s^2 M`, E made by the inverse of S, the coupling is `N^T (K - S) E = -s^2 N^T M E`. It exists for
bodies that only the elements hold, where the flexibility is infinite at rest.

Of the determinant of the whole dynamic stiffness A lacks the factors of Z_zz, at the mean its static part and elsewhere
the square of a modulus: the signs of determinants that bifurcations are told by are the same.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from suboctave.arguments import Range, checked
from suboctave.errors import ConvergenceError, InputError, shortened
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.elimination import ComplexModes, Stack, complex_modes
from suboctave.harmonic.linear_part import (
    EquationOfMotion,
    LinearPart,
    StructuralMatrices,
    damping_words,
    differentiated,
    fed_matrices,
    feeding_matrices,
    in_words,
    natural_frequencies,
)
from suboctave.harmonic.reduction import Reduction
from suboctave.lazy import lazy
from suboctave.model.inputs import check_count, check_is_system, observed_dof
from suboctave.model.projected import projected_words
from suboctave.model.system import System

#: part of a direction that others do not hold, relative, below which it depends on them
_DEPENDENT = 1e-9
#: growth of the highest frequency that a basis is made for, when motions go beyond it
_BEYOND = 1.5
#: and beyond which it is no motion of interest: adaptive harmonics go from 15 to 127, and a range may be left
_TOO_FAR = 20.0


class Coordinates(NamedTuple):
    """Static modes E (r, m), vibrations N (r, s) of the structure held at its unknowns and the squares of their
    frequencies (s,), `S = K + unit M` and `(D S^-1 D^T)^-1`, (m, m).
    """

    static: Array
    free: Array
    squares: Array
    unit: float
    held: Array


class Condensed(EquationOfMotion):
    """The condensed linear part of a system at values of its parameters; made by `linear_part_of`.

    `size` unknowns, `covers` the highest circular frequency that its basis is made for.
    """

    def __init__(self, reduction: Reduction, values: Mapping[str, float], held: tuple[int, ...] = ()) -> None:
        #: degrees of freedom that are unknowns though no element may act on them
        self.held = held
        self.reduction, self.projected, self.values = reduction, reduction.projected, dict(values)
        self.system = reduction.system
        self.size, self.loads = len(reduction.directions), reduction.loads
        self.covers = self.projected.covers
        #: the part at the last other values, and one that covers more
        self._other: Condensed | None = None
        self._wider: Condensed | None = None
        #: what was asked for last, by frequencies
        self._last: tuple[NDArray[Any], tuple[ComplexArray, ComplexArray, dict[Any, Any]]] | None = None
        self.matrices = np.array([matrix.value(values) for matrix in self.projected.matrices])
        self.terms = self.projected.terms
        #: the loads' directions in the equation of motion, (l, N)
        self._loads = self.seen(reduction.loads)

    @property
    def made_for(self) -> dict[str, Any] | None:
        """What its basis is made for, arguments of `linear_part_of`; None where it depends on none."""
        if self.projected.shapes is None:
            return None
        made = {"frequency": self.covers, "scale": self.reduction.scale, "observed": list(self.reduction.observed)}
        return {**made, "held": list(self.held)} if self.held else made

    @property
    def error(self) -> float:
        """Of its flexibility at the highest frequency that it covers, relative, against a direct solution."""
        return self.reduction.error

    @property
    def frequencies(self) -> Array:
        """Natural frequencies of the structure as seen from its unknowns, rad per unit time, ascending, (N,); 0 for
        rigid-body motions.
        """
        return natural_frequencies(self)

    def __repr__(self) -> str:
        how = "as they are" if self.projected.shapes is None else "projected"
        return "\n  ".join([in_words(self, self.system.n, how, self.system.units), *self.words])

    @property
    def words(self) -> tuple[str, ...]:
        """See `LinearPart.words`."""
        own = damping_words(self.system)
        if self.projected.shapes is None:
            return own
        return projected_words(self.system.n, len(self.matrices[0]), self.covers, self.error), *own

    # ------------------------------------------------------------------------------------------------- other values
    def rebuilt(self, values: Mapping[str, float]) -> Condensed:
        """The same part at other parameter values."""
        if self._other is None or self._other.values != values:
            self._other = Condensed(self.reduction.covering(self.covers, values), values, self.held)
        return self._other

    def covering(self, frequency: float) -> Condensed:
        """This part, or one that serves up to a frequency beyond what it covers."""
        if frequency <= self.covers * (1.0 + 1e-9):
            return self
        if not frequency <= _TOO_FAR * self.covers:
            raise ConvergenceError(
                f"a frequency of {frequency:.3g} is far beyond {self.covers:.3g}, which the structure is projected for"
            )
        if self._wider is None or self._wider.covers < frequency:
            wider = self.reduction.covering(self._wide(frequency), self.values)
            self._wider = Condensed(wider, self.values, self.held)
        return self._wider

    def serving(self, frequency: float, several: Iterable[Mapping[str, float]]) -> Condensed:
        """One that serves up to a frequency at all of some values of the parameters, at the values of this part."""
        return Condensed(self.reduction.serving(self._wide(frequency), several), self.values, self.held)

    def _wide(self, frequency: float) -> float:
        """The frequency to cover, in steps that are the same for all motions."""
        wide = self.covers
        while wide < frequency:
            wide *= _BEYOND
        return wide

    # -------------------------------------------------------------------------------------------------- coordinates
    @lazy
    def _coordinates(self) -> Coordinates:
        mass, _, stiffness, _ = self.matrices
        mass, stiffness = 0.5 * (mass + mass.T), 0.5 * (stiffness + stiffness.T)
        values, modes = eigh(stiffness, mass)
        # a unit of stiffness that the structure has, also where some of it moves freely
        sizes = np.sort(np.abs(values))
        unit = float(sizes[np.argmax(sizes > 1e-9 * np.median(sizes))])
        if not np.all(values > -0.5 * unit):
            unit = 2.0 * float(-values.min())
        seen = self.projected.seen @ modes
        weight = 1.0 / (values + unit)
        held = np.linalg.inv((seen * weight) @ seen.T)
        static = modes @ ((weight[:, None] * seen.T) @ held)
        # orthonormal vibrations that are not seen: the rest of an orthogonal matrix
        null = np.linalg.qr(seen.T, mode="complete")[0][:, self.size :]
        squares, turn = eigh((null * values[:, None]).T @ null) if null.shape[1] else (np.zeros(0), np.zeros((0, 0)))
        return Coordinates(static, modes @ (null @ turn), squares, unit, held)

    @lazy
    def _modes(self) -> ComplexModes | None:
        """Those of the vibrations, where they are coordinates in the place of these."""
        _, damping, stiffness, structural = self._parts
        return None if structural[3].any() else complex_modes(damping[3], stiffness[3])

    def _split(self, matrices: Array, modes: ComplexModes | None = None) -> list[tuple[NDArray[Any], ...]]:
        """Matrices (., r, r) in the coordinates (q, z), or modes for z, each as qq, qz, zq, zz, with nothing in the
        loads' columns.
        """
        static, free = self._coordinates.static, self._coordinates.free
        right = np.concatenate((static, free if modes is None else free @ modes.columns), axis=1)
        left = np.concatenate((static, free if modes is None else free @ modes.rows.T), axis=1).T
        m, none = self.size, np.zeros((len(left), len(self._loads)))
        parts: list[tuple[NDArray[Any], ...]] = []
        for matrix in matrices:
            whole = left @ matrix @ right
            beside = np.concatenate((whole[:, :m], none), axis=1)
            parts.append((beside[:m], whole[:m, m:], beside[m:], whole[m:, m:]))
        return parts

    @lazy
    def _parts(self) -> list[tuple[Array, ...]]:
        """M, C, K, S in the coordinates (q, z), see `_split`."""
        static, free, squares, unit, held = self._coordinates
        m, k = self.size, self.matrices[2]
        mass, damping, skew, structural = self._split(np.array([*self.matrices[:2], 0.5 * (k - k.T), self.matrices[3]]))
        # K = S - unit M, and S has no coupling
        qq, qz, zq = (one - unit * other for one, other in zip(skew[:3], mass[:3], strict=True))
        qq[:, :m] += held
        # loads act at all frequencies alike
        qq[:, m:], zq[:, m:] = static.T @ self._loads.T, free.T @ self._loads.T
        stiffness = qq, qz, zq, np.diag(squares) + skew[3]
        return [(*mass[:3], np.eye(len(squares))), damping, stiffness, structural]

    @lazy
    def _plain(self) -> Stack:
        """The same in one row."""
        return Stack.of(self._parts)

    @lazy
    def _own(self) -> Stack:
        """The same, with complex modes for z where damping couples these."""
        modes = self._modes
        if modes is None:
            return self._plain
        none = np.zeros((len(modes.exponents), len(modes.exponents)))
        inner = none, np.eye(len(none)), np.diag(-modes.exponents), none
        outer = [(qq, qz @ modes.columns, modes.rows @ zq) for qq, qz, zq, _ in self._parts]
        return Stack.of([(*part, zz) for part, zz in zip(outer, inner, strict=True)])

    # ------------------------------------------------------------------------------------------------------- blocks
    def _stack(self, names: tuple[str, ...]) -> Stack | None:
        """M, C, K, S in the coordinates (q, z), differentiated; None for zero."""
        if not names:
            return self._own
        parts = differentiated(self.projected.matrices, names, self.values)
        return None if parts is None else Stack.of(self._split(parts, self._modes))

    def _eliminated(self, frequency: NDArray[Any]) -> tuple[ComplexArray, ComplexArray, dict[Any, Any]]:
        """`Z_zz^-1 Z_zq` at frequencies, the transpose of `Z_qz Z_zz^-1`, and what is known there of A and its
        derivatives; what was asked for last is kept.
        """
        if self._last is None or self._last[0] is not frequency:
            right, left, reduced = self._own.eliminated(frequency)
            self._last = frequency, (right, left, {(): reduced})
        return self._last[1]

    def _differentiated(
        self, frequency: NDArray[Any], by: tuple[tuple[tuple[str, ...], int], ...]
    ) -> ComplexArray | None:
        """A and P of unit loads, (F, m, m + l), differentiated by at most two things: each some names, or none and an
        order in Omega of one.
        """
        right, left, known = self._eliminated(frequency)
        if by not in known:
            known[by] = self._made(frequency, by, right, left)
        return known[by]

    def _made(
        self,
        frequency: NDArray[Any],
        by: tuple[tuple[tuple[str, ...], int], ...],
        right: ComplexArray,
        left: ComplexArray,
    ) -> ComplexArray | None:
        total = self._stack(tuple(name for one, _ in by for name in one))
        result = None
        if total is not None:
            result = total.between(frequency, sum(order for _, order in by), left, right)
        if len(by) < 2:
            return result
        a, b = (self._stack(names) for names, _ in by)
        if a is None or b is None:
            return result
        answer = self._own.answered(frequency, a, b, (by[0][1], by[1][1]), left, right)
        return -answer if result is None else result - answer

    def fed(self, rate: float) -> Condensed:
        """See `LinearPart.fed`; the coordinates are those of this part."""
        whole = self._plain
        other = copy.copy(self)
        other._last = other._other = other._wider = None
        other.matrices = fed_matrices(self.matrices, rate)
        for made in ("_equation", "_parts", "_plain", "_feeding"):
            vars(other).pop(made, None)
        vars(other)["_modes"], vars(other)["_own"] = None, whole._replace(entries=fed_matrices(whole.entries, rate))
        return other

    def feeding(self, frequency: Array) -> ComplexArray:
        """See `LinearPart.feeding`."""
        right, left, _ = self._eliminated(frequency)
        return self._unknowns_alone(self._feeding.between(frequency, 0, left, right))

    @lazy
    def _feeding(self) -> Stack:
        return Stack.of(self._split(feeding_matrices(self.matrices), self._modes))

    def _unknowns_alone(self, whole: ComplexArray) -> ComplexArray:
        """Without the loads' columns."""
        return whole if whole.shape[2] == self.size else np.ascontiguousarray(whole[:, :, : self.size])

    # ----------------------------------------------------------------------------------------------------- contract
    def stiffness(self, frequency: NDArray[Any], order: int = 0) -> ComplexArray:
        """See `LinearPart.stiffness`."""
        result = self._differentiated(frequency, (((), 1),) * order)
        assert result is not None
        return self._unknowns_alone(result)

    def stiffness_by(self, frequency: Array, names: tuple[str, ...], order: int = 0) -> ComplexArray | None:
        """See `LinearPart.stiffness_by`."""
        result = self._differentiated(frequency, (*(((name,), 0) for name in names), *(((), 1),) * order))
        return None if result is None else self._unknowns_alone(result)

    def loaded(self, frequency: Array, names: tuple[str, ...] = (), order: int = 0) -> ComplexArray | None:
        """See `LinearPart.loaded`."""
        result = self._differentiated(frequency, (*(((name,), 0) for name in names), *(((), 1),) * order))
        return None if result is None else result[:, :, self.size :]

    def retain(self, direction: Array) -> Array:
        """See `LinearPart.retain`."""
        return coordinates_among(self.reduction.directions, direction)

    def holds(self, direction: Array) -> bool:
        """See `LinearPart.holds`."""
        return _is_among(self.reduction.directions, direction)

    def holding(self, dof: int) -> LinearPart:
        """The same part with the displacement of a degree of freedom among its unknowns."""
        if self.holds(np.eye(1, self.system.n, dof)[0]):
            return self
        made_for = self.made_for or {}
        return linear_part_of(self.system, self.values, **{**made_for, "held": [*self.held, dof]})

    def read(self, motion: Array) -> Array:
        """See `LinearPart.read`."""
        result: Array = motion @ self.reduction.directions.T
        return result

    def expand(self, direction: Array) -> Array:
        """See `LinearPart.expand`."""
        result: Array = direction @ self.projected.seen
        return result

    def seen(self, direction: Array) -> Array:
        """See `LinearPart.seen`."""
        shapes = self.projected.shapes
        return direction if shapes is None else direction @ shapes

    def shaped(self, motion: NDArray[Any]) -> NDArray[Any]:
        """See `LinearPart.shaped`."""
        shapes = self.projected.shapes
        return motion if shapes is None else motion @ shapes.T

    def recovered(self, frequency: Array, amplitudes: ComplexArray, loads: ComplexArray | None = None) -> ComplexArray:
        """See `LinearPart.recovered`."""
        static, free = self._coordinates.static, self._coordinates.free
        shapes = free if self._modes is None else free @ self._modes.columns
        columns = amplitudes
        if len(self._loads):
            none = np.zeros((len(amplitudes), len(self._loads)))
            columns = np.concatenate((amplitudes, none if loads is None else -loads), axis=1)
        inner = (self._eliminated(frequency)[0] @ columns[:, :, None])[:, :, 0]
        result: ComplexArray = amplitudes @ static.T - inner @ shapes.T
        return result


# ------------------------------------------------------------------------------------------------------- which form
def linear_part_of(
    system: System,
    values: Mapping[str, float] | None = None,
    frequency: float = 1.0,
    scale: float | None = None,
    observed: Sequence[int] = (),
    held: Sequence[int] = (),
) -> LinearPart:
    """The linear part of a system with the fewest unknowns: condensed where elements leave degrees of freedom alone.

    frequency: the highest circular frequency of interest, which decides how a large structure is projected; scale: one
    within the range of interest; observed: degrees of freedom whose motion it should give as exactly; held: those that
    should be unknowns.
    """
    at, n = system.parameters if values is None else values, system.n
    directions = unknown_directions(system, held)
    if len(directions) in (0, n):
        return StructuralMatrices(system, at)
    components = [c.direction for c in system.load_components()]
    loads = np.reshape([d for d in components if not _is_among(directions, d)], (-1, n))
    units = [np.eye(1, n, dof)[0] for dof in observed]
    served = independent([*directions, *loads, *units])
    unit = frequency / 16.0 if scale is None else scale
    reduction = Reduction.of(system, directions, loads, served, tuple(observed), unit, frequency, at)
    return Condensed(reduction, at, tuple(held))


@checked
def condense(
    system: System,
    omega: float | Range,
    *,
    harmonics: int = 15,
    observe: int | str | Sequence[int | str] = (),
) -> LinearPart:
    """The linear part that verbs make by themselves, to look at before they work, or to share by `linear=`.

    Printed, it says how many degrees of freedom, unknowns and modes there are, the first natural frequencies, and the
    error of the flexibility.

    Parameters
    ----------
    omega
        Highest frequency of the load, or a range, rad per unit time.
    harmonics
        Highest multiple of it that motions will have; motions beyond find what they need.
    observe
        Degrees of freedom, by number or name, whose motion should be as exact as that at the forces.
    """
    check_is_system(system)
    highest = float(np.max(omega))
    if not (math.isfinite(highest) and highest > 0.0):
        raise InputError(f"omega must be a positive frequency or a range of frequencies, not {shortened(omega)}")
    observed = [observe] if isinstance(observe, int | np.integer | str) else list(observe)
    chosen = [observed_dof(system, dof) for dof in observed] or [system.observed_dof]
    return linear_part_of(system, None, (check_count("harmonics", harmonics) + 0.5) * highest, None, chosen)


def unknown_directions(system: System, held: Sequence[int] = ()) -> Array:
    """Independent directions (m, n) that displacements are unknown along: those that elements read and act along, and
    of degrees of freedom `held`, in the order met; without any those that loads act along.
    """
    n = system.n
    rows = [d for e in system.elements for d in (*e.inputs(n), e.direction(n))]
    rows += [np.eye(1, n, dof)[0] for dof in held]
    return independent(rows or [c.direction for c in system.load_components()]).reshape(-1, n)


def acting(system: System) -> Array:
    """Independent directions (m, n) that elements read and act along and loads act along, in the order met."""
    loads = [c.direction for c in system.load_components()]
    return independent([*unknown_directions(system), *loads]).reshape(-1, system.n)


def independent(rows: Sequence[Array]) -> Array:
    """Those of directions that do not depend on the ones before them."""
    n = len(rows[0]) if rows else 0
    kept: list[Array] = []
    basis = np.zeros((0, n))
    for row in rows:
        row = np.asarray(row, dtype=float)
        size = float(np.linalg.norm(row))
        rest = row - (row @ basis.T) @ basis
        rest -= (rest @ basis.T) @ basis
        left = float(np.linalg.norm(rest))
        if size > 0.0 and left > _DEPENDENT * size:
            kept.append(row)
            basis = np.concatenate((basis, rest[None] / left))
            if len(kept) == n:
                break
    return np.array(kept)


def coordinates_among(directions: Array, direction: Array) -> Array:
    """c with `direction = c @ directions`; InputError if it is not among them."""
    if not _is_among(directions, direction):
        raise InputError("this direction is not among those that displacements are unknown along")
    return _nearest(directions, direction)


def _nearest(directions: Array, direction: Array) -> Array:
    square, pulled = directions @ directions.T, directions @ direction
    c = np.asarray(np.linalg.solve(square, pulled), dtype=float)
    c[np.abs(c) <= 1e-14 * np.abs(c).max(initial=0.0)] = 0.0
    return c


def _is_among(directions: Array, direction: Array) -> bool:
    """Whether a direction depends on others."""
    rest = direction - _nearest(directions, direction) @ directions
    return bool(np.linalg.norm(rest) <= 10.0 * _DEPENDENT * np.linalg.norm(direction))
