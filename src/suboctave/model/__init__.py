"""What vibrates: systems, their nonlinear elements, their loads, and the published ones.

A room without any method: nothing here knows of harmonics of the response, of stability or of curves.
"""

from __future__ import annotations

from suboctave.model.callable_element import Callable
from suboctave.model.clearance import Clearance, Freeplay
from suboctave.model.coupled import CoupledElement
from suboctave.model.dampers import QuadraticDamper, TanhFriction
from suboctave.model.derivative_check import DerivativeReport, check_derivatives
from suboctave.model.element import Element
from suboctave.model.excitations import BaseAcceleration, BaseDisplacement, Gravity, RotatingUnbalance, StaticLoad
from suboctave.model.expression import Coefficient, coefficient
from suboctave.model.expression_element import Expression
from suboctave.model.loads import HarmonicLoad, Load, LoadComponent
from suboctave.model.matrix import MatrixCoefficient, matrix_coefficient
from suboctave.model.sampling import (
    AdaptiveSampling,
    CornerSampling,
    Piece,
    PiecewiseLinear,
    PolynomialSampling,
    SharpSampling,
    SharpVelocitySampling,
)
from suboctave.model.springs import CubicSpring, PolynomialSpring
from suboctave.model.stops import ElasticStop
from suboctave.model.system import System

__all__ = [
    "AdaptiveSampling",
    "BaseAcceleration",
    "BaseDisplacement",
    "Callable",
    "Clearance",
    "Coefficient",
    "CornerSampling",
    "CoupledElement",
    "CubicSpring",
    "DerivativeReport",
    "ElasticStop",
    "Element",
    "Expression",
    "Freeplay",
    "Gravity",
    "HarmonicLoad",
    "Load",
    "LoadComponent",
    "MatrixCoefficient",
    "Piece",
    "PiecewiseLinear",
    "PolynomialSampling",
    "PolynomialSpring",
    "QuadraticDamper",
    "RotatingUnbalance",
    "SharpSampling",
    "SharpVelocitySampling",
    "StaticLoad",
    "System",
    "TanhFriction",
    "check_derivatives",
    "coefficient",
    "matrix_coefficient",
]
