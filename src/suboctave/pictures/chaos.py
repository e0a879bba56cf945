"""Lyapunov exponents, how two trajectories part, where motions are chaotic, and basins of attraction.

Basins have the colours of the periods of their motions, as in every picture; of several motions of one period, the
later ones are paler. What is aperiodic is hatched grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.drawing import Axis, Band, Drawing, Entry, Frame, Guide, Markers, Polyline, Raster, plain
from suboctave.pictures.in_time import Size, check_contents
from suboctave.pictures.layers import check_count
from suboctave.pictures.paper import figure_of
from suboctave.pictures.periods import period_colour
from suboctave.pictures.style import Mark, Pen, places_among, rgb, tinted

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


_EXPONENT = r"exponent $\lambda$"
#: share of white in the colours of the first, second, ... motion of one period
_TINTS = (0.25, 0.65, 0.05, 0.8)
_GREYS = (0.72, 0.15, 0.45, 0.85)
#: colours of growth, from none to the largest; of cells that nothing is known of
_GROWTH, _UNKNOWN = ("#dbe9f4", "#4292c6", "#08306b"), "#dadada"
_LINES = (style.INK, "#D55E00", "#009E73", "#E69F00")
#: hatched besides, so that nobody takes it for a motion of period T
_APERIODIC = -1
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
    check_contents(exponents, "lyapunov exponents")
    running = exponents["running"].to_numpy()
    shown = running.shape[1] if count is None else min(int(count), running.shape[1])
    period = np.arange(1, len(running) + 1)
    frame, entries = Frame([Guide(0.0, Pen(style.SOFT, 0.6), layer=1.0)], title=style.checked_text(title)), {}
    for i in range(shown):
        colour = style.CURVE_COLOURS[i % len(style.CURVE_COLOURS)]
        value, error = (float(exponents[name].to_numpy()[i]) for name in ("exponents", "standard_errors"))
        if np.isfinite(error):
            frame.items.append(Band(value - 2.0 * error, value + 2.0 * error, tinted(colour, 0.7), layer=2.0))
        frame.items.append(Guide(value, Pen(colour, 0.5)))
        line = Polyline(np.array([period, running[:, i]]), Pen(colour), role=f"exponent {i}", layer=4.0)
        frame.items.append(line)
        entries[rf"$\lambda_{{{i + 1}}}$ = {value:.4g} ± {error:.1g}"] = Entry(line.pen)
    axes = Axis("load periods averaged over", 1.0, len(running), logarithmic=True), Axis(_EXPONENT)
    return figure_of(Drawing(axes, [frame], entries), style.sheet_of(size), path)


def plot_separation(
    separation: xarray.Dataset,
    path: str | Path | None = None,
    *,
    most: int = 20,
    title: str | None = None,
    size: Size = (6.0, 3.8),
) -> Figure:
    """Distances of two trajectories over time for at most `most` settings, and the mean rate as a line."""
    check_contents(separation, "separation")
    time, distance = separation["time"].to_numpy(), separation["distance"].to_numpy()
    which = np.unique(np.linspace(0, len(distance) - 1, max(1, int(most))).astype(int))
    frame, thin = Frame(title=style.checked_text(title)), Pen(style.SOFT, 0.5)
    frame.items += [Polyline(np.array([time, distance[i]]), thin, layer=2.0) for i in which]
    entries = {f"{len(which)} of {len(distance)} settings": Entry(thin)}
    exponent, spread = separation.attrs["exponent"], separation.attrs["spread"]
    if np.isfinite(exponent):
        typical = int(np.nanargmin(np.abs(separation["rate"].to_numpy() - exponent)))
        begin = float(np.median(separation["offset"].to_numpy())) * float(separation.attrs["omega"])
        line = begin * np.exp(exponent * time)
        keep = line <= np.max(distance)
        pens = Pen(style.INK), Pen(style.CURVE_COLOURS[0], 1.3)
        frame.items.append(Polyline(np.array([time, distance[typical]]), pens[0]))
        frame.items.append(Polyline(np.array([time[keep], line[keep]]), pens[1], layer=4.0))
        entries["the setting nearest to the mean"] = Entry(pens[0])
        entries[rf"$\lambda$ = {exponent:.3f}, one setting ± {spread:.2g}"] = Entry(pens[1])
    axes = Axis("time", time[0], time[-1]), Axis(r"distance $\delta$", logarithmic=True)
    return figure_of(Drawing(axes, [frame], entries), style.sheet_of(size), path)


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
    check_contents(chart, "lyapunov map")
    across, upwards = _edges(chart["omega"].to_numpy()), _edges(chart["value"].to_numpy())
    exponent, chaotic = chart["exponent"].to_numpy(), chart["chaotic"].to_numpy().astype(bool)
    top = float(exponent[chaotic].max()) if chaotic.any() else 1.0
    cells = np.ones((*exponent.shape, 3))
    levels = np.linspace(0.0, top, len(_GROWTH))
    for channel, values in enumerate(np.array([rgb(colour) for colour in _GROWTH]).T):
        cells[chaotic, channel] = np.interp(exponent[chaotic], levels, values)
    cells[~np.isfinite(exponent)] = rgb(_UNKNOWN)
    raster = Raster(cells, across, upwards, scale=(_GROWTH, 0.0, top, _EXPONENT), layer=0.0)
    frame, entries = Frame([raster], title=style.checked_text(title)), {}
    known = list(dict.fromkeys(name for name, _, _ in lines))
    for name, x, y in lines:
        pen = Pen(_LINES[known.index(name) % len(_LINES)])
        frame.items.append(Polyline(np.array([x, y]), pen))
        entries[name] = Entry(pen)
    axes = Axis(r"$\omega$", *across[[0, -1]]), Axis(plain(chart.attrs["varied"]), *upwards[[0, -1]])
    return figure_of(Drawing(axes, [frame], entries, grid=False), style.sheet_of(size), path)


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
    check_contents(basins, "basins")
    names = [str(name) for name in basins["attractor"].to_numpy()]
    check_count("points", points, len(names), "attractors")
    labels = basins["label"].to_numpy()
    cells, entries = np.zeros((*labels.shape, 3)), {}
    shares = dict(zip([str(k) for k in basins["kind"].to_numpy()], basins["share"].to_numpy(), strict=True))
    amplitude = basins["amplitude"].to_numpy()
    for i, (name, colour) in enumerate(zip(names, _colours(basins["period"].to_numpy()), strict=True)):
        cells[labels == i] = rgb(colour)
        if name in shares:
            words = rf"{name}, $\max\,|x|$ = {amplitude[i]:.4g}: {100.0 * shares[name]:.1f} %"
            entries[words] = Entry(mark=Mark("s", 7.0, colour, style.SOFT, 0.5))
    for number, (name, colour) in _OTHER.items():
        if (labels == number).any():
            cells[labels == number] = rgb(colour)
            words = f"{name}: {100.0 * shares[name]:.1f} %" if name in shares else name
            hatched = Entry(patch=colour, edge=style.SOFT, hatched=True)
            plain_entry = Entry(mark=Mark("s", 7.0, colour, style.SOFT, 0.5))
            entries[words] = hatched if number == _APERIODIC else plain_entry
    x, y = _edges(basins["x"].to_numpy()), _edges(basins["y"].to_numpy())
    frame = Frame([Raster(cells, x, y, labels == _APERIODIC, layer=0.0)], title=style.checked_text(title))
    for places in points or ():
        inside = (places >= (x[0], y[0])).all(axis=1) & (places <= (x[-1], y[-1])).all(axis=1)
        frame.items.append(Markers(places[inside].T, Mark("o", 4.5, "#ffffff"), cut=True, layer=4.0))
    one = int(basins.attrs["dofs"]) == 1
    axes = [
        Axis(_symbol(basins.attrs[f"plane_{letter}"], one), *edges[[0, -1]])
        for letter, edges in zip("xy", (x, y), strict=True)
    ]
    # there is no free place inside
    return figure_of(Drawing(axes, [frame], entries, legend="below", grid=False), style.sheet_of(size), path)


def _colours(periods: np.ndarray) -> list[str]:
    """A colour for the basin of each motion, by period."""
    listed = periods.tolist()
    places = places_among(listed, [str(i) for i in range(len(listed))])
    return [
        tinted(period_colour(p), (_GREYS if p == 1 else _TINTS)[i % 4]) for p, i in zip(listed, places, strict=True)
    ]


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
