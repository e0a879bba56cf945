"""Nodes of Gauss-Lobatto rules on panels, and moments of the polynomials through them."""

from __future__ import annotations

import numpy as np

#: nodes per panel, both ends among them: quadrature of order 12
ORDER = 7


def lobatto(order: int) -> np.ndarray:
    """Nodes on [-1, 1]: the ends and the extrema of the Legendre polynomial of degree order - 1; shape (order,)."""
    slope = np.polynomial.Legendre.basis(order - 1).deriv()
    inner = np.sort(slope.roots().real)
    for _ in range(3):
        inner -= slope(inner) / slope.deriv()(inner)
    return np.concatenate(([-1.0], inner, [1.0]))


NODES = lobatto(ORDER)


def moments(low: float, high: float, count: int) -> np.ndarray:
    """Integrals over (low, high) of the polynomials that are one at a node and zero at the others, times powers of
    `(s - middle) / (high - low)`, 0 .. count - 1; shape (count, ORDER).
    """
    points, weights = np.polynomial.legendre.leggauss(ORDER + 2)
    s = 0.5 * (low + high) + 0.5 * (high - low) * points
    others = [np.delete(NODES, j) for j in range(ORDER)]
    basis = np.array([np.prod((s[:, None] - o) / (NODES[j] - o), axis=1) for j, o in enumerate(others)])
    return np.array([basis @ (0.5 * (high - low) * weights * (0.5 * points) ** i) for i in range(count)])
