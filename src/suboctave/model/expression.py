"""Coefficients: numbers, or expressions in named parameters, with exact derivatives.

A text such as `"2*zeta"` is read with Python's own parser and then walked node by node against a short list of what is
allowed (numbers, names, `+ - * / **`, parentheses, a few functions, `pi`); nothing is ever evaluated as Python code.
The walk leaves a tree of closures, so that a value costs a microsecond. Expressions that are affine in their names are
differentiated at once; all others by SymPy, which is imported when the first of them is differentiated.
"""

from __future__ import annotations

import ast
import math
import numbers
from collections.abc import Callable, Mapping
from typing import Any

from suboctave.errors import InputError, suggest

__all__ = ["FUNCTIONS", "RESERVED", "Coefficient", "coefficient"]

Evaluate = Callable[[Mapping[str, float]], float]

FUNCTIONS: dict[str, Callable[[float], float]] = {
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "sinh": math.sinh,
    "cosh": math.cosh,
    "tanh": math.tanh,
    "abs": math.fabs,
}
# Names that a parameter cannot have. "omega" is the circular frequency of the load, "t" the time.
RESERVED = frozenset(FUNCTIONS) | {"pi", "omega", "t"}

_ELSEWHERE = {
    "ln": "log",
    "arctan": "atan",
    "arcsin": "asin",
    "arccos": "acos",
    "fabs": "abs",
    "Abs": "abs",
    "pow": "x**y instead",
}
_LONGEST = 10_000  # characters
_DEEPEST = 200  # nested operations
_LARGEST_POWER = 1000


class Coefficient:
    """A number or an expression in named parameters. Immutable; made by `coefficient`.

    `text` is what the user wrote, `names` the names that occur in it, `constant` whether there are none.
    """

    __slots__ = ("_affine", "_derivatives", "_evaluate", "_symbolic", "by", "names", "text")

    text: str
    names: frozenset[str]
    by: tuple[str, ...]

    def __init__(
        self,
        text: str,
        names: frozenset[str],
        evaluate: Evaluate,
        affine: Mapping[str, float] | None = None,
        symbolic: Callable[[], Any] | None = None,
        by: tuple[str, ...] = (),
    ) -> None:
        self.text = text
        self.names = names
        self.by = by
        self._evaluate = evaluate
        self._affine = affine
        self._symbolic = symbolic
        self._derivatives: dict[str, Coefficient] = {}

    @property
    def constant(self) -> bool:
        """Whether no name occurs in it."""
        return not self.names

    def value(self, values: Mapping[str, float]) -> float:
        """The number at these values of the parameters; an `InputError` where it has none."""
        try:
            result = self._evaluate(values)
            if result - result == 0.0:
                return result
        except KeyError as missing:
            name = missing.args[0]
            raise InputError(f"{self} needs a value for {name!r}{suggest(name, values)}") from None
        except (ValueError, ZeroDivisionError, OverflowError):
            pass
        at = ", ".join(f"{name} = {values[name]:g}" for name in sorted(self.names))
        raise InputError(f"{self} is not a finite real number" + (f" at {at}" if at else ""))

    def derivative(self, name: str) -> Coefficient:
        """The exact derivative by a parameter (or "omega"); the constant 0 where the name does not occur."""
        if name not in self.names:
            return ZERO
        if name not in self._derivatives:
            self._derivatives[name] = self._differentiate(name)
        return self._derivatives[name]

    def _differentiate(self, name: str) -> Coefficient:
        if self._affine is not None:
            return _number(self._affine[name])
        from suboctave.model import symbolic

        assert self._symbolic is not None
        expression = symbolic.differentiate(self._symbolic(), name)
        evaluate, names = symbolic.closure(expression)
        if not names:
            return _number(evaluate({}))
        return Coefficient(self.text, names, evaluate, symbolic=lambda: expression, by=(*self.by, name))

    def __str__(self) -> str:
        if self.by:
            return f"the derivative of '{self.text}' by {' and '.join(self.by)}"
        return f"'{self.text}'"

    def __repr__(self) -> str:
        return f"Coefficient({self.text!r})" if not self.by else f"<{self}>"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Coefficient):
            return NotImplemented
        return (self.text, self.by) == (other.text, other.by)

    def __hash__(self) -> int:
        return hash((self.text, self.by))

    def __reduce__(self) -> tuple[Any, ...]:  # closures cannot be pickled: parse again on the other side
        return _restore, (self.text, self.by)


