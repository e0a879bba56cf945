"""An adaptive Runge-Kutta method of order 8 for batches of trajectories, and tangent vectors that go with them.

`y = (x, x')`, `x'' = M^-1 (p - C x' - K x - e F)`, with the corners of the laws frozen within a step. Every trajectory
has its own time and its own step; what is decided between two steps is in `adaptive_control`. Tangent vectors follow

    w' = Df(y, t) w,   Df from the laws with their corners frozen, as in the step itself

with the stages and the step of the trajectory: what comes out is the derivative of the numerical flow. Their errors
count for the length of the step, too: directions that the motion does not move in may be the stiff ones. At a corner
of a continuous force the tangent flow is continuous, so nothing is added there. Beside it goes the rate of volume,
`div f = -trace M^-1 (C + sum e_o dF_o/dx')`, whose integral is the sum of all exponents (Liouville).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from suboctave.model.elements.base import Array
from suboctave.model.projected import ProjectedSystem
from suboctave.timedomain.adaptive_control import SCALARS, VECTORS
from suboctave.timedomain.batch import ROOM, Group, Method
from suboctave.timedomain.generated import Index, Rows, module_of
from suboctave.timedomain.law_code import LawCode, callback_shapes
from suboctave.timedomain.layout import NO_TURN, Layout, Numbers

__all__ = ["AdaptiveMethod"]

_FIRST_STEP = 0.01
#: what an error of a tangent vector counts for, beside one of the motion
_LOOSER = 1e-3
_DRIVER = """

@cached(nogil=True, error_model="numpy")
def adaptive(z, at, budget, start, samples, skip, tolerance, address, out, peaks, measure, growth):
    rows = z.reshape(-1, {lanes})
    n, corners, count = {n}, {corners}, {count}
    if start:
        begin(z, address)
    for tried in range(budget):
        attempt(z, address)
        done = 0
        for l in range({lanes}):
            done += control(rows, l, at, n, corners, samples, skip, tolerance, out, peaks, measure)
            {follow}
        if done == {lanes}:
            return 1
    return 0
