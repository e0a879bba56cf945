"""The command line: `suboctave new`, `check`, `run`, `show`, `demo`, `compile`.

Everything heavy is imported when a command runs, so that `--help` and a mistyped option answer at once. Exit status: 0,
1 where a computation failed or a time limit ended it, 2 where the user's input is wrong, 130 after Ctrl-C. With
`--json` the answer is one JSON object on stdout, errors included.
"""

import json
import sys
import warnings
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from suboctave.errors import InputError, NegativeDampingWarning, SuboctaveError
from suboctave.version import __version__

__all__ = ["main"]

FAILED, WRONG, INTERRUPTED = 1, 2, 130  # 130 is what a shell reports after Ctrl-C


application = typer.Typer(
    name="suboctave",
    help="Response curves, stability and bifurcations of vibrating structures with nonlinear parts.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
_AS_JSON = typer.Option("--json", help="One JSON object on stdout instead of text.")
_ALLOW_CODE = typer.Option("--allow-code", help="Import and call the Python code that the file names.")


def _version(wanted: bool) -> None:
    if wanted:
        print(f"suboctave {__version__}")
        raise typer.Exit


@application.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop."),
    ] = False,
) -> None:
    pass


@application.command()
def new(
    path: Annotated[Path, typer.Argument(help="The file to write.")] = Path("study.toml"),
    example: Annotated[str, typer.Option(help="What to start from; --list names them.")] = "reference_oscillator",
    names: Annotated[bool, typer.Option("--list", help="Print the examples and stop.")] = False,
    overwrite: Annotated[bool, typer.Option(help="Replace a file that is there.")] = False,
    json_wanted: Annotated[bool, _AS_JSON] = False,
) -> None:
    """Write a commented study file to start from."""
    from suboctave.study import commands

    commands.new(path, example, names, overwrite, json_wanted)


@application.command()
def check(
    study: Annotated[Path, typer.Argument(help="The study file.")],
    allow_code: Annotated[bool, _ALLOW_CODE] = False,
    json_wanted: Annotated[bool, _AS_JSON] = False,
) -> None:
    """Say everything that is wrong in a study file; nothing is run."""
    from suboctave.study import commands

    commands.check(study, allow_code, json_wanted)


@application.command()
def run(
    study: Annotated[Path, typer.Argument(help="The study file.")],
    out: Annotated[Path | None, typer.Option(help="Folder for what is written, in place of the study's.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace what an earlier run left there.")] = False,
    resume: Annotated[
        bool, typer.Option(help="Go on with a run that stopped; of a complete one, write what is missing.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(help="Time limit for all analyses together.")] = None,
    allow_code: Annotated[bool, _ALLOW_CODE] = False,
    json_wanted: Annotated[bool, _AS_JSON] = False,
) -> None:
    """Run a study: analyses in order, then results, tables and figures."""
    from suboctave.study import commands

    status = commands.run(study, out, overwrite, resume, allow_code, json_wanted, seconds)
    if status:
        raise typer.Exit(status)


@application.command()
def show(
    path: Annotated[Path, typer.Argument(help="A results file (.nc), a study file (.toml), or a journal.")],
    csv: Annotated[Path | None, typer.Option(help="Write the tables as .csv files into this folder.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace .csv files that are there.")] = False,
    allow_code: Annotated[bool, _ALLOW_CODE] = False,
    json_wanted: Annotated[bool, _AS_JSON] = False,
) -> None:
    """Print what a results file holds, or what a study file would run."""
    from suboctave.study import commands

    commands.show(path, csv, overwrite, allow_code, json_wanted)


@application.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for the figures; made where it is missing.")] = Path("demo"),
    json_wanted: Annotated[bool, _AS_JSON] = False,
) -> None:
    """Compute and draw the response of an oscillator that rattles between two stops."""
    from suboctave.study.demo import run_demo

    run_demo(out, json_wanted)


@application.command("compile")
def compile_command() -> None:
    """Compile all numerical kernels into the cache, once after an installation: some tens of seconds."""
    from suboctave.progress import bar
    from suboctave.study.compilation import compile_all

    with bar("compiling") as report:
        compile_all(report)


def main() -> None:
    """Runs the command line. A failure is one readable message and an exit status, never a traceback."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("once", NegativeDampingWarning)
            warnings.showwarning = partial(_note, warnings.showwarning)
            application()
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
            print(_readable(f"suboctave: {_sentence(error)}"), file=sys.stderr)
        sys.exit(status)


def _note(usual: Any, message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
    """A warning of a system is a note to the reader of a study, who has no line of Python to look at."""
    if category is NegativeDampingWarning:
        print(_readable(f"note: {str(message).split(' If this')[0]}"), file=sys.stderr)
    else:
        usual(message, category, *place, **more)


def _sentence(error: Exception) -> str:
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
    return {"ok": False, "status": status, "message": _sentence(error), "mistakes": listed}
