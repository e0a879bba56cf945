"""Bases that leave harmonics out: the equations are those of all harmonics, fewer of them.

Two DOFs with exact contacts, a cubic spring and a law with nodes of its own, in stiffness and in flexibility form. What
is left out is estimated by the force that it would answer to; the motion with all harmonics tells whether that is so.
"""

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation.bordered import bordered, null_vectors
from suboctave.bifurcation.branch import locate_branch_point
from suboctave.bifurcation.branching import branching_equation
from suboctave.bifurcation.solve import Guess
from suboctave.errors import InputError
from suboctave.harmonic import AdaptiveHarmonics, HarmonicBalance, HarmonicBasis
from suboctave.harmonic.perturbation import Kind, parameter_gradient
from suboctave.harmonic.second import Direction, second_derivative
from suboctave.harmonic.selection import choose_harmonics, truncation
from suboctave.stability import floquet_multipliers
from suboctave.stability.variational import refined

OMEGA, STEP = 1.3, 1e-6
LEFT_OUT = HarmonicBasis(12, 2, (0, 1, 2, 3, 4, 6, 8, 10, 12))


def system():
    return so.System(
        mass=[[1.0, 0.1], [0.1, 0.7]],
        damping=[[0.2, -0.05], [-0.05, 0.15]],
        stiffness=[["2*k", -1.0], [-1.0, "1.5*k"]],
        elements=[
            so.ElasticStop((0, 1), stiffness="Kc", gap="j"),
            so.CubicSpring(0, "0.3*k"),
            so.Expression(1, "0.2*max(x - j, 0)*(1 + 0.3*v)"),
        ],
        loads=[so.HarmonicLoad(0, amplitude="0.4*omega"), so.HarmonicLoad(1, 0.2, harmonic=2, phase=0.3)],
        parameters={"k": 1.1, "Kc": 1.5, "j": 0.1},
    )


def motion(basis, size):
    """A motion with the zeros where they belong."""
    k = np.repeat(np.arange(1.0, basis.harmonics + 1.0), 2)
    x = np.random.default_rng(7).normal(size=(basis.size, size)) / np.append(1.0, k**1.5)[:, None]
    return basis.filled.resized(x, basis)


@pytest.fixture(scope="module", params=["stiffness", "flexibility"])
def pair(request, condensed):
    """The same motion in the equations of the kept harmonics and of all, and which of the latter the former are."""
    s = system()
    linear = None if request.param == "stiffness" else condensed(s, [0, 1], 1.3)
    x = motion(LEFT_OUT, 2)
    some = HarmonicBalance(s, LEFT_OUT, linear=linear).settle(x, OMEGA)
    return some.at(x, OMEGA), some.with_basis(LEFT_OUT.filled).at(x, OMEGA), some.entries


