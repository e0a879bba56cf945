"""How a computed curve is laid out as a labelled dataset: the one form that figures, files and tables share.

Dimensions

    point        the points of the curve, in the order in which it was followed
    event        the located bifurcations and grazing contacts, in the order in which the curve meets them
    parameter    the system's parameters, by name
    multiplier   the Floquet multipliers over the response period

Variables on `point`: `omega` (coordinate), `amplitude`, `stable`, `harmonics`, `error`, `residual`, `multipliers`,
`multiplier_errors`, `stability_method`, `parameters` (point x parameter). A free parameter other than omega is a
coordinate under its own name as well, unless the layout already uses that name. Variables on `event` carry the prefix
`event_`; `event_after` is the index of the point after which the event lies, so that the curve with its events is one
line: point `i`, the events with `event_after == i` in their order, point `i + 1`. `event_contact` names the contact
that grazes at an event (empty at a smooth bifurcation), `event_contact_at` is the value of the free parameter at which
it does. Read-offs that were asked for (`rms`, `velocity`, `harmonic_3`, ...; docs/pictures.md) are further variables on
`point`, each with its own on `event`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike

    from suboctave.harmonic.orbit import PeriodicOrbit
    from suboctave.model.system import System

__all__ = ["LAYOUT", "EventRow", "branch_dataset", "check_layout", "coordinate", "curve_dataset", "events_met"]

LAYOUT = 1  # the number of this layout; it grows when a name or a meaning below changes
UNKNOWN = -1  # in event_stable_after
RESERVED = frozenset(
    {"point", "event", "parameter", "multiplier", "omega", "amplitude", "stable", "harmonics", "error", "residual"}
    | {"multipliers", "multiplier_errors", "stability_method", "parameters"}
)


@dataclass(frozen=True)
class EventRow:
    """One located bifurcation, as a row of the dataset.

    `after` is the index of the point after which it lies, `parameters` holds the parameters that differ from those of
    the curve's fixed ones, `stable_after` says whether the motions right after it are stable (None: not known),
    `uncertainty` is the half-width in the free parameter of what is not resolved, `contact` the contact that grazes (at
    a grazing, or at a bifurcation that it brings about), `contact_at` the value of the free parameter where it does;
    `multiplier_error` is the estimated error of `multiplier`, `stability_method` where it comes from.
    """

    kind: str
    after: int
    omega: float
    amplitude: float
    residual: float = np.nan
    multiplier: complex = complex(np.nan, np.nan)
    multiplier_error: float = np.nan
    stability_method: str = ""
    criticality: str | None = None
    stable_after: bool | None = None
    uncertainty: float = 0.0
    contact: str = ""
    contact_at: float = np.nan
    parameters: Mapping[str, float] = field(default_factory=dict)


class ContactLike(Protocol):
    """What the layout asks of a contact that grazes: words for it, and where in the free parameter it does."""

    @property
    def parameter(self) -> float: ...
    def __str__(self) -> str: ...


class EventLike(Protocol):
    """What the layout asks of a located bifurcation or a user's event."""

    @property
    def kind(self) -> str: ...
    @property
    def omega(self) -> float: ...
    @property
    def amplitude(self) -> float: ...
    @property
    def residual(self) -> float: ...
    @property
    def uncertainty(self) -> float: ...
    @property
    def criticality(self) -> str | None: ...
    @property
    def contact(self) -> ContactLike | None: ...
    @property
    def arclength(self) -> float: ...
    @property
    def parameters(self) -> Mapping[str, float]: ...
    @property
    def multipliers(self) -> np.ndarray: ...
    @property
    def critical_error(self) -> float: ...
    @property
    def stability_method(self) -> str: ...
    def critical_multiplier(self) -> complex: ...


