"""A branch and what shooting says of its points: ticks where it agrees, crosses where it does not."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.drawing import Axis, Drawing, Entry, Markers, ordered
from suboctave.pictures.options import Coordinates, View
from suboctave.pictures.paper import figure_of
from suboctave.pictures.response import response_frame
from suboctave.pictures.style import Mark

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


#: by outcome: what the legend says, its mark, its layer
_MARKS = {
    "agrees": ("agrees with shooting", Mark(r"$\checkmark$", 5.5, "#009E73", "#009E73", 0.4), 4.5),
    "cannot tell": ("cannot tell", Mark(r"$?$", 6.5, style.SOFT, style.SOFT, 0.4), 4.5),
    "disagrees": ("disagrees", Mark("X", 8.0, "#D55E00", "#D55E00", 0.4), 7.0),
    "not confirmed": ("not confirmed", Mark("o", 13.0, "none", "#D55E00", 1.6), 7.0),
}


def plot_verified(
    curve: xarray.Dataset,
    places: np.ndarray,
    outcomes: Sequence[str],
    unconfirmed: np.ndarray,
    path: str | Path | None = None,
    *,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 4.2),
) -> Figure:
    """The curve of a dataset with a mark at each of `places` (P, 2), by its outcome.

    `unconfirmed` (B, 2): bifurcations that shooting did not confirm; they get a ring.
    """
    axes = Coordinates((str(curve.attrs["free"]), None), View())
    frame, entries = response_frame([curve], axes)
    frame.title = style.checked_text(title)
    every = np.concatenate([np.reshape(places, (-1, 2)), np.reshape(unconfirmed, (-1, 2))])
    kinds = np.array([*outcomes, *["not confirmed"] * len(unconfirmed)])
    for outcome, (name, mark, layer) in _MARKS.items():
        here = every[kinds == outcome]
        if len(here):
            frame.items.append(Markers(here.T, mark, role=outcome, layer=layer))
            entries[name] = Entry(mark=mark)
    across, upwards = axes.labels([curve])
    drawing = Drawing((Axis(across), Axis(upwards, 0.0)), [frame], ordered(entries))
    return figure_of(drawing, style.sheet_of(size), path)
