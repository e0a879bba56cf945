"""Laws of one displacement and its rate that elements are asked for at nodes: all that have no closed form."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.aft.law import Along, CoefficientSpectra, LawAlong, Member, Second, Third
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import FEWEST, MOST, SETTLED, even, graded_nodes, uniform_nodes
from suboctave.harmonic.trigonometric import motion, spectra
from suboctave.lazy import lazy
from suboctave.model.elements.base import Element
from suboctave.model.elements.smoothness import AdaptiveSampling

__all__ = ["GradedLaw", "Sampled", "UniformLaw", "settled_samples"]


class Sampled(LawAlong):
    """A law of one displacement and its rate, sampled at nodes."""

    @abstractmethod
    def _path(self) -> tuple[Array, Array, Array, Array, Array]:
        """Cosines, sines, weights of the nodes; displacement and its derivative by tau there, (N,) each."""

    @lazy
    def path(self) -> tuple[Array, Array, Array, Array, Array]:
        """Cosines, sines, weights of the nodes; displacement and velocity there, (N,) each."""
        zr, zi, w, u, slope = self._path()
        return zr, zi, w, u, self.along.rate * slope

    def add_spectra(self, out: ComplexArray) -> None:
        """See `LawAlong.add_spectra`."""
        _, _, _, u, v = self.path
        rows: list[Array | None] = [None] * (1 + self.along.size)
        for member in self.members:
            element = _one_input(member)
            parts = element.tangent(u, v, member.coefficients)
            if parts[2] is not None and not element.depends_on_velocity:
                raise InputError(
                    f"{element.label} returns f_v, a derivative by velocity: its class must say "
                    "depends_on_velocity = True"
                )
            for r, part in enumerate(parts):
                if part is not None:
                    sofar = rows[r]
                    rows[r] = part if sofar is None else sofar + part
        present = [r for r, row in enumerate(rows) if row is not None]
        values = [np.asarray(rows[r], dtype=float) for r in present]
        if any(row.shape != u.shape for row in values):
            labels = ", ".join(member.element.label for member in self.members)
            raise InputError(f"{labels}: tangent must return arrays of the shape of u")
        out[present] += self._project(np.array(values))

    def second(self) -> list[Second]:
        """See `LawAlong.second`."""
        zr, zi, w, u, v = self.path
        weights = np.zeros((self.along.size,) * 2 + u.shape)
        for member in self.members:
            uu, uv, vv = _one_input(member).curvature(u, v, member.coefficients)
            weights[0, 0] += uu
            if uv is not None and vv is not None:
                weights[0, 1] += uv
                weights[1, 0] += uv
                weights[1, 1] += vv
        return [Second(zr, zi, w * weights)]

    def third(self) -> list[Third]:
        """See `LawAlong.third`."""
        zr, zi, w, u, v = self.path
        weights = np.zeros((self.along.size,) * 3 + u.shape)
        for member in self.members:
            uuu, uuv, uvv, vvv = _one_input(member).third(u, v, member.coefficients)
            weights[0, 0, 0] += uuu
            if uuv is None or uvv is None or vvv is None:
                continue
            for place in ((0, 0, 1), (0, 1, 0), (1, 0, 0)):
                weights[place] += uuv
            for place in ((0, 1, 1), (1, 0, 1), (1, 1, 0)):
                weights[place] += uvv
            weights[1, 1, 1] += vvv
        return [Third(zr, zi, w * weights, None)]

    def coefficient_spectra(self, member: Member) -> CoefficientSpectra:
        """See `LawAlong.coefficient_spectra`."""
        _, _, _, u, v = self.path
        element, c = _one_input(member), member.coefficients
        f_c, f_uc, f_vc = element.coefficient_tangent(u, v, c)
        tangent = np.zeros((len(c), self.along.size, len(u)))
        tangent[:, 0] = f_uc
        if f_vc is not None:
            tangent[:, 1] = f_vc
        f_cc = element.coefficient_curvature(u, v, c)
        return CoefficientSpectra(self._project(f_c), self._project(tangent), self._project(f_cc))

    def add_change(self, rates: dict[int, Array], out: ComplexArray) -> None:
        """See `LawAlong.add_change`."""
        _, _, _, u, v = self.path
        for member in self.members:
            if member.number in rates:
                parts = _one_input(member).coefficient_change(u, v, member.coefficients, rates[member.number])
                present = [r for r, part in enumerate(parts) if part is not None]
                out[present] += self._project(np.array([parts[r] for r in present]))

    def _project(self, values: Array) -> ComplexArray:
        """Fourier coefficients (..., top + 1) of functions given at the nodes (..., N)."""
        zr, zi, w, _, _ = self.path
        flat = np.ascontiguousarray(np.reshape(values, (-1, len(w))), dtype=float)
        coefficients: ComplexArray = spectra(flat, w, zr, zi, self.along.top)
        return coefficients.reshape(np.shape(values)[:-1] + (self.along.top + 1,))


class UniformLaw(Sampled):
    """Polynomials in displacement and velocity, and laws of unknown smoothness: equidistant instants.

    degree: highest degree of the polynomials among them, 0 without any.
    """

    def __init__(self, along: Along, members: tuple[Member, ...], degree: int) -> None:
        super().__init__(along, members)
        self.degree = degree

    def _path(self) -> tuple[Array, Array, Array, Array, Array]:
        along = self.along
        count = max(member.samples or FEWEST for member in self.members)
        # a force of degree d has harmonics up to d H; none of them may alias onto those up to `top`
        count = max(count, even(self.degree * along.high + along.top + 1)) if self.degree else count
        nodes = uniform_nodes(count)
        u, slope = motion(along.motion, nodes.zr, nodes.zi)
        return nodes.zr, nodes.zi, nodes.weights, u, slope

    def reaching(self, along: Along, members: tuple[Member, ...]) -> UniformLaw:
        """See `LawAlong.reaching`."""
        # the frozen number settles the force up to the order that the motion needs; a higher order must not alias
        least = 1 << math.ceil(math.log2(2 * along.top + 2))
        enough = tuple(
            m._replace(samples=max(m.samples or 0, least)) if isinstance(m.kind, AdaptiveSampling) else m
            for m in members
        )
        return UniformLaw(along, enough, self.degree)


class GradedLaw(Sampled):
    """Laws that are singular near the real axis, at `u = points +- i widths`."""

    def __init__(self, along: Along, members: tuple[Member, ...], points: Array, widths: Array) -> None:
        super().__init__(along, members)
        self.points, self.widths = points, widths

    def _path(self) -> tuple[Array, Array, Array, Array, Array]:
        nodes = graded_nodes(self.along.motion, self.points, self.widths, self.along.top)
        u, slope = motion(self.along.motion, nodes.zr, nodes.zi)
        return nodes.zr, nodes.zi, nodes.weights, u, slope

    def reaching(self, along: Along, members: tuple[Member, ...]) -> GradedLaw:
        """See `LawAlong.reaching`."""
        return GradedLaw(along, members, self.points, self.widths)


def settled_samples(along: Along, member: Member) -> int | None:
    """Number of uniform samples with which force and tangent of an element of unknown smoothness have settled.

    None for elements whose smoothness decides.

    Raises
    ------
    ConvergenceError
        If even 32768 samples do not suffice: the law is too sharp to be sampled blindly.
    """
    if not isinstance(member.kind, AdaptiveSampling):
        return None
    count = max(FEWEST, 1 << math.ceil(math.log2(2 * along.top + 2)))
    previous: ComplexArray | None = None
    while count <= MOST:
        current = np.zeros((1 + along.size, along.top + 1), dtype=complex)
        UniformLaw(along, (member._replace(samples=count),), 0).add_spectra(current)
        if previous is not None and relative_change(previous, current) < SETTLED:
            return count // 2
        previous, count = current, 2 * count
    raise ConvergenceError(
        f"{member.element.label}: the force does not settle with {MOST} samples per period. Tell where its law is "
        "sharp (Element.sampling returning SharpSampling(points, widths)), write it as a text (Expression), whose "
        "corners are located, or use an exact piecewise-linear element"
    )


def relative_change(a: ComplexArray, b: ComplexArray) -> float:
    """Largest change of a row of spectra in units of its largest coefficient."""
    size = np.maximum(np.abs(b).max(axis=1), np.finfo(float).tiny)
    return float((np.abs(b - a).max(axis=1) / size).max())


def _one_input(member: Member) -> Element:
    assert isinstance(member.element, Element)
    return member.element
