"""The linear part of a structure, behind one small contract.

Harmonic balance at a frequency Omega couples the unknown displacement amplitudes `x` (complex, `x exp(i Omega t)`)
with the amplitudes `s` of element forces and P of loads by

    A(Omega) x + s = P.

With all degrees of freedom unknown `A = K - Omega^2 M + i Omega C + i sgn(Omega) S`, S the structural damping;
`condensed` eliminates those that no element acts on.
Whatever is above asks for A and its derivatives with respect to Omega and the parameters, and for the matrices of an
equation of motion with the same response (for monodromy and scaling); it never sees which form it is given. The
structure has n DOFs, its equation of motion N, and `size` of them, or directions through them, are unknown.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.lazy import lazy
from suboctave.model.matrices import MatrixCoefficient, viscous_damping
from suboctave.model.modes import Modes, modes_of
from suboctave.model.system import System
from suboctave.units import UnitSystem


@runtime_checkable
class LinearPart(Protocol):
    """Contract of the linear part. `size` is the number of unknown DOFs; `loads` the directions of loads (l, n) that
    these do not hold; `covers` the highest circular frequency that it serves.
    """

    size: int
    loads: Array
    covers: float

    @property
    def words(self) -> tuple[str, ...]:
        """What a result rests on, in sentences: the projection and its error, structural damping."""

    def rebuilt(self, values: Mapping[str, float]) -> LinearPart:
        """The same part at other parameter values."""

    def stiffness(self, frequency: NDArray[Any], order: int = 0) -> ComplexArray:
        """`d^order A / d Omega^order`, shape (len(frequency), size, size); at complex frequencies, of vibrations that
        decay or grow, structural damping acts by the sign of their real part.
        """

    def stiffness_by(self, frequency: Array, names: tuple[str, ...], order: int = 0) -> ComplexArray | None:
        """`d^order A / d Omega^order` differentiated by one or two parameters; None if zero."""

    def retain(self, direction: Array) -> Array:
        """A direction or load shape in the structure's DOFs (n,) as one in the unknown DOFs (size,).

        Raises InputError for a direction that the unknown DOFs do not hold.
        """

    def holds(self, direction: Array) -> bool:
        """Whether the unknown DOFs hold a direction."""

    def holding(self, dof: int) -> LinearPart:
        """The same part with the displacement of a DOF among its unknowns."""

    def loaded(self, frequency: Array, names: tuple[str, ...] = (), order: int = 0) -> ComplexArray | None:
        """P of a unit of each of the loads whose directions the unknowns do not hold, (F, size, loads), or `d^order / d
        Omega^order` of it, differentiated by parameters, by two things at most; None if zero.
        """

    def equation_of_motion(self) -> tuple[Array, Array, Array]:
        """Mass, damping, stiffness (N, N) of an equation of motion with this response, N >= size.

        There is none of structural damping: its viscous equivalent stands for it (`System.viscous_equivalent`).
        """

    def modes(self) -> Modes:
        """Its undamped modes, in the DOFs of the equation of motion."""

    def read(self, motion: Array) -> Array:
        """The unknowns (..., size) of a motion of the structure, (..., n); of a direction, what they do along it."""

    def expand(self, direction: Array) -> Array:
        """A direction in the unknown DOFs (size,) as one in those of the equation of motion (N,)."""

    def seen(self, direction: Array) -> Array:
        """A direction in the structure's DOFs (..., n) as one in those of the equation of motion (..., N)."""

    def recovered(self, frequency: Array, amplitudes: ComplexArray, loads: ComplexArray | None = None) -> ComplexArray:
        """Complex amplitudes (F, size) of the unknowns at frequencies (F,) as those of the equation of motion, (F, N);
        loads: those of the loads that `loaded` is about, (F, loads), None where there are none.
        """

    def shaped(self, motion: NDArray[Any]) -> NDArray[Any]:
        """A motion (..., N) of the equation of motion as one of the structure, (..., n)."""

    def covering(self, frequency: float) -> LinearPart:
        """The same part, made to serve up to a circular frequency."""

    def fed(self, rate: float) -> LinearPart:
        """The same part with the damping `C - rate M`, which feeds every motion in proportion to its momentum."""

    def feeding(self, frequency: Array) -> ComplexArray:
        """A differentiated by that rate, (F, size, size): `-i Omega M` where all degrees of freedom are unknowns."""

    def __hash__(self) -> int:
        """By identity: what depends on the linear part alone is kept with it as the key."""


