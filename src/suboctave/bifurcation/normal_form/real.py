"""Normal forms of limit points and period doublings, and what all kinds need: see `normal_form`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from suboctave.bifurcation.bordered import NullVectors
from suboctave.bifurcation.normal_form.terms import ROUNDING, Terms, unweighted
from suboctave.continuation.linear import Factor, LeadingBlock
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.derivatives import Multilinear
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, bilinear_gradient
from suboctave.harmonic.waves import Frequencies, Waves


@dataclass(frozen=True, eq=False)
class Expansion:
    """Null vectors of an operator at a motion in the coefficients' own units, psi turned so that g > 0.

    `by_parameter` is `psi.J_p phi`, `by_motion` the gradient of `psi.J phi` by the motion, (2 H + 1, size); `g_size`
    the sum of the moduli that g is made of.
    """

    state: BalanceState
    kind: Kind
    phi: np.ndarray
    psi: np.ndarray
    g: float
    g_size: float
    by_motion: Array
    by_parameter: float
    forms: Multilinear

    @classmethod
    def of(cls, state: BalanceState, kind: Kind, vectors: NullVectors, name: str) -> Expansion:
        """For one of the two real operators."""
        phi, psi = unweighted(state, vectors.right), unweighted(state, vectors.left)
        slope = bilinear_gradient(state, kind, psi, phi, (name,))
        g, size = float((1j * slope.kappa).real), growth_size(state, kind, psi, phi)
        # without damping g is rounding, and the parameter tells the sense
        certain = abs(g) > ROUNDING * size
        turn = -1.0 if (g if certain else slope.rates[name].real) < 0.0 else 1.0
        by_parameter = turn * slope.rates[name].real
        return cls(state, kind, phi, turn * psi, turn * g, size, turn * slope.x, by_parameter, Multilinear(state))

    @cached_property
    def waves(self) -> Waves:
        """phi as waves."""
        return Waves.of(self.state, self.kind, self.phi)

    def squared(self) -> Array:
        """R''[phi, phi], shape (dimension,)."""
        phi = self.waves
        return self.forms.second(phi, phi, Frequencies.of(self.state, Kind.INTEGER)).vector(Kind.INTEGER)

    def cubic(self, second: Array) -> tuple[float, float]:
        """c3 from X2 (dimension,), and the size of its two terms."""
        phi = self.waves
        mixed = float((self.by_motion * second.reshape(self.by_motion.shape)).sum())
        third = self.forms.third(phi, phi, phi, Frequencies.of(self.state, self.kind)).vector(self.kind)
        pure = float(self.psi @ third) / 6.0
        return mixed + pure, abs(mixed) + abs(pure)


def limit_point(state: BalanceState, vectors: NullVectors, name: str, kappa: float) -> Terms:
    """a, b, g and the curvature: along the branch `p = p_0 + curvature eps^2`."""
    own = Expansion.of(state, Kind.INTEGER, vectors, name)
    a, b = 0.5 * float(own.psi @ own.squared()), float(own.psi @ state.residual_by(name))
    return Terms({"a": a, "b": b, "g": own.g, "curvature": _ratio(-a, b)}, {"a": abs(a), "b": abs(b)}, own.g_size)


def period_doubling(state: BalanceState, vectors: NullVectors, name: str, kappa: float) -> Terms:
    """c3, d, g and the curvature."""
    own = Expansion.of(state, Kind.HALF, vectors, name)
    c3, d, size, _ = doubled(own, name)
    coefficients = {"c3": c3, "d": d, "g": own.g, "curvature": _ratio(-c3, d)}
    return Terms(coefficients, {"c3": size, "g": own.g_size}, own.g_size)


def doubled(own: Expansion, name: str) -> tuple[float, float, float, Array]:
    """c3, d, the size of c3's terms, and X2 (dimension,) at a period doubling."""
    state = own.state
    factor = Factor.of(state.jacobian)
    second = factor.solve(-0.5 * own.squared())
    along = factor.solve(-state.residual_by(name)).reshape(state.x.shape)
    d = own.by_parameter + float((own.by_motion * along).sum())
    c3, size = own.cubic(second)
    return c3, d, size, second


def cubic_coefficient(
    state: BalanceState, phi: Array, psi: Array, by_motion: Array, block: LeadingBlock, weights: Array
) -> float:
    """c3 of a period doubling along curves of them, where `psi.R''[phi, .]` is known: it is the gradient of g.

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


@dataclass(frozen=True)
class DoublingPredictor:
    """Motions of twice the period beside a period doubling, to second order in their amplitude.

    In the basis `basis`: `X + eps first + eps^2 second` at `p + eps^2 curvature`, of the free parameter p. Arrays of
    shape (2 basis.harmonics + 1, size). `first` is phi, of unit length in the norm
    weighted by masses; both signs of eps are the same motion, half a period apart.
    """

    basis: HarmonicBasis
    motion: Array
    first: Array
    second: Array
    curvature: float

    def at(self, eps: float) -> tuple[Array, float]:
        """Coefficients, and the change of the parameter."""
        return self.motion + eps * self.first + eps**2 * self.second, eps**2 * self.curvature


def doubling_predictor(
    state: BalanceState, vectors: NullVectors, name: str, basis: HarmonicBasis | None = None
) -> DoublingPredictor:
    """The doubled branch beside a located period doubling: see `DoublingPredictor`.

    `basis`: one of twice the period; unless given, that of all harmonics up to 2 H + 1, which drops nothing.
    """
    own = Expansion.of(state, Kind.HALF, vectors, name)
    c3, d, _, second = doubled(own, name)
    full = HarmonicBasis(2 * state.basis.harmonics + 1, 2 * state.basis.nu)
    basis = full if basis is None else basis
    half = own.phi.reshape(-1, state.balance.size)
    first = np.zeros((full.size, state.balance.size))
    first[1::4], first[2::4] = half[::2], half[1::2]

    def rebased(x: Array) -> Array:
        return state.basis.resized(x.reshape(state.x.shape), basis)

    return DoublingPredictor(basis, rebased(state.x), full.resized(first, basis), rebased(second), _ratio(-c3, d))


def growth_size(state: BalanceState, kind: Kind, psi: np.ndarray, phi: np.ndarray, kappa: float = 0.0) -> float:
    """Sum of the moduli of the terms of `psi.dJ/dkappa phi`, frequency by frequency."""
    left, right = (Waves.of(state, kind, one, kappa) for one in (psi, phi))
    frequency = right.at.values * state.rate
    slope = np.einsum("fij,fj->fi", state.linear.stiffness(frequency, 1), right.amplitudes)
    compliance, change = state.linear.compliance(frequency), state.linear.compliance(frequency, 1)
    if compliance is not None and change is not None:
        # at a null vector the elements answer with the forces that balance A phi
        force = np.einsum("fij,fj->fi", state.linear.stiffness(frequency), right.amplitudes)
        force = np.linalg.solve(compliance, force[..., None])[..., 0]
        slope = slope - np.einsum("fij,fj->fi", change, force)
    return float(np.abs(left.amplitudes.conj() * slope).sum())


def _ratio(over: float, under: float) -> float:
    return over / under if under else float("nan")
