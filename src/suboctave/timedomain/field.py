"""The equation of motion as a first-order vector field, in scaled variables and without any harmonic.

`M x'' + C x' + K x + sum_e d_e f_e(u_e, v_e) = p(t)`, `u_e = d_e . x`, is written for `z = (x / L, x' / (L W))` over
`tau = omega t`, with one length `L_i` per degree of freedom and a reference frequency `W`: tolerances are then pure
numbers, whatever the user's units. A piecewise-linear element contributes nothing but a matrix and a constant while
its contacts stay as they are, so that between two contact instants the field is smooth (linear, if no other element
is there). Every gap, and every point where a smooth law is sharp, is a switch: a scaled distance
`g = side (u - gap) / l` whose sign changes are located by the integrator.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import InputError
from suboctave.model import System
from suboctave.model.elements.base import BaseElement
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.elements.smoothness import switches
from suboctave.model.expressions.coefficients import Coefficient
from suboctave.model.projected import ProjectedSystem

__all__ = ["Array", "Field", "Switch", "default_lengths", "scaled_field"]

Array = NDArray[np.float64]
RightHandSide = Callable[[float, Array], Array]
#: force and slopes of a law for the states that it reads, at an instant
LawAtOneInstant = Callable[[list[float], float], tuple[float, list[float]]]

#: degrees of freedom up to which a system that is no projected structure is stepped
FEW = 40
# A degree of freedom that hardly moves is measured against this share of the largest motion (weighted by its mass).
_SMALLEST_SHARE = 1e-3
# The law of a stop takes this many units in the last place of `u` and `gap` for "exactly at the gap".
_TIE = 4 * np.finfo(float).eps


@dataclass(frozen=True)
class Switch:
    """A place where the law of an element changes or is sharp: `side (u - gap)` changes sign there.

    `stiffness` is that of the piece that acts while `side (u - gap) > 0`; `None` marks a smooth law, where the
    integrator only restarts.
    """

    element: int
    direction: Array
    gap: float
    side: int
    stiffness: float | None


class _Loads(NamedTuple):
    """The loads as rows: `direction[i] amplitude[i] cos(harmonic[i] omega t + phase[i])`, with d/d omega."""

    direction: Array  # (m, n)
    harmonic: Array  # (m,)
    amplitude: Array
    amplitude_slope: Array
    phase: Array
    phase_slope: Array


def _loads(system: System, at: Mapping[str, float]) -> _Loads:
    def read(c: Coefficient) -> tuple[float, float]:
        """Value, and its derivative with respect to omega."""
        return c.value(at), c.derivative("omega").value(at) if "omega" in c.names else 0.0

    components = system.load_components()
    numbers = [(c.harmonic, *read(c.amplitude), *read(c.phase)) for c in components]
    direction = np.array([c.direction for c in components], dtype=float).reshape(-1, system.n)
    return _Loads(direction, *np.array(numbers, dtype=float).reshape(-1, 5).T.copy())


class Field:
    """The scaled vector field of a system at given parameters, frequency and scales.

    `lengths` (n,), `reference` the frequency W of the velocity scale (default: `omega`). Rows of a stacked state are
    the scaled state, then one row per column of the state-transition matrix, then (with `slope=True`) the
    derivative of the state with respect to `omega / W`.
    """

    def __init__(
        self,
        system: System,
        omega: float,
        values: Mapping[str, float] | None = None,
        lengths: Array | None = None,
        reference: float | None = None,
    ) -> None:
        if not (np.isfinite(omega) and omega > 0.0):
            raise InputError(f"omega must be a positive number, not {omega!r}: it sets the scale of time")
        self.system = system
        self.omega = float(omega)
        self.reference = float(reference if reference is not None else omega)
        self.values = {**system.parameters, **system.read_values(values)}
        self.n = system.n
        self.mass, self.damping, self.stiffness = (np.asarray(a, dtype=float) for a in system.matrices(self.values))
        self.inverse_mass = np.linalg.inv(self.mass)
        self.loads = _loads(system, {**self.values, "omega": self.omega})
        #: laws that are evaluated, with their coefficients: all but those that are a sum of pieces
        self.smooth: list[tuple[BaseElement, Array]] = []
        self.switches: list[Switch] = []
        for index, element in enumerate(system.elements):
            c = element.coefficient_values(self.values)
            direction = element.inputs(self.n)[0]
            places = switches(element.sampling(c), c)
            self.switches += [Switch(index, direction, *place) for place in places]
            if not places or places[0][2] is None:
                self.smooth.append((element, c))
        self.rescale(np.ones(self.n) if lengths is None else lengths)

    # ---------------------------------------------------------------------------------------------- scales
    def rescale(self, lengths: Array) -> None:
        """Take new lengths (n,); everything that depends on them is built again."""
        n, omega, reference = self.n, self.omega, self.reference
        self.lengths = np.asarray(lengths, dtype=float)
        self.scale = np.concatenate([self.lengths, self.lengths * reference])
        velocity_per_force = self.inverse_mass / (self.lengths[:, None] * reference * omega)
        self._linear = np.zeros((2 * n, 2 * n))
        self._linear[:n, n:] = np.eye(n) * reference / omega
        self._linear[n:, :n] = -velocity_per_force @ (self.stiffness * self.lengths)
        self._linear[n:, n:] = -velocity_per_force @ (self.damping * self.lengths * reference)
        push = self.loads.direction @ velocity_per_force.T
        self._push = np.hstack([np.zeros_like(push), push])
        #: of every law: its tangent, its coefficients, which of the columns read are its own
        self.laws: list[tuple[Callable[..., tuple[Array, Array]], Array, slice]] = []
        self._one_instant: list[LawAtOneInstant] = []
        read, act = [np.zeros((0, 2 * n))], [np.zeros((0, 2 * n))]
        columns = 0
        for element, c in self.smooth:
            law = as_coupled(element)
            inputs = element.inputs(n)
            zero = np.zeros_like(inputs)
            read.append(np.hstack([inputs * self.lengths, zero]))
            if element.depends_on_velocity:
                read.append(np.hstack([zero, inputs * self.lengths * reference]))
            act.append(np.concatenate([np.zeros(n), -velocity_per_force @ element.direction(n)])[None])
            first, columns = columns, columns + len(inputs) * (1 + element.depends_on_velocity)
            self.laws.append((law.tangent, c, slice(first, columns)))
            self._one_instant.append(_one_instant(element, c))
        #: what the laws read, as columns (2n, Q), and the rates that a unit of their forces makes, (L, 2n)
        self.read, self.act = np.ascontiguousarray(np.vstack(read).T), np.vstack(act)

        along = np.array([s.side * s.direction for s in self.switches]).reshape(-1, n)
        gap = np.array([s.side * s.gap for s in self.switches])
        size = np.abs(along) @ self.lengths
        self._gap_rows = along * self.lengths / size[:, None]
        self._gap_offset = gap / size
        self._gap_acts = np.hstack([np.zeros_like(along), -along @ velocity_per_force.T])
        self._gap_stiffness = np.array([s.stiffness or 0.0 for s in self.switches])
        self._gap_size = size
        self._piecewise: dict[bytes, tuple[Array, Array]] = {}
        self._spectra: dict[bytes, tuple[NDArray[np.complex128], ...]] = {}
        #: rates with their solutions (`linear_flow`), by the contacts that are closed, and whether with the slope
        self.rates: dict[tuple[bytes, bool], RightHandSide] = {}

    def at_frequency(self, omega: float) -> Field:
        """The same field, with the same scales and reference frequency, at another `omega`."""
        return Field(self.system, omega, self.values, self.lengths, self.reference)

    # ------------------------------------------------------------------------------------------ right-hand side
    def _matrices(self, active: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Linear part (2n, 2n), transposed, and constant part (2n,) with the contacts in `active` closed."""
        key = active.tobytes()
        if key not in self._piecewise:
            matrix, constant = self._linear.copy(), np.zeros(2 * self.n)
            for i in np.flatnonzero(active & (self._gap_stiffness != 0.0)):
                force = self._gap_stiffness[i] * self._gap_size[i]
                matrix[:, : self.n] += force * np.outer(self._gap_acts[i], self._gap_rows[i])
                constant -= force * self._gap_offset[i] * self._gap_acts[i]
            self._piecewise[key] = np.ascontiguousarray(matrix.T), constant
        return self._piecewise[key]

    def linear_rate(self, active: NDArray[np.bool_]) -> Array:
        """What the scaled state is multiplied by in its rate per unit of `tau`, (2n, 2n), smooth laws left out."""
        return self._matrices(active)[0].T

    def constant(self, active: NDArray[np.bool_]) -> Array:
        """What does not change in the rate, (2n,)."""
        return self._matrices(active)[1]

    @property
    def push(self) -> Array:
        """Rates (m, 2n) by loads of the amplitude 1."""
        return self._push

    @property
    def closed(self) -> bool:
        """Whether the linear part of the flow is taken in closed form: structures have fast modes, which are stiff."""
        return self.n > FEW or isinstance(self.system, ProjectedSystem)

    def spectrum(self, active: NDArray[np.bool_]) -> tuple[NDArray[np.complex128], ...]:
        """Eigenvalues (2n,) and vectors of `linear_rate`, and their inverse, (2n, 2n)."""
        key = active.tobytes()
        if key not in self._spectra:
            values, vectors = np.linalg.eig(self.linear_rate(active).astype(complex))
            self._spectra[key] = values, vectors, np.linalg.inv(vectors)
        return self._spectra[key]

    def right_hand_side(self, active: NDArray[np.bool_], slope: bool = False) -> RightHandSide:
        """The rate of the stacked rows per unit of `tau`, contacts frozen as in `active` (one flag per switch)."""
        matrix, constant = self._matrices(active)
        m, read, act = 2 * self.n, self.read, self.act
        laws = [(law, own) for law, (_, _, own) in zip(self._one_instant, self.laws, strict=True)]
        forces, slopes = np.zeros(len(laws)), np.zeros((read.shape[1], len(laws)))
        loads, push = self.loads, self._push
        harmonic, phase, pushed = loads.harmonic, loads.phase, loads.amplitude[:, None] * push
        relative = self.reference / self.omega

        def rate(tau: float, y: Array) -> Array:
            rows = y.reshape(-1, m)
            out = rows @ matrix
            first = out[0]
            angle = harmonic * tau + phase
            cosine = np.cos(angle)
            first += constant + cosine @ pushed
            if laws:
                q = rows @ read
                states = q[0].tolist()
                for i, (law, own) in enumerate(laws):
                    forces[i], slopes[own, i] = law(states[own], tau)
                force = q @ slopes
                force[0] = forces
                out += force @ act
            if slope:
                # F_tau = F / omega, so d F_tau / d(omega/W) = -(W/omega) F_tau + W (1/omega) dF/d omega
                change = loads.amplitude_slope * cosine - loads.amplitude * loads.phase_slope * np.sin(angle)
                out[-1] += self.reference * (change @ push) - relative * first
            return out.ravel()

        return rate

    # ------------------------------------------------------------------------------------------------ switches
    def distances(self, z: Array) -> Array:
        """Scaled distance of every switch, positive where its piece acts; `z` (2n,) or (2n, N)."""
        value = self._gap_rows @ z[: self.n]
        return value - (self._gap_offset if z.ndim == 1 else self._gap_offset[:, None])

    def approach(self, z: Array) -> Array:
        """Rate of `distances` per unit of `tau`."""
        return self._gap_rows @ z[self.n :] * (self.reference / self.omega)

    def contacts(self, tau: float, z: Array) -> NDArray[np.bool_]:
        """Which pieces act just after `tau`; exactly at a gap the velocity decides, then the acceleration."""
        distance, approach = self.distances(z), self.approach(z)
        active = distance > 0.0
        rounding = _TIE * (np.abs(self._gap_rows) @ np.abs(z[: self.n]) + np.abs(self._gap_offset))
        tied = np.flatnonzero(np.abs(distance) <= rounding)
        if tied.size:
            slow = _TIE * (np.abs(self._gap_rows) @ np.abs(z[self.n :]))
            turn = self._gap_rows @ self.right_hand_side(active)(tau, z)[self.n :]
            for i in tied:
                active[i] = approach[i] > 0.0 if abs(approach[i]) > slow[i] else turn[i] > 0.0
        return active


