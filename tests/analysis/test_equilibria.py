"""Equilibria against closed forms: eigenvalues, Hopf points, buckling; curves of these; what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from slow import slow

import suboctave as so
from suboctave.model.linearised import eigenvalues, tangent_matrices

pytestmark = pytest.mark.filterwarnings("ignore::suboctave.NegativeDampingWarning")


@pytest.fixture(scope="module")
def wing():
    """A section in plunge and pitch under quasi-steady lift, its stiffness in pitch softening, then hardening."""
    return so.System.from_equations(
        [
            "h'' + xa*a'' + 2*zeta*w*h' + w**2*h + beta*U**2*a + beta*U*h' = 0",
            "xa*h'' + r2*a'' + 2*zeta*r2*a' + r2*(a - k3*a**3 + k5*a**5) - beta*e*U**2*a - beta*e*U*h' = 0",
        ],
        {"xa": 0.2, "r2": 0.25, "zeta": 0.01, "w": 0.5, "beta": 0.1, "e": 0.2, "k3": 2.0, "k5": 20.0, "U": 0.5},
    )


def test_a_hopf_point_and_eigenvalues_in_closed_form():
    system = so.System.from_equations("x'' + (x**2 - mu)*x' + 4*x = 0", {"mu": 0.1})
    found = so.equilibria(system, "mu", (-1.0, 1.0))
    (hopf,) = found.bifurcations["Hopf"]
    assert abs(hopf.parameters["mu"]) < 1e-12
    assert hopf.omega == pytest.approx(2.0, rel=1e-12)
    assert hopf.criticality == "supercritical"
    mu = found.parameter("mu")
    expected = 0.5 * mu + 1j * np.sqrt(4.0 - 0.25 * mu**2)
    np.testing.assert_allclose(found.eigenvalues[:, 0], expected, rtol=1e-10)
    np.testing.assert_array_equal(found.stable, mu < 0.0)
    assert not found.positions.any()


@pytest.mark.parametrize("a", [0.1, -0.1])
def test_the_criticality_is_that_of_the_first_lyapunov_coefficient(a):
    """By averaging a A^2 3/4 is added to the growth: a > 0 subcritical."""
    system = so.System.from_equations("x'' + x - mu*x' - a*x'**3 + x'**5 = 0", {"mu": 0.0, "a": a})
    (hopf,) = so.equilibria(system, "mu", (-0.1, 0.1)).bifurcations["Hopf"]
    assert hopf.criticality == ("subcritical" if a > 0.0 else "supercritical")


def test_flutter_against_the_characteristic_polynomial(wing):
    found = so.equilibria(wing, "U", (0.2, 2.5))
    (hopf,) = found.bifurcations["Hopf"]
    at = {**wing.parameters, "U": hopf.parameters["U"]}
    mass, damping, stiffness = tangent_matrices(wing, np.zeros(2), at)
    s = 1j * hopf.omega
    matrix = s**2 * mass + s * damping + stiffness
    assert abs(np.linalg.det(matrix)) < 1e-12
    # whatever the frequency that the equilibria are written with
    other = so.equilibria(wing, "U", (0.2, 2.5), highest=7.0).bifurcations["Hopf"][0]
    assert other.parameters["U"] == pytest.approx(hopf.parameters["U"], rel=1e-11)
    assert other.omega == pytest.approx(hopf.omega, rel=1e-11)


def test_the_curve_of_hopf_points_in_two_parameters(wing):
    (hopf,) = so.equilibria(wing, "U", (0.2, 2.5)).bifurcations["Hopf"]
    curve = so.track(hopf, "zeta", (0.001, 0.05))
    assert curve.kind == "Hopf"
    assert curve.plane == ("U", "zeta")
    for i in (0, len(curve) // 2, -1):
        values = curve.orbits[i].values
        found = eigenvalues(wing, np.zeros(2), values)
        nearest = found[np.argmin(np.abs(found - 1j * curve.kappa[i]))]
        assert abs(nearest - 1j * curve.kappa[i]) < 1e-9


def test_buckling_is_a_branch_point_and_the_branch_is_switched_to():
    """x^2 = mu beyond mu = 0; imperfect, a limit point."""
    system = so.System.from_equations("x'' + 0.1*x' - mu*x + x**3 = q", {"mu": -0.5, "q": 0.0})
    found = so.equilibria(system, "mu", (-1.0, 1.0))
    (point,) = found.bifurcations["BP"]
    assert abs(point.parameters["mu"]) < 1e-9
    assert point.criticality == "supercritical"
    other = so.switch_branch(point, side=1)
    mu = other.parameter("mu")
    np.testing.assert_allclose(other.positions[:, 0] ** 2, mu, atol=1e-9)
    assert other.stable[5:].all()
    imperfect = system.with_parameters(q=-0.1)
    folded = so.equilibria(imperfect, "mu", (1.0, -1.0), start=[0.95])
    (fold,) = folded.bifurcations["LP"]
    # q = -mu x + x^3 with mu = 3 x^2
    x = 0.05 ** (1.0 / 3.0)
    assert fold.parameters["mu"] == pytest.approx(3.0 * x**2, rel=1e-9)
    curve = so.track(fold, "q", (-0.3, 0.05))
    np.testing.assert_allclose(curve.parameter("mu") ** 3, 6.75 * curve.parameter("q") ** 2, atol=1e-9)


def test_frequencies_beyond_those_at_the_start_are_noticed():
    """A stiffness that grows along the curve: the frequency that equilibria are written with follows."""
    system = so.System.from_equations(
        ["x'' + 0.1*x' + x = 0", "y'' - mu*y' + y**2*y' + k**2*y + 0*x = 0"], {"mu": -0.1, "k": 1.0}
    )
    found = so.equilibria(system, "k", (1.0, 60.0))
    assert found.omega[0] > 2.0 * 60.0
    assert not found.bifurcations.met
    (hopf,) = so.equilibria(system.with_parameters(k=60.0), "mu", (-0.1, 0.1)).bifurcations["Hopf"]
    assert hopf.omega == pytest.approx(60.0, rel=1e-10)


def test_sensitivities_of_a_hopf_point(wing):
    (hopf,) = so.equilibria(wing, "U", (0.2, 2.5)).bifurcations["Hopf"]
    found = so.sensitivity(hopf, by=["zeta", "e"])
    for name in ("zeta", "e"):
        step = 1e-5 * wing.parameters[name]
        sides = [
            so.equilibria(wing.with_parameters({name: wing.parameters[name] + s * step}), "U", (0.2, 2.5))
            for s in (1.0, -1.0)
        ]
        ahead, behind = (side.bifurcations["Hopf"][0].parameters["U"] for side in sides)
        assert found[name]["U"] == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-5)


def test_what_is_found_is_kept(tmp_path, wing):
    found = so.equilibria(wing, "U", (0.2, 2.5), observe="a")
    found.save(tmp_path / "rest.nc")
    again = so.load(tmp_path / "rest.nc")
    assert repr(again) == repr(found)
    np.testing.assert_array_equal(again.eigenvalues, found.eigenvalues)
    table = found.to_dataframe()
    assert list(table)[:5] == ["U", "amplitude", "stable", "eigenvalue_real", "eigenvalue_imag"]
    found.plot(tmp_path / "rest.png")


def test_wrong_use_is_refused(wing):
    with pytest.raises(so.InputError, match=r"make them zero \(here by F\)"):
        so.equilibria(so.library.duffing(), "F", (0.0, 1.0))
    with pytest.raises(so.InputError, match="depends on time"):
        so.equilibria(so.library.mathieu_duffing(F=0.0), "eps", (0.0, 1.0))
    with pytest.raises(so.InputError, match="they have no omega"):
        so.equilibria(wing, "omega", (0.5, 1.0))
    with pytest.raises(so.InputError, match="start must have 2 displacements"):
        so.equilibria(wing, "U", (0.5, 1.0), start=[0.0])
    with pytest.raises(so.InputError, match="highest must be a positive frequency"):
        so.equilibria(wing, "U", (0.5, 1.0), highest=-1.0)
    found = so.equilibria(wing, "U", (0.2, 2.5))
    with pytest.raises(so.InputError, match="nothing moves there"):
        so.limit_cycles(found.points[0], bounds=(0.2, 2.0), parameter="U")


@pytest.mark.parametrize("apart", [1e-8, *slow(0.0, 1e-6)])
def test_pairs_of_different_frequency_that_cross_at_one_parameter_are_all_hopf_points(apart):
    equations = [
        "x'' - (mu - x**2)*x' + x = 0",
        f"y'' - (mu - {apart!r} - y**2)*y' + 4*y = 0",
        "z'' - (mu - z**2)*z' + 9*z = 0",
    ]
    curve = so.equilibria(so.System.from_equations(equations, {"mu": -0.1}), "mu", (-0.2, 0.3), max_step=0.03)
    found = curve.bifurcations["Hopf"]
    assert sorted(item.omega for item in found) == pytest.approx([1.0, 2.0, 3.0], abs=1e-9)
    assert sorted(item.parameter("mu") for item in found) == pytest.approx([0.0, 0.0, apart], abs=1e-12)
    assert not any("explain" in note or "another multiplier" in note for note in curve.warnings)
    cycles = [so.limit_cycles(item, bounds=(-0.05, 0.05), harmonics=5) for item in found]
    assert sorted(round(float(one.omega.max()), 6) for one in cycles) == [1.0, 2.0, 3.0]


def test_hopf_points_know_no_resonance_with_the_frequency_that_equilibria_are_written_with():
    """mu = 0, omega = sqrt(k), wherever the range of k ends."""
    system = so.System.from_equations("x'' - (mu - x**2 - x**4)*x' + k*x + 0.2*x**3 = 0", {"mu": -0.1, "k": 1.0})
    (hopf,) = so.equilibria(system, "mu", (-0.2, 1.0)).bifurcations["Hopf"]
    curve = so.track(hopf, "k", (0.5, 3000.0))
    assert curve.ended.count("reached the end of the range") == 2
    assert not len(curve.bifurcations)
    assert curve.warnings == ()
    assert np.abs(curve.kappa / np.sqrt(curve.parameter("k")) - 1.0).max() < 1e-9
    assert np.abs(curve.parameter("mu")).max() < 1e-12


def test_a_bautin_point_is_where_the_first_lyapunov_coefficient_vanishes(tmp_path):
    """By averaging at omega = 1: a + 3 * 0.3 = 0."""
    system = so.System.from_equations(
        "x'' + x'*(-mu - a*x**2 - 0.3*x'**2 + x**4) + k*x = 0", {"mu": -0.1, "a": 0.5, "k": 1.0}
    )
    (hopf,) = so.equilibria(system, "mu", (-0.3, 0.3)).bifurcations["Hopf"]
    curve = so.track(hopf, "a", (-3.0, 3.0))
    (bautin,) = curve.bifurcations
    assert (bautin.kind, bautin.uncertainty) == ("GH", 0.0)
    assert bautin.parameter("a") == pytest.approx(-0.9, abs=1e-9)
    assert bautin.omega == pytest.approx(1.0, abs=1e-9)
    for a, sense in ((-0.95, "supercritical"), (-0.85, "subcritical")):
        (beside,) = so.equilibria(system.with_parameters(a=a), "mu", (-0.3, 0.3)).bifurcations["Hopf"]
        assert beside.criticality == sense
    curve.save(tmp_path / "hopf.nc")
    assert so.load(tmp_path / "hopf.nc").bifurcations[0].omega == bautin.omega


def test_hopf_points_and_limit_points_meet_in_a_bogdanov_takens_point():
    """x'' + (x - d) x' + x^2 = b: Hopf points at b = d^2, limit points at b = 0."""
    system = so.System.from_equations("x'' + (x - d)*x' - b + x**2 = 0", {"d": 0.5, "b": 0.6})
    curve = so.equilibria(system, "b", (0.9, -0.1), start=[0.9])
    hopf = so.track(curve.bifurcations["Hopf"][0], "d", (-1.0, 1.0))
    assert hopf.warnings == ()
    assert np.abs(hopf.parameter("b") - hopf.parameter("d") ** 2).max() < 1e-9
    limits = so.track(curve.bifurcations["LP"][0], "d", (-1.0, 1.0))
    for one in (hopf, limits):
        (point,) = one.bifurcations
        assert point.kind == "R1"
        assert [point.parameter(name) for name in ("b", "d")] == pytest.approx([0.0, 0.0], abs=1e-7)
    from_there = so.track(hopf.bifurcations[0], "d", (-1.0, 1.0))
    assert from_there.kind == "LP"
    assert np.abs(from_there.parameter("b")).max() < 1e-9


