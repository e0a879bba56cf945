"""Hertz contact: its law, and every method of the package on it, against a written twin, SciPy and its own limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import suboctave as so
from suboctave.errors import InputError
from suboctave.study.file import read_study
from suboctave.study.runner import run_study

C, G, K, D = 0.05, 0.2, 5.0, 0.1
TEXT = f"{K}*max(x - g, 0)**1.5*(1 + {D}*v)"


def oscillator(law, force=0.5):
    return so.System(1.0, C, 1.0, [law], [so.HarmonicLoad(0, "F")], {"F": force, "g": G})


@pytest.fixture(scope="module")
def system():
    return oscillator(so.HertzContact(0, K, "g", D))


@pytest.fixture(scope="module")
def response(system):
    return so.frequency_response(system, (0.55, 0.75))


@pytest.mark.parametrize(
    "law",
    [so.HertzContact(0, 2.0, 0.3, 0.4), so.HertzContact(0, 2e7, -3e-4, 0.1, "left"), so.HertzContact(0, 2.0, 0.3)],
    ids=repr,
)
def test_derivatives_agree_with_differences(law):
    report = so.check_derivatives(law)
    assert report.ok, str(report)


def test_left_is_the_mirror_image_of_right():
    right, left = so.HertzContact(0, 2.0, 0.3, 0.4), so.HertzContact(0, 2.0, -0.3, 0.4, "left")
    u, v = np.linspace(-1.0, 1.0, 21), np.linspace(2.0, -1.0, 21)
    one = right.tangent(u, v, right.coefficient_values({}))[0]
    other = left.tangent(-u, -v, left.coefficient_values({}))[0]
    np.testing.assert_allclose(one, -other, rtol=1e-15)
    assert one[u > 0.3] == pytest.approx(2.0 * (u[u > 0.3] - 0.3) ** 1.5 * (1.0 + 0.4 * v[u > 0.3]))
    assert not one[u <= 0.3].any()


def test_the_restitution_of_an_impact():
    """1 - e = 2/3 damping v_0 for slow impacts (Hunt & Crossley): a free mass, integrated in time by SciPy."""
    law = so.HertzContact(0, 1e4, 0.0, 0.3)
    c, speed = law.coefficient_values({}), 0.02

    def right_side(t, y):
        return [y[1], -law.tangent(y[:1], y[1:], c)[0][0]]

    leaves = lambda t, y: y[0] + 1e-12  # noqa: E731
    leaves.terminal, leaves.direction = True, -1
    end = solve_ivp(right_side, (0.0, 10.0), [0.0, speed], events=leaves, rtol=1e-11, atol=1e-14)
    restitution = -end.y[1, -1] / speed
    assert 1.0 - restitution == pytest.approx(2.0 / 3.0 * 0.3 * speed, rel=0.02)


def test_harmonic_balance_and_normal_forms_as_of_the_written_law(response):
    twin = so.frequency_response(oscillator(so.Expression(0, TEXT)), (0.55, 0.75))
    assert [b.kind for b in response.bifurcations.met] == [b.kind for b in twin.bifurcations.met]
    assert {b.kind for b in response.bifurcations.met} == {"LP", "grazing"}
    for one, other in zip(response.bifurcations.met, twin.bifurcations.met, strict=True):
        assert one.omega == pytest.approx(other.omega, rel=1e-9)
    for one, other in zip(response.bifurcations["LP"], twin.bifurcations["LP"], strict=True):
        assert one.normal_form is not None
        assert one.normal_form.coefficients == pytest.approx(other.normal_form.coefficients, rel=1e-6)


def test_motions_and_multipliers_by_integration_in_time(response):
    """The motion of a point comes back after a period in SciPy, and neighbours of it grow as the multipliers say."""
    point = response.points[0]
    orbit, w = point.orbit, point.orbit.omega
    period = 2.0 * np.pi / w

    def after(start):
        def right_side(t, y):
            contact = K * max(y[0] - G, 0.0) ** 1.5 * (1.0 + D * y[1])
            return [y[1], 0.5 * np.cos(w * t) - C * y[1] - y[0] - contact]

        return solve_ivp(right_side, (0.0, period), start, rtol=1e-10, atol=1e-12, max_step=0.02).y[:, -1]

    start = orbit.start()
    assert after(start) == pytest.approx(start, abs=1e-4)
    monodromy = np.array([(after(start + h) - after(start - h)) / 2e-5 for h in 1e-5 * np.eye(2)]).T
    mu = np.sort_complex(np.linalg.eigvals(monodromy))
    assert np.sort_complex(point.floquet.multipliers) == pytest.approx(mu, abs=1e-3)


def test_the_witness_agrees(system, response):
    """Shooting, and the integrator of many trajectories, which has the law as code of its own."""
    assert so.verify(response.points[0]).agrees
    orbit = response.points[0].orbit
    run = so.integrate(system, start=orbit.start(), omega=orbit.omega, periods=1)
    assert run.displacement[-1, 0] == pytest.approx(orbit.displacement(0.0)[0], abs=1e-4)
    mirrored = so.System(1.0, C, 1.0, [so.HertzContact(0, K, -G, D, "left")], [so.HarmonicLoad(0, 0.5, phase="pi")])
    other = so.integrate(mirrored, start=-orbit.start(), omega=orbit.omega, periods=1)
    assert other.displacement == pytest.approx(-run.displacement, abs=1e-8)


STUDY = """
[system]
mass = 1.0
damping = 0.05
stiffness = 1.0
parameters = { F = 0.5, g = 0.2 }
elements = [{ type = "HertzContact", dof = 0, stiffness = 5.0, gap = "g", damping = 0.1 }]
loads = [{ type = "HarmonicLoad", dof = 0, amplitude = "F" }]
[[analyses]]
name = "response"
type = "frequency_response"
omega = [0.55, 0.75]
"""


def test_in_a_study_file_and_saved(response, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    curve = run_study(read_study(path)).finished[0].result
    np.testing.assert_array_equal(curve.omega, response.omega)
    again = so.load(response.save(tmp_path / "response.nc"))
    assert repr(again.system) == repr(response.system)
    assert again.points[0].orbit.state().balanced.size == response.points[0].orbit.state().balanced.size


def test_mistakes():
    with pytest.raises(InputError, match="did you mean 'left'"):
        so.HertzContact(0, 1.0, 0.1, side="lefd")
    with pytest.raises(InputError, match="gap"):
        so.HertzContact(0, 1.0)
    with pytest.warns(so.NegativeDampingWarning):
        oscillator(so.HertzContact(0, 1.0, "g", damping=-0.1))
