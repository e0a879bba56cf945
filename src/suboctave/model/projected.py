"""A structure in few coordinates: `x = V y`, and what a computation in these says of all degrees of freedom.

The equation of motion of a structure with n degrees of freedom in a basis V (n, r) of its motions,

    V^T M V y'' + V^T C V y' + V^T K V y + sum_e (V^T d_e) f_e(d_e.V y, d_e.V y') = V^T p(t),

is a system like any other, with r degrees of freedom, the same parameters and the same laws. The first coordinates are
chosen to be displacements of the structure along given directions, the rows of `read`, so that `read V = (1, 0)`:
elements then read, and act on, single coordinates, and the displacement of an observed degree of freedom is one. The
others move nothing that is read, and each is the largest displacement that it makes anywhere. They are Craig and
Bampton's coordinates, within the span of the basis.
"""

from __future__ import annotations

import copy
import functools
import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from suboctave.errors import InputError
from suboctave.model.angles import Turns
from suboctave.model.elements.base import Array, BaseElement, Place
from suboctave.model.elements.coupled import CoupledElement
from suboctave.model.loads import HarmonicLoad
from suboctave.model.system import System

#: difference between a direction in the coordinates and a whole number that is rounding
_ROUNDING = 1e-10
#: part of a displacement that is read, relative to the others, that a basis must be able to move by itself
_DEPENDENT = 1e-9
#: part of a turn that need not fit into a basis, relative to it
_TURNED = 1e-9
#: share of the energy of a state that is worth a word when it does not fit into a basis
_NOTICED = 1e-9


class ProjectedSystem(System):
    """A structure in the coordinates of a basis; made by `project`.

    Attributes
    ----------
    structure
        The system with n degrees of freedom.
    shapes
        V, (n, r).
    read
        (k, n): the directions along which the first k coordinates are displacements.
    watched
        Degrees of freedom of the structure that the first coordinates are, in this order.
    covers, error
        Highest circular frequency that the basis is made for, rad per unit time, and the error of the flexibility
        there, relative, against a direct solution of the whole structure.
    """

    structure: System
    shapes: Array
    read: Array
    watched: tuple[int, ...]
    covers: float
    error: float

    @property
    def words(self) -> str:
        """What a result rests on."""
        return projected_words(self.structure.n, self.n, self.covers, self.error)

    @functools.cached_property
    def turns(self) -> Turns:
        """Those of the structure in the coordinates; InputError for one that does not fit into the basis."""
        rows = []
        for angle in self.structure.angles:
            turn = angle.turn(self.structure.n)
            row = np.asarray(np.linalg.lstsq(self.shapes, turn, rcond=None)[0], dtype=float)
            if np.abs(self.shapes @ row - turn).max() > _TURNED * np.abs(turn).max():
                raise InputError(
                    f"a turn of {angle.name(self.structure.dof_names)} is no motion of the projected structure: give "
                    "linear=harmonic.StructuralMatrices(system), which takes all of its degrees of freedom"
                )
            rows.append(row)
        return Turns(np.array(rows).reshape(-1, self.n))

    def coordinate(self, dof: int) -> int:
        """Which coordinate is the displacement of a degree of freedom of the structure."""
        return self.watched.index(dof)

    def reduced(self, states: Any) -> Array:
        """States of the structure (..., 2 n) as coordinates (..., 2 r): their part in the basis, in the product of the
        mass.
        """
        n, values = self.structure.n, np.asarray(states, dtype=float)
        mass = self.structure.mass.sparse_value(self.parameters)
        parts = np.stack([values[..., :n], values[..., n:]], axis=-2)
        pulled = (mass @ parts.reshape(-1, n).T).T @ self.shapes
        inside = np.linalg.solve(self.mass.value(self.parameters), pulled.T).T
        result: Array = inside.reshape(*values.shape[:-1], 2 * self.n)
        return result

    def recovered(self, coordinates: NDArray[Any]) -> Recovered:
        """Displacements (..., n) or states (..., 2 n) of the structure from coordinates (..., r) or (..., 2 r)."""
        return Recovered(coordinates, self.shapes)

    def recovered_peaks(self, peaks: Array) -> Recovered:
        """Largest displacements (..., n) from those of the coordinates (..., r): of the degrees of freedom that are
        watched, nan of the others.
        """
        known = np.full((self.structure.n, len(self.watched)), np.nan)
        known[list(self.watched)] = np.eye(len(self.watched))
        return Recovered(peaks, known)

    def energy_outside(self, state: Array) -> float:
        """Share of the energy of a state (2 n,) of the structure that does not fit into the basis."""
        n, at = self.structure.n, self.parameters
        mass, stiffness = self.structure.mass.sparse_value(at), self.structure.stiffness.sparse_value(at)

        def energy(x: Array, v: Array) -> float:
            return abs(float(x @ (stiffness @ x))) + float(v @ (mass @ v))

        inside = self.recovered(self.reduced(state))[:]
        whole = energy(state[:n], state[n:])
        return min(energy(*np.split(state - inside, 2)) / whole, 1.0) if whole > 0.0 else 0.0

    def _changed(self, **parts: Any) -> System:
        return project(self.structure._changed(**parts), self.shapes, self.read, self.watched, self.covers, self.error)

    def __reduce__(self) -> tuple[Any, ...]:
        return project, (self.structure, self.shapes, self.read, self.watched, self.covers, self.error)


