"""Loads on the right-hand side of the equation of motion: cosines of time, and those that mass or motion make.

A cosine is `amplitude cos(harmonic omega t + phase)`. Motion of the base, `y(t) = amplitude cos(harmonic omega t +
phase)` along the direction r of rigid translation (`x = r` moves all DOFs as the base does):

- in relative coordinates, `x` measured from the base: `M x'' + C x' + K x + f = -M r y''`. Elements between the
  structure and the ground are between structure and base: nothing else changes.
- in absolute coordinates: `M x'' + C x' + K x = C r y' + K r y`, where stiffness and damping, structural too, of the
  structure that hold it to the ground (`K r`, `C r`) hold it to the base. An element that feels `r` would need the
  base's motion too; such systems are written in relative coordinates.
"""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, shortened, suggest
from suboctave.model.description import Recorded
from suboctave.model.elements.base import Array, Dof, Place, required
from suboctave.model.expressions.coefficients import ZERO, Coefficient, Number, coefficient, named_coefficient
from suboctave.model.matrices import MatrixCoefficient

#: translations and rotations, the last words of names such as "1042 z"
ROTATIONS = ("rx", "ry", "rz")
DIRECTIONS = ("x", "y", "z", *ROTATIONS)
#: far above what harmonic balance has unknowns for; angles of higher ones would lose digits in time integration
_HIGHEST = 10_000
#: mass, damping, stiffness and structural damping of the structure that a load acts on
Matrices = tuple[MatrixCoefficient, MatrixCoefficient, MatrixCoefficient, MatrixCoefficient]


@dataclass(frozen=True, eq=False)
class LoadComponent:
    """One cosine: `direction * amplitude * cos(harmonic * omega * t + phase)`, direction (n,), phase in radians."""

    direction: Array
    harmonic: int
    amplitude: Coefficient
    phase: Coefficient

    def __post_init__(self) -> None:
        self.direction.setflags(write=False)


Components: TypeAlias = tuple[LoadComponent, ...]


class Load(Recorded, ABC, family="load"):
    """A periodic or constant force on the right-hand side. Subclasses are immutable by convention.

    A subclass names its expressions in `coefficient_names`, and reads them by `_take`.
    """

    coefficient_names: tuple[str, ...] = ()
    place: Place | None = None

    @property
    def label(self) -> str:
        """How messages name this load."""
        return type(self).__name__ + (f"({self.place})" if self.place is not None else "")

    @property
    def coefficients(self) -> tuple[tuple[str, Coefficient], ...]:
        """Every expression that its user gave, with what it is."""
        return tuple((name, getattr(self, name)) for name in self.coefficient_names)

    @abstractmethod
    def components(self, n: int, matrices: Matrices) -> Components:
        """Its cosines in a structure of n degrees of freedom; constant parts are of harmonic 0.

        `matrices`: those of the structure, for loads of inertia and of moving bases.
        """

    def check_elements(self, n: int, elements: Sequence[Any]) -> None:
        """Refuse elements that the load cannot act beside."""

    def check_names(self, names: Sequence[str]) -> None:
        """Refuse a load that does not say where it acts, where the names of the DOFs show that it must."""

    def _take(self, **given: Any) -> None:
        """Keep expressions by their names; all of them must be given."""
        required(self.label, **given)
        for name, source in given.items():
            setattr(self, name, named_coefficient(source, self.label, name))

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

    place: Place

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
        self.amplitudes = tuple(named_coefficient(given, self.label, "amplitude") for given in amplitudes)
        self.harmonics = tuple(self._read_harmonic(given) for given in harmonics)
        read = tuple(named_coefficient(given, self.label, "phase") for given in phases)
        self.phases = read * (len(amplitudes) if len(phases) == 1 else 1)
        self.static = named_coefficient(static, self.label, "static")

    @property
    def coefficients(self) -> tuple[tuple[str, Coefficient], ...]:
        """Every expression of this load, with what it is."""
        pairs = [("amplitude", c) for c in self.amplitudes] + [("phase", c) for c in self.phases]
        return (*pairs, ("static", self.static))

    def direction(self, n: int) -> Array:
        """The vector (n,) along which the load acts."""
        return self.place.direction(n)

    def components(self, n: int, matrices: Matrices) -> Components:
        """See `Load.components`; the static part comes last."""
        waves = [*zip(self.harmonics, self.amplitudes, self.phases, strict=True)]
        if not (self.static.constant and self.static.value({}) == 0.0):
            waves.append((0, self.static, ZERO))
        return tuple(LoadComponent(self.direction(n), *wave) for wave in waves)


