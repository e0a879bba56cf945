"""What `find_isolas` gives: the isolas over a design parameter, and the curves that were followed on the way."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from suboctave.analysis.branch import Branch
from suboctave.analysis.isola import Isola
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.interruption import Interruption, limited
from suboctave.model.system import System

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["Isolas"]


class Isolas(Sequence[Isola]):
    """Isolas in the order of the values at which they are born, and what was learnt on the way.

    Attributes
    ----------
    system, parameter, bounds, omega
        What was asked.
    limit_points, doublings
        All curves of limit points and of period doublings that were followed, in (omega, parameter).
    notes
        What could not be settled; empty if nothing was left open.
    interruption
        What stopped the search, Ctrl-C or a time limit (`seconds`); None if it came to its end.
    """

    def __init__(
        self,
        isolas: Iterable[Isola],
        system: System,
        parameter: str,
        bounds: tuple[float, float],
        omega: tuple[float, float],
        limit_points: Sequence[TrackedBranch] = (),
        doublings: Sequence[TrackedBranch] = (),
        notes: Iterable[str] = (),
        said: str = "",
        interruption: Interruption | None = None,
    ) -> None:
        self._items = tuple(sorted(isolas, key=_birth))
        self.system = system
        self.parameter = parameter
        self.bounds = bounds
        self.omega = omega
        self.limit_points = tuple(limit_points)
        self.doublings = tuple(doublings)
        self.notes = tuple(notes)
        self.said = said
        self.interruption = interruption
        self.seconds = float("nan")

    def __len__(self) -> int:
        return len(self._items)

    @overload
    def __getitem__(self, which: int) -> Isola: ...
    @overload
    def __getitem__(self, which: slice) -> tuple[Isola, ...]: ...
    def __getitem__(self, which: int | slice) -> Isola | tuple[Isola, ...]:
        return self._items[which]

    def __iter__(self) -> Iterator[Isola]:
        return iter(self._items)

    @limited
    def at(self, value: float, *, seconds: float | None = None) -> list[Branch]:
        """The closed branches that exist at a value of the parameter; `seconds`: time limit of all of them."""
        found: list[Branch] = []
        for isola in self:
            if value in isola and not (found and found[-1].interrupted):
                found.append(isola.at(value))
        return found

    @property
    def plane(self) -> tuple[str, str]:
        """The two parameters of its curves: omega and the design parameter."""
        return "omega", self.parameter

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C or a time limit stopped the search."""
        return self.interruption is not None

    def noting(self, notes: Iterable[str], interruption: Interruption | None = None) -> Isolas:
        """The same with more that could not be settled, and with what stopped it."""
        self.notes = (*self.notes, *notes)
        self.interruption = self.interruption or interruption
        return self

    def to_dataframe(self) -> pandas.DataFrame:
        """One row for each isola: period, range, where it is born and merges, and the frequencies there."""
        from suboctave.analysis.isola_tables import isolas_frame

        return isolas_frame(self)

    def to_csv(self, path: str | Path, what: str = "isolas", overwrite: bool = False) -> Path:
        """The table of the "isolas", or the "points" or "bifurcations" of all curves, as comma-separated text (.csv).

        Curves of limit points come before those of period doublings; the column `curve` numbers them.
        """
        from suboctave.analysis.isola_tables import isolas_csv

        return isolas_csv(self, path, what, overwrite)

    def to_xarray(self, readings: Iterable[str] | bool = False) -> dict[str, xarray.Dataset]:
        """Datasets by name: "isolas" (one entry each, and their edges), all curves, the closed branches known.

        `suboctave.store.isolas` describes the first, `Branch.to_xarray` the others.
        """
        from suboctave.analysis.isola_tables import isolas_datasets

        return isolas_datasets(self, readings)

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """All of it as a NetCDF file (.nc), from which `load` gives it back (layout: docs/results.md).

        Raises
        ------
        InputError
            If the file exists and `overwrite` is not given, or cannot be written there.
        """
        from suboctave.analysis.results import save

        return save(self, path, overwrite)

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Draw the curves over omega and the parameter, with each isola's region; options as of `suboctave.plot`."""
        from suboctave.pictures import plot

        return plot(self, path, **options)

    def __repr__(self) -> str:
        text = self.said
        for isola in self:
            text += "\n" + repr(isola)
        for note in self.notes:
            text += f"\nnote: {note}"
        return text


def _birth(isola: Isola) -> tuple[bool, float]:
    """What isolas are sorted by: the value at which one is born; behind all these, the upper end of its range."""
    return isola.born is None, isola.range[1] if isola.born is None else isola.born
