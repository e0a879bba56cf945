"""Branches that leave others: where they begin, where they end, what is on them; against shooting and identities."""

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation.bordered import branching_equation, doubled_direction, null_vectors
from suboctave.curves.identity import relation
from suboctave.errors import InputError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.perturbation import Kind

RANGE = (4.5, 1.3)


def at(items):
    return np.array([b.omega for b in items])


@pytest.fixture(scope="module")
def weak():
    """The reference oscillator at p = 0.55 and its two period doublings."""
    return so.frequency_response(so.library.reference_oscillator(p=0.55, regularization=3000.0), RANGE)


@pytest.fixture(scope="module")
def strong():
    """The same at p = 1.7, with the 2T branch from its first period doubling."""
    curve = so.frequency_response(so.library.reference_oscillator(p=1.7, regularization=3000.0), RANGE)
    return curve, so.switch_branch(curve.bifurcations["PD"][0])


@pytest.mark.parametrize("begin", [0, 1])
def test_the_2T_branch_leads_from_either_doubling_to_the_other(weak, reference, begin):
    """With the two limit points that shooting finds, and no period doubling of its own."""
    known = sorted(reference["subharmonics_s3000"]["p0.55"]["2T"], key=lambda row: row[1])
    first, last = weak.bifurcations["PD"][begin], weak.bifurcations["PD"][1 - begin]
    branch = so.switch_branch(first)
    assert branch.nu == 2
    assert not branch.closed
    assert branch.departs.omega == first.omega
    assert branch.arrives.omega == pytest.approx(last.omega, abs=1e-6)
    assert branch.arrives.amplitude == pytest.approx(last.amplitude, rel=1e-6)
    assert len(branch.bifurcations["PD"]) == 0
    found = sorted(branch.bifurcations["LP"], key=lambda b: b.omega)
    np.testing.assert_allclose(at(found), [row[1] for row in known], atol=1e-5)
    np.testing.assert_allclose([b.amplitude for b in found], [row[2] for row in known], atol=2e-5)
    assert branch.audit.complete


def test_both_signs_of_the_null_vector_give_the_same_motions(weak):
    """Shifted by one period of the parent."""
    one, other = (so.switch_branch(weak.bifurcations["PD"][0], side=side).orbits[20] for side in (1, -1))
    t = np.linspace(0.0, one.period, 50)
    np.testing.assert_allclose(one.displacement(t), other.displacement(t + one.period / 2), atol=1e-9)


def test_the_cascade_of_the_strongly_forced_oscillator(strong, reference):
    """2T with its doublings and folds, 4T with its doublings, to 1e-5 of shooting."""
    known = reference["subharmonics_s3000"]["p1.7"]
    _, two = strong
    four = so.switch_branch(two.bifurcations["PD"][0])
    for branch, rows in ((two, known["2T"]), (four, known["4T"])):
        for kind in ("LP", "PD"):
            expected = sorted(row[1] for row in rows if row[0] == kind)
            np.testing.assert_allclose(sorted(at(branch.bifurcations[kind])), expected, atol=1e-5)
    assert four.nu == 4
    assert four.arrives.omega == pytest.approx(two.bifurcations["PD"][1].omega, abs=1e-6)


def direction_of(item):
    """Which way omega goes on the branch that leaves a period doubling, from its first three points."""
    stepping = so.SteppingOptions(max_step=1e-3, initial_step=1e-3, max_points=3)
    branch = so.switch_branch(item, stepping=stepping)
    return np.sign(branch.omega[1] - branch.omega[0])


def stands_for(item):
    """The side on which the branch must lie: a supercritical one where the parent's multiplier is beyond -1."""
    form = item.normal_form
    return np.sign(form["curvature"])


def test_criticality_is_that_of_the_branch_itself(weak, strong):
    response, two = strong
    four = so.switch_branch(two.bifurcations["PD"][0])
    doublings = [d for curve in (weak, response, two, four) for d in curve.bifurcations["PD"]]
    assert len(doublings) == 10
    for item in doublings:
        assert direction_of(item) == stands_for(item)
    # the branch of a subcritical one turns back at a limit point before it can attract
    assert [item.criticality for item in doublings].count("subcritical") >= 1


