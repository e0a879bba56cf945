"""Isolas in pictures, from datasets in closed form: ellipses over omega that shrink to a point as j grows."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from suboctave.errors import InputError
from suboctave.pictures import plot, plot_boundaries, plot_space
from suboctave.pictures.boundary import boundary_drawing, space_drawing
from suboctave.pictures.browser import figure_data
from suboctave.pictures.report import write_report
from suboctave.pictures.strokes import surface
from suboctave.pictures.style import period_colour, tinted
from suboctave.store.layout import EventRow, curve_dataset, isolas_dataset

TOP, BOTTOM, MIDDLE = 0.5, 0.1, 2.0


def folds():
    """The limit points at omega = 2 +- sqrt(TOP - j), of motions of period 2T; a cusp stands aside."""
    omega = np.linspace(1.3, 2.7, 29)
    events = [
        EventRow("CP", 3, 1.46, 0.2, parameters={"j": TOP - 0.54**2}),
        EventRow("extremum", 14, 2.0, 0.6, parameters={"j": TOP}, extreme="maximum of j"),
    ]
    dataset = curve_dataset(
        omega,
        np.full(29, 0.6),
        stable=np.ones(29, dtype=bool),
        parameters={"j": TOP - (omega - MIDDLE) ** 2, "p": 0.5},
        free="j",
        events=events,
        period=2,
    )
    return dataset.assign_attrs(tracked="LP", plane="omega\nj").assign(
        coefficient=("point", np.ones(29)),
        event_extreme=("event", np.array([e.extreme for e in events], dtype=object)),
    )


def closed(gap, turned=False):
    """An ellipse around (2, 0.6) whose half width is sqrt(TOP - gap); the lower half is unstable."""
    angle = np.linspace(0.0, 2.0 * np.pi, 41) + 0.4
    if turned:
        angle = -angle[::-1]
    half = np.sqrt(TOP - gap)
    dataset = curve_dataset(
        MIDDLE + half * np.cos(angle),
        0.6 + 0.3 * half * np.sin(angle),
        stable=np.sin(angle) > 0.0,
        parameters={"j": gap, "p": 0.5},
        period=2,
        closed=True,
    )
    return dataset.assign_attrs(isola=0, at=gap)


def isola(merges=np.nan):
    value = np.linspace(BOTTOM, TOP, 401)
    half = np.sqrt(TOP - value)
    row = {"period": 2, "from": BOTTOM, "to": TOP, "born": TOP, "born_omega": MIDDLE, "merges": merges}
    row |= {
        "merges_omega": 1.46 if merges == merges else np.nan,
        "at_from": "<cut>",
        "at_to": "shrinks",
        "notes": "odd",
    }
    edges = np.column_stack([value, MIDDLE - half, MIDDLE + half])
    told = {"isolas": "j", "bounds_low": 0.1, "bounds_high": 1.0, "omega_low": 1.0, "omega_high": 3.0}
    return isolas_dataset([row], [edges], [(0, 0.2), (0, 0.4)], {**told, "said": "1 isola", "notes": "left open"})


def drawn(figure, gid):
    return [item for item in figure.axes[0].get_children() if item.get_gid() == gid]


@pytest.mark.parametrize("turned", [False, True])
def test_the_region_is_what_lies_between_the_limit_points(turned):
    axes = {"x": "j", "y": "omega"} if turned else {}
    figure = plot([isola(), folds()], **axes)
    (region,) = drawn(figure, "isola")
    path = region.get_path()

    def inside(omega, gap):
        return path.contains_point((gap, omega) if turned else (omega, gap))

    for gap in (0.15, 0.3, 0.45):
        half = np.sqrt(TOP - gap)
        for omega in (MIDDLE - 0.97 * half, MIDDLE, MIDDLE + 0.97 * half):
            assert inside(omega, gap)
        assert not inside(MIDDLE + 1.03 * half, gap)
        assert not inside(MIDDLE - 1.03 * half, gap)
    assert not inside(MIDDLE, BOTTOM - 0.01)
    assert not inside(MIDDLE, TOP + 0.01)
    legend = figure.axes[0].get_legend() or figure.legends[0]
    assert "2T isola" in [text.get_text() for text in legend.get_texts()]


def test_the_ends_are_marked_and_named():
    figure = plot_boundaries([isola(merges=TOP - 0.54**2), folds()])
    (birth,) = drawn(figure, "isola_centre")
    assert (birth.get_xdata()[0], birth.get_ydata()[0]) == (MIDDLE, TOP)
    assert not drawn(figure, "extremum")  # it is the birth
    (merging,) = drawn(figure, "isola_merging")
    assert merging.get_xdata()[0] == 1.46
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert "born 0.5000" in texts
    assert "merges 0.2084" in texts
    # without the isolas they are what they are
    assert drawn(plot_boundaries(folds()), "extremum")


def test_in_another_plane_there_is_no_region():
    assert not drawn(plot([isola(), folds()], x="omega", y="p"), "isola")
    figure = plot([isola(), folds()], frequency="Hz", scale=2.0, unit="mm")
    x, y = drawn(figure, "isola")[0].get_xy().T
    assert y.max() == pytest.approx(2.0 * TOP)
    assert x.max() == pytest.approx((MIDDLE + np.sqrt(TOP - BOTTOM)) / (2.0 * np.pi))


def test_the_surface_goes_through_the_loops_and_the_birth():
    gaps = (0.2, 0.3, 0.4)
    loops = []
    for gap in gaps:
        data = closed(gap, turned=gap == 0.3)  # whichever way round it was followed
        loops.append(np.array([data["omega"], np.full(41, gap), data["amplitude"]]))
    grid = surface(loops, [np.array([MIDDLE, TOP, 0.6])])
    assert grid.shape[:2] == (3, 4)
    for row, gap in zip(grid.transpose(1, 0, 2), (*gaps, TOP), strict=True):
        half = np.sqrt(TOP - gap)
        assert row[1] == pytest.approx(gap)
        radius = np.hypot(row[0] - MIDDLE, (row[2] - 0.6) / 0.3)
        assert radius == pytest.approx(half, rel=0.02)
    # neighbours at the same phase: no twist
    angle = [np.arctan2((row[2] - 0.6) / 0.3, row[0] - MIDDLE) for row in grid.transpose(1, 0, 2)[:3]]
    apart = np.angle(np.exp(1j * (np.diff(angle, axis=0))))
    assert np.abs(apart).max() < 0.25
    assert surface(loops[:1]) is None


def test_in_space(tmp_path):
    everything = [isola(), folds(), closed(0.2), closed(0.4)]
    figure = plot_space(everything, tmp_path / "space.png")
    assert (tmp_path / "space.png").stat().st_size > 10_000
    axes = figure.axes[0]
    assert [item for item in axes.collections if item.get_gid() == "isola"]
    assert [item for item in axes.collections if item.get_gid() == "isola-floor"]
    assert [item for item in axes.get_lines() if item.get_gid() == "isola_centre"]
    with pytest.raises(InputError, match="no curve"):
        plot_space([isola()])


def test_for_the_browser():
    plane = figure_data(boundary_drawing([isola(), folds()]), "name")
    region = plane["data"][0]
    assert region["fill"] == "toself"
    assert region["fillcolor"] == tinted(period_colour(2), 0.82)
    assert "isola is born" in [trace["name"] for trace in plane["data"]]
    space = figure_data(space_drawing([isola(), folds(), closed(0.2), closed(0.4)]), "name")
    (grid,) = [trace for trace in space["data"] if trace["type"] == "surface"]
    assert np.shape(grid["x"]) == np.shape(grid["z"])
    assert np.max(grid["y"]) == pytest.approx(TOP)
    json.dumps([plane, space], allow_nan=False)


class Isolas:
    """What `write_report` takes: anything with `to_xarray`."""

    def __init__(self, curves):
        self.curves = curves

    def to_xarray(self):
        return {"isolas": isola(), **self.curves}


def test_the_report(tmp_path):
    given = Isolas({"folds": folds(), "at 0.2": closed(0.2), "at 0.4": closed(0.4)})
    page = write_report({"found": given}, tmp_path / "page.html").read_text(encoding="utf-8")
    words = re.sub(r"<[^>]+>", " ", page.split("<script", 1)[0])
    for said in ("1 isola", "left open", "Isola 0: odd", "Isola 0, j = 0.5: shrinks", "&lt;cut&gt;"):
        assert said in words, said
    assert page.count('<div class="figure">') == 3  # the plane, the closed branches, both in space
    alone = write_report({"none": Isolas({})}, tmp_path / "none.html").read_text(encoding="utf-8")
    assert "1 isola" in alone
    assert "plotly-packed" not in alone.split("<script>")[0]


def test_texts_stand_beside_their_own_markers_where_these_are_close():
    """A birth and a merging a marker apart, on a line: no text is nearer to the other's place."""
    from matplotlib.figure import Figure

    from suboctave.pictures.drawing import Label
    from suboctave.pictures.paper import annotate
    from suboctave.pictures.style import SCREEN

    axes = Figure((6.4, 4.2)).subplots()
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axes.plot([0.0, 0.48, 0.52, 1.0], [0.3, 0.5, 0.5, 0.7])
    places = {"born 0.4446": (0.511, 0.5), "merges 0.4449": (0.489, 0.5)}
    axes.plot(*zip(*places.values(), strict=True), "o", linestyle="None")
    annotate(axes, [Label(np.array(at), text) for text, at in places.items()], SCREEN)

    def distance(box, at):
        point = axes.transData.transform(at)
        return np.hypot(*np.maximum(np.maximum(box.min - point, point - box.max), 0.0))

    for note in axes.texts:
        box, own = note.get_window_extent(), places[note.get_text()]
        (other,) = (at for text, at in places.items() if text != note.get_text())
        assert distance(box, own) <= distance(box, other)