def _restore(text: str, by: tuple[str, ...]) -> Coefficient:
    result = coefficient(text)
    for name in by:
        result = result.derivative(name)
    return result


def coefficient(source: Any) -> Coefficient:
    """A number, or a text such as `"2*zeta"`, as a `Coefficient`; an `InputError` that says what is not allowed."""
    if isinstance(source, Coefficient):
        return source
    if isinstance(source, str):
        return _parse(source)
    if not isinstance(source, bool) and isinstance(source, numbers.Real):
        try:
            number = float(source)
        except OverflowError:  # a whole number of hundreds of digits
            number = math.inf
        if not math.isfinite(number):
            raise InputError(f"a coefficient must be finite, not {number}")
        return _number(number)
    raise InputError(
        f"a coefficient is a number or an expression in the parameters as text, not {source!r} "
        f"({type(source).__name__})"
    )


def _number(number: float) -> Coefficient:
    return Coefficient(repr(number), frozenset(), lambda _: number, {})


ZERO = _number(0.0)


# ------------------------------------------------------------------------------------------------------------- text
def _parse(text: str) -> Coefficient:
    if len(text) > _LONGEST:
        raise InputError(f"an expression of {len(text)} characters is too long (at most {_LONGEST}): {text[:40]!r}...")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, RecursionError | MemoryError) or "nested" in str(error):
            raise InputError(f"{_shortened(text)} is nested too deeply; split it into parameters") from None
        reason = "it is empty" if not text.strip() else f"{getattr(error, 'msg', error)}"
        raise InputError(f"cannot read the expression {_shortened(text)}: {reason}") from None
    form = _Reader(text).read(tree, 0)
    if form.constant is not None:
        number = form.constant
        return Coefficient(text, frozenset(), lambda _: number, {})

    def symbolic() -> Any:
        from suboctave.model.symbolic import from_syntax

        return from_syntax(tree)

    return Coefficient(text, form.names, form.evaluate, form.affine, symbolic)


