"""What a frame shows: which quantity over which frequency axis, in which units, and what the axes say of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.pictures.periods import period_of
from suboctave.store.layout import check_component, coordinate, has_component, reading_name

if TYPE_CHECKING:
    import xarray

__all__ = ["QUANTITIES", "View", "as_multiple", "check_units", "shown_multiple"]

# What the axis says, with {x} the observed displacement, {k} the harmonic, {e} the element.
QUANTITIES = {
    "amplitude": r"amplitude $\max\,|{x}|$",
    "rms": r"RMS of ${x}$",
    "velocity": r"velocity $\max\,|\dot{{{x}}}|$",
    "velocity_rms": r"RMS of $\dot{{{x}}}$",
    "acceleration": r"acceleration $\max\,|\ddot{{{x}}}|$",
    "acceleration_rms": r"RMS of $\ddot{{{x}}}$",
    "harmonic": r"harmonic {k} of ${x}$",  # of harmonic 0 see _MEAN
    "phase": r"phase of harmonic {k} of ${x}$",
    "peak_force": r"peak force, element {e}",
    "contact_share": r"share of period in contact, element {e}",
    "impacts": r"impacts per period, element {e}",
    "transmitted_force": "peak force on the ground",
    "transmissibility": "transmissibility",
}
_MEAN = r"mean of ${x}$, in modulus"
_FREQUENCIES = ("rad/s", "Hz")
_NUMBERED = {"harmonic": "harmonic", "phase": "harmonic"} | dict.fromkeys(
    ("peak_force", "contact_share", "impacts"), "element"
)
_OF_A_DOF = frozenset(list(QUANTITIES)[:8])


@dataclass(frozen=True)
class View:
    """What is drawn and in which units.

    Attributes
    ----------
    quantity
        What is drawn upwards: "amplitude", or a reading such as "rms", "velocity", "harmonic", "phase", "peak_force".
    harmonic, element, dof
        Of which multiple of omega (default 1; 0 is the mean, 0.5 a component of motions of two load periods), of which
        element, of which degree of freedom (default: the observed one).
    frequency
        "rad/s" or "Hz" (where time is in seconds); None leaves omega without a unit.
    omega_reference
        The axis shows `omega / omega_reference`.
    scale, unit
        Values are multiplied by `scale`, and the label ends in `(unit)`: `scale=1e3, unit="mm"` for lengths in m, or
        `scale=1/0.02` for a displacement in units of 0.02. Phases are in degrees unless scaled.
    xlabel, ylabel
        Instead of the labels that follow from the above.
    xlim, ylim
        Part of the axes that is shown, in the units that they show; default everything.
    marks
        Kinds of bifurcations and names of events that get markers; default all.
    """

    quantity: str = "amplitude"
    harmonic: float | None = None
    element: int | None = None
    dof: int | None = None
    frequency: str | None = None
    omega_reference: float | None = None
    scale: float | None = None
    unit: str | None = None
    xlabel: str | None = None
    ylabel: str | None = None
    xlim: Sequence[float] | None = None
    ylim: Sequence[float] | None = None
    marks: Sequence[str] | None = None

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            raise InputError(f"unknown quantity {self.quantity!r}{suggest(str(self.quantity), QUANTITIES)}")
        needs = _NUMBERED.get(self.quantity)
        for name, given in (("harmonic", self.harmonic), ("element", self.element)):
            if given is not None and needs != name:
                raise InputError(f"{name}={given!r} says nothing about the quantity {self.quantity!r}; leave it out")
        if self.harmonic is not None:
            object.__setattr__(self, "harmonic", as_multiple(self.harmonic))
        if needs == "element" and (isinstance(self.element, bool) or not isinstance(self.element, int | np.integer)):
            raise InputError(f"the quantity {self.quantity!r} is one of an element: give element=, its index")
        if self.dof is not None and self.quantity not in _OF_A_DOF:
            raise InputError(f"the quantity {self.quantity!r} is not one of a degree of freedom: leave dof= out")
        check_units(self.frequency, self.omega_reference, self.scale)
        for name, limits in (("xlim", self.xlim), ("ylim", self.ylim)):
            if limits is not None:
                _check_limits(name, limits)
        if isinstance(self.marks, str):
            raise InputError(f'marks is a list of kinds: marks=["{self.marks}"]')

    @property
    def variable(self) -> str:
        """The variable of the dataset that is drawn: the name of a reading."""
        needs = _NUMBERED.get(self.quantity)
        number = {None: None, "element": self.element, "harmonic": self.multiple}[needs]
        return reading_name(self.quantity, number, self.dof)

    @property
    def multiple(self) -> float:
        """The harmonic that is drawn where one is."""
        return 1.0 if self.harmonic is None else self.harmonic

    def readings(self, nu: int) -> list[str]:
        """The read-offs to lay out of motions of nu load periods so that they can be drawn."""
        return [] if self.variable == "amplitude" or not self._has_component(nu) else [self.variable]

    def _has_component(self, nu: int) -> bool:
        return _NUMBERED.get(self.quantity) != "harmonic" or has_component(self.multiple, nu)

    def completed(self, datasets: Sequence[xarray.Dataset]) -> list[xarray.Dataset]:
        """The datasets with the component that is drawn, also where motions have none at that frequency.

        It is zero there, and its phase nan. InputError where none of the motions has it.
        """
        periods = [period_of(dataset) for dataset in datasets]
        if _NUMBERED.get(self.quantity) == "harmonic":
            check_component(self.multiple, periods)
        nothing = math.nan if self.quantity == "phase" else 0.0
        return [
            dataset
            if self._has_component(nu)
            else dataset.assign(
                {
                    f"{prefix}{self.variable}": (of, np.full(dataset.sizes[of], nothing))
                    for prefix, of in (("", "point"), ("event_", "event"))
                }
            )
            for dataset, nu in zip(datasets, periods, strict=True)
        ]

    def check(self, dataset: xarray.Dataset) -> None:
        """Raises InputError where the dataset does not have what is drawn."""
        if self.variable not in dataset or f"event_{self.variable}" not in dataset:
            raise InputError(
                f"this dataset has no {self.variable!r}: draw the branch itself, or lay it out with "
                f"branch.to_xarray(readings=[{self.variable!r}])"
            )

    def factors(self, horizontal: str) -> tuple[float, float]:
        """What values to the right and upwards are multiplied by."""
        across = 1.0
        if horizontal == "omega":
            across = 1.0 / (2.0 * math.pi) if self.frequency == "Hz" else 1.0 / (self.omega_reference or 1.0)
        upwards = 180.0 / math.pi if self.quantity == "phase" and self.scale is None else float(self.scale or 1.0)
        return across, upwards

    def values(self, dataset: xarray.Dataset, horizontal: str) -> tuple[np.ndarray, np.ndarray]:
        """Positions (events, 2) of the events and (points, 2) of the points in the frame, in this order."""
        across, upwards = self.factors(horizontal)
        x, event_x = coordinate(dataset, horizontal)
        y, event_y = dataset[self.variable].to_numpy(), dataset[f"event_{self.variable}"].to_numpy()
        scale = np.array([across, upwards])
        return np.column_stack([event_x, event_y]) * scale, np.column_stack([x, y]) * scale

    def marked(self, dataset: xarray.Dataset, horizontal: str) -> np.ndarray:
        """Which of the events get a marker, shape (events,), bool."""
        kinds = [str(kind) for kind in dataset["event_kind"].to_numpy()]
        chosen = np.array([self.marks is None or kind in self.marks for kind in kinds], dtype=bool)
        places = self.values(dataset, horizontal)[0]
        for column, limits in zip(places.T, (self.xlim, self.ylim), strict=True):
            if limits is not None:
                chosen &= (column >= limits[0]) & (column <= limits[1])
        return chosen

    def labels(
        self, dataset: xarray.Dataset, horizontal: str, curves: Sequence[xarray.Dataset] = ()
    ) -> tuple[str, str]:
        """What the two axes say; `curves`: all that are drawn, which may observe different degrees of freedom."""
        if horizontal != "omega":
            across = horizontal
        elif self.frequency == "Hz":
            across = "forcing frequency (Hz)"
        elif self.omega_reference is not None:
            across = r"frequency ratio $\omega/\omega_0$"
        else:
            across = r"forcing frequency $\omega$" + (" (rad/s)" if self.frequency else "")
        dofs = observed(curves or (dataset,)) if self.dof is None else [self.dof]
        x = "x_i" if len(dofs) > 1 else "x" if int(dataset.attrs.get("dofs", 1)) == 1 else f"x_{{{dofs[0]}}}"
        says = _MEAN if self.quantity == "harmonic" and self.multiple == 0.0 else QUANTITIES[self.quantity]
        upwards = says.format(x=x, k=shown_multiple(self.multiple), e=self.element)
        if len(dofs) > 1 and "{x}" in says:
            upwards += f", $i$ = {', '.join(map(str, dofs))}"
        unit = "°" if self.quantity == "phase" and self.scale is None and self.unit is None else self.unit
        if unit:
            upwards += f" ({unit})"
        return self.xlabel or across, self.ylabel or upwards


def observed(curves: Sequence[xarray.Dataset]) -> list[int]:
    """The degrees of freedom that curves observe, each once, in the order of the curves."""
    return list(dict.fromkeys(int(dataset.attrs.get("observed_dof", 0)) for dataset in curves))


def as_multiple(given: Any) -> float:
    """The multiple of omega that a harmonic is: a number, or a text such as "1/3"."""
    try:
        multiple = float(Fraction(given) if isinstance(given, str) else given)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        multiple = math.nan
    if isinstance(given, bool) or not 0.0 <= multiple < math.inf:
        raise InputError(
            f"harmonic={given!r} is no multiple of omega: 0 (the mean), 1, 2, ..., or a fraction such as 0.5 of "
            "motions of two load periods"
        )
    return multiple


def shown_multiple(multiple: float) -> str:
    """A multiple of omega as text: 3, 1/2, 1/3."""
    fraction = Fraction(multiple).limit_denominator(999)
    return str(fraction) if abs(fraction - Fraction(multiple)) <= 1e-9 else f"{multiple:g}"


def _check_limits(name: str, limits: Any) -> None:
    try:
        first, last = (float(value) for value in limits)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}={limits!r}: give two numbers, (from, to)") from None
    if not (math.isfinite(first) and math.isfinite(last) and first < last):
        raise InputError(f"{name}=({first:g}, {last:g}): two finite numbers, the smaller one first")


def check_units(frequency: Any, omega_reference: Any, scale: Any) -> None:
    """InputError where units of the axes are none, or contradict each other."""
    if frequency is not None and frequency not in _FREQUENCIES:
        raise InputError(f"frequency is 'rad/s' or 'Hz', not {frequency!r}{suggest(str(frequency), _FREQUENCIES)}")
    for name, value in (("omega_reference", omega_reference), ("scale", scale)):
        if value is not None and not (isinstance(value, int | float) and math.isfinite(value) and value > 0):
            raise InputError(f"{name} must be a positive number, not {value!r}")
    if frequency is not None and omega_reference is not None:
        raise InputError("frequency= gives the axis a unit, omega_reference= takes it away: choose one")
