"""Backbones of forced, damped systems: the resonance found on a response, then followed over the load.

What phase resonance is, is in `curves.kinds.phase_resonance`; from any motion beside it, `track(..., onto=)` follows it
as well. Here the motion is looked for: where the phase of a harmonic passes quadrature along a response, with the
largest amplitude of that harmonic.
"""

from __future__ import annotations

from math import gcd
from typing import Unpack

import numpy as np

from suboctave.analysis.branches import frequency_response
from suboctave.analysis.options import TrackOptions, handed_on
from suboctave.analysis.subharmonics import Branches, find_subharmonics
from suboctave.analysis.track import track
from suboctave.arguments import Range
from suboctave.curves.starts import Harmonics
from suboctave.curves.trace import BranchPoint
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.basis import Array
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import pass_on
from suboctave.model.inputs import check_bounds, check_count, check_is_system, check_range, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.results.branch import Branch, TrackedBranch


@with_options(TrackOptions)
@timed
def phase_resonance(
    system: System,
    omega: Range,
    parameter: str,
    bounds: Range,
    *,
    harmonic: int = 1,
    subharmonic: int = 1,
    harmonics: Harmonics = "adaptive",
    **options: Unpack[TrackOptions],
) -> TrackedBranch:
    """The backbone of a resonance: motions whose harmonic lags the load by a quarter of its period, over a parameter.

    Volvert & Kerschen, Journal of Sound and Vibration 511 (2021).

    Parameters
    ----------
    omega
        Where the resonance is looked for at the system's own parameters, (from, to), rad per unit time. The backbone
        may leave it.
    parameter, bounds
        The parameter over which it is followed, that of the load or any other, and its range (from, to), which holds
        the system's own value.
    harmonic, subharmonic
        The resonance of the observed displacement at `harmonic / subharmonic` omega: (1, 1) is the fundamental one,
        (3, 1) superharmonic of order 3, (1, 3) subharmonic of order 3, along motions of `subharmonic` load periods.
    harmonics
        As in `frequency_response`.

    Raises
    ------
    InputError
        Wrong input, before any work: also a load of several harmonics, against which there is no single phase.
    ConvergenceError
        If no motion in quadrature is found in the range of omega.
    """
    check_is_system(system)
    check_bounds(system, parameter, bounds)
    check_range("omega", omega, positive=True)
    k, nu = check_count("harmonic", harmonic), check_count("subharmonic", subharmonic)
    if gcd(k, nu) > 1:
        raise InputError(
            f"harmonic={k} and subharmonic={nu} have a common factor: {k // gcd(k, nu)}/{nu // gcd(k, nu)} is meant"
        )
    loads = sorted({one.harmonic for one in system.load_components() if one.harmonic})
    if loads != [1]:
        shown = f"multiples {', '.join(map(str, loads))} of omega" if loads else "no load that oscillates"
        raise InputError(f"the phase is that of a single load at omega: this system has {shown}")
    plain = handed_on(options)
    plain.pop("formulation", None)
    given: Branch | Branches = (
        frequency_response(system, omega, harmonics=harmonics, **plain)
        if nu == 1
        else find_subharmonics(system, omega, subharmonic=nu, harmonics=harmonics, **plain)
    )
    # the resonance may lie on what is missing
    pass_on(given.interruption)
    branches = [given] if isinstance(given, Branch) else given
    found = [place for branch in branches for place in _in_quadrature(branch, k, nu)]
    if not found:
        raise ConvergenceError(
            f"no motion has its harmonic at {k if nu == 1 else f'{k}/{nu}'} omega in quadrature with the load, for "
            f"omega from {min(omega):g} to {max(omega):g}: widen the range, or change {parameter} in the system"
        )
    _, start = max(found, key=lambda place: place[0])
    return track(start, parameter, bounds, onto={"name": "phase_resonance", "harmonic": k / nu}, **options)


def _in_quadrature(branch: Branch, k: int, nu: int) -> list[tuple[float, BranchPoint]]:
    """Where the phase passes quadrature along a branch: the amplitude of the harmonic, and the point nearest by."""
    orbits = branch.orbits
    z = np.array([orbit.harmonic(k / nu, branch.observe) for orbit in orbits])
    force = np.array([_load(orbit) for orbit in orbits])
    lag: Array = (z**nu * force.conj() ** k).real / np.maximum(np.abs(z) ** nu * np.abs(force) ** k, 1e-300)
    passes = np.flatnonzero(lag[:-1] * lag[1:] < 0.0)
    nearer = passes + (np.abs(lag[passes + 1]) < np.abs(lag[passes]))
    return [(float(abs(z[i])), branch.points[i]) for i in nearer.tolist()]


def _load(orbit: PeriodicOrbit) -> complex:
    """The largest complex amplitude of the load at omega."""
    loads, values = orbit.balance.loads, {**orbit.values, "omega": orbit.omega}
    return loads.force(1, values, loads.strongest(1, values))
