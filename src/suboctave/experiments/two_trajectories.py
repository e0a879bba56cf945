"""The rate at which two trajectories part: an estimate of the largest Lyapunov exponent from two simulations.

    delta(t) = |y_2(t) - y_1(t)| ~ delta(0) exp(lambda t)   until it is of the size of the attractor

(Alcorta et al. 2019, Eq. (15), and many others.) lambda is the slope of log delta by least squares up to `saturation`.
Between rounding and saturation there is room for a finite stretch only, so that the number depends on everything that
changes the trajectory: the step, the offset, where it begins. Here it is taken for many settings, to see how much.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.errors import ConvergenceError, InputError, check_numbers, shortened
from suboctave.experiments.time_result import Layout, TimeResult
from suboctave.interruption import pass_on
from suboctave.model.elements.base import Array
from suboctave.model.inputs import check_count
from suboctave.model.system import System
from suboctave.timedomain.flow import METHODS, Flow, Report, check_motions

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["Separation", "TwoTrajectories", "separate"]


@dataclass(frozen=True)
class TwoTrajectories:
    """How two trajectories are compared.

    Attributes
    ----------
    offset
        What is added to the displacement of the observed degree of freedom of the second one: a number, or several.
    integrator
        "newmark" or "accurate".
    steps_per_period
        Of Newmark's method, several numbers: one setting each. The accurate method takes `tolerances`.
    tolerances
        Of the accurate method, several: one setting each.
    periods
        How long they are followed, in periods of the load.
    saturation
        The distance, relative to the largest of the motion, at which the exponential growth is over.
    """

    offset: float | tuple[float, ...] = 1e-14
    integrator: str = "newmark"
    steps_per_period: tuple[int, ...] = tuple(range(400, 1400, 10))
    tolerances: tuple[float, ...] = (1e-12, 1e-11, 1e-10, 1e-9, 1e-8)
    periods: int = 300
    saturation: float = 1e-2

    def __post_init__(self) -> None:
        if self.integrator not in METHODS:
            raise InputError(f"integrator={self.integrator!r} must be one of {', '.join(METHODS)}")
        check_count("periods", self.periods)
        given: Any
        for name, given in (("steps_per_period", self.steps_per_period), ("tolerances", self.tolerances)):
            if not isinstance(given, Sequence) or isinstance(given, str) or not given:
                raise InputError(f"{name} must be several numbers, one for each setting, not {shortened(given)}")
        given = self.offset if isinstance(self.offset, tuple) else (self.offset,)
        if not given:
            raise InputError("offset must be a number or several of them, not none")
        for value in given:
            check_numbers(offset=value)
        check_numbers(saturation=self.saturation)
        for steps in self.steps_per_period:
            check_count("steps_per_period", steps)
        if not all(0.0 < offset < 1.0 for offset in self.offsets):
            raise InputError(f"offset={self.offset!r} must be positive, and far below the size of the motion")
        if not 0.0 < self.saturation <= 1.0:
            raise InputError(f"saturation={self.saturation!r} must be a share of the size of the motion, up to 1")

    @property
    def offsets(self) -> tuple[float, ...]:
        """All offsets."""
        return self.offset if isinstance(self.offset, tuple) else (float(self.offset),)


@dataclass(eq=False)
class Separation(TimeResult):
    """How fast two trajectories parted, for many settings.

    Attributes
    ----------
    rates
        (S,): the exponent by each setting, natural logarithm per unit of time; NaN where the two did not part by a
        factor of ten.
    settings
        (S, 2): steps per period or tolerance, and offset.
    time, distance
        (P + 1,) and (S, P + 1): the distance at phase 0 of the load, displacements by omega times their value.
    """

    layout = Layout(
        "separation",
        {"time": ("time",), "rates": ("setting",), "distance": ("setting", "time")},
        {"omega": float},
        {"rates": "rate"},
    )
    rates: Array
    settings: Array
    time: Array
    distance: Array
    omega: float
    parameters: Mapping[str, float]
    method: TwoTrajectories
    system: System
    seconds: float = 0.0

    @property
    def exponent(self) -> float:
        """The mean over the settings; NaN if no two parted."""
        kept = self.rates[np.isfinite(self.rates)]
        return float(kept.mean()) if len(kept) else np.nan

    @property
    def spread(self) -> float:
        """The standard deviation of one setting's value: what a single run of this method is worth."""
        kept = self.rates[np.isfinite(self.rates)]
        return float(kept.std(ddof=1)) if len(kept) > 1 else np.nan

    def to_xarray(self) -> xarray.Dataset:
        """Rates and settings, distances over time."""
        variables = {"value": (("setting",), self.settings[:, 0]), "offset": (("setting",), self.settings[:, 1])}
        attributes = {
            "exponent": self.exponent,
            "spread": self.spread,
            "integrator": self.method.integrator,
            "saturation": self.method.saturation,
        }
        return self._dataset(variables, attributes=attributes)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per setting: steps per period or tolerance, offset, exponent."""
        import pandas as pd

        setting = "steps_per_period" if self.method.integrator == "newmark" else "tolerance"
        return pd.DataFrame({setting: self.settings[:, 0], "offset": self.settings[:, 1], "exponent": self.rates})

    def plot(self, path: Any = None, **options: Any) -> Any:
        """The distances over time, and their mean rate; saved if a path is given.

        Options are those of `pictures.plot_separation`: `most`, `title`, `size`.
        """
        from suboctave.pictures.chaos import plot_separation

        return plot_separation(self.to_xarray(), path, **options)

    def __repr__(self) -> str:
        low, high = np.nanpercentile(self.rates, [5, 95]) if np.isfinite(self.rates).any() else (np.nan, np.nan)
        return (
            f"Separation(exponent {self.exponent:.4g}, standard deviation {self.spread:.2g} over {len(self.rates)} "
            f"settings, nine of ten from {low:.4g} to {high:.4g}, at omega={self.omega:.8g})"
        )


def separate(
    system: System,
    first: Array,
    omega: float,
    values: Mapping[str, float],
    how: TwoTrajectories,
    workers: int | None,
    report: Report | None,
) -> Separation:
    """Follow two trajectories from `first` (2n,) for all settings."""
    n, offsets = system.n, np.array(how.offsets)
    starts = np.repeat(first[None], len(offsets) + 1, axis=0)
    starts[1:, system.observed_dof] += offsets
    weight = np.sqrt(np.diagonal(system.mass.value({**system.parameters, **values})))
    metric: Array = np.concatenate([float(omega) * weight, weight])
    settings = how.steps_per_period if how.integrator == "newmark" else how.tolerances
    rates, rows, distances = [], [], []
    time: Array = np.arange(how.periods + 1, dtype=float) * (2.0 * np.pi / float(omega))
    for i, setting in enumerate(settings):
        if how.integrator == "newmark":
            # what Newton's method leaves must stay below the offset
            flow = Flow(system, "newmark", steps_per_period=int(setting), tolerance=1e-14, lanes=8)
        else:
            flow = Flow(system, "accurate", tolerance=float(setting), lanes=8)
        motions = flow.over(starts, omega, how.periods, values, workers=workers)
        pass_on(motions.interruption)
        if motions.failed.any():
            check_motions(motions)
        states = np.concatenate([starts[:, None], motions.states], axis=1) * metric
        size = float(np.max(np.linalg.norm(states[0], axis=1)))
        for offset, other in zip(offsets, states[1:], strict=True):
            distance = np.linalg.norm(other - states[0], axis=1)
            distances.append(distance)
            rates.append(_slope(time, distance, how.saturation * size))
            rows.append((float(setting), offset))
        if report is not None:
            report((i + 1) / len(settings), f"{i + 1} of {len(settings)} settings")
    if n and not np.isfinite(np.array(distances)).all():
        raise ConvergenceError("the motion leaves the range of numbers: it grows without bound")
    return Separation(
        np.array(rates), np.array(rows), time, np.array(distances), float(omega), {**system.parameters, **values},
        how, system,
    )  # fmt: skip


def _slope(time: Array, distance: Array, limit: float) -> float:
    """Slope of log distance until it first reaches `limit`; NaN if it never does, or grows tenfold at most."""
    beyond = np.flatnonzero(distance >= limit)
    if not len(beyond) or beyond[0] < 3:
        return np.nan
    kept = slice(0, int(beyond[0]) + 1)
    positive = distance[kept] > 0.0
    if positive.sum() < 3 or distance[beyond[0]] < 10.0 * distance[0]:
        return np.nan
    return float(np.polyfit(time[kept][positive], np.log(distance[kept][positive]), 1)[0])
