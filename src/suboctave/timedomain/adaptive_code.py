"""Code of an adaptive Runge-Kutta method of order 8 for one structure, several trajectories side by side.

`y = (x, x')`, `x'' = M^-1 (p - C x' - K x - e F)`, with the corners of the laws frozen within a step. Every
trajectory has its own time and its own step; what is decided between two steps is in `adaptive_control`. Numbers lie
side by side as in `newmark_code`.
"""

from __future__ import annotations

from suboctave.timedomain.adaptive_control import FIELDS
from suboctave.timedomain.lanes import HEADER, MOST_UNROLLED, Lanes, Rows, add_asked, asked_states
from suboctave.timedomain.laws import AskedLaw, Names
from suboctave.timedomain.structure import Structure

__all__ = ["IMPORT", "Writer", "adaptive_rows", "adaptive_source"]

IMPORT = "from suboctave.timedomain.adaptive_control import ERROR_3, ERROR_5, NODES, STAGES, control\n"
_DRIVER = """
@njit(cache=True, nogil=True, error_model="numpy")
def adaptive(z, at, budget, start, samples, skip, tolerance, address, out, peaks, measure):
    if start:
        begin(z, address)
    for tried in range(budget):
        attempt(z, address)
        done = 0
        for l in range({lanes}):
            done += control(z, at, l, {lanes}, {n}, {corners}, samples, skip, tolerance, out, peaks, measure)
        if done == {lanes}:
            return 1
    return 0
"""


def adaptive_rows(structure: Structure, lanes: int) -> Rows:
    """The layout of the array `z`."""
    n, m, k, waves = structure.n, len(structure.channels), len(structure.outputs), len(structure.waves)
    rows = Rows(lanes)
    sizes = {
        "A": n * n, "B": n * n, "L": n * waves, "E": n * k, "c": structure.law_numbers,
        **dict.fromkeys(FIELDS, 1),
        "y": 2 * n, "trial": 2 * n, "K": 26 * n, "e3": 2 * n, "e5": 2 * n, "rate": 2 * n, "F": k, "q": m, "r": m,
        "theta": 1, **dict.fromkeys(("on", "g", "dg", "g1", "dg1"), structure.corners),
        **dict.fromkeys(("now", "past", "floor", "peak", "crest", "weight"), n),
    }  # fmt: skip
    for name, count in sizes.items():
        rows.add(name, count)
    add_asked(rows, structure)
    return rows


def adaptive_source(structure: Structure, lanes: int) -> str:
    """The module that integrates `lanes` trajectories of this structure."""
    decorator = '@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})'
    begin, attempt = Writer(structure, lanes).begin(), Writer(structure, lanes).attempt()
    driver = _DRIVER.format(lanes=lanes, n=structure.n, corners=structure.corners)
    return f"{HEADER}{IMPORT}\n\n{decorator}\n{begin}\n\n\n{decorator}\n{attempt}\n\n{driver}"


