"""A system linearised about a position: what its elements add to stiffness and damping there, its eigenvalues and its
natural frequencies.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from suboctave.errors import InputError, shortened
from suboctave.model.elements.base import Array, numbers_of
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.elements.smoothness import levels
from suboctave.model.frequencies import NaturalFrequencies, natural_frequencies

#: degrees of freedom up to which all eigenvalues are asked for
ALL_EIGENVALUES = 400


def tangent_matrices(system: Any, x: Array, values: Mapping[str, float]) -> tuple[Array, Array, Array]:
    """Mass, damping and stiffness of small motions about displacements x (n,), which stand still; each (n, n)."""
    mass, damping, stiffness = (np.array(matrix) for matrix in system.matrices(values))
    for acting, by_x, by_v in _slopes(system, x, values):
        stiffness += np.outer(acting, by_x)
        damping += np.outer(acting, by_v)
    return mass, damping, stiffness


def _slopes(system: Any, x: Array, values: Mapping[str, float]) -> Iterator[tuple[Array, Array, Array]]:
    """Of each element the direction of its force (n,), and the derivatives of that by displacements and velocities."""
    n = system.n
    for element in system.elements:
        law, rows, acting = as_coupled(element), np.asarray(element.inputs(n)), element.direction(n)
        q = rows @ x
        if element.depends_on_velocity:
            q = np.concatenate((q, np.zeros(len(rows))))
        _, slopes = law.tangent(q[:, None], np.zeros(1), element.coefficient_values(values))
        by_v = slopes[len(rows) :, 0] @ rows if element.depends_on_velocity else np.zeros(n)
        yield acting, slopes[: len(rows), 0] @ rows, by_v


def small_vibrations(system: Any, count: int, about: Any, values: Mapping[str, float]) -> NaturalFrequencies:
    """See `System.natural_frequencies`; `values` of all parameters."""
    import scipy.sparse

    n = system.n
    x = np.zeros(n) if about is None else numbers_of(about)
    if x.shape != (n,) or not np.isfinite(x).all():
        raise InputError(f"about= must be {n} finite displacements, not {shortened(about)}")
    mass, damping, stiffness, structural = (part.sparse_value(values) for part in system.linear_parts)
    for acting, by_x, by_v in _slopes(system, x, values):
        if not (np.isfinite(by_x).all() and np.isfinite(by_v).all()):
            raise InputError(
                "an element has no slope there, so that nothing is linear about this position: give another, "
                "about=, or look at the structure without elements, system.linear().natural_frequencies()"
            )
        column = scipy.sparse.csr_array(acting[:, None])
        stiffness = stiffness + column @ scipy.sparse.csr_array(by_x[None])
        damping = damping + column @ scipy.sparse.csr_array(by_v[None])
    return natural_frequencies(
        mass,
        stiffness,
        count,
        system.dof_names,
        damping=damping,
        structural=None if system.structural.zero else structural,
        units=system.units,
        notes=[f"{label} just touches there: its slope on one side is taken" for label in _touching(system, x, values)],
    )


def _touching(system: Any, x: Array, values: Mapping[str, float]) -> Iterator[str]:
    """Elements that have a corner at a position."""
    for element in system.elements:
        coefficients, rows = element.coefficient_values(values), np.asarray(element.inputs(system.n))
        places = levels(element.sampling(coefficients), coefficients)
        if len(rows) == 1 and float(rows[0] @ x) in places:
            yield element.label


def eigenvalues(system: Any, x: Array, values: Mapping[str, float]) -> np.ndarray:
    """Eigenvalues lambda of small motions `exp(lambda t)` about displacements x (n,), shape (2 n,)."""
    mass, damping, stiffness = tangent_matrices(system, x, values)
    scale = 1.0 / np.sqrt(np.diag(mass))
    weighted = [matrix * scale[:, None] * scale for matrix in (mass, damping, stiffness)]
    n, inverse = system.n, np.linalg.inv(weighted[0])
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ weighted[2], -inverse @ weighted[1]]])
    return np.linalg.eigvals(companion)
