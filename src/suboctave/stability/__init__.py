"""Is it stable: one solved motion in; Floquet multipliers, an error estimate and a verdict out."""

from suboctave.stability.monodromy import floquet_multipliers
from suboctave.stability.result import FloquetResult

__all__ = ["FloquetResult", "floquet_multipliers"]
