"""Systems: matrices and loads against arithmetic written out, and everything that must be refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import scipy.sparse

from suboctave.errors import InputError
from suboctave.model import CubicSpring, ElasticStop, HarmonicLoad, System, coefficient, matrix_coefficient

PARAMETERS = {"k": 2.0, "c": 0.1, "m": 3.0}


def chain(**changes):
    parts = {
        "mass": [["m", 0], [0, "2*m"]],
        "damping": [["2*c", "-c"], ["-c", "c*k"]],
        "stiffness": np.array([["k + 1", "-k"], ["-k", "k**2"]], dtype=object),
        "elements": [CubicSpring((0, 1), "k")],
        "loads": [HarmonicLoad(1, 1.0)],
        "parameters": PARAMETERS,
    }
    return System(**{**parts, **changes})


def test_matrices_with_expressions():
    mass, damping, stiffness = chain().matrices()
    np.testing.assert_allclose(mass, [[3, 0], [0, 6]])
    np.testing.assert_allclose(damping, [[0.2, -0.1], [-0.1, 0.2]])
    np.testing.assert_allclose(stiffness, [[3, -2], [-2, 4]])
    stiffness = chain().matrices({**PARAMETERS, "k": 5.0})[2]
    np.testing.assert_allclose(stiffness, [[6, -5], [-5, 25]])


def test_matrix_derivatives_are_those_by_hand():
    mass, damping, stiffness = chain().matrix_derivatives("k")
    assert mass is None
    np.testing.assert_allclose(damping, [[0, 0], [0, 0.1]])
    np.testing.assert_allclose(stiffness, [[1, -1], [-1, 4]])
    np.testing.assert_allclose(chain().matrix_derivatives("k", "k")[2], [[0, 0], [0, 2]])
    for pair in (("k", "c"), ("c", "k")):
        mass, damping, stiffness = chain().matrix_derivatives(*pair)
        assert mass is None
        assert stiffness is None
        np.testing.assert_allclose(damping, [[0, 0], [0, 1]])
    assert chain().matrix_derivatives("omega") == (None, None, None)
    np.testing.assert_allclose(chain().matrix_derivatives("k", values={**PARAMETERS, "k": 7.0})[2][1, 1], 14.0)


@pytest.mark.parametrize("form", [np.asarray, scipy.sparse.csr_array, scipy.sparse.coo_matrix])
def test_a_sum_of_expressions_times_matrices_equals_its_entries(form):
    k0, k1 = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.array([[0.0, 0.0], [0.0, 1.0]])
    terms = matrix_coefficient({1: form(k0), "k**2": form(k1)}, 2, "stiffness")
    entries = matrix_coefficient([[2, -1], [-1, "2 + k**2"]], 2, "stiffness")
    for matrix in (terms, entries):
        np.testing.assert_allclose(matrix.value({"k": 3.0}), [[2, -1], [-1, 11]])
        np.testing.assert_allclose(matrix.sparse_value({"k": 3.0}).toarray(), [[2, -1], [-1, 11]])
        np.testing.assert_allclose(matrix.derivative("k").value({"k": 3.0}), [[0, 0], [0, 6]])
        assert matrix.derivative("k").derivative("k").derivative("k") is None
        assert matrix.derivative("c") is None
    assert terms.sparse == (form is not np.asarray)


def test_the_matrices_given_out_are_copies():
    system = chain(mass=np.eye(2), parameters={"k": 1.0, "c": 0.1})
    system.matrices()[0][0, 0] = 99.0
    assert system.matrices()[0][0, 0] == 1.0


def test_zero_stands_for_a_matrix_of_zeros():
    assert not System(np.eye(3), 0, np.eye(3)).matrices()[1].any()
    with pytest.raises(InputError, match="give a matrix 3 x 3"):
        System(np.eye(3), 0.1, np.eye(3))


def test_units_of_the_degrees_of_freedom_do_not_make_a_mass_singular():
    System(np.diag([1e9, 1e-12]), 0, np.eye(2))
    with pytest.raises(InputError, match="singular"):
        System(np.array([[1e9, 1e-1], [1e-1, 1e-11]]), 0, np.eye(2))


def test_large_sparse_masses_are_judged_by_their_pivots():
    n = 1500  # consistent mass of a rod: 4 on the diagonal, 1 beside it, definite; 1 and 1: indefinite
    beside = np.ones(n - 1)

    def rod(diagonal):
        return scipy.sparse.diags_array([beside, np.full(n, diagonal), beside], offsets=[-1, 0, 1]).tocsr()

    System(rod(4.0), 0, scipy.sparse.eye_array(n))
    with pytest.raises(InputError, match="not positive definite"):
        System(rod(1.0), 0, scipy.sparse.eye_array(n))


# ------------------------------------------------------------------------------------------------------- parameters
def test_with_parameters_leaves_the_original_alone():
    system = chain()
    other = system.with_parameters(k=4.0)
    assert (system.parameters["k"], other.parameters["k"]) == (2.0, 4.0)
    assert other.with_parameters({"k": 2.0, "c": 0.3}).parameters == {"k": 2.0, "c": 0.3, "m": 3.0}
    with pytest.raises(InputError, match=r"no parameter 'K' \(did you mean 'k'\?\)"):
        system.with_parameters(K=1.0)
    with pytest.raises(InputError, match="must be a finite number"):
        system.with_parameters(k=float("nan"))
    with pytest.raises(InputError, match="mass is not positive definite"):
        system.with_parameters(m=-1.0)


def test_systems_do_not_change():
    system = chain()
    with pytest.raises(AttributeError):
        system.name = "other"
    with pytest.raises(TypeError):
        system.parameters["k"] = 1.0


def test_systems_survive_pickling():
    system = chain(name="pair")
    copy = pickle.loads(pickle.dumps(system))
    assert repr(copy) == repr(system)
    for a, b in zip(copy.matrix_derivatives("k"), system.matrix_derivatives("k"), strict=True):
        assert (a is None) == (b is None)
        if a is not None:
            np.testing.assert_array_equal(a, b)


def test_repr_says_what_it_is():
    text = repr(chain(name="pair"))
    for part in (
        "'pair'",
        "2 degrees of freedom",
        "CubicSpring(dof=(0, 1), coefficient=k)",
        "k = 2",
        "HarmonicLoad(dof=1",
    ):
        assert part in text


# ------------------------------------------------------------------------------------------------------------ stops
def test_an_expression_that_is_negative_needs_a_side():
    def system(j, **options):
        stop = ElasticStop(0, "Kc", "j", **options)
        return System(1, 0.1, 1, [stop], [], {"Kc": 1.0, "j": j})

    with pytest.raises(InputError, match="no side is given") as caught:
        system(-0.2)
    for spelling in ("ElasticStop(dof=0, stiffness=Kc, gap='j', side=\"left\")", 'side="right")'):
        assert spelling in str(caught.value)
    assert system(-0.2, side="right").elements[0].side == "right"
    assert system(-0.2, side="left").elements[0].side == "left"
    # the side is fixed by then: a gap may move through zero
    assert system(0.2).with_parameters(j=-0.2).elements[0].side == "right"


def test_a_sharpness_must_stay_positive():
    system = System(1, 0.1, 1, [ElasticStop(0, 1.0, 1.0, regularization="s")], [], {"s": 10.0})
    with pytest.raises(InputError, match="must be positive"):
        system.with_parameters(s=0.0)


# ------------------------------------------------------------------------------------------------------------ loads
def test_force_is_the_sum_of_cosines():
    load = HarmonicLoad((0, 1), amplitude=["p", 0.5], harmonic=[1, 3], phase=[0.3, "q"], static="2*p")
    unbalance = HarmonicLoad(1, "e*omega**2")
    system = System(np.eye(2), 0, np.eye(2), [], [load, unbalance], {"p": 2.0, "q": -0.7, "e": 0.1})
    t, omega = np.linspace(0, 5, 11), 1.7
    wave = 2 * np.cos(omega * t + 0.3) + 0.5 * np.cos(3 * omega * t - 0.7) + 4.0
    expected = [wave, -wave + 0.1 * omega**2 * np.cos(omega * t)]
    np.testing.assert_allclose(system.force_time(t, omega), expected, rtol=1e-14)
    np.testing.assert_allclose(system.force_time(t[3], omega), np.array(expected)[:, 3], rtol=1e-14)
    assert [c.harmonic for c in system.load_components()] == [1, 3, 0, 1]
    assert system.load_components()[3].amplitude.derivative("omega").value({"e": 0.1, "omega": 2.0}) == pytest.approx(
        0.4
    )


def test_observed_degree_of_freedom():
    eye = np.eye(3)
    assert System(eye, 0, eye).observed_dof == 0
    static = HarmonicLoad(1, 1.0, harmonic=0)
    moving = HarmonicLoad(amplitude=1.0, direction=[0.1, 0.0, -2.0])
    assert System(eye, 0, eye, loads=[static]).observed_dof == 1
    assert System(eye, 0, eye, loads=[static, moving]).observed_dof == 2


# --------------------------------------------------------------------------------------------------------- refusals
@pytest.mark.parametrize(
    ("make", "part"),
    [
        (lambda: System([[1, 0]], 0, 1), "mass must be square"),
        (lambda: System([[1, 0], [0]], 0, 1), "rows of different lengths"),
        (lambda: System([], 0, 1), "mass must be square"),
        (lambda: System(np.eye(2), np.eye(3), np.eye(2)), "damping is 3 x 3, but the mass has 2"),
        (lambda: System(1, 0, float("inf")), "stiffness"),
        (lambda: System(1, 0, np.array([[np.nan]])), "stiffness has entries that are not finite"),
        (lambda: System(scipy.sparse.eye_array(2) * 1j, 0, np.eye(2)), "complex"),
        (lambda: System(np.eye(2) * 1j, 0, np.eye(2)), "mass must hold numbers"),
        (lambda: System([[1, 0.5], [0.4, 1]], 0, np.eye(2)), "mass is not symmetric: M\\[0, 1\\] = 0.5"),
        (lambda: System([[1, 2], [2, 1]], 0, np.eye(2)), "not positive definite"),
        (lambda: System([[1, 1], [1, 1]], 0, np.eye(2)), "mass is singular"),
        (lambda: System(np.diag([1.0, 0.0]), 0, np.eye(2)), "diagonal entry at dof 1 is 0"),
        (lambda: System("m", 0, 1, parameters={"m": -1.0}), "diagonal entry at dof 0 is -1"),
        (lambda: System(1, "2*zeta", 1), "damping: unknown parameter 'zeta' in the expression '2\\*zeta'"),
        (lambda: System(1, "2*zta", 1, parameters={"zeta": 1}), "'zeta' is given and used nowhere: one of the two"),
        (lambda: System(1, 0, [["k*"]], parameters={"k": 1}), "stiffness\\[0, 0\\]: cannot read"),
        (lambda: System(1, 0, [[None]]), "stiffness\\[0, 0\\]: a coefficient is a number"),
        (lambda: System(1, 0, "omega"), "only loads may depend on the frequency"),
        (lambda: System(1, 0, 1, [CubicSpring(0, "omega")]), "only loads may depend on the frequency"),
        (lambda: System(1, 0, 1, parameters={"k": 1.0}), "parameter 'k' not used"),
        (lambda: System(1, 0, "k", parameters={"k": "1"}), "must be a finite number"),
        (lambda: System(1, 0, "k", parameters={"k": True}), "must be a finite number"),
        (lambda: System(1, 0, "k", parameters={"k": float("inf")}), "must be a finite number"),
        (lambda: System(1, 0, "k", parameters=["k"]), "must be a mapping"),
        (lambda: System(1, 0, 1, parameters={"omega": 1.0}), "already has a meaning"),
        (lambda: System(1, 0, 1, parameters={"sin": 1.0}), "already has a meaning"),
        (lambda: System(1, 0, 1, parameters={"lambda": 1.0}), "for example 'lambda_'"),
        (lambda: System(1, 0, 1, parameters={"a b": 1.0}), "cannot name a parameter"),
        (lambda: System(1, 0, 1, parameters={"\N{MICRO SIGN}": 1.0}), "plain letters"),
        (
            lambda: System(1, 0, "log(k)", parameters={"k": -1.0}),
            "stiffness: 'log\\(k\\)' is not a finite real number at k",
        ),
        (lambda: System(1, 0, 1, [CubicSpring(1, 1.0)]), "dof 1 does not exist"),
        (lambda: System(1, 0, 1, [HarmonicLoad(0, 1.0)]), r"elements\[0\] must be an Element, not HarmonicLoad"),
        (lambda: System(1, 0, 1, 3), "elements must be an Element or a list of Elements, not 3"),
        (lambda: System(1, 0, 1, loads=[HarmonicLoad(2, 1.0)]), "HarmonicLoad: dof 2 does not exist"),
        (lambda: System({}, 0, 1), "empty mapping"),
        (lambda: System(np.eye(2), 0, {1: np.eye(2), "k": np.eye(3)}, parameters={"k": 1.0}), "different shapes"),
        (lambda: HarmonicLoad(0), "needs amplitude"),
        (lambda: HarmonicLoad(0, 1.0, harmonic=-1), "integer from 0 on"),
        (lambda: HarmonicLoad(0, 1.0, harmonic=1.5), "harmonic must be a whole number.*, not 1.5"),
        (lambda: HarmonicLoad(0, 1.0, harmonic=True), "harmonic must be a whole number.*, not True"),
        (lambda: HarmonicLoad(0, [1.0, 2.0]), "2 of amplitude, 1 of harmonic"),
        (lambda: HarmonicLoad(0, "p/"), "HarmonicLoad\\(dof=0\\), amplitude: cannot read"),
    ],
)
def test_wrong_systems_are_refused_in_one_line(make, part):
    with pytest.raises(InputError, match=part) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_values_may_come_as_coefficients():
    k = coefficient("k")
    np.testing.assert_allclose(System(1, 0, k, parameters={"k": 2.0}).matrices()[2], [[2.0]])
