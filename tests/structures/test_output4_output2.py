"""Nastran's .op4 and .op2: files laid out as in its manuals, and those of pyNastran where that is installed."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
from nastran_files import Machine, output2, output4, runs

import suboctave as so
from suboctave.structures.output2 import read_op2
from suboctave.structures.output4 import read_op4

MACHINES = [Machine("<", 4), Machine(">", 4), Machine("<", 8), Machine(">", 8)]
each_machine = pytest.mark.parametrize("machine", MACHINES, ids=lambda machine: f"{machine.order}{machine.size}")
each_precision = pytest.mark.parametrize("single", [False, True], ids=["double", "single"])


@pytest.fixture(scope="module")
def matrices():
    """A stiffness with a gap and a column of zeros, digits to the last bit, and a diagonal mass."""
    stiffness = np.triu(np.random.default_rng(4).normal(size=(9, 9)))
    stiffness[2:4, 6] = 0.0
    stiffness[:, 3] = stiffness[3, :] = 0.0
    return {"KAA": stiffness + stiffness.T, "MAA": np.diag(np.arange(1.0, 10.0) / 7.0)}


def rounded(matrices, single, machine):
    """What single precision leaves of them; a word of eight bytes has double precision."""
    kind = np.float32 if single and machine.size == 4 else float
    return {name: matrix.astype(kind).astype(float) for name, matrix in matrices.items()}


@each_machine
@each_precision
@pytest.mark.parametrize("form", ["dense", "sparse", "big"])
def test_binary_output4(form, single, machine, matrices, tmp_path):
    wanted = rounded(matrices, single, machine)
    (tmp_path / "job.op4").write_bytes(output4(matrices, form, single, machine))
    structure = so.read_structure(tmp_path / "job.op4", dofs=[(node, "z") for node in range(9)])
    np.testing.assert_array_equal(structure.stiffness.toarray(), wanted["KAA"])
    np.testing.assert_array_equal(structure.mass.toarray(), wanted["MAA"])
    assert structure.damping is None


@each_machine
@each_precision
@pytest.mark.parametrize("label", [True, False], ids=["label", "no label"])
def test_output2(label, single, machine, matrices, tmp_path):
    """Tables before and behind are passed over."""
    wanted = rounded(matrices, single, machine)
    (tmp_path / "job.op2").write_bytes(output2(matrices, single, machine, label))
    structure = so.read_structure(tmp_path / "job.op2")
    np.testing.assert_array_equal(structure.stiffness.toarray(), wanted["KAA"])
    np.testing.assert_array_equal(structure.mass.toarray(), wanted["MAA"])


def text_output4(matrices, form, count, digits, letter="E"):
    """An .op4 file in text, `count` values in a line."""
    width = digits + 7
    lines = []
    for name, matrix in matrices.items():
        rows, n = matrix.shape
        kind, parts_of = (4, 2) if np.iscomplexobj(matrix) else (2, 1)
        head = f"{n:8d}{-rows if form == 'big' else rows:8d}{6 if rows == n else 2:8d}{kind:8d}{name:<8}"
        lines.append(f"{head}1P,{count}E{width}.{digits}")
        for j in range(n):
            parts = list(runs(matrix[:, j]))
            if form == "dense" and parts:
                first, last = parts[0][0], parts[-1][0] + len(parts[-1][1]) - 1
                parts = [(first, matrix[first - 1 : last, j])]
            if parts:
                size = 2 * parts_of
                words = sum(size * len(entries) + {"dense": 0, "sparse": 1, "big": 2}[form] for _, entries in parts)
                row = parts[0][0] if form == "dense" else 0
                lines.append(f"{j + 1:8d}{row:8d}{words:8d}")
            for first, entries in parts:
                length = size * len(entries) + 1
                if parts_of == 2:
                    entries = np.stack([entries.real, entries.imag], axis=1).ravel()
                if form != "dense":
                    lines.append(f"{length:8d}{first:8d}" if form == "big" else f"{first + 65536 * length:12d}")
                texts = [f"{entry:{width}.{digits}E}".replace("E", letter) for entry in entries]
                lines += ["".join(texts[k : k + count]) for k in range(0, len(texts), count)]
        lines += [f"{n + 1:8d}{1:8d}{1:8d}", f"{1.0:{width}.{digits}E}".replace("E", letter)]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("form", ["dense", "sparse", "big"])
@pytest.mark.parametrize(("count", "digits", "letter"), [(3, 16, "E"), (5, 9, "E"), (3, 16, "D")])
def test_output4_in_text(form, count, digits, letter, matrices, tmp_path):
    (tmp_path / "job.op4").write_text(text_output4(matrices, form, count, digits, letter))
    structure = so.read_structure(tmp_path / "job.op4")
    for matrix, wanted in ((structure.stiffness, matrices["KAA"]), (structure.mass, matrices["MAA"])):
        printed = np.array([[float(f"{entry:.{digits}E}") for entry in row] for row in wanted])
        np.testing.assert_array_equal(matrix.toarray(), printed)


@pytest.mark.parametrize("form", ["dense", "sparse", "big"])
@pytest.mark.parametrize(("count", "digits", "letter"), [(3, 16, "E"), (5, 9, "E"), (3, 16, "D")])
def test_complex_numbers_in_text_run_on_over_ends_of_lines(form, count, digits, letter, matrices, tmp_path):
    """An odd number in a line: of every second value the imaginary part is in the next line. K and M are read too."""
    complex_ones = {"KC": matrices["KAA"] * (1 + 0.02j), "GUST": (1.5 - 0.25j) * np.arange(1.0, 28.0).reshape(9, 3)}
    given = {"KC": complex_ones["KC"], **matrices, "GUST": complex_ones["GUST"]}
    (tmp_path / "job.op4").write_text(text_output4(given, form, count, digits, letter))
    found = read_op4(tmp_path / "job.op4").matrices
    for name, matrix in complex_ones.items():
        np.testing.assert_allclose(found[name].toarray(), matrix, rtol=2 * 10.0**-digits)
    structure = so.read_structure(tmp_path / "job.op4")
    np.testing.assert_allclose(structure.stiffness.toarray(), matrices["KAA"], rtol=10.0**-digits)
    with pytest.raises(so.InputError, match="stiffness is complex"):
        so.read_structure(tmp_path / "job.op4", stiffness="KC")


def test_half_a_complex_number_is_said(matrices, tmp_path):
    lines = text_output4({**matrices, "KC": matrices["KAA"] * (1 + 0.02j)}, "dense", 3, 16).splitlines()
    first = next(i for i, line in enumerate(lines) if "KC" in line) + 2
    lines[first] = lines[first][: 2 * 23]
    (tmp_path / "job.op4").write_text("\n".join(lines) + "\n")
    refused(tmp_path / "job.op4", "half a complex number in column 1 of KC")


def test_exponents_of_three_digits_have_no_letter(tmp_path):
    text = text_output4({"MAA": np.eye(2), "KAA": 2.5 * np.eye(2)}, "dense", 3, 16)
    (tmp_path / "job.op4").write_text(text.replace("2.5000000000000000E+00", "2.5000000000000000-103", 1))
    assert read_op4(tmp_path / "job.op4").matrices["KAA"][0, 0] == 2.5e-103


def test_one_triangle_of_a_symmetric_matrix_is_made_whole(matrices, tmp_path):
    halves = {name: np.tril(matrix) for name, matrix in matrices.items()}
    (tmp_path / "job.op4").write_bytes(output4(halves, "sparse"))
    (tmp_path / "job.op2").write_bytes(output2(halves))
    for name in ("job.op4", "job.op2"):
        structure = so.read_structure(tmp_path / name)
        np.testing.assert_array_equal(structure.stiffness.toarray(), matrices["KAA"])


def test_complex_and_rectangular_matrices_beside_them(matrices, tmp_path):
    """They are read, and refused as a stiffness."""
    flexible = matrices["KAA"] * (1 + 0.02j)
    rectangle = np.arange(1.0, 28.0).reshape(9, 3)
    given = {**matrices, "GUST": rectangle, "KC": flexible, "NONE": np.zeros((2, 2))}
    for form in ("dense", "sparse", "big"):
        (tmp_path / "job.op4").write_bytes(output4(given, form))
        found = read_op4(tmp_path / "job.op4").matrices
        for name, matrix in given.items():
            np.testing.assert_array_equal(found[name].toarray(), matrix)
    (tmp_path / "job.op2").write_bytes(output2(given))
    found = read_op2(tmp_path / "job.op2").matrices
    for name, matrix in given.items():
        np.testing.assert_array_equal(found[name].toarray(), matrix)
    for file in ("job.op4", "job.op2"):
        with pytest.raises(so.InputError, match="complex"):
            so.read_structure(tmp_path / file, stiffness="KC")


def refused(path, message=None):
    with pytest.raises(so.InputError, match=message) as caught:
        so.read_structure(path)
    assert path.name in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("machine", [MACHINES[0], MACHINES[3]], ids=["<4", ">8"])
def test_files_that_are_cut_off(machine, matrices, tmp_path):
    """At every tenth byte or so, up to the last one that is needed."""
    files = [output4(matrices, form, machine=machine) for form in ("dense", "sparse", "big")]
    for data in files:
        for end in range(1, len(data), 11):
            (tmp_path / "job.op4").write_bytes(data[:end])
            refused(tmp_path / "job.op4")
    data = output2(matrices, machine=machine, tables=False)
    for end in range(1, len(data) - 2 * (8 + machine.size), 11):
        (tmp_path / "job.op2").write_bytes(data[:end])
        refused(tmp_path / "job.op2")
    (tmp_path / "job.op4").write_bytes(files[0][:-3])
    refused(tmp_path / "job.op4", "no complete record begins at byte")


def test_texts_that_are_cut_off(matrices, tmp_path):
    for form in ("dense", "sparse", "big"):
        lines = text_output4(matrices, form, 3, 16).splitlines(keepends=True)
        for end in range(1, len(lines)):
            (tmp_path / "job.op4").write_text("".join(lines[:end]))
            refused(tmp_path / "job.op4")
    (tmp_path / "job.op4").write_text("".join(lines[:-1]))
    refused(tmp_path / "job.op4", "cut off: MAA has no end")
    (tmp_path / "job.op4").write_text("".join(lines)[:-4])
    refused(tmp_path / "job.op4", "ends within a line")


@pytest.mark.parametrize(
    ("place", "number", "message"),
    [
        (8, 3, "beyond the 3 rows and 9 columns of KAA"),
        (16, 7, "of type 7; types are 1 to 4"),
        (8, -70000, "a string of .* words in column 1"),
    ],
)
def test_headers_that_do_not_fit(place, number, message, matrices, tmp_path):
    data = bytearray(output4(matrices, "sparse"))
    data[place : place + 4] = Machine().whole(number)
    (tmp_path / "job.op4").write_bytes(data)
    refused(tmp_path / "job.op4", message)


def test_a_name_that_occurs_twice(matrices, tmp_path):
    (tmp_path / "job.op4").write_bytes(2 * output4(matrices))
    refused(tmp_path / "job.op4", "holds MAA twice")
    once = output2(matrices, tables=False)[: -len(Machine().key(0))]
    (tmp_path / "job.op2").write_bytes(once + output2(matrices, label=False, tables=False))
    refused(tmp_path / "job.op2", "holds MAA twice")


def test_a_load_that_occurs_twice_is_in_nobodys_way(matrices, tmp_path):
    load = {"PG": np.arange(1.0, 10.0)[:, None]}
    (tmp_path / "job.op4").write_bytes(output4({**load, **matrices}) + output4(load))
    structure = so.read_structure(tmp_path / "job.op4")
    np.testing.assert_array_equal(structure.stiffness.toarray(), matrices["KAA"])
    with pytest.raises(so.InputError, match="holds PG twice"):
        so.read_structure(tmp_path / "job.op4", stiffness="PG")


@pytest.mark.parametrize("name", ["job.op4", "job.op2"])
@pytest.mark.parametrize("data", [b"certainly no matrix", b"certainly no matrix\n", bytes(200), b""])
def test_files_that_are_none(name, data, tmp_path):
    (tmp_path / name).write_bytes(data)
    refused(tmp_path / name)


def test_an_output2_of_tables_alone(tmp_path):
    (tmp_path / "job.op2").write_bytes(output2({}))
    refused(tmp_path / "job.op2", "holds no matrix such as KGG")


# ------------------------------------------------------------------------------------------------ the same by pyNastran
@pytest.fixture
def py_nastran(monkeypatch):
    """Its 1.4 asks NumPy for a name that went with NumPy 2.4."""
    pytest.importorskip("pyNastran")
    monkeypatch.setattr(np, "in1d", np.isin, raising=False)
    from pyNastran.op2.op2 import OP2
    from pyNastran.op4.op4 import OP4

    return OP2, OP4


@pytest.mark.parametrize("form", ["dense", "sparse"])
def test_what_pynastran_writes(form, py_nastran, matrices, tmp_path):
    kind = scipy.sparse.coo_matrix if form == "sparse" else np.asarray
    written = {name: (6, kind(matrix)) for name, matrix in matrices.items()}
    py_nastran[1](debug=None).write_op4(str(tmp_path / "job.op4"), written, is_binary=False)
    structure = so.read_structure(tmp_path / "job.op4")
    np.testing.assert_array_equal(structure.stiffness.toarray(), matrices["KAA"])


@each_precision
@pytest.mark.parametrize("machine", MACHINES[:2], ids=["<", ">"])
def test_pynastran_reads_these_files_too(machine, single, py_nastran, matrices, tmp_path):
    """What is written above is what others take for such files."""
    op2, op4 = py_nastran
    wanted = rounded(matrices, single, machine)
    for form in ("dense", "sparse", "big"):
        (tmp_path / "job.op4").write_bytes(output4(matrices, form, single, machine))
        data = op4(debug=None).read_op4(str(tmp_path / "job.op4"))["KAA"].data
        np.testing.assert_array_equal(scipy.sparse.csr_array(data).toarray(), wanted["KAA"])
    (tmp_path / "job.op2").write_bytes(output2(matrices, single, machine, tables=False))
    model = op2(debug=None)
    model.read_op2(str(tmp_path / "job.op2"), combine=False)
    np.testing.assert_array_equal(model.matrices["KAA"].data.toarray(), wanted["KAA"])
