"""Responses that leave the range where they began: diagrams go on from the other end, the call names options."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so

FORCE, DAMPING, SOFT = 0.05, 0.05, -0.4
RANGE = (0.85, 1.3)


def softening():
    return so.library.duffing(c=DAMPING, F=FORCE, alpha=SOFT)


def amplitudes(omega):
    """Of one harmonic: `a^2 [(1 - w^2 + 3/4 alpha a^2)^2 + c^2 w^2] = F^2` (Nayfeh, Mook, Nonlinear Oscillations)."""
    detuning, bend = 1.0 - omega**2, 0.75 * SOFT
    squares = np.roots([bend**2, 2.0 * bend * detuning, detuning**2 + (DAMPING * omega) ** 2, -(FORCE**2)])
    return np.sort(np.sqrt(squares[np.abs(squares.imag) < 1e-9].real))


def test_options_in_the_message():
    stepping = so.SteppingOptions(max_step=0.05)
    curve = so.frequency_response(
        softening(), RANGE, harmonics=so.AdaptiveHarmonics(minimum=3), stepping=stepping, events=()
    )
    assert f"harmonics=so.{so.AdaptiveHarmonics(minimum=3)!r}, stepping=so.{stepping!r})" in curve.warnings[-1]


def test_a_diagram_goes_on_from_the_other_end(tmp_path):
    """All three motions of the closed form at the end where it began, in the file, too."""
    diagram = so.bifurcation_diagram(softening(), RANGE, depth=1, harmonics=1)
    assert len(diagram) == len(diagram.responses) == 2
    first, other = diagram.responses
    assert [node.number for node in diagram] == [0, 1]
    assert (other.omega[0], other.omega[-1]) == (1.3, 0.85)
    met = np.sort([first.amplitude[0], first.amplitude[-1], other.amplitude[-1]])
    assert met == pytest.approx(amplitudes(RANGE[0]), rel=1e-6)
    assert diagram.legend == ["response from omega = 0.85", "response from omega = 1.3"]
    assert "1  T, omega 1.3 to omega 0.85" in repr(diagram)
    again = so.load(diagram.save(tmp_path / "both.nc"))
    assert repr(again) == repr(diagram)
    assert [node.depth for node in again] == [0, 0]
    assert again[1].origin is None
    # a motion that its user has chosen stands alone
    assert len(so.bifurcation_diagram(softening(), RANGE, depth=1, harmonics=1, start=first.orbits[0])) == 1


def test_a_response_that_runs_through_is_alone():
    assert len(so.bifurcation_diagram(softening(), (1.3, 0.5), depth=1, harmonics=1).responses) == 1


def test_parametric_excitation_folds_back_too():
    """`x'' + c x' + (1 + q cos 2wt) x + x^3 = 0`, large motions from above: they fold at w = q / (2 c) and come back.

    With one harmonic `a^2 = 4/3 (w^2 - 1 +- sqrt(q^2/4 - c^2 w^2))`: the upper one leaves the range where the lower one
    does (Nayfeh, Mook, Nonlinear Oscillations, section 5.7).
    """
    c, q, w = 0.2, 0.6, 1.3
    force = so.Expression(0, "q*cos(2*omega*t)*x + x**3")
    system = so.System(1.0, c, 1.0, elements=[force], parameters={"q": q})
    squares = 4.0 / 3.0 * (w**2 - 1.0 + np.array([-1.0, 1.0]) * np.sqrt(q**2 / 4.0 - (c * w) ** 2))
    # of phase phi: q/2 sin(2 phi) = c w
    phase = 0.5 * np.arcsin(2.0 * c * w / q)
    size = np.sqrt(squares[1])
    guesses = [
        np.array([0.0, size * np.cos(s * phase + t), size * np.sin(s * phase + t)])
        for s in (1, -1)
        for t in (0.0, 0.5 * np.pi)
    ]
    curves = []
    for guess in guesses:
        try:
            curves.append(so.frequency_response(system, (w, 2.0), harmonics=1, start=guess))
        except so.ConvergenceError:
            continue
    curve = max(curves, key=lambda found: found.amplitude[0])
    assert curve.amplitude[0] ** 2 == pytest.approx(squares[1], rel=1e-6)
    assert curve.amplitude[-1] ** 2 == pytest.approx(squares[0], rel=1e-6)
    assert [item.omega for item in curve.bifurcations["LP"]] == pytest.approx([q / (2.0 * c)], rel=1e-8)
    assert any("so.frequency_response(system, (2.0, 1.3), harmonics=1)" in note for note in curve.warnings)
