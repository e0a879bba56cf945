"""Searches divided among processes give the same bits as in one."""

from __future__ import annotations

import re

import pytest

import suboctave as so
from suboctave.store.files import digest
from suboctave.store.registry import to_datasets

SYSTEM = so.library.reference_oscillator(p=0.55, j=0.55)
SEARCH = {"omega": (2.2, 2.5), "parameter": "j", "bounds": (0.56, 0.6), "harmonics": 3, "values": 2}


def digests(item):
    """What a file would hold of a result, part by part, but for the seconds that curves took."""
    found = {}
    for name, dataset in to_datasets(item).items():
        dataset.attrs.pop("seconds", None)
        if "record" in dataset:
            dataset["record"] = (), re.sub(r'"seconds":[^,}]*', "", str(dataset["record"].item()))
        found[name] = digest(dataset)
    return found


@pytest.mark.slow
def test_isolas_on_two_processes_are_those_of_one():
    one, two = (so.find_isolas(SYSTEM, **SEARCH, levels=(1.5,), workers=workers) for workers in (1, 2))
    assert len(one) == 1
    assert digests(two) == digests(one)
    assert two.notes == one.notes
    maps = [so.isola_map(isolas, "Kc", (4.68, 4.72), probes=2, workers=w) for isolas, w in ((one, 1), (two, 2))]
    assert len(maps[0].regions[0].probes) == 2
    assert digests(maps[1]) == digests(maps[0])


def test_a_time_limit_reaches_the_search_on_processes():
    isolas = so.find_isolas(SYSTEM, **SEARCH, workers=2, seconds=0.05)
    assert isolas.interrupted
    assert not len(isolas)


def test_wrong_numbers_of_processes_are_refused():
    with pytest.raises(so.InputError, match="workers must be a positive whole number, not 0"):
        so.find_isolas(SYSTEM, **SEARCH, workers=0)


def test_a_regime_map_on_two_processes_is_that_of_one():
    asked = so.library.duffing(c=0.1, F=0.3), (0.8, 2.2), "F", (0.1, 0.4)
    one, two = (
        so.regime_map(*asked, harmonics=3, depth=0, values=2, search=(3,), workers=workers) for workers in (1, 2)
    )
    assert len(one.curves) == 2
    assert digests(two) == digests(one)
    assert two.notes == one.notes
