"""Structures projected onto a basis of their own against the same structures as they are: nothing may differ."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import scipy.sparse

import suboctave as so
from suboctave.harmonic import HarmonicBalance, StructuralMatrices, condensed, reduction
from suboctave.harmonic.basis import to_complex

OMEGA = (150.0, 212.0)


@pytest.fixture(scope="module")
def beam():
    """A hundred elements, two stops of different stiffness at different places, a load beside them."""
    structure = so.structures.beam(0.7, 0.014, 0.014, 2.05e11, 7800.0, 100)
    places = [structure.dof(node, "z") for node in (90, 70, 100)]
    stops = [
        so.ElasticStop(places[0], stiffness="k", gap="gap"),
        so.ElasticStop(places[1], stiffness=2e4, gap=-7e-4),
    ]
    system = structure.system(
        stops, [so.HarmonicLoad(places[2], 1.0)], {"k": 1e4, "gap": 1e-3}, so.Rayleigh(alpha=3.0, beta=1e-5)
    )
    assert system.n == 200
    return system


def response(system, **options):
    return so.frequency_response(system, OMEGA, harmonics=15, max_step=0.2, **options)


@pytest.fixture(scope="module")
def projected(beam):
    return response(beam)


@pytest.fixture(scope="module")
def whole(beam):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reduction, "COMPLETE", 200)
        linear = so.condense(beam, OMEGA)
        assert len(linear.equation_of_motion()[0]) == 200
        return response(beam, linear=linear)


def test_few_modes_stand_for_many_degrees_of_freedom(projected):
    linear = projected.orbits[0].balance.linear
    assert linear.size == 2
    assert len(linear.equation_of_motion()[0]) < 60
    assert 0.0 < linear.error < 1e-8
    assert "200 degrees of freedom" in repr(linear)


@pytest.mark.slow
def test_the_same_events(projected, whole):
    assert len(whole.bifurcations) >= 2
    assert [b.kind for b in projected.bifurcations] == [b.kind for b in whole.bifurcations]
    for one, other in zip(projected.bifurcations, whole.bifurcations, strict=True):
        # of all modes: half a digit in the last place of the stiffness moves them by 6e-8
        assert one.omega == pytest.approx(other.omega, rel=1e-7)
        assert one.criticality == other.criticality


def answers(system, frequencies, forces):
    """Displacements of all degrees of freedom under forces (F, n), refined in extended precision.

    In double the stiffness of a hundred slender elements, of condition 4e9, gives a resonance to 1e-6 only.
    """
    matrices = [matrix.astype(np.longdouble) for matrix in system.matrices()]
    factors = zip((-(frequencies**2), 1j * frequencies, np.ones_like(frequencies)), matrices, strict=True)
    z = sum(np.multiply.outer(f.astype(np.clongdouble), matrix) for f, matrix in factors)
    x = np.zeros(forces.shape, dtype=np.clongdouble)
    for _ in range(6):
        rest = forces - np.einsum("fij,fj->fi", z, x)
        x += np.linalg.solve(z.astype(complex), rest.astype(complex)[:, :, None])[:, :, 0]
    return x.astype(complex)


def test_every_motion_balances_the_structure_as_it_is(projected):
    """Forces along each motion, answered by all degrees of freedom: the motion that caused them."""
    for orbit in projected.orbits[::10]:
        linear = orbit.balance.linear
        state = orbit.state()
        forces = state.loads_elsewhere @ linear.reduction.loads - to_complex(state.force) @ linear.reduction.directions
        exact = answers(orbit.system, orbit.basis.multiples * orbit.omega, forces)
        assert np.abs(linear.read(exact) - to_complex(orbit.x)).max() < 1e-7 * np.abs(orbit.x).max()
        # a field beside the places of forces is known to less
        assert np.abs(exact - orbit.amplitudes).max() < 1e-5 * np.abs(exact).max()


def test_tracked_curves_have_the_same_equations(projected, beam):
    """The limit point at another gap is where the curve of limit points says."""
    item = projected.bifurcations["LP"][0]
    curve = so.track(item, "gap", (1e-3, 1.05e-3), max_step=0.3)
    again = response(beam.with_parameters(gap=1.05e-3)).bifurcations["LP"][0]
    assert np.abs(curve.omega[[0, -1]] - again.omega).min() < 1e-7 * again.omega


def test_a_results_file_gives_the_same_motions(projected, tmp_path):
    path = projected.save(tmp_path / "beam.nc")
    again = so.load(tmp_path / "beam.nc" if path is None else path)
    assert again.orbits[3].balance.linear.size == 2
    np.testing.assert_array_equal(again.orbits[3].x, projected.orbits[3].x)
    np.testing.assert_allclose(again.orbits[3].displacement(0.01), projected.orbits[3].displacement(0.01), rtol=1e-6)


def chain(n, elements, loads, **parameters):
    stiffness = scipy.sparse.diags_array([-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], offsets=[-1, 0, 1])
    parts = {"1": stiffness.tocsr()}
    if parameters:
        parts["k"] = scipy.sparse.csr_array(([1.0], ([n // 3], [n // 3])), (n, n))
    damping = 0.02 * scipy.sparse.eye_array(n).tocsr() + 0.01 * stiffness.tocsr()
    return so.System(scipy.sparse.eye_array(n).tocsr(), damping, parts, elements, loads, parameters)


def test_a_parameter_in_the_stiffness_rebuilds_the_basis():
    """Far from where the basis was made the flexibility is as exact as there."""
    system = chain(80, [so.CubicSpring(79, 0.5)], [so.HarmonicLoad(79, 0.1)], k=0.5)
    linear = so.condense(system, 0.3)
    for k in (0.5, 2.0, 40.0):
        values = {"k": k}
        frequencies = np.linspace(0.1, 4.0, 9)
        own = np.linalg.inv(linear.rebuilt(values).stiffness(frequencies))[:, 0, 0]
        exact = np.linalg.inv(StructuralMatrices(system, values).stiffness(frequencies))[:, 79, 79]
        np.testing.assert_allclose(own, exact, rtol=1e-7)
    assert linear.rebuilt({"k": 2.0}).reduction is not linear.reduction


@pytest.mark.parametrize("what", ["stiffness", "mass", "damping"])
@pytest.mark.parametrize("ratio", [1.04, pytest.param(0.96, marks=pytest.mark.slow)])
def test_along_a_curve_a_basis_grows_ahead(what, ratio):
    """A spring, a mass, a dashpot at one place: a few bases serve all values, between those they were made for too."""
    n, frequencies = 200, np.linspace(0.05, 0.7, 7)
    whole = chain(n, [so.CubicSpring(n - 1, 0.5)], [so.HarmonicLoad(n - 1, 0.1)])
    parts = {name: getattr(whole, name).sparse_value({}) for name in ("mass", "damping", "stiffness")}
    parts[what] = {"1": parts[what], "k": scipy.sparse.csr_array(([1.0], ([n // 3], [n // 3])), (n, n))}
    system = so.System(**parts, elements=whole.elements, loads=whole.loads, parameters={"k": 5.0})
    linear = so.condense(system, 0.045)
    used, k = [], 5.0
    for i in range(30):
        k *= ratio
        one = linear.rebuilt({"k": k})
        if one.reduction not in used:
            used.append(one.reduction)
        if i % 7 == 3:
            own = np.linalg.inv(one.stiffness(frequencies))[:, 0, 0]
            exact = np.linalg.inv(StructuralMatrices(system, {"k": k}).stiffness(frequencies))[:, n - 1, n - 1]
            np.testing.assert_allclose(own, exact, rtol=1e-8)
    assert linear.reduction not in used
    assert len(used) <= 5
    sizes = [one.projected.shapes.shape[1] for one in (linear.reduction, used[-1])]
    assert sizes[1] < 1.5 * sizes[0]


@pytest.mark.parametrize(
    "what", ["both", *(pytest.param(one, marks=pytest.mark.slow) for one in ("frequency", "parameter"))]
)
def test_a_basis_does_not_depend_on_what_else_is_alive(what):
    """What a curve asks for first, and what others have asked for, leaves it as it is, bit for bit."""
    system = chain(80, [so.CubicSpring(79, 0.5)], [so.HarmonicLoad(79, 0.1)], k=0.5)
    values = {"k": 0.5 if what == "frequency" else 0.83}
    times = 1.0 if what == "parameter" else 1.3

    def asked():
        linear = so.condense(system, 0.3)
        return linear.rebuilt(values).covering(times * linear.covers)

    def bits(part):
        return part.stiffness(np.linspace(0.1, 4.0, 9)).tobytes()

    alone = bits(asked())
    gc.collect()
    others = [so.condense(system, 0.3) for _ in range(3)]
    kept = [
        others[0].covering(3.0 * others[0].covers),
        others[1].rebuilt({"k": 0.9}).covering(2.0 * others[1].covers),
        *(others[2].rebuilt({"k": k}) for k in (0.45, 0.6, 0.75, 1.2, 3.0)),
    ]
    assert bits(asked()) == alone
    # and along a curve that comes from elsewhere
    linear = others[2]
    for k in (3.0, 0.6, values["k"]):
        last = linear.rebuilt({"k": k})
    assert bits(last.covering(times * linear.covers)) == alone
    assert len(kept) == 7


def test_where_an_expression_is_none_no_basis_grows_ahead():
    system = chain(100, [so.CubicSpring(99, 0.5)], [so.HarmonicLoad(99, 0.1)], k=0.5)
    stiffness = system.stiffness.sparse_value({"k": 0.0})
    system = so.System(
        system.mass.value({}), {"0.02": np.eye(100)}, {"1": stiffness, "sqrt(1.02 - k)": np.eye(100)},
        system.elements, system.loads, {"k": 1.0},
    )  # fmt: skip
    linear = so.condense(system, 0.1)
    one = linear.rebuilt({"k": 1.01})
    exact = np.linalg.inv(StructuralMatrices(system, {"k": 1.01}).stiffness(np.array([0.7])))[0, 99, 99]
    assert 1.0 / one.stiffness(np.array([0.7]))[0, 0, 0] == pytest.approx(exact, rel=1e-8)


def test_other_damping_than_rayleigh():
    """One dashpot inside, and one of the elements' degrees of freedom undamped else."""
    n = 90
    system = chain(n, [so.CubicSpring(n - 1, 0.5)], [so.HarmonicLoad(3, 0.1)])
    dashpot = scipy.sparse.csr_array(([0.7], ([40], [40])), (n, n))
    system = so.System(
        system.mass.compact({}), system.damping.compact({}) + dashpot, system.stiffness.compact({}), system.elements,
        system.loads,
    )  # fmt: skip
    linear, frequencies = so.condense(system, 0.3), np.linspace(0.0, 4.0, 9)
    flexibility = np.linalg.inv(StructuralMatrices(system).stiffness(frequencies))[:, [n - 1]][:, :, [n - 1, 3]]
    own = np.linalg.solve(linear.stiffness(frequencies), np.dstack([np.ones((9, 1)), linear.loaded(frequencies)]))
    assert np.abs(own - flexibility).max() < 1e-7 * np.abs(flexibility).max()


