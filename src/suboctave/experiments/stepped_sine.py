"""`stepped_sine`: the virtual stepped-sine test, as a rig would run it; Alcorta et al. 2019, section 5.4.

The frequency goes in steps, the motion is carried on and the load's phase is continuous. At each step the motion
settles, then response and load are measured over whole periods. With X_m and P_m the components at omega of response
and load in measured period m,

    X_1 = P sum_m X_m conj(P_m) / sum_m |P_m|^2,

the cross-spectrum over the auto-spectrum of the load (the estimate H1) times the load's amplitude P: what a
harmonic-balance branch calls `harmonic(1)`, phase relative to the load. Noise on the measured response averages out.

What a stepped-sine test brings: amplitudes and phases over frequency, as tables, datasets and pictures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Unpack

import numpy as np
from numpy.typing import NDArray

from suboctave.arguments import Range, checked
from suboctave.errors import InputError, is_number, refuse_idle, shortened, suggest
from suboctave.experiments.common import (
    FEW,
    ComplexArray,
    Integration,
    On,
    PeaksOn,
    RecognitionOptions,
    TimeResult,
    checked_integration,
    of_structures,
)
from suboctave.experiments.grids import checked_directions, checked_grid
from suboctave.experiments.poincare import attractor_of
from suboctave.interruption import Interruption
from suboctave.model.elements.base import Array
from suboctave.model.inputs import check_count, observed_dof, start_state, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.progress import Report, reporting
from suboctave.projection import COMPLETE
from suboctave.timedomain.flow import Flow, check_extent

_DIRECTIONS = ("up", "down")
_SAMPLES = 128


@with_options(RecognitionOptions)
@timed
@of_structures
def stepped_sine(
    system: System,
    omega: Range,
    *,
    values: int | Sequence[float] = 201,
    direction: str | Sequence[str] = "up",
    start: Any = None,
    transient: int = 200,
    periods: int = 60,
    tap: tuple[float, int, float] | None = None,
    harmonics: Sequence[float] = (0, 0.5, 1, 2, 3),
    noise: float = 0.0,
    seed: int = 0,
    **options: Unpack[RecognitionOptions],
) -> SteppedSine:
    """Step a sine through a range of frequencies and measure the response, as a rig does.

    Parameters
    ----------
    omega
        The range of frequencies `(from, to)`; the order is irrelevant.
    values
        How many frequencies, evenly spread over the range; or these frequencies.
    direction
        "up", "down", or both in a sequence: two tests, each from `start`.
    start
        Where each test begins, (2n,), a periodic motion or an attractor; default rest.
    transient, periods
        Periods of the load at each frequency that are left out, and those that are measured. Sub-harmonic motions need
        `periods` that their period divides (60: up to 6T, and 10T).
    tap
        `(omega, dof, velocity)`: when a test arrives at or first passes this frequency, the velocity of a degree of
        freedom is changed by so much, at phase 0 of the load and after settling. It may lead to another motion.
    harmonics
        Multiples of omega whose components are measured; `periods` times each must be whole. The fundamental always is.
    noise, seed
        Standard deviation of white noise on the samples of the response, in its unit, and the seed of the generator.

    Raises
    ------
    InputError
        Before any work; also if no load is sinusoidal with the frequency omega.
    ConvergenceError
        If the motion leaves the range of numbers.
    """
    how = checked_integration(system, options)
    test = _Test(
        system, how, omega, values, direction, start, transient, periods, tap, harmonics, noise, seed, system.n
    )
    shape, n = (len(test.directions), len(test.grid)), system.n
    out = SteppedSine(
        test.grid, test.directions, test.multiples, np.full((*shape, len(test.multiples), n), np.nan, dtype=complex),
        np.full((*shape, n), np.nan, dtype=complex), np.full((*shape, n), np.nan), np.full(shape, -1),
        np.full((*shape, 2 * n), np.nan), np.full(shape[0], np.nan), True,
        test.transient, test.periods, float(noise), how.observe, system,
    )  # fmt: skip
    with reporting(options.get("progress"), "stepped sine") as report:
        try:
            test.run(out, report)
        except KeyboardInterrupt as cause:
            out.complete, out.interruption = False, Interruption.of(cause)
    return out


def check_stepped_sine(system: System, omega: Any, observe: int | str | None = None, **arguments: Any) -> None:
    """Refuse arguments of `stepped_sine`; nothing is computed.

    How many modes a large structure is integrated in is not known yet: what is too much for them the verb says.
    """
    how, fewest = checked_integration(system, {"observe": observe}), min(system.n, COMPLETE)
    _Test(system, how, omega, **{"seed": 0, "coordinates": fewest, **arguments})


@dataclass
class _Test:
    """The arguments of `stepped_sine`, once they have been checked."""

    system: System
    how: Integration
    omega: Any
    values: int | Sequence[float]
    direction: str | Sequence[str]
    start: Any
    transient: int
    periods: int
    tap: Any
    harmonics: Sequence[float]
    noise: float
    seed: int
    coordinates: int

    def __post_init__(self) -> None:
        self.begin = start_state(self.system, self.start)
        self.grid = checked_grid("omega", self.omega, self.values)
        self.directions = checked_directions(self.direction, _DIRECTIONS)
        self.transient, self.periods = check_count("transient", self.transient), check_count("periods", self.periods)
        self.multiples = _multiples(self.harmonics, self.periods)
        if not (is_number(self.noise) and self.noise >= 0.0):
            raise InputError(
                f"noise must be a standard deviation in the unit of the response, 0 or more, not {self.noise!r}"
            )
        refuse_idle("noise is 0; give noise=, or leave seed out", seed=not self.noise and self.seed != 0)
        try:
            self.random = np.random.default_rng(self.seed)
        except (TypeError, ValueError):
            raise InputError(f"seed must be a whole number, 0 or more, not {shortened(self.seed)}") from None
        _loads(self.system, float(self.grid[0]))
        tests, size = len(self.grid) * len(self.directions), 2 * self.coordinates
        check_extent(tests, self.transient + self.periods, tests * size * (len(self.multiples) + 3))
        self.tapped = _tap(self.system, self.tap, self.grid)

    def run(self, out: SteppedSine, report: Report | None) -> None:
        """All directions side by side, step by step."""
        count, n = len(self.grid), self.system.n
        settling, measured = (
            Flow(self.system, "accurate", samples, tolerance=self.how.tolerance, lanes=FEW) for samples in (1, _SAMPLES)
        )
        up = np.array([direction == "up" for direction in self.directions])
        states = np.repeat(self.begin[None], len(up), axis=0)
        for step in range(count):
            columns = np.where(up, step, count - 1 - step)
            w = self.grid[columns]
            if self.tapped is not None:
                at, dof, change = self.tapped
                now = np.where(up, w >= at, w <= at) & np.isnan(out.tapped)
                if now.any():
                    states[now] = (
                        settling.over(states[now], w[now], self.transient, skip=self.transient, workers=1).checked().end
                    )
                    states[now, n + dof] += change
                    out.tapped[now] = w[now]
            states = settling.over(states, w, self.transient, skip=self.transient, workers=1).checked().end
            motions = measured.over(states, w, self.periods, measure=True, workers=1).checked()
            states = motions.end.copy()
            for s, v in enumerate(columns):
                x, peaks = motions.states[s], motions.peaks[s]
                largest = peaks.reshape(self.periods, -1, n).max(axis=1)
                settled = attractor_of(
                    self.system, x[_SAMPLES - 1 :: _SAMPLES], largest, float(w[s]), self.system.parameters,
                    self.how.period_tolerance, self.how.observe,
                )  # fmt: skip
                out.period[s, v], out.largest[s, v], out.ends[s, v] = settled.period, largest.max(axis=0), states[s]
                # what turns is measured without its drift
                rate = np.array(settled.turns) @ self.system.turns.rows / max(settled.period, 1) / _SAMPLES
                steady = x[:, :n] - np.multiply.outer(np.arange(1.0, len(x) + 1.0), rate)
                samples = steady + (self.random.normal(0.0, self.noise, (len(x), n)) if self.noise else 0.0)
                out.components[s, v], out.response[s, v] = self._measured(samples, float(w[s]))
            if report is not None:
                report((step + 1) / count, f"omega = {w[0]:.6g}")

    def _measured(self, x: Array, omega: float) -> tuple[ComplexArray, ComplexArray]:
        """Components (K, n), and the fundamental (n,) by cross- over auto-spectrum."""
        # samples lie at the ends of the intervals: the first at phase 2 pi / samples
        turn = np.arange(1, len(x) + 1) / _SAMPLES
        scale = np.where(self.multiples == 0.0, 1.0, 2.0)
        waves = np.exp(-2j * np.pi * np.outer(self.multiples, turn))
        components = (waves @ x) * (scale / len(x))[:, None]
        load = _loads(self.system, omega)
        phase = 2.0 * np.pi * turn
        p = np.real(load * np.exp(1j * phase))
        carrier = np.exp(-1j * phase)
        per_period = (2.0 / _SAMPLES) * (carrier[:, None] * x).reshape(self.periods, _SAMPLES, -1).sum(axis=1)
        loads = (2.0 / _SAMPLES) * (carrier * p).reshape(self.periods, _SAMPLES).sum(axis=1)
        cross = np.sum(per_period * np.conj(loads)[:, None], axis=0)
        return components, abs(load) * cross / np.sum(np.abs(loads) ** 2)


def _loads(system: System, omega: float) -> complex:
    """Complex amplitude of the reference: the first load with the frequency omega."""
    values = {**system.parameters, "omega": omega}
    for component in system.load_components():
        if component.harmonic == 1:
            amplitude, phase = component.amplitude.value(values), component.phase.value(values)
            if amplitude != 0.0:
                return complex(amplitude * np.exp(1j * phase))
    raise InputError(
        "a stepped-sine test needs a load with the frequency omega (harmonic=1) whose amplitude is not zero"
    )


def _multiples(harmonics: Sequence[float], periods: int) -> Array:
    try:
        array = np.atleast_1d(np.asarray(list(harmonics), dtype=float))
    except (TypeError, ValueError, OverflowError):
        array = np.array([np.nan])
    if not array.size or not np.isfinite(array).all() or (array < 0.0).any() or (array >= _SAMPLES / 4).any():
        raise InputError(f"harmonics must be multiples of omega from 0 to {_SAMPLES // 4 - 1}, not {harmonics!r}")
    whole = array * periods
    if (np.abs(whole - whole.round()) > 1e-9).any():
        raise InputError(
            f"harmonics={harmonics!r}: {periods} measured periods hold no whole number of each; change periods"
        )
    return np.unique(np.append(array, 1.0))


def _tap(system: System, tap: Any, grid: Array) -> tuple[float, int, float] | None:
    if tap is None:
        return None
    if not isinstance(tap, tuple | list) or len(tap) != 3 or not (is_number(tap[0]) and is_number(tap[2])):
        raise InputError(f"tap must be (omega, dof, change of velocity), not {tap!r}")
    if not grid[0] <= tap[0] <= grid[-1]:
        raise InputError(f"tap: omega = {tap[0]:g} is not within the test, {grid[0]:g} to {grid[-1]:g}")
    return float(tap[0]), observed_dof(system, tap[1]), float(tap[2])


@checked(result=True)
@dataclass(eq=False, repr=False)
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

    The table has one row per measured step: direction, omega, amplitude and phase of the fundamental, others, period.
    """

    contents = "stepped sine"
    dimensions: ClassVar[Mapping[str, str]] = {"largest": "length", "phase_deg": "°"}
    picture = "plot_stepped_sine"
    omega: Annotated[Array, On("omega")]
    directions: Annotated[tuple[str, ...], On("direction", name="direction")]
    multiples: Annotated[Array, On("multiple", name="multiple")]
    components: Annotated[ComplexArray, On("direction", "omega", "multiple", "dof", name="component")]
    response: Annotated[ComplexArray, On("direction", "omega", "dof")]
    largest: Annotated[Array, PeaksOn("direction", "omega", "dof")]
    period: Annotated[NDArray[np.int_], On("direction", "omega")]
    ends: Annotated[Array, On("direction", "omega", "state")]
    tapped: Annotated[Array, On("direction")]
    complete: bool
    transient: int
    periods: int
    noise: float
    observed: int
    system: System

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

    def _columns(self) -> Mapping[str, Any]:
        s, v = np.nonzero(self.period >= 0)
        x, others = self.response[s, v, self.observed], self.components[s, v, :, self.observed].T
        columns = {"direction": np.array(self.directions)[s], "omega": self.omega[v]}
        columns |= {"amplitude": np.hypot(x.real, x.imag), "phase_deg": np.degrees(np.angle(x))}
        parts = zip(self.multiples, others, strict=True)
        columns |= {f"harmonic_{k:g}": np.hypot(c.real, c.imag) for k, c in parts if k != 1.0}
        return columns | {"largest": self.largest[s, v, self.observed], "period": self.period[s, v]}

    def plot(self, path: Any = None, curves: Any = None, measured: Any = None, **options: Any) -> Any:
        """Draw the measured fundamentals, over branches and beside data of a rig if any are given; saved to a path.

        Options are those of `pictures.plot_stepped_sine`: `harmonic`, `dof`, `title`, `size`.
        """
        return super().plot(path, curves=curves, measured=measured, **options)

    def _in_words(self) -> str:
        done, settled = int((self.period >= 0).sum()), int((self.period > 0).sum())
        taps = [f", tapped at omega = {w:.6g} on the way {d}" for w, d in zip(self.tapped, self.directions, strict=True)
                if np.isfinite(w)]  # fmt: skip
        return (
            f"SteppedSine(omega from {self.omega[0]:g} to {self.omega[-1]:g}, {' and '.join(self.directions)}, "
            f"{done} steps, {settled} of them settled{''.join(taps)}{'' if self.complete else ', not complete'})"
        )
