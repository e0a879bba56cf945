"""Expressions as SymPy's, which differentiates them. Imported when the first of them is.

Expressions are built from forms that the reader has accepted: no text is handed to SymPy's parser. `abs`, `sign`,
`heaviside`, and `max(a, b) = b + ramp(a - b)` become functions of our own whose derivatives are those on either side of
the corner (the regular parts); whether a force is continuous there is checked elsewhere (`law`). SymPy's own `Abs`
allows for complex arguments, which makes `abs(log(a))` a derivative of real and imaginary parts.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from typing import Any

import sympy

from suboctave.errors import InputError, suggest
from suboctave.model.expressions.reader import CORNERS, FUNCTIONS, PRIME, Form, read

__all__ = [
    "CORNER_FUNCTIONS",
    "Modulus",
    "PositiveRamp",
    "Ramp",
    "Sign",
    "Step",
    "expanded_size",
    "expression_of",
    "force_expression",
    "number",
    "symbol",
]

_LARGEST_INTEGER = 10**12


class Step(sympy.Function):
    """1 where its argument is positive, else 0."""

    def fdiff(self, argindex: int = 1) -> Any:
        """Zero away from the jump."""
        return sympy.S.Zero


class Sign(sympy.Function):
    """Sign of its argument."""

    def fdiff(self, argindex: int = 1) -> Any:
        """Zero away from the jump."""
        return sympy.S.Zero


class Ramp(sympy.Function):
    """`max(a, 0)`."""

    def fdiff(self, argindex: int = 1) -> Any:
        """On either side of the"""
        return Step(self.args[0])


class Modulus(sympy.Function):
    """`|a|` of a real argument."""

    def fdiff(self, argindex: int = 1) -> Any:
        """On either side of the"""
        return Sign(self.args[0])


class PositiveRamp(sympy.Function):
    """A ramp that stays above zero: where a power of one is divided by, off its corner, zero times it is zero."""


#: functions with a corner or a jump where their argument is zero
CORNER_FUNCTIONS = (Ramp, Step, Modulus, Sign)


@functools.cache
def symbol(name: str) -> Any:
    """The real symbol of a name."""
    return sympy.Symbol(name, real=True)


def force_expression(text: str, where: str, names: Iterable[str] | None = None) -> Any:
    """The SymPy expression of a text in which forces may have corners and names primes, for derivatives by time.

    `where` begins messages; `names` are those that are known, None if any may occur. The primes of symbols are `PRIME`.

    Raises
    ------
    InputError
        With the column and the part of the text that is not allowed.
    """
    known = None if names is None else frozenset(names)

    def refusal(name: str) -> str | None:
        plain = name.rstrip(PRIME)
        if PRIME in plain or len(name) - len(plain) > 2 or not plain:
            return "write x' for a velocity and x'' for an acceleration"
        if known is not None and name not in known:
            shown = name.replace(PRIME, "'")
            return f"unknown name {shown!r}{suggest(shown, [one.replace(PRIME, chr(39)) for one in known])}"
        return None

    plain = text.replace("\u2032", "'").replace("\u2019", "'").replace("'", PRIME)
    expression = expression_of(read(plain, where, {**FUNCTIONS, **CORNERS}, refusal))
    if not all(map(_finite, expression.atoms(sympy.Number))):
        raise InputError(f"{where}: a factor of {text!r:.60} is not a finite real number")
    return expression


def _finite(factor: Any) -> bool:
    try:
        return math.isfinite(float(factor))
    except OverflowError:
        return False


def expression_of(form: Form) -> Any:
    """The SymPy expression of a form."""
    # SymPy itself writes Abs for the root of a square
    return _converted(form).replace(sympy.Abs, Modulus)


def _converted(form: Form) -> Any:
    if form.operation == "name":
        return symbol(form.parts[0])
    if form.operation == "pi":
        return sympy.pi
    if form.constant is not None and form.operation not in ("negative", "+", "-", "*", "/"):
        return number(form.constant)
    match form.operation, [_converted(part) for part in form.parts]:
        case "negative", [a]:
            return -a
        case "+", [a, b]:
            return a + b
        case "-", [a, b]:
            return a - b
        case "*", [a, b]:
            return a * b
        case "/", [a, b]:
            return a / b
        case "**", [a, b]:
            exponent = form.parts[1].constant
            half = exponent is not None and (2.0 * exponent).is_integer()
            return a ** (sympy.Rational(int(2.0 * exponent), 2) if half else b)
        case "max", [a, b]:
            return b + Ramp(a - b)
        case "min", [a, b]:
            return b - Ramp(b - a)
        case "abs", [a]:
            return Modulus(a)
        case "sign", [a]:
            return Sign(a)
        case "heaviside", [a]:
            return Step(a)
        case name, [a]:
            return getattr(sympy, name)(a)
    raise AssertionError(f"{form.operation} was read but has no expression")


def number(value: float) -> Any:
    """A number, exact if it is whole."""
    if float(value).is_integer() and abs(value) < _LARGEST_INTEGER:
        return sympy.Integer(int(value))
    return sympy.Float(float(value))


def expanded_size(expression: Any) -> float:
    """Upper bound of the number of terms after expansion."""
    if expression.is_Add:
        return sum(expanded_size(part) for part in expression.args)
    if expression.is_Mul:
        return math.prod((expanded_size(part) for part in expression.args), start=1.0)
    if expression.is_Pow and expression.exp.is_Integer and expression.exp > 0:
        return float(expanded_size(expression.base)) ** min(int(expression.exp), 60)
    return 1.0
