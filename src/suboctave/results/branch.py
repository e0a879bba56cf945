"""Computed branches: their points, bifurcations, and why they ended; curves of bifurcations in two parameters."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from suboctave.arguments import checked
from suboctave.bifurcation.bifurcation import Bifurcation, BifurcationList, target_multiplier
from suboctave.continuation.ending import Ending, interruption_of, sentence
from suboctave.continuation.problem import Array
from suboctave.curves.junction import Junction, period_name
from suboctave.curves.trace import Audit, BranchPoint, TrackedPoint, bound
from suboctave.errors import GivenDof, InputError, suggest
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.kinds import KINDS, plane_of_curve
from suboctave.model.system import System
from suboctave.pictures.cells import Pictured
from suboctave.results.linear import linear_trace
from suboctave.results.points import Peaks, Points, peaks_of, points_at
from suboctave.results.readings import BranchReadings, Readings, columns, measure_of, with_readings
from suboctave.store.layout import parameter_column, with_units
from suboctave.store.plain import padded
from suboctave.store.registry import Stored
from suboctave.store.table import write_csv
from suboctave.units import UnitSystem

if TYPE_CHECKING:
    import pandas
    import xarray

    from suboctave.results.sweep import SweepPath


@checked(result=True)
class CurveTables(Stored, Pictured):
    """One curve or several, as tables and as their files."""

    @abstractmethod
    def to_dataframe(self, readings: Readings = False) -> pandas.DataFrame:
        """One row per point."""

    @abstractmethod
    def bifurcations_frame(self) -> pandas.DataFrame:
        """One row per bifurcation."""

    def to_csv(self, path: str | Path, what: str = "points", overwrite: bool = False) -> Path:
        """The points, or the "bifurcations", as comma-separated text (.csv), with the units that the system declares in
        the heads.
        """
        frames = {"points": self.to_dataframe, "bifurcations": self.bifurcations_frame}
        if what not in frames:
            raise InputError(f"to_csv writes points or bifurcations, not {what!r}{suggest(str(what), frames)}")
        return write_csv(with_units(frames[what](), *self._observed), path, overwrite)

    @property
    @abstractmethod
    def _observed(self) -> tuple[System, int]:
        """The system, and the degree of freedom whose amplitude is reported."""

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Draw it: stable parts solid, unstable dashed, bifurcations marked, periods of a diagram in their own colours.

        Saved if a path is given; options are those of `suboctave.plot`.
        """
        from suboctave.pictures import plot

        return plot(self, path, **options)


def _span(name: str, first: float, last: float, units: UnitSystem | None) -> str:
    """The range of a parameter in words, frequencies with their units."""
    text = f"{name} from {first:.6g} to {last:.6g}"
    if name != "omega" or units is None:
        return text
    turn = 2.0 * np.pi
    return f"{text} {units.frequency} ({first / turn:.6g} to {last / turn:.6g} {units.cycles})"


def _table(rows: list[Any]) -> Array:
    """An array of numbers, or of rows, which may have several lengths: nan behind the shorter ones."""
    if len({np.shape(row) for row in rows}) > 1:
        return padded(rows, np.result_type(*rows).type)
    return np.array(rows)


def _over_points(path: str, meaning: str) -> Any:
    """What every point has under a dotted name, as an array along the branch."""
    read = attrgetter(path)
    column = cached_property(lambda branch: _table([read(point) for point in branch.points]))
    column.__doc__ = meaning
    return column


