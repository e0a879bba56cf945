"""Systems from equations of motion: the same as those made by hand, and what is refused with the place in the text."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError

make = so.System.from_equations
REFERENCE = {"zeta": 0.03, "alpha": 0.16, "Kc": 4.7, "j": 0.0, "p": 0.55}


def forces(system, seed=0):
    """Everything that acts, at random states and instants: (M^-1 is left out) C v + K x + f - p, (n, N)."""
    rng = np.random.default_rng(seed)
    x, v = rng.normal(size=(2, system.n, 12))
    omega, t = 1.3, np.linspace(0.0, 4.0, 12)
    _, damping, stiffness = system.matrices()
    total = damping @ v + stiffness @ x - system.force_time(t, omega)
    for element in system.elements:
        c, d = element.coefficient_values(system.parameters), element.direction(system.n)
        if isinstance(element, so.CoupledElement):
            read = element.inputs(system.n)
            q = np.concatenate((read @ x, read @ v)) if element.depends_on_velocity else read @ x
            f = element.tangent(q, omega * t, c)[0]
        else:
            f = element.tangent(d @ x, d @ v, c)[0]
        total += np.multiply.outer(d, f)
    return x, v, omega * t, total


def test_the_reference_oscillator_in_two_spellings():
    by_hand = so.library.reference_oscillator(**REFERENCE)
    for text in (
        "x'' + 2*zeta*x' + x + alpha*x**3 + Kc*max(x - j, 0) - Kc*max(-x - 1, 0) = p*cos(omega*t)",
        "p*cos(omega*t) - x'' - x = 2*zeta*x' + alpha*x**3 + Kc*(x+1)*heaviside(-x-1) + Kc*(x-j)*heaviside(x-j)",
    ):
        system = make(text, REFERENCE)
        kinds = sorted(type(e).__name__ for e in system.elements)
        assert kinds == ["CubicSpring", "ElasticStop", "ElasticStop"]
        assert {e.side for e in system.elements if isinstance(e, so.ElasticStop)} == {"left", "right"}
        np.testing.assert_allclose(forces(system)[3], forces(by_hand)[3], atol=1e-13)
        ours, theirs = (so.frequency_response(s, (3.0, 1.6), harmonics=9) for s in (system, by_hand))
        np.testing.assert_allclose(ours.omega, theirs.omega, rtol=1e-9)
        np.testing.assert_allclose(ours.amplitude, theirs.amplitude, rtol=1e-9)
        assert [b.kind for b in ours.bifurcations] == [b.kind for b in theirs.bifurcations]


def test_two_masses_with_springs_between_them():
    by_hand = so.library.nltva()
    system = make(
        [
            "m1*x'' + c1*x' + c2*(x' - y') + k1*x + k2*(x - y) + knl1*x**3 + knl2*(x - y)**3 = F*cos(omega*t)",
            "m2*y'' + c2*(y' - x') + k2*(y - x) - knl2*(x - y)**3 = 0",
        ],
        by_hand.parameters,
    )
    assert system.dof_names == ("x", "y")
    assert sorted(repr(e) for e in system.elements) == sorted(repr(e) for e in by_hand.elements)
    for ours, theirs in zip(system.matrices(), by_hand.matrices(), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-14)


def test_everything_at_once_against_the_text_in_numbers():
    """Coupled masses, an equation with its sign turned, a constant, waves, parametric, coupled and one-sided forces."""
    system = make(
        [
            "-2*x'' - 0.3*y'' = 0.1*x' + (1 + e*cos(2*omega*t + 0.4))*x - y + y*x**2"
            " + max(x - y - g, 0)*y - F*sin(omega*t)",
            "y'' + 0.3*x'' + 0.2*y' + 2*y - x + x*y*x' + (x' - 2*y')**3 + (1 + y)**2 = F*cos(omega*t)**2 + 3",
        ],
        {"e": 0.2, "g": 0.1, "F": 1.5},
    )
    np.testing.assert_allclose(system.matrices()[0], [[2.0, 0.3], [0.3, 1.0]])
    (x, y), (vx, vy), theta, total = forces(system)
    first = 0.1 * vx + (1 + 0.2 * np.cos(2 * theta + 0.4)) * x - y + y * x**2 + np.maximum(x - y - 0.1, 0) * y
    second = 0.2 * vy + 2 * y - x + x * y * vx + (vx - 2 * vy) ** 3 + (1 + y) ** 2
    first -= 1.5 * np.sin(theta)
    second -= 1.5 * np.cos(theta) ** 2 + 3
    np.testing.assert_allclose(total, [first, second], atol=1e-12)


def test_the_modulus_of_a_displacement_is_a_stop_and_a_spring():
    system = make("x'' + 0.1*x' + k*abs(x - a) + c*abs(x')*x' = cos(omega*t)", {"k": 2.0, "a": 0.3, "c": 0.2})
    assert sorted(type(e).__name__ for e in system.elements) == ["ElasticStop", "Expression"]
    (x,), (v,), theta, total = forces(system)
    expected = 0.1 * v + 2.0 * np.abs(x - 0.3) + 0.2 * np.abs(v) * v - np.cos(theta)
    np.testing.assert_allclose(total[0], expected, atol=1e-13)


def test_names_of_the_degrees_of_freedom_last():
    system = make(["x'' + k*(x - y) = 0", "y'' + k*(y - x) + y**3 = cos(omega*t)"], {"k": 2.0})
    for copy in (pickle.loads(pickle.dumps(system)), system.with_parameters(k=3.0)):
        assert copy.dof_names == ("x", "y")
    assert "2 degrees of freedom (x, y)" in repr(system)
    with pytest.raises(InputError, match="different names"):
        so.System(1.0, 0.1, 1.0, loads=[so.HarmonicLoad(0, 1.0)], dof_names=("x", "y"))


def test_equations_in_any_order_and_names_in_order_of_appearance():
    system = make(["y''/2 + z'' + sin(z) = 0", "2*y'' + z''/2 + 3*y = cos(omega*t)"])
    assert system.dof_names == ("y", "z")
    np.testing.assert_allclose(system.matrices()[0], [[2.0, 0.5], [0.5, 1.0]])
    np.testing.assert_allclose(system.matrices()[2], [[3.0, 0.0], [0.0, 0.0]])


def test_loads_with_amplitudes_and_phases_of_the_frequency():
    system = make(
        "x'' + 0.1*x' + x = m*e*omega**2*cos(omega*t - 2*p) + sin(3*omega*t + p)", {"m": 2.0, "e": 0.1, "p": 0.3}
    )
    t = np.linspace(0.0, 5.0, 11)
    expected = 0.2 * 1.7**2 * np.cos(1.7 * t - 0.6) + np.sin(5.1 * t + 0.3)
    np.testing.assert_allclose(system.force_time(t, 1.7)[0], expected, atol=1e-13)


REFUSED = [
    ("x''*x + x = 0", {}, r"x'' is multiplied by something that depends on x"),
    ("x''**2 + x = 0", {}, "depends on x''"),
    ("sin(x'') + x = 0", {}, "depends on x''"),
    ("x'' + k*x = 0", {}, "column 7, 'k': unknown name 'k'"),
    ("x'' + x = p*cos(Omega*t)", {"p": 1.0}, r"column 17, 'Omega': unknown name 'Omega' \(did you mean 'omega'"),
    ("x'' + x + y' = 0", {}, "y' occurs, but no equation has y''"),
    (["x'' + x = 0", "x' + x = 0"], {}, "2 equations for 1 accelerations"),
    ("x' + x = 0", {}, "no second derivative"),
    ("x'' + x = t", {}, "is no load"),
    ("x'' + x = exp(cos(omega*t))", {}, "is no load"),
    ("x'' + x = cos(omega*t/3)", {}, "k a positive integer"),
    ("x'' + x == 0", {}, "one '=' at most"),
    ("x'' + x = ", {}, "is empty"),
    ("x'' + foo(x) = 0", {}, "there is no function 'foo'"),
    ("x'' + x + __import__('os').system('x') = 0", {}, "no equation has|not allowed"),
    ("x'' + ().__class__ = 0", {}, "not allowed"),
    ("x'' + 9**9**9**9*x = 0", {}, "power is larger"),
    ("x'' + c*sign(x') + x = 0", {"c": 1.0}, "the force jumps"),
    ("x'' + omega*x = 0", {}, "only loads may depend"),
    ("x'' + 2*(x", {}, "never closed"),
    (["x'' + y'' + x = 0", "x'' + y'' + y = 0"], {}, "singular"),
    ("x'' + x = 0", {"k": 1.0}, "'k' not used"),
    ("x'' + x = 0", {"x": 1.0}, "both a parameter and a degree of freedom"),
    ("sin'' + x = 0", {}, "cannot name a degree of freedom"),
    ("x'' + x + a*x(t - tau) = 0", {"a": 0.5}, "delays are not supported"),
    ("x'' + 0.1*x'(t - 0.5) + x = 0", {}, "delays are not supported"),
    ("x''(t) + x(t) = 0", {}, "written without their time: x''$"),
    ([], {}, "must be a text or a sequence"),
    ([3], {}, r"equations\[0\] must be a text, not 3"),
]


@pytest.mark.parametrize(("equations", "parameters", "part"), REFUSED, ids=[str(case[0])[:40] for case in REFUSED])
def test_what_is_no_equation_of_motion_is_refused_in_one_line(equations, parameters, part):
    with pytest.raises(InputError, match=part) as caught:
        make(equations, parameters)
    assert "\n" not in str(caught.value)
