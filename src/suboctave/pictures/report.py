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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suboctave.arguments import checked
from suboctave.atomic import free_place, replace_file
from suboctave.errors import InputError, shortened
from suboctave.pictures import style
from suboctave.pictures.given import is_boundary, is_isolas
from suboctave.pictures.options import declared_units
from suboctave.pictures.points import DETAILS, Verified, curve_data, verified_by
from suboctave.pictures.sections import Contents, Section, anchor_of, has_points, is_empty, pictured, sections_of
from suboctave.pictures.strokes import number_of
from suboctave.pictures.tables import bifurcations, notes_on, notes_on_isolas, origin_of, records_of, summary_of
from suboctave.store.layout import check_layout
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray


#: curves with one note that are named
_NAMED = 4
#: characters of motions and forces on a page; beyond it fewer of them are on it
_MOST = 12e6


@dataclass
class Found(Contents):
    """The results of a study as the page shows them.

    `curves_known`: what is known of each numbered curve, ready for JSON; `verified`: what shooting said of it;
    `left_out`: what the page does not hold, in words.
    """

    checks: list[xarray.Dataset] = field(default_factory=list)
    curves_known: list[dict[str, Any]] = field(default_factory=list)
    verified: dict[int, Verified] = field(default_factory=dict)
    left_out: str = ""


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
    sections = list(sections_of(found, {str(name): item for name, item in results.items()}))
    for index, section in enumerate(sections):
        section.anchor = f"part-{index}"
    anchors = {name: section.anchor for section in sections for name in section.names}
    # of one among several in a section the curve itself
    anchors |= {name: anchor_of(found.curves[name]) for s in sections if len(s.names) > 1 for name in s.names}
    versions = sorted({str(data.attrs["suboctave"]) for data in found.every if "suboctave" in data.attrs})
    systems = dict.fromkeys(str(data.attrs["system"]) for data in found.every if data.attrs.get("system"))
    text: str = template("page.html").render(
        title=title,
        version=__version__,
        origin=" · ".join([f"suboctave {', '.join(versions) or __version__}", *systems]),
        links=[(anchors[name], name) for name in found.datasets if name in anchors] if len(anchors) > 1 else [],
        counts=_counts(found, anchors),
        nothing=[_nothing(name, own) for name, own in found.datasets.items() if name not in anchors],
        verification=_verification(found),
        left_out=found.left_out,
        attention=[
            *((f"analysis {name}: failed. {why}", "") for name, why in (failures or {}).items()),
            *_attention(sections, found),
        ],
        sections=sections,
        frequencies=_frequencies(sections, found, results),
        curves=found.curves_known,
        plotly=_plotly() if any(section.figures or section.curves for section in sections) else "",
    )
    return text


def _frequencies(sections: Sequence[Section], found: Found, results: Mapping[str, Any]) -> dict[str, str]:
    """The units of circular frequencies and of cycles; empty where no figure has frequencies on an axis."""
    figures = [figure for section in sections for figure in section.figures]
    figures += [curve.figure for section in sections for curve in section.curves if curve.figure is not None]
    if not any(figure.data and "omega" in figure.data["axes"] for figure in figures):
        return {}
    systems = (getattr(getattr(item, "result", item), "system", None) for item in results.values())
    known = {getattr(system, "units", None) for system in systems if system is not None}
    known |= {declared_units([dataset]) for dataset in found.every if "units" in dataset.attrs}
    units = known.pop() if len(known) == 1 else None
    return {"rad": units.frequency, "cycles": units.cycles} if units else {"rad": "", "cycles": ""}


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
    numbered: list[tuple[xarray.Dataset, str]] = []
    for name, item in results.items():
        found.datasets[str(name)] = own = _datasets(str(name), item)
        # of a table what it was taken from; maps and results in time are both
        whole: Any = getattr(item, "result", None) or (item if hasattr(item, "to_table") else None)
        if hasattr(whole, "plot"):
            found.pictures[str(name)] = pictured(str(name), whole)
        if hasattr(whole, "bifurcations_frame") and hasattr(whole, "disagreements"):
            found.checks.append(whole.to_xarray())
        for label, dataset in own.items():
            if not is_isolas(dataset) and has_points(dataset):
                own[label] = dataset.assign_attrs(number=len(numbered))
                numbered.append((own[label], f"{name}, {label}" if label else str(name)))
    for number, (dataset, _) in enumerate(numbered):
        verified = verified_by(found.checks, dataset)
        if verified is not None:
            found.verified[number] = verified
    sizes = (sum(detail.size(dataset) for dataset, _ in numbered) for detail in DETAILS)
    detail = next(detail for detail, size in zip(DETAILS, sizes, strict=True) if size <= _MOST)
    found.left_out = detail.words
    for number, (dataset, name) in enumerate(numbered):
        found.curves_known.append(curve_data(detail.of(dataset), name, found.verified.get(number)))
    return found


