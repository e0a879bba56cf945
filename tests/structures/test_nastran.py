"""Matrices of Nastran, punched as DMIG entries."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so

DIRECTION = {"x": 1, "z": 3}


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
        (lambda text: text.replace("       6       2", "       6       4"), "[KM]AAX is complex"),
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


def load(name, form, labels):
    """A vector of forces, as Nastran punches P2G: form 9, its column a number without a component."""
    lines = [f"DMIG    {name:<8}{0:>8}{form:>8}{2:>8}{0:>8}{'':>8}{'':>8}{1:>8}"]
    lines.append(f"DMIG*   {name:<16}{1:>16}{0:>16}{'':>16}")
    lines += [f"*       {node:>16}{DIRECTION[direction]:>16}{'1.500000000D+00':>16}" for node, direction in labels]
    return lines


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("form", [2, 9])
@pytest.mark.parametrize("names", [{}, {"mass": "MAAX", "stiffness": "KAAX"}])
def test_a_load_beside_them_is_in_nobodys_way(names, form, first, tmp_path, chain):
    matrices = [*wide("KAAX", chain.stiffness, chain.labels), *wide("MAAX", chain.mass, chain.labels)]
    forces = load("P2G", form, chain.labels)
    (tmp_path / "job.pch").write_text("\n".join(forces + matrices if first else matrices + forces) + "\n")
    structure = so.read_structure(tmp_path / "job.pch", **names, dofs=chain.labels)
    np.testing.assert_allclose(structure.stiffness.toarray(), chain.stiffness)
    np.testing.assert_allclose(structure.mass.toarray(), chain.mass)
    with pytest.raises(so.InputError, match=f"P2G is a matrix of form {form}; square") as caught:
        so.read_structure(tmp_path / "job.pch", stiffness="P2G", mass="MAAX")
    assert caught.value.key == ("stiffness",)


def test_so_is_a_complex_matrix(tmp_path, chain):
    """Its entries have an imaginary part in the last field."""
    lines = [
        line.ljust(72) + "1.0" if line.startswith("*  ") else line for line in wide("KC", chain.stiffness, chain.labels)
    ]
    lines = [lines[0].replace("       6       2", "       6       4"), *lines[1:]]
    lines += [*wide("KAAX", chain.stiffness, chain.labels), *wide("MAAX", chain.mass, chain.labels)]
    (tmp_path / "job.pch").write_text("\n".join(lines) + "\n")
    structure = so.read_structure(tmp_path / "job.pch", dofs=chain.labels)
    np.testing.assert_allclose(structure.stiffness.toarray(), chain.stiffness)
    with pytest.raises(so.InputError, match="KC is complex"):
        so.read_structure(tmp_path / "job.pch", stiffness="KC")


def test_titles_in_other_code_pages(tmp_path, chain):
    lines = ["$TITLE   = Träger", *wide("KAAX", chain.stiffness, chain.labels), *wide("MAAX", chain.mass, chain.labels)]
    (tmp_path / "job.pch").write_bytes(("\n".join(lines) + "\n").encode("latin-1"))
    np.testing.assert_allclose(so.read_structure(tmp_path / "job.pch", dofs=chain.labels).mass.toarray(), chain.mass)
