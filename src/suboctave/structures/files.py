"""Structures from files of other programs.

One file may hold all matrices (.npz, .mat, .h5, .op4, .op2, .pch, CalculiX' .sti), or there is one for each (.mtx of
Matrix Market and of Abaqus, Ansys' .matrix, SciPy's .npz, .npy). How each is read is in a module of its own. Files of
Matrix Market and Harwell-Boeing files are known by how they begin, whatever their ending is.
"""

from __future__ import annotations

import codecs
import gzip
import zlib
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

from suboctave.arguments import Title, checked
from suboctave.errors import InputError, damage, located, path_of, shortened, suggest
from suboctave.structures import (
    abaqus,
    calculix,
    harwell_boeing,
    hdf5,
    matlab,
    matrix_market,
    nastran,
    numpy_files,
    output2,
    output4,
)
from suboctave.structures.contents import Contents, chosen, matrix_of
from suboctave.structures.dof_map import DofMap, GivenLabels, direction_label, node_label
from suboctave.structures.mesh import Mesh
from suboctave.structures.structure import MatrixOrForm, Structure
from suboctave.structures.text_lines import text_of
from suboctave.structures.triplets import LabelledEntries, put_together

FileName: TypeAlias = str | PathLike[str]

_READERS: dict[str, tuple[str, Callable[[Path], Contents]]] = {
    ".npy": ("an array of NumPy", numpy_files.read_npy),
    ".npz": ("an archive of NumPy", numpy_files.read_npz),
    ".mtx": ("a matrix of Matrix Market", matrix_market.read_matrix_market),
    ".mat": ("a MATLAB file", matlab.read_matlab),
    ".h5": ("an HDF5 file", hdf5.read_hdf5),
    ".hdf5": ("an HDF5 file", hdf5.read_hdf5),
    ".op4": ("a Nastran OUTPUT4 file", output4.read_op4),
    ".op2": ("a Nastran OUTPUT2 file", output2.read_op2),
    ".pch": ("a Nastran punch file", nastran.read_punch),
    ".sti": ("matrices of CalculiX", calculix.read_calculix),
    ".mas": ("matrices of CalculiX", calculix.read_calculix),
    ".dof": ("matrices of CalculiX", calculix.read_calculix),
    ".matrix": ("a Harwell-Boeing file", harwell_boeing.read_harwell_boeing),
}
#: endings of files that matrices are read from
ENDINGS = tuple(_READERS)
#: bytes of a file that show how it begins
_BEGINNING = 1024


