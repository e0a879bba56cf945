"""Hill's method: characteristic exponents as eigenvalues in the frequency domain, selected by strip.

The linearised motion as Fourier series is

    y'' + C(t) y' + K(t) y = 0,    K(t) = K_0 + sum_g k_g(t) l_g r_g^T,    C(t) = C_0 + sum_g c_g(t) l_g r_g^T

in DOFs weighted by the square roots of their masses; one term per direction that elements act along, k_g and c_g the
sums of their tangents f_u and f_v along the motion. Fourier coefficients of tangents are exact to any order. The motion
itself is known up to its neglected harmonics. `refined` adds their first-order answer and what that does to the
harmonics that were solved for: near a limit point, where R_X is nearly singular, that is the larger part.

Perturbations `y = exp(lambda t) sum_k phi_k exp(i k w0 t)` of it solve

    [ s_k^2 + s_k C_0 + K_0 ] phi_k + sum_l [ k_{k-l} + s_l c_{k-l} ] l r^T phi_l = 0,    s_k = lambda + i k w0,

a quadratic eigenvalue problem (Hill, Acta Math. 8 (1886) 1-36; for harmonic balance von Groll & Ewins, J. Sound Vib.
241 (2001) 223-233). Each exponent appears again and again, shifted by i w0, and near the ends of the truncated series
wrongly.

Selection by strip: the circle of `Im lambda mod w0`, from the eigenvalues of the inner half of the series, is cut at
its widest gap. One strip of height w0 between two cuts then holds each exponent exactly once: 2 n must fall inside,
which the method checks. Others choose by smallest `|Im lambda|` (Moore, SIAM J. Numer. Anal. 42 (2005) 2522-2568) or by
the most central eigenvectors (Lazarus & Thomas, C. R. Mecanique 338 (2010) 510-517; weighted mean of the harmonics:
Guillot, Lazarus, Thomas, Vergez, Cochelin, J. Comput. Phys. 416 (2020) 109477). Both fail where multipliers are
negative and real, that is beside every period doubling: there exponents come as `sigma_j +- i w0 / 2`, equally central
all of them, and a pair of one is taken instead of one of each.

Two levels. First the solved motion with perturbations of the same H harmonics: then Hill's matrix is the Jacobian of
the balance itself, and the leading errors of motion and perturbation cancel (with contacts both are of order H^-3,
their sum is far smaller). Then both with 2 H + 1 harmonics: the exponents move by the two-sided Rayleigh quotient of
the larger problem, its vectors being those of the first level with their first-order continuation. The move is the
error estimate.

The Koopman-Hill projection: the monodromy matrix from Hill's matrix without choosing among eigenvalues.

Let `y' = A(t) y` be the linearised motion. Its solutions times waves, `z_k = exp(-i k w0 t) y`, solve

    z_k' = sum_l A_{k-l} z_l - i k w0 z_k,    z_k(0) = I,    Phi(T) = z_0(T) = C exp(H T) W,

H Hill's matrix, `W = [I; ..; I]`, C picking the central block; truncated to |k| <= N this is the projection of Bayer
& Leine (Nonlinear Dyn. 111 (2023) 8439-8466). The sub-harmonic form adds the waves k + 1/2, whose z return negated, and
takes `Phi(T) = sum_k z_k(T) + sum_k z_{k+1/2}(T)`, 2 N + 1 blocks Phi and 2 N blocks -Phi, whose truncation errors
cancel to twice the order for smooth forces (Bayer & Leine, arXiv:2503.21318, 2025). Here in the real basis (mean,
cosines, sines), four times cheaper, as in Bayer et al., Int. J. Non-Linear Mech. 167 (2024) 104894: W and C follow from
the series of a Dirac comb at t = 0, which is what all z_k = I amounts to.

Which coefficients of A are kept matters where contacts make them fall off like 1/q. Those beyond 0.6 N lead from the
ends of the truncated series, where z is wrong, straight to the central block; without them the error falls like N^-3
instead of N^-2. The sub-harmonic form does without that, up to N.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import expm

from suboctave.continuation.linear import Factor
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.assembly import galerkin
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.interruption import check_time


@dataclass(frozen=True)
class Variational:
    """The linearised motion.

    damping, stiffness
        C_0, K_0, shape (n, n): those of the structure and the means of the elements' tangents.
    left, right
        l_g, r_g, shape (G, n).
    k, c
        Fourier coefficients q = 0 .. top of k_g, c_g without their means, shape (G, top + 1).
    rate
        Base frequency omega / nu.
    """

    damping: Array
    stiffness: Array
    left: Array
    right: Array
    k: ComplexArray
    c: ComplexArray
    rate: float

    @property
    def n(self) -> int:
        """Number of DOFs of the equation of motion."""
        return self.stiffness.shape[0]

    @property
    def decay(self) -> float:
        """Logarithm of the product of all multipliers, `-int trace C dt` (Liouville)."""
        return -float(np.trace(self.damping)) * (2.0 * math.pi / self.rate)

    def mean_exponents(self) -> ComplexArray:
        """Characteristic exponents of the mean system `y'' + C_0 y' + K_0 y = 0`, shape (2 n,)."""
        zero, one = np.zeros((self.n, self.n)), np.eye(self.n)
        return np.linalg.eigvals(np.block([[zero, one], [-self.stiffness, -self.damping]])).astype(complex)

    @classmethod
    def of(cls, state: BalanceState, top: int) -> Variational:
        """The motion's linearisation with Fourier coefficients up to `top`."""
        mass, damping, stiffness = state.linear.equation_of_motion()
        weight = np.sqrt(np.diag(mass))
        inverse = np.linalg.inv(mass) * weight[:, None]
        damping, stiffness = inverse @ damping / weight, inverse @ stiffness / weight
        count = sum(channel.count for channel in state.channels)
        left, right = np.zeros((2, count, len(mass)))
        k, c = np.zeros((2, count, top + 1), dtype=complex)
        i = 0
        for channel in state.channels:
            reaching = channel.reaching(top)
            for j, direction in enumerate(channel.ins):
                left[i] = inverse @ state.linear.expand(channel.out)
                right[i] = state.linear.expand(direction) / weight
                k[i] = reaching.stiffness(j)
                if channel.moving:
                    c[i] = reaching.damping(j)
                i += 1
        for i in range(count):
            outer = np.outer(left[i], right[i])
            stiffness, damping = stiffness + k[i, 0].real * outer, damping + c[i, 0].real * outer
        k[:, 0] = c[:, 0] = 0.0
        return cls(damping, stiffness, left, right, k, c, state.rate)


