"""Elements with nodes of their own (`harmonic.nodal`) as channels of the linearised motion.

A force f(q, theta) along d_out adds `d_out (f_ui d_i^T y + f_vi d_i^T y')` per input: one channel each, with its own
direction to the left and to the right. Further channels carry no force. They make panels follow what the law follows
(a corner in velocity, a sharp law in velocity), and tell the time at the nodes.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.group_force import GroupLaw
from suboctave.harmonic.nodal import NodalForce
from suboctave.harmonic.quadrature import FEWEST
from suboctave.harmonic.state import BalanceState
from suboctave.model.sampling import AdaptiveSampling, CornerSampling, PolynomialSampling, SharpVelocitySampling
from suboctave.stability.nodes import NODES, ORDER

#: nodes per period of a law that tells nothing, in units of panels of one radian; phase of a tangent over a panel
_BLIND, _TANGENT = 48.0, 7.0
#: width of the slices that are cut out around corners, in units of the motion
_SLICE = 1e-9
#: how close to a corner where powers of a half begin panels are graded, in units of the motion
_ROUGH = 1e-6
_NONE, _NO_PIECES = np.zeros(0), np.zeros((0, 3))


class Channels:
    """The channels of all elements with nodes of their own, after those of the `first` groups.

    Attributes
    ----------
    motions, forces
        Displacement and Fourier coefficients of the force of every channel, lists of (H + 1,) and (top + 1,).
    left, right
        Where a channel acts and what it reads, in the unknown DOFs; zero for those without force.
    laws
        What panels follow: see `GroupLaw`.
    degree, finest
        See `panels.lay_out`.
    blind
        Whether an element tells nothing of how smooth it is.
    """

    def __init__(self, state: BalanceState, first: int) -> None:
        self.state, self.first = state, first
        self.motions: list[ComplexArray] = []
        self.forces: list[ComplexArray] = []
        self.left: list[Array] = []
        self.right: list[Array] = []
        self.laws: list[GroupLaw] = []
        self.degree, self.finest, self.blind = 0, math.inf, False
        self._elements: list[tuple[NodalForce, int, Array]] = []
        self._tangents: list[Array] = []
        #: channels with marks of corners, by the first channel of their element; first and last panel between marks,
        #: by channel
        self._sliced: dict[int, list[tuple[int, int]]] = {}
        self._slices: dict[int, list[tuple[int, int]]] = {}
        for nodal in state.nodal:
            self._add(nodal)
        self._clock = -1
        if any(nodal.own.harmonic for nodal in state.nodal):
            turning = np.zeros(state.basis.harmonics + 1, dtype=complex)
            turning[1] = 1.0
            self._clock = self._channel(turning, None, None)

    def _channel(
        self, motion: ComplexArray, left: Array | None, right: Array | None, pieces: Array = _NO_PIECES,
        singular: tuple[Array, Array] = (_NONE, _NONE),
    ) -> int:  # fmt: skip
        size = self.state.balance.size
        self.motions.append(motion)
        self.forces.append(np.zeros(self.state.balance.top + 1, dtype=complex))
        self.left.append(np.zeros(size) if left is None else left)
        self.right.append(np.zeros(size) if right is None else right)
        self.laws.append(GroupLaw(pieces, _NONE, (), (), *singular, _NO_PIECES, np.zeros(2), (), 0))
        return self.first + len(self.motions) - 1

    def _add(self, nodal: NodalForce) -> None:
        own, kind = nodal.own, nodal.kind
        scale = np.ones(own.count)
        corners = kind if isinstance(kind, CornerSampling) else CornerSampling()
        begin = len(self.motions)
        for i, (d, motion) in enumerate(zip(own.ins, nodal.motions, strict=True)):
            left = own.out
            if len(d) == 1:
                # one unknown DOF: channels have one direction there
                scale[i], left = own.out[0] / d[0], d
            points = corners.points if i == 0 else ()
            self._channel(motion, left, d, _marks(points, motion), _grading(corners, points, motion))
            if i == 0 and corners.points:
                self._sliced.setdefault(self.first + begin, []).append((self.first + begin, 0))
        self.forces[begin] = scale[0] * nodal.force
        self._elements.append((nodal, self.first + begin, scale))
        velocity = 1j * nodal.rate * np.arange(len(nodal.motions[0])) * nodal.motions[0]
        if corners.velocities and velocity.any():
            marks, grading = _marks(corners.velocities, velocity), _grading(corners, corners.velocities, velocity)
            probe = self._channel(velocity, None, None, marks, grading)
            self._sliced.setdefault(self.first + begin, []).append((probe, 1))
        if isinstance(kind, SharpVelocitySampling) and velocity.any():
            self._channel(velocity, None, None, singular=(np.array(kind.velocities), np.array(kind.widths)))
        degree = max(1, kind.degree - 1) if isinstance(kind, PolynomialSampling) else 1
        self.degree = max(self.degree, degree)
        if isinstance(kind, AdaptiveSampling | CornerSampling):
            self.finest = min(self.finest, _BLIND / (nodal.samples or FEWEST))
            self.blind = self.blind or isinstance(kind, AdaptiveSampling)
        if own.harmonic:
            varying = own.harmonic * nodal.basis.nu + degree * nodal.basis.harmonics
            self.finest = min(self.finest, _TANGENT / varying)

    def _state(self, nodal: NodalForce, begin: int, path: Array) -> tuple[Array, Array]:
        """q (Q, N) and theta (N,) of an element at the nodes of the panels."""
        rows = path[begin : begin + nodal.own.count]
        q = np.concatenate((rows[:, 0], rows[:, 1])) if nodal.own.moving else rows[:, 0]
        if self._clock < 0 or not nodal.own.harmonic:
            return np.ascontiguousarray(q), np.zeros(q.shape[1])
        cosine, slope = path[self._clock]
        return np.ascontiguousarray(q), nodal.basis.nu * np.arctan2(-slope / nodal.rate, cosine)

    def ask(self, path: Array, law: Array) -> None:
        """Add force, stiffness and damping along the path (G, 2, N) to `law` (G, 4, N)."""
        self._tangents = []
        for nodal, begin, scale in self._elements:
            q, theta = self._state(nodal, begin, path)
            force, f_q = nodal.own.law.tangent(q, theta, nodal.c)
            law[begin, 0] += scale[0] * force
            self._tangents.append(f_q)
            self._put(nodal, begin, scale, f_q, law[:, 1:])

    def _put(self, nodal: NodalForce, begin: int, scale: Array, f_q: Array, law: Array) -> None:
        """Add a tangent (Q, N) to stiffness and damping (G, >= 2, N)."""
        count = nodal.own.count
        for i in range(count):
            law[begin + i, 0] += scale[i] * f_q[i]
            if nodal.own.moving:
                law[begin + i, 1] += scale[i] * f_q[count + i]

    def changed(self, path: Array, change: Array, law: Array, stretch: Array) -> None:
        """Add stiffness and damping along the path changed by `change` to `law` (G, 2, N).

        Of laws with corners every node keeps its side. For the time by which the motion reaches a corner later the law
        before it stays: an impulse, put into the slice that was cut out there.
        """
        for (nodal, begin, scale), f_q in zip(self._elements, self._tangents, strict=True):
            q, theta = self._state(nodal, begin, path)
            rows = change[begin : begin + nodal.own.count]
            d = np.concatenate((rows[:, 0], rows[:, 1])) if nodal.own.moving else rows[:, 0]
            if isinstance(nodal.kind, SharpVelocitySampling):
                new = f_q + np.einsum("rsn,sn->rn", nodal.own.law.curvature(q, theta, nodal.c), d)
            else:
                new = nodal.own.law.tangent(_moved(nodal, q, d), theta, nodal.c)[1]
            self._put(nodal, begin, scale, new, law)
            for channel, order in self._sliced.get(begin, ()):
                row = order * nodal.own.count
                for p, last in self._slices.get(channel, ()):
                    i, j = p * (ORDER - 1), (last + 1) * (ORDER - 1)
                    # of the displacement, or of the velocity
                    slope = path[channel, 1, i] + (change[begin, 1, i] if order == 0 else 0.0)
                    jump = f_q[row, j] - f_q[row, i]
                    if slope == 0.0 or jump == 0.0:
                        continue
                    later = -change[begin, order, i] / slope
                    length = 2.0 * stretch[p, 0] / nodal.rate
                    bump = 1.5 * scale[0] * jump * later / length * (1.0 - NODES**2)
                    law[begin, order, i : i + ORDER] -= bump

    def locate(self, events: Array, start: np.ndarray, owner: np.ndarray, panels: int) -> None:
        """Find the slices around corners: panels between the two marks of one corner.

        events, start, owner: see `panels.lay_out`; panels: how many there are.
        """
        if not self._sliced:
            return
        first = np.searchsorted(owner, np.arange(self.first + len(self.motions)))
        pieces = events[:, 5].astype(int)
        for i, piece in enumerate(pieces):
            follow = (i + 1) % len(pieces)
            if pieces[follow] < 0:  # a passage between the marks
                follow = (follow + 1) % len(pieces)
            if piece < 0 or owner[piece] < self.first or pieces[follow] < 0 or follow == i:
                continue
            channel = int(owner[piece])
            own, other = piece - first[channel], pieces[follow] - first[channel]
            apart = (events[follow, 0] - events[i, 0]) % (2.0 * math.pi)
            if owner[pieces[follow]] == channel and own // 2 == other // 2 and own != other and 0.0 < apart < 1e-3:
                last = int(start[follow]) - 1 if start[follow] > start[i] else panels - 1
                self._slices.setdefault(channel, []).append((int(start[i]), last))


def _moved(nodal: NodalForce, q: Array, d: Array) -> Array:
    """The states `q + d`, which stay on their sides of all corners."""
    moved = q + d
    kind = nodal.kind
    if isinstance(kind, CornerSampling):
        for row, levels in ((0, kind.points), (nodal.own.count, kind.velocities)):
            for level in levels:
                near = _SLICE * max(float(np.abs(q[row]).max()), np.finfo(float).tiny)
                above = np.maximum(moved[row], level + near)
                moved[row] = np.where(q[row] > level, above, np.minimum(moved[row], level - near))
    return moved


def _grading(corners: CornerSampling, levels: tuple[float, ...], motion: ComplexArray) -> tuple[Array, Array]:
    """Where panels are graded towards corners, as towards a law that is sharp there."""
    if not corners.rough or not levels:
        return _NONE, _NONE
    return np.array(levels, dtype=float), np.full(len(levels), _ROUGH * float(np.abs(motion).max()))


def _marks(levels: tuple[float, ...], motion: ComplexArray) -> Array:
    """Pieces without stiffness: panels end where the motion crosses them, just before and just after a corner."""
    near = _SLICE * 2.0 * float(np.abs(motion).max())
    return np.array([(0.0, level + side * near, 1.0) for level in levels for side in (-1.0, 1.0)]).reshape(-1, 3)
