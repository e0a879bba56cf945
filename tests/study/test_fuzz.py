"""Study files and expressions at random: whatever is written, the answer is a verdict in words, soon."""

from __future__ import annotations

import signal
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

import suboctave as so
from suboctave.model.expressions.coefficients import coefficient
from suboctave.study.file import read_study

hypothesis = pytest.importorskip("hypothesis")
from hypothesis import (  # noqa: E402
    HealthCheck,
    given,
    settings,
    strategies as st,
)

DUFFING = (Path(__file__).parent / "duffing.toml").read_text(encoding="utf-8")
WORDS = sorted({word for line in DUFFING.splitlines() for word in line.replace(",", " ").split()})
ODD = [
    "nan", "inf", "-1", "0", "1e400", "9" * 5000, "true", "[]", "{}", "''", '"""', "[[", "]]", "\n[[analyses]]\n",
    "\n[system]\n", "[" * 300,
    '"9**9**9**9"', '"c**c**c"', '"(" * 9', "1979-05-27", '"\\u0000"', "\ud7ff", "a.b.c", "=",
    '"x**1000**1000"', '"__import__(\'os\')"', "harmonics = 10000000", "dof = 999999999", "harmonic = 1000000000",
    'type = "PolynomialSpring"', "coefficients = { 1000000 = 1.0 }", "coefficients = [1.0, 2.0]", 'start = "response"',
    "{ mapping = [1] }", '{ array = [1], dtype = "V99999999", shape = [9999999999] }', "{ sparse = { shape = 1 } }",
    '{ float = "nan" }',
    '{ callable = "os:getcwd" }', '{ stored = "a" }', '{ expression = "c" }', '{ type = "Gravity" }',
    'equations = ["x\'\' + x**9**9 = cos(omega*t)"]', 'type = "Expression"', 'expression = "x**999999999"',
]  # fmt: skip
QUICK = settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
SOON = 8.0  # seconds that no answer may take


@pytest.fixture(scope="module", autouse=True)
def loaded():
    """What is imported on first use is, before the clock runs."""
    coefficient("c**c").derivative("c")
    so.System.from_equations(["x'' + x + x**3*cos(omega*t) = 0"], {})


@contextmanager
def soon():
    """Nothing may hang: an alarm where there is one, the clock elsewhere."""

    def late(*_):
        raise TimeoutError("no answer in time")

    begin = time.monotonic()
    if hasattr(signal, "SIGALRM"):
        before = signal.signal(signal.SIGALRM, late)
        signal.alarm(int(SOON))
    try:
        yield
    finally:
        if hasattr(signal, "SIGALRM"):
            signal.alarm(0)
            signal.signal(signal.SIGALRM, before)
    assert time.monotonic() - begin < SOON


def verdict(text, folder):
    """Read a study file; anything but a study or a refusal in words is an error."""
    path = folder / "study.toml"
    path.write_bytes(text.encode("utf-8", "replace"))
    with soon():
        try:
            read_study(path)
            said = "in order"
        except so.InputError as refusal:
            said = str(refusal)
    assert 0 < len(said.strip()) < 20_000
    assert [p.name for p in folder.iterdir()] == ["study.toml"]


@st.composite
def changed(draw):
    """The Duffing study with a few words replaced, dropped or put in."""
    text = DUFFING
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(text)))
        end = min(len(text), at + draw(st.integers(0, 12)))
        new = draw(st.one_of(st.sampled_from(WORDS + ODD), st.text(max_size=8)))
        text = text[:at] + new + text[end:]
    return text


leaves = st.one_of(
    st.sampled_from(["c", "alpha", "omega", "pi", "t", "x", "9", "1e308", "0", "-1", "99999999999", "sin", "''"]),
    st.floats(allow_nan=True).map(repr),
)
inner: st.SearchStrategy[str] = st.deferred(lambda: expressions)
expressions = st.one_of(
    leaves,
    st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**", "//", "%", "^", "@", ",", "."]), inner).map(" ".join),
    inner.map(lambda e: f"({e})"),
    st.tuples(st.sampled_from(["sin", "exp", "log", "sqrt", "abs", "eval", "c", "tan", "max"]), inner).map(
        lambda pair: f"{pair[0]}({pair[1]})"
    ),
    inner.map(lambda e: f"-{e}"),
    inner.map(lambda e: f"lambda: {e}"),
    inner.map(lambda e: f"[{e}][0]"),
)


@st.composite
def values(draw):
    """The Duffing study with whole values replaced: it stays TOML far more often."""
    text = DUFFING
    lines = text.splitlines()
    for _ in range(draw(st.integers(1, 3))):
        i = draw(st.integers(0, len(lines) - 1))
        if " = " not in lines[i]:
            continue
        key = lines[i].split(" = ")[0]
        new = draw(
            st.one_of(
                st.sampled_from(ODD),
                st.integers().map(str),
                st.floats().map(str),
                st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=3).map(str),
                expressions.map(lambda e: f'"{e}"'),
            )
        )
        lines[i] = f"{key} = {new}"
    return "\n".join(lines)


def evaluated(text):
    """Parse an expression, take its value and its derivatives; only refusals in words may come of it."""
    with soon():
        try:
            source = coefficient(text)
            values = dict.fromkeys(source.names, 1.3)
            assert abs(source.value(values)) < float("inf")
            for name in sorted(source.names)[:2]:
                source.derivative(name).value(values)
            said = "a number"
        except so.InputError as refusal:
            said = str(refusal)
    assert said.strip()


def stated(text):
    """An equation of motion with a random force in it."""
    with soon():
        try:
            so.System.from_equations([f"x'' + 0.1*x' + x + {text} = cos(omega*t)"], {"c": 0.3, "alpha": 0.5})
            said = "a system"
        except so.InputError as refusal:
            said = str(refusal)
    assert said.strip()


def the_tests(profile):
    @profile
    @given(text=changed())
    def study(tmp_path_factory, text):
        verdict(text, tmp_path_factory.mktemp("fuzz"))

    @profile
    @given(text=values())
    def study_values(tmp_path_factory, text):
        verdict(text, tmp_path_factory.mktemp("fuzz"))

    @profile
    @given(text=st.one_of(expressions, st.text(max_size=30)))
    def expression(text):
        evaluated(text)

    @profile
    @given(text=st.one_of(expressions, st.text(max_size=30)))
    def equation(text):
        stated(text)

    return study, study_values, expression, equation


(
    test_a_study_file_at_random,
    test_values_at_random,
    test_an_expression_at_random,
    test_an_equation_at_random,
) = the_tests(QUICK)


@pytest.mark.slow
def test_five_minutes_at_random(tmp_path_factory):
    """The same with other draws every time, for five minutes in all."""
    end = time.monotonic() + 300.0
    rounds = 0
    while time.monotonic() < end:
        profile = settings(max_examples=300, deadline=None, database=None, suppress_health_check=list(HealthCheck))
        study, study_values, expression, equation = the_tests(profile)
        study(tmp_path_factory)
        study_values(tmp_path_factory)
        expression()
        equation()
        rounds += 1
    assert rounds > 0
