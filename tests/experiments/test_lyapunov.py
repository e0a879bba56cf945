"""Lyapunov exponents, against multipliers by shooting, closed forms, identities and a published study."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.experiments.common import check_continuous
from suboctave.experiments.lyapunov import averaged
from suboctave.timedomain import integrate, shoot

CHAOTIC = so.library.reference_oscillator(p=1.6, Kc=4.2, j=0.0)


def test_periodic_motions_have_the_logarithms_of_their_multipliers():
    system = so.library.duffing(c=0.1, alpha=1.0, F=0.3)
    for state in ([0.0, 0.0], [1.5, 0.0]):
        found = so.lyapunov_exponents(system, start=state, omega=1.5, periods=400, trajectories=8)
        motion = shoot(system, found.end, 1.5)
        expected = np.sort(np.log(np.abs(motion.multipliers)) / motion.period)[::-1]
        assert np.abs(found.exponents - expected).max() < 1e-6
        assert found.smooth
        assert found.chaotic is False
        assert found.dimension == 0.0


def test_sum_is_the_mean_rate_of_volume_of_nonlinear_dampers():
    """With a damper `d x' |x'|` the rate of volume is the mean of `-(c + 2 d |x'|) / m`, from the trajectory itself."""
    system = so.System(
        2.0, 0.05, 1.0, elements=[so.QuadraticDamper(0, 0.4), so.CubicSpring(0, 0.3)],
        loads=[so.HarmonicLoad(0, amplitude=1.0)],
    )  # fmt: skip
    found = so.lyapunov_exponents(system, omega=0.9, periods=60, trajectories=2)
    period = 2.0 * np.pi / 0.9
    motion = integrate(system, found.end, (0.0, period), 0.9)
    _, velocity = motion.at(period * np.arange(4000) / 4000)
    expected = -np.mean(0.05 + 2.0 * 0.4 * np.abs(velocity)) / 2.0
    assert found.divergence == pytest.approx(expected, abs=1e-7)
    assert found.defect < 1e-9


def test_chaos_with_exact_corners():
    found = so.lyapunov_exponents(CHAOTIC, omega=2.6, periods=250, transient=100)
    assert found.chaotic
    assert found.exponents.sum() == pytest.approx(-2.0 * 0.03, abs=1e-9)  # -trace of the damping, x'' + 2 zeta x'
    assert 1.0 < found.dimension < 2.0
    assert 0.001 < found.standard_errors[0] < 0.01
    leading = so.lyapunov_exponents(CHAOTIC, omega=2.6, periods=250, transient=100, count=1)
    assert leading.exponents.shape == (1,)
    assert abs(leading.exponents[0] - found.exponents[0]) < 1e-9
    assert np.isnan(leading.defect)
    assert set(found.to_xarray().dims) >= {"exponent", "trajectory", "stretch", "period"}
    assert len(found.to_dataframe()) == 2


def test_quasi_periodic_motion_has_a_zero_exponent():
    """Two uncoupled oscillators, one with van der Pol's damping, the other one loaded: one exponent vanishes."""
    system = so.System(
        np.eye(2), np.diag([0.0, 0.2]), np.diag([1.0, 3.0]),
        elements=[so.Expression(0, "0.3*(x**2 - 1)*x'")],
        loads=[so.HarmonicLoad(1, amplitude=1.0)],
    )  # fmt: skip
    found = so.lyapunov_exponents(
        system, start=[1.0, 0.0, 0.0, 0.0], omega=1.3, periods=600, transient=200, trajectories=8
    )
    assert abs(found.exponents[0]) < 1e-5
    assert np.abs(found.exponents[1:3] + 0.1).max() < 1e-5  # of x'' + 0.2 x' + 3 x
    assert found.chaotic is False


def test_standard_errors_are_those_of_the_mean():
    """Of independent normal numbers: sigma / sqrt(N) for equal weights."""
    rates = np.random.default_rng(0).normal(size=(64, 200, 3))
    smooth, mean, error, stretches = averaged(rates)
    assert not smooth
    assert np.abs(error * np.sqrt(64 * 200) - 1.0).max() < 0.25
    assert np.abs(mean).max() < 4.0 * error.max()
    assert stretches.shape == (256, 3)


