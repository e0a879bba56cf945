"""Equations with many more harmonics than their dense matrix is made for, against the dense matrix."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.harmonic import HarmonicBalance, HarmonicBasis
from suboctave.harmonic.finer import BorderedMotion

SYSTEMS = {
    "stop": so.System(1.0, 0.1, 1.0, [so.ElasticStop(0, 50.0, 0.4)], [so.HarmonicLoad(0, 0.5)]),
    "velocity and time": so.System.from_equations(
        "x'' + 1.5*x'**2/x + c*x'/x**2 - x**(-4) + 1/x - A*cos(omega*t)/x = 0", parameters={"c": 0.1, "A": 0.2}
    ),
    "two masses": so.System(
        np.eye(2),
        0.05 * np.eye(2),
        [[2.0, -1.0], [-1.0, 2.0]],
        [so.ElasticStop((0, 1), 30.0, 0.2), so.QuadraticDamper(coefficient=0.1, direction=[0.0, 1.0])],
        [so.HarmonicLoad(0, 0.5)],
    ),
}


def motion(system: so.System):
    """Not solved, of 40 harmonics."""
    balance = HarmonicBalance(system, HarmonicBasis(40))
    rng = np.random.default_rng(5)
    decay = np.append(0, np.repeat(np.arange(1, 41), 2))[:, None]
    x = 0.4 * rng.normal(size=(81, system.n)) / (1.0 + decay) ** 2
    x[0] = 1.6
    return balance.settle(x, 1.3).at(x, 1.3), rng


@pytest.mark.parametrize("name", SYSTEMS)
def test_products_and_solutions_are_those_of_the_dense_matrix(name):
    state, rng = motion(SYSTEMS[name])
    size = state.x.size
    column, row = state.residual_by("omega"), rng.normal(size=size + 1)
    dense = np.zeros((size + 1, size + 1))
    dense[:-1, :-1], dense[:-1, -1], dense[-1] = state.jacobian, column, row
    border = BorderedMotion(state, column, row, 12)
    v = rng.normal(size=size + 1)
    np.testing.assert_allclose(border._product(v), dense @ v, atol=1e-11 * np.abs(dense @ v).max())
    solved = border.solve(dense @ v)
    assert np.linalg.norm(dense @ solved - dense @ v) <= 1e-3 * np.linalg.norm(dense @ v)
