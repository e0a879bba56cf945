"""Loads as harmonic coefficients: `amplitude cos(h omega t + phase)` with amplitude and phase free to depend on
omega.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import numpy as np

from suboctave.errors import InputError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.model.system import System


class LoadSpectrum:
    """Coefficients (2 H + 1, n) of the external force and their derivatives with respect to omega and parameters."""

    def __init__(self, system: System, basis: HarmonicBasis, shapes: list[Array]) -> None:
        self.basis = basis
        self.components = list(zip(system.load_components(), shapes, strict=True))
        #: of those with a constant phase
        self._units = [_unit(c, {}) if c.phase.constant else None for c, _ in self.components]
        for component, _ in self.components:
            if component.harmonic * basis.nu > basis.harmonics:
                raise InputError(
                    f"a load at {component.harmonic} omega needs harmonics={component.harmonic} or more, "
                    f"the basis ends at {basis.harmonics / basis.nu:g} omega"
                )

    def value(self, values: Mapping[str, float], size: int, names: tuple[str, ...] = ()) -> Array:
        """Coefficients (2 H + 1, size), differentiated by each of `names` (at most two; "omega" is one of them)."""
        result = np.zeros((self.basis.size, size))
        for (component, shape), unit in zip(self.components, self._units, strict=True):
            if not names:
                wave = component.amplitude.value(values) * (_unit(component, values) if unit is None else unit)
            else:
                touched = component.amplitude.names | component.phase.names
                if not touched.issuperset(names):
                    continue
                wave = _wave_derivative(component, values, names)
            k = component.harmonic * self.basis.nu
            # Re(wave exp(i k tau)) = Re(wave) cos - Im(wave) sin
            if k == 0:
                result[0] += wave.real * shape
            else:
                result[2 * k - 1] += wave.real * shape
                if wave.imag != 0.0:
                    result[2 * k] -= wave.imag * shape
        return result


def _unit(component, values: Mapping[str, float]) -> complex:
    """`exp(i phase)`."""
    angle = component.phase.value(values)
    return complex(math.cos(angle), math.sin(angle))


def _wave_derivative(component, values: Mapping[str, float], names: tuple[str, ...]) -> complex:
    """Derivative of `a exp(i phase)` by one or two names (product and chain rule)."""
    unit, a, phi = _unit(component, values), component.amplitude, component.phase

    def d(coefficient, *by: str) -> float:
        for name in by:
            coefficient = coefficient.derivative(name)
        return coefficient.value(values)

    if len(names) == 1:
        (x,) = names
        return unit * (d(a, x) + (1j * d(a) * d(phi, x) if x in phi.names else 0.0))
    x, y = names
    total = d(a, x, y) + 1j * d(a) * d(phi, x, y) - d(a) * d(phi, x) * d(phi, y)
    total += sum(1j * d(a, p) * d(phi, q) for p, q in itertools.permutations((x, y)))
    return unit * total
