"""Code of the adaptive method that carries tangent vectors along with every trajectory.

    w' = Df(y, t) w,   Df from the laws with their corners frozen, as in the step itself

with the stages and the step of the trajectory: what comes out is the derivative of the numerical flow. Their errors
count for the length of the step, too: directions that the motion does not move in may be the stiff ones. At a corner
of a continuous force the tangent flow is continuous, so nothing is added there. Beside it goes the rate of volume,
`div f = -trace M^-1 (C + sum e_o dF_o/dx')`, whose integral is the sum of all exponents (Liouville).
"""

from __future__ import annotations

from suboctave.timedomain.adaptive_code import IMPORT, Writer, adaptive_rows
from suboctave.timedomain.lanes import HEADER, MOST_UNROLLED, Rows, asked_states
from suboctave.timedomain.laws import AskedLaw
from suboctave.timedomain.structure import Structure

__all__ = ["tangent_rows", "tangent_source"]

#: what an error of a tangent vector counts for, beside one of the motion
_LOOSER = 1e-3
_IMPORT = "from suboctave.timedomain.tangent_control import follow\n"
_DRIVER = """
@njit(cache=True, nogil=True, error_model="numpy")
def adaptive(z, at, more, budget, start, samples, skip, tolerance, address, out, peaks, measure, grown):
    if start:
        begin(z, address)
    for tried in range(budget):
        attempt(z, address)
        done = 0
        for l in range({lanes}):
            done += control(z, at, l, {lanes}, {n}, {corners}, samples, skip, tolerance, out, peaks, measure)
            follow(z, more, l, {lanes}, {n}, {m}, skip, grown)
        if done == {lanes}:
            return 1
    return 0
"""


def tangent_rows(structure: Structure, lanes: int, count: int) -> Rows:
    """The layout of the array `z` with `count` tangent vectors."""
    n, m, k = structure.n, len(structure.channels), len(structure.outputs)
    rows = adaptive_rows(structure, lanes)
    sizes = {
        "w": 2 * n * count, "goal": 2 * n * count, "W": 24 * n * count, "dF": k, "S": 2 * m * k, "G": m * k, "trace": 1,
        "metric": 2 * n, "log": count, **dict.fromkeys(("used", "rate_of_volume", "volume", "seen", "plain"), 1),
        **dict.fromkeys(("sum3", "sum5", "part3", "part5", "before", "after"), 1),
    }  # fmt: skip
    for name, size in sizes.items():
        rows.add(name, size)
    return rows


def tangent_source(structure: Structure, lanes: int, count: int) -> str:
    """The module that integrates `lanes` trajectories of this structure, each with `count` tangent vectors."""
    decorator = '@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})'
    begin, attempt = Writer(structure, lanes).begin(), _TangentWriter(structure, lanes, count).attempt()
    driver = _DRIVER.format(lanes=lanes, n=structure.n, corners=structure.corners, m=count)
    return f"{HEADER}{IMPORT}{_IMPORT}\n\n{decorator}\n{begin}\n\n\n{decorator}\n{attempt}\n\n{driver}"