def two_sided(spectrum: ComplexArray, harmonics: int) -> ComplexArray:
    """Toeplitz matrix of a real function between waves k = -harmonics .. harmonics: its Fourier coefficients k - l."""
    index = np.arange(2 * harmonics + 1)
    both = np.concatenate((spectrum[2 * harmonics : 0 : -1].conj(), spectrum[: 2 * harmonics + 1]))
    return both[index[:, None] - index[None, :] + 2 * harmonics]


#: relative size up to which a first-order answer of the solved harmonics is taken at its word
_ANSWER = 1e-3


def refined(state: BalanceState) -> tuple[BalanceState, BalanceState | None]:
    """The motion with 2 H + 1 harmonics, one step closer to the true one, and, if that is in doubt, another it may be.

    The solved harmonics answer to the neglected ones by `-R_X^-1 R`, R the residual that these leave. At a limit point
    that answer means nothing: there the motion moves by about the root of what disturbs it, in the same direction.
    """
    completed, balance, kept = state.completed, state.balance, state.x.shape[0]
    residual = completed.residual.reshape(completed.x.shape)[:kept].ravel()
    weight = balance.scales()[0]
    lacking = completed.x[kept:]
    size, gap = (float(np.linalg.norm(x * weight)) for x in (state.x, lacking))
    try:
        answer = np.asarray(np.linalg.solve(state.jacobian, -residual), dtype=float)
    except np.linalg.LinAlgError:
        answer = np.asarray(np.linalg.lstsq(state.jacobian, -residual)[0], dtype=float)
    answer = balance.shaped(answer)
    length = float(np.linalg.norm(answer * weight))
    if length <= _ANSWER * size:
        return _moved(completed, answer), None
    return completed, _moved(completed, answer * math.sqrt(max(gap, 1e-14 * size) * size) / length)


