"""Curves of bifurcations in the plane of their two parameters: which side of a boundary a design lies on.

Solid where the boundary is one of stable motions (all multipliers but the critical one inside the unit circle), dashed
where motions on both sides are unstable; extrema and points of codimension two marked. Drawn from datasets, like
response curves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.pictures import style
from suboctave.pictures.legend import ordered, place_legend
from suboctave.pictures.response import draw_response
from suboctave.pictures.saving import png_bytes, save_figure
from suboctave.pictures.view import View
from suboctave.store.layout import check_layout, coordinate

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

__all__ = ["is_boundary", "plot_boundaries"]

#: what the strokes mean here
_STROKES = {"stable": "bounds stable motions", "unstable": "within unstable motions"}
_UPWARDS = "_upwards"


@dataclass(frozen=True)
class _Plane(View):
    """A frame whose vertical axis is a parameter."""

    upwards: str = ""

    @property
    def variable(self) -> str:
        """The variable that `_prepared` adds."""
        return _UPWARDS

    def labels(self, dataset: xarray.Dataset, horizontal: str) -> tuple[str, str]:
        """What the two axes say."""
        across, _ = super().labels(dataset, horizontal)
        up = super().labels(dataset, "omega")[0] if self.upwards == "omega" else self.upwards
        return across, self.ylabel or up


def is_boundary(dataset: xarray.Dataset) -> bool:
    """Whether a dataset is that of a curve of bifurcations in two parameters."""
    return bool(dataset.attrs.get("tracked"))


def plot_boundaries(
    curves: xarray.Dataset | Sequence[xarray.Dataset],
    path: str | Path | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 4.2),
    view: View | None = None,
) -> Figure:
    """One or several curves of bifurcations over the plane of two parameters, saved to `path` where one is given.

    Parameters
    ----------
    x, y
        The axes, "omega" or parameters; default: the two that were free.
    labels
        Names of several curves; default their kinds.

    Others as `suboctave.plot`. Raises InputError for what cannot be drawn.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    group: list[Any] = list(curves) if isinstance(curves, list | tuple) else [curves]
    for dataset in group:
        check_layout(dataset)
    horizontal, upwards = _axes(group, x, y)
    shown = view or View()
    plane = _Plane(
        frequency=shown.frequency,
        omega_reference=shown.omega_reference,
        xlabel=shown.xlabel,
        ylabel=shown.ylabel,
        upwards=upwards,
    )
    prepared = [_prepared(dataset, upwards) for dataset in group]
    inches = style.size_in_inches(size)
    look = style.PRINT if isinstance(size, str) else style.look_of(inches[0])
    figure = Figure(figsize=inches, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    named = labels if labels is not None else _kinds(group) if len(group) > 1 else None
    legend = draw_response(axes, prepared, x=horizontal, labels=named, view=plane, look=look)
    if title:
        axes.set_title(title.replace("$", r"\$"), fontsize=look.large, color=style.INK)
    every = np.concatenate([part for dataset in prepared for part in plane.values(dataset, horizontal)])
    for limits, column in ((axes.set_xlim, every[:, 0]), (axes.set_ylim, every[:, 1])):
        margin = 0.04 * (float(np.ptp(column)) or abs(float(column[0])) or 1.0)
        limits(column.min() - margin, column.max() + margin)
    place_legend(figure, [axes], {_STROKES.get(k, k): entry for k, entry in ordered(legend).items()}, look)
    if path is not None:
        save_figure(figure, path)
    setattr(figure, "_repr_png_", partial(png_bytes, figure))  # noqa: B010
    return figure


def _axes(group: Sequence[xarray.Dataset], x: str | None, y: str | None) -> tuple[str, str]:
    """The parameters to the right and upwards."""
    pairs = {tuple(str(dataset.attrs["plane"]).split("\n")) for dataset in group if is_boundary(dataset)}
    if x is None and y is None:
        if len(pairs) != 1:
            raise InputError("the curves were followed in different parameters: choose axes with x= and y=")
        first, second = next(iter(pairs))
        return first, second
    known = list(dict.fromkeys(name for pair in pairs for name in pair))
    given = x if x is not None else y
    if x is not None and y is not None:
        for dataset in group:
            coordinate(dataset, x)
            coordinate(dataset, y)
        return x, y
    if given not in known or len(known) != 2:
        raise InputError(f"{given!r} is no parameter of these curves{suggest(str(given), known)}: give x= and y=")
    other = known[1 - known.index(given)]
    return (given, other) if x is not None else (other, given)


def _prepared(dataset: xarray.Dataset, upwards: str) -> xarray.Dataset:
    values, at_events = coordinate(dataset, upwards)
    return dataset.assign({_UPWARDS: ("point", values), f"event_{_UPWARDS}": ("event", at_events)})


def _kinds(group: Sequence[xarray.Dataset]) -> list[str]:
    return [str(dataset.attrs["tracked"]) for dataset in group]
