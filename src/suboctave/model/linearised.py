"""A system linearised about a position: what its elements add to stiffness and damping there, and its eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from suboctave.model.elements.base import Array
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.system import System

#: degrees of freedom up to which all eigenvalues are asked for
ALL_EIGENVALUES = 400


def tangent_matrices(system: System, x: Array, values: Mapping[str, float]) -> tuple[Array, Array, Array]:
    """Mass, damping and stiffness of small motions about displacements x (n,), which stand still; each (n, n)."""
    n = system.n
    mass, damping, stiffness = (np.array(matrix) for matrix in system.matrices(values))
    for element in system.elements:
        law, rows, acting = as_coupled(element), np.asarray(element.inputs(n)), element.direction(n)
        q = rows @ x
        if element.depends_on_velocity:
            q = np.concatenate((q, np.zeros(len(rows))))
        _, slopes = law.tangent(q[:, None], np.zeros(1), element.coefficient_values(values))
        stiffness += np.outer(acting, slopes[: len(rows), 0] @ rows)
        if element.depends_on_velocity:
            damping += np.outer(acting, slopes[len(rows) :, 0] @ rows)
    return mass, damping, stiffness


def eigenvalues(system: System, x: Array, values: Mapping[str, float]) -> np.ndarray:
    """Eigenvalues lambda of small motions `exp(lambda t)` about displacements x (n,), shape (2 n,)."""
    mass, damping, stiffness = tangent_matrices(system, x, values)
    scale = 1.0 / np.sqrt(np.diag(mass))
    weighted = [matrix * scale[:, None] * scale for matrix in (mass, damping, stiffness)]
    n, inverse = system.n, np.linalg.inv(weighted[0])
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ weighted[2], -inverse @ weighted[1]]])
    return np.linalg.eigvals(companion)
