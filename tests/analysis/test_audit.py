"""Nothing missed: pairs of events inside one step, found or stated; and what a branch says of its own search."""

from __future__ import annotations

import json
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from slow import slow

import suboctave as so
from suboctave.curves.crossings import first_doubtful
from suboctave.curves.trace import Audit, Unsettled
from suboctave.timedomain import locate_by_shooting, shoot

#: beside the default, largest steps that hold whole pairs of events
STEPS = [None, 0.3, *slow(0.1)]
each_step = pytest.mark.parametrize("max_step", STEPS)


def both_ways(system, omega, max_step=None, harmonics="adaptive", **options):
    """The curve in both directions."""
    low, high = omega
    ways = ((low, high), (high, low))
    return [so.frequency_response(system, way, harmonics=harmonics, max_step=max_step, **options) for way in ways]


def doubtful(places, values, at):
    """Where a zero of one function may hide."""
    signs, sizes = np.where(np.asarray(values) < 0.0, -1.0, 1.0), np.log(np.maximum(np.abs(values), 1e-300))
    doubt = first_doubtful(places, [np.array([[sign], [size]]) for sign, size in zip(signs, sizes, strict=True)], at)
    return None if doubt is None else doubt[1]


def places(curve, kind):
    return sorted(b.omega for b in curve.bifurcations[kind])


# ------------------------------------------------------------------------------- interpolation with a verdict
def test_a_pair_of_zeros_inside_an_interval_is_suspected():
    """(s - c)^2 - d, sampled at -1 ... 4: two zeros in (1, 2), or none but nearly so."""
    at = np.arange(-1.0, 5.0)
    for c in (1.3, 1.5, 1.7):
        for d in (0.01, 1e-4, 1e-6, 0.0):
            share = doubtful(at, (at - c) ** 2 - d, 2)
            assert share is not None
            assert 0.4 <= share <= 0.6  # both parts shrink
            assert abs(1.0 + share - np.clip(c, 1.4, 1.6)) < 0.11
        # the places tell the parabola exactly: what stays away from zero by little is seen to
        assert doubtful(at, (at - c) ** 2 + 1e-3, 2) is None
        # and in the intervals beside there is nothing
        for beside in (at - 1.0, at + 1.0):
            assert doubtful(beside, (beside - c) ** 2 - 1e-4, 2) is None


def test_one_zero_is_one_zero():
    at = np.array([-0.5, 0.4, 1.0, 1.7])
    assert doubtful(at, 2.0 * at - 1.3, 1) is None
    assert doubtful(at, np.sinh(at - 0.7), 1) is None


def test_three_zeros_are_not_taken_for_one():
    """Ends of opposite sign and two more zeros inside: (s - 1/2)((s - c)^2 - d)."""
    at = np.array([-1.0, 0.0, 1.0, 2.0])
    for d in (0.02, 1e-3, 1e-5):
        values = (at - 0.5) * ((at - 0.7) ** 2 - d)
        assert doubtful(at, values, 1) is not None


def test_what_was_not_foretold_is_not_believed():
    """A kink beside the interval spoils the foretelling: the distance to zero must make up for it."""
    at = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    kink = 10.0 * np.maximum(at - 3.0, 0.0)
    assert doubtful(at, 0.2 + kink, 3) is not None
    assert doubtful(at, 20.0 + kink, 3) is None
    # a step further off it does not matter
    assert doubtful(at[:4], (0.2 + kink)[:4], 1) is None


def test_a_third_difference_that_is_small_by_chance_is_not_believed():
    """The third derivative of a quartic vanishes on the way: the parabola through the last places before an interval
    then meets its far end, and says nothing of the inside.
    """
    at = np.array([-0.117, -0.0588, -0.0235, -0.0094, 0.0, 0.0588])

    def quartic(s):
        return 450.0 * (s - 0.0111) ** 2 + 2600.0 * (s + 0.0588) * s * (s + 0.0235) * (s - 0.0588) - 0.001

    assert quartic(0.0) > 0.0 > quartic(0.0111)
    assert doubtful(at, quartic(at), 4) is not None


