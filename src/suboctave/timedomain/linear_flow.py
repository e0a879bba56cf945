"""The flow of a system between its contacts, exact in its linear part.

While contacts stay as they are the scaled field is `z' = A z + sum_k g_k exp(mu_k tau) + sum_l a_l f_l(q_l)`, the mu_k
being 0 and i times the harmonics of the loads, the f_l what smooth laws give for what they read, `q = R z`. With
`A = S diag(lambda) S^-1`, `z = S zeta`, `g_k = S G_k` and `a_l = S B_l`,

    zeta(tau + s) = exp(lambda s) zeta(tau) + sum_k G_k exp(mu_k tau) E_k(s)
                    + sum_l B_l int_0^s exp(lambda (s - t)) f_l dt,
    E_k(s) = (exp(mu_k s) - exp(lambda s)) / (mu_k - lambda).

Modes of a structure far above the load's frequency, which would take thousands of steps in one period, cost nothing
then. The forces f_l of a step are the polynomial through their values at Gauss's nodes (exponential collocation:
Hochbruck & Ostermann, Acta Numerica 19 (2010) 209-286): few numbers, solved for by Newton's method. The last
coefficients of its Legendre series tell how far it may be off, and how long steps may be.

Tangents w obey `w' = A w + sum_l a_l f_l' R w`, the same with the slopes of the laws instead of loads. The derivative
by `omega / W` has the source `-c z'`, c = W / omega, besides: with `w = v - c s z'` it is left to v as `c s` times the
derivative of the loads by tau, whose integral is closed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import NDArray

from suboctave.timedomain.field import Array, Field

__all__ = ["ExactRate", "ExactSolver", "exact_rate"]

ComplexArray = NDArray[np.complex128]

#: error of the diagonal form, relative to the field, from which on it is not used: modes that are nearly the same
_DEFECTIVE = 1e-10
#: longest step, in radians of the load and of the fastest vibration: what happens within is looked at in nine points
_LOAD, _FASTEST = 2.0 * np.pi / 64.0, 8.0
#: product of a difference of exponents and a time below which a quotient is taken by its series
_NEAR = 1e-4
#: nodes of a step, and the factor by which its error falls when it is halved
_NODES = 10
_FALLS = 2.0**_NODES
#: nodes of the integrals with exp(lambda t), which are cut where that is this power of e
_INNER, _GONE = 32, 38.0
#: Newton iterations of a step, and the change of forces, relative to the largest, that is rounding
_ITERATIONS, _ROUNDING = 8, 1e-13
#: what an error of a tangent, which begins as a unit vector, counts for beside one of the motion
_LOOSER = 1e-3
#: share of its longest below which a step makes no sense
_SHORTEST = 1e-9


class _Waves(NamedTuple):
    """Of instants s (N,) after the beginning: `exp(lambda s)` (2n, N), and what loads do until then to the modes and to
    v, for each exponent mu (K, 2n, N), without the factor `exp(mu tau)`.
    """

    decay: ComplexArray
    state: ComplexArray
    change: ComplexArray


class _Step(NamedTuple):
    """What a length of step fixes: the instants, Gauss's nodes and the end, (N,); `waves` there; `onto` (2n, s L), what
    forces at the nodes do at the end; `effect` (L,), the most that those of a law do to a scaled component, per unit of
    the largest; `seen` (s Q, 2n), what laws read there of modes at the beginning; `coupling` (s Q, s L), what forces do
    to what laws read.
    """

    instants: Array
    waves: _Waves
    onto: ComplexArray
    effect: Array
    seen: ComplexArray
    coupling: Array


@lru_cache(maxsize=1)
def _gauss() -> tuple[Array, Array]:
    """Gauss's nodes in a step of length 1, and what gives Legendre coefficients of values there, (s, s)."""
    x, weights = leggauss(_NODES)
    degrees = np.arange(_NODES)
    return 0.5 + 0.5 * x, (0.5 + degrees)[:, None] * weights * legvander(x, _NODES - 1).T


