"""How a periodic motion is written: harmonic bases, the alternating frequency/time method, harmonic balance, orbits
as data.
"""

from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.selection import AdaptiveHarmonics
from suboctave.harmonic.state import BalanceState

__all__ = [
    "AdaptiveHarmonics",
    "BalanceState",
    "HarmonicBalance",
    "HarmonicBasis",
    "LinearPart",
    "PeriodicOrbit",
    "StructuralMatrices",
]
