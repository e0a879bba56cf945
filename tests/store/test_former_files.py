"""Files that earlier versions wrote are read: a study of version 0.1.0, with its curves, diagram and table."""

from __future__ import annotations

import lzma
from pathlib import Path

import numpy as np
import pytest

import suboctave as so

DATA = Path(__file__).parent.parent / "data" / "results_0.1.0.nc.xz"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    path = tmp_path_factory.mktemp("former") / "results.nc"
    path.write_bytes(lzma.decompress(DATA.read_bytes()))
    return so.load(path)


def test_all_of_a_study_is_there(results):
    assert list(results) == ["response", "folds", "diagram", "witness"]
    assert results.attributes["title"] == "written before"
    response, folds, diagram, witness = results.values()
    assert len(response) == 31
    assert [item.kind for item in response.bifurcations.met] == ["LP", "LP"]
    assert response.system.parameters == {"c": 0.1, "alpha": 1.0, "F": 0.3}
    assert (folds.kind, len(folds)) == ("LP", 13)
    assert diagram[0].branch.points[-1].orbit.omega == 0.8
    assert list(witness["what"]) == ["point 0", "point 8", "point 16", "point 24", "LP", "LP"]
    assert witness.result is not None


def test_its_motions_are_motions(results):
    """What was stored solves the equations, and can be gone on from."""
    response = results["response"]
    for point in response.points:
        assert np.abs(point.orbit.state().residual).max() < 1e-8
    onwards = so.continue_branch(response.points[-1], "F", (0.3, 0.35), max_step=0.2)
    assert onwards.parameter("F")[-1] == 0.35
