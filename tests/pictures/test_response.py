"""Figures: what is drawn, what the legend says, what may not overlap, and that nothing global is touched."""

import subprocess
import sys

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.pictures import plot_panels, plot_response, save_figure
from suboctave.pictures.style import KINDS
from suboctave.store.layout import EventRow, curve_dataset


def legend_of(figure):
    legends = [axes.get_legend() for axes in figure.axes if axes.get_legend()] + figure.legends
    assert len(legends) == 1
    return legends[0]


def texts(figure):
    return [text.get_text() for text in legend_of(figure).get_texts()]


def test_markers_lie_on_the_located_bifurcations(duffing):
    dataset = duffing()
    figure = plot_response(dataset)
    (marks,) = [line for line in figure.axes[0].get_lines() if line.get_gid() == "LP"]
    np.testing.assert_array_equal(marks.get_xdata(), dataset["event_omega"])
    np.testing.assert_array_equal(marks.get_ydata(), dataset["event_amplitude"])
    assert marks.get_marker() == "o"
    dashed = [line for line in figure.axes[0].get_lines() if line.get_gid() == "unstable"]
    assert len(dashed) == 1
    assert dashed[0].get_xdata()[0] == dataset["event_omega"][0]
    assert dashed[0].is_dashed()


def test_the_legend_names_only_what_occurs(duffing):
    assert texts(plot_response(duffing())) == ["stable", "unstable", "limit point"]
    assert texts(plot_response(duffing(force=0.02))) == ["stable"]


def test_each_kind_has_its_own_marker_and_an_unknown_one_its_own_name():
    kinds = [*KINDS, "mine"]
    x = np.linspace(0, 1, len(kinds) + 3)
    rows = [EventRow(kind, i, x[i], x[i]) for i, kind in enumerate(kinds)]
    figure = plot_response(curve_dataset(x, x, stable=x < 2, events=rows))
    drawn = {line.get_gid(): line.get_marker() for line in figure.axes[0].get_lines() if line.get_gid() in kinds}
    assert drawn.keys() == set(kinds)
    assert len(set(drawn.values())) == len(kinds)
    assert drawn | {"LP": "o", "PD": "v", "NS": "s", "BP": "D", "grazing": "x", "mine": "*"} == drawn
    names = {"limit point", "period doubling", "Neimark–Sacker", "branch point", "grazing contact", "mine"}
    assert names < set(texts(figure))


def test_several_curves_are_told_apart_by_what_differs(duffing):
    figure = plot_response([duffing(force=0.4), duffing(force=0.2)])
    assert texts(figure)[:2] == ["F = 0.4", "F = 0.2"]
    colours = {line.get_color() for line in figure.axes[0].get_lines() if line.get_gid() == "stable"}
    assert len(colours) == 2
    assert texts(plot_response([duffing()] * 2, labels=["a", "b"]))[:2] == ["a", "b"]


@pytest.mark.parametrize("forces", [(0.4,), (0.4, 0.2), (0.9, 0.05, 0.3)])
def test_the_legend_covers_no_curve(duffing, forces):
    figure = plot_response([duffing(force=force) for force in forces])
    figure.canvas.draw()
    box = legend_of(figure).get_window_extent()
    for axes in figure.axes:
        for line in axes.get_lines():
            x, y = axes.transData.transform(line.get_xydata()).T
            assert not np.any((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1))


def test_a_full_frame_puts_the_legend_outside():
    x = np.linspace(0, 40, 2000)
    dataset = curve_dataset(x, 1 + np.sin(8 * x), stable=x < 50)
    figure = plot_response(dataset)
    figure.canvas.draw()
    assert figure.legends
    assert figure.legends[0].get_window_extent().y0 > figure.axes[0].get_window_extent().y1


def test_labels_and_ticks_stay_inside_and_apart(duffing, tmp_path):
    figure = plot_panels([duffing(), duffing(force=0.2)], tmp_path / "two.svg", titles=["one", "two"])
    assert (tmp_path / "two.svg").exists()
    figure.canvas.draw()
    whole = figure.bbox
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    for box in boxes:
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= whole.x1
        assert box.y1 <= whole.y1
    assert boxes[0].x1 <= boxes[1].x0
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim()


def test_the_axis_is_the_free_parameter():
    p = np.linspace(0.0, 1.0, 5)
    along_p = curve_dataset(np.full(5, 2.0), p, parameters={"p": p}, free="p", observed_dof=2, dofs=3)
    axes = plot_response(along_p).axes[0]
    assert axes.get_xlabel() == "p"
    assert "x_{2}" in axes.get_ylabel()
    along_omega = curve_dataset(p + 1, p, parameters={"p": 0.5})
    with pytest.raises(InputError, match="choose one with x="):
        plot_response([along_p, along_omega])
    assert plot_response([along_p, along_omega], x="p").axes[0].get_xlabel() == "p"


@pytest.mark.parametrize(
    ("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF"), ("PNG", b"\x89PNG")]
)
def test_the_suffix_says_the_form(duffing, tmp_path, suffix, magic):
    path = tmp_path / "new" / f"curve.{suffix}"
    plot_response(duffing(), path)
    first = path.read_bytes()
    assert first.startswith(magic)
    save_figure(plot_response(duffing()), path)
    assert path.read_bytes() == first  # no time stamp in it
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_an_unknown_suffix_and_a_wrong_object_are_refused(duffing, tmp_path):
    with pytest.raises(InputError, match=r"did you mean '\.png'"):
        plot_response(duffing(), tmp_path / "curve.pgn")
    with pytest.raises(InputError, match="draws branches, diagrams, isolas and their datasets, not object"):
        plot_response(object())
    with pytest.raises(InputError, match="no curve"):
        plot_response([])
    with pytest.raises(InputError, match="not laid out by suboctave"):
        plot_response(duffing().drop_attrs())
    newer = duffing().assign_attrs(layout=999)
    with pytest.raises(InputError, match="newer than"):
        plot_response(newer)


def test_what_draws_itself_is_named():
    branch = so.frequency_response(so.library.duffing(c=0.2, alpha=0.1, F=0.1), (0.5, 0.52), harmonics=3)
    with pytest.raises(InputError, match=r"not BranchVerification, which is drawn by its own plot\(\)"):
        so.plot(so.verify(branch, points=1, bifurcations=False))


def test_no_global_plotting_state():
    code = """
import sys, matplotlib
before = matplotlib.rcParams.copy()
from suboctave.pictures import plot_response
from suboctave.store.layout import curve_dataset
plot_response(curve_dataset([1.0, 2.0], [1.0, 2.0]), sys.argv[1])
assert "matplotlib.pyplot" not in sys.modules
after = matplotlib.rcParams.copy()
assert all(dict.__getitem__(after, key) == value for key, value in dict.items(before))
"""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-c", code, f"{folder}/a.svg"], check=True, timeout=120)
