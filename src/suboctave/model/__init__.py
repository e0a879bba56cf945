"""What vibrates: systems, their nonlinear elements, their loads, and the published ones.

A room without any method: nothing here knows of harmonics of the response, of stability or of curves.
"""

from __future__ import annotations

from suboctave.model import library
from suboctave.model.elements.base import Element
from suboctave.model.elements.callable import Callable
from suboctave.model.elements.coupled import CoupledElement, Expression
from suboctave.model.elements.dampers import QuadraticDamper, TanhFriction
from suboctave.model.elements.derivative_check import DerivativeReport, check_derivatives
from suboctave.model.elements.hertz import HertzContact
from suboctave.model.elements.smoothness import (
    AdaptiveSampling,
    CornerSampling,
    Piece,
    PiecewiseLinear,
    PolynomialSampling,
    SharpSampling,
    SharpVelocitySampling,
)
from suboctave.model.elements.springs import CubicSpring, PolynomialSpring
from suboctave.model.elements.stops import Clearance, ElasticStop, Freeplay
from suboctave.model.expressions.coefficients import Coefficient, coefficient
from suboctave.model.loads import (
    BaseAcceleration,
    BaseDisplacement,
    Gravity,
    HarmonicLoad,
    Load,
    LoadComponent,
    RotatingUnbalance,
    StaticLoad,
)
from suboctave.model.matrices import MatrixCoefficient, matrix_coefficient
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
    "HertzContact",
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
    "library",
    "matrix_coefficient",
]
