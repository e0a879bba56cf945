"""Normal forms of bifurcations: coefficients and criticality."""

from suboctave.bifurcation.normal_form.normal_form import FORMS, normal_form
from suboctave.bifurcation.normal_form.terms import NormalForm

__all__ = ["FORMS", "NormalForm", "normal_form"]
