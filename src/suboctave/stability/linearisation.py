"""The elements along a motion, on panels: what stiffness and damping they add, and what force they leave unbalanced.

Stiffness `k_g(tau)` and damping `c_g(tau)` act along the directions g of the elements. Along the motion as it stands,
each element is asked for its tangent once; along a motion that has been corrected by `d(tau)`, again, but for

- sharp laws: `f_u + f_uu d + f_uv d'` at the old nodes. The panels are graded towards the old passages, and where d is
  larger than the law's width the new ones lie between the nodes; the linear form has the right integral all the same.
- piecewise-linear laws: their stiffness s jumps at crossings, which move by `t_c = -d / u'` (a root of the parabola
  where the motion grazes). A thin slice of stiffness acts like an impulse: `-kick y` with `kick = -jump t_c`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from suboctave.harmonic.basis import Array
from suboctave.harmonic.local_force import LocalMotion
from suboctave.harmonic.quadrature import uniform_nodes
from suboctave.harmonic.state import BalanceState
from suboctave.model.sampling import AdaptiveSampling, PiecewiseLinear, PolynomialSampling, SharpSampling
from suboctave.stability.panels import NODES, lay_out

#: a law that tells nothing of itself and needs this many samples per period is smooth over one radian
_BLIND = 48.0


class Linearisation:
    """Stiffness and damping that the elements add along a motion.

    Attributes
    ----------
    directions
        Shape (G, size), in the unknown DOFs.
    stretch
        dtau/ds on every panel, shape (P, ORDER); node i of panel p is node `p (ORDER - 1) + i` of the period.
    base
        Stiffness of the piecewise-linear laws, constant on every panel, shape (G, P).
    stiffness, damping
        Those of all other laws at the nodes, shape (G, N); damping (G, 0) if no element has any.
    defect
        Force that the motion leaves unbalanced, shape (G, N).
    """

    def __init__(self, state: BalanceState) -> None:
        self.state = state
        self.locals = state.local_motions
        groups = state.balance.groups
        self.directions = [group.direction for group in groups]
        high = state.basis.harmonics
        c = np.array([self.locals[group.members[0]].motion for group in groups], dtype=complex).reshape(
            len(groups), high + 1
        )
        f = np.array([2.0 * force[: high + 1] for _, force, _, _ in state.spectra], dtype=complex).reshape(
            len(groups), high + 1
        )
        f[:, 0] *= 0.5
        #: elements that are not piecewise linear, with the index of their direction
        self._curved: list[tuple[int, LocalMotion]] = []
        laws: list[tuple[int, float, float, float, int]] = []
        degree, finest = 0, math.inf
        for g, group in enumerate(groups):
            for i in group.members:
                local = self.locals[i]
                kind = local.kind
                if isinstance(kind, PiecewiseLinear):
                    a = local.coefficients
                    laws += [(g, float(a[p.gap]), 0.0, float(a[p.stiffness]), p.side) for p in kind.pieces]
                    continue
                self._curved.append((g, local))
                degree = max(degree, 1)
                if isinstance(kind, PolynomialSampling):
                    degree = max(degree, kind.degree - 1)
                elif isinstance(kind, SharpSampling):
                    laws += [(g, p, w, 0.0, 1) for p, w in zip(kind.points, kind.widths, strict=True)]
                elif isinstance(kind, AdaptiveSampling):
                    finest = min(finest, _BLIND / (local.samples or 32))
        table = np.array(laws, dtype=float).reshape(-1, 5)
        grid = uniform_nodes(1 << math.ceil(math.log2(8 * high + 8)))
        self._laws = table
        self.stretch, self.values, self._events, self._start = lay_out(
            c, f, degree, finest, table, grid.zr, grid.zi, NODES
        )
        self._rates = state.rate * self.values[:, 1]
        self.base, force = _contacts(self.values, table, self.stretch.shape[0])
        tangent, self.stiffness, self.damping = self._tangents(self.values[:, 0], self._rates)
        self.defect = force + tangent - self.values[:, 2]

    def _tangents(self, u: Array, v: Array, change: Array | None = None) -> tuple[Array, Array, Array]:
        """Sums of f, f_u, f_v over the elements that are not piecewise linear, (G, N) each, the last (G, 0) if none.

        With `change` (G, 2, N), along the motion changed by it.
        """
        f, k = np.zeros_like(u), np.zeros_like(u)
        c: Array | None = None
        for g, local in self._curved:
            element, a = local.element, local.coefficients
            if change is None:
                force, f_u, f_v = element.tangent(u[g], v[g], a)
                f[g] += force
            elif isinstance(local.kind, SharpSampling):
                _, f_u, f_v = element.tangent(u[g], v[g], a)
                f_uu, f_uv, f_vv = element.curvature(u[g], v[g], a)
                f_u = f_u + f_uu * change[g, 0]
                if f_v is not None and f_uv is not None and f_vv is not None:
                    f_u = f_u + f_uv * change[g, 1]
                    f_v = f_v + f_uv * change[g, 0] + f_vv * change[g, 1]
            else:
                _, f_u, f_v = element.tangent(u[g] + change[g, 0], v[g] + change[g, 1], a)
            k[g] += f_u
            if f_v is not None:
                c = np.zeros_like(u) if c is None else c
                c[g] += f_v
        return f, k, np.zeros((len(u), 0)) if c is None else c

    def changed(self, change: Array) -> tuple[Array, Array, Array]:
        """Stiffness, damping, kicks at the beginnings of the panels (G, P) along the motion changed by (G, 2, N)."""
        _, stiffness, damping = self._tangents(self.values[:, 0], self._rates, change)
        kick = _kicks(self._events, self._start, self._laws, change, self.state.rate, len(self.stretch))
        return stiffness, damping, kick

    def size(self) -> Array:
        """Largest displacement along every direction, shape (G,)."""
        return np.abs(self.values[:, 0]).max(axis=1)


@njit(cache=True)
def _contacts(values, laws, panels):
    """Stiffness of the piecewise-linear laws on every panel (G, P), and their force at the nodes (G, N)."""
    groups, _, nodes = values.shape
    m = (nodes - 1) // panels
    base = np.zeros((groups, panels))
    force = np.zeros((groups, nodes))
    for law in range(laws.shape[0]):
        if laws[law, 2] > 0.0:
            continue
        g = int(laws[law, 0])
        gap = laws[law, 1]
        k = laws[law, 3]
        right = laws[law, 4] > 0.0
        for p in range(panels):
            if (values[g, 0, p * m + m // 2] > gap) == right:
                base[g, p] += k
        for j in range(nodes):
            if (values[g, 0, j] > gap) == right:
                force[g, j] += k * (values[g, 0, j] - gap)
    return base, force


@njit(cache=True)
def _kicks(events, start, laws, change, rate, panels):
    """Impulses at the beginnings of panels that stand for the movement of the contacts there, (G, P)."""
    out = np.zeros((change.shape[0], panels))
    m = (change.shape[2] - 1) // panels
    for i in range(events.shape[0]):
        law = int(events[i, 5])
        if laws[law, 2] > 0.0:
            continue
        g = int(laws[law, 0])
        k = laws[law, 3]
        right = laws[law, 4] > 0.0
        p = start[i]
        d = change[g, 0, p * m]
        slope = rate * events[i, 2] + change[g, 1, p * m]
        bend = rate * rate * events[i, 3]
        if events[i, 2] == 0.0:
            # an extremum that misses the gap: does the change carry it across?
            square = -2.0 * (events[i, 4] + d) / bend
            if square > 0.0 and (events[i, 4] > 0.0) != (events[i, 4] + d > 0.0):
                time = 2.0 * math.sqrt(square)
                touches = (events[i, 4] + d > 0.0) == right
                out[g, p] += k * time if touches else -k * time
            continue
        square = slope * slope - 2.0 * bend * d
        if square > 0.0:
            shift = -2.0 * d / (slope + math.copysign(math.sqrt(square), slope))
        else:
            shift = -slope / bend
        # upwards through the gap of a right stop: its stiffness begins later by the shift
        rises = (events[i, 2] > 0.0) == right
        out[g, p] += -k * shift if rises else k * shift
    return out