class _TangentWriter(Writer):
    def __init__(self, structure: Structure, lanes: int, count: int) -> None:
        super().__init__(structure, lanes)
        self.z = tangent_rows(structure, lanes, count)
        self.count = count
        self.slopes: list[tuple[int, int, bool]] = []  # output, channel, by its rate

    def attempt(self) -> str:
        """All stages of a step: as in the method alone, and those of the tangent vectors."""
        n, z, code = self.n, self.z, self.code
        code.each([f"{z('used')} = {z('h')}", f"{z('rate_of_volume')} = 0.0"])
        code.raw("for s in range(0, 13):")
        code.indent += 1
        self._towards("trial", "y", "K", 2 * n)
        self._towards("goal", "w", "W", 2 * n * self.count)
        code.raw("if s == 12:", "    node = 1.0", "else:", "    node = NODES[s]")
        code.each([f"{z('theta')} = {z('omega')} * ({z('t')} + node * {z('h')})"])
        self._rate()
        self._loop(2 * n, [f"{z.at('K', f's * {2 * n} + i')} = {z.at('rate', 'i')}"])
        code.raw("if s < 12:")
        code.indent += 1
        self._tangents()
        code.raw("")
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
        self._error()
        self._corners()
        return f"def attempt(z, address):\n{code.text()}\n    return 0"

    def _error(self) -> None:
        """The error of the tangent vectors, each relative to its length, in units of the motion's tolerance."""
        n, z, code = self.n, self.z, self.code
        size = 2 * n
        code.each([f"{z('extra')} = 0.0"])
        code.raw(f"for c in range({self.count}):")
        code.indent += 1
        code.each([f"{z(name)} = 0.0" for name in ("sum3", "sum5", "before", "after")])
        code.raw(f"for i in range({size}):")
        code.indent += 1
        code.each([f"{z('part3')} = 0.0", f"{z('part5')} = 0.0"])
        code.raw("for j in range(12):", "    a, b = ERROR_3[j], ERROR_5[j]")
        code.indent += 1
        rate = z.at("W", f"(j * {self.count} + c) * {size} + i")
        code.each([f"{z('part3')} += a * {rate}", f"{z('part5')} += b * {rate}"])
        code.raw("")
        code.indent -= 1
        weight = z.at("metric", "i")
        code.each([
            f"{z('sum3')} += ({weight} * {z('part3')}) ** 2",
            f"{z('sum5')} += ({weight} * {z('part5')}) ** 2",
            f"{z('before')} += ({weight} * {z.at('w', f'c * {size} + i')}) ** 2",
            f"{z('after')} += ({weight} * {z.at('goal', f'c * {size} + i')}) ** 2",
        ])  # fmt: skip
        code.raw("")
        code.indent -= 1
        code.each([
            f"length = {z('before')} if {z('before')} > {z('after')} else {z('after')}",
            f"mean = ({z('sum5')} + 0.01 * {z('sum3')}) * {size} * length",
            f"error = {_LOOSER} * {z('h')} * {z('sum5')} / sqrt(mean if mean > 0.0 else 1.0)",
            f"{z('extra')} = error if error > {z('extra')} else {z('extra')}",
        ])  # fmt: skip
        code.raw("")
        code.indent -= 1

    def _towards(self, goal: str, origin: str, rates: str, size: int) -> None:
        """`goal = origin + h sum_j a_sj rates_j` in stage s."""
        z, code = self.z, self.code
        code.raw(f"for i in range({size}):")
        code.indent += 1
        code.each([f"{z.at(goal, 'i')} = 0.0"])
        code.raw("for j in range(s):", "    a = STAGES[s, j]", "    if a != 0.0:")
        code.indent += 2
        code.each([f"{z.at(goal, 'i')} += a * {z.at(rates, f'j * {size} + i')}"])
        code.raw("")
        code.indent -= 2
        code.each([f"{z.at(goal, 'i')} = {z.at(origin, 'i')} + {z('h')} * {z.at(goal, 'i')}"])
        code.raw("")
        code.indent -= 1

    def _forces(self) -> None:
        """The forces of the laws at the trial state, and their slopes."""
        z, code, structure = self.z, self.code, self.structure
        code.each(self._states())
        self._ask()
        forces: list[list[str]] = [[] for _ in range(self.k)]
        slopes: dict[tuple[int, int, bool], list[str]] = {}
        asked = 0
        for e, placed in enumerate(structure.laws):
            if isinstance(placed.law, AskedLaw):
                states = asked_states(placed)
                first = states + 1 + placed.law.count
                told = [z(f"asked{asked}", first + 1 + i) for i in range(states)]
                force, by_q, by_r = z(f"asked{asked}", first), told[: len(placed.inputs)], told[len(placed.inputs) :]
                asked += 1
            else:
                tangent = placed.law.frozen(self._names(e))
                code.each(tangent.lines)
                force, by_q, by_r = tangent.force, tangent.by_q, tangent.by_r
            forces[placed.output].append(force)
            for by_rate, texts in ((False, by_q), (True, by_r)):
                for j, text in zip(placed.inputs, texts, strict=False):
                    if text and text != "0.0":
                        slopes.setdefault((placed.output, j, by_rate), []).append(f"({text})")
        code.each([f"{z('F', o)} = {' + '.join(forces[o])}" for o in range(self.k)])
        self.slopes = list(slopes)
        code.each([f"{self._slope(*which)} = {' + '.join(texts)}" for which, texts in slopes.items()])

    def _slope(self, o: int, j: int, by_rate: bool) -> str:
        return self.z("S", (o * self.m + j) * 2 + by_rate)

    def _tangents(self) -> None:
        """Rates of the tangent vectors in stage s, and the rate of volume."""
        n, k, z, code = self.n, self.k, self.z, self.code
        damping = "".join(f" - {self._slope(o, j, True)} * {z('G', j * k + o)}" for o, j, rate in self.slopes if rate)
        code.each([f"{z('rate_of_volume')} += STAGES[12, min(s, 11)] * ({z('trace')}{damping})"])
        code.raw(f"for c in range({self.count}):")
        code.indent += 1
        for o in range(k):
            terms = [
                f"{self._slope(o, j, rate)} * ({self._along(j, n if rate else 0)})"
                for output, j, rate in self.slopes
                if output == o
            ]
            code.each([f"{z('dF', o)} = {' + '.join(terms) or '0.0'}"])
        size = 2 * n
        here = f"(s * {self.count} + c) * {size}"

        def tangent(i: int | str) -> str:
            return z.at("goal", f"c * {size} + {i}")

        if n <= MOST_UNROLLED:
            for i in range(n):
                terms = [
                    f"{z('A', i * n + j)} * {tangent(j)} + {z('B', i * n + j)} * {tangent(n + j)}" for j in range(n)
                ]
                force = "".join(f" - {z('E', i * k + o)} * {z('dF', o)}" for o in range(k))
                code.each([
                    f"{z.at('W', f'{here} + {i}')} = {tangent(n + i)}",
                    f"{z.at('W', f'{here} + {n + i}')} = {' + '.join(terms)}{force}",
                ])  # fmt: skip
        else:
            rate = z.at("W", f"{here} + {n} + i")
            code.raw(f"for i in range({n}):")
            code.indent += 1
            code.each([f"{z.at('W', f'{here} + i')} = {tangent(f'{n} + i')}", f"{rate} = 0.0"])
            code.raw(f"for j in range({n}):")
            code.indent += 1
            entry = f"i * {n} + j"
            code.each([
                f"{rate} += {z.at('A', entry)} * {tangent('j')} + {z.at('B', entry)} * {tangent(f'{n} + j')}"
            ])  # fmt: skip
            code.raw("")
            code.indent -= 1
            if k:
                code.raw(f"for o in range({k}):")
                code.indent += 1
                code.each([f"{rate} -= {z.at('E', f'i * {k} + o')} * {z.at('dF', 'o')}"])
                code.raw("")
                code.indent -= 1
            code.indent -= 1
        code.raw("")
        code.indent -= 1

    def _along(self, j: int, first: int) -> str:
        """Channel j of tangent vector c, or of its rate."""
        terms = []
        for i, factor in enumerate(self.structure.channels[j].tolist()):
            if factor:
                entry = self.z.at("goal", f"c * {2 * self.n} + {first + i}")
                terms.append(entry if factor == 1.0 else f"{factor!r} * {entry}")
        return " + ".join(terms) or "0.0"
