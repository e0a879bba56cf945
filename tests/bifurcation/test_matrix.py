"""The same bifurcations at any largest step and in both directions: none missed, none added.

Every run of a curve is held against all events that the run with the smallest steps found, and these against shooting
where they are known from it.
"""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so

#: two events are the same within this in omega: what the tolerance of located events leaves
SAME = 3e-6
COARSE = (None, 0.3)
FINE = (0.01, 0.03, 0.1)


def curves():
    """Name, system, range of omega of nine reference curves."""
    for p, j in ((0.55, 0.0), (0.55, 1.0), (1.7, 0.0)):
        for s in (3000.0, None):
            name = f"p={p:g} j={j:g} " + ("exact" if s is None else f"s={s:g}")
            yield name, so.library.reference_oscillator(p=p, j=j, regularization=s), (1.25, 4.5)
    for force in (0.11, 0.12):
        yield f"absorber F={force:g}", so.library.nltva(force), (0.8, 1.5)
    yield "Duffing", so.library.duffing(), (0.3, 6.0)


#: kinds in order of omega. The first six: shooting (tests/data/reference.json), with the doubling at 1.2502494 where
#: the law is exact; the absorber: Detroux, Habib, Masset, Kerschen, Mech. Syst. Signal Process. 60-61 (2015)
EXPECTED = {
    "p=0.55 j=0 s=3000": "LP PD LP PD",
    "p=0.55 j=0 exact": "PD LP PD LP PD",
    "p=0.55 j=1 s=3000": "LP LP",
    "p=0.55 j=1 exact": "LP LP",
    "p=1.7 j=0 s=3000": "PD PD LP PD LP PD",
    "p=1.7 j=0 exact": "PD PD LP PD LP PD",
    "absorber F=0.11": "NS NS LP LP",
    "absorber F=0.12": "NS LP NS LP",
    "Duffing": "LP LP BP BP LP LP",
}
#: one of each law and of each number of events; the others are slow
SOME = ("Duffing", "p=0.55 j=1 exact", "p=1.7 j=0 s=3000")
each_curve = pytest.mark.parametrize(
    ("name", "system", "omega"),
    [pytest.param(*one, id=one[0], marks=[] if one[0] in SOME else [pytest.mark.slow]) for one in curves()],
)


def events(curve):
    return sorted((b.omega, b.kind) for b in curve.bifurcations)


def runs(system, omega, steps):
    for step in steps:
        for ends in (omega, omega[::-1]):
            yield (step, ends), so.frequency_response(system, ends, max_step=step)


def compare(name, found):
    """Each list of events against the first."""
    first = None
    for run, curve in found:
        mine = events(curve)
        assert " ".join(kind for _, kind in mine) == EXPECTED[name], run
        first = first or mine
        assert [w for w, _ in mine] == pytest.approx([w for w, _ in first], abs=SAME), run
        assert not [note for note in curve.warnings if "explain" in note], run
        # one entry for each change of stability, and the other way round
        places = [b.arclength for b in curve.bifurcations]
        for low, high in zip([-np.inf, *places], [*places, np.inf], strict=True):
            between = curve.stable[(curve.arclength > low + 1e-4) & (curve.arclength < high - 1e-4)]
            assert between.all() or not between.any(), (run, low, high)


@each_curve
def test_any_largest_step_and_direction(name, system, omega):
    compare(name, runs(system, omega, COARSE))


@pytest.mark.slow
@each_curve
def test_small_steps_too(name, system, omega):
    compare(name, runs(system, omega, (*FINE, *COARSE)))
