"""Branches that touch rest, states of several DOFs as starts, and an interrupt in one of two directions."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.harmonic import HarmonicBalance, HarmonicBasis

STIFFNESS = np.array([[2.0, -1.0], [-1.0, 1.5]])


@pytest.fixture(scope="module")
def system():
    return so.System(
        np.eye(2),
        0.03 * STIFFNESS,
        STIFFNESS,
        elements=[so.ElasticStop(dof=1, stiffness=3.0, gap=0.4)],
        loads=[so.HarmonicLoad(dof=0, amplitude="p")],
        parameters={"p": 0.3},
    )


def test_a_state_of_two_dofs_leads_to_its_motion(system):
    """The state of a stable motion, integrated for one period, is that motion."""
    curve = so.frequency_response(system, (1.2, 2.5), harmonics=15)
    orbit = next(p.orbit for p in curve.points if p.floquet.stable and p.orbit.amplitude(1) > 0.4)
    again = so.frequency_response(system, (orbit.omega, 2.5), harmonics=15, start=orbit.start())
    np.testing.assert_allclose(again.orbits[0].coefficients, orbit.coefficients, atol=1e-8 * curve.amplitude.max())


def test_no_load_at_all_is_refused(system):
    with pytest.raises(so.InputError, match=r"zero at these parameters \(p=0\)"):
        so.frequency_response(system.with_parameters(p=0.0), (0.5, 1.5))


def test_nothing_bifurcates_at_rest():
    """With one gap closed the equations have a corner at rest; their first bifurcation comes with the motion."""
    sweep = so.continue_branch(so.library.reference_oscillator(), "p", (0.0, 2.0), omega=2.4)
    assert sweep.parameter("p")[0] == 0.0
    assert np.all(sweep.amplitude[1:] > 0.0)
    assert all(b.parameter("p") > 1e-3 for b in sweep.bifurcations)
    # the law is homogeneous but for the cubic spring: stability at a small load is that of any smaller one
    assert len(set(sweep.stable[1:4])) == 1


def test_the_rest_can_be_continued_and_verified(system):
    sweep = so.continue_branch(system, "p", (0.0, 1.0), omega=0.8)
    still = so.continue_branch(sweep.points[0], "omega", (0.5, 2.0))
    assert still.omega[-1] == 2.0
    assert np.all(still.amplitude == 0.0)
    check = so.verify(sweep.points[0])
    assert check.agrees
    assert check.distance == 0.0


def test_an_interrupt_ends_both_directions(system):
    orbit = so.frequency_response(system, (1.2, 2.5), harmonics=9).orbits[20]
    calls = 0

    def stop(_share, _where):
        nonlocal calls
        calls += 1
        if calls == 5:
            raise KeyboardInterrupt

    branch = so.continue_branch(orbit, "omega", (0.4, 2.5), progress=stop)
    assert calls == 5
    assert branch.ended.startswith("interrupted")


def test_parameters_are_taken_by_name_not_by_order():
    system = so.System(
        1.0,
        0.1,
        "a",
        elements=[so.CubicSpring(dof=0, coefficient="b")],
        loads=[so.HarmonicLoad(dof=0, amplitude=1.0)],
        parameters={"a": 1.0, "b": 2.0},
    )
    balance, x = HarmonicBalance(system, HarmonicBasis(3)), np.linspace(0.1, 0.7, 7)
    balance.at(x, 1.0, {"a": 1.0, "b": 2.0}).residual  # noqa: B018  fills what is kept from one call to the next
    other = {"b": 1.0, "a": 2.0}
    fresh = HarmonicBalance(system, HarmonicBasis(3), other).at(x, 1.0).residual
    np.testing.assert_allclose(balance.at(x, 1.0, other).residual, fresh, rtol=1e-14)
