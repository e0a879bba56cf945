"""SymPy expressions of forces as text: in the language of `law_syntax`, or as Python code on arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from suboctave.errors import InputError
from suboctave.model.law_syntax import PRIME

__all__ = ["as_code", "as_text"]

_PLAIN = {"Ramp": "max({}, 0)", "Step": "heaviside({})", "Modulus": "abs({})", "Sign": "sign({})"}
_ARRAYS = {
    "Ramp": "maximum({}, 0.0)", "Step": "heaviside({}, 0.0)", "Modulus": "absolute({})", "Sign": "sign({})",
    "PositiveRamp": "maximum({}, 1e-60)", "asin": "arcsin({})", "acos": "arccos({})", "atan": "arctan({})",
}  # fmt: skip
#: powers up to this one are products
_PRODUCTS = 4


def as_text(expression: Any) -> str:
    """A text that `law_syntax.read` turns into the same expression."""
    return _Printer(None).show(expression, 0).replace(PRIME, "'")


def as_code(expression: Any, names: Mapping[str, str]) -> str:
    """Python code for arrays; `names` says what every symbol is called there."""
    return _Printer(names).show(expression, 0)


class _Printer:
    """Precedence: 0 sum, 1 product, 2 factor, 3 base of a power."""

    def __init__(self, names: Mapping[str, str] | None) -> None:
        self.names = names

    def show(self, e: Any, level: int) -> str:
        if e.is_Symbol:
            return e.name if self.names is None else self.names[e.name]
        if e.is_Rational and not e.is_Integer and self.names is None:
            return self._wrapped(f"{e.p}/{e.q}", 1, level)
        if e.is_number:
            return self._number(e, level)
        if e.is_Add:
            text = self.show(e.args[0], 0)
            for term in e.args[1:]:
                shown = self.show(term, 0)
                text += f" - {shown[1:]}" if shown.startswith("-") else f" + {shown}"
            return self._wrapped(text, 0, level)
        if e.is_Mul:
            return self._product(e, level)
        if e.is_Pow:
            return self._power(e, level)
        inner = ", ".join(self.show(argument, 0) for argument in e.args)
        name = type(e).__name__
        table = _PLAIN if self.names is None else _ARRAYS
        if name == "exp" and self.names is None:
            return f"exp({inner})"
        return table.get(name, name + "({})").format(inner)

    def _wrapped(self, text: str, own: int, level: int) -> str:
        return f"({text})" if own < level else text

    def _number(self, e: Any, level: int) -> str:
        if e.is_Integer and (self.names is None) and abs(int(e)) < 10**12:
            text = str(int(e))
        else:
            try:
                value = float(e)
            except (TypeError, OverflowError):
                value = math.nan
            if not math.isfinite(value):
                raise InputError(f"{e} is not a finite real number")
            text = repr(value)
        return self._wrapped(text, 0 if text.startswith("-") else 3, level)

    def _product(self, e: Any, level: int) -> str:
        sign, above, below = "", [], []
        for factor in e.args:
            if factor == -1:
                sign = "-"
            elif factor.is_Pow and factor.exp.is_number and factor.exp.is_negative:
                below.append(self.show(factor.base ** (-factor.exp), 2))
            else:
                above.append(factor)
        shown = [self.show(factor, 1) for factor in above[:1]] + [self.show(factor, 2) for factor in above[1:]]
        text = "*".join(shown) or "1"
        for factor in below:
            text += f"/{factor}"
        return self._wrapped(sign + text, 0 if sign or text.startswith("-") else 1, level)

    def _power(self, e: Any, level: int) -> str:
        if e.exp.is_number and e.exp.is_negative:
            return self._wrapped(f"1/{self.show(e.base ** (-e.exp), 2)}", 1, level)
        if e.exp == 0.5:
            return f"sqrt({self.show(e.base, 0)})"
        if self.names is not None and e.exp.is_Integer and 1 < int(e.exp) <= _PRODUCTS and e.base.is_Symbol:
            return self._wrapped("*".join([self.show(e.base, 3)] * int(e.exp)), 1, level)
        return self._wrapped(f"{self.show(e.base, 3)}**{self.show(e.exp, 3)}", 2, level)
