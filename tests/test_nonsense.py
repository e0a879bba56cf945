"""Nonsense in the place of arguments: refused in one line by the name of the argument, before any work.

What is compared is what users call: every public verb, constructor and method. No argument but the nonsense one is
given, so that nothing can run: what is not refused ends in Python's own complaint about arguments that are missing.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import suboctave as so


class Thing:
    """Of no use to anybody."""

    def __repr__(self) -> str:
        return "a thing"


#: what no argument can be
NEVER = {
    "an object": Thing(),
    "bytes": b"no",
    "a class": Thing,
    "an empty function": lambda: None,
    "masked entries": np.ma.masked_array([1.0, 2.0], [True, False]),
    "a set": {2.5, -7},
}


def callables() -> Iterator[tuple[str, Callable[..., Any], tuple[Any, ...]]]:
    """Every public function, constructor and method, with what goes before its arguments."""
    for name in sorted(so.__all__):
        item = getattr(so, name)
        if inspect.isfunction(item):
            yield name, item, ()
        elif inspect.isclass(item) and not issubclass(item, Exception) and not inspect.isabstract(item):
            yield name, item, ()
            for method, raw in inspect.getmembers_static(item):
                if not method.startswith("_") and inspect.isfunction(raw) and raw.__module__.startswith("suboctave."):
                    yield f"{name}.{method}", raw, (None,)
    for name, item in vars(so.library).items():
        if inspect.isfunction(item) and item.__module__ == so.library.__name__ and not name.startswith("_"):
            yield f"library.{name}", item, ()


def laws(item: type) -> bool:
    """Whether its methods are the package's own way to call it, by the thousand: elements, loads, methods."""
    ours = "BaseElement Load Formulation StabilityMethod HarmonicBalance HarmonicBasis NewtonOptions SteppingOptions"
    return any(base.__name__ in ours.split() for base in item.__mro__)


#: annotations of what the callable reads itself: several forms, coefficients, places
_ITSELF = ("Any", "Number", "Dof", "Swept", "ArrayLike | None", "GivenName", "GivenLabels", "GivenDofs")


@pytest.mark.parametrize(("name", "call", "first"), [pytest.param(*one, id=one[0]) for one in callables()])
def test_what_can_be_no_argument_is_refused_by_its_name(name, call, first):
    owner = getattr(so, name.split(".")[0], None)
    if first and inspect.isclass(owner) and laws(owner):
        return
    for parameter in list(inspect.signature(call).parameters.values())[len(first) :]:
        by_name = parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD, parameter.POSITIONAL_ONLY)
        text = str(parameter.annotation)
        if not by_name or any(text == known or text.startswith(f"{known} |") for known in _ITSELF) or "Number" in text:
            continue
        for what, nonsense in NEVER.items():
            if (what == "a set" and "Iterable" in text) or (what == "an empty function" and "..." in text):
                continue  # in any order
            with pytest.raises(so.InputError) as refusal:
                call(*first, **{parameter.name: nonsense})
            assert re.match(rf"(\w+: )?{parameter.name}\b", str(refusal.value)), (parameter.name, what)
            assert "\n" not in str(refusal.value)


def refusal(call: Callable[[], Any]) -> str:
    with pytest.raises(so.InputError) as caught:
        call()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture(scope="module")
def system() -> so.System:
    return so.System(1.0, 0.1, 1.0, [so.CubicSpring(0, 0.5)], [so.HarmonicLoad(0, "F")], parameters={"F": 0.3})


@pytest.fixture(scope="module")
def branch(system) -> so.Branch:
    return so.frequency_response(system, (0.9, 0.95), harmonics=3)


def two_masses() -> so.System:
    return so.System(np.eye(2), 0.1 * np.eye(2), [[2.0, -1.0], [-1.0, 2.0]], loads=[so.HarmonicLoad(0, 0.3)])


