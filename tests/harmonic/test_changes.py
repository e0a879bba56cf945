"""What parameters do to the forces, and the derivatives of rounded laws that share nodes, against differences."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.derivatives import third_derivative
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.perturbation import Kind, bilinear_gradient, operator

NAMES = ("k", "gap", "s", "load")


@pytest.fixture(params=[7, 12])
def state(request):
    stops = [
        so.ElasticStop(dof=(0, 1), stiffness="k", gap="gap", side="right", regularization="s"),
        so.ElasticStop(dof=(0, 1), stiffness="2*k", gap=-0.5, side="left", regularization=30.0),
        so.ElasticStop(dof=1, stiffness="k", gap="2*gap", side="right", regularization="s"),
        so.PolynomialSpring(dof=(0, 1), coefficients={3: "15*gap**2"}),
        so.Freeplay(dof=0, stiffness="k", gap="gap", regularization="s"),
        so.ElasticStop(dof=0, stiffness="k", gap="2*gap", side="right"),
        so.ElasticStop(dof=(0, 1), stiffness="k*gap", gap="-gap", side="left"),
    ]
    system = so.System(
        np.diag([1.0, 2.0]),
        0.1 * np.eye(2),
        np.array([[2.0, -1.0], [-1.0, 1.5]]),
        stops,
        [so.HarmonicLoad(dof=0, amplitude="load")],
        {"k": 3.0, "gap": 0.2, "s": 40.0, "load": 1.0},
    )
    basis = HarmonicBasis(request.param, 1)
    rng = np.random.default_rng(3)
    x = rng.standard_normal((basis.size, 2)) / (1.0 + np.arange(basis.size)[:, None]) ** 1.5
    return HarmonicBalance(system, basis).at(x, 1.3)


def _difference(state, name, value, h=1e-5):
    """Derivative of `value(state)` by a parameter, of order h^4."""
    total = 0.0
    for shift, weight in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0)):
        values = {**state.values, name: state.values[name] * (1.0 + shift * h)}
        total = total + weight * value(state.balance.at(state.x, state.omega, values))
    return total / (12.0 * h * state.values[name])


@pytest.mark.parametrize("name", NAMES)
def test_residual_by_parameters(state, name):
    expected = _difference(state, name, lambda moved: moved.residual.copy())
    assert state.residual_by(name) == pytest.approx(expected, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("kind", [Kind.INTEGER, Kind.HALF])
@pytest.mark.parametrize("name", NAMES)
def test_form_by_parameters(state, kind, name):
    rng = np.random.default_rng(5)
    left, right = rng.standard_normal((2, len(operator(state, kind))))
    expected = _difference(state, name, lambda moved: left @ operator(moved, kind) @ right)
    rates = bilinear_gradient(state, kind, left, right, (name,)).rates
    assert rates[name] == pytest.approx(expected, rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("kind", [Kind.INTEGER, Kind.HALF])
def test_gradient_of_the_form(state, kind):
    rng = np.random.default_rng(6)
    left, right = rng.standard_normal((2, len(operator(state, kind))))
    a, h = rng.standard_normal(state.x.shape), 1e-5

    def form(s):
        return left @ operator(state.balance.at(state.x + s * h * a, state.omega), kind) @ right

    expected = (8.0 * (form(1) - form(-1)) - form(2) + form(-2)) / (12.0 * h)
    found = bilinear_gradient(state, kind, left, right, ("omega",))
    assert float((found.x * a).sum()) == pytest.approx(expected, rel=1e-7)


def test_third_derivative_against_differences(state):
    a = np.random.default_rng(7).standard_normal(state.x.shape) / 10.0
    h = 1e-4

    def along(s):
        return state.balance.at(state.x + s * a, state.omega).jacobian @ a.ravel()

    expected = (along(h) - 2.0 * along(0.0) + along(-h)) / h**2
    assert third_derivative(state, a, a, a) == pytest.approx(expected, rel=1e-4, abs=1e-4 * np.abs(expected).max())
