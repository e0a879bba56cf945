"""A curve of bifurcations in two parameters: its points, its extrema and points of codimension two."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation, target_multiplier
from suboctave.continuation.ending import sentence
from suboctave.continuation.problem import Array
from suboctave.curves.points import BranchPoint, TrackedPoint
from suboctave.kinds import KINDS
from suboctave.results.branch import Branch


class TrackedBranch(Branch):
    """Bifurcations of one kind in two free parameters, in order; read like a `Branch`.

    Attributes
    ----------
    kind
        "LP", "BP", "PD", "NS" or "grazing".
    names
        The two free parameters; `name` is the second. Three of a curve of extrema; `name` is the third.
    turning
        The one of them that is extreme all along a curve of extrema; else empty.
    bifurcations
        Extrema of either parameter and points of codimension two, in the order met; `extrema` the former.
    """

    def __init__(self, kind: str, names: tuple[str, ...], *args: Any, turning: str = "", **named: Any) -> None:
        super().__init__(*args, **named)
        self.kind = kind
        self.names = names
        self.turning = turning

    @property
    def ended(self) -> str:
        """Why it ended, in words."""
        return sentence(self.endings, go_on="")

    @property
    def plane(self) -> tuple[str, str]:
        """The two parameters that it is drawn over: of a curve of extrema the third one and the extreme one."""
        return (self.names[-1], self.turning) if self.turning else (self.names[0], self.names[1])

    @property
    def extrema(self) -> list[Bifurcation]:
        """Where the curve turns in one of its parameters (`parameter_name`), in the order met."""
        return self.bifurcations["extremum"]

    @cached_property
    def stable(self) -> np.ndarray:
        """Whether all multipliers but the critical one (or pair) lie inside the unit circle, shape (len,), bool.

        Where they do, the curve is a border of stable motions.
        """
        return np.array([self._others_inside(p) for p in self.points], dtype=bool)

    @cached_property
    def kappa(self) -> Array:
        """Frequency of the critical perturbation along an NS curve, rad per unit time; else zeros; shape (len,)."""
        return np.array([p.extra if self.kind == "NS" else 0.0 for p in self.tracked])

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

    def _others_inside(self, point: Any) -> bool:
        mu = point.floquet.multipliers
        target = target_multiplier(self.kind, point.extra * point.orbit.period)
        if target is not None:
            distance = np.minimum(np.abs(mu - target), np.abs(mu - np.conj(target)))
            mu = np.delete(mu, np.argsort(distance, kind="stable")[: KINDS[self.kind].critical])
        return bool(np.all(np.abs(mu) < 1.0))

    @property
    def _free(self) -> tuple[str, ...]:
        return self.names

    def _columns(self, readings: Iterable[str] | bool) -> dict[str, Any]:
        """As of any branch, and `coefficient`, and `kappa` of an NS curve."""
        own = super()._columns(readings) | {"coefficient": self.coefficient}
        return own | {"kappa": self.kappa} if self.kind == "NS" else own

    def __repr__(self) -> str:
        ends = [", ".join(f"{n}={self.parameter(n)[i]:.6g}" for n in self.names) for i in (0, -1)]
        what = f"{self.kind} curve, extrema of {self.turning}" if self.turning else f"{self.kind} curve"
        text = f"{what}: {len(self)} points from {ends[0]} to {ends[1]}; {self.ended}."
        for warning in self.warnings:
            text += f"\n  note: {warning}"
        return text + "\n" + repr(self.bifurcations)


def tracked_record(branch: TrackedBranch) -> dict[str, Any]:
    """What a file holds of a tracked curve besides what it holds of any branch."""
    return {
        "kind": branch.kind,
        "names": branch.names,
        "turning": branch.turning,
        "extra": [p.extra for p in branch.tracked],
        "coefficient": [p.coefficient for p in branch.tracked],
        "nature": [(p.extreme, p.isola) for p in branch.tracked],
    }


def tracked_points(points: Sequence[BranchPoint], record: Mapping[str, Any]) -> list[Any]:
    """Points that were read, as those of a tracked curve."""
    natures = record.get("nature") or [("", "")] * len(points)
    return [
        TrackedPoint(p.orbit, p.floquet, p.arclength, p.iterations, None, extra, coefficient, *nature)
        for p, extra, coefficient, nature in zip(points, record["extra"], record["coefficient"], natures, strict=True)
    ]
