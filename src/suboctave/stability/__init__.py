"""Is it stable: one solved motion in; Floquet multipliers, an error estimate and a verdict out."""

from suboctave.stability.arbitration import Arbitration, method_of
from suboctave.stability.methods import Hill, KoopmanHill, Monodromy, StabilityMethod
from suboctave.stability.monodromy import floquet_multipliers
from suboctave.stability.result import FloquetResult

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
