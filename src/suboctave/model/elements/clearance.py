"""Joints with play: no force within a gap, a spring on either side of it.

    f = k (u - right) for u > right,    k (u - left) for u < left,    0 between

- `Freeplay`: play of `+- gap` about the place where the linear structure is at rest, as in control surfaces.
- `Clearance`: the whole width of the play (a pin in its bore: the diametral clearance), centred at an offset (the pin
  that rests against one side).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError
from suboctave.model.elements.base import Array, Dof, Element, required
from suboctave.model.elements.smoothness import Piece, PiecewiseLinear, RoundedPiece, SharpSampling
from suboctave.model.elements.stops import ElasticStop, check_sharpness, check_stiffness
from suboctave.model.expressions.coefficients import Coefficient, coefficient

__all__ = ["Clearance", "Freeplay"]

Number = float | str | Coefficient


class _Play(Element):
    """Two stops of one stiffness: coefficients stiffness, left, right, and the sharpness of a regularised law."""

    coefficient_names: tuple[str, ...] = ("stiffness", "left", "right")
    _given: dict[str, Coefficient]

    def __init__(
        self,
        dof: Dof | None,
        stiffness: Any,
        left: Any,
        right: Any,
        regularization: Any,
        direction: ArrayLike | None,
    ) -> None:
        coefficients = [stiffness, left, right]
        self.regularised = regularization is not None
        if self.regularised:
            self.coefficient_names = ("stiffness", "left", "right", "regularization")
            coefficients.append(regularization)
        super().__init__(dof, coefficients, direction=direction)
        sharp = 1.0 if self.regularised else None
        # the two stops answer for the laws; their own coefficients stay unused
        self._stops = tuple(
            (ElasticStop(0, 1.0, 0.0, side=side, regularization=sharp), self._of(gap))
            for side, gap in (("left", 1), ("right", 2))
        )

        self._rounded = (RoundedPiece(0, 1, 3, -1), RoundedPiece(0, 2, 3, 1))

    def _of(self, gap: int) -> list[int]:
        """Which of the coefficients are those of one stop."""
        return [0, gap, 3] if self.regularised else [0, gap]

    def __repr__(self) -> str:
        shown = [str(self.place), f"stiffness={self.coefficients[0].text}"]
        shown += [f"{name}={read.text}" for name, read in self._given.items()]
        if self.regularised:
            shown.append(f"regularization={self.coefficients[3].text}")
        return f"{type(self).__name__}({', '.join(shown)})"

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Refuse a negative stiffness, sides that have changed places, and a sharpness that is not positive."""
        check_stiffness(self, values)
        left, right = (source.value(values) for source in self.coefficients[1:3])
        if left > right:
            raise InputError(f"{self.label}: the play is negative ({right - left:g}) at the system's parameters")
        if self.regularised:
            check_sharpness(self.label, self.coefficients[3].value(values), max(abs(left), abs(right)))

    def sampling(self, c: Array) -> PiecewiseLinear | SharpSampling:
        """Piecewise linear, or sharp at both ends of the play."""
        if not self.regularised:
            return PiecewiseLinear((Piece(0, 1, -1), Piece(0, 2, 1)))
        told = _together([stop.sampling(c[index]) for stop, index in self._stops])
        return replace(told, rounded=self._rounded)

    def smoothness_change(self, c: Array, rates: Array) -> SharpSampling | None:
        """See `Element.smoothness_change`."""
        if not self.regularised:
            return None
        return _together([stop.smoothness_change(c[index], rates[index]) for stop, index in self._stops])

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        """See `Element.tangent`."""
        (f, f_u, _), (g, g_u, _) = (stop.tangent(u, v, c[index]) for stop, index in self._stops)
        return f + g, f_u + g_u, None

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, None, None]:
        """`f_uu`; for the exact law its regular part, which is zero."""
        one, other = (stop.curvature(u, v, c[index])[0] for stop, index in self._stops)
        return one + other, None, None

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, None, None, None]:
        """`f_uuu`; for the exact law its regular part, which is zero."""
        one, other = (stop.third(u, v, c[index])[0] for stop, index in self._stops)
        return one + other, None, None, None

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        """See `Element.coefficient_tangent`; for the exact law the regular parts."""
        f_c, f_uc = np.zeros((2, len(c), len(u)))
        for stop, index in self._stops:
            one, other, _ = stop.coefficient_tangent(u, v, c[index])
            f_c[index] += one
            f_uc[index] += other
        return f_c, f_uc, None

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """See `Element.coefficient_curvature`; for the exact law the regular part."""
        f_cc = np.zeros((len(c), len(c), len(u)))
        for stop, index in self._stops:
            f_cc[np.ix_(index, index)] += stop.coefficient_curvature(u, v, c[index])
        return f_cc


def _together(both: list[PiecewiseLinear | SharpSampling] | list[SharpSampling | None]) -> SharpSampling:
    """What a left and a right stop tell, as one law."""
    left, right = (told for told in both if isinstance(told, SharpSampling))
    return SharpSampling(
        left.points + right.points,
        left.widths + right.widths,
        left.constant + right.constant,
        left.slope + right.slope,
        (left.steps or ()) + (right.steps or ()),
    )


class Freeplay(_Play):
    """No force while `-gap < u < gap`, a spring of this stiffness beyond: `stiffness * (|u| - gap) sign(u)`.

    `gap` is half of the whole play and must not be negative. Exact by default; `regularization=s` (1 / length) as in
    `ElasticStop`. Units: force / length, length.
    """

    def __init__(
        self,
        dof: Dof | None = None,
        stiffness: Number | None = None,
        gap: Number | None = None,
        regularization: Number | None = None,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        required("Freeplay", stiffness=stiffness, gap=gap)
        read = _read("Freeplay", "gap", gap)
        self._given = {"gap": read}
        super().__init__(dof, stiffness, f"-({read.text})", read, regularization, direction)
        _not_negative(self.label, "gap", read)


class Clearance(_Play):
    """A joint with play of the whole width `clearance` about `offset`, and a spring of this stiffness on either side.

    The force is `stiffness * (u - offset -+ clearance / 2)` beyond the two ends. `clearance` must not be negative. With
    `offset = clearance / 2` the joint is at rest where it begins to touch on the left. Exact by default;
    `regularization=s` (1 / length) as in `ElasticStop`. Units: force / length, length.
    """

    def __init__(
        self,
        dof: Dof | None = None,
        stiffness: Number | None = None,
        clearance: Number | None = None,
        offset: Number = 0.0,
        regularization: Number | None = None,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        required("Clearance", stiffness=stiffness, clearance=clearance)
        width, centre = _read("Clearance", "clearance", clearance), _read("Clearance", "offset", offset)
        self._given = {"clearance": width, "offset": centre}
        left, right = (f"({centre.text}) {sign} ({width.text})/2" for sign in "-+")
        super().__init__(dof, stiffness, left, right, regularization, direction)
        _not_negative(self.label, "clearance", width)


def _read(kind: str, what: str, source: Any) -> Coefficient:
    try:
        return coefficient(source)
    except InputError as error:
        raise InputError(f"{kind}, {what}: {error}", (what,)) from None


def _not_negative(label: str, what: str, read: Coefficient) -> None:
    if read.constant and read.value({}) < 0.0:
        raise InputError(f"{label}: {what} must not be negative, not {read.value({}):g}")
