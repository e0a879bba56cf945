"""The shape of the house: which room may import which, what an import costs, and that every public name is there."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import textwrap
from functools import cache
from pathlib import Path

import pytest

import suboctave

ROOT = Path(__file__).parents[1]
SOURCE = Path(suboctave.__file__).parent

# Data flows one way: a room imports from rooms before it in this list, and from itself.
ROOMS = [
    "model",
    "structures",
    "timedomain",
    "harmonic",
    "projection",
    "continuation",
    "floquet",
    "bifurcation",
    "curves",
    "store",
    "pictures",
    "results",
    "experiments",
    "analysis",
    "maps",
    "verification",
    "study",
]
# Modules beside the rooms: they belong to everybody and import nothing of ours but each other.
COMMON = {
    "arguments", "atomic", "compiled", "errors", "frontdoor", "interruption", "kinds", "lazy", "motion", "options",
    "progress", "readings", "session", "units", "version", "workers",
}  # fmt: skip
# Rooms that are kept even further apart than the order asks.
APART = {
    # Vibration-free: it follows any curve.
    "continuation": {"model", "timedomain", "harmonic"},
    # The witness knows no harmonic object, and nothing that it may have to contradict knows the witness.
    "harmonic": {"timedomain"},
    "floquet": {"timedomain"},
    "bifurcation": {"timedomain"},
    # Figures are drawn from datasets, whether they come from a live branch or from a file.
    "pictures": {"model", "timedomain", "harmonic", "continuation", "floquet", "bifurcation", "curves"},
    # Experiments in time follow no curve.
    "experiments": {"harmonic", "continuation", "floquet", "bifurcation", "curves", "results"},
}
HEAVY = ("numba", "sympy", "xarray", "pandas", "matplotlib", "plotly", "jinja2", "typer", "rich", "pydantic", "scipy")
HEAVY += ("numpy",)


def imported_rooms(path: Path) -> list[tuple[int, str]]:
    """(line, first name below suboctave) of every import in a file, those inside functions too."""
    package = ["suboctave", *path.relative_to(SOURCE).with_suffix("").parts[:-1]]
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), filename=str(path))):
        if isinstance(node, ast.Import):
            dotted = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            # `from suboctave import x` names the room only in x.
            dotted = [f"{module}.{alias.name}" for alias in node.names] if module == "suboctave" else [module]
        elif (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute | ast.Name)
            and (node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id)
            in {"import_module", "__import__"}
            and node.args
            and isinstance(node.args[0], ast.Constant)
        ):
            dotted = [str(node.args[0].value)]
        else:
            continue
        for name in dotted:
            parts = name.split(".")
            if parts[0] == "suboctave":
                found.append((node.lineno, parts[1] if len(parts) > 1 else ""))
    return found


def violations(room: str, path: Path) -> list[str]:
    allowed = set(ROOMS[: ROOMS.index(room) + 1]) - APART.get(room, set()) | COMMON
    return [
        f"{path.relative_to(SOURCE)}:{line} imports suboctave{'.' if target else ''}{target}"
        for line, target in imported_rooms(path)
        if target not in allowed
    ]


def modules_of(room: str) -> list[Path]:
    return sorted((SOURCE / room).rglob("*.py"))


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_from_rooms_above_it(room):
    wrong = [line for path in modules_of(room) for line in violations(room, path)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("text", "rooms"),
    [
        ("import suboctave.study.cli", ["study"]),
        ("def f():\n    from suboctave.analysis import Branch", ["analysis"]),
        ("from ..study import cli", ["study"]),
        ("from .. import analysis, study", ["analysis", "study"]),
        ("from suboctave import System", ["System"]),
        ("import importlib\nimportlib.import_module('suboctave.study')", ["study"]),
        ("import numpy", []),
    ],
)
def test_the_import_finder_sees_every_spelling(text, rooms, tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "SOURCE", tmp_path)
    (tmp_path / "model").mkdir()
    path = tmp_path / "model" / "element.py"
    path.write_text(text)
    assert [target for _, target in imported_rooms(path)] == rooms
    assert len(violations("model", path)) == len(rooms)  # a room below, or the package's front door: both refused


@cache
def imported_modules() -> dict[str, set[str]]:
    """The modules that each module imports, those inside functions and for type checkers too."""
    paths = {".".join(path.relative_to(SOURCE.parent).with_suffix("").parts): path for path in SOURCE.rglob("*.py")}
    modules = {name.removesuffix(".__init__"): path for name, path in paths.items()}
    imports: dict[str, set[str]] = {}
    for name, path in modules.items():
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        targets = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        for node in nodes:
            if isinstance(node, ast.ImportFrom) and node.module:
                full = (f"{node.module}.{alias.name}" for alias in node.names)
                targets |= {each if each in modules else node.module for each in full}
        imports[name] = (targets & modules.keys()) - {name}
    return imports


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_no_modules_of_a_room_import_each_other(room):
    imports = imported_modules()

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        waiting = [start]
        while waiting:
            new = imports[waiting.pop()] - seen
            seen |= new
            waiting += new
        return seen

    modules = [name for name in imports if name.split(".")[1:2] == [room]]
    assert modules
    assert not [name for name in modules if name in reached(name)]


def test_there_is_no_room_outside_the_list():
    found = {path.name for path in SOURCE.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert found <= set(ROOMS)
    files = {path.stem for path in SOURCE.glob("*.py")}
    assert files == COMMON | {"__init__", "__main__"}


def test_common_modules_import_nothing_of_the_rooms():
    for name in COMMON:
        assert {target for _, target in imported_rooms(SOURCE / f"{name}.py")} <= COMMON


def python(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_the_package_loads_nothing_heavy():
    loaded = python(f"""
        import sys, suboctave
        dir(suboctave), suboctave.__version__
        print(*[name for name in {HEAVY!r} if name in sys.modules])
    """)
    assert loaded.split() == []


@pytest.mark.parametrize("name", sorted(set(suboctave.__all__) - {"__version__"}))
def test_every_public_name_is_there_and_listed(name):
    assert name in dir(suboctave)
    value = getattr(suboctave, name)
    assert value is getattr(suboctave, name)
    assert getattr(value, "__doc__", None), f"{name} has no docstring"


def test_a_misspelt_name_gets_a_suggestion():
    with pytest.raises(AttributeError, match="did you mean 'frequency_response'"):
        suboctave.freqency_response  # noqa: B018
    assert not hasattr(suboctave, "_repr_html_")


def test_no_file_outgrows_reading():
    long = {path.name: lines for path in SOURCE.rglob("*.py") if (lines := len(path.read_text().splitlines())) > 600}
    assert not long


def test_no_folder_outgrows_a_shelf():
    crowded = {str(path) for path in SOURCE.rglob("*") if path.is_dir() and len(list(path.glob("*.py"))) > 25}
    assert not crowded


def test_no_function_outgrows_a_page():
    """Eighty lines and fifteen arguments at most."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    large = []
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, functions):
                arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                if node.end_lineno - node.lineno + 1 > 80 or len(arguments) > 15:
                    large.append(f"{path.relative_to(SOURCE)}:{node.lineno} {node.name}")
    assert not large


def test_the_guide_names_modules_that_are_there():
    """Paths in CONTRIBUTING.md, from the root or from src/suboctave; the function named beside a path is in it."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w./]+/[\w.]+\.py)`", text))
    assert len(named) > 20
    assert not [path for path in named if not any((base / path).exists() for base in (ROOT, SOURCE, SOURCE / "model"))]
    functions = re.findall(r"`([\w/]+\.py)` `(\w+)", text)
    assert len(functions) > 10
    for path, name in functions:
        assert re.search(rf"(def|class) {name}\b", (SOURCE / path).read_text(encoding="utf-8")), (path, name)
