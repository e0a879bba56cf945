"""What is asked of one periodic motion, whatever holds it: an orbit, a point of a curve, a located bifurcation.

The answers are given in rooms above those of the motions, and are imported when they are asked for.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from suboctave.arguments import checked
from suboctave.errors import GivenDof

if TYPE_CHECKING:
    import pandas


def answer(name: str) -> Any:
    """A function of the room of results."""
    return getattr(importlib.import_module(f"{__package__}.results.motion"), name)


@checked(result=True)
class Motion:
    """One periodic motion."""

    @property
    def stable(self) -> bool:
        """Whether the motion is stable; of a bifurcation, whether it is but for the multipliers that are critical."""
        result: bool = answer("stable")(self)
        return result

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Draw it over one period, saved if a path is given; options are those of `suboctave.plot_history`.

        `suboctave.plot_phase` and `suboctave.plot_spectrum` draw it otherwise.
        """
        return answer("plot")(self, path, options)

    def _repr_html_(self) -> str:
        return str(answer("cell")(self))

    def spectrum(self, dof: GivenDof | None = None) -> pandas.DataFrame:
        """Its components, one row each: `harmonic` (multiple of omega), `omega`, `hertz`, `amplitude` and `phase`.

        The component is `amplitude cos(harmonic omega t + phase)`, phase in radians. `dof`: of which degree of freedom,
        by number or name; default the observed one.
        """
        table: pandas.DataFrame = answer("spectrum")(self, dof)
        return table

    def to_dataframe(self, samples: int = 200) -> pandas.DataFrame:
        """One row per instant over one period, both ends included: `time`, displacements and velocities.

        Columns are `x_0, ..., v_0, ...`, or `x_NAME` and `v_NAME` where degrees of freedom have names.
        """
        table: pandas.DataFrame = answer("to_dataframe")(self, samples)
        return table
