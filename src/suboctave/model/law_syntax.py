"""Texts of forces and equations as SymPy expressions, read node by node against a short list of what is allowed.

Python's own parser makes the syntax tree; no text is handed to SymPy or evaluated. A prime after a name stands for a
derivative by time (`x'`, `x''`). Besides what coefficients may contain (`expression`) there are forces with corners:
`sign`, `max` and `min` of two arguments, `heaviside`. They are functions of our own whose derivatives are those on
either side of the corner (the regular parts); whether the force is continuous there is checked elsewhere (`law_code`).
"""

from __future__ import annotations

import ast
import functools
import math
from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

from suboctave.errors import InputError, suggest
from suboctave.model.expression import FUNCTIONS

__all__ = ["LONGEST", "PRIME", "corner_functions", "read", "symbol"]

#: what a prime is written as while Python parses the text: a letter of the same length
PRIME = "\u02c8"
_ONE = (*FUNCTIONS, "sign", "heaviside")
_TWO = ("max", "min")
_ELSEWHERE = {
    "ln": "log", "arctan": "atan", "arcsin": "asin", "arccos": "acos", "fabs": "abs", "Abs": "abs", "Max": "max",
    "Min": "min", "sgn": "sign", "Heaviside": "heaviside", "step": "heaviside", "pow": "x**y instead",
}  # fmt: skip
LONGEST, _DEEPEST, _LARGEST_POWER, _LARGEST_INTEGER = 10_000, 300, 1000, 10**12
_MOST_OPERATIONS = 500


@functools.cache
def corner_functions() -> SimpleNamespace:
    """`Ramp(a) = max(a, 0)`, `Step(a)`, `Modulus(a)`, `Sign(a)` with their derivatives away from a = 0."""
    import sympy

    class Step(sympy.Function):
        def fdiff(self, argindex: int = 1) -> Any:
            return sympy.S.Zero

    class Sign(sympy.Function):
        def fdiff(self, argindex: int = 1) -> Any:
            return sympy.S.Zero

    class Ramp(sympy.Function):
        def fdiff(self, argindex: int = 1) -> Any:
            return Step(self.args[0])

    class Modulus(sympy.Function):
        def fdiff(self, argindex: int = 1) -> Any:
            return Sign(self.args[0])

    class PositiveRamp(sympy.Function):
        """A ramp that stays above zero: where a power of one is divided by, off its corner, zero times it is zero."""

    return SimpleNamespace(Step=Step, Sign=Sign, Ramp=Ramp, Modulus=Modulus, PositiveRamp=PositiveRamp)


@functools.cache
def symbol(name: str) -> Any:
    """The real symbol of a name."""
    import sympy

    return sympy.Symbol(name, real=True)


def read(text: str, where: str, names: Iterable[str] | None = None) -> Any:
    """The SymPy expression of a text; primes have been accepted in it as part of names.

    `where` begins messages; `names` are those that are known, None if any may occur.

    Raises
    ------
    InputError
        With the column and the part of the text that is not allowed.
    """
    plain = text.replace("\u2032", "'").replace("\u2019", "'").replace("'", PRIME)
    if len(plain) > LONGEST:
        raise InputError(f"{where}: {len(plain)} characters are too many (at most {LONGEST})")
    begin = len(plain) - len(plain.lstrip())
    try:
        tree = ast.parse(plain.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, RecursionError | MemoryError) or "nested" in str(error):
            raise InputError(f"{where}: nested too deeply; split it into parameters or terms") from None
        if not plain.strip():
            raise InputError(f"{where}: the expression is empty") from None
        column = getattr(error, "offset", None)
        at = f" at column {begin + column}" if column else ""
        raise InputError(f"{where}{at}: cannot read {_shortened(text)}: {getattr(error, 'msg', error)}") from None
    found = _Reader(plain, begin, where, None if names is None else frozenset(names)).read(tree, 0)
    import sympy

    if not all(_has_float(number) for number in found.atoms(sympy.Number)):
        raise InputError(f"{where}: a factor of {_shortened(text)} is not a finite real number")
    return found


def _has_float(number: Any) -> bool:
    try:
        return math.isfinite(float(number))
    except OverflowError:
        return False


def _power(expression: Any) -> float:
    """The highest power of anything in an expression; powers of powers are multiplied."""
    if expression.is_Pow and expression.exp.is_number:
        return _power(expression.base) * abs(float(expression.exp))
    parts = [_power(part) for part in expression.args] if expression.is_Add or expression.is_Mul else []
    if not parts:
        return 1.0 if expression.free_symbols else 0.0
    return sum(parts) if expression.is_Mul else max(parts)


