"""Curves that several tests look at are computed once."""

from __future__ import annotations

import gc
import json
import os
from pathlib import Path

import pytest

import suboctave as so

#: tests compute on one core each: what they find does not depend on it
os.environ.setdefault("SUBOCTAVE_WORKERS", "1")
#: what is collected is no garbage
gc.disable()


def pytest_collection_finish():
    """What is there once the tests are collected, stays: the collector of garbage need not look through it again."""
    gc.collect()
    gc.freeze()
    gc.enable()
    gc.set_threshold(20_000, 20, 20)


@pytest.fixture(scope="session")
def reference():
    """Numbers found by shooting, not by harmonic balance (the file says of which system)."""
    return json.loads((Path(__file__).parent / "data" / "reference.json").read_text())


@pytest.fixture(scope="session")
def duffing_curve():
    """A hardening Duffing oscillator swept down over its fold, from 3 to 0.5: LP, LP."""
    return so.frequency_response(so.library.duffing(c=0.1, F=0.3), (3.0, 0.5))


@pytest.fixture(scope="session")
def rattling_curve():
    """The reference oscillator with the exact law: PD, PD, LP, LP."""
    return so.frequency_response(so.library.reference_oscillator(), (4.5, 1.3))
