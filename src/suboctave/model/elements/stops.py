"""Springs behind gaps: elastic stops, one-sided, and joints with play, a stop on either side of it; exact or rounded.

Exact law of a right stop: `f = k (u - b)` for `u > b`, else 0; of a left stop: the same for `u < b`.

Regularised (arctan) law with sharpness `s` (unit 1 / length), after Alcorta et al. 2019, Eq. (42), each stop with its
own constant, so that its force at `u = 0` is that of the exact law. With `y = u - b` and

    phi(y) = y/2 + y atan(s y)/pi - ln(1 + s^2 y^2)/(2 pi s)

    right:  f = k [phi(y) + r]        left:  f = k [u - phi(y) + r]        r = side [max(-side b, 0) - phi(-b)]

(the left law is the mirror image of the right one): an arctan step `side k` of width 1/s at b, the slope k/2 and the
constant `k (r - side b / 2)`. At `b = 0` r has a corner as a function of `b`; its derivative is taken from the side
where the stop is open at rest.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, suggest
from suboctave.model.elements.base import Array, Dof, Element, required
from suboctave.model.elements.smoothness import Piece, PiecewiseLinear, SharpSampling
from suboctave.model.expressions.coefficients import Coefficient, named_coefficient

Number = float | str | Coefficient
_SIDES = {"right": 1, "left": -1}
#: sharpness, and sharpness times gap, beyond which the squares of rounded laws leave the range of floats
_SHARPEST = 1e100


# ------------------------------------------------------------------------------------------------------ laws of a stop
@dataclass(frozen=True)
class _Exact:
    """The exact law of one stop, `k (u - b)` while it touches; derivatives are their regular parts."""

    side: int
    k: float
    b: float

    def _contact(self, u: Array) -> Array:
        return (self.side * (u - self.b) > 0.0).astype(float)

    def tangent(self, u: Array) -> tuple[Array, Array]:
        """`f, f_u`."""
        slope = self.k * self._contact(u)
        return slope * (u - self.b), slope

    def curvature(self, u: Array) -> Array:
        """`f_uu`."""
        return np.zeros_like(u)

    third = curvature

    def rates(self, u: Array) -> tuple[Array, Array]:
        """`f_c, f_uc` by stiffness and gap, (2, N)."""
        contact = self._contact(u)
        return np.array([contact * (u - self.b), -self.k * contact]), np.array([contact, np.zeros_like(u)])

    def bends(self, u: Array) -> Array:
        """`f_cc`, (2, 2, N)."""
        zero, mixed = np.zeros_like(u), -self._contact(u)
        return np.array([[zero, mixed], [mixed, zero]])


@dataclass(frozen=True)
class _Rounded:
    """The regularised law of one stop, with the derivatives of `_Exact`; those of coefficients by the sharpness too."""

    side: int
    k: float
    b: float
    s: float

    def tangent(self, u: Array) -> tuple[Array, Array]:
        force, slope = self._unit(u)
        return self.k * force, self.k * slope

    def _unit(self, u: Array) -> tuple[Array, Array]:
        """Force and slope per unit of stiffness."""
        y = u - self.b
        phi_y = _phi_y(y, self.s)
        phi = _phi(y, self.s, phi_y)
        if self.side > 0:
            return phi + self.rest, phi_y
        return u - phi + self.rest, 1.0 - phi_y

    def curvature(self, u: Array) -> Array:
        return self.side * self.k * _phi_yy(u - self.b, self.s)

    def third(self, u: Array) -> Array:
        y, s = u - self.b, self.s
        return -self.side * self.k * 2.0 * s**3 * y / (np.pi * (1.0 + (s * y) ** 2) ** 2)

    def rates(self, u: Array) -> tuple[Array, Array]:
        y, s, size = u - self.b, self.s, self.side * self.k
        f_k, f_uk = self._unit(u)
        f_b = self.k * (self.rest_by_gap - self.side * _phi_y(y, s))
        f_s = self.k * (self.rest_by_sharpness + self.side * _phi_s(y, s))
        return np.array([f_k, f_b, f_s]), np.array([f_uk, -size * _phi_yy(y, s), size * _phi_ys(y, s)])

    def bends(self, u: Array) -> Array:
        y, b, s, size = u - self.b, self.b, self.s, self.side * self.k
        f_kb = self.rest_by_gap - self.side * _phi_y(y, s)
        f_ks = self.rest_by_sharpness + self.side * _phi_s(y, s)
        f_bb = size * (_phi_yy(y, s) - _phi_yy(-b, s))
        f_bs = size * (_phi_ys(-b, s) - _phi_ys(y, s))
        f_ss = size * (_phi_ss(y, s) - _phi_ss(-b, s))
        return np.array([[np.zeros_like(u), f_kb, f_ks], [f_kb, f_bb, f_bs], [f_ks, f_bs, f_ss]])

    @cached_property
    def rest(self) -> float:
        """r: what makes the force at `u = 0` that of the exact law."""
        at_zero = _phi(-self.b, self.s, _phi_y(-self.b, self.s))
        return float(self.side * max(-self.side * self.b, 0.0) - self.side * at_zero)

    @property
    def rest_by_gap(self) -> float:
        """Its derivative by the gap; at `b = 0` from the side where the stop is open at rest."""
        preloaded = 1.0 if self.side * self.b < 0.0 else 0.0
        return float(self.side * _phi_y(-self.b, self.s) - preloaded)

    @property
    def rest_by_sharpness(self) -> float:
        """Its derivative by the sharpness."""
        return float(-self.side * _phi_s(self.b, self.s))

    def constant(self, k: float, b: float, s: float) -> float:
        """Change of the constant in `SharpSampling` with these changes of the coefficients."""
        side = self.side
        whole = k * (self.rest - 0.5 * side * self.b) + self.k * b * (self.rest_by_gap - 0.5 * side)
        return whole + self.k * s * self.rest_by_sharpness


def _phi(y: Any, s: float, phi_y: Any) -> Any:
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


@lru_cache(maxsize=256)
def _laws_of(
    sides: tuple[int, ...], regularised: bool, c: tuple[float, ...]
) -> tuple[tuple[list[int], _Exact | _Rounded], ...]:
    """Of stops with the coefficients c, the stiffness first: which of these are the own of each, and its law."""
    last, kind = ([len(c) - 1], _Rounded) if regularised else ([], _Exact)
    own = [([0, gap, *last], side) for gap, side in enumerate(sides, start=1)]
    return tuple((index, kind(side, *(c[i] for i in index))) for index, side in own)


def _sharp(rows: list[tuple[int, float, float, float, float]]) -> SharpSampling:
    """Arctan steps of the side, the stiffness, the place, the width and the constant of each."""
    sides, stiffness, places, widths, constants = zip(*rows, strict=True)
    steps = tuple(side * k for side, k in zip(sides, stiffness, strict=True))
    return SharpSampling(places, widths, sum(constants), sum(0.5 * k for k in stiffness), steps)


# ---------------------------------------------------------------------------------------------------------- elements
class _Stops(Element):
    """Stops of one stiffness: its coefficients are that, a gap for every stop and, of a regularised law, the sharpness.

    `sides` (1 right, -1 left) are those of the stops.
    """

    sides: tuple[int, ...]

    def __init__(
        self, dof: Dof | None, stiffness: Any, gaps: Mapping[str, Any], regularization: Any, direction: ArrayLike | None
    ) -> None:
        self.regularised = regularization is not None
        sharpness = {"regularization": regularization} if self.regularised else {}
        coefficients = {"stiffness": stiffness, **gaps, **sharpness}
        self.coefficient_names = tuple(coefficients)
        super().__init__(dof, list(coefficients.values()), direction=direction)
        if self.regularised and self.coefficients[-1].constant:
            self._check_sharpness(self.coefficients[-1].value({}), 0.0)

    def check(self, values: Mapping[str, float], first: bool) -> None:
        """Refuse a negative stiffness, gaps that make no sense, and a sharpness that is not positive."""
        stiffness, *gaps = (source.value(values) for source in self.coefficients)
        if stiffness < 0.0:
            raise InputError(
                f"{self.label}: the stiffness is {stiffness:g}; what touches pushes back, with a positive stiffness. A "
                "spring that gets softer beyond a gap is Expression(dof, '-k*max(x - gap, 0)')"
            )
        sharpness = gaps.pop() if self.regularised else None
        self._check_gaps(gaps, first)
        if sharpness is not None:
            self._check_sharpness(sharpness, max(gaps, key=abs))

    @abstractmethod
    def _check_gaps(self, gaps: list[float], first: bool) -> None:
        """Refuse gaps that make no sense."""

    def _check_sharpness(self, s: float, gap: float) -> None:
        if s <= 0.0:
            raise InputError(
                f"{self.label}: regularization must be positive (1 / length, larger is sharper), not {s:g}"
            )
        if not 1.0 / _SHARPEST <= s <= _SHARPEST / max(1.0, abs(gap)):
            raise InputError(
                f"{self.label}: regularization={s:g} with a gap of {gap:g} is beyond what numbers resolve (1e-100 to "
                "1e100): leave it out for the exact law, or choose units in which the gap is nearer to 1"
            )

    def _laws(self, c: Array) -> tuple[tuple[list[int], _Exact | _Rounded], ...]:
        """Of every stop: which of the coefficients are its own, and its law."""
        return _laws_of(self.sides, self.regularised, tuple(c.tolist()))

    def sampling(self, c: Array) -> PiecewiseLinear | SharpSampling:
        """Piecewise linear, or sharp at the gaps with width 1/s."""
        if not self.regularised:
            return PiecewiseLinear(tuple(Piece(0, gap, side) for gap, side in enumerate(self.sides, start=1)))
        laws = [law for _, law in self._laws(c) if isinstance(law, _Rounded)]
        return _sharp([(law.side, law.k, law.b, 1.0 / law.s, law.constant(law.k, 0.0, 0.0)) for law in laws])

    def smoothness_change(self, c: Array, rates: Array) -> SharpSampling | None:
        if not self.regularised:
            return None
        moved = [(law, *rates[index].tolist()) for index, law in self._laws(c) if isinstance(law, _Rounded)]
        return _sharp([(law.side, k, b, -s / law.s**2, law.constant(k, b, s)) for law, k, b, s in moved])

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        forces, slopes = zip(*(law.tangent(u) for _, law in self._laws(c)), strict=True)
        return sum(forces[1:], forces[0]), sum(slopes[1:], slopes[0]), None

    def curvature(self, u: Array, v: Array, c: Array) -> tuple[Array, None, None]:
        """`f_uu`; for the exact law its regular part, which is zero."""
        return np.sum([law.curvature(u) for _, law in self._laws(c)], axis=0), None, None

    def third(self, u: Array, v: Array, c: Array) -> tuple[Array, None, None, None]:
        """`f_uuu`; for the exact law its regular part, which is zero."""
        return np.sum([law.third(u) for _, law in self._laws(c)], axis=0), None, None, None

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        """See `Element.coefficient_tangent`; for the exact law the regular parts."""
        f_c, f_uc = np.zeros((2, len(c), len(u)))
        for index, law in self._laws(c):
            force, slope = law.rates(u)
            f_c[index] += force
            f_uc[index] += slope
        return f_c, f_uc, None

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """See `Element.coefficient_curvature`; for the exact law the regular part."""
        f_cc = np.zeros((len(c), len(c), len(u)))
        for index, law in self._laws(c):
            f_cc[np.ix_(index, index)] += law.bends(u)
        return f_cc


class ElasticStop(_Stops):
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
        stiffness: Number | None = None,
        gap: Number | None = None,
        side: str | None = None,
        regularization: Number | None = None,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        if side is not None and side not in _SIDES:
            raise InputError(f'ElasticStop: side is "left" or "right", not {side!r}{suggest(str(side), _SIDES)}')
        super().__init__(dof, stiffness, {"gap": gap}, regularization, direction)
        self._side_given = side is not None or not isinstance(gap, str | Coefficient)
        if side is None:
            negative = self._side_given and self.coefficients[1].value({}) < 0.0
            side = "left" if negative else "right"
        self.side, self.sides = side, (_SIDES[side],)

    @property
    def label(self) -> str:
        return f"ElasticStop({self.place}, gap={self.coefficients[1].text})"

    def _check_gaps(self, gaps: list[float], first: bool) -> None:
        """Refuse, first, an ambiguous side."""
        stiffness, gap = self.coefficients[:2]
        if first and not self._side_given and gaps[0] < 0.0:
            start = f"ElasticStop({self.place}, stiffness={stiffness.text}, gap={gap.text!r}"
            raise InputError(
                f"{self.label}: the gap is {gaps[0]:g} at the system's parameters and no side is given. "
                f'Write {start}, side="left") for a stop that acts below it, or {start}, side="right") for a '
                f"preloaded stop that acts above it"
            )


class _Play(_Stops):
    """No force within a play, a spring on either side of it; `given` are the widths that say where it ends."""

    sides = (-1, 1)

    def __init__(
        self,
        dof: Dof | None,
        stiffness: Any,
        left: str,
        right: str,
        regularization: Any,
        direction: ArrayLike | None,
        given: dict[str, Coefficient],
    ) -> None:
        super().__init__(dof, stiffness, {"left": left, "right": right}, regularization, direction)
        what, width = next(iter(given.items()))
        if width.constant and width.value({}) < 0.0:
            raise InputError(f"{self.label}: {what} must not be negative, not {width.value({}):g}")

    def _check_gaps(self, gaps: list[float], first: bool) -> None:
        """Refuse sides that have changed places."""
        left, right = gaps
        if left > right:
            raise InputError(f"{self.label}: the play is negative ({right - left:g}) at the system's parameters")


class Freeplay(_Play):
    """No force while `-gap < u < gap`, a spring of this stiffness beyond: `stiffness * (|u| - gap) sign(u)`.

    Play about the place where the linear structure is at rest, as in control surfaces. `gap` is half of the whole play
    and must not be negative. Exact by default; `regularization=s` (1 / length) as in `ElasticStop`. Units: force /
    length, length.
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
        read = named_coefficient(gap, "Freeplay", "gap")
        super().__init__(dof, stiffness, f"-({read.text})", read.text, regularization, direction, {"gap": read})


class Clearance(_Play):
    """A joint with play of the whole width `clearance` about `offset`, and a spring of this stiffness on either side.

    The force is `stiffness * (u - offset -+ clearance / 2)` beyond the two ends. `clearance` must not be negative: of a
    pin in its bore, the diametral clearance. With `offset = clearance / 2` the joint is at rest where it begins to
    touch on the left. Exact by default; `regularization=s` (1 / length) as in `ElasticStop`. Units: force / length,
    length.
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
        width = named_coefficient(clearance, "Clearance", "clearance")
        centre = named_coefficient(offset, "Clearance", "offset")
        left, right = (f"({centre.text}) {sign} ({width.text})/2" for sign in "-+")
        given = {"clearance": width, "offset": centre}
        super().__init__(dof, stiffness, left, right, regularization, direction, given)