@lru_cache(maxsize=1)
def _inner() -> tuple[Array, Array]:
    """Nodes and weights of the integrals with exp(lambda t), on (-1, 1)."""
    x, weights = leggauss(_INNER)
    return x, weights


class ExactRate:
    """The rate of `Field.right_hand_side`, contacts frozen, of a state, tangents and, with `slope`, its derivative by
    frequency; and its solution.
    """

    def __init__(self, model: Field, active: NDArray[np.bool_], slope: bool) -> None:
        self.rate = model.right_hand_side(active, slope)
        self.model, self.slope = model, slope
        self.values, self.vectors, self.inverse = model.spectrum(active)
        constant, loads = model.constant(active), model.loads
        exponents = 1j * loads.harmonic
        self.exponents = np.concatenate([[0.0], exponents, -exponents])
        turned = np.exp(1j * loads.phase)
        push = self.inverse @ model.push.T

        def factors(amplitude: ComplexArray, still: Array) -> ComplexArray:
            """(2n, K), of complex amplitudes of the loads."""
            waves = push * (0.5 * amplitude)
            mirrored = self.inverse @ (model.push.T * np.conj(0.5 * amplitude))
            return np.concatenate([(self.inverse @ still)[:, None], waves, mirrored], axis=1)

        self.forces = factors(loads.amplitude * turned, constant)
        change = (loads.amplitude_slope + 1j * loads.amplitude * loads.phase_slope) * turned
        self.changes = model.reference * factors(change, np.zeros_like(constant))
        self.relative = model.reference / model.omega
        self.longest = min(_LOAD, _FASTEST / max(float(np.abs(self.values.imag).max()), 1e-300))
        #: R (Q, 2n) and B (2n, L) of the smooth laws
        self.reads, self.acts = model.read.T @ self.vectors, self.inverse @ model.act.T
        self._steps: dict[float, _Step] = {}

    def __call__(self, tau: float, y: Array) -> Array:
        return self.rate(tau, y)

    def waves(self, s: Array) -> _Waves:
        """See `_Waves`."""
        lam = self.values[:, None]
        decay = np.exp(lam * s)
        state, change = np.zeros((2, len(self.exponents), len(lam), len(s)), dtype=complex)
        for k, mu in enumerate(self.exponents):
            x, forces = mu - lam, self.forces[:, k, None]
            near = np.abs(x * s) < _NEAR
            safe = np.where(x == 0.0, 1.0, x)
            first = np.where(
                near, decay * s * (1.0 + 0.5 * x * s + (x * s) ** 2 / 6.0), (np.exp(mu * s) - decay) / safe
            )
            state[k] = forces * first
            if self.slope:
                second = np.where(
                    near, decay * s**2 * (0.5 + x * s / 6.0 + (x * s) ** 2 / 24.0), (first - s * decay) / safe
                )
                change[k] = self.changes[:, k, None] * first + self.relative * mu * forces * (s * first - second)
        return _Waves(decay, state, change)

    def turns(self, tau: float) -> ComplexArray:
        """exp(mu tau), (K,)."""
        return np.exp(self.exponents * tau)

    def integrals(self, h: float, s: Array) -> ComplexArray:
        """`int_0^s exp(lambda (s - t)) l_j(t / h) dt` at s (N,), l_j Lagrange's polynomials: (N, 2n, s)."""
        x, weights = _inner()
        decay = np.maximum(-self.values.real, 1e-300)
        reach = np.minimum(s[:, None], _GONE / decay)
        back = reach[:, :, None] * (0.5 + 0.5 * x)
        factors = 0.5 * reach[:, :, None] * weights * np.exp(self.values[:, None] * back)
        series = legvander(2.0 * (s[:, None, None] - back) / h - 1.0, _NODES - 1)
        moments: ComplexArray = np.einsum("aim,aimp->aip", factors, series)
        return moments @ _gauss()[1]

    def step(self, h: float) -> _Step:
        """What steps of length h need."""
        if h not in self._steps:
            size, laws = len(self.values), len(self.model.laws)
            nodes = h * _gauss()[0] if laws else np.zeros(0)
            instants = np.append(nodes, h)
            waves = self.waves(instants)
            found = self.integrals(h, instants) if laws else np.zeros((1, size, 0))
            onto = np.einsum("ij,il->ijl", found[-1], self.acts)
            effect = np.abs(np.tensordot(self.vectors, onto, 1).real).sum(axis=1).max(axis=0)
            seen = waves.decay.T[:-1, None, :] * self.reads
            coupling = np.einsum("qi,aij,il->aqjl", self.reads, found[:-1], self.acts, optimize=True).real
            read, acted = len(nodes) * len(self.reads), len(nodes) * laws
            self._steps[h] = _Step(
                instants,
                waves,
                onto.reshape(size, acted),
                effect,
                seen.reshape(read, size),
                coupling.reshape(read, acted),
            )
        return self._steps[h]

    def laws(self, q: Array, tau: Array) -> tuple[Array, Array]:
        """Forces (N, L) and slopes (N, L, Q) of the smooth laws for what they read, (N, Q)."""
        force, slopes = (
            np.zeros((len(tau), len(self.model.laws))),
            np.zeros((len(tau), len(self.model.laws), q.shape[1])),
        )
        for i, (law, c, own) in enumerate(self.model.laws):
            f, f_q = law(q[:, own].T.copy(), tau, c)
            force[:, i], slopes[:, i, own] = f, f_q.T
        return force, slopes

    def of_modes(self, tau: float, modes: ComplexArray) -> ComplexArray:
        """The rate of modes (2n, 1)."""
        rate = self.values[:, None] * modes + (self.forces @ self.turns(tau))[:, None]
        if self.model.laws:
            rate = rate + self.acts @ self.laws((self.reads @ modes).real.T, np.array([tau]))[0].T
        return rate

    def collocated(self, h: float, q: Array, tau: Array) -> tuple[Array, Array] | None:
        """Forces (s, L) at the nodes of a step, q (s, Q) what laws would read without them; and what maps a change of
        that to one of the forces, (s L, s Q). None where Newton's method does not arrive.
        """
        coupling, (nodes, reads) = self.step(h).coupling, q.shape
        force, slopes = self.laws(q, tau)
        for _ in range(_ITERATIONS):
            there = q + (coupling @ force.ravel()).reshape(q.shape)
            given, slopes = self.laws(there, tau)
            by_read = np.zeros((nodes, force.shape[1], nodes, reads))
            by_read[np.arange(nodes), :, np.arange(nodes)] = slopes
            matrix = by_read.reshape(force.size, q.size)
            inner = np.eye(force.size) - matrix @ coupling
            if not (np.isfinite(given).all() and np.isfinite(inner).all()):
                return None
            change = np.linalg.solve(inner, (given - force).ravel()).reshape(force.shape)
            force = force + change
            if np.abs(change).max() <= _ROUNDING * np.abs(force).max():
                return force, np.asarray(np.linalg.solve(inner, matrix), dtype=float)
        return None


