"""How an element's coefficients (stiffness, gap, ...) change with the parameters that they are expressions in."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from suboctave.harmonic.basis import Array
from suboctave.model.element import BaseElement


def coefficient_rates(element: BaseElement, values: Mapping[str, float], rates: Mapping[str, float]) -> Array:
    """First change of an element's coefficients along parameter changes, shape (nc,)."""
    result = np.zeros(len(element.coefficients))
    for i, coefficient in enumerate(element.coefficients):
        for name, rate in rates.items():
            if name in coefficient.names:
                result[i] += coefficient.derivative(name).value(values) * rate
    return result


def coefficient_curvature(
    element: BaseElement, values: Mapping[str, float], a: Mapping[str, float], b: Mapping[str, float]
) -> Array:
    """Second change of an element's coefficients along two parameter changes, shape (nc,)."""
    result = np.zeros(len(element.coefficients))
    for i, coefficient in enumerate(element.coefficients):
        for first, rate in a.items():
            if first not in coefficient.names:
                continue
            slope = coefficient.derivative(first)
            for second, other in b.items():
                if second in slope.names:
                    result[i] += slope.derivative(second).value(values) * rate * other
    return result