def _moved(completed: BalanceState, answer: Array) -> BalanceState:
    x = completed.x.copy()
    x[: len(answer)] += answer
    return BalanceState(completed.balance, completed.linear, x, completed.omega, completed.values)


def liouville(multipliers: ComplexArray, errors: Array, decay: float) -> tuple[Array, float]:
    """Errors enlarged until they cover what Liouville's formula shows to be wrong, and that defect.

    The logarithms of the multipliers add up to `decay`; to first order the relative errors of the multipliers add up to
    the defect, so that estimates whose sum is smaller are too small.
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        defect = abs(float(np.log(np.abs(multipliers)).sum()) - decay)
        stated = float((errors / np.abs(multipliers)).sum())
    if not math.isfinite(defect):
        return errors, defect
    return errors * max(1.0, defect / stated if stated > 0.0 else 1.0), defect


#: harmonics reach this many times the highest natural frequency, or the eigenvalues are not good
_REACH = 2.0
#: largest dense eigenvalue problem that is attempted
_LARGEST = 3000
#: share of two effects that cancel (truncated motion, truncated perturbation) by which they are taken not to
_CANCELLED = 0.05


def exponents(system: Variational, harmonics: int) -> ComplexArray:
    """All eigenvalues of Hill's problem with perturbation harmonics 0 .. `harmonics`, in units of the base frequency.

    In the real basis (mean, cosines, sines): `lambda^2 + lambda (2 w0 D + T(C)) + w0^2 D^2 + T(C) w0 D + T(K)`.
    """
    n, size, rate = system.n, 2 * harmonics + 1, system.rate
    derivative = np.zeros((size, size))
    cosine = np.arange(1, size, 2)
    derivative[cosine, cosine + 1], derivative[cosine + 1, cosine] = (cosine + 1) / 2, -(cosine + 1) / 2
    one, each = np.eye(size), np.eye(n)
    first = np.kron(2.0 * derivative, each) + np.kron(one, system.damping / rate)
    zeroth = np.kron(derivative @ derivative, each) + np.kron(derivative, system.damping / rate)
    zeroth += np.kron(one, system.stiffness / rate**2)
    for left, right, k, c in zip(system.left, system.right, system.k, system.c, strict=True):
        outer = np.outer(left, right)
        zeroth += np.kron(galerkin(k / rate**2, c / rate, 1.0, True, harmonics + 1), outer)
        if c.any():
            first += np.kron(galerkin(c / rate, None, 0.0, True, harmonics + 1), outer)
    companion = np.block([[np.zeros_like(zeroth), np.eye(size * n)], [-zeroth, -first]])
    return np.linalg.eigvals(companion).astype(complex)


class _Waves:
    """Hill's problem between waves exp(i k tau), k = -harmonics .. harmonics, in units of the base frequency.

    `P(s) = s_k^2 + s_k C + K`, `s_k = s + i k`; vectors have shape (2 harmonics + 1, n).
    """

    def __init__(self, system: Variational, harmonics: int) -> None:
        self.system, rate = system, system.rate
        self.damping, self.stiffness = system.damping / rate, system.stiffness / rate**2
        self.index = np.arange(-harmonics, harmonics + 1) * np.complex128(1j)
        self.k = [two_sided(k / rate**2, harmonics) for k in system.k]
        self.c = [two_sided(c / rate, harmonics) if c.any() else None for c in system.c]

    def diagonal(self, s: complex) -> ComplexArray:
        """Blocks of P(s) on the diagonal, shape (2 harmonics + 1, n, n)."""
        each = (s + self.index)[:, None, None]
        return each**2 * np.eye(self.system.n) + each * self.damping + self.stiffness

    def matrix(self, s: complex) -> ComplexArray:
        """P(s), square, wave by wave."""
        count, n = len(self.index), self.system.n
        out = np.zeros((count, n, count, n), dtype=complex)
        wave = np.arange(count)
        out[wave, :, wave, :] = self.diagonal(s)
        for left, right, k, c in zip(self.system.left, self.system.right, self.k, self.c, strict=True):
            toeplitz = k if c is None else k + c * (s + self.index)
            out += toeplitz[:, None, :, None] * np.outer(left, right)[None, :, None, :]
        return out.reshape(count * n, count * n)

    def coupled(self, s: complex, phi: ComplexArray, transposed: bool = False) -> ComplexArray:
        """P(s) without its diagonal blocks (or its transpose) applied to phi."""
        out = np.zeros_like(phi)
        speed = s + self.index
        for left, right, k, c in zip(self.system.left, self.system.right, self.k, self.c, strict=True):
            if transposed:
                along = phi @ left
                result = k.T @ along if c is None else k.T @ along + speed * (c.T @ along)
                out += np.multiply.outer(result, right)
            else:
                along = phi @ right
                result = k @ along if c is None else k @ along + c @ (speed * along)
                out += np.multiply.outer(result, left)
        return out

    def vectors(self, s: complex) -> tuple[ComplexArray, ComplexArray]:
        """Right and left null vectors of P at an eigenvalue, by inverse iteration; shape (waves, n) each."""
        factor = Factor.of(self.matrix(s))
        # exactly on an eigenvalue there may be a zero pivot
        pivots = np.diagonal(factor.lu)
        tiny = 1e-16 * float(np.abs(pivots).max())
        np.fill_diagonal(factor.lu, np.where(np.abs(pivots) < tiny, tiny, pivots))
        null = []
        for adjoint in (False, True):
            x = np.ones(len(factor.lu), dtype=complex)
            for _ in range(2):
                x = factor.solve(x / np.linalg.norm(x), adjoint)
            null.append((x / np.linalg.norm(x)).reshape(len(self.index), self.system.n))
        return null[0], null[1].conj()

    def widened(self, phi: ComplexArray) -> ComplexArray:
        """A vector of fewer waves with zeros for the others."""
        more = (len(self.index) - len(phi)) // 2
        return np.pad(phi, ((more, more), (0, 0)))

    def continued(self, s: complex, phi: ComplexArray, transposed: bool = False) -> ComplexArray:
        """A null vector of fewer waves with the first-order answer of the others."""
        wide, more = self.widened(phi), (len(self.index) - len(phi)) // 2
        outside = np.r_[:more, len(wide) - more : len(wide)]
        blocks = self.diagonal(s)[outside]
        drive = -self.coupled(s, wide, transposed)[outside]
        wide[outside] = np.linalg.solve(blocks.transpose(0, 2, 1) if transposed else blocks, drive[:, :, None])[:, :, 0]
        return wide

    def rayleigh(self, s: complex, psi: ComplexArray, phi: ComplexArray) -> tuple[complex, float]:
        """The root near s of the two-sided quotient `psi^T P(s) phi = 0`, and its rounding error."""
        index, square = self.index[:, None], complex((psi * phi).sum())
        steady, unit = self.coupled(0.0, phi), self.coupled(1.0, phi)
        slope = complex((psi * (2.0 * index * phi + phi @ self.damping.T + unit - steady)).sum())
        terms = psi * (index**2 * phi + index * (phi @ self.damping.T) + phi @ self.stiffness.T + steady)
        constant = complex(terms.sum())
        root = s
        for _ in range(3):
            rate = 2.0 * square * root + slope
            if rate == 0.0:
                return s, math.inf
            root -= (square * root**2 + slope * root + constant) / rate
        spread = float(np.abs(terms).sum()) + abs(square * root**2) + abs(slope * root)
        return root, 1e-15 * spread / abs(2.0 * square * root + slope)


def in_strip(values: ComplexArray, harmonics: int) -> tuple[np.ndarray, float]:
    """Indices of all eigenvalues in the strip between two cuts, and the width of the gap they are in (0 to 1).

    The cut is in the middle of the widest gap of `Im s mod 1`, seen in the inner half of the series, where eigenvalues
    are good. The caller must check that as many lie inside as there are exponents.
    """
    height = values.imag
    inner = height[np.abs(height) <= max(1.0, 0.5 * harmonics)]
    around = np.sort(np.mod(inner, 1.0))
    if not around.size:
        return np.zeros(0, dtype=int), 0.0
    gaps = np.diff(np.append(around, around[0] + 1.0))
    widest = int(np.argmax(gaps))
    cut = (around[widest] + 0.5 * gaps[widest]) % 1.0
    return np.flatnonzero((height > cut - 1.0) & (height <= cut)), float(gaps[widest])


def smallest_imaginary(values: ComplexArray, count: int) -> np.ndarray:
    """Moore (2005): the eigenvalues of smallest `|Im s|`."""
    return np.argsort(np.abs(values.imag), kind="stable")[:count]


def most_central(vectors: ComplexArray, count: int) -> np.ndarray:
    """Lazarus & Thomas (2010), in the form of Guillot et al. (2020), Eq. (26).

    The eigenvectors whose mean harmonic `|sum_k k |phi_k|| / sum_k |phi_k|` is smallest; vectors has shape (waves k =
    -H .. H, DOFs, eigenvalues).
    """
    weights = np.linalg.norm(vectors, axis=1)
    harmonic = np.arange(len(weights)) - len(weights) // 2
    return np.argsort(np.abs(harmonic @ weights) / weights.sum(axis=0), kind="stable")[:count]


def _apart(a: ComplexArray, b: ComplexArray | complex) -> ComplexArray:
    """Differences of exponents, shifts by i aside."""
    difference: ComplexArray = a - b
    return difference - 1j * np.round(difference.imag)


def same_exponents(a: ComplexArray, b: ComplexArray) -> bool:
    """True if a has each of the exponents b once, up to shifts by i: each is the nearest of another one."""
    distance: Array = np.abs(_apart(a[:, None], b))
    return len(a) == len(b) and sorted(distance.argmin(axis=1)) == list(range(len(b)))


def hill_multipliers(state: BalanceState, selection: str) -> FloquetResult:
    """Multipliers by Hill's method; `selection` is "strip", "imaginary" or "symmetry"."""
    harmonics = state.basis.harmonics
    solved = Variational.of(state, 2 * harmonics)
    count = 2 * solved.n
    name = "Hill" if selection == "strip" else f"Hill, selection by {selection}"
    unfit = partial(FloquetResult.inapplicable, count, name)
    highest = float(np.abs(solved.mean_exponents().imag).max())
    if harmonics * solved.rate < _REACH * highest:
        return unfit(
            f"Hill's method needs harmonics up to twice the highest natural frequency, {highest:.4g}: the motion's "
            f"{harmonics} reach {harmonics * solved.rate:.4g}, {math.ceil(_REACH * highest / solved.rate)} would do"
        )
    size = count * (2 * harmonics + 1)
    if size > _LARGEST:
        return unfit(f"A Hill problem of {size} unknowns is larger than {_LARGEST}: use the monodromy matrix")
    values = exponents(solved, harmonics)
    strip, gap = in_strip(values, harmonics)
    checks = {"inside the strip": float(len(strip)), "expected": float(count), "gap": gap}
    if len(strip) != count:
        note = f"{len(strip)} of Hill's eigenvalues lie in a strip that must hold {count}: with {harmonics} harmonics "
        return unfit(f"{note}they are not good enough, more are needed", checks)
    chosen, note = strip, ""
    if selection == "imaginary":
        chosen = smallest_imaginary(values, count)
    elif selection == "symmetry":
        waves = _Waves(solved, harmonics)
        chosen = most_central(np.stack([waves.vectors(s)[0] for s in values], axis=-1), count)
    if not same_exponents(values[chosen], values[strip]):
        note = f"Selection by {selection} takes an exponent twice and misses another: its multipliers are not those"
    s, spread = _second_level(state, solved, values[chosen])
    mu = np.exp(2.0 * math.pi * s)
    # exponents are known to `spread`, multipliers relative to their size
    errors = np.abs(mu) * np.expm1(np.minimum(2.0 * math.pi * spread, 700.0)) + 1e-14 * np.abs(mu)
    if note:
        errors = np.full(count, np.inf)
    else:
        mu, errors = _closed(mu, errors)
        errors, checks["Liouville"] = liouville(mu, errors, solved.decay)
    order = np.argsort(-np.abs(mu), kind="stable")
    return FloquetResult(mu[order], errors[order], name, note, checks)


