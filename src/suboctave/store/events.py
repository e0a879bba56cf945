"""The events of a curve as rows of its dataset: located bifurcations, grazing contacts, users' events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

UNKNOWN = -1  # in event_stable_after
#: where, along a curve of bifurcations, a multiplier other than the critical ones reaches the unit circle
_BY_ANOTHER = frozenset({"R1", "R2", "LPPD", "LPNS", "PDNS", "NSNS"})


@dataclass(frozen=True)
class EventRow:
    """One located bifurcation, as a row of the dataset.

    `after` is the index of the point after which it lies, `parameters` holds the parameters that differ from those of
    the curve's fixed ones, `stable_after` says whether the motions right after it are stable (None: not known),
    `uncertainty` is the half-width in the free parameter of what is not resolved, `contact` the contact that grazes (at
    a grazing, or at a bifurcation that it brings about), `contact_at` the value of the free parameter where it does;
    `multiplier_error` is the estimated error of `multiplier`, `stability_method` where it comes from; `extreme` says of
    an extremum what it is ("maximum of j").
    """

    kind: str
    after: int
    omega: float
    amplitude: float
    residual: float = np.nan
    multiplier: complex = complex(np.nan, np.nan)
    multiplier_error: float = np.nan
    stability_method: str = ""
    criticality: str | None = None
    stable_after: bool | None = None
    uncertainty: float = 0.0
    contact: str = ""
    contact_at: float = np.nan
    parameters: Mapping[str, float] = field(default_factory=dict)
    extreme: str = ""


class ContactLike(Protocol):
    """What the layout asks of a contact that grazes: words for it, and where in the free parameter it does."""

    @property
    def parameter(self) -> float: ...
    def __str__(self) -> str: ...


class EventLike(Protocol):
    """What the layout asks of a located bifurcation or a user's event."""

    @property
    def kind(self) -> str: ...
    @property
    def omega(self) -> float: ...
    @property
    def amplitude(self) -> float: ...
    @property
    def residual(self) -> float: ...
    @property
    def uncertainty(self) -> float: ...
    @property
    def criticality(self) -> str | None: ...
    @property
    def contact(self) -> ContactLike | None: ...
    @property
    def arclength(self) -> float: ...
    @property
    def parameters(self) -> Mapping[str, float]: ...
    @property
    def multipliers(self) -> np.ndarray: ...
    @property
    def critical_error(self) -> float: ...
    @property
    def stability_method(self) -> str: ...
    def critical_multiplier(self) -> complex: ...


class BranchEvents(Protocol):
    """What rows of events ask of a branch; events carry their place as arclength along it."""

    @property
    def stable(self) -> np.ndarray: ...
    @property
    def bifurcations(self) -> Iterable[EventLike]: ...
    @property
    def grazings(self) -> Iterable[EventLike]: ...
    @property
    def events(self) -> Iterable[EventLike]: ...


def events_met(branch: BranchEvents) -> list[EventLike]:
    """The branch's bifurcations, grazings and events in the order met: the rows of the dimension `event`."""
    return sorted([*branch.bifurcations, *branch.grazings, *branch.events], key=lambda event: event.arclength)


def event_rows(branch: BranchEvents, arclength: np.ndarray) -> list[EventRow]:
    """The branch's bifurcations, grazings and events in the order met, each with its place and the verdict after it."""
    own = {id(event) for event in (*branch.grazings, *branch.events)}  # stability goes on through these
    rows: list[EventRow] = []
    for event in events_met(branch):
        place = int(np.searchsorted(arclength, event.arclength, side="right")) - 1
        after = min(max(place, 0), max(arclength.size - 2, 0))
        told = rows[-1].stable_after if rows and rows[-1].after == after else None
        before = bool(branch.stable[after]) if told is None else told
        critical = event.critical_multiplier()
        rows.append(
            EventRow(
                event.kind,
                after,
                event.omega,
                event.amplitude,
                residual=event.residual,
                multiplier=critical,
                multiplier_error=event.critical_error,
                stability_method=event.stability_method,
                criticality=event.criticality,
                stable_after=_stable_after(branch, event, after, before, id(event) in own),
                uncertainty=event.uncertainty,
                contact="" if event.contact is None else str(event.contact),
                contact_at=np.nan if event.contact is None else event.contact.parameter,
                parameters=dict(event.parameters),
                extreme=_extreme(event),
            )
        )
    return rows


def _stable_after(branch: BranchEvents, event: EventLike, after: int, before: bool, own: bool) -> bool:
    """Whether the motions right after an event are stable; of a curve of bifurcations, all but its critical ones."""
    if getattr(event, "curve", ""):
        return bool(branch.stable[min(after + 1, len(branch.stable) - 1)]) if event.kind in _BY_ANOTHER else before
    return before if own else not before and not _others_unstable(event.multipliers, event.critical_multiplier())


def _extreme(event: EventLike) -> str:
    which = getattr(event, "extreme", "")
    return f"{which} of {getattr(event, 'parameter_name', '')}" if which else ""


def _others_unstable(multipliers: np.ndarray, critical: complex) -> bool:
    """Whether multipliers other than the critical one (and its conjugate) lie outside the unit circle."""
    distance = np.minimum(np.abs(multipliers - critical), np.abs(multipliers - np.conj(critical)))
    skip = np.argsort(distance)[: 1 if abs(critical.imag) < 1e-6 * abs(critical) else 2]
    return bool(np.any(np.abs(np.delete(multipliers, skip)) > 1.0))


def event_variables(
    events: Sequence[EventRow], names: Sequence[str], values: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """The variables on the dimension `event`; `values`: the parameters at the points."""
    table = np.array(
        [[row.parameters.get(name, values[name][row.after]) for name in names] for row in events], dtype=float
    ).reshape(len(events), len(names))
    return {
        "event_kind": ("event", np.array([row.kind for row in events], dtype=object)),
        "event_after": ("event", np.array([row.after for row in events], dtype=int)),
        "event_omega": ("event", np.array([row.omega for row in events], dtype=float)),
        "event_amplitude": ("event", np.array([row.amplitude for row in events], dtype=float)),
        "event_residual": ("event", np.array([row.residual for row in events], dtype=float)),
        "event_uncertainty": (
            "event",
            np.array([row.uncertainty for row in events], dtype=float),
            {"long_name": "half-width in the free parameter of what is not resolved of an event, else 0"},
        ),
        "event_contact": (
            "event",
            np.array([row.contact for row in events], dtype=object),
            {"long_name": "the contact that grazes; empty at a smooth bifurcation"},
        ),
        "event_contact_at": (
            "event",
            np.array([row.contact_at for row in events], dtype=float),
            {"long_name": "value of the free parameter at which that contact grazes"},
        ),
        "event_multiplier": (
            "event",
            np.array([row.multiplier for row in events], dtype=complex),
            {"long_name": "the multiplier that crosses the unit circle"},
        ),
        "event_multiplier_error": (
            "event",
            np.array([row.multiplier_error for row in events], dtype=float),
            {"long_name": "its estimated error"},
        ),
        "event_stability_method": ("event", np.array([row.stability_method for row in events], dtype=object)),
        "event_criticality": ("event", np.array([row.criticality or "" for row in events], dtype=object)),
        "event_stable_after": (
            "event",
            np.array([UNKNOWN if row.stable_after is None else int(row.stable_after) for row in events], dtype=np.int8),
            {"long_name": "motions right after it are stable: 1, unstable: 0, not known: -1"},
        ),
        "event_parameters": (("event", "parameter"), table),
    }
