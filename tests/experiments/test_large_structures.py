"""Experiments in time on structures that are projected, against the same structures as they are."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from chains import chain_matrices
from scipy import sparse
from slow import slow

import suboctave as so
from suboctave.errors import InputError
from suboctave.experiments.common import coordinates
from suboctave.experiments.stepped_sine import check_stepped_sine
from suboctave.harmonic import StructuralMatrices
from suboctave.model.projected import ProjectedSystem, Recovered
from suboctave.pictures import in_time
from suboctave.projection import small_system
from suboctave.timedomain import integrate as witness

#: just more than what is integrated as it is: the exact integration that they are held against takes the cube of it
N = 42
TIP = N - 1


def chain(elements, load=0.05, **parameters):
    """Equal masses, the first held, the last with an element and the load; the first frequency is 1."""
    mass, stiffness = chain_matrices(N)
    damping = 0.1 * mass + 0.002 * stiffness
    return so.System(mass, damping, stiffness, elements, [so.HarmonicLoad(TIP, load)], parameters)


@pytest.fixture(scope="module")
def stop():
    return chain([so.ElasticStop(TIP, 1.0, 0.3)])


@pytest.fixture(scope="module")
def spring():
    return chain([so.CubicSpring(TIP, "k")], 0.15, k=0.3)


@pytest.fixture(scope="module")
def curve(spring):
    return so.frequency_response(spring, (1.4, 0.9), harmonics=9)


def test_coordinates_are_displacements_where_something_acts(stop):
    """The equation of motion of the projection has the structure's frequencies; its elements read one coordinate."""
    small = small_system(stop, 1.1, [TIP, 30])
    assert isinstance(small, ProjectedSystem)
    assert small.n < N
    assert 0.0 < small.error < 1e-9
    np.testing.assert_array_equal(small.shapes[[TIP, 30], :3], np.eye(2, 3))
    np.testing.assert_array_equal(small.elements[0].direction(small.n), np.eye(1, small.n)[0])
    one, other = (StructuralMatrices(s).stiffness(np.array([0.0, 1.0, 9.0])) for s in (small, stop))
    np.testing.assert_allclose(np.linalg.inv(one)[:, 0, 1], np.linalg.inv(other)[:, TIP, 30], rtol=1e-9)


def test_small_systems_and_those_all_of_which_is_touched_are_left_alone():
    system = so.library.reference_oscillator()
    assert small_system(system, 1.0, [0]) is system
    n = 50
    elements = [so.CubicSpring(i, 1.0) for i in range(n)]
    every = so.System(np.eye(n), 0.1 * np.eye(n), np.eye(n), elements, [so.HarmonicLoad(0, 0.1)])
    assert small_system(every, 1.0, [0]) is every


def test_a_state_in_the_basis_comes_back(stop):
    small = small_system(stop, 1.1, [TIP])
    states = np.random.default_rng(0).normal(size=(3, 2 * small.n))
    whole = small.recovered(states)
    assert whole.shape == (3, 2 * N)
    np.testing.assert_allclose(small.reduced(whole), states, atol=1e-9)
    assert small.energy_outside(whole[0]) < 1e-12


def test_arrays_are_recovered_as_they_are_read(stop):
    small = small_system(stop, 1.1, [TIP])
    coordinates = np.random.default_rng(1).normal(size=(4, 5, 2 * small.n))
    lazy = Recovered(coordinates, small.shapes)
    whole = np.asarray(lazy)
    assert lazy.shape == whole.shape == (4, 5, 2 * N)
    keys = [
        0, (1, 2), (slice(None), 3), (..., 7), (..., N + 7), (slice(None), slice(1, 3), [2, N + 2]),
        (0, 0, slice(N - 2, N + 2)), (np.array([True, False, True, False]), 1), (slice(None, None, 2),),
    ]  # fmt: skip
    for key in keys:
        np.testing.assert_allclose(lazy[key], whole[key], atol=1e-12, err_msg=repr(key))
    np.testing.assert_allclose(lazy - whole, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(lazy), np.abs(whole), atol=1e-12)


def test_a_transient_is_that_of_all_degrees_of_freedom(stop):
    """Contacts excite what lies above the basis: a basis for more harmonics has more of it."""
    omega, periods = 1.02, 8
    short = so.integrate(stop, omega=omega, periods=periods)
    exact = witness(stop, np.zeros(2 * N), short.time, omega)
    assert len(exact.contacts) > 4
    fine = so.integrate(
        stop, omega=omega, periods=periods, linear=so.condense(stop, omega, harmonics=60, observe=[TIP, 20])
    )
    errors = [np.abs(one.displacement - exact.x).max() / np.abs(exact.x).max() for one in (short, fine)]
    assert errors[0] < 1e-3
    assert errors[1] < 0.1 * errors[0]
    assert fine.largest[TIP] == pytest.approx(exact.largest(TIP), rel=1e-4)
    assert np.isnan(short.largest[3])
    assert f"{N} degrees of freedom in" in repr(short)


