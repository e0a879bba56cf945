"""Extrema of a motion against the roots of its derivative, and their pairing between neighbours."""

from __future__ import annotations

import math

import numpy as np
import pytest

from suboctave.harmonic.quadrature import uniform_nodes
from suboctave.harmonic.trigonometric import extrema, passages


def find(c):
    c = np.ascontiguousarray(c, dtype=complex)
    grid = uniform_nodes(1 << math.ceil(math.log2(8 * len(c))))
    return extrema(c, grid.zr, grid.zi)


def passing(*args):
    pairs, count, before, after, _ = passages(*args)
    return pairs[:count], before, after


def derivatives(c, tau):
    k = np.arange(len(c))
    waves = np.exp(1j * np.multiply.outer(tau, k))
    return [np.real(waves @ (c * (1j * k) ** order)) for order in range(3)]


def roots_of_slope(c):
    """Real instants at which the derivative vanishes, from the eigenvalues of a companion matrix."""
    d = 1j * np.arange(len(c)) * c
    z = np.roots(np.concatenate((0.5 * d[:0:-1], [0.0], 0.5 * d[1:].conj())))
    return np.sort(np.mod(np.angle(z[np.abs(np.abs(z) - 1.0) < 1e-6]), 2.0 * np.pi))


@pytest.mark.parametrize("harmonics", [1, 3, 7, 15])
@pytest.mark.parametrize("decay", [0.0, 1.5])
def test_all_extrema_are_found(harmonics, decay):
    rng = np.random.default_rng(3)
    for _ in range(60):
        c = rng.normal(size=harmonics + 1) + 1j * rng.normal(size=harmonics + 1)
        c /= (1.0 + np.arange(harmonics + 1)) ** decay
        c[0] = c[0].real
        tau, value, curve = find(c)
        expected = roots_of_slope(c)
        if len(expected) > 1 and np.diff(expected).min() < 2e-3:
            continue  # two that just come or go: whether they are there is a matter of rounding
        assert np.sort(np.mod(tau, 2.0 * np.pi)) == pytest.approx(expected, abs=1e-8)
        u, slope, bend = derivatives(c, tau)
        assert value == pytest.approx(u, abs=1e-13 * np.abs(c).sum())
        assert np.abs(slope).max() < 1e-7 * np.abs(c).sum() * harmonics**2
        assert curve == pytest.approx(bend, rel=1e-5, abs=1e-6)
        assert np.all(np.diff(np.sign(curve)) != 0.0)  # maxima and minima in turn


def test_a_motion_at_rest_has_none():
    assert find(np.array([0.7, 0.0, 0.0]))[0].size == 0


def test_a_level_passed_by_one_maximum():
    """cos(tau), growing through 1 from 0.9 to 1.1: its maximum passes, and two crossings appear."""
    pairs, before, after = passing(*find([0.0, 0.9]), 1.0, *find([0.0, 1.1]), 1.0)
    assert (before, after) == (0, 2)
    assert pairs.shape == (1, 2)
    tau, _, curve = find([0.0, 0.9])
    assert curve[pairs[0, 0]] < 0.0
    assert math.cos(tau[pairs[0, 0]]) == pytest.approx(1.0)


def test_all_extrema_are_paired():
    """Those that pass first; a maximum with a maximum, a ripple that has merged with none."""
    one, other = find([0.0, 1.0, 0.4]), find([0.0, 1.2, 0.0])
    assert (len(one[0]), len(other[0])) == (4, 2)
    pairs, count, *_ = passages(*one, 1.45, *other, 1.45)
    assert (count, sorted(pairs[:, 1])) == (0, [0, 1])
    assert one[1][pairs[:, 0]].max() == pytest.approx(1.4)
    assert all((one[2][i] < 0.0) == (other[2][j] < 0.0) for i, j in pairs)
    pairs, count, *_ = passages(*one, 1.3, *other, 1.3)
    assert count == 1
    assert one[1][pairs[0, 0]] == pytest.approx(1.4)
    assert sorted(pairs[:, 1]) == [0, 1]


def test_two_that_pass_in_opposite_senses_are_both_seen():
    """e cos(tau) + cos(2 tau) has maxima 1 + e at 0 and 1 - e at pi: where e changes sign they change places.

    The number of crossings of 1 stays 2.
    """
    one, other = find([0.0, 0.1, 1.0]), find([0.0, -0.1, 1.0])
    pairs, before, after = passing(*one, 1.0, *other, 1.0)
    assert (before, after) == (2, 2)
    assert pairs.shape == (2, 2)
    assert np.cos(one[0][pairs[:, 0]]) == pytest.approx(np.cos(other[0][pairs[:, 1]]), abs=1e-12)


def test_a_shift_in_time_is_no_passage():
    """The same motion a little later: nothing passes, wherever the period begins."""
    c = np.array([0.1, 1.0, 0.4j, 0.2])
    for shift in np.linspace(0.0, 0.3, 7):
        for start in np.linspace(0.0, 6.0, 13):
            k = np.arange(4)
            a, b = c * np.exp(1j * k * start), c * np.exp(1j * k * (start + shift))
            for level in (-0.5, 0.1, 0.7):
                pairs, before, after = passing(*find(a), level, *find(b), level)
                assert pairs.size == 0
                assert before == after


def test_ripples_that_come_do_not_disturb_the_pairing():
    """A small fast component that is there at one neighbour only adds extrema, none of which passes the level."""
    smooth, rippled = np.zeros(13, complex), np.zeros(13, complex)
    smooth[1], rippled[1] = 1.0, 1.0
    rippled[12] = 0.02
    assert len(find(rippled)[0]) > len(find(smooth)[0])
    pairs, before, after = passing(*find(smooth), 0.6, *find(rippled), 0.6)
    assert pairs.size == 0
    assert before == after == 2
