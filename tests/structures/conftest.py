"""A small frame with labelled degrees of freedom, whose natural frequencies are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse

import suboctave as so

NODES = (1042, 7, 77, 300)
LABELS = tuple((node, direction) for node in NODES for direction in ("x", "z"))


@dataclass(frozen=True)
class Chain:
    """Masses of 1 in a row between walls, in x with springs of 1 between them, in z with springs of 4."""

    mass: np.ndarray
    stiffness: np.ndarray
    labels: tuple[tuple[int, str], ...]

    @property
    def damping(self) -> np.ndarray:
        """Not symmetric: with a gyroscopic part."""
        damping = 0.02 * self.stiffness
        damping[0, 1] += 0.3
        damping[1, 0] -= 0.3
        return damping

    @property
    def omega(self) -> np.ndarray:
        """Natural frequencies of n equal masses between two walls, 2 sin(i pi / (2 (n + 1)))."""
        one = 2 * np.sin(np.arange(1, 5) * np.pi / 10)
        return np.sort(np.append(one, 2 * one))


@pytest.fixture
def chain() -> Chain:
    row = 2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1)
    return Chain(np.eye(8), np.kron(row, np.diag([1.0, 4.0])), LABELS)


@pytest.fixture
def structure(chain) -> so.Structure:
    stiffness = scipy.sparse.csr_array(chain.stiffness)
    return so.Structure(chain.mass, stiffness, dofs=so.DofMap(chain.labels), name="chain")
