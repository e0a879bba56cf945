"""Structures from files: every format gives the same matrices, and what is wrong with a file is one line."""

from __future__ import annotations

import gzip
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse

import suboctave as so
from suboctave.structures.files import read_matrix


def same(structure: so.Structure, chain, damping: bool = False, labels: bool = False, rtol: float = 0.0) -> None:
    """The structure is the chain; with labels in any order of the degrees of freedom."""
    order = [structure.dof(*label) for label in chain.labels] if labels else list(range(8))
    for what in ("mass", "stiffness", *(["damping"] if damping else [])):
        read = getattr(structure, what).toarray()[np.ix_(order, order)]
        np.testing.assert_allclose(read, getattr(chain, what), rtol=rtol, atol=0, err_msg=what)
    assert damping or structure.damping is None


def line_up(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines) + "\n")
    return path


# -------------------------------------------------------------------------------------------------------------- writers
def write_npz(folder, chain):
    np.savez(folder / "s.npz", M=chain.mass, K=chain.stiffness, C=chain.damping, other=np.ones((3, 3)), text="a")
    return folder / "s.npz"


def write_npz_rows(folder, chain):
    parts = {}
    for name, matrix in (("mass", chain.mass), ("Stiffness", chain.stiffness), ("damping", chain.damping)):
        rows = scipy.sparse.csr_array(matrix)
        parts |= {f"{name}_{part}": getattr(rows, part) for part in ("data", "indices", "indptr", "shape")}
    np.savez(folder / "s.npz", **parts)
    return folder / "s.npz"


def write_mat(folder, chain):
    m, k = (scipy.sparse.csc_matrix(matrix) for matrix in (chain.mass, chain.stiffness))
    scipy.io.savemat(folder / "s.mat", {"MassMatrix": m, "K": k, "C": chain.damping, "freq": np.ones(8), "t": 1.0})
    return folder / "s.mat"


def write_mat_struct(folder, chain):
    model = {"M": scipy.sparse.csc_matrix(chain.mass), "K": chain.stiffness, "D": chain.damping, "name": "a"}
    scipy.io.savemat(folder / "s.mat", {"model": model})
    return folder / "s.mat"


def write_mat_73(folder, chain):
    """As MATLAB does: dense matrices by columns, sparse ones as ir, jc."""
    with h5py.File(folder / "s.mat", "w", userblock_size=512) as file:
        for name, matrix in (("M", chain.mass), ("K", chain.stiffness)):
            columns = scipy.sparse.csc_array(matrix)
            group = file.create_group(name)
            group.attrs["MATLAB_sparse"] = np.uint64(8)
            group["data"] = columns.data
            group["ir"], group["jc"] = columns.indices.astype(np.uint64), columns.indptr.astype(np.uint64)
        file["C"] = chain.damping.T
        file["C"].attrs["MATLAB_class"] = np.bytes_("double")
        file.create_group("#refs#")
    return folder / "s.mat"


def write_h5_dense(folder, chain):
    with h5py.File(folder / "s.h5", "w") as file:
        for what in ("mass", "stiffness", "damping"):
            file[f"model/{what}"] = getattr(chain, what)
    return folder / "s.h5"


def write_h5_sparse(folder, chain):
    with h5py.File(folder / "s.hdf5", "w") as file:
        for what, kind in (("mass", "csr"), ("stiffness", "csc"), ("damping", "csc")):
            matrix = scipy.sparse.csr_array(getattr(chain, what)).asformat(kind)
            group = file.create_group(what)
            group.attrs["encoding-type"] = f"{kind}_matrix"
            group.attrs["shape"] = matrix.shape
            for part in ("data", "indices", "indptr"):
                group[part] = getattr(matrix, part)
    return folder / "s.hdf5"


def write_h5_entries(folder, chain):
    with h5py.File(folder / "s.h5", "w") as file:
        for what in ("mass", "stiffness", "damping"):
            matrix = scipy.sparse.coo_array(getattr(chain, what))
            group = file.create_group(what)
            group["row"], group["col"], group["data"] = matrix.row, matrix.col, matrix.data
    return folder / "s.h5"