def _second_level(state: BalanceState, solved: Variational, values: ComplexArray) -> tuple[ComplexArray, Array]:
    """The exponents with 2 H + 1 harmonics of motion and perturbation, and how far they may be off."""
    inner, outer = state.basis.harmonics, 2 * state.basis.harmonics + 1
    motion, alternative = refined(state)
    first, second = _Waves(solved, inner), _Waves(Variational.of(motion, 2 * outer), outer)
    other = None if alternative is None else _Waves(Variational.of(alternative, 2 * outer), outer)
    moved, spread = np.empty_like(values), np.empty(len(values))
    for j, s in enumerate(values):
        twins = np.flatnonzero(np.abs(_apart(values[:j].conj(), s)) < 1e-9)  # conjugate to rounding
        if twins.size:
            moved[j], spread[j] = moved[twins[0]].conjugate(), spread[twins[0]]
            continue
        phi, psi = first.vectors(s)
        # the same vectors without their continuation show what the motion alone does, to be cancelled by the rest
        middle = second.rayleigh(s, second.widened(psi), second.widened(phi))[0]
        psi, phi = second.continued(s, psi, transposed=True), second.continued(s, phi)
        better, rounding = second.rayleigh(s, psi, phi)
        parts = abs(better - s) + _CANCELLED * (abs(middle - s) + abs(better - middle)) + rounding
        if other is not None:
            parts += abs(other.rayleigh(s, psi, phi)[0] - better)
        near = float(np.abs(_apart(np.delete(values, j), s)).min(initial=1.0))
        if not abs(better - s) < 0.3 * near:
            # two exponents about to meet: first order means nothing, they move by about the root
            better, parts = s, 2.0 * math.sqrt(near * parts) if math.isfinite(parts) else math.inf
        moved[j], spread[j] = better, parts
    return moved, spread


