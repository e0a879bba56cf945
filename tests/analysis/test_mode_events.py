"""Events of nonlinear modes in a second parameter: located again on modes computed there, and by quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import suboctave as so
from suboctave.curves.kinds.free_phase import FreePhaseOperator
from suboctave.curves.kinds.mode_event import ModeEvent
from suboctave.curves.tracked.start import curve_through
from suboctave.results.modes import ModeCurve
from suboctave.study.file import read_study
from suboctave.study.runner import run_study

TIGHT = {
    "harmonics": so.AdaptiveHarmonics(tolerance=1e-11, event_tolerance=1e-11),
    "newton": so.NewtonOptions(tolerance=1e-12),
}


def coupled(k=1.0, damping=0.0):
    """Two masses on unit springs, one of them hardening, k between them: natural frequencies 1, sqrt(1 + 2k)."""
    coupling, loss = [["1 + k", "-k"], ["-k", "1 + k"]], damping * np.array([[2.0, -1.0], [-1.0, 2.0]])
    return so.System(np.eye(2), loss, coupling, elements=[so.CubicSpring(0, 0.5)], parameters={"k": k})


def softening(a=0.5, damping=0.0):
    equation = f"m*x'' + {damping}*x' + x - a*x**3 + 0.1*x**5 = 0"
    return so.System.from_equations(equation, {"a": a, "m": 1.0})


@pytest.fixture(scope="module")
def mode():
    return so.nonlinear_mode(coupled(), mode=1, amplitude=(1.0, 5.0), **TIGHT)


@pytest.fixture(scope="module")
def tongue(mode):
    return so.switch_branch(mode.bifurcations["BP"][0])


@pytest.fixture(scope="module")
def crossings(mode):
    return so.track(mode.bifurcations["BP"][0], "k", (0.9, 2.5), omega=(1.02, 2.0), **TIGHT)


def test_the_equations_by_differences(mode, tongue):
    rng = np.random.default_rng(3)
    turn = so.nonlinear_mode(softening(damping=0.02), amplitude=(0.1, 2.5)).bifurcations["extremum"][0]
    crossing, limit = mode.bifurcations["BP"][0], tongue.bifurcations["LP"][0]
    shaken = ["m*x'' + x + 2*x*y + 0.3*x**3 = 0", "y'' + c*y + x**2 + 0.5*y**3 = 0"]
    system = so.System.from_equations(shaken, {"c": 4.2, "m": 1.0})
    doubling = so.nonlinear_mode(system, mode=2, amplitude=0.1, observe=1).bifurcations["PD"][0]
    cases = ((crossing, "k"), (limit, "k"), (turn, "a"), (turn, "m"), (doubling, "c"), (doubling, "m"))
    for item, name in cases:
        curve, u = curve_through(item, so.HarmonicBasis(5), ("omega", name))
        assert isinstance(curve.augmentation, ModeEvent | FreePhaseOperator)
        u = u + 1e-3 * rng.normal(size=len(u))
        columns = []
        for i in range(len(u)):
            step = 1e-6 * np.eye(1, len(u), i)[0]
            columns.append((curve.evaluate(u + step).residual - curve.evaluate(u - step).residual) / 2e-6)
        exact = curve.evaluate(u).jacobian
        np.testing.assert_allclose(exact, np.array(columns).T, atol=1e-7 * np.abs(exact).max())


def test_branch_points_are_those_of_the_modes_there(crossings):
    for i in (2, len(crossings) // 3, len(crossings) // 2):
        k, size = crossings.parameter("k")[i], crossings.amplitude[i]
        there = so.nonlinear_mode(coupled(k), mode=1, amplitude=(0.5 * size, 1.5 * size), **TIGHT)
        found = min(there.bifurcations["BP"], key=lambda b: abs(b.omega - crossings.omega[i]))
        assert crossings.omega[i] == pytest.approx(found.omega, rel=1e-8)
        assert size == pytest.approx(found.amplitude, rel=1e-7)


def test_the_stiffness_that_makes_the_internal_resonance_vanish(crossings):
    """From rest where the upper frequency is twice the lower one, to a largest k, and back."""
    assert isinstance(crossings, ModeCurve)
    assert crossings.kind == "BP"
    # towards rest k runs as the square of the amplitude
    least = np.argsort(crossings.amplitude)[:2]
    line = np.polyfit(crossings.amplitude[least] ** 2, crossings.parameter("k")[least], 1)
    assert line[1] == pytest.approx(1.5, abs=5e-3)
    (last,) = (e for e in crossings.extrema if e.parameter_name == "k")
    assert last.extreme == "maximum"
    # the tongue's other edge crosses at a smaller amplitude
    counts = []
    for share in (0.999, 1.001):
        there = so.nonlinear_mode(coupled(share * last.parameter("k")), mode=1, amplitude=(1.4, 2.4))
        counts.append(len(there.bifurcations["BP"]))
    assert counts == [2, 0]
    assert np.abs(crossings.damping_ratio).max() < 1e-9


def test_limit_points_are_those_of_the_tongues_there(tongue):
    turns = so.track(tongue.bifurcations["LP"][0], "k", (0.9, 1.1), **TIGHT)
    assert turns.kind == "LP"
    assert turns.plane == ("omega", "k")
    for i in (0, len(turns) // 2, -1):
        # beside the two that are +1 by themselves two more
        assert np.abs(turns.points[i].floquet.multipliers - 1.0).max() < 2e-2
    for i in (0, len(turns) // 3, -1):
        there = so.nonlinear_mode(coupled(turns.parameter("k")[i]), mode=1, amplitude=(2.0, 5.0), **TIGHT)
        found = so.switch_branch(there.bifurcations["BP"][0]).bifurcations["LP"]
        assert min(abs(b.omega / turns.omega[i] - 1.0) for b in found) < 1e-8


def least_frequency(a):
    """Of x'' + x - a x^3 + 0.1 x^5 = 0 over the amplitude: x = A sin t makes the period an integral without corners."""

    def slope(size):
        return (frequency(size + 1e-4) - frequency(size - 1e-4)) / 2e-4

    def frequency(size):
        # 2 (V(A) - V(x)) / (A^2 - x^2)
        def speed(t):
            x, s = (size * np.sin(t)) ** 2, size**2
            return np.sqrt(1.0 - 0.5 * a * (s + x) + (s**2 + s * x + x**2) / 30.0)

        return 2.0 * np.pi / (4.0 * quad(lambda t: 1.0 / speed(t), 0.0, 0.5 * np.pi, epsabs=1e-13, epsrel=1e-13)[0])

    return frequency(brentq(slope, 0.7 * np.sqrt(6.0 * a), 1.3 * np.sqrt(6.0 * a), xtol=1e-9))


def test_extrema_of_omega_by_quadrature(tmp_path):
    (turn,) = so.nonlinear_mode(softening(), amplitude=(0.1, 2.5), **TIGHT).bifurcations["extremum"]
    curve = so.track(turn, "a", (0.45, 0.55), **TIGHT)
    assert (curve.turning, curve.plane) == ("omega", ("a", "omega"))
    for i in range(0, len(curve), max(1, len(curve) // 4)):
        assert curve.omega[i] == pytest.approx(least_frequency(curve.parameter("a")[i]), rel=1e-8)
    curve.save(tmp_path / "turns.nc")
    again = so.load(tmp_path / "turns.nc")
    assert type(again) is ModeCurve
    assert repr(again) == repr(curve)
    so.plot(curve, tmp_path / "turns.png")


def test_extrema_of_omega_of_a_damped_mode():
    (turn,) = so.nonlinear_mode(softening(damping=0.05), amplitude=(0.1, 2.5), **TIGHT).bifurcations["extremum"]
    curve = so.track(turn, "a", (0.45, 0.55), **TIGHT)
    for i in (0, -1):
        there = so.nonlinear_mode(softening(curve.parameter("a")[i], 0.05), amplitude=(0.1, 2.5), **TIGHT)
        assert curve.omega[i] == pytest.approx(there.bifurcations["extremum"][0].omega, rel=1e-8)
    assert curve.damping_ratio == pytest.approx(0.025 / curve.omega, rel=0.1)


def test_against_shooting(crossings):
    check = so.verify(crossings, points=3, bifurcations=False)
    assert all(point.agrees for point in check.points), check


def test_as_a_step(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        """
[system]
equations = ["x'' + (1+k)*x - k*y + 0.5*x**3 = 0", "y'' + (1+k)*y - k*x = 0"]
parameters = { k = 1.0 }

