"""Sampling: sharp laws against adaptive quadrature, polynomial laws against products of series, blind sampling."""

from itertools import pairwise

import numpy as np
import pytest
from channels import by_coefficients, channel_of
from scipy.integrate import quad, solve_ivp
from slow import slow

import suboctave as so
from suboctave.errors import ConvergenceError
from suboctave.harmonic import AdaptiveHarmonics, HarmonicBalance, HarmonicBasis
from suboctave.harmonic.quadrature import graded_nodes, polynomial_nodes
from suboctave.harmonic.trigonometric import crossings
from suboctave.model import AdaptiveSampling, CubicSpring, ElasticStop, HarmonicLoad, PolynomialSpring, System, library

MOTIONS = {
    "one harmonic": [0.1, 1.0 - 0.3j],
    "rest": [0.2, 0.0],
    "rough": [-0.2, 0.4, 0.5j, -0.3 + 0.2j, 0.0, 0.25, 0.1j, -0.1],
    "slow passage": [0.0, 0.0, 0.02j, 1.0],
}


def motion_of(name):
    return np.array(MOTIONS[name], complex)


def value(c, tau):
    return np.real(np.exp(1j * np.multiply.outer(np.asarray(tau, float), np.arange(len(c)))) @ c)


def gaps(c):
    """A gap passed at speed, one that is grazed, one just missed."""
    tau = np.linspace(0, 2 * np.pi, 20001)
    x = value(c, tau)
    return {"passed": 0.35 * x.max() + 0.65 * x.min(), "grazed": x.max(), "missed": x.max() + 1e-3 * np.ptp(x) + 1e-3}


@pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
@pytest.mark.parametrize("sharpness", [3e5, *slow(30.0, 3e3)])
@pytest.mark.parametrize("where", ["passed", "grazed", "missed"])
@pytest.mark.parametrize("motion", ["rough", *slow(*(name for name in MOTIONS if name != "rough"))])
def test_sharp_stop_against_adaptive_quadrature(motion, where, sharpness):
    """Integrals that residual, Jacobian and parameter derivatives consist of; the stop's own stiffness is 1."""
    c, top = motion_of(motion), 2 * len(MOTIONS[motion]) + 1
    gap = gaps(c)[where]
    stop = ElasticStop(0, 1.0, gap, side="right", regularization=sharpness)
    numbers = stop.coefficient_values({})
    spectra = channel_of(stop, c, top)
    by = by_coefficients(spectra)
    near = crossings(c, gap, *np.array([[np.cos(t), np.sin(t)] for t in np.linspace(0, 2 * np.pi, 257)[:-1]]).T)
    ends = [0.0, *near[0], 2 * np.pi]
    if where != "passed" and motion != "rest":
        tau = np.linspace(0, 2 * np.pi, 20001)
        ends = sorted([*ends, float(tau[np.argmax(value(c, tau))])])

    def integral(law, q):
        def integrand(tau):
            u = value(c, [tau])
            return law(u)[0] * np.exp(-1j * q * tau)

        total = 0.0
        for a, b in pairwise(ends):
            if b > a:
                # graded towards the passages at both ends
                cuts = np.unique([a, *(a + (b - a) * 0.5 * 10.0 ** -np.arange(0, 6)), b - (b - a) * 1e-2, b])
                cuts = np.unique([*cuts, *(b - (b - a) * 0.5 * 10.0 ** -np.arange(1, 6))])
                total += sum(
                    quad(integrand, p, r, epsabs=1e-12, epsrel=1e-10, limit=200, complex_func=True)[0]
                    for p, r in pairwise(cuts)
                )
        return total / (2 * np.pi)

    zero = np.zeros(1)
    for q in (0, top):
        assert spectra.spectra[0, q] == pytest.approx(
            integral(lambda u: stop.tangent(u, zero, numbers)[0], q), abs=1e-11
        )
        assert spectra.stiffness(0)[q] == pytest.approx(
            integral(lambda u: stop.tangent(u, zero, numbers)[1], q), abs=1e-10
        )
        assert by.force[1, q] == pytest.approx(
            integral(lambda u: stop.coefficient_tangent(u, zero, numbers)[0][1], q), abs=1e-10
        )


@pytest.mark.parametrize("powers", [{3: 0.7}, {2: -0.4, 5: 0.3}, {1: 1.0, 7: 0.2}])
def test_polynomial_laws_are_integrated_exactly(powers):
    """Against products of Fourier series: a power of the motion is a repeated convolution of its coefficients."""
    c = motion_of("rough")
    top = 2 * len(c) + 1
    series = np.concatenate((0.5 * c[:0:-1].conj(), c[:1], 0.5 * c[1:]))

    def power(n):
        result = np.ones(1, complex)
        for _ in range(n):
            result = np.convolve(result, series)
        centre = len(result) // 2
        padded = np.concatenate((result[centre:], np.zeros(top + 1, complex)))
        return padded[: top + 1]

    spring = PolynomialSpring(0, powers)
    spectra = channel_of(spring, c, top)
    force = sum(a * power(n) for n, a in powers.items())
    slope = sum(a * n * power(n - 1) for n, a in powers.items())
    np.testing.assert_allclose(spectra.spectra[0], force, atol=1e-13 * np.abs(force).max())
    np.testing.assert_allclose(spectra.stiffness(0), slope, atol=1e-13 * np.abs(slope).max())


