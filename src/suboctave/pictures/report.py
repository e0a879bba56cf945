"""One page per study: interactive figures, tables of bifurcations, and where the numbers come from.

The page is a single file that needs no network. Without scripts (and on paper) it shows still pictures; its tables and
texts need none. It is written by the template `templates/page.html`, which escapes everything that comes from a user.
"""

from __future__ import annotations

import base64
import functools
import gzip
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.atomic import free_place, replace_file
from suboctave.errors import InputError, shortened
from suboctave.kinds import KINDS
from suboctave.pictures import style
from suboctave.pictures.boundary import (
    boundary_drawing,
    boundary_names,
    is_boundary,
    is_isolas,
    kind_of,
    parameter_of,
    plane_of,
    space_drawing,
)
from suboctave.pictures.browser import figure_data
from suboctave.pictures.drawing import Drawing
from suboctave.pictures.paper import figure_of, image_of
from suboctave.pictures.response import response_drawing
from suboctave.pictures.strokes import fixed_parameters, spelt
from suboctave.pictures.style import period_name, period_of
from suboctave.store.layout import check_layout, coordinate, parameter_column
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray


#: inches of a still picture in the plane and in space
_SIZE, _SIZE_IN_SPACE = (6.4, 4.2), (6.4, 4.8)


@dataclass(frozen=True)
class Figure:
    """One figure: data for the browser, the still picture (SVG, base64), words for those who see neither."""

    data: dict[str, Any]
    still: str
    words: str


@dataclass
class Section:
    """A part of the page: sentences before and after a table, notes, figures, a tree of branches, and curves: heading,
    figure, and the dataset, of which the template reads tables and sentences.
    """

    heading: str
    anchor: str = ""
    before: Sequence[str] = ()
    table: Table | None = None
    after: Sequence[str] = ()
    notes: Sequence[str] = ()
    figures: Sequence[Figure] = ()
    tree: str = ""
    curves: Sequence[tuple[str, Figure, xarray.Dataset]] = ()


def write_report(
    results: Mapping[str, Any], path: str | Path, *, title: str = "Study", overwrite: bool = False
) -> Path:
    """Write the report page of a study.

    Parameters
    ----------
    results
        Names of analyses and their curves: datasets (`to_xarray`), branches, bifurcation diagrams, or isolas. Datasets
        on the dimension `row` are shown as tables.
    path
        A file ending in .html or .htm; written beside its place and renamed.
    title
        Heading of the page.
    overwrite
        Whether an existing file is replaced.

    Raises
    ------
    InputError
        If there is nothing to show, or the file exists and is not to be replaced, or cannot be written there.
    """
    target = free_place(path, overwrite, (".html", ".htm"))
    if not isinstance(results, Mapping):
        raise InputError(f"results must be a mapping {{name: curve}}, not {shortened(results)}")
    if not results:
        raise InputError("a report needs at least one result")
    datasets = {str(name): _datasets(str(name), item) for name, item in results.items()}
    alone = {name: next(iter(own.values())) for name, own in datasets.items() if list(own) == [""]}
    anchors = {name: f"part-{index}" for index, name in enumerate(datasets)}
    sections = list(_overviews({name: data for name, data in alone.items() if _has_points(data)}))
    for name, item in zip(datasets, results.values(), strict=True):
        section = _section(name, datasets[name], item)
        section.anchor = anchors[name]
        sections.append(section)
    every = [dataset for own in datasets.values() for dataset in own.values()]
    versions = sorted({str(data.attrs["suboctave"]) for data in every if "suboctave" in data.attrs})
    systems = dict.fromkeys(str(data.attrs["system"]) for data in every if data.attrs.get("system"))
    text = _template().render(
        title=str(title),
        version=__version__,
        origin=" · ".join([f"suboctave {', '.join(versions) or __version__}", *systems]),
        links=[(anchors[name], name) for name in datasets] if len(datasets) > 1 else [],
        sections=sections,
        plotly=_plotly() if any(section.figures or section.curves for section in sections) else "",
    )
    replace_file(target, lambda place: place.write_text(text, encoding="utf-8"))
    return target


@functools.cache
def _template() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("suboctave.pictures", "templates")
    page = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    readers = (is_boundary, summary_of, bifurcations, notes_on, origin_of, records_of)
    page.globals |= {reader.__name__: reader for reader in readers}
    page.policies["json.dumps_kwargs"] = {"ensure_ascii": False, "separators": (",", ":")}
    return page.get_template("page.html")


@functools.cache
def _plotly() -> str:
    """Plotly's script for browsers, packed (gzip, base64): a third of its size, and the page needs no network."""
    from plotly.offline import get_plotlyjs

    return base64.b64encode(gzip.compress(get_plotlyjs().encode("utf-8"), 9, mtime=0)).decode("ascii")