"""


def adaptive_rows(layout: Layout, lanes: int, count: int) -> Rows:
    """The layout of the array `z` with `count` tangent vectors."""
    n, m, k, waves, corners = layout.n, len(layout.channels), len(layout.outputs), len(layout.waves), layout.corners
    shapes: dict[str, int | tuple[int, ...]] = {
        **dict.fromkeys(SCALARS, 1),
        "A": (n, n), "B": (n, n), "L": (n, waves), "E": (n, k), "c": layout.law_numbers,
        "y": 2 * n, "trial": (2, n), "K": (13, 2, n), "e3": 2 * n, "e5": 2 * n, "rate": (2, n), "F": k, "wave": waves,
        **dict.fromkeys(("on", "g", "dg", "g1", "dg1"), corners),
        **dict.fromkeys(("now", "past", "floor", "peak", "crest", "weight", "turn", "fold"), n),
        **callback_shapes(layout.called_back),
        "w": (count, 2 * n), "goal": (count, 2, n), "W": (12, count, 2, n), "metric": 2 * n, "log": count,
    }  # fmt: skip
    if count:
        shapes |= {"dF": k, "S": (k, m, 2), "G": (m, k), "trace": 1}
        shapes |= dict.fromkeys(("sum3", "sum5", "part3", "part5", "before", "after"), 1)
    return Rows(lanes, shapes)


class AdaptiveMethod(Method):
    """The compiled integrator of a layout, with `count` tangent vectors for each trajectory.

    `transition`: the vectors begin as unit vectors and are left as they are: columns of the state-transition matrix.
    Otherwise they begin as orthonormal ones in no special direction, and are kept orthonormal.
    """

    effort = 20

    def __init__(
        self, layout: Layout, samples: int, tolerance: float, lanes: int | None, count: int, transition: bool
    ) -> None:
        lanes = lanes or (16 if 16 * adaptive_rows(layout, 1, count).size <= ROOM else 8)
        super().__init__(layout, adaptive_rows(layout, lanes, count), count)
        self.samples, self.tolerance, self.transition = samples, tolerance, transition
        follow = "follow(rows, l, at, n, count, skip, growth)" if count else ""
        driver = _DRIVER.format(lanes=lanes, n=layout.n, corners=layout.corners, count=count, follow=follow)
        begin, attempt = (_AdaptiveCode(layout, self.rows, count) for _ in range(2))
        self.function: Any = module_of(begin.begin(), attempt.attempt(), driver).adaptive
        self.begins = np.array([self.rows.begin[name] for name in VECTORS], dtype=np.int64)
        size = 2 * layout.n
        generic = np.linalg.qr(np.random.default_rng(0).normal(size=(size, size)))[0]
        #: the tangent vectors at the start, as columns (2n, count)
        self.first = (np.eye(size) if transition else generic)[:, :count]

    def numbers(self, numbers: Numbers) -> dict[str, Array]:
        inverse = np.linalg.inv(numbers.mass)
        outputs = inverse @ self.layout.outputs.T
        weight, omega = np.sqrt(np.diagonal(numbers.mass, axis1=1, axis2=2)), numbers.omega[:, None]
        rows = {
            "A": -inverse @ numbers.stiffness,
            "B": -inverse @ numbers.damping,
            "L": inverse @ numbers.loads,
            "E": outputs,
            "c": numbers.laws,
            "omega": omega,
            "period": 2.0 * np.pi / omega,
            "weight": weight,
            "metric": np.hstack([omega * weight, weight]),
        }
        if self.count:
            rows["G"] = self.layout.channels @ outputs
            rows["trace"] = -np.trace(inverse @ numbers.damping, axis1=1, axis2=2)
        return rows

    def start(self, group: Group, alive: int) -> None:
        batch, members, rows = group.batch, group.members, group.row
        rows("y")[:], sizes = batch.states[members].T, batch.sizes[members].T
        weight, period = rows("weight"), rows("period")[0]
        rows("past")[:] = sizes
        # modes of a projection matter by what they add to the motion of the structure
        share = 1.0 if isinstance(self.layout.system, ProjectedSystem) else 1e-3
        rows("floor")[:] = np.maximum(share * np.max(sizes * weight, axis=0) / weight, 1e-300)
        turns = self.layout.turns[:, None]
        rows("turn")[:], rows("fold")[:] = turns, turns if batch.folded else NO_TURN
        rows("h")[:] = rows("next")[:] = np.minimum(_FIRST_STEP, 1.0 / self.samples) * period
        rows("left")[:, :alive] = batch.total
        rows("h")[:, alive:] = 0.0
        rows("plain")[:] = float(self.transition)
        # tangent vectors are orthonormal in the metric of the parameters
        metric = np.ones_like(rows("metric")) if self.transition else rows("metric")
        rows("w")[:] = (self.first.T[:, :, None] / metric).reshape(-1, self.rows.lanes)
        if batch.first is not None:
            rows("sample")[0] = batch.first[members]
            rows("t")[0] = batch.first[members] / self.samples * period

    def advance(self, group: Group, effort: int) -> bool:
        """See `Method.advance`; so many steps of each are tried."""
        batch, begins = group.batch, group.step == 0
        group.step += effort
        done = self.function(
            group.z, self.begins, effort, begins, self.samples, batch.skip, self.tolerance, batch.address,
            group.states, group.peaks, batch.measure, group.growth,
        )  # fmt: skip
        return bool(done)

    def left(self, group: Group) -> float:
        return float(group.row("left").sum())

    def results(self, group: Group) -> dict[str, Array]:
        """See `Method.results`; failed are those whose steps became too short, or their numbers too large."""
        tangents = group.row("w").reshape(self.count, 2 * self.layout.n, self.rows.lanes).transpose(2, 1, 0)
        return {"end": group.row("y").T, "failed": group.row("failed")[0] > 0.0, "tangents": tangents}


class _AdaptiveCode(LawCode):
    """Writes `begin` and `attempt`."""

    def __init__(self, layout: Layout, rows: Rows, count: int) -> None:
        super().__init__(layout, rows)
        self.count = count
        #: derivatives of the forces that are not zero: output, channel, by its rate
        self.slopes: list[tuple[int, int, bool]] = []

    def begin(self) -> str:
        """The first stage and the flags, at the state itself."""
        n, z, code = self.n, self.z, self.code
        with code.block(f"for i in range({2 * n}):"):
            code.each(f"{z('trial', 'i')} = {z('y', 'i')}", f"{z('K', 12, 0, 'i')} = 0.0")
        code.each(f"{z('theta')} = {z('omega')} * {z('t')}")
        for at_corner in ("False", "{} > 0.0"):
            self._corners()
            for i in range(self.layout.corners):
                margin = z("g1", i)
                beyond = f"{margin} > 0.0 or ({margin} == 0.0 and {at_corner.format(z('dg1', i))})"
                code.each(f"{z('on', i)} = 1.0 if {beyond} else 0.0")
            if at_corner == "False":
                self._rate(slopes=False)
                with code.block(f"for i in range({2 * n}):"):
                    code.each(f"{z('K', 0, 0, 'i')} = {z('rate', 'i')}", f"{z('K', 12, 0, 'i')} = {z('rate', 'i')}")
        for i in range(self.layout.corners):
            code.each(f"{z('g', i)} = {z('g1', i)}", f"{z('dg', i)} = {z('dg1', i)}")
        return code.function("begin(z, address)")

    def attempt(self) -> str:
        """All stages of a step of length h from y, the error estimates, and the corners at its end.

        The first stage is the last one of the step before, but where a corner has been turned since: what was missed
        of it, times the jump in slope, would be an error of first order in the rate.
        """
        n, z, code = self.n, self.z, self.code
        code.raw(f"first = {0 if self.count else 1}")
        with code.block(f"for l in range({z.lanes}):"):
            code.raw(f"if {z('stale')} > 0.0:", "    first = 0")
        if self.count:
            code.each(f"{z('used')} = {z('h')}", f"{z('volume_rate')} = 0.0")
        with code.block("for s in range(first, 13):"):
            self._stage("trial", "y", "K", 2 * n)
            if self.count:
                self._stage("goal", "w", "W", 2 * n * self.count)
            code.raw("node = NODES[s]")
            code.each(f"{z('theta')} = {z('omega')} * ({z('t')} + node * {z('h')})")
            self._rate(slopes=bool(self.count))
            with code.block("if s == 0:"):
                with code.block(f"for i in range({2 * n}):"):
                    code.each(f"{z('K', 0, 0, 'i')} = {z('rate', 'i')} if {z('stale')} > 0.0 else {z('K', 0, 0, 'i')}")
                code.each(f"{z('stale')} = 0.0")
            with code.block("else:"), code.block(f"for i in range({2 * n}):"):
                code.each(f"{z('K', 's', 0, 'i')} = {z('rate', 'i')}")
            if self.count:
                with code.block("if s < 12:"):
                    self._tangents()
        with code.block(f"for i in range({2 * n}):"):
            self._errors(13, z("e3", "i"), z("e5", "i"), z("K", "j", 0, "i"))
        if self.count:
            self._tangent_errors()
        self._corners()
        return code.function("attempt(z, address)")

    def _stage(self, goal: str, origin: str, rates: str, size: int) -> None:
        """`goal = origin + h sum_j a_sj rates_j` in stage s, over so many rows."""
        z, code = self.z, self.code
        with code.block(f"for i in range({size}):"):
            code.each(f"{z(goal, 'i')} = 0.0")
            with code.block("for j in range(s):"):
                code.raw("a = STAGES[s, j]")
                with code.block("if a != 0.0:"):
                    code.each(f"{z(goal, 'i')} += a * {z(rates, f'j * {size} + i')}")
            code.each(f"{z(goal, 'i')} = {z(origin, 'i')} + {z('h')} * {z(goal, 'i')}")

    def _errors(self, stages: int, third: str, fifth: str, rate: str) -> None:
        """The two estimates of the error, over the step length."""
        code = self.code
        code.each(f"{third} = 0.0", f"{fifth} = 0.0")
        with code.block(f"for j in range({stages}):"):
            code.raw("a, b = ERROR_3[j], ERROR_5[j]")
            code.each(f"{third} += a * {rate}", f"{fifth} += b * {rate}")

    def _channels(self) -> list[str]:
        """Lines that read the phase and the channels at the trial state."""
        parts = [("q", lambda i: self.z("trial", i)), ("r", lambda i: self.z("trial", 1, i))]
        reading = [f"{kind}{j} = {self.along(j, entry)}" for j in range(self.m) for kind, entry in parts]
        return [f"theta = {self.z('theta')}", *reading]

    def _corners(self) -> None:
        """Margins of the corners and their rates, at the trial state and its rate in the last stage."""
        z, code = self.z, self.code
        if not self.layout.corners:
            return
        code.each(*self._channels())
        code.each(*(f"a{j} = {self.along(j, lambda i: z('K', 12, 1, i))}" for j in range(self.m)))
        code.each(f"omega = {z('omega')}")
        for placed in self.layout.laws:
            for i in range(placed.form.corners):
                lines, margin, rate = placed.form.corner(i, self.names(placed))
                corner = placed.corner + i
                code.each(*lines, f"{z('g1', corner)} = {margin}", f"{z('dg1', corner)} = {rate}")

    def _rate(self, slopes: bool) -> None:
        """The rate of the trial state, and the slopes of the forces."""
        n, z, code = self.n, self.z, self.code

        self.read(self._channels())
        forces, derivatives = self.forces(lambda placed: placed.form.frozen(self.names(placed), slopes))
        code.each(*(f"{z('F', o)} = {force}" for o, force in enumerate(forces)))
        if slopes:
            self.slopes = list(derivatives)
            code.each(*(f"{self._slope(*which)} = {text}" for which, text in derivatives.items()))
        for harmonic in sorted({harmonic for harmonic, _ in self.layout.waves if harmonic}):
            code.each(f"s{harmonic}, c{harmonic} = sine_cosine({float(harmonic)} * {z('theta')})")
        waves = [f"s{h}" if sine else f"c{h}" if h else "1.0" for h, sine in self.layout.waves]
        code.each(*(f"{z('wave', w)} = {wave}" for w, wave in enumerate(waves)))

        def loads(i: Index) -> str:
            return " + ".join(f"{z('L', i, w)} * {z('wave', w)}" for w in range(len(waves))) or "0.0"

        def velocity(i: Index) -> str:
            return z("trial", 1, i)

        code.rows("i", n, lambda i: code.each(f"{z('rate', i)} = {velocity(i)}"))
        self.row_sums(lambda i: z("rate", 1, i), loads, lambda j: z("trial", j), velocity, "F")

    def _slope(self, o: int, j: int, by_rate: bool) -> str:
        return self.z("S", o, j, int(by_rate))

    def _tangents(self) -> None:
        """Rates of the tangent vectors in stage s, and the rate of volume."""
        n, k, z, code = self.n, self.k, self.z, self.code
        damping = "".join(f" - {self._slope(o, j, True)} * {z('G', j, o)}" for o, j, rate in self.slopes if rate)
        code.each(f"{z('volume_rate')} += STAGES[12, s] * ({z('trace')}{damping})")

        def vector(i: Index) -> str:
            return z("goal", "c", 0, i)

        def its_rate(i: Index) -> str:
            return z("goal", "c", 1, i)

        with code.block(f"for c in range({self.count}):"):
            for o in range(k):
                terms = [
                    f"{self._slope(o, j, rate)} * ({self.along(j, its_rate if rate else vector)})"
                    for output, j, rate in self.slopes
                    if output == o
                ]
                code.each(f"{z('dF', o)} = {' + '.join(terms) or '0.0'}")
            code.rows("i", n, lambda i: code.each(f"{z('W', 's', 'c', 0, i)} = {its_rate(i)}"))
            self.row_sums(lambda i: z("W", "s", "c", 1, i), lambda _: "0.0", vector, its_rate, "dF")

    def _tangent_errors(self) -> None:
        """The error of the tangent vectors, each relative to its length, in units of the motion's tolerance."""
        n, z, code = self.n, self.z, self.code
        size, weight = 2 * n, z("metric", "i")
        code.each(f"{z('extra')} = 0.0")
        with code.block(f"for c in range({self.count}):"):
            code.each(*(f"{z(name)} = 0.0" for name in ("sum3", "sum5", "before", "after")))
            with code.block(f"for i in range({size}):"):
                self._errors(12, z("part3"), z("part5"), z("W", "j", "c", 0, "i"))
                parts = {
                    "sum3": z("part3"),
                    "sum5": z("part5"),
                    "before": z("w", "c", "i"),
                    "after": z("goal", "c", 0, "i"),
                }
                code.each(*(f"{z(name)} += ({weight} * {part}) ** 2" for name, part in parts.items()))
            code.each(
                f"length = {z('before')} if {z('before')} > {z('after')} else {z('after')}",
                f"mean = ({z('sum5')} + 0.01 * {z('sum3')}) * {size} * length",
                f"error = {_LOOSER} * {z('h')} * {z('sum5')} / sqrt(mean if mean > 0.0 else 1.0)",
                f"{z('extra')} = error if error > {z('extra')} else {z('extra')}",
            )
