"""The matrix that Newton's method factorises along a curve of bifurcations, in one compiled call."""

from __future__ import annotations

import numpy as np

from suboctave.compiled import kernel
from suboctave.harmonic.evaluation import jacobian


@kernel()
def bordered_by_rows(
    table, moving, rate, starts, dofs, shape, matrices, multiples, omega, x, others, rows, force, row, weights
):
    """Transpose of `[R_u; force G_u; row]`, columns of the first two over `weights`, for u = (X, extra, omega, others).

    Parameters
    ----------
    table, ..., x
        As in `evaluation.jacobian`.
    others
        R differentiated by the free parameters besides omega, (k, N).
    rows, force
        Derivatives of the scalar equations by u, and their unit.
    row
        The last row.
    """
    n, last, count = x.shape[0] * x.shape[1], weights.shape[0] - 1, others.shape[0]
    extended = np.zeros((n, n + 1))
    # not a literal, for which the Jacobian would be compiled once more
    mean = n > 0
    jacobian(extended, table, moving, rate, mean, starts, dofs, shape, matrices, multiples, omega, x)
    out = np.empty((last + 1, last + 1))
    for j in range(last + 1):
        scale = 1.0 / weights[j]
        for i in range(n):
            if j < n:
                out[j, i] = extended[i, j] * scale
            elif j < last - count:
                # R does not depend on the extra unknowns
                out[j, i] = 0.0
            elif j == last - count:
                out[j, i] = extended[i, n] * scale
            else:
                out[j, i] = others[j - last + count - 1, i] * scale
        for r in range(rows.shape[0]):
            out[j, n + r] = rows[r, j] * force * scale
        out[j, last] = row[j]
    return out


__all__ = ["bordered_by_rows"]
