"""The force of all elements that act along one direction, on a motion: one displacement, one set of spectra.

Piecewise-linear laws and polynomials are packed for one compiled call (`evaluation`); sharp laws share one set of
graded nodes, other laws one uniform grid, so that the motion is evaluated once however many elements there are.
`local_force` has the same for a single element, and the derivatives that only located bifurcations need.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import InputError
from suboctave.harmonic import group_kernels, kernels
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.closed_bends import ClosedBends
from suboctave.harmonic.local_force import Curvature
from suboctave.harmonic.quadrature import (
    FEWEST,
    Nodes,
    even,
    graded_motion,
    on_circle,
    singularities,
    uniform_nodes,
)
from suboctave.lazy import lazy
from suboctave.model.element import Element
from suboctave.model.sampling import (
    PiecewiseLinear,
    PolynomialSampling,
    Sampling,
    SharpSampling,
    told_levels,
)

_NONE = np.zeros(0)
_NO_ROWS = np.zeros((0, 3))


@dataclass(frozen=True)
class Group:
    """Elements that act along the same direction: they share displacement, projection and Galerkin matrix."""

    direction: Array
    dofs: np.ndarray
    values: Array
    members: tuple[int, ...]


@dataclass(eq=False)
class GroupLaw:
    """What a group's elements tell of their laws at given coefficients, sorted by how it is integrated.

    pieces
        Stiffness, gap, side of all piecewise-linear pieces, (P, 3).
    polynomial
        Coefficients of u^0, u^1, ... of all polynomials in u, added up.
    sharp, uniform
        Elements (index, coefficients) that are sampled on graded and on uniform nodes.
    points, widths
        Where the sharp ones are singular.
    smooth_steps
        Gap, width, stiffness of all arctan steps that are told, (S, 3); `line` their constant and slope.
    told
        The elements (index, coefficients) that these belong to.
    degree
        Highest degree of polynomials that need samples.
    all
        All elements: index, what it tells, coefficients.
    """

    pieces: Array
    polynomial: Array
    sharp: tuple[tuple[int, Array], ...]
    uniform: tuple[tuple[int, Array], ...]
    points: Array
    widths: Array
    smooth_steps: Array
    line: Array
    told: tuple[tuple[int, Array], ...]
    degree: int
    all: tuple[tuple[int, Sampling, Array], ...] = ()

    @lazy
    def levels(self) -> tuple[tuple[int, int, float], ...]:
        """Displacements at which a law has a corner, or is sharp: element, which of its own, displacement."""
        return tuple((i, place, at) for i, kind, c in self.all for place, at in enumerate(told_levels(kind, c)))

    @property
    def in_closed_form(self) -> bool:
        """Whether no law needs to be asked at nodes."""
        return not (self.sharp or self.uniform)

    @lazy
    def told_places(self) -> tuple[Array, Array]:
        """Gaps and widths of the arctan steps, (S,) each."""
        return self.smooth_steps[:, 0].copy(), self.smooth_steps[:, 1].copy()

    @classmethod
    def of(cls, group: Group, numbers: list[Array], kinds: list[Sampling]) -> GroupLaw:
        """Sort the laws of a group's members."""
        pieces: list[tuple[float, float, float]] = []
        polynomials: list[tuple[float, ...]] = []
        sharp, uniform, told = [], [], []
        steps: list[tuple[float, float, float]] = []
        line = [0.0, 0.0]
        points: list[Array] = []
        widths: list[Array] = []
        degree = 0
        for i in group.members:
            kind, c = kinds[i], numbers[i]
            if isinstance(kind, PiecewiseLinear):
                own = c.tolist()
                pieces += [(own[p.stiffness], own[p.gap], float(p.side)) for p in kind.pieces]
            elif isinstance(kind, PolynomialSampling) and kind.coefficients is not None:
                polynomials.append(kind.coefficients)
            elif isinstance(kind, SharpSampling) and kind.steps is not None:
                told.append((i, c))
                steps += zip(kind.points, kind.widths, kind.steps, strict=True)
                line[0] += kind.constant
                line[1] += kind.slope
            elif isinstance(kind, SharpSampling):
                sharp.append((i, c))
                where = singularities(kind)
                points.append(where[0])
                widths.append(where[1])
            else:
                uniform.append((i, c))
                if isinstance(kind, PolynomialSampling):
                    degree = max(degree, kind.degree)
        total = _NONE
        if polynomials:
            total = np.array(polynomials[0] if len(polynomials) == 1 else _added(polynomials), dtype=float)
        return cls(
            np.array(pieces, dtype=float) if pieces else _NO_ROWS,
            total,
            tuple(sharp),
            tuple(uniform),
            np.concatenate(points) if points else _NONE,
            np.concatenate(widths) if widths else _NONE,
            np.array(steps, dtype=float) if steps else _NO_ROWS,
            np.array(line),
            tuple(told),
            degree,
            tuple([(i, kinds[i], numbers[i]) for i in group.members]),
        )