class Writer:
    """Writes the functions of the module; `tangent_code` adds to them."""

    def __init__(self, structure: Structure, lanes: int) -> None:
        self.structure = structure
        self.n, self.m, self.k = structure.n, len(structure.channels), len(structure.outputs)
        self.z = adaptive_rows(structure, lanes)
        self.code = Lanes(lanes)

    def begin(self) -> str:
        """The first stage and the flags, at the state itself."""
        n, z, code = self.n, self.z, self.code
        self._loop(2 * n, [f"{z.at('trial', 'i')} = {z.at('y', 'i')}", f"{z.at('K', f'{24 * n} + i')} = 0.0"])
        code.each([f"{z('theta')} = {z('omega')} * {z('t')}"])
        for tie in (False, True):
            self._corners()
            for i in range(self.structure.corners):
                g = z("g1", i)
                at_it = f"{z('dg1', i)} > 0.0" if tie else "False"
                code.each([f"{z('on', i)} = 1.0 if {g} > 0.0 or ({g} == 0.0 and {at_it}) else 0.0"])
            if not tie:
                self._rate()
                self._loop(2 * n, [f"{z.at('K', f'{24 * n} + i')} = {z.at('rate', 'i')}"])
        self._loop(2 * n, [f"{z.at('K', 'i')} = {z.at('rate', 'i')}"])
        for i in range(self.structure.corners):
            code.each([f"{z('g', i)} = {z('g1', i)}", f"{z('dg', i)} = {z('dg1', i)}"])
        return f"def begin(z, address):\n{code.text()}\n    return 0"

    def attempt(self) -> str:
        """All stages of a step of length h from y, the error estimates, and the corners at its end.

        The first stage is the last one of the step before, but where a corner has been turned since: what was missed
        of it, times the jump in slope, would be an error of first order in the rate.
        """
        n, z, code = self.n, self.z, self.code
        code.raw("first = 1")
        if self.structure.corners:
            code.raw(*(f"for l in range({z.lanes}):", f"    if z[{z.begin['stale'] * z.lanes} + l] > 0.0:"))
            code.raw("        first = 0")
        code.raw("for s in range(first, 13):")
        code.indent += 1
        code.raw(f"for i in range({2 * n}):")
        code.indent += 1
        code.raw("a = STAGES[s, 0]")
        code.each([f"{z.at('trial', 'i')} = a * {z.at('K', 'i')}"])
        code.raw("for j in range(1, s):", "    a = STAGES[s, j]", "    if a != 0.0:")
        code.indent += 2
        code.each([f"{z.at('trial', 'i')} += a * {z.at('K', f'j * {2 * n} + i')}"])
        code.raw("")
        code.indent -= 2
        code.each([f"{z.at('trial', 'i')} = {z.at('y', 'i')} + {z('h')} * {z.at('trial', 'i')}"])
        code.raw("")
        code.indent -= 1
        code.raw("node = NODES[s]")
        code.each([f"{z('theta')} = {z('omega')} * ({z('t')} + node * {z('h')})"])
        self._rate()
        code.raw("if s == 0:")
        code.indent += 1
        self._loop(2 * n, [f"{z.at('K', 'i')} = {z.at('rate', 'i')} if {z('stale')} > 0.0 else {z.at('K', 'i')}"])
        code.each([f"{z('stale')} = 0.0"])
        code.raw("")
        code.indent -= 1
        code.raw("else:")
        code.indent += 1
        self._loop(2 * n, [f"{z.at('K', f's * {2 * n} + i')} = {z.at('rate', 'i')}"])
        code.indent -= 2
        code.raw(f"for i in range({2 * n}):")
        code.indent += 1
        code.each([f"{z.at('e3', 'i')} = 0.0", f"{z.at('e5', 'i')} = 0.0"])
        code.raw("for j in range(13):", "    a, b = ERROR_3[j], ERROR_5[j]")
        code.indent += 1
        k = z.at("K", f"j * {2 * n} + i")
        code.each([f"{z.at('e3', 'i')} += a * {k}", f"{z.at('e5', 'i')} += b * {k}"])
        code.raw("")
        code.indent -= 2
        self._corners()
        return f"def attempt(z, address):\n{code.text()}\n    return 0"

    def _loop(self, count: int, lines: list[str]) -> None:
        """Statements for every lane and for i below `count`."""
        self.code.raw(f"for i in range({count}):")
        self.code.indent += 1
        self.code.each(lines)
        self.code.raw("")
        self.code.indent -= 1

    def _dot(self, j: int, name: str, first: int) -> str:
        """Channel j of a vector with n rows from `first` on."""
        terms = []
        for i, factor in enumerate(self.structure.channels[j].tolist()):
            if factor:
                entry = self.z(name, first + i)
                terms.append(entry if factor == 1.0 else f"{factor!r} * {entry}")
        return " + ".join(terms)

    def _names(self, e: int) -> Names:
        placed, z = self.structure.laws[e], self.z
        return Names(
            [f"q{j}" for j in placed.inputs],
            [f"r{j}" for j in placed.inputs],
            lambda i: z("c", placed.begin + i),
            f"e{e}",
            lambda i: z("on", placed.corner + i),
            [f"a{j}" for j in placed.inputs],
        )

    def _states(self) -> list[str]:
        lines = [f"theta = {self.z('theta')}"]
        for j in range(self.m):
            lines += [f"q{j} = {self._dot(j, 'trial', 0)}", f"r{j} = {self._dot(j, 'trial', self.n)}"]
        return lines

    def _corners(self) -> None:
        """Margins of the corners and their rates, at the trial state and its rate in the last stage."""
        z, code = self.z, self.code
        if not self.structure.corners:
            return
        code.each(self._states())
        code.each([f"a{j} = {self._dot(j, 'K', 25 * self.n)}" for j in range(self.m)])
        code.each([f"omega = {z('omega')}"])
        for e, placed in enumerate(self.structure.laws):
            for i in range(placed.law.corners):
                lines, margin, rate = placed.law.corner(i, self._names(e))
                code.each(lines)
                code.each([f"{z('g1', placed.corner + i)} = {margin}", f"{z('dg1', placed.corner + i)} = {rate}"])

    def _forces(self) -> None:
        """The forces of the laws at the trial state."""
        z, code, structure = self.z, self.code, self.structure
        code.each(self._states())
        self._ask()
        forces: list[list[str]] = [[] for _ in range(self.k)]
        asked = 0
        for e, placed in enumerate(structure.laws):
            if isinstance(placed.law, AskedLaw):
                states = asked_states(placed)
                forces[placed.output].append(z(f"asked{asked}", states + 1 + placed.law.count))
                asked += 1
                continue
            lines, force = placed.law.force(self._names(e))
            code.each(lines)
            forces[placed.output].append(force)
        code.each([f"{z('F', o)} = {' + '.join(forces[o])}" for o in range(self.k)])

    def _rate(self) -> None:
        """The rate of the trial state."""
        n, k, z, code, structure = self.n, self.k, self.z, self.code, self.structure
        self._forces()
        waves: list[str] = []
        angles: set[int] = set()
        for harmonic, sine in structure.waves:
            if harmonic and harmonic not in angles:
                angles.add(harmonic)
                code.each([f"s{harmonic}, c{harmonic} = sine_cosine({float(harmonic)} * {z('theta')})"])
            waves.append(f"s{harmonic}" if sine else f"c{harmonic}" if harmonic else "1.0")
        count = len(waves)
        if n <= MOST_UNROLLED:
            for i in range(n):
                terms = [
                    f"{z('A', i * n + j)} * {z('trial', j)} + {z('B', i * n + j)} * {z('trial', n + j)}"
                    for j in range(n)
                ]
                terms += [f"{z('L', i * count + w)} * {wave}" for w, wave in enumerate(waves)]
                force = "".join(f" - {z('E', i * k + o)} * {z('F', o)}" for o in range(k))
                code.each([
                    f"{z('rate', i)} = {z('trial', n + i)}",
                    f"{z('rate', n + i)} = {' + '.join(terms)}{force}",
                ])  # fmt: skip
            return
        for w, wave in enumerate(waves):
            # of many degrees of freedom the loads are added one wave after the other
            code.each([f"{z('e3', w) if w < 2 * n else z('e5', w - 2 * n)} = {wave}"])
        code.raw(f"for i in range({n}):")
        code.indent += 1
        loads = [
            f"{z.at('L', f'i * {count} + {w}')} * {z('e3', w) if w < 2 * n else z('e5', w - 2 * n)}"
            for w in range(count)
        ]
        code.each([
            f"{z.at('rate', 'i')} = {z.at('trial', f'{n} + i')}",
            f"{z.at('rate', f'{n} + i')} = {' + '.join(loads) or '0.0'}",
        ])  # fmt: skip
        code.raw(f"for j in range({n}):")
        code.indent += 1
        entry = f"i * {n} + j"
        code.each([
            f"{z.at('rate', f'{n} + i')} += {z.at('A', entry)} * {z.at('trial', 'j')}"
            f" + {z.at('B', entry)} * {z.at('trial', f'{n} + j')}"
        ])  # fmt: skip
        code.raw("")
        code.indent -= 1
        if k:
            code.raw(f"for o in range({k}):")
            code.indent += 1
            code.each([f"{z.at('rate', f'{n} + i')} -= {z.at('E', f'i * {k} + o')} * {z.at('F', 'o')}"])
            code.raw("")
            code.indent -= 1
        code.indent -= 1

    def _ask(self) -> None:
        """Call back for the laws that have no code."""
        z, code = self.z, self.code
        if not self.structure.asked:
            return
        for i, placed in enumerate(self.structure.asked):
            kinds = ("q", "r") if placed.element.depends_on_velocity else ("q",)
            states = [*(f"{kind}{j}" for kind in kinds for j in placed.inputs), "theta"]
            code.each([f"{z(f'asked{i}', row)} = {state}" for row, state in enumerate(states)])
            code.each([
                f"{z(f'asked{i}', len(states) + c)} = {z('c', placed.begin + c)}" for c in range(placed.law.count)
            ])  # fmt: skip
        code.raw(
            *(
                f"call_back(address, {i}, {z.lanes}, z[{z.begin[f'asked{i}'] * z.lanes}:])"
                for i in range(len(self.structure.asked))
            )
        )
        code.each(self._states())
