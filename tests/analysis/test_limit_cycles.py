"""Limit cycles against expansions, averaging and shooting with free period; their bifurcations, followed further."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.continuation.problem import Array
from suboctave.curves.kinds.free_phase import FreePhaseOperator
from suboctave.curves.kinds.limit_cycle import LimitCycle
from suboctave.curves.motion import MotionProblem
from suboctave.curves.tracked.start import curve_through
from suboctave.pictures.tables import notes_on
from suboctave.timedomain import shoot_cycle

pytestmark = pytest.mark.filterwarnings("ignore::suboctave.NegativeDampingWarning")


def hopf_of(system, name, bounds):
    return so.equilibria(system, name, bounds).bifurcations["Hopf"][0]


def exact(orbit):
    return shoot_cycle(orbit.system, orbit.start(), orbit.omega, periods=orbit.basis.nu)


@pytest.fixture(scope="module")
def van_der_pol():
    """With x = sqrt(mu) y that of van der Pol, mu (y^2 - 1) y'."""
    system = so.System.from_equations("x'' + (x**2 - mu)*x' + x = 0", {"mu": 0.1})
    rule = so.AdaptiveHarmonics(tolerance=1e-9, event_tolerance=1e-10, maximum=255)
    return so.limit_cycles(hopf_of(system, "mu", (-0.5, 6.5)), bounds=(0.0, 6.0), harmonics=rule)


def test_the_period_of_van_der_pol(van_der_pol):
    mu, period = van_der_pol.parameter("mu"), 2.0 * np.pi / van_der_pol.omega
    small = (mu > 0.01) & (mu < 0.3)
    expansion = 1.0 + mu**2 / 16.0 - 5.0 * mu**4 / 3072.0
    # the next term of the expansion is of sixth order
    assert np.abs(period / (2.0 * np.pi) - expansion)[small].max() < 2e-3 * 0.3**6
    for i in [*np.flatnonzero(mu > 0.01)[::30], -1]:
        orbit = van_der_pol.orbits[i]
        shot = exact(orbit)
        assert orbit.omega == pytest.approx(shot.omega, rel=1e-8)
        if mu[i] < 5.0:
            assert orbit.amplitude(0) == pytest.approx(shot.amplitude, rel=1e-8)
    assert van_der_pol.stable.all()
    (end,) = van_der_pol.bifurcations["Hopf"]
    assert abs(end.parameters["mu"]) < 1e-12
    assert end.omega == pytest.approx(1.0, rel=1e-12)


def test_the_equations_by_differences():
    """Jacobians of cycles, and of their period doublings and Neimark-Sacker points, against those of residuals."""
    system = so.System.from_equations(
        ["x'' + (x**2 + 0.5*y**2 - mu)*x' + x + 0.1*x*y = 0", "y'' + (y**2 + 0.8*x**2 - m)*y' + 2.6*y + 0.1*y**2 = 0"],
        {"mu": 0.5, "m": 0.4},
    )
    rng = np.random.default_rng(5)
    basis = so.HarmonicBasis(3)
    x = rng.normal(size=(basis.size, 2)) * 0.4
    orbit = so.PeriodicOrbit(so.HarmonicBalance(system, basis), x, 1.1, dict(system.parameters), 0.0, 0.0, None)
    floquet = so.stability(orbit)
    from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent

    items = [Bifurcation("limit_cycle", orbit, floquet, 0.0, 0.0, "mu")]
    items += [
        TrackedEvent(kind, orbit, floquet, 0.0, 0.0, "mu", kappa=kappa, curve="limit_cycle", names=("omega", "mu"))
        for kind, kappa in (("PD", 0.0), ("NS", 0.31))
    ]
    for item, names in zip(items, (("omega", "mu"), ("omega", "mu", "m"), ("omega", "mu", "m")), strict=True):
        curve, u = curve_through(item, basis, names, {"mu": (0.0, 1.0), "m": (0.0, 1.0)})
        assert isinstance(curve.augmentation, LimitCycle if item.kind == "limit_cycle" else FreePhaseOperator)
        u = u + 1e-2 * rng.normal(size=len(u))
        np.testing.assert_allclose(curve.evaluate(u).jacobian, differences(curve, u), atol=2e-6)


