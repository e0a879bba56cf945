"""Bifurcations located in one compiled call, against the general way, which goes through the equations' own methods."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation import bordered as bordered_module
from suboctave.bifurcation import formulation, solve
from suboctave.bifurcation.bordered import bordered, null_vectors
from suboctave.bifurcation.bordered_kernels import border, border_again, fold_step, inverse_iteration
from suboctave.bifurcation.grazing import Touch, read_direction
from suboctave.continuation.lapack import factorise, solve_transposed
from suboctave.errors import ConvergenceError
from suboctave.harmonic import free_form, real_form
from suboctave.harmonic.perturbation import Kind, operator


def between_stops():
    """Two masses, each with a rounded stop; a cubic spring and a stop with a corner between them."""
    elements = [
        so.ElasticStop(dof=0, stiffness=20.0, gap=0.3, regularization=400.0),
        so.ElasticStop(dof=1, stiffness=9.0, gap=-0.4, side="left", regularization=900.0),
        so.CubicSpring(direction=[-1.0, 1.0], coefficient=0.4),
        so.ElasticStop(direction=[-1.0, 1.0], stiffness=5.0, gap=0.1),
    ]
    stiffness = np.array([[3.0, -1.0], [-1.0, 2.0]])
    return so.System(
        np.diag([1.0, 0.7]), 0.02 * stiffness, stiffness, elements, [so.HarmonicLoad(dof=0, amplitude=0.3)]
    )


def doubled(system):
    """The branch of doubled period from the first period doubling of a response."""
    return so.switch_branch(so.frequency_response(system, (4.5, 1.3)).bifurcations["PD"][0])


CURVES = {
    "corners": lambda: so.frequency_response(so.library.reference_oscillator(p=0.55, j=0.0), (4.5, 1.3)),
    "rounded": lambda: so.frequency_response(
        so.library.reference_oscillator(p=0.55, j=0.0, regularization=3000.0), (4.5, 1.3)
    ),
    "corners, 2T": lambda: doubled(so.library.reference_oscillator(p=0.55, j=0.0)),
    "rounded, 2T": lambda: doubled(so.library.reference_oscillator(p=0.55, j=0.0, regularization=3000.0)),
    "polynomials": lambda: so.frequency_response(so.library.nltva(0.11), (0.8, 1.5)),
    "all of them": lambda: so.frequency_response(between_stops(), (3.0, 0.9)),
}


@cache
def searches(name):
    """What is asked on a curve: guesses, kinds, and how each search ended (a solution, or why there is none)."""
    found = []
    locate = solve.locate_singular

    def noted(guess, kind):
        try:
            result = locate(guess, kind)
        except ConvergenceError as failure:
            found.append((guess, kind, str(failure)))
            raise
        found.append((guess, kind, result))
        return result

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(formulation, "locate_singular", noted)
        CURVES[name]()
    return found


@pytest.fixture
def generally(monkeypatch):
    """The general way alone."""
    monkeypatch.setattr(solve, "_at_once", lambda *_: None)
    monkeypatch.setattr(bordered_module, "_compiled", lambda *_: None)
    monkeypatch.setattr(real_form, "closed_parts", lambda *_: None)
    monkeypatch.setattr(free_form, "free_operator", lambda *_: None)
    monkeypatch.setattr(free_form, "free_gradient", lambda *_: None)


@pytest.mark.parametrize("name", CURVES)
def test_both_ways_agree(generally, name):
    asked = searches(name)
    assert asked
    for guess, kind, ended in asked:
        if isinstance(ended, str):
            with pytest.raises(ConvergenceError) as failure:
                solve.locate_singular(guess, kind)
            assert str(failure.value)[:40] == ended[:40]
            continue
        expected = solve.locate_singular(guess, kind)
        at, there = ended.state, expected.state
        assert at.omega == pytest.approx(there.omega, rel=1e-10)
        assert at.x == pytest.approx(there.x, abs=1e-9 * np.abs(there.x).max())
        assert max(ended.residual, expected.residual) < 1e-10
        assert abs(ended.iterations - expected.iterations) <= 1
        for one, other in ((ended.vectors.right, expected.vectors.right), (ended.vectors.left, expected.vectors.left)):
            assert abs(np.vdot(one, other)) == pytest.approx(1.0, abs=1e-9)
        # what is handed over belongs to the motion: asked anew, it says the same
        anew = guess.balance.at(at.x, at.omega, at.values)
        for part in ("motions", "blocks", "spectra_table", "force"):
            here, expected_part = getattr(at, part), getattr(anew, part)
            assert here == pytest.approx(expected_part, abs=1e-11 * max(1.0, np.abs(expected_part).max())), part


def test_every_kind_has_been_asked_for():
    """Limit points and period doublings at corners, rounded laws and polynomials, of the load's period and twice it."""
    kinds = {name: {kind for _, kind, _ in searches(name)} for name in CURVES}
    for name in ("corners", "rounded", "all of them"):
        assert Kind.INTEGER in kinds[name], name
    for name in ("corners", "rounded", "corners, 2T", "rounded, 2T"):
        assert Kind.HALF in kinds[name], name
    assert kinds["polynomials"] == {Kind.INTEGER, Kind.FREE}


