"""Structures: labels, natural frequencies, damping, systems; and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import suboctave as so
from suboctave.errors import InputError
from suboctave.model.updated import Updated


def beam(elements: int) -> so.Structure:
    """A free Euler-Bernoulli beam of length 1 with EI = 1, rho A = 1."""
    h, n = 1.0 / elements, 2 * (elements + 1)
    k = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]) / h**3
    m = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) * h / 420
    scale = np.array([1, h, 1, h])
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        place = slice(2 * e, 2 * e + 4)
        mass[place, place] += m * scale[:, None] * scale
        stiffness[place, place] += k * scale[:, None] * scale
    return so.Structure(mass, stiffness, dofs=[(i, d) for i in range(elements + 1) for d in ("z", "ry")])


# -------------------------------------------------------------------------------------------------------------- labels
@pytest.mark.parametrize("node", [1042, "1042", "node 1042", "Node_1042", np.int64(1042)])
@pytest.mark.parametrize("direction", ["z", "Z", 3, "3", "uz", "T3", np.int32(3)])
def test_a_dof_is_found_as_users_write_it(structure, node, direction):
    assert structure.dof(node, direction) == 1


@pytest.mark.parametrize("text", ["1042 z", "node 1042 Z", "1042:z", "1042, 3", " 1042  z "])
def test_node_and_direction_may_be_one_text(structure, text):
    assert structure.dof(text) == 1


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ((1024, "z"), "there is no node 1024; nearest: 1042, .*; there are 4 nodes, 7 to 1042"),
        ((1042, "y"), "node 1042 has no direction 'y'; it has x, z"),
        ((1042, "rx"), "node 1042 has no direction 'rx'"),
        (("somewhere",), "is no DOF: write node and direction"),
        ((1042.5, "z"), "a node is a whole number or a text"),
        ((True, "z"), "a node is a whole number or a text"),
        ((1042, 1.5), "a direction is one of x, y, z"),
        ((3,), "a DOF is given by node and direction"),
    ],
)
def test_a_dof_that_is_not_there_is_told_with_what_is_near(structure, place, message):
    with pytest.raises(so.InputError, match=message):
        structure.dof(*place)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([(1, ["z"])], "a direction is one of x, y, z"),
        ([(1, {"z": 1})], "a direction is one of x, y, z"),
        ([(1, np.array([3]))], "a direction is one of x, y, z"),
        ([([1], "z")], "a node is a whole number or a text"),
        ([({}, "z")], "a node is a whole number or a text"),
    ],
)
def test_labels_that_are_none(given, message):
    with pytest.raises(so.InputError, match=message):
        so.DofMap(given)
    with pytest.raises(so.InputError, match=message):
        so.DofMap([(1, "x")], fixed=given)


def test_nodes_may_be_texts_and_negative():
    dofs = so.DofMap([("plate.12", "x"), ("Plate.13", "x"), (-4, "z"), (5, "temperature")])
    assert (dofs.index("PLATE.12", "x"), dofs.index("-4", "z"), dofs.index(5, "Temperature")) == (0, 2, 3)
    with pytest.raises(so.InputError, match=r"did you mean 'plate\.12'"):
        dofs.index("plate12", "x")


def test_fixed_dofs_are_gone_and_said(structure, chain):
    held = structure.fixed([(1042, "z"), "7 x", 4, (77, "z")])
    assert held.n == 4
    kept = [i for i in range(8) if i not in (1, 2, 4, 5)]
    np.testing.assert_array_equal(held.stiffness.toarray(), chain.stiffness[np.ix_(kept, kept)])
    assert held.dof(300, "x") == 2
    with pytest.raises(so.InputError, match="1042 z is fixed"):
        held.dof(1042, "z")
    with pytest.raises(so.InputError, match="all DOFs of node 77 are fixed"):
        held.dof(77, "y")
    with pytest.raises(so.InputError, match=r"has no direction 'y'; it has x \(fixed: z\)"):
        held.dof(1042, "y")
    with pytest.raises(so.InputError, match="all DOFs of node 77 are fixed"):
        held.fixed(["node 77"])
    with pytest.raises(so.InputError, match="there is no node 1043; nearest: 1042"):
        structure.fixed(["node 1043"])


def test_a_weighted_direction(structure):
    vector = structure.direction({(1042, "z"): 1.0, "77 z": -0.5})
    assert list(vector) == [0, 1, 0, 0, 0, -0.5, 0, 0]
    for wrong in ({}, {(1042, "z"): "a"}, {(1042, "z"): np.nan}, [1, 2]):
        with pytest.raises(so.InputError):
            structure.direction(wrong)


def test_a_direction_alone_stands_for_all_degrees_of_freedom_in_it():
    plane = so.Structure(np.eye(4), np.eye(4), dofs=[(1, "x"), (1, "ry"), (2, "x"), (2, "ry")])
    assert list(plane.direction("x")) == [1, 0, 1, 0]
    assert list(plane.direction({"UX": -1.0, "2 ry": 0.5})) == [-1, 0, -1, 0.5]
    assert plane.fixed(["ry"]).dofs.names == ("1 x", "2 x")
    with pytest.raises(so.InputError, match="no DOF has the direction 'z'; there are x, ry"):
        plane.direction("z")


@pytest.mark.parametrize("load", [so.BaseAcceleration, so.BaseDisplacement, so.Gravity])
def test_a_base_moves_along_a_direction_where_there_are_several(load):
    """Rotations do not follow a translation of the base."""
    plane = so.Structure(np.eye(4), np.eye(4), dofs=[(1, "x"), (1, "ry"), (2, "x"), (2, "ry")])
    with pytest.raises(
        so.InputError, match=r'directions x, ry: give one, direction=structure\.direction\("x"\)'
    ) as failure:
        plane.system(loads=[so.HarmonicLoad(0, 1.0), load(0.1)])
    assert failure.value.key == ("loads", 1)
    with pytest.raises(so.InputError, match=r"a structure makes it: structure\.direction\('x'\)"):
        load(0.1, direction="x")
    system = plane.system(loads=[load(0.1, direction=plane.direction("x"))])
    assert not np.any([one.direction[[1, 3]] for one in system.load_components()])
    plane.fixed(["ry"]).system(loads=[load(0.1)])


def test_without_labels_dofs_are_numbers(chain):
    structure = so.Structure(chain.mass, chain.stiffness)
    assert structure.fixed([0, 1]).n == 6
    with pytest.raises(so.InputError, match="no DOF map: its DOFs are the numbers 0 to 7"):
        structure.dof(1042, "z")
    with pytest.raises(so.InputError, match="there is no DOF 8"):
        structure.fixed([8])
    with pytest.raises(so.InputError, match="nothing is left"):
        structure.fixed(range(8))


# ------------------------------------------------------------------------------------------------- natural frequencies
def test_frequencies_of_a_chain(structure, chain):
    found = structure.natural_frequencies(20)
    np.testing.assert_allclose(found.omega, chain.omega, rtol=1e-13)
    np.testing.assert_allclose(found.hertz, chain.omega / (2 * np.pi), rtol=1e-13)
    assert "rad per unit time" in str(found)
    assert "Hz" in str(found)
    assert "rigid" not in str(found)
    np.testing.assert_allclose(found.modes.T @ structure.mass @ found.modes, np.eye(8), atol=1e-12)


@pytest.mark.parametrize("elements", [40, 400])
def test_a_free_beam_has_two_rigid_body_modes(elements):
    """Densely and by Lanczos's method; (beta l)^2 of the first elastic ones from cos(beta) cosh(beta) = 1."""
    found = beam(elements).natural_frequencies(5)
    assert found.rigid == 2
    assert "2 rigid-body modes" in str(found)
    expected = np.array([4.730040744862704, 7.853204624095838, 10.99560783800167]) ** 2
    np.testing.assert_allclose(found.omega[2:], expected, rtol=1e-5)
    assert np.all(found.omega[:2] < 1e-2)


