"""`lyapunov_exponents`: how fast neighbouring motions part, or approach each other.

    lambda_i = lim log r_i(t) / t,   W(t) = Q R,   W' = Df(y(t), t) W

with tangent vectors W that are made orthonormal after every step (Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15,
1980), natural logarithms, per unit of time. Several trajectories on one attractor are followed side by side; their
stretches give the standard errors.

Averages of regular motions, periodic or quasi-periodic, converge much faster with smooth weights,
`exp(-1 / (s (1 - s)))` over a stretch 0 < s < 1, than with equal ones (Das et al., Nonlinearity 30, 2017);
those of chaotic motions do not. Both are taken; that with the smaller standard errors counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.experiments.attractors import state_sizes
from suboctave.experiments.common import ParallelOptions, check_continuous, start_state
from suboctave.experiments.time_result import Layout, TimeResult
from suboctave.experiments.two_trajectories import Separation, TwoTrajectories, separate
from suboctave.interruption import pass_on
from suboctave.model.elements.base import Array
from suboctave.model.inputs import check_count, check_omega, read_values
from suboctave.model.system import System
from suboctave.model.timed import timed
from suboctave.options import with_options
from suboctave.progress import reporting
from suboctave.timedomain.flow import Flow, Motions, check_extent, check_motions

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["LyapunovExponents", "lyapunov_exponents", "smooth_weights"]

#: how far from the first trajectory the others begin, in sizes of the motion
_APART = 1e-3
#: stretches of one trajectory
_STRETCHES = 4
#: standard errors beyond which the sign of an exponent counts, and what it must be at least, per radian of the load
_SURE, _LEAST = 5.0, 1e-5


@dataclass(eq=False)
class LyapunovExponents(TimeResult):
    """Lyapunov exponents of the motion that a trajectory settles on.

    Attributes
    ----------
    exponents
        (m,): natural logarithms per unit of time, falling.
    standard_errors
        (m,): of each, from stretches of the trajectories, or from the trajectories, whichever is larger.
    divergence
        The mean rate of volume: the sum of all 2n exponents (Liouville). It is `-trace M^-1 C` without nonlinear
        dampers.
    by_trajectory
        (B, m): what every trajectory alone gives. Very different ones have settled on different motions.
    stretches
        (N, m): what every stretch gives.
    running
        (P, m): the averages over the first periods, over all trajectories.
    smooth
        Whether smooth weights gave the smaller standard errors.
    """

    layout = Layout(
        "lyapunov exponents",
        {
            "exponents": ("exponent",),
            "standard_errors": ("exponent",),
            "by_trajectory": ("trajectory", "exponent"),
            "stretches": ("stretch", "exponent"),
            "running": ("period", "exponent"),
            "end": ("state",),
        },
        {"omega": float, "divergence": float, "smooth": bool, "transient": int, "tolerance": float},
    )
    exponents: Array
    standard_errors: Array
    divergence: float
    by_trajectory: Array
    stretches: Array
    running: Array
    smooth: bool
    omega: float
    parameters: Mapping[str, float]
    transient: int
    tolerance: float
    end: Array
    system: System
    seconds: float = 0.0

    @property
    def per_period(self) -> Array:
        """(m,): the exponents per period of the load."""
        return self.exponents * (2.0 * np.pi / self.omega)

    @property
    def defect(self) -> float:
        """By how much the sum of all exponents misses the divergence, relative to the largest; NaN if some are missing.

        It is of the size of rounding: larger means that the smallest exponents could not be resolved.
        """
        if len(self.exponents) < 2 * self.system.n:
            return np.nan
        largest = max(float(np.max(np.abs(self.exponents))), abs(self.divergence), np.finfo(float).tiny)
        return float(abs(self.exponents.sum() - self.divergence) / largest)

    @property
    def chaotic(self) -> bool | None:
        """Whether the largest exponent is positive beyond doubt; None where five standard errors do not decide."""
        doubt = max(_SURE * float(self.standard_errors[0]), _LEAST * self.omega)
        if not np.isfinite(doubt):
            return None
        if self.exponents[0] > doubt:
            return True
        return False if self.exponents[0] < -doubt or self.smooth else None

    @property
    def dimension(self) -> float:
        """Kaplan and Yorke's dimension of the attractor in the stroboscopic section; NaN if too few exponents."""
        total = np.cumsum(self.exponents)
        if total[0] < 0.0:
            return 0.0
        if (total >= 0.0).all():
            return np.nan
        k = int(np.flatnonzero(total < 0.0)[0])
        return float(k + total[k - 1] / abs(self.exponents[k]))

    def to_xarray(self) -> xarray.Dataset:
        """Exponents with their errors, what trajectories and stretches give, the running averages."""
        return self._dataset(coordinates={"period": np.arange(1, len(self.running) + 1)})

    def to_dataframe(self) -> pandas.DataFrame:
        """One row for each exponent."""
        import pandas as pd

        return pd.DataFrame({
            "exponent": self.exponents, "standard_error": self.standard_errors, "per_period": self.per_period,
        })  # fmt: skip

    def plot(self, path: Any = None, **options: Any) -> Any:
        """The running averages over the periods, with a band of two standard errors; saved if a path is given.

        Options are those of `pictures.plot_lyapunov`: `count`, `title`, `size`.
        """
        from suboctave.pictures.chaos import plot_lyapunov

        return plot_lyapunov(self.to_xarray(), path, **options)

    def __repr__(self) -> str:
        values = ", ".join(
            f"{value:.5g} +- {error:.1g}"
            for value, error in zip(self.exponents[:4], self.standard_errors[:4], strict=True)
        )
        more = ", ..." if len(self.exponents) > 4 else ""
        word = {True: "chaotic", False: "regular", None: "undecided"}[self.chaotic]
        return f"LyapunovExponents({values}{more} at omega={self.omega:.8g}: {word})"


