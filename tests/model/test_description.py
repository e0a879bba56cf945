"""A system written down and made again is the same system, bit for bit."""

from __future__ import annotations

import json
import pickle
from inspect import isabstract

import numpy as np
import pytest
import scipy.sparse

import suboctave as so
from suboctave.model.description import build_part, known_kinds
from suboctave.model.elements.base import BaseElement
from suboctave.model.loads import Load
from suboctave.model.system import build, describe


class OwnSpring(so.CubicSpring):
    """Somebody's element: the class is defined here, at the top of a module."""

    def __init__(self, place, factor=1.0):
        super().__init__(dof=place, coefficient=f"{factor}*alpha")


def doubled(x):
    return 2.0 * x


def systems():
    rng = np.random.default_rng(3)
    n = 9
    mass = np.diag(rng.uniform(1.0, 2.0, n))
    stiffness = rng.normal(size=(n, n))
    chain = scipy.sparse.diags_array([[-1.0] * (n - 1), [2.1] * n, [-1.0] * (n - 1)], offsets=[-1, 0, 1]).tocsr()
    yield so.library.reference_oscillator(regularization=3000.0)
    yield so.System(
        1.0,
        {"c": [[1.0]], "c/3": [[2.0]]},
        1.0,
        [
            so.QuadraticDamper(0, "c"),
            so.TanhFriction(0, 0.1, velocity=1e-3),
            so.Clearance(0, 2.0, "g"),
            so.Freeplay(0, 2.0, 0.1 + 0.2),
            so.Expression(0, "g*x**3*expression", {"x": 0, "expression": [1.0]}),
        ],
        [so.StaticLoad(0, "g"), so.Gravity(9.81), so.BaseAcceleration("c", coordinates="relative")],
        {"c": 0.1, "g": 0.3},
        dof_names=["height"],
        name="many elements",
    )
    yield so.System.from_equations(
        ["x'' + c*x' + (1 + d*cos(omega*t))*x + y*x**2 = cos(omega*t)", "y'' + y + x**3/3 = 0"],
        {"c": 0.1, "d": 0.2},
        name="equations",
    )
    yield so.library.nltva().with_parameters(F=0.1 + 0.2)
    yield so.System(
        mass=mass,
        damping={"c": np.eye(n), 0.1: mass},
        stiffness=stiffness,
        elements=[
            so.PolynomialSpring(direction=rng.normal(size=n), coefficients={3: "a", 5: "a**2/3"}),
            so.ElasticStop((0, 8), stiffness=1.0 / 3.0, gap="g"),
        ],
        loads=[so.HarmonicLoad(2, ["F", "F*omega**2"], [1, 2], [0.1, "g"], static=0.3)],
        parameters={"c": 0.1, "a": 1e-17, "g": 0.7, "F": 1.0},
    ).with_parameters(g=-0.2)
    yield so.System(chain * 0 + scipy.sparse.eye_array(n), {"c": chain}, chain, [OwnSpring(1, factor=2.0)],
                    so.HarmonicLoad(0, 1.0), {"alpha": 0.5, "c": 0.01}, name="chain")  # fmt: skip


def same(a, b):
    assert a.n == b.n
    assert a.name == b.name
    assert a.dof_names == b.dof_names
    assert dict(a.parameters) == dict(b.parameters)
    for one, other in zip(a.matrices(), b.matrices(), strict=True):
        assert one.tobytes() == other.tobytes()
    for name in a.parameters:
        for one, other in zip(a.matrix_derivatives(name), b.matrix_derivatives(name), strict=True):
            assert (one is None and other is None) or one.tobytes() == other.tobytes()
    assert [a.mass.sparse, a.stiffness.sparse] == [b.mass.sparse, b.stiffness.sparse]
    t = np.linspace(0.0, 7.0, 20)
    assert a.force_time(t, 1.3).tobytes() == b.force_time(t, 1.3).tobytes()
    u, v = np.linspace(-3.0, 3.0, 31), np.linspace(1.0, -1.0, 31)
    assert len(a.elements) == len(b.elements)
    for one, other in zip(a.elements, b.elements, strict=True):
        assert type(one) is type(other)
        assert one.direction(a.n).tobytes() == other.direction(a.n).tobytes()
        c, d = one.coefficient_values(a.parameters), other.coefficient_values(b.parameters)
        assert c.tobytes() == d.tobytes()
        assert repr(one) == repr(other)
        if isinstance(one, so.Element):
            assert one.tangent(u, v, c)[0].tobytes() == other.tangent(u, v, d)[0].tobytes()