def test_units_do_not_matter():
    one = beam(200)
    other = so.Structure(one.mass * 1e-9, one.stiffness * 1e6)
    found = other.natural_frequencies(6)
    np.testing.assert_allclose(found.omega[2:], one.natural_frequencies(6).omega[2:] * 10**7.5, rtol=1e-6)
    assert found.rigid == 2


def test_massless_dofs_are_said_and_do_not_spoil_frequencies(chain):
    """Exact condensation of a massless DOF leaves the frequencies of what it hangs on."""
    mass = chain.mass.copy()
    mass[3, 3] = 0.0
    structure = so.Structure(mass, chain.stiffness, dofs=chain.labels)
    assert structure.massless == (3,)
    assert "no inertia 7 z" in repr(structure)
    keep = [i for i in range(8) if i != 3]
    k = chain.stiffness
    condensed = k[np.ix_(keep, keep)] - np.outer(k[keep, 3], k[3, keep]) / k[3, 3]
    exact = np.sqrt(scipy.linalg.eigvalsh(condensed))
    np.testing.assert_allclose(structure.natural_frequencies(9).omega, exact, rtol=1e-12)
    with pytest.raises(so.InputError, match=r"DOFs without inertia: 7 z; .* structure.fixed"):
        structure.system()


def test_constraints_by_multipliers_hold_what_they_constrain(chain):
    """A multiplier that holds the first DOF, against the structure with that DOF fixed."""
    mass, stiffness = np.zeros((9, 9)), np.zeros((9, 9))
    mass[:8, :8], stiffness[:8, :8] = chain.mass, chain.stiffness
    stiffness[8, 0] = stiffness[0, 8] = 1.0
    bound = so.Structure(mass, stiffness)
    held = so.Structure(chain.mass, chain.stiffness).fixed([0])
    np.testing.assert_allclose(bound.natural_frequencies(7).omega, held.natural_frequencies(7).omega, rtol=1e-9)


