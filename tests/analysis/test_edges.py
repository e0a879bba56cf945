"""What no computer can do, or no number can hold, is refused before any work; what users raise stays their own."""

from __future__ import annotations

import importlib
from time import process_time

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import ConvergenceError, InputError

DUFFING = so.library.duffing()
RESULT = so.integrate(DUFFING, omega=1.0, periods=1)
HUGE = 10**400
SQUARE = {"omega": 1.0, "box": ((-1, 1), (-1, 1))}


def expression(text):
    return so.System(1.0, 0.1, 1.0, [so.Expression(0, text)], [so.HarmonicLoad(0, 1.0)])


def spring(text):
    return so.System(1.0, 0.1, 1.0, [so.CubicSpring(0, text)], [so.HarmonicLoad(0, 1.0)], parameters={"a": 1 / 9})


MISTAKES = {
    "steps that would not fit": (lambda: so.stepped_sine(DUFFING, (0.5, 0.6), values=10**9), "count"),
    "steps beyond any array": (lambda: so.stepped_sine(DUFFING, (0.5, 0.6), values=HUGE), "whole number"),
    "settling for years": (lambda: so.stepped_sine(DUFFING, (0.5, 0.6), transient=10**8, values=10**4), "waited"),
    "a grid that would not fit": (lambda: so.basins(DUFFING, **SQUARE, grid=(10**6, 10**6)), "fit"),
    "a side beyond any array": (lambda: so.basins(DUFFING, **SQUARE, grid=(HUGE, 2)), "whole number"),
    "basins for years": (lambda: so.basins(DUFFING, **SQUARE, grid=(2000, 2000), periods=10**8), "waited"),
    "a box of no numbers": (
        lambda: so.basins(DUFFING, omega=1.0, box=((-HUGE, 1), (-1, 1))),
        "must be a finite number",
    ),
    "periods for years": (lambda: so.integrate(DUFFING, omega=1.0, periods=10**12), "periods must be at most"),
    "a transient for years": (
        lambda: so.integrate(DUFFING, omega=1.0, periods=1, transient=10**12),
        "transient must be at most",
    ),
    "sections that would not fit": (
        lambda: so.poincare_sections(DUFFING, omega=1.0, periods=10**8 * 3),
        "periods must be at most",
    ),
    "a diagram that would not fit": (
        lambda: so.brute_force_diagram(DUFFING, omega=(0.5, 1.0), values=10**7, periods=100),
        "fit",
    ),
    "exponents for years": (
        lambda: so.lyapunov_exponents(DUFFING, omega=1.0, periods=10**4, trajectories=10**8),
        "fit",
    ),
    "a map that would not fit": (
        lambda: so.lyapunov_map(DUFFING, omega=(0.5, 1.0), parameter="F", bounds=(0.5, 1.0), grid=(10**5, 10**5)),
        "fit",
    ),
    "a parameter of 400 digits": (lambda: so.library.duffing(F=HUGE), "finite"),
    "another one": (lambda: DUFFING.with_parameters({"F": HUGE}), "finite"),
    "of the integrator": (lambda: so.integrate(DUFFING, omega=1.0, parameters={"F": HUGE}), "finite number"),
    "a parameter that is none": (lambda: so.integrate(DUFFING, omega=1.0, parameters={"F": "1"}), "finite number"),
    "parameters that are none": (lambda: so.integrate(DUFFING, omega=1.0, parameters=[("F", 1.0)]), "mapping"),
    "a mass of 400 digits": (lambda: so.System(HUGE, 0.1, 1.0, loads=[so.HarmonicLoad(0, 1.0)]), "finite"),
    "a range of 400 digits": (lambda: so.frequency_response(DUFFING, (0.5, HUGE)), "must be a finite number"),
    "a frequency of 400 digits": (lambda: so.integrate(DUFFING, omega=HUGE), "positive number"),
    "a step of 400 digits": (lambda: so.frequency_response(DUFFING, (0.5, 0.6), max_step=HUGE), "max_step"),
    "a state of 400 digits": (lambda: so.integrate(DUFFING, start=[HUGE, 0], omega=1.0), "finite numbers"),
    "too sharp a stop": (lambda: so.library.reference_oscillator(regularization=1e300), "exact law"),
    "too blunt a stop": (lambda: so.library.reference_oscillator(regularization=1e-300), "exact law"),
    "too sharp a play": (
        lambda: so.System(1.0, 0.1, 1.0, [so.Freeplay(0, 1.0, 0.5, regularization=1e300)], [so.HarmonicLoad(0, 1.0)]),
        "exact law",
    ),
    "powers of powers": (lambda: expression("((x**1000)**1000)**1000"), "power"),
    "powers of sums of powers": (lambda: expression("((x + 1)**1000 + 1)**1000"), "power"),
    "factors beyond floats": (lambda: expression("1e308*1e308*x"), "finite"),
    "powers of powers of a parameter": (lambda: spring("(((9*a)**1000)**1000)**1000"), "power"),
    "a tower": (lambda: expression("9**9**9**9*x"), "power"),
    "an equation with a tower": (
        lambda: so.System.from_equations("x'' + ((x**1000)**1000)**1000 = cos(omega*t)"),
        "power",
    ),
    "an equation of a megabyte": (lambda: so.System.from_equations("x" * 10**6 + "=1"), "too long"),
    "no file": (lambda: so.load(None), "name"),
    "a number for a file": (lambda: so.load(12), "name"),
    "bytes for a file": (lambda: so.load(b"a.nc"), "name"),
    "a name too long for a file": (lambda: so.load("a" * 5000), "too long"),
    "a folder for a file": (lambda: so.load("."), "folder"),
    "nowhere to save to": (lambda: RESULT.save(None), "name"),
    "an array for a coefficient": (lambda: spring(np.array([1.0, 2.0])), "number or an expression"),
    "a direction in words": (lambda: so.CubicSpring(coefficient=1.0, direction="x"), "direction"),
    "a complex direction": (lambda: so.CubicSpring(coefficient=1.0, direction=[1j]), "direction"),
    "a force in words": (
        lambda: so.System(1.0, 0.1, 1.0, [so.Callable(0, lambda x, v: "a")], [so.HarmonicLoad(0, 1.0)]),
        "no numbers",
    ),
    "a harmonic of 400 digits": (lambda: so.HarmonicLoad(0, 1.0, harmonic=HUGE), "whole number"),
    "friction without smoothing": (lambda: so.TanhFriction(0, 1.0, 1e-320), "choose units"),
    "several frequencies": (lambda: so.integrate(DUFFING, omega=(1, 2)), "positive number"),
    "a frequency in words": (lambda: so.lyapunov_exponents(DUFFING, omega="x"), "positive number"),
    "a list for a method": (lambda: so.integrate(DUFFING, omega=1.0, method=[]), "method must be a text"),
    "a tolerance in words": (lambda: so.integrate(DUFFING, omega=1.0, tolerance="x"), "positive number"),
    "no mapping": (lambda: so.poincare_sections(DUFFING, omega=1.0, parameters="x"), "mapping"),
    "half a worker": (lambda: so.poincare_sections(DUFFING, omega=1.0, workers=1.5), "workers"),
    "not a number of workers": (lambda: so.poincare_sections(DUFFING, omega=[1.0] * 40, workers=np.nan), "workers"),
    "a parameter as a list": (
        lambda: so.brute_force_diagram(DUFFING, omega=1.0, parameter=[], bounds=(0, 1)),
        "parameter must be a text",
    ),
    "ragged states": (lambda: so.brute_force_diagram(DUFFING, omega=(0.5, 1), start=[[1, 2], [3]]), "finite numbers"),
    "nowhere to begin": (lambda: so.brute_force_diagram(DUFFING, omega=(0.5, 1), direction=[]), "direction"),
    "two trajectories, one setting": (lambda: so.TwoTrajectories(steps_per_period=5), "list of positive whole numbers"),
    "two trajectories, no offset": (lambda: so.TwoTrajectories(offset=()), "offset"),
    "a seed in words": (lambda: so.stepped_sine(DUFFING, (0.5, 0.6), seed="x"), "seed"),
    "values beyond waiting": (lambda: so.find_isolas(DUFFING, (0.5, 1), "F", (0.5, 1), values=10**9), "10000"),
    "slices beyond waiting": (lambda: so.regime_map(DUFFING, (0.5, 1), "F", (0.5, 1), values=10**9), "10000"),
    "no element": (lambda: so.check_derivatives(5), "element"),
    "options in words": (lambda: so.NewtonOptions(tolerance="x"), "positive number"),
    "harmonics in words": (lambda: so.AdaptiveHarmonics(minimum="x"), "positive whole number"),
    "steps in words": (lambda: so.SteppingOptions(max_step="x"), "positive number"),
    "no witnesses": (lambda: so.Arbitration(5), "witnesses"),
    "parameters in words": (lambda: DUFFING.with_parameters("x"), "mapping"),
    "no equations": (lambda: so.System.from_equations(None), "equations"),
    "no report": (lambda: so.write_report(None, "none.html"), "mapping"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_what_cannot_be_done_is_refused_in_one_line(case):
    call, words = MISTAKES[case]
    begin = process_time()
    with pytest.raises(InputError) as refused:
        call()
    message = str(refused.value)
    assert words in message
    assert "\n" not in message
    assert len(message) < 400
    assert process_time() - begin < 2.0  # far below what any of them would take


@pytest.mark.parametrize("verb", [so.frequency_response, so.bifurcation_diagram])
@pytest.mark.parametrize("mistake", [ZeroDivisionError, OverflowError, KeyError, RuntimeError])
def test_what_the_function_of_an_event_raises_is_its_users(verb, mistake):
    def fails(orbit):
        if orbit.omega > 0.55:
            raise mistake("mine")
        return 1.0

    with pytest.raises(so.FunctionError, match=r"beyond omega = 0.5\d*: the function of the event 'hot'") as raised:
        verb(so.library.duffing(c=0.1), (0.5, 0.6), harmonics=3, events=[so.Event("hot", fails)])
    assert f"{mistake.__name__}: " in str(raised.value)
    cause = raised.value.__cause__
    assert type(cause) is mistake
    last = cause.__traceback__
    while last.tb_next is not None:
        last = last.tb_next
    assert last.tb_frame.f_code.co_name == "fails"
    # what was computed is there, as after Ctrl-C
    result = raised.value.result
    branch = result if verb is so.frequency_response else result.branches[0]
    assert branch.interruption.failure
    assert branch.omega[0] == 0.5
    assert branch.omega[-1] <= 0.55


def test_a_mistake_in_the_program_is_not_taken_for_one_of_units(monkeypatch):
    """Searches go on after a ConvergenceError: a division by zero of ours must not be one."""

    def divides(*arguments):
        return 1 // 0

    verbs = importlib.import_module("suboctave.analysis.branches")
    monkeypatch.setattr(verbs, "check_system", divides)
    with pytest.raises(ZeroDivisionError):
        so.frequency_response(DUFFING, (0.5, 0.6))


def test_numbers_that_leave_the_range_of_floats_are_named():
    with pytest.raises(ConvergenceError, match="choose units") as refused:
        so.frequency_response(so.library.duffing(F=1e100), (0.5, 0.6), harmonics=3)
    assert "F = 1e+100" in str(refused.value)


@pytest.mark.parametrize(
    ("tiny", "small", "omega"),
    [
        (so.library.duffing(m=1e-100), so.library.duffing(m=1e-9), ((0.5, 0.6), (0.5, 0.6))),
        (DUFFING, DUFFING, ((1e-100, 2e-100), (1e-6, 2e-6))),
    ],
    ids=["mass", "frequency"],
)
def test_what_is_too_small_to_count_does_not(tiny, small, omega):
    """Without inertia worth the name a motion follows its load, and its multipliers vanish."""
    one, other = (so.frequency_response(s, w, harmonics=3) for s, w in zip((tiny, small), omega, strict=True))
    for end in (0, -1):
        assert one.amplitude[end] == pytest.approx(other.amplitude[end], rel=1e-5)
    assert one.stable.all()
    assert other.stable.all()


def test_numbers_of_numpy_are_numbers():
    one = so.integrate(DUFFING, omega=1.0, periods=1, parameters={"F": 0.5})
    other = so.integrate(DUFFING, omega=np.float64(1.0), periods=np.int64(1), parameters={"F": np.float32(0.5)})
    np.testing.assert_array_equal(one.displacement, other.displacement)
