"""The contract of an element: a force `f(u, v; c)` along one direction of the structure.

An element acts on the relative displacement `u = d . x` and velocity `v = d . x'` with the force `d f(u, v; c)` on the
left-hand side of the equation of motion. Its coefficients `c` are numbers or expressions in the system's parameters. A
new element is a subclass that passes its coefficients to `Element.__init__` and provides the laws below as pure
functions of arrays; `check_derivatives` compares them with finite differences. Forces that depend on several
displacements, or on time, are in `coupled`. Derivatives that are not given are differences of fourth order,
`f'(0) ~ (8 (f(h) - f(-h)) - (f(2h) - f(-2h))) / 12 h`.
"""

from __future__ import annotations

import functools
import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from numbers import Integral
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from suboctave.arguments import READ
from suboctave.errors import InputError, chosen_dof, located, shortened
from suboctave.interruption import users_function
from suboctave.model.description import Recorded
from suboctave.model.elements.batch_form import BatchForm, CalledBack, form_of_sampling
from suboctave.model.elements.smoothness import Sampling, WholeLaw, widths_of
from suboctave.model.expressions.coefficients import Coefficient, Number, named_coefficient

Array: TypeAlias = NDArray[np.float64]
Dof: TypeAlias = Annotated[int | str | Sequence[int | str], READ]


def numbers_of(given: Any) -> Array:
    """What was given as an array of floats; an empty one for what is none."""
    try:
        return np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return np.zeros(0)


class Place:
    """Where something acts: `dof=i` along `e_i`, `dof=(i, j)` along `e_i - e_j`, or any `direction` vector."""

    def __init__(self, owner: str, dof: Dof | None, direction: ArrayLike | None) -> None:
        self.owner = owner
        if (dof is None) == (direction is None):
            raise InputError(f"{owner} needs either dof= (one index, or a pair) or direction= (a vector), not both")
        self.dofs: tuple[int, ...] = ()
        #: the names that are given, until a system tells their numbers
        self.named = ""
        self.vector: Array | None = None
        if dof is None:
            self.vector = numbers_of(direction)
            if self.vector.ndim != 1 or not np.all(np.isfinite(self.vector)) or not np.any(self.vector):
                named = isinstance(direction, str | Mapping)
                hint = f"; a structure makes it: structure.direction({shortened(direction)})" if named else ""
                text = f"{owner}: direction must be a vector of finite numbers, not all zero{hint}"
                raise InputError(text, ("direction",))
            self.vector.setflags(write=False)
            return
        asked: Any = dof
        several = isinstance(asked, Sequence | np.ndarray) and not isinstance(asked, str | bytes)
        given = tuple(asked) if several and getattr(asked, "ndim", True) else (asked,)
        with located("dof"):
            if len(given) not in (1, 2) or any(isinstance(e, bool) or not isinstance(e, Integral | str) for e in given):
                what = "an integer, a name, or a pair of these"
                raise InputError(f"{owner}: dof must be {what}, not {shortened(dof)}")
            if _is_named(given):
                self.named = shortened(dof)
                return
            self.dofs = tuple(int(entry) for entry in given)
            if min(self.dofs) < 0:
                raise InputError(f"{owner}: dof {min(self.dofs)} is negative; degrees of freedom count from 0")
            if len(set(self.dofs)) < len(self.dofs):
                raise InputError(f"{owner}: dof={self.dofs} couples a degree of freedom with itself")

    def direction(self, n: int) -> Array:
        """The direction (n,) in a structure of n degrees of freedom; an `InputError` if it does not fit."""
        if self.vector is not None:
            if len(self.vector) != n:
                text = f"{self.owner}: direction has {len(self.vector)} entries, the structure {n} DOFs"
                raise InputError(text, ("direction",))
            return self.vector.copy()
        if self.named:
            raise InputError(f"{self.owner}: dof={self.named} is a name, which a System with dof_names has", ("dof",))
        if max(self.dofs) >= n:
            there = "only DOF 0" if n == 1 else f"DOFs 0 to {n - 1}"
            raise InputError(f"{self.owner}: dof {max(self.dofs)} does not exist; the structure has {there}", ("dof",))
        result = np.zeros(n)
        for dof, sign in zip(self.dofs, (1.0, -1.0), strict=False):
            result[dof] = sign
        return result

    def __str__(self) -> str:
        if self.vector is not None:
            shown = ", ".join(f"{entry:g}" for entry in self.vector[:4]) + (", ..." if len(self.vector) > 4 else "")
            return f"direction=[{shown}]"
        if self.named:
            return f"dof={self.named}"
        return f"dof={self.dofs[0]}" if len(self.dofs) == 1 else f"dof={self.dofs}"


