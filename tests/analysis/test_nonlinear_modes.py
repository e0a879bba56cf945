"""Nonlinear modes against elliptic integrals, shooting, closed forms of damping, and forced motions at resonance."""

from __future__ import annotations

import numpy as np
import pytest
from chains import chain_matrices
from pages import blocks, check_prints
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from scipy.special import ellipk

import suboctave as so
from suboctave.pictures.tables import notes_on
from suboctave.study.file import read_study
from suboctave.study.runner import run_study

TIGHT = {
    "harmonics": so.AdaptiveHarmonics(tolerance=1e-12, event_tolerance=1e-12),
    "newton": so.NewtonOptions(tolerance=1e-12),
}
STIFFNESS = np.array([[2.0, -1.0], [-1.0, 2.0]])


def two_masses(damping=0.0, **more):
    """Kerschen, Peeters, Golinval & Vakakis, Mechanical Systems and Signal Processing 23 (2009)."""
    return so.System(np.eye(2), damping * STIFFNESS, STIFFNESS, elements=[so.CubicSpring(0, 0.5)], **more)


@pytest.fixture(scope="module")
def lower():
    return so.nonlinear_mode(two_masses(), mode=1, amplitude=(0.01, 5.0))


@pytest.fixture(scope="module")
def tongue(lower):
    (crossing,) = lower.bifurcations["BP"]
    return so.switch_branch(crossing)


def test_duffing_over_six_decades_of_amplitude():
    """x'' + x + x^3 = 0: frequency by a complete elliptic integral, energy in closed form."""
    system = so.System(1.0, 0.0, 1.0, elements=[so.CubicSpring(0, 1.0)])
    mode = so.nonlinear_mode(system, amplitude=(1e-3, 1e3), **TIGHT)
    a = mode.amplitude
    assert a[[0, -1]] == pytest.approx([1e-3, 1e3], rel=1e-9)
    exact = np.pi * np.sqrt(1.0 + a**2) / (2.0 * ellipk(a**2 / (2.0 * (1.0 + a**2))))
    assert np.abs(mode.omega / exact - 1.0).max() < 1e-10
    assert np.abs(mode.energy / (a**2 / 2.0 + a**4 / 4.0) - 1.0).max() < 1e-10
    assert np.abs(mode.damping_ratio).max() < 1e-12
    assert mode.stable.all()


def test_energy_and_action_of_a_family():
    """`dE = omega dJ`, and the energy is the same at all times."""
    mode = so.nonlinear_mode(two_masses(), mode=2, energy=(1e-3, 20.0), **TIGHT)
    assert mode.energy[[0, -1]] == pytest.approx([1e-3, 20.0], rel=1e-9)
    slopes = np.gradient(mode.energy, mode.action)[3:-3]
    assert slopes == pytest.approx(mode.omega[3:-3], rel=2e-3)
    orbit, t = mode.orbits[-1], np.linspace(0.0, mode.orbits[-1].period, 50)
    x, v = orbit.displacement(t), orbit.velocity(t)
    whole = 0.5 * (v**2).sum(axis=0) + 0.5 * np.einsum("it,ij,jt->t", x, STIFFNESS, x) + x[0] ** 4 / 8.0
    assert whole == pytest.approx(np.full(50, 20.0), rel=1e-9)


# --------------------------------------------------------------------------------------------- internal resonances
def shot(omega, guess):
    """The symmetric motion at a frequency by shooting over a quarter of its period, and the trace of its monodromy."""

    def rates(t, z):
        x, rest = z[:2], z[4:].reshape(4, -1)
        jacobian = np.zeros((4, 4))
        jacobian[:2, 2:] = np.eye(2)
        jacobian[2:, :2] = -STIFFNESS
        jacobian[2, 0] -= 1.5 * x[0] ** 2
        force = STIFFNESS @ x + np.array([0.5 * x[0] ** 3, 0.0])
        return np.concatenate((z[2:4], -force, (jacobian @ rest).ravel()))

    def after(x, time, whole=False):
        start = np.concatenate((x, np.zeros(2), np.eye(4).ravel() if whole else np.zeros(0)))
        return solve_ivp(rates, (0.0, time), start, rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]

    period = 2.0 * np.pi / omega
    x = fsolve(lambda x: after(x, period / 4.0)[:2], guess, xtol=1e-11)
    return x, np.trace(after(x, period, whole=True)[4:].reshape(4, 4))