def test_the_equations_are_rows_and_columns_of_those_of_all_harmonics(pair):
    some, every, at = pair
    scale = np.abs(every.residual).max()
    assert len(some.residual) == some.balance.dimension == 2 * LEFT_OUT.count < len(every.residual)
    np.testing.assert_allclose(some.residual, every.residual[at], atol=1e-13 * scale)
    np.testing.assert_allclose(some.jacobian, every.jacobian[np.ix_(at, at)], rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(some.linear_jacobian, every.linear_jacobian[np.ix_(at, at)], rtol=1e-13, atol=1e-13)
    for name in ("omega", "k", "Kc", "j"):
        np.testing.assert_allclose(some.residual_by(name), every.residual_by(name)[at], atol=1e-13 * scale)
        np.testing.assert_allclose(some.extended_jacobian(name)[:, -1], some.residual_by(name), atol=1e-15)
    weighted = some.residual.reshape(-1, 2) * some.balance.scales()[1]
    assert some.residual_size() == pytest.approx(np.linalg.norm(weighted))
    # perturbations of half the frequency have all harmonics
    np.testing.assert_array_equal(some.half_jacobian, every.half_jacobian)


def test_vectors_of_unknowns_and_coefficients_are_the_same_thing(pair):
    some, every, at = pair
    np.testing.assert_array_equal(some.unknowns, every.x.ravel()[at])
    np.testing.assert_array_equal(some.balance.spread(some.unknowns), some.x)
    np.testing.assert_array_equal(some.balance.at(some.unknowns, OMEGA).x, some.x)


def test_second_derivatives_and_gradients_against_differences(pair):
    some, _, _ = pair
    balance = some.balance
    rng = np.random.default_rng(3)
    a, b = (balance.spread(rng.normal(size=balance.dimension)) for _ in range(2))

    def at(step, name=None):
        values = balance.values if name is None else {**balance.values, name: balance.values[name] + step}
        return balance.at(some.x + (0.0 if name else step) * b, OMEGA, values)

    exact = second_derivative(some, Direction(a), Direction(b))
    slope = (at(STEP).jacobian - at(-STEP).jacobian) @ balance.packed(a) / (2.0 * STEP)
    np.testing.assert_allclose(exact, slope, atol=1e-6 * np.abs(slope).max())
    left = rng.normal(size=balance.dimension)
    by = float(np.sum(parameter_gradient(some, left, "Kc", ()).x * b))
    slope = left @ (at(STEP).residual_by("Kc") - at(-STEP).residual_by("Kc")) / (2.0 * STEP)
    assert by == pytest.approx(slope, rel=1e-6)
    # the scalar that vanishes where J_0 is singular
    borders = null_vectors(some, Kind.INTEGER)
    assert borders.right.shape == (some.x.size,)
    gx, rates, _ = bordered(some, Kind.INTEGER, borders).gradient(("Kc",))
    g = [bordered(at(s), Kind.INTEGER, borders).g.real for s in (STEP, -STEP)]
    assert gx @ balance.packed(b) == pytest.approx((g[0] - g[1]) / (2.0 * STEP), rel=1e-5)
    g = [bordered(at(s, "Kc"), Kind.INTEGER, borders).g.real for s in (STEP, -STEP)]
    assert rates["Kc"].real == pytest.approx((g[0] - g[1]) / (2.0 * STEP), rel=1e-5)


def test_a_load_needs_its_harmonic():
    with pytest.raises(InputError, match="leaves out the load's harmonic at 2 omega"):
        HarmonicBalance(system(), HarmonicBasis(12, 2, (0, 1, 2, 12)))


def solved(basis, start=None):
    balance = HarmonicBalance(system(), basis)
    x = np.zeros((basis.size, 2)) if start is None else start
    for _ in range(60):
        state = balance.at(x, OMEGA)
        step = balance.spread(np.linalg.solve(state.jacobian, state.residual))
        x = x - step
        if np.abs(step).max() < 1e-13:
            return balance.at(x, OMEGA)
    raise AssertionError("Newton's method did not converge")


@pytest.fixture(scope="module")
def motions():
    """The motion with all of 40 harmonics, and without three below the highest."""
    every = solved(HarmonicBasis(40))
    basis = HarmonicBasis(40, 1, tuple(k for k in range(41) if k not in (9, 11, 12)))
    return every, solved(basis, HarmonicBasis(40).resized(every.x, basis))


def test_what_is_left_out_is_estimated(motions):
    every, some = motions
    weight = every.balance.scales()[0]
    missing = np.linalg.norm((some.x - every.x) * weight) / np.linalg.norm(every.x * weight)
    assert missing > 30.0 * truncation(every)
    assert truncation(some) == pytest.approx(missing, rel=0.1)
    # and mended, to first order
    left = np.linalg.norm((some.completed.x[:81] - every.x) * weight) / np.linalg.norm(every.x * weight)
    assert left < 0.3 * missing
    both, doubt = refined(some)
    assert doubt is None
    assert np.linalg.norm(both.x[:81] - every.x) < 0.1 * np.linalg.norm(some.x - every.x)


def test_multipliers_do_not_miss_it(motions):
    every, some = motions
    near, exact = floquet_multipliers(some), floquet_multipliers(every)
    difference = np.abs(np.sort_complex(near.multipliers) - np.sort_complex(exact.multipliers)).max()
    assert difference < 1e-5
    assert difference <= 3.0 * (near.errors.max() + exact.errors.max())


def test_a_symmetry_that_breaks_is_found_with_few_even_harmonics():
    """The branch point of a symmetric oscillator, and the way its branch leaves, without the higher even harmonics."""
    duffing = so.library.duffing(c=0.1, F=8.0)
    curve = so.frequency_response(duffing, (1.7, 1.4), harmonics=15)
    (known,) = curve.bifurcations["BP"]
    basis = HarmonicBasis(15, 1, tuple(k for k in range(16) if k % 2 or k <= 8))
    x = HarmonicBasis(15).resized(known.orbit.coefficients, basis)
    balance = HarmonicBalance(duffing, basis)
    guess = Guess(balance, x, known.omega + 1e-3, duffing.parameters, "omega", 1.0)
    found = locate_branch_point(guess)
    assert found.residual < 1e-10
    assert found.state.omega == pytest.approx(known.omega, abs=1e-5)
    # the null vector is even, the curve itself odd
    null = found.vectors.right.reshape(-1, 1)
    odd, even = (np.linalg.norm(null[k::4]) + np.linalg.norm(null[k + 1 :: 4]) for k in (1, 3))
    assert odd < 1e-8 * even
    assert not null[2 * basis.left_out].any()
    directions = branching_equation(found.state, "omega", 1.0, found.vectors).directions
    every = branching_equation(known.orbit.state(), "omega", 1.0, known.null_vectors).directions
    for d, e in zip(sorted(directions, key=lambda v: abs(v[-1])), sorted(every, key=lambda v: abs(v[-1])), strict=True):
        there = np.append(HarmonicBasis(15).resized(e[:-1].reshape(-1, 1), basis)[basis.rows], e[-1])
        cosine = d @ there / np.linalg.norm(d) / np.linalg.norm(there)
        assert abs(cosine) == pytest.approx(1.0, abs=1e-6)


# ------------------------------------------------------------------------------------------------------- the choice
def cascade(sizes, nu=8, high=120, power=4.5):
    """A motion whose classes by gcd(k, nu) have given sizes and fall like a power of the frequency; no elements."""
    linear = so.System(1.0, 0.1, 1.0, loads=[so.HarmonicLoad(0, 1.0)])
    basis = HarmonicBasis(high, nu)
    k = np.arange(1, high + 1)
    amplitude = np.array([sizes[int(np.gcd(m, nu))] * min(1.0, m / nu) ** 2 / max(1.0, m / nu) ** power for m in k])
    x = np.zeros((basis.size, 1))
    x[1::2, 0] = amplitude
    return HarmonicBalance(linear, basis).at(x, 1.0)


OPTIONS = AdaptiveHarmonics()


def test_every_class_ends_where_the_tolerance_lets_it():
    state = cascade({8: 0.3, 4: 1.0, 2: 0.2, 1: 0.03})
    chosen = choose_harmonics(state, OPTIONS, 1e-5, dropping=True)
    ends = {d: max(k for k in chosen.kept if np.gcd(k, 8) == d) for d in (1, 2, 4, 8)}
    assert ends[1] < ends[2] < ends[4]
    assert chosen.count < 0.9 * HarmonicBasis(chosen.harmonics, 8).count
    x = state.x.copy()
    x[: chosen.size] -= state.basis.resized(state.x, chosen)
    assert np.linalg.norm(x) <= 1e-5 * np.linalg.norm(state.x)
    # nothing is left out of what is quoted
    assert choose_harmonics(state, OPTIONS, 1e-5).kept is None
    # the choice is kept while it will do, and fills up when asked for
    again = state.balance.with_basis(chosen).at(state.basis.resized(state.x, chosen), 1.0)
    assert choose_harmonics(again, OPTIONS, 1e-5, dropping=True) == chosen
    filled = choose_harmonics(again, OPTIONS, 1e-5)
    assert filled.kept is None
    assert filled.harmonics >= chosen.harmonics


def test_a_young_class_keeps_all_for_the_sake_of_its_birth():
    state = cascade({8: 0.3, 4: 1.0, 2: 0.2, 1: 0.002})
    assert choose_harmonics(state, OPTIONS, 1e-5, dropping=True).kept is None
    basis = HarmonicBasis(120, 8, tuple(k for k in range(121) if k % 2 == 0 or k < 80))
    cut = state.balance.with_basis(basis).at(state.basis.resized(state.x, basis), 1.0)
    assert choose_harmonics(cut, OPTIONS, 1e-5, dropping=True) == HarmonicBasis(120, 8)


def test_symmetric_motions_keep_all():
    """The even harmonics are empty: without them J_0 would not see the symmetry break."""
    parametric = cascade({2: 0.0, 1: 1.0}, nu=2, high=60)
    assert choose_harmonics(parametric, OPTIONS, 1e-5, dropping=True).kept is None
    state = cascade({1: 1.0}, nu=1, high=40)
    x = state.x.copy()
    x[3::4], x[4::4] = 0.0, 0.0
    assert choose_harmonics(state.balance.at(x, 1.0), OPTIONS, 1e-5, dropping=True).kept is None
    some = replace(OPTIONS, minimum=3)
    assert choose_harmonics(state.balance.at(x, 1.0), some, 1e-3, dropping=True).kept is None
