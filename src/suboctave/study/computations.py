"""Small computations that between them call every kernel with all types of arguments that occur.

Numba compiles a kernel for the types of its arguments when it is called with them; what these computations give is not
looked at. Two processes share them, in the order of the list, and each finds in the cache what the other one has
compiled: responses come last, which need what equations and stability have in common with them.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from suboctave.analysis.branches import frequency_response, switch_branch
from suboctave.analysis.track import track
from suboctave.compiled import without_notice
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.model import ElasticStop, HarmonicLoad, System, library
from suboctave.timedomain.flow import Flow


def _equations() -> None:
    """Harmonic balance of one motion."""
    state = HarmonicBalance(library.duffing(), HarmonicBasis(3)).at(np.ones((7, 1)), 1.0)
    state.extended_jacobian("omega")


def _stability() -> None:
    """Multipliers of a motion that no element acts on: it keeps the equations' kernels out of it."""
    system = System(1.0, 0.1, 1.0, loads=[HarmonicLoad(0, 1.0)])
    floquet_multipliers(HarmonicBalance(system, HarmonicBasis(3)).at(np.ones((7, 1)), 1.0))


def _responses() -> None:
    """Exact and rounded contact: period doubling and fold, their curves, the doubled motion; a structure with unknowns
    at its stop only, one vibration of which decays between contacts, and one of which three more are faster than
    its harmonics and coupled by damping.
    """
    system = library.reference_oscillator()
    doubling = frequency_response(system, (4.05, 3.9)).bifurcations[0]
    track(doubling, "j", (0.0, 0.03), max_step=0.2)
    switch_branch(doubling, bounds=(3.9, 4.05))
    system = library.reference_oscillator(regularization=3000.0)
    fold = frequency_response(system, (0.75, 0.79), harmonics=3).bifurcations["LP"][0]
    track(fold, "j", (0.0, 0.03), max_step=0.2)
    for fast in ((), (4e2, 9e2, 2e3)):
        n = 2 + len(fast)
        stiffness = np.diag([2.0, 2.0, *fast]) - np.eye(n, k=1) - np.eye(n, k=-1)
        damping = np.diag([0.1, 8.0, *(1.0 for _ in fast)]) - 0.1 * np.eye(n, k=1) - 0.1 * np.eye(n, k=-1)
        structure = System(np.eye(n), damping, stiffness, [ElasticStop(0, 5.0, 0.3)], [HarmonicLoad(0, 1.0)])
        motion = frequency_response(structure, (1.0, 1.02), harmonics=9).orbits[0]
        # as normal forms ask for it
        motion.state().linear.stiffness(motion.basis.multiples * motion.omega, 2)


def _in_time() -> None:
    """A trajectory and a tangent vector beside it: what judges their steps, corners or none."""
    system = System(1.0, 0.05, 1.0, loads=[HarmonicLoad(0, 1.0)])
    Flow(system, tangents=1).over([0.0, 0.0], 1.0, 1)


COMPUTATIONS: tuple[tuple[str, Callable[[], None]], ...] = (
    ("equations", _equations),
    ("stability", _stability),
    ("motions in time", _in_time),
    ("responses", _responses),
)


def run(number: int) -> None:
    """One computation of the list; what it warns of does not matter."""
    without_notice()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        COMPUTATIONS[number][1]()
