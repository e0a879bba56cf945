"""How a computed curve is laid out as a labelled dataset: the one form that figures, files and tables share, and isolas
beside the curves that they were found on. docs/results.md describes dimensions, variables and attributes for readers.

`event_after` is the index of the point after which an event lies, so that the curve with its events is one line: point
`i`, the events with `event_after == i` in their order, point `i + 1`. A free parameter other than omega is a coordinate
as well. Read-offs that were asked for (`rms`, `velocity`, `harmonic_3`, ...; docs/pictures.md) are further variables on
`point`, each with its own on `event`.

Curves of bifurcations have the attributes `tracked`, their kind, and `plane`; `stable` means there that all multipliers
but the critical ones lie inside the unit circle.

A user may call a parameter "amplitude". In a table or dataset that has a column "amplitude" of its own it is called
"parameter.amplitude", which no parameter can be named; elsewhere by its own name.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.floquet.result import no_verdict
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray
    from numpy.typing import ArrayLike


def parameter_column(name: str, taken: Collection[str]) -> str:
    """The column of a parameter in a table whose other columns have the names `taken`."""
    return f"parameter.{name}" if name in taken else name


def with_units(
    frame: pandas.DataFrame, system: Any, observe: int | None = None, dimensions: Mapping[str, str] | None = None
) -> pandas.DataFrame:
    """A table with units in its heads, "omega (rad/s)", and a column of frequencies behind that of omega; as it is
    where no system declares any. `dimensions`: of columns that are no quantities of curves.
    """
    units = None if system is None else system.units
    if units is None:
        return frame
    if "omega" in frame:
        turns = frame["omega"] / (2.0 * np.pi)
        frame = frame.copy()
        frame.insert(list(frame.columns).index("omega") + 1, f"frequency ({units.cycles})", turns)
    known = {str(name): unit_of_column(str(name), system, observe, dimensions) for name in frame.columns}
    return frame.rename(columns={name: f"{name} ({unit})" for name, unit in known.items() if unit})


#: columns of states and of what is said of a degree of freedom: the number or the name of that last
_STATE, _OF_DOF = re.compile(r"([xv])_(.+)"), re.compile(r".+_dof(.+)")
#: dimension of displacements and velocities
_OF_STATES = {"x": "length", "v": "length / time"}


def unit_of_column(
    name: str, system: Any, observe: int | None = None, dimensions: Mapping[str, str] | None = None
) -> str:
    """The unit of omega, time, states and of what is read off motions, by the name of a column; empty for others,
    without units. What is said of no degree of freedom is said of the observed one.
    """
    units = system.units
    if units is None or name in system.parameters:
        return ""
    if name in ("omega", "time"):
        return str(units.frequency if name == "omega" else units.time)
    dof, names = system.observed_dof if observe is None else observe, list(system.dof_names)
    state, of_dof = _STATE.fullmatch(name), _OF_DOF.fullmatch(name)
    named = state[2] if state else of_dof[1] if of_dof else ""
    if named in names or named.isdigit():
        dof = names.index(named) if named in names else int(named)
    else:
        state = None
    what = max((q for q in QUANTITIES if name == q or name.startswith(f"{q}_")), key=len, default="")
    known = _OF_STATES[state[1]] if state else QUANTITIES[what].unit if what else ""
    dimension = (dimensions or {}).get(name, known)
    own = system.units_of(dof) if not what or QUANTITIES[what].of_dof else units
    return str(own.name(dimension)) if dimension else ""


def led_by(frame: pandas.DataFrame, leading: Mapping[str, Any]) -> pandas.DataFrame:
    """The table of one of several curves behind columns that say which it is; the others there are parameters'."""
    frame = frame.rename(columns={name: parameter_column(name, leading) for name in frame.columns})
    for place, (name, value) in enumerate(leading.items()):
        frame.insert(place, name, value)
    return frame


