"""Maps are saved and loaded: the same labels, borders and motions, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so


@pytest.fixture(scope="module")
def regimes():
    system = so.System(
        mass=1.0,
        damping="c",
        stiffness=1.0,
        elements=[so.CubicSpring(dof=0, coefficient="alpha")],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"c": 0.08, "alpha": 0.5, "F": 0.3},
    )
    return so.regime_map(system, (1.7, 0.9), "F", (0.35, 0.08), harmonics=1, depth=0, values=2)


@pytest.fixture(scope="module")
def region():
    system = so.library.nltva(F=0.15)
    isolas = so.find_isolas(system, (0.8, 3.0), "F", (0.1, 0.25), values=3)
    return so.isola_map(isolas, "k1", (0.95, 1.3), probes=1)


def same_table(one, other):
    assert list(one.columns) == list(other.columns)
    for name in one.columns:
        assert np.array_equal(one[name], other[name]), name


def test_a_regime_map(regimes, tmp_path):
    file = regimes.save(tmp_path / "regimes.nc")
    loaded = so.load(file)
    assert isinstance(loaded, so.RegimeMap)
    assert repr(loaded) == repr(regimes)
    same_table(loaded.to_table(), regimes.to_table())
    cells, labels = regimes.raster(60, 40)
    again, others = loaded.raster(60, 40)
    assert np.array_equal(cells, again)
    assert labels == others
    for omega, value in ((1.0, 0.1), (1.5, 0.3)):
        motions = regimes.motions(omega, value)
        assert len(motions) >= 1
        for one, other in zip(motions, loaded.motions(omega, value), strict=True):
            assert one.coefficients.tobytes() == other.coefficients.tobytes()
    options = {"points": 1, "seed": 1, "starts": 1, "transient": 50}
    assert repr(loaded.check(**options)) == repr(regimes.check(**options))
    with pytest.raises(so.InputError, match="exists"):
        regimes.save(file)
    loaded.save(tmp_path / "again.nc")
    assert repr(so.load(tmp_path / "again.nc")) == repr(regimes)


@pytest.mark.slow
def test_a_map_of_isolas(region, tmp_path):
    assert len(region.regions) == 1
    loaded = so.load(region.save(tmp_path / "isolas.nc"))
    assert isinstance(loaded, so.IsolaMap)
    assert repr(loaded) == repr(region)
    same_table(loaded.to_table(), region.to_table())
    assert loaded.ranges(1.0) == region.ranges(1.0)
    assert loaded.contains(F=0.15, k1=1.0) == region.contains(F=0.15, k1=1.0)
    assert loaded.regions[0].probes == region.regions[0].probes
    assert [repr(curve) for curve in loaded.born] == [repr(curve) for curve in region.born]
    assert repr(loaded.regions[0].isola) == repr(region.regions[0].isola)
    loaded.plot(tmp_path / "map.png")


def test_nothing_found_is_kept_too(tmp_path):
    system = so.library.nltva(F=0.15)
    empty = so.IsolaMap([], system, "F", "k1", None, (0.95, 1.3), ["the merging could not be followed"])
    loaded = so.load(empty.save(tmp_path / "empty.nc"))
    assert repr(loaded) == repr(empty)
    assert loaded.notes == empty.notes
