"""Boundaries in the plane and in space, drawn from datasets in closed form: no solver has a part in what is seen."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from overlaps import labels_on_curves

from suboctave.errors import InputError
from suboctave.pictures import plot, plot_boundaries, plot_space, style
from suboctave.pictures.boundary import boundary_drawing, space_drawing
from suboctave.pictures.browser import SYMBOLS, figure_data
from suboctave.pictures.report import write_report
from suboctave.pictures.style import period_colour
from suboctave.store.layout import EventRow, curve_dataset

TOP = 0.5


def boundary(kind="PD", period=1, shift=0.0, unstable_before=None, **fixed):
    """The parabola j = 1/2 - (omega - 2 - shift)^2, with a GPD at either side of its top; c3 > 0 between them."""
    omega = np.linspace(1.3, 2.7, 29)
    gap = TOP - (omega - 2.0) ** 2
    events = [
        EventRow("GPD", 9, 1.76, 0.3, parameters={"j": TOP - 0.24**2}, stable_after=True),
        EventRow("extremum", 14, 2.0, 0.4, parameters={"j": TOP}, stable_after=True, extreme="maximum of j"),
        EventRow("GPD", 18, 2.24, 0.3, parameters={"j": TOP - 0.24**2}, stable_after=True),
    ]
    stable = np.ones(29, dtype=bool) if unstable_before is None else omega + 1e-9 >= unstable_before
    dataset = curve_dataset(
        omega + shift,
        0.4 - 0.3 * (omega - 2.0) ** 2,
        stable=stable,
        parameters={"j": gap, "p": 0.5, **fixed},
        free="j",
        events=[EventRow(**{**vars(e), "omega": e.omega + shift}) for e in events],
        period=period,
    )
    middle = np.abs(omega - 2.0) < 0.24
    return dataset.assign_attrs(tracked=kind, plane="omega\nj").assign(
        coefficient=("point", np.where(middle, 1.0, -1.0)),
        event_extreme=("event", np.array([e.extreme for e in events], dtype=object)),
    )


def response(gap, period=1):
    """A response at one gap, with period doublings where the parabola says."""
    omega = np.linspace(2.9, 1.1, 37)
    half = np.sqrt(TOP - gap)
    stable = np.abs(omega - 2.0) > half
    events = [
        EventRow("PD", int(np.searchsorted(-omega, -at)) - 1, at, 0.4 - 0.3 * (at - 2.0) ** 2)
        for at in (2.0 + half, 2.0 - half)
    ]
    return curve_dataset(
        omega,
        0.4 - 0.3 * (omega - 2.0) ** 2,
        stable=stable,
        parameters={"j": gap, "p": 0.5},
        events=events,
        period=period,
    )


def lines(figure, *gids):
    return [line for line in figure.axes[0].get_lines() if line.get_gid() in gids]


def test_the_line_is_the_parabola_in_the_colour_of_the_period_that_is_born():
    figure = plot(boundary())
    drawn = lines(figure, "border", "within")
    x, y = np.concatenate([line.get_xydata() for line in drawn]).T
    assert y == pytest.approx(TOP - (x - 2.0) ** 2, abs=1e-3 * TOP)
    # computed points and events alike
    exact = np.abs(y - TOP + (x - 2.0) ** 2) < 1e-12
    known = boundary()
    for omega in (*known["omega"].to_numpy(), *known["event_omega"].to_numpy()):
        assert np.abs(x[exact] - omega).min() < 1e-12
    assert (x.min(), x.max(), y.max()) == pytest.approx((1.3, 2.7, TOP))
    assert {line.get_color() for line in drawn} == {period_colour(2)}
    assert {line.get_color() for line in lines(plot(boundary(period=2)), "border")} == {period_colour(4)}
    assert {line.get_color() for line in lines(plot(boundary("LP", period=2)), "border")} == {period_colour(2)}
    axes = figure.axes[0]
    assert ("omega" in axes.get_xlabel(), axes.get_ylabel()) == (True, "j")


def test_marks_are_hollow_exactly_where_doublings_are_subcritical():
    figure = plot(boundary())
    hollow, filled = (np.concatenate([m.get_xdata() for m in lines(figure, gid)]) for gid in ("along-hollow", "along"))
    assert len(hollow) >= 1
    assert np.all(np.abs(hollow - 2.0) < 0.24)
    assert len(filled) >= 4
    assert np.all(np.abs(filled - 2.0) > 0.24)
    for line in lines(figure, "along-hollow"):
        assert line.get_markerfacecolor() == "white"
        assert line.get_marker() == style.KINDS["PD"].marker
    # of other kinds the coefficient says nothing of the kind
    assert not lines(plot(boundary("NS")), "along-hollow")


def test_marks_stand_at_equal_distances_on_paper():
    figure = plot(boundary("NS"), size="single-column")
    axes = figure.axes[0]
    at = axes.transData.transform(np.concatenate([line.get_xydata() for line in lines(figure, "along")]))
    steps = np.hypot(*np.diff(at[np.argsort(at[:, 0])], axis=0).T) / figure.dpi * 25.4
    assert 4.0 < np.median(steps) < 18.0  # millimetres


def test_dashed_where_motions_on_both_sides_are_unstable():
    figure = plot(boundary(unstable_before=1.9))
    (dashed,) = lines(figure, "within")
    assert dashed.is_dashed()
    # up to the first stable point: no event was located there, so that nothing is promised before it
    assert dashed.get_xdata()[0] == pytest.approx(1.3)
    assert dashed.get_xdata()[-1] == pytest.approx(1.9)
    assert {"borders stable motions", "within unstable motions"} <= set(words_of(figure))
    assert not [w for w in words_of(plot(boundary())) if "stable motions" in w]


def words_of(figure):
    legends = [axes.get_legend() for axes in figure.axes] + list(figure.legends)
    return [text.get_text() for legend in legends if legend is not None for text in legend.get_texts()]


def test_points_are_marked_and_named_and_names_do_not_overlap():
    for size in ("single-column", "double-column", (6.4, 4.2)):
        figure = plot([boundary(), boundary("LP", period=2, shift=0.1)], size=size)
        assert {kind for kind in style.KINDS if lines(figure, kind)} == {"GPD", "extremum"}
        named = [text for text in figure.axes[0].texts if text.get_gid() == "label"]
        assert sorted(text.get_text() for text in named) == ["0.5000", "0.5000", "GPD", "GPD", "GPD", "GPD"]
        assert labels_on_curves(figure) == []
        figure.draw_without_rendering()
        boxes = [text.get_window_extent() for text in named]
        for i, box in enumerate(boxes):
            assert not any(box.overlaps(other) for other in boxes[:i])
            assert figure.bbox.x0 <= box.x0
            assert box.x1 <= figure.bbox.x1


def test_kinds_and_what_differs_is_told_in_the_legend():
    figure = plot([boundary(), boundary(period=2), boundary("LP", period=2)])
    assert words_of(figure)[:3] == ["period doubling T→2T", "period doubling 2T→4T", "limit point of 2T"]
    two = plot([boundary(q=1.0), boundary(q=2.0, shift=0.2)])
    assert words_of(two)[:2] == ["period doubling T→2T, q = 1", "period doubling T→2T, q = 2"]
    first, second = ({(m.get_color(), m.get_linewidth()) for m in lines(f, "border")} for f in (two, plot(boundary())))
    assert len(first) == 2
    assert len(second) == 1
    assert words_of(plot([boundary(), boundary("LP")], labels=["a", "b"]))[:2] == ["a", "b"]


def test_a_named_size_is_a_width_when_the_legend_stands_above():
    group = [boundary(kind, period=nu, shift=0.05 * i) for i, (kind, nu) in enumerate(product_of_kinds())]
    figure = plot(group, size="single-column")
    assert figure.legends
    assert figure.get_figwidth() == pytest.approx(style.SIZES["single-column"][0])
    assert figure.axes[0].get_window_extent().height / figure.dpi > 1.5


def product_of_kinds():
    return [(kind, nu) for kind in ("PD", "LP", "NS", "BP", "grazing") for nu in (1, 2)]


def test_units_and_axes():
    figure = plot(boundary(), frequency="Hz", scale=1e3, unit="mm")
    axes = figure.axes[0]
    x, y = np.concatenate([line.get_xydata() for line in lines(figure, "border")]).T
    assert y == pytest.approx(1e3 * (TOP - (2.0 * np.pi * x - 2.0) ** 2), abs=TOP)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("forcing frequency (Hz)", "j (mm)")
    turned = plot(boundary(), x="j", frequency="Hz", scale=1e3, unit="mm").axes[0]
    assert (turned.get_xlabel(), turned.get_ylabel()) == ("j (mm)", "forcing frequency (Hz)")
    across = np.concatenate([line.get_xdata() for line in turned.get_lines() if line.get_gid() == "border"])
    assert across.max() == pytest.approx(1e3 * TOP)
    upright = plot(boundary(), quantity="amplitude", x="j", scale=2.0)
    x, y = np.concatenate([line.get_xydata() for line in lines(upright, "border")]).T
    assert x.max() == pytest.approx(TOP)
    assert y.max() == pytest.approx(0.8)
    assert "amplitude" in upright.axes[0].get_ylabel()


def test_part_of_the_axes_and_some_of_the_marks():
    figure = plot(boundary(), xlim=(1.9, 2.5), marks=["GPD"])
    assert figure.axes[0].get_xlim() == (1.9, 2.5)
    assert not lines(figure, "extremum")
    (mark,) = lines(figure, "GPD")
    assert mark.get_xdata() == pytest.approx([2.24])
    assert [text.get_text() for text in figure.axes[0].texts if text.get_gid() == "label"] == ["GPD"]
    along = np.concatenate([m.get_xdata() for m in lines(figure, "along", "along-hollow")])
    assert np.all((along > 1.9) & (along < 2.5))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot(boundary(), x="k"), "no parameter 'k'"),
        (lambda: plot(boundary(), x="p"), "'p' was not free"),
        (lambda: plot(boundary(), x="j", y="j"), "same parameter"),
        (lambda: plot(boundary(), y="j", quantity="amplitude"), "y= names a parameter"),
        (lambda: plot(boundary(), quantity="rms"), "no 'rms'"),
        (lambda: plot(boundary(), labels=["a", "b"]), "expected one for each of the 1 curves"),
        (lambda: plot([boundary(), boundary().assign_attrs(plane="p\nj")]), "different parameters"),
        (lambda: plot([boundary(), response(0.2)]), "plot_space"),
        (lambda: plot(response(0.2), y="j"), "y= is for curves of bifurcations"),
        (lambda: plot_boundaries(response(0.2)), "no curve of bifurcations"),
        (lambda: plot_boundaries([]), "no curve"),
        (lambda: plot_space([]), "no curve"),
        (lambda: plot_space([response(0.2), response(0.2)]), "into the depth"),
        (lambda: plot_space([response(0.2), boundary()], x="q"), "no parameter 'q'"),
        (lambda: plot_space([response(0.2), boundary()], y="p"), "neither of omega, j"),
        (lambda: plot_space([response(0.2), boundary()], elevation="high"), "elevation must be a finite number"),
    ],
)
def test_what_cannot_be_drawn_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_responses_and_a_boundary_among_them_over_one_axis():
    figure = plot([boundary(), response(0.2)], x="omega", labels=["border", "response"])
    assert words_of(figure)[:2] == ["border", "response"]


def test_the_same_bytes(tmp_path):
    # what is drawn differs in each of these formats by the time, the ids or the fonts that it might contain
    for suffix in (".svg", ".pdf"):
        files = [tmp_path / f"{i}{suffix}" for i in range(2)]
        for file in files:
            plot([boundary("LP", 2)], file)
        assert files[0].read_bytes() == files[1].read_bytes()
    for file in files:
        plot_space([response(0.2), boundary()], file)
    assert files[0].read_bytes() == files[1].read_bytes()


# --------------------------------------------------------------------------------------------------------------- space
def test_in_space_the_boundary_runs_through_the_markers_of_the_responses():
    figure = plot_space([response(0.1), response(0.3), boundary()])
    axes = figure.axes[0]
    drawn = {gid: [line for line in axes.get_lines() if line.get_gid() == gid] for gid in ("boundary", "PD", "floor")}
    x, y, z = np.concatenate([np.array(line.get_data_3d()) for line in drawn["boundary"]], axis=1)
    assert y == pytest.approx(TOP - (x - 2.0) ** 2, abs=1e-12)
    places = np.concatenate([np.array(line.get_data_3d()) for line in drawn["PD"]], axis=1)
    assert places.shape == (3, 4)
    assert places[1] == pytest.approx(TOP - (places[0] - 2.0) ** 2)
    assert sorted(set(places[1])) == pytest.approx([0.1, 0.3])
    order = np.argsort(x)
    assert places[2] == pytest.approx(np.interp(places[0], x[order], z[order]), abs=1e-3)
    shadow = np.concatenate([np.array(line.get_data_3d()) for line in drawn["floor"]], axis=1)
    assert np.all(shadow[2] == axes.get_zlim()[0])
    assert shadow[:2] == pytest.approx(np.array([x, y]))
    assert (axes.get_xlabel(), axes.get_ylabel()) == (r"forcing frequency $\omega$", "j")


def test_in_space_without_boundaries_the_parameter_that_differs_is_found():
    axes = plot_space([response(0.1), response(0.3)]).axes[0]
    assert axes.get_ylabel() == "j"
    depths = {float(line.get_data_3d()[1][0]) for line in axes.get_lines() if line.get_gid() == "response"}
    assert depths == {0.1, 0.3}


@pytest.mark.parametrize("size", ["single-column", "double-column", (6.4, 5.0)])
def test_in_space_everything_is_on_the_page(size):
    figure = plot_space([response(0.1), response(0.3), boundary()], size=size, title="Where it doubles")
    axes = figure.axes[0]
    figure.draw_without_rendering()
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        box = axis.get_tightbbox(figure.canvas.get_renderer())
        assert box.x0 >= -1.0
        assert box.y0 >= -1.0
        assert box.x1 <= figure.bbox.width + 1.0
        assert box.y1 <= figure.legends[0].get_window_extent().y0 + 1.0


# -------------------------------------------------------------------------------------------------------------- browser
def test_every_marker_has_a_symbol_in_the_browser():
    assert {mark.marker for mark in style.KINDS.values()} | {"*"} <= set(SYMBOLS)


def test_the_browser_is_told_the_same_places():
    told = figure_data(boundary_drawing([boundary()]), "figure")
    line, *_ = told["data"]
    x, y = (np.array(line[axis], dtype=float) for axis in "xy")
    known = np.isfinite(x)
    assert y[known] == pytest.approx(TOP - (x[known] - 2.0) ** 2, abs=1e-8)
    hollow = next(trace for trace in told["data"] if "subcritical" in trace["name"])
    assert np.all(np.abs(np.array(hollow["x"]) - 2.0) <= 0.26)
    (extremum,) = (trace for trace in told["data"] if trace["name"] == "extremum")
    assert (extremum["x"], extremum["y"]) == ([2.0], [TOP])
    space = figure_data(space_drawing([response(0.1), boundary()]), "figure")
    assert space["space"]
    assert {trace["type"] for trace in space["data"]} == {"scatter3d"}


def test_report_pages_show_boundaries_in_the_plane_and_in_space(tmp_path):
    results = {"near": response(0.1), "far": response(0.3), "border": boundary(), "<b>": boundary("LP", 2)}
    page = write_report(results, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Response curves and boundaries over ω and j" in page
    assert "curve of bifurcations of the kind PD (period doubling)" in page
    assert "maximum of j" in page
    assert "<b>" not in page
    figures = [json.loads(text) for text in re.findall(r'<script type="application/json">(.*?)</script>', page, re.S)]
    # each curve once in the plane, in the order asked, and all in space
    assert [figure["axes"] for figure in figures] == [["omega", "quantity"], ["omega", "j"], ["omega", "j", "quantity"]]


@pytest.mark.parametrize("doubtful", [False, True])
def test_the_critical_multiplier_of_a_boundary_is_no_doubt(doubtful, tmp_path):
    """A page counts the multipliers that the curve calls open, not those that happen to lie on the circle."""
    dataset = boundary("PD")
    multipliers = np.tile(np.array([1.0 - 1e-8, -1.0], dtype=complex), (dataset.sizes["point"], 1))
    dataset["multipliers"] = (("point", "multiplier"), multipliers)
    dataset["multiplier_errors"] = (("point", "multiplier"), np.full(multipliers.shape, 1e-6))
    dataset["multiplier_open"] = (("point", "multiplier"), np.tile([doubtful, False], (len(multipliers), 1)))
    page = write_report({"border": dataset}, tmp_path / "page.html")
    assert ("Unsettled" in page.read_text(encoding="utf-8")) is doubtful
