"""The path that a slow sweep would follow along a branch: stable motions, and jumps where these end.

A sweep moves along stable motions in its direction. At a limit point they turn back and it jumps, to a stable motion at
the same value of the parameter. Where stability is lost otherwise (a period doubling, a Neimark-Sacker bifurcation, a
branch point) the motion goes on as one that is not on this branch: the path ends there and says so. It ends as well
where a jump finds no stable motion on the branch, or several: which of them is reached depends on the transient.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suboctave.continuation.problem import Array
from suboctave.errors import InputError, suggest
from suboctave.pictures.strokes import Line, line
from suboctave.store.layout import check_layout

if TYPE_CHECKING:
    import xarray


_DIRECTIONS = {"up": 1.0, "down": -1.0}
_LEFT_FOR = {
    "PD": "a motion of twice the period",
    "NS": "a quasi-periodic motion",
    "BP": "another branch, or a jump",
}


@dataclass(frozen=True)
class Jump:
    """A jump of a sweep: the free parameter's value, and the amplitudes before and after it.

    `kind` is that of the bifurcation ("LP"), or "fold" where the branch turns back without a located one. The amplitude
    after it is interpolated between computed points.
    """

    value: float
    before: float
    after: float
    kind: str


@dataclass(frozen=True, eq=False)
class SweepPath:
    """The path of a sweep, "up" or "down" in the free parameter `name`.

    `values`, `amplitude`, (vertices,): the path, a jump as two vertices of the same value; `jumps` in the order met;
    `ended` says in words why the path ends where it does, `complete` whether that is the end of the branch's range.
    """

    direction: str
    name: str
    values: Array
    amplitude: Array
    jumps: tuple[Jump, ...]
    ended: str
    complete: bool

    def amplitude_at(self, value: float) -> float:
        """Amplitude of the path at a value of the free parameter, interpolated; nan where it does not get."""
        sense = 1 if self.direction == "up" else -1
        v, a = self.values[::sense], self.amplitude[::sense]
        return float(np.interp(value, v, a, left=np.nan, right=np.nan)) if len(v) else float("nan")

    def __repr__(self) -> str:
        span = f"{self.name} from {self.values[0]:.6g} to {self.values[-1]:.6g}" if len(self.values) else "empty"
        text = f"Sweep {self.direction}: {span}; {self.ended}."
        for jump in self.jumps:
            way = "up" if jump.after > jump.before else "down"
            text += (
                f"\n  jumps {way} at {self.name} = {jump.value:.9g} ({jump.kind}), "
                f"amplitude from {jump.before:.6g} to {jump.after:.6g}"
            )
        return text


@dataclass(frozen=True)
class _Run:
    """Vertices first .. last of the line, stable throughout and monotone in the free parameter; `sense` its sign."""

    first: int
    last: int
    sense: float

    def ends(self, sign: float) -> tuple[int, int]:
        """Where a sweep of this sign enters and leaves it."""
        return (self.first, self.last) if self.sense == sign else (self.last, self.first)


def sweep_path(dataset: xarray.Dataset, direction: str = "up") -> SweepPath:
    """The path that a sweep of the free parameter, "up" or "down", follows along a branch; see the top of the module.

    It begins at the outermost stable motion on the side that it comes from (the smallest, where there are several).

    Raises InputError for another direction, or a branch without verdicts on stability.
    """
    check_layout(dataset.attrs)
    if not isinstance(direction, str) or direction not in _DIRECTIONS:
        raise InputError(f'direction is "up" or "down", not {direction!r}{suggest(str(direction), _DIRECTIONS)}')
    if "stable" not in dataset:
        raise InputError("a sweep follows stable motions, and this branch has no verdicts on stability")
    name = str(dataset.attrs["free"])
    whole = line(dataset, name)
    sign = _DIRECTIONS[direction]
    runs = _runs(whole)
    if not runs:
        return SweepPath(direction, name, np.zeros(0), np.zeros(0), (), "no motion of the branch is stable", False)
    run = min(runs, key=lambda run: (sign * whole.x[run.ends(sign)[0]], whole.y[run.ends(sign)[0]]))
    at = run.ends(sign)[0]
    values: list[float] = []
    amplitudes: list[float] = []
    jumps: list[Jump] = []
    limit = (whole.x * sign).max()
    while True:
        end = run.ends(sign)[1]
        step = 1 if end >= at else -1
        walked = np.arange(at, end + step, step)
        values += whole.x[walked].tolist()
        amplitudes += whole.y[walked].tolist()
        why, goes_on = _what_ends(dataset, whole, run, end, step)
        if not goes_on:
            complete = sign * whole.x[end] >= limit - 1e-12 * max(1.0, abs(limit))
            break
        here, kind = float(whole.x[end]), why
        landings = _landings(whole, runs, run, here, sign)
        if len(landings) != 1:
            there = ", ".join(f"{amplitude:.6g}" for _, amplitude in landings)
            target = (
                f"are several stable motions (amplitudes {there})" if landings else "is no stable motion of this branch"
            )
            why, complete = f"at the fold at {name} = {here:.9g} the sweep jumps, and there {target} to jump to", False
            break
        run, landed = landings[0]
        jumps.append(Jump(here, float(amplitudes[-1]), landed, kind))
        values.append(here)
        amplitudes.append(landed)
        inside = np.arange(run.first, run.last + 1)
        ahead = inside[sign * whole.x[inside] > sign * here]
        at = int(ahead[np.argmin(sign * whole.x[ahead])]) if ahead.size else run.ends(sign)[1]
    return SweepPath(direction, name, np.array(values), np.array(amplitudes), tuple(jumps), why, bool(complete))


def hysteresis(dataset: xarray.Dataset) -> list[tuple[float, float]]:
    """Ranges of the free parameter in which sweeps up and down find different motions, ascending.

    Only where both paths get: beyond the end of one of them nothing is said.
    """
    up, down = sweep_path(dataset, "up"), sweep_path(dataset, "down")
    if not (len(up.values) and len(down.values)):
        return []
    low, high = max(up.values[0], down.values[-1]), min(up.values[-1], down.values[0])
    inner = [jump.value for jump in (*up.jumps, *down.jumps) if low < jump.value < high]
    ends = np.unique([low, *inner, high]) if low < high else np.zeros(0)
    joined: list[tuple[float, float]] = []
    for first, last in pairwise(ends):
        middle = 0.5 * (first + last)
        a, b = up.amplitude_at(middle), down.amplitude_at(middle)
        if abs(a - b) <= 1e-9 * max(abs(a), abs(b)):
            continue
        if joined and joined[-1][1] == first:
            joined[-1] = (joined[-1][0], float(last))
        else:
            joined.append((float(first), float(last)))
    return joined


def _runs(whole: Line) -> list[_Run]:
    """The stable parts of the line, cut where the free parameter turns."""
    assert whole.stable is not None
    senses = np.sign(np.diff(whole.x))
    runs: list[_Run] = []
    for piece, (stable, sense) in enumerate(zip(whole.stable, senses, strict=True)):
        # two events at one value (contacts that graze at once) are no turn
        if stable and runs and runs[-1].last == piece and sense in (0.0, runs[-1].sense):
            runs[-1] = _Run(runs[-1].first, piece + 1, runs[-1].sense)
        elif stable and sense:
            runs.append(_Run(piece, piece + 1, sense))
    return runs


def _what_ends(dataset: xarray.Dataset, whole: Line, run: _Run, end: int, step: int) -> tuple[str, bool]:
    """Why a run ends: the kind of fold and True where a sweep jumps, else words and False."""
    name, here = str(dataset.attrs["free"]), float(whole.x[end])
    event = int(whole.event[end])
    if event >= 0:
        kind = str(dataset["event_kind"].to_numpy()[event])
        if kind == "LP":
            return kind, True
        if kind in _LEFT_FOR:
            there = "; a jump is likely" if str(dataset["event_criticality"].to_numpy()[event]) == "subcritical" else ""
            return f"stability is lost at a {kind} at {name} = {here:.9g}, for {_LEFT_FOR[kind]}{there}", False
    if 0 < end < whole.x.size - 1:
        beyond = np.sign(whole.x[end + step] - whole.x[end]) * step
        if beyond and beyond != run.sense:
            return "fold", True
        return f"stability is lost at {name} = {here:.9g} without a located bifurcation", False
    if int(dataset.attrs.get("closed", 0)):
        return f"the branch closes on itself at {name} = {here:.9g}", False
    if end == 0:
        return f"reached the beginning of the branch at {name} = {here:.9g}", False
    return str(dataset.attrs.get("ended", f"end of the branch at {name} = {here:.9g}")), False


def _landings(whole: Line, runs: list[_Run], left: _Run, here: float, sign: float) -> list[tuple[_Run, float]]:
    """Stable runs other than the one just left that a sweep can go on with from this value, and their amplitudes."""
    from scipy.interpolate import PchipInterpolator

    places = []
    for run in runs:
        if run is left:
            continue
        enters, leaves = run.ends(sign)
        # one that begins or ends right here is the same fold, or does not go on
        if not sign * whole.x[enters] < sign * here < sign * whole.x[leaves]:
            continue
        x, first = np.unique(whole.x[run.first : run.last + 1], return_index=True)
        y = whole.y[run.first : run.last + 1][first]
        amplitude = PchipInterpolator(x, y)(here) if len(x) > 2 else np.interp(here, x, y)  # monotone
        places.append((run, float(amplitude)))
    return places
