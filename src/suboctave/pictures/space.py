"""Response curves at several values of a parameter in space, with the curves of bifurcations that run through them.

Frequency to the right, the parameter into the depth, amplitude upwards; the curves of bifurcations once more, thin, as
their projection on the floor, which is the picture of `boundary`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.boundary import BORDER, PALE, WITHIN
from suboctave.pictures.boundary_lines import boundary_names, boundary_styles, is_boundary, kind_of
from suboctave.pictures.boundary_marks import SMALL, event_drawing, event_words, mark_events
from suboctave.pictures.legend import TIGHT
from suboctave.pictures.periods import period_colour, period_name, period_of, tinted
from suboctave.pictures.regions import regions, split, with_ends
from suboctave.pictures.saving import png_bytes, save_figure
from suboctave.pictures.space_view import Space, space_axes, strokes_in_space, surfaces_in_space
from suboctave.pictures.view import View

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

__all__ = ["CLEAR", "SHADE", "plot_space"]

_ASPECT = (1.5, 1.15, 0.95)
_THIN = 0.7  # of a response curve, beside a curve of bifurcations
#: share of white in the projection on the floor
SHADE = 0.55
#: opacity of the surface of an isola
CLEAR = 0.16


def plot_space(
    curves: Any,
    path: str | Path | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    quantity: str | None = None,
    harmonic: float | None = None,
    element: int | None = None,
    dof: int | None = None,
    frequency: str | None = None,
    omega_reference: float | None = None,
    scale: float | None = None,
    unit: str | None = None,
    xlabel: str | None = None,
    ylabel: str | None = None,
    zlabel: str | None = None,
    elevation: float = 24.0,
    azimuth: float = -58.0,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 5.0),
) -> Figure:
    """Response curves at several values of a parameter, and curves of bifurcations through them, in space.

    Parameters
    ----------
    curves
        Branches, tracked ones among them, or their datasets, isolas, or what has `branches`, as `suboctave.plot` takes
        them. The closed branches of an isola that are known are drawn, and the surface that they lie on.
    x, y
        The axes to the right and into the depth: "omega" or parameters; default those in which bifurcations were
        tracked, or omega and the parameter that differs between the response curves.
    zlabel
        Text of the vertical axis; `xlabel` and `ylabel` are those of the others.
    elevation, azimuth
        From where it is seen, degrees above the floor and around the vertical axis.

    Others as `suboctave.plot`.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from suboctave.pictures.plot import datasets_of

    if quantity is None:
        quantity = "amplitude" if harmonic is None else "harmonic"
    view = View(quantity, harmonic, element, dof, frequency, omega_reference, scale, unit, xlabel, ylabel)
    for name, angle in (("elevation", elevation), ("azimuth", azimuth)):
        if isinstance(angle, bool) or not isinstance(angle, int | float) or not np.isfinite(angle):
            raise InputError(f"{name} is an angle in degrees, not {angle!r}")
    given = datasets_of(curves, view)
    group, heads = split(given)
    across, depth = space_axes(group, x, y)
    for dataset in group:
        view.check(dataset)
    space = Space(across, depth, view)
    inches = _inches(size)
    look = style.PRINT if isinstance(size, str) else style.look_of(inches[0])
    figure = Figure(figsize=inches, facecolor="white")
    FigureCanvasAgg(figure)
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    every = np.concatenate([part for dataset in group for part in space.values(dataset)], axis=1)
    floor = _limit(axes, every)
    entries = _shade(axes, given, space, floor)
    entries |= _draw(axes, [with_ends(d, heads) if is_boundary(d) else d for d in group], space, floor, look)
    _dress(axes, space.labels(group[0]), zlabel, look)
    axes.view_init(float(elevation), float(azimuth))
    _place(figure, axes, entries, title, look, grow=isinstance(size, str))
    if path is not None:
        save_figure(figure, path)
    setattr(figure, "_repr_png_", partial(png_bytes, figure))  # noqa: B010
    return figure


def _inches(size: str | tuple[float, float]) -> tuple[float, float]:
    """Named sizes are widths: in space more height is needed."""
    width, height = style.size_in_inches(size)
    return (width, 0.8 * width if width < 5.0 else 0.62 * width) if isinstance(size, str) else (width, height)


def _limit(axes: Any, every: np.ndarray) -> float:
    """Sets the limits; returns the height of the floor."""
    for index, limits in enumerate((axes.set_xlim, axes.set_ylim, axes.set_zlim)):
        known = every[index][np.isfinite(every[index])]
        low, high = float(known.min()), float(known.max())
        margin = 0.04 * (high - low or abs(low) or 1.0)
        floor = 0.0 if index == 2 and low >= 0.0 else low - margin
        limits(floor if index == 2 else low - margin, high + margin)
    return floor


