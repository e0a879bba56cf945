"""Where a response changes: limit points, branch points, period doublings, Neimark-Sacker points."""

from suboctave.bifurcation.bifurcation import KINDS, Bifurcation, BifurcationList
from suboctave.bifurcation.kinds import ALL_KINDS, BifurcationKind, Sample

__all__ = ["ALL_KINDS", "KINDS", "Bifurcation", "BifurcationKind", "BifurcationList", "Sample"]
