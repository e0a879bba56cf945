"""Where a bifurcation lies that the largest number of harmonics does not resolve: on the curve with more of them.

The system of a bifurcation is solved for with as many harmonics as a dense matrix can carry. Its place is theirs: what
those left out move is seen with more of them (`curves.finer`), along whose curve the bifurcation is a zero of one
scalar, the tangent's component along the free parameter for an LP, `prod (1 + mu)` for a PD, `|mu| - 1` of the critical
pair for an NS. How far the zero is from what was solved for is the uncertainty of that; where there is none nearby, the
bifurcation is one of the truncated equations alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from suboctave.continuation.problem import Array
from suboctave.curves.events.locate import Singular
from suboctave.curves.events.monitors import BifurcationKind
from suboctave.curves.finer import FinerMotion, resolved_beside
from suboctave.curves.motion import MotionProblem
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.truncation import next_harmonics

#: distance of a located bifurcation's critical multiplier from where it should be, and error of it, up to which the
#: harmonics it was solved with suffice
CRITICAL = 1e-3
#: scaled arclength of the first secant
_FIRST = 1e-4
#: scaled arclength from the bifurcation solved for beyond which a zero belongs to another one
_FARTHEST = 0.1
#: number of places at which the scalar is evaluated before the search is given up
_PLACES = 12
#: last step of the secants that settles the zero, as a share of its distance from the bifurcation solved for
_SETTLED = 1e-2
#: last step, in scaled arclength, that settles a zero which lies at the bifurcation solved for
_CLOSE = 1e-9


class Resolved(NamedTuple):
    """A bifurcation with more harmonics: the motion, its multipliers, and by how much the error of the critical one
    moves it in the free parameter.
    """

    motion: FinerMotion
    floquet: FloquetResult
    width: float


def is_bifurcation(kind: BifurcationKind, solution: Singular) -> bool:
    """Whether the critical multiplier of a solved bifurcation lies within its error of where it should be."""
    critical = kind.critical(solution)
    if critical is None:
        return True
    away, error = _off_circle(solution, critical)
    return away <= max(error, CRITICAL)


def lacks_harmonics(kind: BifurcationKind, solution: Singular, curve: MotionProblem) -> bool:
    """Whether the harmonics of a located bifurcation leave it open where it lies: they are the most that its curve may
    have, or more led nowhere.
    """
    rule, critical = curve.adaptive, kind.critical(solution)
    if rule is None or critical is None or kind.name not in _SCALARS or kind.multiplicity > 1:
        return False
    if next_harmonics(solution.state, rule).size > solution.state.basis.size:
        return not is_bifurcation(kind, solution)
    return not max(_off_circle(solution, critical)) <= CRITICAL


def _off_circle(solution: Singular, critical: complex) -> tuple[float, float]:
    """Distance of the multiplier nearest to the critical value from it, and its error."""
    away = np.abs(solution.floquet.multipliers - critical)
    nearest = int(np.argmin(away))
    return float(away[nearest]), float(solution.floquet.errors[nearest])


def resolved(kind: BifurcationKind, solution: Singular, curve: MotionProblem, tangent: Array) -> Resolved | None:
    """The bifurcation on the curve with more harmonics, from one solved for on `curve`, in the basis of that; None if
    there is none nearby. `tangent`: of the curve there.

    Raises
    ------
    ConvergenceError
        If there is no motion with more harmonics.
    """
    critical = kind.critical(solution)
    assert critical is not None
    found = resolved_beside(curve, solution.state, tangent, solution.floquet)
    return None if found is None else zero_beside(kind, *found, critical)


def zero_beside(
    kind: BifurcationKind, motion: FinerMotion, result: FloquetResult, critical: complex
) -> Resolved | None:
    """The bifurcation on the curve with more harmonics, by secants from a motion of it with its multipliers; None if
    there is none nearby. critical: the multiplier that lies on the unit circle there.

    Raises
    ------
    ConvergenceError
        If the curve with more harmonics cannot be followed.
    """
    scalar = _SCALARS[kind.name]
    places, values, parameters = [0.0], [scalar(motion, result, critical)], [motion.parameter]
    way = _FIRST
    for _ in range(_PLACES):
        if abs(way) > _FARTHEST:
            return None
        motion = motion.beside(way - places[-1])
        result = floquet_multipliers(motion.state)
        places.append(way)
        values.append(scalar(motion, result, critical))
        parameters.append(motion.parameter)
        change = values[-1] - values[-2]
        if change == 0.0:
            return None
        step = -values[-1] * (places[-1] - places[-2]) / change
        if abs(step) <= max(_CLOSE, _SETTLED * abs(way)):
            error = float(result.errors[np.abs(result.multipliers - critical).argmin()])
            width = error * abs((parameters[-1] - parameters[-2]) / change)
            return Resolved(motion, result, width)
        way += math.copysign(min(abs(step), _FARTHEST / 4.0), step)
    return None


def _slope(motion: FinerMotion, result: FloquetResult, critical: complex) -> float:
    return float((motion.weights * motion.tangent)[-1])


def _double(motion: FinerMotion, result: FloquetResult, critical: complex) -> float:
    sign, logarithm = result.symmetric[:, 1].tolist()
    return float(sign * math.exp(logarithm))


def _beyond_circle(motion: FinerMotion, result: FloquetResult, critical: complex) -> float:
    mu = result.multipliers
    return float(abs(mu[np.abs(mu - critical).argmin()])) - 1.0


_SCALARS = {"LP": _slope, "PD": _double, "NS": _beyond_circle}
