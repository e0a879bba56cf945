"""Gauss's elimination block by block, against LAPACK."""

import numpy as np
import pytest

from suboctave.harmonic.elimination import eliminate


@pytest.mark.parametrize("count", [1, 5, 24, 25, 60])
@pytest.mark.parametrize("kind", [float, complex])
def test_solutions(count, kind):
    """Of a matrix whose pivots lie anywhere, within the block that is eliminated and behind it."""
    rng = np.random.default_rng(count)
    a = rng.normal(size=(count, count)).astype(kind)
    b = rng.normal(size=(count, 3)).astype(kind)
    if kind is complex:
        a += 1j * rng.normal(size=a.shape)
    a[0, 0] = 0.0 if count > 1 else 1.0
    expected, room, x = np.linalg.solve(a, b), a.copy(), b.copy()
    eliminate(room, x, count)
    np.testing.assert_allclose(x, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())
