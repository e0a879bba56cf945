"""Where a response changes: limit points, branch points, period doublings, Neimark-Sacker points."""

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation, BifurcationList
from suboctave.bifurcation.gaps import GrazingContact
from suboctave.bifurcation.normal_form import NormalForm

__all__ = [
    "CONTACT_KINDS",
    "Bifurcation",
    "BifurcationList",
    "GrazingContact",
    "NormalForm",
]
