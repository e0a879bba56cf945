"""The laws of all elements that act along one direction, sorted by how they are integrated."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suboctave.harmonic.aft.closed_form import NO_LINE, NO_ROWS, NONE
from suboctave.harmonic.aft.law import Along, LawAlong, Member
from suboctave.harmonic.aft.pieces import Pieces
from suboctave.harmonic.aft.polynomial import Polynomial
from suboctave.harmonic.aft.sampled import GradedLaw, UniformLaw
from suboctave.harmonic.aft.steps import ArctanSteps
from suboctave.harmonic.basis import Array
from suboctave.harmonic.quadrature import FEWEST
from suboctave.lazy import lazy
from suboctave.model.elements.smoothness import (
    AdaptiveSampling,
    PiecewiseLinear,
    PolynomialSampling,
    SharpSampling,
    levels,
)

__all__ = ["DirectionLaws", "PackedLaws"]


@dataclass(eq=False)
class DirectionLaws:
    """Laws of one displacement and its rate at given coefficients.

    pieces, exact
        Stiffness, gap, side of all piecewise-linear pieces, (P, 3); their elements.
    polynomial, polynomials
        Coefficients of u^0, u^1, ... of all polynomials in u, added up; their elements.
    steps, line, stepped
        Place, width, size of all arctan steps, (S, 3); constant and slope of the laws that they belong to; their
        elements.
    graded, points, widths
        Elements that are sampled on graded nodes, and where they are singular.
    uniform
        Elements that are sampled on uniform nodes.
    degree
        Highest degree of polynomials that need samples.
    members
        All elements.
    """

    pieces: Array = field(default_factory=lambda: NO_ROWS)
    polynomial: Array = field(default_factory=lambda: NONE)
    steps: Array = field(default_factory=lambda: NO_ROWS)
    line: Array = field(default_factory=lambda: NO_LINE)
    graded: tuple[Member, ...] = ()
    uniform: tuple[Member, ...] = ()
    exact: tuple[Member, ...] = ()
    polynomials: tuple[Member, ...] = ()
    stepped: tuple[Member, ...] = ()
    points: Array = field(default_factory=lambda: NONE)
    widths: Array = field(default_factory=lambda: NONE)
    degree: int = 0
    members: tuple[Member, ...] = ()

    @classmethod
    def of(cls, members: tuple[Member, ...]) -> DirectionLaws:
        """Sort the laws of elements."""
        pieces: list[tuple[float, float, float]] = []
        sums: list[tuple[float, ...]] = []
        steps: list[tuple[float, float, float]] = []
        constant = slope = 0.0
        graded, uniform, exact, polynomials, stepped = [], [], [], [], []
        points: list[float] = []
        widths: list[float] = []
        degree = 0
        for member in members:
            kind = member.kind
            if isinstance(kind, PiecewiseLinear):
                exact.append(member)
                own = member.coefficients.tolist()
                pieces += [(own[p.stiffness], own[p.gap], float(p.side)) for p in kind.pieces]
            elif isinstance(kind, PolynomialSampling) and kind.coefficients is not None:
                polynomials.append(member)
                sums.append(kind.coefficients)
            elif isinstance(kind, SharpSampling) and kind.steps is not None:
                stepped.append(member)
                steps += zip(kind.points, kind.widths, kind.steps, strict=True)
                constant += kind.constant
                slope += kind.slope
            elif isinstance(kind, SharpSampling):
                graded.append(member)
                points += kind.points
                widths += kind.widths
            else:
                uniform.append(member)
                if isinstance(kind, PolynomialSampling):
                    degree = max(degree, kind.degree)
        total = [sum(parts) for parts in zip_longest(*sums, fillvalue=0.0)]
        return cls(
            np.array(pieces, dtype=float) if pieces else NO_ROWS,
            np.array(total, dtype=float) if total else NONE,
            np.array(steps, dtype=float) if steps else NO_ROWS,
            np.array((constant, slope)),
            tuple(graded),
            tuple(uniform),
            tuple(exact),
            tuple(polynomials),
            tuple(stepped),
            np.array(points, dtype=float) if points else NONE,
            np.array(widths, dtype=float) if widths else NONE,
            degree,
            members,
        )

    @lazy
    def levels(self) -> tuple[tuple[int, int, float], ...]:
        """Displacements at which a law has a corner, or is sharp: element, which of its own, displacement."""
        return tuple(
            (m.number, place, at) for m in self.members for place, at in enumerate(levels(m.kind, m.coefficients))
        )

    @property
    def tangent_degree(self) -> int:
        """Degree of the tangent as a polynomial in the motion, or what counts as such between singularities."""
        sampled = max(1, self.degree - 1) if self.uniform else 0
        return max(len(self.polynomial) - 2, 1 if self.graded or len(self.steps) else 0, sampled)

    @property
    def singularities(self) -> list[tuple[Array, Array]]:
        """Where laws of displacement are sharp: places and widths."""
        steps = self.steps[:, 0].copy(), self.steps[:, 1].copy()
        return [pair for pair in ((self.points, self.widths), steps) if len(pair[0])]

    @property
    def unknown_samples(self) -> int:
        """Nodes on a period that laws of unknown smoothness want, 0 without any."""
        return max([m.samples or FEWEST for m in self.uniform if isinstance(m.kind, AdaptiveSampling)], default=0)

    @property
    def in_closed_form(self) -> bool:
        """Whether no law needs to be asked at nodes."""
        return not (self.graded or self.uniform)

    def along(self, along: Along) -> list[LawAlong]:
        """These laws along a motion, one object per way of integration."""
        laws: list[LawAlong] = []
        if len(self.pieces):
            laws.append(Pieces(along, self.exact, self.pieces))
        if len(self.polynomial):
            laws.append(Polynomial(along, self.polynomials, self.polynomial))
        if len(self.steps):
            laws.append(ArctanSteps(along, self.stepped, self.steps, self.line))
        if self.graded:
            laws.append(GradedLaw(along, self.graded, self.points, self.widths))
        if self.uniform:
            laws.append(UniformLaw(along, self.uniform, self.degree))
        return laws


class PackedLaws(NamedTuple):
    """The laws of several directions that are known in closed form, as arrays.

    pieces, owner, first
        Stiffness, gap, side of pieces (P, 3), direction by direction, the direction of each, (P,), and where each
        direction's begin, (G + 1,).
    polynomial
        Coefficients of u^0, u^1, ... along every direction (G, D).
    steps, step_owner, step_first, line
        Place, width, size of arctan steps (S, 3), likewise; constant and slope of the laws that they belong to, (G, 2).
    closed_form
        Whether that is all of them.
    singularities
        Direction, places and widths of where laws are sharp.
    degree, unknown_samples
        The largest `tangent_degree` and `unknown_samples` of the directions.
    """

    pieces: Array
    owner: NDArray[np.int64]
    first: NDArray[np.int64]
    polynomial: Array
    steps: Array
    step_owner: NDArray[np.int64]
    step_first: NDArray[np.int64]
    line: Array
    closed_form: bool
    singularities: list[tuple[int, Array, Array]]
    degree: int
    unknown_samples: int

    @classmethod
    def of(cls, laws: list[DirectionLaws]) -> PackedLaws:
        """Pack the laws of all directions."""
        number = np.arange(len(laws))
        polynomial = np.zeros((len(laws), max((len(law.polynomial) for law in laws), default=0)))
        for g, law in enumerate(laws):
            polynomial[g, : len(law.polynomial)] = law.polynomial
        counts = [len(law.pieces) for law in laws]
        step_counts = [len(law.steps) for law in laws]
        return cls(
            np.concatenate([NO_ROWS] + [law.pieces for law in laws]),
            np.repeat(number, counts),
            np.cumsum([0, *counts]),
            polynomial,
            np.concatenate([NO_ROWS] + [law.steps for law in laws]),
            np.repeat(number, step_counts),
            np.cumsum([0, *step_counts]),
            np.array([law.line for law in laws]).reshape(-1, 2),
            all(law.in_closed_form for law in laws),
            [(g, *pair) for g, law in enumerate(laws) for pair in law.singularities],
            max([law.tangent_degree for law in laws], default=0),
            max([law.unknown_samples for law in laws], default=0),
        )

    @property
    def known(self) -> tuple[NDArray[Any], ...]:
        """What is known in closed form, as `closed_form.add_spectra` wants it."""
        return self.pieces, self.first, self.polynomial, self.steps, self.step_first, self.line