ALL = [write_npz, write_npz_rows, write_mat, write_mat_struct, write_mat_73, write_h5_dense, write_h5_sparse]
ALL += [write_h5_entries]


@pytest.mark.parametrize("write", ALL)
def test_one_file_of_all_matrices(write, tmp_path, chain):
    structure = so.read_structure(write(tmp_path, chain), dofs=chain.labels)
    same(structure, chain, damping=True)
    assert structure.name == "s"
    assert structure.dof(7, "z") == 3


@pytest.mark.parametrize("write", ALL)
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.9])
def test_a_file_that_is_cut_off_is_refused_in_one_line(write, share, tmp_path, chain):
    path = write(tmp_path, chain)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(so.InputError, match=path.name) as caught:
        so.read_structure(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("write", ALL)
@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5", ".mtx", ".sti", ".pch", ".npy", ".mtx.gz", ".txt"])
def test_a_file_of_another_kind_than_its_ending_says(write, suffix, tmp_path, chain):
    path = write(tmp_path, chain)
    if suffix == path.suffix:
        return
    other = tmp_path / f"other{suffix}"
    other.write_bytes(path.read_bytes())
    if suffix in (".mat", ".h5") and h5py.is_hdf5(other):
        same(so.read_structure(other), chain, damping=True)
        return
    with pytest.raises(so.InputError, match="other") as caught:
        so.read_structure(other)
    assert "\n" not in str(caught.value)


def test_what_was_saved_is_read_again(tmp_path, structure, chain):
    mesh = so.Mesh(
        [[0, 0], [1, 0], [2, 0], [3, 0], [9, 9]], {"line": [[0, 1], [1, 2]]}, nodes=(*[1042, 7, 77, 300], "a")
    )
    for damping in (None, chain.damping, so.Rayleigh(0.1, "b"), so.ModalDamping([0.1, 0.2]), so.ModalDamping(0.1, 3)):
        given = so.Structure(
            structure.mass,
            structure.stiffness,
            damping,
            so.DofMap(structure.dofs.labels, [("wall", "x")]),
            mesh,
            "a name",
        )
        given.save(tmp_path / "s.npz")
        read = so.read_structure(tmp_path / "s.npz")
        same(so.Structure(read.mass, read.stiffness), chain)
        assert read.dofs.labels == given.dofs.labels
        assert read.dofs.fixed == {("wall", "x")}
        assert read.name == "a name"
        assert read.mesh.nodes == mesh.nodes
        np.testing.assert_array_equal(read.mesh.points, mesh.points)
        np.testing.assert_array_equal(read.mesh.cells["line"], mesh.cells["line"])
        if isinstance(damping, np.ndarray):
            np.testing.assert_array_equal(read.damping.toarray(), damping)
        elif isinstance(damping, so.Rayleigh):
            parameters = {"b": 0.3}
            ours, theirs = (s.system(parameters=parameters).matrices()[1] for s in (given, read))
            np.testing.assert_array_equal(ours, theirs)
        else:
            assert read.damping == damping
    with pytest.raises(so.InputError, match=r"saved in an \.npz file"):
        structure.save(tmp_path / "s.h5")


# -------------------------------------------------------------------------------------------- Matrix Market, any ending
def test_matrix_market_is_known_by_how_it_begins(tmp_path, chain):
    """Under any ending, packed or not, in small letters or great ones, with a mark of its code or without."""
    for suffix in (".mm", ".txt", ".dat", "", ".K", ".npz"):
        files = {what: tmp_path / f"{what}{suffix}" for what in ("mass", "stiffness")}
        for what, path in files.items():
            scipy.io.mmwrite(tmp_path / "a.mtx", scipy.sparse.coo_array(getattr(chain, what)), precision=17)
            path.write_bytes((tmp_path / "a.mtx").read_bytes())
        same(so.read_structure(**files), chain)
    data = files["mass"].read_bytes()
    (tmp_path / "mass.mm.gz").write_bytes(gzip.compress(data))
    files["mass"].write_bytes(b"\xef\xbb\xbf" + data.replace(b"%%MatrixMarket matrix", b"%%matrixmarket MATRIX"))
    same(so.read_structure(mass=tmp_path / "mass.mm.gz", stiffness=files["stiffness"]), chain)
    same(so.read_structure(**files), chain)


@pytest.mark.parametrize("layout", ["coordinate", "array"])
@pytest.mark.parametrize("symmetry", ["general", "symmetric", "skew-symmetric", "hermitian"])
@pytest.mark.parametrize("field", ["real", "integer", "complex"])
def test_matrix_market_as_scipy_writes_it(layout, symmetry, field, tmp_path):
    rng = np.random.default_rng(2)
    matrix = rng.integers(-9, 9, (5, 5)) * (1 if field == "integer" else 1 / 7)
    matrix = matrix * (1 + 0.3j) if field == "complex" else matrix
    turn = {"general": 0.0 * matrix, "symmetric": matrix.T, "skew-symmetric": -matrix.T, "hermitian": matrix.conj().T}
    matrix = matrix + turn[symmetry]
    given = scipy.sparse.coo_array(matrix) if layout == "coordinate" else matrix
    scipy.io.mmwrite(tmp_path / "a.mtx", given, field=field, symmetry=symmetry, precision=17)
    assert f"{layout} {field} {symmetry}" in (tmp_path / "a.mtx").read_text()
    read = read_matrix(tmp_path / "a.mtx")
    np.testing.assert_allclose(read.toarray() if layout == "coordinate" else read, matrix, rtol=1e-16)


def test_numbers_of_matrix_market_are_read_to_their_end(tmp_path):
    """Exponents of Fortran, which SciPy leaves out; what is no number is said, with no end of the process."""
    header = "%%MatrixMarket matrix coordinate real general\n% remark: Träger\n\n2 2 2\n1 1 3.0\n"
    for last, value in (("2 2 1.5D+3", 1500.0), ("2 2 1.5d-3", 0.0015), ("  2\t2   7", 7.0)):
        (tmp_path / "a.mtx").write_bytes((header + last + "\n").encode("latin-1"))
        np.testing.assert_array_equal(read_matrix(tmp_path / "a.mtx").toarray(), np.diag([3.0, value]))
    for last in (
        "2 2 1.0\0",
        "2 2\0 1.0",
        "2\0 2 1.0",
        "2 2 1.0x",
        "2 2 1.0.5",
        "2 2 1.0 7",
        "2 2 1.0e",
        "2 2 -",
        "2 1.5 3",
    ):
        (tmp_path / "a.mtx").write_text(header + last + "\n")
        with pytest.raises(so.InputError, match=r"a\.mtx"):
            read_matrix(tmp_path / "a.mtx")
    (tmp_path / "a.mtx").write_text("%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 2 3.0\n2 1 3.0\n")
    with pytest.raises(so.InputError, match="symmetric, but has entries on both sides"):
        read_matrix(tmp_path / "a.mtx")


def test_damaged_bytes_are_one_line(tmp_path, chain):
    """Each byte of a small file replaced by others: it is a matrix, or an InputError."""
    scipy.io.mmwrite(tmp_path / "a.mtx", scipy.sparse.coo_array(chain.mass[:2, :2]), precision=3)
    data = (tmp_path / "a.mtx").read_bytes()
    for place in range(len(data)):
        for byte in b"\x00\xff-%9 \n":
            (tmp_path / "b.mtx").write_bytes(data[:place] + bytes([byte]) + data[place + 1 :])
            with suppress(so.InputError):
                read_matrix(tmp_path / "b.mtx")


def test_what_is_damaged_beside_them_is_in_nobodys_way(tmp_path, chain):
    """A group, or parts of an archive, that look like a sparse matrix and are none."""
    with h5py.File(write_h5_dense(tmp_path, chain), "a") as file:
        for part in ("data", "indices", "indptr"):
            file[f"results/{part}"] = np.arange(3.0)
    same(so.read_structure(tmp_path / "s.h5"), chain, damping=True)
    np.savez(tmp_path / "s.npz", M=chain.mass, K=chain.stiffness, mesh_indptr=np.arange(3))
    same(so.read_structure(tmp_path / "s.npz"), chain)


# ------------------------------------------------------------------------------------------------ one file for a matrix
@pytest.mark.parametrize("suffix", [".mtx", ".mtx.gz", ".npz", ".npy", ".mat"])
def test_one_file_for_each_matrix(suffix, tmp_path, chain):
    files = {}
    for what in ("mass", "stiffness", "damping"):
        files[what] = path = tmp_path / f"{what}{suffix}"
        matrix = getattr(chain, what)
        if suffix.startswith(".mtx"):
            symmetry = "general" if what == "damping" else "symmetric"
            text = tmp_path / f"{what}.mtx"
            scipy.io.mmwrite(text, scipy.sparse.coo_array(matrix), symmetry=symmetry, precision=17)
            if suffix == ".mtx.gz":
                path.write_bytes(gzip.compress(text.read_bytes()))
        elif suffix == ".npz":
            scipy.sparse.save_npz(path, scipy.sparse.csr_matrix(matrix))
        elif suffix == ".npy":
            np.save(path, matrix)
        else:
            scipy.io.savemat(path, {"A": matrix})
    same(so.read_structure(**files), chain, damping=True)
    same(so.read_structure(mass=files["mass"], stiffness=str(files["stiffness"])), chain)
    for file in files.values():
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(so.InputError, match="cannot be read as") as caught:
        so.read_structure(**files)
    assert caught.value.key[0] in ("mass", "stiffness")


def test_advice_to_unpickle_is_not_passed_on(tmp_path):
    for name in ("a.npz", "a.npy"):
        (tmp_path / name).write_text("hello")
        with pytest.raises(so.InputError, match=r"cannot be read as.*no arrays of numbers") as caught:
            so.read_structure(mass=tmp_path / name, stiffness=tmp_path / name)
        assert "pickle" not in str(caught.value)


def test_a_header_of_matrix_market_is_believed_no_more_than_it_can_hold(tmp_path, chain):
    header = "%%MatrixMarket matrix coordinate real symmetric\n"
    mass = tmp_path / "m.mtx"
    scipy.io.mmwrite(mass, scipy.sparse.coo_array(chain.mass))
    for text, message in [
        ("8 8 1\n9 1 3.0\n", "cannot be read as"),
        ("8 8 1\n99999999999999999999 1 3.0\n", "cannot be read as"),
        ("8 8 2\n1 1 3.0\n", "cannot be read as"),
        ("900000000000 900000000000 1\n1 1 3.0\n", "header may be damaged"),
        ("8 8 1\n1 1 nan\n", "not finite"),
    ]:
        line_up(tmp_path / "k.mtx", [header + text.rstrip()])
        with pytest.raises(so.InputError, match=message):
            so.read_structure(mass=mass, stiffness=tmp_path / "k.mtx")
    line_up(tmp_path / "k.mtx", ["%%MatrixMarket matrix coordinate complex general", "8 8 1", "1 1 3.0 1.0"])
    with pytest.raises(so.InputError, match="the stiffness is complex"):
        so.read_structure(mass=mass, stiffness=tmp_path / "k.mtx")


# ---------------------------------------------------------------------------------------------------------------- names
def test_matrices_are_chosen_by_their_names(tmp_path, chain):
    path = tmp_path / "s.npz"
    np.savez(path, MGG=chain.mass, MAA=2 * chain.mass, KGG=chain.stiffness, odd=chain.damping)
    with pytest.raises(so.InputError, match=r"several that may be the mass, MAA, MGG: choose one with mass='MAA'"):
        so.read_structure(path)
    same(so.read_structure(path, mass="MGG", damping="odd"), chain, damping=True)
    with pytest.raises(so.InputError, match=r"holds no matrix 'KAA'.*did you mean 'MAA'"):
        so.read_structure(path, mass="MGG", stiffness="KAA")
    np.savez(path, A=chain.mass, B=chain.stiffness)
    with pytest.raises(so.InputError, match="has no matrix named as a mass, it has A, B; say which it is: mass="):
        so.read_structure(path)


def test_what_is_missing_is_said(tmp_path, chain):
    with pytest.raises(so.InputError, match="mass is missing"):
        so.read_structure()
    with pytest.raises(so.InputError, match="stiffness is missing"):
        so.read_structure(mass="m.mtx")
    with pytest.raises(so.InputError, match=r"mass='m\.mtx' is a file, k\.mtx too: give one file, or one for each"):
        so.read_structure("k.mtx", mass="m.mtx")
    np.save(tmp_path / "k.npy", chain.stiffness)
    with pytest.raises(so.InputError, match=r"k\.npy holds one matrix: give a file for each"):
        so.read_structure(tmp_path / "k.npy")
    write_npz(tmp_path, chain)
    with pytest.raises(so.InputError, match=r"there is no file .*s\.npy.*did you mean 's\.npz'"):
        so.read_structure(tmp_path / "s.npy")
    with pytest.raises(so.InputError, match="path must be a text or a PathLike"):
        so.read_structure(3)
    (tmp_path / "empty.npz").touch()
    with pytest.raises(so.InputError, match=r"empty\.npz is empty"):
        so.read_structure(tmp_path / "empty.npz")


def test_pickles_are_not_read(tmp_path):
    np.savez(tmp_path / "s.npz", M=np.array([{}], dtype=object))
    with pytest.raises(so.InputError, match="cannot be read as"):
        so.read_structure(tmp_path / "s.npz")


@pytest.mark.parametrize(
    "wrong",
    [
        {"indices": np.array([0, 9])},
        {"indices": np.array([0, -1])},
        {"indices": np.array([0, 2**64 - 1], dtype=np.uint64)},
        {"indices": np.array([0.0, 1.0])},
        {"indptr": np.array([0, 1])},
        {"indptr": np.array([0, 2, 1])},
        {"indptr": np.array([0, 1, 5])},
        {"shape": np.array([3, 2])},
        {"data": np.array([1.0])},
    ],
)
def test_parts_of_a_sparse_matrix_that_do_not_fit(wrong, tmp_path):
    parts = {"data": np.ones(2), "indices": np.array([0, 1]), "indptr": np.array([0, 1, 2]), "shape": np.array([2, 2])}
    np.savez(tmp_path / "s.npz", M=np.eye(2), **{f"K_{name}": array for name, array in (parts | wrong).items()})
    with pytest.raises(so.InputError, match=r"s\.npz") as caught:
        so.read_structure(tmp_path / "s.npz")
    assert "\n" not in str(caught.value)


def test_labels_beside_the_matrices(tmp_path, chain):
    """In the file, as numbers of nodes and directions; in a text; as pairs. Of another length, or twice: refused."""
    numbers = np.array([(node, {"x": 1, "z": 3}[direction]) for node, direction in chain.labels])
    scipy.io.savemat(tmp_path / "s.mat", {"M": chain.mass, "K": chain.stiffness, "dofs": numbers.astype(float)})
    assert so.read_structure(tmp_path / "s.mat").dofs.labels == chain.labels
    path = write_npz(tmp_path, chain)
    lines = [f"{node}, {direction}" for node, direction in chain.labels]
    text = line_up(tmp_path / "labels.txt", ["# node, direction", *lines])
    assert so.read_structure(path, dofs=text).dofs.labels == chain.labels
    for wrong, message in [
        (lines[:-1], "7 labels, the matrices 8 DOFs"),
        ([*lines[:-1], lines[0]], "names 1042 x more than once"),
        (["1042 x 3"], "line 1: node and direction"),
    ]:
        with pytest.raises(so.InputError, match=message):
            so.read_structure(path, dofs=line_up(text, wrong))
    with pytest.raises(so.InputError, match="there is no file"):
        so.read_structure(path, dofs=tmp_path / "none.txt")


# --------------------------------------------------------------------------------------------------------------- Abaqus
DIRECTION = {"x": 1, "z": 3}


def abaqus_lines(matrix, labels, half=True):
    entries = []
    for i, j in zip(*np.nonzero(matrix), strict=True):
        if not half or i <= j:
            (n, d), (m, e) = labels[j], labels[i]
            entries.append(f"{n},{DIRECTION[d]}, {m},{DIRECTION[e]}, {matrix[i, j]:.15e}")
    return entries


@pytest.mark.parametrize("half", [True, False])
def test_matrices_of_abaqus(half, tmp_path, chain):
    stiffness = line_up(tmp_path / "job_STIF1.mtx", ["** a remark", *abaqus_lines(chain.stiffness, chain.labels, half)])
    mass = line_up(tmp_path / "job_MASS1.mtx", abaqus_lines(chain.mass, chain.labels, half))
    same(so.read_structure(stiffness=stiffness, mass=mass), chain, labels=True, rtol=1e-14)
    structure = so.read_structure(stiffness)
    same(structure, chain, labels=True, rtol=1e-14)
    assert structure.dofs.labels[:2] == ((7, "x"), (7, "z"))
    ordered = so.read_structure(mass, dofs=chain.labels)
    same(ordered, chain, rtol=1e-14)
    assert ordered.dofs.labels == chain.labels
    line_up(tmp_path / "job_DMPV1.mtx", abaqus_lines(2 * chain.stiffness, chain.labels, half))
    np.testing.assert_allclose(so.read_structure(stiffness).damping.toarray(), 2 * structure.stiffness.toarray())


def test_internal_nodes_of_abaqus_are_kept(tmp_path):
    stiffness = line_up(tmp_path / "k.mtx", ["1,1, 1,1, 4.0", "-1,1, 1,1, 1.0", "2,3, 2,3, 9.0", "-1,12, -1,12, 1.0"])
    mass = line_up(tmp_path / "m.mtx", ["1,1, 1,1, 1.0", "2,3, 2,3, 1.0"])
    structure = so.read_structure(stiffness=stiffness, mass=mass)
    assert structure.dofs.labels == ((-1, "x"), (-1, "12"), (1, "x"), (2, "z"))
    assert structure.massless == (0, 1)
    np.testing.assert_array_equal(structure.stiffness.toarray()[0], [0, 0, 1, 0])


def test_coordinates_of_abaqus(tmp_path):
    files = {"stiffness": tmp_path / "k.mtx", "mass": tmp_path / "m.mtx"}
    line_up(files["stiffness"], ["1 1 4.0", "2 1 -1.0", "2 2 3.0"])
    line_up(files["mass"], ["1 1 1.0", "2 2 1.0"])
    structure = so.read_structure(**files)
    np.testing.assert_array_equal(structure.stiffness.toarray(), [[4, -1], [-1, 3]])
    assert structure.dofs is None


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["1,1, 1,1, 4.0", "2,1, 1,1"], "no table of numbers"),
        (["1,1, 1,1, 4.0", "2,1, 1,1, four"], "no table of numbers"),
        (["1,1,1,4.0"], "lines of 4 numbers; 3 or 5 are known"),
        (["1.5,1, 1,1, 4.0"], "must be whole numbers"),
        (["nan,1, 1,1, 4.0"], "must be whole numbers"),
        (["1e300,1, 1,1, 4.0"], "must be whole numbers"),
        (["1,99, 1,1, 4.0"], "no direction number 99"),
        (["1,-1, 1,1, 4.0"], "no direction number"),
        (["0 1 4.0"], "row or column 0"),
        (["1,1, 1,1, 4.0", "2,1, 2,1, 4.0", "1,1, 1,1, 4.0"], "given twice"),
        (["2,1, 2,1, 4.0", "1,1, 1,1, nan"], "not finite"),
        (["**"], "holds no entries"),
        (["1,1, 1,1, 4.0", "2,1, 2,1, 4.0", "2,1, 1,1, 1.0", "1,1, 2,1, 3.0"], "not symmetric"),
        (["1,1, 1,1, 4.0"], "names 1 DOFs that k.mtx does not .2 x.: one of the files may be cut off"),
    ],
)
def test_lines_of_abaqus_that_are_wrong(lines, message, tmp_path):
    mass = line_up(tmp_path / "m.mtx", ["1,1, 1,1, 1.0", "2,1, 2,1, 1.0"])
    with pytest.raises(so.InputError, match=message) as caught:
        so.read_structure(stiffness=line_up(tmp_path / "k.mtx", lines), mass=mass)
    assert "\n" not in str(caught.value)


