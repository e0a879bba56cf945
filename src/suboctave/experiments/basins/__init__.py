"""Basins of attraction."""

from suboctave.experiments.basins.attractors import BasinAttractor
from suboctave.experiments.basins.verb import Basins, basins

__all__ = ["BasinAttractor", "Basins", "basins"]
