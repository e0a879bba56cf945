"""What parameters do to the forces, and the derivatives of rounded laws that share nodes, against differences."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.harmonic import law_changes
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.changes import changes_by
from suboctave.harmonic.moving_laws import laws_at
from suboctave.harmonic.perturbation import Kind, bilinear_gradient, form_rates, operator
from suboctave.harmonic.quadrature import rule_tables
from suboctave.harmonic.third import third_derivative

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


@pytest.mark.parametrize("name", ["k", "s", "load"])
def test_packed_as_one_parameter_changes(state, name):
    """The laws are those of the whole set of values, bit by bit, and change by as much as they do."""
    balance = state.balance
    along = balance.laws_along(name)
    for factor in (1.3, 0.8, 1.0):
        values = {**state.values, name: factor * state.values[name]}
        told, expected = along.at(values), balance.packed_laws(values)[0]
        packed = told.packed
        for one, other in zip(packed, expected, strict=True):
            np.testing.assert_array_equal(one, other)
        changes, there = along.changes(values, told), balance.at(state.x, state.omega, values)
        spectra = np.zeros((2, len(balance.groups), balance.top + 1), dtype=complex)
        law_changes.add_changes(
            there.motions, changes.pieces, changes.first, changes.steps, changes.step_first, changes.line,
            balance.grid, np.empty((4, 0)), *packed.places, packed.step_first, *rule_tables(), *spectra,
        )  # fmt: skip
        known = {id(group): change for group, change in changes_by(there, name)}
        for g, group in enumerate(balance.groups):
            change = known.get(id(group))
            for one, of in zip(spectra[:, g], ("force", "stiffness"), strict=True):
                other = np.zeros(balance.top + 1) if change is None else getattr(change, of)
                np.testing.assert_allclose(one, other, atol=1e-12 * max(1.0, np.abs(other).max()))


@pytest.mark.parametrize(("name", "side"), [("gap", 1), ("s", 1), ("k", 1), ("gap", -1), ("s", -1)])
@pytest.mark.parametrize("exact", [True, False])
def test_laws_linear_in_a_parameter_at_once(name, side, exact):
    """As the elements tell them, closed at rest or open, beside laws without the parameter."""
    law = {} if exact else {"regularization": "s"}
    elements = [
        so.ElasticStop(dof=0, stiffness="k", gap=f"{side}*gap", side="right", **law),
        so.ElasticStop(dof=0, stiffness=2.0, gap=0.3, side="right", regularization=30.0),
        so.ElasticStop(dof=1, stiffness="2*k", gap=f"{-side}*gap", side="left", **law),
        so.Clearance(dof=1, stiffness="k", clearance="2*gap", offset="3*gap", **law),
        so.Freeplay(dof=(0, 1), stiffness=1.5, gap="0.5*gap", regularization="2*s"),
    ]
    values = {"k": 3.0, "gap": 0.2, "s": 40.0}
    system = so.System(np.eye(2), np.eye(2), np.eye(2), elements, [so.HarmonicLoad(0, 1.0)], values)
    balance = HarmonicBalance(system, HarmonicBasis(7, 1))
    along = balance.laws_along(name)
    linear = along.linear
    assert linear.value == values[name]
    packed, changes = along.room(linear)
    for factor in (1.0, 1.4, 0.3):
        there = {**values, name: factor * values[name]}
        laws_at(
            there[name] - linear.value, linear.linear, linear.rounded, packed.pieces, changes.pieces, packed.steps,
            *packed.places, packed.line, linear.rest, changes.steps, changes.line,
        )  # fmt: skip
        told = along.at(there)
        for one, other in zip(packed, told.packed, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-14, atol=1e-15)
        for one, other in zip(changes, along.changes(there, told), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-14)


def test_a_parameter_of_a_polynomial_is_not_packed(state):
    assert state.balance.laws_along("gap") is None


@pytest.mark.parametrize("kind", [Kind.INTEGER, Kind.HALF])
@pytest.mark.parametrize("name", NAMES)
def test_form_by_parameters(state, kind, name):
    rng = np.random.default_rng(5)
    left, right = rng.standard_normal((2, len(operator(state, kind))))
    expected = _difference(state, name, lambda moved: left @ operator(moved, kind) @ right)
    rates = form_rates(state, kind, left, right, (name,))
    assert rates is not None
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
