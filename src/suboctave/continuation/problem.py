"""The contract between a curve and the engine that follows it.

A curve is the solution set of `F(u) = 0` with `dim u = dim F + 1` (or `dim F + p` while p - 1 rows are added by the
engine). The engine knows nothing of vibration: frequency responses, amplitude sweeps and tracked bifurcations are all
curves to it.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Evaluation(Protocol):
    """The equations at one u.

    It may have a method `takes_over(other)` that has it keep the derivatives of another evaluation a rounding away, if
    it can, and says so.
    """

    @property
    def residual(self) -> Array:
        """F, shape (N,)."""

    @property
    def jacobian(self) -> Array:
        """dF/du, shape (N, N + 1)."""

    @property
    def error(self) -> float:
        """Dimensionless size of the residual: 1 means as large as the terms that should balance."""


class Problem(Protocol):
    """Equations that Newton's method solves: as many as unknowns, or one fewer."""

    def evaluate(self, u: Array) -> Evaluation:
        """Equations and derivatives at u. May raise ConvergenceError where they do not exist."""

    def where(self, u: Array) -> str:
        """A place on the curve in words, for messages: 'omega = 2.31'."""


class Curve(Problem, Protocol):
    """A curve as the engine sees it. `parameter` is the index in u of the parameter that bounds and directions refer
    to.

    It may have an attribute `delicate`, true where its tangents ask for points as close as rounding allows, and a
    method `severed(point, u, evaluation)` that says, in words, where its equations are not finite between a point and
    u, which has been solved for if its evaluation is given. A method `regular(u)` gives other coordinates in which
    points beside u are solved for (`point.solved_point`), None where there u itself will do.
    """

    @property
    def parameter(self) -> int:
        """Index of the free parameter in u."""

    def weights(self, u: Array, largest: float) -> Array:
        """Scaled arclength: `|du| = norm(weights * du)`. `largest` is the largest `size` met on the branch so far."""

    def size(self, u: Array) -> float:
        """Size of the solution part of u (its amplitude), for the scaling of later steps."""

    def adapted(self, u: Array, evaluation: Evaluation) -> Curve:
        """The same curve, discretised as this point needs it (frozen until the next step); often simply itself."""

    def transfer(self, u: Array, origin: Curve) -> Array:
        """A point or tangent of `origin`, another discretisation of this curve, in this one."""

    def images(self, u: Array) -> list[Array]:
        """All vectors that stand for the same solution as u (u itself, and shifts in time where there are any)."""

    def unwrapped(self, u: Array, near: Array) -> Array:
        """The same u with periodic unknowns moved by whole periods next to those of `near`; where none is, u itself."""
