"""How a computed curve is laid out as a labelled dataset: the one form that figures, files and tables share.

Dimensions

    point        the points of the curve, in the order in which it was followed
    event        the located bifurcations and grazing contacts, in the order in which the curve meets them
    parameter    the system's parameters, by name
    multiplier   the Floquet multipliers over the response period

Variables on `point`: `omega` (coordinate), `amplitude`, `stable`, `harmonics`, `error`, `residual`, `multipliers`,
`multiplier_errors`, `stability_method`, `parameters` (point x parameter). A free parameter other than omega is a
coordinate as well, under its own name, or as "parameter.NAME" where the layout or a file uses that name. Variables on
`event` carry the prefix `event_`; `event_after` is the index of the point after which the event lies, so that the curve
with its events is one line: point `i`, the events with `event_after == i` in their order, point `i + 1`.
`event_contact` names the contact that grazes at an event (empty at a smooth bifurcation), `event_contact_at` is the
value of the free parameter at which it does. Read-offs that were asked for (`rms`, `velocity`, `harmonic_3`, ...;
docs/pictures.md) are further variables on `point`, each with its own on `event`.

Curves of bifurcations (`track`) have the attributes `tracked`, their kind, and `plane`, their two free parameters, one
a line; `stable` means that all multipliers but the critical ones lie inside the unit circle; on `point` there is
`coefficient`, which decides the normal form (a of limit points, c3 of period doublings, negative where they are
supercritical; else nan), on `event` `event_extreme` ("maximum of j" at an extremum, else empty).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.store.columns import parameter_column
from suboctave.store.events import BranchEvents, EventRow, event_rows, event_variables, events_met
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike

    from suboctave.harmonic.orbit import PeriodicOrbit
    from suboctave.model.system import System

__all__ = [
    "LAYOUT",
    "EventRow",
    "branch_dataset",
    "check_component",
    "check_layout",
    "coordinate",
    "curve_dataset",
    "events_met",
    "has_component",
    "reading_name",
]

LAYOUT = 1  # the number of this layout; it grows when a name or a meaning below changes
RESERVED = frozenset(
    {"point", "event", "parameter", "multiplier", "omega", "amplitude", "stable", "harmonics", "error", "residual"}
    | {"multipliers", "multiplier_errors", "stability_method", "parameters", "coefficient"}
    # what files add, and their dimensions (`analysis/saved.py`)
    | {"arclength", "iterations", "coefficients", "record", "unknown", "multipliers_real", "multipliers_imag"}
)
RESERVED_PREFIXES = ("event_", "system_array_")


class BranchLike(BranchEvents, Protocol):
    """What the layout asks of a branch; events carry their place as arclength along it."""

    @property
    def system(self) -> System: ...
    @property
    def name(self) -> str: ...
    @property
    def orbits(self) -> Sequence[PeriodicOrbit]: ...
    @property
    def omega(self) -> np.ndarray: ...
    @property
    def amplitude(self) -> np.ndarray: ...
    @property
    def harmonics(self) -> np.ndarray: ...
    @property
    def truncation(self) -> np.ndarray: ...
    @property
    def multipliers(self) -> np.ndarray: ...
    @property
    def multiplier_errors(self) -> np.ndarray: ...
    @property
    def stability_methods(self) -> Sequence[str]: ...
    @property
    def arclength(self) -> np.ndarray: ...
    @property
    def closed(self) -> bool: ...
    @property
    def ended(self) -> str: ...
    @property
    def observe(self) -> int: ...
    @property
    def options(self) -> Mapping[str, Any]: ...
    @property
    def warnings(self) -> Sequence[str]: ...
    def parameter(self, name: str) -> np.ndarray: ...


def curve_dataset(
    omega: ArrayLike,
    amplitude: ArrayLike,
    *,
    stable: ArrayLike | None = None,
    harmonics: ArrayLike | None = None,
    error: ArrayLike | None = None,
    residual: ArrayLike | None = None,
    multipliers: ArrayLike | None = None,
    multiplier_errors: ArrayLike | None = None,
    stability_method: Sequence[str] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    free: str = "omega",
    events: Sequence[EventRow] = (),
    system: str = "",
    ended: str = "",
    closed: bool = False,
    period: int = 1,
    observed_dof: int = 0,
    dofs: int = 1,
    options: Mapping[str, str | int | float] | None = None,
) -> xarray.Dataset:
    """A curve of periodic motions as a labelled dataset; the layout is described at the top of this module.

    Shapes: `omega`, `amplitude`, `stable`, `harmonics`, `error`, `residual` (points,); `multipliers` (points, m),
    complex, `multiplier_errors` their estimated errors, `stability_method` (points,) where they come from; each of
    `parameters` a number, or (points,) where it varies along the curve. `omega` is in rad per unit time, `amplitude` is
    max |x| over one response period at `observed_dof`, in the system's unit of length; `period` counts the forcing
    periods in one response period; `free` names the parameter that the curve was followed in. `options` are further
    numbers or texts that tell how the curve was computed.

    Raises InputError where lengths disagree or `free` is not a parameter.
    """
    import xarray

    frequency = _points("omega", omega, None)
    count = frequency.size
    values = {
        name: np.broadcast_to(np.asarray(value, dtype=float), (count,))
        if np.ndim(value) == 0
        else _points(name, value, count)
        for name, value in (parameters or {}).items()
    }
    if free != "omega" and free not in values:
        raise InputError(f"the free parameter {free!r} is not a parameter of the curve{suggest(free, values)}")
    for row in events:
        if not 0 <= row.after < count:
            raise InputError(f"event {row.kind} lies after point {row.after} of a curve of {count} points")

    described = _Described(count)
    described.add("amplitude", amplitude, "max |x| over one response period")
    described.add("stable", stable, "all Floquet multipliers inside the unit circle", bool)
    described.add("harmonics", harmonics, "harmonics kept, up to harmonics * omega", int)
    described.add("error", error, "relative size of the neglected harmonics of the force")
    described.add("residual", residual, "residual of the harmonic balance, relative")
    variables: dict[str, Any] = described.variables
    names = list(values)
    variables["parameters"] = (
        ("point", "parameter"),
        np.column_stack([values[name] for name in names]) if names else np.empty((count, 0)),
    )
    for name, rows, kind, meaning in (
        ("multipliers", multipliers, complex, "Floquet multipliers over the response period"),
        ("multiplier_errors", multiplier_errors, float, "estimated errors of the multipliers"),
    ):
        if rows is None:
            continue
        table = np.asarray(rows, dtype=kind)
        if table.ndim != 2 or table.shape[0] != count:
            raise InputError(f"{name}: expected one row for each of the {count} points, got shape {table.shape}")
        variables[name] = (("point", "multiplier"), table, {"long_name": meaning})
    described.add("stability_method", stability_method, "where the multipliers come from", object)
    variables |= event_variables(events, names, values)

    coords: dict[str, Any] = {
        "omega": ("point", frequency, {"long_name": "circular forcing frequency", "units": "rad per unit time"}),
        "parameter": ("parameter", np.array(names, dtype=object)),
    }
    if free != "omega":
        taken = (free,) if free in RESERVED or free.startswith(RESERVED_PREFIXES) else ()
        coords[parameter_column(free, taken)] = ("point", values[free].copy())
    attributes: dict[str, Any] = {
        "layout": LAYOUT,
        "suboctave": __version__,
        "system": system,
        "free": free,
        "ended": ended,
        "closed": int(closed),
        "period": period,
        "observed_dof": observed_dof,
        "dofs": dofs,
    }
    for name, value in (options or {}).items():
        if name in attributes:
            raise InputError(f"option {name!r} would overwrite an attribute of the layout")
        attributes[name] = value
    return xarray.Dataset(variables, coords, attributes)


def branch_dataset(branch: BranchLike) -> xarray.Dataset:
    """A computed branch as a labelled dataset; the layout is described at the top of this module."""
    names = list(branch.system.parameters)
    rows = event_rows(branch, np.asarray(branch.arclength))
    dataset = curve_dataset(
        branch.omega,
        branch.amplitude,
        stable=branch.stable,
        harmonics=branch.harmonics,
        error=branch.truncation,
        residual=[orbit.residual for orbit in branch.orbits],
        multipliers=branch.multipliers,
        multiplier_errors=branch.multiplier_errors,
        stability_method=branch.stability_methods,
        parameters={name: branch.parameter(name) for name in names},
        free=branch.name,
        events=rows,
        system=branch.system.name,
        ended=branch.ended,
        closed=branch.closed,
        period=branch.orbits[0].basis.nu if len(branch.orbits) else 1,
        observed_dof=branch.observe,
        dofs=branch.system.n,
        options={
            name: value if isinstance(value, str | int | float) else repr(value)
            for name, value in {**branch.options, "warnings": "\n".join(branch.warnings)}.items()
        },
    )
    return _with_tracked(dataset, branch, rows)


def _with_tracked(dataset: xarray.Dataset, branch: BranchLike, rows: Sequence[EventRow]) -> xarray.Dataset:
    """The dataset with what only curves of bifurcations have."""
    kind = getattr(branch, "kind", None)
    if kind is None:
        return dataset
    meaning = {"long_name": "coefficient of the normal form: a of limit points, c3 of period doublings, else nan"}
    dataset = dataset.assign_attrs(tracked=str(kind), plane="\n".join(getattr(branch, "plane", ())))
    return dataset.assign(
        coefficient=("point", np.asarray(getattr(branch, "coefficient", np.empty(0)), dtype=float), meaning),
        event_extreme=("event", np.array([row.extreme for row in rows], dtype=object)),
    )


def reading_name(what: str, number: float | None = None, dof: int | None = None) -> str:
    """The name that a read-off is stored under: "velocity", "harmonic_3", "harmonic_0.5", "peak_force_0_dof1".

    `number` is exact in it: 1/3 is 0.3333333333333333.
    """
    if number is not None:
        short = f"{number:g}"
        what += f"_{short if float(short) == number else repr(float(number))}"
    return what if dof is None else f"{what}_dof{dof}"


def has_component(k: float, nu: int) -> bool:
    """Whether motions of nu load periods have a component at `k omega`."""
    return abs(k * nu - round(k * nu)) <= 1e-9


def check_component(k: float, periods: Sequence[int]) -> None:
    """Raises InputError, with the nearest one, where motions of none of these periods have a component at `k omega`."""
    if periods and not any(has_component(k, nu) for nu in periods):
        from suboctave.harmonic.basis import harmonic_index

        harmonic_index(k, max(periods))


def coordinate(dataset: xarray.Dataset, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The values of `omega` or of a named parameter, at the points (points,) and at the events (events,).

    Raises InputError, with a suggestion, for a name that the dataset does not have.
    """
    if name == "omega":
        return dataset["omega"].to_numpy(), dataset["event_omega"].to_numpy()
    names = [str(known) for known in dataset["parameter"].to_numpy()]
    if name not in names:
        raise InputError(f"the curve has no parameter {name!r}{suggest(name, [*names, 'omega'])}")
    column = names.index(name)
    return dataset["parameters"].to_numpy()[:, column], dataset["event_parameters"].to_numpy()[:, column]