@checked(result=True)
class Branch(CurveTables, BranchReadings):
    """A curve of periodic motions along one free parameter.

    Attributes
    ----------
    system, name
        What vibrates, and the free parameter's name.
    observe
        DOF whose amplitude is reported.
    bifurcations, events
        Located bifurcations (`bifurcations["grazing"]`: the contacts that begin or cease to touch), and the user's
        events, in the order met.
    closed, ended
        Whether the curve closed on itself, and a sentence saying why it ended.
    endings
        The same as data: an `Ending` with its `reason` for the first and for the last point.
    interruption
        What stopped it before its end in one of its directions, Ctrl-C or a time limit (`seconds`); None if nothing
        did.
    departs, arrives
        Where it leaves the branch that it bifurcates from, and where it meets it again at its end (`Junction`); None
        where it does not.
    options
        Everything it was computed with.
    seconds
        How long that took; nan where nobody measured.
    """

    #: what its motions are, for legends
    shows: str = "response"

    def __init__(
        self,
        system: System,
        name: str,
        points: list[BranchPoint],
        bifurcations: list[Bifurcation],
        events: list[Bifurcation],
        closed: bool,
        endings: tuple[Ending, ...],
        observe: int,
        options: Mapping[str, Any],
        warnings: tuple[str, ...] = (),
        audit: Audit | None = None,
        departs: Junction | None = None,
        arrives: Junction | None = None,
    ) -> None:
        self.system = system
        self.name = name
        self.points = tuple([bound(point, self) for point in points])
        self.bifurcations = BifurcationList(bifurcations)
        self.events = BifurcationList(events, tuple({e.kind for e in events}))
        self.closed = closed
        self.endings = endings
        self.interruption = interruption_of(endings)
        self.observe = observe
        self.options = dict(options)
        self.warnings = warnings
        self.audit = audit or Audit()
        self.departs = departs
        self.arrives = arrives

    def __len__(self) -> int:
        return len(self.points)

    def __iter__(self) -> Iterator[BranchPoint]:
        return iter(self.points)

    @overload
    def __getitem__(self, key: int) -> BranchPoint: ...
    @overload
    def __getitem__(self, key: slice) -> Points: ...

    def __getitem__(self, key: int | slice) -> BranchPoint | Points:
        """A point by its place, `curve[-1]` the last one, or some of them, `curve[10:20]`."""
        return Points(self, self.points[key]) if isinstance(key, slice) else self.points[key]

    def linear(self) -> Branch:
        """The response of the same system without its elements over the same range, `system.linear()`."""
        system, trace = linear_trace(self)
        response = Branch(system, self.name, trace.points, [], [], trace.closed, trace.endings, self.observe, {})
        response.shows = "linear response"
        return response

    def plot(self, path: Any = None, *, linear: bool = False, **options: Any) -> Any:
        """Draw it: stable parts solid, unstable dashed, bifurcations marked.

        Saved if a path is given; options are those of `suboctave.plot`. `linear`: with the response of the system
        without its elements.
        """
        from suboctave.pictures import plot

        return plot([self, self.linear()] if linear else self, path, **options)

    def bound(self, point: BranchPoint) -> BranchPoint:
        """A motion on the curve as one of its points."""
        return bound(point, self)

    def at(self, **place: float) -> Points:
        """All points at a value of a parameter that the curve was followed in, such as `curve.at(omega=1.5)`.

        They are solved between those of the curve, in its order: several where it folds, none, with words why when they
        are printed, outside its range. Their stability is computed when it is asked for.

        Raises
        ------
        InputError
            For a parameter that was not free.
        ConvergenceError
            If Newton's method does not arrive at a point.
        """
        return points_at(self, place)

    def peaks(
        self,
        quantity: str | Callable[[PeriodicOrbit], float] = "amplitude",
        *,
        dof: GivenDof | None = None,
        harmonic: float | None = None,
    ) -> Peaks:
        """The local maxima of a quantity along the curve, solved for, with their half-power widths and phases.

        Parameters
        ----------
        quantity
            "amplitude" (default), another reading by its name (`reading`), or a function of a motion.
        dof
            Of which degree of freedom, by number or name; default the observed one.
        harmonic
            The amplitude of the component at this multiple of omega instead.
        """
        what, measure = measure_of(self, quantity, dof, harmonic)
        return peaks_of(self, what, measure, self._dof(dof), harmonic)

    @property
    def _observed(self) -> tuple[System, int]:
        return self.system, self.observe

    @property
    def ended(self) -> str:
        """Why it ended, in words."""
        return sentence(self.endings)

    @property
    def nu(self) -> int:
        """Period of its motions in periods of the load: 1 for T, 2 for 2T, ..."""
        return self.points[0].orbit.basis.nu if self.points else 1

    @property
    def basis(self) -> tuple[str, ...]:
        """What its motions rest on, in sentences: the projection of a large structure and its error, structural
        damping. Empty where its matrices are taken as they are.
        """
        parts = {id(p.orbit.balance.linear): p.orbit.balance.linear for p in self.points}
        # of those that have grown from each other, the one for the highest frequencies
        widest = max(parts.values(), key=lambda part: getattr(part, "covers", 0.0), default=None)
        return () if widest is None else widest.words

    @property
    def junctions(self) -> list[tuple[Junction, PeriodicOrbit]]:
        """Where it leaves or meets another branch, each with its own motion right beside."""
        ends = ((self.departs, 0), (self.arrives, -1))
        return [(end, self.points[i].orbit) for end, i in ends if end is not None and self.points]

    @property
    def grazings(self) -> list[Bifurcation]:
        """Where contacts begin or cease to touch, in the order met."""
        return self.bifurcations["grazing"]

    @property
    def orbits(self) -> list[PeriodicOrbit]:
        """The motions, in the order they were computed."""
        return [p.orbit for p in self.points]

    omega: Array = _over_points("orbit.omega", "Circular frequency of the load, shape (len,).")
    multipliers: ComplexArray = _over_points(
        "floquet.multipliers",
        "Floquet multipliers over the response period, by descending modulus, (len, 2 N); nan behind shorter rows.",
    )
    multiplier_errors: Array = _over_points("floquet.errors", "Estimated errors of the multipliers, shape (len, 2 n).")
    arclength: Array = _over_points("arclength", "Distance along the branch in scaled arclength, shape (len,).")
    truncation: Array = _over_points(
        "orbit.truncation", "Estimated size of the neglected harmonics relative to the motion, shape (len,)."
    )
    harmonics: np.ndarray = _over_points(
        "orbit.basis.harmonics", "Highest multiple of the base frequency used at each point, shape (len,), int."
    )

    def parameter(self, name: str) -> Array:
        """Values of omega or a parameter along the branch, shape (len,).

        Raises
        ------
        InputError
            If there is no parameter of that name.
        """
        if name == "omega":
            return self.omega
        if name not in self.system.parameters:
            raise InputError(f"unknown parameter {name!r}{suggest(name, ['omega', *self.system.parameters])}")
        return np.array([p.orbit.values[name] for p in self.points])

    @cached_property
    def amplitude(self) -> Array:
        """Largest |x| of the observed DOF over one response period, shape (len,)."""
        return np.array([p.orbit.amplitude(self.observe) for p in self.points])

    def harmonic(self, k: float, dof: GivenDof | None = None) -> ComplexArray:
        """Complex amplitude of the component at `k omega` (of the observed DOF unless told), shape (len,)."""
        where = self._dof(dof)
        return np.array([p.orbit.harmonic(k, where) for p in self.points])

    @cached_property
    def stable(self) -> np.ndarray:
        """Whether each motion is stable, shape (len,), bool: see `stable_at`."""
        return np.array([self.stable_at(point) for point in self.points], dtype=bool)

    def stable_at(self, point: BranchPoint) -> bool:
        """Whether the motion at a point is stable; not where that is open."""
        return point.floquet.stable and not point.floquet.vague

    @cached_property
    def open(self) -> np.ndarray:
        """Where the errors of multipliers are too large for a verdict, shape (len,), bool."""
        return np.array([p.floquet.vague for p in self.points], dtype=bool)

    def deciding(self, point: BranchPoint, multipliers: ComplexArray) -> NDArray[np.bool_]:
        """Which multipliers of the motion at a point decide whether it is stable: all, (m,), bool."""
        return np.ones(len(multipliers), dtype=bool)

    def open_at(self, point: BranchPoint) -> NDArray[np.bool_]:
        """Which multipliers leave the verdict at a point open, (m,), bool: of those that decide the ones within their
        errors of the unit circle.
        """
        floquet = point.floquet
        return floquet.open & self.deciding(point, floquet.multipliers)

    @cached_property
    def multiplier_open(self) -> np.ndarray:
        """Which multipliers leave the verdict open (`open_at`), (len, 2 N), bool."""
        table = np.zeros(self.multipliers.shape, dtype=bool)
        for row, point in zip(table, self.points, strict=True):
            row[: len(point.floquet.multipliers)] = self.open_at(point)
        return table

    @property
    def verdicts(self) -> str:
        """How many motions are unstable, in words, and of how many that cannot be told: without damping, or where the
        errors of multipliers are too large.
        """
        results = [p.floquet for p in self.points]
        decided = [r for r in results if not r.vague and (r.decided or not r.undamped)]
        unstable, rest = sum(not r.stable for r in decided), len(results) - len(decided)
        return f"{unstable} unstable" + (f", {rest} not settled" if rest else "")

    @cached_property
    def stability_methods(self) -> list[str]:
        """Where each point's multipliers come from, in words."""
        return [p.floquet.method for p in self.points]

    @cached_property
    def kept(self) -> np.ndarray:
        """How many harmonics are unknowns at each point: all up to the highest, shape (len,), int."""
        return self.harmonics

    def to_xarray(self, readings: Readings = False, motions: bool = False) -> xarray.Dataset:
        """The branch as a labelled dataset: points, events, and what produced them.

        `readings`: names of read-offs to add (see `reading`), functions of a motion, or True for all of
        `available_readings`. `motions`: with the Fourier coefficients of the motions
        (`suboctave.store.motions.with_motions`).
        """
        from suboctave.store.layout import branch_dataset, events_met
        from suboctave.store.motions import elements_of, with_motions

        dataset = with_readings(branch_dataset(self), self, events_met(self), readings)
        if not motions:
            return dataset
        forces = [f"peak_force_{index}" for index in elements_of(self.system)]
        return with_motions(with_readings(dataset, self, events_met(self), forces), self)

    def to_dataframe(self, readings: Readings = False) -> pandas.DataFrame:
        """One row per point: free parameters, amplitude, stability, leading multiplier, errors; read-offs on request.

        `readings` as in `to_xarray`. A parameter that bears the name of another column is in "parameter.NAME".
        """
        import pandas as pd

        own = self._columns(readings)
        taken = ("omega", *own)
        table: dict[str, Any] = {"omega": self.omega}
        table |= {parameter_column(name, taken): self.parameter(name) for name in self._free if name != "omega"}
        return pd.DataFrame(table | own)

    @property
    def _free(self) -> tuple[str, ...]:
        """The parameters that it was followed in."""
        return (self.name,)

    def _columns(self, readings: Readings) -> dict[str, Any]:
        """The columns of `to_dataframe` but omega and the free parameters."""
        leading = self.multipliers[:, 0]
        return {
            "amplitude": self.amplitude,
            "stable": self.stable,
            "multiplier_real": leading.real,
            "multiplier_imag": leading.imag,
            "arclength": self.arclength,
            "harmonics": self.harmonics,
            "truncation": self.truncation,
            "residual": [p.orbit.residual for p in self.points],
            **columns(self, readings),
        }

    def bifurcations_frame(self) -> pandas.DataFrame:
        """One row per bifurcation, grazing and event, in the order met: place, parameters, multiplier, errors.

        A parameter that bears the name of another column is in "parameter.NAME".
        """
        import pandas as pd

        own = ["kind", "omega", "amplitude", "multiplier_real", "multiplier_imag"]
        own += ["criticality", "residual", "uncertainty", "arclength", "remark"]
        names = {name: parameter_column(name, own) for name in self.system.parameters}
        rows = []
        for item in sorted([*self.bifurcations.met, *self.events.met], key=lambda b: b.arclength):
            mu = item.critical_multiplier()
            row = {name: getattr(item, name, None) for name in own} | {"remark": item.remark()}
            row |= {"multiplier_real": mu.real, "multiplier_imag": mu.imag, "criticality": item.criticality or ""}
            rows.append({names[n]: value for n, value in item.parameters.items() if n in names} | row)
        return pd.DataFrame(rows, columns=[*own[:2], *names.values(), *own[2:]])

    def sweep_path(self, direction: str = "up") -> SweepPath:
        """The path that a slow sweep of the free parameter "up" or "down" would follow, with its jumps."""
        from suboctave.results.sweep import sweep_path

        return sweep_path(self.to_xarray(), direction)

    def hysteresis(self) -> list[tuple[float, float]]:
        """Ranges of the free parameter in which sweeps up and down find different motions."""
        from suboctave.results.sweep import hysteresis

        return hysteresis(self.to_xarray())

    @property
    def _head(self) -> str:
        """What it is, in a line."""
        values = self.parameter(self.name)
        span = _span(self.name, values[0], values[-1], self.system.units) if len(self) else "empty"
        kind = "Branch" if self.nu == 1 else f"Branch of {period_name(self.nu)} motions"
        leaves = "" if self.departs is None else f"leaves {self.departs}; "
        return f"{kind}: {len(self)} points ({self.verdicts}), {span}; {leaves}{self.ended}."

    def __repr__(self) -> str:
        notes = (f"  note: {warning}" for warning in self.warnings)
        return "\n".join([self._head, *(f"  {words}" for words in self.basis), *notes, repr(self.bifurcations)])