@overload
def lyapunov_exponents(
    system: System,
    state: Any = None,
    *,
    omega: float,
    parameters: Mapping[str, float] | None = None,
    periods: int = 1000,
    transient: int = 300,
    count: int | None = None,
    trajectories: int = 16,
    method: Literal["variational"] = "variational",
    tolerance: float | None = None,
    **options: Unpack[ParallelOptions],
) -> LyapunovExponents: ...


@overload
def lyapunov_exponents(
    system: System,
    state: Any = None,
    *,
    omega: float,
    parameters: Mapping[str, float] | None = None,
    method: Literal["two_trajectories"] | TwoTrajectories,
    **options: Unpack[ParallelOptions],
) -> Separation: ...


@with_options(ParallelOptions)
@timed
def lyapunov_exponents(
    system: System,
    state: Any = None,
    *,
    omega: float,
    parameters: Mapping[str, float] | None = None,
    periods: int = 1000,
    transient: int = 300,
    count: int | None = None,
    trajectories: int = 16,
    method: str | TwoTrajectories = "variational",
    tolerance: float | None = None,
    **options: Unpack[ParallelOptions],
) -> LyapunovExponents | Separation:
    """The Lyapunov exponents of the motion that a trajectory settles on, with their standard errors.

    Parameters
    ----------
    state
        Where the trajectory begins, (2n,), a periodic motion or an attractor; None for rest.
    omega, parameters
        Of the load; other values of some parameters, by name.
    periods, transient
        Periods of the load over which each trajectory is averaged, after some that are left out (twice: once to reach
        the attractor, once for trajectories and tangent vectors to forget where they began).
    count
        How many exponents, the largest first; default all 2n.
    trajectories
        How many are followed side by side. They begin on the attractor, a thousandth of its size apart, and are
        independent if the motion is chaotic.
    method
        "variational"; or "two_trajectories" (or a `TwoTrajectories` with settings of its own): the rate at which two
        trajectories part, as published studies often give it. It is a finite-time value, and its spread over settings
        says how far to trust it; `periods`, `transient`, `count`, `trajectories`, `tolerance` do not concern it.
    tolerance
        Local error relative to the size of the motion (default 1e-10).

    Forces must be continuous: where one jumps, neighbours part by a jump of their own that the derivative of the flow
    does not contain. Laws of this package and forces given as text are; those of one's own are examined along the
    motion, and refused where they jump.

    Raises
    ------
    InputError
        Before any work.
    ConvergenceError
        If a motion leaves the range of numbers.
    """
    first = start_state(system, state)
    values, omega = read_values(system, parameters), check_omega(omega)
    if method == "two_trajectories":
        method = TwoTrajectories()
    if isinstance(method, TwoTrajectories):
        with reporting(options.get("progress"), "two trajectories") as report:
            return separate(system, first, omega, values, method, options.get("workers"), report)
    if method != "variational":
        raise InputError(f"method={method!r}{suggest(str(method), ('variational', 'two_trajectories'))}")
    size = 2 * system.n
    count = size if count is None else check_count("count", count)
    if count > size:
        raise InputError(f"count={count}: a system of {system.n} degrees of freedom has {size} exponents")
    periods, trajectories = check_count("periods", periods), check_count("trajectories", trajectories)
    transient = check_count("transient", transient, 0)
    check_extent(trajectories, transient + periods, trajectories * periods * (count + 1))
    flow = Flow(system, "accurate", tolerance=tolerance, tangents=count)
    with reporting(options.get("progress"), "Lyapunov exponents") as report:
        check_continuous(system, first, float(omega), values)
        starts = _starts(flow, first, omega, values, transient, trajectories)
        motions = flow.over(
            starts, omega, transient + periods, values, transient, workers=options.get("workers"), report=report
        )
    pass_on(motions.interruption)
    check_motions(motions)
    return _exponents(system, motions, omega, values, transient, 1e-10 if tolerance is None else tolerance)


