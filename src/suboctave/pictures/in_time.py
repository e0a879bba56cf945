"""What time integration finds: trajectories, stroboscopic points, brute-force diagrams and stepped sines over branches;
Lyapunov exponents, how two trajectories part, where motions are chaotic, basins of attraction; what shooting says of a
branch.

Motions have the colours of their periods, as in every picture; of several motions of one period the later ones are
paler in basins. What does not repeat is grey, in basins hatched.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import GivenDof, InputError, chosen_dof, suggest
from suboctave.pictures import style
from suboctave.pictures.boundary import boundary_drawing
from suboctave.pictures.drawing import STROKES, Axis, Band, Entry, Frame, Guide, Markers, Polyline, Raster, dot, plain
from suboctave.pictures.frames import cut
from suboctave.pictures.given import datasets_of, is_boundary
from suboctave.pictures.options import (
    Coordinates,
    View,
    as_multiple,
    check_quantity,
    declared_units,
    frequency_label,
    parts_of_dof,
    shown_multiple,
    units_of_dof,
)
from suboctave.pictures.paper import Layout, picture
from suboctave.pictures.response import response_frame
from suboctave.pictures.strokes import check_count
from suboctave.pictures.style import Mark, Pen, period_colour, period_name, places_among, rgb, tinted

if TYPE_CHECKING:
    import xarray


_POINTING = {"up": "^", "down": "v", "anew": "o"}
#: share of the axis beyond what is drawn
_MARGIN = 0.02
#: of what does not repeat, left the range or is missing: what it is called, its colour in a plane of states
_OTHER = {-1: ("aperiodic", "#e3e3e3"), -2: ("left the range", "#d55e00"), -3: ("not computed", "#ffffff")}
#: hatched besides, so that nobody takes it for a motion of period T
_APERIODIC = -1


@picture((7.2, 3.2))
def plot_trajectory(
    trajectory: xarray.Dataset, *, dof: GivenDof | None = None, quantity: str = "displacement"
) -> Layout:
    """The displacement (or "velocity") of one degree of freedom over time, instants of phase 0 marked."""
    check_quantity(quantity, ("displacement", "velocity"))
    dof = checked_dof(trajectory, dof)
    time = trajectory["time"].to_numpy() * float(trajectory.attrs["omega"]) / (2.0 * np.pi)
    at = np.array([time, _along(trajectory[quantity], dof)])
    instants = at[:, :: int(trajectory.attrs["steps_per_period"])]
    line = Polyline(at, Pen(style.INK), role="motion")
    strobe = Markers(instants, dot(style.CURVE_COLOURS[0], 3.0), cut=True, role="strobe", layer=4.0)
    across = Axis(r"time in load periods, $t/T$", time[0], time[-1])
    upwards = Axis(symbol_of(trajectory, dof, int(quantity == "velocity")))
    return Frame([line, strobe]), (across, upwards)


@picture((5.2, 4.6), by_kind=True)
def plot_sections(sections: xarray.Dataset, *, dof: GivenDof | None = None) -> Layout:
    """Stroboscopic points in the plane of displacement and velocity of one degree of freedom, coloured by period."""
    dof = checked_dof(sections, dof)
    at = np.array([_along(sections[name], dof) for name in ("displacement", "velocity")])
    frame, periods = Frame(), sections["period"].to_numpy()
    for period in sorted(set(periods.tolist()), key=lambda p: (p != 0, p)):
        last = slice(-period, None) if period else slice(None)
        chosen = at[:, np.flatnonzero(periods == period), last].reshape(2, -1)
        frame.add(_points(chosen, period, 4.0 if period else 0.8, f"period {period}"))
        frame.entries[_name(period)] = Entry(mark=dot(_colour(period)))
    axes = [Axis(symbol_of(sections, dof, order)) for order in (0, 1)]
    return frame, axes


@picture((6.4, 4.2), by_kind=True)
def plot_brute_force(
    diagram: xarray.Dataset,
    *,
    curves: Any = None,
    quantity: str = "amplitude",
    starts: Sequence[str] | None = None,
    dof: GivenDof | None = None,
) -> Layout:
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
    """
    check_quantity(quantity, ("amplitude", "section"))
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
    low, high = _limits(values)
    frame = _beneath(curves, Axis(varied, low, high), View())
    # beside curves, whose periods have the same names, marks say that they are motions in time
    suffix = "" if curves is None else ", in time"
    for start in shown:
        _add_motions(frame, diagram.isel(start=known.index(start)), start, dof, quantity == "section", suffix)
    symbol = _symbol_of(diagram, dof, 0).strip("$")
    upwards = rf"$\max\,|{symbol}|$" if quantity == "amplitude" else rf"${symbol}(t_k)$, stroboscopic"
    upwards = _with_unit(upwards, diagram, 0, dof)
    text, shows = (_frequency_axis(diagram), varied) if varied == "omega" else (plain(varied), "")
    across = Axis(text, low, high, shows=shows)
    return frame, (across, Axis(upwards))


