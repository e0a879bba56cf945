"""`lyapunov_map`: the largest Lyapunov exponent over the frequency and a parameter, every point by itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from suboctave.analysis.brute_force import _grid, _spread
from suboctave.analysis.checks import check_parameter, read_values
from suboctave.analysis.forces import check_forces
from suboctave.analysis.integration import _not_negative, start_state
from suboctave.analysis.lyapunov import smooth_weights
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.time_result import TimeResult
from suboctave.analysis.tracked_branch import TrackedBranch
from suboctave.errors import InputError
from suboctave.model.element import Array
from suboctave.model.system import System
from suboctave.store.columns import parameter_column
from suboctave.timedomain.batch import Flow, check_count, check_extent
from suboctave.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["LyapunovMap", "lyapunov_map"]

#: stretches that one trajectory is cut into
_STRETCHES = 8
#: what an exponent must be at least to count as chaos: standard errors, and a share of the frequency
_SURE, _LEAST = 3.0, 1e-3


@dataclass(eq=False)
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
    """

    name: str
    omega: Array
    values: Array
    exponent: Array
    standard_error: Array
    complete: bool
    periods: int
    transient: int
    system: System
    seconds: float = 0.0

    @property
    def chaotic(self) -> NDArray[np.bool_]:
        """(V, W): positive by more than three standard errors, and by more than a thousandth of the frequency."""
        with np.errstate(invalid="ignore"):
            return self.exponent > np.maximum(_SURE * self.standard_error, _LEAST * self.omega)

    def to_xarray(self) -> xarray.Dataset:
        """Exponent, its standard error and what counts as chaos on (value, omega)."""
        import xarray

        axes = ("value", "omega")
        return xarray.Dataset(
            {
                "exponent": (axes, self.exponent),
                "standard_error": (axes, self.standard_error),
                "chaotic": (axes, self.chaotic),
                "parameters": (("parameter",), np.array(list(self.system.parameters.values()), dtype=float)),
            },
            coords={"value": self.values, "omega": self.omega, "parameter": list(self.system.parameters)},
            attrs={
                "contents": "lyapunov map",
                "varied": self.name,
                "periods": self.periods,
                "transient": self.transient,
                "complete": int(self.complete),
                "system": self.system.name,
                "suboctave": __version__,
            },
        )

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per point: frequency, value, exponent, its standard error, whether it counts as chaos."""
        import pandas as pd

        value, omega = np.meshgrid(self.values, self.omega, indexing="ij")
        own = {"exponent": self.exponent, "standard_error": self.standard_error, "chaotic": self.chaotic}
        columns = {"omega": omega, parameter_column(self.name, own): value, **own}
        return pd.DataFrame({name: table.ravel() for name, table in columns.items()})

    def plot(self, path: Any = None, curves: Any = (), **options: Any) -> Any:
        """The map in colours, tracked curves of bifurcations over it if any are given; saved if a path is given.

        Options are those of `pictures.plot_lyapunov_map`: `title`, `size`.
        """
        from suboctave.pictures.chaos import plot_lyapunov_map

        lines = []
        for curve in [curves] if isinstance(curves, TrackedBranch) else curves:
            if not isinstance(curve, TrackedBranch):
                raise InputError(f"curves= takes tracked curves of bifurcations, not {type(curve).__name__}")
            lines.append(
                (
                    f"{curve.kind} of {curve.nu}T" if curve.nu > 1 else f"{curve.kind} of T",
                    curve.omega,
                    curve.parameter(self.name),
                )
            )
        return plot_lyapunov_map(self.to_xarray(), path, lines=lines, **options)

    def __repr__(self) -> str:
        share = float(self.chaotic.mean())
        return (
            f"LyapunovMap(omega from {self.omega[0]:g} to {self.omega[-1]:g}, {self.name} from {self.values[0]:g} to "
            f"{self.values[-1]:g}, {len(self.omega)} x {len(self.values)} points, {100 * share:.3g} % chaotic"
            f"{'' if self.complete else ', not complete'})"
        )


@timed
def lyapunov_map(
    system: System,
    omega: Any,
    *,
    parameter: str,
    values: Any,
    counts: tuple[int, int] = (60, 40),
    state: Any = None,
    parameters: Mapping[str, float] | None = None,
    transient: int = 200,
    periods: int = 400,
    tolerance: float = 1e-8,
    workers: int | None = None,
    progress: Any = None,
    seconds: float | None = None,
) -> LyapunovMap:
    """The largest Lyapunov exponent over the frequency and a parameter; all processors work.

    Parameters
    ----------
    omega, values
        Frequencies and values of `parameter`: ranges `(from, to)`, of which `counts` are taken, or all of an array.
    counts
        Of frequencies and of values.
    state
        Where every trajectory begins, (2n,), default rest. Where motions coexist, one of them is seen.
    transient, periods
        Periods of the load that are left out, and those averaged over.
    tolerance
        Local error relative to the size of the motion.
    parameters, workers, progress, seconds
        As in `poincare_sections`. The result does not depend on the number of workers.

    Raises
    ------
    InputError
        Before any work.
    """
    first = start_state(system, state)
    check_parameter(system, parameter)
    fixed = read_values(system, parameters)
    if parameter in fixed:
        raise InputError(f"parameters= fixes {parameter}, which is to be varied")
    if not (isinstance(counts, tuple | list) and len(counts) == 2):
        raise InputError(f"counts={counts!r}: give the number of frequencies and that of values, such as (60, 40)")
    transient, periods = _not_negative("transient", transient), check_count("periods", periods)
    if periods < 2 * _STRETCHES:
        raise InputError(f"periods={periods}: take at least {2 * _STRETCHES}, for the standard errors")
    cells = check_count("counts", counts[0]) * check_count("counts", counts[1])
    check_extent(cells, transient + periods, 2 * cells * periods * system.n)
    frequencies = _spread("omega", omega, check_count("counts", counts[0]), True)
    at = system.with_parameters(fixed) if fixed else system
    _, _, column = _grid(at, float(frequencies[0]), parameter, values, check_count("counts", counts[1]))
    check_forces(at, first, float(frequencies[0]), {parameter: float(column[0])})
    flow = Flow(system, "accurate", tolerance=tolerance, tangents=1)
    shape = len(column), len(frequencies)
    varied: dict[str, Any] = {parameter: np.repeat(column, shape[1]), **fixed}
    with reporting(progress, "Lyapunov map") as report:
        motions = flow.over(
            np.repeat(first[None], shape[0] * shape[1], axis=0), np.tile(frequencies, shape[0]), transient + periods,
            varied, transient, workers=workers, report=report,
        )  # fmt: skip
    assert motions.growth is not None
    length = periods // _STRETCHES
    cut = motions.growth[:, periods - _STRETCHES * length :, 0].reshape(-1, _STRETCHES, length)
    means, errors = [], []
    for weights in (np.full(length, 1.0 / length), smooth_weights(length)):
        told = cut @ weights
        means.append(told.mean(axis=1))
        errors.append(told.std(axis=1, ddof=1) / np.sqrt(_STRETCHES))
    # over the whole trajectory it is better still; what it differs by is what all stretches may have in common
    whole = motions.growth[:, :, 0] @ smooth_weights(periods)
    errors[1], means[1] = np.maximum(errors[1], np.abs(whole - means[1])), whole
    # stretches of a regular motion may all be wrong by the same
    errors[0] = np.maximum(errors[0], np.abs(whole - means[0]))
    smooth = errors[1] < 0.5 * errors[0]  # the less of two estimates of few stretches is smaller by chance, too
    per_time = np.tile(frequencies, shape[0]) / (2.0 * np.pi)
    mean, error = (np.where(smooth, two[1], two[0]) * per_time for two in (means, errors))
    found = LyapunovMap(
        parameter, frequencies, column, mean.reshape(shape), error.reshape(shape), bool(motions.finished.all()),
        periods, transient, at,
    )  # fmt: skip
    found.interruption = motions.interruption
    return found
