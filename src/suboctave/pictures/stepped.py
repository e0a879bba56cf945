"""A stepped-sine test: measured components over frequency, over branches and beside what a rig measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError
from suboctave.pictures import style
from suboctave.pictures.in_time import _POINTING, _check, _colour, _dof, _finish, _frame, _name
from suboctave.pictures.response import draw_response, dress
from suboctave.pictures.view import View, as_multiple, shown_multiple

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

__all__ = ["plot_stepped_sine"]


def plot_stepped_sine(
    test: xarray.Dataset,
    path: str | Path | None = None,
    *,
    curves: Any = None,
    measured: Any = None,
    harmonic: float = 1,
    dof: int | None = None,
    xlim: Sequence[float] | None = None,
    ylim: Sequence[float] | None = None,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 4.2),
) -> Figure:
    """The modulus of a component at each step: upward and downward triangles, coloured by the period of the motion.

    Parameters
    ----------
    curves
        Branches, diagrams of branches or their datasets, drawn beneath by the same harmonic.
    measured
        `Measured`, or several of them; of the fundamental only.
    harmonic, dof
        Which multiple of omega; which degree of freedom (default the observed one).
    xlim, ylim
        Part of the axes that is shown, (from, to); default the frequencies of the test, and all amplitudes.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    from suboctave.pictures.plot import datasets_of

    _check(test, "stepped sine")
    dof = _dof(test, dof)
    harmonic = as_multiple(harmonic)
    data = _several(measured, harmonic)
    limits = View(xlim=xlim, ylim=ylim)
    values = _component(test, harmonic, dof)
    figure, axes, look = _frame(size)
    legend: dict[str, Any] = {}
    if curves is not None:
        view = View("harmonic", harmonic, None, dof)
        legend |= draw_response(axes, datasets_of(curves, view), x="omega", view=view, look=look)
    omega, periods = test["omega"].to_numpy(), test["period"].to_numpy()
    for s, direction in enumerate(test["direction"].to_numpy()):
        for period in sorted({int(p) for p in periods[s] if p >= 0}, key=lambda p: (p == 0, p)):
            here = periods[s] == period
            name = "not settled" if period == 0 else _name(period)
            legend[f"{name}, stepped {direction}"] = axes.plot(
                omega[here],
                values[s][here],
                _POINTING.get(str(direction), "s"),
                color=_colour(period),
                markerfacecolor="none",
                markersize=3.6 * look.marker,
                markeredgewidth=0.8 * look.edge,
                zorder=4,
                gid=f"{direction} {name}",
            )[0]
    for one, colour in zip(data, style.CURVE_COLOURS[3:] * len(data), strict=False):
        legend[one.label.replace("$", r"\$")] = axes.plot(
            one.omega, one.amplitude, "+", color=colour, markersize=5.0 * look.marker, zorder=4.2, gid="measured"
        )[0]
    symbol = f"X_{{{shown_multiple(harmonic)}}}" + ("" if test.attrs["dofs"] == 1 else f"^{{({dof})}}")
    dress(axes, r"$\omega$", f"$|{symbol}|$", look)
    every = np.concatenate([omega, *(one.omega for one in data)])
    spread = np.ptp(every) or abs(every[0])
    axes.set_xlim(*(limits.xlim or (every.min() - 0.02 * spread, every.max() + 0.02 * spread)))
    axes.set_ylim(*(limits.ylim or (0.0, None)))
    return _finish(figure, axes, legend, look, title, path)


def _component(test: xarray.Dataset, harmonic: float, dof: int) -> np.ndarray:
    if harmonic == 1:
        return np.asarray(np.hypot(test["response_real"], test["response_imag"]))[..., dof]
    multiples = test["multiple"].to_numpy()
    found = np.flatnonzero(np.abs(multiples - harmonic) < 1e-9)
    if not found.size:
        raise InputError(f"harmonic={harmonic:g} was not measured; there are {multiples.tolist()}")
    modulus = np.asarray(np.hypot(test["component_real"], test["component_imag"]))
    return np.asarray(modulus[:, :, int(found[0]), dof])


def _several(measured: Any, harmonic: float) -> list[Any]:
    if measured is None:
        return []
    if harmonic != 1:
        raise InputError("measured= are amplitudes of the fundamental: they are drawn with harmonic=1")
    listed = list(measured) if isinstance(measured, Sequence) else [measured]
    for one in listed:
        if not (hasattr(one, "omega") and hasattr(one, "amplitude") and hasattr(one, "label")):
            raise InputError(f"measured= takes what read_measured gives, not {type(one).__name__}")
    return listed
