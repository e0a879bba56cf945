"""Perturbations of a motion as sums of waves `exp(i f tau)` on consecutive frequencies f, in any shift.

A perturbation with the motion's period lives on whole f, one of twice the period on half-odd ones, one with Floquet
exponent `i kappa` on `m + kappa / w0`. Products of them live on sums of their frequencies, so that the second and third
derivatives of the equations take waves in and give waves out, whatever the shifts (`harmonic.third`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState


@dataclass(frozen=True)
class Frequencies:
    """`count` consecutive frequencies from `lowest` on, in units of the base frequency."""

    lowest: float
    count: int

    @classmethod
    def of(cls, state: BalanceState, kind: Kind, kappa: float = 0.0) -> Frequencies:
        """Those of the operator J_kappa; kappa in rad per time, for Kind.FREE."""
        high = state.basis.harmonics
        if kind is Kind.HALF:
            return cls(-high - 0.5, 2 * high + 2)
        return cls(-high + (kappa / state.rate if kind is Kind.FREE else 0.0), 2 * high + 1)

    @cached_property
    def values(self) -> Array:
        """All of them, shape (count,)."""
        return np.asarray(self.lowest + np.arange(self.count), dtype=float)


@dataclass(frozen=True)
class Waves:
    """`sum_f amplitudes_f exp(i f tau)`; amplitudes (F, size)."""

    amplitudes: ComplexArray
    at: Frequencies

    @classmethod
    def of(cls, state: BalanceState, kind: Kind, vector: np.ndarray, kappa: float = 0.0) -> Waves:
        """A vector of the basis of J_kappa: real coefficients of cosines and sines, or complex amplitudes."""
        shaped = np.asarray(vector).reshape(-1, state.balance.size)
        at = Frequencies.of(state, kind, kappa)
        if kind is Kind.FREE:
            return cls(shaped.astype(complex), at)
        if kind is Kind.HALF:
            positive = 0.5 * (shaped[::2] - 1j * shaped[1::2])
            return cls(np.concatenate((positive[::-1].conj(), positive)), at)
        positive = 0.5 * (shaped[1::2] - 1j * shaped[2::2])
        return cls(np.concatenate((positive[::-1].conj(), shaped[:1].astype(complex), positive)), at)

    @cached_property
    def conjugate(self) -> Waves:
        """The complex conjugate as a function of time."""
        return Waves(self.amplitudes[::-1].conj(), Frequencies(-self.at.values[-1], self.at.count))

    @cached_property
    def slope(self) -> Waves:
        """The derivative with respect to tau."""
        return Waves(1j * self.at.values[:, None] * self.amplitudes, self.at)

    def vector(self, kind: Kind) -> np.ndarray:
        """As a vector of the operator's basis, flattened; of a real function for the two real kinds."""
        if kind is Kind.FREE:
            return self.amplitudes.ravel()
        middle = self.at.count // 2
        if kind is Kind.HALF:
            positive = 2.0 * self.amplitudes[middle:]
            out = np.empty((2 * len(positive), positive.shape[1]))
            out[::2], out[1::2] = positive.real, -positive.imag
            return out.ravel()
        positive = 2.0 * self.amplitudes[middle + 1 :]
        out = np.empty((2 * len(positive) + 1, positive.shape[1]))
        out[0], out[1::2], out[2::2] = self.amplitudes[middle].real, positive.real, -positive.imag
        return out.ravel()
