"""Points of codimension two along PD and NS curves of limit cycles: averaging, and multipliers by shooting."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.curves import motion
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.timedomain import shoot_cycle

pytestmark = pytest.mark.filterwarnings("ignore::suboctave.NegativeDampingWarning")

#: friction that falls, then grows with the speed: averaged, mu + 3/4 a A^2 - 5/8 b A^4 = 0, a fold at A^2 = 0.6
RUBBING = "x'' + x - mu*x' - 0.1*x'**3 + 0.1*x'**5 = 0"


def cycles(*others, bounds=(-0.03, 0.01), **parameters):
    """Of the rubbing mass with others, which do not act on it and rest."""
    system = so.System.from_equations([RUBBING, *others], {"mu": 0.0, **parameters})
    hopf = so.equilibria(system, "mu", (-0.1, 0.1)).bifurcations["Hopf"]
    first = min(hopf, key=lambda item: abs(item.parameters["mu"]))
    return so.limit_cycles(first, bounds=bounds, harmonics=5)


@pytest.fixture(scope="module")
def damped_by_the_first():
    """Its damping is that of the first one's square: NS where 0.8 <x^2> = m, at m = 0.4 A^2 if averaged. And how often
    multipliers were computed along the curve.
    """
    computed = []

    def counted(state):
        computed.append(state)
        return floquet_multipliers(state)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(motion, "floquet_multipliers", counted)
        found = cycles("y'' + (0.8*x**2 + y**2 - m)*y' + s*y = 0", m=0.1, s=2.6)
    return found, len(computed)


@pytest.fixture(scope="module")
def torus(damped_by_the_first):
    return damped_by_the_first[0].bifurcations["NS"][0]


def test_what_rests_raises_no_doubt(damped_by_the_first):
    """The second mass does not move but for rounding: what its law reads of that is the same in both halves of the
    period as far as the law of the first one is.
    """
    curve, computed = damped_by_the_first
    assert np.abs([orbit.x[:, 1] for orbit in curve.orbits]).max() < 1e-20
    assert computed < 3 * len(curve)
    # nor does it make multipliers uncertain: where the cycles are stable, all others are within the circle
    assert curve.multiplier_errors.max() < 1e-5
    fold, torus = curve.bifurcations["LP"][0], curve.bifurcations["NS"][0]
    beyond = curve.amplitude > max(fold.amplitude, torus.amplitude)
    np.testing.assert_array_equal(curve.stable, beyond)


def multipliers(event):
    """From the state at t = 0, as far as five harmonics tell it."""
    orbit = event.orbit
    return shoot_cycle(orbit.system, orbit.start(), orbit.omega, corrected=False).multipliers


def test_strong_resonances(torus):
    """The pair turns by sqrt(s) in a period of the first mass: a third, or a quarter, at (5/3)^2, (7/4)^2."""
    curve = so.track(torus, "s", (2.5, 3.3))
    for order, share in ((3, 5.0 / 3.0), (4, 7.0 / 4.0)):
        (event,) = curve.bifurcations[f"R{order}"]
        assert event.parameters["s"] == pytest.approx(share**2, rel=5e-3)
        powers = np.sort(np.abs(multipliers(event) ** order - 1.0))
        # the pair, and the one of the shift in time
        assert powers[2] < 1e-5
        assert so.verify(event).agrees
    with pytest.raises(so.InputError, match="this is a R3"):
        so.track(curve.bifurcations["R3"][0], "s", (2.5, 3.3))


def test_a_fold_neimark_sacker_point(torus):
    curve = so.track(torus, "m", (0.05, 0.35))
    (event,) = curve.bifurcations["LPNS"]
    assert event.parameters["m"] == pytest.approx(0.24, rel=1e-3)
    assert event.parameters["mu"] == pytest.approx(-0.0225, rel=1e-3)
    mu = multipliers(event)
    assert np.sort(np.abs(mu - 1.0))[1] < 1e-4
    assert np.abs(np.abs(mu[np.abs(mu.imag) > 0.1]) - 1.0).max() < 1e-5
    with pytest.raises(so.InputError, match="one of limit cycles: no curve is entered from it"):
        so.track(event, "m", (0.05, 0.35))


def test_a_fold_flip():
    """x shakes the stiffness of y at twice its frequency: PD at A = c / 0.1 in the first approximation."""
    doubling = cycles("y'' + c*y' + (0.25 + 0.1*x)*y + y**3 = 0", c=0.06).bifurcations["PD"][0]
    curve = so.track(doubling, "c", (0.05, 0.09))
    (event,) = curve.bifurcations["LPPD"]
    assert event.parameters["mu"] == pytest.approx(-0.0225, rel=1e-3)
    assert event.parameters["c"] == pytest.approx(0.1 * np.sqrt(0.6), rel=5e-3)
    mu = multipliers(event)
    assert np.sort(np.abs(mu - 1.0))[1] < 1e-4
    assert np.abs(mu + 1.0).min() < 1e-5


def test_a_one_to_two_resonance():
    """x shakes the stiffness of y at about twice its frequency: the product of the two multipliers of y is one, and
    both are -1, where its mean damping is zero at the edge of that tongue.
    """
    found = cycles("y'' + (0.2*x**2 - m)*y' + (0.27 + 0.1*x)*y + y**3 = 0", bounds=(-0.013, 0.001), m=0.01)
    doublings = so.track(found.bifurcations["PD"][0], "m", (0.005, 0.03))
    tori = so.track(found.bifurcations["NS"][0], "m", (0.005, 0.03))
    assert "the curve ends in a 1:2 resonance at" in tori.ended
    (on_doublings,), (at_the_end,) = (curve.bifurcations["R2"] for curve in (doublings, tori))
    for name in ("m", "mu"):
        assert on_doublings.parameters[name] == pytest.approx(at_the_end.parameters[name], rel=1e-8)
    assert tori.parameter("m")[-1] == at_the_end.parameters["m"]
    # to first order the tongue begins where 0.1 A / 4 is the distance of the squares of the frequencies, 0.02, over 2
    assert abs(at_the_end.orbit.harmonic(1, 0)) == pytest.approx(0.4, rel=0.02)
    for event in (on_doublings, at_the_end):
        x = event.orbit.displacement(np.linspace(0.0, event.orbit.period, 64, endpoint=False))[0]
        assert 0.2 * np.mean(x**2) == pytest.approx(event.parameters["m"], rel=1e-6)
        mu = multipliers(event)
        pair = mu[np.argsort(np.abs(mu + 1.0))[:2]]
        assert [pair.sum(), pair.prod()] == pytest.approx([-2.0, 1.0], abs=1e-6)
        with pytest.raises(so.InputError, match="this R2 is one of limit cycles"):
            so.track(event, "m", (0.005, 0.03))


def test_flip_neimark_sacker_points():
    """y doubles where x is as large as c says, z vibrates where m does: each stays in place on the other's curve."""
    second = "y'' + c*y' + (0.25 + 0.1*x)*y + y**3 = 0"
    third = "z'' + (0.8*x**2 + z**2 - m)*z' + 2.6*z = 0"
    found = cycles(second, third, bounds=(-0.0195, 0.001), c=0.05, m=0.14)
    doubling, torus = (found.bifurcations[kind][0] for kind in ("PD", "NS"))
    for start, other, name, bounds in ((doubling, torus, "c", (0.045, 0.065)), (torus, doubling, "m", (0.08, 0.16))):
        (event,) = so.track(start, name, bounds).bifurcations["PDNS"]
        assert event.parameters["mu"] == pytest.approx(other.parameters["mu"], rel=1e-8)
        mu = multipliers(event)
        assert np.abs(mu + 1.0).min() < 1e-6
        assert np.abs(np.abs(mu[mu.imag > 0.1]) - 1.0) == pytest.approx([0.0], abs=1e-6)