def test_texts_that_are_cut_off_within_a_line(tmp_path, chain):
    mass = line_up(tmp_path / "m.mtx", abaqus_lines(chain.mass, chain.labels))
    stiffness = line_up(tmp_path / "k.mtx", abaqus_lines(chain.stiffness, chain.labels))
    text = stiffness.read_text()
    for share in (0.3, 0.5, 0.8):
        stiffness.write_text(text[: int(share * len(text))])
        with pytest.raises(so.InputError, match=r"k\.mtx"):
            so.read_structure(stiffness=stiffness, mass=mass)


def test_files_with_and_without_labels_cannot_be_put_together(tmp_path):
    mass = line_up(tmp_path / "m.mtx", ["1 1 1.0", "2 2 1.0"])
    stiffness = line_up(tmp_path / "k.mtx", ["1,1, 1,1, 4.0", "2,1, 2,1, 4.0"])
    with pytest.raises(so.InputError, match=r"m\.mtx has no labels of DOFs"):
        so.read_structure(stiffness=stiffness, mass=mass)


# ------------------------------------------------------------------------------------------------------------- CalculiX
def write_calculix(folder, chain):
    for suffix, matrix in ((".sti", chain.stiffness), (".mas", chain.mass)):
        rows, columns = np.nonzero(np.triu(matrix))
        entries = [f"{i + 1:10d} {j + 1:10d} {matrix[i, j]:20.13e}" for i, j in zip(rows, columns, strict=True)]
        line_up(folder / f"job{suffix}", entries)
    line_up(folder / "job.dof", [f"{node}.{DIRECTION[direction]}" for node, direction in chain.labels])
    return folder / "job.sti"


