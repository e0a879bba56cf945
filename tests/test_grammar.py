"""One grammar for all verbs: what is followed first, then the ranges, then names; and every class that a verb gives or
takes is public.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import sys
import typing
from pathlib import Path

import numpy as np
import pytest

import suboctave as so
from suboctave.study import steps as _registered  # noqa: F401
from suboctave.study.steps.base import STEPS, Curve, Step

ROOT = Path(__file__).parents[1]
VERBS = {name: getattr(so, name) for name in so.__all__ if inspect.isfunction(getattr(so, name))}
#: ranges, in the order in which they stand
RANGES = ["omega", "parameter", "bounds"]
#: verbs that look at curves or read files; all others compute
PICTURES = {name for name, verb in VERBS.items() if verb.__module__.startswith("suboctave.pictures")}
FILES = {"load", "read_measured", "read_structure"}
COMPUTING = VERBS.keys() - PICTURES - FILES
#: what is done with one solved motion, one law or one structure, in a moment
MOMENTARY = {"check_derivatives", "condense", "sensitivity", "stability"}
#: what verbs take, and systems: what is in these belongs to those who write laws and studies
TAKEN = {
    "View",
    "ProjectedSystem",
    "BaseElement",
    "Formulation",
    "Keeper",
    "StabilityMethod",
    "Study",
    "UnitSystem",
    "BalanceState",
    "Stored",
}
#: names that arguments had, and those that they have now
FORMER = {
    "state": "start", "states": "start", "rest": "start", "settle": "transient", "measure": "periods",
    "steps": "values", "count": "values", "counts": "grid", "order": "subharmonic", "rtol": "tolerance",
}  # fmt: skip


def placed(verb):
    """The names of the arguments that are given by place."""
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return [p.name for p in inspect.signature(verb).parameters.values() if p.kind in kinds]


def default(verb, name):
    return inspect.signature(verb).parameters[name].default


@pytest.mark.parametrize("name", sorted(COMPUTING))
def test_what_is_followed_then_ranges_then_names(name):
    first, *others = placed(VERBS[name])
    allowed = ["parameters"] if name == "sweep" else RANGES
    assert first not in RANGES
    assert others == [one for one in allowed if one in others]
    assert ("parameter" in others) == ("bounds" in others)
    given = inspect.signature(VERBS[name]).parameters
    if "omega" in given and given["omega"].default is inspect.Parameter.empty:
        assert others[0] == "omega"
    if "parameter" in given:
        assert others[-2:] == ["parameter", "bounds"]


@pytest.mark.parametrize("name", sorted(PICTURES | FILES))
def test_what_is_drawn_or_read_then_its_file(name):
    others = placed(VERBS[name])[1:]
    assert others in ([], ["path"], ["fields"], ["field", "path"], ["snapshots", "path"], ["fields", "path"])


@pytest.mark.parametrize("name", sorted(COMPUTING - MOMENTARY))
def test_one_default_of_progress_limit_and_workers(name):
    given = inspect.signature(VERBS[name]).parameters
    assert {"progress", "seconds"} <= given.keys()
    assert all(given[one].default is None for one in ("progress", "seconds", "workers") if one in given)


@pytest.mark.parametrize("name", sorted(COMPUTING))
def test_no_former_names(name):
    given = inspect.signature(VERBS[name]).parameters.keys()
    others = {"lyapunov_exponents": {"count"}, "sweep": {"measure"}}.get(name, set())
    assert not given & FORMER.keys() - others
    if "start" in given and name not in ("continue_branch", "limit_cycles"):  # there it is what is followed
        assert default(VERBS[name], "start") in (None, inspect.Parameter.empty)


def test_a_value_too_many_by_place_is_answered_with_names():
    system = so.library.duffing()
    with pytest.raises(TypeError, match=r"takes system, omega by place, not 3 values: give others by name \(depth="):
        so.bifurcation_diagram(system, (1.0, 2.0), 9)
    with pytest.raises(TypeError, match=r"takes units by place, not 2 values$"):
        system.with_units("m", "s")


@pytest.mark.parametrize("kind", sorted(kind for kind, step in STEPS.items() if hasattr(step, "verb")))
def test_study_files_have_the_names_of_verbs(kind):
    step = STEPS[kind]
    own = {name for name in step.model_fields if name not in (*Step.model_fields, *step.besides)}
    curves = {name for name, field in step.model_fields.items() if inspect.isclass(field.annotation)
              and issubclass(field.annotation, Curve)}  # fmt: skip
    # a step that follows a curve refuses in its check what its verb does not take
    assert (
        own - curves - {"start", "harmonics", "events", "formulation"} <= inspect.signature(step.verb).parameters.keys()
    )


def test_the_table_of_the_reference_is_that_of_the_verbs():
    text = (ROOT / "docs" / "api" / "index.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| `([^`]*)` \|", text.split("## The grammar of verbs")[1], re.M))
    assert rows == {name: ", ".join(placed(VERBS[name])) for name in COMPUTING}


# ------------------------------------------------------------------------------------------------------ public classes
def names_of(function):
    """The names that the annotations of a function are written in, those for type checkers too."""
    module = sys.modules[inspect.unwrap(function).__module__]
    more = {}
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("suboctave"):
            source = importlib.import_module(node.module)
            more |= {alias.asname or alias.name: getattr(source, alias.name, None) for alias in node.names}
    return {**more, **vars(module)}


def classes_in(annotation, names):
    """The classes of the package that an annotation names."""
    if isinstance(annotation, str):
        tree = ast.parse(annotation, mode="eval")
        if annotation.startswith("Annotated["):
            tree = tree.body.slice.elts[0]
        nodes = ast.walk(tree)
        return {one for node in nodes if isinstance(node, ast.Name) for one in classes_in(names.get(node.id), names)}
    if isinstance(annotation, type) and annotation.__module__.startswith("suboctave."):
        return set() if typing.is_typeddict(annotation) else {annotation}
    parts = typing.get_args(annotation)[: 1 if typing.get_origin(annotation) is typing.Annotated else None]
    return {one for part in parts for one in classes_in(part, names)}


def annotations_of(owner):
    """What a function takes and gives, or what the public methods and attributes of a class give: annotation, names."""
    if not isinstance(owner, type):
        signature, names = inspect.signature(owner), names_of(owner)
        yield from ((p.annotation, names) for p in signature.parameters.values())
        yield signature.return_annotation, names
        return
    for name in dir(owner):
        member = inspect.getattr_static(owner, name)
        for part in ("fget", "func", "compute", "__func__"):
            member = getattr(member, part, member)
        if not name.startswith("_") and inspect.isfunction(member):
            yield inspect.signature(member).return_annotation, names_of(member)
    for base in owner.__mro__:
        for name, annotation in vars(base).get("__annotations__", {}).items():
            if not name.startswith("_") and base.__module__.startswith("suboctave."):
                yield annotation, vars(sys.modules[base.__module__])


def test_every_class_that_a_verb_gives_or_takes_is_public():
    results = {getattr(so.results, name) for name in so.results.__all__}
    public = results | {getattr(so, name) for name in so.__all__ if isinstance(getattr(so, name), type)}
    hidden = {
        f"{found.__module__}.{found.__name__} of {getattr(owner, '__name__', owner)}"
        for owner in (*VERBS.values(), *(one for one in results if one.__name__ not in TAKEN))
        for annotation, names in annotations_of(owner)
        for found in classes_in(annotation, names)
        if found not in public
    }
    assert not hidden, "\n".join(sorted(hidden))


def test_the_front_door_of_results():
    assert so.results.Branch is so.Branch
    assert set(dir(so.results)) == set(so.results.__all__)
    with pytest.raises(AttributeError, match="did you mean 'Branch'"):
        so.results.Brnch  # noqa: B018


# ------------------------------------------------------------------------------------------------------------- details
def test_a_range_is_asked_for_in_words():
    system = so.library.duffing()
    for call in (
        lambda: so.frequency_response(system, 3.0),
        lambda: so.equilibria(system, "F", "ab"),
        lambda: so.find_isolas(system, (1.0, 2.0), "F", bounds=3.0),
    ):
        with pytest.raises(so.InputError, match=r"^(omega|bounds) must be two numbers \(from, to\), not"):
            call()


def test_a_matrix_without_parameters_is_an_array():
    system = so.System(2.0, "c", 1.0, parameters={"c": 0.1})
    np.testing.assert_array_equal(np.asarray(system.mass), [[2.0]])
    assert np.asarray(system.mass, dtype=np.float32).dtype == np.float32
    with pytest.raises(so.InputError, match=r"damping depends on c: system.matrices\(\) has its numbers"):
        np.asarray(system.damping)
    np.testing.assert_array_equal(system.matrices()[1], [[0.1]])


def test_the_library_shows_systems_alone():
    assert all(isinstance(getattr(so.library, name)(), so.System) for name in dir(so.library) if "physical" not in name)


def test_results_by_name_answer_as_dictionaries():
    response = so.frequency_response(so.library.duffing(c=0.1, F=0.3), (2.5, 0.8), harmonics=3)
    of_fold = so.sensitivity(response.bifurcations["LP"][0])
    for mapping in (of_fold, so.Results({"response": response})):
        assert "zeta" not in mapping
        assert [] not in mapping
        assert mapping.get([], 3) == mapping.get("zeta", 3) == 3
        with pytest.raises(so.InputError, match="'zeta'"):
            mapping["zeta"]


def test_an_evaluation_needs_all_parameters_and_a_number():
    orbit = so.frequency_response(so.library.duffing(F=0.3), (0.5, 0.51), harmonics=3).orbits[0]
    with pytest.raises(so.InputError, match="values leaves out m, c, k, alpha, F: give all parameters"):
        orbit.balance.at(orbit.x, 1.0, values={})
    with pytest.raises(so.InputError, match="omega must be a number"):
        orbit.balance.at(orbit.x, omega=10**400)


DUFFING = so.library.duffing(c=0.1, F=0.3)
TWO = {"method": so.TwoTrajectories(periods=3, steps_per_period=(100,))}
#: options that others make idle: the call, and what is idle
IDLE = {
    "seeds": (lambda: so.find_isolas(DUFFING, (1, 2), "F", (0.1, 0.2), search=(), seeds=so.Seeds()), "seeds"),
    "seeds of a map": (lambda: so.regime_map(DUFFING, (1, 2), "F", (0.1, 0.2), search=(), seeds=so.Seeds()), "seeds"),
    "steps": (lambda: so.poincare_sections(DUFFING, 1.0, steps_per_period=50), "steps_per_period"),
    "two trajectories": (lambda: so.lyapunov_exponents(DUFFING, 1.0, periods=20, count=1, **TWO), "periods=, count"),
    "seed": (lambda: so.stepped_sine(DUFFING, (1.0, 1.1), seed=3), "seed"),
    "another omega": (lambda: so.continue_branch(an_orbit(), "F", (0.2, 0.4), omega=2.0), "omega=2.0 differs from"),
    "workers": (lambda: so.verify(an_orbit(), workers=2), "workers= and progress"),
    "draws of a grid": (lambda: so.sweep(STUDY, {"F": [0.3]}, sampling="sobol"), "sampling"),
    "nothing to replace": (lambda: so.sweep(STUDY, {"F": [0.3]}, overwrite=True), "overwrite"),
}  # fmt: skip
STUDY = ROOT / "tests" / "study" / "duffing.toml"


def an_orbit():
    return so.frequency_response(DUFFING, (0.5, 0.51), harmonics=3).orbits[0]


@pytest.mark.parametrize("name", IDLE)
def test_an_option_without_effect_is_refused(name):
    call, words = IDLE[name]
    with pytest.raises(so.InputError, match=rf"{words}.*(no effect|leave it out|those of a branch)") as caught:
        call()
    assert "\n" not in str(caught.value)