def test_two_trajectories():
    how = so.TwoTrajectories(steps_per_period=tuple(range(300, 400, 10)), periods=200)
    found = so.lyapunov_exponents(CHAOTIC, omega=2.6, method=how)
    # a single value of this method is good to a seventh: Alcorta et al. 2019 give 0.1918 for a case like this
    assert abs(found.exponent - 0.136) < 3.0 * found.spread / np.sqrt(10) + 0.01
    assert 0.005 < found.spread < 0.05
    assert found.to_xarray()["distance"].sizes == {"setting": 10, "time": 201}
    steady = so.lyapunov_exponents(so.library.duffing(c=0.1, F=0.3), omega=1.5, method=how)
    assert np.isnan(steady.exponent)


def test_map_agrees_with_single_points():
    chart = so.lyapunov_map(
        CHAOTIC, (2.2, 2.6), "p", (0.3, 1.6), grid=(2, 2), periods=160, transient=100, tolerance=1e-9
    )
    assert chart.chaotic.tolist() == [[False, False], [False, True]]
    motion = shoot(CHAOTIC, so.integrate(CHAOTIC, omega=2.2, periods=1, transient=300, parameters={"p": 0.3}).end, 2.2,
                   values={"p": 0.3})  # fmt: skip
    assert chart.exponent[0, 0] == pytest.approx(np.log(np.abs(motion.multipliers[0])) / motion.period, abs=2e-3)
    alone = so.lyapunov_map(
        CHAOTIC, (2.2, 2.6), "p", (0.3, 1.6), grid=(2, 2), periods=160, transient=100, tolerance=1e-9,
        workers=1,
    )  # fmt: skip
    assert np.array_equal(chart.exponent, alone.exponent)


def test_a_force_that_jumps_is_refused():
    def system(law):
        return so.System(1.0, 0.1, 1.0, elements=[so.Callable(0, law)], loads=[so.HarmonicLoad(0, amplitude=1.0)])

    with pytest.raises(InputError, match=r"jumps by 0\.6"):
        check_continuous(system(lambda x, v: 0.3 * np.sign(x - 0.1)), np.zeros(2), 1.0, {})
    check_continuous(system(lambda x, v: 0.3 * np.tanh(1e4 * x)), np.zeros(2), 1.0, {})
    check_continuous(system(lambda x, v: 5.0 * np.maximum(x - 0.3, 0.0)), np.zeros(2), 1.0, {})


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"omega": 2.6, "count": 3}, "2 exponents"),
        ({"omega": 2.6, "method": "variation"}, "variational"),
        ({"omega": -1.0}, "omega"),
        ({"omega": 2.6, "periods": 0}, "periods"),
        ({"omega": 2.6, "parameters": {"pp": 1.0}}, "'p'"),
    ],
)
def test_mistakes(options, said):
    with pytest.raises(InputError, match=said):
        so.lyapunov_exponents(CHAOTIC, **options)


def test_mistakes_of_maps():
    for options, said in (
        ({"omega": (2.0, 3.0), "parameter": "q", "bounds": (1.0, 2.0)}, "no parameter"),
        ({"omega": (2.0, 3.0), "parameter": "p", "bounds": (1.0, 2.0), "grid": 5}, "grid"),
        ({"omega": (2.0, 3.0), "parameter": "p", "bounds": (1.0, 2.0), "parameters": {"p": 1.0}}, "fixes p"),
    ):
        with pytest.raises(InputError, match=said):
            so.lyapunov_map(CHAOTIC, **options)


@pytest.mark.slow
def test_published_case():
    """Alcorta et al. 2019, Fig. 13, with the regularised law: 0.136 +- 0.0003 by a program of its own."""
    system = so.library.reference_oscillator(p=1.6, Kc=4.2, j=0.0, regularization=3000.0)
    found = so.lyapunov_exponents(system, omega=2.6, periods=12000)
    assert found.standard_errors[0] < 6e-4
    assert abs(found.exponents[0] - 0.136) < 3.0 * np.hypot(found.standard_errors[0], 3e-4)
