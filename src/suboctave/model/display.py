"""A system as a notebook shows it: its equation of motion, its matrices, and its elements as a schematic.

Masses stand in a row, the ground below. What holds one mass stands under it, what lies between two masses between
them, or in a row above: linear springs and dampers, of which the signs of the matrices tell, and elements with the
glyph that their class names.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

#: degrees of freedom up to which masses are drawn, and matrices written out
_DRAWN, _WRITTEN = 8, 6
#: elements and loads that are listed
_LISTED = 12
#: entry of a matrix, in units of its largest, below which nothing is coupled
_NOTHING = 1e-12
#: pixels: distance of masses and of connections, size of a mass, and where the row of masses begins
_PITCH, _STEP, _WIDE, _HIGH, _LEFT = 150.0, 34.0, 54.0, 40.0, 24.0
#: pixels that a glyph takes at most
_LONGEST = 90.0
#: of each glyph the path from (0, 0) to (1, 0), in units of its length along, in pixels across
GLYPHS = {
    "spring": "0,0 .25,0 .29,6 .37,-6 .45,6 .53,-6 .61,6 .69,-6 .73,0 1,0",
    "damper": "0,0 .5,0|.5,-5 .5,5|.38,-8 .68,-8 .68,8 .38,8|.68,0 1,0",
    "stop": "0,0 .2,0|.2,-8 .2,8|.36,-8 .36,8|.36,0 .46,0 .5,6 .57,-6 .64,6 .71,-6 .75,0 1,0",
    "friction": "0,0 .34,0|.34,-3 .66,-3|.34,3 .66,3|.66,3 .66,0 1,0",
    "law": "0,0 .34,0|.34,-8 .66,-8 .66,8 .34,8 .34,-8|.66,0 1,0",
}


@dataclass(frozen=True)
class Connection:
    """A glyph from one place to another, in pixels, with a name; `lines`: its strokes, as SVG takes them."""

    name: str
    glyph: str
    start: tuple[float, float]
    end: tuple[float, float]

    @property
    def lines(self) -> list[str]:
        """Its strokes."""
        a, b = np.array(self.start), np.array(self.end)
        along = b - a
        size = float(np.hypot(*along))
        across, drawn = np.array([-along[1], along[0]]) / size, min(1.0, _LONGEST / size)
        strokes = []
        for stroke in GLYPHS[self.glyph].split("|"):
            pairs = [tuple(map(float, pair.split(","))) for pair in stroke.split()]
            # straight on to the ends of a long one
            at = [(s if s in (0.0, 1.0) else 0.5 + drawn * (s - 0.5), t) for s, t in pairs]
            strokes.append(" ".join("{:.1f},{:.1f}".format(*(a + s * along + t * across)) for s, t in at))
        return strokes

    @property
    def label(self) -> tuple[float, float]:
        """Where its name stands."""
        (x, y), upright = 0.5 * (np.array(self.start) + self.end), self.start[0] == self.end[0]
        return (x + 15.0, y + 4.0) if upright else (x, y - 11.0)


@dataclass(frozen=True)
class Schematic:
    """Everything that is drawn, in pixels: upper left corners of masses, connections, loads, leads, and the size."""

    masses: list[tuple[float, float, str]]
    connections: list[Connection]
    loads: list[tuple[float, float, str]]
    leads: list[str]
    width: float
    height: float
    ground: float

    @classmethod
    def of(cls, system: Any) -> Schematic:
        """That of a system with few degrees of freedom."""
        held: dict[int, list[tuple[str, str]]] = {i: [] for i in range(system.n)}
        between: list[tuple[int, int, str, str]] = []
        for name, glyph, ends in _parts(system):
            if len(ends) == 2:
                between.append((min(ends), max(ends), name, glyph))
            else:
                held[ends[0]].append((name, glyph))
        between.sort(key=lambda item: item[1] - item[0])
        rows = _rows(between)
        count = 1 + max(rows, default=-1)
        room = max(1, *(len(items) for items in held.values()))
        pitch = max(_PITCH, _STEP * room + 16.0)
        top = 16.0 + _STEP * max(0, count - 1)
        ground = top + _HIGH + 64.0
        left = max(_LEFT, 0.5 * (_STEP * room - _WIDE))
        masses = [(left + i * pitch, top, _name(system, i)) for i in range(system.n)]
        connections, leads = [], []
        for i, items in held.items():
            first = masses[i][0] + 0.5 * (_WIDE - _STEP * (len(items) - 1))
            for k, (name, glyph) in enumerate(items):
                x = first + _STEP * k
                if not masses[i][0] < x < masses[i][0] + _WIDE:
                    leads.append(f"{x:.1f},{top + _HIGH:.1f} {masses[i][0] + 0.5 * _WIDE:.1f},{top + _HIGH:.1f}")
                connections.append(Connection(name, glyph, (x, top + _HIGH), (x, ground)))
        for (i, j, name, glyph), row in zip(between, rows, strict=True):
            # the first row leads from side to side, others over the masses
            y, low = top + 0.5 * _HIGH - _STEP * row, row > 0
            x0 = masses[i][0] + (0.7 if low else 1.0) * _WIDE
            x1 = masses[j][0] + (0.3 if low else 0.0) * _WIDE
            connections.append(Connection(name, glyph, (x0, y), (x1, y)))
            leads += [f"{x:.1f},{y:.1f} {x:.1f},{top:.1f}" for x in (x0, x1) if low]
        loads = [(masses[i][0], top + 0.2 * _HIGH, name) for i, name in _loaded(system)]
        return cls(masses, connections, loads, leads, masses[-1][0] + pitch, ground + 14.0, ground)


def _rows(between: list[tuple[int, int, str, str]]) -> list[int]:
    """In which row each connection of two masses runs, so that none lie on each other; the first for neighbours."""
    rows: list[int] = []
    for number, (i, j, *_) in enumerate(between):
        others = [(between[k][:2], rows[k]) for k in range(number)]
        taken = {row for (a, b), row in others if a < j and i < b}
        row = int(j - i > 1)
        while row in taken:
            row += 1
        rows.append(row)
    return rows


def _parts(system: Any) -> Iterator[tuple[str, str, tuple[int, ...]]]:
    """Name, glyph and one or two masses of everything that holds them."""
    _, damping, stiffness = system.matrices()
    for letter, glyph, matrix in (("k", "spring", stiffness), ("c", "damper", damping)):
        small = _NOTHING * np.abs(matrix).max()
        for i in range(system.n):
            if abs(matrix[i].sum()) > small * system.n:
                yield letter, glyph, (i,)
            for j in range(i + 1, system.n):
                if abs(matrix[i, j]) > small:
                    yield letter, glyph, (i, j)
    for number, element in enumerate(system.elements):
        direction = element.direction(system.n)
        acting = np.flatnonzero(direction)
        # of more than two the one that moves it most
        ends = acting if len(acting) <= 2 else [np.abs(direction).argmax()]
        yield f"e{number}", element.glyph, tuple(map(int, ends))


def _loaded(system: Any) -> Iterator[tuple[int, str]]:
    """The masses that loads act on."""
    for number, load in enumerate(system.loads):
        moved = {int(np.abs(c.direction).argmax()) for c in load.components(system.n, system.linear_parts)}
        yield from ((i, f"p{number}") for i in sorted(moved))


def _name(system: Any, i: int) -> str:
    return system.dof_names[i] if system.dof_names else f"x{i}"


def system_text(system: Any) -> str:
    """A system in lines: degrees of freedom, elements, loads, parameters, angles, units."""
    title = f"System {system.name!r}" if system.name else "System"
    names = f" ({', '.join(system.dof_names[:8])}{', ...' * (system.n > 8)})" if system.dof_names else ""
    lines = [f"{title}: {system.n} {'degree' if system.n == 1 else 'degrees'} of freedom{names}"]
    for kind, items in (("elements", system.elements), ("loads", system.loads)):
        shown = [repr(item) for item in items[:6]] + (["..."] if len(items) > 6 else [])
        lines += [f"  {kind if not i else '':<10} {text}" for i, text in enumerate(shown)]
    if system.parameters:
        values = ", ".join(f"{name} = {value:g}" for name, value in system.parameters.items())
        lines.append(f"  parameters {values}")
    if system.angles:
        lines.append(f"  angles     {', '.join(angle.name(system.dof_names) for angle in system.angles)}")
    if system.units:
        lines.append(
            f"  units      {system.units}; mass in {system.units.mass}, frequencies in {system.units.frequency}"
        )
    return "\n".join(lines)


def system_html(system: Any) -> str:
    """A `System` as HTML: text, MathML, tables and a drawing, nothing that is fetched or run."""
    small = system.n <= _WRITTEN
    matrices = zip(("M", "C", "K", "S"), system.linear_parts, strict=True)
    kept = [(letter, matrix) for letter, matrix in matrices if letter != "S" or not matrix.zero]
    written = [(letter, _cells(matrix.value(system.parameters))) for letter, matrix in kept] if small else []
    text: str = _template().render(
        system=system,
        title=system.name or "System",
        schematic=Schematic.of(system) if system.n <= _DRAWN else None,
        matrices=written,
        structural=not system.structural.zero,
        listed=_LISTED,
    )
    return text


def _cells(matrix: Any) -> list[list[str]]:
    return [[f"{value:.6g}" for value in row] for row in matrix]


@functools.cache
def _template() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("suboctave.model", "templates")
    page = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return page.get_template("system.html")
