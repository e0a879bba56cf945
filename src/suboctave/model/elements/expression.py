"""Forces written as text: `Expression(0, "alpha*x**3 + beta*x**2*x'")`."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError
from suboctave.model.elements.base import Array, Dof, required
from suboctave.model.elements.batch_form import BatchForm, WrittenForm
from suboctave.model.elements.coupled import CoupledElement
from suboctave.model.elements.smoothness import Sampling
from suboctave.model.expressions.reader import RESERVED

if TYPE_CHECKING:
    from suboctave.model.expressions.law import Law

__all__ = ["Expression"]


class Expression(CoupledElement):
    """A force given as text, with exact derivatives.

    In the text stand `x` and `x'` (or `v`) for displacement and velocity at `dof` or along `direction`, the system's
    parameters by name, `+ - * / **`, the functions of coefficients, `sign`, `heaviside`, `max` and `min`. Time occurs
    as `cos(k*omega*t + phase)` or `sin`, k an integer: parametric excitation. `inputs` names other displacements for
    forces that depend on several: `Expression(0, "k*x*y**2", inputs={"x": 0, "y": (1, 2)})`; then only those names are
    states, and their velocities are written with a prime.

    Corners (`abs`, `max`, ..) at places that do not depend on other states are integrated exactly, others by as many
    samples as it takes. A force that jumps is refused.
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
        places: dict[str, Any] = {"x": dof if direction is None else np.asarray(direction, dtype=float)}
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

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_law"}

    @property
    def label(self) -> str:
        return f"Expression({self.place}, {self.expression!r:.60})"

    def batch_form(self, c: Array) -> BatchForm:
        return WrittenForm(self._law)

    def sampling(self, c: Array) -> Sampling:
        """What the text shows: a polynomial, corners, or nothing."""
        return self._law.sampling(c)

    def tangent(self, q: Array, theta: Array, c: Array) -> tuple[Array, Array]:
        return self._law.tangent(q, theta, c)

    def curvature(self, q: Array, theta: Array, c: Array) -> Array:
        return self._law.curvature(q, theta, c)

    def third(self, q: Array, theta: Array, c: Array) -> Array:
        return self._law.third(q, theta, c)

    def coefficient_tangent(self, q: Array, theta: Array, c: Array) -> tuple[Array, Array]:
        return self._law.coefficient_tangent(q, theta, c)

    def coefficient_curvature(self, q: Array, theta: Array, c: Array) -> Array:
        return self._law.coefficient_curvature(q, theta, c)

    def __repr__(self) -> str:
        read = "" if self._short else f", inputs={dict(zip(self.states, map(str, self.input_places), strict=True))}"
        return f"Expression({self.place}, {self.expression!r}{read})"
