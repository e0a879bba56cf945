"""The report page as a reader uses it, in a headless Chromium: skipped where there is none on the machine."""

from __future__ import annotations

import json
from contextlib import closing

import chromium
import numpy as np
import pytest
import xarray

import suboctave as so
from suboctave.harmonic.orbit import force_along
from suboctave.pictures.drawing import Axis, Drawing, Entry, Frame, Raster
from suboctave.pictures.paper import finished
from suboctave.pictures.report import write_report
from suboctave.pictures.style import sheet_of
from suboctave.store.table import Table
from suboctave.verification.verify import verify

pytestmark = pytest.mark.skipif(chromium.found() is None, reason="there is no Chromium on this machine")


@pytest.fixture(name="study", scope="module")
def _study():
    """A response with period doublings over which it is unstable, the border of these, the response at another gap."""
    system = so.library.reference_oscillator(p=0.55, j=0.0, regularization=3000.0)
    near = so.frequency_response(system, omega=(2.6, 2.0), harmonics=9)
    far = so.frequency_response(system.with_parameters({"j": 0.1}), omega=(2.6, 2.0), harmonics=9)
    border = so.track(near.bifurcations["PD"][0], parameter="j", bounds=(0.0, 0.15))
    return {"near": near, "far": far, "border": border, "check": verify(near, points=[3])}