@picture((6.4, 4.2), by_kind=True)
def plot_stepped_sine(
    test: xarray.Dataset,
    *,
    curves: Any = None,
    measured: Any = None,
    harmonic: float = 1,
    dof: GivenDof | None = None,
) -> Layout:
    """The modulus of a component at each step: upward and downward triangles, coloured by the period of the motion.

    Parameters
    ----------
    curves
        Branches, diagrams of branches or their datasets, drawn beneath by the same harmonic.
    measured
        `Measured`, or several of them; of the fundamental only.
    harmonic, dof
        Which multiple of omega; which degree of freedom (default the observed one).
    """
    dof = checked_dof(test, dof)
    harmonic = as_multiple(harmonic)
    listed = _measured(measured, harmonic)
    values = _component(test, harmonic, dof)
    omega, periods = test["omega"].to_numpy(), test["period"].to_numpy()
    low, high = _limits(np.concatenate([omega, *(one.omega for one in listed)]))
    frame = _beneath(curves, Axis("omega", low, high), View("harmonic", harmonic, None, dof))
    for s, direction in enumerate(test["direction"].to_numpy()):
        for period in sorted({int(p) for p in periods[s] if p >= 0}, key=lambda p: (p == 0, p)):
            here = periods[s] == period
            name = "not settled" if period == 0 else _name(period)
            mark = Mark(_POINTING[str(direction)], 3.6, "none", _colour(period), 0.8)
            at = np.array([omega[here], values[s][here]])
            marks = Markers(at, mark, cut=True, role=f"{direction} {name}", layer=4.0)
            frame.add(marks, f"{name}, stepped {direction}")
    for one, colour in zip(listed, style.CURVE_COLOURS[3:] * len(listed), strict=False):
        at = np.array([one.omega, one.amplitude])
        marks = Markers(at, Mark("+", 5.0, colour, colour), cut=True, role="measured", layer=4.2)
        frame.add(marks, plain(one.label))
    symbol = f"X_{{{shown_multiple(harmonic)}}}" + ("" if test.attrs["dofs"] == 1 else f"^{{({dof})}}")
    axes = Axis(_frequency_axis(test), low, high, shows="omega"), Axis(_with_unit(f"$|{symbol}|$", test, 0, dof), 0.0)
    return frame, axes


def _limits(values: np.ndarray) -> tuple[float, float]:
    """The limits of an axis that shows values, with a margin."""
    margin = _MARGIN * (np.ptp(values) or abs(values[0]) or 1.0)
    return float(values.min() - margin), float(values.max() + margin)


def _beneath(curves: Any, across: Axis, view: View) -> Frame:
    """The frame with branches over a parameter, the text of an axis, if any are given; no markers beyond its ends."""
    if curves is None:
        return Frame()
    return cut(response_frame(datasets_of(curves, view), Coordinates((across.label, None), view)), [across])


def _add_motions(frame: Frame, row: xarray.Dataset, start: str, dof: int, sections: bool, suffix: str) -> None:
    """Add the motions of one way to start, their amplitudes or their `sections`; `suffix` to their names."""
    values, periods = row["value"].to_numpy(), row["period"].to_numpy()
    table = _along(row["displacement" if sections else "largest"], dof)
    for period in sorted({int(p) for p in periods if p >= 0}):
        here, role, name = np.flatnonzero(periods == period), f"{start} {_name(period)}", _name(period) + suffix
        known = table[here][:, -period:] if period else table[here]
        if sections:
            at = np.array([np.repeat(values[here], known.shape[1]), known.ravel()])
            frame.add(_points(at, period, 1.8 if period else 0.9, role))
            frame.entries[name] = Entry(mark=dot(_colour(period)))  # large enough for its colour to be seen
        else:
            mark = Mark(_POINTING[start.split()[0]], 3.2, "none", _colour(period), 0.7)
            at = np.array([values[here], known.max(axis=1)])
            frame.add(Markers(at, mark, cut=True, role=role, layer=4.0), name)


