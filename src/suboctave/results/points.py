"""Points of a curve that are asked for: at a value of a parameter, by their place, and its peaks.

A peak is a local maximum of a quantity along the curve: its derivative by the arclength vanishes. The half-power points
are where the quantity has come down to `1 / sqrt(2)` of the peak, along the curve on both sides; of a linear response
with little damping they lie `2 zeta omega_n` apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self, TypeVar, overload

import numpy as np

from suboctave.arguments import checked
from suboctave.continuation.linear import one_thread
from suboctave.continuation.point import CurvePoint
from suboctave.curves.trace import BranchPoint
from suboctave.errors import InputError, is_number, shortened, suggest
from suboctave.harmonic.basis import Array
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.results.between import Between, Measure, orbit_at, value_at
from suboctave.store.layout import unit_of_column

if TYPE_CHECKING:
    import pandas

#: share of a peak at its half-power points
_HALF = math.sqrt(0.5)
#: relative difference of two values of a quantity that is none: a curve along which it stands has no peak
_EVEN = 1e-9


Item = TypeVar("Item")


class Found(Sequence[Item]):
    """Some things on a curve, in its order; `note` says why there are none."""

    def __init__(self, curve: Any, items: Sequence[Item], note: str = "") -> None:
        self.curve, self.note = curve, note
        self._items = tuple(items)

    def _some(self, items: Sequence[Item]) -> Self:
        return type(self)(self.curve, items, self.note)

    def __len__(self) -> int:
        return len(self._items)

    @overload
    def __getitem__(self, key: int) -> Item: ...
    @overload
    def __getitem__(self, key: slice) -> Self: ...

    def __getitem__(self, key: int | slice) -> Item | Self:
        return self._some(self._items[key]) if isinstance(key, slice) else self._items[key]


@checked(result=True)
class Points(Found[BranchPoint]):
    """Some points of a curve, in its order; a table when printed.

    Attributes
    ----------
    curve
        What they are points of.
    note
        Why there are none, where there are none.
    """

    @property
    def orbits(self) -> list[PeriodicOrbit]:
        """The motions."""
        return [point.orbit for point in self]

    @property
    def omega(self) -> Array:
        """Circular frequencies of the load, (len,)."""
        return np.array([orbit.omega for orbit in self.orbits])

    @property
    def amplitude(self) -> Array:
        """Largest |x| of the DOF that the curve observes, (len,)."""
        return np.array([point.amplitude for point in self])

    @property
    def stable(self) -> np.ndarray:
        """Whether each motion is stable, as the curve says it, (len,), bool."""
        return np.array([point.stable for point in self], dtype=bool)

    def parameter(self, name: str) -> Array:
        """omega or a parameter by name, (len,)."""
        return np.array([point.parameter(name) for point in self])

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per point: the free parameters, amplitude, stability."""
        import pandas as pd

        table: dict[str, Any] = {name: self.parameter(name) for name in self.curve._free}
        return pd.DataFrame({"omega": self.omega, **table, "amplitude": self.amplitude, "stable": self.stable})

    def __repr__(self) -> str:
        if not len(self):
            return self.note or "no points"
        units = self.curve.system.units
        columns = {_titled("omega", self.curve): self.omega}
        if units is not None:
            columns[units.cycles] = self.omega / (2.0 * math.pi)
        columns |= {name: self.parameter(name) for name in self.curve._free if name != "omega"}
        columns[_titled("amplitude", self.curve)] = self.amplitude
        widths = [max(14, 2 + len(title)) for title in columns]
        head = "".join(f"{title:>{width}}" for title, width in zip(columns, widths, strict=True))
        rows = [f"{'':3}{head}  stable"]
        for i, (values, stable) in enumerate(zip(zip(*columns.values(), strict=True), self.stable, strict=True)):
            cells = "".join(f"{value:>{width}.8g}" for value, width in zip(values, widths, strict=True))
            rows.append(f"{i:<3}{cells}  {'yes' if stable else 'no'}")
        return "\n".join(rows)


def _titled(name: str, curve: Any) -> str:
    """The head of a column with its unit, where the system declares units."""
    unit = unit_of_column(name, curve.system, curve.observe)
    return f"{name} ({unit})" if unit else name


