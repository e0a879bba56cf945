"""Points of codimension two along PD and NS curves of limit cycles: averaging, and multipliers by shooting."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.timedomain import shoot_cycle

pytestmark = pytest.mark.filterwarnings("ignore::suboctave.NegativeDampingWarning")

#: friction that falls, then grows with the speed: averaged, mu + 3/4 a A^2 - 5/8 b A^4 = 0, a fold at A^2 = 0.6
RUBBING = "x'' + x - mu*x' - 0.1*x'**3 + 0.1*x'**5 = 0"


def cycles(second, **parameters):
    """Of the rubbing mass with a second one, which does not act on it and rests."""
    system = so.System.from_equations([RUBBING, second], {"mu": 0.0, **parameters})
    hopf = so.equilibria(system, "mu", (-0.1, 0.1)).bifurcations["Hopf"]
    first = min(hopf, key=lambda item: abs(item.parameters["mu"]))
    return so.limit_cycles(first, (-0.03, 0.01), harmonics=5)


@pytest.fixture(scope="module")
def torus():
    """Its damping is that of the first one's square: NS where 0.8 <x^2> = m, at m = 0.4 A^2 if averaged."""
    found = cycles("y'' + (0.8*x**2 + y**2 - m)*y' + s*y = 0", m=0.1, s=2.6)
    return found.bifurcations["NS"][0]


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


# ------------------------------------------------------------------------------------------------------- normal forms
def pumped(g):
    """x shakes the stiffness of y at twice its frequency, y acts on x, and x by its square on its own frequency."""
    first = "x'' + (x**2 - mu)*x' + x + 0.05*y**2 + 0.1*x**2 = 0"
    second = "y'' + 0.1*y' + (0.27 + 0.4*x)*y + g*y**3 + 0.3*y**2 = 0"
    system = so.System.from_equations([first, second], {"mu": 0.0, "g": g})
    hopf = so.equilibria(system, "mu", (-0.1, 0.3)).bifurcations["Hopf"][0]
    (doubling,) = so.limit_cycles(hopf, (-0.01, 0.03)).bifurcations["PD"]
    return doubling


def measured_curvature(doubling):
    """Of the doubled branch: mu over the square of its half-odd part, in units of the null vector."""
    phi = doubling.null_vectors.right * doubling.orbit.state().balance.row_weights(len(doubling.null_vectors.right))
    branch = so.switch_branch(doubling, 1)
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
    (torus,) = so.limit_cycles(first, (0.0, 0.03), harmonics=5).bifurcations["NS"]
    assert torus.criticality == ("supercritical" if expected < 0.0 else "subcritical")
    phi = torus.null_vectors.right * torus.orbit.state().balance.row_weights(len(torus.null_vectors.right))
    # of A phi and its conjugate
    size = 2.0 * np.abs(phi.reshape(-1, torus.orbit.balance.size)[:, 1]).max()
    assert torus.normal_form["curvature"] == pytest.approx(expected * size**2, rel=2e-2)
