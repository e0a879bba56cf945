"""Drawings on paper: Matplotlib figures made without any global plotting state, saved as PNG, SVG or PDF.

The legend stands where it covers no curve, and short texts beside points where they cover least.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial, wraps
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from suboctave.atomic import replace_file
from suboctave.errors import InputError, path_of, suggest
from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.drawing import (
    HATCHES,
    Axis,
    Band,
    Beads,
    Drawing,
    Entry,
    Frame,
    Guide,
    Item,
    Label,
    Markers,
    Polyline,
    Raster,
    Region,
    Surface,
    spread,
)
from suboctave.pictures.options import PageOptions
from suboctave.pictures.strokes import bent
from suboctave.session import at_prompt

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.transforms import Bbox


#: one frame and its axes
Layout: TypeAlias = tuple[Frame, Sequence[Axis]]

SUFFIXES = (".png", ".svg", ".pdf")
# No time stamps: the same curve gives the same file.
_METADATA: dict[str, dict[str, Any]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
# Letters are part of the file: TrueType in PDF, as journals ask for, and outlines in SVG. No random names in SVG.
_EMBEDDED: dict[Any, Any] = {"pdf.fonttype": 42, "svg.fonttype": "path", "svg.hashsalt": "suboctave"}
#: inches of width of a figure from which a legend stands beside the frame, not below it
_WIDE = 5.0
#: lengths of the edges of the frame in space, one to another
_ASPECT = (1.5, 1.15, 0.95)
#: inches of width of a page below which there are fewer ticks, and labels closer to their axes
_SMALL = 4.2


def figure_of(drawing: Drawing, sheet: style.Sheet) -> Figure:
    """The figure of a drawing on a page, without a window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=sheet.inches, facecolor="white")
    FigureCanvasAgg(figure)
    return _filled(figure, drawing, sheet)


def save_or_show(drawing: Drawing, sheet: style.Sheet, path: str | Path | None) -> Figure:
    """The figure of a drawing, saved where a path is given; else at a prompt in a window, where there is a screen."""
    if path is None and at_prompt():
        from matplotlib import get_backend, pyplot
        from matplotlib.backends import BackendFilter, backend_registry

        if get_backend().lower() not in backend_registry.list_builtin(BackendFilter.NON_INTERACTIVE):
            figure = _filled(pyplot.figure(figsize=sheet.inches, facecolor="white"), drawing, sheet)
            figure.show()
            return figure
    figure = figure_of(drawing, sheet)
    if path is not None:
        save_figure(figure, path)
    # Notebooks show an object that has this; without pyplot nothing else would tell them to.
    setattr(figure, "_repr_png_", partial(image_of, figure, "png", dpi=110.0))  # noqa: B010
    return figure


def _filled(figure: Figure, drawing: Drawing, sheet: style.Sheet) -> Figure:
    if len(drawing.axes) == 3:
        _in_space(figure, drawing, sheet)
    else:
        figure.set_layout_engine("constrained")
        _in_plane(figure, drawing, sheet)
    _DRAWINGS[figure] = drawing
    return figure


#: the drawings of figures, for who shows them elsewhere too
_DRAWINGS: WeakKeyDictionary[Figure, Drawing] = WeakKeyDictionary()


def drawing_of(figure: Figure) -> Drawing | None:
    """What a figure shows; None of one that was drawn otherwise."""
    return _DRAWINGS.get(figure)


class _Page(PageOptions, total=False):
    """Keywords of what draws one frame."""

    path: Annotated[str | Path | None, "Where the figure is saved: .png, .svg or .pdf."]


def picture(size: tuple[float, float], **arranged: Any) -> Callable[[Callable[..., Layout]], Callable[..., Figure]]:
    """What lays out one frame and its axes draws it then: the figure under a title, saved where a path is given.

    `size`: inches, unless another is given; `arranged`: as of `Drawing`.
    """

    def decorated(layout: Callable[..., Layout]) -> Callable[..., Figure]:
        @with_options(_Page)
        @wraps(layout)
        def drawn(*given: Any, **options: Any) -> Figure:
            path, title, own = (options.pop(name, None) for name in ("path", "title", "size"))
            frame, axes = layout(*given, **options)
            frame.title = style.checked_text(title)
            sheet = style.sheet_of(size if own is None else own)
            return save_or_show(Drawing(axes, [frame], **arranged), sheet, path)

        return drawn

    return decorated


