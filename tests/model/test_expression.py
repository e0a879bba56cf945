"""Expressions against closed forms and Python's own arithmetic."""

from __future__ import annotations

import math
import pickle
import subprocess
import sys

import pytest

from suboctave.errors import InputError
from suboctave.model import coefficient
from suboctave.model.expressions.reader import FUNCTIONS

VALUES = {"a": 0.37, "b": 1.9, "k": 2.5, "m": 0.8, "omega": 3.1}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2*a", 2 * 0.37),
        ("-a**2", -(0.37**2)),
        ("2**-1", 0.5),
        ("b - a - k", 1.9 - 0.37 - 2.5),
        ("b/a/k", 1.9 / 0.37 / 2.5),
        ("2**3**2", 512.0),
        ("+a + -(-b)", 0.37 + 1.9),
        ("sqrt(k/m)", math.sqrt(2.5 / 0.8)),
        ("a*cos(pi*b) + 1e-3", 0.37 * math.cos(math.pi * 1.9) + 1e-3),
        ("m*a*omega**2", 0.8 * 0.37 * 3.1**2),
        (" ( a ) ", 0.37),
        ("abs(a - b)", 1.53),
        ("b**a", 1.9**0.37),
    ],
)
def test_value_is_that_of_ordinary_arithmetic(text, expected):
    assert coefficient(text).value(VALUES) == pytest.approx(expected, rel=1e-15)


# The derivative by a, written out by hand.
DERIVATIVES = [
    ("3.5", "0"),
    ("a", "1"),
    ("2*a", "2"),
    ("a/4 - b", "1/4"),
    ("b - 2*(a - k)", "-2"),
    ("a*b", "b"),
    ("a**3", "3*a**2"),
    ("a**0.5", "0.5*a**-0.5"),
    ("k/a", "-k/a**2"),
    ("2*a*sqrt(k*m)", "2*sqrt(k*m)"),
    ("sqrt(a*m)", "m/(2*sqrt(a*m))"),
    ("sin(k*a)", "k*cos(k*a)"),
    ("cos(a)", "-sin(a)"),
    ("tan(a)", "1/cos(a)**2"),
    ("asin(a)", "1/sqrt(1 - a**2)"),
    ("acos(a)", "-1/sqrt(1 - a**2)"),
    ("atan(b*a)", "b/(1 + (b*a)**2)"),
    ("exp(-a*b)", "-b*exp(-a*b)"),
    ("log(a)", "1/a"),
    ("sinh(a)", "cosh(a)"),
    ("cosh(a)", "sinh(a)"),
    ("tanh(a)", "1/cosh(a)**2"),
    ("abs(a - b)", "-1"),
    ("abs(log(a))*b", "-b/a"),
    ("abs(3)*sqrt(a**2)", "3"),
    ("abs(a*b)**2", "2*a*b**2"),
    ("b**a", "log(b)*b**a"),
    ("a*omega**2", "omega**2"),
]


@pytest.mark.parametrize(("text", "by_hand"), DERIVATIVES)
def test_derivative_is_the_one_by_hand(text, by_hand):
    derivative = coefficient(text).derivative("a")
    assert derivative.value(VALUES) == pytest.approx(coefficient(by_hand).value(VALUES), rel=1e-14)


def test_every_function_has_a_derivative_in_the_table_above():
    assert {name for name in FUNCTIONS if any(f"{name}(" in text for text, _ in DERIVATIVES)} == set(FUNCTIONS)


@pytest.mark.parametrize("text", ["a**3*b**2", "sin(a*b)/k", "exp(a)*log(b + a)", "tanh(a*b)**2"])
def test_second_derivatives_do_not_depend_on_the_order(text):
    source = coefficient(text)
    ab, ba = source.derivative("a").derivative("b"), source.derivative("b").derivative("a")
    assert ab.value(VALUES) == pytest.approx(ba.value(VALUES), rel=1e-13)
    h = 1e-5
    shifted = [source.derivative("a").value({**VALUES, "b": VALUES["b"] + s * h}) for s in (1, -1)]
    assert ab.value(VALUES) == pytest.approx((shifted[0] - shifted[1]) / (2 * h), rel=1e-8)


def test_second_derivative_of_abs_is_zero_off_its_corner():
    assert coefficient("b*abs(a)").derivative("a").derivative("a").value(VALUES) == 0.0


def test_names_and_constants():
    assert coefficient("2*a + sqrt(b)").names == {"a", "b"}
    assert coefficient("a**2*b").derivative("a").names == {"a", "b"}
    for constant in (3, 2.5, "2*pi", "sqrt(2)", "-1.0"):
        assert coefficient(constant).constant
    assert coefficient("2*a").derivative("nowhere").value({}) == 0.0


def test_affine_expressions_need_no_sympy():
    code = (
        "import sys; from suboctave.model import coefficient;"
        "assert coefficient('2*zeta - (j + 1)/4').derivative('j').value({}) == -0.25;"
        "assert 'sympy' not in sys.modules and 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_derivatives_survive_pickling():
    source = coefficient("a**2*sin(b)").derivative("a").derivative("b")
    copy = pickle.loads(pickle.dumps(source))
    assert copy == source
    assert copy.value(VALUES) == source.value(VALUES)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "it is empty"),
        ("2*", "cannot read"),
        ("a b", "cannot read"),
        ("a^2", "write \\*\\* for a power"),
        ("ln(a)", "write log"),
        ("sqr(a)", "did you mean 'sqrt'"),
        ("sin", "needs an argument"),
        ("sin(a, b)", "exactly one argument"),
        ("a.real", "a dot between names"),
        ("a[0]", "an index in brackets"),
        ("__import__('os').system('true')", "is not allowed"),
        ("(lambda: 1)()", "is not allowed"),
        ("open('x')", "there is no function 'open'"),
        ("'a'", "a text, a truth value"),
        ("2j*a", "imaginary"),
        ("True", "truth value"),
        ("a if b else k", "if/else"),
        ("a < b", "a comparison"),
        ("a*t", "time cannot occur"),
        ("1/0", "not a finite real number"),
        ("sqrt(-1)", "not a finite real number"),
        ("(-8)**(1/3)", "not a finite real number"),
        ("9**9**9**9", "is larger than 1000"),
        ("10**1000", "not a finite real number"),
        ("1e999", "not a finite real number"),
        ("a**100000", "is larger than 1000"),
        ("(" * 500 + "a" + ")" * 500, "nested too deeply"),
        ("-" * 900 + "a", "nested"),
        ("a" * 20000, "too long"),
    ],
)
def test_what_is_not_allowed_is_refused_with_a_reason(text, part):
    with pytest.raises(InputError, match=part):
        coefficient(text)


@pytest.mark.parametrize("source", [True, None, 1j, float("nan"), float("inf"), [1.0], b"a"])
def test_what_is_no_number_is_refused(source):
    with pytest.raises(InputError):
        coefficient(source)


@pytest.mark.parametrize("text", ["log(a)", "sqrt(a)", "1/(a + 1)", "exp(1e3*b)", "a**0.5"])
def test_a_value_that_is_not_finite_is_refused_where_it_arises(text):
    with pytest.raises(InputError, match=r"is not a finite real number at "):
        coefficient(text).value({"a": -1.0, "b": 2.0})


def test_missing_value_is_named():
    with pytest.raises(InputError, match=r"needs a value for 'zeta' \(did you mean 'Zeta'\?\)"):
        coefficient("2*zeta").value({"Zeta": 1.0})
