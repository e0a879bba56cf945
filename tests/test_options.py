"""Options that verbs share: listed in signatures and help, and refused where they are misspelt."""

from __future__ import annotations

import inspect

import pytest

import suboctave as so

CURVE = {"max_step", "observe", "newton", "stepping", "stability", "formulation", "events", "progress", "seconds"}
TRACK = CURVE - {"events"}
SEARCH = TRACK - {"formulation"}


@pytest.mark.parametrize(
    ("verb", "options"),
    [
        (so.frequency_response, CURVE),
        (so.continue_branch, CURVE),
        (so.switch_branch, CURVE),
        (so.bifurcation_diagram, CURVE),
        (so.find_subharmonics, CURVE),
        (so.track, TRACK),
        (so.find_isolas, SEARCH),
        (so.regime_map, SEARCH),
    ],
)
def test_every_option_is_in_the_signature_and_in_the_help(verb, options):
    parameters = inspect.signature(verb).parameters
    assert options <= set(parameters)
    assert all(p.kind is not p.VAR_KEYWORD for p in parameters.values())
    lines = [line.strip() for line in verb.__doc__.splitlines()]
    for name in options:
        assert lines.count(name) == 1
        assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY
        assert parameters[name].default is None
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'max_stp' \(did you mean 'max_step'\?\)"):
        verb(max_stp=0.1)
    with pytest.raises(TypeError, match="unexpected keyword argument 'colour'; known: "):
        verb(colour="red")


RECOGNITION = {"tolerance", "period_tolerance", "observe", "progress", "seconds"}
SECTIONS = RECOGNITION | {"workers", "method", "steps_per_period"}


@pytest.mark.parametrize(
    ("verb", "options", "misspelt"),
    [
        (so.integrate, {"progress", "seconds", "tolerance"}, "tolerence"),
        (so.poincare_sections, SECTIONS, "observed"),
        (so.brute_force_diagram, SECTIONS, "worker"),
        (so.stepped_sine, RECOGNITION, "period_tolerence"),
        (so.basins, RECOGNITION | {"workers"}, "observed"),
        (so.lyapunov_exponents, {"workers", "progress", "seconds"}, "worker"),
        (so.lyapunov_map, {"workers", "progress", "seconds"}, "worker"),
    ],
)
def test_options_of_experiments_are_in_the_signature_and_misspelt_ones_refused(verb, options, misspelt):
    parameters = inspect.signature(verb).parameters
    assert options <= set(parameters)
    assert all(p.kind is not p.VAR_KEYWORD for p in parameters.values())
    with pytest.raises(TypeError, match=f"unexpected keyword argument '{misspelt}' .did you mean"):
        verb(**{misspelt: 1})
