"""What `find_isolas` gives: the isolas over a design parameter, and the curves that were followed on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from suboctave.curves.junction import period_name
from suboctave.errors import InputError, suggest
from suboctave.interruption import Interruption, limited
from suboctave.maps.isolas.isola import Isola, edges_of, isola_row
from suboctave.model.system import System
from suboctave.results.branch import Branch
from suboctave.results.readings.readings import shared
from suboctave.results.tracked_branch import TrackedBranch
from suboctave.store.columns import led_by
from suboctave.store.isolas import isolas_dataset
from suboctave.store.registry import save
from suboctave.store.table import write_csv

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["Isolas", "head_dataset"]


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
    summary
        The outcome in one sentence.
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
        summary: str = "",
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
        self.summary = summary
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
        branches: list[Branch] = []
        for isola in self:
            if value in isola and not (branches and branches[-1].interrupted):
                branches.append(isola.at(value))
        return branches

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
        import pandas

        rows = []
        for isola in self:
            row = isola_row(isola)
            ends: dict[str, Any] = {"period": period_name(isola.nu), "from": row["from"], "to": row["to"]}
            for word in ("born", "merges"):
                ends |= {f"{word} {self.parameter}": row[word], f"{word} omega": row[f"{word}_omega"]}
            rows.append(ends)
        return pandas.DataFrame(rows)

    def to_csv(self, path: str | Path, what: str = "isolas", overwrite: bool = False) -> Path:
        """The table of the "isolas", or the "points" or "bifurcations" of all curves, as comma-separated text (.csv).

        Curves of limit points come before those of period doublings; the column `curve` numbers them.
        """
        makers: dict[str, Callable[[], pandas.DataFrame]] = {
            "isolas": self._complete_frame,
            "points": lambda: self._joined([curve.to_dataframe() for curve in self._curves]),
            "bifurcations": lambda: self._joined([curve.bifurcations_frame() for curve in self._curves]),
        }
        if what not in makers:
            raise InputError(f"to_csv writes isolas, points or bifurcations, not {what!r}{suggest(str(what), makers)}")
        return write_csv(makers[what](), path, overwrite)

    @property
    def _curves(self) -> tuple[TrackedBranch, ...]:
        return (*self.limit_points, *self.doublings)

    def _complete_frame(self) -> pandas.DataFrame:
        """The table with what happens at the ends, and the notes."""
        rows = [isola_row(isola) for isola in self]
        return self.to_dataframe().assign(**{name: [r[name] for r in rows] for name in ("at_from", "at_to", "notes")})

    def _joined(self, frames: Sequence[pandas.DataFrame]) -> pandas.DataFrame:
        import pandas

        full = [
            led_by(frame, {"curve": number, "of": curve.kind, "nu": curve.nu})
            for number, (curve, frame) in enumerate(zip(self._curves, frames, strict=True))
            if len(frame)
        ]
        return pandas.concat(full, ignore_index=True) if full else pandas.DataFrame({"curve": []})

    def to_xarray(self, readings: Iterable[str] | bool = False) -> dict[str, xarray.Dataset]:
        """Datasets by name: "isolas" (one entry each, and their edges), all curves, the closed branches known.

        `suboctave.store.isolas` describes the first, `Branch.to_xarray` the others.
        """
        words = {"LP": "limit points", "PD": "period doublings"}
        named: dict[str, tuple[Branch, dict[str, Any]]] = {
            f"{number}: {words[curve.kind]} of {period_name(curve.nu)}": (curve, {})
            for number, curve in enumerate(self._curves)
        }
        for number, isola in enumerate(self):
            which = f"isola {number}" if len(self) > 1 else "isola"
            for value, branch in isola.known.items():
                named[f"{which} at {self.parameter} = {value:.6g}"] = (branch, {"isola": number, "at": value})
        chosen = shared(readings, [branch.nu for branch, _ in named.values()])
        return {"isolas": head_dataset(self)} | {
            name: branch.to_xarray(names).assign_attrs(attributes)
            for (name, (branch, attributes)), names in zip(named.items(), chosen, strict=True)
        }

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """All of it as a NetCDF file (.nc), from which `load` gives it back (layout: docs/results.md).

        Raises
        ------
        InputError
            If the file exists and `overwrite` is not given, or cannot be written there.
        """
        return save(self, path, overwrite)

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Draw the curves over omega and the parameter, with each isola's region; options as of `suboctave.plot`."""
        from suboctave.pictures import plot

        return plot(self, path, **options)

    def __repr__(self) -> str:
        text = self.summary
        for isola in self:
            text += "\n" + repr(isola)
        for note in self.notes:
            text += f"\nnote: {note}"
        return text


def _birth(isola: Isola) -> tuple[bool, float]:
    """What isolas are sorted by: the value at which one is born; behind all these, the upper end of its range."""
    return isola.born is None, isola.range[1] if isola.born is None else isola.born


def head_dataset(isolas: Isolas) -> xarray.Dataset:
    """The isolas themselves as `store.isolas` lays them out."""
    closed = [(number, value) for number, isola in enumerate(isolas) for value in isola.known]
    return isolas_dataset(
        [isola_row(isola) for isola in isolas],
        [edges_of(isola) for isola in isolas],
        closed,
        {
            "isolas": isolas.parameter,
            "bounds_low": isolas.bounds[0],
            "bounds_high": isolas.bounds[1],
            "omega_low": isolas.omega[0],
            "omega_high": isolas.omega[1],
            "said": isolas.summary,
            "notes": "\n".join(isolas.notes),
            "system": isolas.system.name,
        },
    )
