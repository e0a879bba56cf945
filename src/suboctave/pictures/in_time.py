"""What time integration finds: a trajectory over time, stroboscopic points, and brute-force diagrams over branches.

Motions have the colours of their periods, as in every picture; what does not repeat is grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.pictures import style
from suboctave.pictures.legend import ordered, place_legend
from suboctave.pictures.periods import period_colour, period_name
from suboctave.pictures.response import draw_response, dress
from suboctave.pictures.saving import png_bytes, save_figure
from suboctave.pictures.view import View

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

__all__ = ["plot_brute_force", "plot_sections", "plot_trajectory"]

Size = str | tuple[float, float]
_POINTING = {"up": "^", "down": "v", "rest": "o"}
_APERIODIC = "aperiodic"


def plot_trajectory(
    trajectory: xarray.Dataset,
    path: str | Path | None = None,
    *,
    dof: int | None = None,
    quantity: str = "displacement",
    title: str | None = None,
    size: Size = (7.2, 3.2),
) -> Figure:
    """The displacement (or "velocity") of one degree of freedom over time, instants of phase 0 marked."""
    _check(trajectory, "trajectory")
    if quantity not in ("displacement", "velocity"):
        raise InputError(f"unknown quantity {quantity!r}{suggest(str(quantity), ['displacement', 'velocity'])}")
    dof = _dof(trajectory, dof)
    figure, axes, look = _frame(size)
    omega = float(trajectory.attrs["omega"])
    time = trajectory["time"].to_numpy() * omega / (2.0 * np.pi)
    values = trajectory[quantity].to_numpy()[:, dof]
    axes.plot(time, values, color=style.INK, linewidth=look.line, zorder=3, gid="motion")
    every = slice(None, None, int(trajectory.attrs["steps_per_period"]))
    axes.plot(
        time[every],
        values[every],
        "o",
        color=style.CURVE_COLOURS[0],
        markersize=3.0 * look.marker,
        zorder=4,
        gid="strobe",
    )
    symbol = f"x_{{{dof}}}" if trajectory.attrs["dofs"] > 1 else "x"
    dress(
        axes, r"time in load periods, $t/T$", f"${symbol}$" if quantity == "displacement" else rf"$\dot {symbol}$", look
    )
    axes.set_xlim(time[0], time[-1])
    return _finish(figure, axes, {}, look, title, path)


def plot_sections(
    sections: xarray.Dataset,
    path: str | Path | None = None,
    *,
    dof: int | None = None,
    title: str | None = None,
    size: Size = (5.2, 4.6),
) -> Figure:
    """Stroboscopic points in the plane of displacement and velocity of one degree of freedom, coloured by period."""
    _check(sections, "poincare sections")
    dof = _dof(sections, dof)
    figure, axes, look = _frame(size)
    x, v = (sections[name].to_numpy()[..., dof] for name in ("displacement", "velocity"))
    legend: dict[str, Any] = {}
    periods = sections["period"].to_numpy()
    for period in sorted(set(periods.tolist()), key=lambda p: (p != 0, p)):
        rows = np.flatnonzero(periods == period)
        last = slice(-period, None) if period else slice(None)
        axes.plot(
            x[rows, last].ravel(),
            v[rows, last].ravel(),
            "o" if period else ".",
            color=_colour(period),
            markersize=(4.0 if period else 1.6) * look.marker,
            markeredgewidth=0.0,
            zorder=3 + bool(period),
            gid=f"period {period}",
        )
        legend[_name(period)] = _dot(period, look)
    several = sections.attrs["dofs"] > 1
    symbol = f"x_{{{dof}}}" if several else "x"
    dress(axes, f"${symbol}$", rf"$\dot {symbol}$", look)
    return _finish(figure, axes, legend, look, title, path)


def plot_brute_force(
    diagram: xarray.Dataset,
    path: str | Path | None = None,
    *,
    curves: Any = None,
    quantity: str = "amplitude",
    starts: Sequence[str] | None = None,
    dof: int | None = None,
    title: str | None = None,
    size: Size = (6.4, 4.2),
) -> Figure:
    """What was found over the parameter that was varied, with branches beneath if any are given.

    Parameters
    ----------
    curves
        Branches, diagrams of branches or their datasets; of the amplitude only.
    quantity
        "amplitude": one mark for each motion, its largest |x|. "section": its displacement at phase 0 of the load,
        as many points as the motion has periods, all of them where nothing repeats.
    starts
        Ways to start that are shown; default all.
    dof
        Degree of freedom; default the observed one.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    from suboctave.pictures.plot import datasets_of

    _check(diagram, "brute force")
    if quantity not in ("amplitude", "section"):
        raise InputError(f"unknown quantity {quantity!r}{suggest(str(quantity), ['amplitude', 'section'])}")
    if curves is not None and quantity != "amplitude":
        raise InputError('curves= are drawn with quantity="amplitude"')
    known = [str(name) for name in diagram["start"].to_numpy()]
    shown = known if starts is None else list(starts)
    for name in shown:
        if name not in known:
            raise InputError(f"there is no start {name!r}{suggest(str(name), known)}")
    dof = _dof(diagram, dof)
    name = str(diagram.attrs["varied"])
    figure, axes, look = _frame(size)
    view = View()
    legend: dict[str, Any] = {}
    if curves is not None:
        legend |= draw_response(axes, datasets_of(curves, view), x=name, view=view, look=look)
    draw = _amplitudes if quantity == "amplitude" else _sections
    marks: dict[str, Any] = {}
    for start in shown:
        marks |= draw(axes, diagram.isel(start=known.index(start)), start, dof, look)
    # beside curves, whose periods have the same names, marks say that they were found in time
    legend |= {f"{name}, in time" if curves is not None else name: mark for name, mark in marks.items()}
    several = diagram.attrs["dofs"] > 1
    symbol = f"x_{{{dof}}}" if several else "x"
    upwards = rf"$\max\,|{symbol}|$" if quantity == "amplitude" else rf"${symbol}(t_k)$, stroboscopic"
    dress(axes, r"$\omega$" if name == "omega" else name.replace("$", r"\$"), upwards, look)
    values = diagram["value"].to_numpy()
    spread = np.ptp(values) or abs(values[0]) or 1.0
    axes.set_xlim(values[0] - 0.02 * spread, values[-1] + 0.02 * spread)
    return _finish(figure, axes, legend, look, title, path)