def test_a_free_body_that_elements_hold():
    """Rigid-body motion has no flexibility at rest; nothing is special about it all the same."""
    n = 60
    stiffness = scipy.sparse.diags_array([-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], offsets=[-1, 0, 1])
    stiffness = stiffness.tolil()
    stiffness[0, 0] = stiffness[n - 1, n - 1] = 1.0
    stiffness = stiffness.tocsr()
    damping = 0.02 * stiffness + 1e-3 * scipy.sparse.eye_array(n)
    held = [so.PolynomialSpring(0, {1: 0.3, 3: 1.0})]
    free = so.System(scipy.sparse.eye_array(n), damping, stiffness, held, [so.HarmonicLoad(n - 1, 0.02)])
    branch = so.frequency_response(free, (0.05, 0.051), harmonics=5)
    assert branch.orbits[0].balance.linear.frequencies[0] == 0.0
    orbit = branch.orbits[0]
    balance = HarmonicBalance(free, orbit.basis, linear=StructuralMatrices(free))
    balanced = balance.at(orbit.coefficients, orbit.omega).balanced
    assert balanced.size < 1e-7 * balanced.scale


def test_structures_that_meet_and_clearances_all_around():
    """A stop between two structures is one unknown, a radial clearance two."""
    n = 50
    system = chain(n, [so.ElasticStop((10, 40), 2.0, 0.1)], [so.HarmonicLoad((10, 40), 0.1)])
    assert condensed.linear_part_of(system).size == 1
    law = "(1 + tanh((x**2 + y**2 - 0.01)/0.01))"
    around = [so.Expression(dof, f"{law}*{name}", {"x": 10, "y": 30}) for dof, name in ((10, "x"), (30, "y"))]
    loads = [so.HarmonicLoad(10, 0.2), so.HarmonicLoad(30, 0.2, phase=1.5)]
    system = chain(n, around, loads)
    orbit = so.frequency_response(system, (0.9, 0.89), harmonics=5).orbits[0]
    assert orbit.balance.size == 2
    balance = HarmonicBalance(system, orbit.basis, linear=StructuralMatrices(system), samples=orbit.balance.samples)
    balanced = balance.at(orbit.coefficients, orbit.omega).balanced
    assert balanced.size < 1e-5 * balanced.scale


@pytest.mark.parametrize("count", [10])
def test_many_stops_on_one_structure(count):
    """Each is one unknown; the motion balances all of it."""
    n = 200
    places = np.linspace(20, n - 1, count).astype(int)
    system = chain(n, [so.ElasticStop(int(dof), 0.5, 0.3) for dof in places], [so.HarmonicLoad(n - 1, 0.4)])
    branch = so.frequency_response(system, (0.0085, 0.0082), harmonics=9)
    orbit = branch.orbits[-1]
    assert orbit.balance.size == count
    assert orbit.amplitude(n - 1) > 0.3
    state, matrices = orbit.state(), StructuralMatrices(system)
    forces = to_complex(state.unbalanced) @ orbit.balance.linear.reduction.directions
    exact = np.linalg.solve(matrices.stiffness(orbit.basis.multiples * orbit.omega), -forces[:, :, None])[:, :, 0]
    assert np.abs(orbit.balance.linear.read(exact) - to_complex(orbit.x)).max() < 1e-8 * np.abs(orbit.x).max()
