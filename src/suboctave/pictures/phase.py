"""Phase portraits: dx/dt over x along one response period, with the stroboscopic points of the load's period.

A motion of nu load periods has nu of these points, at t = 0, 2 pi / omega, ...: a period doubling doubles their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suboctave.pictures.motions import Frames, MotionView, check_path, draw_gaps, draw_sections, lower_first

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

__all__ = ["plot_phase"]

_CELL = (3.0, 2.9)  # inches of one frame


def plot_phase(
    motions: Any,
    path: str | Path | None = None,
    *,
    points: Sequence[int] | None = None,
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
    """Draw phase portraits, dx/dt over x along one response period, side by side or in one frame.

    The colour tells the period, T, 2T, ...; circles are the stroboscopic points t = 0, 2 pi / omega, ..., thin lines
    the gaps of elements that act on the degree of freedom alone.

    Parameters
    ----------
    motions
        An orbit, a bifurcation, a point of a branch, a branch with `points`, a dataset of a motion, or a sequence of
        these.
    path
        Where the figure is saved: .png, .svg or .pdf, fonts embedded.
    points
        Which points of the branches, by index.
    dof
        Degree of freedom; default the one that the branch observes, of an orbit alone that of its first load.
    overlay
        All in one frame; else each in its own, on shared axes.
    frequency
        "rad/s" or "Hz", where the system's time is in seconds.
    omega_reference
        Frequencies are stated as `omega / omega_reference`, velocities as derivatives by `omega_reference t`.
    scale, unit
        Factor on lengths, and its unit for the labels: `scale=1e3, unit="mm"`.
    xlabel, ylabel, labels, title
        Texts of the axes, names of the motions, title.
    size
        "single-column" (84 mm), "double-column" (174 mm), or width and height in inches. With several frames the named
        sizes are widths.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    from suboctave.store.motions import motion_datasets  # loads kernels, which curves from files need not

    view = MotionView("displacement", None, frequency, omega_reference, scale, unit, xlabel, ylabel)
    check_path(path)
    datasets = motion_datasets(motions, points, dof)
    frames = Frames(datasets, view, overlay=overlay, labels=labels, size=size, cell=_CELL)
    for index in lower_first(datasets):
        _draw(frames, index, datasets[index], view)
    draw_gaps(frames, datasets, view, upright=True)
    across, upwards = (view.name(datasets[0], order, words=not frames.narrow) for order in (0, 1))
    return frames.finish(xlabel or across, ylabel or upwards, title, path)


def _draw(frames: Frames, index: int, dataset: xarray.Dataset, view: MotionView) -> None:
    axes, look, curve = frames.axes[index], frames.look, frames.looks[index]
    x, v = (dataset[name].to_numpy() * view.factor(d) for d, name in enumerate(("displacement", "velocity")))
    line: dict[str, Any] = {"color": curve.colour, "linewidth": look.line * (curve.width if frames.overlay else 1.0)}
    axes.plot(x, v, zorder=3, solid_joinstyle="round", gid="motion", **line)
    if frames.overlay:
        frames.add(frames.names[index], line, last=False)
    places = [
        dataset[f"section_{name}"].to_numpy() * view.factor(d) for d, name in enumerate(("displacement", "velocity"))
    ]
    draw_sections(frames, index, *places)
