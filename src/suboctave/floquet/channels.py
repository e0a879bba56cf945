"""Laws that give their tangents at the nodes of a time mesh, and the channels of elements with nodes of their own.

An element with nodes of its own (`aft.general`), of force f(q, theta) along d_out, adds `d_out (f_ui d_i^T y + f_vi
d_i^T y')` per input: one channel each, with its own direction to the left and to the right. Channels without force make
panels follow what such a law follows (a corner in velocity, a sharp law in velocity), and give the time at the nodes.

Such laws give their tangents at all nodes at once, along the motion as it stands and, where it is corrected by
`d(tau)`, again; but for sharp laws `f_u + f_uu d + f_uv d'` is taken at the old nodes. Panels are graded towards the
old passages, and where d exceeds the law's width the new ones lie between the nodes; the linear form has the right
integral all the same.
"""

from __future__ import annotations

import math

import numpy as np

from suboctave.floquet.time_mesh import NODES, ORDER
from suboctave.harmonic.aft.channel import Channel
from suboctave.harmonic.aft.closed_form import NO_ROWS
from suboctave.harmonic.aft.general import GeneralLaw, Smoothness
from suboctave.harmonic.aft.table import Probe
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState

#: nodes per period of a law of unknown smoothness, in units of panels of one radian; phase of a tangent over a panel
BLIND, _TANGENT = 48.0, 7.0
#: width of the slices that are cut out around corners, in units of the motion
_SLICE = 1e-9
#: how close to a corner where powers of a half begin panels are graded, in units of the motion
_ROUGH = 1e-6
_NOTHING = Probe()


