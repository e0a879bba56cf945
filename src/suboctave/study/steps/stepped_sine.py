"""The step "stepped_sine": the virtual stepped-sine test, as a table of what a rig would measure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from suboctave.analysis import Table
from suboctave.analysis.stepped_sine import check_stepped_sine, stepped_sine
from suboctave.study.steps.base import Complaint, Context, Range, Step, Surroundings, tried

#: omega, degree of freedom, change of velocity
Tap = Annotated[list[float], Field(min_length=3, max_length=3)]


class SteppedSineStep(Step):
    """`so.stepped_sine` over `omega` in `steps`; `state` and the rest as there."""

    kind: ClassVar[str] = "stepped_sine"

    omega: Range
    steps: int = Field(default=200, ge=1)
    direction: Literal["up", "down", "both"] = "up"
    settle: int = Field(default=200, ge=1)
    measure: int = Field(default=60, ge=1)
    state: list[float] | None = None
    tap: Tap | None = None
    harmonics: list[float] = Field(default_factory=lambda: [0.0, 0.5, 1.0, 2.0, 3.0])
    noise: float = Field(default=0.0, ge=0.0)
    seed: int = Field(default=0, ge=0)
    observe: int | None = None

    def _arguments(self) -> dict[str, Any]:
        names = ("steps", "direction", "settle", "measure", "state", "harmonics", "noise", "seed", "observe")
        tap = self.tap and (self.tap[0], int(self.tap[1]), self.tap[2])
        return {name: getattr(self, name) for name in names} | {"tap": tap}

    def check(self, around: Surroundings) -> Iterator[Complaint]:
        """See `Step.check`."""
        if self.tap is not None and self.tap[1] != int(self.tap[1]):
            yield ("tap",), "tap is [omega, degree of freedom, change of velocity]: the second is a whole number"
            return
        arguments = self._arguments()
        yield from tried("omega", lambda: check_stepped_sine(around.system, tuple(self.omega), **arguments))

    def run(self, context: Context) -> Table:
        """See `Step.run`."""
        found = stepped_sine(context.system, tuple(self.omega), progress=context.progress, **self._arguments())
        frame = found.to_dataframe()
        columns = {str(name): np.asarray(frame[name].tolist()) for name in frame}
        said = f"stepped sine {' and '.join(found.directions)}, amplitudes of x_{found.observed}"
        return Table(columns, said, found)
