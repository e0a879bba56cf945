"""Harmonics of the motions of a cascade of period doublings, and what is quoted of them."""

import pytest

import suboctave as so


@pytest.fixture(scope="module")
def doubled():
    """The reference oscillator, strongly forced: from its first period doubling past two more."""
    system = so.library.reference_oscillator(p=1.7, regularization=3000.0)
    curve = so.frequency_response(system, (2.455, 2.38))
    return so.switch_branch(curve.bifurcations["PD"][0], bounds=(2.38, 3.06))


def _shooting(reference, period):
    rows = reference["subharmonics_s3000"]["p1.7"][period]
    return sorted(omega for kind, omega, _ in rows if kind == "PD")


@pytest.mark.slow
def test_four_periods_are_those_of_shooting(doubled, reference, tmp_path):
    quadrupled = so.switch_branch(doubled.bifurcations["PD"][1], bounds=(2.5, 3.06))
    # a new choice follows when the estimate has passed the tolerance
    assert quadrupled.truncation.max() < 1.5e-5
    assert so.verify(quadrupled.orbits[-1])  # time integration knows no harmonics
    (found,) = quadrupled.bifurcations["PD"]
    assert found.omega == pytest.approx(_shooting(reference, "4T")[1], abs=1e-6)
    assert all(b.residual < 1e-9 for b in quadrupled.bifurcations)
    assert not quadrupled.warnings
    loaded = so.load(quadrupled.save(tmp_path / "quadrupled.nc"))
    for a, b in zip(quadrupled.orbits, loaded.orbits, strict=True):
        assert a.basis == b.basis
        assert a.coefficients.tobytes() == b.coefficients.tobytes()
        assert a.state().residual.tobytes() == b.state().residual.tobytes()
