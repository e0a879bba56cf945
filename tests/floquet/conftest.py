"""Motions that several tests look at, each with the multipliers that shooting finds for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import suboctave as so
from suboctave.errors import ConvergenceError
from suboctave.model import AdaptiveSampling, Element
from suboctave.timedomain import shoot


@dataclass(frozen=True, eq=False)
class Draw:
    """A motion of a response curve and its multipliers by shooting."""

    name: str
    orbit: so.PeriodicOrbit

    @cached_property
    def exact(self):
        return self.shot.multipliers

    @cached_property
    def shot(self):
        return shoot(self.orbit.balance.system, self.orbit.start(), self.orbit.omega)

    @property
    def stable(self):
        return bool(np.all(np.abs(self.exact) < 1.0))


def reference_curves():
    """Name, system, range of omega: weak and strong forcing, regularised and exact stops, an absorber, Duffing."""
    for p, j in ((0.55, 0.0), (0.55, 1.0), (1.7, 0.0)):
        for s in (3000.0, None):
            system = so.library.reference_oscillator(p=p, j=j, regularization=s)
            yield f"p={p} j={j} s={s}", system, (4.5, 1.25)
    for force in (0.11, 0.12):
        yield f"absorber F={force}", so.library.nltva(force), (0.8, 1.5)
    yield "Duffing", so.library.duffing(), (0.3, 6.0)


def drawn(harmonics, each, seed, rounded=None):
    """Up to `each` stable and `each` unstable motions of every reference curve, and which of them the curve calls so.

    `rounded`: how many of those with regularised stops, which shooting takes longest for.
    """
    rng = np.random.default_rng(seed)
    found = []
    for name, system, omega in reference_curves():
        curve = so.frequency_response(system, omega, harmonics=harmonics)
        for wanted in (curve.stable, ~curve.stable):
            places = np.flatnonzero(wanted)
            count = each if rounded is None or not name.endswith("s=3000.0") else rounded
            for i in rng.choice(places, min(count, len(places)), replace=False):
                orbit = curve.orbits[i]
                found.append((bool(curve.stable[i]), Draw(f"{name} omega={orbit.omega:.4f}", orbit)))
    return found


class Drag(Element):
    """f = (c + d u^2) v + e v^3, of which nothing is told: sampled blindly."""

    coefficient_names = ("c", "d", "e")
    depends_on_velocity = True

    def sampling(self, c):
        return AdaptiveSampling()

    def tangent(self, u, v, c):
        c, d, e = c
        return (c + d * u**2) * v + e * v**3, 2 * d * u * v, c + d * u**2 + 3 * e * v**2

    def curvature(self, u, v, c):
        return 2 * c[1] * v, 2 * c[1] * u, 6 * c[2] * v

    def coefficient_tangent(self, u, v, c):
        zero = np.zeros_like(u)
        return np.array([v, u**2 * v, v**3]), np.array([zero, 2 * u * v, zero]), np.array([zero + 1, u**2, 3 * v**2])

    def coefficient_curvature(self, u, v, c):
        return np.zeros((3, 3, len(u)))


def random_system(rng):
    """One to three masses in a row with coupled inertia, gyroscopic and circulatory terms at times, and one or two
    elements: cubic springs, exact and regularised stops, drag; between a mass and the ground or between masses.
    """
    n = int(rng.integers(1, 4))
    side = np.eye(n, k=1) + np.eye(n, k=-1)
    mass = np.diag(rng.uniform(0.5, 2.0, n)) + 0.1 * rng.uniform() * side
    springs = rng.uniform(0.5, 2.0, n)
    between = np.diag(springs[1:], 1)
    stiffness = np.diag(springs + np.append(springs[1:], 0.0)) - between - between.T
    damping = rng.uniform(0.01, 0.06) * stiffness + rng.uniform(0.0, 0.02) * mass
    if n > 1 and rng.uniform() < 0.5:
        gyroscopic = rng.normal(size=(n, n))
        damping = damping + 0.1 * (gyroscopic - gyroscopic.T)
    if n > 1 and rng.uniform() < 0.3:
        stiffness = stiffness + 0.1 * rng.normal(size=(n, n))
    elements = []
    for _ in range(int(rng.integers(1, 3))):
        dof = int(rng.integers(n))
        at = (dof, (dof + 1) % n) if n > 1 and rng.uniform() < 0.3 else dof
        sharp = 10.0 ** rng.uniform(1.0, 3.5)
        k, gap = rng.uniform(1.0, 8.0), rng.uniform(0.05, 1.0)
        elements.append(
            [
                so.CubicSpring(at, rng.uniform(0.1, 1.0)),
                so.ElasticStop(at, k, gap),
                so.ElasticStop(at, k, -gap, regularization=sharp),
                so.ElasticStop(at, k, gap, regularization=sharp),
                Drag(at, [0.02, rng.uniform(0.0, 0.3), rng.uniform(0.0, 0.05)]),
            ][int(rng.integers(5))]
        )
    return so.System(mass, damping, stiffness, elements, [so.HarmonicLoad(int(rng.integers(n)), rng.uniform(0.2, 1.5))])


def random_motions(seed, count) -> Iterator[Draw]:
    """A stable and an unstable motion, where there is one, of short response curves of random systems."""
    rng = np.random.default_rng(seed)
    while count > 0:
        system = random_system(rng)
        mass, _, stiffness = system.matrices()
        lowest = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(mass, stiffness)))).min()
        omega = lowest * rng.uniform(0.7, 3.0)
        harmonics = int(rng.choice([7, 15, 31]))
        try:
            curve = so.frequency_response(system, (1.3 * omega, omega), harmonics=harmonics)
        except ConvergenceError:
            continue
        for places in (np.flatnonzero(curve.stable), np.flatnonzero(~curve.stable)):
            if not places.size:
                continue
            orbit = curve.orbits[rng.choice(places)]
            drawn = Draw(f"{system.n} DOFs, H={harmonics}", orbit)
            try:
                state = drawn.shot.state
            except ConvergenceError:
                continue
            # with few harmonics shooting may run into another motion
            if np.abs(state - orbit.start()).max() < 0.02 * np.abs(orbit.start()).max():
                yield drawn
                count -= 1


def distances(found, exact):
    """Distance of every multiplier found from its partner, under the best pairing."""
    cost = np.abs(np.asarray(found)[:, None] - np.asarray(exact)[None, :])
    rows, columns = linear_sum_assignment(cost)
    result = np.empty(len(cost))
    result[rows] = cost[rows, columns]
    return result


@pytest.fixture(name="distances", scope="session")
def _distances():
    return distances


@pytest.fixture(name="draw", scope="session")
def _draw():
    return cache(drawn)


@pytest.fixture(name="random_motions", scope="session")
def _random_motions():
    return cache(lambda seed, count: list(random_motions(seed, count)))


@pytest.fixture(scope="session")
def fifty():
    """Fifty motions with 31 harmonics, half of them unstable, from all reference curves."""
    found = drawn(31, 5, seed=7, rounded=2)
    halves = [[draw for stable, draw in found if stable is wanted][:25] for wanted in (True, False)]
    assert [len(half) for half in halves] == [25, 25]
    return [*halves[0], *halves[1]]


@pytest.fixture(scope="session")
def at():
    """The motion near an orbit at another frequency, by Newton's method."""

    def solved(orbit, omega):
        balance, x = orbit.balance, orbit.coefficients.copy()
        for _ in range(20):
            state = balance.at(x, omega, orbit.values)
            x -= np.linalg.solve(state.jacobian, state.residual).reshape(x.shape)
        return replace(orbit, x=x, omega=omega)

    return solved


@pytest.fixture(scope="session")
def drag():
    return Drag
