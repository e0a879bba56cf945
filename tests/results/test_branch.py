"""What a branch offers: arrays of full length, tables, datasets, text."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.continuation.notes import Note, lines


def test_arrays(rattling_curve):
    n = len(rattling_curve)
    assert rattling_curve.omega.shape == rattling_curve.amplitude.shape == rattling_curve.stable.shape == (n,)
    assert rattling_curve.multipliers.shape == (n, 2)
    assert rattling_curve.harmonic(3).shape == (n,)
    assert rattling_curve.parameter("omega") is rattling_curve.omega
    assert np.all(rattling_curve.parameter("Kc") == 4.7)
    assert rattling_curve.parameter("Kc").shape == (n,)
    assert np.all(np.diff(rattling_curve.arclength) > 0.0)
    assert np.all(rattling_curve.truncation < 2e-5)
    assert np.abs(rattling_curve.harmonic(1000)).max() == 0.0


def test_amplitude_is_the_largest_displacement(rattling_curve):
    for orbit in rattling_curve.orbits[::40]:
        t = np.linspace(0.0, orbit.period, 20001)
        assert orbit.amplitude() == pytest.approx(np.abs(orbit.displacement(t)).max(), rel=1e-7)


def test_orbit_is_a_motion(rattling_curve):
    """Velocity and acceleration are the derivatives of the displacement."""
    orbit = rattling_curve.orbits[20]
    h = 1e-5
    for t in (0.3, 1.1):
        rate = (orbit.displacement(t + h) - orbit.displacement(t - h)) / (2 * h)
        assert orbit.velocity(t) == pytest.approx(rate, abs=1e-8)
        rate = (orbit.velocity(t + h) - orbit.velocity(t - h)) / (2 * h)
        assert orbit.acceleration(t) == pytest.approx(rate, abs=1e-7)


def test_bifurcations_by_kind_and_position(rattling_curve):
    found = rattling_curve.bifurcations
    assert len(found) == 4
    assert [b.kind for b in found] == ["PD", "PD", "LP", "LP"]
    assert found["PD"] == [found[0], found[1]]
    assert found["NS"] == []
    with pytest.raises(so.InputError, match="did you mean 'PD'"):
        found["PDD"]
    places = [b.arclength for b in found]
    assert places == sorted(places)
    assert found[0] != found[1]
    assert found[0].parameters["Kc"] == 4.7
    assert found[0].parameter("omega") == found[0].omega


def test_bifurcations_lie_on_the_curve(rattling_curve):
    """Between the neighbours in arclength, not farther from them than they are from each other."""
    for b in rattling_curve.bifurcations:
        at = np.searchsorted(rattling_curve.arclength, b.arclength)
        before, after = rattling_curve.orbits[at - 1], rattling_curve.orbits[at]
        reach = 1.5 * abs(after.amplitude() - before.amplitude()) + 1e-3
        assert abs(b.amplitude - before.amplitude()) < reach


def test_dataframe(rattling_curve):
    table = rattling_curve.to_dataframe()
    assert len(table) == len(rattling_curve)
    assert table["omega"].to_numpy() == pytest.approx(rattling_curve.omega)
    assert table["amplitude"].to_numpy() == pytest.approx(rattling_curve.amplitude)
    assert table["stable"].to_numpy().tolist() == rattling_curve.stable.tolist()
    assert (table["residual"] < 1e-10).all()


def test_dataframe_along_a_parameter():
    sweep = so.continue_branch(so.library.duffing(c=0.1, F=0.3), "F", (0.1, 0.2), omega=2.0)
    table = sweep.to_dataframe()
    assert table["F"].iloc[[0, -1]].tolist() == [0.1, 0.2]
    assert (table["omega"] == 2.0).all()


def test_dataset(rattling_curve):
    data = rattling_curve.to_xarray()
    assert data.sizes["point"] == len(rattling_curve)
    touching = data["event_kind"].to_numpy() == "grazing"
    assert data.sizes["event"] == 4 + np.count_nonzero(touching) == 5
    assert data["amplitude"].to_numpy() == pytest.approx(rattling_curve.amplitude)
    expected = pytest.approx([b.omega for b in rattling_curve.bifurcations])
    assert data["event_omega"].to_numpy()[~touching] == expected


def test_text(rattling_curve):
    text = repr(rattling_curve)
    assert text.startswith(f"Branch: {len(rattling_curve)} points (")
    assert "omega from 4.5 to 1.3; reached the end of the range at omega = 1.3." in text
    assert text.count("\nPD") == 2
    assert text.count("\nLP") == 2
    assert "no bifurcations" in repr(so.frequency_response(so.library.duffing(F=0.1), (3.0, 2.9)))
    assert repr(rattling_curve.bifurcations[0]).startswith("<PD at omega=3.9697105")


def test_observed_dof():
    """The loaded DOF unless told; amplitudes of the others by `observe`."""
    system = so.library.nltva(0.05)
    first, second = (so.frequency_response(system, (0.9, 1.0), observe=dof) for dof in (None, 1))
    assert first.observe == 0
    assert first.amplitude == pytest.approx([o.amplitude(0) for o in first.orbits])
    assert second.amplitude == pytest.approx([o.amplitude(1) for o in first.orbits])
    assert second.harmonic(1) == pytest.approx(first.harmonic(1, dof=1))


def test_unknown_parameter(rattling_curve):
    with pytest.raises(so.InputError, match="did you mean 'alpha'"):
        rattling_curve.parameter("alhpa")


def test_provenance(rattling_curve):
    assert rattling_curve.options["bounds"] == {"omega": (4.5, 1.3)}
    assert rattling_curve.options["harmonics"] == "adaptive"
    context = rattling_curve.bifurcations[0].context
    assert context["system"] is rattling_curve.system
    assert context["parameter"] == "omega"
    assert context["bounds"] == {"omega": (4.5, 1.3)}


def test_motions_without_damping_are_not_counted_as_unstable():
    branch = so.frequency_response(so.library.duffing(c=0.0, F=0.2), (0.6, 0.9))
    assert branch.verdicts == f"0 unstable, {len(branch)} not settled"
    assert f"{len(branch)} points ({branch.verdicts})" in repr(branch)
    damped = so.frequency_response(so.library.duffing(c=0.05, F=0.2), (0.6, 2.0))
    assert damped.verdicts == f"{int((~damped.stable).sum())} unstable"


def test_far_too_few_harmonics_are_said_once():
    system = so.library.duffing(c=0.05, F=0.3)
    few, enough, adaptive = (so.frequency_response(system, (0.5, 0.8), harmonics=h) for h in (1, 5, "adaptive"))
    worst = few.truncation.argmax()
    assert few.truncation[worst] > 0.01
    (note,) = (text for text in few.warnings if "too small" in text)
    lacking = few.omega[few.truncation > 0.01]
    assert note == (
        f"between omega = {lacking.min():.6g} and {lacking.max():.6g}: harmonics=1 is too small, it leaves out up to "
        f'{few.truncation[worst]:.0%} of the motion. Use harmonics="adaptive" or 3'
    )
    for curve in (enough, adaptive):
        assert not [text for text in curve.warnings if "too small" in text]


def test_notes_of_one_cause_are_one_line():
    """Few places are listed, of more their number and range are given; what is of one place alone is left out then."""
    folds = [Note(f"in doubt (by {i} %). Use more", "omega", 1.0 + i, 1.0 + i, "LP") for i in range(5)]
    assert lines(folds[:1]) == ["LP at omega = 1: in doubt (by 0 %). Use more"]
    assert lines(folds[:2]) == ["LP at omega = 1, LP at omega = 2: in doubt. Use more"]
    other = Note("constant", "omega", 2.0, 2.0 + 1e-7)
    assert lines([*folds, other, other]) == [
        "5 LP between omega = 1 and 5: in doubt. Use more",
        "between omega = 2 and 2.0000001: constant",
    ]
    lost = [Note("lost", "j", j, j, "LP", f"omega = 1, j = {j:g}", f"diverged at {j:g}") for j in (0.1, 0.2, 0.3, 0.4)]
    assert lines(lost[:1]) == ["LP at omega = 1, j = 0.1: lost: diverged at 0.1"]
    assert lines(lost) == ["4 LP between j = 0.1 and 0.4: lost, the first: diverged at 0.1"]
