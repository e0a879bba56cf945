"""Every element against finite differences, and the stops against the laws they are made from."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import quad

from suboctave.errors import InputError
from suboctave.model import (
    AdaptiveSampling,
    CubicSpring,
    ElasticStop,
    Element,
    PiecewiseLinear,
    PolynomialSpring,
    SharpSampling,
    System,
    check_derivatives,
)


class Dashpot(Element):
    """An element as a user would write it: f = (c + d u^2) v."""

    coefficient_names = ("c", "d")
    depends_on_velocity = True

    def sampling(self, c):
        return AdaptiveSampling()

    def tangent(self, u, v, c):
        rate = c[0] + c[1] * u**2
        return rate * v, 2 * c[1] * u * v, rate

    def curvature(self, u, v, c):
        return 2 * c[1] * v, 2 * c[1] * u, np.zeros_like(u)

    def coefficient_tangent(self, u, v, c):
        zero, one = np.zeros_like(u), np.ones_like(u)
        return np.array([v, u**2 * v]), np.array([zero, 2 * u * v]), np.array([one, u**2])

    def coefficient_curvature(self, u, v, c):
        return np.zeros((2, 2, len(u)))


class WrongSlope(Dashpot):
    def tangent(self, u, v, c):
        f, f_u, f_v = super().tangent(u, v, c)
        return f, 1.001 * f_u, f_v


class ForgottenVelocity(Dashpot):
    depends_on_velocity = False


STOPS = [
    ElasticStop(0, stiffness=4.7, gap=gap, side=side, regularization=s)
    for gap in (0.4, -0.4)
    for side in ("left", "right")
    for s in (None, 3.0, 3000.0)
]
ELEMENTS = [
    CubicSpring(0, 0.16),
    CubicSpring((0, 1), -2.0),
    PolynomialSpring(0, [1.0, -0.3, 0.0, 0.2]),
    PolynomialSpring(0, {3: 1.0, 7: 0.02}),
    PolynomialSpring(direction=[1.0, 2.0], coefficients={1: 1.0}),
    ElasticStop(0, stiffness=1e9, gap=2e-6, regularization=1e9),
    Dashpot(0, [0.1, 0.7]),
    *STOPS,
]


@pytest.mark.parametrize("element", ELEMENTS, ids=repr)
def test_derivatives_agree_with_finite_differences(element):
    report = check_derivatives(element)
    assert report.ok, str(report)
    assert len(report.errors) >= 5


@pytest.mark.parametrize("element", [WrongSlope(0, [0.1, 0.7]), ForgottenVelocity(0, [0.1, 0.7])], ids=repr)
def test_a_wrong_derivative_is_found(element):
    report = check_derivatives(element)
    assert not report.ok
    assert "DO NOT agree" in str(report)


def test_the_checker_looks_where_it_is_told():
    element = ElasticStop(0, stiffness="k", gap="b")
    assert check_derivatives(element, parameters={"k": 2.0, "b": 0.5}, u=[0.0, 1.0], v=[0.0, 0.0]).ok
    with pytest.raises(InputError, match="equal length"):
        check_derivatives(CubicSpring(0, 1.0), u=[0.0, 1.0], v=[0.0])


def law(element, u):
    u = np.atleast_1d(np.asarray(u, dtype=float))
    return element.tangent(u, np.zeros_like(u), element.coefficient_values({}))[0]


def test_exact_stop_is_the_one_sided_spring_of_its_definition():
    u = np.array([-2.0, -1.0, 0.0, 0.5, 2.0])
    np.testing.assert_array_equal(law(ElasticStop(0, 3.0, 0.5), u), [0, 0, 0, 0, 4.5])
    np.testing.assert_array_equal(law(ElasticStop(0, 3.0, -1.0), u), [-3, 0, 0, 0, 0])
    np.testing.assert_array_equal(law(ElasticStop(0, 3.0, -1.0, side="right"), u), [0, 0, 3, 4.5, 9])
    np.testing.assert_array_equal(law(ElasticStop(0, 3.0, 0.5, side="left"), u), [-7.5, -4.5, -1.5, 0, 0])


@pytest.mark.parametrize(
    ("gap", "side", "expected"),
    [
        (-1.0, None, "left"),
        (1.0, None, "right"),
        (0, None, "right"),
        (-0.0, None, "right"),
        ("j", None, "right"),
        ("-1.0", None, "right"),
        (-1.0, "right", "right"),
        ("j", "left", "left"),
    ],
)
def test_side_rule(gap, side, expected):
    stop = ElasticStop(0, 1.0, gap, side=side)
    assert stop.side == expected


def paper_pair(x, Kc, j, s):
    """Alcorta et al. 2019, Eq. (42), with the constant a_c that makes it vanish at rest."""

    def terms(x):
        f_minus, f_plus = (x - j) * np.arctan(s * (x - j)), (x + 1) * np.arctan(s * (x + 1))
        log = np.log((1 + (s * (x + 1)) ** 2) / (1 + (s * (x - j)) ** 2))
        return f_minus - f_plus + log / (2 * s)

    return Kc * (x + (terms(x) - terms(0.0)) / np.pi)


@pytest.mark.parametrize("j", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("s", [20.0, 3000.0])
def test_two_open_regularised_stops_add_up_to_the_law_of_the_paper(j, s):
    x = np.linspace(-3, 3, 61)
    pair = law(ElasticStop(0, 4.7, j, regularization=s), x) + law(ElasticStop(0, 4.7, -1.0, regularization=s), x)
    np.testing.assert_allclose(pair, paper_pair(x, 4.7, j, s), atol=1e-12)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("gap", [-0.7, 0.0, 0.7])
def test_force_at_rest_is_that_of_the_exact_law_and_the_law_tends_to_it(side, gap):
    exact = ElasticStop(0, 4.7, gap, side=side)
    for s in (2.0, 3000.0):
        assert law(ElasticStop(0, 4.7, gap, side=side, regularization=s), 0.0)[0] == pytest.approx(
            law(exact, 0.0)[0], abs=1e-13
        )
    u = np.linspace(-3, 3, 41)
    errors = [
        np.abs(law(ElasticStop(0, 4.7, gap, side=side, regularization=s), u) - law(exact, u)).max() for s in (1e3, 1e6)
    ]
    # it decays like log(s)/s
    assert errors[1] < 3e-3 * errors[0]


def test_left_stop_is_the_mirror_image_of_the_right_one():
    u = np.linspace(-2, 2, 33)
    for s in (None, 50.0):
        right, left = (
            ElasticStop(0, 2.0, 0.3, side="right", regularization=s),
            ElasticStop(0, 2.0, -0.3, side="left", regularization=s),
        )
        np.testing.assert_allclose(law(left, -u), -law(right, u), atol=1e-14)


def test_regularised_stiffness_rises_by_the_stiffness_of_the_stop():
    """The curvature is a smoothed Dirac function: its integral is the jump of the exact law's stiffness."""
    element = ElasticStop(0, 4.7, 0.2, regularization=300.0)
    c = element.coefficient_values({})

    def f_uu(u):
        return element.curvature(np.array([u]), np.zeros(1), c)[0][0]

    total = quad(f_uu, -50.0, 50.0, points=[0.19, 0.2, 0.21], limit=500)[0]
    tails = 4.7 * 2.0 / (np.pi * 300.0 * 50.0)
    assert total == pytest.approx(4.7 - tails, rel=1e-6)


