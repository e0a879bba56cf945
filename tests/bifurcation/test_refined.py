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
