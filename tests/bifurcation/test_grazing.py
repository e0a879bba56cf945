"""Contacts that begin or cease to touch: closed forms of the linear motion before, shooting for everything after.

Up to its first contact a structure is linear, so that the frequency, force or gap at which it begins to touch follows
from its transfer functions. Further impacts and lift-offs are held against shooting, which knows no harmonics.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from slow import slow

import suboctave as so
from suboctave.bifurcation.gaps import levels
from suboctave.harmonic import trigonometric
from suboctave.kinds import KINDS
from suboctave.timedomain import integrate, shoot


def oscillator(j, Kc=30.0, zeta=0.05, p=1.0, m=1.0, k=1.0, side="right", more=()):
    return so.System(
        mass=m,
        damping=2.0 * zeta * np.sqrt(k * m),
        stiffness=k,
        elements=[so.ElasticStop(dof=0, stiffness="Kc", gap="j", side=side)],
        loads=[so.HarmonicLoad(dof=0, amplitude="p"), *more],
        parameters={"Kc": Kc, "j": j, "p": p},
    )


def first_touches(j, zeta=0.05, p=1.0):
    """Frequencies at which the amplitude of a linear oscillator is j, (1 - w^2)^2 + (2 zeta w)^2 = (p / j)^2."""
    half = 1.0 - 2.0 * zeta**2
    root = np.sqrt(half**2 - 1.0 + (p / j) ** 2)
    return np.sqrt(half + root), np.sqrt(half - root)


def described(grazings):
    return [(g.contact.element, g.contact.change) for g in grazings]


# ---------------------------------------------------------------------------------------------- closed forms
@pytest.mark.parametrize("harmonics", ["adaptive", 3, 15])
@pytest.mark.parametrize(("Kc", "share"), [(30.0, 0.5), (30.0, 0.999), (1000.0, 0.999)])
def test_first_touch_of_an_oscillator(Kc, share, harmonics):
    j = share / (2.0 * 0.05)
    curve = so.frequency_response(oscillator(j, Kc), (1.3, 0.6), harmonics=harmonics)
    assert [g.omega for g in curve.grazings] == pytest.approx(first_touches(j), abs=1e-10)
    assert described(curve.grazings) == [(0, "begins to touch"), (0, "ceases to touch")]
    for g in curve.grazings:
        assert g.residual < 1e-10
        assert g.amplitude == pytest.approx(j, rel=1e-9)
        assert g.uncertainty == 0.0
        assert g.contact.gap == j
        assert g.orbit.displacement(g.contact.time)[0] == pytest.approx(j, rel=1e-10)
        assert abs(g.orbit.velocity(g.contact.time)[0]) < 1e-9 * j


def test_a_stop_on_the_left_and_other_units():
    """The mirror image, in millimetres, grams and milliseconds."""
    length, time, mass = 1e3, 1e3, 1e6
    stiffness = mass / time**2
    j = 5.0
    system = oscillator(-j * length, 30.0 * stiffness, 0.05, stiffness * length, mass, stiffness, "left")
    curve = so.frequency_response(system, (1.3 / time, 0.6 / time))
    assert [g.omega * time for g in curve.grazings] == pytest.approx(first_touches(j), abs=1e-10)
    assert described(curve.grazings) == [(0, "begins to touch"), (0, "ceases to touch")]


def linear_amplitude(system, direction, omega, harmonic=1):
    """Complex amplitude of direction . x at a multiple of omega, without the elements."""
    mass, damping, stiffness = system.matrices()
    force = np.zeros(system.n, complex)
    for c in system.load_components():
        if c.harmonic == harmonic:
            force += c.direction * c.amplitude.value(system.parameters) * np.exp(1j * c.phase.value(system.parameters))
    w = harmonic * omega
    return direction @ np.linalg.solve(stiffness - w**2 * mass + 1j * w * damping, force)


@pytest.mark.parametrize(
    ("place", "side", "gap"),
    [({"dof": (0, 1)}, "right", 0.9), ({"dof": (1, 0)}, "left", 0.9), ({"direction": [0.5, 0.3]}, "right", 0.5)],
)
def test_between_masses_and_along_a_direction(place, side, gap):
    system = so.System(
        mass=np.diag([1.0, 0.5]),
        damping=[[0.06, -0.02], [-0.02, 0.04]],
        stiffness=[[2.0, -1.0], [-1.0, 1.5]],
        elements=[so.ElasticStop(stiffness=20.0, gap="b", side=side, **place)],
        loads=[so.HarmonicLoad(dof=0, amplitude=1.0), so.HarmonicLoad(dof=1, amplitude=0.2, harmonic=0)],
        parameters={"b": gap if side == "right" else -gap},
    )
    direction = system.elements[0].direction(2)
    sign = 1.0 if side == "right" else -1.0

    def beyond(omega):
        still = linear_amplitude(system, direction, omega, 0).real
        return sign * still + abs(linear_amplitude(system, direction, omega)) - gap

    grid = np.linspace(2.6, 1.0, 4000)
    crossed = np.flatnonzero(np.diff(np.sign([beyond(w) for w in grid])))
    first = brentq(beyond, grid[crossed[0]], grid[crossed[0] + 1], xtol=1e-14)
    curve = so.frequency_response(system, (2.6, first - 0.02))
    assert curve.grazings[0].omega == pytest.approx(first, abs=1e-10)
    assert described(curve.grazings[:1]) == [(0, "begins to touch")]


def test_with_a_mean_and_a_second_harmonic():
    """The extremum of a sum of waves comes from a search of its own."""
    more = [
        so.HarmonicLoad(dof=0, amplitude=0.4, harmonic=2, phase=0.7),
        so.HarmonicLoad(dof=0, amplitude=-0.3, harmonic=0),
    ]
    system = oscillator(3.0, more=more)

    def beyond(omega):
        a, b = (linear_amplitude(system, np.ones(1), omega, k) for k in (1, 2))
        still = linear_amplitude(system, np.ones(1), omega, 0).real

        def depth(tau):
            return -np.real(a * np.exp(1j * tau) + b * np.exp(2j * tau))

        start = np.linspace(0.0, 2.0 * np.pi, 400)[np.argmin(depth(np.linspace(0.0, 2.0 * np.pi, 400)))]
        best = minimize_scalar(depth, bounds=(start - 0.05, start + 0.05), method="bounded", options={"xatol": 1e-12})
        return still - best.fun - 3.0

    curve = so.frequency_response(system, (1.5, 0.8))
    assert curve.grazings[0].omega == pytest.approx(brentq(beyond, 1.05, 1.4, xtol=1e-14), abs=1e-10)


@pytest.mark.parametrize("harmonics", ["adaptive", 9])
def test_along_a_gap_and_along_a_force(harmonics):
    """At fixed frequency the linear amplitude is the gap, or the force in its units, at which contact begins."""
    omega, zeta = 1.2, 0.05
    gain = 1.0 / abs(1.0 - omega**2 + 2j * zeta * omega)
    system = oscillator(3.0)
    along_gap = so.continue_branch(system, "j", (3.0, 1.0), omega=omega, harmonics=harmonics)
    assert along_gap.grazings[0].parameter("j") == pytest.approx(gain, rel=1e-10)
    assert along_gap.grazings[0].contact.gap == along_gap.grazings[0].parameter("j")
    along_force = so.continue_branch(system, "p", (0.2, 3.0), omega=omega, harmonics=harmonics)
    assert along_force.grazings[0].parameter("p") == pytest.approx(3.0 / gain, rel=1e-10)
    assert "begins to touch" in repr(along_force.bifurcations)
    # an expression of the parameter in place of the parameter
    twice = so.System(
        mass=1.0,
        damping=0.1,
        stiffness=1.0,
        elements=[so.ElasticStop(dof=0, stiffness=30.0, gap="1 + h**2", side="right")],
        loads=[so.HarmonicLoad(dof=0, amplitude=1.0)],
        parameters={"h": 1.5},
    )
    curve = so.continue_branch(twice, "h", (1.5, 0.2), omega=omega, harmonics=harmonics)
    assert curve.grazings[0].parameter("h") == pytest.approx(np.sqrt(gain - 1.0), rel=1e-9)


def test_a_stop_with_a_rounded_corner_begins_where_its_law_is_sharp():
    """The arctan law acts a little before its gap; the place reported is that of the gap itself."""
    for side, gap in (("right", 1.0), ("left", -1.0)):
        system = so.System(
            mass=1.0,
            damping=0.06,
            stiffness=1.0,
            elements=[so.ElasticStop(dof=0, stiffness=4.7, gap="j", side=side, regularization=300.0)],
            loads=[so.HarmonicLoad(dof=0, amplitude=0.5)],
            parameters={"j": gap},
        )
        curve = so.frequency_response(system, (1.6, 1.1), harmonics=15)
        (g,) = curve.grazings
        assert described([g]) == [(0, "begins to touch")]
        u = g.orbit.displacement(np.linspace(0.0, g.orbit.period, 4001))[0]
        assert np.sign(gap) * (np.sign(gap) * u).max() == pytest.approx(gap, abs=1e-6)
        found = so.continue_branch(g, "j", (0.9 * gap, 1.1 * gap)).grazings
        assert [b.parameter("j") for b in found] == pytest.approx([gap], abs=1e-8)


# ---------------------------------------------------------------------------------------------- shooting
def extremum_by_shooting(system, start, omega, time, direction):
    """Motion at omega by shooting, and the extremum of direction . x nearest to a time on it."""
    solution = shoot(system, start, omega)
    path = integrate(system, solution.state, (0.0, solution.period), omega)

    def speed(t):
        return float(path.at(np.mod(t, solution.period))[1][0] @ direction)

    reach = 0.01 * solution.period
    at = brentq(speed, time - reach, time + reach, xtol=1e-13)
    return solution, float(path.at(np.mod(at, solution.period))[0][0] @ direction)


def grazing_by_shooting(g):
    """Frequency at which the extremum meets the gap, by secants on motions found by shooting."""
    system = g.orbit.system
    direction = system.elements[g.contact.element].direction(system.n)
    start, omega, misses = g.orbit.start(), g.omega, []
    for _ in range(6):
        solution, value = extremum_by_shooting(system, start, omega, g.contact.time, direction)
        start = solution.state
        misses.append((omega, value - g.contact.gap))
        if len(misses) == 1:
            omega *= 1.0 + 1e-7
        else:
            (a, fa), (b, fb) = misses[-2:]
            omega = b - fb * (b - a) / (fb - fa)
            if abs(omega - b) < 1e-12:
                break
    return omega


@pytest.fixture(scope="module")
def low_frequencies():
    """The reference oscillator below its main resonance, where each superharmonic brings impacts of its own."""
    return so.frequency_response(so.library.reference_oscillator(p=0.55), (1.0, 0.37))


def test_second_impacts_and_lift_offs_by_shooting(low_frequencies):
    grazings = low_frequencies.grazings
    changes = [g.contact.change for g in grazings]
    # second and third impacts on the closed stop, touches of the other, and contacts that let go inside an interval
    assert {"begins to touch", "ceases to touch", "ceases to lift off"} <= set(changes)
    assert {g.contact.element for g in grazings} == {1, 2}
    for g in (grazings[0], grazings[2], next(g for g in grazings if g.contact.change == "ceases to lift off")):
        assert g.residual < 1e-10
        assert g.omega == pytest.approx(grazing_by_shooting(g), abs=1e-6), g.contact


def crossings(orbit, element):
    state = orbit.state()
    local = state.local(element)
    return len(trigonometric.crossings(local.motion, levels(local)[0], *state.balance.grid)[0])


def test_every_change_in_the_number_of_impacts_is_explained(low_frequencies):
    """Between neighbours the crossings of a gap change by two for each grazing located there, and not otherwise."""
    curve = low_frequencies
    for element in (1, 2):
        counts = np.array([crossings(orbit, element) for orbit in curve.orbits])
        places = np.zeros(len(curve) - 1, int)
        for g in curve.grazings:
            if g.contact.element == element:
                step = np.searchsorted(curve.arclength, g.arclength, side="right") - 1
                places[step] += 2 if g.contact.change.startswith("begins") else -2
        assert np.diff(counts).tolist() == places.tolist()
        assert places.any()


@pytest.mark.parametrize("max_step", [0.3, *slow(0.01)])
def test_the_same_grazings_at_any_step(low_frequencies, max_step):
    curve = so.frequency_response(low_frequencies.system, (1.0, 0.37), max_step=max_step)
    assert described(curve.grazings) == described(low_frequencies.grazings)
    assert [g.omega for g in curve.grazings] == pytest.approx([g.omega for g in low_frequencies.grazings], abs=2e-7)


def test_the_other_way_begins_and_ceases_change_places(oscillator_curve):
    down = oscillator_curve(0.55, omega=(4.5, 1.1))
    up = oscillator_curve(0.55, omega=(1.1, 4.5))
    swap = {"begins": "ceases", "ceases": "begins"}
    expected = [(e, f"{swap[c.split()[0]]} {c.split(maxsplit=1)[1]}") for e, c in described(down.grazings)]
    assert described(up.grazings) == expected[::-1]
    assert [g.omega for g in up.grazings] == pytest.approx([g.omega for g in down.grazings][::-1], abs=1e-7)
    middle = so.continue_branch(down.orbits[len(down) // 2], "omega", (4.5, 1.1))
    assert described(middle.grazings) == described(down.grazings)


def test_two_stops_that_a_symmetric_motion_meets_at_once(oscillator_curve):
    curve = oscillator_curve(0.55, 1.0, omega=(4.5, 1.0))
    assert sorted(described(curve.grazings)) == [(1, "begins to touch"), (2, "begins to touch")]
    assert curve.grazings[0].omega == pytest.approx(curve.grazings[1].omega, abs=1e-12)
    times = [g.contact.time / g.orbit.period for g in curve.grazings]
    assert (times[0] - times[1]) % 1.0 == pytest.approx(0.5, abs=1e-9)


def test_numbering_of_masses_and_elements_does_not_matter():
    def chain(order):
        index = np.argsort(order)
        stiffness = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.2]])
        mass = np.diag([1.0, 0.7, 1.3])
        stops = [
            so.ElasticStop(dof=(int(index[0]), int(index[2])), stiffness=8.0, gap=0.5, side="right"),
            so.ElasticStop(dof=int(index[1]), stiffness=5.0, gap=-0.5),
        ]
        return so.System(
            mass=mass[np.ix_(order, order)],
            damping=0.08 * stiffness[np.ix_(order, order)],
            stiffness=stiffness[np.ix_(order, order)],
            elements=stops if order[0] == 0 else stops[::-1],
            loads=[so.HarmonicLoad(dof=int(index[0]), amplitude=0.5)],
        )

    one = so.frequency_response(chain([0, 1, 2]), (2.2, 0.66), harmonics=13, observe=0)
    other = so.frequency_response(chain([2, 0, 1]), (2.2, 0.66), harmonics=13, observe=1)
    assert len(one.grazings) >= 3
    assert [g.omega for g in other.grazings] == pytest.approx([g.omega for g in one.grazings], abs=1e-10)
    swapped = [(1 - element, change) for element, change in described(one.grazings)]
    assert described(other.grazings) == swapped


# ---------------------------------------------------------------------------------------------- what is reported
def test_no_contact_no_grazing(oscillator_curve):
    duffing = so.frequency_response(so.library.duffing(c=0.1, F=0.3), (3.0, 0.5))
    far = so.frequency_response(oscillator(20.0), (1.3, 0.6))
    for curve in (duffing, far):
        assert curve.grazings == []
        assert curve.bifurcations["grazing"] == []
    assert all(b.smooth and not b.discontinuous for b in duffing.bifurcations)


def test_grazings_are_listed_but_are_no_bifurcations(oscillator_curve):
    curve = oscillator_curve(0.55, omega=(4.5, 1.3))
    found = curve.bifurcations
    assert "grazing" in KINDS
    assert len(found["grazing"]) == 1
    assert all(b.kind != "grazing" for b in found)
    assert len(found) == len(list(found)) == len(found.met) - 1
    assert [b.arclength for b in found.met] == sorted(b.arclength for b in found.met)
    rows = repr(found).splitlines()
    # a table as long as the list, and the contact below
    assert rows[1 + len(found)] == '1 grazing contact, which is no bifurcation (bifurcations["grazing"]):'
    (row,) = rows[2 + len(found) :]
    assert row.startswith("grazing")
    assert row.endswith("ElasticStop(dof=0, gap=-1.0) begins to touch")


def test_a_grazing_in_the_dataset_and_in_the_figure(oscillator_curve):
    curve = oscillator_curve(0.55, omega=(4.5, 1.3))
    dataset = curve.to_xarray()
    kinds = [str(kind) for kind in dataset["event_kind"].to_numpy()]
    at = kinds.index("grazing")
    assert kinds == [b.kind for b in curve.bifurcations.met]
    assert str(dataset["event_contact"].to_numpy()[at]) == "ElasticStop(dof=0, gap=-1.0) begins to touch"
    assert float(dataset["event_contact_at"][at]) == curve.grazings[0].omega
    # stability goes on through it
    after = int(dataset["event_after"][at])
    assert int(dataset["event_stable_after"][at]) == int(dataset["stable"][after])
    figure = curve.plot()
    (legend,) = [axes.get_legend() for axes in figure.axes]
    assert "grazing contact" in [text.get_text() for text in legend.get_texts()]


def test_a_grazing_is_verified_by_shooting(oscillator_curve):
    from dataclasses import replace

    curve = oscillator_curve(0.55, omega=(4.5, 1.3))
    (g,) = curve.grazings
    check = so.verify(g)
    assert check.agrees, check
    assert check.distance < 1e-4
    beside = int(np.abs(curve.arclength - g.arclength).argmin())
    for step in (-2, 2):  # a motion that stays away from the stop, and one that hits it
        wrong = so.verify(replace(g, orbit=curve.orbits[beside + step]))
        assert not wrong.agrees
        assert "does not graze" in repr(wrong)