def test_a_buckled_structure_is_said():
    structure = so.Structure(np.eye(3), np.diag([-4.0, 1.0, 9.0]))
    found = structure.natural_frequencies()
    np.testing.assert_allclose(found.omega, [-2.0, 1.0, 3.0])
    assert "at rest is unstable" in str(found)


def test_frequencies_that_lie_too_close_are_no_endless_search(monkeypatch):
    """Masses on a stiff bed, hardly joined: the lowest of 20000 frequencies differ by 1e-11 of themselves."""
    monkeypatch.setattr("suboctave.model.frequencies._RESTARTS", 2)
    n = 20000
    joined = scipy.sparse.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    structure = so.Structure(scipy.sparse.eye_array(n), 1e3 * scipy.sparse.eye_array(n) + 1e-3 * joined)
    with pytest.raises(so.ConvergenceError, match="may lie too close") as caught:
        structure.natural_frequencies(3)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("count", [0, -1, 1.5, "a", True])
def test_a_count_of_frequencies_is_a_whole_number(structure, count):
    with pytest.raises(so.InputError, match="whole number"):
        structure.natural_frequencies(count)


# -------------------------------------------------------------------------------------------------------------- damping
def test_rayleigh_from_ratios_has_these_ratios(structure, chain):
    damping = so.Rayleigh.from_ratios((chain.omega[0], 0.01), (chain.omega[4], 0.02))
    found = structure.natural_frequencies(8)
    c = damping.matrix(structure.mass, structure.stiffness)
    ratios = np.diag(found.modes.T @ c @ found.modes) / (2 * found.omega)
    np.testing.assert_allclose(ratios[[0, 4]], [0.01, 0.02], rtol=1e-10)


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        (((1, 0.1), (1, 0.1)), "two different frequencies, not twice 1"),
        (((0, 0.1), (1, 0.1)), r"a circular frequency above 0 .*, not \(0, 0.1\)"),
        (((1, 0.1), (2, -1)), r"a damping ratio from 0 on, not \(2, -1\)"),
        ((1, 2), "first must be two finite numbers, .* not 1"),
        (((1,), (2,)), r"first must be two finite numbers, .* not \(1,\)"),
    ],
)
def test_rayleigh_refuses_what_has_no_answer(pairs, message):
    with pytest.raises(so.InputError, match=message):
        so.Rayleigh.from_ratios(*pairs)