def test_the_branch_point_of_two_masses_by_shooting(lower):
    """Beside the pair that is +1 all along another one reaches +1: the trace of the monodromy matrix is 4."""
    (crossing,) = lower.bifurcations["BP"]
    orbit = crossing.orbit
    guess = orbit.displacement(0.0)
    assert np.abs(orbit.velocity(0.0)).max() < 1e-9
    near = [crossing.omega * (1.0 + s * 1e-3) for s in (-1.0, 1.0)]
    exact = brentq(lambda omega: shot(omega, guess)[1] - 4.0, *near, xtol=1e-12)
    assert crossing.omega == pytest.approx(exact, rel=1e-9)
    assert shot(exact, guess)[0] == pytest.approx(guess, rel=1e-6)


def test_the_tongue_leads_to_the_other_mode(lower, tongue):
    """A 2:1 internal resonance: from the lower mode, both ways, to the upper one at twice the frequency."""
    assert "motions of half the period" in tongue.ended
    assert [event.kind for event in tongue.bifurcations] == ["BP", "LP", "BP", "LP", "BP"]
    assert np.abs(lower.harmonic(2)).max() < 1e-6
    assert np.abs(tongue.harmonic(2)).max() > 1.0
    upper = so.nonlinear_mode(two_masses(), mode=2, amplitude=(1.0, 5.0))
    met = [b for b in tongue.bifurcations["BP"] if abs(b.orbit.harmonic(1)) < 1e-3]
    assert len(met) == 2
    for item in met:
        assert np.interp(2.0 * item.omega, upper.omega, upper.amplitude) == pytest.approx(item.amplitude, rel=1e-3)
    # where the energy turns four multipliers are +1
    assert len(tongue.bifurcations["LP"]) == 2
    for item in tongue.bifurcations["LP"]:
        assert np.abs(item.multipliers - 1.0).max() < 2e-2
    assert tongue.energy.max() == pytest.approx(148.660, abs=1e-2)


def test_the_tip_of_a_tongue_does_not_depend_on_rounding(tongue):
    """Two directions lead away there, of four-fold symmetry: the equations of the curve are singular, and twice."""
    tips = [event.omega for event in tongue.bifurcations if abs(event.orbit.harmonic(1)) < 1e-3]
    assert tips[0] == pytest.approx(tips[1], rel=1e-9)
    for change in (-3e-13, -1e-13, 2e-13, 4e-13):
        system = so.System(np.eye(2), np.zeros((2, 2)), (1.0 + change) * STIFFNESS, elements=[so.CubicSpring(0, 0.5)])
        (crossing,) = so.nonlinear_mode(system, mode=1, amplitude=(0.01, 5.0)).bifurcations["BP"]
        again = so.switch_branch(crossing)
        assert [event.kind for event in again.bifurcations] == ["BP", "LP", "BP", "LP", "BP"]
        assert [again.bifurcations[i].omega for i in (0, -1)] == pytest.approx(tips, rel=1e-9)


def mode_of_a_chain(n, element, amplitude):
    mass, stiffness = (matrix.toarray() for matrix in chain_matrices(n))
    return so.nonlinear_mode(
        so.System(mass, np.zeros((n, n)), stiffness, elements=[element]), mode=2, amplitude=amplitude
    )


def test_pairs_pass_minus_one_on_the_circle():
    """Nothing doubles where perturbations meet the same in both halves of the period: det J_half only touches zero."""
    mode = mode_of_a_chain(3, so.CubicSpring(2, 1.0), (0.01, 3.0))
    leftmost = np.array([mu[np.argmin(mu.real)] for mu in (point.floquet.multipliers for point in mode.points)])
    near = leftmost[np.abs(leftmost + 1.0) < 0.3]
    assert np.abs(near + 1.0).min() < 0.03
    assert np.abs(near) == pytest.approx(1.0, abs=1e-6)
    assert not mode.bifurcations["PD"]
    assert not any("PD may lie" in note for note in mode.warnings)


