"""The period-doubling system of Alcorta, Baguet, Prabel, Piteau, Jacquet-Richardet (Nonlinear Dynamics 98, 2019).

A perturbation `exp(lambda t) phi(t)`, lambda = i w0/2, phi of the motion's own period and harmonics (their Eq. 13-18):

    R = 0,    N phi = 0,    q . phi_I = b,    N = R_X + lambda D1 + lambda^2 D2,    phi = phi_R + i phi_I,
    D1 = 2 omega (D kron M) + I kron C + T(f_v),    D2 = I kron M.

N is J_kappa at kappa = w0/2. In real numbers, for (phi_R, phi_I),

    B = [ Re N  -Im N ]        det B = |det N|^2.
        [ Im N   Re N ]

As it stands the system cannot be solved by Newton's method. The frequencies of N, -H + 1/2 .. H + 1/2, are not closed
under conjugation: det N is complex and, at real omega, comes near zero but for the harmonics left out does not reach
it. And where phi solves it so does `exp(i theta) phi`, of which the normalisation fixes one real number of two: the
Jacobian (Eq. 20) is singular to the same accuracy, whatever q, and exactly where |det N| is least. Its steps never
become small.

Here N phi = 0 is meant in the sense of least squares: along the response curve |g| is made least, g the bordered scalar
of N (`kinds.extended`). Its place differs from the zero of det J_half by what the harmonics left out make.
"""

from __future__ import annotations

from dataclasses import replace

from suboctave.bifurcation.bordered import bordered, null_vectors
from suboctave.continuation.linear import Factor, distance
from suboctave.curves.events.locate import Guess, Singular, locate_singular
from suboctave.curves.kinds.extended import PublishedDoubling
from suboctave.errors import ConvergenceError
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, operator

#: way, in units of the motion and of the parameter's range, from a solution to where J_half must be singular
_BESIDE = 0.05


def locate_doubling(guess: Guess) -> Singular:
    """A period doubling by the published system, with the null vectors of J_half there.

    `residual` is that of the whole system, |N phi| in units of omega^2 included: as large as the harmonics left out.
    ConvergenceError where Newton's method does not converge, or to a place where J_half is not singular: |g| may be
    least as well where multipliers only come near -1.
    """
    solution = locate_singular(guess, Kind.HALF, PublishedDoubling)
    state = solution.state
    beside = replace(guess, state=state, vectors=null_vectors(state, Kind.HALF))
    try:
        confirmed = locate_singular(beside, Kind.HALF)
    except ConvergenceError as failure:
        raise ConvergenceError(f"no period doubling where the system is nearly solved: {failure}") from None
    problem = beside.problem()
    here, there = (beside.vector(s) for s in (state, confirmed.state))
    if distance(there, here, problem.weights(here, 0.0)) > _BESIDE:
        raise ConvergenceError("no period doubling where the system is nearly solved: J_half is singular elsewhere")
    half = 0.5 * state.rate
    defect = abs(bordered(state, Kind.FREE, null_vectors(state, Kind.FREE, half), half).g) / state.omega**2
    return replace(solution, vectors=confirmed.vectors, residual=max(solution.residual, defect))


def log_determinant(state: BalanceState) -> float:
    """Natural logarithm of det B, up to a constant of the basis."""
    return 2.0 * Factor.of(operator(state, Kind.FREE, 0.5 * state.rate)).log_determinant
