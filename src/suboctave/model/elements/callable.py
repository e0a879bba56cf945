"""Forces given as Python functions: `Callable(0, lambda x, v, k: k * np.sinh(x), {"k": "k0"})`."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable as Function, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, shortened
from suboctave.interruption import at_once, stopping, users_function
from suboctave.model.elements.base import Array, Dof, Element, central_difference, required, shift_derivative, step_of
from suboctave.model.elements.smoothness import AdaptiveSampling
from suboctave.model.expressions.coefficients import Number

#: step of complex differences
_COMPLEX = 1e-30
#: displacements and velocities at which a function is tried
_DRAWS = np.sin(1.3 * np.arange(1, 10)), np.cos(2.1 * np.arange(1, 10))
#: by which factors that step is shortened until two differences agree, which they do not while a corner lies between
_SHORTER = (1.0, 0.1, 0.01)
#: scales of the motions at which given derivatives are checked: what is sharp about zero is seen at the small ones
_SCALES = (1.0, 0.1, 0.01, 0.001)
#: how far derivatives may be from differences, relative to the largest force and slope
_GIVEN = 1e-5
#: held while the filters of warnings are changed, which are those of the process
_filtering = threading.RLock()


class Callable(Element):
    """A force given as a Python function `f(x, v, *coefficients)` of arrays (N,), at `dof` or along `direction`.

    `coefficients` are handed over after displacement and velocity, in their order: `{name: number or expression}`.
    `derivatives` may give `(f_x, f_v)` as a function of the same arguments; they are held against differences where
    these settle, which they do not across a corner (`x |x|`). Otherwise they are taken by complex steps, exact to
    rounding, if the function is found to bear them, else by differences of fourth order (`accuracy` tells, relative to
    the force's own scale: 1e-15 or about 1e-10). Second derivatives are differences of the first, good for about nine
    (six) digits: enough for Newton's method at bifurcations, not for normal forms of high order.

    The function must be smooth or at least continuous, depend on its arguments alone, and return real arrays of the
    shape of x. It is called often; a law that can be written as text is faster as `Expression`.
    """

    depends_on_velocity = True

    def __init__(
        self,
        dof: Dof | None = None,
        function: Any = None,
        coefficients: Mapping[str, Number] | None = None,
        derivatives: Function[..., tuple[Any, Any]] | None = None,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        required("Callable", function=function)
        for what, given in (("function", function), ("derivatives", derivatives)):
            if given is not None and not callable(given):
                raise InputError(f"Callable: {what} must be a function of arrays, not {shortened(given)}")
        self.coefficient_names = tuple(coefficients or {})
        super().__init__(dof, list((coefficients or {}).values()), direction=direction)
        self.function: Function[..., Any] = function
        self.derivatives = derivatives
        self._complex = derivatives is None and self._bears_complex()

    @property
    def label(self) -> str:
        return f"Callable({self.place}, {getattr(self.function, '__name__', 'function')})"

    @property
    def accuracy(self) -> float:
        """Relative accuracy of the first derivatives."""
        return 1e-15 if self._complex or self.derivatives is not None else 1e-10

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Refuse a function that fails, or does not return finite numbers, or derivatives that are not its own."""
        if first:
            with at_once():
                self._check(values)

    def _check(self, values: Mapping[str, float]) -> None:
        u, v = _DRAWS
        c = self.coefficient_values(values)
        f = self._value(u, v, c)
        if not np.all(np.isfinite(f)):
            raise InputError(f"{self.label}: the force is not finite for displacements and velocities between -1 and 1")
        if self.derivatives is None:
            return
        u, v = (np.outer(_SCALES, state).ravel() for state in _DRAWS)
        given = self._given(u, v, c)
        for name, slope in zip("xv", given, strict=True):
            if not np.all(np.isfinite(slope)):
                raise InputError(f"{self.label}: f_{name} from derivatives= is not finite between -1 and 1")
        for i, k, settled in self._disagreements(given, u, v, c):
            raise InputError(
                f"{self.label}: f_{'xv'[i]} from derivatives= is not the derivative of the force: at x = {u[k]:.4g}, "
                f"v = {v[k]:.4g} it gives {given[i][k]:.6g}, differences give {settled:.6g}"
            )

    def _disagreements(
        self, slopes: tuple[Array, Array], u: Array, v: Array, c: Array
    ) -> Iterator[tuple[int, int, float]]:
        """Where differences settle, not across a corner, at another slope: of which argument, place, their slope."""
        f = self._value(u, v, c)
        finer = np.array([self._differences(u, v, c, factor) for factor in _SHORTER])
        apart = np.abs(np.diff(finer, axis=0))
        best = np.argmin(apart, axis=0)[None]
        settled, doubt = (np.take_along_axis(x, best, axis=0)[0] for x in (finer[1:], apart))
        sizes = np.maximum(np.nanmax(np.abs(f)), np.nanmax(np.abs(slopes), axis=1, keepdims=True))
        for i, k in np.argwhere(np.abs(slopes - settled) > _GIVEN * sizes + doubt):
            yield int(i), int(k), float(settled[i, k])

    def _bears_complex(self) -> bool:
        """Whether complex arguments give what differences give, and the same real part."""
        u, v = _DRAWS
        c = np.where(np.isnan(self._constant), 0.7, self._constant)
        try:
            with _filtering, np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("error", np.exceptions.ComplexWarning)
                real = np.asarray(self.function(u, v, *c))
                stepped = self._stepped(u, v, c)
                if any(f.shape != u.shape or not np.allclose(f.real, real, 1e-12, 0.0, True) for f in stepped):
                    return False
                # a function that drops imaginary parts has slopes of zero
                slopes = stepped[0].imag / _COMPLEX, stepped[1].imag / _COMPLEX
                return next(self._disagreements(slopes, u, v, c), None) is None
        except Exception:  # the user's function may raise anything on complex numbers
            return False

    def _stepped(self, u: Array, v: Array, c: Array) -> list[np.ndarray]:
        """The force at complex steps of displacement and of velocity."""
        places = (u + 1j * _COMPLEX, v), (u, v + 1j * _COMPLEX)
        return [np.asarray(self.function(*place, *c)) for place in places]

    def _value(self, u: Array, v: Array, c: Array) -> Array:
        with users_function(f"{self.label}: the function"):
            f = np.asarray(self.function(u, v, *c))
            if f.dtype.kind not in "biufc":
                raise TypeError(f"it returned {shortened(f.tolist())}, no numbers")
        if np.iscomplexobj(f) or f.shape != u.shape:
            if f.shape == () and not np.iscomplexobj(f):
                return np.full(u.shape, float(f))
            what = f"{self.label}: the function must return real arrays of shape {u.shape}, not {f.dtype} {f.shape}"
            raise stopping(what)
        return f.astype(float)

    def _given(self, u: Array, v: Array, c: Array) -> tuple[Array, Array]:
        assert self.derivatives is not None
        try:
            f_u, f_v = self.derivatives(u, v, *c)
            return np.broadcast_to(np.asarray(f_u, float), u.shape), np.broadcast_to(np.asarray(f_v, float), u.shape)
        except Exception as error:
            what = f"{self.label}: derivatives= must return (f_x, f_v), two real arrays of shape {u.shape}"
            raise stopping(f"{what}; {type(error).__name__}: {error}", error) from error

    def _slopes(self, u: Array, v: Array, c: Array) -> tuple[Array, Array]:
        """`(f_u, f_v)`."""
        if self.derivatives is not None:
            return self._given(u, v, c)
        if self._complex:
            with users_function(f"{self.label}: the function (of complex numbers)"):
                by_u, by_v = (np.imag(f) / _COMPLEX * np.ones_like(u) for f in self._stepped(u, v, c))
            return by_u, by_v
        return self._differences(u, v, c)

    def _differences(self, u: Array, v: Array, c: Array, factor: float = 1.0) -> tuple[Array, Array]:
        """`(f_u, f_v)` by differences of the force, their steps shortened by a factor."""
        return (
            central_difference(lambda h: self._value(u + h, v, c), factor * step_of(u)),
            central_difference(lambda h: self._value(u, v + h, c), factor * step_of(v)),
        )

    def sampling(self, c: Array) -> AdaptiveSampling:
        """Nothing is known of a function."""
        return AdaptiveSampling()

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        return (self._value(u, v, c), *self._slopes(u, v, c))

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        """See `Element.curvature`; by differences."""
        f_uu = central_difference(lambda h: self._slopes(u + h, v, c)[0], step_of(u))
        f_uv, f_vv = central_difference(lambda h: np.array(self._slopes(u, v + h, c)), step_of(v))
        return f_uu, f_uv, f_vv

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, Array]:
        """See `Element.coefficient_tangent`; by differences."""
        f_c, f_uc, f_vc = self._by_coefficients(lambda c: np.array(self.tangent(u, v, c)), (3, len(u)), c)
        return f_c, f_uc, f_vc

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """See `Element.coefficient_curvature`; by differences."""
        out = self._by_coefficients(lambda c: self.coefficient_tangent(u, v, c)[0], (len(c), len(u)), c)
        return 0.5 * (out + out.transpose(1, 0, 2))

    def _by_coefficients(self, law: Function[[Array], Array], shape: tuple[int, int], c: Array) -> Array:
        """Derivatives (k, nc, N) of what has the `shape` (k, N) for coefficients c (nc,)."""
        by_c = [shift_derivative(law, c, i, step_of(value)) for i, value in enumerate(c)]
        return np.reshape(by_c, (len(c), *shape)).transpose(1, 0, 2)
