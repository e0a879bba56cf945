"""Branch switching on curves of limit cycles: the same equations of curves that serve modes."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so


def test_a_pitchfork_of_limit_cycles():
    """van der Pol's oscillator shakes another one, which begins to move at its frequency."""
    with pytest.warns(so.NegativeDampingWarning):
        system = so.System.from_equations(
            ["x'' - 0.1*(1 - x**2)*x' + x = 0", "y'' + 0.02*y' + (p + 0.3*x**2)*y + y**3 = 0"], {"p": 1.2}
        )
    mode = so.nonlinear_mode(system, amplitude=(1.0, 2.2))
    cycle = mode.points[int(np.argmin(np.abs(mode.damping_ratio)))]
    still = so.track(cycle, "p", (0.2, 1.2), onto="limit_cycle")
    (crossing,) = still.bifurcations["BP"]
    assert np.abs(still.harmonic(1, 1)).max() < 1e-9
    moving = so.switch_branch(crossing)
    assert crossing.parameter("p") in [b.parameter("p") for b in moving.bifurcations["BP"]]
    assert np.abs(moving.harmonic(1, 1)).max() > 0.5
    assert moving.parameter("p").max() == pytest.approx(crossing.parameter("p"), abs=1e-4)
    half = so.switch_branch(crossing, side=1)
    assert half.departs.kind == "BP"
    # back onto the first curve from the point as the second has it
    (there,) = moving.bifurcations["BP"]
    back = so.switch_branch(there)
    assert np.abs(back.harmonic(1, 1)).max() < 1e-6
    # near the point y grows like the square root of the way in p
    size, way = np.abs(half.harmonic(1, 1)), crossing.parameter("p") - half.parameter("p")
    assert np.abs(np.diff(np.log(size[1:5])) / np.diff(np.log(way[1:5])) - 0.5).max() < 0.05