def _amplitudes(axes: Axes, row: xarray.Dataset, start: str, dof: int, look: style.Look) -> dict[str, Any]:
    legend: dict[str, Any] = {}
    values, periods = row["value"].to_numpy(), row["period"].to_numpy()
    largest = row["largest"].to_numpy()[..., dof]
    for period in sorted({int(p) for p in periods if p >= 0}):
        here = np.flatnonzero(periods == period)
        heights = largest[here][:, -period:].max(axis=1) if period else largest[here].max(axis=1)
        legend[_name(period)] = axes.plot(
            values[here],
            heights,
            _POINTING.get(start, "s"),
            color=_colour(period),
            markerfacecolor="none",
            markersize=3.2 * look.marker,
            markeredgewidth=0.7 * look.edge,
            zorder=4,
            gid=f"{start} {_name(period)}",
        )[0]
    return legend


def _sections(axes: Axes, row: xarray.Dataset, start: str, dof: int, look: style.Look) -> dict[str, Any]:
    legend: dict[str, Any] = {}
    values, periods = row["value"].to_numpy(), row["period"].to_numpy()
    x = row["displacement"].to_numpy()[..., dof]
    for period in sorted({int(p) for p in periods if p >= 0}):
        here = np.flatnonzero(periods == period)
        points = x[here][:, -period:] if period else x[here]
        axes.plot(
            np.repeat(values[here], points.shape[1]),
            points.ravel(),
            "o",
            color=_colour(period),
            markersize=(1.8 if period else 0.9) * look.marker,
            markeredgewidth=0.0,
            zorder=3 + bool(period),
            gid=f"{start} {_name(period)}",
        )
        legend[_name(period)] = _dot(period, look)
    return legend


def _dot(period: int, look: style.Look) -> Line2D:
    """A point in the legend, large enough for its colour to be seen."""
    from matplotlib.lines import Line2D

    return Line2D([], [], marker="o", linestyle="none", color=_colour(period), markersize=4.0 * look.marker,
                  markeredgewidth=0.0)  # fmt: skip


def _colour(period: int) -> str:
    return period_colour(period) if period else style.SOFT


def _name(period: int) -> str:
    return period_name(period) if period else _APERIODIC


def _check(dataset: Any, contents: str) -> None:
    found = getattr(dataset, "attrs", {}).get("contents")
    if found != contents:
        raise InputError(
            f"expected a dataset of {contents!r}, got {found or type(dataset).__name__!r}; use its to_xarray()"
        )


def _dof(dataset: xarray.Dataset, dof: int | None) -> int:
    count = int(dataset.attrs["dofs"])
    chosen = int(dataset.attrs["observed"]) if dof is None else dof
    if isinstance(chosen, bool) or not isinstance(chosen, int | np.integer) or not 0 <= chosen < count:
        raise InputError(f"dof={dof!r} is out of range: there are {count} DOFs, numbered from 0")
    return int(chosen)


def _frame(size: Size) -> tuple[Figure, Axes, style.Look]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    inches = style.size_in_inches(size)
    look = style.PRINT if isinstance(size, str) else style.look_of(inches[0])
    figure = Figure(figsize=inches, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(), look


def _finish(
    figure: Figure, axes: Axes, legend: dict[str, Any], look: style.Look, title: str | None, path: str | Path | None
) -> Figure:
    if title:
        style.check_text(title)
        axes.set_title(title, fontsize=look.large, color=style.INK)
    place_legend(figure, [axes], ordered(legend), look)
    if path is not None:
        save_figure(figure, path)
    setattr(figure, "_repr_png_", partial(png_bytes, figure))  # noqa: B010
    return figure
