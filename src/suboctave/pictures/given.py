"""What is given to be drawn: live results or datasets, alone, in a sequence or by name, at one DOF or several."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from suboctave.errors import InputError
from suboctave.pictures.drawing import plain
from suboctave.pictures.options import Coordinates, View

if TYPE_CHECKING:
    import xarray


def is_boundary(dataset: xarray.Dataset) -> bool:
    """Whether a dataset is that of a curve of bifurcations in two parameters."""
    return bool(dataset.attrs.get("tracked"))


def is_isolas(dataset: xarray.Dataset) -> bool:
    """Whether a dataset is that of isolas."""
    return bool(dataset.attrs.get("isolas"))


def several_of(curves: Any) -> list[Any]:
    """The branches and diagrams of what is given, named ones as well."""
    if isinstance(curves, dict):
        return [item for given in curves.values() for item in several_of(given)]
    named = getattr(curves, "branches", None)
    if isinstance(named, Mapping):  # results of a study
        others = (getattr(curves, kind, {}).values() for kind in ("diagrams", "isolas"))
        return [*named.values(), *(item for group in others for item in group)]
    return list(curves) if isinstance(curves, list | tuple) else [curves]


def datasets_of(curves: Any, view: View) -> list[xarray.Dataset]:
    """The datasets of what `plot` takes, with the quantity that is drawn; each as often as there are DOFs."""
    if isinstance(view.dof, list):
        every = zip(*([(one, dataset) for dataset in datasets_of(curves, one)] for one in view.each), strict=True)
        return [
            dataset if is_isolas(dataset) else _seen_at(dataset, one, view)
            for group in every
            for one, dataset in (group[:1] if is_isolas(group[0][1]) else group)
        ]
    named = curves if isinstance(curves, dict) else {"": curves}
    datasets = [
        dataset.assign_attrs(called=plain(str(name))) if name else dataset
        for name, given in named.items()
        for item in several_of(given)
        for dataset in _datasets(item, view)
    ]
    drawn = iter(view.completed([dataset for dataset in datasets if not is_isolas(dataset)]))
    return [dataset if is_isolas(dataset) else next(drawn) for dataset in datasets]


def drawn_datasets(curves: Any, view: View | None) -> list[xarray.Dataset]:
    """Datasets as they are given, those of results made."""
    return [
        dataset
        for item in several_of(curves)
        for dataset in ([item] if hasattr(item, "data_vars") else datasets_of(item, view or View()))
    ]


def _seen_at(dataset: xarray.Dataset, one: View, view: View) -> xarray.Dataset:
    """The dataset with what is drawn of one degree of freedom where the view of several looks for it."""
    Coordinates((None,), one).check(dataset)
    drawn = {f"{prefix}{view.variable}": dataset[f"{prefix}{one.variable}"] for prefix in ("", "event_")}
    return dataset.assign(drawn).assign_attrs(observed_dof=one.number)


def _datasets(item: Any, view: View) -> list[xarray.Dataset]:
    """The dataset of a branch, those of all branches of a diagram."""
    import xarray

    if isinstance(item, xarray.Dataset):
        return [item]
    laid_out = getattr(item, "to_xarray", None)
    if laid_out is None or "readings" not in inspect.signature(laid_out).parameters:
        kind, own = type(item).__name__, ", which is drawn by its own plot()" if hasattr(item, "plot") else ""
        raise InputError(f"plot draws branches, diagrams, isolas and their datasets, not {kind}{own}")
    given = laid_out(readings=view.readings(getattr(item, "nu", 0)))
    return list(given.values()) if isinstance(given, dict) else [given]


def named_within(
    group: Sequence[xarray.Dataset], names_of: Callable[[Sequence[xarray.Dataset]], list[str]]
) -> list[str]:
    """The names that the user gave to curves, those of one name told apart as `names_of` curves without one does."""
    names: dict[int, str] = {}
    given = [str(dataset.attrs.get("called", "")) for dataset in group]
    for name in dict.fromkeys(given):
        places = [i for i, own in enumerate(given) if own == name]
        plain_ones = [_without_name(group[i]) for i in places]
        own = names_of(plain_ones) if len(places) > 1 or not name else [""]
        names |= {i: ", ".join(filter(None, (name, word))) for i, word in zip(places, own, strict=True)}
    return [names[i] for i in range(len(group))]


def _without_name(dataset: xarray.Dataset) -> xarray.Dataset:
    other = dataset.copy(deep=False)
    other.attrs = {key: value for key, value in dataset.attrs.items() if key != "called"}
    return other
