"""The integrator against closed forms, matrix exponentials and finite differences."""

import numpy as np
import pytest
from scipy.linalg import expm

import suboctave as so
from suboctave.errors import ConvergenceError, InputError
from suboctave.model import AdaptiveSampling, Element
from suboctave.timedomain import integrate, state_transition
from suboctave.timedomain.field import Field
from suboctave.timedomain.trajectory import flow


def general_matrices(n=3, seed=1):
    """M positive definite, C and K unsymmetric (gyroscopic and follower parts)."""
    rng = np.random.default_rng(seed)
    square = rng.standard_normal((n, n))
    mass = square @ square.T + n * np.eye(n)
    damping = 0.3 * np.eye(n) + 0.1 * rng.standard_normal((n, n))
    stiffness = n * np.eye(n) + 0.4 * rng.standard_normal((n, n))
    return mass, damping, stiffness


def first_order(mass, damping, stiffness):
    n = len(mass)
    inverse = np.linalg.inv(mass)
    return np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])


def test_linear_system_is_the_matrix_exponential():
    mass, damping, stiffness = general_matrices()
    system = so.System(mass, damping, stiffness)
    state = np.array([1.0, -0.5, 0.2, 0.0, 2.0, -1.0])
    end, transition = state_transition(system, state, (0.3, 5.3), omega=1.7)
    exact = expm(5.0 * first_order(mass, damping, stiffness))
    assert np.allclose(transition, exact, rtol=0.0, atol=1e-11)
    assert np.allclose(end, exact @ state, rtol=0.0, atol=1e-11)


def test_forced_linear_oscillator_has_its_closed_form():
    """Particular solution by complex dynamic stiffness, for several load harmonics, phases and a static part."""
    omega, c, k = 1.3, 0.1, 2.0
    parts = [(0.4, 0, 0.0), (1.0, 1, 0.3), (0.5, 3, -1.0)]
    loads = [so.HarmonicLoad(dof=0, amplitude=a, harmonic=q, phase=f) for a, q, f in parts]
    system = so.System(1.0, c, k, loads=loads)

    def particular(t, derivative):
        total = np.zeros_like(t)
        for a, q, f in parts:
            w = q * omega
            total += np.real((1j * w) ** derivative * a * np.exp(1j * (w * t + f)) / (k - w**2 + 1j * w * c))
        return total

    t = np.linspace(0.0, 40.0, 200)
    start = np.array([particular(t[:1], 0)[0], particular(t[:1], 1)[0]])
    motion = integrate(system, start, t, omega)
    assert motion.x[:, 0] == pytest.approx(particular(t, 0), abs=2e-10)
    assert motion.v[:, 0] == pytest.approx(particular(t, 1), abs=2e-10)
    assert motion.end[0] == pytest.approx(particular(t[-1:], 0)[0], abs=1e-11)


def test_exact_stop_against_its_closed_form():
    """Free undamped mass on a spring that meets a stop at the origin: half periods pi and pi/sqrt(1 + K)."""
    stiffness = 8.0
    system = so.System(1.0, 0.0, 1.0, [so.ElasticStop(dof=0, stiffness=stiffness, gap=0.0)])
    state = np.array([0.0, -1.0])
    period = np.pi * (1.0 + 1.0 / 3.0)
    motion = integrate(system, state, (0.0, 1.999999 * period), omega=1.0)
    times = [c.time for c in motion.contacts]
    assert times == pytest.approx([np.pi, period, period + np.pi], rel=1e-12)
    assert [c.closing for c in motion.contacts] == [True, False, True]
    assert motion.largest(0) == pytest.approx(1.0, rel=1e-12)
    end, transition = state_transition(system, state, (0.0, period), omega=1.0)
    assert end == pytest.approx(state, abs=1e-11)
    # both half turns are -1 at once: the whole transition is the identity, at every amplitude the same period
    assert np.allclose(transition, np.eye(2), atol=1e-11)


def test_transition_through_contacts_is_a_product_of_exponentials():
    """Damped, with a gap: between located instants the system is linear, and the force has no jump there."""
    stiffness, gap, c = 30.0, 0.4, 0.08
    system = so.System(1.0, c, 1.0, [so.ElasticStop(dof=0, stiffness=stiffness, gap=gap)])
    state, end = np.array([0.0, 1.0]), 8.0
    motion = integrate(system, state, (0.0, end), omega=2.0)
    assert len(motion.contacts) >= 3
    product, begin, active = np.eye(2), 0.0, False
    for contact in [*motion.contacts, None]:
        until = end if contact is None else contact.time
        k = 1.0 + stiffness * active
        product = expm((until - begin) * np.array([[0.0, 1.0], [-k, -c]])) @ product
        begin = until
        if contact is not None:
            assert motion.at([contact.time])[0][0, 0] == pytest.approx(gap, abs=1e-11)
            active = contact.closing
    _, transition = state_transition(system, state, (0.0, end), omega=2.0)
    assert np.allclose(transition, product, atol=2e-11)


