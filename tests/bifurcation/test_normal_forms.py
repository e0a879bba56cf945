"""Normal forms against closed forms, against the branches that they foretell, and against time integration."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation.normal_form import Expansion, NormalForm, normal_form, with_criticality
from suboctave.errors import InputError
from suboctave.harmonic.basis import HarmonicBasis
from suboctave.harmonic.perturbation import Kind
from suboctave.timedomain import integrate, shoot


def along(balance, start, first, eps, at, values, omega, name):
    """Newton's method in (X, p) for the motion that is eps further along `first` than `start`: p."""
    weight = np.tile(balance.scales[0] ** 2, balance.basis.size)
    row = first.ravel() * weight / (first.ravel() @ (weight * first.ravel()))
    begin = start.ravel()
    x = begin + eps * first.ravel()
    for _ in range(15):
        here = values if name == "omega" else {**values, name: at}
        state = balance.at(x, at if name == "omega" else omega, here)
        matrix = np.zeros((len(x) + 1,) * 2)
        matrix[:-1, :-1], matrix[:-1, -1], matrix[-1, :-1] = state.jacobian, state.residual_by(name), row
        step = np.linalg.solve(matrix, np.append(state.residual, row @ (x - begin) - eps))
        x, at = x - step[:-1], at - step[-1]
        if np.abs(step).max() < 1e-12:
            return at
    raise AssertionError("the branch was not found")


def size_of(b):
    return np.linalg.norm(b.orbit.coefficients * b.orbit.balance.scales[0]) or 1.0


def doubled_motion(b):
    """Basis of twice the period, X, phi and X2 in it: motions `X + eps phi + eps^2 X2` beside a period doubling."""
    state = b.orbit.state()
    own = Expansion.of(state, Kind.HALF, b.null_vectors, b.parameter_name)
    basis = HarmonicBasis(2 * state.basis.harmonics + 1, 2 * state.basis.nu)
    half, first = own.phi.reshape(-1, state.balance.size), np.zeros((basis.size, state.balance.size))
    first[1::4], first[2::4] = half[::2], half[1::2]
    second = np.linalg.solve(state.jacobian, -0.5 * own.squared()).reshape(state.x.shape)
    return basis, state.basis.resized(state.x, basis), first, state.basis.resized(second, basis)


def doubled_curvature(b, share):
    """(p - p_PD) / eps^2 on the doubled branch, eps a share of the motion."""
    state, name = b.orbit.state(), b.parameter_name
    basis, motion, first, second = doubled_motion(b)
    assert np.sum((first * state.balance.scales[0]) ** 2) == pytest.approx(1.0)
    balance = state.balance.with_basis(basis).settle(motion, state.omega, state.values)
    eps, here = share * size_of(b), b.parameter(name)
    at = here + eps**2 * b.normal_form["curvature"]
    start = motion + eps**2 * second
    return (along(balance, start, first, eps, at, state.values, state.omega, name) - here) / eps**2


def own_curvature(b, share):
    """(p(eps) + p(-eps) - 2 p_0) / (2 eps^2) on the branch that leaves an LP or a pitchfork along phi."""
    state, name = b.orbit.state(), b.parameter_name
    first = b.null_vectors.right.reshape(state.x.shape) * state.balance.scales[1]
    eps, here = share * size_of(b), b.parameter(name)
    both = [along(state.balance, state.x, first, e, here, state.values, state.omega, name) for e in (eps, -eps)]
    return (sum(both) - 2.0 * here) / (2.0 * eps**2)


def two_masses():
    return so.System(
        np.eye(2),
        0.05 * np.eye(2),
        [[2.0, -1.0], [-1.0, 2.0]],
        [so.ElasticStop((0, 1), 5.0, 0.0), so.CubicSpring(0, 0.1)],
        [so.HarmonicLoad(0, 0.6)],
    )


