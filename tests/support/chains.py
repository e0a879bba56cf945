"""Chains of masses whose first natural frequency is one, and so is the mass of that vibration by the last mass."""

from __future__ import annotations

import numpy as np
import scipy.sparse


def chain_matrices(n):
    """Mass and stiffness (n, n), sparse: equal masses on equal springs, the first one held."""
    stiffness = scipy.sparse.diags_array([-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], offsets=[-1, 0, 1])
    stiffness = stiffness.tolil()
    stiffness[n - 1, n - 1] = 1.0
    # its vibrations are sines
    angle = 0.5 * np.pi / (n + 0.5)
    last = np.sin(angle * n) ** 2 / np.sum(np.sin(angle * np.arange(1, n + 1)) ** 2)
    return last * scipy.sparse.eye_array(n).tocsr(), last * stiffness.tocsr() / (2.0 * np.sin(0.5 * angle)) ** 2