def _exponents(
    system: System, motions: Motions, omega: float, values: Mapping[str, float], transient: int, tolerance: float
) -> LyapunovExponents:
    """The exponents from the growth (B, P, m + 1) of m tangent vectors, and of the volume, in every period."""
    assert motions.growth is not None
    periods, count = motions.growth.shape[1], motions.growth.shape[2] - 1
    rates = motions.growth * (omega / (2.0 * np.pi))
    smooth, mean, error, stretches = averaged(rates)
    order = np.argsort(-mean[:count], kind="stable")
    weights = smooth_weights(periods) if smooth else np.full(periods, 1.0 / periods)
    return LyapunovExponents(
        exponents=mean[order],
        standard_errors=error[order],
        divergence=float(mean[count]),
        by_trajectory=np.einsum("p,bpm->bm", weights, rates[..., :count])[:, order],
        stretches=stretches[:, order],
        running=np.cumsum(rates[..., :count].mean(axis=0), axis=0) / np.arange(1, periods + 1)[:, None],
        smooth=smooth,
        omega=omega,
        parameters={**system.parameters, **values},
        transient=transient,
        tolerance=tolerance,
        end=motions.end[0],
        system=system,
    )


def averaged(rates: Array) -> tuple[bool, Array, Array, Array]:
    """Averages of rates (B, P, k): whether smooth weights are better, means and standard errors (k,), stretches."""
    several, periods, k = rates.shape
    pieces = _STRETCHES if periods >= 8 * _STRETCHES else 1
    length = periods // pieces
    cut = rates[:, periods - pieces * length :].reshape(several * pieces, length, k)
    # over whole trajectories; what stretches differ from it by is what they may all have in common
    whole = np.einsum("p,bpk->bk", smooth_weights(periods), rates).mean(axis=0)
    best: tuple[bool, Array, Array, Array] | None = None
    least = np.inf
    for smooth in (False, True):
        weights = smooth_weights(length) if smooth else np.full(length, 1.0 / length)
        rows = np.einsum("p,npk->nk", weights, cut)
        error = np.full(k, np.nan)
        if len(rows) > 1:
            error = rows.std(axis=0, ddof=1) / np.sqrt(len(rows))
        if several > 1:
            each = rows.reshape(several, pieces, k).mean(axis=1)
            error = np.maximum(error, each.std(axis=0, ddof=1) / np.sqrt(several))
        mean = rows.mean(axis=0)
        score = float(np.sum(error[:-1] ** 2))
        if smooth:
            mean, error = whole, np.maximum(error, np.abs(whole - mean))
        if best is None or score < least:
            best, least = (smooth, mean, error, rows), score
    assert best is not None
    return best


def smooth_weights(count: int) -> Array:
    """Weights (count,) of sum one that vanish at both ends with all their derivatives."""
    if count < 3:
        return np.full(count, 1.0 / count)
    s = np.arange(1, count + 1) / (count + 1)
    w: Array = np.exp(4.0 - 1.0 / (s * (1.0 - s)))
    return w / w.sum()


def _starts(flow: Flow, first: Array, omega: float, values: Mapping[str, float], transient: int, count: int) -> Array:
    """States (count, 2n): the end of a transient, and others about it."""
    system = flow.system
    motions = flow.over(first, omega, transient + 1, values, skip=max(transient - 1, 0), measure=True)
    pass_on(motions.interruption)
    check_motions(motions)
    assert motions.peaks is not None
    sizes = state_sizes(system, motions.peaks[0], omega, values)
    away = np.random.default_rng(0).normal(size=(count, 2 * system.n))
    away[0] = 0.0
    return motions.end[0] + _APART * sizes * away
