"""`plot`: one call for branches and for datasets read from files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from suboctave.errors import InputError
from suboctave.options import with_options
from suboctave.pictures.boundary import is_boundary, plot_boundaries
from suboctave.pictures.isolas import is_isolas
from suboctave.pictures.options import CurveOptions, View
from suboctave.pictures.response import plot_response

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


@with_options(CurveOptions)
def plot(
    curves: Any,
    path: str | Path | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: str | tuple[float, float] = (6.4, 4.2),
    **options: Unpack[CurveOptions],
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
    x
        The horizontal axis: "omega" or a parameter; default what the curves were followed in.
    y
        Of curves of bifurcations (`track`), which are drawn over the plane of their two parameters: the vertical axis.
        A `quantity` that is given takes its place.
    labels, title
        Names of the curves in the legend, title.
    size
        "single-column" (84 mm), "double-column" (174 mm), or width and height in inches.

    Raises
    ------
    InputError
        For what cannot be drawn, before anything is.
    """
    given = _several(curves)
    if len(given) == 1:  # a diagram says how it is drawn
        labels = getattr(given[0], "legend", None) if labels is None else labels
        if options.get("marks") is None:
            options["marks"] = getattr(given[0], "marks", None)
    view = View(**dict[str, Any](options))
    datasets = datasets_of(curves, view)
    if any(is_isolas(dataset) for dataset in datasets):  # in the plane, without the closed branches
        datasets = [dataset for dataset in datasets if "isola" not in dataset.attrs]
    tracked = [is_boundary(dataset) or is_isolas(dataset) for dataset in datasets]
    texts: dict[str, Any] = {"labels": labels, "title": title, "size": size, "view": view}
    if tracked and all(tracked):
        projected = options.get("quantity") is not None or options.get("harmonic") is not None
        return plot_boundaries(datasets, path, x=x, y=y, projected=projected, **texts)
    if y is not None:
        raise InputError("y= is for curves of bifurcations; of other curves quantity= says what is drawn upwards")
    if any(tracked) and x is None:
        raise InputError(
            "there are curves of bifurcations among response curves: plot_space draws them together, x= one over the "
            "other; or draw each kind by itself"
        )
    return plot_response([data for data in datasets if not is_isolas(data)], path, x=x, **texts)


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
    given = item.to_xarray(readings=view.readings(getattr(item, "nu", 0)))
    return list(given.values()) if isinstance(given, dict) else [given]
