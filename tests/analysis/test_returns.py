"""A branch that folds back and leaves its range where it began names the call that follows what the other end leads to.

With one harmonic the amplitude A of x'' + c x' + x + k x^3 = F cos(omega t) solves, in closed form,

    ((1 - omega^2 + 3/4 k A^2)^2 + (c omega)^2) A^2 = F^2.
"""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so

DAMPING, CUBIC, FORCE = 0.05, -0.02, 0.2
LOW, HIGH = 0.82, 1.4


def amplitudes(omega: float, force: float) -> list[float]:
    a, b = 0.75 * CUBIC, 1.0 - omega**2
    roots = np.roots([a**2, 2.0 * a * b, b**2 + (DAMPING * omega) ** 2, -(force**2)])
    return sorted(float(np.sqrt(root.real)) for root in roots if abs(root.imag) < 1e-9 and root.real > 0.0)


def call_in(branch: so.Branch, verb: str) -> str:
    (warning,) = (text for text in branch.warnings if verb in text)
    return warning[warning.index(verb) :]


@pytest.fixture
def system() -> so.System:
    return so.System(1.0, DAMPING, 1.0, [so.CubicSpring(0, CUBIC)], [so.HarmonicLoad(0, "F")], {"F": FORCE})


def test_a_softening_response_goes_on_from_the_other_end(system):
    assert len(amplitudes(LOW, FORCE)) == 3
    branch = so.frequency_response(system, (LOW, HIGH), harmonics=1)
    assert branch.omega[0] == branch.omega[-1] == LOW
    other = eval(call_in(branch, "so.frequency_response"), {"so": so, "system": system})
    assert other.omega[0] == HIGH
    assert other.omega[-1] == LOW
    # both branches together have all motions at the end where the first one returned
    met = sorted([branch.amplitude[0], branch.amplitude[-1], other.amplitude[-1]])
    np.testing.assert_allclose(met, amplitudes(LOW, FORCE), rtol=1e-8)


def test_so_does_a_sweep_of_the_load(system):
    """F rises, falls and rises with A: from a load between its two extrema the branch of small motions returns."""
    a, b, c = 0.75 * CUBIC, 1.0 - LOW**2, (DAMPING * LOW) ** 2
    turns = np.roots([3.0 * a**2, 4.0 * a * b, b**2 + c])
    folds = np.sqrt([((b + a * t) ** 2 + c) * t for t in sorted(turns.real)])
    begin = float(folds.mean())
    branch = so.continue_branch(system, "F", (begin, 1.0), omega=LOW, harmonics=1)
    assert branch.parameter("F")[0] == branch.parameter("F")[-1] == begin
    assert branch.bifurcations["LP"][0].parameters["F"] == pytest.approx(folds[0], rel=1e-8)
    other = eval(call_in(branch, "so.continue_branch"), {"so": so, "system": system})
    assert other.parameter("F")[0] == 1.0
    np.testing.assert_allclose(other.amplitude[0], amplitudes(LOW, 1.0)[-1], rtol=1e-8)
    met = sorted([branch.amplitude[0], branch.amplitude[-1], other.amplitude[-1]])
    np.testing.assert_allclose(met, amplitudes(LOW, begin), rtol=1e-8)


def test_a_branch_that_leaves_at_the_other_end_names_no_call(system):
    assert not any("folds back" in text for text in so.frequency_response(system, (HIGH, LOW), harmonics=1).warnings)
