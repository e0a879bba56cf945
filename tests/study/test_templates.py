"""The study files that `suboctave new --example` gives, and matrices from files: run, and held against closed forms."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import suboctave as so
from suboctave.study.cli import examples


@pytest.mark.parametrize("name", sorted(examples()))
def test_every_example_is_in_order(name, tmp_path, suboctave):
    if name == "plate":
        pytest.importorskip("skfem")
    path = tmp_path / "mine.toml"
    assert suboctave("new", path, "--example", name)[0] == 0
    if name == "matrices":
        chain = 2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
        for what, matrix in (("M", np.eye(3)), ("C", 0.05 * np.eye(3)), ("K", chain)):
            np.savetxt(tmp_path / f"{what}.csv", matrix, delimiter=",")
    status, out, err = suboctave("check", path)
    assert status == 0, err
    assert "in order" in out


@pytest.mark.parametrize("name", ["reference_oscillator", "nltva", "mathieu_duffing", "unbalance"])
def test_examples_are_short(name):
    text = (Path(so.__file__).parent / "study" / "templates" / f"{name}.toml").read_text()
    assert len(text.splitlines()) <= 25


def test_the_reference_oscillator_from_its_study_file(tmp_path, suboctave, equal):
    path = tmp_path / "mine.toml"
    suboctave("new", path)
    status, out, err = suboctave("run", path, "--json")
    assert status == 0, err
    said = json.loads(out)
    doublings = [b["omega"] for b in said["analyses"][0]["bifurcations"] if b["kind"] == "PD"]
    # by shooting (tests/data/reference.json holds the digits): the exact law
    np.testing.assert_allclose(doublings, [3.96971, 2.29375], atol=1e-5)
    assert suboctave("run", path, "--overwrite")[0] == 0  # with every kernel compiled
    equal(
        so.load(tmp_path / "mine_results" / "results.nc")["response"],
        so.frequency_response(so.library.reference_oscillator(), (4.5, 1.3)),
    )


def test_the_tongue_of_the_mathieu_oscillator(tmp_path, suboctave):
    path = tmp_path / "mine.toml"
    suboctave("new", path, "--example", "mathieu_duffing")
    path.write_text(path.read_text().replace("p = 0.01", "p = 1e-5"))
    assert suboctave("run", path)[0] == 0
    branch = so.load(tmp_path / "mine_results" / "results.nc")["response"]
    # averaging at omega = 2: unstable within omega = 2 +- 2 sqrt(delta^2 / 16 - zeta^2), up to O(delta^2)
    half = 2.0 * np.sqrt(0.15**2 / 16.0 - 0.02**2)
    found = [b.omega for b in branch.bifurcations["PD"]]
    np.testing.assert_allclose(found, [2.0 + half, 2.0 - half], atol=2e-3)
    # the tip: at delta = 4 zeta both meet
    path.write_text(path.read_text().replace("delta = 0.15", "delta = 0.0799"))
    assert suboctave("run", path, "--overwrite")[0] == 0
    assert not list(so.load(tmp_path / "mine_results" / "results.nc")["response"].bifurcations)
    path.write_text(path.read_text().replace("delta = 0.0799", "delta = 0.0805"))
    assert suboctave("run", path, "--overwrite")[0] == 0
    tip = so.load(tmp_path / "mine_results" / "results.nc")["response"].bifurcations["PD"]
    np.testing.assert_allclose([b.omega for b in tip], 2.0, atol=6e-3)
    assert len(tip) == 2


@pytest.mark.slow
def test_the_detached_branch_of_the_absorber(tmp_path, suboctave):
    path = tmp_path / "mine.toml"
    suboctave("new", path, "--example", "nltva")
    assert suboctave("run", path)[0] == 0
    detached = so.load(tmp_path / "mine_results" / "results.nc")["detached"]
    assert detached.closed
    # its right end by shooting
    assert abs(max(b.omega for b in detached.bifurcations["LP"]) - 2.3037802598) < 1e-6


def test_the_unbalance_response_before_contact(tmp_path, suboctave):
    path = tmp_path / "mine.toml"
    suboctave("new", path, "--example", "unbalance")
    path.write_text(path.read_text().replace("omega = [0.5, 2.0]", "omega = [0.5, 0.8]"))
    assert suboctave("run", path)[0] == 0
    branch = so.load(tmp_path / "mine_results" / "results.nc")["run-up"]
    w = branch.omega
    linear = 0.06 * w**2 / np.abs(1.0 - w**2 + 0.08j * w)
    assert linear.max() < 0.5  # the play is never used up
    np.testing.assert_allclose(branch.amplitude, linear, rtol=1e-9)


def test_matrices_come_from_files(tmp_path, suboctave):
    import scipy.io
    import scipy.sparse

    from suboctave.study.system import read_matrix

    matrix = np.array([[2.0, -1.0], [-1.0, 1.0 / 3.0]])
    np.save(tmp_path / "a.npy", matrix)
    np.savez(tmp_path / "b.npz", K=matrix, M=2.0 * matrix)
    scipy.sparse.save_npz(tmp_path / "c.npz", scipy.sparse.csr_array(matrix))
    scipy.io.mmwrite(tmp_path / "d.mtx", scipy.sparse.coo_array(matrix), precision=17)
    scipy.io.savemat(tmp_path / "e.mat", {"K": matrix})
    np.savetxt(tmp_path / "f.csv", matrix, delimiter=",", fmt="%.17g")
    for name, key in (
        ("a.npy", None),
        ("b.npz", "K"),
        ("c.npz", None),
        ("d.mtx", None),
        ("e.mat", None),
        ("f.csv", None),
    ):
        read = read_matrix(tmp_path / name, key)
        dense = read.toarray() if hasattr(read, "toarray") else read
        assert dense.tobytes() == matrix.tobytes(), name
    with pytest.raises(so.InputError, match="choose one with key="):
        read_matrix(tmp_path / "b.npz", None)
    with pytest.raises(so.InputError, match="holds no 'k'"):
        read_matrix(tmp_path / "b.npz", "k")


def test_published_structures_by_name(tmp_path, suboctave):
    path = tmp_path / "beam.toml"
    path.write_text(
        '[system]\nlibrary = "cantilever_beam"\narguments = {elements = 2, F = 0.01}\n'
        '[[analyses]]\ntype = "frequency_response"\nomega = [100.0, 140.0]\n'
    )
    status, _, err = suboctave("check", path)
    assert status == 0, err
    path.write_text(path.read_text().replace("elements = 2", "elements = 2.5"))
    assert "elements=2.5" in suboctave("check", path)[2]


def test_the_plate_is_the_published_one_in_other_units(tmp_path, suboctave):
    """Lengths in 2 mm, masses in that of the plate, times in 1 / omega1: numbers of the file are rounded to 1 %."""
    pytest.importorskip("skfem")
    from suboctave.structures import clearance_plate
    from suboctave.study.file import read_study

    path = tmp_path / "mine.toml"
    suboctave("new", path, "--example", "plate")
    study = read_study(path)
    system, unit = study.system, clearance_plate()
    mass, damping, stiffness = system.matrices()
    m, c, k = unit.matrices()
    weight = 1.0 * 0.6 * 0.005 * 7850.0
    np.testing.assert_allclose(mass, weight * m, atol=1e-9 * weight)
    omega = float(np.sqrt(np.abs(stiffness).max() / (weight * np.abs(k).max())))
    np.testing.assert_allclose(damping, weight * omega * c, atol=1e-2 * weight * omega * np.abs(c).max())
    scales = {"Kc": weight * omega**2, "gap": 2e-3, "F": weight * omega**2 * 2e-3}
    ours = {"Kc": unit.parameters["Kc"], "gap": unit.parameters["gap"], "F": unit.parameters["p"]}
    for name, scale in scales.items():
        assert system.parameters[name] == pytest.approx(ours[name] * scale, rel=0.03), name
    assert study.steps[0].observe == int(np.argmax(unit.elements[0].direction(unit.n)))
    assert system.observed_dof == unit.observed_dof
