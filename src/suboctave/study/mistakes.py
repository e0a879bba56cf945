"""What is wrong in a study file: every mistake with its line, all of them at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

from suboctave.errors import InputError, suggest

if TYPE_CHECKING:
    import pydantic

    from suboctave.study.lines import Lines, Path

__all__ = ["Mistake", "Mistakes", "StudyError", "written"]


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
        self._found: list[Mistake] = []

    def add(self, path: Path, message: str) -> None:
        """One mistake at the key `path`; the same one is noted once."""
        key = written(path)
        mistake = Mistake(_cut(key, 80), self.lines[path], _cut(message, 600))
        if mistake not in self._found:
            self._found.append(mistake)

    def add_validation(self, prefix: Path, error: pydantic.ValidationError, model: type[pydantic.BaseModel]) -> None:
        """What pydantic found in the table at `prefix`, which is a `model`, in our words."""
        for item in error.errors(include_url=False):
            path = (*prefix, *item["loc"])
            self.add(
                _shortened(path, self.lines, item["type"] == "missing"), _in_words(item, _keys(model, item["loc"]))
            )

    def __len__(self) -> int:
        return len(self._found)

    def __bool__(self) -> bool:
        return bool(self._found)

    @property
    def sorted(self) -> list[Mistake]:
        """In the order of the file."""
        return sorted(self._found, key=lambda mistake: mistake.line)

    def refuse(self) -> None:
        """Raises StudyError if there is any."""
        if self._found:
            raise StudyError(self.source, self.sorted)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]} ... {text[-most // 3 :]}"


def written(path: Path) -> str:
    """A path as a user reads it: analyses[0].omega."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _shortened(path: Path, lines: Lines, missing: bool) -> Path:
    """Without the names that pydantic gives to alternatives, which are no keys of the file."""
    kept: Path = ()
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
    said = str(item["msg"]).removeprefix("Input should be ").removeprefix("Value error, ")
    if kind in ("value_error", "assertion_error"):
        return said
    if kind in ("too_short", "too_long"):
        about, wanted = item["ctx"], item["ctx"].get("min_length", item["ctx"].get("max_length"))
        bound = "at least" if kind == "too_short" else "at most"
        return f"must have {bound} {wanted} item{'s' * (wanted != 1)}, not {about['actual_length']}"
    if kind == "union_tag_not_found":
        ways = "a text or a table" if "name_or_table" in str(item["ctx"]) else "a text, a table or a list"
        return f"must be {ways}, not {given!r}"
    if kind == "string_too_short":
        return "must not be empty"
    said = _WORDS.get(kind, said)
    shown = repr(given)
    return f"must be {said}, not {shown if len(shown) <= 60 else shown[:57] + '...'}"