def _shortened(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")


class _Form:
    """A node that has been read: its names, its closure, and what is known about it."""

    __slots__ = ("affine", "constant", "evaluate", "names", "power")

    def __init__(
        self,
        evaluate: Evaluate,
        names: frozenset[str] = frozenset(),
        constant: float | None = None,
        affine: dict[str, float] | None = None,
        power: float = 1.0,
    ) -> None:
        self.evaluate = evaluate
        self.names = names
        self.constant = constant  # its number, if no name occurs
        self.affine = affine  # the factor of every name, if it is affine in all of them
        self.power = power  # the highest power of anything in it, powers of powers multiplied


class _Reader:
    """Turns syntax into closures, and refuses everything that is not on the list."""

    def __init__(self, text: str) -> None:
        self.text = text

    def refuse(self, reason: str) -> InputError:
        return InputError(f"in the expression {_shortened(self.text)}: {reason}")

    def read(self, node: ast.expr, depth: int) -> _Form:
        if depth > _DEEPEST:
            raise self.refuse(f"more than {_DEEPEST} nested operations; split it into parameters")
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return self.number(lambda: float(number))
            case ast.Name(id=name):
                return self.name(name)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return self.negative(self.read(inner, depth + 1))
            case ast.UnaryOp(op=ast.UAdd(), operand=inner):
                return self.read(inner, depth + 1)
            case ast.BinOp(left=left, op=operation, right=right):
                return self.binary(operation, self.read(left, depth + 1), self.read(right, depth + 1))
            case ast.Call(func=ast.Name(id=name), args=[inner], keywords=[]) if name in FUNCTIONS:
                return self.call(name, self.read(inner, depth + 1))
            case ast.Call(func=ast.Name(id=name)):
                if name in FUNCTIONS:
                    raise self.refuse(f"{name} takes exactly one argument")
                hint = f"; write {_ELSEWHERE[name]}" if name in _ELSEWHERE else suggest(name, FUNCTIONS)
                raise self.refuse(f"there is no function {name!r}{hint}")
        raise self.refuse(f"{_what(node)} is not allowed (numbers, names, + - * / **, parentheses, functions, pi)")

    def number(self, compute: Callable[[], float]) -> _Form:
        """A node without names is computed once, here; it must be finite."""
        try:
            value = compute()
        except (ValueError, ZeroDivisionError, OverflowError):
            value = math.nan
        if not math.isfinite(value):
            raise self.refuse("a part without parameters is not a finite real number")
        return _Form(lambda _: value, frozenset(), value, {})

    def name(self, name: str) -> _Form:
        if name == "pi":
            return self.number(lambda: math.pi)
        if name in FUNCTIONS:
            raise self.refuse(f"{name} is a function and needs an argument in parentheses")
        if name == "t":
            raise self.refuse("time cannot occur in a coefficient; periodic forces are loads")
        return _Form(lambda values: values[name], frozenset([name]), None, {name: 1.0})

    def negative(self, inner: _Form) -> _Form:
        f, value = inner.evaluate, inner.constant
        if value is not None:
            return self.number(lambda: -value)
        return _Form(lambda values: -f(values), inner.names, None, _scaled(inner.affine, -1.0), inner.power)

    def call(self, name: str, inner: _Form) -> _Form:
        function, f, value = FUNCTIONS[name], inner.evaluate, inner.constant
        if value is not None:
            return self.number(lambda: function(value))
        return _Form(lambda values: function(f(values)), inner.names)

    def binary(self, operation: ast.operator, left: _Form, right: _Form) -> _Form:
        a, b, evaluate = left.constant, right.constant, None
        power = max(left.power, right.power)
        if isinstance(operation, ast.Pow) and b is not None:
            power = left.power * abs(b)
            if max(power, abs(b)) > _LARGEST_POWER:
                raise self.refuse(f"the power {max(power, abs(b)):g} is larger than {_LARGEST_POWER}")
        evaluate = _operation(operation, left.evaluate, right.evaluate, a, b)
        if evaluate is None:
            other = "; write ** for a power" if isinstance(operation, ast.BitXor) else ""
            raise self.refuse(f"the operation {_what(operation)} is not allowed{other}")
        if a is not None and b is not None:
            compute = evaluate
            return self.number(lambda: compute({}))
        affine = self.affine(operation, left, right)
        return _Form(evaluate, left.names | right.names, None, affine, max(1.0, power))

    def affine(self, operation: ast.operator, left: _Form, right: _Form) -> dict[str, float] | None:
        """Factors of the names, where the operation keeps the expression affine with finite factors."""
        p, q, factors = left.affine, right.affine, None
        if p is None or q is None:
            return None
        if isinstance(operation, ast.Add | ast.Sub):
            sign = 1.0 if isinstance(operation, ast.Add) else -1.0
            factors = {name: p.get(name, 0.0) + sign * q.get(name, 0.0) for name in {*p, *q}}
        elif isinstance(operation, ast.Mult):
            if left.constant is not None:
                factors = _scaled(q, left.constant)
            elif right.constant is not None:
                factors = _scaled(p, right.constant)
        elif isinstance(operation, ast.Div) and right.constant:
            divisor = right.constant
            factors = {name: factor / divisor for name, factor in p.items()}
        if factors is None or not all(map(math.isfinite, factors.values())):
            return None
        return factors


def _scaled(factors: Mapping[str, float] | None, by: float) -> dict[str, float] | None:
    return None if factors is None else {name: by * factor for name, factor in factors.items()}


def _operation(operation: ast.operator, f: Evaluate, g: Evaluate, a: float | None, b: float | None) -> Evaluate | None:
    """The closure of a binary operation; a constant operand is bound into it."""
    match operation:
        case ast.Add():
            return lambda values: f(values) + g(values)
        case ast.Sub():
            return lambda values: f(values) - g(values)
        case ast.Mult():
            if a is not None:
                return lambda values: a * g(values)
            if b is not None:
                return lambda values: f(values) * b
            return lambda values: f(values) * g(values)
        case ast.Div():
            return lambda values: f(values) / g(values)
        case ast.Pow():
            power = math.pow  # refuses a root of a negative number, where ** would answer with a complex one
            if b is not None:
                return lambda values: power(f(values), b)
            return lambda values: power(f(values), g(values))
    return None


_WORDS = {
    ast.Attribute: "a dot between names",
    ast.Subscript: "an index in brackets",
    ast.Compare: "a comparison",
    ast.BoolOp: "and/or",
    ast.IfExp: "if/else",
    ast.Lambda: "lambda",
    ast.Constant: "a text, a truth value or an imaginary number",
    ast.Call: "a call of something else than a function",
    ast.BitXor: "^",
    ast.FloorDiv: "//",
    ast.Mod: "%",
    ast.MatMult: "@",
    ast.Tuple: "a comma",
}


def _what(node: ast.AST) -> str:
    return _WORDS.get(type(node), type(node).__name__)
