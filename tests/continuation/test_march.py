"""The engine on plane curves with closed forms: no vibration anywhere."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from suboctave.continuation import CurvePoint, Event, March, NewtonOptions, SteppingOptions, events
from suboctave.continuation.ending import EndReason
from suboctave.continuation.events import Bracket
from suboctave.continuation.linear import Factor
from suboctave.continuation.march import Place
from suboctave.continuation.newton import correct
from suboctave.continuation.point import between, make_point, point_between
from suboctave.curves.events.monitors import position
from suboctave.errors import ConvergenceError, InputError

NEWTON = NewtonOptions()


@dataclass
class Evaluated:
    residual: np.ndarray
    jacobian: np.ndarray

    @property
    def error(self):
        return float(np.abs(self.residual).max())


@dataclass
class Plane:
    """`f(x, parameter) = 0` in the plane; u = (x, parameter), no scaling."""

    f: object
    gradient: object
    parameter: int = 1
    copies: tuple = ((1, 1),)
    calls: list = field(default_factory=list)

    def evaluate(self, u):
        self.calls.append(u.copy())
        return Evaluated(np.array([self.f(*u)]), np.array([self.gradient(*u)]))

    def weights(self, u, largest):
        return np.ones(2)

    def size(self, u):
        return abs(u[0])

    def adapted(self, u, evaluation):
        return self

    def transfer(self, u, origin):
        return u

    def images(self, u):
        return [u * copy for copy in self.copies]

    def unwrapped(self, u, near):
        return u

    def where(self, u):
        return f"p = {u[1]:.6g}"


def circle(**options):
    return Plane(lambda x, p: x**2 + p**2 - 1.0, lambda x, p: (2 * x, 2 * p), **options)


def cubic():
    """p = x - x^3: folds at x = +-1/sqrt(3), p = +-2/(3 sqrt(3))."""
    return Plane(lambda x, p: p - x + x**3, lambda x, p: (3 * x**2 - 1.0, 1.0))


def solve_at(curve, u):
    return correct(curve, u, curve.parameter, curve.weights(u, 0.0), NEWTON)


def start(curve, x, p):
    return make_point(solve_at(curve, np.array([x, p])), None, 0.0)


def march(curve, x, p, direction, bounds, inspect=None, **stepping):
    engine = March(start(curve, x, p), direction, bounds, NEWTON, SteppingOptions(**stepping), inspect)
    points = list(engine)
    return engine, points, np.array([point.u for point in points])


@pytest.mark.parametrize("max_step", [0.02, 0.05, 0.3])
def test_s_curve_between_its_bounds(max_step):
    """Both folds are passed, the ends are met exactly, every point lies on the curve, no step is too long."""
    engine, points, u = march(cubic(), 1.4, -1.3, 1.0, (-1.344, 1.344), max_step=max_step)
    x, p = u.T
    assert p[0] == -1.3
    assert p[-1] == 1.344
    np.testing.assert_allclose(p, x - x**3, atol=1e-9)
    assert np.all(np.diff(x) < 0.0)
    steps = np.linalg.norm(np.diff(u, axis=0), axis=1)
    assert steps.max() <= max_step * (1 + 1e-6)
    np.testing.assert_allclose(np.diff([point.arclength for point in points]), steps, rtol=1e-9)
    assert p.max() == pytest.approx(1.344)
    fold = 2 / (3 * math.sqrt(3))
    assert p[x > -0.5].max() == pytest.approx(fold, abs=max_step**2)
    assert (engine.ended, engine.closed) == ("reached the end of the range at p = 1.344", False)
    # the tangent is the curve's, of unit length, and goes ahead
    for point in points:
        t = np.array([-1.0, -(1 - 3 * point.u[0] ** 2)])
        np.testing.assert_allclose(point.tangent, t / np.linalg.norm(t), atol=1e-7)
        # [F_u; t] has a determinant of one sign all along: no branch point
        assert point.orientation == points[0].orientation != 0.0


def test_the_other_way_ends_on_the_lower_bound():
    engine, points, u = march(cubic(), -1.4, 1.3, -1.0, (-1.344, 1.344))
    assert u[-1, 1] == -1.344
    assert engine.ended.endswith("p = -1.344")
    assert len(points) > 50


def test_bounds_inside_a_fold():
    """A bound that the curve crosses before its fold, and one just short of touching it."""
    fold = 2 / (3 * math.sqrt(3))
    _, _, u = march(cubic(), 0.0, 0.0, 1.0, (-0.2, 0.3))
    assert u[-1, 1] == 0.3
    assert u[-1, 0] == pytest.approx(np.sort(np.roots([-1, 0, 1, -0.3]))[1], abs=1e-9)
    _, _, u = march(cubic(), 0.0, 0.0, 1.0, (-0.2, fold + 1e-6), max_step=0.05)
    assert u[-1, 1] == -0.2
    assert u[-1, 0] > 1.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("max_step", [0.05, 0.3])
def test_a_circle_closes(direction, max_step):
    engine, points, u = march(circle(), 0.6, 0.8, direction, (-2.0, 2.0), max_step=max_step)
    assert engine.closed
    assert engine.ended == "the curve closed on itself"
    np.testing.assert_array_equal(u[0], u[-1])
    # once around: chords add up to a little less than 2 pi
    assert points[-1].arclength == pytest.approx(2 * np.pi, rel=max_step**2 / 10)
    assert (u[1, 1] - u[0, 1]) * direction > 0
    np.testing.assert_allclose(np.hypot(*u.T), 1.0, atol=1e-9)


@pytest.mark.parametrize(("copy", "length"), [((-1, -1), np.pi), ((-1, 1), 2 * np.pi)])
def test_images_of_the_start_count_as_the_start(copy, length):
    """Where u and -u are one solution the circle is closed after half a turn. The mirror image of the start is passed
    in the wrong direction, so that the whole circle is needed.
    """
    engine, points, _ = march(circle(copies=((1, 1), copy)), 0.6, 0.8, 1.0, (-2.0, 2.0))
    assert engine.closed
    assert points[-1].arclength == pytest.approx(length, rel=1e-3)


def test_a_closed_loop_cut_by_the_bounds_does_not_close():
    engine, _, u = march(circle(), 1.0, 0.0, 1.0, (-0.5, 2.0))
    assert not engine.closed
    assert u[-1, 1] == -0.5
    assert u[-1, 0] == pytest.approx(-math.sqrt(0.75), abs=1e-9)


def test_a_figure_of_eight_does_not_close_at_its_crossing():
    """Lemniscate (x^2 + p^2)^2 = x^2 - p^2, from near the crossing: it passes its start's neighbourhood on the other
    branch, and closes when it is back on its own. At the crossing the determinant [F_u; t] changes sign.
    """

    def f(x, p):
        return (x**2 + p**2) ** 2 - x**2 + p**2

    def gradient(x, p):
        return 4 * x * (x**2 + p**2) - 2 * x, 4 * p * (x**2 + p**2) + 2 * p

    angle = 0.7
    r = math.sqrt(math.cos(2 * angle))
    engine, points, u = march(
        Plane(f, gradient), r * math.cos(angle), r * math.sin(angle), -1.0, (-2, 2), max_step=0.06
    )
    assert engine.closed
    # length of the lemniscate: 5.2441151 (Gauss's constant)
    assert points[-1].arclength == pytest.approx(5.244115108584239, rel=2e-3)
    signs = np.array([point.orientation for point in points])
    assert np.count_nonzero(np.diff(signs)) == 2
    assert u[:, 0].min() < -0.99 < 0.99 < u[:, 0].max()


def test_inspection_may_ask_for_shorter_steps():
    """Refused steps are halved, and taken all the same once they are as short as allowed."""
    seen = []

    def inspect(a, b):
        seen.append(np.linalg.norm(b.u - a.u))
        return seen[-1] < 0.011

    _, _, u = march(cubic(), 0.2, 0.192, 1.0, (-0.2, 0.3), inspect, max_step=0.05)
    assert np.linalg.norm(np.diff(u, axis=0), axis=1)[:-1].max() < 0.011
    assert max(seen) > 0.011
    _, points, _ = march(cubic(), 0.2, 0.192, 1.0, (-0.2, 0.3), lambda a, b: False, min_step=1e-3, max_step=0.05)
    assert len(points) > 90


def test_no_way_on_is_said_with_the_place():
    """A curve that ends in the plane: x = sqrt(1 - p) exists for p <= 1 only and is taken with its positive sign, so
    that its tangent points out of what there is.
    """

    def f(x, p):
        return x - (math.sqrt(1.0 - p) if p < 1.0 else math.nan)

    def gradient(x, p):
        return 1.0, 0.5 / math.sqrt(1.0 - p) if p < 1.0 else math.nan

    engine, _, u = march(Plane(f, gradient), 1.0, 0.0, 1.0, (-1.0, 2.0))
    assert not engine.closed
    assert engine.ended.startswith("step size fell below 1e-07 at p = ")
    assert "min_step" in engine.ended
    assert u[-1, 1] == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(u[:, 0], np.sqrt(1 - u[:, 1]), atol=1e-8)


def test_too_many_points_is_said():
    engine, points, _ = march(circle(), 0.6, 0.8, 1.0, (-2.0, 2.0), max_points=10)
    assert len(points) == 10
    assert engine.ended.startswith("10 points computed at p = ")
    assert "max_points" in engine.ended


def test_an_abandoned_march_says_so():
    engine = March(start(circle(), 0.6, 0.8), 1.0, (-2.0, 2.0), NEWTON, SteppingOptions())
    assert engine.ended == "not started"


# -------------------------------------------------------------------------------------------------- pieces
def test_points_between_neighbours():
    """Hermite interpolation is of fourth order in the distance, the corrected point lies on the curve."""
    curve = circle()
    errors = []
    for step in (0.4, 0.2):
        ends = []
        for angle in (0.3, 0.3 + step):
            ends.append(start(curve, math.cos(angle), math.sin(angle)))
        a, b = (CurvePoint(curve, e.u, np.array([-e.u[1], e.u[0]]), e.weights, e.evaluation, 1.0, 0.0, 0) for e in ends)
        errors.append(abs(np.linalg.norm(between(a, b, 0.4)) - 1.0))
        corrected = point_between(a, b, 0.4, NEWTON)
        assert np.linalg.norm(corrected.u) == pytest.approx(1.0, abs=1e-10)
        np.testing.assert_array_equal(between(a, b, 0.0), a.u)
        np.testing.assert_array_equal(between(a, b, 1.0), b.u)
    assert errors[0] / errors[1] > 12


def located(a, b, values, function):
    bracket = Bracket(a, b, values, function, NEWTON)
    return bracket.points[bracket.zero()]


def test_a_zero_along_the_curve():
    _, points, _ = march(cubic(), 1.2, 1.2 - 1.2**3, 1.0, (-2.0, 2.0))

    def height(point):
        return point.u[0] - 0.123

    at = next(i for i in range(len(points)) if height(points[i + 1]) < 0)
    a, b = points[at : at + 2]
    zero = located(a, b, (height(a), height(b)), height)
    assert zero.u[0] == pytest.approx(0.123, abs=1e-11)
    assert zero.u[1] == pytest.approx(0.123 - 0.123**3, abs=1e-10)
    assert a.arclength < zero.arclength < b.arclength
    assert located(a, b, (0.0, 1.0), height) is a
    assert located(a, b, (1.0, 0.0), height) is b


@pytest.mark.parametrize("astray", [1, 4])
def test_a_point_of_another_curve_is_no_point_between(astray, monkeypatch):
    """Two lines, x = 0 and x = 9: what Newton's method finds on the second is not taken for the first."""
    lines = Plane(lambda x, p: x * (x - 9.0), lambda x, p: (2.0 * x - 9.0, 0.0))
    a, b = start(lines, 0.0, 0.0), start(lines, 0.0, 1.0)
    calls = []

    def led_astray(curve, guess, *arguments):
        calls.append(guess)
        return correct(curve, guess + (9.0, 0.0) if len(calls) <= astray else guess, *arguments)

    monkeypatch.setattr(events, "correct", led_astray)
    bracket = Bracket(a, b, (-0.25, 0.75), lambda point: point.u[1] - 0.25, NEWTON)
    if astray == 4:
        with pytest.raises(ConvergenceError, match="left the curve"):
            bracket.zero()
    else:
        assert bracket.points[bracket.zero()].u == pytest.approx([0.0, 0.25])