def behind_hertz():
    """A stop after Hertz and dampers, as texts: half powers, corners in displacement and in velocity."""
    force = "5*max(x - 0.1, 0)**1.5 + 0.01*v*abs(v) + 0.02*v*max(x, 0)"
    return so.System(1.0, 0.03, 1.0, [so.Expression(0, force)], [so.HarmonicLoad(0, 0.7)])


@pytest.mark.parametrize(
    ("system", "omega", "share", "rel"),
    [
        (lambda: so.library.reference_oscillator(p=0.55), (2.4, 2.2), 1e-3, 1e-5),
        (lambda: so.library.reference_oscillator(p=1.7), (1.45, 1.3), 1e-3, 1e-4),
        (lambda: so.library.reference_oscillator(p=0.55, regularization=3000.0), (4.1, 3.9), 1e-3, 1e-4),
        (two_masses, (1.65, 1.35), 1e-3, 1e-3),
        (behind_hertz, (2.6, 1.7), 1e-3, 1e-3),
    ],
    ids=["exact", "strongly forced", "regularised", "two DOFs", "texts"],
)
def test_the_doubled_branch_bends_as_foretold(system, omega, share, rel):
    doublings = so.frequency_response(system(), omega).bifurcations["PD"]
    assert doublings
    for b in doublings:
        form = b.normal_form
        assert doubled_curvature(b, share) == pytest.approx(form["curvature"], rel=rel)
        # it lies where the parent is unstable (d > 0: above) exactly if it is supercritical
        assert (b.criticality == "supercritical") == (form["d"] * form["curvature"] > 0.0)


def test_the_doubled_branch_by_shooting():
    """Motions of two load periods, found without harmonics: their halves differ by 2 eps phi, eps^2 as foretold."""
    (b,) = so.frequency_response(so.library.reference_oscillator(p=0.55), (2.4, 2.2)).bifurcations["PD"]
    basis, motion, first, second = doubled_motion(b)
    eps = 0.01 * size_of(b)
    x, change = motion + eps * first + eps**2 * second, eps**2 * b.normal_form["curvature"]
    frequency = np.arange(1, basis.harmonics + 1) * 0.5 * b.omega
    state = [x[0, 0] + x[1::2].sum(), frequency @ x[2::2, 0]]
    found = shoot(b.orbit.balance.system, state, b.omega + change, periods=2)
    half = integrate(b.orbit.balance.system, found.state, [0.0, 2.0 * np.pi / found.omega], found.omega)
    phi = np.array([first[1::2].sum(), frequency @ first[2::2, 0]])
    across = 0.5 * (found.state - np.array([half.x[-1, 0], half.v[-1, 0]]))
    assert across / eps == pytest.approx(phi, abs=2e-3)
    assert found.stable


def test_doubled_branches_leave_on_the_side_foretold():
    """Beside a stable parent a supercritical branch is stable, a subcritical one is not."""
    curve = so.frequency_response(so.library.reference_oscillator(p=1.7), (1.45, 1.3))
    words = []
    for b in curve.bifurcations["PD"]:
        branch = so.switch_branch(b)
        begin = int(np.argmin(np.abs(branch.omega - b.omega)))
        near = slice(begin + 1, begin + 4) if begin < len(branch) // 2 else slice(begin - 3, begin)
        side = np.sign(b.normal_form["curvature"])
        assert np.all(np.sign(branch.omega[near] - b.omega) == side)
        assert np.all(branch.stable[near] == (b.criticality == "supercritical"))
        words.append(b.criticality)
    assert words == ["supercritical", "subcritical"]