def differences(curve: MotionProblem, u: Array) -> Array:
    columns = []
    for i in range(len(u)):
        step = np.zeros(len(u))
        step[i] = 1e-6
        columns.append((curve.evaluate(u + step).residual - curve.evaluate(u - step).residual) / 2e-6)
    return np.array(columns).T


@pytest.fixture(scope="module")
def rubbing():
    """Friction that falls, then grows with the speed: a subcritical Hopf point, and a limit point of cycles."""
    return so.System.from_equations("x'' + x - mu*x' - a*x'**3 + b*x'**5 = 0", {"mu": 0.0, "a": 0.1, "b": 0.1})


def test_the_limit_point_of_cycles_by_averaging_and_followed(rubbing):
    """Averaged, mu + 3/4 a A^2 - 5/8 b A^4 = 0: the fold at A^2 = 3 a / (5 b), mu = -9 a^2 / (40 b)."""
    cycles = so.limit_cycles(hopf_of(rubbing, "mu", (-0.1, 0.1)))
    (fold,) = cycles.bifurcations["LP"]
    assert fold.extreme == "minimum"
    assert fold.parameters["mu"] == pytest.approx(-0.0225, rel=1e-5)
    assert fold.amplitude == pytest.approx(np.sqrt(0.6), rel=1e-4)
    assert so.verify(fold).agrees
    # stable beyond the fold, unstable towards the Hopf point
    np.testing.assert_array_equal(cycles.stable, cycles.amplitude > fold.amplitude)
    border = so.track(fold, "a", (-0.05, 0.12))
    np.testing.assert_allclose(border.parameter("mu"), -2.25 * border.parameter("a") ** 2, atol=2e-5)
    assert border.plane == ("a", "mu")
    assert "generalised Hopf (Bautin)" in border.ended
    assert border.stable.all()
    again = so.sensitivity(fold, by=["a"])
    sides = [so.limit_cycles(hopf_of(rubbing.with_parameters(a=0.1 + s * 1e-5), "mu", (-0.1, 0.1))) for s in (1, -1)]
    ahead, behind = (side.bifurcations["LP"][0].parameters["mu"] for side in sides)
    assert again["a"]["mu"] == pytest.approx((ahead - behind) / 2e-5, rel=1e-6)


def test_a_torus_bifurcation_against_shooting_and_averaging():
    """A second oscillator whose damping the first one's cycle brings: NS where 0.8 <x^2> = m, about mu = m / 1.6."""
    system = so.System.from_equations(
        ["x'' + (x**2 + 0.5*y**2 - mu)*x' + x = 0", "y'' + (y**2 + 0.8*x**2 - m)*y' + 2.6*y + 0.1*y**3 = 0"],
        {"mu": 0.5, "m": 0.1},
    )
    cycles = so.limit_cycles(hopf_of(system, "mu", (-0.2, 0.3)))
    (torus,) = cycles.bifurcations["NS"]
    assert torus.parameters["mu"] == pytest.approx(0.1 / 1.6, rel=1e-3)
    pair = exact(torus.orbit).multipliers
    assert abs(abs(pair[np.abs(pair.imag) > 0.1][0]) - 1.0) < 1e-8
    assert so.verify(torus).agrees
    before = cycles.stable[cycles.parameter("mu") < torus.parameters["mu"]]
    assert not before.any()
    curve = so.track(torus, "m", (0.05, 0.2))
    for i in (0, -1):
        moduli = np.abs(exact(curve.orbits[i]).multipliers)
        assert np.sort(np.abs(moduli - 1.0))[2] < 1e-6  # the trivial one and the pair
    assert not any("Unsettled" in note for note in notes_on(curve.to_xarray()))
    assert curve.plane == ("mu", "m")


@pytest.fixture(scope="module")
def doubling():
    """The equations of Roessler with a little inertia in z."""
    system = so.System.from_equations(
        ["y'' - a*y' + y + z = 0", "eps*z'' + z' - b - z*(y' - a*y - c) = 0"],
        {"a": 0.2, "b": 0.2, "c": 2.0, "eps": 0.02},
    )
    cycles = so.limit_cycles(hopf_of(system, "a", (-0.2, 0.3)), bounds=(-0.2, 0.4))
    near = cycles.points[int(np.argmin(np.abs(cycles.parameter("a") - 0.2)))]
    return so.limit_cycles(near, bounds=(1.0, 4.0), parameter="c")


