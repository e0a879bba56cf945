"""Does a damping take energy out? Asked once, when a system is made: a wrong sign, or self-excitation that is meant.

The power that `C` takes from a motion is `v . C v`, which its symmetric part S alone decides. S is judged after scaling
by the diagonal of the mass, `S_ij / sqrt(M_ii M_jj)`, so that units do not matter; gyroscopic parts are skew and count
for nothing.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from suboctave.errors import NegativeDampingWarning

__all__ = ["check_damping", "warn_of_negative"]

_DENSE = 600  # degrees of freedom up to which eigenvalues are cheap; beyond, the diagonal is looked at
#: share of the largest eigenvalue below which a negative one is rounding
_ROUNDING = 1e-9


def check_damping(damping: Any, mass_diagonal: Any) -> None:
    """Warn (`NegativeDampingWarning`) of a damping (n, n), dense or sparse, that feeds energy into some motion."""
    scale = 1.0 / np.sqrt(np.asarray(mass_diagonal, dtype=float))
    if damping.shape[0] > _DENSE:
        values = np.asarray(damping.diagonal(), dtype=float) * scale**2
    else:
        dense = damping if isinstance(damping, np.ndarray) else damping.toarray()
        with np.errstate(over="ignore", invalid="ignore"):
            scaled = 0.5 * (dense + dense.T) * scale[:, None] * scale
        values = np.linalg.eigvalsh(scaled) if np.isfinite(scaled).all() else np.zeros(1)
    if values.min() < -_ROUNDING * np.abs(values).max():
        warn_of_negative("the damping matrix feeds energy into some motions")


def warn_of_negative(what: str) -> None:
    """Say that something is damped negatively, and how to say that it is meant."""
    warnings.warn(
        f"{what}: they grow until another force limits them. If this self-excitation is meant, silence the warning "
        "with warnings.simplefilter('ignore', suboctave.NegativeDampingWarning); else change the sign",
        NegativeDampingWarning,
        stacklevel=5,  # the line that makes the system
    )
