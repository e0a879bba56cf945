"""Arrays that are recovered from coordinates as they are read: every index gives what it gives of the whole array."""

from __future__ import annotations

import copy
from itertools import product

import numpy as np
import pytest

from suboctave.model.projected import Recovered

RNG = np.random.default_rng(0)
SHAPES = RNG.standard_normal((5, 2))
KEYS = [
    0, -1, slice(None), slice(1, 3), slice(None, None, -1), [0, 1], [-1, 0], (0, 1), range(2), [],
    np.array([[0, 1], [1, 0]]), [True, False, True], np.int64(1), None, Ellipsis,
]  # fmt: skip


def pair(lead, states):
    """Recovered, and the array."""
    coordinates = RNG.standard_normal((*lead, 4 if states else 2))
    whole = coordinates[..., :2] @ SHAPES.T
    whole = np.concatenate([whole, coordinates[..., 2:] @ SHAPES.T], axis=-1) if states else whole
    return Recovered(coordinates, SHAPES), whole


def taken(array, key):
    """The part of an array, or IndexError."""
    try:
        return array[key]
    except IndexError:
        return IndexError


@pytest.mark.parametrize("states", [False, True])
@pytest.mark.parametrize("lead", [(), (3,), (3, 4)])
def test_every_index_is_that_of_the_array(lead, states):
    lazy, whole = pair(lead, states)
    masks = [whole > 0.0, (whole[..., 0] > 0.0, 1), (whole[..., 0] > 0.0, None)] if lead else []
    for key in [*KEYS, *product(KEYS, KEYS), *(product(KEYS[::2], KEYS, KEYS[1::2]) if lead else ()), *masks]:
        wanted, found = taken(whole, key), taken(lazy, key)
        assert (wanted is IndexError) == (found is IndexError), key
        if wanted is not IndexError:
            assert np.shape(found) == np.shape(wanted), key
            np.testing.assert_allclose(found, wanted, atol=1e-14, err_msg=repr(key))


def test_what_else_an_array_has():
    lazy, whole = pair((3, 4), True)
    np.testing.assert_array_equal(lazy.T, np.asarray(lazy).T)
    for name in ("max", "mean", "sum", "std", "argmax", "tolist", "ravel", "copy"):
        np.testing.assert_allclose(getattr(lazy, name)(), getattr(whole, name)(), atol=1e-14)
    np.testing.assert_allclose(lazy.max(axis=-1), whole.max(axis=-1))
    np.testing.assert_allclose(np.mean(lazy, axis=0), whole.mean(axis=0))
    np.testing.assert_array_equal(copy.deepcopy(lazy).coordinates, lazy.coordinates)
    with pytest.raises(AttributeError, match="no attribute 'foo'"):
        _ = lazy.foo
    with pytest.raises(ValueError, match="read-only"):  # it would change nothing
        lazy.sort()
