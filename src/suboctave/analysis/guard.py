"""Whether a step may hide something: what its two ends and the steps before tell.

Two events inside one step cancel in every test at its ends. A step is refused (and halved by the engine) if more than
one test changes in it, if the multipliers move too far for their path to be known, if one could have reached +1 or -1
and come back, if a complex pair could have met on the real axis, parted and met again, and if the orientation of the
curve changes without a branch point: then the step has jumped from one branch to another that passes close by.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from suboctave.bifurcation import ALL_KINDS, Bifurcation, Sample
from suboctave.harmonic.basis import ComplexArray

#: two changes in one step are separated by halving it, down to this distance in scaled arclength
_SEPARATE = 2e-3
#: steps shorter than this, in scaled arclength, are not halved for the multipliers' sake
_EXAMINED = 0.01
#: multipliers of modulus above one half may move by this much per step (relative to their modulus where it exceeds one)
_MOVEMENT = 0.4
#: steps shorter than this are not halved to tell a branch point from a jump between branches
_JUMP = 1e-5
#: multipliers this close to the unit circle are not counted when the count is held against the located bifurcations
_NEAR_CIRCLE = 0.02

BRANCH_POINT = next(kind for kind in ALL_KINDS if kind.name == "BP")


class StepGuard:
    """Judges steps along one curve; `passed` tells it of every accepted point."""

    def __init__(self, is_branch_point: Callable[[Sample, Sample], bool]) -> None:
        self._is_branch_point = is_branch_point
        self._before: Sample | None = None
        self._last: Sample | None = None
        self._changed: tuple[Sample, list[str]] | None = None
        self._recent: list[str] = []
        self._speed = 0.0

    def passed(self, sample: Sample) -> None:
        """The step to this sample was accepted."""
        changed = self._changed
        self._recent = changed[1] if changed is not None and changed[0] is sample else []
        if self._last is not None:
            step = sample.point.arclength - self._last.point.arclength
            moved = _movement(self._last.floquet.multipliers, sample.floquet.multipliers)
            self._speed = moved / step if step > 0.0 else 0.0
        self._before, self._last = self._last, sample

    def hides(self, old: Sample, new: Sample) -> bool:
        """True if the step from the last accepted sample to a new one may hide something, and is long enough to
        halve.
        """
        step = new.point.arclength - old.point.arclength
        # along one branch the orientation changes at branch points only
        if BRANCH_POINT.changed(old, new) and step > _JUMP and not self._is_branch_point(old, new):
            return True
        if step < _SEPARATE:
            return False
        changed = [kind.name for kind in ALL_KINDS if kind.changed(old, new)]
        crossed = abs(old.floquet.unstable - new.floquet.unstable)
        if len(changed) > 1 or crossed > 2 or (crossed == 2 and not changed):
            return True
        self._changed = (new, changed)
        return step >= _EXAMINED and self._path_unknown(old, new, step, changed)

    def _path_unknown(self, old: Sample, new: Sample, step: float, changed: list[str]) -> bool:
        """True if the multipliers may have visited +1, -1 or the real axis within a step and come back."""
        a, b = old.floquet.multipliers, new.floquet.multipliers
        # how far they went, seen directly and at the speed of the step before (a fast rotation may look like none)
        moved = _movement(a, b)
        way = max(moved, self._speed * step)
        if moved > _MOVEMENT or way > 1.5 * _MOVEMENT:
            return True
        for target, kinds in ((1.0, ("LP", "BP")), (-1.0, ("PD",))):
            if any(kind in changed or kind in self._recent for kind in kinds):
                continue
            if float(np.abs(a - target).min() + np.abs(b - target).min()) < 1.3 * way:
                return True
        if self._before is not None:
            last = old.point.arclength - self._before.point.arclength
            if _turned_back(self._before.floquet.multipliers, a, b, step / last):
                return True
        return _height(a, b) < 1.5 * way


class CountCheck:
    """Holds the number of unstable multipliers against the located bifurcations."""

    def __init__(self) -> None:
        self._last: Sample | None = None
        self._since: list[Bifurcation] = []

    def complaint(self, sample: Sample, found: list[Bifurcation]) -> str | None:
        """A sentence if the count has changed by what the bifurcations since the last clear point do not explain."""
        self._since += found
        mu = sample.floquet.multipliers
        if not sample.floquet.decided or np.any(np.abs(np.abs(mu) - 1.0) < _NEAR_CIRCLE):
            return None
        last, items = self._last, self._since
        self._last, self._since = sample, []
        if last is None:
            return None
        odd = sum(item.kind in ("LP", "PD", "BP") for item in items)
        pairs = sum(item.kind == "NS" for item in items)
        before, now = last.floquet.unstable, sample.floquet.unstable
        change = abs(now - before)
        # a branch that turns back at a pitchfork is its own mirror image behind it: the count does not change there
        branching = any(item.kind == "BP" for item in items)
        if change <= odd + 2 * pairs and (branching or (change - odd) % 2 == 0):
            return None
        a, b = last.point, sample.point
        names = ", ".join(item.kind for item in items) or "none"
        return (
            f"between {a.curve.where(a.u)} and {b.curve.where(b.u)} the number of unstable multipliers changes from "
            f"{before} to {now}, which the bifurcations located there ({names}) do not explain; a smaller max_step or "
            "more harmonics may resolve it"
        )


def _movement(old: ComplexArray, new: ComplexArray) -> float:
    """Largest distance from a new multiplier of modulus above one half to the nearest old one."""
    relevant = new[np.abs(new) > 0.5]
    if not relevant.size:
        return 0.0
    nearest = np.abs(relevant[:, None] - old[None, :]).min(axis=1)
    return float(np.max(nearest / np.maximum(1.0, np.abs(relevant))))


def _height(old: ComplexArray, new: ComplexArray) -> float:
    """Least way of a complex pair (modulus above one half) down to the real axis and up again between two points."""
    relevant = new[(new.imag > 0.0) & (np.abs(new) > 0.5)]
    before = old[old.imag > 0.0]
    if not (relevant.size and before.size):
        return np.inf
    partner = before[np.abs(relevant[:, None] - before[None, :]).argmin(axis=1)]
    return float(np.min(relevant.imag + partner.imag))


def _turned_back(before: ComplexArray, old: ComplexArray, new: ComplexArray, ratio: float) -> bool:
    """True if a complex pair that would have reached the real axis is still far from it: it may have been there.

    `ratio` is the length of the step from old to new in units of the one before it.
    """
    before, old = before[before.imag > 0.0], old[old.imag > 0.0]
    if not (before.size and old.size):
        return False
    for mu in new[(new.imag > 0.0) & (np.abs(new) > 0.5)]:
        now = old[np.abs(old - mu).argmin()]
        fall = before[np.abs(before - now).argmin()].imag - now.imag
        if mu.imag > 0.3 * now.imag and 2.5 * ratio * fall > now.imag:
            return True
    return False