@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_a_grazing_contact_is_not_missed(depth):
    """x = sin t meets a soft stop at 1 - depth for a time of about 2 sqrt(2 depth), far less than a step."""
    gap = 1.0 - depth
    system = so.System(1.0, 0.0, 1.0, [so.ElasticStop(dof=0, stiffness=1e-3, gap=gap)])
    motion = integrate(system, [0.0, 1.0], (0.0, 3.0), omega=1.0)
    assert [c.closing for c in motion.contacts] == [True, False]
    # the instant of a grazing contact is known to the rounding of x divided by the velocity there
    assert motion.contacts[0].time == pytest.approx(np.arcsin(gap), abs=1e-13 / np.sqrt(depth))
    assert motion.contacts[1].time == pytest.approx(np.pi - np.arcsin(gap), abs=1e-3 * np.sqrt(2 * depth) + 1e-12)


def test_a_stop_just_out_of_reach_is_not_met():
    system = so.System(1.0, 0.0, 1.0, [so.ElasticStop(dof=0, stiffness=5.0, gap=1.0 + 1e-10)])
    assert integrate(system, [0.0, 1.0], (0.0, 10.0), omega=1.0).contacts == ()


def test_a_stop_closed_at_rest_starts_on_the_side_of_the_load():
    """From rest at the gap itself, neither displacement nor velocity tells whether the stop acts."""
    for sign in (+1.0, -1.0):
        system = so.System(
            1.0, 0.0, 1.0, [so.ElasticStop(dof=0, stiffness=8.0, gap=0.0)], [so.HarmonicLoad(0, sign, harmonic=0)]
        )
        k = 9.0 if sign > 0 else 1.0
        t = np.linspace(0.0, 0.9, 7)
        motion = integrate(system, [0.0, 0.0], t, omega=1.0)
        assert motion.x[:, 0] == pytest.approx(sign * (1.0 - np.cos(np.sqrt(k) * t)) / k, abs=1e-11)


def test_two_stops_at_one_place_and_one_on_the_other_side():
    """Coinciding switches change at one instant; energy is kept by all of them."""
    stops = [
        so.ElasticStop(dof=(0, 1), stiffness=3.0, gap=0.2),
        so.ElasticStop(dof=(0, 1), stiffness=4.0, gap=0.2),
        so.ElasticStop(dof=(0, 1), stiffness=7.0, gap=-0.2),
        so.ElasticStop(dof=1, stiffness=5.0, gap=-0.1, side="right"),  # preloaded
    ]
    system = so.System(np.diag([1.0, 2.0]), np.zeros((2, 2)), [[2.0, -1.0], [-1.0, 3.0]], stops)

    def energy(x, v):
        w = x[:, 0] - x[:, 1]
        stored = 3.5 * np.maximum(w - 0.2, 0) ** 2 + 3.5 * np.minimum(w + 0.2, 0) ** 2
        stored += 2.5 * np.maximum(x[:, 1] + 0.1, 0) ** 2
        quadratic = x[:, 0] ** 2 - x[:, 0] * x[:, 1] + 1.5 * x[:, 1] ** 2
        return stored + quadratic + 0.5 * v[:, 0] ** 2 + v[:, 1] ** 2

    motion = integrate(system, [0.5, 0.0, 0.3, -0.6], (0.0, 20.0), omega=1.0)
    assert len(motion.contacts) > 20
    assert energy(motion.x, motion.v) == pytest.approx(energy(motion.x[:1], motion.v[:1])[0], rel=1e-10)


def test_regularised_stop_and_cubic_keep_the_energy():
    """The force integrates to the work done: an independent quadrature of the element's own force."""
    from scipy.integrate import quad

    system = so.System(
        1.0,
        0.0,
        1.0,
        [so.CubicSpring(dof=0, coefficient=0.4), so.ElasticStop(dof=0, stiffness=6.0, gap=0.3, regularization=300.0)],
    )
    motion = integrate(system, [-0.8, 0.5], (0.0, 9.0), omega=1.0)
    stop = system.elements[1]
    c = stop.coefficient_values(system.parameters)

    def work(x):
        force = lambda u: float(stop.tangent(np.array([u]), np.zeros(1), c)[0][0])  # noqa: E731
        return quad(force, -0.8, x, epsabs=1e-13, epsrel=1e-13, points=[0.3] if x > 0.3 else None, limit=400)[0]

    sample = slice(None, None, 25)
    total = np.array(
        [
            0.5 * v**2 + 0.5 * x**2 + 0.1 * x**4 + work(x)
            for x, v in zip(motion.x[sample, 0], motion.v[sample, 0], strict=True)
        ]
    )
    assert total == pytest.approx(total[0], abs=3e-11)


