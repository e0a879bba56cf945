"""A model condensed onto the one DOF that stop and load touch: nothing above may notice.

Six masses in a row, condensed by themselves, against all of them unknown.
Curve, multipliers and located bifurcations must be those of the full model: the equations are the same, only the
unknowns that could be eliminated are gone.
"""

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.harmonic import HarmonicBalance, HarmonicBasis, StructuralMatrices, condensed
from suboctave.harmonic.condensed import linear_part_of
from suboctave.harmonic.elimination import complex_modes

N = 6


def chain(dof, unit=1.0):
    """A chain between two walls with a stop at one mass. `unit` multiplies all masses, stiffnesses and loads."""
    k = unit * (2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
    return so.System(
        mass=unit * np.eye(N),
        damping=0.06 * k,
        stiffness=k,
        elements=[so.ElasticStop(dof, stiffness="Kc", gap=0.5), so.CubicSpring(dof, 0.05 * unit)],
        loads=[so.HarmonicLoad(dof, amplitude="p")],
        parameters={"Kc": 3.0 * unit, "p": 0.4 * unit},
    )


def whole(system, *arguments, **options):
    """The response with all degrees of freedom unknown."""
    return so.frequency_response(system, *arguments, linear=StructuralMatrices(system), **options)


@pytest.fixture(scope="module")
def full():
    return whole(chain(0), (0.35, 1.0), harmonics=9)


@pytest.fixture(scope="module")
def condensed_branch():
    return so.frequency_response(chain(0), (0.35, 1.0), harmonics=9)


def test_same_bifurcations(full, condensed_branch):
    assert len(full.bifurcations) >= 2
    assert [b.kind for b in condensed_branch.bifurcations] == [b.kind for b in full.bifurcations]
    for one, other in zip(condensed_branch.bifurcations, full.bifurcations, strict=True):
        assert one.omega == pytest.approx(other.omega, rel=1e-9)
        assert one.amplitude == pytest.approx(other.amplitude, rel=1e-6)
        np.testing.assert_allclose(one.multipliers[0], other.multipliers[0], atol=1e-5)


def test_same_normal_forms(full, condensed_branch):
    """The null vectors have other lengths: per squared amplitude at the common mass they foretell the same."""
    compared = 0
    for one, other in zip(condensed_branch.bifurcations, full.bifurcations, strict=True):
        assert one.criticality == other.criticality
        if one.normal_form is None:
            continue
        sizes = []
        for b in (one, other):
            weight = b.orbit.balance.scales[1]
            phi = b.null_vectors.right.reshape(-1, len(weight)) * weight
            sizes.append(b.normal_form["curvature"] / np.sum(np.abs(phi[:, 0]) ** 2))
        assert sizes[0] == pytest.approx(sizes[1], rel=1e-7)
        compared += 1
    assert compared


def test_a_branch_that_leaves_has_the_unknowns_of_its_parent(full, condensed_branch):
    branches = [so.switch_branch(response.bifurcations["PD"][0]) for response in (full, condensed_branch)]
    assert [branch.points[0].orbit.x.shape[1] for branch in branches] == [N, 1]
    one, other = ([(b.kind, round(b.omega, 7)) for b in branch.bifurcations] for branch in branches)
    assert one == other


@pytest.mark.parametrize("parameter", ["p", "Kc"])
def test_same_curves_of_bifurcations(full, condensed_branch, parameter):
    """In two parameters, with the same extrema and points of codimension two on the way."""
    kinds = {}
    for one, other in zip(condensed_branch.bifurcations, full.bifurcations, strict=True):
        if kinds.setdefault(one.kind, one) is not one:
            continue
        value = one.parameters[parameter]
        a, b = (so.track(item, parameter, (0.8 * value, 1.2 * value)) for item in (one, other))
        for name in ("omega", parameter):
            assert a.parameter(name)[[0, -1]] == pytest.approx(b.parameter(name)[[0, -1]], rel=1e-7), one.kind
        assert [e.remark() or e.kind for e in a.bifurcations] == [e.remark() or e.kind for e in b.bifurcations]
        for e, f in zip(a.bifurcations, b.bifurcations, strict=True):
            assert e.omega == pytest.approx(f.omega, rel=1e-6)
    assert kinds


def test_same_curve(full, condensed_branch):
    """Every point of the condensed curve, expanded to all DOFs, solves the full model; stability is the same there."""
    balance, doubtful = HarmonicBalance(chain(0), HarmonicBasis(9)), 0
    for i in range(0, len(condensed_branch), 5):
        point = condensed_branch.points[i]
        orbit = point.orbit
        assert orbit.x.shape == (19, 1)
        start = orbit.coefficients
        assert start.shape == (19, N)
        assert start[:, 0] == pytest.approx(orbit.x[:, 0], abs=1e-14)
        whole = balance.at(start, orbit.omega)
        assert np.abs(whole.residual).max() < 1e-9
        verdict = floquet_multipliers(whole)
        # where a contact has just begun the harmonics do not tell them better than their errors say
        apart = np.abs(np.abs(point.floquet.multipliers) - np.abs(verdict.multipliers))
        assert np.all(apart <= 1e-7 + point.floquet.errors)
        doubtful += apart.max() > 1e-7
        assert point.floquet.stable == verdict.stable
    assert doubtful < 2
    assert 0 < condensed_branch.stable.sum() < len(condensed_branch)
    assert condensed_branch.ended == full.ended


def test_units_do_not_matter():
    """Masses, stiffnesses and loads a million times larger: the same points, to rounding."""
    curves = []
    for unit in (1.0, 1e6):
        system = chain(0, unit)
        curves.append(so.frequency_response(system, (0.5, 0.7), harmonics=5))
    assert len(curves[0]) == len(curves[1])
    np.testing.assert_allclose(curves[1].amplitude, curves[0].amplitude, rtol=1e-6)
    assert [b.kind for b in curves[0].bifurcations] == [b.kind for b in curves[1].bifurcations]


def test_any_dof_is_observed():
    """A stop at the last mass: `observe`, `amplitude`, `harmonic` and `displacement` count the structure's DOFs."""
    system = chain(N - 1)
    branch, other = (verb(system, (0.3, 0.4), harmonics=5) for verb in (so.frequency_response, whole))
    one, all_ = branch.orbits[-1], other.orbits[-1]
    for dof in range(N):
        assert one.amplitude(dof) == pytest.approx(all_.amplitude(dof), rel=1e-8)
        assert one.harmonic(1, dof) == pytest.approx(all_.harmonic(1, dof), rel=1e-7)
    np.testing.assert_allclose(one.displacement(0.7), all_.displacement(0.7), atol=1e-9)
    observed = so.frequency_response(system, (0.3, 0.4), harmonics=5, observe=2)
    assert observed.amplitude[-1] == pytest.approx(all_.amplitude(2), rel=1e-8)


def test_starts_are_given_for_the_structure():
    """A state, coefficients or a motion of all degrees of freedom; and the motion read back is the same."""
    system = chain(0)
    motion = whole(system, (0.35, 0.4), harmonics=5).orbits[0]
    for start in (motion, motion.coefficients, motion.start()):
        again = so.frequency_response(system, (0.35, 0.36), harmonics=5, start=start).orbits[0]
        np.testing.assert_allclose(again.coefficients, motion.coefficients, atol=1e-9)
    with pytest.raises(InputError, match="length 12"):
        so.frequency_response(system, (0.3, 0.4), harmonics=5, start=[0.1, 0.0])


@pytest.mark.parametrize("formulation", ["extended", "alcorta2019"])
def test_period_doublings_by_other_formulations(formulation):
    """Extended systems see the linear part through its contract alone, as the bordered one does."""
    k = 2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
    elements = [so.ElasticStop(0, 9.0, 0.0), so.CubicSpring(0, 0.1)]
    system = so.System(np.eye(3), 0.03 * k, 2.0 * k, elements, [so.HarmonicLoad(0, 0.5)])
    full = whole(system, (2.8, 2.2), harmonics=9, formulation=formulation).bifurcations["PD"]
    small = so.frequency_response(system, (2.8, 2.2), harmonics=9, formulation=formulation).bifurcations["PD"]
    default = so.frequency_response(system, (2.8, 2.2), harmonics=9).bifurcations["PD"]
    assert len(default) == 2
    assert [b.omega for b in small] == pytest.approx([b.omega for b in full], abs=1e-9)
    exact = formulation == "extended"
    assert [b.omega for b in small] == pytest.approx([b.omega for b in default], abs=1e-10 if exact else 1e-4)


def coupled(damping=0.02):
    """Masses in a row whose damping no vibration has to itself."""
    n = 7
    stiffness = np.diag(np.linspace(2.0, 9.0, n)) - np.eye(n, k=1) - np.eye(n, k=-1)
    rng = np.random.default_rng(5)
    dampers = damping * sum(np.outer(d, d) for d in rng.normal(size=(4, n)))
    return so.System(
        np.diag(np.linspace(1.0, 1.5, n)), {"c": dampers}, {"k": stiffness, 1.0: 0.3 * np.eye(n)},
        [so.ElasticStop(0, 3.0, 0.5)], [so.HarmonicLoad(n - 1, 0.4)], parameters={"c": 1.0, "k": 1.0},
    )  # fmt: skip


def test_complex_modes_stand_for_vibrations_that_damping_couples(monkeypatch):
    """What they make of everything is what a solution at every frequency makes of it."""
    frequency = np.array([0.0, 0.7, 1.9, 13.0])
    amplitudes = np.array([[1.0], [0.4 - 1j], [0.2j], [0.1]])

    def made(states):
        linear = linear_part_of(coupled())
        assert (linear._modes is not None) == states
        parts = [linear.stiffness(frequency, order) for order in range(3)]
        parts += [linear.stiffness_by(frequency, names) for names in (("c",), ("k",), ("c", "k"), ("k", "k"))]
        parts += [linear.stiffness_by(frequency, ("c",), 1), linear.loaded(frequency), linear.loaded(frequency, ("k",))]
        parts += [linear.feeding(frequency), linear.fed(0.01).stiffness(frequency)]
        return [*parts, linear.recovered(frequency, amplitudes)]

    by_states = made(True)
    with monkeypatch.context() as patch:
        patch.setattr(condensed, "complex_modes", lambda damping, stiffness: None)
        by_solution = made(False)
    for one, other in zip(by_states, by_solution, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-12 * np.abs(other).max())
    whole = StructuralMatrices(coupled()).stiffness(frequency)
    exact = 1.0 / np.linalg.inv(whole)[:, 0, 0]
    np.testing.assert_allclose(by_states[0][:, 0, 0], exact, rtol=1e-11)


def test_complex_modes_that_lie_together_are_none():
    """Critical damping of one vibration leaves it one direction."""
    stiffness, damping = np.diag([1.0, 4.0]), np.array([[2.0, 1e-7], [1e-7, 0.1]])
    assert complex_modes(damping, stiffness) is None
    assert complex_modes(0.1 * damping, stiffness) is not None
    assert complex_modes(np.diag([0.1, 0.2]), stiffness) is None


def test_modal_damping_gives_the_same_curve():
    own = coupled(0.003)
    structure = so.Structure(own.mass.value({}), own.stiffness.value({"k": 1.0}), damping=so.ModalDamping(0.01))
    system = structure.system(list(own.elements), [so.HarmonicLoad(0, 0.5)])
    few, all_known = so.frequency_response(system, (1.0, 1.1), harmonics=9), whole(system, (1.0, 1.1), harmonics=9)
    assert few.orbits[0].state().linear._modes is not None
    assert len(few.bifurcations) == len(all_known.bifurcations) >= 2
    for one, other in zip(few.bifurcations, all_known.bifurcations, strict=True):
        assert one.kind == other.kind
        assert one.omega == pytest.approx(other.omega, rel=1e-9)