def points_at(curve: Any, place: dict[str, Any]) -> Points:
    """See `Branch.at`."""
    free = curve._free
    if len(place) != 1:
        raise InputError(f"at() takes one value, such as at({free[-1]}=...), not {len(place)}")
    ((name, value),) = place.items()
    if name not in free:
        raise InputError(f"the curve was followed in {' and '.join(free)}, not in {name!r}{suggest(name, free)}")
    if not is_number(value):
        raise InputError(f"{name} must be a finite number, not {shortened(value)}")
    if not len(curve):
        return Points(curve, (), "the curve is empty")
    found = Between(curve).places(name, float(value))
    values = curve.parameter(name)
    low, high = float(values.min()), float(values.max())
    note = f"no point at {name} = {value:.6g}: the curve has {name} from {low:.6g} to {high:.6g}"
    return Points(curve, [curve.bound(point) for point in found], "" if found else note)


# ---------------------------------------------------------------------------------------------------------------- peaks
@checked(result=True)
@dataclass(frozen=True, eq=False, repr=False)
class Peak:
    """A local maximum of a quantity along a curve.

    Attributes
    ----------
    point
        The motion there, a point of the curve.
    name, parameter
        The free parameter of the curve and its value at the peak.
    height
        The quantity there.
    width, half_power
        Half-power width, and the values of the parameter between which it lies, where the quantity is `1 / sqrt(2)` of
        the height, along the curve; None where the curve does not come down to that, or rises to a higher peak before.
    harmonic, phase
        The strongest component at a multiple of omega (the one that was asked for), and its phase in radians: the
        component is `|c| cos(harmonic omega t + phase)`.
    """

    point: BranchPoint
    name: str
    parameter: float
    height: float
    half_power: tuple[float, float] | None
    harmonic: float
    phase: float

    @property
    def orbit(self) -> PeriodicOrbit:
        """The motion."""
        return self.point.orbit

    @property
    def omega(self) -> float:
        """Circular frequency of the load."""
        return self.orbit.omega

    @property
    def hertz(self) -> float:
        """Frequency of the load in cycles per unit time: Hz where that is 1 s."""
        return self.omega / (2.0 * math.pi)

    @property
    def stable(self) -> bool:
        """Whether the motion is stable."""
        return self.point.stable

    @property
    def width(self) -> float | None:
        """Distance of the half-power points."""
        return None if self.half_power is None else abs(self.half_power[1] - self.half_power[0])

    def __repr__(self) -> str:
        width = "no half-power width" if self.width is None else f"half-power width {self.width:.6g}"
        return f"<peak at {self.name}={self.parameter:.8g}, height={self.height:.7g}, {width}>"


