"""Expressions as SymPy's, which differentiates them, and again as code and text. Imported when the first is needed.

Expressions are built from forms that the reader has accepted: no text is handed to SymPy's parser. `abs`, `sign`,
`heaviside`, and `max(a, b) = b + ramp(a - b)` become functions of our own whose derivatives are those on either side of
the corner (the regular parts); whether a force is continuous there is checked elsewhere (`law`). SymPy's own `Abs`
allows for complex arguments, which makes `abs(log(a))` a derivative of real and imaginary parts.

One printer writes Python code with NumPy's names for functions. What the names stand for decides what the code works
on: arrays (`array_function`), or whatever a generated kernel imports under them (`lines_of_code`). Code runs with
symbols of our own; no user's text enters it. The other writes texts that the reader turns into the same expression, and
that are code of numbers (`derivative_form`).
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.str import StrPrinter

from suboctave.errors import InputError, suggest
from suboctave.model.expressions.reader import CORNERS, FUNCTIONS, PRIME, Form, read

_LARGEST_INTEGER = 10**12


class _Corner(sympy.Function):
    """A function with a corner or a jump where its argument is zero; `slope` is its derivative on either side."""

    slope: type[sympy.Function] | None = None

    def fdiff(self, argindex: int = 1) -> Any:
        """The regular part."""
        return sympy.S.Zero if self.slope is None else self.slope(self.args[0])


class Step(_Corner):
    """1 where its argument is positive, else 0."""


class Sign(_Corner):
    """Sign of its argument."""


class Ramp(_Corner):
    """`max(a, 0)`."""

    slope = Step


class Modulus(_Corner):
    """`|a|` of a real argument."""

    slope = Sign


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
    InputError tells the column and the part of the text that is not allowed.
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
    if any(real_number(factor) is None for factor in expression.atoms(sympy.Number)):
        raise InputError(f"{where}: a factor of {text!r:.60} is not a finite real number")
    return expression


def real_number(value: Any) -> float | None:
    """A finite real number, None for all else (an expression, a complex number, infinity)."""
    try:
        real = float(value)
    except (TypeError, OverflowError):
        return None
    return real if math.isfinite(real) else None


def expression_of(form: Form) -> Any:
    """The SymPy expression of a form."""
    # SymPy itself writes Abs for the root of a square
    return _converted(form).replace(sympy.Abs, Modulus)


#: operations and functions that SymPy has under another name, or that are ours
_EXPRESSIONS: dict[str, Callable[..., Any]] = {
    "negative": operator.neg, "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "max": lambda a, b: b + Ramp(a - b), "min": lambda a, b: b - Ramp(b - a),
    "abs": Modulus, "sign": Sign, "heaviside": Step,
}  # fmt: skip


def _converted(form: Form) -> Any:
    match form.operation, form.parts:
        case "name", (name,):
            return symbol(name)
        case "pi", _:
            return sympy.pi
        case "expression", (expression,):
            return expression
        case name, _ if form.constant is not None and name not in ("negative", "+", "-", "*", "/"):
            return number(form.constant)
        case "**", (base, exponent):
            twice = math.nan if exponent.constant is None else 2.0 * exponent.constant
            return _converted(base) ** (sympy.Rational(int(twice), 2) if twice.is_integer() else _converted(exponent))
        case name, parts:
            return (_EXPRESSIONS.get(name) or getattr(sympy, name))(*map(_converted, parts))


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


_PLAIN = {"Ramp": "max({}, 0)", "Step": "heaviside({})", "Modulus": "abs({})", "Sign": "sign({})"}
_CODE = {
    "Ramp": "maximum({}, 0.0)", "Step": "(1.0 * ({} > 0.0))", "Modulus": "absolute({})", "Abs": "absolute({})",
    "Sign": "sign({})", "sign": "sign({})", "PositiveRamp": "maximum({}, 1e-60)", "DiracDelta": "0.0",
}  # fmt: skip
_SCALAR = {"pi": math.pi, **FUNCTIONS, **CORNERS}
#: powers up to this one are products
_PRODUCTS = 4


class _Code(NumPyPrinter):
    """Numbers are written as floats, small powers as products: NumPy's power is slow."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": False})

    def _print_Number(self, e: Any) -> str:
        return _float_text(e)

    _print_Integer = _print_Rational = _print_Float = _print_Zero = _print_One = _print_Number
    _print_Half = _print_NegativeOne = _print_NumberSymbol = _print_Number
    _print_Pi = _print_Exp1 = _print_Infinity = _print_NegativeInfinity = _print_Number
    _print_ComplexInfinity = _print_NaN = _print_ImaginaryUnit = _print_Number

    def _print_Function(self, e: Any) -> str:
        written = _CODE.get(type(e).__name__)
        if written is None:
            raise InputError(f"a derivative contains {e}, which has no value; write the expression differently")
        return written.format(*(self._print(argument) for argument in e.args))

    _print_Abs = _print_DiracDelta = _print_not_supported = _print_Function

    def _print_Pow(self, e: Any, rational: bool = False) -> str:
        if e.exp.is_number and e.exp.is_negative:
            return f"(1.0/({self._print(e.base ** (-e.exp))}))"
        if e.exp.is_number and float(e.exp) == 0.5:
            return f"sqrt({self._print(e.base)})"
        if e.exp.is_Integer and e.exp <= _PRODUCTS and e.base.is_Symbol:
            return f"({'*'.join([self._print(e.base)] * int(e.exp))})"
        return f"({self._print(e.base)})**({self._print(e.exp)})"


