"""Newmark's method for batches of trajectories.

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

from typing import Any

import numpy as np

from suboctave.model.elements.base import Array
from suboctave.timedomain.batch import ROOM, Group, Method
from suboctave.timedomain.generated import Index, Rows, module_of
from suboctave.timedomain.law_code import LawCode, callback_shapes
from suboctave.timedomain.layout import NO_TURN, Layout, Numbers

__all__ = ["NewmarkMethod"]

_MOST_ITERATIONS = 30


def newmark_rows(layout: Layout, lanes: int) -> Rows:
    """The layout of the array `z`."""
    n, m, k, waves = layout.n, len(layout.channels), len(layout.outputs), len(layout.waves)
    shapes: dict[str, int | tuple[int, ...]] = {
        # numbers
        "A": (n, n), "B": (n, n), "L": (n, waves), "E": (n, k), "G": (m, k), "c": layout.law_numbers,
        **dict.fromkeys(("h", "rate", "time"), 1),
        # the motion, and what is remembered of it
        "x": n, "v": n, "F": k, "q": m, "r": m, "foreseen": m, "last": m, "bad": 1, "peak": n,
        # within a step
        "lin": n, "before": n, "goal": m, "size": m, "y": m, "again": 1, "J": (k, m), "D": (m, m), "R": m,
        **callback_shapes(layout.called_back),
        "fold": n if layout.system.turns else 0,
    }  # fmt: skip
    return Rows(lanes, shapes)


class NewmarkMethod(Method):
    """The compiled integrator of a layout."""

    def __init__(self, layout: Layout, samples: int, steps: int, tolerance: float, lanes: int | None) -> None:
        size = newmark_rows(layout, 1).size
        lanes = lanes or next((lanes for lanes in (32, 16) if lanes * size <= ROOM), 8)
        super().__init__(layout, newmark_rows(layout, lanes))
        self.steps, self.tolerance = steps, tolerance
        self.stride, self.effort = steps // samples, steps
        self.function: Any = module_of(_NewmarkCode(layout, self.rows).function()).newmark
        self.waves = layout.wave_table(steps)

    def numbers(self, numbers: Numbers) -> dict[str, Array]:
        h = 2.0 * np.pi / (numbers.omega * self.steps)
        h1 = h[:, None, None]
        inverse = np.linalg.inv(4.0 / h1**2 * numbers.mass + 2.0 / h1 * numbers.damping + numbers.stiffness)
        outputs = inverse @ self.layout.outputs.T
        return {
            "A": -2.0 * inverse @ numbers.stiffness,
            "B": inverse @ (4.0 / h1 * numbers.mass),
            "L": inverse @ numbers.loads,
            "E": outputs,
            "G": self.layout.channels @ outputs,
            "c": numbers.laws,
            "h": h,
            "rate": 2.0 / h,
            "time": 1.0 / numbers.omega,
        }

    def start(self, group: Group, alive: int) -> None:
        states, n = group.batch.states[group.members].T, self.layout.n
        group.row("x")[:], group.row("v")[:] = states[:n], states[n:]
        if self.layout.system.turns:
            group.row("fold")[:] = self.layout.turns[:, None] if group.batch.folded else NO_TURN

    def advance(self, group: Group, effort: int) -> bool:
        batch, last = group.batch, group.batch.total * self.stride
        to = min(group.step + effort, last)
        group.slot += self.function(
            group.z, self.waves, group.step, to, self.stride, batch.skip * self.stride, batch.measure, group.step == 0,
            self.tolerance, batch.address, group.states[group.slot :], group.peaks[group.slot :],
        )  # fmt: skip
        group.step = to
        return to == last

    def left(self, group: Group) -> float:
        return (group.batch.total - group.step / self.stride) * self.rows.lanes

    def results(self, group: Group) -> dict[str, Array]:
        """See `Method.results`; of each the steps whose equations were not solved to the tolerance."""
        return {"end": np.concatenate([group.row("x"), group.row("v")]).T, "unsettled": group.row("bad")[0]}


class _NewmarkCode(LawCode):
    """Writes the function."""

    def function(self) -> str:
        """Steps `begin` to `end` of all lanes."""
        code, z = self.code, self.z
        code.raw("points = waves.shape[0]", "slot = 0", "theta = 0.0")
        if self.m:
            with code.block("if fresh:"):
                code.raw("theta = 2.0 * pi * (begin % points) / points")
                code.each(*(f"{z('q', j)} = {self._dot(j, 'x')}" for j in range(self.m)))
                code.each(*(f"{z('r', j)} = {self._dot(j, 'v')}" for j in range(self.m)))
                code.each(*(f"{z('y', j)} = 0.0" for j in range(self.m)))
                forces, _ = self._laws("{r}")
                code.each(*(f"{z('F', o)} = {force}" for o, force in enumerate(forces)))
        with code.block("for step in range(begin, end):"):
            code.raw("k0 = step % points", "k1 = (step + 1) % points")
            waves = range(len(self.layout.waves))
            code.raw(*(f"s{w} = waves[k0, {w}] + waves[k1, {w}]" for w in waves))
            code.raw("theta = 2.0 * pi * k1 / points")
            self._linear()
            if self.m:
                self._newton()
            self._advance()
            self._record()
        code.raw("return slot")
        return code.function(
            "newmark(z, waves, begin, end, stride, skip, measure, fresh, tolerance, address, out, peaks)"
        )

    def _dot(self, j: int, name: str) -> str:
        """Channel j of a vector with n rows."""
        return self.along(j, lambda i: self.z(name, i))

    def _linear(self) -> None:
        """The increment without the forces at the end of the step, and what Newton's method starts from."""
        z, code = self.z, self.code

        def loads(i: Index) -> str:
            return " + ".join(f"{z('L', i, w)} * s{w}" for w in range(len(self.layout.waves))) or "0.0"

        self.row_sums(lambda i: z("lin", i), loads, lambda j: z("x", j), lambda j: z("v", j), "F")
        for j in range(self.m):
            factors = enumerate(np.abs(self.layout.channels[j]).tolist())
            reach = [f"{d!r} * (abs({z('x', i)}) + {z('time')} * abs({z('v', i)}))" for i, d in factors if d]
            code.each(
                f"{z('goal', j)} = {self._dot(j, 'lin')}",
                f"{z('size', j)} = tolerance * ({' + '.join(reach) or '0.0'})",
                f"{z('y', j)} = {z('h')} * {z('r', j)} + {z('foreseen', j)}",
            )

    def _newton(self) -> None:
        code, z, m, k = self.code, self.z, self.m, self.k
        code.each(f"{z('again')} = 1.0")
        code.raw("count = 1", "iteration = 0")
        with code.block(f"while count > 0 and iteration < {_MOST_ITERATIONS}:"):
            code.raw("count = 0", "iteration += 1")
            forces, slopes = self._laws("{rate} * {y} - {r}")
            code.each(*(f"f{o} = {force}" for o, force in enumerate(forces)))
            for o in range(k):
                for j in range(m):
                    terms = [slopes[o, j, False]] if (o, j, False) in slopes else []
                    terms += [f"{z('rate')} * ({slopes[o, j, True]})"] if (o, j, True) in slopes else []
                    code.each(f"{z('J', o, j)} = {' + '.join(terms) or '0.0'}")
            # those that have arrived keep their force; the others take this one, and what the correction adds to it
            code.each(*(f"{z('F', o)} = f{o} if {z('again')} > 0.5 else {z('F', o)}" for o in range(k)))
            self._solve()
            keep = f"{z('again')} > 0.5"
            code.each(*(f"{z('R', j)} = {z('R', j)} if {keep} else 0.0" for j in range(m)))
            code.each(*(f"{z('y', j)} += {z('R', j)}" for j in range(m)))
            for o in range(k):
                change = " + ".join(f"{z('J', o, j)} * {z('R', j)}" for j in range(m))
                code.each(f"{z('F', o)} += {change}")
            code.each(f"more = {keep}", "far = False")
            code.each(*(f"far = far | (abs({z('R', j)}) > {z('size', j)})" for j in range(m)))
            code.each(f"{z('again')} = 1.0 if more & far else 0.0", f"count += 1 if {z('again')} > 0.5 else 0")
        with code.block("if count > 0:"):
            code.each(f"{z('bad')} += {z('again')}")

    def _laws(self, rate: str) -> tuple[list[str], dict[tuple[int, int, bool], str]]:
        """Forces of all laws and their slopes at the guess y, with the channels' rates given by this text."""
        z, channels = self.z, []
        for j in range(self.m):
            own = rate.format(rate=z("rate"), y=z("y", j), r=z("r", j))
            channels += [f"q{j} = {z('q', j)} + {z('y', j)}", f"r{j} = {own}"]
        self.read(channels)
        return self.forces(lambda placed: placed.form.tangent(self.names(placed)))

    def _solve(self) -> None:
        """R: one correction of y by Newton's method. The matrix is near the identity for short steps: no pivots."""
        m, k, z, code = self.m, self.k, self.z, self.code
        code.sums(
            m,
            lambda j: z("R", j),
            lambda j: f"{z('goal', j)} - {z('y', j)}",
            [(k, "-", lambda j, o: f"{z('G', j, o)} * {z('F', o)}")],
        )

        def row(j: Index) -> None:
            product = [(k, "+", lambda i, o: f"{z('G', j, o)} * {z('J', o, i)}")]
            code.sums(m, lambda i: z("D", j, i), lambda i: f"(1.0 if {i} == {j} else 0.0)", product)

        def eliminate(p: Index) -> None:
            def below(j: Index) -> None:
                share = z("D", j, p)
                code.each(f"{share} = {share} / {z('D', p, p)}", f"{z('R', j)} -= {share} * {z('R', p)}")
                code.rows("i", m, lambda i: code.each(f"{z('D', j, i)} -= {share} * {z('D', p, i)}"), _after(p))

            code.rows("j", m, below, _after(p))

        code.rows("j", m, row)
        code.rows("p", m, eliminate)
        for j in range(m - 1, -1, -1):
            rest = "".join(f" - {z('D', j, i)} * {z('R', i)}" for i in range(j + 1, m))
            code.each(f"{z('R', j)} = ({z('R', j)}{rest}) / {z('D', j, j)}")

    def _advance(self) -> None:
        z, code = self.z, self.code
        forces = [(self.k, "-", lambda i, o: f"{z('E', i, o)} * {z('F', o)}")]
        code.sums(self.n, lambda i: z("lin", i), lambda i: z("lin", i), forces)
        code.rows(
            "i",
            self.n,
            lambda i: code.each(
                f"{z('before', i)} = {z('v', i)}",
                f"{z('x', i)} += {z('lin', i)}",
                f"{z('v', i)} = {z('rate')} * {z('lin', i)} - {z('v', i)}",
            ),
        )
        for j in range(self.m):
            code.each(
                f"rate{j} = {self._dot(j, 'v')}",
                f"turn{j} = 0.5 * {z('h')} * (rate{j} - {z('r', j)})",
                f"{z('foreseen', j)} = 2.0 * turn{j} - {z('last', j)}",
                f"{z('last', j)} = turn{j}",
                f"{z('r', j)} = rate{j}",
                f"{z('q', j)} = {self._dot(j, 'x')}",
            )

    def _record(self) -> None:
        n, z, code = self.n, self.z, self.code
        x, v, before, peak = (z(name, "i") for name in ("x", "v", "before", "peak"))
        folded = "abs({x})"
        if self.layout.system.turns:  # within half a turn, and half a turn where the step has passed the far side
            fold = z("fold", "i")
            folded = f"abs({{x}} - {fold} * np.floor({{x}} / {fold} + 0.5))"
        passed = []
        if self.layout.system.turns:
            crossed = f"np.floor(begin / {fold} + 0.5) != np.floor({x} / {fold} + 0.5)"
            passed = [f"now = 0.5 * {fold} if {crossed} else now"]
        with code.block("if measure:"), code.block(f"for i in range({n}):"):
            code.each(
                # the velocity is linear within a step
                f"turns = {v} * {before} < 0.0",
                f"half = 0.5 * {z('h')}",
                f"share = {before} / (({before} - {v}) if turns else 1.0)",
                f"begin = {x} - half * ({before} + {v})",
                f"top = {folded.format(x=f'(begin + half * {before} * share)')}",
                f"now = {folded.format(x=x)}",
                *passed,
                "top = top if turns & (top > now) else now",
                f"{peak} = top if top > {peak} else {peak}",
            )
        with code.block("if (step + 1) % stride == 0:"):
            with code.block("if step + 1 > skip:"):
                with code.block(f"for i in range({n}):"):
                    code.each(f"out[slot, i, l] = {x}", f"out[slot, {n} + i, l] = {v}")
                    with code.block("if measure:"):
                        code.each(f"peaks[slot, i, l] = {peak}")
                code.raw("slot += 1")
            with code.block("if measure:"), code.block(f"for i in range({n}):"):
                code.each(f"{peak} = 0.0")


def _after(p: Index) -> Index:
    return p + 1 if isinstance(p, int) else f"{p} + 1"
