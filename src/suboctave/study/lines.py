"""Where in a TOML text each key stands: a reader that knows places and nothing else.

`tomllib` reads values and forgets lines. This walks over a text that `tomllib` has accepted and notes the line of every
key, every element of an array and every table, arrays of tables included.
"""

from __future__ import annotations

from contextlib import suppress

__all__ = ["Lines", "Path"]

Path = tuple[str | int, ...]

_BLANK = " \t\r\n"


class Lines:
    """The lines (from 1) of the keys of a TOML text."""

    def __init__(self, text: str) -> None:
        self._places: dict[Path, int] = {(): 1}
        with suppress(IndexError, RecursionError):  # what was found up to here is still right
            _Walker(text, self._places).walk()

    def __getitem__(self, path: Path) -> int:
        """The line of a key, or of what it would stand in."""
        while path not in self._places:
            path = path[:-1]
        return self._places[path]

    def __contains__(self, path: Path) -> bool:
        return path in self._places


class _Walker:
    def __init__(self, text: str, places: dict[Path, int]) -> None:
        self.text = text + "\n"
        self.places = places
        self.at = 0
        self.line = 1
        self.counts: dict[Path, int] = {}

    def step(self, count: int = 1) -> None:
        self.line += self.text.count("\n", self.at, self.at + count)
        self.at += count

    def note(self, path: Path) -> None:
        self.places.setdefault(path, self.line)

    def blank(self, newlines: bool = True) -> None:
        """Past white space and comments."""
        while self.at < len(self.text):
            here = self.text[self.at]
            if here == "#":
                while self.text[self.at] != "\n":
                    self.at += 1
            elif here in _BLANK and (newlines or here != "\n"):
                self.step()
            else:
                return

    def walk(self) -> None:
        table: Path = ()
        while True:
            self.blank()
            if self.at >= len(self.text):
                return
            if self.text.startswith("[[", self.at):
                self.at += 2
                *front, last = self.key("]")
                path = (*self.inside(front), last)
                self.note(path)
                self.counts[path] = self.counts.get(path, -1) + 1
                table = (*path, self.counts[path])
                self.at += 2
                self.note(table)
            elif self.text[self.at] == "[":
                self.at += 1
                table = self.inside(self.key("]"))
                self.at += 1
                self.note(table)
            else:
                self.pair(table)

    def inside(self, keys: list[str]) -> Path:
        """The path of a header: a name of an array of tables means its last table."""
        path: Path = ()
        for key in keys:
            path = (*path, key)
            if path in self.counts:
                path = (*path, self.counts[path])
        return path

    def pair(self, table: Path) -> None:
        path = table
        start = self.line
        for key in self.key("="):
            path = (*path, key)
            self.places.setdefault(path, start)
        self.at += 1
        self.value(path)

    def key(self, end: str) -> list[str]:
        """A dotted key, up to the character `end`."""
        parts: list[str] = []
        while True:
            self.blank(newlines=False)
            here = self.text[self.at]
            if here == end:
                return parts
            if here == ".":
                self.at += 1
            elif here in "\"'":
                start = self.at
                self.string()
                parts.append(_unquoted(self.text[start : self.at]))
            else:
                start = self.at
                while self.text[self.at] not in f" \t.{end}":
                    self.step()
                parts.append(self.text[start : self.at])

    def string(self) -> None:
        quote = self.text[self.at]
        mark = quote * 3 if self.text.startswith(quote * 3, self.at) else quote
        self.at += len(mark)
        while not self.text.startswith(mark, self.at):
            self.step(2 if quote == '"' and self.text[self.at] == "\\" else 1)
        self.at += len(mark)
        while len(mark) == 3 and self.text[self.at] == quote:  # quotes right before the end belong to the text
            self.at += 1

    def value(self, path: Path) -> None:
        self.blank()
        here = self.text[self.at]
        if here in "\"'":
            self.string()
        elif here == "[":
            self.at += 1
            index = 0
            while self.more("]"):
                self.note((*path, index))
                self.value((*path, index))
                index += 1
        elif here == "{":
            self.at += 1
            while self.more("}"):
                self.pair(path)
        else:
            while self.text[self.at] not in ",]}\n#":
                self.at += 1

    def more(self, end: str) -> bool:
        """Past a comma; False at the end of an array or inline table, which is passed too."""
        self.blank()
        if self.text[self.at] == ",":
            self.at += 1
            self.blank()
        if self.text[self.at] == end:
            self.at += 1
            return False
        return True


def _unquoted(text: str) -> str:
    import tomllib

    return next(iter(tomllib.loads(f"{text} = 0")))
