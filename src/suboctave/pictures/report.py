"""One page per study: interactive figures, what is known of every point of their curves, tables, and where numbers come
from.

The page is a single file that needs no network. Without scripts (and on paper) it shows still pictures; its tables and
texts need none. It is written by the template `templates/page.html`, which escapes everything that comes from a user;
the scripts beside it draw the figures, and fill the panel of a point that was chosen.
"""

from __future__ import annotations

import base64
import functools
import gzip
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.arguments import checked
from suboctave.atomic import free_place, replace_file
from suboctave.errors import InputError, shortened
from suboctave.pictures import style
from suboctave.pictures.boundary import boundary_drawing, boundary_names, kind_of, parameter_of, plane_of, space_drawing
from suboctave.pictures.browser import figure_data
from suboctave.pictures.drawing import Drawing, Polyline
from suboctave.pictures.given import is_boundary, is_isolas
from suboctave.pictures.paper import drawing_of, figure_of, image_of
from suboctave.pictures.points import Verified, curve_data, verified_by
from suboctave.pictures.response import response_drawing
from suboctave.pictures.strokes import hover_of, number_of, spelt
from suboctave.pictures.style import Pen, period_of
from suboctave.pictures.tables import (
    Table,
    bifurcations,
    columns_of,
    isolas_table,
    notes_on,
    notes_on_isolas,
    origin_of,
    records_of,
    summary_of,
)
from suboctave.store.layout import check_layout, coordinate
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray


#: inches of a still picture in the plane and in space
_SIZE, _SIZE_IN_SPACE = (6.4, 4.2), (6.4, 4.8)


@dataclass(frozen=True)
class Figure:
    """One figure: data for the browser, None where it is a still picture only; this (SVG, base64); and words for those
    who see neither.
    """

    data: dict[str, Any] | None
    still: str
    words: str


@dataclass(frozen=True)
class Curve:
    """A curve on the page: heading, figure, its dataset, and where it stands."""

    heading: str
    figure: Figure
    dataset: xarray.Dataset

    @property
    def anchor(self) -> str:
        """Where links lead to."""
        return f"curve-{number_of(self.dataset)}"


@dataclass
class Section:
    """A part of the page: sentences before and after a table, notes, figures, a tree of branches, and curves."""

    heading: str
    anchor: str = ""
    before: Sequence[str] = ()
    table: Table | None = None
    after: Sequence[str] = ()
    notes: Sequence[str] = ()
    figures: Sequence[Figure] = ()
    tree: str = ""
    curves: Sequence[Curve] = ()


@dataclass
class Found:
    """The results of a study as the page shows them: their datasets by name, pictures of what is no curve, checks."""

    datasets: dict[str, dict[str, xarray.Dataset]] = field(default_factory=dict)
    pictures: dict[str, Figure] = field(default_factory=dict)
    checks: list[xarray.Dataset] = field(default_factory=list)
    #: what is known of each numbered curve, ready for JSON, and what shooting said of it
    curves: list[dict[str, Any]] = field(default_factory=list)
    verified: dict[int, Verified] = field(default_factory=dict)

    @property
    def alone(self) -> dict[str, xarray.Dataset]:
        """The curves and tables that are all of a result."""
        return {name: own[""] for name, own in self.datasets.items() if list(own) == [""]}

    @property
    def every(self) -> list[xarray.Dataset]:
        """All datasets, in their order."""
        return [dataset for own in self.datasets.values() for dataset in own.values()]


