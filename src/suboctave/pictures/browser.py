"""Drawings for the browser: Plotly traces and layout as plain data, ready for JSON, made without Plotly.

The same strokes, markers, colours and axes as on paper. Each entry of the legend is one kind of thing, which a click
hides: the stable part of a curve, its unstable part, the bifurcations of one kind.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.drawing import (
    Axis,
    Band,
    Beads,
    Drawing,
    Entry,
    Frame,
    Guide,
    Item,
    Label,
    Markers,
    Polyline,
    Raster,
    Region,
    Surface,
)
from suboctave.pictures.strokes import DIGITS, spelt

SYMBOLS: dict[str | tuple[int, int, int], str] = {
    "o": "circle", "v": "triangle-down", "^": "triangle-up", "<": "triangle-left", ">": "triangle-right",
    "s": "square", "D": "diamond", "d": "diamond-tall", "P": "cross", "x": "x-thin", "X": "x", "*": "star",
    "p": "pentagon", "h": "hexagon", "H": "hexagon2", "8": "octagon",
    (4, 1, 0): "star-diamond", (3, 1, 0): "star-triangle-up", (3, 1, 180): "star-triangle-down",
    (4, 1, 45): "star-square", (6, 1, 0): "hexagram", (6, 1, 30): "hexagram", (8, 1, 0): "asterisk",
    "+": "cross-thin", (5, 1, 0): "star", (5, 1, 180): "star", (5, 0, 180): "pentagon", (7, 1, 0): "hash",
}  # fmt: skip
#: what symbols there are in space; circles for all others
_SOLID: dict[Any, str] = {(4, 1, 0): "diamond", "s": "square", "D": "diamond", "d": "diamond", "P": "cross"}
_SOLID |= {"x": "x", "X": "x"}
#: pixels of a line of width 1 in the plane and in space, and of a point of a marker's size and of its edge
_LINE, _LINE_IN_SPACE = 2.2, 3.5
_MARK, _MARK_IN_SPACE, _RIM = 1.5, 0.7, 1.5
#: millimetres of a frame on a screen, by which marks along lines are spaced
_SCREEN = (160.0, 110.0)
#: sides of a point for its text, the preferred one first; shares of the axes within which points are near
_SIDES, _NEAR = ("middle right", "top left", "bottom left", "bottom right"), 0.08
_FONT = {"family": "system-ui, Segoe UI, DejaVu Sans, Arial, sans-serif", "size": 13, "color": style.INK}
_AXIS = {"showline": True, "linecolor": style.INK, "gridcolor": style.GRID, "zeroline": False}
_LEGEND = {"orientation": "h", "yref": "container", "y": 0, "yanchor": "bottom", "x": 0, "font": {"size": 12}}
_PAGE = {"font": _FONT, "paper_bgcolor": "white", "legend": _LEGEND}
_SCENE = {
    "aspectmode": "manual",
    "aspectratio": {"x": 1.5, "y": 1.15, "z": 0.95},
    "camera": {"eye": {"x": 1.05, "y": -1.75, "z": 0.9}, "center": {"x": 0, "y": 0, "z": -0.2}},
}
_MATH = ((r"\omega", spelt("omega")), (r"\lambda", "λ"), (r"\delta", "δ"), (r"\max\,", "max "), (r"\,", " "))


def figure_data(drawing: Drawing, name: str) -> dict[str, Any]:
    """Traces and layout of a drawing of one frame; `name` is that of the file when a reader saves the figure."""
    in_space, frame = len(drawing.axes) == 3, drawing.frames[0]
    # a legend entry belongs to what is drawn on top; where curves have several parts, each curve has one, its line
    together = any(item.group not in ("", item.name) for item in frame.items)
    shown = {
        (item.group or item.name) if together else item.name: item
        for item in sorted(frame.items, key=lambda item: (together and _rank(item), item.layer))
        if item.name
    }
    data: list[dict[str, Any]] = []
    # one trace for all strokes of one look and name, and one for every other thing
    traces: dict[Any, list[Item]] = {}
    for number, item in enumerate(frame.items):
        key: Any = (item.name, item.role, item.pen, item.curve) if isinstance(item, Polyline) else number
        traces.setdefault(key, []).append(item)
    for items in traces.values():
        item = items[0]
        own = [one for one in items if shown.get((one.group or one.name) if together else one.name) is one]
        entry = {
            "name": html_of((item.group or item.name) if own else item.name),
            "legendgroup": html_of(item.group or item.name),
            "showlegend": bool(own),
        }
        drawn = _trace(items, drawing.axes, frame)
        if drawn:
            data.append(drawn | entry | _vertices(items))
    common = {n: own for n, own in frame.entries.items() if n not in shown and (own.mark is not None or n in _STYLES)}
    data += [_sample(name, own) for name, own in common.items()] if together else []
    if any(isinstance(item, Raster) for item in frame.items):
        data += [_patch(name, own) for name, own in frame.entries.items() if own.colour]
    if frame.labels and not in_space:
        data.append(_labels(frame.labels, drawing.axes))
    layout = _space(drawing) if in_space else _plane(drawing)
    axes = [axis.shows for axis in drawing.axes]
    return {"data": data, "layout": layout, "name": name, "axes": axes, **({"space": True} if in_space else {})}


def _rank(item: Item) -> int:
    """Of the parts of a curve the one that stands for it in the legend has the highest: a line, a solid one."""
    return isinstance(item, Polyline) + (isinstance(item, Polyline) and item.role in ("stable", "border", "curve"))


def _vertices(items: Sequence[Item]) -> dict[str, Any]:
    """Which points and events of which curve the places of a trace are: the page knows more of them."""
    known = [item.vertices for item in items if item.vertices is not None]
    if items[0].curve < 0 or len(known) < len(items):
        return {}
    gap = [None] if isinstance(items[0], Polyline) else []
    every = [vertex for own in known for vertex in (*own.tolist(), *gap)]
    return {"meta": {"curve": items[0].curve, "role": items[0].role}, "customdata": every[: len(every) - len(gap)]}


def _patch(name: str, entry: Entry) -> dict[str, Any]:
    """An entry of the legend for cells of one colour, which no trace of their own have."""
    mark = {"symbol": "square", "size": 11, "color": entry.colour, "line": {"color": style.SOFT, "width": 0.5}}
    return {"type": "scatter", "mode": "markers", "x": [None], "y": [None], "name": html_of(name), "marker": mark}


#: entries of a legend that are strokes of any curve
_STYLES = ("unstable", "stability open")


def _sample(name: str, entry: Entry) -> dict[str, Any]:
    """An entry of the legend for what several curves have in common: a kind of marker, a stroke."""
    look: dict[str, Any] = {"mode": "lines", "line": {"color": style.SOFT, "width": _LINE}}
    if entry.mark is not None:
        face = "rgba(0,0,0,0)" if entry.mark.face == "none" else entry.mark.face
        edge = {"color": entry.mark.edge, "width": _RIM * entry.mark.rim}
        symbol = SYMBOLS.get(entry.mark.marker, "circle-cross")
        look = {
            "mode": "markers",
            "marker": {"symbol": symbol, "size": _MARK * entry.mark.size, "color": face, "line": edge},
        }
    elif entry.pen is not None:
        look["line"]["dash"] = _dash(entry.pen)
    return {"type": "scatter", "x": [None], "y": [None], "name": html_of(name), "hoverinfo": "skip", **look}


#: cells of a raster that the browser is given, along each side, and how many colours
_CELLS, _COLOURS = 320, 250


def _raster(item: Raster, frame: Frame) -> dict[str, Any]:
    """Cells by the numbers of their colours, with what the legend calls these."""
    rows, columns = (np.arange(0, count, max(1, math.ceil(count / _CELLS))) for count in item.cells.shape[:2])
    steps = np.round(item.cells[np.ix_(rows, columns)] * 255.0).astype(int)
    found, cells = np.unique(steps.reshape(-1, 3), axis=0, return_inverse=True)
    if len(found) > _COLOURS:  # shades of growth: in coarser steps
        found, cells = np.unique(steps.reshape(-1, 3) // 16 * 16, axis=0, return_inverse=True)
    colours = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in found]
    named = {entry.colour.lower(): html_of(name) for name, entry in reversed(frame.entries.items()) if entry.colour}
    top = len(colours)
    scale = [[(i + end) / top, colour] for i, colour in enumerate(colours) for end in (0, 1)]
    middles = (0.5 * (edges[1:] + edges[:-1]) for edges in (item.across[:], item.upwards[:]))
    x, y = (own[which] for own, which in zip(middles, (columns, rows), strict=True))
    return {
        "type": "heatmap",
        "x": _short(x),
        "y": _short(y),
        "z": cells.reshape(len(rows), len(columns)).tolist(),
        "zmin": -0.5,
        "zmax": top - 0.5,
        "colorscale": scale,
        "showscale": False,
        "meta": {"cells": [named.get(colour, "") for colour in colours]},
        "hovertemplate": "%{x:.6g}, %{y:.6g}<extra></extra>",
    }


def _trace(items: Sequence[Item], axes: Sequence[Axis], frame: Frame) -> dict[str, Any]:
    """The trace of a thing, or of several strokes; empty for what is drawn on paper alone."""
    match items[0]:
        case Polyline():
            return _lines([item for item in items if isinstance(item, Polyline)])
        case Markers() as item:
            return _markers(item, item.at)
        case Beads() as item:
            limits = np.array([(axis.low, axis.high) for axis in axes], dtype=float)
            at = item.places(limits[:, 0], limits[:, 1], _SCREEN)
            return _markers(item, at) if at.shape[1] else {}
        case Raster() as item:
            return _raster(item, frame)
        case Region() as item if len(item.outline) == 2:
            fill = {"fill": "toself", "fillcolor": item.colour, "line": {"width": 0}, "hoverinfo": "skip"}
            return {"type": "scatter", "mode": "lines", **_coordinates(item.outline), **fill}
        case Surface() as item:
            return {
                "type": "surface",
                **{letter: [_short(row) for row in part] for letter, part in zip("xyz", item.grid, strict=True)},
                "colorscale": [[0, item.colour], [1, item.colour]],
                "showscale": False,
                "opacity": item.opacity,
                "hoverinfo": "skip",
                "contours": {letter: {"highlight": False} for letter in "xyz"},
            }
    return {}


def _lines(items: Sequence[Polyline]) -> dict[str, Any]:
    """Strokes, with a gap between one and the next."""
    pen, gap = items[0].pen, np.full((len(items[0].at), 1), np.nan)
    at = np.hstack([part for item in items for part in (item.at, gap)])[:, :-1]
    in_space = len(at) == 3
    width = (_LINE_IN_SPACE if in_space else _LINE) * pen.width
    line = {"color": pen.colour, "width": width, "dash": _dash(pen, "dash" if in_space else "")}
    return {**_scatter(at, "lines", items[0]), "connectgaps": False, "line": line}


def _markers(item: Markers | Beads, at: np.ndarray) -> dict[str, Any]:
    mark = item.mark
    if len(at) == 3:
        look = {"symbol": _SOLID.get(mark.marker, "circle"), "size": _MARK_IN_SPACE * mark.size}
    else:
        look = {"symbol": SYMBOLS.get(mark.marker, "circle-cross"), "size": _MARK * mark.size}
    edge = {"color": mark.edge, "width": _RIM * mark.rim}
    face = "rgba(0,0,0,0)" if mark.face == "none" else mark.face
    return {**_scatter(at, "markers", item), "marker": {**look, "color": face, "line": edge}}


def _scatter(at: np.ndarray, mode: str, item: Item) -> dict[str, Any]:
    """A trace through places, (axes, places); of vertices of a curve the page knows what it says under the mouse."""
    hover: dict[str, Any] = {"hoverinfo": "skip"}
    if item.name or mode == "lines":
        known = item.curve >= 0 and item.vertices is not None
        words = "%{text}" if known else "%{x:.6g}, %{y:.6g}"
        hover = {"hovertemplate": f"{html_of(item.name)}<br>{words}<extra></extra>"}
    return {"type": "scatter3d" if len(at) == 3 else "scatter", "mode": mode, **_coordinates(at), **hover}


def _labels(labels: Sequence[Label], axes: Sequence[Axis]) -> dict[str, Any]:
    """Texts beside points; of those near each other, in units of the axes, one to the right, the next above, ..."""
    size = np.array([float(axis.high or 0.0) - float(axis.low or 0.0) for axis in axes])
    taken: list[tuple[np.ndarray, str, str]] = []
    for label in labels:
        near = [text for at, text, _ in taken if np.abs((at - label.at) / size).max() < _NEAR]
        if label.text not in near:
            taken.append((label.at, label.text, _SIDES[len(near) % len(_SIDES)]))
    return {
        "type": "scatter",
        "mode": "text",
        "name": "",
        "cliponaxis": False,
        **_coordinates(np.array([at for at, _, _ in taken]).T),
        "text": [f"\u2003{html_of(text)}\u2003" for _, text, _ in taken],
        "textposition": [side for _, _, side in taken],
        "hoverinfo": "skip",
        "showlegend": False,
    }


def _dash(pen: style.Pen, name: str = "") -> str:
    """The dashes of a line, in pixels; in space, where there are few, by `name`."""
    if isinstance(pen.dash, str):
        return pen.dash
    return name or ",".join(f"{max(1, round(_LINE * part))}px" for part in pen.dash[1])


def _coordinates(at: np.ndarray) -> dict[str, list[float | None]]:
    return {letter: _short(row) for letter, row in zip("xyz", at, strict=False)}


def _short(values: np.ndarray) -> list[float | None]:
    """Numbers with the digits that a screen can show; null where there is none."""
    return [float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None for value in values.tolist()]


# --------------------------------------------------------------------------------------------------------------- layout
def _axis(axis: Axis, **others: Any) -> dict[str, Any]:
    limits: dict[str, Any] = {}
    if axis.low is not None and axis.high is not None:
        ends = [axis.low, axis.high]
        limits = {"range": [math.log10(end) for end in ends] if axis.logarithmic else ends}
    if axis.logarithmic:
        limits["type"] = "log"
    elif axis.low is not None and axis.high is None:
        limits["rangemode"] = "tozero"
    return {**_AXIS, "title": {"text": html_of(axis.label)}, **limits, **others}


def _plane(drawing: Drawing) -> dict[str, Any]:
    across, upwards = (_axis(axis, mirror=True, ticks="inside") for axis in drawing.axes)
    across["title"]["standoff"] = 8
    shapes = [shape for item in drawing.frames[0].items for shape in _shape(item)]
    return {
        **_PAGE,
        "margin": {"l": 64, "r": 12, "t": 34, "b": 52},
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "hoverlabel": {"align": "left"},
        "xaxis": {**across, "automargin": True},
        "yaxis": upwards,
        **({"shapes": shapes} if shapes else {}),
    }


def _shape(item: Item) -> list[dict[str, Any]]:
    """A straight line or a band through the whole frame."""
    if isinstance(item, Band):
        return [
            {"type": "rect", "xref": "paper", "x0": 0, "x1": 1, "y0": item.low, "y1": item.high, "layer": "below"}
            | {"fillcolor": item.colour, "line": {"width": 0}}
        ]
    if isinstance(item, Guide):
        ends = ("y", "x") if item.upright else ("x", "y")
        along = {f"{ends[0]}ref": "paper", f"{ends[0]}0": 0, f"{ends[0]}1": 1}
        line = {"color": item.pen.colour, "width": _LINE * item.pen.width}
        return [{"type": "line", **along, f"{ends[1]}0": item.value, f"{ends[1]}1": item.value, "line": line}]
    return []


def _space(drawing: Drawing) -> dict[str, Any]:
    axes = {f"{letter}axis": _axis(axis) for letter, axis in zip("xyz", drawing.axes, strict=True)}
    return {**_PAGE, "margin": {"l": 0, "r": 0, "t": 34, "b": 0}, "scene": {**axes, **_SCENE}}


def html_of(text: str) -> str:
    """A text of a figure as HTML: what is between dollar signs in letters, with indices."""
    pieces = re.split(r"(?<!\\)\$", html.escape(text))
    if len(pieces) % 2 == 0:  # a single dollar sign is itself
        return html.escape(text).replace(r"\$", "$")
    for i in range(1, len(pieces), 2):
        formula = pieces[i]
        for spelling, letter in _MATH:
            formula = formula.replace(spelling, letter)
        for command, accent in (("ddot", "\u0308"), ("dot", "\u0307")):
            formula = re.sub(rf"\\{command}{{(\w)((?:_{{\w+}}|_\w)?)}}", rf"\1{accent}\2", formula)
            formula = re.sub(rf"\\{command} (\w)", rf"\1{accent}", formula)
        pieces[i] = re.sub(r"_{(\w+)}|_(\w)", r"<sub>\1\2</sub>", formula)
    return "".join(pieces).replace(r"\$", "$")
