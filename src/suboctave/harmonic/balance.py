"""Harmonic balance: the algebraic equations of a periodic motion, their Jacobian and parameter derivatives.

    R(X, omega, parameters) = A X + B S,    S = F(X, omega) - P(omega),

with A, B from the linear part (stiffness form: A = Z, B = I, so that `R = Z X + F - P`), F the Fourier coefficients
of the element forces (Galerkin projection) and P those of the loads. With `T(g)` the Galerkin matrix of a periodic
g(t),

    dF/dX = T(f_x) + T(f_v) omega D,    F_omega = T(f_v) D X.

`HarmonicBalance` holds what is fixed along a curve, `state.BalanceState` is one evaluated motion. Method: Cameron &
Griffin, J. Appl. Mech. 56 (1989) 149-154 (alternating frequency/time); the closed-form integrals are derived in
`local_force`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import InputError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.changing_laws import ChangingLaws
from suboctave.harmonic.group_force import Group, GroupLaw, PackedLaws
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.loads import LoadSpectrum
from suboctave.harmonic.nodal import own_elements
from suboctave.harmonic.quadrature import on_circle, samples_for, search_count
from suboctave.harmonic.rates import coefficient_rates
from suboctave.harmonic.state import BalanceState
from suboctave.lazy import lazy
from suboctave.model.element import Element
from suboctave.model.sampling import AdaptiveSampling, CornerSampling, Sampling
from suboctave.model.system import System

#: what the same equations in another basis share
_IN_ANY_BASIS = (
    *("system", "values", "linear", "size", "matrix_names", "elements", "own", "groups", "directions", "moving"),
    *("any_moving", "load_names", "steady", "_coefficient_names", "_load_shapes", "_load_order"),
    *("_own_coefficients", "_scales", "highest_load", "_laws", "_names", "_changing", "_mass_logarithm"),
)


class HarmonicBalance:
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
        Frozen sample counts, one per element (`settle`), None where the element knows its rule.

    Notes
    -----
    X has shape (2 H + 1, size), or flattened; `size` is the number of unknown DOFs of the linear part. Where the basis
    leaves harmonics out, X is zero there, and the `dimension` equations are those of the harmonics that are kept.
    """

    def __init__(
        self,
        system: System,
        basis: HarmonicBasis,
        values: Mapping[str, float] | None = None,
        linear: LinearPart | None = None,
        samples: tuple[int | None, ...] | None = None,
    ) -> None:
        self.system = system
        self.values = dict(system.parameters if values is None else values)
        self.linear: LinearPart = StructuralMatrices(system, self.values) if linear is None else linear
        self.size = self.linear.size
        self._coefficient_names = sorted({n for e in system.elements for c in e.coefficients for n in c.names})
        #: parameters that the linear part depends on
        self.matrix_names = system.mass.names | system.damping.names | system.stiffness.names
        #: the elements that are evaluated direction by direction, and those with nodes of their own
        self.elements: tuple[Element, ...] = tuple(
            e for e in system.elements if isinstance(e, Element) and not e.own_nodes
        )
        self.own = own_elements(system, self.linear)
        self.groups = self._grouped()
        #: the groups' directions, packed: where each begins, its DOFs, its entries there
        self.directions = (
            np.cumsum([0] + [len(g.dofs) for g in self.groups]),
            np.concatenate([np.zeros(0, dtype=np.int64)] + [g.dofs for g in self.groups]),
            np.concatenate([np.zeros(0)] + [g.values for g in self.groups]),
        )
        #: whether a group's force depends on velocity
        self.moving = np.array(
            [any(system.elements[i].depends_on_velocity for i in g.members) for g in self.groups], dtype=bool
        )
        self.any_moving = bool(self.moving.any())
        self._load_shapes = [self.linear.retain(c.direction) for c in system.load_components()]
        self.load_names = {n for c in system.load_components() for n in c.amplitude.names | c.phase.names}
        self._load_order = sorted(self.load_names)
        #: whether the unbalanced force depends on omega through the motion's frequency alone, and not at fixed X
        self.steady = not (self.any_moving or self.own or "omega" in self.load_names)
        #: of every element: values of its names, its coefficients there, and what it tells of its law
        self._laws: dict[int, tuple[tuple[float, ...], Array, Sampling]] = {}
        self._changing: dict[str, list[tuple[int, dict[int, Array | None]]]] = {}
        self._written_in(basis, samples if samples is not None else (None,) * len(system.elements))

    def _written_in(self, basis: HarmonicBasis, samples: tuple[int | None, ...]) -> None:
        """What depends on the basis and the samples."""
        self.basis = basis
        self.samples = samples
        self.dimension = self.size * basis.count
        self.loads = LoadSpectrum(self.system, basis, self._load_shapes)
        self._load_cache: tuple[tuple, Array] | None = None
        self._load_rates: dict[str, Array | None] = {}
        self._laws_along: dict[str, ChangingLaws | None] = {}
        self._coefficients: (
            tuple[Mapping[str, float], tuple, tuple[list[Array], list[Sampling], list[GroupLaw]]] | None
        ) = None
        self._packed: tuple[list[GroupLaw], tuple[PackedLaws, Array]] | None = None
        self._row_weights: dict[int, Array] = {}
        #: highest Fourier coefficient of the tangent that the integer and the half-odd basis need
        self.top = 2 * basis.harmonics + 1

    def _grouped(self) -> list[Group]:
        found: dict[bytes, tuple[Array, list[int]]] = {}
        for i, element in enumerate(self.elements):
            d = np.asarray(self.linear.retain(element.direction(self.system.n)), dtype=float)
            found.setdefault(d.tobytes(), (d, []))[1].append(i)
        groups = []
        for d, members in found.values():
            dofs = np.flatnonzero(d)
            groups.append(Group(d, dofs, d[dofs].copy(), tuple(members)))
        return groups

    def with_samples(self, samples: tuple[int | None, ...]) -> HarmonicBalance:
        """The same equations with other frozen sample counts."""
        return self if samples == self.samples else self._like(self.basis, samples)

    def with_basis(self, basis: HarmonicBasis) -> HarmonicBalance:
        """The same equations in another basis."""
        return self if basis == self.basis else self._like(basis, self.samples)

    def _like(self, basis: HarmonicBasis, samples: tuple[int | None, ...]) -> HarmonicBalance:
        # the same mapping of values too: so a motion's values are known to be its own, with what the laws are there
        _ = self._own_coefficients, self._scales, self.highest_load, self._mass_logarithm
        other = HarmonicBalance.__new__(HarmonicBalance)
        other.__dict__.update({name: self.__dict__[name] for name in _IN_ANY_BASIS})
        other._written_in(basis, samples)
        return other

    @lazy
    def completed(self) -> HarmonicBalance:
        """The same equations in the basis of 2 H + 1 harmonics, which a motion is completed in."""
        return self.with_basis(HarmonicBasis(self.top, self.basis.nu))

    def at(self, x: Array, omega: float, values: Mapping[str, float] | None = None) -> BalanceState:
        """Evaluate at coefficients x, frequency omega and, where given, other parameter values.

        Raises
        ------
        ConvergenceError
            If an element returns a force that is not finite.
        """
        used = self.values if values is None else values
        linear = self.linear
        if used is not self.values and any(used[n] != self.values[n] for n in self.matrix_names):
            linear = self.linear.rebuilt(used)
        return BalanceState(self, linear, self.spread(np.asarray(x, float)), float(omega), used)

    def packed(self, x: Array) -> Array:
        """Coefficients or their equations (2 H + 1, size) as those of the kept harmonics, shape (dimension,)."""
        rows = self.basis.rows
        return x.ravel() if rows is None else x[rows].ravel()

    def spread(self, vector: Array) -> Array:
        """The reverse of `packed`, shape (2 H + 1, size); what has that many entries already stays as it is."""
        rows = self.basis.rows
        if rows is None or vector.size != self.dimension:
            return vector.reshape(self.basis.size, self.size)
        out = np.zeros((self.basis.size, self.size), dtype=vector.dtype)
        out[rows] = vector.reshape(-1, self.size)
        return out

    def per_unknown(self, scale: Array) -> Array:
        """A factor per DOF, (size,), for every unknown, shape (dimension,)."""
        return np.tile(scale, self.basis.count)

    @lazy
    def entries(self) -> NDArray[np.intp] | None:
        """Which of the `size (2 H + 1)` coefficients are unknowns; None for all."""
        rows = self.basis.rows
        return None if rows is None else (rows[:, None] * self.size + np.arange(self.size)).ravel()

    def settle(self, x: Array, omega: float, values: Mapping[str, float] | None = None) -> HarmonicBalance:
        """These equations with sample counts chosen for a motion and frozen from here on."""
        if self.settled:
            return self
        state = self.at(x, omega, values)
        samples = tuple(
            samples_for(local.element, local.motion, local.rate, local.coefficients, self.top)
            for local in state.local_motions
        )
        return self.with_samples(samples + tuple(force.settled() for force in state.nodal))

    @lazy
    def settled(self) -> bool:
        """True if no element needs a number of samples."""
        kinds = self.coefficients(self.values)[1]
        blind = AdaptiveSampling | CornerSampling
        return all(s is None for s in self.samples) and not any(isinstance(kind, blind) for kind in kinds)

    @lazy
    def highest_load(self) -> int:
        """Highest harmonic of omega that is loaded, or that an element depends on; 0 without."""
        times = [own.harmonic for own in self.own]
        return max([c.harmonic for c in self.system.load_components()] + times, default=0)

    def load(self, values: Mapping[str, float], omega: float) -> Array:
        """Load coefficients P, shape (2 H + 1, size)."""
        if values is self.values and "omega" not in self.load_names:
            return self._own_load
        key = tuple([omega if n == "omega" else values[n] for n in self._load_order])
        if self._load_cache is None or self._load_cache[0] != key:
            self._load_cache = (key, self.loads.value({**values, "omega": omega}, self.size))
        return self._load_cache[1]

    def load_rate(self, name: str) -> Array | None:
        """P differentiated by a parameter, shape (2 H + 1, size), None if it depends on parameters or omega."""
        if name not in self._load_rates:
            self._load_rates[name] = self.loads.constant_rate(name, self.size)
        return self._load_rates[name]

    def coefficients(self, values: Mapping[str, float]) -> tuple[list[Array], list[Sampling], list[GroupLaw]]:
        """Coefficient values of every element, what it tells of its law at them, and that sorted by groups."""
        if values is self.values:
            return self._own_coefficients
        known = self._coefficients
        if known is not None and known[0] is values:
            return known[2]
        key = tuple([values[name] for name in self._coefficient_names])
        found = known[2] if known is not None and known[1] == key else self._sorted_coefficients(values)
        self._coefficients = (values, key, found)
        return found

    def _sorted_coefficients(self, values: Mapping[str, float]) -> tuple[list[Array], list[Sampling], list[GroupLaw]]:
        numbers, kinds = [], []
        for i, names in enumerate(self._names):
            known = self._laws.get(i)
            key = tuple([values[name] for name in names])
            if known is None or known[0] != key:
                element = self.system.elements[i]
                own = element.coefficient_values(values)
                known = self._laws[i] = key, own, element.sampling(own)
            numbers.append(known[1])
            kinds.append(known[2])
        return numbers, kinds, [GroupLaw.of(group, numbers, kinds) for group in self.groups]

    @lazy
    def _names(self) -> list[tuple[str, ...]]:
        """The names that every element's coefficients depend on."""
        return [tuple(sorted({n for c in e.coefficients for n in c.names})) for e in self.system.elements]

    def packed_laws(self, values: Mapping[str, float]) -> tuple[PackedLaws, Array]:
        """The groups' laws at parameter values, as arrays, and points on the circle for their polynomials, (2, N)."""
        laws = self.coefficients(values)[2]
        if self._packed is None or self._packed[0] is not laws:
            found = PackedLaws.of(laws)
            self._packed = (laws, (found, found.nodes(self.basis.harmonics, self.top)))
        return self._packed[1]

    def remember(self, i: int, values: Mapping[str, float], numbers: Array, kind: Sampling) -> None:
        """Keep what an element has told at parameter values, lest it be asked again there."""
        self._laws[i] = tuple([values[name] for name in self._names[i]]), numbers, kind

    def laws_along(self, name: str) -> ChangingLaws | None:
        """The laws as a parameter changes, None where they are not packed with what it does to them."""
        if name not in self._laws_along:
            self._laws_along[name] = ChangingLaws.of(self, name)
        return self._laws_along[name]

    def changing(self, name: str) -> list[tuple[int, dict[int, Array | None]]]:
        """The directions along which a parameter changes forces, with the elements that have it in a coefficient; their
        rates with it where these are constant and not all zero.
        """
        if name not in self._changing:
            touched = [
                (g, {i: _constant_rates(self.elements[i], name) for i in group.members if self._has(i, name)})
                for g, group in enumerate(self.groups)
            ]
            self._changing[name] = [(g, members) for g, members in touched if members]
        return self._changing[name]

    def _has(self, i: int, name: str) -> bool:
        return any(name in c.names for c in self.elements[i].coefficients)

    @lazy
    def grid(self) -> Array:
        """Points on the circle for searches along a motion: cosines and sines, (2, N)."""
        return on_circle(search_count(self.basis.harmonics))

    @lazy
    def _own_coefficients(self) -> tuple[list[Array], list[Sampling], list[GroupLaw]]:
        return self._sorted_coefficients(self.values)

    @lazy
    def _own_load(self) -> Array:
        return self.loads.value(self.values, self.size)

    @lazy
    def _scales(self) -> tuple[Array, Array]:
        mass = self.linear.equation_of_motion()[0]
        shapes = np.array([self.linear.expand(unit) for unit in np.eye(self.size)])
        mobility = np.einsum("ij,ji->i", shapes, np.linalg.solve(mass, shapes.T))
        if not np.all(mobility > 0.0):
            raise InputError("every unknown DOF needs a mass behind it")
        weight = 1.0 / np.sqrt(mobility)
        return weight, 1.0 / weight

    def row_weights(self, rows: int) -> Array:
        """The weights of residual entries (`scales`) for as many rows of an operator."""
        found = self._row_weights.get(rows)
        if found is None:
            found = self._row_weights[rows] = np.tile(self.scales()[1], rows // self.size)
        return found

    def logarithm_of_masses(self, rows: int) -> float:
        """Sum of the logarithms of `sqrt(m_i)` (`scales`) over as many rows of an operator."""
        return rows // self.size * self._mass_logarithm

    @lazy
    def _mass_logarithm(self) -> float:
        return float(np.log(self.scales()[0]).sum())

    @lazy
    def column_weights(self) -> Array:
        """The weights of displacements (`scales`) for all coefficients, shape (dimension,)."""
        return self.per_unknown(self.scales()[0])

    @lazy
    def beyond(self) -> Array:
        """The harmonics H + 1 .. 2 H + 1 in units of omega, shape (H + 1,)."""
        return np.arange(self.basis.harmonics + 1, self.top + 1) / self.basis.nu

    def scales(self) -> tuple[Array, Array]:
        """Weights of a coefficient of displacement and of a residual entry per DOF, `sqrt(m_i)` and its inverse.

        `m_i` is the mass that a DOF shows to a sudden force, `1 / (M^-1)_ii`. The weights make norms independent of
        the units of single DOFs. Shape (size,) each.
        """
        return self._scales


def _constant_rates(element: Element, name: str) -> Array | None:
    """Rates of an element's coefficients with a parameter, if no parameter changes them, and some are not zero."""
    if not all(c.derivative(name).constant for c in element.coefficients):
        return None
    rates = coefficient_rates(element, {}, {name: 1.0})
    return rates if rates.any() else None
