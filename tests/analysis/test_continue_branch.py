"""Curves along any parameter: S-curves, both directions, from a bifurcation, from and to rest, restarts, isolas."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so

OMEGA = 1.5


@pytest.fixture(scope="module")
def s_curve():
    """A Duffing oscillator at fixed frequency, its force from rest to 1."""
    return so.continue_branch(so.library.duffing(c=0.05, F=0.1), "F", (0.0, 1.0), omega=OMEGA)


def one_harmonic_folds(c, omega, alpha=1.0):
    """Folds of `F^2 = a^2 [(1 - omega^2 + 3/4 alpha a^2)^2 + (c omega)^2]` in F: dF^2/d(a^2) = 0. Pairs (F, a)."""
    detuning = 1.0 - omega**2
    q = 0.75 * alpha
    folds = []
    for y in np.roots([3.0 * q**2, 4.0 * q * detuning, detuning**2 + (c * omega) ** 2]):
        force = np.sqrt(y * ((detuning + q * y) ** 2 + (c * omega) ** 2))
        folds.append((float(force.real), float(np.sqrt(y).real)))
    return sorted(folds, key=lambda pair: pair[1])


def test_s_curve_of_one_harmonic():
    curve = so.continue_branch(so.library.duffing(c=0.05, F=0.1), "F", (0.01, 1.0), omega=OMEGA, harmonics=1)
    expected = one_harmonic_folds(0.05, OMEGA)
    assert [b.kind for b in curve.bifurcations] == ["LP", "LP"]
    for b, (force, amplitude) in zip(curve.bifurcations, expected, strict=True):
        assert b.parameter("F") == pytest.approx(force, rel=1e-9)
        assert b.amplitude == pytest.approx(amplitude, rel=1e-7)
        assert b.omega == OMEGA
    a2 = curve.amplitude**2
    assert curve.parameter("F") ** 2 == pytest.approx(
        a2 * ((1.0 - OMEGA**2 + 0.75 * a2) ** 2 + (0.05 * OMEGA) ** 2), rel=1e-8
    )


def test_from_rest(s_curve):
    assert s_curve.amplitude[0] == 0.0
    assert s_curve.parameter("F")[[0, -1]].tolist() == [0.0, 1.0]
    assert s_curve.stable[0]
    # near rest the oscillator is linear
    assert s_curve.amplitude[1] == pytest.approx(
        s_curve.parameter("F")[1] / abs(1.0 - OMEGA**2 + 0.05j * OMEGA), rel=1e-6
    )
    assert [b.kind for b in s_curve.bifurcations] == ["LP", "LP"]
    assert np.all(s_curve.omega == OMEGA)


def test_to_rest(s_curve):
    """The branch ends at the motion that is none, and never goes on to negative forces."""
    back = so.continue_branch(s_curve.orbits[-1], "F", (1.0, 0.0))
    assert back.parameter("F")[[0, -1]].tolist() == [1.0, 0.0]
    assert back.parameter("F").min() == 0.0
    assert back.amplitude[-1] < 1e-12
    assert [b.parameter("F") for b in back.bifurcations] == pytest.approx(
        [b.parameter("F") for b in s_curve.bifurcations][::-1], rel=1e-8
    )


@pytest.mark.parametrize("bounds", [(0.0, 1.0), (1.0, 0.0)])
def test_both_directions_from_an_inner_motion(s_curve, bounds):
    """One branch from the first bound to the second, with everything of the curve that was swept from its end."""
    middle = s_curve.orbits[len(s_curve) // 2]
    both = so.continue_branch(middle, "F", bounds)
    assert both.parameter("F")[[0, -1]].tolist() == list(bounds)
    assert np.all(np.diff(both.arclength) > 0.0)
    folds = [b.parameter("F") for b in s_curve.bifurcations]
    assert [b.parameter("F") for b in both.bifurcations] == pytest.approx(folds[:: 1 if bounds[1] else -1], rel=1e-8)
    places = [b.arclength for b in both.bifurcations]
    assert places == sorted(places)


@pytest.mark.parametrize("fold", [0, 1])
def test_a_fold_in_force_is_a_fold_in_frequency(s_curve, fold):
    """`R_X` is singular there, whichever parameter is free; the branch starts at the fold itself."""
    b = s_curve.bifurcations[fold]
    along = so.continue_branch(b, "omega", (0.5, 6.0))
    assert along.omega[[0, -1]].tolist() == [0.5, 6.0]
    system = s_curve.system.with_parameters(F=b.parameter("F"))
    response = so.frequency_response(system, (0.5, 6.0))
    folds = [f.omega for f in response.bifurcations["LP"]]
    assert min(abs(omega - OMEGA) for omega in folds) < 1e-7


def test_from_a_period_doubling(rattling_curve):
    b = rattling_curve.bifurcations["PD"][0]
    along = so.continue_branch(b, "omega", (4.5, 3.0))
    assert [f.kind for f in along.bifurcations] == ["PD"]
    assert along.omega[[0, -1]].tolist() == [4.5, 3.0]


def test_from_a_point_of_a_branch(s_curve):
    branch = so.continue_branch(s_curve.points[3], "alpha", (0.5, 2.0))
    assert branch.parameter("alpha")[[0, -1]].tolist() == [0.5, 2.0]
    assert np.all(branch.parameter("F") == s_curve.parameter("F")[3])
    assert np.all(branch.omega == OMEGA)


def test_omega_of_a_system_is_its_frequency_response(duffing_curve):
    branch = so.continue_branch(duffing_curve.system, "omega", (3.0, 0.5))
    assert branch.omega.tolist() == duffing_curve.omega.tolist()


def test_restart_equals_the_uninterrupted_run(rattling_curve):
    """From a stored point the curve goes on as if it had never stopped: same folds, same end."""
    at = len(rattling_curve) // 2
    rest = so.continue_branch(rattling_curve.orbits[at], "omega", (4.5, 1.3))
    assert [b.kind for b in rest.bifurcations] == [b.kind for b in rattling_curve.bifurcations]
    for a, b in zip(rest.bifurcations, rattling_curve.bifurcations, strict=True):
        # two roads to the same motion; the number of harmonics of an event may differ with the road
        assert a.omega == pytest.approx(b.omega, abs=1e-7)
    assert rest.amplitude[-1] == pytest.approx(rattling_curve.amplitude[-1], rel=1e-6)
    assert rest.multipliers[-1] == pytest.approx(rattling_curve.multipliers[-1], abs=1e-3)


def test_restart_with_fixed_harmonics_is_exact():
    """With the number of harmonics given, even the digits of the end agree."""
    system = so.library.reference_oscillator()
    whole = so.frequency_response(system, (4.5, 1.3), harmonics=15)
    at = int(np.argmax(whole.omega < 3.0))
    rest = so.frequency_response(system, (whole.omega[at], 1.3), harmonics=15, start=whole.orbits[at])
    assert rest.orbits[0].coefficients == pytest.approx(whole.orbits[at].coefficients, abs=1e-12)
    assert rest.orbits[-1].coefficients == pytest.approx(whole.orbits[-1].coefficients, abs=1e-9)
    assert [b.omega for b in rest.bifurcations] == pytest.approx(
        [b.omega for b in whole.bifurcations][-len(rest.bifurcations) :], abs=1e-11
    )


# The absorber's detached resonance, in no sweep of the frequency at F = 0.15 (it merges at F = 0.18562).


@pytest.fixture(scope="module")
def at_the_top():
    """A motion on the isola: from the merged curve at F = 0.19, near the isola's centre, the force taken down."""
    merged = so.frequency_response(so.library.nltva(0.19), (0.8, 3.0))
    near = np.flatnonzero((np.abs(merged.omega - 1.8) < 0.15) & (merged.amplitude > 1.0))
    down = so.continue_branch(merged.orbits[near[0]], "F", (0.19, 0.15))
    assert down.ended.startswith("reached the end of the range at F = 0.15")
    return down.orbits[-1]


