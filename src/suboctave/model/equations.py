"""Systems from equations of motion written as text.

    x'' + 2*zeta*x' + x + alpha*x**3 = p*cos(omega*t)

What has a second derivative is a degree of freedom; what its acceleration is multiplied by is the mass. Every other
term is sorted by what it is: linear in the state (damping, stiffness), a cosine of time (loads), constant (static
loads), or a force of its own. Forces that depend on one combination of the displacements, and act along it, become
elements along that direction, as if made by hand (`CubicSpring`, `ElasticStop`, ..); the rest `Expression`s.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy
from sympy.simplify.fu import TR8

from suboctave.errors import InputError, located, suggest
from suboctave.model.angles import declared_angles
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
    real_number,
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


def declared_in(equations: str | Sequence[str]) -> tuple[Any, dict[str, str]]:
    """Equations without the angles that are declared beside them, and these with the sizes of their turns."""
    texts = [equations] if isinstance(equations, str) else equations
    if not isinstance(texts, Sequence) or not all(isinstance(text, str) for text in texts):
        return equations, {}
    return declared_angles(texts)


class _Equations:
    """The terms of all equations, each in its place.

    A term that is no part of the linear structure and depends on a single combination `u = d . x` (and its rate) is a
    law of u along that direction d. In one that depends on several displacements u stands for the combination that its
    corners depend on, if that is one.
    """

    def __init__(self, texts: list[str], parameters: dict[str, float]) -> None:
        self.texts, self.parameters = texts, parameters
        self.names = self._find_names()
        self.n = len(self.names)
        self.x = [symbol(name) for name in self.names]
        self.v = [symbol(name + PRIME) for name in self.names]
        self.a = [symbol(name + 2 * PRIME) for name in self.names]
        self.states = {*self.x, *self.v}
        self.t, self.omega = symbol("t"), symbol("omega")
        self.u, self.rate = symbol("(input)"), symbol("(input)" + PRIME)
        self.damping, self.stiffness = ([[0] * self.n for _ in range(self.n)] for _ in range(2))
        self.waves: list[list[tuple[str, int, str]]] = [[] for _ in range(self.n)]
        self.static: list[Any] = [0] * self.n
        #: whether other states occur, direction of u (None without), law: the factor in every equation
        self.laws: dict[tuple[bool, tuple[float, ...] | None, Any], np.ndarray] = {}

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
        for i, equation in enumerate(equations):
            for term in self._terms(equation):
                self._sort(i, term)
        return {
            "mass": _matrix(mass),
            "damping": _matrix(self.damping),
            "stiffness": _matrix(self.stiffness),
            "elements": self._elements(),
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
            short = not self._affine(term) and expanded_size(term) <= _MOST_TERMS
            parts = sympy.Add.make_args(sympy.expand(term)) if short else ()
            yield from parts if any(map(self._affine, parts)) else (term,)

    def _affine(self, term: Any) -> bool:
        """Whether a term is linear in the state, or without it."""
        inside = term.free_symbols & self.states
        return not self._corners(term) and not any(term.diff(s).free_symbols & self.states for s in inside)

    def _sort(self, i: int, term: Any) -> None:
        inside = sorted(term.free_symbols.intersection(self.states), key=str)
        if not self._affine(term):
            for part in self._without_modulus(term):
                if self._affine(part):
                    self._sort(i, part)
                else:
                    self._add(i, part)
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
            self._add(i, varying)
        rest = term.xreplace(dict.fromkeys(inside, 0 * self.t))
        if rest != 0:
            self._load(i, rest)

    def _without_modulus(self, term: Any) -> tuple[Any, ...]:
        """`k |a|` as `2 k max(a, 0) - k a` where `a` is linear in the displacements: a stop and a spring."""
        for atom in term.atoms(Modulus):
            argument, factor = atom.args[0], term / atom
            if not (factor.free_symbols & {*self.states, self.t} or argument.free_symbols & {*self.v, self.t}):
                return (2 * factor * Ramp(argument), -factor * argument) if self._affine(argument) else (term,)
        return (term,)

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

    # ------------------------------------------------------------------------------------------------------- forces
    def _add(self, i: int, term: Any) -> None:
        """A term of the left-hand side of equation i."""
        direction = self._direction(term)
        several = direction is None
        if several:
            corners = {self._direction(atom.args[0]) for atom in self._corners(term)}
            direction = corners.pop() if len(corners) == 1 else None
        swaps: dict[Any, Any] = {}
        if direction is not None:
            lead, *others = (j for j, entry in enumerate(direction) if entry)
            for states, u in ((self.x, self.u), (self.v, self.rate)):
                kept = {states[j]: states[j] if several else 0 * u for j in others}
                swaps |= kept | {states[lead]: u - sum((number(direction[j]) * kept[states[j]] for j in others), 0 * u)}
        factor, law = term.xreplace(swaps).as_coeff_Mul()
        self.laws.setdefault((several, direction, law), np.zeros(self.n))[i] += float(factor)

    def _corners(self, law: Any) -> list[Any]:
        """Functions with a corner of the state."""
        states = {self.u, self.rate, *self.states}
        return [atom for atom in law.atoms(*CORNER_FUNCTIONS) if atom.free_symbols & states]

    def _direction(self, term: Any) -> tuple[float, ...] | None:
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
                factor = real_number(ratio)
                if factor is None or direction[j] not in (0.0, factor):
                    return None
                direction[j] = factor
        return tuple(direction) if all(direction[j] for j in inside) else None

    # ----------------------------------------------------------------------------------------------------- elements
    def _elements(self) -> list[BaseElement]:
        """Everything that was collected."""
        made: list[BaseElement] = []
        for among_several in (False, True):
            smooth: dict[tuple[Any, tuple[float, ...]], Any] = {}
            for (several, direction, law), places in self.laws.items():
                if several is not among_several or not np.any(places):  # without places: terms that cancel
                    continue
                scale = places[np.flatnonzero(places)[0]]
                acting = tuple((places / scale).tolist())
                if direction is not None and np.allclose(acting, direction, rtol=1e-14, atol=0.0):
                    acting = direction
                law = law * number(scale)
                if self._corners(law):
                    made.append(self._element(law, direction, acting))
                else:
                    smooth[direction, acting] = smooth.get((direction, acting), 0) + law
            made += [self._element(law, *where) for where, law in smooth.items() if law != 0]
        return made

    def _element(self, law: Any, direction: tuple[float, ...] | None, acting: tuple[float, ...]) -> BaseElement:
        """As if made by hand, where the law is one of u alone that acts along the same direction; else a text."""
        if direction == acting and not law.free_symbols & {*self.states, self.rate, self.t, self.omega}:
            made = self._stop(law, acting) or self._spring(law, acting)
            if made is not None:
                return made
        inputs: dict[str, Any] = {}
        if direction is not None:
            own = self._place(direction)
            name, dof = "u", own.get("dof")
            while name in self.names or name in self.parameters:
                name += "_"
            if isinstance(dof, int):
                name = self.names[dof]
            inputs[name] = next(iter(own.values()))
            law = law.xreplace({self.u: symbol(name), self.rate: symbol(name + PRIME)})
        inputs |= {self.names[j]: j for j in range(self.n) if law.free_symbols & {self.x[j], self.v[j]}}
        return Expression(expression=as_text(law), inputs=inputs, **self._place(acting))

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
        if self.u in factor.free_symbols or not slope.is_number or slope == 0:
            return None
        stiffness = as_text(factor * slope)
        if coefficient(stiffness).value(self.parameters) < 0.0:  # gets softer there: a spring, but no stop
            return None
        gap = -argument.subs(self.u, 0) / slope
        side = "right" if slope > 0 else "left"
        return ElasticStop(stiffness=stiffness, gap=as_text(gap), side=side, **self._place(direction))

    def _spring(self, law: Any, direction: tuple[float, ...]) -> BaseElement | None:
        """A polynomial in the displacement."""
        if not law.is_polynomial(self.u) or expanded_size(law) > _MOST_TERMS:
            return None
        polynomial = sympy.Poly(law, self.u)
        terms = {power: as_text(factor) for (power,), factor in polynomial.terms()}
        if min(terms) < 1 or max(terms) > _HIGHEST_POWER:
            return None
        place = self._place(direction)
        if list(terms) == [3]:
            return CubicSpring(coefficient=terms[3], **place)
        return PolynomialSpring(coefficients=terms, **place)

    def _place(self, direction: tuple[float, ...]) -> dict[str, Any]:
        """A direction as an index, a pair, or a vector."""
        inside = [(j, entry) for j, entry in enumerate(direction) if entry]
        if [entry for _, entry in inside] == [1.0]:
            return {"dof": inside[0][0]}
        if [entry for _, entry in inside] == [1.0, -1.0]:
            return {"dof": (inside[0][0], inside[1][0])}
        return {"direction": list(direction)}


def _matrix(entries: list[list[Any]]) -> Any:
    """Entries as numbers and texts; a matrix of one entry as that."""
    read = [
        [as_text(entry) if getattr(entry, "free_symbols", ()) else float(entry) for entry in row] for row in entries
    ]
    return read[0][0] if len(read) == 1 else read
