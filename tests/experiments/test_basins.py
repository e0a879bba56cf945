"""Basins of attraction, against long integration, branches of harmonic balance and a count made otherwise."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.timedomain import shoot
from suboctave.timedomain.flow import Flow

basin_run = importlib.import_module("suboctave.experiments.basins")
DUFFING = so.library.duffing(c=0.1, alpha=1.0, F=0.3)
BOX = ((-2.0, 2.0), (-2.0, 2.0))


@pytest.fixture(scope="module")
def found():
    return so.basins(DUFFING, omega=1.5, box=BOX, grid=(30, 24))


def test_labels_are_what_long_integration_finds(found):
    x, y = np.meshgrid(found.x, found.y)
    states = np.column_stack([x.ravel(), y.ravel()])
    sections = so.poincare_sections(DUFFING, start=states, omega=1.5, transient=200, periods=6)
    ends = np.array([sections.attractor(i).amplitude for i in range(len(states))])
    said = np.array([found.attractors[i].amplitude for i in found.labels.ravel()])
    assert np.abs(ends / said - 1.0).max() < 1e-3
    assert len(found.attractors) == 2
    assert found.contradicted == 0
    assert found.followed == 200
    assert found.settling.max() < 200
    assert sum(found.shares.values()) == pytest.approx(1.0)
    told = found.attractor_at(found.x[7], found.y[5])
    assert told is found.attractors[found.labels[5, 7]]


def test_branches_give_the_names(found):
    curve = so.frequency_response(DUFFING, omega=(3.0, 0.5))
    named = so.basins(DUFFING, omega=1.5, box=BOX, grid=(30, 24), attractors={"response": curve})
    assert all(one.given for one in named.attractors)
    assert {one.name for one in named.attractors} == {"response", "response (2)"}
    amplitudes = sorted(one.amplitude for one in named.attractors)
    assert amplitudes == pytest.approx(sorted(one.amplitude for one in found.attractors), rel=1e-7)
    amplitude = {one.name: one.amplitude for one in found.attractors}
    other = {one.name: one.amplitude for one in named.attractors}
    first = np.vectorize(lambda i: found.attractors[i].amplitude)(found.labels)
    second = np.vectorize(lambda i: named.attractors[i].amplitude)(named.labels)
    assert np.allclose(first, second, rtol=1e-6)
    assert set(np.round(list(amplitude.values()), 6)) == set(np.round(list(other.values()), 6))


def test_a_plane_of_two_degrees_of_freedom():
    """Two uncoupled oscillators: the plane of the first one is divided as if the other one were not there."""
    system = so.System(
        np.eye(2), np.diag([0.1, 0.3]), np.diag([1.0, 2.0]), elements=[so.CubicSpring(0, 1.0)],
        loads=[so.HarmonicLoad(0, amplitude=0.3), so.HarmonicLoad(1, amplitude=0.2)],
    )  # fmt: skip
    rest = [0.0, 0.7, 0.0, -0.4]
    both = so.basins(system, omega=1.5, box=BOX, grid=(8, 6), plane=("x_0", "v_0"), start=rest)
    alone = so.basins(DUFFING, omega=1.5, box=BOX, grid=(8, 6))
    first = np.vectorize(lambda i: both.attractors[i].amplitude)(both.labels)
    second = np.vectorize(lambda i: alone.attractors[i].amplitude)(alone.labels)
    assert np.allclose(first, second, rtol=1e-6)
    assert both.plane == ("x_0", "v_0")


def test_goes_on_after_a_kill(tmp_path, monkeypatch, found):
    monkeypatch.setattr(basin_run, "_CHUNK", 100)
    settle, calls = basin_run.BasinRun._settle, []

    def interrupted(self, states, told):
        calls.append(len(states))
        if len(calls) == 5:
            raise KeyboardInterrupt
        return settle(self, states, told)

    monkeypatch.setattr(basin_run.BasinRun, "_settle", interrupted)
    half = so.basins(DUFFING, omega=1.5, box=BOX, grid=(30, 24), keep=tmp_path / "kept")
    assert not half.complete
    assert half.names[-3] == "not computed"
    assert (half.labels == -3).sum() == 720 - 300
    calls[:] = [0] * 10
    again = so.basins(DUFFING, omega=1.5, box=BOX, grid=(30, 24), keep=tmp_path / "kept")
    assert len(calls) == 10 + 5  # only what was missing
    assert again.complete
    assert np.array_equal(again.labels, found.labels)
    assert np.array_equal(again.settling, found.settling)
    assert [one.name for one in again.attractors] == [one.name for one in found.attractors]
    with pytest.raises(InputError, match="other basins"):
        so.basins(DUFFING, omega=1.51, box=BOX, grid=(30, 24), keep=tmp_path / "kept")


def test_chaos_and_escape_are_told():
    chaotic = so.library.reference_oscillator(p=1.6, Kc=4.2, j=0.0)
    told = so.basins(chaotic, omega=2.6, box=((-0.5, 0.5), (-0.5, 0.5)), grid=(4, 4), periods=100)
    assert told.names == {-1: "aperiodic"}
    soft = so.System(1.0, 0.1, 1.0, elements=[so.CubicSpring(0, -1.0)], loads=[so.HarmonicLoad(0, amplitude=0.05)])
    told = so.basins(soft, omega=1.4, box=((-3.0, 3.0), (-1.0, 1.0)), grid=(13, 5))
    assert told.attractor_at(0.0, 0.0) is not None
    # beyond the unstable equilibrium at +-1, moving away
    assert told.labels[4, -1] == -2
    assert told.labels[0, 0] == -2


@pytest.mark.parametrize(
    ("system", "omega"),
    [(DUFFING, 1.5), pytest.param(so.library.reference_oscillator(p=0.55, j=0.5), 2.25, marks=pytest.mark.slow)],
)
def test_what_is_inside_a_neighbourhood_ends_on_its_motion(system, omega):
    """Other states than those that were looked at when it was made, half of them on its boundary, to the end."""
    found = so.basins(system, omega=omega, box=BOX, grid=(16, 16))
    assert len(found.attractors) >= 2
    random = np.random.default_rng(11)
    for one in found.attractors:
        assert one.traps
        for trap in one.traps:
            away = random.normal(size=(400, 2))
            away /= np.linalg.norm(away, axis=1, keepdims=True)
            away[::2] *= np.sqrt(random.uniform(size=(200, 1)))
            back = np.linalg.inv(trap.factor).T
            states = trap.point + trap.radius * away @ back
            end = Flow(system, tolerance=1e-8).over(states, omega, 120 * one.period).end
            assert np.abs(end - trap.point).max() < 0.3 * np.abs(states - trap.point).max()
            nearest = np.min(np.abs(end[:, None] - one.points[None]).max(axis=2), axis=1)
            assert nearest.max() < 1e-2
            flow = Flow(system, tolerance=1e-8, tangents=2, transition=True)
            periods = trap.times * one.period
            tangents = flow.over(states, omega, periods, skip=periods).tangents
            assert np.linalg.norm(trap.factor @ tangents @ back.T, 2, axis=(1, 2)).max() < 1.0


def test_a_journal_of_other_attractors_is_refused(tmp_path, found):
    """Names and motions of `attractors=` are part of the question; the same ones from another run are the same."""
    large, small = sorted(found.attractors, key=lambda one: -one.amplitude)
    options = {"omega": 1.5, "box": BOX, "grid": (8, 8), "keep": tmp_path / "kept"}
    first = so.basins(DUFFING, attractors={"large": shoot(DUFFING, large.state, 1.5)}, **options)
    for given, said in (
        (None, "attractors=large, not none"),
        ({"big": shoot(DUFFING, large.state, 1.5)}, "attractors=large, not big"),
        ({"large": shoot(DUFFING, small.state, 1.5)}, "with other motions as attractors=large"),
        ([shoot(DUFFING, large.state, 1.5)], "attractors=large, not PeriodicSolution"),
    ):
        with pytest.raises(InputError, match=said):
            so.basins(DUFFING, attractors=given, **options)
    curve = so.frequency_response(DUFFING, omega=(3.0, 0.5))
    with pytest.raises(InputError, match="name another file"):
        so.basins(DUFFING, attractors={"large": curve}, **options)
    nearly = shoot(DUFFING, large.state * (1.0 + 1e-4), 1.5)
    again = so.basins(DUFFING, attractors={"large": nearly}, **options)
    assert (again.labels == first.labels).all()
    assert [one.name for one in again.attractors] == [one.name for one in first.attractors]


def test_mistakes():
    for options, said in (
        ({"plane": ("x_0", "v_1")}, "v_0"),
        ({"plane": (0, 0)}, "twice"),
        ({"grid": 5}, "grid"),
        ({"box": (-1.0, 1.0)}, "box"),
        ({"attractors": 3}, "attractors"),
        ({"attractors": [shoot(DUFFING, [-0.2, 0.0], 1.4)]}, "omega=1.4"),
        ({"parameters": {"alpa": 1.0}}, "alpha"),
    ):
        with pytest.raises(InputError, match=said):
            so.basins(DUFFING, **{"omega": 1.5, "box": BOX, **options})


@pytest.mark.slow
def test_published_case():
    """Shares of 200 x 200 states by Newmark's method and long integration, in a program of its own."""
    system = so.library.reference_oscillator(p=0.55, Kc=4.7, j=0.5, regularization=3000.0)
    found = so.basins(system, omega=2.25, box=BOX)
    shares = {round(one.amplitude, 5): found.shares[one.name] for one in found.attractors}
    assert shares == pytest.approx({0.13544: 0.814, 0.88906: 0.1745, 3.09017: 0.0117}, abs=0.002)
    assert found.contradicted == 0
