"""Searches over a design parameter: isolas and regimes."""

from suboctave.maps import files
from suboctave.maps.isolas.map import IsolaMap, isola_map
from suboctave.maps.isolas.result import Isola, Isolas
from suboctave.maps.isolas.verb import find_isolas
from suboctave.maps.regimes.map import RegimeMap
from suboctave.maps.regimes.verb import regime_map

__all__ = ["Isola", "IsolaMap", "Isolas", "RegimeMap", "files", "find_isolas", "isola_map", "regime_map"]
