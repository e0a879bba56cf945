"""A bifurcation diagram as datasets that a file or the journal can hold, and back.

A head with one entry for each branch on the dimension `branch`, by number: `label`, `period`, `depth`, `parent` (the
number of the branch that it leaves, -1 for the response) and `origin` (the index of the bifurcation that it leaves at
on the dimension `event` of its parent, -1 for a response; that from the other end has the first one for its parent);
and the branches, each as `suboctave.results.files.branch` writes it. Bifurcations that were left out or where nothing
could be followed are JSON in `record`, told by branch and index of the event.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.results.diagram import BifurcationDiagram, DiagramBranch
from suboctave.results.files.branch import branch_from_dataset, branch_to_dataset
from suboctave.store.layout import events_met
from suboctave.store.plain import from_json, to_json
from suboctave.store.registry import Codec, parts_of, register

if TYPE_CHECKING:
    import xarray


_MEANINGS = {
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
        name: ("branch", values, {"long_name": _MEANINGS[name]}) for name, values in columns.items()
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