def test_samplings_tell_the_truth():
    exact, smooth = ElasticStop(0, "k", "b", side="left"), ElasticStop(0, "k", "b", regularization="s")
    values = {"k": 2.0, "b": 0.4, "s": 50.0}
    pieces = exact.sampling(exact.coefficient_values(values))
    assert isinstance(pieces, PiecewiseLinear)
    assert [(p.stiffness, p.gap, p.side) for p in pieces.pieces] == [(0, 1, -1)]
    told = smooth.sampling(smooth.coefficient_values(values))
    assert isinstance(told, SharpSampling)
    assert (told.points, told.widths) == ((0.4,), (0.02,))
    assert check_derivatives(smooth, parameters=values).errors["arctan steps"] < 1e-12
    assert PolynomialSpring(0, [1.0, 0.0, 2.0, 0.0, 1.0]).sampling(np.ones(3)).degree == 5


def test_directions():
    np.testing.assert_array_equal(CubicSpring(1, 1.0).direction(3), [0, 1, 0])
    np.testing.assert_array_equal(CubicSpring((2, 0), 1.0).direction(3), [-1, 0, 1])
    np.testing.assert_array_equal(CubicSpring(coefficient=1.0, direction=[1, 2, 0]).direction(3), [1, 2, 0])


def test_elements_survive_pickling():
    for element in ELEMENTS[:6] + STOPS:
        copy = pickle.loads(pickle.dumps(element))
        assert repr(copy) == repr(element)
        np.testing.assert_array_equal(law(copy, [0.3, 0.9]), law(element, [0.3, 0.9]))


