"""Motions of all points of a curve in its dataset: what a report page draws them from."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.harmonic.basis import to_complex
from suboctave.store.layout import events_met


@pytest.fixture(name="curve", scope="module")
def _curve():
    """Two masses, the load and the observed one without a stop, a stop between both and one at the second."""
    system = so.System(
        np.eye(2),
        0.1 * np.eye(2),
        [[2.0, -1.0], [-1.0, 2.0]],
        elements=[so.ElasticStop(dof=1, stiffness=2.0, gap="j")],
        loads=[so.HarmonicLoad(dof=0, amplitude=0.5)],
        parameters={"j": 0.3},
    )
    return so.frequency_response(system, omega=(1.5, 0.7), harmonics=7)


def test_motions_are_those_of_the_orbits(curve):
    data = curve.to_xarray(motions=True)
    assert data["motion"].dims[:2] == ("point", "signal")
    for prefix, orbits in (("", curve.orbits), ("event_", [event.orbit for event in events_met(curve)])):
        table = data[f"{prefix}motion"].to_numpy()
        assert len(table) == len(orbits)
        for row, orbit in zip(table, orbits, strict=True):
            size = orbit.basis.size
            c = to_complex(row[:, :size].T)
            np.testing.assert_allclose(c[:, 0], orbit.amplitudes[:, curve.observe], atol=1e-14)
            np.testing.assert_allclose(c[:, 1], orbit.amplitudes[:, 1], atol=1e-14)  # what the stop reads
            assert not row[:, size:].any()
    assert data["event_harmonics"].to_numpy().tolist() == [e.orbit.basis.harmonics for e in events_met(curve)]


def test_gaps_say_where_contact_begins(curve):
    data = curve.to_xarray(motions=True)
    assert data["gap_signal"].to_numpy().tolist() == [1]
    assert data["gap_side"].to_numpy().tolist() == [1]
    np.testing.assert_array_equal(data["gap_level"].to_numpy(), 0.3)
    assert "ElasticStop" in str(data["gap_label"].to_numpy()[0])
    # contact by the motion and the gap is what the branch reads off
    point = int(np.argmax(curve.contact_share(0)))
    tau = np.linspace(0.0, 2.0 * np.pi, 20001)[:-1]
    c = to_complex(data["motion"].to_numpy()[point, 1])
    x = np.real(np.exp(1j * np.outer(tau, np.arange(len(c)))) @ c)
    assert np.mean(x > 0.3) == pytest.approx(curve.contact_share(0)[point], abs=2e-4)


def test_without_being_asked_nothing_is_added(curve):
    assert "motion" not in curve.to_xarray()
