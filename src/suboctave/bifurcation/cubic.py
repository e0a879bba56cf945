"""The cubic coefficient of a period doubling, along curves of them: the number of `normal_form_real`, sooner.

    c3 = psi.(R''[phi, X2] + R'''[phi, phi, phi] / 6),    J_0 X2 = -R''[phi, phi] / 2.

For laws of displacements alone phi and psi are real functions of time, `psi.R'''` is one sum over the instants at
which f_uuu is known, and `psi.R''[phi, .]` is the gradient that a located point has already. Everything else takes the
general way.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from suboctave.bifurcation.normal_form_real import Expansion
from suboctave.harmonic import real_form
from suboctave.harmonic.basis import Array
from suboctave.harmonic.bends import bends_of
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState
from suboctave.harmonic.third import Multilinear


def cubic_coefficient(
    state: BalanceState, phi: Array, psi: Array, by_motion: Array, solve: Callable[[Array], Array]
) -> float:
    """c3 of a period doubling.

    Parameters
    ----------
    phi, psi
        Right and left null vectors of J_half, in the coefficients' own units.
    by_motion
        Gradient of `psi.J_half phi` by the motion, shape (2 H + 1, size).
    solve
        Solves with J_0.
    """
    balance = state.balance
    if state.nodal or balance.any_moving or state.compliance is not None:
        own = Expansion(state, Kind.HALF, phi, psi, 0.0, 0.0, by_motion, 0.0, Multilinear(state))
        return own.cubic(solve(-0.5 * own.squared()))[0]
    right, left = phi.reshape(-1, balance.size), psi.reshape(-1, balance.size)
    second, third = np.zeros(state.x.shape), np.zeros(1)
    laws = balance.coefficients(state.values)[2]
    known = all(law.in_closed_form for law in laws)
    parts = state.closed_bends if known else [bend.parts for bend in bends_of(state)]
    for group, along in zip(balance.groups, parts, strict=True):
        for part in along:
            real_form.add_doubled_form(right, left, group.dofs, group.values, *part, second, third)
    bent = solve(-0.5 * second.ravel())
    return float(by_motion.ravel().dot(bent)) + float(third[0]) / 6.0