def projected_words(n: int, modes: int, covers: float, error: float) -> str:
    """What a structure in a basis is, in a sentence."""
    return (
        f"Projected: {n} degrees of freedom in {modes} modes, for frequencies up to {covers:.6g}; "
        f"error of the flexibility there {error:.1e}"
    )


def project(
    structure: System,
    shapes: Array,
    read: Array,
    watched: Sequence[int] = (),
    covers: float = np.inf,
    error: float = 0.0,
) -> ProjectedSystem:
    """A structure in coordinates with `read shapes = (1, 0)`, as `coordinates_along` gives them.

    All elements and loads act along directions that depend on the rows of `read`. Raises InputError for an element
    that does not say by a direction where it acts.
    """
    seen = _Seen(shapes, len(read))
    parts: dict[str, Any] = {
        what: getattr(structure, what).projected(shapes) for what in ("mass", "damping", "stiffness", "structural")
    }
    loads = [
        HarmonicLoad(amplitude=c.amplitude.text, harmonic=c.harmonic, phase=c.phase.text, direction=seen(c.direction))
        for c in structure.load_components()
        if np.any(c.direction)
    ]
    result = object.__new__(ProjectedSystem)
    own = {"structure": structure, "shapes": shapes, "read": read, "watched": tuple(watched)}
    for name, value in {**own, "covers": float(covers), "error": float(error)}.items():
        object.__setattr__(result, name, value)
    result._fill(
        check=False, **parts, elements=[_seen_element(e, structure.n, seen) for e in structure.elements], loads=loads,
        parameters=structure.parameters, name=structure.name, dof_names=(), units=structure.units, angles=(),
    )  # fmt: skip
    return result


class _Seen:
    """Directions of the structure (n,) in coordinates (r,); they read the first `count` ones only."""

    def __init__(self, shapes: Array, count: int) -> None:
        self.shapes, self.count = shapes, count

    def __call__(self, direction: Array) -> Array:
        c = direction @ self.shapes
        # the others are rounding; a single coordinate makes simpler code than one of many
        c[self.count :] = 0.0
        near = np.rint(c)
        result: Array = np.where(np.abs(c - near) <= _ROUNDING, near, c)
        return result


def _seen_element(element: BaseElement, n: int, seen: _Seen) -> BaseElement:
    """The element with its directions in the coordinates."""
    result, r = copy.copy(element), seen.shapes.shape[1]
    along, inputs = seen(element.direction(n)), np.array([seen(row) for row in element.inputs(n)])
    result.place = Place(element.label, None, along)
    if isinstance(result, CoupledElement):
        result.input_places = tuple(Place(element.label, None, row) for row in inputs)
    if not (np.array_equal(result.direction(r), along) and np.array_equal(result.inputs(r), inputs)):
        raise InputError(
            f"{element.label} has a way of its own to say where it acts, so that {n} degrees of freedom cannot be "
            "projected: leave `direction` and `inputs` of its class as they are in Element or CoupledElement"
        )
    return result


def coordinates_along(shapes: Array, read: Array, matrices: tuple[Array, Array], watched: Sequence[int] = ()) -> Array:
    """A basis (n, r) of the span of `shapes` in which the first coordinates are displacements along `read` (k, n).

    matrices: mass and stiffness in `shapes`, (r, r). The first coordinates deflect the structure as forces along
    `read` do, the others are its vibrations while these are held. `watched`: which degrees of freedom the first rows
    of `read` are.
    """
    mass, stiffness = (0.5 * (m + m.T) for m in matrices)
    values, modes = eigh(stiffness, mass)
    # a unit of stiffness makes the deflection of what moves freely a finite one
    sizes = np.sort(np.abs(values))
    unit = float(sizes[np.argmax(sizes > 1e-9 * np.median(sizes))])
    shift = 0.0 if values.min() > 1e-9 * unit else unit + max(0.0, -2.0 * float(values.min()))
    along, count = read @ shapes @ modes, len(read)
    weight = 1.0 / (values + shift)
    flexibility = (along * weight) @ along.T
    size = np.sqrt(flexibility.diagonal())
    if not np.linalg.eigvalsh(flexibility / np.multiply.outer(size, size))[0] > _DEPENDENT**2:
        raise InputError(
            "the observed degrees of freedom and those that forces act on do not move by themselves in the modes of "
            "the projection: observe fewer of them"
        )
    static = (weight[:, None] * along.T) @ np.linalg.inv(flexibility)
    null = np.linalg.qr(along.T, mode="complete")[0][:, count:]
    if null.shape[1]:
        null = null @ eigh((null * values[:, None]).T @ null)[1]
    result: Array = shapes @ (modes @ np.concatenate((static, null), axis=1))
    result[:, count:] /= np.abs(result[:, count:]).max(axis=0)
    result[list(watched)] = np.eye(len(watched), result.shape[1])
    return result


