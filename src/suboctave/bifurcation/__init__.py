"""Where a response changes: limit points, branch points, period doublings, Neimark-Sacker points."""

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, KINDS, Bifurcation, BifurcationList
from suboctave.bifurcation.contact import GrazingContact
from suboctave.bifurcation.formulation import (
    Alcorta2019,
    BorderedSystem,
    ExtendedSystem,
    Formulation,
    formulation_of,
)
from suboctave.bifurcation.kinds import ALL_KINDS, BifurcationKind, Sample
from suboctave.bifurcation.normal_form import NormalForm

__all__ = [
    "ALL_KINDS",
    "CONTACT_KINDS",
    "KINDS",
    "Alcorta2019",
    "Bifurcation",
    "BifurcationKind",
    "BifurcationList",
    "BorderedSystem",
    "ExtendedSystem",
    "Formulation",
    "GrazingContact",
    "NormalForm",
    "Sample",
    "formulation_of",
]
