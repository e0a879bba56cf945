"""Units that a system declares: which sets hold together, and where they go."""

from __future__ import annotations

import pytest

import suboctave as so
from suboctave.model.system import build, describe
from suboctave.units import UnitSystem


@pytest.mark.parametrize(
    ("given", "force", "mass", "time"),
    [
        ("mm, N, s", "N", "t", "s"),
        ("m kg s", "N", "kg", "s"),
        ("mm, t, s", "N", "t", "s"),
        ("s; mm; N; t", "N", "t", "s"),
        ("mm, kg, ms", "kN", "kg", "ms"),
        ("um, uN, ms", "µN", "mg", "ms"),
        ("in, lbf, sec", "lbf", "slinch", "s"),
        ("ft, slug, s", "lbf", "slug", "s"),
    ],
)
def test_the_missing_one_of_force_and_mass_follows(given, force, mass, time):
    units = UnitSystem.of(given)
    assert (units.force, units.mass, units.time) == (force, mass, time)
    assert UnitSystem.of(str(units)) == units


def test_a_force_without_a_name_is_written_out():
    units = UnitSystem.of("ft, kg, min")
    assert units.name("force") == "kg ft/min²"
    assert UnitSystem.of(str(units)) == units


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("mm, kg, N, s", "masses are in t, not in kg"),
        ("mm, N", "no unit of time"),
        ("mm, s", "no unit of force or mass"),
        ("mm, cm, N, s", "both units of length"),
        ("mm, Nn, s", "did you mean"),
        (7, "units must be a text, not 7"),
    ],
)
def test_sets_that_do_not_hold_together_are_refused(given, words):
    with pytest.raises(so.InputError, match=words):
        so.library.duffing().with_units(given)


def test_units_of_what_is_made_of_them():
    units = UnitSystem.of("mm, N, s")
    named = [units.name(d) for d in ("length / time^2", "energy", "1", "rad", "length * sqrt(mass)")]
    assert named == ["mm/s²", "N mm", "", "rad", "mm sqrt(t)"]
    assert (units.frequency, units.cycles) == ("rad/s", "Hz")


def test_a_system_keeps_its_units_wherever_it_goes(tmp_path):
    system = so.System(1.0, 0.04, 1.0, [so.CubicSpring(0, "a")], [so.HarmonicLoad(0, 0.1)], {"a": 0.5}, units="m, N, s")
    for other in (system.with_parameters(a=1.0), system.undamped(), build(describe(system))):
        assert other.units == system.units
    assert "units" not in describe(system.with_units(None))
    curve = so.frequency_response(system, (0.9, 1.1), harmonics=3)
    dataset = so.load(curve.save(tmp_path / "curve.nc")).to_xarray(readings=["velocity"])
    units = {name: dataset[name].attrs["units"] for name in ("omega", "amplitude", "velocity")}
    assert units == {"omega": "rad/s", "amplitude": "m", "velocity": "m/s"}
    assert so.System.from_equations("x'' + 0.1*x' + x = cos(omega*t)", units="mm N s").units.mass == "t"


def test_numbers_do_not_depend_on_them():
    system = so.library.duffing()
    plain, named = (so.frequency_response(s, (0.9, 1.1), harmonics=3) for s in (system, system.with_units("mm, N, s")))
    assert (plain.omega == named.omega).all()
    assert (plain.amplitude == named.amplitude).all()
