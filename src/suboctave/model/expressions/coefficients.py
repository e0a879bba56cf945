"""Coefficients: numbers, or expressions in named parameters, with exact derivatives.

Expressions that are affine in their names are differentiated at once; all others by SymPy (`derivatives`), which is
imported when the first of them is.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from suboctave.errors import InputError, suggest
from suboctave.model.expressions.reader import FUNCTIONS, Evaluate, read


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
        from suboctave.model.expressions.derivatives import scalar_function, symbol

        assert self._symbolic is not None
        expression = self._symbolic().diff(symbol(name))
        evaluate, names = scalar_function(expression)
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

    def __reduce__(self) -> tuple[Any, ...]:  # closures cannot be pickled: read again on the other side
        return restored, (self.text, self.by)


def restored(text: str, by: Iterable[str] = ()) -> Coefficient:
    """A coefficient, or its derivative by several names, from its text."""
    result = coefficient(text)
    for name in by:
        result = result.derivative(name)
    return result


def coefficient(source: Any) -> Coefficient:
    """A number, or a text such as `"2*zeta"`, as a `Coefficient`; an `InputError` that says what is not allowed."""
    if isinstance(source, Coefficient):
        return source
    if isinstance(source, str):
        return _from_text(source)
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


def named_coefficient(source: Any, owner: str, name: str) -> Coefficient:
    """The coefficient of this name; refusals begin with its owner, and point at it."""
    try:
        return coefficient(source)
    except InputError as error:
        raise InputError(f"{owner}, {name}: {error}", (name,)) from None


def _number(number: float, text: str = "") -> Coefficient:
    return Coefficient(text or repr(number), frozenset(), lambda _: number, {})


ZERO = _number(0.0)


def _from_text(text: str) -> Coefficient:
    refused = {"t": "time cannot occur in a coefficient; periodic forces are loads"}
    form = read(text, "", FUNCTIONS, refused.get)
    if form.constant is not None:
        return _number(form.constant, text)

    def symbolic() -> Any:
        from suboctave.model.expressions.derivatives import expression_of

        return expression_of(form)

    return Coefficient(text, form.names, form.evaluate, form.affine, symbolic)
