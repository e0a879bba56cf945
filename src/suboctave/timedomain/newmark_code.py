"""Code of Newmark's method for one structure, several trajectories side by side.

Constant average acceleration (beta = 1/4, gamma = 1/2), which is the trapezoidal rule: with S = 4/h^2 M + 2/h C + K,

    dx = S^-1 [-2 K x + 4/h M v + p_0 + p_1 - e (F_0 + F_1)],   v_1 = 2/h dx - v

(the acceleration is eliminated by the equation of motion at the step's begin). Elements feel dx through their channels
only, so that Newton's method has as many unknowns as there are channels, y = d.dx, with F_1 = F(q + y, 2/h y - r):

    y + G F_1 = d.(...),   G = d S^-1 e

It starts from the acceleration extrapolated over the last two steps and ends when its last correction falls below a
tolerance relative to the motion; the force kept is linear over that correction, so that the step balances exactly.

All numbers of W trajectories lie side by side, and inner loops run over them: the compiler makes vector instructions of
those. A trajectory takes part in an iteration only while it needs it, so that its result does not depend on the others.
"""

from __future__ import annotations

import functools

from suboctave.timedomain.lanes import HEADER, MOST_UNROLLED, Lanes, Rows, add_asked, asked_states
from suboctave.timedomain.laws import AskedLaw, Names
from suboctave.timedomain.structure import Structure

__all__ = ["newmark_source", "rows_of"]

_MOST_ITERATIONS = 30


def rows_of(structure: Structure, lanes: int) -> Rows:
    """The layout of the array `z`."""
    n, m, k, waves = structure.n, len(structure.channels), len(structure.outputs), len(structure.waves)
    rows = Rows(lanes)
    for name, count in (
        # numbers
        ("A", n * n), ("B", n * n), ("L", n * waves), ("E", n * k), ("G", m * k), ("c", structure.law_numbers),
        ("h", 1), ("rate", 1), ("time", 1),
        # the motion, and what is remembered of it
        ("x", n), ("v", n), ("F", k), ("q", m), ("r", m), ("foreseen", m), ("last", m), ("bad", 1), ("peak", n),
        # within a step
        ("lin", n), ("before", n), ("goal", m), ("size", m), ("y", m), ("again", 1), ("J", k * m), ("D", m * m),
        ("R", m),
    ):  # fmt: skip
        rows.add(name, count)
    add_asked(rows, structure)
    return rows


def newmark_source(structure: Structure, lanes: int) -> str:
    """The module that integrates `lanes` trajectories of this structure."""
    writer = _Newmark(structure, lanes)
    decorator = '@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})'
    return f"{HEADER}\n\n{decorator}\n{writer.function()}\n"


