"""Forces given as text, with all their derivatives: SymPy differentiates, NumPy evaluates.

A law is compiled once per process and text, each order of derivatives when it is first needed. It runs on arrays in
NumPy: some microseconds per operation more than compiled loops would take, but without a second of compilation at the
first use of every new force.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from suboctave.errors import InputError
from suboctave.model.elements.base import Array
from suboctave.model.elements.batch_form import WrittenForm
from suboctave.model.elements.smoothness import (
    AdaptiveSampling,
    CornerSampling,
    PolynomialSampling,
    Sampling,
    SharpVelocitySampling,
    Surface,
)
from suboctave.model.expressions.derivatives import (
    CORNER_FUNCTIONS,
    Modulus,
    PositiveRamp,
    Ramp,
    Sign,
    Step,
    array_function,
    as_text,
    expanded_size,
    force_expression,
    lines_of_code,
    real_number,
    symbol,
)
from suboctave.model.expressions.reader import PRIME

#: symbol of the phase omega t of the load
_THETA = "omega*t"  # no identifier, so that no parameter can have this name
_HIGHEST_DEGREE = 30
#: distance from the real axis at which functions of a real argument have their nearest singularity
_SINGULAR = {sympy.tanh: sympy.pi / 2, sympy.atan: 1}
_OPERATIONS = 5000
#: distance of two corners, relative to their places, that is rounding of these: 0.1 + 0.2 and 0.3
_TOGETHER = 1e-14


@functools.lru_cache(maxsize=512)
def law_of(text: str, states: tuple[str, ...], short: bool, where: str, coefficients: tuple[str, ...] = ()) -> Law:
    """The law of a text in the displacements `states` and their rates (with a prime); `short`: v is that of x.

    `coefficients`: the order of its other names, by default that of the alphabet.
    """
    return Law(text, states, short, where, coefficients)


class Law:
    """A force `f(q, theta; c)` and its derivatives; q the displacements, then the velocities if it has any.

    Attributes
    ----------
    coefficients
        Names that are neither states nor time.
    corner_input
        Which of the displacements has the corners, or the velocity that steps of tanh and atan are of; they are known
        as such if it is the first.
    phase, rough
        The symbol of omega t; whether a power that is no integer begins at a corner.
    depends_on_velocity, time_harmonic
        Whether a velocity occurs; the highest multiple of the load's frequency, 0 without time.
    """

    def __init__(
        self, text: str, states: tuple[str, ...], short: bool, where: str, coefficients: tuple[str, ...]
    ) -> None:
        self._source = text, states, short, where, coefficients
        expression = force_expression(text, where)
        if short:
            expression = expression.subs(symbol("v"), symbol("x" + PRIME))
        self.where, self.phase = where, symbol(_THETA)
        self._compiled: dict[str, Callable[..., Array]] = {}
        rates = [name + PRIME for name in states]
        self.depends_on_velocity = any(symbol(rate) in expression.free_symbols for rate in rates)
        self.q = [symbol(name) for name in (*states, *(rates if self.depends_on_velocity else ()))]
        self.count = len(states)
        self.expression, self.time_harmonic = _with_phase(expression, where)
        taken = {*self.q, self.phase}
        self.c: list[Any] = [symbol(name) for name in coefficients]
        self.c = self.c or sorted(self.expression.free_symbols - taken, key=str)
        for one in self.c:
            if PRIME in one.name:
                raise InputError(f"{where}: {one.name.replace(PRIME, chr(39))} cannot occur in a force")
        if self.expression.count_ops() > _OPERATIONS:
            raise InputError(f"{where}: more than {_OPERATIONS} operations; split it into several elements")
        self.coefficients = tuple(one.name for one in self.c)
        self._sorted = sorted(self.c, key=str)
        self._ranks = [self._sorted.index(one) for one in self.c]
        self.corner_input = 0
        #: velocities and widths at which tanh and atan are singular, as expressions
        self._steps: list[tuple[Any, Any]] = []
        powers = [power for power in self.expression.atoms(sympy.Pow) if not power.exp.is_integer]
        self.rough = any(power.base.has(Ramp, Modulus, Step) for power in powers)
        #: functions at whose zeros there are corners, where these are not places of the first input
        self._surfaces: list[Any] = []
        self._degree, self._corner_places = self._smoothness()

    def __reduce__(self) -> tuple[Any, ...]:  # compiled again on the other side
        return law_of, self._source

    # ------------------------------------------------------------------------------------------------ smoothness
    def _smoothness(self) -> tuple[int | None, list[tuple[int, Any]] | None]:
        """Degree of a polynomial (else None); rows of q and places of corners, None if they cannot be told."""
        arguments = self.corners()
        if not arguments:
            return self._smooth(), []
        places = [self._place(argument) for argument in arguments]
        for argument, place in zip(arguments, places, strict=True):
            self._check_continuous(argument, place)
        known = [place for place in places if place is not None]
        inputs = {row % self.count for row, _ in known}
        if len(known) == len(places) and len(inputs) == 1:
            self.corner_input = inputs.pop()
            return None, known if self.corner_input == 0 else None
        if not self.rough and not any(argument.has(*CORNER_FUNCTIONS) for argument in arguments):
            self._surfaces = arguments
        return None, None

    def corners(self) -> list[Any]:
        """What vanishes where the force has corners, or jumps, that depend on the state."""
        arguments = {atom.args[0] for atom in self.expression.atoms(*CORNER_FUNCTIONS)}
        return sorted((one for one in arguments if one.free_symbols & {*self.q, self.phase}), key=str)

    def _place(self, argument: Any) -> tuple[int, Any] | None:
        """Row of q and its value at which an argument vanishes, if it depends on that one alone, and linearly."""
        rows = [r for r, state in enumerate(self.q) if state in argument.free_symbols]
        if len(rows) != 1 or self.phase in argument.free_symbols:
            return None
        state = self.q[rows[0]]
        slope = argument.diff(state)
        return None if slope.free_symbols.intersection(self.q) else (rows[0], -argument.subs(state, 0) / slope)

    def _check_continuous(self, argument: Any, place: tuple[int, Any] | None) -> None:
        """Refuse a force that jumps where an argument of a corner function vanishes."""
        if not self.expression.has(Step(argument), Sign(argument)):
            return
        above = {Ramp: argument, Step: 1, Modulus: argument, Sign: 1}
        below = {Ramp: 0, Step: 0, Modulus: -argument, Sign: -1}
        hint = (
            "a force must be continuous. Multiply by something that vanishes there, or smooth it: dry friction is "
            "TanhFriction, or tanh(v/v0)"
        )
        jump = f"the force jumps where {as_text(argument)} changes sign; {hint}"
        if place is None:
            raise InputError(f"{self.where}: it cannot be told whether {jump}")
        sides = [self.expression.subs({kind(argument): v for kind, v in one.items()}) for one in (above, below)]
        draw = np.random.default_rng(1)
        q, c = draw.uniform(0.3, 1.7, (len(self.q), 5)), draw.uniform(0.3, 1.7, len(self.c))
        theta = draw.uniform(0.0, 6.0, 5)
        q[place[0]] = self._compile([place[1]])(q, theta, c)[0]
        upper, lower = self._compile(sides)(q, theta, c)
        if not np.all(np.abs(upper - lower) <= 1e-9 * (1.0 + np.abs(upper) + np.abs(lower))):
            raise InputError(f"{self.where}: {jump}")

    def _smooth(self) -> int | None:
        """Degree of a polynomial in q and in steps, tanh and atan, of one velocity that it may have, else None."""
        steps = [one for one in self.expression.atoms(*_SINGULAR) if one.free_symbols & {*self.q, self.phase}]
        steps.sort(key=str)
        places = [self._place(step.args[0]) for step in steps]
        known = [place for place in places if place is not None and place[0] >= self.count]
        if len(known) < len(steps) or len({row for row, _ in known}) > 1 or (steps and self.time_harmonic):
            return None
        marks = sympy.symbols(f"step_:{len(steps)}")
        degree = self._polynomial(self.expression.xreplace(dict(zip(steps, marks, strict=True))), marks)
        if degree is None or not steps:
            return degree
        row = known[0][0]
        self.corner_input = row - self.count
        if self.corner_input:
            return None
        slopes = [step.args[0].diff(self.q[row]) for step in steps]
        widths = [_SINGULAR[step.func] / sympy.Abs(slope) for step, slope in zip(steps, slopes, strict=True)]
        self._steps = [(place[1], width) for place, width in zip(known, widths, strict=True)]
        return degree

    def _polynomial(self, expression: Any, steps: Sequence[Any]) -> int | None:
        """Total degree in q of a polynomial in q and steps whose time enters by sines and cosines, else None."""
        waves = [wave for wave in expression.atoms(sympy.sin, sympy.cos) if self.phase in wave.free_symbols]
        signs = sympy.symbols(f"wave_:{len(waves)}")
        generators = [*self.q, *steps, *signs]
        harmonics = [0] * (len(self.q) + len(steps)) + [abs(int(wave.args[0].coeff(self.phase))) for wave in waves]
        swapped = expression.xreplace(dict(zip(waves, signs, strict=True)))
        plain = self.phase not in swapped.free_symbols and swapped.is_polynomial(*generators)
        if not plain or expanded_size(swapped) > 1000:
            return None
        monomials = sympy.Poly(swapped, *generators).monoms()
        products = [sum(p * h for p, h in zip(powers, harmonics, strict=True)) for powers in monomials]
        self.time_harmonic = max(self.time_harmonic, *products)
        degree = max(sum(powers[: len(self.q)]) for powers in monomials)
        return degree if degree <= _HIGHEST_DEGREE else None

    def sampling(self, c: Array) -> Sampling:
        """How smooth the law is at these coefficients."""
        if self._steps:
            values = self._numbers("steps", [one for step in self._steps for one in step], c)
            # a step without slope is none
            there = [pair for pair in zip(values[::2], values[1::2], strict=True) if np.isfinite(pair[1])]
            return SharpVelocitySampling(tuple(v for v, _ in there), tuple(w for _, w in there), self._degree or 0)
        if self._degree is not None:
            return PolynomialSampling(max(1, self._degree))
        if self._surfaces:
            return CornerSampling(surfaces=len(self._surfaces))
        if not self._corner_places:
            return AdaptiveSampling()
        rows, places = zip(*self._corner_places, strict=True)
        values = self._numbers("corners", places, c)
        points, velocities = (
            [v for r, v in zip(rows, values, strict=True) if bool(r) is moving] for moving in (False, True)
        )
        return CornerSampling(_apart(points), _apart(velocities), self.rough)

    def level_rates(self, c: Array) -> list[Array] | None:
        """See `BaseElement.level_rates`: from the derivatives of the places; None where they are no places."""
        if not self._corner_places or self._degree is not None:
            return None
        rows, places = zip(*self._corner_places, strict=True)
        values = self._numbers("corners", places, c)
        parts = [place.diff(one) for place in places for one in self.c]
        rates = np.reshape(self._numbers("rates of corners", parts, c), (len(places), len(self.c)))
        kind = self.sampling(c)
        assert isinstance(kind, CornerSampling)
        found = []
        for moving, levels in ((False, kind.points), (True, kind.velocities)):
            own = [i for i, row in enumerate(rows) if bool(row) is moving]
            nearest = [int(np.argmin([abs(values[i] - level) for level in levels])) for i in own]
            found += [
                rates[[i for i, n in zip(own, nearest, strict=True) if n == number]] for number in range(len(levels))
            ]
        return found

    def _numbers(self, what: str, parts: Sequence[Any], c: Array) -> list[float]:
        """Values of expressions of the coefficients."""
        values: list[float] = self._code(what, lambda: parts)(np.zeros((len(self.q), 1)), np.zeros(1), c)[:, 0].tolist()
        return values

    # ------------------------------------------------------------------------------------------------ derivatives
    def _code(self, what: str, parts: Callable[[], Sequence[Any]]) -> Callable[..., Array]:
        if what not in self._compiled:
            self._compiled[what] = self._compile(parts())
        return self._compiled[what]

    def _compile(self, parts: Sequence[Any]) -> Callable[..., Array]:
        """A function `(q, theta, c) -> (len(parts), N)`."""
        return array_function([_off_corners(part) for part in parts], self.q, self.phase, self.c)

    def scalar_code(
        self, parts: list[Any], states: list[str], number: Callable[[int], str], prefix: str, more: Mapping[str, str]
    ) -> tuple[list[str], list[str]]:
        """Lines of code and an expression for each of the parts, for a compiler: of numbers instead of arrays.

        `states`, `number` name states and coefficients; variables of its own begin with `prefix`; `more` are further
        symbols. The phase is `theta`.
        """
        names = {state.name: states[i] for i, state in enumerate(self.q)}
        names |= {one.name: number(i) for i, one in enumerate(self.c)} | {_THETA: "theta", **more}
        return lines_of_code([_off_corners(part) for part in parts], names, f"{prefix}w")

    @functools.cached_property
    def batch_form(self) -> WrittenForm:
        """See `BaseElement.batch_form`."""
        return WrittenForm(self)

    def tangent(self, q: Array, theta: Array, c: Array) -> tuple[Array, Array]:
        """`(f, f_q)`, shapes (N,), (Q, N)."""
        f = self.expression
        values = self._code("tangent", lambda: [f, *(f.diff(a) for a in self.q)])(q, theta, c)
        return values[0], values[1:]

    def _symmetric(self, what: str, by: list[Any], order: int, q: Array, theta: Array, c: Array) -> Array:
        """All derivatives of one order, each computed once."""
        size = len(by)
        index = list(itertools.combinations_with_replacement(range(size), order))
        values = self._code(what, lambda: [self.expression.diff(*(by[i] for i in one)) for one in index])(q, theta, c)
        return values[_numbers_in_tensor(size, order)]

    def curvature(self, q: Array, theta: Array, c: Array) -> Array:
        """`f_qq`, (Q, Q, N)."""
        return self._symmetric("curvature", self.q, 2, q, theta, c)

    def third(self, q: Array, theta: Array, c: Array) -> Array:
        """`f_qqq`, (Q, Q, Q, N)."""
        return self._symmetric("third", self.q, 3, q, theta, c)

    def coefficient_tangent(self, q: Array, theta: Array, c: Array) -> tuple[Array, Array]:
        """`(f_c, f_qc)`, shapes (nc, N), (nc, Q, N)."""
        f = self.expression
        values = self._code(
            "by c", lambda: [d for a in self._sorted for d in (f.diff(a), *(f.diff(a, b) for b in self.q))]
        )
        by_c = values(q, theta, c).reshape(len(self.c), 1 + len(self.q), -1)[self._ranks]
        return by_c[:, 0], by_c[:, 1:]

    def surface(self, which: int, q: Array, theta: Array, c: Array) -> Surface:
        """See `CoupledElement.surface`."""
        value, normal, by_phase = self.surface_slopes(which, q, theta, c)
        phi, states, size = self._surfaces[which], self.q, len(self.q)

        def parts() -> list[Any]:
            normals = [phi.diff(a) for a in states]
            bends = [a.diff(b) for a in normals for b in states]
            return [*bends, *(a.diff(self.phase) for a in normals), *(phi.diff(a) for a in self.c)]

        values = self._code(f"surface {which}, more", parts)(q, theta, c)
        bend, normal_by_phase, by_c = np.split(values, [size * size, size * size + size])
        return Surface(value, normal, bend.reshape(size, size, -1), by_phase, normal_by_phase, by_c)

    def surface_key(self, which: int, c: Array) -> Hashable:
        """See `CoupledElement.surface_key`."""
        text, numbers = self._surface_texts[which]
        return text, *c[numbers].tolist()

    @functools.cached_property
    def _surface_texts(self) -> list[tuple[str, list[int]]]:
        """Every function of a surface as a text, and which coefficients occur in it."""
        return [(str(phi), [i for i, one in enumerate(self.c) if one in phi.free_symbols]) for phi in self._surfaces]

    def surface_slopes(self, which: int, q: Array, theta: Array, c: Array) -> tuple[Array, Array, Array]:
        """See `CoupledElement.surface_slopes`."""
        phi = self._surfaces[which]
        code = self._code(f"surface {which}", lambda: [phi, *(phi.diff(a) for a in self.q), phi.diff(self.phase)])
        values = code(q, theta, c)
        return values[0], values[1:-1], values[-1]

    def coefficient_curvature(self, q: Array, theta: Array, c: Array) -> Array:
        """`f_cc`, (nc, nc, N)."""
        return self._symmetric("by c twice", self._sorted, 2, q, theta, c)[np.ix_(self._ranks, self._ranks)]


@functools.cache
def _numbers_in_tensor(size: int, order: int) -> NDArray[np.int64]:
    """Of every entry of a symmetric tensor: its number among `combinations_with_replacement`."""
    numbers = {one: i for i, one in enumerate(itertools.combinations_with_replacement(range(size), order))}
    entries = [numbers[tuple(sorted(one))] for one in itertools.product(range(size), repeat=order)]
    return np.array(entries, dtype=np.int64).reshape((size,) * order)


def _off_corners(expression: Any) -> Any:
    """Derivatives of powers of ramps divide by them, and multiply by steps that are zero where the ramps are.

    Those by an exponent have their logarithms.
    """
    swaps = {}
    for power in expression.atoms(sympy.Pow, sympy.log):
        base = power.args[0]
        if isinstance(base, Ramp) and not (power.is_Pow and power.exp.is_nonnegative):
            swaps[power] = power.func(PositiveRamp(*base.args), *power.args[1:])
    return expression.xreplace(swaps)


def _with_phase(expression: Any, where: str) -> tuple[Any, int]:
    """Time as the phase theta = omega t of the load, and its highest multiple."""
    t, omega, theta = symbol("t"), symbol("omega"), symbol(_THETA)
    if t not in expression.free_symbols:
        if omega in expression.free_symbols:
            raise InputError(f"{where}: omega occurs outside of cos(k*omega*t); only loads may depend on the frequency")
        return expression, 0
    highest, swaps = 0, {}
    for wave in sorted(expression.atoms(sympy.sin, sympy.cos), key=str):
        if t not in wave.free_symbols:
            continue
        multiple = harmonic_of(wave.args[0])
        if multiple is None:
            raise InputError(
                f"{where}: {as_text(wave)} does not have the period of the load; time occurs as cos(k*omega*t + phase) "
                "or sin, k a positive integer"
            )
        swaps[wave] = type(wave)(multiple * theta + wave.args[0].subs(t, 0))
        highest = max(highest, abs(multiple))
    expression = expression.xreplace(swaps)
    if t in expression.free_symbols or omega in expression.free_symbols:
        what = "time" if t in expression.free_symbols else "omega"
        raise InputError(f"{where}: {what} occurs outside of cos(k*omega*t + phase) and sin(k*omega*t + phase)")
    return expression, highest


def _apart(places: Sequence[float]) -> tuple[float, ...]:
    """Places in ascending order, those that fall together taken once."""
    found: list[float] = []
    for place in sorted(places):
        if not found or place - found[-1] > _TOGETHER * max(abs(place), abs(found[-1])):
            found.append(place)
    return tuple(found)


def harmonic_of(argument: Any) -> int | None:
    """k of an argument `k omega t + phase`, None if it is of another form or k is no integer other than 0."""
    t, omega = symbol("t"), symbol("omega")
    slope = argument.diff(t)
    if t in slope.free_symbols or omega in argument.subs(t, 0).free_symbols:
        return None
    value = real_number(slope / omega)
    return int(value) if value and value.is_integer() else None