@checked
def write_report(
    results: Mapping[str, Any],
    path: str | Path,
    *,
    title: str = "Study",
    overwrite: bool = False,
    failures: Mapping[str, str] | None = None,
) -> Path:
    """Write the report page of a study.

    Parameters
    ----------
    results
        Names of analyses and their curves: datasets (`to_xarray`), branches, bifurcation diagrams, isolas; maps, basins
        and other results in time, or tables of them. Datasets on the dimension `row` are shown as tables. The panel of
        a point shows its motion where branches are given, or datasets with motions (`to_xarray(motions=True)`).
    path
        A file ending in .html or .htm; written beside its place and renamed.
    title
        Heading of the page.
    overwrite
        Whether an existing file is replaced.
    failures
        Names of analyses that gave nothing, and why: listed among what needs attention.

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
    text = page_of(results, str(title), failures or {})
    replace_file(target, lambda place: place.write_text(text, encoding="utf-8"))
    return target


def page_of(results: Mapping[str, Any], title: str, failures: Mapping[str, str] | None = None) -> str:
    """The text of the page that `write_report` writes."""
    found = _found(results)
    anchors = {name: f"part-{index}" for index, name in enumerate(found.datasets)}
    sections = list(_overviews({name: data for name, data in found.alone.items() if _has_points(data)}))
    for name, item in zip(found.datasets, results.values(), strict=True):
        section = _section(name, found, item)
        section.anchor = anchors[name]
        sections.append(section)
    versions = sorted({str(data.attrs["suboctave"]) for data in found.every if "suboctave" in data.attrs})
    systems = dict.fromkeys(str(data.attrs["system"]) for data in found.every if data.attrs.get("system"))
    text: str = template("page.html").render(
        title=title,
        version=__version__,
        origin=" · ".join([f"suboctave {', '.join(versions) or __version__}", *systems]),
        links=[(anchors[name], name) for name in found.datasets] if len(found.datasets) > 1 else [],
        counts=_counts(found, anchors),
        attention=[
            *((f"analysis {name}: failed. {why}", "") for name, why in (failures or {}).items()),
            *_attention(sections, found),
        ],
        sections=sections,
        curves=found.curves,
        plotly=_plotly() if any(section.figures or section.curves for section in sections) else "",
    )
    return text


def picture_of(curves: Sequence[xarray.Dataset]) -> str:
    """Response curves as a still picture (SVG, base64)."""
    drawing = response_drawing([list(curves)])
    return base64.b64encode(image_of(figure_of(drawing, style.sheet_of(_SIZE)), "svg")).decode("ascii")


@functools.cache
def template(name: str) -> Any:
    """A template of a page, which escapes what it is given."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("suboctave.pictures", "templates")
    page = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    readers = (is_boundary, summary_of, bifurcations, notes_on, origin_of, records_of, number_of)
    page.globals |= {reader.__name__: reader for reader in readers}
    page.policies["json.dumps_kwargs"] = {"ensure_ascii": False, "separators": (",", ":")}
    return page.get_template(name)


@functools.cache
def _plotly() -> str:
    """Plotly's script for browsers, packed (gzip, base64): a third of its size, and the page needs no network."""
    from plotly.offline import get_plotlyjs

    return base64.b64encode(gzip.compress(get_plotlyjs().encode("utf-8"), 9, mtime=0)).decode("ascii")


# ------------------------------------------------------------------------------------------------------------- contents
def _found(results: Mapping[str, Any]) -> Found:
    """The datasets of all results, every curve with points numbered; pictures of what is no curve."""
    found = Found()
    for name, item in results.items():
        found.datasets[str(name)] = _datasets(str(name), item)
        # of a table what it was taken from; maps and results in time are both
        whole: Any = getattr(item, "result", None) or (item if hasattr(item, "to_table") else None)
        if hasattr(whole, "plot"):
            found.pictures[str(name)] = _pictured(str(name), whole)
        if hasattr(whole, "bifurcations_frame") and hasattr(whole, "disagreements"):
            found.checks.append(whole.to_xarray())
    for name, own in found.datasets.items():
        for label, dataset in own.items():
            if is_isolas(dataset) or not _has_points(dataset):
                continue
            number = len(found.curves)
            own[label] = dataset.assign_attrs(number=number)
            verified = verified_by(found.checks, dataset)
            if verified is not None:
                found.verified[number] = verified
            found.curves.append(curve_data(own[label], f"{name}, {label}" if label else name, verified))
    return found


def _datasets(name: str, item: Any) -> dict[str, xarray.Dataset]:
    """The datasets of a result by their names; the only one of a curve or a table has none."""
    import xarray

    given: Any = item
    if hasattr(item, "to_table"):
        given = item.to_table().to_xarray()
    elif any(hasattr(item, name) for name in ("bifurcations_frame", "limit_points")):  # curves: with their motions
        given = item.to_xarray(motions=True)
        seconds = getattr(item, "seconds", None)
        if seconds is not None and isinstance(given, xarray.Dataset):
            given = given.assign_attrs(seconds=float(seconds))
    elif hasattr(item, "to_xarray") and not isinstance(item, xarray.Dataset):
        given = item.to_xarray()
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


