"""Joints with play, quadratic damping, smoothed friction, forces as Python functions: laws and derivatives."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import quad

import suboctave as so
from suboctave.errors import InputError
from suboctave.model import PolynomialSampling
from suboctave.model.elements.written import WrittenElement

LAWS = [
    so.QuadraticDamper(0, 0.3),
    so.QuadraticDamper((0, 1), -2e6),
    so.TanhFriction(0, 0.4, 1e-3),
    so.TanhFriction(0, 4e5, 1.3),
    so.Freeplay(0, 2.0, 0.3),
    so.Freeplay(0, 2.0, 0.3, regularization=30.0),
    so.Clearance(0, 2e7, 3e-4, 1e-4),
    so.Clearance(0, 2.0, 0.3, 0.5, regularization=3000.0),
    so.CubicSpring(0, 0.5),
    so.PolynomialSpring(0, {2: 1.0, 5: -0.3}),
    so.ElasticStop(0, 2.0, 0.3, regularization=50.0),
    so.Callable(0, lambda x, v, k, c: k * np.sinh(x) + c * x**2 * v, {"k": 0.5, "c": 0.1}),
]


def force(element, u, v=0.0):
    u = np.atleast_1d(np.asarray(u, dtype=float))
    return element.tangent(u, np.broadcast_to(np.asarray(v, float), u.shape), element.coefficient_values({}))[0]


@pytest.mark.parametrize("element", LAWS, ids=repr)
def test_all_derivatives_to_third_order_agree_with_differences(element):
    report = so.check_derivatives(element, tolerance=2e-6)
    assert report.ok, str(report)
    own = not isinstance(element, so.Callable)  # whose third derivatives are differences
    assert ("f_uuu" in report.errors) == own
    assert ("f_vvv" in report.errors) == (own and element.depends_on_velocity)


class DampedSpring(WrittenElement):
    """Its coefficients do not stand in the order of the alphabet."""

    coefficient_names = ("stiffness", "drag")
    text = "stiffness*x**3 + drag*v"

    def sampling(self, c):
        return PolynomialSampling(3)


def test_a_written_law_keeps_the_order_of_its_coefficients():
    element = DampedSpring(0, [2.0, "d"])
    assert so.check_derivatives(element, parameters={"d": 0.1}), so.check_derivatives(element, parameters={"d": 0.1})
    u, v, c = np.array([0.7]), np.array([-0.3]), element.coefficient_values({"d": 0.1})
    assert element.tangent(u, v, c)[0] == pytest.approx(2.0 * 0.7**3 - 0.1 * 0.3)
    np.testing.assert_allclose(element.coefficient_tangent(u, v, c)[0], [u**3, v])


GIVEN = {
    "drag": (lambda x, v: v * np.abs(v), lambda x, v: (0 * x, 2 * np.abs(v))),
    "quadratic spring": (lambda x, v: x * np.abs(x), lambda x, v: (2 * np.abs(x), 0 * x)),
    "power 3/2": (lambda x, v: np.sign(x) * np.abs(x) ** 1.5, lambda x, v: (1.5 * np.sqrt(np.abs(x)), 0 * x)),
    "friction": (lambda x, v: np.tanh(v / 0.01), lambda x, v: (0 * x, 100 / np.cosh(v / 0.01) ** 2)),
    "stop": (lambda x, v: 5 * np.maximum(x - 0.3, 0), lambda x, v: (5.0 * (x > 0.3), 0.0)),
    "mixed": (lambda x, v: np.abs(x) * v, lambda x, v: (np.sign(x) * v, np.abs(x))),
}
NOT_THEIRS = {
    "half of it": ("quadratic spring", lambda x, v: (np.abs(x), 0 * x)),
    "right on one side": ("quadratic spring", lambda x, v: (2 * x, 0 * x)),
    "exchanged": ("drag", lambda x, v: (2 * np.abs(v), 0 * x)),
    "the other sign": ("drag", lambda x, v: (0 * x, -2 * np.abs(v))),
    "without the inner derivative": ("friction", lambda x, v: (0 * x, 1 / np.cosh(v / 0.01) ** 2)),
    "another gap": ("stop", lambda x, v: (5.0 * (x > 0.5), 0.0)),
}
NO_PAIR = {"only one": lambda x, v: 2 * np.abs(v), "failing": lambda x, v: (0 * x, v.slope)}


@pytest.mark.parametrize("law", GIVEN)
def test_given_derivatives_of_laws_with_corners_are_taken(law):
    force, derivatives = GIVEN[law]
    system_with(so.Callable(0, force, derivatives=derivatives))


@pytest.mark.parametrize("case", NOT_THEIRS)
def test_given_derivatives_that_are_not_the_laws_are_refused(case):
    law, derivatives = NOT_THEIRS[case]
    with pytest.raises(so.InputError, match="from derivatives= is not the derivative of the force: at x = "):
        system_with(so.Callable(0, GIVEN[law][0], derivatives=derivatives))


def test_given_derivatives_that_are_no_numbers_are_refused():
    with pytest.raises(so.InputError, match="f_v from derivatives= is not finite between -1 and 1"):
        system_with(so.Callable(0, GIVEN["drag"][0], derivatives=lambda x, v: (0 * x, np.nan * v)))


@pytest.mark.parametrize("case", NO_PAIR)
def test_derivatives_that_are_no_pair_are_refused(case):
    with pytest.raises(so.InputError, match=r"derivatives= must return \(f_x, f_v\), two real arrays"):
        system_with(so.Callable(0, GIVEN["drag"][0], derivatives=NO_PAIR[case]))


def test_a_function_with_its_derivatives_gives_what_the_text_gives():
    """x |x|^3 as a function of NumPy's `abs`, which bears no complex steps, and as a text: the same motion."""
    function = so.Callable(0, lambda x, v: x * np.abs(x) ** 3, derivatives=lambda x, v: (4 * np.abs(x) ** 3, 0 * x))
    text = so.Expression(0, "x*abs(x)**3")
    one, other = (
        so.frequency_response(system_with(law), (1.0, 1.02), harmonics=7).orbits[0] for law in (function, text)
    )
    np.testing.assert_allclose(one.coefficients, other.coefficients, rtol=1e-9, atol=1e-11)


