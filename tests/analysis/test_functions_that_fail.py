"""A user's function that fails, or takes long: an error that names it and holds what was computed, in time."""

from __future__ import annotations

import contextlib
import signal
import time

import numpy as np
import pytest

import suboctave as so
from suboctave.model.elements.smoothness import AdaptiveSampling

RANGE = (2.5, 0.8)


class Counted:
    """The law x^3, which does something else from one call on, and may take its time."""

    __name__ = "cubic"

    def __init__(self, last=10**9, otherwise=None, pause=0.0):
        self.calls, self.last, self.otherwise, self.pause = 0, last, otherwise, pause

    def __call__(self, x, v):
        self.calls += 1
        time.sleep(self.pause)
        if self.calls > self.last:
            self.otherwise()
        return x**3


def wrong():
    raise ValueError("no such force")


def called(law):
    return so.System(1.0, 0.1, 1.0, [so.Callable(0, law)], [so.HarmonicLoad(0, "F")], parameters={"F": 0.3})


class Own(so.Element):
    """A user's element of its own; `law`: a function."""

    coefficient_names = ()

    def __init__(self, dof, law):
        super().__init__(dof)
        self.law = law

    def sampling(self, c):
        return AdaptiveSampling()

    def tangent(self, u, v, c):
        return self.law(u, v), 3.0 * u**2, None

    def curvature(self, u, v, c):
        return 6.0 * u, None, None

    def coefficient_tangent(self, u, v, c):
        return np.zeros((0, len(u))), np.zeros((0, len(u))), None

    def coefficient_curvature(self, u, v, c):
        return np.zeros((0, 0, len(u)))


def own(law):
    return so.System(1.0, 0.1, 1.0, [Own(0, law)], [so.HarmonicLoad(0, "F")], parameters={"F": 0.3})


@pytest.mark.parametrize("made", [called, own])
def test_a_law_that_fails_leaves_the_curve_as_far_as_it_came(made):
    whole = so.frequency_response(made(Counted()), RANGE)
    with pytest.raises(so.FunctionError, match="failed with ValueError: no such force") as raised:
        so.frequency_response(made(Counted(1500, wrong)), RANGE)
    part = raised.value.result
    assert 2 < len(part) < len(whole)
    # what was computed before is what is computed otherwise
    np.testing.assert_array_equal(part.omega[:-1], whole.omega[: len(part) - 1])
    assert str(part.ended).startswith(f"beyond omega = {part.omega[-1]:.6g}: ")
    assert type(raised.value.__cause__) is ValueError


@pytest.mark.parametrize("made", [called, own])
def test_a_law_that_fails_at_once_leaves_nothing(made):
    system, law = made(Counted()), Counted(0, wrong)
    element = system.elements[0]
    setattr(element, "law" if made is own else "function", law)
    for verb in (lambda: so.frequency_response(system, RANGE), lambda: so.integrate(system, omega=1.0, periods=2)):
        with pytest.raises(so.FunctionError, match="no such force") as raised:
            verb()
        assert raised.value.result is None


def test_searches_keep_what_they_have_too():
    with pytest.raises(so.FunctionError, match="no such force") as raised:
        so.bifurcation_diagram(called(Counted(1000, wrong)), RANGE)
    (branch,) = raised.value.result.branches
    assert len(branch) > 10
    law = Counted(4000, wrong)
    with pytest.raises(so.FunctionError, match="no such force") as raised:
        so.brute_force_diagram(called(law), (0.8, 1.4), values=40, workers=1)
    assert not raised.value.result.complete


def test_wrong_input_is_refused_as_such():
    """Before any work a function that fails is wrong input, whoever asks."""
    with pytest.raises(so.InputError, match="no such force"):
        called(Counted(0, wrong))


# ------------------------------------------------------------------------------------------------------- slow functions
VERBS = {
    "response": lambda system, **given: so.frequency_response(system, RANGE, **given),
    "sub-harmonics": lambda system, **given: so.find_subharmonics(system, RANGE, subharmonic=3, **given),
    "in time": lambda system, **given: so.integrate(system, omega=1.0, periods=1000, **given),
    "exponents": lambda system, **given: so.lyapunov_exponents(system, omega=1.0, **given),
    "sections": lambda system, **given: so.poincare_sections(system, omega=1.0, **given),
    "brute force": lambda system, **given: so.brute_force_diagram(system, (0.8, 1.4), values=20, workers=1, **given),
    "stepped sine": lambda system, **given: so.stepped_sine(system, (0.8, 1.4), **given),
}


@pytest.mark.parametrize("name", VERBS)
def test_a_time_limit_is_looked_at_wherever_a_slow_law_is_called(name):
    """No call of a law begins after the limit but for those that finish the result."""
    with contextlib.suppress(so.TimeLimitError):  # compiled before
        VERBS[name](called(Counted()), seconds=0.01)
    law = Counted()
    system = called(law)
    law.calls, law.pause = 0, 0.01
    with contextlib.suppress(so.TimeLimitError):
        assert VERBS[name](system, seconds=0.4).interruption is not None
    assert law.calls <= 40 + 20


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="signals")
def test_ctrl_c_reaches_a_law_that_compiled_code_calls():
    """No exception passes through C: it would be lost there."""
    law = Counted(200, lambda: signal.raise_signal(signal.SIGINT))
    diagram = so.brute_force_diagram(called(law), (0.8, 1.4), values=100, workers=1)
    assert diagram.interruption is not None
    assert not diagram.complete