@pytest.mark.parametrize("name", CURVES)
def test_g_and_its_gradient(monkeypatch, name):
    for guess, kind, ended in searches(name):
        if isinstance(ended, str) or kind is Kind.FREE:
            continue
        rng = np.random.default_rng(1)
        near = [
            v + 0.1 * rng.standard_normal(len(v)) / np.sqrt(len(v)) for v in (ended.vectors.right, ended.vectors.left)
        ]
        borders = bordered_module.NullVectors(*(v / np.linalg.norm(v) for v in near))
        pair = []
        for general in (False, True):
            with monkeypatch.context() as patch:
                if general:
                    patch.setattr(bordered_module, "_compiled", lambda *_: None)
                    patch.setattr(real_form, "closed_parts", lambda *_: None)
                state = guess.balance.at(guess.x, guess.omega, guess.values)
                b = bordered(state, kind, borders)
                pair.append((b, b.gradient(("omega",))))
        (one, slopes), (other, expected) = pair
        size = guess.omega**2
        assert abs(one.g - other.g) < 1e-10 * size
        assert slopes[0] == pytest.approx(expected[0], abs=1e-9 * np.abs(expected[0]).max())
        assert slopes[1]["omega"] == pytest.approx(expected[1]["omega"], rel=1e-9)
        assert slopes[2] == pytest.approx(expected[2], rel=1e-9)
        for a, b in ((one.right, other.right), (one.left, other.left)):
            assert a == pytest.approx(b, abs=1e-9 * np.abs(b).max())
        rhs = rng.standard_normal(len(one.scale) + 1)
        assert one.factor.solve(rhs) == pytest.approx(other.factor.solve(rhs), rel=1e-7, abs=1e-9)


def rubbing():
    """Two masses, a force that depends on velocity, and a stop between them."""
    elements = [
        so.Expression(dof=0, expression="0.3*x**2*v + 0.1*x**3"),
        so.ElasticStop(direction=[-1.0, 1.0], stiffness=5.0, gap=0.1),
    ]
    stiffness = np.array([[3.0, -1.0], [-1.0, 2.0]])
    loads = [so.HarmonicLoad(dof=0, amplitude=0.3)]
    return so.System(np.array([[1.0, 0.2], [0.2, 0.7]]), 0.02 * stiffness, stiffness, elements, loads)


