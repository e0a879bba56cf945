"""`integrate`, `poincare_sections`, `brute_force_diagram`, against shooting, harmonic balance and published numbers."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import ConvergenceError, InputError
from suboctave.timedomain import integrate as scipy_integrate, shoot
from suboctave.timedomain.period_recognition import extents, period_of, same_cycle

GRID = np.array([[x, v] for x in np.linspace(-3.0, 3.0, 7) for v in np.linspace(-6.0, 6.0, 7)])


@pytest.fixture(scope="module")
def oscillator():
    return so.library.reference_oscillator(j=0.5)


# ------------------------------------------------------------------------------------------------------- recognition
def cycle(n, count, decay=0.0, rate=0.9):
    turn = np.arange(count)
    base = np.array([[np.cos(2 * np.pi * k / n), 3.0 * np.sin(2 * np.pi * k / n)] for k in turn])
    return base + decay * (rate**turn)[:, None]


@pytest.mark.parametrize("n", [1, 2, 3, 7, 20])
def test_the_period_of_a_cycle_is_found(n):
    assert period_of(cycle(n, 60), np.array([1.0, 3.0]), 1e-6).period == n


def test_what_creeps_or_is_too_long_is_not_periodic():
    sizes = np.array([1.0, 3.0])
    assert period_of(cycle(1, 30, decay=1.0), sizes, 1e-6).period == 0
    assert period_of(cycle(1, 300, decay=1.0), sizes, 1e-6).period == 1
    assert period_of(cycle(21, 60), sizes, 1e-6).period == 0  # three repetitions do not fit
    assert period_of(np.full((60, 2), np.nan), sizes, 1e-6).period == 0
    # two periods whose points lie closer than the tolerance count as one: stated, not hidden
    points = np.tile([[1.0, 0.0], [1.0 + 1e-8, 0.0]], (30, 1))
    assert period_of(points, sizes, 1e-6).period == 1
    assert period_of(points, sizes, 1e-9).period == 2


def test_cycles_are_compared_whatever_point_is_first():
    one, sizes = cycle(5, 5), np.array([1.0, 3.0])
    assert same_cycle(one, np.roll(one, 2, axis=0), sizes, 1e-9)
    assert not same_cycle(one, one[::-1] * [1.0, 1.001], sizes, 1e-9)


def test_sizes_do_not_depend_on_units():
    """A rotation in other units, with its inertia, is the same motion."""
    peaks, mass = np.array([2.0, 1e-6]), np.array([1.0, 3.0])
    scale = np.array([1.0, 50.0])
    plain, other = extents(peaks, 1.5, mass), extents(peaks * scale, 1.5, mass / scale**2)
    np.testing.assert_allclose(other, plain * np.tile(scale, 2), rtol=1e-14)


# --------------------------------------------------------------------------------------------------------- integrate
def test_a_trajectory_from_a_periodic_motion_repeats(oscillator):
    orbit = so.periodic_orbit(oscillator, 2.25, start=[0.1, 0.0], harmonics=40)
    motion = so.integrate(oscillator, start=orbit, omega=2.25, periods=3, steps_per_period=50)
    assert motion.time.shape == (151,)
    assert motion.displacement.shape == motion.velocity.shape == (151, 1)
    np.testing.assert_allclose(motion.stroboscopic, np.repeat(orbit.start()[None], 4, axis=0), atol=2e-6)
    assert motion.largest[0] == pytest.approx(orbit.amplitude(), rel=2e-6)
    assert motion.seconds > 0.0
    dataset = motion.to_xarray()
    assert dict(dataset.sizes) == {"time": 151, "dof": 1, "parameter": 5}


def test_a_trajectory_is_that_of_scipy(oscillator):
    motion = so.integrate(oscillator, start=[0.9, 1.0], omega=2.3, periods=4, transient=2, parameters={"p": 0.8})
    period = 2 * np.pi / 2.3
    t = np.linspace(2 * period, 6 * period, 801)
    other = scipy_integrate(oscillator, [0.9, 1.0], np.concatenate([[0.0], t]), 2.3, {"p": 0.8})
    np.testing.assert_allclose(motion.displacement, other.x[1:], atol=1e-8)
    np.testing.assert_allclose(motion.velocity, other.v[1:], atol=1e-8)
    np.testing.assert_allclose(motion.time, t - 2 * period, atol=1e-12)
    assert motion.largest[0] >= np.abs(other.x[1:]).max() - 1e-8
    later = so.integrate(oscillator, start=motion.end, omega=2.3, periods=1, parameters={"p": 0.8})
    assert np.array_equal(later.stroboscopic[0], motion.end)


def test_wrong_input_to_integrate_is_refused(oscillator):
    for arguments, words in (
        ({"start": [0.0]}, "2 finite numbers"),
        ({"method": "newmarc"}, "did you mean 'newmark'"),
        ({"periods": 0}, "positive whole number"),
        ({"transient": -1}, "whole number"),
        ({"parameters": {"zetta": 0.1}}, "did you mean 'zeta'"),
    ):
        with pytest.raises(InputError, match=words):
            so.integrate(oscillator, **{"omega": 2.0, **arguments})
    with pytest.raises(InputError, match="must be a System"):
        so.integrate("oscillator", omega=2.0)
    with pytest.raises(ConvergenceError, match="overflow or need too many steps"):
        so.integrate(oscillator, omega=2.0, periods=400, parameters={"zeta": -30.0})


# ---------------------------------------------------------------------------------------------------------- sections
def test_coexisting_attractors_are_those_of_shooting(oscillator):
    sections = so.poincare_sections(oscillator, start=GRID, omega=2.25, transient=400, periods=12)
    found = sections.attractors
    assert sum(one.count for one in found) == len(GRID)
    assert [one.period for one in found] == [1, 2, 1]
    for one in found:
        truth = shoot(oscillator, one.state, 2.25, one.period)
        assert truth.stable
        assert one.amplitude == pytest.approx(truth.amplitude, rel=1e-6)
    assert sections.to_xarray()["displacement"].shape == (len(GRID), 12, 1)
    varied = so.poincare_sections(oscillator, omega=[2.0, 2.25], transient=10, periods=3)
    with pytest.raises(InputError, match="different frequencies"):
        varied.attractors  # noqa: B018
    with pytest.raises(InputError, match="numbered from 0 to 1"):
        varied.attractor(2)


@pytest.mark.slow
def test_attractors_of_the_regularised_oscillator():
    """Published setting of the isola: shooting gives 3.09017 and 0.88906 (2T) beside a small motion."""
    system = so.library.reference_oscillator(j=0.5, regularization=3000.0)
    found = so.poincare_sections(system, start=GRID, omega=2.25, transient=400, periods=12).attractors
    assert [one.period for one in found] == [1, 2, 1]
    assert [one.amplitude for one in found[:2]] == pytest.approx([3.09017, 0.88906], abs=1e-5)


# ------------------------------------------------------------------------------------------------------- brute force
def test_a_diagram_doubles_where_the_branch_does():
    """Falling frequency through the upper period doubling of the exact law, 3.96971, and through no other."""
    system = so.library.reference_oscillator()
    values = np.array([3.90, 3.96, 3.98, 4.02])
    # from rest another attractor is met, of period 3T
    orbit = so.periodic_orbit(system, 4.02, start=[-0.05, 0.0], harmonics=30)
    diagram = so.brute_force_diagram(
        system,
        (3.9, 4.02),
        values=values,
        direction="down",
        start=[orbit.start(), [0.0, 0.0]],
        transient=600,
        periods=12,
    )
    assert diagram.starts == ("down 0", "down 1")
    assert diagram.period[0].tolist() == [2, 2, 1, 1]
    assert diagram.complete
    for one in diagram.of("down 0"):
        truth = shoot(system, one.state, one.omega, one.period)
        assert one.amplitude == pytest.approx(truth.amplitude, rel=2e-5)
    table = diagram.to_dataframe()
    assert list(table.columns[:2]) == ["omega", "start"]
    assert diagram.period[1, 3] == 3
    assert "T 2, 2T" in repr(diagram)
    with pytest.raises(InputError, match=r"did you mean .down 1."):
        diagram.of("dow")


def test_up_and_down_find_both_sides_of_a_hysteresis(oscillator):
    """Upwards the resonance is followed, downwards the small motion: both stable by shooting, at one frequency."""
    grid = np.linspace(1.25, 2.5, 51)
    diagram = so.brute_force_diagram(
        oscillator, (1.25, 2.5), values=51, direction=("up", "down"), transient=60, periods=6, period_tolerance=1e-4
    )
    at = int(np.argmin(np.abs(grid - 2.25)))
    up, down = (diagram.of(start)[at] for start in ("up", "down"))
    assert up.amplitude > 20.0 * down.amplitude
    for one in (up, down):
        truth = shoot(oscillator, one.state, one.omega, 1)
        assert truth.stable
        assert one.amplitude == pytest.approx(truth.amplitude, rel=1e-3)


def test_a_parameter_is_varied_and_an_interruption_keeps_what_is_there(oscillator):
    options = {"parameter": "p", "bounds": (0.1, 0.3), "values": 5, "transient": 20, "periods": 3}
    whole = so.brute_force_diagram(oscillator, 2.25, direction=("up", "anew"), **options)
    assert whole.starts == ("up", "anew")
    np.testing.assert_allclose(whole.values, np.linspace(0.1, 0.3, 5))
    assert whole.points.shape == (2, 5, 3, 2)
    calls = []

    def stop(share, where):
        calls.append(share)
        if len(calls) == 2:
            raise KeyboardInterrupt

    part = so.brute_force_diagram(oscillator, 2.25, direction="up", progress=stop, **options)
    assert not part.complete
    assert part.period[0, 2:].tolist() == [-1, -1, -1]
    assert np.array_equal(part.points[0, :2], whole.points[0, :2])


def test_wrong_input_to_a_diagram_is_refused(oscillator):
    for arguments, words in (
        ({"omega": 2.0}, "range"),
        ({"omega": (1.0, 2.0), "direction": "upp"}, "did you mean 'up'"),
        ({"omega": 2.0, "parameter": "pp", "bounds": (0, 1)}, "did you mean 'p'"),
        ({"omega": 2.0, "parameter": "p"}, "bounds="),
        ({"omega": (1.0, 2.0), "parameter": "p", "bounds": (0, 1)}, "positive number"),
        ({"omega": (1.0, 2.0), "start": [[0.0]]}, "start must be 2"),
        ({"omega": (1.0, 2.0), "values": [3.0]}, "outside the range"),
        ({"omega": (1.0, 2.0), "bounds": (0, 1)}, "parameter="),
        ({"omega": (1.0, 2.0), "observe": 1}, "out of range"),
        ({"omega": (1.0, 2.0), "period_tolerance": 0.0}, "period_tolerance"),
    ):
        with pytest.raises(InputError, match=words):
            so.brute_force_diagram(oscillator, **arguments)


def test_pictures_show_every_period(oscillator, tmp_path):
    diagram = so.brute_force_diagram(oscillator, (2.0, 2.4), values=4, start=GRID[::7], transient=200, periods=6)
    curve = so.frequency_response(oscillator, omega=(2.0, 2.4), harmonics=9)
    figure = diagram.plot(tmp_path / "over.png", curves=curve)
    drawn = {line.get_gid() for line in figure.axes[0].lines}
    assert any("T" in str(gid) for gid in drawn)
    # bifurcations beyond the range would hang outside the frame, and squeeze it
    wide = so.frequency_response(oscillator, omega=(4.2, 1.3), harmonics=9)
    assert any(not 2.0 <= item.omega <= 2.4 for item in wide.bifurcations)
    axes = diagram.plot(curves=wide).axes[0]
    low, high = axes.get_xlim()
    marked = [line.get_xdata() for line in axes.lines if line.get_linestyle() == "None"]
    assert all(low <= x <= high for places in marked for x in places)
    assert (tmp_path / "over.png").stat().st_size > 1000
    sections = diagram.plot(quantity="section", starts=["up 0"])
    shown = sum(len(line.get_xdata()) for line in sections.axes[0].lines)
    periods = diagram.period[0]
    assert shown == int(np.where(periods > 0, periods, 6).sum())
    with pytest.raises(InputError, match="did you mean 'section'"):
        diagram.plot(quantity="sections")
    so.integrate(oscillator, omega=2.0, periods=2).plot(tmp_path / "time.svg")
    so.poincare_sections(oscillator, start=GRID[:3], omega=2.0, transient=10, periods=6).plot(tmp_path / "points.pdf")
    assert {p.name for p in tmp_path.iterdir()} == {"over.png", "time.svg", "points.pdf"}


def test_columns_of_states_have_the_names_of_degrees_of_freedom():
    equations = ["a'' + 0.1*a' + a + a**3 = cos(omega*t)", "b'' + 0.1*b' + 2*b - a = 0"]
    frame = so.integrate(so.System.from_equations(equations), 1.2, periods=3).to_dataframe()
    assert list(frame.columns) == ["time", "x_a", "x_b", "v_a", "v_b"]