class Channels:
    """Laws that are asked at nodes, and the channels of elements with nodes of their own, after those of the groups.

    Attributes
    ----------
    first
        Number of groups.
    motions, forces
        Displacement and Fourier coefficients of the force of every channel of their own, lists of (H + 1,) and
        (top + 1,).
    numbers
        The channel of every input of these elements.
    probes
        What panels follow along these channels.
    degree, finest
        Degree of the tangents as polynomials in the motion; longest panel that they allow.
    unknown
        Whether a law may be anything.
    """

    def __init__(self, state: BalanceState) -> None:
        self.state, self.first = state, len(state.balance.groups)
        self.motions: list[ComplexArray] = []
        self.forces: list[ComplexArray] = []
        self.numbers: list[int] = []
        self.probes: list[Probe] = []
        self.degree, self.finest, self.unknown = 0, math.inf, False
        #: every law, the channel of its first input, and what its forces along every input are multiplied by
        self._laws: list[tuple[GeneralLaw, int, Array]] = []
        self._tangents: list[Array] = []
        #: channels with marks of corners, by the first channel of their element; first and last panel between marks,
        #: by channel
        self._sliced: dict[int, list[tuple[int, int]]] = {}
        self._slices: dict[int, list[tuple[int, int]]] = {}
        self._clock = -1
        if not state.packed.whole:
            for g, channel in enumerate(state.channels[: self.first]):
                own = [law for law in channel.laws if isinstance(law, GeneralLaw)]
                self._laws += [(law, g, np.ones(1)) for law in own]
        for channel in state.own_channels if state.balance.own else ():
            self._add(channel)
        if any(law.harmonic for law, _, _ in self._laws):
            turning = np.zeros(state.basis.harmonics + 1, dtype=complex)
            turning[1] = 1.0
            self._clock = self._channel(turning)

    def _channel(self, motion: ComplexArray, probe: Probe = _NOTHING) -> int:
        self.motions.append(motion)
        self.forces.append(np.zeros(self.state.balance.top + 1, dtype=complex))
        self.probes.append(probe)
        return self.first + len(self.motions) - 1

    def _add(self, own: Channel) -> None:
        (nodal,) = own.laws
        assert isinstance(nodal, GeneralLaw)
        along, law = nodal.along, nodal.smoothness
        scale = np.ones(own.count)
        begin = len(self.motions)
        for i, (d, motion) in enumerate(zip(own.ins, along.motions, strict=True)):
            if len(d) == 1:
                # see `blocks.in_blocks`
                scale[i] = own.out[0] / d[0]
            self.numbers.append(self._channel(motion, _probe(law, law.points if i == 0 else (), motion)))
            if i == 0 and law.points:
                self._sliced.setdefault(self.first + begin, []).append((self.first + begin, 0))
        self.forces[begin] = scale[0] * own.spectra[0]
        self._laws.append((nodal, self.first + begin, scale))
        velocity = 1j * along.rate * np.arange(len(along.motions[0])) * along.motions[0]
        if law.velocities and velocity.any():
            probe = self._channel(velocity, _probe(law, law.velocities, velocity))
            self._sliced.setdefault(self.first + begin, []).append((probe, 1))
        if law.sharp_velocities[0] and velocity.any():
            self._channel(velocity, Probe(NO_ROWS, *law.sharp_velocities))
        degree = max(1, law.degree - 1)
        self.degree = max(self.degree, degree)
        self.unknown = self.unknown or law.unknown
        if law.cornered or law.unknown:
            self.finest = min(self.finest, BLIND / nodal.samples)
        if nodal.harmonic:
            varying = nodal.harmonic * nodal.along.nu + degree * nodal.along.high
            self.finest = min(self.finest, _TANGENT / varying)

    def _state(self, nodal: GeneralLaw, begin: int, path: Array) -> tuple[Array, Array]:
        """q (Q, N) and theta (N,) of an element at the nodes of the panels."""
        q = _inputs(nodal, begin, path)
        if self._clock < 0 or not nodal.harmonic:
            return np.ascontiguousarray(q), np.zeros(q.shape[1])
        cosine, slope = path[self._clock]
        return np.ascontiguousarray(q), nodal.along.nu * np.arctan2(-slope / nodal.along.rate, cosine)

    def evaluate(self, path: Array, law: Array) -> None:
        """Add force, stiffness and damping along the path (G, 2, N) to `law` (G, >= 3, N)."""
        self._tangents = []
        for nodal, begin, scale in self._laws:
            q, theta = self._state(nodal, begin, path)
            force, f_q = nodal.tangent(q, theta)
            law[begin, 0] += scale[0] * force
            self._tangents.append(f_q)
            self._put(nodal, begin, scale, f_q, law)

    def _put(self, nodal: GeneralLaw, begin: int, scale: Array, f_q: Array, law: Array) -> None:
        """Add a tangent (Q, N) to stiffness and damping in `law` (G, >= 3, N)."""
        count = nodal.count
        for i in range(count):
            law[begin + i, 1] += scale[i] * f_q[i]
            if nodal.moving:
                law[begin + i, 2] += scale[i] * f_q[count + i]

    def changed(self, path: Array, change: Array, law: Array, spans: Array) -> None:
        """Add stiffness and damping along the path changed by `change` to `law` (G, 3, N).

        Of laws with corners every node keeps its side. For the time by which the motion reaches a corner later the law
        before it stays: an impulse, put into the slice that was cut out there.
        """
        for (nodal, begin, scale), f_q in zip(self._laws, self._tangents, strict=True):
            q, theta = self._state(nodal, begin, path)
            d = _inputs(nodal, begin, change)
            if nodal.smoothness.sharp:
                new = f_q + np.einsum("rsn,sn->rn", nodal.curvature(q, theta), d)
            else:
                new = nodal.tangent(_moved(nodal, q, d), theta)[1]
            self._put(nodal, begin, scale, new, law)
            for channel, order in self._sliced.get(begin, ()):
                row = order * nodal.count
                for p, last in self._slices.get(channel, ()):
                    i, j = p * (ORDER - 1), (last + 1) * (ORDER - 1)
                    # of the displacement, or of the velocity
                    slope = path[channel, 1, i] + (change[begin, 1, i] if order == 0 else 0.0)
                    jump = f_q[row, j] - f_q[row, i]
                    if slope == 0.0 or jump == 0.0:
                        continue
                    later = -change[begin, order, i] / slope
                    length = 2.0 * spans[p, 0]
                    bump = 1.5 * scale[0] * jump * later / length * (1.0 - NODES**2)
                    law[begin, 1 + order, i : i + ORDER] -= bump

    def together(self, channel: int) -> slice:
        """The channels of the element with nodes of its own that one belongs to; of others, it alone."""
        for nodal, begin, _ in self._laws:
            if begin >= self.first and begin <= channel < begin + nodal.count:
                return slice(begin, begin + nodal.count)
        return slice(channel, channel + 1)

    def locate(self, events: Array, start: np.ndarray, owner: np.ndarray, panels: int) -> None:
        """Find the slices around corners: panels between the two marks of one corner.

        events, start, owner: see `time_mesh.events_along` and `panels_between`; panels: how many there are.
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


def _inputs(nodal: GeneralLaw, begin: int, path: Array) -> Array:
    """Displacements and, if a law reads them, velocities of its inputs, (Q, N), of all channels' (G, 2, N)."""
    rows = path[begin : begin + nodal.count]
    return np.concatenate((rows[:, 0], rows[:, 1])) if nodal.moving else rows[:, 0]


def _moved(nodal: GeneralLaw, q: Array, d: Array) -> Array:
    """The states `q + d`, which stay on their sides of all corners."""
    moved, law = q + d, nodal.smoothness
    for row, levels in ((0, law.points), (nodal.count, law.velocities)):
        for level in levels:
            near = _SLICE * max(float(np.abs(q[row]).max()), np.finfo(float).tiny)
            above = np.maximum(moved[row], level + near)
            moved[row] = np.where(q[row] > level, above, np.minimum(moved[row], level - near))
    return moved


def _probe(law: Smoothness, levels: tuple[float, ...], motion: ComplexArray) -> Probe:
    """Panels end where the motion crosses pieces without stiffness, just before and just after corners; towards rough
    ones they are graded, as towards a law that is sharp there.
    """
    size = float(np.abs(motion).max())
    near = _SLICE * 2.0 * size
    pieces = [(0.0, level + side * near, 1.0) for level in levels for side in (-1.0, 1.0)]
    rough = levels if law.rough else ()
    return Probe(np.array(pieces).reshape(-1, 3), rough, [_ROUGH * size] * len(rough))