@pytest.mark.parametrize("number", [0, 1, 2, *(pytest.param(n, marks=pytest.mark.slow) for n in range(3, 20))])
def test_criticality_along_the_curve_of_doublings_over_the_gap(number):
    """Twenty gaps drawn by a fixed seed, on both sides of the generalised period doublings of the arctan law.

    For j between these the branch leaves on the other side at once. Just outside, it begins as told and turns back at a
    limit point within 1e-3.
    """
    gap = np.random.default_rng(11).uniform(0.0, 0.177, 20)[number]
    system = so.library.reference_oscillator(p=0.55, j=float(gap), regularization=3000.0)
    curve = so.frequency_response(system, (4.5, 1.9))
    first, last = curve.bifurcations["PD"]
    for item in (first, last):
        assert item.criticality is not None
        assert direction_of(item) == stands_for(item)
        unstable = curve.omega[~curve.stable & (curve.omega < first.omega) & (curve.omega > last.omega)]
        inwards = np.sign(unstable.mean() - item.omega)
        assert (item.criticality == "supercritical") == (direction_of(item) == inwards)


@pytest.mark.slow
def test_no_event_hides_right_beside_the_parent(strong):
    """The 8T branch doubles again within 4e-4 of where it begins: seen from either end, the events are the same."""
    four = so.switch_branch(strong[1].bifurcations["PD"][0])
    one, other = (so.switch_branch(item) for item in four.bifurcations["PD"])
    found = [sorted((b.kind, b.omega) for b in branch.bifurcations) for branch in (one, other)]
    assert [kind for kind, _ in found[0]] == [kind for kind, _ in found[1]] == ["LP", "PD", "PD"]
    np.testing.assert_allclose([w for _, w in found[0]], [w for _, w in found[1]], atol=1e-5)
    for item in one.bifurcations:
        assert so.verify(item).agrees


@pytest.mark.parametrize("max_step", [0.03, 0.1, 0.3, pytest.param(0.005, marks=pytest.mark.slow)])
def test_no_doubling_of_the_2T_branch_is_missed_at_any_step(strong, max_step):
    """AUTO-07p misses the one at 2.448 from steps of 0.01 up."""
    branch = so.switch_branch(strong[0].bifurcations["PD"][0], max_step=max_step)
    np.testing.assert_allclose(sorted(at(branch.bifurcations["PD"])), [2.44814534, 3.02870285], atol=1e-5)
    np.testing.assert_allclose(sorted(at(branch.bifurcations["LP"])), [3.0734387, 3.65104021], atol=1e-5)


def test_a_2T_motion_satisfies_the_equation_of_motion(strong):
    """Shooting from the motion of harmonic balance finds the same one, with the same multipliers."""
    branch = strong[1]
    for point in (branch.points[30], branch.bifurcations["PD"][0]):
        assert so.verify(point.orbit).agrees


