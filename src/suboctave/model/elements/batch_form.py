"""The batch form of a law: text of scalar code, for integrators that are generated for one system.

An element's `batch_form` gives its law with all derivatives, as Newton's method needs it, or with the corners frozen:
what lies beyond a corner is then a flag that an integrator of high order sets, and the force is smooth across the
corner. A law without a batch form of its own is called back, which is slower by a factor of a thousand.
"""

from __future__ import annotations

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.model.elements.smoothness import PiecewiseLinear, PolynomialSampling, Sampling, SharpSampling, levels

Array = NDArray[np.float64]
#: states, phase and numbers of a law to its force and the derivatives by the states
OneInstant = Callable[..., tuple[float, list[float]]]


@dataclass(frozen=True)
class Names:
    """What the arguments of a law are called: displacements q, rates r, their rates a, numbers; prefix of new names."""

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


class BatchForm(ABC):
    """The law of one element as code: `count` numbers depend on the parameters, `corners` may be located.

    `has_code` is False where the element's `tangent` is called back instead.
    """

    count: int = 0
    corners: int = 0
    has_code = True
    #: how many displacements the law reads, and whether it reads their rates
    inputs: int = 1
    moving = False

    def numbers(self, c: Array, sampling: Sampling) -> list[float]:
        """The numbers of the code, from the coefficients of the element and its smoothness there."""
        return c.tolist()

    @abstractmethod
    def tangent(self, names: Names) -> Tangent:
        """Force and derivatives."""

    def frozen(self, names: Names, slopes: bool = True) -> Tangent:
        """Force and, with `slopes`, derivatives while no flag `names.on(i)` changes (1.0 beyond the corner, where its
        margin is positive).
        """
        return self.tangent(names)

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        """Lines of code, then what changes sign at corner i, and its rate."""
        raise IndexError(i)

    @functools.cached_property
    def one_instant(self) -> OneInstant:
        """The law at one instant, `(q.., r.., theta, numbers) -> (f, [f_q.., f_r..])`, of plain numbers: arrays of
        length one take ten times as long. Raises what Python does where there is no real number.
        """
        q, r = ([f"{kind}{j}" for j in range(self.inputs)] for kind in "qr")
        law = self.tangent(Names(q, r, lambda i: f"numbers[{i}]", "w"))
        slopes = [text or "0.0" for text in (law.by_q + law.by_r if self.moving else law.by_q)]
        head = f"def law({', '.join([*q, *(r if self.moving else ()), 'theta', 'numbers'])}):"
        end = f"return float({law.force}), [{', '.join(f'float({text})' for text in slopes)}]"
        return _function("\n    ".join([head, *law.lines, end]))


@functools.lru_cache(maxsize=256)
def _function(text: str) -> OneInstant:
    """What a text of code is in Python."""
    names = {"pi": math.pi, "absolute": math.fabs, "maximum": max, "sign": _sign, "arctan_log": _arctan_log}
    functions = {"arcsin": "asin", "arccos": "acos", "arctan": "atan"}
    plain = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
    names |= {name: getattr(math, functions.get(name, name)) for name in (*functions, *plain)}
    exec(text, names)
    law: Any = names["law"]
    return law


def _sign(x: float) -> float:
    return float((x > 0.0) - (x < 0.0))


def _arctan_log(z: float) -> tuple[float, float]:
    return math.atan(z), math.log1p(z * z)


class PolynomialForm(BatchForm):
    """`sum_p c_p u^p`."""

    def __init__(self, sampling: PolynomialSampling) -> None:
        self.count = sampling.degree + 1

    def numbers(self, c: Array, sampling: Any) -> list[float]:
        return list(sampling.coefficients)

    def tangent(self, names: Names) -> Tangent:
        top, u = self.count - 1, names.q[0]
        force, slope = names.number(top), f"{float(top)} * {names.number(top)}"
        for power in range(top - 1, -1, -1):
            force = f"({force}) * {u} + {names.number(power)}"
            if power:
                slope = f"({slope}) * {u} + {float(power)} * {names.number(power)}"
        return Tangent([], force, [slope], [""])


class ArctanForm(BatchForm):
    """`constant + slope u + sum_i k_i / pi [y_i atan(s_i y_i) - ln(1 + (s_i y_i)^2) / (2 s_i)]`, y_i = u - b_i."""

    def __init__(self, sampling: SharpSampling) -> None:
        self.corners = len(sampling.points)
        self.count = 2 + 4 * self.corners

    def numbers(self, c: Array, sampling: Any) -> list[float]:
        out = [sampling.constant, sampling.slope]
        for point, width, step in zip(sampling.points, sampling.widths, sampling.steps, strict=True):
            out += [point, 1.0 / width, step / math.pi, 0.5 * step * width / math.pi]
        return out

    def tangent(self, names: Names) -> Tangent:
        u, c, p = names.q[0], names.number, names.prefix
        lines, force, slope = [], f"{c(0)} + {c(1)} * {u}", c(1)
        for i in range(self.corners):
            b = 2 + 4 * i
            lines.append(f"{p}y{i} = {u} - {c(b)}")
            lines.append(f"{p}a{i}, {p}l{i} = arctan_log({c(b + 1)} * {p}y{i})")
            force += f" + ({c(b + 2)} * {p}y{i} * {p}a{i} - {c(b + 3)} * {p}l{i})"
            slope += f" + {c(b + 2)} * {p}a{i}"
        return Tangent(lines, force, [slope], [""])

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        return [], f"{names.q[0]} - {names.number(2 + 4 * i)}", names.r[0]