@pytest.mark.parametrize("power", [1, 3, 9])
def test_a_flat_or_steep_function_has_its_zero_too(power):
    """Located to a value of 1e-14 of those at the ends, or to rounding along the curve."""
    curve = cubic()
    a, b = start(curve, -0.3, -0.273), start(curve, 0.5, 0.375)

    def function(point):
        return (point.u[0] - 0.1) ** power

    zero = located(a, b, (function(a), function(b)), function)
    assert zero.u[0] == pytest.approx(0.1, abs=2e-2 if power > 3 else 1e-4 if power > 1 else 1e-11)


def test_newton_converges_quadratically_and_stops_when_it_may():
    curve = circle()
    solved = solve_at(curve, np.array([0.9, 0.6]))
    assert solved.u == pytest.approx([0.8, 0.6], abs=1e-12)
    assert solved.u[1] == 0.6
    assert solved.iterations <= 5
    assert solved.distance == pytest.approx(0.1, rel=1e-9)
    assert solve_at(curve, solved.u).iterations == 0


@pytest.mark.parametrize(
    ("guess", "message"),
    [
        ([0.3, 1.5], r"did not converge near p = 1\.5 \(residual .* after \d+ iterations\)"),
        ([np.nan, 0.5], "not finite"),
    ],
)
def test_newton_gives_up_with_the_place(guess, message):
    row = np.array([0.0, 1.0])
    with pytest.raises(ConvergenceError, match=message):
        correct(circle(), np.array(guess), row, np.ones(2), NEWTON)


