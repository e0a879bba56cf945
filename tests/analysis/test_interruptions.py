"""What Ctrl-C and a time limit leave: everything computed, the fact that something is missing, and nothing cached."""

from __future__ import annotations

import inspect
import json

import numpy as np
import pytest

import suboctave as so
from suboctave import interruption
from suboctave.analysis import phase_resonance as resonance
from suboctave.continuation.ending import Ending, EndReason, interruption_of, read_endings, sentence
from suboctave.continuation.notes import Note
from suboctave.curves import follow as follow_module
from suboctave.errors import ConvergenceError
from suboctave.interruption import Interruption
from suboctave.results.files import branch_from_dataset, branch_to_dataset
from suboctave.timedomain import flow

#: everything public that may take long
VERBS = (
    ("basins", "bifurcation_diagram", "brute_force_diagram", "continue_branch", "find_isolas", "find_subharmonics")
    + ("frequency_response", "integrate", "isola_map", "locate_extremum", "lyapunov_exponents", "lyapunov_map")
    + ("periodic_orbit", "poincare_sections", "regime_map", "stepped_sine", "sweep", "switch_branch", "track", "verify")
    + ("design_margin", "equilibria", "limit_cycles", "nonlinear_mode", "phase_resonance", "track_peak")
)


class Clock:
    """One that moves on by one second whenever a time limit is looked at: so many looks, the same in every run."""

    def __init__(self, monkeypatch):
        self.now = 0.0
        monkeypatch.setattr(interruption, "monotonic", self)
        # the pieces that trajectories are followed in, and what their threads report, go by the time that they take
        monkeypatch.setattr(flow, "perf_counter", lambda: 0.0)
        monkeypatch.setattr(flow, "processors", lambda: 1)

    def __call__(self):
        self.now += 1.0
        return self.now

    def of(self, work):
        """How many looks some work takes, of which a part is then given as its time limit."""
        self.now = 0.0
        work(seconds=1e9)
        looks, self.now = self.now, 0.0
        return looks


@pytest.fixture
def ticks(monkeypatch):
    return Clock(monkeypatch)


