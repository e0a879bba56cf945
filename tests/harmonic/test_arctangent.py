"""The inverse tangent that compiles to vector instructions, against the library's."""

import math

import numpy as np

from suboctave.harmonic.aft.closed_form import add_step


def arctangent(places: np.ndarray) -> np.ndarray:
    force, stiffness = np.zeros((2, len(places)))
    add_step(places, 0.0, 1.0, 1.0, force, stiffness)
    return stiffness


def test_it_is_the_librarys_to_rounding():
    places = np.concatenate((np.linspace(-6.0, 6.0, 2001), 10.0 ** np.linspace(-300.0, 150.0, 301)))
    exact = np.arctan(places)
    assert np.all(np.abs(arctangent(places) - exact) <= 2.0 * np.spacing(np.abs(exact)))


def test_it_keeps_what_is_no_number():
    nothing, most, least = arctangent(np.array((math.nan, math.inf, -math.inf))).tolist()
    assert math.isnan(nothing)
    assert (most, least) == (0.5 * math.pi, -0.5 * math.pi)