# ----------------------------------------------------------------------------------------------- curves of bifurcations
@checked(result=True)
class TrackedBranch(Branch):
    """Bifurcations of one kind in two parameters, or motions singled out otherwise, in order; read like a `Branch`.

    Attributes
    ----------
    kind
        "LP", "BP", "PD", "NS", "Hopf" or "grazing"; "phase_resonance", "ridge", "limit_cycle", ... of motions.
    names
        The two free parameters; `name` is the last. Three of a curve of extrema and of bifurcations of limit cycles,
        whose omega is free; omega alone of a nonlinear mode.
    turning
        The one of them that is extreme all along a curve of extrema; else empty.
    bifurcations
        Extrema of either parameter and points of codimension two, in the order met; `extrema` the former.
    """

    def __init__(self, kind: str, names: tuple[str, ...], *args: Any, turning: str = "", **named: Any) -> None:
        super().__init__(*args, **named)
        self.turning = turning
        self.kind = kind
        self.names = names
        if self.plane is None:
            self.shows = f"{KINDS[kind].words}s"

    @property
    def ended(self) -> str:
        """Why it ended, in words."""
        return sentence(self.endings, go_on="")

    @property
    def plane(self) -> tuple[str, str] | None:
        """The two parameters that it is drawn over: of a curve of extrema the third one and the extreme one; None of
        limit cycles, which are drawn over their parameter as responses are.
        """
        return plane_of_curve(self.kind, self.names, self.turning)

    @property
    def extrema(self) -> list[Bifurcation]:
        """Where the curve turns in one of its parameters (`parameter_name`), on ridges also where the peaks are highest
        or lowest (`parameter_name` "amplitude"), in the order met.
        """
        return self.bifurcations["extremum"]

    def stable_at(self, point: BranchPoint) -> bool:
        """Whether all multipliers but the critical one (or pair) lie inside the unit circle: where they do, the curve
        is a border of stable motions.
        """
        mu = point.floquet.multipliers
        return bool(np.all(np.abs(mu[self.deciding(point, mu)]) < 1.0))

    @property
    def verdicts(self) -> str:
        """At how many points another multiplier than the critical ones lies outside the unit circle, in words."""
        return f"{int(np.count_nonzero(~self.stable))} unstable"

    @cached_property
    def kappa(self) -> Array:
        """Frequency of the critical perturbation along a curve of NS or Hopf points, rad per unit time; else zeros;
        shape (len,).
        """
        return np.array([p.extra if self.kind in ("NS", "Hopf") else 0.0 for p in self.tracked])

    @cached_property
    def coefficient(self) -> Array:
        """The coefficient that decides the normal form, a of LP, c3 of PD (`bifurcation.normal_form`), else nan.

        c3 is negative where the doublings are supercritical and changes sign at a GPD; a does so at a cusp. Shape
        (len,).
        """
        return np.array([p.coefficient for p in self.tracked])

    @property
    def extreme(self) -> list[str]:
        """Along a curve of extrema whether each is a "minimum" or a "maximum" of `turning`; else empty texts."""
        return [p.extreme for p in self.tracked]

    @property
    def isola(self) -> list[str]:
        """Along a curve of extrema of limit points "isola_centre" or "isola_merging" (`TrackedEvent`), else empty."""
        return [p.isola for p in self.tracked]

    @property
    def tracked(self) -> tuple[TrackedPoint, ...]:
        """The points, with what only tracked curves have."""
        return tuple(point for point in self.points if isinstance(point, TrackedPoint))

    def deciding(self, point: BranchPoint, multipliers: ComplexArray) -> NDArray[np.bool_]:
        """See `Branch.deciding`: all but the critical ones."""
        mu, others = multipliers, np.ones(len(multipliers), dtype=bool)
        extra = point.extra if isinstance(point, TrackedPoint) else 0.0
        target, count = target_multiplier(self.kind, extra * point.orbit.period), KINDS[self.kind].critical
        if KINDS[self.kind].free_phase and self.turning:
            count += 1
        elif len(self.names) == 3 and not self.turning:
            # bifurcations of limit cycles, which have a multiplier +1 besides
            others[np.abs(mu - 1.0).argmin()] = False
        if target is not None:
            distance = np.where(others, np.minimum(np.abs(mu - target), np.abs(mu - np.conj(target))), np.inf)
            others[np.argsort(distance, kind="stable")[:count]] = False
        return others

    @property
    def _free(self) -> tuple[str, ...]:
        return self.names

    def _columns(self, readings: Readings) -> dict[str, Any]:
        """As of any branch, and `coefficient`, and `kappa` of an NS curve."""
        own = super()._columns(readings) | {"coefficient": self.coefficient}
        return own | {"kappa": self.kappa} if self.kind in ("NS", "Hopf") else own

    @property
    def _head(self) -> str:
        ends = [", ".join(f"{n}={self.parameter(n)[i]:.6g}" for n in self.names) for i in (0, -1)]
        what = f"{self.kind} curve, extrema of {self.turning}" if self.turning else f"{self.kind} curve"
        return f"{what}: {len(self)} points from {ends[0]} to {ends[1]}; {self.ended}."
