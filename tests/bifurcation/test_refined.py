"""Bifurcations solved again with more harmonics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import suboctave as so
from suboctave.continuation.notes import Note, lines
from suboctave.curves import refine
from suboctave.curves.events.locate import Singular
from suboctave.curves.events.monitors import LIMIT_POINT
from suboctave.curves.motion import MotionProblem
from suboctave.harmonic import AdaptiveHarmonics, HarmonicBasis


def test_a_move_by_more_harmonics_is_measured_in_the_curves_own_parameter(monkeypatch):
    """At a fixed frequency a fold over the load that moves by a tenth of it is not trusted, and named by the load."""
    load = [so.HarmonicLoad(0, "F")]
    system = so.System(1.0, 0.05, 1.0, [so.CubicSpring(0, 1.0)], load, parameters={"F": 0.2})
    curve = so.continue_branch(system, "F", (0.01, 0.6), omega=1.4)
    item = curve.bifurcations["LP"][0]
    state = item.orbit.state()
    problem = MotionProblem.response(state.balance, "F", state.omega, 0.59, AdaptiveHarmonics())
    solution = Singular(state, item.null_vectors, 0.0, item.residual, 1)
    moved = state.balance.at(state.x, state.omega, {**state.values, "F": 1.5 * item.parameter("F")})
    wider = HarmonicBasis(2 * state.basis.harmonics)
    monkeypatch.setattr(refine, "choose_harmonics", lambda *_: wider)
    monkeypatch.setattr(refine, "solve_or_behind", lambda *_: replace(solution, state=moved))
    notes: list[Note] = []
    refine.solved_bifurcation(LIMIT_POINT, solution, problem, 0, notes)
    (line,) = lines(notes)
    assert line.startswith(f"LP at F = {item.parameter('F'):.9g}: too few harmonics, it moves (")
    assert np.isfinite(item.uncertainty)


def test_a_doubling_with_too_few_harmonics_is_solved_for_where_it_lies_with_more():
    """A response of 5 harmonics right behind a grazing has its doubling at 0.18207, where the multiplier of the motions
    is -1.18; by shooting it is within 1e-4 of -1 at 0.1816267.
    """
    system = so.System(
        np.diag([1.72212098, 1.90133601, 1.68477436, 1.24150018]),
        [
            [0.1772445, -0.11149915, 0, 0],
            [-0.11149915, 0.18243463, -0.03494239, 0],
            [0, -0.03494239, 0.11958068, -0.05274481],
            [0, 0, -0.05274481, 0.07624693],
        ],
        [
            [2.22603621, -1.7159445, 0, 0],
            [-1.7159445, 2.2536995, -0.5377548, 0],
            [0, -0.5377548, 1.34948456, -0.81172976],
            [0, 0, -0.81172976, 0.81172976],
        ],
        [so.ElasticStop(1, 3.92111183, -0.57777866, side="left")],
        [so.HarmonicLoad(0, 0.13081868)],
    )
    branch = so.frequency_response(system, (0.16215788, 0.19))
    first, second = branch.bifurcations["PD"]
    assert abs(first.omega - 0.1816267) < 5e-7
    assert np.abs(first.floquet.multipliers + 1.0).min() < 1e-3
    assert not branch.warnings
    assert second.omega > first.omega
