"""Large structures in time: which basis replaces all of their degrees of freedom."""

from suboctave.harmonic.reduction import COMPLETE
from suboctave.projection.in_time import HARMONICS, in_basis, small_system, system_of_motions

__all__ = ["COMPLETE", "HARMONICS", "in_basis", "small_system", "system_of_motions"]
