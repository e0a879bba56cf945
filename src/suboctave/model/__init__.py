"""What vibrates: systems, their nonlinear elements, their loads, and the published ones.

A room without any method: nothing here knows of harmonics of the response, of stability or of curves.
"""

from __future__ import annotations

from suboctave.model.derivative_check import DerivativeReport, check_derivatives
from suboctave.model.element import Element
from suboctave.model.expression import Coefficient, coefficient
from suboctave.model.loads import HarmonicLoad, LoadComponent
from suboctave.model.matrix import MatrixCoefficient, matrix_coefficient
from suboctave.model.sampling import AdaptiveSampling, Piece, PiecewiseLinear, PolynomialSampling, SharpSampling
from suboctave.model.springs import CubicSpring, PolynomialSpring
from suboctave.model.stops import ElasticStop
from suboctave.model.system import System

__all__ = [
    "AdaptiveSampling",
    "Coefficient",
    "CubicSpring",
    "DerivativeReport",
    "ElasticStop",
    "Element",
    "HarmonicLoad",
    "LoadComponent",
    "MatrixCoefficient",
    "Piece",
    "PiecewiseLinear",
    "PolynomialSampling",
    "PolynomialSpring",
    "SharpSampling",
    "System",
    "check_derivatives",
    "coefficient",
    "matrix_coefficient",
]
