"""What is written and read back is the same, bit for bit; damage and strangers are named, with the remedy."""

from __future__ import annotations

import dataclasses

import h5py
import numpy as np
import pytest
import xarray as xr

import suboctave as so
from suboctave.store import files
from suboctave.store.table import Table
from suboctave.study.results import Results


@pytest.fixture(scope="module")
def curve():
    """Bifurcations of three kinds, two contacts, an event of a user's, a warning or two."""
    system = so.library.reference_oscillator()
    event = so.Event("large", lambda orbit: orbit.amplitude() - 1.5)
    return so.frequency_response(system, (2.6, 1.3), max_step=0.2, events=[event])


@pytest.fixture(scope="module")
def saved(curve, tmp_path_factory):
    return curve.save(tmp_path_factory.mktemp("saved") / "curve.nc")


def the_same(a, b, path="branch"):
    """Equal in every field, arrays and numbers to the last bit; the systems are compared by what they do."""
    if isinstance(a, so.System):
        t = np.linspace(0.0, 3.0, 7)
        assert all(x.tobytes() == y.tobytes() for x, y in zip(a.matrices(), b.matrices(), strict=True)), path
        assert a.force_time(t, 1.1).tobytes() == b.force_time(t, 1.1).tobytes()
        assert repr(a) == repr(b)
    elif isinstance(a, so.HarmonicBalance):
        assert (a.basis, a.samples, a.values) == (b.basis, b.samples, b.values), path
        the_same(a.system, b.system, path)
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, path
        assert a.shape == b.shape, path
        assert a.tobytes() == b.tobytes(), path
    elif dataclasses.is_dataclass(a):
        assert type(a) is type(b), path
        for field in dataclasses.fields(a):
            if field.name == "curve":  # of a point, the curve that it is read back with
                continue
            the_same(getattr(a, field.name), getattr(b, field.name), f"{path}.{field.name}")
    elif isinstance(a, dict):
        assert list(a) == list(b), path
        for key in a:
            the_same(a[key], b[key], f"{path}[{key!r}]")
    elif isinstance(a, list | tuple):
        assert type(a) is type(b), path
        assert len(a) == len(b), path
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            the_same(x, y, f"{path}[{i}]")
    elif isinstance(a, float) and a != a:
        assert b != b, path
    else:
        assert a == b, (path, a, b)
        assert type(a) is type(b), (path, type(a), type(b))


def branches_equal(a, b):
    assert len(a) == len(b)
    for name in ("system", "name", "points", "closed", "ended", "observe", "options", "warnings", "audit"):
        the_same(getattr(a, name), getattr(b, name), name)
    the_same(a.bifurcations.met, b.bifurcations.met, "bifurcations")
    the_same(a.events.met, b.events.met, "events")


def test_a_branch_read_back_is_the_same(curve, saved):
    assert len(curve.bifurcations["grazing"]) >= 1
    assert len(curve.bifurcations["LP"]) >= 1
    assert len(curve.events) >= 1
    again = so.load(saved)
    branches_equal(curve, again)
    assert again.seconds == curve.seconds > 0.0
    assert repr(curve) == repr(again)
    xr.testing.assert_identical(curve.to_xarray(), again.to_xarray())


def test_what_was_read_goes_on(curve, saved):
    again = so.load(saved)
    so.continue_branch(curve.bifurcations["LP"][0], "p", (0.5, 0.6), max_step=0.2)  # kernels are compiled by now
    assert so.verify(again.orbits[3]).agrees
    one, other = (so.stability(b.orbits[7]) for b in (curve, again))
    the_same(one.multipliers, other.multipliers)
    fold = (b.bifurcations["LP"][0] for b in (curve, again))
    ways = [so.continue_branch(b, "p", (0.5, 0.6), max_step=0.2) for b in fold]
    branches_equal(*ways)


def test_saved_twice_is_the_same(curve, saved, tmp_path):
    again = so.load(saved).save(tmp_path / "again.nc")
    branches_equal(curve, so.load(again))