def _in_plane(figure: Figure, drawing: Drawing, sheet: style.Sheet) -> None:
    look, count, columns = sheet.look, len(drawing.frames), drawing.columns
    rows = math.ceil(count / columns)
    every: list[Axes] = list(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel())
    for index in range(count, len(every)):
        every[index].remove()
        every[index - columns].tick_params(labelbottom=True)
    frames, (across, upwards) = every[:count], drawing.axes
    for index, (axes, frame) in enumerate(zip(frames, drawing.frames, strict=True)):
        draw(axes, frame, look)
        labels = across.label if index + columns >= count else "", upwards.label if index % columns == 0 else ""
        dress(axes, labels, look, grid=drawing.grid)
        if frame.title:
            axes.set_title(frame.title, fontsize=look.normal if drawing.small else look.large, color=style.INK)
    _set_axis("x", frames[0], across)
    _set_axis("y", frames[0], upwards)
    if drawing.title:
        figure.suptitle(drawing.title, fontsize=look.large, color=style.INK)
    _place(figure, frames, drawing, sheet)  # the frames have their places: what is spaced on paper comes now
    for axes, frame in zip(frames, drawing.frames, strict=True):
        box = axes.get_window_extent()
        size = box.width / figure.dpi * 25.4, box.height / figure.dpi * 25.4
        low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
        for item in frame.items:
            if isinstance(item, Beads) and (at := item.places(low, high, size)).size:
                _draw(axes, Markers(at, item.mark, role=item.role, layer=item.layer + 0.5), look, (1.0, 1.0))
        annotate(axes, frame.labels, look)


def _place(figure: Figure, frames: Sequence[Axes], drawing: Drawing, sheet: style.Sheet) -> None:
    entries, where = handles(drawing.entries, sheet.look), drawing.legend
    arrange(figure)  # a legend inside one of the frames moves nothing
    if where == "free" and any(_legend_inside(axes, entries, sheet) for axes in frames):
        return
    if where in ("beside", "below"):
        beside = where == "beside" and sheet.inches[0] >= _WIDE
        plain: dict[str, Any] = {"frameon": False, "handlelength": 2.2, "handleheight": 1.1}
        place = "outside right upper" if beside else "outside lower center"
        fitting_legend(figure, entries, sheet, most=1 if beside else 2, loc=place, **plain)
    elif entries:
        if sheet.named:
            _grow(figure, entries, sheet)
        fitting_legend(figure, entries, sheet, loc="outside upper center")


# ---------------------------------------------------------------------------------------------------- what is in frames
def draw(axes: Any, frame: Frame, look: style.Look) -> None:
    """Draw what stands in a frame, but for what is spaced on paper and for labels."""
    seen = [item.at for item in frame.items if isinstance(item, Polyline | Markers)]
    around = spread(np.concatenate(seen, axis=1)) if seen else (1.0, 1.0)
    for item in frame.items:
        _draw(axes, item, look, around)


