"""Every wrong input is refused before any work, with a message that names the cause and what to give instead."""

from __future__ import annotations

import math

import numpy as np
import pytest

import suboctave as so

NAN, INF = math.nan, math.inf


@pytest.fixture(scope="module")
def system():
    return so.library.duffing(c=0.1, F=0.3)


@pytest.fixture(scope="module")
def short(system):
    return so.frequency_response(system, (3.0, 2.9))


def harmonic_load(**options):
    return so.System(1.0, 0.1, 1.0, loads=[so.HarmonicLoad(0, 1.0, **options)])


RESPONSE = {
    "no system": (lambda s, b: so.frequency_response(3, (1, 2)), "system must be a System, not 3"),
    "no load": (lambda s, b: so.frequency_response(so.System(1.0, 0.1, 1.0), (1, 2)), "no periodic load: add loads="),
    "one frequency": (
        lambda s, b: so.frequency_response(s, 1.0),
        r"omega must be two numbers \(from, to\), not 1\.0",
    ),
    "three frequencies": (lambda s, b: so.frequency_response(s, (1, 2, 3)), r"omega must be two numbers \(from, to\)"),
    "equal ends": (lambda s, b: so.frequency_response(s, (1, 1)), "two different finite ends"),
    "nan": (lambda s, b: so.frequency_response(s, (NAN, 1)), r"omega\[0\] must be a finite number, not nan"),
    "infinite": (lambda s, b: so.frequency_response(s, (1, INF)), r"omega\[1\] must be a finite number, not inf"),
    "negative": (lambda s, b: so.frequency_response(s, (-1, 1)), "frequencies are positive, in rad per unit time"),
    "zero": (lambda s, b: so.frequency_response(s, (0, 1)), "frequencies are positive"),
    "text": (lambda s, b: so.frequency_response(s, ("low", "high")), r"omega\[0\] must be a finite number, not 'low'"),
    "no harmonics": (lambda s, b: so.frequency_response(s, (1, 2), harmonics=0), "whole number of at least 1.*not 0"),
    "negative harmonics": (
        lambda s, b: so.frequency_response(s, (1, 2), harmonics=-3),
        "whole number of at least 1.*not -3",
    ),
    "half a harmonic": (lambda s, b: so.frequency_response(s, (1, 2), harmonics=7.5), "whole number.*not 7.5"),
    "misspelt": (lambda s, b: so.frequency_response(s, (1, 2), harmonics="adaptiv"), '"adaptive"'),
    "true": (lambda s, b: so.frequency_response(s, (1, 2), harmonics=True), "whole number.*not True"),
    "load above": (
        lambda s, b: so.frequency_response(harmonic_load(harmonic=5), (1, 2), harmonics=3),
        "load at 5 omega needs harmonics=5 or more",
    ),
    "no step": (lambda s, b: so.frequency_response(s, (1, 2), max_step=0), "max_step must be a positive number"),
    "nan step": (
        lambda s, b: so.frequency_response(s, (1, 2), max_step=NAN),
        "max_step must be a positive number, not nan",
    ),
    "text step": (lambda s, b: so.frequency_response(s, (1, 2), max_step="0.1"), "max_step must be a positive number"),
    "tiny step": (lambda s, b: so.frequency_response(s, (1, 2), max_step=1e-9), "max_step=1e-09"),
    "dof": (lambda s, b: so.frequency_response(s, (1, 2), observe=1), "1 DOFs, numbered from 0"),
    "negative dof": (lambda s, b: so.frequency_response(s, (1, 2), observe=-1), "observe=-1 is out of range"),
    "text dof": (
        lambda s, b: so.frequency_response(s, (1, 2), observe="x"),
        "observe='x' is none of the degrees of freedom: they have no names",
    ),
    "bare function": (
        lambda s, b: so.frequency_response(s, (1, 2), events=[len]),
        r"events\[0\] must be an Event, not <built-in",
    ),
    "number for events": (
        lambda s, b: so.frequency_response(s, (1, 2), events=3),
        "events must be an Event or a list of Events, not 3",
    ),
    "same name": (
        lambda s, b: so.frequency_response(s, (1, 2), events=[so.Event("a", len), so.Event("a", len)]),
        "same name",
    ),
    "name of a kind": (
        lambda s, b: so.frequency_response(s, (1, 2), events=[so.Event("LP", len)]),
        "'LP': that is the name of a kind",
    ),
    "event without function": (lambda s, b: so.Event("a", 3), "function must be a function of 1 argument, not 3"),
    "event without name": (lambda s, b: so.Event("", len), "name must be a text that is not empty"),
    "progress": (
        lambda s, b: so.frequency_response(s, (1, 2), progress=3),
        "progress must be a function of 2 arguments, or True or False, not 3",
    ),
    "newton": (lambda s, b: so.frequency_response(s, (1, 2), newton={}), "newton must be a NewtonOptions, not {}"),
    "stepping": (lambda s, b: so.frequency_response(s, (1, 2), stepping=0.1), "must be a SteppingOptions, not 0.1"),
    "newton value": (lambda s, b: so.NewtonOptions(tolerance=-1), "NewtonOptions: tolerance must be a positive number"),
    "stepping value": (lambda s, b: so.SteppingOptions(max_step=0.0), "max_step must be a positive number, not 0.0"),
    "start of four numbers": (
        lambda s, b: so.frequency_response(s, (1, 2), start=[1.0, 2.0, 3.0, 4.0]),
        r"state \(x, dx/dt\) of length 2, or coefficients of shape \(2 H \+ 1, 1\)",
    ),
    "start nan": (lambda s, b: so.frequency_response(s, (1, 2), start=[NAN, 1.0]), "not finite"),
    "start text": (
        lambda s, b: so.frequency_response(s, (1, 2), start="low"),
        "start must be a PeriodicOrbit.*not str",
    ),
    "start branch": (lambda s, b: so.frequency_response(s, (1, 2), start=b), r"not Branch \(one of its \.orbits\?\)"),
    "start of another system": (
        lambda s, b: so.frequency_response(so.library.nltva(), (1, 2), start=b.orbits[0]),
        "start has 1 DOFs, the system has 2",
    ),
}

