"""Curves of sub-harmonic motions that leave harmonics out: the motions, what is quoted of them, and their files."""

import numpy as np
import pytest

import suboctave as so


@pytest.fixture(scope="module")
def doubled():
    """The reference oscillator, strongly forced: from its first period doubling past two more."""
    system = so.library.reference_oscillator(p=1.7, regularization=3000.0)
    curve = so.frequency_response(system, (2.455, 2.38))
    return so.switch_branch(curve.bifurcations["PD"][0], bounds=(2.38, 3.06))


@pytest.fixture(scope="module")
def quadrupled(doubled):
    """Motions of four load periods, with enough harmonics for leaving some out to be worth it."""
    return so.switch_branch(doubled.bifurcations["PD"][1], bounds=(2.5, 3.06))


def _shooting(reference, period):
    rows = reference["subharmonics_s3000"]["p1.7"][period]
    return sorted(omega for kind, omega, _ in rows if kind == "PD")


def test_harmonics_are_left_out_where_they_are_not_missed(quadrupled):
    assert np.all(quadrupled.kept <= quadrupled.harmonics)
    some = [o for o in quadrupled.orbits if o.basis.kept is not None]
    assert some
    assert all(f"{o.basis.count // 2} of {o.basis.harmonics}" in repr(o) for o in some)
    # a new choice follows when the estimate has passed the tolerance
    assert quadrupled.truncation.max() < 1.5e-5
    for orbit in some[:: max(1, len(some) // 3)]:
        k = orbit.basis.left_out
        assert not orbit.coefficients[2 * k].any()
        assert not orbit.coefficients[2 * k - 1].any()
        # time integration knows no harmonics
        assert so.verify(orbit), so.verify(orbit)


def test_what_is_quoted_leaves_none_out(quadrupled, reference):
    assert all(b.orbit.basis.kept is None for b in quadrupled.bifurcations)
    (found,) = quadrupled.bifurcations["PD"]
    assert found.omega == pytest.approx(_shooting(reference, "4T")[1], abs=1e-6)
    assert all(b.residual < 1e-9 for b in quadrupled.bifurcations)
    assert not quadrupled.warnings


def test_files_know_what_is_left_out(quadrupled, tmp_path):
    loaded = so.load(quadrupled.save(tmp_path / "quadrupled.nc"))
    for a, b in zip(quadrupled.orbits, loaded.orbits, strict=True):
        assert a.basis == b.basis
        assert a.coefficients.tobytes() == b.coefficients.tobytes()
        assert a.state().residual.tobytes() == b.state().residual.tobytes()
    np.testing.assert_array_equal(quadrupled.kept, loaded.kept)


def test_twice_the_period_needs_less_than_twice_the_harmonics(doubled, reference):
    """Of motions that are grown up; the doublings are those of shooting."""
    four = so.switch_branch(doubled.bifurcations["PD"][1], bounds=(2.975, 3.06))
    (found,) = four.bifurcations["PD"]
    assert found.omega == pytest.approx(_shooting(reference, "4T")[1], abs=1e-6)
    eight = so.switch_branch(found, bounds=(2.972, 3.06))
    # born where nothing may be left out
    assert doubled.orbits[0].basis.kept is None
    assert four.orbits[0].basis.kept is None
    assert eight.orbits[0].basis.kept is None
    sizes = [curve.orbits[-1].basis.count for curve in (doubled, four, eight)]
    assert sizes[0] < sizes[1] < 2 * sizes[0]
    assert sizes[1] < sizes[2] < 2 * sizes[1]
    assert max(curve.truncation[-1] for curve in (doubled, four, eight)) < 1e-5
