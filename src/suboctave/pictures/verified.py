"""A branch and what shooting says of its points: ticks where it agrees, crosses where it does not."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.in_time import _finish, _frame
from suboctave.pictures.response import draw_response
from suboctave.pictures.view import View

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

__all__ = ["plot_verified"]

#: by outcome: what the legend says, marker, colour, size
_MARKS = {
    "agrees": ("agrees with shooting", r"$\checkmark$", "#009E73", 5.5),
    "cannot tell": ("cannot tell", r"$?$", style.SOFT, 6.5),
    "disagrees": ("disagrees", "X", "#D55E00", 8.0),
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
    figure, axes, look = _frame(size)
    legend: dict[str, Any] = dict(draw_response(axes, [curve], view=View(), look=look))
    told = np.array(list(outcomes))
    for outcome, (name, marker, colour, large) in _MARKS.items():
        here = places[told == outcome] if len(told) else np.zeros((0, 2))
        if len(here):
            legend[name] = axes.plot(
                here[:, 0],
                here[:, 1],
                linestyle="none",
                marker=marker,
                color=colour,
                markersize=large * look.marker,
                markeredgewidth=0.4 * look.edge,
                zorder=7 if outcome == "disagrees" else 4.5,
                gid=outcome,
                clip_on=False,
            )[0]
    if len(unconfirmed):
        legend["not confirmed"] = axes.plot(
            unconfirmed[:, 0],
            unconfirmed[:, 1],
            "o",
            markersize=13.0 * look.marker,
            markerfacecolor="none",
            markeredgecolor="#D55E00",
            markeredgewidth=1.6 * look.edge,
            zorder=7,
            gid="not confirmed",
            clip_on=False,
        )[0]
    axes.set_ylim(bottom=0.0)
    return _finish(figure, axes, legend, look, title, path)
