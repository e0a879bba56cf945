"""How one periodic motion of one degree of freedom is laid out as a labelled dataset: what its pictures work from.

Dimensions

    sample       instants over one response period, from 0 to nu 2 pi / omega, both ends included
    section      the stroboscopic instants 0, 2 pi / omega, ..., nu of them
    component    the multiples k / nu of omega that the motion was solved with, k = 0 .. H
    neglected    those beyond, k = H + 1 .. 2 H + 1
    element      the elements whose forces were asked for
    gap          the gaps of the elements that act on this degree of freedom alone
    parameter    the system's parameters, by name

Variables: `displacement`, `velocity`, `acceleration` on `sample` and, with the prefix `section_`, on `section`;
`amplitude_of_component` on `component`, the complex c_k of `x(t) = Re sum_k c_k exp(i k omega t / nu)`, and
`amplitude_of_neglected`, the first-order answer to the force of the solved motion; `force` (element x sample), of the
law; `gap_level` the place of a gap as a value of x, `gap_element` whose it is; `parameters`. Attributes: `omega`,
`period` (nu), `dof`, `dofs`, `amplitude` (max |x|), `kind` (that of a bifurcation, else empty), `system`, `units`
(those that it declares, else empty).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import InputError, chosen_dof
from suboctave.harmonic.orbit import PeriodicOrbit, force_along
from suboctave.model.elements.coupled import reads
from suboctave.model.elements.smoothness import levels
from suboctave.model.inputs import check_element
from suboctave.store.layout import LAYOUT, check_layout
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray


_CONTENTS = "motion"
#: samples in one load period: enough for a smooth line, more where the motion has high harmonics
_SMOOTH, _PER_HARMONIC = 400, 8


def motion_datasets(
    motions: Any, points: Sequence[int] | None = None, dof: int | None = None, elements: Iterable[int] = ()
) -> list[xarray.Dataset]:
    """Motions given in any form as datasets.

    Parameters
    ----------
    motions
        An orbit, a point of a branch, a bifurcation, a dataset of a motion, a branch (with `points`), or a sequence of
        these.
    points
        Indices of the points of a branch.
    dof
        Degree of freedom; default that which the branch observes, of a motion alone that of its first load.
    elements
        Indices of the elements whose forces are wanted.

    Raises
    ------
    InputError
        For what is no motion, a branch without `points`, or an index that is out of range.
    """
    single = _is_branch(motions) or hasattr(motions, "data_vars") or not isinstance(motions, Iterable)
    given = [motions] if single or isinstance(motions, str) else list(motions)
    branches = [item for item in given if _is_branch(item)]
    if points is not None and not branches:
        raise InputError("points= chooses among the points of a branch, and no branch is given: leave it out")
    if not given:
        raise InputError("no motion to draw")
    forces = tuple(elements)
    return [dataset for item in given for dataset in _laid_out(item, points, dof, forces)]


def _is_branch(item: Any) -> bool:
    return hasattr(item, "orbits") and hasattr(item, "observe")


def _laid_out(
    item: Any, points: Sequence[int] | None, dof: int | None, elements: tuple[int, ...]
) -> Iterator[xarray.Dataset]:
    import xarray

    if isinstance(item, xarray.Dataset):
        yield _checked(item, dof, elements)
    elif _is_branch(item):
        if points is None:
            raise InputError(
                f"a branch has {len(item.orbits)} motions: choose with points=[0, ...], or give branch.orbits[i], "
                "or one of its bifurcations"
            )
        for point in [points] if isinstance(points, int | np.integer) else points:
            if isinstance(point, bool) or not isinstance(point, int | np.integer):
                raise InputError(f"points are indices, whole numbers, not {point!r}")
            if not -len(item.orbits) <= point < len(item.orbits):
                raise InputError(f"there is no point {point}: the branch has {len(item.orbits)}, numbered from 0")
            yield motion_dataset(item.orbits[point], item.observe if dof is None else dof, elements=elements)
    else:
        orbit = item if isinstance(item, PeriodicOrbit) else getattr(item, "orbit", None)
        if not isinstance(orbit, PeriodicOrbit):
            raise InputError(f"this draws orbits, points of branches and bifurcations, not {type(item).__name__}")
        yield motion_dataset(orbit, dof, kind=str(getattr(item, "kind", "")), elements=elements)


def _checked(dataset: xarray.Dataset, dof: int | None, elements: tuple[int, ...]) -> xarray.Dataset:
    if dataset.attrs.get("contents") != _CONTENTS:
        raise InputError("this dataset is no motion: give the branch with points=, or one of its orbits")
    check_layout(dataset.attrs)
    there = int(dataset.attrs["dof"])
    if dof is not None and dof != there:
        raise InputError(f"this dataset holds the motion of DOF {there}, not of DOF {dof}")
    missing = set(elements) - {int(index) for index in dataset["element"].to_numpy()}
    if missing:
        raise InputError(f"this dataset has no force of element {min(missing)}: lay it out with elements=")
    return dataset


def motion_dataset(
    orbit: PeriodicOrbit, dof: int | None = None, *, kind: str = "", elements: Iterable[int] = ()
) -> xarray.Dataset:
    """A motion as a labelled dataset; the layout is described at the top of this module.

    `dof`: default the one of the first load. `kind`: of the bifurcation that it is the motion of. `elements`: indices
    of those whose forces are wanted.

    Raises InputError where one of them is out of range.
    """
    import xarray

    system = orbit.balance.system
    chosen = chosen_dof(dof, system.observed_dof, system.n)
    nu, high = orbit.basis.nu, orbit.basis.harmonics
    multiples = orbit.basis.multiples
    c = np.array([orbit.harmonic(k / nu, chosen) for k in range(high + 1)])
    count = nu * max(_SMOOTH, _PER_HARMONIC * math.ceil(high / nu))
    tau = 2.0 * math.pi * np.arange(count + 1) / count
    sections = np.arange(nu) * (count // nu)
    waves, rates = np.exp(1j * np.multiply.outer(tau, np.arange(high + 1))), 1j * multiples * orbit.omega
    series = {
        name: np.real(waves @ (c * rates**order))
        for order, name in enumerate(("displacement", "velocity", "acceleration"))
    }
    time = tau * nu / orbit.omega
    variables: dict[str, Any] = {name: ("sample", values) for name, values in series.items()}
    variables |= {f"section_{name}": ("section", values[sections]) for name, values in series.items()}
    variables["amplitude_of_component"] = ("component", c)
    state = orbit.state()
    unit = np.zeros(system.n)
    unit[chosen] = 1.0
    beyond = (high + 1.0 + np.arange(high + 1)) / nu * orbit.omega
    lacking = state.linear.recovered(beyond, state.neglected)
    variables["amplitude_of_neglected"] = ("neglected", lacking @ state.linear.seen(unit))
    wanted = [check_element(system, index) for index in elements]
    force = [force_along(state, index)(tau) for index in wanted]
    variables["force"] = (("element", "sample"), np.reshape(force, (len(wanted), count + 1)))
    gaps = []
    for index, (element, law) in enumerate(zip(system.elements, orbit.balance.laws(orbit.values).members, strict=True)):
        places = levels(law.kind, law.coefficients)
        direction = np.asarray(reads(element, system.n), dtype=float) if places else np.zeros(system.n)
        if direction[chosen] and np.count_nonzero(direction) == 1:
            gaps += [(level / direction[chosen], index) for level in places]
    variables["gap_level"] = ("gap", np.array([level for level, _ in gaps], dtype=float))
    variables["gap_element"] = ("gap", np.array([index for _, index in gaps], dtype=int))
    variables["parameters"] = ("parameter", np.array([orbit.values[name] for name in system.parameters], dtype=float))
    coords = {
        "time": ("sample", time, {"long_name": "time, from the load's phase zero"}),
        "section_time": ("section", time[sections]),
        "multiple": ("component", multiples, {"long_name": "frequency in units of omega"}),
        "multiple_neglected": (
            "neglected",
            (len(multiples) + np.arange(len(multiples))) / orbit.basis.nu,
        ),
        "element": ("element", np.array(wanted, dtype=int)),
        "element_label": ("element", np.array([system.elements[index].label for index in wanted], dtype=object)),
        "parameter": ("parameter", np.array(list(system.parameters), dtype=object)),
    }
    attributes = {
        "contents": _CONTENTS,
        "layout": LAYOUT,
        "suboctave": __version__,
        "system": system.name,
        "units": str(system.units or ""),
        "kind": kind,
        "omega": float(orbit.omega),
        "period": nu,
        "dof": chosen,
        "dofs": system.n,
        "amplitude": orbit.amplitude(chosen),
        "residual": float(orbit.residual),
        "error": float(orbit.truncation),
    }
    return xarray.Dataset(variables, coords, attributes)
