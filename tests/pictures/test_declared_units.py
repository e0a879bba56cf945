"""Units that a system declares, on axes and in tables."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.study.screen import console
from suboctave.study.shown import print_result


@pytest.fixture(scope="module")
def curve():
    system = so.library.reference_oscillator(p=0.55, j=0.0).with_units("mm, N, s")
    return so.frequency_response(system, (2.4, 2.2), harmonics=7)


def texts(figure):
    axes = figure.axes[0]
    return axes.get_xlabel(), axes.get_ylabel()


def test_on_axes_of_curves(curve):
    across, upwards = texts(so.plot(curve))
    assert across.endswith("(rad/s)")
    assert upwards.endswith("(mm)")
    assert texts(so.plot(curve, quantity="acceleration"))[1].endswith("(mm/s²)")
    assert texts(so.plot(curve, quantity="peak_force", element=1))[1].endswith("(N)")
    border = so.track(curve.bifurcations["PD"][0], "j", (0.0, 0.01), harmonics=7)
    assert texts(so.plot(border)) == (across, "j")


def test_what_is_given_goes_first(curve):
    assert texts(so.plot(curve, scale=1e3, unit="µm"))[1].endswith("(µm)")
    assert "(" not in texts(so.plot(curve, scale=2.0))[1]
    assert texts(so.plot(curve, frequency="Hz"))[0].endswith("(Hz)")
    assert "(" not in texts(so.plot(curve, omega_reference=2.0))[0]


def test_on_axes_of_motions(curve):
    event = curve.bifurcations["PD"][0]
    assert [text[-6:] for text in texts(so.plot_phase(event))] == ["$ (mm)", "(mm/s)"]
    force = so.plot_history(event, quantity="force", element=1)
    assert texts(force)[1] == "force of element 1 (N)"


def test_of_curves_in_different_units_none_is_shown(curve):
    other = so.frequency_response(curve.system.with_units("m, N, s"), (2.4, 2.2), harmonics=7)
    assert "(" not in "".join(texts(so.plot([curve, other])))


def test_hertz_of_another_unit_of_time_is_refused(curve):
    other = so.frequency_response(curve.system.with_units("mm, N, ms"), (2.4, 2.2), harmonics=7)
    with pytest.raises(so.InputError, match="the system declares ms"):
        so.plot(other, frequency="Hz")
    with pytest.raises(so.InputError, match="the system declares ms"):
        so.plot_phase(other.bifurcations["PD"][0], frequency="Hz")


def test_in_tables_of_the_terminal(curve, capsys):
    print_result(console(), "response", curve)
    head, line = [row for row in capsys.readouterr().out.splitlines() if "omega (" in row or row.split()[:1] == ["PD"]]
    assert head.split()[:7] == ["kind", "omega", "(rad/s)", "Hz", "max", "|x|", "(mm)"]
    omega, hertz = map(float, line.split()[1:3])
    assert hertz == pytest.approx(omega / 6.283185307179586, rel=1e-6)


@pytest.fixture(scope="module")
def beam():
    """A node that is displaced and turns."""
    matrices = np.eye(2), 0.1 * np.eye(2), [[2.0, -1.0], [-1.0, 2.0]]
    load = so.HarmonicLoad(0, 0.1)
    return so.System(*matrices, so.CubicSpring(0, 0.2), load, dof_names=["7 y", "7 rz"], units="mm, N, s")


def test_of_rotations_are_in_rad(beam, tmp_path):
    """On axes, in tables and in heads, of declared angles and of the rotations of structures."""
    turning = so.frequency_response(beam, (0.9, 1.0), harmonics=3, observe="7 rz")
    assert texts(so.plot(turning))[1].endswith("(rad)")
    assert texts(so.plot(turning, quantity="velocity"))[1].endswith("(rad/s)")
    assert texts(so.plot(turning, dof=0))[1].endswith("(mm)")
    assert "amplitude (rad)" in repr(turning.at(omega=0.95))
    assert "amplitude (rad)" in turning.to_csv(tmp_path / "turning.csv").read_text()
    page = so.write_report({"turning": turning}, tmp_path / "page.html").read_text(encoding="utf-8")
    assert '"dof":1,"length":"rad"' in page
    pendulum = so.System.from_equations("x'' + 0.1*x' + sin(x) = 0.1*cos(omega*t)", angles=["x"], units="m, N, s")
    assert pendulum.units_of(0).name("length / time") == "rad/s"


def test_in_heads_of_results_in_time(beam, tmp_path):
    def head(result):
        return result.to_csv(tmp_path / "table.csv", overwrite=True).read_text(encoding="utf-8").splitlines()[0]

    times = {"transient": 2, "periods": 4}
    columns = "time (s),x_7 y (mm),x_7 rz (rad),v_7 y (mm/s),v_7 rz (rad/s)"
    assert head(so.integrate(beam, 1.0, periods=1)) == columns
    assert head(so.lyapunov_exponents(beam, 1.0, **times)).startswith("exponent (1/s),standard_error (1/s)")
    swept = so.brute_force_diagram(beam, (0.5, 0.6), values=2, **times)
    assert head(swept).startswith("omega (rad/s),frequency (Hz),start,kind,period,amplitude (mm)")
    assert head(swept.to_table()) == head(swept)
    stepped = head(so.stepped_sine(beam, (0.5, 0.6), values=2, **times))
    assert "amplitude (mm),phase_deg (°),harmonic_0 (mm)" in stepped