@pytest.mark.parametrize(
    "make",
    [
        lambda: so.Rayleigh.from_ratios((39, 0.02), (286, 2.0)),
        lambda: so.ModalDamping(2.0),
        lambda: so.ModalDamping([0.01, 2]),
    ],
)
def test_ratios_in_per_cent_are_refused(make):
    with pytest.raises(so.InputError, match=r"2 is 200 per cent of critical: write 0\.02 for 2 per cent"):
        make()


def test_a_free_body_is_told_by_the_degrees_of_freedom_that_move_most(structure):
    n = 6
    springs = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    springs[0, 0] = springs[-1, -1] = 1.0
    free = so.Structure(np.eye(n), springs, dofs=[(node, "x") for node in range(1, n + 1)])
    system = free.system(loads=[so.HarmonicLoad(0, 1.0)])
    with pytest.raises(so.InputError, match=r"move freely: 1 x by 1, 2 x by 1, 3 x by 1, 4 x by 1, \.\.\.\. Its"):
        so.frequency_response(system, (0.1, 0.2))
    two = so.System(np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), loads=[so.HarmonicLoad(0, 1.0)])
    with pytest.raises(so.InputError, match=r"DOF \d by 1 \(one of 2 such motions\)"):
        so.frequency_response(two, (0.1, 0.2))


def test_rayleigh_may_depend_on_parameters(structure):
    system = structure.system(parameters={"a": 0.1, "b": 0.2}, damping=so.Rayleigh("a", "2*b"))
    _, c, k = system.matrices()
    np.testing.assert_allclose(c, 0.1 * np.eye(8) + 0.4 * k)
    _, c, _ = structure.system(parameters={"a": 0.1}, damping=so.Rayleigh("a", "a")).matrices()
    np.testing.assert_allclose(c, 0.1 * (np.eye(8) + k))


@pytest.mark.parametrize("losses", [0.03, "2*eta", "matrix"])
def test_structural_damping_is_kept(structure, losses, tmp_path):
    given = abs(structure.stiffness) if losses == "matrix" else losses
    damped = so.Structure(structure.mass, structure.stiffness, dofs=structure.dofs, structural=given)
    assert "structural" in repr(damped)
    damped.save(tmp_path / "damped.npz")
    parameters = {"eta": 0.1} if losses == "2*eta" else {}
    for one in (damped, so.read_structure(tmp_path / "damped.npz"), damped.with_damping(None)):
        system = one.fixed([0]).system(parameters=parameters)
        _, _, k = system.matrices()
        expected = np.abs(k) if losses == "matrix" else {0.03: 0.03, "2*eta": 0.2}[losses] * k
        np.testing.assert_allclose(system.structural.value(parameters), expected)


def test_structural_damping_of_several_structures_in_one(structure):
    damped = so.Structure(structure.mass, structure.stiffness, dofs=structure.dofs, structural=0.03)
    for other, factor in ((damped, 0.03), (structure, 0.0)):
        joined = so.structures.join(damped, other, names=["a", "b"])
        n = structure.n
        losses = joined.system().structural.value({})
        np.testing.assert_allclose(losses[n:, n:], factor * structure.stiffness.toarray())
        np.testing.assert_allclose(losses[:n, :n], 0.03 * structure.stiffness.toarray())


@pytest.mark.parametrize(
    "damping", [so.ModalDamping(0.02), so.ModalDamping([0.02, 0.02]), so.ModalDamping(0.02, count=2)]
)
def test_modal_damping_damps_modes(structure, damping):
    found = structure.natural_frequencies(8)
    c = structure.with_damping(damping).system().matrices()[1]
    ratios = np.diag(found.modes.T @ c @ found.modes) / (2 * found.omega)
    np.testing.assert_allclose(ratios[:2], 0.02)
    beyond = 0.02 if damping == so.ModalDamping(0.02) else 0.02 * found.omega[2:] / found.omega[1]
    np.testing.assert_allclose(ratios[2:], beyond, rtol=1e-7)


def test_modes_beyond_a_ratio_of_zero_are_undamped(structure):
    found = structure.natural_frequencies(8)
    c = structure.with_damping(so.ModalDamping([0.02, 0.01, 0.0])).system().matrices()[1]
    ratios = np.diag(found.modes.T @ c @ found.modes) / (2 * found.omega)
    np.testing.assert_allclose(ratios, [0.02, 0.01, *np.zeros(6)], atol=1e-14)