def test_the_branching_equation_in_the_doubled_basis_finds_the_half_odd_null_vector(weak):
    """At a period doubling the 2T equations have a branch point: T along its own tangent, 2T along phi_half."""
    item = weak.bifurcations["PD"][0]
    parent, size = item.orbit.basis, item.orbit.balance.size
    doubled = HarmonicBasis(2 * parent.harmonics + 1, 2)
    x = parent.resized(item.orbit.coefficients, doubled)
    balance = item.orbit.balance.with_basis(doubled)
    vectors = null_vectors(item.orbit.state(), Kind.HALF)
    phi = doubled_direction(vectors.right * np.tile(balance.scales[1], len(vectors.right) // size), size, doubled)
    equation = branching_equation(balance.at(x, item.omega, item.parameters), "omega", 3.2)
    expected = np.append(phi.ravel(), 0.0)
    expected /= np.linalg.norm(equation.weights * expected)
    cosines = [abs((equation.weights * d) @ (equation.weights * expected)) for d in equation.directions]
    assert max(cosines) == pytest.approx(1.0, abs=1e-7)
    other = equation.directions[int(np.argmin(cosines))]
    odd = other[:-1].reshape(doubled.size, size)[
        [i for k in range(1, doubled.harmonics + 1, 2) for i in (2 * k - 1, 2 * k)]
    ]
    assert np.abs(odd).max() < 1e-7 * np.abs(other).max()


# ------------------------------------------------------------------------------------------------------ branch points
@pytest.fixture(scope="module")
def symmetric():
    """A symmetric Duffing oscillator, which loses its symmetry between two branch points."""
    return so.frequency_response(so.library.duffing(c=0.05, F=1.0), (0.15, 3.5))


def test_the_mirror_branches_of_a_symmetric_oscillator(symmetric):
    """Their halves are each other's mirror images, -x(t + T / 2), and lead from one branch point to the other."""
    first, last = symmetric.bifurcations["BP"]
    halves = [so.switch_branch(first, side=side) for side in (1, -1)]
    for half in halves:
        assert half.departs.omega == first.omega
        assert half.arrives.omega == pytest.approx(last.omega, abs=1e-7)
        assert len(half.bifurcations) == 0
    one, other = (half.orbits[8] for half in halves)
    assert abs(one.amplitudes[0, 0]) > 0.01
    t = np.linspace(0.0, one.period, 40)
    np.testing.assert_allclose(one.displacement(t), -other.displacement(t + one.period / 2), atol=1e-8)
    assert so.verify(one).agrees


def test_both_ways_the_other_branch_closes_through_both_branch_points(symmetric):
    first, last = symmetric.bifurcations["BP"]
    whole = so.switch_branch(last)
    assert whole.closed
    np.testing.assert_allclose(at(whole.bifurcations["BP"]), [last.omega, first.omega], atol=1e-8)
    assert len(whole.bifurcations) == 2
    assert whole.audit.complete


def test_mirror_images_have_bifurcations_of_their_own():
    """Every event of one half of a closed branch of unsymmetric motions is on the other too, as large."""
    curve = so.frequency_response(so.library.duffing(c=0.1, F=30.0), (4.0, 0.5))
    for start in curve.bifurcations["BP"][:3]:
        loop = so.switch_branch(start)
        assert "closed" in loop.ended
        found = [b for b in loop.bifurcations if b.kind != "BP"]
        half = len(found) // 2
        assert half >= 4
        assert [b.kind for b in loop.bifurcations].count("BP") == 2
        for one, other in zip(found[:half], reversed(found[half:]), strict=True):
            assert one.kind == other.kind
            assert one.omega == pytest.approx(other.omega, rel=1e-9)
            assert not relation(one.orbit, other.orbit, 1e-3).one
            # half a period later with the other sign
            turned = one.orbit.amplitudes * -((-1.0) ** np.arange(one.orbit.basis.harmonics + 1))[:, None]
            top = min(len(turned), len(other.orbit.amplitudes))
            assert np.abs(turned[:top] - other.orbit.amplitudes[:top]).max() < 1e-5 * one.amplitude


def test_going_on_from_a_branch_point_stays_on_its_own_branch(symmetric):
    """Not along an arbitrary mix of the two: the symmetric motions have no mean."""
    again = so.continue_branch(symmetric.bifurcations["BP"][0], "omega", (0.15, 3.5))
    assert np.abs(again.harmonic(0)).max() < 1e-9
    for kind in ("LP", "BP"):
        np.testing.assert_allclose(at(again.bifurcations[kind]), at(symmetric.bifurcations[kind]), atol=1e-8)


def test_a_transcritical_branch_point_at_rest():
    """Parametric excitation at the natural frequency with a quadratic spring: rest and a T motion cross and go on.

    Rest loses its stability where a multiplier of Mathieu's equation passes +1; there the other branch crosses it.
    """
    force = so.Expression(0, "q*cos(omega*t)*x + 0.3*x**2 + 0.3*x**3")
    system = so.System(1.0, 0.1, 1.0, elements=[force], parameters={"q": 0.9})
    rest = so.frequency_response(system, (0.7, 1.3), start=np.zeros((11, 1)))
    points = at(rest.bifurcations["BP"])
    assert len(points) == 2
    # Hill's determinant of the harmonics -8 .. 8, scaled
    k = np.arange(-8, 9)
    for omega in points:
        s = 1j * k * omega
        matrix = np.diag(s**2 + 0.1 * s + 1.0) + 0.45 * (np.eye(17, k=1) + np.eye(17, k=-1))
        assert np.linalg.cond(matrix / np.maximum(1.0, np.abs(s) ** 2)[:, None]) > 1e8
    branch = so.switch_branch(rest.bifurcations["BP"][0], bounds=(0.5, 1.5))
    np.testing.assert_allclose(sorted(at(branch.bifurcations["BP"])), points, atol=1e-8)
    assert branch.closed
    # it crosses: motions on both sides of the branch point
    assert branch.omega.min() < points[0] - 1e-3
    assert branch.omega.max() > points[1] + 1e-3
    assert branch.audit.complete
    assert so.verify(branch.orbits[len(branch) // 2]).agrees


# ------------------------------------------------------------------------------------ several DOFs, other parameters
def test_a_2T_branch_of_two_masses_with_a_stop():
    """Both ends are period doublings of the response; a motion in between is the one that shooting finds."""
    system = so.library.two_mass_unilateral(Kc=3.0, gap=0.3, F=0.3, damping=0.05)
    response = so.frequency_response(system, (2.6, 1.0))
    first, last = response.bifurcations["PD"]
    branch = so.switch_branch(first)
    assert branch.nu == 2
    assert branch.arrives.omega == pytest.approx(last.omega, abs=2e-6)
    for orbit in (branch.orbits[len(branch) // 3], branch.orbits[2 * len(branch) // 3]):
        assert so.verify(orbit).agrees


def test_along_another_parameter(weak):
    """A 2T branch over the gap at fixed frequency, from a doubling found along the gap."""
    orbit = min(weak.orbits, key=lambda o: abs(o.omega - 3.0))
    over_gap = so.continue_branch(orbit, "j", (0.0, 0.3))
    doubling = over_gap.bifurcations["PD"][0]
    branch = so.switch_branch(doubling)
    assert branch.name == "j"
    assert np.ptp(branch.omega) == 0.0
    assert branch.departs.parameter == pytest.approx(doubling.parameter("j"))
    assert so.verify(branch.orbits[len(branch) // 2]).agrees


def test_from_a_file(weak, tmp_path):
    """A loaded bifurcation leads onto the same branch, bit for bit, and the branch remembers where it came from."""
    read = so.load(weak.save(tmp_path / "response.nc"))
    one, other = (so.switch_branch(c.bifurcations["PD"][0], max_step=0.2) for c in (weak, read))
    np.testing.assert_array_equal(one.omega, other.omega)
    np.testing.assert_array_equal(one.amplitude, other.amplitude)
    again = so.load(one.save(tmp_path / "doubled.nc"))
    assert (again.departs, again.arrives) == (one.departs, one.arrives)
    assert repr(again) == repr(one)


# --------------------------------------------------------------------------------------------------------- wrong input
def test_what_cannot_be_switched_at(weak):
    with pytest.raises(InputError, match="turns back, no other branch"):
        so.switch_branch(weak.bifurcations["LP"][0])
    with pytest.raises(InputError, match="no other branch leaves"):
        so.switch_branch(weak.grazings[0])
    with pytest.raises(InputError, match=r"must be a Bifurcation, not Branch"):
        so.switch_branch(weak)
    with pytest.raises(InputError, match=r"side must be"):
        so.switch_branch(weak.bifurcations["PD"][0], side=2)
    with pytest.raises(InputError, match="outside the bounds"):
        so.switch_branch(weak.bifurcations["PD"][0], bounds=(1.0, 2.0))


def test_the_beginning_of_a_closed_branch_is_no_limit_point():
    """Where it passes its own beginning it turns back at the branch point."""
    gaps = ((1.0, "right"), (-1.0, "left"))
    stops = [so.ElasticStop(0, 5.0, gap, side=side, regularization=50.0) for gap, side in gaps]
    system = so.System(1.0, 0.08, 1.0, stops, [so.HarmonicLoad(0, 3.0)])
    symmetric = so.frequency_response(system, (0.3, 0.5), harmonics=45)
    loop = so.switch_branch(symmetric.bifurcations["BP"][0])
    assert "closed" in loop.ended
    assert loop.warnings == ()
    # each on either half
    found = sorted(b.omega for b in loop.bifurcations["LP"])
    assert len(found) == 8
    assert found[::2] == pytest.approx(found[1::2], abs=1e-8)


def test_a_step_that_ends_right_on_the_parent_has_met_it():
    """Its motion has an odd part of 2e-6: limit points found on what followed were those of the parent's doubling."""
    system = so.System.from_equations(
        "x'' + 0.05*x' + x - 0.9*x**2 + 0.35*x**3 = p*cos(omega*t)", parameters={"p": 0.25}
    )
    doublings = so.frequency_response(system, (0.3, 2.6)).bifurcations["PD"]
    both = [so.switch_branch(item) for item in doublings]
    for branch in both:
        assert [b.kind for b in branch.bifurcations] == ["LP"] * 3
        assert "reached the T motion" in branch.ended
    first, last = (sorted(b.omega for b in branch.bifurcations) for branch in both)
    np.testing.assert_allclose(first, last, rtol=1e-9)
