"""Sweeps: jumps of a Duffing oscillator where its closed form and time integration say, and honest ends."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.results.sweep import hysteresis, sweep_path
from suboctave.store.layout import EventRow, curve_dataset
from suboctave.timedomain import integrate


def test_a_hardening_duffing_jumps_at_its_limit_points(duffing_curve):
    low, high = sorted(b.omega for b in duffing_curve.bifurcations["LP"])
    up, down = duffing_curve.sweep_path("up"), duffing_curve.sweep_path("down")
    assert [jump.value for jump in up.jumps] == [high]
    assert [jump.value for jump in down.jumps] == [low]
    assert up.jumps[0].before > 5 * up.jumps[0].after
    assert down.jumps[0].before < down.jumps[0].after
    assert up.complete
    assert down.complete
    assert up.values[0] == 0.5
    assert up.values[-1] == 3.0
    assert np.all(np.diff(up.values) >= 0.0)
    assert np.all(np.diff(down.values) <= 0.0)
    assert duffing_curve.hysteresis() == [(low, high)]
    assert "jumps down at omega" in repr(up)


@pytest.mark.parametrize("direction", ["up", "down"])
def test_time_integration_lands_where_the_path_does(duffing_curve, direction):
    path = duffing_curve.sweep_path(direction)
    (jump,) = path.jumps
    fold = min(duffing_curve.bifurcations["LP"], key=lambda b: abs(b.omega - jump.value))
    beyond = jump.value * (1.005 if direction == "up" else 0.995)
    period = 2.0 * np.pi / beyond
    start = fold.orbit.start()
    settled = integrate(duffing_curve.system, start, (0.0, 60 * period), beyond, rtol=1e-8)
    begin = 60 * period
    last = integrate(duffing_curve.system, settled.end, (begin, begin + 2.0 * period), beyond, rtol=1e-8)
    assert last.largest() == pytest.approx(path.amplitude_at(beyond), rel=5e-3)


def test_without_folds_a_sweep_goes_through():
    curve = so.frequency_response(so.library.duffing(c=0.3, F=0.1), (0.5, 2.0), max_step=0.2)
    up = curve.sweep_path("up")
    assert up.jumps == ()
    assert up.complete
    np.testing.assert_allclose(up.values, curve.omega)
    assert curve.hysteresis() == []


def test_a_period_doubling_ends_the_path_and_says_so(rattling_curve):
    first = max(b.omega for b in rattling_curve.bifurcations["PD"])
    down = rattling_curve.sweep_path("down")
    assert down.values[-1] == first
    assert not down.complete
    assert "twice the period" in down.ended
    up = rattling_curve.sweep_path("up")
    assert not up.jumps
    assert "no stable motion of this branch" in up.ended


def z_shape(stable, kinds=("LP", "LP")):
    """A curve over omega 0..2, back to 1 and on to 3, as straight lines, with events at the turns."""
    omega = np.array([0.0, 1.0, 1.9, 1.5, 1.1, 2.0, 3.0])
    size = np.arange(7.0)
    events = [EventRow(kinds[0], 2, 2.0, 2.5), EventRow(kinds[1], 4, 1.0, 4.5)]
    return curve_dataset(omega, size, stable=stable, events=events)


def test_jumps_go_up_and_down_on_an_s_curve():
    data = z_shape([True, True, True, False, False, True, True])
    up, down = sweep_path(data, "up"), sweep_path(data, "down")
    assert [(j.value, j.before) for j in up.jumps] == [(2.0, 2.5)]
    assert up.jumps[0].after == pytest.approx(5.0)
    assert [(j.value, j.before) for j in down.jumps] == [(1.0, 4.5)]
    assert down.jumps[0].after == pytest.approx(1.0)
    assert hysteresis(data) == [(1.0, 2.0)]


@pytest.mark.parametrize(("kind", "words"), [("PD", "twice the period"), ("NS", "quasi-periodic"), ("BP", "another")])
def test_other_ways_to_lose_stability_end_the_path(kind, words):
    omega = np.linspace(0.0, 1.0, 11)
    data = curve_dataset(omega, omega, stable=omega < 0.5, events=[EventRow(kind, 4, 0.45, 0.45)])
    up = sweep_path(data, "up")
    assert up.values[-1] == 0.45
    assert words in up.ended
    assert not up.complete
    assert sweep_path(data, "down").ended.startswith("reached the beginning")


def test_two_contacts_that_graze_at_once_are_no_obstacle():
    omega = np.linspace(0.0, 1.0, 11)
    events = [EventRow("grazing", 4, 0.45, 0.45, stable_after=True), EventRow("grazing", 4, 0.45, 0.45)]
    up = sweep_path(curve_dataset(omega, omega, stable=omega < 2.0, events=events), "up")
    assert up.complete
    assert up.amplitude_at(0.83) == pytest.approx(0.83)


def test_several_motions_to_land_on_are_listed():
    omega = np.array([0.0, 1.0, 2.0, 1.0, 0.5, 2.5, 1.0, 3.0])
    size = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0])
    stable = [True, True, True, False, True, True, True, True]
    up = sweep_path(curve_dataset(omega, size, stable=stable, events=[EventRow("LP", 2, 2.01, 1.1)]), "up")
    assert "several stable motions" in up.ended
    assert not up.jumps


def test_wrong_input_is_refused(duffing_curve):
    with pytest.raises(InputError, match='"up" or "down"'):
        duffing_curve.sweep_path("sideways")
    with pytest.raises(InputError, match="no verdicts"):
        sweep_path(curve_dataset([0.0, 1.0], [0.0, 1.0]))
    nothing = sweep_path(curve_dataset([0.0, 1.0], [0.0, 1.0], stable=[False, False]))
    assert "no motion of the branch is stable" in nothing.ended
    assert "empty" in repr(nothing)
    assert hysteresis(curve_dataset([0.0, 1.0], [0.0, 1.0], stable=[False, False])) == []