WRONG = {
    "workers": (lambda s, b: so.verify(b, workers=-7), "workers must be a positive whole number, not -7"),
    "of one motion": (
        lambda s, b: so.verify(b.orbits[0], bifurcations=False),
        "bifurcations=, workers= and progress= are those of a branch; this is a single motion",
    ),
    "longest": (lambda s, b: so.NewtonOptions(longest=-1), "NewtonOptions: longest must be a positive number, not -1"),
    "iterations": (
        lambda s, b: so.NewtonOptions(iterations=2.5),
        "NewtonOptions: iterations must be a positive whole number, not 2.5",
    ),
    "allow_code": (lambda s, b: so.load("x.nc", allow_code="no"), "allow_code must be True or False, not 'no'"),
    "masked": (
        lambda s, b: so.PeriodicOrbit(b.orbits[0].balance, np.ma.masked_array(b.orbits[0].x, True), 1.0, {}, 0.0),
        "PeriodicOrbit: x must be without masked entries: fill them, or leave them out, not masked_array(...",
    ),
    "a set": (
        lambda s, b: so.frequency_response(s, {0.9, 0.95}),
        "omega must be two numbers (from, to), not {0.9, 0.95}",
    ),
    "a generator": (
        lambda s, b: so.frequency_response(s, (w for w in (0.9, 0.95))),
        "omega must be two numbers (from, to), not <generator object ...",
    ),
    "no system": (lambda s, b: so.HarmonicBalance(2.5, None), "HarmonicBalance: system must be a System, not 2.5"),
    "samples": (
        lambda s, b: so.HarmonicBalance(s, so.HarmonicBasis(3), samples=(1, 2)),
        "samples must be 1 counts, one for each element, not 2",
    ),
    "coefficients": (
        lambda s, b: so.PeriodicOrbit(b.orbits[0].balance, np.zeros((2, 1)), 1.0, {}, 0.0),
        "x must be coefficients of shape (7, 1), not (2, 1)",
    ),
    "frequency": (
        lambda s, b: so.PeriodicOrbit(b.orbits[0].balance, b.orbits[0].x, -1.0, {}, 0.0),
        "PeriodicOrbit: omega must be a positive number, not -1.0",
    ),
    "observe": (
        lambda s, b: so.condense(two_masses(), 1.0, observe=2.5),
        "observe must be a whole number, a text, or a list of whole numbers or texts, not 2.5",
    ),
    "labels": (lambda s, b: b.plot(labels=2.5), "labels must be a list of texts, not 2.5"),
    "one label": (lambda s, b: so.plot(b, labels=["a", 3]), "labels[1] must be a text, not 3"),
    "a table for a text": (
        lambda s, b: so.System(1.0, 0.1, 1.0, name=np.ones((2, 2))),
        "System: name must be a text, not array([[1., 1.], [1., 1.]])",
    ),
    "half a character": (lambda s, b: so.Event("\udcff", len), "Event: name must be a text that is not empty, not ..."),
    "side": (
        lambda s, b: so.HertzContact(0, 1.0, 0.1, side="lefd"),
        "HertzContact: side must be 'right' or 'left', not 'lefd' (did you mean 'left'?)",
    ),
    "a mapping": (
        lambda s, b: so.integrate(s, omega=1.0, parameters={"F": "much"}),
        "parameters['F'] must be a finite number, not 'much'",
    ),
    "truth": (lambda s, b: so.integrate(s, omega=True), "omega must be a positive number, not True"),
    "progress": (
        lambda s, b: so.frequency_response(s, (0.9, 0.95), progress=lambda: None),
        "progress must be a function of 2 arguments, or True or False, not <function ...",
    ),
    "bytes": (
        lambda s, b: so.CubicSpring(b"no", 1.0),
        "CubicSpring: dof must be an integer, a name, or a pair of these, not ...",
    ),
    "ragged": (
        lambda s, b: so.Structure([[1.0], [1.0, 2.0]], np.eye(2)),
        "Structure: mass must be a matrix of numbers, not [[1.0], [1.0, 2.0]]",
    ),
    "digits": (
        lambda s, b: so.HarmonicBasis(10**400),
        "HarmonicBasis: harmonics must be a positive whole number, not 1000...",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_one_line_says_what_is_wrong_and_what_is_wanted(case, system, branch):
    call, text = WRONG[case]
    start, cut, _ = text.partition("...")
    said = refusal(lambda: call(system, branch))
    assert said.startswith(start) if cut else said == text


@pytest.mark.parametrize(
    ("call", "meant"),
    [
        (lambda: so.System(M=1.0), "mass"),
        (lambda: so.System(1.0, K=2.0), "stiffness"),
        (lambda: so.System(1.0, 0.1, stifness=1.0), "stiffness"),
        (lambda: so.CubicSpring(0, k=1.0), "coefficient"),
        (lambda: so.ElasticStop(0, k=1.0), "stiffness"),
        (lambda: so.ElasticStop(0, stiffnes=1.0), "stiffness"),
        (lambda: so.HarmonicLoad(0, amp=1.0), "amplitude"),
        (lambda: so.NewtonOptions(tolerence=1e-8), "tolerance"),
        (lambda: so.verify(None, tolerence=1e-8), "tolerance"),
        (lambda: so.library.duffing(alhpa=1.0), "alpha"),
        (lambda: so.Rayleigh(alpa=1.0), "alpha"),
    ],
)
def test_a_keyword_that_is_misspelt_or_a_symbol_is_put_right(call, meant):
    with pytest.raises(TypeError, match=rf"unexpected keyword argument '\w+' \(did you mean '{meant}'\?\)$"):
        call()


def test_what_makes_sense_is_taken(system):
    """Numbers of NumPy, whole numbers written 5.0, lists and arrays for pairs, tables of pandas for columns."""
    import pandas

    first = so.frequency_response(system, [0.9, 0.95], harmonics=3.0)
    column = pandas.Series([0.9, 0.95], index=["from", "to"])
    for pair in (np.array([0.9, 0.95]), column, (np.float32(0.9), np.float64(0.95))):
        other = so.frequency_response(system, pair, harmonics=np.int64(3))
        assert np.allclose(other.omega[:1], first.omega[:1])
    assert so.HarmonicBasis(np.int64(3)) == so.HarmonicBasis(3.0) == so.HarmonicBasis(3)
    assert so.NewtonOptions(longest=np.inf).longest == np.inf
    assert len(so.Measured([1.0, 2.0], [0.1, 0.2], "rig").omega) == 2
    assert so.System(1.0, 0.1, 1.0, elements=so.CubicSpring(0, 1.0)).elements  # one stands for a list of one


def test_what_the_package_makes_itself_is_not_compared(system, monkeypatch):
    """Points of a curve: their number does not change how many arguments are read."""
    from suboctave import arguments

    counts = []
    read = arguments._Table.read
    monkeypatch.setattr(arguments._Table, "read", lambda self, *given: (counts.append(1), read(self, *given))[1])
    points = []
    for step in (0.06, 0.003):
        counts.append(0)
        points.append((len(so.frequency_response(system, (0.7, 0.8), harmonics=3, max_step=step)), len(counts)))
        counts.clear()
    (few, compared), (many, again) = points
    assert many > 4 * few
    assert again <= compared + 10
