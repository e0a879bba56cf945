"""The options of figures: which quantity is drawn over which axes, in which units, and what the axes say of it.

The public verbs take these as keywords; `View` and `MotionView` hold them once they are checked.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

import numpy as np

from suboctave.errors import GivenDof, InputError, chosen_dof, suggest
from suboctave.pictures.drawing import plain
from suboctave.pictures.style import period_of
from suboctave.store.layout import (
    QUANTITIES,
    Quantity,
    check_component,
    coordinate,
    function_name,
    has_component,
    reading_name,
)
from suboctave.units import UnitSystem

if TYPE_CHECKING:
    import xarray


_MEAN = r"mean of ${x}$, in modulus"  # which harmonic 0 is
_FREQUENCIES = ("rad/s", "Hz")
#: what of a displacement may be shown: the order of its derivative by time
DERIVATIVES = {"displacement": 0, "velocity": 1, "acceleration": 2}
_ACCENTS = ("{0}", r"\dot{{{0}}}", r"\ddot{{{0}}}")
#: letters that stand for themselves where a degree of freedom is called so
_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η", "theta": "θ",
    "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω",
}  # fmt: skip


class PageOptions(TypedDict, total=False):
    """Keywords of every picture: its title and its size."""

    title: Annotated[str | None, "Title."]
    size: Annotated[
        str | tuple[float, float] | None,
        '"single-column" (84 mm), "double-column" (174 mm), or width and height in inches. The named sizes are widths '
        "where there are several frames, or a legend above.",
    ]


class AxesOptions(PageOptions, total=False):
    """Keywords of every figure with axes: where it is drawn, and their texts."""

    ax: Annotated[
        Any,
        "Matplotlib axes that it is drawn into, one for each frame, instead of a figure of its own; what stands in "
        "them stays. The size is theirs.",
    ]
    xlabel: Annotated[str | None, "Text of the axis to the right, instead of the one that follows from what is drawn."]
    ylabel: Annotated[str | None, "The same upwards; in space into the depth."]


class FrameOptions(AxesOptions, total=False):
    """Keywords of every figure in a plane: texts, limits and scales of the axes, see `frames.framed`."""

    xlim: Annotated[Sequence[float] | None, "Part of the axis to the right that is shown, (from, to)."]
    ylim: Annotated[Sequence[float] | None, "The same upwards, as the axis shows it."]
    xscale: Annotated[str | None, '"linear" or "log"; values at or below zero are then left out, and counted.']
    yscale: Annotated[str | None, 'The same upwards, or "dB": 20 times the logarithm of the value in its unit.']


class UnitOptions(TypedDict, total=False):
    """Keywords of every figure of curves or motions: its units, see `Units`."""

    frequency: Annotated[str | None, '"rad/s" or "Hz", where the system\'s time is in seconds.']
    omega_reference: Annotated[
        float | None,
        "The axis shows `omega / omega_reference`; of motions time is `omega_reference t`, and velocities are "
        "derivatives by that.",
    ]
    scale: Annotated[
        float | None,
        "Factor on the quantity; of motions on lengths, of a force on the force; in the plane of two parameters on the "
        "one that is no frequency.",
    ]
    unit: Annotated[str | None, 'Its unit for the label, such as `scale=1e3, unit="mm"`.']


class QuantityOptions(UnitOptions, total=False):
    """Keywords of every figure of curves: their quantity, see `View`, and its units."""

    quantity: Annotated[
        str | Callable[[Any], float] | None,
        'What is drawn: "amplitude" (default), "peak_to_peak", "about_mean", "rms", "velocity", "velocity_rms", '
        '"acceleration", "acceleration_rms", "harmonic", "phase", "peak_force", "contact_share", "impacts", '
        '"transmitted_force", "transmissibility"; or a function of a motion, `quantity=f`, that takes a '
        "`PeriodicOrbit` and gives a number. A dataset must have it: `to_xarray(readings=...)`.",
    ]
    harmonic: Annotated[
        float | str | None,
        "Of which harmonic (alone: its amplitude), a multiple of omega: 0 is the mean, 0.5 a component of motions of "
        "two load periods, which is zero for those of one.",
    ]
    element: Annotated[int | None, "Of which element, by index."]
    dof: Annotated[
        GivenDof | list[GivenDof] | None,
        "Of which degree of freedom, its number or its name, or of which ones, a list; default the observed one.",
    ]


class SpaceOptions(QuantityOptions, AxesOptions, total=False):
    """Keywords of `plot_space`."""


class CurveOptions(QuantityOptions, FrameOptions, total=False):
    """Keywords of `plot`: the quantity of curves, its units, and what of the frame is shown."""

    marks: Annotated[
        Sequence[str] | None,
        'Kinds of bifurcations that get markers, ["PD", "LP"]; default all, of a diagram all but grazing contacts.',
    ]


class MotionOptions(UnitOptions, FrameOptions, total=False):
    """Keywords of every figure of motions: which motions, how they are arranged, their units, and the frame."""

    points: Annotated[Sequence[int] | None, "Which points of the branches, by index."]
    dof: Annotated[
        GivenDof | None,
        "Degree of freedom, its number or its name; default the one that the branch observes, of an orbit alone that "
        "of its first load.",
    ]
    overlay: Annotated[bool | None, "All in one frame; else each in its own, on shared axes."]
    labels: Annotated[Sequence[str] | None, "Names of the motions."]


class SpectrumOptions(MotionOptions, total=False):
    """Keywords of `plot_spectrum`."""

    quantity: Annotated[str | None, '"displacement" (default), "velocity" or "acceleration".']


class HistoryOptions(SpectrumOptions, total=False):
    """Keywords of `plot_history`."""

    element: Annotated[int | None, 'Index of the element whose force is drawn, with `quantity="force"`.']


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of the axes: what `UnitOptions` says of each. Phases are in degrees unless scaled."""

    frequency: str | None = None
    omega_reference: float | None = None
    scale: float | None = None
    unit: str | None = None

    def __post_init__(self) -> None:
        frequency, reference = self.frequency, self.omega_reference
        if frequency is not None and frequency not in _FREQUENCIES:
            raise InputError(f"frequency is 'rad/s' or 'Hz', not {frequency!r}{suggest(str(frequency), _FREQUENCIES)}")
        for name, value in (("omega_reference", reference), ("scale", self.scale)):
            if value is not None and not (isinstance(value, int | float) and math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a positive number, not {value!r}")
        if frequency is not None and reference is not None:
            raise InputError("frequency= gives the axis a unit, omega_reference= takes it away: choose one")

    @property
    def per_omega(self) -> float:
        """What a frequency is multiplied by on an axis of frequencies."""
        return 1.0 / (2.0 * math.pi) if self.frequency == "Hz" else 1.0 / (self.omega_reference or 1.0)

    def of_omega(self, datasets: Sequence[xarray.Dataset]) -> str:
        """What an axis of forcing frequencies says."""
        if self.frequency == "Hz":
            return "forcing frequency (Hz)"
        if self.omega_reference is not None:
            return r"frequency ratio $\omega/\omega_0$"
        return frequency_label(declared_units(datasets), self.frequency or "")

    def unit_of(self, dimension: str, datasets: Sequence[xarray.Dataset], dof: int | None = None) -> str:
        """The unit of a quantity, perhaps of a degree of freedom: the one given, else, where nothing is scaled, that
        which the systems declare.
        """
        if self.unit is not None or self.scale is not None or self.omega_reference is not None:
            return self.unit or ""
        declared = units_of_dof(datasets, dof)
        return declared.name(dimension) if declared else ""

    def check_time(self, dataset: xarray.Dataset) -> None:
        """InputError for frequencies in a unit that the declared one of time contradicts."""
        declared = declared_units([dataset])
        if self.frequency is not None and declared is not None and declared.time != "s":
            raise InputError(
                f"frequency={self.frequency!r} is for time in s, and the system declares {declared.time}: leave it out"
            )


@dataclass(frozen=True)
class View(Units):
    """What is drawn of curves and in which units: the fields are options of `suboctave.plot`, which explains them.

    The quantity is the amplitude by default, with `harmonic` that of this harmonic.
    """

    quantity: str | Callable[[Any], float] = ""
    harmonic: Any = None
    element: int | None = None
    dof: GivenDof | list[GivenDof] | None = None
    marks: Sequence[str] | None = None

    def __post_init__(self) -> None:
        if not self.quantity:
            object.__setattr__(self, "quantity", "amplitude" if self.harmonic is None else "harmonic")
        if not callable(self.quantity):
            check_quantity(self.quantity, QUANTITIES)
        needs = self.kind.numbered
        for name, given in (("harmonic", self.harmonic), ("element", self.element)):
            if given is not None and needs != name:
                raise InputError(f"{name}={given!r} says nothing about the quantity {self.called!r}; leave it out")
        if self.harmonic is not None:
            object.__setattr__(self, "harmonic", as_multiple(self.harmonic))
        if needs == "element":
            _check_element(self.called, self.element)
        if self.dof is not None and not self.kind.of_dof:
            raise InputError(f"the quantity {self.called!r} is not one of a degree of freedom: leave dof= out")
        super().__post_init__()
        if isinstance(self.marks, str):
            raise InputError(f'marks is a list of kinds: marks=["{self.marks}"]')

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> View:
        """The view that the options of a verb ask for, those that are not its own left aside."""
        return cls(**{f.name: options[f.name] for f in fields(cls) if options.get(f.name) is not None})

    @property
    def called(self) -> str:
        """The name of the quantity, of a function its own."""
        return function_name(self.quantity) if callable(self.quantity) else self.quantity

    @property
    def kind(self) -> Quantity:
        """What the quantity is; of a function of a motion no more than its name is known."""
        return Quantity(self.called, "1", plain(self.called)) if callable(self.quantity) else QUANTITIES[self.quantity]

    @property
    def variable(self) -> str:
        """The variable of the dataset that is drawn: the name of a reading."""
        if callable(self.quantity):
            return self.called
        numbers = {"": None, "element": self.element, "harmonic": self.multiple}
        return reading_name(self.quantity, numbers[self.kind.numbered], self.number)

    @property
    def number(self) -> int | None:
        """The number of the degree of freedom that was chosen, None for the one that each curve observes."""
        if isinstance(self.dof, str | tuple):
            raise InputError(f"dof={self.dof!r}: curves laid out as datasets have no names of DOFs; give its number")
        return None if isinstance(self.dof, list) else self.dof

    @property
    def each(self) -> list[View]:
        """A view of each of several degrees of freedom; itself alone where one is chosen, or none."""
        if not isinstance(self.dof, list):
            return [self]
        if not self.dof:
            raise InputError("dof=[]: give degrees of freedom, or leave it out for the observed one")
        return [replace(self, dof=one) for one in self.dof]

    def placed(self, curves: Iterable[Any]) -> View:
        """The view with numbers of degrees of freedom in the places of their names, as the system of the first of
        these curves that has one names them.
        """
        several = self.dof if isinstance(self.dof, list) else [self.dof]
        if not any(isinstance(one, str | tuple) for one in several):
            return self
        curves = list(curves)
        members = (item for curve in curves for item in (curve, *getattr(curve, "branches", ())))
        systems = (getattr(item, "system", None) for item in members)  # that of a dataset is its name
        system: Any = next((one for one in systems if hasattr(one, "dof_names")), None)
        laid_out = (dof_names_of(curve) for curve in curves if hasattr(curve, "attrs"))
        names = next((names for names in laid_out if names), ()) if system is None else system.dof_names
        if system is None and not names:
            return self
        count = len(names) if system is None else system.n
        numbers: list[GivenDof] = [chosen_dof(one, 0, count, names=names) for one in several]
        return replace(self, dof=numbers if isinstance(self.dof, list) else numbers[0])

    @property
    def multiple(self) -> float:
        """The harmonic that is drawn where one is."""
        return 1.0 if self.harmonic is None else self.harmonic

    @property
    def in_degrees(self) -> bool:
        """Whether phases are drawn, in degrees."""
        return self.quantity == "phase" and self.scale is None

    def readings(self, nu: int) -> list[str | Callable[[Any], float]]:
        """The read-offs to lay out of motions of nu load periods so that they can be drawn."""
        if callable(self.quantity):
            return [self.quantity]
        return [] if self.variable == "amplitude" or not self._has_component(nu) else [self.variable]

    def _has_component(self, nu: int) -> bool:
        return self.kind.numbered != "harmonic" or has_component(self.multiple, nu)

    def completed(self, datasets: Sequence[xarray.Dataset]) -> list[xarray.Dataset]:
        """The datasets with the component that is drawn, also where motions have none at that frequency.

        It is zero there, and its phase nan. InputError where none of the motions has it.
        """
        periods = [period_of(dataset) for dataset in datasets]
        if self.kind.numbered == "harmonic":
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

    def label(self, datasets: Sequence[xarray.Dataset]) -> str:
        """What the axis of the quantity says, without a unit; the curves may observe different DOFs."""
        dofs = list(dict.fromkeys(int(dataset.attrs.get("observed_dof", 0)) for dataset in datasets))
        dofs = dofs if self.number is None else [self.number]
        x = "x_i" if len(dofs) > 1 else symbol_of_dof(datasets[0], dofs[0])
        says = _MEAN if self.quantity == "harmonic" and self.multiple == 0.0 else self.kind.axis
        text = says.format(x=x, k=shown_multiple(self.multiple), e=self.element)
        # the dots stand over the letter, not over its index
        text = re.sub(r"(\\d+ot){(\w)(_{\w+})}", r"\1{\2}\3", text)
        names = dof_names_of(datasets[0]) or [str(dof) for dof in range(max(dofs) + 1)]
        several = len(dofs) > 1 and "{x}" in says
        return text + (f", $i$ = {', '.join(plain(names[dof]) for dof in dofs)}" if several else "")


@dataclass(frozen=True)
class Coordinates:
    """The axes of a frame of curves: across, perhaps into the depth, upwards.

    `names` has "omega" or a parameter for each, None for the quantity of the view. `scale` and `unit` of the view are
    those of the last axis that is no frequency.
    """

    names: tuple[str | None, ...]
    view: View

    @property
    def shown(self) -> list[str]:
        """What each axis shows: "omega", a parameter, or "quantity"."""
        return [name or "quantity" for name in self.names]

    @property
    def factors(self) -> np.ndarray:
        """What values along the axes are multiplied by, (axes,)."""
        view = self.view
        scale = math.degrees(1.0) if None in self.names and view.in_degrees else float(view.scale or 1.0)
        return np.array(
            [view.per_omega if n == "omega" else scale if i == self._scaled else 1.0 for i, n in enumerate(self.names)]
        )

    @property
    def _scaled(self) -> int:
        return max((i for i, name in enumerate(self.names) if name != "omega"), default=-1)

    def check(self, dataset: xarray.Dataset) -> None:
        """InputError where the dataset does not have what is drawn."""
        self.view.check_time(dataset)
        name = self.view.variable
        if None in self.names and (name not in dataset or f"event_{name}" not in dataset):
            raise InputError(
                f"this dataset has no {name!r}: draw the branch itself, or lay it out with "
                f"branch.to_xarray(readings=[{name!r}])"
            )

    def of(self, dataset: xarray.Dataset) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the points, (axes, points), and of the events, (axes, events), as the axes show them."""
        known = (self.view.variable, f"event_{self.view.variable}")
        columns = [
            [dataset[part].to_numpy() for part in known] if name is None else coordinate(dataset, name)
            for name in self.names
        ]
        factors = self.factors[:, None]
        points, events = (np.array(part, dtype=float) for part in zip(*columns, strict=True))
        return points * factors, events * factors

    def limits(
        self, datasets: Sequence[xarray.Dataset], *margins: float, from_zero: bool = False
    ) -> list[tuple[float, float]]:
        """The limits of the axes: all points and events with a margin.

        `margins`: shares of each axis beyond what is drawn; `from_zero`: a quantity never negative begins there.
        """
        every = np.concatenate([part for dataset in datasets for part in self.of(dataset)], axis=1)
        limits = []
        for name, row, margin in zip(self.names, every, margins, strict=True):
            known = row[np.isfinite(row)]
            low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
            at_zero = from_zero and name is None and low >= 0.0
            if at_zero:
                low, high = 0.0, high or 1.0
            beyond = margin * (high - low or abs(low) or 1.0)
            limits.append((low if at_zero else low - beyond, high + beyond))
        return limits

    def marked(self, dataset: xarray.Dataset) -> np.ndarray:
        """Which of the events get a marker, (events,), bool: those of the kinds asked for."""
        kinds, marks = dataset["event_kind"].to_numpy(), self.view.marks
        return np.array([marks is None or str(kind) in marks for kind in kinds], dtype=bool)

    def labels(self, datasets: Sequence[xarray.Dataset]) -> tuple[str, ...]:
        """What the axes say."""
        view, texts = self.view, []
        for index, name in enumerate(self.names):
            text = view.of_omega(datasets) if name == "omega" else view.label(datasets) if name is None else name
            if name == "omega" and datasets and all({"shows", "damped"} & set(d.attrs) for d in datasets):
                # of motions that nothing drives, and of bifurcations of modes
                text = text.removeprefix("forcing ")
            unit = view.unit if index == self._scaled else None
            if name is None and unit is None:
                dof = view.number if view.kind.of_dof else NO_DOF
                unit = "°" if view.in_degrees else view.unit_of(view.kind.unit, datasets, dof)
            texts.append(text + (f" ({unit})" if unit else ""))
        return tuple(texts)


@dataclass(frozen=True)
class MotionView(Units):
    """What is drawn of motions and in which units.

    quantity
        "displacement", "velocity", "acceleration", or "force" with `element`.

    Others as `Units`; `scale` and `unit` are those of lengths, of a force those of the force.
    """

    quantity: str = "displacement"
    element: int | None = None

    def check_quantity(self, known: Sequence[str]) -> None:
        """InputError for a quantity that is not among those known, or an element where none is asked for."""
        check_quantity(self.quantity, known)
        if self.quantity == "force":
            _check_element("force", self.element)
        elif self.element is not None:
            raise InputError(
                f"element={self.element!r} says nothing about the quantity {self.quantity!r}; leave it out"
            )

    def factor(self, order: int = 0) -> float:
        """What a derivative of x of this order is multiplied by."""
        return float(self.scale or 1.0) / (self.omega_reference or 1.0) ** order

    def name(self, dataset: xarray.Dataset, order: int, words: bool = False) -> str:
        """A derivative of x as an axis says it: `dx/dt (mm/s)`."""
        letter, index = parts_of_dof(dataset, int(dataset.attrs["dof"]))
        if self.omega_reference is not None and order:
            power = "" if order == 1 else f"^{order}"
            text = rf"$d{power}{letter}{index}/d(\omega_0 t){power}$"
        else:
            text = f"${_ACCENTS[order].format(letter)}{index}$"
        if words:
            text = f"{list(DERIVATIVES)[order]} {text}"
        declared = declared_units([dataset])
        if unit := self.unit_of("length", [dataset], int(dataset.attrs["dof"])):
            time = "s" if self.frequency else declared.time if declared else "time"
            per = "" if not order or self.omega_reference is not None else (f"/{time}", f"/{time}²")[order - 1]
            text += f" ({unit}{per})"
        return text

    def at_frequency(self, omega: float) -> str:
        """A frequency in words."""
        if self.frequency == "Hz":
            return f"{omega / (2.0 * math.pi):.4g} Hz"
        if self.omega_reference is not None:
            return rf"$\omega/\omega_0$ = {omega / self.omega_reference:.4g}"
        return rf"$\omega$ = {omega:.4g}" + (" rad/s" if self.frequency else "")


def frequency_label(declared: UnitSystem | None, unit: str = "") -> str:
    """What an axis of circular frequencies says."""
    unit = unit or (declared.frequency if declared else "")
    return r"forcing frequency $\omega$" + (f" ({unit})" if unit else "")


def declared_units(datasets: Sequence[xarray.Dataset]) -> UnitSystem | None:
    """The units that the systems of all datasets declare; None where they differ."""
    texts = {str(dataset.attrs.get("units", "")) for dataset in datasets}
    return UnitSystem.of(texts.pop()) if len(texts) == 1 else None


#: what is said of no degree of freedom
NO_DOF = -1


def units_of_dof(datasets: Sequence[xarray.Dataset], dof: int | None = None) -> UnitSystem | None:
    """The declared units of what is said of a degree of freedom, by default the observed one: of an angle in rad."""
    declared, angles = declared_units(datasets), set()
    for dataset in datasets:
        known = str(dataset.attrs.get("rotations", "")).split("\n")
        place = dataset.attrs.get("observed_dof", dataset.attrs.get("observed", 0)) if dof is None else dof
        angles.add(str(int(place)) in known)
    return declared.angular if declared is not None and angles == {True} else declared


def dof_names_of(dataset: xarray.Dataset) -> list[str]:
    """What the degrees of freedom of a dataset are called, empty where they have no names."""
    return [name for name in str(dataset.attrs.get("dof_names", "")).split("\n") if name]


def parts_of_dof(dataset: xarray.Dataset, dof: int) -> tuple[str, str]:
    """The letter of a degree of freedom and its index, `_{1}`, perhaps empty, as a formula has them: x, x_1, or the
    name that it has, q_1 of "q1", z_31 of "31 z", x_{left} of "left".
    """
    names = dof_names_of(dataset)
    if dof >= len(names):
        return "x", "" if int(dataset.attrs.get("dofs", 1)) == 1 else f"_{{{dof}}}"
    if of_node := re.fullmatch(r"(\w+) ([xyz])", names[dof]):
        return of_node[2], f"_{{{of_node[1]}}}"
    name = re.sub(r"[\W_]+", "", names[dof])
    digits = name[len(name.rstrip("0123456789")) :]
    word = name.removesuffix(digits)
    word = _GREEK.get(word, word)
    if len(word) != 1:
        return "x", f"_{{{name}}}"
    return word, f"_{{{digits}}}" if digits else ""


def symbol_of_dof(dataset: xarray.Dataset, dof: int) -> str:
    """A degree of freedom as a formula has it."""
    return "".join(parts_of_dof(dataset, dof))


def check_quantity(quantity: str, known: Collection[str]) -> None:
    """InputError for a quantity that is not among those known."""
    if quantity not in known:
        raise InputError(f"unknown quantity {quantity!r}{suggest(str(quantity), known)}")


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


def _check_element(quantity: str, element: Any) -> None:
    if isinstance(element, bool) or not isinstance(element, int | np.integer):
        raise InputError(f"the quantity {quantity!r} is one of an element: give element=, its index")
