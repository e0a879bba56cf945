"""The report page: whole, self-contained, escaped, and never over another file without leave."""

from __future__ import annotations

import base64
import gzip
import html
import html.parser
import json
import re

import numpy as np
import pytest
import xarray

import suboctave as so
from suboctave.errors import InputError
from suboctave.pictures.browser import figure_data
from suboctave.pictures.drawing import Axis, Drawing, Entry, Frame, Polyline, Raster
from suboctave.pictures.points import DETAILS, curve_data, verified_by
from suboctave.pictures.report import write_report
from suboctave.pictures.style import Pen
from suboctave.store.layout import curve_dataset

EVIL = "</script><script>alert('x')</script> & <b>\"bold\"</b>"


class Page(html.parser.HTMLParser):
    """Elements, texts and links of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.links, self.scripts, self.cells, self.words, self._open = [], [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self._open.append(tag)
        self.links += [value for name, value in attrs if name in ("href", "src")]
        if tag == "script":
            self.scripts.append(["" if not attrs else dict(attrs).get("type", ""), ""])
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_endtag(self, tag):
        if tag in self._open:
            while self._open.pop() != tag:
                pass

    def handle_data(self, data):
        if self._open and self._open[-1] == "script":
            self.scripts[-1][1] += data
        elif self._open and self._open[-1] in ("td", "th"):
            self.cells[-1] += data
        elif "style" not in self._open:
            self.words.append(data)


@pytest.fixture(name="page")
def _page(duffing, tmp_path):
    def make(results=None, title="Study", **options):
        path = write_report(results or {"curve": duffing()}, tmp_path / "report.html", title=title, **options)
        return Page(path.read_text(encoding="utf-8"))

    return make


def test_the_page_needs_nothing_from_outside(page, tmp_path):
    read = page()
    assert all(link.startswith(("data:", "#")) for link in read.links)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    assert "@import" not in text
    kinds = [kind for kind, _ in read.scripts]
    assert kinds == ["application/json", "application/json", "text/plain", ""]
    plotly = gzip.decompress(base64.b64decode(read.scripts[2][1])).decode()
    assert "newPlot" in plotly
    assert len(text) < 3_000_000


def test_figures_hold_the_curve_and_its_bifurcations(page, duffing):
    data = duffing()
    told = json.loads(page({"curve": data}).scripts[0][1])
    by_name = {trace["name"]: trace for trace in told["data"]}
    assert set(by_name) == {"stable", "unstable", "limit point"}
    np.testing.assert_allclose(by_name["limit point"]["x"], data["event_omega"], rtol=1e-8)
    drawn = {(x, y) for n in ("stable", "unstable") for x, y in zip(by_name[n]["x"], by_name[n]["y"], strict=True)}
    pairs = zip(data["omega"].values, data["amplitude"].values, strict=True)
    assert {(float(f"{x:.9g}"), float(f"{y:.9g}")) for x, y in pairs} <= drawn
    # between two stable strokes the line is broken, and so are its vertices
    stable = by_name["stable"]
    assert stable["x"].count(None) == 1
    assert len(stable["customdata"]) == len(stable["x"])
    assert told["axes"] == ["omega", "quantity"]


def test_the_table_needs_no_script(page, duffing):
    data = duffing()
    cells = page({"curve": data}).cells
    assert cells[:5] == ["kind", "ω", "max |x|", "multiplier", "residual"]
    assert cells[5] == "LP (limit point)"
    assert [float(cells[6]), float(cells[11])] == pytest.approx(data["event_omega"].values, rel=1e-8)


def test_what_users_write_is_text(duffing, tmp_path):
    data = duffing(named="F").assign_attrs(system=EVIL, warnings=EVIL, note=EVIL, ended=EVIL)
    data["event_kind"] = ("event", np.array([EVIL] * data.sizes["event"], dtype=object))
    results = {EVIL: data, "other": duffing(), "table": xarray.Dataset({EVIL: ("row", [EVIL])}, attrs={"title": EVIL})}
    path = write_report(results, tmp_path / "evil.html", title=EVIL)
    read = Page(path.read_text(encoding="utf-8"))
    assert "b" not in read.tags
    assert len(read.scripts) == 1 + 3  # one figure of two curves, their points, Plotly, ours
    assert not any("alert(" in text for kind, text in read.scripts if kind == "")
    for kind, text in read.scripts:
        if kind == "application/json":
            assert "<" not in text
            for trace in json.loads(text)["data"] if text.startswith("{") else []:
                for words in (trace["name"], trace.get("hovertemplate", "")):
                    assert "<script" not in words
                    assert "<b>" not in words
    assert "".join(read.words).count(EVIL) >= 5
    assert EVIL in read.cells


def test_origin_and_doubts_are_stated(page, duffing):
    data = duffing().assign_attrs(warnings="first warning\nsecond warning", seconds=1.25, newton="tolerance 1e-10")
    points = data.sizes["point"]
    data["multipliers"] = (("point", "multiplier"), np.full((points, 2), 0.5 + 0.0j))
    data["multiplier_errors"] = (("point", "multiplier"), np.full((points, 2), 1e-9))
    doubtful = np.zeros((points, 2), dtype=bool)
    doubtful[7, 0] = True
    data["multiplier_open"] = (("point", "multiplier"), doubtful)
    words = " ".join(page({"curve": data}).words)
    for expected in ("first warning", "second warning", "1.25 s", "tolerance 1e-10", "c = 0.1", "suboctave 0"):
        assert expected in words
    assert f"at 1 of {points} points" in words


def test_curves_over_different_parameters_and_tables(page, duffing):
    p = np.linspace(0.0, 1.0, 5)
    along = curve_dataset(np.full(5, 2.0), p, parameters={"p": p}, free="p")
    table = xarray.Dataset({"omega": ("row", [1.0]), "mu": ("row", [0.5 + 0.25j]), "note": ("row", ["fine"])})
    read = page({"a": duffing(), "b": duffing(force=0.2), "c": along, "d": table})
    figures = [json.loads(text) for kind, text in read.scripts if kind == "application/json" and text.startswith("{")]
    # each curve is drawn once: those over one parameter together, each once in the legend
    assert [[t["name"] for t in f["data"] if t.get("showlegend")] for f in figures] == [["a", "b"], ["motions"]]
    assert [f["layout"]["xaxis"]["title"]["text"] for f in figures] == ["forcing frequency ω", "p"]
    assert [f["axes"] for f in figures] == [["omega", "quantity"], ["p", "quantity"]]
    assert {"0.500000 +0.250000i", "fine"} <= set(read.cells)


def test_what_found_nothing_takes_a_line(page, duffing, tmp_path):
    none = xarray.Dataset({"omega": ("row", np.zeros(0))}, attrs={"title": "no shape was found"})
    bare = curve_dataset(np.zeros(0), np.zeros(0), ended="the first motion was not found")
    path = write_report({"curve": duffing(), "shapes": none, "other": bare}, tmp_path / "nothing.html")
    text = path.read_text(encoding="utf-8")
    assert '<p class="nothing">Found nothing: shapes: no shape was found</p>' in text
    assert '<p class="nothing">Found nothing: other: the first motion was not found</p>' in text
    assert text.count("<section") == 3  # the summary, the curve, where numbers come from


def test_results_in_time_over_frequencies_have_a_choice_of_units(tmp_path):
    """Their axes are among those that the page converts, in the units of the system, also where no curve is on it."""
    system = so.library.duffing(c=0.1, F=0.1).with_units("mm, N, ms")
    times = {"values": 3, "transient": 5, "periods": 4}
    over = {
        "swept": so.brute_force_diagram(system, (0.5, 0.6), **times),
        "stepped": so.stepped_sine(system, (0.5, 0.6), **times),
    }
    text = so.write_report(over, tmp_path / "over.html").read_text(encoding="utf-8")
    assert re.search(r'<div id="view"[^>]* data-rad="rad/ms" data-cycles="kHz"', text)
    assert text.count('"axes":["omega",""]') == 2
    assert text.count("forcing frequency ω (rad/ms)") >= 2
    other = {"load": so.brute_force_diagram(system, 0.5, "F", (0.1, 0.2), **times)}
    assert (
        "data-rad"
        not in so.write_report(other, tmp_path / "other.html").read_text(encoding="utf-8").split("<script")[0]
    )


def test_a_page_has_a_bounded_size():
    """From all of the motions to none: each step is smaller, and says what is missing."""
    system = so.System(
        np.eye(3), 0.1 * np.eye(3), np.diag([2.0, 2.0, 2.0]) - np.eye(3, k=1) - np.eye(3, k=-1),
        loads=[so.HarmonicLoad(dof=0, amplitude=0.5)],
        elements=[so.ElasticStop(dof=1, stiffness=2.0, gap=0.3)],
    )  # fmt: skip
    data = so.frequency_response(system, omega=(1.5, 1.2), harmonics=5).to_xarray(motions=True).assign_attrs(number=0)
    sizes = [detail.size(data) for detail in DETAILS]
    assert sizes == sorted(set(sizes), reverse=True)
    assert sizes[-1] == 0
    for detail, size in zip(DETAILS, sizes, strict=True):
        curve = curve_data(detail.of(data), "curve")
        texts = [places.get(name, "") for places in (curve["points"], curve["events"]) for name in ("motion", "force")]
        assert sum(map(len, texts)) == pytest.approx(size, abs=16)
        assert bool(detail.words) == (size < sizes[0])
    assert [one["label"] for one in curve_data(DETAILS[2].of(data), "curve")["signals"]] == ["x_0", "x_1"]


def test_an_existing_file_is_left_alone(duffing, tmp_path):
    path = tmp_path / "report.html"
    path.write_text("mine")
    with pytest.raises(InputError, match="exists"):
        write_report({"curve": duffing()}, path)
    assert path.read_text() == "mine"
    write_report({"curve": duffing()}, path, overwrite=True)
    first = path.read_bytes()
    write_report({"curve": duffing()}, path, overwrite=True)
    assert path.read_bytes() == first  # no time stamp, no random names
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_wrong_input_is_refused(duffing, tmp_path):
    with pytest.raises(InputError, match="at least one result"):
        write_report({}, tmp_path / "a.html")
    with pytest.raises(InputError, match="got int"):
        write_report({"curve": 3}, tmp_path / "a.html")
    with pytest.raises(InputError, match=r"\.html"):
        write_report({"curve": duffing()}, tmp_path / "a.pdf")
    with pytest.raises(InputError, match="is no folder"):
        write_report({"curve": duffing()}, tmp_path / "nowhere" / "a.html")
    with pytest.raises(InputError, match="not laid out by suboctave"):
        write_report({"curve": duffing().drop_attrs()}, tmp_path / "a.html")
    assert not list(tmp_path.iterdir())


def test_what_was_found_and_what_needs_attention_stands_on_top(page, duffing, tmp_path):
    data = duffing().assign_attrs(early=1, ended="the step became too small", warnings=EVIL)
    path = write_report({"curve": data}, tmp_path / "sum.html", failures={"other": f"no {EVIL}"})
    text = path.read_text(encoding="utf-8")
    summary = text[text.index('id="summary"') : text.index('id="part-0"')]
    words = re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", summary)))
    for expected in ("1 curve", f"{data.sizes['point']} points", "2 limit points", "other: failed. no"):
        assert expected in words, expected
    assert "curve: Ended before its end: the step became too small." in words
    assert "None of the points were checked in the time domain" in words
    assert "time domain" not in words[words.index("What needs attention") :]
    assert EVIL not in summary
    assert '<a href="#curve-0">' in summary
    assert 'id="curve-0"' in text


def test_points_are_packed_with_all_their_digits(page, duffing):
    data = duffing()
    figure, known, *_ = page({"curve": data}).scripts
    (curve,) = json.loads(known[1])
    assert curve["free"] == ["omega"]
    assert set(curve["fixed"]) == {"c", "alpha", "F"}
    for places, prefix in ((curve["points"], ""), (curve["events"], "event_")):
        omega = np.frombuffer(base64.b64decode(places["values"]["omega"]), "<f8")
        np.testing.assert_array_equal(omega, data[f"{prefix}omega"].values)
    assert curve["events"]["kind"] == ["LP", "LP"]
    # each vertex of a figure says which point or event it is
    by_name = {trace["name"]: trace for trace in json.loads(figure[1])["data"]}
    assert by_name["limit point"]["customdata"] == [-1, -2]
    for name in ("stable", "unstable"):
        trace = by_name[name]
        assert trace["meta"]["curve"] == 0
        for x, vertex in zip(trace["x"], trace["customdata"], strict=True):
            if x is not None:
                known = data["omega"].values[vertex] if vertex >= 0 else data["event_omega"].values[-1 - vertex]
                assert x == pytest.approx(known, rel=1e-8)


def test_verifications_are_told_at_their_points(duffing):
    data = duffing()
    omega, amplitude = data["omega"].values[[3, 9]], data["amplitude"].values[[3, 9]]
    met = {name: ("event", data[name].values) for name in ("event_omega", "event_amplitude")}
    check = xarray.Dataset(
        {
            "index": ("point", [3, 9]),
            "omega": ("point", omega),
            "amplitude": ("point", amplitude),
            "distance": ("point", [1e-5, 0.2]),
            "outcome": ("point", np.array(["agrees", "disagrees"], dtype=object)),
            "event_agrees": ("event", [True, False]),
            "event_distance": ("event", [1e-6, 0.3]),
            **met,
        }
    )
    verified = verified_by([check], data)
    assert verified.points == {3: "agrees; distance 1.0e-05", 9: "disagrees; distance 2.0e-01"}
    assert verified.events == {0: "confirmed; distance 1.0e-06", 1: "NOT CONFIRMED; distance 3.0e-01"}
    assert verified.wrong == 2
    assert verified_by([check], duffing(force=0.3)) is None


def test_a_raster_is_cells_by_number_with_their_names():
    cells = np.zeros((2, 3, 3))
    cells[0, 0] = 1.0
    frame = Frame([Raster(cells, np.arange(4.0), np.arange(3.0), layer=0.0)])
    frame.entries["white"] = Entry(patch="#ffffff")
    frame.add(Polyline(np.array([[0.0, 3.0], [0.0, 2.0]]), Pen("#1a1a1a")), "border")
    drawn = figure_data(Drawing([Axis("omega", 0.0, 3.0), Axis("j", 0.0, 2.0)], [frame]), "map")
    raster = next(trace for trace in drawn["data"] if trace["type"] == "heatmap")
    assert [raster["meta"]["cells"][number] for number in raster["z"][0]] == ["white", "", ""]
    assert (raster["x"], raster["y"]) == ([0.5, 1.5, 2.5], [0.5, 1.5])
    assert {trace["name"] for trace in drawn["data"]} >= {"white", "border"}
