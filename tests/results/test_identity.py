"""Which motions are one: shifts by load periods are, mirror images are not, and every count and search says so.

x'' + c x' + x^3 = F cos(omega t) is invariant under x(t) -> -x(t + T / 2), so that motions without that symmetry come
in pairs, which share every modulus of a harmonic.
"""

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.curves.identity import Relation, apart, lies_on, mirrored, relation
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.evaluation import HarmonicBalance
from suboctave.timedomain import integrate


@pytest.fixture(scope="module")
def cubic():
    """The oscillator: symmetric responses are unstable between two pitchforks, 0.805 and 1.479."""
    return so.System(
        mass=1.0,
        damping=0.2,
        stiffness=0.0,
        elements=[so.CubicSpring(dof=0, coefficient=1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F")],
        parameters={"F": 7.5},
    )


@pytest.fixture(scope="module")
def loop(cubic):
    """Its closed branch of unsymmetric motions, which holds both images of each."""
    curve = so.frequency_response(cubic, (1.6, 1.4))
    return so.switch_branch(curve.bifurcations["BP"][0], bounds=(1.0, 1.6))


def shifted(orbit, halves, signs):
    """signs * x(t + halves T / 2), from the definition, as an orbit."""
    t = np.arange(256) / 256.0 * orbit.period
    x = np.asarray(signs)[:, None] * orbit.displacement(t + halves * np.pi / orbit.omega)
    c = np.fft.rfft(x, axis=1).T / 128.0
    c[0] *= 0.5
    rows = np.zeros_like(orbit.coefficients)
    top = orbit.basis.harmonics
    rows[0], rows[1::2], rows[2::2] = c[0].real, c[1 : top + 1].real, -c[1 : top + 1].imag
    return replace(orbit, x=rows)


def rewritten(orbit, harmonics, nu):
    """The same motion in another basis."""
    basis = HarmonicBasis(harmonics, nu)
    return replace(
        orbit,
        balance=HarmonicBalance(orbit.system, basis).settle(
            orbit.basis.resized(orbit.coefficients, basis), orbit.omega
        ),
        x=orbit.basis.resized(orbit.x, basis),
    )


def test_a_mirror_image_is_another_motion_and_a_shift_is_none(cubic, loop):
    doubled = so.switch_branch(loop.bifurcations["PD"][0])
    one, two = loop.orbits[len(loop) // 4], doubled.orbits[len(doubled) // 2]
    assert relation(one, one) is Relation.SAME
    assert relation(one, shifted(one, 1, [-1.0])) is Relation.MIRRORED
    assert relation(one, loop.orbits[len(loop) // 4 + 1]) is Relation.OTHER
    assert relation(two, shifted(two, 2, [1.0])) is Relation.SHIFTED
    for halves in (1, 3):
        assert relation(two, shifted(two, halves, [-1.0])) is Relation.MIRRORED
    # neither the period that a motion is written with nor the number of its harmonics matters
    assert relation(rewritten(one, 2 * one.basis.harmonics, 2), one) is Relation.SAME
    assert relation(rewritten(one, one.basis.harmonics + 8, 1), one) is Relation.SAME
    assert relation(rewritten(one, 60, 2), shifted(one, 1, [-1.0])) is Relation.MIRRORED
    # a symmetric motion is its own image
    symmetric = so.frequency_response(cubic, (1.6, 1.55)).orbits[0]
    assert relation(symmetric, shifted(symmetric, 1, [-1.0])) is Relation.SAME
    assert mirrored(symmetric) is None
    # the image has the even harmonics with the other sign
    even = np.linalg.norm(one.amplitudes[::2]) / np.linalg.norm(one.amplitudes)
    assert apart(one, shifted(one, 1, [-1.0])) == pytest.approx(2.0 * even)


def test_signs_of_single_masses_mirror_and_their_permutation_does_not():
    """Two equal masses on equal springs: exchanging them is a symmetry too, and gives another motion."""
    system = so.System(
        mass=np.eye(2),
        damping=0.1 * np.eye(2),
        stiffness=np.array([[2.0, -1.0], [-1.0, 2.0]]),
        elements=[so.CubicSpring(dof=i, coefficient=1.0) for i in (0, 1)],
        loads=[so.HarmonicLoad(dof=0, amplitude=1.0)],
    )
    orbit = so.frequency_response(system, (0.9, 0.8)).orbits[0]
    other = replace(orbit, x=orbit.x[:, ::-1].copy())
    assert np.allclose(np.sort(np.abs(orbit.amplitudes), axis=1), np.sort(np.abs(other.amplitudes), axis=1))
    assert relation(orbit, other) is Relation.OTHER
    assert relation(orbit, shifted(orbit, 0, [1.0, -1.0])) is Relation.MIRRORED
    assert relation(orbit, shifted(orbit, 1, [-1.0, -1.0])) is Relation.SAME


def test_a_motion_lies_on_a_curve_and_its_image_does_not(loop):
    n = len(loop) // 2
    half = loop.points[3 : n - 3]
    for i in (5, n // 3, n // 2):
        between = loop.orbits[i].omega + 0.37 * (loop.orbits[i + 1].omega - loop.orbits[i].omega)
        branch = so.continue_branch(loop.orbits[i], "omega", (loop.orbits[i].omega, between))
        motion = branch.orbits[-1]
        assert lies_on(motion, half)
        assert not lies_on(mirrored(motion), half)
        assert lies_on(mirrored(motion), half, images=True)
        assert lies_on(mirrored(motion), loop.points)


def test_without_the_symmetry_there_is_no_image(loop):
    weighed = loop.system.with_parameters()
    assert mirrored(loop.orbits[10]) is not None
    system = so.System(
        mass=1.0,
        damping=0.2,
        stiffness=0.0,
        elements=[so.CubicSpring(dof=0, coefficient=1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude="F"), so.StaticLoad(dof=0, force=0.02)],
        parameters=dict(weighed.parameters),
    )
    orbit = so.frequency_response(system, (1.6, 1.55)).orbits[0]
    assert mirrored(orbit) is None


@pytest.mark.slow
def test_coexisting_mirror_images_are_counted_each(cubic):
    """Where the map has four stable motions, time integration from their states stays on four different ones."""
    regimes = so.regime_map(cubic, (1.25, 1.6), "F", (7.4, 7.6), depth=1, values=2)
    for omega, count in ((1.55, 1), (1.4, 2), (1.32, 4)):
        assert regimes.label(omega, 7.5).count == count
    cells, labels = regimes.raster(40, 4)
    assert max(labels[number].count for number in np.unique(cells)) == 4
    motions = regimes.motions(1.32, 7.5)
    period = 2.0 * np.pi / 1.32
    reached = []
    for orbit in motions:
        start = orbit.start() + 1e-3
        end = integrate(cubic, start, np.array([0.0, 60 * period]), 1.32, cubic.parameters, rtol=1e-8)
        reached.append((end.x[-1, 0], end.v[-1, 0]))
        assert np.linalg.norm(np.array(reached[-1]) - orbit.start()) < 1e-3
    apart_in_time = [np.hypot(a[0] - b[0], a[1] - b[1]) for i, a in enumerate(reached) for b in reached[:i]]
    assert min(apart_in_time) > 0.05


def test_a_search_finds_both_partners_of_a_pair():
    """The 2T isola of the Duffing oscillator exists twice: motions of even order have no odd symmetry."""
    system = so.library.duffing(c=0.1).with_parameters(F=5.0)
    found = so.find_subharmonics(system, (2.0, 4.5), subharmonic=2)
    assert len(found) == 2
    assert all(branch.closed and branch.nu == 2 for branch in found)
    images = [mirrored(orbit) for orbit in found[0].orbits[::5]]
    assert all(lies_on(image, found[1].points) and not lies_on(image, found[0].points) for image in images)


def test_a_diagram_follows_what_leaves_mirrored_doublings(cubic):
    diagram = so.bifurcation_diagram(cubic, (1.6, 0.9), depth=2)
    doubled = [node.branch for node in diagram if node.branch.nu == 2]
    assert len(doubled) == 2
    image = mirrored(doubled[0].orbits[len(doubled[0]) // 2])
    assert lies_on(image, doubled[1].points)
    assert not lies_on(image, doubled[0].points)