# --------------------------------------------------------------------------------------------------------------- curves
LAYOUT = 1  # the number of this layout; it grows when a name or a meaning below changes
UNKNOWN = -1  # in event_stable_after
#: variables on `point` besides omega and the parameters: kind, meaning
_POINTS: dict[str, tuple[type, str]] = {
    "amplitude": (float, "max |x| over one response period"),
    "stable": (bool, "all Floquet multipliers inside the unit circle"),
    "harmonics": (int, "harmonics kept, up to harmonics * omega"),
    "error": (float, "relative size of the neglected harmonics of the force"),
    "residual": (float, "residual of the harmonic balance, relative"),
    "multipliers": (complex, "Floquet multipliers over the response period"),
    "multiplier_errors": (float, "estimated errors of the multipliers"),
    "multiplier_open": (bool, "multipliers within their errors of the unit circle, of those that decide on stability"),
    "stability_method": (object, "where the multipliers come from"),
}
RESERVED = frozenset(
    {*_POINTS, "point", "event", "parameter", "multiplier", "omega", "parameters", "coefficient"}
    # what files add, and their dimensions (`results/files.py`)
    | {"arclength", "iterations", "coefficients", "record", "unknown", "multipliers_real", "multipliers_imag"}
)
RESERVED_PREFIXES = ("event_", "system_array_")
#: attributes of a curve, with their defaults
_ATTRIBUTES: dict[str, Any] = {
    "system": "", "ended": "", "closed": 0, "period": 1, "observed_dof": 0, "dofs": 1, "dof_names": "",
}  # fmt: skip
#: variables on `event`, the fields of `EventRow` that all curves have: kind, meaning
_EVENTS: dict[str, tuple[type, str]] = {
    "kind": (object, ""),
    "after": (int, ""),
    "omega": (float, ""),
    "amplitude": (float, ""),
    "residual": (float, ""),
    "uncertainty": (float, "half-width in the free parameter of what is not resolved of an event, else 0"),
    "contact": (object, "the contact that grazes; empty at a smooth bifurcation"),
    "contact_at": (float, "value of the free parameter at which that contact grazes"),
    "multiplier": (complex, "the multiplier that crosses the unit circle"),
    "multiplier_error": (float, "its estimated error"),
    "stability_method": (object, ""),
    "criticality": (object, ""),
    "stable_after": (np.int8, "motions right after it are stable: 1, unstable: 0, not known: -1"),
}
#: where, along a curve of bifurcations, a multiplier other than the critical ones reaches the unit circle
_BY_ANOTHER = frozenset({"R1", "R2", "LPPD", "LPNS", "PDNS", "NSNS"})


@dataclass(frozen=True)
class EventRow:
    """One located bifurcation, as a row of the dataset.

    docs/results.md says what the fields mean; `parameters` holds those that differ from the curve's fixed ones.
    """

    kind: str
    after: int
    omega: float
    amplitude: float
    residual: float = np.nan
    multiplier: complex = complex(np.nan, np.nan)
    multiplier_error: float = np.nan
    stability_method: str = ""
    criticality: str = ""
    stable_after: int = UNKNOWN
    uncertainty: float = 0.0
    contact: str = ""
    contact_at: float = np.nan
    parameters: Mapping[str, float] = field(default_factory=dict)
    extreme: str = ""


def curve_dataset(
    omega: ArrayLike,
    amplitude: ArrayLike,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
    free: str = "omega",
    events: Sequence[EventRow] = (),
    options: Mapping[str, str | int | float] | None = None,
    **given: Any,
) -> xarray.Dataset:
    """A curve of periodic motions as a labelled dataset; docs/results.md describes the layout.

    `parameters`: each a number, or (points,) where it varies along the curve; `free` names the one that the curve was
    followed in. `given`: variables on `point`, (points, ...), and attributes; `options`: attributes that say how the
    curve was computed.
    """
    import xarray

    frequency = np.asarray(omega, dtype=float)
    values: dict[str, np.ndarray] = {
        n: np.full(frequency.size, value, dtype=float) for n, value in (parameters or {}).items()
    }
    columns = np.array([*values.values()]).reshape(len(values), frequency.size)
    variables: dict[str, Any] = {"parameters": (("point", "parameter"), columns.T)}
    given["amplitude"] = amplitude
    for name, (kind, meaning) in _POINTS.items():
        if given.get(name) is not None:
            rows: np.ndarray = np.asarray(given[name], dtype=kind)
            variables[name] = (("point", "multiplier")[: rows.ndim], rows, {"long_name": meaning})
    for name, (kind, meaning) in _EVENTS.items():
        column: np.ndarray = np.array([getattr(row, name) for row in events], dtype=kind)
        variables[f"event_{name}"] = ("event", column, {"long_name": meaning} if meaning else {})
    there = [[row.parameters.get(name, values[name][row.after]) for name in values] for row in events]
    table = np.array(there, dtype=float).reshape(len(events), len(values))
    variables["event_parameters"] = (("event", "parameter"), table)

    coords: dict[str, Any] = {
        "omega": ("point", frequency, {"long_name": "circular forcing frequency", "units": "rad per unit time"}),
        "parameter": ("parameter", np.array(list(values), dtype=object)),
    }
    if free != "omega":
        taken = (free,) if free in RESERVED or free.startswith(RESERVED_PREFIXES) else ()
        coords[parameter_column(free, taken)] = ("point", values[free].copy())
    own = {name: given.get(name, default) for name, default in _ATTRIBUTES.items()}
    attributes = {"layout": LAYOUT, "suboctave": __version__, "free": free, **own, **(options or {})}
    return xarray.Dataset(variables, coords, attributes)