@pytest.mark.parametrize(
    "square", [pytest.param(5.0, marks=pytest.mark.slow, id="apart"), pytest.param(5.7, id="close")]
)
def test_double_neimark_sacker_points(square):
    """y and z have the same damping, m = k, also where their multipliers lie close to each other on the circle."""
    second = f"y'' + (0.8*x**2 + y**2 - k)*y' + {square}*y = 0"
    third = "z'' + (0.8*x**2 + z**2 - m)*z' + 2.6*z = 0"
    found = cycles(second, third, bounds=(-0.0195, 0.001), k=0.1, m=0.14)
    first, last = sorted(found.bifurcations["NS"], key=lambda item: item.parameters["mu"])
    for torus in (first, last):
        (event,) = so.track(torus, "m", (0.09, 0.15)).bifurcations["NSNS"]
        assert event.parameters["m"] == pytest.approx(0.1, rel=1e-8)
        assert event.parameters["mu"] == pytest.approx(last.parameters["mu"], rel=1e-8)
        mu = multipliers(event)
        pairs = mu[mu.imag > 0.1]
        assert np.abs(pairs) == pytest.approx(np.ones(2), abs=1e-6)
        # sqrt(2.6) and sqrt(square) turns in a period, but for the square of the damping
        turns = np.sort(np.abs(np.angle(np.exp(2j * np.pi * np.sqrt([2.6, square])))))
        assert np.sort(np.angle(pairs)) == pytest.approx(turns, abs=5e-3)


