"""In which harmonics a curve is written: the argument `harmonics`, and the curve with its first basis."""

from __future__ import annotations

from typing import Any

import numpy as np

from suboctave.curves.motion import MotionProblem
from suboctave.errors import InputError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.harmonic.linear_part import LinearPart, StructuralMatrices
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.model.system import System

#: unknowns of a dense problem beyond which a run is refused (a matrix of half a gigabyte)
_DENSE_UNKNOWNS = 8000

Harmonics = int | str | AdaptiveHarmonics


def make_curve(
    system: System, name: str, omega: float, span: float, harmonics: Harmonics, nu: int, linear: LinearPart | None
) -> MotionProblem:
    """The curve of a system's motions of `nu` load periods along a free parameter; InputError where it cannot be."""
    loaded = max([1] + [c.harmonic for c in system.load_components()])
    rule = rule_of(harmonics)
    adaptive = rule if isinstance(rule, AdaptiveHarmonics) else None
    high = rule if isinstance(rule, int) else max(rule.minimum, loaded)
    if linear is not None and not isinstance(linear, LinearPart):
        raise InputError(f"linear must fulfil suboctave.harmonic.LinearPart, {type(linear).__name__} does not")
    size = system.n if linear is None else linear.size
    basis = HarmonicBasis(high * nu, nu)
    check_unknowns(size, basis)
    return MotionProblem.response(HarmonicBalance(system, basis, linear=linear), name, omega, span, adaptive)


def rule_of(harmonics: Any) -> AdaptiveHarmonics | int:
    """How harmonics are chosen, or how many of omega are kept: the argument `harmonics` of the verbs, checked."""
    rule = AdaptiveHarmonics() if isinstance(harmonics, str) and harmonics == "adaptive" else harmonics
    if isinstance(rule, AdaptiveHarmonics):
        return rule
    if isinstance(rule, (int, np.integer)) and not isinstance(rule, bool) and rule >= 1:
        return int(rule)
    raise InputError(
        f'harmonics must be a whole number of at least 1, "adaptive" or AdaptiveHarmonics(...), not {harmonics!r}'
    )


def harmonics_of(orbit: PeriodicOrbit) -> Harmonics:
    """The rule or the number of harmonics of the load that a motion was computed with."""
    return orbit.adaptive or max(1, orbit.basis.harmonics // orbit.basis.nu)


def check_unknowns(size: int, basis: HarmonicBasis) -> None:
    """Refuse bases whose dense matrices would not fit; `size`: unknown DOFs."""
    unknowns = size * basis.size
    if unknowns > _DENSE_UNKNOWNS:
        raise InputError(
            f"{size} DOFs with {basis.harmonics // basis.nu} harmonics are {unknowns} unknowns with dense matrices, "
            f"more than {_DENSE_UNKNOWNS}: keep fewer harmonics, or reduce the model before it becomes a System, for "
            "example to its lowest modes P (n, m): System(P.T @ M @ P, P.T @ C @ P, P.T @ K @ P, ...), elements and "
            "loads with direction=P[dof] in place of dof="
        )


def own_linear_part(orbit: PeriodicOrbit, system: System | None = None) -> LinearPart | None:
    """The linear part an orbit was solved with, at its or a system's parameters; None for its system's own matrices."""
    linear = orbit.balance.linear
    values = orbit.values if system is None else dict(system.parameters)
    return None if isinstance(linear, StructuralMatrices) else linear.rebuilt(values)
