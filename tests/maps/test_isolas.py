"""Isolas over a design parameter: their ends, their closed branches, and that nothing depends on where one stands.

Numbers of the reference oscillator by shooting (tests/data), those of the tuned absorber by harmonic balance with 5, 7
and 9 harmonics alike; a Duffing oscillator under a load `F0 (1 - q^2)` against its closed form.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import fsolve
from slow import slow

import suboctave as so
from suboctave import interruption
from suboctave.curves.identity import lies_on, mirrored
from suboctave.interruption import Interruption
from suboctave.maps import catalogue
from suboctave.maps.catalogue import Catalogue, SearchRange
from suboctave.maps.isolas.result import Isola, IsolaEnd, Isolas
from suboctave.maps.isolas.search import Search

OMEGA = (1.3, 4.5)
#: a few seeds of sub-harmonic motions, nothing else
FEW = {"seeds": so.Seeds(4, 2, 1), "depth": 0, "levels": ()}


def reference(**values):
    return so.library.reference_oscillator(regularization=3000.0, **values)


@pytest.fixture(scope="module")
def isolas():
    return so.find_isolas(reference(j=0.0), OMEGA, "j", (0.0, 1.0), values=2)


def test_the_isola_of_the_reference_oscillator(isolas):
    (isola,) = isolas
    assert (isola.nu, isolas.notes, isola.notes) == (2, (), ())
    assert (isola.born.omega, float(isola.born)) == pytest.approx((2.355660, 0.579889), abs=2e-6)
    assert (isola.merges.omega, float(isola.merges)) == pytest.approx((2.023364, 0.176829), abs=2e-6)
    assert (isola.born.kind, isola.merges.kind) == ("isola_centre", "isola_merging")
    assert isola.range == (isola.merges, isola.born)
    # the cusp of the same curve is beside it, and is not its end
    (curve,) = (c for c in isolas.limit_points if c.bifurcations["CP"])
    (cusp,) = curve.bifurcations["CP"]
    assert (cusp.omega, cusp.parameter("j")) == pytest.approx((2.022540, 0.176778), abs=2e-6)
    assert "isola centre" in repr(isolas)


def test_an_end_at_zero_is_an_end(isolas):
    """`if isola.born:` asks whether it is known, not whether the parameter is zero there."""
    (isola,) = isolas

    def moved(end, value):
        orbit = replace(end.orbit, values={**end.orbit.values, "j": value})
        return IsolaEnd.of(replace(end, orbit=orbit), "j", end.kind == "isola_centre")

    born, merges = moved(isola.born, 0.0), moved(isola.merges, 0.0)
    assert born
    assert (float(born), born == 0.0, born < 0.1, f"{born:.3f}", born + 1.0) == (0.0, True, True, "0.000", 1.0)
    # two ends at one value of the parameter are two
    assert born != merges
    assert len({born, merges}) == 2
    assert moved(isola.born, 0.0) == born
    assert hash(born) == hash(0.0)
    assert Isolas([replace(isola, ends=(None, born))], isola.system, "j", (0.0, 1.0), OMEGA)[0].born is born


@pytest.mark.parametrize(("gap", "folds"), [(0.3, (2.082514, 2.785675)), (0.5, (2.200149, 2.514902))])
def test_its_limit_points_by_shooting(isolas, gap, folds):
    branch = isolas[0].at(gap)
    assert branch.closed
    assert sorted(b.omega for b in branch.bifurcations["LP"]) == pytest.approx(folds, abs=2e-6)


def test_closed_branches_between_its_ends(isolas):
    (isola,) = isolas
    span = isola.born - isola.merges
    for gap in (0.2, 0.3, 0.4, 0.5, isola.merges + 1e-4 * span, isola.born - 1e-4 * span):
        branch = isola.at(gap)
        assert branch.closed
        assert branch.nu == 2
        assert branch.parameter("j") == pytest.approx(gap)
        folds = [b.omega for b in branch.bifurcations["LP"]]
        for low, high in isola.stable_ranges(gap):
            assert min(folds) <= low < high <= max(folds)
    with pytest.raises(so.InputError, match=r"from 0\.17682\d* to 0\.57988\d*"):
        isola.at(0.6)
    assert 0.3 in isola
    assert 0.1 not in isola


def test_a_closed_branch_has_both_limit_points_where_it_begins_at_one(isolas):
    branch = isolas[0].at(0.3)
    folds = sorted(item.omega for item in branch.bifurcations["LP"])
    for item in branch.bifurcations["LP"]:
        again = so.continue_branch(item, "omega", (1.3, 4.5))
        assert again.closed
        assert sorted(one.omega for one in again.bifurcations["LP"]) == pytest.approx(folds, abs=1e-8)
        assert again.warnings == branch.warnings


def test_stable_parts_by_shooting(isolas):
    """At j = 0.2 period doublings interrupt the stable part; multipliers by shooting say the same."""
    branch = isolas[0].at(0.2)
    parts = isolas[0].stable_ranges(0.2)
    assert len(parts) == 2
    first, second = (b.omega for b in branch.bifurcations["PD"])
    assert (parts[0][1], parts[1][0]) == pytest.approx(sorted((first, second)))
    for index in range(3, len(branch), 101):
        assert so.verify(branch.orbits[index]).agrees


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0.3, 0.5, 0.9])
def test_the_answer_depends_neither_on_where_one_stands_nor_on_how_one_looks(isolas, gap):
    (isola,) = so.find_isolas(reference(j=gap), (4.2, 1.9), "j", (1.0, 0.0), values=[0.1])
    assert isola.range == pytest.approx(isolas[0].range, abs=1e-9)


@pytest.mark.parametrize(
    ("bounds", "born", "merges"),
    [
        pytest.param((0.0, 0.45), None, 0.176829, marks=pytest.mark.slow),
        pytest.param((0.25, 1.0), 0.579889, None, marks=pytest.mark.slow),
        # also of the isola of nonlinear damping, below
        pytest.param((0.3, 0.5), None, None, marks=pytest.mark.slow),
    ],
)
def test_bounds_that_cut_its_range(bounds, born, merges):
    (isola,) = so.find_isolas(reference(), OMEGA, "j", bounds, values=2)
    assert isola.range == pytest.approx((merges or bounds[0], born or bounds[1]), abs=2e-6)
    for end, expected in ((isola.born, born), (isola.merges, merges)):
        assert end is None if expected is None else end == pytest.approx(expected, abs=2e-6)
    assert sum("cuts its range" in reason for reason in isola.reasons) == (born is None) + (merges is None)
    assert isola.at(0.4).closed


def test_the_tuned_absorber():
    (isola,) = so.find_isolas(so.library.nltva(F=0.11), (0.7, 4.0), "F", (0.05, 0.25), values=2)
    assert isola.nu == 1
    assert (float(isola.born), isola.born.omega) == pytest.approx((0.12466, 1.80265), abs=1e-5)
    assert (float(isola.merges), isola.merges.omega) == pytest.approx((0.18562, 1.44059), abs=1e-5)
    assert isola.at(0.15).closed


@pytest.mark.slow
def test_the_exact_law():
    (isola,) = so.find_isolas(so.library.reference_oscillator(), OMEGA, "j", (0.0, 1.0), values=2)
    assert (isola.born.omega, float(isola.born)) == pytest.approx((2.353543, 0.581107), abs=2e-6)
    assert isola.at(0.4).closed


@pytest.fixture(scope="module")
def damped():
    """An oscillator whose damping falls and rises again with its velocity: over the load it has an isola.

    With one harmonic `F^2 = ((1 - w^2 + 3/4 k A^2) A)^2 + D(w A)^2`, `D(u) = a u - b u^3 + c u^5`.
    """
    return so.System(
        mass=1.0,
        damping=0.0,
        stiffness=1.0,
        elements=[so.Expression(0, "a*v - b*v**3*4/3 + c*v**5*8/5 + k*x**3")],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"F": 0.02, "a": 0.1, "b": 0.12, "c": 0.04, "k": 0.05},
    )


def damped_ends():
    """Where F over (w, A) is stationary: (w, F) of the saddle and of the minimum."""

    def load(w, a):
        u = w * a
        return np.hypot((1.0 - w**2 + 0.0375 * a**2) * a, 0.1 * u - 0.12 * u**3 + 0.04 * u**5)

    def slopes(at):
        w, a = at
        h = 1e-6
        return [load(w + h, a) - load(w - h, a), load(w, a + h) - load(w, a - h)]

    roots = [fsolve(slopes, start, xtol=1e-13) for start in ((1.0, 0.58), (1.03, 1.18))]
    return [(w, load(w, a)) for w, a in roots]


@pytest.mark.parametrize("bounds", [*slow((0.005, 0.06), (0.02, 0.06), (0.005, 0.03)), (0.02, 0.03)])
def test_an_isola_of_nonlinear_damping(damped, bounds):
    """Also where it meets no other branch within the bounds: stronger loads lead to it."""
    (isola,) = so.find_isolas(damped, (0.3, 2.0), "F", bounds, harmonics=1, values=2)
    (w_merges, merges), (w_born, born) = damped_ends()
    assert isola.range == pytest.approx((max(born, bounds[0]), min(merges, bounds[1])), rel=1e-7)
    for end, omega, value in ((isola.born, w_born, born), (isola.merges, w_merges, merges)):
        if bounds[0] < value < bounds[1]:
            assert (float(end), end.omega) == pytest.approx((value, omega), rel=1e-7)
        else:
            assert end is None
    assert sum("cuts its range" in reason for reason in isola.reasons) == (isola.born, isola.merges).count(None)
    assert isola.at(0.5 * sum(isola.range)).closed


@pytest.mark.slow
def test_an_isola_goes_on_where_its_limit_points_were_lost(isolas):
    """Its curves cut off amid its range, as by a corner that could not be passed: followed anew, it is the same isola,
    once.
    """
    (isola,) = isolas
    search = Search(Catalogue(isola.system, "j", (0.0, 1.0), SearchRange(*OMEGA), "adaptive", isola.options, 64))
    search.catalogue.curves += isolas.limit_points
    for piece in isola.pieces:
        kept = [node for node, value in zip(piece.nodes, piece.values, strict=True) if value > 0.26]
        ends = tuple(None if end is None or float(end.parameter("j")) < 0.26 else end for end in piece.ends)
        search.catalogue.pieces.append(replace(piece, nodes=tuple(kept), ends=ends))
    search.meet(isola.at(0.3), 0.3)
    (found,) = search.result()
    assert found.range == pytest.approx(isola.range, abs=2e-6)
    assert found.merges.omega == pytest.approx(isola.merges.omega, abs=2e-6)
    assert found.notes == ()


def one_sided():
    """A mass beside a soft stop: two isolas of 3T over the gap have cusps along their limit points."""
    stop = so.ElasticStop(0, 6.0, "g")
    return so.System(1.0, 0.05, 1.0, [stop], [so.HarmonicLoad(0, 0.5)], parameters={"g": 0.1})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("omega", "value", "born", "at", "folds"),
    [
        ((1.8, 2.3), 0.1, 0.267609, 0.1, (1.90859, 2.05735)),
        # there it leaves the range of omega
        ((3.0, 4.0), 0.05, 0.407511, 0.0, (4.02681, 5.41650)),
    ],
)
def test_a_cusp_is_no_end_of_an_isola(omega, value, born, at, folds):
    """Limit points by `find_subharmonics` at single gaps; what is followed is confirmed by shooting."""
    given = {"values": [value], "search": (3,), "depth": 0, "levels": ()}
    (isola,) = so.find_isolas(one_sided(), omega, "g", (0.0, 0.45), **given)
    assert isola.nu == 3
    assert isola.range[0] == 0.0
    assert float(isola.born) == pytest.approx(born, abs=2e-6)
    loop = isola.at(at)
    assert loop.closed
    places = sorted(item.omega for item in loop.bifurcations["LP"])
    assert (places[0], places[-1]) == pytest.approx(folds, abs=2e-5)
    assert all(so.verify(loop.orbits[place]).agrees for place in (3, len(loop) // 2, len(loop) - 4))


@pytest.mark.slow
def test_two_isolas_that_join():
    """They are told apart, each closed branch belongs to one of them, and it says where they join."""
    first, second = so.find_isolas(reference(p=1.7), (1.8, 4.5), "j", (0.3, 1.0), values=2)
    assert (first.born, second.born) == pytest.approx((0.846206, 0.900471), abs=2e-6)
    joined = max(first.range[0], second.range[0])
    assert joined == pytest.approx(0.780048, abs=2e-6)
    assert sum("as which it goes on" in reason for isola in (first, second) for reason in isola.reasons) == 1
    at = {
        value: [b.bifurcations["LP"] for b in (i.at(value) for i in (first, second) if value in i)]
        for value in (0.7, 0.8)
    }
    assert [len(at[0.7]), len(at[0.8])] == [1, 2]


def test_a_third_of_the_frequency_is_searched_for():
    """The 1/3 sub-harmonic isola of a Duffing oscillator: no branch leads to it; born as the load grows."""
    system = so.System(
        mass=1.0,
        damping=0.02,
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient=0.05)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"F": 5.0},
    )
    (isola,) = so.find_isolas(system, (2.5, 9.0), "F", (0.1, 5.0), values=[5.0], search=(3,), **FEW)
    assert isola.nu == 3
    assert isola.born is not None
    assert (isola.range[0], isola.range[1]) == (isola.born, 5.0)
    folds = sorted(b.omega for b in isola.at(5.0).bifurcations["LP"])
    assert folds == pytest.approx([3.081375, 7.310848], abs=2e-6)


@pytest.mark.slow
def test_ends_can_be_tracked_again(isolas):
    curve = so.track(isolas[0].born, "p", (0.5, 0.6))
    assert set(curve.isola) == {"isola_centre"}
    (isola,) = so.find_isolas(reference(p=0.6), OMEGA, "j", (0.1, 0.9), values=[0.1])
    end = int(np.argmax(curve.parameter("p")))
    assert isola.born == pytest.approx(curve.parameter("j")[end], abs=2e-6)


def test_a_budget_ends_it_politely():
    isolas = so.find_isolas(reference(), OMEGA, "j", (0.0, 1.0), seconds=1e-6)
    assert list(isolas) == []
    assert isolas.interruption == Interruption(1e-6)
    assert any("time limit of 1e-06 s" in note for note in isolas.notes)


def test_a_closed_branch_that_was_interrupted_is_not_kept(isolas, monkeypatch):
    (isola,) = isolas
    value = 0.47
    looks = iter(range(10**6))
    with monkeypatch.context() as patched:
        patched.setattr(interruption, "monotonic", lambda: float(next(looks)))
        part = isola.at(value, seconds=60)
    assert part.interruption == Interruption(60.0)
    assert not part.closed
    assert value not in isola.known
    # nor is anything read off it
    for reading in (lambda: isola.stable_ranges(value), lambda: isola.plot(values=[value])):
        with monkeypatch.context() as patched:
            looks = iter(range(10**6))
            patched.setattr(interruption, "monotonic", lambda looks=looks: float(next(looks)))
            with pytest.raises(so.TimeLimitError), interruption.time_limit(60):
                reading()
    whole = isola.at(value)
    assert whole.closed
    assert len(whole) > len(part)
    assert isola.at(value, seconds=1e-9) is whole  # what is known takes no time


@pytest.mark.parametrize("share", [0.15, 0.6, 0.97])
def test_wherever_a_time_limit_falls_the_search_says_so(share, monkeypatch, looks_of_a_search):
    looks = iter(range(10**9))
    monkeypatch.setattr(interruption, "monotonic", lambda: float(next(looks)))
    found = small_search(share * looks_of_a_search)
    assert found.interruption == Interruption(share * looks_of_a_search)
    assert any("the time limit of" in note for note in found.notes)
    assert found.summary.startswith("Incomplete, the time limit of")
    assert "values of F" in found.summary.split("Not searched: ")[1]
    assert not any(branch.interrupted for isola in found for branch in isola.known.values())
    assert not any(curve.interrupted for curve in (*found.limit_points, *found.doublings))


def test_the_periods_that_were_searched_for_are_named():
    """Also those of which nothing was found."""
    found = small_search(search=(3, 5), seeds=so.Seeds(2, 1, 1))
    assert list(found) == []
    assert found.limit_points
    assert len(found.to_dataframe()) == 0
    assert found.summary.startswith("No isola of T, 3T and 5T motions was found for F from 0.2 to 1")
    assert "a search for 3T motions at 3 values of F and a search for 5T motions at 3 values of F" in found.summary


@pytest.mark.slow
@pytest.mark.parametrize(("stiffness", "gap", "cubic"), [(15.3, 0.159, 0.2), (15.0, 0.17, 0.3)])
def test_an_isola_that_exists_only_between_the_values(stiffness, gap, cubic):
    """A search at one value inside its range knows it; at the values themselves there is none."""
    elements = [so.ElasticStop(0, stiffness, gap), so.CubicSpring(0, cubic)]
    system = so.System(1.0, 0.08, 1.0, elements, [so.HarmonicLoad(0, "q")], parameters={"q": 0.5})
    asked = (1.45, 1.85)
    here = {q: so.find_subharmonics(system.with_parameters({"q": q}), asked, subharmonic=3) for q in (0.1, 0.2, 0.4)}
    assert [len(found) for found in here.values()] == [0, 1, 0]
    isolas = so.find_isolas(system, asked, "q", (0.1, 0.4), values=2, levels=(), search=(3,))
    assert any(isola.nu == 3 and 0.2 in isola for isola in isolas)


def small_search(seconds=None, search=(), seeds=None):
    spring = so.PolynomialSpring(0, {3: "k3"})
    system = so.System(1.0, 0.05, 1.0, [spring], [so.HarmonicLoad(0, "F")], {"F": 1.0, "k3": 1.0})
    return so.find_isolas(
        system,
        (0.5, 3.0),
        "F",
        (0.2, 1.0),
        harmonics=3,
        values=2,
        depth=0,
        levels=(),
        search=search,
        seeds=seeds,
        seconds=seconds,
    )


@pytest.fixture(scope="module")
def looks_of_a_search():
    """How often a search looks at the clock."""
    count = 0

    def clock():
        nonlocal count
        count += 1
        return float(count)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(interruption, "monotonic", clock)
        assert not small_search(1e9).interrupted
    return count


def test_ctrl_c_keeps_what_is_there(damped):
    def stop(share, where):
        if "closed" in where:
            raise KeyboardInterrupt

    isolas = so.find_isolas(damped, (0.3, 2.0), "F", (0.005, 0.06), harmonics=1, values=2, progress=stop)
    assert list(isolas) == []
    assert isolas.limit_points
    assert isolas.interruption == Interruption()
    assert any("interrupted" in note for note in isolas.notes)


# ------------------------------------------------------------------------------------------------- symmetric systems
def hardening(**loads):
    """A Duffing oscillator with damping 0.05, and further loads."""
    return so.System(
        mass=1.0,
        damping=0.05,
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient=1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F"), *(so.StaticLoad(dof=0, force=f) for f in loads.values())],
        parameters={"F": 1.0},
    )


def chain():
    """Two masses on cubic springs."""
    pattern = np.array([[2.0, -1.0], [-1.0, 2.0]])
    return so.System(
        mass=np.eye(2),
        damping=0.1 * pattern,
        stiffness=pattern,
        elements=[so.CubicSpring(dof=0, coefficient=1.0), so.CubicSpring(dof=(0, 1), coefficient=0.5)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"F": 1.0},
    )


def between_stops():
    """A mass between two equal stops."""
    return so.System(
        mass=1.0,
        damping=0.1,
        stiffness=1.0,
        elements=[so.ElasticStop(dof=0, stiffness=5.0, gap=gap) for gap in (1.0, -1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"F": 1.0},
    )


@pytest.mark.parametrize(
    ("system", "omega", "bounds", "harmonics"),
    [
        (hardening(), (0.5, 1.2), (0.5, 3.0), "adaptive"),
        pytest.param(so.library.duffing(c=0.2), (0.5, 3.0), (0.5, 10.0), 9, marks=pytest.mark.slow),
        pytest.param(chain(), (0.4, 2.5), (0.5, 8.0), 5, marks=pytest.mark.slow),
        pytest.param(between_stops(), (0.4, 2.5), (0.5, 6.0), "adaptive", marks=pytest.mark.slow),
        pytest.param(so.library.duffing(c=0.2), (0.5, 3.0), (0.5, 30.0), "adaptive", marks=pytest.mark.slow),
    ],
)
def test_a_loop_between_pitchforks_of_the_response_is_no_isola(system, omega, bounds, harmonics):
    """It closes on itself, and every sweep that passes one of its branch points comes to it."""
    isolas = so.find_isolas(system, omega, "F", bounds, harmonics=harmonics, values=3, levels=(), search=())
    assert list(isolas) == []
    assert isolas.limit_points


@pytest.mark.slow
def test_a_static_load_makes_such_a_loop_an_isola():
    """It takes the response over one half of the loop; the other one closes with what was the symmetric response.

    There are two such loops, at the resonances at a half and at a quarter of the natural frequency. Mirror images of
    the response lead to them: no response begins on them.
    """
    system = hardening(static=0.01)
    isolas = so.find_isolas(system, (0.5, 1.2), "F", (0.5, 3.0), harmonics=9, values=[3.0], levels=(1.5,), search=())
    assert [isola.born.kind for isola in isolas] == ["isola_centre"] * 2
    sweeps = [
        so.frequency_response(system.with_parameters(F=2.5), ends, harmonics=9) for ends in ((0.4, 1.4), (1.4, 0.4))
    ]
    for isola in isolas:
        loop = isola.at(2.5)
        assert loop.closed
        assert isola.stable_ranges(2.5)
        for sweep in sweeps:
            assert sweep.omega[-1] != sweep.omega[0]
            assert sweep.bifurcations["BP"] == []
            assert not any(lies_on(orbit, sweep.points) for orbit in loop.orbits[::5])


def test_a_true_isola_of_unsymmetric_motions_stays():
    """Period-2 motions of the symmetric oscillator, isolated from all others, come in pairs: they are listed once."""
    system = so.library.duffing(c=0.1)
    given = {"values": [5.0], "search": (2,), "levels": (), "depth": 0, "seeds": so.Seeds(8, 6, 1)}
    (isola,) = so.find_isolas(system, (2.9, 4.0), "F", (4.0, 5.0), harmonics=5, **given)
    assert isola.born.kind == "isola_centre"
    loop = isola.at(4.8)
    image = mirrored(loop.orbits[len(loop) // 2])
    assert image is not None
    assert not lies_on(image, loop.points)


def test_what_hangs_on_an_isola_is_part_of_it():
    """The symmetric 3T isola at F = 200 has four pitchforks; the loops between them turn back there, it does not."""
    system = so.library.duffing(c=0.1).with_parameters(F=200.0)
    start = so.periodic_orbit(system, 3.1987, start=[5.656, -25.978], subharmonic=3)
    isola = so.continue_branch(start, "omega", (1.0, 5.0))
    assert isola.closed
    assert len(isola.bifurcations["BP"]) == 4
    search = Search(Catalogue(system, "F", (190.0, 210.0), SearchRange(1.0, 5.0), "adaptive", {}, 0))
    assert search.of(isola, 200.0).detached
    hanging = so.switch_branch(isola.bifurcations["BP"][2])
    assert hanging.closed
    loop = search.of(hanging, 200.0)
    assert loop.detached
    assert lies_on(isola.orbits[len(isola) // 2], loop.branch.points)
    # were one of these branches reached from the response, all of them would be
    search.met[200.0] = [isola]
    assert not search.of(hanging, 200.0).detached


def test_isolas_are_in_the_order_of_their_births():
    """A birth at 0 is one."""

    class Born(Isola):
        born, range = None, None

        def __init__(self, born, top):
            object.__setattr__(self, "born", born)
            object.__setattr__(self, "range", (-1.0, top))

    given = [Born(0.5, 0.5), Born(None, 0.1), Born(0.0, 3.0), Born(-0.5, 1.0)]
    found = Isolas(given, hardening(), "F", (-1.0, 3.0), (0.5, 1.2))
    assert [isola.born for isola in found] == [-0.5, 0.0, 0.5, None]


def test_notes_of_searches_under_other_loads_are_kept(monkeypatch):
    def fails(item, name, *rest, **options):
        raise so.ConvergenceError(f"no curve over {name}")

    monkeypatch.setattr(catalogue, "track", fails)
    given = {"values": [0.05], "levels": (6.0,), "search": (), "depth": 0}
    isolas = so.find_isolas(so.library.duffing(c=0.1, F=0.05), (0.6, 2.0), "F", (0.01, 0.051), harmonics=3, **given)
    (note,) = isolas.notes
    assert note.startswith("LP at omega = ")
    assert note.count("load_level = 6, F = 0.05") == 2
    assert note.endswith("could not be followed over load_level: no curve over load_level")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"parameter": "k"}, "parameter"),
        ({"parameter": "omega"}, "omega varies anyway"),
        ({"values": 1}, "at least 2"),
        ({"values": [0.5, 1.5]}, "from 0 to 1, not"),
        ({"search": (0,)}, "periods"),
        ({"search": "2"}, "search must be a list of whole numbers"),
        ({"levels": (0.0,)}, "levels"),
        ({"levels": (2.0, 1.0)}, "other ones than 1"),
        ({"depth": -1}, "depth"),
        ({"seconds": 0.0}, "seconds"),
        ({"max_curves": True}, "max_curves"),
        ({"seeds": 3}, "Seeds"),
        ({"omega": (0.0, 1.0)}, "omega"),
    ],
)
def test_wrong_input_is_refused(changes, said):
    given = {"system": reference(), "omega": OMEGA, "parameter": "j", "bounds": (0.0, 1.0), **changes}
    with pytest.raises(so.InputError, match=said):
        so.find_isolas(**given)
