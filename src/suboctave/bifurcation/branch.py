"""Branch points: two branches of motions cross (a symmetry breaks, or by design).

At a branch point `R_X` is singular with left null vector psi and `R_omega` lies in its range, `psi . R_omega = 0`. In
one parameter that is one condition too many, so the equations are unfolded: `[R + beta b; g; u . R_omega] = 0` in (X,
omega, beta). It converges as well where a broken symmetry leaves only the ghost of a branch point: then beta is not
zero, and the point is none. With `[J b; c^T 0] [w; .] = [R_omega; 0]`, the gradient of the last equation is `u .
R_omega,p - u . J_p w`.
"""

from __future__ import annotations

import numpy as np

from suboctave.bifurcation.bordered import Bordered, bordered, null_vectors, of_equations
from suboctave.bifurcation.solve import NOTHING, Extra, Guess, Singular, newton
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.perturbation import Kind, bilinear_gradient, parameter_gradient
from suboctave.harmonic.state import BalanceState

#: unfolding, in units of the forces that balance, above which a located point is no branch point: a hundred times what
#: rounding makes of a branch point that a symmetry forces. One of beta parts the branches of a pitchfork by beta^(1/3)
_UNFOLDING = 1e-13


def locate_branch_point(guess: Guess) -> Singular:
    """Locate a branch point in the free parameter.

    Raises
    ------
    ConvergenceError
        If Newton's method fails, or converges to a point whose unfolding is not zero: an imperfect (broken) branch
        point.
    """
    borders = null_vectors(guess.state(), Kind.INTEGER)
    start = guess.state()
    rows = 1.0 / start.balance.per_unknown(start.balance.scales()[1])
    # at rest nothing balances, yet a motion may branch off (parametric excitation)
    force = max(start.force_scale(), guess.size * guess.omega**2, NOTHING)
    last: list[Bordered] = []

    def augmentation(state: BalanceState, extra: Array) -> tuple[list[Extra], Array | None, list[Array]]:
        nonlocal borders
        b = bordered(state, Kind.INTEGER, borders)
        column = force * of_equations(state, Kind.INTEGER, borders.left) * rows
        borders = b.vectors
        last[:] = [b]
        gx, rates, _ = b.gradient((guess.name,))
        size = state.omega**2
        extras = [Extra.of(b.g.real, gx.real, rates[guess.name].real, (0.0,), size)]
        # w with J w + b (.) = R_name, c . w = 0, in weighted variables
        slope = state.residual_by(guess.name)
        rhs = np.append(slope * b.scale, 0.0)
        w = b.factor.solve(rhs)[:-1] * b.scale
        first = parameter_gradient(state, b.left, guess.name, (guess.name,))
        second = bilinear_gradient(state, Kind.INTEGER, b.left, w, (guess.name,))
        value = float(b.left @ slope)
        size = force / guess.span
        by = float((first.rates[guess.name] - second.rates[guess.name]).real)
        extras.append(Extra.of(value, state.balance.packed((first.x - second.x).real), by, (0.0,), size))
        return extras, extra[0] * column, [column]

    state, extra, residual, iterations = newton(guess, np.zeros(1), np.ones(1), augmentation)
    if abs(extra[0]) > _UNFOLDING:
        raise ConvergenceError(
            f"no branch point: its unfolding is {extra[0]:.1e} (a broken symmetry leaves a ghost here)"
        )
    return Singular(state, last[0].vectors, 0.0, residual, iterations)
