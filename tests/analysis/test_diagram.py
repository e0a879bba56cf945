"""Diagrams: every branch once, the tree and what was left out, files that give the same tree back."""

import time
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray as xr

import suboctave as so
from suboctave import interruption
from suboctave.analysis import diagram as diagram_module
from suboctave.errors import ConvergenceError, InputError
from suboctave.results.diagram import DiagramBranch, tree_text

RANGE = (4.5, 2.2)
COARSE = {"max_step": 0.3}


@pytest.fixture(scope="module")
def strong():
    return so.library.reference_oscillator(p=1.7, regularization=3000.0)


@pytest.fixture(scope="module")
def cascade(strong):
    """T, 2T and 4T of the strongly forced oscillator, above its resonance."""
    return so.bifurcation_diagram(strong, RANGE, depth=2, **COARSE)


@pytest.fixture(scope="module")
def pitchfork():
    """The symmetric Duffing oscillator and the pair of mirrored motions that lies between its two branch points."""
    return so.bifurcation_diagram(so.library.duffing(c=0.05, F=1.0), (0.15, 3.5), depth=3)


def at(items):
    return sorted(b.omega for b in items)


def test_each_branch_of_a_cascade_once_where_shooting_has_it(cascade, reference):
    """Both doublings of a branch belong to one branch of twice the period."""
    assert [node.branch.nu for node in cascade] == [1, 2, 4]
    assert [node.depth for node in cascade] == [0, 1, 2]
    known = reference["subharmonics_s3000"]["p1.7"]
    for nu in (2, 4):
        (branch,) = cascade.of_period(nu)
        rows = [row for row in known[f"{nu}T"] if row[0] == "PD" and min(RANGE) < row[1] < max(RANGE)]
        np.testing.assert_allclose(at(branch.bifurcations["PD"]), sorted(row[1] for row in rows), atol=1e-5)
    assert "2 bifurcations" in cascade.stopped
    assert [item.kind for item in cascade[2].left] == ["PD", "PD"]


def test_the_closed_branch_through_two_branch_points_once(pitchfork):
    """Its branch points are those of the response; nothing else leaves there."""
    assert len(pitchfork) == 2
    assert pitchfork[1].branch.closed
    assert pitchfork.stopped == ""
    np.testing.assert_allclose(
        at(pitchfork[1].branch.bifurcations["BP"]), at(pitchfork[0].branch.bifurcations["BP"]), atol=1e-7
    )
    assert pitchfork.legend == ["response", "from BP 0.6952"]


def test_branches_are_numbered_level_by_level(strong):
    """Numbers stay what they are when the diagram grows deeper."""
    system = so.System.from_equations(
        "x'' + 2*zeta*x' + (1 + delta*cos(omega*t))*x + alpha*x**3 = p*cos(omega*t)",
        {"zeta": 0.02, "delta": 0.15, "alpha": 0.5, "p": 0.01},
    )
    diagram = so.bifurcation_diagram(system, (2.3, 1.7), depth=1, max_step=0.2)
    assert [node.number for node in diagram] == [0, 1, 2]
    # parametric resonance: both branches of the tongue, from its ends
    delta, zeta = 0.15, 0.02
    width = np.sqrt(delta**2 / 4 - 4 * zeta**2)  # of the tongue at omega = 2, first order
    ends = [node.branch.departs.omega for node in diagram if node.origin is not None]
    assert sorted(ends)[1] - sorted(ends)[0] == pytest.approx(2 * width, rel=0.1)
    assert diagram["2T, PD 2.06"].number == 1
    assert diagram[-1] is diagram[2]
    assert diagram.parent(diagram[2]) is diagram.root
    assert diagram.parent(diagram.root) is None


def test_wrong_choices_of_a_branch(pitchfork):
    for which, words in ((2, "2 branches"), ("2T", "no branch"), ("T", "2 branches have a label"), (0.5, "number")):
        with pytest.raises(InputError, match=words):
            pitchfork[which]
    with pytest.raises(InputError, match="did you mean 'bifurcations'"):
        pitchfork.to_csv("x.csv", "bifurcation")


@pytest.mark.parametrize(
    ("options", "branches", "said"),
    [
        ({"depth": 0}, 1, "depth=0 reached: 2 bifurcations"),
        ({"max_branches": 2}, 2, "max_branches=2 reached: 2 bifurcations"),
    ],
)
def test_depth_and_budgets_end_it_and_say_what_is_left(strong, options, branches, said):
    diagram = so.bifurcation_diagram(strong, RANGE, **COARSE, **options)
    assert len(diagram) == branches
    assert diagram.stopped.startswith(said)
    assert sum(len(node.left) for node in diagram) == 2


@pytest.mark.parametrize("wrong", [{"depth": -1}, {"depth": 1.5}, {"max_branches": 0}, {"seconds": 0.0}])
def test_wrong_input_is_refused_before_any_work(strong, wrong):
    begin = time.process_time()
    with pytest.raises(InputError, match=next(iter(wrong))):
        so.bifurcation_diagram(strong, RANGE, **wrong)
    assert time.process_time() - begin < 0.1


