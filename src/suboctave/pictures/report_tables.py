"""Tables and sentences of a report page, as plain texts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.kinds import KINDS
from suboctave.pictures import style
from suboctave.pictures.boundary import is_boundary, kind_of, plane_of
from suboctave.pictures.isolas import parameter_of
from suboctave.pictures.periods import period_name, period_of
from suboctave.pictures.words import fixed_parameters, spelt
from suboctave.store.columns import parameter_column
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray


_TEXT = "text"
#: attributes of a dataset that have a place of their own on the page, or none
_PLACED = {"layout", "suboctave", "system", "free", "ended", "closed", "period", "observed_dof", "dofs", "warnings"}
_PLACED |= {"record", "digest", "contents", "tracked", "plane", "isola", "at"}
#: characters of an attribute from which it is folded away, and of a row of a table that stands beside its figure
_LONG, _BESIDE = 400, 56


@dataclass(frozen=True)
class Table:
    """Headings with their class ("", "text", "long"), and the cells of each row."""

    head: Sequence[tuple[str, str]]
    rows: Sequence[Sequence[str]]

    @property
    def wide(self) -> bool:
        """Whether there is no room for it beside a figure."""
        columns = zip([name for name, _ in self.head], *self.rows, strict=True)
        return sum(max(len(text) for text in column) for column in columns) > _BESIDE


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
    free = [name for name in names if name != "omega"]
    values = [coordinate(dataset, name)[1] for name in free]
    columns = {name: dataset[f"event_{name}"].to_numpy() for name in ("kind", "omega", "amplitude", "multiplier")}
    residual, remarks = dataset["event_residual"].to_numpy(), _remarks(dataset)
    own = ("kind", "ω", "max |x|", "multiplier", "residual", "remark")
    head = [("kind", _TEXT), ("ω", ""), *((parameter_column(name, own), "") for name in free)]
    head += [("max |x|", ""), ("multiplier", ""), ("residual", "")] + ([("remark", "long")] if any(remarks) else [])
    rows = []
    for i, remark in enumerate(remarks):
        kind = str(columns["kind"][i])
        name = style.kind_style(kind).name
        row = [f"{kind} ({name})" if kind.isupper() and name != kind else name, f"{columns['omega'][i]:.9g}"]
        row += [f"{value[i]:.9g}" for value in values]
        row += [f"{columns['amplitude'][i]:.7g}", _number(complex(columns["multiplier"][i])), _small(residual[i])]
        rows.append(row + ([remark] if any(remarks) else []))
    return Table(head, rows)


def _remarks(dataset: xarray.Dataset) -> list[str]:
    varied = spelt(str(dataset.attrs["free"]))
    doubt = dataset["event_uncertainty"].to_numpy()
    nothing = np.full(doubt.shape, "")
    extreme = dataset["event_extreme"].to_numpy() if "event_extreme" in dataset else nothing
    contact, critical = dataset["event_contact"].to_numpy(), dataset["event_criticality"].to_numpy()
    remarks = []
    for i in range(len(doubt)):
        words = [str(extreme[i]), str(critical[i]), f"± {doubt[i]:.0e} in {varied}" if doubt[i] else ""]
        words.append(f"contact: {contact[i]}" if str(contact[i]) else "")
        remarks.append("; ".join(filter(None, words)))
    return remarks


def notes_on(dataset: xarray.Dataset) -> list[str]:
    """What the reader must know: warnings, and what stayed unsettled."""
    notes = [note for note in str(dataset.attrs.get("warnings", "")).splitlines() if note.strip()]
    if "multiplier_errors" in dataset and dataset.sizes.get("multiplier"):
        near = np.abs(np.abs(dataset["multipliers"].to_numpy()) - 1.0) <= dataset["multiplier_errors"].to_numpy()
        which = "a multiplier"
        if is_boundary(dataset):  # one of them, or a pair, is on the circle all along
            near &= ~_critical_multipliers(dataset)
            which = "a multiplier besides the critical one"
        open_points = int(np.count_nonzero(near.any(axis=1)))
        if open_points:
            notes.append(
                f"Unsettled: at {open_points} of {near.shape[0]} points {which} is closer to the unit circle than "
                "its estimated error, so that the verdict there could be the other one."
            )
    doubtful = int(np.count_nonzero(dataset["event_uncertainty"].to_numpy() > 0.0))
    if doubtful:
        what = "bifurcation is" if doubtful == 1 else "bifurcations are"
        notes.append(f"{doubtful} {what} located to a stated uncertainty: see the remarks in the table.")
    return notes


def _critical_multipliers(dataset: xarray.Dataset) -> np.ndarray:
    """Which multipliers are those that make the points bifurcations, (points, multipliers), bool: one at LP, BP and PD,
    a pair at NS, none at grazings.
    """
    mu, kind = dataset["multipliers"].to_numpy(), kind_of(dataset)
    critical = np.zeros(mu.shape, dtype=bool)
    target, count = KINDS[kind].multiplier, KINDS[kind].critical
    # a pair that becomes real in a resonance is at the circle still
    distance = np.abs(np.abs(mu) - 1.0) if target is None else np.abs(mu - target)
    distance = np.where(np.isnan(distance), np.inf, distance)
    rows = np.arange(len(mu))
    for place in np.argsort(distance, axis=1, kind="stable")[:, :count].T:
        critical[rows, place] = True
    return critical


def origin_of(dataset: xarray.Dataset) -> list[tuple[str, str]]:
    """Where the numbers of a curve come from, by name."""
    attrs = dataset.attrs
    free = plane_of(dataset) if is_boundary(dataset) else (str(attrs["free"]),)
    # omega that does not change although it is free stands at its points
    fixed = [f"{n} = {v:.9g}" for n, v in fixed_parameters(dataset).items() if n not in map(spelt, free)]
    pairs = [
        ("computed by", f"suboctave {attrs.get('suboctave', '(unknown version)')}"),
        ("system", str(attrs.get("system") or "(no name)")),
        ("degrees of freedom", f"{attrs.get('dofs', 1)}, observed: {attrs.get('observed_dof', 0)}"),
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
    return pairs + [pair for pair in _attributes(dataset) if not _is_long(pair[1])]


def records_of(dataset: xarray.Dataset) -> list[tuple[str, str]]:
    """Attributes of a curve that are too long for a line, by name."""
    return [pair for pair in _attributes(dataset) if _is_long(pair[1])]


def _is_long(text: str) -> bool:
    return len(text) > _LONG or "\n" in text


def _attributes(dataset: xarray.Dataset) -> list[tuple[str, str]]:
    """The attributes of a curve that have no place elsewhere, as texts."""
    pairs = []
    for name, value in dataset.attrs.items():
        if name == "seconds":
            if _is_finite(value):
                pairs.append(("time taken", f"{float(value):.3g} s"))
        elif name not in _PLACED and str(value):
            pairs.append((str(name), str(value)))
    return pairs


def isolas_table(head: xarray.Dataset) -> Table | None:
    """One row for each isola; None where there are none."""
    if not head.sizes["isola"]:
        return None
    names = [("isola", ""), ("period", _TEXT), (f"{parameter_of(head)} from", ""), ("to", "")]
    names += [("born at", ""), ("ω", ""), ("merges at", ""), ("ω", "")]
    keys = ("from", "to", "born", "born_omega", "merges", "merges_omega")
    values = np.array([head[key].to_numpy() for key in keys], dtype=float).T
    rows = [
        [str(i), period_name(int(nu)), *(f"{v:.9g}" if np.isfinite(v) else "–" for v in own)]
        for i, (nu, own) in enumerate(zip(head["period"].to_numpy(), values, strict=True))
    ]
    return Table(names, rows)


def notes_on_isolas(head: xarray.Dataset) -> tuple[list[str], list[str]]:
    """What happens at the ends of isolas, and what stayed open."""
    name, sentences = parameter_of(head), []
    for number, reasons in enumerate(zip(head["at_from"].to_numpy(), head["at_to"].to_numpy(), strict=True)):
        for key, reason in zip(("from", "to"), reasons, strict=True):
            sentences.append(f"Isola {number}, {name} = {float(head[key].to_numpy()[number]):.7g}: {reason}.")
    notes = [f"Isola {i}: {note}" for i, text in enumerate(head["notes"].to_numpy()) for note in str(text).splitlines()]
    return sentences, notes + str(head.attrs.get("notes", "")).splitlines()


def columns_of(dataset: xarray.Dataset) -> Table:
    """A result that is no curve: its columns as they are."""
    columns = {str(name): data.to_numpy() for name, data in dataset.data_vars.items() if data.dims == ("row",)}
    kinds = [_TEXT if column.dtype.kind in "OU" else "" for column in columns.values()]
    rows = [[_cell(column[i]) for column in columns.values()] for i in range(dataset.sizes["row"])]
    return Table(list(zip(columns, kinds, strict=True)), rows)


def _cell(value: Any) -> str:
    if isinstance(value, complex | np.complexfloating):
        return _number(complex(value))
    return f"{float(value):.9g}" if isinstance(value, float | np.floating) else str(value)


def _number(value: complex) -> str:
    """A complex number, its imaginary part where it has one."""
    if not np.isfinite(value):
        return "–"
    return f"{value.real:.6f}" + (f" {value.imag:+.6f}i" if abs(value.imag) > 1e-7 else "")


def _small(value: float) -> str:
    """A residual or an error."""
    return f"{value:.1e}" if math.isfinite(value) else "–"


def _is_finite(value: Any) -> bool:
    try:
        return math.isfinite(float(value))
    except (TypeError, ValueError, OverflowError):
        return False