def _draw(axes: Any, item: Item, look: style.Look, around: tuple[float, float]) -> None:
    placed: dict[str, Any] = {"zorder": item.layer, "gid": item.role}
    match item:
        case Polyline():
            at = bent(item.at[0], item.at[1], around) if item.smooth else item.at
            axes.plot(*at, **_line(item.pen, look), **placed)
        case Markers():
            axes.plot(*item.at, clip_on=item.cut, linestyle="none", **_marker(item.mark, look), **placed)
        case Region() if len(item.outline) == 2:
            axes.fill(*item.outline, facecolor=item.colour, linewidth=0.0, **placed)
        case Region():
            from mpl_toolkits.mplot3d.art3d import Poly3DCollection

            shade = Poly3DCollection([item.outline.T], facecolor=item.colour, linewidth=0.0, gid=item.role)
            shade.set_zorder(item.layer)
            axes.add_collection3d(shade)
        case Surface():
            drawing: dict[str, Any] = {"color": item.colour, "alpha": item.opacity, "shade": False, "linewidth": 0.0}
            axes.plot_surface(*item.grid, rcount=200, ccount=200, **drawing, **placed)
        case Guide():
            line = axes.axvline if item.upright else axes.axhline
            line(item.value, **_line(item.pen, look), **placed)
        case Band():
            axes.axhspan(item.low, item.high, color=item.colour, **placed)
        case Raster():
            _paint(axes, item, look, placed)


def _line(pen: style.Pen, look: style.Look) -> dict[str, Any]:
    ends = {"solid_capstyle": "butt", "dash_capstyle": "butt", "solid_joinstyle": "round"}
    return {"color": pen.colour, "linewidth": look.line * pen.width, "linestyle": pen.dash, **ends}


def _marker(mark: style.Mark, look: style.Look) -> dict[str, Any]:
    return {
        "marker": mark.marker,
        "markersize": mark.size * look.marker,
        "markerfacecolor": mark.face,
        "markeredgecolor": mark.edge,
        "markeredgewidth": mark.rim * look.edge,
    }


def _paint(axes: Axes, raster: Raster, look: style.Look, placed: dict[str, Any]) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    axes.pcolormesh(raster.across, raster.upwards, raster.cells, rasterized=True, **placed)
    for hatch, cells in raster.hatches.items():
        if cells.any() and min(cells.shape) > 1:
            middles = [0.5 * (edges[1:] + edges[:-1]) for edges in (raster.across, raster.upwards)]
            strokes: Any = {"levels": [0.5, 1.5], "colors": "none", "hatches": [hatch], "zorder": raster.layer + 0.5}
            filled = axes.contourf(*middles, cells.astype(float), **strokes)
            filled.set_edgecolor(HATCHES[hatch])
            filled.set_linewidth(0.0)
    if raster.scale is not None:
        colours, low, high, label = raster.scale
        shades = ScalarMappable(Normalize(low, high), LinearSegmentedColormap.from_list("scale", list(colours)))
        figure: Any = axes.figure
        bar = figure.colorbar(shades, ax=axes, pad=0.02)
        bar.set_label(label, fontsize=look.normal, color=style.INK)
        bar.ax.tick_params(labelsize=look.small)