def test_newton_that_goes_to_and_fro_is_given_up_at_once():
    """`sgn(x) sqrt|x|`: every correction leads from x to -x. Slower than quadratic is not nowhere: a double root."""
    row = np.array([0.0, 1.0])
    curve = Plane(lambda x, p: math.copysign(math.sqrt(abs(x)), x), lambda x, p: (0.5 / math.sqrt(abs(x)), 0.0))
    with pytest.raises(ConvergenceError, match="after 2 iterations"):
        correct(curve, np.array([0.3, 0.0]), row, np.ones(2), NEWTON)
    assert len(curve.calls) == 3
    double = Plane(lambda x, p: x**2, lambda x, p: (2.0 * x, 0.0))
    solved = correct(double, np.array([0.3, 0.0]), row, np.ones(2), NewtonOptions(iterations=40))
    assert abs(solved.u[0]) < 1e-5


@pytest.mark.parametrize("kind", [float, complex])
def test_factor_solves_and_knows_the_determinant(kind):
    rng = np.random.default_rng(0)
    for n in (1, 2, 7, 30):
        a = rng.normal(size=(n, n)) + (1j * rng.normal(size=(n, n)) if kind is complex else 0.0)
        b = rng.normal(size=n).astype(a.dtype)
        factor = Factor.of(np.asfortranarray(a))
        np.testing.assert_allclose(a @ factor.solve(b), b, atol=1e-10)
        np.testing.assert_allclose(a.conj().T @ factor.solve(b, adjoint=True), b, atol=1e-10)
        sign, log = np.linalg.slogdet(a)
        assert factor.log_determinant == pytest.approx(log, abs=1e-10)
        if kind is float:
            assert factor.sign == sign
    assert Factor.of(np.zeros((2, 2))).singular
    assert Factor.of(np.zeros((2, 2))).sign == 0.0


