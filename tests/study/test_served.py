"""Pages on the loopback address: of a results file, and of a run that is under way; nobody else reaches them."""

from __future__ import annotations

import http.client
import re
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from suboctave.study import served
from suboctave.study.file import read_study
from suboctave.study.runner import JOURNAL, run_study
from suboctave.study.watching import REFRESH, Watching, curves_so_far

EVIL = "<script>alert('x')</script>"


def asked(address, path="/", host=None, method="GET"):
    """Status, headers and text of a request to an address that is served."""
    place = urlsplit(address)
    connection = http.client.HTTPConnection(place.hostname, place.port, timeout=30)
    try:
        connection.request(method, path, headers={} if host is None else {"Host": host})
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read().decode("utf-8")
    finally:
        connection.close()


def test_the_page_is_for_this_machine_alone():
    with served.served(lambda: "<p>ω</p>") as address:
        assert address.startswith("http://127.0.0.1:")
        status, headers, text = asked(address)
        assert (status, text) == (200, "<p>ω</p>")
        assert headers["Cache-Control"] == "no-store"
        assert "Access-Control-Allow-Origin" not in headers
        port = urlsplit(address).port
        assert asked(address, host=f"localhost:{port}")[0] == 200
        for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}"):
            status, _, text = asked(address, host=host)
            assert status == 403
            assert "ω" not in text
        assert asked(address, "/etc/passwd")[0] == 404
        assert asked(address, "/../study.toml")[0] == 404
        assert asked(address, method="POST")[0] == 501
    with pytest.raises(ConnectionRefusedError):
        asked(address)


def test_a_browser_is_opened_where_there_is_a_screen(monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not served.show_in_browser("http://127.0.0.1:1/")
    monkeypatch.setenv("DISPLAY", ":0")
    assert served.show_in_browser("http://127.0.0.1:1/")
    assert opened == ["http://127.0.0.1:1/"]


def test_the_page_of_a_run_shows_what_was_found_so_far(study_file, monkeypatch):
    monkeypatch.setattr("suboctave.study.runner._OFTEN", 0.0)  # every point is written down
    text = Path(study_file()).read_text(encoding="utf-8").replace('title = "Duffing"', f'title = "{EVIL}"')
    study = read_study(study_file(text, "evil.toml"))
    watching, seen = Watching(study, study.folder), []
    assert watching.page().count("waiting") == len(study.steps)

    class Progress:
        """Looks at the page while an analysis runs."""

        def __enter__(self):
            return watching.reporting(self)

        def __call__(self, share, where):
            if len(seen) < 2 and share > (0.3, 0.7)[len(seen)]:
                seen.append(watching.page())

        def __exit__(self, *_):
            seen.append(watching.page())

    def watch(step):
        watching.begin(step.name)
        return Progress()

    outcome = run_study(study, watch=watch, report=watching.note)
    running, later, over, *_ = seen
    assert f'content="{REFRESH}"' in running
    # the curve grows while its analysis runs, and the share that is done is shown
    shares = [float(re.search(r'<progress value="([\d.]+)"', page)[1]) for page in (running, later)]
    assert 0.3 < shares[0] < 0.7 < shares[1] <= 1.0
    points = [int(re.search(r"points, .*?</td><td>(\d+)</td>", page)[1]) for page in (running, later)]
    assert 2 <= points[0] < points[1] < len(outcome.results["response"])
    assert len({re.search(r"data:image/svg\+xml;base64,(\S+)", page)[1] for page in (running, later)}) == 2
    assert "data:image/svg+xml" in over  # what is finished is drawn
    assert ">LP<" in over  # and what was located is listed
    for page in seen:
        assert EVIL not in page
    assert not (study.folder / JOURNAL).exists()
    watching.finish(outcome)
    assert "What was found" in watching.page()
    assert EVIL not in watching.page()


SEARCH = """[system]
library = "duffing"
arguments = { c = 0.1, F = 0.05 }

[[analyses]]
name = "isolas"
type = "find_isolas"
omega = [0.9, 1.6]
parameter = "F"
bounds = [0.05, 0.2]
harmonics = 3
depth = 0
levels = []
search = []
values = 2
"""


@pytest.mark.parametrize("workers", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_curves_of_a_search_grow_on_the_page(study_file, monkeypatch, workers):
    """Those that it follows itself point by point, those that other processes follow when they are complete."""
    monkeypatch.setattr("suboctave.study.runner._OFTEN", 0.0)
    monkeypatch.setenv("SUBOCTAVE_WORKERS", workers)
    study = read_study(study_file(SEARCH, "search.toml"))
    watching, shares, seen = Watching(study, study.folder), [], []

    class Progress:
        def __enter__(self):
            return watching.reporting(self)

        def __call__(self, share, where):
            shares.append(share)
            if len(shares) % 5:
                return
            curves = curves_so_far(study.folder / JOURNAL).get("isolas", {})
            seen.append({axes: sum(curve.sizes["point"] for curve in own) for axes, own in curves.items()})

        def __exit__(self, *_):
            pass

    def watch(step):
        watching.begin(step.name)
        return Progress()

    run_study(study, watch=watch, report=watching.note)
    sizes = [one.get("omega", 0) for one in seen]
    planes = [one.get(("omega", "F"), 0) for one in seen]
    assert shares == sorted(shares)
    assert shares[-1] > 0.2
    for counts in (sizes, planes):
        assert counts[-1] > 20
    for counts in (sizes, planes) if workers == "1" else (planes,):
        assert max(b - a for a, b in pairwise(counts)) <= 10


def test_show_page_serves_the_report_of_a_results_file(study_file, suboctave, monkeypatch):
    results = run_study(read_study(study_file())).files[0]
    pages = []
    monkeypatch.setattr(served, "show_in_browser", lambda address: pages.append(asked(address)[2]))
    monkeypatch.setattr(served, "wait_for_ctrl_c", lambda: None)
    status, out, _ = suboctave("show", results, "--page")
    assert status == 0
    assert "http://127.0.0.1:" in out
    assert "<h1>Duffing</h1>" in pages[0]
    assert 'id="curves"' in pages[0]
    for wrong in ((study_file(), "--page"), (results, "--page", "--json")):
        status, out, err = suboctave("show", *wrong)
        assert status == 2
        assert "--page" in err + out


def test_run_watch_ends_with_the_report(study_file, suboctave, monkeypatch):
    addresses, pages = [], []
    monkeypatch.setattr(served, "show_in_browser", addresses.append)
    monkeypatch.setattr(served, "wait_for_ctrl_c", lambda: pages.append(asked(addresses[0])[2]))
    status, out, _ = suboctave("run", study_file(), "--watch")
    assert status == 0
    assert addresses[0] in out
    assert "What was found" in pages[0]
    status, _, _ = suboctave("run", study_file(), "--watch", "--json")
    assert status == 2


def test_run_watch_tells_what_failed(study_file, suboctave, monkeypatch):
    addresses, pages = [], []
    monkeypatch.setattr(served, "show_in_browser", addresses.append)
    monkeypatch.setattr(served, "wait_for_ctrl_c", lambda: pages.append(asked(addresses[0])[2]))
    text = Path(study_file()).read_text(encoding="utf-8").replace('bifurcation = "LP"', 'bifurcation = "NS"')
    status, _, _ = suboctave("run", study_file(text), "--watch")
    assert status != 0
    assert "analysis up: failed." in pages[0]
