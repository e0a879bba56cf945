"""Methods chosen by the user, and witnesses asked where the monodromy matrix leaves the verdict open."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from slow import slow

import suboctave as so
from suboctave.errors import InputError
from suboctave.floquet.hill import hill_beside
from suboctave.floquet.methods import StabilityMethod, combined, method_of
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.result import FloquetResult
from suboctave.projection import system_of_motions
from suboctave.timedomain import shoot


@pytest.fixture(scope="module")
def doubling():
    curve = so.frequency_response(so.library.reference_oscillator(), (4.5, 3.8), harmonics=31)
    return curve.bifurcations["PD"][0]


def result(*mu, error=1e-6, method="one"):
    mu = np.array(mu, complex)
    return FloquetResult(mu, np.broadcast_to(np.asarray(error, float), mu.shape).copy(), method)


# ------------------------------------------------------------------------------------------------ methods and names
def test_methods_by_object_and_by_name(doubling, at):
    orbit = at(doubling.orbit, doubling.omega * 1.01)
    for name, method in (("monodromy", so.Monodromy()), ("hill", so.Hill())):
        by_name, by_object = so.stability(orbit, method=name), so.stability(orbit, method=method)
        np.testing.assert_array_equal(by_name.multipliers, by_object.multipliers)
        assert method_of(name) == method
    assert so.stability(orbit, method="hill").method == "Hill"
    assert so.Hill() == so.Hill(selection="strip")
    assert hash(so.Hill()) == hash(so.Hill(selection="strip"))


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ("monodrony", "did you mean 'monodromy'"),
        (so.Hill, "give an object, Hill()"),
        (3, "must be a StabilityMethod or a text"),
    ],
)
def test_wrong_methods_are_refused(doubling, method, message):
    with pytest.raises(InputError, match=message):
        so.stability(doubling.orbit, method=method)


def test_wrong_options_are_refused():
    with pytest.raises(InputError, match="witness"):
        so.Arbitration(witnesses=("hill",))


def test_results_read_well(doubling, at):
    clear = so.stability(at(doubling.orbit, doubling.omega * 1.01))
    assert repr(clear).startswith("FloquetResult: stable (monodromy). Multipliers ")
    assert "+- " in repr(clear)
    assert "not applicable (Hill)" in repr(FloquetResult.inapplicable(2, "Hill", "Too few harmonics"))
    assert "UNDECIDED" in repr(result(1.0 + 1e-7, 0.3))
    assert "unstable, 1 of 2 outside" in repr(result(1.2, 0.3))


# --------------------------------------------------------------------------------------------------------- arbitration
def test_decided_points_ask_no_witness(doubling, monkeypatch, at):
    from suboctave.floquet import methods

    monkeypatch.setattr(methods, "hill_beside", lambda *a: pytest.fail("asked without need"))
    found = so.stability(at(doubling.orbit, doubling.omega * 1.001))
    assert found.decided
    assert found.method == "monodromy"
    assert found.note == ""


@pytest.fixture
def coarse(monkeypatch):
    """A monodromy matrix that knows its multipliers to 1e-4 only."""
    from suboctave.floquet import methods

    honest = methods.floquet_multipliers

    def blurred(state):
        found = honest(state)
        return replace(found, errors=found.errors + 1e-4)

    monkeypatch.setattr(methods, "floquet_multipliers", blurred)
    return blurred


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_witnesses_settle_what_the_monodromy_matrix_leaves_open(doubling, at, coarse, side):
    """Beside a period doubling, closer than the error of the first estimate: the verdict is that of shooting."""
    for distance in (2e-7, 5e-7, 1e-6):
        orbit = at(doubling.orbit, doubling.omega * (1.0 + side * distance))
        exact = shoot(orbit.system, orbit.start(), orbit.omega)
        assert not coarse(orbit.state()).decided
        joint = so.stability(orbit)
        assert joint.decided
        assert joint.stable == exact.stable
        assert np.all(np.abs(np.sort(joint.multipliers.real) - np.sort(exact.multipliers.real)) <= joint.errors + 1e-9)
        assert joint.method == "monodromy + Hill"
        assert "Hill settles it" in joint.note
        assert [w.method for w in joint.witnesses] == ["monodromy", "Hill"]
        assert joint.errors[0] < 1e-5


@pytest.mark.usefixtures("coarse")
def test_a_bifurcation_point_stays_undecided_and_says_why(doubling):
    found = so.stability(doubling)
    assert not found.decided
    assert "-1.0000" in found.note
    assert "the circle" in found.note
    assert "Use more harmonics than the motion's 31" in found.note
    assert [w.method for w in found.witnesses] == ["monodromy", "Hill"]


@pytest.mark.parametrize("count", [5, *slow(40)])
def test_roots_beside_multipliers_are_those_of_shooting(random_motions, count):
    """Whatever the monodromy matrix leaves open: the root beside it is within its own estimate of the truth."""
    asked, answered = 0, 0
    for drawn in random_motions(3, count):
        state = drawn.orbit.state()
        known = floquet_multipliers(state)
        found = hill_beside(state, replace(known, errors=np.full(known.errors.shape, 10.0)))
        for mu, error, start in zip(found.multipliers, found.errors, known.multipliers, strict=True):
            large = abs(start) > 0.3
            asked, answered = asked + large, answered + (large and np.isfinite(error))
            if np.isfinite(error):
                assert np.abs(drawn.exact - mu).min() <= error + 1e-9
            else:
                assert mu == start
    assert answered > 0.9 * asked


def test_roots_of_a_few_unknowns_settle_the_verdict_of_many_modes(monkeypatch):
    """A plate of 34 modes with two unknowns, beside its doubling; the eigenvalues of all modes are not asked for."""
    from suboctave.floquet import methods

    monkeypatch.setattr(methods, "hill_multipliers", lambda *a: pytest.fail("all eigenvalues"))
    plate = so.structures.clearance_plate(20, 12)
    doubling = so.frequency_response(plate, (2.31, 2.28), harmonics=15).bifurcations["PD"][0]
    for omega, stable in ((2.29946, True), (2.2994, False)):
        orbit = so.continue_branch(doubling.orbit, "omega", (omega, doubling.omega)).orbits[0]
        known = so.stability(orbit, method="monodromy")
        errors = known.errors.copy()
        errors[0] = 0.01
        verdict = so.Arbitration().settled(orbit.state(), replace(known, errors=errors))
        assert "Hill" in verdict.method
        assert verdict.decided
        assert verdict.stable is stable
        whole = system_of_motions([orbit])
        exact = shoot(whole, whole.reduced(orbit.start()), orbit.omega)
        assert exact.stable is stable
        assert np.abs(exact.multipliers - verdict.multipliers[0]).min() <= verdict.errors[0]


def test_without_damping_nothing_is_asked():
    """Conservative: pairs stay on the circle whatever is computed how accurately."""
    system = so.System(1.0, 0.0, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.1)])
    found = so.stability(so.frequency_response(system, (0.3, 0.4), harmonics=9).orbits[0])
    assert not found.decided
    assert found.note.startswith("Undamped")
    assert found.witnesses == ()


@dataclass(frozen=True)
class Says(StabilityMethod):
    """A witness that says what it is told."""

    name = "told"
    answer: FloquetResult

    def multipliers(self, state):
        return self.answer


def test_a_contradiction_is_said_in_words(doubling, coarse):
    found = coarse(doubling.orbit.state())
    far = replace(found, multipliers=found.multipliers * 1.5, errors=found.errors, method="a liar")
    joint = so.stability(doubling, method=so.Arbitration(witnesses=(Says(far),)))
    assert "monodromy and a liar contradict each other" in joint.note
    assert not joint.decided
    # the doubt covers both
    assert np.all(np.abs(joint.multipliers - found.multipliers) <= joint.errors)


def test_a_silent_witness_is_passed_over(doubling, coarse):
    found = coarse(doubling.orbit.state())
    silent = Says(FloquetResult.inapplicable(2, "mute", "Nothing to say here"))
    sure = Says(result(-1.0 + 1e-7, found.multipliers[1], error=1e-9, method="sure"))
    joint = so.stability(doubling, method=so.Arbitration(witnesses=(silent, sure)))
    assert joint.decided
    assert joint.stable
    assert "sure settles it" in joint.note
    alone = so.stability(doubling, method=so.Arbitration(witnesses=(silent,)))
    assert not alone.decided
    assert "Nothing to say here" in alone.note


# ----------------------------------------------------------------------------------------------------- joint estimates
def test_overlap_of_two_discs():
    def joint(p, a, q, b):
        found, words = combined(result(p, error=a), result(q, error=b))
        return complex(found.multipliers[0]), float(found.errors[0]), words

    # one inside the other: the smaller
    assert joint(1.0, 0.5, 1.1, 0.1) == (1.1, 0.1, "")
    # equal discs a radius apart: centre in the middle, half the chord
    mu, error, words = joint(0.0, 1.0, 1.0, 1.0)
    assert mu == pytest.approx(0.5)
    assert error == pytest.approx(math.sqrt(0.75))
    assert words == ""
    # hardly touching: the overlap is a point, which is not believed
    assert joint(0.0, 1.0, 1.999999, 1.0)[1] == pytest.approx(0.5)
    # apart: around both, and said
    mu, error, words = joint(0.0, 1.0, 4.0, 0.5)
    assert (mu, error) == (pytest.approx(1.75), pytest.approx(2.75))
    assert "one and one contradict each other" in words


def test_the_truth_lies_in_the_joint_disc_if_it_lies_in_both():
    rng = np.random.default_rng(5)
    for _ in range(500):
        truth = complex(*rng.normal(size=2))
        a, b = 10.0 ** rng.uniform(-3, 0, size=2)
        p, q = (truth + e * math.sqrt(rng.uniform()) * np.exp(2j * np.pi * rng.uniform()) for e in (a, b))
        found, words = combined(result(p, error=a), result(q, error=b))
        assert abs(found.multipliers[0] - truth) <= found.errors[0] + 1e-12
        assert found.errors[0] <= min(a, b) + 1e-12
        assert words == ""


def test_multipliers_are_paired_before_they_are_compared():
    found, words = combined(
        result(-1.2, 0.9 + 0.1j, 0.9 - 0.1j, 1e-9, error=[1e-3, 1e-3, 1e-3, 1e-12]),
        result(0.9 - 0.1001j, 0.9 + 0.1001j, 1e-9, -1.2001, error=1e-3),
    )
    assert words == ""
    assert found.errors[-1] == 1e-12
    np.testing.assert_allclose(found.multipliers[:3], [-1.20005, 0.9 + 0.10005j, 0.9 - 0.10005j], atol=1e-12)
    # an estimate without any digit takes those of the other
    found, words = combined(result(1.0, 0.5, error=np.inf), result(0.51, 0.99, error=1e-3))
    assert words == ""
    assert sorted(found.multipliers.real) == [0.51, 0.99]
    assert np.all(found.errors == 1e-3)
