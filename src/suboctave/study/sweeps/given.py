"""What `suboctave sweep` is given on the command line, as the parameters of a sweep."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from suboctave.errors import InputError, suggest
from suboctave.study.sweeps.plan import DISTRIBUTIONS


def parameters_of(grid: Iterable[str], random: Iterable[str], points: Path | None) -> Any:
    """The parameters that options give: `gap=0.1:0.3:11`, `Kc=4,5`, `gap=normal:0.5:0.02`, a table of points; or None.

    Raises InputError for what cannot be read.
    """
    given: dict[str, Any] = {}
    for option, read, texts in (("--grid", _values, grid), ("--random", _distribution, random)):
        for text in texts:
            name, mark, value = text.partition("=")
            if not mark or not name.strip() or not value.strip():
                raise InputError(f"{option} {text}: give NAME=..., see suboctave sweep --help")
            if name.strip() in given:
                raise InputError(f"{option} {text}: {name.strip()} is given twice")
            given[name.strip()] = read(f"{option} {text}", value.strip())
    if points is None:
        return given or None
    if given:
        raise InputError("--points names all parameters: leave --grid and --random out")
    return _points(points)


def _values(where: str, text: str) -> Any:
    """FROM:TO:COUNT, FROM:TO:COUNT:log, or numbers between commas."""
    parts = text.split(":")
    if len(parts) == 1:
        return [_number(where, part) for part in text.split(",")]
    if len(parts) not in (3, 4) or not parts[2].strip().isdecimal():
        raise InputError(f"{where}: give FROM:TO:COUNT, FROM:TO:COUNT:log, or values between commas")
    spacing = {"spacing": parts[3].strip()} if len(parts) == 4 else {}
    first, last = (_number(where, part) for part in parts[:2])
    return {"from": first, "to": last, "count": int(parts[2]), **spacing}


def _distribution(where: str, text: str) -> Any:
    """KIND:NUMBER:NUMBER..., or one number."""
    kind, *numbers = text.split(":")
    if not numbers:
        return _number(where, kind)
    kind = kind.strip().replace("_", " ").replace("-", " ")
    if kind not in DISTRIBUTIONS:
        raise InputError(f"{where}: there is no distribution {kind!r}{suggest(kind, DISTRIBUTIONS)}")
    wanted = DISTRIBUTIONS[kind]
    if len(numbers) != len(wanted):
        raise InputError(f"{where}: give {kind}:{':'.join(word.upper() for word in wanted)}")
    values = (_number(where, number) for number in numbers)
    return {"distribution": kind, **dict(zip(wanted, values, strict=True))}


def _number(where: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{where}: {text.strip()!r} is no number") from None


def _points(path: Path) -> list[dict[str, float]]:
    """The rows of a table of comma-separated values whose first line names the parameters."""
    import pandas

    try:
        frame = pandas.read_csv(path)
    except FileNotFoundError:
        raise InputError(f"--points {path}: there is no such file") from None
    except (OSError, ValueError) as error:  # no text, no table
        raise InputError(f"--points {path} is no table of comma-separated values: {error}") from None
    if frame.empty:
        raise InputError(f"--points {path}: the table has no rows below its names")
    return [{str(name).strip(): value for name, value in row.items()} for row in frame.to_dict("records")]
