"""Quantities, units and sizes of figures; branches and their datasets give the same picture."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray

import suboctave as so
from suboctave.errors import InputError
from suboctave.pictures import plot
from suboctave.pictures.style import SIZES


@pytest.fixture(scope="module")
def curve():
    return so.frequency_response(so.library.duffing(c=0.1, F=0.3), (3.0, 0.5), max_step=0.15)


def lines(figure, gid):
    return [line for line in figure.axes[0].get_lines() if line.get_gid() == gid]


def extent(figure):
    return np.concatenate([line.get_xydata() for line in figure.axes[0].get_lines() if line.get_gid() != "LP"])


@pytest.mark.parametrize(
    ("options", "read", "label"),
    [
        ({"quantity": "velocity"}, lambda b: b.velocity(), "velocity"),
        ({"quantity": "rms", "scale": 1e3, "unit": "mm"}, lambda b: 1e3 * b.rms(), "RMS of $x$ (mm)"),
        ({"harmonic": 3}, lambda b: np.abs(b.harmonic(3)), "harmonic 3 of $x$"),
        ({"quantity": "phase"}, lambda b: np.degrees(b.phase()), "phase of harmonic 1 of $x$ (°)"),
        ({"quantity": "peak_force", "element": 0}, lambda b: b.peak_force(0), "peak force, element 0"),
        ({"quantity": "transmissibility", "ylabel": "T"}, lambda b: b.transmissibility(), "T"),
    ],
)
def test_what_is_drawn_is_the_reading(curve, options, read, label):
    figure = plot(curve, **options)
    drawn = extent(figure)
    for point, value in zip(curve.omega, read(curve), strict=True):
        assert np.any(np.all(np.isclose(drawn, [point, value], rtol=1e-9, atol=1e-12), axis=1))
    assert label in figure.axes[0].get_ylabel()
    low, high = figure.axes[0].get_ylim()
    assert low <= drawn[:, 1].min()
    assert high >= drawn[:, 1].max()


def test_frequencies_in_hertz_and_relative(curve):
    top = curve.omega.max()
    hertz = plot(curve, frequency="Hz")
    assert extent(hertz)[:, 0].max() == pytest.approx(top / (2.0 * math.pi), rel=1e-14)
    assert hertz.axes[0].get_xlabel() == "forcing frequency (Hz)"
    (marks,) = lines(hertz, "LP")
    expected = [b.omega / (2.0 * math.pi) for b in curve.bifurcations["LP"]]
    np.testing.assert_allclose(marks.get_xdata(), expected, rtol=1e-14)
    assert plot(curve, frequency="rad/s").axes[0].get_xlabel().endswith("(rad/s)")
    relative = plot(curve, omega_reference=2.0)
    assert extent(relative)[:, 0].max() == pytest.approx(top / 2.0, rel=1e-14)
    assert "frequency ratio" in relative.axes[0].get_xlabel()


def test_branch_dataset_and_file_give_the_same_picture(curve, tmp_path):
    plot(curve, tmp_path / "live.svg", quantity="velocity")
    dataset = curve.to_xarray(readings=["velocity"])
    plot(dataset, tmp_path / "dataset.svg", quantity="velocity")
    curve.save(tmp_path / "curve.nc")
    plot(so.load(tmp_path / "curve.nc"), tmp_path / "file.svg", quantity="velocity")
    pictures = [(tmp_path / f"{name}.svg").read_bytes() for name in ("live", "dataset", "file")]
    assert pictures[0] == pictures[1] == pictures[2]
    with xarray.open_dataset(tmp_path / "curve.nc", engine="h5netcdf") as stored:
        plot(stored, tmp_path / "stored.svg")
    plot(curve, tmp_path / "amplitude.svg")
    assert (tmp_path / "stored.svg").read_bytes() == (tmp_path / "amplitude.svg").read_bytes()


def test_the_results_of_a_study_are_drawn_as_its_curves(curve, tmp_path):
    plot(so.Results({"a": curve, "b": curve}), tmp_path / "results.svg")
    plot([curve, curve], tmp_path / "curves.svg")
    assert (tmp_path / "results.svg").read_bytes() == (tmp_path / "curves.svg").read_bytes()


@pytest.mark.parametrize("size", [*SIZES, (5.0, 3.0)])
def test_sizes_are_what_was_asked_for(curve, size):
    figure = plot(curve, size=size)
    assert tuple(figure.get_size_inches()) == SIZES.get(size, size)
    letters = [t.get_fontsize() for t in (*figure.axes[0].get_xticklabels(), figure.axes[0].xaxis.label)]
    assert min(letters) >= 7.0
    assert max(letters) <= (8.0 if isinstance(size, str) else 11.0)


def test_letters_travel_with_the_file(curve, tmp_path):
    plot(curve, tmp_path / "a.pdf", size="single-column")
    plot(curve, tmp_path / "a.svg", size="single-column")
    pdf = (tmp_path / "a.pdf").read_bytes()
    assert b"/FontFile2" in pdf  # TrueType, embedded
    assert b"/Type3" not in pdf
    assert "<text" not in (tmp_path / "a.svg").read_text()  # outlines


def test_curves_differ_in_colour_width_dashes_and_the_edge_of_their_markers(duffing):
    figure = plot([duffing(force=f) for f in (0.5, 0.4, 0.3)])
    stable, unstable, marks = (lines(figure, gid) for gid in ("stable", "unstable", "LP"))
    assert len({line.get_color() for line in stable}) == 3
    assert len({line.get_linewidth() for line in stable}) == 3
    assert {line.get_linestyle() for line in stable} == {"-"}
    assert len({str(line._unscaled_dash_pattern) for line in unstable}) == len(unstable) == 3
    assert [mark.get_markeredgecolor() for mark in marks] == [line.get_color() for line in unstable]


def test_names_with_dollars_are_no_mathematics(duffing, tmp_path):
    figure = plot([duffing()] * 2, tmp_path / "a.svg", labels=["$x", "cost $5 and $6"], title="$\\broken")
    assert (tmp_path / "a.svg").exists()
    assert figure.axes[0].get_title() == "\\$\\broken"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"quantity": "velocty"}, "did you mean 'velocity'"),
        ({"quantity": "rms", "harmonic": 2}, "says nothing about"),
        ({"quantity": "impacts"}, "give element="),
        ({"quantity": "impacts", "element": 0, "dof": 1}, "leave dof= out"),
        ({"quantity": "impacts", "element": 0}, "has no gap"),
        ({"frequency": "hz"}, "did you mean 'Hz'"),
        ({"frequency": "Hz", "omega_reference": 1.0}, "choose one"),
        ({"scale": -1.0}, "positive number"),
        ({"scale": math.inf}, "finite number"),
        ({"size": "singlecolumn"}, "did you mean 'single-column'"),
        ({"size": (0.0, 3.0)}, "width and height"),
        ({"size": 3.0}, "two finite numbers"),
        ({"quantity": "velocity", "dof": 3}, "out of range"),
        ({"x": "omga"}, "did you mean 'omega'"),
    ],
)
def test_wrong_options_are_refused(curve, options, message):
    with pytest.raises(InputError, match=message):
        plot(curve, **options)


def test_a_dataset_without_the_reading_says_how_to_get_it(curve):
    with pytest.raises(InputError, match=r"to_xarray\(readings=\['velocity'\]\)"):
        plot(curve.to_xarray(), quantity="velocity")
    with pytest.raises(InputError, match="not int"):
        plot(3)
