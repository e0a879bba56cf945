"""The channels of laws that are asked at nodes, along a motion whose stability is looked for.

An element with nodes of its own (`aft.general`), of force f(q, theta) along d_out, adds `d_out (f_ui d_i^T y + f_vi
d_i^T y')` per input: one channel each, with its own direction to the left and to the right, behind those of the groups.
Panels end just before and just behind every corner of a law: between such marks lies a slice of no length to speak of,
into which goes what the corner adds as it is reached earlier or later. Channels without force make panels follow what a
law follows, a velocity in which it is sharp or has corners, hold the marks of surfaces, and give the time at the nodes.

Such laws give their tangents at all nodes at once, along the motion as it stands and, where it is corrected by
`d(tau)`, again; but for sharp laws `f_u + f_uu d + f_uv d'` is taken at the old nodes. Panels are graded towards the
old passages, and where d exceeds the law's width the new ones lie between the nodes; the linear form has the right
integral all the same.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from suboctave.floquet.time_mesh import NODES, ORDER
from suboctave.harmonic.aft.channel import Channel
from suboctave.harmonic.aft.closed_form import NO_ROWS
from suboctave.harmonic.aft.corners import Corner, surface_at
from suboctave.harmonic.aft.general import GeneralLaw
from suboctave.harmonic.aft.table import Probe
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState

#: nodes per period of a law of unknown smoothness, in units of panels of one radian; phase of a tangent over a panel
BLIND, _TANGENT = 48.0, 7.0
#: width of the slices that are cut out around corners, in units of the function that vanishes there
_SLICE = 1e-9
#: how close to a corner where powers of a half begin panels are graded, in units of the motion
_ROUGH = 1e-6
#: corrections of a state that has left its side of a corner
_CORRECTED = 3
_NOTHING = Probe()
#: a channel without motion reaches none of these
_UNREACHED = np.array([[0.0, -1.0, 1.0], [0.0, 1.0, 1.0]])
#: and how far in tau their marks may be apart; those of any corner are closer than the latter
_WIDEST, _LONGEST = 1e-4, 1e-3


class _Marked(NamedTuple):
    """Corners of a law that one channel has the marks of."""

    channel: int
    corners: list[Corner]


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
        #: and how fast what vanishes there passes, by channel
        self._sliced: dict[int, list[_Marked]] = {}
        self._slices: dict[int, list[tuple[int, int, float]]] = {}
        #: surfaces with the channel of their marks
        self._surfaces: list[tuple[int, Corner]] = []
        self._clock = -1
        if not state.packed.whole:
            for g, channel in enumerate(state.channels[: self.first]):
                own = [law for law in channel.laws if isinstance(law, GeneralLaw)]
                self._laws += [(law, g, np.ones(1)) for law in own]
        for channel in state.own_channels if state.balance.own else ():
            self._add(channel)
        if self._laws and any(law.harmonic for law, _, _ in self._laws):
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
        corners = nodal.corners
        for i, (d, motion) in enumerate(zip(own.ins, along.motions, strict=True)):
            if len(d) == 1:
                # see `blocks.in_blocks`
                scale[i] = own.out[0] / d[0]
            places = [corner for corner in corners if i == 0 and corner.row == 0]
            self.numbers.append(self._channel(motion, _probe(nodal, motion, places)))
            self._mark(begin, self.numbers[-1], places)
        self.forces[begin] = scale[0] * own.spectra[0]
        self._laws.append((nodal, self.first + begin, scale))
        velocity = nodal.velocity
        places = [corner for corner in corners if 0 < corner.row < along.size]
        if places and velocity.any():
            self._mark(begin, self._channel(velocity, _probe(nodal, velocity, places)), places)
        for corner in corners:
            if corner.row >= along.size:
                # nothing moves along it: its marks are known
                still = np.zeros_like(velocity)
                self._surfaces.append((self._channel(still, Probe(_UNREACHED)), corner))
                self._mark(begin, self._surfaces[-1][0], [corner])
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

    def _mark(self, begin: int, channel: int, corners: list[Corner]) -> None:
        if corners:
            self._sliced.setdefault(self.first + begin, []).append(_Marked(channel, corners))

    def _state(self, nodal: GeneralLaw, begin: int, path: Array) -> tuple[Array, Array]:
        """q (Q, N) and theta (N,) of an element at the nodes of the panels."""
        q, theta = np.ascontiguousarray(_inputs(nodal, begin, path)), np.zeros(path.shape[2])
        if self._clock >= 0 and nodal.harmonic:
            cosine, slope = path[self._clock]
            theta = nodal.along.nu * np.arctan2(-slope / nodal.along.rate, cosine)
        for corner in nodal.corners:
            # what reaches a corner everywhere at once would have its sides by rounding
            if corner.everywhere and abs(corner.turns[1, 0]) < _SLICE * np.abs(q).max():
                surface = surface_at(nodal, corner, q, theta)
                below = surface.value + _SLICE * np.abs(q).max()
                q = q - below / (surface.normal**2).sum(axis=0) * surface.normal
        return q, theta

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
                new = nodal.tangent(_moved(nodal, q, theta, d), theta)[1]
            self._put(nodal, begin, scale, new, law)
            for marked in self._sliced.get(begin, ()):
                for p, last, rate in self._slices.get(marked.channel, ()):
                    i, j = p * (ORDER - 1), (last + 1) * (ORDER - 1)
                    here = surface_at(nodal, marked.corners[0], q[:, i : i + 1], theta[i : i + 1])
                    normal, jumps = here.normal[:, 0], f_q[:, j] - f_q[:, i]
                    passing = rate + normal[: nodal.count] @ change[begin : begin + nodal.count, 1, i]
                    if passing == 0.0 or not jumps.any():
                        continue
                    later, length = -(normal @ d[:, i]) / passing, 2.0 * spans[p, 0]
                    impulses = np.multiply.outer(jumps, -1.5 * later / length * (1.0 - NODES**2))
                    self._put(nodal, begin, scale, impulses, law[:, :, i : i + ORDER])

    def together(self, channel: int) -> slice:
        """The channels of the element with nodes of its own that one belongs to; of others, it alone."""
        for nodal, begin, _ in self._laws:
            if begin >= self.first and begin <= channel < begin + nodal.count:
                return slice(begin, begin + nodal.count)
        return slice(channel, channel + 1)

    def marked(self, events: Array, owner: np.ndarray) -> Array:
        """Events along a motion, rows as of `time_mesh.events_along`, with the marks just before and just behind every
        corner at a surface; owner: see there.
        """
        rows = [events]
        for channel, corner in self._surfaces:
            far = 2.0 * _SLICE * corner.size / np.maximum(np.abs(corner.rate), np.finfo(float).tiny)
            apart = np.abs(np.subtract.outer(corner.at, corner.at)) % (2.0 * math.pi)
            apart = np.minimum(apart, 2.0 * math.pi - apart) + math.pi * np.eye(len(apart))
            nearest = apart.min(axis=1, initial=_WIDEST)
            for side, piece in zip((-1.0, 1.0), np.flatnonzero(owner == channel), strict=True):
                block = np.zeros((len(corner.at), 6))
                block[:, 0] = np.mod(corner.at + side * np.minimum(far, 0.25 * nearest), 2.0 * math.pi)
                block[:, 1], block[:, 2], block[:, 3], block[:, 5] = np.inf, corner.rate, corner.second, piece
                rows.append(block)
        return np.concatenate(rows)

    def locate(self, events: Array, start: np.ndarray, owner: np.ndarray, panels: int) -> None:
        """Find the slices around corners: panels between the two marks of one corner.

        events, start, owner: see `time_mesh.events_along` and `panels_between`; panels: how many there are.
        """
        if not self._sliced:
            return
        first = np.searchsorted(owner, np.arange(self.first + len(self.motions)))
        pieces = events[:, 5].astype(int).tolist()
        for i, piece in enumerate(pieces):
            if piece < 0 or owner[piece] < self.first:
                continue
            channel = int(owner[piece])
            # the other mark of the corner: another element may have its own there, and passages lie between
            other = first[channel] + ((piece - first[channel]) ^ 1)
            for k in range(i + 1, i + len(pieces)):
                follow = k % len(pieces)
                apart = (events[follow, 0] - events[i, 0]) % (2.0 * math.pi)
                if apart >= _LONGEST:
                    break
                if pieces[follow] == other and apart > 0.0:
                    last = int(start[follow]) - 1 if start[follow] > start[i] else panels - 1
                    rate = self.state.rate * float(events[i, 2])
                    self._slices.setdefault(channel, []).append((int(start[i]), last, rate))
                    break
                if owner[pieces[follow]] == channel and pieces[follow] >= 0:
                    break


def _inputs(nodal: GeneralLaw, begin: int, path: Array) -> Array:
    """Displacements and, if a law reads them, velocities of its inputs, (Q, N), of all channels' (G, 2, N)."""
    rows = path[begin : begin + nodal.count]
    return np.concatenate((rows[:, 0], rows[:, 1])) if nodal.moving else rows[:, 0]