class _Text(StrPrinter):
    """What the reader turns into the same expression."""

    def _print_Float(self, e: Any) -> str:
        return _float_text(e)

    _print_Exp1 = _print_Infinity = _print_NegativeInfinity = _print_Float
    _print_ComplexInfinity = _print_NaN = _print_ImaginaryUnit = _print_Float

    def _print_Function(self, e: Any) -> str:
        inner = ", ".join(self._print(argument) for argument in e.args)
        name = type(e).__name__
        return _PLAIN.get(name, name + "({})").format(inner)


def _float_text(e: Any) -> str:
    value = real_number(e)
    if value is None:
        raise InputError(f"{e} is not a finite real number")
    return repr(value)


def as_text(expression: Any) -> str:
    """A text that `force_expression` turns into the same expression."""
    text: str = _Text().doprint(expression)
    return text.replace(PRIME, "'")


def lines_of_code(parts: Sequence[Any], names: Mapping[str, str], prefix: str) -> tuple[list[str], list[str]]:
    """Lines that compute what the parts have in common, in variables that begin with `prefix`, and code of each part.

    `names` says what code stands for every symbol.
    """
    swaps = {one: sympy.Symbol(names[one.name], real=True) for part in parts for one in part.free_symbols}
    common, reduced = sympy.cse(
        [part.xreplace(swaps) for part in parts], symbols=sympy.numbered_symbols(prefix, real=True)
    )
    printer = _Code()
    lines = [f"{name} = {printer.doprint(value)}" for name, value in common]
    return lines, [printer.doprint(part) for part in reduced]


def derivative_form(form: Form, name: str) -> Form:
    """The derivative of a form by a name."""
    expression = expression_of(form).diff(symbol(name)).replace(sympy.Abs, Modulus)
    symbols = sorted(expression.free_symbols, key=str)
    names = [one.name for one in symbols]
    law = sympy.lambdify(symbols, expression, modules=[_SCALAR], printer=_Text(), dummify=True, cse=True)

    def evaluate(values: Mapping[str, float]) -> float:
        result = law(*[values[one] for one in names])
        return math.nan if isinstance(result, complex) else float(result)  # a root of a negative number is complex

    return Form("expression", (expression,), evaluate, frozenset(names))


def array_function(parts: Sequence[Any], q: Sequence[Any], theta: Any, c: Sequence[Any]) -> Callable[..., Any]:
    """A function `(q, theta, c) -> (len(parts), N)` of arrays (Q, N), (N,), (nc,)."""
    law = sympy.lambdify([*q, theta, *c], parts, modules=[vars(np)], printer=_Code(), dummify=True, cse=True)

    def rows(q: Any, theta: Any, c: Any) -> Any:
        out = np.empty((len(parts), theta.shape[0]))
        with np.errstate(all="ignore"):  # what is not finite is noticed where it is used
            for row, value in zip(out, law(*q, theta, *c), strict=True):
                row[:] = value
        return out

    return rows
