"""What a report page shows of isolas: their table, what happens at their ends, their regions, their surfaces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures.boundary import plot_boundaries
from suboctave.pictures.boundary_lines import is_boundary, kind_of
from suboctave.pictures.interactive_boundary import plane_data, space_data
from suboctave.pictures.periods import period_name, period_of
from suboctave.pictures.regions import is_isolas, parameter_of
from suboctave.pictures.report_boundaries import Shown
from suboctave.pictures.report_text import html_table, safe
from suboctave.pictures.space import plot_space
from suboctave.store.layout import check_layout

if TYPE_CHECKING:
    import xarray

__all__ = ["IsolasPart", "isolas_figures", "isolas_part", "isolas_words"]


@dataclass(frozen=True)
class IsolasPart:
    """The dataset of isolas, those of the curves they were found on, and those of closed branches, by name."""

    head: xarray.Dataset
    curves: dict[str, xarray.Dataset]
    closed: dict[str, xarray.Dataset]

    @property
    def every(self) -> dict[str, xarray.Dataset]:
        """The curves, then the closed branches."""
        return self.curves | self.closed


def isolas_part(datasets: Mapping[str, Any]) -> IsolasPart | None:
    """The datasets of isolas (`Isolas.to_xarray`) by what they are; None where they are none."""
    head = next((dataset for dataset in datasets.values() if is_isolas(dataset)), None)
    if head is None:
        return None
    rest = {str(name): dataset for name, dataset in datasets.items() if dataset is not head}
    for dataset in rest.values():
        check_layout(dataset)
    return IsolasPart(
        head,
        {name: dataset for name, dataset in rest.items() if is_boundary(dataset)},
        {name: dataset for name, dataset in rest.items() if not is_boundary(dataset)},
    )


def isolas_words(part: IsolasPart) -> str:
    """The result in a sentence, the table of the isolas, what happens at their ends, and what stayed open."""
    head, name = part.head, parameter_of(part.head)
    told = [f"<p>{safe(str(head.attrs.get('said', '')))}</p>"]
    if head.sizes["isola"]:
        heads = [("isola", ""), ("period", "text"), (f"{name} from", ""), ("to", "")]
        heads += [("born at", ""), ("ω", ""), ("merges at", ""), ("ω", "")]
        told.append(html_table(heads, list(_rows(head))))
    for number, reasons in enumerate(zip(head["at_from"].to_numpy(), head["at_to"].to_numpy(), strict=True)):
        for key, reason in zip(("from", "to"), reasons, strict=True):
            value = float(head[key].to_numpy()[number])
            told.append(f"<p>Isola {number}, {safe(name)} = {value:.7g}: {safe(str(reason))}.</p>")
    notes = [f"Isola {i}: {note}" for i, text in enumerate(head["notes"].to_numpy()) for note in str(text).splitlines()]
    notes += str(head.attrs.get("notes", "")).splitlines()
    return "".join(told) + "".join(f'<p class="note">{safe(note)}</p>' for note in notes)


def _rows(head: xarray.Dataset) -> Iterator[list[str]]:
    for i, nu in enumerate(head["period"].to_numpy()):
        keys = ("from", "to", "born", "born_omega", "merges", "merges_omega")
        numbers = [float(head[key].to_numpy()[i]) for key in keys]
        yield [str(i), period_name(int(nu)), *(f"{v:.9g}" if np.isfinite(v) else "–" for v in numbers)]


def isolas_figures(part: IsolasPart, name: str) -> list[Shown]:
    """The plane of frequency and parameter with the regions, and the surfaces in space where branches are known."""
    parameter = parameter_of(part.head)
    shown = []
    if part.curves:
        named = {f"curve {i}": dataset for i, dataset in enumerate(part.curves.values())}
        still = plot_boundaries([part.head, *named.values()], size=(6.4, 4.2))
        told = plane_data({"isolas": part.head, **named}, "omega", parameter, name)
        shown.append(Shown("", told, still, f"Isolas over ω and {parameter}"))
    if part.closed:
        periods = {int(nu) for nu in part.head["period"].to_numpy()}
        own = {k: c for k, c in part.curves.items() if kind_of(c) == "LP" and period_of(c) in periods}
        group = {"isolas": part.head, **own, **part.closed}
        still = plot_space(list(group.values()), x="omega", y=parameter, size=(6.4, 4.8))
        told = space_data(group, "omega", parameter, f"{name}_space")
        shown.append(Shown("", told, still, f"Closed branches over ω and {parameter}"))
    return shown
