"""The stored chain of ten masses (benchmarks/chain_by_shooting.py): checked by matrix exponentials, and found again."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import suboctave as so
from suboctave.errors import ConvergenceError
from suboctave.timedomain import integrate, locate_by_shooting, shoot
from suboctave.timedomain.locate import Curve

DATA = json.loads((Path(__file__).parents[1] / "data" / "chain.json").read_text())
N = DATA["masses"]


def matrices():
    stiffness = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    stiffness[-1, -1] = 1.0
    return DATA["damping"]["of_mass"] * np.eye(N) + DATA["damping"]["of_stiffness"] * stiffness, stiffness


def chain():
    damping, stiffness = matrices()
    stop = so.ElasticStop(dof=N - 1, stiffness=DATA["stop"]["stiffness"], gap=DATA["stop"]["gap"])
    return so.System(np.eye(N), damping, stiffness, [stop], [so.HarmonicLoad(dof=0, amplitude=DATA["force"])])


@pytest.mark.parametrize("entry", DATA["bifurcations"], ids=lambda e: f"{e['kind']}-{e['omega']:.6f}")
def test_stored_motions_by_matrix_exponentials(entry):
    """Between contacts the chain is linear: state and load together go by an exponential, with no integrator at all."""
    system, omega, start = chain(), entry["omega"], np.array(entry["state"])
    period = 2 * np.pi / omega
    contacts = integrate(system, start, (0.0, period), omega).contacts
    damping, stiffness = matrices()
    gap, stop = DATA["stop"]["gap"], DATA["stop"]["stiffness"]

    def generator(closed):
        """Of (x, v, cos omega t, sin omega t, 1)."""
        a = np.zeros((2 * N + 3, 2 * N + 3))
        a[:N, N : 2 * N] = np.eye(N)
        a[N : 2 * N, :N] = -stiffness
        a[N : 2 * N, N : 2 * N] = -damping
        a[N, 2 * N] = DATA["force"]
        a[2 * N, 2 * N + 1], a[2 * N + 1, 2 * N] = -omega, omega
        if closed:
            a[2 * N - 1, N - 1] -= stop
            a[2 * N - 1, 2 * N + 2] += stop * gap
        return a

    state, transition, time = np.concatenate([start, [1.0, 0.0, 1.0]]), np.eye(2 * N), 0.0
    closed = start[N - 1] > gap
    for contact in [*contacts, None]:
        until = period if contact is None else contact.time
        step = expm((until - time) * generator(closed))
        state, transition, time = step @ state, step[: 2 * N, : 2 * N] @ transition, until
        if contact is not None:
            assert state[N - 1] == pytest.approx(gap, abs=1e-11)
            assert contact.closing != closed
            closed = contact.closing
    assert state[: 2 * N] == pytest.approx(start, abs=2e-11)
    multipliers = np.linalg.eigvals(transition)
    stored = np.array([complex(*mu) for mu in entry["multipliers"]])
    for mu in stored[np.abs(stored) > 0.5]:
        assert np.min(np.abs(multipliers - mu)) < 1e-8
    critical = {"LP": np.abs(multipliers - 1.0), "PD": np.abs(multipliers + 1.0)}
    distance = critical.get(entry["kind"], np.abs(np.abs(multipliers[np.abs(multipliers.imag) > 1e-3]) - 1.0))
    assert np.min(distance) < 2e-7


@pytest.mark.parametrize("entry", DATA["bifurcations"], ids=lambda e: f"{e['kind']}-{e['omega']:.6f}")
def test_stored_bifurcations_are_found_again(entry):
    rng = np.random.default_rng(0)
    start = np.array(entry["state"]) + 1e-4 * rng.standard_normal(2 * N)
    found = locate_by_shooting(chain(), entry["kind"], start, entry["omega"] * (1.0 + 1e-5), observe=N - 1)
    assert found.omega == pytest.approx(entry["omega"], abs=1e-10)
    assert found.amplitude == pytest.approx(entry["amplitude_last_mass"], rel=1e-8)


@pytest.mark.slow
def test_search_in_the_wrong_direction_turns_back():
    """At 0.4335 the multipliers nearest to -1 are still a complex pair: secants lead away from the PD at 0.4343."""
    system = chain()
    found = locate_by_shooting(system, "PD", shoot(system, np.zeros(2 * N), 0.4335).state, 0.4335)
    assert found.omega == pytest.approx(DATA["bifurcations"][0]["omega"], abs=1e-10)


def test_stored_response_is_stable_where_no_multiplier_is_outside():
    """A stable motion attracts: an integration from a disturbed start comes back to the stored amplitude."""
    entry = DATA["response"][0]
    assert entry["unstable_multipliers"] == 0
    omega = entry["omega"]
    system, period = chain(), 2 * np.pi / omega
    settled = integrate(system, np.zeros(2 * N), (0.0, 150 * period), omega, rtol=1e-9)
    last = integrate(system, settled.end, (0.0, period), omega)
    assert last.largest(N - 1) == pytest.approx(entry["amplitude_last_mass"], rel=1e-6)


def test_a_search_is_bounded_by_reach_and_by_passes(monkeypatch):
    """What is not there is given up; what is there is found within the bounds as without them."""
    spent = []
    evaluate = Curve.evaluate
    monkeypatch.setattr(Curve, "evaluate", lambda curve, u: (spent.append(1), evaluate(curve, u))[1])
    entry = next(e for e in DATA["bifurcations"] if e["kind"] == "PD")
    near = entry["state"], entry["omega"] * (1.0 + 1e-5)
    free = locate_by_shooting(chain(), "PD", *near)
    bound = locate_by_shooting(chain(), "PD", *near, reach=0.1, budget=60)
    assert bound.omega == free.omega
    del spent[:]
    with pytest.raises(ConvergenceError, match=r"within 0\.02 of the motion's size"):
        locate_by_shooting(chain(), "BP", *near, reach=0.02)
    assert len(spent) < 60
    del spent[:]
    with pytest.raises(ConvergenceError, match="within 10 passes"):
        locate_by_shooting(chain(), "BP", *near, budget=10)
    assert len(spent) == 10 + 1  # the one that was refused
