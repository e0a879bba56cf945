"""Elastic stops: one-sided springs behind a gap, exact or regularised.

Exact law of a right stop: `f = k (u - b)` for `u > b`, else 0; of a left stop: the same for `u < b`.

Regularised (arctan) law with sharpness `s` (unit 1 / length), after Alcorta et al. 2019, Eq. (42), each stop with its
own constant, so that its force at `u = 0` is that of the exact law. With `y = u - b` and

    phi(y) = y/2 + y atan(s y)/pi - ln(1 + s^2 y^2)/(2 pi s)

    right:  f = k [phi(y) - phi(-b) + max(-b, 0)]        left:  f = k [u - phi(y) + phi(-b) + min(-b, 0)]

(the left law is the mirror image of the right one). At `b = 0` the constant has a corner as a function of `b`; its
derivative is taken from the side where the stop is open at rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, suggest
from suboctave.model.elements.base import Array, Dof, Element, required
from suboctave.model.elements.rounding import at_rest, at_rest_by_gap, at_rest_by_sharpness
from suboctave.model.elements.smoothness import Piece, PiecewiseLinear, RoundedPiece, SharpSampling
from suboctave.model.expressions.coefficients import Coefficient

__all__ = ["ElasticStop", "check_sharpness", "check_stiffness"]

_SIDES = {"right": 1, "left": -1}


def check_stiffness(element: Element, values: Mapping[str, float]) -> None:
    """Refuse a stop or a joint, its stiffness the first coefficient, that would pull instead of push."""
    stiffness = element.coefficients[0].value(values)
    if stiffness < 0.0:
        raise InputError(
            f"{element.label}: the stiffness is {stiffness:g}; what touches pushes back, with a positive stiffness. A "
            "spring that gets softer beyond a gap is Expression(dof, '-k*max(x - gap, 0)')"
        )


#: sharpness, and sharpness times gap, beyond which the squares of rounded laws leave the range of floats
_SHARPEST = 1e100


def check_sharpness(label: str, s: float, gap: float = 0.0) -> None:
    """Refuse a regularization that is not positive, or so sharp or so blunt that its law has no numbers."""
    if s <= 0.0:
        raise InputError(f"{label}: regularization must be positive (1 / length, larger is sharper), not {s:g}")
    if not 1.0 / _SHARPEST <= s <= _SHARPEST / max(1.0, abs(gap)):
        raise InputError(
            f"{label}: regularization={s:g} with a gap of {gap:g} is beyond what numbers resolve (1e-100 to 1e100): "
            "leave it out for the exact law, or choose units in which the gap is nearer to 1"
        )


class ElasticStop(Element):
    """A one-sided spring: force `stiffness * (u - gap)` beyond the gap (`side="right"`: u > gap, `"left"`: u < gap).

    With no `side`, a gap given as a negative number is a left stop; any other number, and every expression, a right
    stop. The side is fixed here, so that a gap may move through zero (a preloaded stop). Exact by default;
    `regularization=s` (1 / length) gives the arctan law of Alcorta et al. 2019, Eq. (42). Units: force / length,
    length.
    """

    coefficient_names: tuple[str, ...] = ("stiffness", "gap")

    def __init__(
        self,
        dof: Dof | None = None,
        stiffness: float | str | Coefficient | None = None,
        gap: float | str | Coefficient | None = None,
        side: str | None = None,
        regularization: float | str | Coefficient | None = None,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        required("ElasticStop", stiffness=stiffness, gap=gap)
        if side is not None and side not in _SIDES:
            raise InputError(f'ElasticStop: side is "left" or "right", not {side!r}{suggest(str(side), _SIDES)}')
        coefficients: list[Any] = [stiffness, gap]
        self.regularised = regularization is not None
        if self.regularised:
            self.coefficient_names = ("stiffness", "gap", "regularization")
            coefficients.append(regularization)
        super().__init__(dof, coefficients, direction=direction)
        self._side_given = side is not None or not isinstance(gap, str | Coefficient)
        if side is None:
            negative = self._side_given and self.coefficients[1].value({}) < 0.0
            side = "left" if negative else "right"
        self.side = side
        self._sign = _SIDES[side]
        self._rounded = (RoundedPiece(0, 1, 2, self._sign),)
        if self.regularised and self.coefficients[2].constant:
            check_sharpness(self.label, self.coefficients[2].value({}))

    @property
    def label(self) -> str:
        """How messages name this element."""
        return f"ElasticStop({self.place}, gap={self.coefficients[1].text})"

    def _options(self) -> list[str]:
        return [f"side={self.side!r}"]

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Refuse a negative stiffness, a sharpness that is not positive and, first, an ambiguous side."""
        gap = self.coefficients[1]
        check_stiffness(self, values)
        if first and not self._side_given and gap.value(values) < 0.0:
            start = f"ElasticStop({self.place}, stiffness={self.coefficients[0].text}, gap={gap.text!r}"
            raise InputError(
                f"{self.label}: the gap is {gap.value(values):g} at the system's parameters and no side is given. "
                f'Write {start}, side="left") for a stop that acts below it, or {start}, side="right") for a '
                f"preloaded stop that acts above it"
            )
        if self.regularised:
            check_sharpness(self.label, self.coefficients[2].value(values), gap.value(values))

    def sampling(self, c: Array) -> PiecewiseLinear | SharpSampling:
        """Piecewise linear, or sharp at the gap with width 1/s."""
        if self.regularised:
            k, b, sharpness = c.tolist()
            constant = k * (at_rest(self._sign, b, sharpness) - 0.5 * self._sign * b)
            return SharpSampling((b,), (1.0 / sharpness,), constant, 0.5 * k, (self._sign * k,), self._rounded)
        return PiecewiseLinear((Piece(stiffness=0, gap=1, side=self._sign),))

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        """See `Element.tangent`."""
        if not self.regularised:
            slope = c[0] * self._contact(u, c)
            return slope * (u - c[1]), slope, None
        k, b, s = c.tolist()
        y = u - b
        phi_y = _phi_y(y, s)
        shape = _phi(y, phi_y, s)
        if self._sign < 0:
            shape, phi_y = u - shape, 1.0 - phi_y
        return k * (shape + at_rest(self._sign, b, s)), k * phi_y, None

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, None, None]:
        """`f_uu`; for the exact law its regular part, which is zero."""
        if not self.regularised:
            return np.zeros_like(u), None, None
        return self._sign * c[0] * _phi_yy(u - c[1], c[2]), None, None

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, None, None, None]:
        """`f_uuu`; for the exact law its regular part, which is zero."""
        if not self.regularised:
            return np.zeros_like(u), None, None, None
        y, s = u - c[1], c[2]
        return -self._sign * c[0] * 2.0 * s**3 * y / (np.pi * (1.0 + (s * y) ** 2) ** 2), None, None, None

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        """See `Element.coefficient_tangent`; for the exact law the regular parts."""
        if not self.regularised:
            contact = self._contact(u, c)
            f_c = np.array([contact * (u - c[1]), -c[0] * contact])
            return f_c, np.array([contact, np.zeros_like(u)]), None
        k, b, s = c.tolist()
        sign, y = self._sign, u - b
        phi_y = _phi_y(y, s)
        phi = _phi(y, phi_y, s)
        f_k = (phi if sign > 0 else u - phi) + at_rest(sign, b, s)
        f_uk = phi_y if sign > 0 else 1.0 - phi_y
        f_b = k * (at_rest_by_gap(sign, b, s) - sign * phi_y)
        f_s = k * (at_rest_by_sharpness(sign, b, s) + sign * _phi_s(y, s))
        return np.array([f_k, f_b, f_s]), np.array([f_uk, -k * sign * _phi_yy(y, s), k * sign * _phi_ys(y, s)]), None

    def smoothness_change(self, c: Array, rates: Array) -> SharpSampling | None:
        """See `Element.smoothness_change`."""
        if not self.regularised:
            return None
        sign, (by_stiffness, gap, sharpness), (k, b, s) = self._sign, rates.tolist(), c.tolist()
        constant = 0.0
        if by_stiffness:
            constant += by_stiffness * (at_rest(sign, b, s) - 0.5 * sign * b)
        if gap:
            constant += k * gap * (at_rest_by_gap(sign, b, s) - 0.5 * sign)
        if sharpness:
            constant += k * sharpness * at_rest_by_sharpness(sign, b, s)
        return SharpSampling((gap,), (-sharpness / s**2,), constant, 0.5 * by_stiffness, (sign * by_stiffness,))

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """See `Element.coefficient_curvature`; for the exact law the regular part."""
        f_cc = np.zeros((len(c), len(c), len(u)))
        if not self.regularised:
            f_cc[0, 1] = f_cc[1, 0] = -self._contact(u, c)
            return f_cc
        k, b, s = c
        sign, y = self._sign, u - b
        f_cc[0, 1] = f_cc[1, 0] = self._by_gap(y, b, s)
        f_cc[0, 2] = f_cc[2, 0] = sign * (_phi_s(y, s) - _phi_s(-b, s))
        f_cc[1, 1] = k * sign * (_phi_yy(y, s) - _phi_yy(-b, s))
        f_cc[1, 2] = f_cc[2, 1] = k * sign * (_phi_ys(-b, s) - _phi_ys(y, s))
        f_cc[2, 2] = k * sign * (_phi_ss(y, s) - _phi_ss(-b, s))
        return f_cc

    def _contact(self, u: Array, c: Array) -> Array:
        return (self._sign * (u - c[1]) > 0.0).astype(float)

    def _by_gap(self, y: Array, b: float, s: float) -> Array:
        """Derivative of the force per unit of stiffness with respect to the gap."""
        sign = self._sign
        preloaded = 1.0 if sign * b < 0.0 else 0.0
        return sign * (_phi_y(-b, s) - _phi_y(y, s)) - preloaded


def _phi(y: Any, phi_y: Any, s: float) -> Any:
    """phi, from its derivative."""
    return y * phi_y - np.log1p((s * y) ** 2) / (2.0 * np.pi * s)


def _phi_y(y: Any, s: float) -> Any:
    return 0.5 + np.arctan(s * y) / np.pi


def _phi_yy(y: Any, s: float) -> Any:
    return s / (np.pi * (1.0 + (s * y) ** 2))


def _phi_s(y: Any, s: float) -> Any:
    return np.log1p((s * y) ** 2) / (2.0 * np.pi * s**2)


def _phi_ys(y: Any, s: float) -> Any:
    return y / (np.pi * (1.0 + (s * y) ** 2))


def _phi_ss(y: Any, s: float) -> Any:
    return y**2 / (np.pi * s * (1.0 + (s * y) ** 2)) - np.log1p((s * y) ** 2) / (np.pi * s**3)