def handles(entries: Mapping[str, Entry], look: style.Look) -> dict[str, Any]:
    """What a legend shows beside its names."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    shown: dict[str, Any] = {}
    for name, entry in entries.items():
        line: dict[str, Any] = {"linestyle": "none"} if entry.pen is None else _line(entry.pen, look)
        handle: Any = Line2D([], [], **line, **({} if entry.mark is None else _marker(entry.mark, look)))
        if entry.patch is not None:
            edge = HATCHES.get(entry.hatch, entry.edge)  # which is the colour of the hatches as well
            drawn: dict[str, Any] = {"edgecolor": edge or "none", "linewidth": 0.5 if edge else 0.0}
            handle = Patch(facecolor=entry.patch, alpha=entry.opacity, hatch=entry.hatch or None, **drawn)
        shown[name] = handle
    return shown


# --------------------------------------------------------------------------------------------------------------- frames
def dress(axes: Axes, labels: tuple[str, str], look: style.Look, *, grid: bool = True) -> None:
    """Texts, ticks, grid and edges of a frame."""
    axes.set_xlabel(labels[0], fontsize=look.large, color=style.INK)
    axes.set_ylabel(labels[1], fontsize=look.large, color=style.INK)
    axes.tick_params(direction="in", top=True, right=True, labelsize=look.normal, color=style.INK, zorder=2)
    axes.tick_params(which="minor", direction="in", top=True, right=True, color=style.INK, zorder=2)
    if grid:
        axes.grid(True, color=style.GRID, linewidth=0.4 * look.line, zorder=0)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color(style.INK)
        spine.set_linewidth(0.53 * look.line)


def _set_axis(letter: str, axes: Any, axis: Axis) -> None:
    """Scale, limits and ticks of one axis, which all frames share."""
    from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator, MultipleLocator

    if axis.logarithmic:
        getattr(axes, f"set_{letter}scale")("log")
    if axis.low is not None or axis.high is not None:
        getattr(axes, f"set_{letter}lim")(axis.low, axis.high)
    own, ticks = getattr(axes, f"{letter}axis"), axis.ticks
    if ticks is None:
        return
    if len(ticks.places):
        own.set_major_locator(FixedLocator(list(ticks.places)))
        own.set_major_formatter(FixedFormatter(list(ticks.texts)))
        return
    own.set_major_locator(MaxNLocator(nbins=ticks.most, steps=list(ticks.steps), integer=ticks.whole))
    if ticks.minor is not None:
        own.set_minor_locator(MultipleLocator(ticks.minor))


# ------------------------------------------------------------------------------------------------------------- in space
def _in_space(figure: Figure, drawing: Drawing, sheet: style.Sheet) -> None:
    """Arrange a drawing with three axes on a figure."""
    from matplotlib.ticker import MaxNLocator

    look, small = sheet.look, sheet.inches[0] < _SMALL
    pad = (-0.45 if small else 0.3) * look.large
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    for letter, given in zip("xyz", drawing.axes, strict=True):
        getattr(axes, f"set_{letter}lim")(given.low, given.high)
        getattr(axes, f"set_{letter}label")(given.label, fontsize=look.large, color=style.INK, labelpad=pad)
        axis = getattr(axes, f"{letter}axis")
        axis.set_pane_color((1.0, 1.0, 1.0, 1.0))
        axis.pane.set_edgecolor(style.GRID)
        axis._axinfo["grid"].update({"color": style.GRID, "linewidth": 0.4 * look.line})
        axis.line.set_color(style.INK)
        axis.line.set_linewidth(0.53 * look.line)
        axis.set_major_locator(MaxNLocator(nbins=4 if small else 5, steps=[1, 2, 2.5, 5, 10]))
    axes.tick_params(labelsize=look.small, color=style.INK, pad=(-0.3 if small else -0.1) * look.small)
    draw(axes, drawing.frames[0], look)
    axes.view_init(*drawing.seen_from)
    _fill_page(figure, axes, drawing, sheet)


def _fill_page(figure: Figure, axes: Any, drawing: Drawing, sheet: style.Sheet) -> None:
    """Title and legend above, and the frame as large as what is left; a named size grows by the legend's height."""
    entries, look = handles(drawing.entries, sheet.look), sheet.look
    if sheet.named:
        _grow(figure, entries, sheet)
    top, whole = 1.0, figure.bbox.height
    if drawing.title:
        figure.suptitle(drawing.title, fontsize=look.large, color=style.INK, y=0.985)
        top -= 2.0 * look.large / 72.0 * figure.dpi / whole
    legend = fitting_legend(figure, entries, sheet, loc="upper center", bbox_to_anchor=(0.5, top))
    top = legend.get_window_extent().y0 / whole
    zoom, corner, room = 1.0, np.zeros(2), np.array([figure.bbox.width, top * whole])
    for _ in range(4):  # letters do not grow with the frame, so that a few rounds are needed
        axes.set_position((*corner, 1.0, top))
        axes.set_box_aspect(_ASPECT, zoom=zoom)
        figure.draw_without_rendering()
        drawn = _extent(figure, axes)
        corner = corner + (0.5 * (room - drawn.min - drawn.max)) / figure.bbox.size
        zoom *= float(np.clip((0.97 * room / drawn.size).min(), 0.5, 1.5))
    axes.set_position((*corner, 1.0, top))