def _shortened(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...").replace(PRIME, "'")


class _Reader:
    def __init__(self, text: str, begin: int, where: str, names: frozenset[str] | None) -> None:
        self.text, self.begin, self.where, self.names = text, begin, where, names

    def refuse(self, node: ast.AST, reason: str) -> InputError:
        source = self.text.strip()
        offset = getattr(node, "col_offset", 0)
        column = len(source.encode()[:offset].decode()) + self.begin + 1
        part = ast.get_source_segment(source, node) or ""
        return InputError(f"{self.where} at column {column}, {_shortened(part.replace(PRIME, chr(39)))}: {reason}")

    def read(self, node: ast.expr, depth: int) -> Any:
        if depth > _DEEPEST:
            raise self.refuse(node, f"more than {_DEEPEST} nested operations; split it into parameters or terms")
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return self.number(node, lambda: number)
            case ast.Name(id=name):
                return self.name(node, name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=inner):
                value = self.read(inner, depth + 1)
                return -value if isinstance(sign, ast.USub) else value
            case ast.BinOp(left=left, op=operation, right=right):
                return self.binary(node, operation, self.read(left, depth + 1), self.read(right, depth + 1))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _ONE + _TWO:
                wanted = 1 if name in _ONE else 2
                if len(arguments) != wanted or any(isinstance(a, ast.Starred) for a in arguments):
                    raise self.refuse(node, f"{name} takes {wanted} argument{'s' * (wanted > 1)}")
                return self.call(node, name, [self.read(a, depth + 1) for a in arguments])
            case ast.Call(func=ast.Name(id=name)):
                hint = f"; write {_ELSEWHERE[name]}" if name in _ELSEWHERE else suggest(name, _ONE + _TWO)
                raise self.refuse(node, f"there is no function {name!r}{hint}")
        raise self.refuse(
            node, "not allowed (numbers, names, + - * / **, parentheses, functions, primes for derivatives by time)"
        )

    def number(self, node: ast.AST, compute: Callable[[], float | int]) -> Any:
        """A part without names is computed at once; it must be finite."""
        import sympy

        try:
            value = compute()
            finite = math.isfinite(value)
        except (ValueError, ZeroDivisionError, OverflowError, TypeError):
            finite = False
        if not finite:
            raise self.refuse(node, "not a finite real number")
        if float(value).is_integer() and abs(value) < _LARGEST_INTEGER:
            return sympy.Integer(int(value))
        return sympy.Float(float(value))

    def real(self, node: ast.AST, value: Any) -> float:
        """The number that a part without names stands for."""
        try:
            return float(value)
        except (TypeError, OverflowError):
            raise self.refuse(node, "not a finite real number") from None

    def name(self, node: ast.AST, name: str) -> Any:
        import sympy

        plain = name.rstrip(PRIME)
        if name == "pi":
            return sympy.pi
        if plain in _ONE + _TWO:
            raise self.refuse(node, f"{plain} is a function and needs arguments in parentheses")
        if PRIME in plain or len(name) - len(plain) > 2 or not plain:
            raise self.refuse(node, "write x' for a velocity and x'' for an acceleration")
        if self.names is not None and name not in self.names:
            shown = name.replace(PRIME, "'")
            known = [n.replace(PRIME, "'") for n in self.names]
            raise self.refuse(node, f"unknown name {shown!r}{suggest(shown, known)}")
        return symbol(name)

    def call(self, node: ast.AST, name: str, arguments: list[Any]) -> Any:
        import sympy

        first = arguments[0]
        corner = corner_functions()
        if all(not argument.free_symbols for argument in arguments):
            values = [self.real(node, argument) for argument in arguments]
            plain: dict[str, Callable[..., float]] = {
                **FUNCTIONS,
                "max": max,
                "min": min,
                "sign": lambda x: float((x > 0) - (x < 0)),
                "heaviside": lambda x: float(x > 0),
            }
            return self.number(node, lambda: plain[name](*values))
        if name == "abs":
            return corner.Modulus(first)
        if name == "sign":
            return corner.Sign(first)
        if name == "heaviside":
            return corner.Step(first)
        if name in _TWO and sum(int(argument.count_ops()) for argument in arguments) > _MOST_OPERATIONS:
            raise self.refuse(node, f"{name} of arguments this long; split it into terms")
        if name == "max":
            return arguments[1] + corner.Ramp(first - arguments[1])
        if name == "min":
            return arguments[1] - corner.Ramp(arguments[1] - first)
        return getattr(sympy, name)(first)

    def binary(self, node: ast.AST, operation: ast.operator, a: Any, b: Any) -> Any:
        import sympy

        fixed = not a.free_symbols and not b.free_symbols
        match operation:
            case ast.Add():
                return a + b
            case ast.Sub():
                return a - b
            case ast.Mult():
                return a * b
            case ast.Div():
                if b.is_zero:
                    raise self.refuse(node, "division by zero")
                return a / b
            case ast.Pow():
                if not b.free_symbols:
                    exponent = self.real(node, b)
                    if max(1.0, _power(a)) * abs(exponent) > _LARGEST_POWER:
                        raise self.refuse(node, f"the power is larger than {_LARGEST_POWER}")
                    if float(2.0 * exponent).is_integer():
                        b = sympy.Rational(int(2.0 * exponent), 2)
                if fixed:
                    return self.number(node, lambda: math.pow(float(a), float(b)))
                return a**b
        other = "; write ** for a power" if isinstance(operation, ast.BitXor) else ""
        raise self.refuse(node, f"the operation {type(operation).__name__} is not allowed{other}")
