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

All motions of a curve are laid out beside its points and events (`with_motions`), their coefficients with zeros behind
those of fewer harmonics.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.bifurcation.gaps import contact_side
from suboctave.errors import GivenDof, InputError, chosen_dof, dof_text
from suboctave.harmonic.basis import Array, to_real
from suboctave.harmonic.energy import fed
from suboctave.harmonic.orbit import PeriodicOrbit, force_along
from suboctave.model.elements.coupled import reads
from suboctave.model.elements.smoothness import levels
from suboctave.model.inputs import check_element
from suboctave.store.layout import LAYOUT, check_layout, events_met
from suboctave.store.plain import padded
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray


_CONTENTS = "motion"
#: samples in one load period: enough for a smooth line, more where the motion has high harmonics
_SMOOTH, _PER_HARMONIC = 400, 8


def motion_datasets(
    motions: Any, points: Sequence[int] | None = None, dof: GivenDof | None = None, elements: Iterable[int] = ()
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
        Degree of freedom, its number or its name; default that which the branch observes, of a motion alone that of
        its first load.
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
    item: Any, points: Sequence[int] | None, dof: GivenDof | None, elements: tuple[int, ...]
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


def _checked(dataset: xarray.Dataset, dof: GivenDof | None, elements: tuple[int, ...]) -> xarray.Dataset:
    if dataset.attrs.get("contents") != _CONTENTS:
        raise InputError("this dataset is no motion: give the branch with points=, or one of its orbits")
    check_layout(dataset.attrs)
    there = int(dataset.attrs["dof"])
    given = dof_text(dof) if isinstance(dof, str | tuple) else dof
    if given not in (None, there, dataset.attrs.get("dof_name")):
        raise InputError(f"this dataset holds the motion of DOF {there}, not of DOF {dof}")
    missing = set(elements) - {int(index) for index in dataset["element"].to_numpy()}
    if missing:
        raise InputError(f"this dataset has no force of element {min(missing)}: lay it out with elements=")
    return dataset


def motion_dataset(
    orbit: PeriodicOrbit, dof: GivenDof | None = None, *, kind: str = "", elements: Iterable[int] = ()
) -> xarray.Dataset:
    """A motion as a labelled dataset; the layout is described at the top of this module.

    `dof`: default the one of the first load. `kind`: of the bifurcation that it is the motion of. `elements`: indices
    of those whose forces are wanted.

    Raises InputError where one of them is out of range.
    """
    import xarray

    system = orbit.balance.system
    chosen = chosen_dof(dof, system.observed_dof, system.n, names=system.dof_names)
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
    beyond = (high + 1.0 + np.arange(high + 1)) / nu * orbit.omega
    lacking = state.linear.recovered(beyond, state.neglected)
    variables["amplitude_of_neglected"] = ("neglected", lacking @ state.linear.seen(_unit(system.n, chosen)))
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
        "dof_names": "\n".join(system.dof_names),
        "amplitude": orbit.amplitude(chosen),
        "residual": float(orbit.residual),
        "error": float(orbit.truncation),
        **({"dof_name": system.dof_names[chosen]} if system.dof_names else {}),
    }
    return xarray.Dataset(variables, coords, attributes)


# ----------------------------------------------------------------------------------------------- all motions of a curve
#: gaps whose contacts are laid out, and elements whose forces are; those of further ones are left out
_GAPS, _ELEMENTS = 12, 8
#: degrees of freedom up to which all are laid out; of larger systems as many of those observed, loaded and read
_DOFS = 24
#: instants in a load period, and in all of a motion, at which the forces of elements are laid out
_INSTANTS, _MOST_INSTANTS = 192, 768


@dataclass(frozen=True)
class Signal:
    """A displacement that is laid out of all motions, `direction . x`; `dof`: the number of the DOF that it is, else
    -1.
    """

    label: str
    direction: Array
    dof: int


def signals_of(system: Any, observe: int) -> list[Signal]:
    """The displacements that are laid out: the observed DOF, the others, and what elements between DOFs read.

    Of a system of many DOFs those that loads act on and elements read, the first ones.
    """
    n, names = system.n, system.dof_names
    read = [np.asarray(row, dtype=float) for element in system.elements for row in element.inputs(n)]
    dofs: Iterable[int] = range(n)
    if n > _DOFS:
        loaded = [component.direction for component in system.load_components()]
        touched = [int(dof) for row in (*loaded, *read) for dof in np.flatnonzero(row)[:_DOFS]]
        dofs = list(dict.fromkeys([observe, *touched]))[:_DOFS]
    order = [observe, *(dof for dof in dofs if dof != observe)]
    signals = [Signal(_dof_label(dof, n, names), _unit(n, dof), dof) for dof in order]
    for row in read:
        ends = np.flatnonzero(row)
        one = len(ends) == 1 and row[ends[0]] == 1.0 and ends[0] in order
        if not one and len(signals) < 2 * _DOFS and not any(np.array_equal(row, own.direction) for own in signals):
            signals.append(Signal(_direction_label(row, n, names), row, -1))
    return signals


def _dof_label(dof: int, n: int, names: Sequence[str]) -> str:
    return names[dof] if names else "x" if n == 1 else f"x_{dof}"


