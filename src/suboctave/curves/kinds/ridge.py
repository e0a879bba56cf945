"""Ridges: motions whose amplitude is extreme along the response, over the first free parameter.

With t the direction of the response there, `R_X t_X + R_p t_p = 0`, and G the amplitude, `G_X . t_X = 0`: the matrix

    B = [R_X R_p; G_X 0],    [B b; c^T 0] [t; g] = [0; 1],    g = 0,

is singular, b and c its null vectors at the last point. It has one null vector at limit points, where p turns, and also
where a closed response shrinks to a point, or two cross: there every direction is one of the response, and in one of
them the amplitude stands. (Such curves: Raze, Volvert & Kerschen, Tracking amplitude extrema of nonlinear frequency
responses using the harmonic balance method, 2024; borders: Govaerts, Numerical Methods for Bifurcations of Dynamical
Equilibria, SIAM 2000.) G is the largest |x| of the observed displacement, or the amplitude of one of its harmonics.
With w the left null vector g changes by `-w . dB t`, of R a central difference of two Jacobians along t.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation.linear import Factor, length
from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array, HarmonicBasis, harmonic_index, to_complex
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.quadrature import peak
from suboctave.lazy import lazy

#: step of the difference of Jacobians, in units of the motion and of the first parameter
_STEP = 1e-5


@dataclass(frozen=True)
class Ridge(Augmentation):
    """`dof` of the displacement; `multiple` of omega of its harmonic, None for the largest displacement; `borders`, c
    and b in units of the motion's size and of the parameter's value at the start, `along`.
    """

    dof: int
    multiple: float | None
    borders: tuple[Array, Array]
    along: float
    reads_observed = True

    @property
    def name(self) -> str:
        """Kind of motions."""
        return "ridge" if self.multiple is None else "harmonic_ridge"

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[Ridge, Array]:
        """See `Augmentation.through`."""
        value = state.omega if names[0] == "omega" else state.values[names[0]]
        none = np.zeros(0)
        blank = cls(item.context["observe"], item.context["onto"].get("harmonic"), (none, none), abs(value) or 1.0)
        left, _, right = np.linalg.svd(blank.at(state, none, names).matrix)
        return replace(blank, borders=(right[-1], left[:, -1])), none

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> RidgeEquations:
        return RidgeEquations(self, state, names)

    def resized(self, basis: HarmonicBasis, size: int) -> Ridge:
        borders = []
        for own in self.borders:
            kept = np.zeros(basis.size * size + 1)
            count = min(len(kept), len(own)) - 1
            kept[:count], kept[-1] = own[:count], own[-1]
            borders.append(kept / length(kept))
        return replace(self, borders=(borders[0], borders[1]))


class RidgeEquations(Equations):
    """g, of B with rows of about unit length."""

    def __init__(self, of: Ridge, state: BalanceState, names: tuple[str, ...]) -> None:
        self.of, self.state, self.names = of, state, names

    @lazy
    def _sizes(self) -> Array:
        """Units of the coefficients and of the first parameter."""
        weight = self.state.balance.per_unknown(self.state.balance.scales[0])
        size = length(weight * self.state.x.ravel()) or 1.0
        return np.append(size / weight, self.of.along)

    @lazy
    def _scaled(self) -> Array:
        """`[R_X R_p]` in these units, (n, n + 1)."""
        scaled: Array = self.state.extended_jacobian(self.names[0]) * self._sizes
        return scaled

    @lazy
    def _units(self) -> tuple[float, float]:
        """What the rows of R and that of G are divided by."""
        return float(np.abs(self._scaled).max()), length(self._amplitude[1] * self._sizes[:-1]) or 1.0

    @lazy
    def matrix(self) -> Array:
        """B in these units, (n + 1, n + 1)."""
        (force, amplitude), n = self._units, len(self._scaled)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n] = self._scaled / force
        matrix[n, :n] = self._amplitude[1] * self._sizes[:-1] / amplitude
        return matrix

    @lazy
    def _null(self) -> tuple[Array, Array, float]:
        """t, w and g."""
        right, left = self.of.borders
        n = len(self.matrix)
        bordered = np.zeros((n + 1, n + 1))
        bordered[:n, :n], bordered[:n, n], bordered[n, :n] = self.matrix, left, right
        factor = Factor.of(bordered)
        if factor.singular:
            raise ConvergenceError("two ridges meet")
        unit = np.eye(1, n + 1, n)[0]
        t, w = factor.solve(unit), factor.solve(unit, adjoint=True)
        return t[:n], w[:n], float(t[n])

    @lazy
    def _amplitude(self) -> tuple[float, Array, Array, float]:
        """The amplitude G, G_X, and the part `c b b^T` of its second derivative: b and c."""
        state = self.state
        reads = state.balance.along(self.of.dof)
        c = to_complex(state.x) @ reads
        if self.of.multiple is not None:
            at = 2 * harmonic_index(self.of.multiple, state.basis.nu) - 1
            if at > len(state.x) - 2:
                raise ConvergenceError(f"the harmonic at {self.of.multiple} omega is not kept")
            z = state.x[at : at + 2] @ reads
            size = float(length(z)) or np.finfo(float).tiny
            rows = np.zeros((2, len(state.x)))
            rows[0, at : at + 2], rows[1, at : at + 2] = z / size, (-z[1] / size, z[0] / size)
            along, across = (np.outer(row, reads).ravel() for row in rows)
            return size, along, across, 1.0 / size
        size, tau, value = peak(c)
        k = np.arange(len(c))
        bend = float(np.real(-(k**2) * c @ np.exp(1j * k * tau)))
        side = 1.0 if value >= 0.0 else -1.0
        waves = np.empty((2, len(state.x)))
        waves[:, 0] = 1.0, 0.0
        waves[0, 1::2], waves[0, 2::2] = np.cos(k[1:] * tau), np.sin(k[1:] * tau)
        waves[1, 1::2], waves[1, 2::2] = -k[1:] * np.sin(k[1:] * tau), k[1:] * np.cos(k[1:] * tau)
        along, turning = (side * np.outer(row, reads).ravel() for row in waves)
        return size, along, turning, -side / bend if bend else 0.0

    def rate(self, along: Array) -> float:
        """Change of the amplitude along a direction (dX, ...) of the curve, relative to it."""
        gradient = self._amplitude[1]
        return float(gradient @ along[: len(gradient)]) / self._unit

    @property
    def _unit(self) -> float:
        return self._amplitude[0] or 1.0

    @property
    def values(self) -> Array:
        return np.array([self._null[2]])

    @lazy
    def rows(self) -> Array:
        (t, w, _), (force, amplitude) = self._null, self._units
        _, _, across, bend = self._amplitude
        step = t * self._sizes
        ahead, behind = (self._moved(s * _STEP * step) for s in (1.0, -1.0))
        row = -w[:-1] @ (ahead - behind) / (2.0 * _STEP * force)
        row[: len(across)] -= w[-1] * bend * float(across @ step[:-1]) / amplitude * across
        return row[None]

    def _moved(self, by: Array) -> Array:
        """Derivatives of R by the coefficients and all names, beside."""
        state, name = self.state, self.names[0]
        omega, values = state.omega, dict(state.values)
        if name == "omega":
            omega += by[-1]
        else:
            values[name] += by[-1]
        moved = state.balance.at(state.x + state.balance.shaped(by[:-1]), omega, values)
        return np.column_stack((moved.jacobian, *(moved.residual_by(one) for one in self.names)))

    def renewed(self) -> Ridge:
        t, w, _ = self._null
        return replace(self.of, borders=(t / length(t), w / length(w)))
