"""Multiple bifurcations: equal oscillators in a ring, or each coupled to all, excited alike.

Their motion in phase is that of one oscillator; what they may do against each other goes by the modes of the coupling,
each a Hill equation with an eigenvalue of it added to the stiffness. Two eigenvalues of a ring are equal, n - 1 where
each is coupled to all.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import suboctave as so
from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.bifurcation.measures import upper
from suboctave.curves.events.locate import Guess, locate_multiple
from suboctave.curves.kinds.multiple import MultiplePoint
from suboctave.curves.tracked.start import curve_through
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.perturbation import Kind
from suboctave.timedomain import locate_by_shooting

DAMPING = 0.03


def coupling(n, every):
    """Of a ring, or of each with all."""
    if every:
        return n * np.eye(n) - np.ones((n, n))
    return 2.0 * np.eye(n) - np.roll(np.eye(n), 1, axis=0) - np.roll(np.eye(n), -1, axis=0)


def oscillators(n, k, p=0.4, *, every=False, detuned=0.0, spring=None, damping=DAMPING):
    """Quadratic and cubic springs: their motions of twice the period begin close to omega = 2."""
    stiffness = np.eye(n) + k * coupling(n, every)
    stiffness[0, 0] += detuned
    springs = [spring or {2: 0.5, 3: 0.2}] * n
    elements = [so.PolynomialSpring(i, one) for i, one in enumerate(springs)]
    loads = [so.HarmonicLoad(i, "p") for i in range(n)]
    return so.System(np.eye(n), damping * np.eye(n), stiffness, elements, loads, {"p": p})


def duffing(n, k, p=0.1):
    return oscillators(n, k, p, spring={3: 0.5}, damping=0.01)


def monodromy(event, eigenvalue, spring, damping=DAMPING):
    """Of the Hill equation of one mode of the coupling along a motion in phase."""
    orbit = event.orbit

    def slope(t, y):
        x = float(orbit.displacement(t)[0])
        stiffness = 1.0 + eigenvalue + sum(power * c * x ** (power - 1) for power, c in spring.items())
        return [y[1], -damping * y[1] - stiffness * y[0], y[3], -damping * y[3] - stiffness * y[2]]

    last = solve_ivp(slope, (0.0, orbit.period), [1.0, 0.0, 0.0, 1.0], rtol=1e-11, atol=1e-12, method="DOP853").y[:, -1]
    return np.array([[last[0], last[2]], [last[1], last[3]]])


@pytest.fixture(scope="module")
def six():
    return so.frequency_response(oscillators(6, 0.01), (1.8, 2.3))


@pytest.fixture(scope="module")
def ring():
    return so.frequency_response(oscillators(4, 0.01), (1.8, 2.3))


@pytest.fixture(scope="module")
def in_phase():
    return so.frequency_response(duffing(3, -0.02), (0.9, 2.0))


def test_all_doublings_of_a_ring_are_located(six):
    # four eigenvalues of the coupling, two of them double; each mode doubles at two frequencies
    assert [event.multiplicity for event in six.bifurcations] == [1, 2, 2, 2, 2, 1, 1, 2, 2, 2, 2, 1]
    assert {event.kind for event in six.bifurcations} == {"PD"}
    assert not six.audit.unsettled
    assert not six.warnings


@pytest.mark.parametrize("which", [0, 1, 3, 5])
def test_each_is_that_of_a_hill_equation(six, which):
    event, eigenvalue = six.bifurcations[which], 0.02 * (1.0 - np.cos(np.pi * [0, 1, None, 2, None, 3][which] / 3.0))
    matrix = monodromy(event, eigenvalue, {2: 0.5, 3: 0.2})
    assert np.linalg.det(matrix + np.eye(2)) == pytest.approx(0.0, abs=1e-8)


def test_three_fall_together_where_each_is_coupled_to_all():
    branch = so.frequency_response(oscillators(4, 0.01, every=True), (1.8, 2.3))
    assert [event.multiplicity for event in branch.bifurcations] == [1, 3, 3, 3, 1, 3, 3, 3]
    assert not branch.audit.unsettled
    assert not branch.warnings


def test_null_vectors_lie_along_branches(ring):
    first, other = (event for event in ring.bifurcations[:3] if event.multiplicity == 2)
    patterns = []
    for event in (first, other):
        vector = event.null_vectors.right.reshape(-1, 4)
        patterns.append(np.abs(vector[np.argmax(np.abs(vector).max(axis=1))]))
        patterns[-1] /= patterns[-1].max()
    # two of four stand still, or two move against two
    rest, against = sorted(patterns, key=np.sum)
    assert np.allclose(np.sort(rest), [0.0, 0.0, 1.0, 1.0], atol=1e-5)
    assert np.allclose(against, 1.0, atol=1e-5)


def test_branches_leave_with_the_symmetry_of_their_null_vector(ring):
    event = next(event for event in ring.bifurcations if event.multiplicity == 2)
    branch = so.switch_branch(event, bounds=(1.9, 2.2), max_step=0.2)
    ends = [junction.omega for junction in (branch.departs, branch.arrives)]
    doubled = [event.omega for event in ring.bifurcations if event.multiplicity == 2]
    assert ends == pytest.approx([doubled[0], doubled[-1]], rel=1e-9)
    point = branch.points[len(branch.points) // 2]
    assert point.orbit.basis.nu == 2
    assert so.verify(point.orbit).agrees
    # opposite masses do the same a period later
    x = point.orbit.x
    odd = np.r_[1 : len(x) : 4, 2 : len(x) : 4]
    assert np.allclose(x[odd][:, :2], -x[odd][:, 2:], atol=1e-8 * np.abs(x).max())


def test_a_double_branch_point(in_phase):
    points = in_phase.bifurcations["BP"]
    assert [event.multiplicity for event in points] == [2, 2]
    matrix = monodromy(points[0], -0.02 * 3.0, {3: 0.5}, 0.01)
    assert np.linalg.det(matrix - np.eye(2)) == pytest.approx(0.0, abs=1e-7)
    assert so.verify(points[0]).agrees


def test_a_double_branch_point_by_shooting_from_any_place_beside_it(in_phase):
    """Three directions lead on from there, of which one is the curve's; the determinant touches zero."""
    event, rng = in_phase.bifurcations["BP"][0], np.random.default_rng(5)
    for _ in range(2):
        start = event.orbit.start() + 1e-7 * rng.standard_normal(6)
        found = locate_by_shooting(event.orbit.system, "BP", start, event.omega, reach=0.1, multiplicity=2)
        assert found.omega == pytest.approx(event.omega, rel=1e-7)


