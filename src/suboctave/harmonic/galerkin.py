"""Galerkin matrices of periodic functions in the bases of cosines and sines.

Between the functions of the integer basis (the mean, cosines and sines of tau, 2 tau, ..) or of the half-odd one (of
tau / 2, 3 tau / 2, ..) the matrix T(g) of the product with a periodic g depends on the Fourier coefficients of g at
sums and differences of frequencies only.
"""

from __future__ import annotations

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.basis import Array, ComplexArray

__all__ = ["add_galerkin", "galerkin", "toeplitz"]

_FIRST, _ONE = np.zeros(1, dtype=np.int64), np.ones(1)
_NO_SPECTRUM = np.zeros(0, dtype=complex)


@kernel()
def add_galerkin(out, stiffness, damping, rate, mean, count, rows, row_values, cols, col_values, n):
    """Add `T(f_u) + T(f_v) d/dt`, of `count` harmonics of the integer (mean) or half-odd basis, times the outer product
    of two sparse shapes over n DOFs to a real matrix.

    stiffness, damping: Fourier coefficients 0 .. top of f_u and f_v, the latter empty without velocity; rate: base
    frequency; rows, row_values, cols, col_values: where the shapes are not zero, and their entries there.
    """
    first = 0 if mean else 1
    # the mean has a cosine only: what follows it lies one place further to the left
    shift = 1 - first
    high = stiffness.shape[0] - 1
    moving = damping.shape[0] > 0
    spectra = np.empty((4, 2 * high + 1))
    # of all orders -high .. high, and seen through views: no index has to be asked for its sign
    for q in range(high + 1):
        spectra[0, high + q] = spectra[0, high - q] = stiffness[q].real
        spectra[1, high + q], spectra[1, high - q] = stiffness[q].imag, -stiffness[q].imag
        if moving:
            spectra[2, high + q] = spectra[2, high - q] = damping[q].real
            spectra[3, high + q], spectra[3, high - q] = damping[q].imag, -damping[q].imag
    lines = np.empty((2, count, 2))
    for i in range(count):
        # the orders j - i and i + j
        low, top = spectra[:, high - i :], spectra[:, high + i + first :]
        for j in range(count):
            gr, gi = low[0, j], -low[1, j]
            pr, pi = top[0, j], top[1, j]
            a = gr + pr
            b = gi - pi
            e = -gi - pi
            d = gr - pr
            if moving:
                # d/dt turns cos into -w sin and sin into w cos
                w = (j + 0.5 * first) * rate
                gr, gi = low[2, j], -low[3, j]
                pr, pi = top[2, j], top[3, j]
                a -= w * (gi - pi)
                b += w * (gr + pr)
                e -= w * (gr - pr)
                d += w * (-gi - pi)
            lines[0, j, 0], lines[0, j, 1] = a, b
            lines[1, j, 0], lines[1, j, 1] = e, d
        # the row of the mean holds halves, and has no sine beside it
        parts, half = (1, 0.5) if mean and i == 0 else (2, 1.0)
        row = max(0, 2 * i - shift)
        for s in range(rows.shape[0]):
            for t in range(cols.shape[0]):
                v = half * row_values[s] * col_values[t]
                for part in range(parts):
                    target, line = out[(row + part) * n + rows[s], cols[t] :], lines[part]
                    if mean:
                        target[0] += v * line[0, 0]
                    for j in range(shift, count):
                        target[(2 * j - shift) * n] += v * line[j, 0]
                        target[(2 * j - shift + 1) * n] += v * line[j, 1]


def galerkin(stiffness: np.ndarray, damping: np.ndarray, rate: float, mean: bool, count: int) -> Array:
    """`T(f_u) + T(f_v) d/dt` between all functions of `count` harmonics of the integer (mean) or half-odd basis."""
    size = 2 * count - (1 if mean else 0)
    out = np.zeros((size, size))
    add_galerkin(out, stiffness, damping, rate, mean, count, _FIRST, _ONE, _FIRST, _ONE, 1)
    return out


def toeplitz(spectrum: ComplexArray, harmonics: int) -> Array:
    """T(g) in the integer basis 0 .. H."""
    return galerkin(spectrum, _NO_SPECTRUM, 0.0, True, harmonics + 1)
