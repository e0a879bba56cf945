"""Forces as text: what is read, what is refused, and that all derivatives are right."""

from __future__ import annotations

import pickle
import time

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.model import AdaptiveSampling, CornerSampling, PolynomialSampling, SharpVelocitySampling

VALUES = {"a": 0.5, "b": -0.3, "k": 2.0, "j": 0.2, "c": 0.4, "e": 0.3, "p": 0.7, "v0": 0.6}
CASES = [
    ("a*x**3 + b*x**2*v", None, PolynomialSampling),
    ("a*x**3 + b*x**2*x'", None, PolynomialSampling),
    ("(1 + e*cos(2*omega*t + p))*x + a*x**3", None, PolynomialSampling),
    ("e*cos(omega*t)**2*x*v", None, PolynomialSampling),
    ("k*max(x - j, 0)*(1 + c*v)", None, CornerSampling),
    ("k*max(x - j, 0)**3.5", None, CornerSampling),
    ("k*max(x - j, 0)**1.5*(1 + c*v)", None, CornerSampling),
    ("k*max(x - j, 0)**(1 + p)", None, CornerSampling),
    ("c*v*abs(v) + k*(x - j)*heaviside(x - j)", None, CornerSampling),
    ("k*min(x, 2*x)", None, CornerSampling),
    (
        "a*tanh(v/v0) + b*sin(x) + exp(-x**2)/(1 + x**2) + sqrt(1 + x**2) + atan(x) + log(2 + x**2)",
        None,
        AdaptiveSampling,
    ),
    ("exp(e*cos(omega*t))*x", None, AdaptiveSampling),
    ("k*tanh(v/v0) + a*x**3 + c*v", None, SharpVelocitySampling),
    ("(k + a*w**2)*atan((u' - j)/v0)", {"w": 1, "u": [1.0, -2.0, 0.0]}, SharpVelocitySampling),
    ("k/(2 + tanh(v/v0))", None, AdaptiveSampling),
    ("k*tanh(v/v0)*cos(omega*t)", None, AdaptiveSampling),
    ("k*tanh(v/v0) + a*atan(x)", None, AdaptiveSampling),
    ("k*x*y**2*sin(omega*t) + c*y'*x", {"x": 0, "y": (1, 2)}, PolynomialSampling),
    ("k*abs(u)*w + b*w'**3", {"w": 1, "u": [1.0, -2.0, 0.0]}, CornerSampling),
    ("k*abs(u)*max(w, 0)", {"w": 1, "u": [1.0, -2.0, 0.0]}, CornerSampling),
    ("k*abs(abs(u) - w)*w", {"w": 1, "u": [1.0, -2.0, 0.0]}, AdaptiveSampling),
    ("k*max(u - j, 0)*w", {"u": [1.0, -2.0, 0.0], "w": 1}, CornerSampling),
]


@pytest.mark.parametrize(("text", "inputs", "kind"), CASES, ids=[case[0] for case in CASES])
def test_all_derivatives_agree_with_differences_and_the_law_is_known_for_what_it_is(text, inputs, kind):
    element = so.Expression(0, text, inputs)
    report = so.check_derivatives(element, parameters=VALUES)
    assert report.ok, str(report)
    assert any(name.startswith("f_u0u0u0") for name in report.errors)
    c = element.coefficient_values({name: VALUES[name] for name in element.coefficient_names})
    assert isinstance(element.sampling(c), kind)


@pytest.mark.parametrize(
    "text", ["2*x**3 - x**2/3", "x*cosh(x) - tanh(x**2)", "max(x, 0.3)*x + x", "abs(x)**3", "-x**2"]
)
def test_values_are_those_of_python(text):
    from math import cosh, tanh

    element = so.Expression(0, text)
    u = np.array([[-1.1, -0.2, 0.2, 0.9]])
    expected = [
        eval(text, {"__builtins__": {}, "x": x, "cosh": cosh, "tanh": tanh, "max": max, "abs": abs}) for x in u[0]
    ]
    np.testing.assert_allclose(element.tangent(u, np.zeros(4), np.zeros(0))[0], expected, rtol=1e-14)


def test_time_is_the_phase_of_the_load():
    element = so.Expression(0, "cos(2*omega*t + 0.3)*x + sin(omega*t)**3")
    theta = np.linspace(0.0, 6.0, 7)
    f = element.tangent(np.full((1, 7), 1.7), theta, np.zeros(0))[0]
    np.testing.assert_allclose(f, 1.7 * np.cos(2 * theta + 0.3) + np.sin(theta) ** 3, atol=1e-14)
    assert element.depends_on_time
    assert element.time_harmonic == 3


def test_corners_follow_the_parameters():
    element = so.Expression(0, "k*max(2*x - j, 0) + c*abs(v + 3)*v")
    places = element.sampling(element.coefficient_values({"k": 1.0, "j": 0.6, "c": 0.1}))
    assert places == CornerSampling((0.3,), (-3.0,))


