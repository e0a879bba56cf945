"""Results of time integration are saved and read back, bit for bit; so are the pictures drawn from them."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
import xarray as xr

import suboctave as so
from suboctave.store.files import pack, unpack
from suboctave.store.registry import from_datasets, to_datasets
from suboctave.store.table import Table
from suboctave.study.results import Results

SYSTEM = so.library.reference_oscillator(p=0.55, j=0.5)


def the_same(a, b, path="result"):
    """Equal in every field, arrays and numbers to the last bit; systems and branches by what they say."""
    if isinstance(a, so.System):
        assert repr(a) == repr(b), path
        assert (
            a.force_time(np.linspace(0.0, 3.0, 7), 1.1).tobytes() == b.force_time(np.linspace(0, 3.0, 7), 1.1).tobytes()
        )
    elif isinstance(a, so.Branch):
        xr.testing.assert_identical(a.to_xarray(), b.to_xarray())
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), path
    elif dataclasses.is_dataclass(a):
        assert type(a) is type(b), path
        for field in dataclasses.fields(a):
            the_same(getattr(a, field.name), getattr(b, field.name), f"{path}.{field.name}")
    elif isinstance(a, dict):
        assert list(a) == list(b), path
        for key in a:
            the_same(a[key], b[key], f"{path}[{key!r}]")
    elif isinstance(a, list | tuple):
        assert (type(a), len(a)) == (type(b), len(b)), path
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            the_same(x, y, f"{path}[{i}]")
    elif isinstance(a, float) and a != a:
        assert b != b, path
    else:
        assert a == b, (path, a, b)
        assert isinstance(b, type(a)) or isinstance(a, type(b)), (path, type(a), type(b))


def _branch():
    return so.frequency_response(SYSTEM, (2.2, 2.6), max_step=0.2, harmonics=9)


def _wide():
    """Two degrees of freedom with names."""
    return so.System(
        np.eye(2), 0.05 * np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]]), so.ElasticStop((0, 1), 3.0, 0.2),
        so.HarmonicLoad(0, "F"), {"F": 0.3}, dof_names=("left", "right"),
    )  # fmt: skip


@cache
def _basins():
    return so.basins(SYSTEM, omega=2.25, box=((-1.0, 1.0), (-1.0, 1.0)), grid=(9, 8), periods=200)


MAKERS = {
    "trajectory": lambda: so.integrate(SYSTEM, start=[0.1, 0.0], omega=2.25, periods=3, steps_per_period=20),
    "trajectory, two": lambda: so.integrate(_wide(), omega=1.1, periods=2, steps_per_period=20, parameters={"F": 0.4}),
    "sections": lambda: so.poincare_sections(
        SYSTEM, start=[[0.1, 0.0], [0.5, 0.4], [3.0, 3.0]], omega=2.25, transient=20, periods=8,
        parameters={"p": [0.5, 0.55, 0.6]},
    ),
    "sections, two": lambda: so.poincare_sections(_wide(), omega=1.1, transient=5, periods=6),
    "brute force": lambda: so.brute_force_diagram(
        SYSTEM, (2.2, 2.4), values=4, direction=("up", "anew"), start=[[0.0, 0.0], [0.5, 0.4]], transient=30, periods=9
    ),
    "brute force over p": lambda: so.brute_force_diagram(
        SYSTEM, 2.25, parameter="p", bounds=(0.5, 0.6), values=3, direction="down", transient=20, periods=6
    ),
    "stepped sine": lambda: so.stepped_sine(
        SYSTEM, (2.2, 2.4), values=5, direction=("up", "down"), transient=10, periods=8, tap=(2.3, 0, 0.9), noise=0.01
    ),
    "exponents": lambda: so.lyapunov_exponents(
        SYSTEM, omega=2.25, periods=40, transient=10, trajectories=3, parameters={"p": 0.6}
    ),
    "two trajectories": lambda: so.lyapunov_exponents(
        so.library.reference_oscillator(p=1.6, Kc=4.2, j=0.0), omega=2.6,
        method=so.TwoTrajectories(steps_per_period=(400, 500), offset=(1e-12, 1e-11), periods=120),
    ),
    "map": lambda: so.lyapunov_map(
        SYSTEM, (2.2, 2.4), parameter="p", bounds=(0.5, 0.6), grid=(3, 2), transient=10, periods=40,
        parameters={"j": 0.4},
    ),
    "basins": lambda: _basins(),
    "verification": lambda: so.verify(_branch(), points=2),
}  # fmt: skip


#: systems of two degrees of freedom are in sections, too
LATER = ("trajectory, two",)


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=pytest.mark.slow if name in LATER else ()) for name in MAKERS],
)
def result(request):
    return MAKERS[request.param]()


def test_saved_and_loaded_it_is_the_same(result, tmp_path):
    again = so.load(result.save(tmp_path / "result.nc"))
    the_same(result, again)
    assert repr(result) == repr(again)
    xr.testing.assert_identical(result.to_xarray(), again.to_xarray())
    assert result.to_dataframe().equals(again.to_dataframe())
    assert len(result.to_dataframe())
    with pytest.raises(so.InputError, match="exists"):
        result.save(tmp_path / "result.nc")
    the_same(again, so.load(again.save(tmp_path / "again.nc")))


def test_the_picture_of_what_was_loaded_is_the_same(result, tmp_path):
    again = so.load(result.save(tmp_path / "result.nc"))
    first, second = (one.plot() for one in (result, again))
    for figure in (first, second):
        figure.canvas.draw()
    one, other = (np.asarray(figure.canvas.buffer_rgba()) for figure in (first, second))
    assert (one == other).all()


def test_tables_and_files_of_studies_hold_it(result, tmp_path):
    table = result.to_table()
    assert len(table) == len(result.to_dataframe())
    place = Results({"found": table, "plain": Table({"a": np.arange(3)})}, {"title": "t"}).save(tmp_path / "results.nc")
    again = so.load(place)
    assert set(again) == {"found", "plain"}
    assert again["plain"].result is None
    the_same(result, again["found"].result)
    for name, column in table.columns.items():
        assert np.array_equal(again["found"][name], column.astype(str) if column.dtype.kind == "O" else column,
                              equal_nan=column.dtype.kind == "f")  # fmt: skip
    assert result.to_csv(tmp_path / "table.csv").read_text().count("\n") == len(table) + 1


def test_a_journal_gives_it_back(result):
    """Blocks of bytes, as the journal of a study has them."""
    groups = {name: unpack(pack(dataset)) for name, dataset in to_datasets(result.to_table()).items()}
    again, _ = from_datasets(groups)
    the_same(result, again.result)


def test_what_is_loaded_goes_on(tmp_path):
    found = _basins()
    again = so.load(found.save(tmp_path / "basins.nc"))
    assert again.attractor_at(0.0, 0.0).name == found.attractor_at(0.0, 0.0).name
    ends = so.integrate(
        again.system, start=again.attractors[0].state, omega=again.omega, periods=again.attractors[0].period
    )
    assert np.allclose(ends.end, again.attractors[0].state, atol=1e-9)


def test_datasets_are_such_as_netcdf_can_hold(result, tmp_path):
    """No complex numbers, no objects: what `to_xarray` gives a user can be written by xarray itself."""
    result.to_xarray().to_netcdf(tmp_path / "plain.nc", engine="h5netcdf")


def test_xarray_reads_it_without_us(tmp_path):
    found = MAKERS["basins"]()
    dataset = xr.open_dataset(found.save(tmp_path / "basins.nc"), engine="h5netcdf")
    assert dataset.attrs["contents"] == "basins"
    assert (dataset["label"].to_numpy() == found.labels).all()
    told = dict(zip(dataset["kind"].to_numpy(), dataset["share"].to_numpy(), strict=True))
    assert told == found.shares


def test_a_part_that_is_missing_is_named():
    parts = to_datasets(so.verify(_branch(), points=2).to_table())
    with pytest.raises(so.InputError, match="result/branch"):
        from_datasets({name: part for name, part in parts.items() if name != "result/branch"})
    head = to_datasets(MAKERS["trajectory"]())
    with pytest.raises(so.InputError, match="stored as 'trajectory' cannot be read"):
        from_datasets({"": head[""].drop_vars("velocity")})
