"""Time histories of motions over one response period: x(t), its derivatives, the force of an element."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures.motions import (
    DERIVATIVES,
    Frames,
    MotionView,
    check_path,
    draw_gaps,
    draw_sections,
    lower_first,
)

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

__all__ = ["plot_history"]

_CELL = (5.6, 2.0)  # inches of one frame


def plot_history(
    motions: Any,
    path: str | Path | None = None,
    *,
    points: Sequence[int] | None = None,
    quantity: str = "displacement",
    element: int | None = None,
    dof: int | None = None,
    overlay: bool = False,
    frequency: str | None = None,
    omega_reference: float | None = None,
    scale: float | None = None,
    unit: str | None = None,
    xlabel: str | None = None,
    ylabel: str | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: str | tuple[float, float] | None = None,
) -> Figure:
    """Draw motions, or the force of an element along them, over one response period.

    Time is counted in load periods from phase zero of the load; beside a motion of longer period others go on, thin.
    Circles are the stroboscopic instants, thin grey lines the gaps of elements that act on the degree of freedom alone.

    Parameters
    ----------
    motions, path, points, dof, overlay, labels, title, size
        As in `plot_phase`.
    quantity
        "displacement", "velocity", "acceleration", or "force" with `element`, its index.
    frequency
        "Hz" or "rad/s", where the system's time is in seconds: the axis shows seconds.
    omega_reference
        The axis shows `omega_reference t`.
    scale, unit
        Factor on lengths (or on the force), and its unit for the label.
    xlabel, ylabel
        Texts of the axes.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    from suboctave.store.motions import motion_datasets  # loads kernels, which curves from files need not

    view = MotionView(quantity, element, frequency, omega_reference, scale, unit, xlabel, ylabel)
    view.check_quantity([*DERIVATIVES, "force"])
    check_path(path)
    datasets = motion_datasets(motions, points, dof, () if element is None else (element,))
    frames = Frames(datasets, view, overlay=overlay, labels=labels, size=size, cell=_CELL, stacked=True)
    longest = max(_length(dataset, view) for dataset in datasets)
    for index in lower_first(datasets):
        _draw(frames, index, datasets[index], view, longest)
    if quantity == "displacement":
        draw_gaps(frames, datasets, view, upright=False)
    frames.frames[0].set_xlim(-0.02 * longest, 1.02 * longest)
    if frequency is None and omega_reference is None and longest > 1.5:
        from matplotlib.ticker import MaxNLocator

        frames.frames[0].xaxis.set_major_locator(MaxNLocator(nbins=9, steps=[1, 2, 5, 10]))
    return frames.finish(xlabel or _across(view), ylabel or _upwards(datasets[0], view), title, path)


def _length(dataset: xarray.Dataset, view: MotionView) -> float:
    """The response period on the axis."""
    return float(dataset["time"].to_numpy()[-1]) * _unit_of_time(dataset, view)


def _draw(frames: Frames, index: int, dataset: xarray.Dataset, view: MotionView, longest: float) -> None:
    axes, look, curve = frames.axes[index], frames.look, frames.looks[index]
    values, length = _values(dataset, view), _length(dataset, view)
    line: dict[str, Any] = {"color": curve.colour, "linewidth": look.line * (curve.width if frames.overlay else 1.0)}
    time = dataset["time"].to_numpy() * _unit_of_time(dataset, view)
    axes.plot(time, values, zorder=3, solid_joinstyle="round", gid="motion", **line)
    for repeated in range(1, math.ceil(longest / length - 1e-9)):
        axes.plot(
            time + repeated * length, values, zorder=2.5, gid="repeated", **{**line, "linewidth": 0.5 * look.line}
        )
    if frames.overlay:
        frames.add(frames.names[index], line, last=False)
    at = dataset["section_time"].to_numpy() * _unit_of_time(dataset, view)
    draw_sections(frames, index, at, np.interp(at, time, values))


def _values(dataset: xarray.Dataset, view: MotionView) -> np.ndarray:
    if view.quantity == "force":
        row = list(dataset["element"].to_numpy()).index(view.element)
        return np.asarray(dataset["force"].to_numpy()[row] * view.factor())
    return np.asarray(dataset[view.quantity].to_numpy() * view.factor(DERIVATIVES[view.quantity]))


def _unit_of_time(dataset: xarray.Dataset, view: MotionView) -> float:
    """What t is multiplied by on the axis."""
    if view.frequency is not None:
        return 1.0
    return view.omega_reference or float(dataset.attrs["omega"]) / (2.0 * math.pi)


def _across(view: MotionView) -> str:
    if view.frequency is not None:
        return "time (s)"
    return r"time in load periods, $t/T$" if view.omega_reference is None else r"time $\omega_0 t$"


def _upwards(dataset: xarray.Dataset, view: MotionView) -> str:
    if view.quantity != "force":
        return view.name(dataset, DERIVATIVES[view.quantity])
    return f"force of element {view.element}" + (f" ({view.unit})" if view.unit else "")
