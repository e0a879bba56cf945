"""The inverse tangent that compiles to vector instructions, against the library's."""

import math

import numpy as np

from suboctave.harmonic.aft.steps import arctangent


def test_it_is_the_librarys_to_rounding():
    places = np.concatenate((np.linspace(-6.0, 6.0, 2001), 10.0 ** np.linspace(-300.0, 300.0, 301)))
    exact = np.arctan(places)
    ours = np.array([arctangent(float(x)) for x in places])
    assert np.all(np.abs(ours - exact) <= 2.0 * np.spacing(np.abs(exact)))


def test_it_keeps_what_is_no_number_and_the_sign_of_zero():
    assert math.isnan(arctangent(math.nan))
    assert [arctangent(x) for x in (math.inf, -math.inf)] == [0.5 * math.pi, -0.5 * math.pi]
    assert math.copysign(1.0, arctangent(-0.0)) == -1.0
