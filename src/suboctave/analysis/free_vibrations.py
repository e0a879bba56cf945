"""Free vibrations by a few harmonics: the backbone of each linear mode, for guesses of motions near its resonances.

Without damping and without the loads that oscillate, motions that are at rest in a turning point at t = 0 are cosines,

    x = a_0 + a_1 cos(Omega t) + ... + a_H cos(H Omega t),

and so are the residuals of harmonic balance: (H + 1) n equations for the a_j and Omega, closed by the size of the
motion, the first harmonic along the linear mode. The mean a_0 is one of the unknowns: between one-sided stops it moves
with the size, and the frequency with it.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from suboctave.continuation.linear import length
from suboctave.continuation.problem import Array
from suboctave.curves.motion import MotionProblem
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import HarmonicBalance

#: harmonics of free vibrations: those of a mass that rebounds from a rigid wall fall with the square of their number
_HARMONICS = 5
#: sizes of free vibrations, in units of the linear response, neighbours a quarter apart
_SIZES = np.geomspace(1e-3, 1e4, 71)
#: those of about .3, 1, 3 and 10 times the linear response
_TYPICAL = [25, 30, 35, 40]
#: iterations of Newton's method for one size, and change relative to the motion at which they end: for guesses
_ITERATIONS, _CLOSE = 12, 1e-6


@dataclass(frozen=True, eq=False)
class Backbone:
    """Free vibrations that continue a linear mode, over their size; nan where none was found.

    frequencies
        Omega, (S,).
    motions
        The cosines a_0 .. a_H of each, (S, H + 1, n).
    """

    frequencies: Array
    motions: Array

    def at(self, frequency: float) -> list[Array]:
        """The free vibrations of a frequency, (H + 1, n) each, interpolated between neighbouring sizes."""
        gap = self.frequencies - frequency
        found = []
        for i in np.flatnonzero(gap[:-1] * gap[1:] < 0.0):
            share = gap[i] / (gap[i] - gap[i + 1])
            found.append((1.0 - share) * self.motions[i] + share * self.motions[i + 1])
        return found

    @property
    def typical(self) -> list[Array]:
        """Free vibrations about as large as the linear response, for motions that are near no resonance."""
        return [motion for motion in self.motions[_TYPICAL] if np.isfinite(motion).all()]


def backbones(curve: MotionProblem, count: int, highest: float) -> list[Backbone]:
    """Those of the first linear modes, as far as their frequencies are no higher than `highest`."""
    balance = curve.balance
    basis = HarmonicBasis(_HARMONICS)
    single = HarmonicBalance(balance.system, basis, balance.values, balance.linear, balance.samples)
    unit = curve.reference or 1.0
    return [_backbone(single, shape, unit * _SIZES, highest) for shape in linear_shapes(balance)[:count]]


def linear_shapes(balance: HarmonicBalance) -> list[Array]:
    """Undamped linear modes in the unknowns, unit length in the masses' weights, the slowest first."""
    from scipy.linalg import eigh

    mass, _, stiffness = balance.linear.equation_of_motion()
    _, vectors = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T))
    shapes = list((np.array([balance.linear.expand(unit) for unit in np.eye(balance.size)]) @ vectors).T)
    weight = balance.scales[0]
    return [s / length(weight * s) for s in shapes if length(weight * s) > 0.0]


def _backbone(single: HarmonicBalance, shape: Array, sizes: Array, highest: float) -> Backbone:
    """From the smallest size on, each from the one before; where that fails from the shape of the linear mode."""
    frequencies = np.full(len(sizes), np.nan)
    motions = np.full((len(sizes), _HARMONICS + 1, single.size), np.nan)
    before: tuple[float, Array, float] | None = None
    for i, size in enumerate(sizes):
        alone = np.zeros((_HARMONICS + 1, single.size))
        alone[1] = size * shape
        # where a law is not finite there is nothing
        with suppress(ConvergenceError):
            found = None if before is None else _free(single, shape, size, before[1] * (size / before[0]), before[2])
            if found is None:
                start = _balancing(single, shape, alone, highest)
                found = None if start is None else _free(single, shape, size, alone, start)
            if found is not None:
                motions[i], frequencies[i] = found
                before = float(size), *found
        if frequencies[i] > highest:
            break
    return Backbone(frequencies, motions)


def _equations(single: HarmonicBalance, motion: Array, frequency: float) -> tuple[Array, Array, Array]:
    """What is left of the cosines without loads that oscillate, and its derivatives by them and by the frequency."""
    cosines = np.r_[0, 1 : 2 * _HARMONICS : 2]
    x = np.zeros((single.basis.size, single.size))
    x[cosines] = motion
    state = single.at(x, frequency)
    rest = state.residual.reshape(x.shape)[cosines]
    rest[1:] += state.load[cosines[1:]]
    rows = (cosines[:, None] * single.size + np.arange(single.size)).ravel()
    by_frequency = np.einsum("hij,hj->hi", state.slope.real, motion)
    return rest.ravel(), state.jacobian[np.ix_(rows, rows)], by_frequency.ravel()


def _balancing(single: HarmonicBalance, shape: Array, motion: Array, start: float) -> float | None:
    """The frequency at which the first harmonic balances along a shape; None where nothing pulls the motion back."""
    rest, _, by_frequency = _equations(single, motion, start)
    own = slice(single.size, 2 * single.size)
    slope = float(shape @ by_frequency[own]) / (2.0 * start)  # by the square of the frequency
    square = start**2 - float(shape @ rest[own]) / slope if slope else -1.0
    return float(np.sqrt(square)) if square > 0.0 else None


def _free(
    single: HarmonicBalance, shape: Array, size: float, motion: Array, frequency: float
) -> tuple[Array, float] | None:
    """The free vibration of a size near a guess, and its frequency (Newton); None where there is none."""
    n, count = single.size, motion.size
    matrix = np.zeros((count + 1, count + 1))
    along = shape / (shape @ shape)
    matrix[count, n : 2 * n] = along
    for _ in range(_ITERATIONS):
        rest, slope, by_frequency = _equations(single, motion, frequency)
        matrix[:count, :count], matrix[:count, count] = slope, by_frequency
        try:
            step = np.linalg.solve(matrix, np.append(rest, along @ motion[1] - size))
        except np.linalg.LinAlgError:
            return None
        motion, frequency = motion - step[:count].reshape(motion.shape), frequency - float(step[count])
        if not (np.isfinite(motion).all() and np.isfinite(frequency) and frequency > 0.0):
            return None
        if length(step[:count]) <= _CLOSE * length(motion) and abs(step[count]) <= _CLOSE * frequency:
            return motion, frequency
    return None