def _shade(axes: Any, given: Sequence[xarray.Dataset], space: Space, floor: float) -> dict[str, Any]:
    """The surfaces of isolas, and their regions on the floor; their entries in the legend."""
    from matplotlib.patches import Patch
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    entries: dict[str, Any] = {}
    for region in regions(split(given)[1]):
        if sorted((space.across, space.depth)) == sorted(("omega", region.parameter)):
            parts = dict(zip(("omega", region.parameter), region.outline, strict=True))
            x, y = (parts[n] * f for n, f in zip((space.across, space.depth), space.factors(), strict=False))
            corners = [np.column_stack([x, y, np.full(x.size, floor)])]
            shade = Poly3DCollection(corners, facecolor=tinted(region.colour, PALE), linewidth=0.0, gid="isola-floor")
            shade.set_zorder(0.9)
            axes.add_collection3d(shade)
    for nu, grid in surfaces_in_space(given, space):
        colour = period_colour(nu)
        axes.plot_surface(
            *grid, color=colour, alpha=CLEAR, shade=False, linewidth=0.0, rcount=200, ccount=200, zorder=2, gid="isola"
        )
        entries[f"{period_name(nu)} isola"] = Patch(facecolor=colour, alpha=2.0 * CLEAR, linewidth=0.0)
    return entries


def _draw(
    axes: Any, group: Sequence[xarray.Dataset], space: Space, floor: float, look: style.Look
) -> dict[str, Line2D]:
    """Floor, response curves from the back to the front, curves of bifurcations; the entries of the legend."""
    from matplotlib.lines import Line2D

    bounds = [dataset for dataset in group if is_boundary(dataset)]
    names = [name.replace("$", r"\$") for name in boundary_names(bounds)]
    styles = boundary_styles(bounds, names)
    responses = [dataset for dataset in group if not is_boundary(dataset)]
    entries: dict[str, Line2D] = {}
    dashed: Any = style.UNSTABLE_DASH
    verdicts: set[bool | None] = set()
    for dataset, curve in zip(bounds, styles, strict=True):
        for piece in strokes_in_space(dataset, space):
            pale = {"color": tinted(curve.colour, SHADE), "linewidth": 0.7 * look.line * curve.width, "zorder": 1}
            axes.plot(piece[0][0], piece[0][1], floor, gid="floor", **pale)
    depths = [float(np.nanmean(space.values(dataset)[0][1])) for dataset in responses]
    for index in np.argsort(depths, kind="stable")[::-1]:
        dataset = responses[index]
        colour = period_colour(period_of(dataset))
        for (x, y, z), stable in strokes_in_space(dataset, space):
            verdicts.add(stable)
            dash: Any = style.UNSTABLE_DASH if stable is False else style.STABLE_DASH
            axes.plot(x, y, z, color=colour, linewidth=_THIN * look.line, linestyle=dash, zorder=3, gid="response")
    kinds: dict[str, style.KindStyle] = {}
    for nu in sorted({period_of(dataset) for dataset in responses}):
        said = "response" if nu == 1 else f"response, {period_name(nu)}"
        entries[said] = Line2D([], [], color=period_colour(nu), linewidth=_THIN * look.line)
    within = set()
    for dataset, name, curve in zip(bounds, names, styles, strict=True):
        line: dict[str, Any] = {"color": curve.colour, "linewidth": 1.25 * look.line * curve.width}
        for (x, y, z), stable in strokes_in_space(dataset, space):
            within.add(stable)
            dash = curve.dash if stable is False else style.STABLE_DASH
            axes.plot(x, y, z, linestyle=dash, zorder=5, gid="boundary", **line)
        entries[name] = Line2D([], [], **line)
    tracked = {(kind_of(dataset), period_of(dataset)) for dataset in bounds}
    for dataset in responses:
        at = space.values(dataset)[1]
        for kind, mark, which in style.marks(dataset):
            if (kind, period_of(dataset)) in tracked:
                drawing = event_drawing(mark, look) | {"markersize": SMALL * 1.3 * mark.size * look.marker}
                axes.plot(*at[:, which], zorder=6, gid=kind, **drawing)
                kinds[kind] = style.kind_style(kind)
    for dataset in bounds:
        mark_events(axes, dataset, space.values(dataset)[1], look, np.ones(dataset.sizes["event"], dtype=bool))
        kinds |= {kind: mark for kind, mark, _ in style.marks(dataset)}
    if False in verdicts:
        entries["unstable"] = Line2D([], [], color=style.SOFT, linewidth=_THIN * look.line, linestyle=dashed)
    if False in within:
        for stable, words in ((True, BORDER), (False, WITHIN)):
            if stable in within:
                dash = style.STABLE_DASH if stable else dashed
                entries[words] = Line2D([], [], color=style.SOFT, linewidth=1.25 * look.line, linestyle=dash)
    order = list(style.KINDS)
    for kind in sorted(kinds, key=lambda k: (order.index(k) if k in order else len(order), k)):
        words = style.kind_style(kind).name if kind in dict(tracked) else event_words(kind)
        entries[words] = Line2D([], [], **event_drawing(kinds[kind], look))
    return entries