def turning_pair(me):
    """A plate on unequal springs, coupled skew-symmetrically, under a rotating unbalance: one after the other a pair of
    multipliers meets at -1, one of the two real ones passes it and comes back, and they part again.
    """
    force = "0.3*{0}*(x**2+y**2) + 0.1*(x**2+y**2)*{0}'"
    return so.System(
        np.eye(2), 0.1 * np.eye(2), [["1", "kx"], ["-kx", "1.1"]],
        [so.Expression(dof, force.format(name), inputs={"x": 0, "y": 1}) for dof, name in enumerate("xy")],
        [so.RotatingUnbalance(0, me, perpendicular=1), so.StaticLoad(1, -0.1)], {"kx": 0.13},
    )  # fmt: skip


@pytest.mark.parametrize("me", [0.15, *slow(0.14, 0.16)])
@pytest.mark.parametrize("omega", [(2.9, 1.2), pytest.param((3.0, 0.3), marks=pytest.mark.slow)])
def test_a_pair_that_meets_at_minus_one(me, omega):
    found, finer = (
        so.frequency_response(turning_pair(me), omega, max_step=step).bifurcations["PD"] for step in (None, 0.03)
    )
    assert len(found) == len(finer) == 2
    for here, there in zip(found, finer, strict=True):
        assert here.omega == pytest.approx(there.omega, abs=1e-7)
        shot = shoot(turning_pair(me), here.orbit.start(), here.omega)
        assert abs(shot.multipliers + 1.0).min() < 1e-4


def test_scale_and_sign_do_not_matter():
    rng = np.random.default_rng(3)
    for _ in range(200):
        n = int(rng.integers(3, 7))
        at = np.cumsum(rng.uniform(0.2, 1.0, n))
        values = rng.normal(size=n) + 1.0
        k = int(rng.integers(0, n - 1))
        k = min(max(k, n - 4), 2)
        share = doubtful(at, values, k)
        assert doubtful(7.0 * at - 3.0, 1e-9 * values, k) == pytest.approx(share, abs=1e-9)
        assert doubtful(at, -values, k) == pytest.approx(share, abs=1e-9)


@pytest.mark.parametrize("gap", [0.3, 0.03, 0.003, 3e-4])
def test_pairs_of_zeros_of_smooth_functions_are_cut_down_to(gap):
    """Looking where the doubt is, as the audit does: a pair is separated, and a near miss cleared, in few looks."""

    def search(function):
        known = {s: function(s) for s in np.linspace(0.0, 5.0, 8)}
        pending = list(pairwise(sorted(known)))
        looks = 0
        while pending:
            p, q = pending.pop()
            order = sorted(known)
            i = order.index(p)
            low, high = max(0, i - 2), min(len(order), i + 4)
            stencil = order[low:high]
            share = doubtful(stencil, [known[s] for s in stencil], i - low)
            if share is not None and q - p > 1e-6:
                middle = p + share * (q - p)
                known[middle] = function(middle)
                looks += 1
                pending += [(middle, q), (p, middle)]
        signs = [known[s] > 0.0 for s in sorted(known)]
        return sum(a != b for a, b in pairwise(signs)), looks

    def pair(s):
        return (1.0 + 0.3 * np.sin(s)) * (np.cosh(s - 2.7) - np.cosh(0.5 * gap))

    found, looks = search(pair)
    assert found == 2
    assert looks < 60
    missed, looks = search(lambda s: pair(s) + 2.0 * (1.0 + 0.3 * np.sin(s)) * (np.cosh(0.5 * gap) - 1.0))
    assert missed == 0
    assert looks < 60


# ---------------------------------------------------------------------------------------- period doublings
def rattling(j, **options):
    return so.library.reference_oscillator(p=0.55, j=j, regularization=3000.0, **options)


@cache
def shot(j):
    """The two period doublings by shooting, ascending."""
    system = rattling(j)
    pair = so.frequency_response(system, (2.4, 1.7)).bifurcations["PD"]
    return sorted(locate_by_shooting(system, "PD", b.orbit.start(), b.omega).omega for b in pair)


