"""What is fixed of harmonic balance along a curve: channels of the elements, laws at parameter values, loads, weights.

    R(X, omega, parameters) = A X + S,    S = F(X, omega) - P(omega),

with A from the linear part (the dynamic stiffness Z where all DOFs are unknown), F the Fourier coefficients of the
element forces (Galerkin projection) and P those of the loads. `evaluation` evaluates them at a motion. Method:
Cameron & Griffin, J. Appl. Mech. 56 (1989) 149-154 (alternating frequency/time).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TypeVar

import numpy as np

from suboctave.arguments import checked
from suboctave.errors import InputError
from suboctave.harmonic.aft.channel import Group
from suboctave.harmonic.aft.law import Member
from suboctave.harmonic.aft.table import PackedLaws
from suboctave.harmonic.assembly import Sparse, sparse
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.loads import LoadSpectrum, Transfer
from suboctave.harmonic.quadrature import search_grid
from suboctave.lazy import lazy
from suboctave.model.elements.coupled import CoupledElement
from suboctave.model.elements.smoothness import AdaptiveSampling, CornerSampling, Sampling, levels
from suboctave.model.system import System

_Same = TypeVar("_Same", bound="Equations")


class Laws:
    """The laws of all elements at parameter values: one by one, and those of every group of one displacement."""

    def __init__(self, members: list[Member], groups: list[Group], like: Laws | None = None) -> None:
        self.members = members
        self.groups = [[members[i] for i in group.members] for group in groups]
        #: laws of the same kinds with other coefficients
        self._like = like

    @lazy
    def packed(self) -> PackedLaws:
        """The groups' laws that are known in closed form, as arrays."""
        like, self._like = self._like, None
        return PackedLaws(self.groups) if like is None else like.packed.moved(self.groups)

    @lazy
    def levels(self) -> list[list[tuple[int, int, float]]]:
        """Displacements at which a law has a corner, or is sharp, group by group: element, which of its own,
        displacement.
        """
        return [
            [(m.number, place, at) for m in group for place, at in enumerate(levels(m.kind, m.coefficients))]
            for group in self.groups
        ]


@lru_cache(maxsize=32)
def _groups_of(system: System, linear: LinearPart) -> tuple[list[Group], list[Group]]:
    """Elements that share the displacement along one direction, and those with channels of their own: the same for all
    equations of a structure, as what depends on them and the linear part alone is kept.
    """
    alike: dict[bytes, tuple[Array, list[int]]] = {}
    own = []
    for i, element in enumerate(system.elements):
        out = np.asarray(linear.retain(element.direction(system.n)), dtype=float)
        if element.own_nodes:
            inputs = np.array([linear.retain(d) for d in element.inputs(system.n)], dtype=float)
            own.append(Group(out, inputs, (i,), element.depends_on_velocity))
        else:
            alike.setdefault(out.tobytes(), (out, []))[1].append(i)
    shared = [
        Group(d, d[None], tuple(members), any(system.elements[i].depends_on_velocity for i in members))
        for d, members in alike.values()
    ]
    return shared, own


