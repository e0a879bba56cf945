"""Springs whose force is a polynomial in the displacement."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, is_number
from suboctave.model.elements.base import Array, DeclaredElement, Dof, required
from suboctave.model.elements.smoothness import PolynomialSampling
from suboctave.model.expressions.coefficients import Number

#: largest power of a displacement, as in texts: 2**1024 is no floating-point number any more
LARGEST_POWER = 1000


class PolynomialSpring(DeclaredElement):
    """`f = sum_p c_p u^p`, from `{power: coefficient}` or from the list `[c_1, c_2, ...]` of the factors of u, u^2, ...

    Powers are positive integers. Unit of `c_p`: force / length^p.
    """

    glyph = "spring"

    def __init__(
        self,
        dof: Dof | None = None,
        coefficients: Mapping[int, Number | None] | Sequence[Number] | None = None,
        *,
        direction: ArrayLike | None = None,
    ) -> None:
        kind = type(self).__name__
        required(kind, coefficients=coefficients)
        powers, factors = _read(kind, coefficients)
        self.powers = powers
        if type(self) is PolynomialSpring:
            self.coefficient_names = tuple(f"c{power}" for power in powers)
        super().__init__(dof, factors, direction=direction)

    def law_at(self, c: Array) -> PolynomialSampling:
        """A polynomial in u alone."""
        factors = [0.0] * (max(self.powers) + 1)
        for power, factor in zip(self.powers, c, strict=True):
            factors[power] = float(factor)
        return PolynomialSampling(max(self.powers), tuple(factors))

    def coefficient_tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        powers = np.array(self.powers)[:, None]
        return u**powers, powers * u ** (powers - 1), None

    def coefficient_curvature(self, u: Array, v: Array, c: Array) -> Array:
        """Zero: the force is linear in its coefficients."""
        return np.zeros((len(c), len(c), len(u)))


class CubicSpring(PolynomialSpring):
    """`f = coefficient * u^3`. Unit of the coefficient: force / length^3."""

    coefficient_names = ("coefficient",)

    def __init__(
        self, dof: Dof | None = None, coefficient: Number | None = None, *, direction: ArrayLike | None = None
    ) -> None:
        super().__init__(dof, {3: coefficient}, direction=direction)

    def tangent(self, u: Array, v: Array, c: Array) -> tuple[Array, Array, None]:
        """See `Element.tangent`; the shortest form, for integrations in time."""
        stiffness = c[0] * u * u
        return stiffness * u, 3.0 * stiffness, None


def _read(kind: str, coefficients: Any) -> tuple[tuple[int, ...], list[Number | None]]:
    """Powers in increasing order with their factors; factors that are the number zero are left out."""
    if isinstance(coefficients, Mapping):
        terms = list(coefficients.items())
    elif isinstance(coefficients, Sequence | np.ndarray) and not isinstance(coefficients, str):
        terms = list(enumerate(coefficients, start=1))
    else:
        raise InputError(f"{kind}: coefficients must be {{power: coefficient}} or a list, not {coefficients!r}")
    read: dict[int, Number | None] = {}
    for power, factor in terms:
        try:
            index = operator.index(power)
        except TypeError:
            raise InputError(f"{kind}: a power must be a positive integer, not {power!r}") from None
        if index < 1 or isinstance(power, bool):
            hint = "; a constant force is a load with static=" if index == 0 else ""
            raise InputError(f"{kind}: a power must be a positive integer, not {power!r}{hint}")
        if index > LARGEST_POWER:
            raise InputError(
                f"{kind}: a power is larger than {LARGEST_POWER}, from which on u**power is no number at u = 2 and "
                "beyond; a wall is an ElasticStop"
            )
        if not is_number(factor) or factor != 0:
            read[index] = factor
    if not read:
        raise InputError(f"{kind}: every coefficient is zero")
    powers = tuple(sorted(read))
    return powers, [read[power] for power in powers]
