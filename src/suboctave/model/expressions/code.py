"""SymPy expressions as code and as text. Imported when the first of them is needed.

One printer writes Python code with NumPy's names for functions. What the names stand for decides what the code works
on: arrays (`array_function`), numbers (`scalar_function`), or whatever a generated kernel imports under them
(`lines_of_code`). Code runs with symbols of our own; no user's text enters it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.str import StrPrinter

from suboctave.errors import InputError
from suboctave.model.expressions.derivatives import Modulus
from suboctave.model.expressions.reader import CORNERS, FUNCTIONS, PRIME, Evaluate

__all__ = ["array_function", "as_text", "lines_of_code", "scalar_function"]

_PLAIN = {"Ramp": "max({}, 0)", "Step": "heaviside({})", "Modulus": "abs({})", "Sign": "sign({})"}
_CODE = {
    "Ramp": "maximum({}, 0.0)", "Step": "heaviside({}, 0.0)", "Modulus": "absolute({})", "Abs": "absolute({})",
    "Sign": "sign({})", "sign": "sign({})", "PositiveRamp": "maximum({}, 1e-60)", "DiracDelta": "0.0",
}  # fmt: skip
_NUMPY = (
    "sqrt", "exp", "log", "sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "absolute", "sign",
    "maximum", "heaviside",
)  # fmt: skip
_SCALAR = {
    **FUNCTIONS, "arcsin": math.asin, "arccos": math.acos, "arctan": math.atan, "absolute": math.fabs,
    "sign": CORNERS["sign"], "maximum": max, "heaviside": lambda x, there: CORNERS["heaviside"](x),
}  # fmt: skip
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
    try:
        value = float(e)
    except (TypeError, OverflowError):
        value = math.nan
    if not math.isfinite(value):
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


def _function(arguments: Sequence[Any], parts: Sequence[Any], space: Mapping[str, Any]) -> Callable[..., Any]:
    """The function of these symbols whose values are those of the parts."""
    printer = _Code()
    function: Callable[..., Any] = sympy.lambdify(
        arguments, parts, modules=[dict(space)], printer=printer, dummify=True, cse=True
    )
    return function


def array_function(parts: Sequence[Any], q: Sequence[Any], theta: Any, c: Sequence[Any]) -> Callable[..., Any]:
    """A function `(q, theta, c) -> (len(parts), N)` of arrays (Q, N), (N,), (nc,)."""
    law = _function([*q, theta, *c], parts, {name: getattr(np, name) for name in _NUMPY})

    def rows(q: Any, theta: Any, c: Any) -> Any:
        out = np.empty((len(parts), theta.shape[0]))
        with np.errstate(all="ignore"):  # what is not finite is noticed where it is used
            for row, value in zip(out, law(*q, theta, *c), strict=True):
                row[:] = value
        return out

    return rows


def scalar_function(expression: Any) -> tuple[Evaluate, frozenset[str]]:
    """An expression as a function of the values of its names, and these."""
    symbols = sorted(expression.free_symbols, key=str)
    names = [one.name for one in symbols]
    law = _function(symbols, [expression.replace(sympy.Abs, Modulus)], _SCALAR)

    def value(values: Mapping[str, float]) -> float:
        result = law(*[values[name] for name in names])[0]
        return result if isinstance(result, float) else math.nan  # a root of a negative number is complex

    return value, frozenset(names)