def rotations_of(system: Any) -> dict[str, str]:
    """The attribute that says which degrees of freedom are angles; none where none are."""
    return {"rotations": "\n".join(map(str, sorted(system.rotations)))} if system.rotations else {}


# --------------------------------------------------------------------------------------------------------- a branch
def branch_dataset(branch: Any) -> xarray.Dataset:
    """A computed branch as a labelled dataset; docs/results.md describes the layout."""
    rows = _event_rows(branch)
    dataset = curve_dataset(
        branch.omega,
        branch.amplitude,
        **{name: getattr(branch, name) for name in ("stable", "harmonics")},
        **{name: getattr(branch, name) for name in ("multipliers", "multiplier_errors", "multiplier_open")},
        error=branch.truncation,
        residual=[orbit.residual for orbit in branch.orbits],
        stability_method=branch.stability_methods,
        parameters={name: branch.parameter(name) for name in branch.system.parameters},
        free=branch.name,
        events=rows,
        system=branch.system.name,
        ended=branch.ended,
        closed=int(branch.closed),
        period=branch.orbits[0].basis.nu if len(branch.orbits) else 1,
        observed_dof=branch.observe,
        dofs=branch.system.n,
        dof_names="\n".join(branch.system.dof_names),
        options={
            name: value if isinstance(value, str | int | float) else repr(value)
            for name, value in {**branch.options, "warnings": "\n".join(branch.warnings)}.items()
        },
    )
    if branch.shows != "response":
        dataset = dataset.assign_attrs(shows=branch.shows)
    if any(ending.early for ending in branch.endings):
        dataset = dataset.assign_attrs(early=1)
    if units := branch.system.units:
        dataset = dataset.assign_attrs(units=str(units), **rotations_of(branch.system))
        dataset["omega"].attrs["units"] = units.frequency
        dataset["amplitude"].attrs["units"] = branch.system.units_of(branch.observe).name(QUANTITIES["amplitude"].unit)
    kind = getattr(branch, "kind", None)
    if kind is None or branch.plane is None:
        return dataset
    meaning = {"long_name": "coefficient of the normal form: a of limit points, c3 of period doublings, else nan"}
    dataset = dataset.assign_attrs(tracked=str(kind), plane="\n".join(branch.plane))
    return dataset.assign(
        coefficient=("point", np.asarray(branch.coefficient, dtype=float), meaning),
        event_extreme=("event", np.array([row.extreme for row in rows], dtype=object)),
    )


def open_points(dataset: xarray.Dataset) -> np.ndarray:
    """At which points of a response the errors of multipliers are too large for a verdict, (point,), bool."""
    if dataset.attrs.get("tracked") or not {"multipliers", "multiplier_errors"} <= set(dataset.variables):
        return np.zeros(dataset.sizes["point"], dtype=bool)
    mu, errors = (dataset[name].to_numpy() for name in ("multipliers", "multiplier_errors"))
    return np.asarray(no_verdict(mu, errors).any(axis=1))


def events_met(branch: Any) -> list[Any]:
    """The branch's bifurcations, grazings and events in the order met: the rows of the dimension `event`."""
    return sorted([*branch.bifurcations, *branch.grazings, *branch.events], key=lambda event: event.arclength)