@checked
def read_structure(
    path: FileName | None = None,
    *,
    stiffness: FileName | None = None,
    mass: FileName | None = None,
    damping: MatrixOrForm = None,
    dofs: GivenLabels | DofMap | FileName | None = None,
    mesh: Mesh | None = None,
    name: Title | None = None,
    structural: MatrixOrForm = None,
) -> Structure:
    """A structure from one file with all matrices, or from one file for each.

    path
        The file with all of them: .npz, .mat, .h5, .op4, .op2, .pch, one of CalculiX' .sti, .mas and .dof, or one of
        Abaqus' job_STIF1.mtx and job_MASS1.mtx.
    stiffness, mass, damping, structural
        With `path`, the names of the matrices in it, where those are not M, K, C, K4 and the like. Without, a file
        each: .mtx (Matrix Market, Abaqus), .matrix (Ansys' HBMAT, with labels from its .mapping), .npz, .npy, .mat,
        .h5, .op4, .pch. `damping` may be `Rayleigh`,
        `ModalDamping` or a matrix also, `structural` a loss factor (a number) or a matrix.
    dofs
        Labels: a `DofMap`, pairs (node, direction), or a text file with node and direction in each line. Where the
        files have labels, these say in which order they are.
    mesh, name
        As those of `Structure`; the name is that of the file where none is given.

    Raises `InputError` for files that cannot be read, with what is wrong in one line.
    """
    given: dict[str, Any] = {"stiffness": stiffness, "mass": mass, "damping": damping, "structural": structural}
    in_files = {what: value for what, value in given.items() if isinstance(value, str | PathLike)}
    labels = _labels(dofs)
    more: dict[str, Any] = {}
    orders: dict[str, DofMap] = {}
    if path is None:
        missing = [what for what in ("mass", "stiffness") if given[what] is None]
        if missing:
            raise InputError(
                f"{missing[0]} is missing: give one file of all matrices, or mass= and stiffness=", (missing[0],)
            )
        files = {what: path_of(value) for what, value in in_files.items()}
        found, orders = _one_each(files)
    else:
        first = path_of(path)
        for what, value in in_files.items():
            if Path(value).suffix.lower() in _READERS:
                raise InputError(
                    f"{what}={str(value)!r} is a file, {first.name} too: give one file, or one for each", (what,)
                )
        files = abaqus.companions(first) if first.suffix.lower() in (".mtx", ".gz") and not in_files else {}
        if files:
            found, orders = _one_each(files)
        else:
            contents = _contents(first)
            found = chosen(contents.matrices, {what: str(value) for what, value in in_files.items()}, first.name)
            more, files = dict(contents.more), dict.fromkeys(found, first)
    found |= {what: value for what, value in given.items() if value is not None and what not in in_files}
    file_names = {what: file.name for what, file in files.items()}
    if any(isinstance(matrix, LabelledEntries) for matrix in found.values()):
        found, more["dofs"] = _labelled(found, file_names, labels)
    elif orders:
        found, more["dofs"] = _in_one_order(found, orders, file_names, labels)
    elif labels is not None:
        more["dofs"] = labels
    more |= {"mesh": mesh} if mesh is not None else {}
    more["name"] = name if name is not None else more.get("name") or next(iter(files.values())).name.partition(".")[0]
    return Structure(**{**more, **found})


def read_matrix(path: FileName, name: str | None = None) -> Any:
    """The matrix of a file, by its name where there are several.

    Raises `InputError` for files that cannot be read, and for names that are not in it.
    """
    file = path_of(path)
    matrices = _contents(file).matrices
    if name is None and len(matrices) != 1:
        raise InputError(f"{file.name} holds {', '.join(sorted(matrices)) or 'nothing'}: choose one with key=")
    if name is not None and name not in matrices:
        raise InputError(f"{file.name} holds no {name!r}{suggest(name, matrices)}")
    matrix = matrix_of(matrices, "matrix", next(iter(matrices)) if name is None else name, file.name)
    if isinstance(matrix, LabelledEntries):
        matrix = put_together({"matrix": matrix}, {"matrix": file.name}, None)[0]["matrix"]
    return matrix


def _one_each(files: Mapping[str, Path]) -> tuple[dict[str, Any], dict[str, DofMap]]:
    """The matrices of files, one in each; of a file with several, the one that is meant by its name. And the labels of
    those that have some beside their entries.
    """
    found: dict[str, Any] = {}
    orders: dict[str, DofMap] = {}
    for what, file in files.items():
        with located(what):
            contents = _contents(file)
            single = len(contents.matrices) == 1
            name = next(iter(contents.matrices)) if single else None
            found[what] = matrix_of(contents.matrices, what, name, file.name)
            if "dofs" in contents.more:
                dofs = contents.more["dofs"]
                orders[what] = dofs if isinstance(dofs, DofMap) else DofMap(dofs)
    return found, orders


