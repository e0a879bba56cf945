"""Pieces of a branch along which its parameter stands still: where no contact changes, what bifurcates is linear.

A gear pair whose teeth stay in mesh obeys a Mathieu equation. Where that is about to double its period, motions of
every size exist at one frequency, up to the one whose teeth separate: no limit point lies there, whatever the sign of
a slope that is rounding.
"""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.timedomain import locate_by_shooting


def gear(mean):
    """A gear pair whose meshing stiffness varies, with backlash (Kahraman, Singh, J. Sound Vib. 146, 1991)."""
    teeth = so.Expression(0, "(1 + eps*cos(omega*t))*(max(x - 1, 0) + min(x + 1, 0))")
    parameters = {"zeta": 0.05, "eps": 0.3, "T": mean, "fa": 0.2}
    return so.System(1.0, "2*zeta", 0.0, [teeth], [so.HarmonicLoad(0, "fa", static="T")], parameters)


def trace_of_mathieu(omega, zeta=0.05, eps=0.3, steps=400):
    """Trace of the monodromy matrix of y'' + 2 zeta y' + (1 + eps cos omega t) y = 0 by Runge-Kutta."""
    h, matrix = 2.0 * np.pi / omega / steps, np.eye(2)

    def slope(t, y):
        return np.array([[0.0, 1.0], [-1.0 - eps * np.cos(omega * t), -2.0 * zeta]]) @ y

    for t in h * np.arange(steps):
        first = slope(t, matrix)
        second = slope(t + h / 2, matrix + h / 2 * first)
        third = slope(t + h / 2, matrix + h / 2 * second)
        last = slope(t + h, matrix + h * third)
        matrix = matrix + h / 6 * (first + 2 * second + 2 * third + last)
    return np.trace(matrix), np.linalg.det(matrix)


@pytest.mark.parametrize(
    ("mean", "folds"), [(0.3, [1.704283]), pytest.param(0.1, [1.883165, 1.883192], marks=pytest.mark.slow)]
)
def test_a_doubled_motion_of_a_linear_equation_has_no_limit_points(mean, folds):
    diagram = so.bifurcation_diagram(gear(mean), (2.6, 1.6), depth=1)
    response, doubled = (node.branch for node in diagram)
    ends = [b.omega for b in response.bifurcations["PD"]]
    for omega in ends:
        # a multiplier is -1 where trace and determinant add up to that
        trace, determinant = trace_of_mathieu(omega)
        assert trace + determinant == pytest.approx(-1.0, abs=1e-7)
    limits = doubled.bifurcations["LP"]
    np.testing.assert_allclose([b.omega for b in limits], folds, atol=1e-6)
    assert not any("turn back" in note or "stability is open" in note for note in doubled.warnings)
    (pieces,) = [note for note in doubled.warnings if "constant along a piece" in note]
    assert pieces.startswith(", ".join(f"omega = {omega:.9g}" for omega in ends))
    for omega in ends:
        sizes = [p.orbit.amplitude() for p in doubled.points if p.still and abs(p.orbit.omega - omega) < 1e-8]
        assert len(sizes) > 1
        assert np.ptp(sizes) > 0.01
    for item in limits:
        witness = locate_by_shooting(doubled.system, "LP", item.orbit.start(), item.omega, periods=2)
        assert item.omega == pytest.approx(witness.omega, abs=1e-7)


def test_a_parametrically_excited_mass_before_a_stop_stands_still():
    """From rest to the touch of the stop: twice the period at the main resonance, the same period at the second."""
    for eps, ends, kind in ((0.3, (2.4, 1.6), "PD"), (0.6, (1.15, 0.9), "BP")):
        springs = [so.Expression(0, "(1 + eps*cos(omega*t))*x"), so.ElasticStop(0, 5.0, 1.0)]
        system = so.System(1.0, 0.02, 0.0, springs, [], {"eps": eps})
        diagram = so.bifurcation_diagram(system, ends, depth=1)
        rest, *others = (node.branch for node in diagram)
        assert len(others) == len(rest.bifurcations[kind]) == 2
        for item, branch in zip(rest.bifurcations[kind], others, strict=True):
            assert not branch.bifurcations["LP"]
            assert all(grazing.omega == pytest.approx(item.omega, abs=1e-9) for grazing in branch.grazings)
            (note,) = [note for note in branch.warnings if "constant along a piece" in note]
            # of the same period the branch goes on through rest, to the touch on its other side
            assert note.endswith("turns back across it") is (kind == "BP")


def test_a_limit_point_at_which_a_branch_begins_is_none_of_these():
    system = so.System(1.0, 0.1, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 1.0)])
    curve = so.frequency_response(system, (0.7, 6.0), harmonics=5)
    fold = curve.bifurcations["LP"][0]
    again = so.continue_branch(fold.orbit, "omega", (0.7, 6.0))
    np.testing.assert_allclose([b.omega for b in again.bifurcations["LP"]], [b.omega for b in curve.bifurcations["LP"]])
    assert not any(point.still for point in again.points)


def test_motions_that_grow_for_ever():
    """Far beyond a stop a parametrically excited mass is bilinear: motions of every size, at the frequency at which the
    bilinear law about zero has a multiplier of one.
    """
    system = so.System.from_equations("x'' + 0.02*x' + (1+0.3*cos(omega*t))*x + 3*max(x-0.5,0) = 0", {})
    doubling = so.frequency_response(system, (2.3, 2.0)).bifurcations["PD"][0]
    branch = so.switch_branch(doubling, bounds=(1.7, 3.2), harmonics=15)
    assert "grow without bound" in branch.ended
    assert len(branch) < 1000
    assert not branch.bifurcations["LP"]
    assert branch.omega[-1] == pytest.approx(2.76284217, abs=1e-7)