# ------------------------------------------------------------------------------------------------ refusals
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"initial_step": 0.0}, "initial_step must be a positive number, not 0"),
        ({"min_step": 0.1, "initial_step": 0.01}, "min_step=0.1"),
        ({"max_step": math.inf}, "max_step must be a positive number, not inf"),
        ({"max_step": 1e-9}, "max_step=1e-09"),
        ({"angle": 2.0}, "angle=2.0"),
        ({"deviation": -1.0}, "deviation must be a positive number, not -1"),
        ({"max_points": 1}, "max_points=1"),
    ],
)
def test_stepping_options_that_make_no_sense(wrong, message):
    with pytest.raises(InputError, match=message):
        SteppingOptions(**wrong)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"tolerance": 0.0}, "tolerance must be a positive number, not 0"),
        ({"tolerance": 1.0}, r"out of range: .*; tolerance in \(0, 1e-2\)"),
        ({"correction": -1.0}, "correction must be a positive number, not -1"),
        ({"iterations": 0}, "iterations must be a positive whole number, not 0"),
    ],
)
def test_newton_options_that_make_no_sense(wrong, message):
    with pytest.raises(InputError, match=message):
        NewtonOptions(**wrong)


def test_events_that_make_no_sense():
    with pytest.raises(InputError, match="name must be a text that is not empty"):
        Event("", abs)
    with pytest.raises(InputError, match="function must be a function of 1 argument, not 3"):
        Event("peak", 3.0)


