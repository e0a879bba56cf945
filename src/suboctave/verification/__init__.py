"""Is it true: motions, branches and bifurcations against shooting in time."""

from suboctave.verification.motions import Verification
from suboctave.verification.result import BranchVerification, VerifiedBifurcation, VerifiedPoint
from suboctave.verification.verify import stability, verify

__all__ = [
    "BranchVerification",
    "Verification",
    "VerifiedBifurcation",
    "VerifiedPoint",
    "stability",
    "verify",
]
