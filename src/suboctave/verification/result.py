"""What shooting says of a branch: verdicts on its points and bifurcations, and these as a labelled dataset.

On `point`: `index` (which point of the branch), `omega`, `amplitude`, `distance`, `multipliers` (point x multiplier,
nan behind those that there are), `multiplier_errors`, `multiplier_error` (the largest difference from the branch's),
`stable` and `computed` (1, 0, or -1 where there is no verdict), `outcome`, `reason`; on `event` with the prefix
`event_`: `kind`, `omega`, `amplitude`, `true_omega`, `distance`, `agrees`, `reason`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.arguments import checked
from suboctave.continuation.problem import Array
from suboctave.experiments.common import TimeResult
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.files import branch_from_dataset, branch_to_dataset
from suboctave.store.layout import parameter_column
from suboctave.store.plain import Recorded, flat, padded, recorded
from suboctave.store.registry import Codec, Datasets, parts_of, register
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


AGREES, DISAGREES, OPEN = "agrees", "disagrees", "cannot tell"


@dataclass(frozen=True, eq=False)
class VerifiedPoint:
    """One point of a branch against the true motion beside it.

    Attributes
    ----------
    index, omega, amplitude
        Which point of the branch, and where it lies.
    distance
        Largest difference of the states at the instants of shooting, relative to the motion, or of the frequencies if
        larger; inf where no true motion was found.
    multipliers, errors
        (2n,): of the true motion over the response period, by falling modulus, and their estimated errors.
    multiplier_error
        Largest difference from those of the branch, paired, relative to those that are larger than one.
    stable, computed
        The verdict of the true motion, None without one, and that of the branch.
    outcome, reason
        "agrees", "disagrees" or "cannot tell", and why.
    """

    index: int
    omega: float
    amplitude: float
    distance: float
    multipliers: ComplexArray
    errors: Array
    multiplier_error: float
    stable: bool | None
    computed: bool | None
    outcome: str
    reason: str

    @property
    def margin(self) -> float:
        """Largest modulus of the true multipliers minus one."""
        return float(np.max(np.abs(self.multipliers))) - 1.0 if len(self.multipliers) else float("nan")

    @property
    def agrees(self) -> bool:
        """Whether it does, for certain."""
        return self.outcome == AGREES

    def __repr__(self) -> str:
        return (
            f"point {self.index} at omega = {self.omega:.8g}: {self.outcome}; distance {self.distance:.1e}, "
            f"multipliers {self.multiplier_error:.1e}. {self.reason}"
        )


@dataclass(frozen=True, eq=False)
class VerifiedBifurcation:
    """A bifurcation of a branch against shooting: its frequency in time, how far that is off, whether it is confirmed.

    `distance` is along the curve of true motions and from it, relative to the motion.
    """

    kind: str
    omega: float
    parameters: Mapping[str, float]
    amplitude: float
    true_omega: float
    distance: float
    agrees: bool
    reason: str

    def __repr__(self) -> str:
        verdict = "confirmed" if self.agrees else "NOT CONFIRMED"
        return f"{self.kind} at omega = {self.omega:.9g}: {verdict}; distance {self.distance:.1e}. {self.reason}"


_KINDS: dict[Any, type] = {"int": int, "float": float, "str": str, "bool": bool}
#: columns of the table behind those that say where a point lies
_OTHERS = ("amplitude", "distance", "multiplier_error", "stable", "computed", "outcome", "margin", "reason")
_LEADING = ("multiplier_real", "multiplier_imag")
#: columns of points and of bifurcations in a dataset, with their types
POINT_COLUMNS, EVENT_COLUMNS = (
    {column.name: _KINDS[column.type] for column in fields(kind) if column.type in _KINDS}
    for kind in (VerifiedPoint, VerifiedBifurcation)
)
VERDICTS = ("stable", "computed")


@checked(result=True)
@dataclass(frozen=True, eq=False, repr=False)
class BranchVerification(TimeResult):
    """What shooting says of a branch.

    Its table (`to_dataframe`) has one row per point: distance, true multiplier that leads, errors, verdicts, outcome
    and reason.

    Attributes
    ----------
    points, bifurcations
        `VerifiedPoint` and `VerifiedBifurcation` of each that was looked at, in the order of the branch.
    complete
        False where an interruption left some out: `interruption`, Ctrl-C or a time limit.
    basis
        In which modes a large structure was integrated, and with which error; empty for one that was taken as it is.
    """

    branch: Branch
    points: tuple[VerifiedPoint, ...]
    bifurcations: tuple[VerifiedBifurcation, ...]
    tolerance: float
    complete: bool
    interruption: Interruption | None = None
    basis: str = ""

    @property
    def agrees(self) -> bool:
        """Whether nothing was found to be wrong."""
        return not self.disagreements and all(item.agrees for item in self.bifurcations)

    @property
    def disagreements(self) -> list[VerifiedPoint]:
        """The points at which the time domain contradicts."""
        return [point for point in self.points if point.outcome == DISAGREES]

    @property
    def undecided(self) -> list[VerifiedPoint]:
        """The points of which nothing can be told, each with its reason."""
        return [point for point in self.points if point.outcome == OPEN]

    @property
    def summary(self) -> str:
        """What was found, in a sentence or two."""
        bad, left = self.disagreements, self.undecided
        known = [point.distance for point in self.points if np.isfinite(point.distance)]
        text = f"{sum(point.agrees for point in self.points)} of {len(self.points)} points agree with shooting"
        if known:
            text += f" (largest distance {max(known):.1e})"
        if bad:
            text += f", {len(bad)} disagree{'s' * (len(bad) == 1)}, the first at omega = {bad[0].omega:.6g}"
        if left:
            text += f", {len(left)} undecided"
        confirmed = sum(item.agrees for item in self.bifurcations)
        if self.bifurcations:
            text += f"; {confirmed} of {len(self.bifurcations)} bifurcations are confirmed"
        return text + ("." if self.complete else f"; {self.interruption or Interruption()} before the end.")

    def to_xarray(self) -> xarray.Dataset:
        """Points and bifurcations with their outcomes; the branch itself is `branch.to_xarray()`."""
        import xarray

        points, events = self.points, self.bifurcations
        tables = ("", "point", points, POINT_COLUMNS), ("event_", "event", events, EVENT_COLUMNS)
        variables: dict[str, Any] = {
            f"{prefix}{name}": (axis, np.array([getattr(item, name) for item in items], dtype=kind))
            for prefix, axis, items, columns in tables
            for name, kind in columns.items()
        }
        for name in VERDICTS:
            verdicts = [getattr(p, name) for p in points]
            variables[name] = ("point", np.array([-1 if v is None else int(v) for v in verdicts], dtype=int))
        variables["multipliers"] = (("point", "multiplier"), padded([p.multipliers for p in points], complex))
        variables["multiplier_errors"] = (("point", "error"), padded([p.errors for p in points], float))
        attributes = {
            "contents": "verification",
            "free": self.branch.name,
            "tolerance": self.tolerance,
            "complete": int(self.complete),
            "said": self.summary,
            "projection": self.basis,
            "system": self.branch.system.name,
            "suboctave": __version__,
        }
        return xarray.Dataset(dict(flat(variables)), attrs=attributes)

    def _columns(self) -> Mapping[str, Any]:
        leading = np.array([p.multipliers[0] if len(p.multipliers) else np.nan for p in self.points], dtype=complex)
        columns: dict[str, Any] = {name: [getattr(p, name) for p in self.points] for name in ("index", "omega")}
        if (name := self.branch.name) != "omega":
            at = self.branch.parameter(name)[np.array(columns["index"], dtype=int)]
            columns[parameter_column(name, [*columns, *_OTHERS, *_LEADING])] = at
        columns |= {name: [getattr(p, name) for p in self.points] for name in _OTHERS}
        return columns | dict(zip(_LEADING, (leading.real, leading.imag), strict=True))

    def bifurcations_frame(self) -> pandas.DataFrame:
        """One row per bifurcation: kind, frequencies, distance, whether it is confirmed, why."""
        import pandas as pd

        names = ["kind", "omega", "amplitude", "true_omega", "distance", "agrees", "reason"]
        return pd.DataFrame([{name: getattr(b, name) for name in names} for b in self.bifurcations], columns=names)

    def plot(self, path: Any = None, **options: Any) -> Figure:
        """The branch with a mark on each point that was looked at: a tick, a cross where shooting disagrees.

        Options are those of `pictures.plot_verified`: `title`, `size`.
        """
        from suboctave.pictures.in_time import plot_verified

        branch = self.branch
        plane = branch.plane if isinstance(branch, TrackedBranch) else None
        x, y = plane or (branch.name, "amplitude")
        across, upwards = branch.parameter(x), branch.amplitude if plane is None else branch.parameter(y)
        places = np.array([(across[p.index], upwards[p.index]) for p in self.points]).reshape(-1, 2)
        bad = [
            [{"omega": b.omega, "amplitude": b.amplitude, **b.parameters}[name] for name in (x, y)]
            for b in self.bifurcations
            if not b.agrees
        ]
        wrong = np.array(bad).reshape(-1, 2)
        outcomes = [point.outcome for point in self.points]
        return plot_verified(branch.to_xarray(), places, outcomes, wrong, path=path, **options)

    def _in_words(self) -> str:
        wrong = [*self.disagreements, *(b for b in self.bifurcations if not b.agrees)]
        lines = [f"BranchVerification: {self.summary}", *(f"  {one!r}" for one in wrong[:8])]
        if len(wrong) > 8:
            lines.append(f"  and {len(wrong) - 8} more")
        return "\n".join(lines)


# ---------------------------------------------------------------------------------------- files: a head, and the branch
def _write(check: BranchVerification) -> dict[str, xarray.Dataset]:
    """The head under the name "", and the branch."""
    record = {
        "multipliers": [len(p.multipliers) for p in check.points],
        "errors": [len(p.errors) for p in check.points],
        "parameters": [dict(e.parameters) for e in check.bifurcations],
    }
    head = recorded(check.to_xarray(), record, "numbers of multipliers, parameters, as JSON")
    return {"": head.assign_attrs(parts="branch"), "branch": branch_to_dataset(check.branch)}


def _read(groups: Datasets, allow_code: bool, linear: LinearPart | None) -> BranchVerification:
    branch = branch_from_dataset(parts_of(groups, ["branch"], "verification")["branch"], allow_code, linear)
    stored = Recorded(groups[""], allow_code)
    points = []
    for i, (count, errors) in enumerate(zip(stored.record["multipliers"], stored.record["errors"], strict=True)):
        known: dict[str, Any] = {name: kind(stored[name][i]) for name, kind in POINT_COLUMNS.items()}
        known |= {name: None if stored[name][i] < 0 else bool(stored[name][i]) for name in VERDICTS}
        mu, doubt = stored["multipliers"][i, :count].copy(), stored["multiplier_errors"][i, :errors].copy()
        points.append(VerifiedPoint(multipliers=mu, errors=doubt, **known))
    events = [
        VerifiedBifurcation(
            parameters=values, **{n: kind(stored[f"event_{n}"][i]) for n, kind in EVENT_COLUMNS.items()}
        )
        for i, values in enumerate(stored.record["parameters"])
    ]
    attributes = stored.dataset.attrs
    tolerance, complete = float(attributes["tolerance"]), bool(attributes["complete"])
    basis = str(attributes.get("projection", ""))
    return BranchVerification(branch, tuple(points), tuple(events), tolerance, complete, basis=basis)


register(Codec("verification", BranchVerification, _write, _read))