@pytest.mark.parametrize("max_step", [0.3, *slow(None)])
@pytest.mark.parametrize("j", [0.177, *slow(0.17, 0.176)])
def test_period_doublings_about_to_merge(j, max_step):
    system = rattling(j)
    for curve in both_ways(system, (1.7, 2.4), max_step):
        assert len(places(curve, "PD")) == 2
        assert len(curve.bifurcations) == 2
        assert not curve.audit.unsettled
        assert places(curve, "PD") == pytest.approx(shot(j), abs=1e-6)


@pytest.mark.parametrize("max_step", [0.3, *slow(None)])
def test_a_pair_that_only_more_harmonics_show(max_step):
    """At j = 0.177125 they are 6e-4 apart. With the five harmonics that suffice for the curve there are none."""
    system = rattling(0.177125)
    for curve in both_ways(system, (1.7, 2.4), max_step):
        pair = places(curve, "PD")
        assert len(pair) == 2
        assert len(curve.bifurcations) == 2
        # a tenth of what the two are apart
        assert pair == pytest.approx(shot(0.177125), abs=min(1e-5, 0.1 * (pair[1] - pair[0])))
    between = shoot(system, curve.bifurcations[0].orbit.start(), float(np.mean(pair)))
    assert np.count_nonzero(between.multipliers.real < -1.0) == 1


def test_a_fixed_number_of_harmonics_says_what_it_cannot_show():
    """With five harmonics and no more allowed, the multipliers cross and the equations' own test does not."""
    curve = so.frequency_response(rattling(0.177125), (2.4, 1.7), harmonics=5)
    assert not curve.bifurcations["PD"]
    stated = [u for u in curve.audit.unsettled if "-1" in u.reason or "-1.0000" in u.reason]
    assert any(min(u.first, u.last) < 2.0217 < max(u.first, u.last) for u in stated)
    assert any("2.0" in note for note in curve.warnings)


@each_step
def test_a_pair_never_goes_missing_silently(max_step):
    """From either side of the merging at j = 0.177129: found, or stated."""
    for j in (0.177128, 0.17713):
        for curve in both_ways(rattling(j), (1.7, 2.4), max_step):
            if len(places(curve, "PD")) != 2:
                assert not places(curve, "PD")
                assert j > 0.177129 or any(
                    min(u.first, u.last) < 2.0217 < max(u.first, u.last) for u in curve.audit.unsettled
                )


@each_step
def test_no_pair_is_seen_where_there_is_none(max_step):
    for curve in both_ways(rattling(0.178), (1.7, 2.4), max_step):
        assert not len(curve.bifurcations)
        assert not curve.audit.unsettled
        assert not curve.warnings


@pytest.mark.parametrize("max_step", [None, *slow(0.1, 0.15, 0.3)])
def test_two_doublings_within_one_step(max_step):
    """The exact law just above the grazing of the left stop: both lie within one step, and it is only these two."""
    stored = json.loads((Path(__file__).parents[1] / "data" / "reference.json").read_text())
    expected = sorted(e[1] for e in stored["reference_oscillator"]["exact_p0.55_j0_below_1.3"])
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    for curve in both_ways(system, (1.1, 3.0), max_step):
        pair = [w for w in places(curve, "PD") if w < 1.3]
        assert pair == pytest.approx(expected, abs=1e-6)
        assert len(curve.bifurcations) == 5
        assert curve.audit.complete
    # one real multiplier beyond -1 between them, none on either side
    for omega, outside in ((1.2, 0), (1.225, 0), (1.24, 1), (1.252, 0), (1.3, 0)):
        nearest = curve.orbits[int(np.argmin(np.abs(curve.omega - omega)))]
        mu = shoot(system, nearest.start(), omega).multipliers
        assert np.count_nonzero(np.abs(mu) > 1.0) == outside, omega


