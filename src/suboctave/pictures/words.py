"""Words of pictures and pages: names of parameters and curves, and what is said of a point under the mouse."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from suboctave.pictures.strokes import Stroke
from suboctave.store.layout import coordinate

if TYPE_CHECKING:
    import xarray


#: significant digits that a screen can show
DIGITS = 9


def spelt(name: str) -> str:
    """How a parameter is written."""
    return "ω" if name == "omega" else name


def fixed_parameters(dataset: xarray.Dataset) -> dict[str, float]:
    """The parameters, and omega, that do not change along a curve."""
    table = dataset["parameters"].to_numpy()
    columns = {"omega": dataset["omega"].to_numpy()}
    columns |= {str(name): table[:, i] for i, name in enumerate(dataset["parameter"].to_numpy())}
    return {spelt(name): float(column[0]) for name, column in columns.items() if np.ptp(column) == 0.0}


def differing(values: Sequence[Mapping[str, float]], digits: int = 6) -> list[list[str]]:
    """For each curve or motion what tells it from the others: "j = 0" for values that all have and that differ."""
    names = [n for n in values[0] if all(n in own for own in values) and len({own[n] for own in values}) > 1]
    return [[f"{name} = {own[name]:.{digits}g}" for name in names] for own in values]


class Hover:
    """What is said of the points and events of a curve: omega, free parameters, amplitude, a multiplier."""

    def __init__(self, dataset: xarray.Dataset) -> None:
        self._dataset = dataset

    @functools.cached_property
    def _free(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Values of the free parameters at points and events."""
        attrs = self._dataset.attrs
        plane = str(attrs.get("plane", "")).split("\n") if attrs.get("tracked") else []
        return {name: coordinate(self._dataset, name) for name in [*plane, str(attrs["free"])] if name != "omega"}

    @functools.cached_property
    def _columns(self) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """Omega, amplitude and a multiplier at points and events."""
        data = self._dataset
        known = "multipliers" in data and data.sizes.get("multiplier", 0) > 0
        leading = data["multipliers"].to_numpy()[:, 0] if known else np.full(data.sizes["point"], np.nan + 0.0j)
        points = (data["omega"].to_numpy(), data["amplitude"].to_numpy(), leading)
        return points, tuple(data[f"event_{name}"].to_numpy() for name in ("omega", "amplitude", "multiplier"))

    def along(self, stroke: Stroke) -> list[str]:
        """Of every vertex of a stroke."""
        return [
            self._text(int(event), True) if event >= 0 else self._text(int(point), False)
            for point, event in zip(stroke.point, stroke.event, strict=True)
        ]

    def of_events(self, which: np.ndarray) -> list[str]:
        """Of some events, by number."""
        return [self._text(int(index), True) for index in which]

    def _text(self, index: int, at_event: bool) -> str:
        omega, amplitude, multiplier = (column[index] for column in self._columns[at_event])
        lines = [f"{spelt('omega')} = {omega:.{DIGITS}g}"]
        lines += [f"{name} = {at[at_event][index]:.{DIGITS}g}" for name, at in self._free.items()]
        lines.append(f"amplitude = {amplitude:.7g}")
        mu = complex(multiplier)
        if np.isfinite(mu):
            shown = f"{mu.real:.5g}" if abs(mu.imag) < 1e-7 else f"{mu.real:.5g} {mu.imag:+.5g}i"
            lines.append(f"{'critical' if at_event else 'leading'} multiplier = {shown}, modulus {abs(mu):.5g}")
        return "\n".join(lines)