class BranchLike(Protocol):
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
    def stable(self) -> np.ndarray: ...
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
    def bifurcations(self) -> Iterable[EventLike]: ...
    @property
    def grazings(self) -> Iterable[EventLike]: ...
    @property
    def events(self) -> Iterable[EventLike]: ...
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
    variables |= _event_variables(events, names, values)

    coords: dict[str, Any] = {
        "omega": ("point", frequency, {"long_name": "circular forcing frequency", "units": "rad per unit time"}),
        "parameter": ("parameter", np.array(names, dtype=object)),
    }
    if free not in RESERVED and not free.startswith("event_"):
        coords[free] = ("point", values[free].copy())
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
    arclength = np.asarray(branch.arclength)
    return curve_dataset(
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
        events=_event_rows(branch, arclength),
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


def events_met(branch: BranchLike) -> list[EventLike]:
    """The branch's bifurcations, grazings and events in the order met: the rows of the dimension `event`."""
    return sorted([*branch.bifurcations, *branch.grazings, *branch.events], key=lambda event: event.arclength)


def _event_rows(branch: BranchLike, arclength: np.ndarray) -> list[EventRow]:
    """The branch's bifurcations, grazings and events in the order met, each with its place and the verdict after it."""
    own = {id(event) for event in (*branch.grazings, *branch.events)}  # stability goes on through these
    rows: list[EventRow] = []
    for event in events_met(branch):
        place = int(np.searchsorted(arclength, event.arclength, side="right")) - 1
        after = min(max(place, 0), max(arclength.size - 2, 0))
        told = rows[-1].stable_after if rows and rows[-1].after == after else None
        before = bool(branch.stable[after]) if told is None else told
        critical = event.critical_multiplier()
        rows.append(
            EventRow(
                event.kind,
                after,
                event.omega,
                event.amplitude,
                residual=event.residual,
                multiplier=critical,
                multiplier_error=event.critical_error,
                stability_method=event.stability_method,
                criticality=event.criticality,
                stable_after=(
                    before if id(event) in own else not before and not _others_unstable(event.multipliers, critical)
                ),
                uncertainty=event.uncertainty,
                contact="" if event.contact is None else str(event.contact),
                contact_at=np.nan if event.contact is None else event.contact.parameter,
                parameters=dict(event.parameters),
            )
        )
    return rows


def _others_unstable(multipliers: np.ndarray, critical: complex) -> bool:
    """Whether multipliers other than the critical one (and its conjugate) lie outside the unit circle."""
    distance = np.minimum(np.abs(multipliers - critical), np.abs(multipliers - np.conj(critical)))
    skip = np.argsort(distance)[: 1 if abs(critical.imag) < 1e-6 * abs(critical) else 2]
    return bool(np.any(np.abs(np.delete(multipliers, skip)) > 1.0))


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


def _event_variables(
    events: Sequence[EventRow], names: Sequence[str], values: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    table = np.array(
        [[row.parameters.get(name, values[name][row.after]) for name in names] for row in events], dtype=float
    ).reshape(len(events), len(names))
    return {
        "event_kind": ("event", np.array([row.kind for row in events], dtype=object)),
        "event_after": ("event", np.array([row.after for row in events], dtype=int)),
        "event_omega": ("event", np.array([row.omega for row in events], dtype=float)),
        "event_amplitude": ("event", np.array([row.amplitude for row in events], dtype=float)),
        "event_residual": ("event", np.array([row.residual for row in events], dtype=float)),
        "event_uncertainty": (
            "event",
            np.array([row.uncertainty for row in events], dtype=float),
            {"long_name": "half-width in the free parameter of what is not resolved of an event, else 0"},
        ),
        "event_contact": (
            "event",
            np.array([row.contact for row in events], dtype=object),
            {"long_name": "the contact that grazes; empty at a smooth bifurcation"},
        ),
        "event_contact_at": (
            "event",
            np.array([row.contact_at for row in events], dtype=float),
            {"long_name": "value of the free parameter at which that contact grazes"},
        ),
        "event_multiplier": (
            "event",
            np.array([row.multiplier for row in events], dtype=complex),
            {"long_name": "the multiplier that crosses the unit circle"},
        ),
        "event_multiplier_error": (
            "event",
            np.array([row.multiplier_error for row in events], dtype=float),
            {"long_name": "its estimated error"},
        ),
        "event_stability_method": ("event", np.array([row.stability_method for row in events], dtype=object)),
        "event_criticality": ("event", np.array([row.criticality or "" for row in events], dtype=object)),
        "event_stable_after": (
            "event",
            np.array([UNKNOWN if row.stable_after is None else int(row.stable_after) for row in events], dtype=np.int8),
            {"long_name": "motions right after it are stable: 1, unstable: 0, not known: -1"},
        ),
        "event_parameters": (("event", "parameter"), table),
    }
