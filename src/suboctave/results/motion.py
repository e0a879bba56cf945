"""Answers of single motions (`suboctave.motion`): stability, picture, components, and samples over a period."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation.linear import one_thread
from suboctave.errors import GivenDof, InputError, chosen_dof
from suboctave.floquet.methods import method_of
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import Array
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.model.inputs import check_count

if TYPE_CHECKING:
    import pandas

#: damping ratio up to which a mode is conservative: what Newton's tolerance leaves of it
_UNDAMPED = 1e-9
#: share of the largest component that is rounding
_ROUNDING = 1e-14


def floquet_of(orbit: PeriodicOrbit) -> FloquetResult:
    """Multipliers of a motion, as `suboctave.stability` gives them by default."""
    if abs(orbit.zeta) > _UNDAMPED:
        raise InputError(
            "a damped mode is a motion that only its fictitious damping keeps going: it has no multipliers of its own; "
            "ask the curve, curve.stable"
        )
    with one_thread():
        return method_of(None).multipliers(orbit.state())


def stable(motion: Any) -> bool:
    """See `Motion.stable`."""
    if isinstance(motion, Bifurcation):
        mu, critical = motion.multipliers, motion.critical_multiplier()
        distance = np.minimum(np.abs(mu - critical), np.abs(mu - np.conj(critical)))
        return motion.floquet.inside(_but(distance, 1 if abs(critical.imag) < 1e-6 * abs(critical) else 2))
    curve = getattr(motion, "curve", None)
    if curve is not None:
        return bool(curve.stable_at(motion))
    orbit = _orbit(motion)
    result: FloquetResult = motion.floquet
    if orbit.system.driven or not np.any(orbit.x[1:]):
        return result.stable and not result.vague
    # of what nothing drives one multiplier is +1 by itself, of a conservative motion two
    return result.inside(_but(np.abs(result.multipliers - 1.0), 2 if result.undamped else 1))


def _but(distance: Array, count: int) -> NDArray[np.bool_]:
    """All but so many of the nearest ones."""
    others = np.ones(len(distance), dtype=bool)
    others[np.argsort(distance, kind="stable")[:count]] = False
    return others


def plot(motion: Any, path: Any, options: Mapping[str, Any]) -> Any:
    """See `Motion.plot`."""
    from suboctave.pictures import plot_history

    return plot_history(motion, path, **options)


def cell(motion: Any) -> str:
    """What a notebook shows of it."""
    from suboctave.pictures.cells import cell_of

    return cell_of(motion)


def spectrum(motion: Any, dof: GivenDof | None) -> pandas.DataFrame:
    """See `Motion.spectrum`."""
    import pandas as pd

    orbit = _orbit(motion)
    system = orbit.balance.system
    which = chosen_dof(dof, observed_of(motion), system.n, names=system.dof_names)
    multiples = orbit.basis.multiples
    c = orbit.amplitudes[:, which]
    # the mean has no phase, nor has what is rounding
    phase = np.where((multiples == 0.0) | (np.abs(c) <= _ROUNDING * np.abs(c).max()), np.nan, np.angle(c))
    table = {"harmonic": multiples, "omega": multiples * orbit.omega}
    return pd.DataFrame(table | {"hertz": table["omega"] / (2.0 * math.pi), "amplitude": np.abs(c), "phase": phase})


def to_dataframe(motion: Any, samples: int) -> pandas.DataFrame:
    """See `Motion.to_dataframe`."""
    import pandas as pd

    orbit = _orbit(motion)
    time = np.linspace(0.0, orbit.period, check_count("samples", samples, 2))
    system = orbit.balance.system
    names = system.dof_names or [str(i) for i in range(system.n)]
    table = {"time": time}
    for letter, values in (("x", orbit.displacement(time)), ("v", orbit.velocity(time))):
        table |= {f"{letter}_{name}": row for name, row in zip(names, values, strict=True)}
    return pd.DataFrame(table)


def observed_of(motion: Any) -> int:
    """The degree of freedom that is observed where a motion was found, else the system's."""
    known = getattr(getattr(motion, "curve", None), "observe", None)
    context = getattr(motion, "context", None) or {}
    known = context.get("observe") if known is None else known
    return int(_orbit(motion).balance.system.observed_dof if known is None else known)


def _orbit(motion: Any) -> PeriodicOrbit:
    orbit: PeriodicOrbit = motion if isinstance(motion, PeriodicOrbit) else motion.orbit
    return orbit