class EquationOfMotion:
    """What a linear part reads from the matrices of its equation of motion, M, C, K and S, (4, N, N).

    `terms`: of a projection, as `modes_of` takes them.
    """

    matrices: Array
    terms: Array | None = None

    def equation_of_motion(self) -> tuple[Array, Array, Array]:
        """M, C, K, C with what stands for structural damping."""
        return self._equation

    @lazy
    def _equation(self) -> tuple[Array, Array, Array]:
        mass, damping, stiffness, structural = self.matrices
        if structural.any():
            damping = damping + viscous_damping(mass, structural, self._undamped)
        return mass, damping, stiffness

    def modes(self) -> Modes:
        """See `LinearPart.modes`."""
        return self._undamped

    @lazy
    def _undamped(self) -> Modes:
        return modes_of(self.matrices[0], self.matrices[2], self.terms)


class StructuralMatrices(EquationOfMotion):
    """Stiffness form straight from a system's matrices: `A = K - Omega^2 M + i Omega C + i sgn(Omega) S`."""

    covers = np.inf

    def __init__(self, system: System, values: Mapping[str, float] | None = None) -> None:
        self.system = system
        self.values = dict(system.parameters if values is None else values)
        self.size = system.n
        self.loads = np.zeros((0, system.n))
        self.matrices = np.array([matrix.value(self.values) for matrix in system.linear_parts])

    def __repr__(self) -> str:
        return in_words(self, self.size, "as they are", self.system.units)

    @property
    def words(self) -> tuple[str, ...]:
        """See `LinearPart.words`."""
        return damping_words(self.system)

    def rebuilt(self, values: Mapping[str, float]) -> StructuralMatrices:
        """The same structure at other parameter values."""
        return StructuralMatrices(self.system, values)

    def stiffness(self, frequency: NDArray[Any], order: int = 0) -> ComplexArray:
        """See `LinearPart.stiffness`."""
        return dynamic_stiffness(self.matrices, frequency, order)

    def stiffness_by(self, frequency: Array, names: tuple[str, ...], order: int = 0) -> ComplexArray | None:
        """See `LinearPart.stiffness_by`."""
        parts = differentiated(self.system.linear_parts, names, self.values)
        return None if parts is None else dynamic_stiffness(parts, frequency, order)

    def retain(self, direction: Array) -> Array:
        """All DOFs are unknowns."""
        return direction

    def holds(self, direction: Array) -> bool:
        """All DOFs are unknowns."""
        return True

    def holding(self, dof: int) -> StructuralMatrices:
        """All DOFs are unknowns."""
        return self

    def loaded(self, frequency: Array, names: tuple[str, ...] = (), order: int = 0) -> ComplexArray | None:
        """The unknowns hold all loads."""
        return None

    def expand(self, direction: Array) -> Array:
        """The unknowns are the DOFs of the equation of motion."""
        return direction

    def read(self, motion: Array) -> Array:
        """All DOFs are unknowns."""
        return motion

    def seen(self, direction: Array) -> Array:
        """The equation of motion is the structure's."""
        return direction

    def recovered(self, frequency: Array, amplitudes: ComplexArray, loads: ComplexArray | None = None) -> ComplexArray:
        """The unknowns are the DOFs of the equation of motion."""
        return amplitudes

    def shaped(self, motion: NDArray[Any]) -> NDArray[Any]:
        """The equation of motion is the structure's."""
        return motion

    def covering(self, frequency: float) -> StructuralMatrices:
        """The matrices serve at any frequency."""
        return self

    def fed(self, rate: float) -> StructuralMatrices:
        """See `LinearPart.fed`."""
        other = copy.copy(self)
        other.matrices = fed_matrices(self.matrices, rate)
        vars(other).pop("_equation", None)
        return other

    def feeding(self, frequency: Array) -> ComplexArray:
        """See `LinearPart.feeding`."""
        return dynamic_stiffness(feeding_matrices(self.matrices), frequency, 0)


