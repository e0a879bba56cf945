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
