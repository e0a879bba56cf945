"""The contract of forces that depend on several displacements and velocities, or on time: `f(q, theta; c)`.

A coupled element acts along its own direction d_out with the force `f`, on the left-hand side of the equation of
motion. It reads the displacements `u_i = d_i . x` along its inputs d_1 .. d_m and, if it depends on velocity, their
rates v_i: together `q = (u_1, .., u_m, v_1, .., v_m)`. Time enters as the phase of the load, `theta = omega t`, and
periodically: `f(q, theta + 2 pi) = f(q, theta)`. That is parametric excitation: stiffness that varies in time.
"""

from __future__ import annotations

import functools
from abc import abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError
from suboctave.model.elements.base import Array, BaseElement, Dof, Element, Place, numbers_of, required
from suboctave.model.elements.batch_form import BatchForm
from suboctave.model.elements.smoothness import Sampling, Surface
from suboctave.model.elements.written import WrittenElement
from suboctave.model.expressions.coefficients import Number
from suboctave.model.expressions.reader import RESERVED

if TYPE_CHECKING:
    from suboctave.model.expressions.law import Law


class CoupledElement(BaseElement):
    """A nonlinear force along one direction that depends on several displacements and velocities, or on time.

    `inputs`: one entry per displacement that the force reads: a DOF, a pair `(i, j)` for `x_i - x_j`, or a vector (with
    decimal points or as an array: two whole numbers are a pair). A subclass provides the laws below as pure functions
    of q (Q, N), theta (N,) and c (nc,); Q is m, or 2 m for a law that `depends_on_velocity`. `time_harmonic` is the
    highest multiple of the load's frequency in a law that `depends_on_time`.
    """

    own_nodes = True
    time_harmonic: int = 0

    def __init__(
        self,
        dof: Dof | None = None,
        inputs: Sequence[Dof | ArrayLike] = (),
        coefficients: Sequence[Number | None] = (),
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        super().__init__(dof, coefficients, direction=direction)
        if not len(inputs):
            raise InputError(f"{self.label} needs inputs: the displacements that its force depends on")
        self.count = len(inputs)
        self.input_places = tuple(_input_place(self.label, given) for given in inputs)

    def inputs(self, n: int) -> Array:
        return np.array([place.direction(n) for place in self.input_places])

    @abstractmethod
    def tangent(self, q: Array, theta: Array, c: Array) -> tuple[Array, Array]:
        """`(f, f_q)`, shapes (N,), (Q, N)."""

    @abstractmethod
    def curvature(self, q: Array, theta: Array, c: Array) -> Array:
        """`f_qq`, (Q, Q, N)."""

    @abstractmethod
    def third(self, q: Array, theta: Array, c: Array) -> Array:
        """`f_qqq`, (Q, Q, Q, N)."""

    @abstractmethod
    def coefficient_tangent(self, q: Array, theta: Array, c: Array) -> tuple[Array, Array]:
        """`(f_c, f_qc)`, shapes (nc, N), (nc, Q, N)."""

    @abstractmethod
    def coefficient_curvature(self, q: Array, theta: Array, c: Array) -> Array:
        """`f_cc`, (nc, nc, N)."""

    def surface(self, which: int, q: Array, theta: Array, c: Array) -> Surface:
        """The function number `which` at whose zeros the law has corners, for a law whose `sampling` tells of some."""
        raise _without_surfaces(self)

    def surface_slopes(self, which: int, q: Array, theta: Array, c: Array) -> tuple[Array, Array, Array]:
        """`phi`, `phi_q`, `phi_theta` of it, (N,), (Q, N), (N,): asked for more often than the others."""
        surface = self.surface(which, q, theta, c)
        return surface.value, surface.normal, surface.by_phase

    def surface_key(self, which: int, c: Array) -> Hashable | None:
        """What the same function of the same inputs of another element has as well; None if that is not known."""
        return None


def _without_surfaces(element: BaseElement) -> InputError:
    return InputError(f"{element.label}: sampling tells of corners at surfaces, so its class must define surface()")


def _input_place(owner: str, given: Any) -> Place:
    is_vector = isinstance(given, np.ndarray) or (
        isinstance(given, Sequence) and any(not isinstance(entry, int | np.integer | str) for entry in given)
    )
    return Place(f"{owner}, inputs", *((None, given) if is_vector else (given, None)))


class _OneInput:
    """An element with one input in the form of a coupled one: q = (u,) or (u, v)."""

    time_harmonic = 0

    def __init__(self, element: Element) -> None:
        self.element = element
        self.count = 1
        self._moving = element.depends_on_velocity

    def _state(self, q: Array) -> tuple[Array, Array]:
        return q[0], q[1] if self._moving else np.zeros_like(q[0])

    def tangent(self, q: Array, theta: Array, c: Array) -> tuple[Array, Array]:
        f, f_u, f_v = self.element.tangent(*self._state(q), c)
        if f_v is not None and not self._moving:
            raise InputError(
                f"{self.element.label} returns f_v, a derivative by velocity: its class must say depends_on_velocity = "
                "True"
            )
        return f, np.array([f_u, np.zeros_like(f_u) if f_v is None else f_v] if self._moving else [f_u])

    def curvature(self, q: Array, theta: Array, c: Array) -> Array:
        f_uu, f_uv, f_vv = _rows(q[0], self.element.curvature(*self._state(q), c))
        return np.array([[f_uu, f_uv], [f_uv, f_vv]]) if self._moving else np.array([[f_uu]])

    def third(self, q: Array, theta: Array, c: Array) -> Array:
        f_uuu, f_uuv, f_uvv, f_vvv = _rows(q[0], self.element.third(*self._state(q), c))
        if not self._moving:
            return np.array([[[f_uuu]]])
        return np.array([[[f_uuu, f_uuv], [f_uuv, f_uvv]], [[f_uuv, f_uvv], [f_uvv, f_vvv]]])

    def coefficient_tangent(self, q: Array, theta: Array, c: Array) -> tuple[Array, Array]:
        f_c, *rest = self.element.coefficient_tangent(*self._state(q), c)
        return f_c, np.stack([np.asarray(part) for part in rest[: 1 + self._moving]], axis=1)

    def coefficient_curvature(self, q: Array, theta: Array, c: Array) -> Array:
        return self.element.coefficient_curvature(*self._state(q), c)

    def surface(self, which: int, q: Array, theta: Array, c: Array) -> Surface:
        raise _without_surfaces(self.element)

    def surface_slopes(self, which: int, q: Array, theta: Array, c: Array) -> tuple[Array, Array, Array]:
        raise _without_surfaces(self.element)

    def surface_key(self, which: int, c: Array) -> Hashable | None:
        return None


def _rows(u: Array, parts: Sequence[Array | None]) -> list[Array]:
    """Derivatives as arrays like u, those that are left out as zeros."""
    return [np.broadcast_to(0.0 if part is None else part, u.shape) for part in parts]


def reads(element: BaseElement, n: int) -> Array:
    """The direction (n,) of the displacement that an element's gaps and corners are places of."""
    return np.asarray(element.inputs(n)[0])


def as_coupled(element: BaseElement) -> CoupledElement | Law | _OneInput:
    """The law of any element in the form of a coupled one, `f(q, theta; c)`."""
    if isinstance(element, CoupledElement):
        return element
    if isinstance(element, WrittenElement) and type(element).tangent is WrittenElement.tangent:
        return element.law
    assert isinstance(element, Element)
    return _OneInput(element)


def _of_law(name: str) -> Any:
    """The method of this name of an expression's law."""

    def method(self: Expression, q: Array, theta: Array, c: Array) -> Any:
        return getattr(self._law, name)(q, theta, c)

    return method


class Expression(CoupledElement):
    """A force given as text, with exact derivatives.

    In the text stand `x` and `x'` (or `v`) for displacement and velocity at `dof` or along `direction`, the system's
    parameters by name, `+ - * / **`, the functions of coefficients, `sign`, `heaviside`, `max` and `min`. Time occurs
    as `cos(k*omega*t + phase)` or `sin`, k an integer: parametric excitation. `inputs` names other displacements for
    forces that depend on several: `Expression(0, "k*x*y**2", inputs={"x": 0, "y": (1, 2)})`; then only those names are
    states, and their velocities are written with a prime.

    Corners (`abs`, `max`, ..) are integrated exactly, at places (`max(x-gap, 0)`), or where a smooth function of the
    states and of time vanishes (`max(sqrt(x**2+y**2)-gap, 0)`), and steps `tanh(v/v0)` and `atan` of one velocity times
    polynomials however steep they are, others by as many samples as it takes. A force that jumps is refused.
    """

    def __init__(
        self,
        dof: Dof | None = None,
        expression: str | None = None,
        inputs: Mapping[str, Dof | ArrayLike] | None = None,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        required("Expression", expression=expression)
        if not isinstance(expression, str):
            raise InputError(f"Expression: the force must be a text such as 'alpha*x**3', not {expression!r}")
        self.expression = expression
        places: dict[str, Any] = {"x": dof if direction is None else numbers_of(direction)}
        if inputs is not None:
            if not isinstance(inputs, Mapping) or not inputs:
                raise InputError("Expression: inputs must be a mapping such as {'x': 0, 'y': 1}")
            places = {str(name): place for name, place in inputs.items()}
        for name in places:
            if not name.isidentifier() or name in RESERVED:
                raise InputError(f"Expression: {name!r} cannot name a displacement")
        self._short = inputs is None
        self.states = tuple(places)
        first = self._law.corner_input
        if first:  # what has the corners comes first
            self.states = (self.states[first], *self.states[:first], *self.states[first + 1 :])
            del self._law
        places = {name: places[name] for name in self.states}
        law = self._law
        self.coefficient_names = law.coefficients
        self.depends_on_velocity = law.depends_on_velocity
        self.depends_on_time = law.time_harmonic > 0
        self.time_harmonic = law.time_harmonic
        super().__init__(dof, list(places.values()), law.coefficients, direction=direction)

    @functools.cached_property
    def _law(self) -> Law:
        """Compiled once per process; `v` is short for x'."""
        from suboctave.model.expressions.law import law_of

        return law_of(self.expression, self.states, self._short, f"Expression({self.expression!r:.60})")

    @property
    def label(self) -> str:
        return f"Expression({self.place}, {self.expression!r:.60})"

    def batch_form(self, c: Array) -> BatchForm:
        return self._law.batch_form

    def sampling(self, c: Array) -> Sampling:
        """What the text shows: a polynomial, corners, steps in a velocity, or nothing."""
        return self._law.sampling(c)

    tangent = _of_law("tangent")
    curvature = _of_law("curvature")
    third = _of_law("third")
    coefficient_tangent = _of_law("coefficient_tangent")
    coefficient_curvature = _of_law("coefficient_curvature")

    def level_rates(self, c: Array) -> list[Array]:
        exact = self._law.level_rates(c)
        return super().level_rates(c) if exact is None else exact

    def surface(self, which: int, q: Array, theta: Array, c: Array) -> Surface:
        return self._law.surface(which, q, theta, c)

    def surface_slopes(self, which: int, q: Array, theta: Array, c: Array) -> tuple[Array, Array, Array]:
        return self._law.surface_slopes(which, q, theta, c)

    def surface_key(self, which: int, c: Array) -> Hashable | None:
        return self._law.surface_key(which, c)