# ------------------------------------------------------------------------------------------------------------- contents
def _datasets(name: str, item: Any) -> dict[str, xarray.Dataset]:
    """The datasets of a result by their names; the only one of a curve or a table has none."""
    import xarray

    given: Any = item.to_xarray() if hasattr(item, "to_xarray") and not isinstance(item, xarray.Dataset) else item
    every = given if isinstance(given, dict) and given else {"": given}
    for dataset in every.values():
        if not isinstance(dataset, xarray.Dataset):
            raise InputError(
                f"{name}: expected a dataset of a curve, got {type(dataset).__name__}; a branch has to_xarray()"
            )
        if not is_isolas(dataset) and ("row" not in dataset.sizes or "point" in dataset.sizes):
            check_layout(dataset.attrs)
    return {str(label): dataset for label, dataset in every.items()}


def _has_points(dataset: xarray.Dataset) -> bool:
    return bool(dataset.sizes.get("point", 0))


def _section(name: str, datasets: Mapping[str, xarray.Dataset], item: Any) -> Section:
    head = next((dataset for dataset in datasets.values() if is_isolas(dataset)), None)
    curves = {label: dataset for label, dataset in datasets.items() if not is_isolas(dataset)}
    if head is not None:
        return _isolas(name, head, curves)
    if list(curves) != [""]:  # all curves in one figure, the tree, and each branch by itself
        figure = _responses(curves, getattr(item, "legend", None))
        each = [_curve(label, data, f"{name}, branch {label}") for label, data in curves.items()]
        return Section(name, figures=[figure], tree=str(item), curves=each)
    (dataset,) = curves.values()
    if _has_points(dataset):
        return Section(name, curves=[_curve(name, dataset)])
    if "row" not in dataset.sizes:
        return Section(name, before=["a curve without points"])
    heading = str(dataset.attrs.get("title", ""))
    return Section(name, before=[heading] if heading else [], table=columns_of(dataset))


def _isolas(name: str, head: xarray.Dataset, curves: Mapping[str, xarray.Dataset]) -> Section:
    """Table and sentences; the regions in the plane, the surfaces where branches are known; each curve by itself."""
    parameter, figures = parameter_of(head), []
    bounds = {label: data for label, data in curves.items() if is_boundary(data)}
    closed = {label: data for label, data in curves.items() if label not in bounds}
    file_name = _file_name([name])
    if bounds:
        words = f"Isolas over ω and {parameter}"
        figures.append(_figure(boundary_drawing([head, *bounds.values()]), file_name, words))
    if closed:
        periods = {int(nu) for nu in head["period"].to_numpy()}
        own = {k: c for k, c in bounds.items() if kind_of(c) == "LP" and period_of(c) in periods}
        group = {"isolas": head, **own, **closed}
        drawing = space_drawing(list(group.values()), x="omega", y=parameter, names=list(group))
        figures.append(_figure(drawing, f"{file_name}_space", f"Closed branches over ω and {parameter}"))
    each = [_curve(label, data, f"{name}, {label}") for label, data in {**bounds, **closed}.items()]
    sentences, notes = notes_on_isolas(head)
    texts: dict[str, Any] = {"before": [str(head.attrs.get("said", ""))], "after": sentences, "notes": notes}
    return Section(name, table=isolas_table(head), figures=figures, curves=each, **texts)


def _curve(name: str, dataset: xarray.Dataset, heading: str = "") -> tuple[str, Figure, xarray.Dataset]:
    draw = _boundaries if is_boundary(dataset) else _responses
    return heading, draw({name: dataset}), dataset


def _overviews(curves: Mapping[str, xarray.Dataset]) -> Iterator[Section]:
    """Curves that belong into one figure: responses over one parameter, boundaries of one plane, both in space."""
    groups: dict[tuple[Any, ...], dict[str, xarray.Dataset]] = {}
    planes: dict[tuple[str, str], dict[str, xarray.Dataset]] = {}
    for name, data in curves.items():
        if is_boundary(data):
            planes.setdefault(plane_of(data), {})[name] = data
        else:
            groups.setdefault((str(data.attrs["free"]), *_observed(data)), {})[name] = data
    for (free, *_), group in groups.items():
        if len(group) > 1:
            yield Section(f"All curves over {spelt(free)}", figures=[_responses(group, list(group))])
    for (first, second), bounds in planes.items():
        plane = f"{spelt(first)} and {spelt(second)}"
        if len(bounds) > 1:
            yield Section(f"Boundaries over {plane}", figures=[_boundaries(bounds)])
        observed = {_observed(data) for data in bounds.values()}
        near = [g for (free, *seen), g in groups.items() if free in (first, second) and tuple(seen) in observed]
        if near and len(observed) == 1:
            every = {**{name: data for group in near for name, data in group.items()}, **bounds}
            drawing = space_drawing(list(every.values()), x=first, y=second, names=list(every))
            heading = f"Response curves and boundaries over {plane}"
            yield Section(heading, figures=[_figure(drawing, _file_name(every), f"{heading}: {', '.join(every)}")])


def _observed(dataset: xarray.Dataset) -> tuple[int, int]:
    return int(dataset.attrs.get("dofs", 1)), int(dataset.attrs.get("observed_dof", 0))


