"""`suboctave compile`: all kernels compiled before anybody waits for them.

Numba compiles a kernel for the types of its arguments when it is called with them. So small computations are run that
between them call every kernel with all types that occur; what they give is not looked at. Two processes take them from
the two ends of the list, and each finds in the cache what the other one has compiled. What all responses have in common
comes first, beside what has nothing in common with it, so that neither compiles it twice.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from typing import Any

from suboctave.analysis.branches import continue_branch, frequency_response, switch_branch
from suboctave.analysis.track import track
from suboctave.compiled import without_notice
from suboctave.model import ElasticStop, Expression, HarmonicLoad, QuadraticDamper, System, library
from suboctave.timedomain.flow import Flow

Report = Callable[[float, str], None]


def _response() -> None:
    """What every response needs."""
    frequency_response(library.duffing(c=0.1, F=0.3), (0.5, 0.6), harmonics=1)


def _two_stops(sharpness: float | None) -> None:
    """One degree of freedom, exact contact or rounded: period doubling, fold, their curves, the doubled motion."""
    system = library.reference_oscillator(regularization=sharpness)
    doubling = frequency_response(system, (4.05, 3.9)).bifurcations[0]
    track(doubling, "j", (0.0, 0.03), max_step=0.2)
    doubled = switch_branch(doubling, bounds=(3.9, 4.05))
    frequency_response(system, (2.4, 2.2))
    folds = frequency_response(system, (0.75, 0.79), harmonics=3).bifurcations
    for events in (doubled.bifurcations, folds):
        for item in events["LP"][:1]:
            track(item, "j", (0.0, 0.03), max_step=0.2)


def _absorber() -> None:
    """Two degrees of freedom with polynomials: Neimark-Sacker points and folds."""
    torus_points = frequency_response(library.nltva(), (1.09, 1.12), harmonics=1).bifurcations
    track(torus_points[0], "F", (0.10, 0.12))
    frequency_response(library.nltva(), (1.0, 1.2))


def _two_masses(sharpness: float | None) -> None:
    """Two degrees of freedom with contact: events of all kinds, the curve of one of each kind."""
    system = library.two_mass_unilateral(regularization=sharpness)
    events = frequency_response(system, (0.5, 0.8)).bifurcations
    for item in {item.kind: item for item in events}.values():
        track(item, "F", (0.09, 0.11), max_step=0.2)


def _polynomial() -> None:
    """One degree of freedom with a polynomial: folds, their curve, a curve over the force."""
    system = library.duffing(c=0.1, F=0.3)
    fold = frequency_response(system, (3.0, 0.5)).bifurcations["LP"][0]
    track(fold, "F", (0.1, 0.4))
    continue_branch(system, "F", (0.1, 0.5), omega=2.0)


def _several_inputs() -> None:
    """A law of two displacements, with corners."""
    frequency_response(library.jeffcott_rotor(), (0.6, 2.0))


def _laws_as_text() -> None:
    """Laws that are integrated at instants of their own: of displacement and velocity, with corners."""
    laws = [Expression(0, "k*max(x - g, 0)**1.5 + c*v*abs(v)"), QuadraticDamper(0, 0.05)]
    numbers = {"k": 3.0, "g": 0.5, "c": 0.1, "F": 0.5}
    system = System(1.0, 0.05, 1.0, laws, [HarmonicLoad(0, "F")], numbers)
    frequency_response(system, (2.0, 0.7))


def _at_rest() -> None:
    """A structure that only its own parameter excites."""
    frequency_response(library.mathieu_duffing(), (1.7, 2.3))


def _grazing() -> None:
    """The first touch of a stop, and its curve."""
    system = System(1.0, 0.04, 1.0, [ElasticStop(0, 10.0, "g")], [HarmonicLoad(0, 0.3)], {"g": 1.0})
    for item in frequency_response(system, (2.0, 0.7)).bifurcations["grazing"][:1]:
        track(item, "g", (0.8, 1.2))


def _methods_of_stability() -> None:
    """Multipliers by Hill's determinant and by Koopman's operator."""
    for method in ("hill", "koopman-hill"):
        frequency_response(library.two_mass_unilateral(), (0.75, 0.8), stability=method, harmonics=9)


def _in_time() -> None:
    """A trajectory with located contacts, and tangent vectors beside it: what judges their steps."""
    system = System(1.0, 0.05, 1.0, [ElasticStop(0, 5.0, 0.3)], [HarmonicLoad(0, 1.0)])
    Flow(system, tangents=1).over([0.0, 0.0], 1.0, 1)


#: title and computation; those at one end of the list have few kernels in common with those at the other
COMPUTATIONS: tuple[tuple[str, Callable[..., None], tuple[Any, ...]], ...] = (
    ("responses", _response, ()),
    ("one degree of freedom, exact contact", _two_stops, (None,)),
    ("one degree of freedom, rounded contact", _two_stops, (3000.0,)),
    ("polynomials", _polynomial, ()),
    ("parametric excitation", _at_rest, ()),
    ("grazing", _grazing, ()),
    ("laws as text", _laws_as_text, ()),
    ("laws of several inputs", _several_inputs, ()),
    ("methods of stability", _methods_of_stability, ()),
    ("two degrees of freedom, rounded contact", _two_masses, (100.0,)),
    ("two degrees of freedom, exact contact", _two_masses, (None,)),
    ("two degrees of freedom, polynomials", _absorber, ()),
    ("motions in time", _in_time, ()),
)


def run(number: int) -> None:
    """One computation of the list; what it warns of does not matter."""
    without_notice()
    _, computation, arguments = COMPUTATIONS[number]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        computation(*arguments)


def compile_all(report: Report, processes: int = 2) -> None:
    """Compile every kernel that is not in the cache; `report(share done, what is being compiled)` is called."""
    pending = deque(range(len(COMPUTATIONS)))
    running: dict[Future[None], int] = {}
    done = 0
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        while pending or running:
            while pending and len(running) < processes and (0 not in running.values() or done == 0):
                number = pending.pop() if len(running) % 2 else pending.popleft()
                running[pool.submit(run, number)] = number
            report(done / len(COMPUTATIONS), "; ".join(COMPUTATIONS[number][0] for number in running.values()))
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                future.result()
                del running[future]
                done += 1
    report(1.0, "")