@pytest.mark.parametrize("hardening", [0.3, -0.3])
def test_parametric_resonance_against_one_harmonic(hardening):
    """`x = a cos(W t + .)`, W = omega / 2: `(1 - W^2 + 3/4 gamma a^2)^2 + (c W)^2 = (eps / 2)^2`."""
    c, eps = 0.005, 0.05
    curve = so.frequency_response(so.library.mathieu_duffing(c=c, eps=eps, gamma=hardening), (2.2, 1.9))
    upper, lower = curve.bifurcations["PD"]
    for b, sign in ((upper, -1.0), (lower, 1.0)):
        w = 0.5 * b.omega
        root = np.sqrt(0.25 * eps**2 - (c * w) ** 2)
        slope = 2.0 * 0.75 * hardening / (2.0 * w - sign * c**2 * w / root)
        assert b.normal_form["curvature"] == pytest.approx(slope, rel=5e-3)
        # to higher frequencies where it hardens: into the tongue at its lower end, out of it at the upper one
        assert b.criticality == ("supercritical" if hardening * sign > 0.0 else "subcritical")


def test_period_doubling_in_a_parameter():
    """The threshold of parametric excitation: `eps^2 / 4 = (1 - W^2 + 3/4 gamma a^2)^2 + (c W)^2`."""
    c, gamma, omega = 0.02, 0.3, 1.96
    system = so.library.mathieu_duffing(c=c, eps=0.01, gamma=gamma)
    rest = so.frequency_response(system, (omega, omega + 0.01)).orbits[0]
    (b,) = so.continue_branch(rest, "eps", (0.01, 0.2)).bifurcations
    w = 0.5 * omega
    slope = 2.0 * (1.0 - w**2) * 0.75 * gamma * 4.0 / (2.0 * b.parameter("eps"))
    assert b.normal_form["curvature"] == pytest.approx(slope, rel=0.02)
    assert b.normal_form["curvature"] == pytest.approx(doubled_curvature(b, 1e-3), rel=1e-5)
    assert b.criticality == "supercritical"


def test_without_damping_there_is_no_criticality():
    curve = so.frequency_response(so.library.mathieu_duffing(c=0.0, eps=0.2), (2.3, 2.0))
    (b,) = curve.bifurcations["PD"]
    assert b.criticality is None
    assert "double" in b.remark()
    assert np.isfinite(b.normal_form["curvature"])


@pytest.fixture(scope="module")
def duffing():
    return so.frequency_response(so.library.duffing(), (0.3, 2.0))


def test_branch_points_of_a_symmetric_system(duffing):
    for b in duffing.bifurcations["BP"]:
        form = b.normal_form
        assert form.shape == "pitchfork"
        assert form["curvature"] == pytest.approx(own_curvature(b, 1e-3), rel=1e-4)
        assert b.criticality == "supercritical"


def test_a_pitchfork_is_one_from_either_branch():
    """At rest nothing but rounding breaks the symmetry, on the branch that leaves rest as on rest itself."""
    rest = so.frequency_response(so.library.mathieu_duffing(eps=0.6), (0.4, 1.5))
    branch = so.switch_branch(rest.bifurcations["BP"][0])
    for one in rest.bifurcations["BP"]:
        (other,) = (b for b in branch.bifurcations["BP"] if abs(b.omega - one.omega) < 1e-7)
        assert other.normal_form.shape == one.normal_form.shape == "pitchfork"
        assert other.criticality == one.criticality
        assert other.normal_form["curvature"] == pytest.approx(one.normal_form["curvature"], rel=1e-6)


def test_folds_bend_as_foretold(duffing):
    for b in duffing.bifurcations["LP"]:
        assert b.normal_form["curvature"] == pytest.approx(own_curvature(b, 1e-4), rel=1e-4)
        assert b.criticality is None


