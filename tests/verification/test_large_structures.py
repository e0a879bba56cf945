"""Shooting from motions of projected structures."""

from __future__ import annotations

import numpy as np
import pytest
from chains import chain_matrices

import suboctave as so
from suboctave.projection import system_of_motions
from suboctave.timedomain import field, integrate
from suboctave.timedomain.field import scaled_field
from suboctave.timedomain.trajectory import flow

N = 120
TIP = N - 1


def chain(elements):
    """Equal masses, the first held, the last with an element and the load; the first frequency is 1."""
    mass, stiffness = chain_matrices(N)
    return so.System(mass, 0.02 * mass + 0.02 * stiffness, stiffness, elements, [so.HarmonicLoad(TIP, 0.05)])


@pytest.fixture(scope="module")
def stop():
    return so.frequency_response(chain([so.ElasticStop(TIP, 1.0, 0.5)]), (1.2, 1.0), harmonics=25)


@pytest.fixture(scope="module")
def spring():
    return so.frequency_response(chain([so.CubicSpring(TIP, 0.3)]), (1.2, 1.0), harmonics=9)


def test_motions_agree(stop):
    """With contacts: in closed form between them."""
    touching = [p for p in stop.points if p.orbit.amplitude(TIP) > 0.6]
    for point in (touching[0], touching[len(touching) // 2]):
        check = so.verify(point)
        assert check.agrees
        assert check.multiplier_error < 1e-4
        assert check.projection.n < N
        assert check.solution.state.shape == (2 * N,)
        assert check.solution.amplitude == pytest.approx(point.orbit.amplitude(TIP), rel=1e-4)
        assert "120 degrees of freedom in" in repr(check)


def test_a_smooth_law(spring):
    point = max(spring.points, key=lambda p: p.orbit.amplitude(TIP))
    check = so.verify(point)
    assert check.agrees
    assert check.distance < 1e-5
    # the fastest vibrations of the chain have no states of their own: multipliers say what that may do to them
    mu, errors = point.floquet.multipliers, point.floquet.errors
    apart = np.abs(mu[:, None] - check.solution.multipliers).min(axis=1)
    assert np.all(apart <= errors + 1e-6)
    assert check.multiplier_error < 1e-4


def test_bifurcations_are_located_again(stop):
    assert len(stop.bifurcations)
    for item in stop.bifurcations:
        check = so.verify(item)
        assert check.agrees, check


def test_a_branch(stop, tmp_path):
    check = so.verify(stop, points=3, bifurcations=False)
    assert check.agrees
    assert check.basis.startswith("Projected: 120 degrees of freedom")
    again = so.load(check.save(tmp_path / "check.nc"))
    assert repr(again) == repr(check)


@pytest.mark.slow
def test_points_of_a_branch_whose_basis_grows_are_held_each_against_its_own():
    """Little damping leaves the multipliers of vibrations beyond a basis, which are others in each, near the circle."""
    mass, stiffness = chain_matrices(50)
    load = [so.HarmonicLoad(49, 0.012)]
    system = so.System(mass, so.ModalDamping(0.003), stiffness, [so.ElasticStop(49, 1.0, 0.5)], load)
    curve = so.frequency_response(system, (1.1, 0.95))
    modes = {point.orbit.state().linear.projected.shapes.shape[1] for point in curve.points}
    assert len(modes) > 1
    check = so.verify(curve, points=3, bifurcations=False)
    assert check.agrees, check


@pytest.mark.parametrize(
    "more",
    [
        [],
        pytest.param([so.CubicSpring(TIP, 0.3)], marks=pytest.mark.slow),
        [so.TanhFriction(TIP, 0.005, 0.02), so.CubicSpring((TIP, TIP - 5), 30.0)],
        [so.Expression(TIP, "0.1*x*y**2", inputs={"x": TIP, "y": 60})],
    ],
    ids=["stop alone", "spring", "friction and spring", "two inputs"],
)
def test_the_closed_form_is_what_stepping_gives(more, monkeypatch):
    """State, tangent flow, slope by omega and contact instants; with laws that are smooth by collocation."""
    curve = so.frequency_response(chain([so.ElasticStop(TIP, 1.0, 0.1), *more]), (1.2, 1.1), harmonics=9)
    orbit = max(curve.orbits, key=lambda o: o.amplitude(TIP))
    small = system_of_motions([orbit])
    start, found = small.reduced(orbit.start()), []
    for closed in (True, False):
        monkeypatch.setattr(field.Field, "closed", closed)
        model = scaled_field(small, start, orbit.omega)
        found.append(flow(model, 0.0, start / model.scale, 2.0 * np.pi, 1e-12, slope=True))
    (one, slopes, passage), (other, stepped, whole) = found
    np.testing.assert_allclose(one, other, atol=1e-9)
    np.testing.assert_allclose(slopes, stepped, atol=1e-8 * np.abs(stepped).max())
    assert len(passage.contacts) == len(whole.contacts) >= 2
    for contact, seen in zip(passage.contacts, whole.contacts, strict=True):
        assert contact.time == pytest.approx(seen.time, abs=1e-9)


def test_trajectories_are_read_between_their_steps(monkeypatch):
    """Dense output with a smooth law, against steps."""
    system = chain([so.ElasticStop(TIP, 1.0, 0.1), so.CubicSpring(TIP, 0.3)])
    orbit = so.frequency_response(system, (1.2, 1.15), harmonics=9).orbits[0]
    small, times, found = system_of_motions([orbit]), np.linspace(0.0, 7.0, 40), []
    for closed in (True, False):
        monkeypatch.setattr(field.Field, "closed", closed)
        found.append(integrate(small, small.reduced(orbit.start()), times, orbit.omega))
    np.testing.assert_allclose(found[0].x, found[1].x, atol=1e-9 * np.abs(found[1].x).max())


def test_a_body_that_nothing_holds_between_its_contacts(monkeypatch):
    """Two equal eigenvalues of rigid-body motion: there is no diagonal form, and the flow is stepped."""
    stiffness = np.array([[1.0, -1.0], [-1.0, 1.0]])
    loads = [so.HarmonicLoad(1, 0.1, static=0.1)]
    free = so.System(np.eye(2), 0.1 * stiffness, stiffness, [so.ElasticStop(0, 3.0, 0.1)], loads)
    start, ends = np.array([0.0, 0.0, 0.1, 0.2]), []
    for few in (1, 1000):
        monkeypatch.setattr(field, "FEW", few)
        path = integrate(free, start, (0.0, 20.0), 2.0)
        assert len(path.contacts) > 2
        ends.append(path.end)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-8)


def test_velocities_that_too_few_harmonics_leave_out_are_no_other_motion():
    """A contact rounds off velocities more slowly than displacements: that is said, and more harmonics agree."""
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    found = [so.verify(orbit) for orbit in so.frequency_response(system, (2.4, 1.7), harmonics=7).orbits[::5]]
    others = [one for one in found if not one.agrees]
    assert others
    assert all("within the truncation error" in one.reason for one in others)
    assert all(so.verify(o).agrees for o in so.frequency_response(system, (2.4, 1.7), harmonics=63).orbits[::18])
