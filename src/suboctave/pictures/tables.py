"""What a report page says of results beside figures: tables, sentences, notes, origins, as plain texts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.boundary import kind_of, parameter_of, plane_of
from suboctave.pictures.given import is_boundary
from suboctave.pictures.options import dof_names_of, units_of_dof
from suboctave.pictures.strokes import fixed_parameters, number_of, spelt
from suboctave.pictures.style import period_name, period_of
from suboctave.store.layout import coordinate, parameter_column
from suboctave.units import UnitSystem

if TYPE_CHECKING:
    import xarray


_TEXT = "text"
#: attributes of a dataset that have a place of their own on the page, or none
_PLACED = {"layout", "suboctave", "system", "free", "ended", "closed", "period", "observed_dof", "dofs", "dof_names"}
_PLACED |= {"warnings", "units", "dofs_left_out", "record", "digest", "contents", "tracked", "plane", "isola", "at"}
_PLACED |= {"seconds", "number", "early"}
#: characters of an attribute from which it is folded away, and of a row of a table that stands beside its figure
_LONG, _BESIDE = 400, 56
#: rows of a table that are on the page
_ROWS = 1000


@dataclass(frozen=True)
class Table:
    """Columns: heading, class ("", "text", "long"), and the cells; `places`: of rows that are points or events of a
    curve which, "curve:vertex", as in `drawing`.
    """

    columns: Sequence[tuple[str, str, Sequence[str]]]
    places: Sequence[str] = ()

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """The cells row by row."""
        return list(zip(*(cells for _, _, cells in self.columns), strict=True))

    @property
    def wide(self) -> bool:
        """Whether there is no room for it beside a figure."""
        return sum(max(map(len, (heading, *cells))) for heading, _, cells in self.columns) > _BESIDE


def summary_of(dataset: xarray.Dataset) -> str:
    """How many points a curve has, how many of them are unstable, of which period, and why it ends."""
    count, unstable, nu = dataset.sizes["point"], "", period_of(dataset)
    bounds = is_boundary(dataset)
    if "stable" in dataset:
        number = int(np.count_nonzero(~dataset["stable"].to_numpy().astype(bool)))
        unstable = f", {number} within unstable motions" if bounds else f", {number} of them unstable"
    kind = kind_of(dataset) if bounds else ""
    begin = f"curve of bifurcations of the kind {kind} ({style.kind_style(kind).name}): " if bounds else ""
    motions = f"; motions of {nu} periods of the force" if nu > 1 else ""
    ended = f"; {dataset.attrs['ended']}" if dataset.attrs.get("ended") else ""
    return f"{begin}{count} points{unstable}{motions}{ended}"


def bifurcations(dataset: xarray.Dataset) -> Table:
    """The located events of a curve, in the order met."""
    names = plane_of(dataset) if is_boundary(dataset) else (str(dataset.attrs["free"]),)
    units, label = UnitSystem.of(str(dataset.attrs.get("units", ""))), observed_label(dataset)
    heads = "ω", f"max |{label}|"
    if units is not None:
        own_units = units_of_dof([dataset]) or units
        heads = f"ω ({units.frequency})", f"max |{label}| ({own_units.length})"
    own, remarks = ("kind", *heads, "multiplier", "residual", "remark"), _remarks(dataset)
    kinds, omega, amplitude, multiplier, residual = (
        dataset[f"event_{name}"].to_numpy() for name in ("kind", "omega", "amplitude", "multiplier", "residual")
    )
    words = [(kind, style.kind_style(kind).name) for kind in map(str, kinds)]
    columns: list[tuple[str, str, Sequence[str]]] = [
        ("kind", _TEXT, [f"{k} ({n})" if k.isupper() and n != k else n for k, n in words]),
        (heads[0], "", _texts(omega)),
        *([(units.cycles, "", _texts(omega / (2.0 * math.pi), 7))] if units is not None else ()),
        *((parameter_column(n, own), "", _texts(coordinate(dataset, n)[1])) for n in names if n != "omega"),
        (heads[1], "", _texts(amplitude, 7)),
        ("multiplier", "", [_number(complex(mu)) for mu in multiplier]),
        ("residual", "", [_small(value) for value in residual]),
    ]
    number = number_of(dataset)
    places = [f"{number}:{-1 - event}" for event in range(len(kinds))] if number >= 0 else []
    return Table([*columns, ("remark", "long", remarks)] if any(remarks) else columns, places)


def observed_label(dataset: xarray.Dataset) -> str:
    """What the observed displacement of a curve is called."""
    place, names = int(dataset.attrs.get("observed_dof", 0)), dof_names_of(dataset)
    return names[place] if place < len(names) else "x" if int(dataset.attrs.get("dofs", 1)) == 1 else f"x_{place}"


def _remarks(dataset: xarray.Dataset) -> list[str]:
    varied = spelt(str(dataset.attrs["free"]))
    doubt = dataset["event_uncertainty"].to_numpy()
    texts = [
        dataset["event_extreme"].to_numpy() if "event_extreme" in dataset else np.full(doubt.shape, ""),
        dataset["event_criticality"].to_numpy(),
        [f"± {value:.0e} in {varied}" if value else "" for value in doubt],
        [f"contact: {contact}" if str(contact) else "" for contact in dataset["event_contact"].to_numpy()],
    ]
    return ["; ".join(filter(None, map(str, words))) for words in zip(*texts, strict=True)]


def notes_on(dataset: xarray.Dataset) -> list[str]:
    """What the reader must know: warnings, and what stayed unsettled."""
    notes = [note for note in str(dataset.attrs.get("warnings", "")).splitlines() if note.strip()]
    if dataset.attrs.get("early"):
        notes.append(f"Ended before its end: {dataset.attrs.get('ended', '')}.")
    if "multiplier_open" in dataset:
        near = dataset["multiplier_open"].to_numpy().astype(bool)
        open_points = int(np.count_nonzero(near.any(axis=-1)))
        if open_points:
            which = "a multiplier besides the critical one" if is_boundary(dataset) else "a multiplier"
            notes.append(
                f"Unsettled: at {open_points} of {near.shape[0]} points {which} is closer to the unit circle than "
                "its estimated error, so that the verdict there could be the other one."
            )
    return notes


def origin_of(dataset: xarray.Dataset) -> list[tuple[str, str]]:
    """Where the numbers of a curve come from, by name."""
    attrs = dataset.attrs
    free = plane_of(dataset) if is_boundary(dataset) else (str(attrs["free"]),)
    # omega that does not change although it is free stands at its points
    fixed = [f"{n} = {v:.9g}" for n, v in fixed_parameters(dataset).items() if n not in map(spelt, free)]
    pairs = [
        ("computed by", f"suboctave {attrs.get('suboctave', '(unknown version)')}"),
        ("system", str(attrs.get("system") or "(no name)")),
        *([("units", str(attrs["units"]))] if attrs.get("units") else []),
        ("degrees of freedom", f"{attrs.get('dofs', 1)}, observed: {observed_label(dataset)}"),
        ("free parameter", " and ".join(map(spelt, free))),
        ("fixed parameters", ", ".join(fixed) or "none"),
    ]
    if "harmonics" in dataset:
        used = dataset["harmonics"].to_numpy()
        pairs.append(("harmonics used", f"{used.min()} to {used.max()}" if np.ptp(used) else f"{used[0]}"))
    for name, words in (("error", "largest neglected part of the motion"), ("residual", "largest residual")):
        if name in dataset:
            pairs.append((words, _small(float(np.nanmax(dataset[name].to_numpy())))))
    if "stability_method" in dataset:
        methods = dict.fromkeys(str(method) for method in dataset["stability_method"].to_numpy())
        pairs.append(("stability from", "; ".join(methods)))
    return pairs + [*filter(_fits, _attributes(dataset))]


def records_of(dataset: xarray.Dataset) -> list[tuple[str, str]]:
    """Attributes of a curve that are too long for a line, by name."""
    return [pair for pair in _attributes(dataset) if not _fits(pair)]


def _fits(pair: tuple[str, str]) -> bool:
    return len(pair[1]) <= _LONG and "\n" not in pair[1]


def _attributes(dataset: xarray.Dataset) -> list[tuple[str, str]]:
    """The attributes of a curve that have no place elsewhere, as texts."""
    seconds = float(dataset.attrs.get("seconds", math.nan))
    taken = [("time taken", f"{seconds:.3g} s")] if math.isfinite(seconds) else []
    return taken + [(str(name), str(v)) for name, v in dataset.attrs.items() if name not in _PLACED and str(v)]


def isolas_table(head: xarray.Dataset, closed: Mapping[str, xarray.Dataset] | None = None) -> Table | None:
    """One row for each isola, which leads to the first of its closed branches; None where there are none."""
    if not head.sizes["isola"]:
        return None
    units = next((UnitSystem.of(str(data.attrs.get("units", ""))) for data in (closed or {}).values()), None)
    omega = "ω" if units is None else f"ω ({units.frequency})"
    headings = (f"{parameter_of(head)} from", "to", "born at", omega, "merges at", omega)
    keys = ("from", "to", "born", "born_omega", "merges", "merges_omega")
    places = [""] * head.sizes["isola"]
    for dataset in reversed([*(closed or {}).values()]):
        highest = int(np.argmax(dataset["amplitude"].to_numpy()))
        places[int(dataset.attrs["isola"])] = f"{number_of(dataset)}:{highest}"
    return Table(
        [
            ("isola", "", [str(i) for i in range(head.sizes["isola"])]),
            ("period", _TEXT, [period_name(int(nu)) for nu in head["period"].to_numpy()]),
            *((name, "", _texts(head[key].to_numpy())) for name, key in zip(headings, keys, strict=True)),
        ],
        places,
    )


def notes_on_isolas(head: xarray.Dataset) -> tuple[list[str], list[str]]:
    """What happens at the ends of isolas, and what stayed open."""
    name = parameter_of(head)
    sentences = [
        f"Isola {number}, {name} = {float(head[key][number]):.7g}: {reason}."
        for number in range(head.sizes["isola"])
        for key in ("from", "to")
        for reason in [head[f"at_{key}"].to_numpy()[number]]
    ]
    notes = [f"Isola {i}: {note}" for i, text in enumerate(head["notes"].to_numpy()) for note in str(text).splitlines()]
    return sentences, notes + str(head.attrs.get("notes", "")).splitlines()


def columns_of(dataset: xarray.Dataset) -> tuple[Table, list[str]]:
    """A result that is no curve: its columns as they are, the first rows of many; and what is not shown, in words."""
    columns = {str(name): data.to_numpy() for name, data in dataset.data_vars.items() if data.dims == ("row",)}
    count = dataset.sizes["row"]
    note = [f"The first {_ROWS} of {count} rows; results files and CSV have all."] if count > _ROWS else []
    shown = {name: column[:_ROWS] for name, column in columns.items()}
    return Table([(n, _TEXT if c.dtype.kind in "OU" else "", [_cell(v) for v in c]) for n, c in shown.items()]), note


def _texts(values: np.ndarray, digits: int = 9) -> list[str]:
    return [f"{value:.{digits}g}" if np.isfinite(value) else "–" for value in values]


def _cell(value: Any) -> str:
    if isinstance(value, complex | np.complexfloating):
        return _number(complex(value))
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return "–" if math.isnan(value) else f"{float(value):.9g}"
    return str(value)


def _number(value: complex) -> str:
    """A complex number, its imaginary part where it has one."""
    if not np.isfinite(value):
        return "–"
    return f"{value.real:.6f}" + (f" {value.imag:+.6f}i" if abs(value.imag) > 1e-7 else "")


def _small(value: float) -> str:
    """A residual or an error."""
    return f"{value:.1e}" if math.isfinite(value) else "–"
