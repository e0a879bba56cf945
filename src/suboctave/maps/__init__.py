"""Searches over a design parameter: isolas and regimes."""

from suboctave.maps.isolas import Isola, IsolaMap, Isolas, find_isolas, isola_map
from suboctave.maps.regimes import RegimeMap, regime_map

__all__ = ["Isola", "IsolaMap", "Isolas", "RegimeMap", "find_isolas", "isola_map", "regime_map"]
