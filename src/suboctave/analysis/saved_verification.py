"""A branch held against the time domain as a labelled dataset, as datasets that a file can hold, and back.

On `point`: `index` (which point of the branch), `omega`, `amplitude`, `distance`, `multipliers` (point x multiplier,
nan behind those that there are), `multiplier_errors`, `multiplier_error` (the largest difference from the branch's),
`stable` and `computed` (1, 0, or -1 where there is no verdict), `outcome`, `reason`; on `event` with the prefix
`event_`: `kind`, `omega`, `amplitude`, `true_omega`, `distance`, `agrees`, `reason`. A file holds the branch as its
group "branch".
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.analysis.branch_verification import BranchVerification, VerifiedBifurcation, VerifiedPoint
from suboctave.analysis.saved import branch_from_dataset, branch_to_dataset
from suboctave.errors import InputError
from suboctave.harmonic.linear_part import LinearPart
from suboctave.store.arrays import array_of, flat, padded
from suboctave.store.plain import from_json, to_json
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray

__all__ = ["verification_dataset", "verification_from_datasets", "verification_to_datasets"]

_POINT: dict[str, Any] = {
    "index": int, "omega": float, "amplitude": float, "distance": float, "multiplier_error": float, "outcome": str,
    "reason": str,
}  # fmt: skip
_EVENT: dict[str, Any] = {
    "kind": str, "omega": float, "amplitude": float, "true_omega": float, "distance": float, "agrees": bool,
    "reason": str,
}  # fmt: skip
_VERDICTS = ("stable", "computed")


def verification_dataset(check: BranchVerification) -> xarray.Dataset:
    """Points and bifurcations that were looked at, and what was found; see the top of this module."""
    import xarray

    points, events = check.points, check.bifurcations
    variables: dict[str, Any] = {
        name: ("point", np.array([getattr(p, name) for p in points], dtype=kind)) for name, kind in _POINT.items()
    }
    for name in _VERDICTS:
        told = (getattr(p, name) for p in points)
        variables[name] = ("point", np.array([-1 if verdict is None else int(verdict) for verdict in told], dtype=int))
    variables["multipliers"] = (("point", "multiplier"), padded([p.multipliers for p in points], complex))
    variables["multiplier_errors"] = (("point", "error"), padded([p.errors for p in points], float))
    variables |= {
        f"event_{name}": ("event", np.array([getattr(e, name) for e in events], dtype=kind))
        for name, kind in _EVENT.items()
    }
    attributes = {
        "contents": "verification",
        "free": check.branch.name,
        "tolerance": check.tolerance,
        "complete": int(check.complete),
        "said": check.summary,
        "system": check.branch.system.name,
        "suboctave": __version__,
    }
    return xarray.Dataset(dict(flat(variables)), attrs=attributes)


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
    """The verification that `verification_to_datasets` wrote.

    Raises InputError where the datasets are not those of one, or the branch is missing.
    """
    if "branch" not in groups:
        raise InputError("the branch that was verified is missing")
    branch = branch_from_dataset(groups["branch"], allow_code, linear)
    head = groups[""]
    try:
        record = from_json(str(head["record"].item()))
        columns = {name: array_of(head, name) for name in (*_POINT, *_VERDICTS, "multipliers", "multiplier_errors")}
        points = []
        for i, (count, errors) in enumerate(zip(record["multipliers"], record["errors"], strict=True)):
            said: dict[str, Any] = {name: kind(columns[name][i]) for name, kind in _POINT.items()}
            said |= {name: None if columns[name][i] < 0 else bool(columns[name][i]) for name in _VERDICTS}
            points.append(VerifiedPoint(
                multipliers=columns["multipliers"][i, :count].copy(),
                errors=columns["multiplier_errors"][i, :errors].copy(), **said,
            ))  # fmt: skip
        met = {name: array_of(head, f"event_{name}") for name in _EVENT}
        events = [
            VerifiedBifurcation(parameters=values, **{name: kind(met[name][i]) for name, kind in _EVENT.items()})
            for i, values in enumerate(record["parameters"])
        ]
        tolerance, complete = float(head.attrs["tolerance"]), bool(head.attrs["complete"])
    except InputError:  # which is a ValueError
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"this is no verification of suboctave: {type(error).__name__}: {error}") from None
    return BranchVerification(branch, tuple(points), tuple(events), tolerance, complete)
