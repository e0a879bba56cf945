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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, suggest
from suboctave.model.elements.base import Array, DeclaredElement, Dof, required
from suboctave.model.elements.smoothness import Piece, PiecewiseLinear, SharpSampling
from suboctave.model.expressions.coefficients import Coefficient, named_coefficient

Number = float | str | Coefficient
_SIDES = {"right": 1, "left": -1}
#: sharpness, and sharpness times gap, beyond which the squares of rounded laws leave the range of floats
_SHARPEST = 1e100


# ------------------------------------------------------------------------------------------------------ laws of a stop
class _Phi(NamedTuple):
    """phi and its derivatives by y and by s."""

    value: Any
    y: Any
    yy: Any
    s: Any
    ys: Any
    ss: Any


def _phi(y: Any, s: float) -> _Phi:
    angle, bell, log = np.arctan(s * y) / np.pi, 1.0 / (np.pi * (1.0 + (s * y) ** 2)), np.log1p((s * y) ** 2) / np.pi
    phi_y = 0.5 + angle
    return _Phi(
        y * phi_y - log / (2.0 * s), phi_y, s * bell, log / (2.0 * s**2), y * bell, y**2 * bell / s - log / s**3
    )


@dataclass(frozen=True)
class _Rounded:
    """The regularised law of one stop, per unit of stiffness, and its derivatives by gap and sharpness."""

    side: int
    b: float
    s: float

    @cached_property
    def _at_rest(self) -> _Phi:
        return _phi(-self.b, self.s)

    @cached_property
    def _preload(self) -> float:
        """`-side b` where that is positive, its derivative by the gap."""
        return -1.0 if self.side * self.b < 0.0 else 0.0

    @property
    def constant(self) -> float:
        """Constant in `SharpSampling`."""
        return float(self._preload * self.b - self.side * (self._at_rest.value + 0.5 * self.b))

    def constant_change(self, b: float, s: float) -> float:
        """Its change with these changes of the gap and the sharpness."""
        by_gap = self.side * (self._at_rest.y - 0.5) + self._preload
        return float(by_gap * b - self.side * self._at_rest.s * s)

    def rates(self, u: Array) -> tuple[Array, Array]:
        """`f_c, f_uc`, (2, N)."""
        at, rest, side = _phi(u - self.b, self.s), self._at_rest, self.side
        f_c = np.array([self._preload - side * (at.y - rest.y), side * (at.s - rest.s)])
        return f_c, side * np.array([-at.yy, at.ys])

    def bends(self, u: Array) -> Array:
        """`f_cc`, (2, 2, N)."""
        at, rest = _phi(u - self.b, self.s), self._at_rest
        mixed = rest.ys - at.ys
        return self.side * np.array([[at.yy - rest.yy, mixed], [mixed, at.ss - rest.ss]])


@dataclass(frozen=True)
class _Exact:
    """The exact law of one stop, per unit of stiffness, and the regular parts of its derivatives by the gap."""

    side: int
    b: float

    def rates(self, u: Array) -> tuple[Array, Array]:
        """`f_c, f_uc`, (1, N)."""
        return -(self.side * (u[None] - self.b) > 0.0).astype(float), np.zeros((1, len(u)))

    def bends(self, u: Array) -> Array:
        """`f_cc`, (1, 1, N)."""
        return np.zeros((1, 1, len(u)))


@lru_cache(maxsize=256)
def _rounded(sides: tuple[int, ...], c: tuple[float, ...]) -> tuple[SharpSampling, tuple[_Rounded, ...]]:
    """All stops with the coefficients c: stiffness, gaps, sharpness."""
    k, *gaps, s = c
    laws = tuple(_Rounded(side, gap, s) for side, gap in zip(sides, gaps, strict=True))
    steps = tuple(k * side for side in sides)
    constant = sum(k * law.constant for law in laws)
    whole = SharpSampling(tuple(gaps), (1.0 / s,) * len(gaps), constant, 0.5 * k * len(gaps), steps)
    return whole, laws


# ---------------------------------------------------------------------------------------------------------- elements
class _Stops(DeclaredElement):
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

    def law_at(self, c: Array) -> PiecewiseLinear | SharpSampling:
        """Piecewise linear, or sharp at the gaps with width 1/s."""
        if self.regularised:
            return _rounded(self.sides, tuple(c.tolist()))[0]
        return PiecewiseLinear(tuple(Piece(0, gap, side) for gap, side in enumerate(self.sides, start=1)))

    def smoothness_change(self, c: Array, rates: Array) -> SharpSampling | None:
        if not self.regularised:
            return None
        (k, *gaps, s), (by_k, *by_gaps, by_s) = c.tolist(), rates.tolist()
        laws = _rounded(self.sides, (k, *gaps, s))[1]
        moved = zip(laws, by_gaps, strict=True)
        constant = sum(by_k * law.constant + k * law.constant_change(by_gap, by_s) for law, by_gap in moved)
        widths, steps = (-by_s / s**2,) * len(gaps), tuple(by_k * side for side in self.sides)
        return SharpSampling(tuple(by_gaps), widths, constant, 0.5 * by_k * len(gaps), steps)

    def _laws(self, c: Array) -> list[tuple[list[int], _Rounded | _Exact]]:
        """Of every stop: which of the coefficients besides the stiffness are its own, and its law."""
        if self.regularised:
            return [([i, len(c) - 1], law) for i, law in enumerate(_rounded(self.sides, tuple(c.tolist()))[1], start=1)]
        return [([i], _Exact(side, c[i])) for i, side in enumerate(self.sides, start=1)]

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        """See `Element.coefficient_tangent`; for the exact law the regular parts."""
        f_c, f_uc = np.zeros((2, len(c), len(u)))
        f_c[0], f_uc[0], _ = self.tangent(u, v, np.array([1.0, *c[1:]]))
        for own, law in self._laws(c):
            force, slope = law.rates(u)
            f_c[own] += c[0] * force
            f_uc[own] += c[0] * slope
        return f_c, f_uc, None

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """See `Element.coefficient_curvature`; for the exact law the regular part."""
        f_cc = np.zeros((len(c), len(c), len(u)))
        for own, law in self._laws(c):
            by_own, _ = law.rates(u)
            f_cc[0, own] += by_own
            f_cc[own, 0] += by_own
            f_cc[np.ix_(own, own)] += c[0] * law.bends(u)
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
    """No force within a play, a spring on either side of it."""

    sides = (-1, 1)

    def _check_width(self, what: str, width: Coefficient) -> None:
        """Refuse a negative width that says where the play ends."""
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
        ends = {"left": f"-({read.text})", "right": read.text}
        super().__init__(dof, stiffness, ends, regularization, direction)
        self._check_width("gap", read)


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
        ends = {name: f"({centre.text}) {sign} ({width.text})/2" for name, sign in (("left", "-"), ("right", "+"))}
        super().__init__(dof, stiffness, ends, regularization, direction)
        self._check_width("clearance", width)
