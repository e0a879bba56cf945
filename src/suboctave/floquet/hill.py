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

As a witness on other multipliers the method needs no eigenvalues: beside each that is in doubt it takes the root of the
determinant of J_kappa, kappa complex (`harmonic.perturbation`), in the unknowns of the balance, at the same two levels.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from suboctave.continuation.linear import Factor
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.assembly import galerkin
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, operator, rate_by_kappa


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
    weight = balance.scales[0]
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
#: quotients in which a root is found, or there is none, and a step whose square counts no more
_QUOTIENTS, _STEP = 12, 1e-6


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
        """Right and left null vectors of P at an eigenvalue, shape (waves, n) each."""
        right, left = null_vectors(self.matrix(s))
        shape = len(self.index), self.system.n
        return right.reshape(shape), left.conj().reshape(shape)

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


def null_vectors(matrix: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Right and left vectors, of length one, that a nearly singular matrix all but maps to zero: `J right`, `left^H J`;
    by inverse iteration.
    """
    factor = Factor.of(matrix)
    # exactly on an eigenvalue there may be a zero pivot
    pivots = np.diagonal(factor.lu)
    tiny = 1e-16 * float(np.abs(pivots).max())
    np.fill_diagonal(factor.lu, np.where(np.abs(pivots) < tiny, tiny, pivots))
    null = []
    for adjoint in (False, True):
        x = np.ones(len(factor.lu), dtype=complex)
        for _ in range(2):
            x = factor.solve(x / np.linalg.norm(x), adjoint)
        null.append(x / np.linalg.norm(x))
    return null[0], null[1]


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
    errors = _of_multiplier(mu, spread)
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
        if other is not None:
            rounding += abs(other.rayleigh(s, psi, phi)[0] - better)
        near = float(np.abs(_apart(np.delete(values, j), s)).min(initial=1.0))
        moved[j], spread[j] = _judged((s, middle, better), rounding, near)
    return moved, spread


def _judged(levels: tuple[complex, complex, complex], doubt: float, near: float) -> tuple[complex, float]:
    """An exponent and how far it may be off: as solved, with the better motion, and with the better perturbation
    besides; `doubt`: what is unsure anyway; `near`: the distance of the next exponent.
    """
    s, middle, better = levels
    parts = abs(better - s) + _CANCELLED * (abs(middle - s) + abs(better - middle)) + doubt
    if abs(better - s) < 0.3 * near:
        return better, parts
    # two exponents about to meet: first order means nothing, they move by about the root
    return s, 2.0 * math.sqrt(max(near, parts) * parts) if math.isfinite(parts) else math.inf


def hill_beside(state: BalanceState, known: FloquetResult) -> FloquetResult:
    """Hill's method at those multipliers alone that lie within their errors of the unit circle.

    Instead of all eigenvalues it takes the root of the determinant of J_kappa, kappa complex, that lies beside each: of
    a structure as many rows as the balance has unknowns. A multiplier without a root of its own keeps its value and has
    an infinite error, as have all that were not asked for.
    """
    count, rows = len(known.multipliers), state.balance.size * (4 * state.basis.harmonics + 3)
    if rows > _LARGEST:
        note = f"Hill's determinant of {rows} rows is larger than {_LARGEST}"
        return FloquetResult.inapplicable(count, "Hill", note)
    mu, errors = known.multipliers.copy(), np.full(count, np.inf)
    refinement = refined(state)
    # a tiny multiplier in place of none
    starts = np.log(np.where(mu == 0.0, np.finfo(float).tiny, mu).astype(complex)) / (2.0 * math.pi)
    for j in np.flatnonzero(known.open & (mu.imag >= 0.0)):
        found = _beside(state, refinement, starts, int(j))
        if found is None:
            continue
        twin = np.flatnonzero(known.multipliers == mu[j].conj())
        mu[j], errors[j] = found
        if not known.multipliers[j].imag:  # a real one, whatever the truncation makes of it
            mu[j], errors[j] = mu[j].real, errors[j] + abs(mu[j].imag)
        elif len(twin):
            mu[twin[0]], errors[twin[0]] = mu[j].conj(), errors[j]
    if not np.isfinite(errors).any():
        return FloquetResult.inapplicable(count, "Hill", "Hill's determinant has no root beside what is in doubt")
    return FloquetResult(mu, errors, "Hill")


def _beside(
    state: BalanceState, refinement: tuple[BalanceState, BalanceState | None], starts: ComplexArray, j: int
) -> tuple[complex, float] | None:
    """Multiplier and error of the root beside the exponent j of others, None if that is nearer to another's."""
    root = _root(state, starts[j])
    if root is None:
        return None
    s, left, right, _ = root
    motion, alternative = refinement
    more = ((motion.basis.harmonics - state.basis.harmonics) * state.balance.size,) * 2
    middle = s + _quotient(motion, s, _operator(motion, s), np.pad(left, more), np.pad(right, more))[0]
    better = _root(motion, middle)
    if better is None or int(np.abs(_apart(starts, better[0])).argmin()) != j:
        return None
    doubt = better[3]
    if alternative is not None:
        other = _root(alternative, better[0])
        doubt = math.inf if other is None else doubt + abs(other[0] - better[0])
    near = float(np.abs(_apart(np.delete(starts, j), s)).min(initial=1.0))
    s, spread = _judged((s, middle, better[0]), doubt, near)
    if not spread < 0.5:  # they repeat: known to no digit
        return None
    mu = complex(np.exp(2.0 * math.pi * s))
    return mu, _of_multiplier(mu, spread)


def _operator(state: BalanceState, s: complex) -> ComplexArray:
    """J_kappa at an exponent."""
    return operator(state, Kind.FREE, -1j * s * state.rate)


def _root(state: BalanceState, s: complex) -> tuple[complex, ComplexArray, ComplexArray, float] | None:
    """A root of the determinant of J_kappa beside an exponent, its left and right vector, and its rounding error: by
    inverse iteration and two-sided Rayleigh quotients (Ruhe, SIAM J. Numer. Anal. 10 (1973) 674-689), of which the last
    leaves about the square of its step.
    """
    for _ in range(_QUOTIENTS):
        matrix = _operator(state, s)
        right, left = null_vectors(matrix)
        step, rounding = _quotient(state, s, matrix, left, right)
        if not cmath.isfinite(step):
            return None
        s += step
        if abs(step) <= _STEP + rounding:
            return s, left, right, rounding
    return None


def _quotient(
    state: BalanceState, s: complex, matrix: ComplexArray, left: ComplexArray, right: ComplexArray
) -> tuple[complex, float]:
    """How far the root of `left^H J_kappa right` lies from s to first order, and its rounding error; matrix: J_kappa
    at s.
    """
    slope = rate_by_kappa(state, Kind.FREE, left, right, -1j * s * state.rate) * state.rate
    if slope == 0.0:
        return complex(math.nan), math.inf
    rounding = 1e-15 * float(np.abs(left) @ np.abs(matrix) @ np.abs(right)) / abs(slope)
    return complex(-1j * np.vdot(left, matrix @ right) / slope), rounding


def _of_multiplier(mu: Any, spread: Any) -> Any:
    """Errors of multipliers from those of exponents: relative to their size."""
    return np.abs(mu) * np.expm1(np.minimum(2.0 * math.pi * spread, 700.0)) + 1e-14 * np.abs(mu)


def _closed(mu: ComplexArray, errors: Array) -> tuple[ComplexArray, Array]:
    """The set closed under conjugation, as it must be: truncation leaves a negative real one with an Im of 1e-6."""
    distance = np.abs(mu[:, None] - mu[None, :].conj())
    partner = distance.argmin(axis=1)
    mutual = partner[partner] == np.arange(len(mu))
    closed = np.where(mutual, 0.5 * (mu + mu[partner].conj()), mu)
    return closed, errors + np.abs(closed - mu)