def test_matrices_of_calculix(tmp_path, chain):
    path = write_calculix(tmp_path, chain)
    for suffix in (".sti", ".mas", ".dof"):
        structure = so.read_structure(path.with_suffix(suffix))
        same(structure, chain, rtol=1e-12)
        assert structure.dofs.labels == chain.labels
        assert structure.name == "job"


@pytest.mark.parametrize(
    ("suffix", "cut", "missing"),
    [
        (
            ".sti",
            "job.sti has 5 rows, job.dof 8: one may be cut off",
            "there is no file .*job.sti .did you mean 'job.mas'",
        ),
        (".mas", "job.mas has 4 rows, job.dof 8: one may be cut off", "job.sti: there is no job.mas beside it"),
        (".dof", "job.sti: an entry stands in row or column 5; there are 4", "job.sti: there is no job.dof beside it"),
    ],
)
def test_files_of_calculix_that_are_cut_off(suffix, cut, missing, tmp_path, chain):
    path = write_calculix(tmp_path, chain)
    lines = path.with_suffix(suffix).read_text().splitlines()
    path.with_suffix(suffix).write_text("\n".join(lines[: len(lines) // 2]) + "\n")
    with pytest.raises(so.InputError, match=cut):
        so.read_structure(path)
    path.with_suffix(suffix).write_text("\n".join(lines)[:-3])
    with pytest.raises(so.InputError, match="ends within a line"):
        so.read_structure(path)
    path.with_suffix(suffix).unlink()
    with pytest.raises(so.InputError, match=missing):
        so.read_structure(path)


def test_a_label_of_calculix_that_is_none(tmp_path, chain):
    path = write_calculix(tmp_path, chain)
    (tmp_path / "job.dof").write_text("1.1\n12\n")
    with pytest.raises(so.InputError, match=r"line 2: '12' is not node\.direction"):
        so.read_structure(path)