def test_third_derivatives_of_elements_that_do_not_know_them():
    """Differences of the second ones, in steps that follow the law's width."""

    class Plain(so.TanhFriction):
        third = so.Element.third

    u, v, c = np.zeros(7), np.linspace(-0.02, 0.02, 7), np.array([0.4, 0.01])
    exact, found = so.TanhFriction(0, 0.4, 0.01).third(u, v, c), Plain(0, 0.4, 0.01).third(u, v, c)
    np.testing.assert_allclose(found[3], exact[3], atol=1e-7 * np.abs(exact[3]).max())


def test_freeplay_and_clearance_are_pairs_of_stops():
    u = np.linspace(-2.0, 2.0, 41)
    for s in (None, 40.0):
        free = so.Freeplay(0, 3.0, 0.5, regularization=s)
        pair = [so.ElasticStop(0, 3.0, gap, regularization=s) for gap in (0.5, -0.5)]
        np.testing.assert_allclose(force(free, u), sum(force(stop, u) for stop in pair), atol=1e-13)
        # the whole width of the play, off centre
        joint = so.Clearance(0, 3.0, 1.0, 0.25, regularization=s)
        pair = [so.ElasticStop(0, 3.0, 0.75, "right", s), so.ElasticStop(0, 3.0, -0.25, "left", s)]
        np.testing.assert_allclose(force(joint, u), sum(force(stop, u) for stop in pair), atol=1e-13)
    np.testing.assert_allclose(force(so.Freeplay(0, 3.0, 0.5), [-1.5, -0.2, 0.2, 1.0]), [-3.0, 0.0, 0.0, 1.5])


def test_a_play_follows_its_parameters():
    system = so.System(
        1.0, 0.1, 1.0,
        elements=[so.Clearance(0, "k", "width", "centre")],
        loads=[so.HarmonicLoad(0, 1.0)],
        parameters={"k": 2.0, "width": 0.4, "centre": 0.1},
    )  # fmt: skip
    np.testing.assert_allclose(system.elements[0].coefficient_values(system.parameters), [2.0, -0.1, 0.3])
    with pytest.raises(InputError, match="the play is negative"):
        system.with_parameters(width=-0.1)


