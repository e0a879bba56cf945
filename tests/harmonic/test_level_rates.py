"""How corners move with coefficients: against the derivative in closed form, in any units."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import suboctave as so
from suboctave.harmonic import HarmonicBalance
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.derivatives import Direction, second_derivative
from suboctave.model.elements.smoothness import CornerSampling


@pytest.mark.parametrize("unit", [1.0, 1e-4, 1e6])
def test_levels_of_texts_move_as_their_derivatives_say(unit):
    """`max(k x - F, 0)` has its corner at F/k, which moves by 1/k and -F/k^2."""
    system = so.System(
        1.0, 0.1, 1.0, [so.Expression(0, "max(k*x - F, 0)")], [so.HarmonicLoad(0, 1.0)],
        parameters={"k": 3.0 * unit, "F": 2.0 * unit},
    )  # fmt: skip
    (element,) = system.elements
    order = [str(name) for name in element.coefficient_names]
    rates = dict(zip(order, element.level_rates(element.coefficient_values(system.parameters))[0][0], strict=True))
    assert rates["F"] == pytest.approx(1.0 / (3.0 * unit), rel=1e-10)
    assert rates["k"] == pytest.approx(-2.0 / (9.0 * unit), rel=1e-10)


def test_levels_that_are_coefficients_move_with_them():
    stop = so.ElasticStop(0, 2.0, 0.3, regularization=1000.0)
    assert stop.level_rates(np.array([2.0, 0.3, 1000.0]))[0][0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


# --------------------------------------------------------------------------------------- corners that fall together
LAWS = {
    "two": "k*max(x - a, 0) + q*max(x - b, 0)",
    "left and right": "k*max(x - a, 0) - q*max(b - x, 0) + 0.3*abs(x - a*b/0.3)",
    "scaled": "k*max(q*x - q*a, 0) + max(k*x - 0.3*k, 0) + 0.2*abs(x - b)",
    "of velocity": "k*abs(x' - a) + q*max(x' - b, 0)*(1 + x**2)",
}


class TwoCorners(so.Element):
    """A law of a user with two corners, of which `sampling` tells the places alone."""

    coefficient_names = ("a", "b", "k")
    own_nodes = True

    def __init__(self, dof, a, b, k):
        super().__init__(dof, [a, b, k])

    def sampling(self, c):
        return CornerSampling(tuple(sorted({float(c[0]), float(c[1])})))

    def _parts(self, u, c):
        return u > c[0], u > c[1], np.zeros_like(u)

    def tangent(self, u, v, c):
        one, other, _ = self._parts(u, c)
        return c[2] * (one * (u - c[0]) + other * (u - c[1])), c[2] * (1.0 * one + other), None

    def curvature(self, u, v, c):
        return np.zeros_like(u), None, None

    def coefficient_tangent(self, u, v, c):
        one, other, none = self._parts(u, c)
        force = np.array([-c[2] * one, -c[2] * other, one * (u - c[0]) + other * (u - c[1])])
        return force, np.array([none, none, 1.0 * one + other]), None

    def coefficient_curvature(self, u, v, c):
        one, other, none = self._parts(u, c)
        return np.array([[none, none, -1.0 * one], [none, none, -1.0 * other], [-1.0 * one, -1.0 * other, none]])


def equations(element, b):
    system = so.System(
        1.0, 0.1, 1.0, [element], [so.HarmonicLoad(0, "0.1*(a + b + k + q)")],
        parameters={"a": 0.3, "b": b, "k": 1.3, "q": 2.0},
    )  # fmt: skip
    rng = np.random.default_rng(4)
    basis = HarmonicBasis(5)
    x, dx = (rng.normal(size=(basis.size, 1)) / (1 + np.arange(basis.size)[:, None]) for _ in range(2))

    def at(h=0.0, **rates):
        values = {name: value + h * rates.get(name, 0.0) for name, value in system.parameters.items()}
        return HarmonicBalance(system, basis).settle(x, 1.1).at(x, 1.1, values)

    return at, dx


def by_differences(function, step=1e-5):
    return (function(step) - function(-step)) / (2.0 * step)


@pytest.mark.parametrize("apart", [0.0, 1e-16, 1e-4, 3e-4, 0.2])
@pytest.mark.parametrize("law", [*LAWS, "of a user"])
@pytest.mark.parametrize("names", [("a", "b"), ("a", "a"), ("b", "k"), ("a", "q")])
def test_corners_that_fall_together(law, names, apart):
    """How the Jacobian changes with each place, and the force with two, against differences of them."""
    element = TwoCorners(0, "a", "b", "k") if law == "of a user" else so.Expression(0, LAWS[law])
    at, dx = equations(element, 0.3 + apart)
    state = at()
    first, second = names
    change = second_derivative(state, Direction(dx), Direction(0.0 * dx, {first: 1.0}))
    assert_allclose(change, by_differences(lambda h: at(h, **{first: 1.0}).jacobian @ dx.ravel()), atol=3e-5)
    if law == "of a user" and apart < 1e-3:  # its two corners cannot be told apart
        return
    twice = second_derivative(state, Direction(0.0 * dx, {first: 1.0}), Direction(0.0 * dx, {second: 1.0}))
    assert_allclose(twice, by_differences(lambda h: at(h, **{second: 1.0}).residual_by(first)), atol=3e-5)