def _added(polynomials: list[tuple[float, ...]]) -> list[float]:
    """The sum of polynomials, by their coefficients."""
    return [sum(parts) for parts in zip_longest(*polynomials, fillvalue=0.0)]


@lru_cache(maxsize=64)
def _zeros(count: int) -> NDArray[np.int64]:
    return np.zeros(count, dtype=np.int64)


@lru_cache(maxsize=64)
def _ends(count: int) -> NDArray[np.int64]:
    return np.array((0, count))


class PackedLaws(NamedTuple):
    """The laws of all directions that are known in closed form, as arrays.

    pieces, owner, first
        Stiffness, gap, side of the pieces of piecewise-linear laws (P, 3), direction by direction; the direction of
        each, (P,); where each direction's begin, (G + 1,).
    polynomial
        Coefficients of u^0, u^1, ... along every direction (G, D).
    steps, step_owner, line
        Gap, width, stiffness of arctan steps (S, 3) and their directions (S,); constant and slope of the laws that they
        belong to, (G, 2).
    step_first, places
        Where each direction's steps begin, (G + 1,); gaps and widths of the steps, (S,) each.
    sampled
        Whether any direction has laws that need nodes of their own, arctan steps among them.
    told
        Whether arctan steps are all of these.
    """

    pieces: Array
    owner: NDArray[np.int64]
    first: NDArray[np.int64]
    polynomial: Array
    steps: Array
    step_owner: NDArray[np.int64]
    line: Array
    step_first: NDArray[np.int64]
    places: tuple[Array, Array]
    sampled: bool
    told: bool

    @classmethod
    def of(cls, laws: list[GroupLaw]) -> PackedLaws:
        """Pack the laws of all directions."""
        if len(laws) == 1:
            # what follows, without the joining
            law = laws[0]
            return cls(
                law.pieces,
                _zeros(len(law.pieces)),
                _ends(len(law.pieces)),
                law.polynomial[None],
                law.smooth_steps,
                _zeros(len(law.smooth_steps)),
                law.line[None],
                _ends(len(law.smooth_steps)),
                law.told_places,
                bool(law.told or law.sharp or law.uniform),
                bool(law.told) and law.in_closed_form and len(law.smooth_steps) > 0,
            )
        number = np.arange(len(laws))
        polynomial = np.zeros((len(laws), max((len(law.polynomial) for law in laws), default=0)))
        for g, law in enumerate(laws):
            polynomial[g, : len(law.polynomial)] = law.polynomial
        counts = [len(law.pieces) for law in laws]
        steps = np.concatenate([np.zeros((0, 3))] + [law.smooth_steps for law in laws])
        return cls(
            np.concatenate([np.zeros((0, 3))] + [law.pieces for law in laws]),
            np.repeat(number, counts),
            np.cumsum([0, *counts]),
            polynomial,
            steps,
            np.repeat(number, [len(law.smooth_steps) for law in laws]),
            np.array([law.line for law in laws]).reshape(-1, 2),
            np.cumsum([0] + [len(law.smooth_steps) for law in laws]),
            (steps[:, 0].copy(), steps[:, 1].copy()),
            any(law.told or law.sharp or law.uniform for law in laws),
            _only_told(laws),
        )

    def nodes(self, high: int, top: int) -> Array:
        """Points on the circle for the polynomials, enough for their tangents: cosines and sines, (2, N)."""
        degree = self.polynomial.shape[1] - 1
        return on_circle(even(degree * high + top + 1)) if degree >= 0 else on_circle(0)


def _only_told(laws: list[GroupLaw]) -> bool:
    known = all(law.in_closed_form and (len(law.smooth_steps) > 0 or not law.told) for law in laws)
    return known and any(law.told for law in laws)