# ------------------------------------------------------------------------------------------ limit points
def cusp(c):
    """Force and omega at the cusp of `x'' + c x' + x + x^3 = F cos` with one harmonic, and its folds at a force.

    With z = a^2, W = omega^2, p = 1 + 3/4 z: `F^2 = z [(p - W)^2 + c^2 W]`, and d F^2 / dz = 0 gives W(z), two roots.
    """

    def response(z, sign):
        p = 1.0 + 0.75 * z
        b = 2.0 * p + 1.5 * z - c**2
        w = 0.5 * (b + sign * np.sqrt(b**2 - 4.0 * (p**2 + 1.5 * z * p)))
        return w, np.sqrt(z * ((p - w) ** 2 + c**2 * w))

    def roots(z):
        p = 1.0 + 0.75 * z
        return (2.0 * p + 1.5 * z - c**2) ** 2 - 4.0 * (p**2 + 1.5 * z * p)

    first = brentq(roots, 0.5 * c, 5.0 * c)
    least = minimize_scalar(
        lambda z: response(z, -1)[1], bounds=(first, 2.0), method="bounded", options={"xatol": 1e-13}
    )

    def folds(force):
        ends = [(first * (1.0 + 1e-12), least.x), (least.x, 2.0)]
        at = [brentq(lambda z: response(z, -1)[1] - force, *e, xtol=1e-15) for e in ends]
        return sorted(np.sqrt(response(z, -1)[0]) for z in at)

    return float(least.fun), folds


@each_step
@pytest.mark.parametrize("above", [1e-2, 1e-4, 1e-6])
def test_folds_about_to_merge(above, max_step):
    """Closer and closer to the cusp: both folds, where the closed form has them, in both directions."""
    force, folds = cusp(0.1)
    system = so.library.duffing(c=0.1, F=force * (1.0 + above))
    for curve in both_ways(system, (0.9, 1.6), max_step, 1):
        assert places(curve, "LP") == pytest.approx(folds(force * (1.0 + above)), abs=1e-9)
        assert len(curve.bifurcations) == 2


@each_step
@pytest.mark.parametrize("below", [1e-2, 1e-4, 1e-6])
def test_no_folds_below_the_cusp(below, max_step):
    force, _ = cusp(0.1)
    for curve in both_ways(so.library.duffing(c=0.1, F=force * (1.0 - below)), (0.9, 1.6), max_step, 1):
        assert not len(curve.bifurcations)


# ------------------------------------------------------------------------------------------- tori
#: forcing at which the absorber's two Neimark-Sacker points meet, between 9.8800025e-2 and 9.880003e-2
MEET = 0.09880003


@each_step
@pytest.mark.parametrize("above", [1e-6, *slow(1e-2, 1e-4)])
def test_neimark_sacker_points_about_to_merge(above, max_step):
    system = so.library.nltva(MEET * (1.0 + above))
    for curve in both_ways(system, (1.0, 1.17), max_step):
        low, high = places(curve, "NS")
        assert len(curve.bifurcations) == 2
        orbit = min(curve.orbits, key=lambda o: abs(o.omega - 0.5 * (low + high)))
        if above > 1e-5:
            # shooting sees the pair outside between them and inside beside them
            for omega, outside in ((0.5 * (low + high), 2), (2.0 * low - high, 0), (2.0 * high - low, 0)):
                mu = shoot(system, orbit.start(), omega).multipliers
                assert np.count_nonzero(np.abs(mu) > 1.0) == outside


@each_step
@pytest.mark.parametrize("below", [1e-3, 1e-5])
def test_no_tori_below(below, max_step):
    system = so.library.nltva(MEET * (1.0 - below))
    for curve in both_ways(system, (1.0, 1.17), max_step):
        assert not len(curve.bifurcations)
        assert curve.stable.all()
        worst = curve.points[int(np.argmax(np.abs(curve.multipliers[:, 0])))].orbit
        assert np.abs(shoot(system, worst.start(), worst.omega).multipliers).max() < 1.0


# ------------------------------------------------------------------------------------ what the branch says
def test_a_branch_says_how_finely_it_was_examined(rattling_curve):
    audit = rattling_curve.audit
    steps = np.diff(rattling_curve.arclength)
    assert audit.complete
    assert audit.unsettled == ()
    # probes between points: intervals as long as steps at most
    assert 0.0 < audit.finest <= steps.min() * (1.0 + 1e-9)
    assert audit.finest < audit.longest <= steps.max() * (1.0 + 1e-9)
    assert audit.probes > 0
    assert "nothing unsettled" in repr(audit)
    assert f"{audit.probes} probes between points" in repr(audit)
    assert f"from {audit.finest:.1e} to {audit.longest:.1e} of arclength" in repr(audit)


