"""Two real multipliers with product one are no Neimark-Sacker point, although they satisfy `det (Phi x Phi - I) = 0`.

The bialternate product, the usual test for a pair `exp(+- i theta)`, vanishes as well where two real multipliers are
each other's inverses (a neutral saddle). A saddle whose unstable multiplier grows from one to large values beside a
stable real one passes such points. Without damping every saddle is one: the flow preserves volume.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import suboctave as so


def duffing_beside_an_overdamped_mass():
    """DOF 0 a lightly damped Duffing oscillator, DOF 1 overdamped (real multipliers), weakly coupled."""
    eps = 0.02
    return so.System(
        np.eye(2),
        np.diag([0.1, 12.0]),
        [[1.0 + eps, -eps], [-eps, 1.0 + eps]],
        [so.CubicSpring(0, 1.0)],
        [so.HarmonicLoad(0, 0.6)],
    )


def test_product_of_real_multipliers_passes_one():
    curve = so.frequency_response(duffing_beside_an_overdamped_mass(), (0.8, 4.0))
    assert [b.kind for b in curve.bifurcations] == ["LP", "LP"]
    signs = []
    for mu in curve.multipliers:
        real = mu[np.abs(mu.imag) < 1e-9].real
        pairs = [a * b for a, b in itertools.combinations(real, 2) if max(a, b) > 1.0]
        signs.append(np.sum(np.array(pairs) > 1.0))
    assert np.count_nonzero(np.diff(signs)) >= 2, "the curve passes no neutral saddle: the test shows nothing"
    assert not curve.warnings


@pytest.mark.parametrize("damping", [0.0, 1e-8, 1e-4])
def test_oscillator_without_damping(damping):
    """Pairs stay on the unit circle (within rounding) or are real with product one: no NS anywhere, one fold."""
    curve = so.frequency_response(so.library.duffing(c=damping, F=0.3), (3.0, 0.8))
    assert np.prod(curve.multipliers, axis=1) == pytest.approx(np.exp(-damping * 2.0 * np.pi / curve.omega), abs=1e-8)
    assert [b.kind for b in curve.bifurcations] == ["LP"]
    assert curve.bifurcations[0].omega == pytest.approx(1.3307949, abs=1e-6)


def test_fold_without_damping_against_one_harmonic():
    """`(1 - omega^2) a + 3/4 a^3 = F` turns at `omega^2 = 1 + 9/4 a^2`, `3/2 a^3 = -F`."""
    curve = so.frequency_response(so.library.duffing(c=0.0, F=0.3), (3.0, 0.8), harmonics=1)
    a = (2.0 * 0.3 / 3.0) ** (1.0 / 3.0)
    (fold,) = curve.bifurcations
    assert fold.omega == pytest.approx(np.sqrt(1.0 + 2.25 * a**2), abs=1e-9)
    assert fold.amplitude == pytest.approx(a, abs=1e-7)
