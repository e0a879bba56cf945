"""Isolas: found, mapped over a second parameter, tabulated."""

from suboctave.maps.isolas import files
from suboctave.maps.isolas.map import isola_map
from suboctave.maps.isolas.region import IsolaMap
from suboctave.maps.isolas.result import Isola, Isolas
from suboctave.maps.isolas.verb import find_isolas

__all__ = ["Isola", "IsolaMap", "Isolas", "files", "find_isolas", "isola_map"]
