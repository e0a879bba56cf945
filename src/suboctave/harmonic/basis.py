"""Harmonic bases: which frequencies a periodic motion is written with.

A motion of period `nu * 2 pi / omega` is

    x(t) = a_0 + sum_k a_k cos(k tau) + b_k sin(k tau),    tau = omega t / nu,

with `nu = 1` for a response at the period of the load, `nu = 2` after one period doubling, and so on. Its
coefficients are stored harmonic by harmonic, `X = (a_0, a_1, b_1, a_2, b_2, ...)`, each entry of length n (the number
of unknown DOFs).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.arguments import Count, checked
from suboctave.errors import InputError, is_number, shortened

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def harmonic_index(k: float, nu: int) -> int:
    """Which multiple of `omega / nu` the frequency `k omega` is, for motions of nu load periods.

    Raises
    ------
    InputError
        If it is none of them, with the nearest that is.
    """
    if not is_number(k):
        raise InputError(f"k must be a multiple of omega, not {shortened(k)}")
    index = k * nu
    if math.isfinite(index) and index > -1e-9 and abs(index - round(index)) <= 1e-9:
        return round(index)
    of, has = ("T", "whole multiples of omega") if nu == 1 else (f"{nu}T", f"multiples of omega/{nu}")
    near = f": did you mean {max(round(index), 0)}/{nu}?" if nu > 1 and math.isfinite(index) else ""
    raise InputError(f"k={k:g} is no harmonic of a motion of period {of}, which has {has}{near}")


@checked(methods=False)
@dataclass(frozen=True, repr=False)
class HarmonicBasis:
    """Harmonics `0 .. harmonics` of the base frequency `omega / nu`.

    Parameters
    ----------
    harmonics
        Highest multiple of the base frequency, at least 1.
    nu
        Period of the motion in periods of the load, at least 1.

    Raises
    ------
    InputError
        If one of them is not a positive whole number.
    """

    harmonics: Count
    nu: Count = 1

    @cached_property
    def size(self) -> int:
        """Number of basis functions, `2 H + 1`: the length of coefficients."""
        return 2 * self.harmonics + 1

    @cached_property
    def multiples(self) -> Array:
        """Frequencies in units of omega, `k / nu` for `k = 0 .. H`; shape (H + 1,)."""
        return np.arange(self.harmonics + 1) / self.nu

    @cached_property
    def half_multiples(self) -> Array:
        """Frequencies of the half-odd basis in units of omega, `(k + 1/2) / nu`, `k = 0 .. H`; shape (H + 1,)."""
        return (np.arange(self.harmonics + 1) + 0.5) / self.nu

    def derivative(self, coefficients: Array) -> Array:
        """Apply `D`, the derivative with respect to `omega t`, to coefficients of shape (2 H + 1, ...)."""
        factor = self.multiples[1:].reshape((-1,) + (1,) * (coefficients.ndim - 1))
        result = np.zeros_like(coefficients)
        result[1::2] = factor * coefficients[2::2]
        result[2::2] = -factor * coefficients[1::2]
        return result

    def resized(self, coefficients: Array, other: HarmonicBasis) -> Array:
        """Coefficients (2 H + 1, ...) of this basis in `other`: padded with zeros, truncated, or re-based to a
        multiple of nu.
        """
        if other.nu % self.nu:
            raise InputError(f"a motion of {self.nu} load periods cannot be written in a basis of {other.nu} of them")
        stride = other.nu // self.nu
        result = np.zeros((other.size,) + coefficients.shape[1:])
        result[0] = coefficients[0]
        kept = min(self.harmonics, other.harmonics // stride)
        index = stride * np.arange(1, kept + 1)
        result[2 * index - 1] = coefficients[1 : 2 * kept : 2]
        result[2 * index] = coefficients[2 : 2 * kept + 1 : 2]
        return result

    @property
    def doubled(self) -> HarmonicBasis:
        """The basis of twice the period with the same highest frequency."""
        return HarmonicBasis(2 * self.harmonics, 2 * self.nu)

    @property
    def halved(self) -> HarmonicBasis:
        """The basis of half the period, nu being even, with the same highest frequency."""
        if self.nu % 2:
            raise InputError(f"{self.nu} load periods have no half")
        return HarmonicBasis(max(1, self.harmonics // 2), self.nu // 2)

    def even_part(self, coefficients: Array) -> Array:
        """The even harmonics of coefficients (2 H + 1, ...) in the basis `halved`: a motion of half the period."""
        half = self.halved
        result = np.zeros((half.size,) + coefficients.shape[1:])
        result[0] = coefficients[0]
        # cosines and sines of the harmonics 2, 4, ...; of one harmonic nothing is even
        result[1::2] = coefficients[3::4][: half.harmonics] if self.harmonics > 1 else 0.0
        result[2::2] = coefficients[4::4][: half.harmonics] if self.harmonics > 1 else 0.0
        return result

    def __repr__(self) -> str:
        return f"HarmonicBasis(harmonics={self.harmonics}, nu={self.nu})"


def to_complex(coefficients: NDArray[Any]) -> ComplexArray:
    """Real coefficients (2 H + 1, ...) to complex ones (H + 1, ...): `x = Re sum_k c_k exp(i k tau)`, `c_k = a_k - i
    b_k`.
    """
    result = np.empty((coefficients.shape[0] // 2 + 1,) + coefficients.shape[1:], dtype=complex)
    result[0] = coefficients[0]
    result.real[1:] = coefficients[1::2]
    np.negative(coefficients[2::2], out=result.imag[1:])
    return result


def to_real(amplitudes: ComplexArray) -> Array:
    """Complex amplitudes (H + 1, ...) to real coefficients (2 H + 1, ...), as `to_complex` reads them."""
    result = np.empty((2 * amplitudes.shape[0] - 1,) + amplitudes.shape[1:])
    result[0], result[1::2], result[2::2] = amplitudes[0].real, amplitudes[1:].real, -amplitudes[1:].imag
    return result


def spectrum_to_real(spectrum: ComplexArray, harmonics: int) -> Array:
    """Fourier coefficients `g_q = mean(g exp(-i q tau))` to real ones `(a_0, a_1, b_1, ...)` up to `harmonics`; first
    axis.
    """
    result = np.empty((2 * harmonics + 1,) + spectrum.shape[1:])
    result[0] = spectrum[0].real
    result[1::2] = 2.0 * spectrum[1 : harmonics + 1].real
    result[2::2] = -2.0 * spectrum[1 : harmonics + 1].imag
    return result
