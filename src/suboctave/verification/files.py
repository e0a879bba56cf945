"""A branch held against the time domain as datasets that a file can hold, and back: a head, and the branch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.harmonic.linear_part import LinearPart
from suboctave.results.files.branch import branch_from_dataset, branch_to_dataset
from suboctave.store.arrays import array_of
from suboctave.store.plain import from_json, to_json
from suboctave.store.registry import Codec, parts_of, register
from suboctave.verification.result import (
    EVENT_COLUMNS,
    POINT_COLUMNS,
    VERDICTS,
    BranchVerification,
    VerifiedBifurcation,
    VerifiedPoint,
    verification_dataset,
)

if TYPE_CHECKING:
    import xarray

__all__ = ["verification_from_datasets", "verification_to_datasets"]


def verification_to_datasets(check: BranchVerification) -> dict[str, xarray.Dataset]:
    """The head under the name "", and the branch."""
    import xarray

    head = verification_dataset(check)
    record = {
        "multipliers": [len(p.multipliers) for p in check.points],
        "errors": [len(p.errors) for p in check.points],
        "parameters": [dict(e.parameters) for e in check.bifurcations],
    }
    variables = {name: (v.dims, v.values, v.attrs) for name, v in head.variables.items()}
    variables["record"] = ((), np.array(to_json(record)), {"long_name": "numbers of multipliers, parameters, as JSON"})
    stored = xarray.Dataset(variables, attrs={**head.attrs, "parts": "branch"})
    return {"": stored, "branch": branch_to_dataset(check.branch)}


def verification_from_datasets(
    groups: Mapping[str, xarray.Dataset], allow_code: bool = False, linear: LinearPart | None = None
) -> BranchVerification:
    """The verification that `verification_to_datasets` wrote."""
    branch = branch_from_dataset(parts_of(groups, ["branch"], "verification")["branch"], allow_code, linear)
    head = groups[""]
    record = from_json(str(head["record"].item()))
    columns = {name: array_of(head, name) for name in (*POINT_COLUMNS, *VERDICTS, "multipliers", "multiplier_errors")}
    points = []
    for i, (count, errors) in enumerate(zip(record["multipliers"], record["errors"], strict=True)):
        known: dict[str, Any] = {name: kind(columns[name][i]) for name, kind in POINT_COLUMNS.items()}
        known |= {name: None if columns[name][i] < 0 else bool(columns[name][i]) for name in VERDICTS}
        points.append(VerifiedPoint(
            multipliers=columns["multipliers"][i, :count].copy(),
            errors=columns["multiplier_errors"][i, :errors].copy(), **known,
        ))  # fmt: skip
    met = {name: array_of(head, f"event_{name}") for name in EVENT_COLUMNS}
    events = [
        VerifiedBifurcation(parameters=values, **{name: kind(met[name][i]) for name, kind in EVENT_COLUMNS.items()})
        for i, values in enumerate(record["parameters"])
    ]
    tolerance, complete = float(head.attrs["tolerance"]), bool(head.attrs["complete"])
    return BranchVerification(branch, tuple(points), tuple(events), tolerance, complete)


register(Codec("verification", BranchVerification, verification_to_datasets, verification_from_datasets))
