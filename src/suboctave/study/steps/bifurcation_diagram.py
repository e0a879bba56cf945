"""The step "bifurcation_diagram": the response with the branches that bifurcate from it."""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import Field

from suboctave.analysis import BifurcationDiagram, bifurcation_diagram
from suboctave.study.steps.base import Context
from suboctave.study.steps.frequency_response import FrequencyResponse


class Diagram(FrequencyResponse):
    """`so.bifurcation_diagram`: a frequency response, and `depth` bifurcations deep what leaves it."""

    kind: ClassVar[str] = "bifurcation_diagram"
    gives_branch: ClassVar[bool] = False
    gives_diagram: ClassVar[bool] = True

    depth: int = Field(default=2, ge=0)
    max_branches: int = Field(default=32, ge=1)

    def run(self, context: Context) -> BifurcationDiagram:
        """See `Step.run`."""
        options: dict[str, Any] = self.options(context)
        omega: Any = tuple(self.omega)
        options |= {"start": self.started(context), "max_branches": self.max_branches}
        return bifurcation_diagram(context.system, omega, self.depth, keeper=context.keeper, **options)