def test_weights_add_up_to_the_period():
    for nodes in (polynomial_nodes(21, 15), graded_nodes(motion_of("rough"), np.array([0.4]), np.array([1e-4]), 15)):
        zr, zi = nodes.zr, nodes.zi
        assert nodes.weights.sum() == pytest.approx(2 * np.pi, rel=1e-13)
        assert np.abs(zr**2 + zi**2 - 1.0).max() < 1e-13
        assert len(zr) == len(np.unique(np.arctan2(zi, zr)))


@pytest.mark.parametrize("harmonics", [1, 2, 3, 4, 6, 8])
@pytest.mark.parametrize("gap", [0.2, 0.9, 1.7])
def test_motions_of_few_harmonics_are_integrated_as_well(harmonics, gap):
    """Against a uniform grid so fine that the law is smooth on it: panels are long there, and the gap is out of reach
    or not.
    """
    c = np.array([0.1] + [0.7 / k**2 * np.exp(1j * k) for k in range(1, harmonics + 1)])
    stop, top = ElasticStop(0, 1.0, gap, side="right", regularization=40.0), 2 * harmonics + 1
    spectra = channel_of(stop, c, top)
    nodes = graded_nodes(c, np.array([gap]), np.array([1.0 / 40.0]), top)
    zr, zi = nodes.zr, nodes.zi
    assert np.abs(zr**2 + zi**2 - 1.0).max() < 1e-14
    tau = 2 * np.pi * np.arange(8192) / 8192
    f, f_u, _ = stop.tangent(value(c, tau), np.zeros_like(tau), stop.coefficient_values({}))
    waves = np.exp(-1j * np.outer(np.arange(top + 1), tau)) / len(tau)
    for found, law in ((spectra.spectra[0], f), (spectra.stiffness(0), f_u)):
        exact = waves @ law
        np.testing.assert_allclose(found, exact, atol=2e-12 * np.abs(exact).max())


class Silent(ElasticStop):
    """A stop that tells nothing of its law."""

    def sampling(self, c):
        return AdaptiveSampling()


def same(one, other):
    return np.abs(other - one).max() <= 1e-11 * np.abs(other).max()


def samples_for(element, c):
    (law,) = channel_of(element, c, 17).laws
    return law.settled_samples(law.members[0], same)


class Broken(CubicSpring):
    """A spring that breaks at u = 1."""

    def sampling(self, c):
        return AdaptiveSampling()

    def tangent(self, u, v, c):
        intact = np.abs(u) < 1.0
        return intact * u, intact.astype(float), None


def test_blind_sampling_settles_on_a_smooth_law_and_agrees_with_the_told_one():
    told = ElasticStop(0, 1.0, 0.3, side="right", regularization=20.0)
    blind = Silent(0, 1.0, 0.3, side="right", regularization=20.0)
    c = motion_of("rough")
    samples = samples_for(blind, c)
    a, b = (channel_of(e, c, 17, samples) for e in (told, blind))
    np.testing.assert_allclose(a.spectra, b.spectra, atol=1e-10)
    assert samples_for(told, c) is None
    # harmonics of a smooth law fall off: fewer samples than for the sharp one
    spring = Silent(0, 1.0, 0.3, side="right", regularization=2.0)
    assert samples_for(spring, c) < samples


@pytest.mark.parametrize("element", [Broken(0, 1.0), Silent(0, 1.0, 0.3, regularization=1e6)], ids=["broken", "sharp"])
def test_a_law_too_sharp_to_be_sampled_blindly_is_refused(element):
    system = System(1.0, 0.1, 1.0, elements=[element], loads=[HarmonicLoad(0, 1.0)])
    balance = HarmonicBalance(system, HarmonicBasis(5))
    x = np.zeros((11, 1))
    x[1] = 1.7
    with pytest.raises(ConvergenceError, match=r"dof=0.*do not resolve the force.*SharpSampling"):
        balance.settle(x, 1.0)