@pytest.fixture(scope="module")
def border(doubling):
    return so.track(doubling.bifurcations["PD"][0], "b", (0.15, 0.25))


def test_a_period_doubling_against_shooting_and_followed(doubling, border):
    (found,) = doubling.bifurcations["PD"]
    assert np.abs(exact(found.orbit).multipliers + 1.0).min() < 1e-8
    assert so.verify(found).agrees
    np.testing.assert_array_equal(doubling.stable, doubling.parameter("c") < found.parameters["c"])
    assert np.abs(exact(border.orbits[-1]).multipliers + 1.0).min() < 1e-6
    assert border.stable.all()
    for curve in (doubling, border):
        # the multiplier +1 of a free phase is known to be one: that its error reaches the circle says nothing
        assert (np.abs(curve.multipliers - 1.0).min(axis=1) <= curve.multiplier_errors.max(axis=1)).any()
        assert not any("Unsettled" in note for note in notes_on(curve.to_xarray()))


def test_all_amplitudes_at_a_hopf_point_without_nonlinear_forces():
    """mu (x^2 - 1) x': at mu = 0 every amplitude, and at 2 the cycles over mu cross."""
    system = so.System.from_equations("x'' + mu*(x**2 - 1)*x' + x = 0", {"mu": 0.1})
    cycles = so.limit_cycles(hopf_of(system, "mu", (-0.5, 0.5)))
    assert np.abs(cycles.parameter("mu")).max() < 1e-12
    (crossing,) = cycles.bifurcations["BP"]
    assert crossing.amplitude == pytest.approx(2.0, rel=1e-9)
    assert "grow without bound" in cycles.ended


BRANCHING = [
    "x'' + 0.087997*x' + 0.742297*x - mu*0.836891*x' + 1.080678*x**2*x' + 0.019262*x**3 + 0.425508*x**5"
    " - 0.234624*x**2*x'*mu - 0.322691*(y-x) + 0.087417*mu*y - 0.497071*(x-y)**3 = 0",
    "y'' + 0.034569*y' + 2.096762*y - mu*0.426615*y' + 0.804409*y**2*y' + 0.347905*y'**3 + 0.266271*(x-y) = 0",
]


def test_a_branch_point_that_asks_for_more_harmonics():
    """Where curves cross their own equations are singular: it is located again by others."""
    hopf = so.equilibria(so.System.from_equations(BRANCHING, {"mu": 0.0}), "mu", (-1.0, 2.0)).bifurcations["Hopf"][1]
    cycles = so.limit_cycles(hopf)
    (crossing,) = cycles.bifurcations["BP"]
    assert not cycles.warnings
    assert crossing.orbit.basis.harmonics > 19
    # that of 63 harmonics
    assert crossing.parameter("mu") == pytest.approx(1.0552731227, abs=1e-9)
    assert np.sort(np.abs(crossing.multipliers - 1.0))[1] < 1e-6


def test_nothing_is_suspected_where_cycles_shrink_to_rest():
    """Both parameters stand still there, and a second multiplier comes to +1."""
    text = "x'' + 0.097555*x' + 1.778399*x - mu*0.793927*x' + 1.227672*x**2*x' + 0.38996*x'**3 = 0"
    hopf = hopf_of(so.System.from_equations(text, {"mu": 0.0}), "mu", (-0.2, 0.4))
    cycles = so.limit_cycles(hopf)
    assert not cycles.warnings
    assert hopf.parameter("mu") == pytest.approx(cycles.bifurcations["Hopf"][0].parameter("mu"), abs=1e-9)


