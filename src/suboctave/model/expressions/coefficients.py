"""Coefficients: numbers, or expressions in named parameters, with exact derivatives.

Expressions that are affine in their names are differentiated at once; all others by SymPy (`derivatives`), which is
imported when the first of them is.
"""

from __future__ import annotations

import numbers
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, TypeAlias

from suboctave.arguments import READ
from suboctave.errors import InputError, is_number, located, shortened, suggest
from suboctave.model.expressions.reader import FUNCTIONS, Form, may_be_infinite, number_form, read


class Coefficient:
    """A number or an expression in named parameters. Immutable; made by `coefficient`.

    `text` is what the user wrote, `names` the names that occur in it, `constant` whether there are none.
    """

    __slots__ = ("_derivatives", "_evaluate", "_form", "by", "constant", "names", "text")

    def __init__(self, text: str, form: Form, by: tuple[str, ...] = ()) -> None:
        self.text = text
        self.by = by
        self.names = form.names
        self.constant = not form.names
        self._form = form
        self._evaluate = form.evaluate
        self._derivatives: dict[str, Coefficient] = {}

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

    @property
    def may_be_infinite(self) -> bool:
        """Whether it divides by what depends on a parameter, or has a function that is not finite everywhere."""
        return may_be_infinite(self._form)

    def derivative(self, name: str) -> Coefficient:
        """The exact derivative by a parameter (or "omega"); the constant 0 where the name does not occur."""
        if name not in self.names:
            return ZERO
        if name not in self._derivatives:
            if self._form.affine is not None:
                slope = coefficient(self._form.affine[name])
            else:
                from suboctave.model.expressions.derivatives import derivative_form

                form = derivative_form(self._form, name)
                slope = Coefficient(self.text, form, (*self.by, name)) if form.names else coefficient(form.evaluate({}))
            self._derivatives[name] = slope
        return self._derivatives[name]

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


Number: TypeAlias = Annotated[float | str | Coefficient, READ]


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
        refused = {"t": "time cannot occur in a coefficient; periodic forces are loads"}
        return Coefficient(source, read(source, "", FUNCTIONS, refused.get))
    if isinstance(source, bool) or not isinstance(source, numbers.Real):
        kind = type(source).__name__
        raise InputError(
            f"a coefficient is a number or an expression in the parameters as text, not {shortened(source)} ({kind})"
        )
    if not is_number(source):
        raise InputError(f"a coefficient must be finite, not {shortened(source)}")
    return Coefficient(repr(float(source)), number_form(float(source)))


def named_coefficient(source: Any, owner: str, name: str) -> Coefficient:
    """The coefficient of this name; refusals begin with its owner, and point at it."""
    with located(name, owner=f"{owner}, {name}"):
        return coefficient(source)


ZERO = coefficient(0.0)