def _event_rows(branch: Any) -> list[EventRow]:
    """The branch's bifurcations, grazings and events in the order met, each with its place and the verdict after it."""
    own = {id(event) for event in (*branch.grazings, *branch.events)}  # stability goes on through these
    arclength = np.asarray(branch.arclength)
    same = ("kind", "omega", "amplitude", "residual", "stability_method", "uncertainty")
    rows: list[EventRow] = []
    for event in events_met(branch):
        place = int(np.searchsorted(arclength, event.arclength, side="right")) - 1
        after = min(max(place, 0), max(arclength.size - 2, 0))
        before = bool(rows[-1].stable_after if rows and rows[-1].after == after else branch.stable[after])
        given: dict[str, Any] = {name: getattr(event, name) for name in same}
        if event.contact is not None:
            given |= {"contact": str(event.contact), "contact_at": event.contact.parameter}
        if getattr(event, "extreme", ""):
            given["extreme"] = f"{event.extreme} of {event.parameter_name}"
        row = EventRow(
            after=after,
            parameters=dict(event.parameters),
            multiplier=event.critical_multiplier(),
            multiplier_error=event.critical_error,
            criticality=event.criticality or "",
            stable_after=_stable_after(branch, event, after, before, id(event) in own),
            **given,
        )
        rows.append(row)
    return rows


def _stable_after(branch: Any, event: Any, after: int, before: bool, own: bool) -> bool:
    """Whether the motions right after an event are stable; of a curve of bifurcations, all but its critical ones."""
    if getattr(event, "curve", ""):
        return bool(branch.stable[min(after + 1, len(branch.stable) - 1)]) if event.kind in _BY_ANOTHER else before
    if own:
        return before
    if before:
        return False
    # unless multipliers other than the critical one (and its conjugate) lie outside the unit circle
    multipliers, critical = event.multipliers, event.critical_multiplier()
    distance = np.minimum(np.abs(multipliers - critical), np.abs(multipliers - np.conj(critical)))
    skip = np.argsort(distance)[: 1 if abs(critical.imag) < 1e-6 * abs(critical) else 2]
    return not np.any(np.abs(np.delete(multipliers, skip)) > 1.0)


# ----------------------------------------------------------------------------------------------------- quantities
@dataclass(frozen=True)
class Quantity:
    """What is read off motions: its meaning and unit, and what an axis says.

    `axis` names what it needs: {x} the displacement of a DOF, {k} the number of a harmonic, {e} that of an element.
    """

    meaning: str
    unit: str
    axis: str

    @property
    def of_dof(self) -> bool:
        """Whether it is one of a degree of freedom."""
        return "{x}" in self.axis

    @property
    def numbered(self) -> str:
        """What it needs the number of, "harmonic" or "element"; else empty."""
        return "harmonic" if "{k}" in self.axis else "element" if "{e}" in self.axis else ""


QUANTITIES: Mapping[str, Quantity] = {
    "amplitude": Quantity("max |x| over a period", "length", r"amplitude $\max\,|{x}|$"),
    "rms": Quantity("root mean square of x", "length", r"RMS of ${x}$"),
    "peak_to_peak": Quantity("largest minus smallest x over a period", "length", r"peak to peak of ${x}$"),
    "about_mean": Quantity("max |x - mean of x| over a period", "length", r"amplitude of ${x}$ about the mean"),
    "velocity": Quantity("max |dx/dt| over a period", "length / time", r"velocity $\max\,|\dot{{{x}}}|$"),
    "velocity_rms": Quantity("root mean square of dx/dt", "length / time", r"RMS of $\dot{{{x}}}$"),
    "acceleration": Quantity("max |d2x/dt2| over a period", "length / time^2", r"acceleration $\max\,|\ddot{{{x}}}|$"),
    "acceleration_rms": Quantity("root mean square of d2x/dt2", "length / time^2", r"RMS of $\ddot{{{x}}}$"),
    "harmonic": Quantity("amplitude of x", "length", r"harmonic {k} of ${x}$"),
    "phase": Quantity("phase of x, negative where it lags", "rad", r"phase of harmonic {k} of ${x}$"),
    "peak_force": Quantity("largest |force| over a period", "force", "peak force, element {e}"),
    "contact_share": Quantity("share of the period in contact", "1", "share of period in contact, element {e}"),
    "impacts": Quantity("contacts begun per period of the motion", "1", "impacts per period, element {e}"),
    "transmitted_force": Quantity("largest |force| on the ground over a period", "force", "peak force on the ground"),
    "transmissibility": Quantity("force on the ground over force applied, first harmonics", "1", "transmissibility"),
    "energy": Quantity("mean kinetic and potential energy, zero at rest", "energy", "energy"),
    "action": Quantity("integral of momenta over displacements in a period, over 2 pi", "energy * time", "action"),
    "modal_amplitude": Quantity("sqrt(c . M c) of the amplitudes c at omega", "length * sqrt(mass)", "modal amplitude"),
    "damping_ratio": Quantity("work over a period in units of that of a damping 2 omega M", "1", "damping ratio"),
}


