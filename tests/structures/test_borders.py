"""The border of the period doublings of a plate with a stop: what is looked for along it on a structure."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse

import suboctave as so

#: where the gap lies at which the doublings become subcritical, with 127 harmonics all along
TURNS_SUBCRITICAL = 0.0938338


def plate(gap):
    return so.structures.clearance_plate(nx=20, ny=12, stops=1, Kc=1.0, gap=gap, p=0.2)


@pytest.mark.slow
def test_a_change_of_harmonics_leaves_nothing_in_doubt():
    response = so.frequency_response(plate(0.1), (2.8, 2.0))
    border = so.track(response.bifurcations["PD"][0], "gap", (0.09, 0.2))
    orders = [point.orbit.basis.harmonics for point in border.points]
    assert len(set(orders)) > 3
    first, second = border.bifurcations["GPD"]
    assert second.parameter("gap") == pytest.approx(TURNS_SUBCRITICAL, abs=1e-6)
    assert [e.extreme for e in border.extrema] == ["maximum", "minimum"]
    # beside the second one the stop's contact splits in two, in an inflection on the gap itself: that is noted
    assert first.parameter("gap") > 0.1
    assert not any("may lie" in note for note in border.warnings if "0.093" not in note)


def test_where_a_pair_of_extrema_is_born_on_the_gap_a_curve_does_not_come_back_along_itself():
    response = so.frequency_response(plate(0.0939), (2.12, 2.04), harmonics=63)
    doubling = min(response.bifurcations["PD"], key=lambda event: abs(event.omega - 2.0759))
    border = so.track(doubling, "gap", (0.09385, 0.0939), harmonics=63, max_step=1e-3)
    assert not border.extrema
    assert any("the equations are not smooth there" in note for note in border.warnings)


def test_a_border_over_a_mass_at_a_point_is_that_of_other_structures():
    """A limit point followed over what a basis has to grow for, against responses of structures with that mass."""
    n = 120
    parts = [-np.ones(n - 1), np.append(np.full(n - 1, 2.0), 1.0), -np.ones(n - 1)]
    stiffness = 8.0 * n / np.pi**2 * scipy.sparse.diags_array(parts, offsets=[-1, 0, 1]).tocsr()
    mass = 2.0 / n * scipy.sparse.eye_array(n).tocsr()
    more = scipy.sparse.csr_array(([1.0], ([n // 2], [n // 2])), (n, n))

    def limit_points(m):
        system = so.System(
            {1.0: mass, "m": more}, 0.02 * mass + 0.002 * stiffness, stiffness,
            [so.ElasticStop(n - 1, 1.0, 0.5)], [so.HarmonicLoad(n - 1, 0.05)], {"m": m},
        )  # fmt: skip
        return so.frequency_response(system, (1.2, 1.0), harmonics=15).bifurcations["LP"]

    curve = so.track(limit_points(0.02)[0], "m", (0.02, 0.08))
    assert curve.orbits[0].balance.linear.size == 1
    end = int(np.argmax(curve.parameter("m")))
    assert curve.parameter("m")[end] == pytest.approx(0.08)
    others = [item.omega for item in limit_points(0.08)]
    assert min(abs(omega / curve.omega[end] - 1.0) for omega in others) < 1e-8
