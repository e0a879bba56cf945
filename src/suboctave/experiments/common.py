"""What experiments in time share: starts, counts, grids and options that are checked, forces without jumps, large
structures in few coordinates, and results that can be saved, loaded and written as a table.
"""

from __future__ import annotations

import functools
import inspect
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    ParamSpec,
    Self,
    TypeAlias,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from numpy.typing import NDArray

from suboctave.arguments import Count, Positive, checked
from suboctave.errors import InputError, is_number, refuse_idle, shortened, suggest
from suboctave.model.elements.base import Array, numbers_of
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.inputs import (
    check_count,
    check_is_system,
    observed_dof,
    start_state,
)
from suboctave.model.projected import ProjectedSystem, Recovered, lost_in_words, project
from suboctave.model.system import System
from suboctave.options import ParallelOptions, RunOptions
from suboctave.pictures.cells import Pictured
from suboctave.projection import in_basis, small_system
from suboctave.store.layout import rotations_of, with_units
from suboctave.store.plain import Recorded, flat, recorded, written_system
from suboctave.store.registry import Codec, Datasets, Stored, register
from suboctave.store.table import Table, write_csv
from suboctave.timedomain.flow import METHODS, Flow
from suboctave.timedomain.layout import Layout as StateLayout
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray

ComplexArray: TypeAlias = NDArray[np.complex128]

#: by how much the points of a periodic motion may miss each other, relative to the motion's size
TOLERANCE = 1e-6
#: trajectories side by side where there are one or two
FEW = 4
#: samples per period of the accurate method, steps of Newmark's
_SAMPLES = {"accurate": 200, "newmark": 1000}


# ----------------------------------------------------------------------------------------------------------- options
class TimeOptions(RunOptions, total=False):
    """How a large structure is integrated."""

    linear: Annotated[
        Any,
        "The linear part whose projection a structure of more than 40 degrees of freedom is integrated in, as "
        "`condense` gives it (default: for 15 harmonics of the highest omega); `harmonic.StructuralMatrices(system)` "
        "for all of its degrees of freedom.",
    ]


class SideBySideOptions(TimeOptions, ParallelOptions, total=False):
    """Options of verbs that follow trajectories side by side."""


class RecognitionOptions(TimeOptions, total=False):
    """How finely a motion is integrated, and how its period is recognised."""

    tolerance: Annotated[
        Positive | None,
        "Local error relative to the size of the motion (default 1e-10, of `basins` 1e-8); of Newmark's method that of "
        "the equations solved in each step.",
    ]
    period_tolerance: Annotated[
        Positive | None,
        "Motions whose points repeat to this share of their size (default 1e-6) are periodic; at least three "
        "repetitions are needed.",
    ]
    observe: Annotated[
        int | str | None,
        "The degree of freedom whose amplitude is reported, by its number or name; default that of the first load.",
    ]


class BasinOptions(RecognitionOptions, SideBySideOptions, total=False):
    """Both."""


class SectionOptions(BasinOptions, total=False):
    """Both, with a choice of the method."""

    method: Annotated[
        str | None,
        '"accurate" (default): Dormand and Prince of order 8 with steps of its own, corners of laws located; or '
        '"newmark": fixed steps, as in `integrate`.',
    ]
    steps_per_period: Annotated[Count | None, "Steps of Newmark's method in one period (default 1000)."]


@dataclass(frozen=True)
class Integration:
    """Options that have been checked."""

    method: str
    steps: int
    tolerance: float | None
    period_tolerance: float
    observe: int
    workers: int | None


