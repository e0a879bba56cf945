"""Read-offs against closed forms: a linear oscillator, motions made by hand, sums over samples, time integration."""

from __future__ import annotations

import math

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.results.readings import contact_of, gapped_elements, peak_force, read_reading
from suboctave.timedomain import integrate

M, C, K, P = 2.0, 0.1, 3.0, 0.4


@pytest.fixture(scope="module")
def linear():
    system = so.System(M, C, K, loads=[so.HarmonicLoad(0, "p")], parameters={"p": P})
    return so.frequency_response(system, (0.5, 3.0), max_step=0.3)


def by_hand(elements, coefficients, omega=1.3, nu=1, parameters=None, n=1):
    """A motion with these coefficients, whatever the equations would say of it."""
    one = np.eye(n)
    system = so.System(one, 0.0 * one, one, elements, parameters=parameters or {})
    x = np.asarray(coefficients, float).reshape(-1, n)
    balance = so.HarmonicBalance(system, so.HarmonicBasis((len(x) - 1) // 2, nu))
    return so.PeriodicOrbit(balance, x, omega, dict(system.parameters), 0.0)


def test_a_linear_oscillator_has_its_textbook_response(linear):
    omega = linear.omega
    stiffness = K - M * omega**2 + 1j * C * omega
    size = P / np.abs(stiffness)
    close = {"rtol": 1e-9, "atol": 0.0}
    np.testing.assert_allclose(linear.amplitude, size, **close)
    np.testing.assert_allclose(linear.velocity(), omega * size, **close)
    np.testing.assert_allclose(linear.acceleration(), omega**2 * size, **close)
    for rms, factor in ((linear.rms(), 1.0), (linear.velocity_rms(), omega), (linear.acceleration_rms(), omega**2)):
        np.testing.assert_allclose(rms, factor * size / math.sqrt(2.0), **close)
    np.testing.assert_allclose(linear.phase(), -np.angle(stiffness), rtol=1e-8)
    assert linear.phase()[0] < 0.0  # lags
    ground = np.abs(K + 1j * C * omega)
    np.testing.assert_allclose(linear.transmissibility(), ground / np.abs(stiffness), **close)
    np.testing.assert_allclose(linear.transmissibility(None), ground / np.abs(stiffness), **close)
    np.testing.assert_allclose(linear.transmitted_force(), ground * size, **close)


def test_peaks_and_mean_squares_of_a_motion_with_many_harmonics():
    x = np.random.default_rng(3).normal(size=23) / np.r_[1.0, np.repeat(np.arange(1, 12), 2)]
    orbit = by_hand([], x, omega=1.7, nu=2)
    t = np.arange(20000) * orbit.period / 20000
    for order, series in enumerate((orbit.displacement, orbit.velocity, orbit.acceleration)):
        samples = series(t)[0]
        assert orbit.rms(0, order) == pytest.approx(math.sqrt(np.mean(samples**2)), rel=1e-12)
        peak = (orbit.amplitude, orbit.velocity_amplitude, orbit.acceleration_amplitude)[order]()
        assert 0.0 <= peak - np.abs(samples).max() < 1e-5 * peak


@pytest.mark.parametrize("gap", [-0.4, 0.0, 0.3, 0.9999])
@pytest.mark.parametrize("side", ["left", "right"])
def test_contact_of_a_cosine_with_a_stop(gap, side):
    size, k = 1.0, 5.0
    orbit = by_hand([so.ElasticStop(0, k, gap, side=side)], [0.0, 0.6 * size, 0.8 * size])
    above = math.acos(gap / size) / math.pi
    share, impacts = contact_of(orbit, 0)
    assert share == pytest.approx(above if side == "right" else 1.0 - above, abs=1e-12)
    assert impacts == 1
    assert peak_force(orbit, 0) == pytest.approx(k * (size - gap if side == "right" else size + gap), rel=1e-12)


def test_never_and_always_in_contact():
    motion = [0.0, 1.0, 0.0]
    assert contact_of(by_hand([so.ElasticStop(0, 5.0, 1.5)], motion), 0) == (0.0, 0)
    assert contact_of(by_hand([so.ElasticStop(0, 5.0, -1.5, side="right")], motion), 0) == (1.0, 0)


def test_play_is_struck_on_both_sides_and_more_often_by_faster_harmonics():
    joint = so.Freeplay(0, 2.0, 0.25)
    share, impacts = contact_of(by_hand([joint], [0.0, 0.5, 0.0]), 0)
    assert share == pytest.approx(2.0 * math.acos(0.5) / math.pi, abs=1e-12)
    assert impacts == 2
    assert contact_of(by_hand([joint], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5], nu=2), 0)[1] == 6


@pytest.mark.parametrize("sharpness", [50.0, 1e4])
def test_a_rounded_stop_is_in_contact_beyond_its_gap(sharpness):
    orbit = by_hand([so.ElasticStop(0, 5.0, 0.5, regularization=sharpness)], [0.0, 1.0, 0.0])
    assert gapped_elements(orbit.balance.system) == [0]
    assert contact_of(orbit, 0) == (pytest.approx(1.0 / 3.0, abs=1e-12), 1)


def test_peak_forces_of_all_sorts_of_laws():
    size, omega = 0.8, 1.3
    elements = [
        so.CubicSpring(0, 2.0),
        so.PolynomialSpring(0, {1: 1.0, 3: -1.0}),  # largest at u = 1 / sqrt(3), not at the turning point
        so.QuadraticDamper(0, 0.7),
        so.TanhFriction(0, 0.3, 1e-3),
    ]
    orbit = by_hand(elements, [0.0, 0.0, size], omega)
    system = orbit.balance.system
    expected = {
        "CubicSpring": 2.0 * size**3,
        "PolynomialSpring": 2.0 / (3.0 * math.sqrt(3.0)),
        "QuadraticDamper": 0.7 * (omega * size) ** 2,
        "TanhFriction": 0.3,
    }
    for index, element in enumerate(system.elements):
        assert peak_force(orbit, index) == pytest.approx(expected[type(element).__name__], rel=1e-11)


def test_peak_force_of_a_law_in_time():
    system = so.System.from_equations("x'' + x + eps*cos(2*omega*t)*x = 0", {"eps": 0.3})
    balance = so.HarmonicBalance(system, so.HarmonicBasis(2))
    orbit = so.PeriodicOrbit(balance, np.array([[0.0], [0.0], [0.5], [0.0], [0.0]]), 1.1, {"eps": 0.3}, 0.0)
    # |cos(2 tau) sin(tau)| is 1 at tau = pi / 2, more than its other extrema
    assert peak_force(orbit, 0) == pytest.approx(0.3 * 0.5, rel=1e-12)


def test_contacts_against_time_integration(rattling_curve):
    curve = rattling_curve
    stops = [i for i, e in enumerate(curve.system.elements) if isinstance(e, so.ElasticStop)]
    shares, strikes = ({i: read(i) for i in stops} for read in (curve.contact_share, curve.impacts))
    forces = {i: curve.peak_force(i) for i in stops}
    assert {len(set(strikes[i])) for i in stops} == {1, 2}  # one of them begins to touch on the way
    for at in np.linspace(0, len(curve) - 1, 5).astype(int):
        orbit = curve.orbits[at]
        quarter = 0.25 * orbit.period  # two periods from outside of contact, of which the second one counts
        path = integrate(curve.system, orbit.start(), (0.0, 2.0 * orbit.period + quarter), orbit.omega)
        t = np.linspace(0.0, orbit.period, 4001)
        x = path.at(t)[0][:, 0]
        for i in stops:
            element = curve.system.elements[i]
            k, gap = element.coefficient_values(orbit.values)[:2]
            met = [c for c in path.contacts if c.element == i]
            closings = [c.time for c in met if c.closing]
            lengths = [next((o.time for o in met if not o.closing and o.time > c), None) for c in closings]
            within = [c for c in closings if c < closings[0] + 0.999 * orbit.period] if closings else []
            assert strikes[i][at] == len(within)
            if within:
                share = sum(lengths[j] - within[j] for j in range(len(within))) / orbit.period
                assert shares[i][at] == pytest.approx(share, abs=2e-4)
                beyond = max(0.0, (x - gap).max()) if element.side == "right" else max(0.0, (gap - x).max())
                assert forces[i][at] == pytest.approx(k * beyond, rel=1e-3)


def test_what_reaches_the_ground_is_what_the_masses_leave_over():
    mass, k = np.diag([1.0, 0.3]), np.array([[1.4, -0.4], [-0.4, 0.4]])
    system = so.System(
        mass, 0.02 * k, k, [so.CubicSpring((0, 1), 0.5), so.CubicSpring(0, 0.3)], [so.HarmonicLoad(1, 0.2)]
    )
    curve = so.frequency_response(system, (0.5, 0.9), max_step=0.2)
    omega, load = curve.omega, 0.2
    # springs between the masses cancel: F = p - sum m_i x_i''
    first = load + omega**2 * (curve.harmonic(1, 0) + 0.3 * curve.harmonic(1, 1))
    np.testing.assert_allclose(curve.transmissibility(), np.abs(first) / load, rtol=1e-6)
    ratio = np.abs(curve.harmonic(1, 0) / curve.harmonic(1, 1))
    np.testing.assert_allclose(curve.motion_ratio(0, 1), ratio, rtol=1e-14)
    with pytest.raises(InputError, match="no force is applied"):
        curve.transmissibility(direction=[1.0, 0.0])
    with pytest.raises(InputError, match="vector of 2"):
        curve.transmissibility(direction=[1.0])


def test_transmissibility_where_the_force_begins_at_zero():
    curve = so.continue_branch(so.library.duffing(c=0.1, F=0.1), "F", (0.0, 0.1), omega=0.7, max_step=0.3)
    assert "transmissibility" in curve.available_readings()
    ratio = curve.transmissibility()
    assert np.isnan(ratio[0])
    linear = abs(1.0 + 0.07j) / abs(1.0 - 0.49 + 0.07j)
    assert ratio[1] == pytest.approx(linear, rel=1e-2)
    assert np.isfinite(ratio[1:]).all()


def test_readings_are_stored_under_their_names(duffing_curve):
    names = ["rms", "harmonic_3", "phase_1", "peak_force_0"]
    dataset = duffing_curve.to_xarray(readings=names)
    frame = duffing_curve.to_dataframe(readings=names)
    assert set(names) <= set(frame)
    for name in names:
        np.testing.assert_array_equal(dataset[name], frame[name])
        assert dataset[name].attrs["long_name"]
    events = duffing_curve.bifurcations.met
    np.testing.assert_allclose(dataset["event_rms"], [b.orbit.rms(0) for b in events], rtol=1e-15)
    np.testing.assert_allclose(dataset["harmonic_3"], np.abs(duffing_curve.harmonic(3)), rtol=1e-15)
    np.testing.assert_allclose(duffing_curve.reading("peak_force_0"), duffing_curve.amplitude**3, rtol=1e-10)
    every = duffing_curve.to_xarray(readings=True)
    assert set(duffing_curve.available_readings()) <= set(every.data_vars)
    assert "rms" not in duffing_curve.to_xarray()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("velocty", "did you mean 'velocity'"),
        ("harmonic", "needs the number of the harmonic"),
        ("rms_2", "takes no number"),
        ("peak_force_0_dof1", "without _dof1"),
        ("peak_force_0.5", "a whole number"),
        ("amplitude", "is there anyway"),
        ("", "no reading"),
    ],
)
def test_a_reading_that_is_none_is_refused(name, message):
    with pytest.raises(InputError, match=message):
        read_reading(name)


