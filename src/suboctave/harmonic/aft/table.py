"""The laws of the elements along several directions, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise, zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suboctave.harmonic.aft.closed_form import NO_ROWS, ClosedLaws, corner_weights, smooth_weights
from suboctave.harmonic.aft.law import Member
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import FEWEST, Nodes, graded_nodes, polynomial_nodes, rule_tables, search_grid
from suboctave.model.elements.smoothness import (
    AdaptiveSampling,
    PiecewiseLinear,
    PolynomialSampling,
    SharpSampling,
)

__all__ = ["PackedLaws", "Probe"]

_NO_TERMS = np.zeros(0)


class Probe(NamedTuple):
    """A direction without force: pieces without stiffness, (P, 3), and places and widths of singularities."""

    pieces: Array = NO_ROWS
    places: Sequence[float] = ()
    widths: Sequence[float] = ()


class Weights(NamedTuple):
    """Second and third derivative of laws along a motion as weights (N,) at instants; `slope`: the third's along its
    slope (`law.Third`), None where there is no corner.
    """

    zr: Array
    zi: Array
    second: Array
    third: Array
    slope: Array | None = None


class _Fixed(NamedTuple):
    """What of `ClosedLaws` is the same whatever numbers are in the laws."""

    owner: np.ndarray
    starts: np.ndarray
    nodes: Array
    grid: Array
    rules: tuple[Array, Array]


class PackedLaws:
    """The laws of several directions, those in closed form as arrays; `probes` are directions that follow.

    Attributes
    ----------
    pieces, first
        Stiffness, gap, side of piecewise-linear pieces (P, 3), direction by direction, and where each direction's
        begin, (G + 1,).
    polynomial
        Coefficients of u^0, u^1, ... along every direction (G, D), all polynomials in u added up.
    steps, step_first, line
        Place, width, size of arctan steps (S, 3), likewise; constant and slope of the laws that they belong to, (G, 2).
    whole
        Whether that is all of them; other laws are asked at nodes.
    singularities
        Direction, places and widths of where laws of displacement are sharp.
    degree
        Largest degree of a tangent as a polynomial in the motion, or what counts as such between singularities.
    unknown_samples
        Most nodes on a period that laws of unknown smoothness want, 0 without any.
    """

    def __init__(self, groups: Sequence[Sequence[Member]], probes: Sequence[Probe] = ()) -> None:
        pieces: list[tuple[float, ...]] = []
        steps: list[tuple[float, float, float]] = []
        polynomials: list[list[float]] = []
        first, step_first = [0], [0]
        self.line = np.zeros((len(groups) + len(probes), 2))
        self.whole, self.degree, self.unknown_samples = True, 0, 0
        self.singularities: list[tuple[int, Array, Array]] = []
        for g, members in enumerate(groups):
            polynomial: list[float] = []
            places: list[float] = []
            widths: list[float] = []
            for member in members:
                kind = member.kind
                if isinstance(kind, PiecewiseLinear):
                    pieces += _pieces([[member]])
                elif isinstance(kind, PolynomialSampling) and kind.coefficients is not None:
                    polynomial = [sum(pair) for pair in zip_longest(polynomial, kind.coefficients, fillvalue=0.0)]
                elif isinstance(kind, SharpSampling):
                    places += kind.points
                    widths += kind.widths
                    self.degree = max(self.degree, 1)
                    if kind.steps is None:
                        self.whole = False
                    else:
                        steps += zip(kind.points, kind.widths, kind.steps, strict=True)
                        self.line[g] += kind.constant, kind.slope
                else:
                    self.whole = False
                    self.degree = max(self.degree, 1, kind.degree - 1 if isinstance(kind, PolynomialSampling) else 0)
                    if isinstance(kind, AdaptiveSampling):
                        self.unknown_samples = max(self.unknown_samples, member.samples or FEWEST)
            self.degree = max(self.degree, len(polynomial) - 2)
            polynomials.append(polynomial)
            first.append(len(pieces))
            step_first.append(len(steps))
            if places:
                self.singularities.append((g, np.array(places), np.array(widths)))
        for g, probe in enumerate(probes, len(groups)):
            pieces += probe.pieces.tolist()
            first.append(len(pieces))
            if probe.places:
                self.singularities.append((g, np.array(probe.places), np.array(probe.widths)))
        step_first += [len(steps)] * len(probes)
        self.pieces = np.array(pieces) if pieces else NO_ROWS
        self.steps = np.array(steps) if steps else NO_ROWS
        self.first, self.step_first = np.array(first), np.array(step_first)
        #: the direction of every piece, (P,), and of every step, (S,)
        self.owner, self.step_owner = _owners(tuple(first)), _owners(tuple(step_first))
        self.polynomial = np.zeros((len(self.line), max(map(len, polynomials), default=0)))
        for row, polynomial in zip(self.polynomial, polynomials, strict=False):
            row[: len(polynomial)] = polynomial
        #: by highest harmonic of a motion, and of a spectrum
        self._closed: dict[tuple[int, int], ClosedLaws] = {}
        #: direction, polynomial, steps, and these' places and widths, of all laws that are smooth
        self._smooth: list[tuple[int, Array, Array, tuple[Array, Array] | None]] = [
            (g, self.polynomial[g], NO_ROWS, None) for g, polynomial in enumerate(polynomials) if polynomial
        ]
        self._smooth += [
            (g, self.line[g], rows, (rows[:, 0].copy(), rows[:, 1].copy()))
            for g, (low, high) in enumerate(pairwise(step_first))
            if len(rows := self.steps[low:high])
        ]

    def moved(self, groups: Sequence[Sequence[Member]]) -> PackedLaws:
        """The same kinds of laws with other coefficients: those of pieces are all that are not told by the kinds."""
        other = object.__new__(PackedLaws)
        other.__dict__.update(self.__dict__)
        rows = _pieces(groups)
        other.pieces = np.array(rows) if rows else NO_ROWS
        other._closed = {key: ClosedLaws(other.pieces, *known[1:]) for key, known in self._closed.items()}
        return other

    def nodes(self, motions: ComplexArray, top: int) -> list[Nodes]:
        """Nodes for every smooth law along motions (G, H + 1), good for Fourier coefficients up to `top`."""
        return [_nodes(motions[g], polynomial, sharp, top) for g, polynomial, _, sharp in self._smooth]

    def closed(self, high: int, top: int) -> ClosedLaws:
        """The laws known in closed form along motions of harmonics up to `high`, for Fourier coefficients to `top`."""
        if (high, top) not in self._closed:
            self._closed[high, top] = self._closed_laws(high, top)
        return self._closed[high, top]

    def _closed_laws(self, high: int, top: int) -> ClosedLaws:
        smooth = self._smooth
        fixed = _fixed(tuple([(g, len(polynomial), len(steps)) for g, polynomial, steps, _ in smooth]), high, top)
        return ClosedLaws(
            self.pieces,
            self.first,
            fixed.owner,
            np.concatenate([_NO_TERMS, *[one[1] for one in smooth]]),
            np.concatenate([NO_ROWS, *[one[2] for one in smooth]]),
            *fixed[1:],
        )

    def weights(self, direction: int, motion: ComplexArray, nodes: list[Nodes]) -> list[Weights]:
        """Second and third derivatives along the motion (H + 1,) in a direction."""
        parts, pieces = [], self.pieces[self.first[direction] : self.first[direction + 1]]
        if len(pieces):
            grid = search_grid(len(motion) - 1)
            parts.append(Weights(*corner_weights(motion, pieces, grid.zr, grid.zi)))
        for (g, polynomial, steps, _), at in zip(self._smooth, nodes, strict=True):
            if g == direction and (len(polynomial) > 2 or len(steps)):
                both = smooth_weights(motion, polynomial, steps, at.zr, at.zi, at.weights)
                parts.append(Weights(at.zr, at.zi, *both))
        return parts

    def sharp_nodes(self, direction: int, nodes: list[Nodes]) -> Nodes | None:
        """Those of the arctan steps in a direction, None without any."""
        steps = (at for (g, _, steps, _), at in zip(self._smooth, nodes, strict=True) if g == direction and len(steps))
        return next(steps, None)


def _pieces(groups: Sequence[Sequence[Member]]) -> list[tuple[float, ...]]:
    """Stiffness, gap and side of all pieces of laws that are piecewise linear."""
    rows: list[tuple[float, ...]] = []
    for members in groups:
        for _, _, kind, coefficients, _ in members:
            if isinstance(kind, PiecewiseLinear):
                own = coefficients.tolist()
                for piece in kind.pieces:
                    rows += ((own[piece.stiffness], own[piece.gap], float(piece.side)),)
    return rows


def _nodes(motion: ComplexArray, polynomial: Array, sharp: tuple[Array, Array] | None, top: int) -> Nodes:
    """Nodes for a polynomial, or for steps with these places and widths."""
    if sharp is None:
        return polynomial_nodes((len(polynomial) - 1) * (len(motion) - 1), top)
    return graded_nodes(motion, *sharp, top)


@lru_cache(maxsize=64)
def _owners(first: tuple[int, ...]) -> NDArray[np.int64]:
    """The direction of every row, from where each direction's begin."""
    return np.array([g for g, (low, high) in enumerate(pairwise(first)) for _ in range(low, high)], dtype=np.int64)


@lru_cache(maxsize=64)
def _fixed(smooth: tuple[tuple[int, int, int], ...], high: int, top: int) -> _Fixed:
    """Of smooth laws by direction, terms of a polynomial, and number of steps: a polynomial where there is none."""
    grid, sets = search_grid(high), [np.zeros((3, 0))] * len(smooth)
    for s, (_, terms, steps) in enumerate(smooth):
        if not steps:
            at = polynomial_nodes((terms - 1) * high, top)
            sets[s] = np.array((at.zr, at.zi, at.weights))
    sizes = [[one[1] for one in smooth], [one[2] for one in smooth], [one.shape[1] for one in sets]]
    return _Fixed(
        np.array([one[0] for one in smooth], dtype=np.int64),
        np.cumsum([[0, *row] for row in sizes], axis=1),
        np.concatenate([np.zeros((3, 0)), *sets], axis=1),
        np.array((grid.zr, grid.zi)),
        rule_tables(),
    )