def check_layout(dataset: xarray.Dataset) -> None:
    """Raises InputError when the dataset is not one that `curve_dataset` of this version lays out."""
    found = dataset.attrs.get("layout")
    if found is None:
        raise InputError("this dataset was not laid out by suboctave: it has no attribute 'layout'")
    if int(found) > LAYOUT:
        raise InputError(
            f"this dataset has layout {found}, newer than {LAYOUT}: it was written by suboctave "
            f"{dataset.attrs.get('suboctave', '(unknown version)')}; update suboctave"
        )


class _Described:
    """Collects the variables on `point`, each with its length checked and its meaning attached."""

    def __init__(self, count: int):
        self.count = count
        self.variables: dict[str, Any] = {}

    def add(self, name: str, values: ArrayLike | None, meaning: str, kind: type = float) -> None:
        if values is not None:
            checked = _points(name, values, self.count, kind)
            self.variables[name] = ("point", checked, {"long_name": meaning})


def _points(name: str, values: ArrayLike, count: int | None, kind: type = float) -> np.ndarray:
    array: np.ndarray = np.asarray(values, dtype=kind)
    if array.ndim != 1 or (count is not None and array.size != count):
        wanted = "a one-dimensional array" if count is None else f"{count} values, one for each point"
        raise InputError(f"{name}: expected {wanted}, got shape {array.shape}")
    return array
