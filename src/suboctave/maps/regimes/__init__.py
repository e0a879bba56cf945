"""Which stable motions coexist over frequency and a parameter."""

from suboctave.maps.regimes import files
from suboctave.maps.regimes.map import RegimeMap
from suboctave.maps.regimes.verb import regime_map

__all__ = ["RegimeMap", "files", "regime_map"]