def test_what_grows_is_not_fed(structure):
    """A buckled structure: modes beyond those that grow are damped, these not."""
    n = structure.n
    buckled = so.Structure(
        structure.mass, structure.stiffness - 2.0 * structure.natural_frequencies(2).omega[0] ** 2 * structure.mass
    )
    found = buckled.natural_frequencies(6)
    assert found.growing >= 1
    c = buckled.with_damping(so.ModalDamping(0.02, count=4)).system().matrices()[1]
    rates = np.diag(found.modes.T @ c @ found.modes)
    np.testing.assert_allclose(rates[: found.growing], 0.0, atol=1e-9 * rates.max())
    assert np.all(rates[found.growing :] > 0.0)
    assert c.shape == (n, n)


def test_rigid_body_modes_stay_undamped():
    structure = beam(4)
    c = so.ModalDamping(0.05).matrix(structure.mass, structure.stiffness)
    translation = structure.direction({(i, "z"): 1.0 for i in range(5)})
    assert np.abs(c @ translation).max() < 1e-8 * np.abs(c.toarray()).max()


@pytest.mark.parametrize(
    "make",
    [
        lambda: so.ModalDamping(-0.1),
        lambda: so.ModalDamping([]),
        lambda: so.ModalDamping("a"),
        lambda: so.ModalDamping([0.1], count=2),
        lambda: so.ModalDamping(0.1, count=0),
        lambda: so.Rayleigh("a +"),
        lambda: so.Rayleigh(np.nan),
    ],
)
def test_what_is_no_damping_is_refused(make):
    with pytest.raises(so.InputError):
        make()


@pytest.mark.parametrize("lowest", [0.0, 1.5, 30.0])
def test_frequencies_of_many_degrees_of_freedom(lowest):
    """Also where the stiffness is not positive, and has to be eliminated with pivots."""
    n = 900
    parts = [-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)]
    stiffness = n**2 / np.pi**2 * scipy.sparse.diags_array(parts, offsets=[-1, 0, 1]) - lowest * scipy.sparse.eye_array(
        n
    )
    structure = so.Structure(scipy.sparse.eye_array(n).tocsr(), stiffness.tocsr())
    squares = (2.0 * n / np.pi * np.sin(0.5 * np.pi * np.arange(1, n + 1) / (n + 1))) ** 2 - lowest
    found = structure.natural_frequencies(8)
    wanted = np.sign(squares) * np.sqrt(np.abs(squares))
    np.testing.assert_allclose(found.omega, np.sort(wanted[:8]), rtol=1e-7)
    assert found.growing == (squares < 0.0).sum()


def rod(n, damping):
    """A rod held at one end, a stop and a load at the other; the first frequency is near 1."""
    stiffness = scipy.sparse.diags_array(
        [-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], offsets=[-1, 0, 1]
    ).tolil()
    stiffness[n - 1, n - 1] = 1.0
    mass = scipy.sparse.eye_array(n).tocsr()
    structure = so.Structure(mass / n, (4.0 * n / np.pi**2) * stiffness.tocsr(), damping=damping)
    return structure, structure.system([so.ElasticStop(n - 1, 2.0, 0.5)], [so.HarmonicLoad(n - 1, 0.02)])


def test_modal_damping_of_all_modes_of_a_large_structure_asks_for_their_number():
    with pytest.raises(so.InputError, match="how many modes"):
        rod(2001, so.ModalDamping(0.1))


def test_modal_damping_of_a_large_structure():
    """The update that is never written out, against the full matrix."""
    structure, system = rod(2500, so.ModalDamping(0.01, count=30))
    assert isinstance(system.damping.sparse_value({}), Updated)
    found = structure.natural_frequencies(40)
    ratios = np.einsum("im,im->m", found.modes, system.damping.sparse_value({}) @ found.modes) / (2.0 * found.omega)
    np.testing.assert_allclose(ratios[:30], 0.01, rtol=1e-6)
    np.testing.assert_allclose(ratios[30:], 0.01 * found.omega[30:] / found.omega[29], rtol=1e-6)
    linear = so.condense(system, 1.2, harmonics=9)
    assert linear.error < 1e-8
    curve = so.frequency_response(system, (0.9, 1.2), harmonics=9, linear=linear)
    assert curve.bifurcations["LP"]


