"""What a user calls: response curves, curves along any parameter, stability and verification of single motions."""

from suboctave.analysis.branch import Branch, BranchPoint
from suboctave.analysis.results import Results, Table, load
from suboctave.analysis.track import track
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.analysis.verbs import continue_branch, frequency_response
from suboctave.analysis.verification import Verification, stability, verify

__all__ = [
    "Branch",
    "BranchPoint",
    "Results",
    "Table",
    "TrackedBranch",
    "Verification",
    "continue_branch",
    "frequency_response",
    "load",
    "stability",
    "track",
    "verify",
]
