"""Events along tracked curves that a change of the harmonics moves across a point."""

from __future__ import annotations

import math
from functools import cache

import pytest

import suboctave as so
from suboctave.continuation.linear import length
from suboctave.continuation.newton import NewtonOptions, correct
from suboctave.continuation.point import make_point
from suboctave.curves.sample import Sample
from suboctave.curves.tracked.events import events_between, nearest_point, same_discretisation, zero_along
from suboctave.curves.tracked.start import curve_through
from suboctave.curves.tracked.tests import CurveTest, Extremum, GeneralisedDoubling
from suboctave.harmonic.basis import HarmonicBasis

OPTIONS = NewtonOptions()
FEW, MANY = HarmonicBasis(15), HarmonicBasis(23)
TESTS = {"GPD": GeneralisedDoubling(), "extremum": Extremum("j")}
WAY = 0.01


@cache
def doublings():
    system = so.library.reference_oscillator(p=0.55, j=0.0, regularization=3e3)
    first = so.frequency_response(system, (4.5, 1.3)).bifurcations["PD"][0]
    return so.track(first, "j", (0.0, 1.0))


@cache
def located(kind, basis):
    """The event of a kind on the curve in a basis: its point."""
    item = next(e for e in doublings().bifurcations if e.kind == kind and e.parameter("j") > 0.16)
    start, u = curve_through(item, item.orbit.basis, ("omega", "j"), {"omega": (0.0, 3.0), "j": (0.0, 1.0)})
    curve = start.with_basis(basis)
    near = curve.transfer(u, start)
    point = nearest_point(curve, near, curve.weights(near, 0.0), OPTIONS)
    return zero_along(point, TESTS[kind].value, OPTIONS, WAY).point


def beside(point, way, heading, place):
    """The point so far along a curve from one of its points, heading up or down in omega."""
    along = point.tangent * math.copysign(1.0, heading * point.tangent[-2])
    row = point.weights * along
    solved = correct(point.curve, point.u + way * along, row / length(row), point.weights, OPTIONS)
    return Sample(make_point(solved, along, place))


@pytest.mark.parametrize("heading", [1.0, -1.0], ids=["up", "down"])
@pytest.mark.parametrize(("before", "after"), [(FEW, MANY), (MANY, FEW)], ids=["more harmonics", "fewer harmonics"])
@pytest.mark.parametrize("kind", TESTS)
def test_is_found_once(kind, before, after, heading):
    """A point lies behind an event in its own discretisation and before it in the next one's, or the other way round.

    If a step counted with the last one's discretisation alone, it would be found twice, or not at all.
    """
    test, own, later = TESTS[kind], located(kind, before), located(kind, after)
    shift = heading * float(later.u[-2] - own.u[-2]) / abs(float(later.tangent[-2]))
    first = beside(own, -WAY, heading, 0.0)
    middle = beside(own, 0.5 * shift, heading, WAY + 0.5 * shift)
    last = beside(later, WAY, heading, 2.0 * WAY + shift)
    again = same_discretisation(middle, last, OPTIONS)
    assert again is not middle
    assert test.value(middle) * test.value(again) < 0.0
    warnings = []
    found = events_between([first, middle], (test,), OPTIONS, warnings)
    found += events_between([middle, last], (test,), OPTIONS, warnings)
    assert warnings == []
    (item,) = found
    assert float(item.sample.point.u[-2]) == pytest.approx(float(own.u[-2]), abs=2.0 * abs(shift))
    assert item.sample.point.arclength == pytest.approx(WAY, abs=2.0 * abs(shift))


class Given(CurveTest):
    """A test whose value at a point is the point."""

    kind = "given"

    def value(self, sample):
        return sample


@pytest.mark.parametrize("odd", [True, False])
@pytest.mark.parametrize("ahead", [1.0, -1.0])
def test_an_exact_zero_at_the_start_is_an_event_of_one_direction(odd, ahead):
    """Turned round, a component of the tangent changes its sign, a zero too; what the motion gives does not."""
    turned = -1.0 if odd else 1.0
    forward = Given().changed(0.0, ahead)
    back = Given().changed(turned * 0.0, turned * -ahead)
    assert (forward, back).count(True) == 1
    # passed on the way it is met once
    assert [Given().changed(-ahead, 0.0), Given().changed(0.0, ahead)].count(True) == 1


def test_a_generalised_doubling_is_as_far_off_as_it_says():
    """Short contacts enter c3 by the third derivative: harmonics that do for the motion do not for its zero."""
    # with 127 to 255 harmonics
    known = [(2.155679737, 0.1506546186), (2.036400694, 0.1747234666)]
    found = doublings().bifurcations["GPD"]
    for item in found:
        omega, j = min(known, key=lambda one: abs(one[0] - item.omega))
        assert abs(item.parameter("j") - j) <= max(item.uncertainty, 3e-7)
        assert abs(item.omega - omega) < 1e-6
        assert item.uncertainty < 1e-5
    assert len(found) == 2
