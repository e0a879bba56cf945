"""Loads where no element acts add no unknown: all is as with every degree of freedom unknown."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.harmonic import HarmonicBalance, HarmonicBasis, StructuralMatrices
from suboctave.harmonic.energy import mean_energy

N = 6
OMEGA = (0.88, 1.0)


def chain(*loads, gap=0.5, phi=0.0):
    """A chain with a stop at its end; a parameter in the stiffness of the first wall."""
    stiffness = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    wall = np.zeros((N, N))
    wall[0, 0] = 1.0
    return so.System(
        np.eye(N), 0.06 * stiffness, {"1": stiffness, "k0": wall}, [so.ElasticStop(N - 1, "Kc", "gap")],
        list(loads) or [so.HarmonicLoad(1, "p", phase="phi")], {"Kc": 3.0, "gap": gap, "p": 0.4, "k0": 0.1, "phi": phi},
    )  # fmt: skip


def many():
    """Loads at several harmonics and places, with phases, a static one, one along two degrees of freedom."""
    return chain(
        so.HarmonicLoad(1, ["p", "p*omega**2/9"], [1, 2], ["phi", 0.4]), so.HarmonicLoad(3, 0.1, phase="2*phi + k0"),
        so.HarmonicLoad((0, 2), 0.05, static=0.02), so.HarmonicLoad(N - 1, 0.03), phi=0.3,
    )  # fmt: skip


def whole(system, *arguments, **options):
    return so.frequency_response(system, *arguments, linear=StructuralMatrices(system), **options)


@pytest.fixture(scope="module")
def pair():
    system = chain()
    return so.frequency_response(system, OMEGA, harmonics=9), whole(system, OMEGA, harmonics=9)


def test_one_unknown_and_the_same_events(pair):
    small, full = pair
    assert small.orbits[0].balance.size == 1
    assert [event.kind for event in small.bifurcations] == [event.kind for event in full.bifurcations]
    assert {event.kind for event in small.bifurcations} == {"PD"}
    for one, other in zip(small.bifurcations, full.bifurcations, strict=True):
        assert one.omega == pytest.approx(other.omega, rel=1e-9)
        assert one.amplitude == pytest.approx(other.amplitude, rel=1e-6)


def test_residual_and_its_derivatives():
    """Loads by omega, by what they depend on, and by a parameter of the stiffness; twice by each of two."""
    system = many()
    linear = so.condense(system, 1.0, harmonics=5)
    balance = HarmonicBalance(system, HarmonicBasis(5), linear=linear)
    x, values, step = 0.4 * np.random.default_rng(3).normal(size=(11, 1)), dict(system.parameters), 1e-5

    def at(name, way):
        moved = {**values, name: values[name] + way * step} if name != "omega" else values
        return balance.at(x, 0.6 + (way * step if name == "omega" else 0.0), moved)

    for name in ("omega", "p", "phi", "k0"):
        ahead, behind = at(name, 1.0), at(name, -1.0)
        exact = at(name, 0.0)
        difference = (ahead.residual - behind.residual) / (2.0 * step)
        np.testing.assert_allclose(exact.residual_by(name), difference, rtol=1e-6, atol=1e-6)
        for other in ("omega", "p", "phi", "k0"):
            difference = (ahead.load_by(other) - behind.load_by(other)) / (2.0 * step)
            np.testing.assert_allclose(exact.load_by(name, other), difference, atol=1e-8)


def test_the_motion_of_the_structure():
    """Displacements, forces on the ground, the force applied and the energy, under loads of all kinds."""
    system = many()
    small = so.frequency_response(system, (0.6, 0.62), harmonics=7, observe=2)
    full = whole(system, (0.6, 0.62), harmonics=7, observe=2)
    one, other = small.orbits[0], full.orbits[0]
    assert one.omega == other.omega
    assert one.balance.size == 1
    np.testing.assert_allclose(one.coefficients, other.coefficients, atol=1e-9)
    for read in ("transmitted_force", "transmissibility"):
        np.testing.assert_allclose(getattr(small, read)()[0], getattr(full, read)()[0], rtol=1e-8)
    energies = [mean_energy(orbit.state()) for orbit in (one, other)]
    assert energies[0] == pytest.approx(energies[1], rel=1e-9)


def test_a_results_file_holds_it(pair, tmp_path):
    small, _ = pair
    again = so.load(small.save(tmp_path / "small.nc") or tmp_path / "small.nc")
    np.testing.assert_allclose(again.orbits[5].coefficients, small.orbits[5].coefficients, atol=1e-14)


def test_sensitivities(pair):
    small, full = pair
    one, other = (so.sensitivity(branch.bifurcations["PD"][0]) for branch in (small, full))
    for name in ("k0", "p", "gap"):
        assert one[name] == pytest.approx(other[name], rel=1e-6)


@pytest.mark.parametrize("dof", [1, 3])
def test_peaks_where_no_element_acts(dof):
    """The observed degree of freedom becomes an unknown for its peak to be followed."""
    system = chain(gap=2.0)
    curves = [
        so.track_peak(branch, "p", (0.4, 0.42))
        for branch in (
            so.frequency_response(system, (0.35, 0.55), harmonics=5, observe=dof),
            whole(system, (0.35, 0.55), harmonics=5, observe=dof),
        )
    ]
    assert curves[0].orbits[0].balance.size == 2
    assert all(curve.observe == dof for curve in curves)
    ends = [(curve.omega[-1], curve.amplitude[-1]) for curve in curves]
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-7)


def test_phases_of_loads_elsewhere():
    """A linear chain's displacement at the load lags by a quarter of the period."""
    curve = so.phase_resonance(
        chain(gap=50.0), parameter="p", bounds=(0.4, 0.6), omega=(0.3, 0.6), harmonics=5, observe=1
    )
    assert curve.orbits[-1].balance.size == 2
    for orbit in (curve.orbits[0], curve.orbits[-1]):
        assert np.angle(orbit.harmonic(1, 1)) == pytest.approx(-0.5 * np.pi, abs=1e-8)
        np.testing.assert_allclose(orbit.coefficients, whole_motion(orbit), atol=1e-9)


