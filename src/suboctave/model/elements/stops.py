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

import math
from abc import abstractmethod
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, suggest
from suboctave.model.elements.base import Array, DeclaredElement, Dof, required
from suboctave.model.elements.smoothness import Piece, PiecewiseLinear, SharpSampling
from suboctave.model.expressions.coefficients import Coefficient, Number, named_coefficient

if TYPE_CHECKING:
    from suboctave.model.expressions.law import Law

_SIDES = {"right": 1, "left": -1}
#: sharpness, and sharpness times gap, beyond which the squares of rounded laws leave the range of floats
_SHARPEST = 1e100


# ------------------------------------------------------------------------------------------------------ laws of a stop
def _text(side: int, gap: str, regularised: bool) -> str:
    """The law of one stop as a text, for its derivatives by the coefficients."""
    if not regularised:
        return f"stiffness*max(x - {gap}, 0)" if side > 0 else f"-stiffness*max({gap} - x, 0)"

    def phi(y: str) -> str:
        sharp = f"regularization*({y})"
        return f"(({y})*(1/2 + atan({sharp})/pi) - log(1 + ({sharp})**2)/(2*pi*regularization))"

    change = f"{phi(f'x - {gap}')} - {phi(f'-{gap}')}"
    law = f"{change} + max(-{gap}, 0)" if side > 0 else f"x - ({change}) - max({gap}, 0)"
    return f"stiffness*({law})"


@lru_cache(maxsize=256)
def _arctan_steps(sides: tuple[int, ...], c: tuple[float, ...]) -> SharpSampling:
    """All stops with the coefficients c: stiffness, gaps, sharpness."""
    k, *gaps, s = c
    constant = 0.0
    for side, b in zip(sides, gaps, strict=True):
        rounded = math.log1p((s * b) ** 2) / (2.0 * math.pi * s) - b * math.atan(s * b) / math.pi
        constant += side * k * (max(-side * b, 0.0) + rounded)
    steps = tuple(k * side for side in sides)
    return SharpSampling(tuple(gaps), (1.0 / s,) * len(gaps), constant, 0.5 * k * len(gaps), steps)


# ---------------------------------------------------------------------------------------------------------- elements
class _Stops(DeclaredElement):
    """Stops of one stiffness: its coefficients are that, a gap for every stop and, of a regularised law, the sharpness.

    `sides` (1 right, -1 left) are those of the stops.
    """

    sides: tuple[int, ...]
    glyph = "stop"

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
            return _arctan_steps(self.sides, tuple(c.tolist()))
        return self._pieces

    @cached_property
    def _pieces(self) -> PiecewiseLinear:
        return PiecewiseLinear(tuple(Piece(0, gap, side) for gap, side in enumerate(self.sides, start=1)))

    @cached_property
    def _law(self) -> Law:
        """The law as a text."""
        from suboctave.model.expressions.law import law_of

        stops = zip(self.sides, self.coefficient_names[1:], strict=False)
        text = " + ".join(_text(side, gap, self.regularised) for side, gap in stops)
        return law_of(text, ("x",), False, type(self).__name__, self.coefficient_names)

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        """See `Element.coefficient_tangent`; for the exact law the regular parts."""
        f_c, f_qc = self._law.coefficient_tangent(u[None], np.zeros_like(u), c)
        return f_c, f_qc[:, 0], None

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """See `Element.coefficient_curvature`; for the exact law the regular part."""
        return self._law.coefficient_curvature(u[None], np.zeros_like(u), c)


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
