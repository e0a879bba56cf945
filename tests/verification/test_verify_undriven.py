"""`verify` of curves of limit cycles, of modes and of bifurcations: against quadrature and an integration apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import suboctave as so
from suboctave.results.modes import ModeCurve
from suboctave.study.file import read_study
from suboctave.study.runner import run_study
from suboctave.verification.shots import kept_going

pytestmark = pytest.mark.filterwarnings("ignore::suboctave.NegativeDampingWarning")

STIFFNESS = np.array([[2.0, -1.0], [-1.0, 2.0]])


@pytest.fixture(scope="module")
def cycles():
    rubbing = so.System.from_equations("x'' + x - mu*x' - a*x'**3 + b*x'**5 = 0", {"mu": 0.0, "a": 0.1, "b": 0.1})
    return so.limit_cycles(so.equilibria(rubbing, "mu", (-0.1, 0.1)).bifurcations["Hopf"][0])


def mode(damping=0.0, size=3.0):
    system = so.System(np.eye(2), damping * STIFFNESS, STIFFNESS, elements=[so.CubicSpring(0, 0.5)])
    return so.nonlinear_mode(system, mode=1, amplitude=(0.01, size))


def spoilt(curve, index):
    """The points of a curve, one of them with a motion too large by a fiftieth."""
    points = list(curve.points)
    orbit = points[index].orbit
    x = orbit.x.copy()
    x[1:] *= 1.02
    points[index] = replace(points[index], orbit=replace(orbit, x=x))
    return type(curve)(
        curve.kind, curve.names, curve.system, curve.name, points, list(curve.bifurcations.met), [], curve.closed,
        curve.endings, curve.observe, curve.options,
    )  # fmt: skip


def test_limit_cycles(cycles):
    check = so.verify(cycles, points=40)
    assert check.agrees, check
    assert all(point.agrees for point in check.points)
    assert {b.kind for b in check.bifurcations} == {"LP", "Hopf", "extremum"}
    for point in check.points:
        # Liouville: of two multipliers one is +1, the other the growth of areas
        orbit = cycles.orbits[point.index]
        v = orbit.velocity(np.arange(512) * orbit.period / 512.0)[0]
        growth = orbit.period * float(np.mean(orbit.values["mu"] + 0.3 * v**2 - 0.5 * v**4))
        assert np.sort(np.abs(point.multipliers - 1.0))[0] < 1e-7
        assert np.prod(point.multipliers).real == pytest.approx(np.exp(growth), abs=1e-5)
        assert point.stable == (growth < 0.0)
    wrong = so.verify(spoilt(cycles, 20), points=[19, 20, 21], bifurcations=False)
    # beside a cycle there are larger ones, of other parameters
    assert [point.index for point in wrong.disagreements] == [20]


def test_the_conservative_form():
    curve = mode()
    check = so.verify(curve, points=12)
    assert check.agrees, check
    assert all(point.agrees for point in check.points)
    (crossing,) = check.bifurcations
    assert crossing.kind == "BP"
    assert "Shooting finds branch point" in crossing.reason
    # that of shooting over a quarter of the period, tests/analysis/test_nonlinear_modes.py
    assert crossing.true_omega == pytest.approx(1.28153429, abs=1e-3)


def test_damped_modes_with_the_damping_that_keeps_them_going():
    curve = mode(0.02, 1.5)
    for orbit, zeta in zip(kept_going(curve.orbits, "d")[::30], curve.damping_ratio[::30], strict=True):
        assert orbit.values["d"] == pytest.approx(2.0 * zeta * orbit.omega, rel=1e-6)
        damping = 0.02 * STIFFNESS - orbit.values["d"] * np.eye(2)

        def rates(t, z, damping=damping):
            return np.concatenate((z[2:], -damping @ z[2:] - STIFFNESS @ z[:2] - [0.5 * z[0] ** 3, 0.0]))

        end = solve_ivp(rates, (0.0, orbit.period), orbit.start(), rtol=1e-10, atol=1e-12).y[:, -1]
        assert end == pytest.approx(orbit.start(), abs=2e-4 * np.abs(orbit.start()).max())
    check = so.verify(curve, every=10)
    assert check.agrees
    assert all(point.agrees and point.stable is None for point in check.points)
    assert "sustained by the same damping" in check.points[0].reason
    # where forces are linear a larger motion is one as well
    at = len(curve) - 3
    wrong = so.verify(spoilt(curve, at), points=[at - 1, at, at + 1])
    assert isinstance(wrong.branch, ModeCurve)
    assert [point.index for point in wrong.disagreements] == [at]
    with pytest.raises(so.InputError, match=r"so\.verify\(curve, points="):
        so.verify(curve.points[3])


def test_a_condensed_damped_structure():
    """Only the nonlinear mass is an unknown; what is eliminated moves as zeta has it."""
    n = 4
    chain = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    system = so.System(np.eye(n), 0.1 * chain, chain, [so.CubicSpring(0, 1.0)])
    curve = so.nonlinear_mode(system, mode=2, amplitude=(0.05, 0.5), harmonics=7)
    assert curve.orbits[0].balance.size == 1
    check = so.verify(curve, points=3)
    assert all(point.agrees and point.distance < 1e-4 for point in check.points), check


def test_curves_of_bifurcations(cycles, tmp_path):
    border = so.track(cycles.bifurcations["LP"][0], "a", (0.05, 0.2))
    check = so.verify(border, points=6)
    assert all(point.agrees for point in check.points), check
    duffing = so.library.duffing(c=0.05, alpha=1.0, F=0.1)
    folds = so.track(so.frequency_response(duffing, (0.7, 2.0)).bifurcations["LP"][0], "F", (0.05, 0.2))
    check = so.verify(folds, points=6)
    assert all(point.agrees for point in check.points), check
    # the critical one is there in time as well
    assert max(np.abs(point.multipliers - 1.0).min() for point in check.points) < 1e-3
    check.plot(tmp_path / "folds.png")


def test_kept_and_drawn(cycles, tmp_path):
    check = so.verify(cycles, points=4)
    check.save(tmp_path / "check.nc")
    assert repr(so.load(tmp_path / "check.nc")) == repr(check)
    check.plot(tmp_path / "check.png")
    assert list(check.to_dataframe().columns[:3]) == ["index", "omega", "mu"]


def test_as_a_step_with_its_notes_on_the_page(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        """
[system]
equations = ["x'' + 2*x - y + 0.5*x**3 = 0", "y'' + 2*y - x = 0"]

[[analyses]]
name = "mode"
type = "nonlinear_mode"
mode = 1
energy = [1e-3, 100.0]

[[analyses]]
name = "witness"
type = "verify"
branch = "mode"
every = 25

[outputs]
html = "report.html"
""",
        encoding="utf-8",
    )
    outcome = run_study(read_study(path))
    curve, table = (step.result for step in outcome.finished)
    assert table["agrees"].all()
    assert list(table["what"][-1:]) == ["BP"]
    assert table.result.branch.kind == curve.kind
    (page,) = (file for file in outcome.files if file.suffix == ".html")
    text = page.read_text(encoding="utf-8")
    assert "agrees; distance" in text
    assert "confirmed; distance" in text
