"""What happens beside a bifurcation: the coefficients of its normal form, and whether it is super- or subcritical.

A motion X at a bifurcation, phi and psi the right and left null vectors of its operator J_kappa, delta the distance in
the free parameter p, eps the amplitude along phi. With X_p the change of the motion along its branch, `J_0 X_p = -R_p`,
and `J_0 X2 = -R''[phi, phi] / 2` what the perturbation does to the motion itself, the amplitude obeys

    LP    g eps' = b delta + a eps^2,          a = psi.R''[phi, phi] / 2, b = psi.R_p
    PD    g eps' = (d delta + c3 eps^2) eps,   c3 = psi.(R''[phi, X2] + R'''[phi, phi, phi] / 6),
                                               d = psi.(J_p phi + R''[phi, X_p])
    BP    the same at a pitchfork; see `normal_form_branch`
    NS    A' = (d delta + c3 |A|^2) A, complex; see `normal_form_torus`

(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., chapters 5 and 9, written for harmonic balance: no
reduction to a map is needed). `g = i psi.dJ/dkappa phi` is what a growth of the perturbation, `kappa -> kappa - i s`,
does to the equations; psi is turned so that g > 0. Then `c3 < 0` is supercritical: motions that branch off lie where
the critical multiplier of the parent is outside the circle, and attract in the critical direction, whatever the other
multipliers do. They follow `p = p_0 + curvature eps^2`, `curvature = -c3 / d`.

phi has unit length weighted by masses, `sum of m_i phi_i^2 = 1` over all coefficients; psi too.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from suboctave.bifurcation.bordered import NullVectors, null_vectors
from suboctave.bifurcation.normal_form import (
    branch as normal_form_branch,
    real as normal_form_real,
    torus as normal_form_torus,
)
from suboctave.bifurcation.normal_form.terms import ROUNDING, NormalForm, Terms, with_criticality
from suboctave.errors import ConvergenceError, InputError, suggest
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind

__all__ = ["FORMS", "NormalForm", "normal_form"]

#: the kinds that have one, and the operators that are singular there
FORMS = {"LP": Kind.INTEGER, "BP": Kind.INTEGER, "PD": Kind.HALF, "NS": Kind.FREE}
_TERMS: dict[str, Callable[[BalanceState, NullVectors, str, float], Terms]] = {
    "LP": normal_form_real.limit_point,
    "PD": normal_form_real.period_doubling,
    "BP": normal_form_branch.branch_point,
    "NS": normal_form_torus.torus,
}


def normal_form(kind: str, state: BalanceState, vectors: NullVectors, name: str, kappa: float = 0.0) -> NormalForm:
    """The normal form of a located bifurcation.

    Parameters
    ----------
    kind
        "LP", "BP", "PD" or "NS".
    state
        The equations at the located motion.
    vectors
        Null vectors of its singular operator, weighted by masses (`Bifurcation.null_vectors`).
    name
        The free parameter, "omega" or one of the system's.
    kappa
        Frequency of the perturbation at an NS, rad per time.
    """
    if kind not in FORMS:
        raise InputError(f"a {kind!r} has no normal form; it is for LP, BP, PD and NS")
    known = ["omega", *state.values]
    if name not in known:
        raise InputError(f"unknown parameter {name!r}{suggest(name, known)}")
    terms = _TERMS[kind]
    whole = terms(state, vectors, name, kappa)
    errors = {key: ROUNDING * size for key, size in whole.sizes.items()}
    # harmonics left out matter like 1 / H where a contact is hard; two numbers, as a single change may vanish by chance
    for high, missing in ((2 * state.basis.harmonics // 3, 2.0), (state.basis.harmonics // 2, 1.0)):
        coarse = _coarser(state, vectors, FORMS[kind], kappa, high)
        if coarse is None:
            continue
        other = terms(*coarse, name, kappa)
        for key in errors:
            change = whole.coefficients[key] - other.coefficients[key] * whole.unit / other.unit
            errors[key] = max(errors[key], missing * abs(change))
    form = NormalForm(kind, name, whole.coefficients, errors)
    if kind == "BP":
        return normal_form_branch.labelled(form, whole)
    if kind == "NS":
        return normal_form_torus.labelled(with_criticality(form), kappa / state.rate)
    return form if kind == "LP" else with_criticality(form)


def _coarser(
    state: BalanceState, vectors: NullVectors, kind: Kind, kappa: float, high: int
) -> tuple[BalanceState, NullVectors] | None:
    """The motion with `high` of its harmonics, its null vectors turned like those given; None with too few of them."""
    balance, basis = state.balance, state.basis
    if high < max(1, balance.highest_load * basis.nu):
        return None
    fewer = HarmonicBasis(high, basis.nu)
    x = basis.resized(state.x, fewer)
    try:
        other = balance.with_basis(fewer).at(x, state.omega, state.values)
        singular = null_vectors(other, kind, kappa)
    except ConvergenceError:
        return None
    short = vectors.resized(fewer, balance.size, kind)
    pair = []
    for own, given in ((singular.right, short.right), (singular.left, short.left)):
        turn = np.vdot(own, given)
        pair.append(own * (turn / abs(turn) if turn else 1.0))
    return other, NullVectors(*pair)
