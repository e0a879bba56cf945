"""The option `formulation`: what reaches the solver, what published test functions miss, and that it is said."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.curves.ledgers import CountCheck
from suboctave.errors import InputError
from suboctave.study.steps.base import as_formulation

#: period doublings of one rattling oscillator with 7 harmonics
UPPER, LOWER = 3.9697276189, 2.2937474090
#: and of two, the time of one running faster by this factor
FASTER = 1.2
PLACES = [FASTER * UPPER, UPPER, FASTER * LOWER, LOWER]


def two_oscillators(faster):
    """Two that know nothing of each other, one in faster time: while one is unstable beyond -1 the other passes -1."""

    def elements(dof, k):
        return [
            so.CubicSpring(dof, 0.16 * k),
            so.ElasticStop(dof, stiffness=4.7 * k, gap=0.0),
            so.ElasticStop(dof, stiffness=4.7 * k, gap=-1.0),
        ]

    k = faster**2
    return so.System(
        np.eye(2),
        np.diag([0.06, 0.06 * faster]),
        np.diag([1.0, k]),
        elements(0, 1.0) + elements(1, k),
        [so.HarmonicLoad(0, 0.55), so.HarmonicLoad(1, 0.55 * k)],
    )


@pytest.fixture(scope="module")
def two():
    return two_oscillators(FASTER)


def places(curve):
    return [b.omega for b in curve.bifurcations["PD"]]


def test_a_test_of_the_leading_multiplier_misses_what_another_hides(two):
    """The paper's second test sees two of four; the audit says which it missed, and nothing else is in doubt."""
    whole = so.frequency_response(two, (4.9, 2.2), harmonics=7, formulation="extended")
    assert places(whole) == pytest.approx(PLACES, abs=1e-9)
    assert whole.audit.complete
    curve = so.frequency_response(two, (4.9, 2.2), harmonics=7, formulation=so.Alcorta2019(test="multiplier"))
    assert places(curve) == pytest.approx([PLACES[0], PLACES[3]], abs=5e-5)
    assert len(curve.audit.unsettled) == 2
    for stretch, place in zip(curve.audit.unsettled, PLACES[1:3], strict=True):
        assert stretch.last < place < stretch.first
        assert "'multiplier'" in stretch.reason
    assert len(curve.warnings) == 1
    # what the branch knows of stability is not touched by what its tests miss
    assert curve.stable.tolist() == whole.stable.tolist()


def test_what_is_missed_beside_what_is_found():
    """Period doublings in neighbouring steps: each passage of -1 is matched with its own."""
    faster = 1.008
    curve = so.frequency_response(
        two_oscillators(faster), (4.1, 2.25), harmonics=7, formulation="alcorta2019", max_step=0.02
    )
    assert places(curve) == pytest.approx([faster * UPPER, LOWER], abs=5e-5)
    assert len(curve.audit.unsettled) == 2
    for stretch, place in zip(curve.audit.unsettled, [UPPER, faster * LOWER], strict=True):
        assert stretch.last < place < stretch.first


def test_the_determinant_has_a_minimum_at_every_period_doubling_of_close_points(two):
    curve = so.frequency_response(
        two, (4.9, 2.2), harmonics=7, formulation=so.Alcorta2019("determinant"), max_step=0.03
    )
    assert places(curve) == pytest.approx(PLACES, abs=5e-5)
    assert not curve.warnings


def test_the_determinant_needs_close_points():
    """det B carries a power of omega that grows with the harmonics: with steps of 0.1 the minimum is passed."""
    system = so.library.reference_oscillator(p=0.55)
    far = so.frequency_response(
        system, (4.5, 3.5), harmonics=31, formulation=so.Alcorta2019("determinant"), max_step=0.3
    )
    assert places(far) == []
    (missed,) = far.audit.unsettled
    assert missed.last < 3.9697105 < missed.first
    near = so.frequency_response(
        system, (4.1, 3.9), harmonics=31, formulation=so.Alcorta2019("determinant"), max_step=0.003
    )
    assert places(near) == pytest.approx([3.9697105], abs=1e-6)
    assert near.audit.complete


