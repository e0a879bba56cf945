"""Lyapunov exponents, how two trajectories part, where motions are chaotic, and basins of attraction.

Basins have the colours of the periods of their motions, as in every picture; of several motions of one period, the
later ones are paler. What is aperiodic is hatched grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.in_time import Size, _check, _finish, _frame
from suboctave.pictures.periods import period_colour, tinted
from suboctave.pictures.response import dress

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

__all__ = ["plot_basins", "plot_lyapunov", "plot_lyapunov_map", "plot_separation"]

_EXPONENT = r"exponent $\lambda$"
#: share of white in the colours of the first, second, ... motion of one period
_TINTS = (0.25, 0.65, 0.05, 0.8)
_GREYS = (0.72, 0.15, 0.45, 0.85)
_LIGHTEST, _DARKEST = "#dbe9f4", "#08306b"
#: hatched besides, so that nobody takes it for a motion of period T
_APERIODIC, _HATCH = -1, "////"
_OTHER = {_APERIODIC: ("aperiodic", "#e3e3e3"), -2: ("left the range", "#d55e00"), -3: ("not computed", "#ffffff")}


def plot_lyapunov(
    exponents: xarray.Dataset,
    path: str | Path | None = None,
    *,
    count: int | None = None,
    title: str | None = None,
    size: Size = (6.0, 3.6),
) -> Figure:
    """Running averages over the periods, with the result and a band of two standard errors; the first `count`."""
    _check(exponents, "lyapunov exponents")
    figure, axes, look = _frame(size)
    running = exponents["running"].to_numpy()
    shown = running.shape[1] if count is None else min(int(count), running.shape[1])
    period = np.arange(1, len(running) + 1)
    legend: dict[str, Any] = {}
    for i in range(shown):
        colour = style.CURVE_COLOURS[i % len(style.CURVE_COLOURS)]
        value, error = (float(exponents[name].to_numpy()[i]) for name in ("exponents", "standard_errors"))
        if np.isfinite(error):
            axes.axhspan(value - 2.0 * error, value + 2.0 * error, color=tinted(colour, 0.7), zorder=2)
        axes.axhline(value, color=colour, linewidth=0.5 * look.line, zorder=3)
        line = axes.plot(period, running[:, i], color=colour, linewidth=look.line, zorder=4, gid=f"exponent {i}")[0]
        legend[rf"$\lambda_{{{i + 1}}}$ = {value:.4g} ± {error:.1g}"] = line
    axes.axhline(0.0, color=style.SOFT, linewidth=0.6 * look.line, zorder=1)
    axes.set_xscale("log")
    axes.set_xlim(1, len(running))
    dress(axes, "load periods averaged over", _EXPONENT, look)
    return _finish(figure, axes, legend, look, title, path)


def plot_separation(
    separation: xarray.Dataset,
    path: str | Path | None = None,
    *,
    most: int = 20,
    title: str | None = None,
    size: Size = (6.0, 3.8),
) -> Figure:
    """Distances of two trajectories over time for at most `most` settings, and the mean rate as a line."""
    _check(separation, "separation")
    figure, axes, look = _frame(size)
    time, distance = separation["time"].to_numpy(), separation["distance"].to_numpy()
    which = np.unique(np.linspace(0, len(distance) - 1, max(1, int(most))).astype(int))
    rates = separation["rate"].to_numpy()
    for i in which:
        line = axes.semilogy(time, distance[i], color=style.SOFT, linewidth=0.5 * look.line, zorder=2)[0]
    legend: dict[str, Any] = {f"{len(which)} of {len(distance)} settings": line}
    exponent, spread = separation.attrs["exponent"], separation.attrs["spread"]
    if np.isfinite(exponent):
        typical = int(np.nanargmin(np.abs(rates - exponent)))
        legend["the setting nearest to the mean"] = axes.semilogy(
            time, distance[typical], color=style.INK, linewidth=look.line, zorder=3
        )[0]
        begin = float(np.median(separation["offset"].to_numpy())) * float(separation.attrs["omega"])
        line = begin * np.exp(exponent * time)
        keep = line <= np.max(distance)
        legend[rf"$\lambda$ = {exponent:.3f}, one setting ± {spread:.2g}"] = axes.semilogy(
            time[keep], line[keep], color=style.CURVE_COLOURS[0], linewidth=1.3 * look.line, zorder=4
        )[0]
    axes.set_xlim(time[0], time[-1])
    dress(axes, "time", r"distance $\delta$", look)
    return _finish(figure, axes, legend, look, title, path)


def plot_lyapunov_map(
    chart: xarray.Dataset,
    path: str | Path | None = None,
    *,
    lines: Sequence[tuple[str, np.ndarray, np.ndarray]] = (),
    title: str | None = None,
    size: Size = (6.4, 4.2),
) -> Figure:
    """Largest exponents in colour where the motion is chaotic, white where it is not, grey where nothing is known.

    `lines`: a name, frequencies and values of the parameter each, drawn over it.
    """
    from matplotlib.colors import LinearSegmentedColormap

    _check(chart, "lyapunov map")
    figure, axes, look = _frame(size)
    omega, values = chart["omega"].to_numpy(), chart["value"].to_numpy()
    exponent, chaotic = chart["exponent"].to_numpy(), chart["chaotic"].to_numpy()
    shown = np.ma.masked_where(~chaotic, exponent)
    colours = LinearSegmentedColormap.from_list("growth", [_LIGHTEST, "#4292c6", _DARKEST])
    unknown = ~np.isfinite(exponent)
    edges = _edges(omega), _edges(values)
    if unknown.any():
        grey = np.ma.masked_where(~unknown, np.ones_like(exponent))
        axes.pcolormesh(*edges, grey, color=None, cmap="Greys", vmin=0.0, vmax=4.0, zorder=0)
    top = float(shown.max()) if chaotic.any() else 1.0
    mesh = axes.pcolormesh(*edges, shown, cmap=colours, vmin=0.0, vmax=top, zorder=1, rasterized=True)
    bar = figure.colorbar(mesh, ax=axes, pad=0.02)
    bar.set_label(_EXPONENT, fontsize=look.normal, color=style.INK)
    bar.ax.tick_params(labelsize=look.small)
    legend: dict[str, Any] = {}
    known: list[str] = []
    for name, x, y in lines:
        if name not in known:
            known.append(name)
        colour = (style.INK, "#D55E00", "#009E73", "#E69F00")[known.index(name) % 4]
        legend[name] = axes.plot(x, y, color=colour, linewidth=look.line, zorder=3)[0]
    axes.set_xlim(edges[0][0], edges[0][-1])
    axes.set_ylim(edges[1][0], edges[1][-1])
    dress(axes, r"$\omega$", str(chart.attrs["varied"]).replace("$", r"\$"), look)
    axes.grid(False)
    return _finish(figure, axes, legend, look, title, path)


def plot_basins(
    basins: xarray.Dataset,
    path: str | Path | None = None,
    *,
    points: Sequence[np.ndarray] | None = None,
    title: str | None = None,
    size: Size = (5.6, 4.6),
) -> Figure:
    """The plane of states, each in the colour of the motion that it tends to.

    `points`: of each attractor its stroboscopic points (n, 2) in this plane, which are marked.
    """
    _check(basins, "basins")
    names = [str(name) for name in basins["attractor"].to_numpy()]
    if points is not None and len(points) != len(names):
        raise InputError(f"points: expected those of {len(names)} attractors, got {len(points)}")
    figure, axes, look = _frame(size)
    labels = basins["label"].to_numpy()
    colours = _colours(basins["period"].to_numpy())
    image = np.zeros((*labels.shape, 3))
    legend: dict[str, Any] = {}
    shares = dict(zip([str(k) for k in basins["kind"].to_numpy()], basins["share"].to_numpy(), strict=True))
    amplitude = basins["amplitude"].to_numpy()
    for i, (name, colour) in enumerate(zip(names, colours, strict=True)):
        image[labels == i] = _rgb(colour)
        if name in shares:
            told = rf"{name}, $\max\,|x|$ = {amplitude[i]:.4g}: {100.0 * shares[name]:.1f} %"
            legend[told] = _swatch(colour, look)
    for number, (name, colour) in _OTHER.items():
        if (labels == number).any():
            image[labels == number] = _rgb(colour)
            told = f"{name}: {100.0 * shares[name]:.1f} %" if name in shares else name
            legend[told] = _hatched(colour) if number == _APERIODIC else _swatch(colour, look)
    x, y = _edges(basins["x"].to_numpy()), _edges(basins["y"].to_numpy())
    axes.imshow(
        image, origin="lower", extent=(x[0], x[-1], y[0], y[-1]), aspect="auto", interpolation="nearest", zorder=0
    )
    if (labels == _APERIODIC).any() and min(labels.shape) > 1:
        filled = axes.contourf(
            basins["x"].to_numpy(), basins["y"].to_numpy(), (labels == _APERIODIC).astype(float), levels=[0.5, 1.5],
            colors="none", hatches=[_HATCH], zorder=1,
        )  # fmt: skip
        filled.set_edgecolor(style.SOFT)
        filled.set_linewidth(0.0)
    _mark(axes, points or (), (x[0], x[-1], y[0], y[-1]), look)
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    one = int(basins.attrs["dofs"]) == 1
    dress(axes, _symbol(basins.attrs["plane_x"], one), _symbol(basins.attrs["plane_y"], one), look)
    axes.grid(False)
    # there is no free place inside
    columns = 1 if figure.get_size_inches()[0] < 5.0 else 2
    figure.legend(
        legend.values(), legend.keys(), loc="outside lower center", ncols=columns, fontsize=look.small, frameon=False
    )
    return _finish(figure, axes, {}, look, title, path)


def _hatched(colour: str) -> Patch:
    from matplotlib.patches import Patch

    return Patch(facecolor=colour, edgecolor=style.SOFT, hatch=_HATCH, linewidth=0.5)


def _swatch(colour: str, look: style.Look) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D(
        [], [], marker="s", linestyle="none", color=colour, markeredgecolor=style.SOFT, markeredgewidth=0.5,
        markersize=7.0 * look.marker,
    )  # fmt: skip


def _mark(axes: Axes, points: Sequence[np.ndarray], box: tuple[float, ...], look: style.Look) -> None:
    for place in points:
        inside = (place[:, 0] >= box[0]) & (place[:, 0] <= box[1]) & (place[:, 1] >= box[2]) & (place[:, 1] <= box[3])
        axes.plot(
            place[inside, 0], place[inside, 1], "o", markersize=4.5 * look.marker, markerfacecolor="white",
            markeredgecolor=style.INK, markeredgewidth=look.edge, zorder=4,
        )  # fmt: skip


def _colours(periods: np.ndarray) -> list[str]:
    seen: dict[int, int] = {}
    colours = []
    for period in periods.tolist():
        place = seen[period] = seen.get(period, -1) + 1
        colours.append(tinted(period_colour(period), (_GREYS if period == 1 else _TINTS)[place % 4]))
    return colours


def _symbol(name: str, one: bool) -> str:
    kind, _, dof = name.partition("_")
    letter = "x" if kind == "x" else r"\dot x"
    return f"${letter}(0)$" if one else f"${letter}_{{{dof}}}(0)$"


def _edges(grid: np.ndarray) -> np.ndarray:
    """Edges of the cells about the values of a grid."""
    if len(grid) == 1:
        half = 0.5 * (abs(float(grid[0])) or 1.0) * 0.01
        return np.array([grid[0] - half, grid[0] + half])
    middle = 0.5 * (grid[1:] + grid[:-1])
    return np.concatenate([[2.0 * grid[0] - middle[0]], middle, [2.0 * grid[-1] - middle[-1]]])


def _rgb(colour: str) -> list[float]:
    return [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
