"""Every derivative of the harmonic-balance equations against central differences of what it is the derivative of.

Two DOFs with a coupled, unsymmetric linear part, two contacts, a cubic spring and a damper that depends on velocity
and position; parameters enter matrices, elements and loads nonlinearly; one load's amplitude and phase depend on
omega. Each case in a plain and in a doubled basis, and each also in flexibility form.
"""

import numpy as np
import pytest

from suboctave.harmonic import HarmonicBalance, HarmonicBasis, StructuralMatrices
from suboctave.harmonic.basis import to_complex, to_real
from suboctave.harmonic.condensed import linear_part_of
from suboctave.harmonic.derivatives import Direction, Multilinear, second_derivative, third_derivative
from suboctave.harmonic.perturbation import (
    Kind,
    bilinear_gradient,
    operator,
    operator_along,
    operator_by_motion,
    parameter_gradient,
    rate_by_kappa,
)
from suboctave.harmonic.waves import Frequencies, Waves
from suboctave.model import (
    CubicSpring,
    ElasticStop,
    Expression,
    HarmonicLoad,
    QuadraticDamper,
    System,
    TanhFriction,
    check_derivatives,
)

OMEGA, KAPPA, STEP = 1.7, 0.37, 1e-6
INPUTS = {"x": 0, "y": (0, 1)}
NAMES = ("zeta", "alpha", "Kc", "j", "p", "k")


def contacts(regularization):
    """A stop between two DOFs and one to ground, sharing a parameter and the gap."""
    return [
        ElasticStop((0, 1), stiffness="Kc*k", gap="j", regularization=regularization),
        ElasticStop(1, stiffness="Kc", gap="-1+j", side="left", regularization=regularization),
    ]


def own_nodes():
    """Corners in displacement and velocity, sharp in velocity, coupled, and in time; parameters in all of them."""
    return [
        Expression(0, "alpha*max(x - j, 0)*(1 + zeta*v) + zeta*v*abs(v)"),
        Expression(1, "k*x*y**2*(1 + j*cos(omega*t + p)) + Kc*x'*y", {"x": 0, "y": (0, 1)}),
        QuadraticDamper((0, 1), "zeta*k"),
        TanhFriction(1, "p", "0.05*k"),
        CubicSpring(0, "alpha"),
    ]


@pytest.fixture(scope="module", params=["exact", "regularised", "damper", "own nodes", "rough", "surfaces"])
def elements(request, damper):
    cubic = CubicSpring(0, "alpha")
    return {
        "exact": [cubic, *contacts(None)],
        "regularised": [cubic, *contacts(30.0)],
        # in one direction with the cubic spring, and in one of its own
        "own nodes": own_nodes(),
        # powers of a half and a corner at one place, the latter moving in time
        "rough": [
            cubic,
            Expression(0, "Kc*max(x - j, 0)**1.5*(1 + zeta*x') + p*abs(x - j)*(1 + y)*(1 + 0.3*cos(omega*t))", INPUTS),
        ],
        # corners where functions of several displacements, of velocities and of time vanish
        "surfaces": [
            cubic,
            Expression(
                0, "Kc*max(x*(1+0.4*y) + 0.3*y - j*(1 + 0.3*cos(omega*t + p)), 0)*(1 + zeta*x' + 0.5*y)", INPUTS
            ),
            Expression(1, "k*max(sqrt(x**2 + y**2 + 0.1) - 2*j, 0)*x + alpha*abs(x' - 0.5*y + k*y'*x)", INPUTS),
        ],
        "damper": [cubic, damper(0, ["zeta*k", "j**2"]), damper((0, 1), ["alpha", "zeta+Kc*j"])],
    }[request.param]


MASS = [[1.0, 0.1], [0.1, 2.0]]
DAMPING = [["2*zeta", -0.01], [0.02, "0.05*k"]]
STIFFNESS = [["2+k", -1], [-1, "1+k**2"]]
#: of two masses behind these that no force acts on: beside the first two, and their own
BEHIND = [
    ([[0.0, 0.1], [0.0, 0.0]], [[0.7, 0.0], [0.0, "1+0.1*k**2"]]),
    ([[-0.01, 0.02], [0.0, "0.01*zeta*k"]], [["zeta", 0.0], [0.0, 0.3]]),
    ([[-1.0, "-0.3*k"], [0.2, -0.5]], [["1.5+k*zeta", -0.2], [-0.2, "2+k"]]),
]


def grown(matrix, behind):
    beside, own = behind
    rows = [[*a, *b] for a, b in zip(matrix, beside, strict=True)]
    return rows + [[beside[0][i], beside[1][i], *own[i]] for i in range(2)]