@pytest.mark.parametrize("parameter", ["arclength", "amplitude"])
def test_a_parameter_may_have_a_name_of_the_layout(parameter, tmp_path):
    system = so.System(1.0, 0.1, 1.0, so.CubicSpring(0, "c"), so.HarmonicLoad(0, parameter), {parameter: 0.3, "c": 1.0})
    branch = so.continue_branch(system, parameter, (0.3, 0.4), omega=1.2, max_step=0.3)
    branches_equal(branch, so.load(branch.save(tmp_path / "a.nc")))
    assert branch.to_csv(tmp_path / "b.csv", "bifurcations").read_text().startswith("kind,omega")


def test_matrices_and_several_dofs_with_a_sparse_mass(tmp_path):
    import scipy.sparse

    n = 9
    chain = scipy.sparse.diags_array([[-1.0] * (n - 1), [2.1] * n, [-1.0] * (n - 1)], offsets=[-1, 0, 1]).tocsr()
    eye = scipy.sparse.eye_array(n).tocsr()
    system = so.System(
        eye, {"c": eye.toarray()}, chain, so.ElasticStop((0, 8), 2.0, 0.5), so.HarmonicLoad(0, 0.2), {"c": 0.2}
    )
    branch = so.frequency_response(system, (0.5, 0.6), harmonics=3, max_step=0.3)
    branches_equal(branch, so.load(branch.save(tmp_path / "chain.nc")))