def test_elements_are_chosen_by_index(rattling_curve):
    with pytest.raises(InputError, match="several elements with a gap"):
        rattling_curve.contact_share()
    with pytest.raises(InputError, match="has no gap"):
        rattling_curve.impacts(0)
    with pytest.raises(InputError, match="out of range"):
        rattling_curve.peak_force(7)
    with pytest.raises(InputError, match="element must be a whole number, not 'stop'"):
        rattling_curve.peak_force("stop")
    with pytest.raises(InputError, match="out of range"):
        rattling_curve.reading("peak_force_7")


@pytest.fixture(scope="module")
def named():
    parts = np.diag([1.0, 2.0]), 0.1 * np.eye(2), np.array([[2.0, -1.0], [-1.0, 3.0]])
    system = so.System(*parts, loads=[so.HarmonicLoad(0, 1.0)], dof_names=["21 x", "31 z"])
    return so.frequency_response(system, (0.5, 0.7), harmonics=1)


@pytest.mark.parametrize("name", ["31 z", ("31", "z"), (31, "z"), "node 31 Z", "31:z"])
def test_a_degree_of_freedom_is_given_by_its_name(named, name, tmp_path):
    orbit = named.orbits[0]
    np.testing.assert_array_equal(named.harmonic(1, name), named.harmonic(1, 1))
    np.testing.assert_array_equal(named.rms(name), named.rms(1))
    np.testing.assert_array_equal(named.motion_ratio(name, "21 x"), named.motion_ratio(1, 0))
    assert orbit.amplitude(name) == orbit.amplitude(1)
    assert orbit.harmonic(1, name) == orbit.harmonic(1, 1)
    for draw in (lambda: so.plot(named, dof=name), lambda: so.plot_history(orbit, dof=name)):
        (axes,) = draw().axes
        assert "z_{31}" in axes.get_ylabel()
    so.integrate(named.system, omega=0.5, periods=1).plot(tmp_path / "a.png", dof=name)


def test_readings_of_named_degrees_of_freedom_are_stored_by_number(named):
    np.testing.assert_array_equal(named.reading("amplitude_dof31 z"), named.reading("amplitude_dof1"))
    assert "rms_dof1" in named.to_xarray(readings=["rms_dof31 z"])


def test_a_name_that_no_degree_of_freedom_has_is_refused(named, linear):
    for read in (
        lambda: named.harmonic(1, "31 y"),
        lambda: named.orbits[0].amplitude(("31", "y")),
        lambda: named.reading("rms_dof31 y"),
        lambda: so.plot(named, dof="31 y"),
        lambda: so.plot_history(named.orbits[0], dof="31 y"),
    ):
        with pytest.raises(InputError, match="did you mean '31 z'"):
            read()
    with pytest.raises(InputError, match="they have no names"):
        linear.rms("31 z")
    with pytest.raises(InputError, match="lay it out with"):
        so.plot(named.to_xarray(), dof="31 z")
    (axes,) = so.plot(named.to_xarray(readings=["amplitude_dof31 z"]), dof="31 z").axes
    assert "z_{31}" in axes.get_ylabel()
