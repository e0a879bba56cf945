"""Shooting and the location of bifurcations, against closed forms, published numbers and earlier shooting.

The numbers of the reference oscillator (zeta = 0.03, alpha = 0.16, Kc = 4.7; `s` = 3000 is the arctan law, `None` the
exact one) were obtained before this package by other shooting programs: DOP853, variational equations, contact instants
as events for the exact law; positions to about 5e-9, amplitudes to 5e-8. No harmonic balance is behind them.
Starts are the solutions rounded to three digits and moved by about 1e-3 in omega.
"""

import numpy as np
import pytest
from scipy.linalg import expm

import suboctave as so
from suboctave.errors import ConvergenceError, InputError
from suboctave.timedomain import integrate, locate_by_shooting, shoot


def follow(system, state, omegas, periods=1):
    """State of the motion at the last of some frequencies, each start being the motion before."""
    for omega in omegas:
        state = shoot(system, state, omega, periods).state
    return state


# ----------------------------------------------------------------------------------------------------- shooting
def test_linear_system_has_its_closed_form():
    """Amplitude from the complex dynamic stiffness, monodromy from the matrix exponential; one Newton step."""
    rng = np.random.default_rng(3)
    mass = np.array([[2.0, 0.3], [0.3, 1.0]])
    damping = 0.2 * np.eye(2) + 0.05 * rng.standard_normal((2, 2))
    stiffness = np.array([[3.0, -1.4], [-0.6, 2.0]])
    omega, force = 1.1, np.array([1.0, 0.0])
    system = so.System(mass, damping, stiffness, loads=[so.HarmonicLoad(dof=0, amplitude=1.0)])
    solution = shoot(system, np.zeros(4), omega, observe=1)
    x = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping, force)
    assert solution.state == pytest.approx(np.concatenate([x.real, (1j * omega * x).real]), abs=1e-10)
    assert solution.amplitude == pytest.approx(abs(x[1]), rel=1e-11)
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]])
    assert np.allclose(solution.monodromy, expm(a * solution.period), atol=1e-10)
    assert solution.iterations <= 2
    assert solution.stable


def test_multipliers_of_the_reference_oscillator():
    """At omega = 3 the T motion has lost its stability by a period doubling; the 2T motion around it has not."""
    system = so.library.reference_oscillator(p=0.55, j=0.0, regularization=3000.0)
    transient = integrate(system, [0.0, 0.0], (0.0, 40 * 2 * np.pi / 3.0), 3.0, rtol=1e-8)
    single = shoot(system, transient.end, 3.0)
    assert single.multipliers == pytest.approx([-2.204151, -0.400114], abs=1e-6)
    assert not single.stable
    double = shoot(system, transient.end, 3.0, periods=2)
    assert double.stable
    assert double.amplitude > 2 * single.amplitude
    # Liouville: with constant damping the product of the multipliers is exp(-2 zeta T)
    for solution in (single, double):
        assert np.prod(solution.multipliers).real == pytest.approx(np.exp(-0.06 * solution.period), rel=1e-10)


def test_amplitude_is_not_the_largest_sample():
    """max |x| of a motion with two harmonics, against a fine scan of the closed form with a parabola at its top."""
    loads = [so.HarmonicLoad(dof=0, amplitude=1.0), so.HarmonicLoad(dof=0, amplitude=2.0, harmonic=2, phase=0.4)]
    system = so.System(1.0, 0.2, 4.0, loads=loads)
    omega = 1.6
    t = np.linspace(0.0, 2 * np.pi / omega, 200001)
    response = sum(
        np.real(a * np.exp(1j * (q * omega * t + f)) / (4.0 - (q * omega) ** 2 + 0.2j * q * omega))
        for a, q, f in [(1.0, 1, 0.0), (2.0, 2, 0.4)]
    )
    assert shoot(system, [0.0, 0.0], omega).amplitude == pytest.approx(np.max(np.abs(response)), rel=1e-9)


def test_newton_from_rest_with_a_stop_closed_at_rest():
    """At j = 0 the rest state is the kink of the law itself."""
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    for omega in (1.3, 2.6, 4.2):
        solution = shoot(system, [0.0, 0.0], omega)
        assert solution.residual < 1e-11
        there = integrate(system, solution.state, (0.0, solution.period), omega)
        assert there.end == pytest.approx(solution.state, abs=1e-10)