def _closed(mu: ComplexArray, errors: Array) -> tuple[ComplexArray, Array]:
    """The set closed under conjugation, as it must be: truncation leaves a negative real one with an Im of 1e-6."""
    distance = np.abs(mu[:, None] - mu[None, :].conj())
    partner = distance.argmin(axis=1)
    mutual = partner[partner] == np.arange(len(mu))
    closed = np.where(mutual, 0.5 * (mu + mu[partner].conj()), mu)
    return closed, errors + np.abs(closed - mu)


#: terms of a Taylor step and what each costs besides, in multiplications; products that an exponential begins with
_TERMS, _EACH, _BEGIN = 25, 1e6, 8
#: largest Hill matrix that is attempted
_LARGEST_PROJECTED = 6000
#: perturbation harmonics, however few the motion has
_FEWEST = 15
#: share of what the motion's neglected harmonics do that is still missing when they are added to first order
_MOTION = 0.5
#: perturbation harmonics that are tried one after the other, in units of the motion's: direct, sub-harmonic
_LADDER = ((0.5, 1.0, 1.5, 2.0, 3.0), (0.5, 1.0, 1.5, 2.0))
#: move of a multiplier at which that ends
_ACCURACY = 1e-4
#: share of parts that cancel by which they are taken not to
_CANCELLED_PROJECTED = 0.02
#: what each law does: direction to the left, to the right, Galerkin matrix
_Parts = list[tuple[Array, Array, Array]]


