"""Names of a package that are listed in its stub, `__init__.pyi`, and loaded when they are first used."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module


def attached(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package whose stub imports its public names."""
    with open(file.removesuffix("c").removesuffix(".py") + ".pyi", encoding="utf-8") as stub:
        imports = [node for node in ast.walk(ast.parse(stub.read())) if isinstance(node, ast.ImportFrom)]
    places = {alias.name: node for node in imports for alias in node.names}
    listed = sorted(places)

    def loaded(name: str) -> object:
        if name not in places:
            raise AttributeError(f"{package} has no {name!r}{_meant(name, listed)}")
        node = places[name]
        start = f"{package}." if node.level else ""
        if node.module is None:
            return import_module(start + name)
        value = getattr(import_module(start + node.module), name)
        setattr(sys.modules[package], name, value)
        return value

    return loaded, lambda: listed, listed


def _meant(name: str, listed: list[str]) -> str:
    if name.startswith("_"):  # protocol probes of notebooks, copy, pickle: no search for a suggestion
        return ""
    from suboctave.errors import suggest

    return suggest(name, listed)
