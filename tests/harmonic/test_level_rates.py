"""How corners move with coefficients: against the derivative in closed form, in any units."""

import numpy as np
import pytest

import suboctave as so


@pytest.mark.parametrize("unit", [1.0, 1e-4, 1e6])
def test_levels_of_texts_move_as_their_derivatives_say(unit):
    """`max(k x - F, 0)` has its corner at F/k, which moves by 1/k and -F/k^2."""
    system = so.System(
        1.0, 0.1, 1.0, [so.Expression(0, "max(k*x - F, 0)")], [so.HarmonicLoad(0, 1.0)],
        parameters={"k": 3.0 * unit, "F": 2.0 * unit},
    )  # fmt: skip
    (element,) = system.elements
    order = [str(name) for name in element.coefficient_names]
    rates = dict(zip(order, element.level_rates(element.coefficient_values(system.parameters))[0], strict=True))
    assert rates["F"] == pytest.approx(1.0 / (3.0 * unit), rel=1e-10)
    assert rates["k"] == pytest.approx(-2.0 / (9.0 * unit), rel=1e-10)


def test_levels_that_are_coefficients_move_with_them():
    stop = so.ElasticStop(0, 2.0, 0.3, regularization=1000.0)
    assert stop.level_rates(np.array([2.0, 0.3, 1000.0]))[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