def _moved(nodal: GeneralLaw, q: Array, theta: Array, d: Array) -> Array:
    """The states `q + d`, which stay on their sides of all corners."""
    moved = q + d
    for corner in nodal.corners:
        near = _SLICE * corner.size
        above = surface_at(nodal, corner, q, theta).value > 0.0
        for _ in range(_CORRECTED if corner.row >= len(q) else 1):
            surface = surface_at(nodal, corner, moved, theta)
            wanted = np.where(above, np.maximum(surface.value, near), np.minimum(surface.value, -near))
            length = np.maximum((surface.normal**2).sum(axis=0), np.finfo(float).tiny)
            moved = moved + (wanted - surface.value) / length * surface.normal
    return moved


def _probe(law: GeneralLaw, motion: ComplexArray, corners: list[Corner]) -> Probe:
    """Panels end where the motion crosses pieces without stiffness, just before and just after corners; towards rough
    ones they are graded, as towards a law that is sharp there.
    """
    size = float(np.abs(motion).max())
    near, levels = _SLICE * 2.0 * size, [corner.level for corner in corners]
    pieces = [(0.0, level + side * near, 1.0) for level in levels for side in (-1.0, 1.0)]
    rough = levels if law.rough else []
    return Probe(np.array(pieces).reshape(-1, 3), rough, [_ROUGH * size] * len(rough))
