"""Parts of Hill's method by themselves, and where they end."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.floquet import hill
from suboctave.floquet.hill import Variational, two_sided
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic import HarmonicBalance, HarmonicBasis

METHODS = [so.Monodromy(), so.Hill()]
WITNESSES = METHODS[1:]
#: what the multipliers of shooting are good to themselves
SHOOTING = 1e-9
each_method = pytest.mark.parametrize("method", METHODS, ids=repr)
each_witness = pytest.mark.parametrize("method", WITNESSES, ids=repr)


def exponents(system):
    """Roots of the quadratic eigenvalue problem of a system without elements."""
    m, c, k = system.matrices()
    zero, one = np.zeros_like(m), np.eye(len(m))
    return np.linalg.eigvals(np.block([[zero, one], [-np.linalg.solve(m, k), -np.linalg.solve(m, c)]]))


# --------------------------------------------------------------------------------------------------- parts of methods
def test_linearised_motion_as_a_series(drag):
    """The Fourier series of K(t), C(t) against the tangents themselves, at instants."""
    system = so.System(
        np.diag([1.0, 4.0]), np.eye(2), np.eye(2), [so.CubicSpring((0, 1), 0.7), drag(1, [0.1, 0.2, 0.3])]
    )
    x = np.array([[0.1, 0.2], [0.5, -0.3], [0.2, 0.4]])
    state = HarmonicBalance(system, HarmonicBasis(1)).settle(x, 1.5).at(x, 1.5)
    series = Variational.of(state, 12)
    tau = np.array([0.3, 2.0])
    u = x[0] + np.outer(np.cos(tau), x[1]) + np.outer(np.sin(tau), x[2])
    v = 1.5 * (np.outer(np.cos(tau), x[2]) - np.outer(np.sin(tau), x[1]))
    weight = np.array([1.0, 2.0])
    for i in range(2):
        waves = np.where(np.arange(13) > 0, 2.0, 1.0) * np.exp(1j * np.arange(13) * tau[i])
        k = series.stiffness + np.einsum("g,gi,gj->ij", (series.k @ waves).real, series.left, series.right)
        c = series.damping + np.einsum("g,gi,gj->ij", (series.c @ waves).real, series.left, series.right)
        spring = 1.0 * 3 * 0.7 * (u[i, 0] - u[i, 1]) ** 2 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        expected = np.eye(2) + spring
        expected[1, 1] += 2 * 0.2 * u[i, 1] * v[i, 1]
        np.testing.assert_allclose(k, weight[:, None] * np.diag([1.0, 0.25]) @ expected / weight, atol=1e-10)
        drag_slope = 0.1 + 0.2 * u[i, 1] ** 2 + 3 * 0.3 * v[i, 1] ** 2
        expected = np.diag([1.0, 1.0 + drag_slope])
        np.testing.assert_allclose(c, weight[:, None] * np.diag([1.0, 0.25]) @ expected / weight, atol=1e-10)


def test_toeplitz_matrix_of_waves():
    """Entry (k, l) is the coefficient k - l of a real function."""
    g = np.array([0.5, 1.0 + 2.0j, 3.0 - 1.0j])
    matrix = two_sided(g, 1)
    assert matrix.tolist() == [[g[0], g[1].conj(), g[2].conj()], [g[1], g[0], g[1].conj()], [g[2], g[1], g[0]]]


# ------------------------------------------------------------------------------------------------ limits of methods
def test_hill_is_not_applicable_below_the_natural_frequencies(distances):
    """With too few harmonics for the highest natural frequency there is no number, but how many would do."""
    system = so.System(
        np.eye(2), 0.02 * np.eye(2), np.diag([1.0, 400.0]), [so.CubicSpring(0, 0.1)], [so.HarmonicLoad(0, 0.5)]
    )
    for harmonics in (5, 25):
        orbit = so.frequency_response(system, (1.4, 1.5), harmonics=harmonics).orbits[-1]
        result = so.stability(orbit, method="hill")
        assert not result.applicable
        assert np.isnan(result.multipliers).all()
        assert np.isinf(result.errors).all()
        assert not result.stable
        assert not result.decided
        assert "27 would do" in result.note
        assert "not applicable" in repr(result)
    orbit = so.frequency_response(system, (1.4, 1.5), harmonics=27).orbits[-1]
    result = so.stability(orbit, method="hill")
    assert result.applicable
    assert distances(result.multipliers, floquet_multipliers(orbit.state()).multipliers).max() < 1e-9


def test_a_strip_that_holds_another_number_is_no_result(monkeypatch):
    """A spurious eigenvalue inside the strip is found out."""
    honest = hill.exponents
    monkeypatch.setattr(hill, "exponents", lambda system, h: np.append(honest(system, h), -0.1 + 0.01j))
    orbit = so.frequency_response(so.library.duffing(), (2.0, 1.9), harmonics=9).orbits[-1]
    result = so.stability(orbit, method="hill")
    assert not result.applicable
    assert "3 of Hill's eigenvalues lie in a strip that must hold 2" in result.note


def test_too_large_a_problem_is_refused():
    n = 60
    k = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    system = so.System(np.eye(n), 0.05 * k, k, [so.CubicSpring(0, 0.1)], [so.HarmonicLoad(0, 0.1)])
    state = HarmonicBalance(system, HarmonicBasis(27)).at(np.zeros((55, n)), 0.3)
    for method in WITNESSES:
        result = method.multipliers(state)
        assert not result.applicable
        assert "use the monodromy matrix" in result.note


@each_witness
def test_a_motion_at_rest(method):
    """No load, no motion: the multipliers of the structure as it hangs there."""
    system = so.System(1.0, 0.1, 2.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.0)])
    result = method.multipliers(HarmonicBalance(system, HarmonicBasis(5)).at(np.zeros(11), 1.3))
    expected = np.exp(exponents(system) * 2 * np.pi / 1.3)
    assert np.abs(np.sort_complex(result.multipliers) - np.sort_complex(expected)).max() < 1e-12


@each_witness
def test_a_limit_point_itself_stays_undecided(method):
    """There the motion answers without bound to what it neglects; the estimate says so instead of a false digit."""
    curve = so.frequency_response(so.library.duffing(), (0.3, 1.0))
    assert len(curve.bifurcations["LP"]) == 2
    for point in curve.bifurcations["LP"]:
        result = so.stability(point, method=method)
        assert np.abs(result.multipliers - 1.0).min() <= result.errors[np.abs(result.multipliers - 1.0).argmin()]
        assert not result.decided
