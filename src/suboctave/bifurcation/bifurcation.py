"""A located bifurcation, on a curve of them an extremum or a point of codimension two, and lists of them."""

from __future__ import annotations

import cmath
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np

from suboctave.arguments import checked
from suboctave.bifurcation.gaps import GrazingContact
from suboctave.bifurcation.normal_form import FORMS, NormalForm, normal_form
from suboctave.errors import ConvergenceError, InputError, suggest
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.waves import Waves
from suboctave.kinds import KINDS, TRACKED_KINDS, suggest_kind
from suboctave.lazy import lazy
from suboctave.motion import Motion

#: kinds at which a curve meets a contact, without having to change in number or stability
CONTACT_KINDS = ("grazing",)


#: way along a curve, in scaled arclength, that its smallest steps resolve
_RESOLVED = 1e-7


def target_multiplier(kind: str, angle: float) -> complex | None:
    """The multiplier that motions of a kind have on the unit circle, None if they need none; angle: that of an NS."""
    row = KINDS.get(kind)
    if row is None or not row.critical:
        return None
    return cmath.exp(1j * angle) if row.multiplier is None else complex(row.multiplier)


@checked(result=True)
@dataclass(frozen=True, eq=False, repr=False)
class CriticalMotion:
    """The perturbation of a motion that neither grows nor decays at a bifurcation, at most one in all displacements.

    frequencies
        Circular frequencies of its waves, (F,), rad per unit time.
    amplitudes
        Complex amplitudes in the coordinates of the linear part's equation of motion, (F, N).
    period
        Of the perturbation: twice the motion's at a PD; at an NS, where it has none, the motion's.
    """

    frequencies: Array
    amplitudes: ComplexArray
    period: float
    linear: LinearPart = field(repr=False)

    def displacement(self, t: Array | float) -> Array:
        """Displacements of all degrees of freedom at the times t; (n,) for a number, (n, len(t)) for an array."""
        waves = np.exp(1j * np.multiply.outer(np.atleast_1d(np.asarray(t, dtype=float)), self.frequencies))
        result = self.linear.shaped(np.real(waves @ self.amplitudes)).T
        return result[:, 0] if np.ndim(t) == 0 else result