def test_from_a_response_to_a_small_load():
    system = so.System.from_equations("x'' + x + (x**2-mu)*x' = F*cos(omega*t)", {"mu": 0.5, "F": 0.05})
    response = so.frequency_response(system, (0.985, 1.03), start=[0.0, 1.4])
    point = response.points[int(np.argmax(response.amplitude))]
    cycles = so.limit_cycles(point, bounds=(0.1, 2.0), parameter="mu", unloaded=True)
    orbit = cycles.orbits[len(cycles) // 2]
    assert orbit.omega == pytest.approx(exact(orbit).omega, rel=1e-6)
    with pytest.raises(so.InputError, match="a load drives this system"):
        so.limit_cycles(point, bounds=(0.1, 2.0), parameter="mu")


def test_what_is_found_is_kept(tmp_path, doubling, border):
    doubling.save(tmp_path / "cycles.nc")
    again = so.load(tmp_path / "cycles.nc")
    assert repr(again) == repr(doubling)
    np.testing.assert_array_equal(again.stable, doubling.stable)
    border.save(tmp_path / "border.nc")
    assert repr(so.load(tmp_path / "border.nc")) == repr(border)
    so.plot(doubling, tmp_path / "cycles.png")
    so.plot(border, tmp_path / "border.png")


def test_wrong_use_is_refused(rubbing):
    found = so.equilibria(rubbing, "mu", (-0.1, 0.1))
    hopf = found.bifurcations["Hopf"][0]
    cycles = so.limit_cycles(hopf, max_step=0.1)
    with pytest.raises(so.InputError, match="must be a Bifurcation, a BranchPoint or a PeriodicOrbit, not 3"):
        so.limit_cycles(3)
    with pytest.raises(so.InputError, match="name the parameter="):
        so.limit_cycles(cycles.points[0])
    with pytest.raises(so.InputError, match="give bounds="):
        so.limit_cycles(cycles.points[0], parameter="mu")
    with pytest.raises(so.InputError, match="did you mean 'mu'"):
        so.limit_cycles(cycles.points[0], bounds=(0.0, 1.0), parameter="mux")
    buckled = so.System.from_equations("x'' + 0.1*x' - mu*x + x**3 = 0", {"mu": -0.5})
    point = so.equilibria(buckled, "mu", (-1.0, 1.0)).bifurcations["BP"][0]
    with pytest.raises(so.InputError, match="begins at Hopf points only: this is a BP"):
        so.limit_cycles(point)
    linear = so.System.from_equations("x'' - mu*x' + x = 0", {"mu": -0.5})
    with pytest.raises(so.ConvergenceError, match="the system is linear"):
        so.limit_cycles(so.equilibria(linear, "mu", (-1.0, 1.0)).bifurcations["Hopf"][0])


def test_cycles_that_grow_without_bound_end_after_orders_of_magnitude():
    """Where mu = 0.50643 / 0.344606 the nonlinear damping is gone; with the amplitude grows the frequency."""
    text = [
        "x'' + 0.082906*x' + 0.54873*x - mu*0.741153*x' + 0.50643*x**2*x' - 0.28776*x**3 + 0.380118*x**5"
        " - 0.344606*x**2*x'*mu = 0"
    ]
    hopf = hopf_of(so.System.from_equations(text, {"mu": 0.0}), "mu", (-1.0, 2.0))
    cycles = so.limit_cycles(hopf)
    assert "grow without bound" in cycles.ended
    assert not cycles.warnings
    assert len(cycles) < 500
    fastest = int(np.argmax(cycles.omega))
    assert 1e3 < cycles.omega[fastest] / hopf.omega < 2e3
    assert cycles.parameter("mu")[fastest] == pytest.approx(0.50643 / 0.344606, abs=1e-2)


def test_the_hopf_point_in_which_cycles_end_is_at_rest():
    """Of a wing section whose cycles shrink to rest: what Newton's method leaves of zero is no motion."""
    values = {
        "xa": 0.25,
        "r2": 0.25,
        "zeta": 0.005,
        "w": 0.4,
        "mu": 0.1,
        "e": 0.3,
        "k3": 3.0,
        "kh": 0.5,
        "b": 0.3,
        "U": 0.5,
    }
    system = so.System.from_equations(
        [
            "h'' + xa*a'' + 2*zeta*w*h' + w**2*(h+kh*h**3) + mu*U**2*a + mu*U*h' = 0",
            "xa*h'' + r2*a'' + 2*zeta*r2*a' + r2*(a + k3*a**3) - mu*e*U**2*a - mu*e*U*h' + b*mu*U*a' = 0",
        ],
        values,
    )
    rest = so.equilibria(system, "U", (0.3, 2.5), observe="a")
    begins = rest.bifurcations["Hopf"][0]
    cycles = so.limit_cycles(begins, bounds=(0.3, 2.5), observe="a")
    (end,) = cycles.bifurcations["Hopf"]
    assert end.parameter("U") == pytest.approx(begins.parameter("U"), abs=1e-9)
    assert end.amplitude == end.residual == 0.0
    assert not end.orbit.coefficients.any()
    assert so.verify(end).agrees
