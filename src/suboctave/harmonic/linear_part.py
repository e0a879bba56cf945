"""The linear part of a structure, behind one small contract.

Harmonic balance at a frequency Omega couples the unknown displacement amplitudes `x` (complex, `x exp(i Omega t)`)
with the amplitudes `s` of element forces minus loads by

    A(Omega) x + s = 0.

With all degrees of freedom unknown `A = K - Omega^2 M + i Omega C`; `condensed` eliminates those that no force acts on.
Whatever is above asks for A and its derivatives with respect to Omega and the parameters, and for the matrices of an
equation of motion with the same response (for monodromy and scaling); it never sees which form it is given. The
structure has n DOFs, its equation of motion N, and `size` of them, or directions through them, are unknown.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.model.system import System


@runtime_checkable
class LinearPart(Protocol):
    """Contract of the linear part. `size` is the number of unknown DOFs."""

    size: int

    def rebuilt(self, values: Mapping[str, float]) -> LinearPart:
        """The same part at other parameter values."""

    def stiffness(self, frequency: Array, order: int = 0) -> ComplexArray:
        """`d^order A / d Omega^order`, shape (len(frequency), size, size)."""

    def stiffness_by(self, frequency: Array, names: tuple[str, ...], order: int = 0) -> ComplexArray | None:
        """`d^order A / d Omega^order` differentiated by one or two parameters; None if zero."""

    def retain(self, direction: Array) -> Array:
        """A direction or load shape in the structure's DOFs (n,) as one in the unknown DOFs (size,).

        Raises InputError for a direction that the unknown DOFs do not hold.
        """

    def equation_of_motion(self) -> tuple[Array, Array, Array]:
        """Mass, damping, stiffness (N, N) of an equation of motion with this response, N >= size."""

    def read(self, motion: Array) -> Array:
        """The unknowns (..., size) of a motion of the structure, (..., n); of a direction, what they do along it."""

    def expand(self, direction: Array) -> Array:
        """A direction in the unknown DOFs (size,) as one in those of the equation of motion (N,)."""

    def seen(self, direction: Array) -> Array:
        """A direction in the structure's DOFs (..., n) as one in those of the equation of motion (..., N)."""

    def recovered(self, frequency: Array, amplitudes: ComplexArray) -> ComplexArray:
        """Complex amplitudes (F, size) of the unknowns at frequencies (F,) as those of the equation of motion, (F,
        N).
        """

    def shaped(self, motion: NDArray[Any]) -> NDArray[Any]:
        """A motion (..., N) of the equation of motion as one of the structure, (..., n)."""

    def covering(self, frequency: float) -> LinearPart:
        """The same part, made to serve up to a circular frequency."""

    def __hash__(self) -> int:
        """By identity: what depends on the linear part alone is kept with it as the key."""


class StructuralMatrices:
    """Stiffness form straight from a system's M, C, K: `A = K - Omega^2 M + i Omega C`."""

    def __init__(self, system: System, values: Mapping[str, float] | None = None) -> None:
        self.system = system
        self.values = dict(system.parameters if values is None else values)
        self.size = system.n
        #: M, C, K, shape (3, n, n)
        self.matrices = np.array(system.matrices(self.values), dtype=float)

    def __repr__(self) -> str:
        return in_words(self, self.size, "as they are")

    def rebuilt(self, values: Mapping[str, float]) -> StructuralMatrices:
        """The same structure at other parameter values."""
        return StructuralMatrices(self.system, values)

    def stiffness(self, frequency: Array, order: int = 0) -> ComplexArray:
        """See `LinearPart.stiffness`."""
        return _blocks(self.matrices, frequency, order)

    def stiffness_by(self, frequency: Array, names: tuple[str, ...], order: int = 0) -> ComplexArray | None:
        """See `LinearPart.stiffness_by`."""
        parts = self.system.matrix_derivatives(*names, values=self.values)
        if all(part is None for part in parts):
            return None
        zero = np.zeros((self.size, self.size))
        return _blocks(np.array([zero if part is None else part for part in parts]), frequency, order)

    def retain(self, direction: Array) -> Array:
        """All DOFs are unknowns."""
        return direction

    def equation_of_motion(self) -> tuple[Array, Array, Array]:
        """M, C, K of the system."""
        mass, damping, stiffness = self.matrices
        return mass, damping, stiffness

    def expand(self, direction: Array) -> Array:
        """The unknowns are the DOFs of the equation of motion."""
        return direction

    def read(self, motion: Array) -> Array:
        """All DOFs are unknowns."""
        return motion

    def seen(self, direction: Array) -> Array:
        """The equation of motion is the structure's."""
        return direction

    def recovered(self, frequency: Array, amplitudes: ComplexArray) -> ComplexArray:
        """The unknowns are the DOFs of the equation of motion."""
        return amplitudes

    def shaped(self, motion: NDArray[Any]) -> NDArray[Any]:
        """The equation of motion is the structure's."""
        return motion

    def covering(self, frequency: float) -> StructuralMatrices:
        """The matrices serve at any frequency."""
        return self


def natural_frequencies(linear: LinearPart) -> Array:
    """Circular natural frequencies of its equation of motion, undamped, ascending, (N,); 0 for what is free to move."""
    mass, _, stiffness = linear.equation_of_motion()
    values = scipy.linalg.eigh(0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T), eigvals_only=True)
    free = np.abs(values) <= 1e-10 * np.abs(np.median(values))
    return np.sqrt(np.where(free, 0.0, np.maximum(values, 0.0)))


def in_words(linear: LinearPart, dofs: int, how: str) -> str:
    """How many degrees of freedom are taken how, what is unknown, and the first natural frequencies."""
    lowest = natural_frequencies(linear)[:6]
    units = (("rad per unit time", 1.0), ("Hz, if that is a second", 2.0 * np.pi))
    shown = [f"{', '.join(f'{w / unit:.6g}' for w in lowest)} {name}" for name, unit in units]
    return (
        f"Linear part: {dofs} degrees of freedom, {how}; {linear.size} unknown displacements\n"
        f"  natural frequencies {shown[0]}\n                      {shown[1]}"
    )


def _blocks(matrices: Array, frequency: Array, order: int) -> ComplexArray:
    """`K - Omega^2 M + i Omega C` at the frequencies, or its first or second derivative by Omega; (F, n, n)."""
    out = np.empty((len(frequency), *matrices.shape[1:]), dtype=complex)
    dynamic_stiffness(matrices, frequency, order, out)
    return out


@kernel()
def dynamic_stiffness(matrices, frequency, order, out):
    """`K - Omega^2 M + i Omega C`, or its first or second derivative by Omega, into `out` (F, n, n); matrices: M, C,
    K.
    """
    n = matrices.shape[1]
    for f in range(frequency.shape[0]):
        om = frequency[f]
        for i in range(n):
            for j in range(n):
                mass, damping, stiffness = matrices[0, i, j], matrices[1, i, j], matrices[2, i, j]
                if order == 0:
                    out[f, i, j] = complex(stiffness - om * om * mass, om * damping)
                elif order == 1:
                    out[f, i, j] = complex(-2.0 * om * mass, damping)
                else:
                    out[f, i, j] = complex(-2.0 * mass, 0.0)
