"""Structures from files of other programs.

One file may hold all matrices (.npz, .mat, .h5, .op4, .op2, .pch, CalculiX' .sti), or there is one for each (.mtx of
Matrix Market and of Abaqus, SciPy's .npz, .npy). How each is read is in a module of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

from suboctave.errors import InputError, damage, located, path_of, shortened, suggest
from suboctave.structures import abaqus, calculix, hdf5, matlab, matrix_market, nastran, numpy_files, output2, output4
from suboctave.structures.contents import Contents, chosen, matrix_of
from suboctave.structures.dof_map import DofMap, direction_label, node_label
from suboctave.structures.mesh import Mesh
from suboctave.structures.structure import Structure
from suboctave.structures.text_lines import text_of
from suboctave.structures.triplets import LabelledEntries, put_together

FileName: TypeAlias = str | PathLike[str]

_READERS: dict[str, tuple[str, Callable[[Path], Contents]]] = {
    ".npz": ("an archive of NumPy", numpy_files.read_npz),
    ".npy": ("an array of NumPy", numpy_files.read_npy),
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
}


def read_structure(
    path: FileName | None = None,
    stiffness: FileName | None = None,
    mass: FileName | None = None,
    damping: Any = None,
    dofs: Any = None,
    mesh: Mesh | None = None,
    name: str | None = None,
    structural: Any = None,
) -> Structure:
    """A structure from one file with all matrices, or from one file for each.

    path
        The file with all of them: .npz, .mat, .h5, .op4, .op2, .pch, one of CalculiX' .sti, .mas and .dof, or one of
        Abaqus' job_STIF1.mtx and job_MASS1.mtx.
    stiffness, mass, damping, structural
        With `path`, the names of the matrices in it, where those are not M, K, C, K4 and the like. Without, a file
        each: .mtx (Matrix Market, Abaqus), .npz, .npy, .mat, .h5, .op4, .pch. `damping` may be `Rayleigh`,
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
    if path is None:
        missing = [what for what in ("mass", "stiffness") if given[what] is None]
        if missing:
            raise InputError(
                f"{missing[0]} is missing: give one file of all matrices, or mass= and stiffness=", (missing[0],)
            )
        files = {what: path_of(value) for what, value in in_files.items()}
        found = _one_each(files)
    else:
        first = path_of(path)
        for what, value in in_files.items():
            if Path(value).suffix.lower() in _READERS:
                raise InputError(
                    f"{what}={str(value)!r} is a file, {first.name} too: give one file, or one for each", (what,)
                )
        files = abaqus.companions(first) if first.suffix.lower() in (".mtx", ".gz") and not in_files else {}
        if files:
            found = _one_each(files)
        else:
            contents = _contents(first)
            found = chosen(contents.matrices, {what: str(value) for what, value in in_files.items()}, first.name)
            more, files = dict(contents.more), dict.fromkeys(found, first)
    found |= {what: value for what, value in given.items() if value is not None and what not in in_files}
    file_names = {what: file.name for what, file in files.items()}
    if any(isinstance(matrix, LabelledEntries) for matrix in found.values()):
        found, more["dofs"] = _labelled(found, file_names, labels)
    elif labels is not None:
        more["dofs"] = labels
    more |= {"mesh": mesh} if mesh is not None else {}
    more["name"] = name if name is not None else more.get("name") or next(iter(files.values())).name.partition(".")[0]
    return Structure(**{**more, **found})


def _one_each(files: Mapping[str, Path]) -> dict[str, Any]:
    """The matrices of files, one in each; of a file with several, the one that is meant by its name."""
    found: dict[str, Any] = {}
    for what, file in files.items():
        with located(what):
            matrices = _contents(file).matrices
            single = len(matrices) == 1
            found[what] = matrix_of(matrices, what, next(iter(matrices)) if single else None, file.name)
    return found


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
    suffix = path.with_suffix("").suffix.lower() if path.suffix.lower() == ".gz" else path.suffix.lower()
    if suffix not in _READERS or (path.suffix.lower() == ".gz" and suffix != ".mtx"):
        known = ", ".join([*_READERS, ".mtx.gz"])
        raise InputError(f"{path.name}: structures are read from {known} files")
    if not path.is_file():
        beside = [file.name for file in path.parent.glob("*") if file.suffix.lower() in _READERS]
        raise InputError(f"there is no file {path}{suggest(path.name, beside)}")
    if not path.stat().st_size:
        raise InputError(f"{path.name} is empty")
    what, reader = _READERS[suffix]
    try:
        if suffix == ".mtx" and not _is_matrix_market(path):
            what, reader = "a matrix of Abaqus", abaqus.read_abaqus
        return reader(path)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes of its reader
        raise InputError(
            f"{path.name} cannot be read as {what}: it may be cut off, or be of another kind than its ending says "
            f"({damage(error)})"
        ) from None


def _is_matrix_market(path: Path) -> bool:
    import gzip

    opening: Any = gzip.open if path.suffix.lower() == ".gz" else open
    with opening(path, "rb") as file:
        return bool(file.read(2) == b"%%")


def _labels(given: Any) -> DofMap | None:
    if given is None or isinstance(given, DofMap):
        return given
    with located("dofs"):
        if not isinstance(given, str | PathLike):
            return DofMap(given)
        path = path_of(given)
        if not path.is_file():
            raise InputError(f"there is no file {path}")
        pairs = []
        for number, line in enumerate(text_of(path).splitlines(), 1):
            words = line.replace(",", " ").split()
            if not words or words[0].startswith(("#", "%", "*")):
                continue
            if len(words) != 2:
                raise InputError(f"{path.name}, line {number}: node and direction, not {shortened(line)}")
            pairs.append((node_label(words[0]), direction_label(words[1])))
        return DofMap(pairs)
