"""The demonstration: response curves of an oscillator that rattles between two stops.

`x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)`, two stops at -1 and j, in the regularised form with
s = 3000, for the three cases of Figs 6 and 7 of Alcorta, Baguet, Prabel, Piteau, Jacquet-Richardet, Nonlinear Dynamics
98 (2019): weak forcing with equal gaps, weak forcing with one gap closed, strong forcing with one gap closed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from suboctave.pictures import plot_boundaries, plot_panels, plot_response
from suboctave.progress import bar
from suboctave.study.screen import console, event_lines, print_events

if TYPE_CHECKING:
    import xarray
    from rich.console import Console

    from suboctave.results.branch import Branch
    from suboctave.results.diagram import BifurcationDiagram

__all__ = [
    "CASES",
    "OMEGA",
    "REGULARIZATION",
    "Case",
    "Curve",
    "compute",
    "draw",
    "run_demo",
    "sequel",
]

OMEGA = (4.5, 1.25)
REGULARIZATION = 3000.0
MAX_STEP = 0.04  # finer than the default, for smooth figures

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Case:
    """One response curve of the demonstration: forcing amplitude `p`, right gap `j` (the left gap is 1)."""

    title: str
    p: float
    j: float


@dataclass(frozen=True)
class Curve:
    """A case with its computed curve, laid out as a dataset, and the seconds that it took."""

    case: Case
    dataset: xarray.Dataset
    seconds: float
    #: whether the user stopped it; what had been computed is there
    interrupted: bool = False


CASES = (
    Case("weak forcing, equal gaps", 0.55, 1.0),
    Case("weak forcing, one gap closed", 0.55, 0.0),
    Case("strong forcing, one gap closed", 1.7, 0.0),
)


def compute(case: Case, progress: Progress | None = None) -> Curve:
    """The response curve of one case, with stability and located bifurcations; `progress(fraction, text)` is called."""
    from suboctave.analysis.frequency_response import frequency_response
    from suboctave.model import library

    begin = perf_counter()
    system = library.reference_oscillator(p=case.p, j=case.j, regularization=REGULARIZATION)
    branch = frequency_response(system, omega=OMEGA, max_step=MAX_STEP, progress=progress)
    return Curve(case, branch.to_xarray(), perf_counter() - begin, branch.interrupted)


def draw(curves: Sequence[Curve], folder: Path) -> list[Path]:
    """Two figures in `folder`, PNG: weak forcing with its two cases side by side, and strong forcing."""
    weak = [curve for curve in curves if curve.case.p < 1.0]
    strong = [curve for curve in curves if curve.case.p >= 1.0]
    files: list[Path] = []
    if weak:
        titles = [f"({letter}) p = {c.case.p:g}, j = {c.case.j:g}" for letter, c in zip("abcdef", weak, strict=False)]
        files.append(folder / "weak_forcing.png")
        plot_panels([curve.dataset for curve in weak], files[-1], titles=titles)
    if strong:
        title = ", ".join(f"p = {c.case.p:g}, j = {c.case.j:g}" for c in strong)
        files.append(folder / "strong_forcing.png")
        plot_response([curve.dataset for curve in strong], files[-1], title=title)
    return files


def sequel(folder: Path, progress: Progress | None = None) -> list[tuple[str, Path]]:
    """What hides beside the response curves: sentences, each with its figure in `folder`.

    The branches that leave the strongly forced response at its period doublings; the border of the first ones over the
    frequency and the gap, with the curve of limit points that begins on it; and, off that border, a resonance of twice
    the period that no sweep meets.
    """
    from suboctave.analysis.diagram import bifurcation_diagram
    from suboctave.analysis.frequency_response import continue_branch, frequency_response
    from suboctave.analysis.track import track
    from suboctave.model import library

    beside: list[tuple[str, Path]] = []
    strong = library.reference_oscillator(p=1.7, j=0.0, regularization=REGULARIZATION)
    diagram = bifurcation_diagram(strong, omega=OMEGA, depth=2, progress=progress)
    count = len(diagram) - 1
    beside.append((f"p = 1.7, j = 0: {count} branches leave the response", folder / "cascade.png"))
    diagram.plot(beside[-1][1])
    _go_on(diagram)

    weak = library.reference_oscillator(p=0.55, j=0.0, regularization=REGULARIZATION)
    doubling = frequency_response(weak, omega=OMEGA).bifurcations["PD"][0]
    border = track(doubling, parameter="j", bounds=(0.0, 1.0), progress=progress)
    _go_on(border)
    limits = track(border.bifurcations["GPD"][-1], parameter="j", bounds=(0.0, 1.0), progress=progress)
    _go_on(limits)
    highest = max(e.parameter("j") for e in border.extrema)
    text = f"p = 0.55: the response doubles its period for gaps up to j = {highest:.5f}"
    beside.append((text, folder / "boundary.png"))
    plot_boundaries([border.to_xarray(), limits.to_xarray()], beside[-1][1])

    fold = min(limits.orbits, key=lambda orbit: abs(orbit.values["j"] - 0.5))
    isola = continue_branch(fold, "omega", OMEGA, progress=progress)
    gap = fold.values["j"]
    response = frequency_response(weak.with_parameters({"j": gap}), omega=OMEGA, progress=progress)
    born = max(e.parameter("j") for e in limits.extrema)
    text = f"up to j = {born:.5f} an isolated resonance of twice the period hides beside it: at j = {gap:.3f}"
    beside.append((text, folder / "isola.png"))
    plot_response([response.to_xarray(), isola.to_xarray()], beside[-1][1], title=f"p = 0.55, j = {gap:.3f}")
    return beside


def _go_on(result: Branch | BifurcationDiagram) -> None:
    """Ctrl-C, which the verbs end politely at, ends the demonstration too."""
    if result.interrupted:
        raise KeyboardInterrupt


def run_demo(out: Path, json_wanted: bool = False) -> None:
    """The demonstration: three response curves, a table of their bifurcations on stdout, figures in `out`."""
    out.mkdir(parents=True, exist_ok=True)  # before the work: a folder that cannot be made is known now
    screen = console(quiet=json_wanted)
    screen.print(
        "An oscillator that rattles between two stops, at -1 and j:\n"
        "    x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)\n"
        f"zeta = 0.03, alpha = 0.16, Kc = 4.7, stops regularised with s = {REGULARIZATION:g};\n"
        f"omega from {OMEGA[0]:g} to {OMEGA[1]:g}.",
        markup=False,
    )
    curves: list[Curve] = []
    for case in CASES:
        with bar(f"p = {case.p:g}, j = {case.j:g}") as report:
            curve = compute(case, report)
        curves.append(curve)
        _print_curve(screen, curve)
        if curve.interrupted:
            break
    screen.print()
    figures = list(draw(curves, out))
    for path in figures:
        screen.print(f"figure: {path}", markup=False, soft_wrap=True)
    if not curves[-1].interrupted:
        with bar("what hides beside them") as report:
            hidden = sequel(out, report)
        for text, path in hidden:
            screen.print(f"\n{text}\nfigure: {path}", markup=False, soft_wrap=True)
            figures.append(path)
    if json_wanted:
        listed = [
            {
                "p": c.case.p,
                "j": c.case.j,
                "points": int(c.dataset.sizes["point"]),
                "seconds": c.seconds,
                "ended": c.dataset.attrs["ended"],
                "events": [
                    {"kind": str(kind), "omega": float(omega)}
                    for kind, omega in zip(c.dataset["event_kind"].values, c.dataset["event_omega"].values, strict=True)
                ],
            }
            for c in curves
        ]
        print(json.dumps({"ok": not curves[-1].interrupted, "curves": listed, "files": [str(f) for f in figures]}))
    if curves[-1].interrupted:
        raise KeyboardInterrupt


def _print_curve(screen: Console, curve: Curve) -> None:
    case, dataset = curve.case, curve.dataset
    screen.print(f"\np = {case.p:g}, j = {case.j:g}: {case.title}", style="bold", markup=False)
    print_events(screen, event_lines(dataset))
    screen.print(f"{dataset.sizes['point']} points in {curve.seconds:.2f} s; {dataset.attrs['ended']}.", markup=False)