def _is_named(given: Any) -> bool:
    """Whether degrees of freedom are given by names."""
    if isinstance(given, Mapping):
        return any(map(_is_named, given.values()))
    return isinstance(given, str) or (isinstance(given, list | tuple) and any(map(_is_named, given)))


def with_numbers(part: Any, names: Sequence[str]) -> Any:
    """An element or a load with the numbers of its degrees of freedom in the place of their names, if it has any."""
    given = {name: part.arguments[name] for name in ("dof", "perpendicular", "inputs") if name in part.arguments}
    asked = {name: value for name, value in given.items() if _is_named(value)}
    if not asked:
        return part
    numbered = {name: _numbered(value, names, name) for name, value in asked.items()}
    return type(part)(**{**part.arguments, **numbered})


def _numbered(given: Any, names: Sequence[str], argument: str) -> Any:
    if isinstance(given, Mapping):
        return {key: _numbered(value, names, argument) for key, value in given.items()}
    if isinstance(given, list | tuple):
        if len(given) == 2 and argument == "dof":
            # one of a node, ("1042", "z"), or two
            with suppress(InputError):
                return chosen_dof(tuple(given), 0, len(names), argument, names)
        return [_numbered(entry, names, argument) for entry in given]
    return chosen_dof(given, 0, len(names), argument, names) if isinstance(given, str) else given


#: methods of an element that give its law
_LAWS = frozenset(
    ("tangent", "curvature", "third", "coefficient_tangent", "coefficient_curvature", "sampling", "law_at", "surface")
)


def _of_user(name: str, method: Any) -> Any:
    """A method of a user's own element: what it raises is a function of the user's that failed."""
    if not inspect.isfunction(method) or getattr(method, "__isabstractmethod__", False):
        return method

    @functools.wraps(method)
    def called(self: Any, *positional: Any, **named: Any) -> Any:
        with users_function(f"{self.label}: {name}"):
            return method(self, *positional, **named)

    return called


