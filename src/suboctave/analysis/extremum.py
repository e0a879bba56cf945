"""An extremum along a curve of bifurcations located by Newton's method, in two formulations.

With `Y(U, q) = 0`, `U = (X, extra, p)`, the equations of the curve and q the parameter that is extreme:

    bordered      [Y; h] = 0, of limit points [R; g; psi . R_p] = 0          (`bifurcation.extremum`)
    alcorta2019   [Y; Y_U Psi; Psi . Psi - 1] = 0 in (U, Psi, q)             (Nonlinear Dynamics 98, 2019, Eq. 32-37)

The second doubles the unknowns. Its Jacobian holds `d(Y_U Psi)/d(U, q)`, which is the derivative of `Y_(U, q)` along
Psi: two more Jacobians give it, whatever Y is. A cusp solves it too; the first, of limit points, does not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suboctave.analysis.checks import make_settings
from suboctave.analysis.making import own_linear_part
from suboctave.analysis.track_start import (
    curve_through,
    discretisation,
    is_extremum,
    spans_of,
    with_extremum,
)
from suboctave.analysis.tracked_curve import TrackedCurve
from suboctave.analysis.tracked_events import Found
from suboctave.analysis.tracked_located import as_event
from suboctave.analysis.tracked_sample import TrackedSample, nearest_point
from suboctave.analysis.tracked_tests import Extremum
from suboctave.bifurcation.formulation import Alcorta2019, BorderedSystem, Formulation, formulation_of
from suboctave.bifurcation.tracked import TrackedEvent
from suboctave.compiled import computation_begins
from suboctave.continuation import NewtonOptions
from suboctave.continuation.linear import Factor, length, one_thread
from suboctave.continuation.problem import Array
from suboctave.errors import ConvergenceError, InputError, shortened
from suboctave.harmonic.balance import HarmonicBalance
from suboctave.interruption import check_time, limited

__all__ = ["locate_extremum", "newton_extremum"]

#: step of the differences along Psi, in units of the motion and of the parameters' ranges
_STEP = 3e-5
#: correction in scaled arclength below which what is left is rounding
_ROUNDING = 1e-11
_ITERATIONS = 12


@limited
def locate_extremum(
    extremum: TrackedEvent,
    *,
    formulation: Formulation | str | None = None,
    newton: NewtonOptions | None = None,
    seconds: float | None = None,
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
    seconds
        Time limit, after which a TimeLimitError is raised.

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
    orbit, context = extremum.orbit, extremum.context or {}
    observe = context.get("observe")
    settings = make_settings(orbit.system, None, observe, (), newton, None, context.get("stability"))
    names = (extremum.names[0], extremum.names[1])
    computation_begins()
    with one_thread():
        _, basis = discretisation(orbit.basis, max(1, orbit.basis.harmonics // orbit.basis.nu))
        if basis.harmonics < orbit.basis.harmonics:
            basis = orbit.basis.filled
        balance = HarmonicBalance(orbit.system, basis, linear=own_linear_part(orbit))
        curve, u = curve_through(extremum, balance, None, names, spans_of(extremum, names, None))
        options = replace(settings.newton, iterations=max(_ITERATIONS, settings.newton.iterations))
        u = newton_extremum(curve, u, extremum.parameter_name, options, chosen)
        found = Found(Extremum(extremum.parameter_name), _sample(curve, u, options), extremum.extreme)
        event = as_event(found, settings.stability, settings.observe)
    return replace(event, arclength=extremum.arclength, context=extremum.context)


def newton_extremum(
    curve: TrackedCurve, u: Array, turning: str, newton: NewtonOptions, formulation: Formulation | None = None
) -> Array:
    """u at the extremum of a parameter along a curve of bifurcations in two parameters, from a guess near it.

    Raises
    ------
    ConvergenceError
        If Newton's method does not converge.
    """
    weights = curve.weights(u, 0.0)
    # from a point of the curve both systems need but follow it
    u = nearest_point(curve, u, weights, newton).u
    published = isinstance(formulation, Alcorta2019)
    solve = _Published(curve, u, turning, weights) if published else _Bordered(curve, u, turning, weights)
    size = np.inf
    for _ in range(newton.iterations + 1):
        check_time()
        step, error = solve.step(u)
        before, size = size, length(weights * step)
        if error <= newton.tolerance and (size <= _ROUNDING or (size <= newton.correction and size > 0.1 * before)):
            return u
        u = u - step
        if size <= newton.correction and size**2 <= _ROUNDING and solve.error(u) <= newton.tolerance:
            return u
        if not np.isfinite(size) or size > 1e3:
            break
    raise ConvergenceError(f"Newton's method for the extremum of {turning} near {curve.where(u)} did not converge")


class _Bordered:
    """`[Y; h] = 0`, with the bordering vectors of the guess."""

    def __init__(self, curve: TrackedCurve, u: Array, turning: str, weights: Array) -> None:
        self.curve = with_extremum(curve, u, turning, (curve.names[0], curve.names[1]))
        self.weights = weights

    def step(self, u: Array) -> tuple[Array, float]:
        """What Newton's method takes from u, and the residual there."""
        evaluation = self.curve.evaluate(u)
        factor = Factor.of(evaluation.jacobian / self.weights)
        if factor.singular:
            raise ConvergenceError(f"the extremum at {self.curve.where(u)} is degenerate")
        return factor.solve(evaluation.residual) / self.weights, evaluation.error

    def error(self, u: Array) -> float:
        """The residual at u."""
        return self.curve.evaluate(u).error


