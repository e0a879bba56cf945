"""The forces of an equation of motion as elements: which direction each depends on, and along which it acts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from suboctave.model.element import BaseElement
from suboctave.model.expression import coefficient
from suboctave.model.expression_element import Expression
from suboctave.model.law_code import expanded_size
from suboctave.model.law_syntax import PRIME, corner_functions, symbol
from suboctave.model.law_text import as_text
from suboctave.model.springs import CubicSpring, PolynomialSpring
from suboctave.model.stops import ElasticStop

__all__ = ["Forces"]

_HIGHEST_POWER, _MOST_TERMS = 30, 500


class Forces:
    """Collects the terms of all equations that are no part of the linear structure.

    A term that depends on a single combination `d . x` (and its rate) is kept with its place in each equation; the
    vector of those places says along which direction it acts.
    """

    def __init__(self, names: list[str], where: Callable[[int], str], parameters: Mapping[str, float]) -> None:
        self.names, self.where, self.parameters = names, where, parameters
        self.n = len(names)
        self.x = [symbol(name) for name in names]
        self.v = [symbol(name + PRIME) for name in names]
        self.u, self.rate = symbol("(input)"), symbol("(input)" + PRIME)
        #: law in u and its rate, direction: in which equations it stands
        self.along: dict[tuple[Any, tuple[float, ...]], np.ndarray] = {}
        self.several: list[tuple[int, Any]] = []

    def add(self, i: int, term: Any) -> None:
        """A term of the left-hand side of equation i."""
        direction = self._direction(term)
        if direction is None:
            self.several.append((i, term))
            return
        first = next(j for j, entry in enumerate(direction) if entry)
        swaps = {self.x[first]: self.u, self.v[first]: self.rate}
        swaps |= {s[j]: 0 * self.u for s in (self.x, self.v) for j in range(self.n) if j != first}
        factor, law = term.xreplace(swaps).as_coeff_Mul()
        key = (law, tuple(direction))
        self.along.setdefault(key, np.zeros(self.n))[i] += float(factor)

    def _direction(self, term: Any) -> list[float] | None:
        """d, its first entry 1, if the term depends on `d . x` and `d . x'` alone."""
        import sympy

        inside = [j for j in range(self.n) if term.free_symbols & {self.x[j], self.v[j]}]
        direction = [0.0] * self.n
        direction[inside[0]] = 1.0
        for states in (self.x, self.v):
            slopes = [term.diff(states[j]) for j in inside]
            if slopes[0] == 0:
                if any(slope != 0 for slope in slopes[1:]):
                    return None
                continue
            for j, slope in zip(inside[1:], slopes[1:], strict=True):
                ratio = sympy.cancel(slope / slopes[0]) if expanded_size(slope) < _MOST_TERMS else slope / slopes[0]
                number = _real(ratio)
                if number is None or direction[j] not in (0.0, number):
                    return None
                direction[j] = number
        return direction if all(direction[j] for j in inside) else None

    # ----------------------------------------------------------------------------------------------------- elements
    def elements(self, taken: set[str]) -> list[BaseElement]:
        """Everything that was collected; `taken` are names that are in use."""
        made: list[BaseElement] = []
        smooth: dict[tuple[tuple[float, ...], tuple[float, ...]], Any] = {}
        for (law, direction), places in self.along.items():
            if not np.any(places):
                continue  # terms that cancel
            acting = tuple(float(place) for place in places)
            scale = acting[next(j for j, entry in enumerate(direction) if entry)]
            if scale and np.allclose(places, scale * np.array(direction), rtol=1e-14, atol=0.0):
                law, acting = law * _number(scale), direction
            stop = self._stop(law, direction) if acting == direction else None
            if stop is not None:
                made.append(stop)
            elif self._has_corner(law):
                made.append(self._expression(law, direction, acting, taken))
            else:
                key = (direction, acting)
                smooth[key] = smooth.get(key, 0) + law
        for (direction, acting), law in smooth.items():
            spring = self._spring(law, direction) if direction == acting else None
            made.append(spring or self._expression(law, direction, acting, taken))
        return made + self._coupled(taken)

    def _has_corner(self, law: Any) -> bool:
        corner = corner_functions()
        kinds = (corner.Ramp, corner.Step, corner.Modulus, corner.Sign)
        states = {self.u, self.rate, *self.x, *self.v}
        return any(atom.free_symbols & states for atom in law.atoms(*kinds))

    def _stop(self, law: Any, direction: tuple[float, ...]) -> BaseElement | None:
        """`k max(a u + b, 0)`, or the same with a Heaviside function, as an elastic stop."""
        import sympy

        corner = corner_functions()
        atoms = [a for a in law.atoms(corner.Ramp, corner.Step) if self.u in a.free_symbols]
        if len(atoms) != 1:
            return None
        argument = atoms[0].args[0]
        factor = law / atoms[0]
        if isinstance(atoms[0], corner.Step):
            factor = sympy.cancel(factor / argument)
        slope = argument.diff(self.u)
        varying = {self.u, self.rate, symbol("t"), symbol("omega")}
        if (
            factor.free_symbols & varying
            or not slope.is_number
            or slope == 0
            or argument.free_symbols & (varying - {self.u})
        ):
            return None
        stiffness = as_text(factor * slope)
        if coefficient(stiffness).value(self.parameters) < 0.0:  # gets softer there: a spring, but no stop
            return None
        gap = -argument.subs(self.u, 0) / slope
        side = "right" if slope > 0 else "left"
        place = self._place(direction)
        return ElasticStop(stiffness=stiffness, gap=as_text(gap), side=side, **place)

    def _spring(self, law: Any, direction: tuple[float, ...]) -> BaseElement | None:
        """A polynomial in the displacement."""
        import sympy

        if not law.is_polynomial(self.u) or law.free_symbols & {self.rate, symbol("t"), symbol("omega")}:
            return None
        if expanded_size(law) > _MOST_TERMS:
            return None
        polynomial = sympy.Poly(law, self.u)
        terms = {power: as_text(factor) for (power,), factor in polynomial.terms()}
        if min(terms) < 1 or max(terms) > _HIGHEST_POWER:
            return None
        place = self._place(direction)
        if list(terms) == [3]:
            return CubicSpring(coefficient=terms[3], **place)
        return PolynomialSpring(coefficients=terms, **place)

    def _place(self, direction: tuple[float, ...], name: str = "dof") -> dict[str, Any]:
        """A direction as an index, a pair, or a vector."""
        inside = [(j, entry) for j, entry in enumerate(direction) if entry]
        if len(inside) == 1 and inside[0][1] == 1.0:
            return {name: inside[0][0]}
        if len(inside) == 2 and (inside[0][1], inside[1][1]) == (1.0, -1.0):
            return {name: (inside[0][0], inside[1][0])}
        return {"direction": [float(entry) for entry in direction]}

    def _expression(
        self, law: Any, direction: tuple[float, ...], acting: tuple[float, ...], taken: set[str]
    ) -> BaseElement:
        inside = [j for j, entry in enumerate(direction) if entry]
        name = self.names[inside[0]] if len(inside) == 1 else _fresh("u", taken)
        law = law.xreplace({self.u: symbol(name), self.rate: symbol(name + PRIME)})
        read = next(iter(self._place(direction).values()))
        return Expression(expression=as_text(law), inputs={name: read}, **self._place(acting))

    def _coupled(self, taken: set[str]) -> list[BaseElement]:
        """Forces that depend on several displacements, along the direction in which each acts."""
        cores: dict[Any, np.ndarray] = {}
        for i, term in self.several:
            factor, core = term.as_coeff_Mul()
            cores.setdefault(core, np.zeros(self.n))[i] += float(factor)
        made: list[BaseElement] = []
        smooth: dict[tuple[float, ...], Any] = {}
        for core, places in cores.items():
            if not np.any(places):
                continue  # terms that cancel
            scale = places[np.flatnonzero(places)[0]]
            acting, law = tuple(float(place) for place in places / scale), core * _number(scale)
            if self._has_corner(law):
                made.append(self._with_corner(acting, law, taken))
            else:
                smooth[acting] = smooth.get(acting, 0) + law
        for acting, law in smooth.items():
            if law != 0:
                inputs = {self.names[j]: j for j in self._inside(law)}
                made.append(Expression(expression=as_text(law), inputs=inputs, **self._place(acting)))
        return made

    def _inside(self, law: Any) -> list[int]:
        return [j for j in range(self.n) if law.free_symbols & {self.x[j], self.v[j]}]

    def _with_corner(self, acting: tuple[float, ...], law: Any, taken: set[str]) -> BaseElement:
        """The displacement that the corner depends on is made the first input, a combination of several if need be."""
        corner = corner_functions()
        arguments = {a.args[0] for a in law.atoms(corner.Ramp, corner.Step, corner.Modulus, corner.Sign)}
        inside = self._inside(law)
        plain = {self.names[j]: j for j in inside}
        forms = set()
        for argument in arguments:
            slopes = [argument.diff(self.x[j]) for j in inside]
            rates = [argument.diff(self.v[j]) for j in inside]
            if any(rates) and any(slopes):
                return Expression(expression=as_text(law), inputs=plain, **self._place(acting))
            used = slopes if any(slopes) else rates
            if not all(slope.is_number for slope in used) or not any(used):
                return Expression(expression=as_text(law), inputs=plain, **self._place(acting))
            first = next(slope for slope in used if slope)
            ratios = [_real(slope / first) for slope in used]
            known = [ratio for ratio in ratios if ratio is not None]
            if len(known) < len(ratios):
                return Expression(expression=as_text(law), inputs=plain, **self._place(acting))
            forms.add(tuple(known))
        if len(forms) != 1:
            return Expression(expression=as_text(law), inputs=plain, **self._place(acting))
        form = forms.pop()
        lead = next(k for k, entry in enumerate(form) if entry)
        name = _fresh("u", taken)
        # x_lead = u - sum of the others
        swaps = {}
        for mark, states in (("", self.x), (PRIME, self.v)):
            others = sum((_number(form[k]) * states[j] for k, j in enumerate(inside) if k != lead), 0 * self.u)
            swaps[states[inside[lead]]] = symbol(name + mark) - others
        changed = law.subs(swaps, simultaneous=True)
        direction = [0.0] * self.n
        for k, j in enumerate(inside):
            direction[j] = form[k]
        inputs: dict[str, Any] = {name: next(iter(self._place(tuple(direction)).values()))}
        inputs |= {self.names[j]: j for k, j in enumerate(inside) if k != lead}
        left = {state.name.rstrip(PRIME) for state in changed.free_symbols}
        inputs = {n: p for n, p in inputs.items() if n in left or n == name}
        return Expression(expression=as_text(changed), inputs=inputs, **self._place(acting))


def _fresh(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    return name


def _number(value: float) -> Any:
    import sympy

    return sympy.Integer(int(value)) if float(value).is_integer() else sympy.Float(value)


def _real(value: Any) -> float | None:
    """A real number, None for all else (an expression, a complex number, infinity)."""
    if not value.is_number:
        return None
    try:
        number = float(value)
    except (TypeError, OverflowError):
        return None
    return number if math.isfinite(number) else None