def reading_name(what: str, number: float | None = None, dof: int | str | None = None) -> str:
    """The name that a read-off is stored under: "velocity", "harmonic_3", "harmonic_0.5", "peak_force_0_dof1".

    `number` is exact in it: 1/3 is 0.3333333333333333.
    """
    if number is not None:
        short = f"{number:g}"
        what += f"_{short if float(short) == number else repr(float(number))}"
    return what if dof is None else f"{what}_dof{dof}"


def function_name(function: Any) -> str:
    """The name that a read-off by a function of a motion is stored under: its own, where no column has that."""
    name = getattr(function, "__name__", type(function).__name__)
    taken = name in QUANTITIES or name in RESERVED or name in ("multiplier_real", "multiplier_imag", "truncation")
    return f"function.{name.strip('<>')}" if taken or not name.isidentifier() else name


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


def check_layout(attributes: Mapping[Any, Any], what: str = "this dataset") -> None:
    """Raises InputError where the attributes of `what` state no layout, or one that this version does not know."""
    if "layout" not in attributes:
        raise InputError(f"{what} was not laid out by suboctave: it has no attribute 'layout'")
    layout = int(np.ravel(attributes["layout"])[0])
    if not 1 <= layout <= LAYOUT:
        which = f"newer than {LAYOUT}" if layout > LAYOUT else "which no version has written"
        raise InputError(
            f"{what} has layout {layout}, {which}: it was written by suboctave "
            f"{attributes.get('suboctave', '(unknown version)')}; update suboctave"
        )


# --------------------------------------------------------------------------------------------------------------- isolas
#: variables on `isola`: name, kind, meaning
ISOLA_COLUMNS: tuple[tuple[str, Any, str], ...] = (
    ("period", int, "load periods in one period of its motions"),
    ("from", float, "least value of the parameter at which it is detached"),
    ("to", float, "largest value of the parameter at which it is detached"),
    ("born", float, "value at which the closed branch shrinks to a point"),
    ("born_omega", float, "frequency there"),
    ("merges", float, "value at which it joins another branch"),
    ("merges_omega", float, "frequency there"),
    ("at_from", object, "what happens at the lower end of its range"),
    ("at_to", object, "what happens at the upper end of its range"),
    ("notes", object, "what could not be settled of it, one a line"),
)
_EDGES = ("edge_value", "edge_low", "edge_high")


def isolas_dataset(
    rows: Sequence[Mapping[str, Any]],
    edges: Sequence[np.ndarray],
    closed: Sequence[tuple[int, float]],
    attributes: Mapping[str, str | int | float],
) -> xarray.Dataset:
    """Isolas as a labelled dataset; docs/results.md describes the layout.

    `rows`: for each isola what `ISOLA_COLUMNS` names; `edges`: for each a table (places, 3) of value, lowest and
    highest frequency; `closed`: number and value of each closed branch.
    """
    import xarray

    variables: dict[str, Any] = {
        name: ("isola", np.array([row[name] for row in rows], dtype=kind), {"long_name": meaning})
        for name, kind, meaning in ISOLA_COLUMNS
    }
    table = np.concatenate([np.empty((0, 3)), *edges])
    variables["edge_isola"] = ("edge", np.repeat(np.arange(len(edges)), [len(part) for part in edges]).astype(int))
    variables |= {name: ("edge", table[:, i]) for i, name in enumerate(_EDGES)}
    variables["closed_isola"] = ("closed", np.array([number for number, _ in closed], dtype=int))
    variables["closed_at"] = ("closed", np.array([value for _, value in closed], dtype=float))
    return xarray.Dataset(variables, attrs={"layout": LAYOUT, "suboctave": __version__, **attributes})
