"""What a stepped-sine test brings: amplitudes and phases over frequency, as tables, datasets and pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import InputError, suggest
from suboctave.experiments.common import ComplexArray
from suboctave.experiments.time_result import Layout, TimeResult
from suboctave.model.elements.base import Array
from suboctave.model.inputs import observed_dof
from suboctave.model.system import System

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["SteppedSine"]


@dataclass(eq=False)
class SteppedSine(TimeResult):
    """A virtual stepped-sine test in S directions over V frequencies.

    Attributes
    ----------
    omega
        (V,), increasing whatever the direction.
    directions
        S of "up", "down".
    multiples
        (K,): the components that were measured, in multiples of omega.
    components
        (S, V, K, n): their complex amplitudes `c` in `x = Re c exp(i k omega t)`, t from phase 0 of the load; nan where
        nothing was measured.
    response
        (S, V, n): the fundamental by cross- over auto-spectrum, times the load's amplitude; phase relative to the load.
    largest
        (S, V, n): the largest |x| between the samples too, without noise.
    period
        (S, V): in periods of the load, 0 where nothing repeats (not settled, quasi-periodic, chaotic), -1 where nothing
        was measured.
    ends
        (S, V, 2n): the states at the end of each step, at phase 0 of the load.
    tapped
        (S,): at which frequency the tap was given, nan without one.
    complete
        False where an interruption (Ctrl-C) left steps out.
    """

    layout = Layout(
        "stepped sine",
        {
            "directions": ("direction",),
            "omega": ("omega",),
            "multiples": ("multiple",),
            "components": ("direction", "omega", "multiple", "dof"),
            "response": ("direction", "omega", "dof"),
            "largest": ("direction", "omega", "dof"),
            "period": ("direction", "omega"),
            "ends": ("direction", "omega", "state"),
            "tapped": ("direction",),
        },
        {"settle": int, "measure": int, "noise": float, "observed": int, "complete": bool},
        {"directions": "direction", "multiples": "multiple", "components": "component"},
    )
    omega: Array
    directions: tuple[str, ...]
    multiples: Array
    components: ComplexArray
    response: ComplexArray
    largest: Array
    period: NDArray[np.int_]
    ends: Array
    tapped: Array
    complete: bool
    settle: int
    measure: int
    noise: float
    observed: int
    system: System
    seconds: float = 0.0

    def of(self, direction: str | None = None) -> int:
        """Which row a direction is; without a name that of the only one."""
        if direction is None:
            if len(self.directions) > 1:
                raise InputError("say which direction: up or down")
            return 0
        if direction not in self.directions:
            raise InputError(f"there is no sweep {direction!r}{suggest(str(direction), self.directions)}")
        return self.directions.index(direction)

    def harmonic(self, k: float = 1, dof: int | None = None, direction: str | None = None) -> ComplexArray:
        """Complex amplitudes (V,) at `k omega`; that of the fundamental is `response`."""
        row, at = self.of(direction), self.observed if dof is None else observed_dof(self.system, dof)
        if k == 1:
            return self.response[row, :, at]
        at_k = np.flatnonzero(np.abs(self.multiples - k) < 1e-9)
        if not at_k.size:
            raise InputError(f"k={k:g} was not measured: harmonics= asks for it; there are {self.multiples.tolist()}")
        return self.components[row, :, int(at_k[0]), at]

    def amplitude(self, direction: str | None = None) -> Array:
        """|X_1| of the observed degree of freedom, (V,)."""
        return np.abs(self.harmonic(1, None, direction))

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per measured step: direction, omega, amplitude and phase of the fundamental, others, period."""
        import pandas as pd

        rows = []
        for s, direction in enumerate(self.directions):
            for v in np.flatnonzero(self.period[s] >= 0):
                x = complex(self.response[s, v, self.observed])
                row = {"direction": direction, "omega": self.omega[v], "amplitude": abs(x),
                       "phase_deg": math.degrees(math.atan2(x.imag, x.real))}  # fmt: skip
                for k, c in zip(self.multiples, self.components[s, v, :, self.observed], strict=True):
                    if k != 1.0:
                        row[f"harmonic_{k:g}"] = abs(c)
                rows.append(row | {"largest": self.largest[s, v, self.observed], "period": self.period[s, v]})
        names = ["direction", "omega", "amplitude", "phase_deg"]
        names += [f"harmonic_{k:g}" for k in self.multiples if k != 1.0]
        return pd.DataFrame(rows, columns=[*names, "largest", "period"])

    def to_xarray(self) -> xarray.Dataset:
        """Components on (direction, omega, multiple, dof), real and imaginary parts apart, and what produced them."""
        return self._dataset()

    def plot(self, path: Any = None, curves: Any = None, measured: Any = None, **options: Any) -> Any:
        """Draw the measured fundamentals, over branches and beside data of a rig if any are given; saved to a path.

        Options are those of `pictures.plot_stepped_sine`: `harmonic`, `dof`, `title`, `size`.
        """
        from suboctave.pictures.in_time import plot_stepped_sine

        return plot_stepped_sine(self.to_xarray(), path, curves=curves, measured=measured, **options)

    def __repr__(self) -> str:
        done, settled = int((self.period >= 0).sum()), int((self.period > 0).sum())
        taps = [f", tapped at omega = {w:.6g} on the way {d}" for w, d in zip(self.tapped, self.directions, strict=True)
                if np.isfinite(w)]  # fmt: skip
        return (
            f"SteppedSine(omega from {self.omega[0]:g} to {self.omega[-1]:g}, {' and '.join(self.directions)}, "
            f"{done} steps, {settled} of them settled{''.join(taps)}{'' if self.complete else ', not complete'})"
        )
