"""`plot`: one call for branches and for datasets read from files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suboctave.errors import InputError
from suboctave.pictures.boundary import plot_boundaries
from suboctave.pictures.boundary_lines import is_boundary
from suboctave.pictures.regions import is_isolas
from suboctave.pictures.response import plot_response
from suboctave.pictures.view import View

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

__all__ = ["datasets_of", "plot"]


def plot(
    curves: Any,
    path: str | Path | None = None,
    *,
    quantity: str | None = None,
    harmonic: float | None = None,
    element: int | None = None,
    dof: int | None = None,
    x: str | None = None,
    y: str | None = None,
    frequency: str | None = None,
    omega_reference: float | None = None,
    scale: float | None = None,
    unit: str | None = None,
    xlabel: str | None = None,
    ylabel: str | None = None,
    xlim: Sequence[float] | None = None,
    ylim: Sequence[float] | None = None,
    marks: Sequence[str] | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 4.2),
) -> Figure:
    """Draw one or several branches: stable parts solid, unstable ones dashed, bifurcations marked.

    Motions of period T, 2T, 4T, ... (T that of the load) have a colour for each; amplitudes are largest values over
    one period of the response. Markers of subcritical bifurcations are hollow, where that is known.

    Parameters
    ----------
    curves
        A branch, a dataset of one (`to_xarray`, or a file opened by xarray), a bifurcation diagram (all its branches),
        isolas (their curves and regions, over frequency and parameter), a sequence of these, or the results of a study.
    path
        Where the figure is saved: .png, .svg or .pdf, fonts embedded.
    quantity
        What is drawn: "amplitude" (default), "rms", "velocity", "velocity_rms", "acceleration", "acceleration_rms",
        "harmonic", "phase", "peak_force", "contact_share", "impacts", "transmitted_force", "transmissibility". A
        dataset must have it: `to_xarray(readings=...)`.
    harmonic, element, dof
        Of which harmonic (alone: its amplitude), of which element, of which degree of freedom. Harmonics are multiples
        of omega: 0 is the mean, 0.5 a component of motions of two load periods, which is zero for those of one.
    x
        The horizontal axis: "omega" or a parameter; default what the curves were followed in.
    y
        Of curves of bifurcations (`track`), which are drawn over the plane of their two parameters: the vertical axis.
        A `quantity` that is asked for takes its place.
    frequency
        "rad/s" or "Hz", where the system's time is in seconds.
    omega_reference
        The axis shows `omega / omega_reference`.
    scale, unit
        Factor on the quantity, and its unit for the label: `scale=1e3, unit="mm"`. In the plane of two parameters, of
        the one that is no frequency.
    xlabel, ylabel, labels, title
        Texts of the axes, names of the curves in the legend, title.
    xlim, ylim
        Part of the axes that is shown, (from, to).
    marks
        Kinds of bifurcations that get markers: ["PD", "LP"]. Default all; of a diagram all but grazing contacts.
    size
        "single-column" (84 mm), "double-column" (174 mm), or width and height in inches.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    projected = quantity is not None or harmonic is not None
    if quantity is None:
        quantity = "amplitude" if harmonic is None else "harmonic"
    given = _several(curves)
    if len(given) == 1:  # a diagram says how it is drawn
        labels = getattr(given[0], "legend", None) if labels is None else labels
        marks = getattr(given[0], "marks", None) if marks is None else marks
    view = View(
        quantity, harmonic, element, dof, frequency, omega_reference, scale, unit, xlabel, ylabel, xlim, ylim, marks
    )
    datasets = datasets_of(curves, view)
    if any(is_isolas(dataset) for dataset in datasets):  # in the plane, without the closed branches
        datasets = [dataset for dataset in datasets if "isola" not in dataset.attrs]
    tracked = [is_boundary(dataset) or is_isolas(dataset) for dataset in datasets]
    if tracked and all(tracked):
        return plot_boundaries(
            datasets, path, x=x, y=y, labels=labels, title=title, size=size, view=view, projected=projected
        )
    if y is not None:
        raise InputError("y= is for curves of bifurcations; of other curves quantity= says what is drawn upwards")
    if any(tracked) and x is None:
        raise InputError(
            "there are curves of bifurcations among response curves: plot_space draws them together, x= one over the "
            "other; or draw each kind by itself"
        )
    datasets = [dataset for dataset in datasets if not is_isolas(dataset)]
    return plot_response(datasets, path, x=x, labels=labels, title=title, size=size, view=view)


def datasets_of(curves: Any, view: View) -> list[xarray.Dataset]:
    """The datasets of what `plot` takes, with the quantity that is drawn."""
    datasets = [dataset for item in _several(curves) for dataset in _datasets(item, view)]
    drawn = iter(view.completed([dataset for dataset in datasets if not is_isolas(dataset)]))
    return [dataset if is_isolas(dataset) else next(drawn) for dataset in datasets]


def _several(curves: Any) -> list[Any]:
    """The branches and diagrams of what is given."""
    named = getattr(curves, "branches", None)
    if isinstance(named, Mapping):  # results of a study
        others = (getattr(curves, kind, {}).values() for kind in ("diagrams", "isolas"))
        return [*named.values(), *(item for group in others for item in group)]
    return list(curves) if isinstance(curves, list | tuple) else [curves]


def _datasets(item: Any, view: View) -> list[xarray.Dataset]:
    """The dataset of a branch, those of all branches of a diagram."""
    import xarray

    if isinstance(item, xarray.Dataset):
        return [item]
    if not hasattr(item, "to_xarray"):
        raise InputError(f"plot draws branches, diagrams, isolas and their datasets, not {type(item).__name__}")
    found = item.to_xarray(readings=view.readings(getattr(item, "nu", 0)))
    return list(found.values()) if isinstance(found, dict) else [found]