def transition(system: Variational, harmonics: int, subharmonic: bool) -> Array:
    """The monodromy matrix in (y, dy / d tau), DOFs weighted by the square roots of their masses; shape (2 n, 2 n)."""
    kept = harmonics if subharmonic else max(1, math.ceil(0.6 * harmonics))
    waves = _propagated(system, 2 * np.arange(harmonics + 1), kept)
    if not subharmonic:
        return waves[0]
    halves = _propagated(system, 2 * np.arange(harmonics) + 1, kept)
    # the sines of a Dirac comb vanish at its place: the mean and the cosines count
    return waves[0] + waves[1::2].sum(axis=0) + halves[::2].sum(axis=0)


def _propagated(system: Variational, doubled: np.ndarray, kept: int) -> Array:
    """Series of the propagated Dirac comb after one period, shape (basis, 2 n, 2 n).

    `doubled`: twice the frequencies of the basis, even or odd, in units of the base frequency.
    """
    n, mean = system.n, bool(doubled[0] == 0)
    size = 2 * len(doubled) - mean
    cosine = np.arange(1 if mean else 0, size, 2)
    frequency = 0.5 * doubled[1 if mean else 0 :]
    start = np.zeros((size, 2 * n, 2 * n))
    start[cosine] = 2.0 * np.eye(2 * n)
    if mean:
        start[0] = np.eye(2 * n)
    stiffness, damping = system.stiffness / system.rate**2, system.damping / system.rate
    parts = []
    for left, right, k, c in zip(system.left, system.right, system.k, system.c, strict=True):
        parts.append((left, np.concatenate((right, 0.0 * right)), _projected(k / system.rate**2, doubled, kept)))
        if c.any():
            parts.append((left, np.concatenate((0.0 * right, right)), _projected(c / system.rate, doubled, kept)))
    block = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    steps, rows = _taylor_steps(block, parts, float(frequency[-1])), size * 2 * n
    # the exponential of a matrix known by its action only, or of one that is formed: whichever costs less
    action = rows * (2 * n * (2 * n + len(parts)) + len(parts) * (size + n))
    if rows**3 * (_BEGIN + math.log2(steps)) <= steps * _TERMS * (action + _EACH):
        matrix = np.kron(np.eye(size), block)
        for left, right, projected in parts:
            matrix -= np.kron(projected, np.outer(np.concatenate((0.0 * left, left)), right))
        turning = np.zeros((size, size))
        turning[cosine, cosine + 1], turning[cosine + 1, cosine] = -frequency, frequency
        matrix += np.kron(turning, np.eye(2 * n))
        end = expm(2.0 * math.pi * matrix) @ start.reshape(-1, 2 * n)
        return np.asarray(end).reshape(start.shape)
    return _by_taylor(start, block, parts, cosine, frequency, steps)


