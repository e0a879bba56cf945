"""The report page as a reader uses it, in a headless Chromium: skipped where there is none on the machine."""

from __future__ import annotations

import json
from contextlib import closing

import chromium
import numpy as np
import pytest
import xarray

import suboctave as so
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
        click_point(page, "near", 0, vertex)
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
    click_point(page, "near", 0, vertex)
    orbit, plots = branch.orbits[vertex], "[...document.querySelectorAll('#panel .small')]"
    assert facts(page)["verification"].startswith("agrees; distance")
    t, x = page.script(f"(() => {{ const own = {plots}[0].data[0]; return [own.x, own.y]; }})()")
    np.testing.assert_allclose(x, orbit.displacement(np.array(t) * orbit.period)[0], atol=1e-6 * np.max(np.abs(x)))
    sizes = page.script(f"{plots}[2].data[0].customdata")
    expected = [abs(orbit.harmonic(k)) for k in range(len(sizes))]
    np.testing.assert_allclose(sizes, expected, rtol=1e-5, atol=1e-9)
    real, imag = page.script(f"(() => {{ const own = {plots}[3].data[1]; return [own.x, own.y]; }})()")
    np.testing.assert_allclose(np.array(real) + 1j * np.array(imag), branch.multipliers[vertex], atol=1e-6)
    words = page.script("panel.innerText")
    share, impacts = branch.contact_share(1)[vertex], int(branch.impacts(1)[vertex])
    assert f"touches {100.0 * share:.1f} % of the period, {impacts} contact" in words


def test_a_place_in_the_plane_leads_to_the_response(page, study):
    click_point(page, "Boundaries over ω and j", 1, len(study["far"]) // 2)  # on the line of j = 0.1
    assert page.script("panel.querySelector('p').textContent") == "far"
    links = page.script("[...panel.querySelectorAll('.links button')].map((one) => one.textContent)")
    assert "near (j = 0)" in links
    assert "border" in links
    rings = page.script(f"{DRAWN}.filter((plot) => plot.data.at(-1).x.length).length")
    assert rings >= 2


def test_the_keyboard_reaches_everything(page, study):
    page.script("document.querySelector('#curve-0 .plot').focus()")
    click_point(page, "near", 0, 5)
    page.script("document.querySelector('#curve-0 .plot').focus()")
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
    page.click_on("#curve-0 .actions button:nth-of-type(3)")
    lines = page.script("saved.text()").splitlines()
    assert len(lines) == 1 + len(study["near"]) + len(study["near"].to_xarray()["event"])
    omega = lines[0].split(",").index("omega")
    assert float(lines[3].split(",")[omega]) == study["near"].omega[2]  # all digits


def test_ten_thousand_points_open_quickly(tmp_path, duffing):
    curves = {f"curve {i}": duffing(force=0.2 + 0.1 * i, points=1000) for i in range(5)}
    path = write_report(curves, tmp_path / "a.html")
    with closing(chromium.Page(tmp_path / "profile")) as page:
        page.open(path.as_uri())
        page.wait("performance.getEntriesByName('figure drawn').length")
        seconds = page.script("performance.getEntriesByName('figure drawn')[0].startTime") / 1e3
        print(f"first figure drawn after {seconds:.2f} s")
        assert seconds < 8.0  # below 2 on a machine that does nothing else
        assert page.errors == []