def test_modal_damping_counted_or_written_out_is_the_same(tmp_path):
    _, system = rod(60, so.ModalDamping(0.01, count=8))
    full = so.System(system.mass, system.damping.value({}), system.stiffness, system.elements, system.loads)
    one, other = (so.frequency_response(each, (0.9, 1.2), harmonics=9) for each in (system, full))
    assert [b.kind for b in one.bifurcations] == [b.kind for b in other.bifurcations] != []
    np.testing.assert_allclose(*([b.omega for b in each.bifurcations] for each in (one, other)), rtol=1e-9)
    path = one.save(tmp_path / "rod.nc") or tmp_path / "rod.nc"
    again = so.load(path).orbits[0].system.damping
    assert isinstance(again.sparse_value({}), Updated)
    np.testing.assert_array_equal(again.value({}), system.damping.value({}))
    forces = [each.transmitted_force() for each in (one, other)]
    # bases are made for the forces, not for the ground
    np.testing.assert_allclose(*forces, rtol=1e-4)


def test_joined_structures_keep_their_modal_damping(structure, tmp_path):
    one, other = structure.with_damping(so.ModalDamping(0.02, count=3)), structure.with_damping(so.Rayleigh(0.1, 0.0))
    joined = so.structures.join(one, other, names=["a", "b"])
    n, c = structure.n, joined.system().damping.value({})
    np.testing.assert_allclose(c[:n, :n], one.system().damping.value({}), atol=1e-12 * c.max())
    np.testing.assert_allclose(c[n:, n:], other.system().damping.value({}), atol=1e-12 * c.max())
    assert not c[:n, n:].any()
    assert "nonzeros" in repr(joined)
    joined.save(tmp_path / "both.npz")
    again = so.read_structure(tmp_path / "both.npz")
    np.testing.assert_allclose(again.system().damping.value({}), c, atol=1e-15)
    held = joined.fixed([joined.dofs.names[0]])
    np.testing.assert_allclose(held.system().damping.value({}), c[1:, 1:], atol=1e-15)


# -------------------------------------------------------------------------------------------------------------- systems
def test_elements_stand_at_labelled_places(structure):
    system = structure.system(
        elements=[so.ElasticStop(dof=structure.dof("node 1042", "z"), stiffness="k", gap=0.1)],
        loads=[so.HarmonicLoad(direction=structure.direction({(7, "x"): 1.0, (77, "x"): 1.0}), amplitude=0.2)],
        parameters={"k": 5.0},
        damping=so.Rayleigh(0.05),
    )
    assert system.dof_names[:2] == ("1042 x", "1042 z")
    assert system.name == "chain"
    assert "1042 z" in repr(system)
    np.testing.assert_array_equal(system.elements[0].direction(8), np.eye(8)[1])


def test_a_stop_that_is_never_reached_leaves_the_linear_response(structure, chain):
    """The response curve against (K - omega^2 M + i omega C)^-1 p."""
    system = structure.system(
        elements=[so.ElasticStop(dof=structure.dof(1042, "z"), stiffness=5.0, gap=100.0)],
        loads=[so.HarmonicLoad(dof=structure.dof(1042, "z"), amplitude=0.2)],
        damping=so.Rayleigh(0.05, 0.01),
    )
    orbit = so.periodic_orbit(system, 1.3, start=np.zeros(16))
    c = 0.05 * chain.mass + 0.01 * chain.stiffness
    exact = np.linalg.solve(chain.stiffness - 1.3**2 * chain.mass + 1.3j * c, 0.2 * np.eye(8)[1])
    assert orbit.amplitude(1) == pytest.approx(abs(exact[1]), rel=1e-9)


def test_the_text_of_a_structure_tells_sizes(structure):
    text = repr(structure.with_damping(so.Rayleigh(0.1, 0.2)))
    assert "Structure 'chain': 8 DOFs (1042 x, 1042 z, 7 x, 7 z, ...)" in text
    assert "mass 8, stiffness 20" in text
    assert "Rayleigh(alpha=0.1, beta=0.2)" in text


