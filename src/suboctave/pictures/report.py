"""One page per study: interactive figures, tables of bifurcations, and where the numbers come from.

The page is a single file that needs no network. Without scripts (and on paper) it shows still pictures; its tables and
texts need none. Everything that comes from a user is escaped.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from suboctave.errors import InputError, shortened
from suboctave.pictures import style
from suboctave.pictures.boundary_lines import is_boundary, plane_of
from suboctave.pictures.interactive import figure_data
from suboctave.pictures.page import POLICY, SCRIPT, STYLE, plotly_source
from suboctave.pictures.report_boundaries import (
    Shown,
    boundary_figure,
    boundary_overviews,
    critical_multipliers,
    space_figure,
)
from suboctave.pictures.report_isolas import IsolasPart, isolas_figures, isolas_part, isolas_words
from suboctave.pictures.report_text import cell, finite, html_table, number, safe, small, spelt
from suboctave.pictures.response import plot_response
from suboctave.pictures.saving import svg_text
from suboctave.store.columns import parameter_column
from suboctave.store.files import free_place, replace_file
from suboctave.store.layout import check_layout, coordinate
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray

__all__ = ["write_report"]

_TEXT = "text"
#: attributes of a dataset that have a place of their own on the page
_TOLD = {"layout", "suboctave", "system", "free", "ended", "closed", "period", "observed_dof", "dofs", "warnings"}
_RECORDS = {"record", "digest", "contents", "tracked", "plane", "isola", "at"}
_LONG = 400
_BESIDE = 56  # characters in a row of a table that stands beside its figure


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
    parts = {str(name): _part(str(name), item) for name, item in results.items()}
    if not parts:
        raise InputError("a report needs at least one result")
    text = _page(parts, str(title))
    replace_file(target, lambda place: place.write_text(text, encoding="utf-8"))
    return target


@dataclass(frozen=True)
class _Diagram:
    """A bifurcation diagram: its tree as text, and its curves by number and label."""

    text: str
    curves: dict[str, xarray.Dataset]
    legend: list[str] | None


_Part: TypeAlias = "xarray.Dataset | _Diagram | IsolasPart"


def _part(name: str, item: Any) -> _Part:
    import xarray

    given: Any = item.to_xarray() if hasattr(item, "to_xarray") and not isinstance(item, xarray.Dataset) else item
    isolas = isolas_part(given) if isinstance(given, dict) else None
    if isolas is not None:
        return isolas
    if isinstance(given, dict) and given:
        curves = {str(label): _dataset(name, dataset) for label, dataset in given.items()}
        return _Diagram(str(item), curves, getattr(item, "legend", None))
    return _dataset(name, given)


def _dataset(name: str, dataset: Any) -> xarray.Dataset:
    import xarray

    if not isinstance(dataset, xarray.Dataset):
        raise InputError(
            f"{name}: expected a dataset of a curve, got {type(dataset).__name__}; a branch has to_xarray()"
        )
    if "row" not in dataset.sizes or "point" in dataset.sizes:
        check_layout(dataset)
    return dataset


def _page(parts: Mapping[str, _Part], title: str) -> str:
    datasets = {name: part for name, part in parts.items() if not isinstance(part, _Diagram | IsolasPart)}
    diagrams = {name: part for name, part in parts.items() if isinstance(part, _Diagram)}
    isolas = {name: part for name, part in parts.items() if isinstance(part, IsolasPart)}
    curves = {name: data for name, data in datasets.items() if data.sizes.get("point", 0)}
    everything = [*datasets.values(), *(data for diagram in diagrams.values() for data in diagram.curves.values())]
    everything += [part.head for part in isolas.values()]
    anchors = {name: f"part-{index}" for index, name in enumerate(parts)}
    sections = [f"<h1>{safe(title)}</h1>", _summary(everything)]
    if len(parts) > 1:
        links = [f'<a href="#{anchors[name]}">{safe(name)}</a>' for name in parts]
        sections.append(f"<nav>{''.join(links)}</nav>")
        sections += _overviews(curves)
    for name in parts:
        sections.append(f'<section id="{anchors[name]}"><h2>{safe(name)}</h2>')
        if name in diagrams:
            sections.append(_diagram(name, diagrams[name]))
        elif name in isolas:
            sections.append(_isolas(name, isolas[name]))
        else:
            sections.append(_curve(name, datasets[name]) if name in curves else _table_of(datasets[name]))
        sections.append("</section>")
    drawn = curves or diagrams or any(part.every for part in isolas.values())
    packed = f'<script type="text/plain" id="plotly-packed">{plotly_source()}</script>' if drawn else ""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<meta name="generator" content="suboctave {safe(__version__)}">\n'
        f"<title>{safe(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(sections)
        + f"\n{packed}\n<script>{SCRIPT}</script>\n</body>\n</html>\n"
    )


def _diagram(name: str, diagram: _Diagram) -> str:
    """All curves in one figure, the tree, and each branch by itself."""
    free = str(next(iter(diagram.curves.values())).attrs["free"])
    each = "".join(
        f"<h2>{safe(name)}, branch {safe(label)}</h2>{_curve(label, data)}" for label, data in diagram.curves.items()
    )
    return f"{_figure(diagram.curves, free, diagram.legend)}<pre>{safe(diagram.text)}</pre>{each}"


def _isolas(name: str, part: IsolasPart) -> str:
    """Table and sentences, regions, surfaces, and each curve and closed branch by itself."""
    figures = "".join(_framed(shown) for shown in isolas_figures(part, _file_name({name: part.head})))
    each = "".join(f"<h2>{safe(name)}, {safe(label)}</h2>{_curve(label, data)}" for label, data in part.every.items())
    return isolas_words(part) + figures + each


def _summary(datasets: Sequence[xarray.Dataset]) -> str:
    versions = sorted({str(data.attrs["suboctave"]) for data in datasets if "suboctave" in data.attrs})
    systems = dict.fromkeys(str(data.attrs["system"]) for data in datasets if data.attrs.get("system"))
    words = [f"suboctave {', '.join(versions) or __version__}", *systems]
    hint = "Hover over a curve for its values, drag to zoom, click in the legend to hide."
    return f'<p class="soft">{safe(" · ".join(words))}</p><p class="soft hint">{hint}</p>'


def _overviews(curves: Mapping[str, xarray.Dataset]) -> list[str]:
    """All curves over the same parameter in one figure, where there are several of one observed DOF."""
    groups: dict[tuple[Any, ...], dict[str, xarray.Dataset]] = {}
    for name, data in curves.items():
        if is_boundary(data):
            continue
        key = (str(data.attrs["free"]), int(data.attrs.get("dofs", 1)), int(data.attrs.get("observed_dof", 0)))
        groups.setdefault(key, {})[name] = data
    several = [(key[0], group) for key, group in groups.items() if len(group) > 1]
    parts = [
        f"<section><h2>All curves over {safe(spelt(free))}</h2>{_figure(group, free, list(group))}</section>"
        for free, group in several
    ]
    for members, what in boundary_overviews(curves):
        shown = (boundary_figure if what == "plane" else space_figure)(members, _file_name(members))
        parts.append(f"<section><h2>{safe(shown.heading)}</h2>{_framed(shown)}</section>")
    return parts


def _curve(name: str, dataset: xarray.Dataset) -> str:
    head, rows = _bifurcations(dataset)
    count, unstable = dataset.sizes["point"], None
    if "stable" in dataset:
        unstable = int(np.count_nonzero(~dataset["stable"].to_numpy().astype(bool)))
    said = f"{count} points" + ("" if unstable is None else f", {unstable} of them unstable")
    figure: Any = _figure
    over = "Bifurcations"
    if is_boundary(dataset):
        said = f"{_kind(dataset)}: {count} points" + (
            "" if unstable is None else f", {unstable} within unstable motions"
        )
        figure, over = _boundary, "Extrema and points of codimension two"
    period = int(dataset.attrs.get("period", 1))
    if period > 1:
        said += f"; motions of {period} periods of the force"
    ended = f"; {dataset.attrs['ended']}" if dataset.attrs.get("ended") else ""
    notes = "".join(f'<p class="note">{safe(note)}</p>' for note in _notes(dataset))
    table = html_table(head, rows) if rows else "<p>none</p>"
    widths = [max(len(text) for text in column) for column in zip([name for name, _ in head], *rows, strict=True)]
    wide = " wide" if sum(widths) > _BESIDE else ""
    return (
        f'<p class="soft">{safe(said + ended)}.</p>'
        f'<div class="pair{wide}"><div>{figure({name: dataset}, str(dataset.attrs["free"]))}</div>'
        f"<div><h3>{over}, in the order met</h3>{table}</div></div>{notes}{_provenance(dataset)}"
    )


def _kind(dataset: xarray.Dataset) -> str:
    kind = str(dataset.attrs["tracked"])
    return f"curve of bifurcations of the kind {kind} ({style.kind_style(kind).name})"


def _file_name(curves: Mapping[str, xarray.Dataset]) -> str:
    return re.sub(r"[^\w-]+", "_", "_".join(curves))[:60] or "figure"


def _figure(curves: Mapping[str, xarray.Dataset], free: str, labels: Sequence[str] | None = None) -> str:
    still = plot_response(list(curves.values()), x=free, labels=labels, size=(6.4, 4.2))
    words = f"Amplitude over {spelt(free)}: {', '.join(curves)}"
    return _framed(Shown("", figure_data(curves, free, _file_name(curves)), still, words))


def _boundary(curves: Mapping[str, xarray.Dataset], _: str) -> str:
    return _framed(boundary_figure(curves, _file_name(curves)))


def _framed(shown: Shown) -> str:
    told = json.dumps(shown.told, ensure_ascii=False, separators=(",", ":"))
    # what would end the script early, or is no line end for JSON but one for scripts
    for bad in "<>&\u2028\u2029":
        told = told.replace(bad, f"\\u{ord(bad):04x}")
    packed = base64.b64encode(svg_text(shown.still).encode("utf-8")).decode("ascii")
    return (
        f'<div class="figure"><div class="plot"></div><div class="still"><img alt="{safe(shown.words)}" '
        f'src="data:image/svg+xml;base64,{packed}"></div><script type="application/json">{told}</script></div>'
    )


def _bifurcations(dataset: xarray.Dataset) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """Headings with their class, and the rows of the table."""
    free = _free(dataset)
    values = [coordinate(dataset, name)[1] for name in free]
    varied = spelt(str(dataset.attrs["free"]))
    extreme = dataset["event_extreme"].to_numpy() if "event_extreme" in dataset else None
    column = {name: dataset[f"event_{name}"].to_numpy() for name in ("kind", "omega", "amplitude", "multiplier")}
    residual, doubt = dataset["event_residual"].to_numpy(), dataset["event_uncertainty"].to_numpy()
    contact, critical = dataset["event_contact"].to_numpy(), dataset["event_criticality"].to_numpy()
    own = ("kind", "ω", "max |x|", "multiplier", "residual", "remark")
    head = [("kind", _TEXT), ("ω", ""), *((parameter_column(name, own), "") for name in free)]
    head += [("max |x|", ""), ("multiplier", ""), ("residual", "")]
    remarks = []
    for i in range(len(residual)):
        words = [str(extreme[i])] if extreme is not None and str(extreme[i]) else []
        words += [str(critical[i])] if str(critical[i]) else []
        words += [f"± {doubt[i]:.0e} in {varied}"] if doubt[i] else []
        words += [f"contact: {contact[i]}"] if str(contact[i]) else []
        remarks.append("; ".join(words))
    if any(remarks):
        head.append(("remark", "long"))
    rows = []
    for i in range(len(residual)):
        kind = str(column["kind"][i])
        name = style.kind_style(kind).name
        row = [f"{kind} ({name})" if kind.isupper() and name != kind else name, f"{column['omega'][i]:.9g}"]
        row += [f"{value[i]:.9g}" for value in values]
        row += [f"{column['amplitude'][i]:.7g}", number(complex(column["multiplier"][i])), small(residual[i])]
        rows.append(row + ([remarks[i]] if any(remarks) else []))
    return head, rows


def _free(dataset: xarray.Dataset) -> list[str]:
    """The free parameters other than omega."""
    names = plane_of(dataset) if is_boundary(dataset) else (str(dataset.attrs["free"]),)
    return [name for name in names if name != "omega"]


def _notes(dataset: xarray.Dataset) -> list[str]:
    """What the reader must know: warnings, and what stayed unsettled."""
    notes = [note for note in str(dataset.attrs.get("warnings", "")).splitlines() if note.strip()]
    if "multiplier_errors" in dataset and dataset.sizes.get("multiplier"):
        near = np.abs(np.abs(dataset["multipliers"].to_numpy()) - 1.0) <= dataset["multiplier_errors"].to_numpy()
        which = "a multiplier"
        if is_boundary(dataset):
            # one of them, or a pair, is on the circle all along
            near &= ~critical_multipliers(dataset)
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


def _provenance(dataset: xarray.Dataset) -> str:
    attrs = dataset.attrs
    pairs: list[tuple[str, str]] = [
        ("computed by", f"suboctave {attrs.get('suboctave', '(unknown version)')}"),
        ("system", str(attrs.get("system") or "(no name)")),
        ("degrees of freedom", f"{attrs.get('dofs', 1)}, observed: {attrs.get('observed_dof', 0)}"),
        (
            "free parameter",
            " and ".join(map(spelt, plane_of(dataset))) if is_boundary(dataset) else spelt(str(attrs["free"])),
        ),
        ("fixed parameters", _fixed(dataset) or "none"),
    ]
    if "harmonics" in dataset:
        used = dataset["harmonics"].to_numpy()
        pairs.append(("harmonics used", f"{used.min()} to {used.max()}" if np.ptp(used) else f"{used[0]}"))
    for name, words in (("error", "largest neglected part of the motion"), ("residual", "largest residual")):
        if name in dataset:
            pairs.append((words, small(float(np.nanmax(dataset[name].to_numpy())))))
    if "stability_method" in dataset:
        methods = dict.fromkeys(str(method) for method in dataset["stability_method"].to_numpy())
        pairs.append(("stability from", "; ".join(methods)))
    longer = []
    for name, value in attrs.items():
        untold = name == "seconds" and not finite(value)
        if name in _TOLD or name in _RECORDS or str(value) == "" or untold:
            continue
        shown = f"{float(value):.3g} s" if name == "seconds" else str(value)
        if len(shown) > _LONG or "\n" in shown:
            longer.append((str(name), shown))
        else:
            pairs.append(("time taken" if name == "seconds" else str(name), shown))
    listed = "".join(f"<dt>{safe(name)}</dt><dd>{safe(value)}</dd>" for name, value in pairs)
    more = "".join(
        f"<details><summary>{safe(name)}</summary><pre>{safe(value)}</pre></details>" for name, value in longer
    )
    return f"<h3>Where these numbers come from</h3><dl>{listed}</dl>{more}"


def _fixed(dataset: xarray.Dataset) -> str:
    table = dataset["parameters"].to_numpy()
    names = [str(name) for name in dataset["parameter"].to_numpy()]
    constant = [f"{n} = {table[0, i]:.9g}" for i, n in enumerate(names) if np.ptp(table[:, i]) == 0.0]
    if str(dataset.attrs["free"]) != "omega" and np.ptp(dataset["omega"].to_numpy()) == 0.0:
        constant.insert(0, f"ω = {float(dataset['omega'].values[0]):.9g}")
    return ", ".join(constant)


def _table_of(dataset: xarray.Dataset) -> str:
    """A result that is no curve: its columns as they are."""
    if "row" not in dataset.sizes:
        return "<p>a curve without points</p>"
    columns = {str(name): data.to_numpy() for name, data in dataset.data_vars.items() if data.dims == ("row",)}
    kinds = [_TEXT if column.dtype.kind in "OU" else "" for column in columns.values()]
    rows = [[cell(column[i]) for column in columns.values()] for i in range(dataset.sizes["row"])]
    heading = f"<p>{safe(str(dataset.attrs['title']))}</p>" if dataset.attrs.get("title") else ""
    return heading + html_table(list(zip(columns, kinds, strict=True)), rows)
