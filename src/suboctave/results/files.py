"""Branches and diagrams as datasets that hold all of them, and back: what `save` and the journal of a study keep.

Of a branch: the dataset of `Branch.to_xarray()` (`suboctave.store.layout`) with complex numbers as pairs of variables
`..._real`, `..._imag`, and besides on `point`: `coefficients` (point x coefficient x unknown, padded with zeros),
`arclength`, `iterations`, `multiplier_errors`; on `event` the same under `event_...` and the null vectors. What is
neither a number per point nor per event is JSON in the variable `record`. docs/results.md describes it for readers
without this package.

Of a diagram: a head with one entry for each branch on the dimension `branch`, by number: `label`, `period`, `depth`,
`parent` (the number of the branch that it leaves, -1 for the response) and `origin` (the index of the bifurcation that
it leaves at on the dimension `event` of its parent, -1 for a response; that from the other end has the first one for
its parent); and the branches. Bifurcations that were left out or where nothing could be followed are JSON in `record`,
by branch and index of the event.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent
from suboctave.bifurcation.bordered import NullVectors
from suboctave.bifurcation.gaps import GrazingContact
from suboctave.bifurcation.normal_form import NormalForm
from suboctave.continuation.ending import Ending, read_endings
from suboctave.curves.audit import Audit, Unsettled
from suboctave.curves.junction import Junction
from suboctave.curves.points import BranchPoint
from suboctave.errors import InputError
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.interruption import Interruption
from suboctave.model.system import System, build, describe
from suboctave.results.branch import Branch, TrackedBranch, tracked_points, tracked_record
from suboctave.results.diagram import BifurcationDiagram, DiagramBranch
from suboctave.store.layout import branch_dataset, events_met
from suboctave.store.plain import Prefixed, array_of, flat, from_json, padded, system_arrays, to_json
from suboctave.store.registry import Codec, parts_of, register

if TYPE_CHECKING:
    import xarray


_CLASSES = {
    c.__name__: c
    for c in (Audit, Unsettled, Ending, GrazingContact, Junction, AdaptiveHarmonics, FloquetResult, NormalForm)
}
_MEANINGS = {
    "coefficients": "a_0, a_1, b_1, ... of x(t) = a_0 + sum a_k cos(k w t) + b_k sin(k w t), w = omega / period",
    "event_coefficients": "the same of the motions at events",
    "arclength": "distance along the branch in scaled arclength",
    "iterations": "Newton iterations",
    "multiplier_errors": "estimated errors of the multipliers",
    "record": "system, options, warnings, audit and what motions share, as JSON",
}


def branch_to_dataset(branch: Branch) -> xarray.Dataset:
    """Everything that a branch holds, as a dataset of numbers and texts that a file can hold.

    Raises InputError where its system cannot be written down.
    """
    import xarray

    writer = _Writer()
    dataset = branch_dataset(branch)
    new: dict[str, Any] = {
        "arclength": (("point",), branch.arclength),
        "iterations": (("point",), np.array([p.iterations for p in branch.points], dtype=int)),
    }
    points = [p.orbit for p in branch.points]
    new |= _orbits("", "point", points, [p.floquet for p in branch.points])
    events = events_met(branch)
    lists = enumerate((branch.bifurcations.met, branch.events.met))
    listed = {id(event): (which, i) for which, items in lists for i, event in enumerate(items)}
    new |= _orbits("event_", "event", [e.orbit for e in events], [e.floquet for e in events])
    for side in ("right", "left"):
        rows = [() if e.null_vectors is None else getattr(e.null_vectors, side) for e in events]
        new[f"event_null_{side}"] = (("event", "null"), padded(rows, complex))
    record = {
        "points": [writer.motion(p.orbit, p.floquet) for p in branch.points],
        "event_list": [listed[id(event)] for event in events],
        "events": [writer.event(event, branch) for event in events],
        "name": branch.name,
        "options": branch.options,
        "warnings": tuple(branch.warnings),
        "audit": branch.audit,
        "closed": bool(branch.closed),
        "ended": branch.ended,
        "endings": branch.endings,
        "departs": branch.departs,
        "arrives": branch.arrives,
        "observe": int(branch.observe),
        "seconds": float(branch.seconds),
        "system": writer.system(branch.system),
        "tables": writer.tables,
        "tracked": tracked_record(branch) if isinstance(branch, TrackedBranch) else None,
    }
    new["record"] = ((), np.array(to_json(record), dtype=object))
    for name, array in writer.arrays.items():
        new[name] = (tuple(f"{name}_{axis}" for axis in range(array.ndim)), array)
    for name, meaning in _MEANINGS.items():
        new[name] = (*new[name][:2], {"long_name": meaning})
    # a parameter that bears the name of a variable is in `parameters` all the same
    coords = [name for name in dataset.coords if name not in new]
    variables = {name: (v.dims, v.values, v.attrs) for name, v in dataset.variables.items() if name not in new} | new
    attributes = {name: value for name, value in dataset.attrs.items() if name != "warnings"}  # they are in `record`
    if branch.seconds == branch.seconds:
        attributes["seconds"] = float(branch.seconds)
    attributes["contents"] = "branch"
    return xarray.Dataset(dict(flat(variables)), attrs=attributes).set_coords(coords)


def branch_from_dataset(dataset: xarray.Dataset, allow_code: bool = False, linear: LinearPart | None = None) -> Branch:
    """The branch that `branch_to_dataset` wrote, equal bit for bit.

    `linear`: the linear part that it was computed with, where that was not the system's own matrices.
    """
    return _Reader(dataset, allow_code, linear).branch()


register(
    Codec(
        "branch",
        Branch,
        lambda branch: {"": branch_to_dataset(branch)},
        lambda groups, allow_code, linear: branch_from_dataset(groups[""], allow_code, linear),
    )
)


def _orbits(
    prefix: str, dimension: str, orbits: Sequence[PeriodicOrbit], verdicts: Sequence[FloquetResult]
) -> dict[str, tuple[tuple[str, ...], Any]]:
    """Coefficients and multipliers of several motions, padded to the longest."""
    longest = max((o.coefficients.shape[0] for o in orbits), default=0)
    size = max((o.coefficients.shape[1] for o in orbits), default=0)
    table = np.zeros((len(orbits), longest, size))
    for row, orbit in zip(table, orbits, strict=True):
        row[: orbit.coefficients.shape[0], : orbit.coefficients.shape[1]] = orbit.coefficients
    # a dimension of its own for each: the longest motion among the points is not that among the events
    shape = (dimension, f"{prefix}coefficient", "unknown" if orbits else f"{prefix}unknown")
    variables: dict[str, tuple[tuple[str, ...], Any]] = {f"{prefix}coefficients": (shape, table)}
    numbers = (dimension, "event_floquet" if prefix else "multiplier")
    variables[f"{prefix}multipliers"] = (numbers, padded([v.multipliers for v in verdicts], complex))
    variables[f"{prefix}multiplier_errors"] = (numbers, padded([v.errors for v in verdicts], float))
    return variables


class _Writer:
    """Collects what motions share, each thing once: systems, discretisations, rules of harmonics, contexts."""

    def __init__(self) -> None:
        self.arrays: dict[str, np.ndarray] = {}
        self.tables: dict[str, list[Any]] = {"systems": [], "discretisations": [], "rules": [], "contexts": []}
        #: numbers of systems and balances by identity, with these, so that no other object takes it
        self._numbers: dict[int, tuple[int, Any]] = {}

    def _listed(self, table: str, entry: Any) -> int:
        """The number of an entry in a table."""
        if entry not in self.tables[table]:
            self.tables[table].append(entry)
        return self.tables[table].index(entry)

    def system(self, system: System) -> int:
        if id(system) not in self._numbers:
            self._numbers[id(system)] = self._listed("systems", describe(system, Prefixed(self.arrays))), system
        return self._numbers[id(system)][0]

    def _discretisation(self, balance: HarmonicBalance) -> int:
        if id(balance) not in self._numbers:
            linear = balance.linear
            shared = {
                "system": self.system(balance.system),
                "harmonics": int(balance.basis.harmonics),
                "nu": int(balance.basis.nu),
                "samples": tuple(None if s is None else int(s) for s in balance.samples),
                "values": tuple(float(balance.values[name]) for name in balance.system.parameters),
                "linear": "" if isinstance(linear, StructuralMatrices) else type(linear).__name__,
            }
            self._numbers[id(balance)] = self._listed("discretisations", shared), balance
        return self._numbers[id(balance)][0]

    def motion(self, orbit: PeriodicOrbit, floquet: FloquetResult) -> list[Any]:
        rule = -1 if orbit.adaptive is None else self._listed("rules", orbit.adaptive)
        verdict = {f.name: getattr(floquet, f.name) for f in fields(floquet) if f.name not in ("multipliers", "errors")}
        verdict["checks"] = dict(floquet.checks)
        return [self._discretisation(orbit.balance), rule, len(floquet.multipliers), verdict]

    def event(self, event: Bifurcation, branch: Branch) -> dict[str, Any]:
        taken = ("orbit", "floquet", "null_vectors", "context")
        plain = {f.name: getattr(event, f.name) for f in fields(event) if f.name not in taken}
        orbit = event.orbit
        own = {
            "omega": orbit.omega,
            "values": dict(orbit.values),
            "residual": orbit.residual,
            "truncation": orbit.truncation,
            "orbit": self.motion(orbit, event.floquet),
            "null": None,
            "normal_form": event.normal_form,
            "context": None,
        }
        if event.null_vectors is not None:
            vectors = event.null_vectors
            own["null"] = [len(vectors.right), bool(np.iscomplexobj(vectors.right)), len(vectors.left)]
        if event.context is not None:
            context = {**event.context, "system": self.system(event.context.get("system", branch.system))}
            own["context"] = self._listed("contexts", context)
        return {"fields": plain, **own}


class _Reader:
    def __init__(self, dataset: xarray.Dataset, allow_code: bool, linear: LinearPart | None) -> None:
        self.dataset = dataset
        self.record = from_json(str(dataset["record"].item()), _CLASSES)
        self.tables = self.record["tables"]
        self._arrays: dict[str, np.ndarray] = {}
        stored = system_arrays(dataset)
        self.systems = [build(text, stored, allow_code) for text in self.tables["systems"]]
        self.system = self.systems[self.record["system"]]
        self.balances = [self._balance(d, linear) for d in self.tables["discretisations"]]

    def _balance(self, stated: Mapping[str, Any], linear: LinearPart | None) -> HarmonicBalance:
        # files of earlier versions name harmonics that were left out: their coefficients are zero
        system, other = self.systems[stated["system"]], stated["linear"]
        if other and linear is None:
            raise InputError(
                f"this branch was computed with another linear part, a {other}: make it again and give it as linear="
            )
        values = dict(zip(system.parameters, stated["values"], strict=True))
        basis = HarmonicBasis(stated["harmonics"], stated["nu"])
        return HarmonicBalance(system, basis, values, linear if other else None, stated["samples"])

    def array(self, name: str) -> np.ndarray:
        """A variable, each put together once."""
        if name not in self._arrays:
            self._arrays[name] = array_of(self.dataset, name)
        return self._arrays[name]

    def motion(
        self,
        prefix: str,
        i: int,
        stored: Sequence[Any],
        omega: float,
        values: dict[str, float],
        residual: float,
        error: float,
    ) -> tuple[PeriodicOrbit, FloquetResult]:
        """A motion with its verdict; `error`: what was neglected of it."""
        which, rule, count, verdict = stored
        balance = self.balances[which]
        x = self.array(f"{prefix}coefficients")[i, : balance.basis.size, : balance.size].copy()
        adaptive = None if rule < 0 else self.tables["rules"][rule]
        multipliers, errors = (
            self.array(f"{prefix}{name}")[i, :count].copy() for name in ("multipliers", "multiplier_errors")
        )
        return PeriodicOrbit(balance, x, omega, values, residual, error, adaptive), FloquetResult(
            multipliers, errors, **verdict
        )

    def branch(self) -> Branch:
        record = self.record
        points, events = self._points(), self._events()
        lists: tuple[dict[int, Bifurcation], dict[int, Bifurcation]] = ({}, {})
        for (place, index), event in zip(record["event_list"], events, strict=True):
            lists[place][index] = event
        bifurcations, own = ([items[i] for i in range(len(items))] for items in lists)
        tracked = record.get("tracked")
        make: Any = Branch
        if tracked:
            make = partial(TrackedBranch, tracked["kind"], tracked["names"], turning=tracked.get("turning", ""))
        branch: Branch = make(
            self.system,
            record["name"],
            points,
            bifurcations,
            own,
            record["closed"],
            # older files hold the sentence alone
            record.get("endings") or read_endings(record["ended"]),
            record["observe"],
            record["options"],
            record["warnings"],
            record["audit"],
            record.get("departs"),
            record.get("arrives"),
        )
        branch.seconds = record["seconds"]
        return branch

    def _points(self) -> list[BranchPoint]:
        names = [str(name) for name in self.array("parameter")]
        omega, values = self.array("omega"), self.array("parameters")
        residual, error = self.array("residual"), self.array("error")
        arclength, iterations = self.array("arclength"), self.array("iterations")
        points = []
        for i, stored in enumerate(self.record["points"]):
            at = {name: float(value) for name, value in zip(names, values[i], strict=True)}
            orbit, floquet = self.motion("", i, stored, float(omega[i]), at, float(residual[i]), float(error[i]))
            points.append(BranchPoint(orbit, floquet, float(arclength[i]), int(iterations[i])))
        if self.record.get("tracked"):
            points[:] = tracked_points(points, self.record["tracked"])
        return points

    def _events(self) -> list[Bifurcation]:
        right, left = self.array("event_null_right"), self.array("event_null_left")
        events = []
        for i, stored in enumerate(self.record["events"]):
            numbers = stored["omega"], stored["values"], stored["residual"], stored["truncation"]
            orbit, floquet = self.motion("event_", i, stored["orbit"], *numbers)
            vectors = None
            if stored["null"] is not None:
                wide, is_complex, narrow = stored["null"]
                pair = right[i, :wide], left[i, :narrow]
                vectors = NullVectors(*(p.copy() if is_complex else p.real.copy() for p in pair))
            context = None
            if stored["context"] is not None:
                context = dict(self.tables["contexts"][stored["context"]])
                context["system"] = self.systems[context["system"]]
            # older files hold no normal forms: they are computed when asked for
            fields = {name: value for name, value in stored["fields"].items() if name != "criticality"}
            made = TrackedEvent if "curve" in fields else Bifurcation
            event = made(orbit=orbit, floquet=floquet, null_vectors=vectors, context=context, **fields)
            events.append(event.with_normal_form(stored["normal_form"]) if "normal_form" in stored else event)
        return events


# ------------------------------------------------------------------------------------------------------------- diagrams
_HEAD = {
    "label": "period, and where the branch begins and ends",
    "period": "load periods in one response period",
    "depth": "how many bifurcations away from the response",
    "parent": "the branch that it leaves, -1 for the response",
    "origin": "the event of the parent that it leaves at, -1 for a response",
}


def diagram_to_datasets(diagram: BifurcationDiagram) -> dict[str, xarray.Dataset]:
    """The head under the name "", the branches under "branch_0", "branch_1", ..."""
    import xarray

    nodes = list(diagram)
    place = {id(event): i for node in nodes for i, event in enumerate(events_met(node.branch))}
    parents = [diagram.parent(node) for node in nodes]
    columns = {
        "label": np.array([node.label for node in nodes]),
        "period": np.array([node.branch.nu for node in nodes]),
        "depth": np.array([node.depth for node in nodes]),
        "parent": np.array([-1 if parent is None else parent.number for parent in parents]),
        "origin": np.array([-1 if node.origin is None else place[id(node.origin)] for node in nodes]),
    }
    record = {
        "failures": [[place[id(item)], why] for node in nodes for item, why in node.failures],
        "failures_of": [node.number for node in nodes for _ in node.failures],
        "left": [place[id(item)] for node in nodes for item in node.left],
        "left_of": [node.number for node in nodes for _ in node.left],
        "interruption": diagram.interruption,
    }
    variables: dict[str, Any] = {
        name: ("branch", values, {"long_name": _HEAD[name]}) for name, values in columns.items()
    }
    variables["record"] = ((), np.array(to_json(record)), {"long_name": "what was left out, as JSON"})
    head = xarray.Dataset(variables, attrs={"branches": len(nodes), "stopped": diagram.stopped})
    if diagram.seconds == diagram.seconds:
        head.attrs["seconds"] = float(diagram.seconds)
    return {"": head} | {f"branch_{node.number}": branch_to_dataset(node.branch) for node in nodes}


def diagram_from_datasets(
    groups: Mapping[str, xarray.Dataset], allow_code: bool = False, linear: LinearPart | None = None
) -> BifurcationDiagram:
    """The diagram that `diagram_to_datasets` wrote, the same tree with equal branches."""
    head = groups[""]
    count = int(head.attrs["branches"])
    parts = parts_of(groups, [f"branch_{i}" for i in range(count)], "diagram")
    branches = [branch_from_dataset(part, allow_code, linear) for part in parts.values()]
    met: list[Any] = [events_met(branch) for branch in branches]
    nodes = [DiagramBranch(branches[0])]
    for number in range(1, count):
        parent = nodes[int(head["parent"].values[number])]
        event = int(head["origin"].values[number])
        if event < 0:
            nodes.append(DiagramBranch(branches[number], number=number))
        else:
            origin, crossed = met[parent.number][event], parent.branch.bifurcations["BP"]
            nodes.append(DiagramBranch(branches[number], origin, parent.depth + 1, number, met=crossed))
        parent.children.append(nodes[-1])
    record = from_json(str(head["record"].item()), {"Interruption": Interruption})
    for number, (event, why) in zip(record["failures_of"], record["failures"], strict=True):
        nodes[number].failures.append((met[number][event], why))
    for number, event in zip(record["left_of"], record["left"], strict=True):
        nodes[number].left.append(met[number][event])
    stopped = str(head.attrs.get("stopped", ""))
    # older files hold the words alone
    noted = Interruption() if stopped.startswith("interrupted") else None
    diagram = BifurcationDiagram(nodes[0], stopped, record.get("interruption", noted))
    diagram.seconds = float(head.attrs.get("seconds", np.nan))
    return diagram


register(Codec("diagram", BifurcationDiagram, diagram_to_datasets, diagram_from_datasets))