@pytest.mark.parametrize(
    ("power", "factor", "shape", "criticality"),
    [(2, 1.0, "transcritical", None), (3, 1.0, "pitchfork", "supercritical"), (3, -1.0, "pitchfork", "subcritical")],
)
def test_a_strut_buckles(power, factor, shape, criticality):
    """`x'' + c x' + k x + f x^p = 0` at rest: k = -f x^(p - 1)."""
    elements = [so.PolynomialSpring(0, {power: factor}), so.Expression(0, "e*cos(omega*t)*x")]
    system = so.System(1.0, 0.1, "k", elements, parameters={"k": 1.0, "e": 0.0})
    rest = so.frequency_response(system, (3.0, 3.1)).orbits[0]
    (b,) = so.continue_branch(rest, "k", (1.0, -0.5)).bifurcations["BP"]
    assert (b.normal_form.shape, b.criticality) == (shape, criticality)
    if power == 3:
        assert b.normal_form["curvature"] == pytest.approx(-factor, rel=1e-6)
    else:
        # the other direction s phi + r v has c s + 2 b r = 0; there x = s phi and k = r
        share = -2.0 * b.normal_form["b"] / b.normal_form["c"]
        assert share * b.null_vectors.right[0] == pytest.approx(-1.0, rel=1e-6)


@pytest.mark.parametrize(
    ("cubic", "damping", "quadratic", "product"), [(0.3, 0.2, 0.0, 0.0), (0.0, -0.2, 0.0, 0.0), (0.2, 0.0, 0.4, 0.3)]
)
def test_self_excitation_against_its_closed_form(cubic, damping, quadratic, product):
    """`x'' + mu x' + x + a x^3 + b x'^3 + q x^2 + g x x' = 0`: by hand, with x = A exp(i t) + c.c.,

    `A' = [-mu / 2 - 3 b |A|^2 / 2 + q g |A|^2 / 2 + i |A|^2 (3 a / 2 - 5 q^2 / 3 - g^2 / 6)] A`.
    """
    force = f"{cubic}*x**3 + {damping}*x'**3 + {quadratic}*x**2 + {product}*x*x'"
    parameters = {"mu": 0.02}
    system = so.System(1.0, "mu", 1.0, [so.Expression(0, force)], [so.HarmonicLoad(0, 1e-3)], parameters=parameters)
    start = so.frequency_response(system, (3.7, 3.6)).orbits[0]
    (b,) = so.continue_branch(start, "mu", (0.02, -0.02)).bifurcations
    form = b.normal_form
    growth = -1.5 * damping + 0.5 * quadratic * product
    assert form["c3"] == pytest.approx(growth, abs=1e-5)
    assert form["c3_frequency"] == pytest.approx(1.5 * cubic - 5.0 * quadratic**2 / 3.0 - product**2 / 6.0, abs=1e-5)
    assert form["d"] == pytest.approx(-0.5, abs=1e-6)
    assert b.criticality == ("supercritical" if growth < 0.0 else "subcritical")


@pytest.mark.parametrize(("omega", "words"), [(3.0, "1:3"), (4.0, "1:4"), (3.02, "1:3")])
def test_strong_resonances_are_stated(omega, words):
    """An oscillator of frequency one beside a load of three or four: the normal form has further terms there."""
    force = "0.1*x'**3 + 0.4*x**2"
    loads = [so.HarmonicLoad(0, 1e-3)]
    system = so.System(1.0, "mu", 1.0, [so.Expression(0, force)], loads, parameters={"mu": 0.02})
    start = so.frequency_response(system, (omega, omega + 0.01)).orbits[0]
    (b,) = so.continue_branch(start, "mu", (0.02, -0.02)).bifurcations
    assert f"strong resonance {words}" in b.remark()
    assert b.criticality == ("supercritical" if omega == 3.02 else None)


