"""All elements along one direction at once, against each element by itself and against other quadratures."""

import math
from functools import lru_cache

import numpy as np
import pytest
from numba import njit

from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic import HarmonicBalance, HarmonicBasis
from suboctave.harmonic.quadrature import graded_nodes, peak
from suboctave.harmonic.trigonometric import jet
from suboctave.model import CubicSpring, ElasticStop, PolynomialSpring, System
from suboctave.model.elements.base import Element
from suboctave.model.elements.derivative_check import check_derivatives
from suboctave.model.elements.smoothness import AdaptiveSampling, PolynomialSampling

#: halvings of a panel at most
_DEPTH = 40


@lru_cache(maxsize=64)
def panel_tables(panels: int, order: int) -> tuple[np.ndarray, ...]:
    """Gauss-Legendre nodes on panels that halve level by level, as points on the circle: what `halved_panels`
    asks for.
    """
    nodes, weights = np.polynomial.legendre.leggauss(order)
    half = math.pi / panels * 0.5 ** np.arange(_DEPTH + 1)
    angles = np.multiply.outer(half, nodes)
    return np.cos(angles), np.sin(angles), np.cos(0.5 * half), np.sin(0.5 * half), weights


@njit
def _nearest(x, d, s, point, width):
    """Distance from here to the nearest complex time at which the motion (value x, derivatives d, s) equals point +-
    i width.
    """
    target = complex(x - point, -width)
    if abs(s) * abs(target) < 1e-6 * d * d:
        return abs(target) / abs(d)
    root = np.sqrt(d * d - 2.0 * s * target)
    q = -(d + root) if (root.real * d >= 0.0) else -(d - root)
    if abs(q) == 0.0:
        return math.sqrt(2.0 * abs(target) / abs(s)) if s != 0.0 else np.inf
    first = abs(q / s) if s != 0.0 else np.inf
    return min(first, abs(2.0 * target / q))


@njit
def halved_panels(c, points, widths, cr, ci, hr, hi, weights, ratio):
    """Composite Gauss-Legendre nodes on a period, graded towards the instants at which a sharp law is passed.

    A panel is halved until the nearest complex instant at which the motion meets a singularity of the law (point +- i
    width) lies at least `ratio` half-lengths from its centre; the rule then converges geometrically on it. Tables
    (`quadrature.panel_tables`): cr, ci (levels, order) hold the nodes of a panel of every level, relative to its
    centre, as points on the circle; hr, hi (levels,) half its half-length; `weights` those of the rule on (-1, 1).
    Level 0 covers the period with equal panels. Returns z (real, imaginary part) and weights, which add up to 2 pi.
    """
    order = weights.shape[0]
    depth = hr.shape[0] - 1
    half = 2.0 * math.atan2(hi[0], hr[0])
    panels = round(math.pi / half)
    capacity = order * panels * 4
    zr = np.empty(capacity)
    zi = np.empty(capacity)
    w = np.empty(capacity)
    count = 0
    stack_r = np.empty(depth + 2)
    stack_i = np.empty(depth + 2)
    stack_level = np.empty(depth + 2, dtype=np.int64)
    for p in range(panels):
        centre = (2 * p + 1) * half
        stack_r[0] = math.cos(centre)
        stack_i[0] = math.sin(centre)
        stack_level[0] = 0
        size = 1
        while size > 0:
            size -= 1
            ar = stack_r[size]
            ai = stack_i[size]
            level = stack_level[size]
            h = half * 0.5**level
            split = False
            if level < depth:
                x, d, s = jet(c, ar, ai)
                for m in range(points.shape[0]):
                    if _nearest(x, d, s, points[m], widths[m]) < ratio * h:
                        split = True
                        break
            if split:
                br = hr[level]
                bi = hi[level]
                stack_r[size] = ar * br - ai * bi
                stack_i[size] = ar * bi + ai * br
                stack_level[size] = level + 1
                stack_r[size + 1] = ar * br + ai * bi
                stack_i[size + 1] = ai * br - ar * bi
                stack_level[size + 1] = level + 1
                size += 2
                continue
            if count + order > capacity:
                capacity *= 2
                zr = np.concatenate((zr, np.empty(capacity - zr.shape[0])))
                zi = np.concatenate((zi, np.empty(capacity - zi.shape[0])))
                w = np.concatenate((w, np.empty(capacity - w.shape[0])))
            for j in range(order):
                zr[count] = ar * cr[level, j] - ai * ci[level, j]
                zi[count] = ar * ci[level, j] + ai * cr[level, j]
                w[count] = h * weights[j]
                count += 1
    return zr[:count], zi[:count], w[:count]


class Damper(Element):
    """f = c v |v|-like but smooth: c v sqrt(v^2 + 1), sampled blindly."""

    coefficient_names = ("c",)
    depends_on_velocity = True

    def sampling(self, c):
        return AdaptiveSampling()

    def tangent(self, u, v, c):
        root = np.sqrt(v * v + 1.0)
        return c[0] * v * root, np.zeros_like(u), c[0] * (root + v * v / root)

    def curvature(self, u, v, c):
        zero = np.zeros_like(u)
        root = np.sqrt(v * v + 1.0)
        return zero, zero, c[0] * (3.0 * v / root - v**3 / root**3)

    def coefficient_tangent(self, u, v, c):
        f, f_u, f_v = self.tangent(u, v, np.ones(1))
        return f[None], f_u[None], f_v[None]

    def coefficient_curvature(self, u, v, c):
        return np.zeros((1, 1, len(u)))


