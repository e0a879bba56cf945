"""The augmented equations of tracked curves: their derivatives against differences, for every kind and element."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation.bordered import null_vectors
from suboctave.bifurcation.normal_form import Expansion, cubic_coefficient, responding
from suboctave.continuation.linear import Factor
from suboctave.curves.kinds.branch_point import BranchPointUnfolded
from suboctave.curves.kinds.grazing import GrazingContactEquations
from suboctave.curves.kinds.singular import SingularOperator
from suboctave.curves.motion import MotionProblem
from suboctave.harmonic.perturbation import Kind

SMOOTH = so.System(
    mass=[["m", 0.0], [0.0, 1.0]],
    damping=[["c", 0.0], [0.0, 0.05]],
    stiffness=[["1 + k", "-k"], ["-k", "k"]],
    elements=[
        so.CubicSpring(dof=0, coefficient="alpha"),
        so.ElasticStop(dof=(0, 1), stiffness="Kc", gap="j", side="right", regularization=40.0),
    ],
    loads=[so.HarmonicLoad(dof=0, amplitude="p"), so.HarmonicLoad(dof=1, amplitude="0.3*p**2", harmonic=2)],
    parameters={"m": 1.3, "c": 0.1, "k": 0.7, "alpha": 0.2, "Kc": 3.0, "j": 0.1, "p": 0.8},
)
EXACT = so.System(
    mass=1.0,
    damping="c",
    stiffness=1.0,
    elements=[
        so.ElasticStop(dof=0, stiffness="Kc", gap="j", side="right"),
        so.ElasticStop(dof=0, stiffness="Kc", gap="-1 - j", side="left"),
        so.CubicSpring(dof=0, coefficient=0.2),
    ],
    loads=[so.HarmonicLoad(dof=0, amplitude="p")],
    parameters={"c": 0.1, "Kc": 3.0, "j": 0.1, "p": 0.8},
)
MOVING = so.System(
    mass=1.0,
    damping="c",
    stiffness=1.0,
    elements=[
        so.QuadraticDamper(dof=0, coefficient="q"),
        so.Expression(dof=0, expression="k*eps*cos(omega*t)*x + q*x**2*v"),
    ],
    loads=[so.HarmonicLoad(dof=0, amplitude="p")],
    parameters={"c": 0.1, "q": 0.3, "k": 1.0, "eps": 0.2, "p": 0.8},
)
CASES = [
    (SMOOTH, ("omega", "k")),
    (SMOOTH, ("omega", "Kc")),
    (SMOOTH, ("j", "p")),
    (SMOOTH, ("omega", "m")),
    (EXACT, ("omega", "Kc")),
    (EXACT, ("omega", "j")),
    (EXACT, ("p", "c")),
    (MOVING, ("omega", "q")),
    (MOVING, ("omega", "eps")),
]


def curve_at(system, names, kind, nu=1):
    """A tracked curve and a vector u of no particular motion, with rich harmonics."""
    basis = so.HarmonicBasis(6, nu)
    balance = so.HarmonicBalance(system, basis)
    rng = np.random.default_rng(3)
    x = rng.standard_normal((basis.size, balance.size)) / (1.0 + np.arange(basis.size)[:, None]) ** 1.5
    x[1] += 1.5
    omega = 1.3
    balance = balance.settle(x, omega)
    state = balance.at(x, omega)
    extra = np.zeros(0)
    if kind == "BP":
        augmentation = BranchPointUnfolded.of(state, names[0])
        extra = np.array([0.02])
    elif kind == "grazing":
        augmentation, extra = GrazingContactEquations.of(state, 0 if system is EXACT else 1, 0), np.array([0.7])
    else:
        operator = {"LP": Kind.INTEGER, "PD": Kind.HALF, "NS": Kind.FREE}[kind]
        extra = np.array([0.31 * state.rate]) if kind == "NS" else extra
        augmentation = SingularOperator.of(state, operator, float(extra.sum()))
    values = np.array([omega if name == "omega" else system.parameters[name] for name in names])
    curve = MotionProblem(balance, names, (1.0, 1.0), omega, augmentation=augmentation)
    return curve, curve.join(x, values, extra)


@pytest.mark.parametrize(
    ("system", "names", "kind"),
    [
        (system, names, kind)
        for system, names in CASES
        for kind in ("LP", "PD", "NS", "BP", "grazing")
        if kind != "grazing" or system is not MOVING  # which has no gap
    ],
)
@pytest.mark.parametrize("nu", [1, 2])
def test_jacobian_by_differences(system, names, kind, nu):
    curve, u = curve_at(system, names, kind, nu)
    jacobian = curve.evaluate(u).jacobian
    h = 1e-6
    for i in {0, 1, 2, 5, len(u) // 2, len(u) - 4, len(u) - 3, len(u) - 2, len(u) - 1}:
        step = np.zeros(len(u))
        step[i] = h
        difference = (curve.evaluate(u + step).residual - curve.evaluate(u - step).residual) / (2.0 * h)
        size = 1.0 + np.abs(jacobian).max(axis=1)
        assert np.abs(difference - jacobian[:, i]) / size == pytest.approx(0.0, abs=2e-6), i


@pytest.mark.parametrize("system", [SMOOTH, EXACT, MOVING])
def test_cubic_coefficient_of_the_general_way(system):
    curve, u = curve_at(system, ("omega", "p"), "PD")
    state = curve.evaluate(u).state
    own = Expansion.of(state, Kind.HALF, null_vectors(state, Kind.HALF), "omega")
    expected = own.cubic(Factor.of(state.jacobian).solve(-0.5 * own.squared()))[0]
    found = cubic_coefficient(state, own.phi, own.psi, own.by_motion, 0.0, responding(state))
    assert found == pytest.approx(expected, rel=1e-9)