@pytest.mark.parametrize("way", [(4.1, 3.9), (3.9, 4.1)])
def test_either_direction_and_two_residuals(way):
    """Both directions, the bifurcation in the order met, its residual that of the system and its orbit's that of R."""
    system = so.library.reference_oscillator(p=0.55)
    curve = so.frequency_response(system, way, harmonics=15, formulation="alcorta2019")
    (found,) = curve.bifurcations
    assert found.omega == pytest.approx(3.9697105, abs=1e-6)
    assert found.orbit.residual < 1e-12 < found.residual < 1e-6
    before = curve.points[np.searchsorted(curve.arclength, found.arclength) - 1]
    assert (before.orbit.omega - found.omega) * (way[1] - way[0]) < 0.0


def test_every_verb_and_every_start():
    system = so.library.reference_oscillator(p=0.4)
    for formulation in ("bordered", "extended", "alcorta2019"):
        along = so.continue_branch(system, "p", (0.4, 1.7), omega=2.33, harmonics=15, formulation=formulation)
        assert [b.kind for b in along.bifurcations] == ["PD"]
        assert along.options["formulation"] == formulation
        assert along.bifurcations[0].context["formulation"] == formulation
        place = along.bifurcations[0].parameters["p"]
        again = so.continue_branch(along.points[-1], "p", (0.4, 1.7), formulation=formulation)
        assert again.bifurcations[0].parameters["p"] == pytest.approx(place, abs=1e-9)
        omega = so.continue_branch(system, "omega", (2.4, 2.3), harmonics=15, formulation=formulation)
        assert omega.options["formulation"] == formulation


def test_options_last(tmp_path):
    system = so.library.reference_oscillator(p=0.55)
    curve = so.frequency_response(system, (4.1, 3.9), harmonics=7, formulation=so.Alcorta2019("determinant"))
    curve.save(tmp_path / "curve.nc")
    assert so.load(tmp_path / "curve.nc").options == curve.options
    assert curve.options["formulation"] == "Alcorta2019(test='determinant')"
    assert so.frequency_response(system, (4.1, 4.0), harmonics=7).options["formulation"] == "bordered"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("extendet", "did you mean 'extended'"),
        ("alcorta", "did you mean 'alcorta2019'"),
        (so.Alcorta2019, "give an object"),
        (3, "must be a Formulation or a text"),
    ],
)
def test_wrong_formulations_are_refused(given, words):
    with pytest.raises(InputError, match=words):
        so.frequency_response(so.library.duffing(), (0.5, 1.5), formulation=given)


def test_wrong_test_functions_are_refused():
    with pytest.raises(InputError, match="did you mean 'determinant'"):
        so.Alcorta2019(test="determinantt")
    with pytest.raises(InputError, match="has no option 'tests'"):
        as_formulation({"name": "alcorta2019", "tests": "determinant"})
    assert as_formulation({"name": "alcorta2019", "test": "determinant"}) == so.Alcorta2019("determinant")


def test_the_count_takes_what_is_accounted_for_elsewhere(two):
    """A period doubling that a test function misses is said once, not again by the count."""
    curve = so.frequency_response(two, (4.1, 3.9), harmonics=7)
    ends = [_Sample(curve.points[0].floquet), _Sample(curve.points[-1].floquet)]
    assert ends[0].floquet.unstable != ends[1].floquet.unstable
    for unseen in (False, True):
        check = CountCheck()
        assert check.complaint(ends[0], []) is None
        assert (check.complaint(ends[1], ["PD"] * unseen) is None) is unseen


def test_the_count_says_in_words_that_it_should_have_changed(two):
    """One located period doubling between motions with as many unstable multipliers."""
    curve = so.frequency_response(two, (4.1, 3.9), harmonics=7)
    check, sample = CountCheck(), _Sample(curve.points[0].floquet)
    assert check.complaint(sample, []) is None
    assert check.complaint(sample, ["PD"])[2].startswith(
        f"as many multipliers are unstable behind as before ({sample.unstable}), although each of the bifurcations "
        "located there (PD) changes their number"
    )


class _Sample:
    def __init__(self, floquet):
        self.floquet = floquet
        self.unstable = self.outside = floquet.unstable
