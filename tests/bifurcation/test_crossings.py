"""Crossings of curves of any kind: place and directions from differences of Jacobians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import suboctave as so
from suboctave.curves.other_branch import beside_branch_point, crossing_point, other_direction


@dataclass
class At:
    residual: np.ndarray
    jacobian: np.ndarray

    @property
    def error(self):
        return float(np.abs(self.residual).max())


@dataclass
class Crossing:
    """`(x - a p) (p - b x - c x^2) = 0, y = p^2`, unknowns (x, y, p): curves that cross at the origin."""

    a: float
    b: float
    c: float

    def evaluate(self, u):
        x, y, p = u
        first, other = x - self.a * p, p - self.b * x - self.c * x**2
        along = (other - first * (self.b + 2.0 * self.c * x), 0.0, -self.a * other + first)
        return At(np.array([first * other, y - p**2]), np.array([along, (0.0, 1.0, -2.0 * p)]))

    def where(self, u):
        return f"p = {u[-1]:g}"


@pytest.mark.parametrize("curve", [Crossing(0.0, 0.0, 1.0), Crossing(0.5, 1.0, 0.3), Crossing(-0.2, 0.4, 0.0)])
def test_place_and_directions(curve):
    weights = np.array([2.0, 1.0, 0.5])
    u = crossing_point(curve, np.array([1e-4, -2e-4, 1e-4]), weights)
    assert u == pytest.approx(np.zeros(3), abs=1e-9)
    ways = [np.array([curve.a, 0.0, 1.0]), np.array([1.0, 0.0, curve.b])]
    for known, wanted in (ways, ways[::-1]):
        found = other_direction(curve, u, weights, known)
        wanted = wanted / np.linalg.norm(weights * wanted)
        assert np.linalg.norm(weights * found) == pytest.approx(1.0)
        assert abs((weights * found) @ (weights * wanted)) == pytest.approx(1.0, abs=1e-8)
    direction = other_direction(curve, u, weights, ways[0])
    ends = [beside_branch_point(curve, u, s * direction, weights, so.NewtonOptions()).u for s in (1.0, -1.0)]
    for end in ends:
        assert end[2] == pytest.approx(curve.b * end[0] + curve.c * end[0] ** 2, abs=1e-8)
    assert ends[0][0] * ends[1][0] < 0.0


def test_where_nothing_crosses():
    curve, weights = Crossing(0.0, 0.0, 1.0), np.ones(3)
    with pytest.raises(so.ConvergenceError, match="no other curve crosses"):
        other_direction(curve, np.array([0.0, 0.25, 0.5]), weights, np.array([0.0, 1.0, 1.0]))
    with pytest.raises(so.ConvergenceError, match="no crossing"):
        crossing_point(curve, np.array([0.0, 0.25, 0.5]), weights)
