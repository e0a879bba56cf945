"""The page of a run while it runs: what its journal holds so far, drawn anew at every request, then its report."""

from __future__ import annotations

import threading
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import SuboctaveError
from suboctave.pictures.boundary import plane_of
from suboctave.pictures.given import is_boundary
from suboctave.pictures.report import page_of, template
from suboctave.pictures.sections import picture_of
from suboctave.store.journal import read_journal
from suboctave.store.layout import EventRow, curve_dataset
from suboctave.study.results import Results
from suboctave.study.runner import JOURNAL, Finished, Outcome, recovered
from suboctave.study.screen import significant

if TYPE_CHECKING:
    import xarray

    from suboctave.progress import Report
    from suboctave.study.file import Study

#: seconds after which the page asks again
REFRESH = 2
#: points from which a curve is drawn, and curves in the picture of one analysis
_DRAWN, _CURVES = 2, 12


class Watching:
    """What a page shows of a run: `begin` and `note` are told of its analyses, `finish` gives the page of its end.

    `page()` may be called from another thread.
    """

    def __init__(self, study: Study, folder: Path) -> None:
        self.study, self.folder = study, folder
        self.since = perf_counter()
        self.ended: str | None = None
        self.under_way = ""
        #: of what is under way the share that is done, and in words where it is
        self.share, self.where = 0.0, ""
        self.over: dict[str, Finished] = {}
        self._lock = threading.Lock()
        #: pictures by analysis, with the sizes of the curves that they show
        self._stills: dict[tuple[str, Axes], tuple[list[int], str]] = {}

    def begin(self, name: str) -> None:
        """An analysis is begun."""
        self.under_way, self.share, self.where = name, 0.0, ""

    def reporting(self, report: Report) -> Report:
        """Reports of the analysis under way, for the page and for another reader."""

        def both(share: float, where: str = "") -> None:
            # what is done in several parts begins each of them anew
            self.share, self.where = max(self.share, share), where
            report(share, where)

        return both

    def note(self, item: Finished) -> None:
        """An analysis is over."""
        self.over[item.step.name] = item
        self.under_way = ""

    def finish(self, outcome: Outcome) -> None:
        """The run is over: from now on its report is shown, or what failed."""
        title, results = self.study.title or self.study.called, Results(outcome.results)
        if len(results):
            self.ended = page_of(results, title, outcome.failures)

    def page(self) -> str:
        """The page as it is now."""
        if self.ended is not None:
            return self.ended
        with self._lock:  # one request after the other: Matplotlib draws in one thread at a time
            return self._so_far()

    def _so_far(self) -> str:
        path = self.folder / JOURNAL
        try:
            known = {item.name: item for item in recovered(path)}
            curves = curves_so_far(path)
        except (SuboctaveError, OSError):  # not there yet, or no more
            known, curves = {}, {}
        rows = []
        for step in self.study.steps:
            item, over = known.get(step.name), self.over.get(step.name)
            state, share = "waiting", None
            if over is not None:
                state = f"failed: {over.failure}" if over.failure else f"finished in {over.seconds:.2f} s"
            elif step.name == self.under_way:
                state, share = self.where or "running", self.share
            numbers = ("", "") if item is None else (str(item.points), str(item.bifurcations))
            rows.append((step.name, step.kind, share, state, *numbers))
        events = [
            (name, kind, significant(omega, 9), significant(amplitude, 7))
            for name, item in known.items()
            for kind, omega, amplitude in item.events
        ]
        pictures = [
            (name, axes if isinstance(axes, str) else " and ".join(axes), self._still(name, axes, own))
            for name, several in curves.items()
            for axes, own in several.items()
        ]
        text: str = template("watch.html").render(
            title=self.study.title or self.study.called,
            seconds=f"{perf_counter() - self.since:.0f}",
            refresh=REFRESH,
            rows=rows,
            events=events,
            pictures=pictures,
        )
        return text

    def _still(self, name: str, axes: Axes, curves: list[xarray.Dataset]) -> str:
        """A picture of an analysis, drawn anew when it has more points."""
        sizes = [data.sizes["point"] for data in curves]
        if self._stills.get((name, axes), ([], ""))[0] != sizes:
            self._stills[name, axes] = sizes, picture_of(curves)
        return self._stills[name, axes][1]


#: what curves are drawn over: the free parameter of responses, the plane of curves of bifurcations
Axes = str | tuple[str, str]


def curves_so_far(path: Path) -> dict[str, dict[Axes, list[xarray.Dataset]]]:
    """The curves that a journal holds, by analysis and by what they are drawn over."""
    curves: dict[str, list[xarray.Dataset]] = {}
    begun: dict[str, dict[int, list[dict[str, Any]]]] = {}
    for record in read_journal(path):
        name = str(record.fields.get("name", ""))
        if record.kind == "points":
            number = int(record.fields.get("curve", 0))
            if not record.fields["from"]:
                begun[name] = {k: parts for k, parts in begun.get(name, {}).items() if k < number}
            begun[name].setdefault(number, []).append(dict(record.fields))
        elif record.kind in ("branch", "analysis"):
            dataset = record.dataset
            begun.pop(name, None)
            if dataset.attrs.get("contents") == "branch":
                curves.setdefault(name, []).append(dataset)
    for name, several in begun.items():
        for parts in several.values():
            curve = _of_points(parts)
            if curve is not None:
                curves.setdefault(name, []).append(curve)
    together: dict[str, dict[Axes, list[xarray.Dataset]]] = {}
    for name, own in curves.items():
        for curve in own:
            axes = plane_of(curve) if is_boundary(curve) else str(curve.attrs["free"])
            together.setdefault(name, {}).setdefault(axes, []).append(curve)
    return {name: {axes: own[-_CURVES:] for axes, own in several.items()} for name, several in together.items()}


def _of_points(parts: list[dict[str, Any]]) -> xarray.Dataset | None:
    """The points that were written down of a curve that is being followed."""
    omega = np.array([value for part in parts for value in part["omega"]])
    values = [one for part in parts for one in part["values"]]
    if len(omega) < _DRAWN:
        return None
    parameters = {name: np.array([one[name] for one in values]) for name in values[0]}
    amplitude = [one for part in parts for one in part["amplitude"]]
    stable = [one for part in parts for one in part["stable"]]
    arclength = np.array([one for part in parts for one in part["arclength"]])
    located = sorted((one for part in parts for one in part["bifurcations"]), key=lambda one: float(one[-1]))
    places = np.searchsorted(arclength, [one[-1] for one in located], side="right") - 1
    events = [
        EventRow(str(kind), int(after), float(at), float(size), parameters=dict(there))
        for (kind, at, there, size, _), after in zip(located, places.clip(0, len(omega) - 2), strict=True)
    ]
    what = parts[0]
    own = {"stable": stable, "parameters": parameters, "events": events, "period": what["period"]}
    curve = curve_dataset(omega, amplitude, free=what["free"][-1], **own)
    if what["plane"] is not None:
        curve = curve.assign_attrs(tracked=what["kind"], plane="\n".join(what["plane"]))
    return curve