@pytest.mark.parametrize("size", [0.0, 1e-150, -1e-75, 1e-30, -1e-12])
def test_a_limit_point_at_rest_is_followed_however_nearly_it_rests(size):
    """x^2 = b: Newton's method comes to x = 0 through ever smaller motions, and ends where rounding has it."""
    system = so.System.from_equations("x'' + d*x' - b + x**2 = 0", {"d": 0.5, "b": 0.6})
    (fold,) = so.equilibria(system, "b", (0.9, -0.1), start=[0.9]).bifurcations["LP"]
    orbit = fold.orbit
    x = np.zeros_like(orbit.x)
    x[0] = size
    limits = so.track(replace(fold, orbit=replace(orbit, x=x)), "d", (0.1, 1.0))
    assert np.abs(limits.parameter("b")).max() < 1e-12
    assert limits.parameter("d")[[0, -1]] == pytest.approx([0.1, 1.0])


def test_a_driven_motion_of_one_harmonic_is_no_equilibrium():
    """Though the load of the system as it was made is zero: the frequency stays as it is."""
    system = so.library.duffing(c=0.05, alpha=1.0, F=0.0)
    rising = so.continue_branch(system, "F", (0.0, 1.0), omega=1.5, harmonics=1)
    limits = so.track(rising.bifurcations["LP"][0], ["F", "alpha"], ((0.01, 2.0), (0.2, 3.0)))
    # the scale of the displacement: F^2 alpha is the same all along
    assert np.ptp(limits.parameter("F") ** 2 * limits.parameter("alpha")) < 1e-9
    assert set(limits.omega) == {1.5}


