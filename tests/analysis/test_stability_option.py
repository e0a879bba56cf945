"""The stability method of a curve: what it stores, what stands in for it, and what is said where none can tell."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import suboctave as so
from suboctave.floquet.methods import StabilityMethod
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.result import FloquetResult
from suboctave.timedomain import shoot

OMEGA = (4.5, 1.3)


@pytest.fixture(scope="module")
def rattling():
    return so.library.reference_oscillator(p=0.55, j=0.0)


@pytest.fixture(scope="module")
def default(rattling):
    return so.frequency_response(rattling, OMEGA)


@dataclass(frozen=True)
class Blurred(StabilityMethod):
    """The monodromy matrix with errors made larger, and a witness that may know better."""

    name = "blurred"
    by: float
    knows: bool = False

    def multipliers(self, state):
        found = floquet_multipliers(state)
        return replace(found, errors=found.errors + self.by, method="blurred")

    def settled(self, state, found):
        return replace(floquet_multipliers(state), method="a witness") if self.knows else found


@pytest.mark.parametrize(
    ("method", "written"),
    [("monodromy", "monodromy"), ("hill", "Hill")],
)
def test_the_method_is_that_of_points_and_bifurcations(rattling, default, method, written):
    """The same bifurcations and verdicts; multipliers within both estimates of each other, and those of the method."""
    curve = so.frequency_response(rattling, OMEGA, stability=method)
    assert [b.kind for b in curve.bifurcations] == [b.kind for b in default.bifurcations]
    assert [b.omega for b in curve.bifurcations] == pytest.approx([b.omega for b in default.bifurcations], abs=1e-9)
    assert set(curve.stability_methods) == {written}
    for point in [*curve.points[::20], *curve.bifurcations]:
        alone = so.stability(point, method=method)
        np.testing.assert_allclose(point.floquet.multipliers, alone.multipliers, rtol=1e-9)
        np.testing.assert_allclose(point.floquet.errors, alone.errors, rtol=1e-4, atol=1e-12)
        other = so.stability(point, method="monodromy")
        mine, its = np.sort_complex(alone.multipliers), np.sort_complex(other.multipliers)
        assert np.all(np.abs(mine - its) <= alone.error + other.error)
    for point in curve.points[::20]:
        assert point.floquet.stable == shoot(rattling, point.orbit.start(), point.orbit.omega).stable


def test_what_is_stored_says_where_it_comes_from(rattling, default):
    curve = so.frequency_response(rattling, (4.5, 3.8), stability="hill")
    dataset = curve.to_xarray()
    assert set(dataset["stability_method"].to_numpy()) == {"Hill"}
    assert list(dataset["event_stability_method"].to_numpy()) == ["Hill"] * len(curve.bifurcations.met)
    assert dataset["multiplier_errors"].shape == dataset["multipliers"].shape == (len(curve), 2)
    np.testing.assert_array_equal(dataset["multiplier_errors"], [p.floquet.errors for p in curve.points])
    (doubling,) = curve.bifurcations["PD"]
    at = list(dataset["event_kind"].to_numpy()).index("PD")
    assert float(dataset["event_multiplier_error"][at]) == doubling.critical_error
    assert abs(doubling.critical_multiplier() + 1.0) <= doubling.critical_error
    assert dataset.attrs["stability"] == curve.options["stability"] == "hill"
    assert default.to_xarray().attrs["stability"] == "arbitration"
    # what is written there is what gives it again
    assert so.frequency_response(rattling, (4.5, 4.4), stability="arbitration").options["stability"] == "arbitration"
    other = so.frequency_response(rattling, (4.5, 4.4), stability=so.Hill("symmetry"))
    assert other.options["stability"] == "Hill(selection='symmetry')"


def test_along_any_parameter(default):
    sweep = so.continue_branch(default.orbits[10], "p", (0.3, 0.6), stability="hill")
    assert set(sweep.stability_methods) == {"Hill"}
    other = so.continue_branch(default.system, "p", (0.3, 0.4), omega=4.0, harmonics=15, stability=so.Hill())
    assert set(other.stability_methods) == {"Hill"}
    assert set(so.continue_branch(default.system, "omega", (4.5, 4.4), stability="hill").stability_methods) == {"Hill"}


@pytest.mark.parametrize(
    ("method", "message"),
    [("hil", "did you mean 'hill'"), (so.Hill, "give an object"), (1.0, "must be a StabilityMethod or a text")],
)
def test_wrong_methods_are_refused_before_any_work(default, method, message):
    with pytest.raises(so.InputError, match=message):
        so.frequency_response(default.system, OMEGA, stability=method)
    with pytest.raises(so.InputError, match=message):
        so.continue_branch(default.orbits[0], "p", (0.3, 0.6), stability=method)


def test_where_hill_says_nothing_the_monodromy_matrix_stands_in():
    """Twice the highest natural frequency, 2 * 8, is reached by 5 harmonics above omega = 3.2 only."""
    system = so.System(
        np.eye(2), 0.04 * np.eye(2), np.diag([4.0, 64.0]), [so.CubicSpring(0, 0.1)], [so.HarmonicLoad(0, 0.5)]
    )
    curve = so.frequency_response(system, (3.6, 2.9), harmonics=5, stability="hill")
    said = np.array([method == "Hill" for method in curve.stability_methods])
    np.testing.assert_array_equal(said, curve.omega > 3.2)
    assert np.isfinite(curve.multipliers).all()
    assert all(p.floquet.stands_in != known for p, known in zip(curve.points, said, strict=True))
    (note,) = curve.warnings
    first = curve.omega[~said][0]
    assert note.startswith(f"between omega = {first:.6g} and 2.9: stability method 'hill' is not applicable")
    assert "highest natural frequency" in note
    assert curve.audit.complete


def test_verdicts_are_asked_of_the_method_where_they_are_open(rattling):
    """Errors of 0.02 leave points beside both sides of a period doubling open; the witness settles them."""
    curve = so.frequency_response(rattling, (4.05, 3.9), max_step=0.002, stability=Blurred(0.02, knows=True))
    (doubling,) = curve.bifurcations["PD"]
    asked = np.array(curve.stability_methods) == "a witness"
    assert asked.any()
    assert not asked.all()
    distance = np.abs(np.abs(curve.multipliers) - 1.0).min(axis=1)
    assert np.all(asked[distance <= 0.02])
    assert np.all(distance[asked] <= 0.02 + 1e-3)
    np.testing.assert_array_equal(curve.stable, curve.omega > doubling.omega)
    assert not any("stability is open" in note for note in curve.warnings)


def test_what_no_method_settles_is_stated(rattling):
    """Errors larger than the distance of all multipliers to the circle, and no bifurcation that could be the reason."""
    curve = so.frequency_response(rattling, (4.5, 4.3), max_step=0.01, stability=Blurred(0.2))
    assert not any(p.floquet.decided for p in curve.points)
    assert not curve.bifurcations.met
    (stated,) = curve.audit.unsettled
    assert (stated.first, stated.last) == (curve.omega[0], curve.omega[-1])
    assert "stability is open" in stated.reason
    assert "by blurred" in stated.reason
    assert sum("stability is open" in note for note in curve.warnings) == 1
    assert "stability is open" in repr(curve.audit)


def test_what_a_period_doubling_explains_is_no_complaint(rattling):
    curve = so.frequency_response(rattling, (4.05, 3.9), max_step=0.002, stability=Blurred(0.02))
    (doubling,) = curve.bifurcations["PD"]
    open_ones = [p.orbit.omega for p in curve.points if not p.floquet.decided]
    assert min(open_ones) < doubling.omega < max(open_ones)
    assert curve.audit.complete


def test_a_point_beside_a_located_bifurcation_is_no_complaint(rattling, default):
    """A branch with a point 1e-9 from its period doubling: no method can tell, and the doubling is in the list."""
    doubling = default.bifurcations["PD"][0]
    start = default.orbits[0]
    assert start.omega == 4.5
    curve = so.continue_branch(doubling, "omega", (3.9, 4.1), stability=Blurred(1e-6))
    close = int(np.argmin(np.abs(curve.omega - doubling.omega)))
    assert abs(curve.omega[close] - doubling.omega) < 1e-9
    assert not curve.points[close].floquet.decided
    assert not any("stability is open" in note for note in curve.warnings)
    assert len(curve.bifurcations["PD"]) == 1


def test_witnesses_are_not_asked_for_ever(rattling):
    """Where they cannot settle three motions in a row they are left alone until a verdict is clear again."""
    asked = []

    @dataclass(frozen=True)
    class Vain(Blurred):
        def settled(self, state, found):
            asked.append(state.omega)
            return found

    curve = so.frequency_response(rattling, (4.5, 4.2), harmonics=15, stability=Vain(0.29))
    assert len(curve) > 5
    assert len(asked) == 3
    assert asked == curve.omega[:3].tolist()
    (stretch,) = [u for u in curve.audit.unsettled if "stability is open" in u.reason]
    assert (stretch.first, stretch.last) == (4.5, 4.2)


def test_undamped_motions_are_said_to_be_once():
    system = so.System(1.0, 0.0, 1.0, [so.CubicSpring(0, 1.0)], [so.HarmonicLoad(0, 0.1)])
    curve = so.frequency_response(system, (0.3, 0.5), harmonics=9)
    (note,) = curve.warnings
    assert note.startswith("between omega = 0.3 and 0.5: the motion is undamped")
    assert curve.audit.complete


def test_another_multiplier_on_the_circle_beside_a_bifurcation():
    """Two oscillators that do not know of each other, one all but undamped: at the other's folds its pair is open.

    The monodromy matrix alone says so; by default its witnesses know the pair to the last digits.
    """
    # a spring at the one at rest: multipliers of motions that no element feels are known to rounding
    springs = [so.CubicSpring(0, 1.0), so.CubicSpring(1, 1.0)]
    system = so.System(np.eye(2), np.diag([0.1, 1e-9]), np.diag([1.0, 2.0]), springs, [so.HarmonicLoad(0, 0.3)])
    for method, said in (("monodromy", True), (None, False)):
        curve = so.frequency_response(system, (1.9, 1.2), harmonics=11, stability=method)
        assert len(curve.bifurcations["LP"]) == 2
        folds = ", ".join(f"LP at omega = {fold.omega:.9g}" for fold in curve.bifurcations["LP"])
        assert any(note.startswith(f"{folds}: another multiplier lies") for note in curve.warnings) is said
        for fold in curve.bifurcations["LP"]:
            # exp(-c T / 2), c = 1e-9
            pair = fold.multipliers[np.abs(fold.multipliers.imag) > 0.1]
            assert np.abs(pair) == pytest.approx(1.0 - 0.5e-9 * fold.orbit.period, abs=1e-7 if said else 1e-12)


def test_a_clear_curve_asks_nobody(rattling, monkeypatch):
    from suboctave.floquet import methods

    for name in ("hill_multipliers", "hill_beside"):
        monkeypatch.setattr(methods, name, lambda *a: pytest.fail("asked without need"))
    settled = []
    honest = methods.Arbitration.settled
    monkeypatch.setattr(
        methods.Arbitration, "settled", lambda self, state, found: settled.append(1) or honest(self, state, found)
    )
    curve = so.frequency_response(rattling, OMEGA)
    assert len(curve.bifurcations) == 4
    assert not settled
    assert curve.audit.complete
    assert all(isinstance(p.floquet, FloquetResult) and p.floquet.decided for p in curve.points)
