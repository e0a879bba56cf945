"""What engineers read off a branch, as arrays over its points.

A motion is `x(t) = Re sum_k c_k exp(i k omega t / nu)`. With the c_k known, everything below is exact for the motion
that was solved: mean squares by Parseval's identity, largest values by Newton's method on the derivative, contacts by
the instants at which gaps are crossed. Phases: `c_k = |c_k| exp(i phase)`, so that the component at `k omega` is
`|c_k| cos(k omega t + phase)`; a response that lags behind a load `cos(omega t)` has a negative phase.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.continuation.problem import Array
from suboctave.errors import InputError, shortened, suggest
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.model.inputs import check_element
from suboctave.model.system import System
from suboctave.results.readings import contacts, transmission
from suboctave.store.columns import parameter_column
from suboctave.store.layout import check_component, has_component, reading_name

if TYPE_CHECKING:
    import xarray


class BranchReadings:
    """What is read off a branch, each an array (len,) over its points. DOFs default to the observed one."""

    system: System
    observe: int
    if TYPE_CHECKING:

        @property
        def orbits(self) -> list[PeriodicOrbit]: ...

    def _over(self, read: Callable[[PeriodicOrbit], float]) -> Array:
        return np.array([read(orbit) for orbit in self.orbits], dtype=float)

    def _of(self, what: str, dof: int | None = None, number: float | None = None) -> Array:
        return Reading(what, dof, number).of(self.orbits, self.observe)

    def rms(self, dof: int | None = None) -> Array:
        """Root mean square of the displacement over a period, its mean included."""
        return self._of("rms", dof)

    def velocity(self, dof: int | None = None) -> Array:
        """Largest |dx/dt| over a period."""
        return self._of("velocity", dof)

    def velocity_rms(self, dof: int | None = None) -> Array:
        """Root mean square of the velocity."""
        return self._of("velocity_rms", dof)

    def acceleration(self, dof: int | None = None) -> Array:
        """Largest acceleration, in modulus, over a period."""
        return self._of("acceleration", dof)

    def acceleration_rms(self, dof: int | None = None) -> Array:
        """Root mean square of the acceleration."""
        return self._of("acceleration_rms", dof)

    def phase(self, k: float = 1, dof: int | None = None) -> Array:
        """Phase of the component at `k omega` in radians, continuous along the branch from a value in (-pi, pi].

        The component is `|c| cos(k omega t + phase)`: negative where the response lags behind `cos(k omega t)`. nan
        where there is no such component.
        """
        return self._of("phase", dof, k)

    def peak_force(self, element: int | None = None) -> Array:
        """Largest |f| of an element over a period (`element`: its index; not needed where there is one)."""
        return self._of("peak_force", None, check_element(self.system, element))

    def contact_share(self, element: int | None = None) -> Array:
        """Contact duration of an element with a gap, as a share of the period (0 to 1)."""
        return self._of("contact_share", None, self._gapped(element))

    def impacts(self, element: int | None = None) -> Array:
        """How often contact begins at an element with a gap in one period of the motion (nu load periods)."""
        return self._of("impacts", None, self._gapped(element))

    def _gapped(self, element: int | None) -> int:
        return check_element(self.system, element, contacts.gapped_elements(self.system))

    def transmitted_force(self, direction: ArrayLike | None = None) -> Array:
        """Largest |F| over a period of the force that springs, dampers and elements pass on to the ground.

        `direction`: the rigid translation r (n,) along which it is taken; all DOFs alike unless told.
        """
        r = transmission.translation(self.system.n, direction)
        return self._over(lambda orbit: transmission.largest(transmission.ground_and_load(orbit, r)[0]))

    def transmissibility(self, harmonic: float | None = 1, direction: ArrayLike | None = None) -> Array:
        """Force on the ground over force applied, by amplitudes at `harmonic`, or by largest values (None).

        `direction` as in `transmitted_force`; nan where the force applied is zero. For a moving base compare motions
        instead: `motion_ratio`.

        Raises
        ------
        InputError
            If no force is applied along the direction at that harmonic anywhere on the branch.
        """
        r = transmission.translation(self.system.n, direction)
        return _somewhere(self._over(lambda orbit: _force_ratio(orbit, harmonic, r)), harmonic)

    def motion_ratio(self, dof: int, reference: int, harmonic: float | None = 1) -> Array:
        """Amplitude of one DOF over that of another, at `harmonic`, or by largest values (None)."""

        def ratio(orbit: PeriodicOrbit) -> float:
            pair = (
                (orbit.amplitude(dof), orbit.amplitude(reference))
                if harmonic is None
                else (abs(orbit.harmonic(harmonic, dof)), abs(orbit.harmonic(harmonic, reference)))
            )
            return pair[0] / pair[1] if pair[1] else np.nan

        return self._over(ratio)

    def reading(self, name: str) -> Array:
        """A read-off by the name under which `to_xarray` and `to_dataframe` store it, such as "velocity_rms".

        With a number where it needs one: "harmonic_3", "harmonic_1/2", "peak_force_0" (element 0), and of another DOF
        than the observed one with the ending "_dof2".
        """
        return _on_points(self, read_reading(name))

    def available_readings(self) -> list[str]:
        """Names of the read-offs of this branch at the observed DOF, first harmonics and all elements included."""
        if not len(self.orbits):
            return []
        names = [*_OF_A_DOF, "harmonic_1", "phase_1"]
        names += [f"peak_force_{i}" for i in range(len(self.system.elements))]
        names += [f"{what}_{i}" for i in contacts.gapped_elements(self.system) for what in _OF_A_GAP]
        orbit = self.orbits[0]
        if orbit.balance.size == self.system.n:
            names.append("transmitted_force")
            if any(transmission.of_harmonic(_applied(o), 1, o.basis.nu) for o in self.orbits):
                names.append("transmissibility")
        return names


@dataclass(frozen=True)
class Reading:
    """One read-off: what, of which DOF (None: the observed one), and the harmonic or element where it needs one."""

    what: str
    dof: int | None = None
    number: float | None = None

    @property
    def name(self) -> str:
        """The name that it is stored under."""
        return reading_name(self.what, self.number, self.dof)

    def fits(self, nu: int) -> bool:
        """Whether motions of nu load periods have it: not a component between the multiples of omega/nu."""
        return READINGS[self.what].numbered != "harmonic" or has_component(self.number or 0.0, nu)

    def of(self, orbits: Sequence[PeriodicOrbit], observe: int) -> Array:
        """Its values, shape (len(orbits),)."""
        dof = observe if self.dof is None else self.dof
        kind = READINGS[self.what]
        if self.what in _OF_AN_ELEMENT and len(orbits):
            system = orbits[0].balance.system
            gapped = contacts.gapped_elements(system) if self.what in _OF_A_GAP else None
            check_element(system, int(self.number or 0), gapped)
        values = np.array([kind.read(orbit, dof, self.number or 0.0) for orbit in orbits])
        return _phases(values) if self.what == "phase" else values.astype(float)

    def attributes(self, system: System) -> dict[str, str]:
        """What a dataset says of it: meaning and unit."""
        kind = READINGS[self.what]
        meaning = kind.meaning
        if kind.numbered == "element":
            meaning += f", element {self.number:g}: {system.elements[int(self.number or 0)].label}"
        elif kind.numbered:
            meaning += f", harmonic {self.number:g}"
        return {"long_name": meaning, "units": kind.unit} | ({} if self.dof is None else {"dof": str(self.dof)})


@dataclass(frozen=True)
class _Kind:
    read: Callable[[PeriodicOrbit, int, float], Any]
    meaning: str
    unit: str
    numbered: str = ""


def _force_ratio(orbit: PeriodicOrbit, harmonic: float | None, r: Array) -> float:
    ground, load = transmission.ground_and_load(orbit, r)
    if harmonic is None:
        sizes = transmission.largest(ground), transmission.largest(load)
    else:
        nu = orbit.basis.nu
        sizes = transmission.of_harmonic(ground, harmonic, nu), transmission.of_harmonic(load, harmonic, nu)
    return sizes[0] / sizes[1] if sizes[1] else np.nan


def _somewhere(ratios: Array, harmonic: float | None) -> Array:
    """Ratios of forces, refused if none of them exists."""
    if len(ratios) and np.all(np.isnan(ratios)):
        where = "" if harmonic is None else f" at harmonic {harmonic:g}"
        raise InputError(
            f"transmissibility: no force is applied{where} along the direction; give another direction or harmonic, "
            "or compare motions (motion_ratio)"
        )
    return ratios


def _applied(orbit: PeriodicOrbit) -> np.ndarray:
    return transmission.ground_and_load(orbit, np.ones(orbit.balance.system.n))[1]


def _ground(orbit: PeriodicOrbit) -> float:
    return transmission.largest(transmission.ground_and_load(orbit, np.ones(orbit.balance.system.n))[0])


READINGS: Mapping[str, _Kind] = {
    "amplitude": _Kind(lambda o, dof, _: o.amplitude(dof), "max |x| over a period", "length"),
    "rms": _Kind(lambda o, dof, _: o.rms(dof), "root mean square of x", "length"),
    "velocity": _Kind(lambda o, dof, _: o.velocity_amplitude(dof), "max |dx/dt| over a period", "length / time"),
    "velocity_rms": _Kind(lambda o, dof, _: o.rms(dof, 1), "root mean square of dx/dt", "length / time"),
    "acceleration": _Kind(
        lambda o, dof, _: o.acceleration_amplitude(dof), "max |d2x/dt2| over a period", "length / time^2"
    ),
    "acceleration_rms": _Kind(lambda o, dof, _: o.rms(dof, 2), "root mean square of d2x/dt2", "length / time^2"),
    "harmonic": _Kind(lambda o, dof, k: abs(o.harmonic(k, dof)), "amplitude of x", "length", "harmonic"),
    "phase": _Kind(lambda o, dof, k: o.harmonic(k, dof), "phase of x, negative where it lags", "rad", "harmonic"),
    "peak_force": _Kind(
        lambda o, _, i: contacts.peak_force(o, int(i)), "largest |force| over a period", "force", "element"
    ),
    "contact_share": _Kind(
        lambda o, _, i: contacts.contact_of(o, int(i))[0], "share of the period in contact", "1", "element"
    ),
    "impacts": _Kind(
        lambda o, _, i: contacts.contact_of(o, int(i))[1], "contacts begun per period of the motion", "1", "element"
    ),
    "transmitted_force": _Kind(lambda o, _dof, _: _ground(o), "largest |force| on the ground over a period", "force"),
    "transmissibility": _Kind(
        lambda o, _dof, _: _force_ratio(o, 1, np.ones(o.balance.system.n)),
        "force on the ground over force applied, first harmonics",
        "1",
    ),
}
_OF_A_DOF = ("rms", "velocity", "velocity_rms", "acceleration", "acceleration_rms")
_OF_A_GAP = ("contact_share", "impacts")
_OF_AN_ELEMENT = ("peak_force", *_OF_A_GAP)
_NAME = re.compile(r"(?P<what>[a-z]+(?:_[a-z]+)*?)(?:_(?P<number>\d+(?:\.\d+|/0*[1-9]\d*)?))?(?:_dof(?P<dof>\d+))?")


def read_reading(name: str) -> Reading:
    """The read-off of a name; InputError, with a suggestion, for one that is none."""
    match = _NAME.fullmatch(str(name))
    what = match["what"] if match else str(name)
    if match is None or what not in READINGS:
        raise InputError(f"there is no reading {name!r}{suggest(what, READINGS)}")
    kind = READINGS[what]
    if bool(kind.numbered) != (match["number"] is not None):
        wanted = f"{what}_1" if kind.numbered else what
        needs = f"needs the number of the {kind.numbered}" if kind.numbered else "takes no number"
        raise InputError(f"the reading {name!r} {needs}: write {wanted!r}")
    if match["dof"] is not None and what not in ("amplitude", *_OF_A_DOF, "harmonic", "phase"):
        raise InputError(f"the reading {what!r} is not one of a degree of freedom: write it without _dof{match['dof']}")
    if what == "amplitude" and match["dof"] is None:
        raise InputError("the amplitude of the observed DOF is there anyway; of another one it is 'amplitude_dof1'")
    number = None if match["number"] is None else float(Fraction(match["number"]))
    if kind.numbered == "element" and number is not None and number % 1.0:
        raise InputError(f"the reading {name!r} needs the index of an element, a whole number")
    return Reading(what, None if match["dof"] is None else int(match["dof"]), number)


def shared(names: Iterable[str] | bool, periods: Sequence[int]) -> list[list[str] | bool]:
    """The names of read-offs for each of several branches, whose motions have these periods nu.

    A component such as `harmonic_0.5` is one of those branches only whose motions have it; InputError if none has.
    """
    if isinstance(names, bool):
        return [names for _ in periods]
    chosen = {name: read_reading(name) for name in ([names] if isinstance(names, str) else names)}
    for reading in chosen.values():
        if READINGS[reading.what].numbered == "harmonic":
            check_component(reading.number or 0.0, periods)
    return [[name for name, reading in chosen.items() if reading.fits(nu)] for nu in periods]


def with_readings(
    dataset: xarray.Dataset, branch: Any, events: Sequence[Any], names: Iterable[str] | bool
) -> xarray.Dataset:
    """The dataset of a branch with read-offs on its points and, with the prefix `event_`, on its events."""
    for reading in _listed(branch, names):
        attributes = reading.attributes(branch.system)
        if reading.name in dataset.coords:  # a free parameter of that name
            dataset = dataset.rename({reading.name: parameter_column(reading.name, (reading.name,))})
        dataset[reading.name] = ("point", _on_points(branch, reading), attributes)
        there = reading.of([event.orbit for event in events], branch.observe)
        if reading.what == "phase":  # of the same turn as the points beside it
            near = dataset[reading.name].to_numpy()[dataset["event_after"].to_numpy()]
            there = there + 2.0 * np.pi * np.round((near - there) / (2.0 * np.pi))
        dataset[f"event_{reading.name}"] = ("event", there, attributes)
    return dataset


def columns(branch: Any, names: Iterable[str] | bool) -> dict[str, Array]:
    """Read-offs as the columns of a table."""
    return {reading.name: _on_points(branch, reading) for reading in _listed(branch, names)}


def _on_points(branch: Any, reading: Reading) -> Array:
    values = reading.of(branch.orbits, branch.observe)
    return _somewhere(values, 1) if reading.what == "transmissibility" else values


def _listed(branch: Any, names: Iterable[str] | bool) -> list[Reading]:
    if isinstance(names, bool):
        names = branch.available_readings() if names else []
    if not isinstance(names, Iterable):
        raise InputError(f"readings must be names, or True for all, not {shortened(names)}")
    chosen = [names] if isinstance(names, str) else list(names)
    return [read_reading(name) for name in dict.fromkeys(chosen)]


def _phases(amplitudes: np.ndarray) -> Array:
    phases = np.where(amplitudes == 0.0, np.nan, np.angle(amplitudes))
    there = np.isfinite(phases)
    phases[there] = np.unwrap(phases[there])
    return phases
