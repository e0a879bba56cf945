"""The compiled flows of batches, against closed forms, against the integration with SciPy, and against themselves."""

from __future__ import annotations

import numpy as np
import pytest
from slow import slow

import suboctave as so
from suboctave.errors import ConvergenceError, FunctionError, InputError
from suboctave.model.elements.coupled import as_coupled
from suboctave.timedomain import integrate
from suboctave.timedomain.flow import Flow

LOADS = [
    so.HarmonicLoad(0, amplitude=["p", "0.3*omega"], harmonic=[1, 3], phase=[0.0, "shift"]),
    so.StaticLoad(0, 0.2),
]
PARAMETERS = {"p": 0.8, "shift": 0.4}


class Logarithmic(so.Element):
    """An element of a user's own, which tells nothing of its law: `c sign(u) log(1 + |u|)`."""

    coefficient_names = ("c",)

    def sampling(self, c):
        from suboctave.model.elements.smoothness import AdaptiveSampling

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
    "mixture": several(2, [
        so.ElasticStop((0, 1), 6.0, 0.2), so.CubicSpring(0, 0.4), so.QuadraticDamper(1, 0.2), Logarithmic(1, [0.7]),
        so.Expression(0, "0.3*max(x - 0.3, 0)*cos(omega*t) + 0.2*sin(x)"), so.TanhFriction(1, 0.1, 0.4),
    ]),
    "seven": several(7, [so.ElasticStop((i, i + 1), 4.0, 0.15) for i in range(6)]),
}  # fmt: skip
TIMED = 1.7
#: the others take seconds each to compile when nothing is in the cache
QUICK = ("stops", "mixture")
EACH = [*QUICK, *slow(*(name for name in SYSTEMS if name not in QUICK))]


def states_for(system, count=3):
    return np.random.default_rng(5).normal(size=(count, 2 * system.n)) * 0.5


