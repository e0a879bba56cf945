"""A branch as a dataset: where each event lies, and what is known right after it."""

from types import SimpleNamespace

import numpy as np

from suboctave.pictures.strokes import cut, line
from suboctave.store.layout import branch_dataset


def event(kind, arclength, multipliers, critical, p=1.0):
    return SimpleNamespace(
        kind=kind,
        omega=1.0 + arclength,
        amplitude=2.0,
        residual=1e-12,
        uncertainty=0.0,
        criticality=None,
        contact=None,
        arclength=arclength,
        parameters={"p": p, "k": 3.0},
        multipliers=np.array(multipliers, dtype=complex),
        critical_multiplier=lambda: complex(critical),
        critical_error=1e-7,
        stability_method="monodromy",
    )


def branch(stable, bifurcations, events=()):
    count = len(stable)
    parameters = {"p": np.linspace(0.0, 1.0, count), "k": np.full(count, 3.0)}
    orbit = SimpleNamespace(residual=1e-11, basis=SimpleNamespace(nu=2))
    return SimpleNamespace(
        system=SimpleNamespace(n=2, name="a system", parameters={"p": 0.0, "k": 3.0}, units=None, dof_names=()),
        name="p",
        shows="response",
        orbits=[orbit] * count,
        omega=np.full(count, 2.0),
        amplitude=np.ones(count),
        stable=np.array(stable, dtype=bool),
        harmonics=np.full(count, 15),
        truncation=np.zeros(count),
        multipliers=np.zeros((count, 4), dtype=complex),
        multiplier_errors=np.full((count, 4), 1e-7),
        multiplier_open=np.zeros((count, 4), dtype=bool),
        stability_methods=["monodromy"] * count,
        arclength=np.arange(float(count)),
        bifurcations=bifurcations,
        grazings=(),
        events=events,
        closed=False,
        endings=(),
        ended="p reached 1",
        observe=1,
        options={"harmonics": "adaptive", "newton": object()},
        warnings=("one", "two"),
        parameter=parameters.__getitem__,
    )


def test_events_are_placed_and_ordered_by_arclength():
    doubling = event("PD", 2.5, [-1, 0.2], -1, p=0.6)
    dataset = branch_dataset(
        branch([1, 1, 1, 0, 0], [doubling, event("LP", 0.5, [1, 0.2], 1)], [event("mine", 3.25, [2, 0], 2)])
    )
    assert list(dataset["event_kind"].to_numpy()) == ["LP", "PD", "mine"]
    assert list(dataset["event_after"].to_numpy()) == [0, 2, 3]
    assert float(dataset["event_parameters"].sel(parameter="p")[1]) == 0.6
    assert dataset.attrs["period"] == 2
    assert dataset.attrs["observed_dof"] == 1
    assert dataset.attrs["warnings"] == "one\ntwo"
    assert all(isinstance(value, str | int | float) for value in dataset.attrs.values())  # a file can hold them


def test_an_event_at_the_very_end_lies_in_the_last_step():
    dataset = branch_dataset(branch([1, 1, 0], [event("LP", 2.0, [1, 0.2], 1)]))
    assert list(dataset["event_after"].to_numpy()) == [1]


def test_between_two_events_of_one_step_the_multipliers_tell():
    def verdicts(stable, first, second):
        data = branch_dataset(branch(stable, [first, second]))
        return [piece.stable for piece in cut(data, line(data, "p"))]

    lone = event("PD", 0.2, [-1, 0.3], -1), event("PD", 0.8, [-1, 0.3], -1)
    assert verdicts([1, 1], *lone) == [True, False, True]
    assert verdicts([0, 0], *lone) == [False, True, False]
    # Another multiplier outside: unstable on both sides, whatever crosses.
    crowded = event("PD", 0.2, [-1, 1.3], -1), event("PD", 0.8, [-1, 1.3], -1)
    assert verdicts([0, 0], *crowded) == [False]
    # A complex pair crosses together.
    pair = [0.6 + 0.8j, 0.6 - 0.8j, 0.1, 0.1]
    torus = event("NS", 0.2, pair, 0.6 + 0.8j), event("NS", 0.8, pair, 0.6 + 0.8j)
    assert verdicts([0, 0], *torus) == [False, True, False]


def test_a_users_event_changes_nothing():
    mine = event("mine", 0.2, [0.5, 0.2], 0.5)
    doubling = event("PD", 0.8, [-1, 0.3], -1)
    dataset = branch_dataset(branch([1, 0], [doubling], [mine]))
    assert [piece.stable for piece in cut(dataset, line(dataset, "p"))] == [True, False]
    assert list(dataset["event_stable_after"].to_numpy()) == [1, 0]
