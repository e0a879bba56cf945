"""Phase portraits, spectra, time histories: what is drawn is the motion, in closed form where it has one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from matplotlib.colors import to_hex

import suboctave as so
from suboctave.errors import InputError
from suboctave.pictures.style import period_colour
from suboctave.store.motions import motion_dataset, motion_datasets

OMEGA = 1.7
A, B = 0.6, 0.25  # x = A cos(omega t / 2) + B sin(omega t)


def motion(nu=2, omega=OMEGA, harmonics=3, gap=0.5, parameters=None):
    """A motion given in closed form: A cos(omega t / nu) + B sin(omega t)."""
    system = so.System(
        mass=1.0,
        damping=0.1,
        stiffness=1.0,
        elements=[so.ElasticStop(0, stiffness=2.0, gap="g"), so.CubicSpring(0, coefficient=0.3)],
        loads=[so.HarmonicLoad(0, amplitude="F")],
        parameters={"g": gap, "F": 1.0, **(parameters or {})},
    )
    basis = so.HarmonicBasis(harmonics, nu)
    x = np.zeros((basis.size, 1))
    x[1] = A
    x[2 * nu] += B
    return so.PeriodicOrbit(so.HarmonicBalance(system, basis), x, omega, dict(system.parameters), 0.0)


def displacement(t, nu=2):
    return A * np.cos(OMEGA * t / nu) + B * np.sin(OMEGA * t)


def velocity(t, nu=2):
    return OMEGA * (-A / nu * np.sin(OMEGA * t / nu) + B * np.cos(OMEGA * t))


@pytest.fixture(scope="module")
def swinging():
    """A beam under a pulsating axial force that swings at half its frequency: 2T motions and the branch of them."""
    beam = _beam()
    # one harmonic at omega = 2: a cos(t + phi), eps / 2 cos 2 phi = -3/4 0.3 a^2, eps / 2 sin 2 phi = c
    phi = math.radians(75.0)
    amplitude = math.sqrt(0.1 * math.cos(math.radians(30.0)) / (0.75 * 0.3))
    basis = so.HarmonicBasis(6, 2)
    x = np.zeros((basis.size, 1))
    x[1:3, 0] = amplitude * math.cos(phi), -amplitude * math.sin(phi)
    guess = so.PeriodicOrbit(so.HarmonicBalance(beam, basis), x, 2.0, dict(beam.parameters), 0.0)
    return so.frequency_response(beam, (2.0, 2.1), harmonics=5, start=guess)


def _beam():
    return so.System(
        mass=1.0,
        damping=0.05,
        stiffness=1.0,
        elements=[so.Expression(0, "eps*cos(omega*t)*x + 0.3*x**3")],
        parameters={"eps": 0.2},
    )


def lines(figure, gid, frame=0):
    return [line for line in figure.axes[frame].get_lines() if line.get_gid() == gid]


def legend_of(figure):
    (legend,) = [axes.get_legend() for axes in figure.axes if axes.get_legend()] + figure.legends
    return [text.get_text() for text in legend.get_texts()]


# ---------------------------------------------------------------------------------------------------------- the dataset
def test_the_dataset_of_a_motion_holds_the_motion():
    data = motion_dataset(motion(), elements=[0])
    t = data["time"].to_numpy()
    assert t[-1] == pytest.approx(2 * 2.0 * math.pi / OMEGA, rel=1e-14)
    np.testing.assert_allclose(data["displacement"], displacement(t), atol=1e-13)
    np.testing.assert_allclose(data["velocity"], velocity(t), atol=1e-13)
    acceleration = -(OMEGA**2) * (A / 4 * np.cos(OMEGA * t / 2) + B * np.sin(OMEGA * t))
    np.testing.assert_allclose(data["acceleration"], acceleration, atol=1e-13)
    np.testing.assert_allclose(data["force"][0], 2.0 * np.maximum(displacement(t) - 0.5, 0.0), atol=1e-12)
    np.testing.assert_allclose(data["section_displacement"], [A, -A], atol=1e-13)
    np.testing.assert_allclose(data["amplitude_of_component"], [0.0, A, -1j * B, 0.0], atol=1e-13)
    assert list(data["multiple"].to_numpy()) == [0.0, 0.5, 1.0, 1.5]
    assert data.attrs["amplitude"] == pytest.approx(
        np.abs(displacement(np.linspace(0, t[-1], 100_001))).max(), rel=1e-8
    )


def test_gaps_are_those_of_elements_on_this_dof_alone():
    system = so.System(
        mass=np.eye(2),
        damping=0.1 * np.eye(2),
        stiffness=2.0 * np.eye(2),
        elements=[
            so.ElasticStop(0, stiffness=1.0, gap=0.3),
            so.ElasticStop((0, 1), stiffness=1.0, gap=0.2),
            so.ElasticStop(direction=[0.0, 2.0], stiffness=1.0, gap=0.8),
            so.Freeplay(1, stiffness=1.0, gap=0.7),
        ],
        loads=[so.HarmonicLoad(1, amplitude=1.0)],
    )
    basis = so.HarmonicBasis(1)
    x = np.ones((3, 2))
    orbit = so.PeriodicOrbit(so.HarmonicBalance(system, basis), x, 1.0, {}, 0.0)
    first, second = motion_dataset(orbit, 0), motion_dataset(orbit)
    assert second.attrs["dof"] == 1  # where the load acts
    assert dict(zip(first["gap_level"].values, first["gap_element"].values, strict=True)) == {0.3: 0}
    # the third stop reads u = 2 x_1
    assert sorted(zip(second["gap_level"].values, second["gap_element"].values, strict=True)) == [
        (-0.7, 3),
        (0.4, 2),
        (0.7, 3),
    ]


def test_neglected_components_are_what_more_harmonics_find():
    duffing = so.library.duffing(c=0.1, F=0.3)
    few = so.frequency_response(duffing, (0.9, 0.8), harmonics=3).orbits[0]
    many = so.frequency_response(duffing, (0.9, 0.8), harmonics=15).orbits[0]
    estimated = motion_dataset(few)["amplitude_of_neglected"].to_numpy()
    solved = np.array([many.harmonic(k) for k in (5, 7)])
    assert abs(estimated[[1, 3]] - solved) == pytest.approx(0.0, abs=0.1 * abs(solved[0]))
    assert abs(estimated[1] - solved[0]) < 0.1 * abs(solved[0])


# ------------------------------------------------------------------------------------------------------ phase portraits
@pytest.mark.parametrize("nu", [1, 2, 3, 4])
def test_a_portrait_has_nu_stroboscopic_points(nu):
    figure = so.plot_phase(motion(nu, harmonics=4))
    (curve,), (points,) = lines(figure, "motion"), lines(figure, "stroboscopic")
    t = 2.0 * math.pi / OMEGA * np.arange(nu)
    expected = np.column_stack([displacement(t, nu), velocity(t, nu)])
    np.testing.assert_allclose(points.get_xydata(), expected, atol=1e-12)
    np.testing.assert_allclose(curve.get_xydata()[0], curve.get_xydata()[-1], atol=1e-12)  # closed
    assert to_hex(curve.get_color()) == period_colour(nu).lower()
    assert figure.axes[0].get_title().startswith("T," if nu == 1 else f"{nu}T,")


def test_units_of_a_portrait():
    figure = so.plot_phase(motion(), frequency="Hz", scale=1e3, unit="mm")
    (points,), (gap,) = lines(figure, "stroboscopic"), lines(figure, "gap")
    np.testing.assert_allclose(points.get_xydata(), 1e3 * np.array([[A, OMEGA * B], [-A, OMEGA * B]]), rtol=1e-12)
    assert gap.get_xdata()[0] == pytest.approx(500.0)
    axes = figure.axes[0]
    assert axes.get_xlabel().endswith("(mm)")
    assert axes.get_ylabel().endswith("(mm/s)")
    assert f"{OMEGA / (2.0 * math.pi):.4g} Hz" in axes.get_title()
    relative = so.plot_phase(motion(), omega_reference=2.0)
    np.testing.assert_allclose(lines(relative, "stroboscopic")[0].get_ydata(), OMEGA * B / 2.0, rtol=1e-12)
    assert "0.85" in relative.axes[0].get_title()


def test_a_gap_far_from_every_motion_is_not_drawn():
    assert not lines(so.plot_phase(motion(gap=5.0)), "gap")
    assert "gaps" not in legend_of(so.plot_phase(motion(gap=5.0)))


def test_several_motions_side_by_side_or_in_one_frame():
    motions = [motion(1), motion(2), motion(2, omega=2.5)]
    apart = so.plot_phase(motions, labels=["a", "b", "c"])
    assert len(apart.axes) == 3
    assert len({axes.get_xlim() for axes in apart.axes}) == len({axes.get_ylim() for axes in apart.axes}) == 1
    assert [axes.get_title().split("\n")[0] for axes in apart.axes] == ["a", "b", "c"]
    colours = [to_hex(lines(apart, "motion", frame)[0].get_color()) for frame in range(3)]
    assert colours[1] == colours[2] == period_colour(2).lower() != colours[0]
    together = so.plot_phase(motions, overlay=True)
    assert len(together.axes) == 1
    looks = [(to_hex(line.get_color()), line.get_linewidth()) for line in lines(together, "motion")]
    assert len(set(looks)) == 3
    names = legend_of(together)
    assert [name.split(",")[0] for name in names[:3]] == ["T", "2T", "2T"]
    assert names[3:] == ["stroboscopic points", "gaps"]


def test_captions_say_what_differs():
    figure = so.plot_phase([motion(), motion(parameters={"F": 2.5})])
    assert [axes.get_title() for axes in figure.axes] == [rf"2T, $\omega$ = 1.7, F = {F}" for F in ("1", "2.5")]


@pytest.mark.parametrize("count", [2, 5])
@pytest.mark.parametrize("size", ["single-column", "double-column", None])
def test_nothing_sticks_out_and_nothing_overlaps(count, size):
    figure = so.plot_phase(
        [motion(1 + i % 4, omega=1.234 + i, harmonics=4) for i in range(count)], size=size, frequency="rad/s", unit="mm"
    )
    figure.canvas.draw()
    if size is not None:
        width = 84.0 if size == "single-column" else 174.0
        assert figure.get_size_inches()[0] * 25.4 == pytest.approx(width, abs=0.2)
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    for i, box in enumerate(boxes):
        assert box.x0 >= -1
        assert box.y0 >= -1
        assert box.x1 <= figure.bbox.x1 + 1
        assert box.y1 <= figure.bbox.y1 + 1
        assert not any(box.overlaps(other) for other in boxes[:i])


# -------------------------------------------------------------------------------------------------------------- spectra
def test_a_spectrum_shows_every_component_in_the_colour_of_its_period():
    figure = so.plot_spectrum(motion(4, harmonics=9))
    (load,), (fourths,) = lines(figure, "component 1"), lines(figure, "component 4")
    np.testing.assert_allclose(load.get_xydata(), [[1.0, B]], rtol=1e-12)
    np.testing.assert_allclose(fourths.get_xydata(), [[0.25, A]], rtol=1e-12)
    assert to_hex(fourths.get_markerfacecolor()) == period_colour(4).lower()
    assert figure.axes[0].get_yscale() == "log"
    (end,) = lines(figure, "truncation")
    assert end.get_xdata()[0] == pytest.approx(9.5 / 4)
    neglected = np.concatenate(
        [line.get_xdata() for line in lines(figure, "neglected 1") + lines(figure, "neglected 2")]
    )
    assert np.all(neglected > 9.5 / 4)
    ticks = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert ticks[:7] == ["0", "1/4", "1/2", "3/4", "1", "5/4", "3/2"]
    assert legend_of(figure) == [r"at $k\,\omega$", r"at $k\,\omega/4$", "neglected (estimated)"]


def test_a_spectrum_of_velocity_in_hertz():
    figure = so.plot_spectrum(motion(), quantity="velocity", frequency="Hz", scale=1e3, unit="mm", highest=1)
    (load,), (halves,) = lines(figure, "component 1"), lines(figure, "component 2")
    hertz = OMEGA / (2.0 * math.pi)
    np.testing.assert_allclose(load.get_xydata(), [[hertz, 1e3 * B * OMEGA]], rtol=1e-12)
    np.testing.assert_allclose(halves.get_xydata(), [[hertz / 2, 1e3 * A * OMEGA / 2]], rtol=1e-12)
    assert "(mm/s)" in figure.axes[0].get_ylabel()
    assert not lines(figure, "truncation")


# ------------------------------------------------------------------------------------------------------- time histories
def test_a_history_in_load_periods():
    figure = so.plot_history([motion(1), motion(2)], overlay=True)
    short, long = lines(figure, "motion")
    t = long.get_xdata()
    assert (short.get_xdata()[-1], t[-1]) == pytest.approx((1.0, 2.0))
    np.testing.assert_allclose(long.get_ydata(), displacement(t * 2.0 * math.pi / OMEGA), atol=1e-12)
    (again,) = lines(figure, "repeated")
    assert again.get_xdata()[[0, -1]] == pytest.approx([1.0, 2.0])
    assert lines(figure, "gap")[0].get_ydata()[0] == 0.5


def test_a_history_of_a_force_in_seconds():
    figure = so.plot_history(motion(), quantity="force", element=0, frequency="Hz", unit="N")
    (line,) = lines(figure, "motion")
    t = line.get_xdata()
    assert t[-1] == pytest.approx(4.0 * math.pi / OMEGA)
    np.testing.assert_allclose(line.get_ydata(), 2.0 * np.maximum(displacement(t) - 0.5, 0.0), atol=1e-12)
    assert figure.axes[0].get_ylabel() == "force of element 0 (N)"
    assert figure.axes[0].get_xlabel() == "time (s)"


# ------------------------------------------------------------------------------------------- where motions come from
def test_orbit_branch_file_and_dataset_give_the_same_picture(swinging, tmp_path):
    swinging.save(tmp_path / "branch.nc")
    loaded = so.load(tmp_path / "branch.nc")
    assert swinging.orbits[1].basis.nu == 2
    ways = [
        (swinging.points[1], None),
        (swinging, [1]),
        (loaded, [1]),
        (loaded, [1 - len(loaded)]),
        (motion_dataset(loaded.orbits[1]), None),
    ]
    wanted = motion_dataset(swinging.orbits[1])
    for item, points in ways:
        (dataset,) = motion_datasets(item, points)
        assert dataset.identical(wanted)
    for draw, options, name in (
        (so.plot_phase, {}, "a.svg"),
        (so.plot_spectrum, {}, "a.png"),
        (so.plot_history, {"quantity": "force", "element": 0}, "a.pdf"),
    ):
        draw(swinging.orbits[1], tmp_path / name, **options)
        live = (tmp_path / name).read_bytes()
        draw(loaded, tmp_path / name, points=[1], **options)
        assert (tmp_path / name).read_bytes() == live


@pytest.mark.parametrize(
    ("draw", "options", "message"),
    [
        (so.plot_phase, {"dof": 1}, "out of range"),
        (so.plot_phase, {"points": [0]}, "no branch is given"),
        (so.plot_phase, {"labels": ["a", "b"]}, "each of the 1 motions"),
        (so.plot_phase, {"frequency": "hz"}, "did you mean 'Hz'"),
        (so.plot_phase, {"frequency": "Hz", "omega_reference": 1.0}, "choose one"),
        (so.plot_phase, {"scale": -1.0}, "positive number"),
        (so.plot_phase, {"size": "single"}, "did you mean 'single-column'"),
        (so.plot_phase, {"path": "a.pgn"}, "did you mean '.png'"),
        (so.plot_spectrum, {"quantity": "force"}, "unknown quantity"),
        (so.plot_spectrum, {"quantity": "velocty"}, "did you mean 'velocity'"),
        (so.plot_spectrum, {"highest": 0.0}, "positive multiple"),
        (so.plot_history, {"quantity": "force"}, "give element="),
        (so.plot_history, {"quantity": "force", "element": 2}, r"out of range: 0: ElasticStop"),
        (so.plot_history, {"element": 0}, "says nothing about"),
    ],
)
def test_wrong_options_are_refused(draw, options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        draw(motion(), **options)
    assert not list(tmp_path.iterdir())


def test_what_is_no_motion_is_refused(swinging):
    for item, message in (
        (swinging, "choose with points"),
        (swinging.to_xarray(), "no motion"),
        ([], "no motion to draw"),
        (3, "not int"),
        ([motion(), "b"], "not str"),
    ):
        with pytest.raises(InputError, match=message):
            so.plot_phase(item)
    for points, message in (([99], "no point 99"), ([0.5], "whole number"), ([True], "whole number")):
        with pytest.raises(InputError, match=message):
            so.plot_phase(swinging, points=points)
    with pytest.raises(InputError, match="drawn by plot_phase"):
        so.plot(motion_dataset(motion()))
    with pytest.raises(InputError, match="no force of element 0"):
        so.plot_history(motion_dataset(motion()), quantity="force", element=0)