class Case:
    """Equations at a random motion, and as functions of everything they depend on."""

    def __init__(self, elements, nu, hidden):
        mass, damping, stiffness = MASS, DAMPING, STIFFNESS
        if hidden:
            mass, damping, stiffness = (
                grown(matrix, behind) for matrix, behind in zip((mass, damping, stiffness), BEHIND, strict=True)
            )
        self.system = System(
            mass=mass,
            damping=damping,
            stiffness=stiffness,
            elements=elements,
            loads=[
                HarmonicLoad(dof=0, amplitude="p*omega**2", phase="0.1*omega*k"),
                HarmonicLoad(dof=1, amplitude="p*k", harmonic=2, static="0.1*p"),
            ],
            parameters={"zeta": 0.03, "alpha": 0.16, "Kc": 4.7, "j": 0.2, "p": 0.5, "k": 1.3},
        )
        self.values = dict(self.system.parameters)
        self.basis = HarmonicBasis(6 * nu, nu)
        self.random = np.random.default_rng(0)
        self.x = self.vector() / (1 + np.arange(self.basis.size)[:, None])
        form = linear_part_of(self.system)
        assert form.size == 2
        self.balance = HarmonicBalance(self.system, self.basis, linear=form).settle(self.x, OMEGA)
        self.state = self.at(0.0)

    def vector(self):
        return self.random.normal(size=(self.basis.size, 2))

    def at(self, h, dx=0.0, **rates):
        """The state at a distance h along a direction."""
        values = {name: value + h * rates.get(name, 0.0) for name, value in self.values.items()}
        return self.balance.at(self.x + h * dx, OMEGA + h * rates.get("omega", 0.0), values)


@pytest.fixture(scope="module", params=[(1, "whole"), (2, "whole"), (1, "condensed")], ids=str)
def made(request, elements):
    nu, form = request.param
    return Case(elements, nu, form == "condensed")


@pytest.fixture
def case(made):
    """With the same random vectors whatever ran before."""
    made.random = np.random.default_rng(1)
    return made


def difference(function, step=STEP):
    return (function(step) - function(-step)) / (2 * step)


def assert_close(exact, function, step=STEP):
    """`exact` is the derivative of `function` at 0: to 1e-6 of its size, and to the rounding of the quotient."""
    rough = difference(function, step)
    rounding = 1e-14 * np.abs(function(0.0)).max() / step
    assert np.abs(rough - exact).max() <= 1e-6 * np.abs(exact).max() + 10 * rounding + 1e-9


def test_the_damper_used_here_is_right(damper):
    assert check_derivatives(damper(0, [0.1, 0.7])).ok


def test_jacobian(case):
    dx = case.vector()
    assert_close(case.state.jacobian @ dx.ravel(), lambda h: case.at(h, dx).residual)


@pytest.mark.parametrize("name", ["omega", *NAMES])
def test_parameter_derivatives(case, name):
    assert_close(case.state.residual_by(name), lambda h: case.at(h, **{name: 1.0}).residual)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({}, {}),
        ({"omega": 0.3}, {"omega": -0.7}),
        ({}, {"omega": 1.0}),
        ({"j": 0.4, "Kc": 0.2, "omega": 0.3}, {"k": 0.5, "p": 0.1, "j": -0.3, "omega": 0.2, "zeta": 0.3}),
        ({"k": 1.0}, {"k": 1.0}),
        ({"alpha": 0.3, "zeta": -0.2}, {"omega": 0.5, "j": 0.3}),
    ],
)
def test_second_derivative(case, first, second):
    da, db = case.vector(), case.vector()

    def slope(h):
        state = case.at(h, db, **second)
        return state.jacobian @ da.ravel() + sum(rate * state.residual_by(name) for name, rate in first.items())

    exact = second_derivative(case.state, Direction(da, first), Direction(db, second))
    assert_close(exact, slope)
    swapped = second_derivative(case.state, Direction(db, second), Direction(da, first))
    assert np.abs(swapped - exact).max() <= 1e-11 * np.abs(exact).max()


def test_third_derivative(case):
    a, b, c = case.vector(), case.vector(), case.vector()
    exact = third_derivative(case.state, a, b, c)
    assert_close_fourth(exact, lambda h: second_derivative(case.at(h, c), Direction(a), Direction(b)))
    swapped = third_derivative(case.state, c, b, a)
    assert np.abs(swapped - exact).max() <= 1e-10 * np.abs(exact).max()


