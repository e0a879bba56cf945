"""What a study leaves: branches, diagrams, isolas, tables and results of time integration by name; and `load`."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.analysis.branch import Branch
from suboctave.analysis.isolas_found import Isolas
from suboctave.analysis.saved import branch_from_dataset, branch_to_dataset
from suboctave.analysis.saved_diagram import diagram_from_datasets, diagram_to_datasets
from suboctave.analysis.saved_isolas import isolas_from_datasets, isolas_to_datasets
from suboctave.analysis.saved_time import TIME_CONTENTS, time_result_from_datasets, time_result_to_datasets
from suboctave.analysis.time_result import TimeResult
from suboctave.analysis.tree import BifurcationDiagram
from suboctave.errors import InputError, suggest
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.store import files
from suboctave.store.arrays import array_of, flat
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["Result", "Results", "Table", "from_datasets", "load", "provenance", "save", "to_datasets"]

#: what a group of a file may hold
_BRANCH, _TABLE, _DIAGRAM, _ISOLAS = "branch", "table", "diagram", "isolas"
#: the part of a table that holds what the table was taken from
_WHOLE = "result"


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers and texts in named columns, (rows,) each: what analyses give that are no curves. `title` says of what.

    `result`: what the table was taken from (basins, a stepped-sine test, ...), saved with it; None if that is all.
    `stopped`: what stopped the analysis before its end, where there is no `result` that says so.
    """

    columns: Mapping[str, np.ndarray]
    title: str = ""
    result: TimeResult | None = None
    stopped: Interruption | None = None

    @property
    def interruption(self) -> Interruption | None:
        """What stopped the analysis before its end, Ctrl-C or a time limit; None if nothing did."""
        return self.stopped if self.result is None else self.result.interruption

    def __len__(self) -> int:
        return max((len(column) for column in self.columns.values()), default=0)

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.columns:
            raise InputError(f"the table has no column {name!r}{suggest(name, self.columns)}")
        return self.columns[name]

    def to_xarray(self) -> xarray.Dataset:
        """The columns as variables on the dimension `row`."""
        import xarray

        return xarray.Dataset(
            {name: ("row", column) for name, column in self.columns.items()}, attrs={"title": self.title}
        )

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per row."""
        import pandas as pd

        return pd.DataFrame(dict(self.columns))

    def to_csv(self, path: str | Path, overwrite: bool = False) -> Path:
        """The table as comma-separated text; a file that exists is left alone unless `overwrite`."""
        return write_csv(self.to_dataframe(), path, overwrite)

    def __repr__(self) -> str:
        return f"Table: {self.title or 'untitled'}, {len(self)} rows\n{self.to_dataframe().to_string()}"


#: what an analysis gives
Result = Branch | BifurcationDiagram | Isolas | Table


@dataclass(frozen=True, eq=False)
class Results(Mapping[str, Result]):
    """The results of a study by the names of its analyses, in their order.

    `attributes`: title, version, platform, time, the study's text; `details`: the same for each analysis (its kind, the
    seconds that it took).
    """

    items_by_name: Mapping[str, Result]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    details: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Result:
        if name not in self.items_by_name:
            raise InputError(f"there is no analysis {name!r}{suggest(str(name), self.items_by_name)}")
        return self.items_by_name[name]

    def __contains__(self, name: object) -> bool:
        return name in self.items_by_name

    def __iter__(self) -> Iterator[str]:
        return iter(self.items_by_name)

    def __len__(self) -> int:
        return len(self.items_by_name)

    @property
    def branches(self) -> dict[str, Branch]:
        """The curves among the results; those of diagrams are in the diagrams."""
        return {name: item for name, item in self.items_by_name.items() if isinstance(item, Branch)}

    @property
    def diagrams(self) -> dict[str, BifurcationDiagram]:
        """The bifurcation diagrams among the results."""
        return {name: item for name, item in self.items_by_name.items() if isinstance(item, BifurcationDiagram)}

    @property
    def isolas(self) -> dict[str, Isolas]:
        """The isolas among the results, by analysis."""
        return {name: item for name, item in self.items_by_name.items() if isinstance(item, Isolas)}

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """All of it as one NetCDF file (.nc), a group for each analysis; docs/results.md describes the layout.

        Raises InputError where the file exists and `overwrite` is not given, or cannot be written.
        """
        target = files.free_place(path, overwrite, (".nc",))
        wrong = [name for name in self if not name or "/" in name or name == "."]
        if wrong:
            raise InputError(f"an analysis cannot be called {wrong[0]!r}: names are groups of the file, no slashes")
        groups = {
            f"{name}/{part}" if part else name: dataset
            for name, item in self.items()
            for part, dataset in to_datasets(item, self.details.get(name, {})).items()
        }
        files.write(target, groups, {"contents": "study", **provenance(), **self.attributes})
        return target

    def __repr__(self) -> str:
        title = self.attributes.get("title") or "untitled"
        lines = [f"Results of the study {title!r}:"]
        for name, item in self.items():
            lines.append(f"  {name}: {_said(item)}")
        return "\n".join(lines)


def _said(item: Result) -> str:
    if isinstance(item, Table):
        return "table"
    if isinstance(item, Isolas):
        curves = len(item.limit_points) + len(item.doublings)
        return f"{len(item)} isola{'s' * (len(item) != 1)} over {item.parameter}, {curves} curves"
    what = "points" if isinstance(item, Branch) else "branches"
    return f"{len(item)} {what}, {len(item.bifurcations)} bifurcations"


def provenance() -> dict[str, str]:
    """What a file says of its origin: version, interpreter, platform, time."""
    return {
        "suboctave": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "platform": platform.platform(),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def to_datasets(item: Result | TimeResult, details: Mapping[str, Any] | None = None) -> dict[str, xarray.Dataset]:
    """A result as datasets that a file or the journal can hold, `details` among the attributes of the one named "".

    A branch is one dataset; a diagram has one more for each of its branches, isolas one for each curve, a table those
    of the result that it was taken from. The attribute `parts` of tables, isolas and verifications names them.
    """
    said = dict(details or {})
    if isinstance(item, Branch):
        return {"": branch_to_dataset(item).assign_attrs({**said, "contents": _BRANCH})}
    if isinstance(item, Table):
        return _table_to_datasets(item, said)
    if isinstance(item, TimeResult):
        parts, contents = time_result_to_datasets(item), None
    elif isinstance(item, BifurcationDiagram):
        parts, contents = diagram_to_datasets(item), _DIAGRAM
    else:
        parts, contents = isolas_to_datasets(item), _ISOLAS
    head, *branches = parts.items()
    told = {"": head[1].assign_attrs(said | ({} if contents is None else {"contents": contents}))}
    return told | {name: dataset.assign_attrs({"contents": _BRANCH}) for name, dataset in branches}


def _table_to_datasets(table: Table, said: Mapping[str, Any]) -> dict[str, xarray.Dataset]:
    import xarray

    found = table.to_xarray()
    held = flat({name: (variable.dims, variable.values) for name, variable in found.variables.items()})
    order = "\n".join(table.columns)
    dataset = xarray.Dataset(dict(held), attrs={**found.attrs, **said, "contents": _TABLE, "columns": order})
    if table.result is None:
        return {"": dataset}
    whole = to_datasets(table.result)
    parts = {f"{_WHOLE}/{name}" if name else _WHOLE: part for name, part in whole.items()}
    return {"": dataset.assign_attrs(parts="\n".join(parts))} | parts


def from_datasets(
    groups: Mapping[str, xarray.Dataset], allow_code: bool = False, linear: LinearPart | None = None
) -> tuple[Result | TimeResult, dict[str, Any]]:
    """The result that `to_datasets` wrote, and the attributes of the dataset named ""."""
    dataset = groups[""]
    details = {str(name): _plain(value) for name, value in dataset.attrs.items()}
    contents = details.get("contents")
    if contents == _BRANCH:
        return branch_from_dataset(dataset, allow_code, linear), details
    if contents == _DIAGRAM:
        return diagram_from_datasets(groups, allow_code, linear), details
    if contents == _ISOLAS:
        return isolas_from_datasets(groups, allow_code, linear), details
    if contents in TIME_CONTENTS:
        return time_result_from_datasets(groups, allow_code, linear), details
    if contents != _TABLE:
        raise InputError(f"a part of the file holds {contents!r}, which this version does not know")
    columns = {name: array_of(dataset, name) for name in str(details.get("columns", "")).splitlines()}
    result = None
    if "parts" in details:
        missing = [name for name in str(details["parts"]).splitlines() if name not in groups]
        if missing:
            raise InputError(f"{missing[0]} of the table is missing")
        whole = {
            name.removeprefix(_WHOLE).removeprefix("/"): groups[name] for name in str(details["parts"]).splitlines()
        }
        result = time_result_from_datasets(whole, allow_code, linear)
    return Table(columns, str(details.get("title", "")), result), details


def save(item: Branch | BifurcationDiagram | Isolas | TimeResult, path: str | Path, overwrite: bool = False) -> Path:
    """One branch or diagram, isolas, or a result of time integration, as a NetCDF file (.nc) of its own."""
    target = files.free_place(path, overwrite, (".nc",))
    files.write(target, to_datasets(item), provenance())
    return target


def load(
    path: str | Path, *, allow_code: bool = False, linear: LinearPart | None = None
) -> Branch | BifurcationDiagram | Isolas | TimeResult | Results:
    """Read a results file: the branch, diagram, isolas or result in time that were saved, or the `Results` of a study.

    Parameters
    ----------
    path
        A NetCDF file that suboctave wrote.
    allow_code
        Import the modules of a user's own elements and functions that the file names. Classes that are already defined
        are found without it.
    linear
        The linear part that the curves were computed with, where that was not the system's own matrices.

    Raises
    ------
    InputError
        If the file is missing, no results file, damaged, or of a newer version; the message says what to do.
    """
    groups = files.read(path)
    root = groups[""]
    read: dict[str, tuple[Result, dict[str, Any]]] = {}
    try:
        if root.attrs.get("contents") in (_BRANCH, _DIAGRAM, _ISOLAS, *TIME_CONTENTS):
            item, _ = from_datasets(groups, allow_code, linear)
            assert not isinstance(item, Table)
            return item
        for name, parts in _by_analysis(groups).items():
            item, details = from_datasets(parts, allow_code, linear)
            read[name] = item.to_table() if isinstance(item, TimeResult) else item, details
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    order = str(root.attrs.get("analyses", "")).splitlines()
    names = sorted(read, key=lambda name: order.index(name) if name in order else len(order))
    attributes = {str(name): _plain(value) for name, value in root.attrs.items()}
    return Results({n: read[n][0] for n in names}, attributes, {n: read[n][1] for n in names})


def _by_analysis(groups: Mapping[str, xarray.Dataset]) -> dict[str, dict[str, xarray.Dataset]]:
    """The groups of a study's file by analysis: "diagram" and "diagram/branch_0" are parts of one."""
    found: dict[str, dict[str, xarray.Dataset]] = {}
    for path, dataset in groups.items():
        name, _, part = path.partition("/")
        if name:
            found.setdefault(name, {})[part] = dataset
    return found


def write_csv(frame: pandas.DataFrame, path: str | Path, overwrite: bool = False) -> Path:
    """A table as comma-separated text, all digits kept."""
    target = files.free_place(path, overwrite, (".csv",))
    files.replace_file(target, lambda place: frame.to_csv(place, index=False, float_format="%.17g"))
    return target


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