[[analyses]]
name = "mode"
type = "nonlinear_mode"
amplitude = 3.0

[[analyses]]
name = "resonances"
type = "track"
start = { analysis = "mode", bifurcation = "BP" }
parameter = "k"
bounds = [0.8, 1.2]
""",
        encoding="utf-8",
    )
    mode, curve = (step.result for step in run_study(read_study(path)).finished)
    again = so.track(mode.bifurcations["BP"][0], "k", (0.8, 1.2))
    np.testing.assert_array_equal(curve.omega, again.omega)


def test_what_is_refused(crossings):
    (last,) = (e for e in crossings.extrema if e.parameter_name == "k")
    with pytest.raises(so.InputError, match="lies on a curve of events of nonlinear modes"):
        so.sensitivity(last)


def resonant(stiffness: float) -> so.System:
    """Two masses with a spring of all powers between them, the second `stiffness` times as stiff."""
    force = "0.5*(x-y)**3 - 0.3*(x-y)**2"
    return so.System.from_equations([f"x'' + x + 0.1*x**3 + {force} = 0", f"y'' + {stiffness}*y - ({force}) = 0"], {})


def test_a_mode_ends_where_it_meets_another_of_twice_its_frequency_and_goes_on_beyond():
    """Behind the meeting the same motions followed once more, half a period later, down to rest."""
    mode = so.nonlinear_mode(resonant(4.6), amplitude=3.0)
    assert [item.kind for item in mode.bifurcations] == ["extremum", "BP"]
    meeting = mode.bifurcations["BP"][0]
    assert "motions of half the period" in mode.ended
    assert np.abs(meeting.orbit.x[[1, 2, 5, 6]]).max() < 1e-9
    assert mode.points[-1].orbit.omega == pytest.approx(meeting.omega, abs=1e-12)
    assert so.verify(meeting).agrees
    assert np.abs(so.switch_branch(meeting, side=1).harmonic(1)).max() < 1e-6
    # the other mode has a second crossing, from which the first one goes on
    other = so.switch_branch(meeting)
    beyond = so.switch_branch(min(other.bifurcations["BP"], key=lambda item: item.omega))
    assert beyond.ended.startswith("reached the end of the range")
    assert beyond.omega.max() > 1.5


def test_where_a_contact_begins_to_touch_omega_of_a_mode_does_not_turn():
    stops = [so.ElasticStop(dof=0, stiffness=4.0, gap=0.26, side="right")]
    system = so.System(np.eye(2), np.zeros((2, 2)), [[2, -1], [-1, 2]], stops)
    for max_step in (None, 0.04, 0.03, 0.02):
        mode = so.nonlinear_mode(system, mode=2, amplitude=1.0, max_step=max_step)
        assert not mode.bifurcations["extremum"]
