"""Spectra of motions: |c_k| of `x(t) = Re sum_k c_k exp(i k omega t / nu)` over the multiples k / nu of omega.

Each component has the colour of the period of its own motion: that at k / nu = p / q, in lowest terms, repeats after q
load periods. A period doubling shows as new components halfway between the old ones. Beyond the components that were
solved for stand, hollow, those neglected, as the force of the solved motion would excite them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from suboctave.errors import InputError
from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.drawing import Axis, Entry, Guide, Markers, Polyline, Ticks
from suboctave.pictures.motions import MotionDrawing
from suboctave.pictures.options import DERIVATIVES, MotionView, SpectrumOptions
from suboctave.pictures.periods import period_colour, period_of
from suboctave.pictures.style import Mark, Pen

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


_CELL = (5.6, 2.4)  # inches of one frame
#: components below this share of the largest are rounding, or zero by symmetry
_NOTHING = 1e-11
#: share of the solved range that is shown beyond it
_BEYOND = 0.3
#: markers of one motion after another, in one frame
_MARKERS = ("o", "s", "^", "D", "v")
#: points of a marker, and how much smaller one in the legend is
_SIZE, _SMALLER = 0.62 * style.MARKER_SIZE, 0.8
#: where the components that were solved for end
_END = Pen(style.SOFT, 0.9, (0, (1.0, 1.5)))


@with_options(SpectrumOptions)
def plot_spectrum(
    motions: Any,
    path: str | Path | None = None,
    *,
    highest: float | None = None,
    **options: Unpack[SpectrumOptions],
) -> Figure:
    """Draw the amplitudes of a motion's components on a logarithmic scale, one above the other or in one frame.

    Components at whole multiples of omega are those of motions of the load's period; those at multiples of omega / 2,
    omega / 3, ... have colours of their own. A dotted line ends what was solved for, hollow markers beyond it are the
    neglected components, estimated. With `frequency` the axis shows frequencies, not multiples of omega.

    Parameters
    ----------
    motions, path
        As in `plot_phase`.
    highest
        Highest multiple of omega that is shown; default all that was solved for and some of what was neglected.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    if highest is not None and not (isinstance(highest, int | float) and math.isfinite(highest) and highest > 0):
        raise InputError(f"highest must be a positive multiple of omega, not {highest!r}")
    drawn = MotionDrawing(motions, path, options, list(DERIVATIVES), _CELL, stacked=True)
    datasets, view = drawn.datasets, drawn.view
    most = highest or max(_end(dataset) * (1.0 + _BEYOND) for dataset in datasets)
    nu = max(period_of(dataset) for dataset in datasets)
    # where components stand close their markers must not become one
    apart = 0.85 * 72.0 * drawn.sheet.inches[0] / (most * nu + 1.0) / drawn.sheet.look.marker
    decades = _decades(datasets, view, most)
    for index in drawn.lower_first:
        _add(drawn, index, most, apart, decades[0] or 1e-300)
    if any(_end(dataset) + 0.5 / period_of(dataset) < most for dataset in datasets):
        drawn.last["neglected (estimated)"] = Entry(_END, Mark("o", 0.5 * style.MARKER_SIZE, "#ffffff"))
    text = r"frequency / $\omega_0$" if view.omega_reference else "frequency / forcing frequency"
    text = f"frequency ({view.frequency})" if view.frequency else text
    unit = max(_unit_of_axis(dataset, view) for dataset in datasets)
    ticks = _ticks(nu, most) if view.frequency is None and view.omega_reference is None else None
    across = Axis(text, -0.6 * unit / nu, (most + 0.3 / nu) * unit, ticks=ticks)
    upwards = view.name(datasets[0], DERIVATIVES[view.quantity]).replace("$", r"$|c_k|$ of $", 1)
    return drawn.figure(across, Axis(upwards, *decades, logarithmic=True))


def _end(dataset: xarray.Dataset) -> float:
    """Highest multiple of omega that was solved for."""
    return float(dataset["multiple"].to_numpy()[-1])


def _unit_of_axis(dataset: xarray.Dataset, view: MotionView) -> float:
    """What a multiple of omega is multiplied by on the axis."""
    omega = float(dataset.attrs["omega"])
    return 1.0 if view.frequency is None and view.omega_reference is None else omega * view.per_omega