@checked(result=True)
@dataclass(frozen=True, eq=False)
class Bifurcation(Motion):
    """A motion at which the response changes its nature, or a contact begins or ceases to touch.

    Attributes
    ----------
    kind
        "LP", "BP", "PD", "NS", "grazing", or the name of a user's event.
    orbit
        The motion, with its own number of harmonics.
    floquet
        Multipliers there, with error estimates.
    residual
        Dimensionless residual of the whole bifurcation system (equations of motion and singularity).
    amplitude
        Largest |x| of the observed DOF over one response period.
    null_vectors
        Right and left null vectors of the singular operator (weighted by masses), None for user events.
    kappa
        Frequency of the perturbation at an NS or a Hopf point, rad per unit time; else 0.
    uncertainty
        Half-width in the free parameter of what is not resolved: of the bracket if the point could only be bracketed;
        behind a grazing that of the neglected harmonics, estimated with half as many more; of an NS how far it lies
        from the motions between which multipliers pass the circle, where few harmonics part the two; else 0.
    contact
        The contact that grazes: at a grazing its own; at another bifurcation the one whose beginning or end brings it
        about (it lies in the square-root layer behind that grazing, see `layer`); None for a smooth bifurcation.
    multiplicity
        How many bifurcations of the kind fall together here, as those of equal sectors do. Each is listed, with null
        vectors of its own: those along which branches leave, as far as these are independent.
    tangent
        At a branch point: the direction (dX, d parameter) of the branch that it was found on; else None.
    arclength
        Position on the branch in scaled arclength; `context` is what the point was found with.
    """

    kind: str
    orbit: PeriodicOrbit
    floquet: FloquetResult
    residual: float
    amplitude: float
    parameter_name: str
    null_vectors: Any = None
    kappa: float = 0.0
    uncertainty: float = 0.0
    arclength: float = 0.0
    contact: GrazingContact | None = None
    multiplicity: int = 1
    tangent: tuple[float, ...] | None = field(default=None, repr=False)
    context: Any = field(default=None, repr=False)

    @property
    def smooth(self) -> bool:
        """True if no contact just begins or ends to touch here."""
        return self.contact is None

    @property
    def discontinuous(self) -> bool:
        """True for a bifurcation that no step can tell from the grazing that brings it about.

        Its critical multiplier jumps across the unit circle as far as the curve can be resolved.
        """
        return (
            self.contact is not None
            and self.kind not in CONTACT_KINDS
            and (self.contact.distance <= _RESOLVED or abs(self._behind(self.contact)) <= self.uncertainty)
        )

    def _behind(self, contact: GrazingContact) -> float:
        """How far behind its grazing it lies in the free parameter."""
        return self.parameter(self.parameter_name) - contact.parameter

    @lazy
    def normal_form(self) -> NormalForm | None:
        """The coefficients of its normal form (`suboctave.bifurcation.normal_form`), computed when first asked for.

        None for contacts and events, for a bifurcation that could only be bracketed, for one in the layer behind a
        grazing, where the equations are not smooth, and for multiple ones, whose forms have more terms.
        """
        if self.kind not in FORMS or self.null_vectors is None or self.contact is not None or self.multiplicity > 1:
            return None
        try:
            return normal_form(self.kind, self.orbit.state(), self.null_vectors, self.parameter_name, self.kappa)
        except (ConvergenceError, np.linalg.LinAlgError):
            return None

    @property
    def criticality(self) -> str | None:
        """Whether it is "supercritical" or "subcritical"; None at limit points and where that is not certain."""
        return None if self.normal_form is None else self.normal_form.criticality

    @property
    def critical_motion(self) -> CriticalMotion | None:
        """What is added to the motion where it bifurcates, the right null vector, as a motion; None where that is not
        known: of contacts, of events, and of what could only be bracketed.
        """
        if self.kind not in FORMS or self.null_vectors is None:
            return None
        state, kind = self.orbit.state(), FORMS[self.kind][0]
        vector = self.null_vectors.right * state.balance.row_weights(len(self.null_vectors.right))
        waves = Waves.of(state, kind, vector, self.kappa)
        frequencies = waves.at.values * state.rate
        moving = state.linear.recovered(frequencies, waves.amplitudes)
        moving = moving / np.abs(state.linear.shaped(moving)).sum(axis=0).max()
        period = self.orbit.period * (2 if kind is Kind.HALF else 1)
        return CriticalMotion(frequencies, moving, period, state.linear)

    def with_normal_form(self, form: NormalForm | None) -> Bifurcation:
        """The same with a normal form that is known: it is not computed again."""
        other = replace(self)
        # in place of the value that would be computed
        object.__setattr__(other, "normal_form", form)
        return other

    def seen_backwards(self, arclength: float) -> Bifurcation:
        """The same on the curve followed the other way."""
        contact = None if self.contact is None else self.contact.backwards()
        other = replace(self, arclength=arclength, contact=contact)
        return other.with_normal_form(self.normal_form) if "normal_form" in self.__dict__ else other

    @property
    def omega(self) -> float:
        """Circular frequency of the load; at Hopf points, and on their curves, that of the oscillation which begins."""
        still = self.kind == "Hopf" or (self.kappa > 0.0 and "still" in (self.context or {}))
        return self.kappa if still else self.orbit.omega

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters of the system by name."""
        return self.orbit.values

    @property
    def multipliers(self) -> ComplexArray:
        """Floquet multipliers over the motion's own period, shape (2 n,)."""
        return self.floquet.multipliers

    @property
    def critical_error(self) -> float:
        """Estimated error of the critical multiplier."""
        at = int(np.argmin(np.abs(self.multipliers - self.critical_multiplier())))
        return float(self.floquet.errors[at])

    @property
    def stability_method(self) -> str:
        """Where the multipliers come from, in words."""
        return self.floquet.method

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the parameters that are free on the curve."""
        return (self.parameter_name,)

    def parameter(self, name: str) -> float:
        """omega or a parameter by name; "amplitude" that."""
        if name == "omega":
            return self.omega
        if name == "amplitude" and name not in self.parameters:
            return self.amplitude
        if name not in self.parameters:
            raise InputError(f"unknown parameter {name!r}{suggest(name, ['omega', *self.parameters])}")
        return self.parameters[name]

    def critical_multiplier(self) -> complex:
        """The multiplier on the unit circle that makes the bifurcation (closest to +1, -1 or exp(i kappa T))."""
        mu = self.multipliers
        if self.kind == "NS" and self.kappa == 0.0:  # only bracketed: the complex pair nearest to the circle
            pairs = mu[mu.imag > 0.0]
            return complex(min(pairs if pairs.size else mu, key=lambda m: abs(abs(m) - 1.0)))
        target = self._target()
        return complex(mu[0] if target is None else min(mu, key=lambda m: abs(m - target)))

    def _target(self) -> complex | None:
        return target_multiplier(self.kind, self.kappa * self.orbit.period)

    def remark(self) -> str:
        """What a table says beside the numbers: the contact that grazes, and what is not resolved."""
        words = []
        if self.multiplicity > 1:
            words.append(f"one of {self.multiplicity} that fall together")
        if self.uncertainty:
            words.append(f"{self.parameter_name} +- {self.uncertainty:.0e}")
        if self.contact is not None and self.kind in CONTACT_KINDS:
            words.append(str(self.contact))
        elif self.contact is not None:
            nature = "discontinuous, at" if self.discontinuous else f"{self._behind(self.contact):+.1e} from"
            words.append(f"{nature} the grazing of {self.contact.label}")
        if self.normal_form is not None and self.normal_form.remark:
            words.append(self.normal_form.remark)
        return "; ".join(words)

    def __repr__(self) -> str:
        free = (
            ""
            if self.parameter_name == "omega"
            else f", {self.parameter_name}={self.parameter(self.parameter_name):.9g}"
        )
        doubt = f" +- {self.uncertainty:.1e}" if self.uncertainty else ""
        return f"<{self.kind} at omega={self.omega:.9g}{free}{doubt}, amplitude={self.amplitude:.7g}>"


@checked(result=True)
class BifurcationList:
    """Located bifurcations in the order met; `["PD"]` gives those of a kind, `[0]` one by position.

    Grazing contacts are no bifurcations: iteration, positions and the length leave them out, `["grazing"]` gives them,
    and the printed table has them below. `met` is everything in the order met.
    """

    def __init__(self, items: list[Bifurcation], names: tuple[str, ...] = ()) -> None:
        self.met = tuple(items)
        self._items = [item for item in items if item.kind not in CONTACT_KINDS]
        self._known = tuple(KINDS) + names

    def __iter__(self) -> Iterator[Bifurcation]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    @overload
    def __getitem__(self, key: str) -> list[Bifurcation]: ...
    @overload
    def __getitem__(self, key: int) -> Bifurcation: ...

    def __getitem__(self, key: str | int) -> list[Bifurcation] | Bifurcation:
        if isinstance(key, str):
            if key not in self._known:
                raise InputError(f"unknown kind of bifurcation {key!r}{suggest_kind(key, self._known)}")
            return [item for item in self.met if item.kind == key]
        return self._items[key]

    def __repr__(self) -> str:
        """A table of the bifurcations, as many as it is long, and below it the grazing contacts."""
        contacts = [item for item in self.met if item.kind in CONTACT_KINDS]
        lines = self._rows(self.met) if self.met else []
        by_item = dict(zip(self.met, lines[1:], strict=True))
        own = [lines[0], *(by_item[item] for item in self._items)] if self._items else ["no bifurcations"]
        if not contacts:
            return "\n".join(own)
        several = f"{len(contacts)} grazing contacts, which are" if len(contacts) > 1 else "1 grazing contact, which is"
        title = f'{several} no bifurcation{"s" * (len(contacts) > 1)} (bifurcations["grazing"]):'
        return "\n".join([*own, title, *(by_item[item] for item in contacts)])

    def _rows(self, items: Sequence[Bifurcation]) -> list[str]:
        """The head of the table and a row for each."""
        free = [name for name in dict.fromkeys(n for b in items for n in b.free_names) if name != "omega"]
        units = items[0].orbit.balance.system.units
        width = max(6, 1 + max(len(b.kind) for b in items))
        omega, size = ("omega", "amplitude") if units is None else (
            f"omega ({units.frequency})", f"amplitude ({units.length})"
        )  # fmt: skip
        wide, room = max(12, len(omega)), max(13, len(size) + 1)
        turns = "" if units is None else f" {units.cycles:>12}"
        rows = [
            f"{'kind':<{width}} {omega:>{wide}}{turns}"
            + "".join(f" {name:>13}" for name in free)
            + f" {size:>{room}}{'multiplier':>24}{'criticality':>15}{'residual':>11}"
        ]
        for b in items:
            mu = b.critical_multiplier()
            text = f"{mu.real:.6f}" + (f"{mu.imag:+.6f}i" if abs(mu.imag) > 1e-7 else "")
            # of an equilibrium they are those of a frequency that is a matter of the method
            text = "" if b.kind == "Hopf" else text
            turning = "" if units is None else f" {b.omega / (2.0 * np.pi):>12.9g}"
            extra = "".join(f" {b.parameter(name):>13.8g}" for name in free)
            remark = b.remark()
            label = b.criticality or ("" if b.normal_form is None else b.normal_form.shape)
            rows.append(
                f"{b.kind:<{width}} {b.omega:>{wide}.9g}{turning}{extra} {b.amplitude:>{room}.7g}{text:>24}{label:>15}"
                f"{b.residual:>11.1e}" + (f"  {remark}" if remark else "")
            )
        return rows


#: kinds of the curves that pass through points of codimension two, or begin there
CURVES_THROUGH = {
    "GPD": ("PD", "LP"),
    "R1": ("LP", "NS"),
    "R2": ("PD", "NS"),
    "LPPD": ("LP", "PD"),
    "LPNS": ("LP", "NS"),
    "PDNS": ("PD", "NS"),
    "NSNS": ("NS",),
}
#: multipliers at ends of curves that are found on others
_AT_ENDS = {"R1": 1.0, "R2": -1.0, "GPD": -1.0}


@checked(result=True)
@dataclass(frozen=True, eq=False, repr=False)
class TrackedEvent(Bifurcation):
    """A bifurcation of a tracked curve at which the curve turns, or at which a second condition holds.

    Besides what a `Bifurcation` has (`null_vectors` and `kappa` are those of the tracked kind):

    curve
        Kind of the motions that the curve consists of; where one ends in a point of another (R1, R2, GPD) the null
        vectors are those of the other.
    names
        The two free parameters.
    extreme
        "minimum" or "maximum" of `parameter_name` at an extremum, else empty.
    isola
        At an extremum along limit points what happens to branches over the other parameter when `parameter_name`
        passes it: "isola_centre" (a closed branch shrinks to a point), "isola_merging" (two branches meet and
        reconnect), empty where that is not certain.
    turning
        On a curve of extrema the parameter that is extreme all along it, else empty.
    """

    curve: str = ""
    names: tuple[str, ...] = ()
    extreme: str = ""
    isola: str = ""
    turning: str = ""

    @property
    def free_names(self) -> tuple[str, ...]:
        """The free parameters."""
        return self.names

    @property
    def smooth(self) -> bool:
        """False along a curve of grazings."""
        return self.curve != "grazing"

    @property
    def discontinuous(self) -> bool:
        """False: events are located along curves, not behind a grazing."""
        return False

    def _target(self) -> complex | None:
        if self.kind in TRACKED_KINDS:
            return super()._target()
        return _AT_ENDS.get(self.kind, target_multiplier(self.curve, self.kappa * self.orbit.period))

    def remark(self) -> str:
        """What a table says beside the numbers."""
        words = [f"{self.extreme} of {self.parameter_name}"] if self.extreme else []
        if self.extreme and self.turning and self.parameter_name == self.names[-1]:
            words.append(f"a minimum and a maximum of {self.turning} meet")
        if self.isola:
            words.append(self.isola.replace("_", " "))
        if self.contact is not None:
            words.append(str(self.contact))
        elif super().remark():
            words.append(super().remark())
        return "; ".join(words)


def kind_of(item: Bifurcation) -> str:
    """Kind of the curve that is followed from a located point."""
    own = isinstance(item, TrackedEvent) and (item.extreme or item.kind not in TRACKED_KINDS)
    return item.curve if own and isinstance(item, TrackedEvent) else item.kind
