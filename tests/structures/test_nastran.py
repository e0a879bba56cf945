"""Matrices of Nastran: OUTPUT4 by pyNastran, where that is installed, and punched DMIG entries."""

from __future__ import annotations

import builtins
import struct

import numpy as np
import pytest
import scipy.sparse

import suboctave as so

DIRECTION = {"x": 1, "z": 3}


def record(*parts: bytes) -> bytes:
    """A record of Fortran: its length before and after it."""
    data = b"".join(parts)
    return struct.pack("<i", len(data)) + data + struct.pack("<i", len(data))


def binary_output4(matrices) -> bytes:
    """Dense columns in double precision, each from its first row to its last, and a column beyond the last."""
    data = b""
    for name, matrix in matrices.items():
        n = len(matrix)
        data += record(struct.pack("<4i", n, n, 6, 2), f"{name:<8}".encode())
        for j in range(n):
            rows = np.flatnonzero(matrix[:, j])
            entries = matrix[rows[0] : rows[-1] + 1, j]
            data += record(struct.pack("<3i", j + 1, rows[0] + 1, 2 * len(entries)), entries.tobytes())
        data += record(struct.pack("<3id", n + 1, 1, 2, 1.0))
    return data


@pytest.mark.parametrize("form", ["binary", "dense", "sparse"])
def test_output4(form, tmp_path, chain):
    op4 = pytest.importorskip("pyNastran.op4.op4")
    path = tmp_path / "job.op4"
    matrices = {"KAA": chain.stiffness, "MAA": chain.mass, "K4AA": chain.stiffness}
    if form == "binary":
        path.write_bytes(binary_output4(matrices))
    else:
        kind = scipy.sparse.coo_matrix if form == "sparse" else np.asarray
        written = {name: (6, kind(matrix)) for name, matrix in matrices.items()}
        op4.OP4(debug=None).write_op4(str(path), written, is_binary=False)
    structure = so.read_structure(path, dofs=chain.labels)
    np.testing.assert_allclose(structure.stiffness.toarray(), chain.stiffness)
    np.testing.assert_allclose(structure.mass.toarray(), chain.mass)
    assert structure.damping is None
    data = path.read_bytes()
    for share in (0.1, 0.5, 0.9):
        path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(so.InputError, match=r"job\.op4") as caught:
            so.read_structure(path)
        assert "\n" not in str(caught.value)


def test_output2_that_is_none(tmp_path, capfd):
    pytest.importorskip("pyNastran.op4.op4")
    for data in (b"certainly no matrix", bytes(200), b""):
        (tmp_path / "job.op2").write_bytes(data)
        with pytest.raises(so.InputError, match=r"job\.op2") as caught:
            so.read_structure(tmp_path / "job.op2")
        assert "\n" not in str(caught.value)
    assert not capfd.readouterr().out


def test_without_pynastran_the_message_says_what_to_install(tmp_path, monkeypatch):
    ordinary = builtins.__import__

    def missing(name, *rest):
        if name.startswith("pyNastran"):
            raise ModuleNotFoundError(f"No module named {name!r}")
        return ordinary(name, *rest)

    monkeypatch.setattr(builtins, "__import__", missing)
    for suffix in (".op4", ".op2"):
        (tmp_path / f"job{suffix}").write_bytes(b"abc")
        with pytest.raises(so.InputError, match=r"pip install suboctave\[fe\]"):
            so.read_structure(tmp_path / f"job{suffix}")
    assert hasattr(np, "in1d") == hasattr(np, "trapz")  # what was added for the import is gone again


# ------------------------------------------------------------------------------------------------------------- punched
def wide(name, matrix, labels):
    """As Nastran punches: sixteen columns a field, exponents with D, the lower triangle by columns."""
    lines = [f"DMIG    {name:<8}{0:>8}{6:>8}{2:>8}{0:>8}{'':>8}{'':>8}{matrix.shape[0]:>8}"]
    for j, (node, direction) in enumerate(labels):
        lines.append(f"DMIG*   {name:<16}{node:>16}{DIRECTION[direction]:>16}{'':>16}")
        for i in np.flatnonzero(matrix[:, j]):
            if i >= j:
                number = f"{matrix[i, j]:.9E}".replace("E", "D")
                lines.append(f"*       {labels[i][0]:>16}{DIRECTION[labels[i][1]]:>16}{number:>16}")
    return lines


def narrow(name, matrix, labels):
    """Eight columns a field, two entries in a line, exponents without a letter."""
    lines = [f"DMIG    {name:<8}{0:>8}{1:>8}{1:>8}{0:>8}"]
    for j, (node, direction) in enumerate(labels):
        groups = [
            f"{labels[i][0]:>8}{DIRECTION[labels[i][1]]:>8}{f'{matrix[i, j] / 10:.1f}+1':>8}{'':>8}"
            for i in np.flatnonzero(matrix[:, j])
        ]
        lines.append(f"DMIG    {name:<8}{node:>8}{DIRECTION[direction]:>8}{'':>8}{groups[0]}")
        lines += [f"{'+':<8}" + "".join(groups[k : k + 2]) for k in range(1, len(groups), 2)]
    return lines


def free(name, matrix, labels):
    """Fields divided by commas."""
    lines = [f"DMIG,{name},0,6,2,0"]
    for j, (node, direction) in enumerate(labels):
        lines += [
            f"DMIG,{name},{node},{DIRECTION[direction]},,{labels[i][0]},{DIRECTION[labels[i][1]]},{matrix[i, j]}"
            for i in np.flatnonzero(matrix[:, j])
            if i >= j
        ]
    return lines


@pytest.mark.parametrize("form", [wide, narrow, free])
def test_punched_matrices_carry_their_labels(form, tmp_path, chain):
    lines = ["$ punched", *form("KAAX", chain.stiffness, chain.labels), *form("MAAX", chain.mass, chain.labels)]
    (tmp_path / "job.pch").write_text("\n".join(lines) + "\n")
    structure = so.read_structure(tmp_path / "job.pch", dofs=chain.labels)
    np.testing.assert_allclose(structure.stiffness.toarray(), chain.stiffness)
    np.testing.assert_allclose(structure.mass.toarray(), chain.mass)
    assert so.read_structure(tmp_path / "job.pch").dofs.labels[0] == (7, "x")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[: len(text) // 2], "ends within a line|named as a mass"),
        (lambda text: text[: len(text) // 2].rpartition("\n")[0] + "\n", "no matrix named as a mass|cut off"),
        (lambda text: text.replace("       6       2", "       6       4"), "KAAX is complex"),
        (lambda text: text.replace("       6       2", "       2       2"), "form 2; square"),
        (lambda text: text.replace("1042", "10x2"), "is no DMIG entry"),
        (lambda text: text.replace("8.000000000D+00", "8.00.000000D+00"), "is no DMIG entry"),
        (lambda text: "$ nothing\nGRID,1,,0.,0.,0.\n", "holds no DMIG matrix"),
    ],
)
def test_punched_matrices_that_are_wrong(change, message, tmp_path, chain):
    text = "\n".join([*wide("KAAX", chain.stiffness, chain.labels), *wide("MAAX", chain.mass, chain.labels)]) + "\n"
    (tmp_path / "job.pch").write_text(change(text))
    with pytest.raises(so.InputError, match=message) as caught:
        so.read_structure(tmp_path / "job.pch")
    assert "\n" not in str(caught.value)
