"""Loads as harmonic coefficients: `amplitude cos(h omega t + phase)` with amplitude and phase free to depend on
omega.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from suboctave.errors import InputError
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis
from suboctave.model.system import System

#: what loads of unit amplitude make of the forces on the unknowns, differentiated by names: see `LinearPart.loaded`
Transfer = Callable[[tuple[str, ...]], ComplexArray | None]


class LoadSpectrum:
    """Coefficients (2 H + 1, size) of the external force and their derivatives with respect to omega and parameters.

    shapes: of every component what it does to the unknowns, (size,); None where these do not hold its direction.
    """

    def __init__(self, system: System, basis: HarmonicBasis, shapes: list[Array | None]) -> None:
        self.basis = basis
        self.components = list(zip(system.load_components(), shapes, strict=True))
        #: of those with a constant phase
        self._units = [_unit(c, {}) if c.phase.constant else None for c, _ in self.components]
        #: those that the unknowns do not hold
        self.elsewhere = [c for c, shape in self.components if shape is None]
        for component, _ in self.components:
            if component.harmonic * basis.nu > basis.harmonics:
                raise InputError(
                    f"a load at {component.harmonic} omega needs harmonics={component.harmonic} or more, "
                    f"the basis ends at {basis.harmonics / basis.nu:g} omega"
                )

    def waves(self, values: Mapping[str, float]) -> ComplexArray | None:
        """Complex amplitudes of the loads that the unknowns do not hold, (H + 1, loads); None without."""
        if not self.elsewhere:
            return None
        result = np.zeros((self.basis.harmonics + 1, len(self.elsewhere)), dtype=complex)
        for i, component in enumerate(self.elsewhere):
            result[component.harmonic * self.basis.nu, i] = _wave(component, values)
        return result

    def force(
        self, harmonic: int, values: Mapping[str, float], along: Array | int, names: tuple[str, ...] = ()
    ) -> complex:
        """Complex amplitude of the force at a multiple of omega along a direction (n,), or on a degree of freedom,
        differentiated as `value`.
        """
        waves = (
            _wave(c, values, names) * float(c.direction[along] if isinstance(along, int) else c.direction @ along)
            for c, _ in self.components
            if c.harmonic == harmonic and _touched(c, names)
        )
        return sum(waves, 0.0j)

    def strongest(self, harmonic: int, values: Mapping[str, float]) -> int:
        """The degree of freedom on which the force at a multiple of omega is largest; -1 without one."""
        forces = [_wave(c, values) * c.direction for c, _ in self.components if c.harmonic == harmonic]
        total = np.abs(np.sum(forces, axis=0)) if forces else np.zeros(1)
        return int(np.argmax(total)) if total.any() else -1

    def value(
        self, values: Mapping[str, float], size: int, names: tuple[str, ...] = (), transfer: Transfer | None = None
    ) -> Array:
        """Coefficients (2 H + 1, size), differentiated by each of `names` (at most two; "omega" is one of them)."""
        result, other = np.zeros((self.basis.size, size)), 0
        for (component, shape), unit in zip(self.components, self._units, strict=True):
            k = component.harmonic * self.basis.nu
            if shape is None:
                assert transfer is not None
                force = np.zeros(size, dtype=complex)
                for own, rest in _shared(names):
                    made = transfer(rest) if _touched(component, own) else None
                    if made is not None:
                        force += _wave(component, values, own) * made[k, :, other]
                other += 1
            elif not names:
                wave = component.amplitude.value(values) * (_unit(component, values) if unit is None else unit)
                force = wave * shape
            elif _touched(component, names):
                force = _wave(component, values, names) * shape
            else:
                continue
            # Re(wave exp(i k tau)) = Re(wave) cos - Im(wave) sin
            if k == 0:
                result[0] += force.real
            else:
                result[2 * k - 1] += force.real
                result[2 * k] -= force.imag
        return result


def _touched(component, names: tuple[str, ...]) -> bool:
    """Whether amplitude or phase depend on all of these."""
    touched: set[str] = component.amplitude.names | component.phase.names
    return touched.issuperset(names)


def _shared(names: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
    """What of a product is differentiated by what, by the product rule."""
    for chosen in itertools.product((True, False), repeat=len(names)):
        yield tuple(itertools.compress(names, chosen)), tuple(itertools.compress(names, (not one for one in chosen)))


def _unit(component, values: Mapping[str, float]) -> complex:
    """`exp(i phase)`."""
    angle = component.phase.value(values)
    return complex(math.cos(angle), math.sin(angle))


def _wave(component, values: Mapping[str, float], names: tuple[str, ...] = ()) -> complex:
    """`a exp(i phase)`, differentiated by two names at most (product and chain rule)."""
    unit, a, phi = _unit(component, values), component.amplitude, component.phase

    def d(coefficient, *by: str) -> float:
        for name in by:
            coefficient = coefficient.derivative(name)
        return coefficient.value(values)

    if not names:
        return unit * d(a)
    if len(names) == 1:
        (x,) = names
        return unit * (d(a, x) + (1j * d(a) * d(phi, x) if x in phi.names else 0.0))
    x, y = names
    total = d(a, x, y) + 1j * d(a) * d(phi, x, y) - d(a) * d(phi, x) * d(phi, y)
    total += sum(1j * d(a, p) * d(phi, q) for p, q in itertools.permutations((x, y)))
    return unit * total
