"""What a sweep gives: one labelled dataset over its parameters, its tables and its files."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.arguments import checked
from suboctave.errors import InputError, suggest
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.pictures.cells import Pictured
from suboctave.store.layout import parameter_column
from suboctave.store.registry import Codec, Datasets, Stored, register
from suboctave.store.table import Table, write_csv
from suboctave.study.sweeps.quantities import Row

if TYPE_CHECKING:
    import pandas
    import xarray

#: names of a dataset that no parameter can have
OWN = ("failure", "seconds", "point", "event", "isola", "row")
#: what `failure` says of a point that has not been computed
MISSING = "not computed"
#: quantities that are drawn unless they are named
_DRAWN = 4
#: how names of quantities end that say how a curve was computed, and of the others those that say most of a design
_OF_COMPUTING = ("points", "regular", "closed", "residual", "neglected", "unsettled", "rows", "branches")
_TELLING = ("isolas", "peak_amplitude", "longest_period", "LP", "PD", "NS", "BP", "peak_omega", "unstable_share")
#: different failures that are printed
_SHOWN = 5


@dataclass(frozen=True)
class Computed:
    """What came of one point: its quantities, in words what failed (empty: nothing), the seconds that it took."""

    row: Row
    failure: str = ""
    seconds: float = float("nan")


@checked(result=True)
@dataclass(eq=False, repr=False)
class Sweep(Stored, Pictured):
    """A study at many values of its parameters.

    Attributes
    ----------
    dataset
        All of it (`to_xarray`): a grid has its parameters as dimensions, a list and draws have the dimension `point`,
        with the parameters as coordinates. A quantity is named after its analysis, "response.peak_amplitude"; lists of
        the first bifurcations, isolas or rows lie along `event`, `isola` or `row`, nan behind the last. `failure` says
        what failed at a point, empty where nothing did; `seconds` how long it took.
    parameters
        Names of the parameters.
    title
        That of the study.
    interruption
        What stopped it, Ctrl-C or a time limit; None if all points are computed.
    """

    dataset: xarray.Dataset
    parameters: tuple[str, ...]
    title: str = ""
    interruption: Interruption | None = None

    def __len__(self) -> int:
        return int(self.dataset["failure"].size)

    @property
    def quantities(self) -> tuple[str, ...]:
        """The names of what is known of every point."""
        return tuple(str(name) for name in self.dataset.data_vars if name not in ("failure", "seconds"))

    def __getitem__(self, name: str) -> np.ndarray:
        """The values of a quantity or a parameter, in the shape of the dataset's variable."""
        known = {parameter_column(p, OWN): p for p in self.parameters}
        column = parameter_column(name, OWN) if name in self.parameters else name
        if column not in self.dataset.variables:
            raise InputError(f"the sweep has no quantity {name!r}{suggest(name, [*self.quantities, *known.values()])}")
        return self.dataset[column].to_numpy()

    @property
    def failures(self) -> dict[int, str]:
        """In words what failed, by the number of the point (in the order of the dataset)."""
        texts = self.dataset["failure"].to_numpy().ravel()
        return {number: str(text) for number, text in enumerate(texts) if text}

    def to_xarray(self) -> xarray.Dataset:
        """The dataset."""
        return self.dataset

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per point: parameters, quantities, lists as one column for each place ("response.LP.omega[0]")."""
        import pandas

        dataset = self.dataset
        over = dataset["failure"].dims
        columns: dict[str, Any] = {}
        for name in (*(parameter_column(p, OWN) for p in self.parameters), *self.quantities, "failure", "seconds"):
            lists = [dim for dim in dataset[name].dims if dim not in over]
            values = dataset[name].broadcast_like(dataset["failure"]).transpose(*over, *lists).to_numpy()
            if lists:
                flat = values.reshape(len(self), -1)
                columns |= {f"{name}[{place}]": flat[:, place] for place in range(flat.shape[1])}
            else:
                columns[name] = values.ravel()
        return pandas.DataFrame(columns)

    def to_table(self) -> Table:
        """The same as a table."""
        frame = self.to_dataframe()
        return Table({str(name): frame[name].to_numpy() for name in frame.columns}, self.words)

    def points_table(self, quantities: Sequence[str] | None = None) -> Table:
        """One row per point: the parameters, `quantities` (default: all that are not the same at every point), and in
        words what failed, if anything did.
        """
        frame = self.to_dataframe()
        own = [parameter_column(name, OWN) for name in self.parameters]
        names = [*own, *(self.varying(frame) if quantities is None else self._chosen(quantities, frame))]
        names += ["failure"] if self.failures else []
        return Table({str(name): frame[name].to_numpy() for name in names}, self.words)

    def varying(self, frame: pandas.DataFrame | None = None) -> list[str]:
        """The columns of `to_dataframe` that are not the same at every point, those first that say most of a design:
        a user's own measures, isolas, amplitudes, bifurcations.
        """
        table = self.to_dataframe() if frame is None else frame
        own = {parameter_column(name, OWN) for name in self.parameters} | {"failure", "seconds"}
        names = [str(name) for name in table.columns if name not in own and table[name].nunique(dropna=False) > 1]
        return sorted(names, key=_rank)

    def _chosen(self, quantities: Sequence[str], frame: pandas.DataFrame) -> list[str]:
        """The names of columns that were asked for; InputError, with a suggestion, for one that is none."""
        chosen = [quantities] if isinstance(quantities, str) else list(quantities)
        for name in chosen:
            if name not in frame.columns:
                raise InputError(f"the sweep has no quantity {name!r}{suggest(str(name), [*map(str, frame.columns)])}")
        return chosen

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Draw it: `quantities` over one parameter, as maps over two, as a matrix of scatter plots over more.

        `quantities`: columns of `to_dataframe` (default: the first four of `varying`); `title`; `size`: width and
        height in inches, or the name of one. Saved if a path is given (.png, .svg, .pdf).
        """
        from suboctave.pictures.sweeps import plot_points

        frame = self.to_dataframe()
        asked = options.pop("quantities", None)
        names = (self.varying(frame)[:_DRAWN] or self._still(frame)) if asked is None else self._chosen(asked, frame)
        if not names:
            raise InputError("the sweep has no quantity that could be drawn: every point failed")
        columns = {str(name): frame[name].to_numpy() for name in frame.columns}
        own = [parameter_column(name, OWN) for name in self.parameters]
        return plot_points(columns, own, names, path, **{"title": self.title or None, **options})

    def _still(self, frame: pandas.DataFrame) -> list[str]:
        """Where nothing varies the first quantity."""
        return [str(name) for name in frame.columns if str(name) in self.quantities][:1]

    def to_csv(self, path: str | Path, overwrite: bool = False) -> Path:
        """The same as comma-separated text (.csv), all digits kept."""
        return write_csv(self.to_dataframe(), path, overwrite)

    def summary(self) -> Table:
        """One row for each quantity without a list: least, median and largest value, and how many points have none."""
        rows = []
        for name in self.quantities:
            if self.dataset[name].dims == self.dataset["failure"].dims:
                values = self[name].ravel()
                there = values[~np.isnan(values)]
                three = np.quantile(there, (0.0, 0.5, 1.0)).tolist() if there.size else [float("nan")] * 3
                rows.append([name, *three, int(values.size - there.size)])
        return Table.of_rows(("quantity", "least", "median", "largest", "missing"), rows, self.words)

    @property
    def words(self) -> str:
        """How many points over what, and how many failed."""
        failed = sum(text != MISSING for text in self.failures.values())
        missing = len(self.failures) - failed
        text = f"{len(self)} points over {', '.join(self.parameters)}, {failed} with a failure"
        return text + (f", {missing} not computed" if missing else "")

    def __repr__(self) -> str:
        return "\n".join([f"Sweep: {self.words}", *self.failure_lines()])

    def failure_lines(self) -> list[str]:
        """The different failures, the most frequent first, each with how many points have it and the first of them."""
        points: dict[str, list[int]] = {}
        for number, text in self.failures.items():
            points.setdefault(text, []).append(number)
        points.pop(MISSING, None)
        lines = []
        for text, numbers in sorted(points.items(), key=lambda item: -len(item[1]))[:_SHOWN]:
            where = f"point {numbers[0]}" if len(numbers) == 1 else f"{len(numbers)} points, the first {numbers[0]}"
            lines.append(f"{where}: {textwrap.shorten(text, 300)}")
        return [*lines, f"and {len(points) - _SHOWN} other failures"] if len(points) > _SHOWN else lines