class Stop:
    """A progress that presses Ctrl-C at its report number `at`."""

    def __init__(self, at):
        self.at, self.count = at, 0

    def __call__(self, share, text):
        self.count += 1
        if self.count == self.at:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def middle(duffing_curve):
    """A motion on the unstable branch between two folds, which lead into opposite directions."""
    system = so.library.duffing(c=0.05, F=0.4)
    curve = so.frequency_response(system, (0.5, 3.0))
    unstable = np.flatnonzero(~curve.stable)
    assert len(unstable) > 4
    return curve.orbits[unstable[len(unstable) // 2]]


# ------------------------------------------------------------------------------------------------------------- Ctrl-C
def test_ctrl_c_in_the_second_direction_is_not_forgotten(middle):
    whole = so.continue_branch(middle, "omega", (0.5, 3.0))
    assert not whole.interrupted
    assert whole.interruption is None
    assert {ending.reason for ending in whole.endings} == {EndReason.RANGE_END}
    first = np.argmin(np.abs(whole.omega - middle.omega) + np.abs(whole.amplitude - middle.amplitude()))
    late = max(first, len(whole) - first) + 5
    for at in (late, late + 8, len(whole) - 3):
        part = so.continue_branch(middle, "omega", (0.5, 3.0), progress=Stop(at))
        assert len(part) < len(whole)
        assert part.interrupted
        assert part.interruption == Interruption()
        assert {ending.reason for ending in part.endings} == {EndReason.RANGE_END, EndReason.INTERRUPTED}
        assert "interrupted at omega = " in part.ended
        assert "reached the end of the range" in part.ended


def test_ctrl_c_in_the_second_direction_of_a_tracked_curve(duffing_curve):
    limit_point = duffing_curve.bifurcations["LP"][0]
    whole = so.track(limit_point, "F", (0.01, 1.0))
    part = so.track(limit_point, "F", (0.01, 1.0), progress=Stop(len(whole) - 3))
    assert part.interrupted
    assert EndReason.RANGE_END in {ending.reason for ending in part.endings}
    assert not whole.interrupted


def test_files_hold_why_a_curve_ended_and_older_ones_are_read_by_their_sentence(middle, tmp_path):
    part = so.continue_branch(middle, "omega", (0.5, 3.0), progress=Stop(40))
    again = so.load(part.save(tmp_path / "part.nc"))
    assert again.endings == part.endings
    assert again.interruption == Interruption()
    dataset = branch_to_dataset(part)
    record = json.loads(str(dataset["record"].item()))
    del record["endings"]
    older = branch_from_dataset(dataset.assign(record=((), np.array(json.dumps(record), dtype=object))))
    assert older.interrupted
    assert older.ended == part.ended
    assert interruption_of(older.endings) == Interruption()


@pytest.mark.parametrize(
    "text",
    [
        "reached the end of the range at omega = 1.3",
        "the curve closed on itself",
        "20 points computed at omega = 2. Raise max_points to go on",
        "what follows omega = 2 could not be computed: {odd}; what was computed is kept",
        "step size fell below 1e-07 at j = 0.1: {odd}. Try more harmonics, a smoother law, or a smaller min_step",
        "reached the T motion at its period doubling at omega = 2.3",
        "interrupted at F = 1 in one direction, in words; what was computed is kept",
        "left the range after a, without a solution on its end. Move the bound a little in one direction, "
        "interrupted at b; what was "
        "computed is kept in the other",
    ],
)
def test_a_sentence_of_an_older_file_is_printed_as_it_was(text):
    assert sentence(read_endings(text)) == text
    assert any(ending.interruption is not None for ending in read_endings(text)) == ("interrupted" in text)


def test_what_cannot_be_computed_of_a_point_ends_the_curve_and_loses_nothing(monkeypatch):
    """A bifurcation whose refinement raised took the whole branch with it."""
    system = so.library.reference_oscillator(p=0.55, j=0.0)
    whole = so.frequency_response(system, (1.4, 1.0), harmonics=9)
    searched = follow_module._Follower._search

    def failing(self, a, b):
        if len(self.trace.points) == 12:
            raise ConvergenceError("out of reach")
        return searched(self, a, b)

    monkeypatch.setattr(follow_module._Follower, "_search", failing)
    part = so.frequency_response(system, (1.4, 1.0), harmonics=9)
    assert [ending.reason for ending in part.endings if ending.early] == [EndReason.FAILED]
    assert part.ended.startswith("what follows omega = ")
    assert part.ended.endswith("could not be computed: out of reach; what was computed is kept")
    np.testing.assert_array_equal(part.omega, whole.omega[: len(part)])
    assert 10 < len(part) < len(whole)


def test_a_search_ends_where_a_tracked_curve_is_interrupted(monkeypatch):
    """A truncated curve is no border: it must not become one of the search."""
    from suboctave.maps import catalogue

    tracked = catalogue.track

    def impatient(*given, **options):
        return tracked(*given, **options, progress=Stop(12))

    monkeypatch.setattr(catalogue, "track", impatient)
    isolas = so.find_isolas(so.library.reference_oscillator(p=0.55, j=0.0, regularization=300), (1.3, 4.5), "j", (0, 1))
    assert isolas.interrupted
    assert not isolas.limit_points
    assert [note for note in isolas.notes if note.startswith("interrupted")]


# --------------------------------------------------------------------------------------------------------- time limits
def test_a_time_limit_gives_what_was_found_and_how_to_go_on(rattling_curve, ticks):
    system = rattling_curve.system
    limit = round(0.6 * ticks.of(lambda seconds: so.frequency_response(system, (4.5, 1.3), seconds=seconds)))
    curve = so.frequency_response(system, (4.5, 1.3), seconds=limit)
    assert 10 < len(curve) < len(rattling_curve)
    assert curve.interruption == Interruption(float(limit))
    assert curve.ended == (
        f"the time limit of {limit} s was reached at omega = {curve.omega[-1]:.6g}; what was computed is kept. "
        "Give more seconds=, or go on from curve.orbits[-1] with so.continue_branch(...)"
    )
    assert curve.omega.tolist() == rattling_curve.omega[: len(curve)].tolist()
    whole = so.continue_branch(curve.orbits[-1], "omega", (4.5, 1.3))
    found = sorted(b.omega for b in whole.bifurcations)
    assert found == pytest.approx(sorted(b.omega for b in rattling_curve.bifurcations), abs=1e-7)


def test_wherever_a_time_limit_falls_the_curve_is_a_part_of_the_whole(rattling_curve, ticks):
    whole, reasons = rattling_curve, set()
    looks = ticks.of(lambda seconds: so.frequency_response(whole.system, (4.5, 1.3), seconds=seconds))
    for share in (0.001, 0.02, 0.31, 0.37, 0.53, 0.54, 0.71, 0.93):
        ticks.now = 0.0
        try:
            part = so.frequency_response(whole.system, (4.5, 1.3), seconds=share * looks)
        except so.TimeLimitError:
            reasons.add("nothing yet")
            continue
        reasons.add(part.endings[-1].reason)
        assert part.omega.tolist() == whole.omega[: len(part)].tolist()
        end = part.arclength[-1]
        expected = [b.omega for b in whole.bifurcations.met if b.arclength <= end]
        assert [b.omega for b in part.bifurcations.met] == expected
    assert reasons == {"nothing yet", EndReason.TIME_LIMIT}


def test_the_end_that_can_be_gone_on_with_is_named(middle, ticks):
    looks = ticks.of(lambda seconds: so.continue_branch(middle, "omega", (0.5, 3.0), seconds=seconds))
    for share in (0.2, 0.4, 0.6, 0.8, 0.95):
        ticks.now = 0.0
        part = so.continue_branch(middle, "omega", (0.5, 3.0), seconds=share * looks)
        (place,) = (i for i, ending in zip((0, -1), part.endings, strict=True) if ending.interruption is not None)
        assert f"curve.orbits[{place}]" in part.ended
        where = next(ending.where for ending in part.endings if ending.interruption is not None)
        assert where == f"omega = {part.omega[place]:.6g}"
    end = Ending(EndReason.RANGE_END, "omega = 3")
    late = Ending.stopped(Interruption(2.5), "omega = 1")
    assert "; what was computed is kept in one direction, " in sentence((late, end))
    assert "curve.orbits[0]" in sentence((late, end))
    assert "curve.orbits[-1]" in sentence((end, late))
    assert "curve.orbits" not in sentence((end, Ending.stopped(Interruption(), "omega = 1")))


def test_the_verbs_that_may_take_long_have_a_time_limit():
    """`stability`, files, pictures and reports need no motion that is not known; everything else has one."""
    public = {name for name in so.__all__ if inspect.isfunction(getattr(so, name))}
    without = {"check_derivatives", "load", "read_measured", "stability", "write_report"}
    without |= {"condense", "read_structure", "animate_shape", "to_pyvista", "write_vtu", "sensitivity"}
    without |= {name for name in public if name.startswith("plot")}
    assert public - without == set(VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_a_time_limit_that_is_none_is_refused_before_anything_else(verb):
    function = getattr(so, verb)
    given = inspect.signature(function).parameters
    assert given["seconds"].kind is inspect.Parameter.KEYWORD_ONLY
    needed = [p for p in given.values() if p.default is p.empty]
    sound = {"box": ((-1.0, 1.0), (-1.0, 1.0)), "parameter": "F", "values": (0.0, 1.0), "bounds": (0.5, 1.0)}
    sound |= {"subharmonic": 3, "by": "F"}
    sound["omega"] = (0.5, 1.0) if verb in ("phase_resonance", "lyapunov_map") else 1.0
    positional = [sound.get(p.name) for p in needed if p.kind is p.POSITIONAL_OR_KEYWORD]
    named = {p.name: sound.get(p.name) for p in needed if p.kind is p.KEYWORD_ONLY}
    for wrong in (0.0, -3, float("nan"), "10"):
        with pytest.raises(so.InputError, match="seconds must be a positive number"):
            function(*positional, **named, seconds=wrong)


def test_searches_in_time_end_with_what_is_there(duffing_curve, ticks):
    system = duffing_curve.system

    def halved(work):
        limit = 0.5 * ticks.of(work)
        found = work(seconds=limit)
        assert (found.complete, found.interruption) == (False, Interruption(limit))
        return found

    diagram = halved(
        lambda seconds: so.brute_force_diagram(
            system, (0.8, 1.2), values=8, direction="up", transient=20, periods=12, seconds=seconds
        )
    )
    assert 0 < int((diagram.period >= 0).sum()) < diagram.period.size
    test = halved(
        lambda seconds: so.stepped_sine(system, (0.8, 1.2), values=9, transient=20, periods=6, seconds=seconds)
    )
    assert 0 < int(np.isnan(test.response).sum()) < test.response.size
    found = halved(lambda seconds: so.verify(duffing_curve, every=3, seconds=seconds))
    assert len(found.points) + len(found.bifurcations) < len(range(0, len(duffing_curve), 3)) + 2
    with pytest.raises(so.TimeLimitError, match="before there was a result to keep"):
        so.integrate(system, omega=1.0, periods=2000, seconds=0.5)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95])
def test_wherever_a_time_limit_falls_the_basins_say_so_and_are_a_part_of_the_whole(share, whole_basins, ticks):
    """Among other places while the neighbourhoods are looked for in which trajectories are trapped."""
    whole, looks = whole_basins
    try:
        part = basins_of_a_duffing_oscillator(share * looks)
    except so.TimeLimitError:
        return
    assert (part.complete, part.interruption) == (False, Interruption(share * looks))
    computed = part.labels != -3
    assert not computed.all() or part.followed == 0
    assert np.array_equal(part.labels[computed], whole.labels[computed])


def basins_of_a_duffing_oscillator(seconds):
    system = so.library.duffing(c=0.2, F=0.3)
    box = ((-2.0, 2.0), (-2.0, 2.0))
    return so.basins(system, omega=1.5, box=box, grid=(8, 8), periods=60, workers=1, seconds=seconds)


@pytest.fixture(scope="module")
def whole_basins():
    """The basins, and how often the clock is looked at for them."""
    with pytest.MonkeyPatch.context() as patched:
        clock = Clock(patched)
        whole = basins_of_a_duffing_oscillator(1e9)
    assert whole.complete
    return whole, clock.now


def test_a_search_for_subharmonics_gives_the_branches_that_it_has(ticks):
    spring = so.PolynomialSpring(0, {3: 1.0})
    system = so.System(1.0, 0.02, 1.0, [spring], [so.HarmonicLoad(0, 4.0)])

    def search(seconds):
        return so.find_subharmonics(system, (4.0, 9.0), subharmonic=3, seeds=so.Seeds(4, 3, 1), seconds=seconds)

    looks = ticks.of(search)
    with pytest.raises(so.TimeLimitError):  # an empty list would say that there are none
        search(2.0)
    ticks.now = 0.0
    found = search(0.7 * looks)
    assert found
    assert found.interruption == Interruption(0.7 * looks)


@pytest.mark.parametrize(("order", "reach"), [(1, (0.7, 6.0)), pytest.param(3, (4.0, 9.0), marks=pytest.mark.slow)])
def test_a_resonance_is_not_read_off_a_part_of_a_response(order, reach, ticks, monkeypatch):
    """Neither after a time limit nor after Ctrl-C: the peak may lie on what is missing."""
    system = so.System(
        1.0, 0.02, 1.0, [so.PolynomialSpring(0, {3: 1.0})], [so.HarmonicLoad(0, "F")], parameters={"F": 4.0}
    )
    stage = "frequency_response" if order == 1 else "find_subharmonics"
    verb, more = getattr(so, stage), {} if order == 1 else {"subharmonic": order, "seeds": so.Seeds(4, 3, 1)}

    def response(seconds):
        return verb(system, reach, harmonics=3, seconds=seconds, **more)

    looks = ticks.of(response)
    for share in (0.8, 0.95):
        ticks.now = 0.0
        assert response(share * looks).interrupted if order == 1 else response(share * looks).interruption

    def part(*given, **options):
        return verb(*given, **options | more, progress=Stop(8))

    monkeypatch.setattr(resonance, stage, lambda *given, **options: verb(*given, **options | more))
    for share in (0.8, 0.95):
        ticks.now = 0.0
        with pytest.raises(so.TimeLimitError, match="before there was a result to keep"):
            so.phase_resonance(
                system,
                parameter="F",
                bounds=(1.0, 4.0),
                omega=reach,
                subharmonic=order,
                harmonics=3,
                seconds=share * looks,
            )
    monkeypatch.setattr(resonance, stage, part)
    with pytest.raises(KeyboardInterrupt):
        so.phase_resonance(system, parameter="F", bounds=(1.0, 4.0), omega=reach, subharmonic=order, harmonics=3)


# ------------------------------------------------------------------------------------------ starts, progress and turns
def test_an_event_right_at_the_start_is_listed_once(duffing_curve):
    start = duffing_curve.orbits[len(duffing_curve) // 2]
    level = start.amplitude()
    here = so.Event("here", lambda orbit: orbit.amplitude() - level)
    branch = so.continue_branch(start, "omega", (0.5, 3.0), events=[here])
    at_start = [event for event in branch.events["here"] if event.omega == pytest.approx(start.omega, rel=1e-12)]
    assert len(at_start) == 1
    assert len(branch.events["here"]) == 1 + sum(
        a * b < 0.0 for a, b in zip(branch.amplitude - level, (branch.amplitude - level)[1:], strict=False)
    )


def test_the_progress_of_a_switched_branch_moves_on(rattling_curve):
    seen = []
    branch = so.switch_branch(
        rattling_curve.bifurcations["PD"][0], progress=lambda share, text: seen.append((share, text))
    )
    shares = [share for share, _ in seen]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    low, high = sorted(branch.options["bounds"]["omega"])
    assert shares[-1] == pytest.approx(np.ptp(branch.omega) / (high - low), abs=1e-9)
    assert len(set(shares)) > len(branch) // 2
    orbit, count = branch.orbits[-1], len(branch.bifurcations)
    kept = orbit.basis.harmonics // orbit.basis.nu
    assert seen[-1][1] == (f"omega = {orbit.omega:.6g}, {len(branch)} points, {count} bifurcations, {kept} harmonics")


def test_what_is_in_doubt_of_a_turn_at_a_branch_point_goes_with_the_turn_along_any_parameter(monkeypatch):
    """A closed branch turns back at the branch point that it was begun at: no limit point, and no note on one."""
    made = follow_module.bifurcation_at

    def doubtful(located, a, b, observe, notes):
        item = made(located, a, b, observe, notes)
        if item.kind == "LP":
            notes.append(Note(f"is in doubt, at F = {item.parameter('F'):.9g}", "omega", item.omega, item.omega, "LP"))
        return item

    monkeypatch.setattr(follow_module, "bifurcation_at", doubtful)
    along = so.continue_branch(so.library.duffing(c=0.05, F=2.0), "F", (0.3, 6.0), omega=0.83)
    loop = so.switch_branch(along.bifurcations["BP"][0])
    assert loop.closed
    told = sorted(float(words.split("at F = ")[1]) for words in loop.warnings if "is in doubt" in words)
    # mirror images share their place, and the line on it
    folds = {float(f"{b.parameter('F'):.9g}") for b in loop.bifurcations["LP"]}
    assert told == pytest.approx(sorted(folds), rel=1e-8)
