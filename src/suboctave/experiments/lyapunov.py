"""`lyapunov_exponents`: how fast neighbouring motions part, or approach each other.

    lambda_i = lim log r_i(t) / t,   W(t) = Q R,   W' = Df(y(t), t) W

with tangent vectors W that are made orthonormal after every step (Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15,
1980), natural logarithms, per unit of time. Several trajectories on one attractor are followed side by side; their
stretches give the standard errors.

Averages of regular motions, periodic or quasi-periodic, converge much faster with smooth weights,
`exp(-1 / (s (1 - s)))` over a stretch 0 < s < 1, than with equal ones (Das et al., Nonlinearity 30, 2017);
those of chaotic motions do not. Both are taken; that with the smaller standard errors counts.

The rate at which two trajectories part: an estimate of the largest Lyapunov exponent from two simulations.

    delta(t) = |y_2(t) - y_1(t)| ~ delta(0) exp(lambda t)   until it is of the size of the attractor

(Alcorta et al. 2019, Eq. (15), and many others.) lambda is the slope of log delta by least squares up to `saturation`.
Between rounding and saturation there is room for a finite stretch only, so that the number depends on everything that
changes the trajectory: the step, the offset, where it begins. Here it is taken for many settings, to see how much.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Unpack, overload

import numpy as np

from suboctave.arguments import Count, Index, Positive, checked
from suboctave.errors import ConvergenceError, InputError, refuse_idle, shortened, suggest
from suboctave.experiments.common import On, SideBySideOptions, TimeResult, check_continuous, of_structures
from suboctave.experiments.poincare import state_sizes
from suboctave.model.elements.base import Array
from suboctave.model.inputs import check_omega, start_state, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.progress import Report, reporting
from suboctave.store.plain import Recorded
from suboctave.timedomain.flow import Flow, Motions, check_extent

#: how far from the first trajectory the others begin, in sizes of the motion
_APART = 1e-3
#: stretches of one trajectory
_STRETCHES = 4
#: periods that are left out and averaged over, and trajectories, by default
_TRANSIENT, _PERIODS, _TRAJECTORIES = 300, 1000, 16
#: standard errors beyond which the sign of an exponent counts, and what it must be at least, per radian of the load
_SURE, _LEAST = 5.0, 1e-5


@checked(result=True)
@dataclass(eq=False, repr=False)
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

    The table has one row per exponent. `plot` draws the running averages over the periods, with a band of two standard
    errors; options are those of `pictures.plot_lyapunov`: `count`, `title`, `size`.
    """

    contents = "lyapunov exponents"
    dimensions: ClassVar[Mapping[str, str]] = {"exponent": "1 / time", "standard_error": "1 / time"}
    picture = "plot_lyapunov"
    exponents: Annotated[Array, On("exponent")]
    standard_errors: Annotated[Array, On("exponent")]
    divergence: float
    by_trajectory: Annotated[Array, On("trajectory", "exponent")]
    stretches: Annotated[Array, On("stretch", "exponent")]
    running: Annotated[Array, On("period", "exponent")]
    smooth: bool
    omega: float
    parameters: Mapping[str, float]
    transient: int
    tolerance: float
    end: Annotated[Array, On("state")]
    system: System

    @property
    def per_period(self) -> Array:
        """(m,): the exponents per period of the load."""
        return self.exponents * (2.0 * np.pi / self.omega)

    @property
    def defect(self) -> float:
        """By how much the sum of all exponents misses the divergence, relative to the largest; NaN if some are missing.

        It is of the size of rounding: larger means that the smallest exponents could not be resolved.
        """
        if len(self.exponents) < 2 * self.integrated.n:
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

    def _derived(self) -> Mapping[str, Any]:
        return {"period": ("period", np.arange(1, len(self.running) + 1))}

    def _columns(self) -> Mapping[str, Any]:
        return {
            "exponent": self.exponents, "standard_error": self.standard_errors, "per_period": self.per_period,
        }  # fmt: skip

    def _in_words(self) -> str:
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
    omega: Positive,
    *,
    start: Any = None,
    parameters: Mapping[str, float] | None = None,
    transient: Index = _TRANSIENT,
    periods: Count = _PERIODS,
    count: Count | None = None,
    trajectories: Count = _TRAJECTORIES,
    method: Literal["variational"] = "variational",
    tolerance: float | None = None,
    **options: Unpack[SideBySideOptions],
) -> LyapunovExponents: ...


@overload
def lyapunov_exponents(
    system: System,
    omega: Positive,
    *,
    start: Any = None,
    parameters: Mapping[str, float] | None = None,
    method: Literal["two_trajectories"] | TwoTrajectories,
    **options: Unpack[SideBySideOptions],
) -> Separation: ...


