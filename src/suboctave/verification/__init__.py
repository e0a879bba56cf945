"""Is it true: motions, branches and bifurcations against shooting in time."""

from suboctave.verification.branch import verify
from suboctave.verification.motion import Verification, stability
from suboctave.verification.result import BranchVerification, VerifiedBifurcation, VerifiedPoint

__all__ = [
    "BranchVerification",
    "Verification",
    "VerifiedBifurcation",
    "VerifiedPoint",
    "stability",
    "verify",
]
