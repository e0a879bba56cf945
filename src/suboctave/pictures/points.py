"""What a report page knows of the points and events of its curves beside where they are drawn, as data for its scripts.

Numbers are packed: little-endian, base64. The Fourier coefficients of the motions come along, of which the page makes
time histories, phase portraits and spectra.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.pictures import style
from suboctave.pictures.boundary import kind_of, plane_of
from suboctave.pictures.given import is_boundary
from suboctave.pictures.options import units_of_dof
from suboctave.pictures.strokes import number_of
from suboctave.pictures.style import period_of
from suboctave.pictures.tables import observed_label
from suboctave.store.layout import coordinate
from suboctave.units import UnitSystem

if TYPE_CHECKING:
    import xarray


#: steps from zero to the largest force of an element in one period
_STEPS = 32767
#: multipliers of a point that are shown, by falling modulus
_MULTIPLIERS = 24


@dataclass(frozen=True)
class Verified:
    """What shooting said of a curve: of points by index and of events by number, each in words; how many disagree."""

    points: dict[int, str] = field(default_factory=dict)
    events: dict[int, str] = field(default_factory=dict)
    wrong: int = 0


@dataclass(frozen=True)
class Detail:
    """What of motions is on a page: of which displacements, "all", "read" (the observed one and those that gaps are
    places of) or "none", and whether the forces of elements over time; `words`: what is not.
    """

    words: str
    displacements: str
    forces: bool

    def of(self, dataset: xarray.Dataset) -> xarray.Dataset:
        """The dataset of a curve without the rest."""
        if "motion" not in dataset:
            return dataset
        if not self.forces:
            dataset = dataset.drop_vars(["force", "event_force"])
        if self.displacements == "none":
            return dataset.drop_vars(["motion", "event_motion"])
        if self.displacements == "read":
            gaps = dataset["gap_signal"].to_numpy()
            kept = np.unique([0, *gaps])
            left = int(np.sum(np.delete(dataset["signal_dof"].to_numpy(), kept) >= 0))
            dataset = dataset.isel(signal=kept).assign(gap_signal=("gap", np.searchsorted(kept, gaps)))
            dataset = dataset.assign_attrs(dofs_left_out=int(dataset.attrs["dofs_left_out"]) + left)
        return dataset

    def size(self, dataset: xarray.Dataset) -> float:
        """Characters of motions and forces on the page."""
        own, count = self.of(dataset), 0
        if "motion" in own:
            sizes = (np.sum(2 * own[f"{prefix}harmonics"].to_numpy() + 1) for prefix in ("", "event_"))
            count += 4 * own.sizes["signal"] * int(sum(sizes))
        if "force" in own:
            count += 2 * (own["force"].size + own["event_force"].size)
        return 4.0 * count / 3.0


_MANY = "There are too many points for all of their motions: this page has"
#: from all of it to nothing
DETAILS = (
    Detail("", "all", True),
    Detail(f"{_MANY} no forces of elements over time.", "all", False),
    Detail(f"{_MANY} the observed displacements and those at gaps, no others, and no forces over time.", "read", False),
    Detail(f"{_MANY} numbers only.", "none", False),
)


def curve_data(dataset: xarray.Dataset, name: str, verified: Verified | None = None) -> dict[str, Any]:
    """A curve with everything that a panel shows of its points and events; `name`: what the page calls it."""
    free = plane_of(dataset) if is_boundary(dataset) else (str(dataset.attrs["free"]),)
    names = list(dict.fromkeys([*free, "omega", *(str(one) for one in dataset["parameter"].to_numpy())]))
    values = {one: coordinate(dataset, one) for one in names}
    varied = [one for one in names if one in free or one == "omega" or np.ptp(values[one][0]) > 0.0]
    kinds = [str(kind) for kind in dataset["event_kind"].to_numpy()]
    verified = verified or Verified()
    return {
        "number": number_of(dataset),
        "name": name,
        "free": list(free),
        "tracked": kind_of(dataset) if is_boundary(dataset) else "",
        "nu": period_of(dataset),
        "units": _units(dataset),
        **_signals(dataset),
        "fixed": {one: float(values[one][0][0]) for one in names if one not in varied},
        "points": _places(dataset, "", {one: values[one][0] for one in varied}),
        "events": {
            **_places(dataset, "event_", {one: values[one][1] for one in varied}),
            "kind": kinds,
            "words": [style.kind_style(kind).name for kind in kinds],
            "after": dataset["event_after"].to_numpy().tolist(),
            "criticality": [str(word) for word in dataset["event_criticality"].to_numpy()],
            "contact": [str(word) for word in dataset["event_contact"].to_numpy()],
            "uncertainty": _finite(dataset["event_uncertainty"].to_numpy()),
        },
        "gaps": _gaps(dataset),
        "instants": {"count": dataset.sizes.get("instant", 0)},
        "verified": {str(index): words for index, words in verified.points.items()},
        "verified_events": {str(index): words for index, words in verified.events.items()},
    }


def verified_by(checks: Sequence[xarray.Dataset], dataset: xarray.Dataset) -> Verified | None:
    """What verifications say of a curve; None where none was of it."""
    omega, amplitude = dataset["omega"].to_numpy(), dataset["amplitude"].to_numpy()
    found: Verified | None = None
    for check in checks:
        index = check["index"].to_numpy().astype(int)
        there = np.array([check["omega"].to_numpy(), check["amplitude"].to_numpy()])
        if index.size and (index.max() >= omega.size or not np.allclose(there, [omega[index], amplitude[index]])):
            continue
        events: dict[int, str] = {}
        met, seen = ([data[f"event_{name}"].to_numpy() for name in ("omega", "amplitude")] for data in (dataset, check))
        for i, place in enumerate(zip(*seen, strict=True)):
            same = np.flatnonzero(np.all(np.isclose(np.transpose(met), place, rtol=1e-9), axis=1))
            words = "confirmed" if bool(check["event_agrees"][i]) else "NOT CONFIRMED"
            events |= {int(e): f"{words}; distance {float(check['event_distance'][i]):.1e}" for e in same[:1]}
        if not index.size and not events:
            continue
        outcome, distance = check["outcome"].to_numpy(), check["distance"].to_numpy()
        points = {
            int(at): f"{words}; distance {far:.1e}" for at, words, far in zip(index, outcome, distance, strict=True)
        }
        wrong = int(np.count_nonzero(outcome == "disagrees")) + sum(word.startswith("NOT") for word in events.values())
        before = found or Verified()
        found = Verified(before.points | points, before.events | events, before.wrong + wrong)
    return found


def _places(dataset: xarray.Dataset, prefix: str, values: dict[str, np.ndarray]) -> dict[str, Any]:
    """The points of a curve, or with `prefix` its events."""
    count = dataset.sizes["event" if prefix else "point"]
    data: dict[str, Any] = {"count": count, "values": {name: packed(column) for name, column in values.items()}}
    data |= {
        name: packed(dataset[f"{prefix}{name}"].to_numpy())
        for name in ("amplitude", "residual", "error")
        if f"{prefix}{name}" in dataset
    }
    if not prefix and "stable" in dataset:
        data["stable"] = packed(dataset["stable"].to_numpy(), "u1")
    if f"{prefix}harmonics" in dataset:
        data["harmonics"] = packed(dataset[f"{prefix}harmonics"].to_numpy(), "<i4")
    if f"{prefix}multipliers" in dataset:
        rows = dataset[f"{prefix}multipliers"].to_numpy()[:, :_MULTIPLIERS]
        data |= {"multipliers": packed(np.stack([rows.real, rows.imag], axis=-1), "<f4"), "of_each": rows.shape[1]}
    elif prefix:
        rows = dataset["event_multiplier"].to_numpy()
        data |= {"multipliers": packed(np.stack([rows.real, rows.imag], axis=-1), "<f4"), "of_each": 1}
    if f"{prefix}motion" in dataset:
        sizes = 2 * dataset[f"{prefix}harmonics"].to_numpy() + 1
        table = dataset[f"{prefix}motion"].to_numpy()
        # one motion after the other, each without the zeros behind it
        own = [row[:, :size].ravel() for row, size in zip(table, sizes, strict=True)]
        data["motion"] = packed(np.concatenate([np.zeros(0), *own]), "<f4")
        data["levels"] = packed(dataset[f"{prefix}gap_level"].to_numpy())
    if f"{prefix}force" in dataset:
        force = dataset[f"{prefix}force"].to_numpy()
        sizes = np.abs(force).max(axis=-1, initial=0.0)
        whole = np.where(sizes > 0.0, sizes, 1.0)[..., None]
        data |= {"force": packed(np.rint(force / whole * _STEPS), "<i2"), "force_sizes": packed(sizes)}
    if f"{prefix}motion" in dataset:
        indices = dataset["element_index"].to_numpy().tolist()
        peaks = [dataset[f"{prefix}peak_force_{index}"].to_numpy() for index in indices]
        data["peaks"] = packed(np.reshape(np.transpose(peaks), (count, len(indices))))
    return data


def _gaps(dataset: xarray.Dataset) -> dict[str, Any]:
    """Where contact begins: which displacement counts, on which side there is contact, of which element."""
    if "motion" not in dataset:
        return {"signal": [], "side": [], "label": []}
    return {name: dataset[f"gap_{name}"].to_numpy().tolist() for name in ("signal", "side", "label")}


def _units(dataset: xarray.Dataset) -> dict[str, str]:
    """The declared units by what they are of; nothing where none are declared."""
    units = UnitSystem.of(str(dataset.attrs.get("units", "")))
    if units is None:
        return {}
    own = {"omega": units.frequency, "cycles": units.cycles, "length": (units_of_dof([dataset]) or units).length}
    return own | {name: getattr(units, name) for name in ("force", "time")}


def _signals(dataset: xarray.Dataset) -> dict[str, Any]:
    """The displacements and the elements whose motions and forces the page has, by name; how many DOFs it has not."""
    labels, numbers = [observed_label(dataset)], [int(dataset.attrs.get("observed_dof", 0))]
    elements: list[str] = []
    if "signal_label" in dataset:
        labels, numbers = (dataset[f"signal_{name}"].to_numpy().tolist() for name in ("label", "dof"))
        elements = [str(label) for label in dataset["element_label"].to_numpy()]
    lengths = [getattr(units_of_dof([dataset], int(dof)), "length", "") for dof in numbers]
    given = zip(labels, numbers, lengths, strict=True)
    signals = [{"label": label, "dof": dof, "length": length} for label, dof, length in given]
    return {"signals": signals, "elements": elements, "left_out": int(dataset.attrs.get("dofs_left_out", 0))}


def packed(values: np.ndarray, kind: str = "<f8") -> str:
    """An array as base64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _finite(values: np.ndarray) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
