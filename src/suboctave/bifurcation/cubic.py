"""The cubic coefficient of a period doubling, along curves of them: the number of `normal_form_real`, sooner.

    c3 = psi.(R''[phi, X2] + R'''[phi, phi, phi] / 6),    J_0 X2 = -R''[phi, phi] / 2.

For laws of displacements alone phi and psi are real functions of time, `psi.R'''` is one sum over the instants at
which f_uuu is known, and `psi.R''[phi, .]` is the gradient that a located point has already; all of it is one compiled
call where the laws are known in closed form. Everything else takes the general way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from suboctave.bifurcation.normal_form_real import Expansion
from suboctave.compiled import at_hand, kernel, ready
from suboctave.continuation.lapack import solve_leading
from suboctave.continuation.linear import LeadingBlock
from suboctave.harmonic import real_form
from suboctave.harmonic.basis import Array
from suboctave.harmonic.bends import bends_of
from suboctave.harmonic.closed_bends import bends_of_corners, bends_of_polynomial, bends_of_smooth_steps
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.real_form import add_doubled_form
from suboctave.harmonic.state import BalanceState
from suboctave.harmonic.third import Multilinear


@kernel()
def closed_cubic(
    phi, psi, by_motion, motions, starts, dofs, shape, pieces, first, polynomial, grid, nodes, steps, step_first, noted,
    transposed, pivots, columns, corner, corner_pivots, weights,
):  # fmt: skip
    """c3 where all laws are known in closed form.

    phi, psi (2 H + 2, n): right and left null vector; by_motion (2 H + 1, n): gradient of psi.J_half phi; motions, ...,
    nodes: as in `evaluation.evaluate`; steps, step_first, noted: arctan steps, None without any, and their nodes with
    the motion along their only direction; the rest: J_0 with its columns over `weights`, as `lapack.leading_block`
    leaves it.
    """
    second, third = np.zeros(by_motion.shape), np.zeros(1)
    level = np.zeros(0)
    for g in range(motions.shape[0]):
        c, at, along = motions[g], dofs[starts[g] : starts[g + 1]], shape[starts[g] : starts[g + 1]]
        if pieces is not None and first[g + 1] > first[g]:
            bends = bends_of_corners(c, pieces[first[g] : first[g + 1]], grid[0], grid[1])
            add_doubled_form(phi, psi, at, along, bends[0], bends[1], bends[2], bends[3], bends[4], second, third)
        if polynomial.shape[1] > 2:
            found = bends_of_polynomial(c, polynomial[g], nodes[0], nodes[1])
            add_doubled_form(phi, psi, at, along, nodes[0], nodes[1], found[0], found[1], level, second, third)
        if steps is not None and step_first[g + 1] > step_first[g]:
            found = bends_of_smooth_steps(noted, steps[step_first[g] : step_first[g + 1]])
            add_doubled_form(phi, psi, at, along, noted[0], noted[1], found[0], found[1], level, second, third)
    bent = second.ravel()
    for i in range(bent.shape[0]):
        bent[i] *= -0.5
    bent = solve_leading(transposed, pivots, columns, corner, corner_pivots, bent)
    gradient, total = by_motion.ravel(), third[0] / 6.0
    for i in range(bent.shape[0]):
        total += gradient[i] * bent[i] / weights[i]
    return total


def cubic_coefficient(
    state: BalanceState, phi: Array, psi: Array, by_motion: Array, block: LeadingBlock, weights: Array
) -> float:
    """c3 of a period doubling.

    Parameters
    ----------
    phi, psi
        Right and left null vectors of J_half, in the coefficients' own units.
    by_motion
        Gradient of `psi.J_half phi` by the motion, shape (2 H + 1, size).
    block, weights
        J_0, its columns divided by the weights, one for every coefficient.
    """
    balance = state.balance
    if state.nodal or balance.any_moving or state.compliance is not None:
        own = Expansion(state, Kind.HALF, phi, psi, 0.0, 0.0, by_motion, 0.0, Multilinear(state))
        return own.cubic(block.solve(-0.5 * own.squared()) / weights)[0]
    right, left = phi.reshape(-1, balance.size), psi.reshape(-1, balance.size)
    at_once = _at_once(state, right, left, by_motion, block, weights)
    if at_once is not None:
        return at_once
    second, third = np.zeros(state.x.shape), np.zeros(1)
    laws = balance.coefficients(state.values)[2]
    known = all(law.in_closed_form for law in laws)
    parts = state.closed_bends if known else [bend.parts for bend in bends_of(state)]
    for group, along in zip(balance.groups, parts, strict=True):
        for part in along:
            real_form.add_doubled_form(right, left, group.dofs, group.values, *part, second, third)
    bent = block.solve(-0.5 * second.ravel()) / weights
    return float(by_motion.ravel().dot(bent)) + float(third[0]) / 6.0


def _at_once(
    state: BalanceState, phi: Array, psi: Array, by_motion: Array, block: LeadingBlock, weights: Array
) -> float | None:
    """In one compiled call, None where that does not go."""
    balance, (packed, nodes) = state.balance, state.packed
    noted = real_form.noted_nodes(state, packed)
    if block.whole.singular or (packed.sampled and not (packed.told and noted.shape[1])):
        return None
    pieces = packed.pieces if len(packed.pieces) else None
    laws = (*balance.directions, pieces, packed.first, packed.polynomial, balance.grid, nodes)
    steps = (packed.steps if packed.told else None, packed.step_first, noted)
    factors = (block.whole.lu.T, block.whole.pivots, block.columns, block.corner, block.pivots, weights)
    given = (phi, psi, by_motion, state.motions, *laws, *steps, *factors)
    asked = (
        (bends_of_corners, len(packed.pieces)),
        (bends_of_polynomial, packed.polynomial.shape[1] > 2),
        (bends_of_smooth_steps, packed.told),
    )
    called: list[Callable[..., Any]] = [add_doubled_form, solve_leading]
    called += [part for part, needed in asked if needed]
    # what it calls is compiled one by one, not all at one go
    if not (at_hand(closed_cubic, *given) or all(map(ready, called))):
        return None
    return float(closed_cubic(*given))
