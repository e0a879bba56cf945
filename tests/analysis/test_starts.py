"""First points: where Newton's method from the linear response fails, and where coexisting motions are chosen from."""

from __future__ import annotations

import numpy as np
import pytest
from slow import slow

import suboctave as so
from suboctave.curves import starts
from suboctave.timedomain import integrate, shoot

IMPACTS = (2000.0, (0.5, -0.6), 0.15, 0.7, 0.42)
MORE_IMPACTS = [(4535.0, (0.66, -0.82), 0.096, 0.697, 0.376), (3000.0, (0.7,), 0.1, 0.7, 0.3)]


@pytest.mark.parametrize("given", [IMPACTS, *slow(*MORE_IMPACTS)], ids=str)
def test_what_is_made_of_impacts_begins_at_what_time_leads_to(given):
    """Stops thousands of times as stiff as the spring, far below resonance: with few harmonics there is no motion."""
    stiffness, gaps, damping, load, omega = given
    stops = [so.ElasticStop(0, stiffness, gap) for gap in gaps]
    system = so.System(1.5, damping, 0.58, stops, [so.HarmonicLoad(0, load)])
    orbit = so.frequency_response(system, (omega, omega + 1e-4)).orbits[0]
    assert orbit.basis.harmonics >= 63
    exact = shoot(system, orbit.start(), omega)
    assert exact.stable
    assert orbit.amplitude() == pytest.approx(exact.amplitude, rel=1e-3)


@pytest.mark.parametrize("omega", [0.3, 1.0, 1.3])
def test_contact_closed_at_rest(omega):
    """j = 0: the stop touches at rest. The motion found is that of shooting."""
    system = so.library.reference_oscillator()
    curve = so.frequency_response(system, (omega, omega + 0.02))
    orbit = curve.orbits[0]
    assert orbit.omega == omega
    assert orbit.residual < 1e-10
    exact = shoot(system, orbit.start(), omega)
    assert orbit.start() == pytest.approx(exact.state, abs=2e-4)
    assert orbit.amplitude() == pytest.approx(exact.amplitude, rel=1e-5)


@pytest.fixture
def paths(monkeypatch):
    """The numbers of harmonics with which a path from a damped structure was followed, each still doing its work."""
    made = []
    original = starts._released
    monkeypatch.setattr(
        starts, "_released", lambda curve, *a: (made.append(curve.balance.basis.harmonics), original(curve, *a))[1]
    )
    return made


def test_a_path_takes_over_where_newton_fails(paths):
    """Stiff stops, strong load: from the linear response Newton does not arrive at every frequency."""
    used = 0
    for omega in (0.6, 1.3):
        paths.clear()
        system = so.library.reference_oscillator(Kc=50.0, p=1.7)
        orbit = so.frequency_response(system, (omega, omega * 1.001), harmonics=63).orbits[0]
        used += bool(paths)
        assert orbit.amplitude() == pytest.approx(shoot(system, orbit.start(), omega).amplitude, rel=1e-3)
    assert used >= 1


def random_oscillator(seed):
    """One to three masses in a row, strongly nonlinear: what kind, and a frequency."""
    rng = np.random.default_rng(seed)
    n, omega = int(rng.integers(1, 4)), float(rng.uniform(0.4, 2.5))
    load, damping = 10.0 ** rng.uniform(-0.5, 1.3), 10.0 ** rng.uniform(-1.2, -0.3)
    row = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    row[-1, -1] = 1.0
    links = [0, *((i, i - 1) for i in range(1, n))]
    hard = 10.0 ** rng.uniform(0.0, 2.0)
    kinds = [
        ("no linear stiffness", 0.0, lambda d: [so.CubicSpring(d, hard)]),
        ("softening", 0.2, lambda d: [so.Expression(d, "3*atan(x)")]),
        ("double well", -1.0, lambda d: [so.CubicSpring(d, 1.0)]),
        ("contacts closed at rest", 0.5, lambda d: [so.ElasticStop(d, hard, 0.0)]),
        ("play without stiffness", 0.0, lambda d: [so.ElasticStop(d, hard, gap) for gap in (0.2, -0.2)]),
    ]
    kind, stiffness, law = kinds[seed % len(kinds)]
    system = so.System(
        np.eye(n),
        damping * (np.eye(n) + row),
        stiffness * row,
        elements=[element for link in links for element in law(link)],
        loads=[so.HarmonicLoad(n - 1, load)],
    )
    return kind, system, omega


