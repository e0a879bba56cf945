"""Exact integration of one-sided springs: against polynomial roots, quadrature between them, and closed forms."""

from itertools import pairwise

import numpy as np
import pytest
from channels import by_coefficients, channel_of
from hypothesis import given, settings, strategies as st

from suboctave.harmonic.quadrature import peak, search_grid
from suboctave.harmonic.trigonometric import crossings
from suboctave.model import ElasticStop

TOP = 25


def value(c, tau, order=0):
    """d^order/dtau^order of Re sum_k c_k exp(i k tau)."""
    k = np.arange(len(c))
    return np.real(np.exp(1j * np.multiply.outer(np.asarray(tau, float), k)) @ (c * (1j * k) ** order))


def companion_crossings(c, level):
    """All roots of the motion minus level on the circle, from the eigenvalues of the companion matrix."""
    p = np.concatenate((0.5 * c[:0:-1], [c[0].real - level], 0.5 * c[1:].conj()))
    z = np.roots(p)
    return np.sort(np.mod(np.angle(z[np.abs(np.abs(z) - 1.0) < 1e-6]), 2 * np.pi))


def random_motion(rng, harmonics, decay):
    c = (rng.normal(size=harmonics + 1) + 1j * rng.normal(size=harmonics + 1)) / (1 + np.arange(harmonics + 1)) ** decay
    c[0] = c[0].real
    return c


def extrema(c):
    """Instants of all extrema, from the companion matrix of the derivative."""
    return companion_crossings(1j * np.arange(len(c)) * c, 0.0)


def local(stop, c, top=TOP):
    return channel_of(stop, c, top)


def kernel_crossings(c, level):
    grid = search_grid(len(c) - 1)
    return crossings(np.ascontiguousarray(c, dtype=complex), level, grid.zr, grid.zi)[0]


def quadrature(c, level, side, q, stiffness):
    """Fourier coefficients q of force and tangent by Gauss-Legendre rules between the roots."""
    ends = companion_crossings(c, level)
    ends = np.append(ends, ends[:1] + 2 * np.pi) if len(ends) else np.array([0.0, 2 * np.pi])
    nodes, weights = np.polynomial.legendre.leggauss(60)
    force, tangent = np.zeros(len(q), complex), np.zeros(len(q), complex)
    for a, b in pairwise(ends):
        for part in range(4):
            half = (b - a) / 8
            tau = a + (2 * part + 1) * half + half * nodes
            y = value(c, tau) - level
            active = half * weights * (side * y > 0) / (2 * np.pi)
            waves = np.exp(-1j * np.multiply.outer(q, tau))
            force += stiffness * waves @ (active * y)
            tangent += stiffness * waves @ active
    return force, tangent


@pytest.mark.parametrize("harmonics", [1, 3, 8, 15, 23])
@pytest.mark.parametrize("decay", [0.0, 0.5, 1.5])
def test_crossings_are_the_roots_of_the_companion_matrix(harmonics, decay):
    rng = np.random.default_rng(100 * harmonics + int(10 * decay))
    for _ in range(10):
        c = random_motion(rng, harmonics, decay)
        level = rng.normal() * np.abs(c[1:]).sum() * 0.3 + c[0].real
        expected, found = companion_crossings(c, level), kernel_crossings(c, level)
        assert len(found) == len(expected)
        np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("harmonics", [2, 7, 15, 31, 63])
@pytest.mark.parametrize("eps", [1e-5, 1e-8, 1e-11])
def test_pairs_hidden_between_samples_are_found(harmonics, eps):
    """Around every extremum of a rough motion: just beyond the level there is one more pair than just short of it,
    and the pair stands sqrt(2 eps / |x''|) to either side.
    """
    rng = np.random.default_rng(harmonics)
    for _ in range(5):
        c = random_motion(rng, harmonics, 0.7)
        size = np.abs(c).sum()
        for tau in extrema(c):
            x, bend = value(c, tau), value(c, tau, 2)
            towards = np.sign(bend) * eps * size  # to the side on which the curve lies
            pair = kernel_crossings(c, x + towards)
            assert len(pair) == len(kernel_crossings(c, x - towards)) + 2
            half = np.sqrt(2 * eps * size / abs(bend))
            if half < 0.02 / harmonics:
                near = np.sort(np.abs(np.mod(pair - tau + np.pi, 2 * np.pi) - np.pi))[:2]
                np.testing.assert_allclose(near, half, rtol=20 * harmonics * half + 1e-14 / eps)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("seed", range(12))
def test_force_and_tangent_against_quadrature(seed, side):
    rng = np.random.default_rng(seed)
    c = random_motion(rng, int(rng.integers(1, 13)), rng.uniform(0.3, 2.0))
    level = c[0].real + 0.4 * rng.normal() * np.abs(c[1:]).sum()
    stop = ElasticStop(0, 3.7, level, side="right" if side > 0 else "left")
    force, tangent = quadrature(c, level, side, np.arange(TOP + 1), 3.7)
    result = local(stop, c)
    np.testing.assert_allclose(result.spectra[0], force, atol=1e-12 * (1 + np.abs(c).sum()))
    np.testing.assert_allclose(result.stiffness(0), tangent, atol=1e-11)