def _listed(given: Any) -> list[Any]:
    if isinstance(given, Sequence | np.ndarray) and not isinstance(given, str) and getattr(given, "ndim", True):
        return list(given)
    return [given]


class StaticLoad(Load):
    """A constant force on the right-hand side, at `dof` (an index, or a pair) or along `direction`."""

    coefficient_names = ("force",)
    place: Place
    force: Coefficient

    def __init__(
        self, dof: Dof | None = None, force: Number | None = None, *, direction: ArrayLike | None = None
    ) -> None:
        self.place = Place("StaticLoad", dof, direction)
        self._take(force=force)

    def components(self, n: int, matrices: Matrices) -> Components:
        return (LoadComponent(self.place.direction(n), 0, self.force, ZERO),)


class RotatingUnbalance(Load):
    """The force of a mass that rotates off its axis, `mass_eccentricity * omega^2`.

    It acts at `dof` as `m e (harmonic omega)^2 cos(harmonic omega t + phase)` and, if the DOF `perpendicular` is given,
    there as the same with sin: forwards whirl from `dof` towards `perpendicular`. `harmonic` is the speed of the shaft
    in units of omega. Unit of `mass_eccentricity`: mass times length.
    """

    coefficient_names = ("mass_eccentricity", "phase")
    mass_eccentricity: Coefficient
    phase: Coefficient

    def __init__(
        self,
        dof: int | None = None,
        mass_eccentricity: Number | None = None,
        perpendicular: int | None = None,
        phase: Number = 0.0,
        harmonic: int = 1,
    ) -> None:
        self.place = Place("RotatingUnbalance", dof, None)
        self.places = [self.place]
        if perpendicular is not None:
            self.places.append(Place("RotatingUnbalance, perpendicular", perpendicular, None))
        taken = [place.dofs for place in self.places]
        if any(len(dofs) != 1 for dofs in taken) or len(set(taken)) < len(taken):
            raise InputError("RotatingUnbalance: dof and perpendicular must be two different DOFs, one index each")
        self._take(mass_eccentricity=mass_eccentricity, phase=phase)
        self.harmonic = self._read_harmonic(harmonic, 1)

    def components(self, n: int, matrices: Matrices) -> Components:
        amplitude = coefficient(f"({self.mass_eccentricity.text}) * {self.harmonic**2} * omega**2")
        phases = (self.phase, coefficient(f"({self.phase.text}) + (-pi/2)"))
        return tuple(
            LoadComponent(place.direction(n), self.harmonic, amplitude, phase)
            for place, phase in zip(self.places, phases, strict=False)
        )


class _WithMatrices(Load):
    """A load along `M r`, `C r` or `K r`; `direction` r (n,), None for all DOFs alike; refused
    where these are named with several directions.
    """

    def __init__(self, direction: ArrayLike | None) -> None:
        self.vector = None if direction is None else Place(type(self).__name__, None, direction)

    def check_names(self, names: Sequence[str]) -> None:
        """Refuse a translation of all DOFs alike where their names have several directions."""
        there = {name.rpartition(" ")[2] for name in names}
        several = [direction for direction in DIRECTIONS if direction in there]
        if self.vector is None and len(several) > 1:
            raise InputError(
                f"{self.label} moves all DOFs alike unless told, and here they have the directions "
                f'{", ".join(several)}: give one, direction=structure.direction("{several[0]}"); in a study file '
                f'direction = "{several[0]}"'
            )

    def direction(self, n: int) -> Array:
        """The vector r (n,) of a rigid translation."""
        return np.ones(n) if self.vector is None else self.vector.direction(n)

    def _along(
        self, matrix: MatrixCoefficient, n: int, amplitude: str, harmonic: int, phase: Coefficient
    ) -> Components:
        """`matrix r amplitude cos(harmonic omega t + phase)`, one cosine per expression in the matrix."""
        return tuple(
            LoadComponent(vector, harmonic, coefficient(f"({factor.text}) * {amplitude}"), phase)
            for factor, vector in matrix.products(self.direction(n))
            if np.any(vector)
        )