def _in_one_order(
    found: dict[str, Any], orders: Mapping[str, DofMap], files: Mapping[str, str], labels: DofMap | None
) -> tuple[dict[str, Any], DofMap]:
    """Matrices in the order of labels that are given, else of the first file with some; others have its order."""
    first = next(iter(orders))
    order = orders[first] if labels is None else labels
    read = dict(found)
    for what in files:
        own = orders.get(what, orders[first])
        if found[what].shape != (len(own), len(own)):
            beside = f"{len(own)} labels belong to it"
            raise InputError(f"{files[what]} has {found[what].shape[0]} rows, and {beside}: do not mix models", (what,))
        alone = sorted(set(own.labels) ^ set(order.labels), key=str)
        if alone:
            node, direction = alone[0]
            other = "the labels given" if labels is not None else files[first]
            raise InputError(
                f"{files[what]} and {other} do not name the same DOFs: {node} {direction} is in one of them only",
                (what,),
            )
        if own.labels != order.labels:
            places = [own.index(*label) for label in order.labels]
            matrix = found[what].tocsr() if hasattr(found[what], "tocsr") else found[what]
            read[what] = matrix[places][:, places]
    return read, order


def _labelled(found: dict[str, Any], files: Mapping[str, str], labels: DofMap | None) -> tuple[dict[str, Any], Any]:
    """Matrices over the same labels; a damping that is no such is as it was."""
    entries = {what: matrix for what, matrix in found.items() if isinstance(matrix, LabelledEntries)}
    for what in ("mass", "stiffness"):
        if what not in entries:
            raise InputError(f"{files[what]} has no labels of DOFs, the other files have: they cannot be put together")
    matrices, order = put_together(entries, files, labels)
    return {**found, **matrices}, labels if labels is not None else order


def _contents(path: Path) -> Contents:
    """What a file holds; InputError for whatever is wrong with it."""
    what, reader = _reader_of(path)
    try:
        return reader(path)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes of its reader
        raise InputError(
            f"{path.name} cannot be read as {what}: it may be cut off, or be of another kind than its ending says "
            f"({damage(error)})"
        ) from None


def _reader_of(path: Path) -> tuple[str, Callable[[Path], Contents]]:
    """What a file is, and what reads it: by how it begins, or else by its ending."""
    if not path.is_file():
        beside = [file.name for file in path.parent.glob("*") if file.suffix.lower() in _READERS]
        raise InputError(f"there is no file {path}{suggest(path.name, beside)}")
    if not path.stat().st_size:
        raise InputError(f"{path.name} is empty")
    beginning, packed = _beginning_of(path), path.suffix.lower() == ".gz"
    suffix = (path.with_suffix("") if packed else path).suffix.lower()
    if beginning.lower().startswith(matrix_market.BEGINNING):
        return _READERS[".mtx"]
    if suffix == ".mtx":
        return "a matrix of Abaqus", abaqus.read_abaqus
    if suffix in _READERS and not packed:
        return _READERS[suffix]
    if harwell_boeing.is_harwell_boeing(beginning.decode("latin-1")):
        return _READERS[".matrix"]
    raise InputError(f"{path.name}: structures are read from {', '.join([*_READERS, '.mtx.gz'])} files")


def _beginning_of(path: Path) -> bytes:
    """How a file begins, without the mark of its code; nothing of a packed one that is damaged."""
    opening: Any = gzip.open if path.suffix.lower() == ".gz" else open
    try:
        with opening(path, "rb") as file:
            beginning: bytes = file.read(_BEGINNING)
    except (OSError, EOFError, zlib.error):
        return b""
    return beginning.removeprefix(codecs.BOM_UTF8)


def _labels(given: Any) -> DofMap | None:
    if given is None or isinstance(given, DofMap):
        return given
    with located("dofs"):
        if not isinstance(given, str | PathLike):
            return DofMap(given)
        path = path_of(given)
        if not path.is_file():
            raise InputError(f"there is no file {path}")
        text = text_of(path)
        if harwell_boeing.is_mapping(text):
            return DofMap(harwell_boeing.labels_of_mapping(text, path.name))
        pairs = []
        for number, line in enumerate(text.splitlines(), 1):
            words = line.replace(",", " ").split()
            if not words or words[0].startswith(("#", "%", "*")):
                continue
            if len(words) != 2:
                raise InputError(f"{path.name}, line {number}: node and direction, not {shortened(line)}")
            pairs.append((node_label(words[0]), direction_label(words[1])))
        return DofMap(pairs)
