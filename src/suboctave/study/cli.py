"""The command line: `suboctave new`, `check`, `run`, `sweep`, `show`, `demo`, `compile`.

Everything heavy is imported when a command runs, so that `--help` and a mistyped option answer at once. Exit status: 0,
1 where a computation failed or a time limit ended it, 2 where the user's input is wrong, 130 after Ctrl-C. With
`--json` the answer is one JSON object on stdout, errors included.
"""

import gc
import io
import json
import shlex
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from suboctave.atomic import free_place
from suboctave.errors import InputError, NegativeDampingWarning, SuboctaveError, printable, suggest
from suboctave.interruption import Interruption
from suboctave.version import __version__

FAILED, WRONG, INTERRUPTED = 1, 2, 130  # 130 is what a shell reports after Ctrl-C


class Stopped(Exception):
    """Ctrl-C, where nothing was computed that could be shown."""


class _Commands(TyperGroup):
    """The commands; Ctrl-C comes through to `main`, which Typer would end without a word."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as cause:
            raise Stopped(str(cause)) from None


application = typer.Typer(
    name="suboctave",
    cls=_Commands,
    help="Response curves, stability and bifurcations of vibrating structures with nonlinear parts.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
_AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on stdout instead of text.")]
_AllowCode = Annotated[bool, typer.Option("--allow-code", help="Import and call the Python code that the file names.")]


def _version(wanted: bool) -> None:
    if wanted:
        print(f"suboctave {__version__}")
        raise typer.Exit


@application.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    pass


@application.command()
def new(
    path: Annotated[Path, typer.Argument(help="The file to write.")] = Path("study.toml"),
    example: Annotated[str, typer.Option(help="What to start from; --list names them.")] = "reference_oscillator",
    names: Annotated[bool, typer.Option("--list", help="Print the examples and stop.")] = False,
    overwrite: Annotated[bool, typer.Option(help="Replace a file that is there.")] = False,
    json_wanted: _AsJson = False,
) -> None:
    """Write a commented study file to start from."""
    from suboctave.atomic import replace_file
    from suboctave.study.screen import console, print_texts

    texts = examples()
    if names:
        known = {name: text.splitlines()[0].removeprefix("# ") for name, text in texts.items()}
        heads = ("example", "what it is")
        if not _answered(json_wanted, {"examples": known}):
            print_texts(console(), heads, list(known.items()), left=heads)
        return
    if example not in texts:
        raise InputError(f"there is no example {example!r}{suggest(example, texts)}")
    target = free_place(path, overwrite, (".toml",))
    text = texts[example].replace("THIS_FILE", printable(str(path)))
    replace_file(target, lambda place: place.write_text(text, encoding="utf-8"))
    if not _answered(json_wanted, {"file": target, "example": example}):
        console().print(f"{target} is written; run it: suboctave run {target}", soft_wrap=True)


def examples() -> dict[str, str]:
    """The study files that `new` writes, by name."""
    templates = (Path(__file__).parent / "templates").glob("*.toml")
    return {path.stem: path.read_text(encoding="utf-8") for path in sorted(templates)}


@application.command()
def check(
    study: Annotated[Path, typer.Argument(help="The study file.")],
    allow_code: _AllowCode = False,
    json_wanted: _AsJson = False,
) -> None:
    """Say everything that is wrong in a study file; nothing is run."""
    from suboctave.study.file import read_study
    from suboctave.study.screen import console

    checked = read_study(study, allow_code)
    names = [step.name for step in checked.steps]
    count = "1 analysis" if len(names) == 1 else f"{len(names)} analyses"
    if not _answered(json_wanted, {"analyses": names, "mistakes": []}):
        console().print(f"{study} is in order: {count}, outputs in {checked.folder}", soft_wrap=True)


@application.command()
def run(
    study: Annotated[Path, typer.Argument(help="The study file.")],
    out: Annotated[Path | None, typer.Option(help="Folder for what is written, in place of the study's.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace what an earlier run left there.")] = False,
    resume: Annotated[
        bool, typer.Option(help="Go on with a run that stopped; of a complete one, write what is missing.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(help="Time limit for all analyses together.")] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Serve a page of what is found, to this machine alone; Ctrl-C ends it.")
    ] = False,
    allow_code: _AllowCode = False,
    json_wanted: _AsJson = False,
) -> None:
    """Run a study: analyses in order, then results, tables and figures."""
    if watch and json_wanted:
        raise InputError("--watch is for a reader, --json for a program: leave one of them out")
    from suboctave.study.file import read_study

    read = read_study(study, allow_code)
    if not watch:
        _run(study, read, None, out, overwrite, resume, seconds, json_wanted)
        return
    from suboctave.study.screen import console
    from suboctave.study.served import served, show_in_browser
    from suboctave.study.watching import Watching

    watching = Watching(read, out if out is not None else read.folder)
    with served(watching.page) as address:
        console().print(f"what is found: {address}", soft_wrap=True)
        show_in_browser(address)
        try:
            _run(study, read, watching, out, overwrite, resume, seconds, json_wanted)
        except typer.Exit as status:
            if status.exit_code == INTERRUPTED:
                raise
            _wait(address)
            raise
        _wait(address)


def _wait(address: str) -> None:
    """The page of a run that is over stays until its reader has seen enough."""
    from suboctave.study.screen import console
    from suboctave.study.served import wait_for_ctrl_c

    console().print(f"the report stays at {address}: Ctrl-C ends it", soft_wrap=True)
    wait_for_ctrl_c()


@contextmanager
def _reporting(name: str, watching: Any) -> Iterator[Any]:
    """Whom an analysis reports to: a bar, and the page of who is `watching`."""
    from suboctave.progress import bar

    with bar(name) as shown:
        if watching is None:
            yield shown
            return
        watching.begin(name)
        yield watching.reporting(shown)


def _run(
    study: Path,
    read: Any,
    watching: Any,
    out: Path | None,
    overwrite: bool,
    resume: bool,
    seconds: float | None,
    json_wanted: bool,
) -> None:
    """Run a study that was read, with what it finds on the terminal, and on a page for who is `watching`."""
    from suboctave.study.runner import Finished, run_study
    from suboctave.study.screen import console
    from suboctave.study.shown import as_plain, print_result

    screen = console(quiet=json_wanted)
    kept: list[Any] = []  # of the whole run: analyses take it again

    def head() -> None:
        """Above the first analysis: what is refused before any work has no title."""
        if kept:
            return
        if read.title:
            screen.print(read.title, style="bold")
        kept.append(read.linear_part())
        if kept[0] is not None:
            screen.print(str(kept[0]), soft_wrap=True)

    def watch(step: Any) -> Any:
        head()
        return _reporting(step.name, watching)

    def report(item: Finished) -> None:
        head()
        if watching is not None:
            watching.note(item)
        if item.failure:
            screen.print(f"\n{item.step.name}", style="bold", end="")
            screen.print(f": failed. {item.failure}")
        if item.result is not None:
            note = ", taken from the earlier run" if item.reused else f" in {item.seconds:.2f} s"
            print_result(screen, item.step.name, item.result, note)

    outcome = run_study(read, out, overwrite, resume, watch, report, seconds)
    if watching is not None:
        watching.finish(outcome)
    if outcome.complete is not None:
        screen.print(f"nothing to compute: {outcome.complete} is complete", soft_wrap=True)
    elif outcome.files:
        screen.print()
    for file in outcome.files:
        screen.print(f"written: {file}", soft_wrap=True)
    if others := [file.name for file in outcome.left if file != outcome.complete]:
        text = f"left as they are: {', '.join(others)} (--resume --overwrite writes them again)"
        screen.print(text, soft_wrap=True)
    status = 0
    if outcome.interruption is not None:
        by_user = outcome.interruption == Interruption()
        status, how = (INTERRUPTED, "Go on") if by_user else (FAILED, "Give more seconds, and go on")
        why = f"{outcome.interruption}; what was computed is kept"
        screen.print(f"{why}. {how}: {_again(study, out, read.allow_code)}", soft_wrap=True)
    elif outcome.failed:
        status = WRONG if any(item.wrong_input for item in outcome.failed) else FAILED
        failed = ", ".join(item.step.name for item in outcome.failed)
        screen.print(f"failed: {failed}. Change the study, and go on with --resume")
    if json_wanted:
        analyses = [
            {"name": item.step.name, "type": item.step.kind, "seconds": item.seconds}
            | {"reused": item.reused, "failure": item.failure}
            | ({} if item.result is None else as_plain(item.result))
            for item in outcome.finished
        ]
        state = {"ok": status == 0, "status": status, "interrupted": outcome.interrupted}
        _answered(json_wanted, state | {"analyses": analyses, "files": outcome.files, "left": outcome.left})
    if status:
        raise typer.Exit(status)


def _again(study: Path, out: Path | None, allow_code: bool) -> str:
    """The command that goes on with a run."""
    words = ["suboctave", "run", str(study), *([] if out is None else ["--out", str(out)])]
    return shlex.join([*words, *["--allow-code"] * allow_code, "--resume"])


_Grid = Annotated[
    list[str] | None,
    typer.Option("--grid", help="NAME=FROM:TO:COUNT, NAME=FROM:TO:COUNT:log or NAME=1,2,5; once for each parameter."),
]
_Random = Annotated[
    list[str] | None,
    typer.Option(
        "--random",
        help="NAME=uniform:LOW:HIGH, NAME=normal:MEAN:DEVIATION, NAME=triangular:LOW:MODE:HIGH, ... (docs/sweeps.md); "
        "once for each parameter.",
    ),
]


@application.command("sweep")
def sweep_command(
    study: Annotated[Path, typer.Argument(help="The study file; its section sweep says what is not said here.")],
    grid: _Grid = None,
    random: _Random = None,
    points: Annotated[
        Path | None, typer.Option(help="A .csv file: a column for each parameter, a row a point.")
    ] = None,
    draws: Annotated[int | None, typer.Option(help="How many points are drawn from the distributions.")] = None,
    seed: Annotated[int | None, typer.Option(help="From which they are drawn.")] = None,
    sampling: Annotated[str | None, typer.Option(help='random, "latin hypercube" or sobol.')] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for what is written, in place of the study's.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; one for each core unless told.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="A Dask scheduler, tcp://HOST:8786, whose workers compute instead.")
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace what an earlier sweep left there.")] = False,
    resume: Annotated[bool, typer.Option(help="Go on with a sweep that stopped.")] = False,
    seconds: Annotated[float | None, typer.Option(help="Time limit of the sweep.")] = None,
    allow_code: _AllowCode = False,
    json_wanted: _AsJson = False,
) -> None:
    """Run a study at many values of its parameters: a grid, a list or random tolerances."""
    from suboctave.study.file import read_study
    from suboctave.study.outputs import make_folder
    from suboctave.study.sweeps.given import parameters_of

    read = read_study(study, allow_code)
    asked = parameters_of(grid or (), random or (), points)
    folder = out if out is not None else read.folder
    make_folder(folder)
    others = [folder / f"sweep{suffix}" for suffix in (".csv", ".png", ".html")]
    for place in others if not (overwrite or resume) else ():
        free_place(place)
    options = {
        "draws": draws, "seed": seed, "sampling": sampling, "path": folder / "sweep.nc", "workers": workers,
        "scheduler": scheduler, "overwrite": overwrite, "resume": resume, "seconds": seconds,
    }  # fmt: skip
    _sweep(read, asked, options, others, json_wanted)


def _sweep(study: Any, asked: Any, options: dict[str, Any], others: list[Path], json_wanted: bool) -> None:
    """Run a sweep, print what came of it, and end with the exit status that says so."""
    from suboctave.pictures.report import write_report
    from suboctave.progress import bar
    from suboctave.study.screen import console
    from suboctave.study.shown import print_sweep, sweep_as_plain
    from suboctave.study.sweeps.verb import sweep

    with bar("sweep") as report:
        result = sweep(study, asked, progress=report, **options)
    table, picture, page = others
    files = [options["path"], result.to_csv(table, overwrite=True)]
    if len(result.failures) < len(result):
        result.plot(picture)
        write_report({"sweep": result}, page, title=result.title or "Sweep", overwrite=True)
        files += [picture, page]
    screen = console(quiet=json_wanted)
    print_sweep(screen, result)
    for file in files:
        screen.print(f"written: {file}", soft_wrap=True)
    status = 0
    if result.interruption is not None:
        status = INTERRUPTED if result.interruption == Interruption() else FAILED
        screen.print(f"{result.interruption}; what was computed is kept. Go on with the same command and --resume")
    elif len(result.failures) == len(result):
        status = FAILED
    _answered(json_wanted, {"ok": status == 0, "status": status, "files": files} | sweep_as_plain(result))
    if status:
        raise typer.Exit(status)


@application.command()
def show(
    path: Annotated[Path, typer.Argument(help="A results file (.nc), a study file (.toml), or a journal.")],
    csv: Annotated[Path | None, typer.Option(help="Write the tables as .csv files into this folder.")] = None,
    page: Annotated[
        bool, typer.Option("--page", help="Serve the report page of a results file, to this machine alone.")
    ] = False,
    overwrite: Annotated[bool, typer.Option(help="Replace .csv files that are there.")] = False,
    allow_code: _AllowCode = False,
    json_wanted: _AsJson = False,
) -> None:
    """Print what a results file holds, or what a study file would run."""
    from suboctave.study.runner import JOURNAL

    if path.is_dir():
        raise InputError(f"{path} is a folder; name the results file in it, or the study file")
    is_study, is_journal = path.suffix.lower() == ".toml", path.suffix == Path(JOURNAL).suffix
    if csv is not None and (is_study or is_journal):
        raise InputError("--csv writes the tables of a results file; this is none")
    if page and (is_study or is_journal):
        raise InputError("--page shows a results file; this is none: `suboctave run --watch` shows a study that runs")
    if page and json_wanted:
        raise InputError("--page is for a reader, --json for a program: leave one of them out")
    if page:
        _show_page(path, allow_code)
        return
    if is_study:
        _show_study(path, allow_code, json_wanted)
    elif is_journal:
        _show_journal(path, json_wanted)
    else:
        _show_results(path, csv, overwrite, allow_code, json_wanted)


def _show_page(path: Path, allow_code: bool) -> None:
    """Serve the page of a results file until Ctrl-C."""
    from suboctave.pictures.report import page_of
    from suboctave.study.results import Results, load
    from suboctave.study.screen import console
    from suboctave.study.served import served, show_in_browser, wait_for_ctrl_c

    results, called = load(path, allow_code=allow_code), printable(path.stem)
    shown = results if isinstance(results, Results) else {called: results}
    if not len(shown):
        raise InputError(f"{path} holds nothing that a page could show")
    title = str(results.attributes.get("title") or called) if isinstance(results, Results) else called
    text = page_of(shown, title)
    with served(lambda: text) as address:
        console().print(f"{address} shows {path} to this machine alone; Ctrl-C ends it", soft_wrap=True)
        show_in_browser(address)
        wait_for_ctrl_c()


def _show_results(path: Path, csv: Path | None, overwrite: bool, allow_code: bool, json_wanted: bool) -> None:
    from suboctave.study.outputs import write_tables
    from suboctave.study.results import Result, Results, load
    from suboctave.study.screen import console
    from suboctave.study.shown import as_plain, print_result
    from suboctave.study.sweeps.result import Sweep

    results = load(path, allow_code=allow_code)
    if isinstance(results, Sweep):
        _show_sweep(path, results, csv, overwrite, json_wanted)
        return
    if not isinstance(results, Results):
        results = Results({printable(path.stem): results if isinstance(results, Result) else results.to_table()})
    written = write_tables(results, csv, overwrite) if csv is not None else []
    listed = {name: as_plain(item) for name, item in results.items()} if json_wanted else {}
    if _answered(json_wanted, {"attributes": results.attributes, "analyses": listed, "files": written}):
        return
    screen, origin = console(), results.attributes
    if origin.get("title"):
        screen.print(str(origin["title"]), style="bold")
    if "written" in origin:
        screen.print(f"suboctave {origin.get('suboctave')}, {origin['written']}")
    for name, item in results.items():
        seconds = results.details.get(name, {}).get("seconds")
        print_result(screen, name, item, f" in {seconds:.2f} s" if seconds is not None else "")
    for file in written:
        screen.print(f"written: {file}", soft_wrap=True)


def _show_sweep(path: Path, result: Any, csv: Path | None, overwrite: bool, json_wanted: bool) -> None:
    from suboctave.study.outputs import make_folder
    from suboctave.study.screen import console
    from suboctave.study.shown import print_sweep, sweep_as_plain

    files = []
    if csv is not None:
        make_folder(csv)
        files.append(result.to_csv(csv / f"{path.stem}.csv", overwrite))
    if not _answered(json_wanted, sweep_as_plain(result) | {"files": files}):
        screen = console()
        print_sweep(screen, result)
        for file in files:
            screen.print(f"written: {file}", soft_wrap=True)


def _show_study(path: Path, allow_code: bool, json_wanted: bool) -> None:
    from suboctave.study.file import read_study
    from suboctave.study.screen import console
    from suboctave.study.sweeps.plan import swept

    study = read_study(path, allow_code)
    given = {step.name: step.model_dump(mode="json", exclude_unset=True) for step in study.steps}
    head = {"title": study.title, "system": repr(study.system), "out": study.folder}
    steps = [{"name": step.name, "type": step.kind, "arguments": given[step.name]} for step in study.steps]
    if _answered(json_wanted, head | {"analyses": steps}):
        return
    screen = console()
    screen.print(study.title or study.called, style="bold")
    screen.print(repr(study.system))
    screen.print("\nanalyses", style="bold")
    for step in study.steps:
        arguments = (f"{k} = {_written(v)}" for k, v in given[step.name].items() if k not in ("name", "type"))
        screen.print(f"  {step.name}: {step.kind}({', '.join(arguments)})")
    if study.sweep is not None:
        screen.print(f"\nsweep over {', '.join(swept(study.sweep))}: suboctave sweep {path}", soft_wrap=True)
    screen.print(f"\noutputs in {study.folder}", soft_wrap=True)


def _written(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_written(v)}" for k, v in value.items() if v not in (None, 0)) + "}"
    return json.dumps(value)


def _show_journal(path: Path, json_wanted: bool) -> None:
    from suboctave.store.journal import read_journal
    from suboctave.study.runner import recovered
    from suboctave.study.screen import console, print_texts, significant

    kinds = [record.kind for record in read_journal(path)]
    if "sweep" in kinds:
        points = kinds.count("point")
        if not _answered(json_wanted, {"points": points}):
            text = f"the journal of a sweep that did not finish, {points} point{'s' * (points != 1)} computed"
            console().print(f"{text}; `suboctave sweep ... --resume` goes on with it", soft_wrap=True)
        return
    analyses = recovered(path)
    if _answered(json_wanted, {"analyses": [asdict(item) for item in analyses]}):
        return
    screen = console()
    screen.print("the journal of a run that did not finish; `suboctave run ... --resume` goes on with it")
    names = ("analysis", "state", "points", "bifurcations", "branches")
    rows = [(a.name, a.state, str(a.points), str(a.bifurcations), str(a.branches or "")) for a in analyses]
    print_texts(screen, names, rows, left=("analysis", "state"))
    for item in analyses:
        if item.events:
            screen.print(f"{item.name}, so far", style="bold")
            lines = [[kind, significant(omega, 9), significant(amplitude, 7)] for kind, omega, amplitude in item.events]
            print_texts(screen, ("kind", "omega", "max |x|"), lines, left=("kind",))


def _answered(json_wanted: bool, content: dict[str, Any]) -> bool:
    """Print what a command has to say as one JSON object, where that is wanted; whether it was."""
    if json_wanted:
        from suboctave.study.shown import to_json

        print(to_json({"ok": True} | content))
    return json_wanted


@application.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for the figures; made where it is missing.")] = Path("demo"),
    json_wanted: _AsJson = False,
) -> None:
    """Compute and draw the response of an oscillator that rattles between two stops."""
    from suboctave.study.demo import run_demo

    run_demo(out, json_wanted)


@application.command("compile")
def compile_command() -> None:
    """Compile all numerical kernels into the cache, once after an installation: about a minute."""
    from time import monotonic

    from suboctave.progress import bar
    from suboctave.study.compilation import compile_all

    begin = monotonic()
    with bar("compiling") as report:
        count = compile_all(report)
    print(f"{count} kernels compiled in {monotonic() - begin:.0f} s" if count else "all kernels are compiled")


def main() -> None:
    """Runs the command line. A failure is one readable message and an exit status, never a traceback."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files need not be UTF-8
        sys.stdout.reconfigure(errors="backslashreplace")
    # little of what is made here is garbage that only the collector finds: it took a tenth of a short run
    gc.set_threshold(50_000, 20, 20)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("once", NegativeDampingWarning)
            warnings.showwarning = partial(_note, warnings.showwarning)
            application()
    except (KeyboardInterrupt, Stopped) as cause:
        print(_readable(f"interrupted {cause}".rstrip()), file=sys.stderr)
        sys.exit(INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has gone
        sys.stdout = None
        sys.exit(0)
    except (SuboctaveError, OSError) as error:
        status = WRONG if isinstance(error, InputError | OSError) else FAILED
        message = str(error)
        if isinstance(error, OSError) and error.strerror and error.filename is not None:
            message = f"{error.filename}: {error.strerror}; nothing was changed there"
        if "--json" in sys.argv[1:]:
            listed = [{"key": m.key, "line": m.line, "message": m.message} for m in getattr(error, "mistakes", ())]
            answer = {"ok": False, "status": status, "message": message, "mistakes": listed}
            print(json.dumps(answer, ensure_ascii=False))
        else:
            print(_readable(f"suboctave: {message}"), file=sys.stderr)
        sys.exit(status)


def _note(usual: Any, message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
    """A warning of a system is a note to the reader of a study, who has no line of Python to look at."""
    if category is NegativeDampingWarning:
        print(_readable(f"note: {str(message).split(' If this')[0]}"), file=sys.stderr)
    else:
        usual(message, category, *place, **more)


def _readable(text: str) -> str:
    """Broken into lines between words where somebody reads it; for other programs a line stays a line."""
    if not sys.stderr.isatty():
        return text
    import shutil
    from textwrap import TextWrapper

    width = min(80, shutil.get_terminal_size().columns)
    wrapper = TextWrapper(width, subsequent_indent=" " * 6, break_long_words=False, break_on_hyphens=False)
    return "\n".join(map(wrapper.fill, text.splitlines()))
