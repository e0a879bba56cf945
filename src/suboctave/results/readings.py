"""What engineers read off a branch, as arrays over its points.

A motion is `x(t) = Re sum_k c_k exp(i k omega t / nu)`. With the c_k known, everything below is exact for the motion
that was solved: mean squares by Parseval's identity, largest values by Newton's method on the derivative, contacts by
the instants at which gaps are crossed. Phases: `c_k = |c_k| exp(i phase)`, so that the component at `k omega` is
`|c_k| cos(k omega t + phase)`; a response that lags behind a load `cos(omega t)` has a negative phase.

Contact is told by the place of the gap: a piecewise-linear law is in contact where one of its pieces acts, a law with a
rounded corner (`SharpSampling`) or a corner in a text where the displacement is beyond the place at which it is sharp,
on its stiffer side. The instants at which gaps are crossed are exact up to rounding (`harmonic.instants`).

In a rigid translation r no internal force does work, so that the force on the ground along r is that of everything that
holds the structure,

    F(t) = r . (K x + C x' + sum_e d_e f_e),

springs, dampers and elements between degrees of freedom cancelling out by themselves. With the force applied,
`P(t) = r . p(t)`, the transmissibility of harmonic k is `|F_k| / |P_k|`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from suboctave.arguments import checked
from suboctave.bifurcation.gaps import contact_side, levels
from suboctave.errors import GivenDof, InputError, chosen_dof, shortened, suggest
from suboctave.harmonic.basis import Array, ComplexArray, harmonic_index, to_complex
from suboctave.harmonic.energy import action, damping_ratio, mean_energy, modal_amplitude
from suboctave.harmonic.orbit import PeriodicOrbit, force_along
from suboctave.harmonic.quadrature import peak, search_grid
from suboctave.harmonic.trigonometric import crossings, extrema
from suboctave.model.elements.smoothness import levels as levels_of
from suboctave.model.inputs import check_element
from suboctave.model.system import System
from suboctave.store.layout import (
    QUANTITIES,
    check_component,
    function_name,
    has_component,
    parameter_column,
    reading_name,
)

if TYPE_CHECKING:
    import xarray


#: what read-offs are asked for by: names, functions of a motion, True for all, False for none
Readings: TypeAlias = str | Callable[[PeriodicOrbit], float] | Sequence[str | Callable[[PeriodicOrbit], float]] | bool


def _of_a_dof(what: str, meaning: str) -> Callable[..., Array]:
    """A method that reads something off one DOF."""

    def read(self: BranchReadings, dof: GivenDof | None = None) -> Array:
        return self._of(what, dof)

    read.__name__, read.__doc__ = what, meaning
    return read


@checked(result=True)
class BranchReadings:
    """What is read off a branch, each an array (len,) over its points. DOFs default to the observed one."""

    system: System
    observe: int
    if TYPE_CHECKING:

        @property
        def orbits(self) -> list[PeriodicOrbit]: ...

    def _over(self, read: Callable[[PeriodicOrbit], float]) -> Array:
        return np.array([read(orbit) for orbit in self.orbits], dtype=float)

    def _of(self, what: str, dof: GivenDof | None = None, number: float | None = None) -> Array:
        return Reading(what, self._dof(dof), number).of(self.orbits, self.observe)

    def _dof(self, given: GivenDof | None) -> int:
        """The number of a degree of freedom that was given, one from the end too; default the observed one."""
        n, names = self.system.n, self.system.dof_names
        if isinstance(given, int | np.integer) and -n <= given < 0:
            given = int(given) + n
        return chosen_dof(given, self.observe, n, names=names)

    rms = _of_a_dof("rms", "Root mean square of the displacement over a period, its mean included.")
    peak_to_peak = _of_a_dof("peak_to_peak", "Largest minus smallest displacement over a period.")
    about_mean = _of_a_dof("about_mean", "Largest distance of the displacement from its mean over a period.")
    velocity = _of_a_dof("velocity", "Largest |dx/dt| over a period.")
    velocity_rms = _of_a_dof("velocity_rms", "Root mean square of the velocity.")
    acceleration = _of_a_dof("acceleration", "Largest acceleration, in modulus, over a period.")
    acceleration_rms = _of_a_dof("acceleration_rms", "Root mean square of the acceleration.")

    def phase(self, k: float = 1, dof: GivenDof | None = None) -> Array:
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
        return check_element(self.system, element, gapped_elements(self.system))

    def transmitted_force(self, direction: ArrayLike | None = None) -> Array:
        """Largest |F| over a period of the force that springs, dampers and elements pass on to the ground.

        `direction`: the rigid translation r (n,) along which it is taken; all DOFs alike unless told.
        """
        r = translation(self.system.n, direction)
        return self._over(lambda orbit: largest(ground_and_load(orbit, r)[0]))

    def transmissibility(self, harmonic: float | None = 1, direction: ArrayLike | None = None) -> Array:
        """Force on the ground over force applied, by amplitudes at `harmonic`, or by largest values (None).

        `direction` as in `transmitted_force`; nan where the force applied is zero. For a moving base compare motions
        instead: `motion_ratio`.

        Raises
        ------
        InputError
            If no force is applied along the direction at that harmonic anywhere on the branch.
        """
        r = translation(self.system.n, direction)
        return _somewhere(self._over(lambda orbit: _force_ratio(orbit, harmonic, r)), harmonic)

    def motion_ratio(self, dof: GivenDof, reference: GivenDof, harmonic: float | None = 1) -> Array:
        """Amplitude of one DOF over that of another, at `harmonic`, or by largest values (None)."""
        above, base = self._dof(dof), self._dof(reference)

        def size(orbit: PeriodicOrbit, of: int) -> float:
            return orbit.amplitude(of) if harmonic is None else abs(orbit.harmonic(harmonic, of))

        below = self._over(lambda orbit: size(orbit, base))
        return self._over(lambda orbit: size(orbit, above)) / np.where(below == 0.0, np.nan, below)

    def reading(self, name: str) -> Array:
        """A read-off by the name under which `to_xarray` and `to_dataframe` store it, such as "velocity_rms".

        With a number where it needs one: "harmonic_3", "harmonic_1/2", "peak_force_0" (element 0), and of another DOF
        than the observed one with the ending "_dof2", or "_dof21 x" where DOFs have names.
        """
        return _on_points(self, read_reading(name).placed(self.system))

    def available_readings(self) -> list[str]:
        """Names of the read-offs of this branch at the observed DOF, first harmonics and all elements included."""
        if not len(self.orbits):
            return []
        names = [*_OF_A_DOF, "harmonic_1", "phase_1"]
        names += [f"peak_force_{i}" for i in range(len(self.system.elements))]
        names += [f"{what}_{i}" for i in gapped_elements(self.system) for what in _OF_A_GAP]
        names.append("transmitted_force")
        r = np.ones(self.system.n)
        if any(of_harmonic(ground_and_load(o, r)[1], 1, o.basis.nu) for o in self.orbits):
            names.append("transmissibility")
        return names


@dataclass(frozen=True)
class Reading:
    """One read-off: what, of which DOF (None: the observed one), and the harmonic or element where it needs one."""

    what: str
    dof: int | str | None = None
    number: float | None = None

    @property
    def name(self) -> str:
        """The name that it is stored under."""
        return reading_name(self.what, self.number, self.dof)

    def placed(self, system: System) -> Reading:
        """The same with the number of its DOF in the place of a name."""
        if not isinstance(self.dof, str):
            return self
        return replace(self, dof=chosen_dof(self.dof, 0, system.n, names=system.dof_names))

    def of(self, orbits: Sequence[PeriodicOrbit], observe: int) -> Array:
        """Its values, shape (len(orbits),)."""
        dof: Any = observe if self.dof is None else self.dof
        if QUANTITIES[self.what].numbered == "element" and len(orbits):
            system = orbits[0].balance.system
            gapped = gapped_elements(system) if self.what in _OF_A_GAP else None
            check_element(system, int(self.number or 0), gapped)
        values = np.array([_READ[self.what](orbit, dof, self.number or 0.0) for orbit in orbits])
        if self.what != "phase":
            return values.astype(float)
        phases = np.where(values == 0.0, np.nan, np.angle(values))
        there = np.isfinite(phases)
        phases[there] = np.unwrap(phases[there])
        return phases

    def attributes(self, system: System) -> dict[str, str]:
        """What a dataset says of it: meaning and unit."""
        kind = QUANTITIES[self.what]
        meaning = kind.meaning
        if kind.numbered == "element":
            meaning += f", element {self.number:g}: {system.elements[int(self.number or 0)].label}"
        elif kind.numbered:
            meaning += f", harmonic {self.number:g}"
        unit = system.units.name(kind.unit) if system.units else kind.unit
        return {"long_name": meaning, "units": unit} | ({} if self.dof is None else {"dof": str(self.dof)})


def _force_ratio(orbit: PeriodicOrbit, harmonic: float | None, r: Array) -> float:
    ground, load = ground_and_load(orbit, r)
    if harmonic is None:
        sizes = largest(ground), largest(load)
    else:
        nu = orbit.basis.nu
        sizes = of_harmonic(ground, harmonic, nu), of_harmonic(load, harmonic, nu)
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


_READ: Mapping[str, Callable[[PeriodicOrbit, int, float], Any]] = {
    "amplitude": lambda orbit, dof, _: orbit.amplitude(dof),
    "rms": lambda orbit, dof, _: orbit.rms(dof),
    "peak_to_peak": lambda orbit, dof, _: orbit.peak_to_peak(dof),
    "about_mean": lambda orbit, dof, _: orbit.amplitude_about_mean(dof),
    "velocity": lambda orbit, dof, _: orbit.velocity_amplitude(dof),
    "velocity_rms": lambda orbit, dof, _: orbit.rms(dof, 1),
    "acceleration": lambda orbit, dof, _: orbit.acceleration_amplitude(dof),
    "acceleration_rms": lambda orbit, dof, _: orbit.rms(dof, 2),
    "harmonic": lambda orbit, dof, k: abs(orbit.harmonic(k, dof)),
    "phase": lambda orbit, dof, k: orbit.harmonic(k, dof),
    "peak_force": lambda orbit, _, index: peak_force(orbit, int(index)),
    "contact_share": lambda orbit, _, index: contact_of(orbit, int(index))[0],
    "impacts": lambda orbit, _, index: contact_of(orbit, int(index))[1],
    "transmitted_force": lambda orbit, _dof, _: largest(ground_and_load(orbit, np.ones(orbit.balance.system.n))[0]),
    "transmissibility": lambda orbit, _dof, _: _force_ratio(orbit, 1, np.ones(orbit.balance.system.n)),
    "energy": lambda orbit, _dof, _: mean_energy(orbit.state()),
    "action": lambda orbit, _dof, _: action(orbit.state()),
    "modal_amplitude": lambda orbit, _dof, _: modal_amplitude(orbit.state()),
    "damping_ratio": lambda orbit, _dof, _: damping_ratio(orbit.state()),
}
_OF_A_DOF = ("rms", "peak_to_peak", "about_mean", "velocity", "velocity_rms", "acceleration", "acceleration_rms")
_OF_A_GAP = ("contact_share", "impacts")
_NAME = re.compile(r"(?P<what>[a-z]+(?:_[a-z]+)*?)(?:_(?P<number>\d+(?:\.\d+|/0*[1-9]\d*)?))?(?:_dof(?P<dof>.+))?")


def read_reading(name: str) -> Reading:
    """The read-off of a name; InputError, with a suggestion, for one that is none."""
    match = _NAME.fullmatch(str(name))
    what = match["what"] if match else str(name)
    if match is None or what not in QUANTITIES:
        raise InputError(f"there is no reading {name!r}{suggest(what, QUANTITIES)}")
    kind = QUANTITIES[what]
    if bool(kind.numbered) != (match["number"] is not None):
        wanted = f"{what}_1" if kind.numbered else what
        needs = f"needs the number of the {kind.numbered}" if kind.numbered else "takes no number"
        raise InputError(f"the reading {name!r} {needs}: write {wanted!r}")
    if match["dof"] is not None and not kind.of_dof:
        raise InputError(f"the reading {what!r} is not one of a degree of freedom: write it without _dof{match['dof']}")
    if what == "amplitude" and match["dof"] is None:
        raise InputError("the amplitude of the observed DOF is there anyway; of another one it is 'amplitude_dof1'")
    number = None if match["number"] is None else float(Fraction(match["number"]))
    if kind.numbered == "element" and number is not None and number % 1.0:
        raise InputError(f"the reading {name!r} needs the index of an element, a whole number")
    dof = match["dof"]
    return Reading(what, int(dof) if dof is not None and dof.isdecimal() else dof, number)


def measure_of(
    branch: Any, quantity: str | Callable[[PeriodicOrbit], float], dof: Any = None, harmonic: float | None = None
) -> tuple[str, Callable[[PeriodicOrbit], float]]:
    """A quantity of single motions, by the name of a reading or as a function of a motion: its name and itself."""
    if callable(quantity):
        if dof is not None or harmonic is not None:
            raise InputError("a function of a motion is what it is: leave dof= and harmonic= out")
        reading: Any = FunctionReading(quantity)
    elif harmonic is not None:
        if quantity != "amplitude":
            raise InputError(f"harmonic={harmonic!r} is for the amplitude; leave it out, or {quantity!r}")
        reading = Reading("harmonic", dof, float(harmonic)).placed(branch.system)
    elif quantity == "amplitude":
        reading = Reading("amplitude", dof).placed(branch.system)
    else:
        read = read_reading(quantity)
        reading = (read if dof is None else replace(read, dof=dof)).placed(branch.system)
    names = branch.system.dof_names
    named = isinstance(reading, Reading) and isinstance(reading.dof, int) and names
    what = replace(reading, dof=names[reading.dof]).name if named else reading.name
    return what, lambda orbit: float(reading.of([orbit], branch.observe)[0])


@dataclass(frozen=True)
class FunctionReading:
    """A read-off by a function of a motion, which gives a number."""

    function: Callable[[PeriodicOrbit], float]

    @property
    def what(self) -> str:
        """What it is called."""
        return function_name(self.function)

    @property
    def name(self) -> str:
        """The name that it is stored under."""
        return self.what

    def placed(self, system: System) -> FunctionReading:
        """Itself."""
        return self

    def of(self, orbits: Sequence[PeriodicOrbit], observe: int) -> Array:
        """Its values, shape (len(orbits),)."""
        return np.array([self._number(orbit) for orbit in orbits], dtype=float)

    def _number(self, orbit: PeriodicOrbit) -> float:
        value = self.function(orbit)
        if not (np.ndim(value) == 0 and np.isrealobj(value) and isinstance(value, int | float | np.number)):
            raise InputError(f"{self.what}(orbit) must give a real number, not {shortened(value)}")
        return float(value)

    def attributes(self, system: System) -> dict[str, str]:
        """What a dataset says of it."""
        return {"long_name": self.what, "units": ""}


def shared(names: Readings, periods: Sequence[int]) -> list[list[Any] | bool]:
    """The names of read-offs for each of several branches, whose motions have these periods nu.

    A component such as `harmonic_0.5` is one of those branches only whose motions have it; InputError if none has.
    """
    if isinstance(names, bool):
        return [names for _ in periods]
    listed = [names] if isinstance(names, str) or callable(names) else list(names)
    chosen = {name: name if callable(name) else read_reading(name) for name in listed}
    components = {
        n: r.number or 0.0
        for n, r in chosen.items()
        if isinstance(r, Reading) and QUANTITIES[r.what].numbered == "harmonic"
    }
    for k in components.values():
        check_component(k, periods)
    return [[n for n in chosen if n not in components or has_component(components[n], nu)] for nu in periods]


def with_readings(dataset: xarray.Dataset, branch: Any, events: Sequence[Any], names: Readings) -> xarray.Dataset:
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


def columns(branch: Any, names: Readings) -> dict[str, Array]:
    """Read-offs as the columns of a table, called as they were asked for."""
    asked = names if not isinstance(names, bool | str) and isinstance(names, Iterable) else [names]
    called = [name if isinstance(name, str) else None for name in dict.fromkeys(asked)]
    listed = _listed(branch, names)
    titles = called if len(called) == len(listed) else [None] * len(listed)
    return {title or reading.name: _on_points(branch, reading) for title, reading in zip(titles, listed, strict=True)}


def _on_points(branch: Any, reading: Reading | FunctionReading) -> Array:
    values = reading.of(branch.orbits, branch.observe)
    return _somewhere(values, 1) if reading.what == "transmissibility" else values


def _listed(branch: Any, names: Readings) -> list[Reading | FunctionReading]:
    if isinstance(names, bool):
        names = branch.available_readings() if names else []
    if not (isinstance(names, Iterable) or callable(names)):
        raise InputError(f"readings must be names, functions of a motion, or True for all, not {shortened(names)}")
    chosen = [names] if isinstance(names, str) or callable(names) else list(names)
    return [
        FunctionReading(name) if callable(name) else read_reading(name).placed(branch.system)
        for name in dict.fromkeys(chosen)
    ]


# ----------------------------------------------------------------------------------- contacts: force, duration, impacts
#: samples around each candidate, and how often the search narrows around the best of them: 16^-9 = 1e-11 of a sample
_AROUND, _ROUNDS = 33, 9
#: candidates whose surroundings are searched
_CANDIDATES = 8


def gapped_elements(system: System) -> list[int]:
    """Indices of the elements that have a gap: a displacement at which contact begins."""
    coefficients = [(element, element.coefficient_values(system.parameters)) for element in system.elements]
    return [index for index, (element, c) in enumerate(coefficients) if levels_of(element.sampling(c), c)]


def contact_of(orbit: PeriodicOrbit, element: int) -> tuple[float, int]:
    """Share of the period in which an element is in contact, and how often contact begins in one period of the motion.

    An element with several gaps is in contact where any of its sides is. One that is always in contact is never struck.
    """
    local = orbit.state().local(element)
    grid = search_grid(local.motion.shape[0] - 1)
    sides = []
    for index, level in enumerate(levels(local)):
        crossed, above = crossings(local.motion, level, grid.zr, grid.zi)
        sides.append((np.sort(crossed), bool(above), contact_side(local, index) > 0))
    every = np.sort(np.concatenate([crossed for crossed, _, _ in sides]))
    if every.size == 0:
        return (1.0 if any(above == right for _, above, right in sides) else 0.0), 0
    ends = np.append(every, every[0] + 2.0 * math.pi)
    middle = np.mod(0.5 * (ends[:-1] + ends[1:]), 2.0 * math.pi)
    touching = np.zeros(middle.size, dtype=bool)
    for crossed, above, right in sides:
        now = (np.searchsorted(crossed, middle) % 2 == 1) != above
        touching |= now == right
    share = float(np.sum(np.diff(ends)[touching]) / (2.0 * math.pi))
    return share, int(np.count_nonzero(touching & ~np.roll(touching, 1)))


def peak_force(orbit: PeriodicOrbit, element: int) -> float:
    """Largest |f| of an element over a period, of its law on the motion (not of a truncated series of the force).

    Candidates are the extrema of the displacements it reads, where a law of displacement alone that only grows has its
    peaks, and the largest samples; the surroundings of each are narrowed down to rounding.
    """
    state = orbit.state()
    motions, force = state.local(element).motions, force_along(state, element)
    high = motions[0].shape[0] - 1
    step = 2.0 * math.pi / (8 * high + 64)
    grid = search_grid(high)
    turns = np.concatenate([extrema(motion, grid.zr, grid.zi)[0] for motion in motions])
    tau = np.concatenate([turns, step * np.arange(8 * high + 64)])

    size = np.abs(force(tau))
    best = float(size.max())
    centres = tau[np.argsort(-size, kind="stable")[:_CANDIDATES]]
    offsets = np.linspace(-1.0, 1.0, _AROUND)
    for _ in range(_ROUNDS):
        around = centres[:, None] + step * offsets
        size = np.abs(force(around.ravel())).reshape(around.shape)
        centres = around[np.arange(len(centres)), size.argmax(axis=1)]
        best = max(best, float(size.max()))
        step *= 2.0 / (_AROUND - 1)
    return best


# ---------------------------------------------------------- the force on the ground, and its ratio to the force applied
def translation(n: int, direction: ArrayLike | None) -> Array:
    """The rigid translation r (n,): all DOFs alike unless told."""
    if direction is None:
        return np.ones(n)
    given: Any = direction
    try:
        r = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        r = np.zeros(0)
    if r.shape != (n,) or not np.all(np.isfinite(r)) or not r.any():
        raise InputError(f"direction must be a vector of {n} finite numbers, not all zero, not {shortened(given)}")
    return r


def ground_and_load(orbit: PeriodicOrbit, r: Array) -> tuple[ComplexArray, ComplexArray]:
    """Complex amplitudes (H + 1,) of the force on the ground and of the force applied, along r."""
    state, balance = orbit.state(), orbit.balance
    frequencies, linear = orbit.basis.multiples * orbit.omega, state.linear
    motion = state.recovered
    damping, stiffness, structural = (
        motion @ linear.seen(r @ part.compact(orbit.values)) for part in balance.system.linear_parts[1:]
    )
    held = stiffness + 1j * (frequencies * damping + np.sign(frequencies) * structural)
    loads, values = balance.loads, {**orbit.values, "omega": orbit.omega}
    applied = np.zeros(len(frequencies), dtype=complex)
    for harmonic in {c.harmonic for c in balance.system.load_components()}:
        applied[harmonic * orbit.basis.nu] = loads.force(harmonic, values, r)
    return held + to_complex(state.force) @ linear.read(r), applied


def of_harmonic(amplitudes: ComplexArray, k: float, nu: int) -> float:
    """Amplitude at `k omega` of a force or motion with these complex amplitudes; 0 beyond them."""
    index = harmonic_index(k, nu)
    return float(abs(amplitudes[index])) if index < len(amplitudes) else 0.0


def largest(amplitudes: ComplexArray) -> float:
    """Largest modulus over a period."""
    return peak(amplitudes)[0]