def whole_motion(orbit):
    """The linear response of the whole structure there."""
    stiffness = StructuralMatrices(orbit.system).stiffness(np.array([orbit.omega]))[0]
    c = np.linalg.solve(stiffness, orbit.values["p"] * np.eye(N)[1])
    x = np.zeros((orbit.basis.size, N))
    x[1], x[2] = c.real, -c.imag
    return x


def test_a_linear_part_of_other_loads_is_refused():
    linear = so.condense(chain(), 1.0)
    with pytest.raises(InputError, match="made for other loads"):
        so.frequency_response(chain(so.HarmonicLoad(2, "p", phase="phi")), OMEGA, linear=linear)
    # loads that the unknowns hold, and others of the same place, do not matter
    for loads in ([so.HarmonicLoad(N - 1, "p", phase="phi")], [so.HarmonicLoad(1, "2*p", phase="phi")]):
        so.frequency_response(chain(*loads), (0.88, 0.881), linear=linear, harmonics=3)


def test_the_base_moves():
    """A load along all degrees of freedom."""
    stiffness = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    base = so.BaseAcceleration(0.2, np.ones(N))
    system = so.System(np.eye(N), 0.06 * stiffness, stiffness, [so.ElasticStop(N - 1, 3.0, 0.5)], [base])
    small, full = so.frequency_response(system, (0.4, 0.41), harmonics=7), whole(system, (0.4, 0.41), harmonics=7)
    assert small.orbits[0].balance.size == 1
    np.testing.assert_allclose(small.orbits[0].coefficients, full.orbits[0].coefficients, atol=1e-9)
