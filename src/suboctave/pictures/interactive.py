"""Response curves for the browser: Plotly traces as plain data, made without Plotly.

The same strokes, markers and colours as in print. Each trace is one kind of thing in the legend: the stable part of a
curve, its unstable part, the bifurcations of one kind.
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.periods import curve_styles, period_of, several_periods
from suboctave.pictures.strokes import line, repeated
from suboctave.pictures.view import observed
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray

__all__ = ["AXIS", "DASHES", "FONT", "SYMBOLS", "Words", "figure_data", "layout_of", "short"]

SYMBOLS: dict[str | tuple[int, int, int], str] = {
    "o": "circle",
    "v": "triangle-down",
    (4, 1, 0): "star-diamond",
    (3, 1, 0): "star-triangle-up",
    (3, 1, 180): "star-triangle-down",
    (4, 1, 45): "star-square",
    "^": "triangle-up",
    "s": "square",
    "D": "diamond",
    "x": "x-thin",
    "*": "star",
    "d": "diamond-tall",
    "P": "cross",
    "h": "hexagon",
    "<": "triangle-left",
    ">": "triangle-right",
    "p": "pentagon",
    "8": "octagon",
    "X": "x",
}
DASHES = ("7px,4px", "10px,3px,2px,3px", "2px,3px")
_DIGITS = 9
FONT = {"family": "system-ui, Segoe UI, DejaVu Sans, Arial, sans-serif", "size": 13, "color": style.INK}
AXIS = {
    "showline": True,
    "mirror": True,
    "ticks": "inside",
    "linecolor": style.INK,
    "gridcolor": style.GRID,
    "zeroline": False,
}


def figure_data(curves: Mapping[str, xarray.Dataset], horizontal: str, name: str) -> dict[str, Any]:
    """Traces and layout of one figure with the curves over `horizontal`, ready for JSON."""
    several = len(curves) > 1
    styles = curve_styles(list(curves.values()), list(curves))
    told = several or several_periods(list(curves.values()))
    data: list[dict[str, Any]] = []
    for index, (label, dataset) in enumerate(curves.items()):
        data += _lines(dataset, horizontal, html.escape(label), styles[index], index, several)
    for index, (label, dataset) in enumerate(curves.items()):
        edge = styles[index].colour if told else style.INK
        data += _markers(dataset, horizontal, html.escape(label), edge, several)
    across = "forcing frequency ω" if horizontal == "omega" else html.escape(horizontal)
    return {"data": data, "layout": layout_of(across, None, tuple(curves.values())), "name": name}


def layout_of(across: str, upwards: str | None, datasets: Sequence[xarray.Dataset] = ()) -> dict[str, Any]:
    """The layout of a frame; with `datasets` and nothing else said, their amplitude upwards."""
    upright: dict[str, Any] = {**AXIS, "title": {"text": upwards}}
    if datasets:
        dofs = observed(datasets)
        one = int(datasets[0].attrs.get("dofs", 1)) == 1
        x = "x<sub>i</sub>" if len(dofs) > 1 else "x" if one else f"x<sub>{dofs[0]}</sub>"
        said = f", i = {', '.join(map(str, dofs))}" if len(dofs) > 1 else ""
        upright |= {"title": {"text": f"amplitude max |{x}|{said}"}, "rangemode": "tozero"}
    return {
        "font": FONT,
        "margin": {"l": 64, "r": 12, "t": 34, "b": 52},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "hoverlabel": {"align": "left"},
        "xaxis": {**AXIS, "title": {"text": across, "standoff": 8}, "automargin": True},
        "yaxis": upright,
        "legend": {
            "orientation": "h",
            "yref": "container",
            "y": 0,
            "yanchor": "bottom",
            "x": 0,
            "font": {"size": 12},
        },
    }


def _lines(
    dataset: xarray.Dataset, horizontal: str, label: str, curve: style.CurveStyle, index: int, several: bool
) -> list[dict[str, Any]]:
    whole = line(dataset, horizontal)
    words = Words(dataset)
    again = repeated(whole)
    verdicts = [None] if whole.stable is None else [True, False]
    traces = []
    for verdict in verdicts:
        vertices = _of_verdict(whole.stable, verdict, whole.x.size, again)
        if not vertices:
            continue
        word = "motions" if verdict is None else "stable" if verdict else "unstable"
        x = [float(whole.x[i]) if i >= 0 else None for i in vertices]
        y = [float(whole.y[i]) if i >= 0 else None for i in vertices]
        told = [
            "" if i < 0 else words.of_event(whole.event[i]) if whole.event[i] >= 0 else words.of_point(whole.point[i])
            for i in vertices
        ]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": f"{label}: {word}" if several else word,
                "legendgroup": label,
                "x": short(x),
                "y": short(y),
                "text": told,
                "hovertemplate": f"{label}: {word}<br>%{{text}}<extra></extra>",
                "connectgaps": False,
                "line": {
                    "color": curve.colour,
                    "width": 2.2 * curve.width,
                    "dash": DASHES[index % len(DASHES)] if verdict is False else "solid",
                },
            }
        )
    return traces


def _of_verdict(stable: np.ndarray | None, verdict: bool | None, count: int, again: np.ndarray) -> list[int]:
    """Vertices of all pieces of one verdict, -1 between two strokes, without those that are there `again`."""
    if stable is None or stable.size == 0:
        return list(range(count)) if not verdict else []
    vertices: list[int] = []
    for piece in np.flatnonzero((stable == verdict) & ~again):
        if not vertices or vertices[-1] != piece:
            vertices += [-1, int(piece)] if vertices else [int(piece)]
        vertices.append(int(piece) + 1)
    return vertices


def _markers(dataset: xarray.Dataset, horizontal: str, label: str, edge: str, several: bool) -> list[dict[str, Any]]:
    positions = coordinate(dataset, horizontal)[1]
    words, heights = Words(dataset), dataset["event_amplitude"].to_numpy()
    smaller = style.OF_SUBHARMONICS if several and period_of(dataset) > 1 else 1.0
    traces = []
    for _, mark, chosen in style.marks(dataset):
        named = html.escape(mark.name)
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": f"{label}: {named}" if several else named,
                "legendgroup": label if several else named,
                "x": short(positions[chosen].tolist()),
                "y": short(heights[chosen].tolist()),
                "text": [words.of_event(int(i)) for i in chosen],
                "hovertemplate": f"{label}: {named}<br>%{{text}}<extra></extra>",
                "marker": {
                    "symbol": SYMBOLS[mark.marker],
                    "size": 1.5 * mark.size * smaller,
                    "color": mark.colour,
                    "line": {"color": edge, "width": 1.8},
                },
            }
        )
    return traces


class Words:
    """What hovering over a point or an event says: omega, free parameters, amplitude, a multiplier."""

    def __init__(self, dataset: xarray.Dataset) -> None:
        plane = str(dataset.attrs.get("plane", "")).split("\n") if dataset.attrs.get("tracked") else []
        free = list(dict.fromkeys(name for name in [*plane, str(dataset.attrs["free"])] if name != "omega"))
        self.free = [html.escape(name) for name in free]
        self.at = [coordinate(dataset, name) for name in free]
        known = "multipliers" in dataset and dataset.sizes.get("multiplier", 0) > 0
        leading = dataset["multipliers"].to_numpy()[:, 0] if known else np.full(dataset.sizes["point"], np.nan + 0.0j)
        self.points = (dataset["omega"].to_numpy(), dataset["amplitude"].to_numpy(), leading)
        self.events = (
            dataset["event_omega"].to_numpy(),
            dataset["event_amplitude"].to_numpy(),
            dataset["event_multiplier"].to_numpy(),
        )

    def of_point(self, index: int) -> str:
        return self._told(self.points, index, 0)

    def of_event(self, index: int) -> str:
        return self._told(self.events, index, 1)

    def _told(self, columns: tuple[np.ndarray, ...], index: int, at_event: int) -> str:
        omega, amplitude, multiplier = (column[index] for column in columns)
        which = ("leading", "critical")[at_event]
        lines = [f"ω = {omega:.{_DIGITS}g}"]
        lines += [f"{n} = {at[at_event][index]:.{_DIGITS}g}" for n, at in zip(self.free, self.at, strict=True)]
        lines.append(f"amplitude = {amplitude:.7g}")
        mu = complex(multiplier)
        if np.isfinite(mu):
            shown = f"{mu.real:.5g}" if abs(mu.imag) < 1e-7 else f"{mu.real:.5g} {mu.imag:+.5g}i"
            lines.append(f"{which} multiplier = {shown}, modulus {abs(mu):.5g}")
        return "<br>".join(lines)


def short(values: list[Any]) -> list[float | None]:
    """Numbers with the digits that a screen can show; null where there is none."""
    return [None if v is None or not math.isfinite(v) else float(f"{v:.{_DIGITS}g}") for v in values]