# ---------------------------------------------------------------------------------------------------------- wrong input
EYE = np.eye(3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"stiffness": np.eye(4)}, r"the stiffness is 4 x 4, the mass 3 x 3"),
        ({"stiffness": np.ones((3, 2))}, "the stiffness must be square, not 3 x 2"),
        ({"stiffness": np.zeros((0, 0)), "mass": np.zeros((0, 0))}, "must be square"),
        ({"stiffness": np.ones(3)}, "must be a matrix of numbers, not of shape"),
        ({"stiffness": "K.npz"}, "must be a matrix of numbers"),
        ({"stiffness": None}, "stiffness must be a matrix of numbers, not None"),
        ({"stiffness": EYE * (1 + 0.1j)}, "the stiffness is complex: give its real part, and structural"),
        ({"stiffness": np.array([[1, 0, 0], [0, np.nan, 0], [0, 0, 1]])}, r"not finite: \[1, 1\] is nan"),
        (
            {"stiffness": np.array([[1, 0, 0], [0, 1, 2], [0, 2.5, 1]])},
            r"not symmetric: \[1, 2\] is 2, \[2, 1\] is 2.5",
        ),
        (
            {"stiffness": np.array([[1, 0, 0], [0, 1e6, 2e5], [0, 2e5 + 0.02, 1e6]])},
            r"\[1, 2\] is 200000, \[2, 1\] is 200000, 0.02 apart; that is 2e-08 of the largest .*0.5 \* \(A \+ A.T\)",
        ),
        ({"stiffness": np.tril(np.ones((3, 3)))}, "only the lower triangle has entries"),
        ({"mass": np.triu(np.ones((3, 3)))}, "the mass is not symmetric.*only the upper triangle"),
        ({"mass": np.diag([1.0, -1.0, 1.0])}, "the mass is not positive definite.*DOFs 1"),
        ({"mass": np.zeros((3, 3))}, "no DOF has inertia"),
        ({"damping": np.eye(2)}, "the damping is 2 x 2"),
        ({"damping": 3.0}, "the damping must be a matrix"),
        ({"dofs": [(1, "x"), (2, "x")]}, "the DOF map has 2 labels, the matrices 3 DOFs"),
        ({"dofs": [(1, "x"), (2, "x"), ("node 1", 1)]}, "names 1 x more than once"),
        ({"dofs": [1, 2, 3]}, "pairs .node, direction."),
        ({"mesh": 3}, "mesh must be a Mesh"),
    ],
)
def test_what_is_no_structure_is_refused(arguments, message):
    with pytest.raises(so.InputError, match=message) as caught:
        so.Structure(**{"mass": EYE, "stiffness": EYE, **arguments})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", [scipy.sparse.csr_array, scipy.sparse.csc_matrix])
def test_indices_outside_of_a_sparse_matrix_are_refused(kind):
    matrix = kind(EYE)
    matrix.indices = np.array([0, 1, 7], dtype=np.int32)
    with pytest.raises(so.InputError, match="the stiffness is no sparse matrix: indices"):
        so.Structure(EYE, matrix)


def test_asymmetry_is_judged_in_any_units():
    """Rotations of a beam in millimetres are 1e6 times as stiff as displacements: rounding there is none here."""
    stiffness = np.array([[1.0, 1e3], [1e3 * (1 + 1e-12), 1e9]])
    assert so.Structure(np.eye(2), stiffness).stiffness[0, 1] == so.Structure(np.eye(2), stiffness).stiffness[1, 0]
    stiffness[1, 0] = 1e3 * (1 + 1e-4)
    with pytest.raises(so.InputError, match="not symmetric"):
        so.Structure(np.eye(2), stiffness)


def test_a_structure_does_not_change(structure):
    with pytest.raises(AttributeError):
        structure.name = "other"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": [1, 2]}, r"an array \(N, 3\)"),
        ({"points": [[0, 0, np.inf]]}, "not finite"),
        ({"cells": {"line": [[0, 5]]}}, "there is no point 5, only 0 to 1"),
        ({"cells": {"line": [0, 1]}}, "'line' of a mesh"),
        ({"cells": [1]}, "a mapping"),
        ({"nodes": [1, 1]}, "2 different labels"),
    ],
)
def test_what_is_no_mesh_is_refused(arguments, message):
    with pytest.raises(so.InputError, match=message):
        so.Mesh(**{"points": [[0, 0], [1, 0]], "cells": {"line": [[0, 1]]}, **arguments})


