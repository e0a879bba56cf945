"""One evaluated motion: what harmonic balance says of it, each part computed when first needed and kept.

    R = A X + S,    S = F(X, omega) - P(omega),    dF/dX = T(f_x) + T(f_v) omega D,    F_omega = T(f_v) D X

in the notation of `equations`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from suboctave.arguments import checked
from suboctave.errors import InputError, NotFiniteError
from suboctave.harmonic.aft.channel import Channel, Group, laws_along
from suboctave.harmonic.aft.closed_form import add_laws
from suboctave.harmonic.aft.law import Along, LawAlong, LocalMotion
from suboctave.harmonic.aft.table import PackedLaws
from suboctave.harmonic.assembly import (
    Sparse,
    add_displacements,
    add_operator,
    apply_blocks,
    balance_residual,
    block_diagonal,
    evaluated,
    sizes_of,
    sparse,
    toeplitz,
)
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis, spectrum_to_real, to_complex
from suboctave.harmonic.equations import Equations, Laws
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.quadrature import SETTLED, Nodes
from suboctave.lazy import lazy

__all__ = ["BalanceState", "HarmonicBalance", "length"]


class HarmonicBalance(Equations):
    """Equations for the coefficients X of a system's periodic motion in a basis.

    Parameters
    ----------
    system
        What vibrates.
    basis
        Harmonics and period.
    values
        Parameter values, default those of the system.
    linear
        Linear part, default the system's own matrices.
    samples
        Frozen sample counts, one per element (`settle`), None where the smoothness of a law decides.

    Notes
    -----
    X has shape (2 H + 1, size), or flattened to `dimension` entries; `size` is the number of unknown DOFs of the linear
    part.
    """

    @lazy
    def completed(self) -> HarmonicBalance:
        """The same equations in the basis of 2 H + 1 harmonics, which a motion is completed in."""
        return self.with_basis(HarmonicBasis(self.top, self.basis.nu))

    @checked(result=True)
    def at(self, x: Array, omega: float, values: Mapping[str, float] | None = None) -> BalanceState:
        """Evaluate at coefficients x, frequency omega and, where given, other parameter values.

        Raises
        ------
        ConvergenceError
            If an element returns a force that is not finite.
        """
        used = self.values if values is None else values
        if len(used) < len(self.values):
            missing = [name for name in self.values if name not in used]
            raise InputError(f"values leaves out {', '.join(missing)}: give all parameters, or none for the system's")
        return self.state(self.shaped(np.asarray(x, float)), float(omega), used)

    def state(self, x: Array, omega: float, values: Mapping[str, float]) -> BalanceState:
        """The same of coefficients in their shape and all parameter values, as curves ask for it at every iteration."""
        return BalanceState(self, self.linear_at(omega, values), x, omega, values)

    def linear_at(self, omega: float, values: Mapping[str, float]) -> LinearPart:
        """The linear part at parameter values, for motions at a frequency."""
        basis, linear = self.basis, self.linear
        if values is not self.values and any(values[n] != self.values[n] for n in self.matrix_names):
            linear = linear.rebuilt(values)
        # the half-odd basis goes up to H + 1/2
        highest = (basis.harmonics + 0.5) / basis.nu * omega
        return linear if -linear.covers <= highest <= linear.covers else linear.covering(abs(highest))

    @checked(result=True)
    def settle(self, x: Array, omega: float, values: Mapping[str, float] | None = None) -> HarmonicBalance:
        """These equations with sample counts chosen for a motion and frozen from here on."""
        if self.settled:
            return self
        state = self.at(x, omega, values)
        samples: list[int | None] = [None] * len(self.samples)
        for channel in state.channels:
            for law, member in channel.members():
                samples[member.number] = law.settled_samples(member, partial(state.same_law, channel))
        return self.with_samples(tuple(samples))


@dataclass(eq=False, slots=True)
class Balanced:
    """Element forces F and residual R, (2 H + 1, size) each; the size of R, and of the forces that balance, `|A X| +
    |F| + |P|`, with residual weights: residuals are held against it.
    """

    force: Array
    residual: Array
    size: float
    scale: float


class BalanceState:
    """One evaluated motion: residual, Jacobian and derivatives, each computed when first needed."""

    def __init__(
        self, balance: HarmonicBalance, linear: LinearPart, x: Array, omega: float, values: Mapping[str, float]
    ) -> None:
        self.balance = balance
        self.basis = balance.basis
        self.linear = linear
        self.x = x
        self.omega = omega
        self.values = values
        self.rate = omega / balance.basis.nu
        #: circular frequencies of the harmonics, (H + 1,)
        self.frequencies = balance.basis.multiples * omega
        self.laws: Laws = balance.laws(values)
        #: the laws of all groups that are known in closed form, as arrays
        self.packed: PackedLaws = self.laws.packed

    @lazy
    def blocks(self) -> ComplexArray:
        """A at the harmonics, (H + 1, size, size)."""
        return self.linear.stiffness(self.frequencies)

    @lazy
    def slope(self) -> ComplexArray:
        """The same differentiated by omega."""
        slope: ComplexArray = self.basis.multiples[:, None, None] * self.linear.stiffness(self.frequencies, 1)
        return slope

    @lazy
    def recovered(self) -> ComplexArray:
        """Complex amplitudes in the linear part's equation of motion, (H + 1, N)."""
        return self.linear.recovered(self.frequencies, to_complex(self.x), self.loads_elsewhere)

    @property
    def loads_elsewhere(self) -> ComplexArray | None:
        """See `LoadSpectrum.waves`."""
        return self.balance.loads.waves({**self.values, "omega": self.omega})

    def _at_once(self) -> bool:
        """Have displacements, spectra, and what balances in one call, where all laws are known in closed form, and say
        whether they are.
        """
        balance, packed = self.balance, self.packed
        if balance.own or not packed.whole:
            return False
        known, top = self.__dict__, balance.top
        laws, load = packed.closed(self.basis.harmonics, top), balance.load(self.values, self.omega, self._loaded)
        blocks = self.linear.stiffness(self.frequencies)
        known["blocks"], known["load"] = blocks, load
        motions, table, force, residual, size, scale, finite = evaluated(
            self.x, blocks, load, balance.directions, balance.scales[1], laws, top
        )
        if not finite:
            self._all_finite(table)
        known["motions"], known["_spectra"], known["balanced"] = motions, table, Balanced(force, residual, size, scale)
        return True

    @lazy
    def motions(self) -> ComplexArray:
        """Complex coefficients of the displacement along each group's direction, (G, H + 1)."""
        if self._at_once():
            return self.motions
        return self._displacements(self.balance.directions, len(self.balance.groups))

    @lazy
    def nodes(self) -> list[Nodes]:
        """Nodes along the motion of the groups' laws in closed form that are smooth."""
        return self.packed.nodes(self.motions, self.balance.top)

    def _displacements(self, directions: Sparse, count: int) -> ComplexArray:
        out = np.zeros((count, self.basis.harmonics + 1), dtype=complex)
        add_displacements(self.x, directions, out)
        return out

    @lazy
    def _along(self) -> list[tuple[Along, list[LawAlong]]]:
        """The laws of every group along the motion."""
        balance = self.balance
        alongs = [
            Along(self.motions[g : g + 1], self.rate, self.basis.nu, group.moving, balance.top)
            for g, group in enumerate(balance.groups)
        ]
        return [
            (along, laws_along(along, members, (self.packed, self.nodes), g))
            for g, (along, members) in enumerate(zip(alongs, self.laws.groups, strict=True))
        ]

    @lazy
    def channels(self) -> list[Channel]:
        """All elements along the motion: the groups of one displacement, then those with channels of their own."""
        spectra, groups = self._spectra, zip(self.balance.groups, self._along, strict=True)
        shared = [
            Channel(group, along, laws, spectra[: 1 + along.size, g]) for g, (group, (along, laws)) in enumerate(groups)
        ]
        return shared + self.own_channels

    @lazy
    def own_channels(self) -> list[Channel]:
        """The channels of elements with several inputs, corners, or time."""
        channels = []
        for group in self.balance.own:
            motions = self._displacements(sparse(group.inputs), len(group.inputs))
            along = Along(motions, self.rate, self.basis.nu, group.moving, self.balance.top)
            members = tuple([self.laws.members[i] for i in group.members])
            channels.append(Channel(group, along, laws_along(along, members)))
        return channels

    def local(self, index: int) -> LocalMotion:
        """One of the system's elements on the motion."""
        member, group, groups = self.laws.members[index], self.balance.group_of[index], self.balance.groups
        if group in groups:
            g = groups.index(group)
            motions = self.motions[g : g + 1]
        else:
            motions = self._displacements(sparse(group.inputs), len(group.inputs))
        return LocalMotion(member.element, member.kind, member.coefficients, motions)

    @lazy
    def _spectra(self) -> ComplexArray:
        """Spectra of force, stiffness and damping along all channels, (3, C, top + 1); of elements with channels of
        their own the force alone.
        """
        if self._at_once():
            return self._spectra
        balance, packed, motions = self.balance, self.packed, self.motions
        table = np.zeros((3, len(balance.all_groups), balance.top + 1), dtype=complex)
        add_laws(motions, packed.closed(self.basis.harmonics, balance.top), table)
        if not packed.whole:
            for g, (along, laws) in enumerate(self._along):
                for law in laws:
                    if not law.whole:
                        law.add_spectra(table[: 1 + along.size, g])
        for c, channel in enumerate(self.own_channels if balance.own else (), len(balance.groups)):
            table[0, c] = channel.spectra[0]
            self._require_finite(channel.spectra, channel.group)
        # a number that is not finite at any instant is in all coefficients
        means = table[:, :, 0].ravel()
        if not cmath.isfinite(means.dot(means)):
            self._all_finite(table)
        return table

    def _all_finite(self, table: ComplexArray) -> None:
        for g, group in enumerate(self.balance.groups):
            self._require_finite(table[:, g], group)

    @property
    def force_spectra(self) -> ComplexArray:
        """Fourier coefficients 0 .. top of the force along every channel, (C, top + 1)."""
        force: ComplexArray = self._spectra[0]
        return force

    @property
    def tangent_spectra(self) -> ComplexArray:
        """Fourier coefficients of stiffness and damping along every input of every channel, (2, Q, top + 1)."""
        balance = self.balance
        shared: ComplexArray = self._spectra[1:, : len(balance.groups)]
        if not balance.own:
            return shared
        own = [channel.spectra[1:].reshape(-1, channel.count, balance.top + 1) for channel in self.own_channels]
        own = [np.concatenate((part, np.zeros((2 - len(part), *part.shape[1:])))) for part in own]
        return np.concatenate((shared, *own), axis=1)

    def _require_finite(self, spectra: ComplexArray, group: Group) -> None:
        if np.isfinite(spectra[:, 0]).all():
            return
        labels = ", ".join(self.laws.members[i].element.label for i in group.members)
        raise NotFiniteError(
            f"{labels} returned a force that is not finite at omega = {self.omega:.6g} "
            f"(largest coefficient of the motion {np.abs(self.x).max():.3g})"
        )

    @lazy
    def balanced(self) -> Balanced:
        """What balances: see `Balanced`."""
        if self._at_once():
            return self.balanced
        balance = self.balance
        force, directions, weight = self._spectra[0], balance.directions, balance.scales[1]
        return Balanced(*balance_residual(self.x, self.blocks, force, self.load, directions, weight))

    def same_law(self, channel: Channel, one: ComplexArray, other: ComplexArray) -> bool:
        """Whether two spectra of a law's force and slopes (1 + Q, top + 1) differ by what matters nowhere.

        Forces serve the residual, which is held against the forces that balance. Slopes serve Newton's method and the
        multipliers: over a period these change by `delta f_u / (m rate^2)` and `delta f_v / (m rate)`, m the mass that
        the direction shows. No law is known better than to its own rounding. A law that hardly acts may so be rounding
        itself.
        """
        weight = self.balance.scales[1]
        out, ins = length(weight * channel.out), np.linalg.norm(weight * channel.ins, axis=1)
        rates = [self.rate**2, self.rate][: 1 + channel.moving]
        weights = np.append(out, np.tile(out * ins, len(rates)))
        matters = np.append(self.balanced.scale, np.repeat(rates, len(ins)))
        change, size = np.abs(other - one).max(axis=1), np.abs(other).max(axis=1)
        return bool(np.all(weights * change <= SETTLED * (weights * size + matters)))

    @lazy
    def driven(self) -> bool:
        """Whether a load or an element sets the phase of the motion."""
        return bool(self.load[1:].any()) or self.balance.system.excited_by_elements

    @property
    def unknowns(self) -> Array:
        """Coefficients as a vector, shape (dimension,)."""
        return self.x.ravel()

    @property
    def force(self) -> Array:
        """Element forces F, shape (2 H + 1, size)."""
        return self.balanced.force

    @lazy
    def unbalanced(self) -> Array:
        """S = F - P, shape (2 H + 1, size)."""
        return self.force - self.load

    @property
    def residual(self) -> Array:
        """R, shape (dimension,)."""
        return self.balanced.residual.ravel()

    @lazy
    def force_jacobian(self) -> Array:
        """dF/dX for all harmonics up to H, square, with size (2 H + 1) rows."""
        return self._add_tangent(np.zeros((self.x.size, self.x.size)), self.blocks[:0])

    def _add_tangent(
        self, out: Array, blocks: ComplexArray, mean: bool = True, slope: ComplexArray | None = None
    ) -> Array:
        """Add the Galerkin matrix of the tangent in the integer (mean=True) or the half-odd basis, and linear blocks
        (H + 1, size, size) or none, to `out`; and to its last column what blocks of their derivative make of X.
        """
        balance, none = self.balance, blocks[:0]
        at, groups, by = balance.directions, len(balance.groups), none if slope is None else slope
        add_operator(out, self._spectra, groups, balance.any_moving, self.rate, mean, at, at, blocks, by, self.x)
        for channel in self.own_channels if balance.own else ():
            q = channel.spectra[1:].reshape(-1, channel.count, balance.top + 1)
            # one input after the other, each with the force along the same direction
            spectra = np.zeros((3, *q.shape[1:]), dtype=complex)
            spectra[1 : 1 + len(q)] = q
            outgoing = sparse(np.tile(channel.out, (channel.count, 1)))
            moving, incoming = channel.moving, sparse(channel.ins)
            add_operator(out, spectra, channel.count, moving, self.rate, mean, outgoing, incoming, none, none, self.x)
        return out

    @lazy
    def jacobian(self) -> Array:
        """R_X, shape (dimension, dimension)."""
        return self._add_tangent(np.zeros((self.x.size, self.x.size)), self.blocks)

    def low_jacobian(self, harmonics: int) -> Array:
        """R_X between the harmonics up to some alone, square, with `size (2 harmonics + 1)` rows."""
        rows = self.balance.size * (2 * harmonics + 1)
        return self._add_tangent(np.zeros((rows, rows)), self.blocks[: harmonics + 1])

    def extended_jacobian(self, name: str) -> Array:
        """`[R_X R_name]`, shape (dimension, dimension + 1); name is "omega" or a parameter."""
        m, change = self.x.size, self.unbalanced_by(name)
        out = self._add_tangent(np.zeros((m, m + 1)), self.blocks, slope=self.linear_by(name))
        if change is not None:
            out[:, -1] += change.ravel()
        return out

    @lazy
    def half_jacobian(self) -> Array:
        """J_half: the same operator in the half-odd basis up to H + 1/2; singular at a period doubling."""
        frequencies, rows = self.basis.half_multiples * self.omega, self.x.size + self.balance.size
        return self._add_tangent(np.zeros((rows, rows)), self.linear.stiffness(frequencies), mean=False)

    @property
    def linear_jacobian(self) -> Array:
        """The part of R_X that stays without elements: A on the block diagonal."""
        return block_diagonal(self.blocks, True)

    def residual_by(self, name: str) -> Array:
        """R differentiated by "omega" or a parameter, shape (dimension,)."""
        block = self.linear_by(name)
        result = np.zeros(self.x.shape) if block is None else apply_blocks(block, self.x)
        change = self.unbalanced_by(name)
        return (result if change is None else result + change).ravel()

    def linear_by(self, name: str) -> ComplexArray | None:
        """A at the harmonics differentiated by "omega" or a parameter, (H + 1, size, size); None for zero."""
        if name == "omega":
            return self.slope
        return self.linear.stiffness_by(self.frequencies, (name,)) if name in self.balance.matrix_names else None

    @lazy
    def load(self) -> Array:
        """Coefficients of the loads, shape (2 H + 1, size)."""
        return self.balance.load(self.values, self.omega, self._loaded)

    def load_by(self, *names: str) -> Array:
        """The same differentiated by "omega" or parameters, two at most."""
        values = {**self.values, "omega": self.omega}
        return self.balance.loads.value(values, self.balance.size, names, self._loaded)

    def _loaded(self, names: tuple[str, ...]) -> ComplexArray | None:
        """See `loads.Transfer`."""
        inside = tuple(name for name in names if name != "omega")
        order = len(names) - len(inside)
        if not self.balance.matrix_names.issuperset(inside):
            return None
        made = self.linear.loaded(self.frequencies, inside, order)
        return made if made is None or not order else self.basis.multiples[:, None, None] ** order * made

    def unbalanced_by(self, name: str) -> Array | None:
        """S differentiated by "omega" or a parameter at fixed X, shape (2 H + 1, size); None if zero."""
        load = None
        if name in self.balance.load_names:
            load = -self.load_by(name)
        force = self._force_by(name)
        if force is None:
            return load
        return force if load is None else force + load

    def _force_by(self, name: str) -> Array | None:
        """Element forces differentiated by "omega" or a parameter at fixed X, shape (2 H + 1, size); None if zero."""
        high = self.basis.harmonics
        total: Array | None = None
        if name == "omega":
            if self.balance.steady:
                return None
            for channel in self.channels:
                for i, d in enumerate(channel.ins if channel.moving else ()):
                    slope = toeplitz(channel.damping(i), high) @ self.basis.derivative(self.x @ d)
                    part = np.multiply.outer(slope, channel.out)
                    total = part if total is None else total + part
            return total
        for channel, change in self.changes_by(name):
            part = np.multiply.outer(spectrum_to_real(change[0], high), channel.out)
            total = part if total is None else total + part
        return total

    def changes_by(self, name: str) -> list[tuple[Channel, ComplexArray]]:
        """For every channel whose forces depend on a parameter: what that does to f and f_q, (1 + Q, top + 1)."""
        if name not in self._changes:
            self._changes[name] = self._changes_by(name)
        return self._changes[name]

    @lazy
    def _changes(self) -> dict[str, list[tuple[Channel, ComplexArray]]]:
        return {}

    def _changes_by(self, name: str) -> list[tuple[Channel, ComplexArray]]:
        rates = {}
        for i in self.balance.elements_with(name):
            rate = self.laws.members[i].element.parameter_rates(self.values, {name: 1.0})
            if rate.any():
                rates[i] = rate
        if not rates:
            return []
        return [(c, c.change(rates)) for c in self.channels if any(i in rates for i in c.group.members)]

    @lazy
    def neglected(self) -> ComplexArray:
        """Amplitudes of the harmonics H + 1 .. 2 H + 1 that the force on the motion would excite, shape (H + 1, size).

        To first order `x_k = -A(k w0)^-1 f_k`, f_k the harmonics of the element forces beyond the basis.
        """
        high, top = self.basis.harmonics, self.balance.top
        force = -2.0 * self.force_spectra.T[high + 1 :] @ self.balance.acting
        frequencies = self.rate * np.arange(high + 1.0, top + 1.0)
        response = _response(self.linear.stiffness(frequencies), force)
        if response is None:
            # an undamped vibration right at a harmonic: beside it the response is as large as numbers tell
            response = _response(self.linear.stiffness((1.0 + _ASIDE) * frequencies), force)
        return np.zeros_like(force) if response is None else response

    @property
    def squares(self) -> Array:
        """Squares of the sizes of the harmonics 0 .. 2 H + 1, with the weights of displacements (`scales`)."""
        return self._sizes[0]

    @property
    def tails(self) -> tuple[Array, float]:
        """Size of all harmonics above k relative to the motion, k = 0 .. 2 H + 1, and the motion's size."""
        return self._sizes[1:]

    @lazy
    def _sizes(self) -> tuple[Array, Array, float]:
        sizes: tuple[Array, Array, float] = sizes_of(self.x, self.neglected, self.balance.scales[0])
        return sizes

    @lazy
    def completed(self) -> BalanceState:
        """The motion together with the harmonics it neglects, in the basis of 2 H + 1 harmonics.

        It solves the equations no better within the basis, but as a function of time it lies closer to the true motion.
        """
        return BalanceState(self.balance.completed, self.linear, self.completed_x[1], self.omega, self.values)

    @lazy
    def completed_x(self) -> tuple[HarmonicBasis, Array]:
        """The basis of 2 H + 1 harmonics, and the coefficients of the completed motion in it."""
        basis = HarmonicBasis(self.balance.top, self.basis.nu)
        x = self.basis.resized(self.x, basis)
        x[self.basis.size :: 2] = self.neglected.real
        x[self.basis.size + 1 :: 2] = -self.neglected.imag
        return basis, x


#: how far beside an undamped resonance its response is taken, as a share of the frequency: a root of what rounding is
_ASIDE = 1e-8


def _response(blocks: ComplexArray, force: ComplexArray) -> ComplexArray | None:
    """A^-1 f for matrices (F, n, n) and forces (F, n); None where one is singular."""
    if blocks.shape[-1] == 1:
        return None if 0.0 in blocks else force / blocks[:, :, 0]
    try:
        return np.asarray(np.linalg.solve(blocks, force[:, :, None])[:, :, 0], dtype=complex)
    except np.linalg.LinAlgError:
        return None


def length(vector: Array) -> float:
    """Euclidean norm of all entries."""
    flat = vector if vector.ndim == 1 else vector.ravel()
    return math.sqrt(flat.dot(flat))
