"""Where a law is sampled: nodes on the period and weights, chosen by what the element tells of itself.

Three rules, all of which converge faster than any power of the number of nodes for the laws they are meant for:

- uniform (the trapezoidal rule), exact for laws that are polynomials in displacement and velocity;
- Gauss-Legendre rules on pieces that are mapped away from the complex instants at which a sharp law (a regularised
  contact) is singular, so that no sampling error is left: sampling a sharp law uniformly bends the response curve
  into false folds;
- uniform with a number of samples that is doubled until force and tangent stop moving, for laws that tell nothing.

The nodes follow the motion at each evaluation. That does no harm because the rule is accurate to rounding before and
after.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import ConvergenceError
from suboctave.harmonic import kernels
from suboctave.harmonic import sharp_nodes as graded
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.model.element import Element
from suboctave.model.sampling import AdaptiveSampling, PolynomialSampling, Sampling, SharpSampling

#: Gauss-Legendre nodes per panel, and how many half-lengths a singularity must keep from a panel's centre: with 12
#: nodes the error of a panel is about (1.4 + sqrt(0.96))^-24 = 7e-10 at worst, and typically the square of that.
_ORDER = 12
_RATIO = 1.4
FEWEST, _MOST = 32, 1 << 15
#: relative change of force and tangent coefficients below which adaptive sampling is content
_SETTLED = 1e-11
#: how many sets of graded nodes are kept, and those
_REMEMBERED = 8
_recent: dict[tuple[bytes, bytes, bytes, int, bool], Array] = {}
_making_room = threading.Lock()


@dataclass(frozen=True)
class Nodes:
    """Points `exp(i tau_j)` on the period (real and imaginary part, shape (N,)) and weights that add up to 2 pi."""

    zr: Array
    zi: Array
    weights: Array

    @property
    def tau(self) -> Array:
        """Instants in [0, 2 pi), shape (N,)."""
        return np.mod(np.arctan2(self.zi, self.zr), 2.0 * math.pi)


@lru_cache(maxsize=64)
def uniform_nodes(count: int) -> Nodes:
    """`count` equidistant instants from tau = 0."""
    tau = 2.0 * math.pi * np.arange(count) / max(1, count)
    return Nodes(np.cos(tau), np.sin(tau), np.full(count, 2.0 * math.pi / max(1, count)))


@lru_cache(maxsize=64)
def on_circle(count: int) -> Array:
    """The same instants as cosines and sines, (2, count)."""
    nodes = uniform_nodes(count)
    return np.array((nodes.zr, nodes.zi))


@lru_cache(maxsize=256)
def singularities(kind: SharpSampling) -> tuple[Array, Array]:
    return np.asarray(kind.points, float), np.asarray(kind.widths, float)


def nodes_for(kind: Sampling, motion: ComplexArray, top: int, samples: int | None) -> Nodes:
    """Nodes for an element whose relative displacement is `Re sum_k motion_k exp(i k tau)`.

    Parameters
    ----------
    kind
        What the element tells of its law.
    motion
        Complex coefficients, shape (H + 1,).
    top
        Highest Fourier coefficient of the tangent that is wanted.
    samples
        Frozen number of samples of an element that tells nothing (`samples_for`), else ignored.
    """
    high = motion.shape[0] - 1
    if isinstance(kind, PolynomialSampling):
        # a force of degree d has harmonics up to d H; none of them may alias onto those up to `top`
        return uniform_nodes(even(kind.degree * high + top + 1))
    if isinstance(kind, SharpSampling):
        return graded_nodes(motion, *singularities(kind), top)
    return uniform_nodes(samples or FEWEST)


def graded_nodes(motion: ComplexArray, points: Array, widths: Array, top: int) -> Nodes:
    """Nodes for laws that are singular at u = points +- i widths: see `sharp_nodes`."""
    return Nodes(*graded_motion(motion, points, widths, top, moving=False)[:3])


def graded_motion(motion: ComplexArray, points: Array, widths: Array, top: int, moving: bool = True) -> Array:
    """These nodes with the motion there: cosines, sines, weights, values and, if `moving`, derivatives by tau, (5, N)
    or (4, N); not to be written to: forces, curvatures and what a parameter changes ask for the same ones one after the
    other.
    """
    key = (motion.tobytes(), points.tobytes(), widths.tobytes(), top, moving)
    found = _recent.get(key)
    if found is None:
        high = motion.shape[0] - 1
        grid = search_grid(high)
        found = graded.sharp_nodes(motion, points, widths, top + high, moving, grid.zr, grid.zi, *rule_tables())
        with _making_room:
            while len(_recent) >= _REMEMBERED:
                del _recent[next(iter(_recent))]
            _recent[key] = found
    return found


def search_grid(high: int) -> Nodes:
    """Equidistant instants, close enough for searches along a motion of harmonics up to `high`."""
    return uniform_nodes(search_count(high))


def search_count(high: int) -> int:
    """Number of these instants."""
    return 8 * high + 8


@lru_cache(maxsize=1)
def rule_tables() -> tuple[Array, Array]:
    """Gauss-Legendre rules of all orders: see `sharp_nodes.tables`."""
    return graded.tables()


def even(count: int) -> int:
    """A number of samples, at least `count`, of a few fixed sizes so that tables are shared."""
    return 8 * math.ceil(count / 8)


def samples_for(element: Element, motion: ComplexArray, rate: float, coefficients: Array, top: int) -> int | None:
    """Number of uniform samples with which force and tangent of an element that tells nothing have settled.

    `rate` is the base frequency. Returns None for elements that know their rule.

    Raises
    ------
    ConvergenceError
        If even 32768 samples do not suffice: the law is too sharp to be sampled blindly.
    """
    if not isinstance(element.sampling(coefficients), AdaptiveSampling):
        return None
    count = max(FEWEST, 1 << math.ceil(math.log2(2 * top + 2)))
    previous: tuple[NDArray[np.complex128], ...] | None = None
    while count <= _MOST:
        nodes = uniform_nodes(count)
        current = sampled_spectra(element, motion, rate, coefficients, nodes, top)
        if previous is not None:
            moved = max(_change(a, b) for a, b in zip(previous, current, strict=True))
            if moved < _SETTLED:
                return count // 2
        previous = current
        count *= 2
    raise ConvergenceError(
        f"{element.label}: the force does not settle with {_MOST} samples per period. Tell where its law is sharp "
        f"(Element.sampling returning SharpSampling(points, widths)), write it as a text (Expression), whose corners "
        "are located, or use an exact piecewise-linear element"
    )


def _change(a: ComplexArray, b: ComplexArray) -> float:
    size = float(np.abs(b).max())
    return float(np.abs(a - b).max()) / size if size > 0.0 else 0.0


def sampled_spectra(
    element: Element, motion: ComplexArray, rate: float, coefficients: Array, nodes: Nodes, top: int
) -> tuple[ComplexArray, ...]:
    """Fourier coefficients 0 .. top of force, stiffness and (if the law depends on velocity) damping at the given
    nodes.
    """
    values = kernels.motion(motion, nodes.zr, nodes.zi)
    f, f_u, f_v = element.tangent(values[0], rate * values[1], coefficients)
    rows = (f, f_u) if f_v is None else (f, f_u, f_v)
    weighted = np.empty((len(rows), nodes.weights.shape[0]))
    for i, row in enumerate(rows):
        np.multiply(row, nodes.weights, out=weighted[i])
    return tuple(kernels.spectra(weighted, nodes.zr, nodes.zi, top))