# -------------------------------------------------------------------------------------------------------------- figures
def _responses(curves: Mapping[str, xarray.Dataset], labels: Sequence[str] | None = None) -> Figure:
    group = list(curves.values())
    free = str(group[0].attrs["free"])
    named = None if labels is None else [labels]
    drawing = response_drawing([group], x=free, labels=named, names=list(curves))
    return _figure(drawing, _file_name(curves), f"Amplitude over {spelt(free)}: {', '.join(curves)}")


def _boundaries(curves: Mapping[str, xarray.Dataset]) -> Figure:
    group = list(curves.values())
    kinds, plane = boundary_names(group), " and ".join(map(spelt, plane_of(group[0])))
    labels = [f"{name}: {kind}" for name, kind in zip(curves, kinds, strict=True)] if len(curves) > 1 else kinds
    return _figure(boundary_drawing(group, labels=labels), _file_name(curves), f"{', '.join(curves)}, over {plane}")


def _figure(drawing: Drawing, name: str, words: str) -> Figure:
    """A drawing for the browser and as a still picture."""
    sheet = style.sheet_of(_SIZE if len(drawing.axes) == 2 else _SIZE_IN_SPACE)
    still = base64.b64encode(image_of(figure_of(drawing, sheet), "svg")).decode("ascii")
    return Figure(figure_data(drawing, name), still, words)


def _file_name(names: Sequence[str] | Mapping[str, Any]) -> str:
    return re.sub(r"[^\w-]+", "_", "_".join(names))[:60] or "figure"


# --------------------------------------------------------------------------------- tables and sentences, as plain texts
_TEXT = "text"
#: attributes of a dataset that have a place of their own on the page, or none
_PLACED = {"layout", "suboctave", "system", "free", "ended", "closed", "period", "observed_dof", "dofs", "warnings"}
_PLACED |= {"record", "digest", "contents", "tracked", "plane", "isola", "at", "seconds"}
#: characters of an attribute from which it is folded away, and of a row of a table that stands beside its figure
_LONG, _BESIDE = 400, 56


@dataclass(frozen=True)
class Table:
    """Columns: heading, class ("", "text", "long"), and the cells."""

    columns: Sequence[tuple[str, str, Sequence[str]]]

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
    own, remarks = ("kind", "ω", "max |x|", "multiplier", "residual", "remark"), _remarks(dataset)
    kinds, omega, amplitude, multiplier, residual = (
        dataset[f"event_{name}"].to_numpy() for name in ("kind", "omega", "amplitude", "multiplier", "residual")
    )
    words = [(kind, style.kind_style(kind).name) for kind in map(str, kinds)]
    columns: list[tuple[str, str, Sequence[str]]] = [
        ("kind", _TEXT, [f"{k} ({n})" if k.isupper() and n != k else n for k, n in words]),
        ("ω", "", _texts(omega)),
        *((parameter_column(n, own), "", _texts(coordinate(dataset, n)[1])) for n in names if n != "omega"),
        ("max |x|", "", _texts(amplitude, 7)),
        ("multiplier", "", [_number(complex(mu)) for mu in multiplier]),
        ("residual", "", [_small(value) for value in residual]),
    ]
    return Table([*columns, ("remark", "long", remarks)] if any(remarks) else columns)


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
    mu, row = dataset["multipliers"].to_numpy(), KINDS[kind_of(dataset)]
    # a pair that becomes real in a resonance is at the circle still
    distance = np.abs(np.abs(mu) - 1.0) if row.multiplier is None else np.abs(mu - row.multiplier)
    nearest = np.argsort(np.where(np.isnan(distance), np.inf, distance), axis=1, kind="stable")[:, : row.critical]
    critical = np.zeros(mu.shape, dtype=bool)
    np.put_along_axis(critical, nearest, True, axis=1)
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


def isolas_table(head: xarray.Dataset) -> Table | None:
    """One row for each isola; None where there are none."""
    if not head.sizes["isola"]:
        return None
    headings = (f"{parameter_of(head)} from", "to", "born at", "ω", "merges at", "ω")
    keys = ("from", "to", "born", "born_omega", "merges", "merges_omega")
    return Table(
        [
            ("isola", "", [str(i) for i in range(head.sizes["isola"])]),
            ("period", _TEXT, [period_name(int(nu)) for nu in head["period"].to_numpy()]),
            *((name, "", _texts(head[key].to_numpy())) for name, key in zip(headings, keys, strict=True)),
        ]
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


def columns_of(dataset: xarray.Dataset) -> Table:
    """A result that is no curve: its columns as they are."""
    columns = {str(name): data.to_numpy() for name, data in dataset.data_vars.items() if data.dims == ("row",)}
    return Table([(n, _TEXT if c.dtype.kind in "OU" else "", [_cell(v) for v in c]) for n, c in columns.items()])


def _texts(values: np.ndarray, digits: int = 9) -> list[str]:
    return [f"{value:.{digits}g}" if np.isfinite(value) else "–" for value in values]


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