def _direction_label(direction: Array, n: int, names: Sequence[str]) -> str:
    """A combination of displacements in words: "tip - root"."""
    terms: list[str] = []
    for dof in sorted(np.flatnonzero(direction).tolist(), key=lambda dof: -direction[dof])[:3]:
        size = abs(direction[dof])
        sign = ("- " if terms else "-") if direction[dof] < 0.0 else "+ " * bool(terms)
        terms.append(f"{sign}{'' if size == 1.0 else f'{size:.3g} '}{_dof_label(dof, n, names)}")
    more = ["+ ..."] if np.count_nonzero(direction) > len(terms) else []
    return " ".join([*terms, *more])


def elements_of(system: Any) -> range:
    """The elements whose forces are laid out: the first ones."""
    return range(min(_ELEMENTS, len(system.elements)))


def with_motions(dataset: xarray.Dataset, branch: Any) -> xarray.Dataset:
    """The dataset of a branch with the motions at its points and, with the prefix `event_`, at its events.

    Variables: `motion` (point x signal x motion_coefficient), a_0, a_1, b_1, ... of `signal` 0, the observed degree of
    freedom, of the others, and of the displacements that elements between them read; `signal_label`, `signal_dof`
    (signal,), the number of the degree of freedom or -1; `gap_level` (point x gap), where contact begins, `gap_signal`,
    `gap_side` (+1: in contact above it) and `gap_label` (gap,); `force` (point x element x instant), of elements over
    one period of the motion, `element_index`, `element_label`, their largest values being readings; `event_harmonics`,
    `event_error`, `event_multipliers` of events. Attribute `dofs_left_out`: how many degrees of freedom are not among
    the signals.
    """
    if not len(branch):
        return dataset
    events = [event for event in events_met(branch) if event.orbit is not None]
    orbits, met = list(branch.orbits), [event.orbit for event in events]
    first, n = orbits[0], branch.system.n
    signals = signals_of(branch.system, branch.observe)
    gaps: list[tuple[int, int, int, int, str]] = []
    for index, element in enumerate(first.balance.system.elements):
        places = _levels(first, index)
        if not places or len(gaps) + len(places) > _GAPS:
            continue
        direction = np.asarray(reads(element, n), dtype=float)
        same = [i for i, signal in enumerate(signals) if np.array_equal(signal.direction, direction)]
        if not same:
            signals.append(Signal(_direction_label(direction, n, branch.system.dof_names), direction, -1))
        which, local = same[0] if same else len(signals) - 1, first.state().local(index)
        gaps += [(index, place, which, contact_side(local, place), element.label) for place in range(len(places))]
    elements = list(elements_of(branch.system))
    labels = [branch.system.elements[index].label for index in elements]
    added: dict[str, Any] = {
        "signal_label": ("signal", np.array([signal.label for signal in signals], dtype=object)),
        "signal_dof": ("signal", np.array([signal.dof for signal in signals], dtype=int)),
        "element_index": ("element", np.array(elements, dtype=int)),
        "element_label": ("element", np.array(labels, dtype=object)),
        "gap_signal": ("gap", np.array([gap[2] for gap in gaps], dtype=int)),
        "gap_side": ("gap", np.array([gap[3] for gap in gaps], dtype=int)),
        "gap_label": ("gap", np.array([gap[4] for gap in gaps], dtype=object)),
        "event_harmonics": ("event", np.array([orbit.basis.harmonics for orbit in met], dtype=int)),
        "event_error": ("event", np.array([orbit.truncation for orbit in met], dtype=float)),
        "event_multipliers": (
            ("event", "event_floquet"),
            padded([event.multipliers for event in events], complex),
        ),
    }
    count = min(_MOST_INSTANTS, first.basis.nu * _INSTANTS)
    tau = 2.0 * math.pi * np.arange(count) / count
    directions, seen = np.array([signal.direction for signal in signals]), dict[int, Array]()
    for prefix, axis, own in (("", "point", orbits), ("event_", "event", met)):
        size = max((orbit.basis.size for orbit in own), default=1)
        table = np.zeros((len(own), len(signals), size))
        levels_there = np.full((len(own), len(gaps)), np.nan)
        force = np.zeros((len(own), len(elements), count))
        for row, orbit in enumerate(own):
            part, state = orbit.balance.linear, fed(orbit.state(), orbit.zeta)
            if id(part) not in seen:  # one for all motions of most curves
                seen[id(part)] = part.seen(directions)
            table[row, :, : orbit.basis.size] = to_real(state.recovered @ seen[id(part)].T).T
            known = {index: _levels(orbit, index) for index in {gap[0] for gap in gaps}}
            levels_there[row] = [known[gap[0]][gap[1]] for gap in gaps]
            for i, index in enumerate(elements):
                force[row, i] = force_along(state, index)(tau)
        added[f"{prefix}motion"] = ((axis, "signal", f"{prefix}motion_coefficient"), table)
        added[f"{prefix}gap_level"] = ((axis, "gap"), levels_there)
        added[f"{prefix}force"] = ((axis, "element", "instant"), force)
    left = n - sum(signal.dof >= 0 for signal in signals)
    return dataset.assign(added).assign_attrs(dofs_left_out=left)


def _unit(n: int, dof: int) -> Array:
    direction = np.zeros(n)
    direction[dof] = 1.0
    return direction


def _levels(orbit: PeriodicOrbit, element: int) -> tuple[float, ...]:
    """Displacements at which an element's law has a corner, or is sharp, at a motion's parameters."""
    law = orbit.balance.laws(orbit.values).members[element]
    return levels(law.kind, law.coefficients)
