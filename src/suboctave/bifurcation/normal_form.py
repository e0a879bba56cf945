"""What happens beside a bifurcation: the coefficients of its normal form, and whether it is super- or subcritical.

A motion X at a bifurcation, phi and psi the right and left null vectors of its operator J_kappa, delta the distance in
the free parameter p, eps the amplitude along phi. With X_p the change of the motion along its branch, `J_0 X_p = -R_p`,
and `J_0 X2 = -R''[phi, phi] / 2` what the perturbation does to the motion itself, the amplitude obeys

    LP    g eps' = b delta + a eps^2,          a = psi.R''[phi, phi] / 2, b = psi.R_p
    PD    g eps' = (d delta + c3 eps^2) eps,   c3 = psi.(R''[phi, X2] + R'''[phi, phi, phi] / 6),
                                               d = psi.(J_p phi + R''[phi, X_p])
    BP    the same at a pitchfork; see below
    NS    A' = (d delta + c3 |A|^2) A, complex; see below

(Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., chapters 5 and 9, written for harmonic balance: no
reduction to a map is needed). `g = i psi.dJ/dkappa phi` is what a growth of the perturbation, `kappa -> kappa - i s`,
does to the equations; psi is turned so that g > 0. Then `c3 < 0` is supercritical: motions that branch off lie where
the critical multiplier of the parent is outside the circle, and attract in the critical direction, whatever the other
multipliers do. They follow `p = p_0 + curvature eps^2`, `curvature = -c3 / d`.

phi has unit length weighted by masses, `sum of m_i phi_i^2 = 1` over all coefficients; psi too.

At a branch point, with `v = (X', 1)` along the branch followed, `J_0 X' = -R_p`, phi.X' = 0, the directions `s phi +
r v` of the two branches solve

    c s^2 + 2 b s r + a r^2 = 0,    a = psi.R''[v, v], b = psi.R''[v, phi], c = psi.R''[phi, phi].

`c = 0` is a pitchfork: the other branch leaves along phi, as `p = p_0 + curvature eps^2`, `curvature = -c3 / b`, with
c3 as at a period doubling. A symmetry of the system is the reason as a rule.

At a Neimark-Sacker point the perturbation `A phi exp(i kappa t)` and its conjugate change the motion by `|A|^2 h11 +
A^2 h20 exp(2 i kappa t) + c.c.`,

    J_0 h11 = -R''[phi, conj phi],    J_2kappa h20 = -R''[phi, phi] / 2,

and what remains at kappa is, with `i g = i psi^H dJ_kappa/dkappa phi`,

    A' = (d delta + c3 |A|^2) A,    c3 = psi^H (R''[phi, h11] + R''[conj phi, h20] + R'''[phi, phi, conj phi] / 2) / (i
    g),    d = psi^H (J_p phi + R''[phi, X_p]) / (i g).

The real part of c3 is the first Lyapunov coefficient: negative, a stable torus surrounds the motions that have lost
stability (supercritical), with `|A|^2 = -Re d delta / Re c3`. Near `kappa = w0 / 3` and `w0 / 4` resonant terms of
second and third order join; at those ratios the form says nothing.

Of limit cycles J_0 is singular by the free phase, and omega an unknown: solutions with J_0 are those of `[J_0 R_omega;
phase condition]`, with a change of omega that moves `psi.J phi` as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from suboctave.bifurcation.bordered import NullVectors, bordered, null_vectors
from suboctave.continuation.linear import Factor, length
from suboctave.errors import ConvergenceError, InputError, suggest
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.derivatives import Direction, Multilinear, second_derivative
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, bilinear_gradient, operator
from suboctave.harmonic.trigonometric import wave_sums
from suboctave.harmonic.waves import Frequencies, Waves
from suboctave.lazy import lazy

#: share of the terms that add up to it below which a number counts as zero whatever its estimated error
_ROUNDING = 1e-9


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
        Estimated errors of those that decide, by the same names: from how they change with two thirds and with half of
        the harmonics.
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
    """Coefficients at one motion, the sizes of the sums that those which decide are made of, the unit that the length
    of psi gives them, and the sign of psi beside that given.
    """

    coefficients: dict[str, float]
    sizes: dict[str, float]
    unit: float
    turn: float = 1.0


def with_criticality(form: NormalForm) -> NormalForm:
    """The same with the sign of c3 read, where it is certain."""
    for key, words in (
        ("g", "a double multiplier: neither super- nor subcritical"),
        ("c3", "cubic coefficient zero within its error"),
    ):
        value, error = form.coefficients.get(key), form.errors.get(key)
        if value is not None and error is not None and not abs(value) > error:
            return replace(form, criticality=None, remark=words)
    return replace(form, criticality="supercritical" if form["c3"] < 0.0 else "subcritical")


def unweighted(state: BalanceState, vector: np.ndarray) -> np.ndarray:
    """A null vector in the coefficients' own units."""
    scale: Array = np.tile(state.balance.scales[1], len(vector) // state.balance.size)
    return vector * scale


@dataclass(frozen=True, eq=False)
class Expansion:
    """Null vectors of an operator at a motion in the coefficients' own units, psi turned so that g > 0.

    `by_parameter` is `psi.J_p phi`, `by_omega` the same by omega, `by_motion` the gradient of `psi.J phi` by the
    motion, (2 H + 1, size); `g_size` the sum of the moduli that g is made of.
    """

    state: BalanceState
    kind: Kind
    phi: np.ndarray
    psi: np.ndarray
    g: float
    g_size: float
    by_motion: Array
    by_parameter: float
    by_omega: float
    forms: Multilinear

    @classmethod
    def of(cls, state: BalanceState, kind: Kind, vectors: NullVectors, name: str) -> Expansion:
        """For one of the two real operators."""
        phi, psi = unweighted(state, vectors.right), unweighted(state, vectors.left)
        slope = bilinear_gradient(state, kind, psi, phi, (name, "omega"))
        g, size = float((1j * slope.kappa).real), _growth_size(state, kind, psi, phi)
        # without damping g is rounding, and the parameter tells the sense
        certain = abs(g) > _ROUNDING * size
        turn = -1.0 if (g if certain else slope.rates[name].real) < 0.0 else 1.0
        by_parameter, by_omega = (turn * slope.rates[one].real for one in (name, "omega"))
        forms = Multilinear(state)
        return cls(state, kind, phi, turn * psi, turn * g, size, turn * slope.x, by_parameter, by_omega, forms)

    @lazy
    def waves(self) -> Waves:
        """phi as waves."""
        return Waves.of(self.state, self.kind, self.phi)

    def growth(self, along: Array, omega: float = 0.0) -> float:
        """d, from the change of the motion along its branch, (2 H + 1, size), and that of a free omega."""
        return self.by_parameter + float((self.by_motion * along).sum()) + self.by_omega * omega

    def squared(self) -> Array:
        """R''[phi, phi], shape (dimension,)."""
        phi = self.waves
        return self.forms.second(phi, phi, Frequencies.of(self.state, Kind.INTEGER)).vector(Kind.INTEGER)

    def cubic(self, second: Array, omega: float = 0.0) -> tuple[float, float]:
        """c3 from X2 (dimension,) and the change of a free omega, and the size of its two terms."""
        phi = self.waves
        mixed = float((self.by_motion * second.reshape(self.by_motion.shape)).sum()) + self.by_omega * omega
        third = self.forms.third(phi, phi, phi, Frequencies.of(self.state, self.kind)).vector(self.kind)
        pure = float(self.psi @ third) / 6.0
        return mixed + pure, abs(mixed) + abs(pure)


def _growth_size(state: BalanceState, kind: Kind, psi: np.ndarray, phi: np.ndarray) -> float:
    """Sum of the moduli of the terms of `psi.dJ/dkappa phi`, frequency by frequency."""
    left, right = Waves.of(state, kind, psi), Waves.of(state, kind, phi)
    frequency = right.at.values * state.rate
    slope = np.einsum("fij,fj->fi", state.linear.stiffness(frequency, 1), right.amplitudes)
    return float(np.abs(left.amplitudes.conj() * slope).sum())


def _ratio(over: float, under: float) -> float:
    return over / under if under else math.nan


def responding(state: BalanceState) -> Callable[[Array], tuple[Array, float]]:
    """Solves `J_0 X = rhs` for (dimension,), of limit cycles at their phase, with a change of omega."""
    if state.driven or not np.any(state.x[1:]):
        plain = Factor.of(state.jacobian)
        return lambda rhs: (plain.solve(rhs), 0.0)
    n = state.balance.dimension
    scale = state.balance.row_weights(n)
    turning = state.basis.derivative(state.x).ravel() / scale
    matrix = np.zeros((n + 1, n + 1))
    matrix[:n] = state.extended_jacobian("omega") * scale[:, None] * np.append(scale, state.omega)
    matrix[n, :n] = state.omega**2 * turning / (length(turning) or 1.0)
    factor = Factor.of(matrix)

    def solve(rhs: Array) -> tuple[Array, float]:
        solution = factor.solve(np.append(rhs * scale, 0.0))
        return solution[:n] * scale, float(solution[n]) * state.omega

    return solve


def limit_point(state: BalanceState, vectors: NullVectors, name: str, kappa: float) -> Terms:
    """a, b, g and the curvature: along the branch `p = p_0 + curvature eps^2`."""
    own = Expansion.of(state, Kind.INTEGER, vectors, name)
    a, b = 0.5 * float(own.psi @ own.squared()), float(own.psi @ state.residual_by(name))
    return Terms({"a": a, "b": b, "g": own.g, "curvature": _ratio(-a, b)}, {"a": abs(a), "b": abs(b)}, own.g_size)


def period_doubling(state: BalanceState, vectors: NullVectors, name: str, kappa: float) -> Terms:
    """c3, d, g and the curvature."""
    own = Expansion.of(state, Kind.HALF, vectors, name)
    solve = responding(state)
    c3, size = own.cubic(*solve(-0.5 * own.squared()))
    along, omega = solve(-state.residual_by(name))
    d = own.growth(along.reshape(state.x.shape), omega)
    coefficients = {"c3": c3, "d": d, "g": own.g, "curvature": _ratio(-c3, d)}
    return Terms(coefficients, {"c3": size, "g": own.g_size}, own.g_size)


def cubic_coefficient(
    state: BalanceState,
    phi: Array,
    psi: Array,
    by_motion: Array,
    by_omega: float,
    solve: Callable[[Array], tuple[Array, float]],
) -> float:
    """c3 of a period doubling along curves of them, where `psi.R''[phi, .]` is known: it is the gradient of g.

    `phi`, `psi`: null vectors of J_half in the coefficients' own units; `by_motion`: gradient of `psi.J_half phi` by
    the motion, (2 H + 1, size), and omega; `solve`: see `responding`.
    """
    own = Expansion(state, Kind.HALF, phi, psi, 0.0, 0.0, by_motion, 0.0, by_omega, Multilinear(state))
    return own.cubic(*solve(-0.5 * own.squared()))[0]


#: share of its terms' size below which c counts as zero: a branch point is located to about 1e-8 of its symmetry
_SYMMETRIC = 1e-6


def branch_point(state: BalanceState, vectors: NullVectors, name: str, kappa: float) -> Terms:
    """a, b, c, g, and c3 with the curvature that belong to c = 0."""
    own = Expansion.of(state, Kind.INTEGER, vectors, name)
    border = bordered(state, Kind.INTEGER, vectors)

    def solve(rhs: Array) -> Array:
        solution: Array = border.factor.solve(np.append(rhs * border.scale, 0.0))[:-1] * border.scale
        return solution

    v = Direction(solve(-state.residual_by(name)).reshape(state.x.shape), {name: 1.0})
    a = float(own.psi @ second_derivative(state, v, v))
    b, squared = own.growth(v.x), own.squared()
    c = float(own.psi @ squared)
    c3, cubic_size = own.cubic(solve(-0.5 * squared))
    coefficients = {"a": a, "b": b, "c": c, "g": own.g, "c3": c3, "curvature": _ratio(-c3, b)}
    # or a share of what c3 amounts to where the branches are as far apart as the parameter is from zero: at rest, which
    # is located as well as rounding allows, c may have no other size
    parameter = abs(state.omega if name == "omega" else state.values[name])
    quadratic = max(_quadratic_size(own), math.sqrt(abs(c3 * b) * parameter))
    turn = math.copysign(1.0, float(np.vdot(own.psi, unweighted(state, vectors.left)).real))
    return Terms(coefficients, {"c3": cubic_size, "g": own.g_size, "c": quadratic}, own.g_size, turn)


def pitchfork_coefficient(state: BalanceState, vectors: NullVectors, name: str) -> float:
    """c3 of a branch point at which a symmetry breaks, psi as it is given; 0 at one at which none does."""
    terms = branch_point(state, vectors, name, 0.0)
    if abs(terms.coefficients["c"]) > _SYMMETRIC * terms.sizes["c"]:
        return 0.0
    return terms.turn * terms.coefficients["c3"]


def _quadratic_size(own: Expansion) -> float:
    """Sum of the moduli that `psi.R''[phi, phi]` is made of, along the motion."""
    phi, psi = own.waves, Waves.of(own.state, Kind.INTEGER, own.psi)
    total = 0.0
    for channel in own.state.channels:
        along = np.ascontiguousarray((psi.amplitudes @ channel.out)[None])
        for zr, zi, weights in channel.second:
            q, left = own.forms.values(channel, phi, zr, zi), wave_sums(along, zr, zi)
            total += float(np.einsum("rsn,rn,sn,n->", *(np.abs(part) for part in (weights, q, q, left[0]))))
    return total / np.pi


#: share of w0 within which a strong resonance is stated, and within which it forbids a verdict
_STATED, _RESONANT = 0.02, 1e-3


def torus(state: BalanceState, vectors: NullVectors, name: str, kappa: float) -> Terms:
    """c3, d and the curvature; growth and frequency apart."""
    phi, psi = unweighted(state, vectors.right), unweighted(state, vectors.left)
    slope = bilinear_gradient(state, Kind.FREE, psi, phi, (name, "omega"), kappa)
    g = 1j * slope.kappa
    forms, wave = Multilinear(state), Waves.of(state, Kind.FREE, phi, kappa)
    whole, own = Frequencies.of(state, Kind.INTEGER), Frequencies.of(state, Kind.FREE, kappa)
    twice = Frequencies.of(state, Kind.FREE, 2.0 * kappa)
    solve = responding(state)
    along, omega = solve(-state.residual_by(name))
    d = (slope.rates[name] + (slope.x * along.reshape(state.x.shape)).sum() + slope.rates["omega"] * omega) / g
    mean, omega = solve(-forms.second(wave, wave.conjugate, whole).vector(Kind.INTEGER).real)
    second = Factor.of(operator(state, Kind.FREE, 2.0 * kappa)).solve(
        -0.5 * forms.second(wave, wave, twice).vector(Kind.FREE)
    )
    h20 = Waves(second.reshape(-1, state.balance.size), twice)
    parts = np.array(
        [
            (slope.x * mean.reshape(state.x.shape)).sum() + slope.rates["omega"] * omega,
            np.vdot(psi, forms.second(wave.conjugate, h20, own).vector(Kind.FREE)),
            0.5 * np.vdot(psi, forms.third(wave, wave, wave.conjugate, own).vector(Kind.FREE)),
        ]
    )
    c3 = complex(parts.sum() / g)
    coefficients = {
        "c3": c3.real,
        "d": d.real,
        "c3_frequency": c3.imag,
        "d_frequency": d.imag,
        "curvature": _ratio(-c3.real, d.real),
    }
    return Terms(coefficients, {"c3": float(np.abs(parts).sum() / abs(g))}, 1.0)


def _beside_resonance(form: NormalForm, share: float) -> NormalForm:
    """The same with strong resonances stated; share: kappa in units of the base frequency."""
    near = [(abs(share - 1.0 / q), q) for q in (2, 3, 4)] + [(abs(share), 1)]
    distance, q = min(near)
    if distance > _STATED:
        return form
    words = f"kappa lies {distance:.1e} w0 from the strong resonance 1:{q}"
    if distance > _RESONANT:
        return replace(form, remark="; ".join(part for part in (words, form.remark) if part))
    return replace(form, remark=words, criticality=None)


#: the kinds that have a form: the operator that is singular there, and the terms
FORMS: dict[str, tuple[Kind, Callable[[BalanceState, NullVectors, str, float], Terms]]] = {
    "LP": (Kind.INTEGER, limit_point),
    "PD": (Kind.HALF, period_doubling),
    "BP": (Kind.INTEGER, branch_point),
    "NS": (Kind.FREE, torus),
    "Hopf": (Kind.FREE, torus),
}


def normal_form(kind: str, state: BalanceState, vectors: NullVectors, name: str, kappa: float = 0.0) -> NormalForm:
    """The normal form of a located LP, BP, PD or NS in its free parameter `name`.

    `vectors`: null vectors of its singular operator, weighted by masses (`Bifurcation.null_vectors`); `kappa`:
    frequency of the perturbation at an NS, rad per time.
    """
    if kind not in FORMS:
        raise InputError(f"a {kind!r} has no normal form; it is for LP, BP, PD, NS and Hopf points")
    known = ["omega", *state.values]
    if name not in known:
        raise InputError(f"unknown parameter {name!r}{suggest(name, known)}")
    operator_kind, terms = FORMS[kind]
    whole = terms(state, vectors, name, kappa)
    errors = {key: _ROUNDING * size for key, size in whole.sizes.items()}
    # harmonics left out matter like 1 / H where a contact is hard; two numbers, as a single change may vanish by chance
    for high, missing in ((2 * state.basis.harmonics // 3, 2.0), (state.basis.harmonics // 2, 1.0)):
        coarse = _coarser(state, vectors, operator_kind, kappa, high)
        if coarse is None:
            continue
        other = terms(*coarse, name, kappa)
        for key in errors:
            change = whole.coefficients[key] - other.coefficients[key] * whole.unit / other.unit
            errors[key] = max(errors[key], missing * abs(change))
    form = NormalForm(kind, name, whole.coefficients, errors)
    if kind == "LP":
        return form
    if kind == "BP":
        if abs(form["c"]) > _SYMMETRIC * whole.sizes["c"]:
            kept = {key: form[key] for key in ("a", "b", "c", "g")}
            return replace(form, coefficients=kept, errors={}, shape="transcritical")
        form = replace(form, shape="pitchfork")
    form = with_criticality(form)
    return _beside_resonance(form, kappa / state.rate) if kind == "NS" else form


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
