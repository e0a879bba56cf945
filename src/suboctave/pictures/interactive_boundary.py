"""Curves of bifurcations for the browser: in the plane of their parameters, and in space among response curves.

Plotly traces as plain data, like those of `interactive`.
"""

from __future__ import annotations

import html
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.boundary import BORDER, PALE, SUBCRITICAL, WITHIN
from suboctave.pictures.boundary_lines import (
    boundary_names,
    boundary_styles,
    is_boundary,
    kind_of,
    subcritical_pieces,
)
from suboctave.pictures.boundary_marks import event_words
from suboctave.pictures.interactive import AXIS, DASHES, FONT, SYMBOLS, Words, layout_of, short
from suboctave.pictures.periods import period_colour, period_name, period_of, tinted
from suboctave.pictures.regions import CENTRE, MERGING, Region, end_text, regions, split, with_ends
from suboctave.pictures.space import CLEAR, SHADE
from suboctave.pictures.space_view import Space, strokes_in_space, surfaces_in_space
from suboctave.pictures.strokes import Line, line
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray

__all__ = ["plane_data", "space_data"]

_UP = "_up"
#: what symbols there are in space; circles for all others
_SOLID_SYMBOLS: dict[Any, str] = {
    (4, 1, 0): "diamond",
    "s": "square",
    "D": "diamond",
    "d": "diamond",
    "P": "cross",
    "x": "x",
    "X": "x",
}


def plane_data(curves: Mapping[str, xarray.Dataset], across: str, upwards: str, name: str) -> dict[str, Any]:
    """Traces and layout of boundaries over the plane of two parameters, ready for JSON; regions of isolas behind."""
    heads = split(list(curves.values()))[1]
    curves = {label: with_ends(data, heads) for label, data in curves.items() if not any(data is h for h in heads)}
    group = list(curves.values())
    kinds = boundary_names(group)
    shaded = [region for region in regions(heads) if {"omega", region.parameter} == {across, upwards}]
    data = [_region(region, across) for region in shaded]
    events: list[dict[str, Any]] = []
    for index, (label, dataset) in enumerate(curves.items()):
        curve = boundary_styles(group, kinds)[index]
        said = html.escape(f"{label}: {kinds[index]}" if len(curves) > 1 else kinds[index])
        values, at_events = coordinate(dataset, upwards)
        prepared = dataset.assign({_UP: ("point", values), f"event_{_UP}": ("event", at_events)})
        whole = line(prepared, across, _UP)
        words = Words(dataset)
        data += _lines(whole, words, said, curve)
        data += _subcritical(dataset, whole, words, said, curve)
        events += _events(dataset, coordinate(dataset, across)[1], at_events, words, said)
    events.sort(key=lambda trace: bool(trace["name"].startswith("isola")))  # the ends of isolas on top
    named: set[str] = set()
    for trace in events:  # a kind stands once in the legend
        trace["showlegend"] = trace["name"] not in named
        named.add(trace["name"])
    layout = layout_of(_spelt(across), html.escape(_spelt(upwards)))
    return {"data": data + events, "layout": layout, "name": name}


def _region(region: Region, across: str) -> dict[str, Any]:
    omega, value = (short(part.tolist()) for part in region.outline)
    x, y = (omega, value) if across == "omega" else (value, omega)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": html.escape(region.words),
        "x": x,
        "y": y,
        "fill": "toself",
        "fillcolor": tinted(region.colour, PALE),
        "line": {"width": 0},
        "hoverinfo": "skip",
    }


def _lines(whole: Line, words: Words, said: str, curve: style.CurveStyle) -> list[dict[str, Any]]:
    traces = []
    verdicts: list[bool | None] = [None] if whole.stable is None else [True, False]
    for verdict in verdicts:
        pieces = np.ones(whole.x.size - 1, dtype=bool) if whole.stable is None else whole.stable == verdict
        vertices = _chained(np.flatnonzero(pieces))
        if not vertices:
            continue
        word = "" if verdict is None else BORDER if verdict else WITHIN
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": said if verdict is not False else f"{said}, {WITHIN}",
                "legendgroup": said,
                "x": short([whole.x[i] if i >= 0 else None for i in vertices]),
                "y": short([whole.y[i] if i >= 0 else None for i in vertices]),
                "text": [_told(whole, words, i) for i in vertices],
                "hovertemplate": f"{said}<br>{word}<br>%{{text}}<extra></extra>",
                "connectgaps": False,
                "line": {
                    "color": curve.colour,
                    "width": 2.2 * curve.width,
                    "dash": DASHES[0] if verdict is False else "solid",
                },
            }
        )
    return traces