@pytest.mark.parametrize(
    "make", [between_stops, rubbing, so.library.reference_oscillator, lambda: so.library.nltva(0.1)]
)
@pytest.mark.parametrize("nu", [1, 2])
def test_complex_operator_and_its_gradient(monkeypatch, make, nu):
    """J_kappa at any kappa, g and its gradient, against the general way."""
    balance = so.HarmonicBalance(make(), so.HarmonicBasis(6, nu))
    rng = np.random.default_rng(3)
    x = rng.standard_normal((13, balance.size)) / (1.0 + np.arange(13)[:, None]) ** 1.5
    found = []
    for general in (False, True):
        with monkeypatch.context() as patch:
            if general:
                patch.setattr(free_form, "free_operator", lambda *_: None)
                patch.setattr(free_form, "free_gradient", lambda *_: None)
            state = balance.at(x, 1.7)
            b = bordered(state, Kind.FREE, null_vectors(balance.at(x, 1.7), Kind.FREE, 0.31), 0.31)
            found.append((operator(state, Kind.FREE, 0.31), b.g, *b.gradient(("omega",))))
    (matrix, g, by_x, rates, by_kappa), (matrix_, g_, by_x_, rates_, by_kappa_) = found
    assert matrix == pytest.approx(matrix_, abs=1e-12 * np.abs(matrix_).max())
    assert g == pytest.approx(g_, rel=1e-8)
    assert by_x == pytest.approx(by_x_, abs=1e-8 * np.abs(by_x_).max())
    assert rates["omega"] == pytest.approx(rates_["omega"], rel=1e-8)
    assert by_kappa == pytest.approx(by_kappa_, rel=1e-8)


def test_left_to_the_general_way():
    """Other parameters than the frequency, Neimark-Sacker points, laws asked at nodes."""
    system = so.library.reference_oscillator()
    balance = so.HarmonicBalance(system, so.HarmonicBasis(5))
    x = np.full((11, 1), 0.3)
    along_force = solve.Guess(balance, x, 2.0, balance.values, "p", 1.0)
    assert solve._at_once(along_force, Kind.INTEGER, along_force.state()) is None
    along_omega = solve.Guess(balance, x, 2.0, balance.values, "omega", 1.0)
    assert solve._at_once(along_omega, Kind.FREE, along_omega.state()) is None
    dry = so.System(1.0, 0.1, 1.0, [so.TanhFriction(dof=0, force=0.1, velocity=0.01)], [so.HarmonicLoad(0, 1.0)])
    balance = so.HarmonicBalance(dry, so.HarmonicBasis(5))
    at_nodes = solve.Guess(balance, x, 2.0, balance.values, "omega", 1.0)
    assert solve._at_once(at_nodes, Kind.INTEGER, at_nodes.state()) is None


def test_pieces_of_linear_algebra():
    rng = np.random.default_rng(2)
    matrix, right = rng.standard_normal((17, 17)), rng.standard_normal(17)
    lu, pivots, solution = matrix.T.copy(), np.empty(17, dtype=np.int32), right.copy()
    assert not factorise(lu, pivots)
    solve_transposed(lu, pivots, solution)
    assert matrix.T @ solution == pytest.approx(right, abs=1e-11)


def test_null_vectors_in_compiled_code():
    guess, kind, _ = searches("all of them")[0]
    state = guess.state()
    expected = null_vectors(state, kind)
    n = len(expected.right)
    matrix = state.jacobian if kind is Kind.INTEGER else state.half_jacobian
    right, left = np.empty(n), np.empty(n)
    assert not inverse_iteration(matrix, state.balance.row_weights(n), 4, right, left)
    assert abs(right @ expected.right) == pytest.approx(1.0, abs=1e-10)
    assert abs(left @ expected.left) == pytest.approx(1.0, abs=1e-10)
    assert inverse_iteration(np.zeros((3, 3)), np.ones(3), 4, np.empty(3), np.empty(3))


