"""The derivatives of coupled elements against finite differences: see `derivative_check`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError
from suboctave.model.coupled import CoupledElement
from suboctave.model.element import Array
from suboctave.model.sampling import CornerSampling

__all__ = ["check_coupled"]

_STEP = 2e-3


def check_coupled(
    element: CoupledElement, c: Array, u: ArrayLike | None, v: ArrayLike | None
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Worst relative error of every derivative, and what is wrong beyond numbers; u, v (m, N)."""
    q, theta = _states(element, c, u, v)
    size, nc, n = len(q), len(c), len(theta)
    f, f_q = element.tangent(q, theta, c)
    f_qq, f_qqq = element.curvature(q, theta, c), element.third(q, theta, c)
    f_c, f_qc = element.coefficient_tangent(q, theta, c)
    f_cc = element.coefficient_curvature(q, theta, c)
    messages = tuple(
        f"{name} has shape {np.shape(value)} instead of {shape}"
        for name, value, shape in (
            ("f", f, (n,)),
            ("f_q", f_q, (size, n)),
            ("f_qq", f_qq, (size, size, n)),
            ("f_qqq", f_qqq, (size, size, size, n)),
            ("f_c", f_c, (nc, n)),
            ("f_qc", f_qc, (nc, size, n)),
            ("f_cc", f_cc, (nc, nc, n)),
        )
        if np.shape(value) != shape
    )
    if messages:
        return {}, messages
    errors: dict[str, float] = {}
    names = [f"u{i}" for i in range(len(element.input_places))] + [f"v{i}" for i in range(len(element.input_places))]

    def compare(name: str, exact: Array, law: Callable[[float], Any], step: float) -> None:
        difference = (8.0 * (law(step) - law(-step)) - (law(2.0 * step) - law(-2.0 * step))) / (12.0 * step)
        noise = 1e-15 * float(np.max(np.abs(law(0.0)), initial=0.0)) / step
        largest = max(float(np.max(np.abs(exact), initial=0.0)), float(np.max(np.abs(difference), initial=0.0)))
        error = float(np.max(np.abs(difference - exact), initial=0.0))
        errors[name] = 0.0 if error <= noise else error / largest

    for i in range(size):
        step = _STEP * (float(np.max(np.abs(q[i]))) or 1.0)

        def at(h: float, i: int = i) -> Array:
            moved = q.copy()
            moved[i] += h
            return moved

        compare(f"f_{names[i]}", f_q[i], lambda h: element.tangent(at(h), theta, c)[0], step)
        compare(f"f_q{names[i]}", f_qq[i], lambda h: element.tangent(at(h), theta, c)[1], step)
        compare(f"f_qq{names[i]}", f_qqq[i], lambda h: element.curvature(at(h), theta, c), step)
    for j, name in enumerate(element.coefficient_names):
        step = _STEP * (abs(float(c[j])) or 1.0)

        def with_c(h: float, j: int = j) -> Array:
            moved = c.copy()
            moved[j] += h
            return moved

        compare(f"f_c[{name}]", f_c[j], lambda h: element.tangent(q, theta, with_c(h))[0], step)
        compare(f"f_qc[{name}]", f_qc[j], lambda h: element.tangent(q, theta, with_c(h))[1], step)
        compare(f"f_cc[{name}]", f_cc[j], lambda h: element.coefficient_tangent(q, theta, with_c(h))[0], step)
    if element.depends_on_time:
        again = element.tangent(q, theta + 2.0 * np.pi, c)[0]
        errors["period"] = float(np.max(np.abs(again - f))) / (float(np.max(np.abs(f))) or 1.0)
    return errors, ()


def _states(element: CoupledElement, c: Array, u: ArrayLike | None, v: ArrayLike | None) -> tuple[Array, Array]:
    """q (Q, N) and theta (N,), away from corners."""
    m = len(element.input_places)
    steps = np.arange(1, 24)
    kind = element.sampling(c)
    corners = kind if isinstance(kind, CornerSampling) else CornerSampling()
    reach = max([abs(p) for p in corners.points] + [0.0]) or 1.0
    rows = (
        [2.1 * reach * np.sin((1.3 + 0.7 * i) * steps + i) for i in range(m)] if u is None else list(np.atleast_2d(u))
    )
    if element.depends_on_velocity:
        fast = max([abs(p) for p in corners.velocities] + [0.0]) or 1.0
        rows += (
            [1.7 * fast * np.cos((1.7 + 0.6 * i) * steps) for i in range(m)] if v is None else list(np.atleast_2d(v))
        )
    if len({len(row) for row in rows}) != 1 or not np.all(np.isfinite(np.concatenate(rows))):
        raise InputError("u and v must be finite, with one row of equal length per input")
    q: Array = np.array(rows, dtype=float)
    keep = np.full(q.shape[1], True)
    # half powers that begin at a corner are too steep beside it for differences
    margin = 100.0 if corners.rough else 4.0
    for row, levels in ((0, corners.points), (m, corners.velocities)):
        for level in levels:
            keep &= np.abs(q[row] - level) > margin * _STEP * float(np.max(np.abs(q[row])))
    q = q[:, keep].copy()
    theta: Array = 0.37 + 0.9 * np.arange(q.shape[1], dtype=float)
    return q, theta
