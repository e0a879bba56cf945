"""The examples as pages: every script of examples/ is run while the site is built, with its figure and what it prints.

A script whose text and package are as they were at the last build is not run again. `SUBOCTAVE_DOCS_RUN=0` runs none:
the pages then show the scripts alone. The pages lie in docs/examples/, generated and not kept.
"""

from __future__ import annotations

import ast
import hashlib
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sphinx.util import logging

DOCS = Path(__file__).parents[1]
EXAMPLES = DOCS.parent / "examples"
PAGES = DOCS / "examples"
KEPT = DOCS / "_build" / "executed"
PROCESSES = 2  # scripts at once; each uses one core
TIME_LIMIT = 300  # seconds for one script: far above the slowest

log = logging.getLogger(__name__)

_INDEX = """# Examples

{pictures}

Each script asks one question, asserts one number with its source, and draws one figure. Figures and texts were made
when these pages were built. The scripts are in the folder `examples` of the repository; run one with
`python examples/ex01_rattling_oscillator.py figure.png`. The figures of a published study take longer. They are on
[a page of their own](../published_study.md) and are kept in the repository.

{rows}

```{{toctree}}
:hidden:

{names}
```
"""


def _digest_of_package() -> str:
    digest = hashlib.sha256()
    for path in sorted((DOCS.parent / "src" / "suboctave").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _run(script: Path, package: str) -> tuple[Path, str, str]:
    """(script, what it printed, what went wrong); its figure lies in KEPT."""
    figure, text = KEPT / f"{script.stem}.png", KEPT / f"{script.stem}.txt"
    digest = hashlib.sha256(script.read_bytes() + package.encode()).hexdigest()
    known = text.read_text(encoding="utf-8").split("\n", 1) if text.exists() else []
    if len(known) == 2 and known[0] == digest and figure.exists():
        return script, known[1], ""
    folders = [str(DOCS.parent / "src"), os.environ.get("PYTHONPATH", "")]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    changes = {"MPLBACKEND": "Agg", "PYTHONPATH": os.pathsep.join(filter(None, folders)), **threads}
    command = [sys.executable, str(script)]  # the figure has the script's name
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, env=os.environ | changes, cwd=KEPT, timeout=TIME_LIMIT, check=False
        )
    except subprocess.TimeoutExpired:
        return script, "", f"did not end within {TIME_LIMIT} s"
    if done.returncode:
        return script, done.stdout, done.stderr.strip().splitlines()[-1]
    text.write_text(f"{digest}\n{done.stdout}", encoding="utf-8")
    return script, done.stdout, ""


def _page(script: Path, printed: str, executed: bool) -> tuple[str, str]:
    """(title, page) of a script."""
    source = script.read_text(encoding="utf-8")
    title, _, rest = (ast.get_docstring(ast.parse(source)) or script.stem).partition("\n")
    rest = re.sub(r"(?m)^ +python ex\d.*$", "", rest).strip()
    title = title.strip().rstrip(".")
    parts = [f"# {title}", rest]
    if executed and (KEPT / f"{script.stem}.png").exists():
        parts.append(f"```{{image}} ../_build/executed/{script.stem}.png\n:alt: Figure drawn by the script\n```")
    if printed.strip():
        parts.append(f"It prints\n\n```text\n{printed.rstrip()}\n```")
    parts.append(f"The script, {{download}}`{script.name} <../../examples/{script.name}>`:")
    parts.append(f"```{{literalinclude}} ../../examples/{script.name}\n:language: python\n```")
    return title, "\n\n".join(part for part in parts if part) + "\n"


def make_pages(app) -> None:
    """Run what has to be run, and write the pages."""
    scripts = sorted(EXAMPLES.glob("ex*.py"))
    execute = os.environ.get("SUBOCTAVE_DOCS_RUN", "1") != "0"
    printed = dict.fromkeys(scripts, "")
    KEPT.mkdir(parents=True, exist_ok=True)
    if execute:
        package, began = _digest_of_package(), time.perf_counter()
        with ThreadPoolExecutor(PROCESSES) as pool:
            for script, text, wrong in pool.map(lambda one: _run(one, package), scripts):
                printed[script] = text
                if wrong:
                    log.warning("examples/%s failed: %s", script.name, wrong)
        log.info("examples: %d scripts in %.0f s", len(scripts), time.perf_counter() - began)
    PAGES.mkdir(exist_ok=True)
    rows, cells = [], []
    for script in scripts:
        title, page = _page(script, printed[script], execute)
        _write(PAGES / f"{script.stem}.md", page)
        rows.append(f"- [{title}]({script.stem}.md)")
        if execute and (KEPT / f"{script.stem}.png").exists():
            cells.append(f"[![{title}](../_build/executed/{script.stem}.png)]({script.stem}.md) {title}")
    names = "\n".join(script.stem for script in scripts)
    _write(PAGES / "index.md", _INDEX.format(pictures=_in_columns(cells), rows="\n".join(rows), names=names))


def _in_columns(cells: list[str]) -> str:
    """Pictures three in a row."""
    lines = [" | ".join(cells[i : i + 3] + [""] * (3 - len(cells[i : i + 3]))) for i in range(0, len(cells), 3)]
    return "\n".join(["| | | |", "|---|---|---|", *(f"| {line} |" for line in lines)]) if cells else ""


def _write(path: Path, text: str) -> None:
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def link_pages(app, docname: str, source: list[str]) -> None:
    """Links to scripts and files of the repository lead to the pages that are made of them."""
    up = "../" * docname.count("/")
    text = re.sub(r"\]\((?:\.\./)+examples/(ex\w+)\.py\)", rf"]({up}examples/\1.md)", source[0])
    text = re.sub(r"\]\((?:\.\./)+examples/?\)", f"]({up}examples/index.md)", text)
    source[0] = re.sub(r"\]\((?:\.\./)+CONTRIBUTING\.md", f"]({up}contributing.md", text)


def setup(app):
    app.connect("builder-inited", make_pages)
    app.connect("source-read", link_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