def test_quadratic_damping_dissipates_what_it_should():
    """Work per cycle of a cos(omega t): 8/3 c omega^2 a^3."""
    a, omega = 0.7, 3.0
    element = so.QuadraticDamper(0, 0.2)

    def power(t):
        v = -a * omega * np.sin(omega * t)
        return force(element, 0.0, v)[0] * v

    half = np.pi / omega
    assert 2.0 * quad(power, 0.0, half)[0] == pytest.approx(8.0 / 3.0 * 0.2 * omega**2 * a**3, rel=1e-10)


def test_friction_tends_to_that_of_coulomb():
    v = np.array([-1.0, -0.1, 0.1, 1.0])
    np.testing.assert_allclose(force(so.TanhFriction(0, 2.0, 1e-3), np.zeros(4), v), 2.0 * np.sign(v), atol=1e-12)


def test_they_survive_pickling():
    for element in LAWS[:-1]:
        copy = pickle.loads(pickle.dumps(element))
        assert repr(copy) == repr(element)
        np.testing.assert_array_equal(force(copy, [0.3, 0.9], 0.2), force(element, [0.3, 0.9], 0.2))


def test_a_function_that_bears_complex_numbers_is_differentiated_exactly():
    good = so.Callable(0, lambda x, v: np.exp(x) * v)
    u, v = np.array([0.3, -1.2]), np.array([0.5, 2.0])
    _, f_u, f_v = good.tangent(u, v, np.zeros(0))
    np.testing.assert_allclose(f_u, np.exp(u) * v, rtol=1e-15)
    np.testing.assert_allclose(f_v, np.exp(u), rtol=1e-15)
    assert good.accuracy == 1e-15


@pytest.mark.parametrize(
    "function",
    [lambda x, v: np.abs(x) * x, lambda x, v: np.real(x) ** 3, lambda x, v: np.array([float(e) ** 3 for e in x])],
    ids=["abs", "drops the imaginary part", "fails"],
)
def test_one_that_does_not_is_differentiated_by_differences(function):
    element = so.Callable(0, function)
    assert element.accuracy == 1e-10
    u = np.array([0.8, 1.3])
    exact = 2.0 * u if element.tangent(u, u, np.zeros(0))[0][0] == pytest.approx(0.64) else 3.0 * u**2
    np.testing.assert_allclose(element.tangent(u, u, np.zeros(0))[1], exact, rtol=1e-9)


def system_with(element):
    return so.System(1.0, 0.1, 1.0, elements=[element], loads=[so.HarmonicLoad(0, 1.0)])


@pytest.mark.parametrize(
    ("make", "part"),
    [
        (lambda: so.Freeplay(0, 1.0, -0.1), "gap must not be negative"),
        (lambda: so.Clearance(0, 1.0, -0.1), "clearance must not be negative"),
        (lambda: so.Clearance(0, 1.0, "2*"), "Clearance, clearance: cannot read"),
        (lambda: so.Freeplay(0, 1.0), "Freeplay needs gap"),
        (lambda: so.TanhFriction(0, 1.0, 0.0), "velocity must be positive"),
        (lambda: so.QuadraticDamper(0), "needs coefficient"),
        (lambda: so.Callable(0, 3.0), "must be a function"),
        (lambda: system_with(so.Callable(0, lambda x: x)), "the function failed with TypeError"),
        (lambda: system_with(so.Callable(0, lambda x, v: x[:2])), "real arrays of shape"),
        (lambda: system_with(so.Callable(0, lambda x, v: x / 0.0 * 0.0)), "not finite"),
        (
            lambda: system_with(so.Callable(0, lambda x, v: x**3, derivatives=lambda x, v: (x**2, 0 * v))),
            "f_x from derivatives= is not",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_wrong_ones_are_refused_in_one_line(make, part):
    with pytest.raises(InputError, match=part) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_law_with_corners_must_have_nodes_of_its_own():
    class Careless(so.QuadraticDamper):
        own_nodes = False

    with pytest.raises(InputError, match="own_nodes = True"):
        system_with(Careless(0, 1.0))

    class Needless(so.ElasticStop):
        own_nodes = True

    with pytest.raises(InputError, match="own_nodes must be False"):
        system_with(Needless(0, 1.0, 1.0))


def test_a_function_is_shown_by_its_name():
    def spring(x, v):
        return x**3

    assert repr(so.Callable(0, spring)) == "Callable(dof=0, function=spring)"
