"""The demonstration: response curves of an oscillator that rattles between two stops.

`x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)`, two stops at -1 and j, in the regularised form with
s = 3000, for the three cases of Figs 6 and 7 of Alcorta, Baguet, Prabel, Piteau, Jacquet-Richardet, Nonlinear Dynamics
98 (2019): weak forcing with equal gaps, weak forcing with one gap closed, strong forcing with one gap closed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from suboctave.analysis.branches import continue_branch, frequency_response
from suboctave.analysis.diagram import bifurcation_diagram
from suboctave.analysis.track import track
from suboctave.model import System, library
from suboctave.pictures import plot_boundaries, plot_panels, plot_response
from suboctave.progress import bar
from suboctave.results.branch import Branch
from suboctave.store.layout import events_met
from suboctave.study.screen import console, event_lines, print_events
from suboctave.study.shown import to_json

if TYPE_CHECKING:
    import xarray

OMEGA = (4.5, 1.25)
REGULARIZATION = 3000.0

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Case:
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


@dataclass(frozen=True)
class Curve:
    """A case with its computed curve, and the seconds that it took."""

    case: Case
    branch: Branch
    seconds: float

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The curve as pictures and tables take it."""
        return self.branch.to_xarray()


CASES = (
    Case("weak forcing, equal gaps", 0.55, 1.0),
    Case("weak forcing, one gap closed", 0.55, 0.0),
    Case("strong forcing, one gap closed", 1.7, 0.0),
)


def compute(case: Case, progress: Progress | None = None) -> Curve:
    """The response curve of one case, with stability and located bifurcations; `progress(fraction, text)` is called."""
    begin = perf_counter()
    branch = frequency_response(case.system, omega=OMEGA, progress=progress)
    return Curve(case, branch, perf_counter() - begin)


def draw(curves: Sequence[Curve], folder: Path) -> list[Path]:
    """Two figures in `folder`, PNG: weak forcing with its two cases side by side, and strong forcing."""
    weak = [curve for curve in curves if curve.case.p < 1.0]
    files = [folder / "weak_forcing.png"]
    titles = [f"({letter}) {curve.case}" for letter, curve in zip("ab", weak, strict=False)]
    plot_panels([curve.dataset for curve in weak], files[0], titles=titles)
    for strong in curves[len(weak) :]:
        files.append(folder / "strong_forcing.png")
        plot_response(strong.dataset, files[-1], title=str(strong.case))
    return files


def sequel(weak: Branch, strong: System, folder: Path, progress: Progress | None = None) -> list[tuple[str, Path]]:
    """What hides beside the response curves: sentences, each with its figure in `folder`.

    The branches that leave the response of the `strong`ly forced system at its period doublings; the border of the
    first ones of the `weak` response over the frequency and the gap, with the curve of limit points that begins on it;
    and, off that border, a resonance of twice the period that no sweep meets.
    """

    def whole(result: Any) -> Any:
        """Ctrl-C, which the verbs end politely at, ends the demonstration too."""
        if result.interrupted:
            raise KeyboardInterrupt
        return result

    beside: list[tuple[str, Path]] = []
    diagram = bifurcation_diagram(strong, omega=OMEGA, depth=2, progress=progress)
    count = len(diagram) - 1
    beside.append((f"p = 1.7, j = 0: {count} branches leave the response", folder / "cascade.png"))
    diagram.plot(beside[-1][1])
    whole(diagram)

    gaps: dict[str, Any] = {"parameter": "j", "bounds": (0.0, 1.0), "progress": progress}
    border = whole(track(weak.bifurcations["PD"][0], **gaps))
    limits = whole(track(border.bifurcations["GPD"][-1], **gaps))
    highest = max(e.parameter("j") for e in border.extrema)
    text = f"p = 0.55: the response doubles its period for gaps up to j = {highest:.5f}"
    beside.append((text, folder / "boundary.png"))
    plot_boundaries([border.to_xarray(), limits.to_xarray()], beside[-1][1])

    fold = min(limits.orbits, key=lambda orbit: abs(orbit.values["j"] - 0.5))
    gap = fold.values["j"]
    isola = continue_branch(fold, "omega", OMEGA, progress=progress)
    response = frequency_response(weak.system.with_parameters({"j": gap}), omega=OMEGA, progress=progress)
    born = max(e.parameter("j") for e in limits.extrema)
    text = f"up to j = {born:.5f} an isolated resonance of twice the period hides beside it: at j = {gap:.3f}"
    beside.append((text, folder / "isola.png"))
    plot_response([response.to_xarray(), isola.to_xarray()], beside[-1][1], title=f"p = 0.55, j = {gap:.3f}")
    return beside


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
        with bar(str(case)) as report:
            curve = compute(case, report)
        curves.append(curve)
        screen.print(f"\n{case}: {case.title}", style="bold", markup=False)
        print_events(screen, event_lines(curve.dataset))
        screen.print(f"{len(curve.branch)} points in {curve.seconds:.2f} s; {curve.branch.ended}.", markup=False)
        if curve.branch.interrupted:
            break
    interrupted = curves[-1].branch.interrupted
    screen.print()
    figures = list(draw(curves, out))
    for path in figures:
        screen.print(f"figure: {path}", markup=False, soft_wrap=True)
    if not interrupted:
        with bar("what hides beside them") as report:
            hidden = sequel(curves[1].branch, CASES[2].system, out, report)
        for text, path in hidden:
            screen.print(f"\n{text}\nfigure: {path}", markup=False, soft_wrap=True)
            figures.append(path)
    if json_wanted:
        listed = [
            {"p": c.case.p, "j": c.case.j, "points": len(c.branch), "seconds": c.seconds, "ended": c.branch.ended}
            | {"events": [{"kind": event.kind, "omega": event.omega} for event in events_met(c.branch)]}
            for c in curves
        ]
        print(to_json({"ok": not interrupted, "curves": listed, "files": figures}))
    if interrupted:
        raise KeyboardInterrupt