def test_steps_bound_the_intervals():
    coarse, fine = (
        so.frequency_response(so.library.duffing(), (3.0, 1.0), max_step=step).audit for step in (0.2, 0.02)
    )
    assert fine.longest <= 0.02 * (1.0 + 1e-9) < coarse.longest <= 0.2 * (1.0 + 1e-9)


def test_audits_of_two_directions_are_joined():
    back = Audit(1e-3, 0.1, 5, 1, (Unsettled("p", 1.0, 2.0, (0.2, 0.5), "something is in doubt"),))
    on = Audit(1e-4, 0.05, 7, 0, (Unsettled("p", 3.0, 4.0, (0.1, 0.3), "something else is"),))
    whole = back.reversed_before(on, 2.0)
    assert (whole.finest, whole.longest, whole.probes, whole.refused) == (1e-4, 0.1, 12, 1)
    first, second = whole.unsettled
    assert (first.first, first.last) == (2.0, 1.0)
    assert first.arclength == (1.5, 1.8)
    assert second.arclength == (2.1, 2.3)
    assert not whole.complete
    text = repr(whole)
    assert "2 unsettled:" in text
    assert "between p = 2 and 1 something is in doubt" in text
    assert "between p = 3 and 4 something else is" in text
    assert repr(Audit()) == "Audit: no interval examined"


def test_what_is_unsettled_is_said_in_words():
    """A test that never settles: every step is stated, once, with its range."""
    from suboctave.curves import interior

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interior, "MOST_PROBES", 0)
        curve = so.frequency_response(so.library.duffing(c=0.1, F=0.3), (3.0, 0.5), max_step=0.3)
    assert curve.audit.unsettled
    assert not curve.audit.complete
    for stretch in curve.audit.unsettled:
        assert stretch.parameter == "omega"
        assert stretch.arclength[0] < stretch.arclength[1]
        at = np.interp(stretch.arclength, curve.arclength, curve.omega)
        # a step may be unsettled in two ways, before and behind a motion inside it
        known = np.isin(stretch.arclength, curve.arclength)
        assert at == pytest.approx([stretch.first, stretch.last], abs=2e-2)
        assert at[known] == pytest.approx(np.array([stretch.first, stretch.last])[known], abs=1e-9)
        assert all(any(reason in note for note in curve.warnings) for reason in stretch.reason.split("; "))
        assert str(stretch) in repr(curve.audit)


@each_step
@pytest.mark.parametrize("omega", [(0.5682, 0.7), (0.7, 0.5682)])
def test_a_pair_right_before_a_contact_ceases(omega, max_step):
    """Behind a grazing that lies just beyond a step nothing foretells the square root: two masses and a stop."""
    system = so.System(
        np.diag([0.7049123, 1.18393191]),
        [[0.10397774, -0.04522106], [-0.04522106, 0.0630743]],
        [[3.62325192, -1.75523209], [-1.75523209, 1.75523209]],
        [so.ElasticStop(dof=0, stiffness=4.504318617, gap=-0.3697493876)],
        [so.HarmonicLoad(dof=0, amplitude=0.427502387669)],
    )
    curve = so.frequency_response(system, omega, max_step=max_step)
    found = sorted(b.omega for b in curve.bifurcations)
    assert [b.kind for b in curve.bifurcations] == ["PD", "PD"]
    assert found == pytest.approx([0.570918, 0.579010], abs=2e-6)
    # shooting on either side of each: stable, unstable, stable
    sides = [found[0] - 1e-4, 0.5 * (found[0] + found[1]), found[1] + 1e-4]
    starts = [min(curve.points, key=lambda p: abs(p.orbit.omega - side)).orbit.start() for side in sides]
    assert [shoot(system, start, side).stable for start, side in zip(starts, sides, strict=True)] == [True, False, True]