def _points(at: np.ndarray, period: int, size: float, role: str) -> Markers:
    return Markers(at, dot(_colour(period), size), cut=True, role=role, layer=3.0 + bool(period))


def _component(test: xarray.Dataset, harmonic: float, dof: int) -> np.ndarray:
    if harmonic == 1:
        return np.hypot(_along(test["response_real"], dof), _along(test["response_imag"], dof))
    multiples = test["multiple"].to_numpy()
    which = np.flatnonzero(np.abs(multiples - harmonic) < 1e-9)
    if not which.size:
        raise InputError(f"harmonic={harmonic:g} was not measured; there are {multiples.tolist()}")
    real, imaginary = (_along(test[f"component_{part}"], dof)[:, :, int(which[0])] for part in ("real", "imag"))
    return np.hypot(real, imaginary)


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
    return period_name(period) if period else _OTHER[_APERIODIC][0]


def symbol_of(dataset: xarray.Dataset, dof: int, order: int) -> str:
    """A displacement, or its first derivative, as an axis says it."""
    return _with_unit(_symbol_of(dataset, dof, order), dataset, order, dof)


def _symbol_of(dataset: xarray.Dataset, dof: int, order: int) -> str:
    letter, index = parts_of_dof(dataset, dof)
    return rf"$\dot {letter}{index}$" if order else f"${letter}{index}$"


def _with_unit(text: str, dataset: xarray.Dataset, order: int, dof: int) -> str:
    """Behind what an axis says of a displacement or its derivative the unit that the system declares."""
    declared = units_of_dof([dataset], dof)
    return f"{text} ({declared.name(('length', 'length / time')[order])})" if declared else text


def _frequency_axis(dataset: xarray.Dataset) -> str:
    return frequency_label(declared_units([dataset]))


def checked_dof(dataset: xarray.Dataset, dof: GivenDof | None) -> int:
    """The degree of freedom that is drawn, default the observed one; InputError where there is none."""
    given = dataset["dof"].to_numpy().tolist() if "dof" in dataset.coords else []
    names = [name for name in given if isinstance(name, str)]
    return chosen_dof(dof, int(dataset.attrs["observed"]), int(dataset.attrs["dofs"]), names=names)


def _along(variable: xarray.DataArray, dof: int) -> np.ndarray:
    """Values of one degree of freedom; of a large structure no others are recovered."""
    return variable.isel(dof=dof).to_numpy()


# ----------------------------------------------------------------------------------------------------- chaos and basins
_EXPONENT = r"exponent $\lambda$"
#: share of white in the colours of the first, second, ... motion of one period
_TINTS = (0.25, 0.65, 0.05, 0.8)
_GREYS = (0.72, 0.15, 0.45, 0.85)
#: colours of growth, from none to the largest; of cells that nothing is known of
_GROWTH, _UNKNOWN = ("#dbe9f4", "#4292c6", "#08306b"), "#dadada"
_LINES = (style.INK, "#D55E00", "#009E73", "#E69F00")


@picture((6.0, 3.6))
def plot_lyapunov(exponents: xarray.Dataset, *, count: int | None = None) -> Layout:
    """Running averages over the periods, with the result and a band of two standard errors; the first `count`."""
    running = exponents["running"].to_numpy()
    shown = running.shape[1] if count is None else min(int(count), running.shape[1])
    period = np.arange(1, len(running) + 1)
    frame = Frame([Guide(0.0, Pen(style.SOFT, 0.6), layer=1.0)])
    for i in range(shown):
        colour = style.CURVE_COLOURS[i % len(style.CURVE_COLOURS)]
        value, error = (float(exponents[name].to_numpy()[i]) for name in ("exponents", "standard_errors"))
        if np.isfinite(error):
            frame.add(Band(value - 2.0 * error, value + 2.0 * error, tinted(colour, 0.7), layer=2.0))
        frame.add(Guide(value, Pen(colour, 0.5)))
        line = Polyline(np.array([period, running[:, i]]), Pen(colour), role=f"exponent {i}", layer=4.0)
        frame.add(line, rf"$\lambda_{{{i + 1}}}$ = {value:.4g} ± {error:.1g}")
    axes = Axis("load periods averaged over", 1.0, len(running), logarithmic=True), Axis(_EXPONENT)
    return frame, axes


