"""Contacts that begin where a function of several displacements, of velocities or of time vanishes."""

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation.gaps import gap_extrema, height_at
from suboctave.verification.motions import pairing


def events(curve):
    return [(str(event.kind), event.omega) for event in curve.bifurcations.met]


def same(found, expected, within=1e-8):
    assert [kind for kind, _ in found] == [kind for kind, _ in expected]
    np.testing.assert_allclose([omega for _, omega in found], [omega for _, omega in expected], atol=within, rtol=0.0)


def test_a_stop_between_two_masses_written_as_a_text():
    """`x - y - gap` as a surface, and as the displacement along a direction."""
    matrices = np.eye(2), 0.06 * np.eye(2), [[2.0, -0.5], [-0.5, 1.5]]
    load, parameters = [so.HarmonicLoad(0, 0.5)], {"gap": 0.3}
    stop = so.System(*matrices, [so.ElasticStop((0, 1), 4.0, "gap")], load, parameters)
    texts = [so.Expression(dof, f"{sign}4*max(x-y-gap, 0)", {"x": 0, "y": 1}) for dof, sign in ((0, ""), (1, "-"))]
    written = so.System(*matrices, texts, load, parameters)
    expected, found = (so.frequency_response(system, (2.2, 1.25), harmonics=25) for system in (stop, written))
    assert len(expected.bifurcations) > 1
    same(events(found), events(expected))
    assert pairing(found.multipliers[-1], expected.multipliers[-1]) < 1e-7
    assert found.warnings == expected.warnings


def test_a_gap_that_moves():
    """A wall that moves as `a cos(omega t)`, and the same in coordinates that move with it."""
    zeta, a, parameters = 0.04, 0.05, {"F": 0.1}
    wall = so.Expression(0, f"3*max(x - 0.5 - {a}*cos(omega*t), 0)")
    moving = so.System(1.0, 2 * zeta, 1.0, [wall], [so.HarmonicLoad(0, "F")], parameters)
    # y = x - w: -w'' - c w' - k w besides the load
    amplitude = f"sqrt((F + {a}*(omega**2 - 1))**2 + ({2 * zeta * a}*omega)**2)"
    phase = f"atan({2 * zeta * a}*omega/(F + {a}*(omega**2 - 1)))"
    stop = so.ElasticStop(0, 3.0, 0.5)
    relative = so.System(1.0, 2 * zeta, 1.0, [stop], [so.HarmonicLoad(0, amplitude, phase=phase)], parameters)
    found, expected = (so.frequency_response(system, (2.0, 0.9), harmonics=25) for system in (moving, relative))
    assert len(expected.bifurcations) > 1
    same(events(found), events(expected))


def rotor(gravity, stiffness="k"):
    """Between the walls of a ring, the shaft being heavy or its bearings unequal."""
    ring = so.library.jeffcott_rotor(me=0.1)
    loads, parameters = [*ring.loads], dict(ring.parameters)
    if gravity:
        loads.append(so.Gravity("g", direction=[0.0, -1.0]))
        parameters["g"] = gravity
    matrices = [["m", 0], [0, "m"]], [["c", 0], [0, "c"]], [["k", 0], [0, stiffness]]
    return so.System(*matrices, ring.elements, loads, parameters)


@pytest.mark.slow
def test_a_heavy_rotor_in_a_ring():
    """Contact begins at the bottom; doublings follow, and a torus, as multipliers in time say."""
    system = rotor(0.1)
    curve = so.frequency_response(system, (0.7, 0.84))
    assert curve.ended.startswith("reached the end")
    assert not curve.audit.unsettled
    assert [str(event.kind) for event in curve.bifurcations] == ["PD", "PD", "NS", "NS", "PD", "PD"]
    touches = curve.bifurcations["grazing"]
    assert len(touches) == 2
    assert {event.contact.change for event in touches} == {"begins to touch"}
    check = so.verify(curve, points=1)
    assert all(event.agrees for event in check.bifurcations), check


@pytest.mark.slow
def test_unequal_bearings():
    curve = so.frequency_response(rotor(0.0, "1.1*k"), (0.84, 0.9), harmonics=21)
    assert [str(event.kind) for event in curve.bifurcations] == ["BP", "BP", "NS"]
    check = so.verify(curve, points=1)
    assert all(event.agrees for event in check.bifurcations), check


@pytest.mark.parametrize("name", ["omega", "b", "a"])
def test_heights_over_a_surface_against_differences(name):
    text = "2*max(x*(1+0.3*y) + 0.2*y' - b*(1 + a*cos(omega*t)), 0)*(1 + y)"
    element = so.Expression(0, text, {"x": 0, "y": 1})
    system = so.System(
        np.eye(2),
        0.1 * np.eye(2),
        [[1.0, -0.2], [-0.2, 1.3]],
        [element],
        [so.HarmonicLoad(0, 0.5)],
        {"b": 0.3, "a": 0.2},
    )
    orbit = so.frequency_response(system, (1.0, 1.1), harmonics=7).orbits[0]
    state, change = orbit.state(), np.random.default_rng(0).normal(size=orbit.state().x.shape)
    tau = float(gap_extrema(state)[0].tau[0])

    def moved(h, dx, dname, dtau):
        values = {**state.values, **({} if name == "omega" else {name: state.values[name] + h * dname})}
        omega = state.omega + (h * dname if name == "omega" else 0.0)
        return height_at(state.balance.at(state.x + h * dx * change, omega, values), 0, 0, tau + h * dtau)

    here, h = height_at(state, 0, 0, tau, (name,)), 1e-6
    assert abs(here.slope) < 1e-7
    for (dx, dname, dtau), first, second in (
        ((1.0, 0.0, 0.0), np.vdot(here.by_x, change), np.vdot(here.slope_by_x, change)),
        ((0.0, 1.0, 0.0), here.by_names[0], here.slope_by_names[0]),
        ((0.0, 0.0, 1.0), here.slope, here.curve),
    ):
        ahead, behind = moved(h, dx, dname, dtau), moved(-h, dx, dname, dtau)
        assert (ahead.height - behind.height) / (2 * h) == pytest.approx(first, abs=1e-7, rel=1e-6)
        assert (ahead.slope - behind.slope) / (2 * h) == pytest.approx(second, abs=1e-6, rel=1e-6)