def test_xarray_reads_it_without_us(curve, saved):
    dataset = xr.open_dataset(saved, engine="h5netcdf")
    assert dataset["omega"].to_numpy().tobytes() == curve.omega.tobytes()
    assert (dataset["multipliers_real"].to_numpy() + 1j * dataset["multipliers_imag"].to_numpy()).tolist() == (
        curve.multipliers.tolist()
    )
    # the series that docs/results.md states, summed by hand
    i, t = 5, np.linspace(0.0, 2.0, 9)
    x = dataset["coefficients"].to_numpy()[i, :, 0]
    w = float(dataset["omega"][i]) / dataset.attrs["period"]
    waves = sum(x[2 * k - 1] * np.cos(k * w * t) + x[2 * k] * np.sin(k * w * t) for k in range(1, len(x) // 2 + 1))
    np.testing.assert_allclose(x[0] + waves, curve.orbits[i].displacement(t)[0], atol=1e-13)
    assert dataset.attrs["suboctave"] == so.__version__
    assert {"python", "platform", "written", "digest"} <= set(dataset.attrs)


def test_every_group_is_what_xarray_reads(saved, tmp_path):
    """Also without events, and where a variable has the name of a dimension that it does not lie along."""
    plain = so.frequency_response(so.library.duffing(c=0.1, F=0.3), (3.0, 2.5), harmonics=3)
    named = xr.Dataset(
        {"x": ("y", [1.0, 2.0]), "a": ("x", ["one", "", "ü"]), "b": ("x", [True, False, True]), "none": ("z", [])},
        {"of_x": ("x", [1, 2, 3]), "z": ("z", np.zeros(0))},
        {"title": "named", "count": 3, "share": 0.5},
    )
    path = tmp_path / "several.nc"
    files.write(path, {"": named, "plain": plain.to_xarray(), "plain/within": named}, {})
    for file in (saved, path):
        for name, part in files.read(file).items():
            with xr.open_dataset(file, group=name or None, engine="h5netcdf") as theirs:
                xr.testing.assert_equal(part, theirs.load())
                assert set(part.coords) == set(theirs.coords)
                for attribute, value in part.attrs.items():
                    assert theirs.attrs[attribute] == value
                for key, variable in part.variables.items():
                    assert variable.attrs == theirs.variables[key].attrs
                    assert variable.dtype.kind == theirs.variables[key].dtype.kind.replace("U", "O")


def test_an_existing_file_is_left_alone(curve, tmp_path):
    path = tmp_path / "mine.nc"
    path.write_text("mine")
    with pytest.raises(so.InputError, match="exists"):
        curve.save(path)
    assert path.read_text() == "mine"
    assert curve.save(path, overwrite=True) == path
    assert [p.name for p in tmp_path.iterdir()] == ["mine.nc"]


def test_csv_keeps_all_digits(curve, tmp_path):
    import pandas as pd

    read = pd.read_csv(curve.to_csv(tmp_path / "points.csv"))
    assert read["omega"].to_numpy().tobytes() == curve.omega.tobytes()
    assert read["amplitude"].to_numpy().tobytes() == curve.amplitude.tobytes()
    events = pd.read_csv(curve.to_csv(tmp_path / "events.csv", "bifurcations"))
    met = sorted([*curve.bifurcations.met, *curve.events.met], key=lambda b: b.arclength)
    assert events["omega"].tolist() == [b.omega for b in met]
    with pytest.raises(so.InputError, match="did you mean 'points'"):
        curve.to_csv(tmp_path / "x.csv", "point")


def test_results_of_a_study_keep_their_order_and_tables(curve, tmp_path):
    table = Table({"omega": np.array([1.0, 2.0]), "what": np.array(["a", "b"]), "mu": np.array([1 + 2j, 0j])}, "t")
    results = Results({"z": curve, "a": table}, {"title": "mine", "analyses": "z\na"}, {"z": {"seconds": 1.5}})
    again = so.load(results.save(tmp_path / "results.nc"))
    assert list(again) == ["z", "a"]
    assert again.attributes["title"] == "mine"
    assert again.details["z"]["seconds"] == 1.5
    branches_equal(again["z"], curve)
    assert again["a"]["mu"].tolist() == [1 + 2j, 0j]
    assert again["a"]["what"].tolist() == ["a", "b"]
    assert again["a"].title == "t"
    with pytest.raises(so.InputError, match="no analysis 'b'"):
        again["b"]


def refused(path):
    with pytest.raises(so.InputError) as refusal:
        so.load(path)
    return str(refusal.value)


def test_strangers_are_named(tmp_path):
    assert "there is no file" in refused(tmp_path / "nothing.nc")
    assert "folder" in refused(tmp_path)
    (tmp_path / "empty.nc").write_bytes(b"")
    assert "it is empty" in refused(tmp_path / "empty.nc")
    (tmp_path / "text.nc").write_text("omega, amplitude\n")
    assert "not a NetCDF" in refused(tmp_path / "text.nc")
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    assert "no attribute 'layout'" in refused(tmp_path / "other.nc")


def test_a_newer_layout_asks_for_an_update(saved, tmp_path):
    path = tmp_path / "new.nc"
    path.write_bytes(saved.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["layout"] = 99
        file.attrs["suboctave"] = "7.0"
    assert "7.0; update suboctave" in refused(path)


def test_a_value_changed_by_another_program_is_noticed(saved, tmp_path):
    path = tmp_path / "changed.nc"
    path.write_bytes(saved.read_bytes())
    with h5py.File(path, "r+") as file:
        file["residual"][3] *= 2.0
    assert "its content is not what was written" in refused(path)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.95])
def test_a_file_cut_short_is_named(saved, tmp_path, share):
    path = tmp_path / "short.nc"
    whole = saved.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    assert "run the study again" in refused(path)


@pytest.mark.parametrize("count", [12, pytest.param(400, marks=pytest.mark.slow)])
def test_flipped_bits_never_give_another_branch(curve, saved, tmp_path, count):
    whole = saved.read_bytes()
    rng = np.random.default_rng(11)
    path = tmp_path / "flipped.nc"
    noticed = 0
    for _ in range(count):
        damaged = bytearray(whole)
        damaged[int(rng.integers(8, len(whole)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            read = so.load(path)
        except so.InputError:
            noticed += 1
        else:  # a byte that nothing rests on
            assert read.omega.tobytes() == curve.omega.tobytes()
    assert noticed > count // 4


def test_complex_columns_of_a_table_come_back_bit_for_bit(tmp_path):
    """Negative zeros, infinities and nan among them, which arithmetic on the parts would change."""
    values = np.array([complex(-0.0, 1.0), complex(1.0, np.inf), complex(np.nan, -0.0), complex(-np.inf, np.nan)])
    saved = Results({"numbers": Table({"mu": values, "name": np.array(["a", "b", "c", "d"])})}).save(tmp_path / "t.nc")
    again = so.load(saved)["numbers"]["mu"]
    assert again.tobytes() == values.tobytes()
