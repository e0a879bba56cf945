"""A finite-element model: mass, stiffness and damping with labelled degrees of freedom, `M x'' + C x' + K x = p(t)`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from os import PathLike
from typing import Annotated, Any

import numpy as np

from suboctave.arguments import Matrix, Rule, Title, array_like, checked
from suboctave.errors import InputError, located, path_of, printable, shortened
from suboctave.model.elements.base import Array, BaseElement
from suboctave.model.expressions.coefficients import Coefficient, named_coefficient
from suboctave.model.frequencies import NaturalFrequencies, natural_frequencies
from suboctave.model.loads import Load
from suboctave.model.system import System
from suboctave.model.updated import part_of
from suboctave.structures.checks import inertia_checked, square_matrix, symmetric_matrix
from suboctave.structures.damping import ModalDamping, Rayleigh, written_out
from suboctave.structures.dof_map import DofMap, GivenDofs, GivenName, shown_dofs, weighted
from suboctave.structures.mesh import Mesh
from suboctave.structures.numpy_files import write

_FORMS = str, PathLike, Coefficient, Rayleigh, ModalDamping, type(None)
#: a matrix, or what stands for one: a loss factor, `Rayleigh`, the name of a file
MatrixOrForm = Annotated[
    Any, Rule("a matrix or what stands for one", lambda given: isinstance(given, _FORMS) or array_like(given))
]


@checked
@dataclass(frozen=True, eq=False, repr=False)
class Structure:
    """Matrices of a structure with what its degrees of freedom are called. Immutable.

    mass, stiffness
        Symmetric (n, n), sparse or dense, finite; kept in SciPy's compressed-row form. DOFs without inertia are kept
        (`massless`), and have to be fixed before the structure vibrates.
    damping
        A matrix (n, n), or `Rayleigh`, or `ModalDamping`; none by default.
    structural
        Structural (hysteretic) damping: a loss factor eta, a number or an expression in parameters, for `eta` times
        the stiffness; or a matrix (n, n), such as Nastran's K4 or the imaginary part of a complex stiffness.
    dofs
        A `DofMap`, or n pairs (node, direction); without one, degrees of freedom are numbers from 0.
    mesh
        For pictures.

    Units are the user's own, if they are consistent (N, mm, t, s; or N, m, kg, s): `natural_frequencies` shows whether
    they are. Raises `InputError` for matrices that are no such, of other sizes, asymmetric, and for maps of another
    length.
    """

    mass: Matrix
    stiffness: Matrix
    damping: MatrixOrForm = None
    dofs: GivenDofs = None
    mesh: Mesh | None = None
    name: Title = ""
    structural: MatrixOrForm = None

    def __post_init__(self) -> None:
        labels: Any = self.dofs
        if labels is not None and not isinstance(labels, DofMap):
            with located("dofs"):
                labels = DofMap(labels)
        mass = square_matrix(self.mass, "mass")
        n = mass.shape[0]
        if labels is not None and len(labels) != n:
            raise InputError(f"the DOF map has {len(labels)} labels, the matrices {n} DOFs", ("dofs",))
        damping = self.damping
        if not isinstance(damping, Rayleigh | ModalDamping | None):
            damping = square_matrix(damping, "damping", n)
        if self.mesh is not None and not isinstance(self.mesh, Mesh):
            raise InputError(f"mesh must be a Mesh, not {shortened(self.mesh)}", ("mesh",))
        stiffness = symmetric_matrix(square_matrix(self.stiffness, "stiffness", n), "stiffness", labels)
        mass = inertia_checked(symmetric_matrix(mass, "mass", labels), labels)
        structural = self.structural
        if structural is not None and np.ndim(structural) == 0 and not hasattr(structural, "tocsr"):
            structural = named_coefficient(structural, "Structure", "structural")
        elif structural is not None:
            structural = symmetric_matrix(square_matrix(structural, "structural", n), "structural", labels)
        read = {
            "mass": mass,
            "stiffness": stiffness,
            "damping": damping,
            "dofs": labels,
            "name": printable(str(self.name)),
        }
        read["structural"] = structural
        for field, value in read.items():
            object.__setattr__(self, field, value)

    # ---------------------------------------------------------------------------------------------------------- places
    @property
    def n(self) -> int:
        """How many degrees of freedom there are."""
        return int(self.mass.shape[0])

    @property
    def massless(self) -> tuple[int, ...]:
        """The degrees of freedom without inertia: rotations of solid elements, multipliers of constraints."""
        return tuple(np.flatnonzero(self.mass.diagonal() == 0.0).tolist())

    def dof(self, node: GivenName, direction: GivenName | None = None) -> int:
        """The number, from 0, of the degree of freedom of a node in a direction: an element's `dof`.

        `node`: 1042, "1042", "node 1042"; or a text of both, "1042 z". `direction`: x, y, z, rx, ry, rz in any case, or
        a number from 1 to 6. Raises `InputError` with what there is near it, and for fixed degrees of freedom.
        """
        return self._labels().index(node, direction)

    def direction(self, weights: Mapping[Any, float] | str) -> Array:
        """The vector (n,) of a weighted sum of displacements, `{(node, direction): weight}`, for `direction=`.

        A direction alone stands for all DOFs in it: `direction("x")` is the translation along x, `{"z": -1.0}` upside
        down along z.
        """
        return weighted(self._labels(), weights)

    def _labels(self) -> DofMap:
        if self.dofs is None:
            raise InputError(
                f"this structure has no DOF map: its DOFs are the numbers 0 to {self.n - 1}; give dofs= to name them"
            )
        return self.dofs

    def fixed(self, dofs: Iterable[Any]) -> Structure:
        """The structure with some degrees of freedom held: their rows and columns go.

        `dofs`: numbers from 0, pairs (node, direction), texts like "1042 z", "node 1042" for all of a node, or "z" for
        all in a direction. Raises `InputError` for what is none.
        """
        if isinstance(dofs, str | Integral) or not isinstance(dofs, Iterable):
            raise InputError(f"fixed takes a list of DOFs, not {shortened(dofs)}")
        gone = sorted({place for item in dofs for place in self._places(item)})
        kept = np.setdiff1d(np.arange(self.n), gone)
        if not len(kept):
            raise InputError("all DOFs would be fixed: nothing is left that moves")
        cut = {what: getattr(self, what)[kept][:, kept] for what in ("mass", "stiffness")}
        if not isinstance(self.damping, Rayleigh | ModalDamping | None):
            cut["damping"] = part_of(self.damping, kept)
        if not isinstance(self.structural, Coefficient | None):
            cut["structural"] = self.structural[kept][:, kept]
        return replace(self, **cut, dofs=None if self.dofs is None else self.dofs.without(gone))

    def _places(self, item: Any) -> Sequence[int]:
        if isinstance(item, Integral) and item is not True and item is not False:
            place = int(item)
            if not 0 <= place < self.n:
                raise InputError(f"there is no DOF {place}: they are numbered 0 to {self.n - 1}")
            return [place]
        if isinstance(item, Sequence) and not isinstance(item, str) and len(item) == 2:
            return [self.dof(*item)]
        of_node = self._labels().of_node(item) if isinstance(item, str) else ()
        return of_node or self._labels().places(item)

    # --------------------------------------------------------------------------------------------------------- motion
    def with_damping(self, damping: MatrixOrForm) -> Structure:
        """The structure with another damping: a matrix (n, n), `Rayleigh`, `ModalDamping`, or None."""
        return replace(self, damping=damping)

    def natural_frequencies(self, count: int = 10) -> NaturalFrequencies:
        """The lowest `count` natural frequencies, with damping ratios and modes; rigid-body modes are counted.

        Printed, they are a table in radians per unit time and in hertz: frequencies 10^1.5 or 10^3 off show units that
        do not fit each other. Degrees of freedom without mass follow the others; those that have no stiffness either
        are left out, and the table says which. Damping with expressions in parameters needs their values, which a
        `system` has.
        """
        damping, losses, notes = self.damping, self.losses(), []
        if isinstance(damping, ModalDamping | Rayleigh):
            damping = damping.matrix(self.mass, self.stiffness)
        if isinstance(damping, Mapping) or isinstance(losses, Mapping):
            damping = losses = None
            notes = ["without damping, which has parameters: system(...).natural_frequencies() has their values"]
        names = () if self.dofs is None else self.dofs.names
        return natural_frequencies(
            self.mass, self.stiffness, count, names, damping=damping, structural=losses, notes=notes
        )

    def system(
        self,
        elements: Iterable[BaseElement] = (),
        loads: Iterable[Load] = (),
        parameters: Mapping[str, float] | None = None,
        damping: MatrixOrForm = None,
        name: Title = "",
        structural: MatrixOrForm = None,
        units: str | None = None,
        angles: Any = (),
    ) -> System:
        """The structure with nonlinear elements and loads at its degrees of freedom.

        `damping`: in the place of its own, a matrix, `Rayleigh` (its numbers may be expressions in parameters) or
        `ModalDamping`; `structural` likewise, a loss factor (a number or an expression) or a matrix. The other
        arguments are those of `System`; names of DOFs are the labels, "1042 z".
        """
        given = {"damping": damping, "structural": structural}
        structure = replace(self, **{what: value for what, value in given.items() if value is not None})
        names = () if self.dofs is None else self.dofs.names
        matrices, losses = structure.matrices(), structure.losses()
        return System(*matrices, elements, loads, parameters, name or self.name, names, losses, units, angles)

    def matrices(self) -> tuple[Any, Any, Any]:
        """`(M, C, K)` as a `System` takes them; zeros without damping, `{expression: matrix}` where it has parameters.

        Raises `InputError` for degrees of freedom without inertia.
        """
        if self.massless:
            what = shown_dofs(self.massless, self.dofs)
            raise InputError(
                f"DOFs without inertia: {what}; every DOF of a system needs some. Hold those that do not matter with "
                "structure.fixed([...]), or reduce the model where it was made"
            )
        damping = self.damping
        if isinstance(damping, Rayleigh | ModalDamping):
            damping = damping.matrix(self.mass, self.stiffness)
        return self.mass, 0.0 * self.mass if damping is None else damping, self.stiffness

    def losses(self) -> Any:
        """The matrix of structural damping as a `System` takes it: `{expression: stiffness}` for a loss factor with
        parameters; None without.
        """
        eta = self.structural
        if not isinstance(eta, Coefficient):
            return eta
        return eta.value({}) * self.stiffness if eta.constant else {eta.text: self.stiffness}

    def save(self, path: str | PathLike[str]) -> None:
        """Write it to an .npz, which `read_structure` reads; the layout is in `structures/numpy_files.py`."""
        file = path_of(path)
        if file.suffix.lower() != ".npz":
            raise InputError(f"a structure is saved in an .npz file, not in {file.name}")
        matrices = {"mass": self.mass, "stiffness": self.stiffness}
        if not isinstance(self.damping, Rayleigh | ModalDamping | None):
            matrices["damping"] = written_out(self.damping)
        if not isinstance(self.structural, Coefficient | None):
            matrices["structural"] = self.structural
        write(file, matrices, self.dofs, self.mesh, self.damping, self.structural, self.name)

    def __repr__(self) -> str:
        title = f"Structure {self.name!r}" if self.name else "Structure"
        lines = [f"{title}: {self.n} {'DOF' if self.n == 1 else 'DOFs'}"]
        if self.dofs is not None:
            lines[0] += f" ({', '.join(self.dofs.names[:4])}{', ...' * (self.n > 4)})"
        lines.append(f"  nonzeros   mass {self.mass.nnz}, stiffness {self.stiffness.nnz}")
        damping = self.damping
        if damping is not None:
            kept = isinstance(damping, Rayleigh | ModalDamping)
            lines.append(f"  damping    {damping if kept else f'{damping.nnz} nonzeros'}")
        eta = self.structural
        if eta is not None:
            lines.append(
                f"  structural {f'loss factor {eta.text}' if isinstance(eta, Coefficient) else f'{eta.nnz} nonzeros'}"
            )
        if self.massless:
            lines.append(f"  no inertia {shown_dofs(self.massless, self.dofs)}")
        if self.mesh is not None:
            lines.append(f"  mesh       {str(self.mesh).removeprefix('Mesh: ')}")
        return "\n".join(lines)
