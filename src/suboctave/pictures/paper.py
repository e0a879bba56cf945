"""Drawings on paper: Matplotlib figures made without any global plotting state, saved as PNG, SVG or PDF.

The legend stands where it covers no curve, and short texts beside points where they cover least.
"""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
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
    Markers,
    Polyline,
    Raster,
    Region,
    Surface,
    spread,
)
from suboctave.pictures.frames import framed
from suboctave.pictures.options import FrameOptions
from suboctave.pictures.placing import annotate, arrange, box_of, crowds, fitting_legend, grow, legend_inside
from suboctave.pictures.strokes import bent
from suboctave.session import at_prompt

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
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
#: decades of a logarithmic axis up to which its ticks are plain numbers
_FEW = 4.0
#: inches of width of a page below which there are fewer ticks, and labels closer to their axes
_SMALL = 4.2


def figure_of(drawing: Drawing | Callable[[Figure], None], sheet: style.Sheet) -> Figure:
    """The figure of a drawing on a page, without a window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=sheet.inches, facecolor="white")
    FigureCanvasAgg(figure)
    return _filled(figure, drawing, sheet)


def finished(drawing: Drawing, sheet: style.Sheet, path: str | Path | None, options: Mapping[str, Any]) -> Figure:
    """The figure of a drawing, saved where a path is given; else at a prompt in a window, where there is a screen.

    `options`: those of `FrameOptions`. Into axes that a user gives it is drawn as it is elsewhere; the figure is then
    that of these axes.
    """
    check_path(path)
    drawing = framed(drawing, options)
    if (own := options.get("ax")) is not None:
        figure = _into(own, drawing, sheet)
        if path is not None:
            save_figure(figure, path)
        return figure
    return save_or_show(drawing, sheet, path)


def save_or_show(drawing: Drawing | Callable[[Figure], None], sheet: style.Sheet, path: str | Path | None) -> Figure:
    """The figure of a drawing, or of what fills one, saved where a path is given; else at a prompt in a window, where
    there is a screen.
    """
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


def _filled(figure: Figure, drawing: Drawing | Callable[[Figure], None], sheet: style.Sheet) -> Figure:
    if not isinstance(drawing, Drawing):
        drawing(figure)
        return figure
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


class _Page(FrameOptions, total=False):
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
            page = {name: options.pop(name, None) for name in _Page.__optional_keys__}
            frame, axes = layout(*given, **options)
            frame.title = style.checked_text(page["title"])
            sheet = style.sheet_of(page["size"] or size)
            return finished(Drawing(axes, [frame], **arranged), sheet, page["path"], page)

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
        _set_scales(axes, drawing)
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
        _draw_spaced(axes, frame, look)


def _draw_spaced(axes: Axes, frame: Frame, look: style.Look) -> None:
    """Draw what is spaced on paper, in a frame that has its place: marks along lines, and labels."""
    figure: Any = axes.figure
    box = axes.get_window_extent()
    size = box.width / figure.dpi * 25.4, box.height / figure.dpi * 25.4
    low, high = _flat(axes, np.array([axes.get_xlim(), axes.get_ylim()])).T
    for item in frame.items:
        if isinstance(item, Beads):
            along = replace(item, at=_flat(axes, item.at), clear=_flat(axes, item.clear))
            if (at := along.places(low, high, size)).size:
                beads = Markers(_flat(axes, at, back=True), item.mark, role=item.role, layer=item.layer + 0.5)
                _draw(axes, beads, look, (1.0, 1.0))
    annotate(axes, [*frame.labels, *crowds(axes, frame)], look)


def _into(given: Any, drawing: Drawing, sheet: style.Sheet) -> Figure:
    """Draw into axes of a user; the figure that they belong to.

    What they say already stays, and so does their look; their limits widen to what is drawn.
    """
    from matplotlib.axes import Axes

    several: list[Any] = list(np.ravel(np.asarray(given, dtype=object)))
    if not all(isinstance(axes, Axes) for axes in several):
        raise InputError(f"ax takes axes of Matplotlib, such as plt.gca(), not {type(given).__name__}")
    if len(several) != len(drawing.frames):
        raise InputError(f"ax has {len(several)} axes, the figure {len(drawing.frames)}: give as many")
    solid = len(drawing.axes) == 3
    if any((axes.name == "3d") is not solid for axes in several):
        asked = 'axes in space, figure.add_subplot(projection="3d")' if solid else "axes in the plane"
        raise InputError(f"ax: what is drawn needs {asked}")
    look, entries = sheet.look, handles(drawing.entries, sheet.look)
    for axes, frame in zip(several, drawing.frames, strict=True):
        letters = "xyz"[: len(drawing.axes)]
        before = {letter: getattr(axes, f"get_{letter}lim")() for letter in letters} if axes.has_data() else {}
        if not solid:
            _set_scales(axes, drawing)
        draw(axes, frame, look)
        for letter, axis in zip(letters, drawing.axes, strict=True):
            if not getattr(axes, f"get_{letter}label")():
                getattr(axes, f"set_{letter}label")(axis.label)
            ends = [(axis.low, axis.high), before.get(letter, (None, None))]
            low, high = ([end for end in side if end is not None] for side in zip(*ends, strict=True))
            getattr(axes, f"set_{letter}lim")(min(low, default=None), max(high, default=None))
        if title := frame.title or drawing.title:
            axes.set_title(title)
        if axes is several[0] and entries:
            _extend_legend(axes, entries, sheet)
    figure: Figure = several[0].figure.figure  # of a part of a figure the whole
    arrange(figure)
    for axes, frame in zip(several, drawing.frames, strict=True) if not solid else ():
        _draw_spaced(axes, frame, look)
    return figure


def _extend_legend(axes: Any, entries: Mapping[str, Any], sheet: style.Sheet) -> None:
    """Add entries to the legend of axes, under what it has."""
    old = axes.get_legend()
    known = (
        {} if old is None else dict(zip((text.get_text() for text in old.get_texts()), old.legend_handles, strict=True))
    )
    every = {**known, **entries}
    if not legend_inside(axes, every, sheet):
        axes.legend(list(every.values()), list(every), loc="best", **box_of(sheet))


def _set_scales(axes: Axes, drawing: Drawing) -> None:
    """Logarithmic axes, before anything is drawn: lines are smooth as they are seen."""
    for letter, axis in zip("xy", drawing.axes, strict=True):
        if axis.logarithmic:
            getattr(axes, f"set_{letter}scale")("log")


def _flat(axes: Any, at: np.ndarray, *, back: bool = False) -> np.ndarray:
    """Places, (axes, places), in coordinates that are linear on the page; or back."""
    if len(at) > 2:
        return at
    scales = [getattr(axes, f"get_{letter}scale")() for letter in "xy"]
    if "log" not in scales:
        return at
    with np.errstate(divide="ignore", invalid="ignore"):
        rows = [
            (10.0**row if back else np.log10(row)) if s == "log" else row for row, s in zip(at, scales, strict=True)
        ]
    return np.array(rows)


def _place(figure: Figure, frames: Sequence[Axes], drawing: Drawing, sheet: style.Sheet) -> None:
    entries, where = handles(drawing.entries, sheet.look), drawing.legend
    arrange(figure)  # a legend inside one of the frames moves nothing
    if where == "free" and any(legend_inside(axes, entries, sheet) for axes in frames):
        return
    if where in ("beside", "below"):
        beside = where == "beside" and sheet.inches[0] >= _WIDE
        plain: dict[str, Any] = {"frameon": False, "handlelength": 2.2, "handleheight": 1.1}
        place = "outside right upper" if beside else "outside lower center"
        fitting_legend(figure, entries, sheet, most=1 if beside else 2, loc=place, **plain)
    elif entries:
        if sheet.named:
            grow(figure, entries, sheet)
        fitting_legend(figure, entries, sheet, loc="outside upper center")


# ---------------------------------------------------------------------------------------------------- what is in frames
def draw(axes: Any, frame: Frame, look: style.Look) -> None:
    """Draw what stands in a frame, but for what is spaced on paper and for labels."""
    seen = [item.at for item in frame.items if isinstance(item, Polyline | Markers)]
    around = spread(_flat(axes, np.concatenate(seen, axis=1))) if seen else (1.0, 1.0)
    for item in frame.items:
        _draw(axes, item, look, around)


def _draw(axes: Any, item: Item, look: style.Look, around: tuple[float, float]) -> None:
    placed: dict[str, Any] = {"zorder": item.layer, "gid": item.role}
    match item:
        case Polyline():
            at = item.at
            if item.smooth:
                across, upwards = _flat(axes, item.at)
                at = _flat(axes, np.array(bent(across, upwards, around)), back=True)
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
    axes.tick_params(axis="x", pad=0.55 * look.normal)  # in the corner clear of the lowest number beside it
    if grid:
        axes.grid(True, color=style.GRID, linewidth=0.4 * look.line, zorder=0)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color(style.INK)
        spine.set_linewidth(0.53 * look.line)


def _set_axis(letter: str, axes: Any, axis: Axis) -> None:
    """Limits and ticks of one axis, which all frames share."""
    from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator, MultipleLocator

    if axis.low is not None or axis.high is not None:
        getattr(axes, f"set_{letter}lim")(axis.low, axis.high)
    own, ticks = getattr(axes, f"{letter}axis"), axis.ticks
    if ticks is None:
        if axis.logarithmic:
            _set_decades(own)
        return
    if len(ticks.places):
        own.set_major_locator(FixedLocator(list(ticks.places)))
        own.set_major_formatter(FixedFormatter(list(ticks.texts)))
        return
    own.set_major_locator(MaxNLocator(nbins=ticks.most, steps=list(ticks.steps), integer=ticks.whole))
    if ticks.minor is not None:
        own.set_minor_locator(MultipleLocator(ticks.minor))


def _set_decades(axis: Any) -> None:
    """Ticks of a logarithmic axis: plain numbers where there are few decades, the ones between them too."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = sorted(axis.get_view_interval())
    decades = math.log10(high / low)
    if decades > _FEW or not 1e-3 <= low < high < 1e5:
        return
    within = MaxNLocator(nbins=7, steps=[1, 2, 2.5, 5, 10])  # a part of a decade
    steps = (1.0,) if decades > 2.0 else (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=steps) if decades > 0.9 else within)
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


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
        grow(figure, entries, sheet)
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


def figure_file(number: int = 1) -> Path:
    """Where a script puts its figure, or the second, the third: the file of that number on its command line, else one
    of its own name, with .png, in the folder that it runs in. Prints which.
    """
    named = [text for text in sys.argv[1:] if Path(text).suffix.lower() in SUFFIXES]
    script = Path(sys.argv[0]).stem or "figure"
    own = f"{script}.png" if number == 1 else f"{script}_{number}.png"
    path = path_of(named[number - 1] if len(named) >= number else own)
    print(f"figure: {path}")
    return path


def image_of(figure: Figure, form: str, **options: Any) -> bytes:
    """The figure as "svg" or "png" in memory."""
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context(_EMBEDDED):
        figure.savefig(buffer, format=form, metadata=_METADATA[f".{form}"], **options)
    return buffer.getvalue()
