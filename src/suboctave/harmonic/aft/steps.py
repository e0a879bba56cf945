"""Contact rounded by arctan steps of the stiffness, known in closed form at nodes.

    f = constant + slope u + sum_i s_i / pi [y_i atan(y_i / w_i) - w_i / 2 ln(1 + (y_i / w_i)^2)],    y_i = u - p_i

Of a step with rates p', w', s' of place, width and size,

    f' = s' f / s - s / pi (p' atan(y / w) + w' / 2 ln(1 + (y / w)^2))
    f_u' = s' f_u / s - s / pi (p' w + w' y) / (w^2 + y^2).

The inverse tangent is arithmetic, which compilers turn into vector instructions where the library's is called number by
number: beyond tan(pi/8) the argument is taken to `(|x| - 1) / (|x| + 1)`, beyond tan(3 pi/8) to `-1 / |x|`, and

    atan t = t + t^3 p(t^2),    |t| <= tan(pi/8),

p the polynomial of degree 10 that agrees at the Chebyshev nodes, with an error of 5e-18 relative to t.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.aft.law import Along, Member, Second, Third
from suboctave.harmonic.aft.sampled import Sampled
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import graded
from suboctave.harmonic.trigonometric import FAST, motion, spectra
from suboctave.lazy import lazy
from suboctave.model.elements.base import Element
from suboctave.model.elements.smoothness import SharpSampling

__all__ = ["ArctanSteps", "add_step", "arctangent"]


_LOW, _HIGH = math.sqrt(2.0) - 1.0, math.sqrt(2.0) + 1.0
_P0, _P1, _P2, _P3 = -0.3333333333333333, 0.1999999999999552, -0.14285714284666542, 0.11111111015256361
_P4, _P5, _P6, _P7 = -0.09090904578123903, 0.07692183190826087, -0.06664511447381948, 0.0585814891280221
_P8, _P9, _P10 = -0.0508544973794026, 0.03923165829558719, -0.01917688711906226


class ArctanSteps(Sampled):
    """All arctan steps along one direction: place, width, size, (S, 3), and constant and slope of their laws."""

    def __init__(self, along: Along, members: tuple[Member, ...], steps: Array, line: Array) -> None:
        super().__init__(along, members)
        self.steps, self.line = steps, line

    def reaching(self, along: Along, members: tuple[Member, ...]) -> ArctanSteps:
        """See `LawAlong.reaching`."""
        return ArctanSteps(along, members, self.steps, self.line)

    @lazy
    def _nodes(self) -> Array:
        """Cosines, sines, weights and displacement at the nodes, (4, N)."""
        places, widths = self.steps[:, 0].copy(), self.steps[:, 1].copy()
        return graded(self.along.motion, places, widths, self.along.top)

    def _path(self) -> tuple[Array, Array, Array, Array, Array]:
        zr, zi, w, u = self._nodes
        return zr, zi, w, u, motion(self.along.motion, zr, zi)[1]

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        zr, zi, w, u = self._nodes
        out[:2] += spectra(stepped(u, self.steps, self.line), w, zr, zi, self.along.top)

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        zr, zi, w, u = self._nodes
        weights = np.zeros_like(u)
        for place, width, size in self.steps.tolist():
            ratio = (u - place) / width
            weights += size / (math.pi * width) / (1.0 + ratio * ratio)
        return [Second(zr, zi, self.along.in_displacement(w * weights, 2))]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        zr, zi, w, u = self._nodes
        weights = np.zeros_like(u)
        for place, width, size in self.steps.tolist():
            ratio = (u - place) / width
            share = 1.0 / (1.0 + ratio * ratio)
            weights -= 2.0 * size / (math.pi * width**2) * ratio * share * share
        return [Third(zr, zi, self.along.in_displacement(w * weights, 3), None)]

    def add_change(self, rates: dict[int, Array], out: ComplexArray) -> None:
        """See `LawAlong.add_change`."""
        rows: list[tuple[float, ...]] = []
        line = np.zeros(2)
        others: dict[int, Array] = {}
        for member in self.members:
            if member.number not in rates:
                continue
            kind, rate = member.kind, rates[member.number]
            assert isinstance(kind, SharpSampling)
            assert isinstance(member.element, Element)
            by = member.element.smoothness_change(member.coefficients, rate)
            if by is None or by.steps is None:
                others[member.number] = rate
                continue
            rows += zip(kind.points, kind.widths, kind.steps or (), by.points, by.widths, by.steps, strict=True)
            line += by.constant, by.slope
        if rows:
            zr, zi, w, u = self._nodes
            out[:2] += spectra(changed_steps(u, np.array(rows), line), w, zr, zi, self.along.top)
        if others:
            super().add_change(others, out)


# without the check for a division by zero, which would be a branch
@kernel(error_model="numpy")
def arctangent(x):
    """The inverse tangent, to within two units in the last place."""
    a = abs(x)
    high = a > _HIGH
    low = a <= _LOW
    over = a if low else (-1.0 if high else a - 1.0)
    under = 1.0 if low else (a if high else a + 1.0)
    base = 0.0 if low else (0.5 * math.pi if high else 0.25 * math.pi)
    t = over / under
    z = t * t
    p = _P10
    p = p * z + _P9
    p = p * z + _P8
    p = p * z + _P7
    p = p * z + _P6
    p = p * z + _P5
    p = p * z + _P4
    p = p * z + _P3
    p = p * z + _P2
    p = p * z + _P1
    p = p * z + _P0
    return math.copysign(base + (t + t * z * p), x)


@kernel(fastmath=FAST)
def add_step(u, point, width, factor, force, stiffness):
    """Add `factor (y atan(y / width) - width / 2 log(1 + (y / width)^2))`, y = u - point, and its derivative by u to
    force and stiffness (N,), in place.
    """
    sharpness = 1.0 / width
    for j in range(u.shape[0]):
        y = u[j] - point
        angle = arctangent(y * sharpness)
        force[j] += factor * y * angle
        stiffness[j] += factor * angle
    # a loop of its own: the logarithm is called number by number. What it loses below 1e-16 is nothing beside a width
    for j in range(u.shape[0]):
        ratio = (u[j] - point) * sharpness
        force[j] -= 0.5 * factor * width * math.log(1.0 + ratio * ratio)


def stepped(u: Array, steps: Array, line: Array) -> Array:
    """Force and stiffness (2, N) of arctan steps (place, width, size), (S, 3), with `line` their constant and slope."""
    out = np.empty((2, len(u)))
    out[0], out[1] = line[0] + line[1] * u, line[1]
    for place, width, size in steps.tolist():
        add_step(u, place, width, size / math.pi, out[0], out[1])
    return out


def changed_steps(u: Array, steps: Array, line: Array) -> Array:
    """Changes of force and stiffness (2, N) of arctan steps with the rates of their numbers, (S, 6); `line`: rates of
    constant and slope.
    """
    out = stepped(u, steps[:0, :3], line)
    for place, width, size, by_place, by_width, by_size in steps.tolist():
        if by_size != 0.0:
            add_step(u, place, width, by_size / math.pi, out[0], out[1])
        if by_place != 0.0 or by_width != 0.0:
            ratio, factor = (u - place) / width, size / math.pi
            out[0] -= factor * (by_place * np.arctan(ratio) + 0.5 * by_width * np.log1p(ratio * ratio))
            out[1] -= factor / width * (by_place + by_width * ratio) / (1.0 + ratio * ratio)
    return out