class PiecesForm(BatchForm):
    """Springs on half-lines, `k_i (u - b_i)` where `side_i (u - b_i) > 0`."""

    def __init__(self, sampling: PiecewiseLinear) -> None:
        self.sides = [piece.side for piece in sampling.pieces]
        self.corners = len(self.sides)
        self.count = 2 * self.corners

    def numbers(self, c: Array, sampling: Any) -> list[float]:
        return [float(c[index]) for piece in sampling.pieces for index in (piece.stiffness, piece.gap)]

    def tangent(self, names: Names) -> Tangent:
        lines, force, slope = [], [], []
        for i, side in enumerate(self.sides):
            k, y = names.number(2 * i), f"{names.prefix}y{i}"
            beyond = f"{y} > 0.0" if side > 0 else f"{y} < 0.0"
            lines.append(f"{y} = {names.q[0]} - {names.number(2 * i + 1)}")
            force.append(f"({k} * {y} if {beyond} else 0.0)")
            slope.append(f"({k} if {beyond} else 0.0)")
        return Tangent(lines, " + ".join(force), [" + ".join(slope)], [""])

    def frozen(self, names: Names, slopes: bool = True) -> Tangent:
        u, c = names.q[0], names.number
        stiffness = [f"{names.on(i)} * {c(2 * i)}" for i in range(self.corners)]
        force = " + ".join(f"{k} * ({u} - {c(2 * i + 1)})" for i, k in enumerate(stiffness))
        return Tangent([], force, [" + ".join(stiffness)], [""])

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        sign = "" if self.sides[i] > 0 else "-"
        return [], f"{sign}({names.q[0]} - {names.number(2 * i + 1)})", f"{sign}{names.r[0]}"


class WrittenForm(BatchForm):
    """A force given as text, from its SymPy expression."""

    def __init__(self, law: Any) -> None:
        self.law = law
        self.count, self.inputs = len(law.c), law.count
        self.moving = law.depends_on_velocity
        self.places = law.corners()
        self.corners = len(self.places)

    def _code(self, parts: list[Any], names: Names, flags: dict[str, str] | None = None) -> tuple[list[str], list[str]]:
        states = [*names.q, *(names.r if self.moving else ())]
        return self.law.scalar_code(parts, states, names.number, names.prefix, flags or {})

    def tangent(self, names: Names) -> Tangent:
        return self._tangent(self.law.expression, names, {}, True)

    def _tangent(self, f: Any, names: Names, flags: dict[str, str], slopes: bool) -> Tangent:
        lines, (force, *by) = self._code([f, *(f.diff(a) for a in self.law.q if slopes)], names, flags)
        by += [""] * (2 * self.law.count - len(by))
        return Tangent(lines, force, by[: self.law.count], by[self.law.count :])

    def frozen(self, names: Names, slopes: bool = True) -> Tangent:
        """See `BatchForm.frozen`: flags are symbols in the expression."""
        import sympy

        from suboctave.model.expressions.derivatives import Modulus, Ramp, Sign, Step

        swaps: dict[Any, Any] = {}
        flags: dict[str, str] = {}
        # a power of a half that begins at a corner does not go on beyond it
        for i, a in enumerate(() if self.law.rough else self.places):
            on = sympy.Symbol(f"(on {i})")
            flags[on.name] = names.on(i)
            swaps |= {Ramp(a): a * on, Step(a): on}
            swaps |= {Modulus(a): a * (2 * on - 1), Sign(a): 2 * on - 1}
        return self._tangent(self.law.expression.xreplace(swaps), names, flags, slopes)

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        place = self.places[i]
        rates = [*names.r, *(names.a if self.moving else ())]
        parts = [place, *(place.diff(q) for q in self.law.q), place.diff(self.law.phase)]
        lines, texts = self._code(parts, names)
        terms = [f"({slope}) * {rate}" for slope, rate in zip(texts[1:-1], rates, strict=True) if slope != "0.0"]
        if texts[-1] != "0.0":
            terms.append(f"({texts[-1]}) * omega")
        return lines, texts[0], " + ".join(terms) or "0.0"


class CalledBack(BatchForm):
    """A law that only its element knows: its `tangent` is called.

    Its corners, if it declares any of its (first) displacement, are located.
    """

    has_code = False

    def __init__(self, c: Array, sampling: Sampling) -> None:
        self.corners = len(levels(sampling, c))
        self.count = self.corners + len(c)

    def numbers(self, c: Array, sampling: Sampling) -> list[float]:
        places = [*levels(sampling, c), *[math.inf] * self.corners]
        return [*places[: self.corners], *c.tolist()]

    def tangent(self, names: Names) -> Tangent:
        raise TypeError("a law that is called back has no code")

    def corner(self, i: int, names: Names) -> tuple[list[str], str, str]:
        return [], f"{names.q[0]} - {names.number(i)}", names.r[0]


_FORMS: dict[type, type[Any]] = {
    PolynomialSampling: PolynomialForm, SharpSampling: ArctanForm, PiecewiseLinear: PiecesForm
}  # fmt: skip


def form_of_sampling(sampling: Sampling, c: Array) -> BatchForm:
    """The law of one displacement as its smoothness class gives it, else called back."""
    form: BatchForm = _FORMS[type(sampling)](sampling) if sampling.whole else CalledBack(c, sampling)
    return form
