"""The cubic coefficient of a period doubling, along curves of them: the number of `normal_form_real`, sooner.

    c3 = psi.(R''[phi, X2] + R'''[phi, phi, phi] / 6),    J_0 X2 = -R''[phi, phi] / 2.

`psi.R''[phi, .]` is the gradient that a located point has already.
"""

from __future__ import annotations

from suboctave.bifurcation.normal_form.real import Expansion
from suboctave.continuation.linear import LeadingBlock
from suboctave.harmonic.basis import Array
from suboctave.harmonic.derivatives import Multilinear
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind


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
    own = Expansion(state, Kind.HALF, phi, psi, 0.0, 0.0, by_motion, 0.0, Multilinear(state))
    return own.cubic(block.solve(-0.5 * own.squared()) / weights)[0]