def _section(name: str, found: Found, item: Any) -> Section:
    datasets = found.datasets[name]
    head = next((dataset for dataset in datasets.values() if is_isolas(dataset)), None)
    curves = {label: dataset for label, dataset in datasets.items() if not is_isolas(dataset)}
    if head is not None:
        return _isolas(name, head, curves, found.alone)
    if list(curves) != [""]:  # all curves in one figure, the tree, and each branch by itself
        figure = _responses(curves, getattr(item, "legend", None))
        each = [_curve(label, data, f"{name}, branch {label}") for label, data in curves.items()]
        return Section(name, figures=[figure], tree=str(item), curves=each)
    (dataset,) = curves.values()
    if _has_points(dataset):
        return Section(name, curves=[_curve(name, dataset)])
    if "row" not in dataset.sizes and name not in found.pictures:
        return Section(name, before=["a curve without points"])
    heading = str(dataset.attrs.get("title", ""))
    figures = [found.pictures[name]] if name in found.pictures else []
    table = columns_of(dataset) if "row" in dataset.sizes else None
    return Section(name, before=[heading] if heading else [], table=table, figures=figures)


def _isolas(
    name: str, head: xarray.Dataset, curves: Mapping[str, xarray.Dataset], others: Mapping[str, xarray.Dataset]
) -> Section:
    """Table and sentences; the regions in the plane, closed branches beside the responses at the same parameters, the
    surfaces on which they lie; each curve by itself.
    """
    parameter, figures = parameter_of(head), []
    bounds = {label: data for label, data in curves.items() if is_boundary(data)}
    closed = {label: data for label, data in curves.items() if label not in bounds}
    responses = {
        n: d for n, d in others.items() if _has_points(d) and not is_boundary(d) and d.attrs["free"] == "omega"
    }
    file_name = _file_name([name])
    if bounds:
        drawing = boundary_drawing([head, *bounds.values()])
        _add_sections(drawing, {**closed, **responses}, parameter)
        figures.append(_figure(drawing, file_name, f"Isolas over ω and {parameter}"))
    if closed:
        periods = {int(nu) for nu in head["period"].to_numpy()}
        own = {k: c for k, c in bounds.items() if kind_of(c) == "LP" and period_of(c) in periods}
        group = {"isolas": head, **own, **closed}
        drawing = space_drawing(list(group.values()), x="omega", y=parameter, names=list(group))
        figures.append(_figure(drawing, f"{file_name}_space", f"Closed branches over ω and {parameter}"))
        values = {_value(data, parameter) for data in closed.values()}
        beside = {n: d for n, d in responses.items() if _value(d, parameter) in values}
        figures.append(_responses({**beside, **closed}, [*beside, *closed]))
    each = [_curve(label, data, f"{name}, {label}") for label, data in {**bounds, **closed}.items()]
    sentences, notes = notes_on_isolas(head)
    texts: dict[str, Any] = {"before": [str(head.attrs.get("said", ""))], "after": sentences, "notes": notes}
    return Section(name, table=isolas_table(head, closed), figures=figures, curves=each, **texts)


def _value(dataset: xarray.Dataset, parameter: str) -> float | None:
    """The value of a parameter along a curve, to 9 digits; None where it varies, or is none of the curve's."""
    if parameter not in dataset["parameter"].to_numpy():
        return None
    values = coordinate(dataset, parameter)[0]
    return float(f"{values[0]:.9g}") if np.ptp(values) == 0.0 else None


def _add_sections(drawing: Drawing, responses: Mapping[str, xarray.Dataset], parameter: str) -> None:
    """In a plane of omega and a parameter, the lines along which responses were computed: they lead to these."""
    frame, (across, upwards) = drawing.frames[0], drawing.axes
    words = "computed responses"
    for name, dataset in responses.items():
        value, omega = _value(dataset, parameter), dataset["omega"].to_numpy()
        if value is None or upwards.low is None or upwards.high is None or not upwards.low <= value <= upwards.high:
            continue
        inside = np.flatnonzero((omega >= (across.low or 0.0)) & (omega <= (across.high or np.inf)))
        if not inside.size:
            continue
        at = np.array([omega[inside], np.full(inside.size, value)])
        texts = [f"{name}\n{text}" for text in hover_of(dataset)(inside, np.full(inside.size, -1))]
        own: dict[str, Any] = {"curve": number_of(dataset), "vertices": inside, "group": words}
        seen: dict[str, Any] = {"role": "section", "layer": 2.0, "name": words, "hover": texts.copy}
        frame.add(Polyline(at, Pen(style.SOFT, 0.6), **seen, **own), words)


def _curve(name: str, dataset: xarray.Dataset, heading: str = "") -> Curve:
    draw = _boundaries if is_boundary(dataset) else _responses
    return Curve(heading, draw({name: dataset}), dataset)


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
        flat = {name: data for group in groups.values() for name, data in group.items()}
        if len(bounds) > 1 or (bounds and flat):
            yield Section(f"Boundaries over {plane}", figures=[_boundaries(bounds, flat)])
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