def _components(dataset: xarray.Dataset, view: MotionView) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Multiples of omega and amplitudes of the components that were solved for, and of those neglected."""
    order, omega, parts = DERIVATIVES[view.quantity], float(dataset.attrs["omega"]), {}
    for name, multiple in (("component", "multiple"), ("neglected", "multiple_neglected")):
        at = dataset[multiple].to_numpy()
        height = np.abs(dataset[f"amplitude_of_{name}"].to_numpy()) * (at * omega) ** order * view.factor(order)
        parts[name] = at, height
    return parts


def _add(drawn: MotionDrawing, index: int, most: float, apart: float, foot: float) -> None:
    """Add one motion's components to its frame, with markers `apart` points from each other, stems from `foot` on."""
    dataset, view, overlay = drawn.datasets[index], drawn.view, drawn.overlay
    items, unit, nu = drawn.frame(index).items, _unit_of_axis(dataset, view), period_of(dataset)
    parts = _components(dataset, view)
    largest = parts["component"][1].max()
    shape = _MARKERS[index % len(_MARKERS)] if overlay else _MARKERS[0]
    look = drawn.sheet.look
    size = min(_SIZE, max(0.8 * apart, 1.3 / look.marker))
    stem = min(0.8, max(0.3 * apart * look.marker, 0.2) / look.line)
    hollow = overlay and index > 0  # so that one behind it shows
    for name, (at, height) in parts.items():
        shown = (height > _NOTHING * largest) & (at <= most * (1.0 + 1e-9))
        periods = np.array([Fraction(round(m * nu), nu).denominator for m in at])
        for q in np.unique(periods[shown]):
            chosen, colour, solved = shown & (periods == q), period_colour(int(q)), name == "component"
            x, y = at[chosen] * unit, height[chosen]
            rim = min(1.0, 0.25 * size * look.marker / look.edge)
            face = colour if solved and not hollow else "none" if solved else "#ffffff"
            mark = Mark(shape, size if solved else _SMALLER * size, face, colour, rim)
            if solved and not overlay:
                gaps = np.full(x.size, np.nan)
                stems = np.array([np.ravel([x, x, gaps], "F"), np.ravel([np.full(x.size, foot), y, gaps], "F")])
                items.append(Polyline(stems, Pen(colour, stem), role="stem", layer=2.0))
            items.append(Markers(np.array([x, y]), mark, cut=True, role=f"{name} {q}"))
            if solved:
                words = r"at $k\,\omega$" if q == 1 else rf"at $k\,\omega/{q}$"
                drawn.last.setdefault(words, Entry(mark=replace(mark, marker="o", size=_SIZE, face=colour)))
    if overlay:
        plain_mark = Mark(shape, size, "none" if hollow else style.INK)
        drawn.legend.setdefault(drawn.names[index], Entry(mark=plain_mark))
    if _end(dataset) + 0.5 / nu < most:
        items.append(Guide((_end(dataset) + 0.5 / nu) * unit, _END, upright=True, role="truncation", layer=1.0))


def _decades(datasets: Sequence[xarray.Dataset], view: MotionView, most: float) -> tuple[float | None, float | None]:
    """The limits upwards: whole decades, three at least."""
    parts = [part for dataset in datasets for part in _components(dataset, view).values()]
    every = np.concatenate([height[at <= most * (1.0 + 1e-9)] for at, height in parts])
    if every.max(initial=0.0) <= 0.0:
        return None, None
    above = every[every > _NOTHING * every.max()]
    top = math.ceil(math.log10(1.3 * above.max()))
    return 10.0 ** min(math.floor(math.log10(above.min())), top - 3), 10.0**top


def _ticks(nu: int, most: float) -> Ticks:
    """The multiples of omega, as fractions where there is room for them."""
    if nu * most <= 14.0:
        places = [Fraction(k, nu) for k in range(math.floor(nu * most) + 1)]
        return Ticks(places=[float(place) for place in places], texts=[str(place) for place in places])
    return Ticks(12, (1, 2, 5, 10), whole=True, minor=1.0 if most <= 130.0 else None)