def fed_matrices(matrices: NDArray[Any], rate: float) -> NDArray[Any]:
    """M, C, K, S (4, ...) with `C - rate M` for C."""
    result = matrices.copy()
    result[1] -= rate * matrices[0]
    return result


def feeding_matrices(matrices: Array) -> Array:
    """The same differentiated by that rate."""
    result = np.zeros_like(matrices)
    result[1] = -matrices[0]
    return result


def natural_frequencies(linear: LinearPart) -> Array:
    """Circular natural frequencies of its equation of motion, undamped, ascending, (N,); 0 for what is free to move."""
    modes = linear.modes()
    return np.sqrt(np.where(modes.rigid, 0.0, np.maximum(modes.squares, 0.0)))


def damping_words(system: System) -> tuple[str, ...]:
    """What stability means with structural damping."""
    if system.structural.zero:
        return ()
    return (
        "Structural damping: multipliers are those of perturbations that it damps at their own frequencies, as there "
        "is no equation of motion in time",
    )


def in_words(linear: LinearPart, dofs: int, how: str, declared: UnitSystem | None) -> str:
    """How many degrees of freedom are taken how, what is unknown, and the first natural frequencies."""
    lowest = natural_frequencies(linear)[:6]
    circular, cycles = "rad per unit time", "Hz, if that is a second"
    if declared:
        circular, cycles = declared.frequency, declared.cycles
    units = ((circular, 1.0), (cycles, 2.0 * np.pi))
    shown = [f"{', '.join(f'{w / unit:.6g}' for w in lowest)} {name}" for name, unit in units]
    unknown = f"{linear.size} unknown displacement{'s' if linear.size > 1 else ''}"
    return (
        f"Linear part: {dofs} degrees of freedom, {how}; {unknown}\n"
        f"  natural frequencies {shown[0]}\n                      {shown[1]}"
    )


def differentiated(
    matrices: Sequence[MatrixCoefficient], names: tuple[str, ...], values: Mapping[str, float]
) -> Array | None:
    """Matrices (n, n) differentiated by parameters, all in one array; None where all are zero."""
    found = []
    for matrix in matrices:
        derived: MatrixCoefficient | None = matrix
        for name in names:
            derived = derived and derived.derivative(name)
        found.append(derived)
    if all(one is None for one in found):
        return None
    n = matrices[0].n
    return np.array([np.zeros((n, n)) if one is None else one.value(values) for one in found])


@kernel(inner=True, forceinline=True)
def factors(w, order):
    """What M, C, K, S are multiplied by in the dynamic stiffness at w, complex, or in its derivative by Omega."""
    if order == 0:
        return -w * w, 1j * w, 1.0 + 0.0j, 1j * np.sign(w.real)
    return (-2.0 * w, 1j, 0.0j, 0.0j) if order == 1 else (complex(-2.0), 0.0j, 0.0j, 0.0j)


@kernel()
def dynamic_stiffness(matrices, frequency, order):
    """`K - Omega^2 M + i Omega C + i sgn(Re Omega) S`, (F, n, n), or its first or second derivative by Omega; matrices
    (4, n, n): M, C, K, S.
    """
    out = np.empty((frequency.shape[0], matrices.shape[1], matrices.shape[2]), dtype=np.complex128)
    for f in range(frequency.shape[0]):
        by = factors(complex(frequency[f]), order)
        for i in range(matrices.shape[1]):
            for j in range(matrices.shape[2]):
                total = by[0] * matrices[0, i, j] + by[1] * matrices[1, i, j]
                out[f, i, j] = total + by[2] * matrices[2, i, j] + by[3] * matrices[3, i, j]
    return out