def test_all_degrees_of_freedom_on_request(stop):
    whole = so.integrate(stop, omega=1.02, periods=1, linear=StructuralMatrices(stop))
    assert whole.projection is None
    exact = witness(stop, np.zeros(2 * N), whole.time, 1.02)
    np.testing.assert_allclose(whole.displacement, exact.x, atol=1e-8 * np.abs(exact.x).max())
    with pytest.raises(InputError, match="condense"):
        so.integrate(stop, omega=1.02, linear=so.condense(so.library.reference_oscillator(), 1.0))


def test_a_motion_of_harmonic_balance_goes_on_in_time(curve, spring):
    point = max((p for p in curve.points if p.floquet.stable), key=lambda p: p.orbit.amplitude(TIP))
    orbit = point.orbit
    path = so.integrate(spring, start=orbit, omega=orbit.omega, periods=3)
    assert path.lost < 1e-12
    for dof in (4, 33, TIP):
        np.testing.assert_allclose(
            path.displacement[:, dof], orbit.displacement(path.time)[dof], atol=1e-4 * orbit.amplitude(dof)
        )


def test_what_does_not_fit_into_the_basis_is_told(spring):
    state = np.zeros(2 * N)
    state[[10, 11]] = 0.01, -0.01
    path = so.integrate(spring, start=state, omega=1.0, periods=1)
    assert path.lost > 0.5
    assert "of the energy of the start do not fit" in repr(path)


@pytest.fixture(scope="module")
def result(spring):
    """Of each experiment a short one, once, when it is asked for."""
    options = {"transient": 20, "periods": 6}
    tapped = {"values": 2, "transient": 30, "periods": 6, "harmonics": (1, 3), "tap": (1.0, 20, 0.1)}
    points = {"parameter": "k", "bounds": (0.2, 0.3), "grid": (1, 1), "transient": 5, "periods": 16}
    makers = {
        "trajectory": lambda: so.integrate(spring, omega=1.0, periods=2),
        "sections": lambda: so.poincare_sections(spring, start=np.zeros((2, 2 * N)), omega=1.0, observe=20, **options),
        "brute": lambda: so.brute_force_diagram(spring, (1.0, 1.01), values=2, **options),
        "sine": lambda: so.stepped_sine(spring, (1.0, 1.01), **tapped),
        "lyapunov": lambda: so.lyapunov_exponents(spring, omega=1.0, periods=32, transient=10, count=1, trajectories=2),
        "map": lambda: so.lyapunov_map(spring, (1.0, 1.01), **points),
    }  # fmt: skip
    return cache(lambda name: makers[name]())


@pytest.mark.parametrize("name", ["trajectory", "sections", "sine", "lyapunov", *slow("brute", "map")])
def test_results_are_the_structures_and_survive_a_file(result, name, tmp_path):
    result = result(name)
    assert result.system.n == N
    assert f"{N} degrees of freedom in" in repr(result)
    again = so.load(result.save(tmp_path / "result.nc"))
    assert repr(again) == repr(result)
    np.testing.assert_array_equal(again.projection.shapes, result.projection.shapes)
    dataset = result.to_xarray()
    for name, variable in again.to_xarray().data_vars.items():
        np.testing.assert_array_equal(variable.to_numpy(), dataset[name].to_numpy(), err_msg=name)
    assert len(result.to_dataframe()) == len(again.to_dataframe())


def test_what_is_observed_is_a_degree_of_freedom_of_the_structure(result):
    sections = result("sections")
    assert sections.observed == 20
    assert sections.points.shape == (2, 6, 2 * N)
    attractor = sections.attractor(0)
    assert attractor.observed == 20
    assert attractor.amplitude == attractor.largest[20]
    assert attractor.state.shape == (2 * N,)
    assert list(sections.to_dataframe().columns[3:5]) == ["x_20", "v_20"]
    assert result("sine").harmonic(1, dof=30).shape == (2,)


@pytest.mark.slow
def test_attractors_of_a_diagram_are_motions_of_the_structure(result):
    assert result("brute").attractors[0][0].state.shape == (2 * N,)


def test_the_fundamental_of_a_stepped_sine_is_that_of_harmonic_balance(spring):
    test = so.stepped_sine(spring, (0.9, 1.0), values=[0.97], transient=60, periods=6, harmonics=(1,))
    orbit = so.frequency_response(spring, (0.97, 0.9), harmonics=5).orbits[0]
    for dof in (5, TIP):
        assert abs(test.harmonic(1, dof)[0]) == pytest.approx(abs(orbit.harmonic(1, dof)), rel=1e-2)


