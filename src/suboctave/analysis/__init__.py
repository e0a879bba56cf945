"""What a user calls: response curves, curves along any parameter, stability and verification of single motions."""

from suboctave.analysis.attractors import Attractor
from suboctave.analysis.basin_attractors import BasinAttractor
from suboctave.analysis.basins import Basins, basins
from suboctave.analysis.branch import Branch, BranchPoint
from suboctave.analysis.branch_verification import BranchVerification, VerifiedBifurcation, VerifiedPoint
from suboctave.analysis.brute_force import BruteForceDiagram, brute_force_diagram
from suboctave.analysis.diagram import BifurcationDiagram, bifurcation_diagram
from suboctave.analysis.extremum import locate_extremum
from suboctave.analysis.integration import Trajectory, integrate
from suboctave.analysis.isola import Isola
from suboctave.analysis.isola_map import isola_map
from suboctave.analysis.isola_region import IsolaMap
from suboctave.analysis.isolas import find_isolas
from suboctave.analysis.isolas_found import Isolas
from suboctave.analysis.lyapunov import LyapunovExponents, lyapunov_exponents
from suboctave.analysis.lyapunov_map import LyapunovMap, lyapunov_map
from suboctave.analysis.measured import Measured, read_measured
from suboctave.analysis.poincare import PoincareSections, poincare_sections
from suboctave.analysis.regime_map import RegimeMap
from suboctave.analysis.regimes import regime_map
from suboctave.analysis.results import Results, Table, load
from suboctave.analysis.stepped_result import SteppedSine
from suboctave.analysis.stepped_sine import stepped_sine
from suboctave.analysis.subharmonics import Seeds, find_subharmonics, periodic_orbit
from suboctave.analysis.switching import switch_branch
from suboctave.analysis.track import track
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.analysis.two_trajectories import Separation, TwoTrajectories
from suboctave.analysis.verbs import continue_branch, frequency_response
from suboctave.analysis.verification import Verification, stability, verify

__all__ = [
    "Attractor",
    "BasinAttractor",
    "Basins",
    "BifurcationDiagram",
    "Branch",
    "BranchPoint",
    "BranchVerification",
    "BruteForceDiagram",
    "Isola",
    "IsolaMap",
    "Isolas",
    "LyapunovExponents",
    "LyapunovMap",
    "Measured",
    "PoincareSections",
    "RegimeMap",
    "Results",
    "Seeds",
    "Separation",
    "SteppedSine",
    "Table",
    "TrackedBranch",
    "Trajectory",
    "TwoTrajectories",
    "Verification",
    "VerifiedBifurcation",
    "VerifiedPoint",
    "basins",
    "bifurcation_diagram",
    "brute_force_diagram",
    "continue_branch",
    "find_isolas",
    "find_subharmonics",
    "frequency_response",
    "integrate",
    "isola_map",
    "load",
    "locate_extremum",
    "lyapunov_exponents",
    "lyapunov_map",
    "periodic_orbit",
    "poincare_sections",
    "read_measured",
    "regime_map",
    "stability",
    "stepped_sine",
    "switch_branch",
    "track",
    "verify",
]
