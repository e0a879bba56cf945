"""Curves of phase resonance, against closed forms and an integration in time that knows nothing of the package."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import suboctave as so
from suboctave.curves.kinds.phase_resonance import PhaseResonance
from suboctave.errors import InputError
from suboctave.study.file import read_study
from suboctave.study.runner import run_study

C = 0.05


@pytest.fixture(scope="module")
def response():
    return so.frequency_response(so.library.duffing(c=C, alpha=1.0, F=0.1), (0.7, 2.0), harmonics=1)


@pytest.fixture(scope="module")
def backbone(response):
    return so.track(peak(response), "F", (0.01, 0.3), onto="phase_resonance")


def peak(branch, k=1):
    """The point where a harmonic is largest."""
    return branch.points[int(np.argmax(np.abs(branch.harmonic(k))))]


def test_the_backbone_of_duffing_in_closed_form(backbone):
    """With one harmonic `omega^2 = 1 + 3/4 A^2` and `F = c omega A`, from end to end of the range."""
    a, w, force = np.abs(backbone.harmonic(1)), backbone.omega, backbone.parameter("F")
    assert w**2 == pytest.approx(1.0 + 0.75 * a**2, rel=1e-9)
    assert force == pytest.approx(C * w * a, rel=1e-9)
    assert (force.min(), force.max()) == pytest.approx((0.01, 0.3), rel=1e-12)
    assert backbone.stable.all()


def by_shooting(right_side, start, omega, k, dof):
    """The motion of a system of SciPy whose harmonic k is in quadrature, with omega: states, omega."""

    def wanted(u):
        period = 2.0 * np.pi / u[-1]
        t = np.arange(512) * period / 512
        args = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12, "t_eval": [*t, period]}
        y = solve_ivp(lambda t, y: right_side(t, y, u[-1]), (0.0, period), u[:-1], **args).y
        return [*(y[:, -1] - u[:-1]), np.mean(y[dof, :-1] * np.cos(k * u[-1] * t))]

    found, _, code, message = fsolve(wanted, [*start, omega], xtol=1e-12, full_output=True)
    assert code == 1, message
    return found


@pytest.mark.parametrize(("k", "reach", "force"), [(1, (0.7, 3.0), 0.1), (3, (0.3, 0.6), 0.5)])
def test_duffing_by_shooting(k, reach, force):
    """The fundamental and the superharmonic resonance, of motions with many harmonics."""
    response = so.frequency_response(so.library.duffing(c=0.02, alpha=1.0, F=force), reach)
    onto = {"name": "phase_resonance", "harmonic": k}
    curve = so.track(peak(response, k), "F", (0.5 * force, 1.2 * force), onto=onto)
    for point in curve.points[:: len(curve) // 3]:
        orbit = point.orbit
        p = orbit.values["F"]
        found = by_shooting(
            lambda t, y, w, p=p: [y[1], -0.02 * y[1] - y[0] - y[0] ** 3 + p * np.cos(w * t)],
            orbit.start(),
            orbit.omega,
            k,
            0,
        )
        assert orbit.omega == pytest.approx(found[-1], rel=1e-6)
        assert orbit.start() == pytest.approx(found[:-1], abs=1e-4)


def two_masses():
    return so.System(
        np.eye(2),
        [[0.04, -0.02], [-0.02, 0.04]],
        [[2.0, -1.0], [-1.0, 2.0]],
        elements=[so.CubicSpring(dof=0, coefficient=0.5)],
        loads=[so.HarmonicLoad(dof=1, amplitude="F")],
        parameters={"F": 0.05},
    )


@pytest.fixture(scope="module")
def two_mass_backbone():
    response = so.frequency_response(two_masses(), (0.8, 1.3))
    return so.track(peak(response), "F", (0.005, 0.3), onto="phase_resonance")


def test_two_masses_by_shooting(two_mass_backbone):
    def right_side(t, y, w):
        x, v = y[:2], y[2:]
        forces = [-2.0 * x[0] + x[1] - 0.5 * x[0] ** 3, x[0] - 2.0 * x[1] + p * np.cos(w * t)]
        return [*v, *(np.array(forces) - [[0.04, -0.02], [-0.02, 0.04]] @ v)]

    observed = two_mass_backbone.observe
    assert observed == 1  # the loaded one
    for point in two_mass_backbone.points[10::40]:
        orbit = point.orbit
        p = orbit.values["F"]
        found = by_shooting(right_side, orbit.start(), orbit.omega, 1, observed)
        assert orbit.omega == pytest.approx(found[-1], rel=1e-6)
        assert orbit.start() == pytest.approx(found[:-1], abs=1e-4 * orbit.amplitude(observed))


def test_where_its_motions_bifurcate(two_mass_backbone):
    """A pitchfork of the motions; from there their stability changes. Its own curve goes through it."""
    (event,) = two_mass_backbone.bifurcations["BP"]
    assert event.critical_multiplier() == pytest.approx(1.0, abs=1e-3)
    changed = np.flatnonzero(np.diff(two_mass_backbone.stable))
    before, behind = two_mass_backbone.arclength[changed[0] : changed[0] + 2]
    assert before - 1e-3 <= event.arclength <= behind


def test_a_limit_point_on_it_is_tracked_in_turn():
    response = so.frequency_response(so.library.duffing(c=0.02, alpha=1.0, F=0.5), (0.3, 0.6))
    onto = {"name": "phase_resonance", "harmonic": 3}
    (limit,) = so.track(peak(response, 3), "F", (0.4, 0.6), onto=onto).bifurcations["LP"]
    curve = so.track(limit, "F", (0.44, 0.47))
    assert curve.kind == "LP"
    assert "onto" not in curve.options
    assert np.abs(curve.multipliers - 1.0).min(axis=1).max() < 1e-3
    at_once = so.frequency_response(so.library.duffing(c=0.02, alpha=1.0, F=0.45), (0.3, 0.6)).bifurcations["LP"]
    there = np.interp(0.45, *np.array(sorted(zip(curve.parameter("F"), curve.omega, strict=True))).T)
    assert min(abs(item.omega - there) for item in at_once) < 1e-4


def softening_then_hardening():
    """`omega^2 = 1 - 3/4 a A^2 + 5/8 A^4` with one harmonic: least at `A^2 = 3 a / 5`."""
    return so.System(
        [[1.0]],
        [[0.01]],
        [[1.0]],
        elements=[so.PolynomialSpring(dof=0, coefficients={3: "-a", 5: 1.0})],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"F": 0.001, "a": 0.5},
    )


def test_its_extremum_and_the_curve_of_these():
    response = so.frequency_response(softening_then_hardening(), (0.9, 1.1), harmonics=1)
    backbone = so.track(peak(response), "F", (0.0005, 0.01), onto="phase_resonance")
    (lowest,) = (e for e in backbone.extrema if e.parameter_name == "omega")
    assert lowest.extreme == "minimum"
    assert lowest.omega**2 == pytest.approx(1.0 - 0.225 * 0.5**2, rel=1e-9)
    curve = so.track(lowest, "a", (0.3, 0.7))
    assert curve.kind == "phase_resonance"
    assert curve.omega**2 == pytest.approx(1.0 - 0.225 * curve.parameter("a") ** 2, rel=1e-7)


@pytest.mark.parametrize("order", [Fraction(1), Fraction(3), Fraction(1, 3), Fraction(2, 3)])
def test_its_derivatives(order):
    """Against differences, where amplitude and phase of the load depend on what varies."""
    load = so.HarmonicLoad(dof=1, amplitude="F*omega**2", phase="0.3 + F")
    system = so.System(np.eye(2), 0.1 * np.eye(2), np.eye(2), loads=[load], parameters={"F": 0.7})
    balance = so.HarmonicBalance(system, so.HarmonicBasis(9, 3))
    x = np.random.default_rng(1).standard_normal((19, 2))
    names = ("omega", "F")
    augmentation = PhaseResonance(order, 0, 1, 0.5)

    def value(u):
        state = balance.at(u[:-2].reshape(19, 2), u[-2], {"F": u[-1]})
        return augmentation.at(state, np.zeros(0), names)

    u = np.array([*x.ravel(), 1.3, 0.7])
    (row,) = value(u).rows
    steps = 1e-6 * np.eye(len(u))
    slopes = [(value(u + step).values[0] - value(u - step).values[0]) / 2e-6 for step in steps]
    assert row == pytest.approx(slopes, rel=1e-6, abs=1e-7)


def test_a_shift_by_a_load_period_changes_nothing():
    system = so.System([[1.0]], [[0.1]], [[1.0]], loads=[so.HarmonicLoad(dof=0, amplitude=1.0, phase=0.4)])
    balance = so.HarmonicBalance(system, so.HarmonicBasis(9, 3))
    x = np.random.default_rng(2).standard_normal((19, 1))
    turn = 2.0 * np.pi / 3.0 * np.arange(1, 10)[:, None]
    turned = x.copy()
    turned[1::2] = np.cos(turn) * x[1::2] + np.sin(turn) * x[2::2]
    turned[2::2] = np.cos(turn) * x[2::2] - np.sin(turn) * x[1::2]
    one, other = (
        PhaseResonance(Fraction(2, 3), 0, 0).at(balance.at(y, 1.2), np.zeros(0), ("omega",)).values for y in (x, turned)
    )
    assert one == pytest.approx(other, rel=1e-12)


def test_saved_and_drawn(response, backbone, tmp_path):
    again = so.load(backbone.save(tmp_path / "backbone.nc"))
    assert again.kind == "phase_resonance"
    assert again.options["onto"] == {"name": "phase_resonance", "harmonic": 1.0}
    for name in ("omega", "amplitude", "multipliers", "arclength"):
        np.testing.assert_array_equal(getattr(again, name), getattr(backbone, name))
    figure = so.plot([response, again], x="omega")
    legend = figure.legends[0] if figure.legends else figure.axes[0].get_legend()
    assert {"response", "phase resonance"} <= {text.get_text() for text in legend.get_texts()}
    assert so.plot(again).axes[0].get_ylabel().endswith("F")


STUDY = """
[system]
library = "duffing"
parameters = { c = 0.05, alpha = 1.0, F = 0.1 }
[[analyses]]
name = "response"
type = "frequency_response"
omega = [0.7, 2.0]
harmonics = 3
[[analyses]]
name = "backbone"
type = "track"
start = { analysis = "response", nearest = { amplitude = 10.0 } }
onto = "phase_resonance"
parameter = "F"
bounds = [0.05, 0.2]
"""


def test_in_a_study_file(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    study = read_study(path)
    curve = run_study(study).finished[1].result
    response = so.frequency_response(study.system, (0.7, 2.0), harmonics=3)
    script = so.track(peak(response), "F", (0.05, 0.2), onto="phase_resonance")
    np.testing.assert_array_equal(curve.omega, script.omega)


@pytest.mark.parametrize(
    ("onto", "message"),
    [
        ({"name": "phase_resonanse"}, "did you mean 'phase_resonance'"),
        ({"name": "phase_resonance", "harmonics": 3}, "did you mean 'harmonic'"),
        ({"name": "phase_resonance", "harmonic": 0.5}, "harmonic"),
        ({"name": "phase_resonance", "harmonic": -1}, "positive"),
    ],
)
def test_mistakes(response, onto, message):
    with pytest.raises(InputError, match=message):
        so.track(peak(response), "F", (0.01, 0.3), onto=onto)


def test_there_must_be_a_load_and_a_point(response):
    with pytest.raises(InputError, match="must be a Bifurcation or a BranchPoint, not Branch"):
        so.track(response, "F", (0.01, 0.3), onto="phase_resonance")
    system = so.System(
        [[1.0]], [[0.1]], [[1.0]], loads=[so.HarmonicLoad(dof=0, amplitude="F", harmonic=2)], parameters={"F": 1.0}
    )
    twice = so.frequency_response(system, (0.4, 0.6))
    with pytest.raises(InputError, match="no load at omega"):
        so.track(twice.points[3], "F", (0.5, 2.0), onto="phase_resonance")
