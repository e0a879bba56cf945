"""Is it true: motions, branches and bifurcations against shooting in time."""

from suboctave.verification.result import BranchVerification, VerifiedBifurcation, VerifiedPoint
from suboctave.verification.verify import Verification, stability, verify

__all__ = [
    "BranchVerification",
    "Verification",
    "VerifiedBifurcation",
    "VerifiedPoint",
    "stability",
    "verify",
]