def test_observed_by_name():
    """Labels of degrees of freedom are names, which verbs take for numbers."""
    structure = so.structures.beam(0.7, 0.014, 0.014, 2.05e11, 7800.0, 4)
    tip, middle = structure.dof(4, "z"), structure.dof(2, "z")
    system = structure.system([so.CubicSpring(tip, 1e9)], [so.HarmonicLoad(tip, 0.3)], damping=so.Rayleigh(3.0, 0.0))
    branch = so.frequency_response(system, (100.0, 101.0), harmonics=3, observe="2 z")
    point = branch.points[0]
    assert branch.observe == middle
    assert branch.amplitude[0] == point.orbit.amplitude(middle)
    assert so.condense(system, 100.0, observe="2 z").size == so.condense(system, 100.0, observe=[middle]).size
    with pytest.raises(so.InputError, match=r"'2 zz' is none of the degrees of freedom \(did you mean"):
        so.frequency_response(system, (100.0, 101.0), harmonics=3, observe="2 zz")


@pytest.mark.parametrize("dof", ["2 z", "node 2 Z", ("2", "z"), (2, "z")])
def test_elements_and_loads_take_names(dof):
    """The system has the numbers; one alone knows none."""
    structure = beam(4)
    number = structure.dof("2 z")
    stop = so.ElasticStop(dof, 1.0, 0.1)
    system = structure.system([stop], [so.HarmonicLoad(dof, 0.3)], damping=so.Rayleigh(3.0, 0.0))
    assert system.elements[0].place.dofs == system.loads[0].place.dofs == (number,)
    assert "dof=" in repr(stop)
    with pytest.raises(InputError, match="is a name, which a System with dof_names has"):
        stop.direction(3)
    with pytest.raises(InputError, match="they have no names"):
        so.System(1.0, 0.1, 1.0, [stop])


def test_two_names_are_a_difference():
    parts = np.eye(2), 0.1 * np.eye(2), np.eye(2)
    names = ["left", "right"]
    system = so.System(*parts, [so.CubicSpring(("left", "right"), 1.0)], dof_names=names)
    np.testing.assert_array_equal(system.elements[0].direction(2), [1.0, -1.0])
    law = so.Expression("left", "u*w", inputs={"u": "left", "w": ("right", "left")})
    np.testing.assert_array_equal(so.System(*parts, [law], dof_names=names).elements[0].inputs(2), [[1, 0], [-1, 1]])
    with pytest.raises(InputError, match=r"CubicSpring: dof='lefft' is none .*did you mean 'left'"):
        so.System(*parts, [so.CubicSpring("lefft", 1.0)], dof_names=names)


@pytest.mark.parametrize("damping", [so.ModalDamping(0.02), so.ModalDamping(0.02, 2), so.Rayleigh(0.1, "b")])
@pytest.mark.parametrize("sparse", [True, False])
def test_a_system_takes_what_a_structure_does(structure, damping, sparse):
    mass, stiffness = structure.mass, structure.stiffness
    if not sparse:
        mass, stiffness = mass.toarray(), stiffness.toarray()
    parameters = {"b": 1e-3} if isinstance(damping, so.Rayleigh) else {}
    system = so.System(mass, damping, stiffness, parameters=parameters)
    wanted = structure.system(damping=damping, parameters=parameters).damping
    np.testing.assert_allclose(system.damping.value(parameters), wanted.value(parameters), atol=1e-12)
    assert system.damping.sparse == sparse


def test_damping_by_modes_of_matrices_with_parameters_is_refused():
    with pytest.raises(so.InputError, match="without parameters, but k is in them"):
        so.System(1.0, so.ModalDamping(0.01), "k", parameters={"k": 2.0})
    one = so.System(1.0, so.ModalDamping(0.01), 4.0)
    assert one.damping.value({})[0, 0] == pytest.approx(0.04)