def add_sampled_spectra(
    law: GroupLaw,
    elements: tuple[Element, ...],
    samples: tuple[int | None, ...],
    motion: ComplexArray,
    rate: float,
    out: tuple[ComplexArray, ComplexArray, ComplexArray],
) -> None:
    """Add the Fourier coefficients of force, stiffness and damping, (top + 1,) each, of a group's laws that need nodes
    of their own to `out`; pieces and polynomials are `evaluation.evaluate`'s.

    Parameters
    ----------
    elements, samples
        The system's, with their frozen sample counts.
    motion, rate
        Complex coefficients of the relative displacement (H + 1,), base frequency.
    """
    top, high = out[0].shape[0] - 1, motion.shape[0] - 1
    if law.told:
        sampled = graded_motion(motion, *law.told_places, top, moving=False)
        group_kernels.add_smooth_steps(sampled, law.smooth_steps, law.line, out[0], out[1])
    if law.sharp:
        zr, zi, w, u, v = graded_motion(motion, law.points, law.widths, top)
        _add_sampled(law.sharp, elements, u, rate * v, Nodes(zr, zi, w), out)
    if law.uniform:
        nodes = uniform_nodes(uniform_count(law, samples, high, top))
        u, v = kernels.motion(motion, nodes.zr, nodes.zi)
        _add_sampled(law.uniform, elements, u, rate * v, nodes, out)


def _add_sampled(
    members: tuple[tuple[int, Array], ...],
    elements: tuple[Element, ...],
    u: Array,
    v: Array,
    nodes: Nodes,
    out: tuple[ComplexArray, ComplexArray, ComplexArray],
) -> None:
    """`u`, `v`: displacement and velocity at the nodes."""
    rows: list[Array | None] = [None, None, None]
    for i, c in members:
        parts = elements[i].tangent(u, v, c)
        for r, part in enumerate(parts):
            if part is not None:
                sofar = rows[r]
                rows[r] = part if sofar is None else sofar + part
        if parts[2] is not None and not elements[i].depends_on_velocity:
            raise InputError(
                f"{elements[i].label} returns f_v, a derivative by velocity: its class must say "
                "depends_on_velocity = True"
            )
    f, f_u, f_v = (_NONE if row is None else np.ascontiguousarray(row, dtype=float) for row in rows)
    if f.shape != u.shape or f_u.shape != u.shape or f_v.shape not in (u.shape, (0,)):
        labels = ", ".join(elements[i].label for i, _ in members)
        raise InputError(f"{labels}: tangent must return arrays of the shape of u")
    group_kernels.add_projected(f, f_u, f_v, nodes.weights, nodes.zr, nodes.zi, *out)


def curvature_of(
    law: GroupLaw,
    closed: list[ClosedBends],
    elements: tuple[Element, ...],
    samples: tuple[int | None, ...],
    motion: ComplexArray,
    rate: float,
    top: int,
) -> Curvature:
    """Second derivatives of a group's force, as weights at instants: see `local_force.Curvature`.

    `closed`: those of its laws that are known in closed form.
    """
    high = motion.shape[0] - 1
    parts = [Curvature(part.zr, part.zi, part.second, None, None) for part in closed]
    for members, points, widths in (
        (law.sharp, law.points, law.widths),
        (law.uniform, None, None),
    ):
        if not members:
            continue
        if points is None or widths is None:
            nodes = uniform_nodes(uniform_count(law, samples, high, top))
            u, v = kernels.motion(motion, nodes.zr, nodes.zi)
        else:
            zr, zi, w, u, v = graded_motion(motion, points, widths, top)
            nodes = Nodes(zr, zi, w)
        rows: list[Array | None] = [None, None, None]
        for i, c in members:
            for r, part in enumerate(elements[i].curvature(u, rate * v, c)):
                if part is not None:
                    weighted, sofar = nodes.weights * part, rows[r]
                    rows[r] = weighted if sofar is None else sofar + weighted
        assert rows[0] is not None
        parts.append(Curvature(nodes.zr, nodes.zi, rows[0], rows[1], rows[2]))
    if len(parts) == 1:
        return parts[0]
    moving = any(part.uv is not None for part in parts)

    def joined(arrays: list[Array | None]) -> Array:
        filled = [np.zeros_like(part.zr) if a is None else a for a, part in zip(arrays, parts, strict=True)]
        return np.concatenate(filled) if filled else np.zeros(0)

    return Curvature(
        joined([p.zr for p in parts]),
        joined([p.zi for p in parts]),
        joined([p.uu for p in parts]),
        joined([p.uv for p in parts]) if moving else None,
        joined([p.vv for p in parts]) if moving else None,
    )


def uniform_count(law: GroupLaw, samples: tuple[int | None, ...], high: int, top: int) -> int:
    """Samples of the laws that share a uniform grid."""
    count = max(samples[i] or FEWEST for i, _ in law.uniform)
    return max(count, even(law.degree * high + top + 1)) if law.degree else count


__all__ = ["Group", "GroupLaw", "PackedLaws", "add_sampled_spectra", "curvature_of"]
