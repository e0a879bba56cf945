"""Events along curves of bifurcations as users get them."""

from __future__ import annotations

from suboctave.bifurcation.contact import GrazingContact
from suboctave.bifurcation.gaps import levels
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.curves.kinds.extremum import LimitPointExtremal
from suboctave.curves.kinds.grazing import GrazingEquations
from suboctave.curves.kinds.singular import SingularOperator
from suboctave.curves.sample import Sample
from suboctave.curves.tracked_events import Found
from suboctave.curves.tracked_tests import Extremum
from suboctave.floquet import StabilityMethod


def as_event(found: Found, method: StabilityMethod, observe: int) -> TrackedEvent:
    """An event as users get it; `observe`: the DOF whose amplitude is reported."""
    sample = found.sample
    curve, orbit = sample.curve, sample.orbit
    name = getattr(found.test, "name", curve.names[1])
    return TrackedEvent(
        found.test.kind,
        orbit,
        method.along(sample.state),
        orbit.residual,
        orbit.amplitude(observe),
        name,
        sample.vectors,
        sample.kappa,
        arclength=sample.point.arclength,
        # a parameter changes by no more than its range along a unit of arclength
        uncertainty=found.off * curve.spans[curve.names.index(name)],
        curve=curve.augmentation.name,
        names=curve.names,
        extreme=found.extreme,
        contact=_contact(sample),
        isola=_isola(found),
        turning=curve.augmentation.turning,
    )


def _contact(sample: Sample) -> GrazingContact | None:
    """What grazes along a curve of grazings."""
    equations = sample.evaluation.equations.own
    if not isinstance(equations, GrazingEquations):
        return None
    state, of = sample.state, equations.of
    local = state.local(of.element)
    time = sample.instant_or_frequency / state.rate
    value = float(sample.point.u[-1])
    return GrazingContact(of.element, local.element.label, levels(local)[of.index], time, "", value)


def _isola(found: Found) -> str:
    """What happens to branches at an extremum along a curve of limit points."""
    curve, sample = found.sample.curve, found.sample
    if not isinstance(found.test, Extremum) or curve.augmentation.name != "LP" or curve.augmentation.turning:
        return ""
    (beside,) = set(curve.names) - {found.test.name}
    base = curve.augmentation
    assert isinstance(base, SingularOperator)
    extremal = LimitPointExtremal(base, beside, 1.0, found.test.name)
    equations = extremal.at(sample.state, sample.evaluation.extra, curve.names)
    return equations.isola


__all__ = ["as_event"]
