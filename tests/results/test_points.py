"""Points of a curve at a value, peaks, and what is asked of single motions: against closed forms and other ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import suboctave as so
from suboctave.floquet.result import FloquetResult
from suboctave.results.branch import Branch

ZETA, F = 0.02, 0.3


@pytest.fixture(scope="module")
def duffing():
    return so.System.from_equations(
        "x'' + 2*zeta*x' + x + a*x**3 = f*cos(omega*t)", parameters={"zeta": ZETA, "a": 0.3, "f": F}
    )


@pytest.fixture(scope="module")
def folded(duffing):
    return so.frequency_response(duffing, (1.0, 3.0), harmonics=7)


def test_the_peak_of_a_linear_response(duffing):
    """At `sqrt(1 - 2 zeta^2)`, of the height `f / (2 zeta sqrt(1 - zeta^2))`; half of the power at
    `1 - 2 zeta^2 -+ 2 zeta sqrt(1 - zeta^2)` squared.
    """
    curve = so.frequency_response(duffing.linear(), (0.5, 1.5))
    (peak,) = curve.peaks()
    root = np.sqrt(1.0 - ZETA**2)
    assert_allclose(peak.omega, np.sqrt(1.0 - 2.0 * ZETA**2), rtol=1e-10)
    assert_allclose(peak.height, F / (2.0 * ZETA * root), rtol=1e-10)
    assert_allclose(np.square(peak.half_power), 1.0 - 2.0 * ZETA**2 + np.array([-2.0, 2.0]) * ZETA * root, rtol=1e-10)
    assert_allclose(peak.width, 2.0 * ZETA, rtol=1e-3)
    assert_allclose(np.tan(peak.phase), -np.sqrt(1.0 - 2.0 * ZETA**2) / ZETA, rtol=1e-8)
    # the energy of motion is largest at the natural frequency
    assert_allclose(curve.peaks("velocity")[0].omega, 1.0, rtol=1e-10)
    assert_allclose(curve.peaks(lambda orbit: orbit.velocity_amplitude(0))[0].omega, 1.0, rtol=1e-10)
    near = so.frequency_response(duffing.linear(), (0.99, 1.5))
    assert near.peaks()[0].width is None  # does not come down that far on its left side
    assert "no peak" in str(so.frequency_response(duffing.linear(), (1.1, 1.5)).peaks())


def test_all_points_at_a_frequency(duffing, folded):
    """Three on the folded curve, each a motion that shooting finds too; as many as there are crossings."""
    found = folded.at(omega=1.6)
    assert len(found) == 3
    assert list(found.stable) == [True, False, True]
    assert_allclose(found.omega, 1.6, rtol=0, atol=0)
    for point in found:
        assert so.verify(point).agrees
        # of the curve of motions over another parameter
        other = so.continue_branch(point, "f", (0.9 * F, 1.1 * F), harmonics=7)
        again = other.at(f=F)
        assert min(abs(again.amplitude - point.amplitude)) < 1e-9 * point.amplitude
    # at a limit point, which lies between two points, from both sides
    fold = folded.bifurcations["LP"][0].omega
    assert len(folded.at(omega=fold - 1e-7)) == 3
    assert len(folded.at(omega=fold + 1e-7)) == 1
    near = folded.at(omega=fold - 1e-7)
    assert_allclose(near.amplitude[0], near.amplitude[1], rtol=1e-3)


def test_none_outside_and_why(folded):
    found = folded.at(omega=9.0)
    assert len(found) == 0
    assert str(found) == "no point at omega = 9: the curve has omega from 1 to 3"
    with pytest.raises(so.InputError, match="followed in omega, not in 'zeta'"):
        folded.at(zeta=0.1)
    with pytest.raises(so.InputError, match="takes one value"):
        folded.at()
    with pytest.raises(so.InputError, match="finite number"):
        folded.at(omega=float("nan"))


def test_a_curve_is_a_sequence_of_points(folded):
    assert len(list(folded)) == len(folded)
    assert folded[-1].omega == folded.at(omega=3.0)[0].omega == 3.0
    assert [point.omega for point in folded[3:6]] == folded.omega[3:6].tolist()
    assert [point.stable for point in folded] == folded.stable.tolist()
    assert [point.amplitude for point in folded[:4]] == folded.amplitude[:4].tolist()


def test_a_tracked_curve_at_either_of_its_parameters(duffing, folded):
    """A limit point solved at another damping is that of the response with it."""
    curve = so.track(folded.bifurcations["LP"][0], "f", (0.2, 0.4))
    (point,) = curve.at(f=0.25)
    response = so.frequency_response(duffing.with_parameters(f=0.25), (1.0, 3.0), harmonics=7)
    assert_allclose(point.omega, response.bifurcations["LP"][0].omega, rtol=1e-9)
    (same,) = curve.at(omega=point.omega)
    assert_allclose(same.parameter("f"), 0.25, rtol=1e-9)
    assert [one.stable for one in curve] == curve.stable.tolist()


def test_the_peak_of_a_nonlinear_response_is_that_of_its_ridge(duffing, folded):
    ridge = so.track_peak(folded, "f", (0.29, 0.31))
    (there,) = ridge.at(f=F)
    peak = folded.peaks().highest
    assert_allclose([peak.omega, peak.height], [there.omega, there.amplitude], rtol=1e-8)


def test_the_seam_of_a_closed_curve_is_one_point(folded):
    """A curve that runs forth and back: its first motion is its last."""
    there = folded.points[:12]
    whole = there[-1].arclength
    back = [replace(point, arclength=2.0 * whole - point.arclength) for point in reversed(there[:-1])]
    loop = Branch(folded.system, "omega", [*there, *back], [], [], True, folded.endings, 0, folded.options)
    first, inside = float(loop.omega[0]), 0.5 * float(loop.omega[4] + loop.omega[5])
    assert loop.at(omega=first).omega.tolist() == [first]
    assert loop.at(omega=inside).omega.tolist() == [inside, inside]
    assert len(loop.at(omega=float(loop.omega[3]))) == 2


def test_equilibria_and_cycles():
    """`x'' - mu x' + x^2 x' + x = 0`: cycles of amplitude 2 sqrt(mu) at first."""
    system = so.System.from_equations("x'' - mu*x' + x**2*x' + x = 0", parameters={"mu": 0.0})
    still = so.equilibria(system, "mu", (-0.2, 0.3))
    assert still.at(mu=0.123)[0].orbit.values["mu"] == 0.123
    assert list(still.at(mu=-0.1).stable) == [True]
    cycles = so.limit_cycles(still.bifurcations["Hopf"][0])
    (cycle,) = cycles.at(mu=0.01)
    assert_allclose(cycle.amplitude, 0.2, rtol=1e-3)
    assert cycle.stable
    assert cycle.orbit.stable  # in spite of the multiplier +1


def test_motions_of_a_conservative_mode_are_stable_within_their_errors():
    """Its multipliers lie on the circle, where rounding puts them to either side."""
    duffing = so.System([[1.0]], [[0.0]], [[1.0]], [so.CubicSpring(0, 1.0)])
    mode = so.nonlinear_mode(duffing, mode=1, amplitude=0.5, harmonics=5, damped=False)
    assert all(point.orbit.stable for point in mode[::8])
    pair = 1.00001 * np.exp([1.0j, -1.0j])
    beside = np.array([1.0, 1.0, *pair, *(1.0 / pair)])
    others = np.arange(6) > 1
    for error, inside in ((1e-4, True), (1e-7, False), (2.0, False)):
        assert FloquetResult(beside, np.full(6, error)).inside(others) is inside


def test_what_is_asked_of_a_motion(folded):
    """The same of an orbit, of a point and of a bifurcation; sums of the spectrum are the motion."""
    point = folded.at(omega=1.2)[0]
    table = point.to_dataframe(samples=101)
    spectrum = point.spectrum("x")
    t = table["time"].to_numpy()
    amplitude, phase = spectrum["amplitude"].to_numpy(), spectrum["phase"].fillna(0.0).to_numpy()
    waves = amplitude * np.cos(np.outer(t, spectrum["omega"]) + phase)
    assert_allclose(waves.sum(axis=1), table["x_x"], atol=1e-12)
    assert_allclose(table["v_x"], point.orbit.velocity(t)[0])
    assert_allclose(spectrum["hertz"], spectrum["omega"] / (2.0 * np.pi))
    for motion in (point.orbit, point, folded.bifurcations[0]):
        assert len(motion.spectrum()) == len(spectrum)
        assert len(motion.multipliers) == 2
        assert motion.stable in (True, False)
        assert motion.plot().axes
    assert_allclose(np.prod(point.orbit.multipliers), np.exp(-4.0 * np.pi * ZETA / 1.2), rtol=1e-6)
    assert not folded.at(omega=1.6)[1].orbit.stable


def test_quantities_about_the_mean():
    """`x = 2 + cos + 0.5 cos 2 tau`: from 1.25 to 3.5."""
    system = so.System(1.0, 1.0, 1.0, loads=[so.HarmonicLoad(0, 1.0)])
    curve = so.frequency_response(system, (1.0, 1.1), harmonics=2)
    orbit = curve[0].orbit
    x = np.array([[2.0], [1.0], [0.0], [0.5], [0.0]])
    known = so.PeriodicOrbit(orbit.balance, x, orbit.omega, orbit.values, 0.0)
    assert_allclose(known.peak_to_peak(), 3.5 - 1.25, rtol=1e-12)
    assert_allclose(known.amplitude_about_mean(), 1.5, rtol=1e-12)
    assert_allclose(curve.peak_to_peak(), 2.0 * curve.amplitude, rtol=1e-12)
    assert_allclose(curve.about_mean(), curve.amplitude, rtol=1e-12)

    def power(orbit):
        return 0.5 * orbit.velocity_amplitude(0) ** 2

    table = curve.to_dataframe(readings=["peak_to_peak", power])
    assert_allclose(table["power"], 0.5 * curve.velocity() ** 2)
    assert_allclose(table["peak_to_peak"], 2.0 * curve.amplitude)
    with pytest.raises(so.InputError, match="must give a real number"):
        curve.to_dataframe(readings=[lambda orbit: orbit.harmonic(1)])


def test_functions_of_motions_are_drawn(folded):
    def power(orbit):
        return 0.5 * orbit.velocity_amplitude(0) ** 2

    (axes,) = folded.plot(quantity=power).axes
    assert axes.get_ylabel() == "power"
    drawn = max(line.get_ydata().max() for line in axes.lines if len(line.get_ydata()) > 2)
    assert_allclose(drawn, max(0.5 * np.max(folded.velocity()) ** 2, 0.0), rtol=1e-3)
    with pytest.raises(so.InputError, match="not one of a degree of freedom"):
        folded.plot(quantity=power, dof=0)


def test_the_linear_response_under_a_curve(duffing, folded):
    line = folded.linear()
    exact = F / np.abs(1.0 - line.omega**2 + 2j * ZETA * line.omega)
    assert_allclose(line.amplitude, exact, rtol=1e-9)
    assert_allclose(line.omega[[0, -1]], [1.0, 3.0])
    (axes,) = folded.plot(linear=True).axes
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert {"response", "linear response"} <= set(texts)
    force = so.continue_branch(folded[3], "a", (0.3, 0.4))
    with pytest.raises(so.InputError, match="nothing depends on a"):
        force.linear()


def test_tables_and_names_with_units(tmp_path):
    """Hz are cycles per second; the printed table of bifurcations has as many rows as it is long."""
    system = so.System.from_equations(
        "y'' + 0.04*y' + y + 0.3*y**3 = f*cos(omega*t)", parameters={"f": 0.3}, units="mm, N, s"
    )
    curve = so.frequency_response(system, (1.0, 2.5), harmonics=5)
    head = str(curve).splitlines()[0]
    assert f"omega from 1 to 2.5 rad/s ({0.5 / np.pi:.6g} to {1.25 / np.pi:.6g} Hz)" in head
    rows = str(curve.bifurcations).splitlines()
    assert rows[0].split()[:5] == ["kind", "omega", "(rad/s)", "Hz", "amplitude"]
    assert len(rows) - 1 == len(curve.bifurcations) == 2
    assert_allclose(float(rows[1].split()[2]), curve.bifurcations[0].omega / (2.0 * np.pi), rtol=1e-8)
    heads = curve.to_csv(tmp_path / "curve.csv").read_text().splitlines()[0].split(",")
    assert heads[:3] == ["omega (rad/s)", "frequency (Hz)", "amplitude (mm)"]
    (axes,) = curve.plot().axes
    assert axes.get_ylabel() == r"amplitude $\max\,|y|$ (mm)"
    assert "omega (rad/s)" not in curve.to_dataframe()


def test_grazing_contacts_are_printed_apart():
    system = so.System(
        1.0, 0.1, 1.0, [so.ElasticStop(0, stiffness=1.0, gap=0.5)], [so.HarmonicLoad(0, 0.08)], dof_names=["q1"]
    )
    curve = so.frequency_response(system, (0.7, 1.0), harmonics=9)
    assert len(curve.grazings) == 1
    rows = str(curve.bifurcations).splitlines()
    at = next(i for i, row in enumerate(rows) if row.startswith("1 grazing contact, which is no bifurcation"))
    assert len(rows) == at + 2
    assert len(curve.bifurcations) == (at - 1 if rows[0] != "no bifurcations" else 0)
    (axes,) = curve.plot(quantity="velocity").axes
    assert axes.get_ylabel() == r"velocity $\max\,|\dot{q}_{1}|$"


def test_a_tracked_curve_beside_its_extremum():
    """Two period doublings at a gap just below the largest one, between points of the curve, none above it."""
    system = so.library.reference_oscillator(p=0.55, j=0.17)
    response = so.frequency_response(system, (2.2, 1.9), harmonics=5)
    curve = so.track(response.bifurcations["PD"][0], "j", (0.15, 0.3))
    (top,) = (item for item in curve.extrema if item.parameter_name == "j")
    largest = top.parameter("j")
    below = curve.at(j=largest - 1e-8)
    assert len(below) == 2
    assert min(below.omega) < top.omega < max(below.omega)
    assert_allclose(below.omega, top.omega, rtol=1e-3)
    assert len(curve.at(j=largest + 1e-8)) == 0
    highest = so.track(top, "p", (0.5, 0.6))
    assert_allclose(highest.at(p=0.55)[0].parameter("j"), largest, rtol=1e-8)
