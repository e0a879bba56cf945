"""Isolas in pictures of curves of bifurcations: their regions in the plane, and which events are their ends.

Drawn from the dataset that `suboctave.store.isolas` describes, given among those of the curves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suboctave.pictures.periods import period_colour, period_name
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray

__all__ = ["CENTRE", "MERGING", "Region", "end_text", "is_isolas", "parameter_of", "regions", "split", "with_ends"]

#: kinds that the events at the two ends of an isola have in pictures
CENTRE, MERGING = "isola_centre", "isola_merging"
#: an event within this, relative to its values, is the end itself
_SAME = 1e-8


@dataclass(frozen=True)
class Region:
    """Where one isola is, in the plane of frequency and parameter: `low` and `high` omega at ascending values.

    `parameter` is the name of the design parameter, `words` what a legend says, `colour` that of its period.
    """

    parameter: str
    words: str
    colour: str
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @property
    def outline(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies and values of the parameter once around it."""
        omega = np.concatenate([self.low, self.high[::-1], self.low[:1]])
        return omega, np.concatenate([self.value, self.value[::-1], self.value[:1]])


def is_isolas(dataset: xarray.Dataset) -> bool:
    """Whether a dataset is that of isolas."""
    return bool(dataset.attrs.get("isolas"))


def parameter_of(dataset: xarray.Dataset) -> str:
    """The design parameter of a dataset of isolas."""
    return str(dataset.attrs["isolas"])


def split(datasets: Sequence[xarray.Dataset]) -> tuple[list[xarray.Dataset], list[xarray.Dataset]]:
    """The datasets of curves, and those of isolas."""
    heads = [dataset for dataset in datasets if is_isolas(dataset)]
    return [dataset for dataset in datasets if not is_isolas(dataset)], heads


def regions(heads: Sequence[xarray.Dataset]) -> list[Region]:
    """The region of each isola."""
    found = []
    for head in heads:
        which = head["edge_isola"].to_numpy()
        value, low, high = (head[f"edge_{name}"].to_numpy() for name in ("value", "low", "high"))
        for number, nu in enumerate(head["period"].to_numpy()):
            own, words = which == number, f"{period_name(int(nu))} isola"
            found.append(Region(parameter_of(head), words, period_colour(int(nu)), value[own], low[own], high[own]))
    return found


def with_ends(dataset: xarray.Dataset, heads: Sequence[xarray.Dataset]) -> xarray.Dataset:
    """The dataset of a curve, the ends of isolas among its events under kinds of their own."""
    kinds = dataset["event_kind"].to_numpy().astype(object)
    for kind, parameter, omega, value in _ends(heads):
        if parameter not in dataset["parameter"].to_numpy():
            continue
        there, at = dataset["event_omega"].to_numpy(), coordinate(dataset, parameter)[1]
        same = (np.abs(there - omega) <= _SAME * abs(omega)) & (np.abs(at - value) <= _SAME * max(abs(value), 1e-300))
        kinds[same] = kind
    return dataset.assign(event_kind=("event", kinds))


def _ends(heads: Sequence[xarray.Dataset]) -> Iterator[tuple[str, str, float, float]]:
    for head in heads:
        for kind, name in ((CENTRE, "born"), (MERGING, "merges")):
            for value, omega in zip(head[name].to_numpy(), head[f"{name}_omega"].to_numpy(), strict=True):
                if np.isfinite(value):
                    yield kind, parameter_of(head), float(omega), float(value)


def end_text(kind: str, value: float | None) -> str:
    """What stands beside an end, with the value of the parameter where that is drawn upwards."""
    word = "born" if kind == CENTRE else "merges"
    return word if value is None else f"{word} {value:#.4g}"
