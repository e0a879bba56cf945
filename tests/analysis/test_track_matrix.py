"""Curves of bifurcations evaluated in compiled calls, against the equations' own methods."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import suboctave as so
from suboctave.analysis import tracked_curve
from suboctave.analysis.tracked_curve import TrackedCurve
from suboctave.bifurcation.augmented import SingularOperator
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.perturbation import Kind

PARAMETERS = {"k": 3.0, "gap": 0.2, "s": 300.0, "p": 1.0, "stiff": 1.5, "cubic": 0.3}
#: the parameters of each system
USED = {
    "polynomial": ("p", "stiff", "cubic"),
    "rounded": ("p", "stiff", "k", "gap", "s"),
    "corners": ("p", "stiff", "k", "gap"),
    "all": tuple(PARAMETERS),
}


def system(laws):
    """Two masses with loads and stops on both, and between them."""
    spring = so.CubicSpring(direction=[-1.0, 1.0], coefficient="cubic")
    stops = [
        so.ElasticStop(dof=0, stiffness="k", gap="gap", regularization="s"),
        so.ElasticStop(dof=0, stiffness="k", gap=-0.5, regularization="s"),
        so.Freeplay(dof=1, stiffness=1.2, gap="2*gap", regularization="2*s"),
    ]
    corners = [
        so.ElasticStop(direction=[-1.0, 1.0], stiffness="k", gap="gap"),
        so.ElasticStop(dof=1, stiffness="2*k", gap=-0.3),
    ]
    elements = {"polynomial": [spring], "rounded": stops, "corners": corners, "all": [spring, *stops, *corners]}[laws]
    return so.System(
        np.diag([1.0, 2.0]),
        0.1 * np.eye(2),
        [[2.0, -1.0], [-1.0, "stiff"]],
        elements,
        [so.HarmonicLoad(dof=0, amplitude="p")],
        {name: PARAMETERS[name] for name in USED[laws]},
    )


@cache
def curve(laws, kind, nu, names=("omega", "gap")):
    """A curve of bifurcations and a vector beside it (that no bifurcation is there does not matter)."""
    basis = HarmonicBasis(7 * nu, nu)
    x = np.random.default_rng(4).standard_normal((basis.size, 2)) / (1.0 + np.arange(basis.size)[:, None]) ** 1.5
    balance = HarmonicBalance(system(laws), basis)
    state = balance.at(x, 1.3)
    operator = SingularOperator.of(balance.at(1.02 * x, 1.31), kind)
    spans, force = (1.0,) * len(names), state.force_scale()
    found = TrackedCurve(balance, operator, names, spans, 1.3, None, 1e-5, force, 0.0, {basis: balance})
    values = [1.3 if name == "omega" else 1.01 * PARAMETERS[name] for name in names]
    return found, found.join(x, np.zeros(0), np.array(values))


def told(found, u):
    """What Newton's method and the tests of events ask for."""
    row, weights = np.linspace(0.1, 1.0, len(u)), np.linspace(1.0, 2.0, len(u))
    evaluation = found.evaluate(u)
    error = evaluation.error
    matrix = evaluation.bordered_transposed(row, weights)
    equations = evaluation.equations
    by_x, rates, by_kappa = equations.gradient
    vectors = equations.bordered.vectors
    return {
        "error": error,
        "residual": evaluation.residual,
        "matrix": matrix,
        "by_x": by_x,
        "rates": np.array([rates[name] for name in found.names]),
        "by_kappa": by_kappa,
        "right": vectors.right,
        "left": vectors.left,
    }


@pytest.mark.parametrize("kind", [Kind.INTEGER, Kind.HALF])
@pytest.mark.parametrize("nu", [1, 2])
@pytest.mark.parametrize(("laws", "name"), [(laws, name) for laws, names in USED.items() for name in names])
def test_both_ways_agree(monkeypatch, laws, nu, kind, name):
    found, u = curve(laws, kind, nu, ("omega", name))
    at_once = told(found, u)
    monkeypatch.setattr(tracked_curve, "evaluate_at_once", lambda evaluation: None)
    monkeypatch.setattr(tracked_curve, "matrix_at_once", lambda evaluation, row, weights: None)
    for key, expected in told(found, u).items():
        scale = np.abs(expected).max()
        assert at_once[key] == pytest.approx(expected, rel=1e-9, abs=1e-11 * scale), key


def test_the_matrix_is_that_of_differences():
    found, u = curve("all", Kind.HALF, 1)
    weights = np.linspace(1.0, 2.0, len(u))
    matrix = found.evaluate(u).bordered_transposed(np.ones(len(u)), weights)
    direction = np.random.default_rng(5).standard_normal(len(u)) * 0.1
    h = 1e-4
    ahead, behind, far, back = (found.evaluate(u + s * h * direction).residual for s in (1.0, -1.0, 2.0, -2.0))
    expected = (8.0 * (ahead - behind) - (far - back)) / (12.0 * h)
    got = (matrix.T @ (weights * direction))[:-1]
    assert got == pytest.approx(expected, rel=1e-5, abs=1e-6 * np.abs(expected).max())


def test_two_named_parameters_go_the_general_way():
    found, u = curve("all", Kind.HALF, 1, ("k", "gap"))
    assert np.isfinite(told(found, u)["matrix"]).all()
