"""The integrators against the closed form of a piecewise-linear oscillator: matrix exponentials between contacts."""

import numpy as np
import pytest
from scipy.linalg import expm

import suboctave as so
from suboctave.timedomain import shoot
from suboctave.timedomain.flow import Flow

ZETA, KC, J, P, OMEGA = 0.03, 4.7, 0.2, 0.55, 2.3


def _rates(region: int) -> np.ndarray:
    """A of z' = A z, z = (x, v, cos omega t, sin omega t, 1), between the stops (0) or at one of them (1, -1)."""
    a = np.zeros((5, 5))
    a[0, 1] = 1.0
    a[1] = [-1.0 - KC * abs(region), -2.0 * ZETA, P, 0.0, KC * {0: 0.0, 1: J, -1: -1.0}[region]]
    a[2, 3], a[3, 2] = -OMEGA, OMEGA
    return a


def _region(x: float) -> int:
    return 1 if x > J else -1 if x < -1.0 else 0


def closed_form(state: np.ndarray, periods: int) -> tuple[np.ndarray, int]:
    """The state (2,) after whole periods of the load, and how many contacts opened and closed."""
    z, t, end = np.array([*state, 1.0, 0.0, 1.0]), 0.0, 2.0 * np.pi * periods / OMEGA
    region, met = _region(state[0]), 0
    pace = 2.0 * np.pi / OMEGA / 400
    while t < end:
        a = _rates(region)
        h = min(pace, end - t)
        over = expm(a * h) @ z
        if _region(over[0]) == region:
            z, t = over, (end if h == end - t else t + h)
            continue
        gap = {1: J, -1: -1.0}[region or _region(over[0])]
        low, high, s = 0.0, h, h
        for _ in range(60):  # Newton's method, kept within a bracket
            at = expm(a * s) @ z
            beyond = _region(at[0]) != region
            low, high = (low, s) if beyond else (s, high)
            step = s - (at[0] - gap) / at[1]
            if abs(step - s) < 1e-16:
                break
            s = step if low <= step <= high else 0.5 * (low + high)
        z, t, met = expm(a * s) @ z, t + s, met + 1
        z[0] = gap
        z[2:4] = np.cos(OMEGA * t), np.sin(OMEGA * t)
        region = 0 if region else _region(gap + np.copysign(1e-9, z[1]))
    return z[:2], met


@pytest.fixture(scope="module")
def told():
    """States, those after three periods, and contacts met."""
    states = np.random.default_rng(0).uniform(-1.0, 1.0, (24, 2))
    ends, met = zip(*(closed_form(state, 3) for state in states), strict=True)
    return states, np.array(ends), met


@pytest.mark.parametrize("tangents", [0, 2])
def test_contacts_leave_no_floor_of_the_error(told, tangents):
    system = so.library.reference_oscillator(zeta=ZETA, alpha=0.0, Kc=KC, j=J, p=P)
    states, true, met = told
    assert min(met) >= 2
    assert max(met) >= 8
    for tolerance, allowed in ((1e-8, 1e-6), (1e-10, 1e-8), (1e-12, 1e-11), (1e-13, 2e-12)):
        flow = Flow(system, "accurate", tolerance=tolerance, tangents=tangents)
        found = flow.over(states, OMEGA, 3, workers=1).end
        assert np.abs(found - true).max() < allowed, tolerance


def test_shooting_agrees_with_the_closed_form():
    system = so.library.reference_oscillator(zeta=ZETA, alpha=0.0, Kc=KC, j=J, p=P)
    flow = Flow(system, "accurate", tolerance=1e-12)
    settled = flow.over(np.array([3.0, 3.0]), OMEGA, 300, skip=299, workers=1).end[0]
    motion = shoot(system, settled, OMEGA, periods=2)
    after, met = closed_form(motion.state, 2)
    assert met == 2
    assert np.abs(after - motion.state).max() < 1e-11