def checked_integration(system: System, options: Mapping[str, Any], **defaults: Any) -> Integration:
    """Options of integration, or a verb's defaults; `InputError` for those that make no sense."""
    given = defaults | {name: value for name, value in options.items() if value is not None}
    method, period_tolerance = given.get("method", "accurate"), given.get("period_tolerance", TOLERANCE)
    check_is_system(system)
    if not (isinstance(period_tolerance, int | float) and 1e-14 <= period_tolerance < 1.0):
        raise InputError(f"period_tolerance={period_tolerance!r}: give a share of the motion's size, such as 1e-6")
    if method == "accurate":
        why = "the accurate method chooses its steps; give method='newmark', or leave it out"
        refuse_idle(why, steps_per_period=given.get("steps_per_period") is not None)
    steps, observe = steps_of(method, given.get("steps_per_period")), observed_dof(system, given.get("observe"))
    return Integration(method, steps, given.get("tolerance"), period_tolerance, observe, given.get("workers"))


def steps_of(method: str, given: int | None) -> int:
    """Samples of the accurate method, or steps of Newmark's, in one period."""
    if method not in METHODS:
        raise InputError(f"method={shortened(method)}{suggest(str(method), METHODS)}")
    return check_count("steps_per_period", _SAMPLES.get(method, 200) if given is None else given)


# ------------------------------------------------------------------------------------------------------------ starts
def starting_states(system: System, start: Any) -> Array:
    """States (k, 2n) of one start, or of several: rest for None, states, or motions, whose state at t = 0 is taken."""
    several = isinstance(start, list | tuple) and len(start) and not all(is_number(one) for one in start)
    if several or (isinstance(start, np.ndarray) and start.ndim == 2 and len(start)):
        return np.stack([start_state(system, one) for one in start])
    return start_state(system, start)[None]


def coordinates(system: System) -> list[str]:
    """Names of the entries of a state: `x_0 ... v_0 ...`; of a projected one those that are watched are named as in
    the structure.
    """
    numbers: list[Any] = list(range(system.n))
    if isinstance(system, ProjectedSystem):
        numbers = [*system.watched, *(f"mode_{i}" for i in range(system.n - len(system.watched)))]
    return [f"{kind}_{i}" for kind in "xv" for i in numbers]


def watched_states(system: System, projection: ProjectedSystem | None) -> tuple[list[int], list[str]]:
    """Which entries of a state a table has, and their names: all, of a projected structure those that are watched."""
    dofs = list(range(system.n)) if projection is None else list(projection.watched)
    named = [system.dof_names[i] if system.dof_names else str(i) for i in dofs]
    return [*dofs, *(system.n + dof for dof in dofs)], [f"{kind}_{name}" for kind in "xv" for name in named]


# -------------------------------------------------------------------------------------------------- large structures
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result", bound="TimeResult")


