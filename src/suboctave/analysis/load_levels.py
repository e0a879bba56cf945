"""Isolas that join other branches under stronger loads: their limit points followed over the level of the loads.

Most isolated responses are parts of the main one where the excitation is stronger. So responses are followed at other
levels of all loads together, and limit points met there brought to the loads' own level, where they lie on branches of
the system itself.
"""

from __future__ import annotations

from collections.abc import Iterator

from suboctave.analysis.branch import Branch
from suboctave.analysis.identity import lies_on
from suboctave.analysis.isola_survey import Survey
from suboctave.analysis.making import own_linear_part
from suboctave.analysis.verbs import continue_branch
from suboctave.errors import ConvergenceError
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.model.system import System

__all__ = ["branches_by_load"]

_LEVEL = "load_level"


def branches_by_load(survey: Survey, value: float, level: float) -> Iterator[Branch]:
    """Branches over omega at a value of the parameter that another level of the loads leads to, each once.

    Without those that the survey has met there. `level` is in units of the loads' own. Where nothing oscillates but
    elements there are none.
    """
    system = survey.system.with_parameters({survey.name: value})
    if not any(c.harmonic for c in system.load_components()):
        return
    scaled = system.with_scaled_loads(_LEVEL)
    bounds = (min(1.0, level), max(1.0, level))
    around = Survey(scaled, _LEVEL, bounds, survey.omega, survey.harmonics, survey.depth, survey.options, survey.most)
    try:
        around.look(level)
    finally:
        for note in around.notes:
            survey.note(f"at {survey.name} = {value:.6g}, looking at {level:g} times the loads: {note}")
    known = list(survey.met.get(value, []))
    for leg in around.legs:
        if not leg.contains(1.0):
            continue
        try:
            orbit = _own(leg.limit_point(1.0).orbit, system)
            if any(lies_on(orbit, branch.points, images=True) for branch in known):
                continue
            low, high = min(*survey.omega, orbit.omega), max(*survey.omega, orbit.omega)
            known.append(continue_branch(orbit, "omega", (low, high), **survey.options))
        except ConvergenceError as failure:
            survey.note(f"at {survey.name} = {value:.6g}, a limit point from stronger loads: {failure}")
            continue
        yield known[-1]


def _own(orbit: PeriodicOrbit, system: System) -> PeriodicOrbit:
    """A motion of the system with scaled loads, at their own level, as one of the system itself."""
    values = {name: value for name, value in orbit.values.items() if name != _LEVEL}
    balance = HarmonicBalance(system, orbit.basis, linear=own_linear_part(orbit))
    balance = balance.settle(orbit.coefficients, orbit.omega)
    return PeriodicOrbit(
        balance, orbit.coefficients, orbit.omega, values, orbit.residual, orbit.truncation, orbit.adaptive
    )