@with_options(SideBySideOptions)
@timed
@of_structures
def lyapunov_exponents(
    system: System,
    omega: Positive,
    *,
    start: Any = None,
    parameters: Mapping[str, float] | None = None,
    transient: Index = _TRANSIENT,
    periods: Count = _PERIODS,
    count: Count | None = None,
    trajectories: Count = _TRAJECTORIES,
    method: str | TwoTrajectories = "variational",
    tolerance: float | None = None,
    **options: Unpack[SideBySideOptions],
) -> LyapunovExponents | Separation:
    """The Lyapunov exponents of the motion that a trajectory settles on, with their standard errors.

    Parameters
    ----------
    omega, parameters
        Of the load; other values of some parameters, by name.
    start
        Where the trajectory begins, (2n,), a periodic motion or an attractor; None for rest.
    transient, periods
        Periods of the load that are left out (twice: once to reach the attractor, once for trajectories and tangent
        vectors to forget where they began), and those over which each trajectory is averaged.
    count
        How many exponents, the largest first; default all 2n.
    trajectories
        How many are followed side by side. They begin on the attractor, a thousandth of its size apart, and are
        independent if the motion is chaotic.
    method
        "variational"; or "two_trajectories" (or a `TwoTrajectories` with settings of its own): the rate at which two
        trajectories part, as published studies often give it. It is a finite-time value, and its spread over settings
        says how far to trust it; it takes no `transient`, `periods`, `count`, `trajectories` and `tolerance`.
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
    first = start_state(system, start)
    values, omega = system.read_values(parameters), check_omega(omega)
    if method == "two_trajectories":
        method = TwoTrajectories()
    if isinstance(method, TwoTrajectories):
        own = {"transient": transient != _TRANSIENT, "periods": periods != _PERIODS, "count": count is not None,
               "trajectories": trajectories != _TRAJECTORIES, "tolerance": tolerance is not None}  # fmt: skip
        refuse_idle("two trajectories are compared; their settings are those of TwoTrajectories(...)", **own)
        with reporting(options.get("progress"), "two trajectories") as report:
            return separate(system, first, omega, values, method, options.get("workers"), report)
    if method != "variational":
        raise InputError(f"method={method!r}{suggest(str(method), ('variational', 'two_trajectories'))}")
    size = 2 * system.n
    count = size if count is None else count
    if count > size:
        raise InputError(f"count={count}: a system of {system.n} degrees of freedom has {size} exponents")
    check_extent(trajectories, transient + periods, trajectories * periods * (count + 1))
    flow = Flow(system, "accurate", tolerance=tolerance, tangents=count)
    with reporting(options.get("progress"), "Lyapunov exponents") as report:
        check_continuous(system, first, float(omega), values)
        starts = _starts(flow, first, omega, values, transient, trajectories)
        motions = flow.over(
            starts, omega, transient + periods, values, transient, workers=options.get("workers"), report=report
        ).checked()
    return _exponents(system, motions, omega, values, transient, 1e-10 if tolerance is None else tolerance)


def _exponents(
    system: System, motions: Motions, omega: float, values: Mapping[str, float], transient: int, tolerance: float
) -> LyapunovExponents:
    """The exponents from the growth (B, P, m + 1) of m tangent vectors, and of the volume, in every period."""
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
    each = over_stretches(rates, _STRETCHES if periods >= 8 * _STRETCHES else 1)
    rows = each.reshape(2, -1, k)
    means, errors = rows.mean(axis=1), np.full((2, k), np.nan)
    if rows.shape[1] > 1:
        errors = rows.std(axis=1, ddof=1) / np.sqrt(rows.shape[1])
    if several > 1:
        errors = np.maximum(errors, each.mean(axis=2).std(axis=1, ddof=1) / np.sqrt(several))
    equal, smooth = np.sum(errors[:, :-1] ** 2, axis=1)
    if not smooth < equal:
        return False, means[0], errors[0], rows[0]
    # over whole trajectories; what stretches differ from it by is what they may all have in common
    whole = np.einsum("p,bpk->bk", smooth_weights(periods), rates).mean(axis=0)
    return True, whole, np.maximum(errors[1], np.abs(whole - means[1])), rows[1]


def over_stretches(rates: Array, pieces: int) -> Array:
    """Averages (2, B, pieces, k) of rates (B, P, k) over equal stretches, with equal weights and with smooth ones."""
    count, periods, k = rates.shape
    length = periods // pieces
    cut = rates[:, periods - pieces * length :].reshape(count, pieces, length, k)
    weights = np.array([np.full(length, 1.0 / length), smooth_weights(length)])
    averages: Array = np.einsum("wp,bspk->wbsk", weights, cut)
    return averages


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
    motions = flow.over(first, omega, transient + 1, values, skip=max(transient - 1, 0), measure=True).checked()
    sizes = state_sizes(system, motions.peaks[0], omega, values)
    away = np.random.default_rng(0).normal(size=(count, 2 * system.n))
    away[0] = 0.0
    return motions.end[0] + _APART * sizes * away


@checked
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

    offset: Positive | tuple[Positive, ...] = 1e-14
    integrator: Literal["newmark", "accurate"] = "newmark"
    steps_per_period: tuple[Count, ...] = tuple(range(400, 1400, 10))
    tolerances: tuple[Positive, ...] = (1e-12, 1e-11, 1e-10, 1e-9, 1e-8)
    periods: Count = 300
    saturation: Positive = 1e-2

    def __post_init__(self) -> None:
        for name, given in (("steps_per_period", self.steps_per_period), ("tolerances", self.tolerances)):
            if not len(given):
                raise InputError(f"{name} must be several numbers, one for each setting, not {shortened(given)}")
        if np.size(self.offset) == 0:
            raise InputError("offset must be a number or several of them, not none")
        for offset in self.offsets:
            if offset >= 1.0:
                raise InputError(f"offset={self.offset!r} must be positive, and far below the size of the motion")
        if self.saturation > 1.0:
            raise InputError(f"saturation={self.saturation!r} must be a share of the size of the motion, up to 1")

    @property
    def offsets(self) -> tuple[float, ...]:
        """All offsets."""
        return tuple(float(offset) for offset in np.atleast_1d(self.offset))


@checked(result=True)
@dataclass(eq=False, repr=False)
class Separation(TimeResult):
    """How fast two trajectories parted, for many settings.

    Attributes
    ----------
    rates
        (S,): the exponent by each setting, natural logarithm per unit of time; NaN where the two did not part by a
        factor of ten.
    value, offset
        (S,): steps per period or tolerance, and offset; both in `settings` (S, 2).
    time, distance
        (P + 1,) and (S, P + 1): the distance at phase 0 of the load, displacements by omega times their value.

    The table has one row per setting. `plot` draws the distances over time, and their mean rate; options are those of
    `pictures.plot_separation`: `most`, `title`, `size`.
    """

    contents = "separation"
    dimensions: ClassVar[Mapping[str, str]] = {"exponent": "1 / time"}
    picture = "plot_separation"
    in_record: ClassVar[Mapping[str, type]] = {"TwoTrajectories": TwoTrajectories}
    rates: Annotated[Array, On("setting", name="rate")]
    value: Annotated[Array, On("setting")]
    offset: Annotated[Array, On("setting")]
    time: Annotated[Array, On("time")]
    distance: Annotated[Array, On("setting", "time")]
    omega: float
    parameters: Mapping[str, float]
    method: TwoTrajectories
    system: System

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

    @property
    def settings(self) -> Array:
        """Both numbers of each setting, (S, 2)."""
        return np.column_stack([self.value, self.offset])

    def _derived(self) -> Mapping[str, Any]:
        own = {"exponent": self.exponent, "spread": self.spread}
        return own | {name: getattr(self.method, name) for name in ("integrator", "saturation")}

    def _recorded(self) -> Mapping[str, Any]:
        return {"method": self.method}

    @classmethod
    def _from_record(cls, stored: Recorded) -> Mapping[str, Any]:
        return {"method": stored.record["method"]}

    def _columns(self) -> Mapping[str, Any]:
        setting = "steps_per_period" if self.method.integrator == "newmark" else "tolerance"
        return {setting: self.value, "offset": self.offset, "exponent": self.rates}

    def _in_words(self) -> str:
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
    newmark = how.integrator == "newmark"
    settings: Sequence[float] = how.steps_per_period if newmark else how.tolerances
    rates, distances = [], []
    time: Array = np.arange(how.periods + 1, dtype=float) * (2.0 * np.pi / float(omega))
    for i, setting in enumerate(settings):
        # what Newton's method leaves must stay below the offset
        steps, tolerance = (int(setting), 1e-14) if newmark else (1000, float(setting))
        flow = Flow(system, how.integrator, steps_per_period=steps, tolerance=tolerance, lanes=8)
        motions = flow.over(starts, omega, how.periods, values, workers=workers).whole()
        if motions.failed.any():
            motions.checked()
        states = np.concatenate([starts[:, None], motions.states], axis=1)
        size = float(np.max(np.linalg.norm(system.turns.modulo(states[0]) * metric, axis=1)))
        distances.append(np.linalg.norm(system.turns.modulo(states[1:] - states[0]) * metric, axis=2))
        rates += [_slope(time, distance, how.saturation * size) for distance in distances[-1]]
        if report is not None:
            report((i + 1) / len(settings), f"{i + 1} of {len(settings)} settings")
    distance = np.concatenate(distances)
    if n and not np.isfinite(distance).all():
        raise ConvergenceError("the motion leaves the range of numbers: it grows without bound")
    used, added = np.repeat(np.array(settings, dtype=float), len(offsets)), np.tile(offsets, len(settings))
    parameters = {**system.parameters, **values}
    return Separation(np.array(rates), used, added, time, distance, float(omega), parameters, how, system)


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
