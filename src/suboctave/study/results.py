"""What a study leaves: branches, diagrams, isolas, tables and results of time integration by name; and `load`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suboctave.arguments import checked
from suboctave.atomic import free_place
from suboctave.errors import InputError, UnknownName, shortened, suggest
from suboctave.experiments.common import TimeResult
from suboctave.harmonic.linear_part import LinearPart
from suboctave.maps.isolas.map import IsolaMap
from suboctave.maps.isolas.result import Isolas
from suboctave.maps.regimes.map import RegimeMap
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.store import files, registry
from suboctave.store.table import Table
from suboctave.study.sweeps.result import Sweep
from suboctave.verification import BranchVerification

if TYPE_CHECKING:
    import xarray


#: what an analysis gives
Result = Branch | BifurcationDiagram | Isolas | Table
#: what may be saved besides
Saved = Result | TimeResult | BranchVerification | IsolaMap | RegimeMap | Sweep


@checked(result=True)
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
        if not isinstance(name, str) or name not in self.items_by_name:
            raise UnknownName(f"there is no analysis {shortened(name)}{suggest(str(name), self.items_by_name)}")
        return self.items_by_name[name]

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
        target = free_place(path, overwrite, (".nc",))
        wrong = [name for name in self if not name or "/" in name or name == "."]
        if wrong:
            raise InputError(f"an analysis cannot be called {wrong[0]!r}: names are groups of the file, no slashes")
        groups = {
            f"{name}/{part}" if part else name: dataset
            for name, item in self.items()
            for part, dataset in registry.to_datasets(item, self.details.get(name, {})).items()
        }
        files.write(target, groups, {"contents": "study", **registry.provenance(), **self.attributes})
        return target

    def __repr__(self) -> str:
        title = self.attributes.get("title") or "untitled"
        lines = [f"Results of the study {title!r}:"]
        for name, item in self.items():
            lines.append(f"  {name}: {_summary(item)}")
        return "\n".join(lines)


def _summary(item: Result) -> str:
    if isinstance(item, Table):
        return "table"
    if isinstance(item, Isolas):
        curves = len(item.limit_points) + len(item.doublings)
        return f"{len(item)} isola{'s' * (len(item) != 1)} over {item.parameter}, {curves} curves"
    what = "points" if isinstance(item, Branch) else "branches"
    return f"{len(item)} {what}, {len(item.bifurcations)} bifurcations"


@checked
def load(path: str | Path, *, allow_code: bool = False, linear: LinearPart | None = None) -> Saved | Results:
    """Read a results file: what was saved there, a branch, diagram, map, sweep, ..., or the `Results` of a study.

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
    read: dict[str, tuple[Any, dict[str, Any]]] = {}
    try:
        if root.attrs.get("contents") in registry.CODECS:
            item: Saved = registry.from_datasets(groups, allow_code, linear)[0]
            return item
        analyses: dict[str, dict[str, xarray.Dataset]] = {}  # "diagram" and "diagram/branch_0" are parts of one
        for place, dataset in groups.items():
            name, _, part = place.partition("/")
            if name:
                analyses.setdefault(name, {})[part] = dataset
        for name, parts in analyses.items():
            item, details = registry.from_datasets(parts, allow_code, linear)
            read[name] = item.to_table() if isinstance(item, TimeResult) else item, details
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    order = str(root.attrs.get("analyses", "")).splitlines()
    names = sorted(read, key=lambda name: order.index(name) if name in order else len(order))
    attributes = {str(name): value for name, value in root.attrs.items()}
    return Results({n: read[n][0] for n in names}, attributes, {n: read[n][1] for n in names})