class _Newmark:
    def __init__(self, structure: Structure, lanes: int) -> None:
        self.structure = structure
        self.n, self.m, self.k = structure.n, len(structure.channels), len(structure.outputs)
        self.waves = range(len(structure.waves))
        self.z = rows_of(structure, lanes)
        self.code = Lanes(lanes)
        self.timed = any(placed.element.depends_on_time for placed in structure.laws)

    def function(self) -> str:
        code = self.code
        code.raw("points = waves.shape[0]", "slot = 0", "theta = 0.0")
        if self.m:
            code.raw("if fresh:")
            code.indent += 1
            code.raw("theta = 2.0 * pi * (begin % points) / points")
            self._read_channels()
            code.each([f"{self.z('y', j)} = 0.0" for j in range(self.m)])
            self._forces(start=True)
            code.raw("")
            code.indent -= 1
        code.raw("for step in range(begin, end):")
        code.indent += 1
        code.raw("k0 = step % points", "k1 = (step + 1) % points")
        code.raw(*(f"s{w} = waves[k0, {w}] + waves[k1, {w}]" for w in self.waves))
        if self.timed or self.structure.asked:
            code.raw("theta = 2.0 * pi * k1 / points")
        self._linear()
        if self.m:
            self._newton()
        self._advance()
        self._record()
        text = code.text()
        head = "def newmark(z, waves, begin, end, stride, skip, measure, fresh, tolerance, address, out, peaks):"
        return f"{head}\n{text}\n    return slot"

    # ------------------------------------------------------------------------------------------------------- parts
    def _number(self, begin: int, i: int) -> str:
        """Number i of the law whose numbers begin there."""
        return self.z("c", begin + i)

    def _dot(self, j: int, name: str, absolute: bool = False) -> str:
        """Channel j of a vector with n rows."""
        terms = []
        for i, factor in enumerate(self.structure.channels[j].tolist()):
            factor = abs(factor) if absolute else factor
            if factor:
                entry = (
                    self.z(name, i)
                    if not absolute
                    else f"(abs({self.z('x', i)}) + {self.z('time')} * abs({self.z('v', i)}))"
                )
                terms.append(entry if factor == 1.0 else f"{factor!r} * {entry}")
        return " + ".join(terms)

    def _read_channels(self) -> None:
        z = self.z
        self.code.each([f"{z('q', j)} = {self._dot(j, 'x')}" for j in range(self.m)])
        self.code.each([f"{z('r', j)} = {self._dot(j, 'v')}" for j in range(self.m)])

    def _linear(self) -> None:
        """The increment without the forces at the end of the step, and what Newton's method starts from."""
        n, k, z, code = self.n, self.k, self.z, self.code
        if n <= MOST_UNROLLED:
            for i in range(n):
                terms = [f"{z('A', i * n + j)} * {z('x', j)} + {z('B', i * n + j)} * {z('v', j)}" for j in range(n)]
                terms += [f"{z('L', i * len(self.waves) + w)} * s{w}" for w in self.waves]
                force = "".join(f" - {z('E', i * k + o)} * {z('F', o)}" for o in range(k))
                code.each([f"{z('lin', i)} = {' + '.join(terms)}{force}"])
        else:
            code.raw(f"for i in range({n}):")
            code.indent += 1
            count = len(self.waves)
            waves = " + ".join(f"{z.at('L', f'i * {count} + {w}')} * s{w}" for w in self.waves) or "0.0"
            code.each([f"{z.at('lin', 'i')} = {waves}"])
            code.raw(f"for j in range({n}):")
            code.indent += 1
            a, b = z.at("A", f"i * {n} + j"), z.at("B", f"i * {n} + j")
            code.each([f"{z.at('lin', 'i')} += {a} * {z.at('x', 'j')} + {b} * {z.at('v', 'j')}"])
            code.raw("")
            code.indent -= 1
            if k:
                code.raw(f"for o in range({k}):")
                code.indent += 1
                code.each([f"{z.at('lin', 'i')} -= {z.at('E', f'i * {k} + o')} * {z.at('F', 'o')}"])
                code.raw("")
                code.indent -= 1
            code.indent -= 1
        for j in range(self.m):
            code.each([
                f"{z('goal', j)} = {self._dot(j, 'lin')}",
                f"{z('size', j)} = tolerance * ({self._dot(j, '', absolute=True)})",
                f"{z('y', j)} = {z('h')} * {z('r', j)} + {z('foreseen', j)}",
            ])  # fmt: skip
        if self.m:
            code.each([f"{z('again')} = 1.0"])

    def _newton(self) -> None:
        code, z = self.code, self.z
        code.raw("count = 1", "iteration = 0", f"while count > 0 and iteration < {_MOST_ITERATIONS}:")
        code.indent += 1
        code.raw("count = 0", "iteration += 1")
        self._forces()
        self._solve()
        code.each([f"count += 1 if {z('again')} > 0.5 else 0"])
        code.raw("")
        code.indent -= 1
        code.raw("if count > 0:")
        code.indent += 1
        code.each([f"{z('bad')} += {z('again')}"])
        code.raw("")
        code.indent -= 1

    def _forces(self, start: bool = False) -> None:
        """F and J at the present guess; J is by y. At the start F alone, which is kept."""
        z, code, structure = self.z, self.code, self.structure
        forces: list[list[str]] = [[] for _ in range(self.k)]
        slopes: list[list[list[str]]] = [[[] for _ in range(self.m)] for _ in range(self.k)]
        lines = []
        for j in range(self.m):
            lines.append(f"q{j} = {z('q', j)} + {z('y', j)}")
            lines.append(f"r{j} = {z('r', j)}" if start else f"r{j} = {z('rate')} * {z('y', j)} - {z('r', j)}")
        self._ask(lines)
        code.each(lines)
        asked = 0
        for e, placed in enumerate(structure.laws):
            if isinstance(placed.law, AskedLaw):
                states = asked_states(placed)
                name, begin = f"asked{asked}", states + 1 + placed.law.count
                force, told = z(name, begin), [z(name, begin + 1 + i) for i in range(states)]
                by_q, by_r = told[: len(placed.inputs)], told[len(placed.inputs) :] or [""] * len(placed.inputs)
                asked += 1
            else:
                tangent = placed.law.tangent(
                    Names(
                        [f"q{j}" for j in placed.inputs],
                        [f"r{j}" for j in placed.inputs],
                        functools.partial(self._number, placed.begin),
                        f"e{e}",
                    )
                )
                code.each(tangent.lines)
                force, by_q, by_r = tangent.force, tangent.by_q, tangent.by_r
            forces[placed.output].append(force)
            for j, slope, rate in zip(placed.inputs, by_q, by_r, strict=True):
                if slope:
                    slopes[placed.output][j].append(f"({slope})")
                if rate:
                    slopes[placed.output][j].append(f"{z('rate')} * ({rate})")
        for o in range(self.k):
            if start:
                code.each([f"{z('F', o)} = {' + '.join(forces[o])}"])
                continue
            code.each([f"f{o} = {' + '.join(forces[o])}"])
            code.each([f"{z('J', o * self.m + j)} = {' + '.join(slopes[o][j]) or '0.0'}" for j in range(self.m)])
        if not start:
            # those that have arrived keep their force; the others take this one, and what the correction adds to it
            code.each([f"{z('F', o)} = f{o} if {z('again')} > 0.5 else {z('F', o)}" for o in range(self.k)])

    def _ask(self, lines: list[str]) -> None:
        """Call back for the laws that have no code; needs the states in rows of their own."""
        z, code = self.z, self.code
        if not self.structure.asked:
            return
        for i, placed in enumerate(self.structure.asked):
            kinds = ("q", "r") if placed.element.depends_on_velocity else ("q",)
            states = [f"{kind}{j}" for kind in kinds for j in placed.inputs]
            lines += [f"{z(f'asked{i}', row)} = {state}" for row, state in enumerate(states)]
            lines.append(f"{z(f'asked{i}', len(states))} = theta")
            lines += [
                f"{z(f'asked{i}', len(states) + 1 + c)} = {z('c', placed.begin + c)}" for c in range(placed.law.count)
            ]
        code.each(lines)
        lines.clear()
        code.raw(
            *(
                f"call_back(address, {i}, {z.lanes}, z[{z.begin[f'asked{i}'] * z.lanes}:])"
                for i in range(len(self.structure.asked))
            )
        )

    def _solve(self) -> None:
        """One correction of y by Newton's method, where it is still wanted."""
        m, k, z, code = self.m, self.k, self.z, self.code
        if m <= MOST_UNROLLED:
            lines = []
            for j in range(m):
                force = "".join(f" + {z('G', j * k + o)} * {z('F', o)}" for o in range(k))
                lines.append(f"b{j} = {z('goal', j)} - {z('y', j)} - (0.0{force})")
                for i in range(m):
                    slope = " + ".join(f"{z('G', j * k + o)} * {z('J', o * m + i)}" for o in range(k))
                    lines.append(f"d{j}_{i} = {1.0 if i == j else 0.0} + {slope}")
            for p in range(m):
                for j in range(p + 1, m):
                    lines.append(f"t = d{j}_{p} / d{p}_{p}")
                    lines += [f"d{j}_{i} = d{j}_{i} - t * d{p}_{i}" for i in range(p + 1, m)]
                    lines.append(f"b{j} = b{j} - t * b{p}")
            for j in range(m - 1, -1, -1):
                known = "".join(f" - d{j}_{i} * b{i}" for i in range(j + 1, m))
                lines.append(f"b{j} = (b{j}{known}) / d{j}_{j}")
            lines += [f"{z('R', j)} = b{j}" for j in range(m)]
            code.each(lines)
        else:
            self._eliminate()
        keep = f"{z('again')} > 0.5"
        code.each([f"{z('R', j)} = {z('R', j)} if {keep} else 0.0" for j in range(m)])
        code.each([f"{z('y', j)} += {z('R', j)}" for j in range(m)])
        for o in range(k):
            terms = " + ".join(f"{z('J', o * m + j)} * {z('R', j)}" for j in range(m))
            code.each([f"{z('F', o)} += {terms}"])
        code.each([f"more = {keep}", "far = False"])
        code.each([f"far = far | (abs({z('R', j)}) > {z('size', j)})" for j in range(m)])
        code.each([f"{z('again')} = 1.0 if more & far else 0.0"])

    def _eliminate(self) -> None:
        """Gaussian elimination, many channels: the matrix is near the identity for short steps and needs no pivots."""
        m, k, z, code = self.m, self.k, self.z, self.code
        code.raw(f"for j in range({m}):")
        code.indent += 1
        code.each([f"{z.at('R', 'j')} = {z.at('goal', 'j')} - {z.at('y', 'j')}"])
        code.raw(f"for o in range({k}):")
        code.indent += 1
        code.each([f"{z.at('R', 'j')} -= {z.at('G', f'j * {k} + o')} * {z.at('F', 'o')}"])
        code.raw("")
        code.indent -= 1
        code.raw(f"for i in range({m}):")
        code.indent += 1
        code.each([f"{z.at('D', f'j * {m} + i')} = 1.0 if i == j else 0.0"])
        code.raw(f"for o in range({k}):")
        code.indent += 1
        slope = z.at("J", f"o * {m} + i")
        code.each([f"{z.at('D', f'j * {m} + i')} += {z.at('G', f'j * {k} + o')} * {slope}"])
        code.raw("")
        code.indent -= 3
        code.raw(f"for p in range({m}):")
        code.indent += 1
        code.raw(f"for j in range(p + 1, {m}):")
        code.indent += 1
        share, pivot = z.at("D", f"j * {m} + p"), z.at("D", f"p * {m} + p")
        code.each([f"{share} = {share} / {pivot}", f"{z.at('R', 'j')} -= {share} * {z.at('R', 'p')}"])
        code.raw(f"for i in range(p + 1, {m}):")
        code.indent += 1
        code.each([f"{z.at('D', f'j * {m} + i')} -= {share} * {z.at('D', f'p * {m} + i')}"])
        code.raw("")
        code.indent -= 3
        code.raw(f"for b in range({m}):", f"    j = {m - 1} - b")
        code.indent += 1
        code.raw(f"for i in range(j + 1, {m}):")
        code.indent += 1
        code.each([f"{z.at('R', 'j')} -= {z.at('D', f'j * {m} + i')} * {z.at('R', 'i')}"])
        code.raw("")
        code.indent -= 1
        code.each([f"{z.at('R', 'j')} = {z.at('R', 'j')} / {z.at('D', f'j * {m} + j')}"])
        code.raw("")
        code.indent -= 1

    def _advance(self) -> None:
        n, k, z, code = self.n, self.k, self.z, self.code
        if n <= MOST_UNROLLED:
            for i in range(n):
                force = "".join(f" - {z('E', i * k + o)} * {z('F', o)}" for o in range(k))
                code.each([f"{z('lin', i)} = {z('lin', i)}{force}"])
        elif k:
            code.raw(f"for i in range({n}):", f"    for o in range({k}):")
            code.indent += 2
            code.each([f"{z.at('lin', 'i')} -= {z.at('E', f'i * {k} + o')} * {z.at('F', 'o')}"])
            code.raw("")
            code.indent -= 2
        moves = [
            "{before} = {v}", "{x} += {lin}", "{v} = {rate} * {lin} - {v}",
        ]  # fmt: skip

        def move(row: str | int) -> list[str]:
            names = ("before", "v", "x", "lin")
            entry = {name: z(name, row) if isinstance(row, int) else z.at(name, row) for name in names}
            return [line.format(rate=z("rate"), **entry) for line in moves]

        if n <= MOST_UNROLLED:
            for i in range(n):
                code.each(move(i))
        else:
            code.raw(f"for i in range({n}):")
            code.indent += 1
            code.each(move("i"))
            code.raw("")
            code.indent -= 1
        for j in range(self.m):
            code.each([
                f"rate{j} = {self._dot(j, 'v')}",
                f"turn{j} = 0.5 * {z('h')} * (rate{j} - {z('r', j)})",
                f"{z('foreseen', j)} = 2.0 * turn{j} - {z('last', j)}",
                f"{z('last', j)} = turn{j}",
                f"{z('r', j)} = rate{j}",
                f"{z('q', j)} = {self._dot(j, 'x')}",
            ])  # fmt: skip

    def _record(self) -> None:
        n, z, code = self.n, self.z, self.code
        code.raw("if measure:", f"    for i in range({n}):")
        code.indent += 2
        x, v, before, peak = (z.at(name, "i") for name in ("x", "v", "before", "peak"))
        code.each([
            # the velocity is linear within a step
            f"turns = {v} * {before} < 0.0",
            f"half = 0.5 * {z('h')}",
            f"share = {before} / (({before} - {v}) if turns else 1.0)",
            f"top = abs({x} - half * ({before} + {v}) + half * {before} * share)",
            f"now = abs({x})",
            "top = top if turns & (top > now) else now",
            f"{peak} = top if top > {peak} else {peak}",
        ])  # fmt: skip
        code.raw("")
        code.indent -= 2
        code.raw("if (step + 1) % stride == 0:", "    if step + 1 > skip:", f"        for i in range({n}):")
        code.indent += 3
        code.each([
            f"out[slot, i, l] = {x}",
            f"out[slot, {n} + i, l] = {v}",
        ])  # fmt: skip
        code.raw("if measure:")
        code.indent += 1
        code.each([f"peaks[slot, i, l] = {peak}"])
        code.raw("")
        code.indent -= 2
        code.raw("slot += 1")
        code.indent -= 1
        code.raw("if measure:", f"    for i in range({n}):")
        code.indent += 2
        code.each([f"{peak} = 0.0"])
        code.raw("")
        code.indent -= 3