@pytest.mark.parametrize("system", list(systems()), ids=lambda s: s.name or "unnamed")
@pytest.mark.parametrize("outside", [False, True])
def test_a_round_trip_through_json_changes_no_bit(system, outside):
    arrays = {} if outside else None
    text = json.dumps(describe(system, arrays), allow_nan=False)
    again = build(json.loads(text), arrays)
    same(system, again)
    assert json.dumps(describe(again, {} if outside else None)) == text
    if outside and not system.mass.sparse and system.n == 9:
        assert arrays


def test_a_pickled_system_can_still_be_described():
    system = so.library.reference_oscillator()
    assert describe(pickle.loads(pickle.dumps(system))) == describe(system)


def test_what_changes_later_does_not_reach_the_description():
    direction = np.array([1.0, 2.0])
    element = so.CubicSpring(direction=direction, coefficient=1.0)
    direction[:] = 9.0
    assert element.arguments["direction"].tolist() == [1.0, 2.0]


def test_every_element_and_load_of_the_package_is_known_by_name():
    public = {name for name in so.__all__ if isinstance(getattr(so, name), type)}
    elements = {n for n in public if issubclass(getattr(so, n), BaseElement) and not isabstract(getattr(so, n))}
    loads = {n for n in public if issubclass(getattr(so, n), Load) and not isabstract(getattr(so, n))}
    assert {"CubicSpring", "Expression"} < elements <= set(known_kinds("element"))
    assert {"HarmonicLoad", "Gravity"} < loads <= set(known_kinds("load"))
    assert not set(known_kinds("element")) & set(known_kinds("load"))


def test_code_is_imported_only_if_that_is_allowed(tmp_path, monkeypatch):
    (tmp_path / "own_law_of_a_test.py").write_text(
        "import suboctave as so\nclass Stiff(so.CubicSpring):\n    def __init__(self, dof):\n"
        "        super().__init__(dof, 2.0)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    item = {"type": "own_law_of_a_test:Stiff", "dof": 0}
    with pytest.raises(so.InputError, match="allow_code=True"):
        build_part(item, "element")
    assert build_part(item, "element", allow_code=True).coefficients[0].value({}) == 2.0
    assert type(build_part(item, "element")).__name__ == "Stiff"  # defined by now: nothing is imported


def test_a_function_is_looked_up_only_if_that_is_allowed():
    from suboctave.model.description import from_plain, plain_value

    written = plain_value(doubled)
    assert set(written) == {"callable"}
    with pytest.raises(so.InputError, match="allow_code=True"):
        from_plain({"callable": "os:system"}, {})
    assert from_plain({"callable": "math:sqrt"}, {}, allow_code=True)(9.0) == 3.0
    with pytest.raises(so.InputError, match="top of a module"):
        plain_value(lambda x: x)


@pytest.mark.parametrize(
    ("item", "message"),
    [
        ({"type": "CubicSprng", "dof": 0}, "did you mean 'CubicSpring'"),
        ({"type": "CubicSpring", "dof": 0, "coeficient": 1.0}, "did you mean 'coefficient'"),
        ({"dof": 0}, "has no type"),
        ({"type": "HarmonicLoad", "dof": 0}, "no element 'HarmonicLoad'"),
        ({"type": "CubicSpring", "dof": 0}, "needs coefficient"),
        (3, "is a table"),
    ],
)
def test_a_wrong_element_is_refused_with_a_suggestion(item, message):
    with pytest.raises(so.InputError, match=message):
        build_part(item, "element")


@pytest.mark.parametrize("damage", ["mass", "elements", "parameters"])
def test_half_a_description_is_none(damage):
    whole = describe(so.library.duffing())
    del whole[damage]
    with pytest.raises(so.InputError, match="not the description of a system"):
        build(whole)