@pytest.mark.parametrize(
    ("system", "omega"),
    [
        (so.library.reference_oscillator(p=0.55, j=0.0), (4.5, 1.3)),
        (so.library.reference_oscillator(p=0.55, j=0.0, regularization=3000.0), (4.5, 1.3)),
        (between_stops(), (3.0, 0.9)),
    ],
)
def test_grazings_agree(monkeypatch, system, omega):
    asked = []
    solved = Touch.solve

    def noted(self, guess, *start):
        asked.append((self, guess))
        return solved(self, guess, *start)

    with monkeypatch.context() as patch:
        patch.setattr(Touch, "solve", noted)
        so.frequency_response(system, omega)
    at_once, ways = 0, []
    for touch, guess in asked:
        found = []
        for general in (False, True):
            with monkeypatch.context() as patch:
                if general:
                    patch.setattr(Touch, "_at_once", lambda *_: None)
                try:
                    found.append(touch.solve(guess))
                except ConvergenceError as failure:
                    found.append(str(failure)[:40])
        one, other = found
        ways.append(touch._at_once(guess, guess.state(), read_direction(guess.state(), touch.element), touch.tau))
        if isinstance(one, str):
            assert one == other
            continue
        at_once += 1
        assert one.state.omega == pytest.approx(other.state.omega, rel=1e-10)
        assert one.state.x == pytest.approx(other.state.x, abs=1e-9 * np.abs(other.state.x).max())
        assert one.tau == pytest.approx(other.tau, abs=1e-8)
        assert abs(one.iterations - other.iterations) <= 1
        assert one.residual < 1e-10
    assert at_once > 0
    assert any(way is not None for way in ways)


def test_solutions_from_the_factors_of_a_matrix_nearby():
    rng = np.random.default_rng(5)
    n = 30
    matrix, change = rng.standard_normal((n, n + 1)), rng.standard_normal((n, n + 1))
    scale, left, right = rng.uniform(0.5, 2.0, n), rng.standard_normal(n), rng.standard_normal(n)
    for far, refused in ((0.0, False), (1e-10, False), (1e-6, False), (1e-5, False), (3.0, True)):
        lu, pivots = np.empty((n + 1, n + 1)), np.empty(n + 1, dtype=np.int32)
        v, u, exact_v, exact_u = np.empty((4, n + 1))
        assert not border(matrix, scale, left, right, 1.7, lu, pivots, v, u)
        near = matrix + far * change
        assert border_again(near, scale, left + far, right - far, 1.7, lu, pivots, v, u) == refused
        assert not border(near, scale, left + far, right - far, 1.7, lu, pivots, exact_v, exact_u)
        if not refused:
            assert v == pytest.approx(exact_v, abs=1e-11 * np.abs(exact_v).max())
            assert u == pytest.approx(exact_u, abs=1e-11 * np.abs(exact_u).max())


def test_step_at_a_fold():
    """The step from the bordered factors solves `[R_X, R_p; g_X, g_p] step = (R, g)`, at a singular R_X too."""
    rng = np.random.default_rng(4)
    n = 9
    u, _, vt = np.linalg.svd(rng.standard_normal((n, n)))
    for smallest in (1e-3, 0.0):
        matrix = np.empty((n, n + 1))
        matrix[:, :n] = u @ np.diag([*np.linspace(2.0, 1.0, n - 1), smallest]) @ vt
        matrix[:, n] = rng.standard_normal(n)
        by_x, residual = rng.standard_normal(n), rng.standard_normal(n)
        scale, step = rng.uniform(0.5, 2.0, n), np.empty(n + 1)
        lu, pivots = np.empty((n + 1, n + 1)), np.empty(n + 1, dtype=np.int32)
        v, w = np.empty(n + 1), np.empty(n + 1)
        left, right = u[:, -1] / scale, vt[-1] / scale
        assert not border(matrix, scale, left, right, 1.7, lu, pivots, v, w)
        assert not fold_step(matrix, scale, lu, pivots, v, residual, by_x, 0.4, 0.2, step)
        whole = np.vstack((matrix, np.append(by_x, 0.4)))
        assert whole @ step == pytest.approx(np.append(residual, 0.2), abs=1e-9)