def _taylor_steps(block: Array, parts: _Parts, highest: float) -> int:
    """Steps for a period, by the norm of Hill's matrix, were velocities measured in the highest frequency."""
    n = block.shape[0] // 2
    stiff = float(np.abs(block[n:, :n]).sum(axis=1).max())
    stiff += sum(float(np.abs(p).sum(axis=1).max() * np.abs(l).max() * np.abs(r[:n]).sum()) for l, r, p in parts)
    drag = float(np.abs(block[n:, n:]).sum(axis=1).max())
    return max(1, math.ceil(0.5 * math.pi * (highest + math.sqrt(stiff) + drag)))


def _projected(spectrum: np.ndarray, doubled: np.ndarray, kept: int) -> Array:
    """Galerkin matrix of a real function's Fourier coefficients up to `kept`."""
    padded = np.zeros(int(doubled[-1]) + 1, dtype=complex)
    count = min(kept + 1, len(padded), len(spectrum))
    padded[:count] = spectrum[:count]
    return galerkin(padded, None, 0.0, bool(doubled[0] == 0), len(doubled))


def _by_taylor(start: Array, block: Array, parts: _Parts, cosine: np.ndarray, frequency: Array, steps: int) -> Array:
    """`exp(2 pi H)` on `start` by Taylor series of short steps: H is known by its action only."""
    n, size, columns = block.shape[0] // 2, len(start), start.shape[2]
    turn = frequency[:, None]
    first = int(cosine[0])
    cosines, sines = slice(first, size, 2), slice(first + 1, size, 2)
    # with the states first all of them, and what the laws feel, are one product
    acting = np.vstack([block, *(right for _, right, _ in parts)])
    felt = np.array([projected for _, _, projected in parts]).reshape(-1, size, size)
    pushed = np.array([left for left, _, _ in parts]).reshape(-1, n).T

    def slope(z: Array) -> Array:
        both = (acting @ z.reshape(2 * n, -1)).reshape(-1, size, columns)
        out, inputs = both[: 2 * n], both[2 * n :]
        out[:, cosines] -= turn * z[:, sines]
        out[:, sines] += turn * z[:, cosines]
        out[n:] -= (pushed @ (felt @ inputs).reshape(len(felt), -1)).reshape(n, size, columns)
        return out

    h = 2.0 * math.pi / steps
    z = np.ascontiguousarray(start.transpose(1, 0, 2))
    for _ in range(steps):
        check_time()
        term, order = z, 0
        total = z.copy()
        limit = 1e-17 * float(np.abs(z).max())
        while float(np.abs(term).max()) > limit and order < 60:
            order += 1
            term = slope(term) * (h / order)
            total += term
        z = total
    return z.transpose(1, 0, 2)


