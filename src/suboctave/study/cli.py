"""The command line: `suboctave demo`, `suboctave --version`.

Everything heavy is imported when a command runs, so that `--help` and a mistyped option answer at once.
"""

# No `from __future__ import annotations` here: typer reads the annotations below, which name what is imported lazily.

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from suboctave.errors import SuboctaveError
from suboctave.version import __version__

if TYPE_CHECKING:
    import typer
    from rich.console import Console

    from suboctave.study.demo import Curve

__all__ = ["main"]

INTERRUPTED = 130  # what a shell reports after Ctrl-C
WIDTH = 80


def main() -> None:
    """Runs the command line. A failure is one readable message and an exit status, never a traceback."""
    try:
        application()()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    except (SuboctaveError, OSError) as error:
        print(f"suboctave: {error}", file=sys.stderr)
        sys.exit(1)


def application() -> "typer.Typer":
    """The commands, as a typer application."""
    import typer

    app = typer.Typer(
        name="suboctave",
        help="Response curves, stability and bifurcations of vibrating structures with nonlinear parts.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
    )

    def version(wanted: bool) -> None:
        if wanted:
            print(f"suboctave {__version__}")
            raise typer.Exit

    @app.callback()
    def options(
        _version: Annotated[
            bool,
            typer.Option("--version", callback=version, is_eager=True, help="Print the version and stop."),
        ] = False,
    ) -> None:
        pass

    @app.command()
    def demo(
        out: Annotated[Path, typer.Option(help="Folder for the figures; made where it is missing.")] = Path("demo"),
    ) -> None:
        """Compute and draw the response of an oscillator that rattles between two stops."""
        run_demo(out)

    return app


def run_demo(out: Path) -> None:
    """The demonstration: three response curves, a table of their bifurcations on stdout, figures in `out`."""
    from rich.console import Console

    from suboctave.study import demo

    out.mkdir(parents=True, exist_ok=True)  # before the work: a folder that cannot be made is known now
    console = Console(highlight=False, width=min(WIDTH, Console().width))
    console.print(
        "An oscillator that rattles between two stops, at -1 and j:\n"
        "    x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)\n"
        f"zeta = 0.03, alpha = 0.16, Kc = 4.7, stops regularised with s = {demo.REGULARIZATION:g};\n"
        f"omega from {demo.OMEGA[0]:g} to {demo.OMEGA[1]:g}.",
        markup=False,
    )
    curves: list[Curve] = []
    for case in demo.CASES:
        with _progress(f"p = {case.p:g}, j = {case.j:g}") as report:
            curve = demo.compute(case, report)
        curves.append(curve)
        _print_curve(console, curve)
        if curve.interrupted:
            break
    console.print()
    for path in demo.draw(curves, out):
        console.print(f"figure: {path}", markup=False, soft_wrap=True)
    if curves[-1].interrupted:
        raise KeyboardInterrupt


def _print_curve(console: "Console", curve: "Curve") -> None:
    from rich import box
    from rich.table import Table

    from suboctave.study.demo import event_lines

    case, dataset = curve.case, curve.dataset
    console.print(f"\np = {case.p:g}, j = {case.j:g}: {case.title}", style="bold", markup=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 2, 0, 0))
    for name in ("kind", "omega", "max |x|", "multiplier", "residual"):
        table.add_column(name, justify="left" if name == "kind" else "right", no_wrap=True)
    lines = event_lines(dataset)
    for line in lines:
        table.add_row(*line)
    if lines:
        console.print(table)
    else:
        console.print("no bifurcation")
    console.print(f"{dataset.sizes['point']} points in {curve.seconds:.2f} s; {dataset.attrs['ended']}.", markup=False)


@contextmanager
def _progress(name: str) -> Iterator[Any]:
    """A bar on stderr while a curve is computed, gone afterwards; silent where nobody watches."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=28),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[text]}"),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(name, total=1.0, text="")

        furthest = 0.0

        def report(fraction: float, text: str = "") -> None:
            nonlocal furthest  # a curve that folds back runs through its range again; a bar does not
            furthest = max(furthest, fraction)
            bar.update(task, completed=furthest, text=text)

        yield report
