"""Places at which a function is not finite, found from its values: poles and logarithms are, steep functions not."""

from __future__ import annotations

import numpy as np
import pytest

from suboctave.harmonic.aft.poles import POINTS, unbounded

_INFINITE = {
    "simple pole": lambda d: 1.0 / d,
    "root": lambda d: np.abs(d) ** -0.5,
    "logarithm": lambda d: np.log(np.abs(d)),
    "cotangent": lambda d: 1.0 / np.tan(d),
    "weak pole on a slope": lambda d: 1e-3 / d + 20.0 * d,
    "no number beyond": lambda d: np.sqrt(d),
}
_FINITE = {
    "root": lambda d: np.sqrt(np.abs(d)),
    "corner": np.abs,
    "peak with a corner": lambda d: 2.0 - np.abs(d),
    "removable": lambda d: np.sin(d) / d,
    "sharp step": lambda d: np.tanh(1e5 * d),
    "sharp peak": lambda d: 1.0 / (1e-6 + d * d),
    "constant": lambda d: 0.0 * d + 3.0,
    "Hertz": lambda d: 1e9 * np.maximum(d, 0.0) ** 1.5,
    "its own logarithm": lambda d: np.abs(d) * np.log(np.abs(d)),
}


def _answers(function, low, high):
    draw = np.random.default_rng(1)
    places, widths = draw.uniform(low, high, 100), 10.0 ** draw.uniform(-4.0, 0.3, 100)
    grid = np.linspace(0.0, 1.0, POINTS)
    with np.errstate(all="ignore"):
        answers = [
            unbounded(lambda s, at=at, width=width: function((s - at) * width), grid)
            for at, width in zip(places, widths, strict=True)
        ]
    return places, answers


@pytest.mark.parametrize("name", _INFINITE)
def test_what_is_not_finite_is_seen(name):
    places, answers = _answers(_INFINITE[name], 0.001, 0.999)
    assert None not in answers
    if name != "no number beyond":
        np.testing.assert_allclose(answers, places, atol=1e-6)


@pytest.mark.parametrize("name", _FINITE)
def test_what_is_finite_is_not_mistaken(name):
    assert set(_answers(_FINITE[name], -0.2, 1.2)[1]) == {None}