def exact_rate(model: Field, active: NDArray[np.bool_], slope: bool) -> Any:
    """The rate with its solution where there is one; else the rate alone."""
    if not model.closed:
        return model.right_hand_side(active, slope)
    key = active.tobytes(), slope
    if key not in model.rates:
        values, vectors, inverse = model.spectrum(active)
        matrix = model.linear_rate(active)
        error = np.abs((vectors * values) @ inverse - matrix).max()
        diagonal = error <= _DEFECTIVE * np.abs(matrix).max()
        model.rates[key] = ExactRate(model, active, slope) if diagonal else model.right_hand_side(active, slope)
    return model.rates[key]


class ExactSolver:
    """What `advance` takes of a solver of SciPy: steps are as long as contacts between them can be seen, and the forces
    of smooth laws within `tolerance` of polynomials.

    `state` (2n,) is that of `y`, whose other rows are computed where they are asked for.
    """

    def __init__(
        self, rate: ExactRate, begin: float, y: Array, end: float, tolerance: float, first: float | None
    ) -> None:
        self.rate, self.end, self.tolerance = rate, end, tolerance
        self.t = self.t_old = begin
        self.status = "running"
        self._next = rate.longest
        self._wanted = first
        self._modes = rate.inverse @ y.reshape(-1, 2 * rate.model.n).T
        self._before, self._force = self._modes, np.zeros((_NODES, len(rate.model.laws)))
        self.state = self.state_old = y[: 2 * rate.model.n]

    @property
    def y(self) -> Array:
        """All rows at `t`."""
        return np.ascontiguousarray((self.rate.vectors @ self._modes).real.T).ravel()

    @property
    def y_old(self) -> Array:
        """All rows at `t_old`."""
        return np.ascontiguousarray((self.rate.vectors @ self._before).real.T).ravel()

    def step(self) -> str | None:
        """Go on by a step; what it fails for."""
        rate, nonlinear = self.rate, bool(self.rate.model.laws)
        self.t_old, self.state_old, self._before = self.t, self.state, self._modes
        wanted, self._wanted = self._wanted, None
        while True:
            h = min(self._next if wanted is None else wanted, self.end - self.t_old)
            error = self._try(h)
            if error <= self.tolerance:
                break
            if h <= _SHORTEST * rate.longest:
                self.status = "failed"
                return "the forces change at once"
            wanted = None
            while self._next >= h:
                self._next *= 0.5
        if nonlinear and h == self._next and error * _FALLS <= 0.1 * self.tolerance:
            self._next = min(2.0 * h, rate.longest)
        self.t = self.end if h >= self.end - self.t_old else self.t_old + h
        self.state = (rate.vectors @ self._modes[:, 0]).real
        if self.t >= self.end:
            self.status = "finished"
        return None

    def _try(self, h: float) -> float:
        """Take a step of length h; the error of its forces as one of the scaled state."""
        rate, before, table, turns = self.rate, self._before, self.rate.step(h), self.rate.turns(self.t_old)
        waves, tangents = table.waves, before[:, 1 : len(before.T) - rate.slope]
        state = waves.decay * before[:, :1] + np.tensordot(turns, waves.state, 1)
        change = waves.decay * before[:, -1:] + np.tensordot(turns, waves.change, 1)
        parts = [state[:, -1:], waves.decay[:, -1:] * tangents, *([change[:, -1:]] if rate.slope else [])]
        error = 0.0
        if rate.model.laws:
            solved = rate.collocated(h, (rate.reads @ state[:, :-1]).real.T, self.t_old + table.instants[:-1])
            if solved is None:
                return np.inf
            self._force, response = solved
            changes = response @ (table.seen @ tangents).real
            forces = np.concatenate(
                (self._force[:, :, None], _LOOSER * changes.reshape(*self._force.shape, tangents.shape[1])), axis=2
            )
            tail = np.abs(np.tensordot(_gauss()[1][-2:], forces, 1)).max(axis=(0, 2))
            error = float((table.effect * tail).max())
            parts[0] = parts[0] + table.onto @ self._force.reshape(-1, 1)
            parts[1] = parts[1] + table.onto @ changes
        if rate.slope:
            if rate.model.laws:
                seen = (rate.reads @ change[:, :-1]).real.T.reshape(-1, 1)
                parts[2] = parts[2] + table.onto @ (response @ seen)
            parts[2] = parts[2] - rate.relative * h * rate.of_modes(self.t_old + h, parts[0])
        self._modes = np.concatenate(parts, axis=1)
        return error

    def dense_output(self) -> Any:
        """The states (2n,) or (2n, N) at any time of the last step."""
        rate, begin, modes, force, h = self.rate, self.t_old, self._before, self._force, self.t - self.t_old

        def states(t: Any) -> Array:
            s = np.atleast_1d(np.asarray(t, dtype=float)) - begin
            waves = rate.waves(s)
            found = waves.decay * modes[:, :1] + np.tensordot(rate.turns(begin), waves.state, 1)
            if rate.model.laws:
                found = found + np.einsum("aij,jl,il->ia", rate.integrals(h, s), force, rate.acts, optimize=True)
            out: Array = (rate.vectors @ found).real
            return out if np.ndim(t) else out[:, 0]

        return states
