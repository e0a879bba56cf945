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


def level_rates(element: BaseElement, c: Array) -> Array:
    """Derivatives of the levels at which a law has corners or is sharp by its coefficients, (levels, nc).

    Points before velocities. What a law says of itself are the levels alone, hence differences of fourth order in steps
    of 1e-3 of a coefficient: exact for levels that are polynomials of it, to about 1e-12 else. Zero where the number of
    levels changes.
    """

    def levels(at: Array) -> Array:
        kind = element.sampling(at)
        return np.array([*getattr(kind, "points", ()), *getattr(kind, "velocities", ())])

    rates = np.zeros((len(levels(c)), len(c)))
    for i, value in enumerate(c):
        h = 1e-3 * (abs(float(value)) or 1.0)
        near = []
        for share in (1.0, -1.0, 2.0, -2.0):
            moved = c.copy()
            moved[i] += share * h
            near.append(levels(moved))
        if {len(there) for there in near} == {len(rates)}:
            rates[:, i] = (8.0 * (near[0] - near[1]) - (near[2] - near[3])) / (12.0 * h)
    return rates


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
