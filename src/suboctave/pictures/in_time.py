"""What time integration finds: a trajectory, stroboscopic points, brute-force diagrams and stepped sines over branches.

Motions have the colours of their periods, as in every picture; what does not repeat is grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, chosen_dof, suggest
from suboctave.pictures import style
from suboctave.pictures.drawing import Axis, Drawing, Entry, Frame, Markers, Polyline, dot, ordered, plain
from suboctave.pictures.options import Coordinates, View, as_multiple, shown_multiple
from suboctave.pictures.paper import figure_of
from suboctave.pictures.periods import period_colour, period_name
from suboctave.pictures.response import response_frame
from suboctave.pictures.style import Mark, Pen

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


Size = str | tuple[float, float]
_POINTING = {"up": "^", "down": "v", "rest": "o"}
_APERIODIC = "aperiodic"
#: share of the axis beyond what is drawn
_MARGIN = 0.02


def plot_trajectory(
    trajectory: xarray.Dataset,
    path: str | Path | None = None,
    *,
    dof: int | None = None,
    quantity: str = "displacement",
    title: str | None = None,
    size: Size = (7.2, 3.2),
) -> Figure:
    """The displacement (or "velocity") of one degree of freedom over time, instants of phase 0 marked."""
    check_contents(trajectory, "trajectory")
    if quantity not in ("displacement", "velocity"):
        raise InputError(f"unknown quantity {quantity!r}{suggest(str(quantity), ['displacement', 'velocity'])}")
    dof = checked_dof(trajectory, dof)
    time = trajectory["time"].to_numpy() * float(trajectory.attrs["omega"]) / (2.0 * np.pi)
    at = np.array([time, trajectory[quantity].to_numpy()[:, dof]])
    instants = at[:, :: int(trajectory.attrs["steps_per_period"])]
    line = Polyline(at, Pen(style.INK), role="motion")
    strobe = Markers(instants, dot(style.CURVE_COLOURS[0], 3.0), cut=True, role="strobe", layer=4.0)
    axes = (
        Axis(r"time in load periods, $t/T$", time[0], time[-1]),
        Axis(symbol_of(trajectory, dof, int(quantity == "velocity"))),
    )
    frame = Frame([line, strobe], title=style.checked_text(title))
    return figure_of(Drawing(axes, [frame]), style.sheet_of(size), path)


def plot_sections(
    sections: xarray.Dataset,
    path: str | Path | None = None,
    *,
    dof: int | None = None,
    title: str | None = None,
    size: Size = (5.2, 4.6),
) -> Figure:
    """Stroboscopic points in the plane of displacement and velocity of one degree of freedom, coloured by period."""
    check_contents(sections, "poincare sections")
    dof = checked_dof(sections, dof)
    at = np.array([sections[name].to_numpy()[..., dof] for name in ("displacement", "velocity")])
    frame, entries = Frame(title=style.checked_text(title)), {}
    periods = sections["period"].to_numpy()
    for period in sorted(set(periods.tolist()), key=lambda p: (p != 0, p)):
        last = slice(-period, None) if period else slice(None)
        chosen = at[:, np.flatnonzero(periods == period), last].reshape(2, -1)
        frame.items.append(_points(chosen, period, 4.0 if period else 0.8, f"period {period}"))
        entries[_name(period)] = Entry(mark=dot(_colour(period)))
    axes = [Axis(symbol_of(sections, dof, order)) for order in (0, 1)]
    return figure_of(Drawing(axes, [frame], ordered(entries)), style.sheet_of(size), path)


def plot_brute_force(
    diagram: xarray.Dataset,
    path: str | Path | None = None,
    *,
    curves: Any = None,
    quantity: str = "amplitude",
    starts: Sequence[str] | None = None,
    dof: int | None = None,
    title: str | None = None,
    size: Size = (6.4, 4.2),
) -> Figure:
    """The motions over the parameter that was varied, with branches beneath if any are given.

    Parameters
    ----------
    curves
        Branches, diagrams of branches or their datasets; of the amplitude only.
    quantity
        "amplitude": one mark for each motion, its largest |x|. "section": its displacement at phase 0 of the load,
        as many points as the motion has periods, all of them where nothing repeats.
    starts
        Ways to start that are shown; default all.
    dof
        Degree of freedom; default the observed one.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    check_contents(diagram, "brute force")
    if quantity not in ("amplitude", "section"):
        raise InputError(f"unknown quantity {quantity!r}{suggest(str(quantity), ['amplitude', 'section'])}")
    if curves is not None and quantity != "amplitude":
        raise InputError('curves= are drawn with quantity="amplitude"')
    known = [str(name) for name in diagram["start"].to_numpy()]
    shown = known if starts is None else list(starts)
    for name in shown:
        if name not in known:
            raise InputError(f"there is no start {name!r}{suggest(str(name), known)}")
    dof = checked_dof(diagram, dof)
    varied = str(diagram.attrs["varied"])
    values = diagram["value"].to_numpy()
    margin = _MARGIN * (np.ptp(values) or abs(values[0]) or 1.0)
    low, high = float(values.min() - margin), float(values.max() + margin)
    frame, entries = _beneath(curves, varied, View(xlim=(low, high)))
    marks: dict[str, Entry] = {}
    for start in shown:
        marks |= _add_motions(frame, diagram.isel(start=known.index(start)), start, dof, quantity == "section")
    # beside curves, whose periods have the same names, marks say that they are motions in time
    entries |= {f"{name}, in time" if curves is not None else name: mark for name, mark in marks.items()}
    symbol = symbol_of(diagram, dof, 0).strip("$")
    upwards = rf"$\max\,|{symbol}|$" if quantity == "amplitude" else rf"${symbol}(t_k)$, stroboscopic"
    across = Axis(r"$\omega$" if varied == "omega" else plain(varied), low, high)
    frame.title = style.checked_text(title)
    return figure_of(Drawing((across, Axis(upwards)), [frame], ordered(entries)), style.sheet_of(size), path)


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
    size: Size = (6.4, 4.2),
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
    check_contents(test, "stepped sine")
    dof = checked_dof(test, dof)
    harmonic = as_multiple(harmonic)
    listed = _measured(measured, harmonic)
    limits = View(xlim=xlim, ylim=ylim)
    values = _component(test, harmonic, dof)
    omega, periods = test["omega"].to_numpy(), test["period"].to_numpy()
    every = np.concatenate([omega, *(one.omega for one in listed)])
    margin = _MARGIN * (np.ptp(every) or abs(every[0]))
    low, high = limits.xlim or (float(every.min() - margin), float(every.max() + margin))
    shown = View("harmonic", harmonic, None, dof, xlim=(low, high), ylim=limits.ylim)
    frame, entries = _beneath(curves, "omega", shown)
    for s, direction in enumerate(test["direction"].to_numpy()):
        for period in sorted({int(p) for p in periods[s] if p >= 0}, key=lambda p: (p == 0, p)):
            here = periods[s] == period
            name = "not settled" if period == 0 else _name(period)
            mark = Mark(_POINTING.get(str(direction), "s"), 3.6, "none", _colour(period), 0.8)
            at = np.array([omega[here], values[s][here]])
            frame.items.append(Markers(at, mark, cut=True, role=f"{direction} {name}", layer=4.0))
            entries[f"{name}, stepped {direction}"] = Entry(mark=mark)
    for one, colour in zip(listed, style.CURVE_COLOURS[3:] * len(listed), strict=False):
        mark = Mark("+", 5.0, colour, colour)
        at = np.array([one.omega, one.amplitude])
        frame.items.append(Markers(at, mark, cut=True, role="measured", layer=4.2))
        entries[plain(one.label)] = Entry(mark=mark)
    symbol = f"X_{{{shown_multiple(harmonic)}}}" + ("" if test.attrs["dofs"] == 1 else f"^{{({dof})}}")
    axes = Axis(r"$\omega$", low, high), Axis(f"$|{symbol}|$", *(limits.ylim or (0.0, None)))
    frame.title = style.checked_text(title)
    return figure_of(Drawing(axes, [frame], ordered(entries)), style.sheet_of(size), path)