@pytest.mark.parametrize(
    "seed", [*range(3, 10), *(pytest.param(i, marks=pytest.mark.slow) for i in (*range(3), *range(10, 30)))]
)
def test_any_oscillator_starts(seed):
    """Whatever is nonlinear: a motion is found, and it is one that shooting finds, too."""
    _, system, omega = random_oscillator(seed)
    orbit = so.frequency_response(system, (omega, omega * (1.0 + 1e-6))).orbits[0]
    exact = shoot(system, orbit.start(), omega).state
    assert np.abs(exact - orbit.start()).max() < 1e-3 * np.abs(exact).max()


def test_a_cubic_spring_alone():
    """`x'' + 0.25 x' + x^3 = 9 cos t`: nothing linear holds it at rest, and it is no body that is free to move."""
    spring = so.CubicSpring(dof=0, coefficient=1.0)
    system = so.System(1.0, 0.25, 0.0, elements=[spring], loads=[so.HarmonicLoad(dof=0, amplitude=9.0)])
    orbit = so.frequency_response(system, (1.0, 1.2)).orbits[0]
    assert orbit.amplitude() == pytest.approx(shoot(system, orbit.start(), 1.0).amplitude, rel=1e-5)


def test_a_body_that_floats_is_named():
    """Between its stops a small motion touches neither: any mean will do, and the message says of what."""
    stops = [so.ElasticStop(0, 10.0, gap) for gap in (0.2, -0.2)]
    system = so.System(1.0, 0.4, 0.0, elements=stops, loads=[so.HarmonicLoad(0, 1.1)])
    with pytest.raises(so.ConvergenceError, match=r"nothing holds DOF 0: its mean position is arbitrary"):
        so.frequency_response(system, (2.9, 3.0))


def held_by_a_play(stiffness):
    """Two masses; the second is held by a spring of this stiffness, and by a play in which a static load pushes it."""
    return so.System(
        np.diag([1.0, 0.4]),
        [[0.06, -0.02], [-0.02, 0.05]],
        np.diag([1.0, stiffness]),
        elements=[so.Clearance((1, 0), stiffness=0.9, clearance=0.6, offset=0.05)],
        loads=[so.HarmonicLoad(0, 0.25), so.StaticLoad(1, 0.02)],
    )


@pytest.mark.parametrize("range_", [(1.3, 1.8), (1.8, 1.3)])
def test_a_body_held_by_a_play_alone_is_the_limit_of_a_soft_spring(range_):
    """Scales do not rest on the response without elements, which a spring that vanishes makes infinite."""
    none, soft, softer = (so.frequency_response(held_by_a_play(stiffness), range_) for stiffness in (0.0, 1e-6, 1e-9))
    kinds = [item.kind for item in none.bifurcations]
    assert len(kinds) >= 4
    assert abs(none.omega[-1] - range_[1]) < 1e-12
    for other in (soft, softer):
        assert [item.kind for item in other.bifurcations] == kinds
    gaps = [
        np.abs(np.subtract([b.omega for b in none.bifurcations], [b.omega for b in other.bifurcations])).max()
        for other in (soft, softer)
    ]
    assert gaps[0] < 1e-5
    assert gaps[1] < 1e-7


