"""The compiled flows of batches, against closed forms, against the integration with SciPy, and against themselves."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.timedomain import integrate
from suboctave.timedomain.batch import Flow

LOADS = [
    so.HarmonicLoad(0, amplitude=["p", "0.3*omega"], harmonic=[1, 3], phase=[0.0, "shift"]),
    so.StaticLoad(0, 0.2),
]
PARAMETERS = {"p": 0.8, "shift": 0.4}


class Logarithmic(so.Element):
    """An element of a user's own, which tells nothing of its law: `c sign(u) log(1 + |u|)`."""

    coefficient_names = ("c",)

    def sampling(self, c):
        from suboctave.model.sampling import AdaptiveSampling

        return AdaptiveSampling()

    def tangent(self, u, v, c):
        return c[0] * np.sign(u) * np.log1p(np.abs(u)), c[0] / (1.0 + np.abs(u)), None

    def curvature(self, u, v, c):
        return -c[0] * np.sign(u) / (1.0 + np.abs(u)) ** 2, None, None

    def coefficient_tangent(self, u, v, c):
        raise AssertionError("not needed in time")

    def coefficient_curvature(self, u, v, c):
        raise AssertionError("not needed in time")


def one(*elements):
    return so.System(1.3, 0.12, 1.1, elements=elements, loads=LOADS, parameters=PARAMETERS)


def several(n, elements, loads=None):
    mass = np.diag(1.0 + 0.3 * np.arange(n))
    spring = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    loads = loads or [so.HarmonicLoad(n - 1, amplitude="p"), so.HarmonicLoad((0, 1), amplitude=0.2, phase="shift")]
    return so.System(mass, 0.05 * spring + 0.02 * mass, spring, elements=elements, loads=loads, parameters=PARAMETERS)


SYSTEMS = {
    "polynomial": one(so.PolynomialSpring(0, [0.0, 0.3, 0.2, 0.0, 0.05])),
    "stops": one(so.ElasticStop(0, 5.0, 0.3), so.ElasticStop(0, 3.0, -0.5), so.CubicSpring(0, 0.2)),
    "preloaded": one(so.ElasticStop(0, 5.0, -0.2, side="right")),
    "rounded": one(so.ElasticStop(0, 5.0, 0.3, regularization=80.0), so.Freeplay(0, 2.0, 0.4, regularization=50.0)),
    "play": one(so.Clearance(0, 4.0, 0.5, offset=0.1)),
    "dampers": one(so.QuadraticDamper(0, 0.3), so.TanhFriction(0, 0.2, 0.3)),
    "text": one(so.Expression(0, "0.4*x**3 + 0.2*x**2*x' + 0.5*max(x - 0.3, 0)**2 + 0.1*abs(x)*x + 0.2*sin(x)")),
    "corner text": one(so.Expression(0, "3*max(x - 0.3, 0) + 2*min(x + 0.4, 0) + 0.3*abs(x')*x'")),
    "Hertz": one(so.Expression(0, "4*max(x - 0.1, 0)**1.5")),
    "parametric": one(so.Expression(0, "0.3*x*cos(2*omega*t + 0.2) + 0.1*x**3")),
    "function": one(so.Callable(0, lambda x, v, k: k * np.sinh(x) + 0.1 * v**3, {"k": "p"})),
    "own element": one(Logarithmic(0, [0.7])),
    "two": several(2, [so.ElasticStop((0, 1), 6.0, 0.2), so.CubicSpring(0, 0.4)]),
    "coupled": several(2, [
        so.Expression(0, "0.5*x*y**2 + 0.1*x'*y", inputs={"x": 0, "y": 1}),
        so.Expression(1, "0.5*x**2*y", inputs={"x": 0, "y": 1}),
    ]),
    "direction": several(3, [
        so.ElasticStop(direction=[1.0, -0.5, 0.25], stiffness=6.0, gap=0.1), so.CubicSpring(2, 0.5),
    ]),
    "seven": several(7, [so.ElasticStop((i, i + 1), 4.0, 0.15) for i in range(6)]),
}  # fmt: skip
TIMED = 1.7


def states_for(system, count=3):
    return np.random.default_rng(5).normal(size=(count, 2 * system.n)) * 0.5


def reference(system, state, periods, omega=TIMED, values=None):
    return integrate(system, state, (0.0, periods * 2 * np.pi / omega), omega, values, rtol=1e-12).end


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_accurate_flow_is_that_of_scipy(name):
    system = SYSTEMS[name]
    x = states_for(system)
    motions = Flow(system).over(x, TIMED, 2)
    for i in range(2):
        np.testing.assert_allclose(motions.end[i], reference(system, x[i], 2), rtol=0, atol=2e-8)


@pytest.mark.parametrize("name", SYSTEMS)
def test_newmark_tends_to_it_with_the_square_of_the_step(name):
    system = SYSTEMS[name]
    x = states_for(system)[0]
    exact = reference(system, x, 1)
    steps = (160, 640) if name not in ("function", "own element") else (40, 160)
    errors = [np.abs(Flow(system, "newmark", steps_per_period=n).over(x, TIMED, 1).end[0] - exact).max() for n in steps]
    assert errors[1] < 2e-3
    # corners are met between two steps: their part of the error comes and goes
    assert 6.0 < errors[0] / errors[1] < 45.0
