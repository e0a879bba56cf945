"""Isolas in files: read back they are the same, and the closed branches that follow from them are the same numbers."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import suboctave as so
from suboctave.study.results import Results


def duffing():
    """A Duffing oscillator whose 1/3 sub-harmonic motions are isolated from the response."""
    return so.System(
        mass=1.0,
        damping=0.02,
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient="alpha")],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"F": 5.0, "alpha": 0.05},
    )


@pytest.fixture(scope="module")
def found():
    isolas = so.find_isolas(
        duffing(),
        (2.5, 9.0),
        "F",
        (0.1, 5.0),
        harmonics=3,
        search=(3,),
        values=[5.0],
        seeds=so.Seeds(4, 2, 1),
        depth=0,
        levels=(),
        stability=so.Hill(),
        max_step=0.2,
    )
    isolas[0].at(4.0)
    return isolas


@pytest.fixture(scope="module")
def read(found, tmp_path_factory):
    return so.load(found.save(tmp_path_factory.mktemp("isolas") / "isolas.nc"))


def test_they_come_back(found, read):
    assert repr(read) == repr(found)
    assert (read.parameter, read.bounds, read.omega) == (found.parameter, found.bounds, found.omega)
    (one,), (other,) = found, read
    assert (other.range, other.reasons, other.nu) == (one.range, one.reasons, one.nu)
    assert float(other.born) == float(one.born)
    assert other.merges is None
    assert list(other.known) == list(one.known)
    xr.testing.assert_identical(other.limit_points.to_xarray(), one.limit_points.to_xarray())
    for before, after in zip(found.limit_points, read.limit_points, strict=True):
        xr.testing.assert_identical(after.to_xarray(), before.to_xarray())
    xr.testing.assert_identical(other.at(4.0).to_xarray(), one.at(4.0).to_xarray())
    assert other.options == one.options


def test_work_goes_on_from_them(found, read):
    (one,), (other,) = found, read
    for place in (3.0, 0.5 * sum(one.range)):
        before, after = one.at(place), other.at(place)
        assert after.closed
        assert np.array_equal(after.omega, before.omega)
        assert np.array_equal(after.multipliers, before.multipliers)


def test_its_birth_is_tracked_from_a_file(read):
    """In units of x sqrt(alpha) there is one load only: alpha F^2 is the same wherever the isola is born."""
    births = so.track(read[0].born, "alpha", (0.03, 0.06))
    assert set(births.isola) == {"isola_centre"}
    invariant = births.parameter("alpha") * births.parameter("F") ** 2
    assert invariant == pytest.approx(invariant[0], rel=1e-8)
    assert births.omega == pytest.approx(births.omega[0], rel=1e-8)


def test_pictures_of_what_was_read(read, tmp_path):
    for figure in (read.plot(tmp_path / "plane.png"), read[0].plot(tmp_path / "space.png", values=2)):
        assert any(item.get_gid() == "isola" for item in figure.axes[0].get_children())
    assert {path.name for path in tmp_path.iterdir()} == {"plane.png", "space.png"}
    wrong = {0: "at least 1", "3": "a whole number", (9.0,): "a number of values", (): "a number of values"}
    for values, message in wrong.items():
        with pytest.raises(so.InputError, match=f"values must be {message}"):
            read[0].plot(values=values)


def test_among_the_results_of_a_study(found, tmp_path):
    path = Results({"isolas": found, "closed": found[0].at(4.0)}).save(tmp_path / "results.nc")
    results = so.load(path)
    assert list(results.isolas) == ["isolas"]
    assert repr(results["isolas"]) == repr(found)
    assert "1 isola over F, 1 curves" in repr(results)
    with pytest.raises(so.InputError, match="exists"):
        found.save(path)


def test_readers_without_the_package(found, tmp_path):
    """docs/results.md: the edges are the limit points of the closed branches."""
    path = found.save(tmp_path / "isolas.nc")
    head = xr.open_dataset(path, engine="h5netcdf")
    assert head.attrs["isolas"] == "F"
    assert float(head["born"][0]) == float(found[0].born)
    branch = found[0].at(4.0)
    folds = sorted(b.omega for b in branch.bifurcations["LP"])
    edges = [np.interp(4.0, head["edge_value"], head[name]) for name in ("edge_low", "edge_high")]
    assert edges == pytest.approx([folds[0], folds[-1]], rel=2e-3)
    place = int(np.flatnonzero(head["closed_at"].values == 4.0)[0])
    closed = xr.open_dataset(path, engine="h5netcdf", group=f"closed_{place}")
    assert np.array_equal(closed["omega"], branch.omega)


def test_a_part_that_is_missing(found, tmp_path):
    import h5py

    path = found.save(tmp_path / "isolas.nc")
    with h5py.File(path, "a") as file:
        del file["closed_0"]
    with pytest.raises(so.InputError, match="closed_0 of the isolas is missing"):
        so.load(path)


def test_none_found_is_a_result_too(tmp_path):
    isolas = so.find_isolas(duffing(), (1.5, 2.0), "F", (0.01, 0.02), harmonics=1, values=2, depth=0, search=())
    assert not isolas
    again = so.load(isolas.save(tmp_path / "none.nc"))
    assert repr(again) == repr(isolas)
    assert again.to_xarray()["isolas"].sizes["edge"] == 0


def test_tables(found, tmp_path):
    import pandas as pd

    frame = pd.read_csv(found.to_csv(tmp_path / "isolas.csv"))
    assert frame["born F"][0] == float(found[0].born)
    assert frame["period"][0] == "3T"
    points = pd.read_csv(found.to_csv(tmp_path / "points.csv", "points"))
    assert len(points) == sum(len(curve) for curve in found.limit_points)
    events = pd.read_csv(found.to_csv(tmp_path / "events.csv", "bifurcations"))
    assert float(found[0].born) in list(events["F"])
    with pytest.raises(so.InputError, match="isolas, points or bifurcations"):
        found.to_csv(tmp_path / "x.csv", "point")
