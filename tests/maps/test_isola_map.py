"""Isolas over two design parameters: against searches of their own, a region that closes, what is not known."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import suboctave as so

OMEGA = (1.3, 4.5)
#: few: both sides of a comparison have them
HARMONICS = 9
#: the second parameters of the check, with their ranges and five values each, drawn once
SECOND = {"Kc": (2.0, 8.0), "p": (0.35, 0.8)}
DRAWN = {
    name: [float(v) for v in np.random.default_rng(seed).uniform(*ends, 5)]
    for seed, (name, ends) in enumerate(SECOND.items(), 2026)
}
CASES = [pytest.param(name, value, id=f"{name}={value:.3f}") for name, values in DRAWN.items() for value in values]


def reference(**values):
    return so.library.reference_oscillator(regularization=3000.0, **values)


@pytest.fixture(scope="module")
def isolas():
    return so.find_isolas(reference(), OMEGA, "j", (0.0, 1.0), harmonics=HARMONICS, values=[0.1])


@pytest.fixture(scope="module")
def map_over(isolas):
    """The map over a second parameter, made once."""

    @cache
    def made(name):
        return so.isola_map(isolas, name, SECOND[name], probes=0)

    return made


@pytest.mark.slow
@pytest.mark.parametrize(("name", "value"), CASES)
def test_birth_and_merging_by_searches_of_their_own(map_over, name, value):
    """Nothing of the map goes into such a search: it begins with responses at other values of the parameter."""
    found = so.find_isolas(reference(**{name: value}), OMEGA, "j", (0.0, 1.0), harmonics=HARMONICS, values=[0.1])
    (isola,) = (one for one in found if one.nu == 2)
    ((low, high),) = map_over(name).ranges(value)
    assert (low, high) == pytest.approx((float(isola.merges), float(isola.born)), abs=2e-5)


def test_the_answer_does_not_depend_on_where_one_stands(isolas):
    """From another value, the other way along both ranges."""
    (found,) = so.find_isolas(
        reference(j=0.3), (4.2, 1.9), "j", (1.0, 0.0), harmonics=HARMONICS, values=[0.1], levels=()
    )
    (isola,) = isolas
    assert found.range == pytest.approx(isola.range, abs=1e-9)


def test_what_the_map_contains(map_over):
    chosen = map_over("p")
    assert (chosen.parameter, chosen.second, chosen.notes) == ("j", "p", ())
    ((low, high),) = chosen.ranges(0.5)
    assert chosen.contains(j=0.5 * (low + high), p=0.5)
    assert not chosen.contains(j=low - 0.01, p=0.5)
    assert not chosen.contains(p=0.5, j=high + 0.01)
    assert {nature for curve in chosen.born for nature in curve.isola} == {"isola_centre"}
    assert {nature for curve in chosen.merges for nature in curve.isola} == {"isola_merging"}
    with pytest.raises(so.InputError, match="did you mean 'p'"):
        chosen.contains(j=0.3, pp=0.5)
    with pytest.raises(so.InputError, match="both as numbers"):
        chosen.contains(j=0.3)
    with pytest.raises(so.InputError, match=r"from p = 0\.35 to 0\.8"):
        chosen.contains(j=0.3, p=0.9)


def test_a_region_that_closes(isolas, tmp_path):
    """With more damping birth and merging meet; closed branches followed within the region say the same."""
    found = so.isola_map(isolas, "zeta", (0.2, 0.02))
    (region,) = found.regions
    assert region.span.closed == (False, True)
    assert found.notes == ()
    assert len(region.probes) == 3
    assert all(probe.agrees for probe in region.probes)
    (curve,) = region.curves
    (meeting,) = (e for e in curve.extrema if e.parameter_name == "zeta")
    low, high = region.span.range(region.span.high)
    assert (low, high) == pytest.approx((meeting.parameter("j"),) * 2, abs=1e-6)
    assert found.ranges(0.19) == []
    assert not found.contains(j=0.15, zeta=0.19)
    table = found.to_table()
    assert set(table["border"]) == {"birth (isola centre)", "merging"}
    found.plot(tmp_path / "map.png", title="Isola")
    assert (tmp_path / "map.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("named", "words"),
    [
        ({"parameter": "KC"}, "did you mean 'Kc'"),
        ({"parameter": "j"}, "another one than j"),
        ({"parameter": "omega"}, "another one than j"),
        ({"bounds": (5.0, 8.0)}, "outside the bounds"),
        ({"probes": -1}, "probes must be"),
        ({"probes": [20.0]}, "probes must be"),
        ({"isolas": []}, "what find_isolas gave"),
        ({"isolas": 3}, "must be an Isola"),
    ],
)
def test_what_is_refused(isolas, named, words):
    given = {"isolas": isolas, "parameter": "Kc", "bounds": (2.0, 8.0), **named}
    with pytest.raises(so.InputError, match=words):
        so.isola_map(**given)
