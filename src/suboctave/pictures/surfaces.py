"""The surface that closed branches at successive values of a parameter lie on.

Each loop is cut at its least and its largest frequency into two arcs, and the places at equal shares of their lengths
are joined from loop to loop. In between that is interpolation: a picture of how the loops hang together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["surface"]

_SAMPLES = 60


def surface(loops: Sequence[np.ndarray], tips: Sequence[np.ndarray] = ()) -> np.ndarray | None:
    """The grid (3, rows, columns) through loops and points that they shrink to, in the order of the parameter.

    `loops`, (3, vertices) each: frequency and parameter, in either order, and the quantity upwards, once around;
    `tips`, (3,) each. None where there are fewer than two rows.
    """
    if not loops or len(loops) + len(tips) < 2:
        return None
    along = 0 if np.ptp(loops[0][0]) > 0.0 else 1
    scale = np.max([np.ptp(loop, axis=1) for loop in loops], axis=0)[:, None]
    scale[scale == 0.0] = 1.0
    ordered = sorted(loops, key=lambda loop: float(loop[1 - along][0]))
    rows: list[np.ndarray] = []
    for loop in ordered:
        both = _arcs(loop, along, scale)
        if rows:
            far = [float(np.sum(((arcs - rows[-1]) / scale)[[along, 2]] ** 2)) for arcs in both]
        else:  # the first one begins with its upper arc
            far = [-float(np.mean(arcs[2, :_SAMPLES])) for arcs in both]
        rows.append(both[int(np.argmin(far))])
    for tip in tips:
        rows.append(np.repeat(np.asarray(tip, dtype=float)[:, None], 2 * _SAMPLES, axis=1))
    rows.sort(key=lambda row: float(row[1 - along][0]))
    return np.stack(rows, axis=1)


def _arcs(loop: np.ndarray, along: int, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The loop from its largest frequency to the least and back, (3, 2 samples), in both senses."""
    vertices = loop[:, :-1] if np.allclose(loop[:, 0], loop[:, -1]) else loop
    vertices = np.roll(vertices, -int(np.argmax(vertices[along])), axis=1)
    turn = int(np.argmin(vertices[along]))
    there, back = vertices[:, : turn + 1], np.column_stack([vertices[:, turn:], vertices[:, 0]])
    first, second = _spread(there, scale), _spread(back, scale)
    return np.hstack([first, second]), np.hstack([second[:, ::-1], first[:, ::-1]])


def _spread(arc: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Places at equal shares of the length of an arc, (3, samples)."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(arc / scale, axis=1), axis=0))])
    return np.array([np.interp(np.linspace(0.0, length[-1], _SAMPLES), length, row) for row in arc])
