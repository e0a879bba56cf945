"""A structure while contacts hold it: its blocks with the constant stiffnesses of those that are closed.

While channels have a constant stiffness, `F = K q + F'` between the instants at which contacts begin and end, the
motion is linear with constant coefficients as well: with `M = (1 - R K)^-1`,

    z' = (L + B K M G) z + B (1 - K R)^-1 F',    q = M G z + M R F',

which eigenvectors separate into blocks again, a `Form` of the structure. The forms along a period, one after the other,
make the motion of a structure with stops a product of exact exponentials.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from suboctave.floquet.blocks import in_one, separated, states_of
from suboctave.floquet.levels import Level
from suboctave.harmonic.basis import Array

#: condition of eigenvectors beyond which rounding would be seen in multipliers: contacts are then followed by panels
_PARALLEL = 1e6
_EPS = float(np.finfo(float).eps)


class Form(NamedTuple):
    """The blocks with states while channels have a constant stiffness; S states in B blocks, G channels.

    motion, first, driven, read
        See `Blocks`: (B, 2, 2), (B + 1,), (S, G), (2, G, S).
    coupling
        See `Blocks`, the blocks in a row: (2 G G, 2 B).
    flexible
        Of what has no states, (G, G).
    out, back
        The states of the free blocks from those of this form, and these from those, (S, S); empty if they are the same.
    rounding
        See `Blocks`.
    """

    motion: Array
    first: np.ndarray
    driven: Array
    read: Array
    coupling: Array
    flexible: Array
    out: Array
    back: Array
    rounding: float


_SAME = np.empty((0, 0))


@lru_cache(maxsize=128)
def form_of(level: Level, held: tuple[float, ...]) -> Form | None:
    """What has states at a level, with the stiffness `held` (G,) at the channels; None where eigenvectors are so nearly
    parallel that digits would be lost.
    """
    first, size, count = level.first, level.states, len(level.flexible)
    free = Form(
        level.motion, first, level.driven, level.read, _in_a_row(level.coupling), level.flexible, _SAME, _SAME, 0.0
    )
    if not any(held) or not size:
        return free
    stiffness, flexible, one = np.diag(held), free.flexible, np.eye(count)
    raised = np.linalg.inv(one - flexible @ stiffness)
    matrix = in_one(level.motion, first) + free.driven @ (stiffness @ raised @ free.read[0])
    try:
        basis, inverse, found = separated(matrix)
    except np.linalg.LinAlgError:  # two of them are the same
        return None
    condition = float(np.linalg.norm(basis) * np.linalg.norm(inverse))
    if not condition < _PARALLEL:
        return None
    driven = inverse @ free.driven @ np.linalg.inv(one - stiffness @ flexible)
    read = np.stack((raised @ free.read[0] @ basis, free.read[1] @ basis))
    held_blocks = states_of(found, driven, read)
    return Form(
        held_blocks.motion, held_blocks.first, driven, read, _in_a_row(held_blocks.coupling), raised @ flexible, basis,
        inverse, condition * _EPS,
    )  # fmt: skip


def _in_a_row(coupling: Array) -> Array:
    blocks, two, pairs = coupling.shape
    return np.ascontiguousarray(coupling.reshape(two * blocks, pairs).T)


class Forms(NamedTuple):
    """Forms one after the other, R of them: see `Form`, with an index more.

    There are as many blocks as in the form with most: others have blocks without states behind them. `turns` (R + 1, S,
    S) has the states of each form from those of the one before, the first and what comes after the last being free;
    `turning` (R + 1,) where these are not the same.
    """

    motion: Array
    first: np.ndarray
    driven: Array
    read: Array
    coupling: Array
    flexible: Array
    turns: Array
    turning: np.ndarray


@lru_cache(maxsize=4)
def forms_along(level: Level, sequence: tuple[tuple[float, ...], ...]) -> tuple[Forms, float]:
    """The forms of a sequence of stiffnesses (G,), and the largest of their relative errors by rounding; where there is
    none for a stiffness, that of the free structure.
    """
    free = form_of(level, (0.0,) * len(level.flexible))
    assert free is not None
    chosen = [form_of(level, held) or free for held in sequence]
    most, size = max([len(form.motion) for form in chosen]), len(free.driven)
    motion, first = np.zeros((len(chosen), most, 2, 2)), np.full((len(chosen), most + 1), size)
    coupling = np.zeros((len(chosen), len(free.coupling), 2 * most))
    for r, form in enumerate(chosen):
        blocks = len(form.motion)
        motion[r, :blocks], first[r, : blocks + 1] = form.motion, form.first
        coupling[r, :, : 2 * blocks] = form.coupling
    steps = list(pairwise([free, *chosen, free]))
    turning = np.array([old is not new for old, new in steps])
    turns = np.empty((len(turning) if turning.any() else 0, size, size))
    for r in turning.nonzero()[0].tolist():
        old, new = steps[r]
        if new is free or old is free:
            turns[r] = old.out if new is free else new.back
        else:
            np.dot(new.back, old.out, out=turns[r])
    # of many small arrays `np.array` makes one without asking each what it is
    driven, read = np.array([form.driven for form in chosen]), np.array([form.read for form in chosen])
    flexible, rounding = np.array([form.flexible for form in chosen]), max([form.rounding for form in chosen])
    return Forms(motion, first, driven, read, coupling, flexible, turns, turning), rounding