def koopman_hill_multipliers(state: BalanceState, subharmonic: bool) -> FloquetResult:
    """Multipliers by the Koopman-Hill projection on the motion with its neglected harmonics.

    The series of the perturbation is lengthened until that moves no multiplier by more than a ten-thousandth, or by
    more than what the motion neglects; the last move is the error estimate.
    """
    name = f"{'sub-harmonic' if subharmonic else 'direct'} Koopman-Hill"
    base, count = max(_FEWEST, state.basis.harmonics), 2 * state.linear.equation_of_motion()[0].shape[0]
    ladder = [math.ceil(share * base) for share in _LADDER[subharmonic]]
    rows = [count * (2 * harmonics + 1) for harmonics in ladder]
    if rows[1] > _LARGEST_PROJECTED:
        note = f"A Hill matrix of {rows[1]} rows is larger than {_LARGEST_PROJECTED}: use the monodromy matrix"
        return FloquetResult.inapplicable(count, name, note)
    motion, alternative = refined(state)
    best = Variational.of(motion, 2 * ladder[-1])
    phi = transition(best, ladder[0], subharmonic)
    of_motion = [_MOTION * (phi - transition(Variational.of(state, 2 * ladder[0]), ladder[0], subharmonic))]
    if alternative is not None:
        of_motion.append(phi - transition(Variational.of(alternative, 2 * ladder[0]), ladder[0], subharmonic))
    for harmonics, size in zip(ladder[1:], rows[1:], strict=True):
        if size > _LARGEST_PROJECTED:
            break
        shorter, phi = phi, transition(best, harmonics, subharmonic)
        if not all(np.isfinite(matrix).all() for matrix in (phi, shorter, *of_motion)):
            return FloquetResult.inapplicable(count, name, "The exponential of Hill's matrix is not finite")
        mu, (series, neglected) = eigenvalues(phi, ([phi - shorter], of_motion))
        if np.all(series <= np.maximum(_ACCURACY * np.maximum(1.0, np.abs(mu)), neglected)):
            break
    errors, defect = liouville(mu, series + neglected, best.decay)
    return FloquetResult(mu, errors, name, checks={"harmonics": float(harmonics), "Liouville": defect})


def eigenvalues(phi: Array, changes: Sequence[Sequence[Array]]) -> tuple[ComplexArray, list[Array]]:
    """Eigenvalues by falling modulus, and how far each set of changes of the matrix, and rounding, moves each."""
    mu, vectors = np.linalg.eig(phi)
    order = np.argsort(-np.abs(mu), kind="stable")
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        left = np.full_like(vectors, np.nan)
    rounding = 1e-15 * ((np.abs(left) @ np.abs(phi)) * np.abs(vectors).T).sum(axis=1)
    moves = []
    for together in changes:
        moved, size = rounding + 1e-14, 1e-15 * float(np.linalg.norm(phi))
        for change in together:
            moved = moved + np.abs(((left @ change) * vectors.T).sum(axis=1))
            # what cancels in this sum need not cancel in the truth
            moved += _CANCELLED_PROJECTED * ((np.abs(left) @ np.abs(change)) * np.abs(vectors).T).sum(axis=1)
            size += float(np.linalg.norm(change))
        # a double eigenvalue moves by the root of the change
        root = math.sqrt(size * max(1.0, float(np.abs(mu).max())))
        moves.append(np.minimum(np.nan_to_num(moved, nan=np.inf), root)[order])
    return mu.astype(complex)[order], moves
