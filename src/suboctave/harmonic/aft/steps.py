"""Contact rounded by arctan steps of the stiffness, known in closed form at nodes.

    f = constant + slope u + sum_i s_i / pi [y_i atan(y_i / w_i) - w_i / 2 ln(1 + (y_i / w_i)^2)],    y_i = u - p_i

Of a step with rates p', w', s' of place, width and size,

    f' = s' f / s - s / pi (p' atan(y / w) + w' / 2 ln(1 + (y / w)^2))
    f_u' = s' f_u / s - s / pi (p' w + w' y) / (w^2 + y^2).
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.harmonic.aft.closed_form import add_law, add_step
from suboctave.harmonic.aft.law import Along, Member, Second, Third
from suboctave.harmonic.aft.sampled import Sampled
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import graded_nodes
from suboctave.harmonic.trigonometric import motion, spectra
from suboctave.lazy import lazy
from suboctave.model.elements.base import Element
from suboctave.model.elements.smoothness import SharpSampling

__all__ = ["ArctanSteps"]


class ArctanSteps(Sampled):
    """All arctan steps along one direction: place, width, size, (S, 3), and constant and slope of their laws."""

    in_closed_form = True

    def __init__(self, along: Along, members: tuple[Member, ...], steps: Array, line: Array) -> None:
        super().__init__(along, members)
        self.steps, self.line = steps, line

    def reaching(self, along: Along, members: tuple[Member, ...]) -> ArctanSteps:
        """See `LawAlong.reaching`."""
        return ArctanSteps(along, members, self.steps, self.line)

    def _path(self) -> tuple[Array, Array, Array, Array, Array]:
        places, widths = self.steps[:, 0].copy(), self.steps[:, 1].copy()
        nodes = graded_nodes(self.along.motion, places, widths, self.along.top)
        u, slope = motion(self.along.motion, nodes.zr, nodes.zi)
        return nodes.zr, nodes.zi, nodes.weights, u, slope

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        add_law(self.along, out, steps=self.steps, line=self.line)

    @lazy
    def _bell(self) -> tuple[Array, Array, Array]:
        """`y / w` and `1 / (1 + (y / w)^2)` of every step at the nodes, (S, N), and `s / (pi w)`, (S,)."""
        place, width, size = self.steps.T
        ratio = (self.path[3] - place[:, None]) / width[:, None]
        return ratio, 1.0 / (1.0 + ratio * ratio), size / (math.pi * width)

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        zr, zi, w, _, _ = self.path
        _, share, factors = self._bell
        return [Second(zr, zi, self.along.in_displacement(w * (factors @ share), 2))]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        zr, zi, w, _, _ = self.path
        ratio, share, factors = self._bell
        weights = (factors / self.steps[:, 1]) @ (-2.0 * ratio * share * share)
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
            zr, zi, w, u, _ = self.path
            out[:2] += spectra(changed_steps(u, np.array(rows), line), w, zr, zi, self.along.top)
        if others:
            super().add_change(others, out)


def changed_steps(u: Array, steps: Array, line: Array) -> Array:
    """Changes of force and stiffness (2, N) of arctan steps with the rates of their numbers, (S, 6); `line`: rates of
    constant and slope.
    """
    out = np.empty((2, len(u)))
    out[0], out[1] = line[0] + line[1] * u, line[1]
    for place, width, size, by_place, by_width, by_size in steps.tolist():
        if by_size != 0.0:
            add_step(u, place, width, by_size / math.pi, out[0], out[1])
        if by_place != 0.0 or by_width != 0.0:
            ratio, factor = (u - place) / width, size / math.pi
            out[0] -= factor * (by_place * np.arctan(ratio) + 0.5 * by_width * np.log1p(ratio * ratio))
            out[1] -= factor / width * (by_place + by_width * ratio) / (1.0 + ratio * ratio)
    return out
