"""What of a figure is shown and where: logarithmic axes, decibels, a user's own axes, several DOFs, named curves."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot
from overlaps import labels_on_curves, overlapping_texts

import suboctave as so
from suboctave.errors import InputError
from suboctave.pictures import plot
from suboctave.store.layout import EventRow, curve_dataset


def lines(figure, *gids):
    return [line for axes in figure.axes for line in axes.get_lines() if line.get_gid() in (gids or ("stable",))]


def legend_of(figure):
    legends = [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))]
    return [text.get_text() for legend in legends for text in legend.get_texts()]


def test_decibels_are_twenty_logarithms_of_the_value_in_its_unit(duffing):
    curve = duffing()
    (plain_marks,) = lines(plot(curve, scale=1e3, unit="mm"), "LP")
    figure = plot(curve, scale=1e3, unit="mm", yscale="dB")
    (marks,) = lines(figure, "LP")
    np.testing.assert_allclose(marks.get_ydata(), 20.0 * np.log10(plain_marks.get_ydata()), rtol=1e-12)
    assert figure.axes[0].get_ylabel().endswith("(dB re 1 mm)")
    assert figure.axes[0].get_yscale() == "linear"


def test_a_power_law_is_a_straight_line_on_logarithmic_axes():
    x = np.geomspace(0.5, 50.0, 9)
    figure = plot(curve_dataset(x, x**-2.0, stable=np.ones(9, dtype=bool)), xscale="log", yscale="log")
    across, upwards = np.log10(lines(figure)[0].get_data())
    np.testing.assert_allclose(upwards, -2.0 * across, atol=1e-9)  # between the points as well
    low, high = figure.axes[0].get_ylim()
    assert 0.0 < low < 50.0**-2
    assert high > 4.0


def test_what_a_logarithmic_axis_cannot_show_is_counted():
    x = np.arange(1.0, 7.0)
    curve = curve_dataset(x, np.array([0.0, 0.0, 1.0, 2.0, 3.0, 4.0]), stable=np.ones(6, dtype=bool))
    for scale in ("log", "dB"):
        figure = plot(curve, yscale=scale)
        assert figure.axes[0].get_ylabel().endswith("2 values at or below zero left out")
        assert np.isfinite(figure.axes[0].get_ylim()).all()
    nothing = curve_dataset(x, np.zeros(6), stable=np.ones(6, dtype=bool))
    with pytest.raises(InputError, match="shows positive values, and there are none"):
        plot(nothing, yscale="log")


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"yscale": "db"}, InputError, "did you mean 'dB'"),
        ({"xscale": "dB"}, InputError, "decibels are for yscale"),
        ({"xscale": "log", "xlim": (0.0, 2.0)}, InputError, "begins above zero"),
        ({"ylim": (2.0, 1.0)}, InputError, "smaller one first"),
        ({"ax": 3}, InputError, "axes of Matplotlib"),
        ({"yscal": "log"}, TypeError, "did you mean 'yscale'"),
    ],
)
def test_frames_that_cannot_be_are_refused(duffing, options, error, message):
    with pytest.raises(error, match=message):
        plot(duffing(), **options)


def test_limits_leave_out_markers_and_their_names(duffing):
    curve = duffing()
    inside = float(curve["event_omega"].to_numpy().max())
    figure = plot(curve, xlim=(inside - 0.02, 2.0))
    assert [list(line.get_xdata()) for line in lines(figure, "LP")] == [[inside]]
    assert "limit point" not in legend_of(plot(curve, xlim=(inside + 0.05, 2.0)))
    top = figure.axes[0].get_ylim()[1]
    assert top < 1.1 * float(curve["amplitude"].to_numpy().max())


def test_into_axes_of_ones_own(duffing):
    weak, strong = duffing(force=0.1), duffing(force=0.4)
    figure, (left, right) = pyplot.subplots(1, 2)
    left.set_ylabel("mine")
    assert plot(weak, ax=left) is figure
    assert len(left.get_lines()) == len(plot(weak).axes[0].get_lines())
    assert (left.get_ylabel(), left.get_xlabel()) == ("mine", plot(weak).axes[0].get_xlabel())
    plot({"weak": weak}, ax=right)
    narrow = right.get_ylim()[1]
    plot({"strong": strong}, ax=right)
    assert right.get_ylim()[1] > narrow
    assert {"weak", "strong"} < {text.get_text() for text in right.get_legend().get_texts()}
    with pytest.raises(InputError, match="ax has 2 axes, the figure 1"):
        plot(weak, ax=[left, right])
    with pytest.raises(InputError, match='projection="3d"'):
        so.plot_space([weak, strong], y="F", ax=left)
    pyplot.close(figure)


def test_names_of_a_dictionary_are_those_of_the_legend(duffing):
    weak, strong = duffing(force=0.1), duffing(force=0.4)
    assert legend_of(plot({"weak": weak, "strong": strong}))[:2] == ["weak", "strong"]
    assert legend_of(plot({"both": [weak, strong]}))[:2] == ["both, F = 0.1", "both, F = 0.4"]
    assert legend_of(plot({"alone": weak}))[0] == "alone"
    with pytest.raises(InputError, match="leave labels= out"):
        plot({"weak": weak}, labels=["strong"])


def test_several_degrees_of_freedom_stand_in_one_frame():
    branch = so.frequency_response(so.library.two_mass_unilateral(), (1.4, 1.6), harmonics=3)
    figure = branch.plot(dof=[0, 1])
    for dof, line in enumerate(lines(figure)):
        away = np.abs(branch.reading(f"amplitude_dof{dof}")[:, None] - line.get_ydata()).min(axis=1)
        assert away.max() < 1e-12  # the line goes through every point
    assert legend_of(figure)[:2] == ["$x_{0}$", "$x_{1}$"]
    with pytest.raises(InputError, match="out of range"):
        branch.plot(dof=[0, 7])
    with pytest.raises(InputError, match="leave it out"):
        branch.plot(dof=[])


def test_events_upon_each_other_are_counted():
    x = np.linspace(1.0, 2.0, 11)
    events = [EventRow("LP", 3, 1.31 + 1e-4 * k, 1.31, 1e-12, 1.0 + 0j) for k in range(5)]
    figure = plot(curve_dataset(x, x, stable=np.ones(11, dtype=bool), events=events))
    assert [text.get_text() for text in figure.axes[0].texts] == ["5 events at 1.31"]
    assert overlapping_texts(figure) == labels_on_curves(figure) == []
