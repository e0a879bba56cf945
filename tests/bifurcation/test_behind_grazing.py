"""Bifurcations in the layer behind a grazing: told from smooth ones, and where shooting finds them.

An oscillator with an elastic stop that it just reaches near resonance folds back at once (Ing, Pavlovskaia,
Wiercigroch, Banerjee, Phil. Trans. R. Soc. A 366, 2008; Jiang, Chong, Ueda, Wiercigroch, Int. J. Mech. Sci. 127, 2017):
the stiffer the stop, the closer the fold lies to the grazing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.curves.augmentation import Augmentation, Equations
from suboctave.curves.events import layer
from suboctave.curves.events.layer import behind_grazing
from suboctave.curves.events.locate import Guess, solve
from suboctave.curves.events.monitors import LimitPoint, NeimarkSacker
from suboctave.errors import ConvergenceError
from suboctave.timedomain import locate_by_shooting, shoot


def oscillator(Kc, zeta, share, length=1.0, time=1.0, regularization=None):
    """Unit mass, spring and force; the gap is a share of the resonance's linear amplitude."""
    return so.System(
        mass=1.0,
        damping=2.0 * zeta / time,
        stiffness=1.0 / time**2,
        elements=[
            so.ElasticStop(
                dof=0, stiffness=Kc / time**2, gap=share * length / (2.0 * zeta), regularization=regularization
            )
        ],
        loads=[so.HarmonicLoad(dof=0, amplitude=length / time**2)],
    )


def first_fold(system, omega=(1.3, 0.95), harmonics="adaptive", **options):
    curve = so.frequency_response(system, omega, harmonics=harmonics, **options)
    return curve, curve.bifurcations["LP"][0]


def behind(b):
    """How far behind its grazing a bifurcation lies, in omega."""
    return b.omega - b.contact.parameter


@pytest.mark.parametrize(
    ("Kc", "zeta", "share"),
    [
        (30.0, 0.05, 0.5),
        (1000.0, 0.05, 0.999),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((30.0, 0.01, 0.5), (200.0, 0.01, 0.999))),
    ],
)
def test_folds_behind_a_grazing_by_shooting(Kc, zeta, share):
    curve, fold = first_fold(oscillator(Kc, zeta, share))
    grazing = curve.grazings[0]
    assert fold.residual < 1e-10
    assert not fold.smooth
    assert fold.contact.element == 0
    assert fold.contact.parameter == pytest.approx(grazing.omega, abs=1e-10)
    witness = locate_by_shooting(curve.system, "LP", fold.orbit.start(), fold.omega)
    error = abs(fold.omega - witness.omega)
    assert error < 0.05 * abs(behind(fold))  # the layer itself is resolved, not only its place
    assert error < fold.uncertainty < 0.3 * abs(behind(fold))
    assert fold.amplitude - grazing.amplitude == pytest.approx(witness.amplitude - grazing.amplitude, rel=0.1)
    assert fold.arclength > grazing.arclength
    row = next(r for r in repr(curve.bifurcations).splitlines() if r.startswith("LP"))
    assert f"{behind(fold):+.1e} from the grazing of ElasticStop" in row


def test_the_layer_is_thinner_by_the_square_of_the_stiffness():
    """g_0 + c k sqrt(s) vanishes at s = (g_0 / (c k))^2: distance times stiffness squared is one number."""
    constant = [behind(first_fold(oscillator(Kc, 0.01, 0.5), harmonics=9)[1]) * Kc**2 for Kc in (50.0, 150.0, 450.0)]
    assert constant[1:] == pytest.approx(constant[:-1], rel=0.01)


def test_beyond_the_smallest_steps_a_fold_is_discontinuous():
    for Kc, thin in ((30.0, False), (3000.0, True)):
        curve, fold = first_fold(oscillator(Kc, 0.01, 0.5))
        assert fold.discontinuous is thin
        assert ("discontinuous, at the grazing" in repr(curve.bifurcations)) is thin
        assert (fold.contact.distance < 1e-7) is thin
        # the multipliers on both sides of the fold: inside before the grazing, outside behind the layer
        at = np.searchsorted(curve.arclength, fold.arclength)
        assert curve.stable[at - 1]
        assert not curve.stable[at + 1]
        assert fold.omega == pytest.approx(curve.grazings[0].omega, abs=1e-7)


