"""Is it stable: one solved motion in; Floquet multipliers, an error estimate and a verdict out."""

from suboctave.stability.monodromy import FloquetResult, floquet_multipliers

__all__ = ["FloquetResult", "floquet_multipliers"]
