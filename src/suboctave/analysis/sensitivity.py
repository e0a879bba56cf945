"""How a located bifurcation moves with every parameter.

With `F(U, p) = 0` the equations of the bifurcation (equations of motion, its scalar conditions, that of an extremum),
U the motion, what the conditions bring and the free parameters, and p all parameters that are held,

    dU / dp = -F_U^-1 F_p:

one factorisation of the Jacobian that Newton's method has, and one column for each parameter. Nothing is solved again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg

from suboctave.analysis.options import Inherited
from suboctave.arguments import checked
from suboctave.bifurcation.bifurcation import Bifurcation, TrackedEvent
from suboctave.continuation.linear import length, one_thread
from suboctave.curves.kinds.multiple import MultipleEquations
from suboctave.curves.motion import MotionProblem
from suboctave.curves.tracked.start import curve_through, is_extremum, on_free_phase, with_extremum
from suboctave.errors import InputError, UnknownName, shortened, suggest
from suboctave.harmonic.basis import Array
from suboctave.kinds import TRACKED_KINDS

if TYPE_CHECKING:
    import pandas

#: step of the difference that the amplitude is differentiated by, in units of the motion and of the parameters
_STEP = 1e-5
#: unfolding of a branch point by a parameter, in units of the motion's forces, that is rounding
_UNFOLDED = 1e-9
#: share of the way of bifurcations that fall together by which a parameter parts them, up to which it is rounding
_PARTED = 1e-6


@checked(result=True)
@dataclass(frozen=True, repr=False)
class Sensitivity(Mapping[str, Mapping[str, float]]):
    """Derivatives of a bifurcation's free parameters and amplitude by the parameters that are held.

    `sensitivity["zeta"]["omega"]` is d omega / d zeta. nan where a branch point is none any more when the parameter
    changes, as it breaks the symmetry that makes it.

    kind
        What moves: "LP", "PD", "isola_centre", ...
    position
        The free parameters of the bifurcation, and its "amplitude", with their values.
    held
        The parameters that are held, with their values.
    derivatives
        Of each of these the derivatives of the position.
    """

    kind: str
    position: Mapping[str, float]
    held: Mapping[str, float]
    derivatives: Mapping[str, Mapping[str, float]]

    def __getitem__(self, name: str) -> Mapping[str, float]:
        if not isinstance(name, str) or name not in self.derivatives:
            raise UnknownName(f"no derivative by {shortened(name)}{suggest(str(name), self.derivatives)}")
        return self.derivatives[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.derivatives)

    def __len__(self) -> int:
        return len(self.derivatives)

    def per_cent(self, name: str, of: str) -> float:
        """Change of `of`, in per cent of its value, when a parameter grows by one per cent of its own."""
        if of not in self.position:
            raise InputError(f"of must be a part of the position, not {of!r}{suggest(of, self.position)}")
        value = self.position[of]
        return self[name][of] * self.held[name] / value if value else float("nan")

    def ranked(self, of: str) -> list[str]:
        """The parameters by how much a per cent of each moves `of`, the strongest first."""
        return sorted(self, key=lambda name: -abs(np.nan_to_num(self.per_cent(name, of), nan=0.0)))

    def to_dataframe(self) -> pandas.DataFrame:
        """One row for each parameter: its value, derivatives, and changes in per cent for one per cent of it."""
        import pandas as pd

        rows = [
            {"parameter": name, "value": self.held[name]}
            | {f"d {of}": self[name][of] for of in self.position}
            | {f"{of} % per %": self.per_cent(name, of) for of in self.position}
            for name in self
        ]
        return pd.DataFrame(rows).set_index("parameter")

    def __repr__(self) -> str:
        where = ", ".join(f"{name} = {value:.7g}" for name, value in self.position.items())
        lines = [f"Sensitivity of the {self.kind} at {where}"]
        heads = "".join(f"{'d ' + of:>16}{'% per %':>11}" for of in self.position)
        lines.append(f"{'parameter':<14} {'value':>11}{heads}")
        for name in self.ranked(next(iter(self.position))):
            shown = "".join(f"{self[name][of]:>16.6g}{self.per_cent(name, of):>11.4g}" for of in self.position)
            lines.append(f"{name:<14} {self.held[name]:>11.6g}{shown}")
        return "\n".join(lines)


@checked
def sensitivity(bifurcation: Bifurcation, *, by: str | Sequence[str] | None = None) -> Sensitivity:
    """Derivatives of where a bifurcation lies, and of its amplitude, by the parameters that were held.

    Parameters
    ----------
    bifurcation
        A located LP, BP, PD, NS or grazing of any branch; or an extremum of a tracked curve in two parameters, such as
        the birth of an isola or where it merges.
    by
        The parameters; by default all of the system, and omega where it is held.

    Raises
    ------
    InputError
        Wrong input, before any work.
    """
    free, held = _names(bifurcation, by)
    with one_thread():
        curve, u, moved = _moving(bifurcation, held)
        first = len(moved) - len(free)
        amplitude = _Amplitude(bifurcation, curve, u)
        derivatives = {}
        for column, name in zip(moved.T, held, strict=True):
            along = np.concatenate((column, [float(name == other) for other in held]))
            rates = dict(zip(free, column[first:].tolist(), strict=True)) | {"amplitude": amplitude.along(along)}
            if _broken(bifurcation, curve, u, along, name):
                rates = dict.fromkeys(rates, float("nan"))
            derivatives[name] = rates
    # the one that an extremum is of comes first
    places = sorted(free, key=lambda name: name != bifurcation.parameter_name)
    position = {name: bifurcation.parameter(name) for name in places} | {"amplitude": amplitude.at(u)}
    kind = (bifurcation.isola if isinstance(bifurcation, TrackedEvent) else "") or bifurcation.kind
    return Sensitivity(kind, position, {name: bifurcation.parameter(name) for name in held}, derivatives)


def _moving(item: Bifurcation, held: Sequence[str]) -> tuple[MotionProblem, Array, Array]:
    """The curve through a bifurcation in its own and further parameters, its unknowns there, and the derivatives of
    those but the further ones by these, (m, number).
    """
    curve, u = curve_through(item, item.orbit.basis, (*item.free_names, *held))
    if is_extremum(item):
        curve = with_extremum(curve, u, item.parameter_name)
    jacobian, own = curve.evaluate(u).jacobian, len(u) - len(held)
    return curve, u, scipy.linalg.solve(jacobian[:, :own], -jacobian[:, own:])


def _broken(item: Bifurcation, curve: MotionProblem, u: Array, along: Array, name: str) -> bool:
    """Whether a parameter breaks the symmetry that forces a branch point, or bifurcations to fall together."""
    n, span = curve.balance.dimension, curve.spans[curve.names.index(name)]
    if item.kind == "BP" and np.abs(along[n : -len(curve.names)]).max() * span > _UNFOLDED:
        return True
    if item.multiplicity == 1:
        return False
    equations = curve.evaluate(u).equations
    assert isinstance(equations, MultipleEquations)
    return equations.parting(along) * span > _PARTED * curve.spans[0]


def foretold(item: TrackedEvent, changes: Mapping[str, float]) -> TrackedEvent:
    """To first order, an extremum where parameters that it is held at have changed."""
    with one_thread():
        curve, u, moved = _moving(item, tuple(changes))
    change = np.array(list(changes.values()))
    x, omega, values = curve.split(u + np.concatenate((moved @ change, change)))
    return replace(item, orbit=replace(item.orbit, balance=curve.balance, x=x, omega=omega, values=values))


class _Amplitude:
    """Largest displacement of the observed degree of freedom near a motion."""

    def __init__(self, item: Bifurcation, curve: MotionProblem, u: Array) -> None:
        self.orbit, self.curve, self.u = item.orbit, curve, u
        known = Inherited(item).observe
        self.observe = item.orbit.system.observed_dof if known is None else known
        n, extras = curve.balance.dimension, curve.augmentation.extras
        #: one over the sizes of everything that changes
        self.weights = np.repeat((1.0 / (length(u[:n]) or 1.0), 0.0, 1.0), (n, extras, len(curve.names)))
        self.weights[n + extras :] /= curve.spans

    def at(self, u: Array) -> float:
        x, omega, values = self.curve.split(u)
        moved = replace(self.orbit, balance=self.curve.balance, x=x, omega=omega, values=values)
        return moved.amplitude(self.observe)

    def along(self, direction: Array) -> float:
        """Its derivative."""
        step = _STEP / length(self.weights * direction)
        return (self.at(self.u + step * direction) - self.at(self.u - step * direction)) / (2.0 * step)


def _names(item: Any, parameters: Any) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The free parameters of a bifurcation, and those that are held and asked for, checked."""
    if not isinstance(item, Bifurcation):
        given = shortened(item)
        raise InputError(f"sensitivity is of a located bifurcation, one of the .bifurcations of a branch, not {given}")
    if is_extremum(item) and len(item.names) != 2:
        raise InputError(f"this extremum lies on a curve in {', '.join(item.names)}: give one in two parameters")
    if isinstance(item, TrackedEvent) and not is_extremum(item) and not on_free_phase(item):
        raise InputError(f"sensitivity is of bifurcations and of extrema along curves of them; this is a {item.kind}")
    if item.kind not in TRACKED_KINDS and not is_extremum(item):
        raise InputError(f"sensitivity is of {', '.join(TRACKED_KINDS)} and extrema; this is a {item.kind}")
    free = item.free_names
    # an equilibrium has no omega
    names = [*([] if "still" in (item.context or {}) else ["omega"]), *item.orbit.system.parameters]
    known = [name for name in names if name not in free]
    if parameters is None:
        return free, tuple(known)
    if isinstance(parameters, str):
        parameters = [parameters]
    for name in parameters:
        if name in free:
            raise InputError(f"{name} is free here: it is what the bifurcation lies at, not what moves it")
        if name not in known:
            raise InputError(f"the system has no parameter {name!r}{suggest(str(name), known)}")
    return free, tuple(dict.fromkeys(parameters))