@picture((6.0, 3.8))
def plot_separation(separation: xarray.Dataset, *, most: int = 20) -> Layout:
    """Distances of two trajectories over time for at most `most` settings, and the mean rate as a line."""
    time, distance = separation["time"].to_numpy(), separation["distance"].to_numpy()
    which = np.unique(np.linspace(0, len(distance) - 1, max(1, int(most))).astype(int))
    frame = Frame()
    for i in which:
        thin = Polyline(np.array([time, distance[i]]), Pen(style.SOFT, 0.5), layer=2.0)
        frame.add(thin, f"{len(which)} of {len(distance)} settings")
    exponent, spread = separation.attrs["exponent"], separation.attrs["spread"]
    if np.isfinite(exponent):
        typical = int(np.nanargmin(np.abs(separation["rate"].to_numpy() - exponent)))
        begin = float(np.median(separation["offset"].to_numpy())) * float(separation.attrs["omega"])
        line = begin * np.exp(exponent * time)
        keep = line <= np.max(distance)
        frame.add(Polyline(np.array([time, distance[typical]]), Pen(style.INK)), "the setting nearest to the mean")
        mean = Polyline(np.array([time[keep], line[keep]]), Pen(style.CURVE_COLOURS[0], 1.3), layer=4.0)
        frame.add(mean, rf"$\lambda$ = {exponent:.3f}, one setting ± {spread:.2g}")
    axes = Axis("time", time[0], time[-1]), Axis(r"distance $\delta$", logarithmic=True)
    return frame, axes


@picture((6.4, 4.2), grid=False)
def plot_lyapunov_map(chart: xarray.Dataset, *, lines: Sequence[tuple[str, np.ndarray, np.ndarray]] = ()) -> Layout:
    """Largest exponents in colour where the motion is chaotic, white where it is not, grey where nothing is known.

    `lines`: a name, frequencies and values of the parameter each, drawn over it.
    """
    across, upwards = _edges(chart["omega"].to_numpy()), _edges(chart["value"].to_numpy())
    exponent, chaotic = chart["exponent"].to_numpy(), chart["chaotic"].to_numpy().astype(bool)
    top = float(exponent[chaotic].max()) if chaotic.any() else 1.0
    cells = np.ones((*exponent.shape, 3))
    levels = np.linspace(0.0, top, len(_GROWTH))
    for channel, values in enumerate(np.array([rgb(colour) for colour in _GROWTH]).T):
        cells[chaotic, channel] = np.interp(exponent[chaotic], levels, values)
    cells[~np.isfinite(exponent)] = rgb(_UNKNOWN)
    frame = Frame([Raster(cells, across, upwards, scale=(_GROWTH, 0.0, top, _EXPONENT), layer=0.0)])
    known = list(dict.fromkeys(name for name, _, _ in lines))
    for name, x, y in lines:
        frame.add(Polyline(np.array([x, y]), Pen(_LINES[known.index(name) % len(_LINES)])), name)
    axes = (
        Axis(_frequency_axis(chart), float(across[0]), float(across[-1]), shows="omega"),
        Axis(plain(chart.attrs["varied"]), *upwards[[0, -1]]),
    )
    return frame, axes


