"""Verbs that give curves: responses, curves along any parameter, switched branches, tracked bifurcations, diagrams."""

from suboctave.analysis.diagram import bifurcation_diagram
from suboctave.analysis.frequency_response import continue_branch, frequency_response
from suboctave.analysis.locate_extremum import locate_extremum
from suboctave.analysis.subharmonics import Seeds, find_subharmonics, periodic_orbit
from suboctave.analysis.switching import switch_branch
from suboctave.analysis.track import track

__all__ = [
    "Seeds",
    "bifurcation_diagram",
    "continue_branch",
    "find_subharmonics",
    "frequency_response",
    "locate_extremum",
    "periodic_orbit",
    "switch_branch",
    "track",
]
