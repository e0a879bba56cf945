"""Exact derivatives of expressions by SymPy. The only module that imports it, and only when it is called.

Expressions are built node by node from syntax that `expression` has already accepted, and turned back into closures by
walking SymPy's tree: no text is handed to SymPy's parser and none is taken back from its printer.
"""

from __future__ import annotations

import ast
import functools
import math
from collections.abc import Callable, Mapping
from typing import Any

from suboctave.errors import InputError
from suboctave.model.expression import FUNCTIONS, Evaluate

__all__ = ["closure", "differentiate", "from_syntax"]

_LARGEST_INTEGER = 2**31


def _symbol(name: str) -> Any:
    import sympy

    return sympy.Symbol(name, real=True)


@functools.cache
def _modulus() -> Any:
    """The modulus of a real argument, straight on either side of its corner.

    SymPy's own `Abs` allows for complex arguments, which makes `abs(log(a))` a derivative of real and imaginary parts.
    """
    import sympy

    class Sign(sympy.Function):
        def fdiff(self, argindex: int = 1) -> Any:
            return sympy.S.Zero

    class Modulus(sympy.Function):
        def fdiff(self, argindex: int = 1) -> Any:
            return Sign(self.args[0])

    return Modulus


def from_syntax(node: ast.expr) -> Any:
    """The SymPy expression of a syntax tree that `expression.coefficient` has accepted."""
    import sympy

    match node:
        case ast.Constant(value=int() as number) if abs(number) < _LARGEST_INTEGER:
            return sympy.Integer(number)
        case ast.Constant(value=int() | float() as number):
            return sympy.Float(float(number))
        case ast.Name(id=name):
            return sympy.pi if name == "pi" else _symbol(name)
        case ast.UnaryOp(op=operation, operand=inner):
            value = from_syntax(inner)
            return -value if isinstance(operation, ast.USub) else value
        case ast.Call(func=ast.Name(id=name), args=[inner]):
            argument = from_syntax(inner)
            if name == "abs":
                return sympy.Abs(argument) if argument.is_number else _modulus()(argument)
            return getattr(sympy, name)(argument)
        case ast.BinOp(left=left, op=operation, right=right):
            a, b = from_syntax(left), from_syntax(right)
            match operation:
                case ast.Add():
                    return a + b
                case ast.Sub():
                    return a - b
                case ast.Mult():
                    return a * b
                case ast.Div():
                    return a / b
                case ast.Pow():
                    return a**b
    raise AssertionError(f"{ast.dump(node)} was accepted but cannot be differentiated")


def differentiate(expression: Any, name: str) -> Any:
    """The derivative of a SymPy expression by the real symbol of that name."""
    return expression.diff(_symbol(name))


def closure(expression: Any) -> tuple[Evaluate, frozenset[str]]:
    """A SymPy expression as a closure over the parameters' values, with the names that occur in it."""
    names = frozenset(symbol.name for symbol in expression.free_symbols)
    return _closure(expression), names


def _closure(expression: Any) -> Evaluate:
    if expression.is_Symbol:
        name = expression.name
        return lambda values: values[name]
    if not expression.free_symbols:
        number = _number(expression)
        return lambda _: number
    if expression.is_Pow:
        return _power(expression)
    parts = [_closure(argument) for argument in expression.args]
    if expression.is_Add:
        return _sum(parts)
    if expression.is_Mul:
        return _product(parts)
    function = _function(type(expression).__name__)
    if function is None or len(parts) != 1:
        raise InputError(f"a derivative contains {expression}, which has no value; write the expression differently")
    inner = parts[0]
    return lambda values: function(inner(values))


def _number(expression: Any) -> float:
    try:
        value = complex(expression)
    except (TypeError, OverflowError):
        value = complex(math.nan)
    if value.imag or not math.isfinite(value.real):
        raise InputError(f"a derivative contains {expression}, which is not a finite real number")
    return value.real


def _function(name: str) -> Callable[[float], float] | None:
    if name in ("Modulus", "Abs"):  # SymPy itself writes Abs for the root of a square
        return math.fabs
    if name in ("Sign", "sign"):
        return lambda x: float((x > 0.0) - (x < 0.0))
    if name == "DiracDelta":
        return lambda x: 0.0
    return FUNCTIONS.get(name)


def _sum(parts: list[Evaluate]) -> Evaluate:
    if len(parts) == 2:
        f, g = parts
        return lambda values: f(values) + g(values)

    def total(values: Mapping[str, float]) -> float:
        result = 0.0
        for part in parts:
            result += part(values)
        return result

    return total


def _product(parts: list[Evaluate]) -> Evaluate:
    if len(parts) == 2:
        f, g = parts
        return lambda values: f(values) * g(values)

    def product(values: Mapping[str, float]) -> float:
        result = 1.0
        for part in parts:
            result *= part(values)
        return result

    return product


def _power(expression: Any) -> Evaluate:
    base, exponent = _closure(expression.base), expression.exp
    if exponent.is_Rational and exponent.q == 2 and exponent.p in (1, -1):
        root = math.sqrt
        if exponent.p == 1:
            return lambda values: root(base(values))
        return lambda values: 1.0 / root(base(values))
    if exponent == -1:
        return lambda values: 1.0 / base(values)
    if exponent == 2:

        def square(values: Mapping[str, float]) -> float:
            x = base(values)
            return x * x

        return square
    power, raised = math.pow, _closure(exponent)
    return lambda values: power(base(values), raised(values))
