"""Branch points and limit points told apart: pitchforks met from either branch, and those an imperfection undoes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from slow import slow

import suboctave as so
from suboctave.bifurcation.bordered import null_vectors, transversality
from suboctave.curves.events.monitors import LimitPoint
from suboctave.errors import ConvergenceError
from suboctave.harmonic.perturbation import Kind
from suboctave.timedomain import locate_by_shooting


def oscillator(stiffness, damping, force, *elements):
    loads = [so.HarmonicLoad(dof=0, amplitude=force), so.StaticLoad(dof=0, force="e")]
    return so.System(1.0, damping, stiffness, elements=list(elements), loads=loads, parameters={"e": 0.0})


def stops(**law):
    return [so.ElasticStop(dof=0, stiffness=20.0, gap=gap, **law) for gap in (1.0, -1.0)]


def cubic(e=0.0):
    system = oscillator(0.0, 0.2, 7.5, so.CubicSpring(dof=0, coefficient=1.0))
    return system.with_parameters(e=e)


def two_masses():
    return so.System(
        mass=[[1.0, 0.0], [0.0, 0.5]],
        damping=[[0.2, -0.1], [-0.1, 0.1]],
        stiffness=[[1.5, -0.5], [-0.5, 0.5]],
        elements=[so.CubicSpring(dof=0, coefficient=1.0), so.CubicSpring(dof=(1, 0), coefficient=2.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude=8.0)],
    )


#: symmetric systems, ranges in which their motions lose the symmetry, and where the finest steps find the branch point
#: from which the unsymmetric motions are followed
SYMMETRIC = {
    "cubic": (cubic, (2.5, 0.6), 0.8047),
    "exact stops": (lambda: oscillator(1.0, 0.1, 6.0, *stops()), (2.0, 1.5), 1.702),
    "rounded stops": (lambda: oscillator(1.0, 0.1, 6.0, *stops(regularization=100.0)), (2.0, 1.5), 1.6967),
    "arctan": (lambda: oscillator(0.2, 0.1, 6.0, so.Expression(0, "10*(x - atan(x))")), (2.0, 0.5), 0.7311),
    "two masses": (two_masses, (2.5, 1.5), 2.185),
}


def shot(system, item):
    """The same by shooting, closer than any of these tests needs it."""
    start = item.orbit.start()
    return locate_by_shooting(system, item.kind, start, item.omega, rtol=1e-10, tol=1e-9).omega


def branch_point(system, omega, near):
    """The one of the symmetric motions, confirmed by shooting."""
    curve = so.frequency_response(system, omega)
    item = min(curve.bifurcations["BP"], key=lambda b: abs(b.omega - near))
    assert item.omega == pytest.approx(shot(system, item), abs=1e-6)
    return item


def unsymmetric(item, away=0.05):
    """A motion of the branch that leaves, where omega has gone some way (as a share of it) from the branch point."""
    half = so.switch_branch(item, side=1)
    return next(orbit for orbit in half.orbits if abs(orbit.omega / item.omega - 1.0) > away)


def kinds(curve):
    return [item.kind for item in curve.bifurcations if item.kind in ("LP", "BP")]


@cache
def pitchfork(name):
    """A system's branch point, and a motion of the branch that leaves there."""
    make, omega, near = SYMMETRIC[name]
    item = branch_point(make(), omega, near)
    return item, unsymmetric(item, 0.01)


@pytest.mark.parametrize("max_step", [0.3, *slow(0.06, 0.02)])
@pytest.mark.parametrize("name", SYMMETRIC)
def test_a_pitchfork_is_one_branch_point_from_the_unsymmetric_motions(name, max_step):
    """They turn back exactly there and go on as their own mirror images: one BP, and no limit point."""
    item, orbit = pitchfork(name)
    system = orbit.system
    ends = (orbit.omega, item.omega - 0.5 * (orbit.omega - item.omega))
    there = so.frequency_response(system, ends, start=orbit, max_step=max_step)
    back = so.frequency_response(system, ends, start=there.orbits[-1], max_step=max_step)
    for curve in (there, back):
        assert kinds(curve) == ["BP"]
        assert curve.bifurcations["BP"][0].omega == pytest.approx(item.omega, abs=3e-7)
        assert curve.omega[-1] == pytest.approx(orbit.omega)
        assert curve.audit.complete


@pytest.mark.parametrize("max_step", [0.06, 0.3, *slow(0.02, 0.04, 0.08, 0.15)])
def test_a_pitchfork_at_any_step(max_step):
    """From an unsymmetric motion: which of those at omega = 0.9 a first guess leads to hangs on its last digit."""
    make, omega, near = SYMMETRIC["cubic"]
    start = unsymmetric(branch_point(make(), omega, near), 0.1)
    curve = so.frequency_response(make(), (start.omega, 0.75), max_step=max_step, start=start)
    assert [item.kind for item in curve.bifurcations] == ["PD", "BP", "PD"]
    assert curve.bifurcations["BP"][0].omega == pytest.approx(0.8047271, abs=1e-7)
    assert curve.audit.complete


