"""The laws of a layout as code in which trajectories lie side by side."""

from __future__ import annotations

from collections.abc import Callable

from suboctave.model.elements.batch_form import Names, Tangent
from suboctave.timedomain.generated import Index, Lanes, Rows
from suboctave.timedomain.layout import Layout, PlacedLaw

__all__ = ["LawCode"]

#: output, channel, and whether it is the derivative by the channel's rate
Slope = tuple[int, int, bool]


class LawCode:
    """Writes channels and forces; what integrates them is added by the methods.

    `code` is the function under way, `z` where its numbers lie: among them rows "c" with the numbers of the laws, and
    those of `callback_shapes`.
    """

    def __init__(self, layout: Layout, rows: Rows) -> None:
        self.layout, self.z, self.code = layout, rows, Lanes(rows.lanes)
        self.n, self.m, self.k = layout.n, len(layout.channels), len(layout.outputs)

    def along(self, j: int, entry: Callable[[int], str]) -> str:
        """Channel j of a vector with entries (n,)."""
        factors = self.layout.channels[j].tolist()
        terms = [entry(i) if d == 1.0 else f"{d!r} * {entry(i)}" for i, d in enumerate(factors) if d]
        return " + ".join(terms) or "0.0"

    def names(self, placed: PlacedLaw) -> Names:
        """What a law's arguments are called: `q0`, `r0`, `a0` ... by channel."""
        q, r, a = ([f"{kind}{j}" for j in placed.inputs] for kind in "qra")
        z = self.z
        return Names(
            *(q, r, lambda i: z("c", placed.begin + i)),
            *(f"e{placed.number}", lambda i: z("on", placed.corner + i), a),
        )

    def read(self, channels: list[str]) -> None:
        """These lines, which read `q0`, `r0`, ... and `theta`, and the calls of the laws without code there."""
        z, code = self.z, self.code
        code.each(*channels)
        if not self.layout.called_back:
            return
        for i, placed in enumerate(self.layout.called_back):
            kinds = "qr" if placed.element.depends_on_velocity else "q"
            given = [*(f"{kind}{j}" for kind in kinds for j in placed.inputs), "theta"]
            given += [z("c", placed.begin + c) for c in range(placed.form.count)]
            code.each(*(f"{z(f'callback{i}', row)} = {number}" for row, number in enumerate(given)))
        for i in range(len(self.layout.called_back)):
            begin = z.begin[f"callback{i}"] * z.lanes
            code.raw(f"call_back(address, {i}, {z.lanes}, z[{begin}:])")
        code.each(*channels)

    def _returned(self, i: int, placed: PlacedLaw) -> Tangent:
        """What the law called back as number i has left."""
        first = placed.states + 1 + placed.form.count
        slopes = [self.z(f"callback{i}", first + 1 + row) for row in range(placed.states)]
        inputs = len(placed.inputs)
        return Tangent([], self.z(f"callback{i}", first), slopes[:inputs], slopes[inputs:] or [""] * inputs)

    def forces(self, form: Callable[[PlacedLaw], Tangent]) -> tuple[list[str], dict[Slope, str]]:
        """Lines for all laws in this form, then the texts of the outputs' forces and of their derivatives."""
        forces: list[list[str]] = [[] for _ in range(self.k)]
        slopes: dict[Slope, list[str]] = {}
        callbacks = {placed.number: i for i, placed in enumerate(self.layout.called_back)}
        for placed in self.layout.laws:
            if placed.form.has_code:
                tangent = form(placed)
            else:
                tangent = self._returned(callbacks[placed.number], placed)
            self.code.each(*tangent.lines)
            forces[placed.output].append(tangent.force)
            for by_rate, texts in ((False, tangent.by_q), (True, tangent.by_r)):
                for j, text in zip(placed.inputs, texts, strict=True):
                    if text and text != "0.0":
                        slopes.setdefault((placed.output, j, by_rate), []).append(f"({text})")
        return [" + ".join(texts) for texts in forces], {which: " + ".join(texts) for which, texts in slopes.items()}

    def row_sums(
        self, goal: Callable[[Index], str], start: Callable[[Index], str], x: Callable[[Index], str],
        v: Callable[[Index], str], force: str,
    ) -> None:  # fmt: skip
        """`goal = start + A x + B v - E force` for all degrees of freedom."""
        z = self.z
        self.code.sums(
            self.n,
            goal,
            start,
            [
                (self.n, "+", lambda i, j: f"{z('A', i, j)} * {x(j)} + {z('B', i, j)} * {v(j)}"),
                (self.k, "-", lambda i, o: f"{z('E', i, o)} * {z(force, o)}"),
            ],
        )
