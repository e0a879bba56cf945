"""Systems of the literature: an absorber, Duffing oscillators, a chain of ten masses, two masses with a stop."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so


def test_nonlinear_absorber(reference, same_events):
    curve = so.frequency_response(so.library.nltva(0.11), (0.8, 1.5))
    expected = [[*e, None] for e in reference["nltva_F0.11"]]
    assert [b.kind for b in curve.bifurcations] == ["NS", "NS", "LP", "LP"]
    # the stored numbers are rounded to 5 digits (NS: to 4)
    for b, e in zip(sorted(curve.bifurcations, key=lambda b: b.omega), expected, strict=True):
        assert b.kind == e[0]
        assert b.omega == pytest.approx(e[1], abs=6e-5 if e[0] == "NS" else 6e-6)
    peak = so.frequency_response(curve.system, (1.0, 1.06), max_step=0.01).amplitude.max()
    assert peak == pytest.approx(reference["nltva_F0.11_peak"], abs=6e-6)
    assert [np.count_nonzero(np.abs(b.multipliers) > 1.0 + 1e-6) for b in curve.bifurcations["NS"]] == [0, 0]


def test_neimark_sacker_multipliers_lie_on_the_circle():
    curve = so.frequency_response(so.library.nltva(0.11), (1.0, 1.2))
    for b in curve.bifurcations["NS"]:
        mu = b.critical_multiplier()
        assert abs(mu) == pytest.approx(1.0, abs=1e-6)
        assert b.kappa * b.orbit.period == pytest.approx(np.angle(mu), abs=1e-6)
        assert 0.0 < b.kappa < 0.5 * b.omega


def test_softening_duffing(reference, same_events):
    system = so.library.duffing(c=0.12, alpha=-0.1, F=0.2)
    curve = so.frequency_response(system, (0.3, 1.5))
    same_events(curve.bifurcations, reference["duffing_softening"]["events"], omega=6e-7)


@pytest.mark.parametrize("omega", [(0.3, 6.0), (6.0, 0.3)], ids=["up", "down"])
def test_duffing_breaks_its_symmetry(reference, same_events, omega):
    """The branch goes straight on at both branch points, and the fold of the other branch is not taken for one."""
    curve = so.frequency_response(so.library.duffing(), omega)
    expected = reference["duffing_symmetry_breaking"]["events"]
    same_events(curve.bifurcations, expected, omega=6e-7)
    in_order = [b.omega for b in curve.bifurcations]
    stored = [e[1] for e in expected]
    assert in_order == pytest.approx(stored if omega[0] < 1.0 else stored[::-1], abs=6e-7)
    even = max(np.abs(curve.harmonic(k)).max() for k in (0, 2, 4))
    assert even < 1e-9 * curve.amplitude.max()


@pytest.mark.slow
def test_chain_of_ten_masses(chain_data, same_events):
    """Kinds, order and places of shooting. Default options reach what adaptive harmonics promise for events, 3e-7 of
    the motion; the two folds and the Neimark-Sacker points lie within 1e-3 of each other in omega."""
    curve = so.frequency_response(chain(chain_data), tuple(chain_data["omega"]), observe=chain_data["masses"] - 1)
    expected = [[e["kind"], e["omega"], e["amplitude_last_mass"]] for e in chain_data["bifurcations"]]
    assert [b.kind for b in curve.bifurcations] == [e[0] for e in expected]
    assert [b.omega for b in curve.bifurcations] == pytest.approx([e[1] for e in expected], abs=1e-7)
    same_events(curve.bifurcations, expected, omega=1e-7, amplitude=3e-6)
    unstable = np.array([point.floquet.unstable for point in curve.points])
    stored = [(e["omega"], e["amplitude_last_mass"], e["unstable_multipliers"]) for e in chain_data["response"]]
    for omega, amplitude, count in stored:
        nearest = np.argmin(np.hypot((curve.omega - omega) / 0.2, (curve.amplitude - amplitude) / 2.0))
        neighbours = unstable[max(0, nearest - 1) : nearest + 2]
        assert count in neighbours


@pytest.mark.slow
def test_chain_of_ten_masses_with_many_harmonics(chain_data, same_events):
    system, last = chain(chain_data), chain_data["masses"] - 1
    curve = so.frequency_response(system, tuple(chain_data["omega"]), harmonics=63, observe=last)
    expected = [[e["kind"], e["omega"], e["amplitude_last_mass"]] for e in chain_data["bifurcations"]]
    same_events(curve.bifurcations, expected, omega=3e-9, amplitude=2e-6)


def test_two_masses_with_a_stop():
    """A stiff stop near grazing: multipliers change quickly there, but every point lies where shooting finds it."""
    curve = so.frequency_response(so.library.two_mass_unilateral(), (0.5, 0.8))
    assert [b.kind for b in curve.bifurcations] == ["NS", "NS", "PD", "PD", "LP", "LP"]
    for b in curve.bifurcations:
        check = so.verify(b)
        assert check.agrees, check
        assert check.solution.omega == pytest.approx(b.omega, abs=5e-6)


def chain(data):
    n = data["masses"]
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    damping = data["damping"]["of_mass"] * np.eye(n) + data["damping"]["of_stiffness"] * stiffness
    stop = so.ElasticStop(dof=n - 1, stiffness=data["stop"]["stiffness"], gap=data["stop"]["gap"])
    return so.System(np.eye(n), damping, stiffness, [stop], [so.HarmonicLoad(dof=0, amplitude=data["force"])])
