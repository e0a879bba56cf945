"""`verify` of whole branches: right ones agree point by point, planted errors are found where they were planted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import suboctave as so
from suboctave.errors import InputError
from suboctave.results.branch import Branch
from suboctave.timedomain import shoot


@pytest.fixture(scope="module")
def checked(duffing_curve):
    return so.verify(duffing_curve)


def planted(branch, index, **changes):
    """The branch with one of its points changed."""
    points = list(branch.points)
    points[index] = replace(points[index], **changes)
    return Branch(
        branch.system, branch.name, points, list(branch.bifurcations.met), [], branch.closed, branch.endings,
        branch.observe, branch.options,
    )  # fmt: skip


def test_a_response_agrees(duffing_curve, checked):
    assert checked.agrees
    assert checked.complete
    assert len(checked.points) == len(duffing_curve)
    assert [b.kind for b in checked.bifurcations] == ["LP", "LP"]
    for found, item in zip(checked.bifurcations, duffing_curve.bifurcations.met, strict=True):
        assert found.agrees
        assert found.true_omega == pytest.approx(item.omega, rel=1e-6)
    assert max(point.distance for point in checked.points) < 5e-4
    assert "2 of 2 bifurcations are confirmed" in checked.summary


def test_true_multipliers_are_those_of_the_variational_equations(duffing_curve, checked):
    """Differences along the compiled flow against the exact tangent, integrated by another code."""
    for at in (5, len(duffing_curve) // 2, len(duffing_curve) - 10):
        point, orbit = checked.points[at], duffing_curve.orbits[at]
        true = shoot(orbit.system, orbit.start(), orbit.omega)
        order = np.argsort(true.multipliers.imag)
        own = point.multipliers[np.argsort(point.multipliers.imag)]
        # shooting at the orbit's own frequency, not at that of the nearest motion
        np.testing.assert_allclose(own, true.multipliers[order], atol=20.0 * point.distance)
        assert np.max(point.errors) < 1e-6


def test_a_wrong_motion_is_found(duffing_curve):
    orbit = duffing_curve.orbits[30]
    coefficients = orbit.coefficients.copy()
    coefficients[1] *= 1.02
    wrong = planted(duffing_curve, 30, orbit=replace(orbit, x=coefficients))
    check = so.verify(wrong, points=range(25, 36), bifurcations=False)
    assert [point.index for point in check.disagreements] == [30]
    assert not check.agrees
    assert "1 disagrees" in check.summary
    assert "another motion" in repr(check)


@pytest.mark.parametrize("to", [1.3, 0.4])
def test_wrong_multipliers_are_found(duffing_curve, to):
    """With the other verdict, and with the same one."""
    floquet = duffing_curve.points[30].floquet
    assert floquet.stable
    scaled = floquet.multipliers * (to / np.abs(floquet.multipliers).max())
    wrong = planted(duffing_curve, 30, known=replace(floquet, multipliers=scaled))
    check = so.verify(wrong, points=[29, 30, 31], bifurcations=False)
    (bad,) = check.disagreements
    assert bad.index == 30
    assert ("the opposite" if to > 1.0 else "Multipliers of shooting differ") in bad.reason


@pytest.mark.parametrize(
    ("errors", "outcome"), [((0.25, 0.25), "cannot tell"), ((0.15, 0.15), "disagrees"), ((0.25, 0.15), "disagrees")]
)
def test_verdicts_that_the_branch_leaves_open_are_not_compared(duffing_curve, errors, outcome):
    """The wrong verdict once more, of multipliers that may be off by as much, or one of which is not."""
    floquet = duffing_curve.points[30].floquet
    scaled = floquet.multipliers * (1.2 / np.abs(floquet.multipliers).max())
    assert np.abs(scaled) == pytest.approx(1.2)
    known = replace(floquet, multipliers=scaled, errors=np.array(errors))
    (point,) = so.verify(planted(duffing_curve, 30, known=known), points=[30], bifurcations=False).points
    assert point.outcome == outcome


def test_verdicts_too_near_to_the_circle_are_not_compared(duffing_curve):
    """The wrong verdict again, with a tolerance within which the true multiplier lies."""
    floquet = duffing_curve.points[30].floquet
    scaled = floquet.multipliers * (1.2 / np.abs(floquet.multipliers).max())
    wrong = planted(duffing_curve, 30, known=replace(floquet, multipliers=scaled))
    distance = 1.0 - np.abs(floquet.multipliers).max()
    check = so.verify(wrong, tolerance=1.1 * distance, points=[30], bifurcations=False)
    assert check.points[0].outcome == "cannot tell"
    assert "unit circle" in check.points[0].reason
    assert check.agrees


def test_a_misplaced_bifurcation_is_not_confirmed(duffing_curve):
    item = duffing_curve.bifurcations["LP"][0]
    orbit = duffing_curve.orbits[20]
    wrong = Branch(
        duffing_curve.system, "omega", list(duffing_curve.points), [replace(item, orbit=orbit)], [], False, (),
        duffing_curve.observe, {},
    )  # fmt: skip
    (found,) = so.verify(wrong, points=[0]).bifurcations
    assert not found.agrees
    assert "NOT CONFIRMED" in repr(found)


def test_exact_contacts_and_doublings(rattling_curve):
    check = so.verify(rattling_curve, points=15)
    assert check.agrees, check
    assert len(check.points) == 15
    kinds = [b.kind for b in check.bifurcations]
    assert kinds.count("PD") == 2
    assert kinds.count("LP") == 2


def test_two_degrees_of_freedom_and_tori():
    branch = so.frequency_response(so.library.nltva(0.11), (1.0, 1.15))
    check = so.verify(branch, every=3)
    assert check.agrees, check
    assert "NS" in [b.kind for b in check.bifurcations]
    for point in check.points:
        assert point.multipliers.shape == (4,)
        # Liouville: the product of all multipliers is exp(-trace(C) T)
        damping = np.trace(branch.system.damping.value(branch.system.parameters) @ np.linalg.inv(
            branch.system.mass.value(branch.system.parameters)))  # fmt: skip
        product = np.prod(point.multipliers)
        assert product == pytest.approx(np.exp(-damping * 2.0 * np.pi / point.omega), rel=1e-5)


def test_branch_points_and_a_parameter():
    """A curve along the load at fixed frequency; a symmetric response with a branch point."""
    duffing = so.library.duffing()
    along = so.continue_branch(duffing, parameter="F", bounds=(0.05, 0.6), omega=0.5)
    assert so.verify(along, points=8).agrees
    frame = so.verify(along, points=3).to_dataframe()
    assert frame["F"].iloc[0] == pytest.approx(along.parameter("F")[0])
    symmetric = so.frequency_response(duffing, (0.65, 0.8))
    check = so.verify(symmetric, points=6)
    assert check.agrees
    assert "BP" in [b.kind for b in check.bifurcations]


def test_multipliers_of_a_million():
    """Small motions about the top between two wells: the product of the growth is exp(2 pi r / omega)."""
    hill = so.System(
        mass=1.0, damping=0.1, stiffness="k", elements=[so.CubicSpring(dof=0, coefficient=1.0)],
        loads=[so.HarmonicLoad(dof=0, amplitude=1e-3)], parameters={"k": 1.0},
    )  # fmt: skip
    down = so.continue_branch(hill, parameter="k", bounds=(1.0, -1.0), omega=0.45)
    branch = so.frequency_response(hill.with_parameters(k=-1.0), (0.45, 0.4), start=down.orbits[-1])
    assert branch.amplitude.max() < 2e-3
    check = so.verify(branch)
    assert check.agrees, check
    growth = -0.05 + np.sqrt(1.0 + 0.05**2)
    for point in check.points:
        assert abs(point.multipliers[0]) == pytest.approx(np.exp(2.0 * np.pi * growth / point.omega), rel=1e-4)
        assert abs(point.multipliers[0]) > 5e5


def test_tables_and_a_picture(checked, tmp_path):
    frame = checked.to_dataframe()
    assert len(frame) == len(checked.points)
    assert set(frame["outcome"]) <= {"agrees", "cannot tell"}
    assert list(checked.bifurcations_frame()["agrees"]) == [True, True]
    figure = checked.plot(tmp_path / "verified.png")
    drawn = [line for line in figure.axes[0].lines if line.get_gid() == "agrees"]
    assert sum(len(line.get_xdata()) for line in drawn) == sum(point.agrees for point in checked.points)


def test_interrupted(duffing_curve):
    def stop(share, _):
        if share > 0.0:
            raise KeyboardInterrupt

    check = so.verify(duffing_curve, progress=stop)
    assert not check.complete
    assert 0 < len(check.points) < len(duffing_curve)
    assert "interrupted" in check.summary


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"points": 0}, "positive number of points"),
        ({"points": [10**6]}, "indices of a branch"),
        ({"points": "all"}, "points must be a whole number or a list of whole numbers, not 'all'"),
        ({"every": 0}, "every must be"),
        ({"points": 3, "every": 2}, "not both"),
        ({"tolerance": 2.0}, "between 0 and 1"),
    ],
)
def test_wrong_input(duffing_curve, arguments, words):
    with pytest.raises(InputError, match=words):
        so.verify(duffing_curve, **arguments)


def test_a_single_motion_has_no_points(duffing_curve):
    with pytest.raises(InputError, match="single motion"):
        so.verify(duffing_curve.orbits[0], points=3)


@pytest.mark.slow
@pytest.mark.parametrize("p", [0.55, 1.7])
def test_the_published_responses(p):
    branch = so.frequency_response(so.library.reference_oscillator(regularization=3000.0, p=p, j=0.0), (4.5, 1.3))
    check = so.verify(branch)
    assert check.agrees, check
    assert all(abs(point.margin) < 1e-3 for point in check.undecided)
    assert all(found.agrees for found in check.bifurcations)
    assert len(check.bifurcations) >= 4


@pytest.mark.slow
def test_the_published_isola():
    isolas = so.find_isolas(so.library.reference_oscillator(regularization=3000.0), (1.3, 4.5), "j", (0.0, 1.0))
    check = so.verify(isolas[0].at(0.5))
    assert check.agrees, check
    assert all(abs(point.margin) < 1e-3 for point in check.undecided)
    assert [b.kind for b in check.bifurcations].count("LP") == 2
