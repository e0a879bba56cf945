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

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from suboctave.bifurcation.bordered import NullVectors, null_vectors
from suboctave.errors import ConvergenceError, InputError, suggest
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState

SUPERCRITICAL, SUBCRITICAL = "supercritical", "subcritical"
#: the kinds that have one, and the operators that are singular there
FORMS = {"LP": Kind.INTEGER, "BP": Kind.INTEGER, "PD": Kind.HALF, "NS": Kind.FREE}
#: share of the terms that add up to it below which a number counts as zero whatever its estimated error
ROUNDING = 1e-9


@dataclass(frozen=True)
class NormalForm:
    """Coefficients of the normal form of a bifurcation in its free parameter.

    Attributes
    ----------
    kind
        "LP", "BP", "PD" or "NS".
    parameter
        Name of the free parameter.
    coefficients
        By name, see `bifurcation.normal_form`. LP: a, b, g, curvature. PD: c3, d, g, curvature. BP: a, b, c, g, and at
        a pitchfork c3, curvature. NS: c3, d (growth), c3_frequency, d_frequency (their imaginary parts), curvature.
    errors
        Estimated errors of those that decide, by the same names: how they change with two thirds of the harmonics.
    criticality
        "supercritical", "subcritical", or None: at an LP, at a transcritical BP, and where no sign is certain.
    shape
        "transcritical" or "pitchfork" at a BP, else empty.
    remark
        Why there is no criticality, and resonances, in words.
    """

    kind: str
    parameter: str
    coefficients: Mapping[str, float]
    errors: Mapping[str, float] = field(default_factory=dict)
    criticality: str | None = None
    shape: str = ""
    remark: str = ""

    def __getitem__(self, name: str) -> float:
        if name not in self.coefficients:
            raise InputError(f"unknown coefficient {name!r}{suggest(name, list(self.coefficients))}")
        return self.coefficients[name]

    def __repr__(self) -> str:
        words = [f"{name}={value:.5g}" for name, value in self.coefficients.items()]
        label = " ".join(word for word in (self.criticality, self.shape) if word)
        return f"<normal form of {self.kind}{', ' + label if label else ''}: {', '.join(words)}>"


@dataclass(frozen=True)
class Terms:
    """Coefficients at one motion, the sizes of the sums that those which decide are made of, and the unit that the
    length of psi gives them.
    """

    coefficients: dict[str, float]
    sizes: dict[str, float]
    unit: float


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
    from suboctave.bifurcation import normal_form_branch, normal_form_real, normal_form_torus

    if kind not in FORMS:
        raise InputError(f"a {kind!r} has no normal form; it is for LP, BP, PD and NS")
    terms = {
        "LP": normal_form_real.limit_point,
        "PD": normal_form_real.period_doubling,
        "BP": normal_form_branch.branch_point,
        "NS": normal_form_torus.torus,
    }[kind]
    found = terms(state, vectors, name, kappa)
    coarse = _coarser(state, vectors, FORMS[kind], kappa)
    other = None if coarse is None else terms(*coarse, name, kappa)
    errors = {}
    for key, size in found.sizes.items():
        # harmonics left out matter like 1 / H where a contact is hard: a third of them tells half of what is missing
        change = 0.0
        if other is not None:
            change = 2.0 * abs(found.coefficients[key] - other.coefficients[key] * found.unit / other.unit)
        errors[key] = max(change, ROUNDING * size)
    form = NormalForm(kind, name, found.coefficients, errors)
    if kind == "BP":
        return normal_form_branch.labelled(form, found)
    if kind == "NS":
        form = normal_form_torus.labelled(form, kappa / state.rate)
    return form if kind == "LP" else with_criticality(form)


def with_criticality(form: NormalForm) -> NormalForm:
    """The same with the sign of c3 read, where it is certain."""
    for key, words in (
        ("g", "a double multiplier: neither super- nor subcritical"),
        ("c3", "cubic coefficient zero within its error"),
    ):
        value, error = form.coefficients.get(key), form.errors.get(key)
        if value is None or error is None:
            continue
        if not abs(value) > error:
            remark = "; ".join(part for part in (form.remark, words) if part)
            return replace(form, criticality=None, remark=remark)
    return replace(form, criticality=SUPERCRITICAL if form.coefficients["c3"] < 0.0 else SUBCRITICAL)


def unweighted(state: BalanceState, vector: np.ndarray) -> np.ndarray:
    """A null vector in the coefficients' own units."""
    scale: Array = np.tile(state.balance.scales()[1], len(vector) // state.balance.size)
    return vector * scale


def _coarser(
    state: BalanceState, vectors: NullVectors, kind: Kind, kappa: float
) -> tuple[BalanceState, NullVectors] | None:
    """The motion with two thirds of its harmonics, its null vectors turned like those given; None with few of them."""
    balance, basis = state.balance, state.basis
    high = 2 * basis.harmonics // 3
    if high < max(1, balance.highest_load * basis.nu):
        return None
    fewer = HarmonicBasis(high, basis.nu)
    x = basis.resized(state.x, fewer)
    try:
        other = balance.with_basis(fewer).at(x, state.omega, state.values)
        found = null_vectors(other, kind, kappa)
    except ConvergenceError:
        return None
    short = vectors.resized(fewer, balance.size, kind)
    pair = []
    for own, given in ((found.right, short.right), (found.left, short.left)):
        turn = np.vdot(own, given)
        pair.append(own * (turn / abs(turn) if turn else 1.0))
    return other, NullVectors(*pair)