def test_a_resonance_of_what_is_eliminated_leaves_nothing_in_doubt():
    """The determinant of J_half has a pole where the chain resonates with its stop's displacement held."""
    mode = mode_of_a_chain(8, so.ElasticStop(7, stiffness=5.0, gap=0.5), (0.3, 3.0))
    assert [round(item.omega, 4) for item in mode.bifurcations["PD"]] == [3.0326, 3.0445, 3.0445]
    assert not any("PD may lie" in note for note in mode.warnings)


def test_every_motion_of_a_tongue_is_one(tongue):
    """By time integration over a period."""
    system = two_masses()
    for orbit in tongue.orbits[::20]:
        end = so.integrate(system, start=orbit.start(), omega=orbit.omega, periods=1, tolerance=1e-11)
        assert end.displacement[-1] == pytest.approx(orbit.displacement(0.0), abs=2e-4)


def test_a_period_doubling_of_a_mode():
    """y alone is linear and pumps x at twice its frequency: the border of Mathieu's first region."""
    system = so.System.from_equations(["x'' + x + 2*x*y = 0", "y'' + 4.2*y + x**2 = 0"])
    mode = so.nonlinear_mode(system, mode=2, amplitude=0.2, observe=1)
    (doubling,) = mode.bifurcations["PD"]
    # x'' + (1 + 2 A cos(2 w t)) x = 0 with x of frequency w, by two harmonics and more of Hill's determinant
    w = 0.5 * np.sqrt(4.2)
    k = np.arange(-9, 10, 2)
    hill = lambda a: np.linalg.det(np.diag((1.0 - (k * w) ** 2) / (1.0 + k**2)) + a * sum(  # noqa: E731
        np.eye(len(k), k=j) for j in (-1, 1)
    ) / (1.0 + k**2)[:, None])  # fmt: skip
    assert doubling.amplitude == pytest.approx(brentq(hill, 0.03, 0.07, xtol=1e-14), rel=1e-6)
    doubled = so.switch_branch(doubling)
    assert doubled.nu == 2
    assert doubled.departs.kind == "PD"
    size = np.abs(doubled.harmonic(0.5, 0))
    assert size[-1] > 0.1 > 1e-2 > size[0]
    assert np.abs(doubled.damping_ratio).max() < 1e-9


# ---------------------------------------------------------------------------------------------------------- damping
def test_damping_of_linear_modes_is_exact():
    """Of one degree of freedom the closed form; of proportional damping that of each mode."""
    one = so.nonlinear_mode(so.System(2.0, 0.12, 8.0), amplitude=(0.1, 1.0))
    assert one.damping_ratio == pytest.approx(np.full(len(one), 0.12 / (2.0 * 2.0 * 2.0)), rel=1e-10)
    assert one.omega == pytest.approx(np.full(len(one), 2.0), rel=1e-10)
    assert one.forcing() == pytest.approx(0.12 * one.omega * one.amplitude, rel=1e-9)
    linear = so.System(np.eye(2), 0.02 * STIFFNESS, STIFFNESS)
    for number, omega in ((1, 1.0), (2, np.sqrt(3.0))):
        mode = so.nonlinear_mode(linear, mode=number, amplitude=(0.1, 1.0))
        assert mode.damping_ratio == pytest.approx(np.full(len(mode), 0.01 * omega), rel=1e-9)