@pytest.mark.parametrize(("gap", "share"), [(-10.0, 1.0), (10.0, 0.0)])
def test_a_stop_always_or_never_touched(gap, share):
    c = np.array([0.3, 1.0 - 0.2j, 0.1j])
    result = local(ElasticStop(0, 2.0, gap, side="right"), c, 5)
    np.testing.assert_allclose(result.stiffness(0), share * 2.0 * np.eye(6)[0], atol=1e-15)
    expected = np.array([c[0].real - gap, c[1] / 2, c[2] / 2, 0, 0, 0]) * 2.0 * share
    np.testing.assert_allclose(result.spectra[0], expected, atol=1e-14)


@given(seed=st.integers(0, 10**6), harmonics=st.integers(1, 15), shift=st.floats(-1.2, 1.2))
@settings(max_examples=60, deadline=None)
def test_two_opposite_stops_are_a_spring(seed, harmonics, shift):
    """`k (u - b)` for u > b and the same for u < b add up to a linear spring; so do all their derivatives, up to the
    corner, whose two boundary terms cancel.
    """
    c = random_motion(np.random.default_rng(seed), harmonics, 1.0)
    gap = c[0].real + shift * np.abs(c[1:]).max()
    pair = [local(ElasticStop(0, 2.5, gap, side=side), c) for side in ("left", "right")]
    force = sum(one.spectra[0] for one in pair)
    spring = np.zeros(TOP + 1, complex)
    spring[: harmonics + 1] = 1.25 * c
    spring[0] = 2.5 * (c[0].real - gap)
    np.testing.assert_allclose(force, spring, atol=1e-12 * (1 + np.abs(c).sum()))
    tangent = sum(one.stiffness(0) for one in pair)
    np.testing.assert_allclose(tangent, 2.5 * np.eye(TOP + 1)[0], atol=1e-12)
    by = [by_coefficients(one) for one in pair]
    np.testing.assert_allclose(sum(b.force[1] for b in by), -2.5 * np.eye(TOP + 1)[0], atol=1e-12)
    assert np.abs(sum(b.tangent[1, 0] for b in by)).max() <= 1e-12 * (1 + np.abs(by[0].tangent[1, 0]).max())
    bent = [np.concatenate([part.weights[0, 0] for part in one.second] or [np.zeros(0)]) for one in pair]
    np.testing.assert_allclose(np.sort(bent[0]), np.sort(-bent[1]), rtol=1e-12)


@pytest.mark.parametrize("harmonics", [1, 5, 15])
@pytest.mark.parametrize("eps", [1e-3, 1e-6, 1e-9, 1e-12])
def test_grazing_stiffness_follows_the_square_root(harmonics, eps):
    """A motion that reaches eps beyond the gap touches for 2 sqrt(2 eps / |x''|): the mean stiffness per unit is
    sqrt(2 eps / |x''|) / pi, with a relative correction of the order of eps.
    """
    c = random_motion(np.random.default_rng(harmonics), harmonics, 1.5)
    at = extrema(c)
    top = at[np.argmax(value(c, at))]
    stop = ElasticStop(0, 1.0, float(value(c, top)) - eps, side="right")
    expected = np.sqrt(2 * eps / abs(value(c, top, 2))) / np.pi
    mean = local(stop, c).stiffness(0)[0].real
    assert mean == pytest.approx(expected, rel=max(30 * harmonics**2 * eps, 2e-15 / eps, 1e-9))


@pytest.mark.parametrize("seed", range(6))
def test_amplitude_is_the_extremum_largest_in_modulus(seed):
    """peak against all extrema, from the companion matrix of the derivative."""
    rng = np.random.default_rng(seed)
    for harmonics in (1, 2, 5, 15, 40):
        c = random_motion(rng, harmonics, rng.uniform(0.0, 2.0))
        size, tau, x = peak(c)
        assert size == pytest.approx(np.abs(value(c, extrema(c))).max(), rel=1e-9)
        assert value(c, tau) == pytest.approx(x, rel=1e-11)
        assert abs(x) == size


def test_amplitude_in_closed_form():
    """max |a0 + cos tau + b cos 2 tau| with the extremum inside: at cos tau = -1/(4 b), of value a0 - b - 1/(8 b)."""
    size, tau, x = peak(np.array([-1.0, 1.0, 0.7 + 0j]))
    assert x == pytest.approx(-1.0 - 0.7 - 1 / 5.6, rel=1e-14)
    assert size == -x
    assert np.cos(tau) == pytest.approx(-1 / 2.8, abs=1e-8)
    assert peak(np.array([0.25 + 0j, 0.0]))[0] == 0.25
    assert peak(np.zeros(4, complex))[0] == 0.0