ALONG = {
    "no start": (lambda s, b: so.continue_branch(3, "F", (0, 1)), "start must be a System, a PeriodicOrbit, .*not 3"),
    "a branch": (lambda s, b: so.continue_branch(b, "F", (0, 1)), "not Branch"),
    "misspelt": (lambda s, b: so.continue_branch(b.orbits[0], "alhpa", (0, 2)), "did you mean 'alpha'"),
    "no name": (lambda s, b: so.continue_branch(b.orbits[0], 3, (0, 2)), "parameter must be a text, not 3"),
    "equal": (lambda s, b: so.continue_branch(b.orbits[0], "F", (0, 0)), "two different finite ends"),
    "one number": (lambda s, b: so.continue_branch(b.orbits[0], "F", 1.0), r"bounds must be two numbers \(from, to\)"),
    "outside": (lambda s, b: so.continue_branch(b.orbits[0], "F", (2, 3)), r"F=0\.3, outside the bounds \(2, 3\)"),
    "another omega": (lambda s, b: so.continue_branch(b.orbits[0], "F", (0, 2), omega=9.0), "differs.*leave it out"),
    "text omega": (
        lambda s, b: so.continue_branch(b.orbits[0], "F", (0, 2), omega="a"),
        "omega must be a finite number, not 'a'",
    ),
    "no omega": (lambda s, b: so.continue_branch(s, "F", (0, 1)), "needs a positive omega="),
    "negative omega": (lambda s, b: so.continue_branch(s, "F", (0, 1), omega=-1.0), "needs a positive omega="),
    "omega twice": (lambda s, b: so.continue_branch(s, "omega", (1, 2), omega=1.5), "leave it out"),
    "negative frequencies": (
        lambda s, b: so.continue_branch(b.orbits[0], "omega", (-1, 4)),
        "frequencies are positive",
    ),
    "unknown of a system": (lambda s, b: so.continue_branch(s, "Q", (0, 1), omega=1.0), "known: .*alpha"),
    "massless": (lambda s, b: so.continue_branch(b.orbits[0], "m", (0, 2)), "at m=0 the mass is singular"),
    "negative mass": (lambda s, b: so.continue_branch(s, "m", (2, -1), omega=1.0), "at m=-1 the mass is not positive"),
    "no harmonics": (lambda s, b: so.continue_branch(b.orbits[0], "F", (0, 2), harmonics=0), "whole number"),
    "step": (lambda s, b: so.continue_branch(b.orbits[0], "F", (0, 2), max_step=-1), "positive number"),
    "dof": (lambda s, b: so.continue_branch(b.orbits[0], "F", (0, 2), observe=4), "out of range"),
    "events": (
        lambda s, b: so.continue_branch(b.orbits[0], "F", (0, 2), events=[3]),
        r"events\[0\] must be an Event, not 3",
    ),
    "no load": (
        lambda s, b: so.continue_branch(so.System(1.0, 0.1, "k", parameters={"k": 1.0}), "k", (1, 2), omega=1.0),
        "no periodic load",
    ),
}

SINGLE = {
    "verify number": (lambda s, b: so.verify(3), "what must be a PeriodicOrbit, .*or a Branch, not 3"),
    "tolerance": (lambda s, b: so.verify(b.orbits[0], tolerance=-1.0), "tolerance must be a number between 0 and 1"),
    "tolerance text": (
        lambda s, b: so.verify(b.orbits[0], tolerance="a"),
        "tolerance must be a number between 0 and 1, not 'a'",
    ),
    "stability text": (lambda s, b: so.stability("x"), "orbit must be a PeriodicOrbit, .*not 'x'"),
    "stability branch": (lambda s, b: so.stability(b), "not Branch"),
    "harmonic": (lambda s, b: b.harmonic(0.5), "no harmonic of a motion"),
    "dof of a harmonic": (lambda s, b: b.harmonic(1, dof=3), "dof=3 is out of range"),
    "parameter": (lambda s, b: b.parameter("Q"), "unknown parameter 'Q'"),
}


@pytest.mark.parametrize(("call", "message"), RESPONSE.values(), ids=RESPONSE.keys())
def test_frequency_response(system, short, call, message):
    refused(system, short, call, message)


@pytest.mark.parametrize(("call", "message"), ALONG.values(), ids=ALONG.keys())
def test_continue_branch(system, short, call, message):
    refused(system, short, call, message)


@pytest.mark.parametrize(("call", "message"), SINGLE.values(), ids=SINGLE.keys())
def test_single_motions(system, short, call, message):
    refused(system, short, call, message)


def refused(system, short, call, message):
    with pytest.raises(so.InputError, match=message) as error:
        call(system, short)
    assert isinstance(error.value, ValueError)
    assert "\n" not in str(error.value)


def test_misspelt_keyword(system):
    with pytest.raises(TypeError, match="harmonic"):
        so.frequency_response(system, (1, 2), harmonic=3)


def test_numpy_numbers_are_numbers(system):
    curve = so.frequency_response(
        system, np.array([3.0, 2.9]), harmonics=np.int64(5), observe=np.int64(0), max_step=np.float64(0.02)
    )
    assert curve.omega[-1] == 2.9
