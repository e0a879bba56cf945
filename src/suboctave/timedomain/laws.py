"""The laws of elements as text of scalar code, for kernels that are generated for one system.

A law tells its force with all derivatives, as Newton's method needs it, or its force alone with the corners frozen:
what lies beyond a corner is then a flag that an integrator of high order sets, and the force is smooth across the
corner. Elements that tell their law (`sampling`), those of this package and forces given as text become code; any
other is asked through a function of C.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from suboctave.model.callable_element import Callable as CallableElement
from suboctave.model.coupled import CoupledElement
from suboctave.model.dampers import QuadraticDamper, TanhFriction
from suboctave.model.element import Array, BaseElement
from suboctave.model.expression_element import Expression
from suboctave.model.sampling import (
    CornerSampling,
    PiecewiseLinear,
    PolynomialSampling,
    SharpSampling,
)

__all__ = ["AskedLaw", "LawText", "Names", "Tangent", "law_text"]


@dataclass(frozen=True)
class Names:
    """What the arguments of a law are called: displacements, rates, their rates, numbers, and a prefix for new
    names."""

    q: Sequence[str]
    r: Sequence[str]
    number: Callable[[int], str]
    prefix: str
    on: Callable[[int], str] = lambda i: f"on[{i}]"
    a: Sequence[str] = ()


@dataclass(frozen=True)
class Tangent:
    """Lines of code, then the expressions of the force and of its derivatives ("" where they are zero)."""

    lines: list[str]
    force: str
    by_q: list[str]
    by_r: list[str]


class LawText(ABC):
    """A law as code; `count` numbers depend on the parameters, `corners` are places that an integrator may locate."""

    count: int = 0
    corners: int = 0

    @abstractmethod
    def numbers(self, element: BaseElement, c: Array) -> list[float]:
        """The numbers of the code, from the coefficients of the element."""

    @abstractmethod
    def tangent(self, names: Names) -> Tangent:
        """Force and derivatives."""

    def force(self, names: Names) -> tuple[list[str], str]:
        """Force alone, corners frozen by the flags `names.on(i)` (1.0 beyond the corner, where it is positive)."""
        told = self.tangent(names)
        return told.lines, told.force

    def frozen(self, names: Names) -> Tangent:
        """`force`, with its derivatives while no flag changes."""
        return self.tangent(names)

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        """Lines of code, then what changes sign at corner i, and its rate."""
        raise IndexError(i)


class PolynomialLaw(LawText):
    """`sum_p c_p u^p`."""

    def __init__(self, degree: int) -> None:
        self.count = degree + 1

    def numbers(self, element: BaseElement, c: Array) -> list[float]:
        told = element.sampling(c)
        assert isinstance(told, PolynomialSampling)
        assert told.coefficients is not None
        return list(told.coefficients)

    def tangent(self, names: Names) -> Tangent:
        top, u = self.count - 1, names.q[0]
        force, slope = names.number(top), f"{float(top)} * {names.number(top)}"
        for power in range(top - 1, -1, -1):
            force = f"({force}) * {u} + {names.number(power)}"
            if power:
                slope = f"({slope}) * {u} + {float(power)} * {names.number(power)}"
        return Tangent([], force, [slope], [""])


class ArctanLaw(LawText):
    """`constant + slope u + sum_i k_i / pi [y_i atan(s_i y_i) - ln(1 + (s_i y_i)^2) / (2 s_i)]`, y_i = u - b_i."""

    def __init__(self, steps: int) -> None:
        self.steps = self.corners = steps
        self.count = 2 + 4 * steps

    def numbers(self, element: BaseElement, c: Array) -> list[float]:
        told = element.sampling(c)
        assert isinstance(told, SharpSampling)
        assert told.steps is not None
        out = [told.constant, told.slope]
        for point, width, step in zip(told.points, told.widths, told.steps, strict=True):
            out += [point, 1.0 / width, step / math.pi, 0.5 * step * width / math.pi]
        return out

    def tangent(self, names: Names) -> Tangent:
        u, c, p = names.q[0], names.number, names.prefix
        lines, force, slope = [], f"{c(0)} + {c(1)} * {u}", c(1)
        for i in range(self.steps):
            b = 2 + 4 * i
            lines.append(f"{p}y{i} = {u} - {c(b)}")
            lines.append(f"{p}a{i}, {p}l{i} = arctan_log({c(b + 1)} * {p}y{i})")
            force += f" + ({c(b + 2)} * {p}y{i} * {p}a{i} - {c(b + 3)} * {p}l{i})"
            slope += f" + {c(b + 2)} * {p}a{i}"
        return Tangent(lines, force, [slope], [""])

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        return [], f"{names.q[0]} - {names.number(2 + 4 * i)}", names.r[0]


class PiecesLaw(LawText):
    """Springs on half-lines, `k_i (u - b_i)` where `side_i (u - b_i) > 0`."""

    def __init__(self, sides: Sequence[int]) -> None:
        self.sides = tuple(sides)
        self.corners = len(self.sides)
        self.count = 2 * self.corners

    def numbers(self, element: BaseElement, c: Array) -> list[float]:
        told = element.sampling(c)
        assert isinstance(told, PiecewiseLinear)
        return [float(c[index]) for piece in told.pieces for index in (piece.stiffness, piece.gap)]

    def tangent(self, names: Names) -> Tangent:
        lines, force, slope = [], [], []
        p = names.prefix
        for i, side in enumerate(self.sides):
            k, y = names.number(2 * i), f"{p}y{i}"
            beyond = f"{y} > 0.0" if side > 0 else f"{y} < 0.0"
            lines.append(f"{y} = {names.q[0]} - {names.number(2 * i + 1)}")
            force.append(f"({k} * {y} if {beyond} else 0.0)")
            slope.append(f"({k} if {beyond} else 0.0)")
        return Tangent(lines, " + ".join(force), [" + ".join(slope)], [""])

    def force(self, names: Names) -> tuple[list[str], str]:
        u, c = names.q[0], names.number
        return [], " + ".join(f"{names.on(i)} * {c(2 * i)} * ({u} - {c(2 * i + 1)})" for i in range(self.corners))

    def frozen(self, names: Names) -> Tangent:
        slope = " + ".join(f"{names.on(i)} * {names.number(2 * i)}" for i in range(self.corners))
        return Tangent(*self.force(names), [slope], [""])

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        sign = "" if self.sides[i] > 0 else "-"
        return [], f"{sign}({names.q[0]} - {names.number(2 * i + 1)})", f"{sign}{names.r[0]}"


class QuadraticLaw(LawText):
    """`c v |v|`."""

    count = corners = 1

    def numbers(self, element: BaseElement, c: Array) -> list[float]:
        return [float(c[0])]

    def tangent(self, names: Names) -> Tangent:
        c, v = names.number(0), names.r[0]
        return Tangent([], f"{c} * {v} * abs({v})", [""], [f"2.0 * {c} * abs({v})"])

    def force(self, names: Names) -> tuple[list[str], str]:
        return [], f"(2.0 * {names.on(0)} - 1.0) * {names.number(0)} * {names.r[0]} * {names.r[0]}"

    def frozen(self, names: Names) -> Tangent:
        slope = f"(2.0 * {names.on(0)} - 1.0) * 2.0 * {names.number(0)} * {names.r[0]}"
        return Tangent(*self.force(names), [""], [slope])

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        return [], names.r[0], names.a[0]


class TanhLaw(LawText):
    """`force tanh(v / velocity)`."""

    count = 2

    def numbers(self, element: BaseElement, c: Array) -> list[float]:
        return [float(c[0]), 1.0 / float(c[1])]

    def tangent(self, names: Names) -> Tangent:
        t = f"{names.prefix}t"
        force, sharp = names.number(0), names.number(1)
        return Tangent(
            [f"{t} = tanh({names.r[0]} * {sharp})"],
            f"{force} * {t}",
            [""],
            [f"{force} * {sharp} * (1.0 - {t} * {t})"],
        )


class WrittenLaw(LawText):
    """A force given as text, from its SymPy expression."""

    def __init__(self, element: Expression) -> None:
        from suboctave.model.law_syntax import corner_functions

        law = element._law
        self.law = law
        self.count = len(law.c)
        self.moving = law.depends_on_velocity
        corner = corner_functions()
        kinds = (corner.Ramp, corner.Step, corner.Modulus, corner.Sign)
        states = {*law.q, law.phase}
        found = {atom.args[0] for atom in law.expression.atoms(*kinds) if atom.free_symbols & states}
        self.places = sorted(found, key=str)
        self.corners = len(self.places)

    def numbers(self, element: BaseElement, c: Array) -> list[float]:
        return [float(value) for value in c]

    def _states(self, names: Names) -> list[str]:
        return [*names.q, *(names.r if self.moving else ())]

    def _code(self, parts: list[Any], names: Names, flags: dict[str, str] | None = None) -> tuple[list[str], list[str]]:
        return self.law.scalar_code(parts, self._states(names), names.number, names.prefix, flags or {})

    def tangent(self, names: Names) -> Tangent:
        return self._tangent(self.law.expression, names, {})

    def force(self, names: Names) -> tuple[list[str], str]:
        lines, parts = self._code(*self._frozen(names))
        return lines, parts[0]

    def frozen(self, names: Names) -> Tangent:
        (expression,), _, flags = self._frozen(names)
        return self._tangent(expression, names, flags)

    def _tangent(self, f: Any, names: Names, flags: dict[str, str]) -> Tangent:
        lines, (force, *slopes) = self._code([f, *(f.diff(a) for a in self.law.q)], names, flags)
        count = self.law.count
        return Tangent(lines, force, slopes[:count], slopes[count:] if self.moving else [""] * count)

    def _frozen(self, names: Names) -> tuple[list[Any], Names, dict[str, str]]:
        """The expression with flags for what lies beyond its corners, and the code of the flags."""
        import sympy

        from suboctave.model.law_syntax import corner_functions

        if self.law.rough:  # a power of a half that begins at a corner does not go on beyond it
            return [self.law.expression], names, {}
        corner = corner_functions()
        swaps: dict[Any, Any] = {}
        flags: dict[str, str] = {}
        for i, a in enumerate(self.places):
            on = sympy.Symbol(f"(on {i})")
            flags[on.name] = names.on(i)
            swaps |= {corner.Ramp(a): a * on, corner.Step(a): on}
            swaps |= {corner.Modulus(a): a * (2 * on - 1), corner.Sign(a): 2 * on - 1}
        return [self.law.expression.xreplace(swaps)], names, flags

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        place = self.places[i]
        rates = [*names.r, *(names.a if self.moving else ())]
        parts = [place, *(place.diff(q) for q in self.law.q), place.diff(self.law.phase)]
        lines, texts = self._code(parts, names)
        terms = [f"({slope}) * {rate}" for slope, rate in zip(texts[1:-1], rates, strict=True) if slope != "0.0"]
        if texts[-1] != "0.0":
            terms.append(f"({texts[-1]}) * omega")
        return lines, texts[0], " + ".join(terms) or "0.0"


class AskedLaw(LawText):
    """A law that only its element knows: `tangent` is called back.

    Its corners, if it tells any of its (first) displacement, are located.
    """

    def __init__(self, element: BaseElement, at: Array) -> None:
        self.element = element
        told = element.sampling(at)
        points = told.points if isinstance(told, SharpSampling | CornerSampling) else ()
        self.corners = len(points)
        self.count = self.corners + len(at)

    def numbers(self, element: BaseElement, c: Array) -> list[float]:
        told = element.sampling(c)
        points = list(told.points) if isinstance(told, SharpSampling | CornerSampling) else []
        return (points + [math.inf] * self.corners)[: self.corners] + [float(value) for value in c]

    def tangent(self, names: Names) -> Tangent:
        raise TypeError("a law that is asked has no code")

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        return [], f"{names.q[0]} - {names.number(i)}", names.r[0]


def law_text(element: BaseElement, c: Array) -> LawText:
    """The law of an element, told as fully as it can be; `c` are its coefficients at some parameters."""
    if type(element) is QuadraticDamper:
        return QuadraticLaw()
    if type(element) is TanhFriction:
        return TanhLaw()
    if isinstance(element, Expression):
        return WrittenLaw(element)
    if isinstance(element, CoupledElement | CallableElement) or element.depends_on_velocity:
        return AskedLaw(element, c)
    told = element.sampling(c)
    if isinstance(told, PolynomialSampling) and told.coefficients is not None:
        return PolynomialLaw(told.degree)
    if isinstance(told, SharpSampling) and told.steps is not None:
        return ArctanLaw(len(told.steps))
    if isinstance(told, PiecewiseLinear):
        return PiecesLaw([piece.side for piece in told.pieces])
    return AskedLaw(element, c)
