"""What several tests of this room share: a damper as a user would write it."""

from __future__ import annotations

import numpy as np
import pytest

from suboctave.model import AdaptiveSampling, Element


class Damper(Element):
    """f = (c + d u^2) v + c d v^3: every derivative of a law with velocity is there, and nothing is told of it."""

    coefficient_names = ("c", "d")
    depends_on_velocity = True

    def sampling(self, c):
        return AdaptiveSampling()

    def tangent(self, u, v, c):
        c, d = c
        return (c + d * u**2) * v + c * d * v**3, 2 * d * u * v, c + d * u**2 + 3 * c * d * v**2

    def curvature(self, u, v, c):
        c, d = c
        return 2 * d * v, 2 * d * u, 6 * c * d * v

    def coefficient_tangent(self, u, v, c):
        c, d = c
        f_c = [v + d * v**3, u**2 * v + c * v**3]
        f_uc = [np.zeros_like(u), 2 * u * v]
        f_vc = [1 + 3 * d * v**2, u**2 + 3 * c * v**2]
        return np.array(f_c), np.array(f_uc), np.array(f_vc)

    def coefficient_curvature(self, u, v, c):
        zero = np.zeros_like(u)
        return np.array([[zero, v**3], [v**3, zero]])


def solve(balance, omega, x=None, iterations=40):
    """Plain Newton iteration at a fixed frequency: coefficients whose residual is at rounding."""
    x = np.zeros((balance.basis.size, balance.size)) if x is None else x.copy()
    for _ in range(iterations):
        state = balance.at(x, omega)
        step = np.linalg.solve(state.jacobian, state.residual).reshape(x.shape)
        x -= step
        if np.abs(step).max() < 1e-13 * np.abs(x).max():
            return x
    raise AssertionError("Newton's method did not converge")


@pytest.fixture(name="damper", scope="session")
def _damper():
    return Damper


@pytest.fixture(name="solve", scope="session")
def _solve():
    return solve
