"""The step "lyapunov_exponents": how fast neighbours of a motion part, one row for each exponent."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field

from suboctave.analysis import Table, lyapunov_exponents
from suboctave.analysis.integration import start_state
from suboctave.study.steps.base import Complaint, Context, Step, Surroundings, as_table, tried


class Lyapunov(Step):
    """`so.lyapunov_exponents` from a `state`, default rest, at one frequency."""

    kind: ClassVar[str] = "lyapunov_exponents"

    omega: float = Field(gt=0.0)
    state: list[float] | None = None
    periods: int = Field(default=1000, ge=1)
    transient: int = Field(default=300, ge=0)
    count: int | None = Field(default=None, ge=1)
    trajectories: int = Field(default=16, ge=1)
    tolerance: float | None = Field(default=None, ge=1e-15, le=1e-2)

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        yield from tried("state", lambda: start_state(around.system, self.state))
        if self.count is not None and self.count > 2 * around.system.n:
            yield ("count",), f"is at most {2 * around.system.n}, two for each degree of freedom"

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
        found = lyapunov_exponents(
            context.system, self.state, omega=self.omega, periods=self.periods, transient=self.transient,
            count=self.count, trajectories=self.trajectories, tolerance=self.tolerance, progress=context.progress,
        )  # fmt: skip
        rows = list(zip(found.exponents, found.standard_errors, found.per_period, strict=True))
        names = ("exponent", "standard_error", "per_period")
        said = f"Lyapunov exponents at omega = {self.omega:g}"
        return Table(as_table(names, (float, float, float), rows), said, found)
