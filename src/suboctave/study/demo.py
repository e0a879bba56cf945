"""The demonstration: response curves of an oscillator that rattles between two stops.

`x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)`, two stops at -1 and j, in the regularised form with
s = 3000, for the three cases of Figs 6 and 7 of Alcorta, Baguet, Prabel, Piteau, Jacquet-Richardet, Nonlinear Dynamics
98 (2019): weak forcing with equal gaps, weak forcing with one gap closed, strong forcing with one gap closed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from suboctave.analysis.branches import continue_branch, frequency_response
from suboctave.analysis.diagram import bifurcation_diagram
from suboctave.analysis.track import track
from suboctave.interruption import pass_on
from suboctave.model import System, library
from suboctave.pictures import plot, plot_boundaries, plot_panels
from suboctave.progress import bar
from suboctave.results.branch import Branch
from suboctave.store.layout import events_met
from suboctave.study.screen import console, event_lines, print_events
from suboctave.study.shown import to_json

OMEGA = (4.5, 1.25)
REGULARIZATION = 3000.0

Progress = Callable[[float, str], None]


class Case(NamedTuple):
    """One response curve of the demonstration: forcing amplitude `p`, right gap `j` (the left gap is 1)."""

    title: str
    p: float
    j: float

    @property
    def system(self) -> System:
        """The oscillator."""
        return library.reference_oscillator(p=self.p, j=self.j, regularization=REGULARIZATION)

    def __str__(self) -> str:
        return f"p = {self.p:g}, j = {self.j:g}"


CASES = (
    Case("weak forcing, equal gaps", 0.55, 1.0),
    Case("weak forcing, one gap closed", 0.55, 0.0),
    Case("strong forcing, one gap closed", 1.7, 0.0),
)


def compute(case: Case, progress: Progress | None = None) -> Branch:
    """The response curve of one case, with stability and located bifurcations; `progress(fraction, text)` is called."""
    return frequency_response(case.system, omega=OMEGA, progress=progress)


def draw(curves: Sequence[Branch], folder: Path) -> list[Path]:
    """Two figures in `folder`, PNG: weak forcing with its two cases side by side, and strong forcing."""
    weak, strong = folder / "weak_forcing.png", folder / "strong_forcing.png"
    titles = [f"({letter}) {case}" for letter, case in zip("ab", CASES, strict=False)]
    plot_panels(curves[:2], weak, titles=titles[: len(curves)])
    if len(curves) < len(CASES):
        return [weak]
    plot(curves[2], strong, title=str(CASES[2]))
    return [weak, strong]


def sequel(weak: Branch, strong: System, folder: Path, progress: Progress | None = None) -> list[tuple[str, Path]]:
    """What hides beside the response curves: sentences, each with its figure in `folder`.

    The branches that leave the response of the `strong`ly forced system at its period doublings; the border of the
    first ones of the `weak` response over the frequency and the gap, with the curve of limit points that begins on it;
    and, off that border, a resonance of twice the period that no sweep meets. Ctrl-C, which the verbs end politely at,
    ends it.
    """
    cascade, boundary, hidden = (folder / f"{name}.png" for name in ("cascade", "boundary", "isola"))
    diagram = bifurcation_diagram(strong, omega=OMEGA, depth=2, progress=progress)
    diagram.plot(cascade)
    pass_on(diagram.interruption)
    leaving = f"p = 1.7, j = 0: {len(diagram) - 1} branches leave the response"

    gaps: dict[str, Any] = {"parameter": "j", "bounds": (0.0, 1.0), "progress": progress}
    border = track(weak.bifurcations["PD"][0], **gaps)
    pass_on(border.interruption)
    limits = track(border.bifurcations["GPD"][-1], **gaps)
    pass_on(limits.interruption)
    plot_boundaries([border, limits], boundary)
    highest, born = (max(e.parameter("j") for e in curve.extrema) for curve in (border, limits))

    fold = min(limits.orbits, key=lambda orbit: abs(orbit.values["j"] - 0.5))
    gap = fold.values["j"]
    isola = continue_branch(fold, "omega", OMEGA, progress=progress)
    response = frequency_response(weak.system.with_parameters({"j": gap}), omega=OMEGA, progress=progress)
    plot([response, isola], hidden, title=f"p = 0.55, j = {gap:.3f}")
    beside = f"an isolated resonance of twice the period hides beside it: at j = {gap:.3f}"
    return [
        (leaving, cascade),
        (f"p = 0.55: the response doubles its period for gaps up to j = {highest:.5f}", boundary),
        (f"up to j = {born:.5f} {beside}", hidden),
    ]


def run_demo(out: Path, json_wanted: bool = False) -> None:
    """The demonstration: three response curves, a table of their bifurcations on stdout, figures in `out`."""
    out.mkdir(parents=True, exist_ok=True)  # before the work: a folder that cannot be made is known now
    screen = console(quiet=json_wanted)
    screen.print(
        "An oscillator that rattles between two stops, at -1 and j:\n"
        "    x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)\n"
        f"zeta = 0.03, alpha = 0.16, Kc = 4.7, stops regularised with s = {REGULARIZATION:g};\n"
        f"omega from {OMEGA[0]:g} to {OMEGA[1]:g}.",
    )
    curves: list[Branch] = []
    for case in CASES:
        with bar(str(case)) as report:
            curve = compute(case, report)
        curves.append(curve)
        screen.print(f"\n{case}: {case.title}", style="bold")
        print_events(screen, event_lines(curve.to_xarray()))
        screen.print(f"{len(curve)} points in {curve.seconds:.2f} s; {curve.ended}.")
        if curve.interrupted:
            break
    screen.print()
    figures = draw(curves, out)
    for path in figures:
        screen.print(f"figure: {path}", soft_wrap=True)
    interrupted = curves[-1].interrupted
    if not interrupted:
        with bar("what hides beside them") as report:
            hidden = sequel(curves[1], CASES[2].system, out, report)
        for text, path in hidden:
            screen.print(f"\n{text}\nfigure: {path}", soft_wrap=True)
            figures.append(path)
    if json_wanted:
        listed = [
            {"p": case.p, "j": case.j, "points": len(curve), "seconds": curve.seconds, "ended": curve.ended}
            | {"events": [{"kind": event.kind, "omega": event.omega} for event in events_met(curve)]}
            for case, curve in zip(CASES, curves, strict=False)
        ]
        print(to_json({"ok": not interrupted, "curves": listed, "files": figures}))
    if interrupted:
        raise KeyboardInterrupt