def _one_instant(element: BaseElement, c: Array) -> LawAtOneInstant:
    """A law with its coefficients, at one instant."""
    tangent, form = as_coupled(element).tangent, element.batch_form(c)

    def by_arrays(states: list[float], tau: float) -> tuple[float, list[float]]:
        f, f_q = tangent(np.array(states)[:, None], np.array([tau]), c)
        return float(f[0]), f_q[:, 0].tolist()

    if not form.has_code:
        return by_arrays
    law, numbers = form.one_instant, form.numbers(c, element.sampling(c))

    def by_numbers(states: list[float], tau: float) -> tuple[float, list[float]]:
        try:
            return law(*states, tau, numbers)
        except (ArithmeticError, ValueError, TypeError):  # no real number, or infinite: arrays go on with that
            return by_arrays(states, tau)

    return by_numbers


def default_lengths(field: Field, motion: Array) -> Array:
    """One length (n,) per degree of freedom: the size of a motion, and of what the loads are sure to cause.

    `motion` (2n,) is a state, or the largest modulus of each component over a motion, in the user's units. The loads
    count with `|p_i| / sum_j (|K_ij| + omega |C_ij| + omega^2 |M_ij|)`, which no resonance can make large.
    """
    n, omega = field.n, field.reference
    size = np.maximum(np.abs(motion[:n]), np.abs(motion[n:]) / omega)
    loads = field.loads
    force = np.abs(loads.direction * loads.amplitude[:, None]).sum(axis=0)
    stiffness, damping, mass = (np.abs(np.diag(a)) for a in (field.stiffness, field.damping, field.mass))
    size = np.maximum(size, force / (stiffness + omega * damping + omega**2 * mass))
    weight = np.sqrt(mass)
    largest = float(np.max(size * weight))
    if largest == 0.0:  # nothing moves and nothing pushes: the gaps are the only lengths that there are
        gaps = [abs(s.gap) * float(weight @ np.abs(s.direction)) for s in field.switches if s.gap != 0.0]
        largest = max(gaps, default=1.0)
    # modes that hardly move matter by what they add to the motion of the structure
    share = 1.0 if isinstance(field.system, ProjectedSystem) else _SMALLEST_SHARE
    return np.maximum(size, share * largest / weight)


def scaled_field(system: System, state: Array, omega: float, values: Mapping[str, float] | None = None) -> Field:
    """The field with lengths from a state (2n,) and the loads; refuses a state of the wrong shape or not finite."""
    state = np.asarray(state, dtype=float)
    if state.shape != (2 * system.n,):
        raise InputError(
            f"a state of {system.n} degrees of freedom is an array of shape ({2 * system.n},): "
            f"displacements, then velocities; got shape {state.shape}"
        )
    if not np.all(np.isfinite(state)):
        raise InputError("the state has entries that are not finite")
    field = Field(system, omega, values)
    field.rescale(default_lengths(field, state))
    return field
