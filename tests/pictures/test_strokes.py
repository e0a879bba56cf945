"""A stroke changes where the bifurcation was located, not at the nearest computed point."""

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator

import suboctave as so
from suboctave.errors import InputError
from suboctave.pictures.strokes import OPEN, bent, cut, line, smooth, without_repeats
from suboctave.store.layout import UNKNOWN, EventRow, curve_dataset

X = np.arange(5.0)


def strokes(dataset, x):
    return cut(dataset, line(dataset, x))


def curve(stable, events, **more):
    return curve_dataset(X, X**2, stable=stable, events=events, **more)


def described(dataset, x="omega"):
    return [(list(stroke.x), stroke.stable) for stroke in strokes(dataset, x)]


def test_dashes_begin_at_the_event():
    rows = [EventRow("LP", 1, 1.25, 1.6), EventRow("LP", 3, 3.5, 12.0)]
    assert described(curve([1, 1, 0, 0, 1], rows)) == [
        ([0.0, 1.0, 1.25], True),
        ([1.25, 2.0, 3.0, 3.5], False),
        ([3.5, 4.0], True),
    ]


def test_every_stroke_begins_where_the_last_one_ended(duffing):
    dataset = duffing()
    assert dataset.sizes["event"] == 2
    pieces = strokes(dataset, "omega")
    assert [piece.stable for piece in pieces] == [True, False, True]
    for before, after, event in zip(pieces[:-1], pieces[1:], range(2), strict=True):
        here = (float(dataset["event_omega"][event]), float(dataset["event_amplitude"][event]))
        assert (before.x[-1], before.y[-1]) == (after.x[0], after.y[0]) == here
    assert sum(piece.x.size for piece in pieces) == dataset.sizes["point"] + 2 + 2  # cuts belong to both sides


def test_the_order_in_which_events_are_listed_does_not_matter():
    rows = [EventRow("PD", 3, 3.5, 12.0), EventRow("PD", 1, 1.5, 2.0)]
    assert described(curve([1, 1, 0, 0, 1], rows)) == described(curve([1, 1, 0, 0, 1], rows[::-1]))


def test_two_events_in_one_step():
    def rows(told):
        return [EventRow("PD", 1, 1.2, 1.4, stable_after=told), EventRow("PD", 1, 1.7, 2.9)]

    between = [([0.0, 1.0, 1.2], True), ([1.2, 1.7], False), ([1.7, 2.0, 3.0, 4.0], True)]
    assert described(curve([1] * 5, rows(UNKNOWN))) == between  # not told: a picture promises nothing
    assert described(curve([1] * 5, rows(False))) == between
    assert described(curve([0] * 5, rows(True))) == [
        ([0.0, 1.0, 1.2], False),
        ([1.2, 1.7], True),
        ([1.7, 2.0, 3.0, 4.0], False),
    ]


def test_a_change_without_located_event_is_drawn_unstable():
    assert described(curve([1, 1, 0, 0, 0], [])) == [([0.0, 1.0], True), ([1.0, 2.0, 3.0, 4.0], False)]


def test_an_event_that_changes_nothing_cuts_nothing():
    pieces = strokes(curve([0] * 5, [EventRow("BP", 2, 2.5, 6.0)]), "omega")
    assert len(pieces) == 1
    assert list(pieces[0].x) == [0.0, 1.0, 2.0, 2.5, 3.0, 4.0]


def test_a_named_parameter_on_the_axis():
    rows = [EventRow("LP", 1, 2.0, 1.5, parameters={"p": 0.15})]
    dataset = curve_dataset(
        np.full(5, 2.0), X, stable=[1, 1, 0, 0, 0], parameters={"p": X / 10, "j": 0.5}, free="p", events=rows
    )
    assert described(dataset, "p") == [([0.0, 0.1, 0.15], True), ([0.15, 0.2, 0.3, 0.4], False)]
    assert list(dataset["p"].to_numpy()) == list(X / 10)
    assert float(dataset["event_parameters"].sel(parameter="j")[0]) == 0.5
    with pytest.raises(InputError, match="did you mean"):
        strokes(dataset, "omga")


def test_a_curve_that_comes_back_on_itself_is_dashed_once():
    """There and back over the same line, with other points: unstable, stable at the far end, unstable."""
    there, back = np.linspace(0.0, 1.0, 21), np.linspace(1.0, 0.0, 34)
    x = np.concatenate([there, back])
    y = np.sin(3.0 * x)
    data = curve_dataset(x, y, stable=x > 0.7)
    spread = (1.0, 1.0)
    kept = without_repeats(strokes(data, "omega"), [], spread)
    assert [stroke.stable for stroke in kept[:2]] == [False, True]
    # what is left of the way back is where its points lie further than those of the way there
    assert sum(np.ptp(stroke.x) for stroke in kept[2:]) < 0.1
    unstable = curve_dataset(x, y, stable=x > 2.0)
    (stroke,) = without_repeats(strokes(unstable, "omega"), [], spread)
    assert stroke.x[0] == 0.0
    assert stroke.x.max() == 1.0
    assert stroke.x[-1] > 0.9  # the way back is left out, but for the turn
    # a line beside it, two hundredths of the frame away, is another one
    beside = curve_dataset(x, np.concatenate([np.sin(3.0 * there), np.sin(3.0 * back) + 0.02]), stable=x > 0.7)
    kept = without_repeats(strokes(beside, "omega"), [], spread)
    assert [stroke.stable for stroke in kept] == [False, True, False]


