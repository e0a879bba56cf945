"""Signs and sizes that are mistakes are refused; negative damping, which can be meant, is said once."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError, NegativeDampingWarning

LOADS = [so.HarmonicLoad(0, 0.3)]


def one(*elements, damping=0.1, **parameters):
    return so.System(1.0, damping, 1.0, list(elements), LOADS, parameters=parameters or None)


@pytest.mark.parametrize(
    "element",
    [
        so.ElasticStop(0, -5.0, 0.2),
        so.ElasticStop(0, -5.0, 0.2, regularization=1000.0),
        so.Freeplay(0, -2.0, 0.1),
        so.Clearance(0, -2.0, 0.1),
        so.ElasticStop(0, "-2*k", 0.2),
    ],
)
def test_what_touches_pushes_back(element):
    with pytest.raises(InputError, match=r"what touches pushes back.*Expression"):
        one(element, **({"k": 1.0} if element.coefficients[0].names else {}))


def test_a_stiffness_may_be_followed_to_zero_and_not_beyond():
    system = one(so.ElasticStop(0, "k", 0.2), k=2.0)
    start = so.frequency_response(system, (0.8, 0.81), harmonics=3).orbits[0]
    with pytest.raises(InputError, match=r"at k=-1 .*the stiffness is -1"):
        so.continue_branch(start, "k", (-1.0, 2.0))
    curve = so.continue_branch(start, "k", (0.0, 2.0), max_step=0.3)
    assert curve.parameter("k").min() == 0.0
    # without the stop: 0.3 over the linear impedance
    here = int(np.argmin(curve.parameter("k")))
    assert curve.amplitude[here] == pytest.approx(0.3 / abs(1.0 - 0.8**2 + 0.08j), rel=1e-9)
    with pytest.raises(InputError, match="pushes back"):
        system.with_parameters(k=-1.0)


def test_a_spring_that_softens_beyond_a_gap_is_a_text():
    """Of slope 1 up to 0.3 and 1/2 beyond: a spring of slope 1/2 with a preloaded stop on its left is the same."""
    text = one(so.Expression(0, "-0.5*max(x - 0.3, 0)"))
    read = so.System.from_equations("x'' + 0.1*x' + x - s*max(x - 0.3, 0) = 0.3*cos(omega*t)", {"s": 0.5})
    other = so.System(
        1.0,
        0.1,
        0.5,
        [so.ElasticStop(0, 0.5, 0.3, side="left")],
        [*LOADS, so.HarmonicLoad(0, -0.15, harmonic=0)],
    )
    assert [type(element).__name__ for element in read.elements] == ["Expression"]
    amplitudes = [so.frequency_response(system, (1.3, 1.4), harmonics=9).amplitude[0] for system in (text, read, other)]
    assert amplitudes == pytest.approx([amplitudes[2]] * 3, rel=1e-7)
    hardening = so.System.from_equations("x'' + 0.1*x' + x + s*max(x - 0.3, 0) = cos(omega*t)", {"s": 0.5})
    assert isinstance(hardening.elements[0], so.ElasticStop)


@pytest.mark.parametrize(
    ("power", "message"),
    [(1001, "larger than 1000"), (10**6, "larger than 1000"), (10**400, "a whole number of at most 18 digits")],
)
def test_powers_that_no_number_can_hold_are_refused(power, message):
    with pytest.raises(InputError, match=message):
        so.PolynomialSpring(0, {power: 1.0})
    so.PolynomialSpring(0, {1000: 1.0})


@pytest.mark.parametrize("start", [[1.0], 1.0, [[1.0]], np.ones(4), np.ones((2, 2)), np.zeros((10, 1))])
def test_starts_of_another_shape_are_refused_with_the_shapes(start):
    system = one(so.CubicSpring(0, 1.0))
    with pytest.raises(
        InputError, match=r"length 2, or coefficients of shape \(2 H \+ 1, 1\), H at least 1; got an array"
    ):
        so.frequency_response(system, (0.8, 1.2), harmonics=5, start=start)


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: one(damping=-0.1), "damping matrix"),
        (lambda: one(damping="-2*z", z=0.05), "damping matrix"),
        (lambda: so.System(np.eye(2), [[0.1, -0.3], [-0.3, 0.1]], np.eye(2), [], LOADS), "damping matrix"),
        (lambda: one(so.QuadraticDamper(0, -1.0)), "QuadraticDamper"),
        (lambda: one(so.TanhFriction(0, "-f", 0.1), f=1.0), "TanhFriction"),
    ],
)
def test_negative_damping_is_said_when_a_system_is_made(make, what):
    with pytest.warns(NegativeDampingWarning, match=what) as said:
        system = make()
    assert [warning.filename for warning in said] == [__file__]  # the line that makes the system
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name, value in system.parameters.items():
            system.with_parameters({name: 2.0 * value})


@pytest.mark.parametrize(
    ("mass", "damping"),
    [
        (np.eye(2), [[0.1, 5.0], [-5.0, 0.1]]),  # gyroscopic
        (np.eye(2), np.zeros((2, 2))),
        (np.eye(2), [[1.0, -1.0], [-1.0, 1.0]]),  # semidefinite: its zero eigenvalue is a rounding away from negative
        (np.diag([1e-6, 1e6]), [[1e-9, 0.0], [0.0, 1e3]]),
    ],
)
def test_damping_that_takes_energy_or_none_is_not_mentioned(mass, damping):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        so.System(mass, damping, np.eye(2), [], LOADS)