class BaseElement(Recorded, ABC, family="element"):
    """What all elements have in common: where they act, and their coefficients. Immutable by convention.

    own_nodes
        Whether it is integrated at instants of its own, chosen for it alone (`sampling` tells them), instead of
        together with the others along the same direction.
    glyph
        How a schematic draws it: "spring", "damper", "stop", "friction" or "law".
    """

    coefficient_names: tuple[str, ...] = ()
    depends_on_velocity: bool = False
    depends_on_time: bool = False
    own_nodes: bool = False
    glyph: str = "law"

    def __init__(
        self,
        dof: Dof | None = None,
        coefficients: Sequence[Number | None] = (),
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        kind = type(self).__name__
        if len(coefficients) == len(self.coefficient_names):
            required(kind, **dict(zip(self.coefficient_names, coefficients, strict=True)))
        self.place = Place(kind, dof, direction)
        if len(coefficients) != len(self.coefficient_names):
            raise InputError(f"{kind} takes {len(self.coefficient_names)} coefficients, got {len(coefficients)}")
        given = zip(self.coefficient_names, coefficients, strict=True)
        read = tuple(named_coefficient(source, f"{kind}({self.place})", name) for name, source in given)
        self.coefficients: tuple[Coefficient, ...] = read
        self._constant = np.array([c.value({}) if c.constant else np.nan for c in read])
        self._varying = tuple((i, c) for i, c in enumerate(read) if not c.constant)

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if not cls.__module__.startswith("suboctave."):
            for name in _LAWS.intersection(vars(cls)):
                setattr(cls, name, _of_user(name, vars(cls)[name]))

    @property
    def label(self) -> str:
        """How messages name this element."""
        return f"{type(self).__name__}({self.place})"

    def direction(self, n: int) -> Array:
        """The vector (n,) with `u = direction . x`."""
        return self.place.direction(n)

    def inputs(self, n: int) -> Array:
        """Directions (m, n) of the displacements that the force reads; gaps and corners are places of the first."""
        return self.direction(n)[None]

    def coefficient_values(self, values: Mapping[str, float]) -> Array:
        """The coefficients (nc,) at these values of the parameters."""
        c = self._constant.copy()
        for i, source in self._varying:
            c[i] = source.value(values)
        return c

    def parameter_rates(self, values: Mapping[str, float], rates: Mapping[str, float]) -> Array:
        """First change of the coefficients along parameter changes, shape (nc,)."""
        result = np.zeros(len(self.coefficients))
        for i, source in self._varying:
            for name, rate in rates.items():
                if name in source.names:
                    result[i] += source.derivative(name).value(values) * rate
        return result

    def parameter_curvature(self, values: Mapping[str, float], a: Mapping[str, float], b: Mapping[str, float]) -> Array:
        """Second change of the coefficients along two parameter changes, shape (nc,)."""
        result = np.zeros(len(self.coefficients))
        for i, source in self._varying:
            for first in source.names.intersection(a):
                slope = source.derivative(first)
                for second in slope.names.intersection(b):
                    result[i] += slope.derivative(second).value(values) * a[first] * b[second]
        return result

    def level_rates(self, c: Array) -> list[Array]:
        """Derivatives by the coefficients of the levels at which the law has corners or is sharp: of each level, points
        before velocities, those of all corners that fall together there, (corners, nc).

        What `sampling` says are the levels alone, hence differences of fourth order in steps of 1e-3 of a coefficient,
        shorter ones where the levels do not keep apart, nan where they never do: exact for levels that are polynomials
        of it, to about 1e-12 else. A law that knows its places has them exactly.
        """

        def levels(at: Array) -> Array:
            kind = self.sampling(at)
            return np.array([*getattr(kind, "points", ()), *getattr(kind, "velocities", ())])

        here = levels(c)
        rates = np.full((len(here), len(c)), np.nan)
        for i, value in enumerate(c):
            h = 1e-3 * (abs(float(value)) or 1.0)
            for _ in range(_SHORTENED):
                moved = [levels(shifted(c, i, share * h)) for share in (1.0, -1.0, 2.0, -2.0)]
                if all(len(one) == len(here) for one in moved) and _keep_apart(here, moved):
                    rates[:, i] = (8.0 * (moved[0] - moved[1]) - (moved[2] - moved[3])) / (12.0 * h)
                    break
                h *= 0.1
        return list(rates[:, None])

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Refuse coefficients that make no sense at a system's parameters.

        Called with `first=True` when a system is made, with False when it is given other parameters.
        """

    @abstractmethod
    def sampling(self, c: Array) -> Sampling:
        """How smooth the law is at these coefficients."""

    def batch_form(self, c: Array) -> BatchForm:
        """The law as code for the integration of many trajectories; default: `tangent` is called back."""
        return CalledBack(c, self.sampling(c))


class Element(BaseElement):
    """A nonlinear force along one direction. Subclasses are immutable by convention.

    A subclass sets `coefficient_names` (on the class, or on the object before `Element.__init__`) and, if its force
    depends on velocity, `depends_on_velocity = True`. Below, `u`, `v` are arrays (N,) and `c` is (nc,).
    """

    @abstractmethod
    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array | None]:
        """`(f, f_u, f_v)`, (N,) each; `f_v` is None for a law without velocity."""

    @abstractmethod
    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, Array | None, Array | None]:
        """`(f_uu, f_uv, f_vv)`, (N,) each; the last two are None for a law without velocity."""

    @abstractmethod
    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array | None]:
        """`(f_c, f_uc, f_vc)`, (nc, N) each; `f_vc` is None for a law without velocity."""

    @abstractmethod
    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """`f_cc`, (nc, nc, N)."""

    def batch_form(self, c: Array) -> BatchForm:
        """See `BaseElement.batch_form`; default: the law that `sampling` declares."""
        return super().batch_form(c) if self.depends_on_velocity else form_of_sampling(self.sampling(c), c)

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, Array | None, Array | None, Array | None]:
        """`(f_uuu, f_uuv, f_uvv, f_vvv)`, (N,) each; the last three are None for a law without velocity.

        Unless a subclass knows better: differences of `curvature`, good for about eight digits of smooth laws.
        """
        narrow, slow = widths_of(self.sampling(c))
        f_uuu = central_difference(lambda h: self.curvature(u + h, v, c)[0], step_of(u, narrow))
        if not self.depends_on_velocity:
            return f_uuu, None, None, None
        by_v = central_difference(lambda h: np.array(self.curvature(u, v + h, c)), step_of(v, slow))
        return f_uuu, by_v[0], by_v[1], by_v[2]


class DeclaredElement(Element):
    """An element without velocity whose smoothness class is all of its law (`whole`): that evaluates it."""

    @abstractmethod
    def law_at(self, c: Array) -> WholeLaw:
        """The law at these coefficients."""

    def sampling(self, c: Array) -> Sampling:
        return self.law_at(c)

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        return *self.law_at(c).tangent(u, c), None

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, None, None]:
        """`f_uu`; at corners its regular part."""
        return self.law_at(c).curvature(u, c), None, None

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, None, None, None]:
        """`f_uuu`; at corners its regular part."""
        return self.law_at(c).third(u, c), None, None, None


def _keep_apart(levels: Array, moved: Sequence[Array]) -> bool:
    """Whether levels have moved by less than half their distances, so that none has passed another."""
    if len(levels) < 2:
        return True
    room = 0.5 * np.abs(np.subtract.outer(levels, levels) + np.diag(np.full(len(levels), np.inf))).min()
    return all(float(np.abs(one - levels).max()) < room for one in moved)


def required(owner: str, **given: Any) -> None:
    """Refuse arguments that were left out (they follow the optional `dof`, so Python cannot)."""
    missing = [name for name, value in given.items() if value is None]
    if missing:
        raise InputError(f"{owner} needs {' and '.join(missing)}")


#: how often a step of 1e-3 is made ten times shorter before levels are taken to fall together
_SHORTENED = 6
#: step as a share of the length over which a law changes: truncation (step^4 / 30 times a fifth derivative) and
#: rounding (1e-16 / step, more behind a sharp corner) both stay below 1e-7 there
STEP = 2e-3


def central_difference(law: Callable[[float], Any], step: float) -> Any:
    """The derivative at 0 of a function of a shift."""
    return (8.0 * (law(step) - law(-step)) - (law(2.0 * step) - law(-2.0 * step))) / (12.0 * step)


def step_of(at: Any, widths: Sequence[float] = ()) -> float:
    """The step for an argument `at` of a law that changes over its largest size, or over a smaller width."""
    return STEP * min(float(np.max(np.abs(at), initial=0.0)) or 1.0, *widths, np.inf)


def shifted(at: Any, i: Any, by: float) -> Any:
    """A copy of an array with one of its entries, or rows, moved."""
    moved = at.copy()
    moved[i] += by
    return moved


def shift_derivative(law: Callable[[Any], Any], at: Any, i: Any, step: float) -> Any:
    """The derivative of a function of an array by one of its entries, or along one of its rows."""
    return central_difference(lambda h: law(shifted(at, i, h)), step)
