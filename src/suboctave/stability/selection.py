"""Which eigenvalues of Hill's problem are the characteristic exponents: by strip, and as the literature chooses.

Eigenvalues are in units of the base frequency, `exp(s tau) sum_k phi_k exp(i k tau)`: an exponent s appears again as
s + i, s - i, ... See `hill` for sources and for what fails.
"""

from __future__ import annotations

import numpy as np

from suboctave.harmonic.basis import Array, ComplexArray


def in_strip(values: ComplexArray, harmonics: int) -> tuple[np.ndarray, float]:
    """Indices of all eigenvalues in the strip between two cuts, and the width of the gap they are in (0 to 1).

    The cut is in the middle of the widest gap of `Im s mod 1`, seen in the inner half of the series, where eigenvalues
    are good. The caller must check that as many lie inside as there are exponents.
    """
    height = values.imag
    inner = height[np.abs(height) <= max(1.0, 0.5 * harmonics)]
    around = np.sort(np.mod(inner, 1.0))
    if not around.size:
        return np.zeros(0, dtype=int), 0.0
    gaps = np.diff(np.append(around, around[0] + 1.0))
    widest = int(np.argmax(gaps))
    cut = (around[widest] + 0.5 * gaps[widest]) % 1.0
    return np.flatnonzero((height > cut - 1.0) & (height <= cut)), float(gaps[widest])


def smallest_imaginary(values: ComplexArray, count: int) -> np.ndarray:
    """Moore (2005): the eigenvalues of smallest `|Im s|`."""
    return np.argsort(np.abs(values.imag), kind="stable")[:count]


def most_central(vectors: ComplexArray, count: int) -> np.ndarray:
    """Lazarus & Thomas (2010), in the form of Guillot et al. (2020), Eq. (26).

    The eigenvectors whose mean harmonic `|sum_k k |phi_k|| / sum_k |phi_k|` is smallest; vectors has shape (waves k =
    -H .. H, DOFs, eigenvalues).
    """
    weights = np.linalg.norm(vectors, axis=1)
    harmonic = np.arange(len(weights)) - len(weights) // 2
    return np.argsort(np.abs(harmonic @ weights) / weights.sum(axis=0), kind="stable")[:count]


def same_exponents(a: ComplexArray, b: ComplexArray) -> bool:
    """True if a has each of the exponents b once, up to shifts by i: each is the nearest of another one."""
    difference = a[:, None] - b[None, :]
    distance: Array = np.abs(difference - 1j * np.round(difference.imag))
    return len(a) == len(b) and sorted(distance.argmin(axis=1)) == list(range(len(b)))