def assert_close_fourth(exact, function, step=1e-5):
    """By differences of fourth order: second derivatives are steep beside a crossing that is nearly tangent."""
    rough = (8.0 * (function(step) - function(-step)) - (function(2 * step) - function(-2 * step))) / (12.0 * step)
    assert np.abs(rough - exact).max() <= 1e-6 * np.abs(exact).max()


def test_derivatives_along_waves_are_those_of_a_longer_basis(case):
    """Half-odd perturbations and their products live in the basis of twice the period."""
    basis = case.basis
    doubled = HarmonicBasis(2 * basis.harmonics + 1, 2 * basis.nu)
    balance = case.balance.with_basis(doubled).settle(basis.resized(case.x, doubled), OMEGA)
    state = balance.at(basis.resized(case.x, doubled), OMEGA)
    half, longer = case.random.normal(size=(2, 2 * basis.harmonics + 2, 2)), []
    for one in half:
        full = np.zeros((doubled.size, 2))
        full[1::4], full[2::4] = one[::2], one[1::2]
        longer.append(full)
    forms, (a, b) = Multilinear(case.state), (Waves.of(case.state, Kind.HALF, one) for one in half)
    second = forms.second(a, b, Frequencies.of(case.state, Kind.INTEGER)).vector(Kind.INTEGER)
    expected = second_derivative(state, Direction(longer[0]), Direction(longer[1])).reshape(-1, 2)
    whole = np.concatenate(([0], np.arange(3, doubled.size, 4), np.arange(4, doubled.size, 4)))
    found = basis.resized(second.reshape(-1, 2), doubled)
    size = np.abs(expected).max()
    np.testing.assert_allclose(found[whole], expected[whole], rtol=0, atol=1e-6 * size)
    assert np.abs(np.delete(expected, whole, axis=0)).max() <= 1e-6 * size
    third = forms.third(a, b, b, Frequencies.of(case.state, Kind.HALF)).vector(Kind.HALF).reshape(-1, 2)
    expected = third_derivative(state, longer[0], longer[1], longer[1]).reshape(-1, 2)
    size = np.abs(expected).max()
    np.testing.assert_allclose(third[::2], expected[1::4], rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(third[1::2], expected[2::4], rtol=0, atol=1e-6 * size)


def test_derivatives_along_waves_of_any_shift(case):
    """For a real direction a, R''[a, b] is the change of J_kappa b, and the third derivative that of R''."""
    n = case.balance.dimension
    da, dc = case.vector(), case.vector()
    b = case.random.normal(size=n) + 1j * case.random.normal(size=n)
    at = Frequencies.of(case.state, Kind.FREE, KAPPA)
    a, c = (Waves.of(case.state, Kind.INTEGER, one) for one in (da, dc))

    def second(state):
        return Multilinear(state).second(a, Waves.of(state, Kind.FREE, b, KAPPA), at).vector(Kind.FREE)

    assert_close(second(case.state), lambda h: operator(case.at(h, da), Kind.FREE, KAPPA) @ b)
    third = Multilinear(case.state).third(a, Waves.of(case.state, Kind.FREE, b, KAPPA), c, at).vector(Kind.FREE)
    assert_close_fourth(third, lambda h: second(case.at(h, dc)))


@pytest.mark.parametrize("kind", Kind)
def test_gradient_of_a_bilinear_form_of_the_operator(case, kind):
    n = operator(case.state, kind, KAPPA).shape[0]
    left, right = case.random.normal(size=(2, n))
    if kind is Kind.FREE:
        left, right = left + 1j * case.random.normal(size=n), right + 1j * case.random.normal(size=n)
    gradient = bilinear_gradient(case.state, kind, left, right, ("omega", *NAMES), KAPPA)
    dx = case.vector()

    def form(state, kappa=KAPPA):
        return np.vdot(left, operator(state, kind, kappa) @ right)

    assert_close((gradient.x * dx).sum(), lambda h: form(case.at(h, dx)))
    for name in ("omega", *NAMES):
        assert_close(gradient.rates[name], lambda h, name=name: form(case.at(h, **{name: 1.0})))
    if kind is Kind.FREE:
        assert_close(gradient.kappa, lambda h: form(case.state, KAPPA + h))


@pytest.mark.parametrize("kind", [Kind.INTEGER, Kind.HALF])
@pytest.mark.parametrize("nu", [1, 2])
@pytest.mark.parametrize("regularization", [None, 20.0])
def test_gradient_without_velocity(kind, nu, regularization):
    """Forces of displacements alone, against differences."""
    case = Case([*contacts(regularization), CubicSpring((0, 1), coefficient="alpha")], nu, None)
    left, right = case.random.normal(size=(2, len(operator(case.state, kind))))
    gradient = bilinear_gradient(case.state, kind, left, right, ("omega",))
    dx = case.vector()

    def form(state):
        return left @ operator(state, kind) @ right

    assert_close((gradient.x * dx).sum(), lambda h: form(case.at(h, dx)))
    assert_close(gradient.rates["omega"], lambda h: form(case.at(h, omega=1.0)))
    assert gradient.kappa == pytest.approx(rate_by_kappa(case.state, kind, left, right), rel=1e-12)


@pytest.mark.parametrize("name", ["omega", *NAMES])
def test_the_column_of_the_parameter(case, name):
    extended = case.state.extended_jacobian(name)
    size = np.abs(extended).max()
    np.testing.assert_allclose(extended[:, :-1], case.state.jacobian, atol=1e-13 * size)
    np.testing.assert_allclose(extended[:, -1], case.state.residual_by(name), atol=1e-13 * size)


@pytest.mark.parametrize("name", ["omega", *NAMES])
def test_gradient_of_a_parameter_derivative(case, name):
    left, dx = case.random.normal(size=case.balance.dimension), case.vector()
    others = ("omega", "j", "k", "Kc", "zeta")
    gradient = parameter_gradient(case.state, left, name, others)

    def form(state):
        return left @ state.residual_by(name)

    assert_close((gradient.x * dx).sum(), lambda h: form(case.at(h, dx)))
    for other in others:
        assert_close(gradient.rates[other].real, lambda h, other=other: form(case.at(h, **{other: 1.0})))


def test_the_free_operator_contains_the_real_ones(case):
    """J_kappa at kappa = 0 is the Jacobian in another basis, and a change of basis keeps the determinant."""
    sign, size = np.linalg.slogdet(operator(case.state, Kind.FREE, 0.0))
    real_sign, real_size = np.linalg.slogdet(case.state.jacobian)
    assert sign.real == pytest.approx(real_sign, abs=1e-9)
    assert size == pytest.approx(real_size, rel=1e-12)


def test_condensed_equations_are_those_of_the_whole_structure(elements):
    """R of the condensed form is R of all degrees of freedom where the others move as they must, without forces."""
    case = Case(elements, 1, True)
    linear, frequencies = case.balance.linear, case.state.frequencies
    x = to_real(linear.shaped(linear.recovered(frequencies, to_complex(case.x))))
    np.testing.assert_allclose(linear.read(x), case.x, atol=1e-12)
    matrices = StructuralMatrices(case.system)
    balance = HarmonicBalance(case.system, case.basis, linear=matrices, samples=case.balance.samples)
    whole = balance.at(x, OMEGA).residual.reshape(x.shape)
    own = case.state.residual.reshape(case.x.shape) @ linear.reduction.directions
    np.testing.assert_allclose(whole, own, atol=1e-11)


@pytest.mark.parametrize("kind", list(Kind))
def test_operator_along_directions(case, kind):
    """`(J_kappa v)'` along several directions at once; for J_0 it is R'' as well, for all the adjoint gradient."""
    state = case.state
    matrix = operator(state, kind, KAPPA)
    right = case.random.normal(size=len(matrix)).astype(matrix.dtype)
    if kind is Kind.FREE:
        right = right + 1j * case.random.normal(size=len(matrix))
    rates = [{"omega": 0.7}, {"omega": -0.2, **dict.fromkeys(NAMES, 0.3)}]
    shifts = [0.4, -0.9]
    directions = [Direction(case.vector(), change) for change in rates]
    found = operator_along(state, kind, right, directions, KAPPA, shifts)
    for column, a, shift in zip(found.T, directions, shifts, strict=True):
        assert_close(column, lambda h: operator(case.at(h, a.x, **a.rates), kind, KAPPA + h * shift) @ right)  # noqa: B023
    left = case.random.normal(size=len(matrix))
    adjoint = bilinear_gradient(state, kind, left, right, ("omega", *NAMES), KAPPA)
    for column, a, shift in zip(found.T, directions, shifts, strict=True):
        expected = (adjoint.x * a.x).sum() + sum(adjoint.rates[name] * rate for name, rate in a.rates.items())
        expected += adjoint.kappa * shift if kind is Kind.FREE else 0.0
        assert left @ column == pytest.approx(expected, rel=1e-9)
    if kind is Kind.INTEGER:
        along = Direction(right.reshape(case.basis.size, 2))
        np.testing.assert_allclose(found[:, 1], second_derivative(state, directions[1], along), rtol=1e-9, atol=1e-9)
        every = operator_by_motion(state, right)
        alone = second_derivative(state, Direction(directions[0].x), along)
        np.testing.assert_allclose(every @ directions[0].x.ravel(), alone, rtol=1e-9, atol=1e-9)
