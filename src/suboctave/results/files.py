"""Branches and diagrams as datasets that hold all of them, and back: what `save` and the journal of a study keep.

Of a branch: the dataset of `Branch.to_xarray()` (`suboctave.store.layout`) with complex numbers as pairs of variables
`..._real`, `..._imag`, and besides the motions as `coefficients`, padded with zeros, on `point` and on `event`. What is
neither a number per point nor per event is JSON in the variable `record`. Of a diagram: a head with one entry for each
branch, by number, and the branches. docs/results.md describes both for readers without this package.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent
from suboctave.bifurcation.bordered import NullVectors
from suboctave.bifurcation.gaps import GrazingContact
from suboctave.bifurcation.normal_form import NormalForm
from suboctave.continuation.ending import Ending, read_endings
from suboctave.curves.junction import Junction
from suboctave.curves.trace import Audit, BranchPoint, TrackedPoint, Unsettled
from suboctave.errors import InputError
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.condensed import Condensed, linear_part_of
from suboctave.harmonic.energy import damping_ratio
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.interruption import Interruption
from suboctave.model.system import System, build, describe
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.diagram import BifurcationDiagram, DiagramBranch
from suboctave.results.equilibria import Equilibria
from suboctave.results.modes import tracked_class
from suboctave.store.layout import branch_dataset, events_met
from suboctave.store.plain import array_of, from_json, padded, recorded, system_arrays
from suboctave.store.registry import Codec, parts_of, register

if TYPE_CHECKING:
    import xarray


_CLASSES = {
    c.__name__: c
    for c in (Audit, Unsettled, Ending, GrazingContact, Junction, AdaptiveHarmonics, FloquetResult, NormalForm)
}
#: attributes of a branch that its record holds as they are
_OWN = ("name", "options", "warnings", "audit", "closed", "endings", "departs", "arrives", "observe")
#: what an event's row in `fields` leaves to others
_ELSEWHERE = ("orbit", "floquet", "null_vectors", "context")
_RECORD = "system, options, warnings, audit and what motions share, as JSON"


def branch_to_dataset(branch: Branch) -> xarray.Dataset:
    """Everything that a branch holds, as a dataset of numbers and texts that a file can hold.

    Raises InputError where its system cannot be written down.
    """
    writer, events = _Writer(), events_met(branch)
    lists = enumerate((branch.bifurcations.met, branch.events.met))
    listed = {id(event): (which, i) for which, items in lists for i, event in enumerate(items)}
    record = {name: getattr(branch, name) for name in (*_OWN, "ended")} | {
        "points": [writer.motion(p.orbit, p.floquet) for p in branch.points],
        "event_list": [listed[id(event)] for event in events],
        "events": [writer.event(event, branch) for event in events],
        "seconds": float(branch.seconds),
        "system": writer.system(branch.system),
        "tables": writer.tables,
        "tracked": None
        if not isinstance(branch, TrackedBranch)
        else {
            **{name: getattr(branch, name) for name in ("kind", "names", "turning")},
            **{name: [getattr(p, name) for p in branch.tracked] for name in ("extra", "coefficient")},
            "nature": [(p.extreme, p.isola) for p in branch.tracked],
        },
    }
    iterations = np.array([p.iterations for p in branch.points], dtype=int)
    verdicts = [e.floquet for e in events]
    variables: dict[str, Any] = {
        "arclength": (("point",), branch.arclength, {"long_name": "distance along the branch in scaled arclength"}),
        "iterations": (("point",), iterations, {"long_name": "Newton iterations"}),
        "coefficients": _coefficients("", "point", branch.orbits),
        "event_coefficients": _coefficients("event_", "event", [e.orbit for e in events]),
        "event_multipliers": (("event", "event_floquet"), padded([v.multipliers for v in verdicts], complex)),
        "event_multiplier_errors": (("event", "event_floquet"), padded([v.errors for v in verdicts], float)),
    }
    for side in ("right", "left"):
        rows = [() if e.null_vectors is None else getattr(e.null_vectors, side) for e in events]
        variables[f"event_null_{side}"] = (("event", "null"), padded(rows, complex))
    dataset = recorded(branch_dataset(branch), record, _RECORD, writer.arrays, variables)
    del dataset.attrs["warnings"]  # they are in `record`
    seconds = {"seconds": float(branch.seconds)} if branch.seconds == branch.seconds else {}
    return dataset.assign_attrs(**seconds, contents="branch")


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


def _coefficients(prefix: str, dimension: str, orbits: Sequence[PeriodicOrbit]) -> tuple[Any, ...]:
    """The Fourier coefficients of several motions, padded to the longest."""
    sizes = np.max([o.x.shape for o in orbits], axis=0) if orbits else (0, 0)
    table = np.zeros((len(orbits), *sizes))
    for row, orbit in zip(table, orbits, strict=True):
        row[: orbit.x.shape[0], : orbit.x.shape[1]] = orbit.x
    meaning = "a_0, a_1, b_1, ... of x(t) = a_0 + sum a_k cos(k w t) + b_k sin(k w t), w = omega / period"
    # a dimension of its own for each: the longest motion among the points is not that among the events
    shape = (dimension, f"{prefix}coefficient", "unknown" if orbits else f"{prefix}unknown")
    return shape, table, {"long_name": "the same of the motions at events" if prefix else meaning}


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
            self._numbers[id(system)] = self._listed("systems", describe(system, self.arrays)), system
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
                # what a condensed part is made for, None where nothing depends on it
                "covers": linear.made_for if isinstance(linear, Condensed) else None,
            }
            self._numbers[id(balance)] = self._listed("discretisations", shared), balance
        return self._numbers[id(balance)][0]

    def motion(self, orbit: PeriodicOrbit, floquet: FloquetResult) -> list[Any]:
        rule = -1 if orbit.adaptive is None else self._listed("rules", orbit.adaptive)
        verdict = {f.name: getattr(floquet, f.name) for f in fields(floquet) if f.name not in ("multipliers", "errors")}
        verdict["checks"] = dict(floquet.checks)
        return [self._discretisation(orbit.balance), rule, len(floquet.multipliers), verdict]

    def event(self, event: Bifurcation, branch: Branch) -> dict[str, Any]:
        orbit, vectors, context = event.orbit, event.null_vectors, event.context
        if context is not None:
            context = {**context, "system": self.system(context.get("system", branch.system))}
        return {
            "fields": {f.name: getattr(event, f.name) for f in fields(event) if f.name not in _ELSEWHERE},
            "omega": orbit.omega,
            "values": dict(orbit.values),
            "residual": orbit.residual,
            "truncation": orbit.truncation,
            "orbit": self.motion(orbit, event.floquet),
            "null": None
            if vectors is None
            else [len(vectors.right), bool(np.iscomplexobj(vectors.right)), len(vectors.left)],
            "normal_form": event.normal_form,
            "context": None if context is None else self._listed("contexts", context),
        }


class _Reader:
    def __init__(self, dataset: xarray.Dataset, allow_code: bool, linear: LinearPart | None) -> None:
        self.array = functools.cache(functools.partial(array_of, dataset))
        self.record: dict[str, Any] = from_json(str(dataset["record"].item()), _CLASSES)
        self.tables = self.record["tables"]
        arrays = system_arrays(dataset)
        self.systems = [build(described, arrays, allow_code) for described in self.tables["systems"]]
        self._parts: dict[tuple[int, str], LinearPart] = {}
        self.balances = [self._balance(d, linear) for d in self.tables["discretisations"]]

    def _balance(self, stated: Mapping[str, Any], linear: LinearPart | None) -> HarmonicBalance:
        # files of earlier versions name harmonics that were left out: their coefficients are zero
        system, other = self.systems[stated["system"]], stated["linear"]
        values = dict(zip(system.parameters, stated["values"], strict=True))
        if other == Condensed.__name__ and linear is None:
            linear = self._condensed(system, stated.get("covers")).rebuilt(values)
        if other and linear is None:
            raise InputError(
                f"this branch was computed with another linear part, a {other}: make it again and give it as linear="
            )
        basis = HarmonicBasis(stated["harmonics"], stated["nu"])
        return HarmonicBalance(system, basis, values, linear if other else None, stated["samples"])

    def _condensed(self, system: System, made_for: Mapping[str, Any] | None) -> LinearPart:
        """The condensed linear part of a system, one for all its motions."""
        key = id(system), str(made_for)
        if key not in self._parts:
            self._parts[key] = linear_part_of(system, None, **(made_for or {}))
        return self._parts[key]

    def motion(self, prefix: str, i: int, stored: Sequence[Any], *numbers: Any) -> tuple[Any, FloquetResult]:
        """A motion with its verdict; `numbers`: omega, values of the parameters, residual, what was neglected of it."""
        which, rule, count, verdict = stored
        balance = self.balances[which]
        x = self.array(f"{prefix}coefficients")[i, : balance.basis.size, : balance.size].copy()
        multipliers, errors = (
            self.array(f"{prefix}{n}")[i, :count].copy() for n in ("multipliers", "multiplier_errors")
        )
        omega, values, residual, truncation = numbers
        adaptive = None if rule < 0 else self.tables["rules"][rule]
        orbit = PeriodicOrbit(balance, x, omega, values, residual, truncation, adaptive)
        if self.record.get("options", {}).get("damped"):
            orbit = replace(orbit, zeta=damping_ratio(orbit.state()))
        return orbit, FloquetResult(multipliers, errors, **verdict)

    def branch(self) -> Branch:
        record = self.record
        points, events = self._points(), self._events()
        listed = sorted(zip(record["event_list"], events, strict=True), key=lambda pair: pair[0])
        bifurcations, own = ([event for (which, _), event in listed if which == place] for place in (0, 1))
        given: dict[str, Any] = {name: record.get(name) for name in _OWN}
        # older files hold the sentence alone
        given["endings"] = given["endings"] or read_endings(record["ended"])
        given |= {"system": self.systems[record["system"]], "points": points}
        given |= {"bifurcations": bifurcations, "events": own}
        if tracked := record.get("tracked"):
            kind, names, turning = tracked["kind"], tracked["names"], tracked.get("turning", "")
            branch: Branch = tracked_class(given["options"])(kind, names, turning=turning, **given)
        else:
            branch = (Equilibria if "still" in given["options"] else Branch)(**given)
        branch.seconds = record["seconds"]
        return branch

    def _points(self) -> list[BranchPoint]:
        names = [str(name) for name in self.array("parameter")]
        values = [dict(zip(names, row, strict=True)) for row in self.array("parameters").tolist()]
        omega, residual, error, arclength, iterations = (
            self.array(name).tolist() for name in ("omega", "residual", "error", "arclength", "iterations")
        )
        tracked = self.record.get("tracked")
        points = []
        for i, stored in enumerate(self.record["points"]):
            orbit, floquet = self.motion("", i, stored, omega[i], values[i], residual[i], error[i])
            point = BranchPoint(orbit, floquet, arclength[i], iterations[i])
            if tracked:
                nature = tracked["nature"][i] if tracked.get("nature") else ("", "")
                more = tracked["extra"][i], tracked["coefficient"][i], *nature
                point = TrackedPoint(orbit, floquet, arclength[i], iterations[i], None, *more)
            points.append(point)
        return points

    def _events(self) -> list[Bifurcation]:
        right, left = self.array("event_null_right"), self.array("event_null_left")
        events = []
        for i, stored in enumerate(self.record["events"]):
            numbers = stored["omega"], stored["values"], stored["residual"], stored["truncation"]
            orbit, floquet = self.motion("event_", i, stored["orbit"], *numbers)
            vectors = context = None
            if stored["null"] is not None:
                wide, is_complex, narrow = stored["null"]
                pair = right[i, :wide], left[i, :narrow]
                vectors = NullVectors(*(p.copy() if is_complex else p.real.copy() for p in pair))
            if stored["context"] is not None:
                context = dict(self.tables["contexts"][stored["context"]])
                context["system"] = self.systems[context["system"]]
            # older files hold no normal forms: they are computed when asked for
            plain = {name: value for name, value in stored["fields"].items() if name != "criticality"}
            made = TrackedEvent if "curve" in plain else Bifurcation
            event = made(orbit=orbit, floquet=floquet, null_vectors=vectors, context=context, **plain)
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
        "label": [node.label for node in nodes],
        "period": [node.branch.nu for node in nodes],
        "depth": [node.depth for node in nodes],
        "parent": [-1 if parent is None else parent.number for parent in parents],
        "origin": [-1 if node.origin is None else place[id(node.origin)] for node in nodes],
    }
    record = {
        "failures": [[place[id(item)], why] for node in nodes for item, why in node.failures],
        "failures_of": [node.number for node in nodes for _ in node.failures],
        "left": [place[id(item)] for node in nodes for item in node.left],
        "left_of": [node.number for node in nodes for _ in node.left],
        "interruption": diagram.interruption,
    }
    variables = {name: ("branch", np.array(columns[name]), {"long_name": meaning}) for name, meaning in _HEAD.items()}
    attributes: dict[str, Any] = {"branches": len(nodes), "stopped": diagram.stopped}
    if diagram.seconds == diagram.seconds:
        attributes["seconds"] = float(diagram.seconds)
    head = recorded(xarray.Dataset(variables, attrs=attributes), record, "what was left out, as JSON")
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
