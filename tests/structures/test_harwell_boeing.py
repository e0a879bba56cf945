"""Harwell-Boeing files: those of Ansys' HBMAT, written here line by line as it does, and those that SciPy writes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.io
import scipy.sparse

import suboctave as so
from suboctave.structures.files import read_matrix

#: of the first columns of numbers: one in a line as HBMAT writes them, several, several side by side without blanks
FORMATS = {
    "hbmat": (("(I14)", "(I14)", "(d25.15)"), (1, 1, 1), (14, 14, 25)),
    "several": (("(8I10)", "(8I10)", "(1P,3E25.16)"), (8, 8, 3), (10, 10, 25)),
    "tight": (("(26I3)", "(26I3)", "(4E22.15)"), (26, 26, 4), (3, 3, 22)),
}


def harwell_boeing(matrix, kind="RSA", how="hbmat", right=None):
    """A file of a matrix: its columns, of a symmetric one from the diagonal on."""
    formats, counts, widths = FORMATS[how]
    columns = scipy.sparse.csc_array(np.tril(matrix) if kind[1] == "S" else matrix)
    columns.sort_indices()
    letter = "E" if how == "several" else "D"
    digits = {"hbmat": 15, "several": 16, "tight": 14}[how]

    def numbers(values):
        values = np.stack([values.real, values.imag], axis=1).ravel() if np.iscomplexobj(values) else values
        return [f"{v:{widths[2]}.{digits}E}".replace("E", letter) for v in values]

    texts = [
        [f"{v + 1:{w}d}" for v in part] for part, w in zip((columns.indptr, columns.indices), widths, strict=False)
    ]
    texts += [numbers(columns.data), [] if right is None else numbers(right)]
    blocks = [
        ["".join(one[k : k + count]) for k in range(0, len(one), count)]
        for one, count in zip(texts, (*counts, counts[-1]), strict=True)
    ]
    rows, n = matrix.shape
    sizes = "".join(f"{len(block):14d}" for block in blocks)
    head = [
        "Stiffness matrix from ANSYS FULL file dumped into Harwell-Boeing format         ",
        f"{sum(map(len, blocks)):14d}{sizes}",
        f"{kind}           {rows:14d}{n:14d}{columns.nnz:14d}{0:14d}",
        f"{formats[0]:<16}{formats[1]:<16}{formats[2]:<20}{'' if right is None else formats[2]:<20}",
    ]
    if right is not None:
        head.append(f"F             {1:14d}{rows:14d}")
    return "\n".join(head + [line for block in blocks for line in block]) + "\n"


def mapping(labels):
    """Number of the equation, node, direction, as HBMAT writes them."""
    lines = ["    Matrix Eqn          Node    DOF     "]
    lines += [f"{i:14d}{node:14d}    {direction:<4}" for i, (node, direction) in enumerate(labels, 1)]
    return "\n".join(lines) + "\n"


def ansys(labels):
    return [(node, f"U{direction.upper()}") for node, direction in labels]


@pytest.mark.parametrize("how", FORMATS)
@pytest.mark.parametrize("right", [True, False])
@pytest.mark.parametrize("kind", ["RSA", "RUA", "rsa"])
def test_matrices_with_their_mappings(kind, right, how, tmp_path, chain):
    vector = np.arange(8.0) if right else None
    for what in ("mass", "stiffness"):
        text = harwell_boeing(getattr(chain, what), kind.upper(), how, vector).replace(kind.upper(), kind)
        (tmp_path / f"{what}.matrix").write_text(text)
        (tmp_path / f"{what}.mapping").write_text(mapping(ansys(chain.labels)))
    structure = so.read_structure(mass=tmp_path / "mass.matrix", stiffness=tmp_path / "stiffness.matrix")
    np.testing.assert_allclose(structure.mass.toarray(), chain.mass, rtol=1e-14)
    np.testing.assert_allclose(structure.stiffness.toarray(), chain.stiffness, rtol=1e-14)
    assert structure.dofs.labels == chain.labels
    assert structure.dof("1042 UZ") == 1


def test_the_order_of_one_matrix_may_be_another(tmp_path, chain):
    """Equations are put together by their labels; `dofs` says in which order."""
    order = [3, 1, 7, 5, 0, 2, 6, 4]
    (tmp_path / "m.matrix").write_text(harwell_boeing(chain.mass[np.ix_(order, order)]))
    (tmp_path / "m.mapping").write_text(mapping(ansys([chain.labels[i] for i in order])))
    (tmp_path / "k.matrix").write_text(harwell_boeing(chain.stiffness))
    (tmp_path / "K.MAPPING").write_text(mapping(ansys(chain.labels)))
    files = {"mass": tmp_path / "m.matrix", "stiffness": tmp_path / "k.matrix"}
    for dofs in (None, chain.labels, tmp_path / "K.MAPPING", [chain.labels[i] for i in order]):
        structure = so.read_structure(**files, dofs=dofs)
        places = [structure.dof(*label) for label in chain.labels]
        for what in ("mass", "stiffness"):
            read = getattr(structure, what).toarray()[np.ix_(places, places)]
            np.testing.assert_allclose(read, getattr(chain, what), rtol=1e-14)
    assert structure.dofs.labels == tuple(chain.labels[i] for i in order)


def test_one_mapping_is_enough_and_none_too(tmp_path, chain):
    """Under an ending of their own."""
    for what in ("mass", "stiffness"):
        (tmp_path / f"{what}.dat").write_text(harwell_boeing(getattr(chain, what), right=np.ones(8)))
    files = {what: tmp_path / f"{what}.dat" for what in ("mass", "stiffness")}
    assert so.read_structure(**files).dofs is None
    (tmp_path / "stiffness.mapping").write_text(mapping(ansys(chain.labels)))
    structure = so.read_structure(**files)
    assert structure.dofs.labels == chain.labels
    np.testing.assert_allclose(structure.mass.toarray(), chain.mass, rtol=1e-14)


def test_what_scipy_writes(tmp_path, chain):
    scipy.io.hb_write(tmp_path / "a.rua", scipy.sparse.csc_matrix(chain.stiffness))
    np.testing.assert_allclose(read_matrix(tmp_path / "a.rua").toarray(), chain.stiffness, rtol=1e-14)


def test_complex_ones_are_read_and_refused_as_a_stiffness(tmp_path, chain):
    (tmp_path / "k.matrix").write_text(harwell_boeing(chain.stiffness * (1 + 0.02j), "CSA"))
    (tmp_path / "m.matrix").write_text(harwell_boeing(chain.mass))
    np.testing.assert_allclose(read_matrix(tmp_path / "k.matrix").toarray(), chain.stiffness * (1 + 0.02j), rtol=1e-14)
    with pytest.raises(so.InputError, match="stiffness is complex"):
        so.read_structure(mass=tmp_path / "m.matrix", stiffness=tmp_path / "k.matrix")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[: len(text) // 2], "ends within a line"),
        (lambda text: text[: len(text) // 2].rpartition("\n")[0] + "\n", "where its header says"),
        (lambda text: text.replace("RSA", "RSE"), "by elements, not assembled"),
        (lambda text: text.replace("RSA", "PSA"), "a pattern without values"),
        (lambda text: text.replace("D+00", "D+0x"), "cannot be read as a Harwell-Boeing file"),
        (lambda text: text.replace("             1\n             ", "             1\n            9", 1), "k.matrix"),
        (lambda text: "\0" * 400 + text, "is no text, or is damaged: a byte 0 in line 1"),
        (lambda text: "binary\n", "write it by HBMAT with the form ASCII"),
        (lambda text: "", "is empty"),
    ],
)
def test_files_that_are_wrong(change, message, tmp_path, chain):
    text = harwell_boeing(chain.stiffness)
    (tmp_path / "k.matrix").write_text(change(text))
    with pytest.raises(so.InputError, match=message) as caught:
        read_matrix(tmp_path / "k.matrix")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.rpartition("             8")[0], "has 8 rows, k.mapping 7: they do not belong together"),
        (lambda text: text.replace("             8", "             9"), "does not number its 8 equations from 1 on"),
        (lambda text: text.replace("             8", "             7"), "line 9: the equation's number, node and dir"),
        (lambda text: text.replace("UZ", "U Z"), "line 3: the equation's number"),
        (lambda text: text.replace("1042", "  43"), "mapping and m.matrix|do not name the same DOFs: 1042 x is in one"),
    ],
)
def test_mappings_that_are_wrong(change, message, tmp_path, chain):
    for name, matrix in (("m", chain.mass), ("k", chain.stiffness)):
        (tmp_path / f"{name}.matrix").write_text(harwell_boeing(matrix))
        (tmp_path / f"{name}.mapping").write_text(mapping(ansys(chain.labels)))
    (tmp_path / "k.mapping").write_text(change(mapping(ansys(chain.labels))))
    with pytest.raises(so.InputError, match=message) as caught:
        so.read_structure(mass=tmp_path / "m.matrix", stiffness=tmp_path / "k.matrix")
    assert "\n" not in str(caught.value)