def pull_in(k=1.0):
    """A plate on a spring before an electrode at a distance of one; at rest `V2 = 2 k x (1 - x)^2`."""
    return so.System.from_equations("x'' + 0.05*x' + k*x = V2/(2*(1 - x)**2)", {"V2": 0.1, "k": k})


def pull_in_called():
    """The same, its force a function of which nothing is known."""
    force = so.Callable(0, lambda x, v, V2: -V2 / (2.0 * (1.0 - x) ** 2), {"V2": "V2"})
    return so.System(1.0, 0.05, 1.0, [force], parameters={"V2": 0.1})


@pytest.mark.parametrize(
    "system",
    [
        pytest.param(pull_in(), id="text"),
        *(
            pytest.param(one, id=name, marks=pytest.mark.slow)
            for one, name in ((pull_in(3.0), "stiffer"), (pull_in_called(), "function"))
        ),
    ],
)
def test_a_pole_of_a_force_ends_the_curve(system):
    """Pull-in at x = 1/3, V2 = 8/27 k; the curve goes on towards the electrode, and no equilibrium lies behind it."""
    k = system.parameters.get("k", 1.0)
    curve = so.equilibria(system, "V2", (0.0, 0.4 * k))
    (fold,) = curve.bifurcations
    assert fold.kind == "LP"
    assert fold.parameters["V2"] == pytest.approx(8.0 / 27.0 * k, rel=1e-9)
    assert "is not finite" in curve.ended
    x = curve.positions[:, 0]
    assert x.max() < 1.0
    np.testing.assert_allclose(curve.parameter("V2"), 2.0 * k * x * (1.0 - x) ** 2, atol=1e-9)


def test_a_pole_that_changes_its_sign_ends_the_curve():
    """`V = x (1 - x)` goes smoothly through the pole of `V / (1 - x)`."""
    system = so.System.from_equations("x'' + 0.05*x' + x = V/(1 - x)", {"V": 0.1})
    curve = so.equilibria(system, "V", (-1.0, 0.4))
    assert "is not finite" in curve.ended
    assert curve.positions.max() < 1.0
    (fold,) = curve.bifurcations
    assert fold.parameters["V"] == pytest.approx(0.25, rel=1e-9)


def test_a_root_ends_the_curve_where_its_argument_vanishes():
    """`x + sqrt(1 - x) = a` turns at x = 3/4 and ends at x = 1."""
    system = so.System.from_equations("x'' + 0.05*x' + x + sqrt(1 - x) = a", {"a": 0.1})
    curve = so.equilibria(system, "a", (1.0, 3.0))
    assert "not finite" in curve.ended
    assert curve.positions.max() == pytest.approx(1.0, abs=1e-6)
    assert [item.kind for item in curve.bifurcations] == ["LP"]
