"""Frames as their user wants them: texts, what of the axes is shown, logarithmic axes and decibels.

One function for all figures in a plane, whatever they show: `framed` changes a finished drawing. What a logarithmic
axis or one in decibels cannot show, values at or below zero, is left out and counted below its text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.pictures.drawing import Axis, Band, Beads, Drawing, Frame, Guide, Item, Markers, Polyline, Raster, Region

#: scales of the two axes; decibels are for quantities, which stand upwards
SCALES = {"x": ("linear", "log"), "y": ("linear", "log", "dB")}
#: share of an axis beyond what is drawn
_MARGIN = 0.05
#: the unit at the end of what an axis says
_UNIT = re.compile(r" \(([^()]*)\)$")


def framed(drawing: Drawing, options: Mapping[str, Any]) -> Drawing:
    """The drawing with the axes that `FrameOptions` ask for; InputError for what no axis can be."""
    across, upwards = (_Wanted(letter, options) for letter in "xy")
    if not (across.changes or upwards.changes):
        return drawing
    frames = drawing.frames
    axes = list(drawing.axes)
    for number, wanted in enumerate((across, upwards)):
        if wanted.scale is not None:
            frames, axes[number] = _on_scale(frames, axes[number], number, wanted)
    for number, wanted in enumerate((across, upwards)):
        if wanted.limits is not None:
            axes[number] = replace(axes[number], low=wanted.limits[0], high=wanted.limits[1])
    for number, wanted in enumerate((across, upwards)):
        if wanted.limits is None and (across.limits or upwards.limits or wanted.scale is not None):
            axes[number] = _around(frames, axes, number)
    if across.limits or upwards.limits:
        frames = [cut(frame, axes) for frame in frames]
    for number, wanted in enumerate((across, upwards)):
        if wanted.label:
            axes[number] = replace(axes[number], label=wanted.label)
    return replace(drawing, axes=axes, frames=frames)


def check_frame(options: Mapping[str, Any]) -> None:
    """InputError for limits and scales that no axis can have."""
    for letter in "xy":
        _Wanted(letter, options)


class _Wanted:
    """What is asked for of one axis: its text, limits and scale; None or "" where nothing is."""

    def __init__(self, letter: str, options: Mapping[str, Any]) -> None:
        self.name = f"{letter}scale"
        self.label = options.get(f"{letter}label") or ""
        self.scale: str | None = options.get(self.name)
        given, known = options.get(f"{letter}lim"), SCALES[letter]
        if self.scale is not None and self.scale not in known:
            reason = ": decibels are for yscale" if self.scale == "dB" else suggest(str(self.scale), known)
            raise InputError(f"{self.name} is one of {', '.join(map(repr, known))}, not {self.scale!r}{reason}")
        self.limits = None if given is None else _checked_limits(f"{letter}lim", given)
        if self.scale == "log" and self.limits is not None and self.limits[0] <= 0.0:
            raise InputError(f"{letter}lim=({self.limits[0]:g}, ...): a logarithmic axis begins above zero")

    @property
    def changes(self) -> bool:
        return bool(self.label or self.scale or self.limits)


def _checked_limits(name: str, limits: Any) -> tuple[float, float]:
    try:
        first, last = (float(value) for value in limits)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}={limits!r}: give two numbers, (from, to)") from None
    if not (math.isfinite(first) and math.isfinite(last) and first < last):
        raise InputError(f"{name}=({first:g}, {last:g}): two finite numbers, the smaller one first")
    return first, last


def _on_scale(frames: Sequence[Frame], axis: Axis, number: int, wanted: _Wanted) -> tuple[list[Frame], Axis]:
    """The frames and one of their axes on a scale, without values that it cannot show."""
    if wanted.scale == "linear":
        return list(frames), replace(axis, logarithmic=False, low=None, high=None)
    values = list(_values(frames, number))
    positive = sum(int(np.count_nonzero(own > 0.0)) for own in values)
    if values and not positive:
        raise InputError(f"{wanted.name}={wanted.scale!r} shows positive values, and there are none: leave it out")
    decibels = wanted.scale == "dB"
    label = axis.label
    if decibels:
        unit = _UNIT.search(label)
        label = f"{_UNIT.sub('', label)} (dB re 1{f' {unit[1]}' if unit else ''})"
    left = _left_out(frames, number)
    if left:
        label += f"\n{left} value{'s' * (left > 1)} at or below zero left out"
    made = [
        replace(
            frame,
            items=[_rescaled(item, number, decibels) for item in frame.items],
            labels=[replace(one, at=_row_on(np.asarray(one.at, float), number, decibels)) for one in frame.labels],
        )
        for frame in frames
    ]
    return made, replace(axis, label=label, low=None, high=None, logarithmic=not decibels, ticks=None)


def _rescaled(item: Item, number: int, decibels: bool) -> Item:
    match item:
        case Polyline() | Markers():
            return replace(item, at=_row_on(item.at, number, decibels))
        case Beads():
            at, clear = (_row_on(part, number, decibels) for part in (item.at, item.clear))
            return replace(item, at=at, clear=clear)
        case Region():
            return replace(item, outline=_row_on(item.outline, number, decibels))
        case Guide() if item.upright == (number == 0):
            return replace(item, value=float(_shown(np.array(item.value), decibels)))
        case Band() if number == 1:
            low, high = (float(_shown(np.array(end), decibels)) for end in (item.low, item.high))
            return replace(item, low=low, high=high)
        case Raster():
            if number == 0:
                return replace(item, across=_shown(item.across, decibels))
            return replace(item, upwards=_shown(item.upwards, decibels))
    return item


def _row_on(at: np.ndarray, number: int, decibels: bool) -> np.ndarray:
    """Places, (axes, ...), with one row as an axis shows it; nan where it cannot."""
    changed = np.array(at, dtype=float)
    changed[number] = _shown(changed[number], decibels)
    return changed


def _shown(values: np.ndarray, decibels: bool) -> np.ndarray:
    positive = np.where(values > 0.0, values, np.nan)
    return 20.0 * np.log10(positive) if decibels else positive


def _values(frames: Sequence[Frame], number: int) -> Iterator[np.ndarray]:
    """The values along one axis of all lines, markers and regions."""
    for frame in frames:
        for item in frame.items:
            if isinstance(item, Polyline | Markers):
                yield item.at[number]
            elif isinstance(item, Region):
                yield item.outline[number]


def _left_out(frames: Sequence[Frame], number: int) -> int:
    """How many places of lines and markers are at or below zero, those drawn twice counted once."""
    every = [i.at for frame in frames for i in frame.items if isinstance(i, Polyline | Markers)]
    if not every:
        return 0
    at = np.concatenate(every, axis=1)
    return len(np.unique(at[:, at[number] <= 0.0], axis=1).T)


def _around(frames: Sequence[Frame], axes: Sequence[Axis], number: int) -> Axis:
    """One axis from end to end of what is drawn within the limits of the other, with a margin."""
    axis, other = axes[number], axes[1 - number]
    low, high = (-math.inf if other.low is None else other.low, math.inf if other.high is None else other.high)
    values = []
    for frame in frames:
        for item in frame.items:
            at = item.outline if isinstance(item, Region) else getattr(item, "at", None)
            if at is not None:
                values.append(at[number][(at[1 - number] >= low) & (at[1 - number] <= high)])
    known = np.concatenate(values) if values else np.empty(0)
    known = known[np.isfinite(known)]
    if axis.logarithmic:
        known = np.log10(known[known > 0.0])
    if not known.size:
        return axis
    least, most = float(known.min()), float(known.max())
    from_zero = axis.low == 0.0 and least >= 0.0 and not axis.logarithmic
    beyond = _MARGIN * ((most - (0.0 if from_zero else least)) or abs(least) or 1.0)
    ends = (0.0 if from_zero else least - beyond), most + beyond
    low, high = (10.0**end for end in ends) if axis.logarithmic else ends
    return replace(axis, low=low, high=high)


def cut(frame: Frame, axes: Sequence[Axis]) -> Frame:
    """The frame without markers and texts beyond its limits, and without what its legend would say of these alone."""

    def inside(at: np.ndarray) -> np.ndarray:
        kept = np.ones(at.shape[1:], dtype=bool)
        for row, axis in zip(at, axes, strict=False):
            low, high = (-math.inf if axis.low is None else axis.low, math.inf if axis.high is None else axis.high)
            kept &= (row >= low) & (row <= high)
        return kept

    items: list[Item] = []
    for item in frame.items:
        if isinstance(item, Markers) and not item.cut:
            which = inside(item.at)
            if not which.any():
                continue
            vertices = None if item.vertices is None else np.asarray(item.vertices)[which]
            items.append(replace(item, at=item.at[:, which], vertices=vertices))
        else:
            items.append(item)
    marks = {(item.mark.marker, item.mark.face) for item in items if isinstance(item, Markers | Beads)}
    gone = {(i.mark.marker, i.mark.face) for i in frame.items if isinstance(i, Markers)} - marks
    entries = {
        name: entry
        for name, entry in frame.entries.items()
        if entry.pen is not None or entry.mark is None or (entry.mark.marker, entry.mark.face) not in gone
    }
    labels = [label for label in frame.labels if inside(np.asarray(label.at, float)[:, None]).all()]
    return replace(frame, items=items, labels=labels, entries=entries)