# ------------------------------------------------------------------------------------------------------- normal forms
def pumped(g):
    """x shakes the stiffness of y at twice its frequency, y acts on x, and x by its square on its own frequency."""
    first = "x'' + (x**2 - mu)*x' + x + 0.05*y**2 + 0.1*x**2 = 0"
    second = "y'' + 0.1*y' + (0.27 + 0.4*x)*y + g*y**3 + 0.3*y**2 = 0"
    system = so.System.from_equations([first, second], {"mu": 0.0, "g": g})
    hopf = so.equilibria(system, "mu", (-0.1, 0.3)).bifurcations["Hopf"][0]
    (doubling,) = so.limit_cycles(hopf, bounds=(-0.01, 0.03)).bifurcations["PD"]
    return doubling


def measured_curvature(doubling):
    """Of the doubled branch: mu over the square of its half-odd part, in units of the null vector."""
    phi = doubling.null_vectors.right * doubling.orbit.state().balance.row_weights(len(doubling.null_vectors.right))
    branch = so.switch_branch(doubling, side=1)
    found = []
    for orbit in branch.orbits[1:3]:
        odd = range(1, orbit.basis.harmonics + 1, 2)
        half = np.concatenate([orbit.x[2 * k - 1 : 2 * k + 1].ravel() for k in odd])
        common = min(len(half), len(phi))
        size = np.linalg.norm(half[:common]) / np.linalg.norm(phi[:common])
        found.append((orbit.values["mu"] - doubling.parameters["mu"]) / size**2)
    return found[0]


@pytest.fixture(scope="module")
def soft():
    return pumped(-0.3)


def test_the_criticality_of_period_doublings(soft):
    assert soft.criticality == "subcritical"
    assert soft.normal_form["curvature"] == pytest.approx(measured_curvature(soft), rel=5e-3)


def test_a_generalised_period_doubling(soft):
    curve = so.track(soft, "g", (-0.35, 0.35))
    (event,) = curve.bifurcations["GPD"]
    np.testing.assert_array_equal(curve.coefficient > 0.0, curve.parameter("g") < event.parameters["g"])
    # between the two sides, on curves of cycles computed there
    sides = [pumped(event.parameters["g"] + s) for s in (-0.02, 0.02)]
    assert [side.criticality for side in sides] == ["subcritical", "supercritical"]
    values = [side.normal_form["curvature"] for side in sides]
    assert abs(sum(values)) < 0.05 * abs(values[1])
    assert values[1] == pytest.approx(measured_curvature(sides[1]), rel=2e-2)


@pytest.mark.parametrize(("back", "expected"), [(0.0, -1.0 / 6.4), (0.5, 0.15 / 1.6)])
def test_the_criticality_of_tori_by_averaging(back, expected):
    """A' = A (mu - A^2 / 4 - back B^2 / 2) / 2, B' = B (m - 0.4 A^2 - B^2 / 4) / 2: mu runs as B^2 along the tori."""
    system = so.System.from_equations(
        ["x'' + (x**2 + back*y**2 - mu)*x' + x = 0", "y'' + (y**2 + 0.8*x**2 - m)*y' + 2.6*y = 0"],
        {"mu": 0.0, "m": 0.02, "back": back},
    )
    hopf = so.equilibria(system, "mu", (-0.1, 0.1)).bifurcations["Hopf"]
    first = min(hopf, key=lambda item: abs(item.parameters["mu"]))
    (torus,) = so.limit_cycles(first, bounds=(0.0, 0.03), harmonics=5).bifurcations["NS"]
    assert torus.criticality == ("supercritical" if expected < 0.0 else "subcritical")
    phi = torus.null_vectors.right * torus.orbit.state().balance.row_weights(len(torus.null_vectors.right))
    # of A phi and its conjugate
    size = 2.0 * np.abs(phi.reshape(-1, torus.orbit.balance.size)[:, 1]).max()
    assert torus.normal_form["curvature"] == pytest.approx(expected * size**2, rel=2e-2)