@picture((5.6, 4.6), legend="below", grid=False)
def plot_basins(basins: xarray.Dataset, *, points: Sequence[np.ndarray] | None = None) -> Layout:
    """The plane of states, each in the colour of the motion that it tends to.

    `points`: of each attractor its stroboscopic points (n, 2) in this plane, which are marked.
    """
    names = [str(name) for name in basins["attractor"].to_numpy()]
    check_count("points", points, len(names), "attractors")
    labels = basins["label"].to_numpy()
    cells, frame = np.zeros((*labels.shape, 3)), Frame()
    shares = dict(zip([str(k) for k in basins["kind"].to_numpy()], basins["share"].to_numpy(), strict=True))
    amplitude = basins["amplitude"].to_numpy()
    for i, (name, colour) in enumerate(zip(names, _colours(basins["period"].to_numpy()), strict=True)):
        cells[labels == i] = rgb(colour)
        if name in shares:
            words = rf"{name}, $\max\,|x|$ = {amplitude[i]:.4g}: {100.0 * shares[name]:.1f} %"
            frame.entries[words] = Entry(mark=Mark("s", 7.0, colour, style.SOFT, 0.5))
    for number, (name, colour) in _OTHER.items():
        if (labels == number).any():
            cells[labels == number] = rgb(colour)
            words = f"{name}: {100.0 * shares[name]:.1f} %" if name in shares else name
            hatched = Entry(patch=colour, edge=style.SOFT, hatch=STROKES)
            plain_entry = Entry(mark=Mark("s", 7.0, colour, style.SOFT, 0.5))
            frame.entries[words] = hatched if number == _APERIODIC else plain_entry
    x, y = _edges(basins["x"].to_numpy()), _edges(basins["y"].to_numpy())
    frame.add(Raster(cells, x, y, {STROKES: labels == _APERIODIC}, layer=0.0))
    for places in points or ():
        inside = (places >= (x[0], y[0])).all(axis=1) & (places <= (x[-1], y[-1])).all(axis=1)
        frame.add(Markers(places[inside].T, Mark("o", 4.5, "#ffffff"), cut=True, layer=4.0))
    one = int(basins.attrs["dofs"]) == 1
    axes = [
        Axis(_symbol(basins, f"plane_{letter}", one), *edges[[0, -1]])
        for letter, edges in zip("xy", (x, y), strict=True)
    ]
    # there is no free place inside
    return frame, axes


def _colours(periods: np.ndarray) -> list[str]:
    """A colour for the basin of each motion, by period."""
    listed = periods.tolist()
    places = places_among(listed, [str(i) for i in range(len(listed))])
    return [
        tinted(period_colour(p), (_GREYS if p == 1 else _TINTS)[i % 4]) for p, i in zip(listed, places, strict=True)
    ]


def _symbol(basins: xarray.Dataset, plane: str, one: bool) -> str:
    kind, _, dof = str(basins.attrs[plane]).partition("_")
    letter = "x" if kind == "x" else r"\dot x"
    return _with_unit(f"${letter}(0)$" if one else f"${letter}_{{{dof}}}(0)$", basins, int(kind != "x"), int(dof or 0))


def _edges(grid: np.ndarray) -> np.ndarray:
    """Edges of the cells about the values of a grid."""
    if len(grid) == 1:
        half = 0.5 * (abs(float(grid[0])) or 1.0) * 0.01
        return np.array([grid[0] - half, grid[0] + half])
    middle = 0.5 * (grid[1:] + grid[:-1])
    return np.concatenate([[2.0 * grid[0] - middle[0]], middle, [2.0 * grid[-1] - middle[-1]]])


# --------------------------------------------------------------------------------------------------------- verification
#: by outcome: what the legend says, its mark, its layer
_MARKS = {
    "agrees": ("agrees with shooting", Mark(r"$\checkmark$", 5.5, "#009E73", "#009E73", 0.4), 4.5),
    "cannot tell": ("cannot tell", Mark(r"$?$", 6.5, style.SOFT, style.SOFT, 0.4), 4.5),
    "disagrees": ("disagrees", Mark("X", 8.0, "#D55E00", "#D55E00", 0.4), 7.0),
    "not confirmed": ("not confirmed", Mark("o", 13.0, "none", "#D55E00", 1.6), 7.0),
}


@picture((6.4, 4.2), by_kind=True)
def plot_verified(
    curve: xarray.Dataset, places: np.ndarray, outcomes: Sequence[str], unconfirmed: np.ndarray
) -> Layout:
    """The curve of a dataset with a mark at each of `places` (P, 2), by its outcome.

    `unconfirmed` (B, 2): bifurcations that shooting did not confirm; they get a ring.
    """
    if is_boundary(curve):
        drawing = boundary_drawing([curve])
        (frame,), (across, upwards) = drawing.frames, drawing.axes
    else:
        axes = Coordinates((str(curve.attrs["free"]), None), View())
        frame = response_frame([curve], axes)
        labels = axes.labels([curve])
        across, upwards = Axis(labels[0], shows=axes.shown[0]), Axis(labels[1], 0.0)
    every = np.concatenate([np.reshape(places, (-1, 2)), np.reshape(unconfirmed, (-1, 2))])
    kinds = np.array([*outcomes, *["not confirmed"] * len(unconfirmed)])
    for outcome, (name, mark, layer) in _MARKS.items():
        here = every[kinds == outcome]
        if len(here):
            frame.add(Markers(here.T, mark, role=outcome, layer=layer), name)
    return frame, (across, upwards)
