"""Is it stable: one solved motion in; Floquet multipliers, an error estimate and a verdict out."""

from suboctave.floquet.methods import Arbitration, Hill, KoopmanHill, Monodromy, StabilityMethod, method_of
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.result import FloquetResult

__all__ = [
    "Arbitration",
    "FloquetResult",
    "Hill",
    "KoopmanHill",
    "Monodromy",
    "StabilityMethod",
    "floquet_multipliers",
    "method_of",
]
