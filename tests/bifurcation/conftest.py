"""Curves that several tests look at, each computed once, and the comparison of bifurcations with stored ones."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest

import suboctave as so

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="session")
def reference():
    return json.loads((DATA / "reference.json").read_text())


@pytest.fixture(scope="session")
def chain_data():
    return json.loads((DATA / "chain.json").read_text())


@pytest.fixture(scope="session")
def oscillator_curve():
    """Response of the reference oscillator by (p, j, regularization, omega, harmonics, max_step)."""

    @cache
    def curve(p, j=0.0, regularization=None, omega=(4.5, 1.25), harmonics="adaptive", max_step=None):
        system = so.library.reference_oscillator(p=p, j=j, regularization=regularization)
        return so.frequency_response(system, omega, harmonics=harmonics, max_step=max_step)

    return curve


@pytest.fixture(scope="session")
def same_events():
    """Check that located bifurcations are the expected `[kind, omega, amplitude | None]`: none missing, none added."""

    def check(found, expected, omega, amplitude=None):
        found, expected = sorted(found, key=lambda b: b.omega), sorted(expected, key=lambda e: e[1])
        assert [b.kind for b in found] == [e[0] for e in expected]
        for b, e in zip(found, expected, strict=True):
            assert b.omega == pytest.approx(e[1], abs=omega), b.kind
            assert b.residual < 1e-10
            if amplitude is not None and e[2] is not None:
                assert b.amplitude == pytest.approx(e[2], abs=amplitude), b

    return check
