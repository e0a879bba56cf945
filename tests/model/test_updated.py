"""A sparse matrix with an update of low rank against the dense one."""

import pickle

import numpy as np
import pytest
import scipy.sparse
from scipy.sparse.linalg import splu

from suboctave.errors import InputError
from suboctave.model.matrices import matrix_coefficient
from suboctave.model.updated import Updated, block_diagonal, largest_entry

N, K = 9, 3


def made(seed=0, weights=(1.0, -0.5, 2.0)):
    rng = np.random.default_rng(seed)
    sparse = scipy.sparse.random_array((N, N), density=0.3, rng=rng).tocsr() + 4.0 * scipy.sparse.eye_array(N)
    return Updated(sparse.tocsr(), rng.normal(size=(N, K)), np.array(weights))


def test_it_is_the_sum_of_both():
    a, v = made(), np.random.default_rng(1).normal(size=(N, 2))
    dense, other = a.toarray(), 0.3 * scipy.sparse.eye_array(N).tocsr()
    np.testing.assert_allclose(dense, a.sparse.toarray() + a.columns @ np.diag(a.weights) @ a.columns.T)
    pairs = [
        (a @ v, dense @ v), (a @ v[:, 0], dense @ v[:, 0]), (v.T @ a, v.T @ dense), (v[:, 0] @ a, v[:, 0] @ dense),
        (a.T.toarray(), dense.T), ((2.0 * a).toarray(), 2.0 * dense), ((a * 2j).toarray(), 2j * dense),
        ((a + other).toarray(), dense + other.toarray()), ((other + a).toarray(), dense + other.toarray()),
        ((a - other).toarray(), dense - other.toarray()), ((other - a).toarray(), other.toarray() - dense),
        ((a + made(2)).toarray(), dense + made(2).toarray()), (a.diagonal(), dense.diagonal()),
        ((a - a.T).toarray(), dense - dense.T),
    ]  # fmt: skip
    for one, wanted in pairs:
        np.testing.assert_allclose(one, wanted, atol=1e-13)
    assert scipy.sparse.issparse(a - a.T)
    assert np.abs(dense).max() <= largest_entry(a)
    assert len(a.data) == a.sparse.nnz + K + N * K


@pytest.mark.parametrize("weights", [(1.0, -0.5, 2.0), (1.0, 0.0, 2.0), (0.0, 0.0, 0.0), (1j, 0.5, 2.0 - 1j)])
def test_its_equations(weights):
    a = made(weights=weights)
    right = np.random.default_rng(3).normal(size=(N, 4)).astype(a.weights.dtype)
    factors = splu(a.sparse.astype(a.weights.dtype).tocsc())
    np.testing.assert_allclose(a.toarray() @ a.factorised(factors).solve(right), right, atol=1e-12)


def test_blocks():
    a, b, c = made(), 2.0 * scipy.sparse.eye_array(2).tocsr(), made(4)
    whole = block_diagonal([a, b, c])
    wanted = scipy.sparse.block_diag([a.toarray(), b.toarray(), c.toarray()]).toarray()
    np.testing.assert_allclose(whole.toarray(), wanted, atol=1e-13)
    assert scipy.sparse.issparse(block_diagonal([b, b]))


def test_as_a_coefficient():
    a = made()
    coefficient = matrix_coefficient(a, N, "damping")
    assert coefficient.sparse
    assert not coefficient.zero
    np.testing.assert_array_equal(coefficient.value({}), a.toarray())
    shapes = np.random.default_rng(5).normal(size=(N, 4))
    np.testing.assert_allclose(coefficient.projected(shapes).value({}), shapes.T @ a.toarray() @ shapes)
    fed = coefficient.less("rate", matrix_coefficient(scipy.sparse.eye_array(N).tocsr()))
    np.testing.assert_allclose(fed.value({"rate": 0.1}), a.toarray() - 0.1 * np.eye(N))
    assert coefficient.derivative("rate") is None
    np.testing.assert_allclose(fed.derivative("rate").value({"rate": 0.1}), -np.eye(N))
    again = pickle.loads(pickle.dumps(a))
    np.testing.assert_array_equal(again.toarray(), a.toarray())


def test_what_does_not_fit():
    a = made()
    with pytest.raises(ValueError, match="do not fit"):
        Updated(a.sparse, a.columns[1:], a.weights)
    with pytest.raises(ValueError, match="do not fit"):
        Updated(a.sparse, a.columns, a.weights[1:])
    with pytest.raises(InputError, match="not finite"):
        matrix_coefficient(Updated(a.sparse, a.columns * np.nan, a.weights))