def test_branches_of_a_double_branch_point(in_phase):
    event = in_phase.bifurcations["BP"][0]
    branch = so.switch_branch(event, bounds=(1.2, 1.6))
    # two move alike, the third does not
    shapes = [np.ptp(np.abs(orbit.x).max(axis=0)) for orbit in branch.orbits]
    assert max(shapes) > 0.1
    for orbit in branch.orbits[:: len(branch) // 3]:
        pairs = [np.abs(orbit.x[:, i] - orbit.x[:, j]).max() for i, j in ((0, 1), (1, 2), (0, 2))]
        assert min(pairs) < 1e-7
        assert so.verify(orbit).agrees


def test_followed_in_a_second_parameter(in_phase):
    event = in_phase.bifurcations["BP"][0]
    curve = so.track(event, "p", (0.08, 0.13))
    assert "codimension two" in " ".join(curve.warnings)
    (between,) = curve.at(p=0.11)
    again = so.frequency_response(duffing(3, -0.02, 0.11), (0.9, 2.0)).bifurcations["BP"][0]
    assert between.omega == pytest.approx(again.omega, rel=1e-9)
    for point in (between, curve.points[-1]):
        assert np.sort(np.abs(point.floquet.multipliers - 1.0))[1] < 1e-6


def test_sensitivity(in_phase):
    event, step = in_phase.bifurcations["BP"][0], 1e-4
    places = [
        so.frequency_response(duffing(3, -0.02, 0.1 + side * step), (0.9, 2.0)).bifurcations["BP"][0].omega
        for side in (-1.0, 1.0)
    ]
    slope = (places[1] - places[0]) / (2.0 * step)
    assert so.sensitivity(event)["p"]["omega"] == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("which", [0, 1, 3])
def test_a_parameter_that_parts_them_has_no_sensitivity(which):
    matrices = {"1": np.eye(4) + 0.01 * coupling(4, every=False), "d": np.diag([1.0, 0.0, 0.0, 0.0])}
    springs = [so.PolynomialSpring(i, {2: 0.5, 3: 0.2}) for i in range(4)]
    loads = [so.HarmonicLoad(i, "p") for i in range(4)]
    system = so.System(np.eye(4), DAMPING * np.eye(4), matrices, springs, loads, {"p": 0.4, "d": 0.0})
    event = so.frequency_response(system, (1.9, 2.0)).bifurcations[which]
    found = so.sensitivity(event)
    assert np.isfinite(found["p"]["omega"])
    assert np.isfinite(found["d"]["omega"]) == (event.multiplicity == 1)


def test_kept_in_files(ring, tmp_path):
    ring.save(tmp_path / "ring.nc")
    events = so.load(tmp_path / "ring.nc").bifurcations
    assert [event.multiplicity for event in events] == [event.multiplicity for event in ring.bifurcations]
    for event, kept in zip(ring.bifurcations, events, strict=True):
        assert np.array_equal(event.null_vectors.right, kept.null_vectors.right)
    assert "one of 2 that fall together" in repr(ring.bifurcations)


def test_each_is_switched_at_in_a_diagram(in_phase):
    diagram = so.bifurcation_diagram(duffing(3, -0.02), (0.9, 1.6), depth=1)
    assert len(list(diagram)) == 3


def test_two_that_lie_close_are_simple():
    branch = so.frequency_response(oscillators(3, 0.01, detuned=1e-4), (1.9, 2.3))
    events = branch.bifurcations["PD"]
    assert [event.multiplicity for event in events] == [1] * 6
    assert not branch.audit.unsettled
    pair = [event for event in events if 1.968 < event.omega < 1.97]
    assert len(pair) == 2
    assert abs(pair[0].omega - pair[1].omega) < 1e-4
    state = pair[0].orbit.state()
    with pytest.raises(ConvergenceError, match="simple ones lie"):
        locate_multiple(Guess(state, "omega", 0.4), Kind.HALF, 2)


def test_neimark_sacker_points_of_equal_absorbers():
    def absorbers(count, k):
        one, two = np.diag([1.0, 0.05]), np.array([[0.004, -0.002], [-0.002, 0.002]])
        unit = np.eye(count)
        ground = np.kron(unit + k * (count * unit - 1.0), np.diag([1.0, 0.0]))
        springs = [so.CubicSpring(None, 0.0042, direction=np.kron(row, [1.0, -1.0])) for row in unit]
        loads = [so.HarmonicLoad(2 * i, "p") for i in range(count)]
        return so.System(np.kron(unit, one), np.kron(unit, two), ground, springs, loads, {"p": 0.15})

    (alone,) = so.frequency_response(absorbers(1, 0.0), (0.9, 1.0)).bifurcations["NS"]
    three = so.frequency_response(absorbers(3, 0.002), (0.9, 1.0))
    # the absorbers, which nothing linear holds, are as free for three masses as for one: a few harmonics tell it all
    assert max(orbit.basis.harmonics for orbit in three.orbits) <= 11
    assert three.multiplier_errors.max() < 1e-4
    events = three.bifurcations["NS"]
    assert sorted(event.multiplicity for event in events) == [1, 2, 2]
    simple = next(event for event in events if event.multiplicity == 1)
    assert simple.omega == pytest.approx(alone.omega, rel=1e-10)
    double = next(event for event in events if event.multiplicity == 2)
    assert np.count_nonzero(np.abs(np.abs(upper(double.multipliers)) - 1.0) < 1e-7) == 2
    curve = so.track(double, "p", (0.149, 0.151))
    place = curve.points[0].orbit
    there = np.abs(np.abs(upper(curve.points[0].floquet.multipliers)) - 1.0)
    assert np.sort(there)[1] < 1e-6
    assert place.omega != double.omega


@pytest.mark.parametrize(("kind", "event"), [(Kind.HALF, "ring"), (Kind.INTEGER, "in_phase")])
def test_derivatives(kind, event, request):
    """Of all equations, by differences, at a motion beside."""
    branch = request.getfixturevalue(event)
    item = next(one for one in branch.bifurcations if one.multiplicity == 2)
    state = item.orbit.state()
    own = MultiplePoint.of(state, kind, 2, "omega")
    extra, names = np.full(own.extras, 1e-3), ("omega", "p")
    random, step = np.random.default_rng(3), 1e-6
    x = state.x + 1e-3 * random.normal(size=state.x.shape)
    direction = random.normal(size=state.x.size + own.extras + 2)

    def at(share):
        way = share * step * direction
        n, q = state.x.size, own.extras
        values = dict(state.values) | {"p": state.values["p"] + way[-1]}
        moved = state.balance.at(x + way[:n].reshape(x.shape), state.omega + way[-2], values)
        return own.at(moved, extra + way[n : n + q], names)

    def whole(equations):
        top = equations.state.residual
        top = top if equations.addition is None else top + equations.addition
        return np.append(top, equations.values)

    change = (whole(at(1.0)) - whole(at(-1.0))) / (2.0 * step)
    rows = at(0.0).jacobian(names) @ direction
    assert np.allclose(rows[:-1], change[:-1], rtol=1e-6, atol=1e-6 * np.abs(change).max())
    # tr G alone
    place = state.x.size
    assert rows[place] == pytest.approx(change[place], rel=1e-6)


def test_extrema_along_their_curves_are_the_last(in_phase):
    item = in_phase.bifurcations["BP"][0]
    plain = {name: getattr(item, name) for name in ("kind", "orbit", "floquet", "residual", "amplitude")}
    extremum = TrackedEvent(**plain | {"kind": "extremum"}, parameter_name="p", curve="BP", names=("omega", "p"))
    extremum = replace(extremum, extreme="maximum", multiplicity=2)
    with pytest.raises(InputError, match="multiple BP"):
        curve_through(extremum, item.orbit.basis, ("omega", "p"))


def van_der_pol(n):
    """A ring, coupled by springs and dampers: Hopf points where mu is what the dampers take."""
    damping = {"1": 0.05 * coupling(n, every=False), "mu": -np.eye(n)}
    stiffness = np.eye(n) + 0.1 * coupling(n, every=False)
    return so.System(np.eye(n), damping, stiffness, [so.Expression(i, "x**2*v") for i in range(n)], [], {"mu": -0.5})


def test_hopf_points_of_a_ring_and_its_rotating_waves():
    branch = so.equilibria(van_der_pol(3), "mu", (-0.3, 0.4))
    simple, *double = branch.bifurcations["Hopf"]
    assert [event.multiplicity for event in (simple, *double)] == [1, 2, 2]
    for event in double:
        assert event.parameters["mu"] == pytest.approx(0.15, abs=1e-12)
        assert event.omega == pytest.approx(np.sqrt(1.3), rel=1e-10)
    senses = []
    for event in double:
        cycles = so.limit_cycles(event, harmonics=5)
        assert [end.kind for end in cycles.bifurcations] == ["Hopf"]
        orbit = cycles.orbits[-1]
        # every oscillator does what its neighbour did a third of a period before
        waves = orbit.x[1] - 1j * orbit.x[2]
        turns = np.angle(waves[1:] / waves[:-1]) * 3.0 / (2.0 * np.pi)
        assert np.allclose(np.abs(turns), 1.0, atol=1e-6)
        senses.append(np.sign(turns[0]))
    assert so.verify(orbit).agrees
    assert sorted(senses) == [-1.0, 1.0]


def test_hopf_points_whose_cycles_cannot_be_told_apart():
    # of four oscillators neighbours do not meet in the third power of the amplitude: any phase between them will do
    branch = so.equilibria(van_der_pol(4), "mu", (-0.05, 0.15))
    event = next(event for event in branch.bifurcations if event.multiplicity == 2)
    with pytest.raises(ConvergenceError, match="2 Hopf points coincide"):
        so.limit_cycles(event, harmonics=5)


def test_a_family_that_leaves_as_another_enters_in_one_step():
    # between two points the count of unstable multipliers stays, and so do the signs of all determinants
    branch = so.frequency_response(oscillators(11, 0.0465174919, p=0.3128428875), (2.0, 2.25))
    assert [event.multiplicity for event in branch.bifurcations].count(2) == 18
    assert not branch.audit.unsettled


def test_blades_that_are_not_quite_equal():
    # modes that lie close together: a step that holds too much is taken in shorter ones
    system = oscillators(5, 0.004, every=True)
    unequal = system.stiffness.sparse_value(system.parameters) + np.diag([0.003, -0.002, 0.001, -0.004, 0.0])
    system = so.System(np.eye(5), DAMPING * np.eye(5), unequal, system.elements, system.loads, system.parameters)
    branch = so.frequency_response(system, (1.8, 2.3))
    assert [event.multiplicity for event in branch.bifurcations["PD"]] == [1] * 10
