"""What curves of bifurcations compute in short ways, against the general ones, which serve all."""

import numpy as np
import pytest

import suboctave as so
from suboctave import CubicSpring, ElasticStop, HarmonicLoad, System
from suboctave.bifurcation.bordered import bordered, null_vectors
from suboctave.bifurcation.normal_form import Expansion, cubic_coefficient
from suboctave.continuation import march
from suboctave.continuation.linear import Factor, LeadingBlock
from suboctave.curves.kinds.singular import SingularOperator
from suboctave.harmonic import HarmonicBalance, HarmonicBasis
from suboctave.harmonic.derivatives import Multilinear
from suboctave.harmonic.perturbation import Kind


@pytest.fixture(params=["exact", "rounded", "fifth powers"])
def state(request):
    """A motion of two DOFs that pass their gaps."""
    stops = {
        "exact": [ElasticStop((0, 1), stiffness=4.0, gap=0.2), ElasticStop(1, stiffness=2.0, gap=-0.5, side="left")],
        "rounded": [ElasticStop((0, 1), stiffness=4.0, gap=0.2, regularization=40.0)],
        "fifth powers": [so.PolynomialSpring((0, 1), {2: 0.3, 5: 0.4})],
    }[request.param]
    system = System(
        mass=[[1.0, 0.1], [0.1, 2.0]],
        damping=[[0.06, -0.01], [0.02, 0.05]],
        stiffness=[[2.0, -1.0], [-1.0, 3.0]],
        elements=[CubicSpring(0, 0.16), *stops],
        loads=[HarmonicLoad(dof=0, amplitude="p")],
        parameters={"p": 0.5},
    )
    basis = HarmonicBasis(5)
    x = np.random.default_rng(3).normal(size=(basis.size, 2)) / (1.0 + np.arange(basis.size))[:, None]
    balance = HarmonicBalance(system, basis)
    return balance.settle(x, 0.9).at(x, 0.9)


def test_the_short_ways_are_the_general_one(state):
    b = bordered(state, Kind.HALF, null_vectors(state, Kind.HALF))
    by_motion = -b.gradient(())[0].reshape(state.x.shape)
    solve = Factor.of(state.jacobian).solve
    general = Expansion(state, Kind.HALF, b.right, b.left, 0.0, 0.0, by_motion, 0.0, 0.0, Multilinear(state))
    expected, size = general.cubic(solve(-0.5 * general.squared()))
    weights = np.linspace(1.0, 2.0, len(state.jacobian))
    block = LeadingBlock(Factor.of(state.jacobian / weights), len(weights))
    found = cubic_coefficient(state, b.right, b.left, by_motion, 0.0, lambda rhs: (block.solve(rhs) / weights, 0.0))
    assert found == pytest.approx(expected, abs=1e-12 * size)


@pytest.mark.parametrize("more", [0, 1, 2, 3])
def test_leading_blocks_by_the_factors_of_the_whole(more):
    whole = np.random.default_rng(more).normal(size=(9 + more, 9 + more))
    block, rhs = whole[:9, :9], np.arange(9.0)
    found = LeadingBlock(Factor.of(whole), 9)
    assert found.solve(rhs) == pytest.approx(np.linalg.solve(block, rhs), rel=1e-10)
    assert found.sign == np.sign(np.linalg.det(block))


@pytest.mark.parametrize("kind", [Kind.INTEGER, Kind.HALF])
def test_derivatives_of_a_motion_a_rounding_away(state, kind):
    """They are kept but for kappa, whose derivative is the motion's own."""
    operator = SingularOperator.of(state, kind)
    beside = state.balance.at(state.x * (1.0 + 1e-7), state.omega)
    names = ("omega", "p")
    kept, other, own = (operator.at(s, np.zeros(0), names) for s in (beside, state, beside))
    assert kept.takes_over(other)
    assert kept.gradient[0] is other.gradient[0]
    assert kept.gradient[1] is other.gradient[1]
    assert kept.rows == pytest.approx(own.rows, rel=1e-4, abs=1e-4 * np.abs(own.rows).max())
    size = np.abs(own.bordered.left).max() * np.abs(own.bordered.right).max()
    assert abs(kept.gradient[2] - own.gradient[2]) < 1e-13 * size
    assert not np.array_equal(kept.rows, own.rows)


def test_spared_derivatives_change_no_event(monkeypatch):
    system = so.library.reference_oscillator(p=0.55, regularization=300.0)
    doubling = so.frequency_response(system, (4.5, 3.2)).bifurcations["PD"][0]
    events = []
    for share in (march._SPARED, 0.0):
        monkeypatch.setattr(march, "_SPARED", share)
        curve = so.track(doubling, "j", (0.0, 1.0), omega=(2.1, 5.0))
        events.append([(e.kind, e.omega, e.parameter("j")) for e in curve.bifurcations])
    spared, plain = events
    assert [e[0] for e in spared] == [e[0] for e in plain] != []
    assert np.array([e[1:] for e in spared]) == pytest.approx(np.array([e[1:] for e in plain]), abs=1e-8)