@checked(result=True, methods=False)
class Equations:
    """Harmonic balance of a system in a basis, without a motion; parameters as in `evaluation.HarmonicBalance`."""

    def __init__(
        self,
        system: System,
        basis: HarmonicBasis,
        values: Mapping[str, float] | None = None,
        linear: LinearPart | None = None,
        samples: tuple[int | None, ...] | None = None,
    ) -> None:
        if samples is not None and len(samples) != len(system.elements):
            raise InputError(f"samples must be {len(system.elements)} counts, one for each element, not {len(samples)}")
        self.system = system
        self.values: Mapping[str, float] = dict(system.parameters if values is None else values)
        self.linear: LinearPart = StructuralMatrices(system, self.values) if linear is None else linear
        self.size = self.linear.size
        #: parameters that the linear part depends on
        self.matrix_names = frozenset[str]().union(*(matrix.names for matrix in system.linear_parts))
        #: elements that share the displacement along one direction, and those with channels of their own
        self.groups, self.own = _groups_of(system, self.linear)
        self.all_groups = (*self.groups, *self.own)
        #: whether any force depends on velocity
        self.any_moving = any(group.moving for group in self.groups)
        components = system.load_components()
        self._load_shapes = [
            self.linear.retain(c.direction) if self.linear.holds(c.direction) else None for c in components
        ]
        #: what loads depend on, or what they do to the unknowns
        self.load_names = {n for c in components for n in c.amplitude.names | c.phase.names}
        self._load_order = sorted(self.load_names)
        elsewhere = [c.direction for c, shape in zip(components, self._load_shapes, strict=True) if shape is None]
        if elsewhere:
            self.load_names |= {"omega", *self.matrix_names}
            if not np.array_equal(elsewhere, self.linear.loads):
                raise InputError(
                    "the linear part was made for other loads than this system has: make it with "
                    "so.condense(system, ...) of this system"
                )
        #: names that every element's coefficients depend on
        self._names = [tuple(sorted({n for c in e.coefficients for n in c.names})) for e in system.elements]
        self._all_names = sorted({name for names in self._names for name in names})
        #: of every element: values of its names, and what it is there; of all elements: the same
        self._members: dict[int, tuple[tuple[float, ...], Member]] = {}
        #: displacements of degrees of freedom by the unknown ones
        self._along: dict[int, Array] = {}
        #: the laws at the equations' own values (True), and at the last others, with the values of their names
        self._laws: dict[bool, tuple[tuple[float, ...] | None, Laws]] = {}
        self._write_in(basis, (None,) * len(system.elements) if samples is None else samples)

    def _write_in(self, basis: HarmonicBasis, samples: tuple[int | None, ...]) -> None:
        """What depends on the basis and the samples."""
        self.basis = basis
        self.samples = samples
        self.dimension = self.size * basis.size
        #: highest Fourier coefficient of the tangent that the integer and the half-odd basis need
        self.top = 2 * basis.harmonics + 1
        self.loads = LoadSpectrum(self.system, basis, self._load_shapes)
        self._load: tuple[tuple[float, ...], Array] | None = None
        self._row_weights: dict[int, Array] = {}

    def along(self, dof: int) -> Array:
        """The displacement of a degree of freedom by those unknown, (size,); InputError where they do not hold it."""
        if dof not in self._along:
            unit = np.zeros(self.system.n)
            unit[dof] = 1.0
            self._along[dof] = self.linear.retain(unit)
        return self._along[dof]

    @lazy
    def group_of(self) -> dict[int, Group]:
        """The group of every element, by its number."""
        return {member: group for group in self.all_groups for member in group.members}

    @lazy
    def directions(self) -> Sparse:
        """Where the forces of all channels act, as the kernels want it."""
        return sparse(self.acting)

    @lazy
    def acting(self) -> Array:
        """Where the forces of all channels act, (C, size)."""
        return np.array([group.direction for group in self.all_groups]).reshape(-1, self.size)

    @lazy
    def steady(self) -> bool:
        """Whether the forces of the elements do not depend on omega at fixed X."""
        return not (self.any_moving or self.own)

    @checked(result=True)
    def with_samples(self: _Same, samples: tuple[int | None, ...]) -> _Same:
        """The same equations with other frozen sample counts."""
        return self if samples == self.samples else self._like(self.basis, samples)

    @checked(result=True)
    def with_basis(self: _Same, basis: HarmonicBasis) -> _Same:
        """The same equations in another basis."""
        return self if basis == self.basis else self._like(basis, self.samples)

    def _like(self: _Same, basis: HarmonicBasis, samples: tuple[int | None, ...]) -> _Same:
        # the same mapping of values too: so a motion's values are known to be its own, with what the laws are there
        _ = self.scales, self.highest_load, self.directions
        other = type(self).__new__(type(self))
        for name, value in vars(self).items():
            if name not in _OF_BASIS:
                setattr(other, name, value)
        if samples != self.samples:
            other._members, other._laws = {}, {}
        other._write_in(basis, samples)
        return other

    def shaped(self, vector: Array) -> Array:
        """A vector of the equations' dimension as coefficients, shape (2 H + 1, size)."""
        try:
            return vector.reshape(self.basis.size, self.size)
        except ValueError:
            raise InputError(
                f"x must be coefficients of shape {(self.basis.size, self.size)}, not {vector.shape}"
            ) from None

    def per_unknown(self, scale: Array) -> Array:
        """A factor per DOF, (size,), for every unknown, shape (dimension,)."""
        return np.tile(scale, self.basis.size)

    def laws(self, values: Mapping[str, float]) -> Laws:
        """The laws of all elements at parameter values; those of the equations' own values, and the last others, are
        kept.
        """
        own = values is self.values
        key = None if own else tuple([values[name] for name in self._all_names])
        if own in self._laws and self._laws[own][0] == key:
            return self._laws[own][1]
        members: list[Member] = []
        like = self._laws[False][1] if False in self._laws else None
        for i, element in enumerate(self.system.elements):
            at = tuple([values[name] for name in self._names[i]])
            if i not in self._members or self._members[i][0] != at:
                c = element.coefficient_values(values)
                self._members[i] = at, Member(i, element, element.sampling(c), c, self.samples[i])
            member = self._members[i][1]
            members += (member,)
            like = None if like is None or like.members[i].kind is not member.kind else like
        self._laws[own] = key, Laws(members, self.groups, like)
        return self._laws[own][1]

    @lazy
    def settled(self) -> bool:
        """True if no element needs a number of samples."""
        kinds: list[Sampling] = [member.kind for member in self.laws(self.values).members]
        blind = AdaptiveSampling | CornerSampling
        return all(s is None for s in self.samples) and not any(isinstance(kind, blind) for kind in kinds)

    @lazy
    def highest_load(self) -> int:
        """Highest harmonic of omega that is loaded, or that an element depends on; 0 without."""
        times = [e.time_harmonic for e in self.system.elements if isinstance(e, CoupledElement)]
        return max([c.harmonic for c in self.system.load_components()] + times, default=0)

    def load(self, values: Mapping[str, float], omega: float, transfer: Transfer) -> Array:
        """Load coefficients P, shape (2 H + 1, size); transfer: see `loads.Transfer`."""
        if self.loads.elsewhere:
            return self.loads.value({**values, "omega": omega}, self.size, (), transfer)
        if values is self.values and "omega" not in self.load_names:
            return self._own_load
        key = tuple([omega if n == "omega" else values[n] for n in self._load_order])
        if self._load is None or self._load[0] != key:
            self._load = (key, self.loads.value({**values, "omega": omega}, self.size))
        return self._load[1]

    @lazy
    def _own_load(self) -> Array:
        return self.loads.value(self.values, self.size)

    def elements_with(self, name: str) -> tuple[int, ...]:
        """The elements that have a parameter in a coefficient."""
        return tuple(i for i, names in enumerate(self._names) if name in names)

    @lazy
    def grid(self) -> Array:
        """Points on the circle for searches along a motion: cosines and sines, (2, N)."""
        nodes = search_grid(self.basis.harmonics)
        return np.array((nodes.zr, nodes.zi))

    @lazy
    def scales(self) -> tuple[Array, Array]:
        """Weights of a coefficient of displacement and of a residual entry per DOF, `sqrt(m_i)` and its inverse.

        `m_i` is the mass that a DOF shows to a sudden force, `1 / (M^-1)_ii`. The weights make norms independent of
        the units of single DOFs. Shape (size,) each.
        """
        mass = self.linear.equation_of_motion()[0]
        shapes = np.array([self.linear.expand(unit) for unit in np.eye(self.size)])
        mobility = np.einsum("ij,ji->i", shapes, np.linalg.solve(mass, shapes.T))
        if not np.all(mobility > 0.0):
            raise InputError("every unknown DOF needs a mass behind it")
        weight = 1.0 / np.sqrt(mobility)
        return weight, 1.0 / weight

    def row_weights(self, rows: int) -> Array:
        """The weights of residual entries (`scales`) for as many rows of an operator."""
        weights = self._row_weights.get(rows)
        if weights is None:
            weights = self._row_weights[rows] = np.tile(self.scales[1], rows // self.size)
        return weights

    def logarithm_of_masses(self, rows: int) -> float:
        """Sum of the logarithms of `sqrt(m_i)` (`scales`) over as many rows of an operator."""
        return rows // self.size * float(np.log(self.scales[0]).sum())

    @lazy
    def column_weights(self) -> Array:
        """The weights of displacements (`scales`) for all coefficients, shape (dimension,)."""
        return self.per_unknown(self.scales[0])


#: what a basis and samples have their own of
_OF_BASIS = frozenset({"_own_load", "settled", "grid", "column_weights", "completed"})
