"""Perturbations of a motion as sums of waves `exp(i f tau)` on consecutive frequencies f, in any shift.

A perturbation with the motion's period lives on whole f, one of twice the period on half-odd ones, one with Floquet
exponent `i kappa` on `m + kappa / w0`. Products of them live on sums of their frequencies, so that the second and third
derivatives of the equations take waves in and give waves out, whatever the shifts (`harmonic.derivatives`).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.trigonometric import spectra
from suboctave.lazy import lazy

__all__ = ["Frequencies", "Kind", "Waves", "fourier"]


class Kind(Enum):
    """Which shift of the frequencies: none, half the base frequency, or any."""

    INTEGER = 0
    HALF = 1
    FREE = 2


@dataclass(frozen=True)
class Frequencies:
    """`count` consecutive frequencies from `lowest` on, in units of the base frequency."""

    lowest: complex
    count: int

    @classmethod
    def of(cls, state: BalanceState, kind: Kind, kappa: complex = 0.0) -> Frequencies:
        """Those of the operator J_kappa; kappa in rad per time, for Kind.FREE, complex where perturbations grow."""
        high = state.basis.harmonics
        if kind is Kind.HALF:
            return _frequencies(-high - 0.5, 2 * high + 2)
        return _frequencies(-high + (kappa / state.rate if kind is Kind.FREE else 0.0), 2 * high + 1)

    @lazy
    def values(self) -> NDArray[Any]:
        """All of them, shape (count,)."""
        values: NDArray[Any] = self.lowest + np.arange(self.count, dtype=float)
        return values


@lru_cache(maxsize=256)
def _frequencies(lowest: complex, count: int) -> Frequencies:
    """The same object for the same frequencies, which keeps their values."""
    return Frequencies(lowest, count)


@dataclass(frozen=True)
class Waves:
    """`sum_f amplitudes_f exp(i f tau)`; amplitudes (F, size)."""

    amplitudes: ComplexArray
    at: Frequencies

    @classmethod
    def of(cls, state: BalanceState, kind: Kind, vector: np.ndarray, kappa: complex = 0.0, left: bool = False) -> Waves:
        """A vector of the basis of J_kappa: real coefficients of cosines and sines, or complex amplitudes.

        Left vectors are scaled such that `left^H J_kappa right` is the same number in both notations.
        """
        shaped = vector.reshape(-1, state.balance.size)
        return cls(as_waves(shaped, kind, left), Frequencies.of(state, kind, kappa))

    @lazy
    def conjugate(self) -> Waves:
        """The complex conjugate as a function of time."""
        return Waves(self.amplitudes[::-1].conj(), Frequencies(-self.at.values[-1], self.at.count))

    @lazy
    def slope(self) -> Waves:
        """The derivative with respect to tau."""
        return Waves(1j * self.at.values[:, None] * self.amplitudes, self.at)

    def vector(self, kind: Kind) -> np.ndarray:
        """As a vector of the operator's basis, flattened; of a real function for the two real kinds."""
        if kind is Kind.FREE:
            return self.amplitudes.ravel()
        middle = self.at.count // 2
        positive = 2.0 * self.amplitudes[middle + (kind is Kind.INTEGER) :]
        rows = np.empty((2 * len(positive), positive.shape[1]))
        rows[::2], rows[1::2] = positive.real, -positive.imag
        if kind is Kind.INTEGER:
            rows = np.concatenate((self.amplitudes[middle : middle + 1].real, rows))
        return rows.ravel()


def as_waves(shaped: np.ndarray, kind: Kind, left: bool) -> ComplexArray:
    """Amplitudes (F, size) of rows of the operator's basis, frequencies ascending."""
    if kind is Kind.FREE:
        return shaped.astype(complex)
    mean = kind is Kind.INTEGER
    count = len(shaped) // 2
    scale, waves = 1.0 if left else 0.5, np.empty((2 * count + mean, shaped.shape[1]), dtype=complex)
    real, imaginary = waves.real, waves.imag
    np.multiply(shaped[mean::2], scale, out=real[count + mean :])
    np.multiply(shaped[mean + 1 :: 2], -scale, out=imaginary[count + mean :])
    real[:count], imaginary[:count] = real[: -count - 1 : -1], -imaginary[: -count - 1 : -1]
    if mean:
        waves[count] = shaped[0]
    return waves


def fourier(values: np.ndarray, weights: Array, zr: Array, zi: Array, top: int) -> ComplexArray:
    """`1/(2 pi) sum_j weights_j values[.., j] z_j^-k`, k = 0 .. top, of complex functions (R, N) at instants."""
    if not np.iscomplexobj(values):
        real: ComplexArray = spectra(np.ascontiguousarray(values), weights, zr, zi, top)
        return real
    both = spectra(np.concatenate((values.real, values.imag)), weights, zr, zi, top)
    whole: ComplexArray = both[: len(values)] + 1j * both[len(values) :]
    return whole
