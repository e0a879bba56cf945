"""`lyapunov_map`: the largest Lyapunov exponent over the frequency and a parameter, every point by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Protocol, Unpack, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from suboctave.arguments import Count, Index, Positive, Range, checked
from suboctave.errors import InputError
from suboctave.experiments.common import (
    On,
    SideBySideOptions,
    TimeResult,
    check_continuous,
    of_structures,
)
from suboctave.experiments.grids import checked_grid, varied_grid
from suboctave.experiments.lyapunov import over_stretches, smooth_weights
from suboctave.model.elements.base import Array
from suboctave.model.inputs import start_state, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.progress import reporting
from suboctave.store.layout import parameter_column
from suboctave.timedomain.flow import Flow, check_extent

#: stretches that one trajectory is cut into
_STRETCHES = 8
#: what an exponent must be at least to count as chaos: standard errors, and a share of the frequency
_SURE, _LEAST = 3.0, 1e-3


@runtime_checkable
class CriticalCurve(Protocol):
    """A curve of bifurcations of one kind, of motions of period `nu` T."""

    kind: str
    nu: int
    omega: Array

    def parameter(self, name: str) -> Array:
        """Values of a parameter along the curve."""


@checked(result=True)
@dataclass(eq=False, repr=False)
class LyapunovMap(TimeResult):
    """The largest Lyapunov exponent over frequency and a parameter.

    Attributes
    ----------
    omega, values
        (W,) and (V,), increasing.
    exponent
        (V, W): natural logarithm per unit of time; NaN where nothing was computed or the motion left the range of
        numbers.
    standard_error
        (V, W): from eight stretches of the one trajectory.
    complete
        False where an interruption (Ctrl-C) left points out.

    The table has one row per point.
    """

    contents = "lyapunov map"
    dimensions: ClassVar[Mapping[str, str]] = {"exponent": "1 / time", "standard_error": "1 / time"}
    picture = "plot_lyapunov_map"
    name: Annotated[str, On(name="varied")]
    omega: Annotated[Array, On("omega")]
    values: Annotated[Array, On("value", name="value")]
    exponent: Annotated[Array, On("value", "omega")]
    standard_error: Annotated[Array, On("value", "omega")]
    complete: bool
    periods: int
    transient: int
    system: System

    @property
    def chaotic(self) -> NDArray[np.bool_]:
        """(V, W): positive by more than three standard errors, and by more than a thousandth of the frequency."""
        with np.errstate(invalid="ignore"):
            return self.exponent > np.maximum(_SURE * self.standard_error, _LEAST * self.omega)

    def _derived(self) -> Mapping[str, Any]:
        return {"chaotic": (("value", "omega"), self.chaotic)}

    def _columns(self) -> Mapping[str, Any]:
        value, omega = np.meshgrid(self.values, self.omega, indexing="ij")
        own = {"exponent": self.exponent, "standard_error": self.standard_error, "chaotic": self.chaotic}
        columns = {"omega": omega, parameter_column(self.name, own): value, **own}
        return {name: table.ravel() for name, table in columns.items()}

    def plot(self, path: Any = None, curves: Any = (), **options: Any) -> Any:
        """The map in colours, tracked curves of bifurcations over it if any are given; saved if a path is given.

        Options are those of `pictures.plot_lyapunov_map`: `title`, `size`.
        """
        lines = []
        for curve in [curves] if isinstance(curves, CriticalCurve) else curves:
            if not isinstance(curve, CriticalCurve):
                raise InputError(f"curves= takes tracked curves of bifurcations, not {type(curve).__name__}")
            period = f"{curve.nu}T" if curve.nu > 1 else "T"
            lines.append((f"{curve.kind} of {period}", curve.omega, curve.parameter(self.name)))
        return super().plot(path, lines=lines, **options)

    def _in_words(self) -> str:
        share = float(self.chaotic.mean())
        return (
            f"LyapunovMap(omega from {self.omega[0]:g} to {self.omega[-1]:g}, {self.name} from {self.values[0]:g} to "
            f"{self.values[-1]:g}, {len(self.omega)} x {len(self.values)} points, {100 * share:.3g} % chaotic"
            f"{'' if self.complete else ', not complete'})"
        )


@with_options(SideBySideOptions)
@timed
@of_structures
def lyapunov_map(
    system: System,
    omega: Range,
    parameter: str,
    bounds: Range,
    *,
    grid: tuple[int | Sequence[float], int | Sequence[float]] = (60, 40),
    start: Any = None,
    parameters: Mapping[str, float] | None = None,
    transient: Index = 200,
    periods: Count = 400,
    tolerance: Positive = 1e-8,
    **options: Unpack[SideBySideOptions],
) -> LyapunovMap:
    """The largest Lyapunov exponent over the frequency and a parameter; all processors work.

    Parameters
    ----------
    omega
        Range of frequencies `(from, to)`.
    parameter, bounds
        The parameter and its range `(from, to)`.
    grid
        How many frequencies and how many values of the parameter, evenly spread over the ranges; or these themselves.
    start
        Where every trajectory begins, (2n,), default rest. Where motions coexist, one of them is seen.
    transient, periods
        Periods of the load that are left out, and those averaged over.
    tolerance
        Local error relative to the size of the motion.
    parameters
        Other values of some parameters, by name.
    """
    first = start_state(system, start)
    system.check_parameter(parameter)
    fixed = system.read_values(parameters)
    if parameter in fixed:
        raise InputError(f"parameters= fixes {parameter}, which is to be varied")
    if periods < 2 * _STRETCHES:
        raise InputError(f"periods={periods}: take at least {2 * _STRETCHES}, for the standard errors")
    at = system.with_parameters(fixed) if fixed else system
    frequencies = checked_grid("omega", omega, grid[0], "grid[0]")
    _, _, column = varied_grid(at, float(frequencies[0]), parameter, bounds, grid[1])
    cells = len(frequencies) * len(column)
    check_extent(cells, transient + periods, 2 * cells * periods * system.n)
    check_continuous(at, first, float(frequencies[0]), {parameter: float(column[0])})
    flow = Flow(system, "accurate", tolerance=tolerance, tangents=1)
    shape = len(column), len(frequencies)
    varied: dict[str, Any] = {parameter: np.repeat(column, shape[1]), **fixed}
    with reporting(options.get("progress"), "Lyapunov map") as report:
        motions = flow.over(
            np.repeat(first[None], shape[0] * shape[1], axis=0), np.tile(frequencies, shape[0]), transient + periods,
            varied, transient, workers=options.get("workers"), report=report,
        )  # fmt: skip
    per_time = frequencies / (2.0 * np.pi)
    mean, error = (part.reshape(shape) * per_time for part in _averaged(motions.growth[:, :, 0]))
    complete = bool(motions.finished.all())
    result = LyapunovMap(parameter, frequencies, column, mean, error, complete, periods, transient, at)
    result.interruption = motions.interruption
    return result


def _averaged(growth: Array) -> tuple[Array, Array]:
    """Mean growth (B,) per period and its standard error, from growths (B, P) cut into stretches."""
    each = over_stretches(growth[:, :, None], _STRETCHES)[..., 0]
    means, errors = each.mean(axis=2), each.std(axis=2, ddof=1) / np.sqrt(_STRETCHES)
    # over the whole trajectory it is better still; what it differs by is what all stretches may have in common
    whole = growth @ smooth_weights(growth.shape[1])
    errors[1], means[1] = np.maximum(errors[1], np.abs(whole - means[1])), whole
    # stretches of a regular motion may all be wrong by the same
    errors[0] = np.maximum(errors[0], np.abs(whole - means[0]))
    smooth = errors[1] < 0.5 * errors[0]  # the less of two estimates of few stretches is smaller by chance, too
    return np.where(smooth, means[1], means[0]), np.where(smooth, errors[1], errors[0])
