"""Every kind of bifurcation in two parameters, against closed forms, shooting, and each other."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from scipy.optimize import fsolve

import suboctave as so
from suboctave.analysis.options import settings_of
from suboctave.continuation import NewtonOptions, SteppingOptions
from suboctave.continuation.march import March, Place
from suboctave.continuation.point import point_between
from suboctave.curves.tracked import watch
from suboctave.curves.tracked.start import solved_start
from suboctave.timedomain import locate_by_shooting, state_transition


@pytest.fixture(scope="module")
def duffing_limits():
    """Limit points of a weakly damped Duffing oscillator with one harmonic."""
    return so.frequency_response(so.library.duffing(c=0.05, alpha=1.0, F=0.1), (0.7, 2.0), harmonics=1)


def test_limit_points_of_duffing_in_closed_form(duffing_limits):
    """`F^2 = A^2 ((1 - w^2 + 3 A^2 / 4)^2 + (c w)^2)` turns where its derivative by A^2 is zero."""
    curve = so.track(duffing_limits.bifurcations["LP"][0], "F", (0.01, 0.3))
    a, w, c = np.abs(curve.harmonic(1)), curve.omega, 0.05
    stiff = 1.0 - w**2 + 0.75 * a**2
    assert a * np.sqrt(stiff**2 + (c * w) ** 2) == pytest.approx(curve.parameter("F"), rel=1e-9)
    assert stiff**2 + (c * w) ** 2 + 1.5 * a**2 * stiff == pytest.approx(0.0, abs=1e-8)


def cusp_of_duffing(c: float, alpha: float) -> tuple[float, float, float]:
    """(omega, F, A) where the first two derivatives of F^2 by A^2 vanish."""

    def equations(u):
        w, square = u
        stiff = 1.0 - w**2 + 0.75 * alpha * square
        damped = stiff**2 + (c * w) ** 2
        return [
            damped + 1.5 * alpha * square * stiff,
            3.0 * alpha * stiff + 1.125 * alpha**2 * square,
        ]

    # weak damping: F_c^2 = 32 / (9 sqrt 3) c^3 / alpha near omega = 1
    w, square = fsolve(
        equations, [1.0 + 0.5 * math.sqrt(3.0) * c, 8.0 * c / (3.0 * math.sqrt(3.0) * alpha)], xtol=1e-13
    )
    stiff = 1.0 - w**2 + 0.75 * alpha * square
    return w, math.sqrt(square * (stiff**2 + (c * w) ** 2)), math.sqrt(square)


@pytest.mark.parametrize("max_step", [None, 0.1])
def test_cusp_of_duffing(duffing_limits, max_step):
    curve = so.track(duffing_limits.bifurcations["LP"][1], "F", (0.001, 0.1), max_step=max_step)
    (cusp,) = curve.bifurcations
    omega, force, amplitude = cusp_of_duffing(0.05, 1.0)
    assert cusp.kind == "CP"  # both parameters turn there, which makes no extremum of either
    assert not curve.extrema
    assert (cusp.omega, cusp.parameter("F")) == pytest.approx((omega, force), rel=1e-8)
    assert cusp.amplitude == pytest.approx(amplitude, rel=1e-6)
    assert curve.parameter("F").min() == pytest.approx(force, rel=0.1)


@pytest.mark.parametrize("c", [0.02, 0.002])
def test_cusp_at_weak_damping(c):
    """The leading term of the closed form; what is left is of the order of the damping."""
    force = math.sqrt(32.0 / (9.0 * math.sqrt(3.0)) * c**3)
    system = so.library.duffing(c=c, alpha=1.0, F=3.0 * force)
    limits = so.frequency_response(system, (0.95, 1.0 + 20.0 * c), harmonics=1).bifurcations["LP"]
    (cusp,) = so.track(limits[0], "F", (0.5 * force, 3.0 * force)).bifurcations["CP"]
    assert cusp.parameter("F") == pytest.approx(force, rel=1.4 * c)


def test_a_closed_curve_of_limit_points_with_two_cusps():
    """The load `F0 (1 - q^2)` has two limit points for |q| below a bound, which meet at cusps on either side."""
    c, most = 0.05, 0.1
    system = so.System(
        mass=1.0,
        damping=c,
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient=1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F0*(1 - q**2)")],
        parameters={"q": 0.0, "F0": most},
    )
    limits = so.frequency_response(system, (0.7, 2.0), harmonics=1).bifurcations["LP"]
    omega, force, _ = cusp_of_duffing(c, 1.0)
    edge = math.sqrt(1.0 - force / most)
    for start in limits:
        curve = so.track(start, "q", (-1.0, 1.0))
        assert curve.closed
        assert [e.kind for e in curve.bifurcations].count("CP") == 2
        assert sorted(e.parameter("q") for e in curve.bifurcations["CP"]) == pytest.approx([-edge, edge], rel=1e-7)
        assert [e.omega for e in curve.bifurcations["CP"]] == pytest.approx([omega] * 2, rel=1e-8)
        # at q = 0 the load is largest: omega turns at both limit points, one of them the start
        assert sorted(e.omega for e in curve.extrema) == pytest.approx(sorted(b.omega for b in limits), rel=1e-8)
        assert curve.omega[0] == curve.omega[-1]


def test_the_tongue_of_a_varying_stiffness():
    """Rest loses its stability with a multiplier -1 of the linear equation, at no amplitude."""
    system = so.library.mathieu_duffing(c=0.05)
    curve = so.frequency_response(system, (1.7, 2.3))
    tongue = so.track(curve.bifurcations["PD"][0], "eps", (0.05, 0.6))
    (tip,) = tongue.extrema
    assert tip.remark() == "minimum of eps"
    assert tip.parameter("eps") == pytest.approx(0.1, rel=1e-3)  # 2 c / sqrt(k m), weak damping
    assert tongue.parameter("eps")[[0, -1]] == pytest.approx([0.6, 0.6])
    for i in range(0, len(tongue), 6):
        orbit = tongue.orbits[i]
        period = 2.0 * math.pi / orbit.omega
        _, transition = state_transition(system, np.zeros(2), (0.0, period), orbit.omega, orbit.values)
        assert np.abs(np.linalg.eigvals(transition) + 1.0).min() < 1e-6
    assert np.all(tongue.amplitude == 0.0)


def test_grazing_of_a_linear_oscillator(monkeypatch):
    """An open stop is touched where the linear amplitude equals its gap: the contact that grazes all along is none that
    begins or ceases within steps, which are not cut because of it.
    """
    cuts = []

    def counted(*arguments):
        cuts.append(arguments)
        return point_between(*arguments)

    monkeypatch.setattr(watch, "point_between", counted)
    c = 0.1
    system = so.System(
        mass=1.0,
        damping=c,
        stiffness=1.0,
        elements=[so.ElasticStop(dof=0, stiffness=10.0, gap="gap", side="right")],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"gap": 1.0, "F": 0.5},
    )
    touch = so.frequency_response(system, (0.4, 0.95)).grazings[0]
    curve = so.track(touch, "gap", (0.6, 6.0))
    assert len(cuts) < len(curve) / 4
    linear = 0.5 / np.hypot(1.0 - curve.omega**2, c * curve.omega)
    assert linear == pytest.approx(curve.parameter("gap"), rel=1e-8)
    (peak,) = (e for e in curve.extrema if e.parameter_name == "gap")
    assert (peak.omega, peak.parameter("gap")) == pytest.approx(
        (math.sqrt(1.0 - c**2 / 2.0), 0.5 / (c * math.sqrt(1.0 - c**2 / 4.0))), rel=1e-8
    )
    # two parameters at the same frequency: the gap grows with the load
    line = so.track(touch, ("F", "gap"), ((0.2, 1.0), (0.0, 10.0)))
    assert line.parameter("gap") / line.parameter("F") == pytest.approx(2.0, rel=1e-8)
    assert set(line.omega) == {touch.omega}
    assert line.parameter("F")[[0, -1]] == pytest.approx([0.2, 1.0])


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_an_instant_is_compared_on_the_circle(turns):
    """A curve of grazings of 2T motions, begun a load period later: the same curve, whatever the instant is called."""
    response = so.frequency_response(so.library.reference_oscillator(p=0.55), (4.5, 1.3), harmonics=9)
    touch = so.switch_branch(response.bifurcations["PD"][0]).grazings[0]
    system, newton = touch.orbit.system, NewtonOptions()
    bounds = (0.3, 0.8)
    settings = settings_of(system, {"observe": 0})
    start = solved_start(touch, touch.orbit.basis, None, ("omega", "p"), {"p": bounds}, settings)
    before, here, behind = islice(March(start, 1.0, bounds, newton, SteppingOptions()), 2, 5)

    def later(point):
        curve, weights = here.curve, here.weights
        u = curve.images(point.u)[1]
        along = curve.images(point.u + point.tangent)[1] - u
        u[curve.balance.dimension] += turns * 2.0 * math.pi
        return replace(point, u=u, tangent=along, weights=weights)

    passed = Place(here).passed(later(before), later(behind))
    assert passed is not None
    assert passed.parameter == here.parameter
    assert Place(here).passed(later(behind), later(before)) is None


@pytest.fixture(scope="module")
def pitchfork():
    """A symmetric Duffing oscillator with a static load q that breaks the symmetry, at q = 0."""
    system = so.System(
        mass=1.0,
        damping="c",
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient=1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F"), so.StaticLoad(dof=0, force="q")],
        parameters={"c": 0.1, "F": 6.0, "q": 0.0},
    )
    return so.frequency_response(system, (1.5, 1.2)).bifurcations["BP"][0]


def test_branch_points_where_a_symmetry_forces_them(pitchfork):
    curve = so.track(pitchfork, "F", (2.0, 10.0))
    assert curve.parameter("F")[[0, -1]] == pytest.approx([2.0, 10.0])
    assert np.abs(curve.harmonic(0)).max() < 1e-9
    assert np.abs(curve.harmonic(2)).max() < 1e-9
    orbit = curve.orbits[-1]
    witness = locate_by_shooting(orbit.system, "BP", orbit.start(), orbit.omega * (1.0 + 1e-5))
    assert curve.omega[-1] == pytest.approx(witness.omega, abs=1e-6)


def test_extrema_that_a_long_step_holds_two_of(pitchfork):
    expected = so.track(pitchfork, "F", (1.0, 15.0), max_step=0.03).extrema
    assert len(expected) == 4
    found = so.track(pitchfork, "F", (1.0, 15.0), max_step=0.5).extrema
    assert [e.remark() for e in found] == [e.remark() for e in expected]
    for a, b in zip(found, expected, strict=True):
        assert (a.omega, a.parameter("F")) == pytest.approx((b.omega, b.parameter("F")), abs=1e-5)


def test_branch_points_end_where_the_symmetry_does(pitchfork):
    curve = so.track(pitchfork, "q", (-0.1, 0.1))
    assert len(curve) == 1
    assert "symmetry that forces them is broken" in curve.ended


@pytest.fixture(scope="module")
def absorber():
    return so.frequency_response(so.library.nltva(F=0.16), (0.9, 1.5), harmonics=7).bifurcations


def test_limit_points_and_tori_of_an_absorber_meet_in_a_resonance(absorber):
    """Detroux et al. 2015: an isola is born and merges; the NS curve ends on the LP curve, +1 being double there."""
    limits = so.track(absorber["LP"][2], "F", (0.05, 0.2), omega=(1.0, 2.5))
    tori = so.track(absorber["NS"][0], "F", (0.05, 0.2))
    turns = {e.remark(): (e.omega, e.parameter("F")) for e in limits.extrema}
    assert turns["minimum of F; isola centre"] == pytest.approx((1.80265, 0.12466), abs=1e-5)
    assert turns["maximum of F; isola merging"] == pytest.approx((1.44059, 0.18562), abs=1e-5)
    (end,) = tori.bifurcations["R1"]
    on_limits = min(limits.bifurcations["R1"], key=lambda e: abs(e.omega - end.omega))
    assert (end.omega, end.parameter("F")) == pytest.approx((on_limits.omega, on_limits.parameter("F")), abs=1e-7)
    assert np.sort(np.abs(end.multipliers - 1.0))[1] < 0.02  # a double one moves like the root of every error
    assert "1:1 resonance" in tori.ended
    # kappa goes to zero, at the last point, like the root of the distance
    way = slice(1, 3) if tori.kappa[0] < tori.kappa[-1] else slice(-2, -4, -1)
    assert tori.kappa.min() == 0.0
    near, further = tori.kappa[way] ** 2
    forces = tori.parameter("F")[way]
    assert forces[0] - near * (forces[1] - forces[0]) / (further - near) == pytest.approx(end.parameter("F"), rel=2e-3)
    (cusp,) = limits.bifurcations["CP"]
    assert cusp.parameter("F") < 0.1


def test_tori_by_shooting(absorber):
    tori = so.track(absorber["NS"][0], "F", (0.11, 0.16), harmonics=9)
    end = min((0, -1), key=lambda i: tori.parameter("F")[i])
    orbit = tori.orbits[end]
    assert orbit.values["F"] == pytest.approx(0.11) or "F" in tori.ended
    witness = locate_by_shooting(orbit.system, "NS", orbit.start(), orbit.omega * (1.0 + 1e-5))
    assert orbit.omega == pytest.approx(witness.omega, abs=1e-6)


@pytest.mark.parametrize(
    ("harmonics", "tolerance"), [(15, None), pytest.param("adaptive", 1e-3, marks=pytest.mark.slow)]
)
def test_fold_flips_from_both_curves_through_them(harmonics, tolerance):
    curve = so.frequency_response(so.library.two_mass_unilateral(), (0.6, 0.8), harmonics=harmonics).bifurcations
    folds = so.track(curve["LP"][0], "F", (0.07, 0.12))
    flips = so.track(curve["PD"][1], "F", (0.06, 0.12), max_step=0.2)
    (a,), (b,) = folds.bifurcations["LPPD"], flips.bifurcations["LPPD"]
    assert (a.omega, a.parameter("F")) == pytest.approx((b.omega, b.parameter("F")), abs=1e-8)
    assert a.orbit.coefficients[:5] == pytest.approx(b.orbit.coefficients[:5], abs=1e-7)
    if tolerance is not None:
        assert a.critical_multiplier().real == pytest.approx(1.0, abs=tolerance)
        assert b.critical_multiplier().real == pytest.approx(-1.0, abs=tolerance)


def test_strong_resonances_of_two_masses():
    curve = so.frequency_response(so.library.two_mass_unilateral(), (0.6, 0.65), harmonics=31).bifurcations
    tori = so.track(curve["NS"][0], "F", (0.05, 0.25))
    for order in (3, 4):
        (found,) = tori.bifurcations[f"R{order}"]
        assert found.kappa == pytest.approx(found.omega / order, rel=1e-9)
        assert found.critical_multiplier() == pytest.approx(np.exp(2j * np.pi / order), abs=5e-3)
    (end,) = tori.bifurcations["R2"]
    assert "1:2 resonance" in tori.ended
    assert np.sort(np.abs(end.multipliers + 1.0))[1] < 0.1  # a double one moves like the root of every error