@pytest.mark.parametrize("offset", [0.0, 0.05])
def test_a_curve_ends_where_its_motion_begins_to_float(offset):
    """`x'' + c x' = F cos(omega t)` within a play of half a width g: from `omega^4 + c^2 omega^2 = (F / g)^2` on the
    motion touches neither side, and its mean is arbitrary. No motion leans on a side then.
    """
    c, load, half = 0.3, 0.5, 0.25
    play = so.Clearance(0, stiffness=5.0, clearance=2.0 * half, offset=offset)
    system = so.System(1.0, c, 0.0, elements=[play], loads=[so.HarmonicLoad(0, load)])
    floats = np.sqrt(0.5 * (np.sqrt(c**4 + 4.0 * (load / half) ** 2) - c**2))
    curve = so.frequency_response(system, (1.2, 2.0))
    assert "its mean position is arbitrary" in curve.ended
    assert curve.omega[-1] == pytest.approx(floats, rel=1e-4)
    assert curve.amplitude.max() > half
    extents = [np.ptp(orbit.displacement(np.linspace(0.0, 2.0 * np.pi / orbit.omega, 400))) for orbit in curve.orbits]
    assert min(extents) > 2.0 * half - 1e-3
    with pytest.raises(so.ConvergenceError, match="its mean position is arbitrary"):
        so.frequency_response(system, (2.0, 1.2))


def test_bodies_that_float_together_are_named():
    """Two masses on a spring between stops: condensed, their stiffness is zero but for rounding."""
    stiffness = np.array([[1.0, -1.0], [-1.0, 1.0]])
    play = so.Clearance(0, stiffness=5.0, clearance=0.5)
    system = so.System(np.diag([1.0, 0.5]), 0.1 * stiffness, stiffness, [play], [so.HarmonicLoad(1, 0.3)])
    with pytest.raises(so.ConvergenceError, match="nothing holds DOF 0"):
        so.frequency_response(system, (2.0, 1.9))


def test_a_weak_spring_holds():
    """A cubic spring alone, weak beside the masses: its mean stiffness, `3/2 a^2`, is 1e-5 of theirs."""
    system = so.System(1.0, 0.1, 0.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.01)])
    curve = so.frequency_response(system, (2.0, 1.9))
    assert len(curve) > 2
    assert curve.stable.all()


@pytest.fixture(scope="module")
def bistable():
    """Both motions of a Duffing oscillator between its folds, by time integration from two states."""
    system, omega = so.library.duffing(c=0.1, F=0.3), 1.4
    period = 2.0 * np.pi / omega
    states = [integrate(system, start, (0.0, 80 * period), omega, rtol=1e-9).end for start in ([0.0, 0.0], [1.5, 0.0])]
    motions = [shoot(system, state, omega) for state in states]
    assert abs(motions[0].amplitude - motions[1].amplitude) > 0.5
    return system, omega, motions


@pytest.mark.parametrize("which", [0, 1], ids=["small", "large"])
@pytest.mark.parametrize("form", ["state", "orbit", "point", "coefficients", "vector"])
def test_start_chooses_the_motion(bistable, which, form):
    system, omega, motions = bistable
    motion = motions[which]
    start = motion.state
    if form != "state":
        point = so.frequency_response(system, (omega, omega + 0.05), start=start).points[0]
        coefficients = point.orbit.coefficients
        start = {"orbit": point.orbit, "point": point, "coefficients": coefficients, "vector": coefficients[:7, 0]}[
            form
        ]
    curve = so.frequency_response(system, (omega, omega + 0.05), start=start)
    assert curve.amplitude[0] == pytest.approx(motion.amplitude, rel=1e-5)
    assert curve.stable[0] == motion.stable


def test_start_at_a_bifurcation():
    """A fold is a start like any other. Both its sides lie in this range: the curve leaves along one of them."""
    system = so.library.duffing(c=0.1, F=0.3)
    fold = so.frequency_response(system, (3.0, 0.5)).bifurcations["LP"][0]
    curve = so.frequency_response(system, (fold.omega, 3.0), start=fold)
    assert len(curve) > 10
    assert curve.omega[-1] in (fold.omega, 3.0)
    assert curve.omega.min() >= fold.omega


