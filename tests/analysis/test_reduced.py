"""Models that are reduced before they become systems, as the message on too many unknowns says."""

import numpy as np
import pytest
import scipy.linalg

import suboctave as so
from suboctave.harmonic import StructuralMatrices

N = 4
MASS = np.diag([1.0, 2.0, 1.0, 1.5])
STIFFNESS = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
DAMPING = 0.05 * STIFFNESS


def test_a_model_in_all_its_modes_is_the_same_model():
    """A change of coordinates changes nothing: the same limit points, and the displacement of the DOF that is meant."""
    modes = scipy.linalg.eigh(STIFFNESS, MASS)[1]
    whole = so.System(MASS, DAMPING, STIFFNESS, [so.CubicSpring(dof=N - 1, coefficient=0.1)], [so.HarmonicLoad(0, 0.2)])
    in_modes = so.System(
        *(modes.T @ matrix @ modes for matrix in (MASS, DAMPING, STIFFNESS)),
        [so.CubicSpring(direction=modes[N - 1], coefficient=0.1)],
        [so.HarmonicLoad(direction=modes[0], amplitude=0.2)],
    )
    one, other = (so.frequency_response(system, (0.7, 0.4), harmonics=3) for system in (whole, in_modes))
    folds = [b.omega for b in one.bifurcations["LP"]]
    assert len(folds) == 2
    assert [b.omega for b in other.bifurcations["LP"]] == pytest.approx(folds, rel=1e-9)
    first, second = (branch.bifurcations["LP"][0].orbit for branch in (one, other))
    t = np.linspace(0.0, first.period, 50)
    np.testing.assert_allclose(modes @ second.displacement(t), first.displacement(t), atol=1e-7)


def test_too_many_unknowns_are_refused_with_what_can_be_done():
    many = 300
    stiffness = 2.0 * np.eye(many) - np.eye(many, k=1) - np.eye(many, k=-1)
    system = so.System(np.eye(many), 0.01 * stiffness, stiffness, [], [so.HarmonicLoad(0, 1.0)])
    with pytest.raises(so.InputError, match=r"Keep fewer harmonics, or reduce the model .* direction=P\[dof\]"):
        so.frequency_response(system, (0.5, 0.6), harmonics=15, linear=StructuralMatrices(system))