def _datasets(name: str, item: Any) -> dict[str, xarray.Dataset]:
    """The datasets of a result by their names; the only one of a curve or a table has none."""
    import xarray

    given: Any = item
    if hasattr(item, "points_table"):  # a sweep
        given = item.points_table().to_xarray().assign_attrs(warnings="\n".join(item.failure_lines()))
    elif hasattr(item, "to_table"):
        given = item.to_table().to_xarray()
    elif any(hasattr(item, name) for name in ("bifurcations_frame", "limit_points")):  # curves: with their motions
        given = item.to_xarray(motions=True)
        seconds = getattr(item, "seconds", None)
        if seconds is not None and isinstance(given, xarray.Dataset):
            given = given.assign_attrs(seconds=float(seconds))
    elif hasattr(item, "to_xarray") and not isinstance(item, xarray.Dataset):
        given = item.to_xarray()
    every = given if isinstance(given, dict) else {"": given}
    for dataset in every.values():
        if not isinstance(dataset, xarray.Dataset):
            raise InputError(
                f"{name}: expected a dataset of a curve, got {type(dataset).__name__}; a branch has to_xarray()"
            )
        if not is_isolas(dataset) and ("row" not in dataset.sizes or "point" in dataset.sizes):
            check_layout(dataset.attrs)
    return {str(label): dataset for label, dataset in every.items()}


# -------------------------------------------------------------------------------------------------------------- summary
def _counts(found: Found, anchors: Mapping[str, str]) -> list[tuple[int | str, str, str]]:
    """What was found: how many, of what, and where the first of it stands; maps and the like by name."""
    curves = [data for data in found.every if has_points(data) and not is_isolas(data)]
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
            if not number:
                continue
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


def _nothing(name: str, own: Mapping[str, xarray.Dataset]) -> str:
    """In a line that an analysis found nothing."""
    head = next(iter(own.values()), None)
    said = (
        "" if head is None else str(head.attrs.get("said") or head.attrs.get("title") or head.attrs.get("ended") or "")
    )
    return f"{name}: {said or 'nothing'}"


def _verification(found: Found) -> str:
    """How many points were checked in the time domain, in a sentence."""
    total = sum(data.sizes["point"] for data in found.every if number_of(data) >= 0)
    checked = sum(len(verified.points) for verified in found.verified.values())
    if not total:
        return ""
    share = "None" if not checked else f"{checked} of {total}"
    how = ' (the analysis "verify", so.verify)' if not checked else ""
    return f"{share} of the points {'was' if checked == 1 else 'were'} checked in the time domain{how}."


def _attention(sections: Sequence[Section], found: Found) -> Iterator[tuple[str, str]]:
    """What the reader must know before believing the numbers, each with where it is said at length; once where several
    curves have the same note.
    """
    notes: dict[str, list[tuple[str, str]]] = {}
    for section in sections:
        for note in section.notes:
            notes.setdefault(note, []).append((section.heading, section.anchor))
        for curve in section.curves:
            name = found.curves_known[number_of(curve.dataset)]["name"]
            for note in notes_on(curve.dataset):
                notes.setdefault(note, []).append((name, curve.anchor))
    for name, own in found.datasets.items():
        for head in filter(is_isolas, own.values()):
            if is_empty(own):
                for note in notes_on_isolas(head)[1]:
                    notes.setdefault(note, []).append((name, ""))
    for note, places in notes.items():
        names = [name for name, _ in places]
        words = (
            ", ".join(names) if len(names) <= _NAMED else f"{', '.join(names[:_NAMED])} and {len(names) - _NAMED} more"
        )
        yield f"{words}: {note}", places[0][1]
    for number, verified in found.verified.items():
        if verified.wrong:
            name = found.curves_known[number]["name"]
            yield f"{name}: shooting disagrees at {verified.wrong} places", f"curve-{number}"