def test_strided_input_gives_the_same_force():
    element, u = STOPS[-1], np.linspace(-1, 1, 20)
    np.testing.assert_array_equal(law(element, u)[::2], law(element, u[::2]))


@pytest.mark.parametrize(
    ("make", "part"),
    [
        (lambda: CubicSpring(0), "CubicSpring needs coefficient"),
        (lambda: CubicSpring(coefficient=1.0), "needs either dof="),
        (lambda: CubicSpring(0, 1.0, direction=[1.0]), "not both"),
        (lambda: CubicSpring(-1, 1.0), "dof -1 is negative"),
        (lambda: CubicSpring((1, 1), 1.0), "couples a degree of freedom with itself"),
        (lambda: CubicSpring((0, 1, 2), 1.0), "an integer, a name, or a pair"),
        (lambda: CubicSpring(0.5, 1.0), "an integer, a name, or a pair"),
        (lambda: System(1.0, 0.1, 1.0, [CubicSpring("tip", 1.0)]), "none of the degrees of freedom"),
        (lambda: CubicSpring(True, 1.0), "an integer, a name, or a pair"),
        (lambda: CubicSpring(coefficient=1.0, direction=[0.0, 0.0]), "not all zero"),
        (lambda: CubicSpring(0, "2*"), "CubicSpring\\(dof=0\\), coefficient: cannot read"),
        (lambda: CubicSpring(0, float("nan")), "must be finite"),
        (lambda: CubicSpring(3, 1.0).direction(2), "DOFs 0 to 1"),
        (lambda: CubicSpring(coefficient=1.0, direction=[1.0, 0.0]).direction(3), "2 entries, the structure 3"),
        (lambda: PolynomialSpring(0, {0: 1.0}), "static="),
        (lambda: PolynomialSpring(0, {1.5: 1.0}), "must be a whole number, not 1.5"),
        (lambda: PolynomialSpring(0, {-1: 1.0}), "positive integer"),
        (lambda: PolynomialSpring(0, [0.0, 0.0]), "every coefficient is zero"),
        (lambda: PolynomialSpring(0, 3.0), "or a list"),
        (lambda: ElasticStop(0, 1.0), "ElasticStop needs gap"),
        (lambda: ElasticStop(0, gap=1.0), "ElasticStop needs stiffness"),
        (lambda: ElasticStop(0, 1.0, 1.0, side="rigth"), "did you mean 'right'"),
        (lambda: ElasticStop(0, 1.0, 1.0, regularization=0.0), "must be positive"),
        (lambda: ElasticStop(0, 1.0, 1.0, regularization=-5), "must be positive"),
        (lambda: Dashpot(0, [1.0]), "takes 2 coefficients, got 1"),
    ],
)
def test_wrong_elements_are_refused_in_one_line(make, part):
    with pytest.raises(InputError, match=part) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("gap", [0.3, -0.4])
def test_changes_of_a_rounded_stop_are_those_of_its_derivatives(side, gap):
    stop = ElasticStop(0, 20.0, gap, side=side, regularization=50.0)
    u, c = np.linspace(-2.0, 2.0, 101), np.array([20.0, gap, 50.0])
    for rates in np.vstack((np.eye(3), [0.3, -2.0, 0.1])):
        step = 1e-6
        ahead, behind = (stop.tangent(u, 0.0 * u, c + sign * step * rates) for sign in (1.0, -1.0))
        f_c, f_uc, damping = stop.coefficient_tangent(u, 0.0 * u, c)
        force, stiffness = rates @ f_c, rates @ f_uc
        assert damping is None
        np.testing.assert_allclose(force, (ahead[0] - behind[0]) / (2.0 * step), rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(stiffness, (ahead[1] - behind[1]) / (2.0 * step), rtol=1e-5, atol=1e-4)