class Gravity(_WithMatrices):
    """The weight `M r g`: `acceleration` g (length / time^2), along the direction r (n,), by default all DOFs alike.

    r has the entry 1 at every DOF that moves with gravity, 0 at horizontal ones, -1 at those that point upwards.
    """

    coefficient_names = ("acceleration",)
    acceleration: Coefficient

    def __init__(self, acceleration: Number | None = None, direction: ArrayLike | None = None) -> None:
        super().__init__(direction)
        self._take(acceleration=acceleration)

    def components(self, n: int, matrices: Matrices) -> Components:
        return self._along(matrices[0], n, f"({self.acceleration.text})", 0, ZERO)


class _Base(_WithMatrices):
    """Motion of the base: see the top of the module."""

    coefficient_names = ("amplitude", "phase")
    amplitude: Coefficient
    phase: Coefficient
    #: power of i omega from what is given (displacement or acceleration) to the acceleration
    _order = 0

    def __init__(
        self,
        amplitude: Number | None = None,
        direction: ArrayLike | None = None,
        coordinates: str = "relative",
        harmonic: int = 1,
        phase: Number = 0.0,
    ) -> None:
        super().__init__(direction)
        if coordinates not in ("relative", "absolute"):
            hint = suggest(str(coordinates), ("relative", "absolute"))
            raise InputError(f"{self.label}: coordinates must be 'relative' or 'absolute', not {coordinates!r}{hint}")
        self.coordinates = coordinates
        self._take(amplitude=amplitude, phase=phase)
        self.harmonic = self._read_harmonic(harmonic, 1)

    def components(self, n: int, matrices: Matrices) -> Components:
        mass, damping, stiffness, structural = matrices
        k, phase, given = self.harmonic, self.phase, f"({self.amplitude.text})"
        frequency = f"({k}*omega)"
        if self.coordinates == "relative":
            # -M r y''; a displacement has y'' = -(k omega)^2 y
            amplitude = f"-1.0 * {given}" if self._order == 0 else f"{given} * {frequency}**2"
            return self._along(mass, n, amplitude, k, phase)
        # y' = k omega amplitude cos(.. + pi / 2); an acceleration has y = -y'' / (k omega)^2
        shown = f"-1.0 * {given} / {frequency}**2" if self._order == 0 else given
        ahead = coefficient(f"({phase.text}) + (pi/2)")
        rate = self._along(damping, n, f"{shown} * {frequency}", k, ahead) + self._along(structural, n, shown, k, ahead)
        return self._along(stiffness, n, shown, k, phase) + rate

    def check_elements(self, n: int, elements: Sequence[Any]) -> None:
        """Refuse elements that would need the motion of the base."""
        if self.coordinates == "relative":
            return
        r = self.direction(n)
        for element in elements:
            felt = element.inputs(n)
            if np.any(np.abs(felt @ r) > 1e-12 * np.abs(felt).sum(axis=1)):
                raise InputError(
                    f"{self.label} in absolute coordinates: {element.label} acts between the structure and the base, "
                    'which moves; write the system in relative coordinates (coordinates="relative")'
                )


class BaseDisplacement(_Base):
    """A base that moves by `amplitude cos(harmonic omega t + phase)` along r = `direction` (default: all DOFs alike).

    `coordinates="relative"` (default): displacements are measured from the base, the load is `M r (harmonic omega)^2
    amplitude`. `"absolute"`: they are measured from a fixed frame, and what holds the structure to the ground, `K r`
    and `C r`, holds it to the base. Unit of `amplitude`: length.
    """

    _order = 2


class BaseAcceleration(_Base):
    """A base that is accelerated by `amplitude cos(harmonic omega t + phase)` along r = `direction`.

    Otherwise as `BaseDisplacement`; the load in relative coordinates is `-M r amplitude`. Unit of `amplitude`: length /
    time^2.
    """

    _order = 0
