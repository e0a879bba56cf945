"""What stands where on a report page: sections of figures, tables and sentences, each curve drawn once.

Curves over one parameter, and curves of bifurcations in one plane, have a figure together, at the place of the first of
them; what is told of each stands below it. Closed branches of isolas are drawn with the responses at their parameters,
where there are such.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.boundary import boundary_drawing, boundary_names, kind_of, parameter_of, plane_of, space_drawing
from suboctave.pictures.browser import figure_data
from suboctave.pictures.drawing import Drawing, Polyline
from suboctave.pictures.given import is_boundary, is_isolas
from suboctave.pictures.paper import drawing_of, figure_of, image_of
from suboctave.pictures.response import response_drawing
from suboctave.pictures.strokes import fixed_parameters, number_of, spelt
from suboctave.pictures.style import Pen, period_of
from suboctave.pictures.tables import Table, columns_of, isolas_table, notes_on_isolas
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray


#: inches of a still picture in the plane and in space
_SIZE, _SIZE_IN_SPACE = (6.4, 4.2), (6.4, 4.8)
#: characters of the names of several curves that a heading holds
_HEADING = 60


@dataclass(frozen=True)
class Figure:
    """One figure; data for the browser, None where it is a still picture only; this (SVG, base64); and words for those
    who see neither. `folded`: what it is folded away under, if it is.
    """

    data: dict[str, Any] | None
    still: str
    words: str
    folded: str = ""


@dataclass(frozen=True)
class Curve:
    """A curve on the page: heading, figure if it has one of its own, and its dataset."""

    heading: str
    dataset: xarray.Dataset
    figure: Figure | None = None

    @property
    def anchor(self) -> str:
        """Where links lead to."""
        return anchor_of(self.dataset)


@dataclass
class Section:
    """A part of the page: sentences before and after a table, notes, figures, a tree of branches, and curves.

    `names`: the analyses that it shows.
    """

    heading: str
    names: Sequence[str]
    anchor: str = ""
    before: Sequence[str] = ()
    table: Table | None = None
    after: Sequence[str] = ()
    notes: Sequence[str] = ()
    figures: Sequence[Figure] = ()
    tree: str = ""
    curves: Sequence[Curve] = ()


@dataclass
class Contents:
    """The datasets of all results by name and part, "" where there is one only, and pictures of what is no curve."""

    datasets: dict[str, dict[str, xarray.Dataset]] = field(default_factory=dict)
    pictures: dict[str, Figure] = field(default_factory=dict)

    @property
    def every(self) -> list[xarray.Dataset]:
        """All datasets, in their order."""
        return [dataset for own in self.datasets.values() for dataset in own.values()]

    @property
    def curves(self) -> dict[str, xarray.Dataset]:
        """The results that are one curve, with points."""
        alone = {name: own[""] for name, own in self.datasets.items() if list(own) == [""]}
        return {name: data for name, data in alone.items() if has_points(data) and not is_isolas(data)}


def has_points(dataset: xarray.Dataset) -> bool:
    """Whether there is a point on a curve."""
    return bool(dataset.sizes.get("point", 0))


def anchor_of(dataset: xarray.Dataset) -> str:
    """Where links to a curve lead to."""
    return f"curve-{number_of(dataset)}"


def is_empty(own: Mapping[str, xarray.Dataset], pictured: bool = False) -> bool:
    """Whether nothing was found by an analysis: no isola, no point, no row."""
    if pictured:
        return False
    return not any(
        bool(data.sizes["isola"]) if is_isolas(data) else has_points(data) or bool(data.sizes.get("row", 0))
        for data in own.values()
    )


def sections_of(contents: Contents, items: Mapping[str, Any]) -> Iterator[Section]:
    """The sections of all results that found something, in the order asked."""
    groups: dict[Any, dict[str, xarray.Dataset]] = {}
    for name, data in contents.curves.items():
        groups.setdefault(_frame_of(data), {})[name] = data
    drawn: set[int] = set()
    for name, own in contents.datasets.items():
        if name in contents.curves:
            key = _frame_of(contents.curves[name])
            if name == next(iter(groups[key])):
                yield _together(groups[key], contents, drawn)
        elif not is_empty(own, name in contents.pictures):
            yield _alone(name, contents, items[name], drawn)


def _frame_of(dataset: xarray.Dataset) -> tuple[Any, ...]:
    """What curves have in common that are drawn into one frame."""
    return (
        plane_of(dataset) if is_boundary(dataset) else (str(dataset.attrs["free"]), int(dataset.attrs.get("dofs", 1)))
    )


def _together(group: Mapping[str, xarray.Dataset], contents: Contents, drawn: set[int]) -> Section:
    """Curves of one frame: one figure, with the closed branches at the same parameters, and what is known of each."""
    first, names = next(iter(group.values())), list(group)
    joined = ", ".join(names)
    over = " and ".join(map(spelt, plane_of(first) if is_boundary(first) else (str(first.attrs["free"]),)))
    heading = joined if len(joined) <= _HEADING else f"{len(names)} curves over {over}"
    if is_boundary(first):
        figures = [_boundaries(group, contents.curves), *_in_space(group, contents)]
    else:
        closed = {
            f"{name}: {label}": data
            for name, own in contents.datasets.items()
            for label, data in _closed(own).items()
            if any(_same_system(data, response) for response in group.values())
        }
        drawn |= {number_of(data) for data in closed.values()}
        figures = [_responses({**group, **closed})]
    if len(names) == 1 and len(figures) == 1:
        return Section(heading, names, curves=[Curve("", first, figures[0])])
    each = [Curve(name if len(names) > 1 else "", data) for name, data in group.items()]
    return Section(heading, names, figures=figures, curves=each)


def _alone(name: str, contents: Contents, item: Any, drawn: set[int]) -> Section:
    """What is no single curve: isolas, a diagram, a table, a map."""
    datasets = contents.datasets[name]
    head = next((dataset for dataset in datasets.values() if is_isolas(dataset)), None)
    curves = {label: dataset for label, dataset in datasets.items() if not is_isolas(dataset)}
    if head is not None:
        return _isolas(name, head, curves, contents, drawn)
    if list(curves) != [""]:  # all branches of a diagram in one figure
        figure = _responses(curves, getattr(item, "legend", None))
        each = [Curve(f"{name}, branch {label}", data) for label, data in curves.items()]
        return Section(name, [name], figures=[figure], tree=str(item), curves=each)
    (dataset,) = curves.values()
    heading = str(dataset.attrs.get("title", ""))
    figures = [contents.pictures[name]] if name in contents.pictures else []
    table, after = columns_of(dataset) if "row" in dataset.sizes else (None, [])
    notes = str(dataset.attrs.get("warnings", "")).splitlines()
    texts: dict[str, Any] = {"before": [heading] if heading else [], "after": after, "notes": notes}
    return Section(name, [name], table=table, figures=figures, **texts)


def _isolas(
    name: str, head: xarray.Dataset, curves: Mapping[str, xarray.Dataset], contents: Contents, drawn: set[int]
) -> Section:
    """Table and sentences; the regions in the plane, the closed branches that are not drawn with responses, and the
    surfaces on which they lie; of each curve its events.
    """
    parameter, figures = parameter_of(head), []
    bounds = {label: data for label, data in curves.items() if is_boundary(data)}
    closed = _closed(curves)
    file_name = _file_name([name])
    if bounds:
        drawing = boundary_drawing([head, *bounds.values()])
        _add_sections(drawing, {**closed, **contents.curves}, parameter)
        figures.append(figure_from(drawing, file_name, f"Isolas over ω and {parameter}"))
    rest = {label: data for label, data in closed.items() if number_of(data) not in drawn}
    if rest:
        figures.append(_responses(rest))
    if closed:
        periods = {int(nu) for nu in head["period"].to_numpy()}
        own = {k: c for k, c in bounds.items() if kind_of(c) == "LP" and period_of(c) in periods}
        group = {"isolas": head, **own, **closed}
        drawing = space_drawing(list(group.values()), x="omega", y=parameter, names=list(group))
        words = f"Closed branches over ω and {parameter}"
        figures.append(figure_from(drawing, f"{file_name}_space", words, folded="In space"))
    each = [Curve(f"{name}, {label}", data) for label, data in {**bounds, **closed}.items()]
    sentences, notes = notes_on_isolas(head)
    texts: dict[str, Any] = {"before": [str(head.attrs.get("said", ""))], "after": sentences, "notes": notes}
    return Section(name, [name], table=isolas_table(head, closed), figures=figures, curves=each, **texts)


def _closed(curves: Mapping[str, xarray.Dataset]) -> dict[str, xarray.Dataset]:
    """The closed branches among the curves of isolas."""
    return {label: data for label, data in curves.items() if "isola" in data.attrs}


def _same_system(one: xarray.Dataset, other: xarray.Dataset) -> bool:
    """Whether two curves over the same parameter are of the same system at the same parameters."""
    if str(one.attrs["free"]) != str(other.attrs["free"]):
        return False
    first, second = fixed_parameters(one), fixed_parameters(other)
    return first.keys() == second.keys() and all(
        np.isclose(value, second[name], rtol=1e-9, atol=0.0) for name, value in first.items()
    )


def _in_space(bounds: Mapping[str, xarray.Dataset], contents: Contents) -> Iterator[Figure]:
    """Boundaries and the responses over one of their parameters in space, where all observe the same."""
    first = next(iter(bounds.values()))
    (x, y), observed = plane_of(first), {_observed(data) for data in bounds.values()}
    near = {
        name: data
        for name, data in contents.curves.items()
        if not is_boundary(data) and str(data.attrs["free"]) in (x, y) and _observed(data) in observed
    }
    if near and len(observed) == 1:
        every = {**near, **bounds}
        drawing = space_drawing(list(every.values()), x=x, y=y, names=list(every))
        words = f"Response curves and boundaries over {spelt(x)} and {spelt(y)}: {', '.join(every)}"
        yield figure_from(drawing, _file_name(every), words, folded="In space, with the responses")


def _observed(dataset: xarray.Dataset) -> tuple[int, int]:
    return int(dataset.attrs.get("dofs", 1)), int(dataset.attrs.get("observed_dof", 0))


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
    for dataset in responses.values():
        value, omega = _value(dataset, parameter), dataset["omega"].to_numpy()
        if is_boundary(dataset) or dataset.attrs["free"] != "omega":
            continue
        if value is None or upwards.low is None or upwards.high is None or not upwards.low <= value <= upwards.high:
            continue
        inside = np.flatnonzero((omega >= (across.low or 0.0)) & (omega <= (across.high or np.inf)))
        if not inside.size:
            continue
        at = np.array([omega[inside], np.full(inside.size, value)])
        own: dict[str, Any] = {"curve": number_of(dataset), "vertices": inside, "group": words, "name": words}
        frame.add(Polyline(at, Pen(style.SOFT, 0.6), role="section", layer=2.0, **own), words)


# -------------------------------------------------------------------------------------------------------------- figures
def _responses(curves: Mapping[str, xarray.Dataset], labels: Sequence[str] | None = None) -> Figure:
    group = list(curves.values())
    free = str(group[0].attrs["free"])
    named = None if labels is None else [labels]
    drawing = response_drawing([group], x=free, labels=named, names=list(curves))
    return figure_from(drawing, _file_name(curves), f"Amplitude over {spelt(free)}: {', '.join(curves)}")


def _boundaries(curves: Mapping[str, xarray.Dataset], responses: Mapping[str, xarray.Dataset]) -> Figure:
    """Curves of bifurcations in their plane, and the lines along which responses were computed."""
    group = list(curves.values())
    kinds, plane = boundary_names(group), " and ".join(map(spelt, plane_of(group[0])))
    labels = [f"{name}: {kind}" for name, kind in zip(curves, kinds, strict=True)] if len(curves) > 1 else kinds
    drawing, (first, second) = boundary_drawing(group, labels=labels), plane_of(group[0])
    if first == "omega":
        _add_sections(drawing, responses, second)
    return figure_from(drawing, _file_name(curves), f"{', '.join(curves)}, over {plane}")


def figure_from(drawing: Drawing, name: str, words: str, folded: str = "") -> Figure:
    """A drawing for the browser and as a still picture."""
    sheet = style.sheet_of(_SIZE if len(drawing.axes) == 2 else _SIZE_IN_SPACE)
    still = base64.b64encode(image_of(figure_of(drawing, sheet), "svg")).decode("ascii")
    return Figure(figure_data(drawing, name), still, words, folded)


def pictured(name: str, item: Any) -> Figure:
    """The picture of a map, of basins, ...: for the browser as well where its drawing is known."""
    with TemporaryDirectory() as folder:  # saved: what is not opens a window at a prompt
        path = Path(folder) / "picture.svg"
        drawing = drawing_of(item.plot(path))
        still = base64.b64encode(path.read_bytes()).decode("ascii")
    data = None if drawing is None or len(drawing.frames) > 1 else figure_data(drawing, _file_name([name]))
    return Figure(data, still, f"Picture of {name}")


def picture_of(curves: Sequence[xarray.Dataset]) -> str:
    """Response curves, or curves of bifurcations, as a still picture (SVG, base64)."""
    drawing = boundary_drawing(curves) if is_boundary(curves[0]) else response_drawing([list(curves)])
    return base64.b64encode(image_of(figure_of(drawing, style.sheet_of(_SIZE)), "svg")).decode("ascii")


def _file_name(names: Sequence[str] | Mapping[str, Any]) -> str:
    return re.sub(r"[^\w-]+", "_", "_".join(names))[:60] or "figure"