def test_a_limit_cycle_is_a_mode_without_damping():
    with pytest.warns(so.NegativeDampingWarning):
        system = so.System.from_equations("x'' - 0.1*(1 - x**2)*x' + x = 0")
    mode = so.nonlinear_mode(system, amplitude=3.0, max_step=0.02)
    assert mode.damping_ratio[0] == pytest.approx(-0.05, abs=1e-6)
    # van der Pol's cycle at mu = 0.1 (Andersen & Geer, SIAM Journal on Applied Mathematics 42, 1982): amplitude
    # 2 + mu^2 / 96, frequency 1 - mu^2 / 16
    at = [np.interp(0.0, mode.damping_ratio, values) for values in (mode.amplitude, mode.omega)]
    assert at == pytest.approx([2.0 + 0.01 / 96.0, 1.0 - 0.01 / 16.0], abs=2e-4)


def test_phase_resonance_is_a_mode_but_for_the_square_of_damping():
    """Frequency and load over amplitude: what is left falls with zeta^2."""
    apart = []
    for zeta in (0.08, 0.04):
        system = so.library.duffing(c=2.0 * zeta, alpha=1.0, F=3.0 * zeta)
        forced = so.phase_resonance(system, parameter="F", bounds=(zeta, 5.0 * zeta), omega=(0.7, 4.0), harmonics=15)
        found = []
        for i in (0, len(forced) // 2, -1):
            size = float(forced.amplitude[i])
            mode = so.nonlinear_mode(system, amplitude=size, damped=False, harmonics=15)
            load = mode.forcing(system=system)[-1]
            found.append([mode.omega[-1] / forced.omega[i] - 1.0, load / forced.parameter("F")[i] - 1.0])
        apart.append(np.abs(found).max(axis=0))
    ratios = np.array(apart[:-1]) / np.array(apart[1:])
    assert np.all(ratios > 3.5)


def test_forcing_of_several_masses():
    """A load at either mass, at the resonance that it makes."""
    damped = two_masses(0.01)
    for at in (0, 1):
        loaded = so.System(
            np.eye(2), 0.01 * STIFFNESS, STIFFNESS, [so.CubicSpring(0, 0.5)], [so.HarmonicLoad(at, "F")], {"F": 0.01}
        )
        forced = so.phase_resonance(loaded, parameter="F", bounds=(0.002, 0.02), omega=(0.9, 1.3), observe=at)
        mode = so.nonlinear_mode(damped, amplitude=(0.05, 1.05 * forced.amplitude.max()), observe=at)
        load = np.interp(forced.amplitude, mode.amplitude, mode.forcing(at))
        assert load[forced.amplitude > 0.1] == pytest.approx(forced.parameter("F")[forced.amplitude > 0.1], rel=2e-2)
    assert mode.forcing([0.0, 1.0]) == pytest.approx(mode.forcing(1))


# ---------------------------------------------------------------------------------------------- systems and results
def test_constant_loads_stay():
    loads = [so.HarmonicLoad(0, 0.5, harmonic=0), so.HarmonicLoad(0, 0.3)]
    system = so.System(1.0, 0.0, 1.0, [so.CubicSpring(0, 1.0)], loads)
    mode = so.nonlinear_mode(system, energy=(1e-6, 1.0))
    rest = brentq(lambda x: x + x**3 - 0.5, 0.0, 1.0, xtol=1e-15)
    assert mode.omega[0] == pytest.approx(np.sqrt(1.0 + 3.0 * rest**2), rel=1e-5)
    assert mode.harmonic(0)[0].real == pytest.approx(rest, abs=1e-5)
    first, last = np.sort([rest + s * 1.0 for s in (-1.0, 1.0)])
    energy = lambda x: x**2 / 2 + x**4 / 4 - x / 2  # noqa: E731
    turns = [
        brentq(lambda x: energy(x) - energy(rest) - 1.0, *ends) for ends in ((first - 1.0, rest), (rest, last + 1.0))
    ]
    x = mode.orbits[-1].displacement(np.linspace(0.0, mode.orbits[-1].period, 2001))[0]
    assert [x.min(), x.max()] == pytest.approx(turns, abs=1e-4)


def test_gyroscopic_coupling_takes_no_energy():
    """Backward and forward whirl: `omega = sqrt(1 + g^2 / 4) -+ g / 2` where it is small."""
    g, springs = 0.4, [so.CubicSpring(0, 1.0), so.CubicSpring(1, 1.0)]
    system = so.System(np.eye(2), [[0.0, -g], [g, 0.0]], np.eye(2), springs)
    for number, side in ((1, -1.0), (2, 1.0)):
        mode = so.nonlinear_mode(system, mode=number, amplitude=(1e-3, 1.0))
        assert not mode.damped
        assert mode.omega[0] == pytest.approx(np.sqrt(1.0 + g**2 / 4.0) + side * g / 2.0, rel=1e-5)
        assert np.abs(mode.damping_ratio).max() < 1e-9
        assert np.gradient(mode.energy, mode.action)[5:-5] == pytest.approx(mode.omega[5:-5], rel=1e-2)


def test_a_stop_begins_where_it_is_reached():
    """x'' + x + 20 max(x - 1, 0): harmonic up to 1, then a half period of each spring."""
    mode = so.nonlinear_mode(so.System(1.0, 0.0, 1.0, [so.ElasticStop(0, 20.0, 1.0)]), amplitude=(0.5, 2.0))
    assert mode.omega[mode.amplitude < 0.99] == pytest.approx(1.0, abs=1e-9)
    energy, stiff = mode.energy[-1], np.sqrt(21.0)
    speed = np.sqrt(2.0 * energy - 1.0)
    # beyond the gap about its own centre 20/21, from 1/21 there
    beyond = 2.0 * (np.pi / 2.0 - np.arctan((1.0 / 21.0) * stiff / speed)) / stiff
    period = beyond + np.pi + 2.0 * np.arcsin(1.0 / np.sqrt(2.0 * energy))
    assert mode.omega[-1] == pytest.approx(2.0 * np.pi / period, rel=1e-4)


@pytest.mark.parametrize("damped", [False, True])
def test_a_condensed_structure_has_its_mass(damped):
    """Of a chain only the nonlinear mass is an unknown: the same mode as with all of them."""
    n = 7
    chain = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    few, whole = (
        so.System(np.eye(n), 0.05 * chain, chain, [so.CubicSpring(0, 1.0), *more])
        for more in ([], [so.CubicSpring(i, 1e-300) for i in range(1, n)])
    )
    curves = [so.nonlinear_mode(one, mode=2, amplitude=(0.05, 0.5), harmonics=7, damped=damped) for one in (few, whole)]
    assert [curve.orbits[0].balance.size for curve in curves] == [1, n]
    for name in ("omega", "energy", "action", "modal_amplitude", "damping_ratio"):
        one, other = (getattr(curve, name)[-1] for curve in curves)
        assert one == pytest.approx(other, rel=1e-8, abs=1e-12), name
    loads = [curve.forcing(0, system=system)[-1] for curve, system in zip(curves, (few, whole), strict=True)]
    assert loads[0] == pytest.approx(loads[1], rel=1e-8)
    if damped:
        assert loads[1] == pytest.approx(curves[1].forcing(0)[-1], rel=1e-8)


def test_a_damped_mode_moves_where_no_force_acts(tmp_path):
    """With `-2 zeta omega` per unit of mass the equations hold at all masses, also of a mode read from a file."""
    n = 6
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    system = so.System(np.eye(n), 0.1 * stiffness, stiffness, [so.CubicSpring(0, 1.0)])
    mode = so.nonlinear_mode(system, amplitude=(0.1, 1.0), damped=True, harmonics=7, observe=n - 1)
    mode.save(tmp_path / "mode.nc")
    for read in (mode, so.load(tmp_path / "mode.nc")):
        for i in (len(read) // 2, len(read) - 1):
            orbit, zeta = read.orbits[i], read.damping_ratio[i]
            fed = system.damping.value({}) - 2.0 * zeta * orbit.omega * np.eye(n)
            for k, c in enumerate(orbit.amplitudes):
                w = k * orbit.omega
                force = (stiffness - w**2 * np.eye(n) + 1j * w * fed) @ c
                assert np.abs(force[1:]).max() < 1e-10
        assert read.amplitude[-1] == pytest.approx(1.0, rel=1e-10)


def test_saved_and_read_again(tongue, tmp_path):
    tongue.save(tmp_path / "tongue.nc")
    again = so.load(tmp_path / "tongue.nc")
    assert type(again) is type(tongue)
    for name in ("omega", "energy", "action", "damping_ratio", "stable"):
        assert np.array_equal(getattr(again, name), getattr(tongue, name))
    assert [b.kind for b in again.bifurcations] == [b.kind for b in tongue.bifurcations]
    # what leaves one of its points is found from the file as well: the upper mode, though by symmetry two more
    # directions lead away there
    other = so.switch_branch(again.bifurcations["BP"][0])
    assert other.omega.min() < 1.2


def test_read_like_a_response(lower, tmp_path):
    assert "Nonlinear mode, conservative" in repr(lower)
    table = lower.to_dataframe(readings=["energy", "action"])
    assert table["energy"].to_numpy() == pytest.approx(lower.energy)
    assert lower.reading("modal_amplitude") == pytest.approx(lower.modal_amplitude)
    so.plot(lower, tmp_path / "mode.png", quantity="energy")
    so.plot([lower, lower], tmp_path / "modes.png")
    assert lower.to_xarray(readings=["energy"])["energy"].attrs["units"] == "energy"


def test_the_study_of_the_page(tmp_path):
    (analyses,) = blocks("nonlinear_modes.md", "toml")
    equations = "x'' + 2*x - y + 0.5*x**3 = 0", "y'' + 2*y - x = 0"
    path = tmp_path / "study.toml"
    path.write_text(f"[system]\nequations = {list(equations)}\n\n{analyses}", encoding="utf-8")
    mode, tongue = (step.result for step in run_study(read_study(path)).finished)
    assert mode.energy[[0, -1]] == pytest.approx([1e-3, 200.0])
    assert tongue.omega.max() == pytest.approx(1.396569, abs=1e-5)
    path.write_text(path.read_text(encoding="utf-8").replace("energy = [1e-3, 200.0]", "damped = true"))
    with pytest.raises(so.InputError, match="where does the mode end"):
        read_study(path)


VELOCITY = so.System.from_equations("x'' + 0.1*x'*abs(x') + x + x**3 = 0")
TIME = so.System.from_equations("x'' + 0.1*x*cos(omega*t) + x + x**3 = 0")


@pytest.mark.parametrize(
    ("system", "given", "words"),
    [
        (VELOCITY, {"amplitude": 1.0, "damped": False}, "depend on velocity"),
        (TIME, {"amplitude": 1.0}, "depends on time"),
        (two_masses(), {}, "where does the mode end"),
        (two_masses(), {"mode": 3, "amplitude": 1.0}, "has 2 modes"),
        (two_masses(), {"mode": 0, "amplitude": 1.0}, "positive whole number"),
        (two_masses(), {"amplitude": 1.0, "energy": 1.0}, "give one of them"),
        (two_masses(), {"amplitude": (1.0, 0.5)}, "from a smaller to a larger"),
        (two_masses(), {"amplitude": -1.0}, "from a smaller to a larger"),
        (two_masses(), {"omega": (1.2, 2.0)}, "outside of"),
        (so.System(1.0, 0.0, 1.0), {"omega": (0.5, 2.0)}, "this mode is linear"),
        (
            so.System(np.eye(2), np.zeros((2, 2)), [[2.0, -1.0], [1.0, 2.0]]),
            {"amplitude": 1.0, "damped": False},
            "symmetric",
        ),
        (so.System(1.0, 0.0, 1.0, [so.ElasticStop(0, 20.0, 0.0)]), {"amplitude": 1.0}, "corner at rest"),
        (two_masses(), {"amplitude": 1.0, "damped": "no"}, "damped must be"),
    ],
)
def test_wrong_use_is_refused_in_words(system, given, words):
    with pytest.raises(so.InputError, match=words):
        so.nonlinear_mode(system, **given)


def test_what_a_mode_is_not_good_for(lower):
    (crossing,) = lower.bifurcations["BP"]
    with pytest.raises(so.InputError, match="unknown parameter 'k'"):
        so.track(crossing, "k", (0.1, 1.0))
    with pytest.raises(so.InputError, match=r"so\.nonlinear_mode follows it"):
        so.track(lower.points[3], "k", (0.1, 1.0), onto="nonlinear_mode")
    with pytest.raises(so.InputError, match="has no damping"):
        lower.forcing()
    with pytest.raises(so.InputError, match="degrees of freedom"):
        lower.forcing(system=so.System(1.0, 0.1, 1.0))
    with pytest.raises(so.InputError, match="direction of a load"):
        lower.forcing([1.0, 0.0, 0.0], system=two_masses(0.01))


@pytest.mark.slow
def test_the_page_says_what_it_prints(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_prints("nonlinear_modes.md", capsys)


def test_motions_of_modes_against_shooting(tmp_path):
    stiffness = np.array([[2.0, -1.0], [-1.0, 2.0]])
    spring = [so.CubicSpring(0, 0.5)]
    mode = so.nonlinear_mode(so.System(np.eye(2), np.zeros((2, 2)), stiffness, spring), mode=1, amplitude=(0.01, 3.0))
    for item in (mode.points[len(mode) // 2], mode.points[-1], mode.bifurcations["BP"][0]):
        assert so.verify(item).agrees
    so.plot(mode, tmp_path / "mode.png", quantity="energy")
    damped = so.nonlinear_mode(so.System(np.eye(2), 0.02 * stiffness, stiffness, spring), mode=1, amplitude=(0.01, 1.0))
    with pytest.raises(so.InputError, match="the motion of no system that stands by itself"):
        so.verify(damped.points[-1])
    assert not so.stability(damped.points[-1]).applicable


def test_an_observed_degree_of_freedom_that_rests_in_the_mode():
    stiffness = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
    system = so.System(np.eye(3), np.zeros((3, 3)), stiffness, [so.CubicSpring(i, 1.0) for i in range(3)], [], {})
    with pytest.raises(so.InputError, match="rests in this mode"):
        so.nonlinear_mode(system, mode=2, amplitude=1.0, observe=1)
    assert len(so.nonlinear_mode(system, mode=2, amplitude=0.1, observe=0)) > 2


@pytest.mark.parametrize("n", [30, 60])
def test_a_damped_mode_whose_spring_moves_little(n):
    """Beside a wall, a hundredth of what moves elsewhere: what damping does there is nothing small to first order."""
    stiffness = (n / 3.0) ** 2 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    system = so.System(np.eye(n), 0.02 * np.eye(n) + 0.001 * stiffness, stiffness, [so.CubicSpring(n - 1, 1.0)])
    mode = so.nonlinear_mode(system, mode=1, amplitude=(0.01, 0.3))
    w = 2.0 * n / 3.0 * np.sin(0.5 * np.pi / (n + 1))
    assert mode.omega[0] == pytest.approx(w, rel=1e-5)
    assert mode.damping_ratio[0] == pytest.approx(0.01 / w + 0.0005 * w, rel=1e-4)
    free = so.nonlinear_mode(system, mode=1, amplitude=(0.01, 0.3), damped=False)
    assert mode.omega[-1] == pytest.approx(free.omega[-1], rel=1e-6)


def test_a_page_takes_the_multipliers_of_a_conserved_energy_for_what_they_are():
    """Energy and phase make two multipliers +1, and pairs of the others stay on the unit circle: no verdict is open."""
    system = so.System(np.eye(2), np.zeros((2, 2)), [[2.0, -1.0], [-1.0, 2.0]], [so.CubicSpring(0, 0.5)])
    for mode in (1, 2):
        curve = so.nonlinear_mode(system, mode=mode, amplitude=(0.05, 0.8))
        assert (np.abs(np.abs(curve.multipliers) - 1.0) <= curve.multiplier_errors).any(axis=1).all()
        assert not curve.multiplier_open.any()
        assert not notes_on(curve.to_xarray())