def test_a_contact_that_is_not_reached_needs_no_more_samples_than_what_matters():
    """A smooth contact far from its gap is the rounding of log(1 + e), 1e-12 of the other forces. The response through
    the resonance and past it, where the oscillator is linear, against integration over a period with another form of
    the law.
    """
    law = "x''+0.1*x'+x+20*log(1+exp(30*(x-1)))/30=F*cos(omega*t)"
    system = so.System.from_equations([law], {"F": 0.8})
    curve = so.frequency_response(system, (3.0, 1.1), harmonics=140)
    assert curve.omega[-1] == pytest.approx(1.1)
    assert curve.amplitude[0] == pytest.approx(0.8 / abs(1.0 - 9.0 + 0.3j), abs=1e-10)
    assert curve.amplitude.max() > 5.0
    for i in np.linspace(0, len(curve) - 1, 6).astype(int):
        start, omega = curve.orbits[i].start(), curve.omega[i]

        def rate(t, y, omega=omega):
            contact = 20.0 * np.logaddexp(0.0, 30.0 * (y[0] - 1.0)) / 30.0
            return y[1], 0.8 * np.cos(omega * t) - 0.1 * y[1] - y[0] - contact

        end = solve_ivp(rate, (0.0, 2.0 * np.pi / omega), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        np.testing.assert_allclose(end, start, atol=1e-6 * np.abs(start).max())


@pytest.mark.parametrize("steepness", [1e4, *slow(1.0, 50.0)])
@pytest.mark.parametrize(
    ("text", "law"),
    [
        ("0.2*tanh({}*v)", lambda x, v, s: 0.2 * np.tanh(s * v)),
        ("(1+x**2)*atan({}*(v-0.3))*v", lambda x, v, s: (1.0 + x**2) * np.arctan(s * (v - 0.3)) * v),
    ],
)
def test_steep_texts_in_a_velocity_against_a_million_samples(text, law, steepness):
    """The trapezoidal rule converges like exp(-2 pi d / step), d = 1e-4 the width of the steepest step in time."""
    c, top, count = motion_of("rough"), 17, 1 << 20
    spectrum = channel_of(so.Expression(0, text.format(steepness)), c, top).spectra[0]
    tau = 2.0 * np.pi * np.arange(count) / count
    exact = np.fft.rfft(law(value(c, tau), value(1j * np.arange(len(c)) * c, tau), steepness))[: top + 1] / count
    np.testing.assert_allclose(spectrum, exact, atol=1e-11 * np.abs(exact).max())


def test_steep_friction_as_a_text_is_that_of_the_element():
    tops = []
    for friction in (so.Expression(0, "0.2*tanh(500*v)"), so.TanhFriction(0, 0.2, 1.0 / 500.0)):
        system = System(1.0, 0.02, 1.0, elements=[friction], loads=[HarmonicLoad(0, 0.5)])
        curve = so.frequency_response(system, (0.8, 1.1))
        assert curve.omega[-1] == pytest.approx(1.1)
        tops.append(curve.amplitude.max())
    assert tops[0] == pytest.approx(tops[1], rel=1e-9)


def test_samples_of_slopes_settle_by_what_they_do_to_multipliers():
    """A light mass behind a sharp law that hardly moves: its multipliers are those of the law that is told."""
    told, blind = (kind(1, 1e-4, 1e-5, side="right", regularization=1e6) for kind in (ElasticStop, Silent))
    x = np.zeros((11, 2))
    x[1] = 1.0, 2e-5
    tangents = []
    for element in (told, blind):
        system = System(np.diag([1.0, 1e-4]), np.diag([0.1, 1e-5]), np.eye(2), [element], [HarmonicLoad(0, 1.0)])
        tangents.append(HarmonicBalance(system, HarmonicBasis(5)).settle(x, 1.0).at(x, 1.0).tangent_spectra)
    np.testing.assert_allclose(tangents[1], tangents[0], atol=1e-10 * 1e-4)


def test_samples_stay_frozen_until_settled_again(damper):
    system = System(1.0, 0.1, 1.0, elements=[damper(0, [0.1, 0.5])], loads=[HarmonicLoad(0, 1.0)])
    small, large = np.zeros((11, 1)), np.zeros((11, 1))
    small[1], large[1:6] = 0.1, 2.0
    balance = HarmonicBalance(system, HarmonicBasis(5)).settle(small, 1.0)
    assert balance.at(large, 1.0).laws.members[0].samples == balance.samples[0]
    assert balance.settle(large, 1.0).samples[0] >= balance.samples[0]
    # a system whose laws are all known is not touched
    known = HarmonicBalance(library.duffing(0.1, 1.0, 1.0, 1.0), HarmonicBasis(5))
    assert known.settle(small, 1.0) is known


def test_events_do_not_depend_on_what_a_law_tells():
    """A stop whose law is told and the same sampled blindly: the same event, solved again with many more harmonics than
    the curve has, and so with more samples.
    """
    found = []
    for stop in (ElasticStop, Silent):
        stops = [stop(0, 4.7, 0.0, side="right", regularization=60.0), stop(0, 4.7, -1.0, regularization=60.0)]
        system = System(1.0, 0.06, 1.0, elements=[CubicSpring(0, 0.16), *stops], loads=[HarmonicLoad(0, 0.55)])
        rule = AdaptiveHarmonics(tolerance=3e-3, event_tolerance=1e-8)
        (event,) = so.frequency_response(system, (0.95, 1.1), harmonics=rule).bifurcations
        found.append(event)
    assert found[1].omega == pytest.approx(found[0].omega, rel=1e-10)
    assert found[1].orbit.basis == found[0].orbit.basis
