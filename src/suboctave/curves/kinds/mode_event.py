"""Where nonlinear modes turn or cross, in a second parameter: extrema of omega, limit points, branch points.

With `Y(X, zeta, omega) = 0` the equations of a mode and Q what is extreme along it, omega or the action,

    K = [Y_U; Q_U],    [K b; c^T 0] [v; h] = [0; 1],    [K b; c^T 0]^T [w; .] = [0; 1],

U all unknowns: h = 0 where Q is extreme, v is then the direction of the mode. (With `dE = omega dJ`, J the action,
energy and action turn together: there four multipliers are +1, at an extremum of omega two.) The two multipliers that
are +1 by themselves leave no trace, since Y holds the phase and has zeta among its unknowns: what Grenat, Baguet,
Lamarque & Dufour (Bifurcation analysis of nonlinear normal modes with the harmonic balance method, 2018) do by
bordering J_0. At a branch point Y_U itself loses rank, and the last entry of w vanishes besides: with Q = omega,

    Y + beta b = 0,    h = 0,    w_Q = 0,

unfolded by beta as in `branch_point`, zero where a symmetry forces the crossing. h and w_Q change by `-w . dK v` and
`-w . dK z`, z the solution for a unit in the row of Q: changes of K along v and z, central differences.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation.linear import length
from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.curves.kinds.bordering import bordered_factor, column_sizes, row_factors, sizes_of, with_harmonics
from suboctave.curves.kinds.nonlinear_mode import ModeEquations, NonlinearMode
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.energy import action_gradient, fed
from suboctave.harmonic.evaluation import BalanceState
from suboctave.lazy import lazy

#: step of the differences of K, in units of the unknowns and of the parameter
_STEP = 1e-5


@dataclass(frozen=True)
class ModeEvent(Augmentation):
    """Events along the modes of `base`: see the classes for the kinds.

    `right`, `left` border K in units of these: rows of `force` times one plus the square of the multiple of omega,
    weighted by masses; columns of `size` of the motion, weighted by masses, 1, and `omega`; `action` of J_U.
    """

    base: NonlinearMode
    right: Array
    left: Array
    force: float
    size: float
    omega: float
    action: float
    #: whether what is extreme is the action, not omega; whether Y_U loses rank
    of_action = False
    crossing = False

    @property
    def extras(self) -> int:
        """zeta, and the unfolding of a branch point."""
        return 2 if self.crossing else 1

    @property
    def free_phase(self) -> bool:
        """As of the mode."""
        return True

    @property
    def own(self) -> Augmentation:
        return self.base

    @property
    def no_multipliers(self) -> str:
        return self.base.no_multipliers

    @classmethod
    def through(cls, item: Bifurcation, state: BalanceState, names: tuple[str, ...]) -> tuple[ModeEvent, Array]:
        """See `Augmentation.through`."""
        base, extra = NonlinearMode.through(item, state, names)
        blank = cls(base, np.zeros(0), np.zeros(0), *_units(state))
        kept = fed(state, float(extra[0]))
        u, _, vt = np.linalg.svd(blank.at(kept, np.append(extra, 0.0), names).matrix)
        event = replace(blank, right=vt[-1], left=u[:, -1])
        return event, np.append(extra, 0.0)[: event.extras]

    def multiplier(self, rate: float, extra: Array) -> complex | None:
        return self.base.multiplier(rate, extra)

    def zeta(self, extra: Array) -> float:
        return self.base.zeta(extra)

    def unfolding(self, extra: Array) -> float:
        return float(extra[1]) if self.crossing else 0.0

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> ModeEventEquations:
        return ModeEventEquations(self, state, extra, names)

    def resized(self, basis: HarmonicBasis, size: int) -> ModeEvent:
        right, left = (with_harmonics(v, basis.size * size, 2) for v in (self.right, self.left))
        base = replace(self.base, reference=self.base.basis.resized(self.base.reference, basis), basis=basis)
        return replace(self, base=base, right=right, left=left)


class ModeExtremum(ModeEvent):
    """omega is extreme along the modes."""

    name = NonlinearMode.name
    turning = "omega"
    trivial = 2


class ModeLimitPoint(ModeEvent):
    """Energy and action are: two more multipliers are +1."""

    name = "LP"
    trivial = 4
    of_action = True


class ModeBranchPoint(ModeEvent):
    """Modes cross, and two more multipliers are +1."""

    name = "BP"
    trivial = 4
    crossing = True


#: by what was located along a mode
MODE_EVENTS: dict[str, type[ModeEvent]] = {"extremum": ModeExtremum, "LP": ModeLimitPoint, "BP": ModeBranchPoint}


def _units(state: BalanceState) -> tuple[float, float, float, float]:
    """Sizes of the forces, of the motion, of omega, and of the gradient of the action over a change of the motion."""
    force, size = sizes_of(state)
    slope = action_gradient(state)[:-1] * column_sizes(state, size)
    return force, size, state.omega, length(slope) or 1.0


class ModeEventEquations(Equations):
    """The equations of the mode, h, and at a branch point w_Q."""

    def __init__(self, of: ModeEvent, state: BalanceState, extra: Array, names: tuple[str, ...]) -> None:
        self.of, self.state, self.extra, self.names = of, state, extra, names
        self.base: ModeEquations = of.base.at(state, extra, names)
        beta = of.unfolding(extra)
        self.addition = beta * self._unfolded if beta else None

    @property
    def own(self) -> Equations:
        return self.base

    @lazy
    def _rows(self) -> Array:
        """Units of the rows of R."""
        return row_factors(self.state, self.of.force)

    @property
    def _unfolded(self) -> Array:
        """R differentiated by beta."""
        return self.of.left[: len(self._rows)] / self._rows

    @lazy
    def _sizes(self) -> Array:
        """Of the unknowns of the mode."""
        return np.append(column_sizes(self.state, self.of.size), [1.0, self.of.omega])

    @lazy
    def matrix(self) -> Array:
        """K, square."""
        n = self.state.balance.dimension
        out = np.zeros((n + 2, n + 2))
        out[: n + 1] = self.base.jacobian(self.names)[:, : n + 2]
        out[:n] *= self._rows[:, None]
        if self.of.of_action:
            # of the motion under its own forces
            slope = action_gradient(fed(self.state, -float(self.extra[0])))
            out[-1, :n], out[-1, -1] = slope[:n] / self.of.action, slope[n] / self.of.action
        else:
            out[-1, -1] = 1.0 / self.of.omega
        return out * self._sizes

    @lazy
    def _solved(self) -> tuple[Array, Array, Array, float]:
        """v, the left vector w, z, and h."""
        factor, m = bordered_factor(self.matrix, self.of.left, self.of.right), len(self.of.right)
        last = np.eye(m + 1)[-2:]
        v, w, z = factor.solve(last[1]), factor.solve(last[1], adjoint=True), factor.solve(last[0])
        return v[:m], w[:m], z[:m], float(v[m])

    @property
    def values(self) -> Array:
        _, w, _, h = self._solved
        return np.concatenate((self.base.values, [h, w[-1]][: self.of.extras]))

    @lazy
    def rows(self) -> Array:
        v, w, z, _ = self._solved
        n, name = self.state.balance.dimension, self.names[1]
        out = np.zeros((1 + self.of.extras, n + self.of.extras + 2))
        out[0] = np.insert(self.base.rows[0], [n + 1] * (self.of.extras - 1), 0.0)
        width = _STEP * (abs(self.state.values[name]) or 1.0)
        beside = self._moved(np.zeros(n + 2), width).matrix - self._moved(np.zeros(n + 2), -width).matrix
        columns = [*range(n + 1), -2]
        for i, along in enumerate((v, z)[: self.of.extras], 1):
            step = _STEP * along * self._sizes
            change = self._moved(step, 0.0).matrix - self._moved(-step, 0.0).matrix
            out[i, columns] = -(w @ change) / (2.0 * _STEP) / self._sizes
            out[i, -1] = -float(w @ beside @ along) / (2.0 * width)
        return out

    def _moved(self, by: Array, other: float) -> ModeEventEquations:
        """The equations beside: the unknowns of the mode, and the second parameter, changed."""
        state, of, n = self.state, self.of, self.state.balance.dimension
        values = {**state.values, self.names[1]: state.values[self.names[1]] + other}
        extra = self.extra.copy()
        extra[0] += by[n]
        moved = state.balance.at(state.x + state.balance.shaped(by[:n]), state.omega + by[-1], values)
        return of.at(fed(moved, of.zeta(extra)), extra, self.names)

    def jacobian(self, names: tuple[str, ...]) -> Array:
        own, n = self.base.jacobian(names), self.state.balance.dimension
        out = np.zeros((n + len(self.rows), self.rows.shape[1]))
        out[:n, : n + 1], out[:n, -2:] = own[:n, : n + 1], own[:n, -2:]
        if self.of.crossing:
            out[:n, n + 1] = self._unfolded
        out[n:] = self.rows
        return out

    def renewed(self) -> ModeEvent:
        v, w, _, _ = self._solved
        force, size, omega, action = _units(fed(self.state, -float(self.extra[0])))
        base, right, left = self.base.renewed(), v / length(v), w / length(w)
        return type(self.of)(base, right, left, force, size, omega, action)
