"""Period doublings of nonlinear modes in a second parameter: Mathieu's equation, shooting, modes computed anew."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import mathieu_b

import suboctave as so
from suboctave.results.modes import ModeCurve

TIGHT = {
    "harmonics": so.AdaptiveHarmonics(tolerance=1e-11, event_tolerance=1e-11),
    "newton": so.NewtonOptions(tolerance=1e-12),
}


def shaking(c=4.2, e=0.0, **more):
    """y shakes the stiffness of x; x = 0 is invariant, and the mode of y a family of its own."""
    equations = ["x'' + x + 2*x*y + 0.3*x**3 = 0", "y'' + c*y + x**2 + e*y**3 = 0"]
    return so.System.from_equations(equations, {"c": c, "e": e, **more})


def doubling(system, **options):
    return so.nonlinear_mode(system, mode=2, amplitude=0.3, observe=1, **options).bifurcations["PD"][0]


def chain(whole=False, n=8, **parameters):
    """Masses on springs, the first one on a spring with quadratic and cubic parts; its second mode has about twice the
    frequency of the first one.
    """
    springs = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    masses, stiffness = np.eye(n).tolist(), springs.tolist()
    masses[0][0], stiffness[0][0] = "m", "2 + k"
    laws = [so.PolynomialSpring(0, {2: "a", 3: 0.5})]
    laws += [so.CubicSpring(i, 1e-300) for i in range(1, n)] if whole else []
    known = {"m": 1.0, "k": 0.0, "a": 0.5, **parameters}
    return so.System(masses, np.zeros((n, n)), stiffness, laws, parameters=known)


def of_chain(system):
    return so.nonlinear_mode(system, mode=2, amplitude=(0.05, 0.75), harmonics=5).bifurcations["PD"][0]


@cache
def of_the_chain(whole=False):
    """Of the chain as it is, with one unknown or with all of them."""
    return of_chain(chain(whole))


@pytest.fixture(scope="module")
def tongue():
    """Over the spring's quadratic part, which has a minimum along it."""
    return so.track(of_the_chain(), "a", (0.43, 0.6))


def test_the_tongue_of_mathieu():
    """Of y = A cos(omega t), omega^2 = c: x'' + (1 + 2 y) x = 0 has the multipliers -1, -1 on b_1."""
    curve = so.track(doubling(shaking(), **TIGHT), "c", (3.8, 5.5), **TIGHT)
    assert isinstance(curve, ModeCurve)
    assert (curve.kind, curve.names) == ("PD", ("omega", "c"))
    c, size = curve.parameter("c"), curve.amplitude
    assert c[-1] == pytest.approx(5.5, rel=1e-12)
    assert np.abs(mathieu_b(1, 4.0 * size / c) - 4.0 / c).max() < 1e-9
    assert curve.omega == pytest.approx(np.sqrt(c), rel=1e-12)
    assert np.abs(curve.damping_ratio).max() < 1e-12
    assert curve.stable.all()
    # at c = 4 nothing is left of the motion
    assert "the oscillation vanishes" in curve.ended
    assert c[0] == pytest.approx(4.0, abs=1e-3)
    # two multipliers are -1 all along: no 1:2 resonance
    assert not curve.bifurcations


def monodromy(orbit, c, e):
    """Of `shaking` from the state of a motion at t = 0."""

    def rates(t, z):
        (x, y, u, v), rest = z[:4], z[4:].reshape(4, 4)
        force = [-x - 2.0 * x * y - 0.3 * x**3, -c * y - x**2 - e * y**3]
        slope = np.zeros((4, 4))
        slope[0, 2] = slope[1, 3] = 1.0
        slope[2, :2] = -1.0 - 2.0 * y - 0.9 * x**2, -2.0 * x
        slope[3, :2] = -2.0 * x, -c - 3.0 * e * y**2
        return np.concatenate(([u, v, *force], (slope @ rest).ravel()))

    start = np.concatenate((orbit.displacement(0.0), orbit.velocity(0.0), np.eye(4).ravel()))
    end = solve_ivp(rates, (0.0, orbit.period), start, rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]
    return end[:4] - start[:4], end[4:].reshape(4, 4)