def _dress(axes: Any, labels: tuple[str, str, str], zlabel: str | None, look: style.Look) -> None:
    small = axes.figure.get_figwidth() < 4.2
    pad = (-0.45 if small else 0.3) * look.large
    axes.set_xlabel(labels[0], fontsize=look.large, color=style.INK, labelpad=pad)
    axes.set_ylabel(labels[1], fontsize=look.large, color=style.INK, labelpad=pad)
    axes.set_zlabel(zlabel or labels[2], fontsize=look.large, color=style.INK, labelpad=pad)
    axes.tick_params(labelsize=look.small, color=style.INK, pad=(-0.3 if small else -0.1) * look.small)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 1.0))
        axis.pane.set_edgecolor(style.GRID)
        axis._axinfo["grid"].update({"color": style.GRID, "linewidth": 0.4 * look.line})
        axis.line.set_color(style.INK)
        axis.line.set_linewidth(0.53 * look.line)
        axis.set_major_locator(_few(4 if small else 5))
    axes.set_box_aspect(_ASPECT)


def _few(count: int) -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=count, steps=[1, 2, 2.5, 5, 10])


def _place(
    figure: Figure, axes: Any, entries: dict[str, Line2D], title: str | None, look: style.Look, *, grow: bool
) -> None:
    """Title and legend above, and the frame as large as what is left; `grow` adds the legend's height to the page."""
    drawing: dict[str, Any] = {"fontsize": look.small, "edgecolor": style.GRID, "framealpha": 1.0, **TIGHT}
    if grow:
        rows = figure.legend(entries.values(), entries.keys(), ncols=_columns(figure, entries, drawing), **drawing)
        figure.draw_without_rendering()
        width, height = figure.get_size_inches()
        figure.set_size_inches(width, height + rows.get_window_extent().height / figure.dpi)
        rows.remove()
    top, whole = 1.0, figure.bbox.height
    if title:
        figure.suptitle(title.replace("$", r"\$"), fontsize=look.large, color=style.INK, y=0.985)
        top -= 2.0 * look.large / 72.0 * figure.dpi / whole
    legend = figure.legend(
        entries.values(),
        entries.keys(),
        loc="upper center",
        bbox_to_anchor=(0.5, top),
        ncols=_columns(figure, entries, drawing),
        **drawing,
    )
    figure.draw_without_rendering()
    top = legend.get_window_extent().y0 / whole
    zoom, corner = 1.0, np.zeros(2)
    room = np.array([figure.bbox.width, top * whole])
    for _ in range(4):  # letters do not grow with the frame, so that a few rounds are needed
        axes.set_position((*corner, 1.0, top))
        axes.set_box_aspect(_ASPECT, zoom=zoom)
        figure.draw_without_rendering()
        low, high = _extent(figure, axes)
        corner = corner + (0.5 * (room - low - high)) / figure.bbox.size
        zoom *= float(np.clip((0.97 * room / (high - low)).min(), 0.5, 1.5))
    axes.set_position((*corner, 1.0, top))


def _columns(figure: Figure, entries: dict[str, Line2D], drawing: dict[str, Any]) -> int:
    """As many columns of the legend as the page is wide, four at most."""
    for columns in range(min(len(entries), 4), 1, -1):
        legend = figure.legend(entries.values(), entries.keys(), ncols=columns, **drawing)
        figure.draw_without_rendering()
        fits = bool(legend.get_window_extent().width <= figure.bbox.width)
        legend.remove()
        if fits:
            return columns
    return 1


def _extent(figure: Figure, axes: Any) -> tuple[np.ndarray, np.ndarray]:
    """The lower left and the upper right corner of the frame with its labels, pixels."""
    from mpl_toolkits.mplot3d import proj3d

    limits = (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())
    cube = np.array(list(product(*limits))).T
    flat = np.array(proj3d.proj_transform(*cube, axes.get_proj())[:2]).T
    corners = [axes.transData.transform(flat)]
    canvas: Any = figure.canvas
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        box = axis.get_tightbbox(canvas.get_renderer())
        corners.append(np.array([[box.x0, box.y0], [box.x1, box.y1]]))
    every = np.concatenate(corners)
    return every.min(axis=0), every.max(axis=0)
