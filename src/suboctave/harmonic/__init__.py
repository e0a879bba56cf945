"""How a periodic motion is written: harmonic bases, the alternating frequency/time method, harmonic balance, orbits
as data.
"""

from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.truncation import AdaptiveHarmonics

__all__ = [
    "AdaptiveHarmonics",
    "BalanceState",
    "HarmonicBalance",
    "HarmonicBasis",
    "LinearPart",
    "PeriodicOrbit",
    "StructuralMatrices",
]
