"""Systems from equations of motion written as text.

    x'' + 2*zeta*x' + x + alpha*x**3 = p*cos(omega*t)

What has a second derivative is a degree of freedom; what its acceleration is multiplied by is the mass. Every other
term is sorted by what it is: linear in the state (damping, stiffness), a cosine of time (loads), constant (static
loads), or a force of its own. Forces that depend on one combination of the displacements, and act along it, become
elements along that direction, as if made by hand (`CubicSpring`, `ElasticStop`, ..); the rest `Expression`s.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy
from sympy.simplify.fu import TR8

from suboctave.errors import InputError, located, suggest
from suboctave.model.elements.base import BaseElement
from suboctave.model.elements.coupled import Expression
from suboctave.model.elements.springs import CubicSpring, PolynomialSpring
from suboctave.model.elements.stops import ElasticStop
from suboctave.model.expressions.coefficients import coefficient
from suboctave.model.expressions.derivatives import (
    CORNER_FUNCTIONS,
    Modulus,
    Ramp,
    Step,
    as_text,
    expanded_size,
    force_expression,
    number,
    symbol,
)
from suboctave.model.expressions.law import harmonic_of
from suboctave.model.expressions.reader import LONGEST, PRIME, RESERVED
from suboctave.model.loads import HarmonicLoad, Load

_HIGHEST_POWER, _MOST_TERMS = 30, 500


def parts_of(equations: str | Sequence[str], parameters: Mapping[str, float]) -> dict[str, Any]:
    """Mass, damping, stiffness, elements, loads and names of the DOFs: the arguments of `System`."""
    texts = [equations] if isinstance(equations, str) else list(equations) if isinstance(equations, Iterable) else []
    if not texts or any(not isinstance(text, str) for text in texts):
        raise InputError("equations must be a text or a sequence of texts, such as [\"x'' + x = p*cos(omega*t)\"]")
    longest = max(map(len, texts))
    if longest > LONGEST:
        raise InputError(f"an equation of {longest} characters is too long (at most {LONGEST})")
    texts = [text.replace("\u2032", "'").replace("\u2019", "'") for text in texts]
    return _Equations(texts, dict(parameters)).parts()


class _Equations:
    def __init__(self, texts: list[str], parameters: dict[str, float]) -> None:
        self.texts, self.parameters = texts, parameters
        self.names = self._find_names()
        self.n = len(self.names)
        self.x = [symbol(name) for name in self.names]
        self.v = [symbol(name + PRIME) for name in self.names]
        self.a = [symbol(name + 2 * PRIME) for name in self.names]
        self.states = {*self.x, *self.v}
        self.t, self.omega = symbol("t"), symbol("omega")

    def _find_names(self) -> list[str]:
        """The degrees of freedom, in the order in which their accelerations appear."""
        names: list[str] = []
        for text in self.texts:
            for name in re.findall(r"([^\W\d]\w*)''(?!')", text):
                if name not in names:
                    names.append(name)
        if not names:
            raise InputError("no second derivative such as x'' occurs in the equations: nothing has a mass")
        if len(names) != len(self.texts):
            listed = ", ".join(f"{name}''" for name in names)
            raise InputError(
                f"{len(self.texts)} equations for {len(names)} accelerations ({listed}); give one for each"
            )
        for name in names:
            if name in self.parameters:
                raise InputError(f"{name!r} is both a parameter and a degree of freedom ({name}'' occurs)")
            if name in RESERVED:
                raise InputError(f"{name!r} cannot name a degree of freedom: it already has a meaning in expressions")
        return names

    def where(self, i: int) -> str:
        return f"equation {i + 1}" if self.n > 1 else "the equation"

    def _read(self, i: int) -> Any:
        """Left-hand side minus right-hand side."""
        sides = self.texts[i].split("=")
        if len(sides) > 2:
            raise InputError(f"{self.where(i)}: one '=' at most, got {len(sides) - 1}")
        dotted = [name + k * PRIME for name in self.names for k in range(3)]
        known = {*self.parameters, *dotted, "t", "omega"}
        for name in re.findall(r"([^\W\d]\w*)'(?!')", self.texts[i]):
            if name not in self.names and not self.texts[i].count(name + "''"):
                hint = suggest(name, self.names)
                raise InputError(f"{self.where(i)}: {name}' occurs, but no equation has {name}''{hint}")
        parts = [
            force_expression(" " * (len(sides[0]) + 1) * k + side, self.where(i), known) for k, side in enumerate(sides)
        ]
        return parts[0] - (parts[1] if len(parts) > 1 else 0)

    # ------------------------------------------------------------------------------------------------------ sorting
    def parts(self) -> dict[str, Any]:
        equations = []
        for i in range(self.n):
            with located("equations", i):
                equations.append(self._read(i))
        mass = [[equation.diff(a) for a in self.a] for equation in equations]
        for i, row in enumerate(mass):
            for a, entry in zip(self.a, row, strict=True):
                inside = entry.free_symbols.intersection({*self.states, *self.a, self.t, self.omega})
                if inside:
                    shown = ", ".join(sorted(s.name.replace(PRIME, "'") for s in inside))
                    raise InputError(
                        f"{self.where(i)}: {a.name.replace(PRIME, chr(39))} is multiplied by something that depends on "
                        f"{shown}; accelerations must enter with constant factors (divide the equation, or choose "
                        "other coordinates)"
                    )
        equations = [equation.xreplace(dict.fromkeys(self.a, 0 * self.t)) for equation in equations]
        mass, equations = self._ordered(mass, equations)
        self.damping: list[list[Any]] = [[0] * self.n for _ in range(self.n)]
        self.stiffness: list[list[Any]] = [[0] * self.n for _ in range(self.n)]
        self.waves: list[list[tuple[str, int, str]]] = [[] for _ in range(self.n)]
        self.static: list[Any] = [0] * self.n
        self.forces = _Forces(self.names, self.parameters)
        for i, equation in enumerate(equations):
            for term in self._terms(equation):
                self._sort(i, term)
        return {
            "mass": _matrix(mass),
            "damping": _matrix(self.damping),
            "stiffness": _matrix(self.stiffness),
            "elements": self.forces.elements({*self.parameters, *self.names}),
            "loads": self._loads(),
            "dof_names": tuple(self.names),
        }

    def _ordered(self, mass: list[list[Any]], equations: list[Any]) -> tuple[list[list[Any]], list[Any]]:
        """Equations in the order of the DOFs whose masses they hold, with positive masses."""
        values = {symbol(name): value for name, value in self.parameters.items()}
        try:
            numbers = np.array([[float(entry.subs(values)) if entry != 0 else 0.0 for entry in row] for row in mass])
        except (TypeError, OverflowError):
            raise InputError(f"the masses {mass} are not all finite real numbers at the parameters {values}") from None
        if np.all(np.diag(numbers)) and np.allclose(np.abs(numbers), np.abs(numbers.T), rtol=1e-9, atol=0.0):
            order = list(range(self.n))
        else:
            from scipy.optimize import linear_sum_assignment

            rows, columns = linear_sum_assignment(-np.abs(numbers))
            order = [int(rows[columns.tolist().index(j)]) for j in range(self.n)]
        signs = [-1 if numbers[i, j] < 0.0 else 1 for j, i in enumerate(order)]
        mass = [[sign * entry for entry in mass[i]] for i, sign in zip(order, signs, strict=True)]
        return mass, [sign * equations[i] for i, sign in zip(order, signs, strict=True)]

    def _terms(self, expression: Any) -> Iterable[Any]:
        """Additive terms, as they are written but where that hides linear ones."""
        for term in sympy.Add.make_args(expression):
            if self._affine(term) or expanded_size(term) > _MOST_TERMS:
                yield term
                continue
            parts = sympy.Add.make_args(sympy.expand(term))
            if any(self._affine(part) for part in parts):
                yield from parts
            else:
                yield term

    def _affine(self, term: Any) -> bool:
        """Whether a term is linear in the state, or without it."""
        inside = term.free_symbols.intersection(self.states)
        if not inside:
            return True
        if any(atom.free_symbols & self.states for atom in term.atoms(*CORNER_FUNCTIONS)):
            return False
        return not any(term.diff(s).free_symbols.intersection(self.states) for s in inside)

    def _sort(self, i: int, term: Any) -> None:
        inside = sorted(term.free_symbols.intersection(self.states), key=str)
        if not inside:
            self._load(i, term)
            return
        if not self._affine(term):
            straight = self._without_modulus(term)
            for part in (term,) if straight is None else straight:
                if self._affine(part):
                    self._sort(i, part)
                else:
                    self.forces.add(i, part)
            return
        varying = 0
        for state in inside:
            for part in sympy.Add.make_args(sympy.expand(term.diff(state))):
                if self.t in part.free_symbols:
                    varying += part * state
                    continue
                if self.omega in part.free_symbols:
                    what = as_text(part * state)
                    raise InputError(f"{self.where(i)}: omega occurs in {what}; only loads may depend on the frequency")
                if state in self.x:
                    self.stiffness[i][self.x.index(state)] += part
                else:
                    self.damping[i][self.v.index(state)] += part
        if varying != 0:
            self.forces.add(i, varying)
        rest = term.xreplace(dict.fromkeys(inside, 0 * self.t))
        if rest != 0:
            self._load(i, rest)

    def _without_modulus(self, term: Any) -> tuple[Any, Any] | None:
        """`k |a|` as `2 k max(a, 0) - k a` where `a` is linear in the displacements: a stop and a spring."""
        atoms = [atom for atom in term.atoms(Modulus) if atom.free_symbols & self.states]
        if len(atoms) != 1:
            return None
        argument = atoms[0].args[0]
        factor = term / atoms[0]
        if factor.free_symbols & {*self.states, self.t} or argument.free_symbols & {*self.v, self.t}:
            return None
        return (2 * factor * Ramp(argument), -factor * argument) if self._affine(argument) else None

    # -------------------------------------------------------------------------------------------------------- loads
    def _load(self, i: int, term: Any, reduced: bool = False) -> None:
        """A term without state, on the right-hand side with the opposite sign."""
        for part in sympy.Add.make_args(sympy.expand(term)):
            if self.t not in part.free_symbols:
                if self.omega in part.free_symbols:
                    self.waves[i].append((as_text(-part), 0, "0"))
                else:
                    self.static[i] -= part
                continue
            factors = sympy.Mul.make_args(part)
            waves = [f for f in factors if self.t in f.free_symbols]
            if len(waves) == 1 and type(waves[0]).__name__ in ("sin", "cos"):
                multiple = harmonic_of(waves[0].args[0])
                if multiple is not None:
                    self._wave(i, -part / waves[0], waves[0], multiple)
                    continue
            elif not reduced:
                turned = sympy.expand(TR8(part))  # products of waves to sums
                if turned != part:
                    self._load(i, turned, True)
                    continue
            raise InputError(
                f"{self.where(i)}: {as_text(part)} is no load: time occurs as cos(k*omega*t + phase) or sin, "
                "k a positive integer"
            )

    def _wave(self, i: int, amplitude: Any, wave: Any, multiple: int) -> None:
        phase = wave.args[0].subs(self.t, 0)
        sine = type(wave).__name__ == "sin"
        if multiple < 0:
            multiple, phase = -multiple, -phase
            amplitude = -amplitude if sine else amplitude
        if sine:
            phase = phase - sympy.pi / 2
        self.waves[i].append((as_text(amplitude), multiple, as_text(phase)))

    def _loads(self) -> list[Load]:
        loads: list[Load] = []
        for i, (waves, static) in enumerate(zip(self.waves, self.static, strict=True)):
            if not waves and static == 0:
                continue
            amplitudes, harmonics, phases = map(list, zip(*(waves or [("0", 0, "0")]), strict=True))
            loads.append(HarmonicLoad(i, amplitudes, harmonics, phases, as_text(static) if static != 0 else 0.0))
        return loads


def _matrix(entries: list[list[Any]]) -> Any:
    """Entries as numbers and texts; a matrix of one entry as that."""
    read = [
        [as_text(entry) if getattr(entry, "free_symbols", ()) else float(entry) for entry in row] for row in entries
    ]
    return read[0][0] if len(read) == 1 else read


# ------------------------------------------------------------------------------------------------------------ forces
class _Forces:
    """Collects the terms of all equations that are no part of the linear structure.

    A term that depends on a single combination `d . x` (and its rate) is kept with its place in each equation; the
    vector of those places says along which direction it acts.
    """

    def __init__(self, names: list[str], parameters: Mapping[str, float]) -> None:
        self.names, self.parameters = names, parameters
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
                factor = _real(ratio)
                if factor is None or direction[j] not in (0.0, factor):
                    return None
                direction[j] = factor
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
                law, acting = law * number(scale), direction
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
        states = {self.u, self.rate, *self.x, *self.v}
        return any(atom.free_symbols & states for atom in law.atoms(*CORNER_FUNCTIONS))

    def _stop(self, law: Any, direction: tuple[float, ...]) -> BaseElement | None:
        """`k max(a u + b, 0)`, or the same with a Heaviside function, as an elastic stop."""
        atoms = [a for a in law.atoms(Ramp, Step) if self.u in a.free_symbols]
        if len(atoms) != 1:
            return None
        argument = atoms[0].args[0]
        factor = law / atoms[0]
        if isinstance(atoms[0], Step):
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
            acting, law = tuple(float(place) for place in places / scale), core * number(scale)
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
        inside = self._inside(law)
        forms = {self._form(atom.args[0], inside) for atom in law.atoms(*CORNER_FUNCTIONS)}
        form = forms.pop()
        if forms or form is None:
            plain = {self.names[j]: j for j in inside}
            return Expression(expression=as_text(law), inputs=plain, **self._place(acting))
        lead = next(k for k, entry in enumerate(form) if entry)
        name = _fresh("u", taken)
        # x_lead = u - sum of the others
        swaps = {}
        for mark, states in (("", self.x), (PRIME, self.v)):
            others = sum((number(form[k]) * states[j] for k, j in enumerate(inside) if k != lead), 0 * self.u)
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

    def _form(self, argument: Any, inside: list[int]) -> tuple[float, ...] | None:
        """The combination of displacements, or of velocities, on which alone an argument depends, its first entry 1."""
        slopes, rates = ([argument.diff(states[j]) for j in inside] for states in (self.x, self.v))
        used = slopes if any(slopes) else rates
        if (any(rates) and any(slopes)) or not any(used) or not all(slope.is_number for slope in used):
            return None
        first = next(slope for slope in used if slope)
        ratios = tuple(ratio for slope in used if (ratio := _real(slope / first)) is not None)
        return ratios if len(ratios) == len(used) else None


def _fresh(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    return name


def _real(value: Any) -> float | None:
    """A real number, None for all else (an expression, a complex number, infinity)."""
    if not value.is_number:
        return None
    try:
        real = float(value)
    except (TypeError, OverflowError):
        return None
    return real if math.isfinite(real) else None