def test_limit_points_and_branch_points_of_the_symmetric_motions():
    """Transversality tells them apart by many orders; all are there in both directions, whatever the steps."""
    system = cubic()
    finest = so.frequency_response(system, (2.5, 0.6), max_step=0.02)
    expected = sorted((item.kind, item.omega) for item in finest.bifurcations)
    assert kinds(finest) == ["BP", "BP", "LP", "LP", "BP"]
    for item in finest.bifurcations:
        vectors = null_vectors(item.orbit.state(), Kind.INTEGER)
        across = transversality(item.orbit.state(), vectors, "omega")
        assert across < 1e-12 if item.kind == "BP" else across > 0.1
    for max_step in (0.06, 0.3):
        for start in (None, finest.orbits[-1]):
            ends = (2.5, 0.6) if start is None else (0.6, 2.5)
            curve = so.frequency_response(system, ends, start=start, max_step=max_step)
            found = sorted((item.kind, item.omega) for item in curve.bifurcations)
            assert [kind for kind, _ in found] == [kind for kind, _ in expected]
            np.testing.assert_allclose([w for _, w in found], [w for _, w in expected], atol=1e-7)


def test_an_imperfect_pitchfork_is_a_limit_point_beside_a_smooth_curve():
    """A static load e parts the branches: R = e + (w - w0) s - s^3 has a limit point at w - w0 ~ e^(2/3)."""
    item = branch_point(cubic(), (2.5, 0.6), 0.8047)
    orbit = unsymmetric(item)
    mirrored = so.frequency_response(cubic(), (orbit.omega, 0.78), start=orbit).orbits[-1]
    distances = []
    for share in (1e-6, 1e-8):
        system = cubic(7.5 * share)
        curves = [so.frequency_response(system, (orbit.omega, 0.78), start=s.coefficients) for s in (orbit, mirrored)]
        turning = next(curve for curve in curves if curve.omega[-1] > 0.8)
        smooth = next(curve for curve in curves if curve.omega[-1] < 0.8)
        assert kinds(smooth) == []
        assert kinds(turning) == ["LP"]
        fold = turning.bifurcations["LP"][0]
        if share > 1e-7:
            assert fold.omega == pytest.approx(shot(system, fold), abs=1e-7)
        distances.append(fold.omega - item.omega)
    slopes = np.diff(np.log(distances)) / np.log(1e-2)
    assert slopes == pytest.approx(2.0 / 3.0, abs=0.01)


def test_a_fold_that_cannot_be_solved_is_in_doubt_and_not_in_the_list(monkeypatch):
    """A sign change of the slope alone is no limit point: one stretch, at its place, and one sentence."""
    system = so.library.duffing(c=0.1, F=0.3)
    fold = so.frequency_response(system, (1.6, 0.9)).bifurcations["LP"][0]

    def refuse(self, guess):
        raise ConvergenceError("refused by the test")

    monkeypatch.setattr(LimitPoint, "solve", refuse)
    curve = so.frequency_response(system, (1.6, 0.9))
    assert not len(curve.bifurcations)
    (stretch,) = curve.audit.unsettled
    assert "limit point" in stretch.reason
    assert fold.omega - 1e-9 <= min(stretch.first, stretch.last)
    assert abs(stretch.first - fold.omega) < 0.01
    assert sum(stretch.reason in note for note in curve.warnings) == 1
    assert not any("LP" in note for note in curve.warnings)


def test_a_curve_of_pitchforks_has_its_points_of_codimension_two():
    """Rest under a parametric load: with no damping at mu = 0 the multiplier +1 is double. Written with half the
    frequency the same points are period doublings.
    """
    equation = "x'' - (mu - x**2)*x' + (1 + q*cos({}*omega*t))*x + 0.5*x**3 = 0"
    borders = []
    for factor, kind, omega in ((2, "BP", (0.7, 1.4)), (1, "PD", (1.4, 2.8))):
        system = so.System.from_equations(equation.format(factor), {"q": 0.5, "mu": -0.1})
        start = so.frequency_response(system, omega).bifurcations[kind][0]
        borders.append(so.track(start, "mu", (-0.4, 0.4)))
    pitchforks, doublings = borders
    resonances = pitchforks.bifurcations["R1"]
    assert sorted(item.omega for item in resonances) == pytest.approx([0.87217941, 1.12074371], abs=1e-7)
    assert max(abs(item.parameter("mu")) for item in resonances) < 1e-9
    found, known = (
        sorted((item.parameter("mu"), factor * item.omega) for item in border.bifurcations[kind])
        for border, kind, factor in ((pitchforks, "GPF", 2.0), (doublings, "GPD", 1.0))
    )
    assert len(found) == 2
    assert np.array(found) == pytest.approx(np.array(known), abs=1e-7)
    torus = so.track(resonances[0], "mu", (-0.4, 0.4))
    assert torus.kind == "NS"
