"""How bifurcations are solved for, as objects: `formulation=...` of the verbs.

- `BorderedSystem()`, "bordered": the minimally augmented system `[R; g]` (`locate`), the default;
- `ExtendedSystem()`, "extended": `[R; J phi; phi.phi - 1]` with the null vector among the unknowns (`kinds.extended`);
- `Alcorta2019()`, "alcorta2019": the published system for period doublings with its own test functions (`alcorta`), the
  extended one for limit points.

Branch points and, in the last, Neimark-Sacker points are solved for as by default. All find the same: the first two to
rounding, the third to what the harmonics left out make.
"""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass
from typing import ClassVar

from suboctave.arguments import checked
from suboctave.curves.augmentation import Augmentation
from suboctave.curves.events.alcorta import locate_doubling
from suboctave.curves.events.locate import Guess, Singular, locate_singular
from suboctave.curves.kinds import equations_of
from suboctave.curves.kinds.extended import ExtendedOperator, PublishedDoubling
from suboctave.curves.kinds.singular import OPERATORS, SingularOperator
from suboctave.errors import InputError, suggest
from suboctave.harmonic.perturbation import Kind

#: the published test functions for period doublings
DOUBLING_TESTS = ("multiplier", "determinant")


class Formulation(ABC):
    """One way to locate motions at which J_kappa is singular."""

    name: ClassVar[str]
    #: the published test function that looks for period doublings, None for the sign of det J_half
    test: str | None = None

    def operator(self, kind: Kind) -> type[SingularOperator]:
        """The equations that single them out."""
        return SingularOperator

    def equations(self, name: str) -> type[Augmentation]:
        """The equations of curves of a kind, by its name."""
        return self.operator(OPERATORS[name]) if name in OPERATORS else equations_of(name)

    def locate(self, guess: Guess, kind: Kind) -> Singular:
        """Locate one from a guess; raises ConvergenceError."""
        return locate_singular(guess, kind, self.operator(kind))


@checked(methods=False)
@dataclass(frozen=True)
class BorderedSystem(Formulation):
    """The minimally augmented system `[R; g]`, g a bordered scalar that vanishes where J_kappa is singular."""

    name: ClassVar[str] = "bordered"


@checked(methods=False)
@dataclass(frozen=True)
class ExtendedSystem(Formulation):
    """The extended system `[R; J_kappa phi; phi^H phi - 1]`."""

    name: ClassVar[str] = "extended"

    def operator(self, kind: Kind) -> type[SingularOperator]:
        return ExtendedOperator


@checked(methods=False)
@dataclass(frozen=True)
class Alcorta2019(Formulation):
    """The formulation of Alcorta et al., Nonlinear Dynamics 98 (2019): its period-doubling system and test functions.

    test
        What looks for period doublings. "multiplier": the sign of `sign(Re mu) |mu| + 1`, mu the multiplier of largest
        modulus (their Eq. 25). It misses a period doubling where another multiplier leads, and answers to pairs that
        leave the circle on the left. "determinant": a minimum of det B, that is a change of the sign of its increment
        from point to point (Eq. 23). It needs points close together: det B carries a power of omega besides, so that
        the minimum is narrower the more harmonics there are, and two of them within three points are none.

    What the test misses the branch still notices, by det J_half and by the number of unstable multipliers, and says in
    its audit and warnings.
    """

    test: str = "multiplier"
    name: ClassVar[str] = "alcorta2019"

    def __post_init__(self) -> None:
        if self.test not in DOUBLING_TESTS:
            raise InputError(f"unknown test function {self.test!r}{suggest(str(self.test), DOUBLING_TESTS)}")

    def operator(self, kind: Kind) -> type[SingularOperator]:
        if kind is Kind.HALF:
            return PublishedDoubling
        return ExtendedOperator if kind is Kind.INTEGER else SingularOperator

    def locate(self, guess: Guess, kind: Kind) -> Singular:
        return locate_doubling(guess) if kind is Kind.HALF else super().locate(guess, kind)


BORDERED = BorderedSystem()
FORMULATIONS: dict[str, Formulation] = {f.name: f for f in (BORDERED, ExtendedSystem(), Alcorta2019())}


def formulation_of(given: Formulation | str | None) -> Formulation:
    """The formulation that a user asked for: an object, its name, or None for the default; InputError otherwise."""
    if given is None:
        return BORDERED
    if isinstance(given, str):
        if given not in FORMULATIONS:
            raise InputError(f"unknown formulation {given!r}{suggest(given, FORMULATIONS)}")
        return FORMULATIONS[given]
    if isinstance(given, type) and issubclass(given, Formulation):
        raise InputError(f"formulation: give an object, {given.__name__}(), instead of the class")
    if not isinstance(given, Formulation):
        raise InputError(f"a formulation is BorderedSystem(), ExtendedSystem(), Alcorta2019() or a name, not {given!r}")
    return given


def written(formulation: Formulation) -> str:
    """A formulation by the name that gives it again, or in full."""
    return formulation.name if FORMULATIONS.get(formulation.name) == formulation else repr(formulation)
