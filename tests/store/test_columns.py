"""Parameters that bear the name of a column are in tables and files all the same, and so is the column."""

from __future__ import annotations

from io import StringIO

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from rich.console import Console
from slow import slow

import suboctave as so
from suboctave.store.layout import led_by, parameter_column
from suboctave.study.screen import print_events


def along(name):
    """x'' + 0.1 x' + x = NAME cos(omega t) at omega = 1: the amplitude is ten times the parameter."""
    system = so.System(1.0, 0.1, 1.0, [], [so.HarmonicLoad(0, name)], parameters={name: 0.1})
    start = so.frequency_response(system, (1.0, 1.01), harmonics=1).orbits[0]
    return so.continue_branch(start, name, (0.05, 0.3), max_step=0.5)


@pytest.mark.parametrize(
    "name",
    ["amplitude", "multiplier_real", "coefficients", *slow("stable", "arclength", "harmonics", "residual", "rms", "F")],
)
def test_free_parameters_are_in_tables_datasets_and_files(name, tmp_path):
    branch = along(name)
    branch.to_csv(tmp_path / "points.csv")
    branch.save(tmp_path / "branch.nc")
    with xr.open_dataset(tmp_path / "branch.nc", engine="h5netcdf") as stored:
        tables = [branch.to_dataframe(readings=["rms"]), branch.to_xarray(["rms"]), stored.load()]
    tables.append(pd.read_csv(tmp_path / "points.csv"))
    for table in tables:
        column = f"parameter.{name}" if f"parameter.{name}" in table else name
        np.testing.assert_allclose(table[column], branch.parameter(name), rtol=1e-15)
        np.testing.assert_allclose(table["amplitude"], 10.0 * branch.parameter(name), rtol=1e-9)
    columns = list(tables[0].columns)
    assert columns[:2] == ["omega", name if name in ("coefficients", "F") else f"parameter.{name}"]
    assert len(set(columns)) == len(columns)
    again = so.load(tmp_path / "branch.nc")
    assert again.parameter(name).tolist() == branch.parameter(name).tolist()
    assert again.to_dataframe().equals(branch.to_dataframe())


@pytest.mark.parametrize("name", ["amplitude", "remark", *slow("kind", "criticality", "residual", "F")])
def test_tables_of_bifurcations_have_every_parameter(name):
    system = so.System(1.0, 0.1, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, name)], parameters={name: 0.3})
    curve = so.frequency_response(system, (1.5, 1.2), harmonics=3)
    frame = curve.bifurcations_frame()
    assert frame["kind"].tolist() == ["LP"]
    assert frame["amplitude"].tolist() == [b.amplitude for b in curve.bifurcations]
    column = name if name == "F" else f"parameter.{name}"
    assert frame[column].tolist() == [0.3]
    folds = so.track(curve.bifurcations["LP"][0], name, (0.29, 0.31))
    points = folds.to_dataframe()
    column = f"parameter.{name}" if name in ("amplitude", "residual") else name
    assert points[column].tolist() == folds.parameter(name).tolist()
    assert points["amplitude"].tolist() == folds.amplitude.tolist()
    assert np.ptp(folds.parameter(name)) == pytest.approx(0.02)


def test_columns_that_say_which_curve_do_not_hide_a_parameter():
    frame = led_by(pd.DataFrame({"omega": [1.0], "nu": [0.3]}), {"branch": 2, "nu": 1})
    assert frame.to_dict("records") == [{"branch": 2, "nu": 1, "omega": 1.0, "parameter.nu": 0.3}]
    assert parameter_column("nu", ()) == "nu"


def test_other_tables_have_both_columns():
    system = so.System(
        1.0, 0.2, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, "period")], parameters={"period": 0.3}
    )
    diagram = so.brute_force_diagram(system, 1.2, parameter="period", bounds=(0.1, 0.3), values=3, transient=50)
    frame = diagram.to_dataframe()
    assert sorted(set(frame["parameter.period"])) == pytest.approx([0.1, 0.2, 0.3])
    assert set(frame["period"]) == {1}
    verified = so.verify(along("distance"), every=5).to_dataframe()
    assert verified["distance"].max() < 1e-6
    assert verified["parameter.distance"].min() == pytest.approx(0.05)


def test_the_terminal_heads_the_column_by_the_parameter():
    out = Console(width=120, record=True, quiet=False, file=StringIO())
    print_events(out, [["LP", "1", "2", "3", "4", "0.5"]], "residual")
    assert "parameter.residual" in out.export_text()