def test_a_start_on_the_other_side_of_a_pole_is_asked_for():
    """`x = 1/x + ..` at rest about 1; the linear response is about 0, where the force is not finite."""
    system = so.System.from_equations("x'' + 0.1*x' + x = 1/x + F*cos(omega*t)", {"F": 0.01})
    with pytest.raises(so.ConvergenceError, match=r"not finite .* Give start="):
        so.continue_branch(system, "F", (0.01, 0.1), omega=1.2)
    curve = so.frequency_response(system, (1.2, 1.25), start=[1.0, 0.0])
    assert curve.orbits[0].displacement(0.0)[0] > 0.9


def test_impossible_start_says_what_was_tried():
    """A frictionless resonance has no motion: the message lists the attempts."""
    system = so.System(1.0, 0.0, 1.0, loads=[so.HarmonicLoad(0, 1.0)])
    with pytest.raises(
        so.ConvergenceError, match=r"no motion found to start from at omega = 1.*linear response.*start="
    ):
        so.frequency_response(system, (1.0, 2.0))


@pytest.fixture(scope="module")
def hardening():
    """A Duffing oscillator that folds at omega = 2.3996 and 1.3292, and its response."""
    system = so.System(1.0, 0.05, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.3)])
    return system, so.frequency_response(system, (0.5, 3.5), harmonics=5)


def test_a_motion_from_elsewhere_starts_no_curve_outside_the_range(hardening):
    """From motions all along the response: a curve in the range, or a refusal that says where the nearest motion is."""
    (system, response), bounds, refused = hardening, (1.2, 0.8), 0
    for start in response.orbits[::6]:
        try:
            curve = so.frequency_response(system, bounds, harmonics=5, start=start)
        except so.ConvergenceError as failure:
            refused += "the nearest one is at omega" in str(failure)
            continue
        assert curve.omega[0] == bounds[0]
        assert min(bounds) <= curve.omega.min() <= curve.omega.max() <= max(bounds)
    assert refused


def test_the_nearest_motion_in_the_range_is_said_to_be_no_start(hardening):
    """A motion of a stronger load at 2.7: beside it the large ones of the weaker load end at 2.3996, in the range."""
    system, _ = hardening
    strong = so.System(1.0, 0.05, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.5)])
    high = so.frequency_response(strong, (0.5, 2.7), harmonics=5)
    start = high.orbits[int(np.argmax(high.amplitude * (high.omega <= 2.7)))]
    curve = so.frequency_response(system, (2.7, 0.8), harmonics=5, start=start)
    assert curve.omega.max() <= 2.7
    elsewhere = bool(abs(curve.omega[0] - 2.7) > 1e-3)
    assert any("the curve begins at the nearest motion" in note for note in curve.warnings) is elsewhere


# mass of the light DOF, sliding force and width of its law
@pytest.mark.parametrize(("mass", "force", "width"), [(0.05, 0.1, 0.03), (0.0407, 0.1123, 0.0328), (0.08, 0.12, 0.02)])
def test_friction_at_a_light_dof_starts_whatever_harmonics_it_asks_for(mass, force, width):
    """Where few harmonics let a body slide that sticks with more, more and fewer are asked for in turn."""
    stiffness = [[2.0, -1.0, 0.0], [-1.0, 1.5, -0.5], [0.0, -0.5, 0.5]]
    laws, loads = [so.TanhFriction(2, force, width)], [so.HarmonicLoad(0, 0.1)]
    system = so.System(np.diag([1.0, 1.0, mass]), 0.02 * np.eye(3), stiffness, laws, loads)
    start = so.frequency_response(system, (0.4, 0.42)).orbits[0]
    fixed = so.frequency_response(system, (0.4, 0.42), harmonics=41).orbits[0]
    amplitudes = [[orbit.amplitude(dof) for dof in range(3)] for orbit in (start, fixed)]
    assert amplitudes[0] == pytest.approx(amplitudes[1], rel=1e-4)
    assert start.truncation < 1e-5