@dataclass
class IntoCircle(Plane):
    """The line x = 1 that goes over to the unit circle where both touch: as steps do between neighbouring branches."""

    def adapted(self, u, evaluation):
        return circle() if u[1] > -0.01 else self


def test_going_round_and_round_without_passing_the_start():
    """The march says so instead of going round until its points are used up."""
    line = IntoCircle(lambda x, p: x - 1.0, lambda x, p: (1.0, 0.0))
    engine, points, u = march(line, 1.0, -2.0, 1.0, (-3.0, 3.0), max_step=0.05)
    assert not engine.closed
    assert "without passing its start" in engine.ended
    assert np.abs(u[-1]).max() <= 1.001
    assert len(points) < 1100


@pytest.mark.parametrize("max_step", [0.05, 0.2, 0.3])
@pytest.mark.parametrize("start", [0.5, 0.55, 0.6, 0.7])
def test_a_bound_that_is_passed_and_passed_back_within_a_step(max_step, start):
    """A circle reaches 1: 2e-4 beyond the bound, on an arc of 0.04."""
    engine, _, u = march(circle(), math.sqrt(1.0 - start**2), start, 1.0, (-2.0, 1.0 - 2e-4), max_step=max_step)
    assert not engine.closed
    assert u[-1, 1] == 1.0 - 2e-4
    assert u[-1, 0] == pytest.approx(math.sqrt(1.0 - (1.0 - 2e-4) ** 2), abs=1e-9)
    assert u[:, 1].max() == 1.0 - 2e-4


@pytest.mark.filterwarnings("error")
def test_a_point_far_beside_a_step_lies_on_no_part_of_it():
    """The cubic between two neighbours runs away outside of them: searching along it would leave the numbers."""
    curve = circle()
    a, b = (start(curve, math.cos(angle), math.sin(angle)) for angle in (0.2, 0.3))
    assert position(a, b, np.array([math.cos(0.23), math.sin(0.23)])) == pytest.approx(0.3, abs=1e-3)
    for distance in (2.0, 1e3, 1e6):
        assert position(a, b, np.array([1.0, distance])) is None
        assert position(a, b, np.array([1.0, -distance])) is None


@dataclass
class Hairpin(Plane):
    """`p = x^2 / (2 r)`, a hairpin of radius r; where it is `wide` the curve lies beside it and there is a further
    unknown, which is zero.
    """

    wide: bool = False
    beside: float = 0.0
    other: object = None

    def evaluate(self, u):
        if not self.wide:
            return super().evaluate(u)
        gradient = (*self.gradient(u[0], u[1]), 0.0)
        return Evaluated(np.array([self.f(u[0], u[1]), u[2]]), np.array([gradient, (0.0, 0.0, 1.0)]))

    def weights(self, u, largest):
        return np.ones(len(u))

    def adapted(self, u, evaluation):
        return self.other

    def images(self, u):
        return [u]

    def transfer(self, u, origin):
        return np.append(u, 0.0) if len(u) < 2 + self.wide else u[: 2 + self.wide]


@pytest.mark.parametrize("beside", [-1e-3, -2e-4, 2e-4, 1e-3])
def test_a_hairpin_is_passed_as_its_discretisation_changes(beside):
    """At every step the curve moves by more than its steps are long where it turns: it keeps its heading, is passed
    once, and is left on its other side.
    """
    radius = 1e-3
    narrow, wide = (
        Hairpin(
            lambda x, p, at=at: p - at - x**2 / (2 * radius),
            lambda x, p: (-x / radius, 1.0),
            wide=at != 0.0,
            beside=at,
        )
        for at in (0.0, beside)
    )
    narrow.other, wide.other = wide, narrow
    begin = start(narrow, math.sqrt(2 * radius), 1.0)
    engine = March(begin, -1.0, (-1.0, 1.0), NEWTON, SteppingOptions())
    points = list(engine)
    assert engine.ending.reason is EndReason.RANGE_END
    assert points[0].u[0] > 0.0 > points[-1].u[0]
    x = np.array([point.u[0] for point in points])
    assert np.all(np.diff(x) < 0.0)


