"""What several tests of this room share: a damper as a user would write it, a model condensed by direct inversion."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from suboctave.errors import InputError
from suboctave.harmonic import StructuralMatrices
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


class Condensed:
    """Flexibility form by direct inversion: `A = S`, `B = S G`, G the block of `Z^-1` at some DOFs; S is `scale I`."""

    def __init__(self, system, dofs, scale=1.0, values=None):
        self.full = StructuralMatrices(system, values)
        self.dofs = list(dofs)
        self.size = len(self.dofs)
        self.scale = scale

    def rebuilt(self, values):
        return Condensed(self.full.system, self.dofs, self.scale, values)

    def stiffness(self, frequency, order=0):
        unit = np.eye(self.size) * (self.scale if order == 0 else 0.0)
        return np.tile(unit, (len(frequency), 1, 1)).astype(complex)

    def stiffness_by(self, frequency, names, order=0):
        return None

    def compliance(self, frequency, order=0):
        return self._flexibility(frequency, ("Omega",) * order)

    def compliance_by(self, frequency, names, order=0):
        return self._flexibility(frequency, (*names, *("Omega",) * order))

    def _flexibility(self, frequency, by):
        """Product rule for Z^-1, differentiated at most twice."""
        y = np.linalg.inv(self._slope(frequency, ()))
        if not by:
            g = y
        elif len(by) == 1:
            g = -y @ self._slope(frequency, by) @ y
        else:
            g = -y @ self._slope(frequency, by) @ y
            for a, b in permutations(by):
                g = g + y @ self._slope(frequency, (a,)) @ y @ self._slope(frequency, (b,)) @ y
        return np.ascontiguousarray(self.scale * g[:, self.dofs][:, :, self.dofs])

    def _slope(self, frequency, by):
        order = by.count("Omega")
        names = tuple(name for name in by if name != "Omega")
        block = self.full.stiffness_by(frequency, names, order) if names else self.full.stiffness(frequency, order)
        return np.zeros((len(frequency), self.full.size, self.full.size)) if block is None else block

    def retain(self, direction):
        if np.delete(direction, self.dofs).any():
            raise InputError("a DOF not among the unknown ones")
        return direction[self.dofs]

    def equation_of_motion(self):
        return self.full.equation_of_motion()

    def expand(self, direction):
        result = np.zeros(self.full.size)
        result[self.dofs] = direction
        return result


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


@pytest.fixture(name="condensed", scope="session")
def _condensed():
    return Condensed


@pytest.fixture(name="solve", scope="session")
def _solve():
    return solve
