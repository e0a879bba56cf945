"""Markers on curves of bifurcations: the small ones along a line, and those of its events."""

from __future__ import annotations

from typing import Any

import numpy as np

from suboctave.pictures import style

__all__ = ["SMALL", "event_drawing", "event_words", "mark_events", "small_mark"]

#: how large the small marks along a line are beside the others
SMALL = 0.55


def event_words(kind: str) -> str:
    """What a legend says of a kind of event; the short name is the one written beside it."""
    name = style.kind_style(kind).name
    return name if kind in ("extremum", name) or kind.startswith("isola") else f"{kind}: {name}"


def small_mark(kind: str, curve: style.CurveStyle, look: style.Look, *, hollow: bool) -> dict[str, Any]:
    """A mark along a line."""
    mark = style.kind_style(kind)
    return {
        "marker": mark.marker,
        "markersize": SMALL * mark.size * look.marker,
        "markerfacecolor": "white" if hollow else curve.colour,
        "markeredgecolor": curve.colour,
        "markeredgewidth": look.edge,
    }


def mark_events(axes: Any, dataset: Any, at: np.ndarray, look: style.Look, marked: np.ndarray) -> None:
    """Markers of extrema and points of codimension two; `at`, (2, events) or, in space, (3, events).

    `marked`, (events,): which of them.
    """
    for kind, mark, every in style.marks(dataset):
        which = every[marked[every]]
        if not which.size:
            continue
        above = 5.5 if kind.startswith("isola") else 5.0
        axes.plot(*at[:, which], zorder=above, gid=kind, clip_on=False, **event_drawing(mark, look))


def event_drawing(mark: style.KindStyle, look: style.Look) -> dict[str, Any]:
    """How a kind of event is marked."""
    return {
        "linestyle": "none",
        "marker": mark.marker,
        "markersize": mark.size * look.marker,
        "markerfacecolor": mark.colour,
        "markeredgecolor": style.INK,
        "markeredgewidth": look.edge,
    }
