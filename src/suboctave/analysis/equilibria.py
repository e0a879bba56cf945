"""Equilibria of systems that nothing drives, over a parameter: where they lose their stability, and how."""

from __future__ import annotations

from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from suboctave.analysis.branches import from_end
from suboctave.analysis.options import CurveOptions, CurveRun, settings_of
from suboctave.arguments import Range
from suboctave.curves.still import BEYOND, STILL, beyond, fastest
from suboctave.errors import ConvergenceError, InputError, is_number, shortened
from suboctave.model.inputs import check_bounds, check_is_system, check_parameter, numbers_of, timed
from suboctave.model.linearised import ALL_EIGENVALUES
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.results.equilibria import Equilibria, as_equilibria

#: tries to find a frequency to write equilibria with that is high enough
_TRIES = 4


@with_options(CurveOptions)
@timed
def equilibria(
    system: System,
    parameter: str,
    bounds: Range,
    *,
    start: ArrayLike | None = None,
    highest: float | None = None,
    **options: Unpack[CurveOptions],
) -> Equilibria:
    """Positions in which a system can stay, over a parameter, with their stability, Hopf, limit and branch points.

    They are motions that do not move, in a basis of one harmonic of a frequency beyond all at which they may oscillate:
    a Hopf point is a Neimark-Sacker point there (`suboctave.curves.hopf`). `limit_cycles` follows the oscillation that
    begins at one, `track` Hopf, limit and branch points in a second parameter, `switch_branch` the branch that crosses
    at a BP.

    Parameters
    ----------
    system
        Loads that oscillate must be zero at its parameters; static ones may act.
    parameter, bounds
        Followed from the first value to the last.
    start
        Displacements (n,) beside the equilibrium that is meant at the first value; default: from those of the system
        without elements.
    highest
        The highest frequency at which anything may oscillate, rad per unit time; default: of all eigenvalues along the
        curve. To be given of systems with more than 400 degrees of freedom.

    Raises
    ------
    InputError
        Wrong input, before any work.
    ConvergenceError
        If no equilibrium is found at the first value.
    """
    check_is_system(system)
    check_undriven(system)
    check_parameter(system, parameter)
    if parameter == "omega":
        raise InputError("nothing drives these motions, they have no omega: name a parameter of the system")
    ends = check_bounds(system, parameter, bounds)
    if highest is not None and not (is_number(highest) and highest > 0.0):
        raise InputError(f"highest must be a positive frequency, not {shortened(highest)}")
    if highest is None and system.n > ALL_EIGENVALUES:
        raise InputError(
            f"of {system.n} degrees of freedom say the highest= frequency, rad per unit time, that matters"
        )
    x = np.zeros(system.n) if start is None else numbers_of(start)
    if x.shape != (system.n,):
        raise InputError(f"start must have {system.n} displacements, not shape {x.shape}")
    settings = settings_of(system, options)
    first = {**system.parameters, parameter: ends[0]}
    omega = BEYOND * (fastest(system, [(x, first)]) if highest is None else float(highest))
    for _ in range(_TRIES):
        run = CurveRun(system, parameter, ends, 1, settings)
        curve = run.scaled(run.curve(omega, 1, None))
        given = None if start is None else np.vstack((x, np.zeros((STILL.size - 1, system.n))))
        with run.reporting(options.get("progress"), f"equilibria along {parameter}") as run:
            trace = from_end(curve, given, run, f"so.equilibria(system, {parameter!r}, ({ends[1]!r}, {ends[0]!r}))")
        branch = run.branch(trace)
        if highest is not None:
            return as_equilibria(branch, omega)
        higher = beyond(system, [(orbit.displacement(0.0), orbit.values) for orbit in branch.orbits], omega)
        if higher == omega:
            return as_equilibria(branch, omega)
        omega = higher
    raise ConvergenceError(f"frequencies grow without bound along {parameter}: give highest=, or a shorter range")


def check_undriven(system: System) -> None:
    """Refuse a system that something drives; InputError."""
    if system.excited_by_elements:
        raise InputError("an element depends on time: the frequency of such motions is that of the excitation")
    if system.driven:
        loads = [load for load in system.load_components() if load.harmonic > 0]
        names = sorted({name for load in loads for name in load.amplitude.names} - {"omega"})
        change = f" (here by {', '.join(names)})" if names else ""
        raise InputError(f"a load drives this system: leave its loads out, or make them zero{change}")
