"""The one reader of expressions: texts become forms, trees of operations with closures.

A text such as `"2*zeta"` is read with Python's own parser and then walked node by node against a short list of what is
allowed (numbers, names, `+ - * / **`, parentheses, a few functions, `pi`); nothing is ever evaluated as Python code. A
value costs a microsecond.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from suboctave.errors import InputError, suggest

Evaluate = Callable[[Mapping[str, float]], float]

#: functions that any expression may contain
FUNCTIONS: dict[str, Callable[[float], float]] = {
    "sqrt": math.sqrt, "exp": math.exp, "log": math.log, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "asin": math.asin, "acos": math.acos, "atan": math.atan, "sinh": math.sinh, "cosh": math.cosh, "tanh": math.tanh,
    "abs": math.fabs,
}  # fmt: skip
#: functions with corners or jumps, of forces only
CORNERS: dict[str, Callable[..., float]] = {
    "sign": lambda x: float((x > 0.0) - (x < 0.0)),
    "heaviside": lambda x: float(x > 0.0),
    "max": max,
    "min": min,
}
# Names that a parameter cannot have. "omega" is the circular frequency of the load, "t" the time.
RESERVED = frozenset(FUNCTIONS) | {"pi", "omega", "t"}

_PAIRS = ("max", "min")
_ELSEWHERE = {
    "ln": "log", "arctan": "atan", "arcsin": "asin", "arccos": "acos", "fabs": "abs", "Abs": "abs", "Max": "max",
    "Min": "min", "sgn": "sign", "Heaviside": "heaviside", "step": "heaviside", "pow": "x**y instead",
}  # fmt: skip
LONGEST = 10_000  # characters
_DEEPEST = 300  # nested operations
_LARGEST_POWER = 1000
#: operations in the arguments of max or min, which occur twice in max(a, b) = b + ramp(a - b)
_MOST_OPERATIONS = 500


# ------------------------------------------------------------------------------------------------------------ reader
@dataclass(slots=True)
class Form:
    """An expression that has been read: an operation and its parts, with its closure and what is known about it.

    Attributes
    ----------
    operation, parts
        One of `+ - * / **`, "negative" or the name of a function, with forms; or "number", "name", "pi", "expression"
        with the number, the name, nothing, an expression of SymPy.
    evaluate, names, constant
        Its value at values of the names; these; its number, if no name occurs.
    affine
        The factor of every name, if it is affine in all of them.
    power, size
        The highest power of anything in it, powers of powers multiplied; how many operations it stands for.
    """

    operation: str
    parts: tuple[Any, ...]
    evaluate: Evaluate
    names: frozenset[str] = frozenset()
    affine: dict[str, float] | None = None
    power: float = 0.0
    size: float = 1.0
    constant: float | None = None


def number_form(value: float, operation: str = "number", parts: tuple[Any, ...] = ()) -> Form:
    """The form of a number, and of an operation whose value is known."""
    return Form(operation, parts or (value,), lambda _: value, affine={}, constant=value)


#: functions that are infinite, or no number, somewhere on the real axis or beyond a place of it
_BOUNDED_DOMAIN = frozenset({"sqrt", "log", "tan", "asin", "acos"})


def may_be_infinite(form: Form) -> bool:
    """Whether a form divides by what depends on a name, has a power that may do so, or such a function, of a name."""
    if not form.names:
        return False
    if form.operation == "expression" or form.operation in _BOUNDED_DOMAIN:
        return True
    if form.operation == "/" and form.parts[1].names:
        return True
    if form.operation == "**":
        power = form.parts[1].constant
        if power is None or power < 0.0 or not float(power).is_integer():
            return True
    return any(may_be_infinite(part) for part in form.parts if isinstance(part, Form))


def read(
    text: str, where: str, functions: Mapping[str, Callable[..., float]], refusal: Callable[[str], str | None]
) -> Form:
    """The form of a text in which these functions may occur, and names about which `refusal` has nothing to say.

    InputError begins with `where`, if it is given, and tells the column and the part of the text that is not allowed.
    """
    start = f"{where}: " if where else ""
    if len(text) > LONGEST:
        raise InputError(f"{start}an expression of {len(text)} characters is too long (at most {LONGEST})")
    source = text.strip()
    begin = len(text) - len(text.lstrip())
    try:
        tree = ast.parse(source, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        start += f"cannot read {_shortened(text)}"
        if isinstance(error, RecursionError | MemoryError) or "nested" in str(error):
            raise InputError(f"{start}: nested too deeply; split it into parameters or terms") from None
        if not source:
            raise InputError(f"{start}: it is empty") from None
        column = getattr(error, "offset", None)
        at = f" at column {begin + column}" if column else ""
        raise InputError(f"{start}{at}: {getattr(error, 'msg', error)}") from None
    where = where or f"in the expression {_shortened(text)}"
    return _Reader(source, begin, where, functions, refusal).read(tree, 0)


#: what a prime is written as while Python parses the text: a letter of the same length
PRIME = "\u02c8"


def _shortened(text: str) -> str:
    return repr((text if len(text) <= 60 else text[:57] + "...").replace(PRIME, "'"))


@dataclass
class _Reader:
    """Turns syntax into forms, and refuses everything that is not on the list."""

    text: str
    begin: int
    where: str
    functions: Mapping[str, Callable[..., float]]
    refusal: Callable[[str], str | None]

    def refuse(self, node: ast.AST, reason: str) -> InputError:
        column = len(self.text.encode()[: getattr(node, "col_offset", 0)].decode()) + self.begin + 1
        part = _shortened(ast.get_source_segment(self.text, node) or "")
        return InputError(f"{self.where} at column {column}, {part}: {reason}")

    def read(self, node: ast.expr, depth: int) -> Form:
        if depth > _DEEPEST:
            raise self.refuse(node, f"more than {_DEEPEST} nested operations; split it into parameters or terms")
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return self.known(node, "number", (number,), lambda: float(number))
            case ast.Name(id=name):
                return self.name(node, name)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                part = self.read(inner, depth + 1)
                known = {"affine": _scaled(part.affine, -1.0), "power": part.power, "size": part.size + 1.0}
                return self.applied(node, "negative", operator.neg, (part,), **known)
            case ast.UnaryOp(op=ast.UAdd(), operand=inner):
                return self.read(inner, depth + 1)
            case ast.BinOp(left=left, op=operation, right=right):
                return self.binary(node, operation, self.read(left, depth + 1), self.read(right, depth + 1))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in self.functions:
                count = 2 if name in _PAIRS else 1
                if len(arguments) != count or any(isinstance(argument, ast.Starred) for argument in arguments):
                    raise self.refuse(node, f"{name} takes {'exactly one argument' if count == 1 else '2 arguments'}")
                return self.call(node, name, [self.read(argument, depth + 1) for argument in arguments])
            case ast.Call(func=ast.Name(id=name), args=[argument]) if _depends_on_time(name, argument, self.functions):
                raise self.refuse(
                    node,
                    "delays are not supported: motions are taken at the time t, and written x, x', x''"
                    if not isinstance(argument, ast.Name)
                    else f"motions are written without their time: {name.replace(PRIME, chr(39))}",
                )
            case ast.Call(func=ast.Name(id=name)) if name not in self.functions:
                other = _ELSEWHERE.get(name, "")
                elsewhere = other in self.functions or name == "pow"
                hint = f"; write {other}" if elsewhere else suggest(name, self.functions)
                raise self.refuse(node, f"there is no function {name!r}{hint}")
        what = _WORDS.get(type(node), type(node).__name__)
        raise self.refuse(node, f"{what} is not allowed (numbers, names, + - * / **, parentheses, functions, pi)")

    def known(self, node: ast.AST, operation: str, parts: tuple[Any, ...], compute: Callable[[], float]) -> Form:
        """A part without names is computed once, here; it must be finite."""
        try:
            value = compute()
        except (ValueError, ZeroDivisionError, OverflowError):
            value = math.nan
        if not math.isfinite(value):
            raise self.refuse(node, "a part without parameters is not a finite real number")
        return number_form(value, operation, parts)

    def name(self, node: ast.AST, name: str) -> Form:
        if name == "pi":
            return self.known(node, "pi", (), lambda: math.pi)
        if name.rstrip(PRIME) in self.functions:
            raise self.refuse(node, f"{name.rstrip(PRIME)} is a function and needs an argument in parentheses")
        reason = self.refusal(name)
        if reason is not None:
            raise self.refuse(node, reason)
        return Form("name", (name,), lambda values: values[name], frozenset([name]), {name: 1.0}, 1.0)

    def call(self, node: ast.AST, name: str, arguments: list[Form]) -> Form:
        size = 1.0 + sum(argument.size for argument in arguments)
        if name in _PAIRS and any(argument.names for argument in arguments):
            if size > _MOST_OPERATIONS:
                raise self.refuse(node, f"{name} of arguments this long; split it into terms")
            size += 2.0 + arguments[1].size
        return self.applied(node, name, self.functions[name], tuple(arguments), power=1.0, size=size)

    def applied(
        self, node: ast.AST, operation: str, function: Callable[..., float], parts: tuple[Form, ...], **known: Any
    ) -> Form:
        """An operation on one part or two, and what is known about its form."""
        f, g = parts[0].evaluate, parts[-1].evaluate
        evaluate: Evaluate = (lambda at: function(f(at), g(at))) if len(parts) == 2 else (lambda at: function(f(at)))
        names = frozenset().union(*(part.names for part in parts))
        if not names:
            return self.known(node, operation, parts, lambda: evaluate({}))
        return Form(operation, parts, evaluate, names, **known)

    def binary(self, node: ast.AST, symbol: ast.operator, left: Form, right: Form) -> Form:
        sign = _SIGNS.get(type(symbol))
        if sign is None:
            other = "; write ** for a power" if isinstance(symbol, ast.BitXor) else ""
            shown = _WORDS.get(type(symbol), type(symbol).__name__)
            raise self.refuse(node, f"the operation {shown} is not allowed{other}")
        a, b = left.constant, right.constant
        power = left.power + right.power if sign in "*/" else max(left.power, right.power)
        if sign == "**" and b is not None:
            power = left.power * abs(b)
            if max(1.0, left.power) * abs(b) > _LARGEST_POWER:
                raise self.refuse(node, f"the power is larger than {_LARGEST_POWER}")
        if sign == "/" and b == 0.0 and a is None:
            raise self.refuse(node, "division by zero")
        known = {"affine": _affine(sign, left, right), "power": power, "size": left.size + right.size + 1.0}
        return self.applied(node, sign, _OPERATIONS[sign], (left, right), **known)


def _depends_on_time(name: str, argument: ast.expr, functions: Mapping[str, Any]) -> bool:
    """Whether it reads as a motion at a time, `x(t)` or `x(t - tau)`."""
    return name not in functions and any(isinstance(one, ast.Name) and one.id == "t" for one in ast.walk(argument))


def _affine(sign: str, left: Form, right: Form) -> dict[str, float] | None:
    """Factors of the names, where an operation keeps expressions affine with finite factors."""
    p, q, factors = left.affine, right.affine, None
    if p is None or q is None:
        return None
    if sign in "+-":
        factor = 1.0 if sign == "+" else -1.0
        factors = {name: p.get(name, 0.0) + factor * q.get(name, 0.0) for name in {*p, *q}}
    elif sign == "*" and left.constant is not None:
        factors = _scaled(q, left.constant)
    elif sign == "*" and right.constant is not None:
        factors = _scaled(p, right.constant)
    elif sign == "/" and right.constant:
        factors = {name: factor / right.constant for name, factor in p.items()}
    return factors if factors is not None and all(map(math.isfinite, factors.values())) else None


def _scaled(factors: Mapping[str, float] | None, by: float) -> dict[str, float] | None:
    return None if factors is None else {name: by * factor for name, factor in factors.items()}


# math.pow refuses a root of a negative number, where ** would answer with a complex one
_OPERATIONS: dict[str, Callable[..., float]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "**": math.pow
}  # fmt: skip
_SIGNS: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
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
