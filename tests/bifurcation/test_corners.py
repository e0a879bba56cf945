"""Limit points in which a curve turns abruptly, of laws whose corners are no gap of one displacement."""

from __future__ import annotations

import numpy as np
import pytest
from slow import slow

import suboctave as so


@pytest.mark.parametrize("me", [0.07, 0.1])
def test_a_rotor_that_meets_its_stator_jumps_where_the_orbit_reaches_the_clearance(me):
    """Circular orbits: r sqrt((1 - w^2)^2 + (c w)^2) = me w^2, a closed form for w at r = clearance = 0.2, c = 0.1."""
    squares = np.roots([1.0 - (me / 0.2) ** 2, 0.1**2 - 2.0, 1.0])
    touch = np.sqrt(squares.max())
    curve = so.frequency_response(so.library.jeffcott_rotor(me=me), (2.5, touch - 0.1), harmonics=5)
    (fold,) = (b for b in curve.bifurcations["LP"] if abs(b.omega - touch) < 0.01)
    assert 0.0 < fold.uncertainty < 1e-7
    assert abs(fold.omega - touch) <= fold.uncertainty
    assert fold.amplitude == pytest.approx(0.2, rel=1e-6)
    assert fold.residual < 1e-9
    assert fold.normal_form is None
    at = np.searchsorted(curve.arclength, fold.arclength)
    assert curve.stable[at - 2]
    assert not curve.stable[at + 2]
    assert any("turns abruptly there, in a corner" in note for note in curve.warnings)
    assert not any("could not be located" in note for note in curve.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("omega", [(5.0, 0.7), *slow((0.4, 6.0))])
def test_a_rotor_that_whirls_into_its_stator_and_out_of_it(omega):
    """The whole curve: contact begins everywhere at once, the curve turns there at the upper of the two frequencies."""
    touch = np.sqrt(np.sort(np.roots([1.0 - (0.05 / 0.2) ** 2, 0.1**2 - 2.0, 1.0])))
    curve = so.frequency_response(so.library.jeffcott_rotor(), omega, harmonics=5)
    assert curve.ended.startswith("reached the end")
    assert abs(curve.omega[-1] - omega[1]) < 1e-12
    low, high = sorted(curve.bifurcations["grazing"], key=lambda event: event.omega)
    np.testing.assert_allclose([low.omega, high.omega], touch, rtol=1e-9)
    change = "begins to touch" if omega[1] > omega[0] else "ceases to touch"
    assert low.contact.change == change
    corner, fold = sorted(curve.bifurcations["LP"], key=lambda event: event.omega)
    assert abs(corner.omega - high.omega) <= corner.uncertainty < 1e-7
    assert fold.omega == pytest.approx(4.38510279, abs=1e-8)
    # as multipliers outside of the ring are those of the shaft alone
    exponents = np.roots([1.0, 0.1, 1.0])
    alone = np.exp(2.0 * np.pi * exponents / low.omega)
    np.testing.assert_allclose(np.sort(low.multipliers.imag), np.sort([*alone.imag, *alone.imag]), atol=1e-6)


def test_a_sharp_fold_of_a_smooth_law_is_no_corner():
    """As sharp as arctan steps of the stiffness make it: solved, not bracketed."""
    stop = so.ElasticStop(0, 200.0, 5.0, regularization=1e4)
    curve = so.frequency_response(so.System(1.0, 0.1, 1.0, [stop], [so.HarmonicLoad(0, 1.0)]), (1.3, 1.0), harmonics=9)
    assert curve.bifurcations["LP"]
    assert all(fold.uncertainty == 0.0 for fold in curve.bifurcations["LP"])