@checked(result=True)
class Peaks(Found[Peak]):
    """The peaks of a curve, in its order; a table when printed. `highest` is the one of them that is, `what` says of
    which quantity they are.
    """

    def __init__(self, curve: Any, peaks: Sequence[Peak], note: str = "", *, what: str = "amplitude") -> None:
        super().__init__(curve, peaks, note)
        self.what = what

    def _some(self, items: Sequence[Peak]) -> Self:
        return type(self)(self.curve, items, self.note, what=self.what)

    @property
    def highest(self) -> Peak:
        """The highest peak."""
        if not self._items:
            raise InputError(self.note or "there are no peaks")
        return max(self._items, key=lambda peak: peak.height)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per peak: parameter, Hz, height, half-power width and points, harmonic, phase, stability.

        nan where there is no width.
        """
        import pandas as pd

        rows = []
        for peak in self:
            low, high = peak.half_power or (math.nan, math.nan)
            width = math.nan if peak.width is None else peak.width
            row = {peak.name: peak.parameter, "hertz": peak.hertz, self.what: peak.height, "width": width}
            row |= {"from": low, "to": high, "harmonic": peak.harmonic, "phase": peak.phase, "stable": peak.stable}
            rows.append(row)
        names = [self.curve.name, "hertz", self.what, "width", "from", "to", "harmonic", "phase", "stable"]
        return pd.DataFrame(rows, columns=names)

    def __repr__(self) -> str:
        if not self._items:
            return self.note or "no peaks"
        units = self.curve.system.units
        first, what = _titled(self.curve.name, self.curve), _titled(self.what, self.curve)
        room, wide = max(14, len(first) + 1), max(14, len(what) + 2)
        turns = f"{units.cycles if units else '1/time':>12}"
        head = f"{first:>{room}}{turns}{what:>{wide}}{'width':>12}{'harmonic':>10}{'phase':>9}  stable"
        rows = [head]
        for peak in self:
            width = "-" if peak.width is None else f"{peak.width:.6g}"
            rows.append(
                f"{peak.parameter:>{room}.8g}{peak.hertz:>12.6g}{peak.height:>{wide}.7g}{width:>12}{peak.harmonic:>10g}"
                f"{math.degrees(peak.phase):>8.1f}°  {'yes' if peak.stable else 'no'}"
            )
        return "\n".join(rows)


def peaks_of(curve: Any, what: str, measure: Measure, dof: int, harmonic: float | None) -> Peaks:
    """See `Branch.peaks`; `measure` of a motion, called `what`, `dof` the one whose components are named."""
    if len(curve) < 2:
        return Peaks(curve, (), "the curve has no two points", what=what)
    search = _Search(curve, measure)
    with one_thread():
        peaks = [search.peak(place, dof, harmonic) for place in search.places()]
    note = f"no peak of {what}: it is largest at an end of the curve, or the same all along it"
    return Peaks(curve, peaks, "" if peaks else note, what=what)


class _Search:
    """The maxima of a measure along a curve."""

    def __init__(self, curve: Any, measure: Measure) -> None:
        self.curve, self.measure = curve, measure
        self.between = Between(curve)
        self.nodes = self.between.nodes
        self.values = np.array([measure(node.orbit) for node in self.nodes])

    def _rate(self, point: CurvePoint) -> float:
        return self.between.change(point, self.measure)

    def places(self) -> Iterator[tuple[int, CurvePoint]]:
        """Every maximum: the node before it and its point."""
        values, last = self.values, len(self.nodes) - 1
        flat = _EVEN * float(np.abs(values).max(initial=0.0))
        seen = -1
        for i in range(last + 1):
            before = i == 0 or values[i - 1] <= values[i]
            behind = i == last or values[i + 1] <= values[i]
            if not (before and behind):
                continue
            for first in (i - 1, i):
                if first <= seen or not 0 <= first < last:
                    continue
                a, b = self.nodes[first], self.nodes[first + 1]
                if a.arclength == b.arclength or abs(values[first + 1] - values[first]) <= flat:
                    continue
                bracket = self.between.bracket(a, b, self._rate)
                if bracket.values[0.0] > 0.0 >= bracket.values[1.0]:
                    seen = first
                    yield first, self.between.zero(bracket)

    def peak(self, place: tuple[int, CurvePoint], dof: int, harmonic: float | None) -> Peak:
        """A maximum with what is read off it."""
        before, solved = place
        point = self.curve.bound(self.between.as_branch_point(solved))
        orbit, name = point.orbit, self.curve.name
        height = self.measure(orbit)
        sides = range(before, -1, -1), range(before + 1, len(self.nodes))
        low, high = (self._half_power(solved, height, nodes) for nodes in sides)
        half = None if low is None or high is None else (min(low, high), max(low, high))
        k = _strongest(orbit, dof) if harmonic is None else harmonic
        return Peak(point, name, value_at(solved, name), height, half, k, float(np.angle(orbit.harmonic(k, dof))))

    def _half_power(self, peak: CurvePoint, height: float, nodes: range) -> float | None:
        """The parameter where the measure has come down from a peak on one side, None where it does not."""
        target, beside = _HALF * height, peak
        for i in nodes:
            node = self.nodes[i]
            if self.values[i] > height * (1.0 + _EVEN):
                return None
            if self.values[i] <= target:
                bracket = self.between.bracket(beside, node, lambda p: self._at(p) - target)
                return value_at(self.between.zero(bracket), self.curve.name)
            beside = self.between.point_at(node)
        return None

    def _at(self, point: CurvePoint) -> float:
        return self.measure(orbit_at(point, point.u))


def _strongest(orbit: PeriodicOrbit, dof: int) -> float:
    """The multiple of omega at which a DOF moves most."""
    sizes = [abs(orbit.harmonic(k / orbit.basis.nu, dof)) for k in range(1, orbit.basis.harmonics + 1)]
    return (1 + int(np.argmax(sizes))) / orbit.basis.nu
