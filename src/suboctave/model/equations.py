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

from suboctave.errors import InputError, suggest
from suboctave.model.element import BaseElement
from suboctave.model.equation_forces import Forces
from suboctave.model.expression import RESERVED
from suboctave.model.law_code import expanded_size, harmonic_of
from suboctave.model.law_syntax import LONGEST, PRIME, corner_functions, read, symbol
from suboctave.model.law_text import as_text
from suboctave.model.loads import HarmonicLoad, Load

__all__ = ["parts_of"]

_MOST_TERMS = 500


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
        found: list[str] = []
        for text in self.texts:
            for name in re.findall(r"([^\W\d]\w*)''(?!')", text):
                if name not in found:
                    found.append(name)
        if not found:
            raise InputError("no second derivative such as x'' occurs in the equations: nothing has a mass")
        if len(found) != len(self.texts):
            listed = ", ".join(f"{name}''" for name in found)
            raise InputError(
                f"{len(self.texts)} equations for {len(found)} accelerations ({listed}); give one for each"
            )
        for name in found:
            if name in self.parameters:
                raise InputError(f"{name!r} is both a parameter and a degree of freedom ({name}'' occurs)")
            if name in RESERVED:
                raise InputError(f"{name!r} cannot name a degree of freedom: it already has a meaning in expressions")
        return found

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
        import sympy

        parts = [read(" " * (len(sides[0]) + 1) * k + side, self.where(i), known) for k, side in enumerate(sides)]
        whole = parts[0] - (parts[1] if len(parts) > 1 else 0)
        return whole.replace(sympy.Abs, corner_functions().Modulus)

    # ------------------------------------------------------------------------------------------------------ sorting
    def parts(self) -> dict[str, Any]:
        equations = [self._read(i) for i in range(self.n)]
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
        self.forces = Forces(self.names, self.where, self.parameters)
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
        import sympy

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
        corner = corner_functions()
        kinds = (corner.Ramp, corner.Step, corner.Modulus, corner.Sign)
        if any(atom.free_symbols.intersection(self.states) for atom in term.atoms(*kinds)):
            return False
        return not any(term.diff(s).free_symbols.intersection(self.states) for s in inside)

    def _sort(self, i: int, term: Any) -> None:
        import sympy

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
        corner = corner_functions()
        atoms = [atom for atom in term.atoms(corner.Modulus) if atom.free_symbols & self.states]
        if len(atoms) != 1:
            return None
        argument = atoms[0].args[0]
        factor = term / atoms[0]
        if factor.free_symbols & {*self.states, self.t} or argument.free_symbols & {*self.v, self.t}:
            return None
        return (2 * factor * corner.Ramp(argument), -factor * argument) if self._affine(argument) else None

    # -------------------------------------------------------------------------------------------------------- loads
    def _load(self, i: int, term: Any, reduced: bool = False) -> None:
        """A term without state, on the right-hand side with the opposite sign."""
        import sympy

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
                from sympy.simplify.fu import TR8

                turned = sympy.expand(TR8(part))  # products of waves to sums
                if turned != part:
                    self._load(i, turned, True)
                    continue
            raise InputError(
                f"{self.where(i)}: {as_text(part)} is no load: time occurs as cos(k*omega*t + phase) or sin, "
                "k a positive integer"
            )

    def _wave(self, i: int, amplitude: Any, wave: Any, multiple: int) -> None:
        import sympy

        phase = wave.args[0].subs(self.t, 0)
        sine = type(wave).__name__ == "sin"
        if multiple < 0:
            multiple, phase = -multiple, -phase
            amplitude = -amplitude if sine else amplitude
        if sine:
            phase = phase - sympy.pi / 2
        self.waves[i].append(
            (as_text(amplitude), multiple, "-pi/2" if sine and phase == -sympy.pi / 2 else as_text(phase))
        )

    def _loads(self) -> list[Load]:
        loads: list[Load] = []
        for i, (waves, static) in enumerate(zip(self.waves, self.static, strict=True)):
            if not waves and static == 0:
                continue
            listed = waves or [("0", 0, "0")]
            loads.append(
                HarmonicLoad(
                    dof=i,
                    amplitude=[amplitude for amplitude, _, _ in listed],
                    harmonic=[multiple for _, multiple, _ in listed],
                    phase=[phase for _, _, phase in listed],
                    static=as_text(static) if static != 0 else 0.0,
                )
            )
        return loads

    def _elements(self) -> list[BaseElement]:
        return self.forces.elements({*self.parameters, *self.names})


def _matrix(entries: list[list[Any]]) -> Any:
    """Entries as numbers and texts; a matrix of one entry as that."""
    read = [[_entry(entry) for entry in row] for row in entries]
    return read[0][0] if len(read) == 1 else read


def _entry(entry: Any) -> float | str:
    if isinstance(entry, int):
        return float(entry)
    return as_text(entry) if entry.free_symbols else float(entry)
