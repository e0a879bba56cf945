"""How few states serve: the slow blocks of a structure as they are, and all faster ones together as few others.

Blocks that are too fast for a motion (`blocks`) need not be followed one by one. What they are to the forces is their
flexibility `H(s) = G (s - L)^-1 B`, and for forces slower than they are its first derivatives at rest tell nearly all
of it. A substitute with the matrices

    L_e = (W^T V)^-1 W^T L V,   B_e = (W^T V)^-1 W^T B,   G_e = G V,
    V = [L^-1 B, ..., L^-2p B],   W^T = [G L^-1; ...; G L^-2p],

has 2 p states for every channel, and its H and 4 p - 1 derivatives of that are those of all fast blocks (two-sided
Lanczos: Bai, Applied Numerical Mathematics 43 (2002) 9-44). Its eigenvectors make blocks of it. Of the order 0 it is a
spring, `q = R F` with the flexibility at rest, without states. A `Level` is one such choice; `left_out` tells what it
costs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from suboctave.floquet.blocks import Blocks, States, in_blocks, in_one, of_blocks, separated, states_of
from suboctave.floquet.left_out import Jumps, LeftOut, Motions, left_out, moved_without
from suboctave.harmonic.aft.channel import Group
from suboctave.harmonic.basis import Array
from suboctave.harmonic.linear_part import LinearPart

#: about how many numbers of blocks are tried: what belongs to each of them serves other motions as well
_CUTS = 12
#: orders of substitutes, those first that are most often the least work
_ORDERS = (1, 2, 0)
#: share of its states that another level must save to be looked for
_FEWER = 0.1
#: condition of a substitute's states beyond which it is none
_PARALLEL = 1e6
#: part of a direction that others do not hold, relative, below which it depends on them
_DEPENDENT = 1e-6
#: how much slower than the slowest block that it stands for a substitute may be
_SLOWER = 1e-3


@dataclass(frozen=True, eq=False)
class Level:
    """What has states: B blocks with S states, G channels. See `blocks.Blocks` for what is not said here.

    slow, own
        How many blocks are the structure's own, the first ones, and how many states these have; others are a
        substitute.
    motion, first, driven, read, coupling, rates, decays, flexibility
        (B, 2, 2), (B + 1,), (S, G), (2, G, S), (B, 2, 2 G G), (B,), (B,), (B, G, G).
    stiffening
        How fast a unit force in one channel makes another move, (G, G): what stiffness adds to squared rates.
    flexible
        R of what has no states, (G, G).
    left_out
        What it leaves out; None where that is nothing.
    states, steepest
        S, and the least of the decays.
    sizes
        Roots of how far a force in a channel drives the structure's own blocks in units of how much channels read of
        them, and the inverse, (2, own).
    """

    slow: int
    own: int
    motion: Array
    first: np.ndarray
    driven: Array
    read: Array
    coupling: Array
    rates: Array
    decays: Array
    flexibility: Array
    stiffening: Array
    flexible: Array
    left_out: LeftOut | None
    states: int
    steepest: float
    sizes: Array


class Along(NamedTuple):
    """A motion as levels are chosen by it: the first arguments of `left_out.moved_without`."""

    known: Motions
    rate: float
    last: float
    jumps: Jumps


class Choice(NamedTuple):
    """A level, how far what it leaves out moves multipliers, and the exponents of the blocks of its own states within a
    period, (own,); see `left_out.moved_without`.
    """

    level: Level
    moved: float
    shifts: Array


class Levels:
    """The levels of a structure, made when they are asked for."""

    def __init__(self, blocks: Blocks) -> None:
        self.blocks = blocks
        whole = _level(blocks, blocks.coupled)
        self.whole = Choice(whole, 0.0, np.zeros(whole.own))
        self._cuts = np.arange(0, blocks.coupled, max(1, blocks.coupled // _CUTS))
        self._first, self._rates = blocks.first[self._cuts], blocks.rates[self._cuts]
        #: of the cuts the first one that leaves no fewer states worth it
        self._end = int(self._first.searchsorted((1.0 - _FEWER) * whole.states))
        self._made: dict[tuple[int, int], Level | None] = {}

    def of(self, slow: int, order: int) -> Level | None:
        """The first `slow` blocks of those that take part, with a substitute of an order for all others; None where
        there is none that has fewer states.
        """
        at = slow, order
        if at not in self._made:
            self._made[at] = self._make(slow, order)
        return self._made[at]

    def _make(self, slow: int, order: int) -> Level | None:
        blocks = self.blocks
        if np.abs(blocks.exponents[blocks.first[slow] : blocks.first[blocks.coupled]]).min() == 0.0:
            return None  # what is free to move is no spring
        if order == 0:
            return _level(blocks, slow, None, blocks.flexibility[slow : blocks.coupled].sum(axis=0))
        few = _substitute(blocks, slow, order)
        return None if few is None else _level(blocks, slow, few)

    def fewest(self, along: Callable[[], Along], resolved: float, tolerable: float) -> Choice:
        """The level with about the fewest states of those by which multipliers move no farther than is tolerable; all
        blocks with rates up to `resolved` have states.
        """
        least, resolving = self.whole, int(self._rates.searchsorted(resolved, side="right"))
        if resolving >= self._end:
            return least
        motion, count = along(), 2 * len(self.blocks.active)
        for order in _ORDERS:
            # the more slow blocks there are, the less is left out
            most = (1.0 - _FEWER) * least.level.states - count * order
            low, high = resolving, int(self._first.searchsorted(most))
            while low < high:
                # beside one that serves another seldom does with fewer states
                middle = (low + high) // 2 if order == _ORDERS[0] else high - 1
                choice = self._tried(motion, int(self._cuts[middle]), order, tolerable)
                if choice is None:
                    low = middle + 1
                else:
                    high, least = middle, choice
        return least

    def _tried(self, along: Along, slow: int, order: int, tolerable: float) -> Choice | None:
        """A level, None where it leaves out too much or there is none."""
        level = self.of(slow, order)
        if level is None or level.left_out is None:
            return None
        shifts = np.empty(slow)
        moved = moved_without(*along, level.left_out, tolerable, shifts)
        if moved > tolerable:
            return None
        return Choice(level, moved, np.repeat(shifts, np.diff(level.first[: slow + 1])))


@lru_cache(maxsize=16)
def levels_of(linear: LinearPart, groups: tuple[Group, ...]) -> Levels:
    """The levels of the linear part with the channels of groups."""
    return Levels(in_blocks(linear, groups))


def _substitute(blocks: Blocks, slow: int, order: int) -> States | None:
    """That of the blocks from `slow` on; None where these have no more states than it, or it would be no damped motion
    as fast as they are.
    """
    first, last, count = blocks.first[slow], blocks.first[blocks.coupled], len(blocks.active)
    size = int(last - first)
    if size <= 2 * order * count:
        return None
    whole = in_one(blocks.motion[slow : blocks.coupled], blocks.first[slow : blocks.coupled + 1])
    inverse: Array = np.asarray(np.linalg.inv(whole), dtype=float)
    driven, read = blocks.driven[first:last], blocks.read[:, :, first:last]
    right = _spanned(inverse @ driven, inverse, 2 * order)
    left = _spanned(inverse.T @ read[0].T, inverse.T, 2 * order)
    if right.shape[1] != left.shape[1]:
        return None
    between = left.T @ right
    if not np.linalg.cond(between) < _PARALLEL:
        return None
    onto = np.linalg.solve(between, left.T)
    try:
        basis, back, matrices = separated(onto @ whole @ right)
    except np.linalg.LinAlgError:  # two of its eigenvectors are the same
        return None
    values = [np.linalg.eigvals(matrix) for matrix in matrices]
    slowest, steepest = min(np.abs(v).min() for v in values), max(v.real.max() for v in values)
    damped = steepest <= max(0.0, float(blocks.decays[slow : blocks.coupled].max()))
    if not (np.linalg.cond(basis) < _PARALLEL and damped and slowest >= blocks.rates[slow] * (1.0 - _SLOWER)):
        return None
    return states_of(matrices, back @ onto @ driven, read @ right @ basis)


def _spanned(vectors: Array, inverse: Array, powers: int) -> Array:
    """An orthonormal basis of some vectors, columns, and of what powers of the inverse make of them, so many in all."""
    basis = np.zeros((len(vectors), 0))
    for _ in range(powers):
        for _ in range(2):
            vectors = vectors - basis @ (basis.T @ vectors)
        length = np.linalg.norm(vectors, axis=0)
        u, sizes, _ = np.linalg.svd(vectors / np.where(length > 0.0, length, 1.0), full_matrices=False)
        new = u[:, sizes > _DEPENDENT * sizes.max(initial=0.0)]
        basis, vectors = np.concatenate((basis, new), axis=1), inverse @ new
    return basis


def _sizes(blocks: Blocks, slow: int) -> Array:
    """See `Level.sizes`."""
    ends, own = blocks.first[: slow + 1], int(blocks.first[slow])
    drives, reads = (blocks.driven[:own] ** 2).sum(axis=1), (blocks.read[0, :, :own] ** 2).sum(axis=0)
    ratio = np.repeat((of_blocks(np.add, drives, ends) / of_blocks(np.add, reads, ends)) ** 0.25, np.diff(ends))
    return np.stack((ratio, 1.0 / ratio))


def _level(blocks: Blocks, slow: int, few: States | None = None, flexible: Array | float = 0.0) -> Level:
    """The first `slow` blocks, with a substitute and a spring for the others."""
    own, count = int(blocks.first[slow]), len(blocks.active)
    if few is None:
        few = states_of([], np.zeros((0, count)), np.zeros((2, count, 0)))
    matrices = [few.motion[b, :width, :width] for b, width in enumerate(np.diff(few.first))]
    exponents = np.concatenate((blocks.exponents[:own], *map(np.linalg.eigvals, matrices)))
    bending = [
        -few.read[0][:, s:e] @ np.linalg.solve(matrix, few.driven[s:e])
        for matrix, (s, e) in zip(matrices, pairwise(few.first), strict=True)
    ]
    first = np.concatenate((blocks.first[: slow + 1], own + few.first[1:]))
    rates, decays = (of_blocks(np.maximum, part, first) for part in (np.abs(exponents), exponents.real))
    springs = np.zeros((count, count)) + flexible
    coupling = np.concatenate((blocks.coupling[:slow], few.coupling))
    return Level(
        slow, own, np.concatenate((blocks.motion[:slow], few.motion)), first,
        np.concatenate((blocks.driven[:own], few.driven)), np.concatenate((blocks.read[:, :, :own], few.read), axis=2),
        coupling, rates, decays,
        np.concatenate((blocks.flexibility[:slow], *(one[None] for one in bending))),
        np.abs(coupling[:, 0].sum(axis=0)).reshape(2, count, count)[1], springs,
        left_out(blocks, slow, few, exponents[own:], springs) if slow < blocks.coupled else None,
        int(first[-1]), float(decays.min(initial=0.0)), _sizes(blocks, slow),
    )  # fmt: skip
