"""Figures and progress where somebody watches: in a notebook, at a prompt, nowhere."""

from __future__ import annotations

import sys
import types
from html import escape

import matplotlib as mpl
import pytest

import suboctave as so
from suboctave.progress import reporting


@pytest.fixture(scope="module")
def curve():
    return so.frequency_response(so.library.duffing(), (0.9, 1.1), harmonics=3)


@pytest.fixture
def screen(monkeypatch):
    """A back end of Matplotlib that has windows, and notes which are shown."""
    from matplotlib.backend_bases import FigureCanvasBase, FigureManagerBase

    shown = []

    class Manager(FigureManagerBase):
        def show(self):
            shown.append(self.canvas.figure)

    class Canvas(FigureCanvasBase):
        manager_class = Manager

    module = types.ModuleType("windows_for_tests")
    module.FigureCanvas, module.FigureManager = Canvas, Manager
    monkeypatch.setitem(sys.modules, "windows_for_tests", module)
    before = mpl.get_backend()
    mpl.use("module://windows_for_tests")
    yield shown
    mpl.use(before)


def test_at_a_prompt_a_figure_is_shown(curve, screen, monkeypatch):
    monkeypatch.setattr(sys, "ps1", ">>> ", raising=False)
    figure = so.plot(curve)
    assert screen == [figure]


def test_where_a_file_is_written_or_nobody_types_no_window_opens(curve, screen, monkeypatch, tmp_path):
    so.plot(curve)
    monkeypatch.setattr(sys, "ps1", ">>> ", raising=False)
    so.plot(curve, tmp_path / "figure.png")
    so.write_report({"response": curve}, tmp_path / "page.html")
    assert not screen


@pytest.fixture
def notebook(monkeypatch):
    """IPython as far as it is used, in a notebook; what its outputs become."""
    outputs = []

    class Handle:
        def update(self, item):
            outputs.append(item)

    ipython, display = types.ModuleType("IPython"), types.ModuleType("IPython.display")
    ipython.get_ipython, ipython.version_info = type("ZMQInteractiveShell", (), {}), (8, 24)
    display.HTML = str
    display.display = lambda item, display_id: Handle()
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    return outputs


def test_in_a_notebook_progress_is_a_bar_that_goes_away(notebook, monkeypatch):
    monkeypatch.setattr("suboctave.progress._OFTEN", 0.0)
    with reporting(True, "response") as report:
        report(0.5, "omega < 1")
        report(0.25, "again")
    first, second, last = notebook
    assert "<progress value='0.500'>" in first
    assert "response 50 %" in first
    assert "omega &lt; 1" in first
    # what is done in several parts does not go back
    assert "value='0.500'" in second
    assert last == ""


def test_in_a_notebook_figures_are_pictures_of_cells(curve, notebook, monkeypatch):
    monkeypatch.setattr(sys, "ps1", "In : ", raising=False)
    figure = so.plot(curve)
    assert figure.canvas.manager is None
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_results_in_a_notebook_are_their_picture_and_what_they_print(curve):
    html = curve._repr_html_()
    assert html.startswith("<img")
    assert "data:image/svg+xml;base64," in html
    assert html.endswith(f">{escape(repr(curve))}</pre>")
    assert "monospace" in html
    for motion in (curve[3], curve[3].orbit):
        assert motion._repr_html_().startswith("<img")
        assert motion._repr_html_().endswith(f">{escape(repr(motion))}</pre>")


def test_a_plane_and_a_motion_in_time_have_pictures_too(curve):
    assert "<img" in so.integrate(curve.system, omega=1.0, periods=2)._repr_html_()
