"""An extremum along a curve of bifurcations located by Newton's method, in two formulations.

With `Y(U, q) = 0`, `U = (X, extra, p)`, the equations of the curve and q the parameter that is extreme:

    bordered      [Y; h] = 0, of limit points [R; g; psi . R_p] = 0          (`bifurcation.extremum`)
    alcorta2019   [Y; Y_U Psi; Psi . Psi - 1] = 0 in (U, Psi, q)             (Nonlinear Dynamics 98, 2019, Eq. 32-37)

The second doubles the unknowns. Its Jacobian holds `d(Y_U Psi)/d(U, q)`, which is the derivative of `Y_(U, q)` along
Psi: two more Jacobians give it, whatever Y is. A cusp solves it too; the first, of limit points, does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np

from suboctave.analysis.options import Inherited, settings_of
from suboctave.bifurcation.bifurcation import TrackedEvent
from suboctave.continuation import NewtonOptions
from suboctave.continuation.linear import length, one_thread
from suboctave.continuation.newton import correct
from suboctave.continuation.problem import Array
from suboctave.curves.events.formulation import Alcorta2019, BorderedSystem, Formulation, formulation_of
from suboctave.curves.motion import MotionProblem
from suboctave.curves.sample import Sample
from suboctave.curves.tracked.events import LocatedEvent, as_event, nearest_point
from suboctave.curves.tracked.start import curve_through, is_extremum, with_extremum
from suboctave.curves.tracked.tests import Extremum
from suboctave.errors import InputError, shortened
from suboctave.interruption import limited
from suboctave.options import RunOptions, with_options
from suboctave.progress import reporting

#: step of the differences along Psi, in units of the motion and of the parameters' ranges
_STEP = 3e-5
#: last correction in scaled arclength, at most
_CORRECTION = 1e-9
_ITERATIONS = 12


@with_options(RunOptions)
@limited
def locate_extremum(
    extremum: TrackedEvent,
    *,
    formulation: Formulation | str | None = None,
    newton: NewtonOptions | None = None,
    **options: Unpack[RunOptions],
) -> TrackedEvent:
    """An extremum of a parameter along a curve of bifurcations, solved for by Newton's method from one that is known.

    Parameters
    ----------
    extremum
        One of the `extrema` of a tracked curve in two parameters: the guess.
    formulation
        "bordered" (default) or "alcorta2019", the system of Alcorta et al. (Nonlinear Dynamics 98, 2019, Eq. 32).
    newton
        Tolerances and number of iterations.

    Raises
    ------
    InputError
        Wrong input, before any work.
    ConvergenceError
        If Newton's method does not converge.
    """
    if not is_extremum(extremum):
        given = shortened(extremum)
        raise InputError(f"locate_extremum starts from one of the .extrema of a tracked curve, not {given}")
    if len(extremum.names) != 2:
        raise InputError(f"this extremum lies on a curve in {', '.join(extremum.names)}: give one in two parameters")
    chosen = formulation_of(formulation)
    if not isinstance(chosen, BorderedSystem | Alcorta2019):
        raise InputError(f'of extrema there are the formulations "bordered" and "alcorta2019", not {chosen.name!r}')
    orbit, inherited = extremum.orbit, Inherited(extremum)
    kept = {"observe": inherited.observe, "stability": inherited.known.get("stability")}
    settings = settings_of(orbit.system, {**kept, "newton": newton})
    names = (extremum.names[0], extremum.names[1])
    with one_thread(), reporting(options.get("progress"), "extremum") as report:
        if report is not None:
            report(0.0, repr(extremum))
        curve, u = curve_through(extremum, orbit.basis, names)
        newton = replace(settings.newton, iterations=max(_ITERATIONS, settings.newton.iterations))
        weights = curve.weights(u, 0.0)
        # from a point of the curve both systems need but follow it
        u = nearest_point(curve, u, weights, newton).u
        last = replace(newton, correction=min(newton.correction, _CORRECTION), rounding=True)
        if isinstance(chosen, Alcorta2019):
            published = _Published(curve, extremum.parameter_name, weights)
            u = correct(published, published.first(u), None, published.scale, last).u[: len(u)]
        else:
            u = correct(with_extremum(curve, u, extremum.parameter_name), u, None, weights, last).u
        sample = Sample(nearest_point(curve, u, curve.weights(u, 0.0), newton))
        located = LocatedEvent(Extremum(extremum.parameter_name), sample, extremum.extreme)
        event = as_event(located, settings.stability, settings.observe)
    return replace(event, arclength=extremum.arclength, context=extremum.context)


@dataclass(frozen=True, eq=False)
class _PublishedEvaluation:
    """`[Y; M Psi; Psi . Psi - 1]` and its derivatives at one (u, Psi), M = Y_U in scaled unknowns."""

    residual: Array
    jacobian: Array
    error: float


class _Published:
    """`[Y; Y_U Psi; Psi . Psi - 1] = 0` in (u, Psi), U in units of `weights`."""

    def __init__(self, curve: MotionProblem, turning: str, weights: Array) -> None:
        self.curve, self.weights = curve, weights
        turn = curve.index(turning)
        self.kept = np.array([i for i in range(len(weights)) if i != turn])
        self.scale = np.concatenate((weights, np.ones(len(self.kept))))
        self.parameter = curve.parameter

    def first(self, u: Array) -> Array:
        """u with the singular vector of M there."""
        m = (self.curve.evaluate(u).jacobian / self.weights)[:, self.kept]
        return np.concatenate((u, np.linalg.svd(m)[2][-1]))

    def where(self, u: Array) -> str:
        return self.curve.where(u[: len(self.weights)])

    def evaluate(self, u: Array) -> _PublishedEvaluation:
        n, psi = len(self.weights), u[len(self.weights) :]
        here = self.curve.evaluate(u[:n])
        along = np.zeros(n)
        along[self.kept] = _STEP * psi / self.weights[self.kept]
        ahead, behind = (self.curve.evaluate(u[:n] + s * along).jacobian for s in (1.0, -1.0))
        m = (here.jacobian / self.weights)[:, self.kept]
        turned = m @ psi
        jacobian = np.zeros((2 * len(m) + 1, n + len(psi)))
        jacobian[: len(m), :n] = here.jacobian
        jacobian[len(m) : -1, :n], jacobian[len(m) : -1, n:] = (ahead - behind) / (2.0 * _STEP), m
        jacobian[-1, n:] = 2.0 * psi
        error = max(here.error, length(turned) / float(np.abs(m).max()))
        return _PublishedEvaluation(np.concatenate((here.residual, turned, [psi @ psi - 1.0])), jacobian, error)