def test_ctrl_c_keeps_the_branches_that_are_there(strong):
    def impatient(share, where):
        if "PD 3.028" in where:
            raise KeyboardInterrupt

    diagram = so.bifurcation_diagram(strong, RANGE, **COARSE, progress=impatient)
    assert diagram.interrupted
    assert [branch.nu for branch in diagram.branches][:2] == [1, 2]
    assert diagram[1].branch.arrives is not None


def test_a_time_limit_keeps_the_branches_that_are_there(strong, cascade, monkeypatch):
    looks = iter(range(10**9))
    monkeypatch.setattr(interruption, "monotonic", lambda: float(next(looks)))
    so.bifurcation_diagram(strong, RANGE, depth=2, seconds=1e9, **COARSE)
    whole = next(looks)
    said = set()
    for share in (0.2, 0.95):
        looks = iter(range(10**9))
        diagram = so.bifurcation_diagram(strong, RANGE, depth=2, seconds=share * whole, **COARSE)
        assert diagram.interruption == interruption.Interruption(share * whole)
        assert diagram.stopped.startswith(f"the time limit of {share * whole:g} s was reached: ")
        for part, full in zip(diagram.branches, cascade.branches, strict=False):
            assert part.interrupted or np.array_equal(part.omega, full.omega)
        said |= {len(diagram)}
    assert len(said) > 1


def test_a_file_holds_what_stopped_a_diagram(strong, monkeypatch, tmp_path):
    looks = iter(range(10**9))
    with monkeypatch.context() as patched:
        patched.setattr(interruption, "monotonic", lambda: float(next(looks)))
        diagram = so.bifurcation_diagram(strong, RANGE, depth=1, seconds=300, **COARSE)
    again = so.load(diagram.save(tmp_path / "diagram.nc"))
    assert again.interruption == diagram.interruption == interruption.Interruption(300.0)


@pytest.fixture
def failing(strong, monkeypatch):
    """A diagram in which the branch of period 4T cannot be followed."""
    switch = diagram_module.switch_branch

    def refuses(item, **options):
        if item.orbit.basis.nu == 2:
            raise ConvergenceError("no point of the other branch was found beside the period doubling")
        return switch(item, **options)

    monkeypatch.setattr(diagram_module, "switch_branch", refuses)
    return so.bifurcation_diagram(strong, RANGE, **COARSE)


def test_a_branch_that_cannot_be_followed_is_listed(failing, tmp_path):
    said = repr(failing)
    assert said.count("not followed: no point of the other branch") == 2
    assert failing.stopped == ""
    read = so.load(failing.save(tmp_path / "d.nc"))
    assert repr(read) == said
    for one, other in zip(read, failing, strict=True):
        assert [b.omega for b, _ in one.failures] == [b.omega for b, _ in other.failures]
        assert all(item in one.branch.bifurcations["PD"] for item, _ in one.failures)


# --------------------------------------------------------------------------------------------------------------- files
def test_a_diagram_read_back_is_the_same_tree_of_the_same_branches(cascade, tmp_path):
    path = cascade.save(tmp_path / "diagram.nc")
    with pytest.raises(InputError, match="exists"):
        cascade.save(path)
    read = so.load(path)
    assert isinstance(read, so.BifurcationDiagram)
    assert repr(read) == repr(cascade)
    assert read.seconds == cascade.seconds > 0.0
    for one, other in zip(read, cascade, strict=True):
        assert (one.number, one.depth, one.label) == (other.number, other.depth, other.label)
        xr.testing.assert_identical(one.branch.to_xarray(), other.branch.to_xarray())
        assert [b.omega for b in one.left] == [b.omega for b in other.left]
        if one.origin is not None:  # the bifurcation of the parent itself, by identity
            assert one.origin in read.parent(one).branch.bifurcations["PD"]
            assert one.origin.omega == other.origin.omega
    # it goes on from there, bit for bit
    again = [so.switch_branch(d[0].branch.bifurcations["PD"][1], **COARSE) for d in (read, cascade)]
    assert again[0].nu == 2
    assert again[0].amplitude.tobytes() == again[1].amplitude.tobytes()


def test_the_file_for_readers_without_the_package(cascade, tmp_path):
    """As docs/results.md describes it."""
    path = cascade.save(tmp_path / "diagram.nc")
    head = xr.open_dataset(path, engine="h5netcdf")
    assert head.attrs["contents"] == "diagram"
    assert head.attrs["branches"] == 3
    assert list(head["parent"].values) == [-1, 0, 1]
    assert list(head["period"].values) == [1, 2, 4]
    four = xr.open_dataset(path, engine="h5netcdf", group="branch_2")
    two = xr.open_dataset(path, engine="h5netcdf", group="branch_1")
    origin = int(head["origin"].values[2])
    assert str(two["event_kind"].values[origin]) == "PD"
    assert float(two["event_omega"].values[origin]) == pytest.approx(float(four["omega"].values[0]), abs=1e-3)