@pytest.mark.slow
def test_basins_of_two_motions_of_a_structure(spring, curve, tmp_path):
    """Both stable motions at one frequency, on the plane of the tip: the states nearest to them belong to them."""
    low, high = sorted(b.omega for b in curve.bifurcations["LP"])
    omega = 0.5 * (low + high)
    basins = so.basins(spring, omega=omega, box=((-1.2, 1.2), (-1.2, 1.2)), grid=(3, 3), attractors=curve, periods=60)
    assert basins.plane == (f"x_{TIP}", f"v_{TIP}")
    assert len(basins.attractors) == 2
    assert set(np.unique(basins.labels)) == {0, 1}
    assert basins.followed == 9
    assert basins.contradicted == 0
    for one in basins.attractors:
        assert one.points.shape == (1, 2 * N)
        path = so.integrate(spring, start=one, omega=omega, periods=1)
        np.testing.assert_allclose(path.end, one.state, atol=1e-5 * one.amplitude)
        assert path.largest[TIP] == pytest.approx(one.amplitude, rel=1e-5)
    again = so.load(basins.save(tmp_path / "basins.nc"))
    np.testing.assert_array_equal(again.attractors[1].points[0], basins.attractors[1].points[0])
    assert repr(again) == repr(basins)


def test_planes_of_other_degrees_of_freedom(spring):
    """A displacement of the plane deflects the structure as a force there does."""
    small = small_system(spring, 1.0, [TIP, 20, 40])
    assert coordinates(small)[:4] == [f"x_{TIP}", "x_20", "x_40", "x_mode_0"]
    _, _, stiffness = spring.matrices()
    force = stiffness @ small.shapes[:, 2]
    force[[20, TIP, 40]] = 0.0
    assert np.abs(force).max() < 1e-6 * np.abs(stiffness).max()
    with pytest.raises(InputError, match="no coordinate"):
        so.basins(spring, plane=("x_20", "y_3"), omega=1.0, box=((-0.1, 0.1), (-0.1, 0.1)))


class Wilful(so.CubicSpring):
    """Says in a way of its own where it acts."""

    def direction(self, n):
        return np.eye(1, n, n - 1)[0]

    def inputs(self, n):
        return self.direction(n)[None]


def test_elements_that_have_no_direction_of_their_own_are_refused():
    with pytest.raises(InputError, match="has a way of its own to say where it acts"):
        so.integrate(chain([Wilful(3, 0.2)]), omega=1.0, periods=1)


def test_elements_between_places_and_loads_of_inertia():
    """Directions of every kind, and a law of two displacements."""
    law = so.Expression(5, "0.2*x*y**2 + 0.01*x'", {"x": (20, 40), "y": TIP})
    system = chain([law, so.ElasticStop((10, TIP), 1.0, 0.1)])
    base = so.BaseAcceleration(0.002)
    parts = (system.mass, system.damping, system.stiffness, system.elements, [*system.loads, base, so.Gravity(1e-3)])
    system = so.System(*parts)
    path = so.integrate(system, omega=0.9, periods=3)
    exact = witness(system, np.zeros(2 * N), path.time, 0.9)
    assert np.abs(path.displacement - exact.x).max() < 1e-3 * np.abs(exact.x).max()


def test_a_stepped_sine_of_a_large_structure_is_not_refused_by_its_degrees_of_freedom():
    """What is kept are coordinates of modes; that alone is counted before anything is computed."""
    n = 100_000
    one = sparse.eye_array(n).tocsr()
    large = so.System(one, 0.1 * one, one, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.1)])
    plan = {"direction": ["up", "down"], "transient": 10, "periods": 10, "start": None, "tap": None, "harmonics": [1.0]}
    check_stepped_sine(large, (0.5, 1.5), values=2000, noise=0.0, **plan)
    with pytest.raises(InputError, match="more than fit"):
        check_stepped_sine(large, (0.5, 1.5), values=5_000_000, noise=0.0, **plan)


def test_pictures_read_the_degree_of_freedom_that_they_draw(result, monkeypatch, tmp_path):
    """Of all displacements one column is recovered; the picture is that of the whole array."""
    path, sections, test = result("trajectory"), result("sections"), result("sine")
    read, honest = [], Recovered._displaced

    def noted(own, coordinates, last):
        read.append(last)
        return honest(own, coordinates, last)

    for shown, options in ((path, {"dof": 7}), (sections, {}), (test, {"harmonic": 3}), (test, {"dof": 7})):
        getattr(in_time, shown.picture)(shown.to_xarray(), path=tmp_path / "whole.svg", **options)
        with monkeypatch.context() as patched:
            patched.setattr(Recovered, "_displaced", noted)
            shown.plot(tmp_path / "one.svg", **options)
        marks = [(tmp_path / f"{name}.svg").read_text().count("<use") for name in ("whole", "one")]
        assert marks[0] == marks[1] > 0
    assert read
    assert all(np.arange(N)[last].size == 1 for last in read)