def test_decay_towards_a_neimark_sacker_point():
    """At the point itself `1 / |A|^2` grows by -2 c3 per time: A from a long integration, by the left eigenvector."""
    curve = so.frequency_response(so.library.nltva(0.11), (1.1, 1.12), harmonics=9)
    (b,) = curve.bifurcations["NS"]
    period, start, form = b.orbit.period, b.orbit.start(), b.normal_form

    def strobe(state, periods):
        times = np.arange(periods + 1) * period
        path = integrate(curve.system, state, times, b.omega, curve.system.parameters, rtol=1e-9)
        return np.hstack((path.x, path.v))

    unit = 1e-5 * np.eye(4)
    monodromy = np.array([(strobe(start + e, 1)[-1] - strobe(start - e, 1)[-1]) / 2e-5 for e in unit]).T
    mu, right = np.linalg.eig(monodromy)
    left = np.linalg.inv(right)[np.argmin(np.abs(mu - np.exp(1j * b.kappa * period)))]
    state = b.orbit.state()
    phi = b.null_vectors.right.reshape(-1, 2) * state.balance.scales[1]
    frequency = np.arange(-9, 10) * state.rate + b.kappa
    wave = np.concatenate((phi.sum(axis=0), 1j * frequency @ phi))
    small, periods = 0.035, 100
    amplitude = (strobe(start + 2.0 * np.real(small * wave), periods) - start) @ left / (left @ wave)
    rise = np.polyfit(np.arange(periods + 1) * period, 1.0 / np.abs(amplitude) ** 2, 1)[0]
    assert form["c3"] == pytest.approx(-0.5 * rise, rel=0.05)
    assert b.criticality == "supercritical"


def test_generalised_period_doublings_of_the_sharp_law():
    """c3 changes its sign twice along the PD curve; beside both the doubled branch itself agrees."""
    signs = []
    for j in (0.145, 0.16, 0.1755):
        system = so.library.reference_oscillator(p=0.55, j=j, regularization=3000.0)
        b = so.frequency_response(system, (2.2, 2.025)).bifurcations["PD"][0]
        signs.append(b.criticality)
        assert b.normal_form["curvature"] == pytest.approx(doubled_curvature(b, 1e-4), rel=1e-2)
    assert signs == ["supercritical", "subcritical", "supercritical"]


@pytest.mark.parametrize(
    ("c3", "g", "criticality", "words"),
    [
        (-1.0, 1.0, "supercritical", ""),
        (1.0, 1.0, "subcritical", ""),
        (-0.05, 1.0, None, "zero within its error"),
        (-1.0, 1e-9, None, "double multiplier"),
        (np.nan, 1.0, None, "zero within its error"),
    ],
)
def test_a_sign_is_read_where_it_is_certain(c3, g, criticality, words):
    form = with_criticality(NormalForm("PD", "omega", {"c3": c3, "g": g}, {"c3": 0.1, "g": 1e-6}))
    assert form.criticality == criticality
    assert words in form.remark


def test_wrong_names_are_refused(duffing):
    b = duffing.bifurcations[0]
    with pytest.raises(InputError, match="did you mean 'omega'"):
        normal_form("LP", b.orbit.state(), b.null_vectors, "omga")
    with pytest.raises(InputError, match="has no normal form"):
        normal_form("grazing", b.orbit.state(), b.null_vectors, "omega")
    with pytest.raises(InputError, match="did you mean 'curvature'"):
        b.normal_form["curvatur"]


def test_no_verdict_behind_a_grazing():
    curve = so.frequency_response(so.library.reference_oscillator(p=0.55), (2.2, 1.5))
    (fold,) = curve.bifurcations["LP"]
    assert fold.contact is not None
    assert fold.normal_form is None
    assert fold.criticality is None


def test_tables_and_files_have_it(tmp_path):
    curve = so.frequency_response(so.library.reference_oscillator(p=1.7), (1.45, 1.3))
    assert [b.criticality for b in curve.bifurcations["PD"]] == ["supercritical", "subcritical"]
    lines = repr(curve.bifurcations).splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[-1].split()[4] == "subcritical"
    assert list(curve.bifurcations_frame()["criticality"]) == ["supercritical", "subcritical"]
    assert list(curve.to_xarray()["event_criticality"].values) == ["supercritical", "subcritical"]
    loaded = so.load(curve.save(tmp_path / "curve.nc"))
    assert [b.normal_form for b in loaded.bifurcations] == [b.normal_form for b in curve.bifurcations]