def of_structures(verb: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """A verb in time that takes large structures too: it computes with the projection, its result is the structure's.

    Here, and nowhere else, a structure is replaced: its states, observed degrees of freedom and planes by those of the
    coordinates.
    """
    signature = inspect.signature(verb)

    @functools.wraps(verb)
    def computed(*positional: Arguments.args, **named: Arguments.kwargs) -> Result:
        try:
            bound = signature.bind(*positional, **named)
        except TypeError:  # said better by Python
            return verb(*positional, **named)
        given, options = bound.arguments, bound.arguments.get("options", {})
        system, linear = given["system"], options.pop("linear", None)
        omega = _highest(given.get("omega"))
        if not isinstance(system, System) or omega is None:  # refused by the verb
            return verb(*positional, **named)
        watched = _watched(system, given, options)
        if linear is None:
            small = small_system(system, omega, watched, _varied(system, given))
        else:
            small = _own(system, linear, watched)
        if not isinstance(small, ProjectedSystem):
            return verb(*bound.args, **bound.kwargs)
        given["system"], lost = small, 0.0
        if given.get("start") is not None:
            states = starting_states(system, given["start"])
            lost = max(small.energy_outside(one) for one in states)
            given["start"] = small.reduced(states if len(states) > 1 else states[0])
        if options.get("observe") is not None:
            options["observe"] = small.coordinate(watched[0])
        if given.get("plane") is not None:
            names = coordinates(system)
            given["plane"] = tuple(names[column] for column in check_plane(system, given["plane"], watched[0]))
        if given.get("tap") is not None:
            at, dof, change = given["tap"]
            given["tap"] = at, small.coordinate(observed_dof(system, dof)), change
        return verb(*bound.args, **bound.kwargs).recovered(lost)

    return computed


def _highest(omega: Any) -> float | None:
    """The highest of the frequencies that were given; None for what is none."""
    values = numbers_of(omega)
    return float(values.max()) if values.size and np.isfinite(values).all() and values.max() > 0.0 else None


def _own(system: System, linear: Any, watched: Sequence[int]) -> System:
    """The system in the basis of a linear part that was given."""
    if getattr(getattr(linear, "system", None), "n", None) != system.n:
        raise InputError(f"linear={shortened(linear)}: give what `condense` makes of this system")
    return in_basis(system, linear, watched)


def _watched(system: System, given: Mapping[str, Any], options: Mapping[str, Any]) -> list[int]:
    """The degrees of freedom that a verb looks at, the observed one first."""
    dofs = [observed_dof(system, options.get("observe"))]
    if given.get("plane") is not None:
        dofs += [column % system.n for column in check_plane(system, given["plane"], dofs[0])]
    tap = given.get("tap")
    if isinstance(tap, tuple | list) and len(tap) == 3:
        dofs.append(observed_dof(system, tap[1]))
    return list(dict.fromkeys(dofs))


def _varied(system: System, given: Mapping[str, Any]) -> dict[str, list[float]]:
    """Ends and middle of the values that parameters have, by name."""
    varied = dict(given["parameters"]) if isinstance(given.get("parameters"), Mapping) else {}
    if given.get("bounds") is not None and isinstance(given.get("parameter"), str):
        varied[given["parameter"]] = given["bounds"]
    arrays = {name: numbers_of(values) for name, values in varied.items() if name in system.parameters}
    return {
        name: sorted({float(a.min()), 0.5 * float(a.min() + a.max()), float(a.max())})
        for name, a in arrays.items()
        if a.size and np.isfinite(a).all()
    }


def check_plane(system: System, plane: Any, observe: int) -> tuple[int, int]:
    """The two coordinates as numbers in the state, or `InputError`."""
    if plane is None:
        return observe, system.n + observe
    if not (isinstance(plane, tuple | list) and len(plane) == 2):
        raise InputError(f'plane={plane!r}: name two coordinates of the state, such as ("x_0", "v_0")')
    names = coordinates(system)
    read = []
    for one in plane:
        if isinstance(one, str):
            if one not in names:
                raise InputError(f"plane: there is no coordinate {one!r}{suggest(one, names)}")
            read.append(names.index(one))
        elif isinstance(one, int | np.integer) and not isinstance(one, bool) and 0 <= one < len(names):
            read.append(int(one))
        else:
            raise InputError(
                f"plane: {one!r} is no coordinate: a name such as x_0, or a number from 0 to {len(names) - 1}"
            )
    if read[0] == read[1]:
        raise InputError(f"plane={plane!r} names one coordinate twice")
    return read[0], read[1]


# ------------------------------------------------------------------------------------------------------------ forces
_PER_PERIOD, _PERIODS, _HALVINGS = 200, 30, 40
#: the share of a force's range that remains between two neighbours if it jumps there
_JUMP = 1e-3


def check_continuous(system: System, state: Array, omega: float, values: Mapping[str, float]) -> None:
    """Refuse elements of a user's own whose force jumps on the way of the motion from `state` (2n,).

    Derivatives of the flow take continuous forces for granted. Between the two samples of the motion that differ most
    in force, the place is halved again and again: what is left of a continuous force is nothing.
    """
    own = StateLayout(system).called_back
    if not own:
        return
    flow = Flow(system, "newmark", _PER_PERIOD, _PER_PERIOD, lanes=8)
    states = flow.over(state, omega, _PERIODS, values).whole().states[0]
    states = np.vstack([state[None], states[np.isfinite(states).all(axis=1)]])
    for placed in own:
        _check_jump(system, placed.element, states, {**system.parameters, **values})


def _check_jump(system: System, element: Any, states: Array, values: Mapping[str, float]) -> None:
    law, n = as_coupled(element), system.n
    rows, c = element.inputs(n), element.coefficient_values(values)
    q = rows @ states[:, :n].T
    if element.depends_on_velocity:
        q = np.vstack([q, rows @ states[:, n:].T])
    phase = 2.0 * np.pi * (np.arange(q.shape[1]) % _PER_PERIOD) / _PER_PERIOD
    f = np.asarray(law.tangent(q, phase, c)[0], dtype=float)
    largest = float(np.ptp(f))
    if len(f) < 2 or not largest > 0.0:
        return
    k = int(np.argmax(np.abs(np.diff(f))))
    # the phase stands still: a force that jumps at an instant, whatever the motion, does no harm
    low, high, at = q[:, k : k + 1], q[:, k + 1 : k + 2], phase[k : k + 1]
    first, last = (float(law.tangent(y, at, c)[0][0]) for y in (low, high))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        force = float(law.tangent(middle, at, c)[0][0])
        if abs(force - first) >= abs(last - force):
            high, last = middle, force
        else:
            low, first = middle, force
    if abs(last - first) > _JUMP * largest:
        place = ", ".join(f"{value:.4g}" for value in low[:, 0])
        raise InputError(
            f"{element.label}: the force jumps by {abs(last - first):.3g} at ({place}); the derivative of the flow "
            "does not contain that. Write the law with a steep but continuous passage"
        )


# ----------------------------------------------------------------------------------------------------------- results
class On:
    """Where a field of a result lies in its dataset: `Annotated[Array, On("time", "dof")]` is a variable on these axes,
    the coordinate if the one axis is called as it is; `name`: what it is called there, if not as the field.
    """

    def __init__(self, *axes: str, name: str = "") -> None:
        self.axes, self.name = axes, name


class StatesOn(On):
    """The axes of states (..., 2n), which are two variables of the dataset: displacement and velocity."""


class PeaksOn(On):
    """The axes of largest displacements (..., n)."""


#: axes along which a structure has as many entries as degrees of freedom, or twice as many, and what they are called
#: where its coordinates are written
_WIDE = {"dof": "coordinate", "state": "state_coordinate"}


def _entries(made: Any) -> Iterator[tuple[str, Any, On]]:
    """Where the fields of a class of results lie: arrays on their axes, numbers and texts as attributes."""
    for name, hint in get_type_hints(made, include_extras=True).items():
        kind, *places = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        if places or (kind in (int, float, bool, str, float | None) and name != "seconds"):
            yield name, kind, places[0] if places else On()


@checked(result=True)
class TimeResult(Stored, Pictured):
    """A result of time integration: trajectories, sections, diagrams, exponents, basins, tests, verifications.

    `contents` says in files what it is, and `picture` which function of `pictures.in_time` draws it. Fields that say
    where they lie in the dataset are written and read by that; what follows from them is `_derived`, and what has no
    place there goes through the record of a file: `_recorded`, with dataclasses among `in_record`, and `_from_record`.
    """

    contents: ClassVar[str]
    picture: ClassVar[str]
    #: columns of its table that are no states and no quantities of motions, by their dimensions
    dimensions: ClassVar[Mapping[str, str]] = {}
    in_record: ClassVar[Mapping[str, type]] = {}
    system: System
    #: what a large structure was integrated as, None for one that was taken as it is
    projection = None  # type: ProjectedSystem | None
    #: share of the energy of the states at the start that did not fit into it
    lost = 0.0

    def __init_subclass__(cls) -> None:
        if "contents" in cls.__dict__:
            register(Codec(cls.contents, cls, _write, partial(_read, cls)))

    @property
    def integrated(self) -> System:
        """The system that was integrated: `projection`, or `system`."""
        return self.system if self.projection is None else self.projection

    def recovered(self, lost: float = 0.0) -> Self:
        """This result of a `ProjectedSystem` as that of its structure: arrays are recovered as they are read."""
        small = self.system
        assert isinstance(small, ProjectedSystem)
        for field, _, place in _entries(type(self)):
            value = getattr(self, field)
            if isinstance(place, PeaksOn):
                setattr(self, field, small.recovered_peaks(value))
            elif isinstance(place, StatesOn) or _WIDE.keys() & set(place.axes):
                setattr(self, field, small.recovered(value))
            elif field == "observed":
                self.observed = small.watched[value]
        self.projection, self.lost, self.system = small, lost, small.structure
        return self

    @property
    def basis(self) -> str:
        """In which modes a large structure was integrated, with which error; empty for one that was taken as it is."""
        return "" if self.projection is None else self.projection.words + lost_in_words(self.lost)

    def __repr__(self) -> str:
        first, *more = self._in_words().splitlines()
        return "\n".join([first, *([f"  {self.basis}"] if self.basis else []), *more])

    @abstractmethod
    def _in_words(self) -> str:
        """The result in a line, and what needs attention in further ones."""

    def to_dataframe(self) -> pandas.DataFrame:
        """The result as a table; the class says what its rows are."""
        import pandas as pd

        return pd.DataFrame(self._columns())

    @abstractmethod
    def _columns(self) -> Mapping[str, Any]:
        """The columns of the table, by name."""

    def _derived(self) -> Mapping[str, Any]:
        """Variables `(axes, values)` and attributes of the dataset that are no fields."""
        return {}

    def _recorded(self) -> Mapping[str, Any]:
        return {}

    @classmethod
    def _from_record(cls, stored: Recorded) -> Mapping[str, Any]:
        return {}

    def to_csv(self, path: str | Path, overwrite: bool = False) -> Path:
        """The table as comma-separated text (.csv)."""
        return write_csv(
            with_units(self.to_dataframe(), getattr(self, "system", None), dimensions=self.dimensions), path, overwrite
        )

    def to_table(self) -> Table:
        """The table with the result beside it (`.result`)."""
        frame = self.to_dataframe()
        columns = {str(name): np.asarray(frame[name].tolist()) for name in frame.columns}
        return Table(columns, repr(self).splitlines()[0], self)

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Draw it; saved if a path is given. The class says what is drawn, and which options there are."""
        from suboctave.pictures import in_time

        return getattr(in_time, self.picture)(self.to_xarray(), path=path, **options)

    def to_xarray(self) -> xarray.Dataset:
        """The result as a labelled dataset, with what produced it (variables: docs/results.md)."""
        return self._dataset()

    def _dataset(self, projected: bool = False) -> xarray.Dataset:
        """The dataset; `projected`: with the coordinates of what is recovered, and the basis."""
        import xarray

        n, values = self.system.n, getattr(self, "parameters", self.system.parameters)
        arrays: dict[str, Any] = {}
        own: dict[str, Any] = {}
        for field, _, place in _entries(type(self)):
            value = getattr(self, field)
            if value is None:
                continue
            if isinstance(place, StatesOn):
                parts = dict(zip(("displacement", "velocity"), halves(value, n), strict=True))
                arrays |= {name: ((*place.axes, "dof"), part) for name, part in parts.items()}
            elif place.axes:
                arrays[place.name or field] = place.axes, value
            else:
                own[place.name or field] = int(value) if isinstance(value, bool) else value
        arrays["parameters"] = ("parameter",), np.array(list(values.values()), dtype=float)
        for name, value in self._derived().items():
            (arrays if isinstance(value, tuple) else own)[name] = value
        produced = {"dofs": n, "dof_names": "\n".join(self.system.dof_names)}
        produced |= {"system": self.system.name, "suboctave": __version__}
        if self.system.units:
            produced |= {"units": str(self.system.units), **rotations_of(self.system)}
        if self.projection is not None:
            produced["projection"] = self.basis
        if projected and self.projection is not None:
            arrays = {name: _as_kept(*entry) for name, entry in arrays.items()}
            arrays |= {"shapes": (("dof", "coordinate"), self.projection.shapes)}
            arrays |= {"read": (("read", "dof"), self.projection.read)}
        attributes = {"contents": self.contents, **own, **produced}
        dataset = xarray.Dataset(dict(flat(arrays)), coords={"parameter": list(values)}, attrs=attributes)
        if "dof" in dataset.dims:
            dataset = dataset.assign_coords(dof=list(self.system.dof_names or range(n)))
        return dataset


def halves(states: Any, n: int) -> tuple[Any, Any]:
    """Displacements and velocities (..., n) of states (..., 2n)."""
    if not isinstance(states, Recovered):
        return states[..., :n], states[..., n:]
    r = states.shapes.shape[1]
    parts = states.coordinates[..., :r], states.coordinates[..., r:]
    return Recovered(parts[0], states.shapes), Recovered(parts[1], states.shapes)


def _as_kept(axes: Any, values: Any, *rest: Any) -> tuple[Any, ...]:
    """A variable with coordinates in the place of what is recovered from them."""
    if not isinstance(values, Recovered):
        return axes, values, *rest
    return tuple(_WIDE.get(axis, axis) for axis in axes), values.coordinates, *rest


# ------------------------------------------------------------------------------------------------------------- files
def _write(item: TimeResult) -> dict[str, xarray.Dataset]:
    """The dataset of `to_xarray`, and besides `record`: JSON with the system and what is no array.

    Of a projected structure the coordinates and the basis, from which all else is recovered.
    """
    system, arrays = written_system(item.system)
    record = {"system": system, "seconds": float(item.seconds), **item._recorded()}
    if (small := item.projection) is not None:
        own = {"watched": list(small.watched), "covers": small.covers, "error": small.error, "lost": item.lost}
        record["projection"] = own
    return {"": recorded(item._dataset(True), record, "the system and what is no array, as JSON", arrays)}


def _read(made: Any, groups: Datasets, allow_code: bool, linear: Any) -> TimeResult:
    """The result that `_write` wrote, equal bit for bit; what follows from its numbers is computed when needed."""
    stored = Recorded(groups[""], allow_code, made.in_record)
    given: dict[str, Any] = {}
    for field, kind, place in _entries(made):
        name = place.name or field
        if isinstance(place, StatesOn):
            given[field] = np.concatenate([stored["displacement"], stored["velocity"]], axis=-1)
        elif place.axes and type(None) in get_args(kind) and name not in stored.dataset:
            continue  # one that has a default, which most results do without
        elif place.axes:
            given[field] = stored[name] if stored[name].dtype.kind not in "OU" else tuple(map(str, stored[name]))
        elif kind == float | None:
            given[field] = float(stored.dataset.attrs[name]) if name in stored.dataset.attrs else None
        else:
            given[field] = kind(stored.dataset.attrs[name])
    if "parameters" in made.__annotations__:
        given["parameters"] = dict(zip(map(str, stored["parameter"]), stored["parameters"].tolist(), strict=True))
    system, lost = stored.system(stored.record["system"]), None
    if (own := stored.record.get("projection")) is not None:
        lost = own.pop("lost")
        system = project(system, stored["shapes"], stored["read"], **own)
        if "observed" in given:
            given["observed"] = system.coordinate(given["observed"])
    result: TimeResult = made(**given, **made._from_record(stored), system=system)
    result.seconds = float(stored.record["seconds"])
    return result if lost is None else result.recovered(lost)
