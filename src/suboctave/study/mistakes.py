"""What is wrong in a study file: every mistake with its line, all of them at once.

`tomllib` reads values and forgets lines. `Lines` walks over a text that `tomllib` has accepted and notes the line of
every key, every element of an array and every table, arrays of tables included.
"""

from __future__ import annotations

import re
import tomllib
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, get_args

import pydantic

from suboctave.errors import InputError, Key, suggest


class Section(pydantic.BaseModel):
    """A table of a study file: no key but its own, each of its type."""

    # a study has few of all kinds of tables: what reads one is built when it is first read
    model_config = pydantic.ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True, defer_build=True)


@dataclass(frozen=True)
class Mistake:
    """One mistake: the key as a user would write it, its line (0: not in the file), and what to change."""

    key: str
    line: int
    message: str

    def __str__(self) -> str:
        place = f"line {self.line}: " if self.line else ""
        return place + (f"{self.key}: {self.message}" if self.key else self.message)


class StudyError(InputError):
    """A study file that is not run, and all that is wrong in it."""

    def __init__(self, source: str, mistakes: Sequence[Mistake]) -> None:
        self.source = source
        self.mistakes = tuple(mistakes)
        count = "1 mistake" if len(mistakes) == 1 else f"{len(mistakes)} mistakes"
        super().__init__(f"{source}: {count}; nothing was run\n" + "\n".join(f"  {m}" for m in mistakes))