@pytest.fixture(scope="module", params=[(0.8, 3.0), (3.0, 0.8)], ids=["up", "down"])
def loop(request, at_the_top):
    return so.continue_branch(at_the_top, "omega", request.param)


def test_isola_closes(loop):
    assert loop.closed
    assert loop.ended == "the curve closed on itself"
    first, last = loop.orbits[0], loop.orbits[-1]
    assert last.omega == first.omega
    assert last.coefficients == pytest.approx(first.coefficients, abs=1e-10)


def test_isola_limit_points_are_its_ends(loop):
    folds = sorted(b.omega for b in loop.bifurcations["LP"])
    assert len(folds) == 2
    assert loop.omega.min() == pytest.approx(folds[0], abs=1e-2)
    assert loop.omega.max() == pytest.approx(folds[1], abs=1e-2)
    assert folds[0] <= loop.omega.min()
    assert loop.omega.max() <= folds[1]
    for b in loop.bifurcations["LP"]:
        check = so.verify(b)
        assert check.agrees, check


def test_isola_each_event_once(loop):
    assert sorted(b.kind for b in loop.bifurcations) == ["LP", "LP", "NS"]
    places = [b.arclength for b in loop.bifurcations]
    assert places == sorted(places)
    assert loop.arclength[0] <= places[0]
    assert places[-1] <= loop.arclength[-1]


def test_isola_seam_on_a_bifurcation(loop):
    """Started at its own fold the loop still names it once."""
    again = so.continue_branch(loop.bifurcations["LP"][0], "omega", (0.8, 3.0))
    assert again.closed
    assert sorted(b.kind for b in again.bifurcations) == ["LP", "LP", "NS"]


def test_isola_is_not_met_by_a_sweep(loop):
    sweep = so.frequency_response(so.library.nltva(0.15), (0.8, 3.0))
    inside = (sweep.omega > loop.omega.min()) & (sweep.omega < loop.omega.max())
    assert sweep.amplitude[inside].max() < 0.5 * loop.amplitude.min()


@pytest.mark.parametrize("regularization", [None, 100.0])
def test_a_gap_is_tracked_through_zero_both_ways(regularization):
    """A preloaded stop, an open one, and what lies between: the regularised law's force at rest has a corner there."""
    system = so.System(
        1.0,
        0.05,
        1.0,
        elements=[so.ElasticStop(dof=0, stiffness=3.0, gap="j", side="right", regularization=regularization)],
        loads=[so.HarmonicLoad(dof=0, amplitude=0.4)],
        parameters={"j": 0.5},
    )
    down = so.continue_branch(system, "j", (0.5, -0.5), omega=1.3, harmonics=15)
    up = so.continue_branch(system.with_parameters(j=-0.5), "j", (-0.5, 0.5), omega=1.3, harmonics=15)
    assert down.parameter("j")[-1] == -0.5
    assert up.parameter("j")[-1] == 0.5
    assert down.amplitude[-1] == pytest.approx(up.amplitude[0], rel=1e-8)
    assert down.amplitude[0] == pytest.approx(up.amplitude[-1], rel=1e-8)