@pytest.fixture(name="page", scope="module")
def _page(study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    path = write_report(study, folder / "report.html", title="A study")
    page = chromium.Page(folder / "profile")
    page.open(path.as_uri())
    yield page
    page.close()


@pytest.fixture(autouse=True)
def _nothing_goes_wrong(page):
    yield
    assert page.errors == []
    assert all(address.startswith(("file:", "data:", "blob:", "about:")) for address in page.requests)


#: the figures that were in view
DRAWN = "[...document.querySelectorAll('.plot')].filter((plot) => plot._fullLayout)"


def facts(page):
    """The panel's list: names and values."""
    return dict(
        page.script(
            "[...document.querySelectorAll('#panel > dl > dt')].map("
            "(name) => [name.textContent, name.nextSibling.textContent])"
        )
    )


def click_point(page, heading, curve, vertex):
    """Click on a vertex of a curve in the first figure of a section."""
    x, y = page.script(f"""(async () => {{
        const heads = [...document.querySelectorAll("h2")];
        const section = heads.find((one) => one.textContent === {json.dumps(heading)}).closest("section");
        const plot = section.querySelector(".plot");
        plot.scrollIntoView({{ block: "center", behavior: "instant" }});
        while (!plot._fullLayout) {{ await new Promise((go) => setTimeout(go, 20)); }}
        await new Promise((go) => setTimeout(go, 100));
        const trace = plot.data.find((t) => t.meta && t.meta.curve === {curve} && t.customdata.includes({vertex}));
        const i = trace.customdata.indexOf({vertex}), box = plot.getBoundingClientRect();
        const {{ xaxis, yaxis }} = plot._fullLayout;
        return [box.x + xaxis._offset + xaxis.l2p(trace.x[i]), box.y + yaxis._offset + yaxis.l2p(trace.y[i])];
    }})()""")
    page.script("panel.replaceChildren(); new Promise((go) => setTimeout(go, 400))")  # else it is a double click
    page.click(x, y)
    page.wait("document.querySelector('#panel dl')")


def test_a_clicked_point_shows_what_python_knows(page, study):
    branch = study["near"]
    for vertex in (3, len(branch) // 2):
        click_point(page, "near, far", 0, vertex)
        orbit, known = branch.orbits[vertex], facts(page)
        assert float(known["ω"]) == pytest.approx(orbit.omega, rel=1e-8)
        assert float(known["max |x|"]) == pytest.approx(orbit.amplitude(branch.observe), rel=1e-6)
        # of the time history that the page makes of the coefficients
        assert float(page.script("panel.dataset.peak")) == pytest.approx(orbit.amplitude(branch.observe), rel=1e-6)
        assert known["stability"] == ("stable" if branch.stable[vertex] else "unstable")
        largest = float(known["largest multiplier"].split(" ")[0])
        assert largest == pytest.approx(branch.multipliers[vertex, 0].real, 1e-4)
        assert float(known["residual"]) == pytest.approx(orbit.residual, rel=0.1)
        assert float(known["neglected part"]) == pytest.approx(orbit.truncation, rel=0.1)
    assert known["verification"] == "not verified"


def test_pictures_of_the_motion(page, study):
    branch, vertex = study["near"], 3
    click_point(page, "near, far", 0, vertex)
    orbit, plots = branch.orbits[vertex], "[...document.querySelectorAll('#panel .small')]"
    assert facts(page)["verification"].startswith("agrees; distance")
    t, x = page.script(f"(() => {{ const own = {plots}[0].data[0]; return [own.x, own.y]; }})()")
    np.testing.assert_allclose(x, orbit.displacement(np.array(t) * orbit.period)[0], atol=1e-6 * np.max(np.abs(x)))
    sizes = page.script(f"{plots}[2].data[0].customdata")
    expected = [abs(orbit.harmonic(k)) for k in range(len(sizes))]
    np.testing.assert_allclose(sizes, expected, rtol=1e-5, atol=1e-9)
    real, imag = page.script(f"(() => {{ const own = {plots}[4].data[1]; return [own.x, own.y]; }})()")
    np.testing.assert_allclose(np.array(real) + 1j * np.array(imag), branch.multipliers[vertex], atol=1e-6)
    words = page.script("panel.innerText")
    share, impacts = branch.contact_share(1)[vertex], int(branch.impacts(1)[vertex])
    assert f"touches {100.0 * share:.1f} % of the period, {impacts} contact" in words
    assert f"largest force {branch.peak_force(1)[vertex]:.5g}" in words
    t, force = page.script(f"(() => {{ const own = {plots}[3].data[1]; return [own.x, own.y]; }})()")
    expected = force_along(orbit.state(), 1)(2.0 * np.pi * np.array(t))
    np.testing.assert_allclose(force, expected, atol=1e-4 * np.max(np.abs(force)))


def test_a_place_in_the_plane_leads_to_the_response(page, study):
    click_point(page, "border", 1, len(study["far"]) // 2)  # on the line of j = 0.1
    assert page.script("panel.querySelector('p').textContent") == "far"
    links = page.script("[...panel.querySelectorAll('.links button')].map((one) => one.textContent)")
    assert "near (j = 0)" in links
    assert "border" in links
    rings = page.script(f"{DRAWN}.filter((plot) => plot.data.at(-1).x.length).length")
    assert rings >= 2


def test_the_keyboard_reaches_everything(page, study):
    page.script("document.querySelector('#part-0 .plot').focus()")
    click_point(page, "near, far", 0, 5)
    page.script("document.querySelector('#part-0 .plot').focus()")
    page.press("ArrowRight")
    page.wait("panel.querySelector('h2').textContent.startsWith('Point 6 ')")
    spoken = page.script("document.getElementById('spoken').textContent")
    assert f"ω {study['near'].omega[6]:.9g}" in spoken
    page.script("document.querySelector('#curve-0 tbody button').focus()")
    page.press("Enter", "\r")
    page.wait("!panel.querySelector('h2').textContent.startsWith('Point')")
    met = sorted([*study["near"].bifurcations.met], key=lambda event: event.arclength)
    assert float(facts(page)["ω"]) == pytest.approx(met[0].omega, rel=1e-8)
    assert page.script("document.querySelectorAll('tr[aria-selected=true]').length") == 1
    page.press("Escape")
    page.wait("panel.hidden")


def test_tables_sort_and_filter(tmp_path, duffing):
    values = np.array([3.0, -1.0, 20.0, np.nan, 1e-3, 7.0, 11.0, 2.0])
    table = xarray.Dataset({"name": ("row", [f"row {i}" for i in range(8)]), "value": ("row", values)})
    path = write_report({"curve": duffing(), "table": table}, tmp_path / "table.html")
    with closing(chromium.Page(tmp_path / "profile")) as page:
        page.open(path.as_uri())
        head, rows = "#part-1 thead th:nth-child(2)", "[...document.querySelectorAll('#part-1 tbody tr')]"
        known = values[np.isfinite(values)]
        orders = {"ascending": np.sort(known), "descending": np.sort(known)[::-1], None: known}
        for state, expected in orders.items():
            page.click_on(f"{head} button")
            assert page.script(f"document.querySelector('{head}').getAttribute('aria-sort')") == state
            shown = page.script(f"{rows}.map((row) => row.cells[1].textContent)")
            assert [float(text) for text in shown if text != "–"] == list(expected)
        page.script("document.querySelector('.filter input').focus()")
        page.call("Input.insertText", text="ROW 4")
        assert page.script(f"{rows}.filter((row) => !row.hidden).map((row) => row.cells[0].textContent)") == ["row 4"]
        assert page.script("document.querySelector('.filter span').textContent") == "1 of 8 rows"
        page.click_on("#curve-0 tbody button")
        page.wait("!panel.hidden")
        assert "made from a dataset without them" in page.script("panel.innerText")
        assert page.errors == []


def test_a_place_in_a_map_says_what_is_there(study, tmp_path):
    class Map:
        """What a page needs of a map."""

        def to_table(self):
            return Table({"j": np.array([0.0, 0.1])}, "a map")

        def plot(self, path):
            cells = np.ones((2, 2, 3))
            cells[1] = 0.0
            frame = Frame([Raster(cells, np.array([2.0, 2.3, 2.6]), np.array([0.0, 0.1, 0.2]), layer=0.0)])
            frame.entries |= {"one motion": Entry(patch="#ffffff"), "two motions": Entry(patch="#000000")}
            drawing = Drawing([Axis("omega", 2.0, 2.6), Axis("j", 0.0, 0.2)], [frame])
            return finished(drawing, sheet_of((5.0, 4.0)), path, {})

    path = write_report({"near": study["near"], "map": Map()}, tmp_path / "map.html")
    with closing(chromium.Page(tmp_path / "profile")) as page:
        page.open(path.as_uri())
        page.script("document.querySelector('#part-1 .plot').scrollIntoView({ block: 'center', behavior: 'instant' })")
        page.wait("document.querySelector('#part-1 .plot')._fullLayout")
        page.script("new Promise((go) => setTimeout(go, 300))")
        page.click(
            *page.script("""(() => {
            const plot = document.querySelector("#part-1 .plot"), box = plot.getBoundingClientRect();
            const { xaxis, yaxis } = plot._fullLayout;
            return [box.x + xaxis._offset + xaxis.l2p(2.15), box.y + yaxis._offset + yaxis.l2p(0.15)];
        })()""")
        )
        page.wait("!panel.hidden")
        words = page.script("panel.innerText")
        assert page.script("panel.querySelector('h2').textContent") == "two motions"
        assert "near (j = 0)" in words
        page.click_on("#panel .links button")
        page.wait("panel.querySelector('h2').textContent.startsWith('Point ')")
        assert page.errors == []


@pytest.fixture(name="pair", scope="module")
def _pair():
    """Two masses, named, in units, with a stop between both."""
    system = so.System(
        np.eye(2),
        0.1 * np.eye(2),
        [[2.0, -1.0], [-1.0, 2.0]],
        elements=[so.ElasticStop(dof=(1, 0), stiffness=2.0, gap=0.2)],
        loads=[so.HarmonicLoad(dof=0, amplitude=0.5)],
        dof_names=["root", "tip"],
        units="mm, N, s",
    )
    return so.frequency_response(system, omega=(2.0, 1.4), harmonics=7)


@pytest.fixture(name="two", scope="module")
def _two(pair, tmp_path_factory):
    folder = tmp_path_factory.mktemp("two")
    path = write_report({"pair": pair}, folder / "report.html")
    page = chromium.Page(folder / "profile", 390, 844)
    page.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
    page.open(path.as_uri())
    yield page
    assert page.errors == []
    page.close()


def select(page, label, value):
    """Choose in one of the selectors."""
    page.script(f"""(() => {{
        const own = [...document.querySelectorAll("#view label")].find((one) => one.textContent.startsWith({label!r}));
        const select = own.querySelector("select");
        select.value = {value!r};
        select.dispatchEvent(new Event("change"));
    }})()""")


def drawn(page):
    """By vertex what the first figure shows of points: across and upwards, and its titles."""
    vertices, titles = page.script("""(() => {
        const plot = document.querySelector(".plot"), found = [];
        for (const trace of plot.data) {
            (trace.customdata || []).forEach((v, i) => {
                if (v !== null && v >= 0) { found.push([v, trace.x[i], trace.y[i]]); }
            });
        }
        return [found, ["xaxis", "yaxis"].map((name) => plot.layout[name].title.text)];
    })()""")
    return {vertex: (x, y) for vertex, x, y in vertices}, titles


def test_selectors_change_all_figures(two, pair):
    two.wait("document.querySelector('.plot')._fullLayout")
    x = np.array([orbit.displacement(np.linspace(0.0, orbit.period, 4001)) for orbit in pair.orbits])
    signals = {"root": x[:, 0], "tip": x[:, 1], "tip - root": x[:, 1] - x[:, 0]}
    for label, values in signals.items():
        select(two, "displacement", label)
        for quantity, expected in {
            "amplitude": np.abs(values).max(1),
            "peak_to_peak": np.ptp(values, axis=1),
            "mean": values[:, :-1].mean(1),
            "rms": np.sqrt((values[:, :-1] ** 2).mean(1)),
        }.items():
            select(two, "quantity", quantity)
            shown, titles = drawn(two)
            assert len(shown) == len(pair)
            for vertex, (omega, value) in shown.items():
                assert omega == pytest.approx(pair.omega[vertex], rel=1e-8)
                assert value == pytest.approx(expected[vertex], rel=2e-6, abs=2e-6)
            assert label in titles[1]
            assert titles[1].endswith("(mm)")
    select(two, "displacement", "tip")
    for quantity, expected in {"harmonic": abs(pair.harmonic(3, "tip")), "velocity": pair.velocity("tip")}.items():
        select(two, "quantity", quantity)
        select(two, "k =", "3")
        values = {vertex: y for vertex, (_, y) in drawn(two)[0].items()}
        np.testing.assert_allclose([values[i] for i in range(len(pair))], expected, rtol=1e-5)
    assert drawn(two)[1][1].endswith("(mm/s)")
    select(two, "quantity", f"force:{pair.system.elements[0].label}")
    values = {vertex: y for vertex, (_, y) in drawn(two)[0].items()}
    np.testing.assert_allclose([values[i] for i in range(len(pair))], pair.peak_force(0), rtol=1e-9)
    select(two, "frequency in", "cycles")
    shown, titles = drawn(two)
    assert shown[4][0] == pytest.approx(pair.omega[4] / (2.0 * np.pi), rel=1e-8)
    assert titles == ["forcing frequency (Hz)", f"largest force, {pair.system.elements[0].label} (N)"]
    select(two, "quantity", "amplitude")
    two.script("document.querySelectorAll('#view input').forEach((box) => box.click())")
    types = two.script("(({ xaxis, yaxis }) => [xaxis.type, yaxis.type])(document.querySelector('.plot')._fullLayout)")
    assert types == ["log", "log"]
    two.script("document.querySelectorAll('#view input').forEach((box) => box.click())")
    for label, value in (("quantity", "amplitude"), ("displacement", ""), ("frequency in", "")):
        select(two, label, value)
    assert drawn(two)[0][4] == pytest.approx((pair.omega[4], pair.amplitude[4]), rel=1e-8)


def test_the_panel_lists_every_displacement_with_units(two, pair):
    vertex = len(pair) // 2
    click_point(two, "pair", 0, vertex)
    known = facts(two)
    assert known["ω"] == f"{pair.omega[vertex]:.9g} rad/s"
    assert known["ω/2π"] == f"{pair.omega[vertex] / (2.0 * np.pi):.9g} Hz"
    assert known["max |root|"].endswith(" mm")
    rows = two.script(
        "[...panel.querySelectorAll('tbody tr')].map((row) => [...row.cells].map((cell) => cell.textContent))"
    )
    orbit = pair.orbits[vertex]
    assert [row[0] for row in rows] == ["root", "tip", "tip - root"]
    for row, dof in zip(rows, (0, 1), strict=False):
        expected = orbit.amplitude(dof), orbit.harmonic(0, dof).real, abs(orbit.harmonic(1, dof))
        assert [float(row[i]) for i in (1, 3, 4)] == pytest.approx(expected, rel=1e-3, abs=1e-6)
    # on a phone the point stays above the panel
    top, ring = two.script("""(() => {
        const plot = document.querySelector(".plot"), box = plot.getBoundingClientRect(), own = plot.data.at(-1);
        const { yaxis } = plot._fullLayout;
        return [panel.getBoundingClientRect().top, box.y + yaxis._offset + yaxis.d2p(own.y[0])];
    })()""")
    assert 0 < ring < top
    # a click on another displacement shows that, everywhere
    two.click_on("#panel tbody tr:nth-child(2) button")
    assert two.script("document.querySelector('#view select').value") == "tip"
    assert "tip" in drawn(two)[1][1]
    select(two, "displacement", "")
    two.script("document.querySelector('#panel .close').click()")


def click_empty(page, selector, across, upwards):
    """Click at shares of the frame of a figure."""
    x, y = page.script(f"""(async () => {{
        const plot = document.querySelector({json.dumps(selector)});
        plot.scrollIntoView({{ block: "center", behavior: "instant" }});
        while (!plot._fullLayout) {{ await new Promise((go) => setTimeout(go, 20)); }}
        await new Promise((go) => setTimeout(go, 400));
        const box = plot.getBoundingClientRect(), {{ xaxis, yaxis }} = plot._fullLayout;
        return [box.x + xaxis._offset + {across} * xaxis._length, box.y + yaxis._offset + {upwards} * yaxis._length];
    }})()""")
    page.click(x, y)


def test_a_click_beside_everything_says_so(page):
    page.press("Escape")
    click_empty(page, "#part-0 .plot", 0.5, 0.02)
    page.wait("document.querySelector('#part-0 .words').textContent.startsWith('Nothing is drawn there')")
    assert page.script("panel.hidden")
    # in a plane of parameters: what is near
    click_empty(page, "#part-1 .plot", 0.97, 0.65)
    page.wait("!panel.hidden")
    assert page.script("panel.querySelector('h2').textContent") == "A place in the plane"
    assert "border" in page.script("panel.innerText")
    page.press("Escape")


def test_light_and_dark(page):
    ground = "getComputedStyle(document.body).backgroundColor"
    assert page.script(ground) == "rgb(255, 255, 255)"
    page.click_on(".look")
    dark = page.script(ground)
    assert max(map(int, dark[4:-1].split(","))) < 50
    drawn = page.script(f"{DRAWN}.map((plot) => plot._fullLayout.paper_bgcolor)")
    assert set(drawn) == {"#15181c"}
    page.click_on(".look")
    assert page.script(ground) == "rgb(255, 255, 255)"
    page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    page.wait(f"{ground} !== 'rgb(255, 255, 255)'")
    page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}])


def test_what_is_saved(page, study):
    page.script(
        "URL.createObjectURL = (blob) => { window.saved = blob; return 'blob:none'; };"
        "HTMLAnchorElement.prototype.click = () => {}; 0"
    )
    page.click_on("#part-0 .actions button:nth-of-type(3)")
    lines = page.script("saved.text()").splitlines()
    assert len(lines) == 1 + sum(len(study[name]) + study[name].to_xarray().sizes["event"] for name in ("near", "far"))
    omega = lines[0].split(",").index("omega")
    assert float(lines[3].split(",")[omega]) == study["near"].omega[2]  # all digits


def test_ten_thousand_points_open_quickly(tmp_path, duffing):
    curves = {f"curve {i}": duffing(force=0.2 + 0.1 * i, points=1000) for i in range(5)}
    path = write_report(curves, tmp_path / "a.html")
    with closing(chromium.Page(tmp_path / "profile")) as page:
        page.call("Performance.enable")
        page.open(path.as_uri())
        page.wait("performance.getEntriesByName('figure drawn').length")
        metrics = {one["name"]: one["value"] for one in page.call("Performance.getMetrics")["metrics"]}
        assert metrics["ProcessTime"] < 6.0  # of the processor, until the first figure is drawn
        assert page.errors == []
