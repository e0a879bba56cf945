"""Which texts of a figure lie on each other or on curves, as Matplotlib's renderer places them."""

from __future__ import annotations

from contextlib import contextmanager
from itertools import combinations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

#: pixels by which boxes may meet: letters do not fill theirs
_MEET = 1.5


def overlapping_texts(figure):
    """Pairs of texts whose boxes overlap on the page, [(text, text), ...]."""
    canvas = FigureCanvasAgg(figure) if not isinstance(figure.canvas, FigureCanvasAgg) else figure.canvas
    canvas.draw()
    renderer, hidden = canvas.get_renderer(), _unseen_ticks(figure)
    seen = [
        (text.get_text(), text.get_window_extent(renderer))
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text().strip() and id(text) not in hidden
    ]
    return [
        (one, other)
        for (one, a), (other, b) in combinations(seen, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > _MEET and min(a.y1, b.y1) - max(a.y0, b.y0) > _MEET
    ]


def labels_on_curves(figure):
    """The texts beside points that a line crosses, or that a marker lies in."""
    figure.canvas.draw()
    return [
        text.get_text()
        for axes in figure.axes
        for text in axes.texts
        if text.get_gid() == "label" and _crossed(axes, text.get_window_extent())
    ]


def _crossed(axes, box):
    for line in axes.get_lines():
        path = line.get_transform().transform_path(line.get_path())
        drawn = line.get_linestyle() != "None"
        if path.intersects_bbox(box, filled=False) if drawn else box.count_contains(path.vertices):
            return True
    return False


def _unseen_ticks(figure):
    """Texts of ticks outside the view, which Matplotlib keeps and does not draw."""
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis, *([axes.zaxis] if axes.name == "3d" else [])):
            drawn = {id(tick) for tick in axis._update_ticks()} if axes.axison and axis.get_visible() else set()
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if id(tick) not in drawn:
                    hidden |= {id(tick.label1), id(tick.label2)}
    return hidden


@contextmanager
def written_figures():
    """The figures that are written meanwhile, [figure, ...]."""
    figures, save = [], Figure.savefig

    def saved(figure, *given, **options):
        figures.append(figure)
        return save(figure, *given, **options)

    Figure.savefig = saved
    try:
        yield figures
    finally:
        Figure.savefig = save