def test_against_shooting_and_modes_computed_anew():
    curve = so.track(doubling(shaking(e=0.5), **TIGHT), "e", (-1.0, 3.0), **TIGHT)
    for i in (0, len(curve) // 2, -1):
        e, orbit = curve.parameter("e")[i], curve.orbits[i]
        missed, matrix = monodromy(orbit, 4.2, e)
        assert np.abs(missed).max() < 1e-9
        # (mu - 1)^2 (mu + 1)^2
        assert np.poly(matrix) == pytest.approx([1.0, 0.0, -2.0, 0.0, 1.0], abs=1e-8)
        there = doubling(shaking(e=e), **TIGHT)
        assert curve.omega[i] == pytest.approx(there.omega, rel=1e-8)
        assert curve.amplitude[i] == pytest.approx(there.amplitude, rel=1e-8)
    assert so.verify(curve, points=3).agrees


def test_a_scaled_motion_is_the_same():
    """Quadratic laws as s and cubic ones as s^2: the amplitude runs as 1 / s, omega stays."""
    equations = ["x'' + x + 2*s*x*y + 0.3*s**2*x**3 = 0", "y'' + 4.2*y + s*x**2 + 0.5*s**2*y**3 = 0"]
    curve = so.track(doubling(so.System.from_equations(equations, {"s": 1.0}), **TIGHT), "s", (0.5, 2.0), **TIGHT)
    s = curve.parameter("s")
    assert s[[0, -1]] == pytest.approx([0.5, 2.0])
    assert curve.amplitude * s == pytest.approx(np.full(len(s), curve.amplitude[0] * s[0]), rel=1e-9)
    assert curve.omega == pytest.approx(np.full(len(s), curve.omega[0]), rel=1e-11)
    assert not curve.bifurcations


@pytest.mark.parametrize(
    ("name", "bounds"),
    [
        ("a", (0.49, 0.51)),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in (("m", (0.98, 1.02)), ("k", (-0.02, 0.02)))),
    ],
)
def test_a_condensed_structure(name, bounds):
    """Of the chain only the nonlinear mass is an unknown: the same curve as with all of them, and as anew."""
    curves = [so.track(of_the_chain(whole), name, bounds) for whole in (False, True)]
    assert [curve.orbits[0].balance.size for curve in curves] == [1, 8]
    for i in (0, -1):
        one, other = (curve.points[i].orbit for curve in curves)
        assert one.omega == pytest.approx(other.omega, rel=1e-9)
        there = of_chain(chain(**{name: curves[0].parameter(name)[i]}))
        assert one.omega == pytest.approx(there.omega, rel=1e-8)
        assert curves[0].amplitude[i] == pytest.approx(there.amplitude, rel=1e-8)
    ways = curves[0].parameter(name) - chain().parameters[name]
    slopes = np.gradient(curves[0].omega, curves[0].parameter(name))
    slope = np.interp(0.0, *(v[np.argsort(ways)] for v in (ways, slopes)))
    assert so.sensitivity(of_the_chain(), by=name)[name]["omega"] == pytest.approx(slope, rel=1e-2)


def test_its_extremum_in_a_third_parameter(tongue):
    """At the least quadratic part two doublings of a mode meet."""
    (turn,) = tongue.extrema
    assert (turn.parameter_name, turn.extreme) == ("a", "minimum")
    low, high = (so.nonlinear_mode(chain(a=turn.parameters["a"] + s), mode=2, amplitude=(0.4, 0.9), harmonics=7)
                 for s in (-1e-4, 1e-4))  # fmt: skip
    assert [len(mode.bifurcations["PD"]) for mode in (low, high)] == [0, 2]
    turns = so.track(turn, "k", (-0.02, 0.02))
    assert (turns.turning, turns.kind) == ("a", "PD")
    k, a = turns.parameter("k")[-1], turns.parameter("a")[-1]
    there = so.track(of_chain(chain(k=k)), "a", (0.43, 0.6)).extrema[0]
    assert a == pytest.approx(there.parameters["a"], rel=1e-9)
    slope, rates = so.sensitivity(turn, by="k"), np.gradient(turns.parameter("a"), turns.parameter("k"))
    assert slope["k"]["a"] == pytest.approx(rates[len(turns) // 2], rel=0.05)


def test_saved_drawn_and_verified(tongue, tmp_path):
    tongue.save(tmp_path / "tongue.nc")
    again = so.load(tmp_path / "tongue.nc")
    assert type(again) is ModeCurve
    assert repr(again) == repr(tongue)
    np.testing.assert_array_equal(again.energy, tongue.energy)
    so.plot(again, tmp_path / "tongue.png")
    turns = so.track(again.extrema[0], "k", (-0.01, 0.01))
    assert turns.parameter("k")[[0, -1]] == pytest.approx([-0.01, 0.01])


def test_a_fold_flip():
    """The tongue of a third mass, at rest like x: a second pair reaches +1, by shooting of its Hill's equation."""
    third = "z'' + s*z + k*z*y = 0"
    equations = ["x'' + x + 2*x*y = 0", "y'' + 4.2*y + x**2 + 0.5*y**3 + 0.5*k*z**2 = 0", third]
    system = so.System.from_equations(equations, {"s": 4.3, "k": 1.0})
    curve = so.track(doubling(system), "s", (4.0, 4.4))
    events = curve.bifurcations["LPPD"]
    assert len(events) == 2
    for event in events:
        orbit, s = event.orbit, event.parameters["s"]

        def rates(t, z, orbit=orbit, s=s):
            y = orbit.displacement(t)[1]
            return np.concatenate((z[2:], -(s + y) * z[:2]))

        end = solve_ivp(rates, (0.0, orbit.period), [1.0, 0.0, 0.0, 1.0], rtol=1e-11, atol=1e-12).y[:, -1]
        assert end[0] + end[3] == pytest.approx(2.0, abs=1e-8)
    with pytest.raises(so.InputError, match="one of nonlinear modes: no curve is entered from it"):
        so.track(events[0], "s", (4.0, 4.4))
