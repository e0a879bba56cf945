"""Structures of many modes, most of them far too fast for the harmonics, and motions of them."""

import numpy as np

import suboctave as so
from suboctave.harmonic import HarmonicBalance, HarmonicBasis

STIFFNESS, GAPS = 10.0, (0.5, 0.6)


def damping_of(kind, frequencies, rng):
    if kind == "stiffness-proportional":  # fast modes are overdamped
        return np.diag(0.01 * (1.0 + frequencies**2))
    damping = np.diag(0.03 * frequencies)
    if kind == "full":
        damping += sum(0.02 * np.outer(d, d) for d in rng.normal(size=(3, len(frequencies))))
    return damping


def structure(n, top, channels, kind, seed, element=None):
    """Modes of frequencies from 1 to `top`, channels that see all of them, and the directions of these."""
    rng = np.random.default_rng(seed)
    frequencies = np.geomspace(1.0, top, n)
    directions = rng.uniform(0.4, 1.0, (channels, n)) * rng.choice([-1.0, 1.0], (channels, n))
    directions[:, 0] = 1.0
    pairs = zip(directions, GAPS, strict=False)
    elements = [element(d) if element else so.ElasticStop(None, STIFFNESS, gap, direction=d) for d, gap in pairs]
    load = so.HarmonicLoad(direction=np.eye(n)[0], amplitude=1.0)
    system = so.System(np.eye(n), damping_of(kind, frequencies, rng), np.diag(frequencies**2), elements, [load])
    return system, directions


def motion_of(system, harmonics, omega, seed):
    """A motion that is given, not solved for: a few harmonics of the slow modes."""
    x = np.zeros((2 * harmonics + 1, system.n))
    x[1, 0], x[4, 0] = 1.3, 0.2
    x[:5, :3] += 0.1 * np.random.default_rng(seed).normal(size=(5, 3))
    return HarmonicBalance(system, HarmonicBasis(harmonics)).at(x, omega)


def displacement(state, direction, tau):
    c, k = state.x @ direction, np.arange(1, state.basis.harmonics + 1)
    return c[0] + np.cos(tau * k) @ c[1::2] + np.sin(tau * k) @ c[2::2]
