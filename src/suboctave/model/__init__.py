"""What vibrates: systems, their nonlinear elements, their loads, and the published ones.

A room without any method: nothing here knows of harmonics of the response, of stability or of curves.
"""

from suboctave.model import library as library
from suboctave.model.elements.base import Element as Element
from suboctave.model.elements.callable import Callable as Callable
from suboctave.model.elements.coupled import CoupledElement as CoupledElement, Expression as Expression
from suboctave.model.elements.derivative_check import (
    DerivativeReport as DerivativeReport,
    check_derivatives as check_derivatives,
)
from suboctave.model.elements.smoothness import (
    AdaptiveSampling as AdaptiveSampling,
    CornerSampling as CornerSampling,
    Piece as Piece,
    PiecewiseLinear as PiecewiseLinear,
    PolynomialSampling as PolynomialSampling,
    SharpSampling as SharpSampling,
    SharpVelocitySampling as SharpVelocitySampling,
)
from suboctave.model.elements.springs import CubicSpring as CubicSpring, PolynomialSpring as PolynomialSpring
from suboctave.model.elements.stops import Clearance as Clearance, ElasticStop as ElasticStop, Freeplay as Freeplay
from suboctave.model.elements.written import (
    HertzContact as HertzContact,
    QuadraticDamper as QuadraticDamper,
    TanhFriction as TanhFriction,
)
from suboctave.model.expressions.coefficients import Coefficient as Coefficient, coefficient as coefficient
from suboctave.model.loads import (
    BaseAcceleration as BaseAcceleration,
    BaseDisplacement as BaseDisplacement,
    Gravity as Gravity,
    HarmonicLoad as HarmonicLoad,
    Load as Load,
    LoadComponent as LoadComponent,
    RotatingUnbalance as RotatingUnbalance,
    StaticLoad as StaticLoad,
)
from suboctave.model.matrices import MatrixCoefficient as MatrixCoefficient, matrix_coefficient as matrix_coefficient
from suboctave.model.system import System as System
