"""Curves in closed form, so that pictures are tested without any solver."""

import numpy as np
import pytest
from scipy.optimize import brentq

from suboctave.store.layout import EventRow, curve_dataset


def duffing(stiffness=1.0, damping=0.1, cubic=0.1, force=0.4, points=60, named="F"):
    """One-harmonic response of a Duffing oscillator, by amplitude A: with kappa = k + 3/4 cubic A^2,

    omega^2 = kappa - c^2/2 +- sqrt(F^2/A^2 - c^2 kappa + c^4/4), folds where d omega / dA = 0.
    """

    def kappa(a):
        return stiffness + 0.75 * cubic * a**2

    def discriminant(a):
        return force**2 / a**2 - damping**2 * kappa(a) + damping**4 / 4

    def frequency(a, sign):
        return np.sqrt(kappa(a) - damping**2 / 2 + sign * np.sqrt(np.maximum(discriminant(a), 0.0)))

    def slope(a):
        return frequency(a * (1 + 1e-6), 1) - frequency(a * (1 - 1e-6), 1)

    peak = brentq(discriminant, 1e-3, 1e3)
    scan = np.linspace(0.05, 1 - 1e-5, 4000) * peak
    signs = np.sign([slope(a) for a in scan])
    folds = [brentq(slope, scan[i], scan[i + 1]) for i in np.flatnonzero(np.diff(signs))]

    right = peak * np.sin(np.linspace(0.07, np.pi / 2, points))
    left = peak * np.sin(np.linspace(np.pi / 2, 0.35, points))[1:]
    amplitude = np.concatenate([right, left])
    omega = np.concatenate([frequency(right, 1), frequency(left, -1)])
    stable = np.ones(amplitude.size, dtype=bool)
    if folds:
        stable[:points] = (right < folds[0]) | (right > folds[1])
    events = [
        EventRow("LP", int(np.searchsorted(right, a)) - 1, float(frequency(a, 1)), float(a), 1e-12, 1.0 + 0j)
        for a in folds
    ]
    return curve_dataset(
        omega,
        amplitude,
        stable=stable,
        parameters={"c": damping, "alpha": cubic, named: force},
        events=events,
        system="Duffing",
    )


@pytest.fixture(name="duffing")
def _duffing():
    return duffing