class VanDerPol(Element):
    """`c (u^2 - 1) v`: a law that uses the velocity and tells nothing about its sharpness."""

    coefficient_names = ("c",)
    depends_on_velocity = True

    def __init__(self, dof, c):
        super().__init__(dof, [c])

    def sampling(self, c):
        return AdaptiveSampling()

    def tangent(self, u, v, c):
        return c[0] * (u * u - 1.0) * v, 2.0 * c[0] * u * v, c[0] * (u * u - 1.0)

    def curvature(self, u, v, c):
        return 2.0 * c[0] * v, 2.0 * c[0] * u, np.zeros_like(u)

    def coefficient_tangent(self, u, v, c):
        return ((u * u - 1.0) * v)[None], (2.0 * u * v)[None], (u * u - 1.0)[None]

    def coefficient_curvature(self, u, v, c):
        return np.zeros((1, 1, len(u)))


def rich_system():
    """Every kind of element, a velocity-dependent one too, on three coupled masses with an unbalance load."""
    mass, damping, stiffness = general_matrices()
    return so.System(
        mass,
        damping,
        stiffness,
        [
            so.CubicSpring(dof=(0, 2), coefficient=0.7),
            VanDerPol(1, 0.2),
            so.ElasticStop(dof=2, stiffness=20.0, gap=0.1),
            so.ElasticStop(dof=1, stiffness=15.0, gap=-0.15, regularization=200.0),
        ],
        [so.HarmonicLoad(dof=0, amplitude="e*omega**2", phase="0.2*omega")],
        parameters={"e": 0.8},
    )


def test_transition_is_the_derivative_of_the_flow():
    system, omega = rich_system(), 1.4
    state = np.array([0.3, 0.1, -0.2, 0.4, -0.5, 0.2])
    times = (0.0, 6.0)
    _, transition = state_transition(system, state, times, omega)
    h = 1e-5
    for i in range(6):
        step = h * np.eye(6)[i]
        up, _ = state_transition(system, state + step, times, omega)
        down, _ = state_transition(system, state - step, times, omega)
        assert np.allclose(transition[:, i], (up - down) / (2 * h), rtol=0.0, atol=3e-7)


def test_slope_in_omega_is_the_derivative_of_the_flow():
    """Over whole periods, loads whose amplitude and phase depend on omega included."""
    system, omega = rich_system(), 1.4
    z = np.array([0.3, 0.1, -0.2, 0.4, -0.5, 0.2])
    model = Field(system, omega)
    _, columns, _ = flow(model, 0.0, z, 2 * np.pi, 1e-12, slope=True)
    h = 1e-5
    up, _, _ = flow(model.at_frequency(omega * (1 + h)), 0.0, z, 2 * np.pi, 1e-12)
    down, _, _ = flow(model.at_frequency(omega * (1 - h)), 0.0, z, 2 * np.pi, 1e-12)
    assert np.allclose(columns[:, -1], (up - down) / (2 * h), rtol=0.0, atol=3e-7)


@pytest.mark.parametrize(("length", "time"), [(1e-6, 1e3), (1e3, 1e-3)])
def test_other_units_give_the_same_motion(length, time):
    """The reference oscillator with its length and its time measured in other units, stops exact and regularised."""

    def system(length, time):
        return so.System(
            1.0,
            0.06 / time,
            1.0 / time**2,
            [
                so.CubicSpring(0, 0.16 / (length * time) ** 2),
                so.ElasticStop(0, 4.7 / time**2, 0.1 * length),
                so.ElasticStop(0, 4.7 / time**2, -1.0 * length, regularization=3000.0 / length),
            ],
            [so.HarmonicLoad(0, 0.55 * length / time**2)],
        )

    scale = np.array([length, length / time])
    plain = integrate(system(1.0, 1.0), [1.2, 0.3], (0.0, 12.0), 2.5)
    other = integrate(system(length, time), scale * [1.2, 0.3], (0.0, 12.0 * time), 2.5 / time)
    assert len(plain.contacts) == len(other.contacts) > 4
    assert other.end / scale == pytest.approx(plain.end, abs=1e-10)
    # the same number of steps, give or take rounding: tolerances follow the units
    assert abs(len(other.t) - len(plain.t)) <= 2


def test_wrong_input_is_refused():
    system = so.library.reference_oscillator()
    with pytest.raises(InputError, match="shape"):
        integrate(system, [0.0, 0.0, 0.0], (0.0, 1.0), 2.0)
    with pytest.raises(InputError, match="finite"):
        integrate(system, [0.0, np.nan], (0.0, 1.0), 2.0)
    with pytest.raises(InputError, match="increasing"):
        integrate(system, [0.0, 0.0], (1.0, 0.0), 2.0)
    with pytest.raises(InputError, match="omega"):
        integrate(system, [0.0, 0.0], (0.0, 1.0), 0.0)
    with pytest.raises(InputError, match="alpha"):
        integrate(system, [0.0, 0.0], (0.0, 1.0), 2.0, values={"alhpa": 1.0})
    with pytest.raises(InputError, match="between"):
        integrate(system, [0.0, 0.0], (0.0, 1.0), 2.0).at([2.0])


def test_a_motion_without_bound_says_so():
    system = so.System(1.0, 0.0, 1.0, [so.CubicSpring(0, -1.0)])
    with pytest.raises(ConvergenceError, match="without bound"):
        integrate(system, [2.0, 0.0], (0.0, 50.0), 1.0)