def _chained(pieces: np.ndarray) -> list[int]:
    """Vertices of pieces of a line, -1 between two strokes."""
    vertices: list[int] = []
    for piece in pieces:
        if not vertices or vertices[-1] != piece:
            vertices += [-1, int(piece)] if vertices else [int(piece)]
        vertices.append(int(piece) + 1)
    return vertices


def _told(whole: Line, words: Words, vertex: int) -> str:
    if vertex < 0:
        return ""
    event = int(whole.event[vertex])
    return words.of_event(event) if event >= 0 else words.of_point(int(whole.point[vertex]))


def _subcritical(
    dataset: xarray.Dataset, whole: Line, words: Words, said: str, curve: style.CurveStyle
) -> list[dict[str, Any]]:
    """Hollow marks at the computed points of subcritical parts."""
    pieces = np.flatnonzero(subcritical_pieces(dataset, whole))
    vertices = [int(i) for i in np.unique(np.concatenate([pieces, pieces + 1])) if whole.point[i] >= 0]
    if not vertices:
        return []
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": f"{said}, {SUBCRITICAL}",
            "legendgroup": said,
            "x": short([whole.x[i] for i in vertices]),
            "y": short([whole.y[i] for i in vertices]),
            "text": [_told(whole, words, i) for i in vertices],
            "hovertemplate": f"{said}, {SUBCRITICAL}<br>%{{text}}<extra></extra>",
            "marker": {
                "symbol": SYMBOLS[style.kind_style(kind_of(dataset)).marker],
                "size": 7,
                "color": "#ffffff",
                "line": {"color": curve.colour, "width": 1.2},
            },
        }
    ]


def _events(dataset: xarray.Dataset, x: np.ndarray, y: np.ndarray, words: Words, said: str) -> list[dict[str, Any]]:
    traces = []
    for kind, mark, chosen in style.marks(dataset):
        named = html.escape(event_words(kind))
        traces.append(
            {
                "type": "scatter",
                "mode": "markers" if kind == "extremum" else "markers+text",
                "name": named,
                "legendgroup": named,
                "x": short(x[chosen].tolist()),
                "y": short(y[chosen].tolist()),
                "text": [html.escape(end_text(kind, None) if kind in (CENTRE, MERGING) else kind)] * len(chosen),
                "textposition": "middle right",
                "hovertext": [words.of_event(int(i)) for i in chosen],
                "hovertemplate": f"{said}: {named}<br>%{{hovertext}}<extra></extra>",
                "marker": {
                    "symbol": SYMBOLS[mark.marker],
                    "size": 1.5 * mark.size,
                    "color": mark.colour,
                    "line": {"color": style.INK, "width": 1.4},
                },
            }
        )
    return traces