@pytest.mark.parametrize(("length", "time"), [(1e-6, 1.0), (1e3, 1e-3)])
def test_units_and_range_do_not_change_the_label(length, time):
    _, fold = first_fold(oscillator(200.0, 0.05, 0.5, length, time), (1.3 / time, 0.95 / time))
    _, other = first_fold(oscillator(200.0, 0.05, 0.5), (1.15, 1.0))
    assert fold.smooth is other.smooth is False
    assert behind(fold) * time == pytest.approx(behind(other), rel=1e-3)


def test_smooth_bifurcations_are_not_laid_at_a_contacts_door(oscillator_curve):
    curve = oscillator_curve(0.55, omega=(4.5, 1.3))
    labelled = [(b.kind, b.smooth) for b in curve.bifurcations]
    # the lower fold follows the first touch of the left stop; peak and period doublings are a matter of long contacts
    assert labelled == [("PD", True), ("PD", True), ("LP", False), ("LP", True)]
    assert not any(b.discontinuous for b in curve.bifurcations)
    assert all(b.uncertainty == 0.0 for b in curve.bifurcations if b.smooth)


def test_a_rounded_law_has_no_layer():
    _, fold = first_fold(oscillator(30.0, 0.05, 0.5, regularization=300.0))
    assert fold.smooth


def test_a_pair_that_leaves_the_circle_behind_a_grazing():
    """Two masses and a stop: a Neimark-Sacker point a millionth behind the grazing, seen by shooting on both sides."""
    curve = so.frequency_response(so.library.two_mass_unilateral(), (0.5, 0.6), harmonics=63)
    (torus,) = curve.bifurcations["NS"]
    (grazing,) = curve.grazings
    assert not torus.smooth
    assert 0.0 < behind(torus) < 3e-6
    inside, outside = (
        shoot(curve.system, torus.orbit.start(), grazing.omega + share * behind(torus)) for share in (0.5, 2.0)
    )
    assert np.abs(inside.multipliers).max() < 1.0
    assert np.count_nonzero(np.abs(outside.multipliers) > 1.0) == 2


def guess_at(orbit, name="omega", span=0.35):
    return Guess(orbit.state(), name, span)


@pytest.mark.parametrize(
    ("Kc", "zeta", "share", "rounding"),
    [(1000.0, 0.01, 0.5, 1e-8), (30.0, 0.05, 0.5, 1e-9), (200.0, 0.01, 0.999, 1e-9)],
)
def test_newton_starts_right_behind_the_grazing(Kc, zeta, share, rounding):
    """From before the grazing no gradient leads to the fold; from right behind it Newton's method finds it.

    With the stiffest stop the fold lies 2e-11 behind its grazing: 1e-14 of omega are 1e-9 of the residual.
    """
    curve, fold = first_fold(oscillator(Kc, zeta, share), harmonics=9)
    orbit = curve.grazings[0].orbit
    for size in 10.0 ** -np.arange(4, 10):
        for sign in (1.0, -1.0):
            start = guess_at(replace(orbit, x=orbit.x * (1.0 - sign * size)))
            if sign > 0.0:
                with pytest.raises(ConvergenceError):
                    LimitPoint().solve(start)
            found = behind_grazing(LimitPoint(), start)
            assert found is not None, (size, sign)
            assert found.state.omega == pytest.approx(fold.omega, abs=1e-12)
            assert abs(found.state.omega - fold.omega) < 0.01 * abs(behind(fold))
            assert found.residual < rounding


