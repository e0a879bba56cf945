"""Systems from the literature, with the numbers of their sources: for examples, tests and comparisons.

Every function returns a `System` whose parameters have the names of its arguments, so that each can be continued or
tracked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from suboctave.arguments import checked
from suboctave.errors import InputError, is_number, shortened
from suboctave.model.elements.base import BaseElement
from suboctave.model.elements.coupled import Expression
from suboctave.model.elements.springs import CubicSpring
from suboctave.model.elements.stops import ElasticStop
from suboctave.model.loads import HarmonicLoad, RotatingUnbalance
from suboctave.model.system import System

__all__ = [
    "chain_with_stop",
    "duffing",
    "jeffcott_rotor",
    "mathieu_duffing",
    "nltva",
    "reference_oscillator",
    "reference_oscillator_physical",
    "two_mass_unilateral",
]


def __dir__() -> list[str]:
    """The systems alone."""
    return __all__


def _forced(
    name: str,
    parameters: dict[str, float],
    elements: Sequence[BaseElement],
    matrices: tuple[Any, Any, Any] = ("m", "c", "k"),
    amplitude: str = "F",
    dof: int = 0,
) -> System:
    """A system under `amplitude cos(omega t)` at `dof`; `matrices`: mass, damping, stiffness."""
    return System(*matrices, elements, [HarmonicLoad(dof=dof, amplitude=amplitude)], parameters, name)


@checked
def reference_oscillator(
    zeta: float = 0.03,
    alpha: float = 0.16,
    Kc: float = 4.7,
    j: float = 0.0,
    p: float = 0.55,
    regularization: float | None = None,
) -> System:
    """A rattling oscillator between two stops, `x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)`, no units.

    `Fc = Kc [(x + 1) H(-x - 1) + (x - j) H(x - j)]`: the left gap is the unit of length, `j` the ratio of the gaps.
    `regularization`: the sharpness of the arctan law (3000 in the source), None for the exact law. Source: Alcorta,
    Baguet, Prabel, Piteau, Jacquet-Richardet, Nonlinear Dynamics 98 (2019), Eqs. (40) to (42), Table 1, with the sign
    of the first Heaviside function mended.
    """
    elements = [
        CubicSpring(dof=0, coefficient="alpha"),
        ElasticStop(dof=0, stiffness="Kc", gap="j", side="right", regularization=regularization),
        ElasticStop(dof=0, stiffness="Kc", gap=-1.0, regularization=regularization),
    ]
    parameters = {"zeta": zeta, "alpha": alpha, "Kc": Kc, "j": j, "p": p}
    return _forced("reference oscillator", parameters, elements, (1.0, "2*zeta", 1.0), "p")


@checked
def reference_oscillator_physical(
    m: float,
    c: float,
    k: float,
    alpha: float,
    kc: float,
    gap1: float,
    gap2: float,
    force: float,
    regularization: float | None = None,
) -> System:
    """The reference oscillator in physical units, `m x'' + c x' + k x + alpha x^3 + Fc(x) = force cos(omega t)`.

    Stops of stiffness `kc` at `x = -gap1` (left) and `x = gap2` (right). `regularization` in 1 / length. Source:
    Alcorta et al. 2019, Eq. (38).
    """
    elements = [
        CubicSpring(dof=0, coefficient="alpha"),
        ElasticStop(dof=0, stiffness="kc", gap="gap2", side="right", regularization=regularization),
        ElasticStop(dof=0, stiffness="kc", gap="-gap1", side="left", regularization=regularization),
    ]
    parameters = {
        "m": m, "c": c, "k": k, "alpha": alpha, "kc": kc, "gap1": gap1, "gap2": gap2, "force": force,
    }  # fmt: skip
    return _forced("reference oscillator (physical)", parameters, elements, amplitude="force")


@checked
def nondimensional(
    m: float,
    c: float,
    k: float,
    alpha: float,
    kc: float,
    gap1: float,
    gap2: float,
    force: float,
    regularization: float | None = None,
) -> dict[str, float | None]:
    """Arguments of `reference_oscillator` for the numbers of `reference_oscillator_physical`.

    Lengths are measured in `gap1` (which must not be zero), frequencies in `sqrt(k/m)`: a motion `x(t)` of the physical
    system at `omega` is `gap1` times the motion of the other one at `omega / sqrt(k/m)`. Source: Alcorta et al. 2019,
    Eq. (39).
    """
    for name, value in (("m", m), ("k", k), ("gap1", gap1)):
        if not value > 0.0:
            raise InputError(f"{name} must be positive to serve as a unit, not {value}")
    return {
        "zeta": c / (2.0 * math.sqrt(k * m)),
        "alpha": alpha * gap1**2 / k,
        "Kc": kc / k,
        "j": gap2 / gap1,
        "p": force / (k * gap1),
        "regularization": None if regularization is None else regularization * gap1,
    }


@checked
def duffing(c: float = 0.05, k: float = 1.0, alpha: float = 1.0, F: float = 1.0, m: float = 1.0) -> System:
    """Duffing's oscillator, `m x'' + c x' + k x + alpha x^3 = F cos(omega t)`; softening if `alpha` is negative."""
    parameters = {"m": m, "c": c, "k": k, "alpha": alpha, "F": F}
    return _forced("Duffing oscillator", parameters, [CubicSpring(dof=0, coefficient="alpha")])


@checked
def mathieu_duffing(
    c: float = 0.05, k: float = 1.0, eps: float = 0.2, gamma: float = 0.3, F: float = 0.0, m: float = 1.0
) -> System:
    """A Duffing oscillator of varying stiffness, `k (1 + eps cos(omega t))`.

    `m x'' + c x' + k (1 + eps cos(omega t)) x + gamma x^3 = F cos(omega t)`. Without `F` it is at rest until that
    loses its stability: by a period doubling around `omega = 2 sqrt(k/m)`, where `eps` exceeds about `2 c / sqrt(k m)`
    (Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, section 5.2).
    """
    elements = [CubicSpring(dof=0, coefficient="gamma"), Expression(dof=0, expression="k*eps*cos(omega*t)*x")]
    parameters = {"m": m, "c": c, "k": k, "eps": eps, "gamma": gamma, "F": F}
    return _forced("Mathieu-Duffing oscillator", parameters, elements)


@checked
def jeffcott_rotor(
    m: float = 1.0,
    c: float = 0.1,
    k: float = 1.0,
    me: float = 0.05,
    kc: float = 20.0,
    clearance: float | None = 0.2,
) -> System:
    """A Jeffcott rotor with an unbalance `me`, DOFs x and y; `omega` is the speed of its shaft.

    `clearance`: radial distance to a frictionless stator ring of stiffness `kc`, which pushes the shaft back along its
    radius beyond it (None: no stator): `F_r = kc max(r - clearance, 0)` with `r^2 = x^2 + y^2 + (1e-6 clearance)^2`,
    which keeps r from zero at rest.
    """
    parameters = {"m": m, "c": c, "k": k, "me": me}
    rubbing = []
    if clearance is not None:
        parameters |= {"kc": kc, "clearance": clearance}
        radius = "sqrt(x**2 + y**2 + (1e-6*clearance)**2)"
        rubbing = [
            Expression(dof, f"kc*max({radius} - clearance, 0)*{name}/{radius}", inputs={"x": 0, "y": 1})
            for dof, name in enumerate("xy")
        ]
    mass, damping, stiffness = ([[one, 0.0], [0.0, one]] for one in "mck")
    unbalance = RotatingUnbalance(dof=0, mass_eccentricity="me", perpendicular=1)
    return System(mass, damping, stiffness, rubbing, [unbalance], parameters, "Jeffcott rotor", ("x", "y"))


@checked
def nltva(F: float = 0.11) -> System:
    """A Duffing oscillator with a nonlinear tuned vibration absorber (DOF 1), forced at DOF 0.

    The absorber is designed by the generalised equal-peak rule for a mass ratio of 5 %: Habib, Detroux, Viguié,
    Kerschen, Mechanical Systems and Signal Processing 52-53 (2015); its response, quasi-periodic motions and isola:
    Detroux, Habib, Masset, Kerschen, the same journal 60-61 (2015). No units.
    """
    parameters = {
        "m1": 1.0, "c1": 0.002, "k1": 1.0, "knl1": 1.0,
        "m2": 0.05, "c2": 0.0128, "k2": 0.0454, "knl2": 0.0042,
        "F": F,
    }  # fmt: skip
    elements = [CubicSpring(dof=0, coefficient="knl1"), CubicSpring(dof=(0, 1), coefficient="knl2")]
    damping, stiffness = ([[f"{x}1 + {x}2", f"-{x}2"], [f"-{x}2", f"{x}2"]] for x in "ck")
    matrices = [["m1", 0.0], [0.0, "m2"]], damping, stiffness
    return _forced("nonlinear tuned vibration absorber", parameters, elements, matrices)


@checked
def two_mass_unilateral(
    F: float = 0.1, Kc: float = 100.0, gap: float = 1.0, damping: float = 0.03, regularization: float | None = None
) -> System:
    """Two unit masses in a row, one of them against a stiff one-sided spring.

    DOF 0 hangs on DOF 1 by a unit spring, DOF 1 on the ground by another; both have a dashpot `damping`. A stop of
    stiffness `Kc` limits DOF 0 to the right; `F cos(omega t)` acts on DOF 1. No units. Source: M. Krack, J. Gross,
    Harmonic Balance for Nonlinear Vibration Problems, Springer 2019, and example 3 of its toolbox NLvib (omega from 0.5
    to 0.8, with limit points, period doublings and Neimark-Sacker points).
    """
    elements = [ElasticStop(dof=0, stiffness="Kc", gap="gap", side="right", regularization=regularization)]
    parameters = {"damping": damping, "Kc": Kc, "gap": gap, "F": F}
    matrices = (
        [[1.0, 0.0], [0.0, 1.0]],
        [["damping", "-damping"], ["-damping", "2*damping"]],
        [[1.0, -1.0], [-1.0, 2.0]],
    )
    return _forced("two masses with a one-sided stop", parameters, elements, matrices, dof=1)


@checked
def chain_with_stop(
    masses: int = 10,
    Kc: float = 1.0,
    gap: float = 1.0,
    F: float = 0.15,
    alpha: float = 0.01,
    beta: float = 0.02,
) -> System:
    """Unit masses in a row on unit springs, the first one on the ground, the last one against a one-sided stop.

    `F cos(omega t)` acts on the first mass, the stop of stiffness `Kc` beyond `gap` on the last; damping
    `alpha M + beta K`. No units. Natural frequencies `2 sin((2 i - 1) pi / (4 masses + 2))`, i = 1, 2, ...: a structure
    of any size whose modes are known. The matrices are sparse.
    """
    if not is_number(masses) or masses != int(masses) or masses < 1:
        raise InputError(f"masses={shortened(masses)}: a whole number from 1 on", ("masses",))
    from scipy.sparse import diags_array, eye_array

    diagonal = [2.0] * (int(masses) - 1) + [1.0]
    beside = [-1.0] * (int(masses) - 1)
    stiffness = diags_array([beside, diagonal, beside], offsets=[-1, 0, 1]).tocsr()
    mass = eye_array(int(masses), format="csr")
    elements = [ElasticStop(dof=int(masses) - 1, stiffness="Kc", gap="gap", side="right")]
    parameters = {"Kc": Kc, "gap": gap, "F": F, "alpha": alpha, "beta": beta}
    matrices = mass, {"alpha": mass, "beta": stiffness}, stiffness
    return _forced("chain with a stop", parameters, elements, matrices)
