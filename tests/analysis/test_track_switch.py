"""From a generalised period doubling onto the limit points of the doubled motions, against shooting."""

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError


@pytest.fixture(scope="module")
def border():
    system = so.library.reference_oscillator(p=0.55, regularization=3000.0)
    response = so.frequency_response(system, (4.5, 1.3))
    return so.track(response.bifurcations["PD"][0], "j", (0, 1))


def test_the_limit_points_that_leave_a_generalised_period_doubling(border):
    """They end on the border, and lead over the merging point and the cusp to the isola's centre and to j = 0."""
    event = border.bifurcations["GPD"][1]
    curve = so.track(event, "j", (0, 1))
    assert curve.kind == "LP"
    assert curve.orbits[-1].basis.nu == 2
    np.testing.assert_allclose(
        [curve.omega[0], curve.parameter("j")[0]], [event.omega, event.parameter("j")], atol=1e-5
    )
    merging, centre = (e for e in curve.extrema if e.parameter_name == "j")
    np.testing.assert_allclose([merging.omega, merging.parameter("j")], [2.023364, 0.176829], atol=1e-5)
    np.testing.assert_allclose([centre.omega, centre.parameter("j")], [2.355660, 0.579889], atol=1e-5)
    (cusp,) = curve.bifurcations["CP"]
    np.testing.assert_allclose([cusp.omega, cusp.parameter("j")], [2.022540, 0.176778], atol=1e-5)
    assert curve.omega[-1] == pytest.approx(3.14017686, abs=1e-5)


def test_the_other_one_leads_to_the_other_limit_points(border):
    curve = so.track(border.bifurcations["GPD"][0], "j", (0, 1))
    ends = sorted([curve.parameter("j")[0], curve.parameter("j")[-1]])
    assert ends[0] == pytest.approx(0.0, abs=1e-12)
    assert ends[1] == pytest.approx(border.bifurcations["GPD"][0].parameter("j"), abs=1e-4)
    last = curve.omega[int(np.argmin(curve.parameter("j")))]
    assert last == pytest.approx(2.94603063, abs=1e-5)


def test_in_other_parameters_than_those_in_which_it_was_found(border):
    """The limit points end where the period doublings have their GPD: at the stiffness held so far."""
    event = border.bifurcations["GPD"][0]
    limits, doublings = (so.track(event, "Kc", (4, 6), onto=kind) for kind in ("LP", "PD"))
    assert limits.orbits[0].basis.nu == 2
    for curve in (limits, doublings):
        (there,) = curve.bifurcations["GPD"]
        # located with other numbers of harmonics, each to what it says
        off = 1e-8 + event.uncertainty + there.uncertainty
        assert there.parameter("Kc") == pytest.approx(event.parameters["Kc"], rel=off)
        assert there.omega == pytest.approx(event.omega, rel=off)


def test_a_period_doubling_in_the_doubled_basis_is_no_limit_point_to_follow(border):
    """There the Jacobian is singular at every one of them, and no motion has a sub-harmonic part."""
    (highest,) = (e for e in border.extrema if e.parameter_name == "j")
    orbit = highest.orbit
    basis = orbit.basis.doubled
    x = orbit.basis.resized(orbit.coefficients, basis)
    balance = orbit.balance.with_basis(basis).settle(x, orbit.omega, orbit.values)
    written = replace(orbit, balance=balance, x=x)
    singular = np.linalg.svd(written.state().jacobian, compute_uv=False)
    assert singular[-1] < 1e-6 * singular[0]
    taken = so.Bifurcation("LP", written, highest.floquet, highest.residual, highest.amplitude, "omega")
    with pytest.raises(InputError, match="repeats earlier"):
        so.track(taken, "j", (0, 1))
