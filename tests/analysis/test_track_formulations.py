"""Curves of bifurcations by every formulation: the same to rounding, the published one to truncation; derivatives."""

import numpy as np
import pytest

import suboctave as so
from suboctave.curves.kinds.extended import ExtendedOperator, PublishedDoubling
from suboctave.errors import InputError
from suboctave.harmonic.perturbation import Kind


@pytest.fixture(scope="module")
def response():
    return so.frequency_response(so.library.reference_oscillator(p=0.55), (4.5, 1.3), harmonics=15)


def extrema(curve, name):
    return np.array([[e.omega, e.parameter(name)] for e in curve.extrema])


def test_period_doublings_over_the_gap(response):
    """Shooting and converged harmonic balance put the extremum at (2.018228, 0.1778746)."""
    doubling = response.bifurcations["PD"][0]
    found = [
        extrema(so.track(doubling, "j", (0, 1), formulation=f), "j") for f in ("bordered", "extended", "alcorta2019")
    ]
    np.testing.assert_allclose(found[1], found[0], atol=1e-8)
    np.testing.assert_allclose(found[2], found[0], atol=1e-6)
    np.testing.assert_allclose(found[2][0], [2.018228, 0.1778746], atol=1e-5)


@pytest.mark.parametrize("formulation", ["extended", "alcorta2019"])
def test_limit_points_and_doublings_of_doubled_motions(formulation):
    """In the basis of 2T, with shifts in time; the published system over the force too."""
    strong = so.frequency_response(so.library.reference_oscillator(p=1.7), (4.5, 2.2), harmonics=9)
    twice = so.switch_branch(strong.bifurcations["PD"][0])
    for kind in ("LP", "PD"):
        item = twice.bifurcations[kind][0]
        options = {"parameter": "p", "bounds": (1.5, 1.9), "omega": (2.2, 4.5)}
        one, other = (so.track(item, **options, formulation=f) for f in ("bordered", formulation))
        for end in (0, -1):
            assert other.omega[end] == pytest.approx(one.omega[end], abs=1e-8 if formulation == "extended" else 2e-5)


def test_neimark_sacker_points_with_a_complex_null_vector():
    absorber = so.frequency_response(so.library.nltva(0.11), (0.9, 1.25), harmonics=5)
    item = absorber.bifurcations["NS"][0]
    one, other = (so.track(item, "F", (0.05, 0.14), formulation=f) for f in ("bordered", "extended"))
    np.testing.assert_allclose(extrema(other, "F"), extrema(one, "F"), atol=1e-8)
    assert len(one.extrema) > 0


@pytest.mark.parametrize("kind", [Kind.INTEGER, Kind.HALF, Kind.FREE, "published"])
def test_derivatives_by_differences(kind):
    """Two DOFs with a contact and a damper, at a motion that solves nothing."""
    system = so.System(
        [[1.0, 0.0], [0.0, 2.0]],
        [[0.1, -0.05], [-0.05, 0.1]],
        [[2.0, -1.0], [-1.0, "k"]],
        elements=[so.ElasticStop(dof=0, stiffness="s", gap=0.1), so.CubicSpring(dof=(0, 1), coefficient=0.3)],
        loads=[so.HarmonicLoad(dof=0, amplitude=1.0)],
        parameters={"k": 2.5, "s": 1.5},
    )
    balance = so.HarmonicBalance(system, so.HarmonicBasis(4))
    rng = np.random.default_rng(3)
    x = rng.standard_normal((9, 2)) / np.arange(1, 10)[:, None]
    omega, names, kappa = 1.3, ("omega", "s"), 0.3
    state = balance.at(x, omega)
    if kind == "published":
        own, extra = PublishedDoubling.started(state)
        augmentation = own.at(state, extra, names).renewed()
    else:
        augmentation, extra = ExtendedOperator.started(state, kind, kappa)
        extra = extra + 0.01 * rng.standard_normal(len(extra))

    def values(u):
        n = balance.dimension
        at = balance.at(u[:n].reshape(9, 2), u[-2], {**system.parameters, "s": u[-1]})
        return augmentation.at(at, u[n:-2], names).values

    u = np.concatenate((x.ravel(), extra, [omega, 1.5]))
    rows = augmentation.at(state, extra, names).rows
    for i in range(len(u)):
        step = 1e-6
        unit = np.eye(1, len(u), i)[0] * step
        slope = (values(u + unit) - values(u - unit)) / (2.0 * step)
        np.testing.assert_allclose(rows[:, i], slope, atol=2e-7 * max(1.0, np.abs(rows).max()))


def test_a_misspelt_formulation(response):
    with pytest.raises(InputError, match="extended"):
        so.track(response.bifurcations["PD"][0], "j", (0, 1), formulation="extendd")