def test_values_replace_parameters():
    system = so.library.reference_oscillator(p=0.1, j=0.0)
    direct = shoot(system.with_parameters(p=0.55), [0.0, 0.0], 4.2)
    replaced = shoot(system, [0.0, 0.0], 4.2, values={"p": 0.55})
    assert np.array_equal(direct.state, replaced.state)
    assert replaced.parameters["p"] == 0.55


# ------------------------------------------------------------------------------------------------- bifurcations
# s, p, j, periods, kind, start omega, start state, omega, max |x|
REFERENCE = [
    (3000.0, 0.55, 0.0, 1, "PD", 3.994, (-0.0581, 0.00261), 3.99345233, 0.0580622),
    (3000.0, 0.55, 0.0, 1, "PD", 2.304, (-0.243, 0.0141), 2.30315297, 0.2430141),
    (3000.0, 0.55, 0.0, 1, "LP", 1.710, (-0.997, 0.130), 1.70914371, 1.0020314),
    (3000.0, 0.55, 0.0, 1, "LP", 2.547, (-0.352, 8.63), 2.54593318, 3.9242705),
    (3000.0, 0.55, 0.0, 2, "LP", 2.947, (-0.481, -0.539), 2.94603063, 0.6191226),
    (3000.0, 0.55, 0.0, 2, "LP", 3.141, (0.201, 1.0), 3.14017686, 1.1492176),
    (3000.0, 1.7, 0.0, 1, "LP", 3.593, (-0.158, 25.9), 3.59219111, 8.1893134),
    (3000.0, 0.55, 1.0, 1, "LP", 1.292, (-0.991, 0.186), 1.29137366, 1.0012975),
    (None, 0.55, 0.0, 1, "LP", 1.708, (-0.997, 0.129), 1.70709593, 1.0019527),
    (None, 0.55, 0.0, 1, "LP", 2.547, (-0.353, 8.63), 2.54594067, 3.9248774),
    (None, 0.55, 0.0, 1, "PD", 2.295, (-0.246, 0.0142), 2.2937534169, None),
    (None, 0.55, 0.0, 1, "PD", 3.971, (-0.0595, 0.00262), 3.9697105128, None),
]


#: the sharp arctan law takes longest to integrate
SHARP = [row for row in REFERENCE if row[0] and row[4] == "LP"]


@pytest.mark.parametrize(
    ("s", "p", "j", "periods", "kind", "start", "state", "omega", "amplitude"),
    [pytest.param(*row, marks=[pytest.mark.slow] if row in SHARP else []) for row in REFERENCE],
)
def test_reference_bifurcations(s, p, j, periods, kind, start, state, omega, amplitude):
    system = so.library.reference_oscillator(p=p, j=j, regularization=s)
    found = locate_by_shooting(system, kind, state, start, periods)
    digits = 6e-9 if s else (3e-9 if kind == "LP" else 2e-10)  # what the number is given to
    assert found.omega == pytest.approx(omega, abs=digits)
    critical = -1.0 if kind == "PD" else 1.0
    assert np.min(np.abs(found.multipliers - critical)) < 1e-5
    if amplitude is not None:
        assert found.amplitude == pytest.approx(amplitude, abs=6e-8)


@pytest.mark.parametrize(
    ("start", "omega", "from_omega"), [(1.11, 1.1096, 0.9), pytest.param(1.196, 1.1956, 0.9, marks=pytest.mark.slow)]
)
def test_neimark_sacker_of_the_nltva(start, omega, from_omega):
    """Detroux et al.'s absorber at F = 0.11; positions from harmonic balance, which agrees for H = 5, 7, 9."""
    system = so.library.nltva(F=0.11)
    state = follow(system, np.zeros(4), np.linspace(from_omega, start, 8))
    found = locate_by_shooting(system, "NS", state, start)
    assert found.omega == pytest.approx(omega, abs=5e-5)
    pair = found.multipliers[np.abs(found.multipliers.imag) > 0.1][0]
    assert abs(pair) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("start", "omega"), [(0.700, 0.695242), (0.737, 0.735569)])
def test_symmetry_breaking_of_a_duffing_oscillator(start, omega):
    """m = k = 1, c = 0.05, F = 1, cubic 1; positions from harmonic balance. The motion found is the symmetric one."""
    system = so.library.duffing(c=0.05, k=1.0, alpha=1.0, F=1.0)
    state = follow(system, [0.953, 0.0], [0.70] if start == 0.7 else [0.70, 0.72, 0.737])
    found = locate_by_shooting(system, "BP", state, start)
    assert found.omega == pytest.approx(omega, abs=6e-7)
    half, _ = integrate(system, found.state, (0.0, found.period / 2), found.omega).at([found.period / 2])
    assert half[0, 0] == pytest.approx(-found.state[0], abs=1e-7)


