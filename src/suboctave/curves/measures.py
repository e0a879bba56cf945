"""What is measured at the points of a curve and may bound it without being an unknown: the amplitude of the observed
degree of freedom, the energy.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from suboctave.continuation import CurvePoint
from suboctave.continuation.bounds import Bounds, Measured, Range
from suboctave.continuation.problem import Curve
from suboctave.curves.motion import MotionEvaluation, MotionProblem
from suboctave.harmonic.energy import mean_energy
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.orbit import amplitude_along


def energy(state: BalanceState, observe: int) -> float:
    """Mean energy of the motion."""
    return mean_energy(state)


#: by the name of what is bounded
MEASURES: dict[str, Callable[[BalanceState, int], float]] = {"amplitude": amplitude_along, "energy": energy}


def _at(name: str, observe: int, point: CurvePoint) -> float:
    assert isinstance(point.evaluation, MotionEvaluation)
    return MEASURES[name](point.evaluation.state, observe)


def bounded(curve: Curve, name: str, ends: tuple[float, float], observe: int) -> Range:
    """The range of a free parameter of a curve, or of what is measured; `observe`: the observed degree of freedom."""
    assert isinstance(curve, MotionProblem)
    if name in curve.names:
        return Bounds(*ends, partial(MotionProblem.index, name=name))
    return Measured(*ends, partial(_at, name, observe))