def space_data(curves: Mapping[str, xarray.Dataset], across: str, depth: str, name: str) -> dict[str, Any]:
    """Traces and layout of response curves and boundaries in space, ready for JSON."""
    space = Space(across, depth)
    surfaces = surfaces_in_space(list(curves.values()), space)
    heads = split(list(curves.values()))[1]
    curves = {
        label: with_ends(data, heads) if is_boundary(data) else data
        for label, data in curves.items()
        if not any(data is head for head in heads)
    }
    bounds = [dataset for dataset in curves.values() if is_boundary(dataset)]
    kinds = boundary_names(bounds)
    styles = dict(zip(map(id, bounds), boundary_styles(bounds, kinds), strict=True))
    low = min(float(np.nanmin(space.values(dataset)[0][2])) for dataset in curves.values())
    floor = min(low, 0.0)
    data = [_surface(grid, period_colour(nu), f"{period_name(nu)} isola") for nu, grid in surfaces]
    for label, dataset in curves.items():
        curve = styles.get(id(dataset))
        said = html.escape(label)
        colour = period_colour(period_of(dataset)) if curve is None else curve.colour
        shown = True
        for (x, y, z), stable in strokes_in_space(dataset, space):
            drawn = {
                "color": colour,
                "width": 3 if curve is None else 6,
                "dash": "dash" if stable is False else "solid",
            }
            data.append(_in_space(x, y, z, drawn, said, shown))
            shown = False
            if curve is not None:
                pale = {"color": tinted(colour, SHADE), "width": 2, "dash": "solid"}
                data.append(_in_space(x, y, np.full_like(z, floor), pale, said, False))
        if curve is not None:
            data += _events_in_space(dataset, space, said)
    first = next(iter(curves.values()))
    titles = (_spelt(across), _spelt(depth), layout_of("", "", (first,))["yaxis"]["title"]["text"])
    axis = {name: value for name, value in AXIS.items() if name in ("showline", "linecolor", "gridcolor", "zeroline")}
    scene = {
        f"{letter}axis": {**axis, "title": {"text": text if letter == "z" else html.escape(text)}}
        for letter, text in zip("xyz", titles, strict=True)
    }
    layout = {
        "font": FONT,
        "margin": {"l": 0, "r": 0, "t": 34, "b": 0},
        "paper_bgcolor": "white",
        "legend": {"orientation": "h", "yref": "container", "y": 0, "yanchor": "bottom", "x": 0, "font": {"size": 12}},
        "scene": {
            **scene,
            "aspectmode": "manual",
            "aspectratio": {"x": 1.5, "y": 1.15, "z": 0.95},
            "camera": {"eye": {"x": 1.05, "y": -1.75, "z": 0.9}, "center": {"x": 0, "y": 0, "z": -0.2}},
        },
    }
    return {"data": data, "layout": layout, "name": name, "space": True}


def _surface(grid: np.ndarray, colour: str, said: str) -> dict[str, Any]:
    return {
        "type": "surface",
        "name": said,
        "showlegend": True,
        **{letter: [short(row.tolist()) for row in part] for letter, part in zip("xyz", grid, strict=True)},
        "colorscale": [[0, colour], [1, colour]],
        "showscale": False,
        "opacity": CLEAR,
        "hoverinfo": "skip",
        "contours": {f"{letter}": {"highlight": False} for letter in "xyz"},
    }


def _in_space(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, drawn: dict[str, Any], said: str, shown: bool
) -> dict[str, Any]:
    return {
        "type": "scatter3d",
        "mode": "lines",
        "name": said,
        "legendgroup": said,
        "showlegend": shown,
        "x": short(x.tolist()),
        "y": short(y.tolist()),
        "z": short(z.tolist()),
        "hovertemplate": f"{said}<br>%{{x:.6g}}, %{{y:.6g}}, %{{z:.6g}}<extra></extra>",
        "line": drawn,
    }


def _events_in_space(dataset: xarray.Dataset, space: Space, said: str) -> list[dict[str, Any]]:
    at, words = space.values(dataset)[1], Words(dataset)
    return [
        {
            "type": "scatter3d",
            "mode": "markers",
            "name": html.escape(event_words(kind)),
            "legendgroup": said,
            **{letter: short(row[chosen].tolist()) for letter, row in zip("xyz", at, strict=True)},
            "text": [words.of_event(int(i)) for i in chosen],
            "hovertemplate": f"{said}: {html.escape(event_words(kind))}<br>%{{text}}<extra></extra>",
            "marker": {
                "symbol": _SOLID_SYMBOLS.get(mark.marker, "circle"),
                "size": 5,
                "color": mark.colour,
                "line": {"color": style.INK, "width": 1},
            },
        }
        for kind, mark, chosen in style.marks(dataset)
    ]


def _spelt(name: str) -> str:
    return "forcing frequency ω" if name == "omega" else name
