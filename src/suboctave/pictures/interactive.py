"""Response curves for the browser: Plotly traces as plain data, made without Plotly.

The same strokes, markers and colours as in print. Each trace is one kind of thing in the legend: the stable part of a
curve, its unstable part, the bifurcations of one kind.
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.strokes import line
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray

__all__ = ["figure_data"]

_SYMBOLS = {"o": "circle", "v": "triangle-down", "s": "square", "D": "diamond", "x": "x-thin", "*": "star"}
_DASHES = ("7px,4px", "10px,3px,2px,3px", "2px,3px")
_DIGITS = 9


def figure_data(curves: Mapping[str, xarray.Dataset], horizontal: str, name: str) -> dict[str, Any]:
    """Traces and layout of one figure with the curves over `horizontal`, ready for JSON."""
    several = len(curves) > 1
    data: list[dict[str, Any]] = []
    for index, (label, dataset) in enumerate(curves.items()):
        curve = style.curve_style(index) if several else style.ONE_CURVE
        data += _lines(dataset, horizontal, html.escape(label), curve, index, several)
    for index, (label, dataset) in enumerate(curves.items()):
        edge = style.curve_style(index).colour if several else style.INK
        data += _markers(dataset, horizontal, html.escape(label), edge, several)
    first = next(iter(curves.values()))
    across = "forcing frequency ω" if horizontal == "omega" else html.escape(horizontal)
    one = int(first.attrs.get("dofs", 1)) == 1
    x = "x" if one else f"x<sub>{int(first.attrs.get('observed_dof', 0))}</sub>"
    axis = {
        "showline": True,
        "mirror": True,
        "ticks": "inside",
        "linecolor": style.INK,
        "gridcolor": style.GRID,
        "zeroline": False,
    }
    layout = {
        "font": {"family": "system-ui, Segoe UI, DejaVu Sans, Arial, sans-serif", "size": 13, "color": style.INK},
        "margin": {"l": 64, "r": 12, "t": 34, "b": 52},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "hoverlabel": {"align": "left"},
        "xaxis": {**axis, "title": {"text": across, "standoff": 8}, "automargin": True},
        "yaxis": {**axis, "title": {"text": f"amplitude max |{x}|"}, "rangemode": "tozero"},
        "legend": {
            "orientation": "h",
            "yref": "container",
            "y": 0,
            "yanchor": "bottom",
            "x": 0,
            "font": {"size": 12},
        },
    }
    return {"data": data, "layout": layout, "name": name}


def _lines(
    dataset: xarray.Dataset, horizontal: str, label: str, curve: style.CurveStyle, index: int, several: bool
) -> list[dict[str, Any]]:
    whole = line(dataset, horizontal)
    verdicts = [None] if whole.stable is None else [True, False]
    traces = []
    for verdict in verdicts:
        vertices = _of_verdict(whole.stable, verdict, whole.x.size)
        if not vertices:
            continue
        at = np.array(vertices)
        kept = at >= 0
        word = "motions" if verdict is None else "stable" if verdict else "unstable"
        x = [float(whole.x[i]) if i >= 0 else None for i in at]
        y = [float(whole.y[i]) if i >= 0 else None for i in at]
        told = [
            _told(dataset, int(whole.point[i]), int(whole.event[i])) if keep else ""
            for i, keep in zip(at, kept, strict=True)
        ]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": f"{label}: {word}" if several else word,
                "legendgroup": label,
                "x": _short(x),
                "y": _short(y),
                "text": told,
                "hovertemplate": f"{label}: {word}<br>%{{text}}<extra></extra>",
                "connectgaps": False,
                "line": {
                    "color": curve.colour,
                    "width": 2.2 * curve.width,
                    "dash": _DASHES[index % len(_DASHES)] if verdict is False else "solid",
                },
            }
        )
    return traces


def _of_verdict(stable: np.ndarray | None, verdict: bool | None, count: int) -> list[int]:
    """Vertices of all pieces of one verdict, -1 between two strokes."""
    if stable is None or stable.size == 0:
        return list(range(count)) if not verdict else []
    vertices: list[int] = []
    for piece in np.flatnonzero(stable == verdict):
        if not vertices or vertices[-1] != piece:
            vertices += [-1, int(piece)] if vertices else [int(piece)]
        vertices.append(int(piece) + 1)
    return vertices


def _markers(dataset: xarray.Dataset, horizontal: str, label: str, edge: str, several: bool) -> list[dict[str, Any]]:
    positions = coordinate(dataset, horizontal)[1]
    heights = dataset["event_amplitude"].to_numpy()
    kinds = np.array([str(kind) for kind in dataset["event_kind"].to_numpy()])
    traces = []
    for kind in dict.fromkeys(kinds):
        mark = style.kind_style(kind)
        chosen = np.flatnonzero(kinds == kind)
        named = html.escape(mark.name)
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": f"{label}: {named}" if several else named,
                "legendgroup": label if several else named,
                "x": _short(positions[chosen].tolist()),
                "y": _short(heights[chosen].tolist()),
                "text": [_told(dataset, -1, int(i)) for i in chosen],
                "hovertemplate": f"{label}: {named}<br>%{{text}}<extra></extra>",
                "marker": {
                    "symbol": _SYMBOLS[mark.marker],
                    "size": 1.5 * mark.size,
                    "color": mark.colour,
                    "line": {"color": edge, "width": 1.8},
                },
            }
        )
    return traces


def _told(dataset: xarray.Dataset, point: int, event: int) -> str:
    """What hovering over a vertex says: omega, the free parameter, amplitude, the leading multiplier."""
    prefix, index = ("event_", event) if event >= 0 else ("", point)
    free = str(dataset.attrs["free"])
    at, there = coordinate(dataset, free)
    lines = [f"ω = {float(dataset[f'{prefix}omega'].values[index]):.{_DIGITS}g}"]
    if free != "omega":
        lines.append(f"{html.escape(free)} = {float((there if event >= 0 else at)[index]):.{_DIGITS}g}")
    lines.append(f"amplitude = {float(dataset[f'{prefix}amplitude'].values[index]):.7g}")
    if event >= 0:
        mu = complex(dataset["event_multiplier"].values[index])
    elif "multipliers" in dataset and dataset.sizes.get("multiplier"):
        mu = complex(dataset["multipliers"].values[index, 0])
    else:
        mu = complex(math.nan, math.nan)
    if np.isfinite(mu):
        shown = f"{mu.real:.5g}" if abs(mu.imag) < 1e-7 else f"{mu.real:.5g} {mu.imag:+.5g}i"
        lines.append(f"{'critical' if event >= 0 else 'leading'} multiplier = {shown}, modulus {abs(mu):.5g}")
    return "<br>".join(lines)


def _short(values: list[Any]) -> list[float | None]:
    """Numbers with the digits that a screen can show; null where there is none."""
    return [None if v is None or not math.isfinite(v) else float(f"{v:.{_DIGITS}g}") for v in values]
