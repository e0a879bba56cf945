"""A tracked curve is read, kept and drawn like a branch; wrong input is refused before any work."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so


@pytest.fixture(scope="module")
def limit_point():
    return so.frequency_response(so.library.duffing(c=0.05, F=0.1), (0.7, 2.0), harmonics=3).bifurcations["LP"][0]


@pytest.fixture(scope="module")
def curve(limit_point):
    return so.track(limit_point, "F", (0.01, 0.2))


def test_saved_and_loaded(curve, tmp_path):
    other = so.load(curve.save(tmp_path / "limits.nc"))
    assert (other.kind, other.names, other.closed, other.ended) == ("LP", ("omega", "F"), False, curve.ended)
    for reading in ("omega", "amplitude", "multipliers", "coefficient", "stable", "kappa"):
        assert np.array_equal(getattr(other, reading), getattr(curve, reading)), reading
    assert repr(other) == repr(curve)
    (cusp,) = other.bifurcations["CP"]
    assert (cusp.curve, cusp.names, cusp.parameter_name) == ("LP", ("omega", "F"), "F")
    assert other.to_dataframe().equals(curve.to_dataframe())


def test_a_loaded_bifurcation_is_followed_like_the_live_one(limit_point, curve, tmp_path):
    branch = so.frequency_response(so.library.duffing(c=0.05, F=0.1), (0.7, 2.0), harmonics=3)
    loaded = so.load(branch.save(tmp_path / "branch.nc"))
    again = so.track(loaded.bifurcations["LP"][0], "F", (0.01, 0.2))
    assert np.array_equal(again.omega, curve.omega)


def test_drawn_over_the_plane_of_its_parameters(curve, tmp_path):
    figure = so.plot(curve, tmp_path / "limits.png", title="limit points")
    (axes,) = figure.axes
    assert axes.get_ylabel() == "F"
    drawn = [line for line in axes.get_lines() if line.get_gid() in ("border", "within")]
    y = np.concatenate([line.get_ydata() for line in drawn])
    assert (y.min(), y.max()) == pytest.approx((curve.parameter("F").min(), 0.2), rel=1e-2)
    markers = [line for line in axes.get_lines() if line.get_gid() == "CP"]
    assert len(markers) == 1
    turned = so.plot([curve, curve], x="F")
    assert "omega" in turned.axes[0].get_ylabel()


def test_a_start_on_a_bound_and_ranges_of_both_parameters(limit_point, curve):
    inside = so.track(limit_point, "F", (0.1, 0.2))
    assert (inside.parameter("F")[0], inside.parameter("F")[-1]) == pytest.approx((0.1, 0.2))
    assert inside.omega[0] == pytest.approx(limit_point.omega, rel=1e-12)
    box = so.track(limit_point, "F", (0.0, 0.2), omega=(1.3, 1.6))
    assert sorted(box.omega[[0, -1]]) == pytest.approx([1.3, 1.6], rel=1e-14)
    for i in (0, -1):
        near = np.argsort(np.abs(curve.omega - box.omega[i]))[:2]
        assert curve.parameter("F")[near].min() <= box.parameter("F")[i] <= curve.parameter("F")[near].max()
    assert "reached the end of the range at omega = 1.3" in box.ended


def test_the_other_order_of_bounds_is_the_curve_backwards(limit_point, curve):
    back = so.track(limit_point, "F", (0.2, 0.01))
    assert [e.kind for e in back.bifurcations] == [e.kind for e in curve.bifurcations][::-1]
    assert (back.omega[0], back.omega[-1]) == pytest.approx((curve.omega[-1], curve.omega[0]), rel=1e-9)


def test_response_curves_through_its_points_have_the_bifurcation_there(curve):
    point = curve.points[len(curve) // 3]
    omega = point.orbit.omega
    branch = so.continue_branch(point, "omega", (0.9 * omega, 1.1 * omega))
    nearest = min(branch.bifurcations["LP"], key=lambda b: abs(b.omega - omega))
    assert nearest.omega == pytest.approx(omega, rel=1e-8)
    again = so.track(nearest, "F", (0.01, 0.2))
    assert again.bifurcations["CP"][0].omega == pytest.approx(curve.bifurcations["CP"][0].omega, rel=1e-8)


def test_points_and_events_by_shooting():
    system = so.library.reference_oscillator()
    start = so.frequency_response(system, (4.1, 3.9)).bifurcations["PD"][0]
    curve = so.track(start, "j", (0.0, 0.3))
    for item in (curve.extrema[0], curve.points[len(curve) // 2]):
        check = so.verify(item)
        assert check.agrees, check


def test_an_interrupted_curve_keeps_what_it_has(limit_point):
    calls = []

    def stop(share, where):
        calls.append((share, where))
        if len(calls) == 5:
            raise KeyboardInterrupt

    curve = so.track(limit_point, "F", (0.01, 0.2), progress=stop)
    assert len(curve) == 6
    assert curve.ended.startswith("interrupted at omega = ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"parameter": "G"}, "unknown parameter 'G'"),
        ({"parameter": "omega"}, "omega is free already"),
        ({"parameter": ("F", "F")}, "two different names"),
        ({"parameter": ("F",)}, "two different names"),
        ({"parameter": ("F", "omega")}, "omega is free anyway: write parameter='F'"),
        ({"parameter": ("omega", "F")}, "omega is free anyway: write parameter='F'"),
        ({"parameter": ("F", "omega"), "bounds": ((0.0, 0.2), (0.5, 2.0))}, "write omega first"),
        ({"parameter": ("F", "c")}, "two ranges"),
        ({"parameter": ("F", "c"), "bounds": ((0.0, 1.0), (0.0, 1.0)), "omega": (1.0, 2.0)}, "leave omega= out"),
        ({"bounds": (0.2, 0.3)}, "the bifurcation has F=0.1, outside"),
        ({"bounds": 3.0}, r"bounds must be two numbers \(from, to\) or a list of pairs"),
        ({"bounds": (0.1, 0.1)}, "two different finite ends"),
        ({"omega": (3.0, 4.0)}, "the bifurcation has omega="),
        ({"omega": (-1.0, 4.0)}, "frequencies are positive"),
        ({"harmonics": 0}, "harmonics must be"),
        ({"max_step": -1.0}, "max_step must be"),
        ({"parameter": "m", "bounds": (0.0, 1.0)}, "m"),
    ],
)
def test_wrong_input_is_refused(limit_point, arguments, message):
    with pytest.raises(so.InputError, match=message):
        so.track(limit_point, **{"parameter": "F", "bounds": (0.0, 0.2), **arguments})


def test_what_cannot_be_tracked(curve, limit_point):
    with pytest.raises(so.InputError, match="this is a CP"):
        so.track(curve.bifurcations["CP"][0], "F", (0.0, 0.2))
    with pytest.raises(so.InputError, match="must be a Bifurcation or a BranchPoint, not PeriodicOrbit"):
        so.track(limit_point.orbit, "F", (0.0, 0.2))


def test_the_coefficient_of_period_doublings_has_the_sign_of_their_normal_form():
    system = so.library.reference_oscillator(p=0.55)
    doubling = so.frequency_response(system, (4.05, 3.9)).bifurcations["PD"][0]
    border = so.track(doubling, "j", (0.0, 0.01))
    dataset = border.to_xarray()
    assert doubling.criticality == "supercritical"
    assert border.coefficient[0] == pytest.approx(doubling.normal_form.coefficients["c3"], rel=1e-3)
    assert np.array_equal(dataset["coefficient"], border.coefficient)
    assert list(border.to_dataframe().columns)[:2] == ["omega", "j"]
    # where motions at the end of a border branch off, its points say of them what a response curve there does
    there = so.frequency_response(system.with_parameters({"j": 0.01}), (3.85, 3.7)).bifurcations["PD"][0]
    assert there.omega == pytest.approx(border.omega[-1], rel=1e-6)
    assert (there.criticality == "supercritical") == (border.coefficient[-1] < 0.0)


def test_events_of_a_dataset_say_what_turns_and_that_stability_goes_on(curve):
    dataset = curve.to_xarray()
    assert [str(kind) for kind in dataset["event_kind"].values] == ["CP"]
    assert [str(text) for text in dataset["event_extreme"].values] == [""]
    after = int(dataset["event_after"][0])
    assert bool(dataset["event_stable_after"][0]) == bool(curve.stable[after])


@pytest.mark.parametrize(
    ("label", "own"),
    [
        ("TR", "NS"),
        ("torus", "NS"),
        ("SN", "LP"),
        ("fold", "LP"),
        ("LPC", "LP"),
        ("HB", "Hopf"),
        ("H", "Hopf"),
        ("BPC", "BP"),
    ],
)
def test_labels_of_other_packages_are_told_by_our_own(limit_point, label, own):
    curve = so.track(limit_point, "F", (0.05, 0.2), stepping=so.SteppingOptions(max_points=2))
    with pytest.raises(
        so.InputError, match=f"unknown kind of bifurcation '{label}': '{own}' is what it is called here"
    ):
        curve.bifurcations[label]