class Undeclared(Damper):
    depends_on_velocity = False


class LyingPolynomial(CubicSpring):
    def sampling(self, c):
        return PolynomialSampling(3, (0.0, 0.0, 0.0, 2.0 * float(c[0])))


ELEMENTS = [
    CubicSpring(0, 0.3),
    PolynomialSpring(0, {2: 0.2, 5: -0.1}),
    ElasticStop(0, 3.0, 0.4),
    ElasticStop(0, 2.0, -0.6),
    ElasticStop(0, 1.5, 0.5, regularization=200.0),
    ElasticStop(0, 2.5, -0.3, regularization=40.0),
    Damper(0, [0.2]),
    CubicSpring((0, 1), 0.7),
    ElasticStop((0, 1), 2.0, 0.1),
]


def state_of(elements, harmonics=6):
    system = System(np.eye(2), 0.1 * np.eye(2), [[2.0, -1.0], [-1.0, 2.0]], elements)
    rng = np.random.default_rng(3)
    x = rng.standard_normal((2 * harmonics + 1, 2)) * 0.7 ** np.arange(2 * harmonics + 1)[:, None]
    return HarmonicBalance(system, HarmonicBasis(harmonics)).settle(x, 1.3).at(x, 1.3)


def test_the_sum_over_elements_is_what_a_channel_gives():
    state = state_of(ELEMENTS)
    assert len(state.channels) == 2
    for channel in state.channels:
        parts = []
        for i in channel.group.members:
            alone = state_of([ELEMENTS[i]])
            parts.append(alone.channels[0])
        assert channel.moving == any(part.moving for part in parts)
        rows = 3 if channel.moving else 2
        total = np.zeros((rows, state.balance.top + 1), dtype=complex)
        for part in parts:
            total[: len(part.spectra)] += part.spectra
        np.testing.assert_allclose(channel.spectra, total, atol=1e-8)


def test_curvature_of_a_channel_integrates_like_those_of_its_elements():
    state = state_of(ELEMENTS)

    def integral(channel, k):
        return sum((part.weights[0, 0] * (part.zr + 1j * part.zi) ** k).sum() for part in channel.second)

    for channel in state.channels:
        for k in (0, 1, 3):
            parts = [state_of([ELEMENTS[i]]).channels[0] for i in channel.group.members]
            assert integral(channel, k) == pytest.approx(sum(integral(part, k) for part in parts), abs=1e-6)


def test_an_undeclared_velocity_is_refused_not_dropped():
    with pytest.raises(InputError, match="depends_on_velocity = True"):
        _ = state_of([Undeclared(0, [0.2])]).force


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
def test_a_force_that_is_not_finite_is_named():
    state = state_of([CubicSpring(0, 1.0), PolynomialSpring(1, {300: 1e300})])
    with pytest.raises(ConvergenceError, match=r"PolynomialSpring\(dof=1\).*not finite"):
        _ = state.residual


def test_a_polynomial_that_tells_other_coefficients_than_it_has_is_found():
    assert not check_derivatives(LyingPolynomial(0, 1.0)).ok
    with pytest.raises(InputError, match="has 4 coefficients"):
        PolynomialSampling(3, (1.0, 2.0))


def bell(u, points, widths):
    return sum(np.arctan((u - p) / w) for p, w in zip(points, widths, strict=True))


@pytest.mark.parametrize("seed", range(40))
def test_graded_nodes_integrate_sharp_laws_as_dyadic_panels_do(seed):
    """Two rules with nothing in common but Gauss-Legendre: mapped pieces, and panels that halve."""
    rng = np.random.default_rng(seed)
    high = int(rng.choice([3, 7, 15]))
    k = np.arange(high + 1)
    c = (rng.standard_normal(high + 1) + 1j * rng.standard_normal(high + 1)) * np.exp(-rng.uniform(0.4, 1.0) * k)
    c[0] = c[0].real
    count = int(rng.integers(1, 4))
    points, widths = rng.uniform(-0.8, 0.8, count) * np.abs(c).sum(), 10.0 ** rng.uniform(-6, -0.5, count)
    if seed % 4 == 0:  # nearly a grazing
        points[0] = peak(c)[2] * (1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-9, -2))
    top = 2 * high + 1
    nodes = graded_nodes(c, points, widths, top)
    assert nodes.weights.sum() == pytest.approx(2 * np.pi, rel=1e-13)
    other = halved_panels(c, points, widths, *panel_tables(40 + 4 * high, 20), 1.6)

    def spectrum(zr, zi, weights):
        z = zr + 1j * zi
        u = np.real(sum(c[q] * z**q for q in range(high + 1)))
        return np.array([(weights * bell(u, points, widths) * z**-q).sum() for q in range(top + 1)])

    mine, theirs = spectrum(nodes.zr, nodes.zi, nodes.weights), spectrum(*other)
    assert np.abs(mine - theirs).max() < 1e-9 * max(1.0, np.abs(theirs).max())
    # a handful of nodes per passage and per harmonic, not per width
    assert len(nodes.weights) < 60 * count * high + 400