def test_a_file_with_a_branch_missing_or_changed(cascade, tmp_path):
    path = cascade.save(tmp_path / "diagram.nc")
    with h5py.File(path, "r+") as file:
        del file["branch_1"]
    with pytest.raises(InputError, match=r"diagram\.nc: branch_1 of the diagram is missing"):
        so.load(path)
    cascade.save(path, overwrite=True)
    with h5py.File(path, "r+") as file:
        file["branch_2"]["omega"][0] = 1.0
    with pytest.raises(InputError, match=r"'branch_2'.*damaged"):
        so.load(path)


def test_tables_of_all_branches(cascade, tmp_path):
    points, events = cascade.to_dataframe(), cascade.bifurcations_frame()
    assert len(points) == sum(len(branch) for branch in cascade.branches)
    assert dict(points.groupby("branch")["nu"].first()) == {0: 1, 1: 2, 2: 4}
    assert at(cascade[1].branch.bifurcations["PD"]) == sorted(
        events[(events.branch == 1) & (events.kind == "PD")].omega
    )
    for what, frame in (("points", points), ("bifurcations", events)):
        lines = cascade.to_csv(tmp_path / f"{what}.csv", what).read_text().splitlines()
        assert len(lines) == 1 + len(frame)
        assert lines[0].startswith("branch,nu,depth,")


# ------------------------------------------------------------------------------------------------------ text, pictures
@pytest.mark.parametrize("width", [60, 80, 100])
def test_the_tree_fits_its_width_and_tells_everything(cascade, width):
    text = tree_text(cascade, width)
    assert max(len(line) for line in text.splitlines()) <= width
    words = " ".join(text.replace("│", " ").split())
    for branch in cascade.branches:
        for item in branch.bifurcations:
            assert f"{item.omega:.6g}" in words
    assert "4T, PD 3.02870" in words
    assert cascade.stopped in words


class _Curve(SimpleNamespace):
    """What the tree asks of a branch."""

    def __len__(self):
        return 9

    def parameter(self, name):
        return np.linspace(2.0, 1.0, 9)


def test_long_lists_of_bifurcations_are_wrapped_and_criticality_is_told():
    senses = ["supercritical", "subcritical", None, ""]
    items = [
        SimpleNamespace(kind="PD", criticality=senses[i % 4], parameter=lambda name, i=i: 2.0 - 0.017 * i)
        for i in range(40)
    ]
    curve = _Curve(
        name="omega", nu=1, closed=False, departs=None, arrives=None, bifurcations=items, verdicts="0 unstable"
    )
    lines = tree_text(so.BifurcationDiagram(DiagramBranch(curve)), 80).splitlines()
    assert max(map(len, lines)) <= 80
    words = " ".join(" ".join(lines).split())
    assert "PD 2 (super), 1.983 (sub), 1.966, 1.949, 1.932 (super)" in words
    assert words.count("(super)") == words.count("(sub)") == 10
    assert not any(line.strip("│ ").startswith("(") for line in lines)  # never parted from its number


def test_a_figure_of_all_branches_in_the_colours_of_their_periods(cascade, tmp_path):
    figure = cascade.plot(tmp_path / "d.png")
    (axes,) = figure.axes
    legend = axes.get_legend() or figure.legends[0]
    assert {text.get_text() for text in legend.get_texts()} >= {"T", "2T", "4T"}
    colours = {line.get_color() for line in axes.lines if line.get_gid() in ("stable", "unstable")}
    assert len(colours) == 3
    assert so.plot([cascade, cascade[0].branch]).axes  # beside other curves, too


def test_a_part_of_a_figure_marks_only_what_lies_in_it(cascade):
    """Grazing contacts are left out unless they are asked for."""
    (axes,) = cascade.plot(xlim=(2.9, 3.1)).axes
    assert axes.get_xlim() == (2.9, 3.1)
    drawn = {line.get_gid(): line.get_xdata() for line in axes.lines if line.get_gid() in ("PD", "LP", "grazing")}
    inside = [b.omega for b in cascade.bifurcations if b.kind == "PD" and 2.9 <= b.omega <= 3.1]
    marks = np.concatenate([line.get_xdata() for line in axes.lines if line.get_gid() == "PD"])
    np.testing.assert_allclose(sorted(marks), sorted(inside))
    assert "grazing" not in drawn
    heights = [b.amplitude[(b.omega > 2.9) & (b.omega < 3.1)] for b in cascade.branches]
    assert axes.get_ylim()[1] == pytest.approx(1.06 * np.concatenate(heights).max(), rel=0.05)
    (axes,) = cascade.plot(marks=["grazing"]).axes
    assert {line.get_gid() for line in axes.lines} == {"stable", "unstable", "grazing"}
    for wrong in ({"xlim": (3.0, 2.0)}, {"ylim": (1.0,)}, {"xlim": 3.0}, {"marks": "PD"}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            cascade.plot(**wrong)
