"""Curves of several periods in one frame: a colour for each period, criticality told, nothing hidden by a parent."""

from __future__ import annotations

import json

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgb

from suboctave.pictures import plot_response
from suboctave.pictures.browser import figure_data
from suboctave.pictures.response import response_drawing
from suboctave.pictures.style import INK, KINDS, period_colour, period_name, tinted
from suboctave.store.layout import EventRow, curve_dataset

X = np.linspace(1.0, 2.0, 21)


def curve(nu, height=1.0, p=0.5, events=(), stable=True):
    return curve_dataset(
        X, height * X, stable=np.full(X.size, stable), parameters={"p": p}, period=nu, events=list(events)
    )


def legend_of(figure):
    (legend,) = [axes.get_legend() for axes in figure.axes if axes.get_legend()] + figure.legends
    return {text.get_text(): line for text, line in zip(legend.get_texts(), legend.get_lines(), strict=True)}


def lines(figure, *gids):
    return [line for line in figure.axes[0].get_lines() if line.get_gid() in gids]


def test_each_period_has_a_colour_of_its_own():
    colours = [period_colour(nu) for nu in (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 16)]
    assert len(set(colours)) == 12
    assert [period_name(nu) for nu in (1, 2, 12)] == ["T", "2T", "12T"]
    assert not {period_colour(nu) for nu in range(17, 65)} & set(colours)
    assert not {period_colour(nu) for nu in (11, 13, 14, 15)} & set(colours)
    assert tinted("#000000", 0.5) == "#808080"


def test_colours_of_periods_that_time_integration_meets_stay_apart():
    """CIE 1976 colour differences: 2.3 can just be seen, 25 is one that nobody overlooks."""
    rgb = np.array([to_rgb(period_colour(nu)) for nu in (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 16)])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = linear @ np.array([[0.4125, 0.2127, 0.0193], [0.3576, 0.7152, 0.1192], [0.1804, 0.0722, 0.9503]])
    f = np.cbrt(xyz / [0.9505, 1.0, 1.0888])
    lab = np.stack([116.0 * f[:, 1] - 16.0, 500.0 * (f[:, 0] - f[:, 1]), 200.0 * (f[:, 1] - f[:, 2])], axis=1)
    apart = np.linalg.norm(lab[:, None] - lab[None], axis=-1)
    assert apart[np.triu_indices(len(lab), 1)].min() > 25.0


@pytest.mark.parametrize("order", [(1, 2, 4), (4, 1, 2)])
def test_colour_and_name_follow_the_period_whatever_the_order(order):
    figure = plot_response([curve(nu, nu) for nu in order])
    named = legend_of(figure)
    assert list(named)[:3] == ["T", "2T", "4T"]
    for nu in order:
        assert to_hex(named[period_name(nu)].get_color()) == period_colour(nu).lower()
    # drawn last, hence on top: the longest period
    assert [to_hex(line.get_color()) for line in lines(figure, "stable")] == [
        period_colour(nu).lower() for nu in (1, 2, 4)
    ]


def test_one_curve_of_another_period_says_so():
    named = legend_of(plot_response(curve(3)))
    assert next(iter(named)) == "3T"
    assert "T" not in legend_of(plot_response(curve(1)))


def test_curves_of_one_period_that_belong_together_share_their_look():
    figure = plot_response([curve(1), curve(2), curve(2, 2.0)])
    assert list(legend_of(figure)) == ["T", "2T", "stable"]
    assert len({(line.get_color(), line.get_linewidth()) for line in lines(figure, "stable")}) == 2


def test_curves_of_one_period_that_differ_are_told_apart():
    figure = plot_response([curve(1), curve(2), curve(2, 2.0, p=0.7)])
    assert list(legend_of(figure)) == ["T, p = 0.5", "2T, p = 0.5", "2T, p = 0.7", "stable"]
    looks = {(to_hex(line.get_color()), line.get_linewidth()) for line in lines(figure, "stable")}
    assert len(looks) == 3
    assert (period_colour(2).lower(), lines(figure, "stable")[1].get_linewidth()) in looks
    assert list(legend_of(plot_response([curve(1), curve(2)], labels=["a", "b"])))[:2] == ["a", "b"]


def test_a_parent_shows_under_the_marker_of_its_child():
    doubling = EventRow("PD", 10, 1.5, 1.5)
    branching = EventRow("PD", 10, 1.5, 1.5)
    figure = plot_response([curve(2, events=[branching]), curve(1, events=[doubling])])
    (parent,), (child,) = (
        [m for m in lines(figure, "PD") if to_hex(m.get_markeredgecolor()) == period_colour(nu).lower()]
        for nu in (1, 2)
    )
    assert child.get_zorder() > parent.get_zorder()
    assert child.get_markersize() < 0.7 * parent.get_markersize()


def test_subcritical_is_hollow_where_it_is_known():
    senses = ["supercritical", "subcritical", None]
    events = [EventRow("PD", 3 + i, X[3 + i], X[3 + i], criticality=sense) for i, sense in enumerate(senses)]
    figure = plot_response(curve(1, events=events))
    faces = {name: to_hex(line.get_markerfacecolor()) for name, line in legend_of(figure).items() if "doubling" in name}
    filled = KINDS["PD"].colour.lower()
    assert faces == {
        "period doubling": filled,
        "period doubling, subcritical": "#ffffff",
    }
    drawn = {tuple(line.get_xdata()): to_hex(line.get_markerfacecolor()) for line in lines(figure, "PD")}
    assert drawn == {(X[3], X[5]): filled, (X[4],): "#ffffff"}
    data = json.loads(json.dumps(figure_data(response_drawing([[curve(1, events=events)]]), "a")))["data"]
    fills = {trace["name"]: trace["marker"]["color"].lower() for trace in data if trace["mode"] == "markers"}
    assert fills == faces


def test_the_page_has_the_same_colours():
    data = figure_data(response_drawing([[curve(1), curve(2)]]), "a")["data"]
    assert [trace["line"]["color"] for trace in data] == [INK, period_colour(2)]


def test_colours_stay_apart_for_colour_blind_readers():
    """T, 2T, 3T, 4T, 8T as seen without red, green or blue cones (Machado, Oliveira & Fernandes 2009, severity 1)."""
    blind = {
        "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    }
    rgb = np.array([to_rgb(period_colour(nu)) for nu in (1, 2, 3, 4, 8)])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    for matrix in blind.values():
        seen = np.clip(linear @ np.array(matrix).T, 0.0, 1.0)
        seen = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
        apart = np.linalg.norm(seen[:, None] - seen[None, :], axis=2)[np.triu_indices(5, 1)]
        assert apart.min() > 0.2