def test_without_stability_there_is_one_stroke():
    (stroke,) = strokes(curve(None, []), "omega")
    assert stroke.stable is None


def test_a_single_point():
    dataset = curve_dataset([1.0], [2.0], stable=[True])
    assert described(dataset) == [([1.0], True)]


def test_a_parameter_may_have_any_name():
    dataset = curve_dataset(X, X, parameters={"amplitude": X, "error": 3.0}, free="amplitude")
    assert list(dataset["amplitude"].to_numpy()) == list(X)
    assert described(dataset, "error") == [([3.0] * 5, None)]


@pytest.mark.parametrize("count", [13, 25])
def test_a_line_is_drawn_through_its_vertices_and_smooth(count):
    """A circle in a frame that is not square; the angle between two pieces shrinks with their length."""
    angle = np.linspace(0.0, 1.9 * np.pi, count)
    x, y = 30.0 * np.cos(angle), 0.2 * np.sin(angle)
    drawn = bent(x, y, (30.0, 0.2))
    for vertex in zip(x, y, strict=True):
        assert np.min(np.hypot((drawn[0] - vertex[0]) / 30.0, (drawn[1] - vertex[1]) / 0.2)) < 1e-15
    assert (drawn[0][0], drawn[1][0], drawn[0][-1], drawn[1][-1]) == (x[0], y[0], x[-1], y[-1])
    off = np.abs(np.hypot(drawn[0] / 30.0, drawn[1] / 0.2) - 1.0)
    assert off.max() < 0.3 * (1.0 - np.cos(0.5 * angle[1]))
    heading = np.unwrap(np.arctan2(np.diff(drawn[1] / 0.2), np.diff(drawn[0] / 30.0)))
    assert np.abs(np.diff(heading)).max() < 0.1 < angle[1]


@pytest.mark.parametrize("count", [3, 4, 30])
def test_the_line_is_that_of_modified_akima_interpolation(count):
    """With vertices at random distances, the last third of them on a straight line."""
    random = np.random.default_rng(count)
    along, values = np.cumsum(random.random(count) + 0.1), random.normal(size=(count, 2))
    values[2 * count // 3 :, 1] = along[2 * count // 3 :]
    at = np.linspace(along[0], along[-1], 300)
    expected = Akima1DInterpolator(along, values, method="makima")(at)
    assert smooth(along, values, at) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_corners_stay():
    """Straight on both sides, whatever lies close to the corner, and none beside it."""
    x = np.array([0.0, 0.3, 0.6, 0.6 + 1e-9, 0.6, 0.6, 0.6])
    y = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.35, 0.9])
    drawn = bent(x, y, (1.0, 1.0))
    below = drawn[0] < 0.6 - 1e-12
    assert drawn[1][below] == pytest.approx(0.0, abs=1e-15)
    assert drawn[0][~below] == pytest.approx(0.6, abs=1e-8)
    assert np.all(np.diff(drawn[0]) >= -1e-8)
    assert np.all(np.diff(drawn[1]) >= 0.0)


def test_few_vertices_and_unknown_values_are_drawn_as_they_are():
    for values in ([1.0], [1.0, 2.0], [1.0, np.nan, 2.0, 4.0]):
        x = np.array(values)
        one, other = bent(x, 2.0 * x, (1.0, 1.0))
        np.testing.assert_array_equal(one, x)
        np.testing.assert_array_equal(other, 2.0 * x)
    # an event upon the last point, as upon the first
    twice = np.array([0.0, 0.0, 0.2, 0.5, 1.0, 1.0])
    one, other = bent(twice, twice**2, (1.0, 1.0))
    assert (one[0], other[0], one[-1], other[-1]) == (0.0, 0.0, 1.0, 1.0)
    assert np.isfinite(one).all()
    same = np.full(5, 0.5)
    one, other = bent(same, same, (1.0, 1.0))
    assert one == pytest.approx(0.5)
    assert other == pytest.approx(0.5)


def test_a_stretch_whose_multipliers_are_not_known_is_dotted():
    """Neither solid nor dashed: an error as large as the multiplier is no verdict."""
    curve = so.frequency_response(so.library.duffing(c=0.1, k=1.0, alpha=1.0, F=0.1), (0.5, 0.8), harmonics=5)
    dataset = curve.to_xarray()
    errors = dataset["multiplier_errors"].to_numpy().copy()
    errors[3:6] = 2.0
    dataset["multiplier_errors"] = (dataset["multiplier_errors"].dims, errors)
    strokes = cut(dataset, line(dataset, "omega"))
    assert [stroke.stable for stroke in strokes] == [True, OPEN, True]
    assert strokes[1].point[[0, -1]].tolist() == [2, 6]