def _rank(name: str) -> int:
    """Smaller for a quantity that says more of a design."""
    if "." not in name:  # a user's own measure
        return -1
    what = name.rpartition(".")[2]
    if what in _TELLING:
        return _TELLING.index(what)
    return len(_TELLING) + (what in _OF_COMPUTING)


# ------------------------------------------------------------------------------------------------------------- files
def _written(sweep: Sweep) -> dict[str, xarray.Dataset]:
    stopped = "" if sweep.interruption is None else json.dumps(sweep.interruption.seconds)
    attributes = {"parameters": "\n".join(sweep.parameters), "stopped": stopped, "seconds": float(sweep.seconds)}
    return {"": sweep.dataset.assign_attrs(attributes)}


def _read(groups: Datasets, allow_code: bool, linear: LinearPart | None) -> Sweep:
    dataset = groups[""]
    attributes = dict(dataset.attrs)
    names: Sequence[str] = str(attributes["parameters"]).splitlines()
    stopped = str(attributes["stopped"])
    kept = {name: attributes[name] for name in ("title", "study", "listed", "key", "origin") if name in attributes}
    whole = dataset.assign(failure=(dataset["failure"].dims, dataset["failure"].to_numpy().astype(object)))
    whole["failure"].attrs = dict(dataset["failure"].attrs)
    whole.attrs = kept
    interruption = Interruption(json.loads(stopped)) if stopped else None
    sweep = Sweep(whole, tuple(names), str(attributes.get("title", "")), interruption)
    sweep.seconds = float(attributes["seconds"])
    return sweep


register(Codec("sweep", Sweep, _written, _read))
