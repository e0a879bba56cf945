"""The command line: `suboctave new`, `check`, `run`, `show`, `demo`.

Everything heavy is imported when a command runs, so that `--help` and a mistyped option answer at once. Exit status: 0,
1 where a computation failed or a time limit ended it, 2 where the user's input is wrong, 130 after Ctrl-C. With
`--json` the answer is one JSON object on stdout, errors included.
"""

# No `from __future__ import annotations` here: typer reads the annotations below, which name what is imported lazily.

import json
import sys
import warnings
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from suboctave.errors import InputError, NegativeDampingWarning, SuboctaveError
from suboctave.version import __version__

if TYPE_CHECKING:
    import typer
    from rich.console import Console

    from suboctave.study.demo import Curve

__all__ = ["main"]

FAILED, WRONG, INTERRUPTED = 1, 2, 130  # 130 is what a shell reports after Ctrl-C


def main() -> None:
    """Runs the command line. A failure is one readable message and an exit status, never a traceback."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("once", NegativeDampingWarning)
            warnings.showwarning = partial(_note, warnings.showwarning)
            application()()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has gone
        sys.stdout = None
        sys.exit(0)
    except (SuboctaveError, OSError) as error:
        status = WRONG if isinstance(error, InputError | OSError) else FAILED
        if "--json" in sys.argv[1:]:
            print(json.dumps(_as_object(error, status), ensure_ascii=False))
        else:
            print(_readable(f"suboctave: {_said(error)}"), file=sys.stderr)
        sys.exit(status)


def _note(usual: Any, message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
    """A warning of a system is a note to the reader of a study, who has no line of Python to look at."""
    if category is NegativeDampingWarning:
        print(_readable(f"note: {str(message).split(' If this')[0]}"), file=sys.stderr)
    else:
        usual(message, category, *place, **more)


def _said(error: Exception) -> str:
    """A refusal of the operating system, without its number."""
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}; nothing was changed there"
    return str(error)


def _readable(text: str) -> str:
    """Broken into lines between words where somebody reads it; for other programs a line stays a line."""
    if not sys.stderr.isatty():
        return text
    import shutil
    import textwrap

    width = min(80, shutil.get_terminal_size().columns)
    lines = text.splitlines()
    return "\n".join(
        textwrap.fill(line, width, subsequent_indent="      ", break_long_words=False, break_on_hyphens=False)
        for line in lines
    )


def _as_object(error: Exception, status: int) -> dict[str, Any]:
    mistakes = getattr(error, "mistakes", ())
    listed = [{"key": m.key, "line": m.line, "message": m.message} for m in mistakes]
    return {"ok": False, "status": status, "message": _said(error), "mistakes": listed}


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
    as_json = typer.Option("--json", help="One JSON object on stdout instead of text.")
    code = typer.Option("--allow-code", help="Import and call the Python code that the file names.")

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
    def new(
        path: Annotated[Path, typer.Argument(help="The file to write.")] = Path("study.toml"),
        example: Annotated[str, typer.Option(help="What to start from; --list names them.")] = "reference_oscillator",
        names: Annotated[bool, typer.Option("--list", help="Print the examples and stop.")] = False,
        overwrite: Annotated[bool, typer.Option(help="Replace a file that is there.")] = False,
        json_wanted: Annotated[bool, as_json] = False,
    ) -> None:
        """Write a commented study file to start from."""
        from suboctave.study import commands

        commands.new(path, example, names, overwrite, json_wanted)

    @app.command()
    def check(
        study: Annotated[Path, typer.Argument(help="The study file.")],
        allow_code: Annotated[bool, code] = False,
        json_wanted: Annotated[bool, as_json] = False,
    ) -> None:
        """Say everything that is wrong in a study file; nothing is run."""
        from suboctave.study import commands

        commands.check(study, allow_code, json_wanted)

    @app.command()
    def run(
        study: Annotated[Path, typer.Argument(help="The study file.")],
        out: Annotated[Path | None, typer.Option(help="Folder for what is written, in place of the study's.")] = None,
        overwrite: Annotated[bool, typer.Option(help="Replace what an earlier run left there.")] = False,
        resume: Annotated[
            bool, typer.Option(help="Go on with a run that stopped; of a complete one, write what is missing.")
        ] = False,
        seconds: Annotated[float | None, typer.Option(help="Time limit for all analyses together.")] = None,
        allow_code: Annotated[bool, code] = False,
        json_wanted: Annotated[bool, as_json] = False,
    ) -> None:
        """Run a study: analyses in order, then results, tables and figures."""
        from suboctave.study import commands

        status = commands.run(study, out, overwrite, resume, allow_code, json_wanted, seconds)
        if status:
            raise typer.Exit(status)

    @app.command()
    def show(
        path: Annotated[Path, typer.Argument(help="A results file (.nc), a study file (.toml), or a journal.")],
        csv: Annotated[Path | None, typer.Option(help="Write the tables as .csv files into this folder.")] = None,
        overwrite: Annotated[bool, typer.Option(help="Replace .csv files that are there.")] = False,
        allow_code: Annotated[bool, code] = False,
        json_wanted: Annotated[bool, as_json] = False,
    ) -> None:
        """Print what a results file holds, or what a study file would run."""
        from suboctave.study import commands

        commands.show(path, csv, overwrite, allow_code, json_wanted)

    @app.command()
    def demo(
        out: Annotated[Path, typer.Option(help="Folder for the figures; made where it is missing.")] = Path("demo"),
        json_wanted: Annotated[bool, as_json] = False,
    ) -> None:
        """Compute and draw the response of an oscillator that rattles between two stops."""
        run_demo(out, json_wanted)

    return app


def run_demo(out: Path, json_wanted: bool = False) -> None:
    """The demonstration: three response curves, a table of their bifurcations on stdout, figures in `out`."""
    from suboctave.analysis.progress import bar
    from suboctave.study import demo
    from suboctave.study.screen import console

    out.mkdir(parents=True, exist_ok=True)  # before the work: a folder that cannot be made is known now
    screen = console(quiet=json_wanted)
    screen.print(
        "An oscillator that rattles between two stops, at -1 and j:\n"
        "    x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)\n"
        f"zeta = 0.03, alpha = 0.16, Kc = 4.7, stops regularised with s = {demo.REGULARIZATION:g};\n"
        f"omega from {demo.OMEGA[0]:g} to {demo.OMEGA[1]:g}.",
        markup=False,
    )
    curves: list[Curve] = []
    for case in demo.CASES:
        with bar(f"p = {case.p:g}, j = {case.j:g}") as report:
            curve = demo.compute(case, report)
        curves.append(curve)
        _print_curve(screen, curve)
        if curve.interrupted:
            break
    screen.print()
    figures = list(demo.draw(curves, out))
    for path in figures:
        screen.print(f"figure: {path}", markup=False, soft_wrap=True)
    if not curves[-1].interrupted:
        with bar("what hides beside them") as report:
            hidden = demo.sequel(out, report)
        for text, path in hidden:
            screen.print(f"\n{text}\nfigure: {path}", markup=False, soft_wrap=True)
            figures.append(path)
    if json_wanted:
        found = [
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
        print(json.dumps({"ok": not curves[-1].interrupted, "curves": found, "files": [str(f) for f in figures]}))
    if curves[-1].interrupted:
        raise KeyboardInterrupt


def _print_curve(screen: "Console", curve: "Curve") -> None:
    from suboctave.study.demo import event_lines
    from suboctave.study.screen import print_events

    case, dataset = curve.case, curve.dataset
    screen.print(f"\np = {case.p:g}, j = {case.j:g}: {case.title}", style="bold", markup=False)
    print_events(screen, event_lines(dataset))
    screen.print(f"{dataset.sizes['point']} points in {curve.seconds:.2f} s; {dataset.attrs['ended']}.", markup=False)
