"""What a curve or a search leaves open, in lines: notes of one cause become one line, however many their places are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

#: what stands in parentheses behind a space is of one place alone; the parentheses of a call are not
_OWN = re.compile(r" \((?:[^()]|\([^()]*\))*\)")

#: as many places of one cause are listed, of more their number and range are given
_LISTED = 3


@dataclass(frozen=True)
class Note:
    """Something that is not settled.

    Attributes
    ----------
    text
        The cause, and last what to do; details of this place alone in parentheses.
    parameter, first, last
        Where: the parameter and its values at both ends of the place. Empty for a note on the whole curve.
    kind
        Of the bifurcation that it is about; empty for a stretch of the curve.
    where
        The place in words, where it has more than one parameter.
    failure
        The message of the failure that is the reason; of several places that of the first is given.
    """

    text: str
    parameter: str = ""
    first: float = 0.0
    last: float = 0.0
    kind: str = ""
    where: str = ""
    failure: str = ""

    @property
    def cause(self) -> str:
        """The text without what is of this place alone."""
        return _OWN.sub("", self.text)


def lines(notes: Iterable[Note]) -> list[str]:
    """One line for each cause, in the order in which causes are met first."""
    causes: dict[tuple[str, str], list[Note]] = {}
    for note in dict.fromkeys(notes):
        causes.setdefault((note.cause, note.parameter), []).append(note)
    return [_line(cause, together) for (cause, _), together in causes.items()]


def _line(cause: str, notes: Sequence[Note]) -> str:
    head = notes[0]
    text = head.text if all(note.text == head.text for note in notes) else cause
    place = ("; " if head.where else ", ").join(map(_one, notes)) if len(notes) <= _LISTED else _several(notes)
    one = all(note.failure == head.failure for note in notes)
    return ": ".join(part for part in (place, text + (", the first" if not one else ""), head.failure) if part)


def _one(note: Note) -> str:
    if not note.parameter:
        return note.where
    if note.kind or note.first == note.last:
        place = note.where or f"{note.parameter} = {note.first:.9g}"
        return f"{note.kind} at {place}" if note.kind else place
    return _span(note.parameter, note.first, note.last)


def _several(notes: Sequence[Note]) -> str:
    """How many places, and the range of the parameter that they lie in."""
    name, kinds = notes[0].parameter, sorted({note.kind for note in notes if note.kind})
    values = [value for note in notes for value in (note.first, note.last)]
    what = "places" if not kinds else kinds[0] if len(kinds) == 1 else f"bifurcations ({', '.join(kinds)})"
    return f"{len(notes)} {what} {_span(name, min(values), max(values))}"


def _span(name: str, first: float, last: float) -> str:
    """Two values of a parameter; places right beside each other differ in late digits."""
    digits = 6 if f"{first:.6g}" != f"{last:.6g}" else 9
    one, other = f"{first:.{digits}g}", f"{last:.{digits}g}"
    return f"between {name} = {one} and {other}" if one != other else f"{name} = {one}"
