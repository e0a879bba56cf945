"""Spectra of motions: |c_k| of `x(t) = Re sum_k c_k exp(i k omega t / nu)` over the multiples k / nu of omega.

Each component has the colour of the period of its own motion: that at k / nu = p / q, in lowest terms, repeats after q
load periods. A period doubling shows as new components halfway between the old ones. Beyond the components that were
solved for stand, hollow, those neglected, as the force of the solved motion would excite them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.motions import DERIVATIVES, Frames, MotionView, check_path, lower_first
from suboctave.pictures.periods import period_colour, period_of

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_spectrum"]

_CELL = (5.6, 2.4)  # inches of one frame
#: components below this share of the largest are rounding, or zero by symmetry
_NOTHING = 1e-11
#: share of the solved range that is shown beyond it
_BEYOND = 0.3
#: markers of one motion after another, in one frame
_MARKERS = ("o", "s", "^", "D", "v")


def plot_spectrum(
    motions: Any,
    path: str | Path | None = None,
    *,
    points: Sequence[int] | None = None,
    quantity: str = "displacement",
    dof: int | None = None,
    highest: float | None = None,
    overlay: bool = False,
    frequency: str | None = None,
    omega_reference: float | None = None,
    scale: float | None = None,
    unit: str | None = None,
    xlabel: str | None = None,
    ylabel: str | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: str | tuple[float, float] | None = None,
) -> Figure:
    """Draw the amplitudes of a motion's components on a logarithmic scale, one above the other or in one frame.

    Components at whole multiples of omega are those of motions of the load's period; those at multiples of omega / 2,
    omega / 3, ... have colours of their own. A dotted line ends what was solved for, hollow markers beyond it are the
    neglected components, estimated.

    Parameters
    ----------
    motions, path, points, dof, overlay, labels, title, size
        As in `plot_phase`.
    quantity
        "displacement", "velocity" or "acceleration".
    highest
        Highest multiple of omega that is shown; default all that was solved for and some of what was neglected.
    frequency
        "Hz" or "rad/s": the axis shows frequencies, not multiples of omega.
    omega_reference
        The axis shows frequencies over this one.
    scale, unit
        Factor on lengths, and its unit for the label.
    xlabel, ylabel
        Texts of the axes.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    from suboctave.store.motions import motion_datasets  # loads kernels, which curves from files need not

    view = MotionView(quantity, None, frequency, omega_reference, scale, unit, xlabel, ylabel)
    view.check_quantity(list(DERIVATIVES))
    check_path(path)
    if highest is not None and not (isinstance(highest, int | float) and math.isfinite(highest) and highest > 0):
        raise InputError(f"highest must be a positive multiple of omega, not {highest!r}")
    datasets = motion_datasets(motions, points, dof)
    frames = Frames(datasets, view, overlay=overlay, labels=labels, size=size, cell=_CELL, stacked=True)
    most = highest or max(_ends(dataset) * (1.0 + _BEYOND) for dataset in datasets)
    nu = max(period_of(dataset) for dataset in datasets)
    # where components stand close their markers must not become one
    apart = 0.85 * 72.0 * float(frames.figure.get_size_inches()[0]) / (most * nu + 1.0)
    ends = [_draw(frames, index, datasets[index], view, most, apart) for index in lower_first(datasets)]
    for drawing in filter(None, ends):
        frames.add("neglected (estimated)", drawing)
    _axis(frames, datasets, view, most)
    upwards = view.name(datasets[0], DERIVATIVES[quantity]).replace("$", r"$|c_k|$ of $", 1)
    return frames.finish(xlabel or _across(view), ylabel or upwards, title, path)


def _ends(dataset: xarray.Dataset) -> float:
    """Highest multiple of omega that was solved for."""
    return float(dataset["multiple"].to_numpy()[-1])


def _unit_of_axis(dataset: xarray.Dataset, view: MotionView) -> float:
    """What a multiple of omega is multiplied by on the axis."""
    omega = float(dataset.attrs["omega"])
    if view.frequency is not None:
        return omega / (2.0 * math.pi) if view.frequency == "Hz" else omega
    return 1.0 if view.omega_reference is None else omega / view.omega_reference


def _across(view: MotionView) -> str:
    if view.frequency is not None:
        return f"frequency ({view.frequency})"
    return r"frequency / forcing frequency" if view.omega_reference is None else r"frequency / $\omega_0$"