class _Published:
    """`[Y; Y_U Psi; Psi . Psi - 1] = 0`, U in units of `weights`."""

    def __init__(self, curve: TrackedCurve, u: Array, turning: str, weights: Array) -> None:
        self.curve, self.weights = curve, weights
        self.turning = curve.index(turning)
        self.kept = np.array([i for i in range(len(u)) if i != self.turning])
        m = (curve.evaluate(u).jacobian / weights)[:, self.kept]
        self.psi: Array = np.linalg.svd(m)[2][-1]

    def step(self, u: Array) -> tuple[Array, float]:
        """See `_Bordered.step`; Psi takes its step at once."""
        evaluation = self.curve.evaluate(u)
        jacobian = evaluation.jacobian / self.weights
        along = np.zeros(len(u))
        along[self.kept] = _STEP * self.psi / self.weights[self.kept]
        ahead, behind = (self.curve.evaluate(u + s * along).jacobian / self.weights for s in (1.0, -1.0))
        second = (ahead - behind) / (2.0 * _STEP)
        m, psi = len(jacobian), self.psi
        matrix, by_turning = jacobian[:, self.kept], jacobian[:, self.turning]
        whole = np.zeros((2 * m + 1, 2 * m + 1))
        whole[:m, :m], whole[:m, -1] = matrix, by_turning
        whole[m:-1, :m], whole[m:-1, m:-1], whole[m:-1, -1] = second[:, self.kept], matrix, second[:, self.turning]
        whole[-1, m:-1] = 2.0 * psi
        factor = Factor.of(whole)
        if factor.singular:
            raise ConvergenceError(f"the extremum at {self.curve.where(u)} is degenerate")
        turned = matrix @ psi
        solved = factor.solve(np.concatenate((evaluation.residual, turned, [psi @ psi - 1.0])))
        self.psi = psi - solved[m:-1]
        step = np.empty(len(u))
        step[self.kept], step[self.turning] = solved[:m], solved[-1]
        size = max(evaluation.error, length(turned) / float(np.abs(matrix).max()))
        return step / self.weights, size

    def error(self, u: Array) -> float:
        """The residual of Y at u."""
        return self.curve.evaluate(u).error


def _sample(curve: TrackedCurve, u: Array, newton: NewtonOptions) -> TrackedSample:
    return TrackedSample(nearest_point(curve, u, curve.weights(u, 0.0), newton))
