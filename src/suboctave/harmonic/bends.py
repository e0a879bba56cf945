"""Second and third derivatives of every force along a motion, as weights at instants, in one form for all elements.

A force acts along `out` and reads q, the displacements along its inputs and their rates. Along perturbations a, b, c of
the motion,

    int f_qq[a, b] h dtau = sum_j W_rs(j) a_r b_s h (tau_j),
    int f_qqq[a, b, c] h dtau = sum_j W_rst(j) a_r b_s c_t h (tau_j) + V_rst(j) d/dtau (a_r b_s c_t h) (tau_j).

V comes from corners. Where the force has a jump eta of its slope f_r at q_r = level, f_rr holds `eta delta(q_r -
level)`, and the third derivative `eta delta'`, of which

    int delta'(q_r - level) g dtau = -sum_i (1 / |q_r'|) d/dtau (g / q_r')  at the instants tau_i of passing,

besides Dirac functions with the jumps of f_rs. A piecewise-linear law has nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.closed_bends import ClosedBends
from suboctave.harmonic.group_force import GroupLaw, uniform_count
from suboctave.harmonic.nodal import NodalForce
from suboctave.harmonic.nodal_third import nodal_third
from suboctave.harmonic.quadrature import Nodes, graded_motion, uniform_nodes
from suboctave.harmonic.state import BalanceState
from suboctave.harmonic.third_weights import Third
from suboctave.lazy import lazy


@dataclass(frozen=True, eq=False)
class Bends:
    """One force along a motion: where it acts (size,), what it reads (m, size), whether rates too."""

    state: BalanceState
    out: Array
    ins: Array
    moving: bool
    source: tuple[GroupLaw, int] | NodalForce

    @lazy
    def second(self) -> tuple[Array, Array, Array]:
        """Instants (cosines, sines) and weights W (Q, Q, N)."""
        if isinstance(self.source, NodalForce):
            bend = self.source.bend
            return bend.zr, bend.zi, bend.weights
        own = self.state.curvatures[self.source[1]]
        if not self.moving:
            return own.zr, own.zi, own.uu[None, None]
        uv, vv = (np.zeros_like(own.uu) if w is None else w for w in (own.uv, own.vv))
        return own.zr, own.zi, np.array([[own.uu, uv], [uv, vv]])

    @property
    def parts(self) -> list[ClosedBends]:
        """Both of a force along one direction that reads no rates."""
        assert not isinstance(self.source, NodalForce)
        law, index = self.source
        if law.in_closed_form:
            return self.state.closed_bends[index]
        zr, zi, second = self.second
        none, no_slope = np.zeros_like(zr), np.zeros(0)
        found = [ClosedBends(zr, zi, second[0, 0], none, no_slope)]
        for part in self.third:
            slope = no_slope if part.slopes is None else part.slopes[0, 0, 0]
            found.append(ClosedBends(part.zr, part.zi, np.zeros_like(part.zr), part.weights[0, 0, 0], slope))
        return found

    @lazy
    def third(self) -> list[Third]:
        """Instants with their weights W and V."""
        if isinstance(self.source, NodalForce):
            return nodal_third(self.source)
        law, index = self.source
        closed = self.state.closed_bends[index]
        return list(_group_third(self.state, law, closed, self.state.motions[index], self.moving))


def bends_of(state: BalanceState) -> list[Bends]:
    """All forces along a motion: one per direction, one per element with nodes of its own."""
    balance = state.balance
    laws = balance.coefficients(state.values)[2]
    found = [
        Bends(state, group.direction, group.direction[None], bool(balance.moving[g]), (law, g))
        for g, (group, law) in enumerate(zip(balance.groups, laws, strict=True))
    ]
    return found + [Bends(state, n.own.out, n.own.ins, n.own.moving, n) for n in state.nodal]


def _group_third(
    state: BalanceState, law: GroupLaw, closed: list[ClosedBends], motion: ComplexArray, moving: bool
) -> Iterator[Third]:
    balance, high, top = state.balance, motion.shape[0] - 1, state.balance.top
    for part in closed:
        yield _in_displacement(part, moving)
    for members, points, widths in (
        (law.sharp, law.points, law.widths),
        (law.uniform, None, None),
    ):
        if not members:
            continue
        if points is None or widths is None:
            nodes = uniform_nodes(uniform_count(law, balance.samples, high, top))
            u, du = kernels.motion(motion, nodes.zr, nodes.zi)
        else:
            zr, zi, w, u, du = graded_motion(motion, points, widths, top)
            nodes = Nodes(zr, zi, w)
        weights = np.zeros((2, 2, 2, len(u)) if moving else (1, 1, 1, len(u)))
        for i, c in members:
            uuu, *rest = balance.elements[i].third(u, state.rate * du, c)
            weights[0, 0, 0] += nodes.weights * uuu
            if not moving or rest[0] is None:
                continue
            uuv, uvv, vvv = (nodes.weights * np.asarray(part) for part in rest)
            for place in ((0, 0, 1), (0, 1, 0), (1, 0, 0)):
                weights[place] += uuv
            for place in ((0, 1, 1), (1, 0, 1), (1, 1, 0)):
                weights[place] += uvv
            weights[1, 1, 1] += vvv
        yield Third(nodes.zr, nodes.zi, weights, None)


def _in_displacement(part: ClosedBends, moving: bool) -> Third:
    """Weights of a law that has f_uuu only."""
    shape = (2, 2, 2, len(part.zr)) if moving else (1, 1, 1, len(part.zr))
    weights = np.zeros(shape)
    weights[0, 0, 0] = part.third
    if not part.slope.size:
        return Third(part.zr, part.zi, weights, None)
    slopes = np.zeros(shape)
    slopes[0, 0, 0] = part.slope
    return Third(part.zr, part.zi, weights, slopes)