@pytest.mark.parametrize("kind", [LimitPoint(), NeimarkSacker()], ids=lambda kind: kind.name)
def test_a_contact_that_changes_nothing_brings_nothing_about(kind, monkeypatch):
    _, fold = first_fold(oscillator(30.0, 0.05, 0.5), harmonics=9)
    start = replace(guess_at(fold.orbit), kappa=0.3)
    monkeypatch.setattr(layer, "weighted_operator", lambda *_: (np.eye(3, dtype=complex), np.ones(3)))
    assert behind_grazing(kind, start) is None


def test_a_determinant_that_grows_behind_the_grazing_has_no_zero_there(monkeypatch):
    """A line in the root of the way that would vanish before the grazing: the bifurcation is none of its layer."""
    curve, fold = first_fold(oscillator(30.0, 0.05, 0.5), harmonics=9)
    grazing, original = curve.grazings[0].orbit.state(), layer.weighted_operator

    def mirrored(state, kind, kappa):
        here, there = (original(one, kind, kappa)[0] for one in (grazing, state))
        return 2.0 * here - there, None

    assert behind_grazing(LimitPoint(), guess_at(fold.orbit)) is not None
    monkeypatch.setattr(layer, "weighted_operator", mirrored)
    assert behind_grazing(LimitPoint(), guess_at(fold.orbit)) is None


def test_where_fewer_harmonics_have_none_it_is_as_uncertain_as_its_grazing(monkeypatch):
    """Another stop is struck before: the grazing of the second one moves with the harmonics of that."""
    stops = [so.ElasticStop(0, 5.0, gap) for gap in (-0.3, 0.8)]
    system = so.System(1.0, 0.1, 1.0, stops, [so.HarmonicLoad(0, 0.5)])
    places = {}
    for harmonics in (9, 6):
        curve = so.frequency_response(system, (0.3, 1.2), harmonics=harmonics)
        places[harmonics] = next(item for item in curve.grazings if item.contact.gap == 0.8)
    moved = abs(places[6].omega - places[9].omega)
    assert moved > 1e-5

    def none(*_):
        raise ConvergenceError("no solution")

    monkeypatch.setattr(layer, "solve_or_behind", none)
    stated = layer.unresolved(LimitPoint(), guess_at(places[9].orbit), places[9].contact)
    assert stated == pytest.approx(moved / (9 / 6 - 1.0), rel=1e-6)


def test_newton_does_not_take_any_standstill_for_convergence():
    """A system whose residual cannot vanish (an extremum that misses its gap) is refused, not rounded."""
    curve, _ = first_fold(oscillator(30.0, 0.05, 0.5), harmonics=9)
    orbit = curve.orbits[0]
    low = np.abs(orbit.coefficients).max()

    class Square(Equations):
        values = rows = renewed = None

        def __init__(self, state):
            self.state = state
            self.values = np.array([(state.x[1, 0] / low) ** 2 + 1.0])
            self.rows = np.zeros((1, state.x.size + 1))
            self.rows[0, 1] = 2.0 * state.x[1, 0] / low**2

    class OutOfReach(Augmentation):
        name = "out of reach"

        def at(self, state, extra, names):
            return Square(state)

    with pytest.raises(ConvergenceError):
        solve(guess_at(orbit), OutOfReach(), np.zeros(0))


def test_what_cannot_be_solved_is_bracketed_and_says_so(monkeypatch):
    def refuse(self, guess):
        raise ConvergenceError("refused by the test")

    monkeypatch.setattr(LimitPoint, "solve", refuse)
    curve, fold = first_fold(oscillator(200.0, 0.05, 0.5), (1.3, 1.0), 9)
    assert fold.uncertainty >= abs(behind(fold)) > 0.0
    assert fold.discontinuous
    assert any("LP at omega" in note and "grazes there" in note for note in curve.warnings)
    grazing = curve.grazings[0]
    assert abs(fold.omega - grazing.omega) <= fold.uncertainty
    dataset = curve.to_xarray()
    kinds = [str(k) for k in dataset["event_kind"].to_numpy()]
    assert float(dataset["event_uncertainty"][kinds.index("LP")]) == fold.uncertainty