class Recovered(np.lib.mixins.NDArrayOperatorsMixin):
    """Displacements (..., n) or states (..., 2 n) of a structure that are kept as coordinates, an array as it is read.

    An index makes the part that it asks for; `np.asarray(...)`, functions of NumPy, operators, and what else an array
    has (`T`, `max`, `mean`) all of it. `shapes` (n, r) times the first r coordinates are the displacements.
    """

    def __init__(self, coordinates: NDArray[Any], shapes: Array) -> None:
        self.coordinates, self.shapes = coordinates, shapes

    @property
    def states(self) -> bool:
        """Whether velocities follow the displacements."""
        return self.coordinates.shape[-1] == 2 * self.shapes.shape[1]

    @property
    def shape(self) -> tuple[int, ...]:
        """As of an array."""
        return (*self.coordinates.shape[:-1], len(self.shapes) * (1 + self.states))

    @property
    def ndim(self) -> int:
        """As of an array."""
        return self.coordinates.ndim

    @property
    def size(self) -> int:
        """As of an array."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def dtype(self) -> np.dtype[Any]:
        """As of an array."""
        return self.coordinates.dtype

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> Any:
        keys = [_index(one) for one in (key if isinstance(key, tuple) else (key,))]
        taken = sum(_axes(one) for one in keys)
        dots = sum(one is Ellipsis for one in keys)
        if dots > 1 or taken > self.ndim:
            raise IndexError(f"an index of {taken} axes and {dots} ellipses for an array of {self.ndim} axes")
        keys += [Ellipsis] * (1 - dots)
        at = next(i for i, one in enumerate(keys) if one is Ellipsis)
        keys[at : at + 1] = [slice(None)] * (self.ndim - taken)
        arrays = [one for one in keys if isinstance(one, np.ndarray)]
        numbered = any(isinstance(one, int) for one in (keys[:-1] if arrays and keys[0] is arrays[0] else keys))
        if arrays and (len(arrays) > 1 or arrays[0].ndim != 1 or numbered or any(one is None for one in keys)):
            return self._one_by_one(tuple(keys))
        *first, last = [one for one in keys if one is not None]
        part = self._displaced(self.coordinates[tuple(first)], last)
        new_axes = tuple(one if one is None else slice(None) for one in keys if one is None or isinstance(one, slice))
        return part[new_axes] if None in new_axes else part

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or not hasattr(np.ndarray, name):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        whole = np.asarray(self)
        whole.setflags(write=False)  # what changes an array in place changes none of the coordinates
        return getattr(whole, name)

    def _one_by_one(self, keys: tuple[Any, ...]) -> NDArray[Any]:
        """Single entries, of which the indices are chosen along several axes at once."""
        n, r = self.shapes.shape
        along = np.meshgrid(*map(np.arange, self.shape), indexing="ij", sparse=True)
        *first, last = (np.broadcast_to(places, self.shape)[keys] for places in along)
        coordinates, rows = self.coordinates[tuple(first)], self.shapes[last % n]
        result: NDArray[Any] = np.einsum("...i,...i", coordinates[..., :r], rows)
        if self.states:
            result = np.where(last < n, result, np.einsum("...i,...i", coordinates[..., r:], rows))
        return result

    def _displaced(self, coordinates: NDArray[Any], last: Any) -> Any:
        n, r = self.shapes.shape
        if not self.states:
            return coordinates[..., :r] @ self.shapes[last].T
        if isinstance(last, slice) and last == slice(None):
            return np.concatenate([coordinates[..., :r] @ self.shapes.T, coordinates[..., r:] @ self.shapes.T], axis=-1)
        which = np.arange(2 * n)[last]
        rows = self.shapes[which % n]
        slow, fast = coordinates[..., :r] @ rows.T, coordinates[..., r:] @ rows.T
        return np.where(which < n, slow, fast) if np.ndim(which) else (slow if which < n else fast)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self[()], dtype=dtype)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **named: Any) -> Any:
        arrays = [np.asarray(one) if isinstance(one, Recovered) else one for one in inputs]
        return getattr(ufunc, method)(*arrays, **named)

    def __repr__(self) -> str:
        return f"Recovered({self.shape}, from {self.shapes.shape[1]} coordinates)"


def _index(key: Any) -> Any:
    """An index as a slice, an int, None, the ellipsis, or an array."""
    if key is None or key is Ellipsis or isinstance(key, slice):
        return key
    array = np.asarray(key)
    if array.ndim == 0 and array.dtype != bool:
        return operator.index(key)
    return array if array.size else array.astype(bool if array.dtype == bool else int)


def _axes(key: Any) -> int:
    """How many axes an index takes."""
    if key is None or key is Ellipsis:
        return 0
    return key.ndim if isinstance(key, np.ndarray) and key.dtype == bool else 1


def coordinates_of(values: Any) -> Any:
    """What an array was recovered from, or the array."""
    return values.coordinates if isinstance(values, Recovered) else values


def lost_in_words(share: float) -> str:
    """What is said of a start that does not fit into a basis; nothing where all of it does."""
    return f"; {100.0 * share:.2g} % of the energy of the start do not fit into them" if share > _NOTICED else ""
