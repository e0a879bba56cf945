"""Periodic loads: `amplitude cos(harmonic omega t + phase)` on the right-hand side of the equation of motion."""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, shortened
from suboctave.model.element import Array, Dof, Place, required
from suboctave.model.expression import ZERO, Coefficient, coefficient
from suboctave.model.matrix import MatrixCoefficient
from suboctave.model.recorded import Recorded

__all__ = ["HarmonicLoad", "Load", "LoadComponent", "Matrices"]

Number = float | str | Coefficient
#: far above what harmonic balance has unknowns for; angles of higher ones would lose digits in time integration
_HIGHEST = 10_000
#: mass, damping and stiffness of the structure that a load acts on
Matrices = tuple[MatrixCoefficient, MatrixCoefficient, MatrixCoefficient]


@dataclass(frozen=True, eq=False)
class LoadComponent:
    """One cosine: `direction * amplitude * cos(harmonic * omega * t + phase)`, direction (n,), phase in radians."""

    direction: Array
    harmonic: int
    amplitude: Coefficient
    phase: Coefficient


class Load(Recorded, ABC, family="load"):
    """A periodic or constant force on the right-hand side. Subclasses are immutable by convention."""

    @property
    @abstractmethod
    def label(self) -> str:
        """How messages name this load."""

    @property
    @abstractmethod
    def coefficients(self) -> tuple[tuple[str, Coefficient], ...]:
        """Every expression that its user gave, with what it is."""

    @abstractmethod
    def components(self, n: int, matrices: Matrices | None = None) -> tuple[LoadComponent, ...]:
        """Its cosines in a structure of n degrees of freedom; constant parts are of harmonic 0.

        `matrices`: those of the structure, for loads of inertia and of moving bases.
        """

    def check_elements(self, n: int, elements: Sequence[Any]) -> None:
        """Refuse elements that the load cannot act beside."""

    def _read(self, what: str, source: Any) -> Coefficient:
        try:
            return coefficient(source)
        except InputError as error:
            raise InputError(f"{self.label}, {what}: {error}") from None

    def _read_harmonic(self, given: Any, least: int = 0) -> int:
        try:
            harmonic = operator.index(given)
        except TypeError:
            harmonic = -1
        if harmonic < least or isinstance(given, bool):
            raise InputError(f"{self.label}: harmonic must be an integer from {least} on, not {given!r}")
        if harmonic > _HIGHEST:
            raise InputError(f"{self.label}: harmonic={shortened(harmonic)} is more than {_HIGHEST}, the highest taken")
        return harmonic


class HarmonicLoad(Load):
    """A force `amplitude cos(harmonic omega t + phase)` on the right-hand side.

    It acts at `dof` (an index, or a pair `(i, j)` for `e_i - e_j`) or along the vector `direction`. `amplitude`,
    `harmonic` and `phase` may be sequences of equal length: a sum of cosines; a single phase serves all of them.
    `static` is a constant force. Amplitudes and phases may contain `omega` (unbalance: `"m*e*omega**2"`).
    """

    def __init__(
        self,
        dof: Dof | None = None,
        amplitude: Number | Sequence[Number] | None = None,
        harmonic: int | Sequence[int] = 1,
        phase: Number | Sequence[Number] = 0.0,
        static: Number = 0.0,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        self.place = Place("HarmonicLoad", dof, direction)
        required(self.label, amplitude=amplitude)
        amplitudes, harmonics, phases = (_listed(given) for given in (amplitude, harmonic, phase))
        if len(amplitudes) != len(harmonics) or len(phases) not in (1, len(amplitudes)):
            raise InputError(
                f"{self.label}: {len(amplitudes)} of amplitude, {len(harmonics)} of harmonic, {len(phases)} of phase; "
                f"give as many of each (a single phase serves all)"
            )
        if len(phases) == 1:
            phases *= len(amplitudes)
        self.amplitudes = tuple(self._read("amplitude", given) for given in amplitudes)
        self.harmonics = tuple(self._read_harmonic(given) for given in harmonics)
        self.phases = tuple(self._read("phase", given) for given in phases)
        self.static = self._read("static", static)

    @property
    def label(self) -> str:
        """How messages name this load."""
        return f"HarmonicLoad({self.place})"

    @property
    def coefficients(self) -> tuple[tuple[str, Coefficient], ...]:
        """Every expression of this load, with what it is."""
        pairs = [("amplitude", c) for c in self.amplitudes] + [("phase", c) for c in self.phases]
        return (*pairs, ("static", self.static))

    def direction(self, n: int) -> Array:
        """The vector (n,) along which the load acts."""
        return self.place.direction(n)

    def components(self, n: int, matrices: Matrices | None = None) -> tuple[LoadComponent, ...]:
        """The cosines of this load, the static part last (harmonic 0)."""
        direction = self.direction(n)
        direction.setflags(write=False)
        cosines = [
            LoadComponent(direction, harmonic, amplitude, phase)
            for amplitude, harmonic, phase in zip(self.amplitudes, self.harmonics, self.phases, strict=True)
        ]
        if not (self.static.constant and self.static.value({}) == 0.0):
            cosines.append(LoadComponent(direction, 0, self.static, ZERO))
        return tuple(cosines)

    def __repr__(self) -> str:
        shown = [str(self.place), f"amplitude={_shown(self.amplitudes)}"]
        if self.harmonics != (1,):
            shown.append(f"harmonic={_shown(self.harmonics)}")
        if any(not phase.constant or phase.value({}) != 0.0 for phase in self.phases):
            shown.append(f"phase={_shown(self.phases)}")
        if not self.static.constant or self.static.value({}) != 0.0:
            shown.append(f"static={self.static.text}")
        return f"HarmonicLoad({', '.join(shown)})"


def _listed(given: Any) -> list[Any]:
    if isinstance(given, Sequence | np.ndarray) and not isinstance(given, str) and np.ndim(given) == 1:
        return list(given)
    return [given]


def _shown(items: Sequence[Any]) -> str:
    texts = [item.text if isinstance(item, Coefficient) else str(item) for item in items]
    return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"