class Mistakes:
    """Collects mistakes by the path of their keys."""

    def __init__(self, source: str, lines: Lines) -> None:
        self.source = source
        self.lines = lines
        self._mistakes: list[Mistake] = []

    def add(self, path: Key, message: str) -> None:
        """One mistake at the key `path`; the same one is noted once."""
        key = written(path)
        mistake = Mistake(_cut(key, 80), self.lines[path], _cut(message, 600))
        if mistake not in self._mistakes:
            self._mistakes.append(mistake)

    @contextmanager
    def at(self, *prefix: str | int) -> Iterator[None]:
        """Note the mistakes that an InputError of the block tells of, in the table at `prefix`."""
        try:
            yield
        except InputError as error:
            for part in error.parts:
                self.add((*prefix, *part.key), str(part))

    def add_validation(self, prefix: Key, error: pydantic.ValidationError, model: type[pydantic.BaseModel]) -> None:
        """What pydantic found in the table at `prefix`, which is a `model`, in our words."""
        for item in _of_nearest_reading(error.errors(include_url=False), prefix, self.lines):
            path = _shortened((*prefix, *item["loc"]), self.lines, item["type"] == "missing")
            self.add(path, _in_words(item, _keys(model, item["loc"])))

    def __len__(self) -> int:
        return len(self._mistakes)

    def refuse(self) -> None:
        """Raises StudyError if there is any, with all of them in the order of the file."""
        if self._mistakes:
            raise StudyError(self.source, sorted(self._mistakes, key=lambda mistake: mistake.line))


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]} ... {text[-most // 3 :]}"


def written(path: Key) -> str:
    """A path as a user reads it: analyses[0].omega."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _of_nearest_reading(errors: Sequence[Any], prefix: Key, lines: Lines) -> list[Any]:
    """What pydantic found, of a value that may be one of several things only what is wrong with it as the one that it
    is nearest to: of which fewest parts are of the wrong type.
    """
    readings: dict[Key, dict[str, list[Any]]] = {}
    for item in errors:
        place = item["loc"][:-1] if item["type"] == "missing" else item["loc"]
        # names that pydantic gives to alternatives are no keys of the file
        depth = next((i for i in range(1, len(place)) if _names_reading(place, i, prefix, lines)), len(place))
        name = str(place[depth]) if depth < len(place) else ""
        readings.setdefault(tuple(place[:depth]), {}).setdefault(name, []).append(item)
    kept: list[Any] = []
    for alternatives in readings.values():
        plain = alternatives.pop("", [])
        nearest = min(alternatives.values(), key=_misfit, default=[])
        kept += plain + nearest
    return kept


def _names_reading(place: Sequence[str | int], i: int, prefix: Key, lines: Lines) -> bool:
    return isinstance(place[i], str) and (*prefix, *place[: i + 1]) not in lines


def _misfit(errors: Sequence[Any]) -> tuple[int, int]:
    """How many parts are of the wrong type, and how many are wrong."""
    return sum(item["type"].endswith("_type") for item in errors), len(errors)


def _shortened(path: Key, lines: Lines, missing: bool) -> Key:
    """Without the names that pydantic gives to alternatives, which are no keys of the file."""
    kept: Key = ()
    for i, part in enumerate(path):
        if isinstance(part, int) or (*kept, part) in lines or i == 0:
            kept = (*kept, part)
    # a key that is missing is not in the file, and still part of the path
    return (*kept, path[-1]) if missing and kept[-1:] != path[-1:] else kept


def _keys(model: type[pydantic.BaseModel], place: Sequence[str | int]) -> list[str]:
    """The keys of the table in which the key at `place` stands: of the model, or of a table inside it."""
    fields = model.model_fields
    if len(place) < 2 or place[0] not in fields:
        return list(fields)
    inner = list(_models(fields[str(place[0])].annotation))
    return [name for table in inner for name in table.model_fields]


def _models(annotation: Any) -> Iterator[type[pydantic.BaseModel]]:
    if hasattr(annotation, "model_fields"):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)


#: what pydantic calls otherwise than TOML does
_WORDS = {
    "string_type": "a text",
    "list_type": "a list",
    "dict_type": "a table",
    "float_type": "a number",
    "int_type": "a whole number",
    "model_type": "a table",
}


def _in_words(item: Any, known: list[str]) -> str:
    kind, given = item["type"], item.get("input")
    if kind == "extra_forbidden":
        return f"there is no such key{suggest(str(item['loc'][-1]), known)}"
    if kind == "missing":
        return "is missing"
    text = str(item["msg"]).removeprefix("Input should be ").removeprefix("Value error, ")
    if kind in ("value_error", "assertion_error"):
        return text
    if kind in ("too_short", "too_long"):
        about, wanted = item["ctx"], item["ctx"].get("min_length", item["ctx"].get("max_length"))
        bound = "at least" if kind == "too_short" else "at most"
        return f"must have {bound} {wanted} item{'s' * (wanted != 1)}, not {about['actual_length']}"
    if kind == "union_tag_not_found":
        return f"must be a text, a table or a list, not {given!r}"
    if kind == "string_too_short":
        return "must not be empty"
    text = _WORDS.get(kind, text)
    shown = repr(given)
    return f"must be {text}, not {shown if len(shown) <= 60 else shown[:57] + '...'}"


# -------------------------------------------------------------------------------------------------------------- lines
#: blanks and comments; texts of one and of several lines; marks; everything else that stands together
_TOKEN = re.compile(
    r"""(?P<blank>[ \t\r]+|\#[^\n]*)
    |\"{3}(?:\\.|[^\\])*?\"{3,5}|'{3}.*?'{3,5}
    |\"(?:\\.|[^"\\])*\"|'[^']*'
    |[\[\]{},=.\n]
    |[^\s\[\]{},=."'#]+""",
    re.VERBOSE | re.DOTALL,
)


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    """What a TOML text consists of, each part with its line."""
    line = 1
    for match in _TOKEN.finditer(text):
        if match.lastgroup != "blank":
            yield match[0], line
        line += match[0].count("\n")


class Lines(dict[Key, int]):
    """The lines (from 1) of the keys of a TOML text; of a key that it does not have that of what it would stand in."""

    def __init__(self, text: str) -> None:
        super().__init__({(): 1})
        self._tokens = deque(_tokens(text))
        with suppress(IndexError, RecursionError):  # what stands before it is still right
            self._walk()

    def __missing__(self, path: Key) -> int:
        return self[path[:-1]]

    def _passed(self, mark: str) -> bool:
        """Whether this mark comes next, which is passed then."""
        here = self._tokens[0][0] == mark
        if here:
            self._tokens.popleft()
        return here

    def _next(self) -> int:
        """The line of what comes next, past the ends of lines."""
        while self._passed("\n"):
            pass
        return self._tokens[0][1]

    def _walk(self) -> None:
        table: Key = ()
        counts: dict[Key, int] = {}
        while True:
            line = self._next()
            if not self._passed("["):
                self._pair(table)
                continue
            is_array = self._passed("[")
            table, keys = (), self._key("]")
            for place, key in enumerate(keys, 1):
                table = (*table, key)
                if is_array and place == len(keys):
                    self._tokens.popleft()
                    self.setdefault(table, line)
                    counts[table] = counts.get(table, -1) + 1
                if table in counts:  # the name of an array of tables means its last table
                    table = (*table, counts[table])
            self.setdefault(table, line)

    def _pair(self, table: Key) -> None:
        line = self._tokens[0][1]
        for key in self._key("="):
            table = (*table, key)
            self.setdefault(table, line)
        self._value(table)

    def _key(self, end: str) -> list[str]:
        """A dotted key, up to the mark `end`."""
        parts = []
        while not self._passed(end):
            part, _ = self._tokens.popleft()
            if part != ".":
                parts.append(next(iter(tomllib.loads(f"{part} = 0"))))
        return parts

    def _value(self, path: Key) -> None:
        if self._passed("["):
            index = 0
            while self._more("]"):
                self.setdefault((*path, index), self._tokens[0][1])
                self._value((*path, index))
                index += 1
        elif self._passed("{"):
            while self._more("}"):
                self._pair(path)
        else:
            while self._tokens and self._tokens[0][0] not in (",", "]", "}", "\n"):
                self._tokens.popleft()

    def _more(self, end: str) -> bool:
        """Past a comma; False at the end of an array or inline table, which is passed too."""
        self._next()
        if self._passed(","):
            self._next()
        return not self._passed(end)