def _draw(
    frames: Frames, index: int, dataset: xarray.Dataset, view: MotionView, most: float, apart: float
) -> dict[str, Any] | None:
    """Draw one motion's components, `apart` points from each other; returns how the end of the solved ones is drawn."""
    axes, look = frames.axes[index], frames.look
    unit, order, nu = _unit_of_axis(dataset, view), DERIVATIVES[view.quantity], period_of(dataset)
    parts = {}
    for name, multiple in (("component", "multiple"), ("neglected", "multiple_neglected")):
        at = dataset[multiple].to_numpy()
        rate = (at * float(dataset.attrs["omega"])) ** order
        parts[name] = at, np.abs(dataset[f"amplitude_of_{name}"].to_numpy()) * rate * view.factor(order)
    largest = parts["component"][1].max()
    shape = _MARKERS[index % len(_MARKERS)] if frames.overlay else _MARKERS[0]
    size = min(0.62 * style.MARKER_SIZE * look.marker, max(0.8 * apart, 1.3))
    width = min(0.8 * look.line, max(0.3 * apart, 0.2))
    hollow = frames.overlay and index > 0  # so that one behind it shows
    for name, (at, height) in parts.items():
        shown = (height > _NOTHING * largest) & (at <= most * (1.0 + 1e-9))
        periods = np.array([Fraction(round(m * nu), nu).denominator for m in at])
        for q in np.unique(periods[shown]):
            chosen = shown & (periods == q)
            colour = period_colour(int(q))
            solved = name == "component"
            drawing: dict[str, Any] = {
                "linestyle": "none",
                "marker": shape,
                "markersize": size if solved else 0.8 * size,
                "markeredgecolor": colour,
                "markerfacecolor": colour if solved and not hollow else "none" if solved else "#ffffff",
                "markeredgewidth": min(look.edge, 0.25 * size),
            }
            if solved and not frames.overlay:
                axes.vlines(at[chosen] * unit, 0.0, height[chosen], color=colour, linewidth=width, zorder=2)
            axes.plot(at[chosen] * unit, height[chosen], zorder=3, gid=f"{name} {q}", **drawing)
            if solved:
                frames.add(
                    r"at $k\,\omega$" if q == 1 else rf"at $k\,\omega/{q}$",
                    {
                        **drawing,
                        "marker": "o",
                        "markersize": 0.62 * style.MARKER_SIZE * look.marker,
                        "markerfacecolor": colour,
                    },
                )
    if frames.overlay:
        inside = "none" if hollow else style.INK
        plain = {"linestyle": "none", "marker": shape, "markersize": size, "markerfacecolor": inside}
        edge = {"markeredgecolor": style.INK, "markeredgewidth": look.edge}
        frames.add(frames.names[index], {**plain, **edge}, last=False)
    end = _ends(dataset) + 0.5 / nu
    if end >= most:
        return None
    dotted: dict[str, Any] = {"color": style.SOFT, "linewidth": 0.9 * look.line, "linestyle": (0, (1.0, 1.5))}
    axes.axvline(end * unit, zorder=1, gid="truncation", **dotted)
    edge = {"markeredgecolor": style.INK, "markeredgewidth": look.edge}
    small = 0.5 * style.MARKER_SIZE * look.marker
    return {**dotted, **edge, "marker": "o", "markersize": small, "markerfacecolor": "#ffffff"}


def _axis(frames: Frames, datasets: Sequence[xarray.Dataset], view: MotionView, most: float) -> None:
    """Logarithmic upwards, whole decades; across the multiples of omega, as fractions where there is room for them."""
    axes = frames.frames[0]
    order = DERIVATIVES[view.quantity]
    heights = []
    for dataset in datasets:
        for name, multiple in (("component", "multiple"), ("neglected", "multiple_neglected")):
            at = dataset[multiple].to_numpy()
            height = np.abs(dataset[f"amplitude_of_{name}"].to_numpy()) * (at * float(dataset.attrs["omega"])) ** order
            heights.append(height[at <= most * (1.0 + 1e-9)] * view.factor(order))
    every = np.concatenate(heights)
    axes.set_yscale("log")
    if every.max(initial=0.0) > 0.0:
        above = every[every > _NOTHING * every.max()]
        top = math.ceil(math.log10(1.3 * above.max()))
        axes.set_ylim(10.0 ** min(math.floor(math.log10(above.min())), top - 3), 10.0**top)
    unit = max(_unit_of_axis(dataset, view) for dataset in datasets)
    nu = max(period_of(dataset) for dataset in datasets)
    axes.set_xlim(-0.6 * unit / nu, (most + 0.3 / nu) * unit)
    if view.frequency is None and view.omega_reference is None:
        _ticks(axes, nu, most)


def _ticks(axes: Axes, nu: int, most: float) -> None:
    from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator, MultipleLocator

    if nu * most <= 14.0:
        places = [Fraction(k, nu) for k in range(math.floor(nu * most) + 1)]
        axes.xaxis.set_major_locator(FixedLocator([float(place) for place in places]))
        axes.xaxis.set_major_formatter(FixedFormatter([str(place) for place in places]))
        return
    axes.xaxis.set_major_locator(MaxNLocator(nbins=12, integer=True))
    if most <= 130.0:
        axes.xaxis.set_minor_locator(MultipleLocator(1.0))
