"""Which eigenvalues of Hill's problem are taken, and where the selections of the literature take the wrong ones."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.floquet.hill import in_strip, most_central, same_exponents, smallest_imaginary
from suboctave.timedomain import shoot

OTHERS = ["imaginary", "symmetry"]


@pytest.fixture(scope="module")
def beside_period_doublings(at):
    """Motions on both sides of two period doublings, with their multipliers by shooting: real and negative."""
    curve = so.frequency_response(so.library.reference_oscillator(), (4.5, 2.2), harmonics=15)
    assert len(curve.bifurcations["PD"]) == 2
    chosen = []
    for doubling in curve.bifurcations["PD"]:
        for shift in (-1e-2, -1e-3, -1e-4, 1e-4, 3e-4):
            orbit = at(doubling.orbit, doubling.omega * (1.0 + shift))
            exact = shoot(orbit.system, orbit.start(), orbit.omega)
            if not exact.multipliers.imag.any() and exact.multipliers.real.max() < 0.0:
                chosen.append((orbit, exact))
    assert {exact.stable for _, exact in chosen} == {True, False}
    return chosen


def test_strip_beside_period_doublings(beside_period_doublings, distances):
    for orbit, exact in beside_period_doublings:
        result = so.stability(orbit, method=so.Hill())
        assert np.all(distances(result.multipliers, exact.multipliers) <= result.errors + 1e-9)
        assert result.stable == exact.stable


@pytest.mark.parametrize("selection", OTHERS)
def test_other_selections_fail_beside_every_period_doubling(beside_period_doublings, distances, selection):
    """Exponents come as sigma_1 +- i w / 2 and sigma_2 +- i w / 2: both rules take one pair, one multiplier twice.

    The result says so, and states no digit.
    """
    for orbit, exact in beside_period_doublings:
        result = so.stability(orbit, method=so.Hill(selection))
        assert distances(result.multipliers, exact.multipliers).max() > 0.01
        assert abs(abs(result.multipliers[0]) - abs(result.multipliers[1])) < 1e-3
        assert "takes an exponent twice" in result.note
        assert np.isinf(result.errors).all()
        assert not result.decided


def test_smallest_imaginary_parts_call_unstable_motions_stable():
    """Not a matter of digits: the verdict itself is wrong on some motions, rounding decides on which."""
    curve = so.frequency_response(so.library.reference_oscillator(), (4.5, 2.2), harmonics=15, max_step=0.01)
    first, last = sorted(b.omega for b in curve.bifurcations["PD"])
    between = [point for point in curve.points if first < point.orbit.omega < last]
    assert len(between) > 50
    assert not any(point.floquet.stable for point in between)
    wrong = [point for point in between if so.stability(point, method=so.Hill("imaginary")).stable]
    assert wrong
    # those found unstable by the strip are, by shooting
    orbit = wrong[0].orbit
    assert not shoot(orbit.system, orbit.start(), orbit.omega).stable


@pytest.mark.parametrize("selection", OTHERS)
def test_other_selections_agree_elsewhere(selection):
    """Complex pairs and positive real multipliers: all rules take the same."""
    seen = set()
    for point in so.frequency_response(so.library.duffing(), (0.3, 6.0), harmonics=15).points[::8]:
        mu = point.floquet.multipliers
        if not mu.imag.any() and mu.real.max() < 0.0:
            continue
        seen.add("complex" if mu.imag.any() else "real")
        strip, other = so.stability(point, method=so.Hill()), so.stability(point, method=so.Hill(selection))
        np.testing.assert_allclose(np.sort_complex(other.multipliers), np.sort_complex(strip.multipliers), atol=1e-9)
        assert other.note == ""
    assert seen == {"complex", "real"}


def test_an_unknown_selection_is_refused():
    with pytest.raises(InputError, match="did you mean 'strip'"):
        so.Hill(selection="stripe")


# ----------------------------------------------------------------------------------------------------- the rules alone
def ladder(exponents, harmonics, spoilt=0.3):
    """Eigenvalues as Hill's problem gives them: every exponent again and again, wrong at the ends."""
    rng = np.random.default_rng(0)
    rungs = np.arange(-harmonics, harmonics + 1)
    values = np.add.outer(np.asarray(exponents, complex), 1j * rungs)
    far = np.abs(rungs) > 0.7 * harmonics
    values[:, far] += spoilt * (rng.normal(size=(len(exponents), far.sum())) + 1j * rng.normal(size=far.sum()))
    return values.ravel()


@pytest.mark.parametrize(
    "exponents",
    [
        [-0.1 + 0.5j, -0.3 + 0.5j],
        [-0.1 + 0.499999j, -0.3 - 0.499999j],
        [0.2, -0.4],
        [-0.1 + 0.49j, -0.1 - 0.49j],
        [-0.1 + 0.2j, -0.1 - 0.2j, -0.3 + 0.3j, -0.3 - 0.3j, 0.1, -0.9],
    ],
)
def test_strip_holds_each_exponent_once(exponents):
    values = ladder(exponents, 12)
    chosen, gap = in_strip(values, 12)
    assert len(chosen) == len(exponents)
    assert gap >= 0.99 / len(exponents)
    assert same_exponents(values[chosen], np.array(exponents, complex))


def test_smallest_imaginary_parts_by_hand():
    values = np.array([1 + 3j, 2 - 0.5j, 3 + 0.1j, 4 - 2j])
    assert smallest_imaginary(values, 2).tolist() == [2, 1]
    twice = ladder([-0.1 + 0.5j, -0.3 + 0.5j], 6)
    assert not same_exponents(twice[smallest_imaginary(twice, 2)], np.array([-0.1 + 0.5j, -0.3 + 0.5j]))


def test_most_central_vectors_by_hand():
    """Waves -1, 0, 1 of one DOF: the mean harmonic of each column is 0.5, 0, -1."""
    vectors = np.array([[[0.0, 1.0, 2.0]], [[1.0, 5.0, 0.0]], [[1.0, 1.0, 0.0]]], complex)
    assert most_central(vectors, 2).tolist() == [1, 0]


def test_sets_of_exponents_are_compared_up_to_shifts():
    a = np.array([0.1 + 0.2j, 0.1 - 0.2j])
    assert same_exponents(a, a + np.array([3j, -2j]))
    assert same_exponents(a[::-1], a + 1e-3)
    assert not same_exponents(np.array([0.1 + 0.2j, 0.11 + 1.2j]), a)
    assert not same_exponents(a[:1], a)
