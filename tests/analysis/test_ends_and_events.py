"""How a branch ends, what it says then, user's events, and what an interruption leaves."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so


def test_ends_exactly_on_the_bounds(duffing_curve, rattling_curve):
    assert duffing_curve.omega[[0, -1]].tolist() == [3.0, 0.5]
    assert rattling_curve.omega[[0, -1]].tolist() == [4.5, 1.3]
    assert duffing_curve.ended == "reached the end of the range at omega = 0.5"
    for orbit in (duffing_curve.orbits[-1], rattling_curve.orbits[-1]):
        assert orbit.residual < 1e-10
    assert duffing_curve.omega.min() == 0.5
    assert duffing_curve.omega.max() == 3.0


def test_a_branch_that_folds_back_leaves_at_the_end_it_came_from():
    """The hardening oscillator swept up from within its bistable range, on the lower branch, ends where it began."""
    system = so.library.duffing(c=0.1, F=0.3)
    low = so.frequency_response(system, (3.0, 1.4)).orbits[-1]
    # between the two folds: down along the lower branch, over the fold, and up out of the range again
    curve = so.frequency_response(system, (3.0, 1.45), start=None)
    assert low.omega == 1.4
    assert curve.omega[0] == 3.0
    assert curve.omega[-1] in (1.45, 3.0)
    assert "reached the end of the range" in curve.ended


def test_max_points_in_words():
    system = so.library.duffing(c=0.1, F=0.3)
    curve = so.frequency_response(system, (3.0, 0.5), stepping=so.SteppingOptions(max_points=20))
    assert len(curve) == 20
    assert curve.ended == f"20 points computed at omega = {curve.omega[-1]:.6g}. Raise max_points to go on"
    assert curve.ended in repr(curve)


def test_largest_step_is_kept(duffing_curve):
    fine = so.frequency_response(duffing_curve.system, (3.0, 0.5), max_step=0.01)
    assert np.diff(fine.arclength).max() <= 0.01 * (1.0 + 1e-6)
    assert len(fine) > 2 * len(duffing_curve)
    assert [b.omega for b in fine.bifurcations] == pytest.approx(
        [b.omega for b in duffing_curve.bifurcations], abs=1e-7
    )


def test_progress_reports_and_never_runs_backwards(duffing_curve):
    seen = []
    so.frequency_response(duffing_curve.system, (3.0, 0.5), progress=lambda share, text: seen.append((share, text)))
    shares = [share for share, _ in seen]
    # the start twice more: before it is solved for, and before its stability is known
    assert len(seen) == len(duffing_curve) + 2
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    assert seen[0][1] == "omega = 3"


def test_interruption_keeps_what_was_computed(rattling_curve):
    def stop(share, text):
        if share > 0.6:
            raise KeyboardInterrupt

    curve = so.frequency_response(rattling_curve.system, (4.5, 1.3), progress=stop)
    assert 10 < len(curve) < len(rattling_curve)
    assert curve.ended == f"interrupted at omega = {curve.omega[-1]:.6g}; what was computed is kept"
    assert curve.omega.tolist() == rattling_curve.omega[: len(curve)].tolist()
    assert [b.omega for b in curve.bifurcations["PD"]][:1] == [rattling_curve.bifurcations["PD"][0].omega]
    # and it can be gone on with
    rest = so.frequency_response(curve.system, (float(curve.omega[-1]), 1.3), start=curve.orbits[-1])
    assert [b.omega for b in rest.bifurcations["LP"]] == pytest.approx(
        [b.omega for b in rattling_curve.bifurcations["LP"]], abs=1e-7
    )


def test_interruption_of_a_branch_followed_both_ways(duffing_curve):
    calls = []

    def stop(share, text):
        calls.append(text)
        if len(calls) == 15:
            raise KeyboardInterrupt

    branch = so.continue_branch(duffing_curve.orbits[3], "F", (0.1, 1.0), progress=stop)
    # both starts have been reported before they were points
    assert len(branch) >= 13
    assert "interrupted" in branch.ended


def test_events_are_located_to_nine_digits(duffing_curve):
    """Where the response has 0.8 of amplitude, and where it lags the load by 90 degrees."""
    level = so.Event("level", lambda orbit: abs(orbit.harmonic(1)) - 0.8)
    quadrature = so.Event("phase resonance", lambda orbit: orbit.harmonic(1).real)
    curve = so.frequency_response(duffing_curve.system, (3.0, 0.5), events=[level, quadrature])
    assert [b.omega for b in curve.bifurcations] == [b.omega for b in duffing_curve.bifurcations]
    levels = curve.events["level"]
    assert len(levels) == 2
    for e in levels:
        assert abs(e.orbit.harmonic(1)) == pytest.approx(0.8, abs=1e-9)
        assert e.residual < 1e-10
        assert e.kind == "level"
    (peak,) = curve.events["phase resonance"]
    assert peak.orbit.harmonic(1).real == pytest.approx(0.0, abs=1e-9)
    # the load then gives what it can, F omega |x_1| / 2 per unit time, and the damper takes c omega^2 k^2 |x_k|^2 / 2
    sizes = np.abs(peak.orbit.amplitudes[:, 0])
    taken = 0.1 * peak.omega * np.sum(np.arange(len(sizes)) ** 2 * sizes**2)
    assert taken == pytest.approx(0.3 * sizes[1], abs=1e-9)
    places = [e.arclength for e in curve.events]
    assert places == sorted(places)
    with pytest.raises(so.InputError, match="did you mean 'level'"):
        curve.events["levl"]


def test_event_of_one_harmonic_against_its_formula():
    """Amplitude 1 of one harmonic: `omega` from `F^2 = (k + 3/4 - omega^2)^2 + (c omega)^2`."""
    system = so.library.duffing(c=0.1, F=0.3)
    event = so.Event("one", lambda orbit: abs(orbit.harmonic(1)) - 1.0)
    curve = so.frequency_response(system, (3.0, 0.5), harmonics=1, events=event)
    b = 1.75
    roots = np.roots([1.0, 0.01 - 2.0 * b, b**2 - 0.09])
    assert sorted(e.omega for e in curve.events) == pytest.approx(sorted(np.sqrt(roots)), abs=1e-9)


def test_event_along_a_parameter():
    event = so.Event("level", lambda orbit: orbit.amplitude() - 1.0)
    sweep = so.continue_branch(
        so.library.duffing(c=0.1, F=0.3), "F", (0.0, 1.0), omega=1.2, harmonics=11, events=[event]
    )
    (found,) = sweep.events
    assert found.amplitude == pytest.approx(1.0, abs=1e-9)
    assert found.parameter("F") == found.parameters["F"]
    assert found.omega == 1.2


def test_an_event_must_return_a_number(duffing_curve):
    bad = so.Event("bad", lambda orbit: float("nan"))
    with pytest.raises(so.InputError, match=r"event 'bad' returned nan at omega = .*finite number"):
        so.frequency_response(duffing_curve.system, (3.0, 2.9), events=[bad])


def test_a_doubling_that_more_harmonics_move_is_listed_once():
    """Close to the extremum of the period doublings: one of two lies behind a point with few harmonics, ahead with
    more.
    """
    system = so.library.reference_oscillator(regularization=3000.0, j=0.1771)
    for omega in ((2.12, 1.98), (2.1, 2.0), (1.98, 2.12)):
        curve = so.frequency_response(system, omega)
        doublings = sorted(b.omega for b in curve.bifurcations["PD"])
        assert doublings == pytest.approx([2.02092649, 2.02261178], abs=1e-6)
        assert not curve.audit.unsettled
