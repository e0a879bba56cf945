"""Layout of a system for the batch integrators: what goes into generated code, and what stays a number.

`M x'' + C x' + K x + sum_o e_o F_o(q, q', theta) = p(t)`: elements read the displacements `q_j = d_j . x` of a few
channels and their rates, and act along a few directions e_o. Channels, directions and the form of every law belong to
the code; matrices, coefficients, loads and the frequency are numbers, which may differ from trajectory to trajectory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import InputError
from suboctave.model.elements.base import Array, BaseElement
from suboctave.model.elements.batch_form import BatchForm
from suboctave.model.expressions.coefficients import Coefficient
from suboctave.model.system import System

__all__ = ["NO_TURN", "Layout", "Numbers", "PlacedLaw"]


#: size of a turn of a displacement that is no angle: beyond all that occur
NO_TURN = 1e300


@dataclass(frozen=True)
class PlacedLaw:
    """A law in its place: the channels that it reads, the direction that it acts along, where its numbers begin."""

    number: int
    element: BaseElement
    form: BatchForm
    inputs: tuple[int, ...]
    output: int
    begin: int
    corner: int  # the first of its corners

    @property
    def states(self) -> int:
        """How many states it reads: displacements and, where it depends on them, their rates."""
        return len(self.inputs) * (2 if self.element.depends_on_velocity else 1)


@dataclass(frozen=True)
class Numbers:
    """The numbers of P sets of parameters: `omega` (P,), matrices (P, n, n), `loads` (P, n, W), `laws` (P, K)."""

    omega: Array
    mass: Array
    damping: Array
    stiffness: Array
    loads: Array
    laws: Array


class Layout:
    """Channels (m, n), output directions (k, n), laws, and the waves (harmonic, whether sine) that loads consist of."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.n = n = system.n
        #: size of a turn of each degree of freedom, (n,)
        self.turns: Array = np.minimum(system.turns.periods, NO_TURN)
        channels: dict[bytes, int] = {}
        outputs: dict[bytes, int] = {}
        self.laws: list[PlacedLaw] = []
        numbers = corners = 0
        for element in system.elements:
            form = element.batch_form(element.coefficient_values(system.parameters))
            inputs = tuple(_entered(channels, row) for row in element.inputs(n))
            output = _entered(outputs, element.direction(n))
            self.laws.append(PlacedLaw(len(self.laws), element, form, inputs, output, numbers, corners))
            numbers += form.count
            corners += form.corners
        self.law_numbers, self.corners = numbers, corners
        self.channels = np.array([np.frombuffer(key) for key in channels]).reshape(-1, n)
        self.outputs = np.array([np.frombuffer(key) for key in outputs]).reshape(-1, n)
        components = system.load_components()
        waves = {(c.harmonic, False) for c in components}
        shifted = (c for c in components if not (c.phase.constant and c.phase.value({}) == 0.0))
        waves |= {(c.harmonic, True) for c in shifted if c.harmonic}
        self.waves = tuple(sorted(waves))

    @property
    def called_back(self) -> list[PlacedLaw]:
        """The laws that only their elements know."""
        return [placed for placed in self.laws if not placed.form.has_code]

    # ----------------------------------------------------------------------------------------------------- numbers
    def numbers(self, omega: Array, varied: Mapping[str, Array]) -> Numbers:
        """The numbers at frequencies `omega` (P,) and parameters `varied` (P,) by name, the others as in the system."""
        system, count = self.system, len(omega)
        names = frozenset(varied)
        sets = [
            {**system.parameters, **{name: float(values[i]) for name, values in varied.items()}} for i in range(count)
        ]

        def each(depends: bool, read: Any) -> Array:
            """What `read` gives for every set; once, if nothing that it needs differs."""
            if depends and names:
                return np.array([read(at, w) for at, w in zip(sets, omega.tolist(), strict=True)])
            one = np.asarray(read(sets[0], float(omega[0])))
            return np.repeat(one[None], count, axis=0)

        mass, damping, stiffness = (
            each(bool(matrix.names & names), lambda at, _, matrix=matrix: matrix.value(at))
            for matrix in (system.mass, system.damping, system.stiffness)
        )
        laws = np.zeros((count, self.law_numbers))
        for placed in self.laws:
            used = frozenset().union(*(c.names for c in placed.element.coefficients))
            end = placed.begin + placed.form.count
            laws[:, placed.begin : end] = each(bool(used & names), lambda at, _, one=placed: self._law(one, at))
        if not all(np.isfinite(array[array != np.inf]).all() for array in (mass, damping, stiffness, laws)):
            raise InputError("the parameters make a matrix or a coefficient infinite or undefined")
        return Numbers(omega, mass, damping, stiffness, self._loads(sets, omega), laws)

    def _law(self, placed: PlacedLaw, at: Mapping[str, float]) -> list[float]:
        element = placed.element
        element.check(at, False)
        c = element.coefficient_values(at)
        numbers = placed.form.numbers(c, element.sampling(c))
        if len(numbers) != placed.form.count:
            raise InputError(f"{element.label}: the law changes its form with its coefficients")
        return numbers

    def _loads(self, sets: Sequence[Mapping[str, float]], omega: Array) -> Array:
        """Factors (P, n, W) of the waves in the external force."""
        out = np.zeros((len(omega), self.n, len(self.waves)))
        for component in self.system.load_components():
            amplitude, phase = (_values(c, sets, omega) for c in (component.amplitude, component.phase))
            for wave, factor in ((False, np.cos(phase)), (True, -np.sin(phase))):
                if (component.harmonic, wave) in self.waves:
                    column = self.waves.index((component.harmonic, wave))
                    out[:, :, column] += (amplitude * factor)[:, None] * component.direction
        return out

    def wave_table(self, points: int) -> Array:
        """The waves (points, W) at the instants `2 pi i / points` of the phase."""
        harmonics, sines = np.array(self.waves, dtype=float).reshape(-1, 2).T
        # the angle is reduced before it is rounded: multiples of a period are the same number
        angle = 2.0 * np.pi * (np.outer(np.arange(points) / points, harmonics) % 1.0)
        waves: Array = np.where(sines > 0.0, np.sin(angle), np.cos(angle))
        return waves

    # ------------------------------------------------------------------------------------------------------ lengths
    def sizes(self, numbers: Numbers, states: Array, which: NDArray[np.int_]) -> Array:
        """Lengths (B, n): the size of states (B, 2n), and of what loads are sure to cause; see `field`."""
        n, omega = self.n, numbers.omega
        force = np.abs(numbers.loads).sum(axis=2)
        diagonal = np.abs(np.diagonal(numbers.stiffness, axis1=1, axis2=2))
        diagonal = diagonal + omega[:, None] * np.abs(np.diagonal(numbers.damping, axis1=1, axis2=2))
        mass = np.abs(np.diagonal(numbers.mass, axis1=1, axis2=2))
        caused = force / (diagonal + omega[:, None] ** 2 * mass)
        lengths = np.maximum(self.system.turns.folded(states[:, :n]), np.abs(states[:, n:]) / omega[which, None])
        return np.maximum(lengths, caused[which])


def _entered(table: dict[bytes, int], row: Array) -> int:
    return table.setdefault(np.ascontiguousarray(row + 0.0, dtype=float).tobytes(), len(table))


def _values(c: Coefficient, sets: Sequence[Mapping[str, float]], omega: Array) -> Array:
    if c.constant:
        return np.full(len(omega), c.value({}))
    return np.array([c.value({**at, "omega": w}) for at, w in zip(sets, omega.tolist(), strict=True)])
