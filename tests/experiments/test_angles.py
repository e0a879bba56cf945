"""Angles: motions that turn are periodic modulo whole turns; against SciPy's integration taken modulo 2 pi, against
closed forms, and what is refused.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import suboctave as so
from suboctave.maps.regimes.map import ROTATES, RegimeCheck
from suboctave.model.system import build, describe
from suboctave.study.file import read_study
from suboctave.timedomain import shoot
from suboctave.timedomain.period_recognition import drift_of

OMEGA = 2.0 / 3.0
TURN = 2.0 * np.pi


def pendulum(force, angles=("x",)):
    """Turns over once in a period of the load, with one, two and four periods at 1.35, 1.44, 1.465."""
    equation = "x'' + 0.5*x' + sin(x) = FD*cos(omega*t)"
    return so.System.from_equations(equation, {"FD": force}, angles=list(angles))


def by_scipy(rate, state, omega, settle, keep):
    """States at phase 0 of the load, (keep + 1, 2n), by an integrator that knows nothing of the package."""
    period, last = TURN / omega, settle + keep
    found = solve_ivp(
        rate, (0.0, last * period), state, "DOP853", period * np.arange(settle, last + 1), rtol=1e-10, atol=1e-10
    )
    return found.y.T


def modulo(x):
    return (np.asarray(x) + np.pi) % TURN - np.pi


@pytest.mark.parametrize(("force", "period"), [(1.35, 1), (1.44, 2), (1.465, 4)])
def test_a_rotation_is_periodic_modulo_its_turns(force, period):
    sections = so.poincare_sections(pendulum(force), omega=OMEGA)
    (found,) = sections.attractors
    assert (found.kind, found.period, found.turns, sections.periods.tolist()) == (
        "periodic",
        period,
        (-period,),
        [period],
    )

    def rate(t, y):
        return [y[1], force * np.cos(OMEGA * t) - 0.5 * y[1] - np.sin(y[0])]

    exact = by_scipy(rate, [0.0, 0.0], OMEGA, 150, period)
    assert round((exact[-1, 0] - exact[0, 0]) / TURN) == -period
    places = np.column_stack([modulo(exact[:-1, 0]), exact[:-1, 1]])
    misses = [np.abs(np.roll(places, k, axis=0) - found.points).max() for k in range(period)]
    assert min(misses) < 1e-5
    assert found.amplitude == pytest.approx(np.pi, rel=1e-12)


def test_without_a_declaration_the_drift_is_recognised_and_said():
    free = pendulum(1.44, ())
    sections = so.poincare_sections(free, omega=OMEGA)
    found = sections.attractor(0)
    assert (found.kind, found.period, found.drift.period) == ("drifting", 0, 2)
    assert found.drift.step[0] == pytest.approx(-2.0 * TURN, rel=1e-9)
    for said in (
        repr(found),
        repr(sections),
        repr(so.brute_force_diagram(free, OMEGA, parameter="FD", bounds=(1.4, 1.5), values=[1.44])),
    ):
        assert "x turns by -2 pi in each period: declare angles=['x']" in said
    with pytest.raises(so.InputError, match="is not periodic"):
        so.basins(free, omega=OMEGA, box=((-1, 1), (-1, 1)), grid=(2, 2), attractors=found)


def test_a_drift_that_is_no_rotation():
    """A mass that nothing holds, dragged at a constant speed against a damper, and shaken."""
    system = so.System(1.0, 0.5, 0.0, [], [so.StaticLoad(0, 0.1), so.HarmonicLoad(0, 0.3)])
    found = so.poincare_sections(system, omega=1.0, transient=100, periods=12).attractor(0)
    assert found.drift.period == 1
    assert found.drift.step[0] == pytest.approx(0.1 / 0.5 * TURN, rel=1e-8)
    assert "x_0 moves on by 1.25664 in each period: if it is an angle" in repr(found)


def test_what_creeps_does_not_drift():
    k = np.arange(60.0)
    creeping = np.column_stack([1.0 - 0.999**k, 1e-3 * 0.999**k])
    assert drift_of(creeping, 1.0, np.ones(1), 1e-6) is None
    assert drift_of(np.column_stack([k**2, k]), 1.0, np.ones(1), 1e-6) is None
    steady = drift_of(np.column_stack([0.3 * k + (-1.0) ** k, 1.0 + 0.0 * k]), 1.0, np.ones(1), 1e-6)
    assert steady.period == 2
    assert steady.step[0] == pytest.approx(0.6)


LOCKED = [
    (2, 1, "x'' + c*x' + sin(x)*cos(2*omega*t) - s*cos(x)*sin(2*omega*t) = 0"),
    (1, 2, "x'' + c*x' + sin(2*x)*cos(omega*t) - s*cos(2*x)*sin(omega*t) = 0"),
]


@pytest.mark.parametrize(("turns", "periods", "equation"), LOCKED)
def test_locked_rotations(turns, periods, equation):
    """A turning field, sin(m x - k omega t), takes the angle along: x = k omega t / m + phi, sin(m phi) = -c k / m.

    One turn in two periods has period two: after one the angle is half a turn off.
    """
    speed, m = turns / periods, periods
    for sense in (1, -1):
        system = so.System.from_equations(equation, {"c": 0.2, "s": float(sense)}, angles=["x"])
        found = so.poincare_sections(system, start=[0.1, sense * speed], omega=1.0, transient=150).attractor(0)
        assert (found.period, found.turns) == (periods, (sense * turns,))
        phi = sense * np.arcsin(-0.2 * speed) / m
        at = found.points[np.argmin(np.abs(modulo(found.points[:, 0] - phi)))]
        assert at == pytest.approx([phi, sense * speed], abs=1e-7)


def test_two_pendula_that_turn_together():
    """A torsion spring between them: a turn of both changes nothing, of one it does. A constant drive."""
    parts = {
        "elements": [so.Expression(i, "sin(x)") for i in (0, 1)],
        "loads": [so.StaticLoad(0, 1.6), so.HarmonicLoad(0, 0.3)],
    }
    matrices = np.eye(2), 0.3 * np.eye(2), [[0.5, -0.5], [-0.5, 0.5]]
    with pytest.raises(so.InputError, match=r"x_0 is no angle of 6.28319: .* the stiffness"):
        so.System(*matrices, **parts, angles=[0, 1])
    system = so.System(*matrices, **parts, angles=[[0, 1]])

    def rate(t, y):
        x, v = y[:2], y[2:]
        spring = 0.5 * (x[0] - x[1])
        drive = 1.6 + 0.3 * np.cos(2.0 * t)
        return [*v, drive - 0.3 * v[0] - np.sin(x[0]) - spring, -0.3 * v[1] - np.sin(x[1]) + spring]

    sections = so.poincare_sections(system, omega=2.0, transient=60, periods=12)
    exact = by_scipy(rate, np.zeros(4), 2.0, 60, 12)[1:]
    both = np.repeat(TURN * np.rint(exact[:, :1] / TURN), 2, axis=1)
    assert np.ptp(both) > 0.0
    away = sections.points[0, :, :2] + TURN * sections.turns[0] - exact[:, :2]
    assert np.abs(away).max() < 1e-5
    assert np.abs(sections.points[0, :, 2:] - exact[:, 2:]).max() < 1e-5
    assert np.abs(sections.points[0, :, :2].mean(axis=1)).max() <= 0.5 * TURN * (1.0 + 1e-12)


def test_librations_about_another_turn_are_those_about_none():
    """Begun about 2 pi, with whichever method: the same points, and the largest angle within half a turn."""
    system = pendulum(0.2)
    for method, off in (("accurate", 1e-6), ("newmark", 1e-4)):
        sections = so.poincare_sections(
            system,
            start=[[0.1, 0.0], [TURN + 0.1, 0.0], [-3.0 * TURN, 0.1]],
            omega=1.0,
            transient=60,
            periods=9,
            method=method,
        )
        (found,) = sections.attractors
        assert (found.period, found.count, found.turns) == (1, 3, (0,))
        orbit = so.periodic_orbit(system, 1.0, start=found.state)
        assert found.amplitude == pytest.approx(orbit.amplitude(0), rel=10.0 * off)
        assert found.points[0] == pytest.approx(orbit.start(), abs=off)


def test_shooting_finds_a_rotation_with_its_multipliers():
    """Liouville: the product of the multipliers is exp(-c T)."""
    solution = shoot(pendulum(1.35), [0.0, 0.8], OMEGA)
    assert solution.residual < 1e-10
    assert solution.stable
    assert np.prod(solution.multipliers).real == pytest.approx(np.exp(-0.5 * TURN / OMEGA), rel=1e-8)
    assert solution.amplitude == pytest.approx(np.pi)


def test_a_trajectory_goes_on_through_turns():
    moving = so.integrate(pendulum(1.35), omega=OMEGA, transient=100, periods=3)
    assert abs(moving.displacement[0, 0]) <= np.pi
    assert moving.displacement[-1, 0] - moving.displacement[0, 0] == pytest.approx(-3.0 * TURN, rel=1e-6)
    assert np.abs(np.diff(moving.displacement[:, 0])).max() < 0.2
    assert moving.largest[0] == pytest.approx(np.abs(moving.displacement).max(), rel=1e-3)


def test_a_stepped_sine_measures_what_turns_without_its_drift():
    """The harmonics of x + omega t are those of a periodic motion: independent of how long is measured."""
    first, second = (
        so.stepped_sine(pendulum(1.35), (OMEGA, 1.0), values=[OMEGA], transient=150, periods=m, harmonics=(1, 2))
        for m in (6, 30)
    )
    assert first.period.tolist() == [[1]]
    assert first.components[0, 0, :, 0] == pytest.approx(second.components[0, 0, :, 0], rel=1e-5)
    assert first.largest[0, 0, 0] == pytest.approx(np.pi)


def test_exponents_of_a_rotation():
    """Of a periodic one the sum is -c, and both are alike; two trajectories of a chaotic one part at the same rate."""
    regular = so.lyapunov_exponents(pendulum(1.35), omega=OMEGA, periods=60, transient=60, trajectories=4)
    assert regular.exponents.sum() == pytest.approx(-0.5, rel=1e-6)
    assert regular.chaotic is False
    chaotic = pendulum(1.5)
    rate = so.lyapunov_exponents(chaotic, omega=OMEGA, periods=300, transient=100, trajectories=8)
    assert rate.chaotic is True
    how = so.TwoTrajectories(steps_per_period=(400, 500, 600), periods=150)
    parted = so.lyapunov_exponents(chaotic, omega=OMEGA, method=how)
    assert parted.exponent == pytest.approx(rate.exponents[0], rel=0.4)
    assert parted.distance.max() < 4.0 * np.pi


def test_harmonic_balance_says_that_it_has_no_rotations():
    state = so.poincare_sections(pendulum(1.35), omega=OMEGA).attractor(0).state
    for angles in (("x",), ()):
        with pytest.raises(so.ConvergenceError, match=r"x grows by -6\.28319 in a period: this motion rotates"):
            so.periodic_orbit(pendulum(1.35, angles), OMEGA, start=state)
    with pytest.raises(so.ConvergenceError, match="which harmonic balance does not describe"):
        so.frequency_response(pendulum(1.35), (OMEGA, 0.9), start=state)


def test_files_keep_turns_and_angles(tmp_path):
    system = pendulum(1.44)
    kept = [
        so.poincare_sections(system, omega=OMEGA, periods=9),
        so.brute_force_diagram(system, OMEGA, parameter="FD", bounds=(1.35, 1.44), values=2, direction="up", periods=9),
    ]
    for i, one in enumerate(kept):
        one.save(tmp_path / f"{i}.nc")
        back = so.load(tmp_path / f"{i}.nc")
        assert back.system.angles == system.angles
        np.testing.assert_array_equal(back.turns, one.turns)
        assert repr(back) == repr(one)
    assert back.period.tolist() == [[1, 2]]
    assert [one.turns for one in back.of("up")] == [(-1,), (-2,)]


@pytest.mark.slow
def test_basins_of_rotations():
    """Both senses, each on about half of the plane; the same by following every state for itself."""
    system, box = pendulum(1.35), ((-np.pi, np.pi), (-2.0, 2.0))
    found = so.basins(system, omega=OMEGA, box=box, grid=(9, 9))
    assert sorted(one.period for one in found.attractors) == [1, 1]
    assert found.contradicted == 0
    x, v = (np.linspace(*side, 9) for side in box)
    states = np.column_stack([np.tile(x, 9), np.repeat(v, 9)])
    settled = so.poincare_sections(system, start=states, omega=OMEGA, transient=60, periods=6)
    turns = np.array([settled.attractor(i).turns[0] for i in range(81)]).reshape(9, 9)
    assert {(int(label), int(turn)) for label, turn in zip(found.labels.ravel(), turns.ravel(), strict=True)} == {
        (int(label), int(turns[found.labels == label][0])) for label in (0, 1)
    }
    free = so.basins(pendulum(1.35, ()), omega=OMEGA, box=box, grid=(3, 3), periods=60)
    assert free.shares == {"drifting": 1.0}
    assert "declare its angle" in repr(free)


@pytest.mark.slow
def test_a_regime_map_is_told_of_rotations():
    """At loads at which the pendulum turns over the map has its librations only: what turns is listed as such."""
    found = so.regime_map(pendulum(1.2), (0.6, 0.7), "FD", (1.3, 1.4), harmonics=9, depth=0, values=1)
    checked = found.check(points=3, starts=3, transient=60)
    assert isinstance(checked, RegimeCheck)
    assert checked.counts.get(ROTATES)
    assert ROTATES in {one.verdict for one in checked.disagreements}


# ------------------------------------------------------------------------------------------------------- declarations
def test_declarations_in_texts_and_arguments():
    equation = "x'' + 0.5*x' + sin(x) = FD*cos(omega*t)"
    declared = pendulum(1.0).angles
    for texts in ([equation, "angle x"], f"{equation}; angle x", f"{equation}\nangle x: 2*pi", ["angles x", equation]):
        assert so.System.from_equations(texts, {"FD": 1.0}).angles == declared
    two = ["x'' + sin(x) = cos(omega*t)", "y'' + y + sin(2*y) - y = 0", "angle x, y: pi"]
    assert [angle.periods for angle in so.System.from_equations(two).angles] == [(TURN,), (np.pi,)]
    assert so.System.from_equations("angle'' + sin(angle) = cos(omega*t)", angles=0).dof_names == ("angle",)
    with pytest.raises(so.InputError, match="leave one of them out"):
        so.System.from_equations([equation, "angle x"], {"FD": 1.0}, angles=["x"])
    assert so.System.from_equations(equation, {"FD": 1.0}).with_angles({"x": "4*pi"}).turns.periods == 2.0 * TURN


def test_angles_stay_with_a_system():
    system = pendulum(1.0)
    for other in (
        pickle.loads(pickle.dumps(system)), build(describe(system)), system.with_parameters(FD=2.0),
        system.with_units("m, N, s"), system.with_scaled_loads(), system.undamped(), system.viscous_equivalent(),
    ):  # fmt: skip
        assert other.angles == system.angles
        assert other.turns.periods == TURN
    assert "angles     x" in repr(system)
    assert pendulum(1.0, ()).angles == ()
    assert "angles" not in describe(pendulum(1.0, ()))


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        (["y"], "none of the degrees of freedom"),
        ([2], "out of range"),
        (["x", 0], "named twice"),
        ({"x": 0.0}, "other than zero"),
        ({"x": "FD"}, "is a number such as"),
        ({"x": "pi"}, "x is no angle of 3.14159: a turn further the force of Expression"),
        ([[]], "names no degree of freedom"),
        ({("x",): [1.0, 2.0]}, "1 degrees of freedom, 2 sizes"),
    ],
)
def test_what_is_no_angle(angles, said):
    with pytest.raises(so.InputError, match=said):
        so.System.from_equations("x'' + 0.5*x' + sin(x) = FD*cos(omega*t)", {"FD": 1.0}, angles=angles)


def test_forces_that_do_not_repeat_with_a_turn():
    """A spring, a stop however far away, a parameter; a sum that does repeat is let pass, whatever its parts."""
    sine, load = so.Expression(0, "sin(x)"), [so.HarmonicLoad(0, 1.0)]
    with pytest.raises(so.InputError, match="the stiffness"):
        so.System(1.0, 0.1, 0.01, [sine], load, angles=[0])
    with pytest.raises(so.InputError, match=r"ElasticStop\\(dof=0, gap=10000.0\\)".replace("\\\\", "\\")):
        so.System(1.0, 0.1, 0.0, [sine, so.ElasticStop(0, 3.0, 1e4)], load, angles=[0])
    with pytest.raises(so.InputError, match="CubicSpring"):
        so.System(1.0, 0.1, 0.0, [sine, so.CubicSpring(0, 1e-3)], load, angles=[0])
    assert so.System(1.0, 0.1, 1.0, [so.Expression(0, "sin(x) - x")], load, angles=[0]).angles
    assert so.System(1.0, 0.1, 0.0, [so.Expression(0, "abs(sin(x))")], load, angles={0: np.pi}).angles
    held = so.System(1.0, 0.1, "k", [sine], load, parameters={"k": 0.0}, angles=[0])
    with pytest.raises(so.InputError, match="x_0 is no angle"):
        held.with_parameters(k=0.1)


@pytest.mark.slow
def test_a_projected_structure_turns_as_its_structure():
    """A rotor of 60 discs on a shaft in a field that one of them feels: a turn of all changes nothing."""
    n = 60
    springs = 1e5 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    springs[0, 0] = springs[-1, -1] = 1e5
    system = so.System(
        np.eye(n) / n, 0.5 * np.eye(n) / n, springs, [so.Expression(0, "sin(x)")],
        [so.HarmonicLoad(0, 1.35)], angles=[list(range(n))],
    )  # fmt: skip
    sections = so.poincare_sections(system, omega=OMEGA, transient=100, periods=6, tolerance=1e-8)
    assert sections.projection is not None
    single = so.poincare_sections(pendulum(1.35), omega=OMEGA)
    found, alone = sections.attractor(0), single.attractor(0)
    assert (found.period, abs(found.turns[0])) == (1, 1)
    assert np.asarray(found.points)[0, 0] == pytest.approx(alone.points[0, 0] * -np.sign(found.turns[0]), abs=5e-3)


def test_a_study_declares_angles(tmp_path):
    text = """
[system]
equations = ["x'' + 0.5*x' + sin(x) = FD*cos(omega*t)"]
parameters = { FD = 1.35 }
angles = %s
[[analyses]]
name = "rates"
type = "lyapunov_exponents"
omega = 0.6666
"""
    path = tmp_path / "study.toml"
    for given in ('["x"]', '{ x = "2*pi" }', "[0]"):
        path.write_text(text % given, encoding="utf-8")
        assert read_study(path).system.angles == pendulum(1.35).angles
    path.write_text(text % '{ x = "pi" }', encoding="utf-8")
    with pytest.raises(so.InputError, match=r"system.angles.*x is no angle of 3.14159"):
        read_study(path)