def test_a_curve_that_comes_back_along_itself_has_not_arrived(monkeypatch):
    """Whatever turns it round: what ends where it began, headed back, is not at the end of the range."""
    advance, steps = March._advance, []

    def turned_once(self, *known):
        new, *rest = advance(self, *known)
        steps.append(new)
        return (new.turned if len(steps) == 10 else new), *rest

    monkeypatch.setattr(March, "_advance", turned_once)
    engine, points, _ = march(cubic(), 1.4, -1.3, 1.0, (-1.3, 1.3))
    assert engine.ending.reason is EndReason.RETRACED
    assert engine.ending.early
    assert "retraced itself back to p = -1.3" in engine.ended
    # from inside the range it is stopped where it began
    steps.clear()
    engine, points, _ = march(cubic(), 1.4, -1.3, 1.0, (-3.0, 1.3))
    assert engine.ending.reason is EndReason.RETRACED
    assert points[-1].parameter < -1.2


def test_the_other_side_of_a_hairpin_is_not_the_same_place():
    """Two stretches that run the other way, 2e-5 apart, are two."""
    half = 1e-5
    hairpin = Plane(lambda x, p: p - (x / half) ** 2, lambda x, p: (-2 * x / half**2, 1.0))
    there = start(hairpin, half, 1.0).turned
    there = there if there.tangent[1] < 0.0 else there.turned
    back = [start(hairpin, -half * math.sqrt(p), p) for p in (0.98, 1.02)]
    back = [point if point.tangent[1] > 0.0 else point.turned for point in back]
    assert not Place(there).retraced(*back, NEWTON)
    same = [start(hairpin, half * math.sqrt(p), p) for p in (0.98, 1.02)]
    same = [point if point.tangent[1] > 0.0 else point.turned for point in same]
    assert Place(there).retraced(*same, NEWTON)
    assert not Place(there.turned).retraced(*same, NEWTON)


class Springs:
    """Many cubic springs, `x + sum / n + x^3 = parameter`, in other units than they are weighed by; its derivatives are
    counted.
    """

    def __init__(self, count):
        self.count, self.asked, self.parameter = count, 0, count

    def evaluate(self, u):
        return Spring(self, u)

    def weights(self, u, largest):
        return np.full(self.count + 1, 2.0)

    def where(self, u):
        return "here"


@dataclass
class Spring:
    curve: Springs
    u: np.ndarray

    @property
    def residual(self):
        x = self.u[:-1]
        return x + x.mean() + x**3 - self.u[-1] * np.linspace(0.5, 1.5, len(x))

    @property
    def error(self):
        return float(np.abs(self.residual).max())

    @property
    def jacobian(self):
        self.curve.asked += 1
        n = self.curve.count
        own = np.diag(1.0 + 3.0 * self.u[:-1] ** 2) + 1.0 / n
        return np.concatenate((own, -np.linspace(0.5, 1.5, n)[:, None]), axis=1)


@pytest.mark.parametrize("count", [3, 450])
def test_many_unknowns_are_corrected_by_factors_of_the_point_before(count):
    """To the same point as by those of their own; factors that lead nowhere change nothing."""
    curve, solved = Springs(count), []
    weights = curve.weights(None, 0.0)
    at = np.append(np.zeros(count), 0.3)
    row = np.eye(1, count + 1, count)[0]
    point = make_point(correct(curve, at, row, weights, NEWTON), row, 0.0)
    guess, along = point.u + 0.02 * point.tangent, weights * point.tangent
    for near in (None, point):
        curve.asked = 0
        found = correct(curve, guess, along, weights, NEWTON, near=near)
        solved.append((found.u, curve.asked))
    assert np.abs(solved[0][0] - solved[1][0]).max() < 1e-9
    assert solved[1][1] == (1 if count > 300 else solved[0][1])
    far = point.u.copy()
    far[:-1] += np.linspace(-2.0, 2.0, count)
    assert np.array_equal(*(correct(curve, far, along, weights, NEWTON, near=near).u for near in (None, point)))