def _beneath(curves: Any, x: str, view: View) -> tuple[Frame, dict[str, Entry]]:
    """The frame with branches over `x`, if any are given, and their entries in the legend."""
    if curves is None:
        return Frame(), {}
    from suboctave.pictures.plot import datasets_of

    return response_frame(datasets_of(curves, view), Coordinates((x, None), view))


def _add_motions(frame: Frame, row: xarray.Dataset, start: str, dof: int, sections: bool) -> dict[str, Entry]:
    """Add the motions of one way to start, their amplitudes or their `sections`, and give their entries."""
    entries: dict[str, Entry] = {}
    values, periods = row["value"].to_numpy(), row["period"].to_numpy()
    table = row["displacement" if sections else "largest"].to_numpy()[..., dof]
    for period in sorted({int(p) for p in periods if p >= 0}):
        here, role = np.flatnonzero(periods == period), f"{start} {_name(period)}"
        known = table[here][:, -period:] if period else table[here]
        if sections:
            at = np.array([np.repeat(values[here], known.shape[1]), known.ravel()])
            frame.items.append(_points(at, period, 1.8 if period else 0.9, role))
            mark = dot(_colour(period))  # large enough for its colour to be seen
        else:
            mark = Mark(_POINTING.get(start, "s"), 3.2, "none", _colour(period), 0.7)
            at = np.array([values[here], known.max(axis=1)])
            frame.items.append(Markers(at, mark, cut=True, role=role, layer=4.0))
        entries[_name(period)] = Entry(mark=mark)
    return entries