def _extent(figure: Figure, axes: Any) -> Bbox:
    """The box of the frame with its labels, pixels."""
    from matplotlib.transforms import Bbox
    from mpl_toolkits.mplot3d import proj3d

    cube = np.array(list(product(axes.get_xlim(), axes.get_ylim(), axes.get_zlim()))).T
    flat = axes.transData.transform(np.array(proj3d.proj_transform(*cube, axes.get_proj())[:2]).T)
    canvas: Any = figure.canvas
    labels = [axis.get_tightbbox(canvas.get_renderer()) for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    return Bbox.union([Bbox([flat.min(axis=0), flat.max(axis=0)]), *labels])


# --------------------------------------------------------------------------------------------------------------- saving
def check_path(path: str | Path | None) -> None:
    """InputError for a file of a form that figures do not have, before any work."""
    if path is not None and (suffix := path_of(path).suffix.lower()) not in SUFFIXES:
        raise InputError(f"cannot tell the form of {path_of(path).name!r} from its suffix{suggest(suffix, SUFFIXES)}")


def save_figure(figure: Figure, path: str | Path, *, dpi: float = 300.0) -> Path:
    """Writes the figure as PNG (at `dpi`), SVG or PDF, by the suffix of `path`; makes the folder where it is missing.

    Written beside its place and renamed, so that an interruption leaves what was there before.
    """
    import matplotlib

    check_path(path)
    target = path_of(path)
    suffix = target.suffix.lower()
    target.parent.mkdir(parents=True, exist_ok=True)
    arranged = figure.get_layout_engine()
    if arranged is not None:
        arrange(figure)
        figure.set_layout_engine(None)  # with one, Matplotlib would draw everything twice
    try:
        with matplotlib.rc_context(_EMBEDDED):
            options: dict[str, Any] = {"format": suffix[1:], "dpi": dpi, "metadata": _METADATA[suffix]}
            replace_file(target, lambda place: figure.savefig(place, **options))
    finally:
        figure.set_layout_engine(arranged)
    return target


def image_of(figure: Figure, form: str, **options: Any) -> bytes:
    """The figure as "svg" or "png" in memory."""
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context(_EMBEDDED):
        figure.savefig(buffer, format=form, metadata=_METADATA[f".{form}"], **options)
    return buffer.getvalue()


# --------------------------------------------------------------------------------------------------- legends and labels
#: where a legend is tried inside a frame
_PLACES: tuple[Any, ...] = ("upper left", "upper right", "center left", "center right", "lower left", "lower right")
#: share of a frame's height from which a legend stands above it
_TALL = 0.7
#: so that two columns fit into the width of a journal's column
_TIGHT: dict[str, Any] = {"handlelength": 2.0, "handletextpad": 0.5, "columnspacing": 1.0}
#: distances of a text from its point, nearest first; further away where everything near is taken
_DISTANCES = (1.0, 2.4, 3.8)
#: points kept clear between two texts, and, rather, between a text and the frame with its ticks
_CLEAR, _TICKS = 1.5, 4.0
_SIDES = ((1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1))


def arrange(figure: Figure) -> None:
    """Give everything on a figure its place, as drawing it would."""
    engine = figure.get_layout_engine()
    if engine is None:
        figure.draw_without_rendering()
    else:
        engine.execute(figure)


def fitting_legend(
    figure: Figure, entries: Mapping[str, Any], sheet: style.Sheet, *, most: int = 4, **where: Any
) -> Legend:
    """The legend of a figure in as many columns as the page is wide, `most` at most; `where` as Matplotlib takes it."""
    for columns in range(max(1, min(len(entries), most)), 0, -1):
        legend = figure.legend(list(entries.values()), list(entries), ncols=columns, **_frame_of(sheet) | where)
        arrange(figure)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            break
        legend.remove()
    return legend


def _grow(figure: Figure, entries: Mapping[str, Any], sheet: style.Sheet) -> None:
    """Add the height of the legend to that of the figure: a named size is a width."""
    width, height = figure.get_size_inches()
    legend = fitting_legend(figure, entries, sheet)
    figure.set_size_inches(width, height + legend.get_window_extent().height / figure.dpi)
    legend.remove()


def _legend_inside(axes: Axes, entries: Mapping[str, Any], sheet: style.Sheet) -> bool:
    """Whether there is a place for the legend inside a frame where it covers nothing; it stands there then."""
    if not entries:
        return True
    legend, frame = axes.legend(list(entries.values()), list(entries), **_frame_of(sheet)), axes.get_window_extent()
    legend.set_zorder(6)
    for place in _PLACES:
        legend.set_loc(place)
        box = legend.get_window_extent()
        inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and box.height < _TALL * frame.height
        if inside and not _covered(axes, box.padded(axes.figure.dpi / 72.0 * style.MARKER_SIZE)):
            return True
    legend.remove()
    return False


def _frame_of(sheet: style.Sheet) -> dict[str, Any]:
    frame = {"frameon": True, "framealpha": 1.0, "edgecolor": style.GRID, "handlelength": 2.6}
    return {"fontsize": sheet.look.small, **frame, **(_TIGHT if sheet.named else {})}


def annotate(axes: Axes, labels: Sequence[Label], look: style.Look) -> None:
    """Write texts beside their places; the same text at the same place once.

    Of the sides of a place the one is taken on which the text covers the fewest lines, markers and other texts, and is
    not nearer to the place of another text.
    """
    unit, window, legend = axes.figure.dpi / 72.0, axes.get_window_extent(), axes.get_legend()
    taken = [] if legend is None else [legend.get_window_extent()]
    gap = 0.75 * style.MARKER_SIZE * look.marker
    looks: dict[str, Any] = {"fontsize": look.small, "color": style.INK, "zorder": 7, "gid": "label"}
    done: list[tuple[str, np.ndarray]] = []
    points = [axes.transData.transform(label.at) for label in labels]
    for label, point in zip(labels, points, strict=True):
        others = [there for other, there in zip(labels, points, strict=True) if other.text != label.text]
        again = any(label.text == text and np.hypot(*(point - there)) < 3.0 * unit for text, there in done)
        if again or not np.isfinite(point).all():
            continue
        done.append((label.text, point))
        at: dict[str, Any] = {"xy": label.at, "textcoords": "offset points", "annotation_clip": False}
        costs = {}
        for distance, (rank, (across, up)) in product(_DISTANCES, enumerate(_SIDES)):
            reach = distance * gap * (0.75 if across and up else 1.0)
            sides: dict[str, Any] = {"ha": ("center", "left", "right")[across], "va": ("center", "bottom", "top")[up]}
            note = axes.annotate(label.text, xytext=(reach * across, reach * up), **at, **sides, **looks)
            box = note.get_window_extent()
            overlaps = box.padded(_CLEAR * unit).count_overlaps(taken)
            cost = 40.0 * _covered(axes, box) + 400.0 * (overlaps + _leaves(box, window))
            own = _distance(box, point)
            cost += 200.0 * any(_distance(box, there) < own for there in others)
            costs[note] = cost + 25.0 * _leaves(box, window.padded(-_TICKS * unit)) + 0.1 * rank + 5.0 * distance
        best = min(costs, key=lambda note: costs[note])
        for note in costs:
            if note is not best:
                note.remove()
        taken.append(best.get_window_extent())


def _distance(box: Bbox, point: np.ndarray) -> float:
    """From a point to a box, in pixels; zero inside."""
    return float(np.hypot(*np.maximum(np.maximum(box.min - point, point - box.max), 0.0)))


def _covered(axes: Axes, box: Bbox) -> int:
    """How many lines cross a box, in pixels, and markers lie in it."""
    count = 0
    for item in axes.get_lines():
        path = item.get_transform().transform_path(item.get_path())
        if item.get_linestyle() != "None":
            count += path.intersects_bbox(box, filled=False)
        else:
            reach = 0.35 * item.get_markersize() * axes.figure.dpi / 72.0
            count += box.padded(reach).count_contains(path.vertices)
    return count


def _leaves(box: Bbox, frame: Bbox) -> bool:
    return not (frame.contains(*box.min) and frame.contains(*box.max))