def test_a_limit_point_is_no_branch_point():
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    with pytest.raises(ConvergenceError):
        locate_by_shooting(system, "BP", [-0.353, 8.63], 2.547, max_iterations=6)


def test_limit_points_of_a_softening_duffing_oscillator():
    """m = 1, c = 0.12, k = 1, cubic -0.1, F = 0.2; positions from harmonic balance. The response bends to the left."""
    system = so.library.duffing(c=0.12, k=1.0, alpha=-0.1, F=0.2)
    small = follow(system, [0.0, 0.0], [0.8, 0.87])
    large = follow(system, [0.0, 0.0], [1.0, 0.9, 0.84])
    assert locate_by_shooting(system, "LP", small, 0.87).omega == pytest.approx(0.873547, abs=6e-7)
    assert locate_by_shooting(system, "LP", large, 0.84).omega == pytest.approx(0.836157, abs=6e-7)


@pytest.mark.parametrize(("length", "time"), [(1e-6, 1e3)])
@pytest.mark.parametrize("kind", ["PD", "LP"])
def test_other_units_give_the_same_bifurcation(kind, length, time):
    state, omega = ((-0.246, 0.0142), 2.295) if kind == "PD" else ((-0.997, 0.129), 1.708)

    def found(length, time):
        system = so.System(
            1.0,
            0.06 / time,
            1.0 / time**2,
            [
                so.CubicSpring(0, 0.16 / (length * time) ** 2),
                so.ElasticStop(0, 4.7 / time**2, 0.0),
                so.ElasticStop(0, 4.7 / time**2, -length),
            ],
            [so.HarmonicLoad(0, 0.55 * length / time**2)],
        )
        return locate_by_shooting(system, kind, np.array(state) * [length, length / time], omega / time)

    plain, other = found(1.0, 1.0), found(length, time)
    assert other.omega * time == pytest.approx(plain.omega, rel=1e-11)
    assert other.amplitude / length == pytest.approx(plain.amplitude, rel=1e-8)
    assert other.multipliers == pytest.approx(plain.multipliers, abs=1e-5)


def test_exchanged_degrees_of_freedom_give_the_same_bifurcation():
    """A chain of two masses with a stop on the second, its DOFs numbered either way."""

    def found(order):
        i, j = order
        mass, stiffness = np.zeros((2, 2)), np.zeros((2, 2))
        mass[i, i], mass[j, j] = 1.0, 0.4
        stiffness[i, i], stiffness[j, j], stiffness[i, j], stiffness[j, i] = 2.0, 1.0, -1.0, -1.0
        system = so.System(
            mass,
            0.03 * stiffness + 0.01 * mass,
            stiffness,
            [so.ElasticStop(dof=j, stiffness=6.0, gap=0.0)],
            [so.HarmonicLoad(dof=i, amplitude=1.0)],
        )
        state = np.zeros(4)
        start = follow(system, state, [4.0, 3.9, 3.8])
        solution = shoot(system, start, 3.8)
        return solution, solution.multipliers

    (first, mu), (second, nu) = found((0, 1)), found((1, 0))
    assert mu == pytest.approx(nu, abs=1e-9)
    assert first.state[[1, 0, 3, 2]] == pytest.approx(second.state, abs=1e-10)
    assert first.amplitude == pytest.approx(second.amplitude, rel=1e-10)


def test_wrong_input_is_refused_and_failure_says_what_to_change():
    system = so.library.reference_oscillator()
    with pytest.raises(InputError, match="did you mean 'LP'"):
        locate_by_shooting(system, "lp", [0.0, 0.0], 2.0)
    with pytest.raises(InputError, match="periods"):
        shoot(system, [0.0, 0.0], 2.0, periods=0)
    with pytest.raises(InputError, match="periods"):
        shoot(system, [0.0, 0.0], 2.0, periods=1.5)
    with pytest.raises(InputError, match="observe"):
        shoot(system, [0.0, 0.0], 2.0, observe=1)
    with pytest.raises(ConvergenceError, match="Start closer"):
        shoot(system.with_parameters(p=1.7), [3.0, 20.0], 3.5, max_iterations=1)
    with pytest.raises(ConvergenceError, match="no NS found"):
        locate_by_shooting(system.with_parameters(p=0.55, j=0.0), "NS", [-0.243, 0.0141], 2.304, max_iterations=5)