def test_directions_and_inputs():
    def places(*args, n=2, **kwargs):
        element = so.Expression(*args, **kwargs)
        return element.direction(n).tolist(), element.inputs(n).tolist()

    assert places(expression="x**3", direction=[1, 0]) == ([1.0, 0.0], [[1.0, 0.0]])
    assert places((0, 1), "x**3") == ([1.0, -1.0], [[1.0, -1.0]])
    assert places(0, "x*y", {"x": 1, "y": [1, 0]}) == ([1.0, 0.0], [[0.0, 1.0], [-1.0, 1.0]])
    assert places(0, "x*y", {"x": 1, "y": [1.0, 2.0]}) == ([1.0, 0.0], [[0.0, 1.0], [1.0, 2.0]])


def test_an_expression_survives_pickling():
    element = so.Expression((0, 1), "k*max(x - j, 0)*v")
    element.tangent(np.ones((2, 1)), np.zeros(1), np.ones(2))
    copy = pickle.loads(pickle.dumps(element))
    assert repr(copy) == repr(element)
    np.testing.assert_array_equal(copy.tangent(np.ones((2, 1)), np.zeros(1), np.full(2, 0.5))[0], [0.25])


REFUSED = [
    ("__import__('os').system('x')", "not allowed"),
    ("x.real", "not allowed"),
    ("().__class__", "not allowed"),
    ("[y for y in x]", "not allowed"),
    ("lambda: x", "not allowed"),
    ("x if x else 0", "not allowed"),
    ("x[0]", "not allowed"),
    ("x == 1", "not allowed"),
    ("f'{x}'", "write x' for a velocity|cannot read|not allowed"),
    ("9**9**9**9*x", "power is larger"),
    ("x**9**9", "power is larger"),
    ("1e400*x", "not a finite"),
    ("exp(exp(exp(1000)))*x", "not a finite"),
    ("x/0", "division by zero"),
    ("(" * 400 + "x" + ")" * 400, "nested too deeply"),
    ("sin(" * 350 + "x" + ")" * 350, "nested"),
    ("-" * 5000 + "x", "nested too deeply"),
    ("+".join(["x"] * 9000), "too long"),
    ("max(x*x, " * 40 + "x" + ")" * 40, "this long"),
    ("", "empty"),
    ("2*", "cannot read"),
    ("x + foo(x)", r"column 5, 'foo\(x\)': there is no function 'foo'"),
    ("arctan(x)", "write atan"),
    ("sinn(x)", "did you mean 'sin'"),
    ("max(x, 1, 2)", "max takes 2 arguments"),
    ("sin", "is a function"),
    ("x^3", r"write \*\* for a power"),
    ("x'''", "write x' for a velocity"),
    ("x''", "cannot occur in a force"),
    ("y'*x", "cannot occur in a force"),
    ("k*sign(v)", "the force jumps"),
    ("k*heaviside(x - 1)", "the force jumps"),
    ("k*heaviside(x*v)*x", "cannot be told"),
    ("t*x", "time occurs outside"),
    ("omega*x", "omega occurs outside"),
    ("omega*cos(omega*t)*x", "omega occurs outside"),
    ("cos(t)*x", "does not have the period"),
    ("cos(omega*t/2)*x", "does not have the period"),
    ("cos(omega*t**2)*x", "does not have the period"),
]


@pytest.mark.parametrize(("text", "part"), REFUSED, ids=[case[0][:30] for case in REFUSED])
def test_what_is_no_force_is_refused_quickly_and_in_one_line(text, part):
    begin = time.process_time()
    with pytest.raises(InputError, match=part) as caught:
        so.Expression(0, text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400
    assert time.process_time() - begin < 2.0


def test_other_wrong_arguments():
    with pytest.raises(InputError, match="needs expression"):
        so.Expression(0)
    with pytest.raises(InputError, match="must be a text"):
        so.Expression(0, 3.0)
    with pytest.raises(InputError, match="mapping"):
        so.Expression(0, "x", ["x"])
    with pytest.raises(InputError, match="cannot name a displacement"):
        so.Expression(0, "x", {"sin": 0})
    system = {"mass": 1.0, "damping": 0.1, "stiffness": 1.0, "loads": [so.HarmonicLoad(0, 1.0)]}
    with pytest.raises(InputError, match=r"unknown parameter 'alpa'.*did you mean 'alpha'"):
        so.System(
            **system, elements=[so.Expression(0, "alpa*x**3"), so.CubicSpring(0, "alpha")], parameters={"alpha": 1.0}
        )
    with pytest.raises(InputError, match="dof 1 does not exist"):
        so.System(**system, elements=[so.Expression(0, "x*y", {"x": 0, "y": 1})])