def _points(at: np.ndarray, period: int, size: float, role: str) -> Markers:
    return Markers(at, dot(_colour(period), size), cut=True, role=role, layer=3.0 + bool(period))


def _component(test: xarray.Dataset, harmonic: float, dof: int) -> np.ndarray:
    if harmonic == 1:
        return np.asarray(np.hypot(test["response_real"], test["response_imag"]))[..., dof]
    multiples = test["multiple"].to_numpy()
    which = np.flatnonzero(np.abs(multiples - harmonic) < 1e-9)
    if not which.size:
        raise InputError(f"harmonic={harmonic:g} was not measured; there are {multiples.tolist()}")
    modulus = np.asarray(np.hypot(test["component_real"], test["component_imag"]))
    return np.asarray(modulus[:, :, int(which[0]), dof])


def _measured(measured: Any, harmonic: float) -> list[Any]:
    if measured is None:
        return []
    if harmonic != 1:
        raise InputError("measured= are amplitudes of the fundamental: they are drawn with harmonic=1")
    listed = list(measured) if isinstance(measured, Sequence) else [measured]
    for one in listed:
        if not (hasattr(one, "omega") and hasattr(one, "amplitude") and hasattr(one, "label")):
            raise InputError(f"measured= takes what read_measured gives, not {type(one).__name__}")
    return listed


def _colour(period: int) -> str:
    return period_colour(period) if period else style.SOFT


def _name(period: int) -> str:
    return period_name(period) if period else _APERIODIC


def symbol_of(dataset: xarray.Dataset, dof: int, order: int) -> str:
    """A displacement, or its first derivative, as an axis says it."""
    symbol = f"x_{{{dof}}}" if dataset.attrs["dofs"] > 1 else "x"
    return rf"$\dot {symbol}$" if order else f"${symbol}$"


def check_contents(dataset: Any, contents: str) -> None:
    """InputError for what is no dataset of these contents."""
    given = getattr(dataset, "attrs", {}).get("contents")
    if given != contents:
        raise InputError(
            f"expected a dataset of {contents!r}, got {given or type(dataset).__name__!r}; use its to_xarray()"
        )


def checked_dof(dataset: xarray.Dataset, dof: int | None) -> int:
    """The degree of freedom that is drawn, default the observed one; InputError where there is none."""
    return chosen_dof(dof, int(dataset.attrs["observed"]), int(dataset.attrs["dofs"]))