def reference(system, state, periods, omega=TIMED, values=None):
    return integrate(system, state, (0.0, periods * 2 * np.pi / omega), omega, values, rtol=1e-12).end


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_law_at_one_instant_is_that_of_arrays(name):
    system, rng = SYSTEMS[name], np.random.default_rng(3)
    for element in system.elements:
        c = element.coefficient_values(system.parameters)
        form = element.batch_form(c)
        if form.has_code:
            q, theta = rng.normal(size=(form.inputs * (1 + form.moving), 12)), rng.uniform(0.0, 6.0, 12)
            f, f_q = as_coupled(element).tangent(q, theta, c)
            numbers = form.numbers(c, element.sampling(c))
            for k in range(12):
                force, slopes = form.one_instant(*q[:, k].tolist(), theta[k], numbers)
                np.testing.assert_allclose([force, *slopes], [f[k], *f_q[:, k]], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("text", ["sqrt(x)", "abs(x**0.5)", "1/x", "exp(-800*x)"])
def test_where_a_law_has_no_real_number_the_integration_says_so(text):
    system = one(so.Expression(0, text))
    with pytest.raises(so.ConvergenceError, match="or a force is not finite"):
        integrate(system, [0.0 if "/" in text else -1.0, 0.0], (0.0, 5.0), TIMED)


@pytest.mark.parametrize("name", EACH)
def test_the_accurate_flow_is_that_of_scipy(name):
    system = SYSTEMS[name]
    x = states_for(system)
    motions = Flow(system).over(x, TIMED, 2)
    for i in range(2):
        np.testing.assert_allclose(motions.end[i], reference(system, x[i], 2), rtol=0, atol=2e-8)


@pytest.mark.parametrize("name", ["stops", *slow(*(name for name in SYSTEMS if name != "stops"))])
def test_newmark_tends_to_it_with_the_square_of_the_step(name):
    system = SYSTEMS[name]
    x = states_for(system)[0]
    exact = reference(system, x, 1)
    errors = [
        np.abs(Flow(system, "newmark", steps_per_period=n).over(x, TIMED, 1).end[0] - exact).max() for n in (160, 640)
    ]
    assert errors[1] < 2e-3
    # corners are met between two steps: their part of the error comes and goes
    assert 6.0 < errors[0] / errors[1] < 45.0


def textbook_newmark(mass, damping, stiffness, force, load, x, v, h, steps):
    """One degree of freedom, accelerations kept from step to step, Newton's method to rounding."""
    a = (load(0) - damping * v - stiffness * x - force(x)[0]) / mass
    for step in range(1, steps + 1):
        new = x
        for _ in range(50):
            acceleration = 4.0 / h**2 * (new - x) - 4.0 / h * v - a
            velocity = 2.0 / h * (new - x) - v
            f, slope = force(new)
            residual = mass * acceleration + damping * velocity + stiffness * new + f - load(step)
            new -= residual / (4.0 / h**2 * mass + 2.0 / h * damping + stiffness + slope)
        a, v, x = 4.0 / h**2 * (new - x) - 4.0 / h * v - a, 2.0 / h * (new - x) - v, new
    return np.array([x, v])


def test_newmark_is_the_method_of_the_textbook():
    system, steps, periods = SYSTEMS["stops"], 200, 5
    h = 2 * np.pi / TIMED / steps

    def force(x):
        right, left = x > 0.3, x < -0.5
        return 5.0 * (x - 0.3) * right + 3.0 * (x + 0.5) * left + 0.2 * x**3, 5.0 * right + 3.0 * left + 0.6 * x**2

    def load(step):
        t = step * h
        return 0.8 * np.cos(TIMED * t) + 0.3 * TIMED * np.cos(3 * TIMED * t + 0.4) + 0.2

    expected = textbook_newmark(1.3, 0.12, 1.1, force, load, 0.4, -0.1, h, steps * periods)
    found = Flow(system, "newmark", steps_per_period=steps).over([0.4, -0.1], TIMED, periods)
    np.testing.assert_allclose(found.end[0], expected, rtol=0, atol=1e-9)
    assert not found.unsettled.any()


def like_stops(damping, loads, alpha=0.0, gaps=(1e3, -1e3)):
    """The structure of SYSTEMS["stops"], which is compiled already, with other numbers; linear unless told."""
    elements = [so.ElasticStop(0, 5.0, gaps[0]), so.ElasticStop(0, 3.0, gaps[1]), so.CubicSpring(0, str(alpha))]
    return so.System(1.3, damping, 1.1, elements=elements, loads=loads, parameters=PARAMETERS)


SILENT = [so.HarmonicLoad(0, amplitude=["0*p", 0.0], harmonic=[1, 3], phase=[0.0, "shift"]), so.StaticLoad(0, 0.0)]


def test_the_linear_response_is_that_of_the_dynamic_stiffness():
    omega, shift = np.array([0.6, 1.9]), np.array([0.4, -1.0])
    system = like_stops(0.12, LOADS)
    motions = Flow(system).over(np.zeros(2), omega, 800, {"shift": shift}, skip=799, measure=True)
    for i, w in enumerate(omega):
        t = np.linspace(0.0, 2 * np.pi / w, 20001)
        x, v = np.full((2, len(t)), 0.2 / 1.1) * [[1.0], [0.0]]
        for k, load in ((1, 0.8), (3, 0.3 * w * np.exp(1j * shift[i]))):
            wave = load / (1.1 + 1j * k * w * 0.12 - (k * w) ** 2 * 1.3) * np.exp(1j * k * w * t)
            x, v = x + wave.real, v + (1j * k * w * wave).real
        np.testing.assert_allclose(motions.end[i], [x[0], v[0]], atol=1e-8)
        np.testing.assert_allclose(motions.peaks[i, 0], np.abs(x).max(), rtol=1e-7)


def test_energy_is_kept_without_damping():
    """The trapezoidal rule keeps that of a linear system for ever, the accurate method that of any for long."""

    def energy(y, gaps):
        stops = 2.5 * max(y[0] - gaps[0], 0) ** 2 + 1.5 * min(y[0] - gaps[1], 0) ** 2
        return 0.5 * 1.3 * y[1] ** 2 + 0.5 * 1.1 * y[0] ** 2 + stops

    x, gaps = np.array([0.2, 1.0]), (0.3, -0.5)
    end = Flow(like_stops(0.0, SILENT), "newmark", steps_per_period=20).over(x, 1.3, 2000).end[0]
    assert energy(end, (1e3, -1e3)) == pytest.approx(energy(x, (1e3, -1e3)), rel=1e-9)
    end = Flow(like_stops(0.0, SILENT, gaps=gaps)).over(x, 1.3, 200).end[0]
    assert energy(end, gaps) == pytest.approx(energy(x, gaps), rel=2e-6)
    # the error follows the tolerance
    end = Flow(like_stops(0.0, SILENT, gaps=gaps), tolerance=1e-12).over(x, 1.3, 200).end[0]
    assert energy(end, gaps) == pytest.approx(energy(x, gaps), rel=2e-8)


@pytest.mark.parametrize("method", ["accurate", "newmark"])
def test_a_trajectory_does_not_depend_on_its_company(method):
    system = SYSTEMS["stops"]
    draw = np.random.default_rng(2)
    x, omega, p = draw.normal(size=(71, 2)), draw.uniform(1.0, 2.0, 71), draw.uniform(0.2, 1.0, 71)
    flow = Flow(system, method, steps_per_period=100)
    together = flow.over(x, omega, 12, {"p": p}, skip=7, measure=True, workers=2)
    alone = flow.over(x, omega, 12, {"p": p}, skip=7, measure=True, workers=1)
    some = [3, 70, 12]
    few = flow.over(x[some], omega[some], 12, {"p": p[some]}, skip=7, measure=True)
    for one in ("states", "peaks", "end"):
        assert np.array_equal(getattr(together, one), getattr(alone, one))
        assert np.array_equal(getattr(together, one)[some], getattr(few, one))
    assert together.states.shape == (71, 5, 2)
    assert np.array_equal(together.states[:, -1], together.end)


def test_an_interruption_keeps_what_is_finished():
    flow = Flow(SYSTEMS["stops"])
    calls = []

    def report(share, where):
        calls.append(share)
        if share > 0.2:
            raise KeyboardInterrupt

    motions = flow.over(np.zeros((160, 2)), 1.7, 400, report=report, workers=1)
    assert calls == sorted(calls)
    assert 0 < motions.finished.sum() < 160
    assert np.isfinite(motions.end[motions.finished]).all()
    assert np.isnan(motions.end[~motions.finished]).all()


@pytest.mark.parametrize("speed", [-3e-5, -3e-6, 3e-5])
@pytest.mark.parametrize("side", [0.0, 1.0])
def test_a_trajectory_within_rounding_of_a_contact_goes_on(speed, side):
    """The way to the gap is less than the last digit of either displacement: no step leads there."""
    gap = np.nextafter(8.15 - 8.0, side)
    stop, load = so.ElasticStop((0, 1), 2.0, gap), so.HarmonicLoad(0, 0.1)
    flow = Flow(so.System(np.eye(2), 0.1 * np.eye(2), 0.1 * np.eye(2), [stop], [load]))
    at, beside = (flow.over([[8.15 + off, 8.0, speed, 0.0]], 1.0, 1).checked().end for off in (0.0, 1e-9))
    assert at == pytest.approx(beside, abs=1e-8)


@pytest.mark.parametrize("method", ["accurate", "newmark"])
def test_what_grows_without_bound_is_told(method):
    if method == "accurate":
        system, x = like_stops(0.0, LOADS, alpha=-1.0), [[0.0, 0.0], [5.0, 0.0]]
    else:
        system, x = like_stops(-60.0, SILENT), [[0.0, 0.0], [0.5, 0.0]]
    motions = Flow(system, method).over(x, 2.0, 10)
    assert motions.failed.tolist() == [False, True]
    with pytest.raises(ConvergenceError, match="1 of 2 trajectories"):
        motions.checked()


def test_what_an_element_raises_reaches_the_user():
    class Broken(Logarithmic):
        def tangent(self, u, v, c):
            raise ArithmeticError("no such law")

    elements = [Broken(1, [0.7]) if type(e) is Logarithmic else e for e in SYSTEMS["mixture"].elements]
    with pytest.raises(FunctionError, match=r"Broken.*tangent failed with ArithmeticError: no such law"):
        Flow(several(2, elements)).over([0.1, 0.0, 0.0, 0.0], 1.7, 1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (((np.zeros((3, 2)), [1.0, 2.0], 1)), "as many states, frequencies"),
        (([0.0, 0.0, 1.0], 1.0, 1), "shape"),
        (([0.0, np.nan], 1.0, 1), "not finite"),
        (([0.0, 0.0], -1.0, 1), "positive"),
        (([0.0, 0.0], 1.0, 0), "positive whole number"),
        (([0.0, 0.0], 1.0, 1, {"pp": 1.0}), "did you mean 'p'"),
    ],
)
def test_wrong_input_is_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        Flow(SYSTEMS["stops"]).over(*arguments)


def test_wrong_options_are_refused():
    for options, words in (
        ({"method": "newmak"}, "did you mean 'newmark'"),
        ({"tolerance": 2.0}, "1e-15 to 1e-2"),
        ({"method": "newmark", "samples": 7, "steps_per_period": 100}, "multiple of samples"),
    ):
        with pytest.raises(InputError, match=words):
            Flow(SYSTEMS["stops"], **options)


def test_beside_a_law_that_is_called_back_every_trajectory_feels_its_own_state():
    """Newmark's steps against the accurate method: an error of second order, 1e-4 with 1000 steps."""
    laws = [so.CubicSpring(0, 0.3), so.Callable(0, lambda x, v: x**3)]
    system = so.System(1.0, 0.1, 1.0, laws, [so.HarmonicLoad(0, 1.0)])
    states = np.random.default_rng(0).normal(size=(4, 2))
    accurate, newmark = (Flow(system, method, lanes=8).over(states, 1.0, 1).end for method in ("accurate", "newmark"))
    assert np.abs(accurate - newmark).max() < 5e-4
