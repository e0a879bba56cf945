"""Is it true: motions, branches and bifurcations against shooting in time."""

from suboctave.verification import files
from suboctave.verification.motion import Verification, stability
from suboctave.verification.result import BranchVerification, VerifiedBifurcation, VerifiedPoint
from suboctave.verification.verify import verify

__all__ = [
    "BranchVerification",
    "Verification",
    "VerifiedBifurcation",
    "VerifiedPoint",
    "files",
    "stability",
    "verify",
]
