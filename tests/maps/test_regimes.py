"""Regimes over omega and a design parameter: against a closed form, time integration, and what is refused."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import suboctave as so
from suboctave.analysis.diagram import Followed, grown_from
from suboctave.curves.identity import lies_on
from suboctave.interruption import Interruption
from suboctave.maps.catalogue import Catalogue, SearchRange, carrier_of
from suboctave.maps.regimes.arcs import Arc, Edge, Slice, Strip
from suboctave.maps.regimes.map import RegimeMap

DAMPING, STIFF = 0.1, 1.0


def duffing():
    return so.System(
        mass=1.0,
        damping="c",
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient="alpha")],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"c": DAMPING, "alpha": STIFF, "F": 0.3},
    )


@pytest.fixture(scope="module")
def folded():
    """Two motions coexist in a horn of the plane, which begins at a cusp."""
    return so.regime_map(duffing(), (2.0, 0.6), "F", (0.5, 0.02), harmonics=1, depth=0)


def motions_of_duffing(omega, force):
    """How many stable motions with one harmonic: of three amplitudes the one in the middle is unstable."""
    # ((1 - w^2) + 3/4 alpha A^2)^2 A^2 + (c w)^2 A^2 = F^2, in A^2
    stiff, cubic = 1.0 - omega**2, 0.75 * STIFF
    roots = np.roots([cubic**2, 2.0 * stiff * cubic, stiff**2 + (DAMPING * omega) ** 2, -(force**2)])
    count = np.count_nonzero((np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0))
    return {1: 1, 3: 2}[int(count)]


def test_a_raster_has_no_limit_of_arcs():
    """Seventy overlapping stable arcs: every cell has the label of its centre."""
    arcs = [Arc(1 + i % 3, False, (Edge(1.0 + 0.01 * i), Edge(1.5 + 0.02 * i)), ()) for i in range(70)]
    catalogue = Catalogue(duffing(), "F", (0.0, 1.0), SearchRange(0.5, 3.5), "adaptive", {}, 1)
    strips = [Strip(0.0, 0.5, Slice(0.2, arcs=arcs), True), Strip(0.5, 1.0, None, False)]
    regimes = RegimeMap(catalogue, strips, 2, 1e-4, ())
    cells, labels = regimes.raster(90, 4)
    omega = 0.5 + (np.arange(90) + 0.5) / 90 * 3.0
    for row, value in enumerate((0.125, 0.375, 0.625, 0.875)):
        for column, place in enumerate(omega):
            assert labels[cells[row, column]] == regimes.label(place, value)
    assert max(label.count for label in labels) > 40


def test_counts_of_a_closed_form(folded):
    draw = np.random.default_rng(7)
    for omega, force in zip(draw.uniform(0.6, 2.0, 400), draw.uniform(0.02, 0.5, 400), strict=True):
        regime = folded.label(omega, force)
        assert regime.count == motions_of_duffing(omega, force), (omega, force)
        assert set(regime.periods) == {1}
    assert folded.notes == ()
    assert [str(regime) for regime in folded.regimes] == ["T", "2 x T"]


def test_motions_at_a_point(folded):
    """The amplitudes are roots of the same cubic."""
    omega, force = 1.45, 0.3
    assert motions_of_duffing(omega, force) == 2
    found = sorted(abs(orbit.harmonic(1)) for orbit in folded.motions(omega, force))
    stiff, cubic = 1.0 - omega**2, 0.75 * STIFF
    roots = np.roots([cubic**2, 2.0 * stiff * cubic, stiff**2 + (DAMPING * omega) ** 2, -(force**2)])
    small, _, large = np.sort(np.sqrt(roots.real))
    assert found == pytest.approx([small, large], rel=1e-8)


def test_raster_and_regions_say_what_labels_say(folded):
    cells, regimes = folded.raster(40, 30)
    for row, column in ((3, 5), (20, 25), (29, 39), (15, 20)):
        omega, value = 0.6 + (column + 0.5) / 40 * 1.4, 0.02 + (row + 0.5) / 30 * 0.48
        assert regimes[cells[row, column]] == folded.label(omega, value)
    assert sum(region.share for region in folded.regions) == pytest.approx(1.0)
    horn = min((region for region in folded.regions if region.regime.count == 2), key=lambda region: region.omega[0])
    # the cusp of the closed form: A^2 such that the derivative of the cubic has a double root
    omega = np.roots([1.0, -np.sqrt(3.0) * DAMPING, -1.0]).max()
    assert horn.omega[0] == pytest.approx(omega, abs=0.01)


def test_time_integration_agrees(folded):
    exact = so.regime_map(duffing(), (0.9, 1.9), "F", (0.1, 0.4), depth=0, values=2)
    checked = exact.check(points=12, seed=3, starts=3, transient=100)
    assert checked.points == 12
    assert checked.rate == 1.0, checked
    assert checked.disagreements == []
    assert len(checked.to_table()) == len(checked.landings) > 12 * 3


@pytest.fixture(scope="module")
def doubling():
    system = so.library.reference_oscillator(regularization=3000.0)
    return so.regime_map(system, (2.9, 3.5), "j", (0.02, 0.12), depth=1, values=2)


def test_a_period_doubling_and_what_only_time_integration_knows(doubling, tmp_path):
    """Motions of 3T and 5T, to which no branch leads, are reported, everything else agrees."""
    system = doubling.system.with_parameters({"j": 0.0283197})
    assert doubling.label(3.33828, 0.0283197).periods == (2,)
    (orbit,) = doubling.motions(3.33828, 0.0283197)
    assert so.poincare_sections(system, start=orbit.start(), omega=3.33828, transient=300).attractor(0).period == 2
    checked = doubling.check(points=15, seed=1)
    assert {one.verdict for one in checked.landings} <= {"agrees", "unknown motion"}
    assert checked.rate > 0.7
    assert all(one.period in (3, 5) for one in checked.disagreements)
    doubling.plot(tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_an_isola_that_nothing_within_the_bounds_leads_to():
    """It neither begins nor ends within the bounds, so that no curve of the response meets it: it is looked for."""
    system = so.System(1.0, 0.05, 1.0, [so.ElasticStop(0, 6.0, "g")], [so.HarmonicLoad(0, 0.5)], parameters={"g": 0.4})
    asked = (system, (2.2, 3.2), "g", (0.4, 0.5))
    found = so.regime_map(*asked, depth=1, values=1)
    assert found.searched == (2,)
    assert "2T isolas were looked for." in repr(found)
    assert max(regime.count for regime in found.regimes) == 2
    inside = system.with_parameters({"g": 0.45})
    known = so.find_subharmonics(inside, (2.2, 3.2), subharmonic=2, seeds=so.Seeds(8, 4, 3))
    (orbit,) = (o for o in found.motions(2.4, 0.45) if o.basis.nu == 2)
    assert any(lies_on(orbit, branch.points) for branch in known)
    alone = so.regime_map(*asked, depth=1, values=1, search=())
    assert (alone.searched, [str(regime) for regime in alone.regimes]) == ((), ["T"])


def test_a_map_that_is_not_complete_says_so_in_its_picture(doubling):
    stopped = copy.copy(doubling)
    stopped.interruption = Interruption()
    for item, first in ((doubling, "T"), (stopped, f"incomplete: {Interruption()}")):
        (legend,) = item.plot().legends
        assert legend.get_texts()[0].get_text() == first


@pytest.mark.slow
def test_the_whole_plane_of_the_reference_oscillator():
    """200 points: every motion that a branch leads to is confirmed; the others, given to the map, are on it then."""
    system = so.library.reference_oscillator(regularization=3000.0)
    first = so.regime_map(system, (1.3, 4.5), "j", (0.0, 1.0))
    assert first.notes == ()
    checked = first.check(points=200, seed=0)
    assert checked.rate > 0.9
    assert {one.verdict for one in checked.disagreements} == {"unknown motion"}
    second = so.regime_map(
        system, (1.3, 4.5), "j", (0.0, 1.0), motions=[orbit for orbit in checked.unknown() if orbit.basis.nu in (3, 5)]
    )
    again = second.check(points=200, seed=0)
    assert again.rate > 0.98
    assert {3, 5} <= {nu for regime in second.regimes for nu in regime.periods}


@pytest.mark.slow
def test_isola_and_cascade_of_one_slice():
    """At j = 0.2306 the isola doubles to 4T and further: periods by time integration alone."""
    system = so.library.reference_oscillator(regularization=3000.0)
    found = so.regime_map(system, (2.0, 2.4), "j", (0.225, 0.235), values=1, search=(2,))
    inside = {2.09: 2, 2.125: 4, 2.18: 4, 2.25: 2}
    for omega, period in inside.items():
        regime = found.label(omega, 0.23)
        assert (period, True) in regime.motions
        (orbit,) = (o for o in found.motions(omega, 0.23) if o.basis.nu == period)
        settled = so.poincare_sections(system.with_parameters({"j": 0.23}), start=orbit.start(), omega=omega)
        assert settled.attractor(0).period == period
    assert found.label(2.155, 0.23).beyond == ((8, True),)
    assert "8T or more on an isola" in str(found.label(2.155, 0.23))


@pytest.mark.parametrize(
    ("named", "words"),
    [
        ({"parameter": "f"}, "did you mean 'F'"),
        ({"parameter": "omega"}, "other axis"),
        ({"bounds": (0.1, 0.1)}, "two different"),
        ({"depth": -1}, "depth must be"),
        ({"values": 0}, "values must be"),
        ({"resolution": 0.7}, "resolution must be"),
        ({"search": "3T"}, "search must be"),
        ({"motions": [3]}, "motions\\[0\\] must be a PeriodicOrbit"),
        ({"isolas": []}, "isolas must be"),
        ({"omega": (-1.0, 2.0)}, "positive"),
    ],
)
def test_what_is_refused(named, words):
    given = {"omega": (0.6, 2.0), "parameter": "F", "bounds": (0.1, 0.4), **named}
    with pytest.raises(so.InputError, match=words):
        so.regime_map(duffing(), **given)


def test_outside_of_the_map(folded):
    with pytest.raises(so.InputError, match=r"omega = 0\.6 to 2"):
        folded.label(3.0, 0.3)
    with pytest.raises(so.InputError, match=r"F = 0\.02 to 0\.5"):
        folded.label(1.0, 0.7)
    with pytest.raises(so.InputError, match="points must be"):
        folded.check(points=0)


# ------------------------------------------------------------------------------------------------- what is followed
@pytest.fixture(scope="module")
def ueda():
    """A symmetric oscillator whose motions lose the symmetry at omega = 0.8047 and double their period at 0.8166."""
    return so.System(
        mass=1.0,
        damping=0.2,
        stiffness=0.0,
        elements=[so.CubicSpring(dof=0, coefficient=1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude=7.5)],
    )


def test_a_branch_point_uses_up_no_period_doubling(ueda):
    """From the symmetric motions: a pitchfork to the unsymmetric ones, then their doubling."""
    response = so.frequency_response(ueda, (0.9, 0.79))
    (pitchfork,) = response.bifurcations["BP"]
    # whichever of the two the first guess led to; the mean of a symmetric motion is zero
    both = response, so.switch_branch(pitchfork)
    symmetric = min(both, key=lambda branch: np.abs(branch.harmonic(0)).max())
    by_period = grown_from(symmetric, Followed(longest=2), {})
    doubled = [node for node in by_period if node.branch.nu == 2]
    assert {(node.crossings, node.depth) for node in doubled} == {(1, 2)}
    assert doubled[0].origin.omega == pytest.approx(0.8165596, abs=1e-6)
    for shallow in (Followed(1), Followed(longest=1)):
        assert {branch.nu for branch in grown_from(symmetric, shallow, {}).branches} == {1}


def test_a_branch_of_twice_the_period_that_leads_elsewhere_ends_isolation():
    """A closed branch is no isola where a 2T branch that leaves the response ends at one of its period doublings."""
    system = so.library.reference_oscillator(p=0.55, regularization=3000.0, j=0.0)
    response = so.frequency_response(system, (4.5, 2.2), harmonics=9, max_step=0.3)
    doublings = response.bifurcations["PD"]
    branch = so.switch_branch(doublings[0], max_step=0.3)
    assert branch.arrives is not None

    class Closed:
        """The response, were it closed, with some of its period doublings."""

        closed, departs, arrives, nu = True, None, None, 1

        def __init__(self, items):
            self.bifurcations = {"BP": [], "PD": items}

    whole, part = Closed(doublings), Closed(doublings[1:])
    assert carrier_of(part, [], {}) is part
    assert carrier_of(part, [branch], {}) is None
    assert carrier_of(whole, [branch], {}) is whole  # leaves it and comes back


@pytest.mark.slow
@pytest.mark.parametrize("case", ["a mass at rest", "a node", "rest"])
def test_a_check_where_something_is_at_rest(case):
    """Nothing couples the second mass; the middle one is a node; a swing stands still below its tongue."""
    if case == "a mass at rest":
        mass, damping, stiffness = np.eye(2), 0.1 * np.eye(2), np.diag([1.0, 3.0])
        parts = [so.CubicSpring(0, 0.5)], [so.HarmonicLoad(0, "F")]
    elif case == "a node":
        mass, damping = np.eye(3), 0.1 * np.eye(3)
        stiffness = [[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]]
        parts = [so.CubicSpring(i, 0.5) for i in (0, 2)], [so.HarmonicLoad(direction=[1, 0, -1], amplitude="F")]
    else:
        mass, damping, stiffness, parts = 1.0, 0.1, 1.0, ([so.Expression(0, "F*x*cos(omega*t) + x**3")], [])
    system = so.System(mass, damping, stiffness, *parts, parameters={"F": 0.2})
    found = so.regime_map(system, (1.5, 2.5), "F", (0.1, 0.4), harmonics=5, depth=1, values=2)
    checked = found.check(points=4)
    assert checked.landings
    assert checked.rate == checked.agreeing == 1.0
