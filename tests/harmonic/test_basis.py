"""Bases: what is refused, and that every change of notation leaves the motion as it was."""

import numpy as np
import pytest

from suboctave.errors import InputError
from suboctave.harmonic import AdaptiveHarmonics, HarmonicBasis
from suboctave.harmonic.basis import spectrum_to_real, to_complex

T = np.linspace(0.0, 40.0, 301)


def motion(basis, coefficients, omega=1.3, order=0):
    """x(t) as the definition of the basis says, or its derivative."""
    rate = np.arange(1, basis.harmonics + 1) * omega / basis.nu
    shift = order * np.pi / 2
    waves = [np.cos(np.outer(T, rate) + shift), np.sin(np.outer(T, rate) + shift)]
    a, b = coefficients[1::2], coefficients[2::2]
    mean = coefficients[0] if order == 0 else 0.0
    return mean + (waves[0] * rate**order) @ a + (waves[1] * rate**order) @ b


@pytest.mark.parametrize("harmonics", [0, -3, 2.5, True, "5", None])
def test_harmonics_that_are_no_positive_whole_number_are_refused(harmonics):
    with pytest.raises(InputError, match="harmonics must be a positive whole number"):
        HarmonicBasis(harmonics)


@pytest.mark.parametrize("nu", [0, -1, 1.5, False])
def test_a_period_that_is_no_positive_whole_number_is_refused(nu):
    with pytest.raises(InputError, match="nu must be a positive whole number"):
        HarmonicBasis(5, nu)


def test_sizes_and_frequencies():
    basis = HarmonicBasis(4, 2)
    assert basis.size == 9
    np.testing.assert_array_equal(basis.multiples, [0, 0.5, 1, 1.5, 2])
    np.testing.assert_array_equal(basis.half_multiples, [0.25, 0.75, 1.25, 1.75, 2.25])
    assert basis == HarmonicBasis(np.int64(4), 2)
    assert hash(basis) == hash(HarmonicBasis(4, 2))


@pytest.mark.parametrize("nu", [1, 3])
def test_derivative_of_the_coefficients_is_that_of_the_motion(nu):
    basis = HarmonicBasis(7, nu)
    x = np.random.default_rng(1).normal(size=(basis.size, 2))
    np.testing.assert_allclose(motion(basis, 1.3 * basis.derivative(x)), motion(basis, x, order=1), atol=1e-12)


@pytest.mark.parametrize(("harmonics", "nu"), [(9, 1), (10, 2), (15, 3), (4, 4)])
def test_a_motion_stays_what_it_is_in_a_larger_basis(harmonics, nu):
    old, new = HarmonicBasis(4, 1), HarmonicBasis(harmonics * nu, nu)
    x = np.random.default_rng(2).normal(size=(old.size, 3))
    y = old.resized(x, new)
    assert y.shape == (new.size, 3)
    np.testing.assert_allclose(motion(new, y), motion(old, x), atol=1e-12)


def test_a_smaller_basis_keeps_the_lower_harmonics():
    old, new = HarmonicBasis(6, 1), HarmonicBasis(5, 2)
    x = np.random.default_rng(3).normal(size=(old.size, 1))
    y = old.resized(x, new)
    kept = x.copy()
    kept[5:] = 0.0  # of multiples 1 and 2 of omega, the basis that ends at 5/2 omega has both, and no third
    np.testing.assert_allclose(motion(new, y), motion(old, kept), atol=1e-13)
    np.testing.assert_array_equal(old.resized(old.resized(x, HarmonicBasis(9)), old), x)


def test_a_motion_cannot_be_written_in_a_shorter_period():
    with pytest.raises(InputError, match="2 load periods"):
        HarmonicBasis(4, 2).resized(np.zeros((9, 1)), HarmonicBasis(4, 3))


def test_real_and_complex_notation_against_the_discrete_fourier_transform():
    basis, omega = HarmonicBasis(6), 2 * np.pi
    x = np.random.default_rng(4).normal(size=basis.size)
    t = np.arange(32) / 32
    waves = np.exp(1j * np.outer(t, omega * np.arange(7)))
    samples = np.real(waves @ to_complex(x))
    np.testing.assert_allclose(spectrum_to_real(np.fft.rfft(samples) / 32, 6), x, atol=1e-13)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"tolerance": 1e-8, "event_tolerance": 1e-7}, "event_tolerance <= tolerance < 0.1, got 1e-07 and 1e-08"),
        ({"tolerance": 0.5}, "event_tolerance <= tolerance < 0.1, got 3e-07 and 0.5"),
        ({"event_tolerance": 0.0}, "event_tolerance must be a positive number, not 0"),
        ({"minimum": 0}, "minimum must be a positive whole number, not 0"),
        ({"minimum": 20, "maximum": 10}, "minimum <= maximum <= 511 harmonics, got 20 and 10"),
        ({"maximum": 1000}, "minimum <= maximum <= 511 harmonics, got 5 and 1000"),
    ],
)
def test_rules_for_adaptive_harmonics_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        AdaptiveHarmonics(**wrong)


@pytest.mark.parametrize("harmonics", [1, 2, 5, 6])
def test_the_even_part_is_the_mean_of_a_motion_and_its_shift_by_half_a_period(harmonics):
    """`(x(t) + x(t + T / 2)) / 2`, in the basis of half the period."""
    basis = HarmonicBasis(harmonics, 2)
    x = np.random.default_rng(harmonics).standard_normal((basis.size, 3))
    half = basis.halved
    t = np.linspace(0.0, 2.0 * np.pi, 17)

    def motion(of, coefficients):
        k = np.arange(1, of.harmonics + 1) / of.nu
        waves = np.empty((len(t), of.size))
        waves[:, 0], waves[:, 1::2], waves[:, 2::2] = 1.0, np.cos(np.outer(t, k)), np.sin(np.outer(t, k))
        return waves @ coefficients

    shifted = x.copy()
    sign = (-1.0) ** np.arange(1, harmonics + 1)[:, None]
    shifted[1::2] *= sign
    shifted[2::2] *= sign
    np.testing.assert_allclose(motion(half, basis.even_part(x)), motion(basis, (x + shifted) / 2), atol=1e-12)
    assert half.doubled.nu == 2
    with pytest.raises(InputError, match="no half"):
        _ = HarmonicBasis(3).halved
