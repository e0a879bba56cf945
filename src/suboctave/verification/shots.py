"""Motions and bifurcations of a branch against multiple shooting, in batches; see `branch_verification`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.continuation.problem import Array
from suboctave.harmonic.basis import ComplexArray
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.timedomain.multiple_shooting import MultipleShooting, ShotMotions

__all__ = ["LOCATED", "Place", "Shot", "Shots"]

#: the kinds whose place along the curve of motions is looked for
LOCATED = ("LP", "BP", "PD", "NS")


@dataclass(frozen=True)
class Shot:
    """The true motion beside one of harmonic balance; `found` False where there is none."""

    converged: bool
    distance: float
    state: Array
    omega: float
    multipliers: ComplexArray
    errors: Array


@dataclass(frozen=True)
class Place:
    """Where a bifurcation lies on the curve of true motions: `along` from the start, in units of the motion's size.

    `along` is nan where no bifurcation of the kind lies within the distance that was looked at.
    """

    shot: Shot
    along: float
    omega: float


class Shots:
    """Multiple shooting from motions of one system that have one period."""

    def __init__(self, orbit: PeriodicOrbit, workers: int | None = None) -> None:
        self.system = orbit.balance.system
        self.shooting = MultipleShooting(self.system, orbit.basis.nu, workers)

    @property
    def at_once(self) -> int:
        """How many motions one batch may have."""
        return self.shooting.at_once

    def motions(self, orbits: Sequence[PeriodicOrbit]) -> list[Shot]:
        """The true motions beside these."""
        states, omega, parameters, sizes = self._starts(orbits)
        return _shots(self.shooting.solve(states, omega, parameters, sizes), states, omega, sizes)

    def places(self, orbits: Sequence[PeriodicOrbit], kinds: Sequence[str], reach: float) -> list[Place]:
        """Where bifurcations of these kinds lie along the curves of true motions, within `reach` on either side."""
        states, omega, parameters, sizes = self._starts(orbits)
        middle = self.shooting.solve(states, omega, parameters, sizes)
        shots = _shots(middle, states, omega, sizes)
        t = np.where(np.isfinite(middle.tangent), middle.tangent, 0.0)
        sides = []
        for way in (-reach, reach):
            y = middle.states + way * t[:, :-1].reshape(states.shape) * sizes[:, None, :]
            sides.append(self.shooting.solve(y, middle.omega * (1.0 + way * t[:, -1]), parameters, sizes, along=t))
        return [
            Place(shot, *_place(kind, [sides[0], middle, sides[1]], b, reach))
            for b, (shot, kind) in enumerate(zip(shots, kinds, strict=True))
        ]

    def _starts(self, orbits: Sequence[PeriodicOrbit]) -> tuple[Array, Array, dict[str, Array], Array]:
        share = np.arange(self.shooting.pieces) / self.shooting.pieces
        states, sizes = [], []
        for orbit in orbits:
            t = share * orbit.period
            states.append(np.hstack([orbit.displacement(t).T, orbit.velocity(t).T]))
            fine = np.linspace(0.0, orbit.period, 8 * orbit.basis.harmonics + 8)
            # a motion at rest has no size of its own
            largest = [np.abs(orbit.displacement(fine)).max(), np.abs(orbit.velocity(fine)).max()]
            largest = [largest[0] or 1.0, largest[1] or orbit.omega]
            sizes.append(np.repeat(largest, self.system.n))
        names = [
            name
            for name, value in self.system.parameters.items()
            if any(orbit.values[name] != value for orbit in orbits)
        ]
        parameters = {name: np.array([orbit.values[name] for orbit in orbits]) for name in names}
        return np.array(states), np.array([o.omega for o in orbits]), parameters, np.array(sizes)


def _shots(solved: ShotMotions, states: Array, omega: Array, sizes: Array) -> list[Shot]:
    multipliers, errors = solved.multipliers()
    distance = np.max(np.abs(solved.states - states) / sizes[:, None, :], axis=(1, 2))
    distance = np.maximum(distance, np.abs(solved.omega - omega) / omega)
    return [
        Shot(bool(solved.converged[b]), float(distance[b]), solved.states[b, 0], float(solved.omega[b]), multipliers[b],
             errors[b])
        for b in range(len(states))
    ]  # fmt: skip


def _place(kind: str, at: list[ShotMotions], b: int, reach: float) -> tuple[float, float]:
    """Where the test function of a kind vanishes along the curve, and omega there; nan where it keeps its sign."""
    if not all(motions.converged[b] for motions in at):
        return float("nan"), float("nan")
    values = [_test(kind, motions, b) for motions in at]
    if kind == "NS":
        values = _pair(values)
    if not values[0] * values[2] < 0.0:
        return float("nan"), float("nan")
    # a parabola through the three, and where it vanishes between the sides
    c, a, d = (float(value) for value in np.polyfit((-1.0, 0.0, 1.0), values, 2))
    roots = np.roots([c, a, d]) if c != 0.0 else np.array([-d / a])
    inside = [float(root.real) for root in roots if abs(root.imag) < 1e-12 and abs(root.real) <= 1.0]
    share = min(inside, key=abs) if inside else 0.0
    bend = np.polyfit((-1.0, 0.0, 1.0), [float(motions.omega[b]) for motions in at], 2)
    return reach * share, float(np.polyval(bend, share))


def _test(kind: str, motions: ShotMotions, b: int) -> Any:
    """What changes its sign at a bifurcation; of a Neimark-Sacker point all multipliers of pairs."""
    monodromy = motions.monodromy[b]
    if kind == "LP":
        return float(motions.tangent[b, -1])
    if kind == "BP":
        return float(motions.border[b])
    if kind == "PD":
        return float(np.linalg.det(monodromy + np.eye(len(monodromy))))
    multipliers = np.linalg.eigvals(monodromy)
    return multipliers[multipliers.imag > 1e-9 * np.abs(multipliers)]


def _pair(pairs: list[Any]) -> list[float]:
    """|mu|^2 - 1 of the pair that is nearest to the unit circle in the middle, followed to either side."""
    if any(len(solved) == 0 for solved in pairs):
        return [1.0, 1.0, 1.0]
    own = pairs[1][np.argmin(np.abs(np.abs(pairs[1]) - 1.0))]
    return [float(abs(solved[np.argmin(np.abs(solved - own))]) ** 2 - 1.0) for solved in pairs]