def _boundaries(curves: Mapping[str, xarray.Dataset], responses: Mapping[str, xarray.Dataset] | None = None) -> Figure:
    """Curves of bifurcations in their plane, and the lines along which responses were computed."""
    group = list(curves.values())
    kinds, plane = boundary_names(group), " and ".join(map(spelt, plane_of(group[0])))
    labels = [f"{name}: {kind}" for name, kind in zip(curves, kinds, strict=True)] if len(curves) > 1 else kinds
    drawing, (first, second) = boundary_drawing(group, labels=labels), plane_of(group[0])
    if first == "omega":
        own = {n: data for n, data in (responses or {}).items() if data.attrs["free"] == "omega"}
        _add_sections(drawing, own, second)
    return _figure(drawing, _file_name(curves), f"{', '.join(curves)}, over {plane}")


def _figure(drawing: Drawing, name: str, words: str) -> Figure:
    """A drawing for the browser and as a still picture."""
    sheet = style.sheet_of(_SIZE if len(drawing.axes) == 2 else _SIZE_IN_SPACE)
    still = base64.b64encode(image_of(figure_of(drawing, sheet), "svg")).decode("ascii")
    return Figure(figure_data(drawing, name), still, words)


def _pictured(name: str, item: Any) -> Figure:
    """The picture of a map, of basins, ...: for the browser as well where its drawing is known."""
    with TemporaryDirectory() as folder:  # saved: what is not opens a window at a prompt
        path = Path(folder) / "picture.svg"
        drawing = drawing_of(item.plot(path))
        still = base64.b64encode(path.read_bytes()).decode("ascii")
    data = None if drawing is None or len(drawing.frames) > 1 else figure_data(drawing, _file_name([name]))
    return Figure(data, still, f"Picture of {name}")


def _file_name(names: Sequence[str] | Mapping[str, Any]) -> str:
    return re.sub(r"[^\w-]+", "_", "_".join(names))[:60] or "figure"


# -------------------------------------------------------------------------------------------------------------- summary
def _counts(found: Found, anchors: Mapping[str, str]) -> list[tuple[int | str, str, str]]:
    """What was found: how many, of what, and where the first of it stands; maps and the like by name."""
    curves = [data for data in found.every if _has_points(data) and not is_isolas(data)]
    counts: list[tuple[int | str, str, str]] = []
    if curves:
        points = sum(data.sizes["point"] for data in curves)
        first = f"curve-{number_of(curves[0])}"
        counts += [(len(curves), "curve" if len(curves) == 1 else "curves", first), (points, "points", first)]
    kinds: dict[str, list[int]] = {}
    for data in curves:
        for kind in data["event_kind"].to_numpy():
            kinds.setdefault(str(kind), []).append(number_of(data))
    for kind, where in kinds.items():
        name = style.kind_style(kind).name
        counts.append((len(where), name if len(where) == 1 else _several(name), f"curve-{where[0]}"))
    for name, own in found.datasets.items():
        for head in filter(is_isolas, own.values()):
            number = int(head.sizes["isola"])
            counts.append((number, "isola" if number == 1 else "isolas", anchors[name]))
    for name in found.pictures:
        counts.append(("", name, anchors[name]))
    return counts


def _several(name: str) -> str:
    """A name of a kind, several of it."""
    if name[0].isupper():  # called after people
        return f"{name} points" if not name.endswith("point") else f"{name}s"
    if name.endswith(("s", "um")):
        return {"extremum": "extrema"}.get(name, name)
    return f"{name[:-1]}ies" if name.endswith("y") else f"{name}s"


def _attention(sections: Sequence[Section], found: Found) -> Iterator[tuple[str, str]]:
    """What the reader must know before believing the numbers, each with where it is said at length."""
    for section in sections:
        for note in section.notes:
            yield f"{section.heading}: {note}", section.anchor
        for curve in section.curves:
            name = found.curves[number_of(curve.dataset)]["name"]
            for note in notes_on(curve.dataset):
                yield f"{name}: {note}", curve.anchor
    for number, verified in found.verified.items():
        if verified.wrong:
            yield f"{found.curves[number]['name']}: shooting disagrees at {verified.wrong} places", f"curve-{number}"
    counts = [(data.sizes["point"], number_of(data)) for data in found.every if number_of(data) >= 0]
    total = sum(count for count, _ in counts)
    checked = sum(len(verified.points) for verified in found.verified.values())
    if total > checked:
        words = "no point was" if not checked else f"{checked} of {total} points were"
        yield f'{words} held against time integration (the analysis "verify", so.verify)', ""
